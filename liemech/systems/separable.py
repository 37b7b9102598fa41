"""Separable systems: canonical ones whose energy is a kinetic energy of the momenta and a potential
of the positions.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, ClassVar, final

from ..errors import InvalidInput, InvalidTimeScale, undefined
from ..formulas import Vec, gradient, record, vec, vectors
from ..formulas.classes.derived import derived
from ..formulas.numbers.anything import why_not_one_expression
from ..formulas.numbers.series import Series
from .canonical import CanonicalSystem, HamiltonianSystem


@record
class SeparableEnergy(CanonicalSystem):
    """An energy H(q, p) = T(p) + V(q), of a free or a constrained system; abstract.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VI.1.2.
    """

    def kinetic(self, p: Vec) -> float:
        """The kinetic energy T(p), which a subclass writes.  p : (n,)."""
        raise undefined(self, "kinetic")

    def potential(self, q: Vec) -> float:
        """The potential V(q), which a subclass writes.  q : (n,)."""
        raise undefined(self, "potential")

    @final
    def energy(self, q: Vec, p: Vec) -> float:
        """T(p) + V(q).  q, p : (n,)."""
        return self.kinetic(p) + self.potential(q)

    @derived
    def velocity(self, q: Vec, p: Vec) -> Vec:
        """The velocity q' = dT/dp, (n,).  q, p : (n,)."""
        return gradient(lambda x: self.kinetic(x), p)

    @derived
    def force(self, q: Vec, p: Vec) -> Vec:
        """The force p' = -dV/dq, (n,).  q, p : (n,)."""
        return -gradient(lambda x: self.potential(x), q)

    @derived
    def relative_force(self, q: Vec) -> Vec:
        """f/(-V), the gradient of log(-V), for a potential that is negative.  q : (n,)."""
        depth = -self.potential(q)
        if not depth > 0.0:
            raise InvalidTimeScale(f"{self!r}: -V = {depth:g}, and its logarithm needs a negative potential")
        return (1.0 / depth) * self.force(q, 0.0 * q)

    @cached_property
    @derived
    def quadratic(self) -> bool:
        """Whether T is a polynomial of at most second degree.  Asked of its formula: the power series of
        T(a + b s) ends with s^2.

        A formula that cannot be expanded, whose series does not end (|p|^2 by way of a root), or
        that compares, gives False.
        """
        if why_not_one_expression(lambda p: self.kinetic(p), self.degrees):
            return False
        p = vec(*[Series(0.5 + 0.125 * i, 1.0 - 0.0625 * i) for i in range(self.degrees)])
        try:
            energy: Any = self.kinetic(p)
        except (TypeError, AttributeError, ArithmeticError, ValueError):
            return False
        return not isinstance(energy, Series) or energy.term(3) is None


@record
class SeparableSystem(SeparableEnergy, HamiltonianSystem):
    """Hamilton's equations in R^2n for H(q, p) = T(p) + V(q):  q' = dT/dp,  p' = -dV/dq.

    1. A subclass writes `kinetic(p)` and `potential(q)`, as formulas, and says its number of `degrees` of
    freedom, n.  Its fields are the parameters.
    2. It may write `velocity(q, p)`, dT/dp, `force(q, p)`, -dV/dq, and `relative_force(q)`, for
    LogarithmicHamiltonian, in closed form; left out, they follow by differentiation, exact to rounding.
    3. It may name what stays constant beside the energy (`constants`).

    StormerVerlet and Splitting step such systems by their two parts, whose motions are known.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VI.1.2 and II.5.
    """

    alternatives: ClassVar[str] = "StormerVerlet() and Splitting(order=4) are for it, RKMK accepts every system"


@record
class MultirateSystem(SeparableSystem):
    """Hamilton's equations for H = T(p) + V_1(q) + ... + V_m(q), parts of the potential that change
    at different rates.

    1. A subclass writes `kinetic(p)` and one method of q for each part, and names these methods in `parts`, the
    fastest first: `parts = ("springs", "gravity")`.
    2. It may write `part_force(k, q)`, the force of part number k, in closed form.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VIII.4.
    """

    parts: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.parts) < 2 or not all(callable(getattr(type(self), name, None)) for name in self.parts):
            raise InvalidInput(
                f"{type(self).__name__} must name its potentials, "
                "methods of q, the fastest first, such as "
                f'parts = ("springs", "gravity"); got {self.parts!r}'
            )

    def part(self, k: int, q: Vec) -> float:
        """The potential number k, V_1 being number 0.  q : (n,)."""
        return getattr(self, self.parts[k])(q)

    @derived
    def part_force(self, k: int, q: Vec) -> Vec:
        """-dV_k/dq, (n,).  q : (n,)."""
        return -gradient(lambda x: self.part(k, x), q)

    @final
    def potential(self, q: Vec) -> float:
        """The sum of the parts.  q : (n,)."""
        return vectors.sum([self.part(k, q) for k in range(len(self.parts))])

    @final
    def force(self, q: Vec, p: Vec) -> Vec:
        """The sum of the forces.  q, p : (n,)."""
        return vectors.sum([self.part_force(k, q) for k in range(len(self.parts))])
