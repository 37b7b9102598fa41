"""The equations of Maxwell and Bloch, real-valued: light in a medium of two levels."""

from __future__ import annotations

from dataclasses import field
from typing import ClassVar

from ...formulas import Mat, Vec, mat, record, vec
from ...groups.poisson_structure import PoissonStructure
from ...rooms.poisson.poisson import PoissonSystem
from ...systems.hamiltonian import Hamiltonian
from ...systems.parts import FunctionOfCoordinate, SplitHamiltonian


@record
class MaxwellBlochStructure(PoissonStructure):
    """B = [[0, 1, 0], [-1, 0, x], [0, -x, 0]], with the Casimir z + x^2/2.

    Source: David and Holm, J. Nonlinear Sci. 2 (1992), 241.
    """

    dim: ClassVar[int] = 3
    rank: ClassVar[int] = 2

    def matrix(self, y: Vec) -> Mat:
        """B(x, y, z).  y : (3,)."""
        x = y[0]
        return mat(vec(0.0, 1.0, 0.0), vec(-1.0, 0.0, x), vec(0.0, -x, 0.0))

    def casimirs(self, y: Vec) -> Vec:
        """z + x^2/2.  y : (3,)."""
        return vec(y[2] + 0.5 * (y[0] * y[0]))

    def coordinate_flow(self, y: Vec, index: int, s: float) -> Vec:
        """y - s;  x + s and z - s x - s^2/2;  y + s x.  y : (3,)."""
        if index == 0:
            return vec(y[0], y[1] - s, y[2])
        if index == 1:
            return vec(y[0] + s, y[1], y[2] - s * (1.0 * y[0] + 0.5 * s))
        return vec(y[0], y[1] + s * (1.0 * y[0]), y[2])


@record
class HalfSquare(Hamiltonian):
    """y_i^2/2, of one coordinate.

    index : i, from 0.  dim : of the space.  weight : what the square is multiplied by, 1 by
    default.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.5.3.
    """

    index: int
    dim: int
    weight: float = 1.0

    def energy(self, mu: Vec) -> float:
        """w y_i^2/2.  mu : (dim,)."""
        return 0.5 * self.weight * (mu[self.index] * mu[self.index])

    def gradient(self, mu: Vec) -> Vec:
        """w y_i, in the place i.  mu : (dim,)."""
        return vec(*[self.weight * mu[i] if i == self.index else 0.0 for i in range(self.dim)])


@record
class MaxwellBloch(PoissonSystem):
    """Maxwell and Bloch's equations x' = y, y' = x z, z' = -x y: the structure above and
    H = (y^2 + z^2)/2.

    Conserved: the energy and z + x^2/2.  With the roles of both exchanged the same equations
    belong to another structure, that of se(2)*.

    Source: David and Holm, J. Nonlinear Sci. 2 (1992), 241; Puta, C. R. Acad. Sci. Paris 318
    (1994), 679.
    """

    structure: MaxwellBlochStructure = field(init=False, repr=False, default=MaxwellBlochStructure())
    hamiltonian: SplitHamiltonian = field(init=False, repr=False)

    def __post_init__(self) -> None:
        parts = FunctionOfCoordinate(HalfSquare(1, 3), 1), FunctionOfCoordinate(HalfSquare(2, 3), 2)
        object.__setattr__(self, "hamiltonian", SplitHamiltonian(parts))
        super().__post_init__()
