"""Frozen dataclasses that cost little to define: `@frozen` is `@dataclass(frozen=True)` without
code that is written and compiled for each class.

`dataclasses` compiles six methods for a class, half a millisecond, and there are hundreds of
classes.  Here five of them are closures, and `__init__` is left to `dataclasses` until it is first
asked for.  Fields, defaults, `replace`, `fields`, `repr`, comparisons and errors are those of
`dataclasses`; but arrays among the fields are compared by their entries.
"""

from __future__ import annotations

import abc
import dataclasses
import functools
import inspect
import operator
import re
import reprlib
import sys
import types
from collections.abc import Callable
from dataclasses import KW_ONLY, InitVar
from typing import Any, ClassVar, TypeVar, dataclass_transform, overload

import numpy as np

from .annotations import own_annotations

T = TypeVar("T", bound=type)

MISSING = dataclasses.MISSING


@dataclasses.dataclass(frozen=True)
class _Example:
    """An example of how `dataclasses` marks a class, a field and a class variable."""

    field: Any
    other: ClassVar[Any] = None


_FIELDS, _PARAMS = "__dataclass_fields__", "__dataclass_params__"
_FIELD, _NO_FIELD = [f._field_type for f in vars(_Example)[_FIELDS].values()]


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
    class_ = cls
    fields: dict[str, Any] = {}
    for base in cls.__mro__[:0:-1]:
        fields |= getattr(base, _FIELDS, {})
        if _PARAMS in vars(base) and not vars(base)[_PARAMS].frozen:
            raise TypeError("cannot inherit frozen dataclass from a non-frozen one")
    fields |= _own_fields(class_)
    setattr(class_, _FIELDS, fields)
    setattr(class_, _PARAMS, vars(_Example)[_PARAMS])
    in_order = [f for f in fields.values() if f._field_type is not _NO_FIELD and f.init and not f.kw_only]
    needed = [f.default is MISSING and f.default_factory is MISSING for f in in_order]
    if needed != sorted(needed, reverse=True):
        _initialiser(class_)  # which says what is wrong
    unwanted = {"__eq__": eq, "__hash__": eq, "__repr__": repr}
    written = {*vars(class_), *[name for name, is_made in unwanted.items() if not is_made]}
    if eq and vars(class_).get("__hash__") is None and "__eq__" in written:  # which Python puts beside `__eq__`
        written.discard("__hash__")
    methods = _methods(class_, [f for f in fields.values() if f._field_type is _FIELD])
    for name, value in methods.items():
        if name not in written:
            setattr(class_, name, value)
        elif name in ("__setattr__", "__delattr__"):
            raise TypeError(f"Cannot overwrite attribute {name} in class {class_.__name__}")
    if "__match_args__" not in written:
        class_.__match_args__ = tuple([f.name for f in in_order])  # type: ignore[misc]
    if "__init__" not in written:
        class_.__init__ = _WhenAsked(class_, "__init__", _initialiser)
    if not class_.__doc__:
        class_.__doc__ = _WhenAsked(class_, "__doc__", _documentation)
    class_.__replace__ = dataclasses.replace  # which `copy.replace` asks for
    abc.update_abstractmethods(class_)
    return cls


def _own_fields(cls: Any) -> dict[str, Any]:
    """The fields that are annotated in a class itself; what `dataclasses.field` says of one gives
    way to its default.
    """
    annotations = own_annotations(cls)
    for name, value in vars(cls).items():
        if isinstance(value, dataclasses.Field) and name not in annotations:
            raise TypeError(f"{name!r} is a field but has no type annotation")
    if not annotations:
        return {}
    if all(_is_field(cls, text) for text in annotations.values()):
        fields = {name: _field(cls, name, text) for name, text in annotations.items()}
    else:
        fields = _fields_by_dataclasses(cls, annotations)
    for name, field in fields.items():
        if isinstance(getattr(cls, name, None), dataclasses.Field):
            if field.default is MISSING:
                delattr(cls, name)
            else:
                setattr(cls, name, field.default)
    return fields


def _fields_by_dataclasses(cls: Any, annotations: Any) -> dict[str, Any]:
    """The fields as `dataclasses` reads annotations."""
    # where it looks for ClassVar, InitVar and KW_ONLY of an annotation that is a text
    home = cls.__module__ if cls.__module__ in sys.modules else __name__
    carrier: Any = type(cls.__name__, (), {"__module__": home, "__doc__": "of fields"})
    carrier.__annotations__ = dict(annotations)
    for name in annotations:
        if hasattr(cls, name):
            setattr(carrier, name, getattr(cls, name))
    dataclasses.dataclass(init=False, repr=False, eq=False, match_args=False)(carrier)
    fields: dict[str, Any] = vars(carrier)[_FIELDS]
    return fields


