"""The default game in hand-written C (airhockey.c), built when needed and called through ctypes."""

from __future__ import annotations

import atexit
import ctypes
import functools
import shutil
import tempfile
from pathlib import Path

import numpy as np
from gymnasium.error import DependencyNotInstalled
from numpy.typing import NDArray

from airhockey_env.game import Game
from airhockey_env.kernel.state import PHYSICS, TABLE
from benchmarks.speed import build


def _part(dtype: np.dtype, names: str) -> np.dtype:
    """A record type of some of the fields, with the memory layout of C."""
    return np.dtype([(name, dtype[name]) for name in names.split()], align=True)


LAW = _part(
    PHYSICS,
    "tick clock_limit half_length half_width half_goal wall_restitution wall_tangential disc_restitution radius "
    "inverse_mass glide_p glide_q glide_r glide_s puck_speed paddle_speed paddle_step per_x per_y per_paddle per_puck "
    "per_clock",
)
STATE = _part(TABLE, "position velocity plan stream n_contacts success steps clock score side done")
OUTPUTS = (
    *("observation", "final_observation", "score", "final_score", "n_contacts", "point", "foul"),
    *("success", "reward", "terminated", "truncated", "contacts"),
)


@functools.cache
def library(command: tuple[str, ...] | None = None, flags: tuple[str, ...] | None = None) -> ctypes.CDLL:
    """Build and load the game, once per process. `build` chooses the compiler and the flags if they are not given.

    Raises:
        DependencyNotInstalled: there is no working C compiler.
    """
    command = command or build.compiler()
    if command is None:
        raise DependencyNotInstalled("the game in C needs a C compiler (cc): install gcc or clang")
    folder = tempfile.mkdtemp(prefix="airhockey")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    path = build.build(command, build.flags(command) if flags is None else flags, Path(folder) / "airhockey.so")
    game = ctypes.CDLL(str(path))
    rows, pointer, number = ctypes.c_int64, ctypes.c_void_p, ctypes.c_int32
    game.step_rows.argtypes = [rows, rows, pointer, pointer, pointer, pointer, number, number]
    game.reset_rows.argtypes = [rows, rows, pointer, pointer, pointer]
    game.step_rows.restype = game.reset_rows.restype = None
    return game


class CGame:
    """Tables of the default game, stepped by the C code from the state of a `Game`.

    Attributes:
        tables: (N,) records of `STATE`.
        out: arrays by the names in `OUTPUTS`, like those of `Game.out`.
    """

    def __init__(self, game: Game, code: ctypes.CDLL | None = None) -> None:
        """Copy the tables, their physics and the settings of `game`, which does not change.

        Args:
            game: the game to continue.
            code: the loaded C library, `library()` by default.

        Raises:
            DependencyNotInstalled: there is no working C compiler.
        """
        self._library = code or library()
        n = game.num_tables
        self.tables = np.zeros(n, STATE)
        self.take(game)
        self._law = np.zeros(1, LAW)
        for name in LAW.names or ():
            self._law[name] = game.physics[name]
        self.out = {name: getattr(game.out, name).copy() for name in OUTPUTS}
        self._pointers = (ctypes.c_void_p * len(OUTPUTS))(*(self.out[name].ctypes.data for name in OUTPUTS))
        self._fixed = (self.tables.ctypes.data, self._law.ctypes.data)
        self._modes = int(game.settings["max_steps"][0]), int(game.settings["autoreset"][0])
        self._shape = (n, 2)

    def take(self, game: Game) -> None:
        """Copy the state of the game's tables."""
        for name in STATE.names or ():
            self.tables[name] = game.tables[name]

    def reset(self) -> None:
        """Start an episode on every table."""
        self._library.reset_rows(0, len(self.tables), *self._fixed, self._pointers)

    def step(self, actions: NDArray[np.float32]) -> None:
        """Play one step on every table and write the results to `out`.

        Raises:
            ValueError: the actions are not a contiguous float32 array of shape (N, 2).
        """
        if actions.shape != self._shape or actions.dtype != np.float32 or not actions.flags.c_contiguous:
            raise ValueError(f"actions must be contiguous float32 of shape {self._shape}, got {actions!r}")
        self._library.step_rows(0, len(self.tables), *self._fixed, actions.ctypes.data, self._pointers, *self._modes)
