"""Rewards: points alone, or points and a potential that tells an agent early what leads to them.

Potential-based terms (Ng, Harada and Russell, "Policy invariance under reward transformations", ICML 1999): with
`SHAPING_DISCOUNT` as the agent's discount, discount * potential(after) - potential(before) leaves the best policy what
it was. A state after the end of an episode has the potential 0.
"""

from __future__ import annotations

import math

from airhockey_env.compiled import inlined
from airhockey_env.kernel.observations import view_of
from airhockey_env.kernel.state import LEFT, PUCK, RIGHT

SHAPING_DISCOUNT = 0.99

PROGRESS, SPEED, DISTANCE = 0.2, 0.4, 0.2
"""Weights of the potential's parts; a goal is worth 1."""


@inlined
def potential(state, params, player):
    """How promising the table is for `player` (LEFT or RIGHT), about -1 to 1.

    A puck far forward and flying forward is good; and while it is on the own side, so is a paddle close behind it.
    """
    view = view_of(state, player)
    progress = view.puck_x / params.half_length
    speed = view.puck_vx / params.puck_speed
    behind_x = view.puck_x - 1.5 * (params.radius[player] + params.radius[PUCK]) - view.x
    behind_y = view.puck_y - view.y
    distance = math.sqrt(behind_x * behind_x + behind_y * behind_y) / params.half_length
    own = min(max(-2.0 * progress, 0.0), 1.0)
    return PROGRESS * progress + SPEED * speed - DISTANCE * own * distance


@inlined
def potentials(state, params, settings):
    """The potentials that the shaping terms of the coming step start from: (left, right), 0 where none are needed."""
    left = potential(state, params, LEFT) if settings.shaped and settings.observed[LEFT] else 0.0
    right = potential(state, params, RIGHT) if settings.shaped and settings.observed[RIGHT] else 0.0
    return left, right


@inlined
def earn(state, params, settings, point, terminated, before):
    """The rewards of the step that led here, (left, right).

    Args:
        point: +1 if the left player scored, -1 if the right one did, else 0.
        terminated: whether the episode is over: its last state has the potential 0.
        before: what `potentials` gave before the step.
    """
    left, right = float(point), float(-point)
    if settings.shaped and settings.observed[LEFT]:
        after = 0.0 if terminated else potential(state, params, LEFT)
        left += SHAPING_DISCOUNT * after - before[LEFT]
    if settings.shaped and settings.observed[RIGHT]:
        after = 0.0 if terminated else potential(state, params, RIGHT)
        right += SHAPING_DISCOUNT * after - before[RIGHT]
    return left, right
