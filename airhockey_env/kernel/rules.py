"""The rules: serves, the shot clock, goals, and who serves next. Physics reports, this judges.

After the rules of the USA Air Hockey Association, as far as a simulation needs them.
"""

from __future__ import annotations

from airhockey_env.compiled import compiled, inlined
from airhockey_env.kernel.random_stream import draw, draw_between
from airhockey_env.kernel.state import HOME, LEFT, PUCK, RIGHT

SERVE_NEAR, SERVE_FAR = 0.2, 0.5
"""A served puck's distance from the centre line, share of the half length."""

SERVE_WIDE = 0.5
"""A served puck's greatest distance from the long axis, share of the half width."""


@compiled
def place_paddles(table, physics):
    """Paddles rest at home, and so does whatever else moved."""
    for player in (LEFT, RIGHT):
        table.position[player, 0] = (-HOME if player == LEFT else HOME) * physics.half_length
        table.position[player, 1] = 0.0
    for disc in range(3):
        table.velocity[disc, 0] = 0.0
        table.velocity[disc, 1] = 0.0


@compiled
def serve(table, physics, side):
    """Give the puck to a side (-1 left, +1 right): paddles at home, the puck at rest somewhere in front of that one."""
    place_paddles(table, physics)
    table.position[PUCK, 0] = side * physics.half_length * draw_between(table, SERVE_NEAR, SERVE_FAR)
    table.position[PUCK, 1] = side * physics.half_width * draw_between(table, -SERVE_WIDE, SERVE_WIDE)
    give(table, side)


@compiled
def give(table, side):
    """The puck is now that side's to play: its clock starts."""
    table.side = side
    table.clock = 0
    table.plan = draw(table)


@inlined
def judge(table, physics, goal):
    """Keep the score and the clock after a tick in which the puck crossed the goal line of side `goal` (0 for none).

    Returns:
        point: +1 if the left player scored, -1 if the right one did, else 0.
        foul: whether the side that has the puck has had it for too long.
    """
    if goal != 0:
        table.score[0 if goal > 0 else 1] += 1
        return goal, False
    if table.position[PUCK, 0] * table.side < 0.0:
        give(table, -table.side)
        return 0, False
    table.clock += 1
    return 0, table.clock > physics.clock_limit


@inlined
def play_on(table, physics, point, foul):
    """After a goal the side that conceded serves; after a foul, the other side."""
    if point != 0:
        serve(table, physics, point)
    elif foul:
        serve(table, physics, -table.side)
