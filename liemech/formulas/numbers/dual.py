"""Numbers that carry a derivative along, so that a formula evaluated with them differentiates
itself.

    f(x + e d) = f(x) + e f'(x) d,   e^2 = 0

Exact to rounding, in plain Python and in native code, where unused parts disappear.  `derivatives`
makes them.

Source: Griewank and Walther, Evaluating Derivatives, 2nd ed., chapter 3 (forward mode).
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from contextvars import ContextVar
from typing import Any

import numpy as np

from ...errors import NotCompilable
from .. import functions as f
from ..functions import LOG_2, LOG_10
from .bases import AN_INT, INTEGER_POWER, ONLY_THERE, ByValue, CarriesMore, Operand, StandIn, raise_if, whole_power
from .complex_numbers import outranks
from .forms import LinearForm

DEPTH: ContextVar[int] = ContextVar("how many derivatives are being taken, one inside the other", default=0)

ALONE: ContextVar[tuple[int, ...]] = ContextVar(
    "the levels of derivatives along which one site moves and all others rest", default=()
)


class Dual(ByValue):
    """value + e slope, e^2 = 0.  Comparisons look at the value.

    slope : a number, or a vector of those along several directions, which share the value.
    The integer 0 as a slope means that there is none: nothing is multiplied by it or added to it.

    level : tells the e of one derivative from those of others, which are taken inside it and have
    higher levels.  Where two meet, the higher level holds the lower one, which is a constant to
    it.  Left out, it is one of its own: above those of the derivatives being taken, below those of
    derivatives still to be taken.

    Source: Siskind and Pearlmutter, Perturbation confusion and referential transparency, IFL 2005.
    """

    __slots__ = ("level", "slope", "value")

    def __init__(self, value: Any, slope: Any, level: float | None = None) -> None:
        if level is None:
            level = DEPTH.get() + 0.5
        self.value, self.slope, self.level = value, slope, level

    parts = property(operator.attrgetter("value", "slope"))

    @property
    def form(self) -> tuple[Any, ...]:
        return Dual, self.level

    # An operation with a dual of the same level, with one of a higher level, or with a constant.

    def __add__(self, other: Any) -> Any:
        if isinstance(other, Dual) and other.level >= self.level:
            if other.level > self.level:
                return other + self
            return Dual(self.value + other.value, _sum(self.slope, other.slope), self.level)
        return NotImplemented if outranks(other) else Dual(self.value + other, self.slope, self.level)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        if isinstance(other, Dual) and other.level >= self.level:
            if other.level > self.level:
                return other.__rsub__(self)
            return Dual(self.value - other.value, _sum(self.slope, -other.slope), self.level)
        return NotImplemented if outranks(other) else Dual(self.value - other, self.slope, self.level)

    def __rsub__(self, other: Any) -> Any:
        return NotImplemented if outranks(other) else Dual(other - self.value, -self.slope, self.level)

    def __mul__(self, other: Any) -> Any:
        if isinstance(other, Dual) and other.level >= self.level:
            if other.level > self.level:
                return other * self
            slope = _sum(_scaled(self.value, other.slope), _scaled(other.value, self.slope))
            return Dual(self.value * other.value, slope, self.level)
        return NotImplemented if outranks(other) else Dual(self.value * other, _scaled(other, self.slope), self.level)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Any:
        if isinstance(other, Dual) and other.level >= self.level:
            if other.level > self.level:
                return other.__rtruediv__(self)
            quotient = self.value / other.value
            return Dual(quotient, _over(_sum(self.slope, -_scaled(quotient, other.slope)), other.value), self.level)
        return NotImplemented if outranks(other) else Dual(self.value / other, _over(self.slope, other), self.level)

    def __rtruediv__(self, other: Any) -> Any:
        if outranks(other):
            return NotImplemented
        quotient = other / self.value
        return Dual(quotient, _scaled(-(quotient / self.value), self.slope), self.level)

    def __pow__(self, n: Any) -> Any:
        """An int as exponent makes products, where they are few; any other exponent, a float too,
        asks the C library.
        """
        if isinstance(n, int) and abs(n) <= INTEGER_POWER:
            if n == 0:
                return Dual(self.value**0, 0, self.level)
            power = whole_power(self, abs(n))
            return power if n > 0 else 1.0 / power
        if outranks(n):
            return NotImplemented
        if isinstance(n, StandIn) and n.is_integer:
            raise NotCompilable(
                f"a power of a number that carries a derivative, with {AN_INT}: make it a float, `x ** float(n)`"
            )
        if isinstance(n, Dual) and n.level > self.level:
            return n.__rpow__(self)
        exponent, by_exponent = n.parts if isinstance(n, Dual) and n.level == self.level else (n, 0)
        value = self.value**exponent
        nonzero = 1.0 * (constant(exponent) != 0.0) if _rests(exponent) else 1.0
        rise = exponent * self.value ** (exponent - nonzero)  # x^0 = 1 at x = 0 too
        return Dual(
            value, _sum(_scaled(rise, self.slope), _by_exponent(self.value, exponent, value, by_exponent)), self.level
        )

    def __rpow__(self, base: Any) -> Any:
        if outranks(base):
            return NotImplemented
        value = base**self.value
        return Dual(value, _by_exponent(base, self.value, value, self.slope), self.level)

    def __mod__(self, other: Any) -> Any:
        if isinstance(other, Dual) and other.level >= self.level:
            if other.level > self.level:
                return other.__rmod__(self)
            slope = _sum(self.slope, -_scaled(self // other, other.slope))
            return Dual(self.value % other.value, slope, self.level)
        return NotImplemented if outranks(other) else Dual(self.value % other, self.slope, self.level)

    def __rmod__(self, other: Any) -> Any:
        return (
            NotImplemented
            if outranks(other)
            else Dual(other % self.value, -_scaled(other // self, self.slope), self.level)
        )

    def __floordiv__(self, other: Any) -> Any:
        return NotImplemented if outranks(other) else value_of(self) // value_of(other)

    def __rfloordiv__(self, other: Any) -> Any:
        return NotImplemented if outranks(other) else value_of(other) // value_of(self)

    def __neg__(self) -> Dual:
        return Dual(-self.value, -self.slope, self.level)

    def __abs__(self) -> Dual:
        sign = 1.0 * (self.value >= 0.0) - 1.0 * (self.value < 0.0)
        return Dual(abs(self.value), _scaled(sign, self.slope), self.level)

    # Equal numbers whose slopes differ are equal at this one point only.

    def __eq__(self, other: object) -> Any:
        equal = super().__eq__(other)
        _not_only_here(equal, self, other)
        return equal

    def __ne__(self, other: object) -> Any:
        _not_only_here(super().__eq__(other), self, other)
        return super().__ne__(other)

    def __bool__(self) -> bool:
        return bool(self != 0.0)

    __hash__ = None

    def __float__(self) -> float:
        raise CarriesMore("a number that carries a derivative")

    def __repr__(self) -> str:
        return f"({self.value} + e {self.slope})"


# ------------------------------------------------------------------ slopes


def _sum(a: Any, b: Any) -> Any:
    """The sum of two slopes."""
    return b if type(a) is int else a if type(b) is int else a + b


def _scaled(k: Any, slope: Any) -> Any:
    """The product of k and a slope; an int, which is zero, stays."""
    return slope if type(slope) is int else k * slope


def _over(slope: Any, k: Any) -> Any:
    """The quotient of a slope and k; an int, which is zero, stays."""
    return slope if type(slope) is int else slope / k


def _by_exponent(base: Any, exponent: Any, value: Any, slope: Any) -> Any:
    """The part of the slope of value = base^exponent that an exponent with this slope adds; at base
    0 nothing, if the exponent is above the order of the derivatives that are still to be taken by
    the base: x^(y - k) log x, which they lead to, is infinite there for y <= k.
    """
    if type(slope) is int:
        return slope
    zero = constant(base) == 0.0
    moves = constant(size_of(slope) if isinstance(slope, tuple) else slope) != 0.0
    infinite = zero & (constant(exponent) <= _order(base)) & moves
    raise_if(infinite, _NO_SLOPE)
    # in native code, which does not raise here, no number
    return value * f.log(base + (1.0 * zero - 1.0 * infinite)) * slope


_NO_SLOPE = (
    "x**y of x = 0 with an exponent that carries a derivative: this derivative is infinite there; where "
    "the exponent is a constant give it as one, else write the gradient or force yourself"
)


def _order(x: Any) -> float:
    """The count of derivatives that a number carries, one inside the other; those of a power series are endless."""
    if isinstance(x, Dual):
        return _order(x.value) + (type(x.slope) is not int)
    return math.inf if hasattr(x, "term") else 0


def _rests(x: Any) -> Any:
    """Whether a number carries no derivative and is no power series."""
    if isinstance(x, Dual):
        return type(x.slope) is int and _rests(x.value)
    return not hasattr(x, "term")


def value_of(x: Any) -> Any:
    """A number without its derivatives."""
    return value_of(x.value) if isinstance(x, Dual) else x


def _not_only_here(equal: Any, a: Any, b: Any) -> None:
    """Refuse that two numbers are equal although they move apart."""
    if equal is False or a is b or outranks(b) or not isinstance(b, _COMPARED):
        return
    motion = _motion(a - b)
    if type(motion) is not int:
        raise_if(equal & (constant(motion) != 0.0), ONLY_THERE.format("a number that carries a derivative"))


_COMPARED = (int, float, np.number, StandIn, Operand)


def _motion(x: Any) -> Any:
    """The sizes of all slopes of a number, added; the integer 0 if it has none."""
    return _motion(x.value) + size_of(x.slope) if isinstance(x, Dual) else 0


def constant(x: Any) -> Any:
    """A number alone: without its derivatives, and of a power series the first term.

    For comparisons with a point where a formula has one slope on all of its branches.
    """
    if isinstance(x, Dual):
        return constant(x.value)
    return constant(x[0]) if hasattr(x, "term") else x


def is_series(x: Any) -> bool:
    """Whether a number is a power series, or carries derivatives of one."""
    return hasattr(value_of(x), "term")


def size_of(x: Any) -> Any:
    """|x|, and of a number that carries a derivative that of both: zero only if both are; of slopes along
    several directions their sum.
    """
    if isinstance(x, tuple):
        total = size_of(x[0])
        for i in range(1, len(x)):
            total = total + size_of(x[i])
        return total
    return size_of(x.value) + size_of(x.slope) if isinstance(x, Dual) else abs(x)


def size_of_slope(x: Any) -> Any:
    """|dx| of the derivative dx that a number carries, 0 if it carries none; along several directions their sum."""
    return size_of_slope(x.value) + size_of(x.slope) if isinstance(x, Dual) else 0.0


def at_rest(slope: Any) -> Any:
    """A slope that is zero, along as many directions as another one, or a form as it."""
    if isinstance(slope, LinearForm):
        return LinearForm.zero()
    kind: Any = type(slope)
    return kind(*[0.0 for _ in slope]) if isinstance(slope, tuple) else 0.0


# ------------------------------------------------------------------ elementary functions:
# f(x + e d) = f(x) + e f'(x) d


def rise_of_tanh(x: Any, y: Any) -> Any:
    """The derivative 1 - y^2 of y = tanh x; where this is the rounding of y, 4 d/(1 + d)^2 with d = exp(-2 |x|)."""
    d, near = f.exp(-2.0 * abs(x)), 1.0 * (abs(constant(x)) < 1.0)
    return near * (1.0 - y * y) + (1.0 - near) * (4.0 * d / ((1.0 + d) * (1.0 + d)))


TIMES: dict[str, Callable[[Any, Any], Any]] = {
    "sin": lambda x, y: f.cos(x),
    "cos": lambda x, y: -f.sin(x),
    "tan": lambda x, y: 1.0 + y * y,
    "sinh": lambda x, y: f.cosh(x),
    "cosh": lambda x, y: f.sinh(x),
    "tanh": rise_of_tanh,
    "exp": lambda x, y: y,
    "exp2": lambda x, y: LOG_2 * y,
    "expm1": lambda x, y: f.exp(x),
}
"""f'(x), for y = f(x)."""

