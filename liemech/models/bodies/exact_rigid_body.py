"""The free rigid body in closed form: momentum by Jacobi's elliptic functions, attitude by one more
integral.

    mu' = mu x w,   g' = g hat(w),   w = J^{-1} mu          mu and w in the body frame, g takes body to space

The unit vector e = mu/|mu| runs along a polhode. Let J2 be the middle moment and axis 3 the one the
polhode surrounds, with e3 > 0; J1, J2, J3 then rise or fall. With G = |mu|, X = 2 E J3 - G^2,
Y = G^2 - 2 E J1 and D = G^2 - 2 E J2, which vanishes on the separatrix (all of the sign of J3 - J1,
or zero),

    e = (a1 cn u, a2 sn u, a3 dn u),    u = u0 + lam t,    k'^2 = 1 - m = (J3-J1) D/((J3-J2) Y),
    lam^2 = (J3-J2) Y/(J1 J2 J3),    lam of the sign of J3 - J2,
    (G a1)^2 = J1 X/(J3-J1),    (G a2)^2 = J2 X/(J3-J2),    (G a3)^2 = J3 Y/(J3-J1).

The constant spatial momentum g mu leaves one angle of the attitude. Let P(e; p) be the rotation
with rows a, e x a, e, where a is the axis p made orthogonal to e and normalised. Then, {i, j} being
the axes other than p,

    g = g(0) P(e(0))^T Rot3(psi) P(e),    psi' = G (e_i^2/J_i + e_j^2/J_j)/(e_i^2 + e_j^2),

singular only where the polhode meets the axis p. With n = J3 (J2-J1)/(J1 (J3-J2)) and
N = (a1/a3)^2, n N = m,

    p = 1:  psi = G t/J3 + N sqrt((1+n)(1+N)) [T(u) - T(u0)],    T(u) = integral of sn^2/(1 + N sn^2) from 0 to u,
    p = 3:  psi = G t/J1 - n sqrt((1+n)(1+N)) [T(u) - T(u0)],    T(u) = integral of sn^2/(1 + n sn^2) from 0 to u.

Take the pole that stays at least 45 degrees away from the polhode: p = 1 if N <= 1, else p = 3.
Then all coefficients are bounded, whatever the body, and no digits cancel.

Source: Whittaker, Analytical Dynamics, 4th ed., sections 69-71; van Zon and Schofield, J. Comput.
Phys. 225 (2007) 145; Celledoni, Fasso, Safstrom and Zanna, SIAM J. Sci. Comput. 30 (2008) 2084.
"""

from __future__ import annotations

import functools
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ...compiler import row_driver
from ...formulas import Mat, Vec, diagonal, dot, identity_matrix, mat, vec, vectors
from .carlson import duplications, elliprf
from .polhode import (
    Direction,
    Polhode,
    angle,
    at,
    attitude,
    direction,
    frame,
    in_body,
    momentum,
    moved,
    sin_cos,
    third_kind,
)

__all__ = ["exact_rigid_body", "momentum_period"]

# Below this k' the body counts as on the separatrix, which it would only leave after the time
# K/lam = 174/lam.
_SEPARATRIX = 2.0**-250

# Bodies that are not next to the separatrix have so many arithmetic-geometric means, or fewer; all
# get the same native code.
_MEANS = 6


