"""Linear maps of large vectors and matrices, and their inverses, by tables of coefficients that native code reads."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import InvalidType
from .large import Large, from_numbers, size_of
from .numbers.bases import InMemory, StandIn

TABLES: dict[str, list[np.ndarray]] = {}
"""The tables of all linear maps of this process, by their content: native code finds them here, and holds
their addresses, so that the first ones stay, whoever has the same ones later.
"""


class LinearMap:
    """A real linear map with few coefficients in a row, between vectors and matrices of two forms.

    groups : of rows with equally many terms: the rows (m,), and (m, terms) coefficients and the
    numbers that they multiply.  Other rows are zero.
    """

    __slots__ = ("content", "groups", "source", "target")

    def __init__(self, matrix: Any, source: tuple[Any, ...], target: tuple[Any, ...]) -> None:
        """matrix : of SciPy's, sparse, by rows; real numbers of complex ones one after the other."""
        self.source, self.target = source, target
        matrix = matrix.tocsr()
        matrix.sort_indices()
        counts = np.diff(matrix.indptr)
        self.groups: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        for terms in np.unique(counts[counts > 0]).tolist():
            rows = np.flatnonzero(counts == terms)
            at = matrix.indptr[rows][:, None] + np.arange(terms)
            self.groups.append(
                (rows.astype(np.int64), np.ascontiguousarray(matrix.data[at], dtype=float),
                 np.ascontiguousarray(matrix.indices[at], dtype=np.int64))
            )  # fmt: skip
        import hashlib

        digest = hashlib.sha256(repr((source, target)).encode())
        for group in self.groups:
            for array in group:
                digest.update(array.tobytes())
        self.content = digest.hexdigest()[:24]
        TABLES.setdefault(self.content, [group[part] for group in self.groups for part in (2, 1, 0)])

    def symbol(self, group: int, part: int) -> str:
        """The name by which native code knows a table: places, coefficients or rows of a group."""
        return f"liemech_table_{self.content}_{3 * group + part}"

    def __call__(self, x: Any) -> Large:
        """The image, each number the sum of its terms from left to right."""
        if isinstance(x, InMemory) and not isinstance(x, Large):
            return x.each(self)
        if not isinstance(x, Large):
            run = next((c for c in x if isinstance(c, StandIn)), None)
            x = Large(x) if run is None else run.emitter.large.stored(x)  # type: ignore[attr-defined]
        if x.form != self.source:
            raise InvalidType(f"{x!r} where one of shape {self.source[0]} belongs")
        if x.numbers is None:
            return x._engine.mapped(self, x)
        numbers, target = x.numbers.ravel(), np.zeros(size_of(self.target))
        with np.errstate(all="ignore"):
            for rows, coefficients, places in self.groups:
                sums = coefficients[:, 0] * numbers[places[:, 0]]
                for k in range(1, coefficients.shape[1]):
                    sums += coefficients[:, k] * numbers[places[:, k]]
                target[rows] = sums
        return from_numbers(self.target, target)


class DiagonalSolver:
    """The solution X of equations along every diagonal of a matrix, each tridiagonal:

        l_jk X_j-1,k-1 + d_jk X_jk + u_jk X_j+1,k+1 = B_jk,

    of real coefficients, by elimination without pivots.  Where the main diagonal has no unique
    solution (its last pivot is rounding) that of B without its trace is taken whose trace is zero.

    lower, diagonal, upper : (n, n).  Source: Golub and Van Loan, Matrix Computations, 4th ed.,
    section 4.3.6.
    """

    __slots__ = ("content", "down", "inverse", "shape", "singular", "up")

    def __init__(self, lower: np.ndarray, diagonal: np.ndarray, upper: np.ndarray) -> None:
        n = len(diagonal)
        self.shape = n, n
        pivots, down = diagonal.copy(), np.zeros((n, n))
        for j in range(1, n):
            down[j, 1:] = lower[j, 1:] / pivots[j - 1, :-1]
            pivots[j, 1:] -= down[j, 1:] * upper[j - 1, :-1]
        up = upper.copy()
        up[-1] = up[:, -1] = 0.0
        self.singular = bool(abs(pivots[-1, -1]) <= 1e-6 * abs(diagonal[-1, -1]))
        if self.singular:
            pivots[-1, -1] = np.inf
        # of real and imaginary part
        self.down, self.up, self.inverse = (np.repeat(x[..., None], 2, axis=2) for x in (down, up, 1.0 / pivots))
        import hashlib

        tables = [self.down, self.up, self.inverse]
        self.content = hashlib.sha256(b"".join([x.tobytes() for x in tables])).hexdigest()[:24]
        TABLES.setdefault(self.content, tables)

    def symbol(self, part: int) -> str:
        """The name by which native code knows a table: `down`, `up` or `inverse`."""
        return f"liemech_table_{self.content}_{part}"

    def __call__(self, b: Any) -> Any:
        """The solution X for a complex matrix B."""
        if isinstance(b, InMemory) and not isinstance(b, Large):
            return b.each(self)
        if b.form != (self.shape, True):
            raise InvalidType(f"{b!r} where a complex matrix of shape {self.shape} belongs")
        if b.numbers is None:
            return b._engine.along_diagonals(self, b)
        x, n = b.numbers.copy(), len(b)
        with np.errstate(all="ignore"):
            if self.singular:
                _without_trace(x)
            for j in range(1, n):
                x[j, 1:] -= self.down[j, 1:] * x[j - 1, :-1]
            x[-1] *= self.inverse[-1]
            for j in range(n - 2, -1, -1):
                x[j, :-1] -= self.up[j, :-1] * x[j + 1, 1:]
                x[j] *= self.inverse[j]
            if self.singular:
                _without_trace(x)
        return Large.of_numbers(x, True)


def _without_trace(x: np.ndarray) -> None:
    """Subtract from the main diagonal its mean.  x : (n, n, 2)."""
    d, trace = np.arange(len(x)), np.array([0.0, 0.0])
    for entry in x[d, d]:
        trace = trace + entry
    x[d, d] -= trace * (1.0 / len(x))
