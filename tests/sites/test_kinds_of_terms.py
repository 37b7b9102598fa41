"""Kinds of terms are those of all edges and sites: one that is another among many is seen."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from terms_of_spins import Biquadratic, Exchange, Twist

import liemech as lm
from liemech import neighbours as near
from liemech.errors import IncompatibleSystem, InvalidInput

N = 200


@lm.record
class Tensor(lm.Term):
    J: lm.Mat

    def energy(self, a: Any, b: Any) -> float:
        return lm.dot(a.mu, self.J @ b.mu)


@lm.record
class Ising(lm.Term):
    K: float

    def energy(self, a: Any, b: Any) -> float:
        return -self.K * a.mu[2] * b.mu[2]


@lm.record
class Axis(lm.Term):
    """Its velocity changes along the motion, but where it is zero."""

    K: float

    def energy(self, a: Any) -> float:
        return self.K * a.mu[2] ** 2 * a.mu[0]


@lm.record
class Rectified(lm.Term):
    def energy(self, a: Any, b: Any) -> float:
        return -a.mu[0] * abs(b.mu[0])


@lm.record
class Sided(lm.Term):
    """Not symmetric where the first spin points down."""

    def energy(self, a: Any, b: Any) -> float:
        return a.mu[0] * b.mu[0] if a.mu[2] > 0.0 else 2.0 * a.mu[0] * b.mu[1]


@lm.record
class OfFirst(lm.Term):
    def energy(self, a: Any, b: Any) -> float:
        return -a.q * lm.dot(a.mu, b.mu)


@lm.record
class Weak(lm.Term):
    """Its second part counts where momenta are large."""

    def energy(self, a: Any, b: Any) -> float:
        x = lm.dot(a.mu, b.mu)
        return -x - 1e-14 * x * x


@lm.record
class Late(lm.Term):
    """Affine until a time that nobody would try."""

    def energy(self, a: Any, t: float) -> float:
        return a.mu[0] if t < 1234.5 else a.mu[0] ** 2 * a.mu[1]


def spins(*terms: Any, n: int = N, **own: Any) -> Any:
    return lm.LiePoissonSystem(lm.SO3() ** n, lm.Terms(*terms, **own))


def one(n: int, at: int, value: Any) -> Any:
    """Zero for all but one."""
    values = np.zeros((n, *np.shape(value)))
    values[at] = value
    return lm.each(values)


def reference(slopes: Callable[[np.ndarray], np.ndarray], mu: np.ndarray, t: float) -> np.ndarray:
    def rate(_: float, y: np.ndarray) -> np.ndarray:
        m = y.reshape(mu.shape)
        return np.cross(m, slopes(m)).ravel()

    found = solve_ivp(rate, (0.0, t), mu.ravel(), method="DOP853", rtol=1e-11, atol=1e-12)
    return found.y[:, -1].reshape(mu.shape)


def start(n: int = N) -> np.ndarray:
    mu = np.random.default_rng(1).normal(size=(n, 3))
    return mu / np.linalg.norm(mu, axis=1)[:, None]


@pytest.mark.slow
def test_one_bond_among_many_that_is_not_symmetric() -> None:
    """An antisymmetric one, beside DOP853; on edges without a direction it is refused."""
    D, mu = np.array([0.3, 0.2, 1.0]), start()
    given = near.edges([(i, (i + 1) % N) for i in range(N)])
    system = spins(Exchange(1.0).over(near.ring(N)), Twist(one(N, 51, D)).over(given))

    def slopes(m: np.ndarray) -> np.ndarray:
        found = -np.roll(m, -1, axis=0) - np.roll(m, 1, axis=0)
        found[51] += np.cross(m[52], D)
        found[52] += np.cross(D, m[51])
        return found

    run = lm.integrate(system, lm.RKMK(order=4), system.state(mu=mu), h=0.01, steps=50)
    assert np.abs(run.mu[-1] - reference(slopes, mu, 0.5)).max() < 1e-8
    energy = -(mu * np.roll(mu, -1, axis=0)).sum() + D @ np.cross(mu[51], mu[52])
    assert abs(run.energy[0] - energy) < 1e-12
    with pytest.raises(InvalidInput, match=r"Twist: .*\(51, 52\)"):
        spins(Twist(one(N, 51, D)).over(near.ring(N)))


@pytest.mark.parametrize("site", [49, 51])
def test_one_site_whose_parameter_makes_bonds_unlike(site: int) -> None:
    q = np.ones(N)
    q[site] = 3.0
    with pytest.raises(InvalidInput, match=f"OfFirst: .*{site}"):
        spins(OfFirst().over(near.ring(N)), q=lm.each(q))
    with pytest.raises(InvalidInput, match="OfFirst"):
        spins(OfFirst().over(near.all_pairs()), q=lm.each(q))
    spins(OfFirst().over(near.ring(N)), q=lm.each(np.ones(N)))


@pytest.mark.parametrize("term", [Rectified(), Sided()])
def test_a_branch_hides_nothing(term: Any) -> None:
    with pytest.raises(InvalidInput, match="not the same with its sites exchanged"):
        spins(term.over(near.ring(6)), n=6)


@pytest.mark.parametrize(
    ("method", "terms"),
    [
        (lm.BondSplitting(), (Exchange(1.0).over(near.ring(N)), Ising(one(N, 55, 2.0)).over(near.ring(N)))),
        (lm.SublatticeSplitting(), (Biquadratic(one(N, 55, 2.0)).over(near.ring(N)),)),
        (lm.SublatticeSplitting(), (Exchange(1.0).over(near.ring(N)), Axis(one(N, 55, 2.0)))),
        (lm.SublatticeSplitting(), (Weak().over(near.ring(N)),)),
        (lm.SublatticeSplitting(), (Rectified().over(near.edges([(0, 1)], sites=N, ordered=True)),)),
    ],
)
def test_one_edge_or_site_of_another_kind(method: Any, terms: Any) -> None:
    with pytest.raises(IncompatibleSystem, match="needs terms whose motions are known"):
        method.require(spins(*terms))


def test_all_times_count() -> None:
    def driven(term: Any) -> Any:
        return lm.DrivenLiePoissonSystem(lm.SO3() ** 6, lm.Terms(Exchange(1.0).over(near.ring(6)), term))

    with pytest.raises(IncompatibleSystem, match="Late"):
        lm.SublatticeSplitting().require(driven(Late()))


def test_matrices_of_bonds_that_are_symmetric() -> None:
    """Not for all values of their parameter, but for those of all edges."""

    J = np.random.default_rng(2).normal(size=(N, 3, 3))
    J = J + J.transpose(0, 2, 1)
    terms = Tensor(lm.each(J)).over(near.ring(N))
    lm.SublatticeSplitting().require(spins(terms))
    J[150, 0, 1] += 1e-3
    with pytest.raises(InvalidInput, match=r"Tensor: .*\(150, 151\)"):
        spins(Tensor(lm.each(J)).over(near.ring(N)))


def test_symmetric_terms_with_branches() -> None:
    """Are seen to be such: their lists need not tell who is the first."""

    @lm.record
    class Spring(lm.Term):
        """A distance by `math`, an end, the softer one of two sites."""

        k: float

        def energy(self, a: Any, b: Any) -> float:
            d = a.g - b.g
            r = math.sqrt(lm.dot(d, d))
            if r > 2.5:
                return 0.0
            return self.k * (a.q if a.q < b.q else b.q) * max(r - abs(a.q - b.q), 0.3) ** 2

    q = np.random.default_rng(3).uniform(1.0, 2.0, 8)
    body = lm.LiePoissonSystem(lm.VectorSpace(3) ** 8, lm.PerSite(lm.KineticEnergy([1.0] * 3)))
    for graph in (near.ring(8), near.all_pairs(), near.within(4.0)):
        system = lm.MechanicalSystem(body, lm.Terms(Spring(1.0).over(graph), q=lm.each(q)))
        assert system.potential.parts[0].merged


def test_the_time_has_its_place() -> None:
    @lm.record
    class First(lm.Term):
        def energy(self, t: float, a: Any) -> float:
            return a.mu[0] * t

    @lm.record
    class Last(lm.Term):
        def covector(self, a: Any, t: float) -> lm.Vec:
            return t * a.xi

    with pytest.raises(InvalidInput, match=r"First: the time of \(t, a\) comes last: energy\(self, a, t\)"):
        spins(First(), n=4)
    with pytest.raises(InvalidInput, match=r"Last: the time of \(a, t\) comes first: covector\(self, t, a\)"):
        Last().over()


def test_a_pulse_is_known_before_it_begins() -> None:
    """Affine at all times, zero until late."""

    @lm.record
    class Field(lm.Term):
        B: lm.Vec
        strength: lm.PiecewisePolynomial

        def energy(self, a: Any, t: float) -> float:
            return -lm.formulas.where(t > 500.0, self.strength(t), 0.0) * lm.dot(self.B, a.mu)

    table = lm.PiecewisePolynomial.linear([0.0, 600.0, 700.0], [0.0, 0.0, 1.0], outside="hold")
    terms = lm.Terms(Exchange(1.0).over(near.ring(6)), Field([0.3, 0.1, 0.2], table))
    lm.SublatticeSplitting().require(lm.DrivenLiePoissonSystem(lm.SO3() ** 6, terms))


@lm.record
class OfSign(lm.Term):
    """Antisymmetric where the parameter is neither positive nor negative."""

    q: float

    def energy(self, a: Any, b: Any) -> float:
        if self.q > 0.0:
            return -lm.dot(a.mu, b.mu)
        if self.q < 0.0:
            return lm.dot(a.mu, b.mu)
        return a.mu[0] * b.mu[1] - a.mu[1] * b.mu[0]


@lm.record
class Local(lm.Term):
    """Antisymmetric near one place."""

    x: float

    def energy(self, a: Any, b: Any) -> float:
        return -lm.dot(a.mu, b.mu) + (a.mu[0] * b.mu[1] - a.mu[1] * b.mu[0]) / (1.0 + (self.x - 1.51e8) ** 2)


@lm.record
class Beside(lm.Term):
    """Its antisymmetric part is small beside one huge exchange, and large beside the others."""

    J: float

    def energy(self, a: Any, b: Any) -> float:
        return -self.J * lm.dot(a.mu, b.mu) + 1e-3 * (a.mu[0] * b.mu[1] - a.mu[1] * b.mu[0])


@lm.record
class InUnits(lm.Term):
    """Between two parts of other degrees, in joules and joule seconds."""

    J: float

    def energy(self, a: Any, b: Any) -> float:
        twist = a.mu[0] * b.mu[1] - a.mu[1] * b.mu[0]
        return 1e11 * (a.mu[2] + b.mu[2]) + 1e44 * twist + self.J * lm.dot(a.mu, b.mu) ** 2


@pytest.mark.parametrize(
    "term",
    [
        OfSign(lm.each(np.where(np.arange(N) == 151, 0.0, (-1.0) ** np.arange(N)))),
        Local(lm.each(1e6 * np.arange(N))),
        Beside(lm.each(np.where(np.arange(N) == 151, 1e12, 1e-3))),
        InUnits(1e114),
    ],
    ids=lambda term: type(term).__name__,
)
def test_what_is_small_elsewhere_is_seen(term: Any) -> None:
    """No edge and no unit hides that a term is not symmetric."""
    given = near.edges([(i, (i + 1) % N) for i in range(N)])
    assert not spins(term.over(given)).hamiltonian.parts[0].merged
    with pytest.raises(InvalidInput, match="its energy is not the same"):
        spins(term.over(near.ring(N)))


def test_ways_that_no_edge_takes_count_for_nothing() -> None:
    """A branch for parameters that are not there, which would be no exchange, or would fail."""

    @lm.record
    class OfKind(lm.Term):
        k: float

        def energy(self, a: Any, b: Any) -> float:
            if self.k < 0.0:
                raise ValueError("k is negative")
            if self.k == 3.0:
                return a.mu[0] * b.mu[1]
            return -(2.0 if self.k == 2.0 else 1.0) * lm.dot(a.mu, b.mu)

    lm.BondSplitting().require(spins(OfKind(lm.each(1.0 + np.arange(N) % 2)).over(near.ring(N))))
    with pytest.raises(InvalidInput, match=r"\(151, 152\)"):
        spins(OfKind(lm.each(np.where(np.arange(N) == 151, 3.0, 2.0))).over(near.ring(N)))


@lm.record
class Easy(lm.Term):
    """A field and an easy axis: no motion of a single site that is known."""

    K: float
    field: lm.Vec

    def energy(self, a: Any) -> float:
        return -lm.dot(self.field, a.mu) + self.K * a.mu[2] * a.mu[2]


@pytest.mark.parametrize("unit", [1.0, 2.0**28, 2.0**30, 2.0**120, 2.0**-30, 2.0**-120])
@pytest.mark.parametrize("time", [1.0, 2.0**40, 2.0**-40])
def test_kinds_do_not_depend_on_units(unit: float, time: float) -> None:
    """Of spins of 1e9 units and more the axis, a constant below 1e-9, was taken for nothing, and its motion for a turn."""
    terms = Easy(0.3 / (unit * time), np.array([0.1, 0.2, 0.3]) / time)
    system = spins(Exchange(0.7 / (unit * time)).over(near.ring(N)), terms)
    for method in (lm.SublatticeSplitting(order=4), lm.BondSplitting(order=4)):
        with pytest.raises(IncompatibleSystem, match="needs terms whose motions are known: Easy"):
            method.require(system)
    free = spins(Exchange(0.7 / (unit * time)).over(near.ring(N)), Easy(0.0, [0.0, 0.0, 1.0 / time]))
    lm.SublatticeSplitting(order=4).require(free)


@lm.record
class Nearly(lm.Term):
    """An exchange beside which something is small."""

    axial: float
    twist: float

    def energy(self, a: Any, b: Any) -> float:
        twisted = a.mu[0] * b.mu[1] - a.mu[1] * b.mu[0]
        return -lm.dot(a.mu, b.mu) - self.axial * a.mu[2] * b.mu[2] + self.twist * twisted


@pytest.mark.parametrize("small", [1e-6, 1e-9, 1e-10, 1e-11])
def test_what_is_small_beside_an_exchange_counts(small: float) -> None:
    """In 1e6 steps of 0.1 an axis of 1e-10 turns what bonds would keep by 1e-5."""
    with pytest.raises(IncompatibleSystem, match="needs terms whose motions are known: Nearly"):
        lm.BondSplitting().require(spins(Nearly(small, 0.0).over(near.ring(N))))
    with pytest.raises(InvalidInput, match="its energy is not the same"):
        spins(Nearly(0.0, small).over(near.ring(N)))


def test_matrices_that_are_isotropic_but_for_rounding_are_bonds() -> None:
    turn = np.array([lm.SO3().exp(x) for x in np.random.default_rng(3).normal(size=(N, 3))])
    J = np.einsum("eji,ejk->eik", turn, 0.7 * turn)
    lm.BondSplitting().require(spins(Tensor(lm.each(J)).over(near.ring(N))))
