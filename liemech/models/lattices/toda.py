"""Toda's lattice in Flaschka's variables."""

from __future__ import annotations

from dataclasses import field
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ...errors import InvalidInput
from ...formulas import Mat, Vec, exp, identity_matrix, log, mat, plain, real_array, record, sum, vec
from ...formulas.classes.derived import closed_form_of
from ...formulas.sites import Meeting, SiteTable, meet
from ...groups.matrices.matrix_group import whole_number
from ...groups.poisson_structure import PoissonStructure
from ...rooms.poisson.poisson import PoissonState, PoissonSystem
from ...systems.hamiltonian import Hamiltonian
from ...systems.parts import OfParts, Part, SplitHamiltonian, StraightLineFlow
from ...systems.vector_field import VectorField


@record
class FlaschkaStructure(PoissonStructure):
    """The structure of Toda's lattice, y = (a, b): {a_i, b_i} = -a_i/4, {a_i, b_i+1} = a_i/4, all
    others zero.

    particles : n.  periodic : is there an a_n, between the last particle and the first?  Casimirs:
    sum b_i, and for a periodic lattice sum ln a_i.

    Source: Flaschka, Phys. Rev. B 9 (1974), 1924; Damianou, Rep. Math. Phys. 2004 and arXiv
    0812.3644.
    """

    particles: int
    periodic: bool = False

    @property
    def springs(self) -> int:
        """The number of springs, of the variables a."""
        return self.particles if self.periodic else self.particles - 1

    @property
    def dim(self) -> int:
        """The dimension: springs and particles together."""
        return self.springs + self.particles

    @property
    def rank(self) -> int:  # type: ignore[override]
        """The rank 2n - 2, n the number of particles."""
        return 2 * self.particles - 2

    def matrix(self, y: Vec) -> Mat:
        """The matrix B(y) of the bracket.  y : (dim,)."""
        return mat(*[self.sharp(y, unit) for unit in identity_matrix(self.dim)]).T

    def sharp(self, y: Vec, a: Vec) -> Vec:
        """B(y) a.  y, a : (dim,)."""
        m, n = self.springs, self.particles
        stretch = [0.25 * y[i] * (a[m + (i + 1) % n] - a[m + i]) for i in range(m)]
        pull = [0.25 * y[i] * a[i] for i in range(m)]
        right = [pull[i] if i < m else 0.0 for i in range(n)]
        left = [pull[i - 1] if i > 0 else pull[n - 1] if self.periodic else 0.0 for i in range(n)]
        return vec(*stretch, *[right[i] - left[i] for i in range(n)])

    def casimirs(self, y: Vec) -> Vec:
        """sum b_i and, for a periodic lattice, sum ln a_i.  y : (dim,), a positive."""
        total = sum([y[self.springs + i] for i in range(self.particles)])
        return vec(total, sum([log(y[i]) for i in range(self.springs)])) if self.periodic else vec(total)


@record
class TodaKinetic(Part):
    """2 sum b_i^2, the kinetic energy: a_i grows by the factor exp(t (b_i+1 - b_i)).

    Source: Flaschka, Phys. Rev. B 9 (1974), 1924.
    """

    particles: int
    springs: int

    def energy(self, mu: Vec) -> float:
        """2 sum b_i^2.  mu : (dim,), the point (a, b)."""
        return 2.0 * sum([mu[self.springs + i] * mu[self.springs + i] for i in range(self.particles)])

    def gradient(self, mu: Vec) -> Vec:
        """(0, 4 b).  mu : (dim,)."""
        return vec(*[0.0 for _ in range(self.springs)], *[4.0 * mu[self.springs + i] for i in range(self.particles)])

    def flow(self, structure: PoissonStructure, y: Vec, t: float) -> Vec:
        """a_i exp(t (b_i+1 - b_i)), b.  y : (dim,)."""
        start, m, n = plain(y), self.springs, self.particles
        grown = [start[i] * exp(t * (start[m + (i + 1) % n] - start[m + i])) for i in range(m)]
        return vec(*grown, *[y[m + i] for i in range(n)])


