"""Tasks: how an episode starts, when it ends, and what counts as success. Each stands in one place here.

To add one: write a `start_...` and an `end_...` function like those below, give it a number and a line in `TASKS`,
and call the two in `start_task` and `end_task`. docs/extending.md does it step by step.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from airhockey_env.compiled import compiled, inlined
from airhockey_env.kernel.random_stream import draw, draw_between
from airhockey_env.kernel.rules import give, place_paddles, serve
from airhockey_env.kernel.state import HOME, LEFT, PUCK, RIGHT
from airhockey_env.tables import TableSpec


class Task(NamedTuple):
    """What is fixed about a task outside of compiled code."""

    number: int
    points: int  # that win the episode
    max_episode_steps: int  # of the registered environment
    opponent: str  # of the registered environment


POINT, MATCH, HIT, DEFEND = range(4)

TASKS = {
    "point": Task(POINT, points=1, max_episode_steps=1500, opponent="striker"),
    "match": Task(MATCH, points=7, max_episode_steps=15_000, opponent="striker"),
    "hit": Task(HIT, points=1, max_episode_steps=500, opponent="idle"),
    "defend": Task(DEFEND, points=1, max_episode_steps=250, opponent="idle"),
}

AT_REST = 0.05
"""m/s. A slower puck goes nowhere any more."""

CAUGHT = 0.3
"""m/s. A slower puck is under control."""


@compiled
def start_task(state, params, task, side):
    """Put the table in a starting state of the task; `side` serves, -1 or +1, or 0 for one drawn at random."""
    if task == HIT:
        start_hit(state, params)
    elif task == DEFEND:
        start_defend(state, params)
    else:
        serve(state, params, side if side != 0 else -1 if draw(state) < 0.5 else 1)


class Puck(NamedTuple):
    """What the end of an episode may depend on besides the score: the puck after the step."""

    x: float  # m
    vx: float  # m/s
    vy: float
    side: int  # that it is on: -1 left, +1 right


@inlined
def end_task(task, points, score, puck, point, foul):
    """Whether the episode ends after this step, and if so whether it was a success for the left player.

    Args:
        points: that win a match.
        score: (left, right).
        point: +1 if the left player scored in this step, -1 if the right one did, else 0.
        foul: whether the shot clock ran out in this step.
    """
    if task == HIT:
        return end_hit(puck, point, foul)
    if task == DEFEND:
        return end_defend(puck, point, foul)
    return end_points(points, score, point)


@inlined
def end_points(points, score, point):
    """A point or a match: over when a side has the points that win; a success if that is the left one."""
    return max(score[LEFT], score[RIGHT]) >= points, point > 0


@compiled
def start_hit(state, params):
    """The puck rests anywhere on the middle of the own side, the own paddle somewhere near home."""
    park(state, params)
    stand(state, params, -HOME * params.half_length, draw_between(state, -0.5, 0.5) * params.half_width)
    state.position[PUCK, 0] = -params.half_length * draw_between(state, 0.1, 0.5)
    state.position[PUCK, 1] = (params.half_width - 1.5 * params.radius[PUCK]) * draw_between(state, -1.0, 1.0)
    give(state, -1)


@inlined
def end_hit(puck, point, foul):
    """Over with a goal, a foul, or a puck that came to rest on the far side; a success with a goal for."""
    missed = puck.x > 0.0 and puck.vx * puck.vx + puck.vy * puck.vy < AT_REST * AT_REST
    return point != 0 or foul or missed, point > 0


@compiled
def start_defend(state, params):
    """A shot comes from the far side, straight or off a side wall, at 2 to 9 m/s; the paddle is somewhere near home."""
    park(state, params)
    own_x = -params.half_length * draw_between(state, 0.6, 0.9)
    stand(state, params, own_x, params.half_width * draw_between(state, -0.5, 0.5))
    wall = params.half_width - params.radius[PUCK]
    clear = state.position[RIGHT, 0] - params.radius[RIGHT] - params.radius[PUCK]  # of the parked paddle
    x = min(params.half_length * draw_between(state, 0.0, 0.6), clear)
    y = 0.95 * wall * draw_between(state, -1.0, 1.0)
    speed = min(draw_between(state, 2.0, 9.0), params.puck_speed)
    goal_y = (params.half_goal - params.radius[PUCK]) * draw_between(state, -1.0, 1.0)
    course = draw(state)
    if course < 0.5:  # off a wall, towards the image of the goal (see scripted)
        side = 1.0 if course < 0.25 else -1.0
        goal_y = side * wall + params.bend * (side * wall - goal_y)
    dx, dy = -params.half_length - x, goal_y - y
    length = math.sqrt(dx * dx + dy * dy)
    state.position[PUCK, 0], state.position[PUCK, 1] = x, y
    state.velocity[PUCK, 0], state.velocity[PUCK, 1] = speed * dx / length, speed * dy / length
    give(state, 1)


@inlined
def end_defend(puck, point, foul):
    """Over with a goal, or once the shot is kept out: sent back over the centre line, or under control.

    A success unless there was a goal against.
    """
    returned = puck.side > 0 and puck.vx >= 0.0
    caught = puck.vx * puck.vx + puck.vy * puck.vy < CAUGHT * CAUGHT
    return point != 0 or foul or returned or caught, point >= 0


@inlined
def stand(state, params, x, y):
    """Put the own paddle on a place or, where a large paddle on a small table has no room there, next to it."""
    far, side = params.half_length - params.radius[LEFT], params.half_width - params.radius[LEFT]
    state.position[LEFT, 0] = max(x, -far)
    state.position[LEFT, 1] = min(max(y, -side), side)


@compiled
def park(state, params):
    """Paddles rest: the own one at home, the opponent's in a far corner, where it covers no goal."""
    place_paddles(state, params)
    far = params.half_length - params.radius[RIGHT]
    state.position[RIGHT, 0] = far
    state.position[RIGHT, 1] = params.half_width - params.radius[RIGHT]


def right_start(spec: TableSpec, task: int) -> tuple[float, float]:
    """Where the right paddle is when an episode of a task begins, m."""
    if task in (HIT, DEFEND):
        return 0.5 * spec.length - spec.paddle_radius, 0.5 * spec.width - spec.paddle_radius
    return 0.5 * HOME * spec.length, 0.0
