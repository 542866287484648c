"""A learning rate that follows the change of the policy: when it falls, when it rises, and that runs keep it."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

from agents.training.learning import FAR, FASTER, Falling, FollowKl, Limited
from agents.training.ppo import PpoArgs, make_env, make_model
from agents.training.train import train

DESIRED = 0.01


def test_a_limit() -> None:
    schedule = Limited(Falling(1.0), 0.7)
    assert [schedule(remaining) for remaining in (1.0, 0.7, 0.2)] == pytest.approx([0.7, 0.7, 0.2])


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (1.1 * FAR, 1e-3 / FASTER),
        (0.9 * FAR, 1e-3),
        (1.1 / FAR, 1e-3),
        (0.9 / FAR, 1e-3 * FASTER),
        (math.inf, 1e-3 / FASTER),
        (None, 1e-3),  # before the first update
    ],
)
def test_the_rate_changes(change: float | None, expected: float) -> None:
    args = PpoArgs(num_envs=2, batch_size=8, net_width=8, learning_rate=1.0)
    model = make_model(args, make_env(args))
    model.num_timesteps = 64  # it is resumed, with this rate
    model.policy.optimizer.param_groups[0]["lr"] = 1e-3
    model.set_logger(_Logger({} if change is None else {"train/approx_kl": change * DESIRED}))
    follow = FollowKl(DESIRED)
    follow.init_callback(model)
    follow.on_training_start({}, {})
    follow.on_rollout_start()
    assert model.lr_schedule(0.0) == pytest.approx(min(expected, Falling(1.0, to=0.02)(0.0)))


def test_a_run_and_its_continuation(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    wild = PpoArgs(
        name="wild", steps=16 * 512, warmup_steps=0, num_envs=32, n_steps=16, batch_size=128, net_width=8,
        eval_every=10_000, eval_episodes=2, report_episodes=2, video_seconds=0.0, learning_rate=0.02,
    )  # fmt: skip
    calm = dataclasses.replace(wild, name="calm", desired_kl=DESIRED)
    halfway = StopAt(8 * 512)
    changes = {args.name: np.median(kls(train(args, [halfway]).path)[-4:]) for args in (wild, calm)}
    assert changes["calm"] < 0.5 * changes["wild"], changes
    calm_rate, wild_rate = (rate_of(tmp_path / "runs" / name) for name in ("calm", "wild"))
    assert calm_rate < 0.5 * wild_rate
    resumed = train(PpoArgs(resume="calm"), [StopAt(9 * 512)])
    assert rate_of(resumed.path) <= FASTER * calm_rate


class StopAt(BaseCallback):
    """Ends training after a number of steps of the run."""

    def __init__(self, steps: int) -> None:
        super().__init__()
        self.steps = steps

    def _on_step(self) -> bool:
        return self.num_timesteps < self.steps


def kls(run: Path) -> list[float]:
    rows = json.loads((run / "evaluations.json").read_text())["updates"]
    return [row["kl"] for row in rows if "kl" in row]


def rate_of(run: Path) -> float:
    model = PPO.load(run / "model.zip", device="cpu")
    return float(model.policy.optimizer.param_groups[0]["lr"])


class _Logger:
    def __init__(self, values: dict[str, Any]) -> None:
        self.name_to_value = values
