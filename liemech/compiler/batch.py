"""Formulas on many arguments at once: the work behind a method called with arrays.

Native code takes as many rows at once as a vector register holds numbers.  It reads them where the caller has them, checks them,
and writes the results where the caller gets them: nothing is copied or rearranged in memory.
"""

from __future__ import annotations

import functools
import inspect
import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from ..errors import InvalidInput, NotCompilable
from ..formulas.broadcasting import element
from ..formulas.complex_numbers import Complex
from ..formulas.pytree import Layout, is_any_number, layout_of
from ..formulas.vectors import Mat, Vec, vec
from .driver import accepted, any_body, attempt, itself, numbers, read, write

SHARE = 50_000
"""Rows that are worth a thread of their own."""


def evaluate(
    formula: Callable[..., Any],
    owner: Any,
    arrays: dict[str, np.ndarray],
    rest: dict[str, Any],
    elements: list[str],
    space: Any,
    tolerance: float,
) -> tuple[Any, np.ndarray] | None:
    """`formula(owner, **arrays, **rest)` for every row of the arrays, in native code; None if there is none.

    arrays : (n, ...), float64 or complex128; a stride of zero means one row for all.  elements : those that `space` guards.

    Returns the results, the batch axis first, and the rows that plain Python must look at: an argument or the result is not
    finite, or an element's `defect` is larger than the tolerance, or the formula raises.
    """
    from . import kernel

    if kernel.available() is not None:
        return None
    n, first = len(next(iter(arrays.values()))), element(arrays, 0)
    try:
        example = formula(owner, **first, **rest)
    except Exception:  # the border will see it too
        return None, np.array([0])
    parts = tuple(_parts(example))
    if not all(isinstance(part, (float, int, Complex, Vec, Mat)) for part in parts):
        return None
    layouts = tuple(layout_of(part, is_any_number) for part in parts)
    bound = _signature(formula).bind(owner, **first, **rest)
    bound.apply_defaults()
    plan: list[tuple[int, Layout | None, bool]] = []
    static: list[Any] = []
    for name, value in list(bound.arguments.items())[1:]:
        if name in first:
            plan.append(([*first].index(name), layout_of(value), name in elements))
        else:
            plan.append((len(static), None, False))
            static.append(value)
    widths = tuple(layout.width for layout in layouts)
    arguments = formula, owner, space, tolerance, tuple(plan), tuple(static), widths
    results = [np.empty((n, width)) for width in widths]
    suspect = np.zeros((1, 1))
    rows = [kernel.Rows(a) for a in (np.broadcast_to(suspect, (n, 1)), *map(_in_rows, arrays.values()), *results)]
    run = _kernel(n, *arguments, *rows)
    if run is None:
        return None
    _share_out(lambda begin, end: run(*arguments, *rows, begin=begin, end=end), n, run.lanes)
    if suspect[0, 0]:  # once more, now with a mark for every row
        suspect = np.zeros((n, 1))
        rows[0] = kernel.Rows(suspect)
        _share_out(lambda begin, end: run(*arguments, *rows, begin=begin, end=end), n, run.lanes)
    finished = iter([_assembled(*part) for part in zip(parts, layouts, results, strict=True)])
    return _nested(example, finished), np.flatnonzero(suspect)


_signature = functools.cache(inspect.signature)


def _kernel(n: int, *arguments: Any) -> Any:
    """Native code for as many rows at once as a register holds numbers; where a formula admits only one, for one."""
    from . import kernel

    for lanes in (kernel.width(), 1) if n >= kernel.width() else (1,):
        try:
            return kernel.kernel(_each, *arguments, lanes=lanes)
        except NotCompilable:
            pass
    return None


