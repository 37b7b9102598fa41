"""Where a free rigid body is on its polhode, and how it is turned, at any time: formulas of the
time, for arrays and native code.

`exact_rigid_body` says what the letters mean.  There is nothing in them but arithmetic, roots and
choices, so that NumPy, plain Python and native code give the same bits.
"""

from __future__ import annotations

import math
from typing import Any

from ...compiler.driver import read, write
from ...formulas import Mat, Record, Vec, record, sqrt, vec, where
from ...formulas.classes.layouts import NUMBER, layout_of, vector_layout
from ...groups.rigid.rotation_coefficients import SINC, VERSINE, polynomial
from .carlson import elliprj

MOMENTUM = vector_layout(3)
WITH_ATTITUDE = layout_of((vec(0.0, 0.0, 0.0), vec(*[0.0] * 9)))

LONGEST = 1e300
"""A phase beyond 2^53 radians has lost its last digit.  This bound on the time keeps it a number."""

WHOLE = 2.0**51
"""Numbers beyond this are whole, or nearly so."""

ROUNDING = 1.5 * 2.0**52

QUARTER_TURN = 1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21
"""pi/2 as the sum of two numbers of 33 bits and the rest."""

PER_RADIAN = 2.0 / math.pi
"""Quarter turns."""


@record
class Polhode(Record):
    """The constants of a motion off the separatrix, momentum and time in units of powers of two.

    means : the pairs (a, b) of the arithmetic-geometric mean of 1 and k', as two vectors.
    least : the mean.  half : 2 K.
    whole : 2 T(K).  begun : T(u0).  count : of duplications.  pole : p - 1, as a number.
    axes : the principal axes as rows, from the axis p on.  unit_of_time, unit_of_momentum : what
    the arguments and results are in.
    """

    rate: float
    begin: float
    half: float
    a: Vec
    b: Vec
    least: float
    k1: float
    nu: float
    count: float
    spin: float
    kappa: float
    whole: float
    begun: float
    pole: float
    amplitude: Vec
    norm: float
    axes: Mat
    unit_of_time: float
    unit_of_momentum: float


Direction = tuple[Any, Any, Any]


def direction(p: Polhode, t: Any) -> tuple[Direction, Any, Any, Any]:
    """The direction of the momentum, from the axis p on, at the time t; sn, cn, and the half turns made until then."""
    u = p.begin + p.rate * t
    turns = nearest(u / p.half)
    argument = u - turns * p.half
    s, c, d = elliptic(p, where(abs(argument) <= p.half, argument, 0.0))
    odd = abs(0.5 * turns - nearest(0.5 * turns))  # a half
    sign = 1.0 - 4.0 * odd
    x, y, z = p.amplitude[0] * (sign * c), p.amplitude[1] * (sign * s), p.amplitude[2] * d
    first = p.pole == 0.0
    return (where(first, x, z), where(first, y, x), where(first, z, y)), s, c, turns


def angle(p: Polhode, t: Any, s: Any, c: Any, turns: Any) -> Any:
    """psi at the time t, where sn, cn and the half turns are these."""
    return p.spin * t + p.kappa * (turns * p.whole + (third_kind(s, c, p.k1, p.nu, p.count) - p.begun))


def elliptic(p: Polhode, u: Any) -> tuple[Any, Any, Any]:
    """Jacobi's functions sn, cn, dn, |u| <= K, by descending Landen transformations: from the
    circle, a = b, up to (1, k').

    With c/s = a cn/sn, s kept, one step is  c <- c dn,  dn <- (b s^2 + c^2/a')/(a s^2 + c^2/a'), where a' = (a + b)/2
    is the a of the step before. All terms are positive: cn and dn stay accurate relatively, however
    close k' is to 0.

    Source: DLMF 22.7.2-22.7.4, with 1 - k1 sn^2 = cn^2 + (1 - k1) sn^2.
    """
    s, c = sin_cos(p.least * u)
    c, s2, below, dn = p.least * c, s * s, p.least, 1.0
    for i in range(len(p.a) - 1, -1, -1):
        c2 = c * c / below
        c, dn, below = c * dn, (p.b[i] * s2 + c2) / (p.a[i] * s2 + c2), p.a[i]
    norm = sqrt(s2 + c * c)
    return s / norm, c / norm, dn


