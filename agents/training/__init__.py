"""Training: one trainer, its recipes, and the folders of runs. It needs torch and Stable-Baselines3."""

from agents.extras import need

need("agents.training", "torch", "stable_baselines3")