def exact_rigid_body(
    inertia: ArrayLike, mu: ArrayLike, g: ArrayLike | None, t: ArrayLike
) -> tuple[np.ndarray, np.ndarray | None]:
    """How a free rigid body spins and where it points at the times t, without integrating.

        mu' = mu x J^{-1} mu,    g' = g hat(J^{-1} mu),    from mu and g at time 0

    inertia : (3,) principal moments in any order, or (3, 3) symmetric positive definite, kg m^2; they need not
    satisfy the triangle inequality
    mu : (3,) body angular momentum at time 0, kg m^2/s
    g : (3, 3) attitude at time 0, body to space; None if the momentum is all you want
    t : any shape, s, of either sign
    Returns the momentum (..., 3) and the attitude (..., 3, 3), or None in its place.
    Raises nothing: the caller has checked the arguments. Finite arguments give finite results.

    The error is a few rounding errors times 1 + |w| t, next to the separatrix too: principal
    moments and mu are taken to be exact. Started at a small angle d from the middle axis, it is
    about log(1/d) times that. An inertia that is not diagonal is diagonalised first, with the
    rounding errors of its eigenvectors.

    Source: Whittaker, Analytical Dynamics, 4th ed., sections 69-71, in the form of this module's
    first lines.
    """
    t = np.asarray(t, dtype=float)
    m = _frozen(mu)
    orbit, unit, start, values = _prepared(_frozen(inertia), m, None if g is None else _frozen(g))
    times = (_times_power_of_two(t, -unit.time) if unit.extreme else t).reshape(-1)
    width = 3 if start is None else 12
    if isinstance(orbit, Polhode):
        rows = _MOVED.rows(values, times, width, lambda x, made: _along(orbit, start, x, made))
    else:
        rows = np.empty((t.size, width))
        _other(orbit, start, times, rows)
    momenta = _times_power_of_two(rows[:, :3], unit.momentum) if unit.extreme else rows[:, :3]
    if isinstance(orbit, _Steady):
        momenta[:] = m
    return momenta.reshape(*t.shape, 3), None if start is None else rows[:, 3:].reshape(*t.shape, 3, 3)


def momentum_period(inertia: ArrayLike, mu: ArrayLike) -> float:
    """After which time the momentum of a free rigid body, seen from the body, comes back: 4
    K(m)/|lam|, in s.

    inertia : (3,) or (3, 3), kg m^2;  mu : (3,), kg m^2/s, as for exact_rigid_body
    Infinite on the separatrix; 0 if the momentum stands still (steady rotation, sphere, rest): any
    time is a period. The attitude has a second frequency and in general does not come back. Raises
    nothing.

    Source: Whittaker, Analytical Dynamics, 4th ed., section 69.
    """
    orbit, unit = _motion(_frozen(inertia), _frozen(mu))[:2]
    if isinstance(orbit, _Steady):
        return 0.0
    if not isinstance(orbit, Polhode) or orbit.rate == 0.0:
        return math.inf
    return float(_times_power_of_two(2.0 * orbit.half / abs(orbit.rate), unit.time))


# --- the motion at many times
# -----------------------------------------------------------------------------------------


def _along(p: Polhode, start: Mat | None, t: np.ndarray, rows: np.ndarray) -> None:
    """The formulas of native code, on arrays."""
    with np.errstate(all="ignore"):
        t = at(p, t)
        e, s, c, turns = direction(p, t)
        _place(p, start, e, None if start is None else angle(p, t, s, c, turns), rows)


def _other(orbit: _Steady | _Separatrix, start: Mat | None, t: np.ndarray, rows: np.ndarray) -> None:
    """Motions that are no elliptic functions of time."""
    with np.errstate(all="ignore"):
        _place(orbit, start, *orbit.evolve(at(orbit, t)), rows)


def _place(orbit: Any, start: Mat | None, e: Any, psi: Any, rows: np.ndarray) -> None:
    entries = momentum(orbit, e)
    if start is not None:
        sine, cosine = sin_cos(psi)
        entries = *entries, *attitude(orbit.axes, start, e, cosine, sine)
    for j, column in enumerate(entries):
        rows[:, j] = column


_MOVED = row_driver.RowDriver(moved)


class _PreparedMotion(NamedTuple):
    """The data that all times of a motion from one start share.  start : g(0) P(e(0))^T in the principal frame."""

    orbit: _Steady | _Separatrix | Polhode
    unit: _Unit
    start: Mat | None
    values: row_driver.Arguments


@functools.lru_cache(256)
def _prepared(inertia: Vec | Mat, mu: Vec, g: Mat | None) -> _PreparedMotion:
    orbit, unit, e0 = _motion(inertia, mu)
    start = None
    if g is not None:
        rows = [vec(*[in_body(orbit.axes, *x, j) for j in range(3)]) for x in (*frame(e0), e0)]
        start = mat(*[vec(*[dot(x, y) for y in rows]) for x in g])
    return _PreparedMotion(orbit, unit, start, row_driver.Arguments(orbit, start))


