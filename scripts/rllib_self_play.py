"""Train an agent with RLlib's PPO by self-play: python -m scripts.rllib_self_play"""

from __future__ import annotations

from agents.rllib.self_play import RllibSelfPlayArgs
from agents.rllib.train import train
from scripts._command import run_command


def main() -> None:
    """Read the command line and train."""
    run_command("rllib_self_play", RllibSelfPlayArgs, train)


if __name__ == "__main__":
    main()
