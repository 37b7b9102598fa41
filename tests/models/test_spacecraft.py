"""Spacecraft: every effect against formulas written here and SciPy's DOP853, published rates, exact
frequencies, and what wheels keep.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import liemech as lm
from liemech.formulas import Mat, gradient, vec
from liemech.models.space.effectors import ConservativeEffector, PoseInSpace
from liemech.models.space.space_forces import SUN_RADIUS, sunlight
from liemech.systems.kinetic_energy import KineticEnergy

M = lm.models
K, J2, RADIUS = 3.986004418e14, 1.08262668e-3, 6378136.3
J = np.array([[900.0, 15.0, -8.0], [15.0, 800.0, 12.0], [-8.0, 12.0, 600.0]])
MASS, AU = 750.0, 1.495978707e11
AXES = np.array([[1.0, 0.0, 0.0], [0.0, 0.6, 0.8], [0.0, 0.0, 1.0]])
WHEELS = M.ReactionWheels(
    AXES, [0.16, 0.2, 0.1], torques=[0.05, -0.3, 0.02], torque_limits=[0.2, 0.1, 0.2],
    viscous=[1e-4, 2e-4, 0.0], coulomb=[5e-4, 0.0, 1e-3], creep=1.0,
)  # fmt: skip
SUN, ARM = np.array([0.6, 0.64, 0.48]) * AU, np.array([0.3, -0.1, 0.2])
FIELD = M.DipoleField(7.7e15, [0.0, 0.28, -0.96], 7.292e-5)
ALL = (
    M.PointGravity(K),
    M.GravityGradient(K),
    M.Oblateness(K, J2, RADIUS),
    M.Drag(9.0, 2e-11, RADIUS + 4e5, 6e4, 7.292e-5, ARM),
    M.SolarPressure(12.0, SUN, centre=ARM),
    M.MagneticTorquers(FIELD, [30.0, -200.0, 10.0], limit=60.0),
)
POSITION, VELOCITY = np.array([6.7e6, 3e5, -4e5]), np.array([300.0, 5200.0, 5600.0])
TURN, RATE = Rotation.from_rotvec([0.3, -0.8, 0.5]), np.array([0.01, -0.02, 0.03])
SPEEDS = np.array([30.0, -20.0, 0.5])


def field_of_a_dipole(t: float, x: np.ndarray) -> np.ndarray:
    a = Rotation.from_rotvec([0.0, 0.0, 7.292e-5 * t]).apply([0.0, 0.28, -0.96])
    r = np.linalg.norm(x)
    return 7.7e15 * (3.0 * (a @ x) * x / r**5 - a / r**3)


def by_hand(t: float, y: np.ndarray) -> np.ndarray:
    """Newton's and Euler's equations, with quaternions and the speeds of the wheels."""
    x, v, q, w, W = np.split(y, [3, 6, 10, 13])
    R = Rotation.from_quat(q).as_matrix()
    r = np.linalg.norm(x)
    u = R.T @ x / r
    F = -K * MASS * x / r**3
    F = F - 3.0 * K / r**4 * R @ ((np.trace(J) - 5.0 * u @ J @ u) / 2.0 * u + J @ u)
    N = 3.0 * K / r**3 * np.cross(u, J @ u)
    z = x[2] / r
    F = F - 1.5 * K * MASS * J2 * RADIUS**2 / r**4 * ((1.0 - 5.0 * z * z) * x / r + np.array([0.0, 0.0, 2.0 * z]))
    wind = v - np.cross([0.0, 0.0, 7.292e-5], x)
    density = 2e-11 * np.exp(-(r - RADIUS - 4e5) / 6e4)
    D = -0.5 * density * 9.0 * np.linalg.norm(wind) * wind
    s = SUN - x
    S = -4.56e-6 * 12.0 * AU**2 * s / np.linalg.norm(s) ** 3
    F, N = F + D + S, N + np.cross(ARM, R.T @ (D + S))
    N = N + np.cross([30.0, -60.0, 10.0], R.T @ field_of_a_dipole(t, x))
    inertias, motors = np.array([0.16, 0.2, 0.1]), np.array([0.05, -0.1, 0.02])
    motors = motors - np.array([1e-4, 2e-4, 0.0]) * W - np.array([5e-4, 0, 1e-3]) * np.tanh(W)
    h = inertias * (W + AXES @ w)
    hub = J - AXES.T @ np.diag(inertias) @ AXES
    # hub w' = N - w x (hub w + A^T h) - A^T h'
    turning = np.linalg.solve(hub, N - np.cross(w, hub @ w + AXES.T @ h) - AXES.T @ motors)
    qv, qw = q[:3], q[3]
    dq = 0.5 * np.r_[qw * w + np.cross(qv, w), -qv @ w]
    return np.r_[v, F / MASS, dq, turning, motors / inertias - AXES @ turning]


@pytest.fixture(scope="module")
def craft() -> M.Spacecraft:
    return M.Spacecraft(J, MASS, ALL, WHEELS)


@pytest.mark.slow
def test_every_effect_against_equations_written_here(craft: M.Spacecraft) -> None:
    """A quarter of an hour to ten digits, orbit, attitude and wheels."""
    start = craft.state_of(POSITION, VELOCITY, TURN, RATE, SPEEDS)
    run = lm.integrate(craft, lm.RKMK(order=4), start, h=0.5, steps=1800, every=1800)
    y = np.r_[POSITION, VELOCITY, TURN.as_quat(), RATE, SPEEDS]
    units = np.repeat([7e6, 8e3, 1.0, 0.03, 100.0], [3, 3, 4, 3, 3])
    exact = solve_ivp(by_hand, (0.0, 900.0), y, "DOP853", rtol=1e-12, atol=1e-13 * units).y[:, -1]
    w, v, W = np.split(np.array(craft.velocity(run.mu[-1])), [3, 6])
    x = run.g[-1, 9:12]
    off = run.rotation[-1].inv() * Rotation.from_quat(exact[6:10])
    assert off.magnitude() < 2e-7
    assert np.abs(w - exact[10:13]).max() < 1e-8
    assert np.abs(W - exact[13:]).max() < 1e-7 * 100.0
    assert np.abs(x - exact[:3]).max() < 1e-2 and np.abs(v - exact[3:6]).max() < 1e-5
    rate = np.array(craft.rate(0.0, start))
    slope = by_hand(0.0, y)
    assert np.allclose(rate[:9], np.r_[RATE, VELOCITY, SPEEDS], rtol=1e-13)
    assert np.allclose(rate[12:15] / MASS, slope[3:6], rtol=1e-13)


@pytest.mark.slow
def test_every_effect_to_ten_digits_by_order_eight(craft: M.Spacecraft) -> None:
    start = craft.state_of(POSITION, VELOCITY, TURN, RATE, SPEEDS)
    run = lm.integrate(craft, lm.RKMK(order=8), start, h=2.0, steps=450, every=450)
    y = np.r_[POSITION, VELOCITY, TURN.as_quat(), RATE, SPEEDS]
    units = np.repeat([7e6, 8e3, 1.0, 0.03, 100.0], [3, 3, 4, 3, 3])
    exact = solve_ivp(by_hand, (0.0, 900.0), y, "DOP853", rtol=1e-13, atol=1e-14 * units).y[:, -1]
    assert (run.rotation[-1].inv() * Rotation.from_quat(exact[6:10])).magnitude() < 1e-10
    assert np.abs(run.g[-1, 9:12] - exact[:3]).max() < 1e-4


@pytest.mark.parametrize("name", ["PointGravity", "GravityGradient", "Oblateness"])
def test_forces_and_torques_are_those_of_the_energy(name: str) -> None:
    effector = next(e for e in ALL if type(e).__name__ == name)

    @lm.record
    class ByEnergy(ConservativeEffector):
        of: Any

        def energy(self, here: Any) -> float:
            return self.of.energy(here)

    R = Mat.of(TURN.as_matrix().tolist())
    here = PoseInSpace(vec(*POSITION), R, MASS, Mat.of(J.tolist()))
    slow = ByEnergy(effector)
    force, torque = np.array(effector.force(here)), np.array(effector.torque(here))
    assert np.allclose(force, np.array(slow.force(here)), rtol=1e-13, atol=1e-14 * np.abs(force).max())
    assert np.allclose(torque, np.array(slow.torque(here)), rtol=1e-12, atol=1e-16)


def test_a_field_with_another_energy_says_anew_what_turns_leave_alone() -> None:
    """x x p + R Pi changes by the torque of -V' = (0, -m, 0) in space about the origin."""

    @lm.record
    class Pulled(M.PointGravity):
        def energy(self, here: Any) -> Any:
            return super().energy(here) + here.mass * here.position[1]

    craft = M.Spacecraft([1.0, 1.5, 2.0], 3.0, [Pulled(1.0)])
    start = craft.state_of([1.0, 0.2, 0.1], [0.0, 1.0, 0.1])
    run = lm.integrate(craft, lm.RKMK(order=4), start, h=0.01, steps=10, compiled=False)
    kept = craft.constants({"mu": np.asarray(run.mu), "g": np.asarray(run.g)})
    assert set(kept) == {"energy"} and np.ptp(kept["energy"]) < 1e-8
    central = M.Spacecraft([1.0, 1.5, 2.0], 3.0, [M.PointGravity(1.0)])
    assert "angular momentum" in central.constants({"mu": np.asarray(run.mu), "g": np.asarray(run.g)})


