"""The chain of Fermi, Pasta and Ulam (and Tsingou): masses on springs that are not quite linear."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...formulas import Vec, dot, real_array, record, vec, vectors
from ...formulas.classes.of_each import each
from ...groups.matrices.matrix_group import whole_number
from ...groups.vector_space import VectorSpace
from ...rooms.sites.graphs import edges
from ...rooms.sites.separable_sites import SeparableSites
from ...rooms.sites.terms.terms import PerSite, Term, Terms
from ...systems.canonical import CanonicalState
from ...systems.kinetic_energy import KineticEnergy
from ...systems.lie_poisson import LiePoissonSystem
from ...systems.mechanical import MechanicalSystem


@record
class BentSpring(Term):
    """A spring between two masses on a line, d^2/2 + alpha d^3/3 + beta d^4/4 with d = x_b - x_a.

    Source: Ford, Phys. Rep. 213 (1992), 271.
    """

    alpha: float
    beta: float

    def energy(self, a: Any, b: Any) -> float:
        """The energy of the spring between two masses."""
        return _energy(b.g[0] - a.g[0], self.alpha, self.beta)


@record
class Walls(Term):
    """Springs to the walls, of the masses whose parameters `left` and `right` are 1."""

    alpha: float
    beta: float

    def energy(self, a: Any) -> float:
        """The energy of the springs between a wall and a mass."""
        left = a.left * _energy(a.g[0], self.alpha, self.beta)
        return left + a.right * _energy(-a.g[0], self.alpha, self.beta)


def _energy(d: float, alpha: float, beta: float) -> float:
    """The energy of a spring that is longer by d."""
    return d * d * (0.5 + d * (alpha / 3.0 + d * (0.25 * beta)))


@record
class FermiPastaUlam(SeparableSites):
    """n unit masses between two walls, H = sum p_i^2/2 + sum (d^2/2 + alpha d^3/3 + beta d^4/4)
    over the n + 1 stretches d.

    particles : n.  alpha, beta : the nonlinear parts of the springs.  q, p : displacements and
    momenta, (n,).  `mode_energies` shows the recurrence that Fermi, Pasta and Ulam found: the
    energy of the first mode comes back.

    Source: Fermi, Pasta and Ulam, Studies of nonlinear problems, Los Alamos report LA-1940 (1955);
    Ford, Phys. Rep. 213 (1992), 271.
    """

    particles: int = 32
    alpha: float = 0.25
    beta: float = 0.0

    def __post_init__(self) -> None:
        whole_number(type(self).__name__, self.particles, 1)
        super().__post_init__()

    @property
    def degrees(self) -> int:  # type: ignore[override]
        """The number n of coordinates, one of each particle."""
        return self.particles

    @property
    def sites(self) -> int:
        return self.particles

    def masses_in_space(self) -> MechanicalSystem:
        """The masses on VectorSpace(1) ** n, with springs to their neighbours and to the walls."""
        n, number = self.particles, np.arange(self.particles)
        pairs = np.column_stack([number[:-1], number[1:]])
        springs = BentSpring(self.alpha, self.beta).over(edges(pairs, sites=n, ordered=True))
        walls = Walls(self.alpha, self.beta)
        field: Any = Terms(springs, walls, left=each(1.0 * (number == 0)), right=each(1.0 * (number == n - 1)))
        kinetic: Any = PerSite(KineticEnergy([1.0]))
        return MechanicalSystem(LiePoissonSystem(VectorSpace(1) ** n, kinetic), field)

    def kinetic(self, p: Vec) -> float:
        """sum p_i^2/2.  p : (n,)."""
        return 0.5 * dot(p, p)

    def potential(self, q: Vec) -> float:
        """The energy of the springs.  q : (n,)."""
        return vectors.sum([_energy(d, self.alpha, self.beta) for d in self._stretches(q)])

    def velocity(self, q: Vec, p: Vec) -> Vec:
        """p.  q, p : (n,)."""
        return p

    def force(self, q: Vec, p: Vec) -> Vec:
        """f(d_i+1) - f(d_i), with f(d) = d + alpha d^2 + beta d^3.  q, p : (n,)."""
        pulls = [d * (1.0 + d * (self.alpha + d * self.beta)) for d in self._stretches(q)]
        return vec(*[pulls[i + 1] - pulls[i] for i in range(self.particles)])

    def mode(self, k: int, amplitude: float) -> CanonicalState:
        """The start at rest in the k-th mode, q_i = amplitude (2/(n + 1))^(1/2) sin(i k pi/(n + 1))."""
        k = whole_number(f"{type(self).__name__}.mode", k, 1)
        n = self.particles
        return self.state(
            amplitude * np.sqrt(2.0 / (n + 1)) * np.sin(np.arange(1, n + 1) * k * np.pi / (n + 1)), np.zeros(n)
        )

    def mode_energies(self, q: Any, p: Any) -> np.ndarray:
        """The harmonic energies (P_k^2 + w_k^2 Q_k^2)/2 of all modes, w_k = 2 sin(k pi/(2
        (n + 1))).  q, p : (..., n).
        """
        name, n = f"{type(self).__name__}.mode_energies", self.particles
        k = np.arange(1, n + 1)
        modes = np.sqrt(2.0 / (n + 1)) * np.sin(np.outer(k, k) * np.pi / (n + 1))
        Q, P = (real_array(x, f"{name}: {what}") @ modes for what, x in (("q", q), ("p", p)))
        return 0.5 * (P * P + (2.0 * np.sin(0.5 * k * np.pi / (n + 1)) * Q) ** 2)

    def _stretches(self, q: Vec) -> Any:
        n = self.particles
        return [q[0], *[q[i + 1] - q[i] for i in range(n - 1)], -q[n - 1]]
