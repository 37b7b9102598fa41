"""From a rotation matrix back to its axis and angle, by way of the unit quaternion.

Accurate for every angle from 0 to pi, both included.  The formula (theta/(2 sin theta))
vee(R - R^T) of the textbooks loses all digits at pi, and the angle from arccos((tr R - 1)/2) loses
half of them at 0.
"""

from __future__ import annotations

from typing import Any

from ...formulas import Mat, Vec, atan2, constant, dot, sqrt, vec, where
from ...formulas.numbers.double_double import is_long
from ...formulas.numbers.dual import is_series, value_of
from ...formulas.removable import atan_root_over
from .rotation_coefficients import ARCSINE, ARCSINE_LIMIT, polynomial


def rotation_quaternion(R: Mat) -> Vec:
    """Unit quaternion (x, y, z, w) of a rotation matrix, scalar part last and w >= 0.

    R = (w^2 - |v|^2) 1 + 2 v v^T + 2 w hat(v) with v = (x, y, z), so the entries of R hold the
    products of the components.  The four products with one of the components are, up to a factor,
    the quaternion; a component of at least 1/2 is taken, so nothing small is divided by.  A matrix
    that is orthogonal only up to rounding gives a unit quaternion just the same.

    R : (3, 3), a rotation (not checked);  returns (4,).

    At half a turn q and -q both have w = 0; the component belonging to the largest diagonal entry
    is then positive, the first of them if several are equal.

    Source: Shepperd, Quaternion from rotation matrix, J. Guidance and Control 1 (1978), 223.
    """
    a, b, c = R[0, 0], R[1, 1], R[2, 2]
    if is_series(a + b + c):
        return _quaternion_of_series(R)
    if a + b + c >= 0.0:
        q = vec(R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1], 1.0 + (a + b + c))
    elif a >= b and a >= c:
        q = vec(1.0 + (a - b - c), R[0, 1] + R[1, 0], R[0, 2] + R[2, 0], R[2, 1] - R[1, 2])
    elif b >= c:
        q = vec(R[0, 1] + R[1, 0], 1.0 + (b - c - a), R[1, 2] + R[2, 1], R[0, 2] - R[2, 0])
    else:
        q = vec(R[0, 2] + R[2, 0], R[1, 2] + R[2, 1], 1.0 + (c - a - b), R[1, 0] - R[0, 1])
    size = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    if q[3] < 0.0:
        size = -size
    return q / size


def rotation_vector(R: Mat) -> Vec:
    """Rotation vector w of a rotation matrix, exp(hat(w)) = R: axis times angle, 0 <= |w| <= pi.

    w = 2 atan2(|v|, q_w) v/|v| for the quaternion (v, q_w); up to 0.3 rad 2 arcsin(|v|) v/|v| by a
    polynomial.  The error is below 3 eps |w| for every angle.

    R : (3, 3), a rotation (not checked);  returns (3,), radians.

    The identity gives exact zeros.  At half a turn w and -w are both right; the component belonging
    to the largest diagonal entry of R is then positive, the first of them if several are equal.
    """
    q = rotation_quaternion(R)
    v = vec(q[0], q[1], q[2])
    if is_series(q[3]):
        return _vector_of_series(v, q[3])
    square = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
    if is_long(value_of(square)):
        return _by_arctangent(v, q[3], square)
    # the polynomial in any case: the branch stands aside of the common path
    near = (2.0 * polynomial(ARCSINE, square)) * v
    return _by_arctangent(v, q[3], square) if square > ARCSINE_LIMIT else near


def _by_arctangent(v: Vec, w: Any, square: Any) -> Vec:
    """The rotation vector 2 atan2(|v|, w) v/|v| of a quaternion (v, w)."""
    if constant(square) == 0.0:  # asked before the root, which has no slope there
        return 2.0 * v  # v is zero or its square underflows; w is 1
    size = sqrt(square)
    return (2.0 * atan2(size, w) / size) * v


def _quaternion_of_series(R: Mat) -> Vec:
    """The quaternion of a matrix of power series, which go on as they begin: each component is
    chosen, not the way to all of them.
    """
    a, b, c = R[0, 0], R[1, 1], R[2, 2]
    x, y, z = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    u, v, w = R[1, 2] + R[2, 1], R[0, 2] + R[2, 0], R[0, 1] + R[1, 0]

    def chosen(scalar: Any, one: Any, two: Any, three: Any) -> Any:
        other = where(a >= b, where(a >= c, one, three), where(b >= c, two, three))
        return where(a + b + c >= 0.0, scalar, other)

    q = vec(
        chosen(x, 1.0 + (a - b - c), w, v),
        chosen(y, w, 1.0 + (b - c - a), u),
        chosen(z, v, u, 1.0 + (c - a - b)),
        chosen(1.0 + (a + b + c), x, y, z),
    )
    size = sqrt(dot(q, q))
    return q / where(q[3] < 0.0, -size, size)


def _vector_of_series(v: Vec, w: Any) -> Vec:
    """2 atan2(|v|, w) v/|v|, without the root where that is small: it has no slope at zero."""
    square = dot(v, v)
    near = 25.0 * square <= w * w
    steep = where(near, w, 1.0)
    close = atan_root_over(where(near, square, 0.0) / (steep * steep)) / steep
    size = sqrt(where(near, 1.0, square))
    return (2.0 * where(near, close, atan2(size, w) / size)) * v
