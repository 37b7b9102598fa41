"""Small vectors and matrices: the arithmetic of formulas.

`Vec` and `Mat` are immutable and hold plain floats (or symbols).  The order of every operation is
fixed and written out here, never left to BLAS, so that a formula gives the same bits in plain
Python, in native code and in an ensemble.  Native code knows the operators and keeps components in
registers; the functions at the end are formulas like any other.
"""

from __future__ import annotations

import builtins
import operator
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np

from ..errors import InvalidType
from .complex_numbers import Complex
from .functions import sqrt
from .numbers import Operand, of_an_int

MANY = 1024
"""An array of more numbers is none of a formula, but samples."""

_make, _component_at = tuple.__new__, tuple.__getitem__


def _by_components(op: Callable[[Any, Any], Any], scalars: bool = False) -> Any:
    """An operator of vectors and its reflection; of a vector and a scalar too if `scalars`."""

    def method(self: Vec, other: Any) -> Any:
        if type(other) is not Vec:
            if isinstance(other, np.ndarray) and not other.ndim:
                other = other.item()
            if scalars and not isinstance(other, _VECTORS):
                if not isinstance(other, (Mat, *_NO_NUMBERS)):
                    return _make(Vec, [op(x, other) for x in self])
                if op not in (operator.add, operator.sub):
                    return NotImplemented
            if are_samples(other, 1):
                return op(np.asarray(self), other)
        return _make(Vec, map(op, self, _same_length(self, other)))

    def reflected(self: Vec, other: Any) -> Any:
        if _begins_a_sum(other, op):
            return self
        if scalars and not isinstance(other, (*_VECTORS, Mat, *_NO_NUMBERS)):
            return _make(Vec, [op(other, x) for x in self])
        return _make(Vec, map(op, _same_length(self, other), self))

    return method, reflected


def _begins_a_sum(x: Any, op: Callable[[Any, Any], Any]) -> bool:
    """The 0 from which Python's `sum` starts."""
    return op is operator.add and type(x) is int and x == 0


def are_samples(x: Any, axes: int) -> bool:
    """An array of more axes or numbers than a formula has beside a vector or matrix: NumPy's own."""
    return isinstance(x, np.ndarray) and (x.ndim > axes or x.size > MANY)


class Vec(tuple[Any, ...], Operand):
    """A small vector, `Vec(1.0, 2.0, 3.0)`; `+ - * / % **` act component by component, with
    scalars too.

    Lists, tuples and arrays of the same length may stand beside it.  Raises InvalidType if the
    lengths differ.
    """

    __slots__ = ()
    axes = 1

    def __new__(cls, *components: Any) -> Vec:
        return _make(cls, components)

    @classmethod
    def of(cls, values: Iterable[Any]) -> Vec:
        """The vector with the given components, numbers made floats and pairs of floats."""
        made = tuple(values)
        return _make(cls, made if _FLOATS.issuperset(map(type, made)) else map(_component, made))

    def __getitem__(self, index: Any) -> Any:
        """A component, or the vector of a slice."""
        found = _component_at(self, index)
        return _make(Vec, found) if index.__class__ is slice else found

    __add__, __radd__ = _by_components(operator.add, scalars=True)
    __sub__, __rsub__ = _by_components(operator.sub, scalars=True)
    __mul__, __rmul__ = _by_components(operator.mul, scalars=True)
    __truediv__, __rtruediv__ = _by_components(operator.truediv, scalars=True)
    __pow__, __rpow__ = _by_components(operator.pow, scalars=True)
    __mod__, __rmod__ = _by_components(operator.mod, scalars=True)

    def __neg__(self) -> Vec:
        return _make(Vec, [-x for x in self])

    def __pos__(self) -> Vec:
        return self

    def __abs__(self) -> Vec:
        """|x_1|, |x_2|, ...; the length of a vector is `norm`."""
        return _make(Vec, [abs(x) for x in self])

    def __matmul__(self, other: Any) -> Any:
        if are_samples(other, 2):
            return np.asarray(self) @ other
        other = small(other)
        if isinstance(other, Mat):
            if len(other) != len(self):
                raise InvalidType(
                    f"a Vec of {len(self)} components cannot "
                    f"multiply a matrix of shape {other.shape}"
                )
            return _make(Vec, [_product(self, column) for column in zip(*other.rows, strict=True)])
        return _product(self, _same_length(self, other))

    def __rmatmul__(self, other: Any) -> Any:
        return small(other) @ self

    @property
    def T(self) -> Vec:
        """The vector itself: rows and columns are told apart by where they stand."""
        return self

    @property
    def shape(self) -> tuple[int]:
        return (len(self),)

    def dot(self, other: Any) -> Any:
        """x @ other."""
        return self @ other

    def sum(self) -> Any:
        """x_1 + x_2 + ..., from left to right."""
        return sum(self)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        if _FLOATS.issuperset(map(type, self)):
            return np.array(tuple(self), dtype=dtype)
        array = np.array(tuple(self), dtype=dtype)
        return array.astype(complex) if any(isinstance(x, Complex) for x in self) else array

    def __getnewargs__(self) -> tuple[Any, ...]:
        return tuple(self)

    def __repr__(self) -> str:
        return f"Vec({', '.join(map(str, self))})"


