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
from .functions import sqrt
from .numbers.bases import InMemory, Operand, StandIn, of_an_int
from .numbers.complex_numbers import Complex

MANY = 1024
"""An array of more numbers is none of a formula, but samples."""

_make, _component_at = tuple.__new__, tuple.__getitem__


def _by_components(op: Callable[[Any, Any], Any], scalars: bool = False) -> Any:
    """An operator of vectors and its reflection; of a vector and a scalar too if `scalars`."""

    def method(self: Vec, other: Any) -> Any:
        if type(other) is not Vec:
            if scalars and type(other) is float:
                return _make(Vec, [op(x, other) for x in self])
            if isinstance(other, InMemory):
                return NotImplemented
            if isinstance(other, np.ndarray) and not other.ndim:
                other = other.item()
            if scalars and not isinstance(other, _VECTORS):
                if not isinstance(other, _NO_NUMBERS):
                    return _make(Vec, [op(x, other) for x in self])
                if isinstance(other, Mat) and op not in (operator.add, operator.sub):
                    return NotImplemented
            if are_samples(other, 1):
                return op(np.asarray(self), other)
        return _make(Vec, map(op, self, _same_length(self, other)))

    def reflected(self: Vec, other: Any) -> Any:
        if scalars and type(other) is float:
            return _make(Vec, [op(other, x) for x in self])
        if _begins_a_sum(other, op):
            return self
        if scalars and not isinstance(other, (*_VECTORS, *_NO_NUMBERS)):
            return _make(Vec, [op(other, x) for x in self])
        return _make(Vec, map(op, _same_length(self, other), self))

    return method, reflected


def _comparison(op: Callable[[Any, Any], Any], whole: bool = False) -> Any:
    """A comparison, component by component, as of arrays; `whole`: vectors of different lengths are different."""

    def method(self: Vec, other: Any) -> Any:
        kind = _WHOLE.get(op, Truths)
        if type(other) is Vec and len(other) == len(self):
            return _make(kind, map(op, self, other))
        if isinstance(other, np.ndarray) and not other.ndim:
            other = other.item()
        if not isinstance(other, _VECTORS):
            if isinstance(other, Mat) or not isinstance(other, _NUMBERS):
                return NotImplemented
            return _make(Truths, [op(x, other) for x in self])
        if are_samples(other, 1):
            return op(np.asarray(self), other)
        other = small(other)
        if whole and not (isinstance(other, Vec) and len(other) == len(self)):
            return NotImplemented
        return _make(kind, map(op, self, _same_length(self, other)))

    return method


def _begins_a_sum(x: Any, op: Callable[[Any, Any], Any]) -> bool:
    """The 0 from which Python's `sum` starts."""
    return op is operator.add and type(x) is int and x == 0


def are_samples(x: Any, axes: int) -> bool:
    """An array of more axes or numbers than a formula has beside a vector or matrix: NumPy's own."""
    return isinstance(x, np.ndarray) and (x.ndim > axes or x.size > MANY)


