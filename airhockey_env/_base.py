"""What the environments have in common: a game, its geometry, its states, and pictures of it.

`TableEnv` is for those with one table, `BatchEnv` for those with many. Each environment adds the interface that is its
library's own.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import logger
from numpy.typing import ArrayLike, NDArray

from airhockey_env.checks import check_choice
from airhockey_env.drawing.window import human_window, import_pygame
from airhockey_env.game import Game
from airhockey_env.kernel.state import RIGHT
from airhockey_env.opponents.players import Player, Policy
from airhockey_env.opponents.pool import Pool
from airhockey_env.tables import TableSpec
from airhockey_env.threads import Threads, one_at_a_time


class GameEnv:
    """A game, and how it is drawn."""

    metadata: dict[str, Any]

    _one_table = False
    """Whether actions come without an axis of tables."""

    def _set_up(
        self, game: Game, render_mode: str | None, render_size: tuple[int, int] | None, names: tuple[str, str]
    ) -> None:
        """Be an environment of this game, whose errors call the left player's and the right player's part so.

        Raises:
            ValueError: the class's metadata do not have this mode, or the size is no size.
        """
        allowed = tuple(self.metadata["render_modes"])
        if render_mode is not None:
            check_choice("render_mode", render_mode, allowed, also="None")
        if render_mode == "human":
            import_pygame()  # or say what is missing
        self._game = game
        game.one_table, game.action_names, game.pools[RIGHT].name = self._one_table, names, names[1]
        self.render_mode = render_mode
        self.metadata = {**self.metadata, "render_fps": round(game.control_hz)}
        self._renderer = None if render_mode is None else make_renderer(game.spec, render_size)

    @property
    def _threads(self) -> Threads:
        return self._game._threads


class TableEnv(GameEnv):
    """What `AirHockeyEnv` and `AirHockeyParallelEnv` have in common."""

    _one_table = True
    _window: Any = None

    @property
    def table(self) -> TableSpec:
        """The table in play."""
        return self._game.table_of(0)

    @property
    def positions(self) -> NDArray[np.float64]:
        """(3, 2) m, a copy: left paddle, right paddle, puck; centred on the table, x along its length."""
        return self._game.positions[0]

    @property
    def velocities(self) -> NDArray[np.float64]:
        """(3, 2) m/s, a copy: left paddle, right paddle, puck."""
        return self._game.velocities[0]

    @property
    def contacts(self) -> NDArray[np.void]:
        """The contacts of the last step in the order of time, a copy: (n,) records, none after a reset or `set_state`.

        The fields: `time` (s into the step), discs `a` and `b` (0 left paddle, 1 right paddle, 2 puck; `b` = -1 for a
        wall or post), `x`, `y` (m), the unit normal `nx`, `ny` that points from b to a, and `impulse` (kg m/s). At most
        8 are kept, which only a squeezed puck exceeds.
        """
        return self._game.contacts_of(0)

    @one_at_a_time
    def get_state(self) -> NDArray[np.void]:
        """Everything that decides what happens next: (1,) record, random stream and clocks included."""
        return self._game.get_state()

    @one_at_a_time
    def set_state(self, state: NDArray[np.void]) -> None:
        """Go on from a state that `get_state` returned: what follows is the same to the bit.

        Raises:
            ValueError: not such a state. Nothing has changed then.
        """
        self._game.set_state(state)

    @one_at_a_time
    def render(self) -> NDArray[np.uint8] | None:
        """The picture as (height, width, 3) uint8 in `"rgb_array"` mode; shows it in a window in `"human"` mode."""
        if self._renderer is None:
            warn_of_no_render_mode()
            return None
        frame = draw_row(self._renderer, self._game, 0)
        if self.render_mode == "rgb_array":
            return frame
        if self._window is None:
            self._window = human_window((frame.shape[1], frame.shape[0]), self.metadata["render_fps"])
        self._window.show(frame)
        return None

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window is not None:
            self._window.close()
            self._window = None

    def _info_of(self, score: NDArray[np.int32], success: bool) -> dict[str, Any]:
        """What a player is told, who has this score."""
        game = self._game
        info: dict[str, Any] = {"score": score, "foul": game.out.foul.item(), "is_success": success}
        if game.randomized:
            info["table"] = {name: value[0] for name, value in game.randomized_values().items()}
        return info

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_window": None}  # a copy opens its own


class BatchEnv(GameEnv):
    """What `AirHockeyVectorEnv` and `AirHockeySB3VecEnv` have in common.

    `opponent` may be a sequence of players, whose members share the tables: see `pool`.
    """

    @property
    def pool(self) -> Pool:
        """The opponents, who can be changed while playing: see `airhockey_env.opponents.pool.Pool`."""
        return self._game.pools[RIGHT]

    @property
    def opponents(self) -> tuple[str | Policy, ...]:
        """As `pool.members`."""
        return self.pool.members

    @property
    def opponent_indices(self) -> NDArray[np.int64]:
        """As `pool.indices`."""
        return self.pool.indices

    @property
    def opponent_skill(self) -> NDArray[np.float64]:
        """As `pool.skill`."""
        return self.pool.skill

    def set_opponents(self, indices: ArrayLike, tables: ArrayLike | None = None) -> None:
        """As `pool.assign`."""
        self.pool.assign(indices, tables)

    def set_opponent(self, index: int, opponent: Player) -> None:
        """As `pool.replace`."""
        self.pool.replace(index, opponent)

    def add_opponent(self, opponent: Player) -> int:
        """As `pool.add`."""
        return self.pool.add(opponent)

    def set_opponent_skill(self, skill: ArrayLike, tables: ArrayLike | None = None) -> None:
        """As `pool.set_skill`."""
        self.pool.set_skill(skill, tables)

    @property
    def table(self) -> TableSpec | tuple[TableSpec, ...]:
        """The table in play; with `randomize`, one for each table."""
        game = self._game
        return tuple(map(game.table_of, range(game.num_tables))) if game.randomized else game.spec

    @property
    def positions(self) -> NDArray[np.float64]:
        """(num_envs, 3, 2) m, a copy: left paddle, right paddle, puck."""
        return self._game.positions

    @property
    def velocities(self) -> NDArray[np.float64]:
        """(num_envs, 3, 2) m/s, a copy: left paddle, right paddle, puck."""
        return self._game.velocities

    @property
    def contacts(self) -> NDArray[np.void]:
        """(num_envs, 8) records, a copy: the contacts of the last step, in each row in the order of time.

        The fields are those of `AirHockeyEnv.contacts`. The first `n_contacts[i]` of row i are contacts, the others are
        zeros. An automatic reset in the same step (`SAME_STEP`) leaves the contacts of the step that ended the episode.
        """
        return self._game.contacts()

    @property
    def n_contacts(self) -> NDArray[np.int32]:
        """(num_envs,) how many contacts of the last step `contacts` holds for each table, a copy."""
        return self._game.out.n_contacts.copy()

    @one_at_a_time
    def get_state(self, indices: ArrayLike | None = None) -> NDArray[np.void]:
        """Copies of everything that decides what happens next, for all tables or for some: (n,) records.

        Args:
            indices: (n,) numbers of tables, or a mask (num_envs,) of bool; None for all.

        Raises:
            ValueError: there are no such tables.
        """
        return self._game.get_state(indices)

    @one_at_a_time
    def set_state(self, state: NDArray[np.void], indices: ArrayLike | None = None) -> None:
        """Let all tables, or some, go on from states that `get_state` returned; the same to the bit.

        Args:
            state: (n,) records.
            indices: (n,) numbers of tables, each once, or a mask (num_envs,) of bool; None for all.

        Raises:
            ValueError: there are no such tables, or not states of as many. Nothing has changed then.
        """
        self._game.set_state(state, indices)

    @one_at_a_time
    def observe(self, indices: ArrayLike | None = None) -> NDArray[Any]:
        """Observations of all tables, or of some, as they are now, without a step: (n, ...), a fresh array.

        What `reset` or `step` returned or, after `set_state`, what they returned in that state.

        Args:
            indices: (n,) numbers of tables, or a mask (num_envs,) of bool; None for all.

        Raises:
            gymnasium.error.ResetNeeded: no episode has begun on one of these tables.
            ValueError: there are no such tables.
        """
        game = self._game
        rows = game.check_rows(indices, "indices", repeated=True)
        game.check_begun(rows)
        return game.observations(rows=None if indices is None else rows)

    def _render_row(self, row: int) -> Any:
        """What is rendered of one table, or None without a render_mode."""
        if self._renderer is None:
            warn_of_no_render_mode()
            return None
        return draw_row(self._renderer, self._game, row)


def warn_of_no_render_mode() -> None:
    """Say why there is nothing to see."""
    logger.warn("render() needs a render_mode: make the environment with render_mode='rgb_array'")


def make_renderer(spec: TableSpec, size: tuple[int, int] | None) -> Any:
    """A `Renderer`; imported here, so that playing without pictures does not load it."""
    from airhockey_env.drawing.render import Renderer

    return Renderer(spec, size)


def draw_row(renderer: Any, game: Game, i: int) -> NDArray[np.uint8]:
    """The picture of table i of a game."""
    spec = game.table_of(i)
    if renderer.table != spec:  # drawn for this episode
        renderer = make_renderer(spec, renderer.size)
    clock = int(game.states["side"][i]) * float(game.shot_clock[i])
    return renderer.draw(game.states["position"][i], score=tuple(game.out.score[i].tolist()), clock=clock)
