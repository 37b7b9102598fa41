"""Generating functions read off the motion itself, as power series in the time t of a step.

The characteristics of a Hamilton-Jacobi equation are the motions.  Along them, what generates the
step is a series in t, whatever the momentum m they pass through.  What the generating function
depends on stays fixed meanwhile, and m with it depends on t: the terms are series in their turn,
each found from those before.

Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VI.5.3; Griewank and
Walther, Evaluating Derivatives, 2nd ed., chapter 13 (series of series).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..formulas import Vec, vec
from ..formulas.numbers.bases import InMemory
from ..formulas.numbers.series import Series, SeriesInMemory
from ..groups.bernoulli import BERNOULLI
from ..groups.lie_group import LieGroup
from ..groups.retractions import Exponential, Retraction
from ..systems.lie_poisson import BodyState


def second_kind(
    system: Any, retraction: Retraction, p: Vec, terms: int, h: float = 1.0, time: float = 0.0
) -> list[Vec]:
    """x_1, x_3, ... of the displacement x = t x_1 + t^3 x_3 + ... of the motion for the time t h,
    p, conjugate to x, fixed.

    With m the momentum half way, v and mu the velocity and the momentum at the end,

        x' = dtau^-1_x v,   (dtau^-1_x)* p = mu,   both left-trivialised, and of both the even part: x is odd in t, p is even.

    Half way it is `time`.  The first gives x, the second p = m + t^2 p_2 + t^4 p_4 + ..., and from
    there m = p - t^2 p_2 - ... as a series in t^2.  The unit of time is h: powers of it might
    under- or overflow.
    """
    group = system.group
    m = begun(p)
    v, mu = motion(system, h, m, 0.5, time)
    odd, even = [], [m]  # type: list[Vec], list[Vec]
    for k in range(0, 2 * terms, 2):
        x = of_terms([None, *[c for term in odd for c in (term, None)]], p)
        if k:
            power_series = of_terms([c for term in even for c in (term, None)], p)
            even = [*even, _at(k, mu) - _added_to_momentum(group, retraction, x, power_series, mu, k)]
        odd = [*odd, (1.0 / (k + 1)) * (_at(k, v) + _added_to_velocity(group, retraction, x, v, k) if k else _at(k, v))]
    settle(m, [-term for term in even[1:]])
    return values(odd)


def first_kind(
    system: Any, retraction: Retraction, s0: Any, scale: float, xi: Vec, order: int, h: float = 1.0, time: float = 0.0
) -> list[Vec]:
    """pi_0, pi_1, ... of the momentum pi = pi_0 + t pi_1 + ... + t^order pi_order at the end of a
    step tau(xi), xi fixed.

    The step is the motion k for the time t h, up to pi, and a step of the class function s0 alone:
    tau(xi) = k h with h of momentum pi.  At the end it is `time`.  Followed backwards from pi, k
    obeys k' = v k, and h = k^-1 tau(xi) moves with the body velocity -u,

        h' = -h u,   u = Ad_tau(xi)^-1 v.
    """
    group = system.group
    m = begun(scale * s0.momentum(group, retraction, xi))
    v, _ = motion(system, h, m, -1.0, time)
    u = series(group.Ad(group.inverse(retraction.tau(group, xi)), v))
    momentum = s0.along(group, retraction, xi, u)
    settle(m, [scale * _at(k, momentum) for k in range(1, order + 1)])
    return [_at(k, m) for k in range(order + 1)]


def velocity_at(system: Any, time: Any, mu: Vec) -> Vec:
    """The body velocity dH/dmu at a time, of free and of driven systems."""
    return system.rate(time, BodyState(mu, None))


def motion(system: Any, h: float, m: Vec, pace: float, time: float = 0.0) -> tuple[Vec, Vec]:
    """Velocity and momentum a time `pace` t h after the momentum was m at `time`: v = h dH(mu), mu' = pace ad*_v mu."""
    mu = begun(m)
    v = series(h * velocity_at(system, Series(time, pace * h), mu))
    for component, rate in zip(each(mu), each(system.group.ad_star(v, mu))):
        component.grow(rate, pace)
    return v, mu


