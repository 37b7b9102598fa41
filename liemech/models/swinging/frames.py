"""Orthonormal vectors in a uniform field: motion on Stiefel manifolds, from the sphere to the rotations."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from ...errors import InvalidInput
from ...formulas import Mat, Vec, dot, mat, real_array, record, transpose, vec
from ...formulas.classes.derived import closed_form_of
from ...groups.matrices.matrix_functions import expm
from ...rooms.constraints.constrained import SeparableConstrainedSystem
from ..input_checks import check_positive


@record
class OrthonormalFrame(SeparableConstrainedSystem):
    """k orthonormal vectors in R^n, the columns of Q, in a uniform field:
    H(Q, P) = tr(P^T P)/(2 m) + tr(F^T Q), Q^T Q = 1.

    field : F, (n, k), in N where Q is in m.  mass : m, in kg.
    q : Q by rows, (n k,).  p : P = m Q' by rows.
    With k = 1 a spherical pendulum of length 1, with k = n a rotation and reflections apart from
    it.  Its geodesics are known.

    Source: Edelman, Arias, Smith, SIAM J. Matrix Anal. Appl. 20 (1998), 303, section 2.2.
    """

    linear_velocity: ClassVar[bool] = True

    field: Mat
    mass: float = 1.0

    def __post_init__(self) -> None:
        shape = real_array(self.field, "OrthonormalFrame: field").shape
        if len(shape) != 2 or shape[0] < shape[1]:
            raise InvalidInput(f"OrthonormalFrame: field is (n, k) with k at most n; got {shape}")
        check_positive(self, "mass")
        super().__post_init__()

    @property
    def degrees(self) -> int:  # type: ignore[override]
        """The number n k of entries of the frame."""
        return len(self.field) * len(self.field[0])

    def _matrix(self, x: Vec) -> Mat:
        """The n by k matrix with these rows."""
        k = len(self.field[0])
        return mat(*[vec(*[x[k * i + a] for a in range(k)]) for i in range(len(self.field))])

    def kinetic(self, p: Vec) -> float:
        """tr(P^T P)/(2 m), in J.  p : (n k,)."""
        return dot(p, p) / (2.0 * self.mass)

    def potential(self, q: Vec) -> float:
        """tr(F^T Q), in J.  q : (n k,)."""
        return dot(vec(*[x for row in self.field for x in row]), q)

    def velocity(self, q: Vec, p: Vec) -> Vec:
        """P/m.  q, p : (n k,)."""
        return (1.0 / self.mass) * p

    def force(self, q: Vec, p: Vec) -> Vec:
        """-F.  q, p : (n k,)."""
        return vec(*[-x for row in self.field for x in row])

    def constraint(self, q: Vec) -> Vec:
        """(Q^T Q - 1)/2 on the diagonal, Q^T Q above it, (k (k + 1)/2,).  q : (n k,)."""
        columns = transpose(self._matrix(q))
        pairs = [(a, b) for a in range(len(columns)) for b in range(a, len(columns))]
        return vec(
            *[0.5 * (dot(columns[a], columns[a]) - 1.0) if a == b else dot(columns[a], columns[b]) for a, b in pairs]
        )

    @closed_form_of("kinetic", "constraint")
    def geodesic(self, q: Vec, p: Vec, t: float) -> tuple[Vec, Vec]:
        """The motion without the field: positions and momenta after the time t.  q, p : (n k,).

            Q(t) = (Q V) e^(tB) (1; 0) e^(-tA),   V(t) = (Q V) e^(tB) (0; 1) e^(-tA),   B = (A -V^T V; 1 A),   A = Q^T V

        Source: Edelman, Arias, Smith, section 2.2.2, (2.42).
        """
        Q, V = self._matrix(q), self._matrix(self.velocity(q, p))
        k = len(Q[0])
        A, S = transpose(Q) @ V, transpose(V) @ V
        upper = [vec(*[A[a, b] for b in range(k)], *[-S[a, b] for b in range(k)]) for a in range(k)]
        lower = [vec(*[1.0 if a == b else 0.0 for b in range(k)], *[A[a, b] for b in range(k)]) for a in range(k)]
        moved = mat(*[vec(*x, *v) for x, v in zip(Q, V)]) @ expm(t * mat(*upper, *lower))
        turned = expm((-t) * A)
        ends = [mat(*[vec(*[row[j] for j in range(i, i + k)]) for row in moved]) @ turned for i in (0, k)]
        rows = [vec(*[x for row in end for x in row]) for end in ends]
        return rows[0], self.mass * rows[1]

    def constants(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The energy and the constraints; without a field the angular momentum too, Q P^T - P Q^T
        above its diagonal.
        """
        constants, n, k = super().constants(states), len(self.field), len(self.field[0])
        if not np.array(self.field).any():
            Q, P = (states[name].reshape(*states[name].shape[:-1], n, k) for name in ("q", "p"))
            whole = Q @ P.swapaxes(-1, -2) - P @ Q.swapaxes(-1, -2)
            constants |= {"angular momentum": whole[(..., *np.triu_indices(n, 1))]}
        return constants
