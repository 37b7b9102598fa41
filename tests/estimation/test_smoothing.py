"""Smoothing and fits: against filters, dense least squares and SciPy's."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
import scipy.optimize

import liemech as lm
from liemech.errors import InvalidInput, NoConvergence
from liemech.estimation.block_tridiagonal import BlockTridiagonal
from liemech.estimation.smoothing import led

es = lm.estimation
RNG = np.random.default_rng(31)


def believed(process, g, P, side="left"):
    return es.ErrorStateFilter(process, side).belief(g, P)


# ---------------------------------------------------------------- linear problems


@pytest.fixture
def drift():
    """A random walk in the plane, measured now and then, twice at the same time, and at both ends."""
    space = lm.VectorSpace(2)
    process, place = es.Turning(space, [0.3, 0.2]), es.Place(space, [0.1, 0.2])
    prior = believed(process, [0.0, 1.0], np.array([[0.3, 0.1], [0.1, 0.5]]))
    u, at = RNG.normal(size=(12, 2)), np.array([0, 3, 7, 7, 12])
    return process, place, prior, u, at, RNG.normal(size=(5, 2))


def test_a_smoothed_path_is_filter_and_smoother(drift):
    """Rauch, Tung and Striebel's recursion over Kalman's filter, both written out."""
    process, place, prior, u, at, z = drift
    h, found = 0.1, None
    x, P, Q = prior.g, np.array(prior.covariance), h * np.diag([0.09, 0.04])
    after, before = [], []
    for k in range(13):
        if k:
            x, P = x + h * u[k - 1], P + Q
        before.append((x, P))
        for i in np.flatnonzero(at == k):
            K = P @ np.linalg.inv(P + np.diag([0.01, 0.04]))
            x, P = x + K @ (z[i] - x), P - K @ P
        after.append((x, P))
    mean, cov = [after[-1][0]], [after[-1][1]]
    for k in range(11, -1, -1):
        (x, P), (ahead, A) = after[k], before[k + 1]
        C = P @ np.linalg.inv(A)
        mean.insert(0, x + C @ (mean[0] - ahead))
        cov.insert(0, P + C @ (cov[0] - A) @ C.T)
    found = es.smooth(process, prior, u, h, [(place, at, z)])
    assert np.allclose(found.g, mean, rtol=0, atol=1e-12)
    assert np.allclose(found.covariance, cov, rtol=1e-10, atol=1e-14)
    # the last of them is what the library's filter believes
    ekf = es.ErrorStateFilter(process)
    b = prior
    for k in range(13):
        b = ekf.predict(b, u[k - 1], h) if k else b
        for i in np.flatnonzero(at == k):
            b = ekf.update(b, place, z[i])
    assert np.allclose(b.g, found.g[-1], rtol=0, atol=1e-13)
    assert np.allclose(b.covariance, found.covariance[-1], rtol=1e-12)


def test_a_smoothed_path_is_dense_least_squares(drift):
    process, place, prior, u, at, z = drift
    h, n = 0.1, len(u)
    rows, right = [], []

    def row(blocks, value, covariance):
        W = np.linalg.inv(np.linalg.cholesky(covariance))
        line = np.zeros((2, 2 * (n + 1)))
        for k, block in blocks.items():
            line[:, 2 * k : 2 * k + 2] = W @ block
        rows.append(line)
        right.append(W @ value)

    one = np.eye(2)
    row({0: one}, prior.g, prior.covariance)
    for k in range(n):
        row({k: -one, k + 1: one}, h * u[k], h * np.diag([0.09, 0.04]))
    for k, value in zip(at, z):
        row({k: one}, value, np.diag([0.01, 0.04]))
    A, b = np.vstack(rows), np.concatenate(right)
    x, cost, *_ = np.linalg.lstsq(A, b, rcond=None)
    found = es.smooth(process, prior, u, h, [(place, at, z)])
    assert np.allclose(found.g.ravel(), x, rtol=0, atol=1e-12)
    inverse = np.linalg.inv(A.T @ A)
    blocks = [inverse[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] for k in range(n + 1)]
    assert np.allclose(found.covariance, blocks, rtol=1e-10, atol=1e-14)
    assert np.isclose(found.chi2, cost[0], rtol=1e-10)
    assert found.excess == len(b) - len(x)


@pytest.mark.parametrize("nodes", [1, 2, 9])
def test_blocks_on_and_beside_the_diagonal(nodes):
    n = 3
    D = RNG.normal(size=(nodes, n, n))
    D = D @ D.swapaxes(1, 2) + 9.0 * np.eye(n)
    E = RNG.normal(size=(nodes - 1, n, n))
    whole = scipy.linalg.block_diag(*D)
    for k in range(nodes - 1):
        a, b = slice(n * k, n * k + n), slice(n * k + n, n * k + 2 * n)
        whole[b, a], whole[a, b] = E[k], E[k].T
    made, b = BlockTridiagonal(D, E), RNG.normal(size=(nodes, n))
    assert np.allclose(whole @ made.solve(b).ravel(), b.ravel(), atol=1e-12)
    inverse = np.linalg.inv(whole)
    blocks = [inverse[n * k : n * k + n, n * k : n * k + n] for k in range(nodes)]
    assert np.allclose(made.diagonal_of_inverse(), blocks, atol=1e-13)


# ---------------------------------------------------------------- chains of poses


def tour(n=6, h=0.5):
    group = lm.SE3()
    process = es.Turning(group, [0.05, 0.05, 0.05, 0.2, 0.2, 0.2])
    u = np.array([0.1, 0.2, 0.8, 1.0, 0.1, 0.0]) + 0.1 * RNG.normal(size=(n, 6))
    x = [np.eye(4)]
    for k in range(n):
        x.append(process.move(x[-1], u[k], process.deviations(h) * RNG.normal(size=6), h))
    return process, u, np.array(x), h


def matrix(xi):
    """The twist (w, v) as a matrix of order 4."""
    a, b, c = xi[:3]
    return np.array([[0, -c, b, xi[3]], [c, 0, -a, xi[4]], [-b, a, 0, xi[5]], [0, 0, 0, 0]])


def twist(m):
    return np.array([m[2, 1], m[0, 2], m[1, 0], *m[:3, 3]])


@pytest.mark.slow
@pytest.mark.parametrize("side", ["left", "right"])
def test_a_smoothed_chain_of_poses_is_scipys_least_squares(side):
    """The same cost with expm and logm of matrices and differences for derivatives."""
    process, u, x, h = tour(3)
    group, n = process.group, 3
    fix = es.Position(group, [0.1, 0.2, 0.3], lever=[0.3, 0.0, 0.1])
    at = np.array([1, 2, 3])
    z = fix.value(x[at]) + np.array([0.1, 0.2, 0.3]) * RNG.normal(size=(3, 3))
    P = np.diag([0.1, 0.1, 0.1, 0.2, 0.2, 0.2]) ** 2
    found = es.smooth(process, believed(process, x[0], P, side), u, h, [(fix, at, z)])
    g0, white = x[0], np.linalg.inv(np.linalg.cholesky(P))

    def log(m):
        return twist(scipy.linalg.logm(m).real)

    def error(m, g):
        return log(np.linalg.inv(m) @ g if side == "left" else g @ np.linalg.inv(m))

    def path(d):
        return [found.g[k] @ scipy.linalg.expm(matrix(d[6 * k : 6 * k + 6])) for k in range(n + 1)]

    def residuals(d):
        g = path(d)
        parts = [white @ error(g0, g[0])]
        for k in range(n):
            ahead = found.g[k] @ scipy.linalg.expm(matrix(h * u[k]))
            L, step = np.zeros((6, 6)), 1e-6
            for i in range(6):
                e = step * np.eye(6)[i]
                ends = [found.g[k] @ scipy.linalg.expm(matrix(h * (u[k] + s * e))) for s in (1, -1)]
                L[:, i] = (error(ahead, ends[0]) - error(ahead, ends[1])) / (2 * step)
            L = L * np.asarray(process.deviations(h))
            W = np.linalg.inv(np.linalg.cholesky(L @ L.T))
            parts.append(W @ error(g[k] @ scipy.linalg.expm(matrix(h * u[k])), g[k + 1]))
        for k, value in zip(at, z):
            predicted = g[k][:3, 3] + g[k][:3, :3] @ [0.3, 0.0, 0.1]
            parts.append((value - predicted) / [0.1, 0.2, 0.3])
        return np.concatenate(parts)

    other = scipy.optimize.least_squares(residuals, np.zeros(24), xtol=1e-14, ftol=1e-14, gtol=1e-14)
    assert np.abs(other.x).max() < 2e-6  # it stays where we ended
    assert np.isclose(found.chi2, 2.0 * other.cost, rtol=1e-8)
    if side == "left":
        inverse = np.linalg.inv(other.jac.T @ other.jac)
        blocks = [inverse[6 * k : 6 * k + 6, 6 * k : 6 * k + 6] for k in range(n + 1)]
        assert np.allclose(found.covariance, blocks, rtol=2e-3, atol=2e-5)


@pytest.mark.slow
def test_a_sensor_that_has_measured_nothing_changes_nothing(drift):
    """One of vectors on a group of matrices, and one on the plane."""
    process, place, prior, u, at, z = drift
    alone = es.smooth(process, prior, u, 0.1, [(place, at, z)])
    silent = (place, np.array([], dtype=int), np.zeros((0, 2)))
    beside = es.smooth(process, prior, u, 0.1, [(place, at, z), silent])
    assert np.array_equal(alone.g, beside.g) and alone.chi2 == beside.chi2 and alone.excess == beside.excess
    rotations = lm.SO3()
    compass = es.Direction(rotations, [0.0, 0.6, 0.8], [0.01] * 3)
    seen = [
        (compass, np.array([1, 2]), np.array([[0.0, 0.6, 0.8]] * 2)),
        (compass, np.array([], dtype=int), np.zeros((0, 3))),
    ]
    gyroscope = es.Turning(rotations, [0.1] * 3)
    paths = [
        es.smooth(gyroscope, believed(gyroscope, np.eye(3), [0.1] * 3), np.full((3, 3), 0.1), 0.1, seen[:n]).g
        for n in (1, 2)
    ]
    assert np.array_equal(*paths)


@pytest.mark.slow
def test_what_is_found_does_not_depend_on_where_it_begins():
    process, u, x, h = tour(6)
    group, at = process.group, np.array([2, 4, 6])
    sensors = [(es.Landmark(group, p, [0.05] * 3), at) for p in ([3.0, 1, 2], [-2.0, 4, 0], [1.0, -3, 1])]
    seen = [(s, at, s.value(x[at]) + 0.05 * RNG.normal(size=(3, 3))) for s, at in sensors]
    first = es.smooth(process, None, u, h, seen, initial=x)
    far = group.compose_exp(x, 0.6 * RNG.normal(size=(7, 6)))
    second = es.smooth(process, None, u, h, seen, initial=far)
    assert np.allclose(first.g, second.g, rtol=0, atol=1e-8)
    assert second.steps > first.steps
    assert np.isclose(first.chi2, second.chi2, rtol=1e-12)


@pytest.mark.parametrize("noise", [1e-2, 1e-4, 1e-6, 1e-9, 1e-11])
def test_small_noise_leaves_digits_or_is_refused(noise):
    """A random walk that hardly walks, measured at its ends, is one place measured twice."""
    space, n = lm.VectorSpace(1), 5
    process, place = es.Turning(space, [noise]), es.Place(space, [0.1])
    seen = [(place, np.array([0, n]), np.array([[1.0], [2.0]]))]
    prior = believed(process, [0.0], [1.0])
    if noise < 1e-8:
        with pytest.raises(InvalidInput, match="so small beside"):
            es.smooth(process, prior, np.zeros((n, 1)), 1.0, seen)
        return
    # information before, after, and along the walk, whose variance grows by noise^2 a step
    found = es.smooth(process, prior, np.zeros((n, 1)), 1.0, seen)
    steps, q = np.arange(n + 1.0), noise * noise
    variances = 1.0 / (1.0 / (1.0 / 101.0 + q * steps) + 1.0 / (0.01 + q * steps[::-1]))
    assert np.abs(found.covariance[:, 0, 0] / variances - 1.0).max() < 1e-5


@lm.record
class Seen(es.Sensor):
    """The position of a car."""

    group: lm.SE2
    deviation: lm.Vec

    def value(self, g):
        return lm.vec(g[0, 2], g[1, 2])


@pytest.mark.slow
@pytest.mark.parametrize("at", [0, 10, 20])
def test_one_position_does_not_tell_a_path_of_poses(at):
    """It may turn about the position; variances were negative."""
    plane = lm.SE2()
    process, sensor = es.Turning(plane, [0.1] * 3), Seen(plane, [0.1] * 2)
    u = np.tile([0.3, 1.0, 0.0], (20, 1))
    path = led(process, plane.exp([0.7, 3.0, -2.0]), u, np.full(20, 0.5))
    with pytest.raises(InvalidInput, match="do not determine"):
        es.smooth(process, None, u, 0.5, [(sensor, np.array([at]), path[[at], :2, 2])], initial=path)


def test_bad_starts_and_undetermined_paths_are_refused():
    process, u, x, h = tour(3)
    group = process.group
    fix = es.Position(group, [0.1] * 3)
    prior = believed(process, x[0], [0.1] * 6)
    seen = [(fix, [1], [[0.0, 0.0, 0.0]])]
    lopsided = es.Belief(group, x[0], np.triu(np.ones((6, 6))))
    reflected = [(es.Place(group, [0.1] * 6), [0, 1], [np.eye(4), np.diag([1.0, 1.0, -1.0, 1.0])])]
    cases = [
        (lambda: es.smooth(process, lopsided, u, h, seen), "smooth: prior: covariance P must be symmetric"),
        (lambda: es.smooth(process, es.Belief(lm.SO3(), np.eye(3), np.eye(3)), u, h, seen), "prior is of SO3"),
        (lambda: es.smooth(process, prior, u, h, reflected), "observations.0.: values is not in"),
        (lambda: es.smooth(process, prior, u, h, seen, iterations=0), "iterations is a whole number from 1 on; got 0"),
        (lambda: es.smooth(process, None, u, h, seen, initial=x), "do not determine"),
        (lambda: es.smooth(process, None, u, h, seen), "initial="),
        (lambda: es.smooth(process, prior, u[:, :5], h, seen), "inputs has shape"),
        (lambda: es.smooth(process, prior, u, -h, seen), "positive step"),
        (lambda: es.smooth(process, prior, u, h, [(fix, [9], [[0, 0, 0]])]), "from 0 to 3"),
        (lambda: es.smooth(process, prior, u, h, [(fix, [1], [[0, 0]])]), "values have shape"),
        (lambda: es.smooth(process, prior, u, h, seen, initial=x[:2]), "initial has shape"),
        (lambda: es.smooth(es.Turning(group, [0.0] * 6), prior, u, h, seen), "singular"),
    ]
    for wrong, said in cases:
        with pytest.raises(InvalidInput, match=said):
            wrong()
    with pytest.raises(NoConvergence, match="iterations"):
        es.smooth(process, prior, u, h, [(fix, [3], [[9.0, 9.0, 9.0]])], iterations=1)


# ---------------------------------------------------------------- fits over tangent maps


@lm.record
class Rate(es.Sensor):
    """The momentum itself."""

    group: lm.LieGroup
    deviation: lm.Vec

    def value(self, g):
        return self.group.split(g)[0]


def tumble(steps=60):
    body = lm.RigidBody([1.0, 1.5, 2.0])
    plan = lm.Plan(body, lm.RKMK(order=4), h=0.1, progress=False)
    start = body.state(mu=[0.5, 0.1, 0.8], g=np.eye(3))
    return body, plan, start, plan.run(start, steps=steps)


@pytest.mark.slow
def test_a_start_is_found_from_the_attitude():
    """Without noise to rounding; with noise as scipy.optimize.least_squares finds it, by differences."""
    body, plan, start, run = tumble()
    space = es.phase_space(body, start)
    assert space == lm.ProductGroup(lm.VectorSpace(3), lm.SO3())
    star, at = es.OfPart(space, 1, es.Place(lm.SO3(), [0.01] * 3)), np.arange(5, 61, 5)
    guess = body.state(mu=[0.4, 0.2, 0.9], g=lm.SO3().exp([0.1, -0.2, 0.1]))
    exact = es.fit(plan, guess, [(star, at, run.g[at])])
    assert np.allclose(exact.start.mu, start.mu, atol=1e-9) and exact.chi2 < 1e-12
    z = lm.SO3().compose_exp(run.g[at], 0.01 * RNG.normal(size=(len(at), 3)))
    found = es.fit(plan, guess, [(star, at, z)])

    def residuals(x):
        there = body.state(mu=found.start.mu + x[:3], g=lm.SO3().compose_exp(found.start.g, x[3:]))
        g = plan.run(there, steps=60).g[at]
        return lm.SO3().log(lm.SO3().compose(lm.SO3().inverse(g), z)).ravel() / 0.01

    other = scipy.optimize.least_squares(residuals, np.zeros(6), jac="3-point", xtol=1e-13)
    assert np.abs(other.x).max() < 1e-6 and np.isclose(2.0 * other.cost, found.chi2, rtol=1e-9)
    assert np.allclose(found.covariance, np.linalg.inv(other.jac.T @ other.jac), rtol=1e-4, atol=1e-9)


@pytest.mark.slow
def test_parameters_are_found_with_the_start():
    body, plan, start, run = tumble()
    space, at = es.phase_space(body, start), np.arange(0, 61, 3)
    seen = [
        (es.OfPart(space, 1, es.Place(lm.SO3(), [0.01] * 3)), at, run.g[at]),
        (Rate(space, [0.01] * 3), at, run.mu[at]),
    ]
    other = plan.replace(system=lm.RigidBody([1.1, 1.4, 2.2]))
    found = es.fit(other, start, seen, by=["start", "inertia"])
    assert np.allclose(found.parameters["inertia"], [1.0, 1.5, 2.0], atol=1e-8)
    assert found.covariance.shape == (9, 9) and np.all(found.deviations > 0.0)
    # of the attitude alone the scale of inertia and momentum together cannot be known
    with pytest.raises(InvalidInput, match="do not determine"):
        es.fit(other, start, seen[:1], by=["start", "inertia"])
    known = es.ErrorStateFilter(es.Turning(space, [0.1] * 6))
    prior = known.belief(space.join(start.mu, np.eye(3)), [1e-7] * 3 + [1.0] * 3)
    found = es.fit(other, start, seen[:1], by=["start", "inertia"], prior=prior)
    assert np.allclose(found.parameters["inertia"], [1.0, 1.5, 2.0], atol=1e-6)


@pytest.mark.slow
def test_an_orbit_is_found_from_positions():
    system = lm.Kepler()
    plan = lm.Plan(system, lm.StormerVerlet(), h=0.02, progress=False)
    start = system.state(q=[1.0, 0.0], p=[0.0, 1.1])
    run, space = plan.run(start, steps=200), es.phase_space(system, start)
    at = np.arange(20, 201, 20)

    @lm.record
    class Seen(es.Sensor):
        deviation: lm.Vec

        @property
        def group(self):
            return lm.ProductGroup(lm.VectorSpace(2), lm.VectorSpace(2))

        def value(self, g):
            return g[:2]

    assert Seen([0.1] * 2).group == space
    plan = plan.replace(every=7)  # which samples a run would keep
    found = es.fit(plan, system.state(q=[1.1, 0.1], p=[0.1, 1.0]), [(Seen([0.1] * 2), at, run.q[at])])
    assert np.allclose(found.start.q, [1.0, 0.0], atol=1e-9)
    assert np.allclose(found.start.p, [0.0, 1.1], atol=1e-9)


def test_what_cannot_be_fitted_is_refused():
    body, plan, start, run = tumble(10)
    space = es.phase_space(body, start)
    star = es.OfPart(space, 1, es.Place(lm.SO3(), [0.01] * 3))
    seen = [(star, [1, 5], run.g[[1, 5]])]
    cases = [
        (lambda: es.fit(plan, start, []), "no observations"),
        (lambda: es.fit(plan, start, seen, by="inertia"), "begins with"),
        (lambda: es.fit(plan, start, seen, by=["start", "mass"]), "mass is no parameter"),
        (
            lambda: es.fit(plan, start, seen, prior=es.Belief(space, space.identity(), -np.eye(6))),
            "negative eigenvalue",
        ),
        (lambda: es.fit(plan, start, [(star, [-1], run.g[:1])]), "from 0 on"),
        (lambda: es.fit(plan, start, [(star, [1], 2.0 * run.g[:1])]), "values is not in"),
    ]
    for wrong, said in cases:
        with pytest.raises(InvalidInput, match=said):
            wrong()
    pendulum = lm.SphericalPendulum(length=1.0)
    with pytest.raises(lm.errors.IncompatibleSystem, match="not free to move"):
        es.phase_space(pendulum, pendulum.state(q=[1.0, 0, 0], p=[0, 0.1, 0]))
