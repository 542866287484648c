"""What the recipes for RLlib share: their options, and what of RLlib's configuration these set."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

from agents.options import Address, Count, Workers

if TYPE_CHECKING:
    from ray.rllib.algorithms.ppo import PPOConfig

Config = TypeVar("Config", bound="PPOConfig")

ACTIVATION = "relu"


@dataclass(frozen=True)
class RllibArgs:
    """The options of the recipes for RLlib."""

    name: str = "rllib"
    """Write the run into runs/NAME/."""
    steps: Count = 1_000_000
    """Train for this many environment steps in all."""
    seed: int = 0
    """Seed the network, the exploration and the tables. RLlib does not promise equal runs for equal seeds."""
    reward: str = "shaped"
    """Learn from this reward: "sparse" (points alone) or "shaped"."""
    num_envs: Count = 64
    """Play on this many tables at once in each process."""
    batch: Count = 8192
    """Learn from this many steps at a time."""
    minibatch: Count = 1024
    """Use this many samples in a gradient step."""
    epochs: Count = 3
    """Pass over the samples of an update this many times."""
    learning_rate: float = 5e-4
    gamma: float = 0.99
    """Discount rewards by this factor per step."""
    net_width: Count = 64
    """Give the policy and the value network two hidden layers of this many units each."""
    workers: Workers = None
    address: Address = None


def with_options(config: Config, args: RllibArgs) -> Config:
    """Set what the options of all recipes say. Without workers, everything happens in the process that trains."""
    from ray.rllib.core.rl_module.default_model_config import DefaultModelConfig

    config.debugging(seed=args.seed, log_level="ERROR")
    config.env_runners(num_env_runners=args.workers or 0)
    config.training(
        lr=args.learning_rate,
        gamma=args.gamma,
        lambda_=0.95,
        clip_param=0.2,
        train_batch_size=args.batch,
        minibatch_size=args.minibatch,
        num_epochs=args.epochs,
        use_kl_loss=False,
        vf_clip_param=float("inf"),
    )
    network = DefaultModelConfig(
        fcnet_hiddens=[args.net_width, args.net_width], fcnet_activation=ACTIVATION, vf_share_layers=False
    )
    config.rl_module(model_config=network)
    return config
