"""Conditions of play: the table, and what stands between the evaluated or trained player and the table.

Commands read them from the options that they share (`agents.options`), a run keeps their contents in its config.json,
and every game of training and measuring is made with them.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, cast

import numpy as np

from agents.files import FIELD_FILES, read_fields
from agents.options import listed
from airhockey_env.cameras import CAMERAS, Camera, resolve_camera
from airhockey_env.checks import check_action_delay, fault
from airhockey_env.kernel.state import SEATS
from airhockey_env.tables import (
    FULL_SIZE,
    PRESETS,
    TABLE_RANGES,
    TableSpec,
    check_randomize,
    resolve_randomize,
    resolve_table,
)


class Options(Protocol):
    """Arguments of a command with the options `TableOption`, `RandomizeOption`, `CameraOption` and `DelayOption`."""

    @property
    def table(self) -> str: ...
    @property
    def randomize(self) -> str | None: ...
    @property
    def camera(self) -> str | None: ...
    @property
    def action_delay_ms(self) -> tuple[float, ...]: ...


@dataclass(frozen=True)
class Conditions:
    """The conditions under which a player plays.

    Raises:
        ValueError: a field is out of range, or some of the drawn tables could not exist. The message names the field.
    """

    table: TableSpec = FULL_SIZE
    """The table, or the one whose values the fields keep that are not drawn."""
    randomize: Mapping[str, Any] | None = None
    """Ranges of the table's fields, (low, high), to draw from for every episode."""
    camera: Camera | None = None
    """The player's camera; None: the player sees exact states."""
    action_delay_ms: float | tuple[float, float] = 0.0
    """ms from the player's choice until its paddle obeys, or the range to draw from for every episode."""

    def __post_init__(self) -> None:
        if self.randomize is not None:
            check_randomize(self.table, self.randomize)
        object.__setattr__(self, "action_delay_ms", check_action_delay("action_delay_ms", self.action_delay_ms))

    @classmethod
    def of_options(cls, args: Options) -> Conditions:
        """Read the options of a command, and the files that they name.

        Raises:
            OSError, ValueError: an option names neither a preset nor a file with the right contents. The message names
                the option and the file.
        """
        table = read_table(args.table)
        randomize, camera = None, None
        if args.randomize is not None:
            randomize = _read("randomize", args.randomize, TABLE_RANGES, lambda given: _ranges(table, given))
        if args.camera is not None:
            camera = _read("camera", args.camera, CAMERAS, resolve_camera)
        delay = args.action_delay_ms
        if len(delay) not in (1, 2):
            raise fault("--action-delay-ms", "one number, or two for a range", delay)
        try:
            return cls(table, randomize, camera, delay[0] if len(delay) == 1 else (delay[0], delay[1]))
        except ValueError as error:
            raise ValueError(str(error).replace("action_delay_ms", "--action-delay-ms")) from error

    @classmethod
    def of_dict(cls, kept: Mapping[str, Any]) -> Conditions:
        """The conditions that `as_dict` has described.

        Raises:
            ValueError: these are not conditions.
        """
        names = [field.name for field in dataclasses.fields(cls)]
        if sorted(kept) != sorted(names):
            raise fault("conditions", f"values of {', '.join(names)}", dict(kept))
        ranges, camera = kept["randomize"], kept["camera"]
        return cls(
            resolve_table(kept["table"]),
            {name: _pair(value) for name, value in ranges.items()} if isinstance(ranges, Mapping) else ranges,
            None if camera is None else resolve_camera(camera),
            kept["action_delay_ms"],
        )

    def as_dict(self) -> dict[str, Any]:
        """The contents, for a JSON file."""
        return {
            "table": dataclasses.asdict(self.table),
            "randomize": self.randomize,
            "camera": None if self.camera is None else self.camera.fields(),
            "action_delay_ms": self.action_delay_ms,
        }

    @classmethod
    def of_env_arguments(cls, arguments: Mapping[str, Any]) -> Conditions:
        """The conditions among the arguments of an environment.

        Raises:
            ValueError: they are not conditions.
        """
        camera = arguments.get("camera")
        return cls(
            resolve_table(arguments.get("table", FULL_SIZE)),
            resolve_randomize(arguments.get("randomize")),
            None if camera is None else resolve_camera(camera),
            arguments.get("action_delay_ms", 0.0),
        )

    def env_arguments(self) -> dict[str, Any]:
        """Arguments of an environment in which the player is the agent, without those that are the defaults."""
        fields = [field.name for field in dataclasses.fields(self)]
        return {name: getattr(self, name) for name in fields if getattr(self, name) != getattr(EXACT, name)}

    def game_arguments(self, *seats: int) -> dict[str, Any]:
        """Arguments of a `Game` in which these seats are played under the conditions, and others with exact states."""
        cameras = [self.camera if seat in seats else None for seat in SEATS]
        left, right = (self.action_delay_ms if seat in seats else 0.0 for seat in SEATS)
        return {
            "table": self.table,
            "randomize": self.randomize,
            "camera": cameras,
            "left_action_delay_ms": left,
            "right_action_delay_ms": right,
        }

    def drawn(self, seed: int | None = None) -> Conditions:
        """The same conditions on one table that is drawn from the ranges."""
        if self.randomize is None:
            return self
        low, high = check_randomize(self.table, self.randomize).T
        values = np.random.default_rng(seed).uniform(low, high)
        return dataclasses.replace(self, table=TableSpec(*values), randomize=None)


def read_table(given: str) -> TableSpec:
    """The table that `--table` names.

    Raises:
        OSError, ValueError: see `Conditions.of_options`.
    """
    return _read("table", given, PRESETS, resolve_table)


def in_words(args: Options) -> str:
    """The conditions as the options give them, for titles: "challenge table, camera robot"."""
    parts = [f"{Path(args.table).name} table"]
    parts += [f"randomize {Path(args.randomize).name}"] if args.randomize is not None else []
    parts += [f"camera {Path(args.camera).name}"] if args.camera is not None else []
    delay = " to ".join(f"{value:g}" for value in args.action_delay_ms)
    return ", ".join([*parts, f"action delay {delay} ms"] if any(args.action_delay_ms) else parts)


def _ranges(table: TableSpec, given: str | Mapping[str, Any]) -> Mapping[str, Any]:
    ranges = resolve_randomize(given)
    assert ranges is not None
    check_randomize(table, ranges)
    return {name: _pair(value) for name, value in ranges.items()}


def _pair(value: Any) -> Any:
    """A range from a file, which is a list there, as a tuple; anything else as it is."""
    return tuple(value) if isinstance(value, list) else value


def _read(name: str, given: str, presets: Mapping[str, Any], resolve: Any) -> Any:
    """What an option means that is the name of a preset or a file of fields."""
    if given in presets:
        return resolve(given)
    path = Path(given)
    if path.suffix not in FIELD_FILES:
        raise ValueError(f"--{name} must be {listed(presets)}, or a .json or .yml file, got {given!r}")
    if not path.is_file():
        raise FileNotFoundError(f"--{name} must name a file that exists, got {given!r}")
    try:
        return resolve(cast(Mapping[str, Any], read_fields(path)))
    except ValueError as error:
        raise ValueError(f"--{name}: {error}" if given in str(error) else f"--{name} {given}: {error}") from error


EXACT = Conditions()
"""The full-size table, exact states, and paddles that obey at once."""
