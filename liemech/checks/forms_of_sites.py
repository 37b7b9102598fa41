"""The multisymplectic law: the two-form of every site changes by what flows to it from its neighbours.

    om_i(U, V) = <d_U mu_i, V_i> - <d_V mu_i, U_i> - <mu_i, [U_i, V_i]>,   kappa_i = d<f_i, .>
    om_i(end) - om_i(start) = (h/2) (kappa_i(start) + kappa_i(end)),       for all variations U, V of the motion

with the forces f_i on the sites.

Source: Marsden, Patrick and Shkoller, Commun. Math. Phys. 199 (1998), 351, theorem 4.1.
"""

from __future__ import annotations

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
    coupled = isinstance(system, MechanicalSystem) and isinstance(system.configurations, PowerGroup)
    return kicked and coupled and system.load is None and system.configurations.copies > 1


class FormsOfSites(Charts):
    """Coordinates on T*G of many sites, by which each has a two-form."""

    def defect(self, trial: Any, apart: float) -> float:
        """The error of the law along a step, beside the sizes of the forms."""
        end, D = self.moved(trial, apart)
        after = self._forms(end, -0.5 * trial.h)
        before = self._forms(self.begin, 0.5 * trial.h)[:, self.free[:, None], self.free]
        scale = np.abs(D).max() ** 2 * np.abs(after).max() + np.abs(before).max()
        return float(np.abs(D.T @ after @ D - before).max() / scale)

    def _forms(self, at: Any, kick: float) -> np.ndarray:
        """om_i + kick kappa_i of every site; om_i is the inverse of its Poisson structure."""
        system, group, B = self.system, self.group, self.structure(at)
        n, N, still = group.base.dim, group.dim, vec(*[0.0] * group.dim)
        slopes = kick * np.array(jacobian(lambda x: system.force(group.compose_exp(at.g, x)), still))
        brackets = kick * np.asarray(group.algebra.poisson_structure(system.force(at.g)))
        forms = np.zeros((group.copies, 2 * N, 2 * N))
        for i, form in enumerate(forms):
            place = np.arange(n * i, n * i + n)
            form[:N, place] += slopes[place].T
            form[place, :N] -= slopes[place]
            form[np.ix_(place, place)] += brackets[np.ix_(place, place)]
            form *= np.outer(self.units, self.units)
            block = np.ix_(*[[*place, *(place + N)]] * 2)
            form[block] += np.linalg.inv(B[block])
        return forms
