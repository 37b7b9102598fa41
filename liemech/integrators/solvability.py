"""How large the step of a variational method may be, and which of several solutions of its equation
belongs to the motion.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from ..formulas import Mat, Vec, acos, cos, dot, sqrt, vec, vectors, where
from ..formulas.elimination import keep_sign, triangular
from ..groups.retractions import Cayley, CayleyAdjoint, Exponential, Retraction
from ..groups.rigid.so3 import SO3Algebra
from ..systems.kinetic_energy import has_inertia

HALF_TURN, WHOLE_TURN, THIRD = math.pi, 2.0 * math.pi, 2.0 * math.pi / 3.0

CONTRACTION = 1.0 / 16.0
"""A branch is followed in pieces on which Newton's corrections shrink to a quarter of their length,
or less; this is the square.
"""

LEAP, MISS = 1.0 / 4.0, 1.0 / 64.0
"""Squares: along one piece the displacement changes by at most half a radian, by an eighth more than foreseen."""

SHORTEST = 2.0**-24
"""The part of a step below which a branch that cannot be followed is said to have ended."""

ROUNDING = 2.0**-100
"""A displacement below this, squared, relative to the size of a configuration, is rounding: four
units in the last place.
"""

LEAST = 2.0**-104
"""An error below this, squared, relative to the displacement, is rounding."""

INFINITY = math.inf

MOST = 500.0
"""Corrections of Newton's method in a step after which it is given up."""


def turns_freely(system: Any, retraction: Retraction) -> bool:
    """Whether it is known how large a step may be, as for kinetic energies on so(3), with the
    exponential and the Cayley map.
    """
    usual = isinstance(retraction, (Exponential, Cayley, CayleyAdjoint))
    return usual and has_inertia(system.lagrangian) and isinstance(system.group.algebra, SO3Algebra)


def largest_impulse(inertia: Vec | Mat, retraction: Retraction) -> float:
    """The h|mu| up to which the step of a body that turns freely has one solution, whatever the
    direction of mu.

    That of the `first_fold`; for the exponential not above 2 pi J_1, where a whole turn about the
    first axis is complete.
    inertia : (3,) or (3, 3), in kg m^2; the result is in kg m^2, too.
    Source: as for `first_fold`.
    """
    limit = first_fold(inertia, retraction)
    return min(limit, WHOLE_TURN * _sorted(inertia)[0]) if isinstance(retraction, Exponential) else limit


def first_fold(inertia: Vec | Mat, retraction: Retraction) -> float:
    """An h|mu| below which no step lies on a fold, where two solutions meet, whatever the direction
    of mu.

        pi max(J_1, sqrt(J_1 J_2 min(1, (J_1 + J_2)/J_3))),   J_1 <= J_2 <= J_3;   infinite for Cayley if `is_always_solvable`

    pi J_1 is proved for the exponential: x = h xi obeys x . J x = h mu . x, so
    |x| <= h|mu|/J_1 <= pi, and in that ball the derivative of J x - (dexp_x)* h mu has a symmetric
    part of at least J_1 - h|mu| (1 - sin|x|/|x|)/|x| >= 0: no two roots. The rest is a search over
    bodies: the least h|mu| at which the derivative is singular is larger, by 29 % or more for
    bodies that obey the triangle inequality (the disc 1, 1, 2 has the least).

    inertia : (3,) or (3, 3), in kg m^2; the result is in kg m^2, too.
    Source: Ortega and Rheinboldt, Iterative Solution of Nonlinear Equations in Several Variables,
    section 5.4 (monotone maps).
    """
    J = _sorted(inertia)
    if not isinstance(retraction, Exponential) and is_always_solvable(J):
        return INFINITY
    return HALF_TURN * max(J[0], sqrt(J[0] * J[1] * min(1.0, (J[0] + J[1]) / J[2])))


def _sorted(inertia: Vec | Mat) -> Vec:
    """The three principal moments, ascending.  (3,)"""
    if isinstance(inertia, vectors.Mat):
        return principal_moments(inertia)
    low, high = min(inertia[0], inertia[1]), max(inertia[0], inertia[1])
    return vec(min(low, inertia[2]), max(low, min(high, inertia[2])), max(high, inertia[2]))


def surely_solvable(inverse: Vec | Mat) -> float:
    """(pi/|J^-1|)^2 <= (pi J_1)^2, quickly: a lower bound of the square of `first_fold`.
    inverse : J^-1, (3,) or (3, 3).
    """
    if isinstance(inverse, vectors.Mat):
        square = dot(inverse[0], inverse[0]) + dot(inverse[1], inverse[1]) + dot(inverse[2], inverse[2])
    else:
        square = dot(inverse, inverse)
    return HALF_TURN * HALF_TURN / square


