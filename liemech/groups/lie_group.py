"""Lie groups as objects; their elements are arrays."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property
from typing import Any, final

import numpy as np

from ..errors import IncompatibleSystem, NotDefined
from ..formulas import Ambient, Element, Mat, Record, Vec, dot, identity_matrix, jacobian, mat, record, solve, sqrt, vec
from ..formulas.broadcasting import MEMBERSHIP as MEMBERSHIP
from ..formulas.broadcasting import small
from ..formulas.dual import size_of
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

    Elements `g` are arrays, for most groups matrices of shape (n, n); velocities `xi` and momenta `mu` are coordinate vectors of
    shape (dim,).

    1. A subclass writes `algebra`, `identity`, `inverse`, `exp`, `Ad`, and `compose` unless that is the matrix product.
       (A group of matrices is easier made from generators alone: `MatrixLieGroup`.)
    2. It may add closed forms: `log`, `Ad_star`, `exp_Ad_star`, `compose_exp`, `dexp`, `dexp_inv` and their duals, the Cayley
       family, `casimirs` and `further_invariants`, `defect`, `nearest`, `random`.
    3. The rest follows.

    Differentials are right-trivialised, d/de tau(xi + e eta) = (dtau_xi eta) tau(xi); `side="left"` asks for the other,
    d/de tau(xi + e eta) = tau(xi) (dtau_xi eta).  Both maps, exp and Cayley, have tau(-xi) = tau(xi)^-1, so that the left one at
    xi is the right one at -xi.  `check_group` verifies all that a subclass writes.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., chapter 9; Iserles et al., Acta Numerica 9 (2000).
    """

    # ---------------------------------------------------------------- 1. a subclass writes

    @property
    def algebra(self) -> LieAlgebra:
        """The Lie algebra of the group."""
        raise NotDefined(f"{type(self).__name__} must define `algebra`")

    def identity(self) -> Element:
        """The neutral element e."""
        raise NotDefined(f"{type(self).__name__} must define `identity`")

    def compose(self, g: Element, h: Element) -> Element:
        """The product g h.  g, h : elements."""
        return g @ h

    def inverse(self, g: Element) -> Element:
        """The inverse g^-1.  g : an element."""
        raise NotDefined(f"{type(self).__name__} must define `inverse`")

    def exp(self, xi: Vec) -> Element:
        """The exponential: where the constant velocity xi leads from e in unit time.  xi : (dim,)."""
        raise NotDefined(f"{type(self).__name__} must define `exp`")

    def Ad(self, g: Element, xi: Vec) -> Vec:
        """The adjoint action Ad_g xi = g xi g^-1: a body velocity seen from space.  g : an element, xi : (dim,)."""
        raise NotDefined(f"{type(self).__name__} must define `Ad`")

    # ---------------------------------------------------------------- 2. closed forms are welcome

    def log(self, g: Element) -> Vec:
        """The velocity xi with exp(xi) = g nearest to zero.  g : an element."""
        raise NotDefined(f"{type(self).__name__} has no logarithm")

    def Ad_star(self, g: Element, mu: Vec) -> Vec:
        """The dual of Ad, <Ad*_g mu, xi> = <mu, Ad_g xi>: a right action, Ad*_gh = Ad*_h Ad*_g.  g : an element, mu : (dim,)."""
        return vec(*[dot(mu, self.Ad(g, unit)) for unit in identity_matrix(self.dim)])

    def exp_Ad_star(self, xi: Vec, mu: Vec) -> Vec:
        """Ad*_exp(xi) mu, the coadjoint orbit through mu followed with velocity xi for unit time.  xi, mu : (dim,)."""
        return self.Ad_star(self.exp(xi), mu)

    def compose_exp(self, g: Element, xi: Vec) -> Element:
        """g exp(xi): g moved by a step with velocity xi, best written as g plus something small.  g : an element, xi : (dim,)."""
        return self.compose(g, self.exp(xi))

    def dexp(self, xi: Vec, eta: Vec, side: str = "right") -> Vec:
        """The trivialised differential of exp, sum_k ad_xi^k eta / (k + 1)!; for large xi from its half.  xi, eta : (dim,)."""
        x = xi if side == "right" else -xi
        return _average(self.ad, self._exp_Ad, self.algebra.ad_size(x), x, eta)

    def dexp_dual(self, xi: Vec, mu: Vec, side: str = "right") -> Vec:
        """The dual of `dexp`, <dexp_dual_xi mu, eta> = <mu, dexp_xi eta>.  xi, mu : (dim,)."""
        x = xi if side == "right" else -xi
        return _average(self.ad_star, self.exp_Ad_star, self.algebra.ad_size(x), x, mu)

    def _exp_Ad(self, xi: Vec, eta: Vec) -> Vec:
        return self.Ad(self.exp(xi), eta)

    def dexp_inv(self, xi: Vec, eta: Vec, side: str = "right") -> Vec:
        """The inverse of `dexp`, defined while no eigenvalue of ad_xi is 2 pi i k, k != 0.  xi, eta : (dim,)."""
        return solve(mat(*[self.dexp(xi, unit, side) for unit in identity_matrix(self.dim)]).T, eta)

    def dexp_inv_dual(self, xi: Vec, mu: Vec, side: str = "right") -> Vec:
        """The dual of `dexp_inv`, <dexp_inv_dual_xi mu, eta> = <mu, dexp_inv_xi eta>.  xi, mu : (dim,)."""
        return solve(mat(*[self.dexp_dual(xi, unit, side) for unit in identity_matrix(self.dim)]).T, mu)

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

    def body_velocity(self, g: Element, rate: Ambient) -> Vec:
        """The velocity xi with g' = g xi, from the rate g' of a moving element.  g : an element, rate : of the same shape."""
        if not isinstance(rate, Mat):  # type: ignore[misc]
            raise NotDefined(f"{type(self).__name__}, whose elements are vectors, must define `body_velocity`")
        return self.algebra.vee(self.inverse(g) @ rate)

    def is_exp_chart(self, xi: Vec) -> bool:
        """Is xi closer to zero than the first singularity of dexp?  A group that does not know lets all pass.  xi : (dim,)."""
        return True

    def exp_mismatch(self, xi: Vec, p: Vec, mu: Vec) -> tuple[Vec, float | Mat, Mat]:
        """How far the momentum p is from being carried by exp(xi) to mu: r = p - (dexp_xi)* mu, or a multiple of it.

        Returns r, dr/dp (a number or a matrix) and dr/dxi (a matrix), for Newton's method.  xi, p, mu : (dim,).
        """
        if type(self).dexp_dual is LieGroup.dexp_dual:  # of the sum alone: exp need not be differentiated
            return p - self.dexp_dual(xi, mu), 1.0, jacobian(lambda x: -1.0 * _mean(self.ad_star, x, mu), xi)
        return p - self.dexp_dual(xi, mu), 1.0, jacobian(lambda x: -1.0 * self.dexp_dual(x, mu), xi)

    def why_no_cayley(self) -> str | None:
        """Why the group has no Cayley map; None if it has one."""
        return f"{type(self).__name__} does not define one" if type(self).cayley is LieGroup.cayley else None

    def cayley(self, xi: Vec) -> Element:
        """The Cayley map (1 - xi/2)^-1 (1 + xi/2), where the algebra is closed under x y x.  xi : (dim,)."""
        raise IncompatibleSystem(f"{type(self).__name__} has no Cayley map: {self.why_no_cayley()}")

    def cayley_inv(self, g: Element) -> Vec:
        """The velocity xi with cayley(xi) = g.  g : an element."""
        raise IncompatibleSystem(f"{type(self).__name__} has no Cayley map: {self.why_no_cayley()}")

    def cayley_Ad_star(self, xi: Vec, mu: Vec) -> Vec:
        """Ad*_cayley(xi) mu.  xi, mu : (dim,)."""
        return self.Ad_star(self.cayley(xi), mu)

    def compose_cayley(self, g: Element, xi: Vec) -> Element:
        """g cayley(xi), best written as g plus something small.  g : an element, xi : (dim,)."""
        return self.compose(g, self.cayley(xi))

    def dcayley(self, xi: Vec, eta: Vec, side: str = "right") -> Vec:
        """The trivialised differential of the Cayley map.  xi, eta : (dim,)."""
        return solve(mat(*[self.dcayley_inv(xi, unit, side) for unit in identity_matrix(self.dim)]).T, eta)

    def dcayley_dual(self, xi: Vec, mu: Vec, side: str = "right") -> Vec:
        """The dual of `dcayley`.  xi, mu : (dim,)."""
        return solve(mat(*[self.dcayley_inv_dual(xi, unit, side) for unit in identity_matrix(self.dim)]).T, mu)

    def dcayley_inv(self, xi: Vec, eta: Vec, side: str = "right") -> Vec:
        """The inverse of `dcayley`, eta - [xi, eta]/2 - xi eta xi/4 as matrices.  xi, eta : (dim,)."""
        raise IncompatibleSystem(f"{type(self).__name__} has no Cayley map: {self.why_no_cayley()}")

    def dcayley_inv_dual(self, xi: Vec, mu: Vec, side: str = "right") -> Vec:
        """The dual of `dcayley_inv`.  xi, mu : (dim,)."""
        return vec(*[dot(mu, self.dcayley_inv(xi, unit, side)) for unit in identity_matrix(self.dim)])

    def cayley_mismatch(self, xi: Vec, p: Vec, mu: Vec) -> tuple[Vec, float | Mat, Mat]:
        """r = (dcayley_xi^-1)* p - mu, or an equation with the same roots, with dr/dp and dr/dxi as in `exp_mismatch`.

        xi, p, mu : (dim,).
        """
        by_p = mat(*[self.dcayley_inv_dual(xi, unit) for unit in identity_matrix(self.dim)]).T
        return by_p @ p - mu, by_p, jacobian(lambda x: self.dcayley_inv_dual(x, p), xi)

    def casimirs(self, mu: Vec) -> Vec:
        """Functions of the momentum that every motion keeps, whatever the Hamiltonian; none known by default.  mu : (dim,)."""
        return vec()

    @property
    def unit_blocks(self) -> tuple[int, ...]:
        """How many components in a row share a physical unit: (3, 3) on SE(3), angular and linear momenta."""
        return (self.dim,)

    def further_invariants(self, mu: Any) -> tuple[float, ...] | None:
        """What tells the coadjoint orbit through mu from others of its dimension with the same Casimirs; () if there are none.

        None, the default: the group does not know.  mu : (dim,).
        """
        return None

    def defect(self, g: Ambient) -> float:
        """How far an array is from being an element, relative to an element's size; 0 on the group.  g : shaped like an element.

        A group that does not know takes every array for an element.
        """
        return 0.0

    def objection(self, g: np.ndarray) -> str | None:
        """Why an array is not an element, in words; None if it is.  g : one array, shaped like an element."""
        defect = self.defect(small(g))
        return None if defect <= MEMBERSHIP else f"it is off the group by {defect:.1e}, more than {MEMBERSHIP:.0e}"

    def scale(self, g: Element | None) -> Vec:
        """The displacements that count as large at g (None: anywhere), for the error control of adaptive steps: 1 by default.

        g : an element.  Returns (dim,).
        """
        return vec(*[1.0 for _ in range(self.dim)])

    def nearest(self, g: Ambient) -> Element:
        """An element close to an array that has drifted off the group.  Never called by an integrator.  g : like an element."""
        raise NotDefined(f"{type(self).__name__} does not know the element nearest to an array")

    def random(self, rng: np.random.Generator | int | None = None, size: int | tuple[int, ...] = ()) -> np.ndarray:
        """Random elements: exp of normally distributed velocities, or Haar measure where a group knows better.

        rng : a generator or a seed.  size : leading axes.
        """
        shape = (size,) if isinstance(size, int) else tuple(size)
        return np.array(self.exp(np.random.default_rng(rng).normal(size=(*shape, self.dim))))

    # ---------------------------------------------------------------- 3. what follows

    @final
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
    def K(self, g: Element, mu: Vec) -> Vec:
        """The left coadjoint action K_g = Ad*_{g^-1}: a body momentum seen from space.  g : an element, mu : (dim,)."""
        return self.Ad_star(self.inverse(g), mu)

    @final
    def contains(self, g: Ambient) -> bool:
        """Is an array an element, up to rounding?  Its `defect` is at most 1e-6.  g : shaped like an element."""
        return self.defect(g) <= MEMBERSHIP

    @final
    def distance(self, g: Element, h: Element) -> float:
        """|log(g^-1 h)|: the length of the velocity that leads from g to h in unit time.  g, h : elements."""
        xi = self.log(self.compose(self.inverse(g), h))
        return sqrt(dot(xi, xi))

    @cached_property
    def element_shape(self) -> tuple[int, ...]:
        """The shape of the arrays that are elements."""
        return np.array(self.identity()).shape

    @cached_property
    def _sizes(self) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """The shapes of a velocity and of an element."""
        return (self.dim,), self.element_shape

    @cached_property
    def is_complex(self) -> bool:
        """Do elements have complex entries?"""
        return np.iscomplexobj(np.array(self.identity()))

    def _shape(self, argument: str, kind: str) -> tuple[int, ...] | None:
        return (self.dim,) if kind == "Vec" else self.element_shape

    def _complex(self, kind: str) -> bool:
        return kind in ("Mat", "Element", "Ambient") and self.is_complex

    def _objection(self, argument: str, value: Any) -> str | None:
        if argument == "side" and not (isinstance(value, str) and value in ("right", "left")):
            return f'is "right" or "left"; got {value!r}'
        if argument == "terms" and not 0 <= value < len(BERNOULLI):
            return f"must be from 0 to {len(BERNOULLI) - 1}; got {value if abs(value) < 10**20 else 'a huge number'}"
        if isinstance(value, np.ndarray):  # asked of elements
            with np.errstate(all="ignore"):
                objection = self.objection(value)
            return objection and f"is not in {self!r}: {objection}"
        return None


