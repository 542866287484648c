"""Files written so that a crash or a full disk never leaves half of one, and read so that errors say what they are."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np


def replace(path: str | Path, write: Callable[[Path], object]) -> None:
    """Let `write` make a file beside `path`, then put it in the place of `path` at once."""
    path = Path(path)
    part = path.with_name(f".part-{path.name}")
    try:
        write(part)
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def read_arrays(path: str | Path, writer: str, needed: Sequence[str]) -> dict[str, Any]:
    """The arrays of an .npz file that `writer` wrote.

    Args:
        needed: names that must be among them.

    Raises:
        OSError: the file cannot be opened.
        ValueError: it is of another kind, or damaged; the message says of the file what "it" is.
    """
    with Path(path).open("rb") as stream:
        if stream.read(2) != b"PK":  # all zip files begin so; what else NumPy can read is a single array or a pickle
            raise ValueError(f"it is not an .npz file as {writer} writes it")
        stream.seek(0)
        try:
            with np.load(stream, allow_pickle=False) as file:
                names = list(file.files)
                missing = [name for name in needed if name not in names]
                if not missing:
                    return {name: file[name] for name in names}
        except Exception as error:  # whatever damage makes of it
            raise ValueError(f"it is a damaged .npz file, or not one as {writer} writes it") from error
    found = ", ".join(map(repr, names[:4])) or "nothing"
    raise ValueError(f"it is a file of something else: {writer} writes {missing[0]!r}, and in it there is {found}")
