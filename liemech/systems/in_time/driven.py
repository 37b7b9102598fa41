"""Driven systems: energies that change with time, in R^2n and on the dual of a Lie algebra."""

from __future__ import annotations

from functools import cached_property
from typing import Any, ClassVar, final

from ...errors import require, undefined
from ...formulas import Vec, derivative, gradient, record, vec
from ...formulas.classes.derived import derived
from ...formulas.classes.records import fill, with_fields
from ...formulas.numbers.transposes import ruled
from ...groups.lie_group import LieGroup
from ..canonical import CanonicalState, PhaseSpace
from ..kinetic_energy import has_inertia
from ..lie_poisson import BodyState, LiePoissonMotion, LiePoissonSystem, body_state
from ..many.energies import moving, on_group
from .driven_hamiltonian import DrivenHamiltonian


@record
class DrivenHamiltonianSystem(PhaseSpace):
    """Hamilton's equations in R^2n for an energy that changes with time, q' = dH/dp(t, q, p),
    p' = -dH/dq(t, q, p).

    1. A subclass writes `energy(t, q, p)`, as a formula, and says its number of `degrees` of freedom, n.  Its
    fields are the parameters.
    2. It may write `velocity`, dH/dp, and `force`, -dH/dq, in closed form; left out, they follow by
    differentiation.
    3. It may name what stays constant (`constants`); the energy does not.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VI.1.2 and VI.5.3.
    """

    driven: ClassVar[bool] = True
    alternatives: ClassVar[str] = "HamiltonJacobi(order=4) keeps its symplectic form, RKMK accepts every system"

    def energy(self, t: float, q: Vec, p: Vec) -> float:
        """H(t, q, p).  q, p : (n,)."""
        raise undefined(self, "energy")

    @derived
    def velocity(self, t: float, q: Vec, p: Vec) -> Vec:
        """The velocity q' = dH/dp, (n,).  q, p : (n,)."""
        return gradient(lambda x: self.energy(t, q, x), p)

    @derived
    def force(self, t: float, q: Vec, p: Vec) -> Vec:
        """The force p' = -dH/dq, (n,).  q, p : (n,)."""
        return -gradient(lambda x: self.energy(t, x, p), q)

    @final
    def rate(self, t: float, state: CanonicalState) -> Vec:
        """(q', p') at time t."""
        return vec(*self.velocity(t, state.q, state.p), *self.force(t, state.q, state.p))

    @final
    def state(self, q: Any, p: Any) -> CanonicalState:
        """A start for `integrate`: positions q and momenta p, (n,) each, or (members, n) for an
        ensemble; numbers if n = 1.

        Raises InvalidInput for wrong shapes and entries that are not finite.
        """
        return self._canonical_state(*self._points(q, p))


# ------------------------------------------------------------------ on the dual of a Lie algebra

_EMPTY: Any = fill(LiePoissonSystem, dict.fromkeys(("group", "hamiltonian", "lagrangian")))
"""An empty system, which formulas fill."""


@record
class DrivenLiePoissonSystem(LiePoissonMotion):
    """Motion on the dual of a Lie algebra by an energy that changes with time, mu' = ad*_xi mu with
    xi = dK/dmu(t, mu), g' = g xi.

    group : the configuration space.  hamiltonian : the energy as a function of time and body
    momentum.  The spatial momentum and the Casimirs are constant, the energy is not.

    Source: Ge and Marsden, Phys. Lett. A 133 (1988), 134; Marsden and Ratiu, Introduction to
    Mechanics and Symmetry, 2nd ed., 13.7.
    """

    driven: ClassVar[bool] = True
    alternatives: ClassVar[str] = (
        "LiePoissonHamiltonJacobi and FirstKindHamiltonJacobi serve it, RKMK accepts every system"
    )

    group: LieGroup
    hamiltonian: DrivenHamiltonian

    def __post_init__(self) -> None:
        energy = on_group(self.hamiltonian, DrivenHamiltonian, type(self).__name__, self.group)
        if energy is not self.hamiltonian:
            object.__setattr__(self, "hamiltonian", energy)
        for name, kind in ("group", LieGroup), ("hamiltonian", DrivenHamiltonian):
            require(f"{type(self).__name__}: {name}", getattr(self, name), kind)
        super().__post_init__()

    @final
    def velocity(self, t: float, mu: Vec) -> Vec:
        """The body velocity xi = dK/dmu at time t.  mu : (dim,)."""
        return ruled(self.hamiltonian.gradient, self._velocity_back, None, (t,), mu)

    def _velocity_back(self, t: float, mu: Vec, w: Vec) -> Any:
        """D_w dK/dmu, as second derivatives commute."""
        along = moving(self.hamiltonian, w)
        slope = derivative(lambda m: self.hamiltonian._free(t, m), mu, along)
        return (slope,), [("momenta", t, mu, along)]

    @final
    def energy(self, t: float, mu: Vec) -> float:
        """K(t, mu).  mu : (dim,)."""
        return self.hamiltonian.energy(t, mu)

    def rate(self, t: float, state: BodyState) -> Vec:
        """The body velocity xi = dH(t, mu)/dmu."""
        return self.velocity(t, state.mu)

    @cached_property
    def site_form(self) -> DrivenLiePoissonSystem | None:
        return self.at_site(DrivenLiePoissonSystem)

    def at(self, t: float) -> LiePoissonSystem:
        """The free system whose energy is for ever what this one's is at time t.  Raises
        InvalidInput as LiePoissonSystem does.
        """
        return LiePoissonSystem(self.group, self.hamiltonian.at(t))

    def _at(self, t: float) -> LiePoissonSystem:
        """The system with the energy of time t: `at` for formulas, unchecked."""
        energy = self.hamiltonian.at(t)
        lagrangian = energy if has_inertia(energy) else None
        return with_fields(_EMPTY, group=self.group, hamiltonian=energy, lagrangian=lagrangian)

    @final
    def state(self, mu: Any, g: Any = None) -> BodyState:
        """A start for `integrate`: body momentum mu and, if the motion on the group is wanted, the
        element g.

        mu : (dim,), or (bodies, dim) for an ensemble;  g : an element, or one for each body.
        Raises InvalidInput for wrong shapes, entries that are not finite, and a g that is not on
        the group.
        """
        return self._vouched(body_state(f"{type(self).__name__}.state", self.group, mu, g))
