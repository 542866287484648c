"""Broad phase: find the pairs of discs that could kiss before the tick is over.

The reach of a disc is the circle that it can get to by the end of the tick at 1.5 times its present speed. Only pairs
whose reaches overlap are checked for a kiss. If a bounce makes a disc faster than that, all reaches are computed again.
Pairs are checked in the same order as without the broad phase, so the contacts are the same to the bit. Regions where
nothing moves cost almost nothing.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from airhockey_env.compiled import compiled
from airhockey_env.engine.tolerances import SKIN

SLACK = 1.5
"""Factor on a disc's speed for its reach: most bounces between equal discs stay within it."""

ROUNDING = 1e-9
"""Relative margin on reaches, far more than all rounding errors in them."""

FEWEST = 12
"""Number of discs from which the broad phase pays off."""

PARTNERS = 64
"""Space for pairs, per disc. If there are more, all pairs are checked."""


class Near(NamedTuple):
    """The pairs of discs near enough to kiss. The partners of disc a are partner[start[a]:start[a + 1]], in order."""

    start: NDArray[np.int64]  # (n + 1,)
    partner: NDArray[np.int64]  # (n * PARTNERS,); each greater than a
    whole: NDArray[np.bool_]  # (1,) there was not enough space, so all pairs count
    greatest: NDArray[np.float64]  # (n,) m/s, speeds up to which the pairs are valid
    reach: NDArray[np.float64]  # (n,) m
    order: NDArray[np.int64]  # (n,) discs sorted by the left end of their reach along x


def make_near(n: int) -> Near:
    """Allocate a `Near` for n discs."""
    return Near(
        start=np.zeros(n + 1, np.int64),
        partner=np.zeros(n * PARTNERS, np.int64),
        whole=np.zeros(1, np.bool_),
        greatest=np.zeros(n),
        reach=np.zeros(n),
        order=np.arange(n, dtype=np.int64),
    )


@compiled
def _sort(order, keys):
    """Insertion sort of `order` by its keys, which are nearly sorted from the last call."""
    for k in range(1, order.shape[0]):
        disc = order[k]
        m = k
        while m > 0 and keys[order[m - 1]] > keys[disc]:
            order[m] = order[m - 1]
            m -= 1
        order[m] = disc


@compiled
def find_near(near, discs, time):
    """Find the pairs that could kiss within `time` seconds."""
    position, velocity, inverse_mass = discs.position, discs.velocity, discs.inverse_mass
    n = position.shape[0]
    start, partner, reach, order = near.start, near.partner, near.reach, near.order
    left = np.empty(n)
    for a in range(n):
        vx, vy = velocity[a, 0], velocity[a, 1]
        near.greatest[a] = SLACK * math.sqrt(vx * vx + vy * vy)
        size = abs(position[a, 0]) + abs(position[a, 1])
        reach[a] = (discs.radius[a] * (1.0 + SKIN) + near.greatest[a] * time) * (1.0 + ROUNDING) + size * ROUNDING
        left[a] = position[a, 0] - reach[a]
        start[a] = 0
    start[n] = 0
    _sort(order, left)
    near.whole[0] = False
    for fill in range(2):  # first count the pairs of each disc, then store them
        for k in range(n):
            a = order[k]
            right, y = position[a, 0] + reach[a], position[a, 1]
            for m in range(k + 1, n):
                b = order[m]
                if left[b] > right:
                    break
                if abs(position[b, 1] - y) > reach[a] + reach[b] or inverse_mass[a] + inverse_mass[b] == 0.0:
                    continue
                first = min(a, b)
                if fill:
                    partner[start[first]] = max(a, b)
                start[first] += 1
        if not fill:
            total = 0
            for a in range(n):
                total += start[a]
                start[a] = total - start[a]
            if total > partner.shape[0]:
                near.whole[0] = True
                return
    for a in range(n, 0, -1):  # storing has advanced every start to that of the next disc
        start[a] = start[a - 1]
    start[0] = 0
    for a in range(n):
        _sort_part(partner, start[a], start[a + 1])


@compiled
def _sort_part(values, first, last):
    """Insertion sort of a part of an array."""
    for k in range(first + 1, last):
        value = values[k]
        m = k
        while m > first and values[m - 1] > value:
            values[m] = values[m - 1]
            m -= 1
        values[m] = value


@compiled
def keep_near(near, discs, a, b, time):
    """After a bounce of disc a (with disc b, or an edge if b < 0), find the pairs again if one of them is too fast."""
    for disc in (a, b):
        if disc >= 0:
            vx, vy = discs.velocity[disc, 0], discs.velocity[disc, 1]
            if not vx * vx + vy * vy <= near.greatest[disc] * near.greatest[disc]:
                find_near(near, discs, time)
                return
