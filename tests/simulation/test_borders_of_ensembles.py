"""Ensembles at the borders of runs: arrays of the wrong length, chunks, ends without a span."""

from __future__ import annotations

import dataclasses
import pickle
from concurrent import futures
from typing import Any, ClassVar

import numpy as np
import pytest

import liemech as lm
from liemech.errors import InvalidInput, InvalidType
from liemech.rooms.at_work import spread

KEPLER = lm.Kepler()
BODY = lm.RigidBody([1.0, 1.5, 2.0])
STARTS = BODY.state(mu=np.linspace([0.5, 0.1, 0.8], [0.6, 0.3, 0.9], 3))
TWO = BODY.state(mu=STARTS.mu[:2])
ONE = BODY.state(mu=[0.5, 0.1, 0.8])
RAGGED = [[1.0], [1.0, 2.0]]


@lm.record
class Largest(lm.TimeScale):
    """A scale that depends on the largest distance of all members at the start."""

    parts: ClassVar[tuple[str, ...] | None] = ("q",)
    unit: float = 1.0

    def value(self, system: Any, state: Any) -> float:
        return self.unit + lm.dot(state.q, state.q)

    def bound(self, system: Any, start: Any) -> lm.TimeScale:
        return dataclasses.replace(self, unit=float(np.abs(start.arrays["q"]).max()))


def test_chunks_go_on_from_the_start_of_all(monkeypatch: Any) -> None:
    monkeypatch.setattr(spread, "CHUNK", 1)
    starts = KEPLER.state(q=np.linspace([0.5, 0.0], [1.0, 0.0], 40), p=[[0.0, 1.2]] * 40)
    method = lm.ReversibleController(lm.StormerVerlet(), Largest())
    plan = lm.Plan(KEPLER, method, h=0.01, compiled=False, progress=False)
    with futures.ThreadPoolExecutor(1) as executor:
        run = plan.run(starts, steps=2, executor=executor)
    assert run.sigma.unit == 1.0  # not 0.69, of the first 16 bodies
    theirs, ours = (plan.resume(x, steps=2) for x in (pickle.loads(pickle.dumps(run)), run))
    assert np.array_equal(ours.t, theirs.t) and np.array_equal(ours.q, theirs.q)


def test_bodies_are_counted_wherever_a_run_begins() -> None:
    own = lm.Plan(BODY, lm.RKMK(order=2), h=[0.1, 0.2], compiled=False)
    two = lm.Plan([BODY, BODY], lm.RKMK(order=2), h=0.1, compiled=False)
    adaptive = lm.Plan(BODY, lm.RKMK(order=5), rtol=1e-3, compiled=False)
    with futures.ThreadPoolExecutor(1) as executor:
        for plan, told in ((own, "h has 2 steps for 3"), (two, "2 systems for 3 bodies")):
            with pytest.raises(InvalidInput, match=told):
                plan.begin(STARTS)
            with pytest.raises(InvalidInput, match=told):
                plan.run(STARTS, steps=1, executor=executor)
        with pytest.raises(InvalidType, match="h must be a number for a start of one body"):
            own.begin(ONE)
        with pytest.raises(InvalidType, match="h must be a number for a start of one body"):
            own.tangent(ONE, steps=1)
        for times, name in (
            ({"t_end": [1.0] * 4}, "t_end has shape"),
            ({"t_end": 1.0, "t_eval": np.ones((2, 4))}, "t_eval has shape"),
        ):
            with pytest.raises(InvalidInput, match=name):
                adaptive.run(STARTS, executor=executor, **times)
        with pytest.raises(InvalidInput, match="t_eval is ragged"):
            own.run(TWO, steps=1, t_eval=RAGGED, executor=executor)
    assert own.step(own.begin(TWO), 3).t.tolist() == pytest.approx([0.3, 0.6])


def test_ragged_arrays_are_refused_by_name() -> None:
    with pytest.raises(InvalidInput, match="h is ragged"):
        lm.Plan(BODY, lm.RKMK(order=2), h=RAGGED)
    with pytest.raises(InvalidInput, match="breaks is ragged"):
        lm.Plan(BODY, lm.RKMK(order=5), breaks=RAGGED)
    with pytest.raises(InvalidInput, match="t_end is ragged"):
        lm.Plan(BODY, lm.RKMK(order=5), rtol=1e-3).run(STARTS, t_end=RAGGED)


def test_the_smallest_step_may_be_lost() -> None:
    plan = lm.Plan(BODY, lm.RKMK(order=2), h=[-1.0, 1e-12, 1.0], compiled=False)
    with pytest.raises(InvalidInput, match="h = 1e-12 is lost"):
        plan.run(STARTS, steps=1, t0=1e8)


def test_a_body_without_a_span_of_time_has_no_trend() -> None:
    plan = lm.Plan(BODY, lm.RKMK(order=5), rtol=1e-3, atol=1e-3, compiled=False)
    run = plan.run(STARTS, t_end=[0.0, 0.0, 0.0])
    assert all(kept.slope == 0.0 for kept in run.drift().kept)


def test_a_scale_needs_the_state() -> None:
    method = lm.ReversibleController(lm.StormerVerlet(), Largest())
    start = KEPLER.state(q=[0.5, 0.0], p=[0.0, 1.2])
    run = lm.integrate(KEPLER, method, start, h=0.01, steps=2, record="energy", compiled=False)
    with pytest.raises(InvalidInput, match=r"scale needs q; this run recorded energy"):
        _ = run.scale


