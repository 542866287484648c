"""The parts of the torture chamber (python -m scripts.torture): hostile play, the laws, and trials of the faces."""
