"""What all glides and bounces of a track say together: generalized least squares, with intervals.

Every bounce gives its own shares and its own place of the wall. Their errors are correlated, because two bounces share
a flight and all share the drag; the covariance is worked out to first order. Bounces on a real table also scatter by
more than the camera's noise, for example because the puck spins: the variance of this scatter is estimated too (Mandel
and Paule, "Interlaboratory evaluation of a material with unequal numbers of replicates", 1970) and added, so that the
intervals include it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from gymnasium.error import DependencyNotInstalled
from numpy.typing import NDArray

from agents.fitting.bounces import NORMAL, PLACE, TANGENTIAL, Bounce
from agents.fitting.glides import Glides

Array = NDArray[np.float64]

LEVEL = 0.95
"""The confidence level of all intervals."""
FEWEST = 3
"""Bounces that tell a share, and how much it scatters."""
ROUNDING = 1e-9
"""Relative variance that is added to each value, so that their covariance can be inverted."""


class Estimate(NamedTuple):
    """A number with its 95 % interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Estimates:
    """What a track tells."""

    drag: list[Estimate]
    """a, c and b of the deceleration a + c*v + b*v**2; none is below 0."""
    drag_covariance: Array
    """(3, 3), before the limit at 0."""
    shares: dict[int, Estimate]
    """`NORMAL` and `TANGENTIAL`, where bounces tell them."""
    scatter: dict[int, float]
    """Standard deviation of these shares from bounce to bounce, beyond the camera's noise."""
    fall: Estimate | None
    """Change of the normal share with the normal speed, s/m; None if too few bounces tell it."""
    walls: dict[tuple[int, int], Estimate]
    """Where the puck's centre turns round, by axis and side, m."""


def check_scipy(what: str) -> None:
    """Raise DependencyNotInstalled if SciPy is missing; `what` is the beginning of the message."""
    try:
        import scipy  # noqa: F401
    except ImportError as error:
        raise DependencyNotInstalled(f'{what} the extra "fit": pip install -e ".[fit]"') from error


def estimate(glides: Glides, bounces: Sequence[Bounce]) -> Estimates:
    """Combine the glides and bounces of a track."""
    from scipy.stats import norm, t

    rows = [
        (k, kind)
        for kind in (NORMAL, TANGENTIAL, PLACE)
        for k, bounce in enumerate(bounces)
        if np.isfinite(bounce.deviations[kind])
    ]
    counts = {kind: sum(1 for row in rows if row[1] == kind) for kind in (NORMAL, TANGENTIAL)}
    rows = [row for row in rows if row[1] == PLACE or counts[row[1]] >= FEWEST]
    kinds = np.array([kind for _, kind in rows], np.int64)
    walls = sorted({bounces[k].wall for k, kind in rows})
    names: list[int | tuple[int, int]] = [kind for kind in (NORMAL, TANGENTIAL) if (kinds == kind).any()]
    names += walls
    wanted = [bounces[k].wall if kind == PLACE else kind for k, kind in rows]
    design = np.array([[float(name == want) for name in names] for want in wanted]).reshape(len(rows), len(names))
    values = np.array([bounces[k].values[kind] for k, kind in rows])
    covariance = _covariance(glides, bounces, rows)

    scatter = {}
    for kind in (NORMAL, TANGENTIAL, PLACE):
        at = kinds == kind
        if at.any():
            used = design[at].any(axis=0)
            scatter[kind] = _scatter(values[at], design[np.ix_(at, used)], covariance[3:, 3:][np.ix_(at, at)])
            covariance[3:, 3:][at, at] += scatter[kind] ** 2
    # The drag that the glides alone give is an observation as well.
    every_value = np.concatenate([glides.drag, values])
    every_design = np.zeros((3 + len(rows), 3 + len(names)))
    every_design[:3, :3], every_design[3:, 3:] = np.eye(3), design
    means, errors = _solve(every_value, every_design, covariance)

    spread = float(norm.isf(0.5 * (1.0 - LEVEL)))
    spreads = np.full(3 + len(names), spread)
    for k, name in enumerate(names):
        kind = PLACE if isinstance(name, tuple) else name
        degrees = int(np.sum(kinds == kind)) - (len(walls) if kind == PLACE else 1)  # that tell the scatter
        spreads[3 + k] = t.isf(0.5 * (1.0 - LEVEL), degrees)
    number = 3 + sum(1 for name in names if name in (NORMAL, TANGENTIAL))
    limits = np.array([[0.0, np.inf]] * 3 + [[0.0, 1.0]] * (number - 3))
    bounded = _within(means[:number], errors[:number, :number], limits, spreads[:number])
    sides = np.sqrt(np.diag(errors))
    return Estimates(
        bounded[:3],
        errors[:3, :3],
        {kind: bounded[3 + k] for k, kind in enumerate(names) if isinstance(kind, int)},
        {kind: scatter[kind] for kind in (NORMAL, TANGENTIAL) if kind in scatter},
        _fall(bounces, rows, kinds, values, covariance[3:, 3:], scatter),
        {
            wall: Estimate(means[k], means[k] - spreads[k] * sides[k], means[k] + spreads[k] * sides[k])
            for k, wall in enumerate(names, start=3)
            if isinstance(wall, tuple)
        },
    )


