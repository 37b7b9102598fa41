"""A run advanced by hand: the bits of `Plan.run`, wherever it stands, and nothing lost."""

from __future__ import annotations

import copy
import pickle
import warnings
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
from scenes import WORLDS, Fenced
from scenes_of_runs import Equator

import liemech as lm
from liemech.errors import IncompatibleSystem, IntegrationFailure, IntegrationInterrupted, InvalidInput, InvalidType
from liemech.rooms.at_work.stepper import BodyInPlace
from liemech.simulation.runs import short

BODY = lm.RigidBody([1.0, 1.6, 2.3])
START = BODY.state(mu=[0.5, -0.3, 0.75], g=np.eye(3))
TOP, KEPLER = lm.models.HeavyTop([1.0, 1.5, 0.7], 1.3, [0.6, 0.0, 0.8]), lm.Kepler()
FALL = KEPLER.state(q=[0.4, 0.0], p=[0.0, 2.0])
PENDULUM = lm.SphericalPendulum()
CLOCKED = lm.ReversibleController(lm.StormerVerlet(), lm.time_scales.DistancePower(1.5))
CASES: dict[str, tuple[Any, Any, Any, dict[str, Any]]] = {
    "explicit": (BODY, lm.RKMK(order=4), START, {}),
    "compensated": (BODY, lm.CovariantVariational(lm.Cayley()), START, {}),
    "with first guesses": (BODY, lm.CovariantVariational(lm.Exponential()), START, {}),
    "with a force": (KEPLER, lm.StormerVerlet(), FALL, {}),
    "constrained": (PENDULUM, lm.RATTLE(), PENDULUM.state([1.0, 0.0, 0.0], [0.0, 0.5, 0.3]), {}),
    "kicks": (TOP, lm.KickDrift(order=4), TOP.state(mu=[0.1, 0.2, 3.0], g=np.eye(3)), {}),
    "of two doubles": (BODY, lm.RKMK(order=4), START, {"precision": "double-double"}),
    "only mu": (BODY, lm.RKMK(order=4), START, {"record": "mu", "h": -0.05}),
    "in fictive time": (KEPLER, CLOCKED, FALL, {}),
}


def plan_of(case: str, compiled: bool | None) -> tuple[lm.Plan, Any]:
    system, method, start, options = CASES[case]
    return lm.Plan(system, method, **{"h": 0.05, "compiled": compiled} | options), start


def stands(stepper: Any, run: Any, row: int) -> None:
    """It is where the run was after so many steps, to the bit."""
    assert stepper.t == run.t[row] and stepper.steps == row
    for name, x in run.states.items():
        assert np.array_equal(getattr(stepper, name), x[row])
        assert np.array_equal(np.array(getattr(stepper.state, name)), x[row])


@pytest.mark.sample(2)
@pytest.mark.parametrize("case", CASES)
@WORLDS
def test_it_stands_where_the_run_was(case: str, compiled: bool) -> None:
    """After one step, some, and those of a copy, a pickled one, and of a run that goes on."""
    plan, start = plan_of(case, compiled)
    run, stepper = plan.run(start, steps=12), plan.stepper(start)
    stands(stepper, run, 0)
    for k in range(1, 4):
        stepper.step()
        stands(stepper, run, k)
    kept = stepper.carry
    stepper.step(4)
    stands(stepper, run, 7)
    others = pickle.loads(pickle.dumps(stepper)), copy.copy(stepper), plan.stepper(stepper.carry)
    for other in (*others, plan.stepper(plan.run(start, steps=7))):
        other.step(5)
        stands(other, run, 12)
    stands(stepper, run, 7)
    rest = plan.resume(stepper, steps=5)
    for name, x in rest.states.items():
        assert np.array_equal(x, run.states[name][7:])
    again = plan.stepper(kept)  # what it carried along before is as it was
    again.step(9)
    stands(again, run, 12)


@pytest.mark.compiled
def test_native_code_takes_over_when_it_is_there(monkeypatch: pytest.MonkeyPatch) -> None:
    plan, start = plan_of("explicit", None)
    run = plan.replace(compiled=False).run(start, steps=9)
    stepper = plan.stepper(start)
    stepper.step(2)
    plan.replace(compiled=True).run(start, steps=1)
    stepper.step(3)
    monkeypatch.setattr(short, "LONGEST", 1000)  # more steps than native code makes at once
    stepper.refresh()
    stepper.step(4)
    stands(stepper, run, 9)
    with pytest.raises(InvalidInput, match="another `compensated` or `precision`"):
        plan.replace(compensated=True).stepper(stepper.carry).step()


