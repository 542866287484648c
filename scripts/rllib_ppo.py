"""Train an agent with RLlib's PPO: python -m scripts.rllib_ppo"""

from __future__ import annotations

from agents.rllib.ppo import RllibPpoArgs
from agents.rllib.train import train
from scripts._command import run_command


def main() -> None:
    """Read the command line and train."""
    run_command("rllib_ppo", RllibPpoArgs, train)


if __name__ == "__main__":
    main()
