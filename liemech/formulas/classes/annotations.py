"""Meanings of annotations: `Vec`, `lm.Vec`, `Optional[Vec]`, `"Vec | None"`, an alias, as a text
or as a value, on every Python.

Resolution never fails: a name that cannot be found, because it is defined later or imported for
typing only, gives `Unknown`.
"""

from __future__ import annotations

import builtins
import functools
import sys
import types
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Annotated, Any, NewType, TypeVar

from ..vectors import Mat, Vec

Element: Any = Annotated[Any, "element"]
"""Annotates an element of a group: a `Mat`, or a `Vec` for groups whose elements are vectors."""

Ambient: Any = Annotated[Any, "ambient"]
"""Annotates what has the shape of an element and need not be one."""

WELL_KNOWN = {"Vec": Vec, "Mat": Mat, "Element": Element, "Ambient": Ambient, "None": None}
"""Meanings of these names where they are imported for typing only."""


class Unknown:
    """The meaning of an annotation, or a part of one, whose names cannot be found."""

    def __or__(self, other: Any) -> Any:
        return typing.Union[self, other]  # noqa: UP007  (`|` is what is defined here)

    __ror__ = __or__

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return self

    def __getitem__(self, item: Any) -> Any:
        return self

    def __call__(self) -> None:
        """Never called: `typing` takes what can be called for a type."""


UNKNOWN = Unknown()


class _Names(Mapping[str, Any]):
    """The names that a text can see; those that are not there are unknown."""

    def __init__(self, *places: Mapping[str, Any]) -> None:
        self.places = *places, vars(builtins), WELL_KNOWN

    def __getitem__(self, name: str) -> Any:
        return next((place[name] for place in self.places if name in place), UNKNOWN)

    def __iter__(self) -> Iterator[str]:
        return iter(())

    def __len__(self) -> int:
        return 0


def own_annotations(thing: Any) -> Mapping[str, Any]:
    """The annotations written in a class or function itself, none of them evaluated in vain."""
    # PEP 649: they are computed when asked for, and a name may not exist yet
    if sys.version_info >= (3, 14):
        import annotationlib

        return annotationlib.get_annotations(thing, format=annotationlib.Format.FORWARDREF)
    return vars(thing).get("__annotations__", {}) if isinstance(thing, type) else thing.__annotations__


def members(annotation: Any, *places: Mapping[str, Any]) -> tuple[Any, ...]:
    """The types that an annotation allows: those of a union, without aliases, quotes, `Annotated`
    and the like.

    places : where names are looked for, nearest first.
    """
    if isinstance(annotation, str) and "|" in annotation and not set(annotation) & set("[]()'\""):
        return _union([part.strip() for part in annotation.split("|")], places)
    type_ = _value(annotation, places)
    if type_ is Element or type_ is Ambient:
        return (type_,)
    origin, inner = typing.get_origin(type_), typing.get_args(type_)
    if origin in (typing.Union, types.UnionType):
        return _union(inner, places)
    if origin in (Annotated, typing.Final):
        return members(inner[0], *places)
    if isinstance(type_, NewType):
        return members(type_.__supertype__, *places)
    if isinstance(type_, TypeVar):
        return members(type_.__bound__ or Any, *places)
    if type(type_).__name__ == "TypeAliasType":  # `type A = ...`, from Python 3.12 on
        return members(_later(lambda: type_.__value__), *places)
    return (type(None) if type_ is None else type_,)


def _union(parts: Iterable[Any], places: tuple[Mapping[str, Any], ...]) -> tuple[Any, ...]:
    return tuple(dict.fromkeys(m for part in parts for m in members(part, *places)))


def _value(annotation: Any, places: tuple[Mapping[str, Any], ...]) -> Any:
    for _ in range(8):  # a quoted text may stand for another
        text = annotation if isinstance(annotation, str) else getattr(annotation, "__forward_arg__", None)
        if not isinstance(text, str):
            return annotation
        # what Python 3.14 knows about a text of its own making
        extra = getattr(annotation, "__extra_names__", None) or {}
        names = _Names(extra, *places)
        name, *attributes = text.strip().split(".")
        if name.isidentifier() and all(map(str.isidentifier, attributes)):
            annotation = functools.reduce(_attribute, attributes, names[name])
        else:
            annotation = _later(functools.partial(eval, text, {}, names))
    return UNKNOWN


def _attribute(holder: Any, name: str) -> Any:
    """An attribute that is there; an annotation is no reason to load a part of a package."""
    if isinstance(holder, types.ModuleType) and name not in WELL_KNOWN and name not in vars(holder):
        return UNKNOWN
    return getattr(holder, name, UNKNOWN)


def _later(value: Callable[[], Any]) -> Any:
    try:
        return value()
    except Exception:  # nonsense and names that come later: an annotation is no reason to fail
        return UNKNOWN


# ------------------------------------------------------------------ of methods

_KINDS = {id(Element): "Element", id(Ambient): "Ambient", id(Mat): "Mat", id(Vec): "Vec", id(float): "float"}
_WRAPPERS = {id(x) for x in (typing.Optional, typing.Union, Annotated, typing.Final)}


def kind_of(annotation: Any, names: Mapping[str, Any]) -> str | None:
    """The one of `signatures.KINDS` that the annotation of an argument is, None apart; every class pays for it on
    import.
    """
    if type(annotation) is str:
        if annotation.isidentifier():
            type_ = names.get(annotation, names)
            if type_ is names:
                type_ = vars(builtins).get(annotation) or WELL_KNOWN.get(annotation)
            if id(type_) in _KINDS or isinstance(type_, type):
                return _KINDS.get(id(type_))
        elif "[" in annotation and "|" not in annotation:
            generic, _, _ = annotation.partition("[")
            if id(_value(generic, (names,))) not in _WRAPPERS:
                return None
    allowed = [m for m in members(annotation, names) if m is not type(None)]
    return _KINDS.get(id(allowed[0])) if len(allowed) == 1 else None
