"""Tokens: what a value is, so that another process can tell whether it has the same one.

Two values have one token exactly if code translated with either of them is the same: numbers count
by type and bits, arrays by their bytes, functions by their code, classes and modules by name.  An
object of another kind counts by its class alone; formulas may read its attributes, which have
tokens of their own, and nothing else.
"""

from __future__ import annotations

import dataclasses
import decimal
import enum
import fractions
import functools
import hashlib
import inspect
import itertools
import struct
import sys
import types
from array import array
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from ...formulas.classes.layouts import Layout
from ...formulas.classes.records import Record
from ...formulas.large import Large
from ...formulas.large_maps import DiagonalSolver, LinearMap
from ...formulas.numbers.bases import StandIn
from ...formulas.numbers.pairs import PAIRS
from ...formulas.tables import Table
from ...formulas.vectors import Mat

ATOMS = {types.NoneType, bool, int, float, complex, str, bytes, range, types.EllipsisType, types.NotImplementedType}
"""Types whose values are known by their text."""

_NUMBERS_AND_TEXTS = (int, float, complex, str, bytes)  # which may have subclasses

Part = tuple[str, Any, Any]  # how it is reached, by which name or index, and the value


Known = dict[Any, list[Any]]
"""By what they have in common: the classes, functions and objects met so far that only their identity tells apart."""


def digest(value: Any, namesakes: Known | None = None) -> str:
    """The token of a value, as a short text.  Objects that only identity tells apart are numbered from the second on."""
    return hashlib.sha256(repr(_token(value, {} if namesakes is None else namesakes)).encode()).hexdigest()[:32]


def same(a: Any, b: Any) -> bool:
    """Whether two values have one token."""
    return a is b or _token(a, {}) == _token(b, {})


def parts(value: Any) -> Iterator[Part]:
    """The parts of a value: items, fields, attributes."""
    if isinstance(value, (tuple, list)):
        for i, x in enumerate(value):
            yield "item", i, x
    elif isinstance(value, dict):
        for i, x in enumerate(value.values()):
            yield "value", i, x
    elif isinstance(value, Record):
        for f in dataclasses.fields(value):  # type: ignore[arg-type]
            yield "attribute", f.name, getattr(value, f.name)
    else:
        for kind, names in _ATTRIBUTES.items():
            if isinstance(value, kind):
                for name in names:
                    yield "attribute", name, getattr(value, name)


def inner(value: Any) -> Iterable[Part]:
    """The parts of a value, none if they are numbers and texts only."""
    plain = isinstance(value, (tuple, list)) and ATOMS.issuperset(map(type, value))
    return () if plain else parts(value)


_ATTRIBUTES: dict[type, tuple[str, ...]] = {
    Layout: ("kind", "detail", "parts"),
    Mat: ("rows",),
    Table: ("content",),
    Large: ("content",),
    LinearMap: ("content",),
    DiagonalSolver: ("content",),
    **dict.fromkeys(PAIRS, ("parts",)),
    types.MethodType: ("__func__", "__self__"),
    property: ("fget",),
    functools.cached_property: ("func",),
    staticmethod: ("__func__",),
    classmethod: ("__func__",),
    functools.partial: ("func", "args", "keywords"),
    slice: ("start", "stop", "step"),
    dataclasses.Field: ("name", "type", "init", "default"),
}


def is_mutable(value: Any) -> bool:
    """Whether the content of a value can change while it stays the same object."""
    if isinstance(value, (list, dict, set, np.ndarray)):
        return True
    return type(value) not in ATOMS and not isinstance(value, Layout) and any(is_mutable(x) for *_, x in inner(value))


def known(value: Any, inside: bool = True) -> bool:
    """Whether the token of a value (and, `inside`, those of its parts) tells all about it, so that Python may compute with
    it before the run.
    """
    if isinstance(value, StandIn) or type(value) in ATOMS or type(value) in MADE or is_own(value):
        return True
    if isinstance(value, (types.FunctionType, types.MethodType)):
        return False  # Python would run what nobody has read
    if of_python(type(value)) and has_operators(type(value)):
        return False
    if isinstance(value, Record):
        return True
    if isinstance(value, np.ndarray) and type(value) not in _ARRAYS:
        return False
    if not has_content(value) or isinstance(value, types.ModuleType) or (isinstance(value, type) and of_python(value)):
        return False
    return not inside or all(known(x) for *_, x in inner(value))


MADE: set[type] = set()
"""Classes of objects that only the compiler makes."""

_ARRAYS = np.ndarray, np.memmap
"""Arrays whose bytes tell all; a masked one has a mask, a subclass what its author wrote."""


def has_content(value: Any) -> bool:
    """Whether the token of a value depends on more than its class."""
    return _head(value, {}) is not None


def of_python(cls: type) -> bool:
    """Whether a class is the user's or of liemech, so that its methods are formulas."""
    return bool(cls.__flags__ & _HEAP) and not is_own(cls) and str(cls.__module__).partition(".")[0] not in _SETTLED


