"""From a `TableSpec` to what the compiled code plays by, and tables drawn anew for every episode."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from airhockey_env.compiled import compiled, records
from airhockey_env.engine.motion import glide_coefficients
from airhockey_env.kernel.random_stream import draw_between
from airhockey_env.kernel.state import LEFT, PHYSICS, PUCK, RIGHT, SHOT_CLOCK
from airhockey_env.tables import FIELDS, TableSpec

(
    LENGTH, WIDTH, GOAL_WIDTH, PUCK_RADIUS, PUCK_MASS, PADDLE_RADIUS, WALL_RESTITUTION, WALL_TANGENTIAL,
    PADDLE_RESTITUTION, DRAG_CONSTANT, DRAG_LINEAR, DRAG_QUADRATIC, PADDLE_SPEED, PADDLE_ACCELERATION, PUCK_SPEED,
) = range(len(FIELDS))  # fmt: skip


@compiled
def derive(law):
    """Work out everything in a `PHYSICS` record from its `spec`, `tick` and `clock_limit`."""
    spec = law.spec
    law.half_length = 0.5 * spec[LENGTH]
    law.half_width = 0.5 * spec[WIDTH]
    law.half_goal = 0.5 * spec[GOAL_WIDTH]
    law.wall_restitution = spec[WALL_RESTITUTION]
    law.wall_tangential = spec[WALL_TANGENTIAL]
    law.disc_restitution = spec[PADDLE_RESTITUTION]
    law.radius[LEFT] = spec[PADDLE_RADIUS]
    law.radius[RIGHT] = spec[PADDLE_RADIUS]
    law.radius[PUCK] = spec[PUCK_RADIUS]
    law.inverse_mass[LEFT] = 0.0
    law.inverse_mass[RIGHT] = 0.0
    law.inverse_mass[PUCK] = 1.0 / spec[PUCK_MASS]
    p, q, r, s = glide_coefficients(spec[DRAG_CONSTANT], spec[DRAG_LINEAR], spec[DRAG_QUADRATIC], 0.5 * law.tick)
    law.glide_p = p
    law.glide_q = q
    law.glide_r = r
    law.glide_s = s
    law.puck_speed = spec[PUCK_SPEED]
    law.paddle_speed = spec[PADDLE_SPEED]
    law.paddle_step = spec[PADDLE_ACCELERATION] * law.tick
    law.per_x = 2.0 / spec[LENGTH]
    law.per_y = 2.0 / spec[WIDTH]
    law.per_paddle = 1.0 / spec[PADDLE_SPEED]
    law.per_puck = 1.0 / spec[PUCK_SPEED]
    law.per_clock = 1.0 / law.clock_limit


@compiled
def draw_physics(table, law, ranges):
    """Draw the fields of the table's spec that have a range, from the table's own stream.

    Args:
        ranges: (len(FIELDS), 2) least and greatest values; equal ones leave a field as it is and draw nothing.
    """
    for k in range(ranges.shape[0]):
        if ranges[k, 0] < ranges[k, 1]:
            law.spec[k] = draw_between(table, ranges[k, 0], ranges[k, 1])
    derive(law)


@compiled
def _derive_rows(physics):
    for i in range(physics.shape[0]):
        derive(physics[i])


def physics_record(spec: TableSpec, control_hz: float) -> NDArray[np.void]:
    """`PHYSICS` of a table at a control rate, (1,)."""
    physics = records(1, PHYSICS)
    physics["spec"] = dataclasses.astuple(spec)
    physics["tick"] = 1.0 / control_hz
    physics["clock_limit"] = round(SHOT_CLOCK * control_hz)
    _derive_rows(physics)
    return physics


def spec_of(law: NDArray[np.void]) -> TableSpec:
    """The `TableSpec` of one `PHYSICS` record."""
    return TableSpec(*law["spec"].tolist())


def with_spec(physics: NDArray[np.void], specs: NDArray[np.float64]) -> NDArray[np.void]:
    """A copy of `PHYSICS` records with other specs, (n, len(FIELDS)), and all that follows from them."""
    changed = physics.copy()
    changed["spec"] = specs
    _derive_rows(changed)
    return changed
