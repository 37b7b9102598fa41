"""Constants of which the run says which one is taken are read-only memory: of any length."""

from __future__ import annotations

import copy
import math
from typing import Any

import numpy as np
import pytest

pytest.importorskip("llvmlite")
import liemech as lm
from liemech.compiler import kernel
from liemech.compiler.changes import cache
from liemech.compiler.changes.content_hashes import digest
from liemech.compiler.machine import llvm

pytestmark = pytest.mark.compiled

N = 2000
FLOATS = [0.5 * i for i in range(N)]
PAIRS = tuple([(float(i), i % 7, i % 3 == 0) for i in range(N)])
ROWS = np.arange(3.0 * N).reshape(N, 3)
WHOLE = np.arange(N) ** 2

BODY = lm.RigidBody([1.0, 2.0, 3.0])


@lm.record
class Reading(lm.Method):
    """Reads tables at places that the state says, also from their ends."""

    order = 1

    def step(self, system, t, state, h):
        i = int(abs(state.mu[0]) * 1000.0) % N
        number, whole, flag = PAIRS[i]
        x = FLOATS[i - 3] * 1e-3 + number * 1e-4 + 0.1 * whole + 1e-5 * ROWS[-i][2]
        x = x + (WHOLE[i] % 11) * 1e-2 + (0.3 if flag else 0.2)
        return lm.BodyState(lm.vec(x, state.mu[2], state.mu[1]), state.g)


@pytest.mark.parametrize("bodies", [None, 5])
def test_the_same_bits_as_plain_python(bodies: int | None) -> None:
    mu = np.random.default_rng(3).normal(size=(bodies, 3) if bodies else 3)
    runs = [
        lm.integrate(BODY, Reading(), BODY.state(mu=mu), h=0.1, steps=40, compiled=c, progress=False).mu
        for c in (False, True)
    ]
    assert np.array_equal(*runs)


@lm.record
class Beyond(lm.Method):
    order = 1

    def step(self, system, t, state, h):
        x = FLOATS[N - 3 + int(state.mu[0])]
        return lm.BodyState(lm.vec(state.mu[0] + 1.0, x, 0.0), state.g)


@pytest.mark.parametrize("compiled", [False, True])
def test_beyond_the_end_is_an_index_error(compiled: bool) -> None:
    with pytest.raises(IndexError) as caught:
        lm.integrate(BODY, Beyond(), BODY.state(mu=[0.0] * 3), h=0.1, steps=9, compiled=compiled)
    assert caught.value.trajectory.steps == 3


@pytest.mark.slow
def test_a_changed_entry_is_another_table(monkeypatch: pytest.MonkeyPatch) -> None:
    """In place or in another list, and back; also where only a bit tells."""
    monkeypatch.setitem(globals(), "FLOATS", [*FLOATS])

    def run(compiled: bool) -> Any:
        start = BODY.state(mu=[0.5, 0.25, 0.125])
        return lm.integrate(BODY, Reading(), start, h=0.1, steps=5, compiled=compiled).mu

    for i, x in ((497, 7.0), (497, -0.0), (497, 0.0), (3, 1.0), (497, 248.5)):
        FLOATS[i] = x
        assert run(True).tobytes() == run(False).tobytes(), (i, x)


DIFFERENT = [
    [0.0, 1.0],
    [-0.0, 1.0],
    [0, 1],
    [False, True],
    (0.0, 1.0),
    ["0.0", 1.0],
    [0.0, [1.0]],
    [[0.0], 1.0],
    [0.0, (1.0,)],
    [math.nan, 1.0],
    [-math.nan, 1.0],
    [np.frombuffer(b"\1\0\0\0\0\0\xf8\x7f").item(), 1.0],
    ["nan", 1.0],
    [0.0, None],
    [0.0, 1.0, 2.0],
]


def test_no_two_tables_have_one_token() -> None:
    tokens = [digest(x) for x in DIFFERENT]
    assert len(set(tokens)) == len(DIFFERENT)
    nested = [digest((1, x)) for x in DIFFERENT]
    assert len({*tokens, *nested}) == 2 * len(DIFFERENT)
    assert tokens == [digest(copy.deepcopy(x)) for x in DIFFERENT]


def test_the_code_does_not_grow_with_the_table(monkeypatch: pytest.MonkeyPatch) -> None:
    """Selecting took one comparison for each entry, and 10,000 were refused."""
    sizes: list[int] = []
    code = llvm.object_code
    monkeypatch.setattr(llvm, "object_code", lambda text: (sizes.append(llvm.size(text)), code(text))[1])
    monkeypatch.setattr(kernel, "KERNELS", type(kernel.KERNELS)())
    monkeypatch.setattr(cache, "load", lambda *_: None)
    for n in (50, 10_000):
        monkeypatch.setitem(globals(), "FLOATS", [0.5 * i for i in range(n)])
        monkeypatch.setitem(globals(), "N", n)
        how: dict[str, Any] = {"h": 0.1, "steps": 2, "compiled": True}
        lm.integrate(BODY, Beyond(), BODY.state(mu=[0.0] * 3), **how)
    assert sizes[0] == sizes[1] < 500
