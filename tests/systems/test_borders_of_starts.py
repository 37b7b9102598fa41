"""Which starts are consistent, and which conditions independent: a little on both sides of every border."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.formulas import vec
from liemech.rooms.constraints.constrained import eliminated, independent

SIDES = pytest.mark.parametrize(("part", "refused"), [(0.9, False), (1.1, True)])


@SIDES
@pytest.mark.parametrize("unit", [1e-4, 1.0, 1e4])
def test_consistent_positions_and_velocities(part: float, refused: bool, unit: float) -> None:
    """2^-40 of their terms, in any unit of length."""
    ball = lm.SphericalPendulum(length=2.0 * unit, gravity=9.8 * unit)
    q, p = unit * np.array([1.2, 0.0, -1.6]), unit * np.array([0.4, 0.9, 0.3])
    there = np.array(ball.defects(vec(*(q * (1.0 + 1e-6))), vec(*p)))[0]
    for at, impulse in (
        (q * (1.0 + part * 2.0**-40 * 1e-6 / there), p),
        (q, p + part * 2.0**-40 * velocity_terms(ball, q, p) * q / (q @ q)),
    ):
        if refused:
            with pytest.raises(lm.errors.InvalidInput, match="is not consistent"):
                ball.state(at, impulse)
        else:
            ball.state(at, impulse)


def velocity_terms(ball: Any, q: np.ndarray, p: np.ndarray) -> float:
    """What a normal impulse of length one, times |q|, is divided by to fail by one."""
    e = 1e-6 * float(q @ q)
    return e / np.array(ball.defects(vec(*q), vec(*(p + e * q / (q @ q)))))[1]


@lm.record
class Nearly(lm.Surface):
    """Two planes that meet at a small angle."""

    angle: float

    def value(self, q: lm.Vec) -> lm.Vec:
        return vec(q[0], q[0] + self.angle * q[1])


@lm.record
class Free(lm.SeparableSystem):
    """A free particle."""

    degrees = 3

    def kinetic(self, p: lm.Vec) -> float:
        return 0.5 * (p @ p)

    def potential(self, q: lm.Vec) -> float:
        return 0.0 * q[0]


@SIDES
def test_independent_constraints(part: float, refused: bool) -> None:
    """Elimination leaves more than 2^-40 of a row: the square of the angle."""
    system = lm.Constrained(Free(), Nearly(2.0**-20 / np.sqrt(part)))
    if refused:
        with pytest.raises(lm.errors.InvalidInput, match=r"rank 1 of 2.*constraint\[1\] follows"):
            system.state([0.0, 0.0, 1.0], [0.0, 0.0, 1.0])
    else:
        system.state([0.0, 0.0, 1.0], [0.0, 0.0, 1.0])
    G = lm.mat(vec(1.0, 0.0), vec(1.0, 2.0**-20 / np.sqrt(part)))
    pivots = eliminated(G @ G.T, vec(0.0, 0.0))[1]
    assert bool(independent(pivots, G, G)) is not refused


@lm.record
class Rows(lm.VelocityConstraint):
    """Two directions that the angular velocity is across."""

    angle: float

    def matrix(self, g: Any) -> lm.Mat:
        return lm.mat(vec(1.0, 0.0, 0.0), vec(1.0, self.angle, 0.0))


@SIDES
def test_independent_conditions_of_bodies(part: float, refused: bool) -> None:
    """Eigenvalues beside each other to 1e-10: half the square of the angle, over 2."""
    body = lm.NonholonomicBody(lm.RigidBody([1.0, 1.0, 1.0]), Rows(2e-5 / np.sqrt(part)))
    if refused:
        with pytest.raises(lm.errors.InvalidInput, match="rank 1 here; conditions 0, 1 depend"):
            body.state([0.0, 0.0, 1.0], np.eye(3))
    else:
        body.state([0.0, 0.0, 1.0], np.eye(3))


@SIDES
@pytest.mark.parametrize("full", [False, True])
def test_consistent_starts_of_bodies(part: float, refused: bool, full: bool) -> None:
    """1e-9 of what velocities of the same energy could be off."""
    J = np.diag([2.0, 1.0, 3.0])
    if full:
        R = lm.SO3().exp([0.3, 0.2, -0.4])
        J = np.array(R) @ J @ np.array(R).T
        J = 0.5 * (J + J.T)
    body = lm.NonholonomicBody(lm.RigidBody(J), lm.joints.Suslov([0.0, 0.0, 1.0]))
    inverse, mu = np.linalg.inv(J), J @ [0.3, 0.4, 0.0]
    scale = np.sqrt(mu @ inverse @ mu * inverse[2, 2])
    off = mu + part * 1e-9 * scale / inverse[2, 2] * np.eye(3)[2]
    if refused:
        with pytest.raises(lm.errors.InconsistentState, match="condition 0 is"):
            body.state(off, np.eye(3))
    else:
        body.state(off, np.eye(3))


@lm.record
class Bent(lm.Hamiltonian):
    """K(u) + L(v) and a little of u v."""

    mixed: float

    def energy(self, mu: lm.Vec) -> float:
        return mu[0] * mu[0] + mu[1] + self.mixed * mu[0] * mu[1]


@lm.record
class Plane(lm.PoissonStructure):
    """b = u v, and a little of u^2, and a little that is not skew."""

    dim = 2
    rank = 2
    bend: float = 0.0
    skew: float = 0.0

    def matrix(self, y: lm.Vec) -> lm.Mat:
        b = y[0] * y[1] + self.bend * y[0] * y[0]
        return lm.mat(vec(0.0, b), vec(-b * (1.0 + self.skew), 0.0))


@pytest.mark.parametrize(
    ("energy", "structure", "words"),
    [
        (Bent(0.0), Plane(), None),
        (Bent(2.0**-60), Plane(), "needs an energy K"),
        (Bent(2.0**-36), Plane(), "needs an energy K"),
        (Bent(0.0), Plane(2.0**-70), "not affine in u"),
        (Bent(0.0), Plane(2.0**-36), "not affine in u"),
        (Bent(0.0), Plane(0.0, 2.0**-41), None),
        (Bent(0.0), Plane(0.0, 2.0**-39), "not skew-symmetric"),
    ],
)
def test_what_planar_euler_refuses(energy: Any, structure: Any, words: str | None) -> None:
    """What bends or mixes a little does so much in other units; skew to 2^-40, for rounding."""
    system = lm.PoissonSystem(structure, energy)
    for method in (lm.PoissonEuler(), lm.PoissonVerlet()):
        if words is None:
            method.require(system)
        else:
            with pytest.raises(lm.errors.IncompatibleSystem, match=words):
                method.require(system)


@pytest.mark.parametrize("unit", [1e-4, 1e4])
def test_defects_are_the_same_in_any_unit(unit: float) -> None:
    found = []
    for length in (1.0, unit):
        ball = lm.SphericalPendulum(length=2.0 * length, gravity=9.8 * length)
        q, p = np.array([1.2, 0.01, -1.6]), np.array([0.4, 0.9, 0.3])
        found.append(np.array(ball.defects(vec(*(length * q)), vec(*(length * p)))))
    assert np.allclose(found[0], found[1], rtol=1e-12) and (found[0] > 1e-6).all()


@lm.record
class TwoSpheres(lm.SeparableConstrainedSystem):
    """A point on two spheres whose centres are a little apart: a circle, across both."""

    degrees = 3
    off: float

    def kinetic(self, p: lm.Vec) -> float:
        return 0.5 * (p[0] * p[0] + p[1] * p[1] / 3.0 + 2.0 * p[2] * p[2])

    def potential(self, q: lm.Vec) -> float:
        return q[2]

    def constraint(self, q: lm.Vec) -> lm.Vec:
        other = q - vec(self.off, 0.5 * self.off, 0.0)
        return vec(lm.dot(q, q) - 1.0, lm.dot(other, other) - 1.0)


@pytest.mark.sample(4)
@pytest.mark.parametrize("off", [1e-4, 1e-5, 1.0, 1e-3])
@pytest.mark.parametrize("away", [1e-6, 1e-3, 3e-2])
def test_constraints_that_are_nearly_parallel(off: float, away: float) -> None:
    """Where RATTLE runs a consistent start is found from near by."""
    system = TwoSpheres(off)
    x = np.array([0.5 * off, 0.25 * off, 0.0])
    q = x + np.sqrt(1.0 - x @ x) * np.array([0.0, 0.0, -1.0])
    p = np.array([0.1, -0.2, 0.0]) * [0.5, 3.0, 0.0]
    rng = np.random.default_rng(2)
    for _ in range(3):
        a, b = away * rng.normal(size=(2, 3))
        start = system.consistent(q + a, p + b)
        assert np.linalg.norm(np.array(start.q) - q) <= 4.0 * np.linalg.norm(a)
        run = lm.integrate(system, lm.RATTLE(), start, h=0.01, steps=3, compiled=False)
        assert np.abs(run.drift()["constraint"].largest) <= 1e-14
