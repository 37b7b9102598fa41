"""Filters on groups: their derivatives, the laws of invariant filters, and equalities with filters written
by other means.
"""

from __future__ import annotations

import numpy as np
import pytest
import shipped
from scenes import hat
from scipy.linalg import expm
from scipy.spatial.transform import Rotation
from scipy.special import chdtri  # a chi^2 that so few exceed; scipy.stats takes a second to import

import liemech as lm
from liemech.errors import InvalidInput, InvalidType
from liemech.estimation import errors_of_elements as errors
from liemech.formulas import vec
from liemech.formulas.vectors import small

es = lm.estimation
SIDES = "left", "right"
RNG = np.random.default_rng(12)
GRAVITY = np.array([0.0, 0.0, -9.80665])


def spd(n, scale=0.1):
    a = RNG.normal(size=(n, n))
    return scale**2 * (a @ a.T / n + np.eye(n))


def transition(process, side, g, u, h):
    """F of the discrete map, as the filter has it."""
    still = vec(*[0.0] * len(process.deviations(h)))
    g, u = small(np.asarray(g)), small(np.asarray(u))
    there = process.move(g, u, still, h)
    step = lambda x: process.move(x, u, still, h)  # noqa: E731
    return np.array(errors.transition(process.group, side, g, step, there))


IMU = es.Imu([1e-3] * 3, [1e-2] * 3)
READING = np.array([0.3, -0.8, 0.5, 1.0, -2.0, 9.0])


@lm.record
class OrdinaryImu(es.Process):
    """The same motion on SO(3) x R^6, where errors of velocity and position are differences."""

    imu: es.Imu

    @property
    def group(self):
        return lm.ProductGroup(lm.SO3(), lm.VectorSpace(6))

    @property
    def inputs(self):
        return 6

    def move(self, g, u, w, h):
        R, x = self.group.split(g)
        rows = [vec(*R[i], x[i], x[3 + i]) for i in range(3)]
        whole = lm.mat(*rows, vec(0.0, 0.0, 0.0, 1.0, 0.0), vec(0.0, 0.0, 0.0, 0.0, 1.0))
        there = self.imu.move(whole, u, w, h)
        turned = lm.mat(*[vec(*there[i][:3]) for i in range(3)])
        rest = vec(*[there[i, 3] for i in range(3)], *[there[i, 4] for i in range(3)])
        return self.group.join(turned, rest)

    def deviations(self, h):
        return self.imu.deviations(h)


def ordinary(g):
    return np.concatenate([g[:3, :3].reshape(-1), g[:3, 3], g[:3, 4]])


# ---------------------------------------------------------------- group-affine maps


@pytest.mark.parametrize("side", SIDES)
def test_the_error_of_an_imu_moves_linearly_however_large_it_is(side):
    """The log-linear property: log error' = F log error exactly (Barrau and Bonnabel 2017, theorem 2)."""
    group, h = IMU.group, 0.4
    m, e = group.random(RNG), 0.7 * RNG.normal(size=9)
    x = group.compose_exp(m, e) if side == "left" else group.compose(group.exp(e), m)
    still = np.zeros(9)
    after = [IMU.move(g, READING, still, h) for g in (m, x)]
    found = es.Belief(group, after[0], None, side).error(after[1])
    assert np.allclose(found, transition(IMU, side, m, READING, h) @ e, rtol=0, atol=2e-13)


@pytest.mark.parametrize("side", SIDES)
def test_the_derivative_of_an_imu_does_not_depend_on_the_state(side):
    F = [transition(IMU, side, g, READING, 0.4) for g in IMU.group.random(RNG, 5)]
    assert np.abs(np.array(F) - F[0]).max() < 1e-13
    if side == "right":  # nor on the readings
        h, G = 0.4, hat(GRAVITY)
        zero, one = np.zeros((3, 3)), np.eye(3)
        published = np.block([[one, zero, zero], [h * G, one, zero], [h * h / 2 * G, h * one, one]])
        assert np.allclose(F[0], published, rtol=0, atol=1e-13)
    # and that of the ordinary filter does
    other = OrdinaryImu(IMU)
    F = [transition(other, side, ordinary(g), READING, 0.4) for g in IMU.group.random(RNG, 2)]
    assert np.abs(F[0] - F[1]).max() > 0.1


def test_an_imu_moves_as_its_equation():
    """R' = R w, v' = R a + gravity, p' = v with the matrix exponential of a frame that falls."""
    g, h = IMU.group.random(RNG), 0.7
    w, a = READING[:3], READING[3:]
    big = np.zeros((5, 5))
    big[:3, :3], big[:3, 3], big[3, 4] = hat(w), a, 1.0
    D = expm(h * big)
    R, v, p = g[:3, :3], g[:3, 3], g[:3, 4]
    there = IMU.move(g, READING, np.zeros(9), h)
    assert np.allclose(there[:3, :3], R @ D[:3, :3], atol=1e-13)
    assert np.allclose(there[:3, 3], v + h * GRAVITY + R @ D[:3, 3], atol=1e-13)
    assert np.allclose(there[:3, 4], p + h * v + h * h / 2 * GRAVITY + R @ D[:3, 4], atol=1e-13)


