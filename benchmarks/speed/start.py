"""Start-up: memory, import time, compilation, and the start from the cache."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from airhockey_env.game import Game
from airhockey_env.kernel.state import STATE
from benchmarks.speed.measure import Effort, Row

TITLE = "Start and memory"
PLAY = (
    "import time; t = time.perf_counter(); import airhockey_env, gymnasium; i = time.perf_counter() - t; "
    "e = gymnasium.make('AirHockey-v0'); e.reset(seed=0); e.step(e.action_space.sample()); "
    "print(i, time.perf_counter() - t)"
)


def measure(effort: Effort) -> tuple[list[Row], list[str]]:
    """Rows for memory and times; there are no notes. A quick run does not compile."""
    state = STATE.itemsize
    memory = state + sum(array.nbytes for array in Game(1).out)
    rows: list[Row] = [
        {"what": "memory per environment: state", "value": state, "unit": "B"},
        {"what": "memory per environment: total", "value": memory, "unit": "B"},
    ]
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}

        def start() -> tuple[float, float]:
            done = subprocess.run(
                [sys.executable, "-c", PLAY], env=environment, check=True, capture_output=True, text=True
            )
            imported, first = map(float, done.stdout.split())
            return imported, first

        if not effort.quick:
            environment["NUMBA_CACHE_DIR"] = folder
            _, compiled = start()
            rows.append({"what": "import to first step, compiling", "value": compiled, "unit": "s"})
        imported, cached = min((start() for _ in range(effort.rounds)), key=sum)
        rows.append({"what": "import to first step, from the cache", "value": cached, "unit": "s"})
        rows.append({"what": "import", "value": imported, "unit": "s"})
    return rows, []


def table(rows: list[Row]) -> list[tuple[str, ...]]:
    """One row per value."""
    return [("what", "value"), *((row["what"], f"{row['value']:.4g} {row['unit']}") for row in rows)]
