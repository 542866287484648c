"""Fit random simulated tables and see how often the intervals hold what the tables are."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from agents.fitting.fit import BOUNDED, FITTED, Field, fit_table
from agents.fitting.simulated import simulate_play, simulate_throws
from agents.fitting.tracks import Track
from airhockey_env.cameras import ROBOT, SLOW, Camera
from airhockey_env.tables import FULL_SIZE, TableSpec
from benchmarks.page import Rows

RANGES: dict[str, tuple[float, float]] = {
    "length": (1.7, 2.5),
    "width": (0.9, 1.25),
    "goal_width": (0.22, 0.4),
    "puck_radius": (0.025, 0.045),
    "wall_restitution": (0.6, 0.95),
    "wall_tangential": (0.6, 0.98),
    "drag_constant": (0.0, 0.05),
    "drag_linear": (0.0, 0.5),
    "drag_quadratic": (0.0, 0.1),
}
"""What the tables are drawn from, evenly: they hold the presets. Their other fields are `FULL_SIZE`'s."""
DRAG = ("drag_constant", "drag_linear", "drag_quadratic")
ABSENT = 1.0 / 3.0
"""Probability that a table does not have one of these kinds of drag. No preset has all three."""
FITTED_FIELDS = tuple(name for name in RANGES if name != "puck_radius")
"""The puck's radius is given."""


class Part(NamedTuple):
    """A way in which tracks come about."""

    title: str
    simulate: Callable[[TableSpec, float, int, Camera], Track]
    camera: Camera


PARTS = {
    "thrown": Part("A thrown puck, seen by the camera ROBOT", simulate_throws, ROBOT),
    "played": Part("Points between two strikers, seen by the camera ROBOT", simulate_play, ROBOT),
    "thrown_slow": Part("A thrown puck, seen by a camera of 60 Hz with a noise of 3 mm", simulate_throws, SLOW),
}


class Recovery(NamedTuple):
    """A table that was drawn, and what the fit found."""

    spec: TableSpec
    fields: dict[str, Field]


def draw_table(rng: np.random.Generator) -> TableSpec:
    """A table from `RANGES`."""
    drawn = {name: float(rng.uniform(*ends)) for name, ends in RANGES.items()}
    for name in DRAG:
        drawn[name] *= float(rng.random() >= ABSENT)
    return dataclasses.replace(FULL_SIZE, **drawn)


def recover(part: str, tables: int, seconds: float, seed: int) -> Iterator[Recovery]:
    """Draw tables, watch a puck on each for a while, and fit what the camera saw."""
    for k in range(tables):
        rng = np.random.default_rng([seed, k])
        spec = draw_table(rng)
        track = PARTS[part].simulate(spec, seconds, int(rng.integers(2**31)), PARTS[part].camera)
        yield Recovery(spec, fit_table(track, FULL_SIZE, {"puck_radius": spec.puck_radius}).fields)


def summarize(recoveries: Sequence[Recovery]) -> list[dict[str, Any]]:
    """For each field: how often it was told, how often its interval holds the truth, errors and half widths."""
    rows = []
    for name in FITTED_FIELDS:
        pairs = [(getattr(one.spec, name), one.fields[name]) for one in recoveries]
        told = [(truth, field) for truth, field in pairs if field.source in (FITTED, BOUNDED)]
        truths, values, lows, highs = (
            np.array([(truth, field.value, field.low, field.high) for truth, field in told], np.float64)
            .reshape(-1, 4)
            .T
        )
        errors = np.abs(values - truths)
        rows.append(
            {
                "field": name,
                "told": len(told),
                "tables": len(pairs),
                "held": int(np.sum((lows <= truths) & (truths <= highs))),
                "median_error": float(np.median(errors)) if told else None,
                "largest_error": float(errors.max()) if told else None,
                "median_half_width": float(np.median(0.5 * (highs - lows))) if told else None,
            }
        )
    return rows


def table(rows: Sequence[dict[str, Any]]) -> Rows:
    """The summary as cells."""
    head = ("field", "told on", "interval holds the truth", "median error", "largest error", "median half width")
    return [
        head,
        *(
            (
                row["field"],
                f"{row['told']} of {row['tables']}",
                f"{row['held'] / row['told']:.1%}" if row["told"] else "",
                *(
                    f"{row[key]:.2g}" if row["told"] else ""
                    for key in ("median_error", "largest_error", "median_half_width")
                ),
            )
            for row in rows
        ),
    ]
