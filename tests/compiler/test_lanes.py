"""What becomes of a formula: static structure leaves no trace, lanes become vector instructions, rounding stays."""

from __future__ import annotations

import multiprocessing
import os
import platform
import re
import sys
import threading
from typing import Any

import fuzz
import numpy as np
import pytest
import worlds

import liemech as lm
from liemech.compiler import kernel
from liemech.compiler.driver import accepted, attempt, itself
from liemech.formulas import Record, Vec, dot, record, sin, vec
from liemech.formulas.classes.layouts import layout_of
from liemech.simulation.compiled.driver import advance

pytestmark = pytest.mark.compiled

ROWS = fuzz.arguments(5, 50, worlds.SPECIAL)


def instructions(formula: Any, lanes: int = 1) -> list[str]:
    """The instructions of LLVM's language that a formula ends up as, names left out."""
    array = np.zeros((4, lanes))
    args = formula, (), layout_of(Vec(0.0, 0.0, 0.0, 0.0)), 3, array, array, array
    from liemech.compiler.machine import llvm

    text = llvm.optimised(
        kernel._translated(worlds.drive, kernel.kernel(worlds.drive, *args, lanes=lanes).kinds, lanes)[1]
    )
    lines = [line.strip() for line in text.splitlines() if line.startswith("  ")]
    return [re.sub(r"[%@#!][\w.\"-]+", "_", line) for line in lines]


# --- static structure
# ------------------------------------------------------------------------------------------------

A = ((), (0.5,), (0.0, 0.5), (0.0, 0.0, 1.0))
B = (1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0)


def slope(y):
    return vec(y[1], -sin(y[0]))


def tableau_as_data(a, b, c, d, n):
    y, h, slopes = vec(a, b), c, []
    for row in A:
        at = y
        for w, k in zip(row, slopes):
            if w != 0.0:
                at = at + (h * w) * k
        slopes = [*slopes, slope(at)]
    for w, k in zip(B, slopes):
        y = y + (h * w) * k
    return y


def written_by_hand(a, b, c, d, n):
    y, h = vec(a, b), c
    k1 = slope(y)
    k2 = slope(y + (h * 0.5) * k1)
    k3 = slope(y + (h * 0.5) * k2)
    k4 = slope(y + (h * 1.0) * k3)
    y = y + (h * (1.0 / 6.0)) * k1
    y = y + (h * (1.0 / 3.0)) * k2
    y = y + (h * (1.0 / 3.0)) * k3
    return y + (h * (1.0 / 6.0)) * k4


@pytest.mark.parametrize("side_by_side", [False, True])
def test_a_tableau_given_as_data_is_the_code_written_by_hand(side_by_side: bool) -> None:
    lanes = kernel.lanes() if side_by_side else 1
    assert instructions(tableau_as_data, lanes) == instructions(written_by_hand, lanes)
    worlds.same_in_all_worlds(tableau_as_data, ROWS)


@record
class Options(Record):
    order: int = 2
    kind: str = "plain"
    extra: Any = None
    flags: tuple[bool, ...] = (True, False)

    def value(self, x):
        if self.kind == "fancy":
            return sin(sin(x))
        total = x
        for flag in self.flags:
            if flag and self.extra is None:
                total = total * 2.0
        while self.order > 5:
            total = total + sin(total)
        for _ in range(self.order):
            total = total + 1.0
        return total if self.order < 3 else sin(total)


OPTIONS = Options()


def with_options(a, b, c, d, n):
    unused = [x * x - dot(vec(b, c), vec(c, x)) for x in (b, c, d)]
    return vec(OPTIONS.value(a), b) if len(unused) == 3 else unused


def without_options(a, b, c, d, n):
    return vec(a * 2.0 + 1.0 + 1.0, b)


def test_branches_on_what_is_known_and_values_nobody_uses_leave_no_trace() -> None:
    found = instructions(with_options)
    assert found == instructions(without_options)


@pytest.mark.slow
def test_a_method_of_fewer_stages_is_shorter_code() -> None:
    """No dead stages: the exponentials of RKMK of order 1, 2, 4 are as many as the stages (the
    first needs none) and one.
    """
    products = [len(re.findall(r"\bv?mul[sp]d|\bfmul\b", march_assembly(order, 1))) for order in (1, 2, 4)]
    assert products[0] < 0.65 * products[1] and products[1] < 0.5 * products[2]


# --- lanes
# -----------------------------------------------------------------------------------------------------------


def march_assembly(order: int, lanes: int) -> str:
    """The machine code of steps of a rigid body."""
    body, method = lm.RigidBody([1.0, 1.5, 2.0]), lm.RKMK(order=order)
    start = body.state(mu=np.full(3 if lanes == 1 else (lanes, 3), 0.5))
    # a plan of its own: one that `integrate` remembers may hold a kernel that `alive` has let go
    lm.Plan(body, method, h=0.1, compiled=True).run(start, steps=1)
    kinds = layout_of(method), layout_of(body)
    mine = [k for k in kernel.alive() if k.entry is advance and k.kinds[:2] == kinds]
    # momentum alone is shown
    return next(k for k in mine if k.lanes == lanes and k.kinds[3].detail.width == 3).assembly()


