"""Spins 1 with an easy plane, coherent states of SU(3): frequencies of small oscillations on 4 x 2 x 2 sites."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...formulas import Mat, Vec, dot, record
from ...formulas.classes.of_each import each
from ...groups.matrices.classical import SU
from ...systems.lie_poisson import LiePoissonSystem
from ..sites.graphs import cubic
from ..sites.terms.terms import Site, Term, Terms
from .compared import Compared

SOURCE = "Dahlbom et al., Phys. Rev. B 106, 054423 (2022); frequencies by Sunny.jl (test_lswt.jl, 'Single Ion')"
J, ACROSS, D, SHAPE = 1.0, 0.1, 5.0, (4, 2, 2)
JUMP = np.diag([np.sqrt(2.0)] * 2, 1)
SPINS = 0.5 * (JUMP + JUMP.T), 0.5j * (JUMP.T - JUMP), np.diag([1.0, 0.0, -1.0])
X = 0.5 - D / (8.0 * (2.0 * J + ACROSS))  # the share of the states m = 1 and -1 at rest


@record
class Bond(Term):
    """J S_a . S_b + (D/4) <S_z^2> of both, but for a constant: S = s mu, K = s^T s; a site has four bonds."""

    coupling: float
    K: Mat
    plane: Vec

    def energy(self, a: Site, b: Site) -> float:
        """J mu_a . K mu_b + plane . (mu_a + mu_b)."""
        return self.coupling * dot(a.mu, self.K @ b.mu) + dot(self.plane, a.mu + b.mu)


def compared(full: bool) -> Iterator[Compared]:
    """Frequencies of the linearised equations; the zero, where two eigenvalues meet, has half of the digits."""
    kx, ky, kz = 2.0 * np.pi * np.indices(SHAPE) / np.reshape(SHAPE, (3, 1, 1, 1))
    z, c = J * (np.cos(kx) + np.cos(ky)) + ACROSS * np.cos(kz), 1.0 - 2.0 * X
    w, B = 8.0 * (1.0 - X) * X * (2.0 * J + ACROSS), np.array([2.0 * z, 2.0 * c**2 * z])
    A = np.array([w + (1.0 - X) * D - 2.0 * c * z, 2.0 * w + c * D - 2.0 * c**2 * z])
    published = np.sort(np.sqrt(np.maximum(A**2 - B**2, 0.0)).ravel())
    group, basis, n = SU(3), np.eye(8), int(np.prod(SHAPE))
    s = np.array([group.algebra.vee(-1j * spin) for spin in SPINS])
    plane = 0.25 * D * np.asarray(group.algebra.vee(-1j * (SPINS[2] @ SPINS[2] - 2.0 / 3.0 * np.eye(3))))
    couplings = np.repeat([J, 2.0 * J, 2.0 * ACROSS], [n, n // 2, n // 2])  # two sites in a circle are tied twice
    bonds = Bond(each(couplings), s.T @ s, plane).over(cubic(*SHAPE, periodic=(True, False, False)))
    spins = LiePoissonSystem(group**n, Terms(bonds))
    sign = 1.0 - 2.0 * (np.indices(SHAPE).sum(axis=0).ravel() % 2)
    Z = np.stack([sign * np.sqrt(0.5 * X), np.full(n, np.sqrt(1.0 - X)), sign * np.sqrt(0.5 * X)], axis=1)
    mu = np.einsum("ij,ajk,ik->ia", Z, [1j * np.asarray(group.algebra.hat(e)) for e in basis], Z).real
    along = np.linalg.svd(np.asarray(group.ad_star(basis, mu[:, None])))[2][:, :4]
    steps = np.einsum("ij,ipa->ipja", np.eye(n), along).reshape(-1, n, 8)
    ahead, behind = (np.asarray(group.ad_star(spins.velocity(m), m)) for m in (mu + steps, mu - steps))  # quadratic
    matrix = np.einsum("jia,ipa->ipj", 0.5 * (ahead - behind), along).reshape(4 * n, 4 * n)
    for k, (frequency, computed) in enumerate(zip(published, np.sort(np.linalg.eigvals(matrix).imag)[2 * n :])):
        yield Compared(f"frequency {k + 1}, J", float(frequency), float(computed), 1e-12 if k else 1e-6)
