"""Rewards: points alone, or points and a potential that tells an agent early what leads to them.

Potential-based terms (Ng, Harada and Russell, "Policy invariance under reward transformations", ICML 1999): with
`SHAPING_DISCOUNT` as the agent's discount, discount * potential(after) - potential(before) leaves the best policy what
it was. A state after the end of an episode has the potential 0.
"""

from __future__ import annotations

import math

from airhockey_env.compiled import inlined
from airhockey_env.kernel.state import PUCK

SHAPING_DISCOUNT = 0.99

PROGRESS, SPEED, DISTANCE = 0.2, 0.4, 0.2
"""Weights of the potential's parts; a goal is worth 1."""


@inlined
def potential(view, params, player):
    """How promising the table is for `player` (LEFT or RIGHT), whose `View` this is: about -1 to 1.

    A puck far forward and flying forward is good; and while it is on the own side, so is a paddle close behind it.
    """
    progress = view.puck_x / params.half_length
    speed = view.puck_vx / params.puck_speed
    behind_x = view.puck_x - 1.5 * (params.radius[player] + params.radius[PUCK]) - view.x
    behind_y = view.puck_y - view.y
    distance = math.sqrt(behind_x * behind_x + behind_y * behind_y) / params.half_length
    own = min(max(-2.0 * progress, 0.0), 1.0)
    return PROGRESS * progress + SPEED * speed - DISTANCE * own * distance


@inlined
def shaping(before, after, terminated):
    """The shaping term of a step from potential `before` to potential `after`."""
    return SHAPING_DISCOUNT * (0.0 if terminated else after) - before
