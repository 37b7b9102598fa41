"""Signatures: which arguments of a method are numbers, vectors, matrices or elements, of which
class the others are, and what the method gives.
"""

from __future__ import annotations

import functools
import inspect
import re
import types
from collections.abc import Callable, Iterable
from typing import Any, TypeVar

from ...errors import InvalidType
from ..vectors import Mat, Vec
from .annotations import kind_of, own_annotations
from .overriding import breaks, kept, promise

LIBRARY = __name__.partition(".")[0]

F = TypeVar("F", bound=Callable[..., Any])

KINDS = ("Ambient", "Element", "Mat", "Vec", "float")
"""The annotations of arguments that are numbers.  Of a method and the one it overrides, the earlier
of these annotations counts.

An `Element` has as many axes as an element of the group has, and is one; an `Ambient` has only its
shape.
"""

RECORDS: dict[str, type[Any]] = {}
"""All classes of records by name: an argument annotated as one of them must be one."""

PLAIN: dict[str, set[type]] = {
    "int": {int},
    "bool": {bool},
    "dict": set(),
    "Generator | int": set(),
    "int | tuple": set(),
}
"""The annotations of options that are no records, and the types that pass unseen."""

ARRAYS = ("ndarray", "ArrayLike")
"""The annotations of methods that take arrays themselves: one, shaped like an element, or elements
with any leading axes.
"""


class Signature:
    """A method with the annotations of its arguments.

    kinds : of the arguments that are numbers, vectors, ..., which of `KINDS`.
    classes : the annotations as text, without modules and brackets.
    promise : the results of a user's method, as the method of the library that it overrides has them; else None.
    """

    def __init__(self, cls: type, name: str, formula: types.FunctionType) -> None:
        self.name, self.formula, self.names = name, formula, arguments(formula)
        self.kinds, self.classes = _annotated_by_bases(cls, name, self.names)
        self.promise = promise(cls, name)

    @property
    def says_nothing(self) -> bool:
        """Whether there is no argument and no result to check."""
        first = next(iter(self.classes.values()), "Any")
        return not self.kinds and first == "Any" and self.promise is None

    @functools.cached_property
    def defaults(self) -> dict[str, Any]:
        """The arguments that may be left out."""
        trailing = self.formula.__defaults__ or ()
        return dict(zip(self.names[len(self.names) - len(trailing) :], trailing))

    @functools.cached_property
    def space_at(self) -> int | None:
        """The place of the argument that knows the shapes of the others; None: the owner does."""
        return next((self.names.index(n) for n in ("group", "action") if n in self.names), None)

    def shapes(self, space: Any) -> tuple[Any, ...]:
        """The length of a vector, the shape of a matrix, for each argument; None: any.  The space remembers it."""
        kinds = [(name, self.kinds.get(name, "float")) for name in self.names]
        shapes = [space._shape(name, kind) if kind != "float" else None for name, kind in kinds]
        lengths = tuple([s[0] if s and len(s) == 1 else s or None for s in shapes])
        if not hasattr(space, "_shapes"):
            object.__setattr__(space, "_shapes", {})
        space._shapes[self] = lengths
        return lengths

    @functools.cached_property
    def trusted(self) -> tuple[set[type] | None, ...]:
        """For each argument the types that pass unchecked: those that formulas hand to each other.  None: any type."""
        return tuple(map(self._trusted, self.names))

    def _trusted(self, name: str) -> set[type] | None:
        none = {type(None)} if self.optional(name) else set()
        kind, text = self.kinds.get(name, "float"), self.text(name)
        if kind != "float":
            return _SMALL.get(kind, {Vec, Mat}) | none
        if text == "float":
            return ({float} if self.kinds else set()) | none
        simple = text in PLAIN or text in ARRAYS or text in RECORDS
        return PLAIN.get(text, set()) | none if simple else None

    def text(self, name: str) -> str:
        """The annotation of an argument, whether or not it may be None."""
        return self.classes.get(name, "").removesuffix(" | None")

    def optional(self, name: str) -> bool:
        """Whether the argument of this name may be None."""
        allowed = self.classes.get(name, "").split(" | ")
        return self.defaults.get(name, 0) is None or "None" in allowed

    def bound(self, args: tuple[Any, ...], options: dict[str, Any]) -> dict[str, Any] | None:
        """The arguments by name; None if their number is wrong, which Python says best."""
        named = dict(zip(self.names, args)) | options
        if len(args) > len(self.names) or len(named) != len(args[: len(self.names)]) + len(options):
            return None
        return named if set(named) <= set(self.names) <= set(named) | set(self.defaults) else None

    def kept(self, owner: Any, result: Any) -> Any:
        """The result of the formula, if it is what was promised; else WrongResult."""
        if self.promise and breaks(self.promise, result):
            return kept(self.promise, f"{type(owner).__name__}.{self.name}", result)
        return result


