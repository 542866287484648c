"""What a run or an evaluation came to: a table in the terminal and a picture."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from agents.measuring.evaluation import Result, TaskResult, wilson_interval
from agents.plots import (
    BLUE,
    GREY,
    RED,
    RULE,
    from_zero,
    new_figure,
    plain,
    save_figure,
    steps_unit,
    time_unit,
    with_interval,
)
from agents.tables import print_table


def print_results(results: Sequence[Result]) -> None:
    """Print wins, losses, draws and the win rates with their 95 % Wilson intervals."""
    points = results[0].points if results else 0
    heads = ("opponent", "wins", "losses", "draws", "win rate (95 %)", "of decided (95 %)", "s/point")
    rows = [
        (
            result.opponent,
            *(str(number) for number in (result.wins, result.losses, result.draws)),
            _share(result.wins, result.points),
            _share(result.wins, result.wins + result.losses),
            f"{result.seconds:.1f}",
        )
        for result in results
    ]
    print_table(f"{points} points each, half of them on each side of the table", [heads, *rows])


def print_task_result(result: TaskResult) -> None:
    """Print successes, failures and the success rate with its 95 % Wilson interval."""
    heads = ("task", "successes", "failures", "by time", "success rate (95 %)", "s/episode")
    counts = (str(number) for number in (result.successes, result.failures, result.timeouts))
    row = (result.task, *counts, _share(result.successes, result.episodes), f"{result.seconds:.1f}")
    print_table(f"{result.episodes} episodes", [heads, row])


def _share(wins: int, points: int) -> str:
    low, high = wilson_interval(wins, points)
    return f"{wins / points:.1%} ({100 * low:.1f}-{100 * high:.1f})" if points else "none"


def draw_training(history: dict[str, Any], opponent: str, path: Path) -> None:
    """Draw the run: win rate with its interval, length of episodes, entropy, and speed."""

    evaluations, updates = history["evaluations"], history["updates"]
    figure = new_figure(11, 6.5)
    axes = figure.subplots(2, 2)

    scale, unit = time_unit(max((row["seconds"] for row in evaluations), default=0.0))
    times = [row["seconds"] / scale for row in evaluations]
    axis = axes[0, 0]
    nan = math.nan  # what JSON keeps as null
    for key, label, color in (
        ("decided_win_rate", "of decided points", RED),
        ("win_rate", "of all points", BLUE),
    ):
        shares = [nan if row[key] is None else row[key] for row in evaluations]
        with_interval(axis, times, shares, [row[f"{key}_95"] for row in evaluations], color, label)
    draws = [row["draws"] / row["points"] for row in evaluations]
    axis.plot(times, draws, color=GREY, label="draws by time", linestyle="--", marker=".")
    axis.axhline(0.5, color=RULE, linewidth=1, zorder=0)
    axis.set(title=f"Wins against {opponent}, 95 % interval", xlabel=unit, ylim=(0, 1))
    from_zero(axis, max(times, default=0.0))
    axis.legend(frameon=False, loc="best")

    most = max((row["steps"] for row in updates), default=0)
    scale, steps = steps_unit(most)
    done = [row["steps"] / scale for row in updates]
    dot = "." if len(updates) < 20 else ""
    seconds = [(row.get("episode_length") or nan) / 50 for row in updates]
    entropies = [nan if row.get("entropy") is None else row["entropy"] for row in updates]
    for axis, values, title in (
        (axes[0, 1], seconds, "Length of an episode in training, s"),
        (axes[1, 0], entropies, "Entropy of the policy, nats"),
        (axes[1, 1], _speed(updates), "Training speed, thousand steps/s"),
    ):
        axis.plot(done, values, color=BLUE, marker=dot)
        axis.set(title=title, xlabel=steps)
        from_zero(axis, most / scale)
        axis.ticklabel_format(axis="y", useOffset=False)
        if not any(math.isfinite(value) for value in values):
            axis.set_yticks([])
            axis.text(0.5, 0.5, "not measured yet", transform=axis.transAxes, ha="center", color=GREY)
        elif axis is not axes[1, 0]:
            axis.set_ylim(0.0, 1.1 * max(value for value in values if math.isfinite(value)))
        else:
            axis.margins(y=0.2)
        if history.get("practice"):
            axis.axvline(history["practice"] / scale, color=GREY, linewidth=1, linestyle=":", label="end of practice")
    if history.get("practice"):
        axes[0, 1].legend(frameon=False)
    for axis in axes.flat:
        plain(axis)
    save_figure(figure, path)


def _speed(updates: Sequence[dict[str, float]], window: int = 20) -> list[float]:
    """Thousand steps per second over the last updates."""
    speeds = []
    for k, row in enumerate(updates):
        before = updates[max(0, k - window)]
        seconds = row["seconds"] - before["seconds"]
        speeds.append((row["steps"] - before["steps"]) / seconds / 1e3 if seconds > 0 else float("nan"))
    return speeds
