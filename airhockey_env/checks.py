"""Checks of arguments: what counts as a number, and one error message for each kind of argument.

A number here is a real number of Python or NumPy, a fraction or a decimal. Booleans, strings, complex numbers and
durations are not numbers, and neither is a finite number that is too large for a float. The `as_` functions read
numbers and return None for anything else. The `check_` functions return the argument in one form, or raise a ValueError
that says its name, what is allowed and what was given.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from decimal import Decimal
from numbers import Integral, Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from airhockey_env.actions import DIRECTIONS

NO_LIMIT = -1
"""`max_episode_steps` of episodes that are never truncated, as in `gymnasium.make`."""

MOST_DELAY = 1000
"""ms by which actions may be late."""
MOST_STACK = 64
"""Observations that a player can be shown at once."""

_NOT_NUMBERS = (bool, np.bool_, np.timedelta64)
"""Types that Python or NumPy count among the whole numbers."""


# What counts as a number ---------------------------------------------------------------------------------------------


def as_float(value: Any) -> float | None:
    """One number as a float, which may be infinite or NaN; None if it is not a number."""
    if not isinstance(value, (Real, Decimal)) or isinstance(value, _NOT_NUMBERS):
        return None
    try:
        number = float(value)
    except (OverflowError, TypeError, ValueError):
        return None
    return None if math.isinf(number) and value != number else number


def as_whole(value: Any) -> int | None:
    """One whole number, however large, as an int; None if it is not a whole number. 3.0 is not one."""
    return int(value) if isinstance(value, Integral) and not isinstance(value, _NOT_NUMBERS) else None


def as_array(value: Any) -> NDArray[np.float64] | None:
    """Numbers as a float64 array of their shape, or None if they are not all numbers or have no shape.

    A float64 array is returned as it is, not copied.
    """
    given = _numbers(value)
    if given is None or given.dtype == np.float64:
        return given
    with np.errstate(over="ignore", under="ignore"):
        array = given.astype(np.float64)
    return None if (np.isinf(array) & np.isfinite(given)).any() else array


def _numbers(value: Any) -> NDArray[Any] | None:
    """Numbers as an array of the type that NumPy chooses, or None."""
    try:
        given = np.asarray(value)
    except (OverflowError, TypeError, ValueError):  # lists of different lengths, for example
        return None
    if given.dtype.kind == "O":  # fractions, or whole numbers that fit no type of NumPy
        floats = [as_float(number) for number in given.flat]
        return None if None in floats else np.array(floats, np.float64).reshape(given.shape)
    return given if given.dtype.kind in "fiu" and not _holds_bool(value) else None


def _holds_bool(value: Any) -> bool:
    """Whether there is a boolean among nested lists, which NumPy would make a number of."""
    if isinstance(value, (list, tuple)):
        return any(map(_holds_bool, value))
    return isinstance(value, (bool, np.bool_))


def shown(value: object) -> str:
    """A value as an error message shows it: as Python writes it, but without the type's name around NumPy's numbers."""
    try:
        return repr(_plain(value))
    except Exception:  # a whole number of more than 4300 digits, or somebody's own __repr__
        return f"a {type(value).__name__} that cannot be shown"


def _plain(value: object) -> object:
    if isinstance(value, np.generic):
        return value.item()
    if type(value) is tuple:
        return tuple(map(_plain, value))
    return list(map(_plain, value)) if type(value) is list else value


# Checks of single arguments ------------------------------------------------------------------------------------------


def fault(name: str, allowed: str, value: object) -> ValueError:
    """The error to raise for an argument that is not what is allowed."""
    return ValueError(f"{name} must be {allowed}, got {shown(value)}")


def check_number(name: str, value: Any, low: float, high: float, also: str = "") -> float:
    """A number from `low` to `high`, as a float.

    Args:
        name: what errors call the argument.
        value: the argument.
        low: the smallest number that is allowed.
        high: the largest number that is allowed.
        also: what else the caller allows, such as "None"; errors name it too.
    """
    number = as_float(value)
    if number is None or not low <= number <= high:
        raise fault(name, f"{_or(also)}a number from {low} to {high}", value)
    return number


def check_positive(name: str, value: Any, most: float = math.inf) -> float:
    """A finite number that is greater than 0 and at most `most`, as a float."""
    number = as_float(value)
    if number is None or not 0.0 < number <= most or math.isinf(number):
        raise fault(name, "a finite number greater than 0" + f" and at most {most}" * math.isfinite(most), value)
    return number


def check_whole(name: str, value: Any, least: int, most: float = 2**31 - 1, also: str = "") -> int:
    """A whole number from `least` to `most`, as an int; `also` as for `check_number`."""
    number = as_whole(value)
    if number is None or not least <= number <= most:
        raise fault(name, f"{_or(also)}a whole number {_range(least, most)}", value)
    return number


def check_choice(name: str, value: Any, choices: Collection[str], also: str = "") -> str:
    """One of some names; `also` as for `check_number`."""
    if not isinstance(value, str) or value not in choices:
        raise fault(name, f"{_or(also)}one of {tuple(choices)}", value)
    return value


def _or(also: str) -> str:
    return f"{also} or " if also else ""


def _range(least: int, most: float) -> str:
    return f"from {least} up" if math.isinf(most) else f"from {least} to {most}"


# Checks of pairs and arrays ------------------------------------------------------------------------------------------


def check_pair(name: str, value: Any, also: str = "") -> NDArray[np.float64]:
    """Two finite numbers, (2,); `also` as for `check_number`."""
    pair = as_array(value)
    if pair is None or pair.shape != (2,) or not np.isfinite(pair).all():
        raise fault(name, f"{_or(also)}two finite numbers", value)
    return pair.copy()


def check_number_or_range(name: str, value: Any, low: float, high: float, also: str = "") -> Any:
    """A number from `low` to `high`, or a range of them (least, greatest), to draw from; `also` as for `check_number`.

    Returns:
        A float, or a tuple of two that differ.
    """
    return _number_or_range(name, value, low, high, as_float, f"{_or(also)}a number from {low} to {high}")


def check_whole_or_range(name: str, value: Any, low: int, high: int, also: str = "") -> Any:
    """The same of whole numbers, as ints."""
    return _number_or_range(name, value, low, high, as_whole, f"{_or(also)}a whole number from {low} to {high}")


def _number_or_range(name: str, value: Any, low: float, high: float, read: Any, allowed: str) -> Any:
    is_range = isinstance(value, (list, tuple, np.ndarray)) and np.shape(value) == (2,)
    ends = [read(end) for end in (value if is_range else (value, value))]
    if None in ends or not low <= ends[0] <= ends[1] <= high:
        raise fault(name, f"{allowed}, or a range (low, high) of them", value)
    return ends[0] if ends[0] == ends[1] else tuple(ends)


def check_whole_pair(name: str, value: Any, least: int, most: float = math.inf) -> tuple[int, int]:
    """Two whole numbers from `least` to `most`."""
    try:
        first, second = (as_whole(number) for number in value)
    except (TypeError, ValueError):
        first = second = None
    if first is None or second is None or not least <= min(first, second) <= max(first, second) <= most:
        raise fault(name, f"two whole numbers {_range(least, most)}", value)
    return first, second


def check_array(name: str, value: ArrayLike, shape: tuple[int, ...], allowed: str) -> NDArray[np.float64]:
    """Numbers, none of them NaN, as a new array of this shape. A single number is repeated to fill it.

    Args:
        name: what errors call the argument.
        value: the argument.
        shape: the shape that the array must have.
        allowed: what errors say of it, such as "an (N, 2) array in m".
    """
    array = as_array(value)
    if array is None:
        raise fault(name, allowed, value)
    if array.ndim == 0:
        array = np.broadcast_to(array, shape)
    if array.shape != shape:
        raise ValueError(f"{name} must be {allowed}, that is of shape {shape}; got shape {array.shape}")
    if np.isnan(array).any():
        raise ValueError(f"{name} must be {allowed}, got NaN")
    return np.array(array, order="C")


# Checks of what the game and its environments take -------------------------------------------------------------------


def check_limit(steps: Any, registered: int, name: str = "max_episode_steps") -> int:
    """The number of steps that truncate an episode, 0 for never.

    Args:
        steps: as in `gymnasium.make`: None for what the environment registers, -1 for no limit, or a whole number.
        registered: the limit of the task's registered environment.
        name: what errors call the argument.
    """
    if steps is None:
        return registered
    if as_whole(steps) == NO_LIMIT:
        return 0
    return check_whole(name, steps, 1, also="None, -1 (no limit)")


def check_stack(name: str, stack: Any) -> int:
    """How many observations a player is shown at once."""
    return check_whole(name, stack, 1, MOST_STACK)


def check_action_delay(name: str, delay: Any) -> Any:
    """A delay of actions, ms, as a float, or a range of delays as a tuple."""
    return check_number_or_range(name, delay, 0, MOST_DELAY)


def check_seed(seed: Any) -> int:
    """A seed: a whole number from 0 up, as an int."""
    return check_whole("seed", seed, 0, math.inf)


def check_seeds(seed: Any, n: int) -> list[int | None]:
    """Seeds of n tables, one for each: from the first one's, which the next numbers follow, or from a list of them."""
    if seed is None:
        return [None] * n
    if not isinstance(seed, (list, tuple)) and np.ndim(seed) == 0:
        first = check_seed(seed)
        return [first + i for i in range(n)]
    if len(seed) != n:
        raise ValueError(f"seed must hold one seed for each of {n} tables, got {len(seed)}")
    return [None if one is None else check_seed(one) for one in seed]


