"""The study of training on several processors does all of its parts."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.helpers import run

pytest.importorskip("ray", reason="needs Ray")


def test_the_command(tmp_path: Path) -> None:
    printed = run("cluster_study", "--quick", "--per-second", "60000", "90000", "--json", "found.json", folder=tmp_path)
    assert "RLlib" in printed
    found = json.loads((tmp_path / "found.json").read_text())
    costs = found["model"]["costs"]
    # Measured on whatever machine this is, a small cost may be too small to be seen. None is negative.
    assert all(costs[name] >= 0.0 for name in ("table", "sample", "latency", "size"))
    assert costs["sample"] > 0.0
    for rows in found["model"]["expected"].values():
        assert [row["workers"] for row in rows] == [1, 2, 4, 8, 16, 32, 64, 128, 256]
    assert {row["library"] for row in found["rllib"]} == {"RLlib", "Stable-Baselines3"}
    assert all(row["per_second"] > 0.0 for row in found["rllib"])
