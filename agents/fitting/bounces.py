"""Bounces: where two flights meet at a wall, and what share of its speed the puck keeps there."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agents.fitting.glides import FEWEST_FRAMES, Glides, place_at
from agents.fitting.tracks import Track

Array = NDArray[np.float64]

LONGEST_PAUSE = 0.05
"""s between the last frame before a bounce and the first one after it."""
SURE = 5.0
"""Standard deviations: how far apart may be what should agree."""
TOLERANCE = 1e-3
"""m that may be added, because neither walls nor calibrations are perfect."""
CLEAR = 0.05
"""Greatest relative error of a speed before a bounce, for a share of it to be worth working out."""
AGREEING = 3e-3
"""m: bounces on the same wall are no farther apart."""
FEWEST_ON_WALL = 2
"""Bounces that must agree on where a wall is: a single one could be the stroke of a paddle."""
STEPS = np.array([1e-6, 1e-6, 1e-5, 1e-5, 1e-6, 1e-6, 1e-5, 1e-5, 1e-5, 1e-5, 1e-5])
"""For finite differences with the starts of two flights and the drag."""

NORMAL, TANGENTIAL, PLACE = range(3)
"""What a bounce tells: the share of the normal and of the tangential speed that is kept, and where the wall is, m."""
_APART, _MOMENT, _NORMAL_SPEED, _TANGENTIAL_SPEED, _ALONG = range(3, 8)


class Bounce(NamedTuple):
    """A bounce between two flights."""

    flight: int
    """Number of the flight that ends; the next one begins."""
    wall: tuple[int, int]
    """Axis (0: an end wall, 1: a side wall) and side (-1 or 1) of the wall."""
    time: float
    """s, when it happened."""
    along: float
    """Where on the wall the puck's centre was, m: its other coordinate."""
    approach: float
    """Normal speed before it, m/s."""
    values: Array
    """(3,) the normal and the tangential share, and the place of the wall, m."""
    deviations: Array
    """(3,) their standard deviations; infinite for a share of a speed that is too slow to tell."""
    by_before: Array
    """(3, 4) their changes with the start of the flight before, for a given drag,"""
    by_after: Array
    """(3, 4) with that of the flight after, for a given drag,"""
    by_drag: Array
    """(3, 3) and with the drag, to which the starts are fitted again."""


def find_meetings(track: Track, glides: Glides) -> list[Bounce]:
    """The meetings of two flights that can be bounces on walls.

    Two flights can bounce on a side wall if one follows the other, their paths meet, and the velocity across the table
    changes its sign while the one along it does not; on an end wall it is the other way round. The puck is nowhere
    seen beyond that place, except through a goal, which is nearer to the middle of the table. Otherwise, it was the
    stroke of a paddle.
    """
    meetings = [
        meeting
        for k, (before, after) in enumerate(pairwise(glides.flights))
        if before.first + len(before.time) == after.first
        and after.begin - before.begin - before.time[-1] <= LONGEST_PAUSE
        for axis in (0, 1)
        if (meeting := _meet(glides, k, axis)) is not None
    ]
    frames = np.array([track.x, track.y])
    middle = 0.5 * (frames.min(axis=1) + frames.max(axis=1))
    return [meeting for meeting in meetings if not _crossed(meeting, frames, middle, glides.noise)]


def _crossed(meeting: Bounce, frames: Array, middle: Array, noise: float) -> bool:
    """Whether the puck was seen beyond the place of a meeting, as far from the middle of the table or farther."""
    axis, side = meeting.wall
    slack = SURE * math.hypot(noise, meeting.deviations[PLACE]) + AGREEING
    beyond = side * (frames[axis] - meeting.values[PLACE]) > slack
    outside = np.abs(frames[1 - axis] - middle[1 - axis]) >= abs(meeting.along - middle[1 - axis])
    return bool((beyond & outside).any())


def cut_again(
    track: Track, glides: Glides, bounds: list[tuple[int, int]], meetings: list[Bounce]
) -> list[tuple[int, int]]:
    """The bounds of the flights, cut at the moments at which their paths meet.

    The first cut gives a frame that is close to a bounce to the flight that its own noise favours. Such frames would
    pull both paths away from the wall.
    """
    moved = {}
    for meeting in meetings:
        before, after = glides.flights[meeting.flight : meeting.flight + 2]
        cut = int(np.searchsorted(track.time, meeting.time))
        moved[after.first] = min(max(cut, before.first + FEWEST_FRAMES), after.first + len(after.time) - FEWEST_FRAMES)
    return [(moved.get(first, first), moved.get(end, end)) for first, end in bounds]


def find_bounces(meetings: Sequence[Bounce]) -> list[Bounce]:
    """The meetings that are bounces on straight walls: a wall is where most meetings on a side of the table agree."""
    walls = sorted({meeting.wall for meeting in meetings})
    found = [bounce for wall in walls for bounce in _most([m for m in meetings if m.wall == wall])]
    return _drop_outliers(sorted(found, key=lambda bounce: bounce.flight))


