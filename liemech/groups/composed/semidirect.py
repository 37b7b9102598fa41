"""Semidirect products of a group with a vector space that it acts on: rigid motions, affine maps,
and the home of heavy tops.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from ...errors import IncompatibleSystem, InvalidInput, require
from ...formulas import Ambient, Element, Mat, Vec, identity_matrix, mat, record, vec
from ..ad_series import mean_slope
from ..lie_algebra import LieAlgebra
from ..lie_group import LieGroup
from ..representations import LinearAction, Representation, RotationAction, averaged, squares, standard_action
from ..vector_space import VectorSpace
from .product import DirectProduct


@record
class SemidirectAlgebra(LieAlgebra):
    """Pairs (xi, u) of a velocity and a vector, [(xi, u), (eta, v)] = ([xi, eta], xi . v - eta .
    u).

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 14.7;
    Cendra, Holm, Marsden and Ratiu, Lagrangian reduction, the Euler-Poincare equations, and
    semidirect products, AMS Transl. 186 (1998), section 1.
    """

    action: Representation

    @property
    def dim(self) -> int:
        return self.action.group.dim + self.action.space_dim

    @property
    def acting(self) -> LieAlgebra:
        """The algebra of the group."""
        return self.action.group.algebra

    def bracket(self, xi: Vec, eta: Vec) -> Vec:
        """([xi, eta], xi . v - eta . u)."""
        (x, u), (y, v) = self.parts(xi), self.parts(eta)
        action = self.action
        return vec(*action.group.ad(x, y), *(action.infinitesimal(x, v) - action.infinitesimal(y, u)))

    def ad_star(self, xi: Vec, mu: Vec) -> Vec:
        """(ad*_xi mu - J(u, p), p . xi): the heavy top's equations are mu' = ad*_xi mu.  J is the
        action's `momentum`.
        """
        (x, u), (m, p) = self.parts(xi), self.parts(mu)
        action = self.action
        return vec(*(action.group.ad_star(x, m) - action.momentum(u, p)), *action.infinitesimal_dual(x, p))

    def parts(self, xi: Vec) -> tuple[Vec, Vec]:
        """The coordinates in the algebra of the group, and the vector.  xi : (dim,)."""
        n = self.action.group.dim
        return xi[:n], xi[n:]

    def exp_Ad_star(self, xi: Vec, mu: Vec) -> Vec:
        """(Ad*_exp(xi) (m - J(phi1(xi) u, p)), p . exp(xi)), without forming the element."""
        (x, u), (m, p) = self.parts(xi), self.parts(mu)
        moved = m - self.action.momentum(self.action.phi1(x, u), p)
        return vec(*self.acting.exp_Ad_star(x, moved), *self.action.exp_act_dual(x, p))

    def dexp(self, xi: Vec, eta: Vec) -> Vec:
        """sum_k (-ad_xi)^k eta/(k + 1)!; for large xi from its half, dexp_xi = (1 + Ad_exp(-xi/2))
        dexp_(xi/2)/2.
        """
        return averaged(self.ad, self._exp_Ad, self._size2(xi), -xi, eta)

    def dexp_dual(self, xi: Vec, mu: Vec) -> Vec:
        """sum_k (-ad*_xi)^k mu/(k + 1)!; for large xi from its half."""
        return averaged(self.ad_star, self.exp_Ad_star, self._size2(xi), -xi, mu)

    def dexp_inv(self, xi: Vec, eta: Vec) -> Vec:
        """(y, phi1^-1 (v - c)) with y = dexp_xi^-1 eta in the group, c the vector of
        dexp_(xi, u) (y, 0), and phi1 at -xi.
        """
        (w, _), (a, v) = self.parts(xi), self.parts(eta)
        y = self.acting.dexp_inv(w, a)
        _, c = self.parts(self.dexp(xi, vec(*y, *(0.0 * v))))
        return vec(*y, *self.action.phi1_inv(-w, v - c))

    def dexp_inv_dual(self, xi: Vec, mu: Vec) -> Vec:
        """((dexp_xi^-1)* (m - c), q) with q = p . phi1^-1 at -xi, and c the group's part of
        (dexp_(xi, u))* (0, q).
        """
        (w, _), (m, p) = self.parts(xi), self.parts(mu)
        q = self.action.phi1_inv_dual(-w, p)
        c, _ = self.parts(self.dexp_dual(xi, vec(*(0.0 * m), *q)))
        return vec(*self.acting.dexp_inv_dual(w, m - c), *q)

    def is_exp_chart(self, xi: Vec) -> bool:
        return self.acting.is_exp_chart(self.parts(xi)[0])

    def exp_residual(self, xi: Vec, p: Vec, mu: Vec) -> tuple[Vec, float, Mat]:
        """r = p - sum_k t_k with t_k = ad*_xi t_k-1/(k + 1), t_0 = mu; the derivative of the
        recursion gives dr/dxi.

        The derivative stops at 1e-11: Newton's method feels no less.
        """
        by_xi = mean_slope(self.ad_star, xi, mu, self._size2(xi))
        return p - self.dexp_dual(-xi, mu), 1.0, -by_xi

    def cayley_Ad_star(self, xi: Vec, mu: Vec) -> Vec:
        """Ad* of (cay xi, y) with y = (1 - xi/2)^-1 u, where p . cay xi = p + q . xi with q = p .
        (1 - xi/2)^-1.
        """
        (x, u), (m, p) = self.parts(xi), self.parts(mu)
        moved = m - self.action.momentum(self._half_inverse(x, u), p)
        turned = p + self.action.infinitesimal_dual(x, self.action.half_inverse_dual(x, p))
        return vec(*self.acting.cayley_Ad_star(x, moved), *turned)

    def dcayley(self, xi: Vec, eta: Vec) -> Vec:
        """(y, (1 + xi/2)^-1 v + y . u/2) with y = dcay_xi eta."""
        (x, u), (a, v) = self.parts(xi), self.parts(eta)
        y = self.acting.dcayley(x, a)
        return vec(*y, *(self._half_inverse(-x, v) + 0.5 * self.action.infinitesimal(y, u)))

    def dcayley_dual(self, xi: Vec, mu: Vec) -> Vec:
        """((dcay_xi)* (m + J(u, p)/2), p . (1 + xi/2)^-1)."""
        (x, u), (m, p) = self.parts(xi), self.parts(mu)
        shifted = m + 0.5 * self.action.momentum(u, p)
        return vec(*self.acting.dcayley_dual(x, shifted), *self.action.half_inverse_dual(-x, p))

    def dcayley_inv(self, xi: Vec, eta: Vec) -> Vec:
        """(dcay_xi^-1 eta, (1 + xi/2)(v - eta . u/2))."""
        (x, u), (a, v) = self.parts(xi), self.parts(eta)
        difference = v - 0.5 * self.action.infinitesimal(a, u)
        return vec(*self.acting.dcayley_inv(x, a), *(difference + 0.5 * self.action.infinitesimal(x, difference)))

    def dcayley_inv_dual(self, xi: Vec, mu: Vec) -> Vec:
        """((dcay_xi^-1)* m - J(u, q)/2, q) with q = p . (1 + xi/2)."""
        (x, u), (m, p) = self.parts(xi), self.parts(mu)
        q = p + 0.5 * self.action.infinitesimal_dual(x, p)
        return vec(*(self.acting.dcayley_inv_dual(x, m) - 0.5 * self.action.momentum(u, q)), *q)

    def _exp_Ad(self, xi: Vec, eta: Vec) -> Vec:
        """The adjoint map Ad_exp(xi) eta, by phi1 of the action."""
        (x, u), (y, v), action = self.parts(xi), self.parts(eta), self.action
        g = action.group.exp(x)
        moved = action.group.Ad(g, y)
        return vec(*moved, *(action.act(g, v) - action.infinitesimal(moved, action.phi1(x, u))))

    def _size2(self, xi: Vec) -> float:
        """The squared entries of ad_xi, those with u left out, which is nilpotent."""
        x, _ = self.parts(xi)
        units = identity_matrix(self.acting.dim)
        return squares([self.acting.bracket(x, unit) for unit in units]) + self.action._size2(x)

    def _half_inverse(self, xi: Vec, v: Vec) -> Vec:
        """(1 - xi/2)^-1 v, where the Cayley map exists."""
        reason = self.action.why_no_cayley()
        if reason is not None:
            raise IncompatibleSystem(f"SemidirectProduct has no Cayley map: {reason}")
        return self.action.half_inverse(xi, v)


@record
class SemidirectProduct(DirectProduct):
    """Pairs (g, x) of a group element and a vector that it acts on,
    (g, x)(h, y) = (g h, x + g . y): `SemidirectProduct(SO3())`.

    An element is one vector, the entries of g (a matrix row by row) and then x, as in a direct product; `join` and
    `split` translate.  Velocities are (xi, u) and momenta (mu, p), the group's part first.  With the
    momentum map J of the action, <J(x, p), xi> = <p, xi . x>,

        exp(xi, u) = (exp xi, phi1(xi) u),                  phi1(xi) = 1 + xi/2 + xi^2/6 + ...,
        Ad_(g, x) (eta, v) = (Ad_g eta, g . v - (Ad_g eta) . x),
        Ad*_(g, x) (mu, p) = (Ad*_g (mu - J(x, p)), p . g).

    acting : the group.  action : a Representation of it; left out, its own matrices, for unit
    quaternions the rotations.  `SemidirectProduct(G, AdjointAction(G))` is the tangent group TG,
    with CoadjointAction(G) the cotangent group T*G.

    The Cayley map is that of the matrices [[xi, u], [0, 0]], where the action has one.  Raises
    InvalidType for what is no Representation, InvalidInput for one of another group.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., sections 9.1 and
    14.7; Cendra, Holm, Marsden and Ratiu (1998), section 1; Leonard and Marsden, Physica D 105
    (1997), for the heavy top.
    """

    acting: LieGroup
    action: Any = None

    def __post_init__(self) -> None:
        require("SemidirectProduct: acting", self.acting, LieGroup)
        if self.action is None:
            object.__setattr__(self, "action", standard_action(self.acting))
        require("SemidirectProduct: action", self.action, Representation)
        if self.action.group != self.acting:
            raise InvalidInput(f"SemidirectProduct: {self.action!r} is no action of {self.acting!r}")

    def __repr__(self) -> str:
        usual = type(self.action) in (LinearAction, RotationAction)
        return (
            f"SemidirectProduct({self.acting!r})" if usual else f"SemidirectProduct({self.acting!r}, {self.action!r})"
        )

    @cached_property
    def algebra(self) -> SemidirectAlgebra:
        return SemidirectAlgebra(self.action)

    @cached_property
    def factors(self) -> tuple[Any, ...]:
        """The group and the vector space, whose elements are beside each other."""
        return self.acting, VectorSpace(self.action.space_dim)

    def matrix(self, g: Element) -> Mat:
        """The affine map y -> g . y + x as a matrix [[g, x], [0, 1]].  Returns (k + 1, k + 1)."""
        h, x = self.split(g)
        columns = [self.action.act(h, unit) for unit in identity_matrix(len(x))]
        return mat(*[vec(*[column[i] for column in columns], x[i]) for i in range(len(x))], vec(*[0.0] * len(x), 1.0))

    # ---------------------------------------------------------------- group

    def compose(self, g: Element, h: Element) -> Element:
        """(a b, x + a . y)."""
        (a, x), (b, y) = self.split(g), self.split(h)
        return self.join(self.acting.compose(a, b), x + self.action.act(a, y))

    def inverse(self, g: Element) -> Element:
        """The inverse of the pair (a, x), (a^-1, -a^-1 . x)."""
        a, x = self.split(g)
        back = self.acting.inverse(a)
        return self.join(back, -self.action.act(back, x))

    def Ad(self, g: Element, xi: Vec) -> Vec:
        """(Ad_a eta, a . v - (Ad_a eta) . x)."""
        (a, x), (eta, v) = self.split(g), self.algebra.parts(xi)
        moved = self.acting.Ad(a, eta)
        return vec(*moved, *(self.action.act(a, v) - self.action.infinitesimal(moved, x)))

    def Ad_star(self, g: Element, mu: Vec) -> Vec:
        """(Ad*_a (m - J(x, p)), p . a)."""
        (a, x), (m, p) = self.split(g), self.algebra.parts(mu)
        return vec(*self.acting.Ad_star(a, m - self.action.momentum(x, p)), *self.action.act_dual(a, p))

    def body_velocity(self, g: Element, rate: Ambient) -> Vec:
        """(a^-1 a', a^-1 . x')."""
        (a, _), (a_rate, x_rate) = self.split(g), self.split(rate)
        return vec(*self.acting.body_velocity(a, a_rate), *self.action.act(self.acting.inverse(a), x_rate))

    def casimirs(self, mu: Vec) -> Vec:
        """The Casimirs of the action; for rotations p.p and mu.p."""
        m, p = self.algebra.parts(mu)
        return self.action.invariants(m, p)

    @property
    def unit_blocks(self) -> tuple[int, ...]:
        return (*self.acting.unit_blocks, self.action.space_dim)

    def further_invariants(self, mu: Any) -> tuple[float, ...] | None:
        """For rotations |mu| where p = 0, as for rigid motions; None for other actions."""
        if not isinstance(self.action, RotationAction) or type(self.action).act is not RotationAction.act:
            return None
        return () if mu[3:].any() else (float(np.linalg.norm(mu[:3])),)

    # ---------------------------------------------------------------- membership

    def objection(self, g: np.ndarray) -> str | None:
        """The objection of the group to its part."""
        width = self.places[0][1]
        numbers = g[:width].view(complex) if self.acting.is_complex else g[:width]
        reason = self.acting.objection(numbers.reshape(self.acting.element_shape))
        return reason and f"of its part in {self.acting!r}, {reason}"

    # ---------------------------------------------------------------- exponential

    def exp(self, xi: Vec) -> Element:
        """The exponential map, (exp xi, phi1(xi) u)."""
        x, u = self.algebra.parts(xi)
        return self.join(self.acting.exp(x), self.action.phi1(x, u))

    def compose_exp(self, g: Element, xi: Vec) -> Element:
        """(a exp xi, x + a . phi1(xi) u)."""
        (a, x), (y, u) = self.split(g), self.algebra.parts(xi)
        return self.join(self.acting.compose_exp(a, y), x + self.action.act(a, self.action.phi1(y, u)))

    def log(self, g: Element) -> Vec:
        """(log a, phi1(log a)^-1 x)."""
        a, x = self.split(g)
        y = self.acting.log(a)
        return vec(*y, *self.action.phi1_inv(y, x))

    # ---------------------------------------------------------------- Cayley map

    def why_no_cayley(self) -> str | None:
        return self.action.why_no_cayley()

    def cayley(self, xi: Vec) -> Element:
        """(cay xi, (1 - xi/2)^-1 u)."""
        x, u = self.algebra.parts(xi)
        return self.join(self.acting.cayley(x), self.algebra._half_inverse(x, u))

    def compose_cayley(self, g: Element, xi: Vec) -> Element:
        """(a cay xi, x + a . (1 - xi/2)^-1 u)."""
        (a, x), (y, u) = self.split(g), self.algebra.parts(xi)
        return self.join(self.acting.compose_cayley(a, y), x + self.action.act(a, self.algebra._half_inverse(y, u)))

    def cayley_inv(self, g: Element) -> Vec:
        """(xi, x - xi . x/2) with xi = cay^-1 a."""
        a, x = self.split(g)
        y = self.acting.cayley_inv(a)
        return vec(*y, *(x - 0.5 * self.action.infinitesimal(y, x)))
