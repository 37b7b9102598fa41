"""Lagrangians on a Lie algebra."""

from __future__ import annotations

from ..errors import undefined
from ..formulas import Mat, Record, Vec, gradient, jacobian, record
from ..formulas.classes.derived import derived


@record
class Lagrangian(Record):
    """A left-invariant Lagrangian as a function of the body velocity, l(xi).

    A subclass writes `value`; its derivatives are derived unless they are written too.  Its fields
    are the parameters.
    """

    def value(self, xi: Vec) -> float:
        """The Lagrangian l(xi), which a subclass writes.  xi : (dim,)."""
        raise undefined(self, "value")

    @derived
    def momentum(self, xi: Vec) -> Vec:
        """The momentum mu = dl/dxi.  xi : (dim,)."""
        return gradient(lambda x: self.value(x), xi)

    @derived
    def hessian(self, xi: Vec) -> Mat | Vec:
        """The second derivative d2l/dxi2, the inertia at xi.  xi : (dim,), result : (dim, dim), or
        (dim,) if it is diagonal.
        """
        return jacobian(lambda x: self.momentum(x), xi)
