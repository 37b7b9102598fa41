"""The energy of a cell of a field, a term of the nodes at its ends."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ...formulas import Mat, Vec, identity_matrix, mat, record, vectors
from ...groups.lie_group import LieGroup
from ...groups.retractions import Exponential, Retraction
from ...integrators.variational import with_inertia
from ...systems.lagrangian import Lagrangian
from ..sites.terms.terms import Term


@record
class CellTerm(Term):
    """The energy of a cell of length l between two nodes, W = l Phi(x/l), x = tau^-1(g_a^-1 g_b); abstract.

    A subclass has the group as `on`, `stored_energy`, `length` and `retraction`, as fields or properties, or
    writes `stored`, `stress` and `moduli`.  The forces on the ends are m = dPhi/deta carried to each,
    (dtau^-1_x)* m.

    Source: Demoures, Gay-Balmaz, Kobilarov and Ratiu, Commun. Nonlinear Sci. Numer. Simul. 19 (2014), 3492.
    """

    if TYPE_CHECKING:  # fields here would be arguments of every cell

        def __getattr__(self, name: str) -> Any: ...

    def stored(self, eta: Vec) -> float:
        """The energy Phi(eta) in a unit of length.  eta : (dim,)."""
        return self.stored_energy.value(eta)

    def stress(self, eta: Vec) -> Vec:
        """The internal force m = dPhi/deta.  eta : (dim,)."""
        return self.stored_energy.momentum(eta)

    def moduli(self, eta: Vec) -> Mat | Vec:
        """The stiffness d2Phi/deta2, a matrix or its diagonal.  eta : (dim,)."""
        return self.stored_energy.hessian(eta)

    def displacement(self, a: Any, b: Any) -> Vec:
        """The displacement between both nodes, x = tau^-1(g_a^-1 g_b)."""
        return self.retraction.tau_inv(self.on, self.on.compose(self.on.inverse(a.g), b.g))

    def energy(self, a: Any, b: Any) -> float:
        """The energy l Phi(x/l) of the cell."""
        return self.length * self.stored((1.0 / self.length) * self.displacement(a, b))

    def force(self, group: Any, k: int, *sites: Any) -> Vec:
        """The force on the first node, k = 0, or on the second, each in its axes."""
        return self.forces(group, *sites)[k]

    def forces(self, group: Any, *sites: Any) -> tuple[Vec, ...]:
        """The forces (dtau^-1_-x)* m and -(dtau^-1_x)* m on both nodes."""
        x, tau = self.displacement(*sites), self.retraction
        m = self.stress((1.0 / self.length) * x)
        return tau.dtau_inv_dual(group, -x, m), -tau.dtau_inv_dual(group, x, m)

    def stiffnesses(self, group: Any, *sites: Any) -> tuple[tuple[Mat, ...], ...]:
        """With x' = dtau^-1_x eta_b - dtau^-1_-x eta_a and n = (dtau^-1_x)* m, so that (dtau_x)* n = m,
        n' = (dtau^-1_x)* (K/l x' - ((dtau_x)* n)' at fixed n), K the moduli.
        """
        tau, x, rate = self.retraction, self.displacement(*sites), 1.0 / self.length
        m, rigidity = self.stress(rate * x), rate * self.moduli(rate * x)
        units, by_ends = identity_matrix(len(x)), []  # type: Any, list[Any]
        for y, sign in ((x, -1.0), (-x, 1.0)):
            by_end = mat(*[tau.dtau_inv(group, y, unit) for unit in units])  # its transpose
            _, weight, slope = tau.residual(group, -y, m, tau.dtau_inv_dual(group, y, m))
            if isinstance(weight, vectors.Mat):
                return super().stiffnesses(group, *sites)
            by_ends = [*by_ends, (by_end, by_end @ with_inertia((sign / weight) * slope, rigidity))]
        (b, on_b), (a, on_a) = by_ends
        return (on_a @ a.T, -(on_a @ b.T)), (-(on_b @ a.T), on_b @ b.T)


@record
class Cell(CellTerm):
    """The energy of a cell of a field, l Phi(tau^-1(g_a^-1 g_b)/l).

    on : the group.  stored_energy : Phi, a Lagrangian of the strain.  length : l.  retraction : tau.
    """

    on: LieGroup
    stored_energy: Lagrangian
    length: float
    retraction: Retraction = Exponential()
