"""Discrete Lagrangians: the action of one step of a body, a function of its mean velocity or of its group element."""

from __future__ import annotations

from functools import cached_property
from typing import Any, ClassVar

from ..errors import InvalidInput, undefined
from ..formulas import Element, Mat, Record, Vec, gradient, jacobian, record, vec, vectors
from ..formulas.classes.derived import derived
from ..groups.lie_group import LieGroup
from ..groups.retractions import Exponential, Retraction
from ..solvers import correction
from ..tableaus.collocation import gauss


@record
class DiscreteLagrangian(Record):
    """The action of a step, l_d(xi) of its mean velocity xi, where the step is g_i+1 = g_i
    tau(h xi); h l(xi) to first order.

    1. A subclass writes `value(xi, h)`, as a formula; its derivatives are derived.  Its fields are
    the parameters.
    2. It says the `order` of the action it makes, and whether it is `symmetric`:
    l_d(xi, -h) = -l_d(xi, h).

    CovariantVariational(retraction, lagrangian=...) makes its steps stationary.  GroupLagrangian is
    the same for those who think of the element of the step.

    Source: Marsden, Pekarsky, Shkoller, Nonlinearity 12 (1999), 1647, section 3; Marsden and West,
    Acta Numerica 10 (2001), 1.3.
    """

    order: ClassVar[int] = 1
    symmetric: ClassVar[bool] = False

    def value(self, xi: Vec, h: float) -> float:
        """l_d(xi), an action.  xi : (dim,), the mean velocity of a step of length h."""
        raise undefined(self, "value")

    @derived
    def action(self, system: Any, retraction: Retraction, xi: Vec, h: float) -> float:
        """l_d(xi) for a system and a retraction, of which `value` knows nothing.  xi : (dim,)."""
        return self.value(xi, h)

    @derived
    def momentum(self, system: Any, retraction: Retraction, xi: Vec, h: float) -> Vec:
        """(1/h) dl_d/dxi, (dim,): the momentum of the mean velocity.  xi : (dim,)."""
        return (1.0 / h) * gradient(lambda x: self.action(system, retraction, x, h), xi)

    @derived
    def hessian(self, system: Any, retraction: Retraction, xi: Vec, h: float) -> Mat:
        """(1/h) d2l_d/dxi2, (dim, dim).  xi : (dim,)."""
        return jacobian(lambda x: self.momentum(system, retraction, x, h), xi)


@record
class GroupLagrangian(DiscreteLagrangian):
    """The action of a step as a function of its element g = g_i^-1 g_i+1.

    1. A subclass writes `on_group(g, h)`, as a formula.  Its derivatives are derived.
    2. `order` and `symmetric` are as of DiscreteLagrangian; it is symmetric if
    L_d(g^-1, -h) = -L_d(g, h).

    Where a book has g_i+1^-1 g_i for the argument, write the inverse of g in its place.

    Source: Marsden, Pekarsky, Shkoller, Nonlinearity 12 (1999), 1647, section 3.
    """

    def on_group(self, g: Element, h: float) -> float:
        """L_d(g), an action.  g : an element."""
        raise undefined(self, "on_group")

    def action(self, system: Any, retraction: Retraction, xi: Vec, h: float) -> float:
        """L_d(tau(h xi)).  xi : (dim,)."""
        return self.on_group(retraction.tau(system.group, h * xi), h)

    def momentum(self, system: Any, retraction: Retraction, xi: Vec, h: float) -> Vec:
        """(dtau_{h xi})* L_g* dL_d, left-trivialised, with <L_g* dL_d, eta> = d/ds L_d(g exp(s eta)).  xi : (dim,)."""
        group = system.group
        g = retraction.tau(group, h * xi)
        slope = gradient(lambda eta: self.on_group(group.compose_exp(g, eta), h), vec(*[0.0 for _ in xi]))
        return retraction.dtau_dual(group, h * xi, slope)


@record
class QuadratureLagrangian(DiscreteLagrangian):
    """The action of the body's own Lagrangian along a curved path to tau(h xi), by Gauss'
    quadrature: of order 4.

        l_d(xi) = h sum_j b_j l(dtau_X(c_j) X'(c_j)/h)  (left-trivialised),   X(s) = s h xi + s (1 - s) y,
        y = -(h^2/2) (d2l/dxi2)^-1 ad*_xi dl/dxi

    The action is stationary for the motion, and this y, which bends the path as the motion does, is
    right to leading order: the action is wrong by the square of what is missing.  Of the
    exponential, dtau is cut after ad^3, which changes it by O(h^5).  With y = 0 the exponential
    gives h l(xi), of order 2.

    nodes : of the quadrature, 2 or more; more of them change the error, not the order.
    Needs a body with a Lagrangian, and a retraction whose differential has a formula.

    Source: Marsden and West, Acta Numerica 10 (2001), 2.6 (quadrature along a path); Hall and Leok,
    Found. Comput. Math. 17 (2017).
    """

    order: ClassVar[int] = 4

    nodes: int = 2

    def __post_init__(self) -> None:
        super().__post_init__()
        if type(self.nodes) is not int or not 2 <= self.nodes <= 4:
            raise InvalidInput(f"QuadratureLagrangian: nodes is 2, 3 or 4; got {self.nodes!r}")

    @cached_property
    def rule(self) -> tuple[tuple[float, float], ...]:
        """The nodes and weights of Gauss's rule, (node, weight) each."""
        tableau = gauss(self.nodes)
        return tuple(zip(tableau.c, tableau.b))

    def action(self, system: Any, retraction: Retraction, xi: Vec, h: float) -> float:
        """The sum over the nodes.  xi : (dim,)."""
        group, body = system.group, system.lagrangian
        pull = group.ad_star(xi, body.momentum(xi))
        inertia = body.hessian(xi)
        # y/h
        bend = (-0.5 * h) * (correction(inertia, pull) if isinstance(inertia, vectors.Mat) else pull / inertia)
        action = 0.0
        for s, weight in self.rule:
            place, speed = h * (s * xi + (s * (1.0 - s)) * bend), xi + (1.0 - 2.0 * s) * bend
            action = action + (h * weight) * body.value(_body_velocity(group, retraction, place, speed))
        return action


def _body_velocity(group: LieGroup, retraction: Retraction, place: Vec, speed: Vec) -> Vec:
    """The body velocity dtau_X X' of tau(X), left-trivialised."""
    if not isinstance(retraction, Exponential):
        return retraction.dtau(group, place, speed)
    term, velocity = speed, speed
    for k in 2, 3, 4:  # sum of (-ad_X)^(k-1) X'/k!
        term = (-1.0 / k) * group.ad(place, term)
        velocity = velocity + term
    return velocity
