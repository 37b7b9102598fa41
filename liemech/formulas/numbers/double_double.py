"""Numbers of two doubles, 32 digits: a formula evaluated with them rounds at 2^-104 instead of
2^-53.

    x = value + low,   |low| at most half a unit in the last place of the value

Products and quotients are rounded to a few 2^-106, sums to that of |a| + |b|; `//`, `%`, `int` and
`round` look at all 32 digits, comparisons at the value.  They are made of
ordinary operations and of fused multiplications, and so have the same bits in plain Python and in
native code.  No operation here branches.

Source: Joldes, Muller, Popescu, Tight and rigorous error bounds for basic building blocks of
double-word arithmetic, ACM Trans. Math. Softw. 44 (2017), algorithms 4, 5, 9, 12, 15, 17; Dekker,
Numer. Math. 18 (1971), 224.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from typing import Any

from .. import functions as f
from .bases import INTEGER_POWER, ByValue, CarriesMore, StandIn, whole_power


def _reflected(op: Callable[[Any, Any], Any]) -> Any:
    """An operator whose left operand is a number of one double."""

    def method(self: DoubleDouble, other: Any) -> Any:
        return op(DoubleDouble(1.0 * other), self) if _is_operand(other) else NotImplemented

    return method


class DoubleDouble(ByValue):
    """value + low, a number of 32 digits.  Comparisons look at the value, which is the number rounded to a double."""

    __slots__ = ("low", "value")
    level = 0

    def __init__(self, value: Any, low: Any = 0.0) -> None:
        self.value, self.low = value, low

    parts = property(operator.attrgetter("value", "low"))

    def __add__(self, other: Any) -> Any:
        if isinstance(other, DoubleDouble):  # algorithm 5
            high, error = two_sum(self.value, other.value)
            return DoubleDouble(*fast_two_sum(high, error + (self.low + other.low)))
        if not _is_operand(other):
            return NotImplemented
        high, error = two_sum(self.value, 1.0 * other)  # algorithm 4
        return DoubleDouble(*fast_two_sum(high, self.low + error))

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        return self + -other if _is_operand(other) else NotImplemented

    def __rsub__(self, other: Any) -> Any:
        return -self + other if _is_operand(other) else NotImplemented

    def __mul__(self, other: Any) -> Any:
        if isinstance(other, DoubleDouble):  # algorithm 12
            high, error = two_product(self.value, other.value)
            cross = f.fma(self.low, other.value, f.fma(self.value, other.low, self.low * other.low))
            return DoubleDouble(*fast_two_sum(high, error + cross))
        if not _is_operand(other):
            return NotImplemented
        other = 1.0 * other
        high, error = two_product(self.value, other)  # algorithm 9
        return DoubleDouble(*fast_two_sum(high, f.fma(self.low, other, error)))

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Any:
        if isinstance(other, DoubleDouble):  # algorithm 17
            high = self.value / other.value
            product = other * high
            residual = (self.value - product.value) + (self.low - product.low)
            return DoubleDouble(*fast_two_sum(high, residual / other.value))
        if not _is_operand(other):
            return NotImplemented
        high = self.value / other  # algorithm 15
        product, error = two_product(high, 1.0 * other)
        return DoubleDouble(*fast_two_sum(high, (((self.value - product) - error) + self.low) / other))

    def __pow__(self, n: Any) -> Any:
        """An int as exponent makes products, where they are few; any other exponent is one of exp(n log x)."""
        if isinstance(n, int) and abs(n) <= INTEGER_POWER:
            power = whole_power(self, abs(n)) if n else DoubleDouble(self.value**0, 0.0 * self.low)
            return power if n >= 0 else 1.0 / power
        if not _is_operand(n):
            return NotImplemented
        # has the sign, and knows what there is at zero and below
        ordinary = f.pow(self.value, rounded_number(1.0 * n))
        zero = 1.0 * (self.value == 0.0)
        return (f.copysign(1.0, ordinary) * (1.0 - zero)) * _exp(n * _log(abs(self) + zero)) + zero * ordinary

    def __divmod__(self, other: Any) -> Any:
        return divided(self, other) if _is_operand(other) else NotImplemented

    def __floordiv__(self, other: Any) -> Any:
        return divided(self, other)[0] if _is_operand(other) else NotImplemented

    def __mod__(self, other: Any) -> Any:
        return divided(self, other)[1] if _is_operand(other) else NotImplemented

    __rtruediv__, __rpow__ = _reflected(operator.truediv), _reflected(operator.pow)
    __rfloordiv__, __rmod__ = _reflected(operator.floordiv), _reflected(operator.mod)
    __rdivmod__ = _reflected(divmod)

    def __floor__(self) -> Any:
        return floor(self, math.floor)

    def __ceil__(self) -> Any:
        return -floor(-self, math.floor)

    def __trunc__(self) -> Any:
        return truncated(self, math.floor)

    __int__ = __trunc__

    def __round__(self, *digits: int) -> Any:
        if digits:
            raise TypeError("`round` of a number of two doubles to a number of digits: write round(x * 100.0) / 100.0")
        return nearest(self, math.floor)

    def __neg__(self) -> DoubleDouble:
        return DoubleDouble(-self.value, -self.low)

    def __abs__(self) -> DoubleDouble:
        return self * f.copysign(1.0, self.value)

    def __float__(self) -> float:
        raise CarriesMore("a number of two doubles")

    def __repr__(self) -> str:
        return f"({self.value} + {self.low})"


def _is_operand(x: Any) -> bool:
    """Whether x can be an operand beside a number of two doubles here, and has no rules of its own."""
    return isinstance(x, (int, float, StandIn, DoubleDouble))


def is_long(x: Any) -> bool:
    """Whether a number is a sum of two doubles."""
    return isinstance(x, DoubleDouble)


def rounded_number(x: Any) -> Any:
    """A number rounded to one double."""
    return x.value if isinstance(x, DoubleDouble) else x


def two_sum(a: Any, b: Any) -> tuple[Any, Any]:
    """fl(a + b), and what rounding took from it, exactly.  Source: Knuth, The Art of Computer Programming 2, 4.2.2."""
    total = a + b
    added = total - a
    return total, (a - (total - added)) + (b - added)


def fast_two_sum(a: Any, b: Any) -> tuple[Any, Any]:
    """`two_sum` where |a| is not less than |b|.  Source: Dekker, Numer. Math. 18 (1971), 224."""
    total = a + b
    return total, b - (total - a)


def two_product(a: Any, b: Any) -> tuple[Any, Any]:
    """fl(a b), and what rounding took from it, exactly."""
    product = a * b
    return product, f.fma(a, b, -product)


# ------------------------------------------------------------------ whole numbers


def divided(x: DoubleDouble, y: Any) -> tuple[DoubleDouble, DoubleDouble]:
    """x // y and x % y, with 32 digits of x; the remainder has the sign of y."""
    quotient = _whole((x / y).value)
    remainder = x - DoubleDouble(quotient) * y
    correction = _whole((remainder / y).value)  # 0, unless there were more than 2^51
    remainder = remainder - correction * y
    sign = f.copysign(1.0, rounded_number(1.0 * y))
    below = 1.0 * (sign * remainder.value < 0.0)
    remainder = remainder + below * y
    return DoubleDouble(*two_sum(quotient, correction)) - below, remainder


