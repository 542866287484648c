"""Rewards: points alone, or points and a potential that tells an agent early what leads to them.

Potential-based terms (Ng, Harada and Russell, "Policy invariance under reward transformations", ICML 1999): with
`SHAPING_DISCOUNT` as the agent's discount, discount * potential(after) - potential(before) leaves the best policy what
it was. A state after the end of an episode has the potential 0.
"""

from __future__ import annotations

import math

from airhockey_env.compiled import inlined
from airhockey_env.kernel.observations import view
from airhockey_env.kernel.state import LEFT, PUCK, RIGHT

SHAPING_DISCOUNT = 0.99

PROGRESS, SPEED, DISTANCE = 0.2, 0.4, 0.2
"""Weights of the potential's parts; a goal is worth 1."""


@inlined
def potential(table, physics, player):
    """How promising the table is for `player` (LEFT or RIGHT), about -1 to 1.

    A puck far forward and flying forward is good; and while it is on the own side, so is a paddle close behind it.
    """
    seen = view(table, player)
    progress = seen.puck_x / physics.half_length
    speed = seen.puck_vx / physics.puck_speed
    behind_x = seen.puck_x - 1.5 * (physics.radius[player] + physics.radius[PUCK]) - seen.x
    behind_y = seen.puck_y - seen.y
    distance = math.sqrt(behind_x * behind_x + behind_y * behind_y) / physics.half_length
    own = min(max(-2.0 * progress, 0.0), 1.0)
    return PROGRESS * progress + SPEED * speed - DISTANCE * own * distance


@inlined
def keep_potentials(table, physics, settings):
    """Note the potentials of a state that no step led to: those that the next step's shaping starts from."""
    if settings.shaped:
        table.potential[LEFT] = potential(table, physics, LEFT)
        if settings.both_sides:
            table.potential[RIGHT] = potential(table, physics, RIGHT)


@inlined
def shaping(table, physics, player, terminated):
    """A player's potential-based term for the step that led here; the table keeps the potential for the next one."""
    before = table.potential[player]
    after = 0.0 if terminated else potential(table, physics, player)
    table.potential[player] = after
    return SHAPING_DISCOUNT * after - before
