"""Checks of what callers give. Each returns it in one form, or raises a ValueError that names the argument."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from airhockey_env.spaces import DIRECTIONS

NO_LIMIT = -1
"""`max_episode_steps` of episodes that are never truncated, as in `gymnasium.make`."""


def check_whole(name: str, value: Any, least: int, most: float = 2**31 - 1) -> int:
    """A whole number from `least` to `most`."""
    whole = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
    if not whole or not least <= value <= most:
        limit = "up" if math.isinf(most) else f"to {most}"
        raise ValueError(f"{name} must be a whole number from {least} {limit}, got {value!r}")
    return int(value)


def check_limit(steps: Any, registered: int, name: str = "max_episode_steps") -> int:
    """The number of steps that truncate an episode, 0 for never.

    Args:
        steps: as in `gymnasium.make`: None for what the environment registers, -1 for no limit, or a whole number.
        registered: the limit of the task's registered environment.
        name: what errors call the argument.
    """
    if steps is None:
        return registered
    most = 2**31 - 1
    whole = isinstance(steps, (int, np.integer)) and not isinstance(steps, bool)
    if not whole or not (steps == NO_LIMIT or 1 <= steps <= most):
        raise ValueError(f"{name} must be None, -1 (no limit) or a whole number from 1 to {most}, got {steps!r}")
    return 0 if steps == NO_LIMIT else int(steps)


def check_number(name: str, value: Any, low: float, high: float) -> float:
    """A number from `low` to `high`."""
    number = isinstance(value, (int, float, np.number)) and not isinstance(value, bool)
    if not number or not low <= value <= high:
        raise ValueError(f"{name} must be a number from {low} to {high}, got {value!r}")
    return float(value)


def check_pair(name: str, value: Any) -> NDArray[np.float64]:
    """Two finite numbers, (2,)."""
    try:
        pair = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name} must be two finite numbers, got {value!r}") from error
    if pair.shape != (2,) or not np.isfinite(pair).all():
        raise ValueError(f"{name} must be two finite numbers, got {value!r}")
    return pair


def check_seed(seed: Any) -> int:
    """A seed as an int.

    Raises:
        ValueError: it is not a whole number from 0 up.
    """
    return check_whole("seed", seed, 0, math.inf)


def check_rows(name: str, tables: ArrayLike, n: int, repeated: bool = False) -> NDArray[np.int64]:
    """Numbers of some of n tables, given as such or as a mask; `repeated`: each may be there more than once."""
    try:
        given = np.atleast_1d(np.asarray(tables))
    except ValueError as error:
        raise ValueError(f"{name} must be numbers of tables or a mask, got {tables!r}") from error
    if given.dtype == np.bool_ and given.shape == (n,):
        return np.flatnonzero(given)
    if not given.size:
        given = given.astype(np.int64)
    whole = given.ndim == 1 and given.dtype.kind in "iu"
    valid = whole and not ((given < 0) | (given >= n)).any()
    if not valid or not (repeated or len(np.unique(given)) == len(given)):
        once = "" if repeated else ", each once"
        raise ValueError(
            f"{name} must be whole numbers from 0 to {n - 1}{once}, or a mask of {n} bools; got {tables!r}"
        )
    return given.astype(np.int64)


def check_skill(skill: ArrayLike, num_tables: int, name: str = "opponent_skill") -> NDArray[np.float64] | float:
    """A skill for all tables, or one for each."""
    try:
        skills = np.asarray(skill)
    except ValueError:  # lists of different lengths
        skills = np.array([None])
    if skills.ndim == 0:
        return check_number(name, skill, 0.0, 1.0)
    if skills.shape != (num_tables,) or skills.dtype.kind not in "fiu" or not ((skills >= 0) & (skills <= 1)).all():
        raise ValueError(f"{name} must be from 0 to 1, one number or one for each table, got {skill!r}")
    return skills.astype(np.float64)


def check_velocities(name: str, actions: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Target velocities as float32. Those that float32 cannot hold are clipped, as all beyond [-1, 1] will be."""
    try:
        given = np.asarray(actions)
        if given.dtype != np.float32:
            given = given.astype(np.float64, casting="same_kind", copy=False)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name} must be an array of shape {shape}, got {actions!r}") from error
    if given.shape != shape:
        raise ValueError(f"{name} must be an array of shape {shape}, got shape {given.shape}")
    if not np.isfinite(given).all():
        raise ValueError(f"{name} must be finite, got {given[~np.isfinite(given)][0]}")
    if given.dtype != np.float32:
        given = given.clip(-1.0, 1.0).astype(np.float32)
    return np.ascontiguousarray(given)


def check_directions(name: str, actions: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Discrete actions as target velocities (N, 2)."""
    try:
        chosen = np.asarray(actions)
    except ValueError as error:
        raise ValueError(f"{name} must be whole numbers from 0 to 8, got {actions!r}") from error
    if chosen.shape != shape or chosen.dtype.kind not in "iu" or ((chosen < 0) | (chosen > 8)).any():
        raise ValueError(f"{name} must be whole numbers from 0 to 8, of shape {shape}; got {actions!r}")
    return DIRECTIONS[chosen.reshape(-1)]
