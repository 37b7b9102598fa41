"""Runs without samples, with formulas that fail, with events and checkpoints: what they leave goes on bit for bit."""

from __future__ import annotations

import pickle
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes_of_runs import Equator

import liemech as lm
from liemech import errors
from liemech.compiler import kernel
from liemech.simulation import keep
from liemech.simulation.runs import equal

BODY = lm.RigidBody([1.0, 1.5, 2.0])
START = BODY.state(mu=[0.5, 0.1, 0.75**0.5], g=np.eye(3))
MANY = BODY.state(mu=[[0.5, 0.1, 0.9], [0.4, 0.2, 0.7]])
KEPLER = lm.Kepler()
PLANET = KEPLER.state(q=[0.6, 0.0], p=[0.0, 1.4])
PLANETS = KEPLER.state(q=[[0.6, 0.0], [0.7, 0.0]], p=[[0.0, 1.4], [0.0, 1.2]])
CLOCK = lm.ReversibleController(lm.StormerVerlet(), sigma=lm.time_scales.DistancePower(1.5))


class Node:
    """A planet passes the axis q_2 = 0."""

    terminal = 5

    def __call__(self, t: float, state: Any) -> float:
        return state.q[1]


def same(run: Any, other: Any) -> bool:
    """Are samples and events those of the other run, to the bit?"""
    pairs = [(run.t, other.t), *((run.states[n], other.states[n]) for n in other.states)]
    met = zip(run.events, other.events, strict=True)
    pairs += [(a, b) for one, two in met for a, b in zip(times(one), times(two), strict=True)]
    return all(np.array_equal(a, b) for a, b in pairs)


def times(event: Any) -> list[Any]:
    return [event[0]] if isinstance(event[0], np.ndarray) else [t for t, _ in event]


# ---------------------------------------------------------------- no samples


@pytest.mark.parametrize(
    ("system", "method", "start", "how"),
    [
        (BODY, lm.RKMK(order=5), START, dict(h=0.1)),
        (BODY, lm.RKMK(order=5), START, dict(rtol=1e-8)),
        (BODY, lm.RKMK(order=5), MANY, dict(rtol=1e-8)),
        (KEPLER, CLOCK, PLANET, dict(h=0.1)),
    ],
    ids=["fixed", "adaptive", "ensemble", "fictive"],
)
def test_a_run_without_samples_stands_where_it_came_to(system, method, start, how):
    plan = lm.Plan(system, method, compiled=False, **how)
    empty = plan.run(start, t_end=1.0, t_eval=[])
    there = plan.run(start, t_end=1.0, t_eval=[1.0])
    assert all(np.array_equal(x, there.states[n][-1]) for n, x in empty.last.arrays.items())
    rest = plan.resume(empty, t_end=2.0, t_eval=[2.0])
    assert same(empty.then(rest), plan.resume(there, t_end=2.0, t_eval=[2.0]))
    nothing = empty.then(plan.resume(empty, t_end=2.0, t_eval=[]))
    assert len(nothing) == 0 and np.all(nothing.carry.t == 2.0)
    assert same(plan.resume(nothing, t_end=3.0), plan.resume(rest, t_end=3.0))


@pytest.mark.parametrize("t_eval", [None, (0.0, 0.25, 0.5, 1.5), ()], ids=["steps", "times", "none"])
@pytest.mark.parametrize("how", ["fixed", "adaptive", "fictive"])
def test_the_last_state_is_that_of_the_event_that_ended_the_run(how, t_eval, tmp_path: Path):
    def late(t, state):
        return t - 0.733

    late.terminal = True
    orbit, body = lm.Kepler(), lm.RigidBody([1.0, 1.5, 2.0])
    begin = body.state(mu=[0.5, 0.0, 0.8])
    system, method, start, options = {
        "fixed": (body, lm.RKMK(order=4), begin, {"h": 0.1, "steps": 20}),
        "adaptive": (body, lm.RKMK(order=5), begin, {"t_end": 2.0}),
        "fictive": (
            orbit,
            lm.ReversibleController(lm.StormerVerlet(), lm.time_scales.DistancePower(1.5)),
            orbit.state(q=[1.0, 0.0], p=[0.0, 1.0]),
            {"h": 0.05, "t_end": 2.0},
        ),
    }[how]
    run = lm.integrate(system, method, start, events=[late], t_eval=t_eval, compiled=False, **options)
    run.save(tmp_path / "run.npz")
    for one in (run, lm.Trajectory.load(tmp_path / "run.npz")):
        assert one.ended == 0
        for name, values in one.events[0][1].arrays.items():
            assert np.array_equal(one.last.arrays[name], values[-1])
    beyond = lm.integrate(system, method, start, t_eval=t_eval, compiled=False, **options)
    assert beyond.ended is None


