"""Magnus methods: one exponential for a step of a linear equation, of integrals of its velocity and
their commutators.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar

from ..errors import IncompatibleSystem
from ..formulas import Vec, record
from ..groups.retractions import Exponential
from ..systems.system import System
from .method import Method

# The nodes of Gauss and Legendre on [0, 1] for orders 2, 4, 6.
NODES = {
    2: (0.5,),
    4: (0.5 - math.sqrt(3.0) / 6.0, 0.5 + math.sqrt(3.0) / 6.0),
    6: (0.5 - math.sqrt(15.0) / 10.0, 0.5, 0.5 + math.sqrt(15.0) / 10.0),
}
ROOT_3, ROOT_15 = math.sqrt(3.0), math.sqrt(15.0)


@record
class Magnus(Method):
    """A Magnus method for linear equations, whose velocity depends on time alone: symmetric, with
    one exponential a step.

    With velocities xi_i at the nodes of Gauss and [ , ] the bracket, for g' = xi(t) g the step is
    exp(Omega) g with

        order 2   Omega = h xi_1
        order 4   Omega = h (xi_1 + xi_2)/2 - h^2 sqrt(3)/12 [xi_1, xi_2]
        order 6   Omega = a_1 + a_3/12 + [-20 a_1 - a_3 + C, a_2 - [a_1, 2 a_3 + C]/60]/240,   C = [a_1, a_2],
                  a_1 = h xi_2,   a_2 = h sqrt(15)/3 (xi_3 - xi_1),   a_3 = 10 h/3 (xi_3 - 2 xi_2 + xi_1)

    For g' = g xi(t) the step is g exp(Omega) and every bracket changes its sign.

    order : 2 (the exponential midpoint rule), 4 or 6.  Velocities are never asked for at the ends
    of a step.

    Source: Blanes, Casas, Ros, Improved high order integrators based on the Magnus expansion, BIT
    40 (2000); Blanes, Casas, Oteo, Ros, The Magnus expansion and some of its applications, Phys.
    Rep. 470 (2009), section 5; Hairer, Lubich, Wanner, IV.7.
    """

    title: ClassVar[str] = "Magnus{0.order}"
    orders: ClassVar[tuple[int, ...]] = 2, 4, 6
    order: int = 4

    symmetric: ClassVar[bool] = True

    def require(self, system: Any) -> None:
        """A system whose velocity depends on time alone."""
        super().require(system)
        if not getattr(system, "linear", False):
            raise IncompatibleSystem(
                f"{self!r} needs a linear equation, such as a LinearGroupEquation, whose velocity "
                f"depends on time alone; got {system!r}. For this one use "
                "RKMK(order=4) or CommutatorFree(order=4)"
            )

    def step(self, system: System, t: float, state: Any, h: float) -> Any:
        """One step by one exponential."""
        start = system.essential_part(state)
        velocities = [system.rate(t + c * h, start) for c in NODES[self.order]]
        return system.displaced(Exponential(), state, self.displacement(system, velocities, h))

    def displacement(self, system: System, velocities: list[Vec], h: float) -> Vec:
        """Omega, from the velocities at the nodes."""
        sign = 1.0 if system.side == "right" else -1.0
        if self.order == 2:
            return h * velocities[0]
        if self.order == 4:
            first, second = velocities
            return 0.5 * h * (first + second) - (sign * h * h * (ROOT_3 / 12.0)) * system.group.ad(first, second)
        first, middle, last = velocities
        a1, a2, a3 = (
            h * middle,
            (h * (ROOT_15 / 3.0)) * (last - first),
            (h * (10.0 / 3.0)) * (last - 2.0 * middle + first),
        )
        c1 = sign * system.group.ad(a1, a2)
        c2 = (sign / -60.0) * system.group.ad(a1, 2.0 * a3 + c1)
        return a1 + a3 / 12.0 + (sign / 240.0) * system.group.ad(c1 - a3 - 20.0 * a1, a2 + c2)