class Vec(tuple[Any, ...], Operand):
    """A small vector, `Vec(1.0, 2.0, 3.0)`; `+ - * / % **` act component by component, with
    scalars too.

    Lists, tuples and arrays of the same length may stand beside it.  Comparisons act component by
    component too; `if u == v` asks for all.  Raises InvalidType if the lengths differ, if a
    component is no number, and where the truth of a vector is asked for.
    """

    __slots__ = ()
    axes = 1

    def __new__(cls, *components: Any) -> Vec:
        if not _FLOATS.issuperset(map(type, components)):
            _numbers(components)
        return _make(cls, components)

    @classmethod
    def of(cls, values: Iterable[Any]) -> Vec:
        """The vector with the given components, numbers made floats and pairs of floats."""
        components = tuple(values)
        if _FLOATS.issuperset(map(type, components)):
            return _make(cls, components)
        _numbers(components)
        return _make(cls, map(_component, components))

    def __getitem__(self, index: Any) -> Any:
        """A component, or the vector of a slice."""
        if index.__class__ is bool:
            raise InvalidType("a truth value as an index of a Vec: write int(x)")
        part = _component_at(self, index)
        return _make(Vec, part) if index.__class__ is slice else part

    __add__, __radd__ = _by_components(operator.add, scalars=True)
    __sub__, __rsub__ = _by_components(operator.sub, scalars=True)
    __mul__, __rmul__ = _by_components(operator.mul, scalars=True)
    __truediv__, __rtruediv__ = _by_components(operator.truediv, scalars=True)
    __pow__, __rpow__ = _by_components(operator.pow, scalars=True)
    __mod__, __rmod__ = _by_components(operator.mod, scalars=True)
    __lt__, __le__ = _comparison(operator.lt), _comparison(operator.le)
    __gt__, __ge__ = _comparison(operator.gt), _comparison(operator.ge)
    __eq__, __ne__ = _comparison(operator.eq, whole=True), _comparison(operator.ne, whole=True)
    __hash__ = tuple.__hash__

    def __contains__(self, x: Any) -> bool:
        if isinstance(x, _NESTED):
            raise InvalidType(f"`in` a Vec, which holds numbers, of {type(x).__name__}")
        return any(x == y for y in self)

    def __bool__(self) -> bool:
        raise InvalidType(f"{_NO_TRUTH}; got a {type(self).__name__} of {len(self)} components")

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
                raise InvalidType(f"a Vec of {len(self)} components cannot multiply a matrix of shape {other.shape}")
            return _make(Vec, [_product(self, column) for column in zip(*other.rows, strict=True)])
        return _product(self, _same_length(self, other))

    def __rmatmul__(self, other: Any) -> Any:
        return _factor(other, self) @ self

    @property
    def T(self) -> Vec:
        """The vector itself: rows and columns are told apart by where they stand."""
        return self

    @property
    def shape(self) -> tuple[int]:
        return (len(self),)

    def dot(self, other: Any) -> Any:
        """The product x @ other, as NumPy has it."""
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
        return f"Vec({few(map(str, self), 12)})"


class Truths(Vec):
    """The truths of a comparison, one for each component.  They count as 1 and 0 beside numbers;
    `&` and `|` join those of two comparisons, which `+` and `-` would not do.
    """

    __slots__ = ()
    __and__, __rand__ = _by_components(operator.and_)
    __or__, __ror__ = _by_components(operator.or_)

    def __add__(self, other: Any) -> Any:
        return _beside_numbers(other) and super().__add__(other)

    def __sub__(self, other: Any) -> Any:
        return _beside_numbers(other) and super().__sub__(other)

    def __neg__(self) -> Vec:
        raise InvalidType("the truths of a comparison have no negative: write 1.0 - (u < v)")

    def any(self) -> Any:
        """Whether the comparison holds for a component."""
        return any(self)

    def all(self) -> Any:
        """Whether the comparison holds for all components."""
        return all(self)


class EqualComponents(Truths):
    """Whether u == v, component by component; true if all are equal."""

    __slots__ = ()

    def __bool__(self) -> bool:
        return all(self)


class UnequalComponents(Truths):
    """u != v, component by component; true if one differs."""

    __slots__ = ()

    def __bool__(self) -> bool:
        return any(self)


class Entries:
    """The truths of a comparison of matrices, one for each entry; true as one of vectors is."""

    __hash__ = None  # type: ignore[assignment]
    axes = 2

    def __init__(self, rows: Iterable[Any], kind: type[Vec]) -> None:
        self.rows = tuple(rows)
        self.together = _make(kind, [x for row in self.rows for x in row])

    def __bool__(self) -> bool:
        return bool(self.together)

    def __eq__(self, other: object) -> bool:
        raise InvalidType("comparisons of matrices are not compared: write .all() or .any()")

    def any(self) -> Any:
        """Whether the comparison holds for an entry."""
        return any(self.together)

    def all(self) -> Any:
        """Whether the comparison holds for all entries."""
        return all(self.together)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return np.array(list(map(tuple, self.rows)), dtype=dtype)

    def __repr__(self) -> str:
        return f"Entries({', '.join(map(str, map(tuple, self.rows)))})"


def few(texts: Iterable[str], most: int) -> str:
    """Texts with commas between them; of more than `most` the first three, the last, and how many."""
    items = list(texts)
    if len(items) <= most:
        return ", ".join(items)
    return f"{', '.join(items[:3])}, ..., {items[-1]}; {len(items)} in all"


