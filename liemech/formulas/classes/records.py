"""Records: the classes people subclass, and what compiled code sees as plain numbers.

A record is a frozen dataclass.  Its fields of type float, `Vec`, `Mat` or another record are
numbers at run time; ints, bools, strings, tuples of numbers, functions and None are part of its
type: loops over them are written out before compilation and branches on them disappear.  Its
methods are formulas.  Called with NumPy arrays they check the shapes and broadcast over leading
axes; called with small vectors (from other formulas) they are the bare formula.

What lies in a field after construction cannot be changed in place: `fields` says what becomes of
lists, arrays, dicts and sets.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
import types
import weakref
from collections.abc import Callable, Iterable
from typing import Any, TypeVar, cast, dataclass_transform

import numpy as np

from ...errors import InvalidInput, InvalidType, LiemechError
from ..calls.broadcasting import Broadcasting
from ..large import Large
from ..numbers.pairs import PAIRS, paired
from ..tables import Table
from ..vectors import Mat, Vec
from .annotations import own_annotations
from .derived import follow_anew
from .fields import FrozenDict, converters, immutable
from .frozen import MISSING, frozen
from .overriding import is_asked, overridden, require_signatures, theirs
from .signatures import bare, keywords, misspelt

T = TypeVar("T", bound=type)

_complete: dict[type, tuple[frozenset[str], Callable[[type], Any]]] = {}
"""Classes known to be frozen dataclasses, with the keywords that they take, and what makes an empty object."""

_known: weakref.WeakValueDictionary[tuple[str, str], type] = weakref.WeakValueDictionary()


def known(module: str, name: str) -> Any:
    """The class of records that was defined last under this name, of the library or of its user;
    None if this process has none.  It is looked up in a list, nothing is imported or evaluated.
    """
    return _known.get((module, name))


class Record(Broadcasting):
    """Base of everything that compiles: frozen dataclasses whose methods are formulas."""

    # its structure, and the shapes and rows that its methods take, once somebody asked for it; no
    # fields: neither pickled, copied nor in `vars`
    __slots__ = ("_layout", "_shapes", "_single_rows")

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        _known[cls.__module__, cls.__qualname__] = cls
        for name in ("__init__", "__post_init__"):
            if name in vars(cls):
                setattr(cls, name, _then_checked(vars(cls)[name]))
        if theirs(cls):  # the library's own classes are looked at by a test
            follow_anew(cls)

    def __new__(cls, *args: Any, **options: Any) -> Any:
        parameters, new = _complete.get(cls) or _completed(cls)
        if options and not parameters.issuperset(options):
            names = keywords(inspect.unwrap(cls.__init__))
            if names is not None:
                raise misspelt(cls.__qualname__, names, options)
        return new(cls)

    def __getstate__(self) -> dict[str, Any]:
        """The fields, without cached attributes."""
        return {f.name: getattr(self, f.name) for f in dataclasses.fields(cast("Any", self))}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Raises InvalidInput for fields from which the class does not make this record: `require_as_made`."""
        for name, value in state.items():  # copies of arrays can be written to again
            object.__setattr__(self, name, immutable(self, name, value))
        require_as_made(self)

    def _held(self, name: str, value: Any) -> Any:
        """Convert the value of a field whose annotation says nothing about it."""
        return immutable(self, name, value)

    def __post_init__(self, *_: Any) -> None:
        """Convert the fields.  Overridden, it is called by `super().__post_init__()`, before or
        after setting derived fields.
        """
        _convert(self, type(self).__post_init__ is Record.__post_init__)


def _convert(self: Any, last: bool) -> None:
    cls: Any = type(self)
    for name, convert, easy, can_wait in converters(cls):
        value = getattr(self, name, MISSING)
        if type(value) not in easy and value is not MISSING and (last or not can_wait):
            new = convert(self, name, value)
            if new is not value:
                object.__setattr__(self, name, new)
            # which a field that takes anything holds as it is
            elif can_wait and isinstance(value, Record):
                easy.add(type(value))


def refilled(cls: Any, fields: dict[str, Any]) -> Any:
    """A record with these fields, all of them, to the bit.  Raises what its class raises for them, and
    InvalidInput as `require_as_made`.
    """
    record = object.__new__(cls)
    record.__setstate__(fields)
    _convert(record, True)
    return record


def require_as_made(record: Any) -> None:
    """Let the class of a copied or loaded record make it again, with all the checks that a user meets.
    Raises InvalidInput unless whole numbers, truth values, names, shapes and classes in its fields are as
    in the new one: native code takes loops and places in memory from them.  Other numbers keep their bits.
    """
    cls: Any = type(record)
    taken = _remaking_arguments(cls)
    if taken is None:
        return
    remade = cls(**{name: getattr(record, name) for name in taken})
    for name in names_of(cls):
        value, other = getattr(record, name), getattr(remade, name)
        if value is not other and not _alike(value, other):
            raise InvalidInput(f"{cls.__qualname__}: {name} is {value!r}, and by the other fields {other!r}")


