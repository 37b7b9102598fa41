"""Relative equilibria: closed forms of their frequencies, thresholds of their stability, their units."""

from __future__ import annotations

import math
import warnings
from typing import Any, ClassVar

import numpy as np
import pytest
from scenes import Charged

import liemech as lm

TILT = 0.4


def tilted(angle: float) -> np.ndarray:
    return np.asarray(lm.SO3().exp([angle, 0.0, 0.0]))


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_free_body_turns_about_its_axes(axis: int) -> None:
    """Euler: about axis i, lambda^2 = w^2 (J_j - J_i)(J_i - J_k)/(J_j J_k)."""
    J, mu = np.array([1.0, 1.5, 2.0]), np.full(3, 0.03)
    mu[axis] = 0.9
    body = lm.RigidBody(J.tolist())
    found = lm.relative_equilibrium(body, body.state(mu=mu))
    i, j, k = axis, (axis + 1) % 3, (axis + 2) % 3
    w = np.linalg.norm(mu) / J[i]  # the momenta of the guess are kept: |mu| too
    square = w * w * (J[j] - J[i]) * (J[i] - J[k]) / (J[j] * J[k])
    np.testing.assert_allclose(found.eigenvalues**2, [square, square], rtol=1e-9)
    assert found.symmetries == 3
    assert found.verdict == ("unstable" if axis == 1 else "stable")
    assert found.squares == ((0, 2), (1, 1), (2, 0))[axis]
    np.testing.assert_allclose(np.linalg.norm(found.state.mu), np.linalg.norm(mu), rtol=1e-14)


@pytest.mark.parametrize("size", [1e-160, 1e-150, 1e150, 1e160])
def test_units_are_refused_in_which_squares_leave_the_range_of_numbers(size: float) -> None:
    """Euler's frequencies grow with the momentum; that of 1e-160 was lost, and 0 called stable."""
    body = lm.RigidBody([1.0, 1.5, 2.0])
    guess = body.state(mu=[size, 1e-3 * size, 0.0])
    if 1e-154 < size < 1e154:
        found = lm.relative_equilibrium(body, guess)
        np.testing.assert_allclose(found.frequencies / size, [6.0**-0.5], rtol=1e-5)
    else:
        with pytest.raises(lm.errors.InvalidInput, match="have squares beyond the range of numbers"):
            lm.relative_equilibrium(body, guess)


@pytest.mark.parametrize("part", [0.9, 1.0 - 1e-6, 1.0 + 1e-6, 1.2])
def test_a_sleeping_top_wakes_below_its_threshold(part: float) -> None:
    """It sleeps if mu_3^2 > 4 A m g l; below, it grows at sqrt(m g l/A - (mu_3/2A)^2).
    Source: Goldstein, Classical Mechanics, 3rd ed., section 5.7.
    """
    A, mgl = 1.3, 0.8
    mu_3 = part * 2.0 * math.sqrt(A * mgl)
    top = lm.models.LagrangeTop(transverse=A, axial=0.6, weight=0.4, length=2.0)
    found = lm.relative_equilibrium(top, top.state(mu=[0.0, 0.0, mu_3], g=np.eye(3)))
    growth = math.sqrt(max(mgl / A - (mu_3 / (2.0 * A)) ** 2, 0.0))
    assert found.growth == pytest.approx(growth, rel=1e-6)
    assert found.verdict == ("unstable" if part < 1.0 else "stable")
    assert found.squares == ((2, 2) if part < 1.0 else (4, 0))


def test_a_top_precesses_without_nodding() -> None:
    """A p^2 cos - mu_3 p + m g l = 0, and nutation is an oscillation in the effective potential.
    Source: Goldstein, Classical Mechanics, 3rd ed., section 5.7.
    """
    A, mgl = 1.0, 0.8
    top = lm.models.LagrangeTop(transverse=A, axial=0.6, weight=mgl, length=1.0)
    found = lm.relative_equilibrium(top, top.state(mu=[0.1, 0.3, 2.1], g=tilted(TILT)))
    mu, g = np.asarray(found.state.mu), np.asarray(found.state.g)
    cos, sin = g[2, 2], math.hypot(g[2, 0], g[2, 1])
    precession = math.hypot(mu[0], mu[1]) / (A * sin)
    assert sin > 0.05 and found.symmetries == 2 and found.verdict == "stable"
    assert A * precession**2 * cos - mu[2] * precession + mgl == pytest.approx(0.0, abs=1e-11)

    def potential(angle: float) -> float:
        return (mu @ g[2] - mu[2] * math.cos(angle)) ** 2 / (2.0 * A * math.sin(angle) ** 2) + mgl * math.cos(angle)

    angle, d = math.atan2(sin, cos), 1e-3 * sin
    weights = {-2: -1 / 12, -1: 4 / 3, 0: -5 / 2, 1: 4 / 3, 2: -1 / 12}
    bent = sum(c * potential(angle + k * d) for k, c in weights.items()) / d**2
    np.testing.assert_allclose(found.frequencies, [math.sqrt(bent / A)], rtol=1e-7)


