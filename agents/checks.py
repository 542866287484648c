"""Checks of what a command line gave."""

from __future__ import annotations

import math
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
