"""Exact free bodies and splittings of bodies in fields: exactness, orders, what is kept, and the coefficients."""

from __future__ import annotations

import functools
import itertools
import warnings
from typing import Any

import mpmath as mp
import numpy as np
import pytest
from scenes import (
    LAGRANGE,
    TOP,
    falling_body,
    hat,
    heavy_top,
    lagrange_top,
    named,
    numbers,
    orbiting_body,
    quiet_body,
    reference,
    rotation,
    same_bits,
    slope,
    slow,
)

import liemech as lm
from liemech.formulas import sin
from liemech.integrators.composition import Composition
from liemech.integrators.free_body.exact_free_body import ExactFreeBody
from liemech.integrators.free_body.moser_veselov import ExactMoserVeselov
from liemech.integrators.free_body.splitting import ThreeRotations
from liemech.integrators.kicks.kick_drift import KickDrift
from liemech.models.bodies.heavy_top import HeavyTop
from liemech.systems.mechanical import MechanicalSystem
from liemech.systems.potential import Force, NoPotential
from liemech.tableaus.splittings import (
    BLANES_CASAS_ESCORIHUELA8,
    BLANES_MOAN4,
    BLANES_MOAN6,
    BLANES_MOAN6_SHORT,
    SPLITTINGS,
    STRANG,
    SplittingTableau,
)

EXACT = ExactFreeBody()
EPS = np.finfo(float).eps


# ---------------------------------------------------------------- the exact free body


@pytest.mark.parametrize("name", ["seed", "unsorted", "axisymmetric"])
def test_the_reference_in_steps(name: str) -> None:
    """Momentum and attitude of a computation with 50 digits, in one step and in many."""
    data = reference(f"rigid_body_{name}")
    body = quiet_body(numbers(data["J"]))
    start = body.state(numbers(data["pi0"]), numbers(data["R0"]))
    for at in data["samples"][1:]:
        t = float(at["t"])
        turn = 1.0 + t * float(np.linalg.norm(body.velocity(np.array(start.mu))))
        for steps in (1, 50):
            run = lm.integrate(body, EXACT, start, h=t / steps, steps=steps, compiled=False)
            assert np.abs(run.mu[-1] - numbers(at["pi"])).max() < 4 * EPS * turn
            assert np.abs(run.g[-1] - numbers(at["R"])).max() < 6 * EPS * turn


MOMENTS = {
    "1 < 2 < 3": [1.0, 1.6, 2.3],
    "2 < 3 < 1": [2.3, 1.0, 1.6],
    "2 < 1 < 3": [1.6, 1.0, 2.3],
    "sphere": [1.3, 1.3, 1.3],
    "disc": [1.0, 1.0, 2.0],
    "rod": [1.0, 1.0, 0.02],
    "nearly symmetric": [1.0, 1.0 + 1e-9, 1.7],
    "no mass has them": [2 / 3, 1.0, 2.0],
}


def motion(J: Any, mu: Any, times: list[float], terms: int = 32) -> list[tuple[np.ndarray, np.ndarray]]:
    """Momentum and displacement by their power series, in 30 digits."""
    with mp.workdps(30):
        K, m, g = [1 / mp.mpf(float(j)) for j in J], [[mp.mpf(float(x)) for x in mu]], [mp.eye(3)]
        for k in range(terms):
            w = [[x * y for x, y in zip(K, row, strict=True)] for row in m]
            pairs = [(m[j], w[k - j]) for j in range(k + 1)]
            m.append([sum(x[a] * y[b] - x[b] * y[a] for x, y in pairs) / (k + 1) for a, b in ((1, 2), (2, 0), (0, 1))])
            g.append(sum((g[j] * mp.matrix(hat(w[k - j]).tolist()) for j in range(k + 1)), mp.zeros(3)) / (k + 1))
        ends = []
        for t in times:
            mu_t = [float(mp.polyval([row[i] for row in reversed(m)], t)) for i in range(3)]
            g_t = [[float(mp.polyval([x[i, j] for x in reversed(g)], t)) for j in range(3)] for i in range(3)]
            ends.append((np.array(mu_t), np.array(g_t)))
    return ends


