"""What counts as a number where callers give one, and how an error shows it."""

from __future__ import annotations

import math
from numbers import Real
from typing import Any

import numpy as np


def as_float(value: Any) -> float | None:
    """One real number as a float, or None if it is none, or is finite and too great for a float.

    Infinities and NaN are floats. Booleans, strings, complex numbers, durations and arrays are no numbers here.
    """
    if not isinstance(value, Real) or isinstance(value, (bool, np.bool_, np.timedelta64)):
        return None
    try:
        number = float(value)
    except (OverflowError, TypeError, ValueError):
        return None
    return None if math.isinf(number) and value != number else number


def shown(value: object) -> str:
    """As Python writes it, without NumPy's names of its types; also what has too many digits to be written."""
    try:
        return repr(value.item() if isinstance(value, np.generic) else value)
    except Exception:  # a whole number of more than 4300 digits, or somebody's own __repr__
        return f"a {type(value).__name__} that cannot be shown"
