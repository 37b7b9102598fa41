"""Lie algebras: the vector space of velocities, its bracket, and what follows from them."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, final

import numpy as np

from ..errors import InvalidType, LawViolation, NotDefined, undefined
from ..formulas import Mat, Record, Vec, dot, identity_matrix, jacobian, mat, norm, record, solve, sum, vec
from ..formulas.classes.derived import derived
from ..formulas.classes.signatures import bare
from ..formulas.numbers.dual import value_of
from .ad_series import bernoulli_series, exponential_series, mean
from .bernoulli import TERMS
from .matrices.matrix_functions import expm, phi1m

SHORT = 4.0
"""Series of ad_xi are summed as they stand where |ad_xi| is no larger; beyond, their terms cancel.

There exp(ad_xi) and its mean come from matrices, by halving and squaring.
"""

Constants = tuple[tuple[tuple[float, ...], ...], ...]


@record
class LieAlgebra(Record):
    """A real Lie algebra, in coordinates with respect to a basis E_1, ..., E_dim.

    Its elements, velocities, are coordinate vectors `xi` of shape (dim,).  The elements of its
    dual, momenta, are coordinate vectors `mu` with respect to the dual basis, so that the pairing
    <mu, xi> is the scalar product.

    must:     `dim`, and `bracket` or `structure_constants`
    may:      closed forms of everything in part 2
    follows:  part 3

    What depends on velocities and momenta alone is found here: ad, the differential dexp of the
    exponential, exp of ad*, and, for algebras of matrices closed under x y x, the differential
    dcayley of the Cayley map of the matrices hat(xi).  Maps to the group are found there.

    Differentials are left-trivialised, as velocities are: d/de exp(xi + e eta) = exp(xi)
    (dexp_xi eta).  Both maps tau, exp and Cayley, have tau(-xi) = tau(xi)^-1, so that the
    right-trivialised differential of many books, d/de exp(xi + e eta) = (dexp_xi eta) exp(xi), is
    the one at -xi.  Formulas know the left side alone; who asks a group, or for a matrix, may say
    `side="right"`.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., sections 9.1, 13.1
    and 14.1; Iserles et al., Acta Numerica 9 (2000), section 2.6.
    """

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        refuse_sides(cls, LieAlgebra)

    # ---------------------------------------------------------------- 1. a subclass writes

    @property
    def dim(self) -> int:
        """The dimension of the algebra and of its group."""
        raise undefined(self, "dim")

    @cached_property
    @derived
    def structure_constants(self) -> Constants:
        """c[k][i][j] with [E_i, E_j] = sum_k c[k][i][j] E_k, as nested tuples of numbers."""
        if type(self).bracket is LieAlgebra.bracket:
            raise NotDefined(f"{type(self).__name__} must define `bracket` or `structure_constants`")
        units = list(identity_matrix(self.dim))
        c = np.array([[self.bracket(a, b) for b in units] for a in units], dtype=float)
        return tuple(tuple(tuple(row) for row in plane) for plane in c.transpose(2, 0, 1).tolist())

    @derived
    def bracket(self, xi: Vec, eta: Vec) -> Vec:
        """The Lie bracket, [xi, eta]^k = c^k_ij xi^i eta^j.  xi, eta : (dim,)."""
        return vec(*[_bilinear(c, xi, eta) for c in self.structure_constants])

    # ---------------------------------------------------------------- 2. closed forms are welcome

    @derived
    def ad_star(self, xi: Vec, mu: Vec) -> Vec:
        """The dual of the bracket, <ad*_xi mu, eta> = <mu, [xi, eta]>, the plain transpose of
        ad_xi.

        Momenta obey the Euler-Poincare equation mu' = ad*_xi mu.  xi, mu : (dim,).
        """
        return vec(*[dot(mu, self.bracket(xi, unit)) for unit in identity_matrix(self.dim)])

    @derived
    def ad_matrix(self, xi: Vec) -> Mat:
        """The matrix of ad_xi: ad_matrix(xi) @ eta = [xi, eta].  xi : (dim,), returns (dim, dim)."""
        return mat(*[self.bracket(xi, unit) for unit in identity_matrix(self.dim)]).T

    def hat(self, xi: Vec) -> Mat:
        """The matrix that represents xi, for algebras of matrices.  xi : (dim,)."""
        raise NotDefined(f"{type(self).__name__} is not given as an algebra of matrices")

    def vee(self, matrix: Mat) -> Vec:
        """The coordinates of a matrix of the algebra: the inverse of `hat`."""
        raise NotDefined(f"{type(self).__name__} is not given as an algebra of matrices")

    # the exponential

    @derived
    def exp_Ad_star(self, xi: Vec, mu: Vec) -> Vec:
        """Ad*_exp(xi) mu = exp(ad*_xi) mu, the coadjoint orbit followed with velocity xi for unit
        time.

        xi, mu : (dim,).
        """
        if self.ad_size(xi) <= SHORT:
            return exponential_series(self.ad_star, xi, mu)
        return mu @ expm(self.ad_matrix(xi))

    @derived
    def dexp(self, xi: Vec, eta: Vec) -> Vec:
        """The differential of exp, left-trivialised, sum_k (-ad_xi)^k eta/(k + 1)!.  xi,
        eta : (dim,).
        """
        if self.ad_size(xi) <= SHORT:
            return mean(self.bracket, -xi, eta)
        return phi1m(self.ad_matrix(-xi)) @ eta

    @derived
    def dexp_dual(self, xi: Vec, mu: Vec) -> Vec:
        """The dual of `dexp`, <dexp_dual_xi mu, eta> = <mu, dexp_xi eta>.  xi, mu : (dim,)."""
        if self.ad_size(xi) <= SHORT:
            return mean(self.ad_star, -xi, mu)
        return mu @ phi1m(self.ad_matrix(-xi))

    @derived
    def dexp_inv(self, xi: Vec, eta: Vec) -> Vec:
        """The inverse of `dexp`, defined while no eigenvalue of ad_xi is 2 pi i k, k != 0.

        xi, eta : (dim,).
        """
        return solve(phi1m(self.ad_matrix(-xi)), eta)

    @derived
    def dexp_inv_dual(self, xi: Vec, mu: Vec) -> Vec:
        """The dual of `dexp_inv`, <dexp_inv_dual_xi mu, eta> = <mu, dexp_inv_xi eta>.  xi,
        mu : (dim,).
        """
        return solve(phi1m(self.ad_matrix(-xi)).T, mu)

    @derived
    def dexp_inv_series(self, xi: Vec, eta: Vec, terms: int) -> Vec:
        """`dexp_inv` cut after ad_xi^terms: eta + [xi, eta]/2 + [xi, [xi, eta]]/12 - ...

        Converges for |ad_xi| < 2 pi.  xi, eta : (dim,).  Source: Hairer, Lubich, Wanner, III.4,
        equation (4.4), at -xi.
        """
        return bernoulli_series(self.bracket, -xi, eta, terms)

    def is_exp_chart(self, xi: Vec) -> bool:
        """Whether xi is closer to zero than the first singularity of dexp.  xi : (dim,).

        An algebra that does not know lets all pass; one that does raises OutsideChart in `dexp_inv` from there on.
        """
        return True

    @derived
    def exp_residual(self, xi: Vec, p: Vec, mu: Vec) -> tuple[Vec, float | Mat, Mat]:
        """How far the momentum p is from being carried by exp(xi) to mu: r = p - (dexp_xi)* mu,
        right-trivialised, or a multiple.

        Returns r, dr/dp (a number or a matrix) and dr/dxi (a matrix), for Newton's method.
        xi, p, mu : (dim,).
        """
        if type(self).dexp_dual is LieAlgebra.dexp_dual:  # the derivative is taken of the sum alone
            by_xi = jacobian(lambda x: -1.0 * mean(self.ad_star, x, mu), xi)
        else:
            by_xi = jacobian(lambda x: -1.0 * self.dexp_dual(-x, mu), xi)
        return p - self.dexp_dual(-xi, mu), 1.0, by_xi

    # the Cayley map (1 - x/2)^-1 (1 + x/2) of the matrices x = hat(xi)

    @derived
    def cayley_Ad_star(self, xi: Vec, mu: Vec) -> Vec:
        """Ad*_cay(xi) mu = mu + ad*_xi (dcay_xi)* mu, right-trivialised.  xi, mu : (dim,)."""
        return mu + self.ad_star(xi, self.dcayley_dual(-xi, mu))

    @derived
    def dcayley(self, xi: Vec, eta: Vec) -> Vec:
        """The differential of the Cayley map, left-trivialised.  xi, eta : (dim,)."""
        units = identity_matrix(self.dim)
        return solve(mat(*[self.dcayley_inv(xi, unit) for unit in units]).T, eta)

    @derived
    def dcayley_dual(self, xi: Vec, mu: Vec) -> Vec:
        """The dual of `dcayley`.  xi, mu : (dim,)."""
        units = identity_matrix(self.dim)
        return solve(mat(*[self.dcayley_inv_dual(xi, unit) for unit in units]).T, mu)

    @derived
    def dcayley_inv(self, xi: Vec, eta: Vec) -> Vec:
        """The inverse of `dcayley`, eta + [xi, eta]/2 - xi eta xi/4 as matrices.  xi, eta : (dim,)."""
        m = self.hat(-xi)
        return eta - (0.5 * self.bracket(-xi, eta) + 0.25 * self.vee(m @ self.hat(eta) @ m))

    @derived
    def dcayley_inv_dual(self, xi: Vec, mu: Vec) -> Vec:
        """The dual of `dcayley_inv`.  xi, mu : (dim,)."""
        return vec(*[dot(mu, self.dcayley_inv(xi, unit)) for unit in identity_matrix(self.dim)])

    @derived
    def cayley_residual(self, xi: Vec, p: Vec, mu: Vec) -> tuple[Vec, float | Mat, Mat]:
        """r = (dcayley_xi^-1)* p - mu, right-trivialised, or an equation with the same roots, as in
        `exp_residual`.

        xi, p, mu : (dim,).
        """
        by_p = mat(*[self.dcayley_inv_dual(-xi, unit) for unit in identity_matrix(self.dim)]).T
        return by_p @ p - mu, by_p, jacobian(lambda x: self.dcayley_inv_dual(-x, p), xi)

    # ---------------------------------------------------------------- 3. what follows

    @final
    def ad(self, xi: Vec, eta: Vec) -> Vec:
        """The adjoint representation, ad_xi eta = [xi, eta].  xi, eta : (dim,)."""
        return self.bracket(xi, eta)

    @final
    def dexp_matrix(self, xi: Vec, side: str = "left") -> Mat:
        """The matrix of `dexp`: exp(xi + d) = exp(xi) exp(dexp_matrix(xi) @ d + ...), for small d.

        With side="right" exp(xi + d) = exp(dexp_matrix(xi, side="right") @ d + ...) exp(xi).
        Robotics names Jacobians by the side on which the small element stands and not by the
        trivialisation: its right Jacobian is this matrix, and its left Jacobian that of
        side="right".

        xi : (dim,);  returns (dim, dim).  Source: Sola, Deray and Atchuthan, A micro Lie theory for
        state estimation in robotics (2018), equations (67) and (71).
        """
        return _columns(self.dexp, sided(xi, side))

    @final
    def dexp_inv_matrix(self, xi: Vec, side: str = "left") -> Mat:
        """The matrix of `dexp_inv`: log(exp(xi) exp(d)) = xi + dexp_inv_matrix(xi) @ d + ..., for
        small d.

        With side="right" log(exp(d) exp(xi)) = xi + dexp_inv_matrix(xi, side="right") @ d + ...
        xi : (dim,);  returns (dim, dim).  Raises OutsideChart where `dexp_inv` does.
        """
        return _columns(self.dexp_inv, sided(xi, side))

    @final
    def dcayley_matrix(self, xi: Vec, side: str = "left") -> Mat:
        """The matrix of `dcayley`.  xi : (dim,);  returns (dim, dim)."""
        return _columns(self.dcayley, sided(xi, side))

    @final
    def ad_size(self, xi: Vec) -> float:
        """A bound for the Euclidean norm of ad_xi, the sum of |xi_i| |ad E_i|.  xi : (dim,)."""
        return sum([size * abs(value_of(x)) for x, size in zip(xi, self._ad_sizes)])

    @cached_property
    def _ad_sizes(self) -> tuple[float, ...]:
        """The Frobenius norms of ad E_i, without derivatives by parameters of the algebra."""
        units = identity_matrix(self.dim)
        return tuple([norm(vec(*[value_of(x) for unit in units for x in self.bracket(e, unit)])) for e in units])

    @final
    def poisson_structure(self, mu: Vec) -> Mat:
        """The minus Lie-Poisson structure matrix, B_ij(mu) = -c^k_ij mu_k: mu' = B(mu) grad H(mu).
        mu : (dim,), B : (dim, dim).
        """
        return mat(*[self.ad_star(unit, mu) for unit in identity_matrix(self.dim)]).T

    @final
    @cached_property
    def basis(self) -> np.ndarray:
        """The matrices E_i = hat(e_i), for algebras of matrices.  (dim, n, n)"""
        return np.array([np.array(self.hat(unit)) for unit in identity_matrix(self.dim)])

    @final
    @cached_property
    def killing_form(self) -> np.ndarray:
        """The Killing form, K_ij = tr(ad_i ad_j): nondegenerate if and only if the algebra is
        semisimple.  (dim, dim)

        Source: Marsden and Ratiu, section 9.1; Cartan's criterion.
        """
        ad = self._ad_matrices
        return np.einsum("iab,jba->ij", ad, ad)

    @cached_property
    @derived
    def invariant_form(self) -> np.ndarray | None:
        """A nondegenerate symmetric form that ad leaves alone, ([x, y], z) = (x, [y, z]); None if
        there is none.  (dim, dim)

        The Killing form of a semisimple algebra, scaled so that its largest entry is 1 and its sign
        that of -Killing; otherwise what the linear equations for a form leave: the Klein form w.v
        on se(3), any form on an abelian algebra, nothing on the Heisenberg algebra.
        """
        from .matrices.matrix_invariants import null_space  # which builds on algebras of matrices

        n, killing, matrices = self.dim, self.killing_form, self._ad_matrices
        units = like_units(matrices)
        # of the generators in these units
        ad = matrices * units[:, None, None] * units / units[:, None]
        if _nondegenerate(np.einsum("iab,jba->ij", ad, ad)):
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
        # one with the fewest entries: a sum of several, as w.v + w.w, would add up units
        for weights in null_space(equations.reshape(len(pairs), -1).T):
            form = np.einsum("p,pab->ab", weights, forms)
            if _nondegenerate(form):
                return _in_units(form, units)
        for weights in np.random.default_rng(1).normal(size=(4 if len(kernel) else 0, len(kernel))):
            # a generic member of the family: degenerate only if all are
            form = np.einsum("k,kab->ab", weights, kernel)
            if _nondegenerate(form):
                return _in_units(form, units)
        return None

    @property
    @derived
    def _ad_matrices(self) -> np.ndarray:
        """The matrices of ad E_i.  (dim, dim, dim), first axis i"""
        units = list(identity_matrix(self.dim))
        c = np.array([[self.bracket(a, b) for b in units] for a in units], dtype=float)
        return c.transpose(0, 2, 1)

    @final
    def check(self) -> None:
        """Verify that the bracket is antisymmetric and obeys the Jacobi identity, to rounding.

        c^k_ij = -c^k_ji and c^a_ib c^b_jk + cyclic(i, j, k) = 0.  Raises LawViolation with the
        largest defect and where it is.
        """
        basis = list(identity_matrix(self.dim))
        # c[i, j] = [E_i, E_j]
        c = np.array([[self.bracket(a, b) for b in basis] for a in basis], dtype=float)
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

    def _objection(self, argument: str, value: Any) -> str | None:
        return objection(argument, value)

    def _shape(self, argument: str, kind: str) -> tuple[int, ...] | None:
        return (self.dim,) if kind == "Vec" else self._matrix_shape

    @cached_property
    def _matrix_shape(self) -> tuple[int, ...] | None:
        """The shape of the matrices hat(xi), where there are such."""
        try:
            return np.shape(self.hat(vec(*[0.0] * self.dim)))
        except NotDefined:
            return None


def objection(argument: str, value: Any) -> str | None:
    """Why a side or a number of terms is none, in words; None if it is."""
    if argument == "side" and not (isinstance(value, str) and value in ("right", "left")):
        return f'is "right" or "left"; got {value!r}'
    if argument == "terms" and not 0 <= value <= TERMS:
        return f"must be from 0 to {TERMS}; got {value if abs(value) < 10**20 else 'a huge number'}"
    return None


def sided(xi: Vec, side: str) -> Vec:
    """Where a left-trivialised differential is taken: the right-trivialised one at xi is that at -xi."""
    return xi if side == "left" else -xi


def refuse_sides(cls: type, base: type) -> None:
    """Raise InvalidType for a formula of a subclass that has a side, where that of `base` has none."""
    for name, formula in vars(cls).items():
        if _has_side(formula) and callable(getattr(base, name, None)) and not _has_side(getattr(base, name)):
            raise InvalidType(
                f"{cls.__name__}.{name} takes `side`: formulas of differentials are left-trivialised, "
                "and the right-trivialised one is asked for at -xi; leave `side` out, and write "
                'what stood for side="left"'
            )


def _has_side(formula: Any) -> bool:
    code = getattr(bare(formula), "__code__", None)
    return code is not None and "side" in code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]


def _columns(formula: Callable[[Vec, Vec], Vec], xi: Vec) -> Mat:
    """The matrix of a formula that is linear in its second argument."""
    return mat(*[formula(xi, unit) for unit in identity_matrix(len(xi))]).T


def like_units(ad: np.ndarray) -> np.ndarray:
    """Powers of two u for which the generators u_i E_i have structure constants of like sizes.
    ad : (dim, dim, dim), the matrices of ad E_i;  returns (dim,)

    log |c^k_ij| + log u_i + log u_j - log u_k is made small by least squares.
    """
    i, k, j = np.nonzero(ad)
    ways = np.zeros((len(i), len(ad)))
    for column, sign in ((i, 1.0), (j, 1.0), (k, -1.0)):
        np.add.at(ways, (np.arange(len(i)), column), sign)
    exponents = np.linalg.lstsq(ways, -np.log2(np.abs(ad[i, k, j])), rcond=None)[0]
    return np.exp2(np.round(exponents))


def _in_units(form: np.ndarray, units: np.ndarray) -> np.ndarray:
    """A form of the generators u_i E_i as one of the E_i, with 1 as its largest entry."""
    form = form / np.outer(units, units)
    return form / np.abs(form).max()


def _nondegenerate(form: np.ndarray) -> bool:
    sizes = np.linalg.svd(form, compute_uv=False)
    return bool(len(sizes) and sizes[-1] > 1e-10 * sizes[0])


def _bilinear(c: tuple[tuple[float, ...], ...], xi: Vec, eta: Vec) -> float:
    """sum_ij c_ij xi^i eta^j over the constants that are not zero."""
    places = [(i, j) for i in range(len(xi)) for j in range(len(eta)) if c[i][j] != 0.0]
    return sum([c[i][j] * (xi[i] * eta[j]) for i, j in places])
