"""Jacobi's elliptic functions by their complementary modulus k', accurate however close k' is to 0,
and the way back to their argument.

Source: DLMF 22.7 (descending Landen transformations), 22.4 (half periods) and 19.25 (the argument
as R_F).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ...formulas import Vec, vec
from .carlson import elliprf
from .exact_rigid_body import _means
from .polhode import elliptic, nearest

LEAST = 2.0**-250
"""Below this k' the half period is 348 and more, and functions are those of k' = 0 up to there."""


class Jacobi(NamedTuple):
    """The functions of one modulus: the pairs (a, b) of the arithmetic-geometric mean of 1 and k', the mean, and k'."""

    a: Vec
    b: Vec
    least: float
    k1: float

    @classmethod
    def of_modulus(cls, k1: float) -> Jacobi:
        """The functions of the complementary modulus k', 0 <= k' <= 1."""
        if k1 < LEAST:
            return cls(vec(1.0), vec(1.0), 0.0, 0.0)
        means = _means(k1)
        a, b = zip(*means, strict=True)
        return cls(vec(*a), vec(*b), means[-1][0], k1)

    @property
    def half(self) -> float:
        """2 K, half a period of sn and cn; infinite for k' = 0."""
        return math.pi / self.least if self.k1 else math.inf

    def argument(self, s: float, c: float) -> float:
        """The u between -K and K with sn u = s, cn u = c >= 0."""
        if not self.k1:
            return math.asinh(s / c) if c else math.copysign(math.inf, s)
        return s * elliprf(c * c, c * c + (self.k1 * s) ** 2, 1.0)

    def functions(self, u: Any) -> tuple[Any, Any, Any, Any]:
        """sn, cn >= 0 and dn of u less whole half periods, and the number of these.  u : (...)."""
        u = np.asarray(u, dtype=float)
        if not self.k1:
            decay = np.exp(-np.abs(u))
            c = 2.0 * decay / (1.0 + decay * decay)
            return np.tanh(u), c, c, np.zeros_like(u)
        turns = nearest(u / self.half)
        argument_left, modulus = u - turns * self.half, self  # type: Any, Any
        return *elliptic(modulus, np.where(np.abs(argument_left) <= self.half, argument_left, 0.0)), turns
