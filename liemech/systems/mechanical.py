"""Mechanical systems: a body whose configurations are a Lie group, in a field of force."""

from __future__ import annotations

from dataclasses import field
from functools import cached_property
from operator import attrgetter
from typing import Any, ClassVar, final

import numpy as np

from ..errors import InvalidInput, require
from ..formulas import Element, Vec, derivative, dot, record, vec
from ..formulas.classes.remembered import shared_property
from ..formulas.derivatives import axes, tangent
from ..formulas.numbers.transposes import AtElement, ruled
from ..groups.coadjoint import CoadjointAction
from ..groups.composed.product import ProductGroup
from ..groups.composed.semidirect import SemidirectProduct
from ..groups.lie_group import LieGroup
from ..groups.retractions import Exponential, Retraction
from ..groups.vector_space import VectorSpace
from .in_time.driven import DrivenLiePoissonSystem
from .lie_poisson import BodyState, LiePoissonSystem, as_users_see, body_state, by_site, in_a_row, of_group
from .many.energies import OfManySites, moving, on_group
from .potential import Force, Potential
from .system import System, as_precise

_NO_FORCE = Force()


@record
class MechanicalSystem(System):
    """A body in a field of force: mu' = ad*_xi mu + f(g) + F(t, xi, g),  g' = g xi,  with xi = dH/dmu.

    body : the body without the field, such as RigidBody([1.0, 1.5, 2.0]) or LiePoissonSystem(SE3(),
    KineticEnergy(J)); with an energy that changes with time a DrivenLiePoissonSystem.
    potential : V, its energy in the field as a function of where it is; f is the force that follows
    from it.
    load : a force F without a potential, if there is one.

    A force moves the momentum off its coadjoint orbit, so that no element of the configurations G
    carries it along.  The cotangent group T*G does, pairs of an element and a momentum,
    (g, m)(h, n) = (g h, m + K_g n), where the velocity is (xi, f + F).  So `group` is T*G, and
    every method for equations on groups applies.  LieVerlet keeps what the variational methods
    keep.
    With `in_space`, where momenta only turn and nothing is far away, `group` is G x g* instead, whose
    velocity is (xi, K_g (f + F)): the momentum in space is a sum of what acts on it, steps are shorter
    to compute, and a momentum that belongs to a symmetry of f is kept to rounding.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., sections 1.4 and
    15.10; for T*G as a group Engo, Partitioned Runge-Kutta methods in Lie-group setting, BIT 43
    (2003).
    """

    coordinates: ClassVar[tuple[str, ...]] = ("mu",)
    # do steps on G x g* add up the momentum in space?
    in_space: ClassVar[bool] = False
    alternatives: ClassVar[str] = "RKMK accepts every system, KickDrift and LieVerlet bodies in a field"

    body: LiePoissonSystem | DrivenLiePoissonSystem
    potential: Potential
    load: Force | None = field(default=None, kw_only=True, repr=False)

    def __post_init__(self) -> None:
        if isinstance(self.body, (LiePoissonSystem, DrivenLiePoissonSystem)):
            name, group = type(self).__name__, self.body.group
            parts: Any = (
                self.body,
                on_group(self.potential, Potential, name, group),
                on_group(self.load, Force, name, group),
            )
            for of_sites in (self.body.hamiltonian, *parts[1:]):
                if isinstance(of_sites, OfManySites):
                    parts = of_sites.held_together(name, *parts)
                    break
            for part, value in zip(("body", "potential", "load"), parts):
                if value is not getattr(self, part):
                    object.__setattr__(self, part, value)
        body = DrivenLiePoissonSystem if self.driven else LiePoissonSystem
        fields: tuple[tuple[str, Any, type, str], ...] = (
            ("body", self.body, body, "such as RigidBody([1.0, 1.5, 2.0])"),
            ("potential", self.potential, Potential, "a subclass with an `energy(g)`"),
            ("load", self.load or _NO_FORCE, Force, "a subclass with a `covector(t, xi, g)`"),
        )
        for name, value, kind, words in fields:
            require(f"{type(self).__name__}: {name}", value, kind, f"a {kind.__name__}, {words}")
        if self.driven and self.body.site_form is not None:
            raise InvalidInput(
                f"{type(self).__name__}: the energy of many sites in a field cannot change with time; "
                "a term of a load can, `covector(t, a)`, and without a field the DrivenLiePoissonSystem "
                "moves by itself"
            )
        super().__post_init__()

    @final
    @property
    def configurations(self) -> LieGroup:
        """The group whose elements tell where the body is."""
        return self.body.group

    @property
    def group(self) -> Any:
        """The group that moves momentum and configuration together: T*G, or G x g* in space."""
        return self._in_space if self.in_space else self._cotangent

    @shared_property
    def _in_space(self) -> ProductGroup:
        return ProductGroup(self.body.group, VectorSpace(self.body.group.dim))

    @shared_property
    def _cotangent(self) -> SemidirectProduct:
        return SemidirectProduct(self.body.group, CoadjointAction(self.body.group))

    # ---------------------------------------------------------------- formulas

    @property
    def driven(self) -> bool:
        """Whether the energy of the body changes with time."""
        return isinstance(self.body, DrivenLiePoissonSystem)

    @final
    def velocity(self, mu: Vec, t: float = 0.0) -> Vec:
        """The body velocity xi = dH/dmu.  mu : (dim,).  t : counts where the energy of the body changes with time."""
        body: Any = self.body
        return body.velocity(t, mu) if self.driven else body.velocity(mu)

    @final
    def force(self, g: Element) -> Vec:
        """The force of the field on the body, <f, eta> = -d/ds V(g exp(s eta)).  g : an element; returns (dim,)."""
        return ruled(self._force_at, self._force_back, self.body.group, (), AtElement(g))

    def _force_at(self, place: AtElement) -> Vec:
        return self.potential.force(self.body.group, place.g)

    def _force_back(self, place: AtElement, w: Vec) -> Any:
        """D_w f - ad*_w f, as second derivatives of the potential commute, but for left-invariant fields."""
        group, along = self.body.group, moving(self.potential, w)
        still = vec(*[0.0 for _ in along])
        force, slope = tangent(lambda x: self.potential._free(group, group.compose_exp(place.g, x)), still, along)
        return (AtElement(slope - group.ad_star(along, force)),), [("elements", 0.0, place.g, -along)]

    @final
    def applied(self, t: float, xi: Vec, g: Element) -> Vec:
        """Field and load together, f(g) + F(t, xi, g).  xi : (dim,), g : an element;  returns (dim,)."""
        force = self.force(g)
        return force if self.load is None else force + self._loaded(t, xi, g)

    @final
    def _loaded(self, t: float, xi: Vec, g: Element) -> Vec:
        """The load F(t, xi, g).  xi : (dim,), g : an element;  returns (dim,)."""
        return ruled(self._load_at, self._load_back, self.body.group, (t,), xi, AtElement(g))

    def _load_at(self, t: float, xi: Vec, place: AtElement) -> Vec:
        load: Any = self.load
        return load.covector(t, xi, place.g)

    def _load_back(self, t: float, xi: Vec, place: AtElement, w: Vec) -> Any:
        load: Any = self.load
        by_xi, by_place = load._slopes(self.body.group, t, xi, place.g, moving(load, w))
        return (by_xi, AtElement(by_place)), []

    @final
    def energy(self, mu: Vec, g: Element, t: float = 0.0) -> float:
        """H(mu) + V(g).  mu : (dim,), g : an element.  t : counts where the energy of the body changes with time."""
        body: Any = self.body
        free = body.energy(t, mu) if self.driven else body.energy(mu)
        return free + self.potential.energy(g)

    @final
    def power(self, mu: Vec, g: Element, t: float = 0.0) -> float:
        """dE/dt = dK/dt(t, mu) + <F, xi>: the energy that the load gives, and what the change of the
        body's own energy does, in W.  mu : (dim,), g : an element.
        """
        body: Any = self.body
        total = derivative(lambda s: body.energy(s, mu), t, 1.0) if self.driven else 0.0
        if self.load is not None:
            xi = self.velocity(mu, t)
            total = total + dot(self.load.covector(t, xi, g), xi)
        return total

    @final
    def spatial_momentum(self, mu: Vec, g: Element) -> Vec:
        """The momentum seen from space, K_g mu; the field changes what it has no symmetry for.
        mu : (dim,), g : an element.
        """
        return self.body.group.K(g, mu)

    # ---------------------------------------------------------------- how it moves

    @property
    def unit_blocks(self) -> tuple[int, ...]:
        """The blocks of equal units of the velocity, and of the force."""
        return (*self.body.group.unit_blocks, *self.body.group.unit_blocks)

    @final
    def rate(self, t: float, state: BodyState) -> Vec:
        """(xi, f): the velocity on T*G; with `in_space` (xi, K_g f), on G x g*."""
        xi = self.velocity(state.mu, t)
        f = self.applied(t, xi, state.g)
        return vec(*xi, *(self.body.group.K(state.g, f) if self.in_space else f))

    @final
    def displaced(self, retraction: Retraction, state: BodyState, omega: Vec) -> BodyState:
        """(g h, Ad*_h (mu + n)) with (h, n) = tau(omega).

        The exponential takes the part of omega in the algebra of G to h; momentum and element are
        then moved by increments, which compensated sums add up.
        """
        return ruled(self._displaced, self._displaced_back, self.body.group, (retraction,), state, omega)

    def _displaced(self, retraction: Retraction, state: BodyState, omega: Vec) -> BodyState:
        omega = as_precise(omega, state.mu)
        if self.in_space:
            group, (xi, kick) = self.body.group, self._in_space.algebra.parts(omega)
            mu = state.mu + group.Ad_star(state.g, kick)
            return BodyState(retraction.tau_Ad_star(group, xi, mu), retraction.compose_tau(group, state.g, xi))
        h, n = self._cotangent.split(retraction.tau(self._cotangent, omega))
        if isinstance(retraction, Exponential):
            group, (xi, _) = self.body.group, self._cotangent.algebra.parts(omega)
            return BodyState(group.exp_Ad_star(xi, state.mu + n), group.compose_exp(state.g, xi))
        return BodyState(self.body.group.Ad_star(h, state.mu + n), self.body.group.compose(state.g, h))

    def _displaced_back(self, retraction: Retraction, state: BodyState, omega: Vec, w: Any) -> Any:
        """Ad_h w_mu, Ad*_(h^-1) w_g, and by omega the products of w with all directions."""
        group, new = self.body.group, self._displaced(retraction, state, omega)
        h = group.compose(group.inverse(state.g), new.g)
        changes = [derivative(lambda x: self._displaced(retraction, state, x), omega, e) for e in axes(omega)]
        bent = vec(*[dot(w.mu, x.mu) + dot(w.g, group.body_velocity(new.g, x.g)) for x in changes])
        return (BodyState(group.Ad(h, w.mu), group.K(h, w.g)), bent), []

    @final
    def variation(self, state: BodyState, omega: Vec) -> tuple[Vec, Vec]:
        """ad*_omega mu and the kick beside |mu|, and omega beside what counts as large where the body is."""
        group = self.body.group
        xi, kick = self.group.algebra.parts(omega)
        kick = group.Ad_star(state.g, kick) if self.in_space else kick
        size = vec(*[abs(m) for m in state.mu])
        return vec(*(group.ad_star(xi, state.mu) + kick), *xi), vec(*size, *group.scale(state.g))

    def constants(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The energy, unless that of the body changes with time, and the momenta that a symmetry of
        the potential keeps; nothing, as far as is known, under a load.
        """
        mu, g = states["mu"], states["g"]
        if self.load is not None:
            return {}
        energy = {} if self.driven else {"energy": np.asarray(self.energy(mu, g))}
        return energy | self.potential.symmetry(self.body.group, mu, g)

    @cached_property
    def site_form(self) -> MechanicalSystem | None:
        """The site form of a system of many sites: that of one body, whose formulas ask the other
        sites for what they need; None if there is none.
        """
        body, of_site = self.body.site_form, getattr(self.potential, "of_site", None)
        load = None if self.load is None else getattr(self.load, "of_site", None)
        if body is None or of_site is None or (load is None and self.load is not None):
            return None
        return MechanicalSystem(body, of_site(), load=None if load is None else load())

    def _written_out(self, state: Any) -> Any:
        """The state with the numbers of all sites in a row."""
        return in_a_row(self, state)

    def by_site(self, arrays: dict[str, Any]) -> dict[str, Any]:
        """The states of several species with an axis of sites."""
        return by_site(self.body.group, arrays)

    def as_users_see(self, arrays: dict[str, Any]) -> dict[str, Any]:
        """The inverse of `by_site`, for every array of a result."""
        return as_users_see(self.body.group, arrays)

    @property
    def is_large(self) -> bool:
        """Whether there are more sites than formulas would be written out for."""
        return self.body.is_large

    def _in_numpy(self, method: str, arguments: dict[str, Any]) -> Any:
        places = {"g": arguments["g"]} if "g" in arguments else {}
        if method in ("energy", "force") and not self.potential.is_large:
            return None
        if method == "energy":
            kinetic = self.body._in_numpy("energy", {"mu": arguments["mu"]})
            return kinetic + self.potential._in_numpy("energy", places)
        if method == "force":
            return self.potential._in_numpy("force", places)
        if method == "velocity":
            return self.body._in_numpy("velocity", arguments)
        return of_group(self.body.group, method, arguments)

    # ---------------------------------------------------------------- checked input

    @final
    def state(self, mu: Any = None, g: Any = None, *, xi: Any = None) -> BodyState:
        """A start for `integrate`: body momentum mu, or body velocity xi, and configuration g.

        mu, xi : (dim,) for one body, (bodies, dim) for an ensemble;  g : an element, or one for
        each body; SciPy's Rotation and RigidTransform will do, on a product a tuple of the factors'
        elements, (rotation, x).
        Raises InvalidInput for a missing g, wrong shapes, entries that are not finite, and a g that
        is not on the group.
        """
        name = f"{type(self).__name__}.state"
        if g is None:
            raise InvalidInput(
                f"{name}: g is missing; the force depends on where the body is, give state(mu=..., g=...)"
            )
        if self.driven and mu is None:
            raise InvalidInput(f"{name}: give mu; the momentum of a velocity changes with time here")
        body: Any = self.body
        momentum = mu if xi is None and mu is not None else body._momentum_of(name, mu, xi)
        state = body_state(name, self.body.group, momentum, g)
        self.potential.require_start(name, self.body.group, state.mu, state.g)
        return self._vouched(state)

    # elements are those of the configurations

    @final
    def identity(self) -> Any:
        """The neutral element of the configurations."""
        return self.body.group.identity()

    @final
    def defect(self, g: Any) -> float:
        """How far an array is from being a configuration.  g : shaped like an element."""
        return self.body.group.defect(g)

    _space = property(attrgetter("configurations"))

    def _shape(self, argument: str, kind: str) -> tuple[int, ...] | None:
        return (self.group.dim,) if argument == "omega" else super()._shape(argument, kind)
