"""Where adaptive runs end: by an event, by a failure, by Ctrl-C, or at their very start."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest
from scenes_of_runs import python_first

import liemech as lm
from liemech.simulation.keep import AtTimes
from liemech.simulation.runs import run as runs
from liemech.simulation.runs.tolerance import ToleranceRun
from liemech.tableaus import BOGACKI_SHAMPINE3

METHOD = lm.RKMK(tableau=BOGACKI_SHAMPINE3)
KEPLER, BODY = lm.Kepler(), lm.RigidBody([1.0, 1.5, 2.0])
FALLING = KEPLER.state(q=[[0.6, 0.0], [0.5, 0.0], [0.7, 0.0]], p=[[0.0, 1.4], [0.0, 0.0], [0.0, 1.1]])
TURNING = BODY.state(mu=[[0.3, 0.4, 2.0], [1.0, -0.5, 0.2], [2.0, 0.1, 0.4]])
WORLDS = pytest.mark.parametrize("compiled", [pytest.param(True, marks=pytest.mark.compiled), False])


def plan(system: Any = KEPLER, compiled: bool | None = True, **how: Any) -> lm.Plan:
    return lm.Plan(system, METHOD, **{"rtol": 1e-4, "progress": False} | how, compiled=compiled)


@WORLDS
def test_a_body_that_fell_into_the_centre_stays_stopped(compiled: bool) -> None:
    """Also in a run that goes on and asks for its samples at other times."""
    falling = plan(compiled=compiled)
    with pytest.warns(RuntimeWarning, match="1 of 3 bodies"):
        before = falling.run(FALLING, t_end=1.0)
    with pytest.warns(RuntimeWarning, match="1 of 3 bodies"):
        after = falling.resume(before, t_end=1.5, t_eval=[1.25, 1.5])
    assert after.stopped.steps == before.stopped.steps and set(after.stopped) == {1}


@pytest.mark.compiled
def test_lanes_can_take_over_from_bodies_of_which_no_samples_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two bodies run in plain Python, then the others in lanes."""
    turning = plan(BODY)
    whole = turning.run(TURNING, t_end=1.0)
    python_first(monkeypatch, 5)
    run = turning.run(TURNING, t_end=1.0, t_eval=[])
    assert run.mu.shape == (0, 3, 3)
    assert np.array_equal(turning.resume(run, t_end=2.0).mu, turning.resume(whole, t_end=2.0).mu)


