"""The multisymplectic law: the two-form of every site changes by what flows to it from its neighbours.

    om_i(U, V) = <d_U mu_i, V_i> - <d_V mu_i, U_i> - <mu_i, [U_i, V_i]>,   kappa_i = d<f_i, .>
    om_i(end) - om_i(start) = (h/2) (kappa_i(start) + kappa_i(end)),       for all variations U, V of the motion

with the forces f_i that cells or edges put on the site.  Summed over all sites it says that steps are symplectic.

Source: Marsden, Patrick and Shkoller, Commun. Math. Phys. 199 (1998), 351, theorem 4.1.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..formulas import jacobian, vec
from ..groups.composed.power import PowerGroup
from ..integrators.kicks.kick_drift import FieldSplitting
from ..systems.mechanical import MechanicalSystem
from ..tableaus.splittings import STRANG
from .points.phase_space_charts import Charts


def has_forms(system: Any, method: Any) -> bool:
    """Whether the law concerns a method: half a kick, a drift, half a kick, of many sites without a load."""
    kicked = isinstance(method, FieldSplitting) and method.tableau == STRANG
    many = isinstance(system, MechanicalSystem) and isinstance(system.configurations, PowerGroup)
    return kicked and many and system.load is None and system.configurations.copies > 1


@dataclass(frozen=True)
class FormsOfSites(Charts):
    """Coordinates on T*G of many sites, by which each has a two-form."""

    def defect(self, trial: Any, apart: float) -> float:
        """What the law is missed by along a step, beside the forms, of the site where it is most."""
        end, D = self.moved(trial, apart)
        worst, half = 0.0, 0.5 * trial.h
        forms = [(self._form(at, i), flow) for at in (self.begin, end) for i, flow in enumerate(self._flows(at))]
        for (start, out), (stop, into) in zip(forms[: len(forms) // 2], forms[len(forms) // 2 :], strict=True):
            before, after = start + half * out, stop - half * into
            scale = np.abs(D).max() ** 2 * np.abs(after).max() + np.abs(before).max()
            worst = max(worst, float(np.abs(D.T @ after @ D - before).max() / scale))
        return worst

    def _form(self, at: Any, i: int) -> np.ndarray:
        """The two-form of site i, the inverse of its Poisson structure."""
        n, form = self.group.base.dim, np.zeros([len(self.units)] * 2)
        place = np.arange(n * i, n * i + n)
        block = np.ix_(*[[*place, *(place + self.group.dim)]] * 2)
        form[block] = np.linalg.inv(self.structure(at)[block])
        return form

    def _flows(self, at: Any) -> Iterator[np.ndarray]:
        """kappa_i = d<f_i, .> of every site."""
        system, group = self.system, self.group
        n, N = group.base.dim, group.dim
        still = vec(*[0.0] * N)
        slopes = np.array(jacobian(lambda x: system.force(group.compose_exp(at.g, x)), still))
        brackets = np.asarray(group.algebra.poisson_structure(system.force(at.g)))
        for i in range(group.copies):
            of_site, flow = slice(n * i, n * i + n), np.zeros([2 * N] * 2)
            flow[:N, of_site] += slopes[of_site].T
            flow[of_site, :N] -= slopes[of_site]
            flow[of_site, of_site] += brackets[of_site, of_site]
            yield flow * np.outer(self.units, self.units)
