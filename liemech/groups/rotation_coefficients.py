"""The coefficients of rotations: functions of x = theta^2 that stand before W and W^2, W = hat(w), |w| = theta.

    exp(W)     = 1 + sinc(x) W    + versine(x) W^2
    dexp_w     = 1 + versine(x) W + segment(x) W^2
    dexp_w^-1  = 1 - W/2          + bernoulli(x) W^2

All are analytic in x >= 0 up to the poles of the last at theta = 2 pi, 4 pi, ...  Up to x = LIMIT they are polynomials:
no root, no division, and so accurate that sinc and versine together change the length of a rotated vector by less than
1e-19 apart from rounding.  Beyond, half angles that never subtract nearly equal numbers.  Relative error for every
double x, next to the zeros of sinc and versine and to the poles too: below 1.5 eps for the polynomials, 3 eps beyond
(4 eps for `bernoulli_slope`).  Only beyond the first pole has `bernoulli` zeros of its own, and near them an absolute
accuracy.

The comparison `x <= LIMIT` needs a number.  For symbols, put the closed forms of the docstrings in the place of these
functions at the border; a branch for them here would cost every step.

Source: Iserles, Munthe-Kaas, Norsett, Zanna, Lie-group methods, Acta Numerica 9 (2000), appendix B; sinc, versine and
segment are the Stumpff functions c_1, c_2, c_3 of celestial mechanics.
"""

from __future__ import annotations

from ..native import cos, sin, sqrt, tan

LIMIT = 2.5
"""Up to this x (theta = 1.58, a little more than a quarter turn) the polynomials hold."""

SPLITTER = 2.0**27 + 1.0
"""Cuts a double into two halves of 26 bits.  Source: Dekker, Numer. Math. 18 (1971), 224."""

# Computed by docs/derivations/rotation_polynomials.py; the tests compute them again.
SINC = (
    1.0,
    -0.16666666666666666,
    0.00833333333333326,
    -0.00019841269841246984,
    2.7557319220197898e-06,
    -2.505210801673136e-08,
    1.6059021986869413e-10,
    -7.646384741955051e-13,
    2.795919307378791e-15,
    -6.819465702868425e-18,
)
VERSINE = (
    0.5,
    -0.041666666666666664,
    0.0013888888888888707,
    -2.4801587301530652e-05,
    2.755731921464292e-07,
    -2.087675608418934e-09,
    1.147069253848644e-11,
    -4.7776141669933567e-14,
    1.5258407365678244e-16,
    -1.1138553254483034e-19,
)
SEGMENT = (
    0.16666666666666666,
    -0.008333333333333333,
    0.00019841269841269752,
    -2.7557319223958237e-06,
    2.5052108380907705e-08,
    -1.6059043400058734e-10,
    7.647138163685982e-13,
    -2.810561551509558e-15,
    8.047561164332583e-18,
    -5.243368350350154e-21,
)
BERNOULLI = (
    0.08333333333333333,
    0.0013888888888888963,
    3.306878306866368e-05,
    8.267195773782133e-07,
    2.087675521102329e-08,
    5.284217179103156e-10,
    1.3380060871983948e-11,
    3.403554880763748e-13,
    8.123247447490993e-15,
    3.0022949434740904e-16,
)
STUMPFF4 = (
    0.041666666666666664,
    -0.001388888888888889,
    2.4801587301587715e-05,
    -2.755731922411423e-07,
    2.0876757008961226e-09,
    -1.1470747631569332e-11,
    4.779596343019204e-14,
    -1.5660804094467186e-16,
    4.909204026232286e-19,
    -7.371304633292864e-21,
)
STUMPFF5 = (
    0.008333333333333333,
    -0.0001984126984126984,
    2.7557319223985876e-06,
    -2.505210838543672e-08,
    1.605904383596632e-10,
    -7.647163647079502e-13,
    2.8114521968315275e-15,
    -8.218839202066883e-18,
    1.9222618087719137e-20,
    -9.544650731907881e-24,
)


