"""A course: whom each table plays against while an agent trains, and when that changes.

Both kinds are Stable-Baselines3 callbacks that assign places in the pool of opponents (`OpponentPool`).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from stable_baselines3.common.callbacks import BaseCallback

from airhockey_env.game import Opponent


class Course(BaseCallback):
    """Assigns opponents to tables while training.

    Args:
        warmup: whom to meet at first, on as many tables each. Against an opponent who does not defend an agent learns
            to attack; against one who does, each early attempt is punished, and it learns to wait for the clock.
        warmup_steps: how long.
        opponents: whom to meet then.
    """

    def __init__(self, warmup: Sequence[Opponent], warmup_steps: int, opponents: Sequence[Opponent]) -> None:
        super().__init__()
        self.warmup = tuple(warmup)
        self.warmup_steps = warmup_steps
        self.opponents = tuple(opponents)
        self._assigned_for: bool | None = None  # the warm-up, or not; None before the first time

    @property
    def pool(self) -> tuple[Opponent, ...]:
        """The environment's pool of opponents, in the order of their places."""
        return (*self.warmup, *self.opponents)

    @property
    def warming_up(self) -> bool:
        return self.num_timesteps < self.warmup_steps

    def places(self) -> np.ndarray:
        """(num_envs,) place of each table's opponent."""
        rows = np.arange(self.training_env.num_envs)
        if self.warming_up:
            return rows % len(self.warmup)
        return len(self.warmup) + rows % len(self.opponents)

    def _on_training_start(self) -> None:
        self._assigned_for = None

    def _on_rollout_start(self) -> None:
        if self._assigned_for != self.warming_up:
            self._assigned_for = self.warming_up
            self.training_env.env_method("set_opponents", self.places())

    def _on_step(self) -> bool:
        return True

    def whom(self) -> str:
        """The opponents, in words."""
        names = ", ".join(str(name) for name in self.opponents)
        return f"{names}, after {self.warmup_steps:,} against {', '.join(map(str, self.warmup))}"

    def save(self, folder: Path) -> None:
        """Write what a resumed run needs into the run's folder: here nothing but the steps, which the model has."""

    def load(self, folder: Path) -> None:
        """Take up what `save` wrote, before training begins."""
