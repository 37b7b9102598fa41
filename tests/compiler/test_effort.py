"""How long LLVM takes follows from what it is given: nothing is stored for nobody, and no type is
spelled out at every use.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import liemech as lm

pytest.importorskip("llvmlite")
from liemech.compiler import kernel, llvm

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
    monkeypatch.setattr(kernel, "_kept", type(kernel._kept)())
    monkeypatch.setenv("LIEMECH_CACHE_DIR", "/dev/null")
    with pytest.raises(Seen):
        lm.integrate(system, method, start, h=0.05, steps=1, compiled=True, progress=False)
    return found[0]


@pytest.mark.slow
def test_results_of_functions_are_short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Before, a composition on SE(3) had 2,000 stores of nothing and 300 characters an instruction."""
    system = lm.KirchhoffBody([1.0, 1.5, 2.0, 1.0, 2.0, 1.5])
    start = system.state(mu=np.array([0.5, 0.1, 0.8, 0.1, 0.2, 0.3]), g=np.eye(4))
    method = lm.Composition(lm.CovariantVariational(lm.Exponential()), order=8)
    text = text_of(system, method, start, monkeypatch)
    assert "store double undef" not in text
    assert len(text) < 120 * text.count("\n")