def test_point_gravity_and_gradient_are_an_orbiting_body() -> None:
    both = M.Spacecraft([900.0, 800.0, 600.0], MASS, [M.PointGravity(K), M.GravityGradient(K)])
    one = M.OrbitingBody([900.0, 800.0, 600.0], MASS, K)
    start = both.state_of(POSITION, VELOCITY, TURN, RATE)
    assert both.energy(start.mu, start.g) == pytest.approx(one.energy(start.mu, start.g), rel=1e-14)
    a, b = np.array(both.force(start.g)), np.array(one.force(start.g))
    assert np.allclose(a[:3], b[:3], rtol=1e-9) and np.allclose(a[3:], b[3:], rtol=1e-13)


@pytest.mark.slow
def test_the_node_of_an_orbit_turns_as_published() -> None:
    """dO/dt = -(3/2) n J2 (a/p)^2 cos i to first order in J2 (Vallado, Fundamentals of
    Astrodynamics and Applications, 4th ed., equation 9-37): with the Sun, 0.9856 degrees a day, at
    98.603 degrees and 800 km.
    """
    a, i = 7.178e6, np.radians(98.603)
    craft = M.Spacecraft([900.0, 800.0, 600.0], MASS, [M.PointGravity(K), M.Oblateness(K, J2, RADIUS)])
    v = np.sqrt(K / a) * np.array([0.0, np.cos(i), np.sin(i)])
    n = np.sqrt(K / a**3)
    turns, per = 14, 60
    run = lm.integrate(
        craft, lm.KickDrift(order=4), craft.state_of([a, 0, 0], v),
        h=2 * np.pi / n / per, steps=per * turns,
    )  # fmt: skip
    L = np.cross(run.g[:, 9:12], run.mu[:, 3:6])
    node = np.unwrap(np.arctan2(L[:, 0], -L[:, 1]))
    # the mean over whole turns, after and before
    mean = [node[:per].mean(), node[-per:].mean()]
    found = (mean[1] - mean[0]) / (run.t[-per] - run.t[0])
    v = run.mu[:, 3:6] / MASS
    a = (1.0 / (2.0 / np.linalg.norm(run.g[:, 9:12], axis=1) - (v * v).sum(axis=1) / K))[:-1].mean()
    published = -1.5 * np.sqrt(K / a**3) * J2 * (RADIUS / a) ** 2 * np.cos(i)
    assert found == pytest.approx(published, rel=1e-3)
    assert np.degrees(found) * 86400.0 == pytest.approx(0.9856, rel=1e-2)
    assert run.drift()["angular momentum along e3"].largest < 1e-12