def test_what_it_gives_is_its_own() -> None:
    stepper = lm.Plan(BODY, lm.RKMK(order=4), 0.05, compiled=False).stepper(START)
    stepper.mu[:] = 7.0
    assert np.array_equal(stepper.mu, START.mu)
    with pytest.raises(AttributeError, match="its state has mu, g"):
        stepper.q  # noqa: B018
    for name, value in {"mu": START.mu, "h": 0.1, "t": 3.0}.items():
        with pytest.raises(AttributeError, match=rf"{name} of a Stepper cannot be set; .*stepper\("):
            setattr(stepper, name, value)


@pytest.mark.slow
@WORLDS
def test_the_count_of_an_event_goes_on(compiled: bool) -> None:
    """Two zeros of three were met before the run is stepped by hand."""
    plan = lm.Plan(BODY, lm.RKMK(order=4), 0.05, events=Equator(), compiled=compiled)
    all_three = plan.run(START, steps=3000)
    ((times, _),) = all_three.events
    first = plan.run(START, steps=all_three.steps - 10)
    assert len(times) == 3 and [len(t) for t, _ in first.events] == [2]
    stepper = plan.stepper(first)
    for steps in (1, 2, 1):
        stepper.step(steps)
    ended = plan.resume(stepper, steps=3000)
    assert np.array_equal(ended.events[0][0], times[2:])


@pytest.mark.compiled
def test_an_interrupt_leaves_it_where_it_has_come_to(monkeypatch: pytest.MonkeyPatch) -> None:
    plan, start = plan_of("explicit", True)
    stepper, run, advance = plan.stepper(start), plan.run(start, steps=9), BodyInPlace.advance

    def interrupted(here: BodyInPlace, steps: int) -> int:
        made = advance(here, steps)
        if here.taken == 6:
            raise KeyboardInterrupt
        return made

    monkeypatch.setattr(BodyInPlace, "advance", interrupted)
    stepper._here.at_once = 2
    with pytest.raises(IntegrationInterrupted, match="after 6 steps, where it stands now"):
        stepper.step(9)
    stands(stepper, run, 6)
    stepper.step(3)
    stands(stepper, run, 9)


def test_events_of_a_plan_are_none_of_an_ensemble_in_fictive_time() -> None:
    system = lm.SundmanTransformed(lm.Kepler(), lambda q, p: lm.dot(q, q))
    start = system.state(q=[[0.9, 0.0], [0.8, 0.0]], p=[[0.0, 1.1], [0.1, 1.2]])
    plan = lm.Plan(system, lm.RKMK(order=4), h=0.03, compiled=False)
    stepper = plan.replace(events=lambda t, state: state.q[0] - 5.0).stepper(start)
    for _ in range(3):
        stepper.step(2)
    assert np.array_equal(stepper.q, plan.run(start, steps=6).q[-1])


# ------------------------------------------------------------------ steps that fail


@WORLDS
@pytest.mark.parametrize("at_a_time", [1, 200])
def test_a_step_that_fails_says_why_and_those_before_it_count(compiled: bool, at_a_time: int) -> None:
    body = lm.RigidBody([1.0, 1.5, 2.0])
    start = body.state(mu=[0.3, 0.4, 0.75])
    plan = lm.Plan(body, Fenced(order=4), 0.1, compiled=compiled)
    with pytest.raises(IntegrationFailure, match="beyond the fence") as caught:
        plan.run(start, steps=200)
    run, stepper = caught.value.trajectory, plan.stepper(start)
    for _ in range(2):  # nor does it go on when it is asked again
        with pytest.raises(IntegrationFailure, match=f"beyond the fence .step {run.steps + 1} of") as caught:
            while True:
                stepper.step(at_a_time)
        stands(stepper, run, run.steps)
        assert np.array_equal(caught.value.trajectory.t, run.t[-1:])  # it failed from there


