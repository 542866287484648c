"""Tracks: the times and places at which a camera saw the puck, as .csv files."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agents.files import MOST_BYTES
from airhockey_env.files import replace

COLUMNS = ("time", "x", "y")
FEWEST_ROWS, MOST_ROWS = 20, 100_000
"""Limits of a file. The most is a quarter of an hour at 120 Hz: a fit's memory grows with the square of the bounces."""
FARTHEST = 10.0
"""m from the origin. No table is as large, so numbers beyond it are in another unit."""


class Track(NamedTuple):
    """What a camera saw of one puck; frames in which it was not seen are left out."""

    time: NDArray[np.float64]
    """(N,) s, when each frame was taken; increasing."""
    x: NDArray[np.float64]
    """(N,) m along the table."""
    y: NDArray[np.float64]
    """(N,) m across the table."""


def read_track(path: Path) -> Track:
    """Read a track from a .csv file with the columns time, x and y, among others.

    Raises:
        OSError: the file cannot be read.
        ValueError: the file is too large, lacks a column, has fewer than `FEWEST_ROWS` or more than `MOST_ROWS` rows,
            has a cell that is not a finite number of the right size, or is not sorted by time. The message names the
            file and the line.
    """
    size = path.stat().st_size
    if size > MOST_BYTES:
        raise ValueError(f"{path} has {size:,} bytes, and at most {MOST_BYTES:,} are allowed")
    rows: list[tuple[float, ...]] = []
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            lines = csv.reader(file)
            head = [name.strip().lower() for name in next(lines, [])]
            for name in COLUMNS:
                if head.count(name) != 1:
                    hint = "; its columns must be separated by commas" if len(head) == 1 and ";" in head[0] else ""
                    raise ValueError(f"{path} must have one column {name!r} in its first line, got {head}{hint}")
            places = [head.index(name) for name in COLUMNS]
            for cells in lines:
                if cells:
                    row = tuple(
                        _number(path, lines.line_num, name, cells[place] if place < len(cells) else "")
                        for name, place in zip(COLUMNS, places, strict=True)
                    )
                    if rows and not row[0] > rows[-1][0]:
                        raise ValueError(
                            f"{path}, line {lines.line_num}: time must be greater than the {rows[-1][0]} s of the row "
                            f"before, got {row[0]}"
                        )
                    rows.append(row)
    except (UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"{path} is not a .csv file: {error}") from error
    if not FEWEST_ROWS <= len(rows) <= MOST_ROWS:
        raise ValueError(f"{path} must have from {FEWEST_ROWS} to {MOST_ROWS} rows, got {len(rows)}")
    return Track(*np.array(rows).T.copy())


def _number(path: Path, line: int, name: str, cell: str) -> float:
    try:
        number = float(cell)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(
            f"{path}, line {line}: {name} must be a finite number, got {cell!r}; leave out the rows in which the puck "
            "was not seen"
        )
    if name != "time" and abs(number) > FARTHEST:
        raise ValueError(f"{path}, line {line}: {name} must be from {-FARTHEST} to {FARTHEST} m, got {cell}")
    return number


def write_track(path: Path, track: Track) -> None:
    """Write a track as a .csv file, with times to 1 microsecond and places to 1 micrometre. The write is atomic."""
    lines = [",".join(COLUMNS), *(f"{t:.6f},{x:.6f},{y:.6f}" for t, x, y in zip(*track, strict=True))]
    replace(path, lambda part: part.write_text("\n".join(lines) + "\n", encoding="utf-8"))
