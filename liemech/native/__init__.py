"""Formulas that run as they stand: in plain Python on small vectors and symbols, and as native code.

A formula is a method of a record (a frozen dataclass) or a free function, written with the arithmetic of small vectors and the
elementary functions below.  The compiler inlines everything a driver calls, writes static loops out and emits one native
function, for one body or for many in SIMD lanes; all of them give the same bits as plain Python.
"""

from typing import Any

from . import border
from .border import check_finite, real_array
from .functions import (
    acos,
    asin,
    atan,
    atan2,
    cos,
    cosh,
    exp,
    expm1,
    log,
    log1p,
    sin,
    sinh,
    sqrt,
    tan,
    tanh,
    where,
)
from .records import Record, record
from .vectors import (
    Mat,
    Vec,
    cross,
    diagonal,
    dot,
    identity_matrix,
    mat,
    norm,
    outer,
    solve,
    solve3,
    transpose,
    vec,
)

__all__ = [
    "Mat",
    "Record",
    "Vec",
    "acos",
    "asin",
    "atan",
    "atan2",
    "check_finite",
    "cos",
    "cosh",
    "cross",
    "diagonal",
    "dot",
    "exp",
    "expm1",
    "identity_matrix",
    "log",
    "log1p",
    "mat",
    "norm",
    "outer",
    "real_array",
    "record",
    "sin",
    "sinh",
    "solve",
    "solve3",
    "sqrt",
    "tan",
    "tanh",
    "transpose",
    "vec",
    "where",
]


def _evaluate_many(*arguments: Any) -> Any:
    from .batch import evaluate

    return evaluate(*arguments)


border.evaluate_many = _evaluate_many
