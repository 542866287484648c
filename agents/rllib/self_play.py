"""A recipe for RLlib: PPO plays against its past self, as two agents of the PettingZoo environment."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from agents.options import Count
from agents.rllib.recipe import RllibArgs, with_options

if TYPE_CHECKING:
    from ray.rllib.algorithms.ppo import PPOConfig

MODULE, PAST = "main", "past"
"""The module that learns, and the copy of it that plays the other side."""


@dataclass(frozen=True)
class RllibSelfPlayArgs(RllibArgs):
    """Train an agent with RLlib's PPO by self-play, and write everything into one folder, runs/NAME/.

    The same command continues a run. Its policy.npz plays in every command, for example in scripts.ladder.
    """

    name: str = "rllib-self-play"
    copy_every: Count = 10
    """Let the agent play against a copy of itself, which is renewed every this many updates."""
    num_envs: Count = 16
    """Play on this many tables in each process. RLlib steps them one by one."""


def make_config(args: RllibSelfPlayArgs) -> PPOConfig:
    """The whole configuration, for RLlib's own tools too."""
    from ray.rllib.algorithms.ppo import PPOConfig
    from ray.rllib.core.rl_module.multi_rl_module import MultiRLModuleSpec
    from ray.rllib.core.rl_module.rl_module import RLModuleSpec
    from ray.tune.registry import register_env

    def renew(algorithm: Any, **_: Any) -> None:
        if algorithm.iteration % args.copy_every == 0:
            algorithm.set_weights({PAST: algorithm.get_weights([MODULE])[MODULE]})

    register_env("AirHockeyParallelEnv", make_env)
    config = (
        PPOConfig()
        .environment("AirHockeyParallelEnv", env_config={"reward": args.reward})
        .env_runners(num_envs_per_env_runner=args.num_envs)
        .multi_agent(policies={MODULE, PAST}, policy_mapping_fn=module_of, policies_to_train=[MODULE])
        .callbacks(on_train_result=renew)
    )
    both = MultiRLModuleSpec(rl_module_specs={MODULE: RLModuleSpec(), PAST: RLModuleSpec()})
    return with_options(config.rl_module(rl_module_spec=both), args)


def make_env(arguments: dict[str, Any]) -> Any:
    """Make the environment for RLlib from the arguments of `AirHockeyParallelEnv`."""
    from ray.rllib.env.wrappers.pettingzoo_env import ParallelPettingZooEnv

    from airhockey_env.parallel_env import AirHockeyParallelEnv

    return ParallelPettingZooEnv(AirHockeyParallelEnv(**arguments))


def module_of(agent: str, episode: Any, **_: Any) -> str:
    """The module that plays an agent: each has both sides of the table in about half of the episodes."""
    main_is_left = int(episode.id_, 16) % 2 == 0
    return MODULE if (agent == "left") == main_is_left else PAST
