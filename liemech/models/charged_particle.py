"""Charged particles in magnetic fields that are not uniform, and the centres about which they gyrate."""

from __future__ import annotations

from dataclasses import field
from typing import Any, ClassVar

import numpy as np

from ..errors import NotDefined, require
from ..formulas import (
    Mat,
    Record,
    Vec,
    asinh,
    atan2,
    cross,
    dot,
    jacobian,
    log,
    mat,
    norm,
    plain,
    record,
    sqrt,
    vec,
    where,
)
from ..formulas.classes.derived import closed_form_of, derived_from
from ..groups.poisson_structure import PoissonStructure
from ..rooms.poisson.poisson import PoissonSystem
from ..systems.hamiltonian import Hamiltonian
from ..systems.parts import Part, SplitHamiltonian, StraightLineFlow
from .lattices.maxwell_bloch import HalfSquare


@record
class MagneticField(Record):
    """A magnetic field B(x) without sources.

    1. A subclass writes `at(x)`.  div B must be zero, or there is no Poisson structure:
    `check_poisson` looks.
    2. For explicit splittings it writes `integral`, in closed form: a quadrature would be no
    Poisson map.

    Source: He, Zhou, Sun, Liu and Qin, Phys. Lett. A 381 (2017), 568.
    """

    def at(self, x: Vec) -> Vec:
        """B(x), (3,).  x : (3,)."""
        raise NotDefined(f"{type(self).__name__} must define `at`")

    @derived_from("at")
    def integral(self, component: int, axis: int, x: Vec, length: float) -> float:
        """The integral of a component of B along an axis, from x over a length.  component,
        axis : 0, 1, 2, different; x : (3,).
        """
        raise NotDefined(f"{type(self).__name__} must define `integral`, which explicit splittings need")

    def _shape(self, argument: str, kind: str) -> tuple[int, ...] | None:
        return (3,) if kind == "Vec" else None


@record
class UniformField(MagneticField):
    """A uniform field, B constant.

    strength : B, (3,).  Source: Landau and Lifshitz, The Classical Theory of Fields, section 21.
    """

    strength: Vec

    def at(self, x: Vec) -> Vec:
        """The field B, which is the same everywhere.  x : (3,)."""
        return self.strength

    def integral(self, component: int, axis: int, x: Vec, length: float) -> float:
        """B_component times the length.  x : (3,)."""
        return self.strength[component] * length


@record
class AxialField(MagneticField):
    """A field along the third axis that grows with the distance from it, B = (0, 0, s R),
    R^2 = x_1^2 + x_2^2.

    slope : s.  Source: Hairer and Lubich, BIT Numer. Math. 58 (2018), 969.
    """

    slope: float = 1.0

    def at(self, x: Vec) -> Vec:
        """(0, 0, s R).  x : (3,)."""
        return vec(0.0, 0.0, self.slope * sqrt(x[0] * x[0] + x[1] * x[1]))

    def integral(self, component: int, axis: int, x: Vec, length: float) -> float:
        """The integral of s (a^2 + c^2)^(1/2) over a, the coordinate of the axis.  x : (3,)."""
        if component != 2:
            return 0.0 * length
        a, c = x[axis], x[1 - axis]
        return self.slope * (_root(a + length, c) - _root(a, c))


def _root(a: Any, c: Any) -> Any:
    """(a (a^2 + c^2)^(1/2) + c^2 asinh(a/|c|))/2, a |a|/2 for c = 0."""
    size = abs(c)
    ratio = a / where(size > 0.0, size, 1.0)
    return 0.5 * (a * sqrt(a * a + c * c) + c * c * asinh(ratio))


@record
class TokamakField(MagneticField):
    """A model of a tokamak, B = (-(2 x_2 + x_1 x_3), 2 x_1 - x_2 x_3, R (R - 1))/(2 R^2), in units
    of its major radius.

    Source: Qin et al., Why is Boris algorithm so good?, Phys. Plasmas 20 (2013), 084503.
    """

    def at(self, x: Vec) -> Vec:
        """B.  x : (3,), not on the third axis."""
        square = x[0] * x[0] + x[1] * x[1]
        R = sqrt(square)
        toroidal = vec(-(2.0 * x[1] + x[0] * x[2]), 2.0 * x[0] - x[1] * x[2], R * (R - 1.0))
        return 0.5 / square * toroidal

    def integral(self, component: int, axis: int, x: Vec, length: float) -> float:
        """The integral by logarithms and angles.  x : (3,), on a way that does not cross the third axis."""
        end = vec(*[x[i] + length if i == axis else x[i] for i in range(3)])
        if axis == 2:
            square, mean = x[0] * x[0] + x[1] * x[1], x[2] + 0.5 * length
            across = -(2.0 * x[1] + x[0] * mean) if component == 0 else 2.0 * x[0] - x[1] * mean
            return length * (0.5 * across / square)
        R0, R1 = sqrt(x[0] * x[0] + x[1] * x[1]), sqrt(end[0] * end[0] + end[1] * end[1])
        if component == 2:
            a, b = x[axis], end[axis]
            s = where(a + b > 0.0, 1.0, -1.0)
            return 0.5 * (length - s * log((s * b + R1) / (s * a + R0)))
        if axis == 0:  # of B_2 over x_1
            turned = atan2(x[1], x[0]) - atan2(end[1], end[0])
            return log(R1 / R0) - 0.5 * x[2] * turned
        turned = atan2(x[0], x[1]) - atan2(end[0], end[1])
        return -log(R1 / R0) - 0.5 * x[2] * turned