def test_the_noise_of_an_imu_is_that_of_integrated_white_noise():
    """Of a body at rest: variances s^2 h of the velocity, s^2 h^3/3 of the position, s^2 h^2/2 between."""
    h, s = 0.3, 1e-2
    still = es.Imu([1e-12] * 3, [s] * 3, gravity=[0.0, 0.0, 0.0])
    ekf = es.ErrorStateFilter(still)
    P = ekf.predict(ekf.belief(np.eye(5), np.zeros((9, 9))), np.zeros(6), h).covariance
    assert np.allclose(P[3:6, 3:6], s**2 * h * np.eye(3), rtol=1e-12)
    assert np.allclose(P[6:, 6:], s**2 * h**3 / 3 * np.eye(3), rtol=1e-12)
    assert np.allclose(P[3:6, 6:], s**2 * h**2 / 2 * np.eye(3), rtol=1e-12)


GROUPS = [*shipped.RIGID, lm.ProductGroup(lm.SE3(), lm.VectorSpace(2))]


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("group", GROUPS, ids=repr)
def test_on_every_group_a_measured_velocity_moves_errors_linearly(group, side):
    """g exp(h u) is affine: on the left F is Ad of exp(-h u), on the right 1, for errors of any size."""
    process, h, u = es.Turning(group, [0.1] * group.dim), 0.3, RNG.normal(size=group.dim)
    m, e = group.random(RNG), 0.3 * RNG.normal(size=group.dim)
    x = errors_moved(group, side, m, e)
    still = np.zeros(group.dim)
    here, there = process.move(m, u, still, h), process.move(x, u, still, h)
    F = transition(process, side, m, u, h)
    published = group.Ad_matrix(group.exp(-h * u)) if side == "left" else np.eye(group.dim)
    assert np.allclose(F, published, rtol=0, atol=1e-12)
    assert np.allclose(es.Belief(group, here, None, side).error(there), F @ e, rtol=0, atol=1e-11)


@pytest.mark.parametrize("kind", [es.ErrorStateFilter, es.UnscentedFilter])
@pytest.mark.parametrize("group", GROUPS, ids=repr)
def test_on_every_group_a_place_is_weighed_as_in_a_vector_space(group, kind):
    """Measured where it is believed to be: P' = (P^-1 + R^-1)^-1 to first order in P, and the estimate stays."""
    P, deviation = spd(group.dim, 1e-4), 1e-4 * np.arange(1.0, group.dim + 1.0)
    f, place = kind(es.Turning(group, [0.1] * group.dim)), es.Place(group, deviation)
    g = group.random(RNG)
    found = f.update(f.belief(g, P), place, g)
    assert np.allclose(found.g, g, rtol=0, atol=1e-7)
    wanted = np.linalg.inv(np.linalg.inv(P) + np.diag(deviation**-2.0))
    assert np.allclose(found.covariance, wanted, rtol=1e-4, atol=1e-13)


# ---------------------------------------------------------------- what cannot be observed


@lm.record
class BodyVelocity(es.Sensor):
    """z = R^T v: wheels, Doppler logs.  Yaw and position cannot be seen by it."""

    group: lm.LieGroup
    deviation: lm.Vec

    def value(self, g):
        if len(g) == 5:
            return vec(*[sum([g[k, i] * g[k, 3] for k in range(3)]) for i in range(3)])
        R, x = self.group.split(g)
        return x[:3] @ R


@pytest.mark.slow
def test_an_invariant_filter_gains_nothing_along_what_cannot_be_observed():
    """Without noise of the process N^T P^-1 N stays what it was, N the rotations about gravity and the
    translations of space; the ordinary filter believes to learn of them (Barrau and Bonnabel 2015).
    """
    h = 0.1
    quiet = es.Imu([1e-12] * 3, [1e-12] * 3)
    start = quiet.group.random(RNG)
    gained = {}
    for name, process, g in (("invariant", quiet, start), ("ordinary", OrdinaryImu(quiet), ordinary(start))):
        rng = np.random.default_rng(3)
        ekf = es.ErrorStateFilter(process, "right")
        sensor = BodyVelocity(process.group, [0.1] * 3)
        belief = ekf.belief(g, [0.2, 0.2, 0.2, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0])
        truth = process.group.compose(process.group.exp(0.2 * rng.normal(size=9)), g)

        def yaw(belief, name=name):
            N = np.zeros(9)
            N[2] = 1.0
            if name == "ordinary":  # a rotation of space turns the velocity and the position of the estimate
                N[3:6] = np.cross([0, 0, 1], belief.g[9:12])
                N[6:] = np.cross([0, 0, 1], belief.g[12:])
            return N @ np.linalg.inv(belief.covariance) @ N

        before = yaw(belief)
        for _ in range(60):
            u = READING + rng.normal(size=6)
            truth = process.move(truth, u, np.zeros(9), h)
            belief = ekf.predict(belief, u, h)
            z = sensor.value(truth) + 0.1 * rng.normal(size=3)
            belief = ekf.update(belief, sensor, z)
        gained[name] = yaw(belief) / before - 1.0
    assert abs(gained["invariant"]) < 1e-6
    assert gained["ordinary"] > 1.0


# ---------------------------------------------------------------- filters written by other means


def by_hand(g, P, u, h, density, known, deviation, z):
    """The multiplicative filter of textbooks, with SciPy's rotations: error x = g exp(e)."""
    turn = Rotation.from_rotvec(h * u).as_matrix()
    w = hat(h * u)
    angle = np.linalg.norm(h * u)
    # the right Jacobian of SO(3), written out
    J = np.eye(3) - (1 - np.cos(angle)) / angle**2 * w + (angle - np.sin(angle)) / angle**3 * w @ w
    P = turn.T @ P @ turn + h * density**2 * J @ J.T
    g = g @ turn
    H = hat(g.T @ known)
    S = H @ P @ H.T + deviation**2 * np.eye(3)
    K = P @ H.T @ np.linalg.inv(S)
    e = K @ (z - g.T @ known)
    A = np.eye(3) - K @ H
    P = A @ P @ A.T + deviation**2 * K @ K.T
    return g @ Rotation.from_rotvec(e).as_matrix(), P


