"""Systems whose potential is a sum of fast and slow parts: stiff springs beside soft forces, an
inner planet beside outer ones.
"""

from __future__ import annotations

from typing import ClassVar, final

from ..errors import InvalidInput
from ..formulas import Vec, gradient, record, vectors
from ..formulas.classes.derived import derived
from .separable import SeparableSystem


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
