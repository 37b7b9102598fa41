"""Canonical transformations by a generating function: the article's (8), with and without K = 0."""

from __future__ import annotations

import itertools
import math
from typing import Any, ClassVar

import numpy as np
import pytest

import liemech as lm
from liemech.errors import IncompatibleSystem, InvalidInput, InvalidType, OutsideChart
from liemech.formulas import cos, sin, tan

EPS = float(np.finfo(float).eps)
KEPLER = lm.Kepler()


@lm.record
class Identity(lm.charts.CanonicalTransformation):
    """G = q.P."""

    degrees: ClassVar[int] = 2

    def generating(self, t: float, q: lm.Vec, P: lm.Vec) -> float:
        return lm.dot(q, P)


@lm.record
class Turning(lm.charts.CanonicalTransformation):
    """A turning frame: G = P . R(-rate t) q."""

    degrees: ClassVar[int] = 2
    rate: float

    def generating(self, t: float, q: lm.Vec, P: lm.Vec) -> float:
        c, s = cos(self.rate * t), sin(self.rate * t)
        return P[0] * (c * q[0] + s * q[1]) + P[1] * (c * q[1] - s * q[0])


@lm.record
class Bent(lm.charts.CanonicalTransformation):
    """Nothing special: not linear in q or P, and changing with time."""

    degrees: ClassVar[int] = 2

    def generating(self, t: float, q: lm.Vec, P: lm.Vec) -> float:
        return (
            lm.dot(q, P)
            + 0.1 * sin(q[0] - 0.4 * q[1] + t) * P[1]
            + 0.05 * q[0] * q[1] * P[0] ** 2
            + 0.02 * (1.0 + t) * P[0] * P[1]
        )


@lm.record
class Oscillator(lm.HamiltonianSystem):
    degrees: ClassVar[int] = 1

    def energy(self, q: lm.Vec, p: lm.Vec) -> float:
        return 0.5 * (p[0] ** 2 + q[0] ** 2)


@lm.record
class Solved(lm.charts.CanonicalTransformation):
    """The solution of the Hamilton-Jacobi equation of the oscillator."""

    degrees: ClassVar[int] = 1

    def generating(self, t: float, q: lm.Vec, P: lm.Vec) -> float:
        return q[0] * P[0] / cos(t) - 0.5 * (q[0] ** 2 + P[0] ** 2) * tan(t)


@lm.record
class Pushed(lm.DrivenHamiltonianSystem):
    """x'' = -x + cos(2 t), and a free second degree."""

    degrees: ClassVar[int] = 2

    def energy(self, t: float, q: lm.Vec, p: lm.Vec) -> float:
        return 0.5 * lm.dot(p, p) + 0.5 * q[0] ** 2 - cos(2.0 * t) * q[0]


T, OLD = 0.4, KEPLER.state([0.7, 0.3], [-0.2, 1.1])
CHANGES = {"identity": Identity(), "turning": Turning(0.7), "bent": Bent()}


@pytest.mark.parametrize("name", CHANGES)
def test_there_and_back(name: str) -> None:
    change = CHANGES[name]
    Q, P = change.new(T, OLD.q, OLD.p)
    q, p = change.old(T, Q, P)
    assert np.abs(np.array([*q, *p]) - [*OLD.q, *OLD.p]).max() < 8 * EPS
    assert np.allclose(change.of_momenta(T, q, P), Q) and np.allclose(change.of_positions(T, q, P), p)


@pytest.mark.parametrize("name", CHANGES)
def test_the_two_form_is_kept(name: str) -> None:
    """M^T J M = J for the derivative of (q, p) -> (Q, P), which passes the iteration exactly."""
    change = CHANGES[name]

    def moved(y: Any) -> Any:
        Q, P = change.new(T, lm.vec(y[0], y[1]), lm.vec(y[2], y[3]))
        return lm.vec(*Q, *P)

    M = np.array(lm.jacobian(moved, lm.vec(*OLD.q, *OLD.p)))
    J = np.kron([[0.0, 1.0], [-1.0, 0.0]], np.eye(2))
    assert np.abs(M.T @ J @ M - J).max() < 32 * EPS