def floor(x: DoubleDouble, of_double: Any) -> Any:
    """The largest integer not above x, where `of_double` gives that of one double."""
    whole = of_double(x.value)
    return whole + of_double(x.low * (1.0 * (x.value == whole)))


def truncated(x: DoubleDouble, of_double: Any) -> Any:
    """The integer next to x on the side of zero."""
    sign = 1 - 2 * (x.value < 0.0)
    return sign * floor(x * sign, of_double)


def nearest(x: DoubleDouble, of_double: Any) -> Any:
    """The integer next to x; of two the even one."""
    whole = floor(x, of_double)
    excess = x - DoubleDouble(1.0 * whole) - 0.5
    up = (excess.value > 0.0) | ((excess.value == 0.0) & (whole % 2 == 1))
    return whole + 1 * up


# ------------------------------------------------------------------ elementary functions


def quotient(numerator: int, denominator: int) -> tuple[float, float]:
    """A fraction as the two doubles next to it."""
    value = numerator / denominator
    n, d = value.as_integer_ratio()
    return value, (numerator * d - n * denominator) / (denominator * d)


def series(x: Any, coefficients: tuple[tuple[float, float], ...], long: int) -> DoubleDouble:
    """c_0 + c_1 x + c_2 x^2 + ..., of which the first `long` terms feel the low words of x and of
    the coefficients; |c_k+1 x| must be below |c_k|.

    """
    value, low = coefficients[-1][0], 0.0
    for c, _ in coefficients[-2 : long - 1 : -1]:
        value = value * x.value + c
    for words in coefficients[long - 1 :: -1]:
        value, low = _nested(words, x, value, low)
    return DoubleDouble(*fast_two_sum(value, low))


