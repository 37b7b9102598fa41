"""The loop: whatever way it is run, the bits are the same; whatever goes wrong, what was reached is kept."""

from __future__ import annotations

import importlib
import os
import signal
import subprocess
import sys
import threading
import time
import warnings
from typing import Any

import numpy as np
import pytest
from scenes import CAYLEY, EXP, METHODS, RKMK4, asymmetric_body, named, quiet_body, same_bits, seed_body

import liemech as lm

COMPILED = [False, pytest.param(True, marks=pytest.mark.compiled)]
ALL = pytest.mark.parametrize("method", METHODS, ids=named)
BOTH_WORLDS = pytest.mark.parametrize("compiled", COMPILED, ids=["plain", "compiled"])


def same_run(a: lm.Trajectory, b: lm.Trajectory) -> bool:
    attitude = a.g is b.g is None or same_bits(a.g, b.g)  # type: ignore[arg-type]
    return same_bits(a.t, b.t) and same_bits(a.mu, b.mu) and attitude


def many(body: lm.RigidBody, attitude: bool = True) -> lm.BodyState:
    """Fifteen bodies, no multiple of any number of lanes: slow ones, and some that turn so fast
    that they leave the polynomials.
    """
    rng = np.random.default_rng(8)
    mu = rng.normal(size=(15, 3))
    mu *= np.geomspace(1e-6, 12.0, 15)[:, None] / np.linalg.norm(mu, axis=1, keepdims=True)
    mu[5] = 0.0
    mu[6] = [0.0, 0.0, 1.0]
    return body.state(mu, body.group.exp(rng.normal(size=(15, 3))) if attitude else None)


def alone(body: lm.RigidBody, starts: lm.BodyState, i: int) -> lm.BodyState:
    return body.state(starts.mu[i], None if starts.g is None else starts.g[i])


# ---------------------------------------------------------------- the same bits


@pytest.mark.parametrize("attitude", [True, False], ids=["mu, g", "mu"])
@ALL
@BOTH_WORLDS
def test_a_member_of_an_ensemble_is_the_body_alone(method: lm.Method, attitude: bool, compiled: bool) -> None:
    """Bit for bit, and although Newton's method takes longer for some, and some need the C library's sine."""
    body, _ = asymmetric_body()
    starts = many(body, attitude)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # for exp some of these steps are too large
        together = lm.integrate(body, method, starts, h=0.4, steps=12, compiled=compiled)
    assert not together.stopped or method is EXP
    for i in range(15):
        if i in together.stopped:
            continue
        one = lm.integrate(body, method, alone(body, starts, i), h=0.4, steps=12, compiled=False)
        assert same_bits(together.mu[:, i], one.mu)
        if attitude:
            assert same_bits(together.g[:, i], one.g)


@pytest.mark.slow
def test_the_progress_bar_changes_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    body, start = asymmetric_body()
    runs = [lm.integrate(body, RKMK4, start, h=0.1, steps=1000, progress=p, compiled=False) for p in (True, False)]
    assert same_run(*runs)
    assert "step" in capsys.readouterr().err


@ALL
@BOTH_WORLDS
def test_momentum_alone_has_the_same_bits(method: lm.Method, compiled: bool) -> None:
    body, start = asymmetric_body()
    full = lm.integrate(body, method, start, h=0.3, steps=40, compiled=compiled)
    for options in ({"record": ("mu",)}, {"record": "mu"}, {"record": ["mu"]}):
        assert same_bits(lm.integrate(body, method, start, h=0.3, steps=40, compiled=compiled, **options).mu, full.mu)
    bare = lm.integrate(body, method, body.state(start.mu), h=0.3, steps=40, compiled=compiled)
    assert same_bits(bare.mu, full.mu)
    assert bare.g is None


@lm.record
class Reduced(lm.Hamiltonian):
    """A heavy top as a body on the dual of se(3): momentum, and the vertical in the body."""

    inertia: lm.Vec
    weight: float

    def energy(self, mu: lm.Vec) -> float:
        m = lm.vec(mu[0], mu[1], mu[2])
        return 0.5 * lm.dot(m, m / self.inertia) + self.weight * mu[5]