def check_rows(name: str, tables: ArrayLike, n: int, repeated: bool = False) -> NDArray[np.int64]:
    """Numbers of some of n tables, given as such or as a mask; `repeated`: each may be there more than once."""
    once = "" if repeated else ", each once"
    allowed = f"whole numbers from 0 to {n - 1}{once}, or a mask of {n} bools"
    try:
        given = np.atleast_1d(np.asarray(tables))
    except ValueError as error:
        raise fault(name, allowed, tables) from error
    if given.dtype == np.bool_ and given.shape == (n,):
        return np.flatnonzero(given)
    if not given.size:
        given = given.astype(np.int64)
    whole = given.ndim == 1 and given.dtype.kind in "iu"
    valid = whole and not ((given < 0) | (given >= n)).any()
    if not valid or not (repeated or len(np.unique(given)) == len(given)):
        raise fault(name, allowed, tables)
    return given.astype(np.int64)


def check_skill(skill: ArrayLike, num_tables: int, name: str = "opponent_skill") -> NDArray[np.float64] | float:
    """A skill for all tables, or one for each: (num_tables,)."""
    skills = as_array(skill)
    if skills is None or skills.ndim == 0:
        return check_number(name, skill, 0.0, 1.0)
    if skills.shape != (num_tables,) or not ((skills >= 0) & (skills <= 1)).all():
        raise fault(name, f"one number from 0 to 1, or one for each of {num_tables} tables", skill)
    return skills.copy()


def check_velocities(name: str, actions: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Target velocities as float32. Those that float32 cannot hold are clipped, as all beyond [-1, 1] will be."""
    given = _numbers(actions)
    if given is not None and given.dtype != np.float32:
        given = as_array(given)
    if given is None:
        raise fault(name, f"an array of shape {shape}", actions)
    if given.shape != shape:
        raise ValueError(f"{name} must be an array of shape {shape}, got shape {given.shape}")
    if not np.isfinite(given).all():
        raise ValueError(f"{name} must be finite, got {given[~np.isfinite(given)][0]}")
    if given.dtype != np.float32:
        given = given.clip(-1.0, 1.0).astype(np.float32)
    return np.ascontiguousarray(given)


def check_directions(name: str, actions: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Discrete actions as target velocities (N, 2)."""
    allowed = f"whole numbers from 0 to {len(DIRECTIONS) - 1}, of shape {shape}"
    try:
        chosen = np.asarray(actions)
    except ValueError as error:
        raise fault(name, allowed, actions) from error
    if chosen.shape != shape or chosen.dtype.kind not in "iu" or ((chosen < 0) | (chosen >= len(DIRECTIONS))).any():
        raise fault(name, allowed, actions)
    return DIRECTIONS[chosen.reshape(-1)]
