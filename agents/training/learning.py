"""Seeds, schedules, a progress bar and a log for Stable-Baselines3's `learn`."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from stable_baselines3 import PPO
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import KVWriter
from stable_baselines3.common.vec_env import VecEnv

from agents.seeding import sequence, table_seeds
from agents.training import workers
from agents.training.joined_tables import JoinedTables
from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv

FAR = 1.5
"""An update that changes the policy by so many times what is desired, or by one part of so many, is far from it."""

FASTER = 1.25
"""The learning rate is multiplied or divided by this at a time."""


def seed_tables(env: VecEnv, seeds: list[int]) -> None:
    """Seed the next reset of wrapped tables, with one seed per table."""
    tables = env.unwrapped
    assert isinstance(tables, (AirHockeySB3VecEnv, JoinedTables))
    tables.seed(seeds)


def seed_learning(model: BaseAlgorithm, env: VecEnv, purpose: str, seed: int) -> None:
    """Prepare a model to learn on these tables, with random streams of their own for every run, session and worker.

    Stable-Baselines3 seeds exploration and tables from the model's seed whenever a model is made or loaded, so this has
    to follow that, directly before `learn`.

    Args:
        purpose: "practice" or "training".
        seed: the seed of the run.
    """
    part = (model.num_timesteps, *workers.part())
    model.set_random_seed(int(sequence("actions", seed, *part).generate_state(1)[0]))
    model.set_env(env)
    seed_tables(env, table_seeds(purpose, seed, env.num_envs, *part))


@dataclass(frozen=True)
class Falling:
    """A schedule that falls linearly during a run; with the defaults, that is RL-Zoo's `lin_`."""

    start: float
    to: float = 0.0
    """The final value, as a share of the start."""
    begins: float = 0.0
    """The share of the run after which the value falls."""
    ends: float = 1.0
    """The share of the run after which it has fallen."""

    def __call__(self, remaining: float) -> float:
        """The value when this share of the run remains, which can be negative in the last rollout."""
        left, length = remaining - (1.0 - self.ends), self.ends - self.begins
        stays = length <= 0.0 or left >= length
        # A run ends with a whole rollout, so with few steps it can go on long after the last of them.
        return self.start * (self.to + (1.0 - self.to) * (1.0 if stays else max(left / length, 0.0)))


class Limited:
    """A schedule with an upper limit, which `FollowKl` changes."""

    def __init__(self, schedule: Callable[[float], float], limit: float = math.inf) -> None:
        self.schedule, self.limit = schedule, limit

    def __call__(self, remaining: float) -> float:
        """The value when this share of the run remains."""
        return min(self.schedule(remaining), self.limit)


class FollowKl(BaseCallback):
    """Limits PPO's learning rate so that updates change the policy by about so much.

    The change is the approximate KL divergence between the policies before and after an update. It grows with the
    square of the learning rate, and the faster, the smaller the disturbances of the actions are. RL libraries for
    robots adapt the rate in this way, too: `desired_kl` of rsl_rl, `kl_threshold` of rl_games.

    Args:
        desired: the KL divergence to aim at. The rate changes when the last one differs from it by more than half.
    """

    model: PPO

    def __init__(self, desired: float) -> None:
        super().__init__()
        self.desired = desired

    def _on_training_start(self) -> None:
        resumed = self.num_timesteps > 0  # the optimizer, which is saved with the model, has the rate
        rate = self.model.policy.optimizer.param_groups[0]["lr"] if resumed else math.inf
        self.model.lr_schedule = Limited(self.model.lr_schedule, rate)

    def _on_rollout_start(self) -> None:
        mine = self.logger.name_to_value.get("train/approx_kl")  # None before the first update
        if mine is None:
            return
        (total,) = workers.total(float(mine))
        change, schedule = total / workers.number() / self.desired, self.model.lr_schedule
        assert isinstance(schedule, Limited)
        rate = self.model.policy.optimizer.param_groups[0]["lr"]
        if change > FAR:
            schedule.limit = rate / FASTER
        elif change < 1.0 / FAR:
            schedule.limit = rate * FASTER

    def _on_step(self) -> bool:
        return True


class ProgressBar(BaseCallback):
    """Shows the steps of the run. It ends at 100 %, although Stable-Baselines3 rounds up to whole rollouts."""

    bar: Any = None

    def _on_training_start(self) -> None:
        from tqdm import tqdm

        total = self.locals["total_timesteps"]
        self.bar = tqdm(total=total, initial=min(self.num_timesteps, total), unit="step", unit_scale=True, disable=None)

    def _on_step(self) -> bool:
        self.bar.update(min(self.num_timesteps, self.bar.total) - self.bar.n)
        return True

    def _on_training_end(self) -> None:
        self.bar.close()


class Records(KVWriter):
    """Appends a row to the records of a run when Stable-Baselines3 writes its log."""

    def __init__(self, rows: list[dict[str, float]], seconds: Callable[[], float]) -> None:
        self.rows, self.seconds = rows, seconds

    def write(self, key_values: dict[str, Any], key_excluded: dict[str, Any], step: int = 0) -> None:
        names = {
            "rollout/ep_len_mean": "episode_length",
            "rollout/ep_rew_mean": "episode_reward",
            "train/entropy_loss": "entropy",
            "train/approx_kl": "kl",
            "train/explained_variance": "explained_variance",
            "time/fps": "fps",
            "time/averaging": "averaging",
        }
        row = {names[key]: float(value) for key, value in key_values.items() if key in names}
        if "entropy" in row:
            row["entropy"] = -row["entropy"]
        self.rows.append({"steps": step, "seconds": self.seconds(), **row})

    def close(self) -> None:
        """Do nothing, because no file is open."""
