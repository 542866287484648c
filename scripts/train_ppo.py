"""Train an agent with PPO: python -m scripts.train_ppo"""

from __future__ import annotations

from agents.training.ppo import PpoArgs
from agents.training.train import own_args, train
from scripts._command import run_command


def main() -> None:
    """Read the command line and train."""
    run_command("train_ppo", PpoArgs, train, own_args)


if __name__ == "__main__":
    main()