@pytest.mark.slow
def test_librations_have_the_frequencies_of_the_gravity_gradient() -> None:
    """Pitch: 3 n^2 (J1 - J3)/J2; roll and yaw together: the roots of
    s^4 + (1 + 3 k1 + k1 k3) s^2 + 4 k1 k3 (times n), with k1 = (J2 - J3)/J1, k3 = (J2 - J1)/J3.

    Source: Hughes, Spacecraft Attitude Dynamics, section 9.2.
    """
    J1, J2_, J3 = 800.0, 900.0, 400.0  # roll (along), pitch (normal), yaw (radial)
    a = 7e6
    n = np.sqrt(K / a**3)
    craft = M.Spacecraft([J1, J2_, J3], MASS, [M.PointGravity(K), M.GravityGradient(K)])
    # body axes: 1 along the velocity, 2 against the normal of the orbit, 3 to the centre
    orbital = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    tilt = Rotation.from_rotvec([2e-6, -3e-6, 1e-6]).as_matrix()
    rate = (orbital @ tilt).T @ np.array([0.0, 0.0, n])
    start = craft.state_of([a, 0, 0], [0, n * a, 0], orbital @ tilt, rate)
    h = 2 * np.pi / n / 300
    run = lm.integrate(craft, lm.KickDrift(order=4), start, h=h, steps=1800, every=30)
    along = np.arctan2(run.g[:, 10], run.g[:, 9])
    turned = Rotation.from_euler("z", along[:, None]).as_matrix() @ orbital
    small = Rotation.from_matrix(turned.transpose(0, 2, 1) @ run.rotation.as_matrix()).as_rotvec()
    dt = 30 * h
    pitch = n * np.sqrt(3.0 * (J1 - J3) / J2_)
    s = small[:, 1]
    assert np.abs(s - s[0] * np.cos(pitch * run.t)).max() < 2e-5 * np.abs(s).max()
    k1, k3 = (J2_ - J3) / J1, (J2_ - J1) / J3
    squares = np.roots([1.0, 1.0 + 3.0 * k1 + k1 * k3, 4.0 * k1 * k3])
    c1, c2 = np.cos(n * np.sqrt(-squares) * dt)
    for angle in (small[:, 0], small[:, 2]):  # a signal of two frequencies fulfils a recursion
        rest = (
            angle[4:] + angle[:-4] - 2 * (c1 + c2) * (angle[3:-1] + angle[1:-3])
            + (2 + 4 * c1 * c2) * angle[2:-2]
        )  # fmt: skip
        assert np.abs(rest).max() < 1e-3 * np.abs(angle).max()


