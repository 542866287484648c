"""Both players in other people's hands: all of SuperSuit, and what else takes PettingZoo's environments."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import supersuit
from pettingzoo.test import api_test, parallel_api_test, parallel_seed_test

from airhockey_env.parallel_env import AirHockeyParallelEnv, env

DISCRETE, RGB = {"continuous": False}, {"obs_type": "rgb"}

WRAPPERS: dict[str, tuple[tuple[Any, ...], dict[str, Any]]] = {
    "action_lambda_v1": ((lambda action, space: -action, lambda space: space), {}),
    "agent_indicator_v0": ((), {}),
    "black_death_v3": ((), {}),
    "clip_actions_v0": ((), {}),
    "clip_reward_v0": ((), {}),
    "color_reduction_v0": ((), RGB),
    "delay_observations_v0": ((2,), {}),
    "dtype_v0": ((np.float64,), {}),
    "flatten_v0": ((), RGB),
    "frame_skip_v0": ((3,), {}),
    "frame_stack_v1": ((3,), {}),
    "frame_stack_v2": ((3,), {}),
    "max_observation_v0": ((2,), RGB),
    "nan_noop_v0": ((0,), DISCRETE),
    "nan_random_v0": ((), DISCRETE),
    "nan_zeros_v0": ((), {}),
    "normalize_obs_v0": ((), {}),
    "observation_lambda_v0": ((lambda seen, space, agent: -seen,), {}),
    "pad_action_space_v0": ((), {}),
    "pad_observations_v0": ((), {}),
    "reshape_v0": (((13, 1),), {}),
    "resize_v1": ((42, 42), RGB),
    "reward_lambda_v0": ((lambda reward: 2 * reward,), {}),
    "scale_actions_v0": ((0.5,), {}),
    "sticky_actions_v0": ((0.25,), {}),
}
BATCHES = {
    "concat_vec_envs_v1",
    "gym_vec_env_v0",
    "pettingzoo_env_to_vec_env_v1",
    "stable_baselines3_vec_env_v0",
    "vectorize_aec_env_v0",
}
GONE = {"stable_baselines_vec_env_v0"}  # Stable-Baselines 1 and 2, of TensorFlow's first days


def test_these_are_all() -> None:
    assert {name for name in dir(supersuit) if name[-3:-1] == "_v"} == WRAPPERS.keys() | BATCHES | GONE


def wrapped(name: str, make: Callable[..., Any]) -> Any:
    given, arguments = WRAPPERS[name]
    return getattr(supersuit, name)(make(max_episode_steps=30, **arguments), *given)


@pytest.mark.parametrize("name", WRAPPERS)
def test_wrapper_over_both_players(name: str) -> None:
    parallel_api_test(wrapped(name, AirHockeyParallelEnv), num_cycles=100)
    if name not in ("sticky_actions_v0", "nan_random_v0"):  # SuperSuit draws these from a generator without a seed
        parallel_seed_test(lambda: wrapped(name, AirHockeyParallelEnv), num_cycles=40)
    if name != "black_death_v3":  # SuperSuit's gives NumPy's bools, which the test refuses
        api_test(wrapped(name, env), num_cycles=100)


@pytest.mark.parametrize("num_cpus", [0, 2])
def test_players_as_tables_of_a_batch(num_cpus: int) -> None:
    players = supersuit.pettingzoo_env_to_vec_env_v1(AirHockeyParallelEnv(max_episode_steps=30))
    envs = supersuit.concat_vec_envs_v1(players, 2, num_cpus=num_cpus, base_class="gymnasium")
    observations, _ = envs.reset(seed=0)
    assert observations.shape == (4, 13)
    ends = 0
    for _ in range(40):
        observations, rewards, terminated, truncated, _ = envs.step(np.zeros((4, 2), np.float32))
        assert observations.shape == (4, 13) and np.isfinite(rewards).all()
        ends += int(np.sum(terminated) + np.sum(truncated))
    envs.close()
    assert ends == 4


def test_tables_in_turn() -> None:
    """SuperSuit's batches of single environments, and of agent-by-agent ones."""
    envs = supersuit.gym_vec_env_v0(gym.make("airhockey_env:AirHockey-v0"), 3)
    assert envs.reset(seed=0)[0].shape == (3, 13)
    assert envs.step(envs.action_space.sample())[-1]["score"].shape == (3, 2)
    tables = supersuit.stable_baselines3_vec_env_v0(gym.make("airhockey_env:AirHockey-v0"), 3)
    assert tables.reset().shape == (3, 13)
    turns = supersuit.vectorize_aec_env_v0(env(max_episode_steps=30), 3)
    turns.reset(seed=0)
    for _ in range(10):
        assert turns.last()[0].shape == (3, 13)
        turns.step([np.zeros(2, np.float32)] * 3)


def test_tianshou_takes_turns() -> None:
    from tianshou.env import DummyVectorEnv, PettingZooEnv

    envs = DummyVectorEnv([lambda: PettingZooEnv(env(max_episode_steps=30))] * 2)
    observations, _ = envs.reset()
    assert [seen["agent_id"] for seen in observations] == ["left", "left"]
    observations, rewards, *_ = envs.step(np.zeros((2, 2), np.float32))
    assert [seen["agent_id"] for seen in observations] == ["right", "right"] and rewards.shape == (2, 2)


def test_skrl_has_both_players() -> None:
    import torch
    from skrl.envs.wrappers.torch import wrap_env

    game = wrap_env(AirHockeyParallelEnv(max_episode_steps=30), wrapper="pettingzoo")
    observations, _ = game.reset()
    assert {agent: tuple(seen.shape) for agent, seen in observations.items()} == {"left": (1, 13), "right": (1, 13)}
    _, rewards, *_ = game.step({agent: torch.zeros(1, 2) for agent in game.agents})
    assert {agent: tuple(reward.shape) for agent, reward in rewards.items()} == {"left": (1, 1), "right": (1, 1)}
