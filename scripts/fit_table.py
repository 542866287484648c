"""Fit a table's physics to the track of a puck on it: python -m scripts.fit_table TRACK.csv"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from agents.conditions import read_table
from agents.files import write_json
from agents.fitting.estimates import check_scipy
from agents.fitting.fit import SIZES, fit_table
from agents.fitting.report import draw_fit, print_fit
from agents.fitting.simulated import simulate_throws
from agents.fitting.tracks import read_track, write_track
from agents.options import FIELD_FILE_HELP, JsonFile, PlotFile, check_output, check_ranges
from airhockey_env.tables import LEAST, PRESETS
from scripts._command import run_command

TRACK_HELP = (
    "A .csv file with the columns time (s, when the frame was taken), x (m, along the table) and y (m, across it) of "
    "the puck's centre, sorted by time. Leave out frames in which the puck was not seen."
)
TABLE_HELP = (
    f"Keep what the track does not tell from this table: {', '.join(PRESETS)}, or {FIELD_FILE_HELP} a TableSpec's "
    "fields."
)
LARGEST = 10.0
"""m, the largest size that can be given."""


@dataclass(frozen=True)
class FitTableArgs:
    """Fit the physics and the sizes of a table to the track of a puck that glides and bounces on it.

    The fields that the track tells are printed with their 95 % intervals. The others keep the values of another table.
    """

    track: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="TRACK.csv", help=TRACK_HELP)]
    table: Annotated[str, tyro.conf.arg(metavar="NAME|FILE", help=TABLE_HELP)] = "full_size"
    length: float | None = None
    """The length of the playing surface, m, if you know it."""
    width: float | None = None
    """The width of the playing surface, m, if you know it."""
    puck_radius: float | None = None
    """The radius of the puck, m, if you know it. A track tells the sizes of the table minus the puck's diameter."""
    goal_width: float | None = None
    """The distance between the posts of a goal, m, if you know it."""
    out: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """Write the table to this .json file, as the fields of a `TableSpec`."""
    json: JsonFile = None
    plot: PlotFile = None
    demo: float | None = None
    """Before the fit, simulate a puck that is thrown on --table for this many seconds, as the camera of a robot sees
    it, and write TRACK.csv. There must be no such file yet."""
    seed: int = 0
    """Draw the throws of --demo from this seed."""


def fit(args: FitTableArgs) -> None:
    """Read, fit, print, and write.

    Raises:
        ValueError, OSError: an argument or the file does not fit.
        DependencyNotInstalled: SciPy is missing.
    """
    check_scipy("fit_table needs")
    check_ranges(args, **dict.fromkeys(SIZES, (LEAST, LARGEST)), demo=(5, 300), seed=(0, 10**9))
    check_output("out", args.out, ".json")
    check_output("json", args.json)
    check_output("plot", args.plot, ".png")
    base = read_table(args.table)
    if args.demo is not None:
        write_demo(args)
    if not args.track.is_file():
        raise FileNotFoundError(f"TRACK.csv must be a file that exists, got {args.track}")
    known = {name: getattr(args, name) for name in SIZES if getattr(args, name) is not None}
    track = read_track(args.track)
    try:
        found = fit_table(track, base, known)
    except ValueError as error:
        raise ValueError(f"{args.track}: {error}") from error
    print_fit(found)
    if args.out is not None:
        write_json(args.out, dataclasses.asdict(found.spec))
    if args.json is not None:
        write_json(args.json, {"track": args.track, "kept_from": args.table, **found.as_dict()})
    if args.plot is not None:
        draw_fit(found, args.track.name, args.plot)


def write_demo(args: FitTableArgs) -> None:
    """Simulate a track on the table that was named.

    Raises:
        FileExistsError, FileNotFoundError: there is such a file already, or its folder does not exist.
    """
    assert args.demo is not None
    if args.track.exists():
        raise FileExistsError(f"--demo writes TRACK.csv, and {args.track} exists already: choose another name")
    if not args.track.parent.is_dir():
        raise FileNotFoundError(f"--demo must write TRACK.csv into a folder that exists, got {args.track}")
    write_track(args.track, simulate_throws(read_table(args.table), args.demo, args.seed))


def main() -> None:
    """Read the command line and fit."""
    run_command("fit_table", FitTableArgs, fit)


if __name__ == "__main__":
    main()
