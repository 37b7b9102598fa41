"""Elementary functions that accept a float, an array, a symbol, and (by the compiler) a number in
native code.

On floats they are those of the C library, as in compiled code, so both worlds give the same bits.
Of a compensated number they are those of its value, without what rounding took from it; of one of
two doubles they have 32 digits.

Outside their domain they return nan or an infinity, as IEEE 754 asks and as compiled code does,
where `math` would raise.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from .numbers.bases import ByValue, StandIn

LOG_2, LOG_10 = math.log(2.0), math.log(10.0)
DEGREE, RADIAN = math.pi / 180.0, 180.0 / math.pi

RULES: dict[str, Callable[..., Any]] = {}
"""The elementary functions of numbers that carry a derivative; filled by `dual`."""

DOUBLE_DOUBLE: dict[str, Callable[..., Any]] = {}
"""The elementary functions of numbers of two doubles; filled by `double_double`."""


OF_MATH: dict[Any, Callable[..., Any]] = {}
OF_ARRAYS: dict[Any, Callable[..., Any]] = {}
"""Functions of Python's `math`, and of NumPy, and those here of the same meaning."""


def _elementary(name: str, numpy_name: str | None = None) -> Callable[..., Any]:
    on_float = getattr(math, name)
    on_array = getattr(np, numpy_name or name)

    def function(*x: Any) -> Any:
        for a in x:
            if isinstance(a, (StandIn, ByValue, np.ndarray)):
                break
        else:
            try:
                return on_float(*x)
            except (ValueError, OverflowError):
                with np.errstate(all="ignore"):
                    return float(on_array(*map(float, x)))
            except TypeError:
                pass
        return _of_others(name, on_array, x)

    function.__name__ = function.__qualname__ = name
    function.__doc__ = f"{name} of a float, an array, a symbol or a number in native code."
    OF_MATH[on_float] = OF_ARRAYS[on_array] = function
    return function


def _of_others(name: str, on_array: Callable[..., Any], x: tuple[Any, ...]) -> Any:
    """The function of what is no float: numbers that carry a derivative before others, for these
    may be their values.
    """
    if any(isinstance(a, np.ndarray) for a in x):
        return on_array(*x)
    if any(hasattr(a, "slope") for a in x):
        return RULES[name](*x)
    if any(hasattr(a, "low") for a in x):
        return DOUBLE_DOUBLE[name](*x)
    if any(hasattr(a, "rest") for a in x):
        return globals()[name](*map(_remembering_nothing, x))
    for a in x:
        if hasattr(a, "elementary"):
            return a.elementary(name, *x)
    if any(hasattr(a, "free_symbols") for a in x):
        import sympy

        return SYMBOLIC[name](*x) if name in SYMBOLIC else getattr(sympy, name)(*x)
    kinds = " and ".join(type(a).__name__ for a in x)
    raise TypeError(f"{name} is a function of numbers; got {kinds} (of a vector: of its components, one by one)")


def _remembering_nothing(x: Any) -> Any:
    """A number without what rounding took from it."""
    return x.value if hasattr(x, "rest") else x


sqrt = _elementary("sqrt")
cbrt = _elementary("cbrt")
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
asinh = _elementary("asinh", "arcsinh")
acosh = _elementary("acosh", "arccosh")
atanh = _elementary("atanh", "arctanh")
exp = _elementary("exp")
exp2 = _elementary("exp2")
log = _elementary("log")
log2 = _elementary("log2")
log10 = _elementary("log10")
expm1 = _elementary("expm1")
log1p = _elementary("log1p")

copysign = _elementary("copysign")
pow = _elementary("pow", "power")


def fma(x: Any, y: Any, z: Any) -> Any:
    """x y + z, rounded once."""
    x, y, z = map(_remembering_nothing, (x, y, z))
    for a in (x, y, z):
        if isinstance(a, StandIn):
            return a.elementary("fma", x, y, z)
    if _FMA is not None:
        try:
            return _FMA(x, y, z)
        except (ValueError, OverflowError):
            return x * y + z
    if not (math.isfinite(x) and math.isfinite(y) and math.isfinite(z)):
        return x * y + z
    (a, b), (c, d), (e, g) = x.as_integer_ratio(), y.as_integer_ratio(), z.as_integer_ratio()
    exact = a * c * g + e * b * d
    try:
        return exact / (b * d * g) if exact else x * y + z
    except OverflowError:
        return x * y + z


_FMA = getattr(math, "fma", None)  # from Python 3.13 on

LIBM = (
    cbrt, sin, cos, tan, asin, acos, atan, atan2, sinh, cosh, tanh, asinh, acosh, atanh, exp, exp2, log, log2, log10, expm1, log1p,
    pow,
)  # fmt: skip
"""Functions that compiled code calls in the C library."""

INSTRUCTIONS = "sqrt", "copysign"
"""Functions that are instructions of the processor."""

SYMBOLIC: dict[str, Callable[..., Any]] = {
    "pow": lambda x, n: x**n,
    "exp2": lambda x: 2**x,
    "log2": lambda x: _sympy("log")(x, 2),
    "log10": lambda x: _sympy("log")(x, 10),
    "expm1": lambda x: _sympy("exp")(x) - 1,
    "log1p": lambda x: _sympy("log")(1 + x),
    "copysign": lambda x, y: _sympy("Abs")(x) * _sympy("sign")(y),
}
"""Functions that SymPy calls by other names."""


def _sympy(name: str) -> Any:
    import sympy

    return getattr(sympy, name)


# ------------------------------------------------------------------ formulas


def fabs(x: Any) -> Any:
    """The absolute value |x|, as a float."""
    return abs(1.0 * x)


def radians(x: Any) -> Any:
    """An angle in degrees, x pi/180."""
    return x * DEGREE


def degrees(x: Any) -> Any:
    """An angle in radians, in degrees: 180 x/pi."""
    return x * RADIAN


def hypot(*x: Any) -> Any:
    """sqrt(x_1^2 + x_2^2 + ...), from left to right.  That of `math` differs in the last bit at times."""
    square = x[0] * x[0]
    for a in x[1:]:
        square = square + a * a
    return sqrt(square)


def where(condition: Any, yes: Any, no: Any) -> Any:
    """`yes` where the condition holds, `no` elsewhere: the branch that costs no branch."""
    if isinstance(condition, bool):
        return yes if condition else no
    if isinstance(condition, np.ndarray):
        return np.where(condition, yes, no)
    if hasattr(condition, "free_symbols"):
        return _sympy("Piecewise")((yes, condition), (no, True))
    if getattr(condition, "axes", 0):
        raise TypeError(f"where: one condition; got a {type(condition).__name__}")
    return yes if condition else no
