"""Adaptive steps of linkages in memory: one step for all bodies, by the error of all."""

from __future__ import annotations

import dataclasses
import itertools
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_links_in_memory import hinged, in_angles, needs_compiler
from test_stages_of_links import WrittenOut, arm

import liemech as lm
from liemech.errors import IncompatibleSystem, IntegrationInterrupted, StepTooSmall
from liemech.joints import Linkage, chain
from liemech.simulation.runs.carry import SiteCarry
from liemech.tableaus import pairs

PAIRS = [x for x in vars(pairs).values() if isinstance(x, lm.tableaus.ButcherTableau) and x.embedded]
METHODS = [*dict.fromkeys((*(lm.RKMK(tableau=x) for x in PAIRS), *(lm.RKMK(order=p) for p in (5, 6, 8))))]


def run(made: Any, method: Any, t_end: float = 0.02, **options: Any) -> Any:
    given: Any = {"rtol": 1e-5, "atol": 1e-5, "compiled": False} | options
    times = given.pop("t_eval", None)
    return lm.Plan(made[0], method, **given).run(made[1], t_end=t_end, t_eval=times)


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_steps_are_those_of_the_equation_written_out(method: Any) -> None:
    """The same control by the same norm: as many steps, rejected ones too, and the same way between them."""
    tolerance = 1e-9 if method.order > 3 else 1e-6  # of low orders the other one takes thousands of steps
    for options in ({}, {"h": 0.02, "rtol": tolerance, "atol": tolerance, "max_step": 0.015}):
        ours, theirs = run(arm(Linkage), method, **options), run(arm(WrittenOut), method, **options)
        assert isinstance(ours.carry, SiteCarry) and not isinstance(theirs.carry, SiteCarry)
        assert (ours.steps, ours.rejected, len(ours)) == (theirs.steps, theirs.rejected, len(theirs))
        # the error is a difference of slopes, in which all but eps/tolerance of the digits are left
        assert np.abs(ours.t - theirs.t).max() < 1e-5 * 0.02
        middle = 0.4 * ours.t[1]
        assert np.abs(ours.at(middle).g - theirs.at(middle).g).max() < 1e-8
        assert np.abs(ours.mu[-1] - theirs.mu[-1]).max() < 1e-8 * np.abs(theirs.mu).max()


@needs_compiler
@pytest.mark.slow
@pytest.mark.parametrize("order", [5, 8])
def test_a_chain_of_hinges_moves_by_lagranges_equations_of_its_angles(order: int) -> None:
    """To the tolerance, at the ends of steps and between them, forwards and back."""
    made, times, errors = hinged(5), np.linspace(0.0, 0.4, 7), []
    wanted = in_angles(5, np.array([0.9, 0, 0, 0, -0.4]), np.array([0, 1.5, 0, 0, 0]), times)
    for rtol in (1e-5, 1e-8):
        found = run(made, lm.RKMK(order=order), 0.4, rtol=rtol, atol=rtol, compiled=True, t_eval=times)
        angles = np.transpose([found.joint(j).angle for j in range(5)])
        errors.append(np.abs(angles - wanted).max() / rtol)
        back = lm.Plan(made[0], lm.RKMK(order=order), rtol=rtol, atol=rtol, compiled=True).resume(found, t_end=0.0)
        assert np.abs(back.g[-1] - made[1].g).max() < 1e3 * rtol
    assert max(errors) < 100.0


@needs_compiler
@pytest.mark.slow
def test_native_steps_have_the_bits_of_plain_ones(tmp_path: Path) -> None:
    """Whole, at times, between steps, gone on with, loaded; what is asked for changes no step."""
    made, method = arm(Linkage), lm.RKMK(order=5)
    plain, native = (run(made, method, 0.1, compiled=c) for c in (False, True))
    assert native.compiled and not plain.compiled and (plain.steps, plain.rejected) == (native.steps, native.rejected)
    times = np.array([0.013, 0.05, 0.1])
    for a, b in (
        (plain, native),
        (plain.at(times), run(made, method, 0.1, compiled=True, t_eval=times)),
        (native.at(times), run(made, method, 0.1, compiled=False, dense=True, t_eval=times).at(times)),
    ):
        assert np.array_equal(a.mu, b.mu) and np.array_equal(a.g, b.g)
    plan = lm.Plan(made[0], method, rtol=1e-5, atol=1e-5, compiled=True)
    at_times = plan.run(made[1], t_end=0.1, t_eval=np.linspace(0.0, 0.1, 40))
    again = plan.run(made[1], t_end=0.1)  # step by step, whatever the plan has done before
    assert len(again) == again.steps + 1 and np.array_equal(again.at(at_times.t).mu, at_times.mu)
    half = plan.run(made[1], t_end=0.06)
    half.save(tmp_path / "half.npz")
    rest = plan.resume(half, t_end=0.1)
    loaded = lm.Trajectory.load(tmp_path / "half.npz")
    assert np.array_equal(plan.resume(loaded, t_end=0.1).mu, rest.mu)
    assert np.array_equal(loaded.at(times[:2]).g, half.at(times[:2]).g)
    both = half.then(rest)
    assert np.abs(both.at(times).g - native.at(times).g).max() < 1e-4
    assert np.abs(both.energy - native.energy[0]).max() < 0.1 * np.abs(native.energy[0])


