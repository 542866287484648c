"""The state of a game as NumPy records: one record for each table, so that a saved state is a copy of a row.

Everything that decides what happens next is in `STATE`, clocks and random stream included (and, behind a camera, in
`camera.CAMERA_STATE`). Nothing in it can be worked out from the rest. `PARAMETERS` is what a `TableSpec` and the
control rate come to, in the form in which the compiled code wants it; one record serves all tables of a game, or each
table has its own.
"""

from __future__ import annotations

import numpy as np

from airhockey_env.engine.records import SURFACE

LEFT, RIGHT, PUCK = range(3)
"""Numbers of the discs; LEFT and RIGHT are also the numbers of the two players and their seats."""

SEATS = (LEFT, RIGHT)

SHOT_CLOCK = 7.0
"""s that a side has to send the puck back over the centre line (rules of the USA Air Hockey Association)."""

HOME = 0.8
"""A paddle's place at a serve, on the long axis: share of the half length from the centre."""

OBSERVATION_SIZE = 13
ROW_SIZE = OBSERVATION_SIZE + 2
"""Columns of a row of a player's history: an observation and the action that led to it."""
CONTACT_ROWS = 8
"""Contacts of one step that a batch keeps for each table."""

PARAMETERS = np.dtype(
    [
        ("spec", np.float64, (15,)),  # the TableSpec's fields in their order; all else follows from these,
        ("tick", np.float64),  # s, one control step,
        ("clock_limit", np.int64),  # and ticks of the shot clock: see parameters.derive
        *((name, SURFACE[name]) for name in SURFACE.names or ()),
        ("radius", np.float64, (3,)),  # m: left paddle, right paddle, puck
        ("inverse_mass", np.float64, (3,)),  # 1/kg
        ("glide_p", np.float64),  # half a tick of glide, see engine.motion
        ("glide_q", np.float64),
        ("glide_r", np.float64),
        ("glide_s", np.float64),
        ("bend", np.float64),  # how much flatter a puck leaves a wall: the tangential restitution over the other one
        ("puck_speed", np.float64),  # m/s, greatest
        ("paddle_speed", np.float64),  # m/s, greatest
        ("paddle_step", np.float64),  # m/s, greatest change of a paddle's velocity in a tick
        ("per_x", np.float64),  # scales of the observation: 1/m
        ("per_y", np.float64),
        ("per_paddle", np.float64),  # s/m
        ("per_puck", np.float64),
        ("per_clock", np.float64),  # 1/ticks
    ],
    align=True,
)

STATE = np.dtype(
    [
        ("position", np.float64, (3, 2)),  # m: left paddle, right paddle, puck
        ("velocity", np.float64, (3, 2)),  # m/s
        ("stream", np.uint64),  # state of the table's own random stream
        ("plan", np.float64),  # 0 to 1, drawn when the puck changes sides: how a scripted player shoots
        ("wander", np.float64, (2, 2)),  # the present actions of players that wander
        ("skill", np.float64, (2,)),  # share of its speed that a scripted player uses, in each seat
        ("member", np.int32, (2,)),  # who plays: a place in the pool of each seat
        ("score", np.int32, (2,)),  # points: left, right
        ("steps", np.int32),  # so far in the episode
        ("clock", np.int32),  # ticks since the puck came to the side that it is on
        ("side", np.int32),  # that side: -1 left, +1 right; 0 before the first episode
        ("done", np.int32),  # 1: the episode is over and the next has not begun
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
        ("randomized", np.bool_),  # draw the tables' parameters for every episode
        ("autoreset", np.int8),  # one of the constants below
        ("observed", np.int8, (2,)),  # seats whose players look at observations: scripted ones do not
    ],
    align=True,
)

AUTORESET_DISABLED, AUTORESET_NEXT_STEP, AUTORESET_SAME_STEP = range(3)


def observation_shape(stack: int) -> tuple[int, ...]:
    """The shape of a player's observations of the state: of one alone, or of a stack of rows."""
    return (OBSERVATION_SIZE,) if stack == 1 else (stack, ROW_SIZE)
