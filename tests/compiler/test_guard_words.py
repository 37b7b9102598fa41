"""Guard words around every buffer of native code: what is written outside is found and named."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.compiler import kernel
from liemech.compiler.driver import read, write
from liemech.compiler.machine import guard_words
from liemech.errors import BufferOverrun, NotCompilable
from liemech.formulas.classes.layouts import NUMBER, vector_layout

pytestmark = pytest.mark.compiled

TWO = vector_layout(2)


@pytest.fixture(autouse=True)
def fenced(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guard_words, "ON", True)


def copied(at: int, given: Any, out: Any) -> None:
    """A driver that writes where it is told."""
    write(out, at, read(given, 0, TWO), TWO)


def call(at: int, given: np.ndarray, out: Any, lanes: int = 1) -> None:
    args = at, given, out
    bodies = {"bodies": lanes, "end": lanes} if lanes > 1 else {}
    kernel.kernel(copied, *args, lanes=lanes)(*args, **bodies)


@pytest.mark.parametrize("at", [0, 1])
def test_what_lies_inside_is_written(at: int) -> None:
    out = np.zeros(4)
    call(at, np.array([1.0, 2.0]), out)
    assert out.tolist() == [0.0] * 2 * at + [1.0, 2.0] + [0.0] * (2 - 2 * at)


@pytest.mark.parametrize("at", [-1, -50, 2, 3, 50])
def test_an_overrun_is_caught_with_the_names_of_buffer_and_kernel(at: int) -> None:
    with pytest.raises(BufferOverrun, match=r"copied.*outside of its buffer `out`"):
        call(at, np.array([1.0, 2.0]), np.zeros(4))


def test_columns_of_many_bodies() -> None:
    lanes = kernel.lanes()
    given, out = np.random.default_rng(1).normal(size=(2, lanes)), np.zeros((4, lanes))
    call(1, given, out, lanes)
    assert np.array_equal(out[2:], given) and not out[:2].any()
    with pytest.raises(BufferOverrun, match="`out`"):
        call(2, given, out, lanes)


def test_what_all_bodies_share() -> None:
    """It is the same for each of them; what each has of its own has no place there."""
    lanes = kernel.lanes()
    out = np.zeros((4, lanes))
    call(1, kernel.Shared(np.array([3.0, 4.0])), kernel.Columns(out), lanes)  # type: ignore[arg-type]
    assert np.array_equal(out, np.repeat([[0.0], [0.0], [3.0], [4.0]], lanes, axis=1))
    both = kernel.Shared(np.array([3.0, 4.0])), kernel.Shared(np.zeros(4))
    call(1, *both, lanes)  # type: ignore[arg-type]
    assert both[1].array.tolist() == [0.0, 0.0, 3.0, 4.0]
    with pytest.raises(BufferOverrun, match="`out`"):
        call(2, *both, lanes)  # type: ignore[arg-type]
    with pytest.raises(NotCompilable, match="what all bodies share"):
        call(0, kernel.Columns(out[:2]), kernel.Shared(np.zeros(4)), lanes)  # type: ignore[arg-type]


def test_gaps_between_rows_and_arrays_that_may_not_be_written() -> None:
    """Rows of a wider array: what lies between them is somebody else's."""
    wide = np.zeros((8, 5))
    given = kernel.Rows(np.ones((8, 2)))
    call(0, given, kernel.Rows(wide[:, 1:3]))  # type: ignore[arg-type]
    assert wide[0].tolist() == [0.0, 1.0, 1.0, 0.0, 0.0]
    with pytest.raises(BufferOverrun, match="`out`"):
        call(1, given, kernel.Rows(wide[:, 1:3]))  # type: ignore[arg-type]
    constant = np.broadcast_to(np.zeros((1, 2)), (8, 2))
    with pytest.raises(BufferOverrun, match="`out`"):
        call(0, given, kernel.Rows(constant))  # type: ignore[arg-type]


def test_runs_of_all_kinds_have_the_same_bits() -> None:
    body = lm.RigidBody([1.0, 1.5, 2.0])
    one, many = body.state(mu=[0.5, 0.0, 0.8]), body.state(mu=np.full((5, 3), 0.5))
    for start in (one, many):
        fixed = lm.Plan(body, lm.RKMK(order=4), h=0.1, compiled=True)
        free = lm.Plan(body, lm.RKMK(order=5), compiled=True)
        for _ in range(2):  # the second time in one call
            run, way = fixed.run(start, steps=10), free.run(start, t_end=3.0)
            at_times = free.run(start, t_end=3.0, t_eval=[1.0, 2.5])
        guard_words.ON = False
        assert np.array_equal(run.mu, fixed.run(start, steps=10).mu)
        assert np.array_equal(way.mu, free.run(start, t_end=3.0).mu)
        assert np.array_equal(at_times.mu, free.run(start, t_end=3.0, t_eval=[1.0, 2.5]).mu)
        guard_words.ON = True
    stepper = fixed.stepper(one)
    stepper.step(3)
    assert np.array_equal(stepper.mu, fixed.run(one, steps=3).mu[-1])


def test_complex_rows() -> None:
    """The numbers of a complex array, two for each."""
    given = (np.arange(16.0) + 1j).reshape(8, 2)
    fence = guard_words.Fence(given[::2])
    fence.inside[0, 1] = np.array([5.0, 7.0]).view(np.int64)
    assert fence.copy_back()
    assert given[0, 1] == 5.0 + 7.0j and given[1, 1] == 3.0 + 1.0j


def test_a_number_alone() -> None:
    fence = guard_words.Fence(np.zeros(1))
    fence.memory[0] = 0
    assert not fence.copy_back() and NUMBER.width == 1
