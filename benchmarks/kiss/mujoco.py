"""The scenes in MuJoCo (package mujoco), with its settings for elastic bounces. See docs/kiss_study.md."""

from __future__ import annotations

import numpy as np
from gymnasium.error import DependencyNotInstalled
from numpy.typing import NDArray

from benchmarks.kiss.scenes import RADIUS, Scene

try:
    import mujoco
except ImportError as error:
    raise DependencyNotInstalled('the scenes in MuJoCo need the extra "study": pip install -e ".[study]"') from error

PACKAGE = "mujoco"
SUB_STEPS = 10  # as many as Chipmunk gets
STIFFNESS = 2.0  # of a contact, times the sub-step squared: the stiffest value tried that conserves energy

MODEL = """
<mujoco>
  <option timestep="{timestep!r}" gravity="0 0 0" integrator="implicitfast" solver="Newton" tolerance="1e-12"/>
  <default><geom condim="1" solref="{stiffness!r} 0" solimp="0.9999 0.9999 0.001 0.5 1"/></default>
  <worldbody>{walls}{pucks}</worldbody>
</mujoco>
"""
PUCK = """
<body>
  <joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/><geom type="sphere" size="{radius}" mass="1"/>
</body>
"""
WALL = '<geom type="plane" size="1 1 1" pos="{x} {y} 0" zaxis="{nx} {ny} 0"/>'


class Table:
    """Spheres on two sliders each, between planes. Contacts are stiff springs without damping."""

    def __init__(self, scene: Scene, hz: float) -> None:
        timestep = 1.0 / hz / SUB_STEPS
        walls = ""
        if scene.size is not None:
            x, y = (0.5 * side for side in scene.size)
            for nx, ny in ((1, 0), (-1, 0), (0, 1), (0, -1)):
                walls += WALL.format(x=-x * nx, y=-y * ny, nx=nx, ny=ny)
        pucks = len(scene.positions) * PUCK.format(radius=RADIUS)
        stiffness = -STIFFNESS / timestep**2
        self.model = mujoco.MjModel.from_xml_string(
            MODEL.format(timestep=timestep, stiffness=stiffness, walls=walls, pucks=pucks)
        )
        self.data = mujoco.MjData(self.model)
        self.data.qpos[:] = scene.positions.ravel()
        self.data.qvel[:] = scene.velocities.ravel()

    def step(self) -> None:
        """Simulate one tick."""
        mujoco.mj_step(self.model, self.data, SUB_STEPS)

    @property
    def positions(self) -> NDArray[np.float64]:
        """(N, 2) m."""
        return self.data.qpos.reshape(-1, 2).copy()

    @property
    def velocities(self) -> NDArray[np.float64]:
        """(N, 2) m/s."""
        return self.data.qvel.reshape(-1, 2).copy()
