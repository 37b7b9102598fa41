"""Complex numbers as pairs of numbers: the entries of the matrices of SU(n), in plain Python and in native code alike."""

from __future__ import annotations

from typing import Any

from .functions import sqrt


def is_vector(x: Any) -> bool:
    """A `Vec` or a `Mat`, which know how to multiply themselves by a number."""
    return isinstance(x, tuple) or hasattr(x, "rows")


class Complex:
    """re + i im.  Products are rounded as written here, whatever Python or the processor would do."""

    __slots__ = ("im", "re")

    def __init__(self, re: Any, im: Any = 0.0) -> None:
        self.re, self.im = re, im

    @property
    def parts(self) -> tuple[Any, Any]:
        """The two numbers, as they lie in memory."""
        return self.re, self.im

    def conjugate(self) -> Complex:
        """re - i im."""
        return Complex(self.re, -self.im)

    def __add__(self, other: Any) -> Any:
        if is_vector(other):
            return NotImplemented
        if isinstance(other, Complex):
            return Complex(self.re + other.re, self.im + other.im)
        return Complex(self.re + other, self.im)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        if is_vector(other):
            return NotImplemented
        if isinstance(other, Complex):
            return Complex(self.re - other.re, self.im - other.im)
        return Complex(self.re - other, self.im)

    def __rsub__(self, other: Any) -> Complex:
        return Complex(other - self.re, -self.im)

    def __mul__(self, other: Any) -> Any:
        if is_vector(other):
            return NotImplemented
        if isinstance(other, Complex):
            return Complex(self.re * other.re - self.im * other.im, self.re * other.im + self.im * other.re)
        return Complex(self.re * other, self.im * other)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Any:
        if is_vector(other):
            return NotImplemented
        if isinstance(other, Complex):
            return self * other.conjugate() / (other.re * other.re + other.im * other.im)
        return Complex(self.re / other, self.im / other)

    def __rtruediv__(self, other: Any) -> Complex:
        return Complex(other, 0.0) / self

    def __neg__(self) -> Complex:
        return Complex(-self.re, -self.im)

    def __abs__(self) -> Any:
        return sqrt(self.re * self.re + self.im * self.im)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Complex) and self.parts == other.parts

    def __hash__(self) -> int:
        return hash(self.parts)

    def __complex__(self) -> complex:
        return complex(self.re, self.im)

    def __repr__(self) -> str:
        return f"({self.re} + {self.im}i)"