def _meet(glides: Glides, k: int, axis: int) -> Bounce | None:
    """The bounce between flights k and k + 1 on a wall across this axis, if there can be one."""
    before, after = glides.flights[k : k + 2]
    between = after.begin - before.begin
    unknowns = np.concatenate([glides.starts[k], glides.starts[k + 1], glides.drag])
    if not (unknowns[2 + axis] * unknowns[6 + axis] < 0.0 < unknowns[3 - axis] * unknowns[7 - axis]):
        return None
    with np.errstate(all="ignore"):  # a puck that stops before the wall has no share, and is refused below
        values = _values(unknowns, between, axis, between)
        values = _values(unknowns, between, axis, float(values[_MOMENT]))
    if not np.isfinite(values).all():
        return None
    moment = float(values[_MOMENT])
    moved = np.array([_values(unknowns + step, between, axis, moment) for step in np.diag(STEPS)])
    changes = ((moved - values) / STEPS[:, np.newaxis]).T
    by_before, by_after = changes[:, :4], changes[:, 4:8]
    by_drag = changes[:, 8:] + by_before @ glides.pulls[k] + by_after @ glides.pulls[k + 1]
    covariance = by_drag @ glides.drag_covariance @ by_drag.T
    covariance += by_before @ glides.start_covariances[k] @ by_before.T
    covariance += by_after @ glides.start_covariances[k + 1] @ by_after.T
    deviations = np.sqrt(np.diag(covariance))
    slack = SURE * deviations[_MOMENT] + 1e-3
    if not before.time[-1] - slack <= moment <= between + slack:
        return None
    if abs(values[_APART]) > SURE * deviations[_APART] + TOLERANCE:
        return None
    told = deviations[:3].copy()
    for share, speed in ((NORMAL, _NORMAL_SPEED), (TANGENTIAL, _TANGENTIAL_SPEED)):
        if deviations[speed] > CLEAR * values[speed]:
            told[share] = np.inf
    return Bounce(
        k,
        (axis, 1 if unknowns[2 + axis] > 0.0 else -1),
        before.begin + moment,
        float(values[_ALONG]),
        float(values[_NORMAL_SPEED]),
        values[:3],
        told,
        by_before[:3],
        by_after[:3],
        by_drag[:3],
    )


def _values(unknowns: Array, between: float, axis: int, moment: float) -> Array:
    """What the paths of two flights tell of the bounce between them, (8,); see the names above.

    Args:
        unknowns: (11,) the start of the flight before, that of the flight after, and the drag.
        between: s from the first frame of the one to the first frame of the other.
        axis: of the wall's normal.
        moment: s from the first frame of the first flight to the bounce, about.
    """
    before, after, drag = unknowns[:4], unknowns[4:8], unknowns[8:]
    for _ in range(2):  # Newton's method; the paths are almost straight
        place, velocity = (pair[:, 0] for pair in place_at(before, drag, np.array([moment])))
        later_place, later_velocity = (pair[:, 0] for pair in place_at(after, drag, np.array([moment - between])))
        moment -= float((place[axis] - later_place[axis]) / (velocity[axis] - later_velocity[axis]))
    other = 1 - axis
    return np.array(
        [
            -later_velocity[axis] / velocity[axis],
            later_velocity[other] / velocity[other],
            place[axis],
            place[other] - later_place[other],
            moment,
            abs(velocity[axis]),
            abs(velocity[other]),
            place[other],
        ]
    )


def _most(meetings: Sequence[Bounce]) -> list[Bounce]:
    """The meetings on one side of the table at the place on which most of them agree; none if no two do."""
    places = np.array([meeting.values[PLACE] for meeting in meetings])
    agree = np.abs(places[:, np.newaxis] - places) <= AGREEING
    wall = np.median(places[agree[int(agree.sum(axis=1).argmax())]])
    reach = np.minimum(TOLERANCE + SURE * np.array([meeting.deviations[PLACE] for meeting in meetings]), 3.0 * AGREEING)
    kept = [m for m, place, far in zip(meetings, places, reach, strict=True) if abs(place - wall) <= far]
    return kept if len(kept) >= FEWEST_ON_WALL else []


def _drop_outliers(bounces: Sequence[Bounce]) -> list[Bounce]:
    """Leave out the bounces whose shares are far from the median: those on posts, or with a spinning puck."""
    usual = np.ones(len(bounces), np.bool_)
    for kind in (NORMAL, TANGENTIAL):
        told = np.array([np.isfinite(bounce.deviations[kind]) for bounce in bounces], np.bool_)
        if not told.any():
            continue
        values = np.array([bounce.values[kind] for bounce in bounces])
        deviations = np.array([bounce.deviations[kind] for bounce in bounces])
        far = np.abs(values - np.median(values[told]))
        scatter = 1.4826 * np.median(far[told])
        usual &= ~told | (far <= SURE * np.hypot(np.where(told, deviations, 0.0), scatter))
    return [bounce for bounce, keep in zip(bounces, usual, strict=True) if keep]
