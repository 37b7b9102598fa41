"""Bodies that move freely in space: rigid ones, and Kirchhoff's in an ideal fluid."""

from __future__ import annotations

from dataclasses import field
from typing import Any

import numpy as np

from ...errors import InvalidInput
from ...formulas import Mat, Vec, check_finite, real_array, record
from ...groups.rigid.se3 import SE3
from ...systems.inertia import checked_inertia
from ...systems.kinetic_energy import KineticEnergy, kinetic_energy
from ...systems.lie_poisson import LiePoissonSystem


@record
class KirchhoffBody(LiePoissonSystem):
    """A rigid body in an ideal fluid that is at rest far away: Kirchhoff's equations

        Pi' = Pi x w + P x v,   P' = P x w,   R' = R hat(w),   p' = R v.

    inertia : of body and fluid together, (6,) or the symmetric positive matrix, (6, 6), of
    l(w, v) = (w, v) . I (w, v)/2, angular part first: in kg m^2, kg m and kg.  `of_blocks` takes it
    by parts.
    mu = (Pi, P) is the impulse in body axes, in kg m^2/s and kg m/s; g = [[R, p], [0, 1]] takes
    body to space.

    Conserved: the energy, P . P, Pi . P, and the impulse seen from space.  Raises InvalidInput if I
    is not symmetric and positive.

    Source: Kirchhoff, Vorlesungen ueber Mechanik (1876), lecture 19; Leonard and Marsden, Physica D
    105 (1997); Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 14.7.
    """

    group: SE3 = field(init=False, repr=False, default=SE3())
    hamiltonian: KineticEnergy = field(init=False, repr=False)
    lagrangian: KineticEnergy = field(init=False, repr=False)
    inertia: Vec | Mat

    def __post_init__(self) -> None:
        inertia, _ = checked_inertia(self.inertia, "KirchhoffBody: inertia", 6, mixed=True)
        object.__setattr__(self, "inertia", inertia)
        kinetic = kinetic_energy(inertia)
        object.__setattr__(self, "hamiltonian", kinetic)
        object.__setattr__(self, "lagrangian", kinetic)

    @classmethod
    def of_blocks(cls, angular: Any, linear: Any, coupling: Any = 0.0) -> KirchhoffBody:
        """The body with l(w, v) = w . J w/2 + w . D v + v . M v/2.

        angular : J, inertia and what the fluid adds, (3,) or (3, 3), in kg m^2.  linear : M, the
        mass and what the fluid adds, a number, (3,) or (3, 3), in kg.  coupling : D, (3, 3), in kg
        m.
        """
        J, M = (_square(block, f"KirchhoffBody: {name}") for block, name in ((angular, "angular"), (linear, "linear")))
        D = real_array(coupling, "KirchhoffBody: coupling")
        if D.shape not in ((), (3, 3)) or (D.shape == () and D != 0.0):
            raise InvalidInput(f"KirchhoffBody: coupling is a 3x3 matrix, or left out; got {coupling!r}")
        check_finite(D, "KirchhoffBody: coupling")
        D = D * np.ones((3, 3))
        whole = np.block([[J, D], [D.T, M]])
        diagonal = not np.any(whole - np.diag(np.diag(whole)))
        return cls(np.diag(whole) if diagonal else whole)


def _square(block: Any, name: str) -> np.ndarray:
    """A block as a matrix."""
    array = real_array(block, name)
    check_finite(array, name)
    if array.shape not in ((), (3,), (3, 3)):
        raise InvalidInput(f"{name} has shape {array.shape}; give a number, (3,) or (3, 3)")
    return array if array.ndim == 2 else np.diag(np.broadcast_to(array, 3))
