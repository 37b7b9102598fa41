"""Does the energy of a run drift, or does it fluctuate about a constant?  The modified energy, from samples and actions.

The steps of a symplectic method are the motion of a modified energy H~ = H + O(h^p), up to terms that are exponentially
small in 1/h.  The action A_n = sum L_d of its steps is that of this motion, so that with D, the central difference of order
2m, D f_n = 1/h sum_k c_k (f_n+k - f_n-k), c_k = (-1)^(k+1) (m!)^2 / (k (m-k)! (m+k)!),

    on a group    H~_n = <mu_n, 1/h sum_k c_k (log g_n^-1 g_n+k - log g_n^-1 g_n-k)> - D A_n
    on R^2n       H~_n = (p_n . D q_n - q_n . D p_n)/2 - D (A - p . q/2)_n

are constant up to O(h^2m).

Source: Skeel and Hardy, Practical construction of modified Hamiltonians, SIAM J. Sci. Comput. 23 (2001), 1172; Marsden and
West, Discrete mechanics and variational integrators, Acta Numerica 10 (2001), section 2.3.
"""

from __future__ import annotations

from itertools import zip_longest
from math import factorial
from typing import Any

import numpy as np

from ...errors import IncompatibleSystem, InvalidInput, require
from ...formulas.classes.frozen import frozen
from ...integrators.free_body.exact_free_body import ExactFreeBody
from ...integrators.kicks.kick_drift import FieldSplitting
from ...integrators.method import steps_as
from ...integrators.separable import SeparableSplitting
from ...integrators.variational import CovariantVariational
from ...simulation import arguments
from ...simulation.trajectory import Trajectory
from ...systems.lie_poisson import LiePoissonSystem
from ...systems.mechanical import MechanicalSystem
from ...systems.separable import SeparableSystem

LESS = 0.1
"""The part of the spread of the energy below which that of the modified energy tells of a fluctuation."""


@frozen
class ModifiedEnergy:
    """The modified energy along a run, beside its energy; `print` it.

    t : (n,), the times of the samples, without those at the ends that differences need.  energy, values : (n,), H and H~.
    """

    t: np.ndarray
    energy: np.ndarray
    values: np.ndarray

    @property
    def verdict(self) -> str:
        """`fluctuates`, if H~ is constant beside H; else `undecided`: the steps are too long for differences of this order."""
        return "fluctuates" if np.ptp(self.values) <= LESS * np.ptp(self.energy) else "undecided"

    def __repr__(self) -> str:
        verdict = "the energy fluctuates" if self.verdict == "fluctuates" else "undecided whether the energy drifts"
        return (
            f"{verdict}: it stays within {np.ptp(self.energy):.1e}, the modified energy within "
            f"{np.ptp(self.values):.1e}"
        )


