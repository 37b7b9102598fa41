"""Keys of values, equal where values are the same in every bit."""

from __future__ import annotations

import enum
import functools
import struct
import types
from collections.abc import Callable
from typing import Any

import numpy as np

from ..large import Large
from ..numbers.pairs import PAIRS
from ..tables import Table
from ..vectors import Mat
from .fields import FrozenDict
from .records import Record, fields_of


class _Itself:
    """An object by identity: equal to itself alone."""

    __slots__ = ("thing",)

    def __init__(self, thing: Any) -> None:
        self.thing = thing

    def __hash__(self) -> int:
        return id(self.thing)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Itself) and self.thing is other.thing


def exact_key(value: Any) -> Any:
    """A key that is equal for values of one type that are the same in every bit, and only for
    those.

    1 is not True nor 1.0, 0.0 is not -0.0, and nan is itself.  Functions, classes, modules, members
    of enums and whatever is not known here are the same if they are one object.
    """
    kind = type(value)
    if kind in COMPARABLE:
        return kind, value
    if kind is float:
        return kind, struct.pack("<d", value)
    if kind is complex:
        return kind, struct.pack("<2d", value.real, value.imag)
    if isinstance(value, enum.Enum):
        return _Itself(value)
    if isinstance(value, tuple):
        return kind, tuple(map(exact_key, value))
    if kind is frozenset:
        return kind, frozenset(map(exact_key, value))
    if isinstance(value, FrozenDict):
        return kind, tuple([(exact_key(k), exact_key(v)) for k, v in value.items()])
    if isinstance(value, (np.generic, np.ndarray)) and not value.dtype.hasobject:
        return kind, value.dtype.str, value.shape, value.tobytes()
    if kind is Large and value.numbers is not None:
        return kind, value.form, value.numbers.tobytes()
    if kind in _BY_PARTS:
        return kind, tuple([exact_key(part) for part in _BY_PARTS[kind](value)])
    if isinstance(value, Record):
        return kind, tuple([exact_key(x) for x in fields_of(value).values()])
    # not imported for their sake
    if (kind.__module__, kind.__name__) in (("fractions", "Fraction"), ("decimal", "Decimal")):
        return kind, value.as_integer_ratio() if kind.__name__ == "Fraction" else value.as_tuple()
    return _Itself(value)


COMPARABLE: set[type] = {int, bool, str, bytes, type(None), type(Ellipsis)}
"""Types whose `==` compares every bit, layouts among them."""

_BY_PARTS: dict[type, Callable[[Any], tuple[Any, ...]]] = {
    range: lambda x: (x.start, x.stop, x.step),
    slice: lambda x: (x.start, x.stop, x.step),
    functools.partial: lambda x: (x.func, x.args, *x.keywords.items()),
    types.MethodType: lambda x: (x.__func__, x.__self__),
    Mat: lambda x: x.rows,
    Table: lambda x: (x.content,),
    **{pair: lambda x: (x.level, *x.parts) for pair in PAIRS},
}
