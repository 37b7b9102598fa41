"""Lie groups as objects; their elements are arrays."""

from __future__ import annotations

from typing import Any, final

import numpy as np

from ..native import Mat, Record, Vec, dot, identity_matrix, mat, norm, record, solve, vec
from .lie_algebra import LieAlgebra

EPSILON = 2.0**-52

# B_k / k! of the Bernoulli numbers, k = 0, 1, 2, ... (B_1 = -1/2): the series of z/(e^z - 1).
# Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., III.4, equation (4.4).
BERNOULLI = (
    1.0,
    -1 / 2,
    1 / 12,
    0.0,
    -1 / 720,
    0.0,
    1 / 30240,
    0.0,
    -1 / 1209600,
    0.0,
    1 / 47900160,
    0.0,
    -691 / 1307674368000,
)


@record
class LieGroup(Record):
    """A Lie group acting on itself from the left: velocities are left-trivialised, xi = g^-1 g', momenta those of the body.

    Elements `g` are matrices of shape (n, n), velocities `xi` and momenta `mu` coordinate vectors of shape (dim,).

    1. A subclass writes `algebra`, `identity`, `compose`, `inverse`, `exp`, `Ad`.
    2. It may add closed forms: `log`, `Ad_star`, `exp_Ad_star`, `dexp`, `dexp_inv`, their duals, the Cayley family, `casimirs`.
    3. The rest follows.

    Differentials are right-trivialised, d/de tau(xi + e eta) = (dtau_xi eta) tau(xi); `side="left"` asks for the other,
    d/de tau(xi + e eta) = tau(xi) (dtau_xi eta).  Both maps, exp and Cayley, have tau(-xi) = tau(xi)^-1, so that the left one at
    xi is the right one at -xi.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., chapter 9; Iserles et al., Acta Numerica 9 (2000).
    """

    # ---------------------------------------------------------------- 1. a subclass writes

    @property
    def algebra(self) -> LieAlgebra:
        """The Lie algebra of the group."""
        raise NotImplementedError(f"{type(self).__name__} must define `algebra`")

    def identity(self) -> Mat:
        """The neutral element e."""
        raise NotImplementedError(f"{type(self).__name__} must define `identity`")

    def compose(self, g: Mat, h: Mat) -> Mat:
        """The product g h.  g, h : (n, n)."""
        return g @ h

    def inverse(self, g: Mat) -> Mat:
        """The inverse g^-1.  g : (n, n)."""
        raise NotImplementedError(f"{type(self).__name__} must define `inverse`")

    def exp(self, xi: Vec) -> Mat:
        """The exponential: where the constant velocity xi leads from e in unit time.  xi : (dim,)."""
        raise NotImplementedError(f"{type(self).__name__} must define `exp`")

    def Ad(self, g: Mat, xi: Vec) -> Vec:
        """The adjoint action Ad_g xi = g xi g^-1: a body velocity seen from space.  g : (n, n), xi : (dim,)."""
        raise NotImplementedError(f"{type(self).__name__} must define `Ad`")

    # ---------------------------------------------------------------- 2. closed forms are welcome

    def log(self, g: Mat) -> Vec:
        """The velocity xi with exp(xi) = g nearest to zero.  g : (n, n)."""
        raise NotImplementedError(f"{type(self).__name__} has no logarithm")

    def Ad_star(self, g: Mat, mu: Vec) -> Vec:
        """The dual of Ad, <Ad*_g mu, xi> = <mu, Ad_g xi>: a right action, Ad*_gh = Ad*_h Ad*_g.  g : (n, n), mu : (dim,)."""
        return vec(*[dot(mu, self.Ad(g, unit)) for unit in identity_matrix(self.dim)])

    def exp_Ad_star(self, xi: Vec, mu: Vec) -> Vec:
        """Ad*_exp(xi) mu, the coadjoint orbit through mu followed with velocity xi for unit time.  xi, mu : (dim,)."""
        return self.Ad_star(self.exp(xi), mu)

    def compose_exp(self, g: Mat, xi: Vec) -> Mat:
        """g exp(xi): g moved by a step with velocity xi, best written as g plus something small.  g : (n, n), xi : (dim,)."""
        return self.compose(g, self.exp(xi))

    def dexp(self, xi: Vec, eta: Vec, side: str = "right") -> Vec:
        """The trivialised differential of exp, sum_k ad_xi^k eta / (k + 1)!.  xi, eta : (dim,)."""
        x = xi if side == "right" else -xi
        term = eta
        total = eta
        k = 1.0
        while norm(term) > 0.0625 * EPSILON * norm(total):
            k = k + 1.0
            term = self.ad(x, term) / k
            total = total + term
        return total

    def dexp_inv(self, xi: Vec, eta: Vec, side: str = "right") -> Vec:
        """The inverse of `dexp`, defined while no eigenvalue of ad_xi is 2 pi i k, k != 0.  xi, eta : (dim,)."""
        return solve(mat(*[self.dexp(xi, unit, side) for unit in identity_matrix(self.dim)]).T, eta)

    def dexp_inv_dual(self, xi: Vec, mu: Vec, side: str = "right") -> Vec:
        """The dual of `dexp_inv`, <dexp_inv_dual_xi mu, eta> = <mu, dexp_inv_xi eta>.  xi, mu : (dim,)."""
        return vec(*[dot(mu, self.dexp_inv(xi, unit, side)) for unit in identity_matrix(self.dim)])

    def dexp_inv_series(self, xi: Vec, eta: Vec, terms: int, side: str = "right") -> Vec:
        """`dexp_inv` cut after ad_xi^terms: eta - [xi, eta]/2 + [xi, [xi, eta]]/12 - ...

        Converges for |ad_xi| < 2 pi.  Source: Hairer, Lubich, Wanner, III.4, equation (4.4).
        """
        x = xi if side == "right" else -xi
        power = eta
        total = eta
        for k in range(1, terms + 1):
            power = self.ad(x, power)
            if BERNOULLI[k] != 0.0:
                total = total + BERNOULLI[k] * power
        return total

    def is_exp_chart(self, xi: Vec) -> bool:
        """Is xi closer to zero than the first singularity of dexp?  A group that does not know lets all pass.  xi : (dim,)."""
        return True

    def exp_mismatch(self, xi: Vec, p: Vec, mu: Vec) -> tuple[Vec, float, Mat]:
        """How far the momentum p is from being carried by exp(xi) to mu: r = p - (dexp_xi)* mu, or a multiple of it.

        Returns r, dr/dp (a number) and dr/dxi (a matrix), for Newton's method.  xi, p, mu : (dim,).
        """
        raise NotImplementedError(f"{type(self).__name__} has no derivative of dexp")

    def cayley(self, xi: Vec) -> Mat:
        """The Cayley map (1 - xi/2)^-1 (1 + xi/2), where the algebra is closed under x y x.  xi : (dim,)."""
        raise NotImplementedError(f"{type(self).__name__} has no Cayley map")

    def cayley_inv(self, g: Mat) -> Vec:
        """The velocity xi with cayley(xi) = g.  g : (n, n)."""
        raise NotImplementedError(f"{type(self).__name__} has no Cayley map")

    def cayley_Ad_star(self, xi: Vec, mu: Vec) -> Vec:
        """Ad*_cayley(xi) mu.  xi, mu : (dim,)."""
        return self.Ad_star(self.cayley(xi), mu)

    def compose_cayley(self, g: Mat, xi: Vec) -> Mat:
        """g cayley(xi), best written as g plus something small.  g : (n, n), xi : (dim,)."""
        return self.compose(g, self.cayley(xi))

    def dcayley(self, xi: Vec, eta: Vec, side: str = "right") -> Vec:
        """The trivialised differential of the Cayley map.  xi, eta : (dim,)."""
        return solve(mat(*[self.dcayley_inv(xi, unit, side) for unit in identity_matrix(self.dim)]).T, eta)

    def dcayley_inv(self, xi: Vec, eta: Vec, side: str = "right") -> Vec:
        """The inverse of `dcayley`, eta - [xi, eta]/2 - xi eta xi/4 as matrices.  xi, eta : (dim,)."""
        raise NotImplementedError(f"{type(self).__name__} has no Cayley map")

    def dcayley_inv_dual(self, xi: Vec, mu: Vec, side: str = "right") -> Vec:
        """The dual of `dcayley_inv`.  xi, mu : (dim,)."""
        return vec(*[dot(mu, self.dcayley_inv(xi, unit, side)) for unit in identity_matrix(self.dim)])

    def cayley_mismatch(self, xi: Vec, p: Vec, mu: Vec) -> tuple[Vec, float, Mat]:
        """r = p - (dcayley_xi)* mu, or a multiple of it, with dr/dp and dr/dxi as in `exp_mismatch`.  xi, p, mu : (dim,)."""
        raise NotImplementedError(f"{type(self).__name__} has no Cayley map")

    def casimirs(self, mu: Vec) -> Vec:
        """Functions of the momentum that every motion keeps, whatever the Hamiltonian; none known by default.  mu : (dim,)."""
        return vec()

    def objection(self, g: np.ndarray) -> str | None:
        """Why an array is not an element of the group, with the number that is wrong; None if it is.  g : (..., n, n)."""
        return None

    # ---------------------------------------------------------------- 3. what follows

    @final
    def contains(self, g: np.ndarray) -> bool:
        """Is every matrix of the array an element of the group, to the accuracy of `objection`?  g : (..., n, n)."""
        return self.objection(np.asarray(g, dtype=float)) is None

    @property
    def dim(self) -> int:
        """The dimension of the group."""
        return self.algebra.dim

    @final
    def ad(self, xi: Vec, eta: Vec) -> Vec:
        """ad_xi eta = [xi, eta].  xi, eta : (dim,)."""
        return self.algebra.bracket(xi, eta)

    @final
    def ad_star(self, xi: Vec, mu: Vec) -> Vec:
        """The dual of ad, <ad*_xi mu, eta> = <mu, [xi, eta]>.  xi, mu : (dim,)."""
        return self.algebra.ad_star(xi, mu)

    @final
    def K(self, g: Mat, mu: Vec) -> Vec:
        """The left coadjoint action K_g = Ad*_{g^-1}: a body momentum seen from space.  g : (n, n), mu : (dim,)."""
        return self.Ad_star(self.inverse(g), mu)

    def _shape(self, argument: str, axes: int) -> tuple[int, ...] | None:
        return (self.dim,) if axes == 1 else self.identity().shape

    def _objection(self, argument: str, value: Any) -> str | None:
        if argument == "side" and value not in ("right", "left"):
            return f'is "right" or "left"; got {value!r}'
        if argument in ("g", "h"):
            with np.errstate(over="ignore"):
                objection = self.objection(value)
            return objection and f"is not in {self!r}: {objection}"
        return None
