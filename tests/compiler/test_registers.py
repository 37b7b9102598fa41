"""Numbers of an ensemble lie in two vector registers each, or in one if the kernel is long: both give the same bits."""

from __future__ import annotations

import numpy as np
import pytest

import liemech as lm
from liemech.compiler import kernel
from liemech.compiler.changes import cache

pytestmark = pytest.mark.compiled


@pytest.mark.slow
def test_one_register_or_two_give_the_same_bits(monkeypatch: pytest.MonkeyPatch) -> None:
    from liemech.compiler.translation import instructions

    monkeypatch.setattr(cache, "load", lambda *_: None)
    monkeypatch.setattr(cache, "store", lambda *_: None)
    body, count = lm.RigidBody([1.0, 1.5, 2.0]), 2 * kernel.lanes() + 3
    turned = np.linspace(0.0, 1.5, count)
    starts = body.state(mu=np.stack([np.cos(turned), np.sin(turned), 0.3 * turned], axis=-1))
    method = lm.CovariantVariational(lm.Cayley())
    runs, sizes = [], []
    for limit in (instructions.SIDE_BY_SIDE, 0):
        monkeypatch.setattr(instructions, "SIDE_BY_SIDE", limit)
        kernel.forget()
        runs.append(lm.Plan(body, method, 0.1, compiled=True).run(starts, steps=20))
        sizes.append(max(k.assembly().count("\n") for k in kernel.alive()))
    assert (runs[0].mu == runs[1].mu).all() and (runs[0].mu[-1] != runs[0].mu[0]).any()
    assert sizes[1] < 0.7 * sizes[0]  # there were two widths
