"""Options of the commands: those that several of them have, numbers as people type them, and checks of what was given.

`Annotated` types are options with their help texts, for `tyro.cli`.
"""

from __future__ import annotations

import dataclasses
import re
import shlex
from collections.abc import Iterable
from decimal import Decimal
from pathlib import Path
from typing import Annotated, Any

import tyro

from agents.models import PLAYERS
from airhockey_env.cameras import CAMERAS
from airhockey_env.checks import check_number
from airhockey_env.tables import PRESETS, TABLE_RANGES

MOST = 10**18
"""The largest number that any option takes."""


def option_name(field: str) -> str:
    """The option that sets a field of an arguments record."""
    return f"--{field.replace('_', '-')}"


def command_with(command: str, args: Any, fields: Iterable[str]) -> str:
    """The command line of a script with the options that set these fields to what they are in an arguments record."""
    words = ["python", "-m", f"scripts.{command}"]
    for field in fields:
        value = getattr(args, field)
        if isinstance(value, bool):
            words.append(option_name(field if value else f"no_{field}"))
        else:
            words += [option_name(field), *map(str, value if isinstance(value, tuple) else (value,))]
    return shlex.join(words)


def listed(names: Iterable[str], last: str = "or") -> str:
    """Names in a sentence: "a, b or c"."""
    *others, final = names
    return f"{', '.join(others)} {last} {final}" if others else final


# Options that several commands have ----------------------------------------------------------------------------------

PLAYER_HELP = (
    f"A player is one of {PLAYERS}. A function takes float32 observations (N, 13) and returns actions (N, 2); its "
    "module is imported from the current folder."
)
"""The sentence that explains which players a command takes."""

FIELD_FILE_HELP = "a .json or .yml file of"

TableOption = Annotated[
    str,
    tyro.conf.arg(
        metavar="NAME|FILE",
        help=f"Play on this table: {', '.join(PRESETS)}, or {FIELD_FILE_HELP} a TableSpec's fields.",
    ),
]
"""The table; see `agents.conditions` for this option and the next three."""

RandomizeOption = Annotated[
    str | None,
    tyro.conf.arg(
        metavar="NAME|FILE",
        help=f"Draw a table for every episode: {', '.join(TABLE_RANGES)}, or {FIELD_FILE_HELP} a TableSpec's fields "
        "with [low, high] each.",
    ),
]

CameraOption = Annotated[
    str | None,
    tyro.conf.arg(
        metavar="NAME|FILE",
        help=f"Let the player see the game through this camera: {', '.join(CAMERAS)}, or {FIELD_FILE_HELP} a Camera's "
        "fields, each a number or a range [low, high] to draw from for every episode.",
    ),
]

DelayOption = Annotated[
    tuple[float, ...],
    tyro.conf.arg(
        metavar="MS [MS]",
        help="Let the player's paddle obey this many milliseconds late. Two numbers are a range to draw from for every "
        "episode.",
    ),
]

Trust = Annotated[
    bool,
    tyro.conf.arg(
        help="Load a model.zip even if objects in it have to be unpickled. Unpickling can run any code, so use "
        "this only with files from people you trust."
    ),
]
"""Whether `load_player` may unpickle."""

Workers = Annotated[
    int | None,
    tyro.conf.arg(
        metavar="N",
        help="Work in this many processes at once. Ray starts them, on this machine or on the cluster of --address. By "
        "default, everything happens in one process, without Ray. See docs/cluster.md.",
    ),
]
"""The number of worker processes; see `agents.cluster`."""

Address = Annotated[
    str | None,
    tyro.conf.arg(
        metavar="auto|HOST:PORT",
        help="Use the Ray cluster at this address; auto is the one that this machine belongs to. By default, Ray is "
        "started on this machine for this command alone.",
    ),
]

JsonFile = Annotated[Path | None, tyro.conf.arg(metavar="FILE", help="Also write the results to this file, as JSON.")]
"""Where to write results, see `check_output`."""

