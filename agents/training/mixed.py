"""Tables under several conditions in one batch: some through a camera, some drawn at random, some with exact states."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv


class MixedTables(VecEnv):
    """Batches with the same spaces and different conditions, as one batch of all their tables.

    Args:
        parts: the batches. Their tables are numbered one after the other.
    """

    def __init__(self, parts: Sequence[AirHockeySB3VecEnv]) -> None:
        self.parts = tuple(parts)
        ends = np.cumsum([part.num_envs for part in parts])
        self._bounds = list(zip([0, *ends[:-1].tolist()], ends.tolist(), strict=True))
        super().__init__(int(ends[-1]), parts[0].observation_space, parts[0].action_space)

    def exact_observations(self) -> NDArray[np.float32]:
        """The exact states (N, 13) that the agent would see without cameras."""
        return np.concatenate([part.exact_observations() for part in self.parts])

    def seed(self, seed: Any = None) -> Sequence[int | None]:
        """Seed the next reset: as `AirHockeySB3VecEnv.seed`."""
        if not isinstance(seed, (list, tuple)):
            seed = [None if seed is None else seed + k for k in range(self.num_envs)]
        for part, (first, last) in zip(self.parts, self._bounds, strict=True):
            part.seed(list(seed[first:last]) if seed[first] is not None else None)
        return list(seed)

    def reset(self) -> NDArray[Any]:
        """Begin an episode on every table."""
        return np.concatenate([part.reset() for part in self.parts])

    def step_async(self, actions: NDArray[Any]) -> None:
        """Take the actions of the next step, (N, 2)."""
        for part, (first, last) in zip(self.parts, self._bounds, strict=True):
            part.step_async(actions[first:last])

    def step_wait(self) -> tuple[NDArray[Any], NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Play the step."""
        seen, rewards, dones, infos = zip(*(part.step_wait() for part in self.parts), strict=True)
        everybody = [info for part in infos for info in part]
        return np.concatenate(seen), np.concatenate(rewards), np.concatenate(dones), everybody
