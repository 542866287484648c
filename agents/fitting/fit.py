"""From a track to a `TableSpec`: which of its fields the track tells, how well, and what is kept of another table."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from agents.fitting.bounces import NORMAL, PLACE, TANGENTIAL, Bounce, cut_again, find_bounces, find_meetings
from agents.fitting.estimates import FEWEST, Estimate, Estimates, estimate
from agents.fitting.flights import drop_glitches, find_flights, measure_noise
from agents.fitting.glides import FEWEST_FRAMES, Glides, fit_glides
from agents.fitting.tracks import Track
from agents.fitting.turns import find_turn, turn
from airhockey_env.tables import FIELDS, TableSpec

FAINT_GLIDE = 0.1
"""m/s**2: if the deceleration is not known to that, at the median speed, the track does not tell it."""
IN_GOAL = 5.0
"""Standard deviations of the noise beyond an end wall, from which on the puck is in a goal."""
SURE = 3.0
"""Standard deviations that are allowed for where the width of the goal is bounded."""
CLOSE = 0.1
"""Relative half width of a range, up to which its middle is taken."""
DRAG = ("drag_constant", "drag_linear", "drag_quadratic")
SIZES = ("length", "width", "puck_radius", "goal_width")
"""The fields that a caller can know."""
FITTED, BOUNDED, GIVEN, KEPT = "fitted", "bounded", "given", "kept"
"""Where the value of a field comes from; see `Field`."""


@dataclass(frozen=True)
class Field:
    """The value of a field of the table, and where it comes from."""

    value: float
    source: str
    """`FITTED`: with a 95 % interval; `BOUNDED`: the middle of a range outside of which it cannot be; `GIVEN`: by the
    caller; `KEPT`: that of the other table."""
    low: float | None = None
    """Least and greatest value of the interval or range, where there is one."""
    high: float | None = None
    note: str = ""
    """Why it is kept, or what its value rests on."""


@dataclass(frozen=True)
class TableFit:
    """A table that was fitted to a track."""

    spec: TableSpec
    fields: dict[str, Field]
    """All fields of the `TableSpec`, in its order."""
    track: Track
    """Without glitches, and turned to the table's axes."""
    angle: float
    """rad, counterclockwise from the axes of the given track to the table's."""
    glides: Glides
    bounces: list[Bounce]
    estimates: Estimates
    centre: tuple[float | None, float | None]
    """m, the table's centre in the coordinates of this track, where walls on both sides tell it."""

    def as_dict(self) -> dict[str, Any]:
        """The table, its fields with their intervals, and what else the track tells, for JSON."""
        fall = self.estimates.fall
        return {
            "table": dataclasses.asdict(self.spec),
            "fields": {name: dataclasses.asdict(field) for name, field in self.fields.items()},
            "frames": len(self.track.time),
            "noise": self.glides.noise,
            "flights": len(self.glides.flights),
            "flights_dropped": self.glides.dropped,
            "bounces": len(self.bounces),
            "angle": self.angle,
            "centre": list(self.centre),
            "scatter_of_wall_restitution": self.estimates.scatter.get(NORMAL),
            "scatter_of_wall_tangential": self.estimates.scatter.get(TANGENTIAL),
            "wall_restitution_per_speed": None if fall is None else fall._asdict(),
        }


def fit_table(track: Track, base: TableSpec, known: Mapping[str, float] | None = None) -> TableFit:
    """Fit a table to the track of a puck on it.

    Args:
        track: where the puck was seen. Its axes are those of the table to within 3 degrees, and have any origin.
        base: the table whose values the fields that the track does not tell keep.
        known: values of some of `SIZES`.

    Raises:
        ValueError: the puck nowhere glides freely for long enough, or what was found, given and kept makes no table.
    """
    known = {} if known is None else dict(known)
    noise = measure_noise(track)
    track = drop_glitches(track, noise)
    glides, meetings = _glides_and_meetings(track, noise)
    angle = find_turn(meetings)
    if angle != 0.0:
        track = turn(track, angle)
        glides, meetings = _glides_and_meetings(track, noise)
    bounces = find_bounces(meetings)
    told = estimate(glides, bounces)
    fields = {name: Field(getattr(base, name), KEPT, note="a track says nothing about it") for name in FIELDS}
    fields.update({name: Field(value, GIVEN) for name, value in known.items()})
    fields.update(_glide_fields(glides, told, base))
    fields.update(_wall_fields(told, base))
    centre = tuple(_middle(told, axis) for axis in (0, 1))
    fields.update(_sizes(told, base, known))
    if "goal_width" not in known:
        fields["goal_width"] = _goal(track, glides, bounces, told, fields, base)
    try:
        spec = TableSpec(**{name: field.value for name, field in fields.items()})
    except ValueError as error:
        raise ValueError(f"what the track tells and what was given or kept do not make a table: {error}") from error
    return TableFit(spec, fields, track, angle, glides, bounces, told, (centre[0], centre[1]))


def _glides_and_meetings(track: Track, noise: float) -> tuple[Glides, list[Bounce]]:
    """All flights of a track, and those that meet."""
    bounds = find_flights(track, noise)
    glides = fit_glides(track, bounds, noise)
    if glides is not None:
        bounds = cut_again(track, glides, bounds, find_meetings(track, glides))
        glides = fit_glides(track, bounds, noise)
    if glides is None:
        raise ValueError(
            f"the track must show the puck glide freely and straight, in {FEWEST_FRAMES} frames or more, and it "
            "nowhere does"
        )
    return glides, find_meetings(track, glides)


