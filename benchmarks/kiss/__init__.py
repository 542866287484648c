"""The parts of the kiss study (python -m scripts.kiss_study): one file per figure and one per other engine."""