def modified_energy(run: Trajectory, order: int = 8) -> ModifiedEnergy:
    """The modified energy of a run, a constant up to O(h^order), which tells whether the energy drifts or fluctuates.

    run : fixed steps of one body, every one kept, by StormerVerlet or Splitting of T(p) + V(q), by CovariantVariational, or by
    LieVerlet or KickDrift of order 2 in a field.  order : 2m, an even number above the order of the method.
    Raises IncompatibleSystem for other methods, InvalidInput for runs that are too short or have not kept all steps.
    Source: Skeel and Hardy, SIAM J. Sci. Comput. 23 (2001), 1172.
    """
    require("modified_energy: run", run, Trajectory, "a run, such as lm.integrate(...) returns")
    method: Any = run.method
    m = arguments.count(order, "order", 2) // 2
    if order % 2 or order <= method.order:
        raise InvalidInput(
            f"modified_energy: order is even and above that of the method, {method.order}; got {order}: else H itself is nearer"
        )
    if run.observed or not run._at_every_step:
        raise InvalidInput(
            "modified_energy: takes one body with fixed steps, all of which are kept, every=1, none cut by breaks or an event"
        )
    if len(run.t) <= 2 * m:
        raise InvalidInput(
            f"modified_energy: differences of order {order} need more than {2 * m} steps; got {run.steps}"
        )
    c = [(-1) ** (k + 1) * factorial(m) ** 2 / (k * factorial(m - k) * factorial(m + k)) for k in range(1, m + 1)]
    inside = slice(m, len(run.t) - m)

    def later(x: np.ndarray, k: int) -> np.ndarray:
        return x[m + k : len(x) - m + k]

    def difference(x: np.ndarray) -> Any:
        """D x at the samples inside."""
        return sum(ck / run.h * (later(x, k) - later(x, -k)) for k, ck in enumerate(c, 1))

    states = run.states
    if states.get("mu", np.empty(0)).ndim > 2:  # of many sites, in a row
        states = {name: x.reshape(len(x), -1) for name, x in states.items()}
    actions = np.append(0.0, np.cumsum(_actions(method, run.system, states, run.h)))
    if isinstance(run.system, SeparableSystem):
        q, p = states["q"], states["p"]
        area = np.sum(p[inside] * difference(q) - q[inside] * difference(p), axis=1)
        values = 0.5 * area - difference(actions - 0.5 * np.sum(p * q, axis=1))
    else:
        group, g = getattr(run.system, "configurations", run.system.group), states["g"]
        back = group.inverse(g[inside])
        to = {k: group.log(group.compose(back, later(g, k))) for k in range(-m, m + 1) if k}
        xi = sum(ck / run.h * (to[k] - to[-k]) for k, ck in enumerate(c, 1))
        values = np.sum(states["mu"][inside] * xi, axis=1) - difference(actions)
    return ModifiedEnergy(run.t[inside], np.asarray(run.energy)[inside], values)


def _actions(method: Any, system: Any, states: Any, h: float) -> np.ndarray:
    """The action L_d of every step, from the samples where it begins and ends, (n,)."""
    if steps_as(method, SeparableSplitting) and isinstance(system, SeparableSystem):
        q, p, tableau = states["q"][:-1], states["p"][:-1], method.tableau
        actions = np.zeros(len(q))
        for b, a in zip_longest(tableau.kicks, tableau.drifts, fillvalue=0.0):
            actions = actions - b * h * system.potential(q)
            p = p + b * h * (0.0 * p + system.force(q, p))
            v = system.velocity(q, p)
            actions, q = actions + a * h * (np.sum(p * v, axis=1) - system.kinetic(p)), q + a * h * v
        return actions
    free, mu = getattr(method, "free", method), states.get("mu")
    bodies = (
        isinstance(system, MechanicalSystem) and steps_as(method, FieldSplitting) and len(method.tableau.drifts) == 1
    )
    if bodies and system.load is None and not system.driven and steps_as(free, CovariantVariational, ExactFreeBody):
        place = states["g"]
        v = np.asarray(system.energy(0.0 * mu, place))
        first, last = method.tableau.kicks
        after = mu[:-1] + first * h * system.force(place[:-1])
        return _free_actions(free, system.body, after, h) - h * (first * v[:-1] + last * v[1:])
    if steps_as(method, CovariantVariational) and isinstance(system, LiePoissonSystem) and "g" in states:
        return _free_actions(method, system, mu[:-1], h)
    raise IncompatibleSystem(
        f"modified_energy: the action of the steps of {method!r} is not known for {system!r} with {', '.join(states)}; "
        "StormerVerlet() and Splitting are for T(p) + V(q), CovariantVariational() for free bodies with their g, LieVerlet() "
        "and KickDrift() for bodies in fields without loads"
    )


def _free_actions(method: CovariantVariational | ExactFreeBody, body: Any, mu: np.ndarray, h: float) -> np.ndarray:
    """The actions of steps of a free body from these momenta, (n,)."""
    if isinstance(method, ExactFreeBody):
        return h * (np.sum(mu * body.velocity(mu), axis=1) - body.energy(mu))
    xi = method.velocity(body, mu, h)
    if method.lagrangian is None:
        return h * np.asarray(body.lagrangian.value(xi))
    return np.asarray([method.lagrangian.action(body, method.retraction, x, h) for x in xi])
