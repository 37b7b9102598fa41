"""The coefficients of rotations: functions of x = theta^2 that stand before W and W^2, W = hat(w),
|w| = theta.

    exp(W)     = 1 + sinc(x) W    + versine(x) W^2
    dexp_w     = 1 + versine(x) W + segment(x) W^2
    dexp_w^-1  = 1 - W/2          + bernoulli(x) W^2

Rigid motions need the derivatives with respect to x too, and Newton's method on them two second
derivatives.

All are analytic in x >= 0, the last before its pole at theta = 2 pi.  Up to x = LIMIT they are
polynomials: no root, no division, and so accurate that sinc and versine together change the length
of a rotated vector by less than 2e-19 apart from rounding.  Beyond, half angles that never subtract
nearly equal numbers.  Relative error for every double x, next to the zeros of sinc and versine and
to the pole too: below 1.5 eps for the polynomials, 3 eps beyond (derivatives: 3 eps of their
terms).

The comparison `x <= LIMIT` needs a number.  For symbols, put the closed forms of the docstrings in
the place of these functions; a branch for them here would cost every step.

Source: Iserles, Munthe-Kaas, Norsett, Zanna, Lie-group methods, Acta Numerica 9 (2000), appendix B;
sinc, versine and segment are the Stumpff functions c_1, c_2, c_3 of celestial mechanics.
"""

from __future__ import annotations

from ...errors import InvalidType, OutsideChart
from ...formulas import Vec, cos, horner, sin, sqrt, tan, where
from ...formulas.numbers.double_double import is_long, rounded_number, two_sum
from ...formulas.numbers.dual import is_series, value_of
from ..bernoulli import BERNOULLI as NUMBERS
from . import stumpff

LIMIT = 0.4
"""Up to this x (theta = 0.63, a tenth of a turn: more than a step should make) the polynomials
hold.
"""

WHOLE_TURN = 39.478417604357375
"""(2 pi)^2 less 8 units in the last place: where dexp is singular for the first time, and just
before, where no digit is left.
"""

SPLITTER = 2.0**27 + 1.0
"""Cuts a double into two halves of 26 bits.  Source: Dekker, Numer. Math. 18 (1971), 224."""

# Computed by docs/derivations/rotation_polynomials.py; the tests compute them again.
SINC = (
    1.0,
    -0.16666666666666663,
    0.00833333333333182,
    -0.00019841269839017376,
    2.7557317622636563e-06,
    -2.5051522133788902e-08,
    1.5952378576761297e-10,
)
VERSINE = (
    0.5,
    -0.041666666666666664,
    0.0013888888888887944,
    -2.480158730018016e-05,
    2.755731822331995e-07,
    -2.087639056185313e-09,
    1.1404068711980445e-11,
)
BERNOULLI = (
    0.08333333333333333,
    0.001388888888888877,
    3.3068783069360897e-05,
    8.267195673709237e-07,
    2.087682644382282e-08,
    5.281585624531128e-10,
    1.386118227211967e-11,
)
OF_SERIES = tuple([abs(b) for b in NUMBERS[2::2]])
"""|B_2k|/(2k)!, for power series, which ask for all derivatives."""

ARCSINE = (
    1.0,
    0.16666666666663632,
    0.07500000002357851,
    0.04464285105005667,
    0.0303826670664572,
    0.022328962275578693,
    0.018613573250000653,
)
ARCSINE_LIMIT = 0.025
"""arcsin(y)/y of x = y^2, up to this x, the squared sine of half an angle of 0.32, to 1.3e-17."""

