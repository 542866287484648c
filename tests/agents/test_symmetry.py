"""Symmetric networks give mirrored actions for mirrored observations, before and after learning."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
import torch

from agents.models import export_policy, load_player
from agents.symmetry import is_symmetric
from agents.training.ppo import PpoArgs, make_env, make_model, phases, resolve, start_model
from agents.training.train import own_args, train
from airhockey_env import AirHockeyEnv
from airhockey_env.kernel.state import observation_shape

SMALL: dict[str, Any] = {
    "num_envs": 4, "n_steps": 8, "batch_size": 16, "net_width": 16, "eval_episodes": 2, "report_episodes": 2,
    "video_seconds": 0,
}  # fmt: skip

SIGNS = np.array([1, -1] * 6 + [1] + [1, -1], np.float32)
"""What a mirror does to the numbers of a stack's row."""


def mirrored(observations: np.ndarray) -> np.ndarray:
    return observations * SIGNS[: observations.shape[-1]]


def seen(stack: int) -> np.ndarray:
    random = np.random.default_rng(7)
    return random.uniform(-1.0, 1.0, (20, *observation_shape(stack))).astype(np.float32)


def assert_symmetric(model: Any, stack: int) -> None:
    observations = seen(stack)
    tensors = [torch.as_tensor(part) for part in (observations, mirrored(observations))]
    actions = [model.policy.get_distribution(part).mode().detach().numpy() for part in tensors]
    values = [model.policy.predict_values(part).detach().numpy() for part in tensors]
    np.testing.assert_allclose(actions[0], actions[1] * SIGNS[:2], atol=1e-5)
    np.testing.assert_allclose(values[0], values[1], atol=1e-5)
    assert np.abs(actions[0][:, 1]).max() > 1e-4, "the actions say something"
    assert np.ptp(values[0]) > 1e-4
    assert is_symmetric(model)


@pytest.mark.parametrize("width", [16, 9])
@pytest.mark.parametrize("sde", [8, 0])
@pytest.mark.parametrize("stack", [1, 3])
def test_an_agent_is_symmetric_and_stays_so(stack: int, sde: int, width: int) -> None:
    args = resolve(PpoArgs(**{**SMALL, "net_width": width, "stack": stack, "sde_sample_freq": sde}))
    model = make_model(args, make_env(args))
    assert_symmetric(model, stack)
    before = export_policy(model).weights
    learn(model, args, updates=10)
    assert_symmetric(model, stack)
    after = export_policy(model).weights
    assert all(np.abs(old - new).max() > 1e-4 for old, new in zip(before, after, strict=True))


def learn(model: Any, args: PpoArgs, updates: int) -> None:
    """Learn by points, as a run does."""
    phase = next(phases(dataclasses.replace(args, warmup_steps=0), model, None, {"practice": None}))
    model.set_env(phase.env)
    model.learn(updates * args.num_envs * args.n_steps)


def test_random_weights_keep_their_size() -> None:
    args = resolve(PpoArgs(num_envs=4, batch_size=64))
    symmetric, other = (make_model(one, make_env(one)) for one in (args, dataclasses.replace(args, symmetric=False)))
    assert not is_symmetric(other)
    for ours, theirs in zip(symmetric.policy.parameters(), other.policy.parameters(), strict=True):
        assert ours.norm().item() == pytest.approx(theirs.norm().item(), rel=0.1, abs=1e-6)


def test_a_network_without_the_symmetry_is_trained_as_it_is() -> None:
    args = resolve(PpoArgs(num_envs=4, n_steps=8, batch_size=16, start="adept", net_width=64))
    model = start_model(args, new=True)
    assert not is_symmetric(model)
    weight = model.policy.mlp_extractor.policy_net[0].weight
    before = weight.detach().clone()
    learn(model, args, updates=4)
    change = weight.detach() - before
    assert not torch.allclose(change, change.flip(0), atol=1e-5)


def test_a_resumed_run_stays_symmetric(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    train(PpoArgs(name="run", steps=64, warmup_steps=0, **SMALL))
    train(own_args(PpoArgs(resume="run", steps=160))[1])
    policy: Any = load_player("runs/run", "player")
    observations = seen(1)
    np.testing.assert_allclose(policy(observations), policy(mirrored(observations)) * SIGNS[:2], atol=1e-5)


def test_the_game_has_the_symmetry() -> None:
    """What the signs say is what the environment does: a mirrored start with mirrored actions is a mirrored episode."""
    first, second = (AirHockeyEnv(opponent="idle") for _ in range(2))
    observations = []
    for env, sign in ((first, 1.0), (second, -1.0)):
        puck = {"puck_position": [-0.4, 0.17 * sign], "puck_velocity": [-2.0, -0.4 * sign]}
        observation, _ = env.reset(seed=1, options=puck)
        rows = [observation]
        for k in range(60):
            action = np.array([np.cos(0.3 * k), sign * np.sin(0.3 * k)], np.float32)
            rows.append(env.step(action)[0])
        observations.append(np.array(rows))
    np.testing.assert_allclose(observations[0], mirrored(observations[1]), atol=1e-6)
