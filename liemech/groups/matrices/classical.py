"""The classical groups of matrices: SO(n), SL(n), GL(n), SU(n), U(n) and Sp(2n)."""

from __future__ import annotations

from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from ...errors import InvalidInput, NotDefined
from ...formulas import Ambient, Complex, Element, Mat, Vec, mat, record, vec
from ...formulas.sums import total
from . import matrix_basis
from .matrix_basis import MatrixBasis, SparseBasis, basis_of
from .matrix_group import MatrixLieGroup, named_by_size, whole_number
from .matrix_invariants import Invariants
from .nearest import nearest_unitary

WRITTEN_OUT = 9
"""Rows up to which formulas of classical groups are written out: so(9) has 36 dimensions, so(10) 45."""


@record
class ClassicalGroup(MatrixLieGroup):
    """A classical group: it has a size, and Casimir functions that are traces of powers.

    The matrix M that stands for a momentum mu, <mu, xi> = Re tr(M^H xi), moves by conjugation along
    every motion, so that tr((M^H)^k) is constant.

    Source: Hall, Lie Groups, Lie Algebras, and Representations, 2nd ed., section 1.2; Marsden and
    Ratiu, section 14.3.
    """

    smallest: ClassVar[int] = 1

    n: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "n", whole_number(type(self).__name__, self.n, self.smallest))

    def _entries(self) -> tuple[np.ndarray, ...]:
        """The entries of the basis that are not zero: which E_k, row, column, value."""
        raise NotDefined(f"{type(self).__name__} must define the entries of its basis")

    @cached_property
    def generators(self) -> np.ndarray:
        """The basis as an array, (dim, n, n): of large groups nobody needs it but who asks."""
        k, i, j, values = self._entries()
        basis = np.zeros((int(k[-1]) + 1, self.n, self.n), dtype=values.dtype)
        basis[k, i, j] = values
        return basis

    @cached_property
    def generated(self) -> MatrixBasis:
        """The basis and the constants that follow from it; of large matrices found from the entries
        that are not zero.
        """
        if self.n <= min(matrix_basis.SMALL, WRITTEN_OUT):
            return basis_of(self.generators, type(self).__name__)
        return SparseBasis(repr(self), self.n, *self._entries())

    def _powers(self) -> tuple[int, ...]:
        """The exponents whose traces are independent Casimir functions."""
        return tuple(range(2, self.n + 1))

    def _casimirs_of(self, m: np.ndarray) -> np.ndarray:
        """The Casimirs from the matrix that stands for a momentum, (samples, n, n), of unitary groups
        from its eigenvalues: where m = i l, i^-k tr(m^k) is the sum of the l^k.
        """
        if self.generated.complex:
            values = np.linalg.eigvalsh(-1j * m)
            return np.stack([(values**k).sum(axis=-1) for k in self._powers()], axis=-1)
        power, traces = m, []
        for k in range(1, max(self._powers()) + 1):
            power = m if k == 1 else power @ m
            if k in self._powers():
                traces.append(np.trace(power, axis1=-2, axis2=-1))
        return np.stack(traces, axis=-1)

    def casimirs(self, mu: Vec) -> Vec:
        """The traces of powers of the matrix that stands for mu."""
        if self.is_large:
            return MatrixLieGroup.casimirs(self, mu)
        m = self.algebra.covector(mu)
        power = m
        values: list[Any] = []
        for k in range(1, max(self._powers()) + 1):
            power = m if k == 1 else power @ m
            if k in self._powers():
                values = [*values, _trace(power, k)]
        return vec(*values)


def _trace(power: Mat, k: int) -> Any:
    """The trace of the power k; of antihermitian matrices i^-k times it, which is real."""
    entries = [power[i, i] for i in range(len(power))]
    if isinstance(entries[0], Complex):
        sign = 1.0 if k % 4 in (0, 1) else -1.0
        return sign * total([x.im if k % 2 else x.re for x in entries])
    return total(entries)


