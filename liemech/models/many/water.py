"""Rigid water molecules of three sites, and the attraction of masses."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import field
from typing import Any, ClassVar

import numpy as np

from ...errors import InvalidInput
from ...formulas import Mat, Vec, dot, norm, record, sqrt, vec
from ...groups.rigid.se3 import join
from ...rooms.sites.terms.point_terms import PointTerm
from ...rooms.sites.terms.terms import Term
from ...systems.kinetic_energy import KineticEnergy
from ..input_checks import check_positive

COULOMB = 138935.45764438
"""e^2/(4 pi epsilon_0) in u A^3/ps^2, with the constants of CODATA 2018."""

KILOJOULE = 100.0
"""A kJ/mol in u A^2/ps^2."""

OXYGEN, HYDROGEN = 15.9994, 1.008
"""Masses in u."""


@record
class SPC(PointTerm):
    """Rigid water molecules, a term of two on SE(3): charges on the three atoms, and one
    Lennard-Jones potential between the oxygens.

        V = sum q_i q_j C/r_ij + (B/r_OO)^12 - (A/r_OO)^6

    Lengths in angstrom, times in ps, masses in u; energies are then in u A^2/ps^2 = 0.01 kJ/mol.

    hydrogen : the charge of a hydrogen, in e; the oxygen has twice as much, negative.  A, B : of
    the Lennard-Jones potential, in A times the root of kJ/mol, (kJ/mol)^(1/6) and (kJ/mol)^(1/12).
    length, angle : of the bonds O-H in A, and between them in degrees.  coulomb : C.
    The element of a molecule is the pose of its centre of mass and its principal axes, with the
    oxygen on the third one.  `kinetic_energy` is that of one molecule.  SPC/E is
    `SPC(hydrogen=0.4238)`.

    Source: Berendsen, Postma, van Gunsteren and Hermans, in Intermolecular Forces (1981), 331; for
    SPC/E Berendsen, Grigera and Straatsma, J. Phys. Chem. 91 (1987), 6269.
    """

    time_unit: ClassVar[str] = "ps"
    hydrogen: float = 0.41
    A: float = 3.7122
    B: float = 3.428
    length: float = 1.0
    angle: float = 109.47122063449069
    coulomb: float = COULOMB
    atoms: Mat = field(init=False, repr=False)
    moments: Vec = field(init=False, repr=False)
    attraction: float = field(init=False, repr=False)
    repulsion: float = field(init=False, repr=False)

    def __post_init__(self) -> None:
        check_positive(self, "A", "B", "length")
        if not 0.0 < self.angle < 180.0:
            raise InvalidInput(f"SPC: angle is between 0 and 180 degrees; got {self.angle:g}")
        half = math.radians(0.5 * self.angle)
        side, height = self.length * math.sin(half), self.length * math.cos(half)
        low = 2.0 * HYDROGEN * height / (OXYGEN + 2.0 * HYDROGEN)
        atoms = np.array([[0.0, 0.0, low], [side, 0.0, low - height], [-side, 0.0, low - height]])
        masses = np.array([OXYGEN, HYDROGEN, HYDROGEN])
        squares = masses @ atoms**2
        whole = masses.sum()
        moments = np.array([squares.sum() - square for square in squares])
        object.__setattr__(self, "atoms", atoms)
        object.__setattr__(self, "moments", [*moments, whole, whole, whole])
        object.__setattr__(self, "attraction", KILOJOULE * self.A**6)
        object.__setattr__(self, "repulsion", KILOJOULE * self.B**12)
        super().__post_init__()

    def __repr__(self) -> str:
        defaults = {f.name: f.default for f in dataclasses.fields(self) if f.init}
        changed = [f"{n}={getattr(self, n):g}" for n, x in defaults.items() if getattr(self, n) != x]
        return f"SPC({', '.join(changed)})"

    @property
    def kinetic_energy(self) -> KineticEnergy:
        """The inertia of one molecule: moments in u A^2, and its mass in u."""
        return KineticEnergy(self.moments)

    def points(self, g: Any) -> tuple[Vec, ...]:
        """The oxygen and the hydrogens, which are in the plane of the first axis and the third."""
        (_, _, high), (side, _, low), _ = self.atoms
        along = vec(*[high * g[k][2] + g[k][3] for k in range(3)])
        middle = [low * g[k][2] + g[k][3] for k in range(3)]
        right = vec(*[middle[k] + side * g[k][0] for k in range(3)])
        left = vec(*[middle[k] - side * g[k][0] for k in range(3)])
        return along, right, left

    def between(self, a: Any, b: Any) -> float:
        """The energy of two molecules, in u A^2/ps^2."""
        d = a[0] - b[0]
        s = 1.0 / dot(d, d)
        s = s * s * s
        energy = s * (self.repulsion * s - self.attraction)
        for i in range(3):
            for j in range(3):
                d = a[i] - b[j]
                energy = energy + self._product(i, j) * (1.0 / sqrt(dot(d, d)))
        return energy

    def pushes(self, a: Any, b: Any) -> tuple[Vec, Vec]:
        """The forces on the atoms of the first molecule and of the second, in space."""
        d = a[0] - b[0]
        r = 1.0 / dot(d, d)
        s = r * r * r
        push = (r * s * (12.0 * self.repulsion * s - 6.0 * self.attraction)) * d
        none = vec(0.0, 0.0, 0.0)
        of_a, of_b = [push, none, none], [-push, none, none]
        for i in range(3):
            for j in range(3):
                d = a[i] - b[j]
                r = 1.0 / sqrt(dot(d, d))
                push = (self._product(i, j) * (r * r * r)) * d
                of_a[i] = of_a[i] + push
                of_b[j] = of_b[j] - push
        return vec(*[x for f in of_a for x in f]), vec(*[x for f in of_b for x in f])

    def felt(self, group: Any, g: Any, push: Any) -> Vec:
        """Torque and force in the axes of a molecule, of forces on its atoms in space."""
        (_, _, high), (side, _, low), _ = self.atoms
        oxygen = _turned_back(g, push[:3])
        hydrogens = _turned_back(g, push[3:6] + push[6:])
        apart = _turned_back(g, push[3:6] - push[6:])
        x, y = (high * oxygen[k] + low * hydrogens[k] for k in range(2))
        return join(vec(-y, x - side * apart[2], side * apart[1]), oxygen + hydrogens)

    def _product(self, i: int, j: int) -> float:
        """The product of the charges of two atoms, the first of each molecule being the oxygen."""
        weights = (-2.0, 1.0, 1.0)
        return weights[i] * weights[j] * (self.coulomb * self.hydrogen * self.hydrogen)


def _turned_back(g: Any, x: Vec) -> Vec:
    """The vector R^T x in the molecule's axes."""
    return vec(*[g[0][k] * x[0] + g[1][k] * x[1] + g[2][k] * x[2] for k in range(3)])


@record
class Gravity(Term):
    """The attraction of two masses, -G m_a m_b/|x_a - x_b|, on VectorSpace(n), with `mass` a
    parameter of the sites: `Terms(Gravity().over(neighbours.all_pairs()), mass=each(m))`.

    constant : G.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., I.2.4.
    """

    constant: float = 1.0

    def energy(self, a: Any, b: Any) -> float:
        """The potential energy of two masses, -G m_a m_b/r."""
        return -self.constant * a.mass * b.mass / norm(a.g - b.g)

    def force(self, group: Any, k: int, *sites: Any) -> Vec:
        return self.forces(group, *sites)[k]

    def forces(self, group: Any, *sites: Any) -> tuple[Vec, ...]:
        """The pulls of two masses on each other."""
        a, b = sites
        d = b.g - a.g
        square = dot(d, d)
        pull = (self.constant * a.mass * b.mass / (square * sqrt(square))) * d
        return pull, -pull
