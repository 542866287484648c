"""docs/works_with.md does what it says."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.ecosystem.page import IN_ANOTHER_ENVIRONMENT, run_section, sections

TESTED_ELSEWHERE = (*IN_ANOTHER_ENVIRONMENT, "Works with", "A single file", "RL-Zoo", "Tianshou", "Weights & Biases")


@pytest.mark.parametrize("name", [name for name in sections() if name not in TESTED_ELSEWHERE])
def test_section(name: str, tmp_path: Path) -> None:
    run_section(name, tmp_path)


def test_a_single_file_learns(tmp_path: Path) -> None:
    printed = run_section("A single file", tmp_path)
    before, after = map(int, re.findall(r"(\d+)%", printed))
    assert before < 30 and after > 60


def test_rl_zoo_trains_and_plays(tmp_path: Path) -> None:
    run_section("RL-Zoo", tmp_path)
    (run,) = (tmp_path / "logs" / "ppo").glob("AirHockeyHit-v0_*")
    assert (run / "AirHockeyHit-v0.zip").exists()


def test_weights_and_biases_gets_the_curves_and_the_model(tmp_path: Path) -> None:
    run_section("Weights & Biases", tmp_path)
    assert (tmp_path / "models" / "model.zip").exists()
    (run,) = tmp_path.glob("wandb/offline-run-*/run-*.wandb")
    for curve in (b"rollout/ep_rew_mean", b"rollout/success_rate", b"time/fps"):
        assert curve in run.read_bytes()
