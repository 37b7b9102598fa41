"""Formulas on many arguments at once: the work behind a method called with arrays."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..errors import NotCompilable
from .border import element
from .driver import accepted, attempt, itself, numbers, read, write
from .functions import where
from .values import Layout, is_any_number, layout_of
from .vectors import Vec

BLOCK = 4096


def evaluate(formula: Callable[..., Any], owner: Any, arrays: dict[str, np.ndarray], rest: dict[str, Any]) -> Any:
    """`formula(owner, **arguments)` for every row of the arrays, in native code; None if there is none."""
    from . import kernel

    if kernel.available() is not None:
        return None
    first = element(arrays, 0)
    example = formula(owner, **first, **rest)
    names = tuple(first)
    layouts = tuple(layout_of(first[name]) for name in names)
    shown = layout_of(example, is_any_number)
    n, lanes = len(next(iter(arrays.values()))), kernel.lanes()
    columns = -(-min(n, BLOCK) // lanes) * lanes
    data = np.zeros((sum(part.width for part in layouts), columns))
    out = np.empty((shown.width + 1, columns))
    arguments = formula, owner, layouts, tuple(rest.values()), shown, data, out
    try:
        run = kernel.kernel(_each, *arguments, lanes=lanes)
    except NotCompilable:
        return None
    results = np.empty((n, shown.width))
    for begin in range(0, n, columns):  # blocks that stay in the cache while their axes are exchanged
        count = min(columns, n - begin)
        row = 0
        for name, part in zip(names, layouts, strict=True):
            data[row : row + part.width, :count] = arrays[name][begin : begin + count].reshape(count, -1).T
            row += part.width
        run(*arguments, bodies=columns, end=-(-count // lanes) * lanes)
        bad = np.flatnonzero(out[shown.width, :count] == 0.0)
        if len(bad):
            formula(owner, **element(arrays, begin + int(bad[0])), **rest)  # raises the error that native code only marks
        results[begin : begin + count] = out[: shown.width, :count].T
    return _assembled(example, shown, results)


def _each(formula: Any, owner: Any, layouts: Any, rest: Any, shown: Any, data: Any, out: Any) -> None:
    start = 0
    arguments: list[Any] = []
    for part in layouts:
        arguments = [*arguments, read(data, start, part)]
        start = start + part.width
    value = attempt(_numbers, formula, owner, *arguments, *rest)
    write(out, 0, value)
    write(out, shown.width, where(accepted(value, itself), 1.0, 0.0))


def _numbers(formula: Any, owner: Any, *arguments: Any) -> Vec:
    return numbers(formula(owner, *arguments))


def _assembled(example: Any, layout: Layout, results: np.ndarray) -> Any:
    """Rows of numbers put together as arrays of the example's shape, the batch axis first."""
    if isinstance(example, tuple) and not isinstance(example, Vec):
        ends = np.cumsum([part.width for part in layout.parts])[:-1]
        parts = zip(example, layout.parts, np.split(results, ends, axis=1), strict=True)
        return tuple(_assembled(x, part, columns) for x, part, columns in parts)
    return np.ascontiguousarray(results).reshape(-1, *np.shape(example))
