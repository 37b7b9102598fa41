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

SOURCE = (
    "Dahlbom et al., Phys. Rev. B 106, 054423 (2022), the equations; frequencies by linear spin wave theory in Sunny.jl "
    "(test_lswt.jl, 'Single Ion'), where the tetragonal antiferromagnet has J = 1, J' = 0.1, D = 5"
)
J, ACROSS, D, SHAPE = 1.0, 0.1, 5.0, (4, 2, 2)
JUMP = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]]) * np.sqrt(2.0)
SPINS = np.array([0.5 * (JUMP + JUMP.T), 0.5j * (JUMP.T - JUMP), np.diag([1.0, 0.0, -1.0])])
X = 0.5 - D / (8.0 * (2.0 * J + ACROSS))
"""The share of the states m = 1 and -1 of a site at rest."""


@record
class Exchange(Term):
    """J S_a . S_b, with S = s mu and K = s^T s."""

    coupling: float
    K: Mat

    def energy(self, a: Site, b: Site) -> float:
        """J mu_a . K mu_b."""
        return self.coupling * dot(a.mu, self.K @ b.mu)


@record
class EasyPlane(Term):
    """D <S_z^2>, but for a constant.  weights : D times the coordinates of S_z^2."""

    weights: Vec

    def energy(self, a: Site) -> float:
        """D <S_z^2 - 2/3>."""
        return dot(self.weights, a.mu)


def published(q: list[float]) -> list[float]:
    """Both frequencies of wave number q, by the closed form of the source."""
    flat, up = np.cos(q[0]) + np.cos(q[1]), np.cos(q[2])
    z, w, c = J * flat + ACROSS * up, 2.0 * J + ACROSS, (1.0 - 2.0 * X) ** 2
    plus, minus = 8.0 * (1.0 - X) * X * w + (1.0 - X) * D, 16.0 * (1.0 - X) * X * w + (1.0 - 2.0 * X) * D
    squares = (plus - 2.0 * (1.0 - 2.0 * X) * z) ** 2 - (2.0 * z) ** 2, (minus - 2.0 * c * z) ** 2 - (2.0 * c * z) ** 2
    return [float(np.sqrt(max(x, 0.0))) for x in squares]


def computed() -> np.ndarray:
    """The frequencies of the equations of motion, linearised along the orbit of the sites at rest, (32,), descending."""
    group, n = SU(3), int(np.prod(SHAPE))
    hat, vee = group.algebra.hat, group.algebra.vee
    s = np.array([vee(-1j * spin) for spin in SPINS])
    couplings = np.repeat([J, 2.0 * J, 2.0 * ACROSS], [n, n // 2, n // 2])  # two sites in a circle are tied twice
    terms = Exchange(each(couplings), s.T @ s).over(cubic(*SHAPE, periodic=(True, False, False)))
    plane = EasyPlane(D * np.asarray(vee(-1j * (SPINS[2] @ SPINS[2] - 2.0 / 3.0 * np.eye(3)))))
    spins = LiePoissonSystem(group**n, Terms(terms, plane.over()))
    sign = 1.0 - 2.0 * (np.indices(SHAPE).sum(axis=0).ravel() % 2)
    Z = np.stack([sign * np.sqrt(0.5 * X), np.full(n, np.sqrt(1.0 - X)), sign * np.sqrt(0.5 * X)], axis=1)
    mu = np.einsum("ij,ajk,ik->ia", Z, [1j * np.asarray(hat(e)) for e in np.eye(8)], Z).real
    moved = np.asarray(group.ad_star(np.eye(8), mu[:, None]))  # (n, 8, 8), along the orbits
    along = np.linalg.svd(moved)[2][:, :4]
    steps = np.zeros((n, 4, n, 8))
    steps[np.arange(n), :, np.arange(n)] = along

    def rate(mu: np.ndarray) -> np.ndarray:
        """The rates of the momenta, quadratic in them."""
        return np.asarray(group.ad_star(spins.velocity(mu), mu))

    change = 0.5 * (rate(mu + steps.reshape(-1, n, 8)) - rate(mu - steps.reshape(-1, n, 8)))
    matrix = np.einsum("jia,ipa->ipj", change, along).reshape(4 * n, 4 * n)
    return np.sort(np.linalg.eigvals(matrix).imag)[: 2 * n - 1 : -1]


def compared(full: bool) -> Iterator[Compared]:
    """All 32; the last one is zero, where two eigenvalues meet, and has half of the digits."""
    waves = [[2.0 * np.pi * k / size for k, size in zip(index, SHAPE)] for index in np.ndindex(*SHAPE)]
    theirs = sorted((x for q in waves for x in published(q)), reverse=True)
    for k, (value, ours) in enumerate(zip(theirs, computed())):
        yield Compared(f"frequency {k + 1}, J", value, float(ours), 1e-12 if k < 31 else 1e-6)
