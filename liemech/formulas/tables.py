"""Tables: many numbers of which a formula reads some, by an index that is known at run time only."""

from __future__ import annotations

import weakref
from typing import Any

import numpy as np

from .functions import where
from .numbers.bases import StandIn


class Table:
    """Numbers that stay where they lie in memory, however many; `entry` reads one.

    Native code is told the place and nothing else, so that tables of all lengths share one code,
    made in the same time.

    place : the address in words of eight bytes, exact as a float.  content : the bytes; None in
    native code.
    """

    __slots__ = ("__weakref__", "array", "content", "place")

    def __init__(self, numbers: Any) -> None:
        self.content: Any = np.ascontiguousarray(numbers, dtype=np.float64).tobytes()
        self.array: Any = np.frombuffer(self.content)
        address = self.array.ctypes.data
        self.place: Any = float(address // 8)
        if address % 8 or int(self.place) * 8 != address:  # no Python does so
            raise MemoryError(
                f"a table of {len(self.array)} numbers lies at {address:#x}, which native code cannot use"
            )
        _alive[self.place] = self

    @staticmethod
    def at(place: Any) -> Table:
        """The table that lies here; in native code one of which nothing else is known."""
        if not isinstance(place, StandIn):
            return _alive[place]
        table = object.__new__(Table)
        table.content, table.array, table.place = None, None, place
        return table

    def part(self, begin: int) -> Table:
        """The rest of the table from an entry on, where it lies."""
        tail = object.__new__(Table)
        tail.content, tail.array = self.content, self.array[begin:]
        tail.place = self.place + begin
        _alive.setdefault(tail.place, tail)
        return tail

    def __len__(self) -> int:
        return len(self.array)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return self.array if dtype is None and not copy else np.array(self.array, dtype=dtype)

    def __reduce__(self) -> tuple[Any, ...]:
        return Table, (np.array(self.array),)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Table) and self.content == other.content

    def __hash__(self) -> int:
        return hash(self.content)

    def __repr__(self) -> str:
        return f"Table({len(self)} numbers)"


_alive: weakref.WeakValueDictionary[float, Table] = weakref.WeakValueDictionary()


def entry(table: Table, i: Any) -> Any:
    """Number i of a table, 0 <= i < len(table).

    Native code knows no length and does not check it: those who ask clip their indices, for nan and
    infinite times too.
    """
    return table.array.item(i)


def last_up_to(table: Table, low: Any, high: Any, x: Any, below: bool = False) -> Any:
    """The largest i from low to high with table[i] <= x, or with `below` table[i] < x; low if there is none.  The table
    rises; native code bisects it too.
    """
    high = high + 1
    while high - low > 1:
        middle = (low + high) // 2
        later = x > entry(table, middle) if below else x >= entry(table, middle)
        low, high = where(later, middle, low), where(later, high, middle)
    return low


def whole(table: Table, i: Any) -> int:
    """Entry number i of a table of whole numbers, as `of_whole` makes it."""
    return int(table.array.view(np.int64)[i])


def of_whole(numbers: Any) -> Table:
    """A table of whole numbers."""
    return Table(np.ascontiguousarray(numbers, dtype=np.int64).view(np.float64))
