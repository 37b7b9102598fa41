"""Lie algebras of matrices, given by a basis: brackets, coordinates and momenta from constants that
NumPy finds once.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np

from ...errors import InvalidType
from ...formulas import Complex, Mat, Vec, mat, record, solve, solve3, vec
from ...formulas.elimination import INFINITE, inverse, solve_matrix
from ...formulas.numbers.bases import InMemory, raise_if
from ...formulas.numbers.double_double import is_long
from ...formulas.numbers.dual import value_of
from ...formulas.sums import antisymmetric_map, bilinear, bilinear_map, entries, linear, scaled, total
from ..ad_series import ROUGH
from ..bernoulli import BERNOULLI
from ..lie_algebra import Constants, LieAlgebra
from . import matrix_arrays
from .matrix_basis import MatrixBasis
from .matrix_functions import LOST, digits, expm1, frobenius2, phi1m, plus

EVEN = BERNOULLI[2::2]
"""B_2k/(2k)!, k = 1, 2, ...: the coefficients of dexp^-1 but the first two."""


@record
class MatrixLieAlgebra(LieAlgebra):
    """The algebra spanned by the generators of a group of matrices, real or complex; coordinates
    are real.

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
        return self.generated.large

    @cached_property
    def dim(self) -> int:
        return self.generated.dim

    @cached_property
    def structure_constants(self) -> Constants:
        """c[k][i][j] with [E_i, E_j] = sum_k c[k][i][j] E_k, from commutators; small fractions
        exactly.
        """
        return tuple(tuple(map(tuple, c)) for c in self.generated.structure_constants.tolist())

    def bracket(self, xi: Vec, eta: Vec) -> Vec:
        """The commutator, over the structure constants that are not zero; of large matrices by
        their products.
        """
        if self.is_large:
            x, y = self.hat(xi), self.hat(eta)
            return self.vee(x @ y - y @ x)
        return antisymmetric_map(self.generated.bracket_terms, xi, eta)

    def ad_star(self, xi: Vec, mu: Vec) -> Vec:
        """The transpose of the bracket, over the structure constants that are not zero; of large
        matrices by their products.
        """
        if self.is_large:
            x, m = adjoint(self.hat(xi)), self.covector(mu)
            return self.pairing(x @ m - m @ x)
        return bilinear_map(self.generated.ad_star_terms, xi, mu)

    def hat(self, xi: Vec) -> Mat:
        """The matrix of a velocity, sum_i xi_i E_i."""
        if self.is_large:
            return self.generated.hat_map(xi)
        return self._assembled(self.generated.hat_terms, xi)

    def vee(self, matrix: Mat) -> Vec:
        """Coordinates by least squares: of a matrix outside the algebra, those of its orthogonal
        projection.
        """
        if self.is_large:
            return self.generated.vee_map(matrix)
        return vec(*[entries(terms, matrix) for terms in self.generated.vee_terms])

    def covector(self, mu: Vec) -> Mat:
        """The matrix M in the algebra that stands for a momentum, <mu, xi> = Re tr(M^H hat(xi)).
        mu : (dim,).
        """
        if self.is_large:
            return self.generated.covector_map(mu)
        return self._assembled(self.generated.covector_terms, mu)

    def pairing(self, matrix: Mat) -> Vec:
        """The momentum that a matrix stands for, mu_i = Re tr(M^H E_i): the inverse of `covector`.
        matrix : (n, n).
        """
        if self.is_large:
            return self.generated.pairing_map(matrix)
        return vec(*[entries(terms, matrix) for terms in self.generated.pairing_terms])

    def ad_size2(self, xi: Vec) -> float:
        """A bound for the square of the Euclidean norm of ad_xi, of large matrices that of their
        Frobenius norms: |[x, y]|^2 <= 2 |x|^2 |y|^2.  xi : (dim,).

        Source: Boettcher and Wenzel, Linear Algebra Appl. 429 (2008) 1864.
        """
        if self.is_large:
            return 2.0 * frobenius2(self.hat(xi))
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
        return matrix_arrays.of_algebra(self, method, arguments)

    def exp_Ad_star(self, xi: Vec, mu: Vec) -> Vec:
        """sum_k ad*_xi^k mu/k!, without forming a matrix unless xi is large."""
        if self.is_large:
            return self._moved(expm1(self.hat(xi)), None if self.group._form else expm1(self.hat(-xi)), mu)
        if self.ad_size2(xi) <= 4.0:
            return mu + _series(self.ad_star, xi, mu, self.ad_size2(xi), 0.0)
        g, group = self.group.exp(xi), self.group
        back = group.exp(-xi) if group._form is None else group.inverse(g)
        return self._coadjoint(g, back, mu) - (mu - mu)  # a zero that remembers, if mu does

    def dexp(self, xi: Vec, eta: Vec) -> Vec:
        """sum_k (-ad_xi)^k eta/(k + 1)!; for large xi from its half,
        dexp_xi = (1 + Ad_exp(-xi/2))/2 dexp_(xi/2).
        """
        return self._phi(self.bracket, self._conjugated, -xi, eta)

    def dexp_dual(self, xi: Vec, mu: Vec) -> Vec:
        """sum_k (-ad*_xi)^k mu/(k + 1)!; for large xi from its half."""
        return self._phi(self.ad_star, self._coadjoint, -xi, mu)

    def dexp_inv(self, xi: Vec, eta: Vec) -> Vec:
        """eta + [xi, eta]/2 + [xi, [xi, eta]]/12 - ...; for large xi the solution of dexp_xi
        (...) = eta.
        """
        size2 = self.ad_size2(xi)
        if self.is_large:
            return _long_bernoulli_series(self.bracket, -xi, eta, size2)
        if size2 <= 1.0:
            return _bernoulli_series(self.bracket, -xi, eta, size2)
        return solve(phi1m(self.ad_matrix(-xi)), eta)

    def dexp_inv_dual(self, xi: Vec, mu: Vec) -> Vec:
        """mu + ad*_xi mu/2 + ad*_xi^2 mu/12 - ...; for large xi the solution of (dexp_xi)*
        (...) = mu.
        """
        size2 = self.ad_size2(xi)
        if self.is_large:
            return _long_bernoulli_series(self.ad_star, -xi, mu, size2)
        if size2 <= 1.0:
            return _bernoulli_series(self.ad_star, -xi, mu, size2)
        return solve(phi1m(self.ad_matrix(-xi).T), mu)

    def exp_residual(self, xi: Vec, p: Vec, mu: Vec) -> tuple[Vec, float | Mat, Mat]:
        """r = p - sum_k t_k with t_k = ad*_xi t_k-1/(k + 1), t_0 = mu; the derivative of the
        recursion gives dr/dxi.

        The derivative stops at 1e-11: Newton's method feels no less.
        """
        size2 = self.ad_size2(xi)
        if self.generated.large:
            return LieAlgebra.exp_residual(self, xi, p, mu)
        tiny, unit = digits(size2)
        k = 2.0
        term = self.ad_star(0.5 * xi, mu)
        slope, bound = 0.5 * self._ad_star_of_basis(mu), size2
        by_xi, change = slope, term
        while bound > ROUGH and k < 64.0:
            k = k + 1.0
            x = (unit / k) * xi
            slope = self._ad_star_of_columns(x, slope) + (unit / k) * self._ad_star_of_basis(term)
            term = self.ad_star(x, term)
            by_xi, change, bound = by_xi + slope, change + term, bound * (size2 / (k * k))
        while bound > tiny and k < 64.0:
            k = k + 1.0
            term = self.ad_star((unit / k) * xi, term)
            change, bound = change + term, bound * (size2 / (k * k))
        carried = mu + change if size2 <= 4.0 else self.dexp_dual(-xi, mu)
        return p - carried, 1.0, -by_xi

    def _phi(self, small: Callable[..., Vec], large: Callable[..., Vec], x: Vec, v: Vec) -> Vec:
        size2 = self.ad_size2(x)
        if size2 <= 4.0:
            return v + _series(small, x, v, size2, 1.0)
        halvings = 0.0
        while size2 > 4.0 and halvings <= LOST:
            x = 0.5 * x
            size2, halvings = self.ad_size2(x), halvings + 1.0
        if halvings > LOST:
            v, halvings = v * (INFINITE - INFINITE), 0.0
        v = v + _series(small, x, v, size2, 1.0)
        g, back = expm1(self.hat(x)), expm1(self.hat(-x))
        while halvings > 0.0:
            v = 0.5 * (v + large(plus(g, 1.0), plus(back, 1.0), v))
            g, back, halvings = 2.0 * g + g @ g, 2.0 * back + back @ back, halvings - 1.0
        return v

    def _ad_star_of_basis(self, mu: Vec) -> Mat:
        """The matrix whose columns are ad*_E_m mu."""
        terms, dim = self.generated.ad_star_terms, self.dim
        return mat(
            *[
                vec(*[_sum([scaled(c, mu[k]) for c, i, k in terms[j] if i == m]) for m in range(dim)])
                for j in range(dim)
            ]
        )

    @property
    def _ad_matrices(self) -> Any:
        """The matrices of ad E_i, of many from all brackets at once.  (dim, dim, dim)"""
        if self.dim <= AT_ONCE:
            return super()._ad_matrices
        units = np.eye(self.dim)
        matrices = np.asarray(self.bracket(units[:, None], units[None])).transpose(0, 2, 1)
        return np.where(np.abs(matrices) <= 1e-13 * np.abs(matrices).max(), 0.0, matrices)

    def ad_matrix(self, xi: Vec) -> Mat:
        terms, dim = self.generated.ad_star_terms, self.dim
        rows = [[[scaled(c, xi[i]) for c, i, k in terms[j] if k == m] for m in range(dim)] for j in range(dim)]
        return mat(*[vec(*[_sum(entry) for entry in row]) for row in rows]).T

    def _moved(self, e: Mat, back: Mat | None, mu: Vec) -> Vec:
        """Ad*_g mu from e = g - 1 and g^-1 - 1 (None: e^H), rounded relative to the change of mu.

        g^H M g^-H = M + d + (M + d) (g^-H - 1) with d = (g - 1)^H M.
        """
        m, on_the_right = self.covector(mu), e if back is None else back.H
        added = e.H @ m
        added = added + (m + added) @ on_the_right
        return mu + self.pairing(added)

    def _conjugated(self, g: Mat, back: Mat, xi: Vec) -> Vec:
        return self.vee(g @ self.hat(xi) @ back)

    def _coadjoint(self, g: Mat, back: Mat, mu: Vec) -> Vec:
        return self.pairing(adjoint(g) @ self.covector(mu) @ adjoint(back))

    def _ad_star_of_columns(self, x: Vec, columns: Mat) -> Mat:
        """The matrix whose columns are ad*_x of the columns of another."""
        dim = self.dim
        return mat(
            *[
                _sum_rows([columns[k] * scaled(c, x[i]) for c, i, k in terms], dim)
                for terms in self.generated.ad_star_terms
            ]
        )

    def dcayley(self, xi: Vec, eta: Vec) -> Vec:
        """(1 + x/2)^-1 eta (1 - x/2)^-1."""
        half = 0.5 * self.hat(-xi)
        return self.vee(solve_matrix(plus(-half, 1.0), self.hat(eta)) @ inverse(plus(half, 1.0)))

    def dcayley_dual(self, xi: Vec, mu: Vec) -> Vec:
        """The dual of (1 + x/2)^-1 eta (1 - x/2)^-1."""
        if self.dim == 3 and self.generated.few_triples:
            return solve3(self._dcayley_inv_dual(-xi), mu)
        half = adjoint(0.5 * self.hat(-xi))
        return self.pairing(solve_matrix(plus(-half, 1.0), self.covector(mu)) @ inverse(plus(half, 1.0)))

    def dcayley_inv_dual(self, xi: Vec, mu: Vec) -> Vec:
        """mu + ad*_xi mu/2 - (the dual of eta -> xi eta xi) mu/4."""
        if self.generated.few_triples:
            return self._dcayley_inv_dual(-xi) @ mu
        m = adjoint(self.hat(-xi))
        if self.is_large:
            p = self.covector(mu)
            left = m @ p
            commutator = left.without_adjoint() if self.group.keeps_lengths else left - p @ m
            return mu - self.pairing(0.5 * commutator + 0.25 * (left @ m))
        triple = self.pairing(m @ self.covector(mu) @ m)
        return mu - (0.5 * self.ad_star(-xi, mu) + 0.25 * triple)

    def cayley_residual(self, xi: Vec, p: Vec, mu: Vec) -> tuple[Vec, float | Mat, Mat]:
        """r = D p - mu with D = (dcay_xi^-1)*, right-trivialised, whose entries are polynomials of xi; dr/dp = D, and
        dr/dxi term by term.
        """
        if not self.generated.few_triples:
            return LieAlgebra.cayley_residual(self, xi, p, mu)
        by_p = self._dcayley_inv_dual(xi)
        linear, square, dim = (self.generated.ad_star_terms, self.generated.triple_dual_terms, self.dim)
        by_xi = mat(
            *[
                vec(
                    *[
                        _sum(
                            [scaled(-0.5 * c, p[k]) for c, i, k in linear[j] if i == m]
                            + [scaled(-0.25 * c, xi[b] * p[k]) for c, a, b, k in square[j] if a == m]
                            + [scaled(-0.25 * c, xi[a] * p[k]) for c, a, b, k in square[j] if b == m]
                        )
                        for m in range(dim)
                    ]
                )
                for j in range(dim)
            ]
        )
        return by_p @ p - mu, by_p, by_xi

    def _dcayley_inv_dual(self, x: Vec) -> Mat:
        """The matrix of (dcay_x^-1)*, right-trivialised, from the constants of ad* and of y -> x y x."""
        linear, square, dim = (self.generated.ad_star_terms, self.generated.triple_dual_terms, self.dim)
        return mat(
            *[
                vec(
                    *[
                        _sum(
                            ([1.0] if j == k else [])
                            + [scaled(-0.5 * c, x[i]) for c, i, col in linear[j] if col == k]
                            + [scaled(-0.25 * c, x[a] * x[b]) for c, a, b, col in square[j] if col == k]
                        )
                        for k in range(dim)
                    ]
                )
                for j in range(dim)
            ]
        )


