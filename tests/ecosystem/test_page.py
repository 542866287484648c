"""docs/works_with.md does what it says."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.ecosystem.page import IN_ANOTHER_ENVIRONMENT, run_section, sections

TESTED_BELOW = ("Works with", "A single file", "RL-Zoo")


@pytest.mark.parametrize("name", [name for name in sections() if name not in (*IN_ANOTHER_ENVIRONMENT, *TESTED_BELOW)])
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
