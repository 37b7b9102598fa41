"""NumPy's functions of vectors, matrices and numbers that carry more: the formulas of the same
meaning, in both worlds.

`np.sin(x)` of a number that carries a derivative is `liemech.formulas.sin(x)`, of a vector the
vector of the sines; `np.cross(a, b)` of vectors is `liemech.cross(a, b)`.  What has no formula
here, and what meets an array of more axes than vectors and matrices have (samples of a run),
NumPy computes, as of arrays.

Source: NumPy Enhancement Proposals 13 (ufuncs) and 18 (array functions).
"""

from __future__ import annotations

import functools
import operator
from collections.abc import Callable
from typing import Any

import numpy as np

from ..errors import InvalidType
from . import functions
from .complex_numbers import Complex
from .elimination import determinant, inverse, solve
from .numbers import OF_NUMPY, Operand
from .pytree import plain
from .vectors import Mat, Vec, are_samples, cross, norm, outer, small, sum, transpose

LARGE = 2.0**500


def square(x: Any) -> Any:
    """x x."""
    return x * x


def maximum(x: Any, y: Any) -> Any:
    """The larger number; nan if one is nan."""
    return functions.where(x < y, y, functions.where(y != y, y, x))


def minimum(x: Any, y: Any) -> Any:
    """The smaller number; nan if one is nan."""
    return functions.where(y < x, y, functions.where(y != y, y, x))


def clip(x: Any, least: Any, most: Any) -> Any:
    """x, or the bound that it is beyond; None is no bound."""
    x = x if least is None else maximum(x, least)
    return x if most is None else minimum(x, most)


def sign(x: Any) -> Any:
    """1, -1, or 0 for 0; nan for nan."""
    return functions.where(
        x > 0.0, 1.0, functions.where(x < 0.0, -1.0, functions.where(x != x, x, 0.0))
    )


def hypot(x: Any, y: Any) -> Any:
    """sqrt(x^2 + y^2), of whatever size: no square overflows, and none is lost."""
    size = plain(maximum(abs(x), abs(y)))
    unit = functions.where(size > LARGE, LARGE, functions.where(size < 1.0 / LARGE, 1.0 / LARGE, 1.0))
    x, y = x / unit, y / unit
    return unit * functions.sqrt(x * x + y * y)


OPERATORS: dict[Any, Callable[..., Any]] = {
    np.add: operator.add, np.subtract: operator.sub, np.multiply: operator.mul, np.negative: operator.neg,
    np.absolute: operator.abs,
}  # fmt: skip
"""Of numbers, vectors and matrices, with the errors of these."""

COMPARISONS: dict[Any, Callable[..., Any]] = {
    np.less: operator.lt, np.less_equal: operator.le, np.greater: operator.gt, np.greater_equal: operator.ge,
    np.equal: operator.eq, np.not_equal: operator.ne,
}  # fmt: skip
"""Of numbers only: NumPy compares vectors, component by component."""

BY_COMPONENTS: dict[Any, Callable[..., Any]] = {
    np.divide: operator.truediv, np.power: operator.pow, np.floor_divide: operator.floordiv,
    np.remainder: operator.mod, np.positive: operator.pos,
    np.sqrt: functions.sqrt, np.cbrt: functions.cbrt, np.square: square, np.fabs: functions.fabs,
    np.sin: functions.sin, np.cos: functions.cos, np.tan: functions.tan,
    np.arcsin: functions.asin, np.arccos: functions.acos, np.arctan: functions.atan, np.arctan2: functions.atan2,
    np.sinh: functions.sinh, np.cosh: functions.cosh, np.tanh: functions.tanh,
    np.arcsinh: functions.asinh, np.arccosh: functions.acosh, np.arctanh: functions.atanh,
    np.exp: functions.exp, np.exp2: functions.exp2, np.expm1: functions.expm1,
    np.log: functions.log, np.log2: functions.log2, np.log10: functions.log10, np.log1p: functions.log1p,
    np.maximum: maximum, np.minimum: minimum, np.clip: clip, np.sign: sign,
    np.hypot: hypot, np.copysign: functions.copysign,
    np.radians: functions.radians, np.deg2rad: functions.radians, np.degrees: functions.degrees, np.rad2deg: functions.degrees,
}  # fmt: skip

