"""Many tables at once for Gymnasium, natively: one compiled kernel plays the batch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium import Space, spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from airhockey_env._base import BatchEnv, warn_of_no_render_mode
from airhockey_env.cameras import Camera
from airhockey_env.checks import check_action_delay, check_seeds, check_skill, check_stack, check_whole
from airhockey_env.final_observations import FinalObservations
from airhockey_env.game import Game
from airhockey_env.kernel.state import LEFT
from airhockey_env.opponents.players import Player, resolve_players
from airhockey_env.spaces import action_space, observation_space
from airhockey_env.table_view import of_tables, set_of_tables
from airhockey_env.tables import TableSpec
from airhockey_env.threads import one_at_a_time


class AirHockeyVectorEnv(BatchEnv, VectorEnv):
    """`num_envs` tables of `AirHockeyEnv` (whose docstring is the specification), stepped together.

    The same seeds and actions give the same trajectories, to the bit, as single environments in a SyncVectorEnv.

    Args:
        num_envs: number of tables.
        max_episode_steps: steps after which an episode is truncated; None: those of the task's id; -1: no limit.
        autoreset_mode: `NEXT_STEP` (the default), `SAME_STEP` or `DISABLED`, as a `gymnasium.vector.AutoresetMode` or
            its value. With `DISABLED`, reset the tables that are done by `reset(options={"reset_mask": mask})`.
        num_threads: threads that share a large batch; None takes all cores that the process may use. The
            results do not depend on it.
        render_mode: None; `"rgb_array"`, with which `render()` returns a tuple of pictures, one for each table; or
            `"rgb_array_list"`, with which it returns a tuple of lists, the pictures of each table's episode since the
            last call, as with Gymnasium's `RenderCollection`.
        task, table, obs_type, continuous, reward, control_hz, randomize, render_size: as in `AirHockeyEnv`.
        camera, stack, action_delay_ms: as in `AirHockeyEnv`.
        opponent, opponent_skill: as in `AirHockeyEnv`. A callable opponent is asked once a step, for all tables.
            `opponent` may also be a sequence, a pool whose members share the tables and that can be changed while
            playing: see `pool`. `opponent_skill` may also be an array, one for each table.

    Infos have Gymnasium's vector form: `score` (num_envs, 2), `foul` and `is_success` (num_envs,), and with `randomize`
    `table`, each with its mask; with `SAME_STEP` also `final_obs` and `final_info`. The contacts of the last step are
    asked for: `contacts` and `n_contacts`.

    Observations, rewards, terminations and truncations are fresh arrays with every step.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012
        "render_modes": ["rgb_array", "rgb_array_list"],
        "render_fps": 50,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        num_envs: int = 1,
        *,
        max_episode_steps: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
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
            autoreset_mode=autoreset_mode,
            num_threads=num_threads,
        )
        self._set_up(game, render_mode, render_size, ("actions", "opponent"))
        self.autoreset_mode: AutoresetMode = game.autoreset_mode
        self._films: list[list[NDArray[np.uint8]]] = [
            [] for _ in range(num_envs if render_mode == "rgb_array_list" else 0)
        ]
        self.metadata["autoreset_mode"] = self.autoreset_mode
        self.num_envs: int = game.num_tables
        self.single_observation_space: spaces.Box = observation_space(game.obs_type, game.interfaces[LEFT].stack)
        self.single_action_space: spaces.Box | spaces.Discrete = action_space(game.continuous)
        self.observation_space: spaces.Space[Any] = batch_space(self.single_observation_space, self.num_envs)
        self.action_space: spaces.Space[Any] = batch_space(self.single_action_space, self.num_envs)

    @one_at_a_time
    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[NDArray[Any], dict[str, Any]]:
        """Begin an episode on every table, or on those of `options["reset_mask"]`.

        Args:
            seed: a seed for the first table, the next number for the second and so on; or one for each table, where
                None lets the table's random stream go on.
            options: those of `AirHockeyEnv.reset`, and `"reset_mask"`: (num_envs,) bool, at least one True.

        Raises:
            ValueError, TypeError: an option or seed is unknown or out of range. The state is as it was then.
        """
        mask = None
        if isinstance(options, Mapping):
            options = dict(options)
            mask = options.pop("reset_mask", None)
        mask = self._check_mask(mask)
        checked = self._game.check_reset_options(options)
        seeds = check_seeds(seed, self.num_envs)
        super().reset(seed=int(seed) if isinstance(seed, (int, np.integer)) else None)
        rows = np.flatnonzero(mask)
        self._game.seed(seeds, rows, lambda n: self.np_random.integers(2**63, size=n))
        self._game.begin(rows, checked)
        if self.render_mode == "rgb_array_list":
            self._film(began=mask, played=mask)
        return self._game.observations(), self._infos(mask)

    @one_at_a_time
    def step(
        self, actions: ArrayLike
    ) -> tuple[NDArray[Any], NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Play one control step on every table.

        Raises:
            ValueError: the actions have the wrong shape or are not finite. Nothing has changed then.
            gymnasium.error.ResetNeeded: no episode has begun; or, with `DISABLED`, one of them is over.
        """
        game, out = self._game, self._game.out
        game.step(actions)
        if self.render_mode == "rgb_array_list":
            self._film(began=out.began)
        infos = self._infos(None)
        if self.autoreset_mode == AutoresetMode.SAME_STEP:
            self._add_final(infos)
        return game.observations(), out.reward[LEFT].copy(), out.terminated.copy(), out.truncated.copy(), infos

    @one_at_a_time
    def render(self) -> tuple[Any, ...] | None:
        """A picture of every table, (height, width, 3) uint8, or a list of them; see `render_mode`."""
        if self.render_mode is None:
            warn_of_no_render_mode()
            return None
        return tuple(map(self._render_row, range(self.num_envs)))

    def _render_row(self, row: int) -> Any:
        if self.render_mode != "rgb_array_list":
            return super()._render_row(row)
        film, self._films[row] = self._films[row], []
        return film

    def _film(self, began: NDArray[np.bool_], played: NDArray[np.bool_] | None = None) -> None:
        """Take a picture of every table, or of those of `played`; where an episode `began`, the first of a new list."""
        for row in range(self.num_envs):
            if began[row]:
                self._films[row] = []
            if played is None or played[row]:
                self._films[row].append(super()._render_row(row))

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """An attribute of every table, or what a method returns for these arguments, as `SyncVectorEnv.call` gives it.

        A table has what is its own of an `AirHockeyEnv`, such as `positions`, `table` or `get_state`; see
        `airhockey_env.table_view.TableView`.

        Raises:
            AttributeError: a table has none of this name.
        """
        found = of_tables(self, name, range(self.num_envs))
        return tuple(one(*args, **kwargs) if callable(one) else one for one in found)

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """An attribute of every table; as `SyncVectorEnv.get_attr`.

        Raises:
            AttributeError: a table has none of this name.
        """
        return self.call(name)

    def set_attr(self, name: str, values: Any) -> None:
        """Set an attribute of every table (`"opponent_skill"` is the one that can be set); as `SyncVectorEnv.set_attr`.

        Args:
            name: of the attribute.
            values: a list or a tuple with one value for each table, or one value for all.

        Raises:
            AttributeError: it cannot be set.
            ValueError: a value will not do, or there are not as many as tables. Nothing has changed then.
        """
        each = list(values) if isinstance(values, (list, tuple)) else [values] * self.num_envs
        if len(each) != self.num_envs:
            raise ValueError(f"values must hold one value for each of {self.num_envs} tables, got {len(each)}")
        set_of_tables(self, name, each, np.arange(self.num_envs))

    def _spaces_of_a_table(self) -> tuple[Space[Any], Space[Any]]:
        return self.single_observation_space, self.single_action_space

    def close_extras(self, **arguments: Any) -> None:
        """End the threads of the batch."""
        if hasattr(self, "_game"):  # Gymnasium 1.2 closes what is deleted, even if making it raised an error
            self._game.close()

    def _infos(self, mask: NDArray[np.bool_] | None) -> dict[str, Any]:
        """Infos of all tables, or of those of the mask."""
        present = np.ones(self.num_envs, np.bool_) if mask is None else mask
        out = self._game.out
        foul, success = out.foul.copy(), out.success.copy()
        if mask is None and self.autoreset_mode == AutoresetMode.SAME_STEP:  # those of an episode's last step are final
            fresh = out.terminated | out.truncated
            foul[fresh] = success[fresh] = False
        return self._info_of(present, out.score.copy(), foul, success, self._game.randomized_values())

    def _info_of(
        self,
        present: NDArray[np.bool_],
        score: NDArray[np.int32],
        foul: NDArray[np.bool_],
        success: NDArray[np.bool_],
        drawn: dict[str, NDArray[np.float64]],
    ) -> dict[str, Any]:
        """Gymnasium's layout: every key with its mask, and nothing where the mask is not set."""
        everywhere = bool(present.all())
        values: dict[str, Any] = {"score": score, "foul": foul, "is_success": success}
        if not everywhere:
            for value in values.values():
                value[~present] = 0
        if drawn:
            values["table"] = {}
            for name, value in drawn.items():
                value[~present] = 0.0
                values["table"].update({name: value, f"_{name}": present.copy()})
        return {**values, **{f"_{name}": present.copy() for name in values}}

    def _add_final(self, infos: dict[str, Any]) -> None:
        """What the automatic reset in the same step has replaced."""
        out = self._game.out
        done = out.terminated | out.truncated
        if not done.any():
            return
        rows = np.flatnonzero(done)
        observations = np.full(self.num_envs, None, dtype=object).view(FinalObservations)
        finals = self._game.final_observations(rows)
        for row, final in zip(rows, finals, strict=True):
            observations[row] = final
        infos["final_obs"], infos["_final_obs"] = observations, done
        infos["final_info"] = self._info_of(
            done, out.final_score.copy(), out.foul.copy(), out.success.copy(), self._game.randomized_values(final=True)
        )
        infos["_final_info"] = done.copy()

    def _check_mask(self, mask: Any) -> NDArray[np.bool_]:
        """As Gymnasium's SyncVectorEnv checks it; but arrays of other libraries, which JaxToNumpy gives, will do."""
        if mask is None:
            return np.ones(self.num_envs, np.bool_)
        if hasattr(mask, "__array__"):
            mask = np.asarray(mask)
        if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_:
            raise TypeError(f"options['reset_mask'] must be an array of bool, got {mask!r}")
        if mask.shape != (self.num_envs,):
            raise ValueError(f"options['reset_mask'] must be of shape ({self.num_envs},), got {mask.shape}")
        if not mask.any():
            raise ValueError("options['reset_mask'] must hold at least one True, got none")
        return mask.copy()
