"""Derivatives of formulas, which may themselves take derivatives: of each, the numbers on the move
have a level of their own.

    f(x + e d) = f(x) + e f'(x) d,   e^2 = 0

Source: Griewank and Walther, Evaluating Derivatives, 2nd ed., chapter 3; Siskind and Pearlmutter,
Perturbation confusion and referential transparency, IFL 2005 (why the e of two derivatives must
differ).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..errors import InvalidType
from .classes.records import Record, fields_of, fill
from .numbers.bases import InMemory, Pair, StandIn
from .numbers.complex_numbers import Complex
from .numbers.dual import ALONE, DEPTH, Dual, value_of
from .of_math import run
from .vectors import Mat, Vec, mat, transpose, vec


def derivative(formula: Callable[[Any], Any], x: Any, direction: Any = 1.0) -> Any:
    """f'(x) d: the derivative of a formula of a vector, a number or a matrix, along a direction of
    the same shape.

    The formula may return a number, a vector, a matrix, a record, or a tuple of these.  Its
    branches are those it takes at x. |x| has the slope 1 at zero, x^0 the slope 0.  Raises
    InvalidType if the shapes of x and the direction differ.
    """
    return tangent(formula, x, direction)[1]


def gradient(formula: Callable[[Any], Any], x: Any) -> Vec:
    """The vector df/dx_j of a formula from vectors to numbers.  x : (n,).  Raises InvalidType if it
    returns a vector (`jacobian`).
    """
    return gradient_to_add(formula, x, False)


def gradient_to_add(formula: Callable[[Any], Any], x: Any, signed: bool = True) -> Vec:
    """The gradient of a formula, to be added to something: components that are zero may be -0.0, which saves an addition
    for each.
    """
    slopes = [tangent(formula, x, unit, signed)[1] for unit in axes(x)]
    for slope in slopes:
        if isinstance(slope, (tuple, list, Mat)):
            raise InvalidType("gradient: of a formula that returns a number; of a vector: jacobian")
    return vec(*slopes)


def jacobian(formula: Callable[[Any], Any], x: Any) -> Mat:
    """The matrix df_i/dx_j of a formula from vectors to vectors.  x : (n,).

    In a formula of one of many sites x is that of this site, and the other sites rest.
    """
    slopes = [tangent(formula, x, unit, False, True)[1] for unit in axes(x)]
    return transpose(mat(*slopes))


def tangent(
    formula: Callable[[Any], Any], x: Any, direction: Any, signed: bool = False, alone: bool = False
) -> tuple[Any, Any]:
    """f(x) and f'(x) d.  Derivatives in the formula are one level deeper.  The compiler runs this function in Python.

    signed : slopes that are zero may be -0.0, which saves an addition for each number.
    alone : do the other sites rest, in a formula of a site?
    """
    level = DEPTH.get() + 1
    before, others = DEPTH.set(level), ALONE.set((*ALONE.get(), level) if alone else ALONE.get())
    try:
        result = run(formula, _moving(x, direction, level))
    finally:
        DEPTH.reset(before)
        ALONE.reset(others)
    return _split(result, level, signed)


BELOW = 0.5
"""A level below those of derivatives that formulas take, of numbers that carry one through whole steps."""


def carried(formula: Callable[[Any], Any], x: Any) -> tuple[Any, Any]:
    """f(x) and f'(x) of a formula that makes steps of all sites.  Derivatives in it are not one level deeper: sweeps over
    all sites do not see one around them.
    """
    return _split(run(formula, _moving(x, 1.0, BELOW)), BELOW, False)


def axes(x: Any) -> list[list[Any]]:
    """The unit vectors of the space of x; an integer 0 says that a component rests."""
    if isinstance(x, InMemory):
        raise InvalidType(f"derivatives by every component of {x!r} are not derived: write the gradient of the energy")
    if not isinstance(x, (Vec, tuple, list, np.ndarray)):
        raise InvalidType(f"x must be a vector; got {type(x).__name__} (of a number: `derivative(f, x)`)")
    return [[1.0 if i == j else 0 for i in range(len(x))] for j in range(len(x))]


def _moving(x: Any, direction: Any, level: float) -> Any:
    """The argument x + e d, e the unit of derivatives of this level."""
    if type(x) is float and (type(direction) is float or (type(direction) is int and not direction)):
        return Dual(x, direction, level)
    if (isinstance(x, np.ndarray) and x.ndim) or isinstance(x, (tuple, list, Mat)):
        if not isinstance(direction, (tuple, list, Mat, np.ndarray)) or len(direction) != len(x):
            size = f"{len(direction)} components" if hasattr(direction, "__len__") else f"{direction!r}"
            raise InvalidType(
                f"the direction of a derivative at a vector of {len(x)} components has as many; got {size}"
            )
        parts = [_moving(a, d, level) for a, d in zip(x, direction)]
        return mat(*parts) if parts and isinstance(parts[0], Vec) else vec(*parts)
    if isinstance(direction, (tuple, list, Mat, np.ndarray)):
        raise InvalidType(f"the direction of a derivative at a number is a number; got {direction!r}")
    if isinstance(x, (complex, Complex)) or isinstance(direction, (complex, Complex)):
        (a, b), (u, v) = _re_im(x), _re_im(direction)
        return Complex(_moving(a, u, level), _moving(b, v, level))
    return Dual(_float(x), direction if type(direction) is int and not direction else _float(direction), level)


def _re_im(x: Any) -> tuple[Any, Any]:
    return x.parts if isinstance(x, Complex) else (x.real, x.imag) if isinstance(x, complex) else (x, 0.0)


def _float(x: Any) -> Any:
    """Numbers of Python and NumPy as floats, others unchanged."""
    return float(x) if isinstance(x, (int, np.number)) else x


def _split(value: Any, level: float, signed: bool = False) -> tuple[Any, Any]:
    """The value of a number, a vector, ..., and its slope at this level; of None and texts the slope is they themselves."""
    if isinstance(value, Dual):
        if value.level == level:
            return value.value, _slope(value.slope, signed)
        if value.level < level:
            return value, 0.0
        parts = [_split(part, level, signed) for part in value.parts]  # one that a formula made by hand
        return tuple([Dual(a, b, value.level) for a, b in zip(*parts)])  # type: ignore[return-value]
    if isinstance(value, (int, float, Pair, np.number)) and not isinstance(value, Complex):
        return value, 0.0
    if isinstance(value, np.ndarray):
        rows = value.tolist()
        return _split(Mat.of(rows) if value.ndim == 2 else Vec.of(rows), level, signed)
    if isinstance(value, (tuple, list, Mat, Complex)):
        pairs = [_split(item, level, signed) for item in (value.parts if isinstance(value, Complex) else value)]
        a, b = zip(*pairs) if pairs else ((), ())
        return (type(value)(a), type(value)(b)) if type(value) in (tuple, list) else (type(value)(*a), type(value)(*b))
    if isinstance(value, Record):
        fields = fields_of(value)
        halves = {name: (x, x) if isinstance(x, int) else _split(x, level, signed) for name, x in fields.items()}
        return tuple([fill(type(value), {n: pair[i] for n, pair in halves.items()}) for i in (0, 1)])
    if value is None or isinstance(value, str):
        return value, value
    # run-time numbers, series, symbols
    if hasattr(value, "elementary") or hasattr(value, "free_symbols"):
        return value, 0.0
    raise InvalidType(
        f"a formula to be differentiated returns numbers, vectors, matrices or records; got {type(value).__name__}"
    )


def _slope(slope: Any, signed: bool) -> Any:
    """A slope; unless `signed`, -0.0 becomes 0.0, as it is for a number at rest."""
    if type(slope) is int:
        return 0.0
    if signed:
        return slope
    if type(slope) is float:
        return slope + 0.0
    return slope + 0.0 if isinstance(value_of(slope), (float, StandIn)) else slope
