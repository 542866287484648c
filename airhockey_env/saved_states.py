"""Saved states: everything that decides what happens next on a table, as one record."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from airhockey_env.kernel.camera import ARRIVES, CAMERA_STATE, MOMENT, CameraArrays
from airhockey_env.kernel.state import PARAMETERS, SEATS, STATE

_FLOATS = tuple(name for name in STATE.names or () if STATE[name].base.kind == "f")
_CAMERA_FIELDS = tuple(name for name in CAMERA_STATE.names or () if CAMERA_STATE[name].base.kind == "f")

Cameras = tuple[CameraArrays | None, CameraArrays | None]
"""The cameras of the left and of the right player, where they have one."""

CAMERA_NAMES = ("left_camera", "right_camera")
"""What saved states call what these have seen."""


def state_dtype(randomized: bool, cameras: Cameras) -> np.dtype:
    """The record that `Game.get_state` returns for one table.

    `STATE` alone where that is everything; else the fields `state`, `parameters` with tables that are drawn for every
    episode, and for each camera `left_camera` or `right_camera`, with its `queue` and its `past`.
    """
    fields: list[Any] = [("parameters", PARAMETERS)] if randomized else []
    for seat, arrays in zip(SEATS, cameras, strict=True):
        if arrays is not None:
            parts = [("state", CAMERA_STATE)]
            parts += [(name, np.float64, getattr(arrays, name).shape[1:]) for name in ("queue", "past")]  # type: ignore[misc]
            fields.append((CAMERA_NAMES[seat], np.dtype(parts)))
    return np.dtype([("state", STATE), *fields]) if fields else STATE


def game_state(saved: NDArray[np.void]) -> NDArray[np.void]:
    """The `STATE` in saved states; a view."""
    return saved["state"] if saved.dtype != STATE else saved


def save(
    rows: NDArray[np.int64], states: NDArray[np.void], parameters: NDArray[np.void], randomized: bool, cameras: Cameras
) -> NDArray[np.void]:
    """Copies of everything that decides what happens next on the given tables: (n,) records."""
    dtype = state_dtype(randomized, cameras)
    if dtype == STATE:
        return np.array(states[rows])
    saved = np.zeros(len(rows), dtype)
    saved["state"] = states[rows]
    if randomized:
        saved["parameters"] = parameters[rows]
    for name, arrays in zip(CAMERA_NAMES, cameras, strict=True):
        if arrays is not None:
            saved[name]["state"] = arrays.states[rows]
            saved[name]["queue"], saved[name]["past"] = arrays.queue[rows], arrays.past[rows]
    return saved


def restore(
    saved: NDArray[np.void],
    rows: NDArray[np.int64],
    states: NDArray[np.void],
    parameters: NDArray[np.void],
    randomized: bool,
    cameras: Cameras,
) -> None:
    """Put checked states back, onto the given tables."""
    states[rows] = game_state(saved)
    if randomized:
        parameters[rows] = saved["parameters"]
    for name, arrays in zip(CAMERA_NAMES, cameras, strict=True):
        if arrays is not None:
            arrays.states[rows] = saved[name]["state"]
            arrays.queue[rows], arrays.past[rows] = saved[name]["queue"], saved[name]["past"]


def check_state(
    saved: Any, shape: tuple[int, ...], parameters: NDArray[np.void], randomized: bool, cameras: Cameras
) -> None:
    """Whether these are states that tables of such a game could be in.

    Args:
        saved: as a caller gives it.
        shape: (n,), of so many tables.
        parameters: (1,) or (N,) `PARAMETERS` of the game.
        randomized: whether its tables are drawn for every episode.
        cameras: the game's.

    Raises:
        ValueError: they are not.
    """
    wrong = [type(saved).__name__]
    if isinstance(saved, np.ndarray):
        wrong = [f"shape {saved.shape}"] if saved.shape != shape else []
        wrong += ["another kind of record"] if saved.dtype != state_dtype(randomized, cameras) else []
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
    for name, arrays in zip(CAMERA_NAMES, cameras, strict=True):
        if arrays is not None:
            _check_camera(saved[name], table, surface, arrays)


def _check_camera(
    saved: NDArray[np.void], table: NDArray[np.void], params: NDArray[np.void], arrays: CameraArrays
) -> None:
    """Raises ValueError unless a camera could be in these states: compiled code counts on it."""
    state, camera = saved["state"], arrays.camera[0]
    length, frames = arrays.queue.shape[1], arrays.past.shape[2]
    numbers = (*(state[name] for name in _CAMERA_FIELDS), saved["queue"], saved["past"])
    begun = table["side"] != 0
    due = np.floor((state["step"] + MOMENT) * camera["camera_hz"] / camera["control_hz"]) + 1
    last = state["step"] + camera["delay"] + camera["jitter"] + 2.0 * MOMENT  # when the last frame so far can arrive
    per_disc = [[params[name] for name in ("per_x", "per_y", speed, speed)] for speed in ("per_paddle", "per_puck")]
    scale = np.moveaxis(np.array(per_disc), -1, 0)
    good = (
        all(np.isfinite(array).all() for array in numbers)
        and ((state["first"] >= 0) & (state["first"] < length)).all()
        and ((state["waiting"] >= 0) & (state["waiting"] <= length)).all()
        and ((state["known"] >= 0) & (state["known"] <= frames)).all()
        and ((state["next"] >= 0) & (state["next"] < frames)).all()
        and ((state["step"] == table["steps"]) | ~begun).all()
        and ((np.abs(state["frame"] - due) <= 1) | ~begun).all()
        and (saved["queue"][..., ARRIVES].max(axis=1) <= last).all()
        and ((state["scale"] == scale).all(axis=(1, 2)) | ~begun).all()
    )
    if not good:
        raise ValueError("state must hold what this game's camera can know, got another camera's or a damaged state")