# --- the data, in the principal frame and in units of their own
# -------------------------------------------------------


class _Unit(NamedTuple):
    """Exponents of two: in these units the largest component of the momentum and the least moment are in [1/2, 1)."""

    time: int
    momentum: int

    @property
    def extreme(self) -> bool:
        """Whether the scales are no floats: then times and momenta are scaled before and after."""
        return max(map(abs, self)) > 1000

    @property
    def factors(self) -> tuple[float, float]:
        """Factors from the caller's times to those of the motion, and from its momenta to the caller's."""
        return (1.0, 1.0) if self.extreme else (math.ldexp(1.0, -self.time), math.ldexp(1.0, self.momentum))


class _Motion(NamedTuple):
    """The kind of motion; units; e(0), along the principal axes from the axis p on."""

    orbit: _Steady | _Separatrix | Polhode
    unit: _Unit
    e0: Direction


def _frozen(value: Any) -> Any:
    """The array as a small vector or matrix, which can be looked up."""
    if isinstance(value, (vectors.Vec, vectors.Mat)):
        return value
    array = np.asarray(value, dtype=float)
    return Vec.of(array.tolist()) if array.ndim == 1 else Mat.of(array.tolist())


@functools.lru_cache(256)
def _motion(inertia: Vec | Mat, mu: Vec) -> _Motion:
    """The motion in the frame and the units that suit it.

    The constants are rational functions of the data, or roots of such. They are computed exactly
    and rounded once, so no small difference of moments, no nearness of the separatrix and no unit
    of measurement spoils them.
    """
    moments, axes = _principal(inertia)
    pi = [dot(axis, mu) for axis in axes]
    unit_of_inertia, unit_of_momentum = (math.frexp(min(moments))[1], math.frexp(max(map(abs, pi)))[1])
    unit = _Unit(unit_of_inertia - unit_of_momentum, unit_of_momentum)
    J, J_scale = _whole(moments, unit_of_inertia)
    m, m_scale = _whole(pi, unit_of_momentum)
    if all(J[i] == J[j] or not m[i] * m[j] for i, j in ((0, 1), (1, 2), (2, 0))):
        return _steady(J, J_scale, m, m_scale, axes, unit)
    order = sorted(range(3), key=lambda i: J[i])
    if _side([J[i] for i in order], [m[i] for i in order]) < 0:
        order.reverse()
    sign = [1, 1 if (order[1] - order[0]) % 3 == 1 else -1, 1]
    if m[order[2]] < 0:
        sign[1], sign[2] = -sign[1], -sign[2]
    J, m = [J[i] for i in order], [s * m[i] for s, i in zip(sign, order, strict=True)]
    return _orbit(J, J_scale, m, m_scale, [s * axes[i] for s, i in zip(sign, order, strict=True)], unit)


def _principal(inertia: Vec | Mat) -> tuple[Vec, Mat]:
    """Principal moments (3,) and axes (3, 3), the axes as the rows of a rotation."""
    identity = identity_matrix(3)
    if isinstance(inertia, vectors.Vec):
        return inertia, identity
    if inertia == diagonal(vec(*[inertia[i, i] for i in range(3)])):
        return vec(*[inertia[i, i] for i in range(3)]), identity
    matrix = np.array(inertia)
    exponent = math.frexp(abs(matrix).max())[1]
    moments, columns = np.linalg.eigh(_times_power_of_two(matrix, -exponent))
    columns[:, 0] *= np.sign(np.linalg.det(columns))
    # A moment below the rounding error of the largest may come out zero or negative: the matrix
    # does not know it.
    moments = np.maximum(moments, np.finfo(float).eps * moments[2])
    return Vec.of(_times_power_of_two(moments, exponent).tolist()), Mat.of(columns.T.tolist())


def _whole(numbers: Vec | list[float], exponent: int) -> tuple[list[int], int]:
    """Whole numbers and k: the numbers, exactly, over 2^exponent and times 2^k."""
    parts = [math.frexp(x) for x in numbers]
    least = min([e for x, e in parts if x], default=0)
    return [int(math.ldexp(x, 53)) << (e - least) if x else 0 for x, e in parts], 53 - least + exponent


