"""Rows of results for an array of numbers, such as the states of a known motion at many times."""

from __future__ import annotations

import functools
import time
from array import array
from collections.abc import Callable
from typing import Any

import numpy as np

from ..formulas.classes.layouts import layout_of, leaves
from . import kernel
from .batch import DISK, FEW, WORTH, share_out

WIDEST = 8
"""The largest number of floats that a vector register holds."""


class RowDriver:
    """A driver with NumPy in its place until native code pays; both give the same bits.

    driver : of values, and of two arrays: it reads the number in a row of the first and fills the
    row of the second.
    """

    def __init__(self, driver: Callable[..., None]) -> None:
        self.driver = driver
        # seconds in NumPy, and after how many it is asked again for native code
        self.spent, self.next = 0.0, DISK
        self.kernels: dict[Any, kernel.Kernel] = {}

    def rows(
        self, values: Arguments, x: np.ndarray, width: int, in_numpy: Callable[[np.ndarray, np.ndarray], None]
    ) -> np.ndarray:
        """A row of `width` numbers for every x, (n,).  in_numpy : fills the rows without native code, given x and them."""
        n = len(x)
        xs, outputs = np.zeros((n + -n % WIDEST, 1)), np.empty((n + -n % WIDEST, width))
        xs[:n, 0] = x
        run = self._kernel(values, xs, outputs) if n >= FEW else None
        if run is None:
            started = time.perf_counter()
            in_numpy(x, outputs[:n])
            self.spent += time.perf_counter() - started
        else:
            call = functools.partial(run.run, values.numbers, (1, width), (xs, outputs), 1)
            share_out(call, len(xs), run.lanes)
        return outputs[:n]

    def _kernel(self, values: Arguments, *arrays: np.ndarray) -> kernel.Kernel | None:
        run = self.kernels.get(values.layouts)
        if run is not None and run.reads.unchanged((*values.values, *arrays)):
            return run
        if self.spent <= self.next or kernel.available() is not None:
            return None
        args = self.driver, *values.values, *[kernel.Rows(a) for a in arrays]
        run = kernel.stored(*args, lanes=kernel.width())
        if run is None and self.spent > WORTH:
            run = kernel.kernel(*args, lanes=kernel.width())
        if run is None:
            self.next = min(WORTH, 2.0 * self.spent)
        else:
            self.kernels[values.layouts] = run
        return run


class Arguments:
    """Arguments of a driver with their layouts and numbers."""

    def __init__(self, *values: Any) -> None:
        self.values = values
        self.layouts = tuple(map(layout_of, values))
        self.numbers = array(
            "d", [x for value, layout in zip(values, self.layouts) for x in leaves(value, layout)]
        ).tobytes()
