"""Conversion of the values of a record's fields, by their annotations.

    float, int, bool, str          Python's own numbers, truth values and strings, also from NumPy's
    Vec, Mat                       from lists and arrays, with float components
    tuple, list, Sequence          tuples, their parts by the annotation of the parts
    set, frozenset                 frozensets
    dict, Mapping                  dicts that cannot be changed
    np.ndarray                     arrays that nobody can write to, from lists too
    anything else, Any             arrays become copies that nobody can write to; lists, dicts and sets are refused

A union takes the first of its types that fits, and whatever is the default of a field is welcome
there.
"""

from __future__ import annotations

import collections
import dataclasses
import functools
import operator
import sys
from collections import abc
from collections.abc import Callable, Mapping
from typing import Any, NoReturn, get_args, get_origin

import numpy as np

from ...errors import InvalidInput, InvalidType
from ..arrays import real_array
from ..calls.batches import AXES
from ..calls.broadcasting import Broadcasting
from ..large import Large
from ..numbers.bases import Pair, StandIn, of_an_int
from ..vectors import Mat, Vec
from .annotations import UNKNOWN, members, own_annotations
from .frozen import MISSING

Convert = Callable[[Any, str, Any], Any]  # of the record, the name of a field and its value
Places = tuple[Mapping[str, Any], ...]  # where the names in an annotation are looked for


class FrozenDict(dict[Any, Any]):
    """A dict that cannot be changed."""

    __slots__ = ()

    def _refuse(self, *args: Any, **options: Any) -> NoReturn:
        raise TypeError("the dict in a field of a record cannot be changed; make a new record with dataclasses.replace")

    __setitem__ = __delitem__ = __ior__ = update = setdefault = pop = popitem = clear = _refuse

    def __reduce__(self) -> tuple[Any, ...]:
        return FrozenDict, (dict(self),)

    def __hash__(self) -> int:  # type: ignore[override]
        return hash(frozenset(self.items()))


class OfEach:
    """The base of values for each of many, in place of a number, a vector or a matrix: a formula is given one in turn."""

    __slots__ = ()


# ------------------------------------------------------------------ values of any kind

CONSTANT: frozenset[type] = frozenset((float, int, bool, str, bytes, complex, type(None), Vec, Mat, Large, FrozenDict))
_CURES: dict[type, str] = {list: "lm.Vec, lm.Mat or tuple", dict: "dict", set: "frozenset", collections.deque: "tuple"}


def immutable(owner: Any, name: str, value: Any) -> Any:
    """The value if nothing in it can be changed in place, arrays as copies of which this holds; else InvalidType."""
    kind = type(value)
    if kind in CONSTANT or isinstance(value, Broadcasting):
        return value
    if isinstance(value, tuple):
        parts = [immutable(owner, name, x) for x in value]
        return value if not any(map(operator.is_not, parts, value)) else tuple.__new__(kind, parts)
    if isinstance(value, np.ndarray):
        return frozen_array(value, f"{type(owner).__name__}.{name}")
    for changeable, cure in _CURES.items():
        if isinstance(value, changeable):
            shown = repr(value) if len(repr(value)) < 80 else f"{repr(value)[:70]}..."
            raise InvalidType(
                f"{type(owner).__name__}.{name} is {shown}, which can be changed in place: "
                f"annotate the field as {cure}, which makes it one{_unknown(owner, name)}"
            )
    return value


def frozen_array(array: np.ndarray, name: str) -> np.ndarray:
    """A copy that nobody can write to, not even by its flags; the array itself if it is one."""
    kind: Any = type(array)
    base: Any = array.base
    if kind is not np.ndarray or array.dtype.hasobject:
        raise InvalidType(f"{name} must be an array of numbers; got {kind.__name__} of dtype {array.dtype}")
    if isinstance(base, bytes):
        return array
    return np.ndarray(array.shape, array.dtype, array.tobytes())


