"""Steps per second of the default game against the batch size, compared with C and with CartPole batches."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from gymnasium.error import DependencyNotInstalled

from benchmarks.speed import games
from benchmarks.speed.measure import Effort, Measure, Row, ratio, run, thousands

TITLE = "Batches, thousand steps/s"
SIZES = (1, 16, 256, 4096, 65_536)
MOST_SYNC = 256  # SyncVectorEnv makes a Python call per environment
THREADED = 256  # up to this size, a single thread steps the batch
OURS, CODE, IN_C = "gym.make_vec", "its compiled step alone", "the same game in C"
TWO, TWO_CODE = f"{OURS}, two threads", f"{CODE}, two threads"
NATIVE, SYNC, POOL = "CartPole-v1, Gymnasium's own batch", "CartPole-v1, SyncVectorEnv", "CartPole-v1, EnvPool"


def measure(effort: Effort) -> tuple[list[Row], list[str]]:
    """Rows for every batch size, and notes about what is missing."""
    rows: list[Row] = []
    notes: list[str] = []
    for size in SIZES[:3] if effort.quick else SIZES:
        wanted: list[tuple[str, Callable[..., Measure], dict[str, Any]]] = [
            (OURS, games.batch, {}),
            (CODE, games.compiled, {}),
            (IN_C, games.in_c, {}),
            (NATIVE, games.cart_poles, {"mode": "vector_entry_point"}),
            (POOL, games.env_pool, {}),
        ]
        if size > THREADED:
            wanted.insert(1, (TWO, games.batch, {"threads": 2}))
            wanted.insert(3, (TWO_CODE, games.compiled, {"threads": 2}))
        if size <= MOST_SYNC:
            wanted.append((SYNC, games.cart_poles, {"mode": "sync"}))
        measures = []
        for name, make, arguments in wanted:
            try:
                measures.append(make(name, size, **arguments))
            except (ImportError, DependencyNotInstalled) as error:
                notes.append(f"{name} is left out: {error}")
        rows += run(measures, effort)
    return rows, sorted(set(notes))


def table(rows: list[Row]) -> list[tuple[str, ...]]:
    """One row per batch size."""
    everything = (OURS, TWO, CODE, TWO_CODE, IN_C, NATIVE, POOL, SYNC)
    names = [name for name in everything if any(row["what"] == name for row in rows)]
    table: list[tuple[str, ...]] = [("environments", *names, "compiled step relative to C")]
    for size in sorted({row["at"] for row in rows}):
        found = {row["what"]: row for row in rows if row["at"] == size}
        share = ratio(rows, found[CODE], IN_C)
        cells = [thousands(found[name]["per_second"]) if name in found else "" for name in names]
        table.append((f"{size:,}", *cells, "" if share is None else f"{share:.2f}"))
    return table
