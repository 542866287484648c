"""Measure how fast everything is: python -m scripts.benchmark"""

from __future__ import annotations

import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import tyro
from rich.console import Console
from rich.progress import track
from rich.table import Table

import airhockey_env
from agents.files import write_json
from airhockey_env.game import Game
from airhockey_env.records import CONTACT_ROWS, TABLE
from airhockey_env.sensing import ROBOT, Camera, sense


@dataclass(frozen=True)
class BenchmarkArgs:
    """Measure how fast everything is. The measurements take turns; medians and bests of --rounds are printed."""

    rounds: int = 5
    """Rounds of every measurement."""
    seconds: float = 0.5
    """Of one measurement, about."""
    num_envs: int = 4096
    """Tables of the batch."""
    training: bool = True
    """Measure PPO end to end too (needs the extra "train")."""
    start: bool = True
    """Measure importing and compiling too, in processes of their own."""
    json: Path | None = None
    """Write the results to this file too."""


@dataclass(frozen=True)
class Measure:
    """One thing to measure: `work` does `steps` steps."""

    name: str
    steps: int
    work: Callable[[], Any]


def batch_measure(name: str, num_envs: int, camera: Camera | None = None, **arguments: Any) -> Measure:
    """The default game in a batch, with all that a step hands out, and random actions."""
    envs = gym.make_vec("AirHockey-v0", num_envs=num_envs, **arguments)
    if camera is not None:
        envs = sense(envs, camera)
    envs.reset(seed=0)
    envs.action_space.seed(0)
    actions = [envs.action_space.sample() for _ in range(8)]
    steps = max(1, 65536 // num_envs)

    def work() -> None:
        for k in range(steps):
            envs.step(actions[k % 8])

    for _ in range(max(1, 300 // steps)):  # past the first serves, into play
        work()
    return Measure(name, steps * num_envs, work)


def single_measure(name: str, env: gym.Env) -> Measure:
    """One table (or another environment), through its wrappers, with random actions."""
    env.reset(seed=0)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(64)]
    steps = 2000

    def work() -> None:
        for k in range(steps):
            _, _, terminated, truncated, _ = env.step(actions[k % 64])
            if terminated or truncated:
                env.reset()

    return Measure(name, steps, work)


def render_measure(name: str) -> Measure:
    """Pictures of one table."""
    env = gym.make("AirHockey-v0", render_mode="rgb_array")
    env.reset(seed=0)

    def work() -> None:
        for _ in range(50):
            env.render()

    return Measure(name, 50, work)


def run(measures: list[Measure], rounds: int, seconds: float) -> dict[str, dict[str, float]]:
    """Steps per second of each measure: median and best of the rounds, which take turns."""
    speeds: dict[str, list[float]] = {measure.name: [] for measure in measures}
    for measure in measures:
        measure.work()
    for _ in track(range(rounds), description="measuring", transient=True):
        for measure in measures:
            times, start = 0, time.perf_counter()
            while (passed := time.perf_counter() - start) < seconds or times == 0:
                measure.work()
                times += 1
            speeds[measure.name].append(times * measure.steps / passed)
    return {name: {"median": statistics.median(values), "best": max(values)} for name, values in speeds.items()}


def measure_start() -> dict[str, float]:
    """Seconds to import, to the first step with an empty cache of machine code, and to it with a full one."""
    play = (
        "import time; t = time.perf_counter(); import airhockey_env, gymnasium; i = time.perf_counter() - t; "
        "e = gymnasium.make('AirHockey-v0'); e.reset(seed=0); e.step(e.action_space.sample()); "
        "print(i, time.perf_counter() - t)"
    )
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "NUMBA_CACHE_DIR": folder, "PYTHONPATH": str(Path(__file__).parents[1])}

        def start() -> tuple[float, float]:
            done = subprocess.run(
                [sys.executable, "-c", play], env=environment, check=True, capture_output=True, text=True
            )
            imported, first = map(float, done.stdout.split())
            return imported, first

        _, compiled = start()
        imported, cached = min((start() for _ in range(3)), key=sum)
    return {"import": imported, "first_step_compiling": compiled, "first_step_cached": cached}


def measure_training() -> float:
    """PPO with the default arguments, end to end: environment steps per second after the first updates."""
    import torch

    from agents.ppo import TrainArgs, make_env, make_model

    args = TrainArgs()
    torch.set_num_threads(args.threads)
    env = make_env(args)
    model = make_model(args, env)
    update = args.num_envs * args.n_steps
    model.learn(4 * update)
    start = time.perf_counter()
    model.learn(20 * update, reset_num_timesteps=False)
    return 20 * update / (time.perf_counter() - start)


def benchmark(args: BenchmarkArgs) -> dict[str, Any]:
    """Measure, print, and write."""
    measures = [
        batch_measure(f"batch of {args.num_envs}, one core", args.num_envs, num_threads=1),
        batch_measure(f"batch of {args.num_envs}, all cores", args.num_envs),
        batch_measure(
            f"batch of {args.num_envs}, one core, idle opponent", args.num_envs, num_threads=1, opponent="idle"
        ),
        batch_measure(f"batch of {args.num_envs}, one core, shaped", args.num_envs, num_threads=1, reward="shaped"),
        batch_measure(
            f"batch of {args.num_envs}, one core, rgb pictures", args.num_envs, num_threads=1, obs_type="rgb"
        ),
        batch_measure(f"batch of {args.num_envs}, one core, seen by ROBOT", args.num_envs, ROBOT, num_threads=1),
        single_measure("gym.make, one table", gym.make("AirHockey-v0")),
        single_measure("one table without wrappers", gym.make("AirHockey-v0").unwrapped),
        single_measure("Gymnasium's CartPole-v1 through gym.make", gym.make("CartPole-v1")),
        render_measure("pictures of the default size"),
    ]
    speeds = run(measures, args.rounds, args.seconds)
    out = Game(1).out
    memory = TABLE.itemsize + sum(array.nbytes for array in out)
    results: dict[str, Any] = {
        "machine": {
            "processor": platform.processor() or platform.machine(),
            "cores": os.cpu_count(),
            "python": platform.python_version(),
            "numpy": np.__version__,
            "airhockey_env": airhockey_env.__version__,
        },
        "steps_per_second": speeds,
        "bytes_per_table": memory,
        "contact_rows_per_table": CONTACT_ROWS,
    }
    if args.start:
        results["start_seconds"] = measure_start()
    if args.training:
        results["ppo_steps_per_second"] = measure_training()

    table = Table(title=f"airhockey-env {airhockey_env.__version__}: {os.cpu_count()} cores, {args.rounds} rounds")
    for name in ("what", "median", "best"):
        table.add_column(name, justify="left" if name == "what" else "right")
    for name, speed in speeds.items():
        table.add_row(name, f"{speed['median']:,.0f} /s", f"{speed['best']:,.0f} /s")
    if args.training:
        table.add_row("PPO end to end, defaults", f"{results['ppo_steps_per_second']:,.0f} /s", "")
    table.add_row("memory", f"{memory} B a table", "")
    for name, seconds in results.get("start_seconds", {}).items():
        table.add_row(name.replace("_", " "), f"{seconds:.2f} s", "")
    Console().print(table)
    if args.json is not None:
        write_json(args.json, results)
    return results


def main() -> None:
    """Read the command line and measure."""
    args = tyro.cli(BenchmarkArgs, prog="python -m scripts.benchmark")
    if args.rounds < 1 or args.num_envs < 1 or not args.seconds > 0:
        sys.exit("benchmark: --rounds and --num-envs must be 1 or more and --seconds greater than 0")
    if args.json is not None and not args.json.parent.is_dir():
        sys.exit(f"benchmark: --json must name a file in a folder that exists, got {args.json}")
    benchmark(args)


if __name__ == "__main__":
    main()
