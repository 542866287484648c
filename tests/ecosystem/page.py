"""docs/works_with.md: its sections as programs, and what they print."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from tests.helpers import ROOT
from tests.pages import WORKS_WITH, blocks

IN_ANOTHER_ENVIRONMENT = ("RLlib",)
"""The sections whose libraries cannot be installed beside the rest."""


def sections() -> dict[str, list[tuple[str, str]]]:
    """The sections with code: the blocks of each, as (language, text)."""
    headings = [line.lstrip("# ") for line in WORKS_WITH.read_text().splitlines() if line.startswith("#")]
    found: dict[str, list[tuple[str, str]]] = {}
    for block in blocks(WORKS_WITH):
        found.setdefault(headings[block.section - 1], []).append((block.language, block.code))
    return found


def run_section(name: str, folder: Path) -> str:
    """Run a section's programs in a folder, a process each, and return what they printed.

    What stands in a block `text` is what the program above it prints. Blocks of other languages than `python` and
    `bash` are for reading: how to install, and what was printed once.
    """
    printed = []
    for language, text in sections()[name]:
        if language == "text":
            assert printed[-1] == text, printed[-1]
        elif language in ("python", "bash"):
            printed.append(run(language, text, folder))
    assert sections()[name] and printed
    return "".join(printed)


def run(language: str, text: str, folder: Path) -> str:
    """Run a program, with `agents` in the folder as in a checkout; what it printed.

    `python` is the one that runs the tests, and finds the package.
    """
    script = folder / f"example.{language}"
    script.write_text(text)
    if not (folder / "agents").exists():
        (folder / "agents").symlink_to(ROOT / "agents")
    command = [sys.executable, script] if language == "python" else ["bash", "-eu", script]
    environment = os.environ | {
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": str(ROOT),
        "PYTHONWARNINGS": "ignore",
        "MINARI_DATASETS_PATH": str(folder / "datasets"),  # not in the home folder
    }
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-4000:]
    return done.stdout
