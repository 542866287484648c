"""TorchRL over the batch, over processes and over both players."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
import torch
from torchrl.data import Unbounded
from torchrl.envs import GymEnv, GymWrapper, PettingZooWrapper, check_env_specs
from torchrl.envs.gym_like import default_info_dict_reader

from airhockey_env.parallel_env import AirHockeyParallelEnv

INFOS = {"score": ((2,), torch.int32), "foul": ((), torch.bool), "is_success": ((), torch.bool)}


@pytest.mark.parametrize("mode", ["Disabled", "SameStep"])
def test_a_rollout_of_the_batch_is_what_the_batch_plays(mode: str) -> None:
    n, steps = 4, 60
    batch = gym.make_vec("airhockey_env:AirHockey-v0", num_envs=n, autoreset_mode=mode, max_episode_steps=15)
    envs = GymWrapper(batch, device="cpu")
    check_env_specs(envs)
    first = envs.reset()
    state = batch.unwrapped.get_state()
    data = envs.rollout(steps, tensordict=first, auto_reset=False, break_when_any_done=False)
    assert data.shape == (n, steps)
    done = data["next", "done"][..., 0].numpy()
    assert done[:, [14, 29, 44, 59]].all() and done.sum() == 4 * n  # no point ends within 15 steps

    plain = gym.make_vec("airhockey_env:AirHockey-v0", num_envs=n, autoreset_mode="Disabled", max_episode_steps=15)
    plain.reset(seed=0)
    plain.unwrapped.set_state(state)
    for step in range(steps):
        observations, rewards, *_ = plain.step(data["action"][:, step].numpy())
        assert (observations == data["next", "observation"][:, step].numpy()).all()
        assert (rewards.astype(np.float32) == data["next", "reward"][:, step, 0].numpy()).all()
        if done[:, step].any():
            if mode == "SameStep":  # where all tables are over together TorchRL resets them once more
                assert (data["observation"][:, step + 1, 0] == np.float32(-0.8)).all()
                break
            observations, _ = plain.reset(options={"reset_mask": done[:, step]})
        if step + 1 < steps:
            assert (observations == data["observation"][:, step + 1].numpy()).all()


def test_infos_of_a_same_step_batch_are_entries() -> None:
    batch = gym.make_vec("airhockey_env:AirHockey-v0", num_envs=4, autoreset_mode="SameStep", max_episode_steps=15)
    data = GymWrapper(batch, device="cpu").rollout(40, break_when_any_done=False)
    for name, (shape, dtype) in INFOS.items():
        assert (data["next", name].shape, data["next", name].dtype) == ((4, 40, *shape), dtype)


def test_processes() -> None:
    envs = GymEnv("airhockey_env:AirHockey-v0", num_envs=4, max_episode_steps=15)
    try:
        check_env_specs(envs)
        data = envs.rollout(40, break_when_any_done=False)
    finally:
        envs.close()
    assert data["next", "observation"].shape == (4, 40, 13)
    for name, (shape, dtype) in INFOS.items():
        assert (data["next", name].shape, data["next", name].dtype) == ((4, 40, *shape), dtype)


def test_one_table() -> None:
    env = GymWrapper(gym.make("airhockey_env:AirHockey-v0"))
    spec = {"score": Unbounded((2,), dtype=torch.int32)}
    env.set_info_dict_reader(default_info_dict_reader(["score"], spec=spec))
    check_env_specs(env)
    assert env.rollout(4)["next", "score"].shape == (4, 2)
    pixels = GymEnv("airhockey_env:AirHockey-v0", obs_type="rgb", from_pixels=False)
    check_env_specs(pixels)
    assert pixels.rollout(3)["pixels"].dtype == torch.uint8


def test_both_players() -> None:
    env = PettingZooWrapper(AirHockeyParallelEnv(max_episode_steps=20))
    check_env_specs(env)
    data = env.rollout(50)
    for agent in ("left", "right"):
        assert data[agent, "observation"].shape == (20, 1, 13)
        assert data["next", agent, "info", "score"].shape == (20, 1, 2)
