"""Reduced magnetohydrodynamics on the sphere by Zeitlin's truncation: a vorticity and a magnetic potential."""

from __future__ import annotations

from dataclasses import field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from ...formulas import Mat, Vec, dot, record
from ...formulas.large_maps import LinearMap
from ...groups.matrices.dual_unitary import DualUnitary, pair_of
from ...systems.hamiltonian import Hamiltonian
from ...systems.lagrangian import Lagrangian
from ...systems.lie_poisson import BodyState, LiePoissonSystem
from .zeitlin_sphere import SphereEnergy, ZeitlinSphere, checked_momenta, laplacian_matrix


@record
class MagneticEnergy(Hamiltonian):
    """The energy of flow and field, E = -int (omega Delta^-1 omega + A Delta A)/2, of momenta (4 pi hbar/N) i (F, A).

    n : N.
    Source: Modin and Roop, IMA J. Numer. Anal. (2025), draf024.
    """

    by_pairs: ClassVar[bool] = True

    n: int

    @cached_property
    def flow(self) -> SphereEnergy:
        """The energy of the flow alone."""
        return SphereEnergy(self.n, 0.0)

    @cached_property
    def group(self) -> DualUnitary:
        """The group of the pairs of matrices."""
        return DualUnitary(self.n)

    @cached_property
    def current(self) -> LinearMap:
        """The map from Theta to y = -i J/hbar."""
        matrix = (self.n, self.n), True
        return LinearMap(-self.flow.factor * laplacian_matrix(self.n), matrix, matrix)

    def energy(self, mu: Vec) -> float:
        """The energy of flow and field.  mu : (2 N^2,)."""
        m = self.group.algebra.covector(mu)
        return 0.5 * dot(self.velocity_matrix(self.group.algebra, m), m)

    def gradient(self, mu: Vec) -> Vec:
        """The coordinates of x = -i Psi/hbar and y = -i J/hbar.  mu : (2 N^2,)."""
        algebra = self.group.algebra
        return algebra.vee(self.velocity_matrix(algebra, algebra.covector(mu)))

    def velocity_matrix(self, algebra: Any, m: Mat) -> Mat:
        """x = -i Psi/hbar and y = -i J/hbar, Delta_N Psi = F, J = Delta_N A, as blocks.  m : (2 N, 2 N)."""
        return self.group.of_velocity(self.velocity_pair(algebra, self.group.pair_of_momentum(m)))

    def velocity_pair(self, algebra: Any, pair: tuple[Any, Any]) -> tuple[Any, Any]:
        """The velocity x + eps y of the momentum Theta + eps W."""
        theta, w = pair
        return self.flow.velocity_matrix(algebra, w), self.current(theta)


@record
class MagneticSphere(LiePoissonSystem):
    """Reduced magnetohydrodynamics on the unit sphere, by Zeitlin's truncation to pairs of matrices N x N:

        omega' = {omega, psi} + {A, j},  A' = {A, psi},  Delta psi = omega,  j = Delta A

        becomes  F' = ([F, Psi] + [A, J])/(i hbar),  A' = [A, Psi]/(i hbar),  Delta_N Psi = F,  J = Delta_N A

    with the magnetic potential A, whose level lines are those of the field.

    n : N, at least 13, as in `ZeitlinSphere`, whose flow is that of A = 0.

    States are momenta on the group of unitary matrices over the dual numbers; `from_harmonics` makes one of
    coefficients of spherical harmonics.  `fields` returns vorticity and potential, each a momentum on
    `sphere`, which has its harmonics and values.  `Isospectral(order=2)` keeps all Casimirs, to rounding, and is a
    Poisson map.

    Conserved: energy; the levels of the potential; the cross helicity int omega A, and int omega A^k for all k;
    and angular momentum.

    Source: Modin and Roop, J. Plasma Phys. (2026), Structure-preserving long-time simulations of turbulence in
    magnetised ideal fluids; IMA J. Numer. Anal. (2025), draf024; Morrison and Hazeltine, Phys. Fluids 27 (1984)
    886 (the bracket).
    """

    called: ClassVar[str] = "sphere"

    group: DualUnitary = field(init=False, repr=False)
    hamiltonian: MagneticEnergy = field(init=False, repr=False)
    lagrangian: Lagrangian | None = field(init=False, repr=False, default=None)
    n: int

    def __post_init__(self) -> None:
        n = ZeitlinSphere(self.n).n
        parts = {"n": n, "group": DualUnitary(n), "hamiltonian": MagneticEnergy(n), "lagrangian": None}
        for name, value in parts.items():
            object.__setattr__(self, name, value)

    @cached_property
    def sphere(self) -> ZeitlinSphere:
        """The sphere of ideal flow, whose momenta stand for single fields."""
        return ZeitlinSphere(self.n)

    def from_harmonics(self, vorticity: Any, potential: Any) -> BodyState:
        """The state with these coefficients of vorticity and magnetic potential; as `ZeitlinSphere.from_harmonics`
        has them.
        """
        to_matrix = self.sphere.group.generated.covector
        w, theta = (to_matrix(np.array(self.sphere.from_harmonics(a).mu)) for a in (vorticity, potential))
        return self.state(self.group.generated.pairing(np.block([[0.5 * w, theta], [0.0 * w, 0.5 * w]])))

    def fields(self, mu: Any) -> list[np.ndarray]:
        """Vorticity and magnetic potential as momenta on `sphere`.  mu : (..., 2 N^2); (..., N^2 - 1) each."""
        m = self.group.generated.covector(checked_momenta(self, mu, "fields"))
        return [self.sphere.group.generated.pairing(x) for x in pair_of(m)]

    def cross_moments(self, mu: Any, powers: tuple[int, ...] = (1, 2, 3)) -> np.ndarray:
        """The Casimirs int omega A^k = (4 pi/N) tr F A^k, the first of them the cross helicity.
        mu : (..., 2 N^2); (..., powers).
        """
        f, a = (self.sphere.matrix(x) for x in self.fields(mu))
        traces = [np.einsum("...ij,...ji->...", f, np.linalg.matrix_power(a, k)).real for k in powers]
        return np.stack([4.0 * np.pi / self.n * x for x in traces], axis=-1)

    def constants(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Energy, moments of the potential, cross helicity and further cross moments, and angular momentum."""
        mu = states["mu"]
        vorticity, potential = self.fields(mu)
        moments, cross = self.sphere.moments(potential), self.cross_moments(mu)
        constants = {"energy": np.asarray(self.energy(mu)), "cross helicity": cross[..., 0]}
        constants |= {f"cross moment {k}": cross[..., k - 1] for k in (2, 3)}
        constants |= {f"moment {k} of the potential": moments[..., k - 2] for k in (2, 3, 4)}
        return constants | {"angular momentum": self.sphere.angular_momentum(vorticity)}