def _average(ad: Callable[[Vec, Vec], Vec], exp_ad: Callable[[Vec, Vec], Vec], size: float, x: Vec, v: Vec) -> Vec:
    """sum_k ad_x^k v/(k + 1)!: the mean of exp(s ad_x) v over 0 <= s <= 1.  exp_ad : exp(ad_x) v.  size : a bound for |ad_x|.

    Terms of a large x cancel; it is halved, and the mean over the whole found from that over its half: (1 + exp(ad_x/2))/2 times.
    """
    halvings = 0.0
    while 4.0 < size < math.inf:
        x, size, halvings = 0.5 * x, 0.5 * size, halvings + 1.0
    total = _mean(ad, x, v)
    while halvings > 0.0:
        total = 0.5 * (total + exp_ad(x, total))
        x, halvings = 2.0 * x, halvings - 1.0
    return total


def _mean(ad: Callable[[Vec, Vec], Vec], x: Vec, v: Vec) -> Vec:
    """The sum as it stands."""
    term = ad(x, v) / 2.0
    total = v + term
    k = 2.0
    while one_norm(term) > 0.0625 * EPSILON * one_norm(total):
        k = k + 1.0
        term = ad(x, term) / k
        total = total + term
    return total


def one_norm(x: Vec) -> float:
    """|x_1| + |x_2| + ..., derivatives included that the components carry."""
    total = size_of(x[0])
    for i in range(1, len(x)):
        total = total + size_of(x[i])
    return total
