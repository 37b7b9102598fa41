"""Formulas that run as they stand: in plain Python on small vectors and symbols, and as native code.

A formula is a method of a record (a frozen dataclass) or a free function, written with the arithmetic of small vectors and the
elementary functions below.  The compiler inlines everything a driver calls, writes static loops out and emits one native
function, for one body or for many in SIMD lanes; all of them give the same bits as plain Python.
"""

from typing import TYPE_CHECKING, Any, TypeAlias

from .broadcasting import check_finite, real_array
from .complex_numbers import Complex
from .dual import Dual, derivative, gradient, jacobian
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
from .pytree import plain
from .records import Record, record
from .vectors import (
    cross,
    diagonal,
    dot,
    horner,
    identity_matrix,
    mat,
    norm,
    outer,
    solve,
    solve3,
    transpose,
    vec,
)

if TYPE_CHECKING:  # formulas are dynamically typed: floats, symbols and arrays pass through the same source
    Vec: TypeAlias = Any
    Mat: TypeAlias = Any
    Element: TypeAlias = Any
    Ambient: TypeAlias = Any
else:
    from .annotations import Ambient, Element
    from .vectors import Mat, Vec

__all__ = [
    "Ambient",
    "Complex",
    "Dual",
    "Element",
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
    "derivative",
    "diagonal",
    "dot",
    "exp",
    "expm1",
    "gradient",
    "horner",
    "identity_matrix",
    "jacobian",
    "log",
    "log1p",
    "mat",
    "norm",
    "outer",
    "plain",
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
