"""Checks of command-line arguments."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

from airhockey_env.tables import PRESETS, TableSpec

MOST = 1e18
"""The greatest number that any option accepts."""


def check_ranges(args: Any, **ranges: tuple[float, float]) -> None:
    """Check numeric fields of a dataclass of arguments against their (least, greatest) values. None is accepted.

    Raises:
        ValueError: a field is out of range. The message names its option, what was given and what is allowed.
    """
    for name, (least, greatest) in ranges.items():
        value = getattr(args, name)
        if value is None:
            continue
        if not least <= value <= greatest or abs(value) > MOST:
            allowed = f"{least} or more" if math.isinf(greatest) else f"from {least} to {greatest}"
            raise ValueError(f"--{name.replace('_', '-')} must be {allowed}, got {value}")


def not_default(args: Any) -> list[str]:
    """Names of the fields of a dataclass of arguments that differ from their defaults."""
    return [field.name for field in dataclasses.fields(args) if getattr(args, field.name) != field.default]


def check_resumed(args: Any, kept: Any, given: Any = None) -> None:
    """Check that a run is resumed with its own arguments, because it would ignore others.

    Args:
        args: the arguments of the command. A field with its default value counts as not given.
        kept: the run's own arguments.
        given: if known, the run's own arguments overridden by those on the command line, which also detects arguments
            that were given with their default value.

    Raises:
        ValueError: an argument differs from the run's. The message names its option.
    """
    names = [field.name for field in dataclasses.fields(kept)] if given is not None else not_default(args)
    now = args if given is None else given
    others = [n for n in names if n not in ("resume", "steps") and getattr(now, n) != getattr(kept, n)]
    if others:
        options = " ".join(f"--{name.replace('_', '-')}" for name in others)
        raise ValueError(f"--resume goes on with the run's own arguments and --steps alone, got {options}")


def check_output(name: str, path: Path | None, suffix: str = "") -> None:
    """Check the path of an output file before a command starts its work. None is accepted.

    Raises:
        ValueError: the path does not end in `suffix`.
        FileNotFoundError: its folder does not exist.
    """
    if path is None:
        return
    if not path.name.endswith(suffix):
        raise ValueError(f"--{name} must end in {suffix}, got {path.name!r}")
    if not path.parent.is_dir():
        raise FileNotFoundError(f"--{name} must name a file in a folder that exists, got {path}")


def make_folder(name: str, path: Path) -> None:
    """Create an output folder, unless it exists, before a command starts its work.

    Raises:
        OSError: it cannot be created, for example because its parent does not exist or it is a file.
    """
    try:
        path.mkdir(exist_ok=True)
    except OSError as error:
        raise OSError(f"--{name} must be a folder, or a new one in a folder that exists, got {path}") from error


TABLE_HELP = f"The table: {', '.join(PRESETS)}."


def check_table(table: str) -> TableSpec:
    """Return the preset for `--table`.

    Raises:
        ValueError: there is no preset of that name.
    """
    if table not in PRESETS:
        raise ValueError(f"--table must be one of {sorted(PRESETS)}, got {table!r}")
    return PRESETS[table]
