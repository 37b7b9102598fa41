"""Energies on the dual of a Lie algebra that change with time."""

from __future__ import annotations

from typing import ClassVar

from ..errors import undefined
from ..formulas import Record, Vec, gradient, record
from ..formulas.derived import derived


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

    @derived
    def gradient(self, t: float, mu: Vec) -> Vec:
        """The velocity xi = dK/dmu.  mu : (dim,)."""
        return gradient(lambda m: self.energy(t, m), mu)