@pytest.mark.slow
def test_a_motion_from_it_is_steady() -> None:
    top = lm.models.HeavyTop([1.0, 1.6, 2.3], 0.8, [0.1, 0.2, 1.0])
    found = lm.relative_equilibrium(top, top.state(mu=[0.0, 0.0, -2.5], g=tilted(3.0)))
    assert found.symmetries == 1 and found.verdict == "stable"
    run = lm.integrate(top, lm.RKMK(order=8), found.state, h=0.05, steps=400, every=400)
    np.testing.assert_allclose(run.mu[-1], run.mu[0], atol=1e-12)
    # it oscillates about it as the eigenvalues say: z(T) = exp(A T) z is the identity after a period of each alone
    assert np.allclose(np.sort(np.abs(found.eigenvalues))[::2], found.frequencies)


@pytest.mark.slow
@pytest.mark.parametrize(("moments", "verdict"), [((10.0, 14.0, 15.0), "stable"), ((15.0, 14.0, 10.0), "unstable")])
def test_a_satellite_faces_its_planet(moments: tuple[float, ...], verdict: str) -> None:
    """In pitch s^2 = -3 (J_roll - J_yaw)/J_pitch, in roll and yaw s^4 + (1 + 3 a + a b) s^2 + 4 a b = 0, in orbits;
    a = (J_pitch - J_yaw)/J_roll, b = (J_pitch - J_roll)/J_yaw.  In metres and kilograms, though torques are 10^-16 of
    the orbit's energy.  Source: Hughes, Spacecraft Attitude Dynamics, section 9.2.
    """
    attraction, radius = 3.986004418e14, 7.0e6
    satellite = lm.models.OrbitingBody(inertia=moments, mass=100.0, attraction=attraction)
    guess = satellite.circular_orbit(radius, g=np.asarray(lm.SO3().exp([0.02, -0.01, 0.03])))
    found = lm.relative_equilibrium(satellite, guess)
    yaw, roll, pitch = moments
    a, b = (pitch - yaw) / roll, (pitch - roll) / yaw
    in_roll_and_yaw = np.roots([1.0, 0.0, 1.0 + 3.0 * a + a * b, 0.0, 4.0 * a * b])
    in_pitch = np.sqrt(complex(3.0 * (yaw - roll) / pitch)) * np.array([1.0, -1.0])
    wanted = np.concatenate([[1.0j, -1.0j], in_pitch, in_roll_and_yaw])
    seen = found.eigenvalues / math.sqrt(attraction / radius**3)
    assert max(np.abs(seen - x).min() for x in wanted) < 1e-6
    assert max(np.abs(wanted - x).min() for x in seen) < 1e-6
    assert found.symmetries == 3 and found.verdict == verdict


@pytest.mark.parametrize("masses", [(1.0, 0.01, 0.005), (1.0, 0.5, 0.4)])
def test_three_masses_turn_as_a_triangle(masses: tuple[float, ...]) -> None:
    """2 s^2 = -1 +- sqrt(1 - 27 (m_1 m_2 + m_2 m_3 + m_3 m_1)/M^2) in units of the rotation (Gascheau 1843, Routh 1875)."""
    m, M = np.array(masses), sum(masses)
    q = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, math.sqrt(0.75)]])
    q -= m @ q / M
    p = m[:, None] * math.sqrt(M) * np.stack([-q[:, 1], q[:, 0]], axis=1)
    rng = np.random.default_rng(0)
    near = [(x * (1.0 + 0.01 * rng.normal(size=x.shape))).ravel() for x in (q, p)]
    bodies = lm.models.NBody(masses, dimension=2)
    found = lm.relative_equilibrium(bodies, bodies.state(*near))
    at = np.asarray(found.state.q).reshape(3, 2)
    sides = [np.linalg.norm(at[i] - at[j]) for i, j in ((0, 1), (1, 2), (2, 0))]
    np.testing.assert_allclose(sides, sides[0], rtol=1e-10)
    turning = math.sqrt(M / sides[0] ** 3)
    routh = np.sqrt(complex(1.0 - 27.0 * (m[0] * m[1] + m[1] * m[2] + m[2] * m[0]) / M**2))
    for square in (0.5 * (-1.0 + routh), 0.5 * (-1.0 - routh), -1.0):
        assert np.abs((found.eigenvalues / turning) ** 2 - square).min() < 1e-8
    # the momentum, the angular momentum and that of the centre of mass, which is kept by itself
    assert found.symmetries == 4
    assert found.verdict == ("unstable" if routh.imag else "spectrally stable")


