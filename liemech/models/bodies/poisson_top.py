"""A rigid body in a field that depends on the vertical: momentum and vertical, (mu, Gamma), in body axes."""

from __future__ import annotations

from dataclasses import field

from ...errors import InvalidInput
from ...formulas import Vec, cos, plain, record, sin, vec
from ...groups.poisson_structure import LiePoissonStructure, PoissonStructure
from ...groups.rigid.se3 import SE3
from ...rooms.poisson.poisson import PoissonSystem
from ...systems.hamiltonian import Hamiltonian
from ...systems.inertia import checked_inertia
from ...systems.parts import Part, SplitHamiltonian, StraightLineFlow


@record
class Height(Hamiltonian):
    """The potential energy w Gamma . c of a heavy top, of points (mu, Gamma).

    weight : w.  centre : c, (3,).

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 1.4.
    """

    weight: float
    centre: Vec

    def energy(self, mu: Vec) -> float:
        """w Gamma . c.  mu : (6,), the point (mu, Gamma)."""
        c = self.centre
        return self.weight * (c[0] * mu[3] + c[1] * mu[4] + c[2] * mu[5])

    def gradient(self, mu: Vec) -> Vec:
        """(0, w c).  mu : (6,)."""
        return vec(0.0, 0.0, 0.0, *[self.weight * c for c in self.centre])


@record
class Turn(Part):
    """mu_i^2/(2 J_i), of points (mu, Gamma): a turn about the axis i, at a constant rate.

    axis : i, from 0.  moment : J_i.

    Source: McLachlan, Phys. Rev. Lett. 71 (1993), 3043; Reich, Physica D 76 (1994), 375.
    """

    axis: int
    moment: float

    def energy(self, mu: Vec) -> float:
        """mu_i^2/(2 J_i).  mu : (6,), the point (mu, Gamma)."""
        return 0.5 * (mu[self.axis] * mu[self.axis]) / self.moment

    def gradient(self, mu: Vec) -> Vec:
        """mu_i/J_i, in the place i.  mu : (6,)."""
        return vec(*[mu[i] / self.moment if i == self.axis else 0.0 for i in range(6)])

    def flow(self, structure: PoissonStructure, y: Vec, t: float) -> Vec:
        """Both vectors turned about the axis by -t mu_i/J_i.  y : (6,)."""
        before, j, k = plain(y), (self.axis + 1) % 3, (self.axis + 2) % 3
        half = 0.5 * (t * (before[self.axis] / self.moment))
        s, c = sin(half), cos(half)
        sine, versine = 2.0 * (s * c), 2.0 * (s * s)
        new = [*y]
        for start in (0, 3):
            a, b = before[start + j], before[start + k]
            new[start + j] = y[start + j] + (sine * b - versine * a)
            new[start + k] = y[start + k] - (sine * a + versine * b)
        return vec(*new)


@record
class PoissonTop(PoissonSystem):
    """A heavy top in principal axes, y = (mu, Gamma):  mu' = mu x J^-1 mu + w Gamma x c,  Gamma' = Gamma x J^-1 mu.

    moments : J, the principal moments about the fixed point, (3,), in kg m^2.  weight : w = m g, in
    N.  centre : c, (3,), in m.
    y : the momentum mu in body axes, in kg m^2/s, and the upward vertical Gamma in body axes.

    Conserved: the energy, Gamma . Gamma and mu . Gamma.  The energy has four parts: a turn about
    each axis, and the field, which kicks.  `HeavyTop` is the same body with its attitude.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., sections 1.4 and
    14.7; Touma and Wisdom, Astron. J.  107 (1994), 1189 (the splitting).
    """

    structure: LiePoissonStructure = field(init=False, repr=False, default=LiePoissonStructure(SE3()))
    hamiltonian: SplitHamiltonian = field(init=False, repr=False)
    moments: Vec
    weight: float
    centre: Vec

    def __post_init__(self) -> None:
        inertia = checked_inertia(self.moments, f"{type(self).__name__}: moments", 3)[0]
        if not len(inertia) == len(self.centre) == 3 or not isinstance(inertia, tuple):
            raise InvalidInput(
                f"{type(self).__name__}: moments and centre have three components each; got {self.moments!r}"
            )
        turns = [Turn(i, moment) for i, moment in enumerate(inertia)]
        object.__setattr__(
            self, "hamiltonian", SplitHamiltonian((*turns, StraightLineFlow(Height(self.weight, self.centre))))
        )
        super().__post_init__()