def _side(J: list[int], m: list[int]) -> int:
    """J1 J3 (G^2 - 2 E J2): positive if the polhode surrounds the axis of the largest moment,
    negative if of the least.
    """
    return m[0] ** 2 * (J[0] - J[1]) * J[2] + m[2] ** 2 * (J[2] - J[1]) * J[0]


def _root(top: int, bottom: int, power: int = 0) -> float:
    """sign(q) sqrt|q| of q = 4^power top/bottom, rounded, also where q is beyond the range of
    floating-point numbers.
    """
    exponent = (abs(top).bit_length() - bottom.bit_length()) // 2
    q = abs(top) / (bottom << 2 * exponent) if exponent > 0 else (abs(top) << -2 * exponent) / bottom
    root = math.ldexp(math.sqrt(q), exponent + power)
    return -root if top < 0 else root


# --- the kinds of motion
# ----------------------------------------------------------------------------------------------


class _Steady(NamedTuple):
    """Momentum and velocity are parallel: e stays, psi = rate t."""

    e0: tuple[float, ...]
    rate: float
    axes: Mat
    unit_of_time: float
    unit_of_momentum: float
    norm: float = 0.0

    def evolve(self, t: np.ndarray) -> tuple[Any, np.ndarray]:
        """Direction and angles psi (n,) at the times t (n,)."""
        return self.e0, self.rate * t


class _Separatrix(NamedTuple):
    """k' = 0: sn u = tanh u, cn u = dn u = 1/cosh u, T by partial fractions in tanh u."""

    amplitude: tuple[float, ...]
    norm: float
    rate: float
    u0: float
    pole: int
    spin: float
    nu: float
    kappa: float
    axes: Mat
    unit_of_time: float
    unit_of_momentum: float

    def evolve(self, t: np.ndarray) -> tuple[Any, np.ndarray]:
        """Directions and angles psi (n,) at the times t (n,)."""
        u = self.u0 + self.rate * t
        s, decay = np.tanh(u), np.exp(-abs(u))
        c = 2.0 * decay / (1.0 + decay * decay)
        root = math.sqrt(self.nu)
        T = (self.rate * t - (np.arctan(root * s) - np.arctan(root * np.tanh(self.u0))) / root) / (1.0 + self.nu)
        a1, a2, a3 = self.amplitude
        return _from(self.pole, (a1 * c, a2 * s, a3 * c)), self.spin * t + self.kappa * T


def _steady(J: list[int], J_scale: int, m: list[int], m_scale: int, axes: Mat, unit: _Unit) -> _Motion:
    """Sphere, rest, or rotation about a principal axis."""
    norm2 = sum([x * x for x in m])
    if not norm2:
        return _Motion(_Steady((0.0, 0.0, 1.0), 0.0, axes, *unit.factors), unit, (0.0, 0.0, 1.0))
    e0 = [_root(x * abs(x), norm2) for x in m]
    pole = min(range(3), key=lambda i: abs(e0[i]))
    others = J[1] * J[2], J[2] * J[0], J[0] * J[1]
    velocity2 = sum([(x * other) ** 2 for x, other in zip(m, others, strict=True)])
    rate = _root(velocity2, (J[0] * J[1] * J[2]) ** 2, J_scale - m_scale)
    axis = _from(pole, e0)
    return _Motion(_Steady(axis, rate, mat(*_from(pole, axes.rows)), *unit.factors), unit, axis)


