"""Common style of the figures of runs, ladders and score cards, and how they are saved."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from airhockey_env.files import replace

PALE = "#eceef2"


def plain(axis: Any, color: str = PALE) -> None:
    """Add a pale grid behind the data, and remove the upper and right frame."""
    axis.grid(color=color)
    axis.set_axisbelow(True)
    axis.spines[["top", "right"]].set_visible(False)


def steps_unit(most: float) -> tuple[float, str]:
    """The unit for an axis of steps up to `most`, as a divisor and a label."""
    for scale, label in ((1e6, "million steps"), (1e3, "thousand steps")):
        if most >= scale:
            return scale, label
    return 1.0, "steps"


def time_unit(most: float) -> tuple[float, str]:
    """The unit for an axis of times up to `most` s, as a divisor and a label."""
    return (60.0, "minutes") if most >= 120.0 else (1.0, "seconds")


def from_zero(axis: Any, most: float) -> None:
    """Set the x axis from 0 to a little more than `most`, so that a single point does not get a range of its own."""
    axis.set_xlim(0.0, 1.05 * most if most > 0.0 else 1.0)
    axis.ticklabel_format(axis="x", style="plain", useOffset=False)


def with_interval(
    axis: Any, x: Sequence[float], y: Sequence[float], intervals: Sequence[Sequence[float]], color: str, label: str
) -> None:
    """Draw values over x with their intervals, which are visible for a single value too."""
    axis.plot(x, y, color=color, label=label, marker=".")
    if intervals:
        low, high = zip(*intervals, strict=True)
        axis.fill_between(x, low, high, color=color, alpha=0.15, linewidth=0)
        axis.vlines(x, low, high, color=color, alpha=0.5, linewidth=1)


def save_figure(figure: Any, path: Path) -> None:
    """Write a figure as a .png file, atomically."""
    replace(path, lambda part: figure.savefig(part, dpi=110, format="png"))
