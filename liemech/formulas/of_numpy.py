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
from . import reductions as r
from .elimination import determinant, inverse, solve
from .numbers.bases import OF_NUMPY, Operand
from .numbers.complex_numbers import Complex
from .numbers.conversions import plain
from .reductions import larger, smaller
from .vectors import Mat, Vec, are_samples, cross, outer, small, transpose

LARGE = 2.0**500


def square(x: Any) -> Any:
    """The square, one product x x."""
    return x * x


def clip(x: Any, least: Any, most: Any) -> Any:
    """x, or the bound that it is beyond; None is no bound."""
    if least is None or most is None:
        return np.minimum(x, most) if least is None else np.maximum(x, least)
    above = functions.where(x < least, least, x)
    inside = functions.where(above > most, most, above)
    return functions.where(least != least, least, functions.where(most != most, most, inside))


def truncated_remainder(x: Any, y: Any) -> Any:
    """The remainder of x/y that has the sign of x."""
    remainder = abs(x) % abs(y)
    return functions.where(x < 0.0, -remainder, remainder)


def sign(x: Any) -> Any:
    """1, -1, or 0 for 0; nan for nan."""
    return functions.where(x > 0.0, 1.0, functions.where(x < 0.0, -1.0, functions.where(x != x, x, 0.0)))


def hypot(x: Any, y: Any) -> Any:
    """sqrt(x^2 + y^2), of whatever size: no square overflows, and none is lost."""
    size = plain(larger(abs(x), abs(y)))
    unit = functions.where(size > LARGE, LARGE, functions.where(size < 1.0 / LARGE, 1.0 / LARGE, 1.0))
    x, y = x / unit, y / unit
    return unit * functions.sqrt(x * x + y * y)


OPERATORS: dict[Any, Callable[..., Any]] = {
    np.add: operator.add, np.subtract: operator.sub, np.multiply: operator.mul, np.negative: operator.neg,
    np.absolute: operator.abs,
}  # fmt: skip
"""Operators of numbers, vectors and matrices, with the errors of these."""

COMPARISONS: dict[Any, Callable[..., Any]] = {
    np.less: operator.lt, np.less_equal: operator.le, np.greater: operator.gt, np.greater_equal: operator.ge,
    np.equal: operator.eq, np.not_equal: operator.ne,
}  # fmt: skip
"""Comparisons of numbers only: NumPy compares vectors, component by component."""

BY_COMPONENTS: dict[Any, Callable[..., Any]] = {
    **functions.OF_ARRAYS,
    np.divide: operator.truediv, np.power: operator.pow, np.floor_divide: operator.floordiv,
    np.remainder: operator.mod, np.fmod: truncated_remainder, np.positive: operator.pos, np.where: functions.where,
    np.square: square, np.fabs: functions.fabs, np.hypot: hypot,
    np.maximum: larger, np.minimum: smaller, np.clip: clip, np.sign: sign,
    np.radians: functions.radians, np.deg2rad: functions.radians, np.degrees: functions.degrees, np.rad2deg: functions.degrees,
}  # fmt: skip
"""Functions of numbers, and so of the components of vectors and the entries of matrices."""

