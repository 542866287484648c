"""Checks of what a command line gave."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any


def check_ranges(args: Any, **ranges: tuple[float, float]) -> None:
    """Check number fields (None passes) of an arguments record against their (least, greatest) values.

    Raises:
        ValueError: one is out of range; the message names its option, what was given and what is allowed.
    """
    for name, (least, greatest) in ranges.items():
        value = getattr(args, name)
        if value is None:
            continue
        if not least <= value <= greatest or math.isinf(value):
            allowed = f"{least} or more" if math.isinf(greatest) else f"from {least} to {greatest}"
            raise ValueError(f"--{name.replace('_', '-')} must be {allowed}, got {value}")


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
