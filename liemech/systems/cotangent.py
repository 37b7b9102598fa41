"""Motion on T*G, pairs of a body momentum and a configuration, and its energies H(g, mu)."""

from __future__ import annotations

from operator import attrgetter
from typing import TYPE_CHECKING, Any, ClassVar, final

import numpy as np

from ..errors import InvalidInput, NoConvergence, require, undefined
from ..formulas import Element, Mat, Vec, derivative, dot, gradient, jacobian, record, vec
from ..formulas.classes.derived import derived, derived_from
from ..formulas.classes.remembered import shared_property
from ..formulas.derivatives import axes
from ..formulas.numbers.transposes import ruled
from ..groups.coadjoint import CoadjointAction
from ..groups.composed.product import ProductGroup
from ..groups.composed.semidirect import SemidirectProduct
from ..groups.lie_group import LieGroup
from ..groups.retractions import Exponential, Retraction
from ..groups.vector_space import VectorSpace
from ..solvers import newton
from .lie_poisson import BodyState, as_users_see, body_state, by_site, in_a_row
from .system import System, as_precise


@record
class CotangentMotion(System):
    """Motion on the cotangent group T*G, mu' = ad*_xi mu + f,  g' = g xi; abstract.

    A subclass has `configurations`, the group G, and writes `rates`, (xi, f), `energy` and `state`.

    A force moves the momentum off its coadjoint orbit, so that no element of G carries it along.  T*G does, pairs of an
    element and a momentum, (g, m)(h, n) = (g h, m + K_g n), where the velocity is (xi, f).  So `group` is T*G, and
    every method for equations on groups applies.
    With `in_space`, where momenta only turn and nothing is far away, `group` is G x g* instead, whose velocity is
    (xi, K_g f): the momentum in space is a sum of what acts on it, steps are shorter to compute, and a momentum that
    belongs to a symmetry of f is kept to rounding.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., sections 1.4 and 15.10; for T*G as a
    group Engo, Partitioned Runge-Kutta methods in Lie-group setting, BIT 43 (2003).
    """

    coordinates: ClassVar[tuple[str, ...]] = ("mu",)
    # do steps on G x g* add up the momentum in space?
    in_space: ClassVar[bool] = False
    # is momentum_and_force(t, xi, g) known, by a Lagrangian?
    has_lagrangian: ClassVar[bool] = False
    # is there a field or a load?
    has_force: ClassVar[bool] = True
    if TYPE_CHECKING:  # a field here would be an argument of every system

        @property
        def configurations(self) -> LieGroup: ...

    def rates(self, t: float, mu: Vec, g: Element) -> tuple[Vec, Vec]:
        """The body velocity xi and the force f at time t.  mu : (dim,), g : an element; (dim,) each."""
        raise undefined(self, "rates")

    @property
    def group(self) -> Any:
        """The group that moves momentum and configuration together: T*G, or G x g* in space."""
        return self._in_space if self.in_space else self._cotangent

    @shared_property
    def _in_space(self) -> ProductGroup:
        return ProductGroup(self.configurations, VectorSpace(self.configurations.dim))

    @shared_property
    def _cotangent(self) -> SemidirectProduct:
        return SemidirectProduct(self.configurations, CoadjointAction(self.configurations))

    @final
    def spatial_momentum(self, mu: Vec, g: Element) -> Vec:
        """The momentum seen from space, K_g mu; a force changes what it has no symmetry for.
        mu : (dim,), g : an element.
        """
        return self.configurations.K(g, mu)

    # ---------------------------------------------------------------- how it moves

    @property
    def unit_blocks(self) -> tuple[int, ...]:
        """The blocks of equal units of the velocity, and of the force."""
        return (*self.configurations.unit_blocks, *self.configurations.unit_blocks)

    @final
    def rate(self, t: float, state: BodyState) -> Vec:
        """(xi, f): the velocity on T*G; with `in_space` (xi, K_g f), on G x g*."""
        xi, f = self.rates(t, state.mu, state.g)
        return vec(*xi, *(self.configurations.K(state.g, f) if self.in_space else f))

    @final
    def displaced(self, retraction: Retraction, state: BodyState, omega: Vec) -> BodyState:
        """(g h, Ad*_h (mu + n)) with (h, n) = tau(omega).

        The exponential takes the part of omega in the algebra of G to h; momentum and element are
        then moved by increments, which compensated sums add up.
        """
        return ruled(self._displaced, self._displaced_back, self.configurations, (retraction,), state, omega)

    def _displaced(self, retraction: Retraction, state: BodyState, omega: Vec) -> BodyState:
        group, omega = self.configurations, as_precise(omega, state.mu)
        if self.in_space:
            xi, kick = self._in_space.algebra.parts(omega)
            return self.kicked(retraction, state, group.Ad_star(state.g, kick), xi)
        h, n = self._cotangent.split(retraction.tau(self._cotangent, omega))
        if isinstance(retraction, Exponential):
            return self.kicked(retraction, state, n, self._cotangent.algebra.parts(omega)[0])
        return BodyState(group.Ad_star(h, state.mu + n), group.compose(state.g, h))

    @final
    def kicked(self, retraction: Retraction, state: BodyState, kick: Vec, xi: Vec) -> BodyState:
        """(g h, Ad*_h (mu + kick)) with h = tau(xi).  kick, xi : (dim,)."""
        group, mu = self.configurations, state.mu + kick
        return BodyState(retraction.tau_Ad_star(group, xi, mu), retraction.compose_tau(group, state.g, xi))

    def _displaced_back(self, retraction: Retraction, state: BodyState, omega: Vec, w: Any) -> Any:
        """Ad_h w_mu, Ad*_(h^-1) w_g, and by omega the products of w with all directions."""
        group, new = self.configurations, self._displaced(retraction, state, omega)
        h = group.compose(group.inverse(state.g), new.g)
        changes = [derivative(lambda x: self._displaced(retraction, state, x), omega, e) for e in axes(omega)]
        bent = vec(*[dot(w.mu, x.mu) + dot(w.g, group.body_velocity(new.g, x.g)) for x in changes])
        return (BodyState(group.Ad(h, w.mu), group.K(h, w.g)), bent), []

    @final
    def variation(self, state: BodyState, omega: Vec) -> tuple[Vec, Vec]:
        """ad*_omega mu and the kick beside |mu|, and omega beside what counts as large where the body is."""
        group = self.configurations
        xi, kick = self.group.algebra.parts(omega)
        kick = group.Ad_star(state.g, kick) if self.in_space else kick
        size = vec(*[abs(m) for m in state.mu])
        return vec(*(group.ad_star(xi, state.mu) + kick), *xi), vec(*size, *group.scale(state.g))

    # ---------------------------------------------------------------- elements are those of the configurations

    def _written_out(self, state: Any) -> Any:
        return in_a_row(self, state)

    def by_site(self, arrays: dict[str, Any]) -> dict[str, Any]:
        return by_site(self.configurations, arrays)

    def as_users_see(self, arrays: dict[str, Any]) -> dict[str, Any]:
        return as_users_see(self.configurations, arrays)

    @final
    def identity(self) -> Any:
        """The neutral element of the configurations."""
        return self.configurations.identity()

    @final
    def defect(self, g: Any) -> float:
        """How far an array is from being a configuration.  g : shaped like an element."""
        return self.configurations.defect(g)

    _space = property(attrgetter("configurations"))

    def _shape(self, argument: str, kind: str) -> tuple[int, ...] | None:
        return (self.group.dim,) if argument == "omega" else super()._shape(argument, kind)


