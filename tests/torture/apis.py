"""The faces of the game, all alike: every table's share of a step or a reset in a dict of its own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from airhockey_env import AirHockeyEnv, AirHockeyVectorEnv
from airhockey_env.parallel_env import AirHockeyParallelEnv
from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv

Seen = dict[str, Any]
"""What one table's player is told of a step or reset; None where the face does not say."""


class SingleFace:
    """`AirHockeyEnv`."""

    mode = AutoresetMode.DISABLED

    def __init__(self, arguments: dict[str, Any]) -> None:
        self.env: Any = AirHockeyEnv(**arguments)
        self.num_envs = 1

    @staticmethod
    def reward(value: float) -> float:
        """A reward, as this face gives it."""
        return float(value)

    def reset(self, seed: Any, options: Any, mask: Any) -> list[Seen]:
        """Begin an episode on every table, or on those of a mask."""
        observation, info = self.env.reset(seed=seed, options=options)
        return [{"observation": observation, "score": info["score"]}]

    def step(self, actions: Any, others: Any = None) -> list[Seen]:
        """Play a step with good actions."""
        observation, reward, terminated, truncated, info = self.env.step(actions[0])
        return [_seen(observation, reward, terminated, truncated, info["score"], info["is_success"])]

    def bad_step(self, value: Any) -> object:
        """Play a step with what should be refused."""
        return self.env.step(value)

    def observe(self) -> list[Any]:
        """What is to be seen now."""
        return [self.env.observe()]

    def pictures(self) -> Sequence[Any]:
        """Pictures of all tables."""
        return [self.env.render()]


class VectorFace(SingleFace):
    """`AirHockeyVectorEnv`."""

    def __init__(self, arguments: dict[str, Any]) -> None:
        self.env = AirHockeyVectorEnv(**arguments)
        self.mode = self.env.autoreset_mode
        self.num_envs = self.env.num_envs

    def reset(self, seed: Any, options: Any, mask: Any) -> list[Seen]:
        if mask is not None:
            options = {**(options or {}), "reset_mask": mask}
        observations, infos = self.env.reset(seed=seed, options=options)
        return [{"observation": observations[i], "score": infos["score"][i]} for i in range(self.num_envs)]

    def step(self, actions: Any, others: Any = None) -> list[Seen]:
        observations, rewards, terminated, truncated, infos = self.env.step(actions)
        seen = []
        for i in range(self.num_envs):
            score, success, final = infos["score"][i], infos["is_success"][i], None
            if "final_info" in infos and infos["_final_info"][i]:
                told = infos["final_info"]
                score, success, final = told["score"][i], told["is_success"][i], infos["final_obs"][i]
            seen.append(_seen(observations[i], rewards[i], terminated[i], truncated[i], score, success, final))
        return seen

    def observe(self) -> list[Any]:
        return list(self.env.observe())

    def pictures(self) -> Sequence[Any]:
        return self.env.render()


class SB3Face(VectorFace):
    """`AirHockeySB3VecEnv`."""

    mode = AutoresetMode.SAME_STEP

    def __init__(self, arguments: dict[str, Any]) -> None:
        self.env = AirHockeySB3VecEnv(**arguments)
        self.num_envs = self.env.num_envs

    @staticmethod
    def reward(value: float) -> float:
        """A reward, as this face gives it."""
        return float(np.float32(value))

    def reset(self, seed: Any, options: Any, mask: Any) -> list[Seen]:
        try:
            if options is not None:
                self.env.set_options(options)
            if seed is not None:
                self.env.seed(seed)
            return [{"observation": self._flat(one)} for one in self.env.reset()]
        except BaseException:  # what was taken already is not for the next reset
            self.env._reset_options()
            self.env._reset_seeds()
            raise

    def step(self, actions: Any, others: Any = None) -> list[Seen]:
        observations, rewards, dones, infos = self.env.step(np.asarray(actions))
        seen = []
        for i, info in enumerate(infos):
            truncated = info.get("TimeLimit.truncated", False)
            final = self._flat(info["terminal_observation"]) if dones[i] else None
            observation = self._flat(observations[i])
            over = bool(dones[i]) and not truncated
            score, success = info.get("score"), info.get("is_success")
            seen.append(_seen(observation, rewards[i], over, truncated, score, success, final))
        return seen

    def observe(self) -> list[Any]:
        return [self._flat(one) for one in self.env.observe()]

    def pictures(self) -> Sequence[Any]:
        return self.env.get_images()

    @staticmethod
    def _flat(observation: NDArray[Any]) -> NDArray[Any]:
        """Without the axis of channels of a grey picture."""
        return observation[..., 0] if observation.shape[-1] == 1 else observation


class ParallelFace(SingleFace):
    """`AirHockeyParallelEnv`: both players are the caller's."""

    def __init__(self, arguments: dict[str, Any]) -> None:
        self.env = AirHockeyParallelEnv(**arguments)
        self.num_envs = 1

    def reset(self, seed: Any, options: Any, mask: Any) -> list[Seen]:
        observations, infos = self.env.reset(seed=seed, options=options)
        other = {"other_observation": observations["right"]}
        return [{"observation": observations["left"], "score": infos["left"]["score"], **other}]

    def step(self, actions: Any, others: Any = None) -> list[Seen]:
        told = self.env.step({"left": actions[0], "right": others[0]})
        observation, reward, terminated, truncated, info = (one["left"] for one in told)
        seen = _seen(observation, reward, terminated, truncated, info["score"], info["is_success"])
        return [{**seen, "other_observation": told[0]["right"], "other_reward": float(told[1]["right"])}]

    def bad_step(self, value: Any) -> object:
        return self.env.step({"left": value, "right": value})

    def observe(self) -> list[Any]:
        return [self.env.observe()["left"]]


def _seen(
    observation: Any, reward: Any, terminated: Any, truncated: Any, score: Any, success: Any, final: Any = None
) -> Seen:
    return {
        "observation": observation,
        "reward": float(reward),
        "terminated": bool(terminated),
        "truncated": bool(truncated),
        "score": score,
        "is_success": None if success is None else bool(success),
        "final": final,
    }


FACES = {"single": SingleFace, "vector": VectorFace, "sb3": SB3Face, "parallel": ParallelFace}
