"""How the pictures of runs, ladders and score cards look, and how they are written."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from airhockey_env.files import replace

PALE = "#eceef2"


def plain(axis: Any, color: str = PALE) -> None:
    """A pale grid behind what is drawn, and no frame above and on the right."""
    axis.grid(color=color)
    axis.set_axisbelow(True)
    axis.spines[["top", "right"]].set_visible(False)


def steps_unit(most: float) -> tuple[float, str]:
    """What to divide numbers of steps by on an axis up to `most`, and the axis's label."""
    for scale, label in ((1e6, "million steps"), (1e3, "thousand steps")):
        if most >= scale:
            return scale, label
    return 1.0, "steps"


def time_unit(most: float) -> tuple[float, str]:
    """What to divide seconds by on an axis up to `most`, and the axis's label."""
    return (60.0, "minutes") if most >= 120.0 else (1.0, "seconds")


def from_zero(axis: Any, most: float) -> None:
    """A horizontal axis from 0 to a little more than `most`: a single point is not blown up to a range of its own."""
    axis.set_xlim(0.0, 1.05 * most if most > 0.0 else 1.0)
    axis.ticklabel_format(axis="x", style="plain", useOffset=False)


def with_interval(
    axis: Any, x: Sequence[float], y: Sequence[float], intervals: Sequence[Sequence[float]], color: str, label: str
) -> None:
    """Draw values over x with their intervals, which show where there is but one value too."""
    axis.plot(x, y, color=color, label=label, marker=".")
    if intervals:
        low, high = zip(*intervals, strict=True)
        axis.fill_between(x, low, high, color=color, alpha=0.15, linewidth=0)
        axis.vlines(x, low, high, color=color, alpha=0.5, linewidth=1)


def save_figure(figure: Any, path: Path) -> None:
    """Write a figure as a .png, at once or not at all."""
    replace(path, lambda part: figure.savefig(part, dpi=110, format="png"))
