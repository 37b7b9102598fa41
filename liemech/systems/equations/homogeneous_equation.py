"""Differential equations on a space that a group moves: spheres, orbits, vector spaces."""

from __future__ import annotations

from typing import Any, ClassVar, final

import numpy as np

from ...errors import InvalidInput, undefined
from ...formulas import Vec, record, vec
from ...formulas.numbers.bases import InMemory
from ...groups.actions import GroupAction
from ...groups.lie_group import LieGroup
from ...groups.retractions import Retraction
from ..input_checks import as_field, large_members, points
from ..system import State, System, as_precise, lies_in_memory


@record
class Point(State):
    """A point `x` of a space; for an ensemble one for each member."""

    x: Any


@record
class HomogeneousEquation(System):
    """An equation on a space moved by a group, x' = A(t, x) . x, the velocity of x under the
    velocity A in the Lie algebra.

    The solution stays on the orbit of its start, and so does every method.

    1. A subclass writes `velocity(t, x)`, the A of the equation.
    2. It may name what stays constant (`constants`).

    action : how the group moves the points, such as SphereAction(3); the points are vectors.

    Source: Munthe-Kaas, Appl. Numer. Math. 29 (1999), section 2; Hairer, Lubich, Wanner, IV.8,
    equation (8.1).
    """

    side: ClassVar[str] = "right"
    action: GroupAction

    @property
    def group(self) -> LieGroup:
        """The group that moves the points."""
        return self.action.group

    def velocity(self, t: float, x: Vec) -> Vec:
        """The velocity A(t, x) in the Lie algebra, (dim,).  x : a point."""
        raise undefined(self, "velocity")

    # ---------------------------------------------------------------- how it moves

    @final
    def rate(self, t: float, state: Point) -> Vec:
        """The velocity A(t, x) at the state's point."""
        return self.velocity(t, state.x)

    @final
    def displaced(self, retraction: Retraction, state: Point, omega: Vec) -> Point:
        """The point tau(omega) . x, moved by the action."""
        omega = as_precise(omega, state.x)
        return Point(retraction.tau_act(self.action, omega, state.x))

    @final
    def moving(self, state: Point, xi: Vec) -> Point:
        return Point(self.action.infinitesimal(xi, state.x))

    @final
    def variation(self, state: Point, omega: Vec) -> tuple[Any, Any]:
        """The change of x by omega, beside |x|."""
        if isinstance(omega, InMemory):
            return (self.action.infinitesimal(omega, state.x),), (abs(state.x),)
        return self.action.infinitesimal(omega, state.x), vec(*[abs(a) for a in state.x])

    @final
    def state(self, x: Any) -> Point:
        """A start for `integrate`: a point, (n,), or one for each member of an ensemble, (members,
        n).

        Raises InvalidInput for wrong shapes, entries that are not finite, and a point that is not
        on the space.
        """
        name, shape = f"{type(self).__name__}.state: x", self.action.point_shape
        array = points(x, name, np.shape(x)[-1:] if shape is None else shape, f"a point of {self.action!r}")
        point_shape = array.shape[array.ndim - len(shape) :] if shape is not None else array.shape[-1:]
        outside = np.flatnonzero(~np.atleast_1d(self.action.contains(array)))
        if len(outside):
            label, bad = (name, array) if array.shape == point_shape else (f"{name}[{outside[0]}]", array[outside[0]])
            try:
                how = f"it is off by {self.action.defect(bad):.1e}"
            except InvalidInput:  # so far off that no float says it
                how = f"got {bad!r}"
            raise InvalidInput(f"{label} is no point of {self.action!r}: {how}")
        members, large = None if array.shape == point_shape else len(array), lies_in_memory(self.group)
        return self.vouched(large_members(Point(as_field(array, point_shape, members, large)), large))

    def _shape(self, argument: str, kind: str) -> tuple[int, ...] | None:
        return self.action._shape(argument, kind)
