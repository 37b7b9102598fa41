"""Formulas that follow from others: what a class may overrule by a closed form, which closed forms a
class has, and which of them are those of an energy that a subclass has replaced.
"""

from __future__ import annotations

import dataclasses
import dis
import functools
import inspect
import types
from collections.abc import Callable, Iterable, Iterator
from typing import Any, TypeVar

from ...errors import InvalidType, NotDefined
from .overriding import theirs
from .signatures import bare

Formula = TypeVar("Formula", bound=Callable[..., Any])


def derived(formula: Formula) -> Formula:
    """Mark a method that is derived from the methods of `self` that it calls.  A subclass that overrides it writes a
    closed form, which gives the same numbers.

    A closed form belongs to those methods: a subclass that overrides one of them, and not the closed form, has the
    derived method again.
    """
    formula.__derived__ = True  # type: ignore[attr-defined]
    return formula


def derived_from(*sources: str) -> Callable[[Formula], Formula]:
    """Mark a method whose answer, such as None, or an error, holds for all versions of these methods.  A class that
    overrides it knows more of its own versions, as with a closed form.
    """

    def mark(formula: Formula) -> Formula:
        formula.__sources__ = sources  # type: ignore[attr-defined]
        return derived(formula)

    return mark


def closed_form_of(*sources: str) -> Callable[[Formula], Formula]:
    """Mark a closed form of what cannot be derived, such as the exact motion.  A subclass that overrides one of the
    sources has the version of the next base, or a property that raises NotDefined.
    """

    def mark(formula: Formula) -> Formula:
        formula.__sources__ = sources  # type: ignore[attr-defined]
        return formula

    return mark


def closed_forms(cls: type) -> Iterator[tuple[str, Any, Any]]:
    """For each closed form of a class of a derived method the name, the closed form and the derived method."""
    for name, home, base in _overruled(cls):
        follows = bare(vars(base)[name]) if base else None
        if isinstance(follows, types.FunctionType) and is_derived(follows) and not hasattr(follows, "__sources__"):
            yield name, bare(vars(home)[name]), follows


def is_derived(member: Any) -> bool:
    """Whether a member is marked as derived."""
    return getattr(_function(member), "__derived__", False)


def stale_forms(cls: type) -> Iterator[tuple[str, type, type | None]]:
    """The closed forms that a class inherits although one of their sources is overridden: the name, the class that has
    the closed form, and the base whose method takes its place, if there is one.
    """
    for name, home, base in _overruled(cls):
        formula = _function(vars(home)[name])
        if home is cls or getattr(formula, "__final__", False):
            continue
        changed = _written_anew(cls, home, formula if hasattr(formula, "__sources__") or not base else vars(base)[name])
        if changed and not _is_of_the_library(cls, (name, *changed)):
            yield name, home, base


def follow_anew(cls: type) -> None:
    """Replace the stale closed forms of a class by derived methods.

    Raises InvalidType where an overriding source calls the closed form: the derived method would call itself.
    """
    while stale := list(stale_forms(cls)):
        for name, home, base in stale:
            sources = _reads(_function(vars(base)[name])) - {name} if base else frozenset()
            if name in _called(cls, sources):
                raise InvalidType(
                    f"{cls.__name__} writes anew what {home.__name__}.{name} is a closed form of, and goes by way of "
                    f"that closed form, as {home.__name__} does: write `{name}` too"
                )
            setattr(cls, name, vars(base)[name] if base else _missing(name, home))


def _missing(name: str, home: type) -> property:
    """A property that says why there is no closed form."""

    def missing(self: Any) -> Any:
        raise NotDefined(
            f"{type(self).__name__}.{name}: {home.__name__} knows it of its own formulas, and {type(self).__name__} "
            "writes others; write it too, or integrate"
        )

    return property(missing)


def _overruled(cls: type) -> Iterator[tuple[str, type, type | None]]:
    """Each closed form of a class: the name, the class that has it, and the base with the method that it replaces."""
    for name in sorted({name for base in cls.__mro__ for name in vars(base)}):
        homes = [base for base in cls.__mro__ if name in vars(base)]
        formula = _function(vars(homes[0])[name])
        if is_derived(formula) or name.startswith("__"):
            continue
        if hasattr(formula, "__sources__"):
            yield name, homes[0], homes[1] if len(homes) > 1 else None
        elif base := next((base for base in homes if is_derived(vars(base)[name])), None):
            yield name, homes[0], base


def _written_anew(cls: type, home: type, member: Any) -> set[str]:
    """The methods read by `member` of `home`, directly or by other methods, that `cls` overrides.

    A method that is abstract in `home` counts only if `member` itself reads it.  Fields do not count: they are parameters.
    """
    direct = _reads(_function(member))
    changed = set()
    for name in _reached(cls, direct) - _fields(home):
        definer, original = _definer(cls, name), _definer(home, name)
        if original is None and name in direct:  # `home` is a mixin, or leaves it to subclasses
            if definer is not None and cls.__mro__.index(definer) < cls.__mro__.index(home):
                changed.add(name)
        elif (
            definer is not original
            and original
            and (name in direct or not _is_abstract(_function(vars(original)[name])))
        ):
            changed.add(name)
    return changed


