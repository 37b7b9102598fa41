"""Lie algebras of matrices, given by a basis: brackets, coordinates and momenta from constants that NumPy finds once."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from ..formulas import Complex, Mat, Vec, mat, record, vec
from ..formulas.sums import antisymmetric_map, bilinear, bilinear_map, entries, linear
from .lie_algebra import Constants, LieAlgebra
from .matrix_basis import MatrixBasis


@record
class MatrixLieAlgebra(LieAlgebra):
    """The algebra spanned by the generators of a group of matrices, real or complex; coordinates are real.

    Of large matrices the structure constants are never formed: the bracket is that of the matrices.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 9.1.
    """

    group: Any

    @cached_property
    def generated(self) -> MatrixBasis:
        """The generators and what follows from them."""
        return self.group.generated

    @cached_property
    def is_large(self) -> bool:
        """Are the matrices too large for formulas?"""
        return self.generated.large

    @cached_property
    def dim(self) -> int:
        """The number of generators."""
        return self.generated.dim

    @cached_property
    def structure_constants(self) -> Constants:
        """c[k][i][j] with [E_i, E_j] = sum_k c[k][i][j] E_k, from commutators; small fractions exactly."""
        return tuple(tuple(map(tuple, c)) for c in self.generated.structure_constants.tolist())

    def bracket(self, xi: Vec, eta: Vec) -> Vec:
        """The commutator, over the structure constants that are not zero."""
        if not self.generated.tabled:
            x, y = self.hat(xi), self.hat(eta)
            return self.vee(x @ y - y @ x)
        return antisymmetric_map(self.generated.bracket_terms, xi, eta)

    def ad_star(self, xi: Vec, mu: Vec) -> Vec:
        """The transpose of the bracket, over the structure constants that are not zero."""
        if not self.generated.tabled:
            x, m = adjoint(self.hat(xi)), self.covector(mu)
            return self.pairing(x @ m - m @ x)
        return bilinear_map(self.generated.ad_star_terms, xi, mu)

    def hat(self, xi: Vec) -> Mat:
        """sum_i xi_i E_i."""
        return self._assembled(self.generated.hat_terms, xi)

    def vee(self, matrix: Mat) -> Vec:
        """Coordinates by least squares: of a matrix outside the algebra, those of its orthogonal projection."""
        return vec(*[entries(terms, matrix) for terms in self.generated.vee_terms])

    def covector(self, mu: Vec) -> Mat:
        """The matrix M in the algebra that stands for a momentum, <mu, xi> = Re tr(M^H hat(xi)).  mu : (dim,)."""
        return self._assembled(self.generated.covector_terms, mu)

    def pairing(self, matrix: Mat) -> Vec:
        """The momentum that a matrix stands for, mu_i = Re tr(M^H E_i): the inverse of `covector`.  matrix : (n, n)."""
        return vec(*[entries(terms, matrix) for terms in self.generated.pairing_terms])

    def ad_size2(self, xi: Vec) -> float:
        """A bound for the square of the Euclidean norm of ad_xi.  xi : (dim,)."""
        return bilinear(self.generated.ad_size_terms, xi, xi)

    def _assembled(self, places: Any, v: Vec) -> Mat:
        if self.generated.complex:
            return mat(*[vec(*[Complex(linear(re, v), linear(im, v)) for re, im in row]) for row in places])
        return mat(*[vec(*[linear(re, v) for re, _ in row]) for row in places])

    def _shape(self, argument: str, kind: str) -> tuple[int, ...] | None:
        return (self.dim,) if kind == "Vec" else (self.generated.n, self.generated.n)

    def _complex(self, kind: str) -> bool:
        return kind == "Mat" and self.generated.complex

    def _in_numpy(self, method: str, arguments: dict[str, Any]) -> Any:
        basis = self.generated
        match method, *arguments.values():
            case "hat", xi:
                return basis.hat(xi)
            case "vee", matrix:
                return basis.vee(matrix)
            case "covector", mu:
                return basis.covector(mu)
            case "pairing", matrix:
                return basis.pairing(matrix)
            case ("bracket" | "ad"), xi, eta:
                x, y = basis.hat(xi), basis.hat(eta)
                return basis.vee(x @ y - y @ x)
            case "ad_star", xi, mu:
                x, m = np.conj(basis.hat(xi)).swapaxes(1, 2), basis.covector(mu)
                return basis.pairing(x @ m - m @ x)
        return None


def adjoint(m: Mat) -> Mat:
    """The conjugate transpose."""
    if isinstance(m[0, 0], Complex):
        return mat(*[vec(*[x.conjugate() for x in row]) for row in m.T])
    return m.T
