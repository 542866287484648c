"""The scenes in Box2D 2.3 (package box2d), with its settings for fast bodies. See docs/kiss_study.md."""

from __future__ import annotations

import warnings

import numpy as np
from gymnasium.error import DependencyNotInstalled
from numpy.typing import NDArray

from benchmarks.kiss.scenes import RADIUS, Scene

try:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # as an error, the warning from SWIG would crash Python
        import Box2D
except ImportError as error:
    raise DependencyNotInstalled('the scenes in Box2D need the extra "study": pip install -e ".[study]"') from error

PACKAGE = "box2d"
VELOCITY_ITERATIONS, POSITION_ITERATIONS = 8, 3  # as the manual suggests
LARGEST = 10.0  # m: the manual recommends moving bodies of 0.1 m to 10 m
STEP_LIMIT = 2.0  # m: no body moves farther in a step (b2_maxTranslation)


class Table:
    """Bullet bodies on a table that is scaled up as far as Box2D allows, which makes its slop of 5 mm matter least."""

    def __init__(self, scene: Scene, hz: float) -> None:
        self.dt = 1.0 / hz
        self.scale = min(LARGEST / (2.0 * RADIUS), 0.95 * STEP_LIMIT * hz / scene.top_speed)
        self.world = Box2D.b2World(gravity=(0.0, 0.0), doSleep=False, continuousPhysics=True)
        self.bodies = []
        for place, velocity in zip(self.scale * scene.positions, self.scale * scene.velocities, strict=True):
            body = self.world.CreateDynamicBody(
                position=place.tolist(), linearVelocity=velocity.tolist(), bullet=True, fixedRotation=True
            )
            body.CreateCircleFixture(radius=self.scale * RADIUS, density=1.0, friction=0.0, restitution=1.0)
            self.bodies.append(body)
        if scene.size is not None:
            x, y = (0.5 * self.scale * side for side in scene.size)
            corners = [(-x, -y), (x, -y), (x, y), (-x, y)]
            walls = self.world.CreateStaticBody()
            for corner, following in zip(corners, corners[1:] + corners[:1], strict=True):
                walls.CreateEdgeFixture(vertices=[corner, following], friction=0.0, restitution=1.0)

    def step(self) -> None:
        """Simulate one tick."""
        self.world.Step(self.dt, VELOCITY_ITERATIONS, POSITION_ITERATIONS)

    @property
    def positions(self) -> NDArray[np.float64]:
        """(N, 2) m."""
        return np.array([tuple(body.position) for body in self.bodies]) / self.scale

    @property
    def velocities(self) -> NDArray[np.float64]:
        """(N, 2) m/s."""
        return np.array([tuple(body.linearVelocity) for body in self.bodies]) / self.scale
