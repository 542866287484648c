"""How the pictures of runs, ladders and score cards look, and how they are written."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from airhockey_env.files import replace

PALE = "#eceef2"


def plain(axis: Any, color: str = PALE) -> None:
    """A pale grid behind what is drawn, and no frame above and on the right."""
    axis.grid(color=color)
    axis.set_axisbelow(True)
    axis.spines[["top", "right"]].set_visible(False)


def save_figure(figure: Any, path: Path) -> None:
    """Write a figure as a .png, at once or not at all."""
    replace(path, lambda part: figure.savefig(part, dpi=110, format="png"))
