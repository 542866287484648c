"""Training on several processors: RLlib beside Stable-Baselines3, and a model of data-parallel training."""