def test_a_sample_at_a_last_time_where_the_velocity_jumps():
    plan, start = (lm.Plan(BODY, lm.RKMK(order=5), rtol=1e-8, breaks=[0.3, 1.0]), BODY.state(START.mu))
    whole = plan.run(start, t_end=1.0)
    for record in None, ["mu", "energy"]:
        few = plan.replace(record=record).run(start, t_end=1.0, t_eval=[0.0, 0.5, 1.0, 1.0])
        assert few.t.tolist() == [0.0, 0.5, 1.0, 1.0]
        assert np.array_equal(few.mu[2:], whole.mu[[-1, -1]])


# ---------------------------------------------------------------- formulas that fail


def late(t: float, state: Any) -> float:
    return nothing_of_this_name if t > 0.55 else t  # noqa: F821


@pytest.mark.parametrize("how", [dict(h=0.1), dict(rtol=1e-8)], ids=["fixed", "adaptive"])
@pytest.mark.parametrize("t_eval", [None, [0.0, 0.3, 0.9]])
def test_a_mistake_in_a_recorded_formula_leaves_the_samples_before_it(how, t_eval):
    plan = lm.Plan(BODY, lm.RKMK(order=5), record=["mu", ("a", late)], compiled=False, **how)
    with pytest.raises(NameError, match="nothing_of_this_name") as caught:
        plan.run(BODY.state(START.mu), t_end=1.0, t_eval=t_eval)
    kept: Any = caught.value.trajectory  # type: ignore[attr-defined]
    whole = plan.replace(record="mu").run(BODY.state(START.mu), t_end=1.0, t_eval=t_eval)
    n = int(np.sum(whole.t <= 0.55))
    assert n > 1 and np.array_equal(kept.a, whole.t[:n]) and np.array_equal(kept.t, kept.a)
    assert np.array_equal(kept.mu, whole.mu[:n]) and kept.carry is None


# ---------------------------------------------------------------- events

RUNS = {
    "fixed": (KEPLER, lm.StormerVerlet(), PLANET, dict(h=0.08, events=Node()), 75, 125),
    "fictive": (KEPLER, CLOCK, PLANET, dict(h=0.08, events=Node()), 75, 125),
    "ensemble": (KEPLER, lm.StormerVerlet(), PLANETS, dict(h=0.08, events=Node()), 75, 125),
}


@pytest.mark.parametrize("which", RUNS)
def test_the_count_of_a_terminal_event_goes_on(which, tmp_path: Path):
    system, method, start, how, first, rest = RUNS[which]
    plan = lm.Plan(system, method, compiled=False, **how)  # type: ignore[arg-type]
    whole, part = plan.run(start, steps=first + rest), plan.run(start, steps=first)
    counts = [len(t) for t in times(whole.events[0])]
    assert set(counts) == {5} and all(0 < len(t) < 5 for t in times(part.events[0]))
    part.save(tmp_path / "run.npz")
    for known in part, pickle.loads(pickle.dumps(part)), lm.Trajectory.load(tmp_path / "run.npz"):
        joined = known.then(plan.resume(known, steps=rest))
        if which == "ensemble":  # a body that has stopped shows its last sample again
            assert np.array_equal(joined.t[-1], whole.t[-1])
            assert np.array_equal(joined.q[-1], whole.q[-1])
        else:
            assert same(joined, whole)


