"""Several batches of tables as one: a part of the tables can be under other conditions, or play another task."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import Space
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv
from airhockey_env.threads import Threads


class JoinedTables(VecEnv):
    """Batches of tables as one batch.

    Args:
        parts: the batches. Their tables are numbered one after the other.
        observation_space: of the joined batch; None for that of the parts.
        num_threads: threads that step the parts; None takes all cores that the process may use.
    """

    def __init__(
        self,
        parts: Sequence[AirHockeySB3VecEnv],
        observation_space: Space[Any] | None = None,
        num_threads: int | None = 1,
    ) -> None:
        self.parts = tuple(parts)
        ends = np.cumsum([part.num_envs for part in parts]).tolist()
        self._threads = Threads(num_threads)
        self._bounds = list(zip([0, *ends[:-1]], ends, strict=True))
        super().__init__(ends[-1], observation_space or parts[0].observation_space, parts[0].action_space)

    def join(self, seen: Sequence[NDArray[Any]]) -> Any:
        """The observations of the joined batch from those of the parts."""
        return np.concatenate(seen)

    def seed(self, seed: Any = None) -> Sequence[int | None]:
        """Seed the next reset: as `AirHockeySB3VecEnv.seed`."""
        seeds = seed if isinstance(seed, (list, tuple)) else [seed + k for k in range(self.num_envs)]
        for part, (first, last) in zip(self.parts, self._bounds, strict=True):
            part.seed(seeds[first:last])
        return list(seeds)

    def reset(self) -> Any:
        """Begin an episode on every table."""
        return self.join([part.reset() for part in self.parts])

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
        return self.join(seen), np.concatenate(rewards), np.concatenate(dones), everybody

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