def polynomial(c: tuple[float, ...], x: float) -> float:
    """The polynomial of ten coefficients, c_0 + c_1 x + ... + c_9 x^9.

    Summed in groups (after Estrin), it is six operations deep; one coefficient after the other, eighteen.
    """
    x2 = x * x
    x3 = x * x2
    low = c[0] + (c[1] * x + c[2] * x2)
    middle = (c[3] + c[4] * x) + c[5] * x2
    high = (c[6] + c[7] * x) + x2 * (c[8] + c[9] * x)
    return (low + x3 * middle) + (x3 * x3) * high


def sin_cos_root(x: float) -> tuple[float, float]:
    """Sine and cosine of sqrt(x), each with its relative accuracy, even next to a zero.

    The root is rounded, sqrt(x) = t + e, and next to a zero of the sine this alone would cost all digits.  x - t^2 is
    computed exactly, from the halves of t, and e = (x - t^2)/(2 t) put back to first order.
    """
    t = sqrt(x)
    high = SPLITTER * t - (SPLITTER * t - t)
    low = t - high
    e = (((x - high * high) - 2.0 * high * low) - low * low) / (2.0 * t)
    s = sin(t)
    c = cos(t)
    return s + e * c, c - e * s


def exp_coefficients(x: float) -> tuple[float, float]:
    """`sinc` and `versine`, what the exponential needs.

    The polynomials are evaluated in any case: the rare branch then stands aside of the common path and costs it nothing.
    """
    a, b = polynomial(SINC, x), polynomial(VERSINE, x)
    if x > LIMIT:
        s, _ = sin_cos_root(x)
        half, _ = sin_cos_root(0.25 * x)
        a, b = s / sqrt(x), 2.0 * half * half / x
    return a, b


def sinc(x: float) -> float:
    """Sine over angle, sin(theta)/theta with x = theta^2; 1 at zero."""
    return exp_coefficients(x)[0]


def versine(x: float) -> float:
    """Versed sine over angle squared, (1 - cos theta)/theta^2 with x = theta^2; 1/2 at zero."""
    return exp_coefficients(x)[1]


def segment(x: float) -> float:
    """Circular segment over angle cubed, (theta - sin theta)/theta^3 with x = theta^2; 1/6 at zero."""
    if x <= LIMIT:
        return polynomial(SEGMENT, x)
    t = sqrt(x)
    return (t - sin(t)) / (x * t)


def dexp_coefficients(x: float) -> tuple[float, float, float, float]:
    """`versine` and `segment`, what the differential of the exponential needs, and their derivatives with respect to x.

    With the next two Stumpff functions c_4, c_5:  versine = 1/2 - x c_4, segment = 1/6 - x c_5, and
    versine' = c_4 - segment/2, segment' = (3 c_5 - c_4)/2.
    """
    c4, c5 = polynomial(STUMPFF4, x), polynomial(STUMPFF5, x)
    b, c = 0.5 - x * c4, 1 / 6 - x * c5
    if x > LIMIT:
        b, c = versine(x), segment(x)
        c4, c5 = (0.5 - b) / x, (1 / 6 - c) / x
    return b, c, c4 - 0.5 * c, 0.5 * (3.0 * c5 - c4)


def bernoulli(x: float) -> float:
    """Coefficient of the inverse differential of exp, (1 - (theta/2) cot(theta/2))/theta^2 with x = theta^2.

    1/12 at zero, 1/pi^2 at half a turn, a pole at a full turn.  Its Taylor coefficients are |B_2k|/(2k)!, B_2k the
    Bernoulli numbers.  Doubling of the angle, cot 2a = (cot a - tan a)/2, gives a sum of positive terms:

        d(x) = d(x/4)/4 + tan(theta/4)/(4 theta).
    """
    if x <= LIMIT:
        return polynomial(BERNOULLI, x)
    if x <= 4.0 * LIMIT:
        t = sqrt(x)
        return 0.25 * (polynomial(BERNOULLI, 0.25 * x) + tan(0.25 * t) / t)
    s, c = sin_cos_root(0.25 * x)
    return (1.0 - 0.5 * sqrt(x) * c / s) / x
