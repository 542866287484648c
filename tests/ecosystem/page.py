"""docs/works_with.md: its sections as programs, and what they print."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from tests.test_docs import ROOT, blocks

PAGE = ROOT / "docs" / "works_with.md"
IN_ANOTHER_ENVIRONMENT = ("RLlib",)
"""The sections whose libraries cannot be installed beside the rest."""


def sections() -> dict[str, list[tuple[str, str]]]:
    """The sections that have code: what stands in the code blocks of each, as (language, text)."""
    headings = [line.lstrip("# ") for line in PAGE.read_text().splitlines() if line.startswith("#")]
    found: dict[str, list[tuple[str, str]]] = {}
    for block in blocks(PAGE):
        found.setdefault(headings[block.section - 1], []).append((block.language, block.code))
    return found


def run_section(name: str, folder: Path) -> None:
    """Run a section's programs, one process each, in a folder; what they print is what stands below them."""
    printed = None
    for language, text in sections()[name]:
        if language == "text":
            assert printed == text, f"{name} prints\n{printed}"
            continue
        script = folder / ("example.py" if language == "python" else "example.sh")
        script.write_text(text)
        command = [sys.executable, script] if language == "python" else ["bash", "-eu", script]
        done = subprocess.run(command, cwd=folder, env=environment(), capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        printed = done.stdout


def environment() -> dict[str, str]:
    """For a program that runs from any folder: `python` is this one, and finds the package."""
    return os.environ | {
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": str(ROOT),
        "PYTHONWARNINGS": "ignore",
    }
