"""The coefficients of collocation methods and their relatives, every one the exact one, rounded.

The nodes are the zeros of an orthogonal polynomial, the weights are integrals of Lagrange
polynomials: both in as many decimal digits as it takes.

Source: Hairer and Wanner, Solving Ordinary Differential Equations II, 2nd ed., IV.5; Hairer,
Lubich, Wanner, II.1.3 and II.1.4.
"""

from __future__ import annotations

import functools
import itertools
import math
from decimal import Decimal, localcontext

Polynomial = list[Decimal]  # coefficients of 1, x, x^2, ...


def rounded(name: str, s: int) -> tuple[list[list[float]], list[float], list[float]]:
    """A, b, c of the method with s stages."""
    with localcontext() as context:
        context.prec = 40 + 4 * s
        A, b, c = _exact(name, s)
        tiny = Decimal(10) ** -30  # exact zeros come out as rounding errors
        rows = [[float(x) if abs(x) > tiny else 0.0 for x in row] for row in (*A, b, c)]
    return rows[:s], rows[s], rows[s + 1]


def _exact(name: str, s: int) -> tuple[list[list[Decimal]], list[Decimal], list[Decimal]]:
    """A, b, c in the precision of the context."""
    lobatto = name.startswith("Lobatto")
    c = _zeros(s - 1, s - 1, s - 2) if lobatto else _zeros(s - 1, s, s - 1) if name == "Radau IIA" else _zeros(s, s, s)
    integrals = [_integral(p) for p in _lagrange(c)]
    A = [[_value(p, x) for p in integrals] for x in c]
    b = [_value(p, Decimal(1)) for p in integrals]
    if name == "Lobatto IIIB":
        A = [[b[j] - b[j] * A[j][i] / b[i] for j in range(s)] for i in range(s)]
        c = [sum(row, Decimal(0)) for row in A]
    if name == "Lobatto IIIC":
        A = [[b[0], *(_value(_integral(p), x) - b[0] * p[0] for p in _lagrange(c[1:]))] for x in c]
    return A, b, c


def _zeros(p: int, q: int, m: int) -> list[Decimal]:
    """The zeros of the m-th derivative of x^p (x - 1)^q, p and q being m or m + 1: all real, simple, and in [0, 1]."""
    f: Polynomial = [Decimal(0)] * p + [Decimal((-1) ** (q - k) * math.comb(q, k)) for k in range(q + 1)]
    for _ in range(m):
        f = _derivative(f)
    slope = _derivative(f)
    # in the angle of x = (1 - cos)/2 the zeros are evenly spaced, so that four points for each
    # separate them
    count = 4 * len(f) + 1
    grid = [Decimal((1.0 - math.cos(math.pi * k / count)) / 2.0) for k in range(1, count)]
    inner = []
    for low, high in itertools.pairwise(grid):
        if (_value(f, low) > 0) != (_value(f, high) > 0):
            x = (low + high) / 2
            for _ in range(12):
                x = x - _value(f, x) / _value(slope, x)
            inner.append(x)
    return [Decimal(0)] * (p > m) + inner + [Decimal(1)] * (q > m)


def _lagrange(c: list[Decimal]) -> list[Polynomial]:
    """The polynomials that are 1 at one of the nodes and 0 at the others."""
    polynomials = []
    for i, x in enumerate(c):
        p = [Decimal(1)]
        for other in c[:i] + c[i + 1 :]:
            p = [(a - other * b) / (x - other) for a, b in zip([Decimal(0), *p], [*p, Decimal(0)])]
        polynomials.append(p)
    return polynomials


def _integral(p: Polynomial) -> Polynomial:
    return [Decimal(0), *(a / (k + 1) for k, a in enumerate(p))]


def _derivative(p: Polynomial) -> Polynomial:
    return [k * a for k, a in enumerate(p)][1:]


def _value(p: Polynomial, x: Decimal) -> Decimal:
    return functools.reduce(lambda total, a: total * x + a, reversed(p), Decimal(0))