@record
class EnergyOnCotangent(CotangentMotion):
    """Motion on T*G by an energy of momentum and configuration; abstract.  Momenta are added up in space."""

    in_space: ClassVar[bool] = True
    alternatives: ClassVar[str] = "SymplecticRKMK keeps its symplectic form, RKMK accepts every system"

    def __post_init__(self) -> None:
        group = getattr(self, "configurations", None)
        require(f"{type(self).__name__}: configurations", group, LieGroup, "a LieGroup, such as SO3()")
        super().__post_init__()

    @derived_from("energy")
    def symmetry(self, mu: Any, g: Any) -> dict[str, Any]:
        """The momenta that the motion keeps because the energy has a symmetry, by name, for the samples of a run.

        By Noether's theorem <K_g mu, eta> is kept if H(exp(s eta) g, mu) = H(g, mu), and <mu, eta> if
        H(g exp(s eta), Ad*_exp(s eta) mu) = H(g, mu).  mu : (..., dim), g : elements, arrays both.
        """
        return {}

    def constants(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The momenta that a symmetry keeps."""
        return self.symmetry(states["mu"], states["g"])

    def state(self, mu: Any = None, g: Any = None) -> BodyState:
        """A start for `integrate`: body momentum mu and configuration g.

        mu : (dim,), or (bodies, dim) for an ensemble;  g : an element, or one for each body.
        Raises InvalidInput for missing parts, wrong shapes, entries that are not finite, and a g that is not on the group.
        """
        name = f"{type(self).__name__}.state"
        if g is None or mu is None:
            raise InvalidInput(f"{name}: {'g' if g is None else 'mu'} is missing; give state(mu=..., g=...)")
        return self._vouched(body_state(name, self.configurations, mu, g))

    def _at_rest(self) -> Vec:
        return vec(*[0.0 for _ in range(self.configurations.dim)])


@record
class CotangentSystem(EnergyOnCotangent):
    """Motion on T*G by any energy H(g, mu):

        xi = dH/dmu,   g' = g xi,   mu' = ad*_xi mu + f,   <f, eta> = -d/ds H(g exp(s eta), mu) at s = 0

    1. A subclass writes `energy(mu, g)`, as a formula, and has `configurations`, the group G.  Its fields are the
    parameters.
    2. It may write `velocity`, dH/dmu, and `force`, f, in closed form; left out, they follow by differentiation, exact to
    rounding.
    3. It may name what its symmetries keep (`symmetry`).

    Magnetic fields, rotating frames, bases in motion, masses that depend on where a body is: where momentum and place
    meet in one term.  Of energies H(mu) + V(g) MechanicalSystem has more methods.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 4.4 and chapter 13.
    """

    def energy(self, mu: Vec, g: Element) -> float:
        """The energy H(g, mu), which a subclass writes.  mu : (dim,), g : an element."""
        raise undefined(self, "energy")

    @derived
    def velocity(self, mu: Vec, g: Element) -> Vec:
        """The body velocity xi = dH/dmu, (dim,).  mu : (dim,), g : an element."""
        return gradient(lambda m: self.energy(m, g), mu)

    @derived
    def force(self, mu: Vec, g: Element) -> Vec:
        """The force f, <f, eta> = -d/ds H(g exp(s eta), mu), (dim,).  mu : (dim,), g : an element."""
        return -gradient(lambda eta: self.energy(mu, self.configurations.compose_exp(g, eta)), self._at_rest())

    def rates(self, t: float, mu: Vec, g: Element) -> tuple[Vec, Vec]:
        """The body velocity and the force.  mu : (dim,), g : an element."""
        return self.velocity(mu, g), self.force(mu, g)

    def constants(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The energy, and what a symmetry keeps."""
        return {"energy": np.asarray(self.energy(states["mu"], states["g"]))} | super().constants(states)


@record
class TangentSystem(CotangentSystem):
    """Motion on TG by any Lagrangian l(xi, g), as that of its momenta on T*G:

        mu = dl/dxi,   g' = g xi,   mu' = ad*_xi mu + f,   <f, eta> = d/ds l(xi, g exp(s eta)) at s = 0

    1. A subclass writes `lagrangian(xi, g)`, as a formula, and has `configurations`, the group G.  Its fields are the
    parameters.
    2. It may write `momentum`, dl/dxi, and `hessian`, d2l/dxi2.
    3. It may name what its symmetries keep (`symmetry`).

    SymplecticRKMK(order=2) solves for the velocity.  Other methods find that of a momentum by Newton's method, which takes
    one step where l is of second degree in xi; where the energy is known, a CotangentSystem is faster with them.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., sections 7.2 and 13.5.
    """

    has_lagrangian: ClassVar[bool] = True

    def lagrangian(self, xi: Vec, g: Element) -> float:
        """The Lagrangian l(xi, g), which a subclass writes.  xi : (dim,), g : an element."""
        raise undefined(self, "lagrangian")

    @derived
    def momentum(self, xi: Vec, g: Element) -> Vec:
        """The momentum mu = dl/dxi, (dim,).  xi : (dim,), g : an element."""
        return gradient(lambda x: self.lagrangian(x, g), xi)

    @derived
    def hessian(self, xi: Vec, g: Element) -> Mat:
        """The inertia d2l/dxi2, (dim, dim).  xi : (dim,), g : an element."""
        return jacobian(lambda x: self.momentum(x, g), xi)

    @final
    def velocity(self, mu: Vec, g: Element) -> Vec:
        """The body velocity xi with dl/dxi = mu, (dim,).  mu : (dim,), g : an element.  Raises NoConvergence."""
        still, at_rest = 0.0 * mu, self.momentum(0.0 * mu, g)
        beside = vec(*[abs(a) + abs(b) for a, b in zip(mu, at_rest)])
        xi, size, enough, _ = newton(lambda x: (self.momentum(x, g) - mu, self.hessian(x, g), 1.0), still, beside)
        if not size <= enough:
            raise NoConvergence(f"{type(self).__name__}: no velocity has the momentum {mu!r}; is d2l/dxi2 positive?")
        return xi

    @final
    def force(self, mu: Vec, g: Element) -> Vec:
        """The force f, <f, eta> = d/ds l(xi, g exp(s eta)), (dim,).  mu : (dim,), g : an element."""
        return self.rates(0.0, mu, g)[1]

    @final
    def energy(self, mu: Vec, g: Element) -> float:
        """The energy <mu, xi> - l.  mu : (dim,), g : an element."""
        xi = self.velocity(mu, g)
        return dot(mu, xi) - self.lagrangian(xi, g)

    @final
    def rates(self, t: float, mu: Vec, g: Element) -> tuple[Vec, Vec]:
        xi = self.velocity(mu, g)
        return xi, self.momentum_and_force(t, xi, g)[1]

    @final
    def momentum_and_force(self, t: float, xi: Vec, g: Element) -> tuple[Vec, Vec]:
        """The momentum dl/dxi and the force.  xi : (dim,), g : an element."""
        group = self.configurations
        return self.momentum(xi, g), gradient(
            lambda eta: self.lagrangian(xi, group.compose_exp(g, eta)), self._at_rest()
        )

    def state(self, mu: Any = None, g: Any = None, *, xi: Any = None) -> BodyState:
        """A start for `integrate`: body momentum mu, or body velocity xi, and configuration g.

        mu, xi : (dim,), or (bodies, dim) for an ensemble;  g : an element, or one for each body.
        Raises InvalidInput for missing parts, wrong shapes, entries that are not finite, and a g that is not on the group.
        """
        if mu is not None and xi is not None:
            raise InvalidInput(f"{type(self).__name__}.state: give mu, the momentum, or xi, the velocity, not both")
        return super().state(mu if xi is None or g is None else self.momentum(xi, g), g)


@record
class DrivenCotangentSystem(EnergyOnCotangent):
    """Motion on T*G by an energy that changes with time, H(t, g, mu), as CotangentSystem by one that does not.

    1. A subclass writes `energy(t, mu, g)`, as a formula, and has `configurations`, the group G.  Its fields are the
    parameters.
    2. It may write `velocity`, dH/dmu, and `force` in closed form.
    3. It may name what its symmetries keep (`symmetry`); the energy is not kept.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 4.4 and chapter 13.
    """

    driven: ClassVar[bool] = True

    def energy(self, t: float, mu: Vec, g: Element) -> float:
        """The energy H(t, g, mu), which a subclass writes.  mu : (dim,), g : an element."""
        raise undefined(self, "energy")

    @derived
    def velocity(self, t: float, mu: Vec, g: Element) -> Vec:
        """The body velocity xi = dH/dmu at time t, (dim,).  mu : (dim,), g : an element."""
        return gradient(lambda m: self.energy(t, m, g), mu)

    @derived
    def force(self, t: float, mu: Vec, g: Element) -> Vec:
        """The force f, <f, eta> = -d/ds H(t, g exp(s eta), mu), (dim,).  mu : (dim,), g : an element."""
        return -gradient(lambda eta: self.energy(t, mu, self.configurations.compose_exp(g, eta)), self._at_rest())

    def rates(self, t: float, mu: Vec, g: Element) -> tuple[Vec, Vec]:
        """The body velocity and the force at time t.  mu : (dim,), g : an element."""
        return self.velocity(t, mu, g), self.force(t, mu, g)
