"""Vectors and matrices that are too large to be written out number by number: they lie in memory.

Products of matrices and linear equations are BLAS's and LAPACK's, as SciPy brings them; everything
else goes number by number, in loops.  Sums have one order: sixteen interleaved ones, then halves of
them.  So plain Python, which lets NumPy do the loops, and native code give the same bits, on one
machine and with one library.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

import numpy as np

from ..errors import InvalidType
from . import blas
from .numbers.bases import InMemory, StandIn
from .numbers.complex_numbers import Complex
from .sums import halves
from .vectors import Mat, Vec

TOGETHER = 16
"""Sums are this many interleaved ones."""


def _operator(op: Callable[[Any, Any], Any]) -> Any:
    """An operator, number by number, and its reflection."""
    return lambda self, other: self._by_numbers(op, self, other), lambda self, other: self._by_numbers(op, other, self)


class Large(InMemory):
    """A vector (k,) or a matrix (m, n), real or complex, in memory; `+ - * /` act number by number,
    with real numbers too, `@` multiplies matrices.

    numbers : float64, of a complex matrix with a last axis for real and imaginary part; None in
    native code, which knows the place.
    """

    __slots__ = ("is_complex", "numbers", "place", "shape")

    def __init__(self, array: Any) -> None:
        array = np.asarray(array)
        self.is_complex = array.dtype.kind == "c"
        entries = np.array(array, dtype=complex if self.is_complex else float, order="C")
        self.shape: tuple[int, ...] = entries.shape
        self.numbers: Any = entries.view(float).reshape(_inside(entries.shape, self.is_complex))
        self.place: Any = None

    @staticmethod
    def of_numbers(numbers: np.ndarray, is_complex: bool) -> Large:
        """The vector or matrix of these numbers, which nobody else changes."""
        large = object.__new__(Large)
        large.numbers, large.is_complex, large.place = numbers, is_complex, None
        large.shape = numbers.shape[:-1] if is_complex else numbers.shape
        return large

    @staticmethod
    def at(place: Any, form: tuple[Any, ...]) -> Large:
        """The vector or matrix of this form that lies at a place, in native code."""
        large = object.__new__(Large)
        (large.shape, large.is_complex), large.place, large.numbers = form, place, None
        return large

    # ---------------------------------------------------------------- its form

    @property
    def form(self) -> tuple[Any, ...]:
        """The shape, and whether it is complex: what layouts and native code know of it."""
        return self.shape, self.is_complex

    @property
    def size(self) -> int:
        """The count of real numbers, two for a complex entry."""
        return size_of(self.form)

    @property
    def axes(self) -> int:  # type: ignore[override]
        return len(self.shape)

    def __len__(self) -> int:
        return self.shape[0]

    @property
    def flat(self) -> list[float]:
        """The real numbers of all entries, in a row."""
        return self.numbers.ravel().tolist()

    @property
    def array(self) -> np.ndarray:
        """The entries as an array of NumPy's, real or complex."""
        if self.numbers is None:
            raise InvalidType("an array of numbers that are known at run time only")
        if self.is_complex:
            return np.asarray(self.numbers.view(complex)[..., 0])
        return np.asarray(self.numbers)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        if self.is_complex and dtype is not None and np.dtype(dtype).kind != "c":
            raise TypeError(f"{self!r} is not real")
        return np.array(self.array, dtype=dtype)

    def __iter__(self) -> Any:
        return iter(Vec.of(self.array.tolist()) if len(self.shape) == 1 else self.array.tolist())

    def __getitem__(self, index: Any) -> Any:
        if self.numbers is None:
            return self._engine.entry(self, index)
        entries = self.array[index]
        return entries.item() if np.ndim(entries) == 0 else Large(entries)

    @property
    def content(self) -> Any:
        """The form and bytes, by which vectors and matrices are compared; None in native code."""
        return None if self.numbers is None else (self.form, self.numbers.tobytes())

    def __eq__(self, other: object) -> Any:
        return (
            isinstance(other, Large) and self.form == other.form and self.numbers.tobytes() == other.numbers.tobytes()
        )

    def __hash__(self) -> int:
        return hash((self.form, self.numbers.tobytes()))

    def __reduce__(self) -> tuple[Any, ...]:
        return Large, (np.array(self.array),)

    def __repr__(self) -> str:
        kind = "complex " if self.is_complex else ""
        return f"Large({kind}{' x '.join(map(str, self.shape))})"

    @property
    def _engine(self) -> Any:
        """The `LargeArrays` of the translation that the place belongs to."""
        return self.place.emitter.large

    # ---------------------------------------------------------------- arithmetic

    def _by_numbers(self, op: Callable[[Any, Any], Any], a: Any, b: Any) -> Any:
        """An operator, number by number, of two alike, or of one and a real number."""
        engine = None
        for x in (a, b):
            if isinstance(x, Large):
                if x.form != self.form:
                    raise InvalidType(f"{self!r} cannot be combined with {x!r}")
                engine = x._engine if x.numbers is None else engine
            elif isinstance(x, StandIn):
                engine = x.emitter.large  # type: ignore[attr-defined]
            elif isinstance(x, InMemory) or (not isinstance(x, (int, float)) and getattr(x, "shape", ()) != self.shape):
                return NotImplemented
        if engine is not None:
            return engine.by_numbers(op, a, b)
        left, right = (
            x if isinstance(x, (int, float)) else x.numbers if isinstance(x, Large) else Large(x).numbers
            for x in (a, b)
        )  # fmt: skip
        with np.errstate(all="ignore"):
            return Large.of_numbers(op(left, right), self.is_complex)

    __add__ = _operator(operator.add)[0]
    __sub__, __rsub__ = _operator(operator.sub)
    __mul__, __rmul__ = _operator(operator.mul)
    __truediv__, __rtruediv__ = _operator(operator.truediv)

    def __radd__(self, other: Any) -> Any:
        return self if type(other) is int and other == 0 else self._by_numbers(operator.add, other, self)

    def __neg__(self) -> Large:
        return self._by_numbers(operator.mul, -1.0, self)

    def __pos__(self) -> Large:
        return self

    def __abs__(self) -> Large:
        if self.numbers is None:
            return self._engine.absolute(self)
        return Large.of_numbers(np.abs(self.numbers), self.is_complex)

    def __bool__(self) -> bool:
        raise InvalidType(f"{self!r} is neither true nor false")

    def __rmatmul__(self, other: Any) -> Any:
        return Large(other) @ self

    def inner_with(self, other: Any) -> Any:
        return inner(self, other)

    # ---------------------------------------------------------------- matrices

    def __matmul__(self, other: Any) -> Any:
        if isinstance(other, (Vec, Mat, np.ndarray)) and self.numbers is not None:
            other = Large(other)
        if not isinstance(other, Large):
            return NotImplemented
        if self.axes == 2 and other.axes == 1:  # a matrix of one column
            return (self @ other.reshaped((len(other), 1))).reshaped((len(self),))
        if len(self.shape) + len(other.shape) != 4 or self.shape[1] != other.shape[0]:
            raise InvalidType(f"{self!r} cannot multiply {other!r}")
        if self.is_complex != other.is_complex:
            raise InvalidType(f"{self!r} cannot multiply {other!r}: one is real, one complex")
        if self.numbers is None or other.numbers is None:
            return (self if self.numbers is None else other)._engine.product(self, other)
        return Large.of_numbers(blas.product(self.numbers, other.numbers, self.is_complex), self.is_complex)

    @property
    def T(self) -> Large:
        return self._turned(False)

    @property
    def H(self) -> Large:
        return self._turned(True)

    def _turned(self, conjugate: bool) -> Large:
        if len(self.shape) == 1:
            return self
        if self.numbers is None:
            return self._engine.turned(self, conjugate and self.is_complex)
        transposed = np.ascontiguousarray(self.numbers.swapaxes(0, 1))
        if self.is_complex and conjugate:
            transposed[..., 1] = -transposed[..., 1]
        return Large.of_numbers(transposed, self.is_complex)

    def without_adjoint(self) -> Large:
        """The difference A - A^H, in new memory."""
        if self.numbers is None:
            return self._engine.without_adjoint(self)
        turned = self.H
        return Large.of_numbers(self.numbers - turned.numbers, self.is_complex)

    def reshaped(self, shape: tuple[int, ...]) -> Large:
        """The numbers of this vector or matrix in another shape."""
        if self.numbers is None:
            return Large.at(self.place, (shape, self.is_complex))
        return Large.of_numbers(self.numbers.reshape(_inside(shape, self.is_complex)), self.is_complex)

    def plus(self, s: float) -> Large:
        """The sum A + s 1, in new memory."""
        if self.numbers is None:
            return self._engine.plus(self, s)
        numbers = self.numbers.copy()
        diagonal = np.arange(len(self))
        numbers[(diagonal, diagonal, 0) if self.is_complex else (diagonal, diagonal)] += s
        return Large.of_numbers(numbers, self.is_complex)

    def determinant(self) -> Any:
        """det A, by Gaussian elimination with pivots."""
        if self.numbers is None:
            return self._engine.determinant(self)
        re_and_im = blas.determinant(self.numbers, self.is_complex)
        return Complex(*re_and_im) if self.is_complex else re_and_im[0]

    def over(self, a: Large) -> Large:
        """B A^-1, by Gaussian elimination with pivots; nan if A is singular."""
        if self.numbers is None or a.numbers is None:
            return (self if self.numbers is None else a)._engine.over(self, a)
        return Large.of_numbers(blas.over(self.numbers, a.numbers, self.is_complex), self.is_complex)


