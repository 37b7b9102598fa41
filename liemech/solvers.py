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


def orientation(jacobian: Mat) -> float:
    """The determinant, or a number of its sign: negative beyond a fold.  1 where it would cost too much.  jacobian : (n, n)."""
    if len(jacobian) != 3:
        return 1.0
    a, b, c = jacobian.T
    return dot(a, cross(b, c))
