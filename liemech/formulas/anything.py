"""A number without a value: a formula that works with it does the same at every point, for it cannot ask."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from .numbers import StandIn
from .vectors import Vec


class Asked(TypeError):
    """A formula asked for a value, or for a sign."""


def _any(self: Anything, *others: Any) -> Any:
    """The result of any operation; numbers that carry a derivative, vectors and complex numbers know better."""
    for x in others:
        if isinstance(x, (tuple, list)) or hasattr(x, "slope") or hasattr(x, "rows") or hasattr(x, "parts"):
            return NotImplemented
    return self


def _asked(self: Anything, *others: Any) -> Any:
    raise Asked("it depends on a comparison, a sign or a rounding")


class Anything(StandIn):
    """Some number, nobody knows which."""

    __slots__ = ()
    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __truediv__ = __rtruediv__ = __pow__ = __rpow__ = _any
    __neg__ = __pos__ = _any
    __lt__ = __le__ = __gt__ = __ge__ = __bool__ = __abs__ = _asked
    __mod__ = __rmod__ = __floordiv__ = __rfloordiv__ = __divmod__ = __rdivmod__ = _asked
    __int__ = __float__ = __index__ = __round__ = __floor__ = __ceil__ = __trunc__ = _asked
    __eq__ = __ne__ = _asked
    __hash__ = None  # type: ignore[assignment]

    def elementary(self, name: str, *x: Any) -> Any:
        """The same, except of `copysign`, which looks at a sign."""
        return _asked(self) if name == "copysign" else self


def choice(formula: Callable[[Vec], Any], n: int) -> str:
    """Why a formula of n numbers may do one thing at one point and another thing at another; empty if it cannot."""
    try:
        formula(Vec(*[Anything()] * n))
    except (ArithmeticError, AttributeError, ValueError, TypeError) as refusal:
        return str(refusal)
    return ""
