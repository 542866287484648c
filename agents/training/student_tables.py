"""Tables for a student: some under easier conditions than others, and with the exact states for its teacher."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

from airhockey_env.kernel.state import OBSERVATION_SIZE
from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv
from airhockey_env.threads import Threads

SEEN, EXACT_STATE, TABLE = "seen", "exact", "table"
"""The parts of an observation: what the student sees; the exact state, (13,); and the values of the table's drawn
fields, each from -1 to 1 within its range, or a zero if none is drawn."""


class StudentTables(VecEnv):
    """Batches that differ only in their conditions, as one batch of all their tables.

    Observations are dicts with the keys `SEEN`, `EXACT_STATE` and `TABLE`. A point that is drawn by time is worth
    nothing more: infos hold no `terminal_observation`, from which Stable-Baselines3 would estimate its further value.

    Args:
        parts: the batches. Their tables are numbered one after the other.
        ranges: ranges of the table's fields that are drawn for every episode on some of the tables, (low, high).
    """

    def __init__(self, parts: Sequence[AirHockeySB3VecEnv], ranges: Mapping[str, Sequence[float]]) -> None:
        self.parts, self.ranges = tuple(parts), ranges
        ends = np.cumsum([part.num_envs for part in parts]).tolist()
        self._threads = Threads(None)
        self._bounds = list(zip([0, *ends[:-1]], ends, strict=True))
        space = {
            SEEN: parts[0].observation_space,
            EXACT_STATE: spaces.Box(-1.0, 1.0, (OBSERVATION_SIZE,), np.float32),
            TABLE: spaces.Box(-np.inf, np.inf, (max(len(ranges), 1),), np.float32),
        }
        super().__init__(ends[-1], spaces.Dict(space), parts[0].action_space)

    def seed(self, seed: Any = None) -> Sequence[int | None]:
        """Seed the next reset: as `AirHockeySB3VecEnv.seed`."""
        seeds = seed if isinstance(seed, (list, tuple)) else [seed + k for k in range(self.num_envs)]
        for part, (first, last) in zip(self.parts, self._bounds, strict=True):
            part.seed(seeds[first:last])
        return list(seeds)

    def reset(self) -> dict[str, NDArray[Any]]:
        """Begin an episode on every table."""
        return self._observations([part.reset() for part in self.parts])

    def step_async(self, actions: NDArray[Any]) -> None:
        """Take the actions of the next step, (num_envs, 2)."""
        for part, (first, last) in zip(self.parts, self._bounds, strict=True):
            part.step_async(actions[first:last])

    def step_wait(self) -> Any:
        """Play the step."""
        results: list[Any] = [None] * len(self.parts)

        def play(first: int, last: int) -> None:
            for k in range(first, last):
                results[k] = self.parts[k].step_wait()

        self._threads.share(len(self.parts), 1, play)
        seen, rewards, dones, infos = zip(*results, strict=True)
        everybody = [info for part in infos for info in part]
        for i in np.flatnonzero(np.concatenate(dones)):
            del everybody[i]["terminal_observation"]
        return self._observations(seen), np.concatenate(rewards), np.concatenate(dones), everybody

    def _observations(self, seen: Sequence[NDArray[Any]]) -> dict[str, NDArray[Any]]:
        exact = np.concatenate([part.exact_observations() for part in self.parts])
        table = np.zeros((self.num_envs, max(len(self.ranges), 1)), np.float32)
        if self.ranges:
            values = np.concatenate([part.table_values(list(self.ranges)) for part in self.parts])
            low, high = np.array(list(self.ranges.values())).T
            table[:] = 2.0 * (values - low) / np.maximum(high - low, 1e-9) - 1.0
        return {SEEN: np.concatenate(seen), EXACT_STATE: exact, TABLE: table}

    def close(self) -> None:
        """End the threads."""
        self._threads.close()
        for part in self.parts:
            part.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute of each of these tables: as `AirHockeySB3VecEnv.get_attr`."""
        everybody = [value for part in self.parts for value in part.get_attr(attr_name)]
        return [everybody[i] for i in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Nothing of these tables can be set.

        Raises:
            AttributeError: always.
        """
        raise AttributeError(f"{attr_name} cannot be set on {type(self).__name__}")

    def env_method(self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any) -> list[Any]:
        """Nothing of these tables can be called.

        Raises:
            AttributeError: always.
        """
        raise AttributeError(f"{method_name} cannot be called on {type(self).__name__}")

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:
        """No table is wrapped."""
        return [False for _ in self._get_indices(indices)]