@functools.cache
def _remaking_arguments(cls: Any) -> tuple[str, ...] | None:
    """The fields that the `__init__` of a class of records takes; None if it takes other arguments, or if no class of the
    library computes or checks fields in it.  A user's `__post_init__` alone does not count: it may turn degrees into
    radians, and would do so again.
    """
    bases = [base for base in cls.__mro__ if issubclass(base, Record) and not theirs(base)]
    if theirs(cls) and all(base.__post_init__ is Record.__post_init__ for base in bases):
        return None
    taken = tuple([f.name for f in dataclasses.fields(cls) if f.init])
    if cls.__post_init__ is Record.__post_init__ and len(taken) == len(names_of(cls)):
        return None
    parameters = inspect.signature(cls.__init__).parameters.values()
    named = {x.name for x in parameters if x.kind not in (x.VAR_POSITIONAL, x.VAR_KEYWORD)}
    return taken if named == {"self", *taken} else None


@functools.cache
def names_of(cls: Any) -> tuple[str, ...]:
    """The names of the fields of a class of records."""
    return tuple([f.name for f in dataclasses.fields(cls)])


def fields_of(value: Any) -> dict[str, Any]:
    """The values of the fields of a record, by name."""
    cls: Any = type(value)
    return {name: getattr(value, name) for name in names_of(cls)}


def fill(cls: type, fields: dict[str, Any]) -> Any:
    """An instance of a record class with these fields, unchecked."""
    record: Any = object.__new__(cls)
    for name, value in fields.items():
        object.__setattr__(record, name, value)
    return record


def with_fields(value: Any, **fields: Any) -> Any:
    """A record with other values of some fields, unchecked."""
    return fill(type(value), fields_of(value) | fields)


def _alike(value: Any, other: Any) -> bool:
    """Whether two values are equal but for real numbers.  Tables know their sizes by their own classes."""
    if type(value) is not type(other):
        return False
    if type(value) is float or isinstance(value, (complex, Table)):
        return True
    if isinstance(value, Record):
        cls: Any = type(value)
        return all(_alike(getattr(value, name), getattr(other, name)) for name in names_of(cls))
    if isinstance(value, np.ndarray):
        return value.shape == other.shape and (value.dtype.kind in "fc" or np.array_equal(value, other))
    if isinstance(value, Large):
        return np.shape(value) == np.shape(other)
    if isinstance(value, FrozenDict):
        return value.keys() == other.keys() and all(_alike(x, other[key]) for key, x in value.items())
    if isinstance(value, (Vec, Mat, tuple)):
        equal = len(value) == len(other)
        return equal and ({*map(type, value), *map(type, other)} == _FLOAT or all(map(_alike, value, other)))
    return not isinstance(value, (int, np.integer, str, bytes, frozenset, type)) or bool(value == other)


_FLOAT = {float}


def _then_checked(initialise: Callable[..., None]) -> Callable[..., None]:
    """An `__init__` or `__post_init__` of a subclass, after which all fields are checked; that of a
    base leaves it to the last.  A `__post_init__` sees whole numbers of NumPy as ints, those in tuples too.
    """

    @functools.wraps(initialise)
    def method(self: Any, *args: Any, **options: Any) -> None:
        cls = type(self)
        if method is cls.__post_init__:
            for name, value in [*vars(self).items()]:
                if isinstance(value, np.integer):  # which NumPy gives as an element or a length
                    object.__setattr__(self, name, int(value))
                elif type(value) is tuple and any(isinstance(x, np.integer) for x in value):
                    object.__setattr__(self, name, tuple([int(x) if isinstance(x, np.integer) else x for x in value]))
        try:
            initialise(self, *args, **options)
        except LiemechError:
            raise
        except Exception as error:
            _blame(self, error)
            raise
        if method is cls.__post_init__ or method is vars(cls).get("__init__"):
            _convert(self, True)
            for name in Record.__slots__:  # it was looked at before it was ready
                if hasattr(self, name):
                    object.__delattr__(self, name)

    return method


def _blame(self: Any, error: Exception) -> None:
    """Raise the error of the first field whose value cannot be converted; return if there is none."""
    cls: Any = type(self)
    for name, convert, _, _ in converters(cls):
        value = getattr(self, name, MISSING)
        if value is not MISSING:
            try:
                convert(self, name, value)
            except LiemechError as reason:
                raise reason from error
            except Exception:  # no reason
                continue


def _completed(cls: Any) -> tuple[frozenset[str], Callable[[type], Any]]:
    """The entry of a class in `_complete`, once it has been looked at."""
    _require_dataclass(cls)
    _require_methods_in_sight(cls)
    _require_final_methods(cls)
    require_signatures(cls, bare)
    parameters = frozenset(keywords(inspect.unwrap(cls.__init__)) or ())
    _complete[cls] = parameters, super(Record, cls).__new__
    return _complete[cls]