def test_the_field_of_a_dipole() -> None:
    """Minus the gradient of strength a . x/r^3, twice as strong at the poles as at the equator."""
    field = M.DipoleField(7.7e15)
    x = np.array([3e6, -4e6, 5e6])
    potential = lambda y: 7.7e15 * lm.dot([0.0, 0.0, -1.0], y) / lm.norm(y) ** 3  # noqa: E731
    derived = -np.array(gradient(potential, vec(*x)))
    assert np.allclose(np.array(field.at(0.0, vec(*x))), derived, rtol=1e-13)
    pole, equator = (np.array(field.at(5.0, vec(*y))) for y in ([0, 0, 7e6], [7e6, 0, 0]))
    assert pole[2] == pytest.approx(-2.0 * equator[2], rel=1e-15)
    assert equator[2] == pytest.approx(7.7e15 / 7e6**3, rel=1e-15)  # north, 22.4 microtesla
    turning = M.DipoleField(7.7e15, [0.6, 0.0, -0.8], 2 * np.pi / 86400.0)
    quarter = np.array(turning.at(21600.0, vec(7e6, 0.0, 0.0)))
    assert np.allclose(quarter, 7.7e15 / 7e6**3 * np.array([0.0, -0.6, 0.8]), rtol=1e-12, atol=1e-20)


