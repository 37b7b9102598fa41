"""Frozen dataclasses whose arrays are compared by their entries, and whose long tuples are shown by their ends."""

from __future__ import annotations

import abc
import dataclasses
import functools
import operator
import reprlib
import sys
from collections.abc import Callable
from dataclasses import KW_ONLY, InitVar  # noqa: F401 - of annotations of classes without a module
from typing import Any, ClassVar, TypeVar, dataclass_transform, overload  # noqa: F401

import numpy as np

T = TypeVar("T", bound=type)

MISSING = dataclasses.MISSING


@overload
@dataclass_transform(frozen_default=True, field_specifiers=(dataclasses.field,))
def frozen(cls: T) -> T: ...
@overload
@dataclass_transform(frozen_default=True, field_specifiers=(dataclasses.field,))
def frozen(*, eq: bool = ..., repr: bool = ...) -> Callable[[T], T]: ...
def frozen(cls: Any = None, *, eq: bool = True, repr: bool = True) -> Any:
    """Make a class a frozen dataclass.

    eq, repr : as for `dataclasses.dataclass`.
    """
    if cls is None:
        return functools.partial(frozen, eq=eq, repr=repr)
    home = cls.__module__
    if home not in sys.modules:  # where `dataclasses` looks for ClassVar, InitVar and KW_ONLY
        cls.__module__ = __name__
    dataclasses.dataclass(frozen=True, eq=False, repr=False)(cls)
    cls.__module__ = home
    switches = {"__repr__": repr, "__eq__": eq, "__hash__": eq}
    written = {*vars(cls)}
    if "__eq__" in written and vars(cls)["__hash__"] is None:  # by Python, beside a written `__eq__`
        written.remove("__hash__")
    for method in _methods(cls, dataclasses.fields(cls)):
        if switches[method.__name__] and method.__name__ not in written:
            setattr(cls, method.__name__, method)
    return abc.update_abstractmethods(cls)


def _methods(cls: Any, fields: tuple[Any, ...]) -> list[Any]:
    """The methods that show, compare and hash the fields of a class."""
    compared = _values([f.name for f in fields if f.compare])
    hashed = _values([f.name for f in fields if (f.compare if f.hash is None else f.hash)])
    shown = [f.name for f in fields if f.repr]

    def __repr__(self: Any) -> str:
        values = ", ".join([f"{name}={_shown(getattr(self, name))}" for name in shown])
        return f"{type(self).__qualname__}({values})"

    def __eq__(self: Any, other: object) -> Any:
        if other.__class__ is self.__class__:
            return _equal(compared(self), compared(other))
        return NotImplemented

    def __hash__(self: Any) -> int:
        values = hashed(self)
        try:
            return hash(values)
        except TypeError:
            return hash(_without_arrays(values))

    for method in (__repr__, __eq__, __hash__):
        method.__qualname__, method.__module__ = f"{cls.__qualname__}.{method.__name__}", cls.__module__
        # of no file, as those that `dataclasses` writes: nobody who asks what a user has written finds them
        method.__code__ = method.__code__.replace(co_filename="<string>")
    return [_once(__repr__), __eq__, __hash__]


_once = getattr(dataclasses, "_recursive_repr", None) or reprlib.recursive_repr()


def _equal(a: Any, b: Any) -> Any:
    """Whether two values are equal, as parts of tuples are: arrays if they have one shape and equal entries."""
    if a is b:
        return True
    if type(a) is type(b) is tuple:
        if {tuple, np.ndarray}.isdisjoint([*map(type, a), *map(type, b)]):
            return a == b
        return len(a) == len(b) and all(map(_equal, a, b))
    if np.ndarray in (type(a), type(b)):
        return type(a) is type(b) and np.array_equal(a, b)
    return a == b


def _without_arrays(value: Any) -> Any:
    """A value with the shapes of its arrays in their place."""
    if type(value) is tuple:
        return tuple(map(_without_arrays, value))
    return value.shape if type(value) is np.ndarray else value


def _shown(value: Any) -> str:
    """A value of a field; of a long tuple, such as the links of a chain, its ends."""
    if type(value) is not tuple or len(value) <= 3 or isinstance(value[0], (float, int)):
        return repr(value)
    return f"({value[0]!r}, ..., {value[-1]!r}; {len(value)} in all)"


def _values(names: list[str]) -> Callable[[Any], tuple[Any, ...]]:
    """A function for the values of these attributes as a tuple."""
    if len(names) > 1:
        return operator.attrgetter(*names)
    if not names:
        return lambda record: ()
    value = operator.attrgetter(*names)
    return lambda record: (value(record),)
