"""Cameras for Gymnasium environments: for one table and for a batch, the same compiled code behind both."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils import RecordConstructorArgs
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper
from numpy.typing import NDArray

from airhockey_env.env import AirHockeyEnv
from airhockey_env.sensing.camera import Camera, resolve_camera
from airhockey_env.sensing.sight import Sight, cameras_around, check_space, game_of
from airhockey_env.vector_env import AirHockeyVectorEnv


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
        self._game = game_of(env, AirHockeyEnv)
        check_space(env.observation_space)
        self._sight = Sight(self.camera, self._game, cameras_around(env, CameraObservation))

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
        self._game = game_of(env, AirHockeyVectorEnv)
        check_space(env.single_observation_space)
        self._sight = Sight(self.camera, self._game, cameras_around(env, CameraVectorObservation))
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
            seen = self._sight.finish(over, observations, infos["final_obs"], self._game)
        elif self._mode == AutoresetMode.NEXT_STEP:
            seen = self._sight.follow(observations, self._game, begins=self._over)
        else:
            seen = self._sight.follow(observations, self._game)
        self._over = over
        return seen, rewards, terminated, truncated, infos


def sense(env: Any, camera: str | Camera | Mapping[str, Any]) -> Any:
    """Put a camera between an environment, or a batch, and its player.

    Args:
        env: an `AirHockeyEnv`, `AirHockeyVectorEnv` or `AirHockeySB3VecEnv`, wrapped or not.
        camera: `"robot"`, a `Camera`, or a mapping of its fields.

    Returns:
        `CameraObservation`, `CameraVectorObservation` or `airhockey_env.sensing.sb3.CameraSB3Observation` around it.

    Raises:
        ValueError: `camera` is none of these, or the environment's observations are not its states.
        TypeError: `env` is none of these.
    """
    fields = resolve_camera(camera).fields()
    if isinstance(env, VectorEnv):
        return CameraVectorObservation(env, **fields)
    if any(kind.__module__.startswith("stable_baselines3.") for kind in type(env).__mro__):  # without importing it
        from airhockey_env.sensing.sb3 import CameraSB3Observation

        return CameraSB3Observation(env, **fields)
    return CameraObservation(env, **fields)
