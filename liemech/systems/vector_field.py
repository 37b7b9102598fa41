"""Vector fields in R^n: equations y' = f(y), their Lie derivatives, and sums of fields whose motions
are known one by one.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar, final

import numpy as np

from ..errors import InvalidInput, InvalidType, NotDefined, require, undefined
from ..formulas import Mat, Vec, derivative, plain, record, vec, vectors
from ..formulas.classes.derived import derived_from
from ..formulas.classes.remembered import shared_property
from ..formulas.numbers.anything import traced
from ..formulas.vectors import Vec as SmallVec
from ..formulas.vectors import small
from ..groups.matrices.matrix_functions import phi1m
from ..groups.matrices.matrix_group import whole_number
from ..groups.poisson_structure import require_formula
from ..groups.retractions import Retraction
from ..groups.vector_space import VectorSpace
from .input_checks import as_field, points
from .parts import LEAST, OfParts, affine, special_nowhere, straight, where_defined
from .system import State, System


@record
class PoissonState(State):
    """Where a vector field is, such as that of a Poisson system: a point `y`, (n,) or, for an
    ensemble, (members, n).
    """

    y: Any


@record
class MotionOfPoints(System):
    """A motion of points y of R^n, which the group R^n moves under addition; abstract.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., I.1.
    """

    coordinates: ClassVar[tuple[str, ...]] = ("y",)

    @property
    def dim(self) -> int:
        """The dimension n of the points y."""
        raise NotDefined(f"{type(self).__name__} must say its dimension, dim: ClassVar[int] = 3")

    @shared_property
    def group(self) -> VectorSpace:
        """The group of displacements, R^n under addition."""
        return VectorSpace(self.dim)

    @final
    def displaced(self, retraction: Retraction, state: PoissonState, omega: Vec) -> PoissonState:
        """The state at the point y + omega."""
        return PoissonState(retraction.compose_tau(self.group, state.y, omega))

    @final
    def variation(self, state: PoissonState, omega: Vec) -> tuple[Vec, Vec]:
        """The displacement and the sizes |y| that it is compared with."""
        return omega, vec(*[abs(x) for x in state.y])

    # ---------------------------------------------------------------- checked input

    @final
    def state(self, y: Any) -> PoissonState:
        """A start for `integrate`: a point y, (n,), or (members, n) for an ensemble.

        Raises InvalidInput for wrong shapes, entries that are not finite, and points at which the
        system is not defined.
        """
        where, shape = f"{type(self).__name__}.state", (self.dim,)
        array = points(y, f"{where}: y", shape, f"a point of {self!r}")
        self._check_formulas(array)
        self._require(array, where)
        return self.vouched(PoissonState(as_field(array, shape, None if array.shape == shape else len(array))))

    def _check_formulas(self, y: np.ndarray) -> None:
        """Raise InvalidInput for formulas that do not fit the points.  y : (n,), or (members, n)."""

    def _require_vector(self, given: str, formula: Callable[[], Any]) -> None:
        """Raise InvalidType, InvalidInput unless a formula gives a vector of n numbers."""
        name = f"{type(self).__name__}.{given.partition('(')[0]}"
        try:
            value = formula()
        except (ArithmeticError, ValueError):  # no value there: the run will tell
            return
        except TypeError as error:
            raise InvalidType(f"{name} cannot be evaluated: {error}. It is {given}") from error
        if not isinstance(value, SmallVec) or len(value) != self.dim:
            raise InvalidInput(
                f"{name} returns {value!r}; {given} must return a vector of {self.dim} numbers: lm.vec(...)"
            )

    def _require(self, y: np.ndarray, where: str) -> None:
        """Raise InvalidInput for points outside of where the system is defined; a subclass knows."""

    @final
    def _shape(self, argument: str, kind: str) -> tuple[int, ...] | None:
        return (self.dim,) if kind == "Vec" else None


@record
class VectorField(MotionOfPoints):
    """An equation in R^n, y' = f(y).

    1. A subclass writes `velocity(y)`, f, as a formula, and says the dimension `dim`, n.  Its
    fields are the parameters.
    2. It may write `flow(y, t)`, the motion in closed form: then it can be a part of a SplitField.
    3. It may name what stays constant (`constants`).

    The group that moves y is R^n under addition, so that RKMK is the Runge-Kutta method of its
    tableau, Taylor the Taylor method.  `check_poisson_field` asks whether f is locally the field of
    an energy.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., III.5.1.
    """

    alternatives: ClassVar[str] = (
        "Splitting(order=4) is for a SplitField of parts whose motion is known, RKMK accepts every system"
    )

    # ---------------------------------------------------------------- 1. a subclass writes

    def velocity(self, y: Vec) -> Vec:
        """f(y), (n,).  y : (n,)."""
        raise undefined(self, "velocity")

    # ---------------------------------------------------------------- 2. closed forms are welcome

    @derived_from("velocity")
    def flow(self, y: Vec, t: float) -> Vec:
        """Where y is after the time t.  y : (n,)."""
        raise undefined(self, "flow")

    # ---------------------------------------------------------------- what follows

    @final
    def lie_derivative(self, F: Callable[[Any], Any], times: int = 1) -> Callable[[Any], Any]:
        """The rate of change of F along the motion, D F(y) = sum f_j dF/dy_j, or D D F, ...: a
        formula of y.

        F : from y, (n,), to a number or a vector.  times : how often.
        Source: Hairer, Lubich, Wanner, III.5.1; the slides, (2.2).
        """
        require_formula("lie_derivative", "F", F)
        for _ in range(whole_number("lie_derivative", times, 1)):
            F = self._derived(F)
        return F

    def _derived(self, F: Callable[[Any], Any]) -> Callable[[Any], Any]:
        def derived_at(y: Any) -> Any:
            at = vec(*y)
            return derivative(F, at, self.velocity(at))

        return derived_at

    # ---------------------------------------------------------------- how it moves

    @final
    def rate(self, t: float, state: PoissonState) -> Vec:
        return self.velocity(state.y)

    def _check_formulas(self, y: np.ndarray) -> None:
        """Whether `velocity` is a vector of n numbers.  y : (n,), or (members, n)."""
        at = small(np.atleast_2d(y)[0])
        self._require_vector("velocity(self, y)", lambda: self.velocity(at))


# ---------------------------------------------------------------- sums of fields


@record
class SplitField(OfParts, VectorField):
    """An equation y' = f_1(y) + f_2(y) + ..., the sum of fields whose motions are known one by one.

    parts : VectorFields of one dimension.  Those that write their `flow` have it; of the others
    straight lines, f_i constant along its own motion, and affine fields A y + c are recognised by
    what their formulas do at all points.
    `Splitting` makes the motions in turn, MultipleTimeSteps those of fast parts more often.

    Raises InvalidType, InvalidInput for parts that are no fields or of several dimensions.
    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., II.5 and III.5; the
    slides, (2.1).
    """

    quadratic: ClassVar[bool] = False  # type: ignore[misc]

    parts: tuple[VectorField, ...]

    def __post_init__(self) -> None:
        parts: Any = self.parts
        parts = tuple(parts) if isinstance(parts, list) else parts
        name = type(self).__name__
        if not isinstance(parts, tuple) or not parts:
            raise InvalidType(f"{name}: parts must be a tuple of VectorFields; got {parts!r}")
        for part in parts:
            require(f"{name}: parts", part, VectorField, "VectorFields")
        if len({part.dim for part in parts}) > 1:
            raise InvalidInput(
                f"{name}: the parts are of dimensions {[part.dim for part in parts]}; they must be of one"
            )
        recognised = [recognised_field(part) for part in parts]
        object.__setattr__(self, "parts", tuple([p if isinstance(f, str) else f for p, f in zip(parts, recognised)]))
        super().__post_init__()

    @property
    def dim(self) -> int:
        return self.parts[0].dim

    def velocity(self, y: Vec) -> Vec:
        """f_1 + f_2 + ...  y : (n,)."""
        return vectors.sum([part.velocity(y) for part in self.parts])

    def _check_formulas(self, y: np.ndarray) -> None:
        """Whether the velocities and the motions of the parts are vectors of n numbers too."""
        at = small(np.atleast_2d(y)[0])
        for part in self.parts:
            part._check_formulas(y)
            if has_flow(part):
                part._require_vector("flow(self, y, t)", lambda part=part: part.flow(at, 0.0))  # type: ignore[misc]

    @final
    def in_turn(self, state: PoissonState, turns: list[tuple[int, float]]) -> PoissonState:
        y = state.y
        for number, t in turns:
            part = self.parts[number]
            y = part.flow(y if isinstance(part, RecognisedField) else plain(y), t)
        return PoissonState(y)

    @final
    def unknown_motion(self) -> str:
        for part in self.parts:
            if not has_flow(part):
                return str(recognised_field(part))
        return ""


@record
class RecognisedField(VectorField):
    """A field whose motion was recognised; abstract.

    field : the field.
    """

    field: VectorField

    @property
    def dim(self) -> int:
        return self.field.dim

    def velocity(self, y: Vec) -> Vec:
        """The velocity of the field.  y : (n,)."""
        return self.field.velocity(y)


@record
class StraightField(RecognisedField):
    """A field that is constant along its own motion."""

    def flow(self, y: Vec, t: float) -> Vec:
        """y + t f(y).  y : (n,)."""
        return y + t * self.field.velocity(plain(y))


@record
class AffineField(RecognisedField):
    """A field A y + c.

    rates : the matrix A.
    """

    rates: Mat

    def flow(self, y: Vec, t: float) -> Vec:
        """y + t phi_1(t A) (A y + c), phi_1(x) = (e^x - 1)/x.  y : (n,)."""
        return y + phi1m(t * self.rates) @ (t * self.field.velocity(plain(y)))


def has_flow(field: VectorField) -> bool:
    """Whether the class of the field writes its motion, `flow`."""
    return type(field).flow is not VectorField.flow


def recognised_field(field: VectorField) -> VectorField | str:
    """The field with its motion, or why none is known."""
    if has_flow(field):
        return field
    speeds, reason = traced(field.velocity, [1] * field.dim)
    if reason:
        return (
            f"the motion of {field!r} is not known: its formula need not be the same at all points "
            f"({reason}). Write its `flow`"
        )
    try:
        where, error = where_defined(field.velocity, special_nowhere(field.dim))
        if len(where) < LEAST:
            return f"{field!r} has a velocity at {len(where)} of the points where it was looked at, too few to know it; {error}"
        if straight(field.velocity, speeds, where):
            return StraightField(field=field)
        rates = affine(field.velocity, speeds, where)
        if rates is not None:
            return AffineField(field=field, rates=rates)
    except (ArithmeticError, ValueError, TypeError) as refusal:
        return f"{field!r} cannot be looked at: {refusal}"
    return (
        f"the motion of {field!r} is not known: it is no straight line, and the field is not "
        "affine. Write its `flow`, or split it further"
    )
