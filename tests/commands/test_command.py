"""What the commands have in common."""

from __future__ import annotations

import sys
from dataclasses import dataclass

import pytest

from scripts._command import run_command


@dataclass(frozen=True)
class NoArgs:
    """No arguments."""


@pytest.mark.parametrize("error", [ValueError, OSError, MemoryError])
def test_errors_are_read_in_80_columns(error: type[Exception], monkeypatch: pytest.MonkeyPatch) -> None:
    path = "/a-long-path/" * 9
    said = f"--option must be one of {list(range(60))}, got {path}"

    def act(_: NoArgs) -> None:
        raise error(said)

    monkeypatch.setattr(sys, "argv", ["command"])
    with pytest.raises(SystemExit) as stop:
        run_command("command", NoArgs, act)
    lines = str(stop.value.code).splitlines()
    assert len(lines) > 2
    assert all(len(line) <= 80 or line == path for line in lines)
    assert " ".join(lines).endswith(said)
