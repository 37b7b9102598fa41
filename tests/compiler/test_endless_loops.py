"""Ctrl-C ends native code whose formula has a loop that never ends, soon."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import threading
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.compiler import kernel
from liemech.compiler.driver import write
from liemech.compiler.machine import interrupts
from liemech.errors import IntegrationInterrupted
from liemech.formulas.classes.layouts import NUMBER

pytestmark = [pytest.mark.compiled, pytest.mark.skipif(os.name == "nt", reason="os.kill ends a process there")]

BODY = lm.RigidBody([1.0, 1.5, 2.0])
ONE, MANY = BODY.state(mu=[0.5, 0.0, 0.7]), BODY.state(mu=np.full((11, 3), 0.5))


def settled(x: Any) -> Any:
    """0.2 after infinitely many turns."""
    while x > 0.0:
        x = x * 0.5 + 0.1
    return x


@lm.record
class Waiting(lm.Method):
    """Never comes to the end of its step, natively known by a loop."""

    inner: Any = lm.RKMK(order=2)
    order = 2

    def step(self, system, t, state, h):
        return self.inner.step(system, t, state, h * settled(state.mu[0] * state.mu[0] + 0.25))


@lm.record
class WaitingTrial(lm.RKMK):
    def trial(self, system, t, state, xi, h, rtol, atol, dense):
        h = h * settled(state.mu[0] * state.mu[0] + 0.25)
        return super().trial(system, t, state, xi, h, rtol, atol, dense)


@lm.record
class Counting(lm.Method):
    """A loop with an end that nobody lives to see."""

    order = 1

    def step(self, system, t, state, h):
        x = state.mu[0]
        for i in range(10**15):
            x = x + 1e-16 * i
        return lm.BodyState(lm.vec(x, state.mu[1], state.mu[2]), state.g)


SOON = 5.0
"""Seconds of processor time, whatever else the machine does; left alone the loops go on for months."""


def seconds_to_stop(run: Callable[[], Any], monkeypatch: pytest.MonkeyPatch) -> float:
    """How much processor time after Ctrl-C it comes back; the signal is sent once native code runs."""
    sent: list[float] = []

    def interrupt() -> None:
        time.sleep(0.05)
        sent.append(time.process_time())
        os.kill(os.getpid(), signal.SIGINT)

    run_once = lm.compiler.kernel.Kernel.on_memory

    def on_memory(self: Any, *args: Any) -> None:
        if not sent and threading.current_thread() is threading.main_thread():
            threading.Thread(target=interrupt).start()
            sent.append(0.0)
        run_once(self, *args)

    monkeypatch.setattr(lm.compiler.kernel.Kernel, "on_memory", on_memory)
    with pytest.raises(IntegrationInterrupted):
        run()
    return time.process_time() - sent[1]


@lm.record
class Asking(lm.Method):
    """Asks Python for a function in every turn."""

    order = 1

    def step(self, system, t, state, h):
        x = state.mu[0]
        for _ in range(10**15):
            x = math.hypot(x, 1e-6)
        return lm.BodyState(lm.vec(x, state.mu[1], state.mu[2]), state.g)


HOW = {"h": 0.1, "steps": 50, "compiled": True, "progress": False}


@pytest.mark.parametrize("start", [ONE, MANY], ids=["one body", "lanes"])
@pytest.mark.parametrize("method", [Waiting(), Counting(), Asking()], ids=["while", "for", "asking"])
def test_steps_of_one_length(method: Any, start: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    run = lambda: lm.integrate(BODY, method, start, **HOW)  # noqa: E731
    assert seconds_to_stop(run, monkeypatch) < SOON


def test_a_second_signal_raises_no_more_than_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the first one raised is gone with it: the next run is not disturbed."""
    run = lambda: lm.integrate(BODY, Waiting(), ONE, **HOW)  # noqa: E731
    kill = os.kill
    monkeypatch.setattr(os, "kill", lambda *of: [kill(*of) for _ in range(2)])
    assert seconds_to_stop(run, monkeypatch) < SOON
    assert lm.integrate(BODY, Long(), ONE, **HOW).ended is None


