"""Mechanical systems: a body whose configurations are a Lie group, in a field of force."""

from __future__ import annotations

import math
from dataclasses import field
from functools import cached_property
from typing import Any, ClassVar, final

import numpy as np

from ..errors import InvalidInput, require
from ..formulas import Element, Vec, derivative, dot, record, vec
from ..formulas.derivatives import tangent
from ..formulas.numbers.transposes import AtElement, ruled
from ..groups.lie_group import LieGroup
from .cotangent import CotangentMotion
from .in_time.driven import DrivenLiePoissonSystem
from .lie_poisson import BodyState, LiePoissonSystem, body_state, of_group
from .many.energies import OfManySites, moving, on_group
from .potential import Force, NoPotential, Potential

_NO_FORCE = Force()


@record
class MechanicalSystem(CotangentMotion):
    """A body in a field of force: mu' = ad*_xi mu + f(g) + F(t, xi, g),  g' = g xi,  with xi = dH/dmu.

    body : the body without the field, such as RigidBody([1.0, 1.5, 2.0]) or LiePoissonSystem(SE3(),
    KineticEnergy(J)); with an energy that changes with time a DrivenLiePoissonSystem.
    potential : V, its energy in the field as a function of where it is; f is the force that follows
    from it.
    load : a force F without a potential, if there is one.

    LieVerlet keeps what the variational methods keep.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., sections 1.4 and
    15.10; for T*G as a group Engo, Partitioned Runge-Kutta methods in Lie-group setting, BIT 43
    (2003).
    """

    alternatives: ClassVar[str] = "RKMK accepts every system, KickDrift and LieVerlet bodies in a field"
    # the longest stable one of KickDrift() near rest, where the system knows it
    largest_step: ClassVar[float] = math.inf

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

    # ---------------------------------------------------------------- formulas

    @property
    def driven(self) -> bool:  # type: ignore[override]
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
    def rates(self, t: float, mu: Vec, g: Element) -> tuple[Vec, Vec]:
        """The body velocity, and the force of field and load.  mu : (dim,), g : an element."""
        xi = self.velocity(mu, t)
        return xi, self.applied(t, xi, g)

    @property
    def has_lagrangian(self) -> bool:  # type: ignore[override]
        """Whether the body has a Lagrangian."""
        return self._body_at(0.0).lagrangian is not None

    @property
    def has_force(self) -> bool:  # type: ignore[override]
        """Whether there is a field or a load."""
        return self.load is not None or type(self.potential) is not NoPotential

    @final
    def momentum_and_force(self, t: float, xi: Vec, g: Element) -> tuple[Vec, Vec]:
        """The momentum dl/dxi, and the force of field and load.  xi : (dim,), g : an element."""
        return self._body_at(t).lagrangian.momentum(xi), self.applied(t, xi, g)

    def _body_at(self, t: float) -> Any:
        """The body with the energy that it has at time t."""
        body: Any = self.body
        return body._at(t) if self.driven else body

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

    @property
    def is_large(self) -> bool:
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
