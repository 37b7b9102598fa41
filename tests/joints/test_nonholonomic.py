"""Rolling and gliding: exact motions, order, the way back, and what becomes of the energy."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import Rolling, Slope

import liemech as lm

EPSILON = np.finfo(float).eps


@lm.record
class Row(lm.VelocityConstraint):
    """One condition with constant coefficients in body axes."""

    row: lm.Vec

    def matrix(self, g):
        return lm.mat(self.row)


J = np.array([[1.0, 0.0, 0.2], [0.0, 1.6, 0.3], [0.2, 0.3, 2.0]])


def suslov(w: np.ndarray, t: float) -> np.ndarray:
    """The first two components of the exact angular velocity: an angle that turns by the law of a
    pendulum's separatrix.
    """
    a, b = np.sqrt(np.array([J[0, 0] * w[0] ** 2 + J[1, 1] * w[1] ** 2] * 2) / [J[0, 0], J[1, 1]])
    c = complex(J[0, 2] * a, J[1, 2] * b) / np.sqrt(J[0, 0] * J[1, 1])
    begun = np.arctan2(w[1] / b, w[0] / a) - np.angle(c)
    s = abs(c) * t + np.arctanh(np.sin(begun))
    angle = np.angle(c) + np.arctan2(np.tanh(s), np.sign(np.cos(begun)) / np.cosh(s))
    return np.array([a * np.cos(angle), b * np.sin(angle)])


def run(system, start, h, steps, method=None, **options):
    chosen = method or lm.LagrangeDAlembert()
    return lm.integrate(system, chosen, start, h=h, steps=steps, compiled=False, progress=False, **options)


def order(errors) -> float:
    return float(np.log2(errors[0] / errors[1]))


@pytest.mark.parametrize("retraction", [lm.Exponential(), lm.Cayley()])
def test_Suslov_problem(retraction):
    body = lm.NonholonomicBody(lm.RigidBody(J), Row([0.0, 0.0, 1.0]))
    w = np.array([0.6, -0.9, 0.0])
    start, errors = body.state(J @ w, np.eye(3)), []
    for n in 20, 40:
        found = run(body, start, 4.0 / n, n, lm.LagrangeDAlembert(retraction))
        xi = np.linalg.solve(J, found.mu.T).T
        errors.append(np.abs(xi[-1, :2] - suslov(w, 4.0)).max())
        assert np.abs(xi[:, 2]).max() < 2 * EPSILON
    assert order(errors) == pytest.approx(2.0, abs=0.06)
    # later rounding has grown: the rotation is unstable
    there = run(body, start, 0.1, 10, lm.LagrangeDAlembert(retraction))
    back = run(body, there.last, -0.1, 10, lm.LagrangeDAlembert(retraction))
    assert np.allclose(back.mu[-1], np.array(start.mu), rtol=0.0, atol=1e-14)


@pytest.mark.slow
def test_the_energy_of_the_Suslov_problem_stays_off_after_the_passage():
    # From one steady rotation to the other: no symplectic form holds the energy, but its offset is
    # of second order.
    J = np.array([[1.0, 0.0, 0.4], [0.0, 1.6, 0.4], [0.4, 0.4, 1.6]])
    body = lm.NonholonomicBody(lm.RigidBody(J), Row([0.0, 0.0, 1.0]))
    d = np.angle(complex(J[0, 2] / np.sqrt(J[0, 0]), J[1, 2] / np.sqrt(J[1, 1])))
    w = np.array([np.cos(d - 1.5) / np.sqrt(J[0, 0]), np.sin(d - 1.5) / np.sqrt(J[1, 1]), 0.0])
    start, offsets = body.state(J @ w, np.eye(3)), []
    for h in 0.3, 0.15:
        energy = run(body, start, h, round(45.0 / h)).energy
        offsets.append(abs(energy[-1] / energy[0] - 1.0))
        # the passage is over, and nothing changes any more
        assert abs(energy[-1] - energy[-20]) < 1e-3 * offsets[-1]
    assert offsets[1] > 1e-7
    assert order(offsets) == pytest.approx(2.0, abs=0.2)


def test_Chaplygin_sleigh():
    # A blade at the distance a behind the centre of mass: u = U tanh(k (t - t0)), w = W/cosh(k
    # (t - t0)).
    mass, inertia, a, u, w = 1.3, 0.7, 0.4, -0.5, 1.1
    free = lm.LiePoissonSystem(lm.SE2(), lm.KineticEnergy([inertia, mass, mass]))
    sleigh = lm.NonholonomicBody(free, Row([-a, 0.0, 1.0]))
    start = sleigh.state([inertia * w, mass * u, mass * a * w], np.eye(3))
    K = inertia + mass * a * a
    energy = 0.5 * (mass * u * u + K * w * w)
    U, W = np.sqrt(2.0 * energy / mass), np.sqrt(2.0 * energy / K)
    s = mass * a * U / K * 4.0 + np.arctanh(u / U)
    errors = []
    for n in 40, 80:
        end = run(sleigh, start, 4.0 / n, n).mu[-1]
        errors.append(np.abs([end[1] / mass - U * np.tanh(s), end[0] / inertia - W / np.cosh(s)]).max())
    assert order(errors) == pytest.approx(2.0, abs=0.05)


def ball(moments) -> tuple[lm.NonholonomicBody, lm.State, np.ndarray]:
    """A ball of 0.3 m and 2 kg with these moments, rolling, and its angular velocity in space."""
    mass, r, w = 2.0, 0.3, np.array([1.0, 2.0, 0.7])
    free = lm.LiePoissonSystem(lm.ProductGroup(lm.SO3(), lm.VectorSpace(2)), lm.KineticEnergy([*moments, mass, mass]))
    R = np.array(lm.SO3().exp([0.3, 0.2, -0.5]))
    body = lm.NonholonomicBody(free, Rolling(r))
    return (
        body,
        body.state([*np.array(moments) * (R.T @ w), mass * r * w[1], -mass * r * w[0]], [*R.ravel(), 0.1, 0.2]),
        w,
    )


def test_an_even_ball_rolls_straight():
    body, start, w = ball([0.07, 0.07, 0.07])
    end = run(body, start, 0.1, 20).g[-1]
    assert np.allclose(end[9:], np.array([0.1, 0.2]) + 2.0 * 0.3 * np.array([w[1], -w[0]]), rtol=0.0, atol=1e-13)


@pytest.mark.slow
def test_an_uneven_ball_keeps_its_momentum_about_the_point_of_contact():
    # Chaplygin's ball: m r^2 (w - (w.e3) e3) + R Pi is constant, and the energy.
    body, start, _ = ball([0.05, 0.07, 0.09])
    exact = run(body, start, 0.1, 20, lm.RKMK(order=6)).g[-1]
    errors, changes = [], []
    for n in 20, 40:
        found = run(body, start, 2.0 / n, n)
        errors.append(np.abs(found.g[-1] - exact).max())
        R = found.g[:, :9].reshape(-1, 3, 3)
        about = np.einsum("kij,kj->ki", R, found.mu[:, :3]) + np.cross(
            [0.0, 0.0, 0.3], np.pad(found.mu[:, 3:], ((0, 0), (0, 1)))
        )
        changes.append(np.abs(about - about[0]).max())
        misses = [np.array(body.jacobian(g)) @ np.array(body.velocity(mu)) for mu, g in zip(found.mu, found.g)]
        assert np.abs(misses).max() < 8 * EPSILON
    assert order(errors) == pytest.approx(2.0, abs=0.05)
    assert max(changes) < 1e-14


def test_nonholonomic_particle():
    # z' = y x': y is uniform, x' = c/sqrt(1 + y^2), z' = y x'.
    free = lm.LiePoissonSystem(lm.VectorSpace(3), lm.KineticEnergy([1.0, 1.0, 1.0]))
    particle = lm.NonholonomicBody(free, Slope())
    y, v, rate = 0.2, 0.7, 0.9
    start = particle.state([v, rate, y * v], [0.1, y, -0.3])
    c, end = v * np.sqrt(1.0 + y * y), y + rate * 3.0
    exact = [
        0.1 + c / rate * (np.arcsinh(end) - np.arcsinh(y)),
        end,
        -0.3 + c / rate * (np.sqrt(1.0 + end * end) - np.sqrt(1.0 + y * y)),
    ]
    errors = [np.abs(run(particle, start, 3.0 / n, n).g[-1] - exact).max() for n in (20, 40)]
    assert order(errors) == pytest.approx(2.0, abs=0.05)


def test_what_does_not_roll_is_refused():
    body = lm.NonholonomicBody(lm.RigidBody(J), Row([0.0, 0.0, 1.0]))
    with pytest.raises(lm.errors.InconsistentState, match=r"G\(g\) J\^-1 mu must be zero; condition 0 is 1\.27"):
        body.state([1.0, 2.0, 3.0], np.eye(3))
    near = body.consistent([1.0, 2.0, 3.0], np.eye(3))
    assert abs(np.linalg.solve(J, np.array(near.mu))[2]) < 1e-15
    # the force of the constraint acts along e3 alone
    assert np.allclose(np.array(near.mu)[:2], [1.0, 2.0])
    with pytest.raises(lm.errors.IncompatibleSystem, match=r"LagrangeDAlembert\(\) is the method"):
        run(body, near, 0.1, 1, lm.LieRATTLE())
    with pytest.raises(lm.errors.InvalidType, match="NonholonomicBody"):
        lm.ConstrainedBody(lm.RigidBody(J), Row([0.0, 0.0, 1.0]))
    with pytest.raises(lm.errors.InvalidType, match=r"matrix must return lm.mat\(...\), \(m, 3\)"):
        lm.NonholonomicBody(lm.RigidBody(J), Row([0.0, 0.0, 1.0, 0.0]))


@lm.record
class Gear(lm.VelocityConstraint):
    """Two oscillators x, z whose gear a third body turns, x' + sin(y) z' = 0."""

    def matrix(self, g):
        return lm.mat(lm.vec(1.0, 0.0, lm.formulas.sin(g[1])))


@lm.record
class Driver(lm.Potential):
    """The springs of x and z, and -cos y + a sin 2 y of a pendulum that turns over and over."""

    a: float

    def energy(self, g):
        y = g[1]
        return 0.5 * (g[0] * g[0] + g[2] * g[2]) - lm.formulas.cos(y) + self.a * lm.formulas.sin(2.0 * y)


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize(
    "method",
    [
        lm.LagrangeDAlembert(),
        *(lm.Composition(lm.LagrangeDAlembert(), order=p) for p in (4, 6)),
        lm.ReversibleController(lm.LagrangeDAlembert(), lambda mu: 2.0 / (2.0 + 0.3 * lm.dot(mu, mu))),
    ],
    ids=lambda method: method.name,
)
def test_no_method_holds_the_energy_where_the_motion_has_no_way_back(method):
    """A test of the kind of Modin and Verdier, Numer. Math. 145 (2020), 405: for a = 0 turning the sign of y with that of
    the velocities reverses the motion, and the energy stays in its band; for a = 0.3 nothing does, and it leaves it.
    """
    free = lm.LiePoissonSystem(lm.VectorSpace(3), lm.KineticEnergy([1.0] * 3))
    for a, holds in ((0.0, True), (0.3, False)):
        body = lm.NonholonomicBody(lm.MechanicalSystem(free, Driver(a)), Gear())
        start = body.consistent(mu=[0.0, 2.3, 0.6], g=[0.8, 0.3, 0.5])
        energy = lm.integrate(body, method, start, h=0.2, steps=20_000, every=10).energy
        first, last = energy[:500], energy[-500:]
        moved = abs(last.mean() - first.mean()) / np.ptp(last)
        assert moved < 0.02 if holds else moved > 1.5