def third_kind(s: Any, c: Any, k1: float, nu: float, count: float) -> Any:
    """T = integral of sn^2/(1 + nu sn^2) from 0 to u, |u| <= K. Source: DLMF 19.25.14 (T = (F - Pi)/nu there)."""
    s2, c2 = s * s, c * c
    return s * s2 * elliprj(c2, c2 + k1 * k1 * s2, 1.0, 1.0 + nu * s2, count) / 3.0


def momentum(p: Any, e: Direction) -> tuple[Any, ...]:
    """The momentum in the body."""
    x, y, z = p.norm * e[0], p.norm * e[1], p.norm * e[2]
    return tuple([p.unit_of_momentum * in_body(p.axes, x, y, z, j) for j in range(3)])


def frame(e: Direction) -> tuple[Direction, Direction]:
    """a and e x a, along the axes from p on: the axis p made orthogonal to e and normalised, and
    what is orthogonal to both.
    """
    r = sqrt(e[1] * e[1] + e[2] * e[2])
    return (r, -e[0] * e[1] / r, -e[0] * e[2] / r), (0.0, e[2] / r, -e[1] / r)


def attitude(axes: Mat, start: Mat, e: Direction, c: Any, s: Any) -> tuple[Any, ...]:
    """The nine entries of start Rot3(psi) P(e), row after row; c, s : cosine and sine of psi.
    start : g(0) P(e(0))^T.
    """
    a, b = frame(e)
    x = [c * a[j] - s * b[j] for j in range(3)]
    y = [s * a[j] + c * b[j] for j in range(3)]
    entries: list[Any] = []
    for i in range(3):
        m = [start[i][0] * x[j] + start[i][1] * y[j] + start[i][2] * e[j] for j in range(3)]
        entries = [*entries, *[in_body(axes, m[0], m[1], m[2], j) for j in range(3)]]
    return tuple(entries)


def in_body(axes: Mat, x: Any, y: Any, z: Any, j: int) -> Any:
    """Component j in the body of what is x, y, z along the axes."""
    return axes[0][j] * x + axes[1][j] * y + axes[2][j] * z


# ------------------------------------------------------------------ numbers


def nearest(x: Any) -> Any:
    """The whole number nearest to x."""
    return where(abs(x) < WHOLE, (x + ROUNDING) - ROUNDING, x)


def sin_cos(x: Any) -> tuple[Any, Any]:
    """Sine and cosine, to rounding.  From 2^50 on the last digit of x is a quarter of a
    radian and more: the angle is unknown, and zero is taken.
    """
    x = where(abs(x) < 0.5 * WHOLE, x, 0.0)
    quarters = nearest(PER_RADIAN * x)
    half = 0.5 * (((x - quarters * QUARTER_TURN[0]) - quarters * QUARTER_TURN[1]) - quarters * QUARTER_TURN[2])
    h2 = half * half
    s = half * polynomial(SINC, h2)
    s, c = 2.0 * s * (1.0 - h2 * polynomial(VERSINE, h2)), 1.0 - 2.0 * (s * s)
    k = quarters - 4.0 * nearest(0.25 * quarters)  # -2, -1, 0, 1, 2
    s, c = where(abs(k) == 1.0, c, s), where(abs(k) == 1.0, s, c)
    return where((abs(k) == 2.0) | (k == -1.0), -s, s), where((abs(k) == 2.0) | (k == 1.0), -c, c)


# ------------------------------------------------------------------ the driver of native code


def moved(p: Polhode, start: Mat | None, times: Any, rows: Any) -> None:
    """The motion at one time."""
    t = at(p, read(times, 0, NUMBER))
    e, s, c, turns = direction(p, t)
    mu = vec(*momentum(p, e))
    if start is None:
        write(rows, 0, mu, MOMENTUM)
    else:
        sine, cosine = sin_cos(angle(p, t, s, c, turns))
        write(rows, 0, (mu, vec(*attitude(p.axes, start, e, cosine, sine))), WITH_ATTITUDE)


def at(p: Any, t: Any) -> Any:
    """A time in the unit of the motion."""
    t = p.unit_of_time * t
    return where(t > LONGEST, LONGEST, where(t < -LONGEST, -LONGEST, t))
