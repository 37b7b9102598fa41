"""The free rigid body in closed form: momentum by Jacobi's elliptic functions, attitude by one more integral.

    mu' = mu x w,   g' = g hat(w),   w = J^{-1} mu          mu and w in the body frame, g takes body to space

The unit vector e = mu/|mu| runs along a polhode. Let J2 be the middle moment and axis 3 the one the polhode surrounds,
with e3 > 0; J1, J2, J3 then rise or fall. With G = |mu|, X = 2 E J3 - G^2, Y = G^2 - 2 E J1 and D = G^2 - 2 E J2, which
vanishes on the separatrix (all of the sign of J3 - J1, or zero),

    e = (a1 cn u, a2 sn u, a3 dn u),    u = u0 + lam t,    k'^2 = 1 - m = (J3-J1) D/((J3-J2) Y),
    lam^2 = (J3-J2) Y/(J1 J2 J3),    lam of the sign of J3 - J2,
    (G a1)^2 = J1 X/(J3-J1),    (G a2)^2 = J2 X/(J3-J2),    (G a3)^2 = J3 Y/(J3-J1).

The constant spatial momentum g mu leaves one angle of the attitude. Let P(e; p) be the rotation with rows a, e x a, e,
where a is the axis p made orthogonal to e and normalised. Then, {i, j} being the axes other than p,

    g = g(0) P(e(0))^T Rot3(psi) P(e),    psi' = G (e_i^2/J_i + e_j^2/J_j)/(e_i^2 + e_j^2),

singular only where the polhode meets the axis p. With n = J3 (J2-J1)/(J1 (J3-J2)) and N = (a1/a3)^2, n N = m,

    p = 1:  psi = G t/J3 + N sqrt((1+n)(1+N)) [T(u) - T(u0)],    T(u) = integral of sn^2/(1 + N sn^2) from 0 to u,
    p = 3:  psi = G t/J1 - n sqrt((1+n)(1+N)) [T(u) - T(u0)],    T(u) = integral of sn^2/(1 + n sn^2) from 0 to u.

Take the pole that stays at least 45 degrees away from the polhode: p = 1 if N <= 1, else p = 3. Then all coefficients
are bounded, whatever the body, and no digits cancel.

Source: Whittaker, Analytical Dynamics, 4th ed., sections 69-71; van Zon and Schofield, J. Comput. Phys. 225 (2007) 145;
Celledoni, Fasso, Safstrom and Zanna, SIAM J. Sci. Comput. 30 (2008) 2084.
"""

import math
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import ArrayLike

from .carlson import elliprf, elliprj

__all__ = ["exact_rigid_body", "momentum_period"]

# Below this k' the body counts as on the separatrix, which it would only leave after the time K/lam = 174/lam.
_SEPARATRIX = 2.0**-250

# A phase beyond 2^53 radians has lost its last digit. This bound on the time keeps it a number.
_LONGEST_TIME = 1e300


def exact_rigid_body(
    inertia: ArrayLike, mu: ArrayLike, g: ArrayLike | None, t: ArrayLike
) -> tuple[np.ndarray, np.ndarray | None]:
    """How a free rigid body spins and where it points at the times t, without integrating.

        mu' = mu x J^{-1} mu,    g' = g hat(J^{-1} mu),    from mu and g at time 0

    inertia : (3,) principal moments in any order, or (3, 3) symmetric positive definite, kg m^2; they need not satisfy
        the triangle inequality
    mu : (3,) body angular momentum at time 0, kg m^2/s
    g : (3, 3) attitude at time 0, body to space; None if the momentum is all you want
    t : any shape, s, of either sign
    Returns the momentum (..., 3) and the attitude (..., 3, 3), or None in its place.
    Raises nothing: the caller has checked the arguments. Finite arguments give finite results.

    The error is a few rounding errors times 1 + |w| t, next to the separatrix too: principal moments and mu are taken
    to be exact. Started at a small angle d from the middle axis, it is about log(1/d) times that. An inertia
    that is not diagonal is diagonalised first, with the rounding errors of its eigenvectors.

    Source: Whittaker, Analytical Dynamics, 4th ed., sections 69-71, in the form of this module's first lines.
    """
    t, mu = np.asarray(t, float), np.asarray(mu, float)
    motion, axes, unit = _motion(inertia, mu)
    tau = np.clip(_times_power_of_two(t.ravel(), -unit.time), -_LONGEST_TIME, _LONGEST_TIME)
    e, psi = motion.evolve(tau, attitude=g is not None)  # psi is None if g is
    if isinstance(motion, _Steady):
        momentum = np.broadcast_to(mu, (tau.size, 3)).copy()
    else:
        momentum = _times_power_of_two(_combine(axes.T, motion.norm * e).T, unit.momentum)
    momentum = momentum.reshape(t.shape + (3,))
    if g is None or psi is None:
        return momentum, None
    attitude = _attitude(np.asarray(g, float), axes, motion, e, psi)
    return momentum, attitude.reshape(t.shape + (3, 3))


