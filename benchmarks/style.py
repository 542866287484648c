"""What the figures of benchmarks have in common beside the look of all figures, which stands in `agents.plots`."""

from __future__ import annotations

from gymnasium.error import DependencyNotInstalled

from agents.plots import BLUE, GREEN, RED

COLORS = {"overlap": RED, "kiss": BLUE, "continuous": GREEN}
MARKERS = {"overlap": "s", "kiss": "o", "continuous": "^"}


def check_matplotlib(what: str) -> None:
    """Raise DependencyNotInstalled if matplotlib is missing; `what` is the beginning of the message."""
    try:
        import matplotlib  # noqa: F401
    except ImportError as error:
        raise DependencyNotInstalled(f'{what} the extra "study": pip install -e ".[study]"') from error