def _inside(shape: tuple[int, ...], is_complex: bool) -> tuple[int, ...]:
    """The shape of the real numbers."""
    return (*shape, 2) if is_complex else shape


def size_of(form: tuple[Any, ...]) -> int:
    """The count of real numbers of a form, two for a complex entry."""
    shape, is_complex = form
    size = 2 if is_complex else 1
    for n in shape:
        size *= n
    return size


def from_numbers(form: tuple[Any, ...], numbers: Any) -> Large:
    """The vector or matrix of this form with these real numbers in a row."""
    return Large.of_numbers(np.array(numbers, dtype=float).reshape(_inside(*form)), form[1])


def inner(a: Any, b: Any) -> Any:
    """The sum of the products of the real numbers of two vectors or matrices: of matrices the real
    part of tr(A^H B).
    """
    a, b = (x if isinstance(x, Large) else Large(x) for x in (a, b))
    if a.form != b.form:
        raise InvalidType(f"dot: of {a!r} and {b!r}")
    for x in (a, b):
        if x.numbers is None:
            return x._engine.inner(a, b)
    with np.errstate(all="ignore"):
        return total((a.numbers * b.numbers).ravel())


def distance2(a: Large, b: Large) -> Any:
    """The sum of the squared differences of the real numbers of two vectors or matrices."""
    for x in (a, b):
        if x.numbers is None:
            return x._engine.distance2(a, b)
    with np.errstate(all="ignore"):
        difference = (a.numbers - b.numbers).ravel()
        return total(difference * difference)


def total(numbers: np.ndarray) -> float:
    """The sum of numbers: sixteen interleaved ones, then halves of them, then what is left over."""
    whole = len(numbers) // TOGETHER * TOGETHER
    sum_ = 0.0
    with np.errstate(all="ignore"):
        if whole:
            sum_ = halves(numbers[:whole].reshape(-1, TOGETHER).sum(axis=0).tolist())
    for x in numbers[whole:].tolist():
        sum_ = sum_ + x
    return sum_


def sum_of(a: Large) -> Any:
    """The sum of the real numbers of a vector or matrix."""
    return total(a.numbers.ravel()) if a.numbers is not None else a._engine.sum(a)
