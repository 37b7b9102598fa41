"""Kepler's problem in closed form: where a planet is at any time, on ellipses, parabolas and
hyperbolas.

Seen from the pericentre, with the start's distance r_0 as the unit of length and (r_0^3/k)^(1/2) as
that of time,

    t = p G_1 + G_3,   r = p + e G_2,   q = (p - G_2, eta G_1),   v = (-G_1, eta G_0)/r,

p the distance of the pericentre, eta the angular momentum, G_n = s^n c_n(b s^2) and b = -2 E.  No
digits cancel, near a parabola and on the way through a close pericentre neither.  The constants are
computed with a hundred digits from the numbers given, and rounded once; the period and the time of
the pericentre are sums of parts, so that whole revolutions are taken off without loss.

Source: Danby, Fundamentals of Celestial Mechanics, 2nd ed., sections 6.3, 6.9.
"""

from __future__ import annotations

import functools
import math
from decimal import Context, Decimal, localcontext
from typing import Any, NamedTuple

import numpy as np

from ...compiler import row_driver
from ...compiler.driver import accepted, attempt, itself, read, write
from ...errors import InvalidInput
from ...formulas import Record, Vec, asinh, cbrt, record, sqrt, vec, where
from ...formulas.classes.layouts import NUMBER, vector_layout
from ...formulas.numbers.double_double import two_sum
from ..bodies.polhode import nearest
from .decimals import DIGITS, PI, cos_sin
from .universal_variables import solved

PLACE, NAN = vector_layout(4), float("nan")

PIECE = 1024
"""So many times are taken first, then twice as many, and so on: native code is asked for before each piece."""

FAR = 2.0
"""From this hyperbolic anomaly on a logarithm is nearer than the root of a cubic."""


@record
class Conic(Record):
    """The constants of an orbit.

    period : its three parts, the first two of so few digits that 2^26 of them are exact; zero on
    open orbits.  per : revolutions in a unit of time, zero on open orbits.  half : a little more
    than half of the period, infinite on open orbits, in the unit of time.  since : the time from the
    pericentre to the start, in two parts.  pace : 1/(the unit of time).
    b, e, pericentre, eta : as in the first lines of this module.  bend : (e/6)^(1/3).
    places, speeds : what takes x, y and v_x, v_y to the frame of the start, rows of 2.
    """

    period: Vec
    per: float
    half: float
    since: Vec
    pace: float
    b: float
    e: float
    pericentre: float
    eta: float
    bend: float
    places: Vec
    speeds: Vec


def place(c: Conic, t: float) -> Vec:
    """Position and velocity at the time t after the start, (4,).  Not numbers where the planet meets the sun."""
    n = nearest((t + c.since[0]) * c.per)
    a, lost_0 = two_sum(t - n * c.period[0], -(n * c.period[1]))
    a, lost_1 = two_sum(a, c.since[0])
    tau = c.pace * (a + ((lost_0 + lost_1) + (c.since[1] - n * c.period[2])))
    tau = where(abs(tau) <= c.half, tau, 0.0)  # else the phase has no digit left
    G1, G2, _, ended = solved(c.pericentre, 0.0, 1.0, c.b, tau, first_guess(c, tau))
    r = where(ended, c.pericentre + c.e * G2, NAN)
    x, y, u, v = c.pericentre - G2, c.eta * G1, -G1 / r, c.eta * (1.0 - c.b * G2) / r
    return vec(
        c.places[0] * x + c.places[1] * y,
        c.places[2] * x + c.places[3] * y,
        c.speeds[0] * u + c.speeds[1] * v,
        c.speeds[2] * u + c.speeds[3] * v,
    )


def first_guess(c: Conic, tau: float) -> float:
    """The s with  tau = p s + e s^3/6, nearly; far out on a hyperbola a logarithm."""
    root = cbrt(tau)
    s = tau / (c.pericentre + c.bend * (root * root))
    if c.b < 0.0:
        root = sqrt(-c.b)
        mean = -c.b * root * tau
        far = asinh((mean + asinh(mean / c.e)) / c.e)
        s = where(root * abs(s) > FAR, far / root, s)
    return s


def _placed(c: Conic, times: Any, rows: Any) -> None:
    """The driver of native code: one time."""
    position = attempt(place, c, read(times, 0, NUMBER))
    write(rows, 0, vec(NAN, NAN, NAN, NAN), PLACE)
    if accepted(position, itself):
        write(rows, 0, position, PLACE)


_PLACED = row_driver.RowDriver(_placed)


