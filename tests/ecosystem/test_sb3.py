"""Algorithms of sb3-contrib and SBX over the batch: they train, and their models come back from a file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sb3_contrib
import sbx

from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv

ON_POLICY = {"n_steps": 16, "batch_size": 64}
OFF_POLICY = {"learning_starts": 64, "buffer_size": 1000, "batch_size": 32, "gradient_steps": 1}
ALGORITHMS: dict[str, tuple[Any, str, dict[str, Any], dict[str, Any]]] = {
    "RecurrentPPO": (sb3_contrib.RecurrentPPO, "MlpLstmPolicy", ON_POLICY, {}),
    "TRPO": (sb3_contrib.TRPO, "MlpPolicy", ON_POLICY, {}),
    "QRDQN": (sb3_contrib.QRDQN, "MlpPolicy", OFF_POLICY, {"continuous": False}),
    "CrossQ": (sb3_contrib.CrossQ, "MlpPolicy", OFF_POLICY, {}),
    "DQN in JAX": (sbx.DQN, "MlpPolicy", OFF_POLICY, {"continuous": False}),
}


@pytest.mark.parametrize("name", ALGORITHMS)
def test_algorithm(name: str, tmp_path: Path) -> None:
    algorithm, policy, given, arguments = ALGORITHMS[name]
    envs = AirHockeySB3VecEnv(8, **arguments)
    envs.seed(0)
    device = {"device": "cpu"} if algorithm.__module__.startswith("sb3_contrib") else {}
    model = algorithm(policy, envs, policy_kwargs={"net_arch": [32]}, seed=0, **given, **device)
    model.learn(128)
    assert model.num_timesteps == 128
    model.save(tmp_path / "model")
    again = algorithm.load(tmp_path / "model", env=envs, **device)
    observations = envs.observe()
    actions = model.predict(observations, deterministic=True)[0]
    assert actions.shape == (8, *envs.action_space.shape)
    assert np.array_equal(again.predict(observations, deterministic=True)[0], actions)
    again.learn(128, reset_num_timesteps=False)
    assert again.num_timesteps == 256
