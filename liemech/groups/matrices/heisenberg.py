"""The Heisenberg groups: upper triangular matrices, whose exponential is a polynomial."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from ...formulas import Ambient, Element, Mat, Vec, dot, mat, record, vec
from ..lie_group import CayleyByExponential
from .matrix_algebra import MatrixLieAlgebra
from .matrix_group import MatrixLieGroup, named_by_size, whole_number


@record
class HeisenbergAlgebra(MatrixLieAlgebra):
    """Nilpotent: [x, [x, y]] = 0, so that every series ends after its second term.

    Source: Hall, Lie Groups, Lie Algebras, and Representations, 2nd ed., section 5.2.
    """

    def exp_Ad_star(self, xi: Vec, mu: Vec) -> Vec:
        """The coadjoint map Ad*_exp(xi) mu = mu + ad*_xi mu."""
        return mu + self.ad_star(xi, mu)

    def dexp(self, xi: Vec, eta: Vec) -> Vec:
        """The differential eta - [xi, eta]/2 of exp."""
        return eta + self.bracket(-0.5 * xi, eta)

    def dexp_dual(self, xi: Vec, mu: Vec) -> Vec:
        """The transposed differential mu - ad*_xi mu/2."""
        return mu + self.ad_star(-0.5 * xi, mu)

    def dexp_inv(self, xi: Vec, eta: Vec) -> Vec:
        """The inverse differential eta + [xi, eta]/2."""
        return self.dexp(-xi, eta)

    def dexp_inv_dual(self, xi: Vec, mu: Vec) -> Vec:
        """The transposed inverse differential mu + ad*_xi mu/2."""
        return self.dexp_dual(-xi, mu)

    def exp_residual(self, xi: Vec, p: Vec, mu: Vec) -> tuple[Vec, float | Mat, Mat]:
        """r = p - mu - ad*_xi mu/2, linear in xi."""
        return p - self.dexp_dual(-xi, mu), 1.0, -0.5 * self._ad_star_of_basis(mu)

    # the Cayley map is the exponential one
    cayley_Ad_star, cayley_residual = exp_Ad_star, exp_residual
    dcayley, dcayley_dual, dcayley_inv, dcayley_inv_dual = dexp, dexp_dual, dexp_inv, dexp_inv_dual


@record
class Heisenberg(CayleyByExponential, MatrixLieGroup):
    """H_2n+1, the matrices [[1, q, z], [0, 1, p], [0, 0, 1]] with a row q and a column p of n
    numbers, and a number z.

    Coordinates are (q_1, ..., q_n, p_1, ..., p_n, z), with [Q_i, P_i] = Z and nothing else.  Since
    the product of any three matrices of the algebra is zero, exp x = 1 + x + x^2/2, the Cayley map
    is the same, and [x, [x, y]] = 0 ends every series.  The component of the momentum along Z is
    the Casimir function; there is no invariant form.

    n : pairs of coordinates; matrices have n + 2 rows.
    Source: Hall, Lie Groups, Lie Algebras, and Representations, 2nd ed., sections 1.2 and 5.2.
    """

    n: int = 1

    __repr__ = named_by_size

    def __post_init__(self) -> None:
        object.__setattr__(self, "n", whole_number(type(self).__name__, self.n, 1))

    @cached_property
    def generators(self) -> np.ndarray:
        """Q_i = E_0i, P_i = E_i,n+1, Z = E_0,n+1, rows and columns counted from 0."""
        n, i = self.n, np.arange(self.n)
        e = np.zeros((2 * n + 1, n + 2, n + 2))
        e[i, 0, 1 + i] = e[n + i, 1 + i, n + 1] = e[2 * n, 0, n + 1] = 1.0
        return e

    @cached_property
    def algebra(self) -> MatrixLieAlgebra:
        return HeisenbergAlgebra(self)

    # ---------------------------------------------------------------- group

    def inverse(self, g: Element) -> Element:
        """[[1, -q, q p - z], [0, 1, -p], [0, 0, 1]]."""
        q, p, z = self._parts(g)
        return self._element(-q, -p, dot(q, p) - z)

    def exp(self, xi: Vec) -> Element:
        """[[1, q, z + q p/2], [0, 1, p], [0, 0, 1]]."""
        q, p, z = self._split(xi)
        return self._element(q, p, z + 0.5 * dot(q, p))

    def compose_exp(self, g: Element, xi: Vec) -> Element:
        """The product g exp(xi), where q and p are added."""
        q, p, z = self._parts(g)
        dq, dp, dz = self._split(xi)
        return self._element(q + dq, p + dp, z + (dz + 0.5 * dot(dq, dp) + dot(q, dp)))

    def log(self, g: Element) -> Vec:
        """(q, p, z - q p/2)."""
        q, p, z = self._parts(g)
        return vec(*q, *p, z - 0.5 * dot(q, p))

    def Ad(self, g: Element, xi: Vec) -> Vec:
        """xi + [log g, xi]."""
        return xi + self.algebra.bracket(self.log(g), xi)

    def Ad_star(self, g: Element, mu: Vec) -> Vec:
        """mu + ad*_log g mu."""
        return mu + self.algebra.ad_star(self.log(g), mu)

    def casimirs(self, mu: Vec) -> Vec:
        """The only Casimir, the momentum along Z."""
        return vec(mu[2 * self.n])

    @property
    def unit_blocks(self) -> tuple[int, ...]:
        """The momenta along Q, along P and along Z."""
        return (self.n, self.n, 1)

    def further_invariants(self, mu: Any) -> tuple[float, ...]:
        """All components where that along Z is zero: such orbits are points.  All others are
        planes.
        """
        return () if mu[-1] else tuple(mu.tolist())

    def nearest(self, g: Ambient) -> Element:
        """The element of least |h - g|: that with the same q, p and z."""
        return self._element(*self._parts(g))

    # ---------------------------------------------------------------- parts

    def _split(self, xi: Vec) -> tuple[Vec, Vec, float]:
        n = self.n
        return xi[:n], xi[n : 2 * n], xi[2 * n]

    def _parts(self, g: Mat) -> tuple[Vec, Vec, float]:
        n = self.n
        return (vec(*[g[0, i + 1] for i in range(n)]), vec(*[g[i + 1, n + 1] for i in range(n)]), g[0, n + 1])

    def _element(self, q: Vec, p: Vec, z: float) -> Mat:
        n = self.n
        rows = [vec(0.0, *[1.0 if i == j else 0.0 for j in range(n)], p[i]) for i in range(n)]
        return mat(vec(1.0, *q, z), *rows, vec(*[0.0] * (n + 1), 1.0))
