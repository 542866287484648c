"""Learning curves of several runs side by side: over steps and over wall time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from agents.files import COUNT, TEXT, read_json
from agents.plots import (
    BLUE,
    GREEN,
    INK,
    ORANGE,
    PINK,
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
from agents.training.runs import EVALUATION, RunFolder

COLORS = (BLUE, RED, GREEN, ORANGE, PINK, INK)


def read_runs(names: Sequence[str]) -> dict[str, dict[str, Any]]:
    """The records of runs by their folders' names.

    Raises:
        FileNotFoundError: there is no such run.
        ValueError: its files are damaged.
    """
    runs = {}
    for name in names:
        folder = RunFolder.open(name)
        config = read_json(folder.config, {"opponent": TEXT, "seed": COUNT})
        history = read_json(folder.evaluations, {"evaluations": [EVALUATION]})
        if not history["evaluations"]:
            raise ValueError(f"{folder.path} has no evaluations yet")
        runs[folder.path.name] = {"opponent": config["opponent"], "seed": config["seed"], **history}
    return runs


def print_curves(runs: dict[str, dict[str, Any]]) -> None:
    """Print how every run did at each evaluation."""
    scale, label = steps_unit(max(row["steps"] for run in runs.values() for row in run["evaluations"]))
    rows = [("run", "seed", label, "minutes", "against", "wins", "losses", "draws", "of decided")]
    for name, run in runs.items():
        for row in run["evaluations"]:
            share = row["decided_win_rate"]
            rows.append(
                (
                    name,
                    str(run["seed"]),
                    f"{row['steps'] / scale:.1f}",
                    f"{row['seconds'] / 60:.1f}",
                    row["opponent"],
                    *(str(row[key]) for key in ("wins", "losses", "draws")),
                    "none" if share is None else f"{share:.1%}",
                )
            )
    print_table("Evaluations while training", rows)


def draw_curves(runs: dict[str, dict[str, Any]], path: Path) -> None:
    """Draw the share of decided points won, with its 95 % interval, and that of draws: by steps and by minutes."""
    from matplotlib.ticker import PercentFormatter

    figure = new_figure(11, 4.2)
    axes = figure.subplots(1, 2, sharey=True)
    opponents = sorted({run["opponent"] for run in runs.values()})
    second, times = time_unit(max(row["seconds"] for run in runs.values() for row in run["evaluations"]))
    unit, steps = steps_unit(max(row["steps"] for run in runs.values() for row in run["evaluations"]))
    for axis, key, scale, label in (
        (axes[0], "steps", unit, steps),
        (axes[1], "seconds", second, f"{times} of wall time"),
    ):
        for k, (name, run) in enumerate(runs.items()):
            color = COLORS[k % len(COLORS)]
            rows = run["evaluations"]
            x = [row[key] / scale for row in rows]
            nan = float("nan")  # what JSON keeps as null
            won = [nan if row["decided_win_rate"] is None else row["decided_win_rate"] for row in rows]
            intervals = [row["decided_win_rate_95"] for row in rows]
            with_interval(axis, x, won, intervals, color, f"{name}, seed {run['seed']}")
            axis.plot(x, [row["draws"] / row["points"] for row in rows], color=color, linestyle=":", linewidth=1.2)
        axis.set(xlabel=label, ylim=(0, 1))
        from_zero(axis, max(row[key] / scale for run in runs.values() for row in run["evaluations"]))
        axis.yaxis.set_major_formatter(PercentFormatter(1.0))
        axis.axhline(0.9, color=RULE, linewidth=1, zorder=0)
        plain(axis)
    axes[0].set(title=f"Decided points won against {' and '.join(opponents)} (dotted: draws)")
    axes[0].title.set_size(11)
    axes[1].legend(frameon=False, loc="lower right")
    save_figure(figure, path)
