"""Who can play in a seat: scripted and trained players by name, policies from files, and callables."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from airhockey_env.checks import check_stack
from airhockey_env.kernel.scripted import EXTERNAL, SCRIPTED
from airhockey_env.opponents.policy import MlpPolicy
from airhockey_env.opponents.trained import TRAINED, trained_policy

NAMES = (*SCRIPTED, *TRAINED)
"""The names of players."""

Policy = Callable[[NDArray[np.float32]], ArrayLike]
"""A policy: float32 observations (N, 13), seen from its own side, to actions (N, 2).

With an attribute `stack`, a whole number K from 2 to 64, it is given the last K observations and the actions that led
to them instead, (N, K, 15), as an environment with this `stack` shows them."""

Player = str | os.PathLike[str] | Policy
"""Who plays: a name in `NAMES`, the path of a `policy.npz` or of a run's folder, or a policy."""

_ALLOWED = f"one of {NAMES}, the path of a policy.npz or of a run's folder, or a callable"


def resolve_players(name: str, given: Any, several: bool = True) -> list[str | Policy]:
    """The members of the pool that an argument means: names as they are, and the policies of files.

    Args:
        name: what errors call the argument.
        given: a player or, with `several`, a sequence of one or more.

    Raises:
        ValueError: no such player.
    """
    is_sequence = isinstance(given, Sequence) and not isinstance(given, (str, bytes)) and not callable(given)
    if not (several and is_sequence):
        return [resolve_player(name, given)]
    if not given:
        raise ValueError(f"{name} must be a player, or a sequence of one or more, got {given!r}")
    return [resolve_player(name, player, f" at place {place}") for place, player in enumerate(given)]


def resolve_player(name: str, given: Any, where: str = "") -> str | Policy:
    """A player as a pool holds it: a name, or a policy; that of a file in place of its path.

    Args:
        name: what errors call the argument.
        given: as a caller gives it.
        where: in a sequence, for the error.

    Raises:
        ValueError: no such player, or the file holds no policy.
    """
    if isinstance(given, str) and given in NAMES:
        return given
    if callable(given):
        check_stack(f"{name}.stack{where}", stack_of(given))
        return given
    path, problem = os.fspath(given) if isinstance(given, os.PathLike) else given, ""
    if path and isinstance(path, str):
        try:
            return _policy_at(Path(path))
        except FileNotFoundError as error:
            problem = f"; there is no file {error.filename}"
        except (OSError, ValueError) as error:
            problem = f"; {error}"
    raise ValueError(f"{name} must be {_ALLOWED}, got {path!r}{where}{problem}")


def _policy_at(path: Path) -> MlpPolicy:
    """The policy of a file, or of a run's folder. One file is read once, as long as it stays the same."""
    path = (path / "policy.npz" if path.is_dir() else path).resolve()
    stat = path.stat()
    return _policy_of(path, (stat.st_ino, stat.st_mtime_ns, stat.st_size))


@functools.lru_cache(maxsize=64)
def _policy_of(path: Path, version: tuple[int, ...]) -> MlpPolicy:
    return MlpPolicy.load(path)


def driver_of(member: str | Policy) -> int:
    """The number of the scripted player who drives the paddle, or EXTERNAL for a policy."""
    return SCRIPTED[member] if isinstance(member, str) and member in SCRIPTED else EXTERNAL


def policy_of(member: str | Policy) -> Policy:
    """The policy of a member of a pool that is no scripted player."""
    return trained_policy(member) if isinstance(member, str) else member


def stack_of(member: str | Policy) -> int:
    """How many observations a member of a pool is shown at once: 1 for scripted players, who look at none."""
    return 1 if driver_of(member) != EXTERNAL else getattr(policy_of(member), "stack", 1)