OF_VECTORS: dict[Any, tuple[Callable[..., Any], tuple[Any, ...]]] = {
    np.matmul: (operator.matmul, ((Vec, Mat), (Vec, Mat))),
    np.dot: (operator.matmul, ((Vec, Mat), (Vec, Mat))),
    np.inner: (operator.matmul, (Vec, Vec)),
    np.cross: (cross, (Vec, Vec)),
    np.outer: (outer, (Vec, Vec)),
    np.sum: (sum, (Vec,)),
    np.transpose: (transpose, (Mat,)),
    np.linalg.norm: (norm, (Vec,)),
    np.linalg.solve: (solve, (Mat, (Vec, Mat))),
    np.linalg.inv: (inverse, (Mat,)),
    np.linalg.det: (determinant, (Mat,)),
}
"""Functions of vectors and matrices, and of which."""


def formula_of(function: Any, x: tuple[Any, ...]) -> tuple[Callable[..., Any], list[Any]] | None:
    """The formula of the same meaning as NumPy's function of x, and x as it takes them; None if
    there is none.
    """
    axes = max(map(_axes, x))
    formula, kinds = OF_VECTORS.get(function, (None, ()))
    most = max((_most(kind) for kind in kinds), default=axes)
    if any(are_samples(a, most) for a in x):
        return None
    operands = [_number(a) if isinstance(a, _OF_NUMPY) and a.ndim == 0 else small(a) for a in x]
    if formula is not None:
        fits = len(x) == len(kinds) and all(map(isinstance, operands, kinds))
        return (formula, operands) if fits else None
    if function in BY_COMPONENTS:
        formula = BY_COMPONENTS[function]
        operands = [float(a) if type(a) is int and function is not np.power else a for a in operands]
        return functools.partial(by_components, formula) if axes else formula, operands
    found = OPERATORS.get(function) or (None if axes else COMPARISONS.get(function))
    return found and (found, operands)


def by_components(formula: Callable[..., Any], *x: Any) -> Any:
    """A function of numbers, of the components of vectors and the entries of matrices.  Raises
    InvalidType if they have different lengths.
    """
    whole = max(x, key=_axes)
    if not _axes(whole):
        return formula(*x)
    if len({len(a) for a in x if _axes(a) == _axes(whole)}) > 1:
        shapes = " and ".join(str(a.shape) for a in x if isinstance(a, (Vec, Mat)))
        raise InvalidType(f"vectors or matrices of shapes {shapes} cannot be combined")
    columns = ([*a] if _axes(a) == _axes(whole) else [a] * len(whole) for a in x)
    return type(whole)(*(by_components(formula, *row) for row in zip(*columns, strict=True)))


def _most(kind: Any) -> int:
    """The axes that an array in the place of such an operand may have."""
    return max(k.axes for k in kind) if isinstance(kind, tuple) else kind.axes


_OF_NUMPY = (np.ndarray, np.generic)


def _number(x: Any) -> Any:
    """A number of NumPy's as Python's, a complex one as of formulas."""
    if isinstance(x.item(), (complex, np.complexfloating)):
        return Complex(float(x.real), float(x.imag))
    return float(x) if isinstance(x.item(), (float, np.floating)) else x.item()


def _axes(x: Any) -> int:
    return x.axes if isinstance(x, Operand) else 0


for _function in (*OPERATORS, *COMPARISONS, *BY_COMPONENTS, *OF_VECTORS):
    OF_NUMPY[_function] = functools.partial(formula_of, _function)
