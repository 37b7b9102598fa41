"""Adaptive steps: the error estimate, the controller, dense output, events, and what is said when they end early."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
from scenes import asymmetric_body, slope
from scipy.optimize import brentq

import liemech as lm
from liemech.formulas import sin, vec
from liemech.tableaus import pairs

BODY, START = asymmetric_body()
PAIRS = [t for t in vars(pairs).values() if isinstance(t, lm.tableaus.ButcherTableau) and t.embedded and t.order < 7]
EVERY_PAIR = pytest.mark.parametrize("tableau", PAIRS, ids=lambda t: t.name)
DP5 = lm.RKMK(tableau=pairs.DORMAND_PRINCE5)


@lm.record
class Driven(lm.LinearGroupEquation):
    """A rotation driven by a velocity that grows without bound at t = 1, or not at all."""

    pole: float = 0.0

    def drive(self, t):
        return vec(1.0 + self.pole / (1.0 - t), sin(2.0 * t), 0.3 * t)


def errors(run: lm.Trajectory) -> tuple[float, float]:
    exact = BODY.exact(START, run.t)
    return np.abs(run.mu - exact.mu).max(), np.abs(run.g - exact.g).max()


# ---------------------------------------------------------------- one step on probation


@EVERY_PAIR
def test_the_estimate_has_its_order_and_is_one(tableau: lm.tableaus.ButcherTableau) -> None:
    """The estimate goes to zero with the power of h that the controller assumes, and is no smaller
    than the error itself.
    """
    method, rate = lm.RKMK(tableau=tableau), BODY.rate(0.0, START)
    sizes, found, true = [0.4, 0.2, 0.1], [], []
    for h in sizes:
        trial = method.trial(BODY, 0.0, START, rate, h, 0.0, 1.0, False)
        found.append(trial.error)
        true.append(np.abs(np.array(trial.state.g) - BODY.exact(START, [h]).g[0]).max())
    assert round(slope(sizes, found)) == method.error_order
    assert true[-1] < 4 * found[-1]


@EVERY_PAIR
def test_the_way_between_the_ends_of_a_step_has_its_order(tableau: lm.tableaus.ButcherTableau) -> None:
    method, rate = lm.RKMK(tableau=tableau), BODY.rate(0.0, START)
    sizes = [0.8, 0.4, 0.2] if method.dense_order > 5 else [0.2, 0.1, 0.05]
    worst = []
    for h in sizes:
        trial, at = method.trial(BODY, 0.0, START, rate, h, 1.0, 1.0, True), []
        for theta in (0.2, 0.5, 0.7):
            omega = sum((theta ** (k + 1) * p for k, p in enumerate(trial.curve)), vec(0.0, 0.0, 0.0))
            state = BODY.displaced(lm.Exponential(), START, omega)
            at.append(np.abs(np.array(state.g) - BODY.exact(START, [theta * h]).g[0]).max())
        worst.append(max(at))
        end = sum(trial.curve, vec(0.0, 0.0, 0.0))
        assert np.allclose(BODY.displaced(lm.Exponential(), START, end).mu, trial.state.mu, rtol=0, atol=1e-14)
    assert slope(sizes, worst) > method.dense_order + 0.8


# ---------------------------------------------------------------- runs


@EVERY_PAIR
def test_the_error_follows_the_tolerance(tableau: lm.tableaus.ButcherTableau) -> None:
    """From 1e-4 to 1e-8 both errors fall by at least 10^3, and stay within a factor of the tolerance."""
    found = []
    for tolerance in (1e-4, 1e-8):
        run = lm.integrate(
            BODY, lm.RKMK(tableau=tableau), START, t_end=10.0, rtol=tolerance, atol=tolerance, dense=False
        )
        found.append(max(errors(run)))
        assert run.t[-1] == 10.0
        assert found[-1] < 300 * tolerance
    assert found[1] < 1e-3 * found[0]


def test_dense_output_is_on_the_group_and_the_orbit() -> None:
    run = lm.integrate(BODY, DP5, START, t_end=10.0, rtol=1e-9, atol=1e-9)
    times = np.linspace(0.0, 10.0, 401)
    between, exact = run.at(times), BODY.exact(START, times)
    assert np.abs(between.mu - exact.mu).max() < 3e-8
    assert np.abs(between.g - exact.g).max() < 3e-8
    size = np.linalg.norm(between.mu, axis=1)
    assert np.abs(size / size[0] - 1).max() < 1e-14
    assert np.abs(np.swapaxes(between.g, 1, 2) @ between.g - np.eye(3)).max() < 1e-13
    spatial = BODY.spatial_momentum(between.mu, between.g)
    assert np.abs(spatial - spatial[0]).max() < 1e-13
    assert np.array_equal(run.at(run.t).mu, run.mu)
    assert np.array_equal(run.at(3.0).mu, run.at([3.0]).mu[0])
    with pytest.raises(lm.errors.InvalidInput, match="outside the run"):
        run.at(10.5)


def test_momentum_alone_and_a_first_step_of_ones_own() -> None:
    run = lm.integrate(BODY, DP5, START, t_end=5.0, h=0.01, record=("mu",), dense=False)
    assert run.g is None
    assert run.t[1] == 0.01
    assert "rejected" in repr(run)
    with pytest.raises(lm.errors.InvalidInput, match="dense=True"):
        run.at(1.0)
    assert run.drift()["Casimir 1"].verdict == "exact"


@pytest.mark.slow
def test_steps_shrink_where_the_motion_is_fast() -> None:
    """Close to the pole the steps are short, and the driven rotation agrees with one by many small steps."""
    system = Driven(lm.SO3(), 0.01)
    start = system.state(np.eye(3))
    run = lm.integrate(system, DP5, start, t_end=0.999, rtol=1e-9, atol=1e-9)
    steps = np.diff(run.t)
    assert steps[-1] < 0.05 * steps.max()
    fine = lm.integrate(
        system, lm.RKMK(tableau=pairs.DORMAND_PRINCE5), start, h=0.999 / 200_000, steps=200_000, every=200_000
    )
    assert np.abs(fine.g[-1] - run.g[-1]).max() < 1e-7


@pytest.mark.parametrize("at_rest", [False, True])
@pytest.mark.parametrize("unit", [2.0**30, 2.0**-30])
def test_a_unit_of_time_changes_no_step(unit: float, at_rest: bool) -> None:
    """The first step is chosen from the motion: in years as in nanoseconds."""

    def seen(unit: float) -> lm.Trajectory:
        top = lm.models.HeavyTop([1.0, 1.5, 2.0], weight=3.0 / unit**2, centre=[0.1, 0.0, 0.5])
        start = top.state(0.0 * START.mu if at_rest else np.array(START.mu) / unit, np.array(START.g))
        return lm.integrate(top, DP5, start, t_end=2.0 * unit, rtol=1e-8, atol=0.0)

    run, in_units = seen(1.0), seen(unit)
    assert np.array_equal(in_units.t / unit, run.t)
    assert np.array_equal(in_units.mu * unit, run.mu)
    assert np.array_equal(in_units.g, run.g)


# ---------------------------------------------------------------- events


def test_events_are_found_where_the_exact_motion_has_them() -> None:
    def crossing(t, state):
        return state.mu[1]

    run = lm.integrate(BODY, DP5, START, t_end=40.0, rtol=1e-11, atol=1e-11, events=crossing)
    (times, states) = run.events[0]
    grid = np.linspace(0.0, 40.0, 4001)
    values = BODY.exact(START, grid).mu[:, 1]
    brackets = np.flatnonzero(values[:-1] * values[1:] < 0)
    exact = [brentq(lambda t: BODY.exact(START, [t]).mu[0, 1], grid[i], grid[i + 1], xtol=1e-13) for i in brackets]
    assert len(exact) >= 3
    assert np.allclose(times, exact, rtol=0, atol=1e-8)
    assert np.abs(states.mu[:, 1]).max() < 1e-13


def test_events_that_end_the_run_and_those_of_one_direction() -> None:
    def crossing(t, state):
        return state.mu[1]

    every = lm.integrate(BODY, DP5, START, t_end=30.0, rtol=1e-9, atol=1e-9, events=crossing).events[0][0]
    crossing.direction = 1
    rising = lm.integrate(BODY, DP5, START, t_end=30.0, rtol=1e-9, atol=1e-9, events=[crossing]).events[0][0]
    assert 0 < len(rising) < len(every)
    assert set(rising) < set(every)
    crossing.terminal = True
    run = lm.integrate(BODY, DP5, START, t_end=30.0, rtol=1e-9, atol=1e-9, events=[crossing, lambda t, state: t - 0.5])
    assert run.t[-1] == rising[0] == run.events[0][0][-1]
    assert run.events[1][0] == pytest.approx([0.5], abs=1e-14)
    assert abs(run.mu[-1, 1]) < 1e-13
    shortly_before = run.t[-1] - 1e-3
    assert np.abs(run.at(shortly_before).mu - BODY.exact(START, [shortly_before]).mu[0]).max() < 1e-7


@pytest.mark.parametrize("wanted", [1, 2, np.int64(3), True, False, None, 0, 50])
def test_a_terminal_event_counts_as_in_scipy(wanted) -> None:
    def crossing(t, state):
        return state.mu[1]

    every = lm.integrate(BODY, DP5, START, t_end=60.0, events=crossing).events[0][0]
    assert len(every) > 3
    crossing.terminal = wanted
    run = lm.integrate(BODY, DP5, START, t_end=60.0, events=crossing)
    number = int(wanted or 0)
    if 0 < number <= len(every):
        assert np.array_equal(run.events[0][0], every[:number])
        assert run.t[-1] == every[number - 1]
    else:
        assert np.array_equal(run.events[0][0], every)
        assert run.t[-1] == 60.0


def marked(**attributes):
    def event(t, state):
        return state.mu[1]

    vars(event).update(attributes)
    return event


# ---------------------------------------------------------------- refusals


def test_a_motion_without_a_future() -> None:
    system = Driven(lm.SO3(), 1.0)
    with pytest.raises(lm.errors.StepTooSmall, match=r"at t = 1.* the step fell to .*singularity") as caught:
        lm.integrate(system, DP5, system.state(np.eye(3)), t_end=2.0, rtol=1e-6)
    run = caught.value.trajectory
    assert 0.999 < run.t[-1] <= 1.0
    assert np.isfinite(run.g).all()


VALUE, KIND, PAIR = lm.errors.InvalidInput, lm.errors.InvalidType, lm.errors.IncompatibleSystem


@pytest.mark.parametrize(
    ("error", "words", "given"),
    [
        (VALUE, "rtol must be positive; got -1", dict(t_end=1.0, rtol=-1)),
        (VALUE, "rtol must be positive; got 0", dict(t_end=1.0, rtol=0.0)),
        (VALUE, "atol must be finite", dict(t_end=1.0, atol=np.nan)),
        (VALUE, "t_end must be finite", dict(t_end=np.inf)),
        (VALUE, "t_eval has t = 2, which is not between 0 and 1", dict(t_end=1.0, t_eval=[0.0, 2.0])),
        (VALUE, "t_eval must be sorted", dict(t_end=1.0, t_eval=[0.5, 0.2])),
        (VALUE, r"t_eval has shape \(1, 1\)", dict(t_end=1.0, t_eval=[[0.5]])),
        (KIND, "events are functions of t and state; got 3", dict(t_end=1.0, events=[3])),
        (VALUE, "`terminal` of an event is True, False, or the number", dict(t_end=1.0, events=marked(terminal=-1))),
        (VALUE, "`terminal` of an event .* got 2.5", dict(t_end=1.0, events=marked(terminal=2.5))),
        (VALUE, "`direction` of an event", dict(t_end=1.0, events=marked(direction="up"))),
        (VALUE, "compensated is for fixed steps", dict(t_end=1.0, compensated=True)),
        (VALUE, "dense is for adaptive steps", dict(h=0.1, steps=3, dense=False)),
        (KIND, "dense must be True, False or None", dict(t_end=1.0, dense=3)),
        (VALUE, "every is for fixed steps", dict(t_end=1.0, every=2)),
        (VALUE, "rtol is for adaptive steps", dict(h=0.1, steps=3, rtol=1e-3)),
        (VALUE, "give h and steps.* or t_end", dict(h=0.1)),
        (PAIR, "has no error estimate.*embedded pair", dict(t_end=1.0, method=lm.RKMK(order=4))),
        (PAIR, "all its steps are alike", dict(t_end=1.0, method=lm.CovariantVariational())),
    ],
)
def test_refused(error: type[Exception], words: str, given: dict) -> None:
    given = dict(method=DP5, start=START) | given
    with pytest.raises(error, match=words):
        lm.integrate(BODY, given.pop("method"), given.pop("start"), **given)


def test_a_tolerance_below_rounding_is_raised_with_a_warning() -> None:
    with pytest.warns(RuntimeWarning, match="below rounding"):
        lm.integrate(BODY, DP5, START, t_end=0.1, rtol=1e-18, atol=1e-12)


@pytest.mark.parametrize("unit", [1.0, 1e-5, 1e-6, 1e-12, 1e-20])
@pytest.mark.parametrize("bodies", [None, 3])
def test_a_default_tolerance_that_controls_no_digit_is_warned_of(unit, bodies):
    body = lm.RigidBody(np.array([1.0, 1.5, 2.0]) * unit)
    mu = np.array([0.5, 0.1, 0.8]) * unit
    start = body.state(mu if bodies is None else np.tile(mu, (bodies, 1)))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        lm.integrate(body, lm.RKMK(order=5), start, t_end=1.0, rtol=1e-8)
        told = [str(w.message) for w in caught if "atol" in str(w.message)]
        assert len(told) == (unit <= 1e-6)
        lm.integrate(body, lm.RKMK(order=5), start, t_end=1.0, rtol=1e-8, atol=1e-9 * unit)
        if bodies is None:  # the attitude has a size of its own
            lm.integrate(body, lm.RKMK(order=5), body.state(mu, np.eye(3)), t_end=1.0, rtol=1e-8)
        rest = body.state(0.0 * mu)
        lm.integrate(body, lm.RKMK(order=5), rest, t_end=1.0)
        assert len([w for w in caught if "atol" in str(w.message)]) == len(told)


@pytest.mark.parametrize("many", [False, True])
@pytest.mark.parametrize("options", [{"h": 0.1, "steps": 20}, {"t_end": 2.0}])
def test_an_event_that_is_nan_is_named(options: dict[str, Any], many: bool) -> None:
    """Its zeros would be lost without a word."""

    def root_of_height(t: float, state: Any) -> float:
        return float("nan") if t > 1.0 else 0.9 - t

    start = BODY.state(np.tile(START.mu, (2, 1)), np.tile(np.eye(3), (2, 1, 1))) if many else START
    with pytest.warns(RuntimeWarning, match="root_of_height was nan at t = 1"):
        run = lm.integrate(BODY, DP5, start, events=root_of_height, **options)
    times = [met[0] for met in (run.events[0] if many else run.events)]
    assert all(np.allclose(found, [0.9], atol=1e-12) for found in times)
