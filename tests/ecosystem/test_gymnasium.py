"""Gymnasium's wrappers over one table and over the batch, in every autoreset mode."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium as gym
import jax.numpy as jnp
import numpy as np
import pytest
import torch
from gymnasium import spaces, wrappers
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers import vector

import airhockey_env  # noqa: F401
from tests.helpers import random_actions, same

RGB = {"obs_type": "rgb"}
PICTURES = {"render_mode": "rgb_array"}
WIDE = spaces.Box(-2, 2, (13,), np.float32)

BOTH: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {  # what the wrapper takes, and what the environment
    "RecordEpisodeStatistics": ({}, {}),
    "TransformReward": ({"func": lambda reward: 2 * reward}, {}),
    "ClipReward": ({"min_reward": -0.5, "max_reward": 0.5}, {}),
    "NormalizeReward": ({}, {"reward": "shaped"}),
    "ClipAction": ({}, {}),
    "RescaleAction": ({"min_action": 0.0, "max_action": 1.0}, {}),
    "NormalizeObservation": ({}, {}),
    "DtypeObservation": ({"dtype": np.float64}, {}),
    "FlattenObservation": ({}, RGB),
    "RescaleObservation": ({"min_obs": np.float32(0), "max_obs": np.float32(1)}, {}),
    "ReshapeObservation": ({"shape": (42, 168, 3)}, RGB),
    "GrayscaleObservation": ({}, RGB),
    "ResizeObservation": ({"shape": (42, 42)}, RGB),
}
SINGLE = {
    "TransformAction": ({"func": lambda action: -action, "action_space": None}, {}),
    "TransformObservation": ({"func": lambda seen: 2 * seen, "observation_space": WIDE}, {}),
    "FrameStackObservation": ({"stack_size": 4}, {"obs_type": "grayscale"}),
    "DelayObservation": ({"delay": 3}, {}),
    "TimeAwareObservation": ({}, {}),
    "MaxAndSkipObservation": ({"skip": 4}, {"obs_type": "grayscale"}),
    "StickyAction": ({"repeat_action_probability": 0.25}, {}),
    "RepeatAction": ({"num_repeats": 3}, {}),
    "DiscretizeAction": ({"bins": 5}, {}),
    "DiscretizeObservation": ({"bins": 3, "multidiscrete": True}, {}),
    "AddRenderObservation": ({"render_only": False}, PICTURES),
    "AddWhiteNoise": ({"probability_of_noise_per_pixel": 0.1}, PICTURES),
    "ObstructView": ({"obstructed_pixels_ratio": 0.1, "obstruction_width": 8}, PICTURES),
    "RenderCollection": ({}, PICTURES),
    "HumanRendering": ({}, PICTURES),
    "Autoreset": ({}, {}),
    "TimeLimit": ({"max_episode_steps": 20}, {}),
}
BATCH = {
    "TransformAction": ({"func": lambda actions: -actions}, {}),
    "TransformObservation": ({"func": lambda seen: 2 * seen, "single_observation_space": WIDE}, {}),
    "HumanRendering": ({}, PICTURES),
}
ARRAYS = {
    "NumpyToTorch": (torch.Tensor, torch.asarray),
    "JaxToNumpy": (np.ndarray, np.asarray),
}


def play(envs: Any, mode: AutoresetMode, array: Callable[[Any], Any] = np.asarray, steps: int = 100) -> list[Any]:
    """What a batch returns for sampled actions, and for resets by mask where tables stay over otherwise."""
    envs.action_space.seed(0)
    results = [envs.reset(seed=0)]
    for _ in range(steps):
        results.append(envs.step(array(envs.action_space.sample())))
        over = results[-1][2] | results[-1][3]
        if mode == AutoresetMode.DISABLED and over.any():
            results.append(envs.reset(options={"reset_mask": over}))
    envs.close()
    return results


@pytest.mark.parametrize("name", [*BOTH, *SINGLE])
def test_wrapper_over_one_table(name: str) -> None:
    given, arguments = (BOTH | SINGLE)[name]
    env = getattr(wrappers, name)(gym.make("AirHockey-v0", max_episode_steps=40, **arguments), **given)
    env.action_space.seed(0)
    ends = 0
    for seed in range(2):
        observation, info = env.reset(seed=seed)
        over = False
        while not over:
            assert observation in env.observation_space
            observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
            assert np.isfinite(reward) and info["score"].shape == (2,)
            over = terminated or truncated
        ends += 1
        if arguments == PICTURES:
            assert np.any(env.render()) or env.render_mode == "human"
    assert ends == 2
    env.close()


def refused(name: str, mode: AutoresetMode) -> bool:
    """Whether Gymnasium has a wrapper for other autoreset modes only, over whatever vector environment."""
    if name == "NormalizeObservation":
        return mode != AutoresetMode.NEXT_STEP
    return name.endswith("Observation") and mode == AutoresetMode.SAME_STEP


@pytest.mark.parametrize("mode", AutoresetMode)
@pytest.mark.parametrize("name", [*BOTH, *BATCH])
def test_wrapper_over_the_batch(name: str, mode: AutoresetMode) -> None:
    given, arguments = (BOTH | BATCH)[name]
    batch = gym.make_vec("AirHockey-v0", num_envs=4, autoreset_mode=mode, max_episode_steps=20, **arguments)
    if refused(name, mode):
        with pytest.raises(ValueError, match="autoreset_mode"):
            getattr(vector, name)(batch, **given)
        return
    envs = getattr(vector, name)(batch, **given)
    finals = 0
    for observations, *rest in play(envs, mode):
        assert observations in envs.observation_space
        if len(rest) > 1:
            rewards, *_, infos = rest
            assert rewards.shape == (4,) and np.isfinite(rewards).all()
            finals += "final_info" in infos
    assert (finals > 0) == (mode == AutoresetMode.SAME_STEP)


@pytest.mark.parametrize("mode", AutoresetMode)
@pytest.mark.parametrize("name", ARRAYS)
def test_arrays_of_a_batch_become_others_with_the_same_values(name: str, mode: AutoresetMode) -> None:
    kind, array = ARRAYS[name]
    arguments = {"num_envs": 4, "max_episode_steps": 20, "randomize": {"width": (1.0, 1.2)}, "autoreset_mode": mode}
    converted = play(getattr(vector, name)(gym.make_vec("AirHockey-v0", **arguments)), mode, array)
    plain = play(gym.make_vec("AirHockey-v0", **arguments), mode)
    finals = 0
    for ours, theirs in zip(converted, plain, strict=True):
        assert all(isinstance(one, kind) for one in ours[:-1])
        assert same([np.asarray(one) for one in ours[:-1]], list(theirs[:-1]))
        finals += "final_obs" in theirs[-1]
        assert_same_infos(ours[-1], theirs[-1], kind)
    assert (finals > 0) == (mode == AutoresetMode.SAME_STEP)


@pytest.mark.parametrize("name", ARRAYS)
def test_arrays_of_one_table_become_others_with_the_same_values(name: str) -> None:
    kind, array = ARRAYS[name]
    arguments = {"randomize": {"width": (1.0, 1.2)}, "max_episode_steps": 40}
    env, plain = getattr(wrappers, name)(gym.make("AirHockey-v0", **arguments)), gym.make("AirHockey-v0", **arguments)
    ours, theirs = env.reset(seed=0), plain.reset(seed=0)
    for action in random_actions(0, 30, 1)[:, 0]:
        assert isinstance(ours[0], kind) and same(np.asarray(ours[0]), theirs[0])
        assert [float(one) for one in ours[1:-1]] == [float(one) for one in theirs[1:-1]]
        assert_same_infos(ours[-1], theirs[-1], object)
        ours, theirs = env.step(array(action)), plain.step(action)


def assert_same_infos(ours: dict[str, Any], theirs: dict[str, Any], kind: type) -> None:
    """Alike in keys and values, the former of another library's arrays; the final observations in one array."""
    assert ours.keys() == theirs.keys()
    for key, value in theirs.items():
        if isinstance(value, dict):
            assert_same_infos(ours[key], value, kind)
        elif key == "final_obs":
            assert isinstance(ours[key], kind)
            assert (
                np.asarray(ours[key])[theirs["_final_obs"]].tolist() == np.stack(value[theirs["_final_obs"]]).tolist()
            )
        else:
            assert isinstance(ours[key], kind) and same(np.asarray(ours[key]), np.asarray(value))