def _glide_fields(glides: Glides, told: Estimates, base: TableSpec) -> dict[str, Field]:
    """The three coefficients of the deceleration."""
    speed = float(np.median([math.hypot(*start[2:]) for start in glides.starts]))
    powers = np.array([1.0, speed, speed**2])
    side = 1.96 * math.sqrt(powers @ told.drag_covariance @ powers)
    if side > FAINT_GLIDE:
        note = f"at {speed:.2g} m/s the track tells the deceleration to no more than ±{side:.2g} m/s²"
        return {name: Field(getattr(base, name), KEPT, note=note) for name in DRAG}
    return {name: Field(one.value, FITTED, one.low, one.high) for name, one in zip(DRAG, told.drag, strict=True)}


def _wall_fields(told: Estimates, base: TableSpec) -> dict[str, Field]:
    """What the puck keeps of its speed at a wall."""
    fields = {}
    for name, kind in (("wall_restitution", NORMAL), ("wall_tangential", TANGENTIAL)):
        if kind in told.shares:
            one = told.shares[kind]
            fields[name] = Field(one.value, FITTED, one.low, one.high)
        else:
            fields[name] = Field(getattr(base, name), KEPT, note=f"the track shows fewer than {FEWEST} clear bounces")
    return fields


def _middle(told: Estimates, axis: int) -> float | None:
    """Where the middle between two walls is, m."""
    low, high = told.walls.get((axis, -1)), told.walls.get((axis, 1))
    return None if low is None or high is None else 0.5 * (low.value + high.value)


def _reach(told: Estimates, axis: int) -> Estimate | None:
    """How far from the middle between two walls the puck's centre gets, m."""
    low, high = told.walls.get((axis, -1)), told.walls.get((axis, 1))
    if low is None or high is None:
        return None
    value = 0.5 * (high.value - low.value)
    side = 0.5 * math.hypot(low.high - low.value, high.high - high.value)
    return Estimate(value, value - side, value + side)


def _sizes(told: Estimates, base: TableSpec, known: Mapping[str, float]) -> dict[str, Field]:
    """Length, width and the puck's radius: the track tells half the sizes minus the radius."""
    reaches = {name: _reach(told, axis) for axis, name in enumerate(("length", "width"))}
    fields: dict[str, Field] = {}
    radius, side, rests = known.get("puck_radius", base.puck_radius), 0.0, "with the given puck_radius"
    if "puck_radius" not in known:
        # Each size that was given tells the radius; their mean weighs them by their intervals.
        found = [
            (0.5 * known[name] - reach.value, reach.high - reach.value)
            for name, reach in reaches.items()
            if name in known and reach is not None
        ]
        if found:
            weights = np.array([1.0 / side**2 for _, side in found])
            radius, side = float(np.average([one for one, _ in found], weights=weights)), float(weights.sum() ** -0.5)
            fields["puck_radius"] = Field(radius, FITTED, radius - side, radius + side)
            rests = "with the fitted puck_radius"
        else:
            note = "the track tells only the table's sizes minus the puck's diameter"
            fields["puck_radius"] = Field(radius, KEPT, note=note)
            rests = "with the puck_radius of the table"
    for name, reach in reaches.items():
        if name in known:
            continue
        if reach is None:
            fields[name] = Field(
                getattr(base, name), KEPT, note="the track does not show two bounces on each of its two walls"
            )
            continue
        value, own = 2.0 * (reach.value + radius), 2.0 * math.hypot(reach.high - reach.value, side)
        fields[name] = Field(value, FITTED, value - own, value + own, note=f"{rests}, {radius:.5g} m")
    return fields


def _goal(
    track: Track, glides: Glides, bounces: list[Bounce], told: Estimates, fields: Mapping[str, Field], base: TableSpec
) -> Field:
    """The goal's width: the puck bounces beside it and passes through it."""
    middle, reach = [_middle(told, axis) for axis in (0, 1)], _reach(told, 0)
    if middle[0] is None or middle[1] is None or reach is None:
        return Field(base.goal_width, KEPT, note="the track does not show two bounces on each of the four walls")
    radius, noise = fields["puck_radius"].value, glides.noise
    # A bounce on the front of a post looks like one on the wall while the place does not tell them apart.
    beside = [
        abs(bounce.along - middle[1]) + math.sqrt(2.0 * radius * SURE * bounce.deviations[PLACE])
        for bounce in bounces
        if bounce.wall[0] == 0
    ]
    high = 2.0 * min(beside)
    low = 2.0 * radius
    depth = np.abs(track.x - middle[0]) - reach.value  # of the puck's rim behind the end wall
    inside = depth > IN_GOAL * noise
    if inside.any():
        # The rim touches a post at most: the centre is as far from it as the radius.
        short = np.clip(radius - depth[inside], 0.0, radius)
        needed = np.abs(track.y[inside] - middle[1]) + np.sqrt(radius**2 - short**2) - SURE * noise
        low = max(low, 2.0 * float(needed.max()))
    if low > high:
        return Field(base.goal_width, KEPT, note="shots into the goals and bounces beside them contradict each other")
    if high - low <= CLOSE * (high + low):
        return Field(0.5 * (low + high), BOUNDED, low, high, "shots went into it, and bounces went beside it")
    value = min(max(base.goal_width, low), high)
    return Field(value, KEPT, low, high, "the track shows only that it is in this range")
