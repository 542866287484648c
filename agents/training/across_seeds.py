"""What runs with different seeds come to: how soon they win, how they end, and what that says of further seeds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from agents.measuring.shares import Share
from agents.tables import print_table

LEVELS = (0.9, 0.97)
"""Shares of the decided points whose first evaluation at or above them is reported."""

RESAMPLES = 10_000


def interquartile_mean(values: ArrayLike) -> Any:
    """The mean over the last axis without the lowest and the highest quarter of the values, rounded down to whole ones.

    This is the aggregate of Agarwal et al., "Deep reinforcement learning at the edge of the statistical precipice"
    (NeurIPS 2021), and what their library rliable computes.
    """
    ordered = np.sort(np.asarray(values, np.float64), axis=-1)
    left_out = ordered.shape[-1] // 4
    return ordered[..., left_out : ordered.shape[-1] - left_out].mean(axis=-1)


def bootstrap_interval(values: Sequence[float]) -> tuple[float, float]:
    """95 % percentile interval of the interquartile mean, over runs drawn with replacement, always the same ones."""
    drawn = np.random.default_rng(0).choice(np.asarray(values, np.float64), (RESAMPLES, len(values)))
    low, high = np.quantile(interquartile_mean(drawn), [0.025, 0.975])
    return float(low), float(high)


def last_result(run: dict[str, Any]) -> dict[str, Any]:
    """The result of a run's report against the opponent of its evaluations or, without one, its last evaluation."""
    row = run["evaluations"][-1]
    return next((one for one in run.get("report", []) if one.get("opponent") == row["opponent"]), row)


def print_ends(runs: dict[str, dict[str, Any]]) -> None:
    """Print when each run first reached the `LEVELS`, and how it ended; of several, also median, worst and mean.

    Args:
        runs: records as `curves.read_runs` returns them.
    """
    rows = [
        ("run", *(f"minutes to {level:.0%}" for level in LEVELS), "minutes", "wins", "losses", "draws", "of decided")
    ]
    shares = []
    for name, run in runs.items():
        end = last_result(run)
        share = Share(end["wins"], end["wins"] + end["losses"])
        shares.append(share.value)
        counts = (str(end[key]) for key in ("wins", "losses", "draws"))
        minutes = (_minutes(run["evaluations"], level) for level in LEVELS)
        rows.append((name, *minutes, f"{run['evaluations'][-1]['seconds'] / 60:.1f}", *counts, str(share)))
    print_table("How they end", rows)
    if len(runs) > 1 and not np.isnan(shares).any():
        low, high = bootstrap_interval(shares)
        print(
            f"Of decided: median {np.median(shares):.1%}, worst {min(shares):.1%}, interquartile mean "
            f"{interquartile_mean(shares):.1%} (95 % bootstrap interval over runs: {100 * low:.1f}-{100 * high:.1f})"
        )


def _minutes(evaluations: Sequence[dict[str, Any]], level: float) -> str:
    reached = [row["seconds"] for row in evaluations if (row["decided_win_rate"] or 0.0) >= level]
    return f"{reached[0] / 60:.1f}" if reached else "never"
