"""The Lagrange top in closed form: the tilt by Jacobi's elliptic functions, both turns by integrals
of the third kind.

With u = cos(tilt), M = w l > 0, the moments A, A, C, the spin p_3 = mu_3 and the vertical momentum
a = mu . Gamma,

    u'^2 = (2/A)(e - M u)(1 - u^2) - (a - p_3 u)^2/A^2 = (2 M/A)(u - u_1)(u - u_2)(u - u_3),   u_1 <= u <= u_2 <= 1 <= u_3
    u = u_1 + (u_2 - u_1) sn^2 v,   v = v_0 + lam t,   lam^2 = M (u_3 - u_1)/(2 A),   k^2 = (u_2 - u_1)/(u_3 - u_1)

The attitude is a unit quaternion, alpha = (w, z) = ((1 + u)/2)^(1/2) e^(i p),
beta = (x, y) = ((1 - u)/2)^(1/2) e^(i r), with Euler's angles p = (phi + psi)/2 and
r = (phi - psi)/2:

    p' = ((a + p_3)/(1 + u) - p_3)/(2 A) + p_3/(2 C),     r' = ((a - p_3)/(1 - u) + p_3)/(2 A) - p_3/(2 C)

Each phase is uncertain only where its number vanishes: nothing is singular at the upper or the
lower pole.  A top that passes exactly through a pole has a = p_3 or a = -p_3; there the root takes
the sign of cn or sn.  The roots u_1, u_2, u_3 and all differences are computed with many digits and
rounded once.

Source: Whittaker, Analytical Dynamics, 4th ed., sections 71-73; Klein and Sommerfeld, The Theory of
the Top, volume II, chapter IV (the parameters alpha and beta).
"""

from __future__ import annotations

import math
from decimal import Context, Decimal, localcontext
from typing import Any, NamedTuple

import numpy as np

from .jacobi import Jacobi

DIGITS = 200
SAME = Decimal(10) ** -60
"""Roots that are closer to each other, or to 1, are equal: no start of sixteen digits tells them apart."""

Quaternion = tuple[Any, Any, Any, Any]


class Phase(NamedTuple):
    """The phase of alpha or beta: `begin` + rate t + factor (I(v) - I(v_0)), I the integral of 1/(1 + nu sn^2)."""

    begin: float
    rate: float
    factor: float
    nu: float
    rest: float
    """1 + nu."""
    ratio: float
    """k^2/nu."""

    def integral(self, k1: float, s: Any, c: Any) -> Any:
        """I(v), |v| <= K: for nu < 0 as F - nu T, for nu > 0 by another such sum, so that all terms
        are positive.

        Source: DLMF 19.25.14 (T = (F - Pi)/nu there), and 19.21.12 with z for x.
        """
        from scipy.special import elliprc, elliprf, elliprj

        s2, c2 = s * s, c * c
        d2 = c2 + k1 * k1 * s2
        if self.nu <= 0.0:
            third = elliprj(c2, d2, 1.0, c2 + self.rest * s2)
            return s * (elliprf(c2, d2, 1.0) - self.nu * s2 * third / 3.0)
        q = 1.0 + self.ratio * s2
        return s * (elliprc(c2 * d2, (c2 + self.rest * s2) * q) + self.ratio * s2 * elliprj(c2, d2, 1.0, q) / 3.0)


class Tilting(NamedTuple):
    """A motion whose tilt changes, or stands still beside the vertical.  signed : does alpha, does
    beta pass through zero?
    """

    jacobi: Jacobi
    A: float
    spin: float
    sums: tuple[float, float]
    """a + p_3, a - p_3."""
    least: tuple[float, float]
    """1 + u_1, 1 - u_2."""
    width: float
    rate: float
    start: tuple[float, float]
    """sn, cn at the start."""
    signed: tuple[bool, bool]
    phases: tuple[Phase, Phase]

    def amplitudes(self, s: Any, c: Any) -> tuple[Any, Any, Any, Any]:
        """|alpha| and |beta|, or with the sign of sn, of cn; and sn, cn over them."""
        half = math.sqrt(0.5 * self.width)
        alpha, s_over = np.sqrt(0.5 * (self.least[0] + self.width * s * s)), None
        beta, c_over = np.sqrt(0.5 * (self.least[1] + self.width * c * c)), None
        if self.signed[0]:
            alpha, s_over = half * s, np.full(np.shape(s), 1.0 / half)
        if self.signed[1]:
            beta, c_over = half * c, np.full(np.shape(c), 1.0 / half)
        return (alpha, beta, s / alpha if s_over is None else s_over, c / beta if c_over is None else c_over)

    def at(self, t: np.ndarray) -> tuple[Quaternion, Any, Any]:
        """Attitude, and the body velocities about the transverse axes, at the times t."""
        begin = self.jacobi.argument(*self.start)
        s, c, d, turns = self.jacobi.functions(begin + self.rate * t)
        p, r = (self._phase(phase, t, s, c, turns) for phase in self.phases)
        odd = 1.0 - 2.0 * np.abs(turns - 2.0 * np.round(0.5 * turns))
        s, c = odd * s, odd * c
        alpha, beta, s_over, c_over = self.amplitudes(s, c)
        tilting = -self.width * self.rate * d * s_over * c_over
        if self.signed[1]:
            turning = self.spin * beta / alpha if not self.signed[0] else 0.0 * s
        elif self.signed[0]:
            turning = -self.spin * alpha / beta
        else:
            up, down = (self.sums[0] - 2.0 * self.spin * alpha * alpha, self.sums[1] + 2.0 * self.spin * beta * beta)
            turning = np.where(np.abs(beta) < np.abs(alpha), down, up) / (2.0 * alpha * beta)
        turning = turning / self.A
        (cp, sp), (cr, sr) = ((np.cos(x), np.sin(x)) for x in (p, r))
        # of psi = p - r, with the rounding errors of the attitude
        cosine, sine = cp * cr + sp * sr, sp * cr - cp * sr
        velocity = tilting * cosine + turning * sine, turning * cosine - tilting * sine
        return (alpha * cp, beta * cr, beta * sr, alpha * sp), *velocity

    def _phase(self, phase: Phase, t: Any, s: Any, c: Any, turns: Any) -> Any:
        if not phase.factor:
            return phase.begin + phase.rate * t
        s0, c0 = self.start
        k1 = self.jacobi.k1
        if not k1:  # sn = tanh v, and nu > 0
            root = math.sqrt(phase.nu)
            angle = (self.rate * t + root * (np.arctan(root * s) - math.atan(root * s0))) / phase.rest
        else:
            angle = 2.0 * turns * phase.integral(k1, 1.0, 0.0) + (phase.integral(k1, s, c) - phase.integral(k1, s0, c0))
        return phase.begin + phase.rate * t + phase.factor * angle


