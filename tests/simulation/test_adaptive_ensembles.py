"""Adaptive ensembles in the lanes of native code: bit for bit what every body does alone."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes_of_runs import python_first
from scipy.integrate import solve_ivp

import liemech as lm
from liemech.errors import IntegrationFailure, StepTooSmall
from liemech.simulation import keep
from liemech.simulation.compiled import lanes
from liemech.simulation.runs import run
from liemech.tableaus import BOGACKI_SHAMPINE3

pytestmark = pytest.mark.compiled

METHOD = lm.RKMK(tableau=BOGACKI_SHAMPINE3)
BODY, RNG = lm.RigidBody([1.0, 1.5, 2.0]), np.random.default_rng(7)
MU = RNG.normal(size=(40, 3)) * RNG.uniform(0.1, 4.0, size=(40, 1))
PLAN = lm.Plan(BODY, METHOD, rtol=1e-5, progress=False)
TIMES = np.array([0.0, 0.3, 0.30001, 1.0, 1.0, 1.7, 2.0])


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few bodies at once, and few trials, so that lanes take the next bodies often."""
    monkeypatch.setattr(run.Run, "room", 16)
    monkeypatch.setattr(run, "LONGEST", 8)
    monkeypatch.setattr(lanes, "TRIALS", 1)
    monkeypatch.setattr(keep, "ROWS", 20)


def native(**changed: Any) -> lm.Plan:
    return PLAN.replace(compiled=True, **changed)


def alone(i: int, plan: lm.Plan = PLAN, **how: Any) -> lm.Trajectory:
    return plan.run(BODY.state(mu=MU[i]), **how)


@pytest.mark.sample(5)
@pytest.mark.parametrize("workers", [1, 2])
@pytest.mark.parametrize("bodies", [1, 3, 8, 17, 40])
def test_every_body_is_what_it_is_alone(bodies: int, workers: int) -> None:
    """Only the ends, which differ; whatever the number of bodies, of lanes and of threads."""
    ends = np.linspace(0.5, 6.0, bodies)
    ends[0] = 0.0  # it has nowhere to go
    runs = native(workers=workers).run(BODY.state(mu=MU[:bodies]), t_end=ends)
    assert runs.compiled and runs.t.shape == (2, bodies) and not runs.stopped
    many = [alone(i, t_end=ends[i], t_eval=[0.0, ends[i]]) for i in range(0, bodies, 3)]
    for i, one in zip(range(0, bodies, 3), many, strict=True):
        assert np.array_equal(runs.mu[:, i], one.mu) and np.array_equal(runs.t[:, i], one.t)
    if bodies < 4:
        whole = [alone(i, t_end=ends[i]) for i in range(bodies)]
        assert runs.steps == max(one.steps for one in whole)
        assert runs.rejected == sum(one.rejected or 0 for one in whole)
        assert runs.h == np.mean([one.h for one in whole])


@pytest.mark.slow
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("own", [False, True])
def test_samples_between_the_steps(sign: float, own: bool) -> None:
    """At the same times, and every body at its own; forwards and backwards."""
    times = sign * (TIMES[:, None] * np.linspace(1.0, 2.0, 17) if own else TIMES)
    t_end = times[-1]
    runs = native().run(BODY.state(mu=MU[:17]), t_end=t_end, t_eval=times)
    for i in range(0, 17, 4):
        mine = times[:, i] if own else times
        one = alone(i, t_end=mine[-1], t_eval=mine)
        assert np.array_equal(runs.mu[:, i], one.mu)
    assert np.array_equal(runs.t, times)


