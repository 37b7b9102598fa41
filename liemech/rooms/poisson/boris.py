"""Boris' method for charged particles, to compare with: explicit, keeps volumes, but is no Poisson
map.
"""

from __future__ import annotations

from typing import Any, ClassVar

from ...formulas import Vec, cross, dot, record, vec
from ...integrators.method import Method
from .poisson import PoissonState


@record
class Boris(Method):
    """The method of Boris for a `ChargedParticle` of unit charge and mass: half a drift, a kick,
    half a drift.

    The kick is half the electric one, a turn of the velocity about B, and the other half.  The turn
    is the Cayley map of -h B, so the magnetic field alone does not change |v|.

    Order 2, symmetric, explicit.  It keeps volumes in (x, v), but is no Poisson map.  Raises
    IncompatibleSystem for other systems.

    Source: Boris, Proc. 4th Conf. Num. Sim. Plasmas (1970), 3; Qin et al., Phys. Plasmas 20 (2013),
    084503.
    """

    order: ClassVar[int] = 2
    symmetric: ClassVar[bool] = True
    needs: ClassVar[tuple[str, ...]] = ("magnetic_field",)

    def step(self, system: Any, t: float, state: PoissonState, h: float) -> PoissonState:
        """Half a drift, half a push, the rotation by the field, half a push, half a drift."""
        y = state.y
        v = vec(y[3], y[4], y[5])
        middle = vec(y[0], y[1], y[2]) + 0.5 * h * v
        push = self._push(system, middle, 0.5 * h)
        b = 0.5 * h * system.magnetic_field.at(middle)
        before = v + push
        after = before + 2.0 / (1.0 + dot(b, b)) * cross(before + cross(before, b), b) + push
        return PoissonState(vec(*(middle + 0.5 * h * after), *after))

    def _push(self, system: Any, x: Vec, h: float) -> Vec:
        """-h dphi(x): the kick of the electric field in a time h.  x : (3,)."""
        if system.potential is None:
            return vec(0.0, 0.0, 0.0)
        return -h * system.potential.gradient(x)