STUMPFF4 = (
    0.041666666666666664,
    -0.001388888888888889,
    2.480158730158839e-05,
    -2.7557319224724247e-07,
    2.0876757146334453e-09,
    -1.1470719729895683e-11,
    4.764673072706606e-14,
)
STUMPFF5 = (
    0.008333333333333333,
    -0.0001984126984126984,
    2.755731922398578e-06,
    -2.505210838524148e-08,
    1.6059043681290294e-10,
    -7.64710385181737e-13,
    2.800217162164268e-15,
)
BERNOULLI_SLOPE = (
    0.001388888888888889,
    6.613756613756372e-05,
    2.480158730276442e-06,
    8.350702604811484e-08,
    2.642109203885492e-09,
    8.024224540181275e-11,
    2.4700363823686915e-12,
)
VERSINE_CURVATURE = (
    0.002777777777777778,
    -0.0001488095238095238,
    3.306878306877966e-06,
    -4.1753513972442996e-08,
    3.441223519215949e-10,
    -2.0073388030015064e-12,
    8.691323078310912e-15,
)
SEGMENT_CURVATURE = (
    0.0003968253968253968,
    -1.6534391534391536e-05,
    3.006253006253251e-07,
    -3.211808767556669e-09,
    2.2941491847650753e-11,
    -1.1808195587871567e-13,
    4.597527216715691e-16,
)


def polynomial(c: tuple[float, ...], x: float) -> float:
    """The polynomial of seven coefficients, c_0 + c_1 x + ... + c_6 x^6.

    Summed in groups (after Estrin), it is five operations deep; one coefficient after the other,
    twelve.
    Raises InvalidType for a number of two doubles, which such a polynomial does not serve.
    """
    if is_long(x):
        raise InvalidType(
            "precision: these functions of angles are known to 16 digits only; take Cayley() or precision='double'"
        )
    x2 = x * x
    low = (c[0] + c[1] * x) + x2 * (c[2] + c[3] * x)
    return low + (x2 * x2) * ((c[4] + c[5] * x) + x2 * c[6])


def sin_cos_root(x: float, low: float = 0.0) -> tuple[float, float]:
    """Sine and cosine of sqrt(x + low), |low| <= eps x, each with its relative accuracy, even next
    to a zero.

    The root is rounded, sqrt(x) = t + e, and next to a zero of the sine this alone would cost all
    digits.  x - t^2 is computed exactly, from the halves of t, and e = (x - t^2 + low)/(2 t) put
    back: to first order as long as e^2 is nothing.
    """
    if is_long(value_of(x)):
        return sin(sqrt(x)), cos(sqrt(x))
    t = sqrt(x)
    high = SPLITTER * t - (SPLITTER * t - t)
    low_half = t - high
    e = ((((x - high * high) - 2.0 * high * low_half) - low_half * low_half) + low) / (2.0 * t)
    s, c = sin(t), cos(t)
    near = 1.0
    if t > SPLITTER:
        e, near = sin(e), cos(e)
    return near * s + e * c, near * c - e * s


def lost_in_square(w: Vec, x: float) -> float:
    """|w|^2 - x, what was rounded away when x = |w|^2 was computed: beyond many turns it decides
    where the last one ends.

    Source: Dekker, Numer. Math. 18 (1971), 224: exact products; the sums are those of `two_sum`.
    """
    if is_long(value_of(x)):
        return 0.0
    total, lost = 0.0, 0.0
    for c in w:
        square, high = c * c, SPLITTER * c - (SPLITTER * c - c)
        low_half = c - high
        of_square = ((high * high - square) + 2.0 * high * low_half) + low_half * low_half
        total, of_sum = two_sum(total, square)
        lost = lost + (of_square + of_sum)
    return (total - x) + lost


def exp_coefficients(x: float, w: Vec | None = None) -> tuple[float, float]:
    """`sinc` and `versine`, what the exponential needs.

    w : the vector of which x is the squared length; given, sine and cosine are those of its length
    before x was rounded.

    The polynomials are evaluated in any case: the rare branch then stands aside of the common path
    and costs it nothing.
    """
    if is_long(value_of(x)):
        c1, c2, *_ = stumpff.stumpff(x)
        return c1, c2
    a, b = polynomial(SINC, x), polynomial(VERSINE, x)
    if x > LIMIT:
        a, b = _by_half_angles(x, 0.0 if w is None else lost_in_square(w, x))
    return a, b


