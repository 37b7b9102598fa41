"""How long LLVM takes follows from what it is given: nothing is stored for nobody, and no type is
spelled out at every use.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import liemech as lm

pytest.importorskip("llvmlite")
from liemech.compiler import kernel
from liemech.compiler.machine import llvm
from liemech.compiler.translation import expressions

pytestmark = pytest.mark.compiled


class Seen(Exception):
    """Ends a compilation."""


def text_of(system: Any, method: Any, start: Any, monkeypatch: pytest.MonkeyPatch) -> str:
    """What LLVM is given."""
    found: list[str] = []

    def stop(text: str) -> bytes:
        found.append(text)
        raise Seen

    monkeypatch.setattr(llvm, "object_code", stop)
    monkeypatch.setattr(kernel, "KERNELS", type(kernel.KERNELS)())
    monkeypatch.setenv("LIEMECH_CACHE_DIR", "/dev/null")
    with pytest.raises(Seen):
        lm.integrate(system, method, start, h=0.05, steps=1, compiled=True, progress=False)
    return found[0]


@pytest.mark.slow
def test_results_of_functions_are_short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Before, a composition on SE(3) had 2,000 stores of nothing and 300 characters an instruction."""
    system = lm.models.KirchhoffBody([1.0, 1.5, 2.0, 1.0, 2.0, 1.5])
    start = system.state(mu=np.array([0.5, 0.1, 0.8, 0.1, 0.2, 0.3]), g=np.eye(4))
    method = lm.Composition(lm.CovariantVariational(lm.Exponential()), order=8)
    text = text_of(system, method, start, monkeypatch)
    assert "store double undef" not in text
    assert len(text) < 120 * text.count("\n")


def slow(n: int) -> float:
    """More calls than anybody can wait for, of what is known now: no instruction is made."""
    return 1.0 if n < 2 else slow(n - 1) + slow(n - 2)


@lm.record
class Slow(lm.Method):
    order = 1

    def step(self, system, t, state, h):
        return lm.BodyState(state.mu * slow(38), state.g)


def test_what_never_ends_while_translating_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(expressions, "WORK", 5000)
    body = lm.RigidBody([1.0, 2.0, 3.0])
    with pytest.raises(lm.errors.NotCompilable, match="more than 5000 expressions"):
        lm.integrate(body, Slow(), body.state(mu=[0.1] * 3), h=0.1, steps=1, compiled=True)