def array_held(owner: Any, name: str, value: Any) -> Any:
    """The array of a list, which nobody can write to; any other value as `immutable`."""
    if not isinstance(value, list):
        return immutable(owner, name, value)
    try:
        return frozen_array(np.array(value), f"{type(owner).__name__}.{name}")
    except ValueError:
        raise InvalidInput(f"{type(owner).__name__}.{name} is ragged: its rows have different lengths") from None


def _unknown(owner: Any, name: str) -> str:
    """A hint if the annotation of a field says nothing because its names cannot be found."""
    field = next(f for f in dataclasses.fields(owner) if f.name == name.partition("[")[0])
    unknown = UNKNOWN in members(field.type, *_places(type(owner), field.name))
    return (
        f" (where {type(owner).__name__} is defined, nothing is known by its annotation {field.type!r})"
        if unknown
        else ""
    )


# ------------------------------------------------------------------ by annotation


@functools.cache
def converters(cls: Any) -> tuple[tuple[str, Convert, set[type], bool], ...]:
    """The name of each field, what converts its value, the types of value that need no conversion, and whether it can
    wait.

    What says nothing before the class itself has had its say can wait: refusals of lists and of numbers that are no
    integers.
    """
    entries: list[tuple[str, Convert, set[type], bool]] = []
    for field in dataclasses.fields(cls):
        _require_types(cls, field)
        convert = _conversion(field.type, _places(cls, field.name))
        if convert is None:
            entries.append((field.name, cls._held, set(CONSTANT), True))
        else:
            entries.append(
                (field.name, _or_default(convert, field.default), set(_EASY.get(convert, ())), convert is _integer)
            )
    return tuple(entries)


def _require_types(cls: Any, field: Any) -> None:
    """Raise InvalidType for an annotation that is a value, as that of `x: 3` or `x: Vec(1.0)`, or
    gives a length, `Vec[3]`.
    """
    name = f"{cls.__name__}.{field.name}"
    for kind in members(field.type, *_places(cls, field.name)):
        if isinstance(kind, (int, float, complex, tuple, list, dict, set, np.ndarray, np.generic)):
            raise InvalidType(
                f"{name} is annotated by the value {kind!r}: annotate it by a type, float, lm.Vec, "
                "lm.Mat or tuple, and give a value as the default, `x: lm.Vec = ...`"
            )
        if get_origin(kind) in (Vec, Mat):
            raise InvalidType(
                f"{name} is annotated {field.type!r}: write lm.{get_origin(kind).__name__} alone; how "
                "long it is, its value says"
            )


def _places(cls: Any, name: str) -> Places:
    """The names that the annotation of a field may use: those of its class and of the module."""
    home = next((c for c in cls.__mro__ if name in own_annotations(c)), cls)
    return vars(home), getattr(sys.modules.get(home.__module__), "__dict__", {})


def _or_default(convert: Convert, default: Any) -> Convert:
    def converted(owner: Any, name: str, value: Any) -> Any:
        try:
            return convert(owner, name, value)
        except (InvalidInput, InvalidType):
            if value is not default:
                raise
            return value

    return convert if default is MISSING else converted


def _conversion(annotation: Any, places: Places) -> Convert | None:
    """The conversion to the first type of an annotation that fits; None if every value is welcome as it is."""
    allowed = members(annotation, *places)
    if Any in allowed or object in allowed:
        return None
    if any((get_origin(kind) or kind) is np.ndarray for kind in allowed):
        return array_held
    small = tuple(kind for kind in (Vec, Mat) if kind in allowed)
    singles = {kind: _single(kind, places) for kind in allowed if kind not in small}
    # an int is a float too
    steps = [step for _, step in sorted(singles.items(), key=lambda item: item[0] is not int) if step]
    if small:
        steps.append(functools.partial(_small, allowed=small))
    if not steps:
        return None
    if len(allowed) == max(len(small), 1):
        return steps[0]
    exact = frozenset(kind for kind in allowed if kind in CONSTANT) - {Vec, Mat}
    # of a class that converts nothing
    others = not all(step or kind is type(None) for kind, step in singles.items())

    def first(owner: Any, name: str, value: Any) -> Any:
        if type(value) in exact:
            return value
        for step in steps:
            try:
                return step(owner, name, value)
            except (InvalidInput, InvalidType) as error:
                refusal = error
        if others:
            return immutable(owner, name, value)
        raise refusal

    return first