def starts_of_all_kinds(J: Any) -> list[np.ndarray]:
    """Generic, on an axis, near each axis, and, if there is one, on the separatrix |mu|^2 = 2 E J_b and beside it."""
    rng = np.random.default_rng(4)
    starts = [*rng.normal(size=(2, 3)), np.eye(3)[0], *(np.eye(3) + 1e-7), np.eye(3)[1] + 1e-3 * rng.normal(size=3)]
    J = np.array(J)
    a, b, c = np.argsort(J)
    if J[a] < J[b] < J[c]:
        separatrix = np.zeros(3)
        separatrix[[a, c]] = np.sqrt([J[a] * (J[c] - J[b]), J[c] * (J[b] - J[a])])
        separatrix[b] = 0.4
        starts += [separatrix, separatrix * (1.0 + 1e-8 * np.eye(3)[a])]
    return starts


@pytest.mark.parametrize("moments", MOMENTS.values(), ids=MOMENTS)
def test_a_step_is_exact(moments: list[float]) -> None:
    """To a rounding error of what the step adds, whatever the motion."""
    body = quiet_body(moments)
    for mu in starts_of_all_kinds(moments):
        speed = float(np.linalg.norm(body.velocity(mu)))
        times = [h / speed for h in (1e-3, 0.2, -0.8)]
        for h, (end, g) in zip(times, motion(moments, mu, times), strict=True):
            run = lm.integrate(body, EXACT, body.state(mu, np.eye(3)), h=h, steps=1, compiled=False)
            size = float(np.linalg.norm(mu))
            assert np.abs(run.mu[-1] - end).max() < (1.0 + 2.0 * abs(h) * speed) * EPS * size
            assert np.abs(run.g[-1] - g).max() < (1.0 + 2.0 * abs(h) * speed) * EPS


@pytest.mark.parametrize("h", [3.0, -20.0])
def test_long_steps_are_made_in_parts(h: float) -> None:
    for moments in ([1.0, 1.6, 2.3], [1.0, 1.0, 2.0], [1.3, 1.3, 1.3], [0.3, 1.0, 1.1]):
        body = quiet_body(moments)
        for mu in np.random.default_rng(4).normal(size=(3, 3)):
            start = body.state(mu, np.eye(3))
            run, exact = (lm.integrate(body, EXACT, start, h=h, steps=1, compiled=False), body.exact(start, h))
            turn = abs(h) * float(np.linalg.norm(body.velocity(mu)))
            assert np.abs(run.mu[-1] - exact.mu).max() < 4 * EPS * (1 + turn) * np.linalg.norm(mu)
            assert np.abs(run.g[-1] - exact.g).max() < 4 * EPS * (1 + turn)


def test_a_matrix_of_inertia() -> None:
    """The same body in turned axes moves as it did."""
    rng = np.random.default_rng(1)
    U, J, mu = rotation(rng), np.array([1.0, 1.6, 2.3]), np.array([0.4, 0.9, -0.3])
    turned = U @ np.diag(J) @ U.T
    body, other = lm.RigidBody(J), lm.RigidBody(0.5 * (turned + turned.T))
    for h in (0.01, 0.3, -2.0, 9.0):
        exact = body.exact(body.state(mu, np.eye(3)), h)
        run = lm.integrate(other, EXACT, other.state(U @ mu, U.T), h=h, steps=1, compiled=False)
        assert np.abs(run.mu[-1] - U @ exact.mu).max() < 2e-15 * (1 + abs(h))
        assert np.abs(run.g[-1] - exact.g @ U.T).max() < 4e-15 * (1 + abs(h))


def test_the_angle_about_the_momentum_is_the_same_all_along_an_orbit() -> None:
    """By the closed form: g is the least rotation from e(h) to e, (1 + e.e(h), e(h) x e), and then
    (cos, sin e)(psi/2) about e.
    """
    from liemech.models.bodies.exact_rigid_body import exact_rigid_body

    J, h, mu0 = [1.0, 1.6, 2.3], 0.8, np.array([0.4, 0.9, -0.3])
    along, _ = exact_rigid_body(J, mu0, None, np.linspace(0.0, 7.0, 9))
    angles = []
    for mu in along:
        end, g = exact_rigid_body(J, mu, np.eye(3), h)
        q = np.array(lm.SO3().quaternion(g))
        angles.append(2.0 * np.arctan2(q[:3] @ (mu + end) / (2.0 * np.linalg.norm(mu)), q[3]))
    assert np.ptp(angles) < 1e-14
    assert angles[0] > 0.1