_HEAP = 1 << 9  # Python's flag of classes made while it runs
_SETTLED = {"builtins", "enum", "fractions", "decimal", "numpy"}

_QUIET = """
    __module__ __qualname__ __doc__ __dict__ __weakref__ __slots__ __annotations__ __annotate__
    __annotate_func__ __annotations_cache__ __static_attributes__ __firstlineno__ __classdictcell__
    __classcell__ __orig_bases__ __parameters__ __type_params__ __match_args__ __final__
    __abstractmethods__ __subclasshook__ __init_subclass__ __class_getitem__ __set_name__
    __protocol_attrs__ __non_callable_proto_members__ __dataclass_fields__ __dataclass_params__
    __new__ __init__ __post_init__ __replace__ __del__ __setattr__ __delattr__ __missing__ __copy__
    __deepcopy__ __reduce__ __reduce_ex__ __getstate__ __setstate__ __getnewargs__
    __getnewargs_ex__ __sizeof__ __dir__
    """
_HARMLESS = frozenset(_QUIET.split())
"""Names with two underscores of a class that no operator, function or loop of Python's asks for, or
that the compiler asks about itself (`__missing__`).
"""

_TEXTS = {"__repr__", "__str__", "__format__", "__bytes__"}
"""The methods that say how an object looks as a text: `textual` asks about them."""


def has_operators(cls: type) -> bool:
    """Whether a class, or one of its bases, defines something that Python's operators, loops and functions run.  (The
    methods that a dataclass or a named tuple is given have no file of the user's.)
    """
    return any(
        name.startswith("__") and name.endswith("__") and name not in _HARMLESS | _TEXTS
        and _is_written(member)
        for c in cls.__mro__ if of_python(c)
        for name, member in vars(c).items()
    )  # fmt: skip


def _is_written(member: Any) -> bool:
    """Whether a member of a class was written by somebody, not by `record`, `dataclass`, `enum` or
    `collections.namedtuple`.
    """
    if member is None:  # `__hash__` beside an `__eq__`
        return False
    code = getattr(member, "__code__", None)
    if code is None:
        return not isinstance(member, types.BuiltinFunctionType)
    of_dataclass = code.co_filename.startswith("<") or code.co_filename == dataclasses.__file__
    return not of_dataclass and str(member.__module__) not in _MAKERS


_MAKERS = {"enum", "dataclasses", "collections", "typing"}


def looks_itself(value: Any) -> bool:
    """Whether a user's class writes the text of an object, or of a part of it: `__repr__`, `__str__`, ..."""
    written = any(
        name in vars(c) and _is_written(vars(c)[name])
        for c in type(value).__mro__ if of_python(c)
        for name in _TEXTS
    )  # fmt: skip
    return written or any(looks_itself(x) for *_, x in inner(value))


def is_own(value: Any) -> bool:
    """Whether a value is of the compiler or of formulas, whose source is in the key on disk: numbers, vectors, functions,
    modules.
    """
    if isinstance(value, types.ModuleType):
        return value.__name__.startswith(_OWN)
    cls = value if isinstance(value, (type, types.FunctionType)) else type(value)
    if type(cls).__module__ == "_ctypes":  # of the file that was the first to ask for an array of this length
        return False
    return str(cls.__module__).startswith(_OWN) and not (isinstance(cls, type) and issubclass(cls, Record))


_LIBRARY = __name__.partition(".")[0]
_OWN = f"{_LIBRARY}.compiler.", f"{_LIBRARY}.formulas."


# ------------------------------------------------------------------ tokens


def _token(value: Any, namesakes: Known) -> Any:
    """Nested tuples of texts; no two of different values look the same."""
    head = _head(value, namesakes)
    if head is None:
        return "object", _one_of(("object", _named(type(value), namesakes)), value, namesakes)
    if type(value) in ATOMS:
        return head
    token = _together(value) if type(value) in (tuple, list) else None
    if token is not None:
        return *head, token
    return *head, *[_token(x, namesakes) for *_, x in parts(value)]


def _together(value: Any) -> str | None:
    """A hash of all entries of a tuple or list at once, of the bits of floats, or of the text of numbers, texts, and
    tuples and lists of these; None where a text does not tell entries apart.
    """
    if {*map(type, value)} == {float}:
        content = array("d", value).tobytes()
    else:
        entries, depth = value, 0
        while not ATOMS.issuperset(kinds := {*map(type, entries)}):
            depth += 1
            if not kinds <= _NESTED or depth > 8:
                return None
            entries = [*itertools.chain.from_iterable(x for x in entries if type(x) in (tuple, list))]
        text = repr(value)
        if "nan" in text:  # one of many
            return None
        content = text.encode(errors="surrogatepass")
    return hashlib.sha256(content).hexdigest()


_NESTED = ATOMS | {tuple, list}


