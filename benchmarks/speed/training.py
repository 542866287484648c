"""Stable-Baselines3's PPO over the batch, end to end, and where its time goes."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

from benchmarks.speed.measure import Effort, Row

TITLE = "Training"
UPDATES = 10
THREADS = (1, 2)


def measure(effort: Effort) -> tuple[list[Row], list[str]]:
    """A row for each number of threads, measured after the first update; there are no notes."""
    import torch

    before = torch.get_num_threads()
    try:
        return [_row(threads, 1 if effort.quick else UPDATES) for threads in THREADS], []
    finally:
        torch.set_num_threads(before)


def _row(threads: int, updates: int) -> Row:
    import torch

    from agents.training.ppo import PpoArgs, make_env, make_model

    torch.set_num_threads(threads)
    args = PpoArgs(threads=threads)
    env = make_env(args)
    model = make_model(args, env)
    rollout = args.num_envs * args.n_steps
    model.learn(rollout)
    inside = {"environment": 0.0, "gradient steps": 0.0}
    for name, owner, method in (("environment", env, "step"), ("gradient steps", model, "train")):
        setattr(owner, method, partial(_timed, getattr(owner, method), inside, name))
    start = time.perf_counter()
    model.learn(updates * rollout, reset_num_timesteps=False)
    passed = time.perf_counter() - start
    shares = {name: seconds / passed for name, seconds in inside.items()}
    return {
        "what": f"PPO, the defaults of scripts.train_ppo, --threads {threads}",
        "per_second": updates * rollout / passed,
        "shares": {**shares, "the rest": 1.0 - sum(shares.values())},
    }


def _timed(call: Callable[..., Any], inside: dict[str, float], name: str, *arguments: Any) -> Any:
    start = time.perf_counter()
    result = call(*arguments)
    inside[name] += time.perf_counter() - start
    return result


def table(rows: list[Row]) -> list[tuple[str, ...]]:
    """The rows as a table, with the parts of the time."""
    cells = [
        (row["what"], f"{row['per_second']:,.0f}", *(f"{share:.0%}" for share in row["shares"].values()))
        for row in rows
    ]
    return [("what", "steps/s", *rows[0]["shares"]), *cells]
