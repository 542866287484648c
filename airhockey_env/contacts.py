"""How the contacts of a step stand in `info`."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import repeat
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airhockey_env.engine.records import CONTACT


class Contacts:
    """The contacts of one step on one table, in the order of time. Behaves like the structured array that it holds.

    `len(contacts)`, `contacts["impulse"]`, `contacts[0]`, iteration, `np.asarray(contacts)` and the attributes
    `dtype`, `shape` and `size` are those of the array (see `AirTable.step` for its fields). It is not an array itself
    because Gymnasium's SyncVectorEnv and AsyncVectorEnv stack arrays in infos, and demand that they are all of one
    shape: the number of contacts varies.
    """

    __slots__ = ("_block", "_count", "_row")

    def __init__(self, block: NDArray[np.void], row: int, count: int) -> None:
        """The first `count` contacts in a row of `block`, (rows, contacts); taken out of it when they are asked for."""
        self._block = block
        self._row = row
        self._count = count

    @property
    def rows(self) -> NDArray[np.void]:
        """The structured array."""
        return self._block[self._row, : self._count]

    @property
    def dtype(self) -> np.dtype:
        return self.rows.dtype

    @property
    def shape(self) -> tuple[int, ...]:
        return self.rows.shape

    @property
    def size(self) -> int:
        return self.rows.size

    def __len__(self) -> int:
        return len(self.rows)

    def __iter__(self) -> Iterator[np.void]:
        return iter(self.rows)

    def __getitem__(self, key: Any) -> Any:
        return self.rows[key]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return np.array(self.rows, dtype=dtype) if copy or dtype is not None else self.rows

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Contacts) and np.array_equal(self.rows, other.rows)

    __hash__ = None  # type: ignore[assignment]

    def __reduce__(self) -> tuple[Any, ...]:
        return Contacts, (np.array(self.rows)[np.newaxis], 0, self._count)  # without the other rows of the block

    def __repr__(self) -> str:
        return f"Contacts({self.rows!r})"


NO_CONTACTS = Contacts(np.zeros((1, 0), CONTACT), 0, 0)


def batch_contacts(
    buffer: NDArray[np.void], counts: NDArray[np.int32], present: NDArray[np.bool_]
) -> NDArray[np.object_]:
    """The contacts of a step on every table, as Gymnasium's vector infos hold objects: (N,), None where not present.

    Most tables have none in most steps, so the others are copied out of the engine's buffer together.
    """
    contacts = np.empty(len(counts), dtype=object)
    contacts.fill(NO_CONTACTS)
    rows = np.flatnonzero(counts)
    if len(rows):
        made = map(Contacts, repeat(buffer[rows]), range(len(rows)), counts[rows].tolist())
        contacts[rows] = np.fromiter(made, dtype=object, count=len(rows))
    if not present.all():
        contacts[~present] = None
    return contacts