def nested(c: tuple[float, float], x: Any, s: Any) -> DoubleDouble:
    """c + x s, where |x s| is below |c|."""
    return DoubleDouble(*fast_two_sum(*_nested(c, x, s.value, s.low)))


def _nested(c: tuple[float, float], x: Any, value: Any, low: Any) -> tuple[Any, Any]:
    """The words of c + x (value + low).

    They are summed side by side and left as they are: the low one stays within some units in the
    last place of the other.
    """
    product, error = two_product(value, x.value)
    low = f.fma(low, x.value, f.fma(value, x.low, error))
    value, error = fast_two_sum(c[0], product)
    return value, error + (c[1] + low)


SINE = tuple([quotient((-1) ** k, math.factorial(2 * k + 1)) for k in range(15)])
COSINE = tuple([quotient((-1) ** k, math.factorial(2 * k)) for k in range(16)])
EXPONENTIAL = tuple([quotient(1, math.factorial(k + 1)) for k in range(15)])

# Bits of pi/2 and log 2 one after the other; multiples of the words are summed up exactly enough.
HALF_PI = 1.5707963267948966, 6.123233995736766e-17, -1.4973849048591698e-33, 5.562271104316826e-50
LN_2 = 0.6931471805599453, 2.3190468138462996e-17, 5.707708438416212e-34, -3.5824322106018114e-50
SHIFT = 1.5 * 2.0**52

LARGEST_ANGLE = 2.0**60
"""Up to here the words of pi/2 tell how many turns an angle has."""


def _whole(x: Any) -> Any:
    """The whole number next to x; beyond 2^51 one nearby, off by 2^-53 of x at most."""
    shift = f.copysign(SHIFT, x)
    return (x + shift) - shift


def _reduced(x: Any, words: tuple[float, ...]) -> tuple[Any, Any]:
    """The whole k next to x over a constant, and what is left, x - k constant."""
    k = _whole(x.value * (1.0 / words[0]))
    remainder = x
    for word in words:
        remainder = remainder - DoubleDouble(*two_product(k, word))
    return k, remainder


def sin_cos(x: Any) -> tuple[Any, Any]:
    """Sine and cosine, by the distance from the nearest quarter turn; nan beyond LARGEST_ANGLE."""
    quarters, near = _reduced(x, HALF_PI)
    more_quarters, r = _reduced(near, HALF_PI)  # 0 quarters, unless there were more than 2^51
    r = r + f.sqrt(-1.0 * (abs(x.value) > LARGEST_ANGLE))  # the root of -1 is nan
    square = r * r
    s, c = r * series(square, SINE, 8), series(square, COSINE, 8)
    quarter = _modulo_4(_modulo_4(quarters) + more_quarters)
    odd = 1.0 * (abs(quarter) == 1.0)
    back = 1.0 - 2.0 * (abs(quarter) == 2.0)  # half a turn changes both signs
    return (back * (1.0 - odd)) * s + (quarter * odd) * c, (back * (1.0 - odd)) * c - (quarter * odd) * s


def _modulo_4(k: Any) -> Any:
    """A whole number less a multiple of 4 near it, up to 2^53 the next one: -2, -1, 0, 1 or 2."""
    return k - 4.0 * _whole(0.25 * k)