PlotFile = Annotated[Path | None, tyro.conf.arg(metavar="FILE", help="Also draw the results into this .png file.")]
"""Where to draw results, see `check_output`."""


# Numbers -------------------------------------------------------------------------------------------------------------

_SCALES = {"": 1, "k": 10**3, "m": 10**6, "g": 10**9, "b": 10**9}
_COUNT = re.compile(r"([+-]?(?:\d+(?:_\d+)*)(?:\.\d*)?(?:e[+-]?\d{1,3})?)([kmgb]?)", re.IGNORECASE)


def read_count(text: str) -> int:
    """The whole number that is written as 1000000, 1_000_000, 1e6, 1M or 1000k.

    Raises:
        ValueError: it is not a number, or not a whole one.
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
"""A whole number on a command line, or None where none is given."""


# Checks --------------------------------------------------------------------------------------------------------------


def check_ranges(args: Any, **ranges: tuple[float, float]) -> None:
    """Check number fields (None passes) of an arguments record against their (smallest, largest) values.

    Raises:
        ValueError: a field is out of range. The message names its option, what was given and what is allowed.
    """
    for field, (least, greatest) in ranges.items():
        if getattr(args, field) is not None:
            check_number(option_name(field), getattr(args, field), least, min(greatest, float(MOST)))


def check_cluster(args: Any) -> None:
    """Check --workers and --address of an arguments record.

    Raises:
        ValueError: the number of workers is out of range, or there is an address without one.
    """
    check_ranges(args, workers=(1, 10_000))
    if args.address is not None and args.workers is None:
        raise ValueError(f"--address goes with --workers, got --address {args.address} alone")


def not_default(args: Any) -> list[str]:
    """Names of the fields of a dataclass of arguments that differ from their defaults."""
    return [field.name for field in dataclasses.fields(args) if getattr(args, field.name) != field.default]


SESSION = ("resume", "steps", "device", "workers", "address")
"""The arguments that can be given when a run is resumed."""


def check_resumed(given: Any, kept: Any) -> None:
    """Check that a run is resumed with its own arguments, because it would ignore others.

    Args:
        given: the run's own arguments, overridden by those that the caller or the command line gave.
        kept: the run's own arguments.

    Raises:
        ValueError: an argument differs from the run's. The message names its option.
    """
    names = [field.name for field in dataclasses.fields(kept)]
    others = [n for n in names if n not in SESSION and getattr(given, n) != getattr(kept, n)]
    if others:
        options = " ".join(map(option_name, others))
        allowed = listed([option_name(name) for name in SESSION if name != "resume" and name in names], "and")
        raise ValueError(f"--resume goes on with the run's own arguments and {allowed} alone, got {options}")


def check_device(name: str) -> None:
    """Check that PyTorch can train on a device of this name.

    Raises:
        ValueError: it cannot.
    """
    import torch

    try:
        torch.zeros(1, device=name)
    except (RuntimeError, AssertionError, NotImplementedError) as error:  # depends on how PyTorch was built
        reason = str(error).splitlines()[0]
        raise ValueError(
            f'--device must be "cpu", or another device that PyTorch can use, got {name!r}: {reason}'
        ) from None


def check_output(name: str, path: Path | None, suffix: str = "") -> None:
    """Check the path (None passes) of a file that a command will write, before it starts its work.

    Raises:
        ValueError: the path does not end in `suffix`.
        FileNotFoundError: its folder does not exist.
    """
    if path is None:
        return
    if not path.name.endswith(suffix):
        raise ValueError(f"--{name} must end in {suffix}, got {path.name!r}")
    if not path.parent.is_dir():
        raise FileNotFoundError(f"--{name} must name a file in a folder that exists, got {path}")


def make_folder(name: str, path: Path) -> None:
    """Make the folder that a command will write into, unless it is there, before it starts its work.

    Raises:
        OSError: it cannot be created, for example because its parent does not exist or it is a file.
    """
    try:
        path.mkdir(exist_ok=True)
    except OSError as error:
        raise OSError(f"--{name} must be a folder, or a new one in a folder that exists, got {path}") from error