def swings(t: float, state: Any) -> float:
    """The height of the third body, 1.5 m below."""
    return state.g[2 * 16 + 11] + 1.5


@pytest.mark.slow
@pytest.mark.parametrize("compiled", [False, pytest.param(True, marks=needs_compiler)])
def test_events_between_adaptive_steps(compiled: bool) -> None:
    """Zeros on the ways of steps, where `run.at` has them; what ends a run is where it goes on."""
    made, method = hinged(3), lm.RKMK(order=5)
    whole = run(made, method, 0.6, rtol=1e-8, atol=1e-8, compiled=compiled, events=[swings])
    plain = run(made, method, 0.6, rtol=1e-8, atol=1e-8, compiled=compiled)
    assert np.array_equal(whole.mu, plain.mu) and np.array_equal(whole.at(0.3).g, plain.at(0.3).g)
    times, states = whole.events[0]
    assert len(times) == 2
    for t, state in zip(times, states.g):
        assert abs(state[2 * 16 + 11] + 1.5) < 1e-13 and np.abs(plain.at(t).g - state).max() < 1e-15

    def once(t: float, state: Any) -> float:
        return swings(t, state)

    once.terminal = True  # type: ignore[attr-defined]
    plan = lm.Plan(made[0], method, rtol=1e-8, atol=1e-8, compiled=compiled, events=[once])
    ended = plan.run(made[1], t_end=0.6)
    assert ended.t[-1] == times[0] and np.array_equal(ended.g[-1], states.g[0])
    rest = plan.resume(ended, t_end=0.6)
    assert rest.t[0] == times[0] and abs(rest.t[-1] - times[1]) < 1e-6
    seen = run(made, method, 0.6, rtol=1e-8, atol=1e-8, compiled=compiled, events=[once], t_eval=np.linspace(0, 0.6, 9))
    assert np.array_equal(seen.t, np.linspace(0, 0.6, 9)[np.linspace(0, 0.6, 9) <= times[0]])


@pytest.mark.slow
def test_recorded_functions_and_jumps_of_inputs() -> None:
    """At the ends of all steps; a step ends where an input jumps."""
    made, method = hinged(3), lm.RKMK(order=5)
    found = run(made, method, 0.02, record=["energy"])
    assert len(found.energy) == found.steps + 1
    pulse = lm.PiecewisePolynomial([0.0, 0.0077, 1.0], [[3.0], [0.0]])
    pushed = Linkage(made[0].links, made[0].joints, forces=[lm.joints.Motor(1, pulse)])
    one = lm.joints.Motor(1, 3.0)
    first = run((Linkage(made[0].links, made[0].joints, forces=[one]), made[1]), method, 0.0077)
    for linkage, at, options in ((made[0], 0.0123, {"breaks": [0.0123]}), (pushed, 0.0077, {})):
        cut = run((linkage, made[1]), method, 0.02, **options)
        k = int(np.abs(cut.t - at).argmin())
        assert abs(cut.t[k] - at) < 1e-15 and len(cut) == cut.steps + 1
    assert np.abs(cut.mu[k] - first.mu[-1]).max() < 1e-12 * np.abs(first.mu).max()


@pytest.mark.parametrize("compiled", [False, pytest.param(True, marks=[needs_compiler, pytest.mark.slow])])
def test_what_cannot_be_stepped_is_named(compiled: bool) -> None:
    made, method = hinged(3), lm.RKMK(order=5)
    fast = made[0].state(angles={0: 0.7}, rates={1: 1e200})
    with pytest.raises((StepTooSmall, lm.errors.NotFinite), match="t = 0") as told:
        run((made[0], fast), method, compiled=compiled, progress=False)
    assert len(told.value.trajectory) == 1
    with pytest.raises(StepTooSmall, match="3 steps led to t"):
        lm.Plan(made[0], method, rtol=1e-9, compiled=compiled).run(made[1], t_end=1.0, steps=3)


@lm.record
class Wind(lm.Force):
    """One that begins at some time, before which it has no value."""

    begins: float

    def covector(self, t: float, xi: Any, g: Any) -> Any:
        return -0.1 * lm.formulas.sqrt(t - self.begins) * xi