_SMALL: dict[str, set[type]] = {"Vec": {Vec}, "Mat": {Mat}}


def bare(method: Any) -> Any:
    """The formula behind a method that broadcasts; anything else unchanged."""
    formula = getattr(method, "__formula__", method)  # which a decorator may have copied
    return formula if formula is getattr(method, "__wrapped__", method) else method


def arguments(method: types.FunctionType) -> tuple[str, ...]:
    """The names of the arguments after `self`; much quicker than `inspect.signature`, and every
    class pays for it on import.
    """
    code = method.__code__
    return code.co_varnames[1 : code.co_argcount]


def _annotated_by_bases(cls: type, name: str, names: tuple[str, ...]) -> tuple[dict[str, str], dict[str, str]]:
    """The kind and the class of each argument, from the annotations of a method and of those that it overrides."""
    kinds: dict[str, str] = {}
    classes: dict[str, str] = {}
    for base in cls.__mro__:
        member = base.__dict__.get(name)
        if not isinstance(member, types.FunctionType):
            continue
        for argument, description in zip(names, _annotated(bare(member))):
            if description is None:
                continue
            kind, text = description
            if kind is not None:
                before = kinds.get(argument, kind)
                kinds[argument] = kind if KINDS.index(kind) < KINDS.index(before) else before
            if text is not None and classes.get(argument, "Any") == "Any":
                classes[argument] = text
    return (kinds if set(kinds.values()) - {"float"} else {}), classes


Annotated = tuple["str | None", "str | None"] | None

_ANNOTATED: dict[types.FunctionType, list[Annotated]] = {}
"""The kinds and classes of the arguments of the library's formulas, as `_annotated` finds them."""


def _annotated(formula: types.FunctionType) -> list[Annotated]:
    """The kind and the class with which each argument of a formula is annotated; None without an annotation.  Formulas
    with `*args` or `**options` have no classes.
    """
    remembered = _ANNOTATED.get(formula)
    if remembered is not None:
        return remembered
    annotations = own_annotations(formula)
    counted = not formula.__code__.co_flags & (inspect.CO_VARARGS | inspect.CO_VARKEYWORDS)
    described: list[Annotated] = [
        None
        if name not in annotations
        else (kind_of(annotations[name], formula.__globals__), class_text(annotations[name]) if counted else None)
        for name in arguments(formula)
    ]
    if (formula.__module__ or "").partition(".")[0] == LIBRARY:
        _ANNOTATED[formula] = described
    return described


def class_text(annotation: Any) -> str:
    """An annotation without modules and brackets: "Generator | int | None", "int | tuple"."""
    if isinstance(annotation, str):
        return _short(annotation)
    return _short(getattr(annotation, "__name__", str(annotation)))


@functools.cache
def _short(text: str) -> str:
    return re.sub(r"\w+\.|\[.*?\]", "", text)


def keywords(function: Any) -> dict[str, None] | None:
    """The arguments that a function or method takes by name, `self` apart; None: any."""
    code = getattr(function, "__code__", None)
    if code is None or code.co_flags & inspect.CO_VARKEYWORDS:
        return None
    names = code.co_varnames[1 : code.co_argcount + code.co_kwonlyargcount]
    return dict.fromkeys(names[max(code.co_posonlyargcount - 1, 0) :])


def misspelt(where: str, parameters: Iterable[str], options: Iterable[str]) -> InvalidType:
    """The error for a keyword that is not known, with the nearest one that is."""
    import difflib

    unknown = next(name for name in options if name not in parameters)
    near = difflib.get_close_matches(unknown, parameters, 1)
    hint = f". Did you mean {near[0]!r}?" if near else f"; it takes {', '.join(parameters) or 'none'}"
    return InvalidType(f"{where}() got an unexpected keyword argument {unknown!r}{hint}")


def spelt(function: F) -> F:
    """A function, or method, that answers a misspelt keyword with the nearest of its arguments."""
    code = function.__code__
    parameters = dict.fromkeys(code.co_varnames[: code.co_argcount + code.co_kwonlyargcount])

    @functools.wraps(function)
    def checked(*args: Any, **options: Any) -> Any:
        try:
            return function(*args, **options)
        except TypeError:
            if parameters.keys() >= options.keys():
                raise
            where = function.__qualname__.removesuffix(".__init__")
            raise misspelt(where, [name for name in parameters if name != "self"], options) from None

    return checked  # type: ignore[return-value]
