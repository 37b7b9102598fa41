"""Points and axes of two bodies as functions of their poses [[R, p], [0, 1]], with derivatives: what joints are made
of.
"""

from __future__ import annotations

from ..formulas import Mat, Vec, atan2, cross, dot, mat, sqrt, transpose, vec
from ..groups.rigid.se3 import join

GROUND = mat(vec(1.0, 0.0, 0.0, 0.0), vec(0.0, 1.0, 0.0, 0.0), vec(0.0, 0.0, 1.0, 0.0), vec(0.0, 0.0, 0.0, 1.0))
REST = vec(0.0, 0.0, 0.0)
REST6 = vec(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

PARALLEL = 2.0**-40
"""The squared length of the difference of two directions up to which no direction across them is defined."""


def pose(g: Vec, body: int) -> Mat:
    """The pose of a body from the entries of the poses of all bodies, row by row."""
    return mat(*[vec(*[g[16 * body + 4 * i + j] for j in range(4)]) for i in range(4)])


def rotation(g: Mat) -> Mat:
    """The rotation R of a pose, (3, 3)."""
    return mat(*[vec(g[i, 0], g[i, 1], g[i, 2]) for i in range(3)])


def hung(turn: Mat, at_first: Vec, at_second: Vec) -> Mat:
    """The pose with the rotation `turn` that puts the point `at_first` of a body on the point `at_second` of the other."""
    p = at_second - turn @ at_first
    return mat(*[vec(*turn[i], p[i]) for i in range(3)], vec(0.0, 0.0, 0.0, 1.0))


def carrying(axes: tuple[Vec, ...], others: tuple[Vec, ...]) -> Mat:
    """The rotation that carries three axes to three others."""
    return transpose(mat(*others)) @ mat(*axes)


# ------------------------------------------------------------------ points and axes


def turned(g: Mat, e: Vec) -> Vec:
    """R e: a direction of the body, seen from space."""
    return vec(*[g[i, 0] * e[0] + g[i, 1] * e[1] + g[i, 2] * e[2] for i in range(3)])


def place(g: Mat, a: Vec) -> Vec:
    """p + R a: a point of the body, in space."""
    return vec(g[0, 3], g[1, 3], g[2, 3]) + turned(g, a)


def seen(g: Mat, n: Vec) -> Vec:
    """R^T n: a direction of space, seen from the body."""
    return vec(*[g[0, i] * n[0] + g[1, i] * n[1] + g[2, i] * n[2] for i in range(3)])


def along(g: Mat, a: Vec, n: Vec) -> Vec:
    """The derivative of n . (p + R a), (a x R^T n, R^T n).  n : fixed in space."""
    f = seen(g, n)
    return join(cross(a, f), f)


def turning(g: Mat, e: Vec, n: Vec) -> Vec:
    """The derivative of n . R e, (e x R^T n, 0)."""
    return join(cross(e, seen(g, n)), REST)


def crossed(g: Mat, u: Vec, k: Mat, e: Vec) -> tuple[Vec, Vec]:
    """The derivatives of R u . S e by both poses."""
    return turning(g, u, turned(k, e)), turning(k, e, turned(g, u))


def between(a: Vec, b: Vec) -> float:
    """The angle between two unit vectors, from 0 to pi."""
    n = cross(a, b)
    return atan2(sqrt(dot(n, n)), dot(a, b))


def turned_by(g: Mat, k: Mat, attitude: Mat) -> float:
    """The angle, from 0 to pi, between the attitude of the first body and S A, at which the second one holds it."""
    turn = transpose(rotation(g)) @ rotation(k) @ transpose(attitude)
    n = vec(turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1])
    return atan2(sqrt(dot(n, n)), turn[0, 0] + turn[1, 1] + turn[2, 2] - 1.0)


def shift(g: Mat, a: Vec, k: Mat, b: Vec, e: Vec) -> tuple[Vec, Vec]:
    """The derivatives of S e . (x_1 - x_2) by both poses, e an axis of the second body."""
    n, d = turned(k, e), place(g, a) - place(k, b)
    return along(g, a, n), turning(k, e, d) - along(k, b, n)


def across(axis: Vec) -> tuple[Vec, Vec]:
    """Two unit vectors at right angles to a unit vector and to each other.

    Source: Duff et al., Building an orthonormal basis, revisited, J. Comput. Graph. Tech. 6 (2017).
    """
    x, y, z = axis
    sign = 1.0 if z >= 0.0 else -1.0
    a = -1.0 / (sign + z)
    b = x * y * a
    return vec(1.0 + sign * x * x * a, sign * b, -sign * x), vec(b, sign + y * y * a, -y)


def beside(axis: Vec, other: Vec) -> Vec:
    """The unit vector at right angles to an axis that is nearest to another direction; any if both are parallel."""
    d = other - dot(axis, other) * axis
    square = dot(d, d)
    far = square > PARALLEL
    length = 1.0 / sqrt(square if far else 1.0)
    u = across(axis)[0]
    return vec(*[(length * x if far else y) for x, y in zip(d, u)])
