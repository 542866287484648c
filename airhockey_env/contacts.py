"""How the contacts of a step stand in `info`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray


class Contacts:
    """The contacts of one step on one table, in the order of time. Behaves like the structured array that it holds.

    `len(contacts)`, `contacts["impulse"]`, `contacts[0]`, iteration, `np.asarray(contacts)` and the attributes
    `dtype`, `shape` and `size` are those of the array (see `AirTable.step` for its fields). It is not an array itself
    because Gymnasium's SyncVectorEnv and AsyncVectorEnv stack arrays in infos, and demand that they are all of one
    shape: the number of contacts varies.
    """

    __slots__ = ("rows",)

    def __init__(self, rows: NDArray[np.void]) -> None:
        self.rows = rows

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

    def __repr__(self) -> str:
        return f"Contacts({self.rows!r})"


class BatchContacts:
    """The contacts of one step on every table of a batch: `contacts[i]` are those of table i, as `Contacts`.

    They are read from the engine's buffer when they are asked for, so that a step which nobody asks costs nothing.
    The next step overwrites that buffer: after it, asking raises RuntimeError. `np.asarray(contacts)` makes an
    object array of copies in time, as does copying or pickling.
    """

    def __init__(self, buffer: NDArray[np.void], counts: NDArray[np.int32], age: list[int]) -> None:
        self._buffer = buffer
        self._counts = counts
        self._age = age  # a one-element list that the batch changes with every step
        self._born = age[0]

    def __len__(self) -> int:
        return len(self._counts)

    def __getitem__(self, i: Any) -> Any:
        if not isinstance(i, (int, np.integer)):
            return self.__array__()[i]
        if self._age[0] != self._born:
            raise RuntimeError("contacts of an earlier step: the next step has overwritten them, copy them in time")
        return Contacts(self._buffer[i, : self._counts[i]].copy())

    def __iter__(self) -> Iterator[Contacts]:
        return (self[i] for i in range(len(self)))

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[np.object_]:
        array = np.empty(len(self), dtype=object)
        for i in range(len(self)):
            array[i] = self[i]
        return array

    def __reduce__(self) -> tuple[Any, ...]:
        return _from_array, (self.__array__(),)

    def __repr__(self) -> str:
        return f"BatchContacts(num_envs={len(self)}, in all={int(self._counts.sum())})"


def _from_array(array: NDArray[np.object_]) -> NDArray[np.object_]:
    return array