def _covariance(glides: Glides, bounces: Sequence[Bounce], rows: Sequence[tuple[int, int]]) -> Array:
    """The covariance of the drag and of the given bounces' values, (3 + rows, 3 + rows), to first order."""
    from scipy.sparse import lil_array

    roots = {}
    own = lil_array((3 + len(rows), 4 * len(glides.flights)))
    by_drag = np.zeros((3 + len(rows), 3))
    by_drag[:3] = np.eye(3)
    for row, (k, kind) in enumerate(rows, start=3):
        bounce = bounces[k]
        by_drag[row] = bounce.by_drag[kind]
        for flight, change in ((bounce.flight, bounce.by_before), (bounce.flight + 1, bounce.by_after)):
            if flight not in roots:
                roots[flight] = np.linalg.cholesky(glides.start_covariances[flight])
            own[row, 4 * flight : 4 * flight + 4] = change[kind] @ roots[flight]
    own = own.tocsr()
    total = (own @ own.T).toarray() + by_drag @ glides.drag_covariance @ by_drag.T
    return total + ROUNDING * np.diag(np.diag(total))


def _solve(values: Array, design: Array, covariance: Array) -> tuple[Array, Array]:
    """Generalized least squares: the means and their covariance."""
    from scipy.linalg import cho_factor, cho_solve

    weighted = cho_solve(cho_factor(covariance), design)
    errors = np.linalg.inv(design.T @ weighted)
    return errors @ (weighted.T @ values), errors


def _scatter(values: Array, design: Array, covariance: Array) -> float:
    """The standard deviation that must be added to the errors of all values so that they explain the residuals."""
    from scipy.optimize import brentq

    degrees = len(values) - design.shape[1]
    if degrees < 1:
        return 0.0

    def excess(variance: float) -> float:
        full = covariance + variance * np.eye(len(values))
        residual = values - design @ _solve(values, design, full)[0]
        return float(residual @ np.linalg.solve(full, residual)) - degrees

    if excess(0.0) <= 0.0:
        return 0.0
    most = 2.0 * float(np.var(values - design @ np.linalg.lstsq(design, values, rcond=None)[0])) + 1e-12
    while excess(most) > 0.0:
        most *= 2.0
    return float(np.sqrt(brentq(excess, 0.0, most, rtol=1e-3)))


def _fall(
    bounces: Sequence[Bounce],
    rows: Sequence[tuple[int, int]],
    kinds: NDArray[np.int64],
    values: Array,
    covariance: Array,
    scatter: dict[int, float],
) -> Estimate | None:
    """How the normal share changes with the normal speed."""
    from scipy.stats import t

    at = kinds == NORMAL
    speeds = np.array([bounces[k].approach for k, kind in rows if kind == NORMAL])
    if len(speeds) < FEWEST + 1:
        return None
    design = np.stack([np.ones(len(speeds)), speeds - speeds.mean()], axis=1)
    noise = covariance[np.ix_(at, at)] - scatter[NORMAL] ** 2 * np.eye(len(speeds))
    noise += _scatter(values[at], design, noise) ** 2 * np.eye(len(speeds))
    means, errors = _solve(values[at], design, noise)
    side = float(np.sqrt(errors[1, 1]) * t.isf(0.5 * (1.0 - LEVEL), len(speeds) - 2))
    return Estimate(float(means[1]), float(means[1]) - side, float(means[1]) + side)


def _within(means: Array, covariance: Array, limits: Array, spreads: Array) -> list[Estimate]:
    """The most likely numbers within their limits, and the intervals of their profile likelihoods.

    The interval of a number holds the values for which the best others within their limits fit almost as well.

    Args:
        means, covariance: (n,), (n, n) without limits.
        limits: (n, 2) least and greatest.
        spreads: (n,) half widths of the intervals without limits, in standard deviations.
    """
    from scipy.optimize import brentq, lsq_linear

    root = np.linalg.inv(np.linalg.cholesky(covariance))

    def best(matrix: Array, target: Array, least: Array, greatest: Array) -> tuple[Array, float]:
        found = lsq_linear(matrix, target, (least, greatest), method="bvls", tol=1e-12)
        return np.clip(found.x, least, greatest), 2.0 * found.cost  # rounding can lead a little beyond a limit

    values, cost = best(root, root @ means, limits[:, 0], limits[:, 1])
    results = []
    for k, value in enumerate(values):
        others = np.arange(len(values)) != k

        def excess(number: float, k: int = k, others: NDArray[np.bool_] = others) -> float:
            target = root @ means - root[:, k] * number
            return best(root[:, others], target, *limits[others].T)[1] - cost - spreads[k] ** 2

        ends = []
        for side, limit in zip((-1.0, 1.0), limits[k], strict=True):
            far = means[k] + side * np.sqrt((spreads[k] ** 2 + cost) * covariance[k, k]) * 1.01
            far = max(far, limit) if side < 0.0 else min(far, limit)
            ends.append(far if excess(far) <= 0.0 else brentq(excess, value, far))
        results.append(Estimate(float(value), float(ends[0]), float(ends[1])))
    return results