def test_the_count_of_an_adaptive_run_goes_on_and_begins_anew_after_its_end(tmp_path: Path):
    plan = lm.Plan(BODY, lm.RKMK(order=5), rtol=1e-7, events=Equator(), compiled=False)
    part = plan.run(START, t_end=15.0)
    part.save(tmp_path / "run.npz")
    ended = plan.resume(lm.Trajectory.load(tmp_path / "run.npz"), t_end=200.0)
    assert len(part.events[0][0]) + len(ended.events[0][0]) == 3 and len(part.events[0][0]) > 0
    assert ended.t[-1] < 200.0 and ended.t[-1] == ended.events[0][0][-1]
    again = plan.resume(ended, t_end=200.0)  # another three
    assert len(again.events[0][0]) == 3 and again.t[-1] < 200.0
    other = plan.replace(events=lambda t, state: state.mu[0] - 0.1)  # none of these was met
    assert [n for _, n in other.resume(part, t_end=15.0).carry.met[0]] == [0]


# ---------------------------------------------------------------- checkpoints


@pytest.mark.sample(4)
@pytest.mark.parametrize(
    ("record", "events", "t_eval"), [(None, Equator(), None), ("energy", (), True), (None, Equator(), True)]
)
@pytest.mark.parametrize("start", [START, MANY], ids=["one", "many"])
def test_a_checkpoint_after_so_many_steps(record, events, t_eval, start, tmp_path: Path):
    """With events and with t_eval too, and where it was asked for."""
    path = tmp_path / "run.npz"
    plan = lm.Plan(BODY, lm.RKMK(order=4), 0.05, every=3, record=record, events=events,
                   compiled=False)  # fmt: skip
    t = np.linspace(0.0, 5.0, 22) if t_eval else None
    whole = plan.run(start, t_end=5.0, t_eval=t, checkpoint=path, checkpoint_every="30 steps")
    part = lm.Trajectory.load(path)
    if events and start is MANY:  # one after the other: 100 steps of the first, 80 of the second
        assert [one.step for one in part.carry.members] == [100, 80]
        rest = plan.resume(part, t_end=5.0)
        assert np.array_equal(rest.mu[-1], whole.mu[-1])
        return
    assert part.carry.step == 90
    more = None if t is None else t[t > 4.5]
    assert same(part.then(plan.resume(part, t_end=5.0, t_eval=more)), whole)


def test_a_checkpoint_of_adaptive_steps_with_events(tmp_path: Path):
    path = tmp_path / "run.npz"
    plan = lm.Plan(BODY, lm.RKMK(order=5), rtol=1e-7, events=Equator(), compiled=False)
    whole = plan.run(START, t_end=25.0, checkpoint=path, checkpoint_every="30 steps")
    part = lm.Trajectory.load(path)
    assert part.steps % 30 == 0 and 0 < part.steps < whole.steps
    assert same(part.then(plan.resume(part, t_end=25.0)), whole)


DISKS = {
    "steps": (BODY, lm.RKMK(order=4), {"h": 0.05}, {"steps": 40}),
    "events": (BODY, lm.RKMK(order=4), {"h": 0.05, "events": Equator()}, {"steps": 40}),
    "times": (BODY, lm.RKMK(order=4), {"h": 0.05}, {"t_end": 2.0, "t_eval": [0.5, 1.5, 2.0]}),
    "energies": (BODY, lm.RKMK(order=4), {"h": 0.05, "record": "energy"}, {"steps": 40}),
    "adaptive": (BODY, lm.RKMK(order=5), {"rtol": 1e-9}, {"t_end": 20.0}),
    "fictive": (
        lm.Kepler(),
        lm.ReversibleController(lm.StormerVerlet(), sigma=lm.time_scales.DistancePower(1.5)),
        {"h": 0.02},
        {"steps": 40},
    ),
}


