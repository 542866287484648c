"""The file that holds a replay."""

from __future__ import annotations

import io
import json
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airhockey_env.actions import DIRECTIONS
from airhockey_env.checks import check_number
from airhockey_env.files import parse_json, read_arrays, replace
from airhockey_env.game import CONTROL_RATES

FORMAT = 2
"""The version of the files' format."""

MOST_BYTES = 256 * 2**20
"""The greatest size of an unpacked file: a week of play at 50 Hz."""

_NOTES = ("version", "fingerprint", "id", "arguments", "seeds")
_ARRAYS = ("starts", "states", "ends", "actions", "right_actions")


@dataclass(frozen=True)
class Replay:
    """What a file holds; see the package's description for the arrays."""

    version: str
    fingerprint: str
    id: str | None
    arguments: dict[str, Any]
    seeds: tuple[int | None, ...]
    starts: NDArray[np.int64]
    states: NDArray[np.void]
    ends: NDArray[np.void]
    actions: NDArray[Any]
    right_actions: NDArray[np.float32]
    name: str = "the replay"
    """What errors call it."""

    def __len__(self) -> int:
        """Number of actions."""
        return len(self.actions)

    @property
    def control_hz(self) -> float:
        """Actions a second."""
        return float(self.arguments["control_hz"])

    @property
    def seconds(self) -> float:
        """Seconds of play."""
        return len(self) / self.control_hz

    def save(self, path: str | Path) -> None:
        """Write an .npz file; a file that is there already is replaced at once or not at all."""
        notes = {"format": FORMAT, **{name: getattr(self, name) for name in _NOTES}}
        buffer = io.BytesIO()
        arrays: dict[str, Any] = {name: getattr(self, name) for name in _ARRAYS}
        np.savez_compressed(buffer, replay=np.array(json.dumps(notes)), **arrays)
        replace(path, lambda part: part.write_bytes(buffer.getvalue()))

    @classmethod
    def load(cls, path: str | Path) -> Replay:
        """Read a file that `save` wrote. Whether its dynamics are this version's is for `play_back` to say.

        Raises:
            FileNotFoundError: there is no such file.
            ValueError: the file does not hold a replay; the message names it.
        """
        try:
            arrays = read_arrays(path, "RecordReplay", ("replay", *_ARRAYS), MOST_BYTES)
            notes = parse_json(str(arrays["replay"]))
            if notes["format"] != FORMAT:
                raise ValueError(f"it is of format {notes['format']!r}, and this version reads format {FORMAT}")
            given = {**{name: notes[name] for name in _NOTES}, **{name: arrays[name] for name in _ARRAYS}}
            replay = cls(**{**given, "seeds": tuple(given["seeds"])}, name=str(path))
            replay._check()
        except FileNotFoundError:
            raise
        except (OSError, ValueError) as error:
            raise ValueError(f"{path} does not hold a replay: {error}") from error
        except Exception as error:  # whatever a damaged file makes of it
            raise ValueError(f"{path} does not hold a replay: {type(error).__name__}: {error}") from error
        return replay

    def _check(self) -> None:
        """Whether the arrays fit together; a ValueError (or worse) if not."""
        texts = (self.version, self.fingerprint, *(() if self.id is None else (self.id,)))
        if not all(isinstance(text, str) for text in texts) or not isinstance(self.arguments, dict):
            raise ValueError("version, fingerprint and id must be strings, and arguments must be an object")
        if not all(seed is None or (type(seed) is int and seed >= 0) for seed in self.seeds):
            raise ValueError("seeds must be whole numbers from 0 up, or null")
        check_number("control_hz", self.arguments["control_hz"], *CONTROL_RATES)
        segments, steps = len(self.starts), len(self.actions)
        shapes = self.starts.shape == self.states.shape == self.ends.shape == (len(self.seeds),)
        if not shapes or not segments or self.starts.dtype != np.int64:
            raise ValueError("there must be one segment or more, each with a start, a state, an end and a seed or null")
        if self.starts[0] != 0 or (np.diff(self.starts) < 0).any() or self.starts[-1] > steps:
            raise ValueError(f"starts must rise from 0 to at most {steps}, got {self.starts}")
        if self.arguments["continuous"] is True:
            good = self.actions.dtype == np.float32 and self.actions.shape == (steps, 2)
            good = good and bool(np.isfinite(self.actions).all())
        else:
            good = self.actions.dtype == np.int8 and self.actions.ndim == 1
            good = good and bool(((self.actions >= 0) & (self.actions < len(DIRECTIONS))).all())
        expected = steps if self.arguments["opponent"] is None else 0
        good = good and self.right_actions.dtype == np.float32 and self.right_actions.shape == (expected, 2)
        if not good or not np.isfinite(self.right_actions).all():
            raise ValueError("the actions must be finite, and of the shape and type that the arguments call for")


def is_replay(path: str | Path) -> bool:
    """Whether a file looks like a replay (and not like a policy, say)."""
    try:
        with zipfile.ZipFile(Path(path)) as file:
            return "replay.npy" in file.namelist()
    except (OSError, zipfile.BadZipFile):
        return False
