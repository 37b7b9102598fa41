"""Runs in fictive time go on, are kept in files, look for events, and are stepped one by one, as runs in time are."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.errors import IntegrationInterrupted, InvalidInput, InvalidType

KEPLER = lm.Kepler()
ORBIT = KEPLER.pericentre(0.6)
CONTROLLED = lm.ReversibleController(lm.StormerVerlet(), lm.time_scales.DistancePower(1.5))
PAIRS = [
    (KEPLER, CONTROLLED),
    # a sigma that knows the energy of the start
    (lm.TimeTransformed(KEPLER, lm.time_scales.EqualChange()), lm.AdaptiveVerlet()),
    (lm.LogarithmicHamiltonian(KEPLER), lm.StormerVerlet()),
]


def plan(system: lm.System = KEPLER, method: lm.Method = CONTROLLED, **options: object) -> lm.Plan:
    return lm.Plan(system, method, h=0.05, compiled=False, progress=False, **options)  # type: ignore[arg-type]


def assert_same(a: lm.Trajectory, b: lm.Trajectory, but: float = np.nan) -> None:
    """The same samples, bit for bit, but those of `a` at one time."""
    kept = slice(None) if np.isnan(but) else a.t != but
    for name in ("t", "q", "p", "tau", "z"):
        x, y = getattr(a, name), getattr(b, name)
        assert (x is None and y is None) or np.array_equal(x[kept], y), name


@pytest.mark.parametrize(("system", "method"), PAIRS)
def test_a_run_to_a_time_goes_on_as_if_it_had_not_stopped(system: lm.System, method: lm.Method) -> None:
    """The shorter step to the first t_end leads to a sample; the motion goes on from the last whole step."""
    prepared = plan(system, method)
    whole, first = prepared.run(ORBIT, t_end=3.0), prepared.run(ORBIT, t_end=2.0)
    rest = prepared.resume(first, t_end=3.0)
    assert rest.t[0] == first.carry.t == 2.0 and np.array_equal(rest.q[0], first.q[-1])
    assert_same(first.then(rest), whole, but=2.0)
    # four whole steps, then to the time
    mixed = prepared.resume(prepared.resume(first, steps=4), t_end=3.0)
    assert_same(mixed, prepared.resume(prepared.run(ORBIT, steps=first.steps + 3), t_end=3.0))
    assert np.array_equal(prepared.resume(first, t_end=2.0).q, first.q[-1:])
    within = prepared.resume(first, t_end=2.0 + 1e-9)  # in the step that the first run has cut
    assert np.array_equal(within.q[-1], prepared.run(ORBIT, t_end=2.0 + 1e-9).q[-1])


def test_a_time_at_the_end_of_a_step_is_one_sample() -> None:
    """With sigma = 1 physical time is the fictive one."""
    prepared = plan(method=lm.ReversibleController(lm.StormerVerlet(), lambda q: 1.0 + 0.0 * q[0])).replace(h=0.25)
    first = prepared.run(ORBIT, t_end=1.0)
    for rest in (prepared.resume(first, t_end=2.0), prepared.resume(first, steps=4)):
        assert np.array_equal(first.then(rest).t, np.arange(9) / 4.0)


def test_times_that_are_asked_for_after_a_stop() -> None:
    prepared = plan()
    first = prepared.run(ORBIT, t_end=2.0)
    some = prepared.resume(first, t_end=5.0, t_eval=[2.0, 3.3, 5.0])
    assert np.array_equal(some.t, [2.0, 3.3, 5.0]) and np.array_equal(some.q[0], first.q[-1])
    assert np.abs(some.q - prepared.run(ORBIT, t_end=5.0).at([2.0, 3.3, 5.0]).q).max() < 1e-13


@pytest.mark.parametrize(("system", "method"), PAIRS)
def test_a_run_in_a_file(system: lm.System, method: lm.Method, tmp_path: Path) -> None:
    prepared = plan(system, method)
    first = prepared.run(ORBIT, t_end=2.0)
    first.save(tmp_path / "run.npz")
    kept: lm.Trajectory = lm.Trajectory.load(tmp_path / "run.npz")
    assert type(kept) is type(first) and repr(kept) == repr(first)
    assert_same(kept, first)
    assert np.array_equal(kept.scale, first.scale) and np.array_equal(kept.at([0.3, 1.9]).q, first.at([0.3, 1.9]).q)
    assert np.array_equal(kept.carry.state.q, first.carry.state.q) and kept.carry.t == 2.0
    assert_same(kept.then(prepared.resume(kept, t_end=3.0)), prepared.run(ORBIT, t_end=3.0), but=2.0)


@pytest.mark.parametrize("how", [{"t_end": 12.0}, {"steps": 200}])
def test_a_run_that_was_killed_goes_on_from_its_checkpoint(
    how: dict[str, float], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("liemech.simulation.checkpoint.SHARE", 1.0)
    calls = []

    def sigma(q: lm.Vec) -> float:
        calls.append(0)
        if stop and len(calls) == 300:
            raise KeyboardInterrupt
        return lm.dot(q, q)

    stop = True
    prepared = plan(record=["energy", "q"])
    prepared.run(ORBIT, checkpoint=tmp_path / "run.npz", checkpoint_every=0.0, **how)  # type: ignore[arg-type]
    kept = lm.Trajectory.load(tmp_path / "run.npz")
    whole = prepared.run(ORBIT, **how)  # type: ignore[arg-type]
    assert 0 < len(kept) <= len(whole) and kept.carry.step == kept.steps
    left = {"steps": 200 - kept.steps} if "steps" in how else how
    joined = kept.then(prepared.resume(kept, **left))  # type: ignore[arg-type]
    assert np.array_equal(joined.q, whole.q) and np.array_equal(joined.energy, whole.energy)
    with pytest.raises(IntegrationInterrupted) as stopped:
        plan(method=lm.ReversibleController(lm.StormerVerlet(), sigma)).run(ORBIT, **how)  # type: ignore[arg-type]
    begun, stop = stopped.value.trajectory, False
    again = plan(method=begun.method)
    left = {"steps": 200 - begun.steps} if "steps" in how else how
    assert_same(begun.then(again.resume(begun, **left)), again.run(ORBIT, **how))  # type: ignore[arg-type]


def crossing(t: float, state: lm.CanonicalState) -> float:
    return state.q[1]  # type: ignore[no-any-return]


@pytest.mark.parametrize(("system", "method"), PAIRS[:2])
def test_events_are_where_a_run_to_their_times_ends(system: lm.System, method: lm.Method) -> None:
    """The ellipse passes its axis after half of the period, 2 pi for the energy -1/2."""
    watched, bare = plan(system, method, events=crossing), plan(system, method)
    run, whole = watched.run(ORBIT, t_end=3.4), bare.run(ORBIT, t_end=3.4)
    assert_same(run, whole)
    times, states = run.events[0]
    assert times == pytest.approx([np.pi], abs=0.02) and np.abs(states.q[:, 1]).max() < 1e-11
    ends = bare.run(ORBIT, t_end=float(times[0]))
    assert np.abs(ends.q[-1] - states.q[0]).max() < 1e-13
    few = plan(system, method, events=crossing, every=7)
    assert_same(few.run(ORBIT, steps=30), plan(system, method, every=7).run(ORBIT, steps=30))
    first = watched.run(ORBIT, t_end=2.0)
    joined = first.then(watched.resume(first, t_end=3.4))
    assert_same(joined, whole, but=2.0)
    assert len(joined.events[0][0]) == 1 and np.abs(joined.events[0][0] - times).max() < 1e-12


def test_terminal_events_and_directions_and_events_that_fail(tmp_path: Path) -> None:
    def rising(t: float, state: lm.CanonicalState) -> float:
        return state.q[1]  # type: ignore[no-any-return]

    rising.direction, rising.terminal = +1, True  # type: ignore[attr-defined]
    prepared = plan(events=[crossing, rising], every=4)
    run = prepared.run(ORBIT, t_end=20.0)
    assert run.t[-1] == run.events[1][0][0] == run.events[0][0][1] and run.t[-1] == pytest.approx(2.0 * np.pi, abs=0.02)
    assert np.array_equal(run.q[:-1], plan(every=4).run(ORBIT, t_end=20.0).q[: len(run) - 1])
    assert np.array_equal(run.q[-1], run.events[1][1].q[0]) and run.tau[-2] < run.tau[-1]
    with pytest.raises(InvalidInput, match="carries nothing on"):
        prepared.resume(run, t_end=30.0)
    run.save(tmp_path / "run.npz")
    assert np.array_equal(lm.Trajectory.load(tmp_path / "run.npz").events[1][0], run.events[1][0])
    back = lm.Plan(KEPLER, CONTROLLED, h=-0.05, events=crossing, compiled=False).run(ORBIT, t_end=-4.0)
    assert back.events[0][0] == pytest.approx([-np.pi], abs=0.02)

    def late(t: float, state: lm.CanonicalState) -> float:
        return 1.0 if t < 1.0 else [][3]  # type: ignore[no-any-return]

    with pytest.raises(IndexError) as mistake:
        plan(events=late).run(ORBIT, t_end=20.0)
    told: lm.Trajectory = mistake.value.trajectory  # type: ignore[attr-defined]
    assert_same(told, plan().run(ORBIT, steps=len(told) - 1))
    assert 0.9 < told.t[-1] < 1.0


def test_carries_of_equal_plans_and_of_others() -> None:
    """Plans that are equal step each other's carries, those of bodies too; others refuse them."""
    body = lm.RigidBody([1.0, 2.0, 2.5])
    for system in (body, [body, lm.RigidBody([1.0, 2.0, 2.6])]):
        start = body.state([0.1, 1.0, 0.2]) if system is body else body.state([[0.1, 1.0, 0.2]] * 2)
        one, other = (lm.Plan(system, lm.RKMK(order=4), h=0.1, compiled=False) for _ in range(2))
        stepped = other.step(one.begin(start))
        assert np.array_equal(stepped.numbers, one.step(one.begin(start)).numbers)
    orbiting = plan().begin(ORBIT)
    with pytest.raises(InvalidInput, match="another system or method"):
        plan(*PAIRS[1]).step(orbiting)
    with pytest.raises(InvalidInput, match=r"h = 0\.05, the plan has 0\.1"):
        plan().replace(h=0.1).step(orbiting)
    with pytest.raises(InvalidType, match="begin"):
        plan().step(one.begin(start))  # type: ignore[arg-type]


