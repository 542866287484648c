"""Files that reproduce what the torture chamber found.

A case is a face of the game, its arguments, and the operations that were done to it one after the other, with every
action that was played: so it does not depend on how the chamber draws its trials. It is JSON, with tables and states by
the names of their fields: so it can be read, and still be played when the layout of a state or the dynamics have
changed since, as they will have with the repair. (A replay, see `airhockey_env.replay`, is refused then.)
"""

from __future__ import annotations

import dataclasses
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import airhockey_env
from agents.files import COUNT, TEXT, mismatch
from airhockey_env.files import replace
from airhockey_env.tables import TableSpec

FORMAT = 1
"""The version of the files' format."""

_PATTERN = {
    "format": COUNT,
    "version": TEXT,
    "face": TEXT,
    "arguments": {},
    "operations": [{"do": TEXT}],
    "weird": [TEXT],
}


@dataclass(frozen=True)
class Case:
    """What was done to a face of the game, ready for JSON."""

    face: str
    arguments: dict[str, Any]
    operations: list[dict[str, Any]]
    law: str = ""
    """What was found."""
    weird: tuple[str, ...] = ()
    """Names of arguments that may be refused."""

    def save(self, path: Path) -> None:
        """Write a file; one that is there already is replaced at once or not at all."""
        notes = {"format": FORMAT, "version": airhockey_env.__version__, **dataclasses.asdict(self)}
        replace(path, lambda part: part.write_text(json.dumps(notes, indent=1) + "\n", encoding="utf-8"))

    @classmethod
    def load(cls, path: Path) -> Case:
        """Read a file that `save` wrote.

        Raises:
            OSError: there is no such file.
            ValueError: the file does not hold a case; the message names it.
        """
        try:
            notes = json.loads(path.read_text(encoding="utf-8"))  # with infinities, which are among what was tried
            if (wrong := mismatch(notes, _PATTERN)) is not None:
                raise ValueError(wrong)
            if notes.pop("format") != FORMAT:
                raise ValueError(f"it is not of format {FORMAT}")
            notes.pop("version")
            return cls(**{**notes, "weird": tuple(notes["weird"])})
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
            raise ValueError(f"{path} does not hold a case of the torture chamber: {error}") from error

    def through_json(self) -> Case:
        """What a file of this case would hold."""
        return Case(**{**json.loads(json.dumps(dataclasses.asdict(self))), "weird": self.weird})


def encoded(table: Any) -> Any:
    """A `table` argument, ready for JSON."""
    return dataclasses.asdict(table) if isinstance(table, TableSpec) else table


def decoded(table: Any) -> Any:
    """The `table` argument that `encoded` was given; whatever else it is stays."""
    is_spec = isinstance(table, dict) and table.keys() == {field.name for field in dataclasses.fields(TableSpec)}
    return TableSpec(**table) if is_spec else table


def encode_state(state: NDArray[np.void]) -> dict[str, Any]:
    """A state of n tables by the names of its fields, ready for JSON."""
    return {
        name: encode_state(state[name]) if state.dtype[name].names else state[name].tolist()
        for name in state.dtype.names or ()
    }


def decode_state(fields: dict[str, Any], like: NDArray[np.void]) -> NDArray[np.void]:
    """The state that `encode_state` was given, in the layout of `like`, whose values stand for those it lacks."""
    state = like.copy()
    for name in state.dtype.names or ():
        if name in fields:
            nested = bool(state.dtype[name].names)
            state[name] = decode_state(fields[name], state[name]) if nested else fields[name]
    return state