def momentum_period(inertia: ArrayLike, mu: ArrayLike) -> float:
    """After which time the momentum of a free rigid body, seen from the body, comes back: 4 K(m)/|lam|, in s.

    inertia : (3,) or (3, 3), kg m^2;  mu : (3,), kg m^2/s, as for exact_rigid_body
    Infinite on the separatrix; 0 if the momentum stands still (steady rotation, sphere, rest): any time is a period.
    The attitude has a second frequency and in general does not come back. Raises nothing.

    Source: Whittaker, Analytical Dynamics, 4th ed., section 69.
    """
    motion, _, unit = _motion(inertia, np.asarray(mu, float))
    if isinstance(motion, _Steady):
        return 0.0
    if motion.k1 < _SEPARATRIX or motion.rate == 0.0:
        return math.inf
    return float(_times_power_of_two(4.0 * _quarter_period(_means(motion.k1)) / abs(motion.rate), unit.time))


# --- the data, in the principal frame and in units of their own -------------------------------------------------------


@dataclass(frozen=True)
class _Unit:
    """Exponents of two: in these units the largest component of the momentum and the least moment are in [1/2, 1)."""

    time: int
    momentum: int


def _motion(inertia: ArrayLike, mu: np.ndarray) -> "tuple[_Steady | _Polhode, np.ndarray, _Unit]":
    """The motion in the frame and the units that suit it; that frame, axes as rows; those units.

    The constants are rational functions of the data, or roots of such. They are computed exactly and rounded once, so
    no small difference of moments, no nearness of the separatrix and no unit of measurement spoils them.
    """
    moments, axes = _principal(np.asarray(inertia, float))
    momentum = _combine(axes, mu)
    inertia_exponent, momentum_exponent = math.frexp(min(moments))[1], math.frexp(max(abs(momentum)))[1]
    J = [Fraction(x) / Fraction(2) ** inertia_exponent for x in moments.tolist()]
    pi = [Fraction(x) / Fraction(2) ** momentum_exponent for x in momentum.tolist()]
    unit = _Unit(time=inertia_exponent - momentum_exponent, momentum=momentum_exponent)
    if all(J[i] == J[j] or not pi[i] * pi[j] for i, j in ((0, 1), (1, 2), (2, 0))):
        return _steady(J, pi), axes, unit
    J, pi, relabel = _relabelled(J, pi)
    return _polhode(J, pi), _combine(relabel, axes), unit


