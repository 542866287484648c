"""Rewards: points alone, or points and a potential that tells an agent early what leads to them.

Potential-based terms (Ng, Harada and Russell, "Policy invariance under reward transformations", ICML 1999): with
`SHAPING_DISCOUNT` as the agent's discount, discount * potential(after) - potential(before) leaves the best policy what
it was. A state after the end of an episode has the potential 0.
"""

from __future__ import annotations

from airhockey_env.compiled import inlined
from airhockey_env.observations import view
from airhockey_env.records import LEFT

SHAPING_DISCOUNT = 0.99


@inlined
def potential(table, physics):
    """How promising the table is for the left player, about -1 to 1."""
    seen = view(table, LEFT)
    progress = seen.puck_x / physics.half_length
    return 0.2 * progress


@inlined
def shaping(table, physics, terminated):
    """The potential-based term for the step that led here; the table remembers the potential for the next one."""
    before = table.potential
    after = 0.0 if terminated else potential(table, physics)
    table.potential = after
    return SHAPING_DISCOUNT * after - before
