"""Broad phase: which pairs of discs could kiss at all before the tick is over.

No disc leaves its reach, the circle that it can get to until the end of the tick at half as much again as its present
speed, so only pairs whose reaches meet are asked for a kiss. A bounce that makes a disc faster than that draws all
reaches anew. The pairs that are asked come in the same order as if all were, so the contacts are the same to the bit;
a region where nothing moves costs next to nothing.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from airhockey_env.compiled import compiled
from airhockey_env.engine.tolerances import SKIN

SLACK = 1.5
"""A disc's reach is for this much of its speed: most bounces between equals stay within it."""

ROUNDING = 1e-9
"""Share by which reaches are larger than that, far more than all rounding in them."""

FEWEST = 12
"""Discs on a table from which on it pays."""

PARTNERS = 64
"""Room for pairs, per disc; where there are more, all pairs are asked."""


class Near(NamedTuple):
    """The pairs of discs near enough to kiss: those of disc a are partner[start[a]:start[a + 1]], in order."""

    start: NDArray[np.int64]  # (n + 1,)
    partner: NDArray[np.int64]  # (n * PARTNERS,); each greater than a
    whole: NDArray[np.bool_]  # (1,) there was no room: all pairs count
    greatest: NDArray[np.float64]  # (n,) m/s, speeds up to which the pairs hold
    reach: NDArray[np.float64]  # (n,) m
    order: NDArray[np.int64]  # (n,) discs by where their reach begins along x


def make_near(n: int) -> Near:
    """Room for the pairs of n discs."""
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
    """Insertion sort of `order` by its keys: they are nearly in order from last time."""
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
    for fill in range(2):  # count the pairs of each disc, then note them
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
    for a in range(n, 0, -1):  # filling has moved every start to the next one's place
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
    """After a bounce of disc a (with disc b, or an edge if b < 0): new pairs if one is faster than they hold for."""
    for disc in (a, b):
        if disc >= 0:
            vx, vy = discs.velocity[disc, 0], discs.velocity[disc, 1]
            if not vx * vx + vy * vy <= near.greatest[disc] * near.greatest[disc]:
                find_near(near, discs, time)
                return
