"""Cameras for Gymnasium environments: for one table and for a batch, the same compiled code behind both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.utils import RecordConstructorArgs
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper
from numpy.typing import NDArray

from airhockey_env.compiled import records
from airhockey_env.env import AirHockeyEnv
from airhockey_env.game import Game
from airhockey_env.sensing.camera import Camera
from airhockey_env.sensing.frames import ADVANCE, HOLD, LENS, RESTART, make_memory, sense_rows
from airhockey_env.spaces import observation_space
from airhockey_env.vector_env import AirHockeyVectorEnv


class _Sight:
    """What a camera sees of a number of tables.

    Args:
        camera: the camera.
        game: whose tables it looks at; read for its control rate here, and for its scales where an episode begins.
        depth: cameras that lie between this one and the game: each has random streams of its own.
    """

    def __init__(self, camera: Camera, game: Game, depth: int) -> None:
        n, control_hz = game.num_tables, game.control_hz
        lens = records(1, LENS)
        lens["control_hz"] = control_hz
        lens["camera_hz"] = control_hz if camera.camera_hz is None else camera.camera_hz
        lens["delay"] = camera.delay_ms * 1e-3 * control_hz
        lens["jitter"] = camera.jitter_ms * 1e-3 * control_hz
        lens["noise"] = camera.opponent_noise_mm * 1e-3, camera.noise_mm * 1e-3
        lens["dropout"] = camera.dropout
        lens["gap"] = camera.occlusion_mm * 1e-3
        lens["estimates"] = camera.velocity_frames is not None
        self._lens = lens
        self._memory = make_memory(n, lens, camera.velocity_frames or 1)
        self._depth = depth
        self._all = np.full(n, ADVANCE, np.int8)
        self._seeded = np.zeros(n, np.bool_)
        self._begun = np.zeros(n, np.bool_)
        self._ready = False

    def check_ready(self) -> None:
        """Raises ResetNeeded if the camera has not seen every table's episode begin."""
        if not self._ready:
            raise ResetNeeded("reset every table, through the camera's wrapper, before step")

    def restart(
        self, mask: NDArray[np.bool_], seeds: Sequence[int | None], observations: NDArray[np.float32], game: Game
    ) -> NDArray[np.float32]:
        """Begin an episode on the tables of the mask, with new random streams where there is a seed."""
        streams = self._memory.sights["stream"]
        for i in np.flatnonzero(mask).tolist():
            seed = seeds[i]
            if seed is not None or not self._seeded[i]:
                key = np.random.SeedSequence(seed, spawn_key=(1 + self._depth,))
                streams[i] = key.generate_state(1, np.uint64)[0]
        self._seeded |= mask
        self._begun |= mask
        self._ready = bool(self._begun.all())
        return self._look(np.where(mask, RESTART, HOLD).astype(np.int8), observations, game)

    def follow(
        self, observations: NDArray[np.float32], game: Game, begins: NDArray[np.bool_] | None = None
    ) -> NDArray[np.float32]:
        """Go one control step on, on all tables; on those of `begins` an episode begins with it."""
        tasks = self._all
        if begins is not None and begins.any():
            tasks = np.where(begins, RESTART, ADVANCE).astype(np.int8)
        return self._look(tasks, observations, game)

    def begin(self, mask: NDArray[np.bool_], observations: NDArray[np.float32], game: Game) -> NDArray[np.float32]:
        """Begin an episode on the tables of the mask in the step that ended one."""
        return self._look(np.where(mask, RESTART, HOLD).astype(np.int8), observations, game)

    def _look(self, tasks: NDArray[np.int8], observations: NDArray[np.float32], game: Game) -> NDArray[np.float32]:
        sense_rows(tasks, observations, game.physics, self._lens, self._memory)
        return self._memory.seen.copy()