def is_always_solvable(moments: Vec) -> bool:
    """Whether the step with the Cayley map has one solution for every h and mu.  A sufficient condition on
    the principal moments, (3,).

    With x = h xi/2 the equation is F(x) = J x + x cross J x + (x . J x) x = h mu/2.  F grows in all
    directions; if det DF > 0 everywhere, it maps space onto space one to one.  Of this polynomial
    in the x_i^2, only the coefficients k_ij of x_i^2 x_j^2,

        k_ij = 4 J_i J_j (J_i + J_j) + 8 J_1 J_2 J_3 - J_k (J_i^2 + J_j^2),   beside   k_i = J_i (4 J_i^2 + 3 J_j J_k)   of x_i^4,

    can be negative.  The condition is that this quadratic form is not negative where no x_i^2 is,
    for which k_ij >= -2 (k_i k_j)^(1/2) is enough here: where two of the k_ij come near that bound,
    the third is at least 2 (k_i k_j)^(1/2).
    It holds for all bodies that obey the triangle inequality and whose moments differ by a factor
    of less than 70; det DF does vanish for rods beyond 1:135.

    Source: Ortega and Rheinboldt, section 5.3 (Hadamard's theorem); Hadeler, Linear Algebra Appl.
    49 (1983), 79 (copositivity).
    """
    most = max(moments[0], max(moments[1], moments[2]))
    a, b, c = moments[0] / most, moments[1] / most, moments[2] / most
    ra, rb, rc = (
        sqrt(a * (4.0 * a * a + 3.0 * b * c)),
        sqrt(b * (4.0 * b * b + 3.0 * c * a)),
        sqrt(c * (4.0 * c * c + 3.0 * a * b)),
    )
    ab, bc, ca = _mixed(a, b, c), _mixed(b, c, a), _mixed(c, a, b)
    return min(ab + ra * rb, min(bc + rb * rc, ca + rc * ra)) >= 0.0


def _mixed(a: float, b: float, c: float) -> float:
    """Half of k_ij, symmetric in the moments a and b."""
    return 2.0 * a * b * (a + b) + 4.0 * a * b * c - 0.5 * c * (a * a + b * b)


def principal_moments(inertia: Mat) -> Vec:
    """The eigenvalues of a symmetric matrix, (3, 3), ascending, to 1e-8 of the largest, much better
    if no two are equal.

    Source: Smith, Communications of the ACM 4 (1961), 168.
    """
    J = inertia
    mean = (J[0, 0] + J[1, 1] + J[2, 2]) / 3.0
    a, b, c = J[0, 0] - mean, J[1, 1] - mean, J[2, 2] - mean
    u, v, w = J[1, 2], J[0, 2], J[0, 1]
    spread = sqrt((a * a + b * b + c * c + 2.0 * (u * u + v * v + w * w)) / 6.0)
    if spread == 0.0:
        return vec(mean, mean, mean)
    a, b, c, u, v, w = a / spread, b / spread, c / spread, u / spread, v / spread, w / spread
    half = 0.5 * (a * (b * c - u * u) - w * (w * c - u * v) + v * (w * u - b * v))
    angle = acos(max(-1.0, min(1.0, half))) / 3.0
    most, least = mean + 2.0 * spread * cos(angle), mean + 2.0 * spread * cos(angle + THIRD)
    least = max(least, 0.0)
    return vec(least, 3.0 * mean - most - least, most)


def grown(trial: Callable[..., Any], first: Vec, guess: Vec, most: float = INFINITY) -> tuple[Vec, float]:
    """The solution that grows out of zero with the step h, and the part of h up to which it does, 1 or less.

    trial : at a part s of the step, an unknown, the solution so far and the size of Newton's correction before, infinite
    for the first one: the corrected unknown, the size of its correction, may it be trusted, and has it settled?  If not to
    be trusted, half as much of the way is tried.  first : the unknown over s, which is followed, at s = 0.  guess : of the
    whole step.  most : corrections.

    Source: Deuflhard, Newton Methods for Nonlinear Problems, section 5.1 (with the simplest prediction).
    """
    x, slope, y = 0.0 * first, first, guess
    reached, piece, before, tried = 0.0, 1.0, INFINITY, 0.0
    while reached < 1.0 and piece > SHORTEST and tried < most:
        part = min(1.0, reached + piece)
        new, size, good, done = trial(part, part * y, x, before)
        if not good:
            y, piece, before = slope, 0.5 * piece, INFINITY
        elif done:
            x, reached, piece, before = new, part, 2.0 * piece, INFINITY
            slope = y = new / part
        else:
            y, before = new / part, size
        tried = tried + 1.0
    return x, reached


def stays_near(x: Vec, former: Vec, size: float, before: float) -> bool:
    """Whether a corrected displacement is still near the former one, in proportion if that is large, and the first of the
    squared corrections is small, each of the next ones much smaller.
    """
    leap, scale = x - former, 1.0 + dot(former, former) / 16.0
    small = size <= where(before < INFINITY, CONTRACTION * before, MISS * scale)
    return small and dot(leap, leap) <= LEAP * scale


def is_upright(jacobian: Mat, rate: float) -> bool:
    """Whether the determinant has the sign of rate times a positive inertia, as on the whole branch from h = 0."""
    return keep_sign(triangular([*jacobian])[1], rate)
