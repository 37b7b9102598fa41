"""Toda's lattice by its Lax form, and the full symmetric Toda flow."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from ...formulas import Mat, Vec, mat, real_array, record, vec
from ...formulas.classes.derived import closed_form_of
from ...formulas.large import Large
from ...formulas.numbers.bases import InMemory
from ...groups.matrices.matrix_group import whole_number
from ...systems.equations.isospectral_flow import IsospectralFlow
from ...systems.lie_poisson import BodyState


@record
class TodaFlow(IsospectralFlow):
    """The full symmetric Toda flow: L' = [B, L] with B the part of L above its diagonal less that below.

    n : the number of rows, at least 2.
    Where L is tridiagonal, with b on its diagonal and a beside it, this is the open lattice of Toda in
    Flaschka's variables, a_i' = a_i (b_i+1 - b_i), b_i' = 2 (a_i^2 - a_i-1^2): `lattice` makes such a
    matrix of positions and momenta.  In the long run L becomes diagonal, its eigenvalues in descending
    order.

    Conserved: the eigenvalues.  `exact` is the motion in closed form.

    Source: Deift, Li, Nanda, Tomei, The Toda flow on a generic orbit is integrable, Comm. Pure Appl.
    Math. 39 (1986); Symes, Physica D 4 (1982) 275; Flaschka, Phys. Rev. B 9 (1974) 1924.
    """

    n: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "n", whole_number(type(self).__name__, self.n, 2))
        super().__post_init__()

    @property
    def size(self) -> int:
        return self.n

    @cached_property
    def _signs(self) -> Large:
        """-1 above the diagonal, 1 below."""
        i = np.arange(self.n)
        return Large(np.sign(i[:, None] - i))

    def velocity_matrix(self, m: Mat) -> Mat:
        """X = -B.  m : (n, n)."""
        # skew to the bit, else what rounding has left beside symmetry would grow with the flow
        if isinstance(m, InMemory):
            signed: Any = self._signs * m
            return 0.5 * (signed - signed.T)
        n = range(self.n)
        mean = lambda i, j: 0.5 * (m[i, j] + m[j, i])  # noqa: E731
        sign = lambda i, j: -1.0 if i < j else 1.0  # noqa: E731
        return mat(*[vec(*[0.0 if i == j else sign(i, j) * mean(i, j) for j in n]) for i in n])

    def lattice(self, q: Any, p: Any) -> BodyState:
        """The state of the open lattice with these positions and momenta, (n,) each."""
        q, p = (real_array(x, f"TodaFlow.lattice: {name}") for name, x in (("q", q), ("p", p)))
        a = 0.5 * np.exp(0.5 * (q[:-1] - q[1:]))
        return self.state(np.diag(-0.5 * p) + np.diag(a, 1) + np.diag(a, -1))

    @closed_form_of("velocity_matrix")
    def exact(self, start: BodyState, t: Any) -> np.ndarray:
        """L row by row at the times t, (m,) or a number: Q^T L_0 Q with exp(t L_0) = Q R,
        in the axes of L_0.  (m, n^2) or (n^2,).

        Source: Symes, Physica D 4 (1982) 275.
        """
        values, vectors = np.linalg.eigh(self.matrix(np.asarray(start.mu)))
        matrices = []
        for time in np.atleast_1d(real_array(t, "TodaFlow.exact: t")):
            order = np.argsort(-time * values, kind="stable")  # large rows first, for small ones to count
            l = values[order]
            q, r = np.linalg.qr(np.exp(time * (l - l[0]))[:, None] * vectors.T[order])
            q = q * np.where(np.diag(r) < 0.0, -1.0, 1.0)
            matrices.append((q.T @ (l[:, None] * q)).ravel())
        return np.array(matrices) if np.ndim(t) else matrices[0]

    def of_flaschka(self, mu: Vec) -> np.ndarray:
        """a and b of a tridiagonal L, (2 n - 1,), as `TodaLattice` has them.  mu : (n^2,)."""
        l = self.matrix(np.asarray(mu))
        return np.concatenate([np.diag(l, 1), np.diag(l)])