@pytest.mark.parametrize(("axis", "verdict"), [(0, "stable"), (1, "unstable"), (2, "unstable")])
def test_a_body_in_water_turns_broadside(axis: int, verdict: str) -> None:
    """Moving along axis i: s^2 = -P^2 (1/m_j - 1/m_i)/J_k about each axis k across.
    Source: Kirchhoff, Vorlesungen ueber Mechanik (1876), lecture 19; Leonard, Automatica 33 (1997), section 3.
    """
    J, m = (1.0, 1.2, 1.5), (3.0, 2.0, 1.8)
    P = np.full(3, 1e-2)
    P[axis] = 2.0
    body = lm.models.KirchhoffBody([*J, *m])
    found = lm.relative_equilibrium(body, body.state(mu=[*np.zeros(3), *P]))
    for k in {0, 1, 2} - {axis}:
        other = 3 - axis - k
        square = -(P @ P) * (1.0 / m[other] - 1.0 / m[axis]) / J[k]
        assert np.abs(found.eigenvalues**2 - square).min() < 1e-7
    assert found.symmetries == 6 and found.verdict == verdict


@pytest.mark.parametrize("length", [2.0**-30, 1.0, 2.0**30])
@pytest.mark.parametrize("time", [2.0**-30, 1.0, 2.0**30])
def test_units_change_nothing(length: float, time: float) -> None:
    mass, rate = 3.0, 1.0 / time
    moment, weight = mass * length**2, mass * length * rate**2
    top = lm.models.HeavyTop([moment, 1.6 * moment, 2.3 * moment], 0.8 * weight, [0.1 * length, 0.2 * length, length])
    found = lm.relative_equilibrium(top, top.state(mu=[0.0, 0.0, -2.5 * moment * rate], g=tilted(3.0)))
    plain = lm.models.HeavyTop([3.0, 4.8, 6.9], 2.4, [0.1, 0.2, 1.0])
    wanted = lm.relative_equilibrium(plain, plain.state(mu=[0.0, 0.0, -7.5], g=tilted(3.0)))
    np.testing.assert_allclose(found.frequencies * time, wanted.frequencies, rtol=1e-9)
    assert found.squares == wanted.squares == (4, 0)


def test_a_body_at_rest_is_one_too() -> None:
    """Hanging, a body swings at sqrt(m g l/J) about each horizontal axis."""
    top = lm.models.HeavyTop([1.0, 1.6, 2.3], 0.8, [0.0, 0.0, 1.0])
    found = lm.relative_equilibrium(top, top.state(mu=np.zeros(3), g=tilted(3.1)))
    np.testing.assert_allclose(found.frequencies, [math.sqrt(0.8 / 1.6), math.sqrt(0.8)], rtol=1e-9)
    assert found.verdict == "stable"
    pendulum = lm.models.Pendulum()
    up = lm.relative_equilibrium(pendulum, pendulum.state(q=3.0, p=0.0))
    assert up.symmetries == 0 and up.verdict == "unstable"
    assert up.growth == pytest.approx(math.sqrt(pendulum.gravity / pendulum.length), rel=1e-12)
    # found again from itself
    assert lm.relative_equilibrium(pendulum, up.state).growth == pytest.approx(up.growth, rel=1e-12)


def test_a_charged_top_in_a_magnetic_field() -> None:
    """Numbers of an independent program, which differentiated by complex steps."""
    M = [[1.1, 0.3, 0.0], [0.3, 0.7, 0.2], [0.0, 0.2, 1.3]]
    top = Charged([1.0, 1.6, 2.3], M, [0.08, 0.16, 0.8], 1.2)
    # the level of the momentum is that of the guess
    guess = top.state(mu=np.asarray(tilted(3.0)).T @ [0.0, 0.0, 2.5], g=tilted(3.0))
    found = lm.relative_equilibrium(top, guess)
    mu, g = np.asarray(found.state.mu), np.asarray(found.state.g)
    np.testing.assert_allclose(mu, [-0.142772907109018, -0.452020670987044, -2.45559263023255], rtol=1e-12)
    np.testing.assert_allclose(g[2], [-0.07615495395893, -0.199562307223443, -0.976921342034849], rtol=1e-12)
    assert found.velocity[:3] @ g[2] == pytest.approx(0.743082613199693, rel=1e-12)
    np.testing.assert_allclose(found.frequencies, [0.946587108, 1.4644706848], rtol=1e-8)
    assert found.symmetries == 1 and found.squares == (4, 0) and found.verdict == "stable"


