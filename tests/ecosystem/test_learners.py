"""Other implementations of PPO learn with the recipe of `train_ppo`."""

from __future__ import annotations

import json
from pathlib import Path

from agents.training.ppo import PpoArgs, resolve
from benchmarks.learners import LEARNERS
from scripts.learner_study import LearnerStudyArgs, study

STEPS = (16_384, 40_960, 57_344)
"""At which they are evaluated: where rollouts end. Practice ends within one, after half of 49,152 steps."""


def test_all_learners_train_on_equal_terms(tmp_path: Path) -> None:
    path = tmp_path / "rows.json"
    rows = study(LearnerStudyArgs(steps=49_152, eval_every=10_000, points=20, json=path))
    assert json.loads(path.read_text()) == rows
    assert [(row["learner"], row["steps"]) for row in rows] == [
        (learner.name, steps) for learner in LEARNERS.values() for steps in STEPS
    ]
    assert all(row["points"] == 20 and row["seconds"] > 0.0 for row in rows)


def test_sbx_has_the_network_and_the_settings_of_train_ppo() -> None:
    args = resolve(PpoArgs())
    sb3, sbx = (LEARNERS[name].make(args) for name in ("sb3", "sbx"))
    for setting in ("n_steps", "batch_size", "n_epochs", "gamma", "gae_lambda", "max_grad_norm", "sde_sample_freq"):
        assert getattr(sbx, setting) == getattr(sb3, setting), setting
    layers = sbx.policy.actor_state.params["params"]
    shapes = [tuple(reversed(layers[f"Dense_{k}"]["kernel"].shape)) for k in range(3)]
    ours = [
        layer.weight.shape
        for layer in (*sb3.policy.mlp_extractor.policy_net, sb3.policy.action_net)
        if hasattr(layer, "weight")
    ]
    assert shapes == [tuple(shape) for shape in ours]
