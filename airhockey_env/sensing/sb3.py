"""Cameras for Stable-Baselines3: a wrapper of its `VecEnv`, the same code behind it as behind those for Gymnasium."""

from __future__ import annotations

import inspect
from typing import Any

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper, VecNormalize

from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv
from airhockey_env.sensing.camera import Camera
from airhockey_env.sensing.sight import Sight, cameras_around, check_space, game_of


class CameraSB3Observation(VecEnvWrapper):
    """A camera between each table of a batch for Stable-Baselines3 and its player.

    Wraps an `AirHockeySB3VecEnv` with state observations, and other wrappers around it that leave the observations
    what they are. Sees the same, to the bit, as `CameraVectorObservation` on a batch with the same seeds.
    `terminal_observation` is what the camera knew too.

    Args:
        venv: the batch.
        **fields: of `Camera`.

    Raises:
        ValueError: a field of the camera is out of range, or the batch's observations are not its states.
        TypeError: a field is unknown, or the batch is not an `AirHockeySB3VecEnv`.
    """

    def __init__(self, venv: VecEnv, **fields: Any) -> None:
        self.camera = Camera(**fields)
        self._game = game_of(venv, AirHockeySB3VecEnv)
        check_space(venv.observation_space)
        inner = venv
        while isinstance(inner, VecEnvWrapper):
            if isinstance(inner, VecNormalize) and inner.norm_obs:  # the space does not show it
                raise ValueError("a camera looks at state observations: put it inside of VecNormalize, not around it")
            inner = inner.venv
        super().__init__(venv)
        self._sight = Sight(self.camera, self._game, cameras_around(venv, CameraSB3Observation))

    def reset(self) -> NDArray[np.float32]:
        """Begin an episode on every table: its first frame is seen at once. With the seeds of `seed`, if given."""
        seeds = list(self.unwrapped._seeds)  # which the reset uses up
        observations: Any = self.venv.reset()
        return self._sight.restart(np.ones(self.num_envs, np.bool_), seeds, observations, self._game)

    def step_async(self, actions: np.ndarray) -> None:
        """Take the actions of the next step."""
        self._sight.check_ready()
        self.venv.step_async(actions)

    def step_wait(self) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Play the step; the observations are what the camera knows after it."""
        observations: Any
        observations, rewards, dones, infos = self.venv.step_wait()
        if dones.any():
            finals = {i: infos[i]["terminal_observation"] for i in np.flatnonzero(dones).tolist()}
            seen = self._sight.finish(dones, observations, finals, self._game)
            for i, final in finals.items():
                infos[i]["terminal_observation"] = final
        else:
            seen = self._sight.follow(observations, self._game)
        return seen, rewards, dones, infos

    def __getstate__(self) -> dict[str, Any]:
        # Without this and __setstate__, Stable-Baselines3's __getattr__ asks itself for ever for what is not there yet.
        return {name: value for name, value in self.__dict__.items() if name != "class_attributes"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state, class_attributes=dict(inspect.getmembers(type(self))))
