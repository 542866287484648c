"""The state of a game as NumPy records: one record a table, so that a state is a copy of a row.

Everything that decides what happens next lies in `TABLE`, clocks and random stream included. `PHYSICS` is what a
`TableSpec` and the control rate come to, in the form in which the compiled code wants it; one record serves all
tables of a batch, or each table has its own.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from airhockey_env.compiled import records
from airhockey_env.engine.motion import glide_coefficients
from airhockey_env.engine.records import SURFACE
from airhockey_env.tables import TableSpec

LEFT, RIGHT, PUCK = range(3)
"""Numbers of the discs."""

SHOT_CLOCK = 7.0
"""s that a side has to send the puck back over the centre line (rules of the USA Air Hockey Association)."""

HOME = 0.8
"""A paddle's place at a serve, on the long axis: share of the half length from the centre."""

OBSERVATION_SIZE = 13
CONTACT_ROWS = 8
"""Contacts of one step that a batch keeps for each table."""

PHYSICS = np.dtype(
    [
        *((name, SURFACE[name]) for name in SURFACE.names or ()),
        ("tick", np.float64),  # s, one control step
        ("radius", np.float64, (3,)),  # m: left paddle, right paddle, puck
        ("inverse_mass", np.float64, (3,)),  # 1/kg
        ("glide_p", np.float64),  # half a tick of glide, see engine.motion
        ("glide_q", np.float64),
        ("glide_r", np.float64),
        ("glide_s", np.float64),
        ("puck_speed", np.float64),  # m/s, greatest
        ("paddle_speed", np.float64),  # m/s, greatest
        ("paddle_step", np.float64),  # m/s, greatest change of a paddle's velocity in a tick
        ("clock_limit", np.int32),  # ticks
        ("per_x", np.float64),  # scales of the observation: 1/m
        ("per_y", np.float64),
        ("per_paddle", np.float64),  # s/m
        ("per_puck", np.float64),
        ("per_clock", np.float64),  # 1/ticks
    ],
    align=True,
)

TABLE = np.dtype(
    [
        ("position", np.float64, (3, 2)),  # m: left paddle, right paddle, puck
        ("velocity", np.float64, (3, 2)),  # m/s
        ("stream", np.uint64),  # state of the table's own random stream
        ("n_contacts", np.int32),  # in the last step
        ("success", np.int32),  # 1 if the last step ended the episode with success, else 0
        ("hits", np.int32, (3,)),  # the engine's count of contacts in the tick
        ("steps", np.int32),  # so far in the episode
        ("clock", np.int32),  # ticks since the puck came to the side that it is on
        ("side", np.int8),  # that side: -1 left, +1 right
        ("done", np.bool_),  # the episode is over and the next has not begun
        ("player", np.int8, (2,)),  # who drives the left and the right paddle, see opponents
        ("score", np.int32, (2,)),  # points: left, right
        ("skill", np.float64, (2,)),  # share of its speed that a scripted player uses
        ("plan", np.float64),  # 0 to 1, drawn when the puck changes sides: how a scripted player shoots
        ("wander", np.float64, (2, 2)),  # the present actions of players that wander
        ("potential", np.float64, (2,)),  # of the shaped reward, in this state: for the left and the right player
    ],
    align=True,
)
"""The fields leave no gaps: bytes between fields are not always copied, and equal states should have equal bytes."""

SETTINGS = np.dtype(
    [
        ("task", np.int32),  # number of the task, see tasks
        ("points", np.int32),  # points that win a match
        ("max_steps", np.int32),  # steps that truncate an episode, 0 for no limit
        ("shaped", np.bool_),
        ("autoreset", np.int8),  # one of the constants below
        ("both_sides", np.bool_),  # write the right-hand player's observations and rewards too
    ],
    align=True,
)

AUTORESET_DISABLED, AUTORESET_NEXT_STEP, AUTORESET_SAME_STEP = range(3)


def physics_record(spec: TableSpec, control_hz: float) -> NDArray[np.void]:
    """`PHYSICS` of a table at a control rate, shape (1,)."""
    physics = records(1, PHYSICS)
    tick = 1.0 / control_hz
    row = physics[0]
    row["half_length"] = 0.5 * spec.length
    row["half_width"] = 0.5 * spec.width
    row["half_goal"] = 0.5 * spec.goal_width
    row["wall_restitution"] = spec.wall_restitution
    row["wall_tangential"] = spec.wall_tangential
    row["disc_restitution"] = spec.paddle_restitution
    row["tick"] = tick
    row["radius"] = (spec.paddle_radius, spec.paddle_radius, spec.puck_radius)
    row["inverse_mass"] = (0.0, 0.0, 1.0 / spec.puck_mass)
    row["glide_p"], row["glide_q"], row["glide_r"], row["glide_s"] = glide_coefficients(
        spec.drag_constant, spec.drag_linear, spec.drag_quadratic, 0.5 * tick
    )
    row["puck_speed"] = spec.puck_speed
    row["paddle_speed"] = spec.paddle_speed
    row["paddle_step"] = spec.paddle_acceleration * tick
    row["clock_limit"] = round(SHOT_CLOCK * control_hz)
    row["per_x"] = 2.0 / spec.length
    row["per_y"] = 2.0 / spec.width
    row["per_paddle"] = 1.0 / spec.paddle_speed
    row["per_puck"] = 1.0 / spec.puck_speed
    row["per_clock"] = 1.0 / float(row["clock_limit"])
    return physics
