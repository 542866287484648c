"""What the commands have in common."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import dataclass

import pytest

from scripts._command import run_command
from tests.helpers import ROOT


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


COMMAND = """
import sys
from dataclasses import dataclass
from scripts._command import run_command

@dataclass(frozen=True)
class NoArgs:
    pass

def act(_: NoArgs) -> None:
    {body}

run_command("command", NoArgs, act)
"""


def outcome(output: int, body: str, *arguments: str) -> tuple[int, str]:
    """The exit code of a command that writes to `output` and does what `body` says, and its messages."""
    done = subprocess.run(
        [sys.executable, "-c", COMMAND.format(body=body), *arguments],
        cwd=ROOT,
        stdout=output,
        stderr=subprocess.PIPE,
        text=True,
    )
    return done.returncode, done.stderr


@pytest.mark.parametrize(
    ("body", "arguments"),
    [
        ("pass", ["--help"]),
        ("print('a few words')", []),
        ("print('many words' * 100_000)", []),
        ("[print('a line') for _ in range(100_000)]", []),
        ("import rich; rich.print('a few words')", []),
    ],
)
def test_a_reader_that_has_ended_ends_it_quietly(body: str, arguments: list[str]) -> None:
    """As in `python -m scripts.train_ppo --help | head -5`."""
    reading, writing = os.pipe()
    os.close(reading)
    try:
        assert outcome(writing, body, *arguments) == (1, "")
    finally:
        os.close(writing)


def test_another_broken_pipe_is_told() -> None:
    code, said = outcome(subprocess.DEVNULL, "raise BrokenPipeError('the worker has ended')")
    assert code == 1
    assert said == "command: the worker has ended\n"


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full")
def test_a_full_disk_under_the_output_is_told() -> None:
    with open("/dev/full", "w") as full:
        code, said = outcome(full.fileno(), "print('a few words')")
    assert code == 1
    assert said.startswith("command: ") and said.count("\n") == 1