def test_derivatives_of_any_depth_pass_the_iteration() -> None:
    """Third ones, of a map with a closed form: Q = q + P^2 q^2/10, p = P + ..."""

    @lm.record
    class Cubic(lm.charts.CanonicalTransformation):
        degrees: ClassVar[int] = 1

        def generating(self, t: float, q: lm.Vec, P: lm.Vec) -> float:
            return q[0] * P[0] + P[0] ** 3 * q[0] / 3.0  # p = P + P^3/3, a cubic equation for P

    def momentum(p: Any) -> Any:
        return Cubic().new(0.0, lm.vec(0.3), lm.vec(p))[1][0]

    P = 0.8
    p = P + P**3 / 3.0

    def third(x: Any) -> Any:
        return lm.derivative(lambda a: lm.derivative(lambda b: lm.derivative(momentum, b), a), x)

    slope = 1.0 / (1.0 + P * P)
    exact = 2.0 * (5.0 * P * P - 1.0) * slope**5  # of the inverse of P + P^3/3
    assert momentum(p) == pytest.approx(P, rel=4 * EPS)
    assert lm.derivative(momentum, p) == pytest.approx(slope, rel=8 * EPS)
    assert third(p) == pytest.approx(exact, rel=1e-13)


@pytest.mark.parametrize("original", [KEPLER, Pushed()], ids=["Kepler", "driven"])
@pytest.mark.parametrize("name", CHANGES)
def test_the_equations_of_k_are_the_motion(name: str, original: Any) -> None:
    """(8): Q' = K_P and P' = -K_Q with K = H + dG/dt are what the motion of H does to Q and P."""
    system = CHANGES[name].system(original)
    Q, P = CHANGES[name].new(T, OLD.q, OLD.p)
    by_energy = (
        np.array(lm.gradient(lambda x: system.energy(T, Q, x), P)),
        -np.array(lm.gradient(lambda x: system.energy(T, x, P), Q)),
    )
    assert np.array(system.velocity(T, Q, P)) == pytest.approx(by_energy[0], rel=1e-13)
    assert np.array(system.force(T, Q, P)) == pytest.approx(by_energy[1], rel=1e-13)


def test_k_in_a_turning_frame_is_the_energy_less_the_angular_momentum() -> None:
    system, change = Turning(0.7).system(KEPLER), Turning(0.7)
    Q, P = change.new(T, OLD.q, OLD.p)
    spin = OLD.q[0] * OLD.p[1] - OLD.q[1] * OLD.p[0]
    assert system.energy(T, Q, P) == pytest.approx(KEPLER.energy(OLD.q, OLD.p) - 0.7 * spin)
    assert Identity().system(KEPLER).energy(T, OLD.q, OLD.p) == KEPLER.energy(OLD.q, OLD.p)


def test_a_solution_of_the_hamilton_jacobi_equation_brings_the_motion_to_rest() -> None:
    """K = 0, and the new variables are where the motion was at time zero."""
    system = Solved().system(Oscillator())
    for t in (0.1, 0.7, 1.2):
        Q, P = lm.vec(0.5), lm.vec(0.7)
        assert abs(system.energy(t, Q, P)) < 8 * EPS
        assert abs(system.velocity(t, Q, P)[0]) + abs(system.force(t, Q, P)[0]) < 32 * EPS
        q, p = Solved().old(t, Q, P)
        assert q[0] == pytest.approx(0.5 * math.cos(t) + 0.7 * math.sin(t), rel=1e-14)
        assert p[0] == pytest.approx(0.7 * math.cos(t) - 0.5 * math.sin(t), rel=1e-14)


@pytest.mark.parametrize("name", ["turning", "bent"])
def test_the_motion_in_new_variables_leads_where_the_old_one_does(name: str) -> None:
    """By the midpoint rule of Runge; the error is its own."""
    change = CHANGES[name]
    system = change.system(KEPLER)
    start = system.state(*change.new(T, OLD.q, OLD.p))
    exact = np.array(KEPLER.exact(OLD, 0.3).q)
    method, errors = lm.RKMK(order=2), []
    for n in (6, 12):
        run = lm.integrate(system, method, start, h=0.3 / n, steps=n, t0=T, compiled=False, progress=False)
        q, _ = change.old(T + 0.3, run.last.q, run.last.p)
        errors.append(np.abs(np.array(q) - exact).max())
    slopes = [math.log2(a / b) for a, b in itertools.pairwise(errors)]
    assert slopes[0] == pytest.approx(2.0, abs=0.25)


