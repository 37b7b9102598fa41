"""Functions of floats that native code asks Python for: those of `math` and NumPy that are not the
C library's.

`math.hypot` and `np.exp` round in ways of their own, so native code calls the very functions that
plain Python calls.  That costs about a microsecond each time; the functions of `liemech.formulas`
are the C library's in both worlds and cost a fiftieth of it.
"""

from __future__ import annotations

import ctypes
import functools
import math
from collections.abc import Callable
from typing import Any

import numpy as np

_MATH = (
    "acosh asinh atanh cbrt erf erfc exp2 fmod gamma hypot lgamma log10 log2 nextafter remainder"
)
_NUMPY = (
    "sin cos tan arcsin arccos arctan arctan2 sinh cosh tanh arcsinh arccosh arctanh exp exp2 "
    "expm1 log log2 log10 log1p logaddexp power hypot cbrt square reciprocal sign floor ceil trunc "
    "rint maximum minimum fmax fmin fmod mod copysign heaviside deg2rad rad2deg"
)

FUNCTIONS: dict[Any, str] = {
    **{
        getattr(math, name): f"liemech_math_{name}" for name in _MATH.split() if hasattr(math, name)
    },
    **{getattr(np, name): f"liemech_numpy_{name}" for name in _NUMPY.split()},
}
"""The functions and their names in native code, one for each number of arguments."""


@functools.cache
def addresses() -> dict[str, int]:
    """Where native code finds them; with one and with two arguments."""
    found = {}
    for function, symbol in FUNCTIONS.items():
        for count in (1, 2):
            _kept.append(
                ctypes.CFUNCTYPE(ctypes.c_double, *[ctypes.c_double] * count)(_quiet(function))
            )
            found[f"{symbol}_{count}"] = ctypes.cast(_kept[-1], ctypes.c_void_p).value or 0
    return found


_kept: list[Any] = []  # the machine code that ctypes makes lives as long as these objects


def _quiet(function: Callable[..., Any]) -> Callable[..., float]:
    """The function; nan where it raises, which native code takes for a failure."""

    def value(*x: float) -> float:
        try:
            return float(function(*x))
        except (ArithmeticError, ValueError, TypeError):
            return math.nan

    return value