def pfaffian(a: Mat) -> Any:
    """The Pfaffian of an antisymmetric matrix of an even number n of rows, Pf^2 = det.

    Eigenvalues of a J^T, J = diag([[0, 1], [-1, 0]], ...), come in equal pairs; Pf is the product
    of one of each pair, which Newton's identities find from the traces of powers: divisions are by
    1, ..., n/2 only.

    Source: the definition as in Wimmer, ACM Trans. Math. Softw. 38 (2012), 30; the rest is the
    characteristic polynomial of a J^T.
    """
    n = len(a)
    m = mat(*[vec(*[a[i, j + 1] if j % 2 == 0 else -a[i, j - 1] for j in range(n)]) for i in range(n)])
    power, powers, products = m, [0.0], [1.0]
    for k in range(1, n // 2 + 1):
        power = m if k == 1 else power @ m
        powers = [*powers, 0.5 * total([power[i, i] for i in range(n)])]
        terms = [products[k - i] * powers[i] if i % 2 else -(products[k - i] * powers[i]) for i in range(1, k + 1)]
        products = [*products, total(terms) / float(k)]
    return products[n // 2]


def haar(rng: np.random.Generator | int | None, size: int | tuple[int, ...], n: int, complex_: bool) -> np.ndarray:
    """Orthogonal or unitary matrices, uniformly distributed: the QR decomposition of Gaussian
    matrices, signs made unique.

    Source: Mezzadri, Notices of the AMS 54 (2007), 592.
    """
    generator = np.random.default_rng(rng)
    shape = (size,) if isinstance(size, int) else tuple(size)
    a = generator.normal(size=(*shape, n, n))
    if complex_:
        a = a + 1j * generator.normal(size=(*shape, n, n))
    q, r = np.linalg.qr(a)
    diagonal = np.einsum("...ii->...i", r)
    return q * (diagonal / np.abs(diagonal))[..., None, :]


# ------------------------------------------------------------------ orthogonal


@record
class SO(ClassicalGroup):
    """SO(n): rotations of n dimensions, n at least 2.  Basis E_ji - E_ij, i < j; for n = 3 the
    usual one, hat(w) x = w x x.

    n : the number of rows.
    Source: Hall, Lie Groups, Lie Algebras, and Representations, 2nd ed., sections 1.2 and 3.4.
    """

    __repr__ = named_by_size

    smallest: ClassVar[int] = 2

    def _entries(self) -> tuple[np.ndarray, ...]:
        """E_ji - E_ij for i < j, (1, 2), (1, 3), ...; of SO(3) in the order and with the signs of
        the vector product.
        """
        i, j = np.triu_indices(self.n, 1)
        if self.n == 3:
            i, j = np.array([1, 2, 0]), np.array([2, 0, 1])
        k, ones = np.arange(len(i)), np.ones(len(i))
        return _in_order((k, j, i, ones), (k, i, j, -ones))

    @cached_property
    def invariants(self) -> Invariants:
        """g^T g = 1 and det g = 1."""
        return Invariants(forms=(np.eye(self.n),), determinant="1")

    def casimirs(self, mu: Vec) -> Vec:
        """(-1)^k/2 tr(hat(mu)^2k), k = 1, ...: (n - 1)/2 of them for odd n, n/2 - 1 and the
        Pfaffian for even n.

        The first is |mu|^2.  The Pfaffian, mu_12 mu_34 - mu_13 mu_24 + mu_14 mu_23 on SO(4),
        changes its sign under a reflection.
        """
        if self.is_large:
            return MatrixLieGroup.casimirs(self, mu)
        square = self.algebra.hat(mu) @ self.algebra.hat(mu)
        power = square
        values: list[Any] = []
        for k in range(1, (self.n + 1) // 2):
            power = square if k == 1 else power @ square
            trace = total([power[i, i] for i in range(self.n)])
            values = [*values, 0.5 * trace if k % 2 == 0 else -0.5 * trace]
        return vec(*values, *([] if self.n % 2 else [pfaffian(-self.algebra.hat(mu))]))

    def _casimirs_of(self, m: np.ndarray) -> np.ndarray:
        """Casimirs from the rates b_j in all planes, m = Q diag([[0, b_j], [-b_j, 0]]) Q^T: half the
        traces are the sums of b_j^2k, the Pfaffian is det(Q) b_1 b_2 ...
        """
        from scipy.linalg import schur

        casimirs = []
        for x in m:
            blocks, q = schur(2.0 * x)  # hat(mu) is twice the matrix that stands for mu
            rates = np.diag(blocks, 1)  # of which one is zero between two planes
            values = [np.sum(rates ** (2 * k)) for k in range(1, (self.n + 1) // 2)]
            planes = [] if self.n % 2 else [np.linalg.det(q) * np.prod(-rates[::2])]
            casimirs.append([*values, *planes])
        return np.array(casimirs)

    def further_invariants(self, mu: Any) -> tuple[float, ...]:
        """None: the Casimirs tell the angular velocities in all planes, for even n with the
        orientation.
        """
        return ()

    def nearest(self, g: Ambient) -> Element:
        """The rotation of least squared difference: the orthogonal polar factor, its last direction
        turned if it reflects.

        Raises InvalidInput for an array that is as close to several.  Source: Higham, Functions of
        Matrices (2008), theorem 8.4.
        """
        h = nearest_unitary(np.array(g, dtype=float), oriented=True)
        if h is None:
            raise InvalidInput(f"SO({self.n}).nearest: the array is as close to one rotation as to others")
        return Mat.of(h.tolist())

    def random(self, rng: np.random.Generator | int | None = None, size: int | tuple[int, ...] = ()) -> np.ndarray:
        """Rotations distributed uniformly (Haar measure)."""
        q = haar(rng, size, self.n, False)
        q[..., :, 0] *= np.linalg.det(q)[..., None]
        return q


# ------------------------------------------------------------------ linear


@record
class SL(ClassicalGroup):
    """SL(n): real matrices of determinant 1, n at least 2.  Basis E_ij for i != j, then
    E_ii - E_i+1,i+1.

    n : the number of rows.  Not every element has a logarithm.
    Source: Hall, Lie Groups, Lie Algebras, and Representations, 2nd ed., sections 1.2 and 3.4.
    """

    __repr__ = named_by_size

    smallest: ClassVar[int] = 2

    def _entries(self) -> tuple[np.ndarray, ...]:
        """E_ij, i != j, row by row, then E_ii - E_i+1,i+1."""
        i, j = np.nonzero(~np.eye(self.n, dtype=bool))
        return _in_order((np.arange(len(i)), i, j, np.ones(len(i))), *_differences(self.n, len(i)))

    @cached_property
    def invariants(self) -> Invariants:
        """The law of unimodular matrices, det g = 1."""
        return Invariants(determinant="1")

    def nearest(self, g: Ambient) -> Element:
        """The multiple of the matrix that has determinant 1.  Raises InvalidInput for a determinant
        that is not positive.
        """
        a = np.array(g, dtype=float)
        sign, log_det = np.linalg.slogdet(a)
        if sign <= 0:
            raise InvalidInput(f"SL({self.n}).nearest: the determinant is not positive")
        return Mat.of((a * np.exp(-log_det / self.n)).tolist())


@record
class GL(ClassicalGroup):
    """GL(n): all invertible real matrices.  Basis E_ij, row by row.

    n : the number of rows.  An element has a logarithm if no eigenvalue is zero or negative.
    Source: Hall, Lie Groups, Lie Algebras, and Representations, 2nd ed., sections 1.2 and 3.4.
    """

    __repr__ = named_by_size

    def _entries(self) -> tuple[np.ndarray, ...]:
        """The entries of E_ij, row by row."""
        k = np.arange(self.n**2)
        return k, k // self.n, k % self.n, np.ones(len(k))

    @cached_property
    def invariants(self) -> Invariants:
        """None; an element must be invertible."""
        return Invariants()

    def _powers(self) -> tuple[int, ...]:
        return tuple(range(1, self.n + 1))

    def nearest(self, g: Ambient) -> Element:
        """The matrix itself.  Raises InvalidInput for a singular one: there is no nearest."""
        if np.linalg.slogdet(np.array(g, dtype=float))[0] == 0.0:
            raise InvalidInput(
                f"GL({self.n}).nearest: the matrix is singular; invertible ones are as close as one likes"
            )
        return g


# ------------------------------------------------------------------ unitary


@record
class SU(ClassicalGroup):
    """SU(n): unitary matrices of determinant 1, n at least 2; coordinates are real.

    Basis E_ij - E_ji and i (E_ij + E_ji) for i < j, then i (E_jj - E_j+1,j+1).  n : the number of
    rows.
    Source: Hall, Lie Groups, Lie Algebras, and Representations, 2nd ed., sections 1.2 and 3.4.
    """

    __repr__ = named_by_size

    smallest: ClassVar[int] = 2

    def _entries(self) -> tuple[np.ndarray, ...]:
        """E_ij - E_ji, i (E_ij + E_ji) for each i < j, then i (E_jj - E_j+1,j+1)."""
        first = self.n * (self.n - 1)
        return _in_order(*_antihermitian(self.n), *_differences(self.n, first, 1j))

    @cached_property
    def invariants(self) -> Invariants:
        """g^H g = 1 and det g = 1."""
        return Invariants(hermitian=(np.eye(self.n),), determinant="1")

    def further_invariants(self, mu: Any) -> tuple[float, ...]:
        """None: the Casimirs tell the eigenvalues."""
        return ()

    def nearest(self, g: Ambient) -> Element:
        """The unitary polar factor divided by the n-th root of its determinant.  Raises
        InvalidInput for a singular array.
        """
        u = _polar(f"SU({self.n})", g)
        return Mat.of((u * np.exp(-1j * np.angle(np.linalg.det(u)) / self.n)).tolist())

    def random(self, rng: np.random.Generator | int | None = None, size: int | tuple[int, ...] = ()) -> np.ndarray:
        """Elements distributed uniformly (Haar measure)."""
        q = haar(rng, size, self.n, True)
        q[..., :, 0] /= np.linalg.det(q)[..., None]
        return q


@record
class U(ClassicalGroup):
    """U(n): unitary matrices; coordinates are real.

    Basis E_ij - E_ji and i (E_ij + E_ji) for i < j, then i E_jj.  n : the number of rows.
    Source: Hall, Lie Groups, Lie Algebras, and Representations, 2nd ed., sections 1.2 and 3.4.
    """

    __repr__ = named_by_size

    def _entries(self) -> tuple[np.ndarray, ...]:
        """E_ij - E_ji, i (E_ij + E_ji) for each i < j, then i E_jj."""
        k = np.arange(self.n)
        diagonal = self.n * (self.n - 1) + k, k, k, np.full(self.n, 1j)
        return _in_order(*_antihermitian(self.n), diagonal)

    @cached_property
    def invariants(self) -> Invariants:
        """The law of unitary matrices, g^H g = 1."""
        return Invariants(hermitian=(np.eye(self.n),), determinant="unit")

    def further_invariants(self, mu: Any) -> tuple[float, ...]:
        """None: the Casimirs tell the eigenvalues."""
        return ()

    def _powers(self) -> tuple[int, ...]:
        return tuple(range(1, self.n + 1))

    def nearest(self, g: Ambient) -> Element:
        """The unitary matrix of least |h - g|: the polar factor.  Raises InvalidInput for a
        singular array.

        Source: Higham, Functions of Matrices (2008), theorem 8.4.
        """
        return Mat.of(_polar(f"U({self.n})", g).tolist())

    def random(self, rng: np.random.Generator | int | None = None, size: int | tuple[int, ...] = ()) -> np.ndarray:
        """Elements distributed uniformly (Haar measure)."""
        return haar(rng, size, self.n, True)


# ------------------------------------------------------------------ symplectic


@record
class Sp(ClassicalGroup):
    """Sp(2n), the real symplectic group: g^T Om g = Om with Om = [[0, 1], [-1, 0]].  The argument
    is 2n, an even number.

    Basis Om^-1 S with S = E_ii, then S = E_ij + E_ji for i < j.  n : the number of rows, 2n.
    Not every element has a logarithm.
    Source: Hall, Lie Groups, Lie Algebras, and Representations, 2nd ed., sections 1.2 and 3.4.
    """

    __repr__ = named_by_size

    smallest: ClassVar[int] = 2

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.n % 2:
            raise InvalidInput(
                f"Sp({self.n}): the argument is the number of rows 2n, an even number; Sp(2) is the smallest"
            )

    @cached_property
    def form(self) -> np.ndarray:
        """Om = [[0, 1], [-1, 0]].  (2n, 2n)"""
        return np.kron([[0.0, 1.0], [-1.0, 0.0]], np.eye(self.n // 2))

    def _entries(self) -> tuple[np.ndarray, ...]:
        """Om^-1 E_ii, then Om^-1 (E_ij + E_ji) for i < j: Om^-1 exchanges the halves of the rows, one
        of them with its sign changed.
        """
        n, half, d = self.n, self.n // 2, np.arange(self.n)
        i, j = np.triu_indices(n, 1)
        k = n + np.arange(len(i))
        places = (d, d, d), (k, i, j), (k, j, i)
        return _in_order(*[(at, (x + half) % n, y, np.where(x < half, 1.0, -1.0)) for at, x, y in places])

    @cached_property
    def invariants(self) -> Invariants:
        """g^T Om g = Om, from which det g = 1 follows."""
        return Invariants(forms=(self.form,))

    def inverse(self, g: Element) -> Element:
        """Om^-1 g^T Om: blocks of g exchanged, the others with their sign changed."""
        if self.is_large:
            return MatrixLieGroup.inverse(self, g)
        n = self.n
        return mat(*[vec(*[self._entry_of_inverse(g, i, j) for j in range(n)]) for i in range(n)])

    def _entry_of_inverse(self, g: Mat, i: int, j: int) -> Any:
        n, half = self.n, self.n // 2
        entry = g[(j + half) % n, (i + half) % n]
        return entry if (i < half) == (j < half) else -entry

    def _powers(self) -> tuple[int, ...]:
        return tuple(range(2, self.n + 1, 2))


# ------------------------------------------------------------------ bases


def _in_order(*parts: tuple[np.ndarray, ...]) -> tuple[np.ndarray, ...]:
    """Entries of a basis, one generator after the other."""
    k, *columns = (np.concatenate(x) for x in zip(*parts, strict=True))
    order = np.argsort(k, kind="stable")
    return (k[order], *(x[order] for x in columns))


def _differences(n: int, first: int, unit: complex = 1.0) -> list[tuple[np.ndarray, ...]]:
    """E_ii - E_i+1,i+1, times a unit.  first : the number of the first of them."""
    k = np.arange(n - 1)
    return [(first + k, at, at, np.full(n - 1, s * unit)) for at, s in ((k, 1.0), (k + 1, -1.0))]


def _antihermitian(n: int) -> list[tuple[np.ndarray, ...]]:
    """E_ij - E_ji, i (E_ij + E_ji) for each i < j."""
    i, j = np.triu_indices(n, 1)
    k = 2 * np.arange(len(i))
    return [
        (k + part, row, column, np.full(len(i), value))
        for part, row, column, value in ((0, i, j, 1 + 0j), (0, j, i, -1 + 0j), (1, i, j, 1j), (1, j, i, 1j))
    ]  # fmt: skip


def _polar(name: str, g: Ambient) -> np.ndarray:
    """The unitary factor of a = u p.  Raises InvalidInput."""
    u = nearest_unitary(np.array(g, dtype=complex), oriented=False)
    if u is None:
        raise InvalidInput(f"{name}.nearest: the array is singular; it is as close to one element as to others")
    return u