@lm.record
class Crank(lm.ConstrainedSystem):
    """A slider at x that a heavy crank at the angle phi pushes on a spring: a length and an angle."""

    degrees = 2

    mass: float
    length: float
    stiffness: float

    @property
    def unit_blocks(self) -> tuple[int, ...]:
        return 1, 1, 1, 1

    def energy(self, q: lm.Vec, p: lm.Vec) -> float:
        turning = 0.5 * p[1] ** 2 / (self.mass * self.length**2)
        return 0.5 * p[0] ** 2 / self.mass + turning + 0.5 * self.stiffness * q[0] ** 2

    def constraint(self, q: lm.Vec) -> lm.Vec:
        return lm.vec(q[0] / self.length - np.sin(q[1]) - 0.2 * np.cos(q[1]))


def in_units(scene: str, mass: float, length: float, second: float) -> tuple[Any, Any, Any]:
    """A system, a start, and the units of the parts of its state."""
    inertia, push = mass * length**2, mass * length / second**2
    turn = inertia / second
    moments = inertia * np.array([1.0, 1.0, 0.5])
    if scene == "top":
        top = lm.models.LagrangeTop(push, moments[0], moments[2], length)
        g = lm.SO3().exp([0.3, 0.2, 0.1])
        return top, top.state(turn * np.array([0.3, 0.1, 1.5]), g), {"mu": turn, "g": 1.0}
    if scene == "double pendulum":
        gravity = 9.8 * length / second**2
        links = lm.models.DoublePendulum(mass * np.array([1.0, 1.3]), length * np.array([1.0, 0.7]), gravity)
        start = links.state([0.5, -0.8], turn * np.array([0.3, 0.2]))
        return links, start, {"q": 1.0, "p": turn}
    if scene == "reduced top":
        units = np.repeat([turn, 1.0], 3)
        group = lm.SemidirectProduct(lm.SO3())
        reduced = lm.LiePoissonSystem(group, Reduced(moments, push * length))
        start = reduced.state(units * [0.3, 0.1, 1.5, 0.2, 0.3, 0.9])
        return reduced, start, {"mu": units}
    speed = length / second
    if scene == "body":
        body = lm.RigidBody(inertia * np.array([1.0, 1.5, 2.25]))
        g = lm.SO3().exp([0.3, 0.2, 0.1])
        return body, body.state(turn * np.array([0.5, 0.3, 0.8]), g), {"mu": turn, "g": 1.0}
    if scene == "Kepler":
        kepler = lm.Kepler(attraction=length**3 / second**2)
        start = kepler.state(length * np.array([0.75, 0.1]), speed * np.array([0.2, 1.2]))
        return kepler, start, {"q": length, "p": speed}
    if scene == "three bodies":
        three = lm.models.NBody(mass * np.array([1.0, 0.5, 0.25]), length**3 / second**2 / mass, 2)
        q, p = np.array([[1.0, 0.1, -0.8, 0.5, 0.1, -1.2], [0.1, 0.5, -0.2, -0.4, 0.15, 0.1]])
        return three, three.state(length * q, mass * speed * p), {"q": length, "p": mass * speed}
    if scene == "pendulum":
        pendulum = lm.models.Pendulum(1.3 * mass, 0.7 * length, 9.8 * length / second**2)
        return pendulum, pendulum.state([0.7], [0.2 * turn]), {"q": 1.0, "p": turn}
    if scene == "spherical pendulum":
        on_sphere = lm.SphericalPendulum(1.3 * mass, length, 9.8 * length / second**2)
        start = on_sphere.state(length * np.array([0.6, 0.0, -0.8]), mass * speed * np.array([0.4, 0.5, 0.3]))
        return on_sphere, start, {"q": length, "p": mass * speed}
    if scene == "crank":
        crank = Crank(mass, length, mass / second**2)
        start = crank.consistent([0.5 * length, 0.4], turn * np.array([0.0, 1.3]))
        return (crank, start, {"q": np.array([length, 1.0]), "p": turn * np.array([1.0 / length, 1.0])})
    units = np.repeat([turn, turn / length], 3)
    body = lm.models.KirchhoffBody(np.array([*moments, mass, 1.2 * mass, 1.7 * mass]))
    return body, body.state(units * [0.3, 0.1, 1.5, 0.2, 0.3, 0.9]), {"mu": units}


