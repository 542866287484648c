"""The same scene, started at different phases of the tick: where the pucks go with each method."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airhockey_env.air_table import METHODS, AirTable
from airhockey_env.web.scenes import Scene

PHASES = 12
SECONDS = 0.5
"""How far the paths go."""
MOST_PUCKS = 6
"""Pucks of a scene with a fan."""
STEPS = 8
"""Steps of the continuous method in a tick."""
MOST_PLACES = 60
"""Places on a way, so that answers are short; later bends are cut off."""


def position_at(table: AirTable, seconds: float) -> NDArray[np.float64]:
    """(N, 2) centres so long after the table's last tick, m, with a part of the next tick. The table is unchanged.

    The continuous method plays the part; the others move everything until the end of a tick before they look.
    """
    if table.method != "continuous" or seconds <= 0.0:
        return table.positions + table.velocities * seconds
    positions, velocities, time = table.positions.copy(), table.velocities.copy(), table.time
    table.step(seconds)
    shown = table.positions.copy()
    table.positions[:], table.velocities[:], table.time = positions, velocities, time
    return shown


def fan(scene: Scene) -> dict[str, Any]:
    """Play a scene from `PHASES` phases of the tick.

    Returns:
        `phases`; `paths`, by method: for each phase and puck the places on its way, m; and `spread`, by method: the
        greatest distance between the ends of two paths of the same puck, m, `SECONDS` after the start.
    """
    phases, starts = [], []
    for k in range(PHASES):
        try:
            starts.append(replace(scene, phase=k / PHASES).tables())
        except ValueError:  # an earlier start would be in a wall or in another puck
            continue
        phases.append(k / PHASES)
    paths: dict[str, Any] = {method: [] for method in METHODS}
    spread = dict.fromkeys(METHODS, 0.0)
    for method in METHODS:
        ends = []
        for phase, tables in zip(phases, starts, strict=True):
            way = _way(tables[method], scene.tick, SECONDS + phase * scene.tick)
            ends.append(way[-1])
            paths[method].append(np.stack(way, axis=1).round(4).tolist())
        for one in ends:
            for other in ends:
                spread[method] = max(spread[method], float(np.hypot(*(one - other).T).max()))
    return {"phases": phases, "paths": paths, "spread": spread}


def _way(table: AirTable, tick: float, seconds: float) -> list[NDArray[np.float64]]:
    """Where the pucks are in the beginning, before and after each step with contacts, and in the end.

    What the continuous method does is independent of its steps, so that short ones show where a path bends.
    """
    steps = STEPS if table.method == "continuous" else 1
    ticks = int(seconds / tick)
    way = [table.positions.copy()]
    for _ in range(ticks * steps):
        before = table.positions.copy()
        if len(table.step(tick / steps)) and len(way) < MOST_PLACES:
            way += [before, table.positions.copy()]
    way.append(position_at(table, seconds - ticks * tick))
    return way
