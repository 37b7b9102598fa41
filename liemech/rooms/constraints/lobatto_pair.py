"""The pair of Lobatto IIIA and IIIB for constrained systems: RATTLE's relatives of higher order."""

from __future__ import annotations

import functools
from typing import Any, ClassVar

from ...formulas import Mat, Vec, dot, mat, norm, plain, record, sqrt, vec, vectors
from ...formulas.numbers.sizes import magnitudes, one_norms
from ...groups.representations import squares
from ...integrators.rkmk import combination
from ...solvers import fixed_point
from ...systems.canonical import CanonicalState
from ...tableaus.collocation import lobatto_iiia, lobatto_iiib
from ...tableaus.trees import Row
from .constrained import eliminated
from .on_constraints import OnConstraints


@record
class LobattoPair(OnConstraints):
    """The Lobatto IIIA-IIIB pair of Jay with s stages, for every energy H(q, p) with constraints
    g(q) = 0:

        P_i = p_n - h sum_j b_ij (H_q(P_j, Q_j) + G(Q_j)^T L_j)          i, j = 1..s, b of IIIB
        Q_i = q_n + h sum_j a_ij H_p(P_j, Q_j),   g(Q_i) = 0             a of IIIA; Q_1 = q_n, q_n+1 = Q_s
        p_n+1 = p_n - h sum_j b_j (H_q(P_j, Q_j) + G(Q_j)^T L_j),   G(q_n+1) H_p(p_n+1, q_n+1) = 0

    order : 2, 4, 6 or 8, that is 2 s - 2.  Order 2 is RATTLE.  Symmetric, symplectic on M; both
    constraints hold to rounding, the energy oscillates without drift.  The stages are iterated
    until they change no more.

    A ConstrainedSystem is needed.  Raises NoConvergence where the step is too large,
    InconsistentState where the constraints become dependent.
    Source: Jay, SIAM J. Numer. Anal. 33 (1996), 368; Hairer, Lubich, Wanner, VII.1.5.
    """

    title: ClassVar[str] = "Lobatto IIIA-IIIB {0.order}"
    symmetric: ClassVar[bool] = True

    orders: ClassVar[tuple[int, ...]] = 2, 4, 6, 8
    order: int = 4

    @functools.cached_property
    def tableau(self) -> tuple[tuple[Row, ...], tuple[Row, ...], Row]:
        """A of IIIA, A of IIIB, and b of both."""
        a, b = lobatto_iiia(self.order // 2 + 1), lobatto_iiib(self.order // 2 + 1)
        return a.A, b.A, a.b

    def step(self, system: Any, t: float, state: CanonicalState, h: float) -> CanonicalState:
        """The stages, from the start as a guess; then into the tangent space by an impulse at the
        end.
        """
        start, b = plain(state), self.tableau[2]
        q, p, s, G = start.q, start.p, len(b), system.constraint_jacobian(start.q)
        zero = vec(*[0.0 for _ in G])
        guess = [q for _ in range(s)], [p for _ in range(s)], [zero for _ in range(s - 1)]
        Q, P, L = fixed_point(lambda stages: self._sweep(system, h, q, p, stages), guess, self, h)
        kicks = [
            system.force(Q[j], P[j]) - (L[j] @ system.constraint_jacobian(Q[j]) if j < s - 1 else 0.0 * p)
            for j in range(s)
        ]
        drift = combination(b, [system.velocity(Q[j], P[j]) for j in range(s)], h)
        kick = combination(b, kicks, h)
        impulse, pivots = system.tangent_impulse(q + drift, p + kick)
        self.check_branch(system, h, q, q + drift, p, G, pivots)
        return CanonicalState(state.q + drift, state.p + (kick + impulse))

    def _sweep(self, system: Any, h: float, q: Vec, p: Vec, stages: Any) -> tuple[Any, float | Vec, float | Vec]:
        """The next iterate of the stages, from the forces of the last ones; multipliers by Newton's method with these."""
        A, B, _ = self.tableau
        Q, P, L = stages
        s, m = len(Q), len(L[0])
        rows = [system.constraint_jacobian(Q[j]) for j in range(s)]
        normals = [system.normals(Q[j], P[j]) for j in range(s)]
        forces = [system.force(Q[j], P[j]) - L[j] @ rows[j] for j in range(s - 1)]
        ps = [p + combination(B[i], forces, h) for i in range(s)]
        speeds = [system.velocity(Q[j], ps[j]) for j in range(s)]
        qs = [q if i == 0 else q + combination(A[i], speeds, h) for i in range(s)]
        failing = vec(*[x for i in range(1, s) for x in system.constraint(qs[i])])
        # no exchange: all leading minors of A B are positive
        change = -eliminated(self._slope(h, rows, normals), failing)[0]
        dL = [vec(*[change[j * m + k] for k in range(m)]) for j in range(s - 1)]
        ps = [ps[i] + combination(B[i], [dL[j] @ rows[j] for j in range(s - 1)], h) for i in range(s)]
        pushed = [combination(B[i], [dL[j] @ normals[j] for j in range(s - 1)], h) for i in range(s)]
        qs = [qs[0], *[qs[i] + combination(A[i], pushed, h) for i in range(1, s)]]
        L = [L[j] - dL[j] for j in range(s - 1)]
        # momenta follow from positions
        blocks = _of_positions(system.unit_blocks, len(q))
        if len(blocks) == 1:
            off = sqrt(squares([magnitudes(a - b) for a, b in zip(qs, Q)]))
            return (qs, ps, L), off, norm(magnitudes(q)) + norm(magnitudes(qs[s - 1] - q))
        off = vec(*[0.0 for _ in blocks])
        for new, old in zip(qs, Q):
            off = off + one_norms(new - old, blocks)
        return (qs, ps, L), off, one_norms(q, blocks) + one_norms(qs[s - 1] - q, blocks)

    def _slope(self, h: float, rows: list[Mat], normals: list[Mat]) -> Mat:
        """The derivatives of the g(Q_i), i = 2..s, by the -L_j, j = 1..s-1, through the momenta."""
        A, B, _ = self.tableau
        s, m = len(rows), len(rows[0])
        slope_rows: list[Vec] = []
        for i in range(1, s):
            for k in range(m):
                row = [
                    (h * h * _entry(A, B, i, j)) * dot(rows[i][k], normals[j][l])
                    for j in range(s - 1)
                    for l in range(m)
                ]
                slope_rows = [*slope_rows, vec(*row)]
        return mat(*slope_rows)


def _entry(A: tuple[Row, ...], B: tuple[Row, ...], i: int, j: int) -> float:
    """The entry i, j of the matrix product A B."""
    return vectors.sum([A[i][k] * B[k][j] for k in range(len(A))])


def _of_positions(blocks: tuple[int, ...], n: int) -> tuple[int, ...]:
    """The blocks of positions and momenta that n positions fill."""
    position_blocks: list[int] = []
    filled = 0
    for size in blocks:
        if filled < n:
            position_blocks = [*position_blocks, size]
        filled = filled + size
    return tuple(position_blocks)
