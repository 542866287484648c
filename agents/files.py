"""Files of a run, written so that a crash or a full disk never leaves half of one."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from airhockey_env.files import replace


def replace_together(writes: Mapping[Path, Callable[[Path], object]]) -> None:
    """Let each function make a file beside its path; when all are made, put them in the places of the paths."""
    parts = {path: path.with_name(f".part-{path.name}") for path in writes}
    try:
        for path, write in writes.items():
            write(parts[path])
            with open(parts[path], "rb+") as file:
                os.fsync(file.fileno())  # or a machine that loses power could keep the new name of an empty file
        for path, part in parts.items():
            os.replace(part, path)
    finally:
        for part in parts.values():
            part.unlink(missing_ok=True)


def write_json(path: Path, data: Any) -> None:
    """Write data as indented JSON. Numbers that JSON does not have (not a number, infinity) become null."""
    text = json.dumps(_finite(data), indent=2, allow_nan=False) + "\n"
    replace(path, lambda part: part.write_text(text))


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
        return json.loads(path.read_text())
    except ValueError as error:  # of the text or of its encoding
        raise ValueError(f"{path} is not a JSON file: {error}") from error
