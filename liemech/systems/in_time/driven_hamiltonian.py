"""Energies on the dual of a Lie algebra that change with time."""

from __future__ import annotations

from typing import Any, ClassVar

from ...errors import undefined
from ...formulas import Record, Vec, gradient, record
from ...formulas.classes.derived import derived, derived_from
from ..hamiltonian import Hamiltonian


@record
class DrivenHamiltonian(Record):
    """The energy of a body as a function of time and momentum, K(t, mu).

    A subclass writes `energy`; the gradient is derived unless it is written too.  Its fields are
    the parameters.

    coupled : is it that of one of many sites, which asks the others?

    Source: Ge and Marsden, Phys. Lett. A 133 (1988), 134.
    """

    coupled: ClassVar[bool] = False

    def energy(self, t: float, mu: Vec) -> float:
        """K(t, mu).  mu : (dim,)."""
        raise undefined(self, "energy")

    @property
    def of_species(self) -> tuple[Any, ...]:
        """The energies of a body, one for each species of sites: itself."""
        return (self,)

    @derived
    def gradient(self, t: float, mu: Vec) -> Vec:
        """The velocity xi = dK/dmu.  mu : (dim,)."""
        return gradient(lambda m: self.energy(t, m), mu)

    def _free(self, t: float, mu: Vec) -> Vec:
        """The velocity, were a site that is held free."""
        return self.gradient(t, mu)

    @derived_from("energy")
    def at(self, t: float) -> Any:
        """The energy that is for ever what this one is at time t."""
        return Frozen(self, t)


@record
class Frozen(Hamiltonian):
    """A driven energy frozen at one time, H(mu) = K(time, mu).

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., 13.7.
    """

    driven: DrivenHamiltonian
    time: float

    def energy(self, mu: Vec) -> float:
        """K(time, mu).  mu : (dim,)."""
        return self.driven.energy(self.time, mu)

    def gradient(self, mu: Vec) -> Vec:
        """The velocity dK/dmu at the frozen time.  mu : (dim,)."""
        return self.driven.gradient(self.time, mu)
