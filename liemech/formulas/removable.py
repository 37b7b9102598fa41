"""Quotients that are 0/0 at zero and smooth there, with their derivatives of all orders.

    sinc(x) = sin(x)/x = 1 - x^2/6 + x^4/120 - ...

Close to zero they are sums of their power series, farther out what they abbreviate.  Both are
formulas like any other: numbers that carry derivatives, power series and numbers of two doubles
pass through.  Both sides of the place where they meet lose some bits in the first derivative, in
the sixth some four to six digits.

Source: Abramowitz and Stegun, Handbook of Mathematical Functions, 4.1.28, 4.2.1, 4.3.65, 4.4.42,
4.5.62; Stumpff, Himmelsmechanik I, 1959 (the functions c_k).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ..errors import InvalidInput
from .functions import atan, expm1, log1p, sin, sinh, sqrt, where
from .numbers.double_double import DoubleDouble, is_long, quotient
from .numbers.dual import constant, is_series
from .vectors import horner

NEAR, HALF = 2.0, 0.5
"""Up to here the functions are sums, those that are entire and those with a singularity at distance
1, of which the sum is one of powers of 1/4.
"""

FAR = 5.0
"""A place at which all of them are closed forms."""

Words = tuple[tuple[float, float], ...]


def _stumpff_terms(k: int) -> Words:
    return tuple([quotient((-1) ** j, math.factorial(2 * j + k)) for j in range(26)])


STUMPFF = {k: _stumpff_terms(k) for k in (1, 2, 3)}
EXPM1 = tuple([quotient(1, math.factorial(j + 1)) for j in range(44)])
ATAN = tuple([quotient((-1) ** j, 2 * j + 1) for j in range(64)])
ATANH = tuple([quotient(1, 2 * j + 1) for j in range(64)])


def _sum(words: Words, count: int, x: Any) -> Any:
    """The sum of a power series: of so many terms, of all of them for numbers of two doubles."""
    if is_long(constant(x)):
        return horner([DoubleDouble(value, low) for value, low in words], x)
    values = [value for value, _ in words[:count]]
    if is_series(x) and count > 20:  # no loop of native code carries one: two that are written out
        return horner([*values[:20], horner(values[20:], x)], x)
    return horner(values, x)


def _quotient(
    x: Any, reach: float, near: Callable[[Any], Any], far: Callable[[Any], Any], size: Callable[[Any], Any] = abs
) -> Any:
    """near(x) where the size of x is at most `reach`, far(x) elsewhere.

    Of a power series both are computed, as its terms are chosen when they are wanted: near at 0 where x is far, far at
    FAR where x is near.
    """
    if isinstance(x, np.ndarray):
        quotients = [_quotient(a, reach, near, far, size) for a in x.ravel().tolist()]
        return np.array(quotients).reshape(x.shape)
    if is_series(x):
        close = size(x) <= reach
        return where(close, near(where(close, x, 0.0)), far(where(close, FAR, x)))
    return near(x) if size(x) <= reach else far(x)


def stumpff(k: int, z: Any) -> Any:
    """The function c_k(z) = 1/k! - z/(k + 2)! + z^2/(k + 4)! - ..., k = 1, 2, 3, of z of either
    sign.

    With z = x^2:  c_1 = sin(x)/x,  c_2 = (1 - cos x)/x^2,  c_3 = (x - sin x)/x^3;  with z = -x^2
    sinh(x)/x,  (cosh x - 1)/x^2,  (sinh x - x)/x^3.  Of the square of a length they need no root,
    which has no derivative at zero.
    Raises InvalidInput for another k.
    """
    if k not in STUMPFF:
        raise InvalidInput(f"stumpff: k is 1, 2 or 3; got {k!r}")
    return _quotient(z, NEAR * NEAR, lambda z: _stumpff_near(k, z), lambda z: _stumpff_far(k, z))


def _stumpff_near(k: int, z: Any) -> Any:
    return _sum(STUMPFF[k], 18, z)


def _stumpff_far(k: int, z: Any) -> Any:
    if is_series(z):
        above = z > 0.0
        of_circle = _stumpff_of_circle(k, where(above, z, 1.0))
        return where(above, of_circle, _stumpff_of_hyperbola(k, where(above, -1.0, z)))
    return _stumpff_of_circle(k, z) if z > 0.0 else _stumpff_of_hyperbola(k, z)


def _stumpff_of_circle(k: int, z: Any) -> Any:
    x = sqrt(z)
    s, half = sin(x) / x, sin(0.5 * x)
    return s if k == 1 else 2.0 * half * half / z if k == 2 else (1.0 - s) / z


def _stumpff_of_hyperbola(k: int, z: Any) -> Any:
    x = sqrt(-z)
    s, half = sinh(x) / x, sinh(0.5 * x)
    return s if k == 1 else -2.0 * half * half / z if k == 2 else (1.0 - s) / z


def _versine_far(x: Any) -> Any:
    root = sin(0.5 * x) / x
    return 2.0 * root * root


def _coshm1_far(x: Any) -> Any:
    root = sinh(0.5 * x) / x
    return 2.0 * root * root


def sinc(x: Any) -> Any:
    """sin(x)/x, 1 at zero.  (`numpy.sinc` is that of pi x.)"""
    return _quotient(x, NEAR, lambda x: _stumpff_near(1, x * x), lambda x: sin(x) / x)


def versine_over(x: Any) -> Any:
    """(1 - cos x)/x^2, 1/2 at zero."""
    return _quotient(x, NEAR, lambda x: _stumpff_near(2, x * x), _versine_far)


def segment_over(x: Any) -> Any:
    """(x - sin x)/x^3, 1/6 at zero."""
    return _quotient(x, NEAR, lambda x: _stumpff_near(3, x * x), lambda x: (1.0 - sin(x) / x) / x / x)


def sinh_over(x: Any) -> Any:
    """The quotient sinh(x)/x, 1 at zero."""
    return _quotient(x, NEAR, lambda x: _stumpff_near(1, -x * x), lambda x: sinh(x) / x)


def coshm1_over(x: Any) -> Any:
    """(cosh x - 1)/x^2, 1/2 at zero."""
    return _quotient(x, NEAR, lambda x: _stumpff_near(2, -x * x), _coshm1_far)


def expm1_over(x: Any) -> Any:
    """(exp(x) - 1)/x, 1 at zero; 1/expm1_over(x) generates the Bernoulli numbers."""
    return _quotient(x, NEAR, lambda x: _sum(EXPM1, 30, x), lambda x: expm1(x) / x)


def _log1p_near(x: Any) -> Any:
    below = 2.0 + x
    u = x / below
    return (2.0 / below) * _sum(ATANH, 36, u * u)


def log1p_over(x: Any) -> Any:
    """log(1 + x)/x, 1 at zero.

    log(1 + x) = 2 artanh(x/(2 + x))
    """
    return _quotient(x, HALF, _log1p_near, lambda x: log1p(x) / x, lambda x: abs(x / (2.0 + x)))


def atan_over(x: Any) -> Any:
    """The quotient arctan(x)/x, 1 at zero."""
    return _quotient(x, HALF, lambda x: _sum(ATAN, 36, x * x), lambda x: atan(x) / x)


def atan_root_over(z: Any) -> Any:
    """arctan(x)/x as a series in z = x^2, for z up to 1/25: without a root, which has no slope at zero."""
    return _sum(ATAN, 12, z)