def test_what_a_run_does_not_go_on_with() -> None:
    first = plan().run(ORBIT, t_end=2.0)
    for other, words in (
        (plan().replace(h=0.1), "h = 0.05 instead of 0.1"),
        (plan(method=lm.ReversibleController(lm.StormerVerlet(), lm.time_scales.DistancePower(1.0))), "power"),
        (plan(lm.Kepler(2.0)), "another system"),
        (plan(lm.TimeTransformed(KEPLER, lm.time_scales.DistancePower(1.5)), lm.AdaptiveVerlet()), "another system"),
    ):
        with pytest.raises(InvalidInput, match=words):
            other.resume(first, t_end=3.0)
    with pytest.raises(InvalidInput, match="turn the sign"):
        plan().resume(first, t_end=1.0)
    with pytest.raises(InvalidInput, match="does not begin where"):
        first.then(first)


def test_what_cannot_be_saved_is_refused_before_the_first_step(tmp_path: Path) -> None:
    """Not when the first checkpoint is due, a minute later."""
    no_record = plan(method=lm.ReversibleController(lm.StormerVerlet(), lambda q: lm.dot(q, q)))
    with pytest.raises(InvalidInput, match="cannot be saved"):
        no_record.run(ORBIT, t_end=0.2, checkpoint=tmp_path / "run.npz")
    with pytest.raises(InvalidInput, match="cannot be saved"):
        no_record.resume(no_record.run(ORBIT, t_end=0.2), t_end=0.3, checkpoint=tmp_path / "run.npz")


