"""Print tables in a terminal so that they fit its width without breaking words or numbers."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

GAP = 2
"""Spaces between two columns."""

LONGEST_WORD = 24
"""Length of the longest word that is never broken in a text column; longer ones, such as paths, are."""


def print_table(title: str, cells: Sequence[Sequence[str]], names: int = 0) -> None:
    """Print a table.

    If it is too wide, texts and heads are wrapped between words. If it is still too wide, the table is split between
    columns, and each part repeats the names of the rows.

    Args:
        title: printed above the table.
        cells: a row of heads, then rows of as many cells. The heads are not printed if all are empty.
        names: number of the column with the names of the rows. It and the columns before it are repeated in each part.
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
    """The width of the longest word or number of a column."""
    words = column[0].split() + ([word for cell in column[1:] for word in cell.split()] if text else list(column[1:]))
    longest = max(map(len, words), default=0)
    return max(1, min(longest, LONGEST_WORD) if text else longest)


def _parts(columns: Sequence[Sequence[str]], texts: Sequence[bool], width: int) -> list[list[int]]:
    """Split the columns into as few parts as fit, of about equal length; text columns are in every part."""
    again = [k for k, text in enumerate(texts) if text]
    others = [k for k, text in enumerate(texts) if not text]
    for number in range(1, len(others) + 1):
        bounds = [len(others) * k // number for k in range(number + 1)]
        parts = [[*again, *others[first:last]] for first, last in pairwise(bounds)]
        if all(sum(_least(columns[k], texts[k]) + GAP for k in part) - GAP <= width for part in parts):
            return parts
    return [[*again, k] for k in others] or [again]


def _widths(columns: Sequence[Sequence[str]], texts: Sequence[bool], width: int) -> list[int]:
    """The widths of all columns: the least that each needs; spare space goes to the columns that lack most."""
    widths = [_least(column, text) for column, text in zip(columns, texts, strict=True)]
    for _ in range(width - sum(widths) - GAP * (len(widths) - 1)):
        lacks = [max(map(len, column)) - now for column, now in zip(columns, widths, strict=True)]
        if max(lacks) <= 0:
            break
        widths[lacks.index(max(lacks))] += 1
    return widths