@pytest.mark.parametrize(
    ("scene", "method"),
    [
        ("top", lm.RKMK(tableau=lm.tableaus.IMPLICIT_MIDPOINT)),
        ("double pendulum", lm.RKMK(tableau=lm.tableaus.gauss(2))),
        ("top", lm.RKMK(tableau=lm.tableaus.gauss(2))),
        ("top", lm.KickDrift(order=4)),
        ("double pendulum", lm.SymmetricHamiltonJacobi(order=4)),
        ("reduced top", lm.RKMK(tableau=lm.tableaus.gauss(3))),
        ("submarine", lm.FirstKindHamiltonJacobi(order=2)),
        ("submarine", lm.GalerkinVariational(order=4)),
        ("submarine", lm.GalerkinVariational(order=8, retraction=lm.Cayley())),
        ("crank", lm.LobattoPair(order=6)),
        ("submarine", lm.LiePoissonHamiltonJacobi(order=4)),
        ("submarine", lm.Taylor(order=8)),
        pytest.param("reduced top", lm.FirstKindHamiltonJacobi(order=2), marks=pytest.mark.slow),
    ],
)
def test_units_of_mass_length_and_time_change_no_bit(scene: str, method: lm.Method) -> None:
    """Torques beside velocities, angles beside momenta: what stops an iteration compares each with its own."""
    system, start, _ = in_units(scene, 1.0, 1.0, 1.0)
    run = lm.integrate(system, method, start, h=0.1, steps=6, compiled=False)
    for k, l, s in ((40, 0, 0), (0, -50, 0), (0, 45, 0), (0, 0, 40), (-30, 21, 13)):
        there, begin, units = in_units(scene, 2.0**k, 2.0**l, 2.0**s)
        other = lm.integrate(there, method, begin, h=0.1 * 2.0**s, steps=6, compiled=False)
        for name, unit in units.items():
            assert same_bits(other.states[name], unit * run.states[name]), (name, k, l, s)


MOVED = {
    "body": (
        *(lm.CovariantVariational(r) for r in (lm.Exponential(), lm.Cayley())), lm.MoserVeselov(),
        *(lm.RKMK(order=order) for order in (2, 3, 4, 5)), lm.RKMK(tableau=lm.tableaus.gauss(2)),
        lm.CommutatorFree(order=4), lm.ExactFreeBody(), lm.Isospectral(), lm.ImplicitMidpoint(), lm.SphericalMidpoint(),
        *(lm.LiePoissonHamiltonJacobi(order=order) for order in (2, 4, 6)), lm.FirstKindHamiltonJacobi(order=2),
        lm.GalerkinVariational(order=4), lm.Taylor(order=8), lm.Composition(lm.CovariantVariational(), order=4),
    ),
    "top": (
        lm.LieVerlet(), lm.KickDrift(order=4), lm.RKMK(order=4), lm.GalerkinVariational(order=4),
        lm.Taylor(order=6, retraction=lm.Exponential()),
        lm.RKMK(tableau=lm.tableaus.gauss(2)), lm.Composition(lm.LieVerlet(), order=4),
    ),
    "Kepler": (
        lm.StormerVerlet(), lm.SymplecticEuler(), lm.Splitting(order=4), lm.HamiltonJacobi(order=4),
        lm.SymmetricHamiltonJacobi(order=4), lm.RKMK(order=4), lm.RKMK(tableau=lm.tableaus.gauss(2)), lm.Taylor(order=10),
    ),
    "three bodies": (
        lm.StormerVerlet(), lm.Splitting(order=4), lm.RKMK(order=4), lm.RKMK(tableau=lm.tableaus.gauss(2)),
        lm.Taylor(order=6), lm.HamiltonJacobi(order=2),
    ),
    "pendulum": (
        lm.StormerVerlet(), lm.SymplecticEuler(), lm.Splitting(order=6), lm.HamiltonJacobi(order=3),
        lm.SymmetricHamiltonJacobi(order=4), lm.RKMK(order=4), lm.Taylor(order=8), lm.RKMK(tableau=lm.tableaus.gauss(3)),
    ),
    "double pendulum": (lm.HamiltonJacobi(order=2), lm.RKMK(order=4), lm.RKMK(tableau=lm.tableaus.gauss(2))),
    "spherical pendulum": (lm.RATTLE(), lm.LobattoPair(order=4), lm.ConstrainedEuler(), lm.Composition(lm.RATTLE(), order=4)),
    "reduced top": (lm.RKMK(order=4), lm.Taylor(order=6), lm.RKMK(tableau=lm.tableaus.gauss(2))),
    "submarine": (
        lm.RKMK(order=4), lm.CovariantVariational(), lm.GalerkinVariational(order=2), lm.LiePoissonHamiltonJacobi(order=2),
        lm.LiePoissonHamiltonJacobi(order=4), lm.Taylor(order=8), lm.RKMK(tableau=lm.tableaus.gauss(2)),
    ),
}  # fmt: skip
"""Models and methods whose units are changed at random."""


