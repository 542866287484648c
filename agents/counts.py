"""Whole numbers on the command line, such as 20_000, 20k or 2e4."""

from __future__ import annotations

import re
from decimal import Decimal
from typing import Annotated, Any

import tyro

MOST = 10**18

_SCALES = {"": 1, "k": 10**3, "m": 10**6, "g": 10**9, "b": 10**9}
_COUNT = re.compile(r"([+-]?(?:\d+(?:_\d+)*)(?:\.\d*)?(?:e[+-]?\d{1,3})?)([kmgb]?)", re.IGNORECASE)


def read_count(text: str) -> int:
    """Parse a whole number that is written as 1000000, 1_000_000, 1e6, 1M or 1000k.

    Raises:
        ValueError: the text is not a number, or not a whole one.
    """
    found = _COUNT.fullmatch(text.strip())
    if found is None:
        raise ValueError(f"must be a whole number, such as 20_000, 20k, 2e4 or 1.5M, got {text!r}")
    number = Decimal(found[1].replace("_", "")) * _SCALES[found[2].lower()]
    if abs(number) > MOST:
        raise ValueError(f"must be at most {MOST:_}, got {text!r}")
    if number != number.to_integral_value():
        raise ValueError(f"must be a whole number, got {text!r}")
    return int(number)


_SPEC: Any = tyro.constructors.PrimitiveConstructorSpec(
    nargs=1,
    metavar="INT|1e6",
    instance_from_str=lambda words: read_count(words[0]),
    is_instance=lambda value: value is None or type(value) is int,
    str_from_instance=lambda value: ["None" if value is None else f"{value:_}"],
)

Count = Annotated[int, _SPEC]
"""A whole number on a command line."""

OptionalCount = Annotated[int | None, _SPEC]
"""A whole number on a command line, or None if none is given."""
