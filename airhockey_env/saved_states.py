"""Saved states: everything that decides what happens next on a table, as one record."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from airhockey_env.kernel.state import PARAMETERS, STATE
from airhockey_env.player_interface import PlayerInterfaces

_FLOATS = tuple(name for name in STATE.names or () if STATE[name].base.kind == "f")


def state_dtype(randomized: bool, interfaces: PlayerInterfaces | None) -> np.dtype:
    """The record that `Game.get_state` returns for one table.

    `STATE` alone where that is everything; else the fields `state`, `parameters` with tables that are drawn for every
    episode, and those of the players' interfaces, such as `left_camera` or `right_history`. With None for these, it
    is the record of a table without what stands between it and its players.
    """
    fields: list[Any] = [("parameters", PARAMETERS)] if randomized else []
    fields += [(name, array.dtype, array.shape[1:]) for name, array in _arrays(interfaces).items()]
    return np.dtype([("state", STATE), *fields]) if fields else STATE


def _arrays(interfaces: PlayerInterfaces | None) -> dict[str, NDArray[Any]]:
    return {} if interfaces is None else interfaces.saved_fields()


def game_state(saved: NDArray[np.void]) -> NDArray[np.void]:
    """The `STATE` in saved states; a view."""
    return saved["state"] if saved.dtype != STATE else saved


def save(
    rows: NDArray[np.int64],
    states: NDArray[np.void],
    parameters: NDArray[np.void],
    randomized: bool,
    interfaces: PlayerInterfaces | None,
) -> NDArray[np.void]:
    """Copies of everything that decides what happens next on the given tables: (n,) records."""
    dtype = state_dtype(randomized, interfaces)
    if dtype == STATE:
        return np.array(states[rows])
    saved = np.zeros(len(rows), dtype)
    saved["state"] = states[rows]
    if randomized:
        saved["parameters"] = parameters[rows]
    for name, array in _arrays(interfaces).items():
        saved[name] = array[rows]
    return saved


def restore(
    saved: NDArray[np.void],
    rows: NDArray[np.int64],
    states: NDArray[np.void],
    parameters: NDArray[np.void],
    randomized: bool,
    interfaces: PlayerInterfaces | None,
) -> None:
    """Put checked states back, onto the given tables."""
    states[rows] = game_state(saved)
    if randomized:
        parameters[rows] = saved["parameters"]
    for name, array in _arrays(interfaces).items():
        array[rows] = saved[name]


def check_state(
    saved: Any,
    shape: tuple[int, ...],
    parameters: NDArray[np.void],
    randomized: bool,
    interfaces: PlayerInterfaces | None,
) -> None:
    """Whether these are states that tables of such a game could be in.

    Args:
        saved: as a caller gives it.
        shape: (n,), of so many tables.
        parameters: (1,) or (N,) `PARAMETERS` of the game.
        randomized: whether its tables are drawn for every episode.
        interfaces: the game's players'.

    Raises:
        ValueError: they are not.
    """
    wrong = [type(saved).__name__]
    if isinstance(saved, np.ndarray):
        wrong = [f"shape {saved.shape}"] if saved.shape != shape else []
        wrong += ["another kind of record"] if saved.dtype != state_dtype(randomized, interfaces) else []
    if wrong:
        raise ValueError(f"state must be what get_state returned, of shape {shape}; got {' and '.join(wrong)}")
    table = game_state(saved)
    for name in _FLOATS:
        if not np.isfinite(table[name]).all():
            raise ValueError(f"state must hold finite numbers, got one in {name!r} that is not")
    surface = saved["parameters"] if randomized else parameters
    half = np.stack([surface["half_length"], surface["half_width"]], axis=-1)
    if not (np.abs(table["position"]) <= half[:, np.newaxis]).all():
        raise ValueError("state must have all discs on the table, got a 'position' beyond it")
    if randomized and (surface["tick"] != parameters["tick"][0]).any():
        hz = 1.0 / parameters["tick"][0]
        raise ValueError(f"state must be of a game at control_hz {hz:g}, as this one is, got that of another game")
    if interfaces is not None:
        interfaces.check(saved, table, surface)
