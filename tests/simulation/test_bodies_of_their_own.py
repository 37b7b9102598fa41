"""Ensembles whose bodies go each its own way: ends, events, steps, methods and clocks of their own,
bit for bit the single runs.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
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


@pytest.mark.parametrize("t_end", [slow(2.0), [2.0, 1.5, -1.0, 1.0]])
def test_adaptive_ensembles_go_on_body_by_body(t_end: Any, tmp_path: Path) -> None:
    """Each with its controller, from where it stands."""
    plan = lm.Plan(BODY, DP5, rtol=1e-6, compiled=False)
    first, ends = plan.run(STARTS, t_end=t_end), 1.5 * np.broadcast_to(t_end, 4)
    with ThreadPoolExecutor(2) as executor:
        spread = plan.run(STARTS, t_end=t_end, executor=executor)
    for begun in (first, saved(first, tmp_path), spread):
        assert np.array_equal(begun.carry.t, first.t[-1])
        rest = plan.resume(begun, t_end=ends)
        for i, end in enumerate(ends):
            alone = plan.resume(plan.run(of(i), t_end=first.carry.members[i].t), t_end=end)
            assert np.array_equal(rest.mu[-1, i], alone.mu[-1])
            assert np.array_equal(rest.g[-1, i], alone.g[-1]) and rest.t[-1, i] == end
        joined = begun.then(rest)
        assert np.array_equal(joined.t[0], np.zeros(4)) and np.array_equal(joined.t[-1], ends)
    with pytest.raises(InvalidInput, match="another method"):
        lm.Plan(BODY, lm.RKMK(order=8), rtol=1e-6).resume(first, t_end=9.0)


LOOKS = [0]


@lm.record
class Interrupting(lm.Hamiltonian):
    """A free body, whose energy is asked for until somebody presses Ctrl-C."""

    def gradient(self, mu: lm.Vec) -> lm.Vec:
        LOOKS[0] -= 1
        if LOOKS[0] == 0:
            raise KeyboardInterrupt
        return lm.vec(mu[0], mu[1] / 1.5, mu[2] / 2.0)


def test_an_adaptive_ensemble_that_was_interrupted_goes_on(tmp_path: Path) -> None:
    """Its file has every body where it stands: at the end, on the way, at its start."""
    system, file = lm.LiePoissonSystem(lm.SO3(), Interrupting()), tmp_path / "runs.npz"
    plan = lm.Plan(system, DP5, rtol=1e-6, compiled=False, progress=False)
    starts = system.state(MU)
    LOOKS[0] = 280
    with pytest.raises(KeyboardInterrupt) as caught:
        plan.run(starts, t_end=4.0, checkpoint=file, checkpoint_every=0.0)
    whole, told = plan.run(starts, t_end=4.0), caught.value.trajectory  # type: ignore[attr-defined]
    assert told.carry.t[0] == 4.0 and told.carry.t[3] == 0.0
    for part in (told, lm.Trajectory.load(file)):
        assert np.array_equal(part.t[-1], part.carry.t)
        rest = plan.resume(part, t_end=4.0)
        assert np.array_equal(rest.mu[-1], whole.mu[-1])
        assert np.array_equal(part.then(rest).t[-1], np.full(4, 4.0))


@pytest.mark.parametrize("times", [[0.0, 1.0, 3.0], [2.9, 3.0]])
@pytest.mark.parametrize("stepping", [{"h": 0.1}, {"rtol": 1e-6}])
def test_a_body_that_an_event_has_ended_stays_there(stepping: Any, times: list[float]) -> None:
    """At its place then, for all samples to come, and not at the last one that was asked for."""
    method = lm.StormerVerlet() if "h" in stepping else DP5
    plan = lm.Plan(KEPLER, method, events=axis(2), compiled=False, **stepping)
    runs = plan.run(ORBITS, t_end=3.0, t_eval=times)
    ended, place = runs.events[0][1]
    assert len(ended) == 2 and ended[-1] < 2.9
    assert runs.t[-1, 1] == ended[-1] and np.array_equal(runs.q[-1, 1], place.q[-1])
    assert runs.t[-1, 0] == 3.0


def test_events_of_every_body(tmp_path: Path) -> None:
    """The orbits end at their second crossing, each at its own time; those that went on go on."""
    for how, span in (
        (dict(h=0.1), dict(steps=30)),
        (dict(h=[0.1, 0.05, 0.15]), dict(t_end=3.0)),
        (dict(rtol=1e-4), dict(t_end=3.0, t_eval=[0.0, 1.0, 2.0, 3.0])),
    ):
        method = lm.StormerVerlet() if "h" in how else DP5
        plan = lm.Plan(KEPLER, method, events=[axis(), axis(2)], compiled=False, **how)
        runs = plan.run(ORBITS, **span)
        assert runs.t.shape == (len(runs), 3) and runs.t[-1, 1] < 3.0 - 0.1
        for i in range(3):
            own = {name: np.broadcast_to(x, 3)[i].item() for name, x in how.items()}
            alone = lm.Plan(KEPLER, method, events=[axis(), axis(2)], compiled=False, **own)
            run = alone.run(KEPLER.state(q=Q[i], p=P[i]), **span)
            for k in range(2):
                assert np.array_equal(runs.events[k][i][0], run.events[k][0])
                assert np.array_equal(runs.events[k][i][1].q, run.events[k][1].q)  # type: ignore[attr-defined]
            if "h" in how or "t_eval" in span:
                assert np.array_equal(runs.q[: len(run), i], run.q)
                assert np.array_equal(runs.t[: len(run), i], run.t)
        assert runs.t[-1, 1] == runs.events[1][1][0][1]  # type: ignore[index]
        again = saved(runs, tmp_path)
        assert np.array_equal(again.events[0][2][0], runs.events[0][2][0])
        rest = plan.resume(again, **({"steps": 5} if "steps" in span else {"t_end": 3.6}))
        assert "h" not in how or rest.t[-1, 1] == runs.t[-1, 1]  # it had ended
        assert runs.then(rest).t[-1, 0] > 3.0


def test_bodies_with_steps_of_their_own_meet_at_times() -> None:
    plan = lm.Plan(BODY, lm.RKMK(order=4), h=[0.1, 0.05, 0.2, 0.025], compiled=False)
    asked = plan.run(STARTS, steps=15, t_eval=[0.0, 0.13, 0.3])
    met, rest = plan.run(STARTS, t_end=1.0), None
    assert asked.t.shape == (3,) and np.array_equal(met.t[-1], np.full(4, 1.0))
    for i, h in enumerate((0.1, 0.05, 0.2, 0.025)):
        alone = lm.Plan(BODY, lm.RKMK(order=4), h=h, compiled=False)
        assert np.array_equal(asked.mu[:, i], alone.run(of(i), steps=15, t_eval=[0.0, 0.13, 0.3]).mu)
        run = alone.run(of(i), t_end=1.0)
        assert np.array_equal(met.mu[: len(run), i], run.mu)
        assert np.array_equal(met.t[: len(run), i], run.t)
        assert np.array_equal(met.mu[-1, i], run.mu[-1])
        rest = plan.resume(met, t_end=1.6) if rest is None else rest
        assert np.array_equal(rest.mu[-1, i], alone.run(of(i), t_end=1.6).mu[-1])
    with pytest.raises(InvalidInput, match=r"t_end = 0.3; fixed steps"):
        plan.run(STARTS, t_end=0.3)


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


def test_tolerances_of_every_body() -> None:
    rtol = [1e-3, 1e-5, 1e-7, 1e-9]
    runs = lm.integrate(BODY, DP5, STARTS, t_end=2.0, rtol=rtol, max_step=[0.1, 9.0, 9.0, 9.0])
    for i, tolerance in enumerate(rtol):
        alone = lm.integrate(BODY, DP5, of(i), t_end=2.0, rtol=tolerance, max_step=9.0 if i else 0.1)
        assert np.array_equal(runs.mu[-1, i], alone.mu[-1])
    with pytest.raises(InvalidInput, match="rtol must be positive"):
        lm.integrate(BODY, DP5, STARTS, t_end=2.0, rtol=[1e-3, 1e-3, 1e-3, -1.0])
    with pytest.raises(InvalidInput, match="rtol has 2 numbers for 4 bodies"):
        lm.integrate(BODY, DP5, STARTS, t_end=2.0, rtol=[1e-3, 1e-3])


@pytest.mark.sample(3)
@pytest.mark.parametrize("systems", [KEPLER, [lm.Kepler(1.0 + 0.1 * i) for i in range(3)]], ids=str)
@pytest.mark.parametrize("methods", [TIMED[1], TIMED], ids=["one", "of each"])
@pytest.mark.parametrize("how", [dict(steps=12), dict(t_end=0.8), dict(t_end=0.8, t_eval=[0.1, 0.5])])
def test_every_body_has_a_fictive_clock_of_its_own(
    systems: Any, methods: Any, how: dict[str, Any], tmp_path: Path
) -> None:
    plan = lm.Plan(systems, methods, 0.05, compiled=False)
    runs = plan.run(ORBITS, **how)
    longer = {"steps": 24} if "steps" in how else {"t_end": 1.2}
    rest = plan.resume(saved(runs, tmp_path), **(longer if "t_end" in longer else how))
    for i in range(3):
        system, method = (x[i] if isinstance(x, list) else x for x in (systems, methods))
        single = lm.Plan(system, method, 0.05, compiled=False)
        start = system.state(q=Q[i], p=P[i])
        alone = single.run(start, **how)
        n = len(alone)
        assert np.array_equal(runs.q[:n, i], alone.q) and np.array_equal(runs.p[:n, i], alone.p)
        assert np.array_equal(np.broadcast_to(runs.t.T, (3, len(runs)))[i, :n], alone.t)
        assert np.array_equal(rest.q[-1, i], single.run(start, **longer).q[-1])
    assert runs.drift()["energy"].largest < 0.2


def test_a_body_that_fails_disturbs_no_other() -> None:
    """A planet falls into the sun, the others pass."""
    falling = KEPLER.state(q=[[0.6, 0.0], [0.5, 0.0]], p=[[0.0, 1.4], [0.0, 0.0]])
    plan = lm.Plan(KEPLER, DP5, rtol=1e-6, compiled=False)
    with pytest.warns(RuntimeWarning, match="1 of 2 bodies stopped early: body 1"):
        runs = plan.run(falling, t_end=2.0)
    alone = plan.run(KEPLER.state(q=[0.6, 0.0], p=[0.0, 1.4]), t_end=2.0)
    assert [*runs.stopped] == [1] and np.array_equal(runs.q[-1, 0], alone.q[-1])
    with pytest.warns(RuntimeWarning, match="1 of 2 bodies stopped early"):
        rest = plan.resume(runs, t_end=3.0)
    assert [*rest.stopped] == [1] and np.array_equal(rest.q[-1, 1], runs.q[-1, 1])
    assert np.array_equal(rest.q[-1, 0], plan.resume(alone, t_end=3.0).q[-1])


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