@pytest.mark.slow
def test_pieces_become_shorter_where_they_take_long(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bodies that wait for the others in the middle of their way go on where they stood."""
    whole = native().run(BODY.state(mu=MU), t_end=4.0, t_eval=TIMES)
    monkeypatch.setattr(run, "PATIENCE", 0.0)
    monkeypatch.setattr(run.Run, "room", 32)
    slow = native().run(BODY.state(mu=MU), t_end=4.0, t_eval=TIMES)
    assert np.array_equal(slow.mu, whole.mu) and slow.steps == whole.steps
    assert np.array_equal(slow.carry.state.mu, whole.carry.state.mu)


def test_plain_python_begins_and_lanes_take_over(monkeypatch: pytest.MonkeyPatch) -> None:
    """The bits do not tell where."""
    whole = native().run(BODY.state(mu=MU[:19]), t_end=2.0, t_eval=TIMES)
    python_first(monkeypatch, 13)
    mixed = native().run(BODY.state(mu=MU[:19]), t_end=2.0, t_eval=TIMES)
    assert np.array_equal(mixed.mu, whole.mu) and mixed.steps == whole.steps
    assert mixed.h == whole.h and mixed.rejected == whole.rejected
    again = [native().resume(run, t_end=2.5) for run in (mixed, whole)]
    assert np.array_equal(again[0].mu, again[1].mu)


# ------------------------------------------------------------------ bodies that fail


@lm.record
class Blowing(lm.Hamiltonian):
    """mu_3' = mu_3^2 at mu = (1, 0, mu_3) on R^3 with one bracket: without bound at t = 1 / mu_3."""

    def energy(self, mu: lm.Vec) -> float:
        return mu[0] * mu[2] * mu[2] * mu[1]


UNBOUNDED = lm.LiePoissonSystem(lm.SO3(), Blowing())
STARTS = np.array([[0.0, 0.0, 1.0], [1.0, 2.0, 3.0], [0.0, 1.0, 0.0], [0.3, 0.2, 0.1]])


@pytest.mark.slow
@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("t_eval", [None, [0.0, 0.1, 50.0]])
def test_a_body_that_fails_stands_at_its_last_accepted_state(compiled: bool, t_eval: Any) -> None:
    """It is told with its steps and the reason, as it is alone; the others come to the end."""
    plan = lm.Plan(UNBOUNDED, METHOD, rtol=1e-4, compiled=compiled, progress=False)
    with pytest.raises(StepTooSmall) as caught:
        plan.replace(dense=True).run(UNBOUNDED.state(mu=STARTS[1]), t_end=50.0, steps=40)
    single = caught.value.trajectory
    with pytest.warns(RuntimeWarning, match="1 of 4 bodies stopped early: body 1 after 40 steps"):
        runs = plan.run(UNBOUNDED.state(mu=STARTS), t_end=50.0, steps=40, t_eval=t_eval)
    assert [*runs.stopped] == [1] and runs.stopped[1].steps == single.steps == 40
    assert str(runs.stopped[1].error) == str(caught.value)
    assert isinstance(runs.stopped[1].error, IntegrationFailure)
    assert np.array_equal(runs.mu[-1, 1], single.mu[-1])
    for i in (0, 2, 3):
        one = plan.run(UNBOUNDED.state(mu=STARTS[i]), t_end=50.0, t_eval=[50.0])
        assert np.array_equal(runs.mu[-1, i], one.mu[-1])
    with pytest.warns(RuntimeWarning, match="1 of 4 bodies stopped early: body 1"):
        rest = plan.resume(runs, t_end=51.0)
    assert np.array_equal(rest.mu[-1, 1], single.mu[-1]) and rest.stopped[1].steps == 40


def test_a_body_that_fails_has_its_own_time_where_bodies_have() -> None:
    """Where it stands no time goes by; bodies that share their times go on sharing them."""
    kepler = lm.Kepler()
    start = kepler.state(q=[[0.6, 0.0], [0.5, 0.0]], p=[[0.0, 1.4], [0.0, 0.0]])
    plan, t = lm.Plan(kepler, METHOD, rtol=1e-4, progress=False), np.linspace(0.0, 2.0, 5)
    with pytest.warns(RuntimeWarning, match="1 of 2 bodies stopped early: body 1"):
        own = plan.run(start, t_end=[2.0, 2.0], t_eval=np.stack([t, t], axis=1))
    assert np.array_equal(own.t[:, 0], t)
    assert 0.3 < own.carry.t[1] < 0.4 and set(own.t[:, 1]) == {0.0, own.carry.t[1]}
    with pytest.warns(RuntimeWarning, match="1 of 2 bodies stopped early: body 1"):
        shared = plan.run(start, t_end=2.0, t_eval=t)
    assert np.array_equal(shared.t, t) and np.array_equal(shared.q, own.q)


@pytest.mark.parametrize("compiled", [True, False])
def test_a_body_whose_step_becomes_too_small(compiled: bool, tmp_path: Path) -> None:
    """A planet falls into the sun: alone and beside others it fails at the same step."""
    kepler = lm.Kepler()
    plan = lm.Plan(kepler, METHOD, rtol=1e-4, compiled=compiled, progress=False)
    q, p = [[0.6, 0.0], [0.5, 0.0], [0.7, 0.0]], [[0.0, 1.4], [0.0, 0.0], [0.0, 1.1]]
    with pytest.raises(IntegrationFailure) as caught:
        plan.run(kepler.state(q=q[1], p=p[1]), t_end=2.0)
    single: Any = caught.value
    with pytest.warns(RuntimeWarning, match="1 of 3 bodies stopped early: body 1"):
        runs = plan.run(kepler.state(q=q, p=p), t_end=2.0)
    assert str(runs.stopped[1].error) == str(single)
    assert np.array_equal(runs.q[-1, 1], single.trajectory.q[-1])
    assert runs.stopped[1].steps == single.trajectory.steps
    runs.save(tmp_path / "runs.npz")
    assert np.array_equal(lm.Trajectory.load(tmp_path / "runs.npz").q, runs.q)


@lm.record
class Walled(lm.Hamiltonian):
    """A free body that has no energy where mu_2 > 0.9."""

    inertia: lm.Vec

    def energy(self, mu: lm.Vec) -> float:
        if mu[1] > 0.9:
            raise ValueError("wall")
        return 0.5 * lm.dot(mu, mu / self.inertia)


WALLED = lm.LiePoissonSystem(lm.SO3(), Walled([1.0, 0.6, 0.4]))
BEHIND = [-1.91, 0.9003, -0.48]


@pytest.mark.slow
@pytest.mark.parametrize("compiled", [True, False])
def test_a_body_whose_formula_fails_at_its_start_makes_no_step(compiled: bool) -> None:
    """Though the first step is found by a probe, which goes through the wall."""
    plan = lm.Plan(WALLED, lm.RKMK(order=5), rtol=1e-6, compiled=compiled, progress=False)
    with pytest.raises(IntegrationFailure, match="wall") as alone:
        plan.run(WALLED.state(mu=BEHIND), t_end=1.0)
    with pytest.warns(RuntimeWarning, match="body 1 after 0 steps"):
        runs = plan.run(WALLED.state(mu=[[0.1, 0.2, 0.3], BEHIND]), t_end=1.0)
    assert runs.stopped.steps == {1: 0} and str(runs.stopped[1].error) == str(alone.value)
    assert np.array_equal(runs.mu[:, 1], [BEHIND, BEHIND])


def test_an_interrupt_leaves_every_body_where_it_stands(monkeypatch: pytest.MonkeyPatch) -> None:
    """From there all go on, and come to the same bits."""
    piece, left = run.Run._piece, [3]

    def pressed(self: Any, *args: Any) -> None:
        left[0] -= 1
        if not left[0]:
            raise KeyboardInterrupt
        piece(self, *args)

    starts = BODY.state(mu=MU[:19])
    whole = native().run(starts, t_end=5.0)
    monkeypatch.setattr(run.Run, "_piece", pressed)
    with pytest.raises(KeyboardInterrupt) as caught:
        native().run(starts, t_end=5.0)
    told: Any = caught.value.trajectory  # type: ignore[attr-defined]
    assert np.array_equal(told.t[-1], told.carry.t)
    assert ((told.t[-1] > 0.0) & (told.t[-1] < 5.0)).any() and (told.t[-1] == 0.0).any()
    assert np.array_equal(native().resume(told, t_end=5.0).mu[-1], whole.mu[-1])


def test_bodies_that_fail_before_and_after_lanes_take_over(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each as it does alone."""
    plan = lm.Plan(UNBOUNDED, METHOD, rtol=1e-4, compiled=True, progress=False)
    starts = UNBOUNDED.state(mu=STARTS[[1, 0, 1, 3]])
    with pytest.warns(RuntimeWarning, match="2 of 4 bodies stopped early"):
        whole = plan.run(starts, t_end=50.0, steps=40)
    python_first(monkeypatch, 9)
    with pytest.warns(RuntimeWarning, match="2 of 4 bodies stopped early"):
        mixed = plan.run(starts, t_end=50.0, steps=40)
    assert [*mixed.stopped] == [*whole.stopped] == [0, 2]
    assert np.array_equal(mixed.mu, whole.mu) and np.array_equal(mixed.mu[:, 0], mixed.mu[:, 2])
    assert str(mixed.stopped[0].error) == str(mixed.stopped[2].error)
    assert mixed.stopped.steps == whole.stopped.steps
    with pytest.warns(RuntimeWarning, match="2 of 4 bodies"):
        assert np.array_equal(plan.resume(mixed, t_end=51.0).mu, plan.resume(whole, t_end=51.0).mu)


@lm.record
class Bounded(lm.Hamiltonian):
    """A free body that is known for mu_2 >= 0 only."""

    def gradient(self, mu: lm.Vec) -> lm.Vec:
        if mu[1] < 0.0:
            raise ArithmeticError("nothing is known there")
        return lm.vec(mu[0], mu[1] / 1.5, mu[2] / 2.0)


@pytest.mark.slow
def test_steps_of_one_length_that_fail_between_two_samples() -> None:
    """Of bodies with ends or events of their own too: it stands where it came to."""
    system = lm.LiePoissonSystem(lm.SO3(), Bounded())
    plan = lm.Plan(system, lm.RKMK(order=4), 0.05, compiled=False)
    mu = np.array([[0.0, 1.0, 0.0], [0.5, 1.0, 1.0], [0.0, 0.0, 1.0]])
    with pytest.raises(IntegrationFailure) as caught:
        plan.run(system.state(mu=mu[1]), steps=1000)
    single: Any = caught.value
    taken = single.trajectory.steps
    assert taken % 10 != 0 and np.array_equal(single.reached.mu, single.trajectory.mu[-1])
    for events in ((), (lambda t, state: 1.0,)):
        many = plan.replace(every=10, events=events)
        with pytest.warns(RuntimeWarning, match=f"1 of 3 bodies .* body 1 after {taken} steps"):
            runs = many.run(system.state(mu=mu), t_end=[10.0, 10.0, 10.0])
        assert np.array_equal(runs.mu[-1, 1], single.reached.mu)
        assert np.array_equal(runs.mu[-1, [0, 2]], mu[[0, 2]])


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("bodies", [1, 17])
@pytest.mark.parametrize("method", [lm.RKMK(order=5), lm.Taylor(order=10)], ids=repr)
def test_breaks_without_samples_between(method: Any, bodies: int) -> None:
    body = lm.RigidBody([1.0, 1.5, 2.0])
    start = body.state(mu=np.random.default_rng(4).normal(size=(bodies, 3)))
    for t_end in (3.0, 2.0):  # a jump at the end, too
        runs = [
            lm.integrate(body, method, start, t_end=t_end, breaks=[1.0, 2.0], compiled=compiled)
            for compiled in (False, True)
        ]
        assert runs[1].compiled and runs[0].t[-1] == runs[1].t[-1] == t_end
        assert np.array_equal(runs[0].mu, runs[1].mu)


# --- the motion between the steps
# ---------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize("own", [False, True])
def test_motions_between_steps_are_those_of_every_body_alone(own: bool, compiled: bool) -> None:
    systems = [lm.RigidBody([1.0, 1.5, 2.0 + 0.1 * i * own]) for i in range(5)]
    options = {"rtol": 1e-6, "compiled": compiled, "progress": False, "dense": True}
    plan = lm.Plan(systems if own else BODY, METHOD, **options)
    start, times = (BODY.state(mu=MU[:5], g=np.broadcast_to(np.eye(3), (5, 3, 3))), np.linspace(0, 2, 9))
    run = plan.run(start, t_end=2.0)
    seen = run.at(times)
    assert len(run) == 2 and seen.mu.shape == (9, 5, 3) and run.at(0.3).g.shape == (5, 3, 3)
    for i, system in enumerate(systems):
        alone = system.state(mu=MU[i], g=np.eye(3))
        one = lm.Plan(system, METHOD, **options).run(alone, t_end=2.0).at(times)
        assert np.array_equal(seen.mu[:, i], one.mu) and np.array_equal(seen.g[:, i], one.g)
    assert np.array_equal(plan.run(start, t_end=2.0, t_eval=[0.5, 2.0]).at(times).mu, seen.mu)


def test_motions_between_steps_are_joined_saved_and_divided(tmp_path: Path) -> None:
    plan, start, times = native(dense=True), BODY.state(mu=MU[:40]), np.linspace(0.0, 2.0, 9)
    whole = plan.run(start, t_end=2.0)
    seen = whole.at(times).mu
    half = plan.run(start, t_end=1.0)
    joined = half.then(plan.resume(half, t_end=2.0))
    assert np.array_equal(joined.at(times[:4]).mu, half.at(times[:4]).mu)
    assert np.abs(joined.at(times).mu - seen).max() < 1e-3
    whole.save(tmp_path / "run.npz")
    assert np.array_equal(lm.Trajectory.load(tmp_path / "run.npz").at(times).mu, seen)
    with ThreadPoolExecutor(2) as executor:
        assert np.array_equal(plan.run(start, t_end=2.0, executor=executor).at(times).mu, seen)


def test_motions_between_steps_end_where_every_body_ends() -> None:
    def level(t: float, state: Any) -> Any:
        return state.mu[1]

    level.terminal = True  # type: ignore[attr-defined]
    start = BODY.state(mu=MU[:8])
    run = native(dense=True, events=(level,)).run(start, t_end=4.0)
    for i, motion in enumerate(run.dense.bodies):
        assert motion.t[-1] == run.t[-1, i]
        assert np.array_equal(motion(motion.t[-1]).mu, run.mu[-1, i])


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_bodies_that_have_ended_stay_where_they_are_between_the_steps_of_others(sign: float) -> None:
    """Euler's equations by DOP853."""
    t_end, times = sign * np.array([1.0, 2.0, 3.0]), sign * np.array([0.5, 1.5, 2.5])
    plan = lm.Plan(BODY, lm.RKMK(order=5), rtol=1e-11, dense=True, progress=False)
    run, (a, b, c) = plan.run(BODY.state(mu=MU[:3]), t_end=t_end), 1.0 / np.array(BODY.inertia)

    def euler(_: float, m: Any) -> Any:
        return [(c - b) * m[1] * m[2], (a - c) * m[2] * m[0], (b - a) * m[0] * m[1]]

    found = run.at(times).mu
    for i in range(3):
        for k, t in enumerate(times):
            until = sign * min(abs(t), abs(t_end[i]))
            exact = solve_ivp(euler, (0.0, until), MU[i], method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
            np.testing.assert_allclose(found[k, i], exact, rtol=0.0, atol=1e-8)
    assert np.array_equal(run.at(times[1]).mu, found[1])
    for outside in (sign * 3.1, -sign * 0.1, np.nan):
        with pytest.raises(lm.errors.InvalidInput, match="outside the run"):
            run.at(outside)
