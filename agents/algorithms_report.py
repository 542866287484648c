"""What a run of `scripts.train` came to: a line in the terminal and a picture."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from agents.plots import plain, save_figure


def print_run(env_id: str, history: dict[str, Any]) -> None:
    """Print success rates before and after training, with their 95 % Wilson intervals."""
    from rich.console import Console
    from rich.table import Table

    table = Table(title=env_id, padding=(0, 1), box=None)
    for name in ("", "steps", "minutes", "episodes", "success rate (95 %)", "s/episode"):
        table.add_column(name, justify="right", no_wrap=True)
    for label, row in (("untrained", history["evaluations"][0]), ("trained", history["evaluations"][-1])):
        low, high = row["success_rate_95"]
        table.add_row(
            label,
            f"{row['steps']:,}",
            f"{row['seconds'] / 60:.1f}",
            str(row["episodes"]),
            f"{row['success_rate']:.1%} ({100 * low:.1f}-{100 * high:.1f})",
            f"{row['mean_seconds']:.2f}",
        )
    Console().print(table)


def draw_run(history: dict[str, Any], title: str, path: Path) -> None:
    """Draw the success rate with its interval over steps, the untrained one beside it, and the cost in minutes."""
    from matplotlib.figure import Figure

    rows = history["evaluations"]
    figure = Figure(figsize=(11, 4), layout="constrained")
    figure.suptitle(title)
    success, cost = figure.subplots(1, 2)
    thousands = [row["steps"] / 1e3 for row in rows]
    low, high = zip(*(row["success_rate_95"] for row in rows), strict=True)
    success.axhspan(*rows[0]["success_rate_95"], color="#8a8f9c", alpha=0.15, linewidth=0, label="untrained")
    success.fill_between(thousands, low, high, color="#e5395b", alpha=0.15, linewidth=0)
    success.plot(thousands, [row["success_rate"] for row in rows], color="#e5395b", marker=".", label="trained")
    success.set(title="Episodes that succeed, 95 % interval", xlabel="thousand steps", ylim=(0, 1))
    success.legend(frameon=False, loc="upper left")
    cost.plot(thousands, [row["seconds"] / 60 for row in rows], color="#2f6fdd", marker=".")
    cost.set(title="Minutes of training", xlabel="thousand steps")
    cost.set_ylim(bottom=0)
    for axis in (success, cost):
        plain(axis)
    save_figure(figure, path)