def _by_half_angles(x: float, low: float) -> tuple[float, float]:
    """`sinc` and `versine` where theta is no small angle."""
    s, _ = sin_cos_root(x, low)
    half, _ = sin_cos_root(0.25 * x, 0.25 * low)
    return s / sqrt(x), 2.0 * half * half / x


def sinc(x: float) -> float:
    """Sine over angle, sin(theta)/theta with x = theta^2; 1 at zero."""
    return exp_coefficients(x)[0]


def versine(x: float) -> float:
    """Versed sine over angle squared, (1 - cos theta)/theta^2 with x = theta^2; 1/2 at zero."""
    return exp_coefficients(x)[1]


def dexp_coefficients(x: float) -> tuple[float, float, float, float]:
    """`versine` and `segment`, what the differential of the exponential needs, and their
    derivatives.
    """
    _, b, c, _, b_slope, c_slope = all_coefficients(x)
    return b, c, b_slope, c_slope


def all_coefficients(x: float, w: Vec | None = None) -> tuple[float, float, float, float, float, float]:
    """`sinc`, `versine`, `segment` and their derivatives with respect to x; w as in
    `exp_coefficients`.

    With the next two Stumpff functions c_4, c_5:  versine = 1/2 - x c_4, segment = 1/6 - x c_5,
    sinc = 1 - x segment, and sinc' = (segment - versine)/2, versine' = c_4 - segment/2 = (sinc - 2
    versine)/(2 x), segment' = (3 c_5 - c_4)/2 = (versine - 3 segment)/(2 x).
    """
    if is_long(value_of(x)):
        return stumpff.coefficients(x)
    c4, c5 = polynomial(STUMPFF4, x), polynomial(STUMPFF5, x)
    b, c = 0.5 - x * c4, 1 / 6 - x * c5
    a, b_slope, c_slope = ((1.0 - x * (1 / 6)) + (x * x) * c5, (c4 - 1 / 12) + (0.5 * x) * c5, 1.5 * c5 - 0.5 * c4)
    if x > LIMIT:
        a, b = _by_half_angles(x, 0.0 if w is None else lost_in_square(w, x))
        if x <= 16.0 * LIMIT:
            q = 0.25 * x
            if q > LIMIT:
                q = 0.25 * q
            c, c4, c5 = _doubled(q, polynomial(STUMPFF4, q), polynomial(STUMPFF5, q))
            if x > 4.0 * LIMIT:
                c, c4, c5 = _doubled(4.0 * q, c4, c5)
            b_slope, c_slope = c4 - 0.5 * c, 0.5 * (3.0 * c5 - c4)
        else:
            c = (1.0 - a) / x
            b_slope, c_slope = (0.5 * a - b) / x, (0.5 * b - 1.5 * c) / x
    return a, b, c, 0.5 * (c - b), b_slope, c_slope


def dexp_curvatures(x: float) -> tuple[float, float]:
    """The second derivatives of `versine` and `segment`: for the Jacobian of Newton's method, which
    forgives a few digits.

    versine'' = (sinc' - 4 versine')/(2 x),  segment'' = (versine' - 5 segment')/(2 x).
    """
    x = rounded_number(x)
    b, c = polynomial(VERSINE_CURVATURE, x), polynomial(SEGMENT_CURVATURE, x)
    if x > LIMIT:
        _, _, _, a_slope, b_slope, c_slope = all_coefficients(x)
        b, c = (0.5 * a_slope - 2.0 * b_slope) / x, (0.5 * b_slope - 2.5 * c_slope) / x
    return b, c


def _doubled(q: float, c4: float, c5: float) -> tuple[float, float, float]:
    """The Stumpff functions c_3, c_4, c_5 of twice the angle, x = 4 q: sums of positive terms where
    q < 2.

    c_3(4q) = (c_3 + c_1 c_2)/4,  c_4(4q) = c_3 (1 + c_1)/8,  c_5(4q) = (1/12 + c_5 (1 - q/2) + c_4 c_1)/16,
    with c_3 = 1/6 - q c_5, c_2 = 1/2 - q c_4, c_1 = 1 - q c_3.
    """
    c3 = 1 / 6 - q * c5
    c1 = 1.0 - q * c3
    return (
        0.25 * (c3 + c1 * (0.5 - q * c4)),
        0.125 * c3 * (1.0 + c1),
        0.0625 * ((c5 * (1.0 - 0.5 * q) + c4 * c1) + 1 / 12),
    )


