"""Fixtures that several files share. Nothing is shown on a screen, and nothing is heard."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from tests.helpers import Call

os.environ.update(SDL_VIDEODRIVER="dummy", PYGAME_HIDE_SUPPORT_PROMPT="1")


@pytest.fixture
def call(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Call:
    """Call a command in this process, from `tmp_path`; what it printed, the message of its exit included."""

    def call(script: str, *arguments: str, fails: bool = False) -> str:
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "argv", [script, *arguments])
        message = ""
        try:
            import_module(f"scripts.{script}").main()
            failed = False
        except SystemExit as stop:  # anything else would be a traceback
            failed = stop.code not in (None, 0)
            message = " ".join(stop.code.split()) if isinstance(stop.code, str) else ""  # however its lines are broken
        printed = capsys.readouterr()
        everything = f"{printed.out}{printed.err}{message}"
        assert failed == fails, everything
        return everything

    return call


@pytest.fixture
def pygame(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """The library, with no window open before or after."""
    monkeypatch.setenv("SDL_AUDIODRIVER", "dummy")  # PettingZoo sets another when it is imported
    module = pytest.importorskip("pygame", reason="needs pygame-ce")
    module.display.quit()
    yield module
    module.mixer.quit()
    module.display.quit()


@pytest.fixture
def small_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Threads share batches of 1,000 tables or more, so that a test of theirs is quick."""
    monkeypatch.setattr("airhockey_env.game.ROWS_PER_THREAD", 500)
