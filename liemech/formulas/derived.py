"""Formulas that follow from others: what a class may overrule by a closed form, which closed forms a
class has, and which of them are those of an energy that a subclass has replaced.
"""

from __future__ import annotations

import dis
import functools
import types
from collections.abc import Callable, Iterator
from typing import Any, TypeVar

from .signatures import bare

Formula = TypeVar("Formula", bound=Callable[..., Any])


def derived(formula: Formula) -> Formula:
    """Mark a method that follows from what a subclass must write, the methods of `self` that it calls:
    an own version of it is a closed form, which has to give the same numbers.

    A closed form counts beside those methods only: a subclass that writes one of them anew, and no
    closed form, has the derived method again.
    """
    formula.__derived__ = True  # type: ignore[attr-defined]
    return formula


def derived_from(*sources: str) -> Callable[[Formula], Formula]:
    """Mark a method that says what is known without further knowledge of these methods: None, nothing,
    or an error.  An own version of it is knowledge about them, and counts as a closed form does.
    """

    def mark(formula: Formula) -> Formula:
        formula.__sources__ = sources  # type: ignore[attr-defined]
        return derived(formula)

    return mark


def closed_forms(cls: type) -> Iterator[tuple[str, Any, Any]]:
    """The derived methods that a class has its own version of, but for what is known of others: the
    name, that version, and the derived method that it stands for.
    """
    for name, home, base in _overruled(cls):
        follows = bare(vars(base)[name])
        if isinstance(follows, types.FunctionType) and not hasattr(follows, "__sources__"):
            yield name, bare(vars(home)[name]), follows


def is_derived(member: Any) -> bool:
    """Was it marked?"""
    return getattr(_function(member), "__derived__", False)


def stale_forms(cls: type) -> Iterator[tuple[str, type]]:
    """The closed forms that a class inherits and that are those of a method that has been written
    anew: the name, and the base whose derived method is to stand for it.
    """
    for name, home, base in _overruled(cls):
        final = getattr(_function(vars(home)[name]), "__final__", False)
        if home is not cls and not final and _is_stale(cls, name, home, vars(base)[name]):
            yield name, base


def follow_anew(cls: type) -> None:
    """Put derived methods in the place of closed forms that a class inherits, where it, or a base before
    theirs, writes anew what they abbreviate.
    """
    while stale := dict(stale_forms(cls)):
        for name, base in stale.items():
            setattr(cls, name, vars(base)[name])


def _overruled(cls: type) -> Iterator[tuple[str, type, type]]:
    """Each method with a closed form: its name, the class that has the closed form, and the one that
    has the derived method.
    """
    for name in sorted({name for base in cls.__mro__ for name in vars(base)}):
        homes = [base for base in cls.__mro__ if name in vars(base)]
        if not is_derived(vars(homes[0])[name]):
            base = next((base for base in homes if is_derived(vars(base)[name])), None)
            if base is not None:
                yield name, homes[0], base


def _is_stale(cls: type, name: str, home: type, derivation: Any) -> bool:
    """Is a closed form of `home` that of other methods than a class has?

    Direct sources must be those of `home`.  Of what these call, helpers that the closed form calls
    too may be written anew.
    """
    direct = _reads(_function(derivation))
    sources = _reached(cls, direct, every_version=True)
    changed = [source for source in sources if _written_anew(cls, source, home)]
    if not changed:
        return False
    shared = _reached(cls, _reads(_function(vars(home)[name])), every_version=False)
    return any(source in direct or source not in shared for source in changed)


def _written_anew(cls: type, name: str, home: type) -> bool:
    """Has a class another method of this name than `home`?"""
    own, known = _definer(cls, name), _definer(home, name)
    if own is None or known is not None:
        return own is not known
    return cls.__mro__.index(own) < cls.__mro__.index(home)  # `home` is a mixin that knows no such method


def _definer(cls: type, name: str) -> type | None:
    return next((base for base in cls.__mro__ if name in vars(base)), None)


def _reached(cls: type, names: frozenset[str], every_version: bool) -> set[str]:
    """These names of methods, and those of what they call in turn, as a class has them; or by every
    version that it inherits, which `super` may call.
    """
    found: set[str] = set()
    waiting = [*names]
    while waiting:
        name = waiting.pop()
        homes = [base for base in cls.__mro__ if name in vars(base)]
        if name in found or not homes:
            continue
        found.add(name)
        for home in homes if every_version else homes[:1]:
            waiting.extend(_reads(_function(vars(home)[name])))
    return found


def _function(member: Any) -> Any:
    """The function behind a method or a property."""
    return bare(getattr(member, "fget", None) or getattr(member, "func", None) or member)


@functools.cache
def _reads(formula: Any) -> frozenset[str]:
    """The attributes of `self` that a formula reads, or those that it is said to follow from."""
    if not isinstance(formula, types.FunctionType) or not formula.__code__.co_argcount:
        return frozenset()
    if hasattr(formula, "__sources__"):
        return frozenset(formula.__sources__)
    found, waiting = set(), [formula.__code__]
    owner = formula.__code__.co_varnames[0]
    while waiting:
        code = waiting.pop()
        waiting.extend(x for x in code.co_consts if isinstance(x, types.CodeType))
        loaded: Any = None
        for instruction in dis.get_instructions(code):
            if instruction.opname in ("LOAD_ATTR", "LOAD_METHOD") and loaded == owner:
                found.add(instruction.argval)
            loaded = instruction.argval[-1] if isinstance(instruction.argval, tuple) else instruction.argval
    return frozenset(found)
