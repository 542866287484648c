"""Tracks of simulated tables: a puck that is thrown again and again, as the camera of a robot sees it."""

from __future__ import annotations

import math

import numpy as np

from agents.fitting.tracks import Track
from airhockey_env.cameras import ROBOT, Camera
from airhockey_env.game import Game
from airhockey_env.kernel.camera import THE_PUCK
from airhockey_env.kernel.state import LEFT, PUCK
from airhockey_env.tables import TableSpec

CONTROL_HZ = 240
"""Twice the frames of `ROBOT`, so that no more than one frame arrives in most steps."""
THROWS = (0.8, 6.0)
"""m/s, the slowest and the fastest throw."""
LONGEST_THROW = 5.0
"""s after which the puck is thrown again."""
SLOWEST = 0.1
"""m/s below which it is thrown again at once."""
PAUSE = 1.0
"""s between two throws, in which the hand hides the puck."""


def simulate_track(table: TableSpec, seconds: float, seed: int, camera: Camera = ROBOT) -> Track:
    """The track of a puck that somebody throws from random places in random directions past two resting paddles.

    A throw ends after `LONGEST_THROW` s, when the puck is slow or when it is in a goal. Each frame has the time at
    which it was taken; frames that the camera loses are missing.

    Args:
        table: what the puck glides on.
        seconds: s of all throws together.
        seed: of the throws and of the camera.
        camera: what sees the puck. It must have `velocity_frames`, because it then keeps its last frames.
    """
    rng = np.random.default_rng(seed)
    game = Game(1, left=None, right="idle", table=table, control_hz=CONTROL_HZ, camera=(camera, None), num_threads=1)
    cameras = game.cameras[LEFT]
    assert cameras is not None and camera.velocity_frames is not None
    state, ring = cameras.states[0], cameras.past[0, THE_PUCK]
    limit = np.array([0.5 * table.length, 0.5 * table.width]) - table.puck_radius
    rest = np.zeros((1, 2), np.float32)
    rows: list[tuple[float, float, float]] = []
    played, clock = 0.0, 0.0
    while played < seconds:
        speed, angle = rng.uniform(*THROWS), rng.uniform(0.0, 2.0 * math.pi)
        throw = {
            "puck_position": (rng.uniform(-0.2, 0.2) * limit[0], rng.uniform(-0.9, 0.9) * limit[1]),
            "puck_velocity": (speed * math.cos(angle), speed * math.sin(angle)),
        }
        game.reset(seed=int(rng.integers(2**31)), options=throw)
        rows.append((clock, *ring[0, 1:]))
        seen, steps, done = 1, 0, False
        while not done and steps < LONGEST_THROW * CONTROL_HZ:
            game.step(left=rest)
            steps += 1
            while seen != state["next"][THE_PUCK]:
                time, x, y = ring[seen]
                rows.append((clock + time / CONTROL_HZ, x, y))
                seen = (seen + 1) % len(ring)
            done = bool(game.done[0]) or math.hypot(*game.states["velocity"][0, PUCK]) < SLOWEST
        played += steps / CONTROL_HZ
        clock += steps / CONTROL_HZ + PAUSE
    return Track(*np.array(rows).T.copy())
