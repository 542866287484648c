"""Ray's RLlib, which pins an older Gymnasium than the other libraries take: .venv-distributed."""

from __future__ import annotations

import secrets
from pathlib import Path

import pytest

from tests.ecosystem.page import run_section


def test_section(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER", "0")  # on every system: no ports but this machine's own
    monkeypatch.setenv("RAY_AUTH_TOKEN", secrets.token_hex(32))  # or it writes one into the home folder
    monkeypatch.setenv("RAY_USAGE_STATS_ENABLED", "0")
    run_section("RLlib", tmp_path)
