"""Tests of identities of formulas at random points, on every way through their branches.

A formula without comparisons is one expression: an identity that holds at a random point holds everywhere.  One with
comparisons is an expression on every way through its branches.  All ways are taken in turn: by a comparison of known
numbers with the points where it has this outcome, by any other one with all points.

Floats lose small terms beside large ones.  Residues by a prime are exact, and elementary functions of them are hashes,
as if of any function: an identity of residues holds for all numbers, in all units.

Source: Schwartz, J. ACM 27 (1980) (identities tested at random points).
"""

from __future__ import annotations

import functools
import hashlib
import operator
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from .. import functions
from ..vectors import vec
from .bases import CarriesMore, Operand, StandIn

MOST = 64
"""The largest number of ways, and of comparisons on one way, for which a formula is tested."""

APART = 2.0**-40
"""Numbers that differ by more than this, relative to their terms, are not equal: rounding of some thousand operations,
so that what a motion loses by it is lost among the rounding of its parameters.
"""


PRIME = 2**127 - 1
"""The modulus of residues."""

KNOWN, ANY, MOVING = 0, 1, 2
"""What a number is made of, at most: parameters of known values, numbers that may have any value, the state."""


class Undecided(TypeError):
    """Raised for a formula that cannot be tested on all ways."""


class Ways:
    """The ways through the branches of formulas.

    of_moving : may there be comparisons of numbers that move?
    """

    def __init__(self, of_moving: bool) -> None:
        self.of_moving = of_moving
        self.points: Any = np.array(True)  # the mask of points that are on this way
        self.branch = False  # has a comparison been met whose outcome is not known?
        self._answers: list[bool] = []
        self._comparisons: list[tuple[str, Any]] = []

    def each(self) -> Iterator[None]:
        """Take the ways in turn; an equal comparison has one outcome on a way."""
        for _ in range(MOST):
            self._comparisons, self.points, self.branch = [], np.array(True), False
            yield
            while self._answers and not self._answers[-1]:
                self._answers.pop()
            if not self._answers:
                return
            self._answers[-1] = False
        raise Undecided("a formula has too many branches")

    def answer(self, kind: str, x: Number) -> bool:
        """Whether x > 0, for the kind "positive", or x = 0, for the kind "zero", on this way."""
        if x.moves == MOVING and not self.of_moving and np.any(x.at):
            raise Undecided("a formula compares numbers that move")
        if x.moves == KNOWN:
            holds = x.at > 0.0 if kind == "positive" else x.at == 0.0
            undecided = np.broadcast_arrays(self.points, holds)[0]
            if not (undecided & holds).any() or not (undecided & ~holds).any():
                return bool((undecided & holds).any())
            answer = self._new_answer(kind, x)
            self.points = undecided & (holds == answer)
            return answer
        if not np.any(x.at):
            return kind == "zero"
        for (other, compared), answer in zip(self._comparisons, self._answers):
            if other == kind and self.equal(compared, x.at):
                return answer
            opposite = other == kind and (kind == "zero" or answer or x.moves == MOVING)
            if opposite and self.equal(compared, -x.at):
                return answer if kind == "zero" else not answer
        self.branch = True
        return self._new_answer(kind, x)

    def equal(self, number: Any, other: Any) -> bool:
        """Whether numbers are equal, up to rounding, at all points of this way where they are finite."""
        return not ((np.abs(number - other) > APART * (np.abs(number) + np.abs(other))) & self.points).any()

    def _new_answer(self, kind: str, x: Number) -> bool:
        """The outcome, on this way, of a comparison not met before."""
        if len(self._comparisons) == len(self._answers):
            if len(self._comparisons) == MOST:
                raise Undecided("a formula has too many branches")
            self._answers.append(True)
        self._comparisons.append((kind, x.at))
        return self._answers[len(self._comparisons) - 1]


def values_of(x: Any) -> Any:
    """The values of a number at the points."""
    return x.at if isinstance(x, Number) else x