def _share_out(run: Callable[[int, int], None], n: int, lanes: int) -> None:
    """Run from 0 to n, large numbers of rows on all processors; the last rows, too few for all lanes, with some once more."""
    processors = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    threads, whole = max(1, min(processors, n // SHARE)), n // lanes
    bounds = [whole * i // threads * lanes for i in range(threads + 1)]
    if threads == 1:
        run(0, bounds[1])
    else:
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(run, bounds[:-1], bounds[1:]))
    if n % lanes:
        run(n - lanes, n)


def _in_rows(array: np.ndarray) -> np.ndarray:
    """The array, or a copy if its rows are no rows of numbers in memory."""
    if array.strides[0] == 0:
        return np.broadcast_to(np.require(array[:1], requirements=("C", "A")), array.shape)
    whole = array[0].flags.c_contiguous and array.flags.aligned and array.strides[0] % 8 == 0
    return array if whole else np.require(array, requirements=("C", "A"))


# ------------------------------------------------------------------ one row, in native code


def _each(
    formula: Any, owner: Any, space: Any, tolerance: Any, plan: Any, static: Any, widths: Any, suspect: Any, *rows: Any
) -> None:
    arguments: list[Any] = []
    for at, layout, _ in plan:
        arguments = [*arguments, static[at] if layout is None else read(rows[at], 0, layout)]
    value, total = attempt(_guarded, formula, owner, space, tolerance, plan, widths, arguments)
    start = 0
    for k in range(len(widths)):
        write(rows[len(rows) - len(widths) + k], 0, vec(*value[start : start + widths[k]]))
        start = start + widths[k]
    if any_body(not accepted(total, itself)):
        write(suspect, 0, vec(1.0))


def _guarded(formula: Any, owner: Any, space: Any, tolerance: Any, plan: Any, widths: Any, arguments: Any) -> tuple[Vec, float]:
    """The numbers of the result and their sum, finite only if they are; raises where plain Python must look at the arguments."""
    given: list[Any] = []
    for k in range(len(plan)):
        if plan[k][1] is not None:
            given = [*given, *numbers(arguments[k])]
    total = _total(given)
    sound = total - total == 0.0
    for k in range(len(plan)):
        if plan[k][2]:
            sound = sound and space.defect(arguments[k]) <= tolerance
    if not sound:
        raise InvalidInput("not finite, or no element")
    value = numbers(formula(owner, *arguments))
    if len(value) != sum(widths):
        raise NotCompilable("the result has another form than in plain Python")
    return value, _total(value)


def _total(terms: Any) -> Any:
    """The sum of the terms, by halves: a short chain of additions."""
    half = len(terms) // 2
    return _total(terms[:half]) + _total(terms[half:]) if half else terms[0]


# ------------------------------------------------------------------ results


def _parts(example: Any) -> Iterator[Any]:
    """The parts of a result that each fill an array."""
    if isinstance(example, tuple) and not isinstance(example, Vec):
        for part in example:
            yield from _parts(part)
    else:
        yield example


def _nested(example: Any, parts: Iterator[Any]) -> Any:
    """The arrays, in tuples as in the example."""
    if isinstance(example, tuple) and not isinstance(example, Vec):
        return tuple(_nested(part, parts) for part in example)
    return next(parts)


def _assembled(example: Any, layout: Layout, rows: np.ndarray) -> np.ndarray:
    """Rows of numbers as an array of the example's shape, the batch axis first."""
    shape = len(rows), *(example.shape if isinstance(example, Mat) else (len(example),) if isinstance(example, Vec) else ())
    widths = list(_entries(layout))
    if set(widths) == {2}:
        return rows.view(np.complex128).reshape(shape)
    if 2 in widths:  # real entries among complex ones
        starts = np.cumsum([0, *widths[:-1]])
        whole = rows[:, starts].astype(np.complex128)
        for k, start in enumerate(starts):
            if widths[k] == 2:
                whole.imag[:, k] = rows[:, start + 1]
        return whole.reshape(shape)
    return rows.reshape(shape).astype(bool) if isinstance(example, bool) else rows.reshape(shape)


def _entries(layout: Layout) -> Iterator[int]:
    """How many numbers each entry of a vector or matrix has: one if it is real, two if it is complex."""
    if layout.kind in ("number", "pair"):
        yield layout.width
    for part in () if layout.kind == "pair" else layout.parts:
        yield from _entries(part)
