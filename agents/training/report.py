"""The results of a run or an evaluation: tables in the terminal and a picture."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from agents.measuring.evaluation import Result, TaskResult
from agents.measuring.shares import Share
from agents.plots import BLUE, GREY, RED, from_zero, new_figure, plain, save_figure, steps_unit, with_interval
from agents.tables import print_table


def print_results(results: Sequence[Result], conditions: str) -> None:
    """Print wins, losses, draws and the win rates with their 95 % Wilson intervals.

    Args:
        conditions: under which the points were played, in words.
    """
    points = results[0].points if results else 0
    heads = ("opponent", "wins", "losses", "draws", "win rate (95 %)", "of decided (95 %)", "s/point")
    rows = [
        (
            result.opponent,
            *(str(number) for number in (result.wins, result.losses, result.draws)),
            str(Share(result.wins, result.points)),
            str(Share(result.wins, result.wins + result.losses)),
            f"{result.seconds:.1f}",
        )
        for result in results
    ]
    print_table(f"{points} points each, half of them on each side; {conditions}", [heads, *rows])


def print_task_result(result: TaskResult, conditions: str) -> None:
    """Print successes, failures and the success rate with its 95 % Wilson interval.

    Args:
        conditions: under which the episodes were played, in words.
    """
    heads = ("task", "successes", "failures", "by time", "success rate (95 %)", "s/episode")
    counts = (str(number) for number in (result.successes, result.failures, result.timeouts))
    row = (result.task, *counts, str(Share(result.successes, result.episodes)), f"{result.seconds:.1f}")
    print_table(f"{result.episodes} episodes; {conditions}", [heads, row])


def print_successes(title: str, agents: Mapping[str, Mapping[str, Any]]) -> None:
    """Print success rates with their 95 % Wilson intervals.

    Args:
        agents: rows of evaluations, by the names of the agents.
    """
    rows = [("", "episodes", "success rate (95 %)", "s/episode")]
    for name, row in agents.items():
        rows.append((name, str(row["episodes"]), success_rate(row), f"{row['mean_seconds']:.2f}"))
    print_table(title, rows)


def success_rate(row: Mapping[str, Any]) -> str:
    """The success rate of an evaluation and its 95 % interval, in %."""
    low, high = row["success_rate_95"]
    return f"{row['success_rate']:.1%} ({100 * low:.1f}-{100 * high:.1f})"


def draw_training(history: dict[str, Any], title: str, path: Path) -> None:
    """Draw evaluations with their intervals, length of episodes, entropy, and speed, all over steps.

    Args:
        history: the records of a run, as in `checkpoints.HISTORY`.
        title: the title of the picture.
        path: the .png file.
    """

    evaluations, updates = history["evaluations"], history["updates"]
    figure = new_figure(11, 6.5)
    figure.suptitle(title)
    axes = figure.subplots(2, 2)
    most = max((row["steps"] for row in (*evaluations, *updates)), default=0)
    scale, label = steps_unit(most)
    _draw_evaluations(axes[0, 0], evaluations, scale)
    lengths = [_value(row, "episode_length") / 50 for row in updates]
    entropies = [_value(row, "entropy") for row in updates]
    done = [row["steps"] / scale for row in updates]
    for axis, values, what in (
        (axes[0, 1], lengths, "Length of an episode in training, s"),
        (axes[1, 0], entropies, "Entropy of the policy, nats"),
        (axes[1, 1], _speed(updates), "Training speed, thousand steps/s"),
    ):
        axis.set(title=what)
        _draw_updates(axis, done, values, from_nothing=values is not entropies)
    for axis in axes.flat:
        axis.set(xlabel=label)
        from_zero(axis, most / scale)
        if history["practice"]:
            practice = history["practice"] / scale
            axis.axvline(practice, color=GREY, linewidth=1, linestyle=":", zorder=0, label="end of practice")
        plain(axis)
    if evaluations or history["practice"]:
        axes[0, 0].legend(frameon=False)
    save_figure(figure, path)


def _draw_evaluations(axis: Any, rows: Sequence[Mapping[str, Any]], scale: float) -> None:
    """Draw the shares of points won and drawn, or of successful episodes."""
    steps = [row["steps"] / scale for row in rows]
    for key, label, color in (
        ("decided_win_rate", "won of decided points", RED),
        ("win_rate", "won of all points", BLUE),
        ("success_rate", "successful episodes", RED),
    ):
        if rows and key in rows[0]:
            shares = [_value(row, key) for row in rows]
            with_interval(axis, steps, shares, [row[f"{key}_95"] for row in rows], color, label)
    if rows and "draws" in rows[0]:
        draws = [row["draws"] / row["points"] for row in rows]
        axis.plot(steps, draws, color=GREY, label="draws by time", linestyle="--", marker=".")
    axis.set(title="Evaluations, with 95 % intervals", ylim=(0, 1))


def _draw_updates(axis: Any, steps: Sequence[float], values: Sequence[float], from_nothing: bool) -> None:
    """Draw one value per update. With `from_nothing`, the vertical axis begins at 0."""
    axis.plot(steps, values, color=BLUE, marker="." if len(values) < 20 else "")
    axis.ticklabel_format(axis="y", useOffset=False)
    finite = [value for value in values if math.isfinite(value)]
    if not finite:
        axis.set_yticks([])
        axis.text(0.5, 0.5, "not measured", transform=axis.transAxes, ha="center", color=GREY)
    elif from_nothing:
        axis.set_ylim(0.0, 1.1 * max(finite))
    else:
        axis.margins(y=0.2)


def _value(row: Mapping[str, Any], key: str) -> float:
    """A value of a row of records, NaN if it is missing or null."""
    value = row.get(key)
    return math.nan if value is None else value


def _speed(updates: Sequence[dict[str, float]], window: int = 20) -> list[float]:
    """Thousands of steps per second, over a window of updates."""
    speeds = []
    for k, row in enumerate(updates):
        before = updates[max(0, k - window)]
        seconds = row["seconds"] - before["seconds"]
        speeds.append((row["steps"] - before["steps"]) / seconds / 1e3 if seconds > 0 else math.nan)
    return speeds
