"""The motion of a linear energy on a Poisson manifold, and its mean over a unit of time, by power series."""

from __future__ import annotations

from typing import Any

from ..errors import NoConvergence
from ..formulas import Vec, vec
from ..formulas.numbers.dual import Dual, is_series
from ..formulas.numbers.products import Products
from ..formulas.numbers.series import Series

TERMS = 12
"""Terms of a series; of a step of some tenths of the time scale these are enough at once."""

ROUNDING = 2.0**-54
"""A stretch of the motion is so short that its last two terms are below this part of the point and the first three."""

STRETCHES = 64
"""So many stretches at most; each is half as long as it need be, or longer."""


def linear_motion(structure: Any, y: Vec, p: Vec) -> tuple[Vec, Vec]:
    """The change of y in a unit of time of the motion y' = B(y) p, and the mean of the change over that time.

    y(s) = y_0 + s y_1 + s^2 y_2 + ...,  (k + 1) y_(k+1) = (B(y(s)) p)_k, exact to rounding: where the series of the
    whole time falls too slowly, it begins anew on the way.  y, p : (n,).
    Raises NoConvergence where the motion is too fast for this.

    Source: Griewank and Walther, Evaluating Derivatives, 2nd ed., chapter 13 (Taylor methods).
    """
    change, mean, left = 0.0 * y, 0.0 * y, 1.0
    for _ in range(STRETCHES):
        at = y + change
        terms = motion_terms(structure, at, p, TERMS)
        s = left
        for _ in range(STRETCHES):
            first = s * (abs(terms[0]) + s * (abs(terms[1]) + s * abs(terms[2])))
            last = (abs(terms[-2]) + s * abs(terms[-1])) * s ** (TERMS - 1)
            if not any(last > ROUNDING * (abs(at) + first)):
                break
            s = 0.5 * s
        far, halfway, power = 0.0 * y, 0.0 * y, s
        for k in range(TERMS):
            term = power * terms[k]
            far, halfway, power = far + term, halfway + (1.0 / (k + 2)) * term, s * power
        mean = mean + s * (change + halfway)
        change, left = change + far, left - s
        if left <= 0.0:
            break
    if left > 0.0:
        raise NoConvergence(
            f"{structure!r}: the motion with energy p . y, p = {tuple(p)}, is too fast for power series in "
            f"{STRETCHES} parts of a unit of time. Take shorter steps"
        )
    return change, mean


def motion_terms(structure: Any, y: Vec, p: Vec, number: int) -> list[Vec]:
    """y_1, ..., y_number of the motion y' = B(y) p from y.  y, p : (n,)."""
    products = Products()
    carries = any(isinstance(c, Dual) and not is_series(c) for c in y)  # derivatives, as the structure may, too
    at, covector = [
        vec(*[Series.begun(c, products) if carries else Series(c).among(products) for c in x]) for x in (y, p)
    ]
    for component, rate in zip(at, structure.sharp(at, covector)):
        Series.grown(component, rate, 1.0)
    return [Series.coefficient(at, k) for k in range(1, number + 1)]
