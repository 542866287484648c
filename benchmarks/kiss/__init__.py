"""The parts of the kiss study (python -m scripts.kiss_study): one file a figure, one a peer engine."""
