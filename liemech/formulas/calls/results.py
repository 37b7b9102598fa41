"""Results of a formula for many rows, as arrays."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ...errors import InvalidType
from ..arrays import shown
from ..large import Large
from ..numbers.complex_numbers import Complex
from ..vectors import Mat, Vec


def none_of(results: Any) -> Any:
    """The results without their rows."""
    return tuple(map(none_of, results)) if isinstance(results, tuple) else results[:0]


def first_not_finite(results: Any) -> int | None:
    """The first row with an infinity or a nan."""
    if isinstance(results, tuple):
        rows = [i for part in results if (i := first_not_finite(part)) is not None]
        return min(rows) if rows else None
    finite = np.isfinite(results)
    return None if finite.all() else int(np.argmin(finite.reshape(len(results), -1).all(axis=1)))


def unflattened(results: Any, leading: tuple[int, ...]) -> Any:
    """The results with these leading axes in place of one; a single number unchanged."""
    if isinstance(results, tuple):
        return tuple([unflattened(part, leading) for part in results])
    array = results.reshape(leading + results.shape[1:])
    return array if array.ndim else array.item()


def reshaped_as_given(results: Any, space: Any) -> Any:
    """The results in the shape in which the arguments came."""
    if isinstance(results, tuple):
        return tuple([reshaped_as_given(part, space) for part in results])
    return space._out_of_rows(results) if isinstance(results, np.ndarray) else results


def _real(value: Any) -> Any:
    """A value of a formula: a power of a negative number, complex in Python, is no number here, as in native code."""
    if type(value) is complex:
        return math.nan
    if isinstance(value, Vec) and any(type(x) is complex for x in value):
        return Vec(*map(_real, value))
    if isinstance(value, Mat) and any(type(x) is complex for row in value.rows for x in row):
        return Mat(*map(_real, value.rows))
    return value


def _no_value(where: str, value: Any) -> str:
    if dataclasses.is_dataclass(type(value)):  # which formulas only can ask for
        return (
            f"{where} was given a NumPy array: the formula that it comes from gives one where a "
            "vector belongs; write liemech.vec(...) for np.array([...]), liemech.vec(*B) * x for B * x"
        )
    return f"{where} gave {shown(value)}; a formula gives numbers, vectors, matrices or tuples of these"


def stacked(results: Sequence[Any], where: str) -> Any:
    """The values of a formula as arrays, the batch axis first; tuples of values as tuples of arrays."""
    first = results[0]
    if isinstance(first, tuple) and not isinstance(first, Vec):
        return tuple(stacked(list(part), where) for part in zip(*results, strict=True))
    if all(isinstance(row, bool) for row in results):
        return np.array(results)
    results = [_real(row) for row in results]
    for row in results:
        if not isinstance(row, (float, int, Complex, Vec, Mat, Large, np.ndarray, np.number)):
            raise InvalidType(_no_value(where, row))
    try:
        return np.array(results, dtype=float)
    except ValueError:
        raise InvalidType(f"{_no_value(where, first)}, of one shape") from None
    except TypeError:  # complex entries among them
        return np.array(results, dtype=complex)
