"""Compensated sums: numbers that remember what rounding took from them, so that many small
increments add up.

    s = value + rest,   s + x: value' = fl(value + fl(x + rest)),  rest' = fl(x + rest) - (value' - value)

Only sums remember.  Whatever else is done with such a number (products, sin, %, int) is done with
its value and gives an ordinary number.

Source: Kahan, Comm. ACM 8 (1965), 40; Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd
ed., VIII.5.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

from .bases import ByValue, StandIn
from .complex_numbers import is_vector


def _of_value(op: Callable[[Any, Any], Any]) -> Any:
    """An operator and its reflection that know nothing of what rounding took."""

    def method(self: Compensated, other: Any) -> Any:
        return NotImplemented if is_vector(other) else op(self.value, value_of(other))

    def reflected(self: Compensated, other: Any) -> Any:
        return NotImplemented if is_vector(other) else op(other, self.value)

    return method, reflected


class Compensated(ByValue):
    """value + rest, where |rest| is at most about half a unit in the last place of the value."""

    __slots__ = ("rest", "value")
    level = 0

    def __init__(self, value: Any, rest: Any = 0.0) -> None:
        self.value, self.rest = value, rest

    parts = property(operator.attrgetter("value", "rest"))

    def settled(self) -> Compensated:
        """The number, from here on one that remembers, if only zero."""
        remembers = not isinstance(self.rest, StandIn)
        return self if remembers else Compensated(self.value, 1.0 * self.rest)

    def __add__(self, other: Any) -> Any:
        if not _is_operand(other):
            return NotImplemented
        increment = (
            other.value + (_rest(self) + _rest(other)) if isinstance(other, Compensated) else other + _rest(self)
        )
        total = self.value + increment
        return Compensated(total, increment - (total - self.value))

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        return self + -other if _is_operand(other) else NotImplemented

    def __rsub__(self, other: Any) -> Any:
        return -self + other if _is_operand(other) else NotImplemented

    def __neg__(self) -> Compensated:
        return Compensated(-self.value, 0 - self.rest)  # of what is not there, 0, the same

    __mul__, __rmul__ = _of_value(operator.mul)
    __truediv__, __rtruediv__ = _of_value(operator.truediv)
    __mod__, __rmod__ = _of_value(operator.mod)
    __floordiv__, __rfloordiv__ = _of_value(operator.floordiv)

    def __pow__(self, n: Any) -> Any:
        return self.value ** value_of(n)

    def __rpow__(self, base: Any) -> Any:
        return base**self.value

    def __abs__(self) -> Any:
        return abs(self.value)

    def __float__(self) -> float:
        return float(self.value)

    def __repr__(self) -> str:
        return f"({self.value} + {self.rest})"


def _rest(x: Compensated) -> Any:
    """The rest that x remembers, on whichever way it came here."""
    remainder = x.rest
    return remainder.settled(_ON_ONE_WAY) if isinstance(remainder, StandIn) else remainder


_ON_ONE_WAY = (
    "a sum of a number that remembers on one way only what rounding took from it: write "
    "liemech.formulas.plain(x) before the branch, max or where"
)


def _is_operand(x: Any) -> bool:
    """Whether x may be added to a compensated number here, and not by rules of its own."""
    return isinstance(x, (int, float, StandIn, Compensated))


def value_of(x: Any) -> Any:
    """A number without what it remembers."""
    return x.value if isinstance(x, Compensated) else x
