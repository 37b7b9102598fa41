"""Plain Python or native code, chosen by the clock: whenever the change comes, the bits are the same."""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
import warnings
from typing import Any

import numpy as np
import pytest
from scenes import asymmetric_body

import liemech as lm
from liemech.compiler import kernel
from liemech.formulas import dot
from liemech.simulation.compiled import execution
from liemech.simulation.reports import progress as progress_module
from liemech.simulation.runs import equal

pytestmark = pytest.mark.compiled

RKMK = lm.RKMK(order=4, truncation=9)  # which no other test uses


@pytest.fixture
def fresh(monkeypatch: pytest.MonkeyPatch) -> Any:
    """A process that has learned nothing yet, and has a cache of nothing."""
    monkeypatch.setattr(execution, "_histories", {})
    monkeypatch.setattr(execution, "_shown", set())
    monkeypatch.setattr(importlib.import_module("liemech.simulation.integrate"), "_plans", {})
    monkeypatch.setattr(kernel, "KERNELS", type(kernel.KERNELS)())
    monkeypatch.setattr(kernel, "stored", lambda *_, **__: None)
    return monkeypatch


def starts(count: int | None) -> tuple[Any, Any]:
    body, start = asymmetric_body()
    if count is None:
        return body, start
    rng = np.random.default_rng(2)
    return body, body.state(rng.normal(size=(count, 3)), np.eye(3))


class Clock:
    """The time, as plain Python seems to take it: a millisecond at every look."""

    def __init__(self) -> None:
        self.now = 0.0

    def perf_counter(self) -> float:
        self.now += 1e-3
        return self.now


@pytest.mark.slow
@pytest.mark.parametrize("count", [None, 3, 19])
@pytest.mark.parametrize("wait", [0.0, 0.002, 0.003])
@pytest.mark.parametrize("every", [1, 7])
def test_a_run_that_changes_on_the_way_has_the_bits_of_one_that_does_not(
    count: int | None, wait: float, every: int, fresh: Any
) -> None:
    """In the middle of the steps, of the bodies, and of a sample."""
    body, start = starts(count)
    plain = lm.integrate(body, RKMK, start, h=0.1, steps=120, every=every, compiled=False)
    fresh.setattr(execution, "_histories", {})
    fresh.setattr(execution, "WAIT", wait)
    fresh.setattr(execution, "time", Clock())
    fresh.setattr(equal, "LOOK", 0.0)  # all pieces are short
    run = lm.integrate(body, RKMK, start, h=0.1, steps=120, every=every)
    assert run.compiled
    assert np.array_equal(run.mu, plain.mu)
    assert np.array_equal(run.g, plain.g)
    assert not run.stopped


@pytest.mark.slow
def test_an_adaptive_run_that_changes_on_the_way(fresh: Any) -> None:
    body, start = asymmetric_body()
    method, kept = lm.RKMK(order=5), dict(t_end=60.0, rtol=1e-8, atol=1e-10)
    plain = lm.integrate(body, method, start, compiled=False, **kept)
    fresh.setattr(execution, "WAIT", 0.002)
    fresh.setattr(execution, "time", Clock())
    run = lm.integrate(body, method, start, **kept)
    assert run.compiled
    assert np.array_equal(run.t, plain.t)
    assert np.array_equal(run.mu, plain.mu)
    times = np.linspace(0.0, 60.0, 500)
    assert np.array_equal(run.at(times).g, plain.at(times).g)


def test_short_runs_do_not_compile_and_a_number_of_them_does(fresh: Any) -> None:
    """What plain Python takes is added up over runs of the same kind; then native code serves the
    next one from its first step.
    """
    body, start = asymmetric_body()
    fresh.setattr(execution, "time", Clock())
    fresh.setattr(execution, "WAIT", 0.01)
    worlds = [lm.integrate(body, RKMK, start, h=0.1, steps=10).compiled for _ in range(40)]
    assert not worlds[0]
    assert worlds[-1]
    assert worlds == sorted(worlds)
    assert lm.integrate(lm.RigidBody([2.0, 1.0, 1.4]), RKMK, start, h=0.1, steps=1).compiled


@pytest.mark.slow
def test_code_on_disk_is_used_soon(fresh: Any, tmp_path: Any) -> None:
    program = """
import liemech as lm
from liemech.simulation.compiled import execution
execution.LOOK, execution.WAIT = 0.0, 1e9  # nothing is ever compiled
body = lm.RigidBody([1.0, 1.5, 2.0])
start = body.state(mu=[0.5, 0.0, 0.5])
print(lm.integrate(body, lm.RKMK(order=3), start, h=0.1, steps=500).compiled)
lm.integrate(body, lm.RKMK(order=3), start, h=0.1, steps=1, compiled=True)
"""
    env = os.environ | {"LIEMECH_CACHE_DIR": str(tmp_path)}
    found = [
        subprocess.run(
            [sys.executable, "-c", program], env=env, capture_output=True, text=True, check=True, timeout=120
        ).stdout
        for _ in range(2)
    ]
    assert found == ["False\n", "True\n"]


@lm.record
class Stubborn(lm.Hamiltonian):
    def energy(self, mu):
        return 0.5 * dot(mu, mu)

    def gradient(self, mu):
        try:
            return 1.0 * mu
        except ZeroDivisionError:
            return mu


@pytest.mark.parametrize("count", [None, 3])
def test_a_refusal_is_told_once_and_remembered(count: int | None, fresh: Any) -> None:
    system = lm.LiePoissonSystem(lm.SO3(), Stubborn())
    _, start = starts(count)
    fresh.setattr(execution, "WAIT", 0.0)
    asked: list[Any] = []
    real = kernel.kernel
    fresh.setattr(kernel, "kernel", lambda *a, **k: asked.append(a[0]) or real(*a, **k))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        runs = [lm.integrate(system, RKMK, start, h=0.1, steps=20) for _ in range(4)]
    assert not any(run.compiled for run in runs)
    assert [w.category for w in caught] == [lm.errors.NotCompiledWarning]
    assert caught[0].filename == __file__
    assert "Stubborn.gradient (test_execution.py, line" in str(caught[0].message)
    assert len(asked) == len(set(asked))
    for _ in range(2):
        with pytest.raises(lm.errors.NotCompilable, match=r"Stubborn.gradient \(test_execution.py, line"):
            lm.integrate(system, RKMK, start, h=0.1, steps=20, compiled=True)


@pytest.mark.parametrize(("progress", "shown"), [(None, True), (False, False)])
def test_a_long_compilation_shows_itself(progress: bool | None, shown: bool, fresh: Any, capsys: Any) -> None:
    body, start = asymmetric_body()
    fresh.setattr(progress_module, "NOTICE", 0.0)
    lm.integrate(body, RKMK, start, h=0.1, steps=2, compiled=True, progress=progress)
    assert ("compiling RKMK" in capsys.readouterr().err) is shown