class CameraObservation(gym.Wrapper, RecordConstructorArgs):
    """A camera between one table and its player.

    Wraps an `AirHockeyEnv` with state observations, and the wrappers of `gymnasium.make` or other cameras around it.
    The observation space stays what it is. `reset(seed=...)` starts the camera's random stream anew too.

    Args:
        env: the environment.
        **fields: of `Camera`.

    Raises:
        ValueError: a field of the camera is out of range, or the environment's observations are not its states.
        TypeError: a field is unknown, or the environment is not an `AirHockeyEnv`.
    """

    def __init__(self, env: gym.Env, **fields: Any) -> None:
        self.camera = Camera(**fields)
        RecordConstructorArgs.__init__(self, **fields)
        gym.Wrapper.__init__(self, env)
        self._game = _game(env, AirHockeyEnv)
        _check_space(env.observation_space)
        self._sight = _Sight(self.camera, self._game, _depth(env, CameraObservation))

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin an episode: its first frame is seen at once."""
        observation, info = self.env.reset(seed=seed, options=options)
        seeds = [None if seed is None else int(seed)]
        return self._sight.restart(np.ones(1, np.bool_), seeds, observation[None], self._game)[0], info

    def step(self, action: Any) -> tuple[NDArray[np.float32], Any, bool, bool, dict[str, Any]]:
        """Play one control step; the observation is what the camera knows after it."""
        self._sight.check_ready()
        observation, reward, terminated, truncated, info = self.env.step(action)
        return self._sight.follow(observation[None], self._game)[0], reward, terminated, truncated, info


class CameraVectorObservation(VectorWrapper, RecordConstructorArgs):
    """A camera between each table of a batch and its player.

    Wraps an `AirHockeyVectorEnv` with state observations, in any of the three autoreset modes, and other wrappers
    around it that leave the observations what they are. Table i sees the same, to the bit, as `CameraObservation` on
    one table with its seed, whatever the size of the batch. `final_obs` is what the camera knew too.

    Args:
        env: the environment.
        **fields: of `Camera`.

    Raises:
        ValueError: a field of the camera is out of range, or the environment's observations are not its states.
        TypeError: a field is unknown, or the environment is not an `AirHockeyVectorEnv`.
    """

    def __init__(self, env: VectorEnv, **fields: Any) -> None:
        self.camera = Camera(**fields)
        RecordConstructorArgs.__init__(self, **fields)
        VectorWrapper.__init__(self, env)
        self._game = _game(env, AirHockeyVectorEnv)
        _check_space(env.single_observation_space)
        self._sight = _Sight(self.camera, self._game, _depth(env, CameraVectorObservation))
        self._mode = AutoresetMode(env.metadata["autoreset_mode"])
        self._over = np.zeros(self.num_envs, np.bool_)

    def reset(
        self, *, seed: Any = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin an episode on every table, or on those of `options["reset_mask"]`; its first frame is seen at once."""
        n = self.num_envs
        mask = options.get("reset_mask") if isinstance(options, Mapping) else None
        chosen = np.ones(n, np.bool_) if mask is None else np.array(mask)
        observations, infos = self.env.reset(seed=seed, options=options)
        if seed is None:
            seeds: list[int | None] = [None] * n
        elif np.ndim(seed) == 0:
            seeds = [int(seed) + i for i in range(n)]
        else:
            seeds = [None if one is None else int(one) for one in seed]
        self._over = self._over & ~chosen
        return self._sight.restart(chosen, seeds, observations, self._game), infos

    def step(
        self, actions: Any
    ) -> tuple[NDArray[np.float32], NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Play one control step on every table; the observations are what the camera knows after it."""
        self._sight.check_ready()
        observations, rewards, terminated, truncated, infos = self.env.step(actions)
        over = terminated | truncated
        if self._mode == AutoresetMode.SAME_STEP and over.any():
            seen = self._finish(over, observations, infos)
        elif self._mode == AutoresetMode.NEXT_STEP:
            seen = self._sight.follow(observations, self._game, begins=self._over)
        else:
            seen = self._sight.follow(observations, self._game)
        self._over = over
        return seen, rewards, terminated, truncated, infos

    def _finish(
        self, over: NDArray[np.bool_], observations: NDArray[np.float32], infos: dict[str, Any]
    ) -> NDArray[np.float32]:
        """See the ends of the episodes that are over, and then the beginnings of the next."""
        rows = np.flatnonzero(over)
        ends = observations.copy()
        finals = infos["final_obs"]
        ends[rows] = np.stack([finals[i] for i in rows])
        seen = self._sight.follow(ends, self._game)
        for i in rows:
            finals[i] = seen[i].copy()
        return self._sight.begin(over, observations, self._game)


def sense(env: Any, camera: Camera) -> Any:
    """Put a camera between an environment, or a batch, and its player.

    Args:
        env: an `AirHockeyEnv` or `AirHockeyVectorEnv`, wrapped or not.
        camera: the camera, such as `ROBOT`.

    Returns:
        `CameraObservation` or `CameraVectorObservation` around it.

    Raises:
        ValueError: `camera` is not a `Camera`, or the environment's observations are not its states.
        TypeError: `env` is neither.
    """
    if not isinstance(camera, Camera):
        raise ValueError(f"camera must be a Camera, such as airhockey_env.sensing.ROBOT, got {camera!r}")
    wrapper = CameraVectorObservation if isinstance(env, VectorEnv) else CameraObservation
    return wrapper(env, **camera.fields())


def _game(env: Any, kind: type[Any]) -> Game:
    if not isinstance(env.unwrapped, kind):
        raise TypeError(
            f"the environment must be an {kind.__name__}, wrapped or not, got {env!r}; inside another vector "
            "environment, put the camera around each table"
        )
    return env.unwrapped._game


def _check_space(space: gym.Space) -> None:
    if space != observation_space():
        raise ValueError(
            f"a camera looks at state observations, {observation_space()}, got an environment with {space}: "
            "put it inside of wrappers that change the observations"
        )


def _depth(env: Any, kind: type) -> int:
    """Cameras around the environment so far."""
    depth = 0
    while env is not env.unwrapped:
        depth += isinstance(env, kind)
        env = env.env
    return depth
