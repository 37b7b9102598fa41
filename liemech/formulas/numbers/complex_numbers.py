"""Complex numbers as pairs of numbers: the entries of the matrices of SU(n), in plain Python and in
native code alike.
"""

from __future__ import annotations

from math import inf
from operator import attrgetter
from typing import Any

import numpy as np

from ..functions import sqrt
from .bases import INTEGER_POWER, Pair, StandIn, whole_power


def is_vector(x: Any) -> bool:
    """A `Vec`, a `Mat` or an array, which know how to multiply themselves by a number."""
    return not isinstance(x, _REAL) and (isinstance(x, (tuple, list, np.ndarray)) or hasattr(x, "rows"))


def outranks(x: Any) -> bool:
    """A vector, or a complex number: what a number with a derivative leaves an operation to."""
    return not isinstance(x, _REAL) and (isinstance(x, (Complex, complex)) or is_vector(x))


_REAL = (float, StandIn)


class Complex(Pair):
    """re + i im.  Products are rounded as written here, whatever Python or the processor would do.

    Its parts may carry derivatives or be series; where it meets such a number, that one is real.
    """

    __slots__ = ("im", "re")
    level = inf

    def __init__(self, re: Any, im: Any = 0.0) -> None:
        self.re, self.im = re, im

    parts = property(attrgetter("re", "im"))
    real, imag = property(attrgetter("re")), property(attrgetter("im"))

    def conjugate(self) -> Complex:
        """The complex conjugate, re - i im."""
        return Complex(self.re, -self.im)

    def __add__(self, other: Any) -> Any:
        if isinstance(other, Complex):
            return Complex(self.re + other.re, self.im + other.im)
        if is_vector(other):
            return NotImplemented
        return self + _ours(other) if isinstance(other, complex) else Complex(self.re + other, self.im)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        if isinstance(other, Complex):
            return Complex(self.re - other.re, self.im - other.im)
        if is_vector(other):
            return NotImplemented
        return self - _ours(other) if isinstance(other, complex) else Complex(self.re - other, self.im)

    def __rsub__(self, other: Any) -> Any:
        return -self + other

    def __mul__(self, other: Any) -> Any:
        if isinstance(other, Complex):
            return Complex(self.re * other.re - self.im * other.im, self.re * other.im + self.im * other.re)
        if is_vector(other):
            return NotImplemented
        return self * _ours(other) if isinstance(other, complex) else Complex(self.re * other, self.im * other)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Any:
        if isinstance(other, Complex):
            return self * other.conjugate() / (other.re * other.re + other.im * other.im)
        if is_vector(other):
            return NotImplemented
        return self / _ours(other) if isinstance(other, complex) else Complex(self.re / other, self.im / other)

    def __rtruediv__(self, other: Any) -> Any:
        return NotImplemented if is_vector(other) else _ours(other) / self

    def __pow__(self, n: Any) -> Any:
        if type(n) is not int or abs(n) > INTEGER_POWER:
            raise TypeError(f"a power of a Complex has an int of at most {INTEGER_POWER} as exponent; got {n!r}")
        power = whole_power(self, abs(n)) if n else Complex(1.0, 0.0)
        return power if n >= 0 else 1.0 / power

    def __neg__(self) -> Complex:
        return Complex(-self.re, -self.im)

    def __pos__(self) -> Complex:
        return self

    def __abs__(self) -> Any:
        return sqrt(self.re * self.re + self.im * self.im)

    def __eq__(self, other: object) -> Any:
        other = _ours(other)
        return (self.re == other.re) & (self.im == other.im)

    def __ne__(self, other: object) -> Any:
        other = _ours(other)
        return (self.re != other.re) | (self.im != other.im)

    def __hash__(self) -> int:
        return hash(complex(self))

    def __complex__(self) -> complex:
        return complex(self.re, self.im)

    def __repr__(self) -> str:
        return f"({self.re} + {self.im}i)"


def _ours(x: Any) -> Complex:
    """Any complex or real number as a `Complex`."""
    return x if isinstance(x, Complex) else Complex(x.real, x.imag) if isinstance(x, complex) else Complex(x, 0.0)