OVER: dict[str, Callable[[Any, Any], Any]] = {
    "sqrt": lambda x, y: 2.0 * y,
    "cbrt": lambda x, y: 3.0 * y * y,
    "asin": lambda x, y: f.sqrt((1.0 - x) * (1.0 + x)),
    "acos": lambda x, y: -f.sqrt((1.0 - x) * (1.0 + x)),
    "atan": lambda x, y: 1.0 + x * x,
    "asinh": lambda x, y: f.sqrt(x * x + 1.0),
    "acosh": lambda x, y: f.sqrt(x - 1.0) * f.sqrt(x + 1.0),
    "atanh": lambda x, y: (1.0 - x) * (1.0 + x),
    "log": lambda x, y: x,
    "log2": lambda x, y: LOG_2 * x,
    "log10": lambda x, y: LOG_10 * x,
    "log1p": lambda x, y: 1.0 + x,
}
"""1/f'(x): f' is not rounded before the division."""


def _rule(
    function: Callable[[Any], Any], factor: Callable[[Any, Any], Any], combine: Callable[[Any, Any], Any]
) -> Callable[[Any], Dual]:
    """An elementary function of a number that carries a derivative."""

    def value_and_slope(x: Any) -> Dual:
        y = function(x.value)
        return Dual(y, combine(x.slope, factor(x.value, y)), x.level)

    return value_and_slope


