"""Tables of numbers in a terminal: they fit its width without breaking a word, a number or a head's words."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

GAP = 2
"""Between two columns."""

LONGEST_WORD = 24
"""Letters of the longest word that a text column keeps whole; longer ones, such as paths, are folded."""


def print_table(title: str, cells: Sequence[Sequence[str]], names: int = 0) -> None:
    """Print a table. Where it is too wide, texts and heads are wrapped between words; where that is not enough, the
    table is cut between two columns, and what follows is printed below with the names again.

    Args:
        title: stands over it.
        cells: a row of heads, then rows of as many cells. No heads are shown if all are empty.
        names: number of the column that says what a row is about; it and all before it come again after a cut.
    """
    from rich.console import Console
    from rich.table import Table

    console = Console()
    columns = list(zip(*cells, strict=True))
    texts = [k <= names for k in range(len(columns))]
    for part in _parts(columns, texts, console.width):
        table = Table(
            title=title, box=None, padding=(0, GAP, 0, 0), pad_edge=False, show_header=any(cells[0])
        )  # fmt: skip
        for k, width in zip(
            part, _widths([columns[k] for k in part], [texts[k] for k in part], console.width), strict=True
        ):
            table.add_column(columns[k][0], justify="left" if k == names else "right", width=width, overflow="fold")
        for row in cells[1:]:
            table.add_row(*(row[k] for k in part))
        console.print(table)


def _least(column: Sequence[str], text: bool) -> int:
    """The width of its longest word or number."""
    words = column[0].split() + ([word for cell in column[1:] for word in cell.split()] if text else list(column[1:]))
    longest = max(map(len, words), default=0)
    return max(1, min(longest, LONGEST_WORD) if text else longest)


def _parts(columns: Sequence[Sequence[str]], texts: Sequence[bool], width: int) -> list[list[int]]:
    """Numbers of the columns of each part, the texts in all of them: as few parts as fit, about equally long."""
    again = [k for k, text in enumerate(texts) if text]
    others = [k for k, text in enumerate(texts) if not text]
    for number in range(1, len(others) + 1):
        bounds = [len(others) * k // number for k in range(number + 1)]
        parts = [[*again, *others[first:last]] for first, last in pairwise(bounds)]
        if all(sum(_least(columns[k], texts[k]) + GAP for k in part) - GAP <= width for part in parts):
            return parts
    return [[*again, k] for k in others] or [again]


def _widths(columns: Sequence[Sequence[str]], texts: Sequence[bool], width: int) -> list[int]:
    """The widths of all columns: the least that each needs, and what is left goes to those that lack most."""
    widths = [_least(column, text) for column, text in zip(columns, texts, strict=True)]
    for _ in range(width - sum(widths) - GAP * (len(widths) - 1)):
        lacks = [max(map(len, column)) - now for column, now in zip(columns, widths, strict=True)]
        if max(lacks) <= 0:
            break
        widths[lacks.index(max(lacks))] += 1
    return widths