_ANY, _SEVERAL = (Vec, Mat), (tuple, list)
AXIS: dict[str, Callable[..., Any]] = {
    "sum": r.total, "max": r.largest, "min": r.smallest, "mean": r.mean, "prod": r.product,
}  # fmt: skip
METHODS: dict[str, Callable[..., Any]] = {
    **AXIS, "trace": r.trace, "diagonal": r.diagonal_of, "copy": r.copy, "flatten": r.flat, "ravel": r.flat,
}  # fmt: skip
"""Methods of vectors and matrices that arrays have."""
OF_VECTORS: dict[Any, tuple[Callable[..., Any], tuple[Any, ...], tuple[str, ...]]] = {
    np.matmul: (operator.matmul, (_ANY, _ANY), ()),
    np.dot: (operator.matmul, (_ANY, _ANY), ()),
    np.inner: (operator.matmul, (Vec, Vec), ()),
    np.vdot: (operator.matmul, (Vec, Vec), ()),
    np.cross: (cross, (Vec, Vec), ()),
    np.outer: (outer, (Vec, Vec), ()),
    np.transpose: (transpose, (_ANY,), ()),
    np.linalg.solve: (solve, (Mat, _ANY), ()),
    np.linalg.inv: (inverse, (Mat,), ()),
    np.linalg.det: (determinant, (Mat,), ()),
    **{getattr(np, name): (formula, (_ANY,), ("axis",)) for name, formula in AXIS.items()},
    np.linalg.norm: (r.length, (_ANY,), ()),
    np.all: (r.every, (Vec,), ()),
    np.any: (r.some, (Vec,), ()),
    np.trace: (r.trace, (Mat,), ()),
    np.diag: (r.diagonal_matrix, (_ANY,), ()),
    np.diagonal: (r.diagonal_of, (Mat,), ()),
    np.copy: (r.copy, (_ANY,), ()),
    np.ravel: (r.flat, (_ANY,), ()),
    np.zeros_like: (r.zeros_like, (_ANY,), ()),
    np.ones_like: (r.ones_like, (_ANY,), ()),
    np.roll: (r.rolled, (Vec, int), ()),
    np.diff: (r.differences, (Vec,), ()),
    np.concatenate: (r.concatenated, (_SEVERAL,), ("axis",)),
    np.hstack: (r.beside, (_SEVERAL,), ()),
    np.vstack: (r.below, (_SEVERAL,), ()),
    np.stack: (r.stacked, (_SEVERAL,), ("axis",)),
    np.kron: (r.kronecker, (_ANY, _ANY), ()),
    np.tensordot: (r.contracted, (_ANY, _ANY), ("axes",)),
    np.einsum: (r.einsum, (str,), ()),
    np.interp: (r.interpolated, (object, _ANY, _ANY), ()),
    np.searchsorted: (r.place, (_ANY, object), ("side",)),
}
"""Functions of vectors and matrices, of which, and the options that the formula knows."""

OF_NUMBERS = {
    np.where: functions.where, np.clip: clip, np.interp: r.interpolated, np.searchsorted: r.place,
}  # fmt: skip
"""Functions of numbers for which native code has the formula alone: NumPy has none of floats with its bits."""


Found = tuple[Callable[..., Any], list[Any], dict[str, Any]]
"""A formula, and what it takes."""


def formula_of(function: Any, x: tuple[Any, ...], options: dict[str, Any]) -> Found | None:
    """The formula of the same meaning as NumPy's function of x, x as it takes them, and the
    options; None if there is none.
    """
    if function in OF_VECTORS:
        return _of_vectors(function, x, options)
    axes = max(map(_axes, x))
    if options or any(are_samples(a, axes) for a in x) or (function is np.where and len(x) < 3):
        return None
    operands = [_operand(a) for a in x]
    if function in BY_COMPONENTS:
        formula = BY_COMPONENTS[function]
        operands = [float(a) if type(a) is int and function is not np.power else a for a in operands]
        return functools.partial(by_components, formula) if axes else formula, operands, {}
    operator_ = OPERATORS.get(function) or (None if axes else COMPARISONS.get(function))
    return operator_ and (operator_, operands, {})


def _of_vectors(function: Any, x: tuple[Any, ...], options: dict[str, Any]) -> Found | None:
    formula, kinds, keywords = OF_VECTORS[function]
    most = len(kinds) + len(keywords) if function is not np.einsum else len(x)
    if not set(options) <= set(keywords) or len(x) > most or any(are_samples(a, 2) for a in inside(x)):
        return None
    operands = [
        [_operand(b) for b in a] if type(a) in _SEVERAL and kind is _SEVERAL else _operand(a)
        for a, kind in zip(x, (*kinds, *[object] * len(x)), strict=False)
    ]
    fits = len(x) >= len(kinds) and all(map(isinstance, operands, kinds))
    numbers = [a for a, kind in zip(operands, kinds, strict=False) if kind is object]
    return (formula, operands, options) if fits and not any(map(_axes, numbers)) else None


def inside(x: Any) -> list[Any]:
    """Operands, and those in lists among them."""
    return [b for a in x for b in (inside(a) if type(a) in _SEVERAL else [a])]


def _operand(x: Any) -> Any:
    """An array, a list or a number of NumPy's as a formula takes it."""
    return _number(x) if isinstance(x, _OF_NUMPY) and x.ndim == 0 else small(x)


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
    kind = Mat if _axes(whole) == 2 else Vec
    return kind(*(by_components(formula, *row) for row in zip(*columns, strict=True)))


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
for _name, _method in METHODS.items():
    for _kind in (Vec, Mat):
        if not hasattr(_kind, _name):
            setattr(_kind, _name, _method)
