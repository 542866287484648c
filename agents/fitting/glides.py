"""The glide: one deceleration for all flights of a track, and a straight path with its own start for each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agents.fitting.flights import LEAST_NOISE
from agents.fitting.tracks import Track
from airhockey_env.compiled import compiled
from airhockey_env.engine.motion import glide_coefficients

Array = NDArray[np.float64]

FEWEST_FRAMES = 6
"""The fewest frames of a flight: its path has four unknowns, and two are left to see whether it is one."""
SHORTEST_WAY = 20.0
"""Standard deviations of the noise that a puck must travel in a flight, to have a direction."""
UNLIKELY = 1e-5
"""Probability of residuals as large as a flight's, below which it was not a free glide."""
LEAST_SPEED = 1e-6
"""m/s: a puck at rest has no direction."""
ROUNDS = 8
STEPS = np.array([1e-4, 1e-4, 1e-4])
"""Steps in the three coefficients for finite differences."""
ROUGHEST = 3.0
"""Times the noise from frame to frame that the residuals of glides may be: lenses bend straight paths a little."""
FAINT = np.array([1.0, 3.0, 3.0])
"""m/s**2, 1/s, 1/m: standard deviations of the prior on the coefficients, whose mean is 0. It is so wide that it only
matters for what the track does not tell at all."""


class Flight(NamedTuple):
    """The frames of one flight."""

    first: int
    """Number of its first frame in the track."""
    begin: float
    """s, when that was taken."""
    time: Array
    """(n,) s since that frame."""
    place: Array
    """(2, n) m, x and y."""


@dataclass(frozen=True)
class Glides:
    """The least-squares fit of all flights."""

    flights: list[Flight]
    """The n flights that are free glides."""
    drag: Array
    """(3,) a, c and b of the deceleration a + c*v + b*v**2; any of them may be negative."""
    starts: list[Array]
    """The start of each flight: x, y, vx, vy at its first frame, (4,)."""
    noise: float
    """Standard deviation of the residuals, m."""
    drag_covariance: Array
    """(3, 3)"""
    start_covariances: list[Array]
    """The covariance of each flight's start where the drag is known, (4, 4)."""
    pulls: list[Array]
    """The change of each flight's start with the drag, (4, 3)."""
    residuals: list[Array]
    """The residuals of each flight, (2, n) m: seen minus fitted, along and across the path."""
    dropped: int
    """Flights that were long enough but were not free glides, for example of a puck that a hand moved."""


@compiled
def _slide(times, speed, constant, linear, quadratic, nodes, weights):
    """Distances and speeds after the given times, (2, n), as the engine's glide has them.

    Args:
        times: (n,) s from the moment of `speed`; may be negative.
        speed: m/s.
        constant, linear, quadratic: of the deceleration.
        nodes, weights: (m,) of a quadrature on [0, 1].
    """
    slid = np.zeros((2, len(times)))
    for i in range(len(times)):
        for k in range(len(nodes) + 1):
            time = times[i] * nodes[k] if k < len(nodes) else times[i]
            p, q, r, s = glide_coefficients(constant, linear, quadratic, time)
            now = max(0.0, p * speed - q) / (r * speed + s)
            if k < len(nodes):
                slid[0, i] += times[i] * weights[k] * now
            else:
                slid[1, i] = now
    return slid


_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)
_NODES, _WEIGHTS = 0.5 + 0.5 * _NODES, 0.5 * _WEIGHTS


def slide(times: Array, speed: float, drag: Array) -> Array:
    """Distances, m, and speeds, m/s, of a puck `times` s after it had `speed`: (2, n)."""
    return _slide(times, speed, *drag.tolist(), _NODES, _WEIGHTS)


def fit_glides(track: Track, bounds: list[tuple[int, int]], noise: float) -> Glides | None:
    """Fit the flights between the given bounds; None if none of them is a free glide.

    Flights whose residuals are too large are dropped, and the others are fitted again.

    Args:
        track: the frames.
        bounds: (first, last + 1) frames of each flight.
        noise: m, from frame to frame.
    """
    from scipy.stats import chi2

    flights, starts = [], []
    for first, end in bounds:
        time, place = track.time[first:end] - track.time[first], np.array([track.x[first:end], track.y[first:end]])
        if end - first >= FEWEST_FRAMES and np.hypot(*(place[:, -1] - place[:, 0])) > SHORTEST_WAY * noise:
            slope = np.polyfit(time, place.T, 2 if end - first > 2 * FEWEST_FRAMES else 1)
            flights.append(Flight(first, float(track.time[first]), time, place))
            starts.append(np.concatenate([slope[-1], slope[-2]]))
    found, drag = len(flights), np.zeros(3)
    while flights:
        fit = _fit(flights, drag, starts, found)
        degrees = np.array([2 * len(flight.time) - 4 for flight in flights])
        squares = np.array([np.sum(one**2) for one in fit.residuals])
        variance = min(max(float(np.median(squares / degrees)), LEAST_NOISE**2), (ROUGHEST * noise) ** 2)
        free = squares <= variance * chi2.isf(UNLIKELY, degrees)
        if free.all():
            return fit
        flights = [flight for flight, keep in zip(flights, free, strict=True) if keep]
        starts = [start for start, keep in zip(fit.starts, free, strict=True) if keep]
        drag = fit.drag
    return None


