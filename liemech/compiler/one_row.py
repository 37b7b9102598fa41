"""One row in native code: a method called with one array for each argument, again and again.

Its arguments are copied to one place in memory, where native code reads and checks them and writes the results.
Rows that it marks or cannot take are evaluated in plain Python.
"""

from __future__ import annotations

import itertools
import math
import threading
from array import array
from typing import Any

import numpy as np

from ..formulas.calls.one_row import MADE, OneRow
from ..formulas.classes.layouts import gatherer, layout_of
from ..formulas.vectors import small
from . import batch, kernel
from .kept import SECONDS_OF_ROWS

_DOUBLE = np.dtype(float)

_adding = threading.Lock()

PATIENCE = 0.05
"""Seconds to wait for another thread before plain Python gives the result."""


def prepare(row: OneRow, args: tuple[Any, ...], result: Any) -> None:
    """Look for native code: in this process, on disk from `DISK` seconds of plain Python on, and made
    from `WORTH` on.
    """
    rows, key = row.rows(args), (row.formula, type(row.batch[1]))
    with _adding:
        spent = SECONDS_OF_ROWS[key] = SECONDS_OF_ROWS.get(key, 0.0) + row.spent
    row.spent = 0.0
    job = batch.job_of(rows, _small(result))
    if job is None or kernel.available() is not None:
        row.next = 2.0 * row.next
        return
    arguments = *job.arguments, *job.rows
    run = kernel.known(_alone, *arguments)
    if run is None and spent > batch.DISK:
        run = kernel.stored(_alone, *arguments)
    if run is None and spent > batch.WORTH:
        run = batch.compiled(_alone, job, rows, (1,))
    if run is None:
        row.next = 2.0 * row.next if spent > batch.WORTH else max(row.next, 0.1 * spent)
    elif Native.fits(job, result):
        MADE.add(key)
        row.native = Native(row, job, run, args, result)
    else:
        row.next = np.inf


def _alone(*args: Any) -> None:
    """`batch.each` as a separate driver, since batches look for kernels of it that take several rows."""
    batch.each(*args)


def _small(result: Any) -> Any:
    return tuple(map(_small, result)) if type(result) is tuple else small(result)


class Native:
    """A kernel and its memory: a mark, the arguments and the results."""

    def __init__(self, row: OneRow, job: Any, run: kernel.Kernel, args: Any, result: Any) -> None:
        self.run, self.owner, self.lock = run, row.batch[1], threading.Lock()
        self.shapes, count = [*map(np.shape, args)], len(args)
        self.single = type(result) is not tuple
        parts = (result,) if self.single else result
        self.dtypes = row.dtypes[:count]
        shapes = [(), *self.shapes, *map(np.shape, parts)]
        dtypes = [_DOUBLE, *self.dtypes, *[np.result_type(float, part) for part in parts]]
        sizes = [math.prod(shape) * dtype.itemsize // 8 for shape, dtype in zip(shapes, dtypes)]
        ends = [0, *itertools.accumulate(sizes)]
        self.memory = np.zeros(ends[-1])
        rows = [self.memory[a:b].reshape(1, -1) for a, b in itertools.pairwise(ends)]
        views = [flat[0].view(dtype).reshape(shape) for flat, dtype, shape in zip(rows, dtypes, shapes)]
        self.inputs, self.outputs = views[1 : 1 + count], views[1 + count :]
        self.kinds = [type(part) for part in parts]
        arguments = job.arguments
        numbers = [x for a in arguments for x in gatherer(layout_of(a))(a)]
        integers = [kernel.Rows(r).step for r in rows]
        self.arguments = (*arguments, *map(kernel.Rows, rows))
        self.rows = rows
        self.block = run.block(array("d", numbers).tobytes(), integers, rows)

    @staticmethod
    def fits(job: Any, result: Any) -> bool:
        """Whether all results are numbers, vectors and matrices of them, or truth values, of the sizes of the job."""
        parts = result if type(result) is tuple else (result,)
        sizes = [np.size(part) * (2 if np.iscomplexobj(part) else 1) for part in parts]
        return all(isinstance(p, (float, bool, np.ndarray)) for p in parts) and sizes == [
            layout.width for layout in job.layouts
        ]

    def __call__(self, owner: Any, args: tuple[Any, ...]) -> Any:
        """The result; None if plain Python has to give it."""
        if (owner is not self.owner and owner != self.owner) or len(args) != len(self.shapes):
            return None
        for value, shape, dtype in zip(args, self.shapes, self.dtypes):
            kind = type(value)
            if kind is np.ndarray:
                if value.dtype is not dtype or value.shape != shape:
                    return None
            elif kind is not float or shape:
                return None
        # another thread is there for microseconds; this one, interrupted within, would wait for itself
        if not (self.lock.acquire(blocking=False) or self.lock.acquire(timeout=PATIENCE)):
            return None
        try:
            if not self.run.reads.unchanged(self.arguments):
                return None
            memory = self.memory
            memory[0] = 0.0
            for place, value in zip(self.inputs, args):
                place[...] = value
            self.run.on_memory(self.block, self.rows)
            if memory[0]:
                return None
            results = [
                place.copy() if kind is np.ndarray else kind(place.item())
                for place, kind in zip(self.outputs, self.kinds)
            ]
        finally:
            self.lock.release()
        return results[0] if self.single else tuple(results)