def _atan2(y: Any, x: Any) -> Dual:
    (a, da), (b, db), level = _of_two(y, x)
    return Dual(f.atan2(a, b), _over(_sum(_scaled(b, da), -_scaled(a, db)), a * a + b * b), level)


def _copysign(x: Any, y: Any) -> Dual:
    (a, da), (b, _), level = _of_two(x, y)
    sign = f.copysign(1.0, value_of(a)) * f.copysign(1.0, value_of(b))
    return Dual(f.copysign(a, b), _scaled(sign, da), level)


def _of_two(x: Any, y: Any) -> tuple[tuple[Any, Any], tuple[Any, Any], float]:
    """The parts of two numbers at the higher one of their levels, and the level."""
    level = max(x.level if isinstance(x, Dual) else 0.0, y.level if isinstance(y, Dual) else 0.0)
    a, b = (n.parts if isinstance(n, Dual) and n.level == level else (n, 0) for n in (x, y))
    return a, b, level


f.RULES.update(
    {name: _rule(getattr(f, name), slope, lambda s, k: _scaled(k, s)) for name, slope in TIMES.items()}
    | {name: _rule(getattr(f, name), slope, _over) for name, slope in OVER.items()}
    | {"atan2": _atan2, "copysign": _copysign, "pow": operator.pow}
)