def begun(x: Vec) -> Vec:
    """The vector of series that begin with the components, and end with them unless they are told how to go on."""
    return SeriesInMemory(x) if isinstance(x, InMemory) else vec(*[Series(c) for c in x])


def of_terms(terms: list[Any], like: Vec) -> Vec:
    """The vector of series with these terms, vectors like another one or None."""
    if isinstance(like, InMemory):
        return SeriesInMemory(*terms)
    return vec(*[
        Series(*[None if term is None else term[i] for term in terms]) for i in range(len(like))
    ])  # fmt: skip


def each(x: Vec) -> Any:
    """The series of a vector: its components, or one of vectors in memory."""
    return (x,) if isinstance(x, InMemory) else x


def settle(m: Vec, terms: list[Vec]) -> None:
    """Set the unknown series m to m_0 + e a + e^2 b + ... of the terms a, b, ..., which may depend on m."""
    for component, tail in zip(each(m), each(collected(terms))):
        component.by((Series(None, 1.0) * tail).term)


def collected(terms: list[Vec]) -> Vec:
    """The vector of series a + e b + e^2 c + ... of the terms a, b, c, ..., which are vectors of series themselves."""
    total = series(terms[0])
    for k in range(1, len(terms)):
        power, term = Series(*[None for _ in range(k)], 1.0), series(terms[k])
        if isinstance(total, InMemory):
            total = total + power * term
        else:
            total = vec(*[a + power * b for a, b in zip(total, term)])
    return total


def values(terms: list[Vec]) -> list[Vec]:
    """The coefficients of e^0, e^1, ... in a + e b + e^2 c + ..., as many as there are terms."""
    total = collected(terms)
    return [_at(k, total) for k in range(len(terms))]


def series(x: Vec) -> Vec:
    """The vector with every component a series, also those that depend on nothing."""
    if isinstance(x, InMemory):
        return x if isinstance(x, SeriesInMemory) else SeriesInMemory(x)
    return vec(*[Series.holding(c) for c in x])


def _at(k: int, x: Vec) -> Vec:
    """The terms of t^k of every component."""
    if isinstance(x, InMemory):
        return series(x).coefficient_of(k)
    return vec(*[c[k] for c in series(x)])


def _added_to_velocity(group: LieGroup, retraction: Retraction, x: Vec, v: Vec, k: int) -> Vec:
    """The change of v by dtau^-1_x at t^k, left-trivialised.

    The exponential: ad_x v = ad_x (v - x/t), where v - x/t begins with t: two brackets less to be
    nested.
    """
    if not isinstance(retraction, Exponential):
        return _at(k, retraction.dtau_inv(group, x, v)) - _at(k, v)
    turning = of_terms([None, *[_at(j, v) - _at(j + 1, x) for j in range(1, k)]], v)
    return _at(k, _bernoulli(lambda y: group.ad(-x, y), group.ad(-x, turning), 1, k - 1))


def _added_to_momentum(group: LieGroup, retraction: Retraction, x: Vec, p: Vec, mu: Vec, k: int) -> Vec:
    """The change of p by (dtau^-1_x)* at t^k, left-trivialised, where p itself has no term yet.

    The exponential: what is odd in t comes from -ad*_x p/2 alone, with -x in the place of x, and so
    ad*_x p is known from mu.
    """
    if not isinstance(retraction, Exponential):
        return _at(k, retraction.dtau_inv_dual(group, x, p))
    odd = of_terms([None, *[-2.0 * _at(j, mu) if j % 2 else None for j in range(1, k)]], mu)
    return _at(k, _bernoulli(lambda y: group.ad_star(-x, y), group.ad_star(-x, odd), 2, k))


def _bernoulli(ad: Callable[[Vec], Vec], y: Vec, first: int, last: int) -> Vec:
    """The terms of dexp^-1 = 1 - ad/2 + ad^2/12 - ... from ad^first, which is y, to ad^last."""
    power, total = y, BERNOULLI[first] * y
    for k in range(first + 1, last + 1):
        power = ad(power)
        if BERNOULLI[k] != 0.0:
            total = total + BERNOULLI[k] * power
    return total
