"""A model of data-parallel PPO: what to expect from more workers than there are to measure with.

In an update, every worker steps its own tables, then makes the same number of gradient steps as the others. Before each
of them, all wait for the slowest, and average their gradients in gloo's ring: with n workers, 2 (n - 1) messages of an
n-th of the bytes each, one after the other. What a worker needs for a gradient step varies by chance, with a lognormal
distribution. The model has no node that is always slower, no lost worker, and no evaluations.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.cluster.costs import Costs

UPDATES = 40
"""Updates that are simulated for one number."""

MOST_SPREAD = 1.5
"""The greatest spread that `fit_spread` returns."""


@dataclass(frozen=True)
class Sizes:
    """An update of all workers together: the defaults of `scripts.train_ppo`."""

    num_envs: int = 512
    n_steps: int = 32
    batch_size: int = 2048
    n_epochs: int = 3

    @property
    def steps(self) -> int:
        """Environment steps of an update."""
        return self.num_envs * self.n_steps

    @property
    def gradients(self) -> int:
        """Gradient steps of an update."""
        return max(1, self.n_epochs * self.steps // self.batch_size)

    def times(self, factor: int) -> Sizes:
        """With so many times the tables and the samples."""
        return replace(self, num_envs=factor * self.num_envs, batch_size=factor * self.batch_size)


@dataclass(frozen=True)
class Expected:
    """What the model expects of a number of workers."""

    workers: int
    per_second: float  # environment steps
    averaging: float  # share of the time in messages
    waiting: float  # share of the time of a worker spent waiting for slower ones


def averaging(costs: Costs, workers: int) -> float:
    """Seconds of an all-reduce of the gradients."""
    return 2 * (workers - 1) * (costs.latency + costs.byte * costs.size / workers)


def sent(costs: Costs, workers: int, sizes: Sizes) -> float:
    """Bytes that each worker sends in an update."""
    return sizes.gradients * 2 * (workers - 1) * costs.size / workers


def expect(costs: Costs, workers: int, sizes: Sizes, seed: int = 0) -> Expected:
    """Simulate updates.

    Args:
        sizes: of all workers together. Each has an equal share, of one table and one sample at least.
    """
    random = np.random.default_rng(seed)
    tables, samples = max(1.0, sizes.num_envs / workers), max(1.0, sizes.batch_size / workers)
    rollout = sizes.n_steps * (costs.step + costs.table * tables)
    gradient = costs.gradient + costs.sample * samples
    # A spread of s in each of many steps is one of s / sqrt(steps) in their sum.
    rollouts = rollout * _chance(random, costs.spread / np.sqrt(sizes.n_steps), (UPDATES, 1, workers))
    gradients = gradient * _chance(random, costs.spread, (UPDATES, sizes.gradients, workers))
    gradients[:, :1] += rollouts  # nobody waits between a rollout and the first gradient step
    slowest = gradients.max(-1).sum()
    messages = UPDATES * sizes.gradients * averaging(costs, workers)
    total = slowest + messages
    waiting = max(0.0, slowest - gradients.mean(-1).sum())
    return Expected(workers, UPDATES * sizes.steps / total, messages / total, waiting / total)


def _chance(random: np.random.Generator, spread: float, shape: tuple[int, ...]) -> np.ndarray:
    """Factors of mean 1."""
    return random.lognormal(-(spread**2) / 2, spread, shape)


def fit_spread(costs: Costs, measured: Mapping[int, float], sizes: Sizes) -> Costs:
    """The same costs with the spread at which the model expects the measured speedup.

    Args:
        measured: environment steps per second by the number of workers, of one and of more. With several of more, their
            spreads are averaged.

    Raises:
        ValueError: there is no measurement of one worker, or none of more.
    """
    if 1 not in measured or len(measured) < 2:
        raise ValueError(f"measured must have the steps per second of 1 worker and of more, got {dict(measured)}")
    spreads = []
    for workers, per_second in measured.items():
        if workers == 1:
            continue
        low, high = 0.0, MOST_SPREAD
        for _ in range(30):
            middle = (low + high) / 2
            guess = replace(costs, spread=middle)
            speedup = expect(guess, workers, sizes).per_second / expect(guess, 1, sizes).per_second
            low, high = (middle, high) if speedup > per_second / measured[1] else (low, middle)
        spreads.append((low + high) / 2)
    return replace(costs, spread=float(np.mean(spreads)))