_VECTORS = (np.ndarray, list, tuple)
_NO_NUMBERS = (type(None), str, bytes, dict, set, slice)
_FLOATS = frozenset([float])


def _component(x: Any) -> Any:
    if isinstance(x, (complex, np.complexfloating)):
        return Complex(float(x.real), float(x.imag))
    return float(x) if isinstance(x, (int, np.number)) else of_an_int(x)


def small(x: Any) -> Any:
    """A list, a tuple or an array as a `Vec` or `Mat` with its numbers; anything else is what it
    is.
    """
    if not isinstance(x, _VECTORS) or isinstance(x, Vec):
        return x
    if isinstance(x, np.ndarray) and not x.ndim:
        return x.item()
    return Mat.of(x) if len(x) and isinstance(x[0], _VECTORS) else Vec.of(x)


def _same_length(v: Vec, other: Any) -> Any:
    if type(other) is Vec and len(other) == len(v):
        return other
    other = small(other)
    if isinstance(other, Vec) and len(other) == len(v):
        return other
    kind = (
        f"a vector of {len(other)} components" if isinstance(other, Vec) else type(other).__name__
    )
    raise InvalidType(f"a Vec of {len(v)} components cannot be combined with {kind}")


def _product(a: Iterable[Any], b: Iterable[Any]) -> Any:
    """a_1 b_1 + a_2 b_2 + ..., from left to right."""
    terms = map(operator.mul, a, b)
    total = next(terms)
    for term in terms:
        total = total + term
    return total


class Mat(Operand):
    """A small matrix, `Mat((1.0, 0.0), (0.0, 1.0))` by rows; `@` multiplies, `.T` transposes,
    `A[i, j]` picks an entry.
    """

    __slots__ = ("rows",)
    axes = 2
    rows: tuple[Vec, ...]

    def __init__(self, *rows: Iterable[Any]) -> None:
        made = tuple([row if type(row) is Vec else _make(Vec, row) for row in rows])
        if len(set(map(len, made))) > 1:
            raise InvalidType(
                "the rows of a Mat have the same length; got rows of "
                f"{', '.join([str(len(row)) for row in made])}"
            )
        _set_rows(self, made)

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError("a Mat is immutable")

    def __reduce__(self) -> tuple[Any, ...]:
        return Mat, tuple(tuple(row) for row in self.rows)

    @classmethod
    def of(cls, rows: Iterable[Iterable[Any]]) -> Mat:
        """The matrix with the given rows, numbers made floats."""
        return cls(*map(Vec.of, rows))

    @property
    def shape(self) -> tuple[int, int]:
        return len(self.rows), len(self.rows[0]) if self.rows else 0

    @property
    def T(self) -> Mat:
        return Mat(*zip(*self.rows, strict=True))

    def __len__(self) -> int:
        return len(self.rows)

    def __iter__(self) -> Iterator[Vec]:
        return iter(self.rows)

    def __getitem__(self, index: Any) -> Any:
        """An entry A[i, j], a row A[i], a column A[:, j], a block A[:2, 1:]."""
        if not isinstance(index, tuple):
            return Mat(*self.rows[index]) if index.__class__ is slice else self.rows[index]
        i, j = index
        if i.__class__ is not slice:
            return self.rows[i][j]
        block = [row[j] for row in self.rows[i]]
        return Mat(*block) if j.__class__ is slice else _make(Vec, block)

    def dot(self, other: Any) -> Any:
        """A @ other."""
        return self @ other

    def _by_rows(self, op: Callable[[Any, Any], Any], other: Any) -> Any:
        if are_samples(other, 2):
            return op(np.asarray(self), other)
        other = small(other)
        if isinstance(other, Mat):
            if other.shape != self.shape:
                raise InvalidType(
                    f"matrices of shapes {self.shape} and {other.shape} cannot be combined"
                )
            return Mat(*map(op, self.rows, other.rows))
        if isinstance(other, Vec) and op in (operator.add, operator.sub):
            raise InvalidType(f"a Mat cannot be added to or subtracted from {type(other).__name__}")
        return Mat(*(op(row, other) for row in self.rows))

    def __add__(self, other: Any) -> Mat:
        return self._by_rows(operator.add, other)

    def __radd__(self, other: Any) -> Mat:
        if _begins_a_sum(other, operator.add):
            return self
        return small(other) + self if isinstance(other, _VECTORS) else self + other

    def __sub__(self, other: Any) -> Mat:
        return self._by_rows(operator.sub, other)

    def __rsub__(self, other: Any) -> Mat:
        return -self + other

    def __mul__(self, other: Any) -> Mat:
        return self._by_rows(operator.mul, other)

    def __rmul__(self, other: Any) -> Mat:
        if isinstance(other, _VECTORS):
            return self * other
        return Mat(*(other * row for row in self.rows))

    def __truediv__(self, other: Any) -> Mat:
        return self._by_rows(operator.truediv, other)

    def __rtruediv__(self, other: Any) -> Mat:
        return Mat(*(other / row for row in self.rows))

    def __pow__(self, other: Any) -> Mat:
        """Of every entry; the product of matrices is `A @ A`."""
        return self._by_rows(operator.pow, other)

    def __rpow__(self, other: Any) -> Mat:
        return Mat(*(other**row for row in self.rows))

    def __neg__(self) -> Mat:
        return Mat(*(-row for row in self.rows))

    def __abs__(self) -> Mat:
        return Mat(*map(abs, self.rows))

    def __matmul__(self, other: Any) -> Any:
        if are_samples(other, 2):
            return np.asarray(self) @ other
        other = small(other)
        if not isinstance(other, (Vec, Mat)) or self.shape[1] != len(other):
            kind = (
                f"one with {len(other)} rows"
                if isinstance(other, (Vec, Mat))
                else type(other).__name__
            )
            raise InvalidType(f"a matrix of shape {self.shape} cannot multiply {kind}")
        if isinstance(other, Mat):
            columns = tuple(zip(*other.rows, strict=True))
            return Mat(*([_product(row, column) for column in columns] for row in self.rows))
        return _make(Vec, [_product(row, other) for row in self.rows])

    def __rmatmul__(self, other: Any) -> Any:
        return small(other) @ self

    def __eq__(self, other: object) -> Any:
        return self.rows == other.rows if isinstance(other, Mat) else NotImplemented

    def __hash__(self) -> int:
        return hash(self.rows)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        if all(_FLOATS.issuperset(map(type, row)) for row in self.rows):
            return np.array([tuple(row) for row in self.rows], dtype=dtype)
        return np.array([np.asarray(row, dtype=dtype) for row in self.rows])

    def __repr__(self) -> str:
        return f"Mat({', '.join(repr(tuple(row)) for row in self.rows)})"


