"""Learning curves of runs side by side: python -m scripts.curves RUN [RUN ...]"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import tyro

from agents.options import PlotFile, check_output
from agents.training.across_seeds import print_ends
from agents.training.curves import draw_curves, print_curves, read_runs
from scripts._command import run_command


@dataclass(frozen=True)
class CurvesArgs:
    """Print and draw the learning curves of training runs."""

    runs: Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="RUN [RUN ...]")]
    """Show the curves of these runs, each given by its folder or its name under runs/."""
    plot: PlotFile = None


def curves(args: CurvesArgs) -> None:
    """Read, print, and draw.

    Raises:
        ValueError, OSError: an argument does not fit.
    """
    if not args.runs:
        raise ValueError("RUN must name one run or more, got none")
    check_output("plot", args.plot, ".png")
    runs = read_runs(args.runs)
    print_curves(runs)
    print_ends(runs)
    if args.plot is not None:
        draw_curves(runs, args.plot)


def main() -> None:
    """Read the command line and show the curves."""
    run_command("curves", CurvesArgs, curves)


if __name__ == "__main__":
    main()