def test_sunlight_in_the_penumbra() -> None:
    """The part of a disc that another one leaves, counted on a grid; light before, none behind."""
    sun, radius = vec(AU, 0.0, 0.0), 6.4e6
    assert sunlight(vec(7e6, 0.0, 0.0), sun, radius) == 1.0
    assert sunlight(vec(-7e6, 0.0, 0.0), sun, radius) == 0.0
    grid = (np.arange(2000) + 0.5) / 1000.0 - 1.0
    for x in ([-7e6, 6.39e6, 0.0], [-4e7, 6.3e6, 1e6], [-3.5e7, 0.0, 6.45e6], [-2e9, 1e6, 0.0]):
        s = np.array([AU, 0, 0]) - x
        a, b = np.arcsin(SUN_RADIUS / np.linalg.norm(s)), np.arcsin(radius / np.linalg.norm(x))
        c = np.arccos(-np.dot(x, s) / np.linalg.norm(s) / np.linalg.norm(x))
        inside = grid[:, None] ** 2 + grid**2 < 1.0
        hidden = inside & ((a * grid[:, None] - c) ** 2 + (a * grid) ** 2 < b * b)
        assert sunlight(vec(*x), sun, radius) == pytest.approx(1 - hidden.sum() / inside.sum(), abs=2e-3)
        assert 0.0 < sunlight(vec(*x), sun, radius) < 1.0


# ---------------------------------------------------------------- wheels


@pytest.mark.slow
def test_motors_and_friction_leave_the_spin_in_space_alone() -> None:
    """Hub and wheels: R Pi to 1e-14 where nothing acts from outside, and energy without motors."""
    driven = M.Spacecraft(J, MASS, [M.PointGravity(K)], WHEELS)
    run = lm.integrate(
        driven,
        lm.RKMK(order=4),
        driven.state_of(POSITION, VELOCITY, TURN, RATE, SPEEDS),
        h=0.5,
        steps=20_000,
        every=100,
    )
    spin = np.einsum("nij,nj->ni", run.rotation.as_matrix(), run.mu[:, :3])
    assert np.abs(np.array(driven.velocity(run.mu[-1]))[:3] - RATE).max() > 1e-3
    assert np.abs(spin - spin[0]).max() < 3e-14 * np.linalg.norm(spin[0])  # 20,000 steps
    assert "energy" not in run.drift() and run.drift()["angular momentum"].largest < 1e-9
    coasting = M.Spacecraft(J, MASS, (), M.ReactionWheels(AXES, [0.16, 0.2, 0.1]))
    assert coasting.load is None
    start = coasting.state_of([0, 0, 0], [1, 0, 0], TURN, RATE, SPEEDS)
    run = lm.integrate(coasting, lm.RKMK(order=4), start, h=0.5, steps=2000, every=10)
    drift = run.drift()
    assert drift["spin in space"].largest < 3e-14 and drift["energy"].largest < 1e-8
    assert np.array_equal(run.mu[-1, 6:], run.mu[0, 6:])  # nothing turns the wheels


def test_a_wheel_that_rubs_comes_to_rest_beside_its_body() -> None:
    """About one axis: I W' = -c W I/(1 - I/J), so W falls by e in I (1 - I/J)/c."""
    I, c = 2.0, 0.5
    craft = M.Spacecraft([10.0, 10.0, 5.0], 1.0, (), M.ReactionWheels([[0, 0, 1.0]], [I], viscous=[c]))
    start = craft.state_of([0, 0, 0], [0, 0, 0], speeds=[7.0])
    run = lm.integrate(craft, lm.RKMK(order=4), start, h=0.05, steps=100, compiled=False)
    W = np.array(craft.velocity(run.mu))[:, 6]
    assert np.abs(W - 7.0 * np.exp(-run.t * c / (I * (1.0 - I / 5.0)))).max() < 1e-8
    w = np.array(craft.velocity(run.mu))[:, 2]
    assert np.allclose(w, -I / 5.0 * (W - 7.0), atol=1e-12)  # what is left is in the body


def test_saturated_motors() -> None:
    wheels = M.ReactionWheels(
        np.eye(3), [0.1] * 3, torques=[5.0, -0.3, -0.3], torque_limits=[0.2, 0.4, 0.4], speed_limits=[4.0, 4.0, 4.0]
    )
    craft = M.Spacecraft([100.0, 100.0, 100.0], 1.0, (), wheels)
    start = craft.state_of([0, 0, 0], [0, 0, 0], speeds=[0.0, 3.9, -4.5])
    run = lm.integrate(craft, lm.RKMK(order=4), start, h=0.01, steps=300, every=10, compiled=False)
    W = np.array(craft.velocity(run.mu))[:, 6:]
    assert W[1, 0] == pytest.approx(0.2 / 0.1 / (1 - 1e-3) * 0.1, rel=1e-4)  # within its torque
    assert 4.0 <= W[-1, 0] < 4.03 and -4.03 < W[-1, 1] <= -4.0  # to the limit and no further
    assert np.abs(W[:, 2] + 4.5).max() < 0.02  # beyond it: no torque that speeds up