def _fit(flights: list[Flight], drag: Array, starts: list[Array], found: int) -> Glides:
    """Gauss and Newton's method. The starts are eliminated: what is left of each flight are three equations."""
    starts = list(starts)
    for _ in range(ROUNDS):
        parts = [_linearize(flight, start, drag) for flight, start in zip(flights, starts, strict=True)]
        normal, right, squares = np.zeros((3, 3)), np.zeros(3), 0.0
        for residual, by_start, by_drag in parts:
            basis = np.linalg.qr(by_start)[0]
            own, left = by_drag - basis @ (basis.T @ by_drag), residual - basis @ (basis.T @ residual)
            normal += own.T @ own
            right += own.T @ left
            squares += float(left @ left)
        variance = max(squares / (sum(2 * len(flight.time) - 4 for flight in flights) - 3), LEAST_NOISE**2)
        # Scaled by the prior, whose inverse covariance is then 1, no rounding can make this indefinite.
        values, vectors = np.linalg.eigh(normal / variance * np.outer(FAINT, FAINT))
        root = FAINT[:, np.newaxis] * vectors / np.sqrt(1.0 + values.clip(0.0))
        covariance = root @ root.T
        change = covariance @ (right / variance - drag / FAINT**2)
        drag = drag + change
        for k, (residual, by_start, by_drag) in enumerate(parts):
            starts[k] = starts[k] + np.linalg.lstsq(by_start, residual - by_drag @ change, rcond=None)[0]
        if (np.abs(change) < 1e-3 * np.sqrt(np.diag(covariance))).all():
            break
    inverses = [np.linalg.pinv(by_start) for _, by_start, _ in parts]
    return Glides(
        flights,
        drag,
        starts,
        float(np.sqrt(variance)),
        covariance,
        [variance * inverse @ inverse.T for inverse in inverses],
        [-inverse @ by_drag for inverse, (_, _, by_drag) in zip(inverses, parts, strict=True)],
        [_turned(flight, start, drag) for flight, start in zip(flights, starts, strict=True)],
        found - len(flights),
    )


def place_at(start: Array, drag: Array, times: Array) -> tuple[Array, Array]:
    """Places, m, and velocities, m/s, of a flight `times` s after its first frame: (2, n) each."""
    speed = max(float(np.hypot(start[2], start[3])), LEAST_SPEED)
    direction = start[2:, np.newaxis] / speed
    way, speeds = slide(times, speed, drag)
    return start[:2, np.newaxis] + direction * way, direction * speeds


def _linearize(flight: Flight, start: Array, drag: Array) -> tuple[Array, Array, Array]:
    """Residuals (2n,), and the changes of the fitted places with the start (2n, 4) and with the drag (2n, 3)."""
    times, n = flight.time, len(flight.time)
    speed = max(float(np.hypot(start[2], start[3])), LEAST_SPEED)
    direction = start[2:] / speed
    way = slide(times, speed, drag)[0]
    step = 1e-4 * speed
    by_speed = (slide(times, speed + step, drag)[0] - slide(times, speed - step, drag)[0]) / (2.0 * step)
    by_start, by_drag = np.zeros((2, n, 4)), np.zeros((2, n, 3))
    across = np.eye(2) - np.outer(direction, direction)
    for axis in range(2):
        by_start[axis, :, axis] = 1.0
        for other in range(2):
            by_start[axis, :, 2 + other] = (
                across[axis, other] * way / speed + direction[axis] * direction[other] * by_speed
            )
    for k in range(3):
        shift = np.eye(3)[k] * STEPS[k]
        change = (slide(times, speed, drag + shift)[0] - slide(times, speed, drag - shift)[0]) / (2.0 * STEPS[k])
        by_drag[:, :, k] = direction[:, np.newaxis] * change
    residual = flight.place - start[:2, np.newaxis] - direction[:, np.newaxis] * way
    return residual.ravel(), by_start.reshape(2 * n, 4), by_drag.reshape(2 * n, 3)


def _turned(flight: Flight, start: Array, drag: Array) -> Array:
    """Residuals along and across the path, (2, n)."""
    residual = flight.place - place_at(start, drag, flight.time)[0]
    along, across = start[2:] / max(float(np.hypot(start[2], start[3])), LEAST_SPEED)
    return np.array([[along, across], [-across, along]]) @ residual
