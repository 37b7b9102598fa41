"""Point masses that attract each other: the N-body problem, its figure eight, and the outer Solar System."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from ...errors import InvalidInput
from ...formulas import Vec, norm, record, vec, vectors
from ...formulas.classes.of_each import each
from ...groups.vector_space import VectorSpace
from ...rooms.sites.graphs import all_pairs
from ...rooms.sites.separable_sites import SeparableSites
from ...rooms.sites.terms.terms import PerSite, Terms
from ...rooms.sites.terms.trials_of_terms import in_one_place
from ...systems.canonical import CanonicalState
from ...systems.kinetic_energy import KineticEnergy
from ...systems.lie_poisson import LiePoissonSystem
from ...systems.mechanical import MechanicalSystem
from ..input_checks import check_positive
from ..many.water import Gravity

VX, VY = 0.3471168881189269382427769203203, 0.53272494538803022926202798769193
"""Velocities of the figure eight (Newton's method on the choreography, 30 digits); Li and Liao have the first ten."""

EIGHT_PERIOD = 6.325913982926211677589000333967

OUTER = (
    (1.00000597682, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
    (0.000954786104043, (-3.5023653, -3.8169847, -1.5507963), (0.00565429, -0.00412490, -0.00190589)),
    (0.000285583733151, (9.0755314, -3.0458353, -1.6483708), (0.00168318, 0.00483525, 0.00192462)),
    (0.0000437273164546, (8.3101420, -16.2901086, -7.2521278), (0.00354178, 0.00137102, 0.00055029)),
    (0.0000517759138449, (11.4707666, -25.7294829, -10.8169456), (0.00288930, 0.00114527, 0.00039677)),
    (1.0 / 1.3e8, (-15.5387357, -25.2225594, -3.1902382), (0.00276725, -0.00170702, -0.00136504)),
)
"""Masses in Suns, positions in AU, velocities in AU/day: the Sun with the inner planets, Jupiter, ..., Pluto."""


@record
class NBody(SeparableSites):
    """Point masses in space or in the plane, H = sum |p_i|^2/(2 m_i) - G sum_(i < j) m_i
    m_j/|q_i - q_j|.

    masses : m, (N,).  gravity : G.  dimension : 3, or 2 for motion in a plane.
    q, p : positions and momenta of all bodies, one body after the other, (N dimension,).

    Seven bodies in space are written out, as one; of more, one body is stepped in a loop over all,
    which is faster from there on, and takes any number.
    Conserved: the energy, the total momentum and the angular momentum.
    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., I.2.4.
    """

    small: ClassVar[int] = 21
    time_unit: ClassVar[str] = ""
    masses: Vec
    gravity: float = 1.0
    dimension: int = 3

    def __post_init__(self) -> None:
        if self.dimension not in (2, 3):
            raise InvalidInput(f"{type(self).__name__}: dimension is 2 or 3; got {self.dimension!r}")
        if len(self.masses) < 2:
            raise InvalidInput(f"{type(self).__name__}: masses are two at least; got {self.masses!r}")
        super().__post_init__()
        check_positive(self, "masses", "gravity")

    @property
    def degrees(self) -> int:  # type: ignore[override]
        """The number of coordinates, N times the dimension."""
        return self.dimension * len(self.masses)

    @property
    def sites(self) -> int:
        """The number N of bodies, which are sites."""
        return len(self.masses)

    def masses_in_space(self) -> MechanicalSystem:
        """The masses on VectorSpace(dimension) ** N, with `Gravity` of all pairs."""
        m, d = np.array(self.masses), self.dimension
        kinetic: Any = PerSite(KineticEnergy(each(np.repeat(m[:, None], d, axis=1))))
        pulls: Any = Terms(Gravity(self.gravity).over(all_pairs()), mass=each(m))
        return MechanicalSystem(LiePoissonSystem(VectorSpace(d) ** len(m), kinetic), pulls)

    def _require_places(self, name: str, q: np.ndarray) -> None:
        for member in q.reshape(-1, len(self.masses), self.dimension):
            for i, j in in_one_place(member):
                raise InvalidInput(
                    f"{name}: masses {i} and {j} are in one place, where they draw each other without limit"
                )

    def kinetic(self, p: Vec) -> float:
        """sum |p_i|^2/(2 m_i).  p : (N dimension,)."""
        d = self.dimension
        return vectors.sum(
            [p[i * d + k] * p[i * d + k] / (2.0 * m) for i, m in enumerate(self.masses) for k in range(d)]
        )

    def potential(self, q: Vec) -> float:
        """-G sum m_i m_j/|q_i - q_j|.  q : (N dimension,)."""
        m, pairs = self.masses, [(i, j) for i in range(len(self.masses)) for j in range(i)]
        return -vectors.sum([self.gravity * m[i] * m[j] / norm(self._apart(q, i, j)) for i, j in pairs])

    def velocity(self, q: Vec, p: Vec) -> Vec:
        """p_i/m_i.  q, p : (N dimension,)."""
        return vec(*[p[i] / self.masses[i // self.dimension] for i in range(self.degrees)])

    def force(self, q: Vec, p: Vec) -> Vec:
        """-G sum_j m_i m_j (q_i - q_j)/|q_i - q_j|^3.  q, p : (N dimension,)."""
        d = self.dimension
        force = [0.0 for _ in range(self.degrees)]
        for i in range(len(self.masses)):
            for j in range(i):
                x = self._apart(q, i, j)
                square = x @ x
                pull = self.gravity * self.masses[i] * self.masses[j] / (square * norm(x))
                for k in range(d):
                    force[i * d + k] = force[i * d + k] - pull * x[k]
                    force[j * d + k] = force[j * d + k] + pull * x[k]
        return vec(*force)

    def momentum(self, p: Vec) -> Vec:
        """The sum of all momenta, (dimension,).  p : (N dimension,)."""
        d = self.dimension
        return vec(*[vectors.sum([p[i * d + k] for i in range(len(self.masses))]) for k in range(d)])

    def angular_momentum(self, q: Vec, p: Vec) -> Vec:
        """sum q_i x p_i, (3,), or one number in the plane, (1,).  q, p : (N dimension,)."""
        d = self.dimension
        planes = ((0, 1),) if d == 2 else ((1, 2), (2, 0), (0, 1))
        bodies = range(0, self.degrees, d)
        return vec(*[vectors.sum([q[i + a] * p[i + b] - q[i + b] * p[i + a] for i in bodies]) for a, b in planes])

    def constants(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The energy, momentum and angular momentum."""
        return super().constants(states) | self.momenta_of_sites(states)

    def momenta_of_sites(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The momentum and angular momentum, sums over the bodies."""
        q, p = states["q"], states["p"]
        momenta = {"momentum": self.momentum(p), "angular momentum": self.angular_momentum(q, p)}
        return {name: np.asarray(value) for name, value in momenta.items()}

    def _apart(self, q: Vec, i: int, j: int) -> Vec:
        d = self.dimension
        return vec(*[q[i * d + k] - q[j * d + k] for k in range(d)])

    # ---------------------------------------------------------------- known motions

    @classmethod
    def figure_eight(cls) -> tuple[NBody, CanonicalState]:
        """Three equal masses that follow each other on an eight, with G = m = 1; the period is
        6.3259139829262.

        Source: Chenciner and Montgomery, Annals of Math. 152 (2000), 881; Simo, in Celestial
        Mechanics, Contemp. Math. 292 (2002).
        """
        system = cls(masses=vec(1.0, 1.0, 1.0), gravity=1.0, dimension=2)
        return system, system.state([-1.0, 0.0, 1.0, 0.0, 0.0, 0.0], [VX, VY, VX, VY, -2.0 * VX, -2.0 * VY])

    @classmethod
    def outer_solar_system(cls, barycentric: bool = True) -> tuple[NBody, CanonicalState]:
        """The Sun (with the inner planets), Jupiter, Saturn, Uranus, Neptune and Pluto on 5
        September 1994; AU, days, Suns.

        barycentric : is the centre of mass at rest in the origin, or the Sun?

        Source: Hairer, Lubich, Wanner, I.2.4, table 2.2 (Ahnerts Kalender 1994).
        """
        masses, q, v = (np.array(column) for column in zip(*OUTER, strict=True))
        if barycentric:
            q, v = (x - masses @ x / masses.sum() for x in (q, v))
        system = cls(masses=masses, gravity=2.95912208286e-4)
        return system, system.state(q.ravel(), (masses[:, None] * v).ravel())
