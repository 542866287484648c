"""Files of a run, written so that a crash or a full disk never leaves half of one."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from airhockey_env.files import replace


def write_json(path: Path, data: Any) -> None:
    """Write data as indented JSON. Numbers that JSON does not have (not a number, infinity) become null."""
    text = json.dumps(_finite(data), indent=2, allow_nan=False) + "\n"
    replace(path, lambda part: part.write_text(text, encoding="utf-8"))


def _finite(data: Any) -> Any:
    if isinstance(data, dict):
        return {name: _finite(value) for name, value in data.items()}
    if isinstance(data, (list, tuple)):
        return [_finite(value) for value in data]
    return None if isinstance(data, float) and not math.isfinite(data) else data


def read_json(path: Path) -> Any:
    """Read a JSON file.

    Raises:
        ValueError: the file is not JSON; the message names it.
    """
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:  # of the text or of its encoding
        raise ValueError(f"{path} is not a JSON file: {error}") from error