@lm.record
class CircularHat(lm.Potential):
    """-|x|^2/2 + |x|^4/4 of a point in the plane whose coordinates are factors of a product."""

    def energy(self, g: lm.Vec) -> float:
        square = g[0] * g[0] + g[1] * g[1]
        return -0.5 * square + 0.25 * square * square


def test_a_turn_may_mix_two_factors() -> None:
    """On a circle of radius r: w^2 = r^2 - 1, and radial oscillations at sqrt(6 r^2 - 4)."""
    line = lm.VectorSpace(1)
    plane = lm.LiePoissonSystem(lm.ProductGroup(line, line), lm.KineticEnergy([1.0, 1.0]))
    hat = lm.MechanicalSystem(plane, CircularHat())
    found = lm.relative_equilibrium(hat, hat.state(mu=[0.1, 2.0], g=[1.5, 0.1]))
    r = np.linalg.norm(found.state.g)
    assert found.symmetries == 1 and found.verdict == "stable"
    assert np.linalg.norm(found.state.mu) == pytest.approx(r * math.sqrt(r * r - 1.0), rel=1e-10)
    np.testing.assert_allclose(found.frequencies, [math.sqrt(6.0 * r * r - 4.0)], rtol=1e-9)


@lm.record
class Friction(lm.Force):
    """A torque against the rotation."""

    c: float

    def covector(self, t: float, xi: lm.Vec, g: object) -> lm.Vec:
        return -self.c * xi


@lm.record
class InTheField(lm.Potential):
    """A body with an axis of its own in each direction, as a crystal: no turn leaves it as it is."""

    def energy(self, g: lm.Mat) -> float:
        return -g[0][0] - 2.0 * g[1][1] - 3.0 * g[2][2]


def test_under_friction_it_comes_to_rest() -> None:
    damped = lm.MechanicalSystem(lm.RigidBody([1.0, 1.5, 2.0]), InTheField(), load=Friction(0.3))
    found = lm.relative_equilibrium(damped, damped.state(mu=[0.1, 0.0, 0.0], g=tilted(0.2)))
    assert found.squares is None and found.symmetries == 0 and found.verdict == "asymptotically stable"
    # about e_k: J s^2 + c s + the sum of the other two fields = 0
    wanted = [np.roots([J, 0.3, k]) for J, k in ((1.0, 5.0), (1.5, 4.0), (2.0, 3.0))]
    np.testing.assert_allclose(np.sort_complex(found.eigenvalues), np.sort_complex(np.concatenate(wanted)), atol=1e-9)


@lm.record
class OnAHill(lm.HamiltonianSystem):
    """A charge in a magnetic field, on a round hill, or in a bowl if the slope is negative."""

    degrees = 2
    field: float
    slope: float

    def energy(self, q: lm.Vec, p: lm.Vec) -> float:
        v = p + 0.5 * self.field * lm.vec(q[1], -q[0])
        return 0.5 * lm.dot(v, v) - 0.5 * self.slope * lm.dot(q, q) + 0.1 * lm.dot(q, q) ** 2


@lm.record
class TwoSigns(lm.HamiltonianSystem):
    """Two oscillators, one of negative energy, which q_1 p_2 + q_2 p_1 leaves alone."""

    degrees = 2

    def energy(self, q: lm.Vec, p: lm.Vec) -> float:
        both = p[0] ** 2 + q[0] ** 2 - p[1] ** 2 - q[1] ** 2
        return 0.5 * both + 0.1 * both**2


@pytest.mark.parametrize(
    ("system", "squares", "verdict"),
    [
        (OnAHill(0.0, 4.0), (2, 2), "unstable"),
        (OnAHill(1.0, 1.0), (2, 2), "unstable"),
        (OnAHill(3.0, 1.0), (4, 0), "stable"),
        (OnAHill(0.0, -1.0), (4, 0), "stable"),
        (TwoSigns(), (2, 2), "spectrally stable"),
    ],
    ids=repr,
)
def test_at_the_centre_of_a_symmetry_no_direction_is_left_out(system: Any, squares: Any, verdict: str) -> None:
    """There its momentum is stationary, so that all four directions are at the level of it."""
    found = lm.relative_equilibrium(system, system.state(q=[0.0, 0.0], p=[0.0, 0.0]))
    assert (found.symmetries, found.squares, found.verdict) == (1, squares, verdict)
    if isinstance(system, OnAHill):  # q'' = i B q' + k q in the complex plane
        roots = np.roots([1.0, -1j * system.field, -system.slope])
        wanted = np.sort_complex(np.round([*roots, *roots.conj()], 12))
        np.testing.assert_allclose(np.sort_complex(np.round(found.eigenvalues, 12)), wanted, atol=1e-9)


