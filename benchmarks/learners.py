"""How fast other implementations of PPO learn with the recipe and the settings of `train_ppo`."""

from __future__ import annotations

import importlib.util
import math
import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from gymnasium.error import DependencyNotInstalled
from numpy.typing import NDArray
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback, CallbackList

from agents.features import relative_features
from agents.measuring.evaluation import play_points
from agents.measuring.shares import Share
from agents.training.learning import seed_learning
from agents.training.ppo import WINDOW, PpoArgs, make_env, make_model, model_arguments, phases
from agents.training.recipe import History
from airhockey_env.tables import FULL_SIZE
from benchmarks.speed.measure import Row

ONE_THREAD = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
"""JAX reads this from XLA_FLAGS when it is imported. Stable-Baselines3 has one thread here, too."""


@dataclass(frozen=True)
class Learner:
    """A library's PPO.

    Args:
        make: makes the untrained model.
        needs: the modules of the library.
    """

    name: str
    make: Callable[[PpoArgs], BaseAlgorithm]
    needs: tuple[str, ...] = ()

    def check(self) -> None:
        """Raises gymnasium.error.DependencyNotInstalled if the library is missing."""
        if any(importlib.util.find_spec(module) is None for module in self.needs):
            raise DependencyNotInstalled(f'{self.name} is missing: pip install -e ".[ecosystem]"')


def make_sbx(args: PpoArgs) -> BaseAlgorithm:
    """Make SBX's PPO, which is Stable-Baselines3's in JAX, with the settings of `train_ppo`.

    SBX has no feature extractors for states, so that its networks begin with the fixed layer instead. In place of gSDE
    it holds Gaussian disturbances for as many steps. They begin as large as gSDE makes them with the same network.
    """
    os.environ.setdefault("XLA_FLAGS", ONE_THREAD)
    from flax import linen
    from sbx import PPO
    from sbx.ppo.policies import Actor, Critic

    matrix = relative_features(FULL_SIZE).T

    class RelativeActor(Actor):
        def __call__(self, x: Any) -> Any:
            return super().__call__(x @ matrix)

    class RelativeCritic(Critic):
        def __call__(self, x: Any) -> Any:
            return super().__call__(x @ matrix)

    arguments = model_arguments(args)
    del arguments["stats_window_size"]  # an attribute is set below
    arguments["policy_kwargs"] = {
        "log_std_init": args.log_std_init + math.log(10.0),
        "net_arch": arguments["policy_kwargs"]["net_arch"],
        "activation_fn": linen.relu,
        "actor_class": RelativeActor,
        "critic_class": RelativeCritic,
    }
    model: BaseAlgorithm = PPO("MlpPolicy", make_env(args), **arguments)
    model._stats_window_size = WINDOW
    return model


LEARNERS: dict[str, Learner] = {
    "sb3": Learner("Stable-Baselines3", lambda args: make_model(args, make_env(args))),
    "sbx": Learner("SBX", make_sbx, needs=("sbx", "flax")),
}


class Progress(BaseCallback):
    """Evaluates a model regularly against the striker, and leaves the time for that out of the seconds."""

    def __init__(self, name: str, every: int, points: int) -> None:
        super().__init__()
        self.name, self.every, self.points = name, every, points
        self.rows: list[Row] = []
        self._due = every
        self._begun = time.perf_counter()

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        if self.num_timesteps >= self._due:
            self.evaluate()
            self._due = (self.num_timesteps // self.every + 1) * self.every

    def evaluate(self) -> None:
        """Add a row."""
        seconds = time.perf_counter() - self._begun

        def player(observations: NDArray[np.float32]) -> NDArray[np.float32]:
            actions, _ = self.model.predict(observations, deterministic=True)
            return np.asarray(actions, np.float32)

        result = play_points(player, "striker", self.points, purpose="progress")
        self.rows.append({"learner": self.name, "steps": self.num_timesteps, "seconds": seconds, **result.as_dict()})
        self._begun = time.perf_counter() - seconds


def learn(learner: Learner, args: PpoArgs, points: int) -> list[Row]:
    """Train from scratch as `train_ppo` does, on one thread; a row for each evaluation.

    Args:
        args: resolved options, of which those of folders, reports and videos say nothing here.
        points: points of each evaluation.
    """
    assert args.steps is not None and args.eval_every is not None
    torch.set_num_threads(1)
    model = learner.make(args)
    history: History = {"practice": None, "evaluations": [], "updates": [], "report": []}
    progress = Progress(learner.name, args.eval_every, points)
    for phase in phases(args, model, None, history):  # type: ignore[arg-type]
        if model.num_timesteps >= args.steps:
            break
        seed_learning(model, phase.env, phase.purpose, args.seed)
        model.learn(
            args.steps - model.num_timesteps,
            callback=CallbackList([*phase.callbacks, progress]),
            reset_num_timesteps=model.num_timesteps == 0,
        )
    return progress.rows


def table(rows: list[Row]) -> Iterator[tuple[str, ...]]:
    """The rows as a table."""
    yield ("learner", "million steps", "minutes", "steps/s", "of the decided points (95 %)", "draws")
    for row in rows:
        yield (
            row["learner"], f"{row['steps'] / 1e6:.1f}", f"{row['seconds'] / 60:.1f}",
            f"{row['steps'] / row['seconds']:,.0f}", str(Share(row["wins"], row["wins"] + row["losses"])),
            f"{row['draws']} of {row['points']}",
        )  # fmt: skip
