"""How a paddle follows a target within its limits of speed and acceleration."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


def approach_speed(distance: float, step: float, tick: float) -> float:
    """The greatest speed for the coming tick from which one can still stop within `distance`.

    Exact for a velocity that is constant within a tick and falls by at most `step` from one to the next: with n ticks
    left, the speeds w, w - step, ..., w - (n - 1) * step cover the distance and leave nothing.
    """
    ticks = math.ceil(0.5 * (math.sqrt(1.0 + 8.0 * distance / (tick * step)) - 1.0) - 1e-9)
    return 0.0 if ticks < 1 else (distance / tick + 0.5 * step * ticks * (ticks - 1)) / ticks


class Hand(NamedTuple):
    """What a paddle can do; one tick's worth of it."""

    speed: float  # m/s, greatest
    step: float  # m/s, greatest change of velocity in a tick
    tick: float  # s
    near: tuple[float, float]  # m, least x and y
    far: tuple[float, float]  # m, greatest x and y

    def reachable(self, place: tuple[float, float]) -> tuple[float, float]:
        """The place nearest to the given one at which the paddle can be."""
        x, y = (min(max(p, low), high) for p, low, high in zip(place, self.near, self.far, strict=True))
        return x, y

    def follow(
        self,
        place: NDArray[np.float64],
        velocity: NDArray[np.float64],
        target: tuple[float, float],
        target_velocity: tuple[float, float] = (0.0, 0.0),
    ) -> tuple[float, float]:
        """The action that brings the paddle to a target as fast as its limits allow, and stops it there.

        Args:
            place, velocity: of the paddle, (2,) m and m/s.
            target: where the target will be at the end of the tick, m.
            target_velocity: its velocity, m/s: the paddle brakes down to this one, so that it keeps up with a target
                that moves.

        Returns:
            The target velocity as a share of the greatest speed.
        """
        # As seen by somebody who moves along with the target.
        ux, uy = target_velocity
        dx = target[0] - ux * self.tick - place[0]
        dy = target[1] - uy * self.tick - place[1]
        distance = math.hypot(dx, dy)
        if distance > 0.0:
            dx, dy = dx / distance, dy / distance
        # What turns the paddle's way towards the target is not there for braking.
        across = min(abs(dx * (velocity[1] - uy) - dy * (velocity[0] - ux)), 0.8 * self.step)
        step = math.sqrt(self.step * self.step - across * across)
        wanted = approach_speed(distance, step, self.tick)
        vx, vy = ux + wanted * dx, uy + wanted * dy
        share = 1.0 / max(self.speed, math.hypot(vx, vy))
        return vx * share, vy * share
