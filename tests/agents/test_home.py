"""The units that bring a paddle home while the puck is away."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from agents.models import export_policy
from agents.training.home import UNITS, add_home_units
from agents.training.ppo import PpoArgs, make_env, make_model, start_model
from agents.training.train import train
from airhockey_env.opponents.policy import MlpPolicy
from airhockey_env.tables import FULL_SIZE
from airhockey_env.vector_env import AirHockeyVectorEnv
from tests.helpers import some_observations

SMALL = PpoArgs(num_envs=4, n_steps=8, batch_size=16, net_width=16, sde_sample_freq=0)


def outputs(policy: MlpPolicy, observations: NDArray[np.float32]) -> NDArray[np.float64]:
    """Target velocities before they are clipped: (N, 2)."""
    values = policy.inputs(observations).astype(np.float64)
    for weight, bias in zip(policy.weights[:-1], policy.biases[:-1], strict=True):
        values = np.maximum(values @ weight.T + bias, 0.0)
    return values @ policy.weights[-1].T + policy.biases[-1]


def model_with_idle_units(args: PpoArgs = SMALL) -> Any:
    """A model in which some units of each layer are not used, so that nothing is lost with them."""
    model = make_model(args, make_env(args))
    first, _, second, _ = model.policy.mlp_extractor.policy_net
    for layer, number in ((first, UNITS[0]), (second, UNITS[1])):
        layer.weight.data[:number], layer.bias.data[:number] = 0.0, 0.0
    return model


def pull(observations: NDArray[np.float32]) -> NDArray[np.float64]:
    """What the units add to the target velocities on a full-size table, as its lengths and speeds are: (N, 2)."""
    x, y, vx, vy = observations[:, :4].astype(np.float64).T
    half_length, half_width = 0.5 * 2.362, 0.5 * 1.144
    x += vx * 5.0 * (5.0 / 30.0 / 2.0) / half_length  # where the paddle stops
    y += vy * 5.0 * (5.0 / 30.0 / 2.0) / half_width
    near = np.maximum(-(observations[:, 8] + 0.08 * observations[:, 10] * 12.0 / half_length), 0.0)
    forward, left, right = (np.maximum(np.maximum(d, 0.0) - 100.0 * near, 0.0) for d in (x + 0.7, y - 0.25, -y - 0.25))
    return np.stack([-400.0 * forward, 400.0 * (right - left)], axis=1)


@pytest.mark.parametrize(("stack", "foresight"), [(1, False), (3, False), (1, True)])
def test_what_they_add(stack: int, foresight: bool) -> None:
    model = model_with_idle_units(dataclasses.replace(SMALL, stack=stack, foresight=foresight))
    observations = some_observations(200)
    seen = observations
    if stack > 1:
        seen = np.random.default_rng(0).uniform(-1.0, 1.0, (200, stack, 15)).astype(np.float32)
        seen[:, -1, :13] = observations
    before = outputs(export_policy(model), seen)
    add_home_units(model, FULL_SIZE)
    added = outputs(export_policy(model), seen) - before
    expected = pull(observations)
    assert (np.abs(expected) > 1.0).mean() > 0.1
    np.testing.assert_allclose(added, expected, atol=0.01)


def test_the_paddle_goes_home_while_the_puck_is_away() -> None:
    model = model_with_idle_units()
    model.policy.action_net.bias.data[:] = 7.0  # as strong a wish to be elsewhere as agents have learned
    add_home_units(model, FULL_SIZE)
    policy = export_policy(model)
    env = AirHockeyVectorEnv(64, opponent="idle")
    seen, _ = env.reset(seed=3)
    away = seen[:, 8] > 0.0
    assert 10 < away.sum() < 54
    for _ in range(60):
        seen = env.step(policy(seen))[0]
    away &= seen[:, 8] > 0.0
    assert away.any()
    assert (seen[away, 0] < -0.65).all() and (np.abs(seen[away, 1]) < 0.3).all()


def test_a_puck_that_rests_near_the_centre_line_can_be_reached() -> None:
    model = model_with_idle_units()
    before, centimetre = export_policy(model), 0.01 / (0.5 * 2.362)
    add_home_units(model, FULL_SIZE)
    touching = (0.0413 + 0.0505) / (0.5 * 2.362)
    for puck, pulled in ((-centimetre, False), (centimetre, True)):
        seen = np.zeros((1, 13), np.float32)
        seen[0, 8], seen[0, 0] = puck, puck - touching  # the paddle is behind the puck
        added = outputs(export_policy(model), seen) - outputs(before, seen)
        assert (np.abs(added) > 1.0).any() == pulled


def test_training_keeps_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    args = dataclasses.replace(
        SMALL, home=True, name="one", steps=256, warmup_steps=0, video_seconds=0, eval_episodes=2, report_episodes=2
    )
    begun = export_policy(start_model(args, new=True))
    policy = MlpPolicy.load(train(args).policy)
    resumed = MlpPolicy.load(train(PpoArgs(resume="one", steps=512)).policy)
    here, there = slice(-UNITS[0], None), slice(-UNITS[1], None)
    for trained in (policy, resumed):
        for k, place in ((0, here), (1, there), (1, (slice(None), here)), (2, (slice(None), there))):
            np.testing.assert_array_equal(trained.weights[k][place], begun.weights[k][place])
        np.testing.assert_array_equal(trained.biases[0][here], begun.biases[0][here])
        np.testing.assert_array_equal(trained.biases[1][there], begun.biases[1][there])
    for before, after in ((begun, policy), (policy, resumed)):
        assert all((one != other).any() for one, other in zip(before.weights, after.weights, strict=True))


def test_a_policy_that_has_them_gets_no_second_ones(tmp_path: Path) -> None:
    model = model_with_idle_units()
    add_home_units(model, FULL_SIZE)
    export_policy(model).save(tmp_path / "policy.npz")
    args = dataclasses.replace(SMALL, home=True, start=str(tmp_path / "policy.npz"))
    observations = some_observations(50)
    expected = outputs(export_policy(model), observations)
    again = outputs(export_policy(start_model(args, new=True)), observations)
    np.testing.assert_allclose(again, expected, rtol=1e-4, atol=1e-3)
    weaker = export_policy(model)
    weaker.weights[-1][:, -UNITS[1] :] /= 16.0
    weaker.save(tmp_path / "policy.npz")
    again = outputs(export_policy(start_model(args, new=True)), observations)
    np.testing.assert_allclose(again, expected, rtol=1e-4, atol=1e-3)


def test_layers_must_have_room() -> None:
    with pytest.raises(ValueError, match="net-width"):
        train(dataclasses.replace(SMALL, home=True, net_width=7))