@functools.cache
def _fields(cls: type) -> frozenset[str]:
    return frozenset(field.name for field in dataclasses.fields(cls)) if dataclasses.is_dataclass(cls) else frozenset()


def written_together(cls: type, *names: str) -> bool:
    """Whether the methods of these names are of one class, or together from one of the library."""
    in_one_class = len({_definer(cls, name) for name in names}) == 1
    return in_one_class or _is_of_the_library(cls, names)


def _is_of_the_library(cls: type, names: Iterable[str]) -> bool:
    """Whether a class has the methods of these names together from one class of the library."""
    return any(
        all(_definer(base, name) is _definer(cls, name) for name in names) for base in cls.__mro__ if not theirs(base)
    )


def _definer(cls: type, name: str) -> type | None:
    return next((base for base in cls.__mro__ if name in vars(base)), None)


def _is_abstract(formula: Any) -> bool:
    """Whether a method only says that a subclass has to write it."""
    names = getattr(getattr(formula, "__code__", None), "co_names", ())
    refusals = {"undefined", "NotDefined", "NotImplementedError"}
    return getattr(formula, "__isabstractmethod__", False) or not refusals.isdisjoint(names)


def _reached(cls: type, names: frozenset[str]) -> set[str]:
    """The names of methods and of all that they call in turn, in every version that a class inherits: `super` may call
    any of them.
    """
    return _in_turn(names, lambda name: [_function(vars(base).get(name)) for base in cls.__mro__])


def _called(cls: type, names: frozenset[str]) -> set[str]:
    """The names of methods and of all that they call in turn, in the versions that a class has."""

    def versions(name: str) -> Iterator[Any]:
        for base in cls.__mro__:
            if name in vars(base):
                yield (formula := _function(vars(base)[name]))
                if "super" not in getattr(getattr(formula, "__code__", None), "co_names", ()):
                    return

    return _in_turn(names, versions)


def _in_turn(names: Iterable[str], versions: Callable[[str], Iterable[Any]]) -> set[str]:
    """Names of methods, and all names that their formulas read, theirs read, and so on.

    versions : the formulas that a name stands for.
    """
    reached: set[str] = set()
    waiting = [*names]
    while waiting:
        name = waiting.pop()
        if name not in reached:
            reached.add(name)
            for formula in versions(name):
                waiting.extend(_reads(formula))
    return reached


def _function(member: Any) -> Any:
    """The function behind a method, of an object or of its class, or a property."""
    for name in ("fget", "func", "__func__"):
        member = getattr(member, name, None) or member
    return bare(member)


def _reads(formula: Any) -> frozenset[str]:
    """The attributes of `self` that a formula reads, or its declared sources."""
    if hasattr(formula, "__sources__"):
        return frozenset(formula.__sources__)
    return _read_by(formula) if isinstance(formula, types.FunctionType) else frozenset()


@functools.cache
def _read_by(formula: types.FunctionType) -> frozenset[str]:
    """The attributes of its first argument that a function reads.  If the argument goes elsewhere, into another name, a
    function or a decorator: all names in the function and in the functions of users that it may call.
    """
    code = formula.__code__
    if not code.co_argcount and not code.co_flags & inspect.CO_VARARGS:
        return frozenset()
    read: set[str] = set()
    if code.co_argcount and not _read_of(code, code.co_varnames[0], read):
        return frozenset(read)
    reached, waiting = {formula}, [formula]
    while waiting:
        function = waiting.pop()
        names, constants = _written_in(function.__code__)
        read |= names | constants
        cells = [cell.cell_contents for cell in function.__closure__ or () if cell != _EMPTY]
        for called in map(_function, (*cells, *[function.__globals__.get(name) for name in names])):
            if isinstance(called, types.FunctionType) and theirs(called) and called not in reached:
                reached.add(called)
                waiting.append(called)
    return frozenset(read)


_EMPTY = types.CellType()


def _read_of(code: types.CodeType, owner: str, read: set[str]) -> bool:
    """Add the attributes of a local value that a code reads; does the value go elsewhere?"""
    away, loaded = False, False
    for instruction in dis.get_instructions(code):
        name, value = instruction.opname, instruction.argval
        if loaded and name in ("LOAD_ATTR", "LOAD_METHOD"):
            read.add(value)
            away = away or value == "__class__"
        elif loaded:
            away = True
        values = value if isinstance(value, tuple) else (value,)  # two at once, since 3.13
        loads = name.startswith(("LOAD_FAST", "LOAD_DEREF")) and not (
            name.startswith("LOAD_FAST") and owner in code.co_cellvars  # which closures are made of, since 3.13
        )
        loaded = loads and values[-1] == owner
        away = away or (loads and owner in values[:-1])
    for inner in code.co_consts:
        if isinstance(inner, types.CodeType) and owner in inner.co_freevars:
            away = _read_of(inner, owner, read) or away
    return away


def _written_in(code: types.CodeType) -> tuple[set[str], set[str]]:
    """The names, and the texts, in a code."""
    names, texts = {*code.co_names}, {x for x in code.co_consts if isinstance(x, str)}
    for inner in code.co_consts:
        if isinstance(inner, types.CodeType):
            nested = _written_in(inner)
            names, texts = names | nested[0], texts | nested[1]
    return names, texts
