"""The blocks of code on a page of the docs. Needs nothing but Python: tests of other environments read pages too.

`python tests/pages.py PAGE` prints the Python blocks of a page, as a program.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import NamedTuple

DOCS = Path(__file__).parents[1] / "docs"
WORKS_WITH, DATASETS = DOCS / "works_with.md", DOCS / "datasets.md"
"""The pages whose blocks tests/ecosystem runs."""


class Block(NamedTuple):
    """A block of code on a page."""

    section: int  # number of the heading that it stands under
    line: int  # of the page, where the code begins
    language: str
    code: str


def blocks(page: Path) -> list[Block]:
    """The blocks of code on a page, in order."""
    found: list[Block] = []
    section, start, language = 0, 0, ""
    lines = page.read_text(encoding="utf-8").splitlines()
    for number, line in enumerate(lines):
        if start:
            if line == "```":
                found.append(Block(section, start, language, "\n".join(lines[start:number]) + "\n"))
                start = 0
        elif line.startswith("```"):
            start, language = number + 1, line[3:]
        elif line.startswith("#"):
            section += 1
    assert not start, f"{page}: a block of code does not end"
    return found


if __name__ == "__main__":
    print("\n".join(block.code for block in blocks(Path(sys.argv[1])) if block.language == "python"))
