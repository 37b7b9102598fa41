"""The polynomials of `liemech.groups.rigid.rotation_coefficients`, computed from scratch in 60-digit
arithmetic.

Seven coefficients for f(x) = c_0 + c_1 x + ... on [0, L]: keep c_0 .. c_{j-1}, interpolate the
rest.  The nodes are the zeros of the Chebyshev polynomial T_7, stretched so that the smallest zero
falls on x = 0 and the point u = 1 on x = L.  Then the error, which is nearly const x prod
(x - x_k), is T_7 itself: it swings evenly between its bounds, and the polynomial is nearly the best
one.

c_0 is the Taylor coefficient.  Each further coefficient is rounded before the next is computed, so
that the later ones make up for the rounding of the earlier ones.

Run this file to print the coefficients and the largest relative error of each polynomial.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

from mpmath import mp, mpf

from liemech.groups.rigid import rotation_coefficients as code

Function = Callable[[mpf], mpf]
TERMS = 7
DIGITS = 60


def sinc(x: mpf) -> mpf:
    return mp.sin(mp.sqrt(x)) / mp.sqrt(x)


def versine(x: mpf) -> mpf:
    return (1 - mp.cos(mp.sqrt(x))) / x


def segment(x: mpf) -> mpf:
    return (1 - sinc(x)) / x


def bernoulli(x: mpf) -> mpf:
    half = mp.sqrt(x) / 2
    return (1 - half * mp.cot(half)) / x


def stumpff4(x: mpf) -> mpf:
    return (mpf(1) / 2 - versine(x)) / x


def stumpff5(x: mpf) -> mpf:
    return (mpf(1) / 6 - segment(x)) / x


def bernoulli_slope(x: mpf) -> mpf:
    half = mp.sqrt(x) / 2
    return (half * mp.cot(half) + (half / mp.sin(half)) ** 2 - 2) / (2 * x**2)


def versine_curvature(x: mpf) -> mpf:
    """From x versine' = sinc/2 - versine, differentiated once more."""
    sinc_slope, slope = (segment(x) - versine(x)) / 2, (sinc(x) - 2 * versine(x)) / (2 * x)
    return (sinc_slope - 4 * slope) / (2 * x)


def segment_curvature(x: mpf) -> mpf:
    """From x segment' = versine/2 - 3 segment/2."""
    versine_slope, slope = (
        (sinc(x) - 2 * versine(x)) / (2 * x),
        (versine(x) - 3 * segment(x)) / (2 * x),
    )
    return (versine_slope - 5 * slope) / (2 * x)


def arcsine(x: mpf) -> mpf:
    return mp.asin(mp.sqrt(x)) / mp.sqrt(x)


POLYNOMIALS: dict[str, tuple[Function, Fraction, tuple[float, ...]]] = {
    "SINC": (sinc, Fraction(1), code.SINC),
    "VERSINE": (versine, Fraction(1, 2), code.VERSINE),
    "BERNOULLI": (bernoulli, Fraction(1, 12), code.BERNOULLI),
    "STUMPFF4": (stumpff4, Fraction(1, 24), code.STUMPFF4),
    "STUMPFF5": (stumpff5, Fraction(1, 120), code.STUMPFF5),
    "BERNOULLI_SLOPE": (bernoulli_slope, Fraction(1, 720), code.BERNOULLI_SLOPE),
    "VERSINE_CURVATURE": (versine_curvature, Fraction(1, 360), code.VERSINE_CURVATURE),
    "SEGMENT_CURVATURE": (segment_curvature, Fraction(1, 2520), code.SEGMENT_CURVATURE),
}
"""Name in the code: the function, its value at zero, the coefficients in the code."""


def coefficients(f: Function, at_zero: Fraction, limit: float) -> tuple[float, ...]:
    """Seven doubles c for which c_0 + c_1 x + ... + c_6 x^6 is nearly the best approximation of f
    on [0, limit].
    """
    with mp.workdps(DIGITS):
        zeros = [mp.cos((2 * k - 1) * mp.pi / (2 * TERMS)) for k in range(1, TERMS + 1)]
        nodes = [limit * (u - zeros[-1]) / (1 - zeros[-1]) for u in zeros]
        c = [mpf(at_zero.numerator) / at_zero.denominator]
        while len(c) < TERMS:
            x = nodes[: TERMS - len(c)]
            powers = mp.matrix([[xi**j for j in range(len(x))] for xi in x])
            rest = mp.matrix([(f(xi) - mp.polyval(c[::-1], xi)) / xi ** len(c) for xi in x])
            c.append(mpf(float(mp.lu_solve(powers, rest)[0])))
        return tuple(map(float, c))


def relative_error(f: Function, c: tuple[float, ...], limit: float, samples: int = 200) -> float:
    """Largest |c_0 + c_1 x + ... - f(x)| / |f(x)| on (0, limit], the sum taken exactly."""
    with mp.workdps(DIGITS):
        xs = [limit * mpf(i) / samples for i in range(1, samples + 1)]
        return float(max(abs(mp.polyval(c[::-1], x) / f(x) - 1) for x in xs))


if __name__ == "__main__":
    for name, (f, at_zero, _) in POLYNOMIALS.items():
        c = coefficients(f, at_zero, code.LIMIT)
        print(f"# relative error {relative_error(f, c, code.LIMIT):.1e}\n{name} = (")
        print("".join(f"    {ci!r},\n" for ci in c) + ")")
    print("ARCSINE =", coefficients(arcsine, Fraction(1), code.ARCSINE_LIMIT))
