"""Differential equations on a Lie group, in body or in space velocities, autonomous or driven."""

from __future__ import annotations

from typing import Any, ClassVar, final

from ...errors import undefined
from ...formulas import Element, Vec, record
from ...formulas.numbers.bases import InMemory
from ...groups.lie_group import LieGroup
from ...groups.retractions import Retraction
from ..input_checks import as_field, large_members, members_of
from ..system import State, System, as_precise, lies_in_memory


@record
class GroupState(State):
    """A place on a group: the element `g`; for an ensemble one for each body."""

    g: Any


@record
class GroupEquation(System):
    """An equation on a Lie group, g' = g xi(t, g) or, with `side = "right"`, g' = xi(t, g) g.

    1. A subclass writes `velocity(t, g)`; for spatial velocities it sets `side = "right"`.
    2. It may name what stays constant (`constants`).

    Source: Iserles et al., Lie-group methods, Acta Numerica 9 (2000), section 2.2; Hairer, Lubich,
    Wanner, IV.8, equation (8.1).
    """

    group: LieGroup

    def velocity(self, t: float, g: Element) -> Vec:
        """The velocity xi(t, g) in the Lie algebra, (dim,).  g : an element."""
        raise undefined(self, "velocity")

    # ---------------------------------------------------------------- how it moves

    @final
    def rate(self, t: float, state: GroupState) -> Vec:
        """The velocity xi(t, g) at the state's element."""
        return self.velocity(t, state.g)

    @final
    def displaced(self, retraction: Retraction, state: GroupState, omega: Vec) -> GroupState:
        """g tau(omega), or tau(omega) g for spatial velocities."""
        omega = as_precise(omega, state.g)
        if self.side == "left":
            return GroupState(retraction.compose_tau(self.group, state.g, omega))
        return GroupState(retraction.tau_compose(self.group, omega, state.g))

    @final
    def moving(self, state: GroupState, xi: Vec) -> GroupState:
        """g xi, or xi g for spatial velocities, as matrices."""
        x = self.group.algebra.hat(xi)
        return GroupState(state.g @ x if self.side == "left" else x @ state.g)

    @final
    def variation(self, state: GroupState, omega: Vec) -> tuple[Any, Any]:
        """The displacement, beside what counts as large at g."""
        if isinstance(omega, InMemory):
            displacement: Any = omega
            return (displacement,), (0.0 * displacement + 1.0,)
        return omega, self.group.scale(state.g)

    @final
    def state(self, g: Any) -> GroupState:
        """A start for `integrate`: an element, or one for each body of an ensemble.

        Raises InvalidInput for wrong shapes, entries that are not finite, and a g that is not on
        the group.
        """
        elements, shape = (members_of(self.group, g, f"{type(self).__name__}.state: g"), self.group.element_shape)
        members = None if elements.shape == shape else len(elements)
        large = lies_in_memory(self.group)
        return self.vouched(large_members(GroupState(as_field(elements, shape, members, large)), large))


@record
class LinearGroupEquation(GroupEquation):
    """A linear equation on a Lie group, g' = g xi(t) or, with `side = "right"`, g' = xi(t) g: what
    Magnus methods solve.

    A subclass writes `drive(t)`, the velocity as a function of time alone.

    Source: Iserles et al., Lie-group methods, Acta Numerica 9 (2000), section 4.
    """

    linear: ClassVar[bool] = True

    def drive(self, t: float) -> Vec:
        """The velocity xi(t), (dim,), which a subclass writes."""
        raise undefined(self, "drive")

    @final
    def velocity(self, t: float, g: Element) -> Vec:
        """The velocity xi(t), wherever g is."""
        return self.drive(t)
