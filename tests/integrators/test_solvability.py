"""How large a step may be: certificates against the determinants they speak of, and every solution against the branch
from h = 0.

The branch is computed here once more, with arc length as its parameter, so that folds are passed and seen.
"""

from __future__ import annotations

import math
import re
import warnings

import numpy as np
import pytest
from scenes import CAYLEY, EXP, asymmetric_body, named, quiet_body, rotation, same_bits, seed_body

import liemech as lm
from liemech.integrators.solvability import first_fold, is_always_solvable, principal_moments
from liemech.solvers import newton

# large steps are what this is about
pytestmark = pytest.mark.filterwarnings("ignore::liemech.errors.StepWarning")
BOTH = pytest.mark.parametrize("method", [EXP, CAYLEY], ids=named)
INFINITY = math.inf


# ---------------------------------------------------------------- the equation, for many bodies at once


def coefficients(square: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(1 - cos th)/th^2 and (th - sin th)/th^3."""
    th = np.sqrt(square)
    safe = np.where(square < 1e-3, 1.0, th)
    b = np.where(square < 1e-3, 0.5 - square / 24 + square**2 / 720, (1 - np.cos(safe)) / safe**2)
    c = np.where(square < 1e-3, 1 / 6 - square / 120 + square**2 / 5040, (safe - np.sin(safe)) / safe**3)
    return b, c


def carried(method: lm.CovariantVariational, x: np.ndarray, m: np.ndarray) -> np.ndarray:
    """(dtau_x)* m, right-trivialised.  x, m : (..., 3)."""
    square, w = (x * x).sum(-1)[..., None], np.cross(x, m)
    if method is CAYLEY:
        return 4 / (4 + square) * (m - w / 2)
    b, c = coefficients(square)
    return m - b * w + c * np.cross(x, w)


def excess(method: lm.CovariantVariational, J: np.ndarray, x: np.ndarray, m: np.ndarray) -> np.ndarray:
    """J x - (dtau_x)* m, zero for a step."""
    return J * x - carried(method, x, m)


def slopes(method: lm.CovariantVariational, J: np.ndarray, x: np.ndarray, m: np.ndarray) -> np.ndarray:
    """Its derivative by x, (..., 3, 3): of a polynomial for Cayley, else by central differences of order 4."""
    columns = []
    for e in np.eye(3):
        near, far = 2e-3 * e, 4e-3 * e
        near_slope = (excess(method, J, x + near, m) - excess(method, J, x - near, m)) / 4e-3
        far_slope = (excess(method, J, x + far, m) - excess(method, J, x - far, m)) / 8e-3
        columns.append((4 * near_slope - far_slope) / 3)
    return np.stack(columns, -1)


def adjugate(D: np.ndarray) -> np.ndarray:
    a, b, c = D[..., 0], D[..., 1], D[..., 2]
    return np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], -2)


def branch(
    method: lm.CovariantVariational, J: np.ndarray, m: np.ndarray, piece: float = 0.02
) -> tuple[np.ndarray, np.ndarray]:
    """What grows out of x = 0 when m grows from nothing: x (n, 3) at m, and the part s (n,) of m
    where there is a fold, or 1.

    (x, s) moves along adj(D) (dtau_x)* m, det D: the direction in which the equation stays solved,
    on folds too.  With the exponential s is nan where the branch comes within 0.1 of a whole turn
    and turns away: it may count as ended there, too.
    """
    n = len(m)
    x_all, s_all, ended, close = np.zeros((n, 3)), np.zeros(n), np.zeros(n), np.zeros(n, dtype=bool)
    active = np.arange(n)
    chart = 2 * math.pi if method is EXP else INFINITY
    for _ in range(5000):
        if not len(active):
            return x_all, ended
        x, s, inertia, data = x_all[active], s_all[active], J[active], m[active]

        def direction(
            x: np.ndarray, s: np.ndarray, J: np.ndarray = inertia, m: np.ndarray = data
        ) -> tuple[np.ndarray, np.ndarray]:
            D = slopes(method, J, x, s[:, None] * m)
            dx, ds = (adjugate(D) @ carried(method, x, m)[..., None])[..., 0], np.linalg.det(D)
            size = np.maximum(np.linalg.norm(dx, axis=1) / (0.3 + np.linalg.norm(x, axis=1)), 2 * np.abs(ds))
            return dx / size[:, None], ds / size

        dx, ds = direction(x, s)
        dx, ds = direction(x + piece / 2 * dx, s + piece / 2 * ds)
        new, part = x + piece * dx, s + piece * ds
        arrived = part >= 1
        new[arrived] = x[arrived] + ((1 - s) / (part - s))[arrived, None] * (new - x)[arrived]
        part = np.minimum(part, 1.0)
        # back to the branch, by the shortest way, or to its point at s = 1
        for _ in range(2 + 3 * bool(arrived.any())):
            D, r = (
                slopes(method, inertia, new, part[:, None] * data),
                excess(method, inertia, new, part[:, None] * data),
            )
            wide = np.concatenate([D, np.where(arrived[:, None], 0.0, -carried(method, new, data))[..., None]], axis=2)
            change = (np.linalg.pinv(wide) @ r[..., None])[..., 0]
            new, part = new - change[:, :3], part - np.where(arrived, 0.0, change[:, 3])
        fold = ~arrived & (np.linalg.det(slopes(method, inertia, new, part[:, None] * data)) <= 0.0)
        fold |= np.linalg.norm(new, axis=1) >= chart
        close[active] |= np.linalg.norm(new, axis=1) >= chart - 0.1
        x_all[active], s_all[active] = new, part
        ended[active] = np.where(fold, np.minimum(part, 1 - 1e-9), np.where(close[active], math.nan, 1.0))
        active = active[~(arrived | fold)]
    raise AssertionError("the branch is longer than expected")


def shapes(rng: np.random.Generator, count: int) -> np.ndarray:
    """Inertias (count, 3): bodies, rods down to 1:2000, plates, and moments that no body has."""
    J = []
    for kind in np.arange(count) % 4:
        a, b = np.sort(rng.uniform(0.2, 1.0, 2))
        thin = 10 ** rng.uniform(-3.3, -0.5)
        rod, any_three = [thin, 1.0, 1.0 + thin * rng.uniform()], 10 ** rng.uniform(-2, 0, 3)
        J.append(([a, b, b + a * rng.uniform()], rod, [a, 1.0, 1.0 + a], any_three)[kind])
    return rng.permuted(np.array(J), axis=1)


def against_the_branch(method: lm.CovariantVariational, count: int, seed: int, piece: float = 0.02) -> tuple[int, int]:
    """Steps of h = 1 on random bodies, h |mu| from 0.1 to 20: how many were accepted, how many
    refused, all of them rightly.

    Those that come close to a whole turn may be refused.
    """
    rng = np.random.default_rng(seed)
    J, mu = shapes(rng, count), rng.normal(size=(count, 3))
    slim = rng.random(count) < 0.3
    mu[slim] *= np.sqrt(J[slim])
    mu *= (10 ** rng.uniform(-1.0, math.log10(20.0), count) / np.linalg.norm(mu, axis=1))[:, None]
    wanted, part = branch(method, J, mu, piece)
    accepted = 0
    for inertia, momentum, x, s in zip(J, mu, wanted, part, strict=True):
        body, m = quiet_body(inertia), lm.Vec.of(momentum)
        try:
            found = np.array(method.displacement(body, 1.0, m, body.velocity(m)))
        except (lm.errors.NoConvergence, lm.errors.OutsideChart):
            assert s != 1.0, (inertia, momentum)
            continue
        assert not s < 1.0, (inertia, momentum)
        assert np.abs(found - x).max() < 1e-8 * (1.0 + np.abs(x).max()), (inertia, momentum)
        accepted += 1
    return accepted, int((part < 1.0).sum())


# ---------------------------------------------------------------- every step is the one that grows out of h = 0


@pytest.mark.slow
@pytest.mark.parametrize(("method", "count", "seed"), [(EXP, 24, 4), (CAYLEY, 40, 5)], ids=["exp", "Cayley"])
def test_steps_are_those_that_grow_out_of_zero(method: lm.CovariantVariational, count: int, seed: int) -> None:
    accepted, refused = against_the_branch(method, count, seed, piece=0.05)
    assert accepted > count / 2
    assert refused > (count / 5 if method is EXP else 0)


@pytest.mark.slow
@BOTH
def test_many_steps_are_those_that_grow_out_of_zero(method: lm.CovariantVariational) -> None:
    against_the_branch(method, 300, seed=3)


@pytest.mark.slow
@BOTH
def test_steps_of_rigid_motions_are_those_that_grow_out_of_zero(method: lm.CovariantVariational) -> None:
    """On SE(3), against 400 small pieces of the way."""
    rng, accepted = np.random.default_rng(12), 0
    for _ in range(30):
        a, b = np.sort(rng.uniform(0.3, 1.0, 2))
        body = lm.models.KirchhoffBody.of_blocks([a, b, b + a * rng.uniform()], rng.uniform(0.5, 2.0, 3))
        mu = rng.normal(size=6)
        mu *= 10 ** rng.uniform(0.0, 1.2) * a / np.linalg.norm(mu[:3])
        x = before = np.zeros(6)
        on_the_way = True
        for k in range(1, 401):
            y = guess = 2 * x - before if k > 1 else np.array(body.velocity(mu)) / 400
            for _ in range(6):
                r, D, _ = method.equation(body, 1.0, lm.Vec.of(mu * k / 400), lm.Vec.of(y))
                change = np.linalg.solve(np.array(D), np.array(r))
                y = y - change
                if np.abs(change).max() < 1e-9:
                    break
            on_the_way = (
                np.abs(change).max() < 1e-8 and np.linalg.det(np.array(D)) > 0.0 and np.abs(y - guess).max() < 0.1
            )
            if not on_the_way or (method is EXP and np.linalg.norm(y[:3]) > 2 * math.pi):
                on_the_way = False
                break
            x, before = y, x
        try:
            found = np.array(method.displacement(body, 1.0, lm.Vec.of(mu), body.velocity(lm.Vec.of(mu))))
        except lm.errors.NoConvergence:
            assert not on_the_way
            continue
        if on_the_way:
            assert np.abs(found - x).max() < 1e-8 * (1.0 + np.abs(x).max())
            accepted += 1
    assert accepted > 12


@pytest.mark.slow
@pytest.mark.parametrize(("thin", "size"), [(1 / 1000, 0.8), (1 / 1000, 2.0)])
def test_thin_rods_have_steps_on_other_sheets_which_are_refused(thin: float, size: float) -> None:
    """Newton's method from J^-1 mu does find a root, with det > 0: not the one of the motion."""
    rng = np.random.default_rng(0)
    mu = rng.normal(size=(30, 3)) * [0.1, 1.0, 1.0]
    mu *= size / np.linalg.norm(mu, axis=1)[:, None]
    J = np.broadcast_to([thin, 1.0, 1.0], mu.shape)
    wanted, part = branch(CAYLEY, J, mu, piece=0.05)
    body, strangers = quiet_body(J[0]), 0
    for m, x, s in zip(mu, wanted, part, strict=True):
        if s == 1.0:
            found = CAYLEY.displacement(body, 1.0, lm.Vec.of(m), lm.Vec.of(m / J[0]))
            assert np.abs(np.array(found) - x).max() < 1e-9 * (1.0 + np.abs(x).max())
            continue
        with pytest.raises(lm.errors.NoConvergence, match="grows out of h = 0 ends at h"):
            CAYLEY.displacement(body, 1.0, lm.Vec.of(m), lm.Vec.of(m / J[0]))
        y = np.array(newton(lambda y, m=m: CAYLEY.equation(body, 1.0, lm.Vec.of(m), y), lm.Vec.of(m / J[0]), m @ m)[0])
        strangers += (
            np.abs(excess(CAYLEY, J[0], y, m)).max() < 1e-10 and np.linalg.det(slopes(CAYLEY, J[0], y, m)) > 0.0
        )
    assert strangers > 1


# ---------------------------------------------------------------- certificates


def cayley_determinant(J: np.ndarray, x: np.ndarray) -> np.ndarray:
    """det DF of F(x) = J x + x cross J x + (x . J x) x.  J : (3,), x : (n, 3)."""
    columns = []
    for e in np.eye(3):
        turning = np.cross(e, J * x) + np.cross(x, J * e)
        columns.append(J * e + turning + 2 * (x @ (J * e))[:, None] * x + ((x * x) @ J)[:, None] * e)
    return np.linalg.det(np.stack(columns, -1))


def test_where_the_certificate_holds_the_determinant_is_positive() -> None:
    rng = np.random.default_rng(6)
    x = np.abs(rng.normal(size=(4000, 3))) * 10 ** rng.uniform(-1.5, 1.0, (4000, 3))
    certified = 0
    for J in shapes(rng, 200):
        if is_always_solvable(lm.Vec.of(J)):
            certified += 1
            assert cayley_determinant(J, x).min() > 0.0
    assert 100 < certified < 200


def test_the_certificate_holds_for_bodies_less_than_seventy_times_longer_than_thick() -> None:
    rng = np.random.default_rng(7)
    for _ in range(2000):
        least = 10 ** rng.uniform(-math.log10(70.0), 0.0)
        middle = rng.uniform(max(least, 1.0 - least), 1.0)
        assert is_always_solvable(lm.Vec.of(rng.permutation([least, middle, 1.0])))
    assert is_always_solvable(lm.Vec.of((2 / 3, 1.0, 2.0)))
    assert not is_always_solvable(lm.Vec.of((1.0, 1.0, 1 / 80)))
    rod = np.array([1 / 140, 1.0, 1.0])
    x = np.array([[a, b, b] for a in np.linspace(0, 6, 60) for b in np.linspace(0, 1, 100)])
    assert cayley_determinant(rod, x).min() < 0.0  # and beyond, there is nothing to certify


@pytest.mark.slow
def test_no_derivative_is_singular_before_the_first_fold() -> None:
    """|F(x)| = h|mu| at x, F(x) = (dtau_x^-1)* J x: where det DF <= 0, it is larger than the bound."""
    rng = np.random.default_rng(8)
    singular = 0
    for J in (*shapes(rng, 24), np.array([1.0, 1.0, 2.0]), np.array([0.01, 0.0101, 1.0])):
        u = np.abs(rng.normal(size=(3000, 3))) * 10 ** rng.uniform(-2, 0, (3000, 3))
        x = u / np.linalg.norm(u, axis=1)[:, None] * rng.uniform(0.5, 2 * math.pi - 1e-2, 3000)[:, None]
        M = np.stack([carried(EXP, x, e) for e in np.eye(3)], -1)
        m = np.linalg.solve(M, (J * x)[..., None])[..., 0]
        folded = np.linalg.det(slopes(EXP, J, x, m)) <= 0.0
        singular += folded.sum()
        bound = first_fold(lm.Vec.of(J), lm.Exponential())
        assert (np.linalg.norm(m, axis=1)[folded] > bound).all()
        low, middle, high = np.sort(J)
        assert bound >= math.pi * low
        if low + middle >= high:
            assert bound == pytest.approx(math.pi * math.sqrt(low * middle), rel=1e-14)
            assert (np.linalg.norm(m, axis=1)[folded] > 1.28 * bound).all()
    assert singular > 1000


def test_the_bound_of_the_proof() -> None:
    """The symmetric part of the derivative of (dexp_x)* m by x is at most |m| (1 - sin|x|/|x|)/|x| for |x| <= pi."""
    for th in np.linspace(0.1, math.pi, 20):
        angle = np.linspace(0.0, math.pi, 31)
        x, m = (np.broadcast_to([0.0, 0.0, th], (31, 3)), np.stack([np.sin(angle), 0 * angle, np.cos(angle)], -1))
        D = -slopes(EXP, np.zeros(3), x, m)
        largest = np.linalg.eigvalsh((D + np.swapaxes(D, 1, 2)) / 2).max()
        assert largest == pytest.approx((1 - math.sin(th) / th) / th, rel=1e-8)


def test_principal_moments() -> None:
    rng = np.random.default_rng(9)
    for J in (*shapes(rng, 100), np.array([2.0, 2.0, 2.0]), np.array([1.0, 1.0, 3.0])):
        turn = rotation(rng)
        full = turn @ np.diag(J) @ turn.T
        found = np.array(principal_moments(lm.Mat.of((0.5 * (full + full.T)).tolist())))
        # half the digits where two are equal
        assert np.abs(np.sort(found) - np.sort(J)).max() < 1e-8 * J.max()


# ---------------------------------------------------------------- asking, and failing


def test_largest_step() -> None:
    body, start = asymmetric_body()
    size = np.linalg.norm(np.array(start.mu))
    assert CAYLEY.largest_step(body, start) == INFINITY
    assert EXP.largest_step(body, start) == pytest.approx(math.pi * math.sqrt(1.6) / size, rel=1e-14)
    many = body.state(np.outer([0.5, 2.0], start.mu))
    assert EXP.largest_step(body, many) == pytest.approx(math.pi * math.sqrt(1.6) / (2 * size), rel=1e-14)
    assert EXP.largest_step(body, body.state([0.0, 0.0, 0.0])) == INFINITY
    turn = rotation(np.random.default_rng(1))
    full = turn @ np.diag(body.inertia) @ turn.T
    tilted = lm.RigidBody(0.5 * (full + full.T))
    assert EXP.largest_step(tilted, start) == pytest.approx(EXP.largest_step(body, start), rel=1e-10)
    assert CAYLEY.largest_step(tilted, start) == INFINITY
    needle = quiet_body([1 / 500, 1.0, 1.0])
    assert EXP.largest_step(needle, start) == pytest.approx(2 * math.pi / 500 / size, rel=1e-14)
    assert CAYLEY.largest_step(needle, start) == pytest.approx(math.pi * math.sqrt(1 / 500) / size, rel=1e-14)
    fish = lm.models.KirchhoffBody.of_blocks([1.0, 1.6, 2.3], [2.0, 2.5, 3.1])
    assert EXP.largest_step(fish, fish.state([0.5, -0.3, 0.4, 0.2, 0.6, -0.4])) is None


def test_caution() -> None:
    body, start = seed_body()
    largest = EXP.largest_step(body, start)
    assert EXP.step_warning(body, start, 0.99 * largest) is None
    assert CAYLEY.step_warning(body, start, 1e6) is None
    assert f"{largest:.3g}" in EXP.step_warning(body, start, -1.01 * largest)
    composed = lm.Composition(EXP, order=4)
    # its largest substep is 0.66 h
    assert composed.step_warning(body, start, 1.01 * largest) is None
    assert composed.step_warning(body, start, 1.6 * largest) is not None


@pytest.mark.filterwarnings("default::liemech.errors.StepWarning")
def test_a_run_with_a_large_step_warns_once() -> None:
    body, start = seed_body()
    with pytest.warns(lm.errors.StepWarning, match=r"h = 3 is larger than 2\.\d+") as caught:
        lm.integrate(body, EXP, start, h=3.0, steps=10, compiled=False)
    assert len(caught) == 1
    assert caught[0].filename == __file__


@BOTH
def test_up_to_the_largest_step_every_direction_has_one(method: lm.CovariantVariational) -> None:
    rng = np.random.default_rng(11)
    for J in shapes(rng, 15):
        body = quiet_body(J)
        mu = rng.normal(size=3)
        start = body.state(mu / np.linalg.norm(mu))
        h = min(method.largest_step(body, start), 1e3)
        lm.integrate(body, method, start, h=h, steps=3, compiled=False)


@pytest.mark.slow
def test_a_failure_says_where_the_branch_ends_and_keeps_what_there_is() -> None:
    body, _ = seed_body()
    start = body.state([0.0, 0.6, 0.8], np.eye(3))
    with pytest.raises(lm.errors.NoConvergence) as caught:
        lm.integrate(body, EXP, start, h=20.0, steps=50, compiled=False)
    text, run = str(caught.value), caught.value.trajectory
    assert f"step {len(run)} of 50" in text
    assert "h|xi| = " in text
    ends = float(re.search(r"ends at h = ([0-9.]+)", text)[1])
    usable = float(re.search(r"try ([0-9.]+)", text)[1])
    assert usable == pytest.approx(EXP.largest_step(body, start), rel=5e-3)
    lm.integrate(body, EXP, start, h=usable * 0.99, steps=50, compiled=False)
    last = run.last
    lm.integrate(body, EXP, last, h=0.99 * ends, steps=1, compiled=False)
    with pytest.raises(lm.errors.NoConvergence):
        lm.integrate(body, EXP, last, h=1.02 * ends, steps=1, compiled=False)
    _, part = branch(EXP, np.array([body.inertia]), 20.0 * np.array([last.mu]))
    assert ends == pytest.approx(20.0 * part[0], rel=1e-2)


@pytest.mark.slow
@pytest.mark.compiled
@BOTH
def test_large_steps_have_the_same_bits_in_native_code(method: lm.CovariantVariational) -> None:
    needle = quiet_body([1 / 150, 1.0, 1.005])
    mu = np.random.default_rng(3).normal(size=(8, 3)) * [0.05, 1.0, 1.0]
    fast = 0
    for h in (0.3, -0.8):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # some of these steps have no solution
            cloud = lm.integrate(needle, method, needle.state(mu), h=h, steps=5, compiled=True)
        for i, m in enumerate(mu):
            try:
                alone = lm.integrate(needle, method, needle.state(m), h=h, steps=5, compiled=False)
            except lm.errors.IntegrationFailure as failure:
                assert cloud.stopped[i].steps == len(failure.trajectory) - 1
                continue
            assert same_bits(cloud.mu[:, i], alone.mu)
            fast += abs(h) > method.largest_step(needle, needle.state(m))
    assert fast > 3


@BOTH
def test_a_unit_of_mass_changes_no_bit_of_a_large_step(method: lm.CovariantVariational) -> None:
    J, mu = np.array([1 / 150, 1.0, 1.005]), np.array([0.05, 0.8, -0.5])
    plain = lm.integrate(quiet_body(J), method, quiet_body(J).state(mu), h=0.9, steps=3, compiled=False)
    for unit in (2.0**-200, 2.0**200):
        body = quiet_body(unit * J)
        assert same_bits(
            lm.integrate(body, method, body.state(unit * mu), h=0.9, steps=3, compiled=False).mu / unit, plain.mu
        )


def least_value(J: np.ndarray, across: np.ndarray) -> float:
    """The least value of the quadratic form with the coefficients k_i and k_ij, where no x_i^2 is
    negative and their sum is one.
    """
    a, b, c = J
    k = np.diag([J[i] * (4.0 * J[i] ** 2 + 3.0 * J[i - 1] * J[i - 2]) for i in range(3)])
    for i, j, m in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        k[i, j] = k[j, i] = 2.0 * J[i] * J[j] * (J[i] + J[j]) + 4.0 * a * b * c - 0.5 * J[m] * (J[i] ** 2 + J[j] ** 2)
    return float(np.einsum("ni,ij,nj->n", across, k, across).min())


@pytest.mark.parametrize("share", [0.0, 0.3, 0.5])
def test_the_condition_is_that_a_quadratic_form_is_not_negative(share: float) -> None:
    """From thick to thin bodies it fails where the form does, on a grid that is fine along all ratios of the x_i^2."""
    logarithms = np.linspace(-6.0, 6.0, 241)
    u, v = (10.0 ** x.ravel() for x in np.meshgrid(logarithms, logarithms))
    across = np.stack([np.ones_like(u), u, v], axis=-1) / (1.0 + u + v)[:, None]
    seen = set()
    for ratio in np.geomspace(20.0, 400.0, 40):
        J = np.array([1.0, 1.0 - share / ratio, 1.0 / ratio])
        least = least_value(J, across)
        solvable = is_always_solvable(lm.Vec.of(J))
        seen.add(solvable)
        assert solvable == (least >= 0.0)
    assert seen == {True, False}