@pytest.mark.slow
@pytest.mark.compiled
def test_native_code_gives_the_same_bits() -> None:
    system = Turning(0.7).system(KEPLER)
    Q, P = Turning(0.7).new(T, OLD.q, OLD.p)
    many = system.state(np.array(Q) * np.array([[1.0], [0.9], [1.1]]), np.array([P] * 3))
    for start in (system.state(Q, P), many):
        native, python = (
            lm.integrate(system, lm.RKMK(order=4), start, h=0.05, steps=10, t0=T, compiled=c, progress=False)
            for c in (True, False)
        )
        assert native.q.tobytes() == python.q.tobytes()
        assert native.p.tobytes() == python.p.tobytes()


@pytest.mark.slow
def test_a_closed_form_serves_methods_that_expand_in_power_series() -> None:
    @lm.record
    class Closed(Turning):
        def old(self, t: float, Q: lm.Vec, P: lm.Vec) -> tuple[lm.Vec, lm.Vec]:
            c, s = cos(self.rate * t), sin(self.rate * t)
            return (lm.vec(c * Q[0] - s * Q[1], c * Q[1] + s * Q[0]), lm.vec(c * P[0] - s * P[1], c * P[1] + s * P[0]))

    Q, P = Turning(0.7).new(0.0, OLD.q, OLD.p)
    system, method = Closed(0.7).system(KEPLER), lm.HamiltonJacobi(order=4)
    run = lm.integrate(system, method, system.state(Q, P), h=0.02, steps=5, compiled=False, progress=False)
    q, _ = Turning(0.7).old(0.1, run.last.q, run.last.p)
    assert np.abs(np.array(q) - np.array(KEPLER.exact(OLD, 0.1).q)).max() < 1e-6
    with pytest.raises(IncompatibleSystem, match="write `new` and `old` in closed form"):
        method.require(Turning(0.7).system(KEPLER))


def test_what_is_refused() -> None:
    @lm.record
    class Folded(lm.charts.CanonicalTransformation):
        """Q = q^2: nothing is negative."""

        degrees: ClassVar[int] = 1

        def generating(self, t: float, q: lm.Vec, P: lm.Vec) -> float:
            return q[0] ** 2 * P[0]

    assert Folded().old(0.0, lm.vec(4.0), lm.vec(1.0))[0][0] == pytest.approx(2.0)
    with pytest.raises(OutsideChart, match="no position q with dG/dP"):
        Folded().old(0.0, lm.vec(-4.0), lm.vec(1.0))

    @lm.record
    class Timeless(lm.charts.CanonicalTransformation):
        degrees: ClassVar[int] = 1

        def generating(self, q: lm.Vec, P: lm.Vec) -> float:  # type: ignore[override]
            return q[0] * P[0]

    @lm.record
    class Vector(lm.charts.CanonicalTransformation):
        degrees: ClassVar[int] = 1

        def generating(self, t: float, q: lm.Vec, P: lm.Vec) -> Any:
            return q + P

    with pytest.raises(InvalidType, match=r"generating\(self, t, q, P\)"):
        Timeless()
    with pytest.raises(InvalidType, match="must return a number"):
        Vector()
    with pytest.raises(InvalidInput, match="must say its degrees of freedom"):

        @lm.record
        class Mute(lm.charts.CanonicalTransformation):
            pass

        Mute()
    with pytest.raises(InvalidInput, match="with 1 degrees of freedom is needed"):
        Folded().system(KEPLER)
    with pytest.raises(InvalidInput, match="a HamiltonianSystem or a Driven"):
        Identity().system(lm.RigidBody([1.0, 1.5, 2.0]))
    with pytest.raises(InvalidType, match="must be a CanonicalTransformation"):
        type(Identity().system(KEPLER))(transformation=3.0, original=KEPLER)