ORBITS = KEPLER.state(q=[[0.5, 0.0], [0.7, 0.0]], p=[[0.0, 1.2]] * 2)


def test_steps_and_clocks_of_ensembles_in_fictive_time() -> None:
    method = lm.ReversibleController(lm.StormerVerlet(), lm.time_scales.DistancePower(1.5))
    run = lm.Plan(KEPLER, method, [0.05, 0.1], compiled=False).run(ORBITS, steps=4)
    assert np.array_equal(run.h, [0.05, 0.1])
    system = lm.TimeTransformed(KEPLER, lm.time_scales.DistancePower(1.5))
    plan = lm.Plan(system, lm.RKMK(order=4), [0.05, 0.1], compiled=False)
    many = plan.tangent(ORBITS, steps=3)
    assert np.allclose(many.tau[-1], [0.15, 0.3], rtol=1e-15)
    assert many.energy.shape == (4, 2)


START = KEPLER.state(q=[0.4, 0.0], p=[0.0, 2.0])
EXTENDED = lm.TimeTransformed(KEPLER, lm.time_scales.DistancePower(1.5))
PLANS = [
    lm.Plan(KEPLER, CONTROLLED, h=0.2, compiled=False),
    lm.Plan(KEPLER, CONTROLLED, h=0.2, every=3, compiled=False),
    lm.Plan(EXTENDED, lm.AdaptiveVerlet(), h=0.2, compiled=False),
]


