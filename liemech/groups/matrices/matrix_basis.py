"""Constants that NumPy finds once from the generators of an algebra of matrices, for formulas to use as
constants.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from ...errors import InvalidInput, InvalidType, LawViolation, NotDefined
from ...formulas.large_maps import LinearMap
from ...formulas.sums import Terms

SMALL = 12
"""Formulas for matrices with more rows than this would be too long to write out; arrays then go
through NumPy.
"""

TABLED = 160
"""Dimension up to which large groups have structure constants, a cube of numbers, nevertheless:
so(16) has 120.
"""

LIKE = 10
"""Units are powers of 2^10: generators and rows whose sizes are within a factor of a few have one
unit, 1 for most.
"""

CLOSED = 1e-10
"""The part by which a bracket may stick out of the span of the generators, relative to the product of their
sizes.
"""


class MatrixBasis:
    """Generators E_1, ..., E_dim of an algebra of real or complex matrices, real coordinates,
    checked when made.

    Coordinates are taken by least squares: `dual` is the basis V_i with Re tr(V_i^H E_j) = 1 if
    i = j, else 0.

    generators : (dim, n, n).  balanced : are they those of a `core`?  Raises InvalidInput,
    InvalidType for arrays that are no matrices, LawViolation for generators that are linearly
    dependent or whose brackets leave their span.

    Source: Hall, Lie Groups, Lie Algebras, and Representations, 2nd ed., sections 3.1 and 3.3.
    """

    def __init__(self, generators: np.ndarray, name: str, balanced: bool = False) -> None:
        self.name, self.balanced = name, balanced
        self.generators = _checked(generators, name)
        self.dim, self.n, _ = self.generators.shape
        self.complex = np.iscomplexobj(self.generators)
        self.large = self.n > SMALL
        self._check_closed()

    # ---------------------------------------------------------------- arrays

    @cached_property
    def columns(self) -> Any:
        """The generators as the columns of a sparse matrix, real above imaginary parts.
        (n^2 or 2 n^2, dim)
        """
        from scipy.sparse import csr_array

        return csr_array(real_parts(self.generators).T)

    @cached_property
    def units(self) -> tuple[np.ndarray, np.ndarray]:
        """Powers of two u (dim,) and d (n,) for which the matrices d_i^-1 (E_k)_ij d_j/u_k are of
        like sizes, and their rows and columns too.

        All of them are 1 unless generators, or coordinates of the space they act on, have very
        unlike units: boosts by metres per second have entries 1 and 1/c^2.

        Source: Parlett and Reinsch, Balancing a matrix for calculation of eigenvalues and
        eigenvectors, Numer. Math. 13 (1969) 293.
        """
        from scipy.linalg import matrix_balance

        sizes = np.linalg.norm(self.generators, axis=(1, 2))
        whole = np.einsum("kij,k->ij", np.abs(self.generators), 1.0 / sizes)
        rows = matrix_balance(whole, permute=False, separate=True)[1][0]
        rows = power_of_two(rows / rows[0])
        if (rows != 1.0).any():
            sizes = np.linalg.norm(self.generators / rows[:, None] * rows, axis=(1, 2))
        return power_of_two(sizes), rows

    @cached_property
    def core(self) -> MatrixBasis:
        """This algebra in units in which small numbers are rounding errors; itself if these units are 1."""
        units, rows = self.units
        if self.balanced or ((units == 1.0).all() and (rows == 1.0).all()):
            return self
        scaled = self.generators / units[:, None, None] / rows[:, None] * rows
        return MatrixBasis(scaled, self.name, balanced=True)

    @cached_property
    def shifts(self) -> tuple[tuple[tuple[int, tuple[int, ...]], ...], ...]:
        """For every generator the columns and rows of the blocks in which it has entries; none for
        one that turns, shears or stretches coordinates of one unit.

        Rows share a unit where elements mix them to and fro: R in (R, x; 0, 1), and not x and 1.
        """
        from scipy.sparse.csgraph import connected_components

        nonzero = np.abs(self.core.generators) > 2.0**-40 * np.abs(self.core.generators).max()
        _, block = connected_components(nonzero.any(axis=0), connection="strong")
        of_generators = []
        for entries in nonzero:
            blocks = {(int(j), int(block[i])) for i, j in np.argwhere(entries)}
            within = any(block[j] == b for j, b in blocks)
            rows = [(j, tuple(np.flatnonzero(block == b).tolist())) for j, b in sorted(blocks)]
            of_generators.append(() if within else tuple(rows))
        return tuple(of_generators)

    def to_core(self, g: np.ndarray) -> np.ndarray:
        """A matrix in the units of `core`.  g : (..., n, n)."""
        d = self.units[1]
        return g if self.core is self else g / d[:, None] * d

    def from_core(self, g: np.ndarray) -> np.ndarray:
        """The way back.  g : (..., n, n)."""
        d = self.units[1]
        return g if self.core is self else g * d[:, None] / d

    @cached_property
    def rows(self) -> Any:
        """The pseudo-inverse of `columns`: rows that read off coordinates.  (dim, n^2 or 2 n^2),
        sparse

        Generators that share no entry with the others are dealt with apart, so that zeros stay
        zeros.
        """
        from scipy.sparse import coo_array, csr_array
        from scipy.sparse.csgraph import connected_components

        units = power_of_two(np.linalg.norm(self.generators, axis=(1, 2)))
        columns = self.columns.tocsc()
        gram = (columns.T @ columns).tocsr()
        count, labels = connected_components(gram, directed=False)
        order = np.argsort(labels, kind="stable")
        values, at, to = [], [], []
        for members in np.split(order, np.cumsum(np.bincount(labels, minlength=count))[:-1]):
            block = columns[:, members].toarray() / units[members]
            touched = np.flatnonzero(block.any(axis=1))
            inverse = clean(np.linalg.pinv(block[touched], rcond=1e-15)) / units[members][:, None]
            i, j = np.nonzero(inverse)
            values.append(inverse[i, j])
            at.append(members[i])
            to.append(touched[j])
        parts = np.concatenate(values), (np.concatenate(at), np.concatenate(to))
        return csr_array(coo_array(parts, shape=columns.shape[::-1]))

    def hat(self, xi: np.ndarray) -> np.ndarray:
        """sum_i xi_i E_i.  xi : (..., dim)."""
        return self._matrices(self.columns, xi)

    def vee(self, matrix: np.ndarray) -> np.ndarray:
        """Coordinates, by least squares.  matrix : (..., n, n)."""
        flat = real_parts(matrix.reshape(-1, self.n, self.n), self.complex)
        return (self.rows @ flat.T).T.reshape(*matrix.shape[:-2], self.dim)

    def covector(self, mu: np.ndarray) -> np.ndarray:
        """The matrix sum_i mu_i V_i, so that <mu, xi> = Re tr(M^H hat(xi)).  mu : (..., dim)."""
        return self._matrices(self.rows.T, mu)

    def _matrices(self, columns: Any, x: np.ndarray) -> np.ndarray:
        """The matrices sum_i x_i C_i, C_i a column, their real before their imaginary parts.  x : (..., dim)."""
        flat = (columns @ x.reshape(-1, self.dim).T).T
        if self.complex:
            flat = flat[:, : self.n**2] + 1j * flat[:, self.n**2 :]
        return flat.reshape(*x.shape[:-1], self.n, self.n)

    def pairing(self, matrix: np.ndarray) -> np.ndarray:
        """Re tr(M^H E_i) for all i: the momentum that a matrix stands for.  matrix : (..., n, n)."""
        flat = real_parts(matrix.reshape(-1, self.n, self.n), self.complex)
        return (self.columns.T @ flat.T).T.reshape(*matrix.shape[:-2], self.dim)

    def sticks_out(self, matrix: np.ndarray) -> np.ndarray:
        """The norm of what a matrix has besides a part in the algebra.  matrix : (..., n, n)."""
        return np.linalg.norm(matrix - self.hat(self.vee(matrix)), axis=(-2, -1))

    @cached_property
    def structure_constants(self) -> np.ndarray:
        """c[k, i, j] with [E_i, E_j] = c[k, i, j] E_k; small fractions exactly."""
        if self.core is not self:
            u = self.units[0]
            return self.core.structure_constants * (np.outer(u, u) / u[:, None, None])
        e = self.generators
        products = np.einsum("iab,jbc->ijac", e, e)
        return clean(self.vee(products - products.swapaxes(0, 1))).transpose(2, 0, 1)

    @cached_property
    def tabled(self) -> bool:
        """Whether brackets are quicker by structure constants than by products of matrices, which those of
        small ones always are.
        """
        if not self.large:
            return True
        return self.dim <= TABLED and np.count_nonzero(self.structure_constants) <= 2 * self.n**3

    # ---------------------------------------------------------------- laws

    def _check_closed(self) -> None:
        if self.core is not self:
            return  # which has been looked at
        e = self.generators
        sizes = np.linalg.norm(e, axis=(1, 2))
        pairs = [(i, j) for i in range(self.dim) for j in range(i + 1, self.dim)]
        if not self.large:
            left, right = np.array(pairs, dtype=int).reshape(-1, 2).T
            a, b, size = e[left], e[right], sizes[left] * sizes[right]
        else:  # two generic elements tell as much as all pairs
            xi, eta = np.random.default_rng(1).normal(size=(2, 1, self.dim)) / sizes
            a, b = self.hat(xi), self.hat(eta)
            size = np.linalg.norm(a, axis=(1, 2)) * np.linalg.norm(b, axis=(1, 2))
        defects = self.sticks_out(a @ b - b @ a) / size
        if defects.max(initial=0.0) > CLOSED:
            worst = int(defects.argmax())
            generators = (
                "two generic elements"
                if self.large
                else "the generators {} and {}".format(*(k + 1 for k in pairs[worst]))
            )
            raise LawViolation(
                f"{self.name}.generators is not closed under the bracket: the bracket of {generators} "
                f"sticks out of their span by {defects[worst]:.1e} of the size "
                "of the product. Add it to the generators"
            )

    @cached_property
    def without_cayley(self) -> str | None:
        """Why the algebra is not closed under x y x; None if it is."""
        if self.core is not self:
            return self.core.without_cayley
        if self.large:
            x, y = self.hat(np.random.default_rng(1).normal(size=(2, self.dim)))
            off = self.sticks_out(x @ y @ x) / (np.linalg.norm(x) ** 2 * np.linalg.norm(y))
            return (
                None
                if off <= CLOSED
                else f"its algebra is not closed under x y x: generic elements stick out by {off:.1e}"
            )
        e = self.generators
        t = np.einsum("iab,jbc,lcd->ijlad", e, e, e)
        # x y x for all x if and only if x y z + z y x for all x and z
        t = t + t.transpose(2, 1, 0, 3, 4)
        sizes = np.linalg.norm(e, axis=(1, 2))
        off = self.sticks_out(t) / np.einsum("i,j,l->ijl", sizes, sizes, sizes)
        if off.max() <= CLOSED:
            return None
        diagonal = np.einsum("iji->ij", off)
        if diagonal.max() > CLOSED:
            i, j = (int(k) for k in np.unravel_index(diagonal.argmax(), diagonal.shape))
            return (
                f"its algebra is not closed under x y x: with the generators x = E_{i + 1}, y = "
                f"E_{j + 1} the product sticks out by {diagonal[i, j] / 2:.1e} of its size"
            )
        i, j, k = (int(x) + 1 for x in np.unravel_index(off.argmax(), off.shape))
        return (
            f"its algebra is not closed under x y x: with the generators x = E_{i} + E_{k}, y = "
            f"E_{j} the product sticks out by {off.max():.1e} of its size"
        )

    # ---------------------------------------------------------------- constants of formulas

    @cached_property
    def hat_terms(self) -> tuple[tuple[tuple[Terms, Terms], ...], ...]:
        """For each entry of hat(xi), the terms (coefficient, i) of real and imaginary part."""
        return self._entries(self.columns.toarray())

    @cached_property
    def covector_terms(self) -> tuple[tuple[tuple[Terms, Terms], ...], ...]:
        """For each entry of sum_i mu_i V_i, the terms (coefficient, i) of real and imaginary part."""
        return self._entries(self.rows.toarray().T)

    def _entries(self, columns: np.ndarray) -> Any:
        n, terms = self.n, [linear_terms(row) for row in columns]
        parts = [terms[: n * n], terms[n * n :] or [()] * (n * n)]
        return tuple(tuple((parts[0][n * i + j], parts[1][n * i + j]) for j in range(n)) for i in range(n))

    @cached_property
    def vee_terms(self) -> tuple[Terms, ...]:
        """For each coordinate, the terms (coefficient, row, column, 0 or 1 for the imaginary part)."""
        return self._readings(self.rows.toarray())

    @cached_property
    def pairing_terms(self) -> tuple[Terms, ...]:
        """For each Re tr(M^H E_i), the terms (coefficient, row, column, 0 or 1 for the imaginary
        part).
        """
        return self._readings(self.columns.toarray().T)

    def _readings(self, rows: np.ndarray) -> tuple[Terms, ...]:
        n = self.n
        return tuple(tuple((c, k % (n * n) // n, k % n, k // (n * n)) for c, k in linear_terms(row)) for row in rows)

    @cached_property
    def bracket_terms(self) -> tuple[Terms, ...]:
        """For each component of [x, y], the terms (c, i, j), standing for c (x_i y_j - x_j y_i)
        with c > 0.
        """
        upper = [products(np.triu(c, 1)) for c in self.structure_constants]
        return tuple(tuple((v, i, j) if v > 0 else (-v, j, i) for v, i, j in terms) for terms in upper)

    @cached_property
    def ad_star_terms(self) -> tuple[Terms, ...]:
        """For each component of ad*_x mu, the terms (c, i, k), standing for c x_i mu_k."""
        return tuple(products(c.T) for c in self.structure_constants.transpose(2, 0, 1))

    @cached_property
    def ad_size_terms(self) -> Terms:
        """The terms (c, i, j), i <= j, of a sum over c x_i x_j that bounds the square of the norm
        of ad_x, in the units of `core`.

        The Frobenius norm; half of it where all ad_x are antisymmetric, so that their singular
        values come in pairs.  Without structure constants |[x, y]|^2 <= 2 |x|^2 |y|^2, Frobenius
        norms of matrices, compared with lengths of coordinates.

        Source: Boettcher and Wenzel, The Frobenius norm and the commutator, Linear Algebra Appl.
        429 (2008) 1864.
        """
        if self.core is not self:
            u = self.units[0].tolist()
            return tuple((c * u[i] * u[j], i, j) for c, i, j in self.core.ad_size_terms)
        if not self.tabled:
            square = (self.columns.T @ self.columns).toarray()
            lengths = np.linalg.eigvalsh(square)
            return products(
                clean(2.0 * lengths[-1] / lengths[0] * (2.0 * np.triu(square, 1) + np.diag(np.diag(square))))
            )
        ad = self.structure_constants.transpose(1, 0, 2)
        square = np.einsum("iab,jab->ij", ad, ad) * (0.5 if np.array_equal(ad, -ad.swapaxes(1, 2)) else 1.0)
        return products(clean(2.0 * np.triu(square, 1) + np.diag(np.diag(square))))

    @cached_property
    def triple_terms(self) -> tuple[Terms, ...]:
        """For each coordinate of x y x, the terms (c, i, l, j), i <= l, standing for c x_i x_l y_j."""
        if self.core is not self:
            u = self.units[0].tolist()
            return tuple(
                tuple((c * u[i] * u[l] * u[j] / u[k], i, l, j) for c, i, l, j in terms)
                for k, terms in enumerate(self.core.triple_terms)
            )
        e = self.generators
        t = self.vee(np.einsum("iab,jbc,lcd->ijlad", e, e, e))
        t = clean(t + t.transpose(2, 1, 0, 3)).transpose(3, 0, 2, 1)  # [k, i, l, j]
        weight = np.triu(np.ones((self.dim, self.dim))) - 0.5 * np.eye(self.dim)
        return tuple(
            tuple((float(c[i, l, j]), int(i), int(l), int(j)) for i, l, j in np.argwhere(c != 0.0))
            for c in t * weight[:, :, None]
        )

    @cached_property
    def triple_dual_terms(self) -> tuple[Terms, ...]:
        """For each component of the dual of y -> x y x, applied to mu, the terms (c, i, l, k),
        standing for c x_i x_l mu_k.
        """
        dual_terms: list[list[Any]] = [[] for _ in range(self.dim)]
        for k, terms in enumerate(self.triple_terms):
            for c, i, l, j in terms:
                dual_terms[j].append((c, i, l, k))
        return tuple(map(tuple, dual_terms))

    @cached_property
    def few_triples(self) -> bool:
        """Whether x y x is quicker by its constants than by products of matrices."""
        if self.large or self.without_cayley is not None:
            return False
        return sum(map(len, self.triple_terms)) <= self.n**3

    # ---------------------------------------------------------------- of large matrices

    @cached_property
    def hat_map(self) -> LinearMap:
        """The hat map of large vectors, a sparse matrix."""
        return LinearMap(self._interleaved(self.columns), self._vector, self._matrix)

    @cached_property
    def vee_map(self) -> LinearMap:
        """The vee map of large matrices, a sparse matrix."""
        return LinearMap(self._interleaved(self.rows.T).T, self._matrix, self._vector)

    @cached_property
    def covector_map(self) -> LinearMap:
        """The covector map of large vectors, a sparse matrix."""
        return LinearMap(self._interleaved(self.rows.T), self._vector, self._matrix)

    @cached_property
    def pairing_map(self) -> LinearMap:
        """The pairing map of large matrices, a sparse matrix."""
        return LinearMap(self._interleaved(self.columns).T, self._matrix, self._vector)

    @property
    def _vector(self) -> tuple[Any, ...]:
        return (self.dim,), False

    @property
    def _matrix(self) -> tuple[Any, ...]:
        return (self.n, self.n), self.complex

    def _interleaved(self, columns: Any) -> Any:
        """Columns with the imaginary parts of complex matrices behind the real ones, entry by entry, as they lie
        in memory.
        """
        size = self.n**2
        if not self.complex:
            return columns
        return columns.tocsr()[np.arange(2 * size).reshape(2, size).T.ravel()]


class SparseBasis(MatrixBasis):
    """A basis of large matrices, known to be closed and independent, of few entries each.

    k, i, j, values : which E_k, row, column, value.
    """

    def __init__(self, name: str, n: int, k: np.ndarray, i: np.ndarray, j: np.ndarray, values: np.ndarray) -> None:
        self.name, self.n, self.balanced, self.large = name, n, True, True
        self.dim, self.complex = int(k[-1]) + 1, np.iscomplexobj(values)
        self._sparse = k, i, j, values

    @cached_property
    def generators(self) -> np.ndarray:  # type: ignore[override]
        """E_1, E_2, ...: (dim, n, n), for those who ask."""
        k, i, j, values = self._sparse
        basis = np.zeros((self.dim, self.n, self.n), dtype=values.dtype)
        basis[k, i, j] = values
        return basis

    @cached_property
    def columns(self) -> Any:
        from scipy.sparse import coo_array

        k, i, j, values = self._sparse
        at, size = i * self.n + j, self.n**2
        parts = np.concatenate([values.real, values.imag]) if self.complex else values
        rows = np.concatenate([at, size + at]) if self.complex else at
        nonzero = np.flatnonzero(parts)
        generator = np.tile(k, 2)[nonzero] if self.complex else k[nonzero]
        shape = (2 if self.complex else 1) * size, self.dim
        return coo_array((parts[nonzero], (rows[nonzero], generator)), shape=shape).tocsr()

    @cached_property
    def units(self) -> tuple[np.ndarray, np.ndarray]:
        return np.ones(self.dim), np.ones(self.n)

    @cached_property
    def rows(self) -> Any:
        """The pseudo-inverse of `columns`: of generators that are orthogonal to all others each by
        its length, of the others together.
        """
        from scipy.sparse import coo_array, csr_array

        columns = self.columns.tocsc()
        gram = (columns.T @ columns).tocsr()
        alone = np.diff(gram.indptr) == 1
        coupled = np.flatnonzero(~alone)
        scale = np.where(alone, 1.0 / gram.diagonal(), 0.0)
        inverses = csr_array(columns.T.tocsr() * scale[:, None])
        if len(coupled):
            block = columns[:, coupled]
            touched = np.unique(block.indices)
            inverse = clean(np.linalg.pinv(block[touched].toarray(), rcond=1e-15))
            i, j = np.nonzero(inverse)
            of_coupled = coo_array((inverse[i, j], (coupled[i], touched[j])), shape=inverses.shape)
            inverses = csr_array(inverses + of_coupled.tocsr())
        inverses.eliminate_zeros()
        return inverses

    @property
    def shifts(self) -> tuple[Any, ...]:
        return ()

    @property
    def tabled(self) -> bool:
        return False

    @cached_property
    def ad_size_terms(self) -> Terms:
        raise NotDefined(f"{self.name}: ad is measured by matrices")


_known: dict[tuple[Any, ...], MatrixBasis] = {}


def basis_of(generators: Any, name: str) -> MatrixBasis:
    """The basis for these generators, made once."""
    try:
        array = np.asarray(generators)
    except ValueError:
        raise InvalidInput(f"{name}.generators is ragged: its rows have different lengths") from None
    if array.dtype == object or array.nbytes > 2**22:
        return MatrixBasis(array, name)
    import hashlib

    key = name, array.dtype.str, array.shape, hashlib.sha256(array.tobytes()).digest()
    if key not in _known:
        _known[key] = MatrixBasis(array, name)
    return _known[key]


# ------------------------------------------------------------------ helpers


def _checked(array: np.ndarray, name: str) -> np.ndarray:
    """The generators as an array of floats or complex numbers, square, finite, linearly
    independent.
    """
    if array.dtype.kind not in "iufc":
        raise InvalidType(f"{name}.generators must be real or complex numbers; got dtype {array.dtype}")
    if array.ndim != 3 or array.shape[1] != array.shape[2] or not array.size:
        raise InvalidInput(
            f"{name}.generators has shape {array.shape}; it must be (dim, n, n): square matrices, one per generator"
        )
    array = np.array(array, dtype=complex if array.dtype.kind == "c" else float)
    bad = np.argwhere(~np.isfinite(array))
    if len(bad):
        at = tuple(map(int, bad[0]))
        raise InvalidInput(f"{name}.generators{list(at)} is {array[at]}; every entry must be finite")
    largest = float(max(np.abs(array.real).max(), np.abs(array.imag).max()))
    if largest > np.finfo(float).max ** 0.5 / array.shape[1]:
        raise InvalidInput(
            f"{name}.generators have entries up to {largest:.1e}, whose products leave the range of "
            "floats; scale the generators"
        )
    sizes = np.linalg.norm(array, axis=(1, 2))
    if len(array) <= 2 * SMALL**2:
        flat = real_parts(array) / np.where(sizes > 0.0, sizes, 1.0)[:, None]
        rank = int((np.linalg.svd(flat, compute_uv=False) > 1e-10).sum())
    else:
        rank = int((sizes > 0.0).sum())
    if rank < len(array):
        raise LawViolation(
            f"{name}.generators are linearly dependent: {len(array)} matrices of rank {rank}. Leave some out"
        )
    array.flags.writeable = False
    return array


def real_parts(matrices: np.ndarray, both: bool | None = None) -> np.ndarray:
    """Matrices as rows of real numbers, for complex ones the real parts before the imaginary
    parts.  matrices : (m, n, n).
    """
    flat = matrices.reshape(len(matrices), int(np.prod(matrices.shape[1:])))
    if both or (both is None and np.iscomplexobj(matrices)):
        return np.concatenate([flat.real, flat.imag], axis=1)
    return flat


def clean(values: np.ndarray) -> np.ndarray:
    """The values; those within rounding of a fraction with a denominator up to 60 are set to it."""
    values = np.array(values, dtype=float, order="C")
    scale = np.abs(values).max(initial=0.0)
    margin = 16 * np.finfo(float).eps
    values[np.abs(values) <= margin * scale] = 0.0
    flat = values.reshape(-1)
    places = np.flatnonzero(flat)  # few: tables of large algebras are nearly empty
    for q in range(1, 61):
        x = flat[places]
        nearest = np.round(x * q) / q
        hit = (np.abs(x - nearest) <= margin * np.abs(x)) & (nearest != 0.0)
        flat[places[hit]] = nearest[hit]
        places = places[~hit]
    return values


def power_of_two(sizes: np.ndarray) -> np.ndarray:
    """The power of 2^10 next to each size.  sizes : positive."""
    return np.ldexp(1.0, (LIKE * np.round(np.log2(sizes) / LIKE)).astype(int))


def linear_terms(row: np.ndarray) -> tuple[tuple[float, int], ...]:
    """(coefficient, index) of the nonzero entries, positive coefficients first."""
    terms = [(float(row[k]), int(k)) for k in np.flatnonzero(row)]
    return tuple(sorted(terms, key=lambda term: term[0] < 0.0))


def products(square: np.ndarray) -> tuple[tuple[float, int, int], ...]:
    """(coefficient, row, column) of the nonzero entries, positive coefficients first."""
    terms = [(float(square[i, j]), int(i), int(j)) for i, j in np.argwhere(square != 0.0)]
    return tuple(sorted(terms, key=lambda term: term[0] < 0.0))