def _orbit(J: list[int], J_scale: int, m: list[int], m_scale: int, axes: list[Vec], unit: _Unit) -> _Motion:
    """The constants of the module's first lines, from moments and momentum in the order of the formulas."""
    J1, J2, J3 = J
    norm2 = sum([x * x for x in m])
    X = m[0] ** 2 * (J3 - J1) * J2 + m[1] ** 2 * (J3 - J2) * J1  # J1 J2 times that of the formulas
    Y = m[1] ** 2 * (J2 - J1) * J3 + m[2] ** 2 * (J3 - J1) * J2  # J2 J3 times
    signed = 1 if J3 > J1 else -1  # of all these differences
    (J12, J13, J23), X, Y = ((signed * x for x in (J2 - J1, J3 - J1, J3 - J2)), signed * X, signed * Y)
    n_top, n_bottom = J3 * J12, J1 * J23
    at_axis_1 = X <= Y  # N = X/Y
    nu_top, nu_bottom, Jq = (X, Y, J3) if at_axis_1 else (n_top, n_bottom, J1)
    nu = nu_top / nu_bottom
    kappa = _root(nu_top**2 * (n_bottom + n_top) * (Y + X), nu_bottom**2 * n_bottom * Y)
    # The half turn u -> u + 2K changes the signs of sn and cn: use it to start on the half of the
    # polhode with cn >= 0.
    turned = -1 if m[0] < 0 else 1
    amplitude = (
        turned * _root(X, J2 * J13 * norm2), turned * _root(X, J1 * J23 * norm2), _root(Y, J2 * J13 * norm2)
    )  # fmt: skip
    rate = signed * _root(J23 * Y, J1 * (J2 * J3) ** 2, J_scale - m_scale)
    k1 = _root(J13 * signed * _side(J, m) * J2, J23 * J1 * Y)
    s0 = turned * _root(m[1] * abs(m[1]) * J1 * J23, X)
    c0 = _root(m[0] ** 2 * J2 * J13, X)
    pole = 0 if at_axis_1 else 2
    norm, spin = _root(norm2, 1, -m_scale), _root(norm2, Jq**2, J_scale - m_scale)
    kappa = kappa if at_axis_1 else -kappa
    rows, e0 = mat(*_from(pole, axes)), _from(pole, [_root(x * abs(x), norm2) for x in m])
    if k1 < _SEPARATRIX:
        # cn u0 = 0 can happen only next to the separatrix, where dn u0 takes its place; it has k'
        # as its least value.
        u0 = math.asinh(s0 / max(math.hypot(c0, k1 * s0), np.finfo(float).tiny))
        return _Motion(_Separatrix(amplitude, norm, rate, u0, pole, spin, nu, kappa, rows, *unit.factors), unit, e0)
    means = _means(k1)
    least = means[-1][0]
    a, b = zip(*(means[:-1] + [(least, least)] * (_MEANS - len(means) + 1)), strict=True)
    count = duplications(0.0, k1 * k1, 1.0, 1.0 + nu)
    orbit = Polhode(
        rate=rate,
        begin=s0 * elliprf(c0 * c0, c0 * c0 + (k1 * s0) ** 2, 1.0),
        half=math.pi / means[-1][0],  # 2 K; DLMF 19.8.5
        a=vec(*a),
        b=vec(*b),
        least=least,
        k1=k1,
        nu=nu,
        count=count,
        spin=spin,
        kappa=kappa,
        whole=2.0 * third_kind(1.0, 0.0, k1, nu, count),
        begun=third_kind(s0, c0, k1, nu, count),
        pole=float(pole),
        amplitude=vec(*amplitude),
        norm=norm,
        axes=rows,
        unit_of_time=unit.factors[0],
        unit_of_momentum=unit.factors[1],
    )
    return _Motion(orbit, unit, e0)


def _from(pole: int, three: Any) -> Direction:
    """Three things in cyclic order, from this one on."""
    return three[pole], three[pole - 2], three[pole - 1]


def _means(k1: float) -> list[tuple[float, float]]:
    """The pairs (a, b) of the arithmetic-geometric mean of 1 and k', to the last with a = b.

    Source: DLMF 19.8.1. Convergence is quadratic: once a and b share half their digits, their means
    share all.
    """
    pairs = [(1.0, k1)]
    while (a := pairs[-1][0]) - (b := pairs[-1][1]) > 1e-8 * a:
        pairs.append((0.5 * (a + b), math.sqrt(a * b)))
    mean = 0.5 * (a + b)
    return [*pairs, (mean, mean)]


def _times_power_of_two(x: ArrayLike, exponent: int) -> np.ndarray:
    with np.errstate(over="ignore", under="ignore"):
        return np.ldexp(x, exponent)
