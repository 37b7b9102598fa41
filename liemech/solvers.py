"""The one Newton iteration: when it stops, and what it says when it does not converge."""

from __future__ import annotations

from .native import Mat, Vec, cross, dot, solve, solve3

TOLERANCE = 2.0**-30
"""A residual below this, relative to the data, means that the correction it asks for is the last one needed.

Newton's method squares the relative error, so one more correction leaves about 2^-60: below rounding, and without the energy drift
that stopping *at* a tolerance causes.
"""

LIMIT = 50
"""Iterations after which a step is declared unsolvable; a good step needs two or three."""


def correction(jacobian: Mat, residual: Vec) -> Vec:
    """What Newton's method subtracts: jacobian^-1 residual.  jacobian : (n, n), residual : (n,)."""
    return solve3(jacobian, residual) if len(residual) == 3 else solve(jacobian, residual)


def beyond_fold(jacobian: Mat, rate: float) -> bool:
    """Has the determinant the sign that it cannot have on the branch from h = 0?  Told in three dimensions only.

    jacobian : (n, n), there rate times a positive matrix.
    """
    if len(jacobian) != 3:
        return False
    a, b, c = jacobian.T
    return rate * dot(a, cross(b, c)) <= 0.0
