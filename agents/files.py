"""Files of runs and of settings: atomic writing, and reading with checks whose errors name the file."""

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

from gymnasium.error import DependencyNotInstalled

from airhockey_env.files import parse_json, replace

MOST_BYTES = 64 * 2**20
"""Greatest size of a JSON file. The records of a run with a hundred thousand updates take a third of it."""


Args = TypeVar("Args")


def replace_together(writes: Mapping[Path, Callable[[Path], object]]) -> None:
    """Let each function write a temporary file beside its path; once all are written, rename them to the paths."""
    parts = {path: path.with_name(f".part-{path.name}") for path in writes}
    try:
        for path, write in writes.items():
            write(parts[path])
            with open(parts[path], "rb+") as file:
                os.fsync(file.fileno())  # otherwise a power failure could leave an empty file under the new name
        for path, part in parts.items():
            os.replace(part, path)
    finally:
        for part in parts.values():
            part.unlink(missing_ok=True)


def write_json(path: Path, data: Any) -> None:
    """Write data as indented JSON. Numbers that JSON does not have (NaN, infinity) become null, and paths text."""
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
    """A condition on a value in a JSON file, and its description for error messages."""

    text: str
    fits: Callable[[Any], bool]


def _number(value: Any) -> bool:
    return type(value) in (int, float) and abs(value) < 1e300  # False for NaN too


COUNT = Kind("a whole number from 0 up", lambda value: type(value) is int and 0 <= value < 2**63)
POSITIVE = Kind("a whole number from 1 up", lambda value: type(value) is int and 1 <= value < 2**63)
NUMBER = Kind("a finite number", _number)
SHARE = Kind("a number from 0 to 1", lambda value: _number(value) and 0 <= value <= 1)
TEXT = Kind("a text", lambda value: isinstance(value, str))
FILE = Kind("a file's name", lambda value: isinstance(value, str) and Path(value).name == value != "")


def or_none(kind: Kind) -> Kind:
    """The same kind, or null."""
    return Kind(f"{kind.text} or null", lambda value: value is None or kind.fits(value))


def read_json(path: Path, pattern: Any = None, most: int | None = None) -> Any:
    """Read a JSON file.

    Args:
        path: the file.
        pattern: what the file must contain: a `Kind`; a dict from names to patterns, for an object with at least these
            names; a list of one pattern, for a list of any length; a tuple of patterns, for a list of that length.
            None accepts anything.
        most: greatest size of the file, bytes; `MOST_BYTES` by default.

    Raises:
        OSError: the file cannot be read.
        ValueError: the file is not JSON, is too large, or does not match the pattern. The message names the file.
    """
    size, most = path.stat().st_size, MOST_BYTES if most is None else most
    if size > most:
        raise ValueError(f"{path} has {size:,} bytes, and at most {most:,} are allowed")
    try:
        data = parse_json(path.read_text(encoding="utf-8"))
    except ValueError as error:  # of the text or of its encoding
        raise ValueError(f"{path} is not a JSON file: {error}") from error
    if (wrong := mismatch(data, pattern)) is not None:
        raise ValueError(f"{path}: {wrong}")
    return data


MOST_YAML_BYTES, MOST_YAML_VALUES = 2**20, 10_000
"""Greatest size of a YAML file, and most values in it. Its aliases could otherwise make a short file huge."""


def read_yaml(path: Path) -> Any:
    """Read a YAML file of plain values.

    Raises:
        OSError: the file cannot be read.
        ValueError: the file is not YAML, is too large, or contains itself. The message names the file.
        gymnasium.error.DependencyNotInstalled: PyYAML is missing.
    """
    try:
        import yaml
    except ImportError as error:
        raise DependencyNotInstalled(f'{path} needs PyYAML: pip install -e ".[train]"') from error
    try:
        if path.stat().st_size > MOST_YAML_BYTES:
            raise ValueError(f"it has more than {MOST_YAML_BYTES:,} bytes")
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
        _check_values(data)
    except (yaml.YAMLError, UnicodeDecodeError, ValueError, TypeError, RecursionError) as error:
        raise ValueError(f"{path} is not a YAML file: {error}") from error
    return data


def _check_values(data: Any) -> None:
    """Raise ValueError if YAML's aliases, `*name`, make data huge or let them contain themselves."""
    parts: list[Any] = [data]
    for _ in range(MOST_YAML_VALUES):
        if not parts:
            return
        part = parts.pop()
        parts += part.values() if isinstance(part, dict) else part if isinstance(part, list) else ()
    raise ValueError(f"it must have fewer than {MOST_YAML_VALUES:,} values")


FIELD_FILES = (".json", ".yml", ".yaml")
"""The suffixes of the files that `read_fields` reads."""


def read_fields(path: Path) -> dict[str, Any]:
    """Read a JSON or YAML file, by its suffix, that has values by name.

    Raises:
        OSError: the file cannot be read.
        ValueError: the file is damaged, too large, or has anything else. The message names the file.
        gymnasium.error.DependencyNotInstalled: the file is YAML and PyYAML is missing.
    """
    data = read_json(path, most=MOST_YAML_BYTES) if path.suffix == ".json" else read_yaml(path)
    if not isinstance(data, dict) or not all(isinstance(name, str) for name in data):
        raise ValueError(f"{path} must have values by name, got {_brief(data)}")
    return data


def mismatch(data: Any, pattern: Any, where: str = "it") -> str | None:
    """Describe the first value that does not match a pattern of `read_json`; None if everything matches."""
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
    """Read the arguments in the config.json of a run. This checks their types, not their ranges.

    Args:
        path: the file.
        arguments: a dataclass whose fields are numbers, texts, paths, tuples of these, or dictionaries. Fields that are
            missing in the file get their defaults.
        beside: names that the file may contain in addition.

    Raises:
        OSError: the file cannot be read.
        ValueError: the file does not contain such arguments. The message names the file.
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
                f"{path}: {name!r} is no option of this version; resume the run with the version that began it"
            )
        try:
            values[name] = _typed(value, hints[name])
        except TypeError as error:
            raise ValueError(f"{path}: {name} must be {error}, got {_brief(value)}") from error
    return arguments(**values)


def _typed(value: Any, hint: Any) -> Any:
    """Convert a JSON value to a field of this type; raise a TypeError that says what it must be."""
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
