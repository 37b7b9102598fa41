"""Columns: values of all sites, by name, in rows of memory."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np

from ..errors import InvalidType
from .classes.layouts import Layout, build, carried_layout, difference, fits, leaves
from .classes.records import Record
from .numbers.conversions import fitted
from .sites import present_site


class Column:
    """The values of one name at all sites, in rows of an array that has a place for each site.

    rows : the rows of the numbers of a value, in order.  layout : the layout of a value.
    """

    __slots__ = ("array", "layout", "rows")

    def __init__(self, array: Any, rows: Sequence[int], layout: Layout) -> None:
        self.array, self.rows, self.layout = array, rows, layout

    def load(self) -> Any:
        """The value at this site.  Native code may load it more than once: nothing is saved before the last meeting."""
        return self.at(present_site())

    def save(self, value: Any) -> None:
        """Set the value of this site, after the last meeting."""
        self.put(present_site(), value)

    def at(self, i: int) -> Any:
        """The value of site i.  In a loop over sites it is one that the loop does not save."""
        numbers = np.ascontiguousarray(self.array[self._index, i])
        if not self.layout.has_integers:
            return build(self.layout, iter(numbers.tolist()))
        in_both_types = zip(numbers.tolist(), numbers.view(np.int64).tolist(), self.layout.kinds)
        return build(self.layout, (_WHOLE[kind](n) if kind in _WHOLE else x for x, n, kind in in_both_types))

    def put(self, i: int, value: Any) -> None:
        """Set the value of site i, outside of loops over sites.  Raises InvalidType for one of another layout."""
        value = fitted(value, self.layout) if self.layout.remembers else value
        actual = carried_layout(value)
        if not fits(actual, self.layout):
            raise InvalidType(difference(actual, self.layout, "the value of a site"))
        numbers = np.empty(self.layout.width)
        for k, (x, kind) in enumerate(zip(leaves(value, self.layout), self.layout.kinds)):
            (numbers.view(np.int64) if kind in _WHOLE else numbers)[k] = x
        self.array[self._index, i] = numbers

    @property
    def _index(self) -> Any:
        rows = self.rows
        return slice(rows.start, rows.stop) if isinstance(rows, range) else rows

    @property
    def width(self) -> int:
        """The number of numbers in a value."""
        return self.layout.width

    @property
    def fields(self) -> Any:
        """The columns of the fields of a record, by name."""
        columns, begin = {}, 0
        for name, part in zip(self.layout.detail[1], self.layout.parts, strict=True):
            columns[name] = Column(self.array, self.rows[begin : begin + part.width], part)
            begin += part.width
        return SimpleNamespace(**columns)

    def nth(self, k: int) -> Column:
        """The column of part number k of the values; a k that is known at run time only takes parts of one layout."""
        part, begin = self.layout.parts[k], sum(part.width for part in self.layout.parts[:k])
        return Column(self.array, self.rows[begin : begin + part.width], part)

    def heads(self, n: int) -> Any:
        """The columns of the fields, of vectors with their first n entries only, of matrices with their first n rows."""
        columns = vars(self.fields).items()
        return SimpleNamespace(**{name: Column(x.array, *_headed(x.rows, x.layout, n)) for name, x in columns})


_WHOLE: dict[str, Any] = {"integer": int, "truth": bool}
"""Numbers of 64 bits that are no floats."""


def _headed(rows: Sequence[int], layout: Layout, n: int) -> tuple[Sequence[int], Layout]:
    """The rows and the layout of the first n entries or rows."""
    if layout.kind in ("vec", "mat"):
        head = Layout(layout.kind, layout.parts[:n], layout.detail)
        return rows[: head.width], head
    head_rows: list[int] = []
    parts: list[Layout] = []
    begin = 0
    for part in layout.parts:
        part_rows, head = _headed(rows[begin : begin + part.width], part, n)
        begin, head_rows, parts = begin + part.width, [*head_rows, *part_rows], [*parts, head]
    whole = len(head_rows) == len(rows)
    return (rows if whole else head_rows), Layout(layout.kind, tuple(parts), layout.detail)


def named(**parts: Layout) -> Layout:
    """The layout of a record of these parts."""
    return Layout("record", tuple(parts.values()), (Record, tuple(parts)))


def columns_of(array: Any, parts: dict[str, Any]) -> Any:
    """The columns of values by name, one after another in the rows of an array; a tuple of layouts stands for parts alike."""
    layouts = {name: Layout("tuple", x) if isinstance(x, tuple) else x for name, x in parts.items()}
    layout = named(**layouts)
    return Column(array, range(layout.width), layout).fields
