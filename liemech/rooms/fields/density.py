"""Densities of fields, l(eta, xi) = T(xi) - Phi(eta), of the strain eta = g^-1 g_s and the velocity xi = g^-1 g_t."""

from __future__ import annotations

from dataclasses import field
from typing import Any

import numpy as np

from ...errors import require
from ...formulas import Mat, Record, Vec, dot, record
from ...formulas.classes.of_each import each
from ...systems.hamiltonian import Hamiltonian
from ...systems.kinetic_energy import KineticEnergy, has_inertia, times
from ...systems.lagrangian import Lagrangian


@record
class StrainEnergy(Hamiltonian, Lagrangian):
    """The energy of a strain in a unit of length, Phi(eta) = (eta - eta_0) . C (eta - eta_0)/2, and as a
    Hamiltonian lam . eta_0 + lam . C^-1 lam/2, where lam = C (eta - eta_0) is the internal force.

    stiffness : C, (dim,) or (dim, dim) symmetric.  rest : eta_0, the strain without force, (dim,).
    Raises InvalidInput for a stiffness without an inverse.

    Source: Simo, Comput. Methods Appl. Mech. Eng. 49 (1985), 55, section 5.
    """

    stiffness: Vec | Mat
    rest: Vec
    compliance: Vec | Mat = field(init=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "compliance", KineticEnergy(self.stiffness).inverse)

    def energy(self, mu: Vec) -> float:
        """lam . eta_0 + lam . C^-1 lam/2, of a force lam."""
        return dot(mu, self.rest) + 0.5 * dot(mu, times(self.compliance, mu))

    def gradient(self, mu: Vec) -> Vec:
        """The strain eta = eta_0 + C^-1 lam of a force lam."""
        return self.rest + times(self.compliance, mu)

    def value(self, xi: Vec) -> float:
        """Phi(eta), of a strain eta."""
        return 0.5 * dot(xi - self.rest, times(self.stiffness, xi - self.rest))

    def momentum(self, xi: Vec) -> Vec:
        """The force lam = C (eta - eta_0) of a strain eta."""
        return times(self.stiffness, xi - self.rest)

    def hessian(self, xi: Vec) -> Mat | Vec:
        """The stiffness C."""
        return self.stiffness

    def _shape(self, argument: str, kind: str) -> tuple[int, ...] | None:
        return (len(self.rest),) if kind == "Vec" else None


@record
class FieldDensity(Record):
    """The Lagrangian of a field in a unit of length, l(eta, xi) = T(xi) - Phi(eta).

    kinetic : T, a Lagrangian and a Hamiltonian both, such as KineticEnergy(M).
    stored : Phi, a Lagrangian of the strain, such as KineticEnergy(C), StrainEnergy(C, rest), or one of
    your own; to march in space it is a Hamiltonian too.

    Source: Demoures, Gay-Balmaz, Kobilarov and Ratiu, Commun. Nonlinear Sci. Numer. Simul. 19 (2014), 3492
    (multisymplectic Lie group variational integrator for a geometrically exact beam), section 2.
    """

    kinetic: Any
    stored: Lagrangian

    def __post_init__(self) -> None:
        super().__post_init__()
        for what, energy in (("kinetic", self.kinetic), ("stored", self.stored)):
            require(f"FieldDensity: {what}", energy, Lagrangian, "such as KineticEnergy([1.0, 1.0, 1.0])")

    def value(self, eta: Vec, xi: Vec) -> float:
        """l(eta, xi) = T(xi) - Phi(eta).  eta, xi : (dim,)."""
        return self.kinetic.value(xi) - self.stored.value(eta)

    @property
    def exchanged(self) -> FieldDensity:
        """The density whose time is the arc s and whose arc is the time, -l with xi and eta exchanged."""
        return FieldDensity(self.stored, self.kinetic)

    def speeds(self, dim: int) -> np.ndarray:
        """The speeds c of small waves at the strain without force, rising, M c^2 v = C v, (dim,); nan of what is
        unstable.
        """
        rest = getattr(self.stored, "rest", None)
        still = Vec(*[0.0] * dim)
        M, C = (
            np.array(energy.hessian(at), dtype=float)
            for energy, at in ((self.kinetic, still), (self.stored, rest if isinstance(rest, Vec) else still))
        )
        M, C = (np.diag(x) if x.ndim == 1 else x for x in (M, C))
        with np.errstate(invalid="ignore"):
            return np.sort(np.sqrt(np.linalg.eigvals(np.linalg.solve(M, C)).real))


@record
class OnPart(Hamiltonian, Lagrangian):
    """A kinetic energy T on a part w of a unit of length: w T(xi), as a Hamiltonian w T*(mu/w).

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 7.2.
    """

    kinetic: Any
    part: float

    def energy(self, mu: Vec) -> float:
        """w T*(mu/w)."""
        return self.part * self.kinetic.energy((1.0 / self.part) * mu)

    def gradient(self, mu: Vec) -> Vec:
        """The velocity of the momentum mu/w."""
        return self.kinetic.gradient((1.0 / self.part) * mu)

    def value(self, xi: Vec) -> float:
        """w T(xi)."""
        return self.part * self.kinetic.value(xi)

    def momentum(self, xi: Vec) -> Vec:
        """w dT/dxi."""
        return self.part * self.kinetic.momentum(xi)

    def hessian(self, xi: Vec) -> Mat | Vec:
        """w d2T/dxi2."""
        return self.part * self.kinetic.hessian(xi)


def on_parts(kinetic: Any, parts: np.ndarray) -> Any:
    """A kinetic energy on parts of the line, one for each node.  parts : (nodes,)."""
    if has_inertia(kinetic):
        J = np.array(kinetic.inertia)
        return KineticEnergy(each(parts.reshape(-1, *[1] * J.ndim) * J))
    return OnPart(kinetic, each(parts))
