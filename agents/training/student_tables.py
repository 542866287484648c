"""Tables for a student: some under easier conditions than others, and with the exact states for its teacher."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from agents.training.joined_tables import JoinedTables
from airhockey_env.kernel.state import OBSERVATION_SIZE
from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv

SEEN, EXACT_STATE, TABLE = "seen", "exact", "table"
"""The parts of an observation: what the student sees; the exact state, (13,); and the values of the table's drawn
fields, each from -1 to 1 within its range, or a zero if none is drawn."""


class StudentTables(JoinedTables):
    """Batches that differ only in their conditions, as one batch of all their tables.

    Observations are dicts with the keys `SEEN`, `EXACT_STATE` and `TABLE`. A point that is drawn by time is worth
    nothing more: infos hold no `terminal_observation`, from which Stable-Baselines3 would estimate its further value.

    Args:
        parts: the batches.
        ranges: ranges of the table's fields that are drawn for every episode on some of the tables, (low, high).
    """

    def __init__(self, parts: Sequence[AirHockeySB3VecEnv], ranges: Mapping[str, Sequence[float]]) -> None:
        self.ranges = ranges
        space = {
            SEEN: parts[0].observation_space,
            EXACT_STATE: spaces.Box(-1.0, 1.0, (OBSERVATION_SIZE,), np.float32),
            TABLE: spaces.Box(-np.inf, np.inf, (max(len(ranges), 1),), np.float32),
        }
        super().__init__(parts, spaces.Dict(space), num_threads=None)

    def step_wait(self) -> Any:
        """Play the step."""
        seen, rewards, dones, infos = super().step_wait()
        for i in np.flatnonzero(dones):
            del infos[i]["terminal_observation"]
        return seen, rewards, dones, infos

    def join(self, seen: Sequence[NDArray[Any]]) -> dict[str, NDArray[Any]]:
        """The dicts of observations, from what the students on the parts see."""
        exact = np.concatenate([part.exact_observations() for part in self.parts])
        table = np.zeros((self.num_envs, max(len(self.ranges), 1)), np.float32)
        if self.ranges:
            values = np.concatenate([part.table_values(list(self.ranges)) for part in self.parts])
            low, high = np.array(list(self.ranges.values())).T
            table[:] = 2.0 * (values - low) / np.maximum(high - low, 1e-9) - 1.0
        return {SEEN: super().join(seen), EXACT_STATE: exact, TABLE: table}