@pytest.mark.parametrize("bodies", [False, True])
@pytest.mark.parametrize("kind", DISKS)
def test_a_checkpoint_that_cannot_be_written(kind: str, bodies: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The run goes on, and what is on the disk is what was written last."""
    system, method, given, how = DISKS[kind]
    start = MANY if bodies else START
    if kind == "fictive":
        start = lm.Kepler().pericentre(0.3)
        if bodies:
            start = system.state(q=[start.q] * 3, p=[start.p] * 3)
    path = tmp_path / "run.npz"
    plan = lm.Plan(system, method, compiled=False, **given)
    whole, save, asked = plan.run(start, **how), lm.Trajectory.save, []

    def full(run: Any, path: Any) -> None:
        asked.append(run.steps)
        if kept is None or len(asked) > kept:
            raise OSError(28, "No space left on device")
        save(run, path)

    monkeypatch.setattr(lm.Trajectory, "save", full)
    for kept in (None, 1):
        asked.clear()
        with pytest.warns(RuntimeWarning) as told:
            run = plan.run(start, checkpoint=path, checkpoint_every="7 steps", **how)
        assert run == whole
        first, last = [str(w.message) for w in told if "checkpoint" in str(w.message)]
        assert "run.npz cannot be written, OSError: [Errno 28] No space left" in first
        assert len(asked) > 1 and f"{len(asked) - (kept or 0)} could not be written" in last
        assert ("up to step" if kept else "nothing is there of it") in last
        assert path.exists() == bool(kept)
    assert lm.Trajectory.load(path).steps == asked[0]


@pytest.mark.compiled
@pytest.mark.parametrize("bodies", [False, True])
@pytest.mark.parametrize("kind", DISKS)
def test_an_interrupt_while_native_code_is_made(kind: str, bodies: bool, monkeypatch: pytest.MonkeyPatch):
    """Is one of the run, and it goes on from where it was to begin."""
    system, method, given, how = DISKS[kind]
    start = MANY if bodies else START
    if kind == "fictive":
        start = lm.Kepler().pericentre(0.3)
        if bodies:
            start = system.state(q=[start.q] * 3, p=[start.p] * 3)
    plain = lm.Plan(system, method, compiled=False, **given)
    how = {name: x for name, x in how.items() if name != "t_eval"}
    whole = plain.run(start, **how)

    def pressed(*call: Any, **options: Any) -> Any:
        raise KeyboardInterrupt

    monkeypatch.setattr(kernel, "kernel", pressed)
    monkeypatch.setattr(kernel, "known", lambda *call, **options: None)
    plan = lm.Plan(system, method, compiled=True, **given)
    with pytest.raises(lm.errors.IntegrationInterrupted, match="interrupted") as stop:
        plan.run(start, **how)
    begun = stop.value.trajectory
    assert begun.steps == 0 and begun.t[-1].max() == 0.0
    assert plain.resume(begun, **how).t[-1].max() == whole.t[-1].max()
    with pytest.raises(lm.errors.IntegrationInterrupted, match="interrupted") as stop:
        plan.resume(begun, **how)
    assert stop.value.trajectory.steps == 0


@pytest.mark.parametrize("verb", ["begin", "stepper", "tangent"])
def test_ctrl_c_while_native_code_is_made_for_what_is_no_run(verb: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """It leaves the start, too."""

    def pressed(*call: Any, **options: Any) -> Any:
        raise KeyboardInterrupt

    monkeypatch.setattr(kernel, "kernel", pressed)
    monkeypatch.setattr(kernel, "known", lambda *call, **options: None)
    plan = lm.Plan(BODY, lm.RKMK(order=4), 0.05, compiled=True)
    more = {"steps": 3} if verb == "tangent" else {}
    with pytest.raises(lm.errors.IntegrationInterrupted, match="before the steps") as stop:
        getattr(plan, verb)(START, **more)
    run: Any = stop.value.trajectory
    assert run.steps == 0 and np.array_equal(run.mu[0], START.mu)


def test_a_disk_that_has_room_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    save, asked = lm.Trajectory.save, []

    def full(run: Any, path: Any) -> None:
        asked.append(run.steps)
        if len(asked) in (2, 3):
            raise PermissionError(13, "Permission denied")
        save(run, path)

    monkeypatch.setattr(lm.Trajectory, "save", full)
    plan, path = lm.Plan(BODY, lm.RKMK(order=4), 0.05, compiled=False), tmp_path / "run.npz"
    with pytest.warns(RuntimeWarning, match="Permission denied; the run goes on") as told:
        plan.run(START, steps=40, checkpoint=path, checkpoint_every="7 steps")
    assert len(told) == 1 and asked == [7, 14, 21, 28, 35]
    assert lm.Trajectory.load(path).steps == 35


@lm.record
class Walled(lm.Hamiltonian):
    """A free body that has no energy where mu_2 > 0.9."""

    def energy(self, mu: lm.Vec) -> float:
        if mu[1] > 0.9:
            raise ValueError("wall")
        return 0.5 * mu[0] ** 2 + mu[1] ** 2 + 1.5 * mu[2] ** 2


@pytest.mark.parametrize("compiled", [False, pytest.param(True, marks=pytest.mark.compiled)])
@pytest.mark.parametrize("adaptive", [False, True])
def test_a_checkpoint_of_what_cannot_be_recorded(compiled: bool, adaptive: bool, tmp_path: Path):
    """The first error is raised, with what could be recorded of all bodies."""
    system = lm.LiePoissonSystem(lm.SO3(), Walled())
    how: Any = {"t_end": -2.0} if adaptive else {"steps": 45}
    steps: Any = {"rtol": 1e-6} if adaptive else {"h": -0.05, "events": lambda t, s: s.mu[1]}
    plan = lm.Plan(system, lm.RKMK(order=5), record="energy", compiled=compiled, **steps)
    start = system.state(mu=[[0.1, 0.2, 0.3], [-1.91, 0.9003, -0.48]])
    with pytest.raises(ValueError, match="wall") as caught:
        plan.run(start, checkpoint=tmp_path / "run.npz", checkpoint_every="7 steps", **how)
    error: Any = caught.value
    assert error.trajectory.bodies == 2 and [*error.trajectory.states] == ["energy"]


def test_how_often_a_checkpoint_is_written(tmp_path: Path):
    path = tmp_path / "run.npz"
    plan = lm.Plan(BODY, lm.RKMK(order=2), 0.1, compiled=False)
    short = plan.run(START, steps=30, checkpoint=path, checkpoint_every=timedelta(days=1))
    assert lm.Trajectory.load(path) == short  # at its end
    path.unlink()
    plan.run(START, steps=30, checkpoint=path, checkpoint_every=timedelta(0))
    assert path.exists()
    for wrong in "ten steps", "10", "3.5 steps", "10 s":
        with pytest.raises(errors.InvalidInput, match="a text such as '1000 steps'; got"):
            plan.run(START, steps=30, checkpoint=path, checkpoint_every=wrong)
    with pytest.raises(errors.InvalidInput, match="checkpoint_every must be at least 1"):
        plan.run(START, steps=30, checkpoint=path, checkpoint_every="0 steps")


# ---------------------------------------------------------------- tangent maps


@pytest.mark.parametrize("ending", ["npz", "h5"])
def test_tangent_maps_in_files(ending, tmp_path: Path):
    if ending == "h5":
        pytest.importorskip("h5py")
    path = tmp_path / f"map.{ending}"
    runs = [
        lm.Plan(KEPLER, lm.StormerVerlet(), h=0.1, compiled=False).tangent(
            PLANETS, steps=3, by=["start", "attraction"]
        ),
        lm.Plan(KEPLER, CLOCK, h=0.1, compiled=False).tangent(PLANET, steps=2),
    ]
    for run in runs:
        run.save(path)
        found: Any = lm.Trajectory.load(path)
        assert type(found) is type(run) and found.tangent.keys() == run.tangent.keys()
        assert all(np.array_equal(found.tangent[n], x) for n, x in run.tangent.items())
        assert np.array_equal(found.q, run.q) and found.system == run.system
        assert (found.tau is None) == (run.tau is None)
        assert run.tau is None or np.array_equal(found.tau, run.tau)
        with pytest.raises(errors.InvalidInput, match="multiply the maps"):
            lm.Plan(KEPLER, lm.StormerVerlet(), h=0.1).resume(found, steps=1)


# ---------------------------------------------------------------- equal runs


def test_runs_compare(tmp_path: Path):
    """Equal are those of equal systems and methods with the same samples and events, to the bit."""
    plan = lm.Plan(BODY, lm.RKMK(order=3), 0.5, events=Equator(), compiled=False)
    run = plan.run(START, steps=8)
    run.save(tmp_path / "run.npz")
    loaded = lm.Trajectory.load(tmp_path / "run.npz")
    for same_run in plan.run(START, steps=8), pickle.loads(pickle.dumps(run)), loaded:
        assert run == same_run and hash(run) == hash(same_run)
    moved = BODY.state(mu=np.array(START.mu) * (1.0 + 2.0**-50), g=np.eye(3))
    other = lm.RigidBody([1.0, 1.5, 2.1])
    for unlike in (
        plan.run(moved, steps=8),
        plan.run(START, steps=7),
        plan.replace(events=()).run(START, steps=8),
        plan.replace(system=other).run(START, steps=8),
        plan.run(BODY.state(START.mu), steps=8),
        plan.tangent,
    ):
        assert run != unlike
    many = lm.Plan([BODY, other], lm.RKMK(order=3), 0.5, compiled=False)
    assert many.run(MANY, steps=2) == many.run(MANY, steps=2)
    assert many.run(MANY, steps=2) != lm.Plan(BODY, lm.RKMK(order=3), 0.5).run(MANY, steps=2)
    clock = lm.Plan(KEPLER, CLOCK, h=0.1, compiled=False)
    assert clock.run(PLANET, steps=2) == clock.run(PLANET, steps=2) != clock.run(PLANET, steps=3)
    maps = [clock.tangent(PLANET, steps=1, by=by) for by in ("start", "start", "attraction")]
    assert maps[0] == maps[1] != maps[2]


# ---------------------------------------------------------------- Ctrl-C


@pytest.mark.parametrize("how", [dict(h=0.1), dict(rtol=1e-8)], ids=["fixed", "adaptive"])
@pytest.mark.parametrize("t_eval", [None, [0.0, 0.3, 0.9]])
def test_an_interrupt_while_formulas_are_recorded(how, t_eval):
    def stop(t: float, state: Any) -> float:
        if t > 0.55:
            raise KeyboardInterrupt
        return t

    plan = lm.Plan(BODY, lm.RKMK(order=5), record=["mu", ("a", stop)], compiled=False, **how)
    with pytest.raises(errors.IntegrationInterrupted, match="the samples before") as caught:
        plan.run(BODY.state(START.mu), t_end=1.0, t_eval=t_eval)
    kept: Any = caught.value.trajectory
    assert len(kept) > 1 and np.array_equal(kept.a, kept.t) and kept.carry is None
    assert kept.t[-1] < 0.55 and len(kept.mu) == len(kept)


def test_an_interrupt_between_the_parts_of_a_run(monkeypatch):
    """In Python that is nobody's formula: what was recorded is there."""
    monkeypatch.setattr(equal, "STEPS", 8)
    for kind, how in ((keep.Quantities, dict(record="energy")), (keep.Every, dict(events=Equator()))):
        plan = lm.Plan(BODY, lm.RKMK(order=2), h=0.1, compiled=False, **how)  # type: ignore[arg-type]
        whole, calls = plan.run(START, steps=50), []
        name = "flush" if kind is keep.Quantities else "see"
        true = getattr(kind, name)

        def kept(self, *given, true=true, calls=calls):
            calls.append(None)
            if len(calls) == 3:
                raise KeyboardInterrupt
            return true(self, *given)

        monkeypatch.setattr(kind, name, kept)
        with pytest.raises(errors.IntegrationInterrupted, match=r"after \d+ (of 50 )?steps") as caught:
            plan.run(START, steps=50)
        run: Any = caught.value.trajectory
        assert 5 < len(run) < 51 and np.array_equal(run.t, whole.t[: len(run)])
        assert all(np.array_equal(x, whole.states[n][: len(run)]) for n, x in run.states.items())