@pytest.mark.parametrize("mode", AutoresetMode)
def test_gymnasiums_own_batch_of_tables_converts_too(mode: AutoresetMode) -> None:
    """But for the objects among its infos in SameStep, whatever the environment."""
    sync = SyncVectorEnv([lambda: gym.make("AirHockey-v0", max_episode_steps=20)] * 2, autoreset_mode=mode)
    envs = vector.NumpyToTorch(sync)
    if mode == AutoresetMode.SAME_STEP:
        with pytest.raises(BufferError):
            play(envs, mode, torch.asarray)
    else:
        assert all(type(value) is torch.Tensor for value in play(envs, mode, torch.asarray)[-1][-1].values())


def test_jax_actions_reach_the_table() -> None:
    """What ArrayConversion and JAX's own training loops hand over."""
    env, plain = gym.make("AirHockey-v0").unwrapped, gym.make("AirHockey-v0").unwrapped
    envs = gym.make_vec("AirHockey-v0", num_envs=2)
    for one in (env, plain, envs):
        one.reset(seed=0)
    action = np.array([0.5, -0.25], np.float32)
    expected = plain.step(action)[0]
    assert same(env.step(jnp.asarray(action))[0], expected)
    assert same(envs.step(jnp.asarray(np.stack([action, action])))[0][0], expected)


def test_infos_become_a_list() -> None:
    envs = vector.DictInfoToList(gym.make_vec("AirHockey-v0", num_envs=3, randomize={"width": (1.0, 1.2)}))
    for infos in (envs.reset(seed=0)[1], envs.step(envs.action_space.sample())[-1]):
        assert [info.keys() for info in infos] == [{"score", "foul", "is_success", "table"}] * 3
        assert len({info["table"]["width"] for info in infos}) == 3


@pytest.mark.parametrize("batch", [False, True])
def test_videos(batch: bool, tmp_path: Any) -> None:
    if batch:
        envs = gym.make_vec("AirHockey-v0", num_envs=2, render_mode="rgb_array", max_episode_steps=10)
        recorder = vector.RecordVideo(envs, str(tmp_path), episode_trigger=lambda episode: episode == 0)
    else:
        env = gym.make("AirHockey-v0", render_mode="rgb_array", max_episode_steps=10)
        recorder = wrappers.RecordVideo(env, str(tmp_path), episode_trigger=lambda episode: episode == 0)
    recorder.reset(seed=0)
    for _ in range(12 if batch else 10):
        recorder.step(recorder.action_space.sample())
    recorder.close()
    assert [file.suffix for file in tmp_path.iterdir() if file.stat().st_size > 1000] == [".mp4"]
