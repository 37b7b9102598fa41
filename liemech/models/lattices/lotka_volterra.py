"""Lotka and Volterra's predators and prey, any number of species, and the lattice of Volterra."""

from __future__ import annotations

from dataclasses import field
from typing import Any

import numpy as np

from ...errors import InvalidInput
from ...formulas import Mat, Vec, log, mat, real_array, record, vec
from ...formulas.classes.derived import closed_form_of
from ...groups.matrices.matrix_group import whole_number
from ...groups.poisson_structure import LogCanonical
from ...rooms.poisson.poisson import PoissonState, PoissonSystem, positive
from ...systems.hamiltonian import Hamiltonian
from ...systems.parts import FunctionOfCoordinate, SplitHamiltonian


@record
class SpeciesEnergy(Hamiltonian):
    """The energy of one species, d y - p ln y.

    index : which, from 0.  number : of all species.  weight : d.  rate : p.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.2.2.
    """

    index: int
    number: int
    weight: float
    rate: float

    def energy(self, mu: Vec) -> float:
        """d y - p ln y, y the component of this species.  mu : (n,)."""
        y = mu[self.index]
        return self.weight * y - self.rate * log(y)

    def gradient(self, mu: Vec) -> Vec:
        """d - p/y for this species, zero for the others.  mu : (n,)."""
        slope = self.weight - self.rate / mu[self.index]
        return vec(*[slope if i == self.index else 0.0 for i in range(self.number)])


@record
class LotkaVolterra(PoissonSystem):
    """Species that eat each other, y_i' = y_i sum_j c_ij (d_j y_j - p_j), with c_ij = -c_ji.

    coupling : c, (n, n), skew-symmetric.  weights : d, (n,).  rates : p, (n,).  Left out, they are
    those of two species, u' = u (v - 2), v' = v (1 - u).
    y : the numbers of individuals, (n,), positive.

    Conserved: the energy sum (d_i y_i - p_i ln y_i), and sum k_i ln y_i for every k with c k = 0.
    Not every system of Lotka and Volterra is of this form: the coefficients of its products must be
    c_ij d_j.

    Raises InvalidInput for a coupling that is not skew-symmetric, and for numbers that are not positive.
    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., I.1.1 and VII.2.2;
    Plank, J. Math. Phys. 36 (1995).
    """

    structure: LogCanonical = field(init=False, repr=False)
    hamiltonian: SplitHamiltonian = field(init=False, repr=False)
    coupling: Mat = mat(vec(0.0, 1.0), vec(-1.0, 0.0))
    weights: Vec = vec(1.0, 1.0)
    rates: Vec = vec(1.0, 2.0)

    def __post_init__(self) -> None:
        name = type(self).__name__
        structure = LogCanonical(self.coupling)
        n = structure.dim
        rows = [real_array(getattr(self, key), f"{name}: {key}") for key in ("weights", "rates")]
        for key, row in zip(("weights", "rates"), rows, strict=True):
            if row.shape != (n,) or not np.isfinite(row).all():
                raise InvalidInput(f"{name}: {key} are {n} finite numbers, as coupling has rows; got {row.tolist()}")
        object.__setattr__(self, "structure", structure)
        parts = [
            FunctionOfCoordinate(SpeciesEnergy(i, n, d, p), i)
            for i, (d, p) in enumerate(zip(*(row.tolist() for row in rows), strict=True))
        ]
        object.__setattr__(self, "hamiltonian", SplitHamiltonian(tuple(parts)))
        super().__post_init__()

    @classmethod
    def volterra_lattice(cls, n: int) -> LotkaVolterra:
        """Volterra's lattice of n species, u_i' = u_i (u_i+1 - u_i-1), with u_0 = u_n+1 = 0.

        For n odd u_1 u_3 ... u_n is kept, as are the eigenvalues of a matrix that
        `TodaLattice.of_volterra` makes.
        Source: Kac and van Moerbeke, Adv. Math. 16 (1975), 160.
        """
        n = whole_number("LotkaVolterra.volterra_lattice", n, 2)
        make: Any = cls
        return make(np.eye(n, k=1) - np.eye(n, k=-1), np.ones(n), np.zeros(n))

    @closed_form_of("energy", "gradient")
    def logarithmic_gradient(self, y: Vec) -> Vec:
        """d_i y_i - p_i.  y : (n,)."""
        return self.weights * y - self.rates

    def equilibrium(self) -> PoissonState:
        """The state at rest, y_i = p_i/d_i."""
        return self.state(np.array(self.rates) / np.array(self.weights))

    def _require(self, y: np.ndarray, where: str) -> None:
        positive(y, where)
