"""How the contacts of a step stand in `info`."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import repeat
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airhockey_env.compiled import compiled
from airhockey_env.engine.records import CONTACT


class Contacts:
    """The contacts of one step on one table, in the order of time. Behaves like the structured array that it holds.

    `len(contacts)`, `contacts["impulse"]`, `contacts[0]`, iteration, `np.asarray(contacts)` and the attributes
    `dtype`, `shape` and `size` are those of the array (see `AirTable.step` for its fields). It is not an array itself
    because Gymnasium's SyncVectorEnv and AsyncVectorEnv stack arrays in infos, and demand that they are all of one
    shape: the number of contacts varies.
    """

    __slots__ = ("_all", "_first", "_last")

    def __init__(self, contacts: NDArray[np.void], first: int, last: int) -> None:
        """Those from `first` to `last` (excluded) of the contacts of many tables; taken out when they are asked for."""
        self._all = contacts
        self._first = first
        self._last = last

    @property
    def rows(self) -> NDArray[np.void]:
        """The structured array."""
        return self._all[self._first : self._last]

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
        return Contacts, (np.array(self.rows), 0, len(self.rows))  # without those of other tables

    def __repr__(self) -> str:
        return f"Contacts({self.rows!r})"


NO_CONTACTS = Contacts(np.zeros(0, CONTACT), 0, 0)


def batch_contacts(
    buffer: NDArray[np.void], counts: NDArray[np.int32], present: NDArray[np.bool_]
) -> NDArray[np.object_]:
    """The contacts of a step on every table, as Gymnasium's vector infos hold objects: (N,), None where not present.

    Most tables have none in most steps, so the others are copied out of the engine's buffer together.
    """
    contacts = np.empty(len(counts), dtype=object)
    contacts.fill(NO_CONTACTS)
    together, rows, bounds = _gather(buffer, counts)
    if len(rows):
        ends = bounds.tolist()
        made = map(Contacts, repeat(together), ends, ends[1:])
        contacts[rows] = np.fromiter(made, dtype=object, count=len(rows))
    if not present.all():
        contacts[~present] = None
    return contacts


@compiled
def _gather(buffer, counts):
    """The first `counts[i]` contacts of every row i, one after the other; the rows that have any; where each begins."""
    n, rows = 0, 0
    for i in range(counts.shape[0]):
        n += counts[i]
        rows += counts[i] > 0
    together = np.empty(n, buffer.dtype)
    having = np.empty(rows, np.int64)
    bounds = np.zeros(rows + 1, np.int64)
    n, rows = 0, 0
    for i in range(counts.shape[0]):
        if counts[i] > 0:
            for k in range(counts[i]):
                together[n] = buffer[i, k]
                n += 1
            having[rows] = i
            rows += 1
            bounds[rows] = n
    return together, having, bounds
