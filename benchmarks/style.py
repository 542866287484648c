"""Common style of the figures. The colours are those of Okabe and Ito, which colour-blind people can distinguish."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

from gymnasium.error import DependencyNotInstalled

from agents.plots import plain
from airhockey_env.files import replace

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLORS = {"overlap": "#D55E00", "kiss": "#0072B2", "continuous": "#009E73"}
MARKERS = {"overlap": "s", "kiss": "o", "continuous": "^"}
BLUE, RED, GREEN = "#0072B2", "#D55E00", "#009E73"
INK, GREY, PALE = "#22262e", "#8a8f9c", "#e6e8ee"


def check_matplotlib(what: str) -> None:
    """Raise DependencyNotInstalled if matplotlib is missing; `what` is the beginning of the message."""
    try:
        import matplotlib  # noqa: F401
    except ImportError as error:
        raise DependencyNotInstalled(f'{what} the extra "study": pip install -e ".[study]"') from error


def new_figure(width: float, height: float) -> Figure:
    """Create an empty figure; sizes in inches."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def tidy(axis: Axes) -> None:
    """Add a pale grid behind the data and remove the box around it."""
    plain(axis, PALE)


def save(figure: Figure, path: Path) -> None:
    """Write a PNG atomically, with a colour palette, which makes it a third of the size."""
    from PIL import Image

    picture = BytesIO()
    figure.savefig(picture, dpi=110, format="png")
    small = Image.open(picture).convert("RGB").quantize(256, dither=Image.Dither.NONE)
    replace(path, lambda part: small.save(part, format="PNG", optimize=True))
