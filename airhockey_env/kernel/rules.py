"""The rules: serves, the shot clock, goals, and who serves next. Physics reports, this judges.

After the rules of the USA Air Hockey Association, as far as a simulation needs them.
"""

from __future__ import annotations

import math

from airhockey_env.compiled import compiled, inlined
from airhockey_env.kernel.random_stream import draw, draw_between
from airhockey_env.kernel.state import HOME, LEFT, PUCK, RIGHT

SERVE_NEAR, SERVE_FAR = 0.2, 0.5
"""A served puck's distance from the centre line, share of the half length."""

SERVE_WIDE = 0.5
"""A served puck's greatest distance from the long axis, share of the half width."""


@compiled
def place_paddles(state, params):
    """Paddles rest at home, and so does whatever else moved."""
    for player in (LEFT, RIGHT):
        state.position[player, 0] = (-HOME if player == LEFT else HOME) * params.half_length
        state.position[player, 1] = 0.0
    for disc in range(3):
        state.velocity[disc, 0] = 0.0
        state.velocity[disc, 1] = 0.0


@compiled
def place_puck(state, params, puck):
    """Begin an episode with the puck where the caller wants it, the left paddle at home.

    Args:
        puck: x, y (m), vx, vy (m/s) and the speed that these two come to; NaN where the task decides. What is faster
            than the table allows, which may be another one in every episode, is slowed down.
    """
    if not math.isnan(puck[0]):
        state.position[PUCK, 0], state.position[PUCK, 1] = puck[0], puck[1]
        state.position[LEFT, 0], state.position[LEFT, 1] = -HOME * params.half_length, 0.0
        state.side = -1 if puck[0] < 0.0 else 1
    if not math.isnan(puck[2]):
        share = min(1.0, params.puck_speed / puck[4])
        state.velocity[PUCK, 0], state.velocity[PUCK, 1] = share * puck[2], share * puck[3]


@compiled
def serve(state, params, side):
    """Give the puck to a side (-1 left, +1 right): paddles at home, the puck at rest somewhere in front of that one."""
    place_paddles(state, params)
    state.position[PUCK, 0] = side * params.half_length * draw_between(state, SERVE_NEAR, SERVE_FAR)
    state.position[PUCK, 1] = side * params.half_width * draw_between(state, -SERVE_WIDE, SERVE_WIDE)
    give(state, side)


@compiled
def give(state, side):
    """The puck is now that side's to play: its clock starts."""
    state.side = side
    state.clock = 0
    state.plan = draw(state)


@inlined
def judge(point, puck_x, side, clock, clock_limit):
    """The shot clock after a tick.

    Args:
        point: +1 if the left player scored, -1 if the right one did, else 0.
        puck_x: m, where the puck is.
        side: the side that it was on, -1 left, +1 right.
        clock: ticks since it came there.
        clock_limit: ticks that it may stay there.

    Returns:
        side, clock: those now.
        crossed: whether the puck came to the other side: its `plan` is to be drawn, see `give`.
        foul: whether the side that has the puck has had it for too long.
    """
    if point != 0:
        return side, clock, False, False
    if puck_x * side < 0.0:
        return -side, 0, True, False
    return side, clock + 1, False, clock + 1 > clock_limit


@compiled
def play_on(state, params, point, foul):
    """After a goal the side that conceded serves; after a foul, the other side."""
    if point != 0:
        serve(state, params, point)
    elif foul:
        serve(state, params, -state.side)