LAST_BITS = {"submarine"}
"""Where implicit methods stop by one norm of all components, and agree to rounding."""


def moved_in_units(seed: int, scene: str, method: lm.Method) -> str:
    """What differs in units of thirty decades, chosen at random, powers of two; nothing if it is
    the same motion, bit for bit, or to rounding where no more is promised.
    """
    rng = np.random.default_rng(seed)
    system, start, units = in_units(scene, 1.0, 1.0, 1.0)
    run = lm.integrate(system, method, start, h=0.05, steps=3, compiled=False)
    k, l, s = map(int, rng.integers(-50, 51, size=3))
    there, begin, units = in_units(scene, 2.0**k, 2.0**l, 2.0**s)
    other = lm.integrate(there, method, begin, h=0.05 * 2.0**s, steps=3, compiled=False)
    for name, unit in units.items():
        here, found = run.states[name], other.states[name] / unit
        if not same_bits(found, here):
            off = np.abs(found - here).max() / np.abs(here).max()
            if scene in LAST_BITS and off <= 1e-15:
                continue
            return f"{scene}, {method!r}, {name} in 2^({k}, {l}, {s}): off by {off:.1e}"
    return ""


@pytest.mark.sample(8)
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("scene, method", [(s, m) for s, methods in MOVED.items() for m in methods])
def test_units_of_thirty_decades(scene: str, method: lm.Method, seed: int) -> None:
    assert moved_in_units(seed, scene, method) == ""


@ALL
def test_layout_and_type_of_the_input_change_nothing(method: lm.Method) -> None:
    body, start = asymmetric_body()
    mu, g = np.tile(start.mu, (4, 1)), np.tile(np.array(start.g), (4, 1, 1))
    wanted = lm.integrate(body, method, body.state(mu, g), h=0.1, steps=5)
    backwards = np.ascontiguousarray(g[..., ::-1])[..., ::-1]
    for other in (body.state(np.asfortranarray(mu), backwards), body.state(mu.astype(">f8"), g.astype(">f8"))):
        assert same_run(lm.integrate(body, method, other, h=0.1, steps=5), wanted)
    integers = lm.integrate(body, method, body.state([1, 2, 3]), h=0.1, steps=5)
    assert same_run(integers, lm.integrate(body, method, body.state([1.0, 2.0, 3.0]), h=0.1, steps=5))


# ---------------------------------------------------------------- times and samples


@BOTH_WORLDS
def test_a_method_sees_these_times(compiled: bool) -> None:
    body, start = asymmetric_body()
    run = lm.integrate(body, Clock(), start, h=0.1, steps=700, every=7, t0=5.0, compiled=compiled)
    seen = run.mu[1:, 0]
    assert np.array_equal(seen, 5.0 + (np.arange(7, 701, 7) - 1) * 0.1)


@lm.record
class Clock(lm.Method):
    """Writes the time of the step in place of the momentum."""

    def step(self, system: lm.LiePoissonSystem, t: float, state: lm.BodyState, h: float) -> lm.BodyState:
        return lm.BodyState(lm.vec(t, h, 0.0), state.g)


