"""The Stumpff functions in numbers of two doubles: what coefficients of rotations are made of, to
31 digits.

    c_k(x) = 1/k! - x/(k+2)! + x^2/(k+4)! - ...,   c_k = 1/k! - x c_(k+2),   c_k' = (k c_(k+2) - c_(k+1))/2

Source: Stumpff, Himmelsmechanik I (1959), V.41; for the differential of exp see
`rotation_coefficients`.
"""

from __future__ import annotations

import math
from typing import Any

from ...formulas import horner, sin, sqrt
from ...formulas.numbers.double_double import DoubleDouble, is_long, nested, quotient, series

LIMIT = 1.0
"""Up to this x the series of c_5 and c_6 are summed; beyond, sines and cosines leave more digits
than are wanted.
"""

TERMS, LONG = 14, 7
"""Terms of the series, and how many of them have two doubles: the others leave an error of 1.1e-31
of c_5 at x = 1, and 1e-32 of c_1 and c_2.
"""
C5 = tuple([quotient((-1) ** k, math.factorial(2 * k + 5)) for k in range(TERMS)])
C6 = tuple([quotient((-1) ** k, math.factorial(2 * k + 6)) for k in range(TERMS)])
ONE, HALF, SIXTH, TWENTY_FOURTH = [quotient(1, k) for k in (1, 2, 6, 24)]


def stumpff(x: Any) -> tuple[Any, ...]:
    """c_1, ..., c_6 at x = theta^2."""
    if is_long(x):
        c5, c6 = series(x, C5, LONG), series(x, C6, LONG)
        c4, c3 = nested(TWENTY_FOURTH, -x, c6), nested(SIXTH, -x, c5)
        c2, c1 = nested(HALF, -x, c4), nested(ONE, -x, c3)
    else:  # derivatives, in which the words of a sum would lose theirs
        c5, c6 = [horner([DoubleDouble(*words) for words in terms], x) for terms in (C5, C6)]
        c4, c3 = DoubleDouble(*TWENTY_FOURTH) - x * c6, DoubleDouble(*SIXTH) - x * c5
        c2, c1 = DoubleDouble(*HALF) - x * c4, DoubleDouble(*ONE) - x * c3
    if x > LIMIT:
        theta = sqrt(x)
        half = sin(0.5 * theta)
        c1, c2 = sin(theta) / theta, 2.0 * (half * half) / x
        c3, c4 = (1.0 - c1) / x, (0.5 - c2) / x
        c5, c6 = (DoubleDouble(*SIXTH) - c3) / x, (DoubleDouble(*TWENTY_FOURTH) - c4) / x
    return c1, c2, c3, c4, c5, c6


def coefficients(x: Any) -> Any:
    """`sinc`, `versine`, `segment` and their derivatives, these to 28 digits."""
    c1, c2, c3, c4, c5, _ = stumpff(x)
    return c1, c2, c3, 0.5 * (c3 - c2), c4 - 0.5 * c3, 0.5 * (3.0 * c5 - c4)


def bernoulli(x: Any) -> tuple[Any, Any]:
    """(1 - (theta/2) cot(theta/2))/theta^2 = (c_3 - 2 c_4)/(2 c_2), and its derivative."""
    _, c2, c3, c4, c5, c6 = stumpff(x)
    d = 0.5 * (c3 - 2.0 * c4) / c2
    slope = 0.5 * (3.0 * c5 - c4) - (4.0 * c6 - c5)  # of c_3 - 2 c_4
    return d, (0.5 * slope - d * (c4 - 0.5 * c3)) / c2
