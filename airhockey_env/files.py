"""Atomic writing of files, and safe reading of JSON and .npz files that may come from strangers.

A crash or a full disk never leaves a partly written file. Reading never runs code from a file and checks sizes before
it unpacks anything.
"""

from __future__ import annotations

import json
import math
import os
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from numpy.lib import format as npy

_READERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}
"""Functions that read the header of an array, by format version; 2.0 is for structured arrays with many fields."""

MOST_VALUES = 10**6
"""Most values that a JSON file may have."""


def replace(path: str | Path, write: Callable[[Path], object]) -> None:
    """Write `path` atomically: let `write` create a temporary file beside it, then rename that to `path`."""
    path = Path(path)
    part = path.with_name(f".part-{path.name}")
    try:
        write(part)
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def check_archive(archive: zipfile.ZipFile, most: int) -> None:
    """Check the directory of a zip file before any of its members is unpacked.

    Args:
        archive: the open file.
        most: greatest total size of the unpacked members, bytes.

    Raises:
        ValueError: the members are larger, or two have the same name.
    """
    members = archive.infolist()
    if len({member.filename for member in members}) < len(members):
        raise ValueError("it has two members of the same name")
    size = sum(member.file_size for member in members)
    if size > most:
        raise ValueError(f"it would unpack to {size:,} bytes, and at most {most:,} are allowed")


def parse_json(text: str, constants: bool = False) -> Any:
    """Parse JSON text.

    Args:
        constants: accept NaN and Infinity, which Python writes although JSON does not have them.

    Raises:
        ValueError: the text is not JSON, repeats a name within an object, is nested too deeply, or has more than
            `MOST_VALUES` values (each of which takes far more memory than its text).
    """
    values = sum(map(text.count, ",[{"))
    if values > MOST_VALUES:
        raise ValueError(f"it has about {values:,} values, and at most {MOST_VALUES:,} are allowed")
    try:
        return json.loads(text, object_pairs_hook=_once, parse_constant=None if constants else _refuse)
    except RecursionError as error:
        raise ValueError("it is nested too deeply") from error


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    result = dict(pairs)
    if len(result) < len(pairs):
        raise ValueError("an object in it has the same name twice")
    return result


def _refuse(name: str) -> float:
    raise ValueError(f"JSON has no {name}")


def read_arrays(path: str | Path, writer: str, needed: Sequence[str], most: int) -> dict[str, Any]:
    """Read the arrays of an .npz file.

    Args:
        path: the file.
        writer: name of the function that writes such files, for error messages.
        needed: names of arrays that the file must contain.
        most: greatest total size of the arrays, bytes.

    Returns:
        The arrays by name.

    Raises:
        OSError: the file cannot be opened.
        ValueError: it is another kind of file, too large or damaged. The message calls the file "it", so that callers
            can put its name in front.
    """
    with Path(path).open("rb") as stream:
        if stream.read(2) != b"PK":  # all zip files begin so; what else NumPy can read is a single array or a pickle
            raise ValueError(f"it is not an .npz file as {writer} writes it")
        stream.seek(0)
        try:
            with zipfile.ZipFile(stream) as archive:
                names = [name.removesuffix(".npy") for name in archive.namelist()]
                missing = [name for name in needed if name not in names]
                if not missing:
                    check_archive(archive, most)
                    for member in archive.infolist():
                        _check_array(archive, member)
                    return {name: _read_array(archive, f"{name}.npy") for name in names}
        except Exception as error:  # a damaged file may raise anything
            reason = f": {error}" if isinstance(error, ValueError) else ""
            raise ValueError(f"it is a damaged .npz file, or not one as {writer} writes it{reason}") from error
    found = ", ".join(map(repr, names[:4])) or "nothing"
    raise ValueError(f"it is a file of something else: {writer} writes {missing[0]!r}, and in it there is {found}")


def _check_array(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> None:
    """Raise ValueError unless a member is as long as its header says. Arrays of objects (pickles) are refused."""
    with archive.open(member) as file:
        reader = _READERS.get(npy.read_magic(file))
        if reader is None:
            raise ValueError(f"{member.filename!r} is an array of an unknown version of the format")
        shape, _, dtype = reader(file)
        if dtype.hasobject:
            raise ValueError(f"{member.filename!r} holds Python objects instead of numbers")
        if any(type(side) is not int or side < 0 for side in shape):
            raise ValueError(f"{member.filename!r} has the impossible shape {shape}")
        if math.prod(shape) * dtype.itemsize != member.file_size - file.tell():
            raise ValueError(f"{member.filename!r} is not as long as an array of shape {shape} and type {dtype}")


def _read_array(archive: zipfile.ZipFile, name: str) -> Any:
    with archive.open(name) as file:
        return npy.read_array(file, allow_pickle=False)