@record
class TodaPotential(Hamiltonian):
    """4 sum a_i^2, the energy of the springs: b moves along a straight line."""

    particles: int
    springs: int

    def energy(self, mu: Vec) -> float:
        """4 sum a_i^2.  mu : (dim,), the point (a, b)."""
        return 4.0 * sum([mu[i] * mu[i] for i in range(self.springs)])

    def gradient(self, mu: Vec) -> Vec:
        """(8 a, 0).  mu : (dim,)."""
        return vec(*[8.0 * mu[i] for i in range(self.springs)], *[0.0 for _ in range(self.particles)])


@record
class TodaSite(OfParts, VectorField):
    """One particle of a long lattice and the spring behind it, y = (a, b), which asks its neighbours
    for theirs; behind the last particle of an open lattice a = 0.

    before, after : the sites next to each.
    """

    before: SiteTable
    after: SiteTable
    dim: ClassVar[int] = 2
    if not TYPE_CHECKING:  # where they are fields of the base
        parts: ClassVar[tuple[str, str]] = "kinetic energy", "springs"
        quadratic: ClassVar[bool] = True

    @classmethod
    def of_particles(cls, particles: int) -> TodaSite:
        """The site form of a chain with this number of particles."""
        number, make = np.arange(particles)[None], cls  # type: Any, Any
        return make(*[SiteTable.of((number + step) % particles) for step in (-1, 1)])

    def energy(self, y: Vec) -> float:
        """The share of this site, 4 a^2 + 2 b^2.  y : (2,)."""
        return 4.0 * y[0] * y[0] + 2.0 * y[1] * y[1]

    def velocity(self, y: Vec) -> Vec:
        """a (b_next - b), 2 (a^2 - a_before^2).  y : (2,)."""
        others = meet(y)
        b = others.of(self.after, 0)[1]
        return vec(y[0] * (b - y[1]), self._pull(y, others))

    def _pull(self, y: Vec, others: Meeting) -> float:
        a = others.of(self.before, 0)[0]
        return 2.0 * y[0] * y[0] - 2.0 * a * a

    def in_turn(self, state: PoissonState, turns: list[tuple[int, float]]) -> PoissonState:
        """The motions of the two energies one after the other."""
        y = state.y
        for part, t in turns:
            at_turn = plain(y)
            others = meet(at_turn)
            if part == 0:
                b = others.of(self.after, 0)[1]
                y = vec(at_turn[0] * exp(t * (b - at_turn[1])), y[1])
            else:
                y = vec(y[0], y[1] + t * self._pull(at_turn, others))
        return PoissonState(y)

    def unknown_motion(self) -> str:
        """The empty string: the motions of both energies are known."""
        return ""


