"""Bases of the numbers of formulas: stand-ins for a float, numbers made of two, numbers compared
by a value, whole powers.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ...errors import InvalidInput

INTEGER_POWER = 64
"""Up to here powers with an int as exponent are products, which are fast and exist where the logarithm does not."""

AN_INT = "an int as exponent that is known only at run time (products would be made of one known before)"


class StandIn:
    """Base of what takes the place of a number whose value is not known yet: the compiler's numbers."""

    __slots__ = ()

    @property
    def is_integer(self) -> bool:
        """Whether the number takes the place of an int."""
        return False

    @property
    def is_truth(self) -> bool:
        """Whether the number takes the place of a bool."""
        return False

    def settled(self, what: str) -> Any:
        """The number, which is a float on every way to this place."""
        return self

    def fails(self) -> None:
        """Let the attempt fail, where Python raises, if this truth value holds."""

    def elementary(self, name: str, *x: Any) -> Any:
        """The elementary function of this name, of numbers of which one is `self`."""
        raise NotImplementedError

    def beside(self, numbers: Sequence[Any]) -> Any:
        """Numbers, `self` among them, as one number whose sums and products are those of each, and
        whose `apart()` are the numbers; None if they cannot lie side by side.
        """
        return None


def is_number(value: Any) -> bool:
    """A float, or the compiler's stand-in for a number (ints and bools inside values are static)."""
    return isinstance(value, (float, StandIn))


def is_any_number(value: Any) -> bool:
    """A number of any kind: what may differ between the branches of a formula."""
    return isinstance(value, (bool, int, float, StandIn))


def of_an_int(x: Any) -> Any:
    """A stand-in for an int as one for a float; anything else as it is."""
    integer: Any = x if isinstance(x, StandIn) and x.is_integer else None
    return x if integer is None else 1.0 * integer


OF_NUMPY: dict[Any, Callable[..., Any]] = {}
"""NumPy's functions, and what finds the formula of the same meaning; filled by `of_numpy`."""


class Operand:
    """Operands that NumPy's functions leave to formulas: vectors, of one axis, matrices, of two,
    and numbers that carry more.
    """

    __slots__ = ()
    axes = 0

    def __array_ufunc__(self, function: Any, method: str, *x: Any, **options: Any) -> Any:
        if method == "__call__":
            return self.__array_function__(function, (), x, options)
        return getattr(function, method)(*_arrays(x), **_arrays(options))

    def __array_function__(self, function: Any, types: Any, x: Any, options: Any) -> Any:
        match = OF_NUMPY[function](x, options) if function in OF_NUMPY else None
        if match is None:
            return function(*_arrays(x), **_arrays(options))
        formula, operands, keywords = match
        return formula(*operands, **keywords)


class InMemory(Operand):
    """Vectors and matrices that are too large to be written out."""

    __slots__ = ()

    def inner_with(self, other: Any) -> Any:
        """The scalar product with another vector or matrix."""
        raise NotImplementedError

    def each(self, linear: Callable[[Any], Any]) -> Any:
        """The image under a linear map of what is made of such vectors or matrices."""
        raise NotImplementedError

    @property
    def T(self) -> Any:
        """The transpose A^T; a vector stays as it is."""
        raise NotImplementedError

    @property
    def H(self) -> Any:
        """The conjugate transpose A^H; a vector stays as it is."""
        raise NotImplementedError

    def plus(self, s: float) -> Any:
        """The sum A + s 1, of a square matrix."""
        raise NotImplementedError

    def over(self, a: Any) -> Any:
        """The quotient B A^-1, where `a` is a square matrix."""
        raise NotImplementedError

    def determinant(self) -> Any:
        """The determinant det A of a square matrix."""
        raise NotImplementedError


def _arrays(x: Any) -> Any:
    """Arrays instead of vectors and matrices, and of one object instead of a number that carries more."""
    if isinstance(x, Operand):
        array = np.asarray(x) if x.axes else np.empty((), dtype=object)
        if not x.axes:
            array[()] = x
        return array
    if type(x) in (list, tuple):
        return type(x)(map(_arrays, x))
    return {name: _arrays(value) for name, value in x.items()} if type(x) is dict else x


class CarriesMore(TypeError):
    """A number that carries more than a double was to become one."""

    def __init__(self, kind: str) -> None:
        super().__init__(
            f"{kind} cannot become a float: fill a list, not np.zeros(...), and take functions from "
            "liemech.formulas (sin, exp, sqrt, ...), not from math; of a function that is not there, "
            "write the gradient or force yourself"
        )


class Pair(Operand):
    """A number made of two, its `parts`, as they lie in memory.  Of two kinds the one of the higher
    level holds the other.
    """

    __slots__ = ()
    level: Any
    parts: Any

    @property
    def form(self) -> tuple[Any, ...]:
        """The class, and what it takes beside the parts to make such a number."""
        return (type(self),)


class ByValue(Pair):
    """A number with a `value`; what else it carries plays no part in comparisons, and none in whole numbers: between
    jumps their derivative is zero.
    """

    __slots__ = ()
    value: Any

    def __lt__(self, other: Any) -> Any:
        return _value(self) < _value(other)

    def __le__(self, other: Any) -> Any:
        return _value(self) <= _value(other)

    def __gt__(self, other: Any) -> Any:
        return _value(self) > _value(other)

    def __ge__(self, other: Any) -> Any:
        return _value(self) >= _value(other)

    def __eq__(self, other: object) -> Any:
        return _value(self) == _value(other)

    def __ne__(self, other: object) -> Any:
        return _value(self) != _value(other)

    def __bool__(self) -> bool:
        return bool(self.value)

    def __pos__(self) -> ByValue:
        return self

    def __divmod__(self, other: Any) -> Any:
        return self // other, self % other

    def __rdivmod__(self, other: Any) -> Any:
        return other // self, other % self

    def __floor__(self) -> Any:
        return math.floor(self.value)

    def __ceil__(self) -> Any:
        return math.ceil(self.value)

    def __trunc__(self) -> Any:
        return math.trunc(self.value)

    def __round__(self, *digits: int) -> Any:
        return round(self.value, *digits)

    def __int__(self) -> Any:
        return math.trunc(self)

    __hash__ = None  # type: ignore[assignment]


def _value(x: Any) -> Any:
    return _value(x.value) if isinstance(x, ByValue) else x


def raise_if(condition: Any, message: str) -> None:
    """Raise InvalidInput if a condition holds, which may be known only at run time."""
    if isinstance(condition, StandIn):
        condition.fails()
    elif isinstance(condition, (bool, np.bool_)) and condition:
        raise InvalidInput(message)


ONLY_THERE = (
    "`==` or `!=` of {}: they are equal here and not beside, so the branch "
    "for this one point knows a value and no slope. Of what is 0/0 there take sinc, expm1_over, "
    "log1p_over, ... from liemech.formulas; where both branches have the same slope compare "
    "liemech.formulas.constant(x)"
)
"""Why an equality that holds is refused."""


def whole_power(x: Any, n: int) -> Any:
    """x^n by squares and products, n = 1, 2, ..."""
    if n == 1:
        return x
    half = whole_power(x, n // 2)
    return half * half * x if n % 2 else half * half