def _principal(inertia: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Principal moments (3,) and axes (3, 3), the axes as the rows of a rotation."""
    diagonal = inertia if inertia.ndim == 1 else np.diagonal(inertia)
    if inertia.ndim == 1 or np.array_equal(inertia, np.diag(diagonal)):
        return diagonal, np.eye(3)
    exponent = math.frexp(abs(inertia).max())[1]
    moments, vectors = np.linalg.eigh(_times_power_of_two(inertia, -exponent))
    vectors[:, 0] *= np.sign(np.linalg.det(vectors))
    # A moment below the rounding error of the largest may come out zero or negative: the matrix does not know it.
    moments = np.maximum(moments, np.finfo(float).eps * moments[2])
    return _times_power_of_two(moments, exponent), vectors.T


def _relabelled(J: list[Fraction], pi: list[Fraction]) -> tuple[list[Fraction], list[Fraction], np.ndarray]:
    """Moments and momentum in the order of the formulas, and the rotation (rows: new axes) that orders them so."""
    order = sorted(range(3), key=lambda i: J[i])
    if _separatrix_side(J, pi, J[order[1]]) < 0:
        order.reverse()
    sign = [1, 1 if (order[1] - order[0]) % 3 == 1 else -1, 1]
    if pi[order[2]] < 0:
        sign[1], sign[2] = -sign[1], -sign[2]
    rotation = np.zeros((3, 3))
    rotation[range(3), order] = sign
    return [J[i] for i in order], [s * pi[i] for s, i in zip(sign, order, strict=True)], rotation


def _separatrix_side(J: list[Fraction], pi: list[Fraction], J2: Fraction) -> Fraction:
    """D = G^2 - 2 E J2: positive if the polhode surrounds the axis of the largest moment, negative if of the least."""
    return sum((p * p * (j - J2) / j for j, p in zip(J, pi, strict=True)), Fraction(0))


# --- the two kinds of motion ------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Steady:
    """Momentum and velocity are parallel: e stays, psi = rate t."""

    e0: tuple[float, ...]
    pole: int
    rate: float

    def evolve(self, t: np.ndarray, attitude: bool) -> tuple[np.ndarray, np.ndarray | None]:
        """Directions (3, n) and angles psi (n,) at the times t (n,)."""
        return np.multiply.outer(self.e0, np.ones_like(t)), self.rate * t if attitude else None


def _steady(J: list[Fraction], pi: list[Fraction]) -> _Steady:
    """Sphere, rest, or rotation about a principal axis."""
    norm2 = _sum_of_squares(pi)
    if not norm2:
        return _Steady((0.0, 0.0, 1.0), pole=0, rate=0.0)
    e0 = tuple(_root(p * abs(p) / norm2) for p in pi)
    pole = min(range(3), key=lambda i: abs(e0[i]))
    return _Steady(e0, pole, rate=_root(_sum_of_squares([p / j for p, j in zip(pi, J, strict=True)])))


@dataclass(frozen=True)
class _Polhode:
    """The momentum moves: the constants of the module's first lines."""

    e0: tuple[float, ...]
    norm: float  # G
    amplitude: tuple[float, ...]  # a1, a2, a3
    rate: float  # lam
    k1: float  # k'
    s0: float  # sn u0
    c0: float  # cn u0, not negative
    pole: int  # p - 1
    spin: float  # G/J_q
    nu: float  # N or n, whichever is at most 1
    kappa: float  # +- nu sqrt((1+n)(1+N))

    def evolve(self, t: np.ndarray, attitude: bool) -> tuple[np.ndarray, np.ndarray | None]:
        """Directions (3, n) and, if wanted, angles psi (n,) at the times t (n,)."""
        functions = _hyperbolic if self.k1 < _SEPARATRIX else _elliptic
        sn, cn, dn, T = functions(self, t, attitude)
        a1, a2, a3 = self.amplitude
        return np.stack((a1 * cn, a2 * sn, a3 * dn)), None if T is None else self.spin * t + self.kappa * T


def _polhode(J: list[Fraction], pi: list[Fraction]) -> _Polhode:
    """The constants, from moments and momentum in the order of the formulas."""
    J1, J2, J3 = J
    norm2 = _sum_of_squares(pi)
    X = pi[0] ** 2 * (J3 - J1) / J1 + pi[1] ** 2 * (J3 - J2) / J2
    Y = pi[1] ** 2 * (J2 - J1) / J2 + pi[2] ** 2 * (J3 - J1) / J3
    A1_2, A2_2, A3_2 = J1 * X / (J3 - J1), J2 * X / (J3 - J2), J3 * Y / (J3 - J1)
    n, N = J3 * (J2 - J1) / (J1 * (J3 - J2)), A1_2 / A3_2
    pole, nu, Jq, sign = (0, N, J3, 1) if N <= 1 else (2, n, J1, -1)
    # The half turn u -> u + 2K changes the signs of sn and cn: use it to start on the half of the polhode with cn >= 0.
    half = -1 if pi[0] < 0 else 1
    return _Polhode(
        e0=tuple(_root(p * abs(p) / norm2) for p in pi),
        norm=_root(norm2),
        amplitude=(half * _root(A1_2 / norm2), half * _root(A2_2 / norm2), _root(A3_2 / norm2)),
        rate=(1 if J3 > J2 else -1) * _root((J3 - J2) * Y / (J1 * J2 * J3)),
        k1=_root((J3 - J1) * _separatrix_side(J, pi, J2) / ((J3 - J2) * Y)),
        s0=half * _root(pi[1] * abs(pi[1]) / A2_2),
        c0=_root(pi[0] ** 2 / A1_2),
        pole=pole,
        spin=_root(norm2 / Jq**2),
        nu=float(nu),
        kappa=sign * _root(nu**2 * (1 + n) * (1 + N)),
    )


def _sum_of_squares(v: list[Fraction]) -> Fraction:
    return sum((x * x for x in v), Fraction(0))


def _root(q: Fraction) -> float:
    """sign(q) sqrt|q|, rounded, also where q is beyond the range of floating-point numbers but its root is not."""
    exponent = (q.numerator.bit_length() - q.denominator.bit_length()) // 2
    root = math.ldexp(math.sqrt(abs(q) / Fraction(4) ** exponent), exponent)
    return -root if q < 0 else root


# --- sn, cn, dn and T(u) - T(u0) at u = u0 + lam t --------------------------------------------------------------------

_Functions = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray | None]


