"""What a run or an evaluation came to: a table in the terminal and a picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from agents.evaluation import Result, TaskResult, wilson_interval
from agents.plots import plain, save_figure
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
    from matplotlib.figure import Figure

    evaluations, updates = history["evaluations"], history["updates"]
    figure = Figure(figsize=(11, 6.5), layout="constrained")
    axes = figure.subplots(2, 2)

    minutes = [row["seconds"] / 60 for row in evaluations]
    axis = axes[0, 0]
    nan = float("nan")  # what JSON keeps as null
    for key, label, color in (
        ("decided_win_rate", "of decided points", "#e5395b"),
        ("win_rate", "of all points", "#2f6fdd"),
    ):
        axis.plot(
            minutes,
            [nan if row[key] is None else row[key] for row in evaluations],
            color=color,
            label=label,
            marker=".",
        )
        low, high = zip(*(row[f"{key}_95"] for row in evaluations), strict=True) if evaluations else ((), ())
        axis.fill_between(minutes, low, high, color=color, alpha=0.15, linewidth=0)
    draws = [row["draws"] / row["points"] for row in evaluations]
    axis.plot(minutes, draws, color="#8a8f9c", label="draws by time", linestyle="--", marker=".")
    axis.axhline(0.5, color="#c9ccd4", linewidth=1, zorder=0)
    axis.set(title=f"Wins against {opponent}, 95 % interval", xlabel="minutes", ylim=(0, 1))
    axis.legend(frameon=False, loc="center right")

    millions = [row["steps"] / 1e6 for row in updates]
    seconds = [(row.get("episode_length") or nan) / 50 for row in updates]
    axes[0, 1].plot(millions, seconds, color="#2f6fdd")
    axes[0, 1].set(title="Length of an episode in training, s", xlabel="million steps")
    axes[1, 0].plot(
        millions, [nan if row.get("entropy") is None else row["entropy"] for row in updates], color="#2f6fdd"
    )
    axes[1, 0].set(title="Entropy of the policy, nats", xlabel="million steps")
    axes[1, 1].plot(millions, _speed(updates), color="#2f6fdd")
    axes[1, 1].set(title="Training speed, thousand steps/s", xlabel="million steps")
    axes[1, 1].set_ylim(bottom=0)
    if history.get("practice"):
        for axis in axes.flat[1:]:
            axis.axvline(
                history["practice"] / 1e6, color="#8a8f9c", linewidth=1, linestyle=":", label="end of practice"
            )
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
