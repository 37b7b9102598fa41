"""Where runs begin, end, meet and fail: each of these once gave a wrong number or an error that named nothing."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import liemech as lm

BODY = lm.RigidBody([1.0, 1.5, 2.0])
START = BODY.state(mu=[0.5, 0.1, 0.8], g=np.eye(3))
ALGORITHM_1 = lm.CovariantVariational(lm.Cayley())


def test_short_steps_of_several_systems_are_their_own() -> None:
    bodies = [lm.RigidBody([1.0, 1.5, 2.0]), lm.RigidBody([1.0, 1.2, 2.1]), lm.RigidBody([1.0, 1.9, 2.3])]
    starts = bodies[0].state(mu=np.tile([0.5, 0.1, 0.8], (3, 1)))
    for method in (lm.RKMK(order=4), ALGORITHM_1):
        run = lm.integrate(bodies, method, starts, h=0.05, steps=20, t_eval=[0.13, 0.5], compiled=False)
        for i, body in enumerate(bodies):
            one = lm.integrate(
                body, method, body.state(mu=[0.5, 0.1, 0.8]), h=0.05, steps=20, t_eval=[0.13, 0.5], compiled=False
            )
            assert np.array_equal(run.mu[:, i], one.mu)
    xi = lm.integrate(bodies, ALGORITHM_1, starts, h=0.05, steps=3, compiled=False).xi
    assert np.array_equal(
        xi[:, 2], lm.integrate(bodies[2], ALGORITHM_1, bodies[2].state(mu=[0.5, 0.1, 0.8]), h=0.05, steps=3).xi
    )


def test_casimirs_of_several_systems_are_their_own() -> None:
    species = [lm.models.LotkaVolterra.volterra_lattice(3), lm.models.LotkaVolterra.volterra_lattice(3)]
    starts = species[0].state([[1.0, 2.0, 3.0], [2.0, 1.0, 0.5]])
    run = lm.integrate(species, lm.Splitting(order=2), starts, h=0.01, steps=3, compiled=False)
    assert np.array_equal(run.casimirs[:, 1], species[1].casimirs(run.y[:, 1]))


def test_at_needs_all_steps() -> None:
    times = [*np.linspace(0.0, 0.1, 100), 10.0]
    run = lm.integrate(BODY, ALGORITHM_1, START, h=0.1, steps=100, t_eval=times, compiled=False)
    assert len(run) == run.steps + 1
    with pytest.raises(lm.errors.InvalidInput, match="kept all its steps"):
        run.at(5.0)


def test_a_carry_belongs_to_its_plan() -> None:
    plan = lm.Plan(BODY, lm.RKMK(order=4), 0.1, compiled=False)
    carry = plan.begin(START)
    for wrong, message in (
        (lambda: plan.replace(h=0.05).step(carry), "steps of h = 0.1, the plan has 0.05"),
        (lambda: plan.replace(system=lm.RigidBody([1.0, 1.2, 2.0])).step(carry), "another system or method"),
        (lambda: plan.step(carry, -1), "steps must be at least 1"),
        (lambda: plan.step(carry, 1.0), "steps must be a whole number"),  # type: ignore[arg-type]
        (lambda: plan.step("a"), "what `begin` or `step` gave"),  # type: ignore[arg-type]
    ):
        with pytest.raises(lm.errors.LiemechError, match=message):
            wrong()


@lm.record
class Pulse(lm.Force):
    begin: float
    end: float

    def covector(self, t: float, xi: lm.Vec, g: Any) -> lm.Vec:
        from liemech.formulas import where

        return lm.vec(where(t > self.begin, where(t < self.end, 10.0, 0.0), 0.0), 0.0, 0.0)


@pytest.mark.parametrize(("begin", "end"), [(0.0, 0.01), (9.99, 10.0), (5.0, 5.01)])
def test_breaks_at_the_ends_count(begin: float, end: float) -> None:
    """A pulse that begins with the run, or ends with it, or where a run is resumed."""
    system = lm.MechanicalSystem(lm.RigidBody([1.0, 2.0, 3.0]), lm.NoPotential(), load=Pulse(begin, end))
    start = system.state(mu=[1.0, 0.0, 0.0], g=np.eye(3))
    plan = lm.Plan(system, lm.RKMK(order=5), breaks=[begin, end], compiled=False)
    run = plan.run(start, t_end=10.0)
    assert run.t[-1] == 10.0
    assert abs(run.mu[-1, 0] - 1.1) < 1e-12
    half = plan.run(start, t_end=end)
    if end < 10.0:
        assert abs(plan.resume(half, t_end=10.0).mu[-1, 0] - 1.1) < 1e-12


def equator(t: float, state: Any) -> float:
    return float(state.mu[0])


def test_every_goes_on_counting_with_events_too() -> None:
    for events in ((), equator):
        plan = lm.Plan(BODY, lm.RKMK(order=4), 0.01, events=events, every=10, compiled=False)
        rest = plan.resume(plan.run(START, steps=37), steps=33)
        assert np.allclose(rest.t, [0.37, 0.4, 0.5, 0.6, 0.7], rtol=1e-15)


def test_joined_runs_keep_events_and_the_way_between() -> None:
    plan = lm.Plan(BODY, lm.RKMK(order=5), rtol=1e-5, events=equator, compiled=False)
    first = plan.run(START, t_end=40.0)
    rest = plan.resume(first, t_end=80.0)
    joined = first.then(rest)
    assert len(joined.events[0][0]) == len(first.events[0][0]) + len(rest.events[0][0]) > 1
    assert np.array_equal(joined.at([3.0, 50.0]).mu, np.concatenate([first.at([3.0]).mu, rest.at([50.0]).mu]))


@pytest.mark.slow
def test_a_run_resumed_at_an_event_leaves_it() -> None:
    def event(t: float, state: Any) -> float:
        return float(state.mu[0])

    event.terminal = True  # type: ignore[attr-defined]
    plan = lm.Plan(BODY, lm.RKMK(order=5), rtol=1e-7, events=event, compiled=False)
    run, times = plan.run(START, t_end=60.0), []
    while run.t[-1] < 60.0:
        times.append(run.t[-1])
        run = plan.resume(run, t_end=60.0)
    free = lm.integrate(BODY, lm.RKMK(order=5), START, t_end=60.0, rtol=1e-7, events=equator, compiled=False)
    assert len(times) == len(free.events[0][0]) > 2
    assert np.abs(times - free.events[0][0]).max() < 1e-5


def test_the_last_time_may_be_rounded() -> None:
    run = lm.integrate(BODY, ALGORITHM_1, START, h=1 / 49, t_end=1.0, t_eval=np.linspace(0.0, 1.0, 5), compiled=False)
    assert abs(run.t[-1] - 1.0) < 1e-15
    whole = lm.integrate(BODY, ALGORITHM_1, START, h=1 / 49, steps=49, compiled=False)
    assert np.array_equal(whole.at(1.0).mu, whole.mu[-1])


@pytest.mark.slow
def test_failing_events_keep_the_samples_before_them() -> None:
    def event(t: float, state: Any) -> float:
        if t > 8.0:
            raise RuntimeError("no more")
        return 1.0

    with pytest.raises(RuntimeError, match="no more") as caught:
        lm.integrate(BODY, lm.RKMK(order=4), START, h=0.01, steps=2000, events=event, compiled=False)
    run = caught.value.trajectory  # type: ignore[attr-defined]
    assert np.array_equal(run.t, np.arange(801) * 0.01)
    assert np.array_equal(run.mu, lm.integrate(BODY, lm.RKMK(order=4), START, h=0.01, steps=800, compiled=False).mu)


@pytest.mark.slow
def test_tangent_maps_on_complex_groups() -> None:
    system = lm.LiePoissonSystem(lm.SU(2), lm.KineticEnergy([1.0, 2.0, 3.0]))
    start = system.state(mu=[0.5, -0.2, 0.3], g=np.eye(2))
    plan = lm.Plan(system, lm.RKMK(order=4), 0.1, compiled=False)
    D = plan.tangent(start, steps=5).tangent["start"][-1]
    assert D.shape == (6, 6)
    e, group = 1e-5, lm.SU(2)
    for k, unit in enumerate(np.eye(6)):
        ends = [
            plan.run(system.state(mu=np.array(start.mu) + x[:3], g=group.exp(x[3:])), steps=5)
            for x in (e * unit, -e * unit)
        ]
        middle = plan.run(start, steps=5).g[-1].conj().T
        turned = [group.log(middle @ run.g[-1]) for run in ends]
        column = np.concatenate([ends[0].mu[-1] - ends[1].mu[-1], turned[0] - turned[1]]) / (2 * e)
        assert np.abs(D[:, k] - column).max() < 1e-8


@pytest.mark.parametrize(
    ("message", "given"),
    [
        (r"breaks has shape \(1, 1\)", dict(t_end=1.0, method=lm.RKMK(order=5), breaks=[[0.1]])),
        ("events are functions of t and state; got 3", dict(h=0.1, steps=2, events=3)),
        ("an event gives a number", dict(h=0.1, steps=2, events=lambda t, state: state.mu)),
        ("dense must be True, False or None", dict(t_end=1.0, method=lm.RKMK(order=5), dense=1)),
        (
            "start has mu and is of another kind of system",
            dict(h=0.1, steps=2, system=lm.Kepler(), method=lm.StormerVerlet()),
        ),
        ("a folder that exists", dict(h=0.1, steps=2, checkpoint="/")),
    ],
)
def test_refused_by_name(message: str, given: dict[str, Any]) -> None:
    given = dict(system=BODY, method=lm.RKMK(order=4), start=BODY.state(mu=[0.5, 0.1, 0.8])) | given
    with pytest.raises(lm.errors.LiemechError, match=message):
        lm.integrate(given.pop("system"), given.pop("method"), given.pop("start"), compiled=False, **given)


def test_what_a_plan_was_given_is_kept_as_it_was() -> None:
    names, bodies = ["mu"], [BODY, lm.RigidBody([1.0, 1.2, 2.0])]
    plan = lm.Plan(BODY, lm.RKMK(order=4), 0.1, record=names, events=iter([equator]), compiled=False)
    several = lm.Plan(bodies, lm.RKMK(order=4), 0.1, compiled=False)
    names.append("g")
    bodies.reverse()
    assert set(plan.run(START, steps=2).states) == set(plan.replace(h=0.2).run(START, steps=2).states) == {"mu"}
    assert plan.replace(h=0.2).events == (equator,)
    assert several.replace(h=0.2).system[1].inertia[1] == 1.2
    with pytest.raises(lm.errors.InvalidInput, match="the plan records"):
        plan.replace(record=("mu", "g"), events=()).resume(plan.replace(events=()).run(START, steps=2), steps=1)
    one = lm.Plan(BODY, ALGORITHM_1, 0.1, compensated=False, compiled=False).run(START, steps=2)
    with pytest.raises(lm.errors.InvalidInput, match="another `compensated`"):
        lm.Plan(BODY, ALGORITHM_1, 0.1, compiled=False).resume(one, steps=1)


@lm.record
class Interrupted(lm.Method):
    """Ctrl-C in the middle of a piece, once."""

    def step(self, system: Any, t: float, state: Any, h: float) -> Any:
        if t >= 29.0 and interruptions:
            raise interruptions.pop()
        return lm.BodyState(state.mu + lm.vec(1.0, 0.0, 0.0), state.g)


interruptions: list[KeyboardInterrupt] = []


@pytest.mark.parametrize("bodies", [None, 3])
def test_an_interrupted_run_goes_on_from_a_sample_that_was_taken(bodies: int | None) -> None:
    """The first sample of what follows is the last state, not memory that nobody has written to."""
    interruptions[:] = [KeyboardInterrupt()]
    mu = [0.0, 0.0, 0.0] if bodies is None else np.zeros((bodies, 3))
    plan = lm.Plan(BODY, Interrupted(), 1.0, compiled=False)
    with pytest.raises(lm.errors.IntegrationInterrupted) as caught:
        plan.run(BODY.state(mu=mu), steps=200)
    run = caught.value.trajectory  # type: ignore[attr-defined]
    rest = plan.resume(run, steps=3)
    assert np.array_equal(rest.mu[..., 0].reshape(4, -1)[:, 0], rest.t)
    assert np.array_equal(rest.mu[0], run.mu[-1])
