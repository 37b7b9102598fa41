"""Hamiltonians on the dual of a Lie algebra."""

from __future__ import annotations

from typing import Any, ClassVar

from ..errors import undefined
from ..formulas import Mat, Record, Vec, gradient, record
from ..formulas.classes.derived import derived


@record
class Hamiltonian(Record):
    """The energy of a body as a function of its momentum, H(mu).

    A subclass writes `energy`; the gradient is derived unless it is written too.  Its fields are
    the parameters (`float`, `Vec`, `Mat` or other records).

    coupled : is it that of one of many sites, which asks the others?
    """

    coupled: ClassVar[bool] = False

    def energy(self, mu: Vec) -> float:
        """The energy H(mu), which a subclass writes.  mu : (dim,)."""
        raise undefined(self, "energy")

    @property
    def of_species(self) -> tuple[Any, ...]:
        """The energies of a body, one for each species of sites: itself, unless a site has several."""
        return (self,)

    @derived
    def gradient(self, mu: Vec) -> Vec:
        """The velocity xi = dH/dmu.  mu : (dim,)."""
        return gradient(lambda m: self.energy(m), mu)

    def _free(self, mu: Vec) -> Vec:
        """The velocity, were a site that is held free."""
        return self.gradient(mu)

    # does it know velocities as pairs, `velocity_pair`, of a group over the dual numbers?
    by_pairs: ClassVar[bool] = False

    @derived
    def velocity_matrix(self, algebra: Any, m: Mat) -> Mat:
        """The velocity as a matrix, hat(dH/dmu), from the matrix M that stands for the momentum: what
        methods for large matrices ask for.  An energy that knows it as a matrix writes it so.
        """
        return algebra.hat(self.gradient(algebra.pairing(m)))
