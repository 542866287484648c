"""How all figures look, and how they are written.

Colours are those of Okabe and Ito, which colour-blind people can tell apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from airhockey_env.files import replace

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BLUE, RED, GREEN, ORANGE, PINK, SKY = "#0072B2", "#D55E00", "#009E73", "#E69F00", "#CC79A7", "#56B4E9"
INK, GREY, RULE, PALE = "#22262e", "#8a8f9c", "#c9ccd4", "#e6e8ee"
"""Greys, from the darkest: of texts, of what matters less, of lines to compare with, and of grids."""


def new_figure(width: float, height: float) -> Figure:
    """An empty figure, inches."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def plain(axis: Any) -> None:
    """A pale grid behind what is drawn, and no frame above and on the right."""
    axis.grid(color=PALE)
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


def heat_map(axis: Any, percents: Any) -> None:
    """Draw percentages (n, m), from red over white at 50 to blue, with a number in each cell; NaN is left empty."""
    from matplotlib.colors import LinearSegmentedColormap

    colors = LinearSegmentedColormap.from_list("percents", [RED, "white", BLUE])
    axis.imshow(np.ma.masked_invalid(percents), cmap=colors, vmin=0, vmax=100, aspect="auto")
    for (i, j), percent in np.ndenumerate(percents):
        if not np.isnan(percent):
            dark = abs(percent - 50) > 30
            axis.text(j, i, f"{percent:.0f}", ha="center", va="center", color="white" if dark else INK)
    axis.set_xticks(np.arange(1, percents.shape[1]) - 0.5, minor=True)
    axis.set_yticks(np.arange(1, percents.shape[0]) - 0.5, minor=True)
    axis.grid(which="minor", color="white", linewidth=2)
    axis.tick_params(which="both", length=0)
    axis.spines[:].set_visible(False)


def save_figure(figure: Any, path: Path) -> None:
    """Write a figure as a .png with a palette, which takes a third of the space. The write is atomic."""
    from PIL import Image

    picture = BytesIO()
    figure.savefig(picture, dpi=110, format="png")
    method = Image.Quantize.MAXCOVERAGE  # keeps the colours of small things beside large shaded areas
    small = Image.open(picture).convert("RGB").quantize(256, method=method, dither=Image.Dither.NONE)
    replace(path, lambda part: small.save(part, format="PNG", optimize=True))