def _operation(of_values: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    def operation(self: Number, other: Any) -> Any:
        if not isinstance(other, (Number, int, float, np.number)):
            return NotImplemented
        return self.made_with(of_values(self.at, values_of(other)), other)

    return operation


def _undecided(self: Number, *others: Any) -> Any:
    raise Undecided("a formula rounds a number")


class Number(Operand, StandIn):
    """A number at many points.

    at : its values, or residues.  ways : the ways through branches.  moves : KNOWN, ANY or MOVING.
    """

    __slots__ = ("at", "moves", "ways")

    def __init__(self, at: np.ndarray, ways: Ways, moves: int) -> None:
        self.at, self.ways, self.moves = at, ways, moves

    def made_with(self, at: np.ndarray, *others: Any) -> Number:
        """The number with these values, computed from this one and others."""
        return Number(at, self.ways, max([self.moves, *[x.moves for x in others if isinstance(x, Number)]]))

    __add__ = __radd__ = _operation(operator.add)
    __mul__ = __rmul__ = _operation(operator.mul)
    __sub__, __rsub__ = _operation(operator.sub), _operation(lambda x, y: y - x)
    __truediv__, __rtruediv__ = _operation(operator.truediv), _operation(lambda x, y: y / x)
    __pow__, __rpow__ = _operation(operator.pow), _operation(lambda x, y: np.power(float(y), x))

    def __neg__(self) -> Number:
        return self.made_with(-self.at)

    def __pos__(self) -> Number:
        return self

    def elementary(self, name: str, *x: Any) -> Any:
        if name == "copysign":
            return abs(x[0]) if x[1] > 0.0 else -abs(x[0])
        values = [values_of(y) for y in x]
        image = values[0] * values[1] + values[2] if name == "fma" else getattr(functions, name)(*values)
        return self.made_with(image, *x)

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


class Residue:
    """A number modulo PRIME, an entry of arrays: sums, products and quotients are exact, functions are hashes."""

    def __init__(self, n: int) -> None:
        self.n = n % PRIME

    @staticmethod
    def from_number(x: Any) -> Residue:
        """The residue of a float; a residue as it is."""
        if isinstance(x, Residue):
            return x
        above, below = float(x).as_integer_ratio()
        return Residue(above * pow(below, -1, PRIME))

    def __add__(self, other: Any) -> Residue:
        return Residue(self.n + Residue.from_number(other).n)

    def __mul__(self, other: Any) -> Residue:
        return Residue(self.n * Residue.from_number(other).n)

    __radd__, __rmul__ = __add__, __mul__

    def __neg__(self) -> Residue:
        return Residue(-self.n)

    def __sub__(self, other: Any) -> Residue:
        return self + -Residue.from_number(other)

    def __rsub__(self, other: Any) -> Residue:
        return -self + other

    def __truediv__(self, other: Any) -> Residue:
        return Residue(self.n * pow(Residue.from_number(other).n, -1, PRIME))

    def __rtruediv__(self, other: Any) -> Residue:
        return Residue.from_number(other) / self

    def __pow__(self, other: Any) -> Residue:
        if not isinstance(other, Residue) and float(other).is_integer():
            return Residue(pow(self.n, int(other), PRIME))
        return self._any("pow", Residue.from_number(other).n)

    def __rpow__(self, other: Any) -> Residue:
        return Residue.from_number(other)._any("pow", self.n)

    def __abs__(self) -> float:
        """The size: 0 for zero, else 1."""
        return float(self.n != 0)

    def __bool__(self) -> bool:
        return self.n != 0

    def __getattr__(self, name: str) -> Callable[[], Residue]:
        if name.startswith("_") or not hasattr(functions, name):
            raise AttributeError(name)
        return functools.partial(self._any, name)

    def _any(self, name: str, *others: int) -> Residue:
        return Residue(int.from_bytes(hashlib.sha256(repr((name, self.n, *others)).encode()).digest(), "big"))


class AnyFunction:
    """Any function of a number, in place of a table.

    size : the components of its values; 0 for numbers.  random_number : makes one.
    """

    def __init__(self, size: int, random_number: Callable[[], Number]) -> None:
        self.size, self.random_number = size, random_number
        self._known: list[tuple[np.ndarray, Any]] = []

    def __call__(self, x: Any) -> Any:
        """The value of the function, equal for equal arguments."""
        if not isinstance(x, Number) or (x.moves == MOVING and not x.ways.of_moving):
            raise Undecided("a table of a number that moves")
        for argument, value in self._known:
            if x.ways.equal(argument, x.at):
                return value
        components = [y.made_with(y.at, x) for y in [self.random_number() for _ in range(max(self.size, 1))]]
        value = vec(*components) if self.size else components[0]
        self._known.append((x.at, value))
        return value
