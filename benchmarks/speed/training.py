"""Stable-Baselines3's PPO over the batch, end to end, and the environment's share of the time."""

from __future__ import annotations

import time
from typing import Any

from benchmarks.speed.measure import Effort, Row

TITLE = "Training"
UPDATES = 10


def measure(effort: Effort) -> tuple[list[Row], list[str]]:
    """One row, measured after the first update; there are no notes."""
    import torch

    from agents.training.ppo import PpoArgs, make_env, make_model

    args = PpoArgs()
    torch.set_num_threads(args.threads)
    env = make_env(args)
    model = make_model(args, env)
    update = args.num_envs * args.n_steps
    updates = 1 if effort.quick else UPDATES
    model.learn(update)
    inside = 0.0
    step = env.step

    def timed(actions: Any) -> Any:
        nonlocal inside
        start = time.perf_counter()
        result = step(actions)
        inside += time.perf_counter() - start
        return result

    env.step = timed  # type: ignore[method-assign]
    start = time.perf_counter()
    model.learn(updates * update, reset_num_timesteps=False)
    passed = time.perf_counter() - start
    steps = updates * update / passed
    return [{"what": "PPO, the defaults of scripts.train_ppo", "per_second": steps, "share": inside / passed}], []


def table(rows: list[Row]) -> list[tuple[str, ...]]:
    """The row as a table."""
    cells = [(row["what"], f"{row['per_second']:,.0f}", f"{row['share']:.0%}") for row in rows]
    return [("what", "steps/s", "share of time in the environment"), *cells]