@pytest.mark.compiled
def test_a_free_body_keeps_everything() -> None:
    body = lm.RigidBody([1.0, 1.6, 2.3])
    run = lm.integrate(body, EXACT, body.state([0.4, 0.9, -0.3], np.eye(3)), h=0.3, steps=100_000, every=1000)
    for name in ("energy", "Casimir 1", "spatial momentum"):
        assert run.drift()[name].largest < 1e-13
    exact = body.exact(body.state([0.4, 0.9, -0.3], np.eye(3)), run.t[-1])
    assert np.abs(run.mu[-1] - exact.mu).max() < 1e-9


def test_rest_and_units() -> None:
    """A body at rest stays; units that are powers of two change no bit."""
    body = lm.RigidBody([1.0, 1.6, 2.3])
    run = lm.integrate(body, EXACT, body.state([0.0, 0.0, 0.0], np.eye(3)), h=0.1, steps=3)
    assert np.array_equal(run.mu, np.zeros((4, 3)))
    assert np.array_equal(run.g[-1], np.eye(3))
    mu, unit = np.array([0.4, 0.9, -0.3]), 2.0**-120
    heavy = lm.RigidBody(unit * np.array([1.0, 1.6, 2.3]))
    a = lm.integrate(body, EXACT, body.state(mu, np.eye(3)), h=0.1, steps=20)
    b = lm.integrate(heavy, EXACT, heavy.state(unit * mu, np.eye(3)), h=0.1, steps=20)
    assert same_bits(a.mu, b.mu / unit)
    assert same_bits(a.g, b.g)


def test_too_many_turns() -> None:
    body = lm.RigidBody([1.0, 1.6, 2.3])
    with pytest.raises(lm.errors.NoConvergence, match=r"turns more than a hundred thousand times in it; try [0-9.e-]+"):
        lm.integrate(body, EXACT, body.state([1e9, 1.0, 1.0], np.eye(3)), h=10.0, steps=1)


# ---------------------------------------------------------------- splittings


SCENES = {f.__name__: f for f in (heavy_top, lagrange_top, falling_body)} | {
    "orbiting_body": lambda: orbiting_body(1.0)
}
EVERYWHERE = pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)

BY_ORDER = [KickDrift(order=p) for p in (2, 4, 6, 8)]
SHORT = KickDrift(tableau=BLANES_MOAN6_SHORT)
COMPOSED = [Composition(KickDrift(), order=p) for p in (4, 6, 8)]
ROTATIONS, ALGORITHM_1 = (KickDrift(ThreeRotations()), KickDrift(lm.CovariantVariational(lm.Cayley())))
COUNTS = {
    **dict(zip(BY_ORDER, [(100, 200, 400), (48, 64, 96), (16, 20, 24), (12, 16, 20)], strict=True)),
    SHORT: (16, 20, 30),
    **dict(zip(COMPOSED, [(40, 60, 80), (20, 30, 40), (20, 24, 28)], strict=True)),
    ROTATIONS: (200, 300, 400),
    ALGORITHM_1: (200, 300, 400),
}


QUICK = BY_ORDER[0], BY_ORDER[1], BY_ORDER[2], COMPOSED[0], ROTATIONS
"""Methods of which the order is measured whenever the tests run; that of the others is slow."""