@pytest.mark.sample(2)
@pytest.mark.parametrize("plan", PLANS)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_it_steps_from_the_last_whole_step(plan: Any, sign: float, tmp_path: Any) -> None:
    """To the bit; between samples that lie several steps apart up to rounding, for sums of steps
    are compensated and samples are not.
    """
    every, plan = plan.replace(every=1, h=sign * 0.2), plan.replace(h=sign * 0.2)
    whole, steps = plan.run(START, t_end=sign), every.run(START, t_end=sign).t
    cut = 0.3 * steps[1] + 0.7 * steps[2]
    after = cut + (steps[2] - cut) * np.array([0.2, 0.5, 0.9])
    first = plan.run(START, t_end=cut)
    rest = plan.resume(first, t_end=sign)
    twice = plan.resume(plan.resume(first, t_end=after[0]), t_end=sign)
    sampled = plan.resume(first, t_end=sign, t_eval=after)
    rest.save(tmp_path / "run.npz")
    loaded = lm.Trajectory.load(tmp_path / "run.npz")
    none = plan.resume(first, steps=0)
    rounding = 0.0 if whole.t[1] == steps[1] else 1e-14
    for run, times in (
        (rest, after),
        (loaded, after),
        (twice, after[1:]),
        (first.then(rest), np.linspace(0.0, sign, 40)),
        (first.then(none).then(rest), np.linspace(0.0, sign, 40)),
        (none.then(rest), after),
    ):
        assert np.abs(run.at(times).q - whole.at(times).q).max() <= rounding
    assert np.array_equal(sampled.q, rest.at(after).q)
    assert sampled.tau == pytest.approx(plan.run(START, t_end=sign, t_eval=after).tau, rel=1e-13)


def test_an_event_inside_of_the_step_is_that_of_the_whole_run() -> None:
    def crossed(t: float, state: Any) -> float:
        return state.q[1] - 0.5

    plan = PLANS[0].replace(events=crossed)
    whole = plan.run(START, t_end=1.0)
    times, states = whole.events[0]
    k = int(np.searchsorted(whole.t, times[0]))
    cut = 0.5 * (whole.t[k - 1] + times[0])
    found, then = plan.resume(plan.run(START, t_end=cut), t_end=1.0).events[0]
    assert found[0] == pytest.approx(times[0], rel=1e-14)
    assert then.q[0] == pytest.approx(states.q[0], rel=1e-14)


def test_a_step_that_fails_tells_the_fictive_time() -> None:
    method = lm.ReversibleController(lm.StormerVerlet(), lm.time_scales.DistancePower(2.0))
    plan = lm.Plan(KEPLER, method, h=5.0, compiled=False)
    carry = plan.begin(KEPLER.state(q=[0.1, 0.0], p=[0.0, 4.0]), t0=3.0)
    with pytest.raises(lm.errors.InvalidTimeScale, match=r"step 2 of 30, tau = 5;"):
        plan.step(carry, 30)
