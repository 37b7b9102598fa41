"""Splitting on the constraints: kicks within the tangent space, and free motions along geodesics,
which are known.
"""

from __future__ import annotations

from typing import Any

from ...errors import IncompatibleSystem
from ...formulas import Vec, plain, record, vec
from ...integrators.method import alternatives
from ...integrators.separable import ChosenByOrder
from ...systems.canonical import CanonicalState
from .constrained import SeparableConstrainedSystem, cross_products, eliminated


@record
class GeodesicSplitting(ChosenByOrder):
    """Splitting of H = T(p) + V(q) with constraints: V kicks p within the tangent space, T moves
    along a geodesic; both exactly.

        V:  p += t (f - G^T y),  G H_p = 0        T:  (q, p) = system.geodesic(q, p, t)

    order : 2, 4, 6 or 8; or a `tableau`, of `liemech.tableaus.splittings`.  As [V, [V, [V, T]]] = 0
    on the constraints too, the Runge-Kutta-Nystroem splittings are of their full order.
    Explicit, symmetric, symplectic on M; the energy oscillates without drift.

    A SeparableConstrainedSystem with quadratic T and a formula `geodesic(q, p, t)` is needed, such
    as SphericalPendulum().
    Source: Hairer, Lubich, Wanner, VII.1.5 (splitting of constrained systems); Dullweber,
    Leimkuhler, McLachlan, J. Chem. Phys.  107 (1997).
    """

    __repr__ = ChosenByOrder.__repr__

    def require(self, system: Any) -> None:
        """A constrained system whose geodesics are known."""
        if not isinstance(system, SeparableConstrainedSystem):
            raise IncompatibleSystem(
                f"{self!r} needs a SeparableConstrainedSystem, H = T(p) + V(q) with g(q) = 0; got "
                f"{system!r}. {alternatives(system)}"
            )
        if not callable(getattr(system, "geodesic", None)):
            raise IncompatibleSystem(
                f"{self!r} needs the free motion on the constraints as a formula, geodesic(q, p, "
                f"t) -> (q, p); {system!r} has none. RATTLE() and its compositions need none"
            )
        if not system.quadratic:
            raise IncompatibleSystem(
                f"{self!r} needs a kinetic energy of second degree; that of {system!r} is none. Use RATTLE()"
            )
        super().require(system)

    def step(self, system: Any, t: float, state: CanonicalState, h: float) -> CanonicalState:
        """Kick, drift along a geodesic, kick, ...; before the last kick the position is put on the
        constraints.
        """
        start, (kicks, drifts) = plain(state), (self.tableau.kicks, self.tableau.drifts)
        q, p = start.q, start.p
        for a, b in zip(drifts, kicks):
            if b != 0.0:
                p = self._kicked(system, q, p, b * h)
            q, p = system.geodesic(q, p, a * h)
        q = system.across(q, p, q)  # what rounding has left
        p = self._kicked(system, q, p, kicks[len(drifts)] * h)
        return CanonicalState(state.q + (q - start.q), state.p + (p - start.p))

    def _kicked(self, system: Any, q: Vec, p: Vec, t: float) -> Vec:
        """p + t f, without what is across the constraints, rounding of the steps before included."""
        G, p = system.constraint_jacobian(q), p + t * system.force(q, p)
        x, _ = eliminated(cross_products(G, system.normals(q, p)), vec(*(G @ system.velocity(q, p))))
        return p - x @ G
