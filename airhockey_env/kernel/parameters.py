"""From a `TableSpec` to the numbers that the compiled code plays by, also for tables drawn for every episode."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from airhockey_env.compiled import compiled, inlined, records
from airhockey_env.engine.motion import glide_coefficients
from airhockey_env.kernel.random_stream import draw_between
from airhockey_env.kernel.state import LEFT, PARAMETERS, PUCK, RIGHT, SHOT_CLOCK
from airhockey_env.tables import FIELDS, TableSpec

(
    LENGTH, WIDTH, GOAL_WIDTH, PUCK_RADIUS, PUCK_MASS, PADDLE_RADIUS, WALL_RESTITUTION, WALL_TANGENTIAL,
    PADDLE_RESTITUTION, DRAG_CONSTANT, DRAG_LINEAR, DRAG_QUADRATIC, PADDLE_SPEED, PADDLE_ACCELERATION, PUCK_SPEED,
) = range(len(FIELDS))  # fmt: skip


@compiled
def derive(params):
    """Work out everything in a `PARAMETERS` record from its `spec`, `tick` and `clock_limit`."""
    spec = params.spec
    params.half_length = 0.5 * spec[LENGTH]
    params.half_width = 0.5 * spec[WIDTH]
    params.half_goal = 0.5 * spec[GOAL_WIDTH]
    params.wall_restitution = spec[WALL_RESTITUTION]
    params.wall_tangential = spec[WALL_TANGENTIAL]
    params.disc_restitution = spec[PADDLE_RESTITUTION]
    params.radius[LEFT] = spec[PADDLE_RADIUS]
    params.radius[RIGHT] = spec[PADDLE_RADIUS]
    params.radius[PUCK] = spec[PUCK_RADIUS]
    params.inverse_mass[LEFT] = 0.0
    params.inverse_mass[RIGHT] = 0.0
    params.inverse_mass[PUCK] = 1.0 / spec[PUCK_MASS]
    p, q, r, s = glide_coefficients(spec[DRAG_CONSTANT], spec[DRAG_LINEAR], spec[DRAG_QUADRATIC], 0.5 * params.tick)
    params.glide_p = p
    params.glide_q = q
    params.glide_r = r
    params.glide_s = s
    params.bend = spec[WALL_TANGENTIAL] / max(spec[WALL_RESTITUTION], 0.1)
    params.puck_speed = spec[PUCK_SPEED]
    params.paddle_speed = spec[PADDLE_SPEED]
    params.paddle_step = spec[PADDLE_ACCELERATION] * params.tick
    params.per_x = 2.0 / spec[LENGTH]
    params.per_y = 2.0 / spec[WIDTH]
    params.per_paddle = 1.0 / spec[PADDLE_SPEED]
    params.per_puck = 1.0 / spec[PUCK_SPEED]
    params.per_clock = 1.0 / params.clock_limit


@compiled
def draw_parameters(state, params, ranges):
    """Draw the fields of the table's spec that have a range, from the table's own stream.

    Args:
        ranges: (len(FIELDS), 2) least and greatest values; equal ones leave a field as it is and draw nothing.
    """
    for k in range(ranges.shape[0]):
        if ranges[k, 0] < ranges[k, 1]:
            params.spec[k] = draw_between(state, ranges[k, 0], ranges[k, 1])
    derive(params)


@inlined
def params_of(parameters, i):
    """The record of table i: (1,) records are those of all tables, (N,) have one for each."""
    return parameters[i if parameters.shape[0] > 1 else 0]


@compiled
def _derive_rows(parameters):
    for i in range(parameters.shape[0]):
        derive(parameters[i])


def make_parameters(spec: TableSpec, control_hz: float) -> NDArray[np.void]:
    """`PARAMETERS` of a table at a control rate, (1,)."""
    parameters = records(1, PARAMETERS)
    parameters["spec"] = dataclasses.astuple(spec)
    parameters["tick"] = 1.0 / control_hz
    parameters["clock_limit"] = round(SHOT_CLOCK * control_hz)
    _derive_rows(parameters)
    return parameters


def spec_of(params: NDArray[np.void]) -> TableSpec:
    """The `TableSpec` of one `PARAMETERS` record."""
    return TableSpec(*params["spec"].tolist())


def with_specs(parameters: NDArray[np.void], specs: NDArray[np.float64]) -> NDArray[np.void]:
    """A copy of `PARAMETERS` records with other specs, (n, len(FIELDS)), and all that follows from them."""
    changed = parameters.copy()
    changed["spec"] = specs
    _derive_rows(changed)
    return changed