def _powers(x: Any) -> tuple[Any, Any]:
    """2^k and exp(x - k log 2) - 1, from a sixteenth of the exponent."""
    k, r = _reduced(x, LN_2)
    r = 0.0625 * r
    e = r * series(r, EXPONENTIAL, 8)
    for _ in range(4):
        e = 2.0 * e + e * e
    return f.exp2(k), e


def _exp(x: Any) -> Any:
    power, e = _powers(x)
    return power * (e + 1.0)


def _expm1(x: Any) -> Any:
    power, e = _powers(x)
    return power * e + DoubleDouble(*two_sum(power, -1.0))


def _log(x: Any) -> Any:
    below = 1.0 * (x.value < 0.5)  # log(x) = -log(1/x), so that 1 + u is not small
    above = below / x + (1.0 - below) * x
    return (1.0 - 2.0 * below) * _log_of(above - 1.0, f.log(above.value))


def _log1p(x: Any) -> Any:
    return _log_of(x, f.log1p(x.value))


def _log_of(u: Any, guess: Any) -> Any:
    """log(1 + u), from its first 16 digits."""
    e = _expm1(DoubleDouble(guess, 0.0))
    d = (u - e) / (e + 1.0)
    return (d - 0.5 * d * d) + guess


def _sqrt(x: Any) -> Any:
    root = f.sqrt(x.value)
    square, error = two_product(root, root)
    return DoubleDouble(
        *fast_two_sum(root, (((x.value - square) - error) + x.low) / (2.0 * root + 1.0 * (root == 0.0)))
    )


def _cbrt(x: Any) -> Any:
    root = f.cbrt(x.value)
    square = DoubleDouble(*two_product(root, root))
    return (x - square * root) / (3.0 * root * root + 1.0 * (root == 0.0)) + root


def _atan2(y: Any, x: Any) -> Any:
    y, x = (a if isinstance(a, DoubleDouble) else DoubleDouble(1.0 * a, 0.0) for a in (y, x))
    angle = f.atan2(y.value, x.value)
    s, c = sin_cos(DoubleDouble(angle, 0.0))
    along = x * c + y * s
    return (y * c - x * s) / (along + 1.0 * (along.value == 0.0)) + angle


def _sinh(x: Any) -> Any:
    e = _expm1(abs(x))
    return (0.5 * f.copysign(1.0, x.value)) * (e + e / (e + 1.0))


def _cosh(x: Any) -> Any:
    e = _exp(abs(x))
    return 0.5 * (e + 1.0 / e)


def _tanh(x: Any) -> Any:
    e = _expm1(-2.0 * abs(x))
    return -f.copysign(1.0, x.value) * e / (e + 2.0)


def _asinh(x: Any) -> Any:
    size, square = abs(x), x * x
    return f.copysign(1.0, x.value) * _log1p(size + square / (_sqrt(square + 1.0) + 1.0))


def _copysign(x: Any, y: Any) -> Any:
    sign = f.copysign(1.0, rounded_number(y)) * f.copysign(1.0, rounded_number(x))
    return sign * x


_RULES = _sqrt, _cbrt, _atan2, _sinh, _cosh, _tanh, _asinh, _exp, _log, _expm1, _log1p, _copysign

f.DOUBLE_DOUBLE.update({rule.__name__[1:]: rule for rule in _RULES})
f.DOUBLE_DOUBLE.update(
    {
        "sin": lambda x: sin_cos(x)[0],
        "cos": lambda x: sin_cos(x)[1],
        "tan": lambda x: operator.truediv(*sin_cos(x)),
        "atan": lambda x: _atan2(x, 1.0),
        "asin": lambda x: _atan2(x, _sqrt((1.0 - x) * (1.0 + x))),
        "acos": lambda x: _atan2(_sqrt((1.0 - x) * (1.0 + x)), x),
        "acosh": lambda x: _log(x + _sqrt((x - 1.0) * (x + 1.0))),
        "atanh": lambda x: 0.5 * _log1p(2.0 * x / (1.0 - x)),
        "exp2": lambda x: _exp(x * DoubleDouble(*LN_2[:2])),
        "log2": lambda x: _log(x) / DoubleDouble(*LN_2[:2]),
        "log10": lambda x: _log(x) / DoubleDouble(2.302585092994046, -2.1707562233822494e-16),
        "pow": operator.pow,
    }
)
