"""What a player sees: always from the own side, in [-1, 1]."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from airhockey_env.compiled import inlined
from airhockey_env.kernel.state import LEFT, PUCK, RIGHT, SHOT_CLOCK
from airhockey_env.tables import TableSpec

OWN_PADDLE = slice(0, 4)
"""Columns of an observation: x, y and velocity x, y of the player's own paddle,"""
OTHER_PADDLE = slice(4, 8)
"""of the opponent's paddle,"""
PUCK_COLUMNS = slice(8, 12)
"""and of the puck;"""
CLOCK_COLUMN = 12
"""and the shot clock."""

COLUMNS = (
    *(f"{disc}_{part}" for disc in ("own_paddle", "opponent_paddle", "puck") for part in ("x", "y", "vx", "vy")),
    "shot_clock",
)
"""The names of the columns."""
SCALES = (
    *("half_length", "half_width", "paddle_speed", "paddle_speed") * 2,
    *("half_length", "half_width", "puck_speed", "puck_speed"),
    "shot_clock",
)
"""The names of what they are divided by; see `scales_of`."""


def scales_of(spec: TableSpec) -> NDArray[np.float64]:
    """What the columns of an observation are divided by on a table, (13,), in m, m/s and s."""
    sizes = {
        "half_length": 0.5 * spec.length,
        "half_width": 0.5 * spec.width,
        "paddle_speed": spec.paddle_speed,
        "puck_speed": spec.puck_speed,
        "shot_clock": SHOT_CLOCK,
    }
    return np.array([sizes[name] for name in SCALES])


class View(NamedTuple):
    """The table as one player sees it: own goal at -x, m and m/s. The right-hand player's is turned by 180 degrees."""

    x: float  # own paddle
    y: float
    vx: float
    vy: float
    other_x: float  # the opponent's paddle
    other_y: float
    other_vx: float
    other_vy: float
    puck_x: float
    puck_y: float
    puck_vx: float
    puck_vy: float


@inlined
def view_of(state, player):
    """The table as `player` (LEFT or RIGHT) sees it."""
    s = 1.0 if player == LEFT else -1.0
    other = RIGHT if player == LEFT else LEFT
    p, v = state.position, state.velocity
    return View(
        s * p[player, 0], s * p[player, 1], s * v[player, 0], s * v[player, 1],
        s * p[other, 0], s * p[other, 1], s * v[other, 0], s * v[other, 1],
        s * p[PUCK, 0], s * p[PUCK, 1], s * v[PUCK, 0], s * v[PUCK, 1],
    )  # fmt: skip


@inlined
def view_at(block, k, player):
    """The same of table k of a block."""
    s = 1.0 if player == LEFT else -1.0
    other = RIGHT if player == LEFT else LEFT
    p, v = block.position, block.velocity
    return View(
        s * p[player, 0, k], s * p[player, 1, k], s * v[player, 0, k], s * v[player, 1, k],
        s * p[other, 0, k], s * p[other, 1, k], s * v[other, 0, k], s * v[other, 1, k],
        s * p[PUCK, 0, k], s * p[PUCK, 1, k], s * v[PUCK, 0, k], s * v[PUCK, 1, k],
    )  # fmt: skip


@inlined
def _share(value, scale):
    """The share of a scale. Zero has no sign in it: it would be all that tells the two sides apart."""
    return value * scale + 0.0


@inlined
def observe(state, params, player, out, i):
    """Write a player's observation of table i to `out`, (2, N, 13) float32; see `AirHockeyEnv`."""
    # All is read before anything is written: so the compiler can write several numbers at once.
    view = view_of(state, player)
    x, y, paddle, puck = params.per_x, params.per_y, params.per_paddle, params.per_puck
    own_side = state.side < 0 if player == LEFT else state.side > 0
    used = state.clock * params.per_clock
    row = out[player, i]
    row[0], row[1] = _share(view.x, x), _share(view.y, y)
    row[2], row[3] = _share(view.vx, paddle), _share(view.vy, paddle)
    row[4], row[5] = _share(view.other_x, x), _share(view.other_y, y)
    row[6], row[7] = _share(view.other_vx, paddle), _share(view.other_vy, paddle)
    row[8], row[9] = _share(view.puck_x, x), _share(view.puck_y, y)
    row[10], row[11] = _share(view.puck_vx, puck), _share(view.puck_vy, puck)
    row[12] = used if own_side else 0.0 - used
