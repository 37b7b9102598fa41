"""Quadratic energy: Lagrangian and Hamiltonian of a free body."""

from __future__ import annotations

from dataclasses import field
from typing import Any

import numpy as np

from ..formulas import Mat, Vec, dot, record, vectors
from .hamiltonian import Hamiltonian
from .lagrangian import Lagrangian


@record
class KineticEnergy(Hamiltonian, Lagrangian):
    """Kinetic energy with inertia J: l(xi) = xi . J xi/2 and, the same number, H(mu) = mu . J^-1 mu/2.

    inertia : (dim,) principal moments, or (dim, dim) a symmetric matrix.  The inverse is stored: formulas never divide by J.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., sections 1.2 and 15.2.
    """

    inertia: Vec | Mat
    inverse: Vec | Mat = field(init=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if isinstance(self.inertia, vectors.Vec):
            inverse: Vec | Mat = 1.0 / self.inertia
        else:
            inverse = Mat.of(np.linalg.inv(np.array(self.inertia)).tolist())
        object.__setattr__(self, "inverse", inverse)

    def energy(self, mu: Vec) -> float:
        """H(mu) = mu . J^-1 mu/2."""
        return 0.5 * dot(mu, self.gradient(mu))

    def gradient(self, mu: Vec) -> Vec:
        """xi = J^-1 mu."""
        return times(self.inverse, mu)

    def value(self, xi: Vec) -> float:
        """l(xi) = xi . J xi/2."""
        return 0.5 * dot(xi, self.momentum(xi))

    def momentum(self, xi: Vec) -> Vec:
        """mu = J xi."""
        return times(self.inertia, xi)

    def hessian(self, xi: Vec) -> Mat | Vec:
        """J."""
        return self.inertia

    def _shape(self, argument: str, kind: str) -> tuple[int, ...] | None:
        return (len(self.inertia),) if kind == "Vec" else None


def times(inertia: Vec | Mat, x: Any) -> Any:
    """The product of an inertia, where a Vec stands for a diagonal matrix, with a vector or another such matrix."""
    return inertia @ x if isinstance(inertia, vectors.Mat) else inertia * x
