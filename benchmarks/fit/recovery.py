"""Fit random simulated tables and see how often the intervals hold what the tables are."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from agents.fitting.fit import BOUNDED, FITTED, Field, fit_table
from agents.fitting.simulated import simulate_track
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
"""What the tables are drawn from, evenly. Each drag is 0 on a third of them, as on the presets."""
ABSENT = 1.0 / 3.0
"""Share of the tables without constant, linear or quadratic drag."""


class Recovery(NamedTuple):
    """A table that was drawn, and what the fit found."""

    spec: TableSpec
    fields: dict[str, Field]
    noise: float


def draw_table(rng: np.random.Generator) -> TableSpec:
    """A table with fields from `RANGES`; the others are `FULL_SIZE`'s."""
    drawn = {name: float(rng.uniform(*ends)) for name, ends in RANGES.items()}
    for name in ("drag_constant", "drag_linear", "drag_quadratic"):
        drawn[name] *= float(rng.random() >= ABSENT)
    return dataclasses.replace(FULL_SIZE, **drawn)


def recover(tables: int, seconds: float, seed: int) -> Iterator[Recovery]:
    """Draw tables, throw a puck on each for a while, and fit what the camera saw; only the puck's radius is known."""
    for k in range(tables):
        spec = draw_table(np.random.default_rng([seed, k]))
        track = simulate_track(spec, seconds, seed * 1_000_003 + k)
        fit = fit_table(track, FULL_SIZE, {"puck_radius": spec.puck_radius})
        yield Recovery(spec, fit.fields, fit.glides.noise)


def summarize(recoveries: list[Recovery]) -> list[dict[str, Any]]:
    """For each fitted field: how often it was told, the coverage of its intervals, errors and half widths."""
    rows = []
    for name in RANGES:
        told = [(getattr(one.spec, name), one.fields[name]) for one in recoveries]
        told = [(true, f) for true, f in told if f.source in (FITTED, BOUNDED)]
        if name == "puck_radius" or not told:
            continue
        errors = np.array([abs(field.value - true) for true, field in told])
        held = sum(field.low <= true <= field.high for true, field in told)
        widths = np.array([0.5 * (field.high - field.low) for _, field in told])
        rows.append(
            {
                "field": name,
                "told": len(told),
                "tables": len(recoveries),
                "coverage": held / len(told),
                "error": float(np.median(errors)),
                "worst": float(errors.max()),
                "half_width": float(np.median(widths)),
            }
        )
    return rows


def table(rows: list[dict[str, Any]]) -> Rows:
    """The summary as cells."""
    head = ("field", "told on", "95 % interval holds the truth", "median error", "largest error", "median half width")
    return [
        head,
        *(
            (
                row["field"],
                f"{row['told']} of {row['tables']}",
                f"{row['coverage']:.1%}",
                *(f"{row[key]:.2g}" for key in ("error", "worst", "half_width")),
            )
            for row in rows
        ),
    ]
