"""Formulas on many arguments at once: the work behind a method called with arrays."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..errors import NotCompilable
from .driver import accepted, attempt, itself, numbers, read, write
from .functions import where
from .records import element
from .values import NUMBER, Layout, is_any_number, layout_of, leaves
from .vectors import Vec


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
    columns = -(-n // lanes) * lanes
    data = np.empty((sum(part.width for part in layouts), columns))
    row = 0
    for name, part in zip(names, layouts, strict=True):
        flat = arrays[name].reshape(n, -1).T
        data[row : row + part.width, :n] = flat
        data[row : row + part.width, n:] = flat[:, :1]
        row += part.width
    out = np.empty((shown.width + 1, columns))
    arguments = formula, owner, layouts, tuple(rest.values()), shown, data, out
    try:
        kernel.kernel(_each, *arguments, lanes=lanes)(*arguments, bodies=columns, end=columns)
    except NotCompilable:
        return None
    bad = np.flatnonzero(out[shown.width, :n] == 0.0)
    if len(bad):
        formula(owner, **element(arrays, int(bad[0])), **rest)  # raises the error that native code only marks
    return _assembled(example, shown, iter(out[: shown.width, :n]))


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


def _assembled(example: Any, layout: Layout, rows: Any) -> Any:
    """Rows of numbers put together as arrays of the example's shape, the batch axis first."""
    if layout == NUMBER:
        return next(rows)
    if isinstance(example, tuple) and not isinstance(example, Vec):
        return tuple(_assembled(x, part, rows) for x, part in zip(example, layout.parts, strict=True))
    columns = np.array([next(rows) for _ in leaves(example, layout)])
    return np.ascontiguousarray(columns.T).reshape(-1, *np.shape(example))