def test_a_warning_that_is_an_error_comes_out_of_native_code() -> None:
    """Of a function that native code asks Python for: no number is made up for it."""
    k = kernel.kernel(logarithm, 1.0, np.empty((1, 1)))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(RuntimeWarning, match="divide by zero"):
            k(0.0, np.empty((1, 1)))
        k(1.0, np.empty((1, 1)))


def logarithm(x: float, out: Any) -> None:
    write(out, 0, np.log10(x), NUMBER)


def test_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those that work beside the main thread stop with it."""
    start = BODY.state(mu=np.full((4096, 3), 0.5))
    run = lambda: lm.integrate(BODY, Waiting(), start, workers=3, **HOW)  # noqa: E731
    assert seconds_to_stop(run, monkeypatch) < SOON


def test_adaptive_steps_and_a_stepper(monkeypatch: pytest.MonkeyPatch) -> None:
    run = lambda: lm.integrate(BODY, WaitingTrial(order=5), ONE, t_end=9.0, compiled=True)  # noqa: E731
    assert seconds_to_stop(run, monkeypatch) < SOON
    stepper = lm.Plan(BODY, Waiting(), h=0.1, compiled=True).stepper(ONE)
    monkeypatch.undo()
    assert seconds_to_stop(stepper.step, monkeypatch) < SOON
    assert stepper.steps == 0


def test_what_another_handler_raises_comes_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """A time limit, for example."""

    class Late(Exception):
        pass

    def late(*_: Any) -> None:
        raise Late("too late")

    before = signal.signal(signal.SIGALRM, late)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.3)
        with pytest.raises(Late):
            lm.integrate(BODY, Waiting(), ONE, **HOW)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def test_long_loops_go_on_after_an_interrupt_of_another_run() -> None:
    """A run that was given up disturbs none that was not: the same bits."""

    x = lm.integrate(BODY, Long(), ONE, **HOW).mu
    interrupts.give_up(threading.Event())
    assert np.array_equal(lm.integrate(BODY, Long(), ONE, **HOW).mu, x)
    event = threading.Event()
    interrupts.give_up(event)
    with pytest.raises(KeyboardInterrupt):
        interrupts.working_for(event, lambda: lm.integrate(BODY, Long(), ONE, **HOW))


@lm.record
class Long(lm.Method):
    """100,000 turns in a step."""

    order = 1

    def step(self, system, t, state, h):
        x, n = state.mu[0], 0
        while n < 100_000:
            x, n = x + h * 1e-6, n + 1
        return lm.BodyState(lm.vec(x, state.mu[1], state.mu[2]), state.g)


SMALLER = """
from compiler.test_endless_loops import mixed
from compiler.worlds import native, plain
from liemech.compiler import kernel

assert kernel.width() == 4
rows = [(0.1 * i, 0.2 + 0.1 * i, 0.3, -0.1 * i) for i in range(8)]
plainly = [plain(mixed, row, 20_000) for row in rows]
for lanes in (1, 4, 8):
    assert native(mixed, rows, 4, 20_000, lanes) == plainly, lanes
"""
"""In code for AVX2 and no more, whose registers hold four numbers."""


def mixed(a: float, b: float, c: float, d: float, turns: int) -> Any:
    for _ in range(turns):
        a, b, c, d = a + 1e-3 * b, b + 1e-3 * c, c + 1e-3 * d, d - 1e-3 * a
    return a, b, c, d


@pytest.mark.slow
def test_asking_changes_no_register_of_a_processor_with_avx2() -> None:
    """The loop asks once in 2^14 turns, and goes on with the same numbers in all lanes."""
    from llvmlite import binding

    if not binding.get_host_cpu_features().get("avx2"):
        pytest.skip("another processor")
    here = Path(__file__).parent.parent
    paths = os.pathsep.join([str(here), str(here.parent)])
    environment = os.environ | {"PYTHONPATH": paths, "LIEMECH_CACHE_DIR": os.devnull, "LIEMECH_CPU": "x86-64-v3"}
    subprocess.run([sys.executable, "-c", SMALLER], env=environment, check=True, timeout=60)