def _require_dataclass(cls: Any) -> None:
    params = vars(cls).get("__dataclass_params__")
    if params is None:
        fields = [f.name for f in dataclasses.fields(cls)] if dataclasses.is_dataclass(cls) else []
        forgotten = [n for n, a in own_annotations(cls).items() if "ClassVar" not in str(a)]
        if not fields and not forgotten and not dataclasses.is_dataclass(cls):
            raise InvalidType(f"{cls.__name__} is no dataclass yet: put @liemech.record above the class")
        if not set(forgotten) <= set(fields):
            raise InvalidType(
                f"{cls.__name__} has the fields {', '.join(forgotten)}: put @liemech.record above the class"
            )
    elif not params.frozen:
        raise InvalidType(
            f"{cls.__name__} can be changed in place: put @liemech.record above the class instead of @dataclass"
        )


def _require_methods_in_sight(cls: Any) -> None:
    """Refuse a class with a method and a field of one name: the field would hide the method."""
    for field in dataclasses.fields(cls) if dataclasses.is_dataclass(cls) else ():
        for base in cls.__mro__:
            if field.name in own_annotations(base) or not field.init:
                _require_free(cls, base, field.name)
                break
            if isinstance(vars(base).get(field.name), _METHODS):
                raise InvalidType(
                    f"{base.__name__}.{field.name} is a method or a property, and {field.name} is a "
                    f"field: one would hide the other; give the field its value, {cls.__name__}(..., "
                    f"{field.name}=...), or name the method otherwise"
                )


def _require_free(cls: Any, home: Any, name: str) -> None:
    """Refuse a field of a user's class with the name of a method by which the library would ask for something else."""
    base = overridden(cls, home, name) if theirs(home) else None
    if base is not None and is_asked(cls, name):
        raise InvalidType(
            f"{home.__name__}.{name} is a field, and {base[0].__name__}.{name} a method that the library calls: give the "
            "field another name"
        )


def _require_final_methods(cls: Any) -> None:
    """Refuse a class that replaces a final method, on which other methods count."""
    for derived in cls.__mro__:
        for name in vars(derived):
            base = next((b for b in derived.__mro__[1:] if name in vars(b)), None)
            if base is not None and getattr(vars(base)[name], "__final__", False):
                says = (vars(base)[name].__doc__ or "").strip().split("\n")[0].split(". ")[0]
                raise InvalidType(
                    f"{derived.__name__} replaces {base.__name__}.{name}{says and f' ({says})'}, "
                    "which follows from what a subclass writes, and on which other formulas count; "
                    "give yours another name, or write what it follows from"
                )


_METHODS = types.FunctionType, property, functools.cached_property, classmethod, staticmethod


@dataclass_transform(frozen_default=True, field_specifiers=(dataclasses.field,))
def record(cls: T) -> T:
    """Make a subclass of `Record` (a group, a Hamiltonian, a system, a method, ...) a frozen
    dataclass that compiles.
    """
    if not issubclass(cls, Record):
        raise InvalidType(
            f"@record is for subclasses of Record, such as liemech.Hamiltonian; {cls.__name__} is not one"
        )
    return frozen(cls)


# ------------------------------------------------------------------ the inside of values


def parts_of(value: Any) -> Any:
    """The items of a vector, a tuple, a list, the rows of a matrix, the fields of a record, the two numbers of a pair."""
    if isinstance(value, (tuple, list)):
        return value
    if isinstance(value, Mat):
        return value.rows
    if isinstance(value, Record):
        return fields_of(value).values()
    return value.parts if isinstance(value, PAIRS) else [value.place]


def of_parts(value: Any, parts: list[Any]) -> Any:
    """A value of the kind of another, with other parts; a record is filled in unchecked."""
    cls: Any = type(value)
    if isinstance(value, (Vec, Mat)):
        return cls(*parts)
    if isinstance(value, Record):
        return fill(cls, dict(zip(names_of(cls), parts, strict=True)))
    if isinstance(value, PAIRS):
        return paired(value.form, parts)
    return Table.at(*parts) if cls is Table else cls(parts)


def records_in(value: Any, kind: type) -> list[Any]:
    """The records of a kind that a value holds, in order."""
    if isinstance(value, kind):
        return [value]
    if isinstance(value, Record):
        return [x for part in fields_of(value).values() for x in records_in(part, kind)]
    if type(value) in (tuple, list):
        return [x for part in value for x in records_in(part, kind)]
    return []


def with_records(
    value: Any, kind: type, others: Iterable[Any], on_exchange: Callable[[Any, Any], None] | None = None
) -> Any:
    """The value with the records of a kind, those of `records_in`, replaced by others, in order.  Attributes beside the
    fields of a record are copied unless they hold a record of the kind.

    on_exchange : called with every new record and the one that it replaces.
    """
    replacements = iter(others)

    def changed(x: Any) -> Any:
        if isinstance(x, kind):
            return next(replacements)
        if not records_in(x, kind):
            return x
        if not isinstance(x, Record):
            return type(x)([changed(part) for part in x])
        fields = fields_of(x)
        beside = {n: y for n, y in vars(x).items() if n not in fields and not records_in(y, kind)}
        record = fill(type(x), beside | {n: changed(part) for n, part in fields.items()})
        if on_exchange is not None:
            on_exchange(record, x)
        return record

    return changed(value)