@pytest.mark.parametrize("compiled", [False, pytest.param(True, marks=[needs_compiler, pytest.mark.slow])])
def test_without_a_velocity_at_the_start_there_is_no_run(compiled: bool) -> None:
    rods = hinged(3)[0]
    for begins, words in ((0.5, "at the start, t = 0"), (-0.5, None)):
        linkage = Linkage(rods.links, rods.joints, load={1: Wind(begins)})
        made = linkage, linkage.state(angles={0: 0.9}, rates={1: 1.5})
        if words is None:
            assert run(made, lm.RKMK(order=5), 0.01, compiled=compiled).t[-1] == 0.01
        else:
            with pytest.raises(lm.errors.IntegrationFailure, match=words) as told:
                run(made, lm.RKMK(order=5), 0.01, compiled=compiled)
            assert len(told.value.trajectory) == 1


@lm.record
class Unknown(lm.Force):
    """One by a function that native code does not have."""

    def covector(self, t: float, xi: Any, g: Any) -> Any:
        return -math.frexp(0.1 + t)[0] * xi


@needs_compiler
def test_what_cannot_be_compiled_is_named_where_all_steps_are_looked_at() -> None:
    rods = hinged(3)[0]
    linkage = Linkage(rods.links, rods.joints, load={1: Unknown()})
    made = linkage, linkage.state(angles={0: 0.9})
    with pytest.raises(lm.errors.NotCompilable, match="frexp"):
        run(made, lm.RKMK(order=5), compiled=True)


def test_numbers_that_other_steps_carried_along_are_refused_with_the_way_to_go_on() -> None:
    """A file of before, of fixed steps of RKMK, has slopes beside the states."""
    made, plan = hinged(3), lm.Plan(hinged(3)[0], lm.RKMK(order=4), h=0.01, compiled=False)
    found = plan.run(made[1], steps=2)
    carry = found.carry
    slopes = np.zeros((48, carry.numbers.shape[1]))
    of_before = dataclasses.replace(carry, numbers=np.concatenate([carry.numbers, slopes]))
    with pytest.raises(lm.errors.InvalidInput, match=r"plan\.run\(run\.last, t0=run\.t\[-1\]"):
        plan.resume(dataclasses.replace(found, carry=of_before), steps=1)


def test_an_interrupted_run_keeps_its_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    made, method = hinged(3), lm.RKMK(order=5)
    whole, asked = run(made, method, 0.02), itertools.count()

    def stopped(t: float, state: Any) -> float:
        if next(asked) == 40:
            raise KeyboardInterrupt
        return 1.0

    plan = lm.Plan(made[0], method, rtol=1e-5, atol=1e-5, compiled=False, events=[stopped])
    try:
        run_so_far = plan.run(made[1], t_end=0.02)
    except IntegrationInterrupted as error:
        run_so_far = error.trajectory
    assert np.array_equal(run_so_far.mu, whole.mu[: len(run_so_far)])


@pytest.mark.slow
def test_what_is_refused_or_written_out() -> None:
    """Members choose steps of their own, and are written out; Taylor's method in a chart that has no such form is refused."""
    made = hinged(3)
    mu, g = (np.stack([x, x]) for x in (np.asarray(made[1].mu), np.asarray(made[1].g)))
    members = run((made[0], made[0]._reached(mu=mu, g=g)), lm.RKMK(order=5))
    assert members.bodies == 2 and np.abs(members.mu[-1, 0] - run(made, lm.RKMK(order=5)).mu[-1]).max() < 1e-12
    with pytest.raises(IncompatibleSystem, match=r"no adaptive steps.*Exponential"):
        run(made, lm.Taylor(order=6))


@needs_compiler
@pytest.mark.slow
def test_sixty_four_rods_beside_fixed_steps() -> None:
    """As exact as fixed steps of the same length, by as many steps; and the energy beside the tolerance."""
    for linkage, angles in ((chain(64), {0: [0.3, 0.1, 0.0]}), (chain(64, axis=[0.0, 1.0, 0.0]), {0: 0.3, 40: 0.2})):
        made = linkage, linkage.state(angles=angles)
        exact = run(made, lm.RKMK(order=8), 0.2, rtol=1e-11, atol=1e-11, compiled=True, dense=False)
        found = run(made, lm.RKMK(order=5), 0.2, rtol=1e-7, atol=1e-7, compiled=True, dense=False)
        fixed = lm.integrate(linkage, lm.RKMK(order=5), made[1], h=0.2 / found.steps, steps=found.steps, compiled=True)
        off, beside = (np.abs(x.g[-1] - exact.g[-1]).max() for x in (found, fixed))
        assert off < 1e-5 and off < 5.0 * beside
        assert np.ptp(found.energy) < 1e-5 * np.abs(found.energy[0])
