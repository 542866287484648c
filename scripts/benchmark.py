"""Measure how fast everything is: python -m scripts.benchmark"""

from __future__ import annotations

import math
import os
import platform
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any, Literal

import numba
import numpy as np
from rich.progress import track

import airhockey_env
from agents.files import write_json
from agents.options import Count, JsonFile, PlotFile, check_output, check_ranges
from agents.tables import print_table
from benchmarks import page
from benchmarks.speed import batch, c_flags, options, pucks, single, start, training
from benchmarks.speed.measure import Effort
from benchmarks.style import check_matplotlib
from scripts._command import run_command

PARTS: dict[str, ModuleType] = {
    "batch": batch,
    "c_flags": c_flags,
    "single": single,
    "options": options,
    "pucks": pucks,
    "start": start,
    "training": training,
}


@dataclass(frozen=True)
class BenchmarkArgs:
    """Measure how fast everything is, and compare it with other environments and engines.

    Measurements that are compared take turns, in interleaved rounds. The results are medians over the rounds.
    """

    rounds: Count = 5
    """Repeat every measurement in this many rounds."""
    seconds: float = 0.2
    """Let one measurement take about this many seconds."""
    only: Literal["batch", "c_flags", "single", "options", "pucks", "start", "training"] | None = None
    """Measure only this part."""
    quick: bool = False
    """Measure small cases in one short round, to see that everything works."""
    json: JsonFile = None
    plot: PlotFile = None
    page: Path | None = None
    """Also write the tables into this page, between its marks for them, as docs/benchmark.md has them."""

    @property
    def parts(self) -> list[str]:
        """What to measure."""
        return [self.only] if self.only else list(PARTS)


def check(args: BenchmarkArgs) -> None:
    """Raises ValueError, OSError, DependencyNotInstalled for what could not be done in the end."""
    check_ranges(args, rounds=(1, math.inf), seconds=(0.001, 3600))
    for name, path in (("json", args.json), ("plot", args.plot), ("page", args.page)):
        check_output(name, path)
    if args.page is not None:
        if not args.page.is_file():
            raise FileNotFoundError(f"--page must be a page that exists, got {args.page}")
        text = args.page.read_text(encoding="utf-8")
        for name in args.parts:
            page.check(text, name)
    if args.plot is not None:
        check_matplotlib("--plot needs")


def benchmark(args: BenchmarkArgs) -> dict[str, Any]:
    """Measure, print, and write after every part: an interrupt loses none that is done."""
    check(args)
    effort = Effort(1, 0.01, True) if args.quick else Effort(args.rounds, args.seconds)
    results: dict[str, Any] = {
        "machine": {
            "processor": platform.processor() or platform.machine(),
            "cores": os.cpu_count(),
            "load": os.getloadavg() if hasattr(os, "getloadavg") else None,
            "python": platform.python_version(),
            "numpy": np.__version__,
            "numba": numba.__version__,
            "airhockey_env": airhockey_env.__version__,
        },
        "rounds": effort.rounds,
        "seconds": effort.seconds,
    }
    notes = []
    for name in track(args.parts, description="measuring", transient=True):
        part = PARTS[name]
        rows, missing = part.measure(effort)
        notes += missing
        results[name] = rows
        cells = part.table(rows)
        print_table(part.TITLE, cells)
        if args.json is not None:
            write_json(args.json, results)
        if args.page is not None:
            page.write(args.page, page.insert(args.page.read_text(encoding="utf-8"), name, cells))
    if args.plot is not None:
        from benchmarks.speed.plot import draw

        draw(results, args.plot)
    for note in notes:
        print(note)
    return results


def main() -> None:
    """Read the command line and measure."""
    run_command("benchmark", BenchmarkArgs, benchmark)


if __name__ == "__main__":
    main()
