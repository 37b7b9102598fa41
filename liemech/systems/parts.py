"""Parts of an energy or of a vector field, and those of them whose motion is known in closed form."""

from __future__ import annotations

from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InvalidInput, NotDefined, require, undefined
from ..formulas import Mat, Vec, derivative, gradient, jacobian, plain, record, vec, vectors
from ..formulas.classes.derived import derived_from
from ..formulas.numbers.anything import Anything, degree, indices_in, traced
from ..formulas.vectors import Vec as SmallVector
from ..groups.matrices.matrix_functions import phi1m
from ..groups.poisson_structure import PoissonStructure
from .hamiltonian import Hamiltonian
from .system import System

ROUNDING = 2.0**-44
"""A sum below this, relative to its terms, is zero up to rounding."""

LEAST = 3
"""A motion is recognised only if the part has a velocity at this many points or more."""


@record
class OfParts(System):
    """A system that moves by the sum of several `parts`, each of which has a motion of its own that
    may be known; abstract.  `Splitting` makes these motions in turn.

    parts : the parts.  quadratic : are they two, (T, V), with {V, {V, {V, T}}} = 0, as if T were of
    second degree in momenta?
    A subclass writes `in_turn` and `unknown_motion`.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., II.5 and III.5.
    """

    if TYPE_CHECKING:
        parts: tuple[Any, ...]
        quadratic: bool

    def in_turn(self, state: Any, turns: list[tuple[int, float]]) -> Any:
        """The state after the motions of parts, by number and time, one after the other."""
        raise undefined(self, "in_turn")

    def unknown_motion(self) -> str:
        """Why the motion of some part is not known; empty if all are."""
        raise undefined(self, "unknown_motion")


@record
class Part(Hamiltonian):
    """An energy whose motion is known: a part of another one, by which `Splitting` steps it.

    A subclass writes `energy(y)`, and `flow`.  Parts that are T(p), V(q), a function of one
    coordinate, or at most quadratic where the structure is constant, need no flow: they are
    Hamiltonians, and recognised by what their formulas do at all points.  A part that compares, as
    a wall does, says what it is: `StraightLineFlow(part)`, `FunctionOfCoordinate(part, i)`.
    """

    @derived_from("energy", "gradient")
    def flow(self, structure: PoissonStructure, y: Vec, t: float) -> Vec:
        """Where y is after the time t, if this part is all the energy.  structure : the Poisson
        structure.  y : (n,).
        """
        raise undefined(self, "flow")


@record
class SplitHamiltonian(Hamiltonian):
    """An energy that is the sum of parts, H = H_1 + H_2 + ..., whose motions are known one by one.

    parts : Hamiltonians; those with a motion of their own are `Part`s, the others are recognised
    where they can be.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.4.2.
    """

    parts: tuple[Hamiltonian, ...]

    def __post_init__(self) -> None:
        super().__post_init__()
        for part in self.parts:
            require("SplitHamiltonian: parts", part, Hamiltonian, "Hamiltonians, such as KineticEnergy(...)")
        if not self.parts:
            raise InvalidInput("SplitHamiltonian: parts is empty")

    def energy(self, mu: Vec) -> float:
        """H_1 + H_2 + ...  mu : (n,), a point."""
        return vectors.sum([part.energy(mu) for part in self.parts])

    def gradient(self, mu: Vec) -> Vec:
        """dH_1 + dH_2 + ...  mu : (n,), a point."""
        return vectors.sum([part.gradient(mu) for part in self.parts])


# ---------------------------------------------------------------- recognised ones


@record
class Recognised(Part):
    """A Hamiltonian whose motion was recognised; abstract.

    hamiltonian : the energy.
    """

    hamiltonian: Hamiltonian

    def energy(self, mu: Vec) -> float:
        """The energy of the Hamiltonian.  mu : (n,)."""
        return self.hamiltonian.energy(mu)

    def gradient(self, mu: Vec) -> Vec:
        """The gradient of the Hamiltonian.  mu : (n,)."""
        return self.hamiltonian.gradient(mu)


@record
class StraightLineFlow(Recognised):
    """An energy that moves every point along a straight line, at a constant velocity: T(p), V(q).

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., II.5.
    """

    def flow(self, structure: PoissonStructure, y: Vec, t: float) -> Vec:
        """y + t B(y) dH(y).  y : (n,)."""
        start = plain(y)
        return y + t * structure.sharp(start, self.hamiltonian.gradient(start))