def test_a_body_that_stops_is_told_once() -> None:
    body = lm.RigidBody([1.0, 1.5, 2.0])
    plan = lm.Plan(body, Fenced(order=4), 0.1, compiled=False)
    stepper = plan.stepper(body.state(mu=[[0.3, 0.4, 0.75], [0.1, 0.0, 0.2], [0.3, 0.5, 0.75]]))
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        for _ in range(40):
            stepper.step()
    assert len(told) == len(stepper.stopped) == 2
    run = plan.run(body.state(mu=[0.1, 0.0, 0.2]), steps=40)
    assert np.array_equal(stepper.mu[1], run.mu[-1])
    for i, stop in stepper.stopped.items():
        assert f"body {i} after {stop.steps} steps" in " ".join(str(one.message) for one in told)
        assert "beyond the fence" in str(stop.error)
    nobody = plan.stepper(body.state(mu=[[0.3, 0.4, 0.75]]))
    with pytest.warns(RuntimeWarning), pytest.raises(IntegrationFailure, match="beyond the fence"):
        nobody.step(40)


# ------------------------------------------------------------------ what it reads, and threads

GAIN = 1.0


@lm.record
class Gained(lm.Hamiltonian):
    """Reads a name of this module."""

    inertia: lm.Vec

    def energy(self, mu: Any) -> Any:
        return 0.5 * GAIN * lm.dot(mu, mu / self.inertia)


@pytest.mark.compiled
def test_formulas_count_as_they_were_when_it_was_made(monkeypatch: pytest.MonkeyPatch) -> None:
    system = lm.LiePoissonSystem(lm.SO3(), Gained([1.0, 0.5, 0.4]))
    plan = lm.Plan(system, lm.RKMK(order=4), 0.05, compiled=True)
    start = system.state(mu=[0.5, -0.3, 0.75])
    before, stepper = plan.run(start, steps=4), plan.stepper(start)
    stepper.step(2)
    middle = plan.stepper(stepper.carry)
    monkeypatch.setitem(globals(), "GAIN", 1.25)
    stepper.step(2)
    stands(stepper, before, 4)
    middle.refresh()
    middle.step(2)
    wanted = plan.run(system.state(mu=before.mu[2]), steps=2).mu[-1]
    assert np.array_equal(middle.mu, wanted) and not np.array_equal(middle.mu, before.mu[4])


@pytest.mark.compiled
def test_threads_may_share_it() -> None:
    plan, start = plan_of("explicit", True)
    stepper, run = plan.stepper(start), plan.run(start, steps=2000)

    def hundred(_: int) -> bool:
        for _ in range(100):
            stepper.step()
            state = stepper.carry
            assert np.array_equal(np.array(state.state.mu), run.mu[state.step])
        return True

    with ThreadPoolExecutor(4) as pool:
        assert all(pool.map(hundred, range(20)))
    stands(stepper, run, 2000)


@pytest.mark.slow
def test_what_is_no_step_of_this_plan_is_refused() -> None:
    plan, start = plan_of("explicit", False)
    stepper = plan.stepper(start)
    with pytest.raises(InvalidInput, match="another system or method"):
        plan.replace(system=lm.RigidBody([1.0, 1.2, 2.0])).resume(stepper, steps=1)
    with pytest.raises(InvalidInput, match=r"steps of h = 0\.05"):
        plan.replace(h=0.1).stepper(stepper.carry)
    with pytest.raises(InvalidInput, match="another method"):
        plan.replace(method=lm.RKMK(order=2)).stepper(plan.run(start, steps=1))
    with pytest.raises(InvalidInput, match="fixed steps"):
        lm.Plan(BODY, lm.RKMK(order=5), rtol=1e-6).stepper(start)
    with pytest.raises(InvalidType, match="what `begin` or `step` gave"):
        plan.stepper([0.5, -0.3, 0.75])
    for steps in (0, -1, 1.0):
        with pytest.raises((InvalidInput, InvalidType), match="steps must be"):
            stepper.step(steps)  # type: ignore[arg-type]
    with pytest.raises(InvalidType, match="another kind of system"):
        plan.stepper(KEPLER.state([1.0, 0.0], [0.0, 1.0]))
    with pytest.raises(InvalidInput, match=r"Plan\.stepper: t0 = 3\.0 is for a state"):
        plan.stepper(stepper.carry, t0=3.0)
    adaptive = lm.Plan(BODY, lm.RKMK(order=5), rtol=1e-6)
    with pytest.raises(InvalidInput, match=r"Plan\.resume is for fixed steps"):
        adaptive.resume(stepper, t_end=1.0)
    ending = plan.replace(events=Equator())
    with pytest.raises(InvalidInput, match=r"Plan\.stepper: this run was interrupted"):
        ending.stepper(ending.run(start, steps=3000))
    with pytest.raises(IncompatibleSystem, match="leave out max_step for steps of length h"):
        lm.Plan(BODY, lm.RKMK(order=4), 0.1, max_step=0.1, breaks=[0.5])
