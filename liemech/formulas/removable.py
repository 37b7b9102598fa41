"""Quotients that are 0/0 at zero and smooth there, with their derivatives of all orders.

    sinc(x) = sin(x)/x = 1 - x^2/6 + x^4/120 - ...

Close to zero they are sums of their power series, farther out what they abbreviate.  Both are
formulas like any other: numbers that carry derivatives, power series and numbers of two doubles pass
through.  Both sides of the place where they meet lose some bits in the first derivative, in the
sixth some four to six digits.

Source: Abramowitz and Stegun, Handbook of Mathematical Functions, 4.1.28, 4.2.1, 4.3.65, 4.4.42,
4.5.62; Stumpff, Himmelsmechanik I, 1959 (the functions c_k).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ..errors import InvalidInput
from .double_double import DoubleDouble, is_long, quotient
from .dual import constant
from .functions import atan, expm1, log1p, sin, sinh, sqrt
from .vectors import horner

NEAR, HALF = 2.0, 0.5
"""Up to here the functions are sums, those that are entire and those with a singularity at distance
1, of which the sum is one of powers of 1/4.
"""

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
    return horner([value for value, _ in words[:count]], x)


def _of_array(function: Callable[..., Any], x: np.ndarray) -> np.ndarray:
    return np.array([function(a) for a in x.ravel().tolist()]).reshape(x.shape)


def stumpff(k: int, z: Any) -> Any:
    """The function c_k(z) = 1/k! - z/(k + 2)! + z^2/(k + 4)! - ..., k = 1, 2, 3, of z of either sign.

    With z = x^2:  c_1 = sin(x)/x,  c_2 = (1 - cos x)/x^2,  c_3 = (x - sin x)/x^3;  with z = -x^2
    sinh(x)/x,  (cosh x - 1)/x^2,  (sinh x - x)/x^3.  Of the square of a length they need no root,
    which has no derivative at zero.
    Raises InvalidInput for another k.
    """
    if k not in STUMPFF:
        raise InvalidInput(f"stumpff: k is 1, 2 or 3; got {k!r}")
    if isinstance(z, np.ndarray):
        return _of_array(lambda a: stumpff(k, a), z)
    if abs(z) <= NEAR * NEAR:
        return _sum(STUMPFF[k], 18, z)
    if z > 0.0:
        x = sqrt(z)
        s, half = sin(x) / x, sin(0.5 * x)
        return s if k == 1 else 2.0 * half * half / z if k == 2 else (1.0 - s) / z
    x = sqrt(-z)
    s, half = sinh(x) / x, sinh(0.5 * x)
    return s if k == 1 else -2.0 * half * half / z if k == 2 else (1.0 - s) / z


def sinc(x: Any) -> Any:
    """sin(x)/x, 1 at zero.  (`numpy.sinc` is that of pi x.)"""
    if isinstance(x, np.ndarray):
        return _of_array(sinc, x)
    return stumpff(1, x * x) if abs(x) <= NEAR else sin(x) / x


def versine_over(x: Any) -> Any:
    """(1 - cos x)/x^2, 1/2 at zero."""
    if isinstance(x, np.ndarray):
        return _of_array(versine_over, x)
    if abs(x) <= NEAR:
        return stumpff(2, x * x)
    root = sin(0.5 * x) / x
    return 2.0 * root * root


def segment_over(x: Any) -> Any:
    """(x - sin x)/x^3, 1/6 at zero."""
    if isinstance(x, np.ndarray):
        return _of_array(segment_over, x)
    return stumpff(3, x * x) if abs(x) <= NEAR else (1.0 - sin(x) / x) / x / x


def sinh_over(x: Any) -> Any:
    """sinh(x)/x, 1 at zero."""
    if isinstance(x, np.ndarray):
        return _of_array(sinh_over, x)
    return stumpff(1, -x * x) if abs(x) <= NEAR else sinh(x) / x


def coshm1_over(x: Any) -> Any:
    """(cosh x - 1)/x^2, 1/2 at zero."""
    if isinstance(x, np.ndarray):
        return _of_array(coshm1_over, x)
    if abs(x) <= NEAR:
        return stumpff(2, -x * x)
    root = sinh(0.5 * x) / x
    return 2.0 * root * root


def expm1_over(x: Any) -> Any:
    """(exp(x) - 1)/x, 1 at zero; 1/expm1_over(x) generates the Bernoulli numbers."""
    if isinstance(x, np.ndarray):
        return _of_array(expm1_over, x)
    return _sum(EXPM1, 30, x) if abs(x) <= NEAR else expm1(x) / x


def log1p_over(x: Any) -> Any:
    """log(1 + x)/x, 1 at zero.

    log(1 + x) = 2 artanh(x/(2 + x))
    """
    if isinstance(x, np.ndarray):
        return _of_array(log1p_over, x)
    below = 2.0 + x
    u = x / below
    if abs(u) <= HALF:
        return (2.0 / below) * _sum(ATANH, 36, u * u)
    return log1p(x) / x


def atan_over(x: Any) -> Any:
    """arctan(x)/x, 1 at zero."""
    if isinstance(x, np.ndarray):
        return _of_array(atan_over, x)
    return _sum(ATAN, 36, x * x) if abs(x) <= HALF else atan(x) / x
