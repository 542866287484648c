"""Distil a policy from a teacher: python -m scripts.distill"""

from __future__ import annotations

from agents.training.distill import DistillArgs
from agents.training.train import own_args, train
from scripts._command import run_command


def main() -> None:
    """Read the command line and train."""
    run_command("distill", DistillArgs, train, own_args)


if __name__ == "__main__":
    main()