@record
class FunctionOfCoordinate(Recognised):
    """An energy that depends on one coordinate, which it leaves where it is.

    index : the coordinate, from 0.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.4.2.
    """

    index: int

    def flow(self, structure: PoissonStructure, y: Vec, t: float) -> Vec:
        """The motion that the coordinate has as energy, for the time t dH/dy_index.  y : (n,)."""
        return structure.coordinate_flow(y, self.index, t * self.hamiltonian.gradient(plain(y))[self.index])


@record
class Affine(Recognised):
    """An energy whose velocity is an affine function of the point: quadratic ones where the
    structure is constant.

    rates : the matrix A of the velocity A y + c.
    """

    rates: Mat

    def flow(self, structure: PoissonStructure, y: Vec, t: float) -> Vec:
        """y + t phi_1(t A) (A y + c), phi_1(x) = (e^x - 1)/x.  y : (n,)."""
        start = plain(y)
        return y + phi1m(t * self.rates) @ (t * structure.sharp(start, self.hamiltonian.gradient(start)))


def recognised(structure: PoissonStructure, part: Hamiltonian) -> Part | str:
    """The part with its motion, or why none is known."""
    if isinstance(part, Part):
        return part

    def velocity(y: Any) -> Any:
        return structure.sharp(y, part.gradient(y))

    formulas, reason = traced(lambda y: (part.energy(y), velocity(y)), [1] * structure.dim)
    if reason:
        return (
            f"the motion of {part!r} is not known: its formula need not be the same at all points "
            f"({reason}). Say what it is, StraightLineFlow(part) or FunctionOfCoordinate(part, i), or derive it "
            "from Part and write `flow`"
        )
    try:
        points, error = where_defined(velocity, special_nowhere(structure.dim))
        if len(points) < LEAST:
            return f"{part!r} has a velocity at {len(points)} of the points where it was looked at, too few to know it; {error}"
        energy, speeds = formulas
        if straight(velocity, speeds, points):
            return StraightLineFlow(part)
        polynomial = max(map(degree, speeds)) < inf
        slopes = [np.array(gradient(lambda x: part.energy(x), y), dtype=float) for y in points]
        felt = np.flatnonzero(np.any(slopes, axis=0))
        if len(felt) == 1 and (len(indices_in(energy)) == 1 or polynomial):
            structure.coordinate_flow(points[0], int(felt[0]), 0.5)
            return FunctionOfCoordinate(part, int(felt[0]))
        rates = affine(velocity, speeds, points)
        if rates is not None:
            return Affine(part, rates)
    except NotDefined as missing:
        return f"{missing}, and so no motion of the energy {part!r} of one coordinate"
    except (ArithmeticError, ValueError, TypeError) as error:
        return f"{part!r} cannot be looked at: {error}"
    return (
        f"the motion of {part!r} is not known: it is no straight line, depends on more than one "
        "coordinate, and its velocity is not affine. Derive it from "
        "Part and write `flow`, or split it further"
    )


def second_degree(structure: PoissonStructure, T: Hamiltonian, V: Hamiltonian) -> bool:
    """Whether {V, {V, {V, T}}} = 0: then Runge-Kutta-Nystroem splittings are of their order.

    Told by the degree of T along the straight lines of V; of other polynomials at one to three
    points, to rounding.
    """

    def velocity(y: Any) -> Any:
        return structure.sharp(y, V.gradient(y))

    formulas, reason = traced(lambda y: (T.energy(y), velocity(y)), [1] * structure.dim)
    if reason:
        return False
    speeds = formulas[1]
    if _unmoved(speeds):  # T along a line of constant velocity
        along, _ = traced(lambda y: T.energy(y), [int(_moves(v)) for v in speeds])
        return degree(along) <= 2
    if max(map(degree, [formulas[0], *speeds])) == inf:
        return False

    def once(y: Any) -> Any:  # {T, V}, the slope of T along the motion of V
        return derivative(lambda x: T.energy(x), y, velocity(y))

    def twice(y: Any) -> Any:
        return derivative(once, y, velocity(y))

    def vanishes(y: Any) -> bool:
        # by far: terms need not be compared
        if abs(derivative(twice, y, velocity(y)) * once(y)) > 1e-8 * twice(y) ** 2:
            return False
        slopes = np.array(gradient(twice, y), dtype=float)
        terms = slopes * np.array(velocity(y), dtype=float)
        return bool(abs(terms.sum()) <= ROUNDING * np.abs(terms).sum())

    try:
        return all(vanishes(y) for y in special_nowhere(structure.dim)[: 3 if structure.dim <= 12 else 1])
    except (ArithmeticError, ValueError, TypeError):
        return False


