"""Many tables at once for Stable-Baselines3: its `VecEnv`, straight over the batch."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.error import DependencyNotInstalled
from gymnasium.vector import AutoresetMode
from numpy.typing import ArrayLike, NDArray

from airhockey_env._base import BatchEnv
from airhockey_env.cameras import Camera
from airhockey_env.checks import (
    as_whole,
    check_action_delay,
    check_choice,
    check_seed,
    check_skill,
    check_stack,
    check_whole,
    shown,
)
from airhockey_env.game import Game
from airhockey_env.kernel.state import LEFT
from airhockey_env.opponents.players import Player, resolve_players
from airhockey_env.reset_options import ResetOptions
from airhockey_env.spaces import action_space, observation_space
from airhockey_env.table_view import of_tables, set_of_tables
from airhockey_env.tables import FIELDS, TableSpec
from airhockey_env.threads import one_at_a_time

try:
    from stable_baselines3.common.vec_env import VecEnv
except ImportError as error:
    raise DependencyNotInstalled(
        'AirHockeySB3VecEnv needs Stable-Baselines3: pip install "airhockey-env[train]"'
    ) from error


class AirHockeySB3VecEnv(BatchEnv, VecEnv):
    """`num_envs` tables of `AirHockeyEnv` (whose docstring is the specification) as a Stable-Baselines3 `VecEnv`.

    Episodes restart in the step that ends them. The info of that step holds `terminal_observation`,
    `TimeLimit.truncated`, `score`, `foul` and `is_success`; the infos of other steps are empty, so that a step of many
    tables does not make many objects. `VecMonitor` and the other wrappers of Stable-Baselines3 work on top.

    `get_attr`, `set_attr` and `env_method` mean what they mean for a `DummyVecEnv` of `AirHockeyEnv` tables: they are
    about each table's own. What concerns the whole batch is called directly, through Stable-Baselines3's wrappers too.

    Pictures have an axis of channels, as Stable-Baselines3's `VecFrameStack` and `CnnPolicy` need it:
    `obs_type="grayscale"` gives (84, 84, 1) here, and with `stack=K` (K, 84, 84), where the pictures are the channels.

    Args:
        num_envs: number of tables.
        max_episode_steps: steps after which an episode is truncated; None: those of the task's id; -1: no limit.
        num_threads: threads that share a large batch; None takes all cores. The results do not depend on it.
        render_mode: None or `"rgb_array"`.
        task, table, obs_type, continuous, reward, control_hz, randomize, render_size: as in `AirHockeyEnv`.
        camera, stack, action_delay_ms: as in `AirHockeyEnv`.
        opponent, opponent_skill: as in `AirHockeyEnv`. `opponent` may also be a sequence, a pool whose members share
            the tables and that can be changed while playing: see `pool`. `opponent_skill` may also be an array, one
            for each table.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 50}  # noqa: RUF012

    def __init__(
        self,
        num_envs: int,
        *,
        max_episode_steps: int | None = None,
        num_threads: int | None = None,
        task: str = "point",
        opponent: Player | Sequence[Player] = "striker",
        opponent_skill: ArrayLike = 1.0,
        table: str | TableSpec | Mapping[str, float] = "full_size",
        obs_type: str = "state",
        continuous: bool = True,
        reward: str = "sparse",
        control_hz: float = 50,
        randomize: str | Mapping[str, tuple[float, float]] | None = None,
        camera: str | Camera | Mapping[str, Any] | None = None,
        stack: int = 1,
        action_delay_ms: float | Sequence[float] = 0,
        render_mode: str | None = None,
        render_size: tuple[int, int] | None = None,
    ) -> None:
        num_envs = check_whole("num_envs", num_envs, 1)
        game = Game(
            num_envs,
            task=task,
            table=table,
            right=resolve_players("opponent", opponent),
            right_skill=check_skill(opponent_skill, num_envs),
            obs_type=obs_type,
            continuous=continuous,
            reward=reward,
            control_hz=control_hz,
            randomize=randomize,
            camera=(camera, None),
            left_stack=check_stack("stack", stack),
            left_action_delay_ms=check_action_delay("action_delay_ms", action_delay_ms),
            max_episode_steps=max_episode_steps,
            autoreset_mode=AutoresetMode.SAME_STEP,
            num_threads=num_threads,
        )
        self._set_up(game, render_mode, render_size, ("actions", "opponent"))
        self._actions: np.ndarray | None = None
        self._empty: list[dict[str, Any]] = [{} for _ in range(num_envs)]  # infos of steps that end no episode
        space = observation_space(game.obs_type, game.interfaces[LEFT].stack)
        self._adds_channels = game.obs_type == "grayscale" and game.interfaces[LEFT].stack == 1
        if self._adds_channels:
            space = spaces.Box(0, 255, (*space.shape, 1), np.uint8)
        metadata = self.metadata
        super().__init__(game.num_tables, space, action_space(game.continuous))
        self.metadata = metadata  # which the constructor has replaced: VecVideoRecorder reads the rate of frames

    @one_at_a_time
    def reset(self) -> NDArray[Any]:
        """Begin an episode on every table; with the seeds of `seed` and the options of `set_options`, if given."""
        groups = self._option_groups()
        game = self._game
        if not game.seeded and self._seeds[0] is None:
            self.seed(int(np.random.SeedSequence().generate_state(1)[0]))
        if self._seeds[0] is not None:
            game.seed(self._seeds, game.check_rows(None), lambda n: np.random.SeedSequence().generate_state(n))
            self._reset_seeds()
        for rows, options in groups:
            game.begin(rows, options)
        if any(self._options):
            self._reset_options()
        return self._with_channels(self._game.observations())

    def _option_groups(self) -> list[tuple[NDArray[np.int64], ResetOptions]]:
        """The options of the next reset, checked, and the tables of each."""
        check = self._game.check_reset_options
        if not any(self._options):  # quickly
            return [(self._game.check_rows(None), check(None))]
        rows_of: dict[Any, list[int]] = {}
        checked: dict[Any, ResetOptions] = {}
        for row, given in enumerate(self._options):
            options = check(given)
            key = (options.serve, *(None if pair is None else tuple(pair.tolist()) for pair in options[1:]))
            checked[key] = options
            rows_of.setdefault(key, []).append(row)
        return [(np.array(rows), checked[key]) for key, rows in rows_of.items()]

    @property
    def reset_infos(self) -> list[dict[str, Any]]:
        """The infos of the tables' last resets, as `DummyVecEnv` keeps them; `{}` before the first one."""
        game = self._game
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        drawn = game.randomized_values()
        for i in np.flatnonzero(game.side):
            infos[i] = {"score": np.zeros(2, np.int32), "foul": False, "is_success": False}
            if game.randomized:
                infos[i]["table"] = {name: values[i] for name, values in drawn.items()}
        return infos

    @reset_infos.setter
    def reset_infos(self, infos: list[dict[str, Any]]) -> None:
        """They follow from the tables: the constructor of `VecEnv` sets what there is no need to keep."""

    @one_at_a_time
    def observe(self, indices: Any = None) -> NDArray[Any]:
        """As `AirHockeyVectorEnv.observe`; pictures have their axis of channels."""
        return self._with_channels(super().observe(indices))

    @one_at_a_time
    def exact_observations(self) -> NDArray[np.float32]:
        """The state observations (num_envs, 13) as they would be without a camera, whatever `obs_type` is.

        For what may know more than the agent while it trains: a teacher, or a critic.
        """
        return self._game.exact_observations(LEFT)

    def table_values(self, names: Sequence[str]) -> NDArray[np.float64]:
        """The values of these fields of the `TableSpec` in play on every table: (num_envs, len(names)).

        Raises:
            ValueError: there is no such field.
        """
        columns = [FIELDS.index(check_choice("names", name, FIELDS)) for name in names]
        specs = self._game.parameters["spec"][:, columns]
        return np.broadcast_to(specs, (self.num_envs, len(columns))).copy()

    def seed(self, seed: int | list[int] | tuple[int, ...] | None = None) -> Sequence[int | None]:
        """Seed the next reset: the first table with `seed`, the next with the number after it, and so on.

        Args:
            seed: as in Stable-Baselines3; or a list with one seed for each table.

        Raises:
            ValueError: not whole numbers from 0 up, or not one for each table. Nothing has changed then.
        """
        if not isinstance(seed, (list, tuple)):
            return super().seed(None if seed is None else check_seed(seed))
        if len(seed) != self.num_envs:
            raise ValueError(f"seed must hold one seed for each of {self.num_envs} tables, got {len(seed)}")
        self._seeds = [check_seed(one) for one in seed]
        return self._seeds

    def set_options(self, options: list[dict[str, Any]] | dict[str, Any] | None = None) -> None:
        """Options of the next reset: those of `AirHockeyEnv.reset`, for all tables, or a list with one for each.

        Raises:
            ValueError: one is unknown or out of range, or the list is too short or long. Nothing has changed then.
        """
        given = options if isinstance(options, list) else [options] * self.num_envs
        if len(given) != self.num_envs:
            raise ValueError(f"options must hold one dict for each of {self.num_envs} tables, got {len(given)}")
        for one in given:
            self._game.check_reset_options(one)
        super().set_options(options)

    def step_async(self, actions: np.ndarray) -> None:
        """Take the actions of the next step.

        Raises:
            ValueError: they have the wrong shape or are not finite. Nothing has changed then.
        """
        self._actions = self._game.check_actions(LEFT, actions)

    @one_at_a_time
    def step_wait(self) -> tuple[NDArray[Any], NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Play the step."""
        if self._actions is None:
            raise RuntimeError("call step_async before step_wait")
        out = self._game.out
        actions, self._actions = self._actions, None
        self._game.play(actions)
        dones = out.terminated | out.truncated
        # Thousands of new dicts in every step would take longer than the step, most of it in the garbage collector.
        self._empty = [info if not info else {} for info in self._empty]
        infos = self._empty.copy()
        rows = np.flatnonzero(dones)
        drawn = self._game.randomized_values(final=True)
        finals: Any = ()
        if len(rows):
            finals = self._with_channels(self._game.final_observations(rows))
        for i, final in zip(rows, finals, strict=True):
            score = out.final_score[i].copy()
            infos[i] = {
                "terminal_observation": final,
                "TimeLimit.truncated": bool(out.truncated[i]),
                "score": score,
                "foul": bool(out.foul[i]),
                "is_success": bool(out.success[i]),
            }
            if self._game.randomized:
                infos[i]["table"] = {name: values[i] for name, values in drawn.items()}
        return self._with_channels(self._game.observations()), out.reward[LEFT].astype(np.float32), dones, infos

    @one_at_a_time
    def get_images(self) -> Sequence[np.ndarray | None]:
        """A picture of every table; without a render_mode, a warning and None for every table."""
        if self.render_mode is None:
            warnings.warn("get_images() needs render_mode='rgb_array', got render_mode=None", stacklevel=2)
            return [None] * self.num_envs
        return [self._render_row(row) for row in range(self.num_envs)]

    def close(self) -> None:
        """End the threads of the batch."""
        self._game.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute of each of these tables, as `DummyVecEnv` has it of its environments.

        A table has what is its own of an `AirHockeyEnv`, such as `positions`, `table` or `opponent_skill`; see
        `airhockey_env.table_view.TableView`.

        Args:
            attr_name: its name.
            indices: number of a table, or numbers, counted from the end if negative; None for all.

        Raises:
            AttributeError: a table has none of this name.
            IndexError, TypeError: there are no such tables.
        """
        return of_tables(self, attr_name, self._rows(indices))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of each of these tables: `"opponent_skill"` is the one that can be set.

        Raises:
            AttributeError: it cannot be set.
            ValueError: the value will not do. Nothing has changed then.
            IndexError, TypeError: there are no such tables.
        """
        rows = np.unique(np.array(self._rows(indices), np.int64))
        set_of_tables(self, attr_name, [value] * len(rows), rows)

    def env_method(self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any) -> list[Any]:
        """Call a method of each of these tables, such as `set_opponent_skill`, `get_state` or `observe`.

        What concerns the whole batch, such as the members of the pool of opponents, is called directly:
        `VecMonitor(envs).set_opponent(0, policy)`.

        Raises:
            AttributeError: a table has no method of this name.
            IndexError, TypeError: there are no such tables.
        """
        methods = of_tables(self, method_name, self._rows(indices))
        return [method(*method_args, **method_kwargs) for method in methods]

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:
        """No table is wrapped."""
        return [False for _ in self._rows(indices)]

    def _with_channels(self, observations: NDArray[Any]) -> NDArray[Any]:
        return observations[..., None] if self._adds_channels else observations

    def _spaces_of_a_table(self) -> tuple[spaces.Space[Any], spaces.Space[Any]]:
        return self.observation_space, self.action_space

    def _rows(self, indices: Any) -> Sequence[int]:
        """Numbers of tables, from what Stable-Baselines3 allows for `indices`."""
        n = self.num_envs
        if indices is None:
            return range(n)
        given = indices if as_whole(indices) is None else [indices]
        if not isinstance(given, Iterable) or isinstance(given, (str, bytes)) or None in map(as_whole, given):
            raise TypeError(f"indices must be None, a whole number or several, got {shown(indices)}")
        rows = [int(row) for row in given]
        if not all(-n <= row < n for row in rows):
            raise IndexError(f"indices must be from {-n} to {n - 1}, got {shown(indices)}")
        return [row % n for row in rows]