@lm.record
class OfTwoLines(lm.Potential):
    """A saddle, or a bowl."""

    k: lm.Vec

    def energy(self, g: lm.Vec) -> float:
        return 0.5 * lm.dot(self.k * g, g)


@pytest.mark.parametrize(("k", "squares"), [((1.0, 2.0), (4, 0)), ((1.0, -1.0), (3, 1))])
def test_left_less_right_translations_of_a_line_are_no_momentum(k: Any, squares: tuple[int, int]) -> None:
    plane = lm.LiePoissonSystem(lm.VectorSpace(1) * lm.VectorSpace(1), lm.KineticEnergy([1.0, 1.5]))
    point = lm.MechanicalSystem(plane, OfTwoLines(k))
    found = lm.relative_equilibrium(point, point.state(mu=[0.0, 0.0], g=[0.0, 0.0]))
    assert (found.symmetries, found.squares) == (0, squares)
    rates = [x for c, m in zip(k, (1.0, 1.5)) for x in np.roots([m, 0.0, c])]
    np.testing.assert_allclose(np.sort_complex(found.eigenvalues**2), np.sort_complex(np.square(rates)), atol=1e-9)


@lm.record
class OnALineAndInAHat(lm.CotangentSystem):
    """A point on a line, with V = k x^2/2 + x^4/10, and one in a plane, with V = (|q|^2 - 1)^2."""

    configurations = lm.VectorSpace(1) * lm.VectorSpace(2)
    k: float
    quartic: float

    def energy(self, mu: lm.Vec, g: lm.Vec) -> float:
        x, height = g[0], g[1] ** 2 + g[2] ** 2 - 1.0
        return 0.5 * lm.dot(mu, mu) + 0.5 * self.k * x**2 + self.quartic * x**4 + height**2


@pytest.mark.parametrize(
    ("k", "quartic", "mu", "q", "squares", "growth"),
    [
        (-1.4, 0.1, (0.0, 0.0, 0.7), (0.0, 1.0, 0.0), (3, 1), math.sqrt(1.4)),
        (0.0, 0.0, (0.0, 0.0, 0.7), (0.0, 1.0, 0.0), (2, 0), 0.0),
        (0.0, 0.0, (0.6, 0.0, 0.0), (0.3, 0.0, 0.0), (2, 2), 2.0),
        (-1.4, 0.0, (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), (3, 1), math.sqrt(1.4)),
    ],
)
def test_two_points_are_as_stable_as_each(
    k: float, quartic: float, mu: Any, q: Any, squares: Any, growth: float
) -> None:
    both = OnALineAndInAHat(k, quartic)
    found = lm.relative_equilibrium(both, both.state(mu=mu, g=q))
    assert found.squares == squares and found.growth == pytest.approx(growth, abs=1e-9)
    assert found.verdict == ("unstable" if growth else "stable")


@lm.record
class BodyAndSphere(lm.CotangentSystem):
    """Two free bodies, of which one has equal moments, and one on a line."""

    configurations = lm.SO3() * lm.SO3() * lm.VectorSpace(1)

    def energy(self, mu: lm.Vec, g: lm.Vec) -> float:
        body, sphere = mu[:3], mu[3:6]
        return 0.5 * (lm.dot(body, body / lm.vec(1.0, 1.6, 2.3)) + lm.dot(sphere, sphere) + mu[6] ** 2)


def test_momenta_that_move_nothing_and_add_nothing_change_no_squares() -> None:
    both = BodyAndSphere()
    eye = np.eye(3).ravel()
    found = lm.relative_equilibrium(
        both, both.state(mu=[0.0, 1.2, 0.0, 0.0, 0.7, 0.0, 0.1], g=np.concatenate([eye, eye, [0.0]]))
    )
    assert (found.symmetries, found.squares, found.verdict) == (3 + 6 + 1, (1, 1), "unstable")


