"""Orders of Runge-Kutta-Munthe-Kaas and commutator-free methods on a double spherical pendulum, moved by SE(3) x SE(3)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...formulas import Vec, cross, dot, record, vec
from ...groups.representations import AdjointAction
from ...groups.rigid.se3 import SE3
from ...integrators.commutator_free import CommutatorFree
from ...integrators.rkmk import RKMK
from ...systems.equations.homogeneous_equation import HomogeneousEquation
from ...tableaus.explicit import HEUN2, KUTTA3
from ..at_work.measured_orders import measure_order
from .compared import Compared

SOURCE = (
    "Celledoni et al., Int. J. Comput. Math. 99 (2022), 58, and its program: rods of 1 m, masses and start at random"
)


@record
class DoubleSphericalPendulum(HomogeneousEquation):
    """Two rods of 1 m without mass, with masses at their ends: q_i' = omega_i x q_i, omega_i' = h_i.

        (m_1 + m_2) h_1 - m_2 q_1 x (q_2 x h_2) = (m_1 + m_2) g e_3 x q_1 - m_2 |omega_2|^2 q_2 x q_1
        m_2 h_2 - m_2 q_2 x (q_1 x h_1) = m_2 g e_3 x q_2 - m_2 |omega_1|^2 q_1 x q_2

    Points are (q_1, omega_1, q_2, omega_2), moved by Ad of SE(3) x SE(3).
    """

    mass1: float
    mass2: float

    def velocity(self, t: float, x: Vec) -> Vec:
        """(omega_1, q_1 x h_1, omega_2, q_2 x h_2)."""
        q1, w1, q2, w2 = x[0:3], x[3:6], x[6:9], x[9:12]
        ratio, weight, n = self.mass2 / (self.mass1 + self.mass2), vec(0.0, 0.0, 9.81), cross(q1, q2)
        f1, f2 = cross(weight, q1) + ratio * dot(w2, w2) * n, cross(weight, q2) - dot(w1, w1) * n
        r = f2 + cross(q2, cross(q1, f1))  # = (1 - ratio) h_2 + ratio (n . h_2) n
        h2 = (1.0 / (1.0 - ratio)) * (r - (ratio * dot(n, r) / (1.0 - ratio + ratio * dot(n, n))) * n)
        h1 = f1 + ratio * cross(q1, cross(q2, h2))
        return vec(*w1, *cross(q1, h1), *w2, *cross(q2, h2))


def compared(full: bool) -> Iterator[Compared]:
    """Orders between their two finest steps, h = 0.1/79 and 0.1/159 s; an order off by more than 0.1 is a failure."""
    draw = np.random.default_rng(1)
    q, spin = draw.random((2, 2, 3))
    q /= np.linalg.norm(q, axis=1)[:, None]
    pendulum = DoubleSphericalPendulum(AdjointAction(SE3() ** 2), *(1.0 + 10.0 * draw.random(2)).tolist())
    start = pendulum.state(np.stack([q, np.cross(q, spin)], axis=1).ravel())
    names = "Lie-Euler", "Lie-Euler-Heun", "RKMK3", "RKMK4", "commutator-free"
    methods = RKMK(order=1), RKMK(tableau=HEUN2), RKMK(tableau=KUTTA3), RKMK(order=4), CommutatorFree(order=4)
    for name, method, order in zip(names, methods, (1, 2, 3, 4, 4)):
        orders = measure_order(pendulum, method, start, 0.1, steps=(79, 159))
        yield Compared(f"order, {name}", order, float(orders), 0.1)
