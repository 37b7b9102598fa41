"""Arrays that users give: lists, NumPy's arrays, SciPy's rotations as arrays of doubles, or a
refusal that names the argument and shows its value.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InvalidInput, InvalidType
from .vectors import Vec, of_floats

Array = NDArray[np.float64]


def real_array(value: Any, name: str, or_complex: bool = False) -> np.ndarray:
    """`value` as a float64 array, or a clear refusal: complex, object, string and ragged input is
    not guessed at.

    What has `as_matrix`, like SciPy's rotations, is asked for it.  With `or_complex` the array is
    complex128.
    """
    if isinstance(value, np.ma.MaskedArray) and np.ma.is_masked(value):
        raise InvalidInput(f"{name} has masked entries; fill or drop them first")
    if hasattr(value, "as_matrix") and not isinstance(value, type):
        value = value.as_matrix()
    try:
        array = np.asarray(value)
    except ValueError:
        raise InvalidInput(f"{name} is ragged: its rows have different lengths") from None
    if array.dtype is _DOUBLE and not or_complex:
        return array
    if array.dtype.kind not in ("iufc" if or_complex else "iuf"):
        kind = "complex" if or_complex else "real"
        raise InvalidType(f"{name} must be {kind} numbers; got dtype {array.dtype} from {shown(value)}")
    with np.errstate(over="ignore"):  # of long doubles; what becomes infinite is refused as that
        return array.astype(np.complex128 if or_complex else np.float64, copy=False)


_DOUBLE = np.dtype(float)


def at_a_glance(value: Any, shape: tuple[int, ...]) -> Any:
    """A list of numbers, or an array, as a `Vec` or `Mat` if it obviously has this shape and finite
    entries.

    None: it is something else, or something that only `real_array` and `check_finite` can judge.
    """
    kind = type(value)
    if kind is np.ndarray:
        return of_floats(value) if value.dtype is _DOUBLE and value.shape == shape and len(shape) in (1, 2) else None
    if kind not in _SEQUENCES or (len(value),) != shape:
        return None
    if not _FLOAT.issuperset(map(type, value)):
        whole = [x for x in value if type(x) is int]
        if not _REAL.issuperset(map(type, value)) or not -(2**53) < min(whole) <= max(whole) < 2**53:
            return None
        value = map(float, value)
    components = tuple.__new__(Vec, value)
    return components if all(map(math.isfinite, components)) else None


_SEQUENCES, _FLOAT, _REAL = (frozenset([list, tuple, Vec]), frozenset([float]), frozenset([float, int]))


def check_finite(array: np.ndarray, name: str, leading: tuple[int, ...] = ()) -> None:
    """Refuse an array with an infinity or a nan, saying where it is.

    leading : the indices of the array itself, if it is one of many.
    """
    finite = np.isfinite(array)
    if not finite.all():
        at = tuple(map(int, np.argwhere(~finite)[0]))
        raise InvalidInput(f"{name}{[*leading, *at] or ''} is {array[at]}; every entry must be finite")


def shown(value: Any) -> str:
    """A value for a message, cut where it is long."""
    try:
        text = " ".join(repr(value).split())
    except Exception:  # somebody else's __repr__
        text = f"a {type(value).__name__}"
    return text if len(text) <= 60 else text[:57] + "..."