@functools.cache
def fast_top() -> tuple[HeavyTop, lm.BodyState, lm.BodyState]:
    """A top with two turns ahead of it, and where it is after 3 s: by RKMK of order 8, step 1e-3."""
    top, slow = heavy_top()
    start = top.state(2.5 * np.array(slow.mu), np.array(slow.g))
    return (top, start, lm.integrate(top, lm.RKMK(order=8), start, h=1e-3, steps=3000, every=3000).last)


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("method", [m if m in QUICK else slow(m) for m in COUNTS], ids=named)
def test_orders_on_the_heavy_top(method: Any) -> None:
    top, start, end = fast_top()
    errors = []
    for n in COUNTS[method]:
        run = lm.integrate(top, method, start, h=3.0 / n, steps=n, compiled=True)
        errors.append([np.abs(run.mu[-1] - np.array(end.mu)).max(), np.abs(run.g[-1] - np.array(end.g)).max()])
        assert run.drift()["vertical momentum"].largest < 2e-14
    for error in np.array(errors).T:
        assert slope([3.0 / n for n in COUNTS[method]], error) == pytest.approx(method.order, abs=0.2)


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("method", [BY_ORDER[1], BY_ORDER[2]], ids=named)
def test_the_reference_digits(method: Any) -> None:
    """With 160 steps to t = 10, against 50 digits."""
    for scene, data in ((heavy_top, TOP), (lagrange_top, LAGRANGE)):
        top, start = scene()
        run = lm.integrate(top, method, start, h=1 / 32, steps=320, compiled=True)
        for at in data["samples"]:
            k, bound = round(32 * float(at["t"])), 1e-8 if method.order == 4 else 1e-12
            assert np.abs(run.mu[k] - numbers(at["pi"])).max() < bound
            assert np.abs(run.g[k][2] - numbers(at["Gamma"])).max() < bound


@EVERYWHERE
def test_order_four_in_other_fields(scene: Any) -> None:
    """Spinning tops, thrown and orbiting bodies, with inertia that is no diagonal."""
    system, start = scene()
    exact = lm.integrate(system, lm.RKMK(order=8), start, h=1 / 40, steps=40, every=40, compiled=False)
    errors = []
    for n in (8, 12, 16):
        run = lm.integrate(system, BY_ORDER[1], start, h=1 / n, steps=n, compiled=False)
        errors.append(max(np.abs(run.mu[-1] - exact.mu[-1]).max(), np.abs(run.g[-1] - exact.g[-1]).max()))
    size = max(np.abs(exact.mu[-1]).max(), np.abs(exact.g[-1]).max())
    assert errors[-1] < 1e-13 * size or slope([1 / 8, 1 / 12, 1 / 16], errors) == pytest.approx(4.0, abs=0.2)


def test_a_thrown_body_is_split_without_error() -> None:
    """Gravity does not turn it: Strang's splitting is the parabola itself."""
    body, start = falling_body()
    run = lm.integrate(body, BY_ORDER[0], start, h=0.25, steps=20, compiled=False)
    exact = body.exact(start, run.t)
    assert np.abs(run.g - exact.g).max() < 1e-13 * np.abs(exact.g).max()
    assert np.abs(run.mu - exact.mu).max() < 1e-13 * np.abs(exact.mu).max()


def test_without_a_field_only_the_drift_is_left() -> None:
    body = lm.RigidBody([1.0, 1.6, 2.3])
    field = MechanicalSystem(body, NoPotential())
    g = rotation(np.random.default_rng(2))
    a = lm.integrate(body, EXACT, body.state([0.4, 0.9, -0.3], g), h=0.1, steps=50, compensated=False)
    b = lm.integrate(field, BY_ORDER[0], field.state([0.4, 0.9, -0.3], g), h=0.1, steps=50, compensated=False)
    assert same_bits(a.mu, b.mu)
    assert same_bits(a.g, b.g)


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("method", [BY_ORDER[1], ROTATIONS, *(slow(m) for m in (BY_ORDER[0], BY_ORDER[2]))], ids=named)
def test_energy_is_bounded_and_the_vertical_momentum_kept(method: Any) -> None:
    top, start = heavy_top()
    run = lm.integrate(top, method, start, h=0.1, steps=100_000, every=20)
    energy = np.abs(top.energy(run.mu, run.g) - float(TOP["energy"]))
    assert energy[2500:].max() <= 1.1 * energy[:2500].max() < {2: 2e-2, 4: 1e-6, 6: 1e-9}[method.order]
    vertical = np.einsum("ni,ni->n", run.mu, run.g[:, 2, :])
    assert np.abs(vertical - float(TOP["vertical_momentum_pi_dot_Gamma"])).max() < 1e-12


