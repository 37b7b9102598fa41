"""Numbers without values, by which the degree of a formula, and the numbers that it depends on, are found.

A formula that runs with them does the same at every point: comparisons, signs and roundings raise ValueAsked.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import Any

from ..vectors import Vec
from .bases import Operand, StandIn

ASKED = "it depends on a comparison, a sign or a rounding"


class ValueAsked(TypeError):
    """Raised where a formula needs a value or a sign."""


def _asked(self: Anything, *others: Any) -> Any:
    raise ValueAsked(ASKED)


class Anything(Operand, StandIn):
    """A number without a value.

    degree : as a polynomial of the numbers that count; 0 if it does not depend on them, infinite if it is no polynomial.
    indices : of the numbers of which it is made.
    """

    __slots__ = ("degree", "indices")

    def __init__(self, degree: float = inf, indices: frozenset[int] = frozenset()) -> None:
        self.degree, self.indices = degree, indices

    def __add__(self, other: Any) -> Any:
        if isinstance(other, Anything):
            return Anything(max(self.degree, other.degree), self.indices | other.indices)
        return self if isinstance(other, (int, float)) else NotImplemented

    __radd__ = __sub__ = __rsub__ = __add__

    def __mul__(self, other: Any) -> Any:
        if isinstance(other, Anything):
            return Anything(self.degree + other.degree, self.indices | other.indices)
        if isinstance(other, (int, float)):
            return self if other else 0.0
        return NotImplemented

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Any:
        if isinstance(other, Anything):
            return Anything(inf if other.degree else self.degree, self.indices | other.indices)
        return self if isinstance(other, (int, float)) else NotImplemented

    def __rtruediv__(self, other: Any) -> Any:
        if isinstance(other, (int, float)):
            return self._function() if other else 0.0
        return NotImplemented

    def __pow__(self, n: Any) -> Any:
        if isinstance(n, int) and n >= 0:
            return Anything(self.degree * n, self.indices) if n else 1.0
        return self._function(n) if isinstance(n, (int, float, Anything)) else NotImplemented

    def __rpow__(self, base: Any) -> Any:
        return self._function() if isinstance(base, (int, float)) else NotImplemented

    def __neg__(self) -> Anything:
        return self

    __pos__ = __neg__

    def _function(self, *others: Any) -> Anything:
        """A function of this number and others: no polynomial, unless all of them are constant."""
        numbers = [self, *(x for x in others if isinstance(x, Anything))]
        return Anything(inf if any(x.degree for x in numbers) else 0, frozenset().union(*(x.indices for x in numbers)))

    def elementary(self, name: str, *x: Any) -> Any:
        """A function of the number, except `copysign`, which looks at a sign."""
        return _asked(self) if name == "copysign" else self._function(*x)

    __lt__ = __le__ = __gt__ = __ge__ = __bool__ = __abs__ = _asked
    __mod__ = __rmod__ = __floordiv__ = __rfloordiv__ = __divmod__ = __rdivmod__ = _asked
    __int__ = __float__ = __index__ = __round__ = __floor__ = __ceil__ = __trunc__ = _asked
    __eq__ = __ne__ = _asked
    __hash__ = None  # type: ignore[assignment]


def traced(formula: Callable[[Vec], Any], degrees: list[int]) -> tuple[Any, str]:
    """The result of a formula, run with numbers of these degrees; or None, and why it may depend on the point in another
    way than as one expression.
    """
    try:
        return formula(Vec(*[Anything(d, frozenset([i])) for i, d in enumerate(degrees)])), ""
    except (ArithmeticError, AttributeError, ValueError, TypeError) as refusal:
        return None, str(refusal)


def why_not_one_expression(formula: Callable[[Vec], Any], n: int) -> str:
    """Why a formula of n numbers is not one expression everywhere; empty if it is."""
    return traced(formula, [1] * n)[1]


def degree(x: Any) -> float:
    """The degree of a result as a polynomial."""
    return x.degree if isinstance(x, Anything) else 0


def indices_in(x: Any) -> frozenset[int]:
    """The numbers of which a result is made."""
    return x.indices if isinstance(x, Anything) else frozenset()
