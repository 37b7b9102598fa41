"""Kernels in one process: bounded in number, made once, safe in threads and after a fork; one file binds LLVM."""

from __future__ import annotations

import gc
import os
import sys
import threading
import time
import weakref
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import liemech
import liemech as lm
from liemech.compiler import kept, kernel
from liemech.compiler.changes import cache
from liemech.compiler.driver import read, write
from liemech.formulas import Vec, vec
from liemech.formulas.classes.layouts import layout_of
from liemech.formulas.sites import LINE, WORTH, in_lines

pytestmark = pytest.mark.compiled

FLAT = layout_of(Vec(0.0, 0.0))


def scale(times: Any, given: Any, out: Any) -> None:
    x = read(given, 0, FLAT)
    write(out, 0, vec(x[0] * times[0], x[1] * times[0]), FLAT)


def result(k: float) -> list[float]:
    args = (k, "static"), np.array([[1.0], [2.0]]), np.zeros((2, 1))
    kernel.kernel(scale, *args)(*args)
    return args[2][:, 0].tolist()


@pytest.fixture
def no_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cache, "folder", lambda: None)


@pytest.mark.slow
def test_a_sweep_over_static_values_does_not_leak(monkeypatch: pytest.MonkeyPatch, no_disk: None) -> None:
    monkeypatch.setattr("liemech.compiler.kept.ALIVE", 4)
    kernel.forget()
    seen: list[Any] = []
    for i in range(6):
        assert result(i + 0.5) == [i + 0.5, 2 * i + 1.0]
        seen.append(weakref.ref(kernel.alive()[-1]))
    gc.collect()
    assert [r() is not None for r in seen] == [False] * 2 + [True] * 4
    held = kernel.alive()[0]
    for i in range(10, 14):
        result(i + 0.5)
    args = (2.5, "static"), np.array([[1.0], [2.0]]), np.zeros((2, 1))
    held(*args)  # who holds a kernel can run it
    assert args[2][:, 0].tolist() == [2.5, 5.0]


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="reads the memory of the process as Linux tells it")
def test_compiling_keeps_no_memory(monkeypatch: pytest.MonkeyPatch, no_disk: None) -> None:
    """Before, 0.27 KB for each instruction: the passes' tables were never freed."""
    texts: list[str] = []
    from liemech.compiler.machine import llvm

    made = llvm.object_code
    monkeypatch.setattr(llvm, "object_code", lambda text: texts.append(text) or made(text))
    body = lm.RigidBody([1.0, 2.0, 3.0])
    monkeypatch.setattr(kernel, "KERNELS", type(kernel.KERNELS)())
    start = body.state([1.0, 0.2, 0.3], np.eye(3))
    lm.integrate(body, lm.RKMK(order=4), start, h=0.1, steps=1, compiled=True, progress=False)

    def used() -> int:
        gc.collect()
        return int(Path("/proc/self/statm").read_text().split()[1]) * 4096

    for _ in range(3):
        made(texts[0])
    before = used()
    for _ in range(5):
        made(texts[0])
    assert used() - before < 5 * 0.05 * 1024 * llvm.size(texts[0])


def test_what_is_used_stays(monkeypatch: pytest.MonkeyPatch, no_disk: None) -> None:
    monkeypatch.setattr(kept, "ALIVE", 3)
    kernel.forget()
    result(0.5)
    first = kernel.alive()[0]
    for i in range(1, 5):
        result(i + 0.5)
        result(0.5)
    assert first in kernel.alive() and len(kernel.alive()) == 3


def test_threads_make_the_same_kernel_once(monkeypatch: pytest.MonkeyPatch, no_disk: None) -> None:
    kernel.forget()
    made: list[Any] = []
    translated = kernel._translated
    monkeypatch.setattr(kernel, "_translated", lambda *a: made.append(a) or translated(*a))
    begin, found = threading.Barrier(4), []

    def work() -> None:
        begin.wait()
        found.append(result(77.5))

    threads = [threading.Thread(target=work) for _ in range(4)]
    for t in threads:
        t.start()
    for t in threads:
        t.join(60)
    assert found == [[77.5, 155.0]] * 4 and len(made) == 1


def test_different_kernels_do_not_wait_for_each_other(monkeypatch: pytest.MonkeyPatch, no_disk: None) -> None:
    """While one thread is held up in the translation of its kernel, another makes its own."""
    kernel.forget()
    held, go_on = threading.Event(), threading.Event()
    translated = kernel._translated

    def slow(entry: Any, kinds: Any, *rest: Any) -> Any:
        if threading.current_thread().name == "slow":
            held.set()
            assert go_on.wait(60)
        return translated(entry, kinds, *rest)

    monkeypatch.setattr(kernel, "_translated", slow)
    thread = threading.Thread(target=result, args=(78.5,), name="slow")
    thread.start()
    assert held.wait(60)
    assert result(79.5) == [79.5, 159.0]
    assert thread.is_alive()
    go_on.set()
    thread.join(60)


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="has no fork")
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_child_forked_while_another_thread_compiles_can_compile(no_disk: None) -> None:
    kernel.forget()
    stop = threading.Event()

    def busy() -> None:
        k = 1000.5
        while not stop.is_set():
            result(k)
            k += 1.0

    thread = threading.Thread(target=busy)
    thread.start()
    try:
        for i in range(5):
            time.sleep(0.02)
            child = os.fork()
            if child == 0:
                os._exit(0 if result(2000.5 + i) == [2000.5 + i, 4001.0 + 2 * i] else 1)
            end = time.monotonic() + 60
            while (done := os.waitpid(child, os.WNOHANG)) == (0, 0) and time.monotonic() < end:
                time.sleep(0.02)
            if done == (0, 0):
                os.kill(child, 9)
                os.waitpid(child, 0)
            assert done[0] == child and os.waitstatus_to_exitcode(done[1]) == 0, "the child waits for a lock for ever"
    finally:
        stop.set()
        thread.join(60)


def test_an_instance_made_anew_is_not_looked_at_as_another(no_disk: None) -> None:
    """Runs of new instances with the same static part share the kernel without following all paths again."""
    runs = []
    for moments in ([1.0, 2.0, 3.0], [2.0, 3.0, 4.0]):
        body = lm.RigidBody(moments)
        runs.append(lm.integrate(body, lm.RKMK(order=2), body.state(mu=[1.0, 0.0, 0.5]), h=0.1, steps=3, compiled=True))
    mine = [k for k in kernel.alive() if k.entry.__name__ == "advance" and k.kinds[0] == layout_of(lm.RKMK(order=2))]
    assert len(mine) == 1 and mine[0].reads._guard is not None


def test_one_file_binds_llvm() -> None:
    package = Path(liemech.__file__).parent
    binding = [f.relative_to(package).as_posix() for f in package.rglob("*.py") if "llvmlite.binding" in f.read_text()]
    assert binding == ["compiler/machine/llvm.py"]


@pytest.mark.parametrize("shape", [(3, 5), (101, 12, 256), (7, 5008), (2**14,), (0, 8)])
def test_large_arrays_begin_a_line_of_the_cache(shape: tuple[int, ...]) -> None:
    """A store of eight numbers stays in one line: 13 % of a run that keeps every step."""
    arrays = [in_lines(*shape) for _ in range(5)]
    for array in arrays:
        assert array.shape == shape and array.flags.c_contiguous and array.flags.writeable
        if array.size >= WORTH:
            assert array.ctypes.data % LINE == 0
    arrays[0][...], arrays[1][...] = 1.0, 2.0
    assert (arrays[0] == 1.0).all() and (arrays[1] == 2.0).all()
