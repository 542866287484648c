"""What a player sees: always from the own side, in [-1, 1]."""

from __future__ import annotations

from typing import NamedTuple

from airhockey_env.compiled import inlined
from airhockey_env.kernel.state import LEFT, PUCK, RIGHT

OWN_PADDLE = slice(0, 4)
"""Columns of an observation: x, y and velocity x, y of the player's own paddle,"""
OTHER_PADDLE = slice(4, 8)
"""of the opponent's paddle,"""
PUCK_COLUMNS = slice(8, 12)
"""and of the puck;"""
CLOCK_COLUMN = 12
"""and the shot clock."""


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
def _share(value, scale):
    """The share of a scale. Zero has no sign in it: it would be all that tells the two sides apart."""
    return value * scale + 0.0


@inlined
def observe(state, params, player, out, i):
    """Write a player's observation of table i to `out`, (2, N, 13) float32; see `AirHockeyEnv`."""
    view = view_of(state, player)
    out[player, i, 0] = _share(view.x, params.per_x)
    out[player, i, 1] = _share(view.y, params.per_y)
    out[player, i, 2] = _share(view.vx, params.per_paddle)
    out[player, i, 3] = _share(view.vy, params.per_paddle)
    out[player, i, 4] = _share(view.other_x, params.per_x)
    out[player, i, 5] = _share(view.other_y, params.per_y)
    out[player, i, 6] = _share(view.other_vx, params.per_paddle)
    out[player, i, 7] = _share(view.other_vy, params.per_paddle)
    out[player, i, 8] = _share(view.puck_x, params.per_x)
    out[player, i, 9] = _share(view.puck_y, params.per_y)
    out[player, i, 10] = _share(view.puck_vx, params.per_puck)
    out[player, i, 11] = _share(view.puck_vy, params.per_puck)
    own_side = state.side < 0 if player == LEFT else state.side > 0
    used = state.clock * params.per_clock
    out[player, i, 12] = used if own_side else 0.0 - used