def test_motors_and_friction_of_ones_own_count_without_torques() -> None:
    """W' = -c W/I', I' = I (1 - I/J) of a wheel on a body that turns back; or u, that of a motor."""

    @lm.record
    class Rubbing(M.ReactionWheels):
        def torque(self, here: Any) -> Any:
            return -0.02 * here.speeds

    @lm.record
    class Geared(M.ReactionWheels):
        def motors(self, here: Any) -> Any:
            return vec(*[0.02 for _ in self.inertias])

    felt = 0.1 * (1.0 - 0.1 / 2.0)
    for wheels, speeds in (
        (Rubbing(np.eye(3), [0.1] * 3), 4.0 * np.exp(-0.02 / felt)),
        (Geared(np.eye(3), [0.1] * 3), 4.0 + 0.02 / felt),
    ):
        craft = M.Spacecraft([2.0] * 3, 1.0, (), wheels)
        start = craft.state_of([0.0] * 3, [0.0] * 3, speeds=[4.0] * 3)
        run = lm.integrate(craft, lm.RKMK(order=4), start, h=0.1, steps=10, compiled=False)
        assert craft.velocity(run.mu)[-1, 6:] == pytest.approx([speeds] * 3, rel=1e-8)
        assert "energy" not in run.drift()


@pytest.mark.slow
def test_a_law_of_control_is_a_subclass() -> None:
    """A wheel on each axis by a proportional and differential law: the error falls as of a damped oscillator."""

    @lm.record
    class Pointing(M.ReactionWheels):
        stiffness: float = 0.0
        damping: float = 0.0

        def command(self, here: Any) -> Any:
            R = here.attitude
            error = 0.5 * vec(R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1])
            return self.stiffness * error + self.damping * here.rate

    law = Pointing(np.eye(3), [0.1] * 3, stiffness=4.0, damping=40.0)
    craft = M.Spacecraft([100.1] * 3, 1.0, (), law)
    start = craft.state_of([0, 0, 0], [0, 0, 0], Rotation.from_rotvec([1e-4, 0, 0]))
    run = lm.integrate(craft, lm.RKMK(order=4), start, h=0.1, steps=600)
    angle = run.rotation.as_rotvec()[:, 0]
    w, d = 0.2, 0.2  # stiffness/100 = w^2, damping/100 = 2 d: critically damped
    assert np.abs(angle - 1e-4 * (1.0 + d * run.t) * np.exp(-w * run.t)).max() < 1e-9


@pytest.mark.slow
def test_momenta_in_space_are_sums_of_what_acts_on_them() -> None:
    """RKMK on G x g* adds up K_g f: the vertical spin in a field that is the same all around the
    vertical is kept to rounding, where steps on T*G, of the same order, let it drift.
    """

    @lm.record
    class Weight(ConservativeEffector):
        centre: lm.Vec

        def energy(self, here: Any) -> float:
            return lm.dot(here.attitude[2], self.centre)

    craft = M.Spacecraft([1.0, 1.5, 0.7], 1.0, [Weight([0.8, 0.0, 1.0])])
    other = lm.MechanicalSystem(craft.body, craft.potential)
    start = craft.state_of([0.0] * 3, [0.0] * 3, Rotation.from_rotvec([0.4, -0.3, 0.5]), [0.3, 0.4, 1.5])
    ends: dict[str, Any] = {}
    for system in craft, other:
        for n in (40, 80, 640):
            begin = system.state(start.mu, start.g)
            run = lm.integrate(system, lm.RKMK(order=4), begin, h=4.0 / n, steps=n)
            ends[f"{system.in_space} {n}"] = np.r_[run.mu[-1], run.g[-1]]
            spin = np.einsum("ni,ni->n", run.g[:, 6:9], run.mu[:, :3])
            if n == 40:
                assert np.ptp(spin) < 1e-14 if system.in_space else np.ptp(spin) > 1e-7
    assert np.abs(ends["True 640"] - ends["False 640"]).max() < 1e-7
    for name in "True", "False":
        errors = [np.abs(ends[f"{name} {n}"] - ends["True 640"]).max() for n in (40, 80)]
        assert np.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.5)


