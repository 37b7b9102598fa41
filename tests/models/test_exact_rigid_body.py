"""The exact free rigid body against its equations of motion, solved independently to 30 digits, and its own laws."""

import itertools
import json
import math
import subprocess
import sys
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest

import liemech as lm
from liemech.compiler import batch, kernel, row_driver
from liemech.models.bodies import exact_rigid_body as exact
from liemech.models.bodies import polhode
from liemech.models.bodies.exact_rigid_body import exact_rigid_body, momentum_period

EPS = np.finfo(float).eps
REFERENCE = Path(__file__).parent.parent / "reference"


# --- an independent solution: Taylor series of mu' = mu x w, r' = r x w (r a row of g), in integers
# scaled by 2^BITS --

BITS = 260
ORDER = 40
TOLERANCE = 1 << BITS - 120  # of the last term kept


def scaled(x):
    """x 2^BITS as an integer, exact for every double above 2^-200."""
    numerator, denominator = float(x).as_integer_ratio()
    return (numerator << BITS) // denominator


def taylor(J, mu, g, times):
    """mu (n, 3) and g (n, 3, 3) at the times, all of one sign and growing in size; J, mu of order one."""
    unit = scaled(2.0 / top_rate(J, mu) if any(mu) else max(abs(times)))
    J = [scaled(x) for x in J]
    vectors = [[scaled(x) for x in v] for v in (mu, *g)]
    now, mus, gs = 0, [], []
    for t in map(scaled, times):
        while now != t:
            series = taylor_series(J, vectors, unit if t > now else -unit)
            last = max(abs(x[-1]) for v in series for x in v)
            reach = int((TOLERANCE / max(last, 1)) ** (1 / ORDER) * 2**64) << BITS - 64
            rest = (abs(t - now) << BITS) // unit
            h = min(reach, rest)
            now = t if h == rest else now + (h * unit >> BITS) * (1 if t > now else -1)
            vectors = [[horner(x, h) for x in v] for v in series]
        values = np.array([[x / 2**BITS for x in v] for v in vectors])
        mus.append(values[0])
        gs.append(values[1:])
    return np.array(mus), np.array(gs)