def lagrange_top(A: float, C: float, M: float, mu: Any, q: Quaternion, t: np.ndarray) -> tuple[Quaternion, np.ndarray]:
    """Attitude as a unit quaternion (w, x, y, z) and body momentum (n, 3) at the times t, (n,).

    A, A, C : the moments.  M : weight times length, of any sign.  mu, q : the start.

    Source: Whittaker, Analytical Dynamics, 4th ed., sections 71-73.
    """
    w, x, y, z = q
    spin = float(mu[2])
    if M < 0.0:  # the vertical turned over: (0, 1, 0, 0) q
        (w, x, y, z), momenta = lagrange_top(A, C, -M, mu, (-x, w, -z, y), t)
        return (x, -w, z, -y), momenta
    upright = not (x or y) or not (w or z)
    if upright and not (mu[0] or mu[1]):
        half = (0.5 * spin / C) * t
        return _spun((w, x, y, z), half), np.stack([np.full(t.shape, float(m)) for m in mu], axis=-1)
    if M == 0.0:
        return _free(A, C, mu, q, t)
    motion = _tilting(A, C, M, mu, (w, x, y, z))
    attitude, first, second = motion.at(t)
    return attitude, np.stack([A * first, A * second, np.full(t.shape, spin)], axis=-1)


def quaternion(g: np.ndarray) -> Quaternion:
    """A unit quaternion (w, x, y, z) of a rotation (3, 3): the largest by a root, the others,
    however small, by division.

    Source: Shepperd, J. Guidance and Control 1 (1978), 223.
    """
    (a, b, c), (d, e, f), (k, l, m) = g.tolist()
    rows = (
        (1.0 + a + e + m, l - f, c - k, d - b),
        (l - f, 1.0 + a - e - m, b + d, c + k),
        (c - k, b + d, 1.0 - a + e - m, f + l),
        (d - b, c + k, f + l, 1.0 - a - e + m),
    )
    row = rows[max(range(4), key=lambda i: rows[i][i])]
    size = math.hypot(*row)
    return row[0] / size, row[1] / size, row[2] / size, row[3] / size


def _spun(q: Any, half: Any) -> Quaternion:
    """q turned about the third axis of the body by twice an angle."""
    w, x, y, z = q
    c, s = np.cos(half), np.sin(half)
    return w * c - z * s, x * c + y * s, y * c - x * s, z * c + w * s


def _free(A: float, C: float, mu: Any, q: Quaternion, t: np.ndarray) -> tuple[Quaternion, np.ndarray]:
    """Without weight: a turn about the momentum with |mu|/A, after one about the axis of the body
    with mu_3 (1/C - 1/A).
    """
    about_axis, size = (1.0 / C - 1.0 / A) * float(mu[2]) * t, math.hypot(*mu)
    c, s = np.cos(0.5 * size / A * t), np.sin(0.5 * size / A * t)
    e = [s * float(m) / size for m in mu]
    w, x, y, z = q  # q (c, e): the turn about the momentum, seen from the body at the start
    turned = (
        w * c - (x * e[0] + y * e[1] + z * e[2]),
        w * e[0] + x * c + y * e[2] - z * e[1],
        w * e[1] + y * c + z * e[0] - x * e[2],
        w * e[2] + z * c + x * e[1] - y * e[0],
    )
    cosine, sine = np.cos(about_axis), np.sin(about_axis)
    momenta = (mu[0] * cosine + mu[1] * sine, mu[1] * cosine - mu[0] * sine, np.full(t.shape, float(mu[2])))
    return _spun(turned, 0.5 * about_axis), np.stack(momenta, axis=-1)


