"""Disturbances of a given size, and what else differs between practice and points."""

from __future__ import annotations

from typing import Any

import pytest

from agents.training import ppo
from agents.training.noise import Noise, set_noise
from agents.training.ppo import PpoArgs, make_env, make_model
from airhockey_env.kernel.rewards import SHAPING_DISCOUNT

UPDATE = 16 * 8
TINY: dict[str, Any] = {"num_envs": 16, "n_steps": 8, "batch_size": 64, "n_epochs": 1, "net_width": 16}


def deviation(model: Any) -> float:
    """The standard deviation of the actions' disturbances on the tables as they are now."""
    seen, _ = model.policy.obs_to_tensor(model._last_obs)
    return model.policy.get_distribution(seen).distribution.variance.mean().item() ** 0.5


@pytest.mark.parametrize("sde_sample_freq", [0, 4])
def test_noise_has_the_given_deviation(sde_sample_freq: int) -> None:
    args = PpoArgs(sde_sample_freq=sde_sample_freq, **TINY)
    model = make_model(args, make_env(args))
    model.learn(UPDATE)
    set_noise(model, 0.2)
    assert deviation(model) == pytest.approx(0.2, rel=0.01)


@pytest.mark.parametrize(
    ("end", "steps", "expected"), [(0.1, 0, 0.4), (0.1, 500, 0.2), (0.1, 1100, 0.1), (0.0, 0, 0.4), (0.0, 500, 0.3)]
)
def test_noise_falls_or_is_learned(end: float, steps: int, expected: float) -> None:
    args = PpoArgs(**TINY)
    model = make_model(args, make_env(args))
    model.learn(UPDATE)
    set_noise(model, 0.3)
    noise = Noise(0.4, end, first=0, last=1000)
    noise.init_callback(model)
    model.num_timesteps = noise.num_timesteps = steps
    noise.on_rollout_start()
    assert deviation(model) == pytest.approx(expected, rel=0.01)


def test_practice_is_shaped_and_points_have_their_own_reward_and_discount(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[tuple[str, str]] = []
    tables = ppo.AirHockeySB3VecEnv
    monkeypatch.setattr(
        ppo, "AirHockeySB3VecEnv",
        lambda *args, **kwargs: seen.append((kwargs["task"], kwargs["reward"])) or tables(*args, **kwargs),
    )  # fmt: skip
    args = ppo.resolve(PpoArgs(steps=8 * UPDATE, gamma=0.9, noise=0.2, **TINY))
    model = make_model(args, make_env(args))
    history: dict[str, Any] = {"practice": None}
    phases = ppo.phases(args, model, None, history)
    next(phases)
    assert model.gamma == model.rollout_buffer.gamma == SHAPING_DISCOUNT
    points = next(phases)
    assert model.gamma == model.rollout_buffer.gamma == 0.9
    assert seen[-2:] == [("hit", "shaped"), ("point", "sparse")]
    assert [type(callback) for callback in points.callbacks] == [Noise]
