"""Learning curves of several runs side by side: over steps and over wall time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from agents.files import COUNT, read_json
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
from agents.training.checkpoints import TIMES
from agents.training.ppo import EVALUATION
from agents.training.runs import RunFolder

COLORS = (BLUE, RED, GREEN, ORANGE, PINK, INK)


def read_runs(names: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Read the seeds and records of runs, by the names of their folders.

    Raises:
        FileNotFoundError: there is no such run.
        ValueError: its files are damaged, or it is not a run of train_ppo or train_self_play.
    """
    runs = {}
    for name in names:
        folder = RunFolder.open(name)
        config = read_json(folder.config, {"seed": COUNT})
        history = read_json(folder.evaluations, {"evaluations": [{**TIMES, **EVALUATION}]})
        if not history["evaluations"]:
            raise ValueError(f"{folder.path} has no evaluations yet")
        runs[folder.path.name] = {"seed": config["seed"], **history}
    return runs


def print_curves(runs: dict[str, dict[str, Any]]) -> None:
    """Print the evaluations of all runs."""
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
    """Draw the shares of decided points won, with 95 % intervals, and of draws, over steps and over time."""
    from matplotlib.ticker import PercentFormatter

    figure = new_figure(11, 4.2)
    axes = figure.subplots(1, 2, sharey=True)
    every = [row for run in runs.values() for row in run["evaluations"]]
    steps, seconds = (max(row[key] for row in every) for key in ("steps", "seconds"))
    for axis, key, most, (scale, label) in (
        (axes[0], "steps", steps, steps_unit(steps)),
        (axes[1], "seconds", seconds, time_unit(seconds)),
    ):
        for k, (name, run) in enumerate(runs.items()):
            color, rows = COLORS[k % len(COLORS)], run["evaluations"]
            x = [row[key] / scale for row in rows]
            won = [math.nan if row["decided_win_rate"] is None else row["decided_win_rate"] for row in rows]
            intervals = [row["decided_win_rate_95"] for row in rows]
            with_interval(axis, x, won, intervals, color, f"{name}, seed {run['seed']}")
            axis.plot(x, [row["draws"] / row["points"] for row in rows], color=color, linestyle=":", linewidth=1.2)
        axis.set(xlabel=label if key == "steps" else f"{label} of training", ylim=(0, 1))
        from_zero(axis, most / scale)
        axis.yaxis.set_major_formatter(PercentFormatter(1.0))
        axis.axhline(0.9, color=RULE, linewidth=1, zorder=0)
        plain(axis)
    opponents = " and ".join(sorted({row["opponent"] for row in every}))
    axes[0].set_title(f"Decided points won against {opponents} (dotted: draws)", size=11)
    axes[1].legend(frameon=False, loc="lower right")
    save_figure(figure, path)
