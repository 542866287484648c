"""The game for a number of tables: arrays in, arrays out. Every environment here is a thin layer over it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode
from numpy.typing import ArrayLike, NDArray

from airhockey_env.cameras import Camera
from airhockey_env.checks import (
    NO_LIMIT,
    check_action_delay,
    check_choice,
    check_directions,
    check_limit,
    check_number,
    check_rows,
    check_seeds,
    check_skill,
    check_stack,
    check_velocities,
    check_whole,
    fault,
)
from airhockey_env.compiled import machine_code, records
from airhockey_env.drawing.pixels import CHANNELS, Pixels
from airhockey_env.engine.records import CONTACT
from airhockey_env.interface_parts import Tables
from airhockey_env.kernel.outputs import Outputs, make_outputs
from airhockey_env.kernel.parameters import make_parameters, spec_of, with_specs
from airhockey_env.kernel.random_stream import stream_from_seed
from airhockey_env.kernel.scripted import EXTERNAL
from airhockey_env.kernel.state import (
    AUTORESET_DISABLED,
    AUTORESET_NEXT_STEP,
    AUTORESET_SAME_STEP,
    CONTACT_ROWS,
    LEFT,
    RIGHT,
    SEATS,
    SETTINGS,
    STATE,
)
from airhockey_env.kernel.step import refresh_rows, reset_rows, step_rows
from airhockey_env.kernel.tasks import TASKS
from airhockey_env.opponents.players import Player, resolve_players
from airhockey_env.opponents.pool import Needs, Pool
from airhockey_env.player_interface import PlayerInterfaces
from airhockey_env.reset_options import SERVERS, ResetOptions, check_reset_options
from airhockey_env.saved_states import check_state, game_state, restore, save
from airhockey_env.tables import FIELDS, TableSpec, check_randomize, resolve_randomize, resolve_table
from airhockey_env.threads import Threads, one_at_a_time

_FLOAT32 = np.dtype(np.float32)

REWARDS = ("sparse", "shaped")
OBS_TYPES = ("state", *CHANNELS)
CONTROL_RATES = (10, 240)
"""Hz, least and greatest."""
ROWS_PER_THREAD = 4096
"""Fewer tables than this, which take a quarter of a millisecond, are not always worth waking a thread for."""

_AUTORESET = {
    AutoresetMode.DISABLED: AUTORESET_DISABLED,
    AutoresetMode.NEXT_STEP: AUTORESET_NEXT_STEP,
    AutoresetMode.SAME_STEP: AUTORESET_SAME_STEP,
}

Seat = Player | Sequence[Player] | None
"""Who plays a paddle: None for the caller, a player, or a pool of players, which share the tables."""

CameraLike = str | Camera | Mapping[str, Any]

_step_code: list[Callable[..., None]] = []
"""The machine code of `step_rows`, once it is needed: its arguments are of the same types in every game."""


class Game:
    """Air hockey on `num_tables` tables at once, for two players who can each be anybody.

    ```python
    from airhockey_env import LEFT, RIGHT, Game

    game = Game(4096, left=None, right="striker")
    game.reset(seed=0)
    for _ in range(100):
        actions = 5.0 * (game.out.observation[LEFT][:, 8:10] - game.out.observation[LEFT][:, 0:2])
        game.step(left=actions)
    print(game.out.reward[RIGHT].sum(), game.out.foul.any())
    ```

    With `left=None, right=None` the caller plays both paddles of every table: `game.step(left=..., right=...)`.

    The results of the last step or reset are in `out`, an `Outputs`, whose arrays the next one overwrites. The rules,
    the observations (N, 13), the actions (N, 2) and the rewards are those of `AirHockeyEnv`, whose docstring is their
    specification; each player sees the table from its own side.

    Args:
        num_tables: N, how many tables.
        left, right: who plays each paddle: None for the caller; the name of a player (`"idle"`, `"random"`,
            `"goalie"`, `"striker"`, and the trained `"adept"`, `"expert"` and `"robust"`); the path of a `policy.npz`
            or of a run's folder; a callable policy, from float32 observations (N, 13) to actions (N, 2); or a sequence
            of these, a pool whose members share the tables: see `Pool`.
        left_skill, right_skill: 0 to 1, the share of its paddle's speed that a scripted player uses: one number, or
            one for each table, (N,).
        camera: what the players see the game through: None for exact states; `"robot"`, a `Camera`, or a mapping of
            its fields, for each of the two; or a pair (left, right) of these. Scripted players look at exact states.
        left_stack, right_stack: how many observations, 1 to 64, `observations` gives of the player in that seat: with
            more than 1 each one with the action that led to it, (N, stack, 15), from the oldest on.
        left_action_delay_ms, right_action_delay_ms: 0 to 1000 ms by which the paddle obeys an action of the caller or
            of a policy in that seat late; or a range (low, high), from which each table draws for each episode.
            Scripted players, who look at exact states, act immediately.
        autoreset_mode: when the next episode of a table begins: an `AutoresetMode` of Gymnasium, or its value. With
            `DISABLED`, `reset` the tables that are done.
        max_episode_steps: steps after which an episode is truncated; None: those of the task's id; -1: no limit.
        points: points that win a match; None for the task's own.
        num_threads: threads that share a large number of tables; None takes all cores that the process may use. The
            results do not depend on it.
        task, table, obs_type, continuous, reward, control_hz, randomize: as in `AirHockeyEnv`.

    Raises:
        ValueError: an argument is out of range. The message names it.

    Attributes:
        out: `Outputs` of the last step or reset.
        pools: the pools of the left and of the right seat.
        interfaces: what stands between the players and the table.
        spec: the `TableSpec` in play; with `randomize`, the one that others are drawn around.
    """

    def __init__(
        self,
        num_tables: int,
        *,
        left: Seat = None,
        right: Seat = "striker",
        left_skill: ArrayLike = 1.0,
        right_skill: ArrayLike = 1.0,
        task: str = "point",
        table: str | TableSpec | Mapping[str, float] = "full_size",
        obs_type: str = "state",
        continuous: bool = True,
        reward: str = "sparse",
        control_hz: float = 50,
        randomize: str | Mapping[str, Any] | None = None,
        camera: CameraLike | Sequence[CameraLike | None] | None = None,
        left_stack: int = 1,
        right_stack: int = 1,
        left_action_delay_ms: float | Sequence[float] = 0,
        right_action_delay_ms: float | Sequence[float] = 0,
        points: int | None = None,
        max_episode_steps: int | None = NO_LIMIT,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        num_threads: int | None = None,
    ) -> None:
        self.num_tables: int = check_whole("num_tables", num_tables, 1)
        n = self.num_tables
        self.spec: TableSpec = resolve_table(table)
        self.obs_type: str = check_choice("obs_type", obs_type, OBS_TYPES)
        self.pixels: Pixels | None = Pixels(obs_type) if obs_type in CHANNELS else None
        if not isinstance(continuous, (bool, np.bool_)):
            raise fault("continuous", "True or False", continuous)
        self.continuous: bool = bool(continuous)
        self.control_hz: float = check_number("control_hz", control_hz, *CONTROL_RATES)
        self.autoreset_mode: AutoresetMode = _autoreset_mode(autoreset_mode)
        self._reset_by_hand = self.autoreset_mode is AutoresetMode.DISABLED
        self._threads = Threads(None if num_threads is None else check_whole("num_threads", num_threads, 1))
        ranges = resolve_randomize(randomize)
        self.ranges: NDArray[np.float64] = check_randomize(self.spec, {} if ranges is None else ranges)
        self.randomized: tuple[str, ...] = () if ranges is None else tuple(ranges)
        self.parameters: NDArray[np.void] = make_parameters(self.spec, self.control_hz)
        if self.randomized:
            self.parameters = np.repeat(self.parameters, n)
        self.settings: NDArray[np.void] = records(1, SETTINGS)
        self.settings["task"] = TASKS[check_choice("task", task, tuple(sorted(TASKS)))].number
        self.settings["points"] = TASKS[task].points if points is None else check_whole("points", points, 1)
        self.settings["max_steps"] = check_limit(max_episode_steps, TASKS[task].max_episode_steps)
        self.settings["shaped"] = check_choice("reward", reward, REWARDS) == "shaped"
        self.settings["autoreset"] = _AUTORESET[self.autoreset_mode]
        self.settings["randomized"] = bool(self.randomized)
        stacks = check_stack("left_stack", left_stack), check_stack("right_stack", right_stack)
        delays = (
            check_action_delay("left_action_delay_ms", left_action_delay_ms),
            check_action_delay("right_action_delay_ms", right_action_delay_ms),
        )

        self.states: NDArray[np.void] = records(n, STATE)
        self.states["skill"][:, LEFT] = check_skill(left_skill, n, "left_skill")
        self.states["skill"][:, RIGHT] = check_skill(right_skill, n, "right_skill")
        self.out: Outputs = make_outputs(n, bool(self.randomized))
        self._drivers = np.full((2, n), EXTERNAL, np.int8)
        tables = Tables(n, self.control_hz, self.parameters, self.settings, self._drivers, self.out)
        self.interfaces: PlayerInterfaces = PlayerInterfaces(tables, stacks, delays, camera)
        self.pools: tuple[Pool, Pool] = (self._make_pool("left", LEFT, left), self._make_pool("right", RIGHT, right))
        self._no_actions = np.zeros((n, 2), np.float32)
        self._all_rows = np.arange(n)
        self._needs: tuple[Needs, Needs] | None = None  # those of the two pools that were last seen to
        self._sent = self._no_actions, self._no_actions  # the actions of the last step
        self._see_to_needs()
        self.begun: bool = False
        self.seeded: bool = False
        self.action_names: tuple[str, str] = ("left", "right")
        """What errors call the actions of the two players."""
        self.plain: bool = self.pixels is None and stacks == (1, 1)
        """Whether `observations` are those in `out`."""
        self.one_table: bool = False
        """Whether actions come without an axis of tables, which a game on one table needs not have."""

    # What a caller does -----------------------------------------------------------------------------------------

    @one_at_a_time
    def reset(
        self,
        seed: int | Sequence[int | None] | None = None,
        tables: ArrayLike | None = None,
        options: Mapping[str, Any] | None = None,
    ) -> None:
        """Begin an episode on every table, or on some; what the players see then is in `out`.

        Args:
            seed: a seed for the first table, the next number for the second and so on; or one for each table (N,),
                where None lets the table's random stream go on. Without any, the first reset draws seeds.
            tables: (n,) numbers of tables, each once, or a mask (N,) of bool; None for all. Others keep their streams.
            options: those of `AirHockeyEnv.reset`.

        Raises:
            ValueError: a seed, table or option is unknown or out of range. Nothing has changed then.
        """
        rows = self.check_rows(tables)
        checked = self.check_reset_options(options)
        seeds = check_seeds(seed, self.num_tables)
        self.seed(seeds, rows, lambda n: np.random.SeedSequence().generate_state(n, np.uint64))
        self.begin(rows, checked)

    @one_at_a_time
    def step(self, left: ArrayLike | None = None, right: ArrayLike | None = None) -> None:
        """Play one control step on all tables; the results are in `out`.

        Args:
            left, right: (N, 2) actions of the players that the caller plays, or (N,) with `continuous=False`; for a
                seat that somebody else plays, None.

        Raises:
            ValueError: actions are missing, or there are some too many, or they have the wrong shape or are not finite.
                Nothing has changed then.
            gymnasium.error.ResetNeeded: no episode has begun on some table; or, with `DISABLED`, one is over.
        """
        left_actions, right_actions = self.check_actions(LEFT, left), self.check_actions(RIGHT, right)
        self.play(left_actions, right_actions)

    @property
    def positions(self) -> NDArray[np.float64]:
        """(N, 3, 2) m, a copy: left paddle, right paddle, puck; centred on the table, x along its length."""
        return self.states["position"].copy()

    @property
    def velocities(self) -> NDArray[np.float64]:
        """(N, 3, 2) m/s, a copy: left paddle, right paddle, puck."""
        return self.states["velocity"].copy()

    @property
    def done(self) -> NDArray[np.bool_]:
        """(N,) whether the episode is over and the next has not begun, a copy."""
        return self.states["done"] != 0

    @property
    def side(self) -> NDArray[np.int32]:
        """(N,) the side that the puck is on, -1 left, +1 right; 0 before the first episode; a copy."""
        return self.states["side"].copy()

    @property
    def shot_clock(self) -> NDArray[np.float64]:
        """(N,) the share of the shot clock that the side with the puck has used, 0 to 1."""
        return self.states["clock"] / self.parameters["clock_limit"][0]

    def table_of(self, i: int) -> TableSpec:
        """The table in play number i."""
        return spec_of(self.parameters[i]) if self.randomized else self.spec

    def randomized_values(self, final: bool = False) -> dict[str, NDArray[np.float64]]:
        """The values of the randomized fields, (N,) each; `final`: of the episodes that an automatic reset ended."""
        specs = self.out.final_spec if final else self.parameters["spec"]
        return {name: specs[:, FIELDS.index(name)].copy() for name in self.randomized}

    def observations(self, seat: int = LEFT, rows: NDArray[np.int64] | None = None) -> NDArray[Any]:
        """A player's observations as they are now, a fresh array: of all tables, or of those numbered by `rows`.

        float32 (N, 13), or with a stack of more than 1 (N, stack, 15); or pictures, see `obs_type`.

        Raises:
            ValueError: a scripted player plays that seat, who looks at no observations.
        """
        if not self.pools[seat].observes:
            raise fault("seat", "one that the caller or a policy plays, not a scripted player's", seat)
        self._see_to_needs()
        seen = self.interfaces[seat].seen()
        return self.as_observations(seen if rows is None else seen[rows], rows)

    def final_observations(self, rows: NDArray[np.int64], seat: int = LEFT) -> NDArray[Any]:
        """What a player saw at the end of the episodes that an automatic reset ended on the given tables, likewise."""
        return self.as_observations(self.interfaces[seat].seen(final=True)[rows], rows, final=True)

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

    @one_at_a_time
    def get_state(self, indices: ArrayLike | None = None) -> NDArray[np.void]:
        """Everything that decides what happens next on the given tables, a copy: (n,) records.

        Args:
            indices: (n,) numbers of tables, or a mask (N,) of bool; None for all.

        Raises:
            ValueError: there are no such tables.
        """
        rows = self.check_rows(indices, "indices", repeated=True)
        self._see_to_needs()
        return save(rows, self.states, self.parameters, bool(self.randomized), self.interfaces)

    @one_at_a_time
    def set_state(self, state: NDArray[np.void], indices: ArrayLike | None = None) -> None:
        """Put saved states back (or onto other tables): what follows is the same to the bit.

        A state keeps the player's place in the pool, not the player: its table is assigned that place again, and is
        played by whoever has it now.

        Args:
            state: (n,) records of `get_state`, of a game with these arguments.
            indices: (n,) numbers of tables, each once, or a mask (N,) of bool; None for all.

        Raises:
            ValueError: there are no such tables; not states of as many tables, or none that they could be in, or of a
                larger pool of players. Nothing has changed then.
        """
        rows = self.check_rows(indices, "indices")
        self._see_to_needs()
        check_state(state, rows.shape, self.parameters, bool(self.randomized), self.interfaces)
        members = game_state(state)["member"]
        for seat, pool in zip(SEATS, self.pools, strict=True):
            places = max(len(pool.members), 1)
            if ((members[:, seat] < 0) | (members[:, seat] >= places)).any():
                raise ValueError(
                    f"state must be of a game with no more {pool.name}s than this one's {places}, got one that is "
                    f"played by number {members[:, seat].max()} (counted from 0)"
                )
        moved = (members != self.states["member"][rows]).any(axis=0)
        restore(state, rows, self.states, self.parameters, bool(self.randomized), self.interfaces)
        for seat, pool in zip(SEATS, self.pools, strict=True):
            if moved[seat]:
                pool.refresh(rows)
        self.seeded = True
        self.begun = bool(self.states["side"].all())  # a state may be of before the first episode
        self._refresh(rows)
        out = self.out  # nothing has happened yet in this state
        out.n_contacts[rows], out.point[rows], out.foul[rows], out.success[rows] = 0, 0, False, False

    def close(self) -> None:
        """End the threads; they start again if they are needed again."""
        self._threads.close()

    # What the environments need besides -------------------------------------------------------------------------

    def seed(self, seeds: Sequence[int | None], rows: NDArray[np.int64], fresh: Callable[[int], NDArray[Any]]) -> None:
        """Start the random streams, those of the players' interfaces included, of the given tables that have a seed.

        Args:
            seeds: (N,) checked seeds, or None.
            rows: numbers of tables.
            fresh: draws so many seeds, where tables that have no stream yet are given none.
        """
        streams: dict[int, Any] = dict.fromkeys(range(self.num_tables) if not self.seeded else ())
        streams.update({i: seeds[i] for i in rows.tolist() if seeds[i] is not None or not self.seeded})
        missing = [i for i, seed in streams.items() if seed is None]
        if missing:
            drawn = fresh(self.num_tables).tolist()
            streams.update({i: drawn[i] for i in missing})
        for i, seed in streams.items():
            self.states["stream"][i] = stream_from_seed(int(seed))
            for part in self.interfaces.parts:
                part.seed(i, int(seed))
        self.seeded = True

    def begin(self, rows: NDArray[np.int64], options: ResetOptions) -> None:
        """Begin an episode on the given tables, with checked options."""
        sides = np.full(len(rows), SERVERS[options.serve], np.int64)
        given = (self.states, self.parameters, self.settings, self.ranges)
        reset_rows(rows, sides, options.puck(), *given, self.out)
        for part in self.interfaces.parts:
            part.start(rows)
        self.begun = self.begun or bool(self.states["side"].all())  # a puck that was served is on a side

    def check_actions(self, seat: int, given: Any) -> NDArray[np.float32]:
        """A player's actions as float32 target velocities (N, 2); nobody reads those of a seat of others.

        Raises:
            ValueError: they are missing, or of another shape or kind than the action space's, or not finite.
        """
        if not self.pools[seat].by_caller:
            if given is not None:
                raise fault(self.action_names[seat], "None, because the caller does not play this seat", given)
            return self._no_actions
        if (
            self.one_table
            and self.continuous
            and type(given) is np.ndarray
            and given.dtype == _FLOAT32
            and given.shape == (2,)
        ):
            x, y = given.tolist()
            if math.isfinite(x + y) and given.flags.c_contiguous:
                return given.reshape(1, 2)
        name, shape = self.action_names[seat], () if self.one_table else (self.num_tables,)
        if not self.continuous:
            return check_directions(name, given, shape)
        return check_velocities(name, given, (*shape, 2)).reshape(self.num_tables, 2)

    def play(self, left_actions: NDArray[np.float32], right_actions: NDArray[np.float32] | None = None) -> None:
        """Play one control step with checked actions; see `step`."""
        n = self.num_tables
        right_actions = self._no_actions if right_actions is None else right_actions
        if not self.begun:
            raise ResetNeeded("reset every table before step")
        if self._reset_by_hand:
            done = self.states["done"]
            if done[0] if n == 1 else done.any():
                over = np.flatnonzero(done).tolist()
                raise ResetNeeded(f"the episodes on tables {over} are over: reset them before step")
        left, right = self.pools
        if (left.needs, right.needs) != self._needs:
            self._see_to_needs()
        if left.asks:
            left_actions = left.actions()
        if right.asks:
            right_actions = right.actions()
        self._sent = left_actions, right_actions
        if n < 2 * ROWS_PER_THREAD:  # as `share` would, but asking it takes a tenth of one table's step
            self._step_rows(0, n, left_actions, right_actions)
        else:
            self._threads.share(n, ROWS_PER_THREAD, self._step_rows, left_actions, right_actions)

    def played_actions(self, seat: int) -> NDArray[np.float32]:
        """The target velocities (N, 2) that reached a seat's paddles in the last step, where the caller or a policy
        plays: what they sent, after the delay of actions."""
        delay = self.interfaces[seat].delay
        return self._sent[seat] if delay is None else delay.arrays.played

    def as_observations(
        self, observations: NDArray[np.float32], rows: NDArray[np.int64] | None = None, final: bool = False
    ) -> NDArray[Any]:
        """State observations of all tables, or of those numbered by `rows`, as `obs_type` says; a fresh array.

        A copy; or pictures of each observation (..., 13) or row of a stack (..., 15): uint8 (..., 84, 84, 3) or
        (..., 84, 84).

        Args:
            observations: float32 (n, 13), or (n, stack, 15).
            rows: numbers of these n tables.
            final: these are observations that an automatic reset replaced, on tables that it may have drawn again.
        """
        if self.pixels is None:
            return observations.copy()
        parameters = self.parameters if rows is None or len(self.parameters) == 1 else self.parameters[rows]
        if final and self.randomized:
            parameters = with_specs(parameters, self.out.final_spec if rows is None else self.out.final_spec[rows])
        return self.pixels.pictures(observations, parameters, self._threads, again=rows is None)

    def exact_observations(self, seat: int = LEFT) -> NDArray[np.float32]:
        """A player's state observations as they would be without a camera, a fresh array: (N, 13)."""
        if self.interfaces[seat].camera is None:
            return self.out.observation[seat].copy()
        exact = make_outputs(self.num_tables, bool(self.randomized))
        refresh_rows(self._all_rows, self.states, self.parameters, self.settings, exact)
        return exact.observation[seat]

    def check_begun(self, rows: NDArray[Any] | slice = slice(None)) -> None:
        """Raises ResetNeeded if no episode has begun on one of the given tables."""
        if not self.states["side"][rows].all():
            raise ResetNeeded("reset every table, or set its state, before observe")

    def check_rows(self, tables: ArrayLike | None, name: str = "tables", repeated: bool = False) -> NDArray[np.int64]:
        """Numbers of tables, each once unless `repeated`, or a mask, or None for all; errors call them `name`."""
        return self._all_rows if tables is None else check_rows(name, tables, self.num_tables, repeated)

    def check_reset_options(self, options: Mapping[str, Any] | None) -> ResetOptions:
        """`options` of a reset, checked; see `AirHockeyEnv.reset`.

        Raises:
            ValueError: one is unknown or out of range.
        """
        return check_reset_options(options, self.spec, int(self.settings["task"][0]), bool(self.randomized))

    def set_camera(self, camera: CameraLike | Sequence[CameraLike | None] | None) -> None:
        """Put other cameras, or none, before the players; `reset` every table afterwards.

        Raises:
            ValueError: no such camera.
        """
        self.interfaces.set_camera(camera)
        self.states["side"] = 0
        self.begun = self.seeded = False
        self._needs = None
        self._see_to_needs()

    # How it is done ---------------------------------------------------------------------------------------------

    def _make_pool(self, name: str, seat: int, players: Seat) -> Pool:
        members = None if players is None else resolve_players(name, players)
        return Pool(name, seat, members, self.states, self._drivers, self.interfaces[seat], self._threads)

    def _see_to_needs(self) -> None:
        """Work out, and remember, what those look at who play now, and nothing else."""
        needs = self.pools[LEFT].needs, self.pools[RIGHT].needs
        if needs == self._needs:
            return
        self._needs = needs
        before = self.settings["observed"][0].tolist()
        # Cameras and histories look on whoever plays: a policy that comes into the pool knows what it would know.
        observed = [needs[seat].observes or self.interfaces[seat].looks_on(needs[seat].stack) for seat in SEATS]
        self.settings["observed"] = observed
        if any(observed[seat] > before[seat] for seat in SEATS):
            begun = np.flatnonzero(self.states["side"])
            if len(begun):
                self._refresh(begun)
        self.interfaces.remember(needs[LEFT].stack, needs[RIGHT].stack)

    def _step_rows(self, first: int, last: int, left: NDArray[np.float32], right: NDArray[np.float32]) -> None:
        fixed = (self.states, self.parameters, self.settings, self.ranges, self._drivers)
        if not _step_code:
            _step_code.append(
                machine_code(step_rows, first, last, *fixed, self._no_actions, self._no_actions, self.out)
            )
        parts = self.interfaces.parts
        if not parts:
            _step_code[0](first, last, *fixed, left, right, self.out)
            return
        left_played = self.interfaces[LEFT].act(first, last, left)
        right_played = self.interfaces[RIGHT].act(first, last, right)
        _step_code[0](first, last, *fixed, left_played, right_played, self.out)
        for part in parts:
            part.follow(first, last, right if part.seat == RIGHT else left)

    def _refresh(self, rows: NDArray[np.int64]) -> None:
        """Bring the outputs of the given tables up to date after their states were changed from outside."""
        refresh_rows(rows, self.states, self.parameters, self.settings, self.out)
        for part in self.interfaces.parts:
            part.show(rows)


def _autoreset_mode(given: Any) -> AutoresetMode:
    try:
        return AutoresetMode(given)
    except ValueError as error:
        raise fault("autoreset_mode", f"one of {[mode.value for mode in AutoresetMode]}", given) from error