def taylor_series(J, vectors, h):
    """Coefficients of the powers of t/h."""
    series = [[[x] for x in v] for v in vectors]
    w = [[(x << BITS) // j] for x, j in zip(vectors[0], J, strict=True)]
    for k in range(ORDER):
        for v in series:
            new = []
            for i in range(3):
                a, b = (i + 1) % 3, (i + 2) % 3
                product = sum(v[a][m] * w[b][k - m] - v[b][m] * w[a][k - m] for m in range(k + 1))
                new.append((product >> BITS) * h // (k + 1) >> BITS)
            for x, y in zip(v, new, strict=True):
                x.append(y)
        for i in range(3):
            w[i].append((series[0][i][-1] << BITS) // J[i])
    return series


def horner(coefficients, x):
    value = 0
    for c in reversed(coefficients):
        value = c + (value * x >> BITS)
    return value


# --- the regimes
# ------------------------------------------------------------------------------------------------------

REGIMES = {
    "sphere": ([2, 2, 2], [0.3, -0.5, 0.7]),
    "rest": ([1, 2, 3], [0, 0, 0]),
    "steady, least axis": ([1, 2, 3], [-0.8, 0, 0]),
    "steady, middle axis": ([1, 2, 3], [0, 1.1, 0]),
    "steady, largest axis": ([1, 2, 3], [0, 0, -0.9]),
    "steady, in the equator": ([2, 2, 3], [0.4, -0.3, 0]),
    "oblate": ([1, 1, 2], [0.5, 0.3, 0.9]),
    "oblate, slow precession": ([1, 1, 2], [0.6, 0.8, 1e-8]),
    "oblate, backwards": ([1, 2, 1], [0.5, -0.9, 0.3]),
    "prolate": ([1, 2, 2], [-0.5, 0.3, 0.9]),
    "prolate, slow precession": ([1, 2, 2], [1e-8, 0.3, 0.9]),
    "nearly oblate": ([1, 1 + 1e-10, 2], [0.5, 0.3, 1e-4]),
    "nearly prolate": ([1, 2, 2 + 1e-10], [1e-6, 0.3, -0.9]),
    "nearly prolate, other side": ([1, 2, 2 + 1e-10], [1e-3, 0.3, -0.9]),
    "nearly a sphere": ([1, 1 + 1e-9, 1 + 3e-9], [0.5, 0.3, -0.9]),
    "seed of the article": ([2 / 3, 1, 2], [0.5, 0, 0.75**0.5]),
    "about the largest axis": ([1, 2, 3], [0.3, -0.4, 1.2]),
    "about the least axis": ([1, 2, 3], [-1.2, 0.3, 0.4]),
    "unsorted": ([3, 1, 2], [0.3, 1.5, -0.4]),
    "unsorted, all negative": ([2, 3, 1], [-0.9, -0.3, -0.8]),
    "no triangle inequality": ([1, 1.5, 9], [0.7, -0.3, 0.2]),
    "nearly a rod": ([1, 1.1, 1e-4], [0.7, -0.6, 1e-3]),
    "nearly a rod, tumbling": ([1, 1.1, 1e-4], [-0.7, 0.9, 1e-5]),
    "nearly steady": ([1, 2, 3], [1e-9, -1e-10, -1]),
    "nearly steady, middle axis": ([1, 2, 3], [1e-9, 1, -3e-9]),
    "separatrix": ([2, 3, 6], [1, -0.5, 1]),
    "separatrix, other branch": ([2, 3, 6], [-1, 0.5, 1]),
    "separatrix, falling moments": ([6, 3, 2], [0.7, -1.5, -0.7]),
    "just above the separatrix": ([2, 3, 6], [1, -0.5, 1 + 4e-16]),
    "just below the separatrix": ([2, 3, 6], [1 + 4e-16, -0.5, 1]),
    "near the separatrix": ([2, 3, 6], [1, -0.5, 1 - 1e-7]),
}
REGIMES |= {
    f"random {seed}": (np.exp(random.normal(size=3)), random.normal(size=3))
    for seed, random in ((seed, np.random.default_rng(seed)) for seed in range(6))
}
MOVING = [name for name, (J, mu) in REGIMES.items() if momentum_period(J, mu) > 0]


def attitude(seed=0):
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))


def top_rate(J, mu):
    """A bound on |w|, from the energy."""
    return math.sqrt(np.sum(np.square(mu) / J) / np.min(J))


def errors(J, mu, g, t, solution):
    """Largest error of the momentum and of the attitude, each relative, over 1 + rate |t|.

    The rate is |w|, or that of the momentum if it is greater, which takes a moment above the sum of the others.
    """
    period = momentum_period(J, mu)
    rate = max(np.linalg.norm(np.divide(mu, J)), 2 * math.pi / period if period else 0.0)
    size = np.linalg.norm(mu) or 1.0
    return [
        float((abs(a - b).reshape(len(t), -1).max(axis=1) / scale / (1 + rate * abs(t))).max())
        for a, b, scale in zip(exact_rigid_body(J, mu, g, t), solution, (size, 1.0), strict=True)
    ]


# --- against the equations of motion
# ----------------------------------------------------------------------------------


@pytest.mark.parametrize("body", ["seed", "unsorted", "axisymmetric"])
def test_reference_solutions(body):
    data = json.loads((REFERENCE / f"rigid_body_{body}.json").read_text())
    J, mu, g = (np.array(data[key], float) for key in ("J", "pi0", "R0"))
    t, mus, gs = (np.array([sample[key] for sample in data["samples"]], float) for key in ("t", "pi", "R"))
    assert max(errors(J, mu, g, t, (mus, gs))) < 10 * EPS


@pytest.mark.parametrize("name", REGIMES)
def test_equations_of_motion_forwards_and_backwards(name):
    J, mu = REGIMES[name]
    for sign in (1, -1):
        t = sign * np.array([0.1, 3.0, 12.0]) / (top_rate(J, mu) or 1.0)
        assert max(errors(J, mu, attitude(), t, taylor(J, mu, attitude(), t))) < 20 * EPS


@pytest.mark.slow
@pytest.mark.parametrize("offset", [1e-2, -1e-2, 1e-7, -1e-7, 1e-13, -1e-13])
def test_several_flips_next_to_the_separatrix(offset):
    """The body waits near its middle axis and flips; the exact constants make even the time of the flip exact."""
    J, mu = [2, 3, 6], [1, -0.5, 1 + offset]
    t = momentum_period(J, mu) * np.array([0.23, 0.49, 0.51, 1.1])
    assert max(errors(J, mu, attitude(), t, taylor(J, mu, attitude(), t))) < 10 * EPS


@pytest.mark.parametrize("name", MOVING)
def test_derivatives(name):
    """mu' = mu x w and g' = g hat(w), by central differences of order 8."""
    J, mu = REGIMES[name]
    rate = max(top_rate(J, mu), 2 * math.pi / momentum_period(J, mu))
    h, t = 0.02 / rate, np.linspace(-20, 20, 7) / rate
    weights = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
    forward = {k: exact_rigid_body(J, mu, attitude(), t + k * h) for k in range(-4, 5)}
    momentum_rate, attitude_rate = (
        sum(c * (forward[k][i] - forward[-k][i]) for k, c in weights.items()) / h for i in (0, 1)
    )
    mus, gs = forward[0]
    w = mus / np.array(J)
    bound = 2000 * EPS * rate  # rounding over h, plus h^8
    assert abs(momentum_rate - np.cross(mus, w)).max() < bound * np.linalg.norm(mu)
    assert abs(attitude_rate - np.cross(gs, w[:, None, :])).max() < bound


# --- laws
# -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [name for name in REGIMES if "middle" not in name and "separatrix" not in name])
def test_flow_property(name):
    """From 0 to s, from there to s + t: the same as from 0 to s + t. (Next to the saddle, rounding at s would grow.)"""
    J, mu = REGIMES[name]
    s, t = np.array([3.7, -9.1]) / (top_rate(J, mu) or 1.0)
    there = exact_rigid_body(J, mu, attitude(), s)
    for a, b in zip(exact_rigid_body(J, *there, t), exact_rigid_body(J, mu, attitude(), s + t), strict=True):
        assert abs(a - b).max() < 300 * EPS * (abs(b).max() or 1.0)


@pytest.mark.parametrize("name", REGIMES)
def test_conserved_over_long_times(name):
    """Spatial momentum, |mu|, energy and orthogonality, to rounding at any time: none of them has a phase to lose."""
    J, mu = REGIMES[name]
    t = np.concatenate((np.linspace(-30, 30, 50), [1e4, -1e7, 1e12])) / (top_rate(J, mu) or 1.0)
    g = attitude()
    mus, gs = exact_rigid_body(J, mu, g, t)
    size = np.linalg.norm(mu)
    assert abs(gs @ gs.transpose(0, 2, 1) - np.eye(3)).max() < 10 * EPS
    assert abs(np.linalg.det(gs) - 1).max() < 10 * EPS
    assert abs(np.linalg.norm(mus, axis=1) - size).max() <= 4 * EPS * size
    assert abs(np.einsum("nij,nj->ni", gs, mus) - g @ mu).max() <= 10 * EPS * size
    energy = np.sum(mus**2 / np.array(J), axis=1)
    assert abs(energy - energy[25]).max() <= 20 * EPS * np.sum(np.square(mu)) / np.min(J)


@pytest.mark.parametrize("J, mu", [([2 / 3, 1, 2], [0.5, 0, 0.75**0.5]), ([3, 1, 2], [0.3, 1.5, -0.4])])
@pytest.mark.parametrize("periods", [1, 1000, 10**6, -(10**6)])
def test_long_times(J, mu, periods):
    """After a period the momentum is back, the body has turned about g mu by an angle; both from 30-digit integrals."""
    with mp.workdps(30):
        a, b, c = sorted(range(3), key=lambda i: J[i])
        Ja, Jb, Jc = (mp.mpf(J[i]) for i in (a, b, c))
        E2, G2 = (
            mp.fsum(mp.mpf(p) ** 2 / mp.mpf(j) for p, j in zip(mu, J, strict=True)),
            mp.fsum(mp.mpf(p) ** 2 for p in mu),
        )
        if E2 * Jb > G2:
            Ja, Jc = Jc, Ja
        # The momentum surrounds the axis c: mu_a = A cos th, mu_b = B sin th, th' = rate mu_c,
        # which is never zero.
        A2, B2 = (Ja * (E2 * Jc - G2) / (Jc - Ja), Jb * (E2 * Jc - G2) / (Jc - Jb))
        rate = mp.sqrt((Jc - Ja) * (Jc - Jb) / (Ja * Jb)) / Jc

        def mu_c(th):
            return mp.sqrt(G2 - A2 * mp.cos(th) ** 2 - B2 * mp.sin(th) ** 2)

        def turn(th):  # psi' of the frame with pole a
            y, z = B2 * mp.sin(th) ** 2, mu_c(th) ** 2
            return mp.sqrt(G2) * (y / Jb + z / Jc) / (y + z)

        quarters = mp.linspace(0, 2 * mp.pi, 9)
        period = mp.quad(lambda th: 1 / (rate * mu_c(th)), quarters)
        angle = mp.quad(lambda th: turn(th) / (rate * mu_c(th)), quarters)
        t = float(periods * period)
        # the part of the time that is not a whole number of periods
        late = float(t - periods * period)
        angle = float(mp.fmod(periods * angle, 2 * mp.pi))
    assert abs(momentum_period(J, mu) / float(period) - 1) < 4 * EPS
    start, g0 = exact_rigid_body(J, mu, attitude(), late)
    axis = attitude() @ mu / np.linalg.norm(mu)
    hat = np.cross(axis, np.eye(3)).T
    rotation = np.eye(3) + math.sin(angle) * hat + (1 - math.cos(angle)) * hat @ hat
    end, g = exact_rigid_body(J, mu, attitude(), t)
    growth = 1 + np.linalg.norm(np.divide(mu, J)) * abs(t)
    assert abs(end - start).max() < 5 * EPS * growth
    assert abs(g - rotation @ g0).max() < 5 * EPS * growth


def test_continuous_across_the_separatrix():
    """A step off the separatrix grows like exp(lam t) and no faster, on either side."""
    J, t = [2, 3, 6], np.linspace(0, 20, 41)
    on = exact_rigid_body(J, [1, -0.5, 1], np.eye(3), t)
    assert momentum_period(J, [1, -0.5, 1]) == math.inf
    for offset in (1e-9, -1e-9, 1e-13, -1e-13):
        off = exact_rigid_body(J, [1, -0.5, 1 + offset], np.eye(3), t)
        allowed = 5 * abs(offset) * np.exp(t * 1.5 / 3) + 100 * EPS
        assert (abs(on[0] - off[0]).max(axis=1) < allowed).all()
        assert (abs(on[1] - off[1]).max(axis=(1, 2)) < (1 + t) * allowed).all()


def test_period():
    assert [momentum_period(*REGIMES[name]) for name in ("sphere", "rest", "steady, middle axis")] == [0, 0, 0]
    assert momentum_period([1, 1, 2], [0.5, 0.3, 0.9]) == pytest.approx(2 * math.pi / 0.45, rel=4 * EPS)
    # A distance d from the middle axis: K = log(4/k') + O(k'^2), k' proportional to d, down to the
    # least d.
    for d in (1e-20, 1e-60):
        k1, lam = 2 * d / math.sqrt(3), math.sqrt(0.5 / 6)
        assert momentum_period([1, 2, 3], [0, 1, d]) == pytest.approx(4 * math.log(4 / k1) / lam, rel=10 * EPS)


# --- data as they come
# ------------------------------------------------------------------------------------------------


@pytest.mark.sample(8)
@pytest.mark.parametrize("name", REGIMES)
def test_vectorised_equals_scalar_bit_for_bit(name):
    J, mu = REGIMES[name]
    t = np.linspace(-50, 70, 37)
    mus, gs = exact_rigid_body(J, mu, attitude(), t)
    for i in (0, 11, 36):
        m, g = exact_rigid_body(J, mu, attitude(), t[i])
        assert (m.shape, g.shape) == ((3,), (3, 3))
        assert np.array_equal(m, mus[i])
        assert np.array_equal(g, gs[i])
    shaped = exact_rigid_body(J, mu, attitude(), t[:36].reshape(4, 9))
    assert np.array_equal(shaped[0].reshape(-1, 3), mus[:36])
    assert np.array_equal(shaped[1].reshape(-1, 3, 3), gs[:36])
    only, nothing = exact_rigid_body(J, mu, None, t)
    assert np.array_equal(only, mus)
    assert nothing is None


@pytest.mark.sample(2)
@pytest.mark.parametrize("inertia_unit, momentum_unit", [(-150, -110), (132, 60), (-900, 40), (3, 900)])
def test_units_that_are_powers_of_two_change_no_bit(inertia_unit, momentum_unit):
    t = np.array([-7.0, 0.0, 0.3, 1e5])
    for name in MOVING:
        J, mu = REGIMES[name]
        there = exact_rigid_body(
            np.ldexp(J, inertia_unit),
            np.ldexp(mu, momentum_unit),
            attitude(),
            np.ldexp(t, inertia_unit - momentum_unit),
        )
        here = exact_rigid_body(J, mu, attitude(), t)
        assert np.array_equal(np.ldexp(there[0], -momentum_unit), here[0]), name
        assert np.array_equal(there[1], here[1]), name


@pytest.mark.parametrize("inertia_unit, momentum_unit", [(1e-46, 1e-34), (1e40, 1e36), (1e-300, 1e-300)])
def test_molecules_and_planets(inertia_unit, momentum_unit):
    J, mu = np.array([1, 2, 3]) * inertia_unit, np.array([0.3, -0.4, 1.2]) * momentum_unit
    t = np.array([-3, 10.0]) * (inertia_unit / momentum_unit)
    size = np.array([1, 2, 3]), np.array([0.3, -0.4, 1.2])
    mus, gs = exact_rigid_body(J, mu, None, t)[0], exact_rigid_body(J, mu, attitude(), t)[1]
    here = exact_rigid_body(*size, attitude(), np.array([-3, 10.0]))
    assert abs(mus / momentum_unit - here[0]).max() < 50 * EPS
    assert abs(gs - here[1]).max() < 50 * EPS


@pytest.mark.parametrize("name", [name for name in REGIMES if "middle" not in name and "separatrix" not in name])
def test_full_inertia_is_the_principal_one_seen_from_turned_axes(name):
    J, mu = REGIMES[name]
    U, g = attitude(7), attitude()
    t = np.linspace(-12, 12, 9) / (top_rate(J, mu) or 1.0)
    turned = U @ np.diag(J) @ U.T
    mus, gs = exact_rigid_body((turned + turned.T) / 2, U @ mu, g @ U.T, t)
    expected = exact_rigid_body(J, mu, g, t)
    # the matrix knows its moments to eps of the largest
    rounding = 200 * EPS * np.max(J) / np.min(J)
    assert abs(mus @ U - expected[0]).max() <= rounding * (np.linalg.norm(mu) or 1.0)
    assert abs(gs @ U - expected[1]).max() < rounding


def test_diagonal_matrix_equals_its_diagonal():
    J, mu = REGIMES["unsorted"]
    for a, b in zip(
        exact_rigid_body(np.diag(J), mu, attitude(), 3.0), exact_rigid_body(J, mu, attitude(), 3.0), strict=True
    ):
        assert np.array_equal(a, b)


@pytest.mark.sample(5)
@pytest.mark.parametrize("J", [*itertools.product([1e-300, 1, 1e300], repeat=3), (1, 1 + EPS, 1 - EPS / 2)])
def test_finite_in_finite_out(J):
    t = np.array([0.0, 5e-324, 1e-9, -1.0, 1e9, -1e150, 1.7e308])
    for mu in itertools.product([0.0, 5e-324, -1e-200, 1e-20, 1.0], [0.0, -1e-155, 1e300], [0.0, 1.0, -1e-9, 1e300]):
        mus, gs = exact_rigid_body(J, mu, np.eye(3), t)
        assert np.isfinite(mus).all()
        assert np.isfinite(gs).all()
        assert abs(gs @ gs.transpose(0, 2, 1) - np.eye(3)).max() < 10 * EPS
        assert momentum_period(J, mu) >= 0


@pytest.mark.slow
def test_scipy_is_loaded_only_when_needed():
    code = "import sys, liemech.models.bodies.exact_rigid_body; assert 'scipy' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True, cwd=Path(__file__).parents[2])


@pytest.mark.parametrize("rests", [0, 1, 2])
def test_two_components_of_the_momentum_drive_the_third(rests: int) -> None:
    """mu' = mu x J^-1 mu, of the exact motion of a free body at a start without one component."""
    body, mu = lm.RigidBody([1.0, 1.5, 2.2]), np.array([0.4, -0.7, 0.9])
    mu[rests] = 0.0
    start, h = body.state(mu, np.eye(3)), 1e-3
    rate = (np.array(body.exact(start, h).mu) - np.array(body.exact(start, -h).mu)) / (2.0 * h)
    assert np.abs(rate - np.cross(mu, mu / [1.0, 1.5, 2.2])).max() < 1e-6
    assert abs(rate[rests]) > 0.05


BODIES = {
    "plain": ([1.0, 1.5, 2.0], [0.5, 0.0, 0.75**0.5]),
    "unsorted": ([3.0, 1.0, 2.0], [0.3, 1.5, -0.4]),
    "oblate": ([1.0, 1.0, 1.5], [0.5, 0.3, 0.9]),
    "near the separatrix": ([2.0, 3.0, 4.0], [1.0, -0.5, 0.8660254037844386]),
    "turned": ([[2.0, 0.1, 0.3], [0.1, 2.5, -0.2], [0.3, -0.2, 1.5]], [0.2, -0.7, 0.4]),
    "molecule": ([1e-46, 1.5e-46, 2e-46], [1e-34, 2e-34, 3e-34]),
}


@pytest.fixture
def fresh(monkeypatch: pytest.MonkeyPatch) -> row_driver.RowDriver:
    driver = row_driver.RowDriver(polhode.moved)
    monkeypatch.setattr(exact, "_MOVED", driver)
    return driver


@pytest.mark.compiled
@pytest.mark.parametrize("attitude", [True, False])
def test_native_code_gives_the_bits_of_numpy(
    attitude: bool, fresh: row_driver.RowDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    t = np.concatenate([np.linspace(-7.0, 30.0, 91), [0.0, 1e5, -1e9, 1e17, 1e290]])
    for J, mu in BODIES.values():
        body = lm.RigidBody(J)
        start = body.state(mu=mu, g=lm.SO3().random(3) if attitude else None)
        fresh.next = np.inf
        plain = body.exact(start, t)
        fresh.next, fresh.spent = -1.0, 1e9
        native = body.exact(start, t)
        assert fresh.kernels, "no native code was made"
        for name, values in plain.arrays.items():
            assert np.array_equal(values, native.arrays[name])
        monkeypatch.setattr(exact, "_along", lambda *_: pytest.fail("native code is there"))
        assert np.array_equal(body.exact(start, t).mu, plain.mu)
        monkeypatch.undo()
        monkeypatch.setattr(exact, "_MOVED", fresh)


@pytest.mark.compiled
def test_native_code_is_made_when_it_pays(fresh: row_driver.RowDriver, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[object] = []
    monkeypatch.setattr(kernel, "stored", lambda *_, **__: None)
    monkeypatch.setattr(kernel, "kernel", lambda *args, **__: made.append(args))
    body = lm.RigidBody([1.0, 1.5, 2.0])
    start = body.state(mu=[0.5, 0.2, 0.3])
    body.exact(start, np.linspace(0.0, 1.0, 50))
    assert not made and 0.0 < fresh.spent < batch.DISK
    fresh.spent = 2.0 * batch.WORTH
    body.exact(start, np.linspace(0.0, 1.0, 50))
    assert len(made) == 1


def test_few_times_and_none() -> None:
    body = lm.RigidBody([1.0, 1.5, 2.0])
    start = body.state(mu=[0.5, 0.2, 0.3], g=np.eye(3))
    many = body.exact(start, np.linspace(0.0, 3.0, 7))
    for n in (0, 1, 7):
        some = body.exact(start, np.linspace(0.0, 3.0, 7)[:n])
        assert np.array_equal(some.mu, many.mu[:n]) and np.array_equal(some.g, many.g[:n])
        assert some.g.shape == (n, 3, 3)


def test_results_belong_to_the_caller() -> None:
    """Nobody can write to them, and the next call does not either."""
    body = lm.RigidBody([1.0, 1.5, 2.0])
    start, t = body.state(mu=[0.5, 0.2, 0.3], g=np.eye(3)), np.linspace(0.0, 3.0, 50)
    first = body.exact(start, t)
    kept = first.g.copy()
    body.exact(body.state(mu=[0.1, -0.2, 0.3], g=np.eye(3)), t)
    assert np.array_equal(first.g, kept)
    with pytest.raises(ValueError, match="read-only"):
        first.g[0, 0, 0] = 7.0