@pytest.mark.slow
@pytest.mark.skipif(platform.machine().lower() not in ("x86_64", "amd64"), reason="reads the assembly of x86")
def test_an_ensemble_computes_with_whole_vector_registers() -> None:
    text = march_assembly(4, kernel.lanes())
    arithmetic = r"\bv?(?:add|sub|mul|div){}d\b.*%{}"
    register = {8: "zmm", 4: "ymm", 2: "xmm"}[kernel.width()]
    packed = re.findall(arithmetic.format("p", register), text)
    scalar = re.findall(arithmetic.format("s", "xmm"), text)
    assert len(packed) > 200, "one step of RKMK4 is some hundred products and sums"
    assert len(scalar) < len(packed) / 10, f"{len(scalar)} scalar beside {len(packed)} packed"


@pytest.mark.parametrize("side_by_side", [False, True])
def test_no_multiplication_is_fused_with_an_addition(side_by_side: bool) -> None:
    """It would round once where Python rounds twice."""
    lanes = kernel.lanes() if side_by_side else 1
    assert not re.search(r"\bv?fn?m(add|sub)|\bfml[as]\b", march_assembly(4, lanes))


def keeps_everything_across_calls(a, b, c, d, n):
    """More numbers alive than there are registers, while some lanes call the C library and others do not."""
    kept = [x * (i + 1.0) for i in range(8) for x in (a, b, c, d)]
    x = a
    if a > 0.0:
        x = sin(x)
    if b > 0.0:
        x = x + sin(sin(c) + b)
    total = dot(vec(*kept), vec(*[k * 0.25 - 1.0 for k in kept]))
    return vec(x, total, *kept)


@pytest.mark.sample(2)
@pytest.mark.parametrize("lanes", [1, 2, 4, 8, 16, 24])
def test_calls_of_the_c_library_leave_all_registers_of_all_lanes_alone(lanes: int) -> None:
    worlds.same_in_all_worlds(keeps_everything_across_calls, ROWS, lanes=[lanes])


def turns_until_small(a, b, c, d, n):
    """Lanes leave one after the other, and each remembers when."""
    x, k = a, -1
    for turn in range(60):
        x, k = 0.5 * x, turn
        if abs(x) < 1.0:
            break
    return vec(x, k + 0.0)


def test_the_turns_of_a_loop_are_counted_once_for_all_lanes() -> None:
    """A vector of counters would take a register and a mask; only `k`, which is asked for later, needs one."""
    worlds.same_in_all_worlds(turns_until_small, ROWS, lanes=[1, 4, kernel.lanes()])
    lines = instructions(turns_until_small, kernel.width())
    scalar, vectors = (
        len([line for line in lines if re.search(form, line)]) for form in (r"= phi i64", r"= phi <\d+ x i64>")
    )
    assert scalar == 2 * vectors, "the counters of bodies and of turns, beside k"


def risen(x):
    if x < 0.0:
        raise ValueError("negative")
    return x + 1.0


def with_a_part_that_is_tried(x, y, turns):
    if x > 2.0:
        raise ValueError("large")
    part = attempt(risen, y)
    return vec(x + part) if accepted(part, itself) else vec(x)


def test_an_attempt_within_another_fails_by_itself() -> None:
    """Neither makes the other fail, nor good."""
    rows = [[x, y] for x in (1.0, 3.0) for y in (1.0, -1.0)]
    worlds.same_in_all_worlds(with_a_part_that_is_tried, rows)


@pytest.mark.slow
def within(t, first, last):
    if not first <= t <= last:
        raise ValueError("outside")
    return t


def refused(t, last):
    if t > last:
        raise ValueError("outside")


def under_a_mask(a, b, c, d, n):
    x = within(1.0 * n, -10.0, 10.0) if c > 0.0 else b
    return vec(x, a)


def after_others_have_raised(a, b, c, d, n):
    if c > 2.0:
        raise ValueError("too much")
    return vec(within(1.0 * n, -10.0, 10.0) + b)


def after_others_have_returned(a, b, c, d, n):
    if c > 2.0:
        return vec(b)
    refused(n, 10)
    return vec(within(1.0 * n, -10.0, 10.0) + b)


@pytest.mark.parametrize("formula", [under_a_mask, after_others_have_raised, after_others_have_returned])
@pytest.mark.parametrize("turns", [3, 30])
def test_what_all_lanes_raise_together_may_stand_under_a_mask(formula: Any, turns: int) -> None:
    rows = [[0.5, 0.25, c, 1.0] for c in (-1.0, 0.5, 2.5, 3.5)]
    if formula is after_others_have_raised and turns == 30:
        rows.append([0.5, 0.25, -1.0, 1.0])
        found = worlds.native(formula, rows, 1, turns, kernel.lanes())
        assert found == [worlds.REJECTED] * len(rows)
    else:
        worlds.same_in_all_worlds(formula, rows, turns)


