"""The game for a number of tables: arrays in, arrays out. Every face of the package is a thin layer over this."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from gymnasium.error import ResetNeeded
from numpy.typing import ArrayLike, NDArray

from airhockey_env.checks import (
    NO_LIMIT,
    check_directions,
    check_limit,
    check_number,
    check_rows,
    check_skill,
    check_velocities,
    check_whole,
)
from airhockey_env.compiled import machine_code, records
from airhockey_env.drawing.pixels import CHANNELS, Pixels
from airhockey_env.engine.records import CONTACT
from airhockey_env.kernel.parameters import physics_record, spec_of, with_spec
from airhockey_env.kernel.random_stream import stream_from_seed
from airhockey_env.kernel.scripted import EXTERNAL
from airhockey_env.kernel.state import (
    AUTORESET_DISABLED,
    CONTACT_ROWS,
    HOME,
    LEFT,
    OBSERVATION_SIZE,
    PHYSICS,
    PUCK,
    RIGHT,
    SETTINGS,
    TABLE,
)
from airhockey_env.kernel.step import refresh_rows, reset_rows, step_rows
from airhockey_env.kernel.tasks import TASKS
from airhockey_env.opponents.players import (
    Group,
    Opponent,
    Policy,
    answers_of,
    check_opponent,
    groups_of,
    member_of,
    number_of,
    pool_of,
    scripted,
)
from airhockey_env.reset_options import SERVERS, ResetOptions, check_reset_options
from airhockey_env.tables import FIELDS, TableSpec, check_randomize, resolve_table
from airhockey_env.threads import Threads

REWARDS = ("sparse", "shaped")
OBS_TYPES = ("state", *CHANNELS)
CONTROL_HZ = (10, 240)
ROWS_PER_THREAD = 1024
"""Fewer tables than this are not worth waking a thread for."""
PICTURES_PER_THREAD = 64
"""Nor fewer pictures than this."""

RANDOMIZED_TABLE = np.dtype([("table", TABLE), ("physics", PHYSICS)])
"""The state of a table whose physics is drawn anew for every episode."""


_FLOATS = tuple(name for name in TABLE.names or () if TABLE[name].base.kind == "f")


class Outputs(NamedTuple):
    """What the compiled step writes; allocated once."""

    observation: NDArray[np.float32]  # (N, 13) of the left players
    other_observation: NDArray[np.float32]  # (N, 13) of the right players, where these come from outside
    final_observation: NDArray[np.float32]  # (N, 13) what an automatic reset in the same step replaced
    score: NDArray[np.int32]  # (N, 2) left, right
    final_score: NDArray[np.int32]  # (N, 2) what an automatic reset in the same step replaced
    n_contacts: NDArray[np.int32]  # (N,) in the last step: the first so many of its row of `contacts`
    point: NDArray[np.int8]  # (N,) +1 if the left player scored in the last step, -1 if the right one did, else 0
    foul: NDArray[np.bool_]  # (N,) a shot clock ran out in the last step
    success: NDArray[np.bool_]  # (N,) the step ended the episode with success
    final_spec: NDArray[np.float64]  # (N, 15), where tables are drawn anew: PHYSICS' spec, likewise
    reward: NDArray[np.float64]  # (N,)
    other_reward: NDArray[np.float64]  # (N,) of the right players, where these come from outside
    terminated: NDArray[np.bool_]  # (N,)
    truncated: NDArray[np.bool_]  # (N,)
    contacts: NDArray[np.void]  # (N, CONTACT_ROWS) CONTACT


_step_code: list[Callable[..., None]] = []
"""The machine code of `step_rows`, once it is needed: its arguments are of the same types in every game."""


class Game:
    """Air hockey on `num_tables` tables at once.

    The arguments are those of `AirHockeyEnv`, where they are described; this is the one place that checks them. Beyond
    these, `player` names a scripted player for the left paddle in place of the caller's actions, and `opponent=None`
    lets the caller play the right paddle too: its observations lie in `out.other_observation`, its rewards in
    `out.other_reward`, its actions go to `step`.

    Opponents stand in a pool, of one or of a sequence of them. Every table is assigned a place in it: table i has the
    place i modulo the pool's size at first, whatever the number of tables, and `set_opponents` changes that while
    playing. A table's state keeps the place and the skill (see `set_state`), a new episode leaves them as they are.

    Attributes:
        spec: the `TableSpec` in play.
        obs_type: what `shown` makes of observations.
        pixels: draws them, or None.
        tables: (N,) records of `TABLE`: the whole state.
        out: `Outputs` of the last reset or step; overwritten by the next.
        answers: (N, 2) actions that policies from outside gave in the last step, on the tables that they play.
        ranges: (fields of a `TableSpec`, 2) least and greatest values of what is drawn anew, see `check_randomize`.
        opponents: the pool, a tuple; with `opponent=None`, empty.
    """

    def __init__(
        self,
        num_tables: int,
        *,
        table: str | TableSpec | Mapping[str, float] = "full_size",
        player: str | None = None,
        opponent: Opponent | Sequence[Opponent] | None = "striker",
        opponent_skill: ArrayLike = 1.0,
        obs_type: str = "state",
        continuous: bool = True,
        reward: str = "sparse",
        control_hz: float = 50,
        task: str = "point",
        points: int | None = None,
        max_episode_steps: int | None = NO_LIMIT,
        autoreset: int = AUTORESET_DISABLED,
        randomize: Mapping[str, Any] | None = None,
        num_threads: int | None = None,
    ) -> None:
        self.num_tables = check_whole("num_envs", num_tables, 1)
        self.spec = resolve_table(table)
        self._left = scripted("player", player)
        self._pool = pool_of(opponent)
        self._two_players = opponent is None
        if not isinstance(reward, str) or reward not in REWARDS:
            raise ValueError(f"reward must be one of {REWARDS}, got {reward!r}")
        if not isinstance(obs_type, str) or obs_type not in OBS_TYPES:
            raise ValueError(f"obs_type must be one of {OBS_TYPES}, got {obs_type!r}")
        self.obs_type = obs_type
        self.pixels = Pixels(obs_type) if obs_type in CHANNELS else None
        if not isinstance(continuous, (bool, np.bool_)):
            raise ValueError(f"continuous must be True or False, got {continuous!r}")
        self.continuous = bool(continuous)
        self.control_hz = check_number("control_hz", control_hz, *CONTROL_HZ)
        skill = check_skill(opponent_skill, self.num_tables)
        self.threads = Threads(None if num_threads is None else check_whole("num_threads", num_threads, 1))

        self.ranges = check_randomize(self.spec, {} if randomize is None else randomize)
        self.randomized = () if randomize is None else tuple(randomize)
        self.physics = physics_record(self.spec, self.control_hz)
        if self.randomized:
            self.physics = np.repeat(self.physics, self.num_tables)
        self.settings = records(1, SETTINGS)
        if not isinstance(task, str) or task not in TASKS:
            raise ValueError(f"task must be one of {sorted(TASKS)}, got {task!r}")
        self.settings["task"] = TASKS[task].number
        self.settings["points"] = TASKS[task].points if points is None else check_whole("points", points, 1)
        self.settings["max_steps"] = check_limit(max_episode_steps, TASKS[task].max_episode_steps)
        self.settings["shaped"] = reward == "shaped"
        self.settings["autoreset"] = autoreset
        self.settings["randomized"] = bool(self.randomized)

        n = self.num_tables
        self.tables = records(n, TABLE)
        self.tables["player"][:, LEFT] = self._left
        self.tables["opponent"] = np.arange(n) % len(self._pool)
        self.tables["skill"][:, 0] = 1.0
        self.tables["skill"][:, 1] = skill
        self.out = Outputs(
            observation=np.zeros((n, OBSERVATION_SIZE), np.float32),
            other_observation=np.zeros((n if self._two_players else 0, OBSERVATION_SIZE), np.float32),
            final_observation=np.zeros((n, OBSERVATION_SIZE), np.float32),
            score=np.zeros((n, 2), np.int32),
            final_score=np.zeros((n, 2), np.int32),
            n_contacts=np.zeros(n, np.int32),
            point=np.zeros(n, np.int8),
            foul=np.zeros(n, np.bool_),
            success=np.zeros(n, np.bool_),
            final_spec=np.zeros((n if self.randomized else 0, len(FIELDS)), np.float64),
            reward=np.zeros(n, np.float64),
            other_reward=np.zeros(n if self._two_players else 0, np.float64),
            terminated=np.zeros(n, np.bool_),
            truncated=np.zeros(n, np.bool_),
            contacts=records((n, CONTACT_ROWS), CONTACT),
        )
        self._others = np.zeros((n, 2), np.float32)
        self.answers = self._others
        self._all_rows = np.arange(n)
        self._autoreset = autoreset
        self.begun = False
        self._groups: list[Group] | None = None
        self._seat(self._all_rows)

    # What a caller does -----------------------------------------------------------------------------------------

    def seed(self, seeds: Sequence[int | None] | NDArray[np.int64]) -> None:
        """Start the random stream of every table whose seed is not None anew."""
        for i, seed in enumerate(seeds):
            if seed is not None:
                self.tables["stream"][i] = stream_from_seed(int(seed))

    def reset(self, rows: NDArray[np.int64] | None = None, options: ResetOptions | None = None) -> None:
        """Begin an episode on the given tables (all by default), with checked options."""
        rows = self._all_rows if rows is None else rows
        options = options or ResetOptions()
        sides = np.full(len(rows), SERVERS[options.serve], np.int64)
        reset_rows(rows, sides, self.tables, self.physics, self.settings, self.ranges, self.out)
        if options.puck_position is not None:
            self.tables["position"][rows, PUCK] = options.puck_position
            self.tables["position"][rows, LEFT] = -0.5 * HOME * self.spec.length, 0.0
            self.tables["side"][rows] = -1 if options.puck_position[0] < 0.0 else 1
        if options.puck_velocity is not None:
            speed = max(math.hypot(*options.puck_velocity), 1e-300)
            # The options were checked against the table that was asked for; a drawn one may allow less.
            share = np.minimum(1.0, self.physics["puck_speed"][rows] / speed) if self.randomized else 1.0
            self.tables["velocity"][rows, PUCK] = np.multiply.outer(share, options.puck_velocity)
        if options.puck_position is not None or options.puck_velocity is not None:
            refresh_rows(rows, self.tables, self.physics, self.settings, self.out)
        self._note_begun()

    def table_of(self, i: int) -> TableSpec:
        """The table in play number i."""
        return spec_of(self.physics[i]) if self.randomized else self.spec

    def drawn(self, final: bool = False) -> dict[str, NDArray[np.float64]]:
        """The values of the randomized fields, (N,) each; `final`: of the episodes that an automatic reset ended."""
        specs = self.out.final_spec if final else self.physics["spec"]
        return {name: specs[:, FIELDS.index(name)].copy() for name in self.randomized}

    def check_action(self, action: Any, name: str = "action") -> NDArray[np.float32]:
        """The action of a game on one table as (1, 2) float32; see `check_actions`. Errors call it `name`."""
        if not self.continuous:
            return check_directions(name, action, ())
        usual = isinstance(action, np.ndarray) and action.dtype == np.float32 and action.shape == (2,)
        if usual and action.flags.c_contiguous and math.isfinite(action[0]) and math.isfinite(action[1]):  # quickly
            return action.reshape(1, 2)
        return check_velocities(name, action, (2,)).reshape(1, 2)

    def check_actions(self, actions: ArrayLike) -> NDArray[np.float32]:
        """Actions as float32 target velocities (N, 2).

        Raises:
            ValueError: of another shape or kind than the action space's, or not finite.
        """
        n = self.num_tables
        if not self.continuous:
            return check_directions("actions", actions, (n,))
        return check_velocities("actions", actions, (n, 2))

    def step(self, targets: NDArray[np.float32], others: NDArray[np.float32] | None = None) -> None:
        """Play one step on all tables; the results lie in `out`.

        Args:
            targets: checked actions (see `check_actions`) of the left players.
            others: those of the right players, with `opponent=None`.
        """
        n = self.num_tables
        if not self.begun:
            raise ResetNeeded("reset every table before step")
        if self._autoreset == AUTORESET_DISABLED:
            done = self.tables["done"]
            if done[0] if n == 1 else done.any():
                raise ResetNeeded(
                    f"the episodes on tables {np.flatnonzero(done).tolist()} are over: reset them before step"
                )
        if others is None:
            others = self._ask() if self._asks else self._others
        self.threads.share(n, ROWS_PER_THREAD, self._step_rows, targets, others)

    @property
    def opponents(self) -> tuple[str | Policy, ...]:
        """The pool of opponents: names, and policies (those of files too); with `opponent=None`, empty."""
        return tuple(member for member in self._pool if member is not None)

    def set_opponents(self, indices: ArrayLike, tables: ArrayLike | None = None) -> None:
        """Assign opponents to tables, from the next step on; episodes under way go on.

        Args:
            indices: places in the pool: one for each of the tables, or one for all of them.
            tables: numbers of tables, each once, or a mask (N,) of bool; None for all.

        Raises:
            ValueError: there are no such places or tables. Nothing has changed then.
        """
        rows = self.check_rows(tables)
        try:
            places = np.asarray(indices)
        except ValueError:  # lists of different lengths
            places = np.array(None)
        whole = places.dtype.kind in "iu" and places.shape in ((), rows.shape)
        if not whole or ((places < 0) | (places >= len(self._pool))).any():
            raise ValueError(
                f"indices must be whole numbers from 0 to {len(self._pool) - 1}, places in the pool of opponents, one "
                f"or one for each of {len(rows)} tables; got {indices!r}"
            )
        self.tables["opponent"][rows] = places
        self._seat(rows)

    def set_opponent(self, index: int, opponent: Opponent) -> None:
        """Put another opponent in a place of the pool, on whatever tables that place plays, from the next step on.

        Raises:
            ValueError: there is no such place, or no such opponent. Nothing has changed then.
        """
        self._check_one_player()
        index = check_whole("index", index, 0, len(self._pool) - 1)
        self._pool[index] = member_of(check_opponent(opponent))
        self._seat(np.flatnonzero(self.tables["opponent"] == index))

    def add_opponent(self, opponent: Opponent) -> int:
        """Add an opponent to the pool; its place, for `set_opponents`. No table is assigned to it yet.

        Raises:
            ValueError: no such opponent. Nothing has changed then.
        """
        self._check_one_player()
        self._pool.append(member_of(check_opponent(opponent)))
        self._seat(self.check_rows([]))
        return len(self._pool) - 1

    def set_opponent_skill(self, skill: ArrayLike, tables: ArrayLike | None = None) -> None:
        """Set the share of their speed that scripted opponents use, from the next step on.

        It belongs to the tables, not to the places in the pool: whoever is assigned to a table plays with its skill.

        Args:
            skill: 0 to 1: one for each of the tables, or one for all of them.
            tables: numbers of tables, each once, or a mask (N,) of bool; None for all.

        Raises:
            ValueError: the skill is out of range, or there are no such tables. Nothing has changed then.
        """
        rows = self.check_rows(tables)
        self.tables["skill"][rows, 1] = check_skill(skill, len(rows))

    def check_begun(self, rows: NDArray[Any] | slice = slice(None)) -> None:
        """Whether there is anything to see on the given tables.

        Raises:
            ResetNeeded: no episode has begun on one of them.
        """
        if not self.tables["side"][rows].all():
            raise ResetNeeded("reset every table, or set its state, before observe")

    def observations(self) -> NDArray[Any]:
        """Fresh observations of the left players, as `obs_type` says: (N, ...)."""
        return self.shown(self.out.observation)

    def shown(
        self, observations: NDArray[np.float32], rows: NDArray[np.int64] | None = None, final: bool = False
    ) -> NDArray[Any]:
        """State observations (n, 13) of all tables, or of those numbered by `rows`, as `obs_type` says; a fresh array.

        float32 (n, 13), a copy; or pictures, uint8 (n, 84, 84, 3) or (n, 84, 84). `final`: these are observations that
        an automatic reset replaced, on tables that it may have drawn anew.
        """
        if self.pixels is None:
            return observations.copy()
        n = len(observations)
        physics = self.physics if rows is None or len(self.physics) == 1 else self.physics[rows]
        if final and self.randomized:
            physics = with_spec(physics, self.out.final_spec if rows is None else self.out.final_spec[rows])
        background = self.pixels.background(physics)
        frames = self.pixels.blank(n, again=rows is None)
        self.threads.share(n, PICTURES_PER_THREAD, self.pixels.draw, observations, physics, background, frames)
        return frames if frames.shape[-1] > 1 else frames[..., 0]

    def contacts(self) -> NDArray[np.void]:
        """The contacts of the last step, a copy: (N, CONTACT_ROWS) records of `CONTACT`.

        In row i the first `out.n_contacts[i]` are contacts, in the order of time, and the others are zeros.
        """
        contacts = np.array(self.out.contacts, CONTACT, subok=False)
        contacts[np.arange(CONTACT_ROWS) >= self.out.n_contacts[:, np.newaxis]] = 0
        return contacts

    def contacts_of(self, i: int) -> NDArray[np.void]:
        """The contacts of the last step on table i, in the order of time, a copy: (n,) records of `CONTACT`."""
        return np.array(self.out.contacts[i, : self.out.n_contacts[i]], CONTACT, subok=False)

    def get_state(self, indices: ArrayLike | None = None) -> NDArray[np.void]:
        """A copy of everything that decides what happens next on the given tables; None for all.

        Raises:
            ValueError: there are no such tables.
        """
        rows = self.check_rows(indices, "indices", repeated=True)
        if not self.randomized:
            return np.array(self.tables[rows])
        state = np.zeros(len(rows), RANDOMIZED_TABLE)
        state["table"], state["physics"] = self.tables[rows], self.physics[rows]
        return state

    def set_state(self, state: NDArray[np.void], indices: ArrayLike | None = None) -> None:
        """Put copied states back (or onto other tables): what follows is the same to the bit.

        A state keeps the opponent's place in the pool, not the opponent: its table is assigned that place again, and
        is played by whoever has it now. So a state that was saved before `set_opponents` brings back who played; one
        that was saved before `set_opponent` is played by the new one; and one of another game by this game's.

        Raises:
            ValueError: there are no such tables; not a state of as many tables, or none that they could be in, or of a
                larger pool of opponents. Nothing has changed then.
        """
        chosen = self.check_rows(indices, "indices")
        dtype = RANDOMIZED_TABLE if self.randomized else TABLE
        wrong = [type(state).__name__]
        if isinstance(state, np.ndarray):
            wrong = [f"shape {state.shape}"] if state.shape != chosen.shape else []
            wrong += ["another kind of record"] if state.dtype != dtype else []
        if wrong:
            raise ValueError(
                f"state must be what get_state returned, of shape {chosen.shape}; got {' and '.join(wrong)}"
            )
        table = state["table"] if self.randomized else state
        self._check_playable(table, state["physics"] if self.randomized else self.physics)
        places = table["opponent"]
        if ((places < 0) | (places >= len(self._pool))).any():
            raise ValueError(
                f"state must be of a game with no more opponents than this one's {len(self._pool)}, got one that is "
                f"played by number {places.max()} (counted from 0)"
            )
        moved = bool((places != self.tables["opponent"][chosen]).any())
        self.tables[chosen] = table
        if self.randomized:
            self.physics[chosen] = state["physics"]
        self.tables["player"][chosen, LEFT] = self._left
        if moved:
            self._seat(chosen)
        else:
            self.tables["player"][chosen, RIGHT] = self._numbers[places]
        self._note_begun()
        refresh_rows(chosen, self.tables, self.physics, self.settings, self.out)
        out = self.out  # nothing has happened yet in this state
        out.n_contacts[chosen], out.point[chosen], out.foul[chosen], out.success[chosen] = 0, 0, False, False

    # How it is done ---------------------------------------------------------------------------------------------

    def _note_begun(self) -> None:
        """Whether every table has begun an episode: a puck that was served is on a side."""
        self.begun = self.begun or bool(self.tables["side"].all())

    def _step_rows(self, first: int, last: int, targets: NDArray[np.float32], others: NDArray[np.float32]) -> None:
        fixed = (self.tables, self.physics, self.settings, self.ranges)
        if not _step_code:
            _step_code.append(machine_code(step_rows, first, last, *fixed, self._others, self._others, self.out))
        _step_code[0](first, last, *fixed, targets, others, self.out)

    def _seat(self, rows: NDArray[np.int64]) -> None:
        """Bring what follows from the pool, and from the places in it of the given tables, up to date."""
        self._numbers = np.array([number_of(member) for member in self._pool], np.int8)
        self.tables["player"][rows, RIGHT] = self._numbers[self.tables["opponent"][rows]]
        self._groups = None  # made where they are needed
        self._asks = not self._two_players and bool((self.tables["player"][:, RIGHT] == EXTERNAL).any())
        watched = bool(self.settings["both_sides"][0])
        self.settings["both_sides"] = self._asks or self._two_players
        if self._asks and not watched:
            n = self.num_tables
            if len(self.out.other_observation) != n:
                self.out = self.out._replace(
                    other_observation=np.zeros((n, OBSERVATION_SIZE), np.float32), other_reward=np.zeros(n)
                )
            # What the right-hand players see was not kept up to now.
            playing = np.flatnonzero(self.tables["side"])
            if not len(playing):
                return
            refresh_rows(playing, self.tables, self.physics, self.settings, self.out)

    def _ask(self) -> NDArray[np.float32]:
        """The actions of the opponents from outside."""
        observations = self.out.other_observation
        if self._groups is None:
            self._groups = groups_of(self._pool, self.tables["opponent"], observations)
        self.answers = answers_of(self._groups, observations, self._others)
        return self.answers

    def _check_one_player(self) -> None:
        if self._two_players:
            raise ValueError("the caller plays the right paddle (opponent=None): there is no pool of opponents")

    def _check_playable(self, table: NDArray[np.void], physics: NDArray[np.void]) -> None:
        """Raises ValueError unless tables could be in these states, under these physics, in this game."""
        for name in _FLOATS:
            if not np.isfinite(table[name]).all():
                raise ValueError(f"state must hold finite numbers, got another in {name!r}")
        if ((table["n_contacts"] < 0) | (table["n_contacts"] > CONTACT_ROWS)).any():
            raise ValueError(f"state must have 0 to {CONTACT_ROWS} contacts, got another number in 'n_contacts'")
        half = np.stack([physics["half_length"], physics["half_width"]], axis=-1)
        if not (np.abs(table["position"]) <= half[:, np.newaxis]).all():
            raise ValueError("state must have all discs on the table, got a 'position' off it")
        if self.randomized and (physics["tick"] != self.physics["tick"][0]).any():
            raise ValueError(f"state must be of a game at control_hz {self.control_hz}, as this one; got another's")

    def check_rows(self, tables: ArrayLike | None, name: str = "tables", repeated: bool = False) -> NDArray[np.int64]:
        """Numbers of tables, each once unless `repeated`, or a mask, or None for all; errors call them `name`."""
        return self._all_rows if tables is None else check_rows(name, tables, self.num_tables, repeated)

    def check_reset_options(self, options: Mapping[str, Any] | None) -> ResetOptions:
        """`options` of a reset, checked; see `AirHockeyEnv.reset`.

        Raises:
            ValueError: one is unknown or out of range.
        """
        return check_reset_options(options, self.spec, int(self.settings["task"][0]), bool(self.randomized))

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_groups": None}  # made where they are needed: a copy would not keep their views

    def __deepcopy__(self, memo: dict[int, Any]) -> Game:
        from copy import deepcopy

        copied = type(self).__new__(type(self))
        memo[id(self)] = copied
        # Policies from outside are shared: they are a caller's, and may not be copyable.
        copied.__dict__.update(
            {
                name: list(value) if name == "_pool" else deepcopy(value, memo)
                for name, value in self.__getstate__().items()
            }
        )
        return copied