def _tilting(A_: float, C_: float, M_: float, mu: Any, q: Quaternion) -> Tilting:
    """The constants of the module's first lines."""
    with localcontext(Context(prec=DIGITS)):
        A, C, M, m1, m2, p3, *four = map(Decimal, map(float, (A_, C_, M_, *mu, *q)))
        size = sum((x * x for x in four), Decimal(0)).sqrt()
        w, x, y, z = (c / size for c in four)
        up, down = 2 * (w * w + z * z), 2 * (x * x + y * y)  # 1 + u, 1 - u
        G1, G2 = 2 * (x * z - w * y), 2 * (y * z + w * x)
        flat = m1 * G1 + m2 * G2
        high, low = flat + p3 * up, flat - p3 * down  # a + p_3, a - p_3
        a, u = flat + p3 * (1 - down), 1 - down
        energy = (m1 * m1 + m2 * m2) / (2 * A) + M * u
        u1, u2, u3 = _roots(energy / M + p3 * p3 / (2 * A * M), a * p3 / (A * M) - 1, energy / M - a * a / (2 * A * M))
        above, below, width, span = 1 - u2, 1 + u1, u2 - u1, u3 - u1
        signed = below < SAME, above < SAME
        below, above = (Decimal(0) if zero else x for zero, x in zip(signed, (below, above)))
        gap = u3 - u2 if u3 - u2 > SAME else Decimal(0)
        rate = (M * span / (2 * A)).sqrt()
        speed = G1 * m2 - G2 * m1
        s0, c0 = Decimal(0), Decimal(1)
        if width > SAME:
            s0, c0 = (max(x / width, Decimal(0)).sqrt() for x in (u - u1, u2 - u))
            s0 = -s0 if speed < 0 else s0
        else:
            width, gap = Decimal(0), span
        # over the least 1 + u and the largest 1 - u
        p_part = Decimal(0) if signed[0] else high / (2 * A * below * rate)
        r_part = Decimal(0) if signed[1] else low / (2 * A * (1 - u1) * rate)
        p_nu, r_nu = (Decimal(0) if signed[0] else width / below), -width / (1 - u1)
        rate_about_axis = p3 / (2 * C) - p3 / (2 * A)
        v = [float(c) for c in (m1 / A, m2 / A, p3 / C)]
        motion = Tilting(
            jacobi=Jacobi.of_modulus(float((gap / span).sqrt())),
            A=A_,
            spin=float(p3),
            sums=(float(high), float(low)),
            least=(float(below), float(above)),
            width=float(width),
            rate=float(rate),
            start=(float(s0), float(c0)),
            signed=signed,
            phases=(
                Phase(0.0, float(rate_about_axis), float(p_part), float(p_nu), float(1 + p_nu), float(below / span)),
                Phase(0.0, -float(rate_about_axis), float(r_part), float(r_nu), float(above / (1 - u1)), 0.0),
            ),
        )
    return motion._replace(phases=_begun(motion, [float(c) for c in (w, x, y, z)], v))


def _begun(motion: Tilting, q: list[float], v: list[float]) -> tuple[Phase, Phase]:
    """The phases at the start; of a number that vanishes there, from its rate of change."""
    w, x, y, z = q
    s, c = motion.start
    size_alpha, size_beta, _, _ = motion.amplitudes(np.float64(s), np.float64(c))
    alpha, beta = (w, z), (x, y)
    if motion.signed[0] and size_alpha == 0.0:
        alpha, size_alpha = (-(x * v[0] + y * v[1]), x * v[1] - y * v[0]), 1.0
    if motion.signed[1] and size_beta == 0.0:
        beta, size_beta = (w * v[0] - z * v[1], w * v[1] + z * v[0]), -s
    first, second = motion.phases
    return tuple(  # type: ignore[return-value]
        phase._replace(begin=math.atan2(math.copysign(1.0, size) * pair[1], math.copysign(1.0, size) * pair[0]))
        for phase, pair, size in ((first, alpha, size_alpha), (second, beta, size_beta))
    )


def _roots(b: Decimal, c: Decimal, d: Decimal) -> tuple[Decimal, Decimal, Decimal]:
    """The three real roots of u^3 - b u^2 + c u + d, the largest by Newton's method from above."""
    u = 1 + abs(b) + abs(c) + abs(d)
    for _ in range(3 * DIGITS):
        slope = (3 * u - 2 * b) * u + c
        if not slope > 0:
            break
        change = (((u - b) * u + c) * u + d) / slope
        u -= change
        if abs(change) <= abs(u) * Decimal(10) ** (10 - DIGITS):
            break
    u = max(u, Decimal(1))
    total, product = b - u, c - u * (b - u)
    half = max(total * total / 4 - product, Decimal(0)).sqrt()
    return total / 2 - half, min(total / 2 + half, Decimal(1)), u