def _elliptic(polhode: _Polhode, t: np.ndarray, attitude: bool) -> _Functions:
    """On either side of the separatrix. Two quarter periods change the signs of sn and cn and add 2 T(K) to T."""
    s0, c0, k1 = polhode.s0, polhode.c0, polhode.k1
    means = _means(k1)
    K = _quarter_period(means)
    u = s0 * float(elliprf(c0**2, c0**2 + (k1 * s0) ** 2, 1.0)) + polhode.rate * t
    turns = np.rint(u / (2.0 * K))
    s, c, d = _sn_cn_dn(u - turns * (2.0 * K), means)
    sign = 1.0 - 2.0 * np.mod(turns, 2.0)
    if not attitude:
        return sign * s, sign * c, d, None
    whole, start = _third_kind(np.array([1.0, s0]), np.array([0.0, c0]), k1, polhode.nu)
    return sign * s, sign * c, d, turns * (2.0 * whole) + (_third_kind(s, c, k1, polhode.nu) - start)


def _hyperbolic(polhode: _Polhode, t: np.ndarray, attitude: bool) -> _Functions:
    """On the separatrix, k' = 0: sn u = tanh u, cn u = dn u = 1/cosh u, T by partial fractions in tanh u."""
    # cn u0 = 0 can happen only next to the separatrix, where dn u0 takes its place; it has k' as its least value.
    u0 = math.asinh(polhode.s0 / max(math.hypot(polhode.c0, polhode.k1 * polhode.s0), np.finfo(float).tiny))
    u = u0 + polhode.rate * t
    s, decay = np.tanh(u), np.exp(-abs(u))
    c = 2.0 * decay / (1.0 + decay * decay)
    if not attitude:
        return s, c, c, None
    nu, root = polhode.nu, math.sqrt(polhode.nu)
    T = (polhode.rate * t - (np.arctan(root * s) - np.arctan(root * np.tanh(u0))) / root) / (1.0 + nu)
    return s, c, c, T


