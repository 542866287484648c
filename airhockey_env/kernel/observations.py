"""What a player sees: always from the own side, in [-1, 1]."""

from __future__ import annotations

from typing import NamedTuple

from airhockey_env.compiled import inlined
from airhockey_env.kernel.state import LEFT, PUCK, RIGHT


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
def view(table, player):
    """The table as `player` (LEFT or RIGHT) sees it."""
    s = 1.0 if player == LEFT else -1.0
    other = RIGHT if player == LEFT else LEFT
    p, v = table.position, table.velocity
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
def observe(table, physics, player, out, i):
    """Write a player's observation of the table to row i of `out`, (N, 13) float32; see `AirHockeyEnv`."""
    seen = view(table, player)
    out[i, 0] = _share(seen.x, physics.per_x)
    out[i, 1] = _share(seen.y, physics.per_y)
    out[i, 2] = _share(seen.vx, physics.per_paddle)
    out[i, 3] = _share(seen.vy, physics.per_paddle)
    out[i, 4] = _share(seen.other_x, physics.per_x)
    out[i, 5] = _share(seen.other_y, physics.per_y)
    out[i, 6] = _share(seen.other_vx, physics.per_paddle)
    out[i, 7] = _share(seen.other_vy, physics.per_paddle)
    out[i, 8] = _share(seen.puck_x, physics.per_x)
    out[i, 9] = _share(seen.puck_y, physics.per_y)
    out[i, 10] = _share(seen.puck_vx, physics.per_puck)
    out[i, 11] = _share(seen.puck_vy, physics.per_puck)
    own_side = table.side < 0 if player == LEFT else table.side > 0
    used = table.clock * physics.per_clock
    out[i, 12] = used if own_side else 0.0 - used