# ---------------------------------------------------------------- products of groups


@pytest.mark.slow
def test_free_bodies_and_midpoints_on_products() -> None:
    """Factors that nothing couples move as they do alone; coupled ones keep every sphere."""
    group = lm.ProductGroup(lm.SO3(), lm.UnitQuaternions(), lm.VectorSpace(2))
    moments = np.array([1.0, 1.5, 2.0, 2.0, 3.0, 4.5, 1.0, 2.0])
    both = lm.LiePoissonSystem(group, KineticEnergy(moments))
    mu = np.array([0.3, 0.6, 1.1, 0.5, 0.5, 0.7, 1.0, 2.0])
    start = both.state(mu, (Rotation.identity(), [0, 0, 0, 1.0], [0.0, 0.0]))
    run = lm.integrate(both, lm.ExactFreeBody(), start, h=0.7, steps=50, every=50)
    first, second = (lm.RigidBody(moments[:3]), lm.RigidBody(moments[3:6], group=lm.UnitQuaternions()))
    one = first.exact(first.state(mu[:3], np.eye(3)), 35.0)
    other = second.exact(second.state(mu[3:6], [0, 0, 0, 1.0]), 35.0)
    assert np.abs(run.mu[-1, :6] - np.r_[one.mu, other.mu]).max() < 1e-13
    assert np.abs(run.g[-1, :9] - np.ravel(one.g)).max() < 1e-13
    assert np.abs(np.abs(run.g[-1, 9:13]) - np.abs(other.g)).max() < 1e-13
    assert np.allclose(run.g[-1, 13:], [35.0, 35.0], rtol=1e-13)
    for method in lm.SphericalMidpoint(), lm.ImplicitMidpoint():
        run = lm.integrate(both, method, start, h=0.1, steps=40)
        for body, at, there in ((first, slice(0, 3), np.eye(3)), (second, slice(3, 6), [0, 0, 0, 1.0])):
            alone = lm.integrate(body, method, body.state(mu[at], there), h=0.1, steps=40)
            assert np.abs(run.mu[:, at] - alone.mu).max() < 1e-14
    pair = np.diag(moments) + 0.3 * (np.eye(8, k=4) + np.eye(8, k=-4))
    coupled = lm.LiePoissonSystem(group, KineticEnergy(pair))
    exact = lm.integrate(coupled, lm.RKMK(order=8), coupled.state(start.mu, start.g), h=0.05, steps=40)
    errors = []
    for h in (0.1, 0.05):
        run = lm.integrate(coupled, lm.SphericalMidpoint(), start, h=h, steps=round(2 / h))
        assert run.drift()["Casimir 1"].largest < 1e-14 and run.drift()["Casimir 2"].largest < 1e-14
        assert run.drift()["spatial momentum"].largest < 1e-13
        errors.append(np.abs(run.mu[-1] - exact.mu[-1]).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)
    with pytest.raises(lm.errors.IncompatibleSystem, match="couples the factors"):
        lm.integrate(coupled, lm.ExactFreeBody(), start, h=0.1, steps=1)


@pytest.mark.slow
def test_kicks_and_drifts_with_wheels() -> None:
    """Order 2 with the spherical midpoint rule as drift; the moment of everything is kept."""
    wheels = M.ReactionWheels(AXES, [1.6, 2.0, 1.0])
    craft = M.Spacecraft(J, MASS, [M.PointGravity(K), M.GravityGradient(K)], wheels)
    start = craft.state_of(POSITION, VELOCITY, TURN, RATE, SPEEDS)
    exact = lm.integrate(craft, lm.RKMK(order=8), start, h=0.5, steps=80)
    errors = []
    for h in (1.0, 0.5):
        run = lm.integrate(craft, lm.KickDrift(lm.SphericalMidpoint()), start, h=h, steps=round(40 / h))
        errors.append((run.rotation[-1].inv() * exact.rotation[-1]).magnitude())
        assert run.drift()["angular momentum"].largest < 1e-14
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)