@pytest.mark.parametrize(
    ("steps", "every", "numbers"),
    [(0, 1, [0]), (0, 5, [0]), (1, 5, [0, 1]), (10, 3, [0, 3, 6, 9, 10]), (10, 5, [0, 5, 10]), (10, 11, [0, 10])],
)
def test_samples_are_the_start_every_so_many_and_the_end(steps: int, every: int, numbers: list[int]) -> None:
    body, start = asymmetric_body()
    run = lm.integrate(body, RKMK4, start, h=0.25, steps=steps, every=every)
    assert np.array_equal(run.t, 0.25 * np.array(numbers))
    assert np.array_equal(run.mu[0], start.mu)
    assert run.steps == steps
    if steps:
        assert np.array_equal(run.last.mu, lm.integrate(body, RKMK4, start, h=0.25, steps=steps).mu[-1])


@ALL
@BOTH_WORLDS
def test_a_body_at_rest_stays_at_rest(method: lm.Method, compiled: bool) -> None:
    body, start = asymmetric_body()
    for size in (0.0, 5e-324):
        run = lm.integrate(body, method, body.state([size, 0, 0], start.g), h=0.5, steps=20, compiled=compiled)
        assert np.array_equal(run.mu, np.tile([size, 0, 0], (21, 1)))
        assert np.array_equal(run.g, np.tile(np.array(start.g), (21, 1, 1)))


# ---------------------------------------------------------------- failures


@lm.record
class Bounded(lm.Method):
    """Fails where its own counter reaches `limit`: by an error of its own, or by a number that is none."""

    limit: float
    how: str

    def step(self, system: lm.LiePoissonSystem, t: float, state: lm.BodyState, h: float) -> lm.BodyState:
        if state.mu[0] >= self.limit:
            if self.how == "raises":
                raise lm.errors.OutsideChart(f"the counter is at {state.mu[0]:g}")
            if self.how == "value":
                raise ValueError("a formula of mine")
            return lm.BodyState(state.mu / 0.0 if self.how == "divides" else state.mu * 1e300 * 1e300, state.g)
        return lm.BodyState(state.mu + lm.vec(1.0, 0.0, 0.0), state.g)


FAILURES = {
    "raises": (lm.errors.OutsideChart, "the counter is at 7"),
    "value": (lm.errors.IntegrationFailure, "ValueError: a formula of mine"),
    "divides": (lm.errors.NotFinite, "division by zero"),
    "overflows": (lm.errors.NotFinite, "overflowed"),
}


@pytest.mark.sample(2)
@pytest.mark.parametrize("every", [1, 3, 100])
@pytest.mark.parametrize("how", FAILURES)
@BOTH_WORLDS
def test_a_failing_step_leaves_what_was_reached(how: str, every: int, compiled: bool) -> None:
    body, start = asymmetric_body()
    kind, message = FAILURES[how]
    with pytest.raises(lm.errors.IntegrationFailure, match=message) as caught:
        rest = body.state([0, 0, 0], start.g)
        lm.integrate(body, Bounded(7.0, how), rest, h=0.5, steps=50, every=every, t0=1.0, compiled=compiled)
    error = caught.value
    assert type(error) is kind
    assert isinstance(error, ArithmeticError)
    assert "[step 8 of 50, t = 4.5;" in str(error)
    run = error.trajectory
    assert run.steps == 7
    assert np.array_equal(run.mu[:, 0], np.arange(0, 8, every))
    assert np.array_equal(run.t, 1.0 + 0.5 * np.arange(0, 8, every))
    assert len(run.g) == len(run.t)
    if how in ("raises", "value", "divides"):
        assert error.__cause__ is not None


@pytest.mark.sample(2)
@BOTH_WORLDS
@pytest.mark.parametrize("how", FAILURES)
@pytest.mark.parametrize("every", [1, 4])
def test_a_bad_member_harms_no_other(how: str, every: int, compiled: bool) -> None:
    """It stays where it was, says so once, and whatever lane it shares, the others keep their bits."""
    body, _ = asymmetric_body()
    method = Bounded(50.0, how)
    first = np.zeros((15, 3))
    first[:, 0] = np.linspace(0.0, 14.0, 15)
    good = lm.integrate(body, method, body.state(first), h=0.5, steps=30, every=every, compiled=compiled)
    first[4, 0], first[9, 0] = 38.0, 50.0
    with pytest.warns(
        RuntimeWarning, match="2 of 15 bodies stopped early: body 4 after 12 steps, body 9 after 0"
    ) as seen:
        run = lm.integrate(body, method, body.state(first), h=0.5, steps=30, every=every, compiled=compiled)
    assert len(seen) == 1
    assert seen[0].filename == __file__
    assert FAILURES[how][1].replace("at 7", "at 50") in str(seen[0].message)
    assert run.stopped.steps == {4: 12, 9: 0}
    others = [i for i in range(15) if i not in run.stopped]
    assert same_bits(run.mu[:, others], good.mu[:, others])
    numbers = np.array([*range(0, 30, every), 30])
    assert np.array_equal(run.mu[:, 4, 0], 38.0 + np.minimum(numbers, 12))
    assert np.array_equal(run.mu[:, 9, 0], np.full(len(numbers), 50.0))


