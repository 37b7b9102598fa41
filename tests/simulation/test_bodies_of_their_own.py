"""Ensembles whose bodies go each its own way: ends, events, steps, methods and clocks of their own,
bit for bit the single runs.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import slow

import liemech as lm
from liemech.errors import IntegrationFailure, IntegrationInterrupted, InvalidInput
from liemech.formulas import sqrt, where
from liemech.simulation.between.events import Events

BODY = lm.RigidBody([1.0, 1.5, 2.0])
MU = np.random.default_rng(0).normal(size=(4, 3))
STARTS = BODY.state(MU, np.broadcast_to(np.eye(3), (4, 3, 3)))
DP5 = lm.RKMK(order=5)
KEPLER = lm.Kepler()
Q, P = [[0.6, 0.0], [0.5, 0.1], [0.7, 0.0]], [[0.0, 1.4], [0.0, 1.3], [0.1, 1.2]]
ORBITS = KEPLER.state(q=Q, p=P)
TIMED = [
    lm.ReversibleController(lm.StormerVerlet(), sigma=lm.time_scales.DistancePower(1.0 + 0.2 * i)) for i in range(3)
]


def of(i: int) -> Any:
    return BODY.state(MU[i], np.eye(3))


def axis(terminal: int = 0) -> Callable[[float, Any], float]:
    def event(t: float, state: Any) -> float:
        return float(state.q[1])

    event.terminal = terminal  # type: ignore[attr-defined]
    return event


def saved(run: lm.Trajectory, folder: Path, name: str = "run.npz") -> lm.Trajectory:
    run.save(folder / name)
    return lm.Trajectory.load(folder / name)


@pytest.mark.parametrize("compiled", [False, pytest.param(True, marks=pytest.mark.compiled)])
def test_every_body_has_a_method_of_its_own(compiled: bool, tmp_path: Path) -> None:
    """Moser-Veselov steps fitted to the motion of each."""
    bodies = [lm.RigidBody([1.0, 1.5, 2.0 + 0.1 * i]) for i in range(4)]
    methods = [lm.ExactMoserVeselov.of(body, of(i), 0.1) for i, body in enumerate(bodies)]
    plan = lm.Plan(bodies, methods, 0.1, compiled=compiled)
    runs, first = plan.run(STARTS, steps=8), plan.run(STARTS, steps=5)
    assert runs.compiled == compiled
    for i, body in enumerate(bodies):
        alone = lm.integrate(body, methods[i], of(i), h=0.1, steps=8, compiled=False)
        assert np.array_equal(runs.mu[:, i], alone.mu) and np.array_equal(runs.g[:, i], alone.g)
        exact = body.exact(of(i), t=runs.t)
        assert np.abs(runs.mu[:, i] - exact.mu).max() < 1e-12
    again = saved(first, tmp_path)
    assert np.array_equal(again.then(plan.resume(again, steps=3)).mu, runs.mu)
    with pytest.raises(InvalidInput, match="there are 4 methods for 2 bodies"):
        lm.integrate(BODY, methods, BODY.state(MU[:2]), h=0.1, steps=3)
    with pytest.raises(InvalidInput, match="differ in numbers only; method 1"):
        lm.Plan(BODY, [lm.RKMK(order=4), DP5], 0.1)


def test_clocks_that_part_and_one_that_stands_still(tmp_path: Path) -> None:
    """Steps side by side in fictive time lead to different times; from there each goes to one time.
    A planet that falls into the sun never comes there.
    """
    plan = lm.Plan(KEPLER, TIMED[1], 0.05, compiled=False)
    apart, met = plan.resume(plan.run(ORBITS, steps=8), t_end=0.8), plan.run(ORBITS, t_end=0.8)
    assert np.array_equal(apart.q[-1], met.q[-1]) and np.array_equal(apart.t[-1], met.t[-1])
    falling = KEPLER.state(q=[Q[0], [0.5, 0.0]], p=[P[0], [0.0, 0.0]])
    with pytest.warns(RuntimeWarning, match="1 of 2 bodies stopped early: body 1"):
        runs = plan.run(falling, t_end=0.8, steps=40)
    with pytest.warns(RuntimeWarning, match="1 of 2 bodies stopped early: body 1"):
        rest = plan.resume(saved(runs, tmp_path), t_end=1.0)
    alone = plan.run(KEPLER.state(q=Q[0], p=P[0]), t_end=1.0)
    assert np.array_equal(rest.q[-1, 0], alone.q[-1]) and rest.stopped[1].steps == 40
    own = lm.integrate(KEPLER, TIMED[1], ORBITS, h=[0.05, 0.025, 0.1], steps=4, compiled=False)
    third = KEPLER.state(q=Q[2], p=P[2])
    single = lm.integrate(KEPLER, TIMED[1], third, h=0.1, steps=4, compiled=False)
    assert np.array_equal(own.q[:, 2], single.q) and np.array_equal(own.t[:, 2], single.t)


def test_a_run_goes_on_to_the_time_where_it_stands() -> None:
    """Though its steps, or its clock, tell this time with rounding."""
    plan = lm.Plan(KEPLER, TIMED[0], 0.05, compiled=False)
    run = plan.run(KEPLER.state(q=Q[0], p=P[0]), t_end=0.7)
    for end in (0.7, np.nextafter(0.7, 0.0), np.nextafter(0.7, 1.0)):
        still = plan.resume(run, t_end=end)
        assert len(still) == 1 and np.array_equal(still.q[-1], run.q[-1])
    many = lm.Plan(BODY, lm.RKMK(order=4), 0.1)
    assert many._count(None, 0.1 * (10**8 + 3), 0.0, 10**8) == 3


@pytest.mark.parametrize("how", [{}, {"t_eval": [0.0, 0.2, 3.0]}], ids=["ends", "times"])
def test_a_body_that_stops_in_fictive_time_stands_after_its_last_step(how: dict[str, Any]) -> None:
    # 45 steps lead the nearest body not to t = 3; samples are kept every 7.
    start = KEPLER.state(q=[[0.9, 0.0], [0.3, 0.0]], p=[[0.0, 1.1], [0.0, 1.4]])
    plan = lm.Plan(KEPLER, TIMED[1], 0.1, every=7, compiled=False)
    with pytest.warns(RuntimeWarning, match="body 1 after 45 steps"):
        runs = plan.run(start, steps=45, t_end=3.0, **how)
    single = plan.replace(every=1).run(KEPLER.state(q=[0.3, 0.0], p=[0.0, 1.4]), steps=45)
    error = runs.stopped[1].error
    assert runs.stopped[1].steps == 45 and error.clock == (single.t[-1], single.tau[-1], single.z[-1])
    for found in (runs.q[-1, 1], runs.carry.members[1].state.q, error.reached.q):
        assert np.array_equal(found, single.q[-1])
    assert runs.tau[-1, 1] == single.tau[-1] and runs.t[-1].max() == 3.0


# ------------------------------------------------------------------ events, looked at side by side


def rising(t: float, state: Any) -> float:
    return state.q[0]


rising.direction = 1.0  # type: ignore[attr-defined]


def third(t: float, state: Any) -> float:
    return state.q[1]


third.terminal = 3  # type: ignore[attr-defined]


def below(t: float, state: Any) -> float:
    """A bound that is defined above it only: it fails in the steps after its zero."""
    return (state.q[1] + 0.3) / sqrt(where(state.q[1] > -0.6, 1.0, -1.0))


below.terminal = True  # type: ignore[attr-defined]

MANY = 19
RNG = np.random.default_rng(3)
# one falls into the sun, and one meets nothing
MANY_Q = np.stack([RNG.uniform(0.5, 1.0, MANY), 0.1 * RNG.normal(size=MANY)], axis=1)
MANY_P = np.stack([0.1 * RNG.normal(size=MANY), RNG.uniform(1.0, 1.3, MANY)], axis=1)
MANY_Q[5], MANY_P[5] = [0.5, 0.0], [0.0, 0.0]
MANY_Q[9], MANY_P[9] = [3.0, 1.0], [0.1, 0.4]
ENDS = np.where(np.arange(MANY) % 3 == 0, -4.0, np.linspace(2.0, 9.0, MANY))
ADAPTIVE = {"rtol": 1e-6, "max_step": 0.1}


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize(
    ("method", "stepping", "how"),
    [
        (DP5, ADAPTIVE, {"t_end": 9.0, "t_eval": [0.0, 0.5, 2.0, 4.4, 9.0]}),
        (DP5, ADAPTIVE | {"breaks": (0.0, 2.0, 5.0)}, {"t_end": ENDS}),
        (lm.StormerVerlet(), {"h": 0.03, "every": 7}, {"steps": 300}),
        slow(lm.RKMK(order=4), {"h": -0.03}, {"t_end": -6.0}),
    ],
)
@pytest.mark.parametrize("events", [(rising, third), slow((below, rising))])
@pytest.mark.parametrize("several", [False, slow(True)])
def test_events_of_bodies_side_by_side(
    method: Any, stepping: dict[str, Any], how: dict[str, Any], events: Any, several: bool
) -> None:
    suns: Any = [lm.Kepler(1.0 + 0.01 * i) for i in range(MANY)] if several else KEPLER
    plan = lm.Plan(suns, method, **stepping, events=events, compiled=True)
    starts = KEPLER.state(MANY_Q, MANY_P)
    with warnings.catch_warnings(action="ignore"):
        runs = plan.run(starts, **how)
    assert runs.compiled
    for i in range(MANY):
        own = {n: x[i] if n == "t_end" and np.ndim(x) else x for n, x in how.items()}
        single, error = plan.replace(system=suns[i] if several else KEPLER), None
        try:
            alone = single.run(KEPLER.state(MANY_Q[i], MANY_P[i]), **own)
        except IntegrationFailure as caught:
            error, alone = caught, caught.trajectory
        t = runs.t if runs.t.ndim == 1 else runs.t[:, i]
        shown = len(alone)
        if plan.adaptive and "t_eval" not in how:  # of an ensemble the start and the end
            shown = 0
            last = alone.last if error is None else error.reached
            assert np.array_equal(runs.q[-1, i], last.q)
            assert error is not None or t[-1] == alone.t[-1]
        assert np.array_equal(runs.q[:shown, i], alone.q[:shown])
        assert np.array_equal(t[:shown], alone.t[:shown])
        assert (i in runs.stopped) == (error is not None)
        for k in range(len(events)):
            (times, states), (found, then) = alone.events[k], runs.events[k][i]
            assert np.array_equal(times, found) and np.array_equal(states.p, then.p)


def test_an_event_that_fails_is_raised_as_its_body_alone_raises_it() -> None:
    def broken(t: float, state: Any) -> float:
        if state.q[0] < -0.2:
            raise ValueError("too far")
        return state.q[1]

    starts = KEPLER.state(MANY_Q[:4], MANY_P[:4])
    for method, how in (DP5, {"rtol": 1e-6}), (lm.StormerVerlet(), {"h": 0.03}):
        plan = lm.Plan(KEPLER, method, **how, events=broken)
        with pytest.raises(ValueError, match="too far") as raised:
            plan.run(starts, t_end=9.0)
        assert any("[integrate: body 0]" in note for note in raised.value.__notes__)
        assert raised.value.trajectory.bodies == 4  # type: ignore[attr-defined]


@pytest.mark.compiled
@pytest.mark.parametrize("nth", [2, slow(3)])
@pytest.mark.parametrize("of", [(Events, "see"), slow((Events, "_natively"))])
@pytest.mark.parametrize(
    ("method", "stepping", "end"), [(DP5, ADAPTIVE, {"t_end": 6.0}), (lm.StormerVerlet(), {"h": 0.02}, {"steps": 300})]
)
def test_an_interrupt_between_events_loses_and_repeats_none(
    method: Any, stepping: Any, end: dict[str, Any], of: Any, nth: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.setattr("liemech.simulation.runs.run.LONGEST", 16 if "rtol" in stepping else 100)
    starts = KEPLER.state(MANY_Q[6:], MANY_P[6:])
    plan = lm.Plan(KEPLER, method, **stepping, events=(rising, third), compiled=True)
    whole = plan.run(starts, **end)
    asked, calls = getattr(*of), []

    def pressed(*given: Any) -> Any:
        calls.append(asked(*given))
        if len(calls) == nth:
            raise KeyboardInterrupt
        return calls[-1]

    part: Any = None
    with monkeypatch.context() as during:
        during.setattr(*of, pressed)
        while part is None:  # native code of the events may come too late for so many pieces
            calls.clear()
            try:
                plan.run(starts, **end)
            except IntegrationInterrupted as stopped:
                part = stopped.trajectory
    for k, of_each in enumerate(part.events):
        for i, (times, _) in enumerate(of_each):
            assert np.array_equal(times, whole.events[k][i][0][: len(times)])
            assert len(times) == 0 or times[-1] <= part.carry.members[i].t
    left = {"t_end": 6.0}
    going, through = (plan.replace(events=(rising,)), lm.Plan(KEPLER, method, **stepping).run(starts, **left))
    ends = going.resume(part, **left).q[-1]
    for i, (times, _) in enumerate(part.events[1]):
        assert len(times) == 3 or np.array_equal(ends[i], through.q[-1, i])
    assert sum(len(times) < 3 for times, _ in part.events[1]) > 5


def test_quantities_are_those_of_each_system() -> None:
    """Runge and Lenz's vector is p x L/k - q/r with the attraction k of each."""
    attractions = np.array([1.0, 1.5, 0.7])
    planets = [lm.Kepler(float(k)) for k in attractions]
    plan = lm.Plan(planets, lm.StormerVerlet(), h=0.02, compiled=False)
    run = plan.run(ORBITS, steps=3)
    L = run.q[..., 0] * run.p[..., 1] - run.q[..., 1] * run.p[..., 0]
    across = np.stack([run.p[..., 1] * L, -run.p[..., 0] * L], axis=-1)
    r = np.linalg.norm(run.q, axis=-1)
    expected = across / attractions[:, None] - run.q / r[..., None]
    kept = plan.replace(record=["runge_lenz", "potential"]).run(ORBITS, steps=3)
    assert kept.runge_lenz == pytest.approx(expected, rel=1e-13)
    assert kept.potential == pytest.approx(-attractions / r, rel=1e-14)
    assert run.system.runge_lenz(run.q, run.p) == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize("away", [0.0, 0.1])
def test_bodies_bound_to_surfaces_of_their_own_start_there(away: float) -> None:
    """Pendulums of three lengths, q . q = l^2: a start is a state of each by its own length."""
    lengths = np.array([1.0, 1.5, 2.0])
    pendulums = [lm.SphericalPendulum(length=length) for length in lengths]
    q, p = np.outer(lengths + away, [0.6, 0.0, -0.8]), np.outer(lengths, [0.0, 1.0, 0.0])
    plan, start = lm.Plan(pendulums, lm.RATTLE(), h=0.01, compiled=False), lm.CanonicalState(q, p)
    if away:
        with pytest.raises(InvalidInput, match=r"body 0: .*not consistent"):
            plan.run(start, steps=1)
        return
    run = plan.run(start, steps=5)
    assert np.linalg.norm(run.q, axis=-1) == pytest.approx(np.tile(lengths, (6, 1)), rel=1e-14)
    for i, pendulum in enumerate(pendulums):
        alone = lm.integrate(pendulum, lm.RATTLE(), pendulum.state(q[i], p[i]), h=0.01, steps=5, compiled=False)
        assert np.array_equal(run.q[:, i], alone.q)
