"""One table of a batch, for the interfaces that ask each table by name.

These are Stable-Baselines3's `get_attr` and `env_method`, and `call` of Gymnasium's vector environments.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium import Space
from numpy.typing import NDArray

from airhockey_env.checks import check_number
from airhockey_env.tables import TableSpec

if TYPE_CHECKING:
    from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv
    from airhockey_env.vector_env import AirHockeyVectorEnv


class TableView:
    """Table `i` of a batch: what an `AirHockeyEnv` has of its own, and its place in the pool of opponents.

    What concerns all tables at once (a step, the members of the pool) is not here; it is asked of the batch itself.
    """

    __slots__ = ("_batch", "_row")

    def __init__(self, batch: AirHockeyVectorEnv | AirHockeySB3VecEnv, row: int) -> None:
        self._batch, self._row = batch, row

    @property
    def unwrapped(self) -> TableView:
        """This view."""
        return self

    @property
    def metadata(self) -> dict[str, Any]:
        """The batch's."""
        return self._batch.metadata

    @property
    def render_mode(self) -> str | None:
        """The batch's."""
        return self._batch.render_mode

    @property
    def observation_space(self) -> Space[Any]:
        """The space of this table's observations."""
        return self._batch._spaces_of_a_table()[0]

    @property
    def action_space(self) -> Space[Any]:
        """The space of this table's actions."""
        return self._batch._spaces_of_a_table()[1]

    @property
    def table(self) -> TableSpec:
        """The `TableSpec` in play."""
        return self._batch._game.table_of(self._row)

    @property
    def positions(self) -> NDArray[np.float64]:
        """(3, 2) m, a copy: left paddle, right paddle, puck."""
        return self._batch._game.states["position"][self._row].copy()

    @property
    def velocities(self) -> NDArray[np.float64]:
        """(3, 2) m/s, a copy: left paddle, right paddle, puck."""
        return self._batch._game.states["velocity"][self._row].copy()

    @property
    def contacts(self) -> NDArray[np.void]:
        """As `AirHockeyEnv.contacts`."""
        return self._batch._game.contacts_of(self._row)

    @property
    def opponent_skill(self) -> float:
        """The share of its speed that a scripted opponent uses, 0 to 1."""
        return float(self._batch.pool.skill[self._row])

    @property
    def opponent_index(self) -> int:
        """The opponent, as its place in the pool."""
        return int(self._batch.pool.indices[self._row])

    def set_opponent_skill(self, skill: float) -> None:
        """As `AirHockeyEnv.set_opponent_skill`."""
        self._batch.set_opponent_skill(check_number("opponent_skill", skill, 0.0, 1.0), [self._row])

    def set_opponents(self, indices: int) -> None:
        """Assign an opponent to this table: its place in the pool."""
        self._batch.set_opponents(indices, [self._row])

    def get_state(self) -> NDArray[np.void]:
        """As `AirHockeyEnv.get_state`."""
        return self._batch.get_state([self._row])

    def set_state(self, state: NDArray[np.void]) -> None:
        """As `AirHockeyEnv.set_state`."""
        self._batch.set_state(state, [self._row])

    def observe(self) -> NDArray[Any]:
        """As `AirHockeyEnv.observe`, of the shape that the batch's observations have."""
        return self._batch.observe([self._row])[0]

    def render(self) -> Any:
        """This table's part of what the batch renders."""
        return self._batch._render_row(self._row)


NAMES = tuple(name for name in vars(TableView) if not name.startswith("_"))
"""What can be asked of a table."""


def of_tables(batch: AirHockeyVectorEnv | AirHockeySB3VecEnv, name: str, rows: Iterable[int]) -> list[Any]:
    """The attribute `name` of each of these tables.

    Raises:
        AttributeError: a table has none of this name.
    """
    if name not in NAMES:
        there = isinstance(name, str) and not name.startswith("_") and hasattr(type(batch), name)
        hint = f"; the batch has {name!r} for all tables together: ask env.unwrapped for it" if there else ""
        raise AttributeError(f"the attribute of a table must be one of {NAMES}, got {name!r}{hint}")
    return [getattr(TableView(batch, row), name) for row in rows]


def set_of_tables(
    batch: AirHockeyVectorEnv | AirHockeySB3VecEnv, name: str, values: list[Any], rows: NDArray[np.int64]
) -> None:
    """Set the attribute `name` of each of these tables; of none if one of the values will not do.

    Raises:
        AttributeError: it cannot be set.
        ValueError: a value will not do. Nothing has changed then.
    """
    if name != "opponent_skill":
        raise AttributeError(f"the attribute to set of a table must be 'opponent_skill', got {name!r}")
    batch.set_opponent_skill([check_number(name, value, 0.0, 1.0) for value in values], rows)
