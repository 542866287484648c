"""Checks of what a command line gave."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

from airhockey_env.tables import PRESETS, TableSpec

MOST = 1e18
"""The greatest number that any option takes."""


def check_ranges(args: Any, **ranges: tuple[float, float]) -> None:
    """Check number fields (None passes) of an arguments record against their (least, greatest) values.

    Raises:
        ValueError: one is out of range; the message names its option, what was given and what is allowed.
    """
    for name, (least, greatest) in ranges.items():
        value = getattr(args, name)
        if value is None:
            continue
        if not least <= value <= greatest or abs(value) > MOST:
            allowed = f"{least} or more" if math.isinf(greatest) else f"from {least} to {greatest}"
            raise ValueError(f"--{name.replace('_', '-')} must be {allowed}, got {value}")


def not_default(args: Any) -> list[str]:
    """Names of the fields of an arguments record that have another value than their default."""
    return [field.name for field in dataclasses.fields(args) if getattr(args, field.name) != field.default]


def check_resumed(given: Any, kept: Any) -> None:
    """Check that a run is resumed with its own arguments: it would not heed others.

    Args:
        given: the run's own arguments, with those of the command line in their places.
        kept: the run's own.

    Raises:
        ValueError: an argument is another than the run's; the message names its option.
    """
    names = [field.name for field in dataclasses.fields(kept)]
    others = [n for n in names if n not in ("resume", "steps") and getattr(given, n) != getattr(kept, n)]
    if others:
        options = " ".join(f"--{name.replace('_', '-')}" for name in others)
        raise ValueError(f"--resume goes on with the run's own arguments and --steps alone, got {options}")


def check_output(name: str, path: Path | None, suffix: str = "") -> None:
    """Check the path (None passes) of a file that a command will write, before it works for that.

    Raises:
        ValueError: it does not end in `suffix`.
        FileNotFoundError: its folder does not exist.
    """
    if path is None:
        return
    if not path.name.endswith(suffix):
        raise ValueError(f"--{name} must end in {suffix}, got {path.name!r}")
    if not path.parent.is_dir():
        raise FileNotFoundError(f"--{name} must name a file in a folder that exists, got {path}")


def make_folder(name: str, path: Path) -> None:
    """Make the folder that a command will write into, unless it is there, before the command works for that.

    Raises:
        OSError: it cannot be made: there is a file in its place, or the folder above it does not exist, say.
    """
    try:
        path.mkdir(exist_ok=True)
    except OSError as error:
        raise OSError(f"--{name} must be a folder, or a new one in a folder that exists, got {path}") from error


TABLE_HELP = f"The table: {', '.join(PRESETS)}."


def check_table(table: str) -> TableSpec:
    """The preset that `--table` names.

    Raises:
        ValueError: there is none of that name.
    """
    if table not in PRESETS:
        raise ValueError(f"--table must be one of {sorted(PRESETS)}, got {table!r}")
    return PRESETS[table]
