"""Elementary functions that accept a float, an array, a symbol, and (by the compiler) a number in native code.

On floats they are those of the C library, as in compiled code, so both worlds give the same bits.
Outside their domain they return nan or an infinity, as IEEE 754 asks and as compiled code does, where `math` would raise.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

RULES: dict[str, Callable[..., Any]] = {}
"""What the elementary functions do to numbers that carry a derivative; filled by `dual`."""


def _elementary(name: str, numpy_name: str | None = None) -> Callable[..., Any]:
    on_float = getattr(math, name)
    on_array = getattr(np, numpy_name or name)

    def function(*x: Any) -> Any:
        if any(isinstance(a, np.ndarray) for a in x):
            return on_array(*x)
        try:
            return on_float(*x)
        except (ValueError, OverflowError):
            with np.errstate(all="ignore"):
                return float(on_array(*map(float, x)))
        except TypeError:
            if any(hasattr(a, "slope") for a in x):
                return RULES[name](*x)
            for a in x:
                if hasattr(a, "elementary"):
                    return a.elementary(name, *x)
            import sympy

            return getattr(sympy, name)(*x)

    function.__name__ = function.__qualname__ = name
    function.__doc__ = f"{name} of a float, an array, a symbol or a number in native code."
    return function


sqrt = _elementary("sqrt")
sin = _elementary("sin")
cos = _elementary("cos")
tan = _elementary("tan")
asin = _elementary("asin", "arcsin")
acos = _elementary("acos", "arccos")
atan = _elementary("atan", "arctan")
atan2 = _elementary("atan2", "arctan2")
sinh = _elementary("sinh")
cosh = _elementary("cosh")
tanh = _elementary("tanh")
exp = _elementary("exp")
log = _elementary("log")
expm1 = _elementary("expm1")
log1p = _elementary("log1p")

LIBM = (sin, cos, tan, asin, acos, atan, atan2, sinh, cosh, tanh, exp, log, expm1, log1p)
"""What compiled code calls in the C library; `sqrt` is an instruction."""


def where(condition: Any, yes: Any, no: Any) -> Any:
    """`yes` where the condition holds, `no` elsewhere: the branch that costs no branch."""
    if isinstance(condition, bool):
        return yes if condition else no
    if isinstance(condition, (np.ndarray, np.bool_)):
        return np.where(condition, yes, no)
    import sympy

    return sympy.Piecewise((yes, condition), (no, True))
