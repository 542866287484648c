"""The rules: serves, the shot clock, goals, and what ends an episode. Physics reports, this judges.

After the rules of the USA Air Hockey Association, as far as a simulation needs them.
"""

from __future__ import annotations

from airhockey_env.compiled import compiled, inlined
from airhockey_env.random_stream import draw, draw_between
from airhockey_env.records import HOME, LEFT, PUCK, RIGHT

SERVE_NEAR, SERVE_FAR = 0.2, 0.5
"""A served puck's distance from the centre line, share of the half length."""

SERVE_WIDE = 0.5
"""A served puck's greatest distance from the long axis, share of the half width."""


@compiled
def serve(table, physics, side):
    """Give the puck to a side (-1 left, +1 right): paddles at home, the puck at rest somewhere in front of that one."""
    for player in (LEFT, RIGHT):
        table.position[player, 0] = (-HOME if player == LEFT else HOME) * physics.half_length
        table.position[player, 1] = 0.0
    table.position[PUCK, 0] = side * physics.half_length * draw_between(table, SERVE_NEAR, SERVE_FAR)
    table.position[PUCK, 1] = side * physics.half_width * draw_between(table, -SERVE_WIDE, SERVE_WIDE)
    for disc in range(3):
        table.velocity[disc, 0] = 0.0
        table.velocity[disc, 1] = 0.0
    give(table, side)


@compiled
def give(table, side):
    """The puck is now that side's to play: its clock starts."""
    table.side = side
    table.clock = 0
    table.plan = draw(table)


@compiled
def start_episode(table, physics, side):
    """Begin an episode with a serve by `side`, or by a side drawn at random if it is 0."""
    table.steps = 0
    table.score[0] = 0
    table.score[1] = 0
    table.n_contacts = 0
    table.done = False
    if side == 0:
        side = -1 if draw(table) < 0.5 else 1
    serve(table, physics, side)


@inlined
def judge(table, physics, settings, goal):
    """Keep the score and the clock after a tick in which the puck crossed the goal line of side `goal` (0 for none).

    Returns:
        point: +1 if the left player scored, -1 if the right one did, else 0.
        terminated: whether that ended the episode. If not, the puck has been served to the side that conceded.
    """
    if goal != 0:
        winner = 0 if goal > 0 else 1
        table.score[winner] += 1
        terminated = table.score[winner] >= settings.points
        if not terminated:
            serve(table, physics, goal)
        return goal, terminated
    keep_clock(table, physics)
    return 0, False


@inlined
def keep_clock(table, physics):
    """Count the time that the puck has been on a side; past the limit it is a foul and the other side serves."""
    x = table.position[PUCK, 0]
    side = table.side
    if x * side < 0.0:
        give(table, -side)
        return
    table.clock += 1
    if table.clock > physics.clock_limit:
        serve(table, physics, -side)