@lm.record
class Shaken(lm.Force):
    """A force that is none at t = 0."""

    def covector(self, t: float, xi: lm.Vec, g: lm.Mat) -> lm.Vec:
        return lm.vec(np.sin(t), 0.0, 0.0)


@lm.record
class Swelling(lm.Force):
    """A friction that feeds in energy later on."""

    def covector(self, t: float, xi: lm.Vec, g: lm.Mat) -> lm.Vec:
        return -np.cos(t) * xi


@pytest.mark.parametrize("load", [Shaken(), Swelling()], ids=repr)
def test_loads_that_change_with_time_leave_no_steady_motion(load: lm.Force) -> None:
    body = lm.MechanicalSystem(lm.RigidBody([1.0, 1.5, 2.0]), InTheField(), load=load)
    with pytest.raises(lm.errors.IncompatibleSystem, match="changes with time"):
        lm.relative_equilibrium(body, body.state(mu=np.zeros(3), g=np.eye(3)))


@pytest.mark.slow
def test_where_there_is_none_it_says_so() -> None:
    falling = lm.MechanicalSystem(
        lm.LiePoissonSystem(lm.SE3(), lm.KineticEnergy([1.0, 1.5, 2.0, 3.0, 3.0, 3.0])), lm.models.UniformGravity(9.81)
    )
    with pytest.raises(lm.errors.NoConvergence, match="no relative equilibrium with the momenta of the guess"):
        lm.relative_equilibrium(falling, falling.state(mu=np.ones(6), g=np.eye(4)))
    body = lm.RigidBody([1.0, 1.5, 2.0])
    with pytest.raises(lm.errors.IncompatibleSystem, match="the guess is the state of one body"):
        lm.relative_equilibrium(body, body.state(mu=np.ones((2, 3))))
    kepler = lm.DoubleBracket(body, 0.1) if hasattr(lm, "DoubleBracket") else lm.models.ChainPendulum(2)
    with pytest.raises(lm.errors.IncompatibleSystem, match="wanted is a LiePoissonSystem"):
        lm.relative_equilibrium(kepler, body.state(mu=np.ones(3)))


@lm.record
class Beads(lm.HamiltonianSystem):
    """Two beads in the plane on a chain of two springs of length 1 from the origin."""

    degrees: ClassVar[int] = 4
    k: float

    def energy(self, q: Any, p: Any) -> Any:
        first = lm.formulas.sqrt(q[0] * q[0] + q[1] * q[1]) - 1.0
        second = lm.formulas.sqrt((q[2] - q[0]) * (q[2] - q[0]) + (q[3] - q[1]) * (q[3] - q[1])) - 1.0
        return 0.5 * lm.dot(p, p) + 0.5 * self.k * (first * first + second * second)


def test_a_chain_turns_stretched() -> None:
    """w^2 r_1 = k (a - b), w^2 r_2 = k b with stretches a, b; along the chain and across it the frame that turns couples
    k [[2, -1], [-1, 1]] - w^2 and [[T_1/r_1 + T_2/l, -T_2/l], [-T_2/l, T_2/l]] - w^2 by 2 w.
    """
    k, w = 5.0, 0.8
    a, b = np.linalg.solve([[w * w - k, k], [w * w, w * w - k]], [-w * w, -2.0 * w * w])
    r, l = np.array([1.0 + a, 2.0 + a + b]), 1.0 + b
    found = lm.relative_equilibrium(
        Beads(k), Beads(k).state(q=[r[0], 0.02, r[1], -0.03], p=[0.0, w * r[0], 0.0, w * r[1]])
    )
    assert np.linalg.norm(np.reshape(found.state.q, (2, 2)), axis=1) == pytest.approx(r, rel=1e-3)
    J = found.state.q[0] * found.state.p[1] - found.state.q[1] * found.state.p[0]
    J += found.state.q[2] * found.state.p[3] - found.state.q[3] * found.state.p[2]
    w = J / np.sum(np.reshape(found.state.q, (2, 2)) ** 2)
    a, b = np.linalg.solve([[w * w - k, k], [w * w, w * w - k]], [-w * w, -2.0 * w * w])
    r, l = np.array([1.0 + a, 2.0 + a + b]), 1.0 + b
    along = k * np.array([[2.0, -1.0], [-1.0, 1.0]]) - w * w * np.eye(2)
    across = np.array([[k * a / r[0] + k * b / l, -k * b / l], [-k * b / l, k * b / l]]) - w * w * np.eye(2)
    zero, turn = np.zeros((2, 2)), 2.0 * w * np.eye(2)
    motion = np.block([[np.zeros((4, 4)), np.eye(4)], [-along, zero, zero, turn], [zero, -across, -turn, zero]])
    frequencies = np.sort(np.linalg.eigvals(motion).imag)[-3:]
    assert found.frequencies == pytest.approx(frequencies, rel=1e-9) and found.verdict == "stable"


