"""Lie algebras: the vector space of velocities, its bracket, and what follows from them."""

from __future__ import annotations

from functools import cached_property
from typing import final

import numpy as np

from ..errors import LawViolation, NotDefined
from ..formulas import Mat, Record, Vec, dot, identity_matrix, mat, record, vec
from ..formulas.dual import value_of

Constants = tuple[tuple[tuple[float, ...], ...], ...]


@record
class LieAlgebra(Record):
    """A real Lie algebra, in coordinates with respect to a basis E_1, ..., E_dim.

    Its elements, velocities, are coordinate vectors `xi` of shape (dim,).  The elements of its dual, momenta, are coordinate
    vectors `mu` with respect to the dual basis, so that the pairing <mu, xi> is the scalar product.

    1. A subclass writes `dim` and `structure_constants`.
    2. It may replace `bracket`, `ad_star`, `hat` and `vee` by closed forms.
    3. The rest follows.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., sections 9.1, 13.1 and 14.1.
    """

    # ---------------------------------------------------------------- 1. a subclass writes

    @property
    def dim(self) -> int:
        """The dimension of the algebra and of its group."""
        raise NotDefined(f"{type(self).__name__} must define `dim`")

    @property
    def structure_constants(self) -> Constants:
        """c[k][i][j] with [E_i, E_j] = sum_k c[k][i][j] E_k, as nested tuples of numbers."""
        raise NotDefined(f"{type(self).__name__} must define `structure_constants`")

    # ---------------------------------------------------------------- 2. closed forms are welcome

    def bracket(self, xi: Vec, eta: Vec) -> Vec:
        """The Lie bracket, [xi, eta]^k = c^k_ij xi^i eta^j.  xi, eta : (dim,)."""
        return vec(*[_bilinear(c, xi, eta) for c in self.structure_constants])

    def ad_star(self, xi: Vec, mu: Vec) -> Vec:
        """The dual of the bracket, <ad*_xi mu, eta> = <mu, [xi, eta]>, the plain transpose of ad_xi.

        Momenta obey the Euler-Poincare equation mu' = ad*_xi mu.  xi, mu : (dim,).
        """
        return vec(*[dot(mu, self.bracket(xi, unit)) for unit in identity_matrix(self.dim)])

    def hat(self, xi: Vec) -> Mat:
        """The matrix that represents xi, for algebras of matrices.  xi : (dim,)."""
        raise NotDefined(f"{type(self).__name__} is not given as an algebra of matrices")

    def vee(self, matrix: Mat) -> Vec:
        """The coordinates of a matrix of the algebra: the inverse of `hat`."""
        raise NotDefined(f"{type(self).__name__} is not given as an algebra of matrices")

    # ---------------------------------------------------------------- 3. what follows

    @final
    def ad(self, xi: Vec, eta: Vec) -> Vec:
        """The adjoint representation, ad_xi eta = [xi, eta].  xi, eta : (dim,)."""
        return self.bracket(xi, eta)

    @final
    def ad_size(self, xi: Vec) -> float:
        """A bound for the Euclidean norm of ad_xi, the sum of |xi_i| |ad E_i|.  xi : (dim,)."""
        total = 0.0
        for x, size in zip(xi, self._ad_sizes):
            total = total + size * abs(value_of(x))
        return total

    @cached_property
    def _ad_sizes(self) -> tuple[float, ...]:
        """The Frobenius norms of ad E_i."""
        return tuple(np.linalg.norm(self._ad_matrices, axis=(1, 2)).tolist())

    @final
    def poisson_structure(self, mu: Vec) -> Mat:
        """The minus Lie-Poisson structure matrix, B_ij(mu) = -c^k_ij mu_k: mu' = B(mu) grad H(mu).  mu : (dim,), B : (dim, dim)."""
        return mat(*[self.ad_star(unit, mu) for unit in identity_matrix(self.dim)]).T

    @final
    @cached_property
    def basis(self) -> np.ndarray:
        """The matrices E_i = hat(e_i), for algebras of matrices.  (dim, n, n)"""
        return np.array([np.array(self.hat(unit)) for unit in identity_matrix(self.dim)])

    @final
    @cached_property
    def killing_form(self) -> np.ndarray:
        """The Killing form, K_ij = tr(ad_i ad_j): nondegenerate if and only if the algebra is semisimple.  (dim, dim)

        Source: Marsden and Ratiu, section 9.1; Cartan's criterion.
        """
        ad = self._ad_matrices
        return np.einsum("iab,jba->ij", ad, ad)

    @cached_property
    def invariant_form(self) -> np.ndarray | None:
        """A nondegenerate symmetric form that ad leaves alone, ([x, y], z) = (x, [y, z]); None if there is none.  (dim, dim)

        The Killing form of a semisimple algebra, scaled so that its largest entry is 1 and its sign that of -Killing; otherwise
        what the linear equations for a form leave: the Klein form w.v on se(3), any form on an abelian algebra, nothing on
        the Heisenberg algebra.
        """
        ad, n = self._ad_matrices, self.dim
        killing = self.killing_form
        if _nondegenerate(killing):
            return -killing / np.abs(killing).max()
        pairs = [(i, j) for i in range(n) for j in range(i, n)]
        forms = np.zeros((len(pairs), n, n))
        for form, (i, j) in zip(forms, pairs, strict=True):
            form[i, j] = form[j, i] = 1.0
        moved = np.einsum("pab,ibc->piac", forms, ad)  # (E_a, [E_i, E_c])
        equations = moved + moved.swapaxes(-1, -2)
        _, sizes, directions = np.linalg.svd(equations.reshape(len(pairs), -1).T)
        rank = int((sizes > 1e-12 * max(sizes.max(initial=0.0), 1e-300)).sum())
        kernel = np.einsum("kp,pab->kab", directions[rank:], forms)
        for weights in np.random.default_rng(1).normal(size=(4 if len(kernel) else 0, len(kernel))):
            form = np.einsum("k,kab->ab", weights, kernel)  # a generic member of the family: degenerate only if all are
            if _nondegenerate(form):
                return form / np.abs(form).max()
        return None

    @property
    def _ad_matrices(self) -> np.ndarray:
        """The matrices of ad E_i.  (dim, dim, dim), first axis i"""
        basis = list(identity_matrix(self.dim))
        return np.array([[self.bracket(a, b) for b in basis] for a in basis], dtype=float).transpose(0, 2, 1)

    @final
    def check(self) -> None:
        """Verify that the bracket is antisymmetric and obeys the Jacobi identity, to rounding.

        c^k_ij = -c^k_ji and c^a_ib c^b_jk + cyclic(i, j, k) = 0.  Raises LawViolation with the largest defect and where it is.
        """
        basis = list(identity_matrix(self.dim))
        c = np.array([[self.bracket(a, b) for b in basis] for a in basis], dtype=float)  # c[i, j] = [E_i, E_j]
        scale = np.abs(c).max(initial=0.0)
        antisymmetry = c + c.transpose(1, 0, 2)
        nested = np.einsum("jkb,iba->ijka", c, c)
        jacobi = nested + nested.transpose(1, 2, 0, 3) + nested.transpose(2, 0, 1, 3)
        for law, defect, size in (("antisymmetry", antisymmetry, scale), ("the Jacobi identity", jacobi, scale**2)):
            worst = np.unravel_index(np.abs(defect).argmax(), defect.shape)
            if abs(defect[worst]) > 64 * np.finfo(float).eps * size:
                indices = tuple(int(i) + 1 for i in worst[:-1])
                raise LawViolation(
                    f"{type(self).__name__}.bracket breaks {law} at the basis elements {indices}: "
                    f"defect {defect[worst]:.1e}, structure constants up to {scale:.1e}"
                )

    def _shape(self, argument: str, kind: str) -> tuple[int, ...] | None:
        return (self.dim,) if kind == "Vec" else self._matrix_shape

    @cached_property
    def _matrix_shape(self) -> tuple[int, ...] | None:
        """That of the matrices hat(xi), where there are such."""
        try:
            return np.shape(self.hat(vec(*[0.0] * self.dim)))
        except NotDefined:
            return None


def _nondegenerate(form: np.ndarray) -> bool:
    sizes = np.linalg.svd(form, compute_uv=False)
    return bool(len(sizes) and sizes[-1] > 1e-10 * sizes[0])


def _bilinear(c: tuple[tuple[float, ...], ...], xi: Vec, eta: Vec) -> float:
    """sum_ij c_ij xi^i eta^j over the constants that are not zero."""
    total = 0.0
    for i in range(len(xi)):
        for j in range(len(eta)):
            if c[i][j] != 0.0:
                total = total + c[i][j] * (xi[i] * eta[j])
    return total