@record
class MagneticStructure(PoissonStructure):
    """The structure of a charged particle, y = (x, v): {x_i, v_j} = delta_ij, {v_i, v_j} = e_ijk
    B_k(x), for unit charge and mass.

    field : B.  The identity of Jacobi is div B = 0.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 6.7; He et al. (2017).
    """

    dim: ClassVar[int] = 6
    rank: ClassVar[int] = 6
    unit_blocks: ClassVar[tuple[int, ...]] = (3, 3)
    field: MagneticField

    def matrix(self, y: Vec) -> Mat:
        """[[0, 1], [-1, -hat B]].  y : (6,)."""
        B = self.field.at(vec(y[0], y[1], y[2]))
        return mat(
            vec(0.0, 0.0, 0.0, 1.0, 0.0, 0.0),
            vec(0.0, 0.0, 0.0, 0.0, 1.0, 0.0),
            vec(0.0, 0.0, 0.0, 0.0, 0.0, 1.0),
            vec(-1.0, 0.0, 0.0, 0.0, B[2], -B[1]),
            vec(0.0, -1.0, 0.0, -B[2], 0.0, B[0]),
            vec(0.0, 0.0, -1.0, B[1], -B[0], 0.0),
        )

    def sharp(self, y: Vec, a: Vec) -> Vec:
        """(a_v, a_v x B - a_x).  y, a : (6,)."""
        v = vec(a[3], a[4], a[5])
        turn = cross(v, self.field.at(vec(y[0], y[1], y[2])))
        return vec(*v, turn[0] - a[0], turn[1] - a[1], turn[2] - a[2])


@record
class SquaredVelocity(Part):
    """v_i^2/2, of points (x, v): x_i moves at a constant rate, and the field turns the other two
    velocities on the way.

    axis : i, from 0.  field : B.

    Source: He, Qin, Sun, Xiao, Zhang and Liu, Phys. Plasmas 22 (2015), 124503.
    """

    axis: int
    field: MagneticField

    def energy(self, mu: Vec) -> float:
        """v_i^2/2.  mu : (6,), the point (x, v)."""
        return 0.5 * (mu[3 + self.axis] * mu[3 + self.axis])

    def gradient(self, mu: Vec) -> Vec:
        """v_i, in its place.  mu : (6,)."""
        return vec(*[mu[i] if i == 3 + self.axis else 0.0 for i in range(6)])

    def flow(self, structure: PoissonStructure, y: Vec, t: float) -> Vec:
        """x_i + t v_i;  v_j - the integral of B_k, v_k + that of B_j over the way, i, j, k cyclic.
        y : (6,).
        """
        start, i = plain(y), self.axis
        j, k = (i + 1) % 3, (i + 2) % 3
        x, path = vec(start[0], start[1], start[2]), t * start[3 + i]
        new = [*y]
        new[i] = y[i] + path
        new[3 + j] = y[3 + j] - self.field.integral(k, i, x, path)
        new[3 + k] = y[3 + k] + self.field.integral(j, i, x, path)
        return vec(*new)


@record
class ElectricEnergy(Hamiltonian):
    """An electric potential phi(x), as an energy of points (x, v).

    potential : a Hamiltonian whose argument is x.

    Source: Landau and Lifshitz, The Classical Theory of Fields, section 16.
    """

    potential: Hamiltonian

    def energy(self, mu: Vec) -> float:
        """phi(x).  mu : (6,), the point (x, v)."""
        return self.potential.energy(vec(mu[0], mu[1], mu[2]))

    def gradient(self, mu: Vec) -> Vec:
        """(dphi, 0).  mu : (6,)."""
        return vec(*self.potential.gradient(vec(mu[0], mu[1], mu[2])), 0.0, 0.0, 0.0)


