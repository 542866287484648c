"""What plays and learns: PPO, evaluation, and the reports of runs. Used from a checkout, not installed."""
