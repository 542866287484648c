"""Policies as ONNX files play as they do themselves."""

from __future__ import annotations

import math
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecFrameStack

from agents.onnx_files import (
    INPUT,
    OUTPUT,
    TOLERANCE,
    compare,
    played_observations,
    random_observations,
    run_onnx,
    to_onnx,
)
from airhockey_env import AirHockeyEnv, MlpPolicy
from airhockey_env.kernel.observations import COLUMNS, SCALES, scales_of
from airhockey_env.kernel.state import observation_shape
from airhockey_env.opponents.foresight import FORESEEN_SIZE
from airhockey_env.opponents.trained import TRAINED, trained_policy
from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv
from airhockey_env.tables import CHALLENGE, FULL_SIZE, TableSpec
from tests.helpers import Call

onnx = pytest.importorskip("onnx", reason="needs the extra onnx")
onnxruntime = pytest.importorskip("onnxruntime", reason="needs the extra onnx")


def network(
    outputs: int = 2,
    activation: str = "relu",
    squash: bool = False,
    stack: int = 1,
    foresight: TableSpec | None = None,
) -> MlpPolicy:
    """A network whose actions use all of their range."""
    rng = np.random.default_rng(outputs)
    inputs = math.prod(observation_shape(stack)) + (0 if foresight is None else FORESEEN_SIZE)
    sizes = (inputs, 40, 24, outputs)
    layers = list(pairwise(sizes))
    weights = [rng.normal(size=(n_out, n_in)) * 2.0 / math.sqrt(n_in) for n_in, n_out in layers]
    biases = [rng.normal(size=n_out) / 4.0 for _, n_out in layers]
    return MlpPolicy(weights, biases, activation, squash, stack, foresight)


@pytest.mark.parametrize(("stack", "foresight"), [(1, None), (6, None), (1, FULL_SIZE), (1, CHALLENGE)])
@pytest.mark.parametrize("outputs", [2, 9])
@pytest.mark.parametrize("squash", [False, True])
@pytest.mark.parametrize("activation", ["tanh", "relu"])
def test_a_file_plays_as_its_policy(
    activation: str, squash: bool, outputs: int, stack: int, foresight: TableSpec | None
) -> None:
    policy = network(outputs, activation, squash, stack, foresight)
    contents = to_onnx(policy)
    for observations in (random_observations(policy), played_observations(policy)):
        difference = compare(contents, policy, observations)
        assert difference.is_rounding
        assert difference.largest <= 3 * TOLERANCE  # weights of this size give no more rounding
        assert len(np.unique(run_onnx(contents, observations), axis=0)) >= min(outputs, 5)
    for n in (1, 3):
        assert run_onnx(contents, observations[:n]).shape == (n, 2)


@pytest.mark.parametrize("outputs", [2, 9])
def test_another_policy_is_told_from_it(outputs: int) -> None:
    policy = network(outputs)
    bias = policy.biases[1].copy()
    bias[np.abs(policy.weights[2]).sum(axis=0).argmax()] += 0.01
    other = MlpPolicy(policy.weights, [policy.biases[0], bias, policy.biases[2]])
    assert not compare(to_onnx(other), policy, random_observations(policy)).is_rounding


@pytest.mark.parametrize("stack", [1, 3])
def test_a_file_says_what_it_takes_and_gives(stack: int) -> None:
    session = onnxruntime.InferenceSession(to_onnx(network(stack=stack)))
    (taken,), (given,) = session.get_inputs(), session.get_outputs()
    assert (taken.name, tuple(taken.shape[1:]), taken.type) == (INPUT, observation_shape(stack), "tensor(float)")
    assert (given.name, given.shape[1], given.type) == (OUTPUT, 2, "tensor(float)")
    metadata = session.get_modelmeta().custom_metadata_map
    assert metadata["stack"] == str(stack)
    columns, scales = (metadata[name].split(",") for name in ("columns", "scales"))
    assert len(columns) == len(scales) == taken.shape[-1]
    assert tuple(columns[:13]) == COLUMNS and tuple(scales[:13]) == SCALES
    assert columns[13:] == ["sent_action_x", "sent_action_y"][: len(columns) - 13]


def test_scales_are_those_of_observations() -> None:
    env = AirHockeyEnv(table="challenge", opponent="striker")
    env.reset(seed=3, options={"puck_position": (0.2, 0.1), "puck_velocity": (-1.0, 0.5)})
    for _ in range(8):
        observation, *_ = env.step(np.array([0.3, 0.2], np.float32))
    true = np.concatenate([part for k in (0, 1, 2) for part in (env.positions[k], env.velocities[k])])
    assert np.count_nonzero(true) == 12
    np.testing.assert_allclose(observation[:12] * scales_of(CHALLENGE)[:12], true, rtol=1e-6)


@pytest.mark.parametrize("name", TRAINED)
def test_the_command_writes_what_ships(name: str, call: Call, tmp_path: Path) -> None:
    printed = call("export", name, "--onnx", "policy.onnx")
    policy = trained_policy(name)
    contents = (tmp_path / "policy.onnx").read_bytes()
    for observations in (random_observations(policy), played_observations(policy)):
        difference = compare(contents, policy, observations)
        assert difference.is_rounding
        assert f"{difference.largest:.1e}" in printed
    assert [path.name for path in tmp_path.iterdir()] == ["policy.onnx"]


def test_models_and_folders_are_exported(call: Call, tmp_path: Path) -> None:
    model = PPO("MlpPolicy", AirHockeySB3VecEnv(1, stack=3), n_steps=2, batch_size=2, device="cpu")
    model.save(tmp_path / "model.zip")
    network(stack=3).save(tmp_path / "policy.npz")
    played: list[NDArray[np.float32]] = []
    for player in ("model.zip", "policy.npz", "."):
        call("export", player, "--onnx", "policy.onnx")
        seen = np.random.default_rng(0).uniform(-1, 1, (5, 3, 15)).astype(np.float32)
        played.append(run_onnx((tmp_path / "policy.onnx").read_bytes(), seen))
    np.testing.assert_allclose(played[0], model.predict(seen, deterministic=True)[0], atol=1e-6)
    assert (played[1] == played[2]).all() and (played[0] != played[1]).any()


def test_what_is_no_such_network_is_refused(call: Call, tmp_path: Path) -> None:
    (tmp_path / "export_players.py").write_text("def still(seen):\n    return 0 * seen[:, :2]\n")
    stacked = VecFrameStack(AirHockeySB3VecEnv(1), 2)
    PPO("MlpPolicy", stacked, n_steps=2, batch_size=2, device="cpu").save(tmp_path / "frames.zip")
    for player in ("striker", "export_players:still", "frames.zip"):
        assert "MODEL must be" in call("export", player, "--onnx", "policy.onnx", fails=True)
    assert not (tmp_path / "policy.onnx").exists()


@pytest.mark.parametrize("missing", ["onnx", "onnxruntime"])
def test_the_extra_is_named_when_it_is_missing(missing: str, call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, missing, None)
    assert '".[onnx]"' in call("export", "expert", "--onnx", "policy.onnx", fails=True)