def segment(x: float) -> float:
    """Circular segment over angle cubed, (theta - sin theta)/theta^3 with x = theta^2; 1/6 at zero."""
    return dexp_coefficients(x)[1]


def bernoulli(x: float) -> float:
    """Coefficient of the inverse differential of exp, (1 - (theta/2) cot(theta/2))/theta^2 with
    x = theta^2.

    1/12 at zero, 1/pi^2 at half a turn.  Its Taylor coefficients are |B_2k|/(2k)!, B_2k the
    Bernoulli numbers.
    Raises OutsideChart from a full turn on, where it has a pole.
    """
    if is_long(value_of(x)):
        return bernoulli_coefficients(x)[0]
    if is_series(x):
        check_chart(x)
        close = x <= 1.0
        near, t = where(close, x, 0.0), sqrt(where(close, 1.0, x))
        far = (1.0 - 0.5 * t * cos(0.5 * t) / sin(0.5 * t)) / (t * t)
        return where(close, horner(OF_SERIES, near), far)
    d = polynomial(BERNOULLI, x)
    if x > LIMIT:
        check_chart(x)
        d = _bernoulli_by_halves(x)
    return d


def _bernoulli_by_halves(x: float) -> float:
    """Halving the angle, cot 2a = (cot a - tan a)/2, gives a sum of positive terms,
    d(x) = d(x/4)/4 + tan(theta/4)/(4 theta).
    """
    total, weight = 0.0, 1.0
    if x > 16.0 * LIMIT:
        s, c = sin_cos_root(0.25 * x)
        total, weight, x = (1.0 - 0.5 * sqrt(x) * c / s) / x, 0.0, 0.0
    while x > LIMIT:
        t = sqrt(x)
        weight = 0.25 * weight
        total = total + weight * (tan(0.25 * t) / t)
        x = 0.25 * x
    return total + weight * polynomial(BERNOULLI, x)


def bernoulli_coefficients(x: float) -> tuple[float, float]:
    """`bernoulli` and its derivative with respect to x.  Raises OutsideChart from a full turn on.

    The derivative of the sum above is one of positive terms again,
    d'(x) = d'(x/4)/16 + segment(x/4)/(128 cos^2(theta/4)).
    """
    if is_long(value_of(x)):
        check_chart(x)
        return stumpff.bernoulli(x)
    d, d_slope = polynomial(BERNOULLI, x), polynomial(BERNOULLI_SLOPE, x)
    if x > LIMIT:
        check_chart(x)
        d, d_slope = 0.0, 0.0
        weight, slope_weight = 1.0, 1.0
        while x > LIMIT:
            quarter = 0.25 * x
            s, c = sin_cos_root(0.25 * quarter)
            _, area, _, _ = dexp_coefficients(quarter)
            weight = 0.25 * weight
            d, d_slope = (d + weight * (s / (c * sqrt(x))), d_slope + slope_weight * (area / (128.0 * c * c)))
            x, slope_weight = quarter, 0.0625 * slope_weight
        d, d_slope = (d + weight * polynomial(BERNOULLI, x), d_slope + slope_weight * polynomial(BERNOULLI_SLOPE, x))
    return d, d_slope


def check_chart(x: float) -> None:
    """Raise OutsideChart from a full turn on, where dexp cannot be inverted."""
    if x >= WHOLE_TURN:
        raise OutsideChart(
            f"dexp_inv at the angle {sqrt(x)}: dexp is singular at a full turn, 2 pi = "
            "6.283185307179586; take log(exp(xi)), which is at most "
            "half a turn, or in a step a smaller h"
        )
