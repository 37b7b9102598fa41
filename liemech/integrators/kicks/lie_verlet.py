"""Lie-Verlet: the covariant variational method in a field of force."""

from __future__ import annotations

from functools import cached_property
from typing import ClassVar

from ...formulas import record
from ...groups.retractions import Exponential, Retraction
from ...tableaus.splittings import STRANG, SplittingTableau
from ..variational import CovariantVariational
from .kick_drift import FieldSplitting


@record
class LieVerlet(FieldSplitting):
    """Algorithm 1 between two kicks, the discrete Euler-Lagrange equations of the sum of h
    l(xi_i) - h (V(g_i) + V(g_i+1))/2:

        m = mu_i + (h/2) f(g_i)                                                 half a kick
        (dtau^-1_{h xi_i})* dl/dxi(xi_i) = m  (right-trivialised),   g_i+1 = g_i tau(h xi_i)         one step without the field
        mu_i+1 = Ad*_tau(h xi_i) m + (h/2) f(g_i+1)                             half a kick

    retraction : Exponential() is the more accurate one, Cayley() has a solution for every step
    size.  Order 2, symmetric, symplectic; a momentum that belongs to a symmetry of the potential is
    kept to rounding, the energy oscillates without drift.  One force a step.  On R^n it is the
    Verlet method.
    A load F, by the principle of Lagrange and d'Alembert, adds (h/2) F to each kick: to the first
    as it is at the beginning, to the last as it is at the end, an equation for mu_i+1.
    Raises NoConvergence if the step is too large.

    Source: Bou-Rabee and Marsden, Found. Comput. Math. 9 (2009); Lee, Leok, McClamroch, Lie group
    variational integrators for the full body problem, Comput. Methods Appl. Mech. Eng. 196 (2007);
    for loads Marsden and West, Acta Numerica 10 (2001), section 3.2.
    """

    title: ClassVar[str] = "Lie-Verlet ({chart})"
    order: ClassVar[int] = 2
    symmetric: ClassVar[bool] = True
    symplectic: ClassVar[bool] = True
    tableau: ClassVar[SplittingTableau] = STRANG

    retraction: Retraction = Exponential()

    @cached_property
    def free(self) -> CovariantVariational:
        """The motion between the kicks."""
        return CovariantVariational(self.retraction)
