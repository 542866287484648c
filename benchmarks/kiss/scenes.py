"""The two scenes of the study: a shot whose result is known exactly, and a crowd of pucks on a lossless table."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airhockey_env import AirTable

METHODS = ("overlap", "kiss", "continuous")
RADIUS = 0.05  # m, of every puck
REACH = 2.0 * RADIUS


@dataclass(frozen=True)
class Scene:
    """Equal pucks of mass 1 kg and radius `RADIUS`, without losses.

    Args:
        positions, velocities: (N, 2) m and m/s.
        size: (length, width) of the table, m, or None for no walls.
    """

    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]
    size: tuple[float, float] | None = None

    @property
    def top_speed(self) -> float:
        """Speed of a puck if it had the energy of all of them, m/s: an upper bound."""
        return float(np.sqrt((self.velocities**2).sum()))

    def table(self, method: str = "continuous") -> AirTable:
        """The scene on an `AirTable`."""
        return AirTable(self.positions, self.velocities, RADIUS, size=self.size, method=method)


def shot(speed: float, offset: float, run_up: float) -> Scene:
    """A fast puck moves along x towards a target that rests at the origin.

    Args:
        speed: speed of the fast puck, m/s.
        offset: distance of its path from the centre of the target, m; it hits if this is less than `REACH`.
        run_up: distance from the start to the kiss, m.
    """
    kiss = -math.sqrt(REACH**2 - offset**2)
    return Scene(np.array([[kiss - run_up, offset], [0.0, 0.0]]), np.array([[speed, 0.0], [0.0, 0.0]]))


def exact_angle(offset: float) -> float:
    """Direction in which the target leaves, degrees from x: along the line of centres at the kiss."""
    return -math.degrees(math.asin(offset / REACH))


def angle(velocity: NDArray[np.float64]) -> float:
    """Direction of a velocity, degrees from x."""
    return math.degrees(math.atan2(velocity[1], velocity[0]))


def struck(method: str, offset: float, run_up: float, travel: float, speed: float = 1.0) -> NDArray[np.float64] | None:
    """Velocity of the target after the shot, m/s, or None if the fast puck passed through.

    Args:
        method: the method of `AirTable`.
        offset, run_up, speed: see `shot`.
        travel: distance that the fast puck travels per tick, m.
    """
    table = shot(speed, offset, run_up).table(method)
    for _ in range(math.ceil((run_up + 2.0 * REACH) / travel)):
        if len(table.step(travel / speed)):
            return table.velocities[1].copy()
    return None


def crowd(seed: int, pucks: int = 12, speed: float = 2.0, size: tuple[float, float] = (2.0, 1.0)) -> Scene:
    """Pucks at random positions with equal speeds in random directions."""
    rng = np.random.default_rng(seed)
    room = 0.5 * np.array(size) - RADIUS
    places: list[NDArray[np.float64]] = []
    while len(places) < pucks:
        place = rng.uniform(-room, room)
        if all(math.dist(place, other) > 1.1 * REACH for other in places):
            places.append(place)
    directions = rng.uniform(0.0, 2.0 * math.pi, pucks)
    velocities = speed * np.stack([np.cos(directions), np.sin(directions)], axis=1)
    return Scene(np.array(places), velocities, size)
