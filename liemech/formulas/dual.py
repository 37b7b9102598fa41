"""Differentiation: numbers that carry a derivative along, so that a formula evaluated with them differentiates itself.

    f(x + e d) = f(x) + e f'(x) d,   e^2 = 0

Exact to rounding, in plain Python and in native code, where unused parts disappear.  Of dual numbers of dual numbers come
second derivatives.

Source: Griewank and Walther, Evaluating Derivatives, 2nd ed., chapter 3 (forward mode).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from . import functions as f
from .complex_numbers import Complex, is_vector
from .numbers import ByValue
from .vectors import Mat, Vec, mat, transpose, vec

INTEGER_POWER = 64
"""Up to here whole powers are products, which are fast and exist where the logarithm does not."""


class Dual(ByValue):
    """value + e slope, e^2 = 0.  Comparisons look at the value.

    The integer 0 as a slope means that there is none: nothing is multiplied by it or added to it.
    """

    __slots__ = ("slope", "value")

    def __init__(self, value: Any, slope: Any) -> None:
        self.value, self.slope = value, slope

    @property
    def parts(self) -> tuple[Any, Any]:
        """The two numbers, as they lie in memory."""
        return self.value, self.slope

    def __add__(self, other: Any) -> Any:
        if is_vector(other):
            return NotImplemented
        if isinstance(other, Dual):
            return Dual(self.value + other.value, _sum(self.slope, other.slope))
        return Dual(self.value + other, self.slope)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        if is_vector(other):
            return NotImplemented
        if isinstance(other, Dual):
            return Dual(self.value - other.value, _sum(self.slope, -other.slope))
        return Dual(self.value - other, self.slope)

    def __rsub__(self, other: Any) -> Dual:
        return Dual(other - self.value, -self.slope)

    def __mul__(self, other: Any) -> Any:
        if is_vector(other):
            return NotImplemented
        if isinstance(other, Dual):
            return Dual(self.value * other.value, _sum(_scaled(self.value, other.slope), _scaled(other.value, self.slope)))
        return Dual(self.value * other, _scaled(other, self.slope))

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Any:
        if is_vector(other):
            return NotImplemented
        if isinstance(other, Dual):
            quotient = self.value / other.value
            return Dual(quotient, _over(_sum(self.slope, -_scaled(quotient, other.slope)), other.value))
        return Dual(self.value / other, _over(self.slope, other))

    def __rtruediv__(self, other: Any) -> Dual:
        quotient = other / self.value
        return Dual(quotient, _scaled(-(quotient / self.value), self.slope))

    def __pow__(self, n: Any) -> Any:
        if isinstance(n, (int, float)) and n == int(n) and 1 <= abs(n) <= INTEGER_POWER:
            power = whole_power(self, abs(int(n)))
            return power if n > 0 else 1.0 / power
        return Dual(self.value**n, _scaled(n * self.value ** (n - 1), self.slope))

    def __neg__(self) -> Dual:
        return Dual(-self.value, -self.slope)

    def __pos__(self) -> Dual:
        return self

    def __abs__(self) -> Dual:
        sign = 1.0 * (self.value >= 0.0) - 1.0 * (self.value < 0.0)
        return Dual(abs(self.value), _scaled(sign, self.slope))

    def __repr__(self) -> str:
        return f"({self.value} + e {self.slope})"


def whole_power(x: Any, n: int) -> Any:
    """x^n by squares and products, n = 1, 2, ..."""
    if n == 1:
        return x
    half = whole_power(x, n // 2)
    return half * half * x if n % 2 else half * half


def _sum(a: Any, b: Any) -> Any:
    """The sum of two slopes."""
    return b if type(a) is int else a if type(b) is int else a + b


def _scaled(k: Any, slope: Any) -> Any:
    """k times a slope."""
    return slope if type(slope) is int else k * slope


def _over(slope: Any, k: Any) -> Any:
    """A slope over k."""
    return slope if type(slope) is int else slope / k


def value_of(x: Any) -> Any:
    """A number without its derivative."""
    return x.value if isinstance(x, Dual) else x


def slope_of(x: Any) -> Any:
    """The derivative that a number carries; zero if it carries none."""
    return x.slope if isinstance(x, Dual) and type(x.slope) is not int else 0.0


# ------------------------------------------------------------------ elementary functions: f(x + e d) = f(x) + e f'(x) d


def _sqrt(x: Any) -> Dual:
    root = f.sqrt(x.value)
    return Dual(root, _over(x.slope, 2.0 * root))


def _sin(x: Any) -> Dual:
    return Dual(f.sin(x.value), _scaled(f.cos(x.value), x.slope))


def _cos(x: Any) -> Dual:
    return Dual(f.cos(x.value), _scaled(-f.sin(x.value), x.slope))


def _tan(x: Any) -> Dual:
    t = f.tan(x.value)
    return Dual(t, _scaled(1.0 + t * t, x.slope))


def _asin(x: Any) -> Dual:
    return Dual(f.asin(x.value), _over(x.slope, f.sqrt(1.0 - x.value * x.value)))


def _acos(x: Any) -> Dual:
    return Dual(f.acos(x.value), _over(-x.slope, f.sqrt(1.0 - x.value * x.value)))


def _atan(x: Any) -> Dual:
    return Dual(f.atan(x.value), _over(x.slope, 1.0 + x.value * x.value))


def _atan2(y: Any, x: Any) -> Dual:
    a, b = value_of(y), value_of(x)
    return Dual(f.atan2(a, b), (b * slope_of(y) - a * slope_of(x)) / (a * a + b * b))


def _sinh(x: Any) -> Dual:
    return Dual(f.sinh(x.value), _scaled(f.cosh(x.value), x.slope))


def _cosh(x: Any) -> Dual:
    return Dual(f.cosh(x.value), _scaled(f.sinh(x.value), x.slope))


def _tanh(x: Any) -> Dual:
    t = f.tanh(x.value)
    return Dual(t, _scaled(1.0 - t * t, x.slope))


def _exp(x: Any) -> Dual:
    value = f.exp(x.value)
    return Dual(value, _scaled(value, x.slope))


def _log(x: Any) -> Dual:
    return Dual(f.log(x.value), _over(x.slope, x.value))


def _expm1(x: Any) -> Dual:
    return Dual(f.expm1(x.value), _scaled(f.exp(x.value), x.slope))


def _log1p(x: Any) -> Dual:
    return Dual(f.log1p(x.value), _over(x.slope, 1.0 + x.value))


_RULES = (_sqrt, _sin, _cos, _tan, _asin, _acos, _atan, _atan2, _sinh, _cosh, _tanh, _exp, _log, _expm1, _log1p)
f.RULES.update({rule.__name__[1:]: rule for rule in _RULES})


# ------------------------------------------------------------------ derivatives of formulas


def derivative(formula: Callable[[Any], Any], x: Any, direction: Any) -> Any:
    """f'(x) d: the derivative of a formula of one vector in a direction; it may return a number, a vector or a matrix.

    x, direction : (n,).
    """
    return slopes(formula(vec(*[Dual(a, d) for a, d in zip(x, direction)])))


def gradient(formula: Callable[[Any], Any], x: Any) -> Vec:
    """The vector df/dx_j of a formula from vectors to numbers.  x : (n,)."""
    return vec(*[slopes(formula(_along(x, j))) for j in range(len(x))])


def jacobian(formula: Callable[[Any], Any], x: Any) -> Mat:
    """The matrix df_i/dx_j of a formula from vectors to vectors.  x : (n,)."""
    return transpose(mat(*[slopes(formula(_along(x, j))) for j in range(len(x))]))


def _along(x: Any, j: int) -> Vec:
    """x with its component j on the move."""
    return vec(*[Dual(x[i], 1.0 if i == j else 0) for i in range(len(x))])


def size_of(x: Any) -> Any:
    """|x|, and of a number that carries a derivative that of both: zero only if both are."""
    return size_of(x.value) + size_of(slope_of(x)) if isinstance(x, Dual) else abs(x)


def slopes(value: Any) -> Any:
    """The derivatives that a number, a vector or a matrix carries."""
    if isinstance(value, Mat):
        return mat(*[slopes(row) for row in value])
    if isinstance(value, Vec):
        return vec(*[slopes(x) for x in value])
    if isinstance(value, Complex):
        return Complex(slope_of(value.re), slope_of(value.im))
    return slope_of(value)
