"""Train an agent with an algorithm of Stable-Baselines3: python -m scripts.train --algo sac --env AirHockeyDefend-v0"""

from __future__ import annotations

from agents.training.train import own_args, train
from agents.training.zoo import ZooArgs
from scripts._command import run_command


def main() -> None:
    """Read the command line and train."""
    run_command("train", ZooArgs, train, own_args)


if __name__ == "__main__":
    main()