def test_on_rotations_it_is_the_multiplicative_filter():
    group, h, density, deviation = lm.SO3(), 0.1, 0.02, 0.05
    ekf = es.ErrorStateFilter(es.Turning(group, [density] * 3))
    known = np.array([[1.0, 0.0, 0.0], [0.0, 0.6, 0.8]])
    sensors = [es.Direction(group, k, [deviation] * 3) for k in known]
    g, P = group.random(RNG), spd(3, 0.3)
    belief = ekf.belief(g, P)
    for k in range(40):
        u, z = RNG.normal(size=3), RNG.normal(size=3)
        z /= np.linalg.norm(z)
        g, P = by_hand(g, P, u, h, density, known[k % 2], deviation, z)
        belief = ekf.update(ekf.predict(belief, u, h), sensors[k % 2], z)
        assert np.allclose(belief.g, g, rtol=0, atol=1e-11)
        assert np.allclose(belief.covariance, P, rtol=1e-9, atol=1e-15)


@lm.record
class Linear(es.Process):
    """x' = A x + B u + w on R^3."""

    A: lm.Mat
    B: lm.Mat
    size: lm.Vec

    @property
    def group(self):
        return lm.VectorSpace(3)

    @property
    def inputs(self):
        return 2

    def move(self, g, u, w, h):
        return self.A @ g + self.B @ u + w

    def deviations(self, h):
        return self.size


@lm.record
class LinearSensor(es.Sensor):
    H: lm.Mat
    deviation: lm.Vec

    @property
    def group(self):
        return lm.VectorSpace(3)

    def value(self, g):
        return self.H @ g


@pytest.mark.parametrize("make", [
    lambda p: es.ErrorStateFilter(p), lambda p: es.ErrorStateFilter(p, "right", reset=True),
    lambda p: es.UnscentedFilter(p), lambda p: es.UnscentedFilter(p, "right", spread=0.3),
    lambda p: es.UnscentedFilter(p, spread=1.7),
])  # fmt: skip
def test_what_is_linear_is_kalmans_filter(make):
    A, B, H = RNG.normal(size=(3, 3)), RNG.normal(size=(3, 2)), RNG.normal(size=(2, 3))
    size, deviation = np.array([0.1, 0.2, 0.3]), np.array([0.2, 0.1])
    ekf, sensor = make(Linear(A, B, size)), LinearSensor(H, deviation)
    x, P = RNG.normal(size=3), spd(3, 1.0)
    belief = ekf.belief(x, P)
    for _ in range(6):
        u, z = RNG.normal(size=2), RNG.normal(size=2)
        x, P = A @ x + B @ u, A @ P @ A.T + np.diag(size**2)
        S = H @ P @ H.T + np.diag(deviation**2)
        K, r = P @ H.T @ np.linalg.inv(S), z - H @ x
        belief = ekf.predict(belief, u, 1.0)
        innovation, found = ekf.innovation(belief, sensor, z)
        assert np.allclose(innovation, r, atol=1e-10) and np.allclose(found, S, rtol=1e-10)
        belief = ekf.update(belief, sensor, z)
        x, P = x + K @ r, P - K @ S @ K.T
        assert np.allclose(belief.g, x, rtol=1e-9, atol=1e-10)
        assert np.allclose(belief.covariance, P, rtol=1e-8, atol=1e-11)
        assert np.isclose(belief.nis, r @ np.linalg.solve(S, r), rtol=1e-9)


@pytest.mark.slow
def test_a_bent_cloud_is_normal_in_the_algebra():
    """Headings spread by 0.4 rad and a step forward make a bent cloud in the plane, whose errors in the algebra are
    normally distributed as the filter says (Long et al., The banana distribution is Gaussian, 2012).
    """
    group, spread = lm.SE2(), 0.4
    ukf = es.UnscentedFilter(es.Turning(group, [1e-9] * 3))
    belief = ukf.predict(ukf.belief(np.eye(3), [spread, 1e-9, 1e-9]), [0.0, 1.0, 0.0], 1.0)
    assert np.allclose(belief.g[:2, 2], [1.0, 0.0], atol=1e-12)
    turns = group.exp(spread * RNG.normal(size=(4000, 1)) * np.array([1.0, 0.0, 0.0]))
    e = belief.error(group.compose(turns, group.exp([0.0, 1.0, 0.0])))
    assert np.allclose(np.cov(e.T), belief.covariance, rtol=0.1, atol=2e-3)
    assert np.allclose(belief.covariance[0, 2], spread**2, rtol=1e-6)


# ---------------------------------------------------------------- sides, resets, gates


@pytest.mark.slow
def test_a_belief_stays_when_the_arrays_it_was_made_of_are_written_on():
    g, covariance = np.eye(3), np.diag([1.0, 2.0, 3.0])
    belief = lm.estimation.ErrorStateFilter(lm.estimation.Turning(lm.SO3(), [0.1] * 3)).belief(g, covariance)
    g[:], covariance[:] = 0.0, 7.0
    assert np.array_equal(belief.g, np.eye(3)) and np.array_equal(belief.covariance, np.diag([1.0, 2.0, 3.0]))


