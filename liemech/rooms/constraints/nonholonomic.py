"""Bodies that roll or glide: the discrete principle of Lagrange and d'Alembert on a Lie group."""

from __future__ import annotations

from typing import Any, ClassVar

from ...errors import IncompatibleSystem
from ...formulas import Element, Vec, jacobian, record
from ...integrators.method import alternatives
from .constrained_body import NonholonomicBody
from .lie_rattle import LieRATTLE


@record
class LagrangeDAlembert(LieRATTLE):
    """Discrete Lagrange-d'Alembert equations: a step of Algorithm 1 under a condition on
    velocities, averaged over its ends.

        m = mu_i + (h/2) f(g_i) - A(g_i)* l,  (dtau^-1_x)* J x/h = m,  (A(g_i) + A(g_i tau(x))) x = 0        for x and l
        g_i+1 = g_i tau(x),  mu_i+1 = Ad*_tau(x) m + (h/2) f(g_i+1) - A(g_i+1)* l',  A(g_i+1) J^-1 mu_i+1 = 0  for l'

    dtau is the right-trivialised one.
    retraction : Exponential() is the more accurate one.
    Order 2, symmetric; the constraint holds to rounding at every node.  There is no two-form to be
    kept.  The energy, which the motion keeps, is kept up to O(h^2), and may stay off by as much for
    good where the motion goes from one regime to another.
    Raises NoConvergence if the step is too large.

    Source: Cortes and Martinez, Nonlinearity 14 (2001); Fedorov and Zenkov, Nonlinearity 18 (2005);
    Kobilarov, Marsden and Sukhatme, Discrete Contin. Dyn. Syst. S 3 (2010).
    """

    title: ClassVar[str] = "Lagrange-d'Alembert ({chart})"
    symmetric: ClassVar[bool] = True
    symplectic: ClassVar[bool] = False
    order: ClassVar[int] = 2

    def require(self, system: Any) -> None:
        """A NonholonomicBody, on a group that has the retraction."""
        if not isinstance(system, NonholonomicBody):
            raise IncompatibleSystem(f"{self!r} needs a NonholonomicBody; got {system!r}. {alternatives(system)}")
        self.retraction.require(system.configurations)

    def _condition(self, system: Any, g: Element, x: Vec) -> tuple[Vec, Any]:
        """(A(g) + A(g tau(x))) x/2, and its derivative by x, by rows and blocks."""
        C = jacobian(lambda y: self._crossing(system, g, y), x)
        rows = [[row[start:end] for start, end in system.places] for row in C]
        return self._crossing(system, g, x), [[rows[a][b] for b, _ in ties] for a, ties in enumerate(system.touches)]

    def _crossing(self, system: Any, g: Element, x: Vec) -> Vec:
        g_end = self.retraction.compose_tau(system.configurations, g, x)
        return 0.5 * (system.jacobian(g) @ x + system.jacobian(g_end) @ x)
