"""The functions of `math` in formulas whose numbers carry more than a double: `math.sin` of a
number with a derivative is `liemech.formulas.sin`, and raises where Python's raises.

Python's own functions take floats only.  A formula that has met one of them with another number is
run again with functions of the same names that take all numbers.
"""

from __future__ import annotations

import math
import types
from collections.abc import Callable
from typing import Any

from . import functions
from .numbers.bases import ByValue, CarriesMore, Operand, StandIn


def _log(x: Any, *base: Any) -> Any:
    return functions.log(x) / functions.log(*base) if base else functions.log(x)


OF_MATH: dict[Any, Callable[..., Any]] = {
    **functions.OF_MATH,
    **{getattr(math, name): getattr(functions, name) for name in ("degrees", "fabs", "hypot", "radians")},
    math.log: _log,
}
"""Python's functions, and the formulas of the same meaning."""


def head(x: Any) -> Any:
    """The double in a number that carries more."""
    if isinstance(x, ByValue):
        return head(x.value)
    return head(x[0]) if hasattr(x, "grow") else x


def _taking_all(function: Any, formula: Callable[..., Any]) -> Callable[..., Any]:
    def value(*x: Any) -> Any:
        if not any(isinstance(a, Operand) for a in x):
            return function(*x)
        # which raises where there is none
        function(*[math.nan if isinstance(y, StandIn) else y for y in map(head, x)])
        return formula(*x)

    return value


_INSTEAD = {function: _taking_all(function, formula) for function, formula in OF_MATH.items()}


def _module() -> Any:
    """A stand-in for `math`, as it is now, whose functions take all numbers."""
    names = vars(math)
    instead = {n: _INSTEAD.get(f, f) for n, f in names.items() if isinstance(f, _BUILTIN)}
    return types.SimpleNamespace(**{**names, **instead})


_BUILTIN = types.BuiltinFunctionType


def taking_all(formula: Any) -> Any:
    """The formula with such functions, also in those that it calls by name."""
    return _again(formula, {}) if isinstance(formula, types.FunctionType) else formula


def _again(formula: types.FunctionType, copies: dict[int, Any]) -> Any:
    if id(formula) in copies:
        return copies[id(formula)]
    names = dict(formula.__globals__)
    copy: Any = types.FunctionType(formula.__code__, names, formula.__name__, formula.__defaults__, formula.__closure__)
    copy.__kwdefaults__ = formula.__kwdefaults__
    copies[id(formula)] = copy
    for name in _named(formula.__code__):
        value = names.get(name)
        if value is math:
            names[name] = _module()
        elif isinstance(value, _BUILTIN) and value in _INSTEAD:
            names[name] = _INSTEAD[value]
        elif isinstance(value, types.FunctionType) and value.__module__ == formula.__module__:
            names[name] = _again(value, copies)
    return copy


def _named(code: types.CodeType) -> set[str]:
    """The names in a function, and in those inside of it."""
    inner = [c for c in code.co_consts if isinstance(c, types.CodeType)]
    return {*code.co_names}.union(*map(_named, inner))


def run(formula: Any, *x: Any) -> Any:
    """formula(*x), where it has to be with functions that take all numbers."""
    try:
        return formula(*x)
    except CarriesMore:
        pass  # what is raised below is not raised because of this
    return taking_all(formula)(*x)