@record
class ChargedParticle(PoissonSystem):
    """A particle of unit charge and mass in a magnetic field and an electric potential: x' = v,
    v' = -dphi(x) + v x B(x).

    field : B, such as AxialField(), or a MagneticField of one's own.  potential : phi, a
    Hamiltonian of x, (3,); None if there is none.  y = (x, v) : position and velocity.  The energy
    is |v|^2/2 + phi; its four parts have motions in closed form if the field has its `integral`s,
    so that `Splitting` is explicit, of any order, and a Poisson map.

    Source: He, Qin, Sun, Xiao, Zhang and Liu, Phys. Plasmas 22 (2015), 124503; He et al., Phys.
    Lett. A 381 (2017), 568.
    """

    structure: MagneticStructure = field(init=False, repr=False)
    hamiltonian: SplitHamiltonian = field(init=False, repr=False)
    field: MagneticField
    potential: Hamiltonian | None = None

    def __post_init__(self) -> None:
        require(f"{type(self).__name__}: field", self.field, MagneticField, "a MagneticField, such as AxialField()")
        object.__setattr__(self, "structure", MagneticStructure(self.field))
        parts: list[Hamiltonian] = [SquaredVelocity(i, self.field) for i in range(3)]
        if type(self.field).integral is MagneticField.integral:
            parts = [HalfSquare(3 + i, 6) for i in range(3)]
        if self.potential is not None:
            parts.append(StraightLineFlow(ElectricEnergy(self.potential)))
        object.__setattr__(self, "hamiltonian", SplitHamiltonian(tuple(parts)))
        super().__post_init__()

    @property
    @closed_form_of("energy")
    def magnetic_field(self) -> MagneticField:
        """B, about which the method of Boris turns the velocity."""
        return self.field


# ---------------------------------------------------------------- guiding centre


@record
class GuidingCentreStructure(PoissonStructure):
    """The structure of the centre of gyration, y = (X, u), with b = B/|B|, B* = B + u curl b,
    B*p = b . B*:

        [[hat(b)/B*p, B*/B*p], [-B*^T/B*p, 0]]

    field : B.  With B in place of B* the identity of Jacobi would fail.
    """

    dim: ClassVar[int] = 4
    rank: ClassVar[int] = 4
    field: MagneticField

    def matrix(self, y: Vec) -> Mat:
        """B(X, u).  y : (4,)."""
        b, star, along = self.fields(y)
        s = star / along
        h = b / along
        return mat(
            vec(0.0, -h[2], h[1], s[0]),
            vec(h[2], 0.0, -h[0], s[1]),
            vec(-h[1], h[0], 0.0, s[2]),
            vec(-s[0], -s[1], -s[2], 0.0),
        )

    def fields(self, y: Vec) -> tuple[Vec, Vec, float]:
        """b, B* and B*p.  y : (4,)."""
        x, u = vec(y[0], y[1], y[2]), y[3]
        B = self.field.at(x)
        b = B / norm(B)
        slopes = jacobian(lambda z: self.field.at(z) / norm(self.field.at(z)), x)
        curl = vec(slopes[2, 1] - slopes[1, 2], slopes[0, 2] - slopes[2, 0], slopes[1, 0] - slopes[0, 1])
        star = B + u * curl
        return b, star, dot(b, star)


@record
class GuidingEnergy(Hamiltonian):
    """u^2/2 + mu |B(X)| + phi(X), of points (X, u).

    field : B.  moment : mu, the magnetic moment.  potential : phi, or None.

    Source: Cary and Brizard, Rev. Mod. Phys. 81 (2009), 693.
    """

    field: MagneticField
    moment: float
    potential: Hamiltonian | None = None

    def energy(self, mu: Vec) -> float:
        """u^2/2 + mu |B(X)| + phi(X).  mu : (4,), the point (X, u)."""
        x = vec(mu[0], mu[1], mu[2])
        total = 0.5 * (mu[3] * mu[3]) + self.moment * norm(self.field.at(x))
        return total if self.potential is None else total + self.potential.energy(x)


@record
class GuidingCentre(PoissonSystem):
    """The centre about which a charged particle gyrates, X' = (u B* + b x (mu d|B| + dphi))/B*p,
    u' = -B* . (mu d|B| + dphi)/B*p.

    field : B.  moment : mu, |v across B|^2/(2 |B|).  potential : phi, a Hamiltonian of X, or None.
    y = (X, u) : the centre, and the velocity along the field.

    No explicit Poisson integrator is known for it: RKMK of high order, or in a `DarbouxChart` the
    symplectic ones.

    Source: Littlejohn, J. Plasma Phys. 29 (1983), 111; Cary and Brizard, Rev. Mod. Phys. 81 (2009),
    693.
    """

    structure: GuidingCentreStructure = field(init=False, repr=False)
    hamiltonian: GuidingEnergy = field(init=False, repr=False)
    field: MagneticField
    moment: float
    potential: Hamiltonian | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "structure", GuidingCentreStructure(self.field))
        object.__setattr__(self, "hamiltonian", GuidingEnergy(self.field, self.moment, self.potential))
        super().__post_init__()

    @classmethod
    def of_particle(cls, particle: ChargedParticle, y: Any) -> tuple[GuidingCentre, np.ndarray]:
        """The system and the start, (4,), of the centre of a particle at y = (x, v), to first order
        in the gyration radius.
        """
        y = np.array(y, dtype=float)
        x, v = y[:3], y[3:]
        B = np.array(particle.field.at(x))
        size = np.linalg.norm(B)
        b = B / size
        along = float(v @ b)
        across = v - along * b
        moment = float(across @ across / (2.0 * size))
        centre: Any = cls
        return centre(particle.field, moment, particle.potential), np.array([*(x + np.cross(v, b) / size), along])
