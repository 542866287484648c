"""What a player can foresee: where the puck goes if nobody touches it, and what comes of the next kiss.

Where the puck will be depends on quotients of numbers of an observation, such as the slope of its path, and these are
hard to compute for a small network of sums and ReLUs. What is foreseen is an approximation: the puck loses no speed,
bounces off the side walls at most twice, and meets neither posts nor end walls; a paddle keeps its velocity.

All is written with +, -, *, /, `abs` and `np.sqrt` alone. So the same functions run in compiled code, on arrays, and on
whatever else has these operations, such as the nodes of an ONNX graph.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from airhockey_env.compiled import compiled
from airhockey_env.kernel.state import OBSERVATION_SIZE
from airhockey_env.tables import TableSpec

OF_A_SIDE = 15
FORESEEN_SIZE = 2 * OF_A_SIDE
"""Numbers that are foreseen: as many of the player's own shots as of the opponent's, which come last."""

SOON, VERY_SOON = 0.4, 0.1
"""What takes this time counts half as much as what happens now, s."""
SEEN_KISSES = 0.25
"""Later kisses are not foreseen, s."""

_REST = 0.01
"""Added to speeds that are divided by, m/s: a puck that rests goes nowhere."""
_NEAR = 0.02
"""Added to distances in the same way, m."""


class Table(NamedTuple):
    """What has to be known of a table, in m, m/s and shares."""

    half_length: float
    half_width: float
    half_goal: float
    puck: float  # radius
    reach: float  # of a kiss: the sum of the radii
    bend: float  # slope of the path after a bounce at a side wall by the slope before
    restitution: float  # between paddle and puck
    paddle_speed: float
    puck_speed: float


def table_of(spec: TableSpec) -> Table:
    """The table of a specification."""
    return Table(
        half_length=0.5 * spec.length,
        half_width=0.5 * spec.width,
        half_goal=0.5 * spec.goal_width,
        puck=spec.puck_radius,
        reach=spec.puck_radius + spec.paddle_radius,
        bend=spec.wall_restitution / max(spec.wall_tangential, 0.1),
        restitution=spec.paddle_restitution,
        paddle_speed=spec.paddle_speed,
        puck_speed=spec.puck_speed,
    )


@register_jitable
def _relu(value: Any) -> Any:
    return 0.5 * (value + abs(value))


@register_jitable
def _clamp(value: Any, limit: Any) -> Any:
    return 0.5 * (abs(value + limit) - abs(value - limit))


@register_jitable
def _step(value: Any) -> Any:
    """0 for negative numbers and 1 for positive ones."""
    return _relu(value) / (abs(value) + 1e-9)


@register_jitable
def _half_after(time: Any, half: Any) -> Any:
    return half / (half + time)


@register_jitable
def _if_coming(value: Any, speed: Any) -> Any:
    """The value for a positive speed, and 0 for a negative one."""
    return value * _relu(speed) / (_relu(speed) + _REST)


@register_jitable
def _passage(x: Any, y: Any, vx: Any, vy: Any, line: Any, table: Any) -> tuple[Any, Any]:
    """When and where the puck passes a line ahead, in +x: the time, s, and y after up to two bounces, m."""
    speed, distance = _relu(vx) + _REST, _relu(line - x)
    straight = y + distance * vy / speed  # as if there were no walls
    wall, bend = table.half_width - table.puck, table.bend
    left, right = _relu(straight - wall), _relu(-straight - wall)
    bounced = left - right
    twice = _relu(bend * left - 2.0 * wall) - _relu(bend * right - 2.0 * wall)
    return (distance + _NEAR) / speed, _clamp(straight - (1.0 + bend) * (bounced - twice), wall)


@register_jitable
def _kiss(x: Any, y: Any, vx: Any, vy: Any, paddle: Any, table: Any) -> tuple[Any, Any, Any, Any, Any, Any, Any]:
    """The next kiss of a paddle (x, y, vx, vy) with the puck.

    Returns:
        How near in time the puck is to the paddle, 0 to 1; the same, but 0 if they miss each other; by how much their
        paths miss each other, with a sign, where 1 is the reach of a kiss; and the puck after the kiss: x, y, vx, vy.
    """
    dx, dy, wx, wy = x - paddle[0], y - paddle[1], vx - paddle[2], vy - paddle[3]
    w = np.sqrt(wx * wx + wy * wy + _REST * _REST)
    ux, uy = wx / w, wy / w
    nearest = -dx * ux - dy * uy  # way to go until then
    miss = (dx * uy - dy * ux) / table.reach
    chord = np.sqrt(_relu(1.0 - miss * miss))  # cosine of the angle between the path and the normal at the kiss
    ahead = _step(nearest)  # 0 for a puck that goes away
    time = _relu(nearest - table.reach * chord) / w
    # The normal, from the paddle to the puck, is u turned by the angle whose sine is the miss.
    nx, ny = -chord * ux + miss * uy, -chord * uy - miss * ux
    gain = (1.0 + table.restitution) * ahead * chord * w
    near = ahead * _relu(1.0 - time / SEEN_KISSES)
    return near, near * _step(1.0 - miss * miss), miss, x + time * vx, y + time * vy, vx + gain * nx, vy + gain * ny


@register_jitable
def _foresee_side(paddle: Any, other: Any, x: Any, y: Any, vx: Any, vy: Any, table: Any, out: Any, first: int) -> None:
    """Write what comes of the shots of one side, which sees its own goal at -x, to `out` from `first` on."""
    goal = table.half_length - table.puck
    time, at = _passage(x, y, vx, vy, goal, table)
    soon = _if_coming(_half_after(time, SOON), vx)
    reached, at_paddle = _passage(x, y, vx, vy, other[0], table)
    reaches = _if_coming(_half_after(reached, SOON), vx)
    near, kissed, miss, kiss_x, kiss_y, kiss_vx, kiss_vy = _kiss(x, y, vx, vy, paddle, table)
    shot_time, shot_at = _passage(kiss_x, kiss_y, kiss_vx, kiss_vy, goal, table)
    shot = _if_coming(kissed, kiss_vx)
    scale = 1.0 / table.half_width
    # The way of the puck to the other goal,
    out[first] = _half_after(time, VERY_SOON) * soon
    out[first + 1] = soon
    out[first + 2] = 2.0 * scale * soon * at
    out[first + 3] = 3.0 * scale * soon * (at - other[1])
    # to the other paddle,
    out[first + 4] = _half_after(reached, VERY_SOON) * reaches
    out[first + 5] = 3.0 * scale * reaches * (at_paddle - other[1])
    # the kiss with the own paddle,
    out[first + 6] = kissed
    out[first + 7] = near * _clamp(miss, 2.0)
    out[first + 8] = 3.0 / table.puck_speed * kissed * kiss_vx
    out[first + 9] = 3.0 / table.puck_speed * kissed * kiss_vy
    # and the way from there to the other goal.
    out[first + 10] = shot
    out[first + 11] = 3.0 * scale * shot * shot_at
    out[first + 12] = 3.0 * scale * shot * (shot_at - other[1])
    out[first + 13] = shot * _relu(1.0 - abs(shot_at) / table.half_goal)
    out[first + 14] = shot * _half_after(shot_time, SOON)


@register_jitable
def foresee(o: Any, table: Any, out: Any) -> None:
    """Write the numbers that are foreseen from those of an observation to `out`, `FORESEEN_SIZE` of them."""
    x, y, paddle, puck = table.half_length, table.half_width, table.paddle_speed, table.puck_speed
    own = (o[0] * x, o[1] * y, o[2] * paddle, o[3] * paddle)
    other = (o[4] * x, o[5] * y, o[6] * paddle, o[7] * paddle)
    puck_x, puck_y, puck_vx, puck_vy = o[8] * x, o[9] * y, o[10] * puck, o[11] * puck
    turned_own = (-own[0], -own[1], -own[2], -own[3])
    turned_other = (-other[0], -other[1], -other[2], -other[3])
    _foresee_side(own, other, puck_x, puck_y, puck_vx, puck_vy, table, out, 0)
    _foresee_side(turned_other, turned_own, -puck_x, -puck_y, -puck_vx, -puck_vy, table, out, OF_A_SIDE)


@compiled
def add_foreseen(observations, table, out):
    """Write observations (N, 13) float32 and what is foreseen from them to `out`, (N, 13 + FORESEEN_SIZE) float32."""
    for i in range(len(observations)):
        out[i, :OBSERVATION_SIZE] = observations[i]
        foresee(observations[i], table, out[i, OBSERVATION_SIZE:])


def with_foresight(observations: NDArray[np.float32], table: Table) -> NDArray[np.float32]:
    """Observations (N, 13) and what is foreseen from them, (N, 13 + FORESEEN_SIZE)."""
    out = np.empty((len(observations), OBSERVATION_SIZE + FORESEEN_SIZE), np.float32)
    add_foreseen(observations, table, out)
    return out
