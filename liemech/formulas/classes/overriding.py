"""Does a method that a user's class writes keep what its base in the library says of it: its
arguments, and that it gives a number or a vector?
"""

from __future__ import annotations

import dis
import inspect
import types
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from ...errors import InvalidType
from ..numbers.bases import InMemory
from ..vectors import Mat, Vec, small

F = TypeVar("F", bound=Callable[..., Any])

_LIBRARY = __name__.partition(".")[0]


class WrongResult(InvalidType):
    """A formula gave another kind of result than its base in the library does."""


def theirs(cls: type | types.FunctionType) -> bool:
    """Whether a class or a function is a user's, not the library's."""
    return (cls.__module__ or "").partition(".")[0] != _LIBRARY  # None: of a text that was executed


def require_signatures(cls: type, formula_of: Any) -> None:
    """Raise InvalidType for a method that takes other arguments than the one of the library that it
    overrides, and for one that gives nothing.

    formula_of : what finds the formula behind a method.
    """
    for home in filter(theirs, cls.__mro__[:-1]):
        for name, member in vars(home).items():
            base = overridden(cls, home, name)
            if base is None or not isinstance(member, types.FunctionType) or not theirs(member):
                continue
            formula, other = formula_of(member), formula_of(base[1])
            if _yields(formula) and not _yields(other):
                raise InvalidType(
                    f"{home.__name__}.{name} yields, and is called once for a result: end it with `return ...`"
                )
            taken, required = _positional(formula), _positional(other)
            if None in (taken, required):
                continue
            least, most, names = taken
            by_name = _by_name_only(formula)
            if not least <= len(required[2]) or not most >= required[0] or by_name:
                names = (*names, *(("*", *by_name) if by_name else ()))
                promised = ", ".join(("self", *required[2]))
                clock = (
                    "; an energy or force that depends on time belongs to a driven system, such as "
                    "DrivenHamiltonianSystem or DrivenHamiltonian"
                    if names[:1] == ("t",) and required[2][:1] != ("t",)
                    else ""
                )
                raise InvalidType(
                    f"{home.__name__}.{name} takes ({', '.join(('self', *names))}), and is called "
                    f"as {base[0].__name__}.{name}({promised}): write `def {name}({promised})`{clock}"
                )
            if _gives_nothing(formula) and not _gives_nothing(other):
                raise InvalidType(f"{home.__name__}.{name} returns nothing: end it with `return ...`")


def overridden(cls: type, home: type, name: str) -> tuple[type, Any] | None:
    """The class of the library whose method of this name one of `home` overrides, and the method."""
    for base in cls.__mro__[cls.__mro__.index(home) + 1 :]:
        member = vars(base).get(name)
        if isinstance(member, types.FunctionType) and not theirs(base) and base is not object:
            return (base, member) if not name.startswith("__") else None
    return None


def asked(method: F) -> F:
    """Mark a method that runs call for every object of its class, so that no field may have its name."""
    method.asked = True  # type: ignore[attr-defined]
    return method


def is_asked(cls: type, name: str) -> bool:
    """Whether runs call a method of this name for every object of the class."""
    return any(getattr(vars(base).get(name), "asked", False) for base in cls.__mro__)


def _positional(function: Any) -> Any:
    """The least and the most arguments after `self` that are given by their places, and their
    names; None if any number may be.
    """
    code = function.__code__
    if code.co_argcount < 1 or code.co_flags & inspect.CO_VARARGS:
        return None
    names = code.co_varnames[1 : code.co_argcount]
    return len(names) - len(function.__defaults__ or ()), len(names), names


def _by_name_only(function: Any) -> tuple[str, ...]:
    """The arguments that must be given, and by their names."""
    code, defaults = function.__code__, function.__kwdefaults__ or {}
    names = code.co_varnames[code.co_argcount : code.co_argcount + code.co_kwonlyargcount]
    return tuple([name for name in names if name not in defaults])


def _yields(function: Any) -> bool:
    """Whether a function gives an iterator, or is to be awaited."""
    return bool(function.__code__.co_flags & (inspect.CO_GENERATOR | inspect.CO_COROUTINE))


def _gives_nothing(function: Any) -> bool:
    """Whether a function returns, and always None."""
    if _yields(function):
        return False
    before, returns = None, []
    for instruction in dis.get_instructions(function.__code__):
        if instruction.opname == "RETURN_CONST":
            returns.append(instruction.argval is None)
        elif instruction.opname == "RETURN_VALUE":
            returns.append(before is not None and before.opname == "LOAD_CONST" and before.argval is None)
        before = instruction
    return bool(returns) and all(returns)


_NUMBER = "a number", "of a vector take a component, or lm.dot(x, x); a number for each site or edge is lm.each(values)"
_VECTOR = "a vector", "write lm.vec(...) with its components"
_MATRIX = "a matrix", "write lm.mat(...) with its rows"
_PROMISES = {
    "float": (0, *_NUMBER), "Vec": (1, *_VECTOR), "Mat": (2, *_MATRIX),
}  # fmt: skip


def promise(cls: type, name: str) -> tuple[int, str, str] | None:
    """The axes that the results of a user's method have, in words too, and the remedy; None if nothing is promised."""
    base = overridden(cls, cls, name) if theirs(cls) else None
    return base and _PROMISES.get(str(base[1].__annotations__.get("return", "")))


def breaks(promised: tuple[int, str, str], result: Any) -> bool:
    """Whether a result is no number, vector or matrix, whichever was promised."""
    kind = type(result)
    if isinstance(result, InMemory):
        return bool(result.axes != promised[0])
    return kind in _NO_NUMBERS if promised[0] == 0 else kind is not (None, Vec, Mat)[promised[0]]


def kept(promised: tuple[int, str, str], where: str, result: Any) -> Any:
    """The result of a formula, an array or a list as a vector or matrix; WrongResult if it is
    something else than promised.
    """
    _axes, shape, remedy = promised
    converted = small(result) if isinstance(result, (list, tuple, np.ndarray)) else result
    if not breaks(promised, converted):
        return converted
    if result is None:
        remedy = "end every way through it with `return ...`"
    got = "None" if result is None else f"{type(result).__name__}, {result!r}"[:90]
    raise WrongResult(f"{where} must return {shape}; got {got}: {remedy}")


_NO_NUMBERS = frozenset([type(None), Vec, Mat, str, tuple, list, dict, set, np.ndarray])