def adjoint(m: Mat) -> Mat:
    """The conjugate transpose m^H, m^T for real entries."""
    if isinstance(m, InMemory):
        return m.H
    if isinstance(m[0, 0], Complex):
        return mat(*[vec(*[x.conjugate() for x in row]) for row in m.T])
    return m.T


def _sum(items: list[Any]) -> Any:
    return total(items) if len(items) else 0.0


def _sum_rows(rows: list[Vec], dim: int) -> Vec:
    return total(rows) if len(rows) else vec(*[0.0] * dim)


def _series(action: Callable[..., Vec], x: Vec, v: Vec, size2: float, first: float) -> Vec:
    """The sum of A^k v first!/(k + first)! for k = 1, 2, ..., A = action(x, .) with |A|^2 <= size2:
    exp(A) v - v for first = 0.
    """
    tiny, unit = digits(size2)
    k = first + 1.0
    term = action((unit / k) * x, v)
    result, bound = term, size2
    while bound > tiny and k < 64.0:
        k = k + 1.0
        term = action((unit / k) * x, term)
        result, bound = result + term, bound * (size2 / (k * k))
    return result


def _bernoulli_series(action: Callable[..., Vec], x: Vec, v: Vec, size2: float) -> Vec:
    """The sum of B_k/k! A^k v, A = action(x, .) with |A|^2 <= size2 <= 1: as many terms as that
    needs.
    """
    if is_long(value_of(size2)):
        raise InvalidType(
            "precision: the inverse of dexp is known to 16 digits only here; take Cayley() or precision='double'"
        )
    if size2 <= 0.02:
        return _bernoulli_sum(EVEN[:5], action, x, v)
    return _bernoulli_sum(EVEN, action, x, v)


