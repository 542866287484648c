"""What a run of `scripts.train` came to: a line in the terminal and a picture."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from agents.plots import from_zero, plain, save_figure, steps_unit, time_unit, with_interval
from agents.tables import print_table


def print_run(env_id: str, history: dict[str, Any]) -> None:
    """Print success rates before and after training, with their 95 % Wilson intervals."""
    rows = [("", "steps", "minutes", "episodes", "success rate (95 %)", "s/episode")]
    for label, row in (("untrained", history["evaluations"][0]), ("trained", history["evaluations"][-1])):
        low, high = row["success_rate_95"]
        rows.append(
            (
                label,
                f"{row['steps']:,}",
                f"{row['seconds'] / 60:.1f}",
                str(row["episodes"]),
                f"{row['success_rate']:.1%} ({100 * low:.1f}-{100 * high:.1f})",
                f"{row['mean_seconds']:.2f}",
            )
        )
    print_table(env_id, rows)


def draw_run(history: dict[str, Any], title: str, path: Path) -> None:
    """Draw the success rate with its interval over steps, the untrained one beside it, and the cost in minutes."""
    from matplotlib.figure import Figure

    rows = history["evaluations"]
    figure = Figure(figsize=(11, 4), layout="constrained")
    figure.suptitle(title)
    success, cost = figure.subplots(1, 2)
    most = max(row["steps"] for row in rows)
    scale, label = steps_unit(most)
    steps = [row["steps"] / scale for row in rows]
    success.axhspan(*rows[0]["success_rate_95"], color="#8a8f9c", alpha=0.15, linewidth=0, label="untrained")
    rates, intervals = [row["success_rate"] for row in rows], [row["success_rate_95"] for row in rows]
    with_interval(success, steps, rates, intervals, "#e5395b", "trained")
    success.set(title="Episodes that succeed, 95 % interval", xlabel=label, ylim=(0, 1))
    success.legend(frameon=False, loc="upper left")
    second, unit = time_unit(max(row["seconds"] for row in rows))
    times = [row["seconds"] / second for row in rows]
    cost.plot(steps, times, color="#2f6fdd", marker=".")
    cost.set(title=f"{unit.capitalize()} of training", xlabel=label, ylim=(0.0, 1.1 * max(times) or 1.0))
    for axis in (success, cost):
        from_zero(axis, most / scale)
        plain(axis)
    save_figure(figure, path)