def _means(k1: float) -> list[tuple[float, float]]:
    """The pairs (a, b) of the arithmetic-geometric mean of 1 and k', to the last with a = b.

    Source: DLMF 19.8.1. Convergence is quadratic: once a and b share half their digits, their means share all.
    """
    pairs = [(1.0, k1)]
    while (a := pairs[-1][0]) - (b := pairs[-1][1]) > 1e-8 * a:
        pairs.append((0.5 * (a + b), math.sqrt(a * b)))
    mean = 0.5 * (a + b)
    return [*pairs, (mean, mean)]


def _quarter_period(means: list[tuple[float, float]]) -> float:
    """K. Source: DLMF 19.8.5."""
    return 0.5 * math.pi / means[-1][0]


def _sn_cn_dn(u: np.ndarray, means: list[tuple[float, float]]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Jacobi's functions, |u| <= K, by descending Landen transformations: from the circle, a = b, up to (1, k').

    With c/s = a cn/sn, s kept, one step is  c <- c dn,  dn <- (b s^2 + c^2/a')/(a s^2 + c^2/a'), where a' = (a + b)/2
    is the a of the step before. All terms are positive: cn and dn stay accurate relatively, however close k' is to 0.

    Source: DLMF 22.7.2-22.7.4, with 1 - k1 sn^2 = cn^2 + (1 - k1) sn^2.
    """
    below = means[-1][0]
    s, c, dn = np.sin(below * u), below * np.cos(below * u), np.ones_like(u)
    s2 = s * s
    for a, b in reversed(means[:-1]):
        c2 = c * c / below
        c, dn = c * dn, (b * s2 + c2) / (a * s2 + c2)
        below = a
    norm = np.sqrt(s2 + c * c)
    return s / norm, c / norm, dn


def _third_kind(sn: np.ndarray, cn: np.ndarray, k1: float, nu: float) -> np.ndarray:
    """T = integral of sn^2/(1 + nu sn^2) from 0 to u, |u| <= K. Source: DLMF 19.25.14 (T = (F - Pi)/nu there)."""
    s2, c2 = sn * sn, cn * cn
    return sn * s2 * elliprj(c2, c2 + k1 * k1 * s2, 1.0, 1.0 + nu * s2) / 3.0


# --- the attitude -----------------------------------------------------------------------------------------------------


def _attitude(
    g: np.ndarray, axes: np.ndarray, motion: _Steady | _Polhode, e: np.ndarray, psi: np.ndarray
) -> np.ndarray:
    """g P(e(0))^T Rot3(psi) P(e), shape (n, 3, 3), for directions e (3, n) in the frame of the rows of axes."""
    start = np.stack(_frame(np.array(motion.e0), motion.pole, axes))
    a, b, e = _frame(e, motion.pole, axes)
    cos, sin = np.cos(psi), np.sin(psi)
    rows = _combine(_combine(g, start.T), np.stack((cos * a - sin * b, sin * a + cos * b, e)))
    return np.ascontiguousarray(np.moveaxis(rows, -1, 0))


def _frame(e: np.ndarray, pole: int, axes: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The rows a, e x a, e of P(e; p), given back in the body frame; e : (3,) or (3, n), so are they."""
    ep, ei, ej = np.roll(e, -pole, axis=0)
    r = np.sqrt(ei * ei + ej * ej)
    a = np.roll(np.stack((r, -ep * ei / r, -ep * ej / r)), pole, axis=0)
    b = np.roll(np.stack((np.zeros_like(r), ej / r, -ei / r)), pole, axis=0)
    return _combine(axes.T, a), _combine(axes.T, b), _combine(axes.T, e)


def _combine(matrix: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """matrix @ rows, written out: the same bits for one time and for many, which BLAS does not promise."""
    x, y, z = rows
    return np.stack([m[0] * x + m[1] * y + m[2] * z for m in matrix])


def _times_power_of_two(x: ArrayLike, exponent: int) -> np.ndarray:
    with np.errstate(over="ignore", under="ignore"):
        return np.ldexp(x, exponent)