def test_sides_are_told_from_each_other_by_ad():
    group = lm.SE3()
    process = es.Turning(group, 0.1 * np.arange(1.0, 7.0))
    sensor = es.Landmark(group, [3.0, -1.0, 2.0], [0.1, 0.2, 0.3])
    g, P, u, z = group.random(RNG), spd(6, 0.2), RNG.normal(size=6), RNG.normal(size=3)
    left = es.ErrorStateFilter(process)
    right = es.ErrorStateFilter(process, "right")
    b = left.belief(g, P)
    c = b.seen_from("right")
    A = np.array([group.Ad(g, unit) for unit in np.eye(6)]).T
    assert np.allclose(c.covariance, A @ P @ A.T, rtol=1e-12)
    assert np.allclose(c.seen_from("left").covariance, P, rtol=1e-10)
    x = group.compose_exp(g, 0.3 * RNG.normal(size=6))
    assert np.allclose(c.error(x), A @ b.error(x), atol=1e-13)
    assert np.isclose(c.nees(x), b.nees(x), rtol=1e-9)
    # a step of either is the other's
    b, c = left.predict(b, u, 0.2), right.predict(c, u, 0.2)
    assert np.allclose(c.seen_from("left").covariance, b.covariance, rtol=1e-9)
    # an update moves to the same element; its covariance is carried by Ad of the estimate before
    b2, c2 = left.update(b, sensor, z), right.update(c, sensor, z)
    assert np.allclose(b2.g, c2.g, atol=1e-12) and np.isclose(b2.nis, c2.nis, rtol=1e-10)
    A = group.Ad_matrix(b.g)
    assert np.allclose(c2.covariance, A @ b2.covariance @ A.T, rtol=1e-8)
    with pytest.raises(InvalidInput, match="seen_from"):
        left.predict(c, u, 0.2)


@pytest.mark.parametrize("side", SIDES)
def test_a_reset_carries_the_covariance_by_dexp(side):
    group = lm.SE3()
    process, place = es.Turning(group, [0.1] * 6), es.Place(group, [0.3] * 6, side)
    g, P = group.random(RNG), spd(6, 0.5)
    z = group.compose(group.exp(0.5 * RNG.normal(size=6)), g)
    kept, carried = (es.ErrorStateFilter(process, side, reset) for reset in (False, True))
    a, b = (f.update(f.belief(g, P), place, z) for f in (kept, carried))
    assert np.array_equal(a.g, b.g)
    # errors from the old estimate and from the new one, by differences
    before = es.Belief(group, g, P, side)
    J, d = np.zeros((6, 6)), 1e-5
    e = before.error(a.g)
    for i, unit in enumerate(np.eye(6)):
        ends = [a.error(errors_moved(group, side, g, e + s * d * unit)) for s in (1.0, -1.0)]
        J[:, i] = (ends[0] - ends[1]) / (2 * d)
    assert np.allclose(b.covariance, J @ a.covariance @ J.T, rtol=1e-5, atol=1e-9)
    assert not np.allclose(b.covariance, a.covariance, rtol=1e-3)


def errors_moved(group, side, g, e):
    return group.compose_exp(g, e) if side == "left" else group.compose(group.exp(e), g)


def test_a_gate_leaves_out_what_is_beyond_its_quantile():
    group = lm.SO3()
    ekf = es.ErrorStateFilter(es.Turning(group, [0.01] * 3))
    star = es.Place(group, [0.01] * 3)
    belief = ekf.belief(np.eye(3), [0.01] * 3)
    # S = 2e-4, so |r|^2 = nis * 2e-4
    edge = np.sqrt(chdtri(3, 0.01) * 2e-4)
    for factor, wanted in ((0.999, True), (1.001, False)):
        z = group.exp([0.0, factor * edge, 0.0])
        found = ekf.update(belief, star, z, gate=0.99)
        assert found.accepted == wanted
        assert np.isclose(found.nis, factor**2 * chdtri(3, 0.01), rtol=1e-9)
        assert np.array_equal(found.g, belief.g) == np.array_equal(found.covariance, belief.covariance) == (not wanted)
    both = ekf.belief(np.array([np.eye(3)] * 2), [0.01] * 3)
    z = group.exp(np.array([[0.0, 0.1 * edge, 0.0], [0.0, 9.0 * edge, 0.0]]))
    assert ekf.update(both, star, z, gate=0.99).accepted.tolist() == [True, False]
    for bad in (0.0, 1.0, -1, "high", [0.5]):
        with pytest.raises((InvalidInput, InvalidType), match="gate"):
            ekf.update(belief, star, np.eye(3), gate=bad)


# ---------------------------------------------------------------- derivatives, worlds


@lm.record
class Seeking(es.Discrete):
    """A velocity that depends on the place, a step by a method of the library."""

    def velocity(self, g, u, w):
        return u + w + vec(-g[2, 1], g[2, 0], 0.0)

    def deviations(self, h):
        return vec(0.1, 0.2, 0.3)


