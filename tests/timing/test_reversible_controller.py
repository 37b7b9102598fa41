"""The reversible controller: order, symmetry and reversibility around any symmetric method, on any
system; what it refuses.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.errors import IncompatibleSystem, InvalidInput, InvalidTimeScale, InvalidType, StepTooSmall
from liemech.formulas import cos
from liemech.rooms.fictive_time.clocked import Clocked

KEPLER = lm.Kepler()
ORBIT = KEPLER.pericentre(0.6)
TIME = 7.3

TOP = lm.models.LagrangeTop(weight=1.0, transverse=1.0, axial=0.5, length=1.0)
FALLING = TOP.state(mu=[0.3, 0.0, 1.5], g=np.eye(3))


def verlet(sigma: Any = None) -> lm.ReversibleController:
    return lm.ReversibleController(lm.StormerVerlet(), lm.time_scales.DistancePower(1.5) if sigma is None else sigma)


def slopes(error: Callable[[float], float], h: float, count: int = 3) -> list[float]:
    errors = [error(h / 2**k) for k in range(count)]
    return [math.log2(a / b) for a, b in itertools.pairwise(errors)]


@lm.record
class Constant(lm.TimeScale):
    """Fixed steps, in another unit."""

    unit: float

    def value(self, system: Any, state: Any) -> float:
        return self.unit


@pytest.mark.parametrize(
    ("method", "order", "h"),
    [
        (verlet(), 2, 0.08),
        (verlet(lm.time_scales.EqualArc()), 2, 0.08),
        pytest.param(verlet(lm.time_scales.EqualChange()), 2, 0.08, marks=pytest.mark.slow),
        (verlet(lambda q, p: 1.0 / (1.0 + lm.dot(p, p))), 2, 0.08),
        (lm.ReversibleController(lm.Splitting(order=4), lm.time_scales.EqualArc()), 4, 0.16),
        (
            lm.ReversibleController(lm.Composition(lm.StormerVerlet(), order=4), lm.time_scales.DistancePower(2.0)),
            4,
            0.16,
        ),
        (lm.Composition(verlet(), order=4), 4, 0.16),
        (lm.ReversibleController(lm.Splitting(order=6), lm.time_scales.DistancePower(1.5)), 6, 0.32),
        (lm.Composition(verlet(), order=6), 6, 0.32),
    ],
    ids=lambda x: getattr(x, "name", None),
)
def test_order_at_a_physical_time(method: lm.Method, order: int, h: float) -> None:
    assert method.order == order
    exact = KEPLER.exact(ORBIT, TIME)

    def error(h: float) -> float:
        run = lm.integrate(KEPLER, method, ORBIT, h=h, t_end=TIME, compiled=False)
        assert run.t[-1] == TIME
        return float(np.abs(run.q[-1] - exact.q).max())

    assert min(slopes(error, h)) > order - 0.15


@pytest.mark.slow
@pytest.mark.parametrize(
    ("base", "order", "sigma"),
    [
        (lm.LieVerlet(), 2, lambda mu: 1.0 / (0.1 + lm.dot(mu, mu))),
        (lm.KickDrift(order=4), 4, lambda g: 1.0 + 0.5 * g[2, 2]),
        pytest.param(lm.LieVerlet(), 2, lm.time_scales.EqualArc(), marks=pytest.mark.slow),
        pytest.param(lm.KickDrift(order=4), 4, lambda mu: 1.0 / (0.1 + lm.dot(mu, mu)), marks=pytest.mark.slow),
        pytest.param(lm.KickDrift(order=4), 4, lm.time_scales.EqualArc(), marks=pytest.mark.slow),
    ],
)
def test_order_on_a_group(base: lm.Method, order: int, sigma: Any) -> None:
    method, t = lm.ReversibleController(base, sigma), 1.5

    def end(h: float) -> np.ndarray:
        run = lm.integrate(TOP, method, FALLING, h=h, t_end=t, compiled=False)
        assert run.drift()["vertical momentum"].verdict == "exact"
        return np.concatenate([run.mu[-1], run.g[-1].ravel()])

    exact = lm.integrate(TOP, lm.RKMK(order=8), FALLING, h=t / 40, steps=40, compiled=False)
    reference = np.concatenate([exact.mu[-1], exact.g[-1].ravel()])
    assert min(slopes(lambda h: float(np.abs(end(h) - reference).max()), 0.2)) > order - 0.2


def test_a_constant_sigma_is_no_transformation() -> None:
    run = lm.integrate(KEPLER, verlet(Constant(0.25)), ORBIT, h=0.5, steps=60)
    plain = lm.integrate(KEPLER, lm.StormerVerlet(), ORBIT, h=0.125, steps=60)
    assert np.array_equal(run.q, plain.q) and np.array_equal(run.p, plain.p) and np.array_equal(run.t, plain.t)
    assert np.array_equal(run.tau, 0.5 * np.arange(61)) and (run.z == 4.0).all()


@pytest.mark.parametrize(
    "method", [verlet(), verlet(lm.time_scales.EqualArc()), lm.Composition(verlet(), order=4)], ids=repr
)
def test_symmetric(method: lm.Method) -> None:
    """Steps with h, as many with -h from where they lead, with z and time: back at the start."""
    controller = getattr(method, "base", method)
    whole = Clocked(KEPLER, controller.sigma)
    start = whole.extended(ORBIT, 0.0)
    memory = method.start(whole, start, 0.1)
    for _ in range(40):
        memory = method.step(whole, 0.0, memory, 0.1)
    there = method.observe(memory)
    memory = method.start(whole, there, -0.1)
    for _ in range(40):
        memory = method.step(whole, 0.0, memory, -0.1)
    back = method.observe(memory)
    assert abs(there.q - start.q)[0] > 0.1
    for a, b in zip((*back.q, *back.p, back.time, back.z), (*start.q, *start.p, start.time, start.z)):
        assert abs(a - b) < 2e-13 * max(1.0, abs(b))


def test_reversible_where_sigma_does_not_tell_the_direction() -> None:
    """Forth, velocities turned back, forth again, turned once more: at the start, with z, if
    sigma(rho y) = sigma(y); not for a sigma that tells p from -p.
    """

    def turned(state: Any) -> Any:
        return type(state)(state.q, -state.p, state.time, state.z)

    for sigma, exact in (
        (lm.time_scales.DistancePower(1.5), True),
        (lm.time_scales.EqualArc(), True),
        (lambda p: 1.0 / (1.0 + lm.dot(p, p)), True),
        (lambda p: 1.0 / (2.0 + lm.formulas.tanh(p[0] + p[1])), False),
    ):
        method = verlet(sigma)
        whole = Clocked(KEPLER, method.sigma)
        start = whole.extended(ORBIT, 0.0)
        there = start
        for _ in range(2):
            memory = method.start(whole, there, 0.1)
            for _ in range(20):
                memory = method.step(whole, 0.0, memory, 0.1)
            there = turned(method.observe(memory))
        away = [*(there.q - start.q), *(there.p - start.p), there.z - start.z]
        if exact:
            assert max(abs(x) for x in away) < 1e-12
        else:
            assert max(abs(x) for x in away) > 1e-3


def test_energy_does_not_drift_and_z_follows_sigma() -> None:
    run = lm.integrate(KEPLER, verlet(), KEPLER.pericentre(0.9), h=8.4 / 500, steps=20_000, every=20)
    report = run.drift()["energy"]
    assert report.verdict == "bounded" and abs(report.slope) * report.duration < 1e-6
    assert np.abs(run.z * run.scale - 1.0).max() < 1e-3


def test_steps_by_the_printed_formula_collapse() -> None:
    """The slides print G(y_n) in the second half step too, (3.8) and (3.9): then z sigma = 1 is
    lost, and z falls below zero.
    """
    start, sigma = KEPLER.pericentre(0.9), lm.time_scales.DistancePower(2.0)
    whole, eps = Clocked(KEPLER, sigma), 0.06

    def smallest(printed: bool) -> float:
        method = lm.ReversibleController(lm.StormerVerlet(), sigma)
        memory, least = method.start(whole, whole.extended(start, 0.0), eps), math.inf
        for _ in range(400):
            before = memory
            try:
                memory = method.step(whole, 0.0, memory, eps)
            except InvalidTimeScale:
                return -1.0
            if printed:
                z = memory.z + 0.5 * eps * (before.rate - memory.rate)
                memory = dataclasses.replace(memory, z=z)
            state = method.observe(memory)
            least = min(least, state.z * sigma.value(KEPLER, whole.without(state)))
        return least

    assert smallest(printed=True) < 0.5 < 0.99 < smallest(printed=False)


# ------------------------------------------------------------------ native code and ensembles


def test_a_member_of_an_ensemble_moves_as_it_does_alone() -> None:
    factors = np.linspace(1.0, 1.1, 3)[:, None]
    starts = KEPLER.state(factors * np.array(ORBIT.q), np.repeat([np.array(ORBIT.p)], 3, axis=0))
    many = lm.integrate(KEPLER, verlet(), starts, h=0.05, steps=60, compiled=False)
    assert many.t.shape == (61, 3) and many.q.shape == (61, 3, 2) and many.z.shape == (61, 3)
    for i in range(3):
        one = lm.integrate(KEPLER, verlet(), KEPLER.state(starts.q[i], starts.p[i]), h=0.05, steps=60, compiled=False)
        assert np.array_equal(one.q, many.q[:, i]) and np.array_equal(one.t, many.t[:, i])
    assert many.drift()["energy"].verdict == "bounded"
    assert "3 bodies" in repr(many)


# ------------------------------------------------------------------ refusals


def test_what_is_refused() -> None:
    with pytest.raises(InvalidInput, match="not symmetric"):
        lm.ReversibleController(lm.SymplecticEuler(), lm.time_scales.EqualArc())
    with pytest.raises(InvalidInput, match="fixed steps"):
        lm.ReversibleController(verlet(), lm.time_scales.EqualArc())
    with pytest.raises(InvalidType, match="sigma is a TimeScale"):
        lm.ReversibleController(lm.StormerVerlet(), 3.0)  # type: ignore[arg-type]
    with pytest.raises(InvalidType, match="must be a method"):
        lm.ReversibleController(lm.StormerVerlet, lm.time_scales.EqualArc())  # type: ignore[arg-type]
    body = lm.RigidBody([1.0, 1.5, 2.0])
    spin = body.state(mu=[0.5, 0.0, 0.75**0.5])
    free = lm.CovariantVariational(lm.Cayley())
    for sigma in (lm.time_scales.DistancePower(), lm.time_scales.EqualPath()):
        with pytest.raises(IncompatibleSystem):
            lm.integrate(body, lm.ReversibleController(free, sigma), spin, h=0.1, steps=3)
    with pytest.raises(IncompatibleSystem, match="StormerVerlet"):
        lm.integrate(body, verlet(), spin, h=0.1, steps=3)
    with pytest.raises(InvalidInput, match="must be parts of the state"):
        lm.integrate(KEPLER, verlet(lambda x: x), ORBIT, h=0.1, steps=3)
    starts = KEPLER.state([ORBIT.q, ORBIT.q], [ORBIT.p, ORBIT.p])
    with pytest.raises(InvalidInput, match="energy of one start"):
        lm.integrate(KEPLER, verlet(lm.time_scales.EqualPath()), starts, h=0.1, steps=3)
    with pytest.raises(InvalidTimeScale, match="body 1"):
        two = KEPLER.state([[1.0, 0.0], [-1.0, 0.0]], [[0.0, 1.0], [0.0, 1.0]])
        lm.integrate(KEPLER, verlet(lambda q: q[0]), two, h=0.1, steps=3)


def test_sigma_and_z_must_be_positive() -> None:
    with pytest.raises(InvalidTimeScale, match=r"sigma\(q\) = -1 at the start"):
        lm.integrate(KEPLER, verlet(lambda q: -1.0), ORBIT, h=0.1, steps=3)
    with pytest.raises(InvalidTimeScale, match=r"try 1\.25") as failed:
        lm.integrate(KEPLER, verlet(lm.time_scales.DistancePower(2.0)), ORBIT, h=5.0, steps=30)
    run = failed.value.trajectory
    assert " tau = " in str(failed.value) and " t = " not in str(failed.value)
    # the time of what there is does not go back
    assert len(run) > 1 and (np.diff(run.t) > 0.0).all()
    with pytest.raises(InvalidTimeScale, match="at t = "):  # a sigma that jumps below zero
        lm.integrate(KEPLER, verlet(lambda q: lm.formulas.where(q[0] > 0.0, 1.0, -1.0)), ORBIT, h=0.1, t_end=9.0)


def test_which_options_a_run_takes() -> None:
    for wrong, words in (
        ({"h": 0.1, "t_end": 1.0, "rtol": 1e-3}, "rtol is not for steps in fictive time"),
        ({"h": 0.1}, "steps or t_end"),
        ({"t_end": 1.0}, "give h"),
        ({"h": -0.1, "t_end": 1.0}, "turn the sign of h"),
        ({"h": 0.1, "steps": 5, "t_eval": [0.0]}, "t_eval needs t_end"),
        ({"h": 0.1, "t_end": 1.0, "t_eval": [2.0]}, "not between"),
    ):
        with pytest.raises(InvalidInput, match=words):
            lm.integrate(KEPLER, verlet(), ORBIT, **wrong)
    with pytest.raises(StepTooSmall, match="5 steps led to") as failed:
        lm.integrate(KEPLER, verlet(), ORBIT, h=0.1, t_end=3.0, steps=5)
    assert failed.value.trajectory.steps == 5


# ---------------------------------------------------------------- driven systems


@lm.record
class Swing(lm.DrivenHamiltonianSystem):
    """A planar oscillator whose spring changes with time."""

    degrees = 2

    def energy(self, t: float, q: lm.Vec, p: lm.Vec) -> float:
        return 0.5 * lm.dot(p, p) + (0.5 + 0.3 * cos(2.0 * t)) * (q[0] ** 2 + 2.0 * q[1] ** 4)


@lm.record
class Pumped(lm.DrivenHamiltonian):
    """A body whose moments of inertia change with time."""

    def energy(self, t: float, mu: lm.Vec) -> float:
        a = 1.0 + 0.3 * cos(2.0 * t)
        return 0.5 * (a * mu[0] ** 2 + 0.6 * mu[1] ** 2 + 0.4 * mu[2] ** 2)


SWING, PUMPED = Swing(), lm.DrivenLiePoissonSystem(lm.SO3(), Pumped())
DRIVEN = [
    (SWING, SWING.state([1.0, 0.2], [0.3, 0.8]), lm.SymmetricHamiltonJacobi(order=4), sigma)
    for sigma in (lm.time_scales.EqualArc(), lm.time_scales.DistancePower(1.0), lambda q, p: 1.0 / (1.0 + lm.dot(p, p)))
] + [
    (PUMPED, PUMPED.state([0.4, 0.9, 1.1]), lm.LiePoissonHamiltonJacobi(order=4), sigma)
    for sigma in (lm.time_scales.EqualArc(), lambda mu: 1.0 / (1.0 + mu[0] * mu[0]))
]


@pytest.mark.slow
@pytest.mark.parametrize(("system", "start", "method", "sigma"), DRIVEN)
def test_on_driven_systems(system: Any, start: Any, method: lm.Method, sigma: Any) -> None:
    """Of its order at a physical time, from a time that is not zero; the scale of a sample is that
    of its time, and grows as `growth` says.
    """
    t0, t_end = 0.7, 1.9

    def exact(t: float, here: Any = start, now: float = t0) -> Any:
        run = lm.integrate(system, lm.RKMK(order=8), here, h=(t - now) / 40, steps=40, t0=now, compiled=False)
        return run.last

    wanted = np.concatenate([np.array(x) for x in exact(t_end).parts.values() if x is not None])
    controlled = lm.ReversibleController(method, sigma)

    def run(h: float) -> Any:
        return lm.integrate(system, controlled, start, h=h, t_end=t_end, t0=t0, compiled=False)

    def error(h: float) -> float:
        end = run(h).last
        got = np.concatenate([np.array(x) for x in end.parts.values() if x is not None])
        return float(np.abs(got - wanted).max())

    (slope,) = slopes(error, 0.1, 2)
    assert slope == pytest.approx(4.0, abs=0.6)
    found = run(0.1)
    bound, k = found.sigma, len(found) // 2
    t, e = float(found.t[k]), 1e-3
    here = system.state(*[x[k] for x in found.states.values()])
    sizes = [bound.value_at(system, t + s, exact(t + s, here, t)) for s in (-e, e)]
    assert bound.value_at(system, t, here) == pytest.approx(found.scale[k], rel=1e-14)
    assert (sizes[1] - sizes[0]) / (2.0 * e) == pytest.approx(bound.growth(system, t, here), rel=1e-5)


@pytest.mark.slow
@pytest.mark.compiled
def test_driven_systems_native_and_plain() -> None:
    for system, start, method, sigma in (DRIVEN[0], DRIVEN[3]):
        both = [
            lm.integrate(system, lm.ReversibleController(method, sigma), start, h=0.1, steps=5, compiled=c)
            for c in (False, True)
        ]
        for name, values in both[0].states.items():
            assert np.array_equal(values, both[1].states[name]), name
        assert np.array_equal(both[0].t, both[1].t)


def test_gauss_methods_on_vector_spaces_and_not_on_groups() -> None:
    """(3.8) for any symmetric Phi: those of Gauss are symmetric on R^n, of one stage everywhere."""
    gauss = lm.tableaus.gauss
    for stages in (1, 2):
        method = lm.ReversibleController(lm.RKMK(tableau=gauss(stages)), lm.time_scales.DistancePower(1.5))
        whole = Clocked(KEPLER, method.sigma)
        start = whole.extended(ORBIT, 0.0)
        state = start
        for h in (0.1, -0.1):
            memory = method.start(whole, state, h)
            for _ in range(10):
                memory = method.step(whole, 0.0, memory, h)
            state = method.observe(memory)
        assert max(abs(x) for x in (*(state.q - start.q), state.z - start.z)) < 1e-12
        exact = KEPLER.exact(ORBIT, 2.0).q
        errors = []
        for h in (0.2, 0.1):
            run = lm.integrate(KEPLER, method, ORBIT, h=h, t_end=2.0, compiled=False, progress=False)
            errors.append(np.abs(run.q[-1] - exact).max())
        assert math.log2(errors[0] / errors[1]) == pytest.approx(2 * stages, abs=0.3)
    sigma = lm.time_scales.EqualArc()
    lm.ReversibleController(lm.RKMK(tableau=gauss(1)), sigma).require(TOP)
    with pytest.raises(IncompatibleSystem, match="its chart stands at the start of the step"):
        lm.ReversibleController(lm.RKMK(tableau=gauss(2)), sigma).require(TOP)


@lm.record
class Ramp(lm.DrivenHamiltonianSystem):
    """A particle at which a force pulls that grows from nothing at one time."""

    degrees = 1

    begins: float = 0.0

    def energy(self, t: float, q: lm.Vec, p: lm.Vec) -> float:
        return 0.5 * lm.dot(p, p) - (t - self.begins) * q[0]


@pytest.mark.parametrize("transformed", [False, True])
def test_sigma_is_asked_for_when_the_motion_starts(transformed: bool) -> None:
    """At rest |f| is the force: none at `begins`, where 1/|f| has no value, and 1 a second later."""

    def run(t0: float, begins: float) -> lm.Trajectory:
        system: Any = Ramp(begins)
        start, method = system.state([0.0], [0.0]), lm.SymmetricHamiltonJacobi(order=4)
        if transformed:
            system, method = (lm.SundmanTransformed(system, lm.time_scales.EqualArc()), lm.RKMK(order=4))
        else:
            method = lm.ReversibleController(method, lm.time_scales.EqualArc())
        return lm.integrate(system, method, start, h=0.01, steps=20, t0=t0)

    there = run(1.0, 0.0)
    # p' = t from p(1) = 0
    assert there.p[-1, 0] == pytest.approx(0.5 * (there.t[-1] ** 2 - 1.0), rel=1e-5)
    assert run(0.0, -1.0).p[-1, 0] == pytest.approx(there.p[-1, 0], rel=1e-14)
    for t0 in 0.0, 1.0:
        with pytest.raises(InvalidTimeScale, match="at the start"):
            run(t0, t0)


@lm.record
class OfSpeed(lm.time_scales.DistancePower):
    def value(self, system: Any, state: Any) -> float:
        return 1.0 / (1.0 + lm.dot(state.p, state.p))


@pytest.mark.parametrize(
    "run",
    [
        lambda sigma: (KEPLER, verlet(sigma)),
        lambda sigma: (lm.TimeTransformed(KEPLER, sigma), lm.HamiltonJacobi(order=2)),
    ],
    ids=["controller", "transformed"],
)
def test_a_subclass_writes_a_sigma_of_other_parts(run: Any) -> None:
    """That of its base depends on q alone, which was taken for granted: p was set to q."""
    one, other = (
        lm.integrate(*run(sigma), ORBIT, h=0.05, steps=5, compiled=False)
        for sigma in (OfSpeed(), lambda p: 1.0 / (1.0 + lm.dot(p, p)))
    )
    assert np.allclose(one.t, other.t, rtol=1e-13) and np.allclose(one.q, other.q, rtol=1e-13)
    assert lm.time_scales.EqualPath.parts == ("q",)
