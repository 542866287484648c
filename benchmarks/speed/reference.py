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
from airhockey_env.kernel.state import LEFT, PARAMETERS, RIGHT, STATE
from benchmarks.speed import build


def _part(dtype: np.dtype, names: str) -> np.dtype:
    """A record type of some of the fields, with the memory layout of C."""
    return np.dtype([(name, dtype[name]) for name in names.split()], align=True)


C_PARAMETERS = _part(
    PARAMETERS,
    "tick clock_limit half_length half_width half_goal wall_restitution wall_tangential disc_restitution radius "
    "inverse_mass glide_p glide_q glide_r glide_s puck_speed paddle_speed paddle_step per_x per_y per_paddle per_puck "
    "per_clock",
)
C_STATE = _part(STATE, "position velocity plan stream steps clock score side done")
OUTPUTS = (
    *("observation", "final_observation", "score", "final_score", "n_contacts", "point", "foul"),
    *("success", "reward", "right_reward", "terminated", "truncated", "began", "contacts"),
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


def outputs_of(game: Game, name: str) -> NDArray[np.generic]:
    """Copy of a game's output in the layout of the game in C."""
    if name == "right_reward":
        return game.out.reward[RIGHT].copy()
    output = getattr(game.out, name)
    return output[LEFT].copy() if name in ("observation", "final_observation", "reward") else output.copy()


class CGame:
    """Tables of the default game, stepped by the C code from the state of a `Game`.

    Attributes:
        states: (N,) records of `C_STATE`.
        out: arrays by the names in `OUTPUTS`, like those of `Game.out`, for the left player where that has both.
    """

    def __init__(self, game: Game, code: ctypes.CDLL | None = None) -> None:
        """Copy the states, the parameters and the settings of `game`, which does not change.

        Args:
            game: the game to continue.
            code: the loaded C library, `library()` by default.

        Raises:
            DependencyNotInstalled: there is no working C compiler.
        """
        self._library = code or library()
        n = game.num_tables
        self.states = np.zeros(n, C_STATE)
        self.take(game)
        self._parameters = np.zeros(1, C_PARAMETERS)
        for name in C_PARAMETERS.names or ():
            self._parameters[name] = game.parameters[name]
        self.out = {name: outputs_of(game, name) for name in OUTPUTS}
        self._pointers = (ctypes.c_void_p * len(OUTPUTS))(*(self.out[name].ctypes.data for name in OUTPUTS))
        self._fixed = (self.states.ctypes.data, self._parameters.ctypes.data)
        self._modes = int(game.settings["max_steps"][0]), int(game.settings["autoreset"][0])
        self._shape = (n, 2)

    def take(self, game: Game) -> None:
        """Copy the state of the game's tables."""
        for name in C_STATE.names or ():
            self.states[name] = game.states[name]

    def reset(self) -> None:
        """Start an episode on every table."""
        self._library.reset_rows(0, len(self.states), *self._fixed, self._pointers)

    def step(self, actions: NDArray[np.float32]) -> None:
        """Play one step on every table and write the results to `out`.

        Raises:
            ValueError: the actions are not a contiguous float32 array of shape (N, 2).
        """
        if actions.shape != self._shape or actions.dtype != np.float32 or not actions.flags.c_contiguous:
            raise ValueError(f"actions must be contiguous float32 of shape {self._shape}, got {actions!r}")
        self._library.step_rows(0, len(self.states), *self._fixed, actions.ctypes.data, self._pointers, *self._modes)
