"""Training: one trainer, its recipes, and the folders of runs."""