@pytest.mark.slow
@pytest.mark.compiled
def test_long_steps_compile_too() -> None:
    for body in (lm.RigidBody([1.0, 1.6, 2.3]), lm.RigidBody([[1.0, 0.1, 0.0], [0.1, 1.6, 0.2], [0.0, 0.2, 2.3]])):
        start = body.state([0.4, 0.9, -0.3], np.eye(3))
        for h in (0.1, 11.0):
            plain, native = (lm.integrate(body, EXACT, start, h=h, steps=10, compiled=c) for c in (False, True))
            assert same_bits(plain.mu, native.mu)
            assert same_bits(plain.g, native.g)


@pytest.mark.slow
@pytest.mark.parametrize("compiled", [False, pytest.param(True, marks=pytest.mark.compiled)])
def test_ensembles_are_single_runs(compiled: bool) -> None:
    """Members that need one part a step beside those that need many, and one at rest."""
    rng = np.random.default_rng(6)
    top, _ = heavy_top()
    mu, g = (np.array([0.0, 0.3, 1.0, 9.0, 40.0])[:, None] * rng.normal(size=(5, 3)), lm.SO3().random(rng, 5))
    for system, method in ((top, BY_ORDER[0]), (top.body, EXACT)):
        many = lm.integrate(system, method, system.state(mu, g), h=0.2, steps=20, compiled=compiled)
        for i in range(5):
            one = lm.integrate(system, method, system.state(mu[i], g[i]), h=0.2, steps=20, compiled=False)
            assert same_bits(np.ascontiguousarray(many.mu[:, i]), one.mu)
            assert same_bits(np.ascontiguousarray(many.g[:, i]), one.g)


# ---------------------------------------------------------------- loads


@lm.record
class Drive(Force):
    """A torque that comes and goes, and friction."""

    friction: float

    def covector(self, t: float, xi: lm.Vec, g: Any) -> lm.Vec:
        return lm.vec(0.0, 0.3 * sin(2.0 * t), 0.0) - self.friction * xi


@pytest.mark.slow
@pytest.mark.parametrize(("friction", "order"), [(0.0, 4), (0.2, 2)])
def test_orders_under_a_load(friction: float, order: int) -> None:
    """A driven top keeps the order, one with friction does not."""
    top, start = heavy_top()
    system = HeavyTop(top.inertia, top.weight, top.centre, load=Drive(friction))
    exact = lm.integrate(system, lm.RKMK(order=8), start, h=1 / 40, steps=80, every=80, t0=0.3, compiled=False)
    errors = []
    for n in (24, 32, 48):
        run = lm.integrate(system, BY_ORDER[1], start, h=2 / n, steps=n, t0=0.3, compiled=False)
        errors.append(max(np.abs(run.mu[-1] - exact.mu[-1]).max(), np.abs(run.g[-1] - exact.g[-1]).max()))
    assert slope([1 / 24, 1 / 32, 1 / 48], errors) == pytest.approx(order, abs=0.2)
    home = lm.integrate(system, BY_ORDER[1], run.last, h=-2 / n, steps=n, t0=2.3, compiled=False)
    assert np.abs(home.mu[-1] - np.array(start.mu)).max() < 1e-12


@lm.record
class Felt(Force):
    """Friction that is felt where the table is not zero."""

    strength: lm.PiecewisePolynomial

    def covector(self, t: float, xi: lm.Vec, g: Any) -> lm.Vec:
        return -self.strength(t) * xi


LATER = lm.PiecewisePolynomial.linear([5.0, 6.0, 7.0], [1.0, 1.0, 1.0])


@pytest.mark.parametrize("bodies", [None, 3])
@pytest.mark.parametrize(
    ("load", "method", "told"),
    [
        (Drive(0.2), KickDrift(order=4), True),
        (Drive(0.2), KickDrift(order=8), True),
        (Drive(0.2), KickDrift(), False),
        (Drive(0.0), KickDrift(order=4), False),
        (Drive(0.2), lm.Composition(KickDrift(), order=4), False),
        (Felt(LATER), KickDrift(order=4), True),
    ],
    ids=lambda x: type(x).__name__ if isinstance(x, Force) else None,
)
def test_an_order_that_friction_takes_away_is_told(
    load: Force, method: lm.Method, told: bool, bodies: int | None
) -> None:
    top, start = heavy_top()
    system = HeavyTop(top.inertia, top.weight, top.centre, load=load)
    if bodies:
        start = system.state(np.tile(start.mu, (bodies, 1)), np.array(start.g))
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        lm.integrate(system, method, start, h=0.01, steps=1, t0=5.0, compiled=False)
    assert ["is of order 2 under" in str(w.message) for w in seen] == [True] * told


