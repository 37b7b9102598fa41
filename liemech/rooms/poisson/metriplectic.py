"""Metriplectic systems: motions whose energy stays and whose entropy grows."""

from __future__ import annotations

from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from ...errors import InvalidInput, require, undefined
from ...formulas import Record, Vec, dot, jacobian, record, sqrt
from ...formulas.classes.records import with_fields
from ...groups.lie_algebra import LieAlgebra
from ...groups.poisson_structure import LiePoissonStructure, PoissonStructure
from ...groups.retractions import Retraction
from ...groups.vector_space import VectorSpace
from ...systems.hamiltonian import Hamiltonian
from ...systems.lie_poisson import LiePoissonSystem
from ...systems.system import System, as_precise
from .poisson import PoissonSystem

TOLERANCE = 2.0**-40
"""Brackets that should vanish may be so large, relative to their terms, where a system is made."""


@record
class Friction(Record):
    """Friction that turns energy into heat, as skew forms A_k on velocities; abstract.

    A subclass writes `pairing`; its fields are the parameters.

    Source: Morrison and Updike, Inclusive curvature-like framework for describing dissipation: metriplectic
    4-bracket dynamics, J. Nonlinear Sci. 34 (2024), 90.
    """

    def pairing(self, mu: Vec, xi: Vec, eta: Vec) -> Vec:
        """The numbers A_k(xi, eta), linear in each and skew: A_k(xi, xi) = 0.  mu, xi, eta : (dim,)."""
        raise undefined(self, "pairing")


@record
class BracketFriction(Friction):
    """The friction of a Lie algebra: A(xi, eta) = sqrt(strength) [xi, eta], all its components.

    algebra : of the velocities.  strength : not negative.
    Source: Morrison, A paradigm for joined Hamiltonian and dissipative systems, Physica D 18 (1986), 410 (the
    relaxing rigid body); Morrison and Updike, J. Nonlinear Sci. 34 (2024), section 4.
    """

    algebra: LieAlgebra
    strength: float

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.strength >= 0.0:
            raise InvalidInput(f"BracketFriction: strength is not negative; got {self.strength!r}")

    def pairing(self, mu: Vec, xi: Vec, eta: Vec) -> Vec:
        """The bracket sqrt(strength) [xi, eta], (dim,)."""
        return sqrt(self.strength) * self.algebra.bracket(xi, eta)


