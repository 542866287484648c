"""The cost of a tick against the number of pucks, for `AirTable` and other engines.

The scenes are those of the kiss study, on a table that grows with the number of pucks, at 50 ticks per second: all
pucks move at 2 m/s, or two of them do while the others rest.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks.kiss.engines import OURS, Open, available
from benchmarks.kiss.scenes import Scene, crowd
from benchmarks.speed.measure import Effort, Measure, Row, run

TITLE = "Pucks"
PUCKS = (2, 8, 32, 128, 512)
HZ = 50.0
MOST_OTHERS = 128
MOVING, RESTING = "all moving", "two moving"
SPEED = 2.0  # m/s


def scene(pucks: int, still: bool) -> Scene:
    """A crowd with the density of the kiss study's twelve pucks; with `still`, only two pucks move."""
    side = max(1.0, np.sqrt(pucks / 12))
    made = crowd(0, pucks, SPEED, (2.0 * side, side))
    if not still:
        return made
    velocities = made.velocities.copy()
    velocities[2:] = 0.0
    return replace(made, velocities=velocities)


def _measure(name: str, open_table: Open, pucks: int, still: bool) -> Measure:
    """Two seconds, then again from the start: later, two moving pucks would have set all others in motion."""
    start = scene(pucks, still)

    def work() -> None:
        table = open_table(start, HZ)
        for _ in range(100):
            table.step()

    return Measure(f"{name}, {RESTING if still else MOVING}", pucks, 100, work)


def measure(effort: Effort) -> tuple[list[Row], list[str]]:
    """Rows for every number of pucks, and notes about missing engines."""
    engines, _, notes = available()
    rows: list[Row] = []
    for pucks in PUCKS[:2] if effort.quick else PUCKS:
        chosen = {name: engine for name, engine in engines.items() if name == OURS or pucks <= MOST_OTHERS}
        measures = [_measure(name, engine, pucks, still) for still in (False, True) for name, engine in chosen.items()]
        rows += run(measures, effort)
    return rows, notes


def table(rows: list[Row]) -> list[tuple[str, ...]]:
    """One row per number of pucks."""
    names = list(dict.fromkeys(row["what"] for row in rows))
    cells: list[tuple[str, ...]] = [("pucks", *(f"{name}, µs a tick" for name in names))]
    for pucks in sorted({row["at"] for row in rows}):
        found = {row["what"]: 1e6 / row["per_second"] for row in rows if row["at"] == pucks}
        cells.append((str(pucks), *(f"{found[name]:,.1f}" if name in found else "" for name in names)))
    return cells
