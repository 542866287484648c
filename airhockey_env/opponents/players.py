"""Who plays the right paddles: a pool of opponents, scripted, trained or from outside, and how the last are asked."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from airhockey_env.checks import check_velocities
from airhockey_env.kernel.scripted import EXTERNAL, SCRIPTED
from airhockey_env.kernel.state import OBSERVATION_SIZE
from airhockey_env.opponents.policy import MlpPolicy
from airhockey_env.opponents.trained import TRAINED, resolved

NAMES = (*SCRIPTED, *TRAINED)
"""The names of opponents."""

Policy = Callable[[NDArray[np.float32]], ArrayLike]
"""An opponent from outside: float32 observations (N, 13), seen from its own side, to actions (N, 2)."""

Opponent = str | os.PathLike[str] | Policy
"""Who plays the right paddle: a name in `NAMES`, the path of a `policy.npz` or of a run's folder, or a policy."""

_ALLOWED = f"one of {NAMES}, the path of a policy.npz or of a run's folder, or a callable"


def check_opponent(opponent: Any, several: bool = False) -> Any:
    """`opponent` of a face: unlike a caller of `Game`, its user does not play the right paddle too.

    Args:
        several: a sequence of opponents will do as well.

    Raises:
        ValueError: None, or a sequence that will not do.
    """
    if opponent is None or (not several and _is_pool(opponent)):
        raise ValueError(f"opponent must be {_ALLOWED}, got {opponent!r}")
    return opponent


def _is_pool(opponent: Any) -> bool:
    return isinstance(opponent, Sequence) and not isinstance(opponent, (str, bytes)) and not callable(opponent)


def pool_of(opponent: Any) -> list[str | Policy | None]:
    """The pool of opponents that an `opponent` argument means; None is a caller of `Game` who plays both paddles.

    Raises:
        ValueError: no such opponent, or no opponent at all.
    """
    if opponent is None:
        return [None]
    if not _is_pool(opponent):
        return [member_of(opponent)]
    if not opponent:
        raise ValueError(f"opponent must be a player, or a sequence of one or more, got {opponent!r}")
    return [member_of(member, f" at place {place}") for place, member in enumerate(opponent)]


def member_of(opponent: Any, where: str = "") -> str | Policy:
    """An opponent as a pool holds it: a name, or a policy; that of a file in place of its path.

    Args:
        opponent: as a caller gives it.
        where: in a sequence, for the error.

    Raises:
        ValueError: no such opponent, or the file holds no policy.
    """
    if callable(opponent) or (isinstance(opponent, str) and opponent in NAMES):
        return opponent
    given, problem = os.fspath(opponent) if isinstance(opponent, os.PathLike) else opponent, ""
    if given and isinstance(given, str):
        try:
            return _policy_at(Path(given))
        except FileNotFoundError as error:
            problem = f"; there is no file {error.filename}"
        except (OSError, ValueError) as error:
            problem = f"; {error}"
    raise ValueError(f"opponent must be {_ALLOWED}, got {given!r}{where}{problem}")


def _policy_at(path: Path) -> MlpPolicy:
    """The policy of a file, or of a run's folder. One file is read once, as long as it stays the same."""
    path = (path / "policy.npz" if path.is_dir() else path).resolve()
    stat = path.stat()
    return _policy_of(path, (stat.st_ino, stat.st_mtime_ns, stat.st_size))


@functools.lru_cache(maxsize=64)
def _policy_of(path: Path, version: tuple[int, ...]) -> MlpPolicy:
    return MlpPolicy.load(path)


def number_of(opponent: Opponent | None) -> int:
    """The number of who drives the right paddle: a member of a pool."""
    return EXTERNAL if callable(resolved(opponent)) else scripted("opponent", opponent)


def scripted(name: str, player: Any) -> int:
    """The number of a scripted player; of None, whose actions come from outside.

    Raises:
        ValueError: no such player; the message calls the argument `name`.
    """
    if player is None:
        return EXTERNAL
    if isinstance(player, str) and player in SCRIPTED:
        return SCRIPTED[player]
    raise ValueError(f"{name} must be one of {tuple(SCRIPTED)}, got {player!r}")


class Group(NamedTuple):
    """The tables on which one policy from outside plays, and what it is shown of them."""

    policy: Policy
    name: str  # for errors
    rows: slice | NDArray[np.int64]  # n tables; a slice where they follow each other
    seen: NDArray[np.float32]  # (n, 13), read-only: a view of all observations with a slice, else of `copied`
    copied: NDArray[np.float32] | None  # (n, 13), filled in every step


def groups_of(
    pool: Sequence[Opponent | None],
    places: NDArray[np.integer],
    observations: NDArray[np.float32],
) -> list[Group]:
    """The tables on which policies from outside play, one group for each policy, in the order of the pool.

    Args:
        pool: of opponents.
        places: (N,) in the pool: who plays on each table.
        observations: (N, 13) of the right players, which go on changing in place.
    """
    members: dict[int, int] = {}  # a policy may have several places
    group_of = np.full(len(pool), -1, np.min_scalar_type(-1 - len(pool)))  # small ones sort faster
    for place, member in enumerate(pool):
        if number_of(member) == EXTERNAL:
            group_of[place] = members.setdefault(id(resolved(member)), len(members))
    groups_of_tables = group_of[places]
    order = np.argsort(groups_of_tables, kind="stable")
    bounds = np.searchsorted(groups_of_tables[order], np.arange(len(members) + 1))
    groups = []
    for group in range(len(members)):
        rows = order[bounds[group] : bounds[group + 1]]
        if not len(rows):
            continue
        place = int(np.argmax(group_of == group))
        name = "the opponent's actions" if len(pool) == 1 else f"the actions of opponent {place}"
        policy: Any = resolved(pool[place])
        if rows[-1] - rows[0] == len(rows) - 1:
            part, copied = slice(int(rows[0]), int(rows[-1]) + 1), None
            seen = observations[part]
            groups.append(Group(policy, name, part, _read_only(seen), None))
        else:
            copied = np.zeros((len(rows), OBSERVATION_SIZE), np.float32)
            groups.append(Group(policy, name, rows, _read_only(copied), copied))
    return groups


def answers_of(
    groups: Sequence[Group], observations: NDArray[np.float32], answers: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Ask the policies from outside for their actions.

    Args:
        observations: (N, 13) of the right players, those of which the groups are.
        answers: (N, 2), written in place where policies from outside play, unless one of them plays everywhere.

    Returns:
        (N, 2) float32: `answers`, or those of the one policy.

    Raises:
        ValueError: a policy's actions are of the wrong shape, or not finite.
    """
    n = len(answers)
    if len(groups) == 1 and len(groups[0].seen) == n:
        group = groups[0]
        return check_velocities(group.name, group.policy(group.seen), (n, 2))
    for policy, name, rows, seen, copied in groups:
        if copied is not None and not isinstance(rows, slice):
            np.take(observations, rows, axis=0, out=copied, mode="clip")  # other modes would copy twice
        answers[rows] = check_velocities(name, policy(seen), (len(seen), 2))
    return answers


def _read_only(array: NDArray[np.float32]) -> NDArray[np.float32]:
    view = array.view()
    view.flags.writeable = False
    return view
