"""Densities of fields, l(eta, xi) = T(xi) - Phi(eta), of the strain eta = g^-1 g_s and the velocity xi = g^-1 g_t."""

from __future__ import annotations

from dataclasses import field
from typing import Any, final

import numpy as np

from ...errors import InvalidInput, require
from ...formulas import Mat, Record, Vec, check_finite, dot, record
from ...formulas.classes.fields import OfEach
from ...formulas.classes.of_each import Each, each
from ...systems.hamiltonian import Hamiltonian
from ...systems.kinetic_energy import KineticEnergy, has_inertia, times
from ...systems.lagrangian import Lagrangian


@record
class StrainEnergy(Hamiltonian, Lagrangian):
    """The energy of a strain in a unit of length, Phi(eta) = (eta - eta_0) . C (eta - eta_0)/2, and as a
    Hamiltonian lam . eta_0 + lam . C^-1 lam/2 of the internal force lam = C (eta - eta_0).

    stiffness : C, (dim,) or (dim, dim) symmetric.  rest : eta_0, the strain without force, (dim,).
    Raises InvalidInput for a stiffness without an inverse, or of other components than the rest.

    Source: Simo, Comput. Methods Appl. Mech. Eng. 49 (1985), 55, section 5.
    """

    stiffness: Vec | Mat
    rest: Vec
    compliance: Vec | Mat = field(init=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "compliance", KineticEnergy(self.stiffness).inverse)
        if not isinstance(self.rest, OfEach):
            check_finite(np.array(self.rest), "StrainEnergy: rest")
            if not isinstance(self.stiffness, OfEach) and len(self.stiffness) != len(self.rest):
                raise InvalidInput(
                    f"StrainEnergy: stiffness is of {len(self.stiffness)} components, rest of {len(self.rest)}; give as many"
                )

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
        """The stiffness C = d2Phi/deta2."""
        return self.stiffness

    def _shape(self, argument: str, kind: str) -> tuple[int, ...] | None:
        strain: Any = self.rest
        return np.shape(strain.values if isinstance(strain, Each) else strain)[-1:] if kind == "Vec" else None


@record
class FieldDensity(Record):
    """The Lagrangian of a field in a unit of length, l(eta, xi) = T(xi) - Phi(eta).

    kinetic : T, KineticEnergy(M), or a StrainEnergy.
    stored : Phi, KineticEnergy(C), StrainEnergy(C, rest), or another Lagrangian of the strain.

    Source: Demoures, Gay-Balmaz, Kobilarov and Ratiu, Commun. Nonlinear Sci. Numer. Simul. 19 (2014), 3492.
    """

    kinetic: Any
    stored: Lagrangian

    def __post_init__(self) -> None:
        super().__post_init__()
        require("FieldDensity: stored", self.stored, Lagrangian, "such as KineticEnergy([1.0, 1.0, 1.0])")
        if not (has_inertia(self.kinetic) or type(self.kinetic) is StrainEnergy):
            raise InvalidInput(
                "FieldDensity: kinetic is quadratic, KineticEnergy(M), or StrainEnergy(M, rest) of a field "
                f"that marches in space; got {self.kinetic!r}"
            )

    @final
    def value(self, eta: Vec, xi: Vec) -> float:
        """l(eta, xi) = T(xi) - Phi(eta).  eta, xi : (dim,)."""
        return self.kinetic.value(xi) - self.stored.value(eta)


def on_parts(kinetic: Any, parts: np.ndarray) -> Any:
    """The energies w T of parts w of the line, one for each node.  parts : (nodes,)."""
    M = np.array(kinetic.inertia if has_inertia(kinetic) else kinetic.stiffness)
    of_parts = each(parts.reshape(-1, *[1] * M.ndim) * M)
    return KineticEnergy(of_parts) if has_inertia(kinetic) else StrainEnergy(of_parts, kinetic.rest)
