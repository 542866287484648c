"""The pool of opponents, as the faces for many tables show it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from airhockey_env.game import Game
from airhockey_env.opponents.players import Opponent, Policy
from airhockey_env.threads import one_at_a_time


class OpponentPool:
    """What `AirHockeyVectorEnv` and `AirHockeySB3VecEnv` have for a pool of opponents, whose members play in turn.

    `opponent` may be a sequence of opponents' names, paths of policies and callables. Table i is assigned the member i
    modulo the pool's size at first, whatever the number of tables; `set_opponents` changes that while playing. Every
    callable is asked once a step, for all of its tables together, and its observations are valid until the next step.

    ```python
    envs = gymnasium.make_vec("AirHockey-v0", num_envs=4096, opponent=["striker", old_policy]).unwrapped
    observations, infos = envs.reset(seed=0)
    place = envs.add_opponent(new_policy)
    envs.set_opponents(np.random.default_rng(0).integers(place + 1, size=4096))
    envs.set_opponents(place, tables=[0, 1, 2])  # the new one, on these
    envs.set_opponent(1, newer_policy)  # in place of old_policy, wherever that plays
    envs.set_opponent_skill(0.5, tables=[3])
    ```

    Changes hold from the next step on, and new episodes leave them as they are. A saved state (`get_state`) keeps the
    table's place in the pool and its skill, not the opponent itself: when it is put back, the table is assigned that
    place again, and is played by whoever has it then. A state of a larger pool than this one is refused.
    """

    _game: Game

    @property
    def opponents(self) -> tuple[str | Policy, ...]:
        """The pool: names and callables; of a file, the policy in it."""
        return self._game.opponents

    @property
    def opponent_indices(self) -> NDArray[np.int64]:
        """(num_envs,) each table's opponent, as its place in the pool; a copy."""
        return np.array(self._game.tables["opponent"])

    @property
    def opponent_skill(self) -> NDArray[np.float64]:
        """(num_envs,) the share of their speed that scripted opponents use; a copy."""
        return np.array(self._game.tables["skill"][:, 1])

    @one_at_a_time
    def set_opponents(self, indices: ArrayLike, tables: ArrayLike | None = None) -> None:
        """Assign opponents to tables, from the next step on; episodes under way go on.

        Args:
            indices: places in the pool: one for each of the tables, (n,), or one for all of them.
            tables: (n,) numbers of tables, each once, or a mask (num_envs,) of bool; None for all.

        Raises:
            ValueError: there are no such places or tables. Nothing has changed then.
        """
        self._game.set_opponents(indices, tables)

    @one_at_a_time
    def set_opponent(self, index: int, opponent: Opponent) -> None:
        """Put another opponent in a place of the pool, on whatever tables that place plays, from the next step on.

        Raises:
            ValueError: there is no such place, or no such opponent. Nothing has changed then.
        """
        self._game.set_opponent(index, opponent)

    @one_at_a_time
    def add_opponent(self, opponent: Opponent) -> int:
        """Add an opponent to the pool; its place, for `set_opponents`. No table is assigned to it yet.

        Raises:
            ValueError: no such opponent. Nothing has changed then.
        """
        return self._game.add_opponent(opponent)

    @one_at_a_time
    def set_opponent_skill(self, skill: ArrayLike, tables: ArrayLike | None = None) -> None:
        """Set the share of their speed that scripted opponents use, from the next step on.

        It belongs to the tables, not to the places in the pool: whoever is assigned to a table plays with its skill.

        Args:
            skill: 0 to 1: one for each of the tables, (n,), or one for all of them.
            tables: (n,) numbers of tables, each once, or a mask (num_envs,) of bool; None for all.

        Raises:
            ValueError: the skill is out of range, or there are no such tables. Nothing has changed then.
        """
        self._game.set_opponent_skill(skill, tables)
