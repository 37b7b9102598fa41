"""One row: a method called with one array for each argument, without the preparations for many.

Nothing is decided here that the long way would not decide: whatever is not plainly one finite row of
the right shape, and whatever fails, goes the long way, which says why.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from time import perf_counter
from typing import Any

import numpy as np

from ..arrays import at_a_glance
from ..classes.signatures import Signature
from ..numbers.complex_numbers import Complex
from ..vectors import Mat, Vec, small
from .batches import AXES, MEMBERSHIP, Batch, who_knows_elements

_FLOATS, _PAIRS = frozenset([float]), {Complex}
_DOUBLE, _COMPLEX = np.dtype(float), np.dtype(complex)


class OneRow:
    """The form of a row that a method of one owner takes: the shapes of its arguments (None: any of so many axes), and
    which are elements.

    native : the method in native code, once that pays.
    """

    __slots__ = ("axes", "batch", "dtypes", "elements", "formula", "least", "native", "next", "shapes", "spent")

    def __init__(self, signature: Signature, owner: Any, kinds: list[str]) -> None:
        self.formula, self.least = signature.formula, len(signature.names)
        self.least -= len(signature.defaults)
        self.shapes: list[Any] = [
            () if kind == "float" else owner._shape(name, kind) for name, kind in zip(signature.names, kinds)
        ]
        self.axes = [AXES.get(kind) for kind in kinds]
        self.dtypes = [_COMPLEX if owner._complex(kind) else _DOUBLE for kind in kinds]
        self.elements = [i for i, kind in enumerate(kinds) if kind == "Element"]
        self.batch = (signature, owner)
        self.native: Callable[[Any, tuple[Any, ...]], Any] | None = None
        self.spent, self.next = 0.0, 0.0 if (self.formula, type(owner)) in MADE else SOON

    def rows(self, args: tuple[Any, ...]) -> Batch:
        """The arguments as a batch of one row."""
        signature, owner = self.batch
        columns = zip(signature.names, args, self.dtypes)
        arrays = {name: np.array(value, dtype=dtype)[None] for name, value, dtype in columns}
        elements = tuple([signature.names[i] for i in self.elements if i < len(args)])
        where = f"{type(owner).__name__}.{signature.name}"
        promise = signature if signature.promise else None
        return Batch(self.formula, owner, arrays, {}, elements, owner, where, (1,), promise)


SOON = 0.005
"""Seconds of plain Python after which native code is asked for."""

MADE: set[Any] = set()
"""Formulas of classes that have native code in this process: other owners ask for it at once."""

prepare: Callable[[OneRow, tuple[Any, ...], Any], None] | None = None
"""Looks for native code, given a row, its arguments and the result: it sets `native`, or `next`, when to
ask again.  The package, which knows the compiler, puts it here.
"""


def one_row(signature: Signature, owner: Any, args: tuple[Any, ...]) -> Any:
    """The result, if every argument is one row; None if it has to be checked as any other call."""
    try:
        row = owner._single_rows[signature]
    except (AttributeError, KeyError):
        row = _remembered(signature, owner)
    if row is None or not row.least <= len(args) <= len(row.shapes):
        return None
    if row.native is not None:
        result = row.native(owner, args)
        if result is not None:
            return result
    values = []
    for value, shape, axes, dtype in zip(args, row.shapes, row.axes, row.dtypes):
        if shape is None and getattr(value, "ndim", 0) == axes:
            shape = value.shape
        if dtype is _COMPLEX:
            fits = type(value) is np.ndarray and value.dtype is dtype and value.shape == shape
            if not fits or not np.isfinite(value).all():
                return None
            values.append(small(value))
        elif shape:
            vector = at_a_glance(value, shape)
            if vector is None:
                return None
            values.append(vector)
        elif type(value) is not float or not math.isfinite(value):
            return None
        else:
            values.append(value)
    started = perf_counter()
    try:
        for i in row.elements:
            if i < len(values) and not who_knows_elements(owner).defect(values[i]) <= MEMBERSHIP:
                return None
        result = row.formula(owner, *values)
        if signature.promise:
            signature.kept(owner, result)
        result = _array(result)
    except Exception:  # it will be raised again, with all that can be said about it
        return None
    row.spent += perf_counter() - started
    if row.spent > row.next and result is not None and prepare is not None:
        prepare(row, args, result)
    return result


def _array(result: Any) -> Any:
    """A finite result as arrays are given; None if it needs a closer look."""
    kind = type(result)
    if kind is float:
        return result if math.isfinite(result) else None
    if kind is bool:
        return result
    if kind is tuple:
        parts = tuple([_array(part) for part in result])
        return None if any(part is None for part in parts) else parts
    if kind is Vec:
        rows = (result,)
    elif kind is Mat:
        rows = result.rows
    else:
        return None
    kinds = {type(x) for row in rows for x in row}
    if kinds <= _FLOATS:
        finite = all(math.isfinite(x) for row in rows for x in row)
        return np.array(result if kind is Vec else [*map(tuple, rows)]) if finite else None
    if kinds != _PAIRS:
        return None
    array = np.array(result, dtype=complex)
    return array if np.isfinite(array).all() else None


def _remembered(signature: Signature, owner: Any) -> OneRow | None:
    """The row of a method of this owner, or None if it takes other things than rows of numbers."""
    row = _row(signature, owner)
    try:
        rows = owner._single_rows
    except AttributeError:
        rows = {}
        # groups and algebras without fields, made anew in every other line of a program
        cls, library = type(owner), __name__.partition(".")[0]
        if cls.__module__.partition(".")[0] == library and not dataclasses.fields(cls):
            rows = vars(cls).get("_single_rows_of_all")
            if rows is None:
                cls._single_rows_of_all = rows = {}
        object.__setattr__(owner, "_single_rows", rows)
    if signature not in rows:
        rows[signature] = row
    return rows[signature]


def _row(signature: Signature, owner: Any) -> OneRow | None:
    names, kinds = signature.names, signature.kinds
    numbers = [kinds[name] for name in names if name in kinds]
    if signature.space_at is not None or not {*names[: len(numbers)]} <= kinds.keys():
        return None
    try:
        row = OneRow(signature, owner, numbers)
        large = owner.is_large or not owner._takes_rows
    except Exception:  # an owner that lacks something, of which the long way will speak
        return None
    forms = zip(row.shapes, row.axes)
    return row if not large and all(n if s is None else len(s) <= 2 for s, n in forms) else None
