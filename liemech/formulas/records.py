"""Records: the classes people subclass, and what compiled code sees as plain numbers.

A record is a frozen dataclass.  Its fields of type float, `Vec`, `Mat` or another record are numbers at run time; ints, bools,
strings, tuples of numbers, functions and None are part of its type: loops over them are written out before compilation and
branches on them disappear.  Its methods are formulas.  Called with NumPy arrays they check the shapes and broadcast over leading
axes; called with small vectors (from other formulas) they are the bare formula.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from typing import Any, TypeVar, cast, dataclass_transform

import numpy as np

from ..errors import InvalidInput, InvalidType
from .broadcasting import AXES, Broadcasting, annotation_text, real_array
from .vectors import Mat, Vec

T = TypeVar("T", bound=type)

_complete: set[type] = set()  # classes known to be dataclasses


class Record(Broadcasting):
    """Base of everything that compiles: frozen dataclasses whose methods are formulas."""

    def __new__(cls, *args: Any, **options: Any) -> Any:
        if cls not in _complete:
            forgotten = [n for n, a in vars(cls).get("__annotations__", {}).items() if "ClassVar" not in str(a)]
            if not set(forgotten) <= {f.name for f in dataclasses.fields(cast("Any", cls))}:
                raise InvalidType(f"{cls.__name__} has the fields {', '.join(forgotten)}: put @liemech.record above the class")
            _complete.add(cls)
        return super().__new__(cls)

    def __getstate__(self) -> dict[str, Any]:
        """The fields, without what is only remembered beside them."""
        return {f.name: getattr(self, f.name) for f in dataclasses.fields(cast("Any", self))}

    def __post_init__(self) -> None:
        cls: Any = type(self)
        for name, convert in _converters(cls):
            object.__setattr__(self, name, convert(self, name, getattr(self, name)))


@dataclass_transform(frozen_default=True, field_specifiers=(dataclasses.field,))
def record(cls: T) -> T:
    """Make a subclass of `Record` (a group, a Hamiltonian, a system, a method, ...) a frozen dataclass that compiles."""
    if not issubclass(cls, Record):
        raise InvalidType(f"@record is for subclasses of Record, such as liemech.Hamiltonian; {cls.__name__} is not one")
    made: Any = dataclasses.dataclass(frozen=True)(cls)
    return made


# ------------------------------------------------------------------ fields


def _number(owner: Any, name: str, value: Any) -> Any:
    if isinstance(value, (bool, complex, str, bytes)) or (isinstance(value, np.ndarray) and value.ndim):
        raise InvalidType(f"{type(owner).__name__}.{name} is a number; got {value!r}")
    try:
        return float(value)
    except (TypeError, ValueError):
        if not hasattr(value, "free_symbols"):
            raise InvalidType(f"{type(owner).__name__}.{name} is a number; got {value!r}") from None
        return value


def _small(owner: Any, name: str, value: Any, allowed: tuple[type, ...]) -> Any:
    if isinstance(value, allowed):
        return value
    array = real_array(value, f"{type(owner).__name__}.{name}")
    for kind in allowed:
        if array.ndim == AXES[kind.__name__]:
            return kind.of(array.tolist())  # type: ignore[attr-defined]
    expected = " or ".join({"Vec": "a vector", "Mat": "a matrix"}[k.__name__] for k in allowed)
    raise InvalidInput(f"{type(owner).__name__}.{name} is {expected}; got an array of shape {array.shape}")


@functools.cache
def _converters(cls: Any) -> tuple[tuple[str, Callable[[Any, str, Any], Any]], ...]:
    found: list[tuple[str, Callable[[Any, str, Any], Any]]] = []
    for field in dataclasses.fields(cls):
        kinds = annotation_text(field.type).split(" | ")
        allowed = tuple(kind for kind in (Vec, Mat) if kind.__name__ in kinds)
        if not field.init:
            continue
        if kinds == ["float"]:
            found.append((field.name, lambda o, n, v: v if type(v) is float else _number(o, n, v)))
        elif allowed:
            optional = (*allowed, type(None)) if "None" in kinds else allowed

            def convert(o: Any, n: str, v: Any, allowed: Any = allowed, optional: Any = optional) -> Any:
                return v if isinstance(v, optional) else _small(o, n, v, allowed)

            found.append((field.name, convert))
    return tuple(found)
