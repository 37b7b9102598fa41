"""Retractions: maps from the algebra to the group that replace the exponential, and their
left-trivialised differentials, d/de tau(xi + e eta) = tau(xi) (dtau_xi eta).

Source: Bou-Rabee and Marsden, Hamilton-Pontryagin integrators on Lie groups, Found. Comput. Math. 9
(2009), section 4.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, final

from ..errors import IncompatibleSystem, NoConvergence, undefined
from ..formulas import (
    Element,
    Mat,
    Record,
    Vec,
    derivative,
    dot,
    identity_matrix,
    jacobian,
    mat,
    plain,
    record,
    solve,
    sqrt,
    vec,
)
from ..formulas.classes.derived import derived
from ..solvers import LIMIT, TOLERANCE
from .lie_algebra import refuse_sides
from .lie_group import LieGroup

if TYPE_CHECKING:
    from .actions import GroupAction


@record
class Retraction(Record):
    """A map tau with tau(0) = e, dtau_0 = 1 and tau(-xi) = tau(xi)^-1 that carries small steps from
    the algebra to the group.

    1. A subclass writes `tau`, as a formula.
    2. It may add closed forms for everything else.  What it leaves out follows from tau by
    differentiation.

    Differentials are left-trivialised.  The right-trivialised one, d/de tau(xi + e eta) = (dtau_xi
    eta) tau(xi), is the one at -xi: `dtau(group, -xi, eta)`, and so are its inverse and its duals.

    Source: Bou-Rabee and Marsden (2009), definition 4.1.
    """

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        refuse_sides(cls, Retraction)

    # ---------------------------------------------------------------- 1. a subclass writes

    def tau(self, group: LieGroup, xi: Vec) -> Element:
        """The group element tau(xi).  xi : (dim,)."""
        raise undefined(self, "tau")

    # ---------------------------------------------------------------- 2. closed forms are welcome

    def why_not(self, group: LieGroup) -> str | None:
        """Why the map cannot be used on a group; None if it can."""
        return None

    @derived
    def tau_inv(self, group: LieGroup, g: Element) -> Vec:
        """The xi with tau(xi) = g.  g : an element.

        By Newton's method on the group, xi + dtau_xi^-1 log(tau(xi)^-1 g), from log(g).  Raises
        NoConvergence.
        """
        xi = group.log(g)
        size = residual = dot(xi, xi)
        for _ in range(LIMIT):
            error = group.log(group.compose(group.inverse(self.tau(group, xi)), g))
            xi = xi + self.dtau_inv(group, xi, error)
            residual = dot(error, error)
            if not residual > TOLERANCE * TOLERANCE * size:
                break
        if not residual <= TOLERANCE * TOLERANCE * size:
            raise NoConvergence(f"{type(self).__name__}: no xi found with tau(xi) = g, |log g| = {sqrt(size):.2g}")
        return xi

    @derived
    def tau_Ad_star(self, group: LieGroup, xi: Vec, mu: Vec) -> Vec:
        """Ad*_tau(xi) mu.  xi, mu : (dim,)."""
        return group.Ad_star(self.tau(group, xi), mu)

    @derived
    def compose_tau(self, group: LieGroup, g: Element, xi: Vec) -> Element:
        """g tau(xi).  g : an element, xi : (dim,)."""
        return group.compose(g, self.tau(group, xi))

    @derived
    def tau_compose(self, group: LieGroup, xi: Vec, g: Element) -> Element:
        """tau(xi) g.  xi : (dim,), g : an element."""
        return group.compose(self.tau(group, xi), g)

    @derived
    def tau_act(self, action: GroupAction, xi: Vec, x: Vec) -> Vec:
        """tau(xi) . x, a point moved by the group.  xi : (dim,), x : a point."""
        return action.act(self.tau(action.group, xi), x)

    @derived
    def dtau(self, group: LieGroup, xi: Vec, eta: Vec) -> Vec:
        """The differential, tau(xi)^-1 d/de tau(xi + e eta).  xi, eta : (dim,)."""
        rate = derivative(lambda x: self.tau(group, x), xi, eta)
        return group.body_velocity(self.tau(group, xi), rate)

    @derived
    def dtau_dual(self, group: LieGroup, xi: Vec, mu: Vec) -> Vec:
        """Its dual, <dtau_dual_xi mu, eta> = <mu, dtau_xi eta>.  xi, mu : (dim,)."""
        return vec(*[dot(mu, self.dtau(group, xi, unit)) for unit in identity_matrix(group.dim)])

    @derived
    def dtau_inv(self, group: LieGroup, xi: Vec, eta: Vec) -> Vec:
        """Its inverse.  xi, eta : (dim,)."""
        return solve(mat(*[self.dtau(group, xi, unit) for unit in identity_matrix(group.dim)]).T, eta)

    @derived
    def dtau_inv_dual(self, group: LieGroup, xi: Vec, mu: Vec) -> Vec:
        """The dual of the inverse, <dtau_inv_dual_xi mu, eta> = <mu, dtau_inv_xi eta>.  xi,
        mu : (dim,).
        """
        return solve(mat(*[self.dtau(group, xi, unit) for unit in identity_matrix(group.dim)]), mu)

    def is_chart(self, group: LieGroup, xi: Vec) -> bool:
        """Whether xi is in the neighbourhood of zero on which dtau can be inverted.  xi : (dim,)."""
        return True

    @derived
    def residual(self, group: LieGroup, xi: Vec, p: Vec, mu: Vec) -> tuple[Vec, float | Mat, Mat]:
        """How far p = dl/dxi is from fitting the momentum mu at the start of a step tau(xi):
        r = p - (dtau_xi)* mu, right-trivialised, or a multiple.

        r = 0 is the discrete Legendre transform (dtau_xi^-1)* p = mu, freed of the inverse.
        Returns r, dr/dp (a number or a matrix) and dr/dxi (a matrix), for Newton's method.  xi, p,
        mu : (dim,).
        """
        return (p - self.dtau_dual(group, -xi, mu), 1.0, jacobian(lambda x: -self.dtau_dual(group, -x, mu), xi))

    # ---------------------------------------------------------------- 3. what follows

    def _explain(self, arguments: dict[str, Any]) -> None:
        if isinstance(arguments.get("group"), LieGroup):
            self.require(arguments["group"])

    @final
    def require(self, group: LieGroup) -> None:
        """Raise IncompatibleSystem, with the reason, unless the map can be used on this group."""
        reason = self.why_not(group)
        if reason:
            raise IncompatibleSystem(
                f"{self!r} cannot be used on {group!r}: {reason}. Exponential() serves every group"
            )


@record
class Exponential(Retraction):
    """The exponential map: follows a constant velocity exactly.

    Source: Iserles et al., Lie-group methods, Acta Numerica 9 (2000), section 2.4.
    """

    @final
    def tau(self, group: LieGroup, xi: Vec) -> Element:
        """The exponential map, tau(xi) = exp(xi), whose series methods know; another map is a Retraction. xi : (dim,)."""
        return group.exp(xi)

    def tau_inv(self, group: LieGroup, g: Element) -> Vec:
        """The inverse map, tau^-1(g) = log(g)."""
        return group.log(g)

    def tau_Ad_star(self, group: LieGroup, xi: Vec, mu: Vec) -> Vec:
        """The coadjoint action of tau(xi), Ad*_exp(xi) mu."""
        return group.algebra.exp_Ad_star(xi, mu)

    def compose_tau(self, group: LieGroup, g: Element, xi: Vec) -> Element:
        """The product g tau(xi) = g exp(xi)."""
        return group.compose_exp(g, xi)

    def tau_compose(self, group: LieGroup, xi: Vec, g: Element) -> Element:
        """g exp(Ad_g^-1 xi): rounded by what the step adds, not by what is there."""
        return group.compose_exp(g, group.Ad(group.inverse(plain(g)), xi))

    def tau_act(self, action: GroupAction, xi: Vec, x: Vec) -> Vec:
        """The action on a point, exp(xi) . x."""
        return action.exp_act(xi, x)

    def dtau(self, group: LieGroup, xi: Vec, eta: Vec) -> Vec:
        """dexp_xi eta = sum_k (-ad_xi)^k eta/(k + 1)!."""
        return group.algebra.dexp(xi, eta)

    def dtau_inv(self, group: LieGroup, xi: Vec, eta: Vec) -> Vec:
        """dexp_xi^-1 eta = sum_k B_k/k! (-ad_xi)^k eta."""
        return group.algebra.dexp_inv(xi, eta)

    def dtau_dual(self, group: LieGroup, xi: Vec, mu: Vec) -> Vec:
        """The transposed differential of tau, (dexp_xi)* mu."""
        return group.algebra.dexp_dual(xi, mu)

    def dtau_inv_dual(self, group: LieGroup, xi: Vec, mu: Vec) -> Vec:
        """The transposed inverse differential of tau, (dexp_xi^-1)* mu."""
        return group.algebra.dexp_inv_dual(xi, mu)

    def is_chart(self, group: LieGroup, xi: Vec) -> bool:
        """Before the first turn is complete."""
        return group.algebra.is_exp_chart(xi)

    def residual(self, group: LieGroup, xi: Vec, p: Vec, mu: Vec) -> tuple[Vec, float | Mat, Mat]:
        """p - (dexp_xi)* mu, right-trivialised."""
        return group.algebra.exp_residual(xi, p, mu)


@record
class Cayley(Retraction):
    """The Cayley map (1 - xi/2)^-1 (1 + xi/2): no sine, no root, and an implicit step that has a
    solution for every step size.

    On groups of matrices whose algebra is closed under x y x: SO(n), Sp(2n), U(n), SU(2), SL(2),
    SE(3).

    Source: Hairer, Lubich, Wanner, IV.8.3; Bou-Rabee and Marsden (2009), section 4.4.
    """

    def _on(self, group: LieGroup) -> LieGroup:
        """The group whose Cayley map this is."""
        return group

    def why_not(self, group: LieGroup) -> str | None:
        """Its algebra is not closed under x y x."""
        reason = group.why_no_cayley()
        return reason and f"there is no Cayley map on it, {reason}"

    def tau(self, group: LieGroup, xi: Vec) -> Element:
        """The Cayley map, tau(xi) = cay(xi)."""
        return self._on(group).cayley(xi)

    def tau_inv(self, group: LieGroup, g: Element) -> Vec:
        """2 (g - 1)(g + 1)^-1."""
        return self._on(group).cayley_inv(g)

    def tau_Ad_star(self, group: LieGroup, xi: Vec, mu: Vec) -> Vec:
        """The coadjoint action of tau(xi), Ad*_cay(xi) mu."""
        return self._on(group).algebra.cayley_Ad_star(xi, mu)

    def compose_tau(self, group: LieGroup, g: Element, xi: Vec) -> Element:
        """The product g tau(xi) = g cay(xi)."""
        return self._on(group).compose_cayley(g, xi)

    def tau_compose(self, group: LieGroup, xi: Vec, g: Element) -> Element:
        """g cay(Ad_g^-1 xi): rounded by what the step adds, not by what is there."""
        return self._on(group).compose_cayley(g, group.Ad(group.inverse(plain(g)), xi))

    def dtau(self, group: LieGroup, xi: Vec, eta: Vec) -> Vec:
        """(1 + xi/2)^-1 eta (1 - xi/2)^-1."""
        return self._on(group).algebra.dcayley(xi, eta)

    def dtau_inv(self, group: LieGroup, xi: Vec, eta: Vec) -> Vec:
        """(1 + xi/2) eta (1 - xi/2)."""
        return self._on(group).algebra.dcayley_inv(xi, eta)

    def dtau_dual(self, group: LieGroup, xi: Vec, mu: Vec) -> Vec:
        """The dual of (1 + xi/2)^-1 eta (1 - xi/2)^-1."""
        return self._on(group).algebra.dcayley_dual(xi, mu)

    def dtau_inv_dual(self, group: LieGroup, xi: Vec, mu: Vec) -> Vec:
        """The dual of (1 + xi/2) eta (1 - xi/2)."""
        return self._on(group).algebra.dcayley_inv_dual(xi, mu)

    def residual(self, group: LieGroup, xi: Vec, p: Vec, mu: Vec) -> tuple[Vec, float | Mat, Mat]:
        """A multiple of p - (dcay_xi)* mu, right-trivialised, without its division."""
        return self._on(group).algebra.cayley_residual(xi, p, mu)


@record
class CayleyAdjoint(Cayley):
    """The Cayley map of the adjoint representation: Ad_tau(xi) = (1 - ad_xi/2)^-1 (1 + ad_xi/2), 6
    by 6 matrices on SE(3).

    It differs from `Cayley` in the third order of the displacement.  On SO(3), where ad is hat, the
    two are the same.

    Source: Selig, Cayley maps for SE(3), 12th IFToMM World Congress (2007); Kobilarov and Marsden,
    IEEE T-RO 27 (2011).
    """

    def _on(self, group: LieGroup) -> LieGroup:
        """The group with the Cayley map of its matrices Ad_g."""
        by_adjoint = group.by_adjoint
        return group if by_adjoint is None else by_adjoint

    def why_not(self, group: LieGroup) -> str | None:
        """The Cayley map of its matrices Ad_g is not known."""
        if group.by_adjoint is None:
            return "it has no Cayley map of the adjoint representation, as SE3() has"
        return None