@pytest.mark.slow
def test_a_drift_that_is_symplectic_for_momenta_alone_is_no_symplectic_splitting() -> None:
    """A field feels the attitude, with which the spherical midpoint rule is not symplectic."""
    assert lm.SphericalMidpoint().symplectic and not lm.KickDrift(lm.SphericalMidpoint()).symplectic
    top = lm.models.HeavyTop([1.0, 1.5, 0.7], 1.3, [0.6, 0.0, 0.8])
    start = top.state([0.3, 0.6, 1.1], np.eye(3))
    for free, verdict in (lm.SphericalMidpoint(), "not seen"), (lm.ThreeRotations(), "holds"):
        report = lm.check_method(lm.KickDrift(free), top, start)
        assert report["symplectic"].verdict == verdict


def test_the_rotation_of_a_product() -> None:
    craft = M.Spacecraft(J, MASS)
    start = craft.state(xi=[*RATE, 0, 0, 0], g=(TURN, POSITION))
    assert np.allclose(np.array(start.g), np.r_[TURN.as_matrix().ravel(), POSITION])
    run = lm.integrate(craft, lm.KickDrift(), start, h=0.1, steps=2)
    assert (run.rotation[0].inv() * TURN).magnitude() < 1e-15
    many = craft.state_of(np.tile(POSITION, (4, 1)), VELOCITY, TURN, np.outer(np.arange(4), RATE))
    run = lm.integrate(craft, lm.KickDrift(), many, h=0.1, steps=2)
    assert run.rotation.as_matrix().shape == (3, 4, 3, 3)
    pair = lm.LiePoissonSystem(lm.ProductGroup(lm.SO3(), lm.SO3()), KineticEnergy([1.0] * 6))
    run = lm.integrate(pair, lm.RKMK(order=4), pair.state(np.ones(6), (TURN, TURN)), h=0.1, steps=1)
    with pytest.raises(lm.errors.InvalidInput, match="has 2; take the factors apart"):
        _ = run.rotation
    with pytest.raises(lm.errors.InvalidInput, match="element 2 has shape"):
        craft.state(xi=[*RATE, 0, 0, 0], g=(TURN, [1.0, 2.0]))


def test_what_is_no_spacecraft() -> None:
    I3 = np.eye(3)
    for make, told in (
        (lambda: M.Spacecraft(J, -1.0), "mass must be positive"),
        (lambda: M.Spacecraft(J, 1.0, [3.0]), "effectors are records such as"),
        (lambda: M.Spacecraft(J, 1.0, wheels=[1.0]), "wheels must be ReactionWheels"),
        (lambda: M.ReactionWheels(2.0 * I3, [1.0] * 3), "of length 1"),
        (lambda: M.ReactionWheels(I3, [1.0] * 2), "3 numbers, one for each axis"),
        (lambda: M.ReactionWheels(I3, [0.0] * 3), "nor zero"),
        (lambda: M.ReactionWheels(I3, [1.0] * 3, viscous=[-1.0, 0, 0]), "viscous must not be negative"),
        (lambda: M.Spacecraft([1.0] * 3, 1.0, (), M.ReactionWheels(I3, [1.5] * 3)), "of no body"),
        (lambda: M.SolarPressure(1.0, [0.0, 0.0, 0.0]), "sun is the place of the Sun"),
        (lambda: M.Drag(1.0, 1e-12, 7e6, 0.0), "height must be positive"),
        (lambda: M.DipoleField(1.0, [0, 0, 2.0]), "of length 1"),
        (lambda: M.Spacecraft(J, 1.0).state_of([1, 0, 0], [0, 0, 0], speeds=[1.0]), "has no wheels"),
        (lambda: M.Spacecraft(J, 1.0).state_of([1, 0], [0, 0, 0]), "position has shape"),
    ):  # fmt: skip
        with pytest.raises((lm.errors.InvalidInput, lm.errors.InvalidType), match=told):
            make()
