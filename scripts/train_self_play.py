"""Train an agent by self-play: python -m scripts.train_self_play"""

from __future__ import annotations

from agents.training.self_play import SelfPlayArgs
from agents.training.train import own_args, train
from scripts._command import run_command


def main() -> None:
    """Read the command line and train."""
    run_command("train_self_play", SelfPlayArgs, train, own_args)


if __name__ == "__main__":
    main()