def _head(value: Any, namesakes: Known) -> tuple[Any, ...] | None:
    """The token of a value without its parts; None for an object of unknown content."""
    kind = type(value)
    if kind is float and value != value:
        return "nan", struct.pack("<d", value).hex()
    if kind in ATOMS:
        return kind.__name__, repr(value)
    for base in _NUMBERS_AND_TEXTS:
        if isinstance(value, base) and not isinstance(value, (enum.Enum, np.generic)):
            return "of", _named(kind, namesakes), base.__repr__(value)
    if isinstance(value, types.FunctionType):
        head = "function", _named(value, namesakes), code_token(value.__code__)
        return *head, _one_of(head, value, namesakes)
    if isinstance(value, type):
        return "class", *[_named(c, namesakes) for c in value.__mro__]
    if isinstance(value, types.ModuleType):
        return "module", value.__name__
    if isinstance(value, enum.Enum):
        return "member", _named(kind, namesakes), value.name, _token(value.value, namesakes)
    if isinstance(value, dict):
        return _named(kind, namesakes), *[_token(x, namesakes) for x in value]
    if isinstance(value, Record):
        return _named(kind, namesakes), *[f.name for f in dataclasses.fields(value)]  # type: ignore[arg-type]
    if isinstance(value, (tuple, list, *_ATTRIBUTES)):
        return _named(kind, namesakes), str(len(value)) if isinstance(value, (tuple, list)) else ""
    if isinstance(value, (set, frozenset)):  # in the order in which a loop takes them
        return _named(kind, namesakes), *[_token(x, namesakes) for x in value]
    if isinstance(value, (np.ndarray, np.generic)) and not value.dtype.hasobject:
        return (_named(kind, namesakes), value.dtype.str, str(value.shape), hashlib.sha256(value.tobytes()).hexdigest())
    if isinstance(value, (fractions.Fraction, decimal.Decimal, np.dtype)):
        return _named(kind, namesakes), repr(value)
    if isinstance(value, types.CodeType):
        return "code", code_token(value)
    if isinstance(value, np.ufunc) or (isinstance(value, types.BuiltinFunctionType) and _of_module(value)):
        return "builtin", _named(value, namesakes)
    if isinstance(value, _DESCRIPTORS):
        return "descriptor", _named(value.__objclass__, namesakes), value.__name__
    return None


_DESCRIPTORS = (
    types.WrapperDescriptorType,
    types.MethodDescriptorType,
    types.GetSetDescriptorType,
    types.MemberDescriptorType,
)


def _of_module(function: types.BuiltinFunctionType) -> bool:
    return function.__self__ is None or isinstance(function.__self__, types.ModuleType)


def _named(value: Any, namesakes: Known) -> str:
    name = (
        f"{getattr(value, '__module__', '')}.{getattr(value, '__qualname__', None) or getattr(value, '__name__', '')}"
    )
    return name + _one_of(name, value, namesakes) if isinstance(value, type) else name


def _one_of(common: Any, value: Any, namesakes: Known) -> str:
    """The number of a value among its namesakes so far: '' for the first, '#1' for the second."""
    values = namesakes.setdefault(common, [])
    number = next((i for i, x in enumerate(values) if x is value), len(values))
    if number == len(values):
        values.append(value)
    return f"#{number}" if number else ""


@functools.lru_cache(4096)
def code_token(code: types.CodeType) -> str:
    """A hash of the code of a function: comments, docstrings and line numbers make no difference."""
    return hashlib.sha256(repr(_code(code)).encode()).hexdigest()


def _code(code: types.CodeType) -> Any:
    constants = list(code.co_consts)
    if constants and isinstance(constants[0], str) and _has_docstring(code):
        constants[0] = None
    names = code.co_names, code.co_varnames, code.co_cellvars, code.co_freevars
    counts = (code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags & _MEANING)
    return code.co_code.hex(), names, counts, [_constant(c) for c in constants]


def names(code: types.CodeType) -> list[str]:
    """The names of globals and attributes in a function and those nested in it."""
    inner = [n for c in code.co_consts if isinstance(c, types.CodeType) for n in names(c)]
    return list(dict.fromkeys([*code.co_names, *inner]))


def _constant(value: Any) -> Any:
    if isinstance(value, types.CodeType):
        return _code(value)
    if isinstance(value, frozenset):  # of a test `x in {...}`: the order says nothing
        return "frozenset", *sorted(repr(_token(x, {})) for x in value)
    return _token(value, {})


def _has_docstring(code: types.CodeType) -> bool:
    """Whether the first constant of a code, a text, is its docstring.  From Python 3.14 on a flag says so; before,
    every `def` has one, None at least.
    """
    if sys.version_info >= (3, 14):
        return bool(code.co_flags & _DOCSTRING)
    return bool(code.co_flags & inspect.CO_OPTIMIZED) and not code.co_name.startswith("<")


_DOCSTRING = 0x4000000
_MEANING = 0x3FF  # `*args`, generators, ...; without the flags of `from __future__`
