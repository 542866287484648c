"""Cutting a track into flights: the stretches in which nothing strikes the puck.

The cut is the best of all: dynamic programming finds the stretches whose smooth curves fit the track with the least
sum of squares plus a price for each cut (optimal partitioning: Jackson and others, "An algorithm for optimal
partitioning of data on an interval", 2005).
"""

from __future__ import annotations

import numpy as np

from agents.fitting.tracks import Track
from airhockey_env.compiled import compiled

LEAST_NOISE = 5e-5
"""m. A track without any noise would leave no tolerance for its own rounding."""
PRICE = 30.0
"""The sum of squares that a cut has to save, in units of the noise's variance."""
LONGEST_GAP = 0.1
"""s without a frame after which a new flight begins."""
GLITCH = 8.0
"""Standard deviations between a frame and its neighbours, on both sides, above which it shows something else."""
CURVES = np.array([1.0, 5.0, 1.0, 0.3])
"""Expected size of a curve's coefficients in powers of time: m from the first frame, m/s, m/s**2 and m/s**3. The last
two allow for drag and keep a curve from bending around a bounce."""


def measure_noise(track: Track) -> float:
    """The standard deviation of the noise on x and on y, m, from how far frames lie from between their neighbours.

    The median does not mind the few frames beside a bounce.
    """
    t = track.time
    share = (t[1:-1] - t[:-2]) / (t[2:] - t[:-2])
    scale = np.sqrt(1.0 + share**2 + (1.0 - share) ** 2)
    near = t[2:] - t[:-2] < LONGEST_GAP
    if not near.any():
        return LEAST_NOISE
    apart = [np.abs(p[1:-1] - (1.0 - share) * p[:-2] - share * p[2:]) / scale for p in (track.x, track.y)]
    return max(LEAST_NOISE, float(np.median(np.concatenate([one[near] for one in apart]))) / 0.6745)


def drop_glitches(track: Track, noise: float) -> Track:
    """Leave out single frames that lie neither on the line of the two before nor on that of the two after."""
    t = track.time
    far = np.zeros((2, len(t)), np.bool_)  # from the line of the two before, of the two after
    for side, (near, beyond) in enumerate(((-1, -2), (1, 2))):
        k = np.arange(2, len(t) - 2)
        ratio = (t[k] - t[k + near]) / (t[k + near] - t[k + beyond])
        scale = noise * np.sqrt(1.0 + (1.0 + ratio) ** 2 + ratio**2)
        for p in (track.x, track.y):
            far[side, k] |= np.abs(p[k] - p[k + near] - ratio * (p[k + near] - p[k + beyond])) > GLITCH * scale
    return Track(*(column[~far.all(axis=0)] for column in track))


def find_flights(track: Track, noise: float) -> list[tuple[int, int]]:
    """The flights of a track as (first, last + 1) numbers of its frames; every frame is in one of them."""
    starts = _cut(track.time, track.x, track.y, noise, PRICE, LONGEST_GAP, (noise / CURVES) ** 2)
    bounds, end = [], len(track.time)
    while end > 0:
        bounds.append((int(starts[end]), end))
        end = int(starts[end])
    return bounds[::-1]


@compiled
def _cut(time, x, y, noise, price, gap, ridge):
    """For every number of frames from 0 to N, where the last flight of their best cut begins, (N + 1,).

    Args:
        time, x, y: (N,) s, m, m.
        noise: m.
        price: of a cut.
        gap: s, the longest within a flight.
        ridge: (4,) what is added to the diagonal of the normal equations.
    """
    n, size = len(time), 4
    best = np.full(n + 1, np.inf)
    best[0] = 0.0
    starts = np.zeros(n + 1, np.int64)
    for first in range(n):
        normal = np.zeros((4, 4))
        right = np.zeros((4, 2))
        factor = np.zeros((4, 4))
        powers = np.ones(4)
        squares = 0.0
        for k in range(size):
            normal[k, k] = ridge[k]
        for last in range(first, n):
            if last > first and time[last] - time[last - 1] > gap:
                break
            dx, dy = x[last] - x[first], y[last] - y[first]
            for k in range(1, size):
                powers[k] = powers[k - 1] * (time[last] - time[first])
            for j in range(size):
                right[j, 0] += powers[j] * dx
                right[j, 1] += powers[j] * dy
                for k in range(size):
                    normal[j, k] += powers[j] * powers[k]
            squares += dx * dx + dy * dy
            explained = 0.0
            for j in range(size):  # Cholesky: what the curve explains is |factor^-1 right|**2
                for k in range(j + 1):
                    total = normal[j, k]
                    for m in range(k):
                        total -= factor[j, m] * factor[k, m]
                    factor[j, k] = np.sqrt(total) if j == k else total / factor[k, k]
            for column in range(2):
                solved = np.zeros(4)
                for j in range(size):
                    total = right[j, column]
                    for m in range(j):
                        total -= factor[j, m] * solved[m]
                    solved[j] = total / factor[j, j]
                    explained += solved[j] * solved[j]
            cost = (squares - explained) / (noise * noise)
            total = best[first] + cost + price
            if total < best[last + 1]:
                best[last + 1] = total
                starts[last + 1] = first
            if cost > 2.0 * (last - first + 1) + 5.0 * price:  # cutting it is better, however it goes on
                break
    return starts
