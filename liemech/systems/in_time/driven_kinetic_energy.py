"""Kinetic energy of a body whose inertia changes with time."""

from __future__ import annotations

from typing import Any

from ...errors import undefined
from ...formulas import Mat, Vec, dot, inverse, record, vectors
from ...formulas.classes.records import fill, with_fields
from ..kinetic_energy import KineticEnergy, times
from .driven_hamiltonian import DrivenHamiltonian

_EMPTY: Any = fill(KineticEnergy, dict.fromkeys(("inertia", "inverse")))
"""An empty kinetic energy, which formulas fill."""


@record
class DrivenKineticEnergy(DrivenHamiltonian):
    """Kinetic energy with an inertia that changes with time, K(t, mu) = mu . J(t)^-1 mu/2: of fuel
    that is burnt, of masses that are moved.

    1. A subclass writes `inertia(t)`, as a formula: (dim,) moments, or (dim, dim) a symmetric
    matrix.  Its fields are the parameters.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., sections 13.7 and
    15.2; for masses that leave Goldstein, Classical Mechanics, 3rd ed., section 1.6.
    """

    def inertia(self, t: float) -> Any:
        """J(t), (dim,) or (dim, dim)."""
        raise undefined(self, "inertia")

    def energy(self, t: float, mu: Vec) -> float:
        return 0.5 * dot(mu, self._velocity(t, mu))

    def gradient(self, t: float, mu: Vec) -> Vec:
        """xi = J(t)^-1 mu.  mu : (dim,)."""
        return self._velocity(t, mu)

    def _velocity(self, t: float, mu: Vec) -> Vec:
        return times(self._inverse(self.inertia(t)), mu)

    def at(self, t: float) -> KineticEnergy:
        """The kinetic energy with J(t)."""
        inertia = self.inertia(t)
        return with_fields(_EMPTY, inertia=inertia, inverse=self._inverse(inertia))

    def _inverse(self, inertia: Vec | Mat) -> Vec | Mat:
        return inverse(inertia) if isinstance(inertia, vectors.Mat) else 1.0 / inertia