def exact_kepler(q: Vec, p: Vec, attraction: float, t: np.ndarray) -> np.ndarray:
    """Positions and velocities, (n, 4), at the times t, (n,), from the start.

    q, p : (2,), taken to be exact.  The error is a few rounding errors of |q| and |p| there, and
    what rounding of t does to them.
    """
    conic, values = _prepared(q, p, attraction)

    def in_python(x: np.ndarray, rows: np.ndarray) -> None:
        for i, time in enumerate(x.tolist()):
            try:
                rows[i] = place(conic, time)
            except ZeroDivisionError:
                rows[i] = NAN

    begin = 0
    pieces: list[np.ndarray] = []
    while begin < len(t) or not pieces:
        end = PIECE + 2 * begin
        pieces.append(_PLACED.rows(values, t[begin:end], 4, in_python))
        begin = end
    return pieces[0] if len(pieces) == 1 else np.concatenate(pieces)


# ------------------------------------------------------------------ the constants


class _PreparedOrbit(NamedTuple):
    conic: Conic
    values: row_driver.Arguments


@functools.lru_cache(256)
def _prepared(q: Vec, p: Vec, attraction: float) -> _PreparedOrbit:
    orbit = conic(q, p, attraction)
    return _PreparedOrbit(orbit, row_driver.Arguments(orbit))


def conic(q: Vec, p: Vec, attraction: float) -> Conic:
    """The orbit through q with the velocity p.  Raises InvalidInput for q = 0."""
    if not any(q):
        raise InvalidInput("Kepler.exact: q is zero: the planet starts in the sun")
    with localcontext(Context(prec=DIGITS + 20)):
        k = Decimal(attraction)
        (x, y), (u, v) = [Decimal(a) for a in q], [Decimal(a) for a in p]
        r0 = (x * x + y * y).sqrt()
        speed = (k / r0).sqrt()
        unit = r0 / speed
        momentum = (x * v - y * u) / (r0 * speed)
        turns = -1 if momentum < 0 else 1
        eta, rise = abs(momentum), (x * u + y * v) / (r0 * speed)
        along, across = eta * eta - 1, eta * rise  # e cos and e sin of the angle to the start
        e = (along * along + across * across).sqrt()
        if e < _TINY:
            e, along, across = Decimal(0), Decimal(1), Decimal(0)
        b, pericentre = 2 - eta * eta - rise * rise, eta * eta / (1 + e)
        c, s = (along / e, across / e) if e else (along, across)
        start, side = (x / r0, y / r0), (-turns * y / r0, turns * x / r0)
        first = [c * m - s * n for m, n in zip(start, side)]
        second = [s * m + c * n for m, n in zip(start, side)]
        since, period = _since(b, e, pericentre, rise) * unit, Decimal(0)
        if b > 0:
            period = 2 * PI / (b * b.sqrt()) * unit
        parts, since_parts = _parts(period, (26, 26, 53)), _parts(since, (53, 53))
        if not math.isfinite(parts[0]):
            parts = [0.0, 0.0, 0.0]
        frame = [(first[i], second[i]) for i in range(2)]
        return Conic(
            vec(*parts),
            float(1 / period) if parts[0] else 0.0,
            1.001 * math.pi * float(b) ** -1.5 if parts[0] else math.inf,
            vec(*since_parts),
            float(1 / unit),
            float(b),
            float(e),
            float(pericentre),
            float(eta),
            float(e / 6) ** (1.0 / 3.0),
            vec(*[float(r0 * a) for row in frame for a in row]),
            vec(*[float(speed * a) for row in frame for a in row]),
        )


_TINY = Decimal(10) ** -60


def _since(b: Decimal, e: Decimal, pericentre: Decimal, rise: Decimal) -> Decimal:
    """The time from the pericentre to the distance 1, where r' is this."""
    if not e:
        return Decimal(0)
    G1, G2 = rise / e, (1 - pericentre) / e
    if abs(b) * (G1 * G1 + G2) < Decimal(10) ** -40:  # as on a parabola
        return pericentre * G1 + G1 * G2 / 3
    root = abs(b).sqrt()
    sine, cosine = root * G1, 1 - b * G2
    if b < 0:
        angle = (abs(sine) + (1 + sine * sine).sqrt()).ln().copy_sign(sine)
    else:
        near = Decimal(math.atan2(sine, cosine))
        c, s = cos_sin(near)
        d = sine * c - cosine * s  # the sine of what is missing
        angle = near + d + d**3 / 6 + 3 * d**5 / 40 + 5 * d**7 / 112
    return (angle / root - e * G1) / b


def _parts(x: Decimal, digits: tuple[int, ...]) -> list[float]:
    """Floats of these numbers of binary digits, whose sum is x."""
    floats = []
    for count in digits:
        whole = float(x)
        mantissa, exponent = math.frexp(whole)
        if math.isfinite(whole):
            whole = math.ldexp(round(math.ldexp(mantissa, count)), exponent - count)
            x = x - Decimal(whole)
        floats.append(whole)
    return floats