# ---------------------------------------------------------------- coefficients


TABLEAUS = pytest.mark.parametrize("tableau", SPLITTINGS.values(), ids=lambda t: t.name)


@TABLEAUS
def test_a_splitting_has_the_order_it_claims_and_no_more(tableau: SplittingTableau) -> None:
    tableau.check()
    with pytest.raises(lm.errors.LawViolation, match=f"of order {tableau.order}, not {tableau.order + 1}"):
        SplittingTableau(
            tableau.name, tableau.order + 1, tableau.kicks, tableau.drifts, tableau.quadratic, "", tableau.symmetric
        )
    if tableau.quadratic:
        with pytest.raises(lm.errors.LawViolation, match=r"of order [24], not"):
            SplittingTableau(
                tableau.name, tableau.order, tableau.kicks, tableau.drifts, quadratic=tableau.order == 4
            ) if (tableau.order > 4) else SplittingTableau(tableau.name, 5, tableau.kicks, tableau.drifts)


def test_a_composition_of_strang_is_a_splitting() -> None:
    """Neighbouring half kicks join; its order does not need the special form of T."""
    from liemech.tableaus.compositions import KAHAN_LI6

    gamma = KAHAN_LI6.gamma
    halves = [0.0, *gamma, 0.0]
    kicks = [0.5 * (a + b) for a, b in itertools.pairwise(halves)]
    assert SplittingTableau("Kahan-Li 6", 6, kicks, gamma).stages == 9


def test_stages_and_reach() -> None:
    found = [(t.order, t.stages, round(t.reach, 2)) for t in SPLITTINGS.values()]
    assert found[:5] == [(2, 1, 1.0), (4, 6, 0.60), (6, 14, 0.31), (6, 11, 0.36), (8, 19, 0.42)]
    assert {(1, 1, 1.0), (3, 3, 1.0), (4, 6, 0.43), (6, 10, 0.43)} <= set(found[5:])
    assert BLANES_MOAN4.nodes[-1] == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize(
    ("error", "words", "arguments"),
    [
        (lm.errors.LawViolation, "drifts are .* not the same backwards", (2, (0.5, 0.0, 0.5), (0.5, 0.6))),
        (lm.errors.LawViolation, "is of order 0, not 2: the word B", (2, (0.5, 0.6, 0.5), (0.5, 0.5))),
        (lm.errors.LawViolation, "is of order 2, not 4", (4, (0.5, 0.5), (1.0,))),
        (lm.errors.InvalidInput, "one more finite number than drifts", (2, (0.5, 0.5), (0.5, 0.5))),
        (lm.errors.InvalidInput, "whole number from 1", (0, (0.5, 0.5), (1.0,))),
        (lm.errors.InvalidType, "kicks is a sequence of numbers", (2, "ab", (1.0,))),
    ],
)
def test_coefficients_that_cannot_be_meant(error: type[Exception], words: str, arguments: Any) -> None:
    with pytest.raises(error, match=words):
        SplittingTableau("spoilt", *arguments)


# ---------------------------------------------------------------- refusals


def test_methods_that_cannot_be_meant() -> None:
    body = lm.RigidBody([1.0, 1.6, 2.3])
    fitted = ExactMoserVeselov.of(body, body.state([0.4, 0.9, -0.3]), 0.1)
    for make, words in (
        (lambda: KickDrift(fitted), "fitted to one orbit.*ExactFreeBody"),
        (lambda: KickDrift(3), "free must be a method"),
        (lambda: KickDrift(order=3), r"order is one of \[2, 4, 6, 8\]"),
        (
            lambda: KickDrift(ThreeRotations(), order=4),
            r"of order 2\. Composition\(KickDrift\(ThreeRotations\(\)\), order=4\)",
        ),
        (lambda: KickDrift(tableau=4), "tableau must be a SplittingTableau"),
    ):
        with pytest.raises((lm.errors.InvalidInput, lm.errors.InvalidType), match=words):
            make()


