"""The angle between a track's axes and the table's: walls that the puck bounces on must be straight and square."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from agents.fitting.bounces import AGREEING, PLACE, Bounce
from agents.fitting.tracks import Track

Array = NDArray[np.float64]

ANGLES = np.radians(np.linspace(-3.0, 3.0, 301))
"""Which are tried. Cameras are set up by eye at worst."""
FEWEST = 6
"""Bounces on walls that tell an angle."""
SIGNIFICANT = 3.0
"""Standard errors from 0 of an angle that is corrected."""


def find_turn(meetings: Sequence[Bounce]) -> float:
    """The angle, rad, from the track's axes to the table's, counterclockwise; 0 where the track tells none.

    It is the one at which the most bounces agree on four walls, and then their least-squares lines'.
    """
    across = np.array([meeting.values[PLACE] for meeting in meetings])
    # A side wall of a table turned by a small angle is at y = place + angle * x, an end wall at x = place - angle * y.
    along = np.array([meeting.along * (1.0 if meeting.wall[0] == 1 else -1.0) for meeting in meetings])
    walls = [
        np.flatnonzero([meeting.wall == wall for meeting in meetings])
        for wall in sorted({meeting.wall for meeting in meetings})
    ]
    counts = [sum(len(_agreeing(across[w] - angle * along[w])) for w in walls) for angle in ANGLES]
    best = ANGLES[np.flatnonzero(np.array(counts) == max(counts, default=0))]
    if not len(best) or max(counts) < FEWEST:
        return 0.0
    angle = float(np.median(best))
    kept = [w[_agreeing(across[w] - angle * along[w])] for w in walls]
    x = np.concatenate([along[w] - along[w].mean() for w in kept])
    y = np.concatenate([across[w] - across[w].mean() for w in kept])
    degrees, spread = len(x) - len(kept) - 1, float(x @ x)
    if degrees < 1 or not spread > 0.0:
        return 0.0
    angle = float(x @ y) / spread
    error = math.sqrt(float(np.sum((y - angle * x) ** 2)) / degrees / spread)
    return math.atan(angle) if abs(angle) > SIGNIFICANT * error else 0.0


def _agreeing(places: Array) -> NDArray[np.int64]:
    """Numbers of the places that agree with the one with which most do."""
    agree = np.abs(places[:, np.newaxis] - places) <= AGREEING
    return np.flatnonzero(agree[int(agree.sum(axis=1).argmax())])


def turn(track: Track, angle: float) -> Track:
    """The track in axes that are turned counterclockwise by this angle, rad."""
    cos, sin = math.cos(angle), math.sin(angle)
    return Track(track.time, cos * track.x + sin * track.y, cos * track.y - sin * track.x)
