"""The pool of a seat: who plays there, on which table, and how policies are asked for their actions."""

from __future__ import annotations

from copy import deepcopy
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from airhockey_env.checks import check_rows, check_skill, check_velocities, check_whole, fault
from airhockey_env.kernel.scripted import EXTERNAL
from airhockey_env.kernel.state import LEFT
from airhockey_env.opponents.players import Player, Policy, driver_of, policy_of, resolve_player, stack_of
from airhockey_env.opponents.policy import MlpPolicy
from airhockey_env.player_interface import PlayerInterface
from airhockey_env.threads import Threads, one_at_a_time

ROWS_PER_THREAD = 512
"""Rows of networks that are worth a thread of their own."""


class Needs(NamedTuple):
    """What the players of a seat have to be shown."""

    observes: bool
    """Whether they look at observations: the caller and policies do, scripted players do not."""
    stack: int
    """The greatest number of observations that one of the policies in the pool is shown at once."""


class Pool:
    """The players of one seat, who share its tables.

    Every table is assigned a place in the pool: table i has the place i modulo the pool's size at first, whatever the
    number of tables, and `assign` changes that while playing. Changes hold from the next step on; episodes under way go
    on, and new episodes leave the assignment as it is. A policy is asked once a step, for all of its tables together;
    the observations that it is given are valid until the next step. A policy with an attribute `stack` greater than 1
    is given that many of the last observations, each with the action that led to it, (n, stack, 15): see `Policy`.

    ```python
    envs = gymnasium.make_vec("AirHockey-v0", num_envs=4096, opponent=["striker", old_policy]).unwrapped
    observations, infos = envs.reset(seed=0)
    place = envs.pool.add(new_policy)
    envs.pool.assign(np.random.default_rng(0).integers(place + 1, size=4096))
    envs.pool.assign(place, tables=[0, 1, 2])  # the new one, on these
    envs.pool.replace(1, newer_policy)  # in place of old_policy, wherever that plays
    envs.pool.set_skill(0.5, tables=[3])
    ```

    A saved state (`get_state`) keeps the table's place in the pool and its skill, not the player: when it is put back,
    the table is assigned that place again, and is played by whoever has it then.

    A seat that the caller plays has an empty pool, which cannot be changed.

    Attributes:
        name: what errors call the players.
        by_caller: whether the caller plays this seat.
        asks: whether a policy plays on one of the tables.
        needs: what the players have to be shown.
        last_actions: (N, 2) what the policies answered in the last step, on the tables that they play.

    Args:
        name: what errors call the players, such as "opponent".
        seat: LEFT or RIGHT.
        members: the players, resolved; None if the caller plays.
        states: (N,) `STATE`, those of the game: it keeps who plays where.
        drivers: (2, N) int8, which scripted player drives each paddle; written.
        interface: what stands between the players of this seat and the table.
        threads: the game's, whose lock is held during changes.
    """

    def __init__(
        self,
        name: str,
        seat: int,
        members: list[str | Policy] | None,
        states: NDArray[np.void],
        drivers: NDArray[np.int8],
        interface: PlayerInterface,
        threads: Threads,
    ) -> None:
        self.name = name
        self.by_caller: bool = members is None
        self._seat = seat
        self._members = members or []
        self._states, self._drivers, self._interface, self._threads = states, drivers, interface, threads
        self._room = np.zeros((len(states), 2), np.float32)
        self.last_actions: NDArray[np.float32] = self._room
        self._groups: list[_Group] | None = None
        states["member"][:, seat] = np.arange(len(states)) % max(len(self._members), 1)
        self.refresh(None)

    @property
    def members(self) -> tuple[str | Policy, ...]:
        """The players, in the order of their places: names and policies; of a file, the policy in it."""
        return tuple(self._members)

    @property
    def indices(self) -> NDArray[np.int64]:
        """(N,) each table's player, as its place in the pool; a copy."""
        return self._states["member"][:, self._seat].astype(np.int64)

    @property
    def skill(self) -> NDArray[np.float64]:
        """(N,) the share of their paddle's speed that scripted players use; a copy."""
        return self._states["skill"][:, self._seat].copy()

    @one_at_a_time
    def assign(self, indices: ArrayLike, tables: ArrayLike | None = None) -> None:
        """Assign players to tables.

        Args:
            indices: places in the pool: one for each of the tables, (n,), or one for all of them.
            tables: (n,) numbers of tables, each once, or a mask (N,) of bool; None for all.

        Raises:
            ValueError: there are no such places or tables. Nothing has changed then.
        """
        self._check_changeable()
        rows = self._rows(tables)
        try:
            places = np.asarray(indices)
        except ValueError:  # lists of different lengths
            places = np.array(None)
        whole = places.dtype.kind in "iu" and places.shape in ((), rows.shape)
        if not whole or ((places < 0) | (places >= len(self._members))).any():
            allowed = f"places in the pool of {self.name}s, whole numbers from 0 to {len(self._members) - 1}"
            raise fault("indices", f"{allowed}: one place, or one for each of {len(rows)} tables", indices)
        self._states["member"][rows, self._seat] = places
        self.refresh(rows)

    @one_at_a_time
    def replace(self, index: int, player: Player) -> None:
        """Put another player in a place of the pool, on whatever tables that place plays.

        Raises:
            ValueError: there is no such place, or no such player. Nothing has changed then.
        """
        self._check_changeable()
        index = check_whole("index", index, 0, len(self._members) - 1)
        self._members[index] = resolve_player(self.name, player)
        self.refresh(None)

    @one_at_a_time
    def add(self, player: Player) -> int:
        """Add a player to the pool; its place, for `assign`. No table is assigned to it yet.

        Raises:
            ValueError: no such player. Nothing has changed then.
        """
        self._check_changeable()
        self._members.append(resolve_player(self.name, player))
        self.refresh(None)
        return len(self._members) - 1

    @one_at_a_time
    def set_skill(self, skill: ArrayLike, tables: ArrayLike | None = None) -> None:
        """Set the share of their paddle's speed that scripted players use.

        It belongs to the tables, not to the places in the pool: whoever is assigned to a table plays with its skill.

        Args:
            skill: 0 to 1: one for each of the tables, (n,), or one for all of them.
            tables: (n,) numbers of tables, each once, or a mask (N,) of bool; None for all.

        Raises:
            ValueError: the skill is out of range, or there are no such tables. Nothing has changed then.
        """
        rows = self._rows(tables)
        self._states["skill"][rows, self._seat] = check_skill(skill, len(rows), f"{self.name}_skill")

    def refresh(self, rows: NDArray[np.int64] | None) -> None:
        """Bring what follows from the members and the tables' places up to date, on the given tables or on all."""
        drivers = np.array([EXTERNAL] if self.by_caller else [driver_of(member) for member in self._members], np.int8)
        places = self._states["member"][:, self._seat]
        if rows is None:
            self._drivers[self._seat] = drivers[places]
        else:
            self._drivers[self._seat][rows] = drivers[places[rows]]
        self._groups = None  # made where they are needed
        self.asks: bool = not self.by_caller and bool((self._drivers[self._seat] == EXTERNAL).any())
        self.needs: Needs = Needs(self.observes, max(map(stack_of, self._members), default=1))

    @property
    def observes(self) -> bool:
        """Whether the players look at observations: the caller and policies do, scripted players do not."""
        return self.by_caller or self.asks

    def actions(self) -> NDArray[np.float32]:
        """Ask the policies for their actions, (N, 2) float32; rows of tables that scripted players play mean nothing.

        Raises:
            ValueError: a policy's actions have the wrong shape, or are not finite.
        """
        if self._groups is None:
            self._groups = self._make_groups()
        n, groups = len(self._room), self._groups
        if n >= 2 * ROWS_PER_THREAD and self._threads.num_threads > 1:
            # Not those derived from it, whose own way to act several threads may not take at once.
            self._ask_networks([group for group in groups if type(group.policy) is MlpPolicy])
            groups = [group for group in groups if type(group.policy) is not MlpPolicy]
        elif len(groups) == 1 and len(groups[0].seen) == n:
            group = groups[0]
            self.last_actions = check_velocities(group.name, group.policy(group.seen), (n, 2))
            return self.last_actions
        for group in groups:
            group.look()
            self._room[group.rows] = check_velocities(group.name, group.policy(group.seen), (len(group.seen), 2))
        self.last_actions = self._room
        return self.last_actions

    def _ask_networks(self, groups: list[_Group]) -> None:
        """Ask policies that several threads may ask at once: each thread takes some of the rows of one or more."""
        answers = [np.empty((len(group.seen), 2), np.float32) for group in groups]
        bounds = np.cumsum([0, *map(len, answers)])

        def ask(first: int, last: int) -> None:
            for group, answer, begin in zip(groups, answers, bounds, strict=False):
                part = slice(max(first - begin, 0), max(min(last - begin, len(answer)), 0))
                if part.start < part.stop:
                    group.look(part)
                    assert isinstance(group.policy, MlpPolicy)
                    group.policy.act(group.seen[part], answer[part])

        self._threads.share(int(bounds[-1]), ROWS_PER_THREAD, ask)
        for group, answer in zip(groups, answers, strict=True):
            self._room[group.rows] = check_velocities(group.name, answer, answer.shape)

    def _make_groups(self) -> list[_Group]:
        """The tables on which policies play, one group for each policy, in the order of the pool."""
        numbers: dict[int, int] = {}  # a policy may have several places
        group_of = np.full(len(self._members), -1, np.min_scalar_type(-1 - len(self._members)))  # small: sorts faster
        for place, member in enumerate(self._members):
            if driver_of(member) == EXTERNAL:
                group_of[place] = numbers.setdefault(id(policy_of(member)), len(numbers))
        groups_of_tables = group_of[self._states["member"][:, self._seat]]
        order = np.argsort(groups_of_tables, kind="stable")
        bounds = np.searchsorted(groups_of_tables[order], np.arange(len(numbers) + 1))
        groups = []
        for number in range(len(numbers)):
            rows = order[bounds[number] : bounds[number + 1]]
            if not len(rows):
                continue
            place = int(np.argmax(group_of == number))
            who = self.name if self.name == "opponent" else f"{self.name} player"
            name = f"the {who}'s actions" if len(self._members) == 1 else f"the actions of {who} {place}"
            policy = policy_of(self._members[place])
            stack = stack_of(policy)
            # All that is kept, of which the policy is shown the newest part: taking a part of it would copy it first.
            source = self._interface.seen(1 if stack == 1 else self._interface.rows)
            newest = slice(None) if stack == 1 else slice(-stack, None)
            if rows[-1] - rows[0] == len(rows) - 1:
                part = slice(int(rows[0]), int(rows[-1]) + 1)
                groups.append(_Group(policy, name, part, _read_only(source[part, newest]), source, None))
            else:
                copied = np.zeros((len(rows), *source.shape[1:]), np.float32)
                groups.append(_Group(policy, name, rows, _read_only(copied[:, newest]), source, copied))
        return groups

    def _rows(self, tables: ArrayLike | None) -> NDArray[np.int64]:
        n = len(self._states)
        return np.arange(n) if tables is None else check_rows("tables", tables, n)

    def _check_changeable(self) -> None:
        if self.by_caller:
            side = "left" if self._seat == LEFT else "right"
            raise ValueError(f"the caller plays the {side} paddle: there is no pool of players to change")

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_groups": None}  # made where they are needed: a copy would not keep their views

    def __deepcopy__(self, memo: dict[int, Any]) -> Pool:
        copied = type(self).__new__(type(self))
        memo[id(self)] = copied
        # Policies are shared: they are a caller's, and may not be copyable.
        members = {"_members": list(self._members)}
        others = {name: deepcopy(value, memo) for name, value in self.__getstate__().items() if name != "_members"}
        copied.__dict__.update(others, **members)
        return copied


class _Group(NamedTuple):
    """The tables on which one policy plays, and what it is shown of them."""

    policy: Policy
    name: str  # for errors
    rows: slice | NDArray[np.int64]  # n tables; a slice where they follow each other
    seen: NDArray[np.float32]  # (n, 13) or (n, stack, 15), read-only: a view of `source` with a slice, else of `copied`
    source: NDArray[np.float32]  # (N, 13) or (N, K, 15)
    copied: NDArray[np.float32] | None  # (n, 13) or (n, K, 15), filled in every step

    def look(self, part: slice = slice(None)) -> None:
        """Fill what is copied, or a part of it."""
        if self.copied is not None and not isinstance(self.rows, slice):
            # Other modes would copy twice.
            np.take(self.source, self.rows[part], axis=0, out=self.copied[part], mode="clip")


def _read_only(array: NDArray[np.float32]) -> NDArray[np.float32]:
    view = array.view()
    view.flags.writeable = False
    return view
