"""Formulas that run as they stand: in plain Python on small vectors and symbols, and as native
code.

A formula is a method of a record (a frozen dataclass) or a free function, written with the
arithmetic of small vectors and the elementary functions below.  The compiler inlines everything a
driver calls, writes static loops out and emits one native function, for one body or for many in
SIMD lanes; all of them give the same bits as plain Python.

Folders: `numbers/` are what a formula may meet in place of floats (derivatives, series, more digits), `classes/` records
and how they lie in memory (`layouts`), `calls/` methods called with arrays.  `sites.py` has the words of
many sites, `columns.py` their values by name, `large.py` what is too large to be written out; `of_math.py` and
`of_numpy.py` say which formula stands for a function of `math` or NumPy.
"""

from typing import TYPE_CHECKING, Any, TypeAlias

from . import of_numpy  # noqa: F401 (NumPy's functions become formulas)
from .arrays import check_finite, real_array
from .classes.records import Record, record
from .derivatives import derivative, gradient, jacobian
from .elimination import determinant, inverse, solve, solve3
from .functions import (
    acos,
    acosh,
    asin,
    asinh,
    atan,
    atan2,
    atanh,
    cbrt,
    copysign,
    cos,
    cosh,
    degrees,
    exp,
    exp2,
    expm1,
    fabs,
    hypot,
    log,
    log1p,
    log2,
    log10,
    pow,
    radians,
    sin,
    sinh,
    sqrt,
    tan,
    tanh,
    where,
)
from .numbers.complex_numbers import Complex
from .numbers.conversions import plain
from .numbers.dual import Dual, constant
from .removable import (
    atan_over,
    coshm1_over,
    expm1_over,
    log1p_over,
    segment_over,
    sinc,
    sinh_over,
    stumpff,
    versine_over,
)
from .vectors import cross, diagonal, dot, horner, identity_matrix, mat, norm, outer, sum, transpose, vec

# formulas are dynamically typed: floats, symbols and arrays pass through the same source
if TYPE_CHECKING:
    Vec: TypeAlias = Any
    Mat: TypeAlias = Any
    Element: TypeAlias = Any
    Ambient: TypeAlias = Any
else:
    from .classes.annotations import Ambient, Element
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
    "acosh",
    "asin",
    "asinh",
    "atan",
    "atan2",
    "atan_over",
    "atanh",
    "cbrt",
    "check_finite",
    "constant",
    "copysign",
    "cos",
    "cosh",
    "coshm1_over",
    "cross",
    "degrees",
    "derivative",
    "determinant",
    "diagonal",
    "dot",
    "exp",
    "exp2",
    "expm1",
    "expm1_over",
    "fabs",
    "gradient",
    "horner",
    "hypot",
    "identity_matrix",
    "inverse",
    "jacobian",
    "log",
    "log10",
    "log1p",
    "log1p_over",
    "log2",
    "mat",
    "norm",
    "outer",
    "plain",
    "pow",
    "radians",
    "real_array",
    "record",
    "segment_over",
    "sin",
    "sinc",
    "sinh",
    "sinh_over",
    "solve",
    "solve3",
    "sqrt",
    "stumpff",
    "sum",
    "tan",
    "tanh",
    "transpose",
    "vec",
    "versine_over",
    "where",
]
