"""The one Newton iteration: when it stops, and what it says when it does not converge."""

from __future__ import annotations

from collections.abc import Callable

from .native import Mat, Vec, cross, dot, mat, solve, solve3, vec

TOLERANCE = 2.0**-30
"""A residual below this, relative to the data, means that the correction it asks for is the last one needed.

Newton's method squares the relative error, so one more correction leaves about 2^-60: below rounding, and without the energy drift
that stopping *at* a tolerance causes.
"""

LIMIT = 50
"""Iterations after which a step is declared unsolvable; a good step needs two or three."""


def newton(
    equation: Callable[[Vec], tuple[Vec, Mat, float]], guess: Vec, data: float, rate: float = 1.0
) -> tuple[Vec, float, float, bool]:
    """The root of an equation: its residual is tested against the data, and the correction that it asks for applied once more.

    equation : gives at x the residual r, its derivative and the factor w that |r|^2 has over the data.  data : a square.
    Returns x, |r|^2 at the last test, what it had to reach (w 2^-60 data, else x is no root), and whether x is `beyond_fold`.
    """
    x, goal = guess, TOLERANCE * TOLERANCE * data
    size = enough = goal
    folded = False
    for _ in range(LIMIT):
        r, jacobian, weight = equation(x)
        x, folded = x - correction(jacobian, r), beyond_fold(jacobian, rate)
        size, enough = dot(r, r), weight * goal
        if size <= enough:
            break
    return x, size, enough, folded


def correction(jacobian: Mat, residual: Vec) -> Vec:
    """What Newton's method subtracts: jacobian^-1 residual.  jacobian : (n, n), residual : (n,)."""
    if len(residual) == 3:
        return solve3(jacobian, residual)
    return solve6(jacobian, residual) if len(residual) == 6 else solve(jacobian, residual)


def solve6(m: Mat, rhs: Vec) -> Vec:
    """The solution of a 6 by 6 system by its 3 by 3 blocks: no branch, two divisions.

    With m = [[A, B], [C, D]] and rhs = (e, f):  (A - B D^-1 C) x = e - B D^-1 f,  D y = f - C x.  D must be regular, as it is in a
    Newton step, where m is close to a positive inertia over h.
    """
    A, B = _block(m, 0, 0), _block(m, 0, 3)
    C, D = _block(m, 3, 0), _block(m, 3, 3)
    last = vec(rhs[3], rhs[4], rhs[5])
    if D[0, 1] == 0.0 and D[0, 2] == 0.0 and D[1, 0] == 0.0 and D[1, 2] == 0.0 and D[2, 0] == 0.0 and D[2, 1] == 0.0:
        d = vec(1.0 / D[0, 0], 1.0 / D[1, 1], 1.0 / D[2, 2])  # an inertia, along its axes
        G, g = mat(*[d[i] * C[i] for i in range(3)]), d * last
    else:
        a, b, c = D.T
        bc = cross(b, c)
        inverse = (1.0 / dot(a, bc)) * mat(bc, cross(c, a), cross(a, b))
        G, g = inverse @ C, inverse @ last
    x = solve3(A - B @ G, vec(rhs[0], rhs[1], rhs[2]) - B @ g)
    y = g - G @ x
    return vec(*x, *y)


def _block(m: Mat, i: int, j: int) -> Mat:
    return mat(*[vec(m[k, j], m[k, j + 1], m[k, j + 2]) for k in range(i, i + 3)])


def beyond_fold(jacobian: Mat, rate: float) -> bool:
    """Has the determinant the sign that it cannot have on the branch from h = 0?  Told in three dimensions only.

    jacobian : (n, n), there rate times a positive matrix.
    """
    if len(jacobian) != 3:
        return False
    a, b, c = jacobian.T
    return rate * dot(a, cross(b, c)) <= 0.0