def _beside_numbers(other: Any) -> bool:
    """The truths of two comparisons are neither added nor subtracted."""
    if isinstance(other, Truths) or (isinstance(other, np.ndarray) and other.dtype == bool):
        raise InvalidType("truths of comparisons are joined by `&` and `|`, not by `+` and `-`")
    return True


_WHOLE: dict[Any, type[Vec]] = {operator.eq: EqualComponents, operator.ne: UnequalComponents}
_VECTORS = (np.ndarray, list, tuple)
_NUMBERS = (int, float, complex, np.generic, StandIn, Operand)
_FLOATS = frozenset([float])
_NO_TRUTH = "a vector or matrix is neither true nor false: write any(...), all(...) or len(...), or compare one number"


def _numbers(components: Iterable[Any]) -> None:
    """Raise InvalidType if a component is a vector or a matrix itself, or no number at all."""
    for x in components:
        if isinstance(x, np.ndarray) and x.ndim:
            raise InvalidType("a NumPy array where a number belongs, write liemech.vec")
        if isinstance(x, _NESTED) and not isinstance(x, np.ndarray):
            raise InvalidType(
                f"a Vec holds numbers; got {type(x).__name__} among them: liemech.mat(u, v) is the "
                "matrix with rows u, v, liemech.vec(*u, *v) has them one after the other"
            )
        if isinstance(x, _NO_NUMBERS):
            raise InvalidType(
                f"a Vec holds numbers; got {x!r} among them: numbers in a string are float(x), what "
                "may be missing is a field of its own, `lm.Vec | None`"
            )


def _factor(x: Any, beside: Any) -> Any:
    """A vector or matrix to stand before `@`."""
    x = small(x)
    if not isinstance(x, (Vec, Mat)):
        raise InvalidType(f"`@` between {type(x).__name__} and {type(beside).__name__}: write `*`")
    return x


def _component(x: Any) -> Any:
    if isinstance(x, (complex, np.complexfloating)):
        return Complex(float(x.real), float(x.imag))
    return float(x) if isinstance(x, (int, np.number)) else of_an_int(x)


def small(x: Any) -> Any:
    """A list, a tuple or an array as a `Vec` or `Mat` with its numbers, a float of NumPy's as one
    of Python's; anything else is what it is.
    """
    if not isinstance(x, _VECTORS) or isinstance(x, Vec):
        return x.item() if isinstance(x, np.floating) else x
    if isinstance(x, np.ndarray):
        if not x.ndim:
            return x.item()
        x = x if x.dtype.kind == "b" else x.tolist()
    return Mat.of(x) if len(x) and isinstance(x[0], _VECTORS) else Vec.of(x)