def _bernoulli_sum(coefficients: tuple[float, ...], action: Callable[..., Vec], x: Vec, v: Vec) -> Vec:
    power = action(x, v)
    change = -0.5 * power
    for b in coefficients:
        power = action(x, power)
        change = change + b * power
        power = action(x, power)
    return v + change


AT_ONCE = 20
"""Beyond this dimension brackets of basis vectors are found in one call."""

FARTHEST = 20.0
"""The square of the size of ad up to which the series of dexp^-1, which ends at 2 pi, is summed up."""

FAR = (*EVEN, *[-2.0 * (1.0 + 0.25**k) / (-4.0 * math.pi**2) ** k for k in range(len(EVEN) + 1, 65)])
"""More of B_2k/(2k)! = -2 zeta(2k)/(-4 pi^2)^k, with zeta(2k) = 1 + 4^-k but for 9^-k.

Source: NIST Handbook of Mathematical Functions, 25.2.1 and 25.6.2.
"""


def _long_bernoulli_series(action: Callable[..., Vec], x: Vec, v: Vec, size2: float) -> Vec:
    """The series of Bernoulli numbers for |A|^2 up to 20.  Raises InvalidInput for larger ones."""
    raise_if(
        size2 > FARTHEST,
        "dexp_inv: a displacement of large matrices whose commutators may be longer than 4.5; take a shorter step",
    )
    power = action(x, v)
    change, bound = -0.5 * power, size2
    for k in range(len(FAR)):
        b = FAR[k]
        if bound * abs(b) <= 2.0**-56:
            break
        power = action(x, power)
        change = change + b * power
        power = action(x, power)
        bound = bound * size2
    return v + change