@lm.record
class OnAShaft(lm.HamiltonianSystem):
    """Two unit masses on rods of unit length, hung from a shaft that turns their plane at the rate w; angles from below."""

    degrees: ClassVar[int] = 2
    w: float

    def energy(self, q: Any, p: Any) -> Any:
        first, both = lm.formulas.sin(q[0]), lm.formulas.sin(q[0]) + lm.formulas.sin(q[1])
        c = lm.formulas.cos(q[0] - q[1])
        kinetic = (0.5 * p[0] * p[0] - c * p[0] * p[1] + p[1] * p[1]) / (2.0 - c * c)
        hung = -2.0 * lm.formulas.cos(q[0]) - lm.formulas.cos(q[1])
        return kinetic + hung - 0.5 * self.w**2 * (first * first + both * both)


def spinning_in_water(part: float) -> tuple[Any, Any, float]:
    """A body of revolution that moves along its axis is a top with A m g l = A P^2 (1/c - 1/a).
    Source: Lamb, Hydrodynamics, 6th ed. (1932), article 126.
    """
    A, C, a, c, P = 1.3, 0.6, 2.5, 1.7, 1.4
    pull = P * P * (1.0 / c - 1.0 / a)
    L = part * 2.0 * math.sqrt(A * pull)
    body = lm.models.KirchhoffBody([A, A, C, a, a, c])
    square = pull / A - (0.5 * L / A) ** 2
    return body, body.state(mu=[0.0, 0.0, L, 0.0, 0.0, P]), math.sqrt(max(square, 0.0))


def satellite(part: float) -> tuple[Any, Any, float]:
    """In pitch a satellite turns over where its moment about the roll axis is below that about yaw."""
    attraction, radius, yaw, pitch = 3.986004418e14, 7.0e6, 10.0, 15.0
    body = lm.models.OrbitingBody(inertia=(yaw, yaw * part, pitch), mass=100.0, attraction=attraction)
    square = 3.0 * attraction / radius**3 * (yaw - yaw * part) / pitch
    return body, body.circular_orbit(radius), math.sqrt(max(square, 0.0))


def triangle(part: float) -> tuple[Any, Any, float]:
    """Masses 1, x, x: 27 (2 x + x^2) = (1 + 2 x)^2 for x = (36 sqrt 2 - 50)/46 (Gascheau 1843)."""
    x = (36.0 * math.sqrt(2.0) - 50.0) / 46.0 / part
    m, M = np.array([1.0, x, x]), 1.0 + 2.0 * x
    q = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, math.sqrt(0.75)]])
    q -= m @ q / M
    p = m[:, None] * math.sqrt(M) * np.stack([-q[:, 1], q[:, 0]], axis=1)
    bodies = lm.models.NBody(m, dimension=2)
    routh = np.sqrt(complex(1.0 - 27.0 * (2.0 * x + x * x) / M**2))
    return bodies, bodies.state(q.ravel(), p.ravel()), math.sqrt(M) * abs(np.sqrt(-0.5 + 0.5 * routh).real)


def chain_on_a_shaft(part: float) -> tuple[Any, Any, float]:
    """It hangs while the shaft turns slower than it swings, w^2 < 2 - sqrt 2, the least zero of Laguerre's L_2."""
    slowest = 2.0 - math.sqrt(2.0)
    chain = OnAShaft(math.sqrt(slowest) / part)
    return chain, chain.state(q=[0.0, 0.0], p=[0.0, 0.0]), math.sqrt(max(chain.w**2 - slowest, 0.0))


@pytest.mark.parametrize("part", [0.9, 1.0 - 1e-6, 1.0 + 1e-6, 1.1])
@pytest.mark.parametrize(
    ("of", "beyond"),
    [
        pytest.param(spinning_in_water, "stable", marks=pytest.mark.slow),
        pytest.param(satellite, "stable", marks=pytest.mark.slow),
        pytest.param(triangle, "spectrally stable", marks=pytest.mark.slow),
        (chain_on_a_shaft, "stable"),
    ],
)
def test_thresholds_to_a_millionth(of: Any, beyond: str, part: float) -> None:
    """Below its threshold a motion is unstable and grows as in closed form."""
    system, state, growth = of(part)
    found = lm.relative_equilibrium(system, state)
    assert found.verdict == ("unstable" if part < 1.0 else beyond)
    assert found.growth == pytest.approx(growth if part < 1.0 else 0.0, rel=1e-6)


