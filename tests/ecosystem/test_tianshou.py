"""Tianshou: what its buffers hold, and an experiment that comes back from its folder."""

from __future__ import annotations

from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
import torch
from tianshou.algorithm.algorithm_base import Policy
from tianshou.data import Batch, Collector, VectorReplayBuffer
from tianshou.env import DummyVectorEnv, SubprocVectorEnv
from tianshou.highlevel.experiment import Experiment

from tests.ecosystem.page import run_section

ID = "airhockey_env:AirHockey-v0"


class Still(Policy):
    def __init__(self) -> None:
        super().__init__(action_space=gym.make(ID).action_space, action_scaling=False)

    def forward(self, batch: Batch, state: object = None, **kwargs: object) -> Batch:
        return Batch(act=np.zeros((len(batch.obs), 2), np.float32))


def test_infos_are_columns_of_the_buffer() -> None:
    make = [lambda: gym.make(ID, max_episode_steps=10, randomize={"width": (1.0, 1.2)})] * 2
    for envs in (DummyVectorEnv(make), SubprocVectorEnv(make)):
        buffer = VectorReplayBuffer(100, 2)
        collector = Collector(Still(), envs, buffer)
        collector.reset()
        collected = collector.collect(n_episode=4)
        envs.close()
        assert collected.n_collected_steps == 40 == len(buffer)
        infos = buffer[:].info
        assert (infos.score.shape, infos.score.dtype) == ((40, 2), np.int32)
        assert infos.foul.shape == infos.is_success.shape == infos.table.width.shape == (40,)
        assert 1.0 <= infos.table.width.min() < infos.table.width.max() <= 1.2


def test_an_experiment_comes_back_from_its_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    run_section("Tianshou", tmp_path)
    folder = tmp_path / "log" / "air-hockey" / "exp_seed=42"
    experiment = Experiment.from_directory(str(folder), restore_policy=True)
    algorithm = experiment.create_experiment_world().algorithm
    (file,) = folder.glob("policy*")
    saved, restored = torch.load(file, weights_only=True), algorithm.state_dict()
    weights = [name for name in saved if name.startswith(("policy.", "critic."))]
    assert len(weights) > 8 and all(torch.equal(saved[name], restored[name]) for name in weights)
    assert algorithm.policy(Batch(obs=np.zeros((3, 13), np.float32), info={})).act.shape == (3, 2)
