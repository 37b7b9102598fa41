"""What a method may remember from step to step: integers, truth values and tuples of numbers that
change, in every driver with the bits of plain Python; what cannot work is refused by name.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.errors import IntegrationFailure, InvalidType, NotCompilable

BODY = lm.RigidBody([1.0, 1.5, 2.0])
H = 0.1


@lm.record
class Mem(lm.Record):
    state: Any
    turn: int
    large: int
    first: bool
    pair: tuple[float, ...]
    nested: Any


@lm.record
class Alternating(lm.Method):
    """Steps whose length depends on all that is remembered."""

    inner: Any = lm.RKMK(order=4)
    order = 1

    def start(self, system, state, h):
        return Mem(state, 0, -(2**60) - 1, True, (0.5, 1.0), ((3, False), lm.vec(0.25, 0.75)))

    def observe(self, memory):
        return memory.state

    def step(self, system, t, m, h):
        (count, odd), weights = m.nested
        part = m.pair[0] if m.first else weights[0]
        if m.turn == 2:
            part = part * (1.0 + (m.large % 7) / 16.0) + count / 64.0
        new = self.inner.step(system, t, m.state, part * h)
        return Mem(
            new,
            (m.turn + 1) % 3,
            -m.large + 2 if m.turn == 1 else -m.large,
            not m.first or odd,
            (m.pair[1], m.pair[0]),
            (((count * 5 + 1) % 17, not odd), lm.vec(weights[1], weights[0])),
        )


def by_hand(state: Any, steps: int) -> np.ndarray:
    """The momenta of the same, without any driver."""
    method = Alternating()
    small = BODY.state(mu=state.mu)
    carry = method.start(BODY, lm.BodyState(lm.vec(*small.mu), None), H)
    found = [[*carry.state.mu]]
    for n in range(steps):
        carry = method.step(BODY, n * H, carry, H)
        found.append([*carry.state.mu])
    return np.array(found)


ONE = BODY.state(mu=[0.5, 0.0, 0.75**0.5])
MANY = BODY.state(mu=np.random.default_rng(26).normal(size=(11, 3)))
STEPS = 41
WORLDS = pytest.mark.parametrize("compiled", [False, True])


@WORLDS
def test_a_run_its_parts_and_a_stepper(compiled: bool, tmp_path: Path) -> None:
    exact = by_hand(ONE, STEPS)
    plan = lm.Plan(BODY, Alternating(), h=H, compiled=compiled)
    assert np.array_equal(plan.run(ONE, steps=STEPS).mu, exact)
    run = plan.run(ONE, steps=20)
    run = plan.resume(run, steps=STEPS - 20)
    assert np.array_equal(run.mu[-1], exact[-1])
    single = plan.run(ONE, steps=1)
    for n in range(2, 9):
        single = plan.resume(single, steps=1)
        assert np.array_equal(single.mu[-1], exact[n])
    single.save(tmp_path / "run.npz")
    again = plan.resume(lm.Trajectory.load(tmp_path / "run.npz"), steps=STEPS - 8)
    assert np.array_equal(again.mu[-1], exact[-1])
    stepper = plan.stepper(ONE)
    for n in range(1, 8):
        stepper.step()
        assert np.array_equal(stepper.mu, exact[n])


@pytest.mark.slow
@WORLDS
def test_an_ensemble_with_and_without_a_rest(compiled: bool) -> None:
    exact = np.stack([by_hand(BODY.state(mu=mu), STEPS) for mu in MANY.mu], axis=1)
    plan = lm.Plan(BODY, Alternating(), h=H, compiled=compiled)
    assert np.array_equal(plan.run(MANY, steps=STEPS).mu, exact)
    run = plan.resume(plan.run(MANY, steps=7), steps=STEPS - 7)
    assert np.array_equal(run.mu[-1], exact[-1])


@WORLDS
def test_integers_are_whole_up_to_their_last_bit(compiled: bool) -> None:
    """A generator of random numbers remembers 61 bits."""

    run = lm.integrate(BODY, Random(), ONE, h=H, steps=200, every=200, compiled=compiled)
    seed = 1
    for _ in range(200):
        seed = (seed * 3 + 2**59 + 7) % (2**60 - 93)
    assert run.mu[-1, 0] == float(seed % 1000003)


@lm.record
class Seeded(lm.Record):
    state: Any
    seed: int


@lm.record
class Random(lm.Method):
    order = 1

    def start(self, system, state, h):
        return Seeded(state, 1)

    def observe(self, memory):
        return memory.state

    def step(self, system, t, m, h):
        seed = (m.seed * 3 + 2**59 + 7) % (2**60 - 93)
        new = lm.BodyState(lm.vec(float(seed % 1000003), m.state.mu[1], m.state.mu[2]), m.state.g)
        return Seeded(new, seed)


@lm.record
class Doubling(Random):
    """Counts beyond 64 bits."""

    def step(self, system, t, m, h):
        return Seeded(m.state, 2 * m.seed)


@WORLDS
def test_an_integer_beyond_64_bits_ends_the_run_where_it_comes(compiled: bool) -> None:
    with pytest.raises(IntegrationFailure, match=r"64 bits.*step 63") as caught:
        lm.integrate(BODY, Doubling(), ONE, h=H, steps=100, compiled=compiled)
    assert caught.value.trajectory.steps == 62


@lm.record
class Loose(lm.Record):
    state: Any
    more: Any


@lm.record
class Changing(lm.Method):
    """Remembers `first`, from step 3 on `then`."""

    first: Any
    then: Any
    order = 1

    def start(self, system, state, h):
        return Loose(state, (0, self.first))

    def observe(self, memory):
        return memory.state

    def step(self, system, t, m, h):
        return Loose(m.state, (m.more[0] + 1, self.then if m.more[0] >= 2 else m.more[1]))


CHANGES = {
    "None": (None, 1.0, r"\[1\] was None and becomes a float"),
    "an integer": (1, 1.0, r"\[1\] was an int and becomes a float"),
    "a truth value": (True, 1, r"\[1\] was a bool and becomes an int"),
    "a longer vector": (lm.vec(1.0), lm.vec(1.0, 2.0), "vector of 1 and becomes a vector of 2"),
    "a longer tuple": ((1, 2), (1, 2, 3), r"\[1\] had 2 parts and has 3"),
    "a vector": (1.0, lm.vec(1.0, 2.0), r"\[1\] was a float and becomes a vector of 2"),
    "a text": ("a", "b", r"\[1\] was 'a' and becomes 'b'"),
    "a record": (lm.Cayley(), lm.Exponential(), "was a Cayley and becomes a Exponential"),
    "a matrix": (lm.mat([1.0, 2.0], [1.0, 2.0]), lm.mat([1.0, 2.0]), "matrix of 2 rows and becomes a matrix of 1 rows"),
    "a complex number": (1.0, 1.0 + 2.0j, r"\[1\] was a float and becomes \(1\+2j\)"),
}


@pytest.mark.parametrize("name", CHANGES)
def test_a_memory_that_changes_its_structure_is_refused_by_name(name: str) -> None:
    first, then, told = CHANGES[name]
    method = Changing(first, then)
    with pytest.raises(InvalidType, match=told) as caught:
        lm.integrate(BODY, method, ONE, h=H, steps=10, compiled=False)
    assert caught.value.trajectory.steps == 2
    with pytest.raises(InvalidType, match=told):
        lm.integrate(BODY, method, MANY, h=H, steps=10, compiled=False)
    for start in (ONE, MANY):
        with pytest.raises(NotCompilable):
            lm.integrate(BODY, method, start, h=H, steps=10, compiled=True)


@lm.record
class Hidden(Random):
    """Shows something else than the state."""

    shown: Any

    def observe(self, memory):
        return self.shown


@WORLDS
@pytest.mark.parametrize("shown", [None, 1.5, "abc", lm.vec(1.0, 2.0, 3.0), (ONE,)], ids=repr)
def test_what_is_observed_is_a_state(compiled: bool, shown: Any) -> None:
    for start in (ONE, MANY):
        with pytest.raises(InvalidType, match=r"Hidden.observe must return the state"):
            lm.integrate(BODY, Hidden(shown), start, h=H, steps=3, compiled=compiled)


@pytest.mark.slow
@WORLDS
def test_what_is_remembered_of_compensated_numbers_too(compiled: bool) -> None:
    """Numbers of two doubles, and of one with a rest."""
    for how in ({"precision": "double-double"}, {"compensated": True}):
        whole = lm.Plan(BODY, Alternating(), h=H, compiled=compiled, **how)
        plain = lm.Plan(BODY, Alternating(), h=H, compiled=False, **how)
        parts = whole.resume(whole.run(ONE, steps=13), steps=12)
        assert np.array_equal(parts.mu[-1], plain.run(ONE, steps=25).mu[-1])


def crossing(t: float, state: Any) -> Any:
    return state.mu[1] - 0.02


crossing.terminal = True  # type: ignore[attr-defined]


@pytest.mark.slow
def test_tangents_and_times_and_events() -> None:
    runs = []
    for compiled in (False, True):
        plan = lm.Plan(BODY, Alternating(), h=H, compiled=compiled)
        tangent = plan.tangent(ONE, by=("start",), steps=20)
        ended = lm.integrate(BODY, Alternating(), ONE, h=H, steps=40, events=[crossing], compiled=compiled)
        assert 0 < ended.steps < 40
        at_times = lm.integrate(BODY, Alternating(), ONE, h=H, t_end=2.0, t_eval=[0.3, 1.0, 1.9], compiled=compiled)
        runs.append((tangent.tangent["start"], ended.mu, at_times.mu))
    for plain, native in zip(*runs, strict=True):
        assert np.array_equal(plain, native)
