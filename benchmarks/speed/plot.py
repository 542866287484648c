"""The figure of the suite: speed against the batch size, and the cost of pucks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from agents.plots import BLUE, GREEN, GREY, INK, ORANGE, RED, new_figure, plain, save_figure
from benchmarks.kiss.engines import COLORS, OURS
from benchmarks.speed import batch, pucks
from benchmarks.speed.measure import Row

LINES = {
    batch.IN_C: (INK, "s", "--"),
    batch.CODE: (GREEN, "^", "-"),
    batch.TWO_CODE: (GREEN, "^", ":"),
    batch.OURS: (BLUE, "o", "-"),
    batch.TWO: (BLUE, "o", ":"),
    batch.NATIVE: (RED, "v", "-"),
    batch.POOL: (ORANGE, "D", "-"),
    batch.SYNC: (GREY, "x", "-"),
}


def draw(results: dict[str, list[Row]], path: Path) -> None:
    """Plot the parts "batch" and "pucks", as far as they were measured."""
    figure = new_figure(12.5, 4.8)
    left, right = figure.subplots(1, 2)
    for name, (color, marker, line) in LINES.items():
        rows = [row for row in results.get("batch", []) if row["what"] == name]
        if rows:
            points = [row["at"] for row in rows], [row["per_second"] for row in rows]
            left.plot(*points, color=color, marker=marker, linestyle=line, label=name, markersize=5)
    left.set(title="Steps a second", xlabel="tables (or carts) in the batch", ylabel="steps/s")
    for name in dict.fromkeys(row["what"] for row in results.get("pucks", [])):
        engine, still = name.split(", ")
        rows = [row for row in results["pucks"] if row["what"] == name]
        style: dict[str, Any] = {"linestyle": ":" if still == pucks.RESTING else "-", "marker": "o", "markersize": 4}
        style |= {"color": COLORS[engine], "zorder": 3 if engine == OURS else 2}
        right.plot([row["at"] for row in rows], [1e6 / row["per_second"] for row in rows], label=name, **style)
    right.set(title="Processor time of a tick of 20 ms", xlabel="pucks on the table", ylabel="µs")
    for axis in (left, right):
        if axis.lines:
            axis.set(xscale="log", yscale="log")
            axis.legend(frameon=False, fontsize=8)
        plain(axis)
    save_figure(figure, path)
