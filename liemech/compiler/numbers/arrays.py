"""Arrays that a formula makes of numbers of the run: `np.array([x, y])`, and a constant array times
such a number.

Beside a `Vec`, a `Mat` or a number that carries a derivative they are the vector or matrix of their
numbers, as in plain Python.  Among themselves they are added, multiplied and divided number by
number.  Where NumPy rounds in ways of its own (sums, products of matrices, powers) and where arrays
share memory they are refused.
"""

from __future__ import annotations

import operator
from collections.abc import Iterator
from typing import Any

import numpy as np

from ...errors import NotCompilable
from ...formulas.classes.records import Record, fill, record
from ...formulas.numbers.bases import Operand
from ...formulas.of_numpy import by_components
from ...formulas.vectors import MANY, Mat, Vec, small
from ..changes.content_hashes import MADE
from .ir_numbers import Emitter, Num, kind_of

REMEDY = "write liemech.vec(...) for np.array([...]), liemech.mat(...) for one of two axes"
_BY_NUMBERS = (operator.add, operator.sub, operator.mul, operator.truediv, operator.neg, operator.pos)


@record
class Array(Record):
    """The numbers of an array, as a vector or matrix."""

    entries: Any

    def __iter__(self) -> Iterator[Any]:
        return map(array, self.entries)

    def __len__(self) -> int:
        return len(self.entries)

    def __getitem__(self, index: Any) -> Any:
        return array(self.entries[index])


MADE.add(Array)


def array(x: Any) -> Any:
    """The array of a vector or matrix; a number unchanged."""
    return fill(Array, {"entries": x}) if isinstance(x, (Vec, Mat)) else x


def vector(x: Any) -> Any:
    """The vector or matrix of an array, also in lists and tuples; anything else as it is."""
    if isinstance(x, Array):
        return x.entries
    return type(x)(map(vector, x)) if type(x) in (list, tuple) else x


def refuse(what: str) -> NotCompilable:
    return NotCompilable(f"{what} of an array with numbers of the run: {REMEDY}")


def made(emitter: Emitter, x: Any, options: dict[str, Any]) -> Array:
    """The array np.array(x) of a vector or matrix."""
    content = small(vector(x))
    numbers = [n for row in content for n in row] if isinstance(content, Mat) else content
    if not isinstance(content, (Vec, Mat)) or set(options) - {"dtype"} or options.get("dtype", float) is not float:
        raise NotCompilable(f"np.array of one number, or with options: {REMEDY}")
    objects = any(isinstance(n, Operand) for n in numbers)
    if any(isinstance(n, (Vec, Mat, Record, list, tuple)) for n in numbers) or (objects and options):
        raise refuse("three axes, or `dtype`")
    if not objects and (
        any(isinstance(n, Num) and n.mixed for n in numbers)
        or not any(kind_of(n) == "f" for n in _given(x))
        or any(kind_of(n) == "b" for n in _given(x))
    ):
        raise NotCompilable("np.array of integers or truth values of the run: write float(x)")
    emitter.meet_numpy()
    return array(content)


def _squared(x: Any, exponent: Any) -> bool:
    """Whether a power is x**2, which NumPy multiplies.  In an array of objects Python makes the powers."""
    return (
        isinstance(x, Array)
        and type(exponent) in (int, float)
        and exponent == 2
        and len({isinstance(n, Operand) for n in _given(x.entries)}) == 1
    )


def _given(x: Any) -> list[Any]:
    """The numbers of nested lists, in order."""
    nested = isinstance(x, (list, tuple, Mat, Array, np.ndarray))
    return [n for part in x for n in _given(part)] if nested else [x]


def computed(emitter: Emitter, op: Any, x: tuple[Any, ...]) -> Any:
    """An operator where an array with numbers of the run is among the operands; None if there is none."""
    if not any(isinstance(a, Array) for a in x):
        if not any(isinstance(a, np.ndarray) and a.ndim for a in x) or not any(isinstance(a, Num) for a in x):
            return None
        for a in x:
            if isinstance(a, np.ndarray) and (a.dtype != float or not 0 < a.ndim < 3 or a.size > MANY):
                raise NotCompilable(
                    f"an array of {a.dtype.name} with {a.ndim} axes beside a number of the run: make "
                    f"it a Vec or Mat, or one of floats of one or two axes, of at most {MANY}"
                )
    if any(isinstance(a, Operand) for a in x):
        return op(*map(vector, x))
    if op is operator.pow and _squared(*x):
        op, x = operator.mul, (x[0], x[0])
    if op not in _BY_NUMBERS:
        raise refuse(f"`{getattr(op, '__name__', op)}`")
    emitter.meet_numpy()
    return array(by_components(op, *[small(vector(a)) for a in x]))