def test_systems_that_are_refused() -> None:
    top, start = heavy_top()
    body = top.body
    with pytest.raises(lm.errors.IncompatibleSystem, match=r"body in a field.*Without a field it is ExactFreeBody"):
        lm.integrate(body, KickDrift(), body.state(start.mu, start.g), h=0.1, steps=1)

    @lm.record
    class Quartic(lm.Hamiltonian):
        def energy(self, mu: lm.Vec) -> float:
            return 0.5 * lm.dot(mu, mu) + 0.1 * mu[0] ** 4

    quartic = lm.LiePoissonSystem(lm.SO3(), Quartic())
    with pytest.raises(lm.errors.IncompatibleSystem, match="not quadratic"):
        EXACT.require(quartic)
    free = Composition(lm.LiePoissonHamiltonJacobi(order=4), order=6)
    with pytest.raises(lm.errors.IncompatibleSystem, match="quadratic in the momentum"):
        KickDrift(free, order=4).require(MechanicalSystem(quartic, NoPotential()))
    with pytest.raises(lm.errors.IncompatibleSystem, match="does not turn"):
        EXACT.require(lm.LiePoissonSystem(lm.SO(4), lm.KineticEnergy(np.ones(6))))
    fish = lm.models.KirchhoffBody([1.0, 1.6, 2.3, 1.0, 1.1, 1.2])
    with pytest.raises(lm.errors.IncompatibleSystem, match="as in a fluid"):
        EXACT.require(fish)
    with pytest.raises(lm.errors.IncompatibleSystem, match="needs a system"):
        EXACT.require(3)
    with pytest.raises(lm.errors.IncompatibleSystem, match=r"in a field.*KickDrift\(ExactFreeBody\(\)\) splits"):
        EXACT.require(top)
    for method in (KickDrift(), lm.LieVerlet()):
        with pytest.raises(lm.errors.IncompatibleSystem, match=r"HeavyTop\(.*the same top as a body in a field"):
            method.require(top.reduced)


def test_faces() -> None:
    assert repr(KickDrift(order=4)) == "KickDrift(ExactFreeBody(), order=4)"
    assert KickDrift(ThreeRotations()).name == "Strang splitting (Three rotations)"
    assert eval(repr(KickDrift(order=6)), {"KickDrift": KickDrift, "ExactFreeBody": ExactFreeBody}) == KickDrift(
        order=6
    )
    assert repr(BLANES_MOAN6) == "SplittingTableau(Blanes-Moan 6: order 6, 14 kicks)"
    assert KickDrift().tableau == STRANG
    assert KickDrift(order=8).tableau == BLANES_CASAS_ESCORIHUELA8
    assert KickDrift().symmetric
    assert KickDrift().symplectic
    assert not KickDrift(lm.RKMK(order=4)).symplectic


@lm.record
class DragOfABall(lm.Force):
    """That of a ball in air, c |xi| xi."""

    c: float

    def covector(self, t: float, xi: lm.Vec, g: Any) -> lm.Vec:
        return -(self.c * lm.norm(xi)) * xi


@lm.record
class WeightOfABall(lm.Potential):
    def energy(self, g: Any) -> float:
        return 9.81 * g[2]


@pytest.mark.xfail(strict=True, raises=lm.errors.NotFinite, reason="|xi| has no derivative at rest")
def test_a_ball_that_is_let_go_in_air() -> None:
    """Its speed is sqrt(g/c) tanh(sqrt(g c) t), with an error of the order 2."""
    body = lm.LiePoissonSystem(lm.VectorSpace(3), lm.KineticEnergy([1.0, 1.0, 1.0]))
    ball = lm.MechanicalSystem(body, WeightOfABall(), load=DragOfABall(0.5))
    run = lm.integrate(ball, lm.KickDrift(), ball.state(mu=[0.0, 0.0, 0.0], g=[0.0, 0.0, 0.0]), h=0.01, steps=100)
    assert abs(run.mu[-1, 2] / -(np.sqrt(9.81 / 0.5) * np.tanh(np.sqrt(9.81 * 0.5))) - 1.0) < 1e-4
