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
    rows = []
    for threads in THREADS:
        torch.set_num_threads(threads)
        name = f"PPO, the defaults of scripts.train_ppo, --threads {threads}"
        rows.append(_row(name, 1 if effort.quick else UPDATES))
    torch.set_num_threads(before)
    return rows, []


def _row(name: str, updates: int) -> Row:
    from agents.training.ppo import PpoArgs, make_env, make_model

    args = PpoArgs()
    env = make_env(args)
    model = make_model(args, env)
    rollout = args.num_envs * args.n_steps
    model.learn(rollout)
    inside = {"environment": 0.0, "gradient steps": 0.0}
    env.step = partial(_timed, env.step, inside, "environment")  # type: ignore[method-assign]
    model.train = partial(_timed, model.train, inside, "gradient steps")  # type: ignore[method-assign]
    start = time.perf_counter()
    model.learn(updates * rollout, reset_num_timesteps=False)
    passed = time.perf_counter() - start
    shares = {part: seconds / passed for part, seconds in inside.items()}
    return {
        "what": name,
        "per_second": updates * rollout / passed,
        "shares": {**shares, "the rest": 1.0 - sum(shares.values())},
    }


def _timed(call: Callable[..., Any], inside: dict[str, float], part: str, *arguments: Any) -> Any:
    start = time.perf_counter()
    result = call(*arguments)
    inside[part] += time.perf_counter() - start
    return result


def table(rows: list[Row]) -> list[tuple[str, ...]]:
    """The rows as a table, with the parts of the time."""
    cells = [
        (row["what"], f"{row['per_second']:,.0f}", *(f"{share:.0%}" for share in row["shares"].values()))
        for row in rows
    ]
    return [("what", "steps/s", *rows[0]["shares"]), *cells]
