"""Many tables at once for Stable-Baselines3: its `VecEnv`, straight over the batch."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.error import DependencyNotInstalled
from numpy.typing import NDArray

from airhockey_env.checks import check_seed
from airhockey_env.face import BatchFace
from airhockey_env.game import Game
from airhockey_env.players import Opponent, check_opponent
from airhockey_env.pool import OpponentPool
from airhockey_env.records import AUTORESET_SAME_STEP
from airhockey_env.spaces import action_space, observation_space

try:
    from stable_baselines3.common.vec_env import VecEnv
except ImportError as error:
    raise DependencyNotInstalled(
        'AirHockeySB3VecEnv needs Stable-Baselines3: pip install "airhockey-env[train]"'
    ) from error


class AirHockeySB3VecEnv(OpponentPool, BatchFace, VecEnv):
    """`num_envs` tables of `AirHockeyEnv` (whose docstring is the specification) as a Stable-Baselines3 `VecEnv`.

    Episodes restart in the step that ends them. The info of that step holds `terminal_observation`,
    `TimeLimit.truncated`, `score` and `is_success`; the infos of other steps are empty, so that a step of many tables
    does not make many objects. `VecMonitor` and the other wrappers of Stable-Baselines3 work on top.

    Pictures have an axis of channels, as Stable-Baselines3's `VecFrameStack` and `CnnPolicy` need it:
    `obs_type="grayscale"` gives (84, 84, 1) here.

    Args:
        num_envs: number of tables.
        max_episode_steps: steps after which an episode is truncated, or None.
        render_mode: None or `"rgb_array"`.
        render_size: as in `AirHockeyEnv`.
        opponent: as in `AirHockeyEnv`, or a sequence: a pool that the tables share and that can be changed while
            playing, see `OpponentPool`.
        **arguments: those of `AirHockeyEnv` and `num_threads`; `opponent_skill` may be an array, one for each table.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 50}  # noqa: RUF012

    def __init__(
        self,
        num_envs: int,
        *,
        opponent: Opponent | Sequence[Opponent] = "striker",
        max_episode_steps: int | None = 1500,
        render_mode: str | None = None,
        render_size: tuple[int, int] | None = None,
        **arguments: Any,
    ) -> None:
        game = Game(
            num_envs,
            opponent=check_opponent(opponent, several=True),
            max_episode_steps=max_episode_steps,
            autoreset=AUTORESET_SAME_STEP,
            **arguments,
        )
        self._show(game, render_mode, render_size)
        self._targets: NDArray[np.float32] | None = None
        space = observation_space(game.obs_type)
        if game.obs_type == "grayscale":
            space = spaces.Box(0, 255, (*space.shape, 1), np.uint8)
        super().__init__(game.num_tables, space, action_space(game.continuous))

    def reset(self) -> NDArray[Any]:
        """Begin an episode on every table; with the seeds of `seed` and the options of `set_options`, if given."""
        options = [self._game.check_reset_options(one) for one in self._options]
        if not self._seeded and self._seeds[0] is None:
            self.seed(int(np.random.SeedSequence().generate_state(1)[0]))
        self._game.seed(self._seeds)
        self._seeded = True
        for row, one in enumerate(options):
            self._game.reset(np.array([row]), one)
        self._reset_seeds()
        self._reset_options()
        self.reset_infos = [{} for _ in range(self.num_envs)]
        return self._with_channels(self._game.observations())

    def observe(self, indices: Any = None) -> NDArray[Any]:
        """As `AirHockeyVectorEnv.observe`; pictures have their axis of channels."""
        return self._with_channels(super().observe(indices))

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
            ValueError: of the wrong shape, or not finite. Nothing has changed then.
        """
        self._targets = self._game.check_actions(actions)

    def step_wait(self) -> tuple[NDArray[Any], NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Play the step."""
        if self._targets is None:
            raise RuntimeError("call step_async before step_wait")
        out = self._game.out
        targets, self._targets = self._targets, None
        self._game.step(targets)
        dones = out.terminated | out.truncated
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        rows = np.flatnonzero(dones)
        drawn = self._game.drawn(final=True)
        finals = (
            self._with_channels(self._game.shown(out.final_observation[rows], rows, final=True)) if len(rows) else ()
        )
        for i, final in zip(rows, finals, strict=True):
            score = out.final_score[i].copy()
            infos[i] = {
                "terminal_observation": final,
                "TimeLimit.truncated": bool(out.truncated[i]),
                "score": score,
                "is_success": bool(out.success[i]),
            }
            if self._game.randomized:
                infos[i]["table"] = {name: float(values[i]) for name, values in drawn.items()}
        return self._with_channels(self._game.observations()), out.reward.astype(np.float32), dones, infos

    def get_images(self) -> Sequence[np.ndarray | None]:
        """A picture of every table."""
        return self._pictures() or [None] * self.num_envs

    def close(self) -> None:
        """Nothing is held open."""

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute of the batch, once for each of the tables asked for."""
        return [getattr(self, attr_name) for _ in self._rows(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of the batch; the tables share it, so `indices` must be all of them."""
        if len(self._rows(indices)) != self.num_envs:
            raise ValueError(f"indices must be None: the tables share their attributes, got {indices!r}")
        setattr(self, attr_name, value)

    def env_method(self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any) -> list[Any]:
        """Call a method of the batch once; its result stands for each of the tables asked for."""
        result = getattr(self, method_name)(*method_args, **method_kwargs)
        return [result for _ in self._rows(indices)]

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:
        """No table is wrapped."""
        return [False for _ in self._rows(indices)]

    def _with_channels(self, observations: NDArray[Any]) -> NDArray[Any]:
        return observations[..., None] if self._game.obs_type == "grayscale" else observations

    def _rows(self, indices: Any) -> list[int]:
        chosen: Iterable[int] = self._get_indices(indices)
        return list(chosen)
