"""Unitary matrices over the dual numbers, as matrices of blocks."""

from __future__ import annotations

from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from ...formulas import record
from ...formulas.large_maps import LinearMap
from .classical import U
from .matrix_basis import SMALL, SparseBasis
from .matrix_group import MatrixLieGroup, named_by_size, whole_number
from .matrix_invariants import Invariants


@record
class DualUnitary(MatrixLieGroup):
    """U(n) with dual numbers as entries, u (1 + eps a), eps^2 = 0, as matrices [[u, u a], [0, u]]: the
    semidirect product of U(n) and its algebra u(n), or the coalgebra, which the trace makes of it.

    Coordinates are those of x and then of y, on u(n), of [[x, y], [0, x]].  A momentum is a pair
    (W, Theta) of antihermitian matrices, <mu, (x, y)> = Re tr(W^H x) + Re tr(Theta^H y), and moves by
    Theta' = [Theta, x], W' = [W, x] + [Theta, y]: that is the conjugation of Theta + eps W.

    n : half the number of rows, at least 7: such matrices lie in memory.
    Source: Modin and Roop, IMA J. Numer. Anal. (2025), draf024 (magnetic extensions g x g*); Marsden and
    Ratiu, section 14.3 (traces as Casimir functions).
    """

    over_duals: ClassVar[bool] = True

    n: int

    __repr__ = named_by_size

    def __post_init__(self) -> None:
        object.__setattr__(self, "n", whole_number(type(self).__name__, self.n, SMALL // 2 + 1))

    @cached_property
    def maps(self) -> tuple[LinearMap, ...]:
        """Of matrices of blocks the sum of those on the diagonal, and the corner; from a matrix the diagonal, and the corner."""
        n, diagonal, corner = self.n, as_blocks(self.n, (0, 0), (1, 1)), as_blocks(self.n, (0, 1))
        matrix, blocks = ((n, n), True), ((2 * n, 2 * n), True)
        down = LinearMap(diagonal.T, blocks, matrix), LinearMap(corner.T, blocks, matrix)
        return (*down, LinearMap(diagonal, matrix, blocks), LinearMap(corner, matrix, blocks))

    def pair_of_momentum(self, m: Any) -> tuple[Any, Any]:
        """Theta and W of Theta + eps W, from the matrix [[W/2, Theta], [0, W/2]] of a momentum."""
        total, corner, *_ = self.maps
        return corner(m), total(m)

    def of_momentum(self, pair: tuple[Any, Any]) -> Any:
        """The inverse of `pair_of_momentum`."""
        *_, diagonal, corner = self.maps
        return diagonal(0.5 * pair[1]) + corner(pair[0])

    def pair_of_velocity(self, x: Any) -> tuple[Any, Any]:
        """x and y of x + eps y, from the matrix [[x, y], [0, x]]."""
        total, corner, *_ = self.maps
        return 0.5 * total(x), corner(x)

    def of_velocity(self, pair: tuple[Any, Any]) -> Any:
        """The inverse of `pair_of_velocity`."""
        *_, diagonal, corner = self.maps
        return diagonal(pair[0]) + corner(pair[1])

    @cached_property
    def generators(self) -> np.ndarray:
        """The basis as an array, (2 n^2, 2 n, 2 n)."""
        return self.generated.generators

    @cached_property
    def generated(self) -> SparseBasis:
        """The basis [[E, 0], [0, E]] and then [[0, E], [0, 0]] with the basis E of u(n)."""
        n, (k, i, j, values) = self.n, U(self.n)._entries()
        blocks = (0, 0, 0), (0, n, n), (n * n, 0, n)
        entries = [(k + first, i + down, j + right, values) for first, down, right in blocks]
        return SparseBasis(repr(self), 2 * n, *map(np.concatenate, zip(*entries)))

    @cached_property
    def invariants(self) -> Invariants:
        """g eps = eps g with eps = [[0, 1], [0, 0]], and g^H B g = B with B = [[0, 1], [1, 0]]."""
        eps, b = (np.kron(x, np.eye(self.n)) for x in ([[0.0, 1.0], [0.0, 0.0]], [[0.0, 1.0], [1.0, 0.0]]))
        return Invariants(commuting=(eps,), hermitian=(b,))

    def why_not_isospectral(self) -> str | None:
        """None: the adjoint over the dual numbers, [[x^H, y^H], [0, x^H]], is that of antihermitian matrices, and
        W = M^H moves as a momentum of GL(2 n) that has this one as its part.
        """
        return None

    def _casimirs_of(self, m: np.ndarray) -> np.ndarray:
        """The sums over j of l_j^k and of l_j^(k-1) w_j, k = 1, ..., n, with the eigenvalues l_j + eps w_j of
        -i (Theta + eps W).
        """
        w, theta = pair_of(m)
        values, vectors = np.linalg.eigh(-1j * theta)
        change = np.einsum("...ij,...ik,...kj->...j", np.conj(vectors), -1j * w, vectors).real
        powers = range(1, self.n + 1)
        first = [(values**k).sum(axis=-1) for k in powers]
        return np.stack(first + [(values ** (k - 1) * change).sum(axis=-1) for k in powers], axis=-1)


def pair_of(m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """W and Theta of the matrix M = [[W/2, Theta], [0, W/2]] that stands for a momentum.  m : (..., 2 n, 2 n)."""
    n = m.shape[-1] // 2
    return m[..., :n, :n] + m[..., n:, n:], m[..., :n, n:]


def as_blocks(n: int, *corners: tuple[int, int]) -> Any:
    """The matrix, of SciPy's, that writes a complex matrix (n, n) into blocks of one of (2 n, 2 n), at (0, 0) to
    (1, 1); its transpose adds up these blocks.
    """
    from scipy.sparse import coo_array

    i, j, part = (x.ravel() for x in np.indices((n, n, 2)))
    rows = np.concatenate([2 * (2 * n * (i + n * down) + j + n * right) + part for down, right in corners])
    columns = np.tile(np.arange(2 * n * n), len(corners))
    return coo_array((np.ones(len(rows)), (rows, columns)), (8 * n * n, 2 * n * n))
