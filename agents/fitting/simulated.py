"""Tracks of simulated tables: of a puck that somebody throws, or that two players play with, as a camera sees it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from agents.fitting.tracks import Track
from airhockey_env.cameras import ROBOT, Camera
from airhockey_env.game import Game
from airhockey_env.kernel.camera import THE_PUCK
from airhockey_env.kernel.state import LEFT, PUCK
from airhockey_env.tables import TableSpec

CONTROL_HZ = 240
THROWS = (0.8, 6.0)
"""m/s, the slowest and the fastest throw."""
LONGEST_THROW = 5.0
"""s after which the puck is thrown again."""
SLOWEST = 0.1
"""m/s below which it is thrown again at once."""
PAUSE = 1.0
"""s between two throws or points, in which nothing is seen."""


def simulate_throws(table: TableSpec, seconds: float, seed: int, camera: Camera = ROBOT) -> Track:
    """The track of a puck that is thrown from random places in random directions, past two resting paddles.

    A throw ends after `LONGEST_THROW` s, when the puck is slow, or when it is in a goal. Each frame has the time at
    which it was taken; frames that the camera loses are missing.

    Args:
        table: what the puck glides on.
        seconds: s of all throws together.
        seed: of the throws and of the camera.
        camera: what sees the puck. It must estimate velocities (`velocity_frames`), because it then keeps its frames.
    """
    rng = np.random.default_rng(seed)
    watched = _Watched(table, camera, "idle")
    limit = np.array([0.5 * table.length, 0.5 * table.width]) - table.puck_radius
    while watched.played < seconds:
        speed, angle = rng.uniform(*THROWS), rng.uniform(0.0, 2.0 * math.pi)
        throw = {
            "puck_position": (rng.uniform(-0.2, 0.2) * limit[0], rng.uniform(-0.9, 0.9) * limit[1]),
            "puck_velocity": (speed * math.cos(angle), speed * math.sin(angle)),
        }
        watched.begin(int(rng.integers(2**31)), throw)
        end = watched.played + LONGEST_THROW
        while not watched.over and watched.speed > SLOWEST and watched.played < end:
            watched.step()
    return watched.track()


def simulate_play(table: TableSpec, seconds: float, seed: int, camera: Camera = ROBOT) -> Track:
    """The track of the puck while two strikers play points. The arguments are as above."""
    rng = np.random.default_rng(seed)
    watched = _Watched(table, camera, "striker")
    while watched.played < seconds:
        watched.begin(int(rng.integers(2**31)), None)
        while not watched.over and watched.played < seconds:
            watched.step()
    return watched.track()


class _Watched:
    """A game of two such players on one table, of which a camera's frames are recorded."""

    def __init__(self, table: TableSpec, camera: Camera, player: str) -> None:
        self._game = Game(
            1, left=player, right=player, table=table, control_hz=CONTROL_HZ, camera=(camera, None), num_threads=1
        )
        seen = self._game.interfaces[LEFT].camera
        assert seen is not None and camera.velocity_frames is not None
        self._state, self._ring = seen.arrays.states[0], seen.arrays.past[0, THE_PUCK]
        self._rows: list[tuple[float, float, float]] = []
        self._began = self._read = 0
        self._steps = 0
        self.played = 0.0
        """s in all episodes so far."""

    def begin(self, seed: int, options: Mapping[str, Any] | None) -> None:
        """Begin an episode, a while after the last one."""
        self._began = self._steps + round(PAUSE * CONTROL_HZ) * (1 if self._rows else 0)
        self._steps, self._read = self._began, 0
        self._game.reset(seed=seed, options=options)
        self._note()

    def step(self) -> None:
        """Play a control step."""
        self._game.step()
        self._steps += 1
        self.played += 1.0 / CONTROL_HZ
        self._note()

    def _note(self) -> None:
        """Write down the frames that have arrived since the last time."""
        while self._read != self._state["next"][THE_PUCK] or (self._read == 0 and self._steps == self._began):
            time, x, y = self._ring[self._read]
            self._rows.append(((self._began + time) / CONTROL_HZ, x, y))
            self._read = (self._read + 1) % len(self._ring)

    @property
    def over(self) -> bool:
        """Whether the episode is over."""
        return bool(self._game.done[0])

    @property
    def speed(self) -> float:
        """The puck's, m/s."""
        return math.hypot(*self._game.states["velocity"][0, PUCK])

    def track(self) -> Track:
        """What was seen so far."""
        return Track(*np.array(self._rows).T.copy())