_set_rows: Any = Mat.rows.__set__  # type: ignore[attr-defined, misc]


def of_floats(array: np.ndarray) -> Any:
    """An array of float64, (n,) or (m, n), as a vector or matrix; None if an entry, or the sum of
    all, is not finite.
    """
    values = array.tolist()
    many = array.ndim == 2
    total = builtins.sum(map(builtins.sum, values) if many else values)
    if total - total != 0.0:
        return None
    if not many:
        return _make(Vec, values)
    made = object.__new__(Mat)
    _set_rows(made, tuple([_make(Vec, row) for row in values]))
    return made


def vec(*components: Any) -> Vec:
    """Small vector from its components."""
    return Vec(*components)


def mat(*rows: Any) -> Mat:
    """Small matrix from its rows."""
    return Mat(*rows)


# ------------------------------------------------------------------ formulas, in both worlds


def dot(a: Any, b: Any) -> Any:
    """Scalar product a . b.  a, b : (n,).  Raises InvalidType if the lengths differ."""
    if len(a) != len(b):
        raise InvalidType(f"dot: the vectors have {len(a)} and {len(b)} components")
    total: Any = None
    for x, y in zip(a, b):
        total = x * y if total is None else total + x * y
    return 0.0 if total is None else total


def cross(a: Any, b: Any) -> Vec:
    """Vector product a x b in R^3.  a, b : (3,).  Raises InvalidType if they have another length."""
    if len(a) != 3 or len(b) != 3:
        raise InvalidType(f"cross: the vectors have {len(a)} and {len(b)} components, not 3")
    (a1, a2, a3), (b1, b2, b3) = a, b
    return vec(a2 * b3 - a3 * b2, a3 * b1 - a1 * b3, a1 * b2 - a2 * b1)


def sum(terms: Any) -> Any:
    """The sum of numbers, vectors or matrices, added up from left to right; 0.0 of none."""
    total: Any = None
    for x in terms:
        total = x if total is None else total + x
    return 0.0 if total is None else total


def norm(a: Any) -> Any:
    """Euclidean length |a|."""
    return sqrt(dot(a, a))


def horner(terms: Any, x: Any) -> Any:
    """terms_0 + x terms_1 + x^2 terms_2 + ..., of numbers or vectors, by Horner's rule."""
    total = terms[len(terms) - 1]
    for k in range(len(terms) - 2, -1, -1):
        total = terms[k] + x * total
    return total


def outer(a: Any, b: Any) -> Mat:
    """The matrix a b^T.  a : (m,), b : (n,)."""
    return mat(*[vec(*[x * y for y in b]) for x in a])


def transpose(m: Any) -> Any:
    """The transpose of a small matrix."""
    return m.T


def identity_matrix(n: int) -> Mat:
    """The n by n unit matrix."""
    return mat(*[vec(*[1.0 if i == j else 0.0 for j in range(n)]) for i in range(n)])


def diagonal(v: Any) -> Mat:
    """The diagonal matrix with the entries of v."""
    return mat(*[vec(*[v[i] if i == j else 0.0 for j in range(len(v))]) for i in range(len(v))])