@record
class Metriplectic(System):
    """A Poisson system with friction inside of it: the energy stays, and the entropy grows.

        mu' = {mu, H} + (mu, S),   (F, S) = sum_k A_k(dH, dF) A_k(dH, dS),   dS/dt = sum_k A_k(dH, dS)^2

    system : the motion without friction, a LiePoissonSystem or a PoissonSystem.
    entropy : S, a Casimir function of it, as a Hamiltonian.
    friction : the skew forms A_k, a `Friction`; a number stands for `BracketFriction` of this strength.

    On the dual of so(3), with S a function of |mu|^2, the body settles on a principal axis while |mu| changes: it exchanges
    angular momentum with its surroundings, and no energy.
    `DiscreteGradient()` keeps the energy to rounding and lets the entropy grow in every step.

    Raises InvalidType for a system of another kind, InvalidInput for an entropy that is no Casimir function and
    forms that are not skew.
    Source: Morrison, Physica D 18 (1986), 410; Grmela and Oettinger, Dynamics and thermodynamics of complex
    fluids, Phys. Rev. E 56 (1997), 6620.
    """

    alternatives: ClassVar[str] = "DiscreteGradient() keeps its laws, RKMK accepts every system"

    system: Any
    entropy: Hamiltonian
    friction: Any

    def __post_init__(self) -> None:
        name = type(self).__name__
        require(
            f"{name}: system", self.system, (LiePoissonSystem, PoissonSystem), "a LiePoissonSystem or a PoissonSystem"
        )
        require(
            f"{name}: entropy", self.entropy, Hamiltonian, "a Hamiltonian, a record with `energy`, whose value is S"
        )
        if isinstance(self.friction, (int, float)) and isinstance(self.system, LiePoissonSystem):
            friction = BracketFriction(self.system.group.algebra, float(self.friction))
            object.__setattr__(self, "friction", friction)
        require(f"{name}: friction", self.friction, Friction, "a Friction, a record with `pairing`")
        self._require_laws()
        super().__post_init__()

    def _require_laws(self) -> None:
        """Raise InvalidInput where S is no Casimir function, or a form is not skew, at a generic place."""
        rng = np.random.default_rng(2)
        mu, xi = [Vec.of(rng.uniform(0.5, 1.0, self.dim).tolist()) for _ in range(2)]
        moved = [self.structure.sharp(mu, x) for x in (self.entropy.gradient(mu), xi)]
        terms = sum(abs(a * b) for a, b in zip(xi, moved[1], strict=True)) + dot(moved[1], moved[1])
        if not dot(moved[0], moved[0]) <= TOLERANCE * terms:
            raise InvalidInput(
                f"{type(self).__name__}: the entropy {self.entropy!r} is no Casimir function of {self.system!r}: it would "
                f"move mu = {mu!r} by {moved[0]!r}, and must not. Take a function of its Casimirs, such as those of "
                "`system.casimirs`"
            )
        diagonal, beside = (np.abs(self.friction.pairing(mu, xi, x)).max() for x in (xi, mu))
        if not diagonal <= TOLERANCE * beside:
            raise InvalidInput(
                f"{type(self).__name__}: the forms of {self.friction!r} must be skew, A(xi, xi) = 0, for the energy to "
                f"stay; at xi = {xi!r} the largest is {diagonal:g}"
            )

    # ---------------------------------------------------------------- formulas

    @property
    def dim(self) -> int:
        """The number of components of the state."""
        return self.structure.dim

    @property
    def structure(self) -> PoissonStructure:
        """The Poisson structure of the system."""
        if isinstance(self.system, PoissonSystem):
            return self.system.structure
        return LiePoissonStructure(self.system.group)

    @cached_property
    def group(self) -> VectorSpace:
        """R^n: friction moves momenta off their orbits."""
        return VectorSpace(self.dim)

    @property
    def part(self) -> str:
        """The name of the coordinates in states, "mu" or "y"."""
        return "y" if isinstance(self.system, PoissonSystem) else "mu"

    def energy(self, mu: Vec) -> float:
        """H(mu), which stays.  mu : (dim,)."""
        return self.system.energy(mu)

    def gradient(self, mu: Vec) -> Vec:
        """The derivative dH(mu) of the energy, (dim,).  mu : (dim,)."""
        if isinstance(self.system, PoissonSystem):
            return self.system.gradient(mu)
        return self.system.velocity(mu)

    def change(self, mu: Vec, xi: Vec, sigma: Vec) -> Vec:
        """{mu, H} + (mu, S) for dH = xi and dS = sigma.  mu, xi, sigma : (dim,)."""
        forms = jacobian(lambda eta: self.friction.pairing(mu, xi, eta), xi)
        return self.structure.sharp(mu, xi) + forms.T @ (forms @ sigma)

    def rate(self, t: float, state: Any) -> Vec:
        """The rate mu' of the coordinates, with friction, (dim,)."""
        mu = getattr(state, self.part)
        return self.change(mu, self.gradient(mu), self.entropy.gradient(mu))

    def moved(self, state: Any, by: Vec) -> Any:
        """The state with other coordinates.  by : added to them."""
        mu = getattr(state, self.part)
        coordinates = mu + as_precise(by, mu)
        return with_fields(state, y=coordinates) if self.part == "y" else with_fields(state, mu=coordinates)

    def displaced(self, retraction: Retraction, state: Any, omega: Vec) -> Any:
        """The state with coordinates mu + omega."""
        return self.moved(state, omega)

    def variation(self, state: Any, omega: Vec) -> tuple[Vec, Vec]:
        """The displacement omega, and |mu| by components, beside which to measure."""
        mu = getattr(state, self.part)
        return omega, Vec(*[abs(x) for x in mu])

    def constants(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The energy, which friction keeps, along the samples."""
        return {"energy": np.asarray(self.energy(states[self.part]))}

    def state(self, *args: Any, **parts: Any) -> Any:
        """A start for `integrate`, as the system without friction has it; no attitude.

        Raises InvalidInput as that does.
        """
        start = self.system._written_out(self.system.state(*args, **parts))
        if getattr(start, "g", None) is not None:
            raise InvalidInput(
                f"{type(self).__name__}.state: friction moves momenta off their orbits, where no "
                "attitude belongs to them; leave g out"
            )
        return self._vouched(start)
