"""Conditions on where bodies are: joints, rods, fixed points, or any functions of a group element
that are to be zero.
"""

from __future__ import annotations

from typing import Any

from ...errors import NotDefined, undefined
from ...formulas import Element, Mat, Record, Vec, jacobian, record, vec
from ...formulas.classes.derived import derived, derived_from
from ...groups.composed.product import ProductGroup
from ...groups.lie_group import LieGroup

Rows = tuple[tuple[Vec, ...], ...]
"""The derivative G by rows: for each condition, a vector for each factor of the group that it
`touches`.
"""


@record
class Constraint(Record):
    """Holonomic conditions on a group, c(g) = 0, with independent derivatives.

    1. A subclass writes `value`, as a formula that returns m numbers.  Its fields are the
    parameters.
    2. It may write `jacobian` in closed form; left out, it follows by differentiation, exact to
    rounding.
    3. On a product of groups it may say which factors each condition depends on (`touches`), which
    saves work.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.1.
    """

    def value(self, g: Any) -> Vec:
        """c(g), (m,).  g : an element."""
        raise undefined(self, "value")

    @derived
    def jacobian(self, group: LieGroup, g: Element) -> Mat:
        """G(g), left-trivialised: G eta = d/ds c(g exp(s eta)) at s = 0.  g : an element.  Returns
        (m, dim).
        """
        return jacobian(lambda eta: self.value(group.compose_exp(g, eta)), vec(*[0.0 for _ in range(group.dim)]))

    def at_time(self, t: float) -> Any:
        """The conditions at time t: the same, unless they change with time."""
        return self

    def paces(self, g: Any) -> list[Any]:
        """dc/dt, (m,), of conditions that change with time."""
        raise undefined(self, "paces")

    @property
    def rheonomic(self) -> bool:
        """Whether the conditions change with time."""
        return self.at_time(1.0) is not self

    @property
    def yields(self) -> tuple[Any, ...]:
        """1/A of each condition whose rate gains lam/A by its multiplier; none by default."""
        return ()

    @derived_from("value", "matrix")
    def touches(self, group: LieGroup, conditions: int) -> tuple[tuple[int, ...], ...]:
        """The factors of the group that each condition depends on, by their numbers; all by
        default.
        """
        return (tuple(range(len(factors_of(group)))),) * conditions

    @derived
    def rows(self, group: LieGroup, g: Element) -> Rows:
        """G(g) by rows and factors, as `touches` says."""
        G = self.jacobian(group, g)
        factors = self.touches(group, len(G))
        return tuple([tuple([parts_of(group, row)[b] for b in of_row]) for row, of_row in zip(G, factors)])


@record
class VelocityConstraint(Constraint):
    """Conditions on velocities, linear and homogeneous, A(g) xi = 0, that come from no c(g):
    rolling, blades, knife edges.

    1. A subclass writes `matrix`, as a formula that returns m independent rows.  Its fields are the
    parameters.

    Source: Bloch, Nonholonomic Mechanics and Control, 2nd ed., section 1.3; Cortes and Martinez,
    Nonlinearity 14 (2001).
    """

    def matrix(self, g: Any) -> Mat:
        """A(g), (m, dim), for left-trivialised velocities.  g : an element."""
        raise undefined(self, "matrix")

    def value(self, g: Any) -> Vec:
        """Not defined, for conditions on velocities come from no c(g): raises NotDefined."""
        raise NotDefined(f"{type(self).__name__}: conditions on velocities come from no function c(g)")

    @derived
    def jacobian(self, group: LieGroup, g: Element) -> Mat:
        """A(g).  g : an element."""
        return self.matrix(g)


def factors_of(group: LieGroup) -> tuple[LieGroup, ...]:
    """The factors of a product; of another group, the group itself."""
    return group.factors if isinstance(group, ProductGroup) else (group,)


def parts_of(group: LieGroup, xi: Vec) -> tuple[Vec, ...]:
    """The coordinates of each factor.  xi : (dim,)."""
    return group.algebra.parts(xi) if isinstance(group, ProductGroup) else (xi,)
