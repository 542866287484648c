"""Timing in interleaved rounds, so that other load on the machine affects everything equally."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Effort:
    """How much to measure: `rounds` of about `seconds` each; `quick` leaves out large measurements."""

    rounds: int
    seconds: float
    quick: bool = False


@dataclass(frozen=True)
class Measure:
    """One thing to measure.

    Args:
        name: what is measured.
        at: its size, if it is measured at several: environments in a batch, or pucks.
        steps: number of steps that a call of `work` makes.
        work: the function to time.
        threads: number of threads. One thread is timed by CPU time, several by wall time.
    """

    name: str
    at: int
    steps: int
    work: Callable[[], Any]
    threads: int = 1


Row = dict[str, Any]


def run(measures: list[Measure], effort: Effort) -> list[Row]:
    """Steps per second of each measure: median and best over interleaved rounds."""
    speeds: list[list[float]] = [[] for _ in measures]
    for measure in measures:
        measure.work()
    for _ in range(effort.rounds):
        for measure, found in zip(measures, speeds, strict=True):
            clock = time.perf_counter if measure.threads > 1 else time.process_time
            times, start = 0, clock()
            while (passed := clock() - start) < effort.seconds or times == 0:
                measure.work()
                times += 1
            found.append(times * measure.steps / max(passed, 1e-9))
    return [
        {
            "what": measure.name,
            "at": measure.at,
            "threads": measure.threads,
            "per_second": statistics.median(found),
            "best": max(found),
        }
        for measure, found in zip(measures, speeds, strict=True)
    ]


def ratio(rows: list[Row], row: Row, to: str) -> float | None:
    """Speed of a row divided by that of `to` at the same size; None if that was not measured."""
    other = next((r["per_second"] for r in rows if r["what"] == to and r["at"] == row["at"]), None)
    return None if other is None else row["per_second"] / other


def thousands(speed: float) -> str:
    """Format thousand steps per second, with three digits or more."""
    return f"{speed / 1e3:,.1f}" if speed < 1e5 else f"{speed / 1e3:,.0f}"