@BOTH_WORLDS
def test_an_ensemble_of_which_all_fail_holds_numbers(compiled: bool) -> None:
    body, _ = asymmetric_body()
    with pytest.warns(RuntimeWarning, match="15 of 15 bodies"):
        run = lm.integrate(
            body, Bounded(3.0, "overflows"), body.state(np.zeros((15, 3))), h=1.0, steps=600, compiled=compiled
        )
    assert np.array_equal(run.mu[:, :, 0], np.minimum(np.arange(601), 3)[:, None] * np.ones(15))


@lm.record
class Window(lm.Method):
    """Fails between the times 3 and 4, and would go on afterwards if asked."""

    def step(self, system: lm.LiePoissonSystem, t: float, state: lm.BodyState, h: float) -> lm.BodyState:
        scale = 1e300 if 3.0 <= t < 4.0 and state.mu[1] > 0.0 else 1.0
        return lm.BodyState(state.mu * scale * scale + lm.vec(1.0, 0.0, 0.0), state.g)


@BOTH_WORLDS
def test_a_body_that_stopped_does_not_start_again(compiled: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Not even where the next piece of the run begins at a time at which its step would succeed."""
    body, _ = asymmetric_body()
    monkeypatch.setattr(sys.modules["liemech.simulation.runs.equal"], "PATIENCE", 0.0)
    starts = body.state([[0.0, 0.0, 0.0], [0.0, 1e10, 0.0]])
    with pytest.warns(RuntimeWarning, match="body 1 after 3 steps"):
        run = lm.integrate(body, Window(), starts, h=1.0, steps=200, compiled=compiled)
    assert run.stopped.steps == {1: 3}
    assert np.array_equal(run.mu[:, 0, 0], np.arange(201.0))
    assert np.array_equal(run.mu[:, 1, 0], np.minimum(np.arange(201.0), 3.0))


@pytest.mark.sample(4)
@ALL
@BOTH_WORLDS
def test_no_result_holds_what_is_no_number(method: lm.Method, compiled: bool) -> None:
    """Sizes from the least to the largest double: a motion, or an error."""
    for size in (1e-320, 1e-200, 1e-150, 1e-20, 1e20, 1e150, 1e200, 1.7e308):
        for h in (1e-3, 1.0):
            body = lm.RigidBody([1.0, 1.6, 2.3])
            start = body.state([size, -size, size], np.eye(3))
            try:
                run = lm.integrate(body, method, start, h=h, steps=5, compiled=compiled)
            except lm.errors.IntegrationFailure as failure:
                run = failure.trajectory
            assert np.isfinite(run.mu).all()
            assert np.isfinite(run.g).all()


# ---------------------------------------------------------------- Ctrl-C


@BOTH_WORLDS
def test_an_interrupted_run_ends_soon_and_keeps_its_samples(compiled: bool) -> None:
    body, start = asymmetric_body()
    steps, every = (10**10, 10**5) if compiled else (10**6, 10)
    lm.integrate(body, CAYLEY, start, h=0.1, steps=2 * every, every=every, compiled=compiled)  # nothing left to compile
    pressed: list[float] = []

    def press() -> None:
        time.sleep(0.6)
        pressed.append(time.process_time())
        signal.raise_signal(signal.SIGINT) if os.name == "nt" else os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=press)
    thread.start()
    with pytest.raises(lm.errors.IntegrationInterrupted, match=r"interrupted after \d+ of") as caught:
        lm.integrate(body, CAYLEY, start, h=0.1, steps=steps, every=every, compiled=compiled, progress=False)
    spent = time.process_time() - pressed[0]  # of the processor, whatever else the machine does
    thread.join()
    assert spent < 1.0
    assert isinstance(caught.value, KeyboardInterrupt)
    assert not isinstance(caught.value, Exception)  # `except Exception` must not swallow it
    run = caught.value.trajectory
    assert len(run) > 1
    assert run.steps < steps
    again = lm.integrate(body, CAYLEY, start, h=0.1, steps=round(run.t[1] / 0.1), every=10**5, compiled=compiled)
    assert same_bits(run.mu[1], again.mu[-1])
    assert np.isfinite(run.mu).all()
    assert run.stopped == {}


@pytest.mark.slow
def test_an_interrupted_program_ends_as_one() -> None:
    program = (
        "import liemech as lm, os, signal, threading\n"
        "body = lm.RigidBody([1, 1.5, 2])\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # as above
        "threading.Timer(1.0, lambda: os.kill(os.getpid(), "
        "signal.SIGINT)).start()\nlm.integrate(body, lm.RKMK(), body.state([1, 2, 3]), h=0.1, "
        "steps=10**11, every=10**11, progress=False)\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
    assert done.returncode != 0
    assert "IntegrationInterrupted" in done.stderr


def test_a_needle() -> None:
    """A needle of ratio 1e12 is stiff: the implicit method runs on, the explicit one leaves the
    motion (but not the orbit).
    """
    body = quiet_body([1e-12, 1.0, 1.0])
    start = body.state([0.0, 0.3, 0.4], np.eye(3))
    run = lm.integrate(body, CAYLEY, start, h=0.1, steps=50)
    assert np.abs(run.mu - run.mu[0]).max() < 1e-12
    assert run.drift()["energy"].largest < 1e-12
    wild = lm.integrate(body, RKMK4, start, h=0.1, steps=50)
    assert np.abs(np.linalg.norm(wild.mu, axis=1) - 0.5).max() < 1e-14
    assert wild.drift()["energy"].largest > 1e6


@pytest.mark.sample(3)
@pytest.mark.compiled
@ALL
@pytest.mark.parametrize("h", [0.1, 0.5])
def test_momentum_is_kept_to_rounding_over_many_steps(method: lm.Method, h: float) -> None:
    """|mu| and the spatial momentum after 10^5 steps: 1e-13 relative."""
    for body, start in (seed_body(), asymmetric_body()):
        run = lm.integrate(body, method, start, h=h, steps=10**5, every=10**3, compiled=True)
        size = np.linalg.norm(start.mu)
        assert np.abs(np.linalg.norm(run.mu, axis=1) / size - 1).max() < 1e-13
        assert np.abs(run.spatial_momentum - run.spatial_momentum[0]).max() < 1e-13 * size


def test_steps_to_a_time_for_methods_that_cannot_choose_them() -> None:
    body, start = asymmetric_body()
    for method in (RKMK4, lm.CrouchGrossman(order=3), CAYLEY):
        run = lm.integrate(body, method, start, h=0.1, t_end=2.0)
        assert same_run(run, lm.integrate(body, method, start, h=0.1, steps=20))
    adaptive = lm.integrate(body, lm.RKMK(order=5), start, h=0.1, t_end=2.0)  # its first step
    assert adaptive.h is None or not np.allclose(np.diff(adaptive.t), 0.1)
    with pytest.raises(lm.errors.InvalidInput, match="lead to t_end"):
        lm.integrate(body, RKMK4, start, h=0.3, t_end=2.0)


def test_a_method_made_anew_finds_the_plan_of_the_last() -> None:
    body, start = asymmetric_body()
    plans = importlib.import_module("liemech.simulation.integrate")._plans
    first = lm.integrate(body, lm.RKMK(order=4), start, h=0.1, steps=3)
    before = len(plans)
    again = lm.integrate(body, lm.RKMK(order=4), start, h=0.1, steps=3)
    assert len(plans) == before and same_run(first, again)
    # and by its numbers
    fitted = lm.ExactMoserVeselov.of(body, start, 0.1)
    other = lm.ExactMoserVeselov(0.1, fitted.constants, [(1.0 + 1e-9) * x for x in fitted.moments])
    runs = [lm.integrate(body, m, start, h=0.1, steps=3) for m in (fitted, other)]
    assert not np.array_equal(runs[0].mu, runs[1].mu)
