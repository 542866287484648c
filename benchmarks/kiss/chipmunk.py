"""The scenes in Chipmunk (package pymunk), with its settings for fast bodies. See docs/kiss_study.md."""

from __future__ import annotations

import math

import numpy as np
from gymnasium.error import DependencyNotInstalled
from numpy.typing import NDArray

from benchmarks.kiss.scenes import RADIUS, Scene

try:
    import pymunk
except ImportError as error:
    raise DependencyNotInstalled('the scenes in Chipmunk need the extra "study": pip install -e ".[study]"') from error

PACKAGE = "pymunk"
SUB_STEPS = 10  # as in the example of Space.step's documentation
SLOP = 1e-4  # m, overlap that is not corrected; the default, 0.1, is meant for pixels
WALL = 0.5  # m thick, so that nothing gets through


class Table:
    """Elastic circles between thick walls, with ten sub-steps per tick."""

    def __init__(self, scene: Scene, hz: float) -> None:
        self.dt = 1.0 / hz / SUB_STEPS
        self.space = pymunk.Space()
        self.space.iterations = 10
        self.space.collision_slop = SLOP
        self.bodies = []
        for place, velocity in zip(scene.positions.tolist(), scene.velocities.tolist(), strict=True):
            body = pymunk.Body(mass=1.0, moment=math.inf)
            body.position, body.velocity = tuple(place), tuple(velocity)
            self._add(pymunk.Circle(body, RADIUS), body)
            self.bodies.append(body)
        if scene.size is not None:
            x, y = (0.5 * side + WALL for side in scene.size)
            corners = [(-x, -y), (x, -y), (x, y), (-x, y)]
            for corner, following in zip(corners, corners[1:] + corners[:1], strict=True):
                self._add(pymunk.Segment(self.space.static_body, corner, following, WALL))

    def _add(self, shape: pymunk.Shape, *body: pymunk.Body) -> None:
        shape.elasticity, shape.friction = 1.0, 0.0
        self.space.add(*body, shape)

    def step(self) -> None:
        """Simulate one tick."""
        for _ in range(SUB_STEPS):
            self.space.step(self.dt)

    @property
    def positions(self) -> NDArray[np.float64]:
        """(N, 2) m."""
        return np.array([body.position for body in self.bodies])

    @property
    def velocities(self) -> NDArray[np.float64]:
        """(N, 2) m/s."""
        return np.array([body.velocity for body in self.bodies])
