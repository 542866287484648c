"""Train an agent with PPO: python -m scripts.train_ppo"""

from __future__ import annotations

import sys

import tyro

from agents.ppo import TrainArgs, train


def main() -> None:
    """Read the command line and train."""
    args = tyro.cli(TrainArgs, prog="python -m scripts.train_ppo")
    try:
        train(args)
    except (ValueError, OSError) as error:
        sys.exit(f"train_ppo: {error}")


if __name__ == "__main__":
    main()
