"""Series of ad_xi applied to a vector: its exponential, the mean of that, and Bernoulli's series.

Every function takes the action `ad(x, v)`, that of ad_x or of its dual ad*_x.
Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., III.4.
"""

from __future__ import annotations

from collections.abc import Callable

from ..formulas import Mat, Vec, identity_matrix, mat
from ..formulas.numbers.double_double import is_long
from ..formulas.numbers.dual import value_of
from ..formulas.numbers.sizes import EPSILON, one_norm
from .bernoulli import BERNOULLI

ROUGH = 2.0**-72
"""(2^-36)^2: the square of what an iteration does not feel."""

Action = Callable[[Vec, Vec], Vec]


def exponential_series(ad: Action, x: Vec, v: Vec) -> Vec:
    """exp(ad_x) v = v + ad_x v + ad_x^2 v/2 + ..., summed as it stands.  x, v : (dim,)."""
    return _sum(ad, x, v, 1.0)


def mean(ad: Action, x: Vec, v: Vec) -> Vec:
    """The mean of exp(s ad_x) v over 0 <= s <= 1, sum_k ad_x^k v/(k + 1)!, as it stands.  x,
    v : (dim,).
    """
    return _sum(ad, x, v, 2.0)


def mean_slope(ad: Action, x: Vec, v: Vec, size2: float) -> Mat:
    """The derivative of `mean` with respect to x, from that of the recursion of its terms.

    size2 : a bound for the square of |ad_x|.  It stops at 1e-11: Newton's method feels no less.  x,
    v : (dim,).
    """
    units = identity_matrix(len(x))
    term, k = 0.5 * ad(x, v), 2.0
    slopes = mat(*[0.5 * ad(unit, v) for unit in units])
    total, before, bound = slopes, 1.0, size2
    while before > ROUGH and k < 64.0:
        k = k + 1.0
        y = (1.0 / k) * x
        slopes = mat(*[ad(y, s) + (1.0 / k) * ad(unit, term) for unit, s in zip(units, slopes)])
        term, total = ad(y, term), total + slopes
        before, bound = bound, bound * (size2 / (k * k))
    return total.T


def bernoulli_series(ad: Action, x: Vec, v: Vec, terms: int) -> Vec:
    """sum_k B_k/k! ad_x^k v, k = 0, ..., terms.  x, v : (dim,)."""
    power, total = v, v
    for k in range(1, terms + 1):
        power = ad(x, power)
        if BERNOULLI[k] != 0.0:
            total = total + BERNOULLI[k] * power
    return total


def _sum(ad: Action, x: Vec, v: Vec, k: float) -> Vec:
    """v + ad_x v/k + ad_x^2 v/(k (k + 1)) + ..., until a term is rounding."""
    term = ad(x, v) / k
    total = v + term
    epsilon = EPSILON * EPSILON if is_long(value_of(total[0])) else EPSILON
    while one_norm(term) > 0.0625 * epsilon * one_norm(total):
        k = k + 1.0
        term = ad(x, term) / k
        total = total + term
    return total