def _same_length(v: Vec, other: Any) -> Any:
    if type(other) is Vec and len(other) == len(v):
        return other
    other = small(other)
    if isinstance(other, Vec) and len(other) == len(v):
        return other
    kind = f"a vector of {len(other)} components" if isinstance(other, Vec) else type(other).__name__
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
        vectors = tuple([row if type(row) is Vec else Vec(*row) for row in rows])
        if len(set(map(len, vectors))) > 1:
            raise InvalidType(
                f"the rows of a Mat have the same length; got rows of {', '.join([str(len(row)) for row in vectors])}"
            )
        _set_rows(self, vectors)

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
        if index.__class__ is bool:
            raise InvalidType("a truth value as an index of a Mat: write int(x)")
        if not isinstance(index, tuple):
            return Mat(*self.rows[index]) if index.__class__ is slice else self.rows[index]
        if len(index) != 2:
            raise InvalidType(f"a Mat has two axes; got {len(index)} indices")
        i, j = index
        if i.__class__ is not slice:
            return self.rows[i][j]
        block = [row[j] for row in self.rows[i]]
        return Mat(*block) if j.__class__ is slice else _make(Vec, block)

    def dot(self, other: Any) -> Any:
        """The product A @ other, as NumPy has it."""
        return self @ other

    def _by_rows(self, op: Callable[[Any, Any], Any], other: Any) -> Any:
        if isinstance(other, InMemory):
            return NotImplemented
        if are_samples(other, 2):
            return op(np.asarray(self), other)
        other = small(other)
        if isinstance(other, Mat):
            if other.shape != self.shape:
                raise InvalidType(f"matrices of shapes {self.shape} and {other.shape} cannot be combined")
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
        """Powers of all entries; the product of matrices is `A @ A`."""
        return self._by_rows(operator.pow, other)

    def __rpow__(self, other: Any) -> Mat:
        return Mat(*(other**row for row in self.rows))

    def __neg__(self) -> Mat:
        return Mat(*(-row for row in self.rows))

    def __abs__(self) -> Mat:
        return Mat(*map(abs, self.rows))

    def __matmul__(self, other: Any) -> Any:
        if isinstance(other, InMemory):
            return NotImplemented
        if are_samples(other, 2):
            return np.asarray(self) @ other
        other = small(other)
        if not isinstance(other, (Vec, Mat)) or self.shape[1] != len(other):
            kind = f"one with {len(other)} rows" if isinstance(other, (Vec, Mat)) else type(other).__name__
            raise InvalidType(f"a matrix of shape {self.shape} cannot multiply {kind}")
        if isinstance(other, Mat):
            columns = tuple(zip(*other.rows, strict=True))
            return Mat(*([_product(row, column) for column in columns] for row in self.rows))
        return _make(Vec, [_product(row, other) for row in self.rows])

    def __rmatmul__(self, other: Any) -> Any:
        return _factor(other, self) @ self

    def __eq__(self, other: object) -> Any:
        return self._compared(operator.eq, other)

    def __ne__(self, other: object) -> Any:
        return self._compared(operator.ne, other)

    def _compared(self, op: Callable[[Any, Any], Any], other: Any) -> Any:
        """Entry by entry, as of arrays; matrices of different shapes are different."""
        if isinstance(other, np.ndarray) and other.ndim:
            return op(np.asarray(self), other)
        other = small(other)
        if isinstance(other, Mat) and other.shape == self.shape:
            return Entries(map(op, self.rows, other.rows), _WHOLE[op])
        if isinstance(other, (Vec, Mat)) or not isinstance(other, _NUMBERS):
            return NotImplemented
        return Entries([op(row, other) for row in self.rows], Truths)

    def __bool__(self) -> bool:
        raise InvalidType(f"{_NO_TRUTH}; got a Mat of shape {self.shape}")

    def __contains__(self, x: Any) -> bool:
        raise InvalidType("`in` a Mat: write `any(x in row for row in A)` of a number")

    def __hash__(self) -> int:
        return hash(self.rows)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        if all(_FLOATS.issuperset(map(type, row)) for row in self.rows):
            return np.array([tuple(row) for row in self.rows], dtype=dtype)
        return np.array([np.asarray(row, dtype=dtype) for row in self.rows])

    def __repr__(self) -> str:
        return f"Mat({few((repr(tuple(row)) for row in self.rows), 6)})"


_NESTED = (*_VECTORS, Mat)
_NO_NUMBERS = (Mat, type(None), str, bytes, dict, set, slice, type)
_set_rows: Any = Mat.rows.__set__  # type: ignore[attr-defined, misc]


def of_floats(array: np.ndarray) -> Any:
    """An array of float64, (n,) or (m, n), as a vector or matrix; None if an entry, or the sum of
    all, is not finite.
    """
    values = array.tolist()
    is_matrix = array.ndim == 2
    total = builtins.sum(map(builtins.sum, values) if is_matrix else values)
    if total - total != 0.0:
        return None
    if not is_matrix:
        return _make(Vec, values)
    matrix = object.__new__(Mat)
    _set_rows(matrix, tuple([_make(Vec, row) for row in values]))
    return matrix


def vec(*components: Any) -> Vec:
    """Small vector from its components."""
    return Vec(*components)


def mat(*rows: Any) -> Mat:
    """Small matrix from its rows."""
    return Mat(*rows)


# ------------------------------------------------------------------ formulas, in both worlds


def dot(a: Any, b: Any) -> Any:
    """Scalar product a . b.  a, b : (n,).  Raises InvalidType if the lengths differ, or for a matrix."""
    if isinstance(a, InMemory):
        return a.inner_with(b)
    if isinstance(b, InMemory):
        return b.inner_with(a)
    if len(a) != len(b):
        raise InvalidType(f"dot: the vectors have {len(a)} and {len(b)} components")
    total: Any = None
    for x, y in zip(a, b):
        total = x * y if total is None else total + x * y
    if isinstance(total, (Vec, Mat, list)):
        raise InvalidType("dot: of two vectors; of a matrix write A @ u or u @ A")
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
