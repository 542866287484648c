"""Files of a run: none is ever left half written, and the errors of reading one name it."""

from __future__ import annotations

import dataclasses
import json
import math
import os
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from airhockey_env.files import parse_json, replace

MOST_BYTES = 64 * 2**20
"""The greatest size of a JSON file. A run's records of a hundred thousand updates take a third of it."""


Args = TypeVar("Args")


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
    """Write data as indented JSON. Paths become texts, and numbers that JSON does not have (NaN, infinity) null."""
    text = json.dumps(_plain(data), indent=2, allow_nan=False) + "\n"
    replace(path, lambda part: part.write_text(text, encoding="utf-8"))


def _plain(data: Any) -> Any:
    if isinstance(data, dict):
        return {name: _plain(value) for name, value in data.items()}
    if isinstance(data, (list, tuple)):
        return [_plain(value) for value in data]
    if isinstance(data, Path):
        return str(data)
    return None if isinstance(data, float) and not math.isfinite(data) else data


class Kind(NamedTuple):
    """What a value of a JSON file has to be."""

    text: str
    fits: Callable[[Any], bool]


def _number(value: Any) -> bool:
    return type(value) in (int, float) and abs(value) < 1e300  # what is not a number is not less either


COUNT = Kind("a whole number from 0 up", lambda value: type(value) is int and 0 <= value < 2**63)
POSITIVE = Kind("a whole number from 1 up", lambda value: type(value) is int and 1 <= value < 2**63)
NUMBER = Kind("a finite number", _number)
SHARE = Kind("a number from 0 to 1", lambda value: _number(value) and 0 <= value <= 1)
TEXT = Kind("a text", lambda value: isinstance(value, str))
FILE = Kind("a file's name", lambda value: isinstance(value, str) and Path(value).name == value != "")


def or_none(kind: Kind) -> Kind:
    """That or null."""
    return Kind(f"{kind.text} or null", lambda value: value is None or kind.fits(value))


def read_json(path: Path, pattern: Any = None) -> Any:
    """Read a JSON file.

    Args:
        pattern: what it has to hold: a `Kind`; a dict from names to patterns, for an object that has these and maybe
            others; a list of one pattern, for a list of any length; a tuple, for a list of that length. None: anything.

    Raises:
        OSError: the file cannot be read.
        ValueError: the file is not JSON, is too large, or does not hold that; the message names it.
    """
    size = path.stat().st_size
    if size > MOST_BYTES:
        raise ValueError(f"{path} has {size:,} bytes, and may have {MOST_BYTES:,}")
    try:
        data = parse_json(path.read_text(encoding="utf-8"))
    except ValueError as error:  # of the text or of its encoding
        raise ValueError(f"{path} is not a JSON file: {error}") from error
    if (wrong := mismatch(data, pattern)) is not None:
        raise ValueError(f"{path}: {wrong}")
    return data


def mismatch(data: Any, pattern: Any, where: str = "it") -> str | None:
    """What does not fit a pattern of `read_json`; None if all does."""
    if isinstance(pattern, Kind):
        return None if pattern.fits(data) else f"{where} must be {pattern.text}, got {_brief(data)}"
    if isinstance(pattern, dict):
        if not isinstance(data, dict):
            return f"{where} must be an object, got {_brief(data)}"
        missing = [name for name in pattern if name not in data]
        if missing:
            return f"{where} must have {missing[0]!r}, which is missing"
        parts = [(f"{where}.{name}", data[name], part) for name, part in pattern.items()]
    elif isinstance(pattern, (list, tuple)):
        if not isinstance(data, list) or (isinstance(pattern, tuple) and len(data) != len(pattern)):
            return f"{where} must be a list{f' of {len(pattern)}' * isinstance(pattern, tuple)}, got {_brief(data)}"
        patterns = pattern if isinstance(pattern, tuple) else pattern * len(data)
        parts = [(f"{where}[{k}]", value, patterns[k]) for k, value in enumerate(data)]
    else:
        return None
    return next((wrong for place, value, part in parts if (wrong := mismatch(value, part, place)) is not None), None)


def _brief(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 40 else f"{text[:37]}..."


def read_arguments(path: Path, arguments: type[Args], beside: Sequence[str] = ()) -> Args:
    """The arguments record that a run's config.json keeps. Its types are checked, not its ranges.

    Args:
        arguments: a dataclass whose fields are numbers, texts, paths, tuples of these, or objects of JSON; those that
            the file lacks have their defaults.
        beside: names of what else the file may hold.

    Raises:
        OSError: the file cannot be read.
        ValueError: it does not hold such arguments; the message names it.
    """
    kept = read_json(path, {})
    hints = typing.get_type_hints(arguments)
    fields = {field.name for field in dataclasses.fields(arguments)}  # type: ignore[arg-type]
    values = {}
    for name, value in kept.items():
        if name in beside:
            continue
        if name not in fields:
            raise ValueError(
                f"{path}: {name!r} is no option of this version; the version that began the run can resume it"
            )
        try:
            values[name] = _typed(value, hints[name])
        except TypeError as error:
            raise ValueError(f"{path}: {name} must be {error}, got {_brief(value)}") from error
    return arguments(**values)


def _typed(value: Any, hint: Any) -> Any:
    """A value of JSON as a field of this type; a TypeError says what it must be."""
    if isinstance(hint, types.UnionType) or typing.get_origin(hint) is typing.Union:
        for one in typing.get_args(hint):
            try:
                return _typed(value, one)
            except TypeError:
                continue
    elif typing.get_origin(hint) is tuple and isinstance(value, list):
        parts = typing.get_args(hint)
        return tuple(_typed(part, parts[0]) for part in value)
    elif typing.get_origin(hint) is dict and isinstance(value, dict):
        return value
    elif hint is Path and isinstance(value, str):
        return Path(value)
    elif hint is float and _number(value):
        return float(value)
    elif (
        (hint is int and type(value) is int and abs(value) < 2**63)
        or (hint is type(None) and value is None)
        or (hint in (str, bool) and type(value) is hint)
    ):
        return value
    raise TypeError(getattr(hint, "__name__", None) or str(hint))
