"""Functions of the state kept instead of the state: the values of the samples, in memory for themselves alone."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import scenes_of_runs

import liemech as lm
from liemech import errors
from liemech.simulation.runs import equal

BODY = lm.RigidBody([1.0, 1.5, 2.0])
START = BODY.state(mu=[0.5, 0.0, 0.75**0.5], g=np.eye(3))
RNG = np.random.default_rng(2)
MANY = BODY.state(mu=RNG.normal(size=(3, 3)), g=np.broadcast_to(np.eye(3), (3, 3, 3)))
STEPS = dict(method=lm.RKMK(order=2), h=0.1, compiled=False)


def tilt(t, state):
    return state.g[2, 2]


@lm.record
class Distance(lm.Record):
    """How far the momentum is from a place."""

    place: lm.Vec

    def __call__(self, t, state):
        return lm.norm(state.mu - self.place)


KEPT = ("mu", "energy", "casimirs", tilt, ("turned", lambda t, state: t * state.mu), ("far", Distance([1.0, 0.0, 0.0])))


def same(run, full):
    """Is what was kept what the states of the other run give?"""
    assert np.array_equal(run.t, full.t) and run.steps == full.steps and "g" not in run.states
    assert np.array_equal(run.mu, full.mu) and np.array_equal(run.tilt, full.g[..., 2, 2])
    assert np.array_equal(run.energy, full.energy) and np.array_equal(run.casimirs, full.casimirs)
    t = full.t.reshape(-1, *[1] * (full.mu.ndim - 1))
    assert np.array_equal(run.turned, t * full.mu)
    x, y, z = np.moveaxis(full.mu - [1.0, 0.0, 0.0], -1, 0)
    assert np.array_equal(run.far, np.sqrt(x * x + y * y + z * z))


@pytest.mark.sample(3)
@pytest.mark.parametrize("every", [1, 7, 500])
@pytest.mark.parametrize("start", [START, MANY], ids=["one", "many"])
def test_what_is_kept_is_that_of_the_samples(every, start, monkeypatch):
    monkeypatch.setattr(equal, "STEPS", 30)  # in parts that do not end at samples
    monkeypatch.setattr(equal, "SAMPLES", 20)
    full = lm.integrate(BODY, start=start, steps=100, every=every, **STEPS)
    same(lm.integrate(BODY, start=start, steps=100, every=every, record=KEPT, **STEPS), full)


def test_resumed_saved_joined_and_its_last_state(tmp_path: Path):
    plan = lm.Plan(BODY, lm.RKMK(order=2), h=0.1, record=("energy", tilt), compiled=False)
    first = plan.run(START, steps=10)
    first.save(tmp_path / "run.npz")
    first = lm.Trajectory.load(tmp_path / "run.npz")
    whole, joined = plan.run(START, steps=30), first.then(plan.resume(first, steps=20))
    assert np.array_equal(joined.energy, whole.energy) and joined.observed == whole.observed == ("energy", "tilt")
    assert np.array_equal(whole.last.mu, lm.integrate(BODY, start=START, steps=30, **STEPS).mu[-1])
    assert whole.drift()["energy"].largest < 1e-2
    with pytest.raises(errors.InvalidInput, match="recorded energy, tilt"):
        lm.Plan(BODY, lm.RKMK(order=2), h=0.1).resume(first, steps=1)
    for what in ("casimirs", "spatial_momentum"):
        with pytest.raises(errors.InvalidInput, match="needs"):
            getattr(whole, what)
    with pytest.raises(errors.InvalidInput, match="kept all its steps"):
        whole.at(0.5)


def test_failures_keep_what_there_was(monkeypatch):
    monkeypatch.setattr(equal, "STEPS", 8)

    def far(t, state):
        if t > 0.55:
            raise ValueError("far")
        return t

    with pytest.raises(errors.IntegrationFailure, match=r"record='far': ValueError: far .*at t = 0.56") as caught:
        lm.integrate(BODY, start=START, steps=100, record=("energy", far), **STEPS | {"h": 0.02})
    kept = caught.value.trajectory
    assert 9 <= len(kept) <= 28 and np.array_equal(kept.far, kept.t) and len(kept.energy) == len(kept)


def test_a_body_that_stops_stays(monkeypatch):
    monkeypatch.setattr(equal, "STEPS", 12)

    @lm.record
    class Wall(lm.Force):
        limit: float

        def covector(self, t, xi, g):
            if t > self.limit:
                raise ValueError("wall")
            return lm.vec(0.1, 0.0, 0.0)

    systems = [lm.MechanicalSystem(lm.RigidBody([1.0, 1.5, 2.0]), lm.NoPotential(), load=Wall(x)) for x in (0.55, 0.35)]
    start = systems[0].state(mu=[[1.0, 0.0, 0.1]] * 2, g=[np.eye(3)] * 2)
    how = dict(method=lm.RKMK(order=2), start=start, h=0.1, steps=20, compiled=False)
    with pytest.warns(RuntimeWarning, match="2 of 2 bodies stopped early") as warned:
        full = lm.integrate(systems, **how)
        run = lm.integrate(systems, record=("mu", tilt), **how)
    assert len(warned) == 2
    assert (
        np.array_equal(run.t, full.t)
        and np.array_equal(run.mu, full.mu)
        and np.array_equal(run.tilt, full.g[..., 2, 2])
    )
    assert run.stopped.steps == full.stopped.steps


@pytest.mark.slow
@pytest.mark.compiled
def test_memory_is_that_of_what_is_kept():
    """The states of 2 10^5 samples would take 24 bytes each, their energies and times take 16."""
    plan = lm.Plan(BODY, lm.CovariantVariational(), h=0.1, record="energy", compiled=True, progress=False)
    start = BODY.state(mu=[0.5, 0.0, 0.75**0.5])
    plan.run(start, steps=1000)
    tracemalloc.start()
    plan.replace(every=5).run(start, steps=1_000_000)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 2 * 200_001 * 16 + 8e6  # joined at the end, beside a part of 65,536 samples


@pytest.mark.parametrize(
    ("record", "words"),
    [
        (lambda t, state: 1.0, "function without a name"),
        ([("a", lambda t, state: np.array([1.0]))], "gives a number"),
        ([("a", lambda t, state: 1)], "gives a number"),
        (("t", tilt), "record is"),
        ([("t", tilt)], "the name of something else"),
        ([("drift", tilt)], "the name of something else"),
        (("velocity_of_light",), "record is"),
    ],
)
def test_what_cannot_be_kept_is_refused(record, words):
    with pytest.raises(errors.LiemechError, match=words):
        lm.integrate(BODY, start=START, steps=3, record=record, **STEPS)


@pytest.mark.parametrize("scene", scenes_of_runs.FAILING, ids=lambda scene: scene.name)
@pytest.mark.parametrize("samples", [None, 12], ids=["all kept", "a few at a time"])
def test_the_run_of_a_body_that_stops_has_what_is_kept(scene, samples, monkeypatch):
    """As far as it came; not the states, which were not asked for."""
    if samples is not None:
        monkeypatch.setattr(equal, "SAMPLES", samples)
    known, times = scenes_of_runs.observer(scene, "functions")
    plan = lm.Plan(scene.system, scene.method, compiled=False, progress=False, **scene.options | known)
    with pytest.warns(RuntimeWarning, match="stopped early"):
        run = plan.run(scene.start(3), **scene.spans({})[0] | times)
    for i, stop in run.stopped.items():
        own = stop.error.trajectory
        assert own.states.keys() == run.states.keys() and own.observed == run.observed
        for name, x in own.states.items():
            assert len(x) == len(own) <= stop.steps + 1
            assert np.array_equal(x, run.states[name][: len(own), i]), name


@lm.record
class Products(lm.Hamiltonian):
    """An energy that is zero on the axes."""

    k: float

    def energy(self, mu):
        return self.k * (mu[0] * mu[1] + 0.3 * mu[2] * mu[0] + 0.1 * mu[1] * mu[2])


@pytest.mark.parametrize("unit", [1.0, 1e-14, 1e14])
def test_a_recorded_energy_that_begins_at_zero_drifts_in_any_unit(unit):
    """Of small ones a drift was told to be exact: its changes were measured beside one."""
    system = lm.LiePoissonSystem(lm.SO3(), Products(1.0 / unit))
    start = system.state(mu=[0.0, unit, 0.0])
    run = lm.integrate(system, lm.RKMK(order=2), start, h=0.1, steps=400, record="energy", compiled=False)
    assert run.energy[0] == 0.0 and run.drift()["energy"].verdict == "drifting"


def test_an_attraction_is_recorded_before_there_are_samples():
    """Its energy has a pole at zero, which stood for states that are not there yet."""
    kepler = lm.Kepler()
    start = kepler.state(q=[0.8, 0.0], p=[0.0, 1.3])
    ways = dict(record="energy", t_end=0.9, rtol=1e-9, compiled=False)
    run = lm.integrate(kepler, lm.RKMK(order=5), start, t_eval=[0.8, 0.9], **ways)
    assert np.abs(run.energy - (0.5 * 1.3**2 - 1.0 / 0.8)).max() < 1e-7
    assert lm.integrate(kepler, lm.RKMK(order=5), start, t_eval=[], **ways).energy.shape == (0,)