_NO_FIELDS = ClassVar, InitVar, KW_ONLY
_NAMES_OF_NONE = "ClassVar", "InitVar", "KW_ONLY"


def _is_field(cls: Any, text: Any) -> bool:
    """Whether an annotation, which is a text, is for certain that of an ordinary field."""
    if type(text) is not str or any(name in text for name in _NAMES_OF_NONE):
        return False
    word = _WORD.match(text)
    home = vars(sys.modules[cls.__module__]) if cls.__module__ in sys.modules else {}
    meaning = None if word is None else home.get(word[0])
    return word is not None and not any(meaning is mark for mark in _NO_FIELDS)


_WORD = re.compile(r"\w+")


def _field(cls: Any, name: str, text: str) -> Any:
    """The field of a name, as `dataclasses` makes it."""
    default = getattr(cls, name, MISSING)
    if isinstance(default, types.MemberDescriptorType):
        default = MISSING
    field: Any = default if isinstance(default, dataclasses.Field) else dataclasses.field(default=default)
    if field.default.__class__.__hash__ is None:
        raise ValueError(f"mutable default {type(field.default)} for field {name} is not allowed: use default_factory")
    field.name, field.type, field._field_type = name, text, _FIELD
    if field.kw_only is MISSING:
        field.kw_only = False
    return field


def _methods(cls: Any, fields: list[Any]) -> dict[str, Any]:
    """The methods of a frozen dataclass that need no code of their own."""
    names = frozenset([f.name for f in fields])
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

    def __setattr__(self: Any, name: str, value: Any) -> None:
        if type(self) is cls or name in names:
            raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")
        super(cls, self).__setattr__(name, value)

    def __delattr__(self: Any, name: str) -> None:
        if type(self) is cls or name in names:
            raise dataclasses.FrozenInstanceError(f"cannot delete field {name!r}")
        super(cls, self).__delattr__(name)

    methods = __repr__, __eq__, __hash__, __setattr__, __delattr__
    for method in methods:
        method.__qualname__ = f"{cls.__qualname__}.{method.__name__}"
        method.__module__ = cls.__module__
    return {m.__name__: m for m in methods} | {"__repr__": _once(__repr__)}


# as of those that `dataclasses` writes, their code is of no file: nobody who asks what a user has
# written finds them
_methods.__code__ = _methods.__code__.replace(
    co_consts=tuple(
        [c.replace(co_filename="<string>") if isinstance(c, types.CodeType) else c for c in _methods.__code__.co_consts]
    )
)


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


_once = getattr(dataclasses, "_recursive_repr", None) or reprlib.recursive_repr()


def _values(names: list[str]) -> Callable[[Any], tuple[Any, ...]]:
    """A function for the values of these attributes as a tuple."""
    if len(names) > 1:
        return operator.attrgetter(*names)
    if not names:
        return lambda record: ()
    value = operator.attrgetter(*names)
    return lambda record: (value(record),)


# ------------------------------------------------------------------ made when it is asked for


class _WhenAsked:
    """An attribute of a class that is made when somebody asks for it, and stays."""

    def __init__(self, cls: type, name: str, make: Callable[[Any], Any]) -> None:
        self.cls, self.name, self.make = cls, name, make

    def __get__(self, owner: Any, cls: type | None = None) -> Any:
        value = self.make(self.cls)
        setattr(self.cls, self.name, value)
        return value.__get__(owner, cls) if hasattr(value, "__get__") else value

    def __reduce__(self) -> tuple[Any, ...]:
        """A class that is sent to another process takes what was made along."""
        return _itself, (self.__get__(None, self.cls),)


def _itself(value: Any) -> Any:
    return value


def _initialiser(cls: Any) -> Any:
    """The `__init__` that `dataclasses` writes for the fields of a class."""
    marks = {name: vars(cls)[name] for name in (_FIELDS, _PARAMS)}
    types = {name: field.type for name, field in marks[_FIELDS].items()}
    base = type("_", (), {**marks, "__annotations__": types})
    space = {"__module__": cls.__module__, "__qualname__": cls.__qualname__, "__doc__": "of fields"}
    if hasattr(cls, "__post_init__"):
        space["__post_init__"] = cls.__post_init__
    twin: Any = dataclasses.dataclass(frozen=True, repr=False, eq=False)(type(cls.__name__, (base,), space))
    return twin.__init__


def _documentation(cls: Any) -> str:
    """The fields, for a class without a docstring."""
    try:
        return cls.__name__ + str(inspect.signature(cls)).replace(" -> None", "")
    except (TypeError, ValueError):
        return str(cls.__name__)
