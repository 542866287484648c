"""Write measured tables into a Markdown page, between markers in the page."""

from __future__ import annotations

import re
from pathlib import Path

from airhockey_env.files import replace

Rows = list[tuple[str, ...]]


def markdown(rows: Rows) -> str:
    """Format a table in Markdown; the first row is the head."""
    head, *body = rows
    lines = [head, tuple("---" for _ in head), *body]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def write(path: Path, text: str) -> None:
    """Write a page atomically."""
    replace(path, lambda part: part.write_text(text, encoding="utf-8"))


def insert(page: str, part: str, rows: Rows) -> str:
    """Return the page with the table of a part replaced.

    Raises:
        ValueError: the page does not have the markers of this part exactly once.
    """
    start, end, pattern = _place(part)
    check(page, part)
    return pattern.sub(lambda _: f"{start}\n{markdown(rows)}\n{end}", page)


def check(page: str, part: str) -> None:
    """Raise ValueError unless the page has the markers of a part exactly once."""
    start, end, pattern = _place(part)
    if len(pattern.findall(page)) != 1:
        raise ValueError(f"the page must have one place for the table of {part!r}, between {start!r} and {end!r}")


def _place(part: str) -> tuple[str, str, re.Pattern[str]]:
    """The start and end markers of a part, and a pattern that matches them and everything in between."""
    start, end = f"<!-- table {part} -->\n", f"<!-- end of table {part} -->\n"
    return start, end, re.compile(re.escape(start) + ".*?" + re.escape(end), re.DOTALL)