def straight(velocity: Any, speeds: Any, points: list[Any]) -> bool:
    """Whether a velocity moves every point along a straight line.  speeds : what it makes of numbers
    without a value.
    """
    # what vanishes at some points of nothing special vanishes at all
    polynomial = max(map(degree, speeds)) < inf
    return (_unmoved(speeds) or polynomial) and all(_rests(velocity, y) for y in points)


def affine(velocity: Any, speeds: Any, points: list[Any]) -> np.ndarray | None:
    """The matrix A of a velocity A y + c; None if it is no such velocity.  The same arguments."""
    if max(map(degree, speeds)) == inf:
        return None
    rates = np.array(jacobian(velocity, points[0]), dtype=float)
    # as it is written, it may be of a degree that shows only in other units
    others = [] if max(map(degree, speeds)) <= 1 else where_defined(velocity, _far(len(points[0])))[0]
    return rates if _everywhere(rates, velocity, [*points[1:], *others]) else None


def _moves(speed: Any) -> bool:
    """Whether the component is not zero everywhere."""
    return isinstance(speed, Anything) or speed != 0.0


def _unmoved(speeds: Any) -> bool:
    """Whether speeds are made of coordinates alone that do not move."""
    moving = {i for i, v in enumerate(speeds) if _moves(v)}
    return all(moving.isdisjoint(indices_in(v)) for v in speeds)


def special_nowhere(n: int) -> list[Any]:
    """Generic points of R^n: three of size one in the first octant, then others of many sizes and signs."""
    rng = np.random.default_rng(7)
    drawn = [*rng.uniform(0.5, 1.0, size=(3, n))]
    for size in (3.0, 0.05, 10.0, 100.0, 1e4):
        x, signs = size * rng.uniform(0.5, 1.0, size=(2, n)), rng.choice([-1.0, 1.0], size=n)
        drawn += [x[0], signs * x[1], -signs * x[1]]
    return [SmallVector.of(y.tolist()) for y in drawn]


def _far(n: int) -> list[Any]:
    """Points with each coordinate in a unit of its own."""
    rng, shape = np.random.default_rng(10), (16, n)
    drawn = rng.choice([-1.0, 1.0], shape) * 10.0 ** rng.uniform(-40.0, 40.0, shape)
    return [SmallVector.of(y.tolist()) for y in drawn]


def where_defined(velocity: Any, points: list[Any]) -> tuple[list[Any], str]:
    """The points at which the velocity has a finite value and derivative, and why another one has none."""
    defined, why = [], "it is not finite elsewhere"
    for y in points:
        try:
            v = velocity(y)
            if np.isfinite([*v, *derivative(velocity, y, v)]).all():
                defined.append(y)
        except (ArithmeticError, ValueError, TypeError) as error:
            why = f"at {vec(*y)}: {error}"
    return defined, why


def _rests(velocity: Any, y: Any) -> bool:
    """Whether the velocity is constant along itself at y, to rounding, each component beside its own terms."""
    v = velocity(y)
    change = np.abs(np.array(derivative(velocity, y, v), dtype=float))
    if not change.any():
        return True
    terms = np.abs(np.array(jacobian(velocity, y), dtype=float)) @ np.abs(np.array(v, dtype=float))
    return bool((change <= ROUNDING * terms).all())


def _everywhere(rates: np.ndarray, velocity: Any, points: list[Any]) -> bool:
    """Whether this is the derivative of the velocity at all points.  Seen along a direction to which every
    column contributes alike.

    The columns are compared after the rows, for components have units of their own.  Columns of
    zeros must be zero.
    """
    sizes = np.abs(rates)
    rows = sizes.max(axis=1, keepdims=True)
    columns = (sizes / np.where(rows > 0.0, rows, 1.0)).max(axis=0)
    rng, felt = np.random.default_rng(9), columns > 0.0
    for y in points:
        weights = rng.uniform(0.5, 1.0, len(columns)) * rng.choice([-1.0, 1.0], len(columns))
        for direction in (np.where(felt, weights / np.where(felt, columns, 1.0), 0.0), np.where(felt, 0.0, weights)):
            slope = np.array(derivative(velocity, y, SmallVector.of(direction.tolist())), dtype=float)
            if not (np.abs(slope - rates @ direction) <= ROUNDING * (sizes @ np.abs(direction))).all():
                return False
    return True
