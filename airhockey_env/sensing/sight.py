"""What a camera sees of a number of tables, for the wrappers of every library, and what these demand of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from airhockey_env.compiled import records
from airhockey_env.game import Game
from airhockey_env.sensing.camera import Camera
from airhockey_env.sensing.frames import ADVANCE, HOLD, LENS, RESTART, make_memory, sense_rows
from airhockey_env.spaces import observation_space


class Sight:
    """What a camera sees of a number of tables.

    Args:
        camera: the camera.
        game: whose tables it looks at; read for its control rate here, and for its scales where an episode begins.
        depth: cameras that lie between this one and the game: each has random streams of its own.
    """

    def __init__(self, camera: Camera, game: Game, depth: int) -> None:
        n, control_hz = game.num_tables, game.control_hz
        lens = records(1, LENS)
        lens["control_hz"] = control_hz
        lens["camera_hz"] = control_hz if camera.camera_hz is None else camera.camera_hz
        lens["delay"] = camera.delay_ms * 1e-3 * control_hz
        lens["jitter"] = camera.jitter_ms * 1e-3 * control_hz
        lens["noise"] = camera.opponent_noise_mm * 1e-3, camera.noise_mm * 1e-3
        lens["dropout"] = camera.dropout
        lens["gap"] = camera.occlusion_mm * 1e-3
        lens["estimates"] = camera.velocity_frames is not None
        self._lens = lens
        self._memory = make_memory(n, lens, camera.velocity_frames or 1)
        self._depth = depth
        self._all = np.full(n, ADVANCE, np.int8)
        self._seeded = np.zeros(n, np.bool_)
        self._begun = np.zeros(n, np.bool_)
        self._ready = False

    def check_ready(self) -> None:
        """Raises ResetNeeded if the camera has not seen every table's episode begin."""
        if not self._ready:
            raise ResetNeeded("reset every table, through the camera's wrapper, before step")

    def restart(
        self, mask: NDArray[np.bool_], seeds: Sequence[int | None], observations: NDArray[np.float32], game: Game
    ) -> NDArray[np.float32]:
        """Begin an episode on the tables of the mask, with new random streams where there is a seed."""
        streams = self._memory.sights["stream"]
        for i in np.flatnonzero(mask).tolist():
            seed = seeds[i]
            if seed is not None or not self._seeded[i]:
                key = np.random.SeedSequence(seed, spawn_key=(1 + self._depth,))
                streams[i] = key.generate_state(1, np.uint64)[0]
        self._seeded |= mask
        self._begun |= mask
        self._ready = bool(self._begun.all())
        return self._look(np.where(mask, RESTART, HOLD).astype(np.int8), observations, game)

    def follow(
        self, observations: NDArray[np.float32], game: Game, begins: NDArray[np.bool_] | None = None
    ) -> NDArray[np.float32]:
        """Go one control step on, on all tables; on those of `begins` an episode begins with it."""
        tasks = self._all
        if begins is not None and begins.any():
            tasks = np.where(begins, RESTART, ADVANCE).astype(np.int8)
        return self._look(tasks, observations, game)

    def finish(
        self, over: NDArray[np.bool_], observations: NDArray[np.float32], finals: Any, game: Game
    ) -> NDArray[np.float32]:
        """Go one control step on, which ends the episodes on the tables of the mask and begins the next there.

        Args:
            over: (N,) the mask.
            observations: (N, 13), of the new episodes where the old ones are over.
            finals: from numbers of tables to the last observations of the episodes that are over; becomes what the
                camera knew.
            game: whose tables these are.
        """
        rows = np.flatnonzero(over).tolist()
        ends = observations.copy()
        ends[rows] = np.stack([finals[i] for i in rows])
        seen = self.follow(ends, game)
        for i in rows:
            finals[i] = seen[i].copy()
        return self._look(np.where(over, RESTART, HOLD).astype(np.int8), observations, game)

    def _look(self, tasks: NDArray[np.int8], observations: NDArray[np.float32], game: Game) -> NDArray[np.float32]:
        sense_rows(tasks, observations, game.physics, self._lens, self._memory)
        return self._memory.seen.copy()


def game_of(env: Any, kind: type[Any]) -> Game:
    """The game behind an environment of this kind, wrapped or not, or a TypeError."""
    if not isinstance(env.unwrapped, kind):
        raise TypeError(
            f"the environment must be an {kind.__name__}, wrapped or not, got {env!r}; inside another vector "
            "environment, put the camera around each table"
        )
    return env.unwrapped._game


def check_space(space: gym.Space) -> None:
    """A ValueError if these are not state observations."""
    if space != observation_space():
        raise ValueError(
            f"a camera looks at state observations, {observation_space()}, got an environment with {space}: "
            "put it inside of wrappers that change the observations"
        )


def cameras_around(env: Any, kind: type) -> int:
    """Number of cameras of this kind around the environment so far."""
    depth = 0
    while env is not env.unwrapped:
        depth += isinstance(env, kind)
        env = env.venv if hasattr(env, "venv") else env.env  # as Stable-Baselines3's wrappers, or Gymnasium's, have it
    return depth