NOTHING: tuple[float, ...] = ()


def of_no_components(a, b, c, d, n):
    if c > 0.0:
        none, few = vec(*NOTHING), [*NOTHING]
        a = a + len(none) + 2.0 * b
        if b > 0.0:
            a = a - len(few) - c
    return vec(a, b)


def test_what_has_no_components_may_stand_under_a_mask() -> None:
    rows = [[0.5, b, c, 1.0] for c in (-1.0, 0.5, 2.5) for b in (0.25, -0.25)]
    worlds.same_in_all_worlds(of_no_components, rows)


@pytest.mark.slow
def test_every_body_of_an_ensemble_is_the_body_run_alone() -> None:
    """Fast and slow bodies side by side: large steps leave the polynomials and call the C library, small ones do not."""
    body = lm.RigidBody([1.0, 1.5, 2.0])
    rng = np.random.default_rng(7)
    mu = rng.normal(size=(37, 3)) * 10.0 ** rng.uniform(-3, 1.5, size=(37, 1))
    g = np.broadcast_to(np.eye(3), (37, 3, 3))
    for method in (lm.RKMK(order=4), lm.RKMK(order=3), lm.CovariantVariational(lm.Cayley())):
        h = 0.3 if isinstance(method, lm.RKMK) else 0.02
        many = lm.integrate(body, method, body.state(mu=mu, g=g), h=h, steps=60, every=20, compiled=True)
        for i in range(0, 37, 3):
            start = body.state(mu=mu[i], g=g[i])
            for compiled in (True, False):
                one = lm.integrate(body, method, start, h=h, steps=60, every=20, compiled=compiled)
                assert np.array_equal(one.mu, many.mu[:, i]) and np.array_equal(one.g, many.g[:, i])


# --- threads and processes
# -------------------------------------------------------------------------------------------


def run_of(moments: list[float], steps: int = 2000, compiled: bool = True) -> bytes:
    body = lm.RigidBody(moments)
    start = body.state(mu=[0.5, -0.25, 0.75], g=np.eye(3))
    run = lm.integrate(body, lm.RKMK(order=4), start, h=0.1, steps=steps, every=100, compiled=compiled)
    return run.mu.tobytes() + run.g.tobytes()


BODIES = [[1.0, 1.5, 2.0], [3.0, 1.0, 2.5], [2.0, 2.0, 1.0], [1.0, 1.0, 1.0]]


@pytest.mark.slow
def test_threads_that_compile_and_run_at_once_do_not_mix(monkeypatch: pytest.MonkeyPatch) -> None:
    expected = [run_of(moments, compiled=False) for moments in BODIES]
    kernel.forget()
    found: dict[int, bytes] = {}
    begin = threading.Barrier(len(BODIES))

    def work(i: int) -> None:
        begin.wait()
        found[i] = run_of(BODIES[i])

    threads = [threading.Thread(target=work, args=(i,)) for i in range(len(BODIES))]
    for t in threads:
        t.start()
    for t in threads:
        t.join(60)
    assert [found[i] for i in range(len(BODIES))] == expected


def test_workers_share_an_ensemble_without_changing_it() -> None:
    """A thread is worth 2^15 steps: here are three."""
    body = lm.RigidBody([1.0, 1.5, 2.0])
    starts = body.state(mu=np.random.default_rng(3).normal(size=(1000, 3)))
    runs = [lm.integrate(body, lm.RKMK(order=4), starts, h=0.1, steps=100, compiled=True, workers=w) for w in (1, 2, 5)]
    assert all(np.array_equal(run.mu, runs[0].mu) for run in runs)


def _child(queue: Any) -> None:
    queue.put(run_of(BODIES[1]))
    queue.close()
    queue.join_thread()
    os._exit(0)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="has no fork")
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_forked_process_uses_the_code_and_makes_more() -> None:
    run_of(BODIES[0])
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    child = context.Process(target=_child, args=(queue,))
    child.start()
    found = queue.get(timeout=60)
    child.join(60)
    assert found == run_of(BODIES[1], compiled=False) and child.exitcode == 0


def test_kernels_can_be_thrown_away() -> None:
    """The engine of one is not the engine of another."""
    array = np.zeros((4, 1))
    args = without_options, (), layout_of(Vec(0.0, 0.0, 0.0, 0.0)), 3, array, array, array
    kinds = kernel.kernel(worlds.drive, *args).kinds
    for _ in range(3):
        some = [kernel.Kernel(worlds.drive, kinds, 1) for _ in range(2)]
        del some
    worlds.same_in_all_worlds(without_options, ROWS)