def test_a_run_that_an_event_ended_says_so() -> None:
    def turned(t: float, state: Any) -> float:
        return t - 0.15

    turned.terminal = True  # type: ignore[attr-defined]
    plan = lm.Plan(BODY, lm.RKMK(order=2), h=0.1, events=turned, compiled=False)
    with pytest.raises(InvalidInput, match="ended by an event"):
        plan.resume(plan.run(ONE, steps=4), steps=1)


@pytest.mark.slow
@pytest.mark.parametrize("adaptive", [False, True])
def test_the_last_state_of_every_body_is_that_of_its_terminal_event(
    adaptive: bool, tmp_path: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(spread, "CHUNK", 1)

    def turned_by_a_twelfth(t: float, state: Any) -> float:
        return state.g[1, 0] - 0.5

    turned_by_a_twelfth.terminal = True  # type: ignore[attr-defined]
    rates = np.r_[np.linspace(1.0, 2.0, 18), 0.1, 0.2]  # of spins about a main axis; the last two come nowhere near
    starts = BODY.state(mu=[[0.0, 0.0, 2.0 * w] for w in rates], g=np.tile(np.eye(3), (20, 1, 1)))
    method, how = (lm.RKMK(order=5), {}) if adaptive else (lm.RKMK(order=2), {"h": 0.1})
    plan = lm.Plan(BODY, method, events=turned_by_a_twelfth, compiled=False, **how)
    first, whole = ({"t_end": 0.4}, {"t_end": 0.8}) if adaptive else ({"steps": 4}, {"steps": 8})
    until = {"t_end": 0.8} if adaptive else {"steps": 4}
    halves = plan.run(starts, **first)
    with futures.ThreadPoolExecutor(1) as executor:
        chunks = plan.run(starts, t_eval=[0.0, 0.1], executor=executor, **whole)
    runs = [plan.run(starts, t_eval=[0.0, 0.1], **whole), chunks]
    runs[0].save(tmp_path / "run.npz")
    runs.append(lm.Trajectory.load(tmp_path / "run.npz"))
    seen = [0.1, 0.1, 0.1]
    if not adaptive:  # bodies that an event has ended go on with adaptive steps
        runs.append(halves.then(plan.resume(halves, **until)))
        seen.append(0.8)
    for run, t in zip(runs, seen, strict=True):
        assert run.ended == (0,) * 18 + (None,) * 2
        angle = np.r_[np.full(18, np.pi / 6.0), rates[18:] * t]
        turned = np.arctan2(run.last.g[:, 1, 0], run.last.g[:, 0, 0])
        assert np.allclose(turned, angle, rtol=1e-12, atol=0.0)


def test_what_a_checkpoint_cannot_hold_is_named(tmp_path: Any) -> None:
    function = lm.ReversibleController(lm.StormerVerlet(), lambda q: lm.dot(q, q))
    start = KEPLER.state(q=[0.5, 0.0], p=[0.0, 1.2])
    with pytest.raises(InvalidInput, match="checkpoint: the method cannot be saved"):
        lm.Plan(KEPLER, function, h=0.01).run(start, steps=1, checkpoint=tmp_path / "run.npz")


@pytest.mark.slow
def test_the_step_of_chunks_without_a_rejection_is_their_mean(monkeypatch: Any) -> None:
    monkeypatch.setattr(spread, "CHUNK", 1)
    starts = BODY.state(mu=np.linspace([0.5, 0.1, 0.8], [5.0, 1.0, 8.0], 20))
    plan = lm.Plan(BODY, lm.RKMK(order=5), h=1e-3, rtol=1e-3, compiled=False)
    whole = plan.run(starts, t_end=0.5)
    with futures.ThreadPoolExecutor(1) as executor:
        run = plan.run(starts, t_end=0.5, executor=executor)
    assert whole.rejected == run.rejected == 0
    assert run.h == pytest.approx(whole.h, rel=1e-12)


MANY = [lm.RigidBody([1.0, 1.5, 1.6 + 0.02 * i]) for i in range(19)]


def test_what_the_systems_of_an_ensemble_must_be() -> None:
    starts = BODY.state(mu=np.linspace([0.5, 0.1, 0.8], [0.6, 0.3, 0.9], 19))
    given = dict(h=0.1, steps=2)
    for systems, message in (
        (MANY[:3], "3 systems for 19 bodies"),
        ([*MANY[:18], lm.RigidBody(np.diag([1.0, 1.5, 2.0]))], "system 18, .* is of another kind than system 0"),
        ([], "one for each body"),
        ([*MANY[:18], 3.0], "got 3.0"),
    ):
        with pytest.raises(InvalidInput, match=message):
            lm.integrate(systems, lm.RKMK(order=4), starts, **given)  # type: ignore[arg-type]
    with pytest.raises(InvalidInput, match="19 systems for a start of one"):
        lm.integrate(MANY, lm.RKMK(order=4), ONE, **given)  # type: ignore[arg-type]
    plan = lm.Plan(MANY, lm.RKMK(order=4), 0.1, compiled=False)
    with pytest.raises(InvalidInput, match="another system"):
        plan.replace(system=MANY[::-1]).resume(plan.run(starts, steps=1), steps=1)