def _single(kind: Any, places: Places) -> Convert | None:
    """The conversion to one type; None for those that take their values as they are."""
    origin = get_origin(kind) or kind
    if not isinstance(origin, type):
        return None
    if origin is float or issubclass(origin, np.floating):
        return _number
    if origin in (int, bool, str):
        return {int: _integer, bool: _truth, str: _text}[origin]
    if origin in (tuple, list, abc.Sequence, abc.MutableSequence, abc.Collection, abc.Iterable):
        return _sequence(get_args(kind), origin is tuple, places)
    if origin in (set, frozenset, abc.Set, abc.MutableSet):
        return _set
    if origin in (dict, abc.Mapping, abc.MutableMapping):
        return _dict(get_args(kind), places)
    return None


def _number(owner: Any, name: str, value: Any) -> Any:
    if isinstance(value, OfEach):
        return _of_each(owner, name, value, {0}, "a number")
    if type(value) is float or isinstance(value, (StandIn, Pair)):
        return of_an_int(value)
    if isinstance(value, (bool, np.bool_, complex, str, bytes)) or (isinstance(value, np.ndarray) and value.ndim):
        raise _no_number(owner, name, value)
    try:
        return float(value)
    except OverflowError:
        raise InvalidInput(f"{type(owner).__name__}.{name} is larger than a float can be, which is 1.8e308") from None
    except (TypeError, ValueError):
        if not hasattr(value, "free_symbols"):
            raise _no_number(owner, name, value) from None
        return value


def _no_number(owner: Any, name: str, value: Any) -> InvalidType:
    cure = "; a number for each is lm.each(values)" if isinstance(value, (list, np.ndarray)) else ""
    return InvalidType(f"{type(owner).__name__}.{name} is a number; got {value!r}{cure}")


def _integer(owner: Any, name: str, value: Any) -> Any:
    if isinstance(value, bool) or type(value) is int:
        return value
    if isinstance(value, StandIn) and value.is_integer:
        return value
    try:
        return operator.index(value)
    except TypeError:
        raise InvalidType(f"{type(owner).__name__}.{name} is an integer; got {value!r}") from None


def _truth(owner: Any, name: str, value: Any) -> Any:
    return bool(value) if isinstance(value, np.bool_) else immutable(owner, name, value)


def _text(owner: Any, name: str, value: Any) -> Any:
    return str(value) if isinstance(value, np.str_) else immutable(owner, name, value)


_EASY: dict[Convert, frozenset[type]] = {
    _number: frozenset([float]),
    _integer: frozenset([int]),
    _truth: frozenset([bool]),
    _text: frozenset([str]),
}


_FLOAT = frozenset([float])


def _of_each(owner: Any, name: str, value: Any, axes: set[int], what: str) -> Any:
    """`each(values)`, whose values have so many axes."""
    shape = getattr(value, "shape", None)
    if shape is not None and len(shape) not in axes:
        raise InvalidInput(
            f"{type(owner).__name__}.{name} is {what} for each; got {value!r}, whose values have shape {shape}"
        )
    return value


