"""Formulas on many arguments at once: the work behind a method called with arrays.

Rows are evaluated in plain Python until it pays to have native code: it is there already, or the
rows left would take longer than making it.  Native code takes as many rows at once as a vector
register holds numbers.  It reads them where the caller has them, checks them, and writes the
results where the caller gets them: nothing is copied or rearranged in memory.  A row that it marks
(an argument or the result is not finite, an array is no element, the formula raises) is evaluated
again in plain Python, whose result or error counts.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
import itertools
import os
import time
import weakref
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from ..errors import InvalidInput, NotCompilable, NotCompiledWarning, warn
from ..formulas.calls.batches import MEMBERSHIP, Batch, row_of
from ..formulas.classes.frozen import frozen
from ..formulas.classes.layouts import NUMBER, Layout, layout_of, vector_layout
from ..formulas.numbers.bases import is_any_number
from ..formulas.numbers.complex_numbers import Complex
from ..formulas.sums import total as total_of
from ..formulas.vectors import Mat, Vec, vec
from . import kernel
from .driver import accepted, any_body, attempt, itself, numbers, read, write
from .kept import BATCHES, NATIVE, REFUSED, SECONDS_OF_BATCHES
from .machine.interrupts import in_threads

SHARE = 50_000
"""Rows that are worth a thread of their own."""

WORTH, ROWS = 0.3, 200
"""A compilation is worth while if plain Python would take longer than so many seconds, those of a short kernel, and so
many rows: formulas of many operations take longer to compile, too.
"""

DISK = 0.1
"""Seconds of plain Python that are worth a look at the disk, and the import of llvmlite."""

NOISE = 0.005
"""Seconds after which the time of a row is believed."""

FEW = 8
"""Smaller batches are not worth the preparations; no register holds more numbers."""


def evaluate_rows(batch: Batch) -> Any:
    """The formula for every row, the batch axis first: the values of plain Python, bit for bit,
    wherever they are computed.
    """
    n, key = len(batch), (batch.formula, type(batch.owner))
    ready = _of_this_form(batch) if n >= FEW and key in NATIVE else None
    if ready is not None:
        return _finished(batch, *ready, [])
    values = [batch.row(0)]
    job = job_of(batch, values[0]) if n >= FEW else None
    run = _ready_made(kernel.known, job) if job is not None and key in NATIVE else None
    if run is not None and job is not None:
        return _finished(batch, job, run, values)
    started, before, looked = time.thread_time(), SECONDS_OF_BATCHES.get(key, 0.0), False
    while run is None and len(values) < n:
        values.append(batch.row(len(values)))
        done = len(values) - 1
        if job is None or done & (done - 1):
            continue
        spent = time.thread_time() - started  # asked after 1, 2, 4, 8, ... rows
        expected = before + spent * (n - 1) / done
        if expected > DISK and before + spent > NOISE and not looked:
            run, looked = _ready_made(kernel.stored, job), True
        if expected > WORTH + ROWS * spent / done and before + spent > NOISE and run is None:
            run = compiled(each, job, batch, _lanes())
            job = None if run is None else job
    SECONDS_OF_BATCHES[key] = before + time.thread_time() - started
    if run is None or job is None or len(values) == n:
        return batch.stacked(values, range(n))
    NATIVE.add(key)
    return _finished(batch, job, run, values)


def _form(batch: Batch) -> Any:
    """The form of a batch: batches of one form run the same native code."""
    arrays = tuple([(name, a.shape[1:], a.dtype.char) for name, a in batch.arrays.items()])
    return (
        batch.formula,
        layout_of(batch.owner),
        arrays,
        batch.elements,
        tuple(batch.rest),
        layout_of(tuple(batch.rest.values())),
    )


def _of_this_form(batch: Batch) -> tuple[Job, kernel.Kernel] | None:
    """The job and its kernel, if a batch of this form had them and nothing that the kernel has read has changed."""
    form = _form(batch)
    entry = BATCHES.get(form)
    run = entry[1]() if entry is not None and kernel.available() is None else None
    if entry is None or run is None:
        return None
    job = entry[0].for_batch(batch)
    if not run.reads.unchanged((*job.arguments, *job.rows)):
        return None
    BATCHES.use(form)
    return job, run


# ------------------------------------------------------------------ native code for a batch


@frozen
class Job:
    """The key and the arguments of native code for a batch: the driver's arguments that are no arrays, and the
    parts of a result.
    """

    arguments: tuple[Any, ...]
    example: Any
    parts: tuple[Any, ...]
    layouts: tuple[Layout, ...]
    rows: list[kernel.Rows]
    """Like those it will get: marks, arguments, results."""
    static: dict[str, Any]
    """The arguments of the formula that are the same for all rows."""

    def kept(self, batch: Batch) -> Job:
        """The job without owner, group and values of its batch, so that they may be freed."""
        static = {k: None if k in batch.rest else default for k, default in self.static.items()}
        *_, plan, _, results = self.arguments
        return dataclasses.replace(self, arguments=(plan, (), results), static=static)

    def for_batch(self, batch: Batch) -> Job:
        """The job for a batch of the same form."""
        static = self.static | batch.rest
        *_, plan, _, results = self.arguments
        arguments = (batch.formula, batch.owner, batch.group, MEMBERSHIP, plan, tuple(static.values()), results)
        return Job(arguments, self.example, self.parts, self.layouts, self.rows, static)

    @property
    def key(self) -> Any:
        formula, owner, _, _, plan, static, _ = self.arguments
        return formula, layout_of(owner), plan, layout_of(static), self.layouts


def job_of(batch: Batch, example: Any) -> Job | None:
    """The job of a batch; None if the results are no numbers, or native code for them has been refused before."""
    parts = tuple(_parts(example))
    if not all(isinstance(part, (float, int, Complex, Vec, Mat)) for part in parts):
        return None
    layouts = tuple([layout_of(part, is_any_number) for part in parts])
    first = row_of(batch.arrays, 0)
    bound = _signature(batch.formula).bind(batch.owner, **first, **batch.rest)
    bound.apply_defaults()
    plan: list[tuple[int, Layout | None, bool]] = []
    static: dict[str, Any] = {}
    for name, value in list(bound.arguments.items())[1:]:
        if name in first:
            plan.append(([*first].index(name), layout_of(value), name in batch.elements))
        else:
            plan.append((len(static), None, False))
            static[name] = value
    results = tuple([vector_layout(layout.width) for layout in layouts])
    arguments = (batch.formula, batch.owner, batch.group, MEMBERSHIP, tuple(plan), tuple(static.values()), results)
    example_rows = [kernel.Rows(np.empty((1, 1))) for _ in range(1 + len(batch.arrays) + len(results))]
    job = Job(arguments, example, parts, layouts, example_rows, static)
    return None if job.key in REFUSED else job


_signature = functools.cache(inspect.signature)


def _lanes() -> tuple[int, int]:
    """The numbers of rows side by side to try: as many as a register holds numbers, or one where a formula admits no
    more.
    """
    return kernel.width(), 1


def _ready_made(find: Callable[..., kernel.Kernel | None], job: Job) -> kernel.Kernel | None:
    """The kernel of a job, if there is one already.  find : `kernel.known`, in this process, or `kernel.stored`, on disk."""
    if kernel.available() is not None:
        return None
    kernels = (find(each, *job.arguments, *job.rows, lanes=lanes) for lanes in _lanes())
    return next((run for run in kernels if run is not None), None)


def compiled(driver: Callable[..., None], job: Job, batch: Batch, several: tuple[int, ...]) -> kernel.Kernel | None:
    """The kernel of a job for the first number of lanes that the formula admits, compiled if need be; None, after a
    warning, if it admits none, and from then on.
    """
    if kernel.available() is not None:
        return None
    for lanes in several:
        try:
            return kernel.kernel(driver, *job.arguments, *job.rows, lanes=lanes)
        except NotCompilable as error:
            reason = error
    REFUSED.add(job.key)
    # ours that call NumPy mean to
    if not batch.formula.__module__.startswith(f"{__package__.partition('.')[0]}."):
        warn(f"{batch.where} runs as plain Python: {reason}", NotCompiledWarning)
    return None


def _finished(batch: Batch, job: Job, run: kernel.Kernel, values: list[Any]) -> Any:
    """The results: of the first rows the values, of all others from native code, or from plain Python if it marks them."""
    if values:
        form = _form(batch)
        BATCHES[form] = job.kept(batch), weakref.ref(run)
        BATCHES.use(form)
    # at least a register full of rows, some of them twice
    start = min(len(values), len(batch) - run.lanes)
    whole = [np.empty((len(batch), layout.width)) for layout in job.layouts]
    arrays = [*[_in_rows(array[start:]) for array in batch.arrays.values()], *[array[start:] for array in whole]]
    count = len(batch) - start

    def evaluate(marks: np.ndarray) -> None:
        rows = [kernel.Rows(array) for array in (marks, *arrays)]
        share_out(run.on(*job.arguments, *rows), count, run.lanes)

    mark, marks = np.zeros((1, 1)), np.zeros((0, 1))
    evaluate(np.ndarray((count, 1), buffer=mark, strides=(0, 8)))
    if mark[0, 0]:  # once more, now with a mark for every row
        marks = np.zeros((count, 1))
        evaluate(marks)
    results = _nested(
        job.example, iter([_assembled(*part) for part in zip(job.parts, job.layouts, whole, strict=True)])
    )
    marked = [start + int(i) for i in np.flatnonzero(marks)]
    rows = [*range(len(values)), *[i for i in marked if i >= len(values)]]
    if rows:
        _put(results, rows, batch.stacked([*values, *[batch.row(i) for i in rows[len(values) :]]], rows))
    return results


def _put(results: Any, rows: Any, values: Any) -> None:
    """Write values into these rows of the results, part by part of a tuple."""
    if isinstance(results, tuple):
        for part, value in zip(results, values, strict=True):
            _put(part, rows, value)
    else:
        results[rows] = values


def share_out(run: Callable[[int, int], None], n: int, lanes: int) -> None:
    """Run the rows from 0 to n, many of them on all processors; the last ones, too few for all lanes, together with some
    that are run twice.
    """
    if n < 2 * SHARE:
        run(0, n - n % lanes)
        if n % lanes:
            run(n - lanes, n)
        return
    processors = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    threads, whole = max(1, min(processors, n // SHARE)), n // lanes
    bounds = [whole * i // threads * lanes for i in range(threads + 1)]
    works = [functools.partial(run, *ends) for ends in itertools.pairwise(bounds)]
    with ThreadPoolExecutor(max(1, threads - 1)) as pool:
        in_threads(works, pool)
    if n % lanes:
        run(n - lanes, n)


def _in_rows(array: np.ndarray) -> np.ndarray:
    """The array, or a copy if the numbers of a row do not lie side by side."""
    if array.strides[0] == 0:
        return np.broadcast_to(np.require(array[:1], requirements=("C", "A")), array.shape)
    whole = array[0].flags.c_contiguous and array.flags.aligned and array.strides[0] % 8 == 0
    return array if whole else np.require(array, requirements=("C", "A"))


# ------------------------------------------------------------------ one row, in native code


def each(
    formula: Any, owner: Any, space: Any, tolerance: Any, plan: Any, static: Any, results: Any, suspect: Any, *rows: Any
) -> None:
    """The driver of a batch, for one row: read the arguments, write the results, and mark a row that is not accepted.

    plan : of each argument its index, among the rows or else in `static`, its layout, and whether it must be an element.
    """
    arguments: list[Any] = []
    for at, layout, _ in plan:
        arguments = [*arguments, static[at] if layout is None else read(rows[at], 0, layout)]
    value, total = attempt(_guarded, formula, owner, space, tolerance, plan, results, arguments)
    start = 0
    for k in range(len(results)):
        end = start + results[k].width
        write(rows[len(rows) - len(results) + k], 0, vec(*value[start:end]), results[k])
        start = end
    if any_body(not accepted(total, itself)):
        write(suspect, 0, 1.0, NUMBER)


def _guarded(
    formula: Any, owner: Any, space: Any, tolerance: Any, plan: Any, results: Any, arguments: Any
) -> tuple[Vec, float]:
    """The numbers of the result and their sum, finite only if they are; raises where plain Python
    must look at the arguments.
    """
    components: list[Any] = []
    for k in range(len(plan)):
        if plan[k][1] is not None:
            components = [*components, *numbers(arguments[k])]
    total = total_of(components)
    sound = total - total == 0.0
    for k in range(len(plan)):
        if plan[k][2]:
            sound = sound and space.defect(arguments[k]) <= tolerance
    if not sound:
        raise InvalidInput("not finite, or no element")
    value = numbers(formula(owner, *arguments))
    if len(value) != sum([layout.width for layout in results]):
        raise NotCompilable("the result has another form than in plain Python")
    return value, total_of([*value])


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
    shape = (
        len(rows),
        *(example.shape if isinstance(example, Mat) else (len(example),) if isinstance(example, Vec) else ()),
    )
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
    """The numbers of each entry of a vector or matrix: one if it is real, two if it is complex."""
    if layout.kind in ("number", "pair"):
        yield layout.width
    for part in () if layout.kind == "pair" else layout.parts:
        yield from _entries(part)