@pytest.mark.compiled
@pytest.mark.parametrize("where", [(ToleranceRun, "moved"), (AtTimes, "see"), (runs.Run, "_commit")])
def test_after_ctrl_c_every_sample_is_one_of_the_whole_run(where: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Wherever it comes; and from there the run goes on to the same end."""
    turning, times = plan(BODY), [0.0, 0.3, 0.6, 0.9, 1.0]
    whole = turning.run(TURNING, t_end=1.0, t_eval=times)
    true = getattr(*where)

    def pressed(*_: Any) -> None:
        monkeypatch.setattr(*where, true)
        raise KeyboardInterrupt

    monkeypatch.setattr(*where, pressed)
    with pytest.raises(KeyboardInterrupt) as caught:
        turning.run(TURNING, t_end=1.0, t_eval=times)
    run: Any = caught.value.trajectory
    at = np.broadcast_to(run.t[:, None] if run.t.ndim == 1 else run.t, (5, 3))
    for i in range(3):
        place = np.searchsorted(times, at[:, i])
        assert np.array_equal(np.array(times)[place], at[:, i])
        assert np.array_equal(run.mu[:, i], whole.mu[place, i])
    assert np.array_equal(turning.resume(run, t_end=1.0).mu[-1], whole.mu[-1])


def near(t: float, state: Any) -> Any:
    """Is zero at a distance of 1/10 from the centre."""
    return state.q[0] ** 2 + state.q[1] ** 2 - 0.01


near.terminal = True  # type: ignore[attr-defined]


@WORLDS
def test_an_event_ends_runs_before_the_singularity_behind_it(compiled: bool) -> None:
    """A body that falls from rest at 1/2 is at 1/10 after (arccos sqrt(r) + sqrt(r (1 - r))) / 4,
    r = 1/5; from there it could go on.
    """
    falls = plan(compiled=compiled, events=[near], rtol=1e-5)
    states = KEPLER.state(q=[[0.5, 0.0], [0.6, 0.0]], p=[[0.0, 0.0], [0.0, 0.0]])
    both = falls.run(states, t_end=2.0)
    alone = falls.run(KEPLER.state(q=[0.5, 0.0], p=[0.0, 0.0]), t_end=2.0)
    assert alone.t[-1] == pytest.approx((np.arccos(0.2**0.5) + 0.16**0.5) / 4.0, rel=1e-3)
    assert np.max(np.abs(both.q[-1] - [[0.1, 0.0], [0.1, 0.0]])) < 1e-9 and not both.stopped
    assert both.t[-1, 0] == alone.t[-1] and np.array_equal(both.q[-1, 0], alone.last.q)
    assert both.carry is not None and alone.carry is not None
    back = falls.resume(alone, t_end=0.3)  # against the time
    assert back.t[-1] == 0.3 and np.array_equal(falls.resume(both, t_end=0.3).q[-1, 0], back.q[-1])


@WORLDS
def test_steps_beyond_a_terminal_event_are_not_counted(compiled: bool) -> None:
    """Nor are those that were rejected there: the counts are those of a run up to the last step
    before the event, and of one step more.
    """

    def across(t: float, state: Any) -> Any:
        return state.q[0]

    across.terminal = 3  # type: ignore[attr-defined]
    start = KEPLER.state(q=[0.4, 0.0], p=[0.0, 2.0])
    orbit = plan(compiled=compiled, events=[across])
    run = orbit.run(start, t_end=40.0)
    assert run.steps == len(run.t) - 1 and run.h == run.t[-1] / run.steps
    with pytest.raises(lm.errors.StepTooSmall) as caught:  # as many steps as it has made, and no more
        orbit.replace(events=()).run(start, t_end=40.0, steps=run.steps)
    limited: Any = caught.value.trajectory
    assert limited.rejected == run.rejected > 0
    assert np.array_equal(limited.t[:-1], run.t[:-1]) and limited.t[-1] > run.t[-1]


@lm.record
class Unfinished(lm.Hamiltonian):
    """Turns about two axes; nobody knows what it does elsewhere."""

    def gradient(self, mu: lm.Vec) -> lm.Vec:
        if mu[1] < 0.0:
            raise ArithmeticError("nothing known")
        if mu[2] < 0.0:
            raise NotImplementedError("still to be written")
        return lm.vec(mu[0], mu[1] / 1.5, mu[2] / 2.0)


@WORLDS
def test_a_mistake_in_a_formula_is_raised_whatever_bodies_before_it_failed_of(compiled: bool) -> None:
    """At the start as on the way."""
    system = lm.LiePoissonSystem(lm.SO3(), Unfinished())
    for first, second in [((-0.5, 1.0, 1.0), (0.3, 1.0, 0.02)), ((0.5, -1.0, 1.0), (0.3, 0.1, -1.0))]:
        states = system.state(mu=[first, second])
        with pytest.raises(NotImplementedError, match="still to be written") as caught:
            plan(system, compiled).run(states, t_end=10.0)
        assert "body 1" in "".join(caught.value.__notes__)
        run: Any = caught.value.trajectory  # type: ignore[attr-defined]
        assert 0 in run.stopped and np.array_equal(run.mu[0], states.mu)


@pytest.mark.compiled
@pytest.mark.parametrize("where", ["begin", "_march", "together"])
def test_ctrl_c_around_the_steps_keeps_what_there_is(where: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """When lanes begin, in plain Python, and when all is put together."""
    turning, true = plan(BODY), getattr(ToleranceRun, where)
    whole = turning.run(TURNING, t_end=1.0)
    python_first(monkeypatch, 5)

    def pressed(*_: Any) -> None:
        monkeypatch.setattr(ToleranceRun, where, true)
        raise KeyboardInterrupt

    monkeypatch.setattr(ToleranceRun, where, pressed)
    with pytest.raises(KeyboardInterrupt) as caught:
        turning.run(TURNING, t_end=1.0)
    run: Any = caught.value.trajectory
    assert np.array_equal(run.mu[0], whole.mu[0])
    assert np.array_equal(turning.resume(run, t_end=1.0).mu[-1], whole.mu[-1])


@pytest.mark.parametrize("record", [["energy"], ["mu", "energy"]])
def test_a_run_without_samples_knows_what_it_records(record: list[str]) -> None:
    """And goes on."""
    recorded = plan(BODY, compiled=False, record=record)
    start = BODY.state(mu=[0.3, 0.4, 2.0])
    run = recorded.run(start, t_end=1.0, t_eval=[])
    assert list(run.states) == record and run.energy.shape == (0,) and len(run) == 0
    after = recorded.resume(run, t_end=2.0, t_eval=[1.5, 2.0])
    alone = recorded.run(start, t_end=1.0)
    assert np.array_equal(after.energy, recorded.resume(alone, t_end=2.0, t_eval=[1.5, 2.0]).energy)


def component(i: int) -> Any:
    """A momentum that becomes zero; the third time ends the run."""

    def event(t: float, state: Any) -> Any:
        return state.mu[i]

    event.terminal = 3  # type: ignore[attr-defined]
    return event


def test_zeros_of_one_event_do_not_count_for_another_of_its_name() -> None:
    """They do for the event itself; from a file it is known by its name."""
    first, other = (plan(BODY, False, events=[component(i)]) for i in (0, 1))
    start = BODY.state(mu=[0.3, 0.4, 2.0])
    begun = first.run(start, t_end=10.0)
    met = len(begun.events[0][0])
    assert 0 < met < 3 and len(other.resume(begun, t_end=60.0).events[0][0]) == 3
    assert len(first.resume(begun, t_end=60.0).events[0][0]) == 3 - met
    assert len(first.resume(pickle.loads(pickle.dumps(begun)), t_end=60.0).events[0][0]) == 3 - met


def test_a_lambda_of_another_process_is_not_known_by_its_name() -> None:
    """For all have the same one."""

    def lambdas(i: int) -> Any:
        event: Any = lambda t, state: state.mu[i]  # noqa: E731
        event.terminal = 3
        return event

    first, other = (plan(BODY, False, events=[lambdas(i)]) for i in (0, 1))
    begun = first.run(BODY.state(mu=[0.3, 0.4, 2.0]), t_end=10.0)
    sent = pickle.loads(pickle.dumps(begun))
    assert begun.events[0][0].size and len(other.resume(sent, t_end=60.0).events[0][0]) == 3


@lm.record
class Power(lm.Hamiltonian):
    """Has no velocity where a momentum is negative."""

    def gradient(self, mu: lm.Vec) -> lm.Vec:
        return lm.vec(mu[0] ** 1.5, mu[1], 2.0 * mu[2])


@WORLDS
def test_a_start_without_velocity_is_refused_alike_in_every_run_of_a_plan(compiled: bool) -> None:
    """Also after one that has prepared the plan."""
    system = lm.LiePoissonSystem(lm.SO3(), Power())
    turning, told = plan(system, compiled), []
    for mu in ([-1.0, 0.2, 0.3], [1.0, 0.2, 0.3], [-1.0, 0.2, 0.3]):
        try:
            turning.run(system.state(mu=mu), t_end=0.1)
        except lm.errors.IntegrationFailure as error:
            told.append((type(error), str(error)))
    assert len(told) == 2 and told[0] == told[1] and "at the start" in told[0][1]


@WORLDS
def test_a_body_without_velocity_has_the_samples_that_were_asked_for(compiled: bool) -> None:
    """And no other."""
    states, times = KEPLER.state(q=[[0.6, 0.0], [0.0, 0.0]], p=[[0.0, 1.4], [0.0, 0.0]]), [0.5, 1.0]
    with pytest.warns(RuntimeWarning, match="body 1 after 0 steps"):
        run = plan(compiled=compiled).run(states, t_end=1.0, t_eval=times)
    assert run.t.tolist() == times and np.array_equal(run.q[:, 1], [[0.0, 0.0]] * 2)
    with pytest.raises(lm.errors.IntegrationFailure) as caught:
        plan(compiled=compiled).run(KEPLER.state(q=[0.0, 0.0], p=[0.0, 0.0]), t_end=1.0, t_eval=times)
    assert len(caught.value.trajectory) == 0


@pytest.mark.compiled
def test_a_mark_of_a_run_that_was_interrupted_is_not_taken_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """Python was asked for a step, and Ctrl-C came in it: a run of no length from there has not failed."""
    turning = plan(BODY)
    run = turning.run(TURNING, t_end=1.0)
    run.carry.members[1].clock[5] = 2.0
    still = turning.resume(run, t_end=1.0)
    assert not still.stopped and [m.clock[5] for m in still.carry.members] == [0.0] * 3


@WORLDS
def test_a_body_without_velocity_has_failed_also_where_it_has_nowhere_to_go(compiled: bool) -> None:
    """Alone, whatever ran before, and beside others."""
    still, none = plan(compiled=compiled), KEPLER.state(q=[0.0, 0.0], p=[0.0, 0.0])
    states = KEPLER.state(q=[[0.6, 0.0], [0.0, 0.0]], p=[[0.0, 1.4], [0.0, 0.0]])
    for _ in range(2):
        with pytest.raises(lm.errors.IntegrationFailure):
            still.run(none, t_end=0.0, t_eval=[0.0])
        with pytest.warns(RuntimeWarning, match="body 1 after 0 steps"):
            run = still.run(states, t_end=0.0)
        assert set(run.stopped) == {1} and run.carry is not None
        with pytest.warns(RuntimeWarning, match="body 1 after 0 steps"):
            after = still.resume(run, t_end=0.5)
        alone = still.run(KEPLER.state(q=[0.6, 0.0], p=[0.0, 1.4]), t_end=0.5)
        assert set(after.stopped) == {1} and np.array_equal(after.q[-1, 0], alone.last.q)


@WORLDS
@pytest.mark.parametrize("given", [{"rtol": [1e-4, 1e-4, -1.0]}, {"atol": [0.0, 1.0, np.nan]}, {"h": [0.1, 0.1, 0.0]}])
def test_a_refusal_of_a_number_of_one_body_names_the_body(compiled: bool, given: Any) -> None:
    """And the number; as many as bodies are wanted."""
    with pytest.raises(lm.errors.InvalidInput, match=next(iter(given))) as caught:
        plan(BODY, compiled, **given).run(TURNING, t_end=1.0)
    assert caught.value.__notes__ == ["[integrate: body 2]"]
    name, numbers = next(iter(given.items()))
    with pytest.raises(lm.errors.InvalidInput, match=f"{name} has 2 (numbers|steps) for 3 bodies"):
        plan(BODY, compiled, **{name: numbers[:2]}).run(TURNING, t_end=1.0)
