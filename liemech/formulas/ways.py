"""Numbers at many points at once, whose comparisons are answered in all ways, one after the other.

A formula without comparisons is one expression, so that an identity which it has at a point by chance it has
everywhere.  With comparisons it is one on every way through its branches, and all of these are gone, wherever
the points are.

Source: Schwartz, J. ACM 27 (1980) (identities tested at points by chance).
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from . import functions
from .numbers import CarriesMore, Operand, StandIn
from .vectors import vec

MOST = 64
"""Of more ways nothing is told, or of so many comparisons on one."""

APART = 1e-9
"""Two numbers that should be equal and differ by more than this, relative to their terms, are two."""


class Undecided(TypeError):
    """A formula asked for more than can be answered in all ways."""


class Ways:
    """The ways through the branches of formulas.

    of_moving : may there be comparisons of numbers that move?
    """

    def __init__(self, of_moving: bool) -> None:
        self.of_moving = of_moving
        self._answers: list[bool] = []
        self._asked: list[tuple[str, np.ndarray]] = []

    def all(self) -> Iterator[None]:
        """One way after the other; on each, what is asked again is answered as before."""
        for _ in range(MOST):
            self._asked = []
            yield
            while self._answers and not self._answers[-1]:
                self._answers.pop()
            if not self._answers:
                return
            self._answers[-1] = False
        raise Undecided("a formula has too many branches")

    @property
    def branch(self) -> bool:
        """Was anything asked on this way?"""
        return bool(self._asked)

    def answer(self, kind: str, x: Number) -> bool:
        """Is x positive, or, of the other kind, zero?"""
        if not np.any(x.at):
            return kind == "zero"
        if x.moves and not self.of_moving:
            raise Undecided("a formula compares numbers that move")
        for (other, seen), answer in zip(self._asked, self._answers):
            size = APART * (np.abs(seen) + np.abs(x.at))
            if other == kind and bool((np.abs(seen - x.at) <= size).all()):
                return answer
            if other == kind and bool((np.abs(seen + x.at) <= size).all()):
                return answer if kind == "zero" else not answer
        if len(self._asked) == len(self._answers):
            if len(self._asked) == MOST:
                raise Undecided("a formula has too many branches")
            self._answers.append(True)
        self._asked.append((kind, x.at))
        return self._answers[len(self._asked) - 1]


def values_of(x: Any) -> Any:
    """The values of a number at the points."""
    return x.at if isinstance(x, Number) else x


def _operation(of_values: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    def operation(self: Number, other: Any) -> Any:
        if not isinstance(other, (Number, int, float, np.number)):
            return NotImplemented
        return self.made(of_values(self.at, values_of(other)), other)

    return operation


def _undecided(self: Number, *others: Any) -> Any:
    raise Undecided("a formula rounds a number")


class Number(Operand, StandIn):
    """A number at many points.

    at : its values, (points,).  ways : the ways through branches.  moves : is it a part of a state, or made of one?
    """

    __slots__ = ("at", "moves", "ways")

    def __init__(self, at: np.ndarray, ways: Ways, moves: bool) -> None:
        self.at, self.ways, self.moves = at, ways, moves

    def made(self, at: np.ndarray, *others: Any) -> Number:
        """A number that is made of this one and others."""
        return Number(at, self.ways, self.moves or any(isinstance(x, Number) and x.moves for x in others))

    __add__ = __radd__ = _operation(operator.add)
    __mul__ = __rmul__ = _operation(operator.mul)
    __sub__, __rsub__ = _operation(operator.sub), _operation(lambda x, y: y - x)
    __truediv__, __rtruediv__ = _operation(operator.truediv), _operation(lambda x, y: y / x)
    __pow__, __rpow__ = _operation(operator.pow), _operation(lambda x, y: np.power(float(y), x))

    def __neg__(self) -> Number:
        return self.made(-self.at)

    def __pos__(self) -> Number:
        return self

    def elementary(self, name: str, *x: Any) -> Any:
        """The function of this name."""
        if name == "copysign":
            return abs(x[0]) if x[1] > 0.0 else -abs(x[0])
        values = [values_of(y) for y in x]
        found = values[0] * values[1] + values[2] if name == "fma" else getattr(functions, name)(*values)
        return self.made(found, *x)

    def __gt__(self, other: Any) -> bool:
        return self.ways.answer("positive", self - other)

    def __lt__(self, other: Any) -> bool:
        return self.ways.answer("positive", other - self)

    def __ge__(self, other: Any) -> bool:
        return not self.__lt__(other)

    def __le__(self, other: Any) -> bool:
        return not self.__gt__(other)

    def __eq__(self, other: object) -> bool:
        return self.ways.answer("zero", self - other)

    def __ne__(self, other: object) -> bool:
        return not self.__eq__(other)

    def __bool__(self) -> bool:
        return self != 0.0

    def __abs__(self) -> Number:
        return self if self > 0.0 else -self

    def __float__(self) -> float:
        raise CarriesMore("a number at many points")

    __mod__ = __rmod__ = __floordiv__ = __rfloordiv__ = __divmod__ = __rdivmod__ = _undecided
    __int__ = __index__ = __round__ = __floor__ = __ceil__ = __trunc__ = _undecided
    __hash__ = None  # type: ignore[assignment]


class AnyFunction:
    """In place of a table: some function of a number, or, of so many components, a vector.

    rng : where its values come from.
    """

    def __init__(self, size: int, rng: np.random.Generator) -> None:
        self.size, self.rng = size, rng
        self._known: list[tuple[np.ndarray, Any]] = []

    def __call__(self, x: Any) -> Any:
        """Its value, equal for equal arguments."""
        at = np.asarray(values_of(x))
        for seen, value in self._known:
            if bool((np.abs(seen - at) <= APART * (np.abs(seen) + np.abs(at))).all()):
                return value
        if not isinstance(x, Number) or (x.moves and not x.ways.of_moving):
            raise Undecided("a table of a number that moves")
        found = [x.made(self.rng.normal(size=at.shape)) for _ in range(max(self.size, 1))]
        value = vec(*found) if self.size else found[0]
        self._known.append((at, value))
        return value