@lm.record
class InnermostOrbit(lm.SeparableSystem):
    """A point in the plane, V = -1/r - b/r^3: circular orbits at r^2 - J^2 r + 3 b = 0, two for J^4 > 12 b, none below."""

    degrees: ClassVar[int] = 2
    b: float

    def kinetic(self, p: Any) -> Any:
        return lm.dot(p, p) / 2.0

    def potential(self, q: Any) -> Any:
        r = lm.formulas.sqrt(lm.dot(q, q))
        return -1.0 / r - self.b / (r * r * r)


@pytest.mark.slow
def test_near_a_fold_it_says_where_newton_went() -> None:
    """With 12 b = 1 the orbits merge at J = 1, r = 1/2; the outer one is stable, the inner one not."""
    system = InnermostOrbit(1.0 / 12.0)

    def near(J: float, r: float) -> Any:
        return lm.relative_equilibrium(system, system.state(q=[r, 0.0], p=[0.01, J / r]))

    for J, r, sign in ((1.05, 0.7, 1), (1.05, 0.3, -1), (1.001, 0.55, 1), (1.001, 0.45, -1)):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            found = near(J, r)
        radius = 0.5 * (J**2 + sign * math.sqrt(J**4 - 1.0))
        assert np.linalg.norm(found.state.q) == pytest.approx(radius, rel=1e-9)
        square = 3.0 * J**2 / radius**4 - 2.0 / radius**3 - 1.0 / radius**5
        assert found.verdict == ("stable" if sign > 0 else "unstable")
        assert np.abs(found.eigenvalues**2 + square).max() < 1e-6 * abs(square)
    with pytest.warns(RuntimeWarning, match=r"0 negative squares at the guess and 1 at .* a fold, .* small steps"):
        jumped = near(1.0001, 0.7)
    assert jumped.verdict == "unstable"
    with pytest.raises(lm.errors.NoConvergence, match=r"as beyond a fold, where two .* small steps of its momenta"):
        near(0.999, 0.55)


def test_it_prints_what_it_is() -> None:
    body = lm.RigidBody([1.0, 1.5, 2.0])
    text = str(lm.relative_equilibrium(body, body.state(mu=[0.0, 1.0, 0.0])))
    assert text.startswith("relative equilibrium, unstable: a disturbance grows as exp(0.23")
    assert "symmetries   3" in text


class Coupled(lm.Potential):
    """Two tops in their fields, whose axes feel one another, on a group whose elements split into two rotations."""

    def energy(self, g: Any) -> Any:
        a, b = self.group.split(g)
        return 0.8 * (a[2, 2] + b[2, 2]) + 0.3 * lm.dot(a[2], b[2])


@lm.record
class OnPower(Coupled):
    group: Any = lm.SO3() ** 2


@lm.record
class OnProduct(Coupled):
    group: Any = lm.SO3() * lm.SO3()


@pytest.mark.slow
def test_bodies_of_a_power_are_steady_as_those_of_a_product() -> None:
    """SO(3)^2 as a power, with an axis of bodies, and as a product: one steady motion, which a run from it keeps."""
    g, mu = np.stack([tilted(0.3), tilted(-0.2)]), [0.1, 0.2, 2.5, -0.1, 0.3, 2.3]
    found = {}
    for potential, elements in ((OnPower(), g), (OnProduct(), OnProduct().group.join(*g))):
        tops = lm.LiePoissonSystem(potential.group, lm.KineticEnergy([1.0, 1.0, 0.6, 1.0, 1.0, 0.6]))
        system = lm.MechanicalSystem(tops, potential)
        found[type(potential)] = lm.relative_equilibrium(system, system.state(mu=mu, g=elements))
        if potential.group == OnPower().group:
            steady = found[OnPower]
            run = lm.integrate(system, lm.RKMK(order=6), steady.state, h=0.05, steps=40, compiled=False)
            across, leans = (
                np.hypot(*np.moveaxis(run.mu.reshape(41, 2, 3), -1, 0)[:2]),
                run.g.reshape(41, 2, 3, 3)[..., 2, 2],
            )
            for constant in (across, leans):  # but for the turns of each top about its axis
                np.testing.assert_allclose(constant, np.tile(constant[0], (41, 1)), atol=1e-8)
    np.testing.assert_allclose(found[OnPower].frequencies, found[OnProduct].frequencies, rtol=1e-10)
    assert found[OnPower].verdict == found[OnProduct].verdict == "stable" and len(found[OnPower].frequencies) == 3
