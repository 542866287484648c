"""A recipe for RLlib: PPO plays points against one opponent, on the native batch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from agents.rllib.recipe import RllibArgs, with_options

if TYPE_CHECKING:
    from ray.rllib.algorithms.ppo import PPOConfig

MODULE = "default_policy"
"""RLlib's name for the only module."""


@dataclass(frozen=True)
class RllibPpoArgs(RllibArgs):
    """Train an agent with RLlib's PPO against one opponent, and write everything into one folder, runs/NAME/.

    The same command continues a run. Its policy.npz plays in every command, for example in scripts.ladder.
    """

    name: str = "rllib-ppo"
    opponent: str = "striker"
    """Train against this opponent: a name, the path of a policy.npz, or the path of a run's folder."""


def make_config(args: RllibPpoArgs) -> PPOConfig:
    """The whole configuration, for RLlib's own tools too."""
    from ray.rllib.algorithms.ppo import PPOConfig

    env = {"opponent": args.opponent, "reward": args.reward, "num_threads": 1}  # an env runner has one processor
    return with_options(
        PPOConfig()
        .environment("airhockey_env:AirHockey-v0", env_config=env)
        .env_runners(num_envs_per_env_runner=args.num_envs, gym_env_vectorize_mode="vector_entry_point"),
        args,
    )