@record
class TodaLattice(PoissonSystem):
    """Particles on a line with exponential springs, H = sum p_i^2/2 + sum exp(q_i - q_i+1), in
    Flaschka's variables y = (a, b):

        a_i = exp((q_i - q_i+1)/2)/2,  b_i = -p_i/2,   a_i' = a_i (b_i+1 - b_i),  b_i' = 2 (a_i^2 - a_i-1^2)

    particles : n.  periodic : is the last particle tied to the first?
    Conserved: the energy, sum b_i, for a periodic lattice sum ln a_i, and the eigenvalues of `lax`,
    the matrix with b on its diagonal and a beside it: its motion is isospectral.  Long lattices go
    by sites, and a step of one is compiled for all of them.

    Source: Toda, J. Phys. Soc. Japan 22 (1967), 431; Flaschka, Phys. Rev. B 9 (1974), 1924; Hairer,
    Lubich, Wanner, IV.3.2.
    """

    structure: FlaschkaStructure = field(init=False, repr=False)
    hamiltonian: SplitHamiltonian = field(init=False, repr=False)
    particles: int
    periodic: bool = False
    small: ClassVar[int] = 48

    def __post_init__(self) -> None:
        n = whole_number(type(self).__name__, self.particles, 3 if self.periodic else 2)
        structure = FlaschkaStructure(n, self.periodic)
        object.__setattr__(self, "structure", structure)
        m = structure.springs
        parts = TodaKinetic(n, m), StraightLineFlow(TodaPotential(n, m))
        object.__setattr__(self, "hamiltonian", SplitHamiltonian(parts))
        super().__post_init__()

    def state_of(self, q: Any, p: Any) -> PoissonState:
        """The state with these positions and momenta, (n,) or (members, n) each."""
        q, p = (real_array(x, f"{type(self).__name__}.state_of: {name}") for name, x in (("q", q), ("p", p)))
        for name, x in (("q", q), ("p", p)):
            if x.shape[-1:] != (self.particles,):
                raise InvalidInput(
                    f"{type(self).__name__}.state_of: {name} has shape {x.shape}; give ({self.particles},)"
                )
        stretch = (q - np.roll(q, -1, axis=-1))[..., : self.structure.springs]
        return self.state(np.concatenate([0.5 * np.exp(0.5 * stretch), -0.5 * p], axis=-1))

    def of_volterra(self, u: Any) -> PoissonState:
        """The state to which Henon's map takes a lattice of Volterra with 2n - 1 species,
        u : (2n - 1,).

            a_i = (u_2i-1 u_2i)^(1/2)/2,   b_i = (u_2i-1 + u_2i-2)/2

        Source: Damianou, arXiv 0812.3644.
        """
        u = real_array(u, f"{type(self).__name__}.of_volterra: u")
        if self.periodic or u.shape[-1:] != (2 * self.particles - 1,):
            raise InvalidInput(
                f"{type(self).__name__}.of_volterra: an open lattice of {self.particles} particles "
                f"comes from {2 * self.particles - 1} species; got shape {u.shape}"
            )
        odd, even = u[..., ::2], u[..., 1::2]
        b = 0.5 * odd
        b[..., 1:] += 0.5 * even
        return self.state(np.concatenate([0.5 * np.sqrt(odd[..., :-1] * even), b], axis=-1))

    # ---------------------------------------------------------------- of many particles

    @cached_property
    @closed_form_of("energy")
    def site_form(self) -> TodaSite | None:
        """The site form; None of few particles, which are faster written out."""
        return TodaSite.of_particles(self.particles) if self.dim > self.small else None

    def by_site(self, arrays: dict[str, Any]) -> dict[str, Any]:
        """Points as (..., n, 2), a and b of each particle."""
        return {name: self._divided(np.asarray(y)) for name, y in arrays.items()}

    def _divided(self, y: Any) -> np.ndarray:
        m = self.structure.springs
        by_site = np.zeros((*y.shape[:-1], self.particles, 2))
        by_site[..., :m, 0], by_site[..., 1] = y[..., :m], y[..., m:]
        return by_site

    def as_users_see(self, arrays: dict[str, Any]) -> dict[str, Any]:
        """The points as users see them, (..., dim), from sites."""
        m = self.structure.springs
        return {
            name: np.concatenate([x[..., :m, 0], x[..., 1]], axis=-1) if name == "y" else x
            for name, x in arrays.items()
        }

    def momenta_of_sites(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The Casimirs: the sum of b, and of a ring that of log a."""
        m, y = self.structure.springs, states["y"]
        casimirs = {"Casimir 1": y[..., m:].sum(axis=-1)}
        return casimirs | ({"Casimir 2": np.log(y[..., :m]).sum(axis=-1)} if self.periodic else {})

    def lax(self, y: Vec) -> Mat:
        """The symmetric matrix L, tridiagonal (and with corners if periodic), whose eigenvalues
        stay.  y : (dim,), L : (n, n).
        """
        m, n = self.structure.springs, self.particles
        rows = [[y[m + i] if i == j else 0.0 for j in range(n)] for i in range(n)]
        for i in range(m):
            rows[i][(i + 1) % n] = rows[(i + 1) % n][i] = y[i]
        return mat(*[vec(*row) for row in rows])

    def constants(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Energy, Casimirs, and the eigenvalues of L."""
        return super().constants(states) | {"eigenvalues": np.linalg.eigvalsh(self.lax(states["y"]))}
