"""What is measured, and how: everything takes turns, so that whatever else the machine does strikes all alike."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Effort:
    """How much to measure: `rounds` of about `seconds` each; `quick` leaves out what is large."""

    rounds: int
    seconds: float
    quick: bool = False


@dataclass(frozen=True)
class Measure:
    """One thing to measure.

    Args:
        name: what it is.
        at: its size, where it is measured at several: tables of a batch, pucks.
        steps: how many `work` does.
        threads: by more than one, it is timed by the clock on the wall; else by the processor's time.
    """

    name: str
    at: int
    steps: int
    work: Callable[[], Any]
    threads: int = 1


Row = dict[str, Any]


def run(measures: list[Measure], effort: Effort) -> list[Row]:
    """Steps per second of each measure, median and best of rounds in which all take turns."""
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
    """The row's speed as a multiple of that of `to` at the same size; None if that was not measured."""
    other = next((r["per_second"] for r in rows if r["what"] == to and r["at"] == row["at"]), None)
    return None if other is None else row["per_second"] / other


def thousands(speed: float) -> str:
    """Thousand steps a second, in three figures or more."""
    return f"{speed / 1e3:,.1f}" if speed < 1e5 else f"{speed / 1e3:,.0f}"