def _small(owner: Any, name: str, value: Any, allowed: tuple[type, ...]) -> Any:
    if type(value) is Vec and Vec in allowed and _FLOAT.issuperset(map(type, value)):
        return value
    if isinstance(value, Large):
        return value
    if isinstance(value, OfEach):
        kinds = " or ".join({"Vec": "a vector", "Mat": "a matrix"}[k.__name__] for k in allowed)
        return _of_each(owner, name, value, {AXES[k.__name__] for k in allowed}, kinds)
    if isinstance(value, allowed):
        rows: Any = value.rows if isinstance(value, Mat) else (value,)
        if all(_FLOAT.issuperset(map(type, row)) for row in rows):
            return value
        ordinary = all(
            type(x) is float or not (isinstance(x, (int, np.number)) or getattr(x, "is_integer", None) is True)
            for row in rows
            for x in row
        )
        return value if ordinary else type(value).of(value)  # type: ignore[attr-defined]
    if isinstance(value, (list, tuple)) and any(
        isinstance(x, StandIn) for row in value for x in (row if isinstance(row, (list, tuple)) else [row])
    ):
        raise InvalidType(
            f"{type(owner).__name__}.{name} is a list or a tuple of numbers known only at run time: "
            "write liemech.vec(...) or liemech.mat(...)"
        )
    array = real_array(value, f"{type(owner).__name__}.{name}")
    for kind in allowed:
        if array.ndim == AXES[kind.__name__]:
            return kind.of(array.tolist())  # type: ignore[attr-defined]
    expected = " or ".join({"Vec": "a vector", "Mat": "a matrix"}[k.__name__] for k in allowed)
    raise InvalidInput(f"{type(owner).__name__}.{name} is {expected}; got an array of shape {array.shape}")


def _sequence(args: tuple[Any, ...], fixed: bool, places: Places) -> Convert:
    """The conversion to tuples: of parts of one kind, or of one kind each for `tuple[A, B]`."""
    fixed = fixed and bool(args) and args[-1] is not Ellipsis
    parts = [_conversion(a, places) or immutable for a in args if a is not Ellipsis] if args else [_nested]

    def convert(owner: Any, name: str, value: Any) -> Any:
        if isinstance(value, tuple) and type(value) is not tuple:
            return immutable(owner, name, value)
        items = value.tolist() if isinstance(value, np.ndarray) and value.ndim else value
        if not isinstance(items, (tuple, list, range, collections.deque)):
            raise InvalidType(f"{type(owner).__name__}.{name} is a tuple; got {value!r}")
        if fixed and len(items) != len(parts):
            raise InvalidInput(f"{type(owner).__name__}.{name} is a tuple of {len(parts)} parts; got {value!r}")
        chosen = parts if fixed else parts * len(items)
        converted = tuple(
            [
                x if c is _number and type(x) is float else c(owner, f"{name}[{i}]", x)
                for i, (x, c) in enumerate(zip(items, chosen))
            ]
        )
        return (
            value
            if items is value and type(value) is tuple and not any(map(operator.is_not, converted, value))
            else converted
        )

    return convert


def _nested(owner: Any, name: str, value: Any) -> Any:
    return (
        _sequence((), False, ())(owner, name, value)
        if isinstance(value, (list, tuple))
        else immutable(owner, name, value)
    )


def _set(owner: Any, name: str, value: Any) -> Any:
    if not isinstance(value, (abc.Set, list, tuple)):
        raise InvalidType(f"{type(owner).__name__}.{name} is a set; got {value!r}")
    return value if isinstance(value, frozenset) else frozenset(value)


def _dict(args: tuple[Any, ...], places: Places) -> Convert:
    part = (_conversion(args[1], places) if len(args) == 2 else None) or immutable

    def convert(owner: Any, name: str, value: Any) -> Any:
        if not isinstance(value, abc.Mapping):
            raise InvalidType(f"{type(owner).__name__}.{name} is a dict; got {value!r}")
        return (
            value
            if type(value) is FrozenDict
            else FrozenDict({k: part(owner, f"{name}[{k!r}]", v) for k, v in value.items()})
        )

    return convert