@pytest.mark.slow
@pytest.mark.parametrize("side", SIDES)
def test_the_covariance_moves_by_the_differential_of_the_step_itself(side):
    group, h = lm.SO3(), 0.4
    process = Seeking(group, lm.RKMK(order=3))
    ekf = es.ErrorStateFilter(process, side)
    g, u, P = group.random(RNG), RNG.normal(size=3), spd(3)
    there = process.move(g, u, np.zeros(3), h)
    F, L, d = np.zeros((3, 3)), np.zeros((3, 3)), 1e-5
    here, size = es.Belief(group, there, None, side), np.array([0.1, 0.2, 0.3])
    for i, unit in enumerate(np.eye(3)):
        ends = [process.move(errors_moved(group, side, g, s * d * unit), u, np.zeros(3), h) for s in (1, -1)]
        F[:, i] = (here.error(ends[0]) - here.error(ends[1])) / (2 * d)
        ends = [process.move(g, u, s * d * unit, h) for s in (1, -1)]
        L[:, i] = (here.error(ends[0]) - here.error(ends[1])) / (2 * d) * size[i]
    found = ekf.predict(ekf.belief(g, P), u, h)
    assert np.array_equal(found.g, there)
    assert np.allclose(found.covariance, F @ P @ F.T + L @ L.T, rtol=1e-7, atol=1e-10)
    # a coarser method has another differential
    other = es.ErrorStateFilter(Seeking(group, lm.RKMK(order=1)), side)
    assert not np.allclose(other.predict(other.belief(g, P), u, h).covariance, found.covariance, rtol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("kind", [es.ErrorStateFilter, es.UnscentedFilter])
def test_members_of_an_ensemble_are_as_alone(kind):
    process = es.BiasedGyroscope([0.01] * 3, [1e-4] * 3)
    group = process.group
    f = kind(process, "right")
    sensor = es.OfPart(group, 0, es.Direction(lm.SO3(), [0.0, 0.6, 0.8], [0.02] * 3))
    g, P = group.random(RNG, 5), np.array([spd(6) for _ in range(5)])
    u, z = RNG.normal(size=(5, 3)), RNG.normal(size=(5, 3))
    many = f.update(f.predict(f.belief(g, P), u, 0.1), sensor, z)
    for i in range(5):
        one = f.update(f.predict(f.belief(g[i], P[i]), u[i], 0.1), sensor, z[i])
        assert np.array_equal(one.g, many.g[i]) and one.nis == many.nis[i]
        assert np.array_equal(one.covariance, many.covariance[i])


@pytest.mark.slow
def test_a_bias_is_found():
    process = es.BiasedGyroscope([1e-3] * 3, [1e-5] * 3)
    group, ekf = process.group, es.ErrorStateFilter(process)
    star = es.OfPart(group, 0, es.Place(lm.SO3(), [1e-3] * 3))
    bias, rng, h = np.array([0.02, -0.01, 0.03]), np.random.default_rng(8), 0.1
    truth = np.eye(3)
    belief = ekf.belief(group.join(np.eye(3), np.zeros(3)), [0.1] * 3 + [0.05] * 3)
    for k in range(600):
        w = np.array([0.3 * np.cos(0.1 * k), 0.2, 0.1])
        truth = lm.SO3().compose_exp(truth, h * w)
        belief = ekf.predict(belief, w + bias + 1e-3 / np.sqrt(h) * rng.normal(size=3), h)
        if k % 5 == 0:
            belief = ekf.update(belief, star, lm.SO3().compose_exp(truth, 1e-3 * rng.normal(size=3)))
    assert np.all(np.abs(group.split(belief.g)[1] - bias) < 4.0 * belief.deviations[3:])
    assert belief.deviations[3:].max() < 2e-3
    assert belief.nees(group.join(truth, bias)) < chdtri(6, 0.001)


def consistent(kind, side, runs, turns):
    """Rotations of so many turns with a gyroscope and a star tracker: squared errors at each fix."""
    rng, group, h = np.random.default_rng(3), lm.SO3(), 0.1
    ekf, star = kind(es.Turning(group, [1e-3] * 3), side), es.Place(group, [0.01] * 3)
    truth, e = np.tile(np.eye(3), (runs, 1, 1)), 0.1 * rng.normal(size=(runs, 3))
    belief = ekf.belief(errors_moved(group, side, truth, -e), [0.1] * 3)
    nees, nis = [], []
    for k in range(int(2 * np.pi * turns / h)):
        w = np.array([0.6 * np.cos(0.03 * k), 0.6 * np.sin(0.03 * k), 0.8])  # |w| = 1
        truth = group.compose_exp(truth, h * np.broadcast_to(w, (runs, 3)))
        belief = ekf.predict(belief, w + 1e-3 / np.sqrt(h) * rng.normal(size=(runs, 3)), h)
        if k % 10 == 9:
            belief = ekf.update(belief, star, group.compose_exp(truth, 0.01 * rng.normal(size=(runs, 3))))
            nees.append(belief.nees(truth))
            nis.append(belief.nis)
    return es.consistency(nees, 3), es.consistency(nis, 3)


@pytest.mark.slow
def test_it_is_as_uncertain_as_it_says():
    errors, innovations = consistent(es.ErrorStateFilter, "left", 60, 6)
    for found in (errors, innovations):
        assert found.inside > 0.8 and abs(found.mean / 3.0 - 1.0) < 0.08, str(found)


@pytest.mark.slow
@pytest.mark.parametrize("kind", [es.ErrorStateFilter, es.UnscentedFilter])
@pytest.mark.parametrize("side", SIDES)
def test_it_is_as_uncertain_as_it_says_in_1000_runs_of_100_turns(kind, side):
    errors, innovations = consistent(kind, side, 1000, 100)
    for found in (errors, innovations):
        assert found.inside > 0.92 and abs(found.mean / 3.0 - 1.0) < 0.01, str(found)


WIDE = [(lm.SO3(), 3, 0), (lm.SE2(), 1, 2), (lm.SE3(), 3, 3)]
"""Groups, and how many components of an error are angles and how many are shifts."""


@pytest.mark.slow
@pytest.mark.parametrize("kind", [es.ErrorStateFilter, es.UnscentedFilter])
@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("group, angles, shifts", WIDE, ids=["SO3", "SE2", "SE3"])
def test_a_wide_belief_stays_as_wide_at_rest(group, angles, shifts, side, kind):
    """F = 1, and next to no noise: nothing was measured."""
    filter = kind(es.Turning(group, [1e-9] * group.dim), side)
    for width in (0.3, 0.8, 1.0, 1.5, 2.0, np.pi, 10.0, 1000.0):
        deviations = [width] * angles + [0.1] * shifts
        belief = filter.belief(group.random(RNG), deviations)
        found = filter.predict(belief, np.zeros(group.dim), 1e-3)
        np.testing.assert_allclose(found.covariance, np.diag(np.square(deviations)), rtol=1e-7, atol=1e-9 * width**2)
        np.testing.assert_allclose(found.g, belief.g, rtol=0.0, atol=1e-10 * width)


@pytest.mark.parametrize("kind", [es.ErrorStateFilter, es.UnscentedFilter])
@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("group, angles, shifts", WIDE, ids=["SO3", "SE2", "SE3"])
def test_noise_widens_a_belief_by_more_than_a_turn(group, angles, shifts, side, kind):
    """At rest variances add: an error of the algebra is the noise itself."""
    for before, density in ((1e-3, 2.0), (1e-3, 8.0), (1.0, 8.0), (0.3, 100.0)):
        n = group.dim
        filter = kind(es.Turning(group, [density] * n), side)
        found = filter.predict(filter.belief(np.eye(group.element_shape[0]), [before] * n), np.zeros(n), 4.0)
        wanted = before**2 + 4.0 * density**2
        np.testing.assert_allclose(found.covariance, wanted * np.eye(n), rtol=1e-7, atol=1e-7 * wanted)


@pytest.mark.slow
@pytest.mark.parametrize("kind", [es.ErrorStateFilter, es.UnscentedFilter])
@pytest.mark.parametrize("h", [1.0, 10.0, 60.0, 600.0])
def test_an_unknown_bias_turns_an_attitude_by_more_than_a_turn(kind, h):
    """Its deviation is that of the bias times the time, however long no star is seen."""
    process = es.BiasedGyroscope([1e-9] * 3, [1e-9] * 3)
    filter = kind(process)
    belief = filter.belief(process.group.identity(), [1e-9] * 3 + [0.1] * 3)
    found = filter.predict(belief, np.zeros(3), h)
    np.testing.assert_allclose(found.deviations, [0.1 * h] * 3 + [0.1] * 3, rtol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("width", [0.3, 1.0, np.pi])
@pytest.mark.parametrize("group, angles, shifts", WIDE, ids=["SO3", "SE2", "SE3"])
def test_truths_drawn_from_a_wide_belief_are_found(group, angles, shifts, width, side):
    """A tracker, of which the squared error is chi-square after five updates."""
    runs, n, rng = 1000, group.dim, np.random.default_rng(5)
    deviations = np.array([width] * angles + [0.1] * shifts)
    filter, tracker = es.UnscentedFilter(es.Turning(group, [1e-9] * n), side), es.Place(group, [0.01] * n, side)
    truth, one = group.exp(deviations * rng.normal(size=(runs, n))), np.eye(group.element_shape[0])
    belief = filter.belief(np.tile(one, (runs, 1, 1)), np.tile(np.diag(deviations**2), (runs, 1, 1)))
    for _ in range(5):
        belief = filter.predict(belief, np.zeros((runs, n)), 0.1)
        belief = filter.update(belief, tracker, errors_moved(group, side, truth, 0.01 * rng.normal(size=(runs, n))))
    # the mean of so many chi-squares, and their deviation
    assert abs(belief.nees(truth).mean() - n) < 4.0 * np.sqrt(2.0 * n / runs)
    assert np.mean(belief.nees(truth) < chdtri(n, 0.05)) > 0.95 - 4.0 * np.sqrt(0.05 * 0.95 / runs)


@pytest.mark.parametrize(("nees", "dim", "said"), [
    ([[1.0, np.nan]], 3, "nees holds squares"), ([[1.0, -2.0]], 3, "nees holds squares"), ([[1.0, 2.0]], 0, "dim is"),
    ([[1.0, 2.0]], -3, "dim is"), ([[1.0, 2.0]], "3", "dim is"), ([[1.0, 2.0]], np.nan, "dim is"),
])  # fmt: skip
def test_what_has_no_chi_square_is_refused(nees, dim, said):
    with pytest.raises(InvalidInput, match=said):
        es.consistency(nees, dim)


def test_bounds_are_those_of_chi_square():
    found = es.consistency(np.full((4, 50), 6.0), 6, 0.9)
    assert np.allclose(found.bounds, chdtri(300, [0.95, 0.05]) / 50, rtol=1e-12)
    assert found.mean == 6.0 and found.inside == 1.0


SO3 = lm.SO3()


@lm.record
class Tumbling(es.Discrete):
    """A velocity that depends on the attitude."""

    def velocity(self, g, u, w):
        return u + w + 0.3 * lm.vec(g[2, 0], g[2, 1], g[2, 2])

    def deviations(self, h):
        return lm.vec(0.1, 0.1, 0.1) / h**0.5


@lm.record
class Equation(lm.GroupEquation):
    def velocity(self, t, g):
        return lm.vec(0.3, -0.2, 0.5) + 0.3 * lm.vec(g[2, 0], g[2, 1], g[2, 2])


@pytest.mark.parametrize("method", [lm.RKMK(order=4), lm.RKMK(tableau=lm.tableaus.gauss(2))], ids=repr)
def test_a_discrete_process_is_a_step_of_its_method(method):
    equation = Equation(SO3)
    g, u = SO3.exp([0.2, 0.3, 0.1]), [0.3, -0.2, 0.5]
    run = lm.integrate(equation, method, equation.state(g), h=0.1, steps=1, compiled=False)
    assert np.allclose(Tumbling(SO3, method).led(g, u, 0.1), run.g[-1], rtol=0, atol=1e-15)


def test_a_discrete_process_has_a_method_that_moves_it():
    """One for velocities that depend on time alone would step at order 1."""
    with pytest.raises(lm.errors.IncompatibleSystem, match="needs a linear equation"):
        Tumbling(SO3, lm.Magnus(order=4))


# ---------------------------------------------------------------- what is refused

EKF = es.ErrorStateFilter(es.Turning(SO3, [0.1] * 3))
GOOD = EKF.belief(np.eye(3), [0.1] * 3)


@pytest.mark.parametrize(("wrong", "said"), [
    (lambda: es.ErrorStateFilter(es.Turning(SO3, [0.1] * 3), "body"), "side"),
    (lambda: EKF.belief(np.diag([1.0, 1.0, -1.0]), [0.1] * 3), "reflection"),
    (lambda: EKF.belief(np.eye(3), np.diag([1.0, 1.0, -1.0])), "negative eigenvalue"),
    (lambda: EKF.belief(np.eye(3), np.triu(np.ones((3, 3)))), "symmetric"),
    (lambda: EKF.belief(np.eye(3), np.eye(4)), "covariance has shape"),
    (lambda: EKF.belief(np.eye(3), np.full((3, 3), np.nan)), "must be finite"),
    (lambda: EKF.predict(GOOD, [1.0, 2.0], 0.1), "u has shape"),
    (lambda: EKF.predict(GOOD, [1.0, 2.0, np.nan], 0.1), "u"),
    (lambda: EKF.predict(np.eye(3), [1.0, 2.0, 3.0], 0.1), "must be a Belief"),
    (lambda: EKF.update(GOOD, es.Place(lm.SE3(), [0.1] * 6), np.eye(4)), "the filter estimates"),
    (lambda: EKF.update(GOOD, es.Place(SO3, [0.1] * 3), 2.0 * np.eye(3)), "z is not in"),
    (lambda: EKF.innovation(GOOD, es.Place(SO3, [0.1] * 3), 2.0 * np.eye(3)), "z is not in"),
    (lambda: EKF.update(GOOD, "star", np.eye(3)), "must be a Sensor"),
    (lambda: EKF.update(GOOD, es.Direction(SO3, [0, 0, 1.0], [0.1] * 3), [1.0]), "z has shape"),
    (lambda: es.Position(SO3, [0.1] * 3), "OfPart"),
    (lambda: es.UnscentedFilter(es.Turning(SO3, [0.1] * 3), spread=0.0), "spread"),
    (lambda: EKF.predict(GOOD, [1.0, 2.0, 3.0], -0.1), "h must be positive"),
    (lambda: EKF.predict(GOOD, [1.0, 2.0, 3.0], 0), "h must be positive"),
    (lambda: EKF.belief(np.array([np.eye(3), 1.1 * np.eye(3)]), [0.1] * 3), r"g\[1\] is not in"),
    (lambda: es.ErrorStateFilter(es.Turning(lm.SE3(), [0.1] * 6)).predict(GOOD, np.zeros(6), 0.1), "the belief is of"),
    (lambda: es.ErrorStateFilter(SO3), "must be a Process"),
    (lambda: es.Place(SO3, [0.1] * 2), "deviation must be 3 finite numbers, positive"),
    (lambda: es.Place(SO3, [0.1, 0.1, 0.0]), "deviation must be 3 finite numbers, positive"),
    (lambda: es.Place(SO3, [0.1] * 3, "up"), "side"),
    (lambda: es.Turning(SO3, [0.1, -0.1, 0.1]), "density must be 3 finite numbers, not negative"),
    (lambda: es.Direction(SO3, [1.0, 0.0], [0.1] * 3), "known must be 3 finite numbers"),
    (lambda: es.Imu([1e-3] * 3, [1e-2] * 2), "accelerometer must be 3"),
    (lambda: es.BiasedImu([1e-3] * 3, [1e-2] * 3, [1e-4] * 3), "wander must be 6"),
])  # fmt: skip
def test_refusals(wrong, said):
    with pytest.raises((InvalidInput, InvalidType), match=said):
        wrong()


PLAIN = [lm.SE2(), lm.SL(3), lm.SO(4), lm.SU(2), lm.SU(4), lm.Sp(4), lm.Heisenberg(2), lm.UnitQuaternions(),
         lm.VectorSpace(3), lm.ProductGroup(SO3, lm.VectorSpace(2)), SO3 ** 2]  # fmt: skip


@pytest.mark.parametrize("group", PLAIN, ids=repr)
def test_sensors_are_of_elements_that_turn_and_move(group):
    """Other matrices were read as rotations and positions: the column of SE(2) that is its position as a direction."""
    for sensor in (
        lambda: es.Direction(group, [0.0, 0.6, 0.8], [0.1] * 3),
        lambda: es.Position(group, [0.1] * 3),
        lambda: es.Landmark(group, [1.0, 2.0, 3.0], [0.1] * 3),
    ):
        with pytest.raises(InvalidInput, match=r"SE\(3\), SE_2\(3\) or SGal\(3\); got"):
            sensor()
    d = np.array([0.0, 0.6, 0.8])
    for turning in (SO3, lm.SO(3), lm.SE3(), lm.SE23(), lm.SGal3()):
        g = turning.exp(np.linspace(0.1, 0.5, turning.dim))
        assert np.allclose(es.Direction(turning, d, [0.1] * 3).value(g), g[:3, :3].T @ d, rtol=0, atol=1e-15)


def test_log_has_a_derivative_at_the_identity():
    from liemech.formulas import derivative
    from liemech.formulas.derivatives import axes

    for group in (SO3, lm.SE3(), lm.SE23(), lm.SGal3(), lm.UnitQuaternions()):
        zero = vec(*[0.0] * group.dim)
        slopes = [derivative(lambda e, G=group: G.log(G.exp(e)), zero, d) for d in axes(zero)]
        assert np.array_equal(np.array(slopes), np.eye(group.dim))


def test_the_error_of_a_singular_covariance_has_no_square() -> None:
    """P = v v^T, whose inverse is rounding: e . P^-1 e was any number."""
    group, v = lm.SE3(), np.array([0.3, -0.2, 0.5, 0.1, 0.7, -0.4])
    for P in (np.outer(v, v), np.diag([1.0, 1.0, 1.0, 1.0, 1.0, 0.0]), 1e-30 * np.outer(v, v)):
        with pytest.raises(InvalidInput, match="covariance is singular"):
            es.Belief(group, np.eye(4), P).nees(group.exp(0.1 * v[::-1]))
    deviations, e = np.array([1e-12, 1.0, 1e9, 1e-3, 2.0, 1e4]), 1e-12 * v
    nees = es.Belief(group, np.eye(4), np.diag(deviations**2)).nees(group.exp(e))
    assert np.isclose(nees, np.sum((e / deviations) ** 2), rtol=1e-9)


@pytest.mark.parametrize("kind", [es.ErrorStateFilter, es.UnscentedFilter])
@pytest.mark.parametrize(("covariance", "said"), [
    (np.eye(3) + np.array([[0.0, 0.5, 0.0], [0.0] * 3, [0.0] * 3]), "symmetric"),
    (np.diag([1.0, 1.0, -0.5]), "negative eigenvalue"),
])  # fmt: skip
def test_a_belief_made_by_hand_is_looked_at(kind, covariance, said):
    group = lm.SO3()
    f, sensor = kind(es.Turning(group, [0.1] * 3)), es.Direction(group, [0.0, 0.0, 1.0], [0.1] * 3)
    belief, z = es.Belief(group, np.eye(3), covariance), np.array([0.0, 0.1, 1.0])
    for use in (
        lambda: f.predict(belief, [0.1, 0.2, 0.3], 0.1),
        lambda: f.update(belief, sensor, z),
        lambda: f.innovation(belief, sensor, z),
    ):
        with pytest.raises(InvalidInput, match=f"{kind.__name__}.*belief: covariance.*{said}"):
            use()
    deviations = es.Belief(group, np.eye(3), np.array([0.1, 0.2, 0.3]))
    known = f.belief(np.eye(3), [0.1, 0.2, 0.3])
    assert np.array_equal(f.update(deviations, sensor, z).covariance, f.update(known, sensor, z).covariance)


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("kind", [es.ErrorStateFilter, es.UnscentedFilter])
def test_a_group_of_complex_matrices_is_filtered_as_the_real_one_that_it_covers(kind, side):
    """SU(2) refused its own elements.  Its rates are half of those of SO(3), in other axes: xi -> M xi keeps brackets."""
    M = -2.0 * np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    rates = np.random.default_rng(3).normal(size=(4, 3)) @ M.T / 2.0
    of_groups = []
    for group, J in ((lm.SU(2), np.linalg.inv(M)), (lm.SO3(), np.eye(3))):
        unit = np.abs(J[2, 2])
        process, star = es.Turning(group, [0.01 * unit] * 3), es.Place(group, [0.03 * unit] * 3)
        f = kind(process, side=side, reset=True)
        prior = belief = f.belief(group.identity(), [0.1 * unit] * 3)
        truth = group.exp(np.cumsum(0.1 * rates, axis=0) @ J.T)
        for u, z in zip(rates @ J.T, truth):
            belief = f.update(f.predict(belief, u, 0.1), star, z)
        of_groups.append((np.asarray(group.log(belief.g)), belief.covariance, belief.nis))
        path = es.smooth(process, prior, rates @ J.T, 0.1, [(star, [1, 4], truth[[0, 3]])])
        of_groups[-1] += np.asarray(group.log(path.g)), path.covariance, path.chi2
    small, turning = of_groups
    for k, rtol in ((0, 1e-9), (3, 1e-7)):  # the smoothed path as far as it is iterated
        assert np.allclose(small[k] @ M.T, turning[k], rtol=rtol, atol=rtol * np.abs(turning[k]).max())
        assert np.allclose(M @ small[k + 1] @ M.T, turning[k + 1], rtol=rtol, atol=rtol * turning[k + 1].max())
        assert np.isclose(small[k + 2], turning[k + 2], rtol=rtol)


@lm.record
class Askew(es.Place):
    """A star tracker that is mounted askew."""

    def value(self, g):
        return self.group.compose_exp(g, vec(0.1, 0.2, 0.3))


@pytest.mark.parametrize("kind", [es.ErrorStateFilter, es.UnscentedFilter])
def test_an_element_is_measured_as_a_subclass_says(kind):
    """The residual was that of the element itself.  At g an exact sensor measures g exp(c), without a residual."""
    group, c = lm.SO3(), np.array([0.1, 0.2, 0.3])
    f, tracker = kind(es.Turning(group, [0.01] * 3)), Askew(group, [0.1] * 3)
    belief = f.belief(group.exp([0.3, -0.2, 0.5]), [0.1] * 3)
    z = group.compose_exp(belief.g, c)
    assert np.abs(f.innovation(belief, tracker, z)[0]).max() < 1e-14
    turned = f.innovation(belief, tracker, group.compose(belief.g, group.exp(-c)))[0]
    assert np.allclose(turned, -2.0 * c, rtol=0.0, atol=1e-6 if kind is es.ErrorStateFilter else 0.02)
