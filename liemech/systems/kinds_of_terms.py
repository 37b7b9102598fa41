"""Kinds of energies of coupled sites, seen from their derivatives at some points: those whose motion
is known.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..formulas import Record, dot, jacobian, record, vec
from ..formulas.pytree import inside, with_fields
from .tabulated import inputs
from .terms import AtTime, at_time

APART = 1e-9
"""What should vanish, and is larger than this times what it is made of, does not."""

TRIED = 4
"""Edges at which a term is looked at."""

TIMES = 0.0, 0.37, -0.73, 1.19, 7.3, 101.0
"""Times at which a term that changes is looked at."""

SHARES = 0.03, 0.21, 0.42, 0.58, 0.79, 0.97
"""Of the time that its tables have values for, where they have them for some time only."""


@record
class Kind(Record):
    """The parts of a term that are looked at.

    affine : is it affine in the momentum of each site?  steady : does the velocity that it gives a
    single site stay as it is while the site moves along?  isotropic : is it a function of the
    product of two momenta, with derivatives c b and c a?
    """

    affine: bool = False
    steady: bool = False
    isotropic: bool = False


def kind_of(terms: Any, part: Any) -> Kind:
    """The kind of a term on the sites of a power; a formula that fails where it is tried is of none."""
    try:
        seen, arity = list(_tried(terms, part)), part.graph.arity
        changes = bool(inside(part, AtTime))
        if changes and not any(_size(term.slope(0, *sites)) for _, term, sites in seen):
            return Kind()  # of a pulse that is zero whenever it is tried nothing is known
        return Kind(
            all(_affine(term, sites) for _, term, sites in seen),
            arity == 1 and all(_steady(group, term, *sites) for group, term, sites in seen),
            arity == 2 and all(_isotropic(term, *sites) for _, term, sites in seen),
        )
    except Exception:  # it may fail anywhere but where it is meant to be used
        return Kind()


def _tried(terms: Any, part: Any) -> Iterator[tuple[Any, Any, list[Any]]]:
    """The group of the first site, a term and its sites at some edges, somewhere."""
    rng = np.random.default_rng(7)
    for number, ends in part.graph.some_edges(TRIED):
        mus = [rng.normal(size=terms.group.base_of(i).dim).tolist() for i in ends]
        sites = [terms.site_with(i, vec(*mu), None) for i, mu in zip(ends, mus)]
        term = part.at_edge(number)
        for t in _times(term) if inside(term, AtTime) else (0.0,):
            yield terms.group.base_of(ends[0]), at_time(term, t), sites


def _times(term: Any) -> list[float]:
    """Times at which a term is looked at."""
    ends = [np.asarray(x.knots)[[0, -1]] for x in inputs(term) if x.outside == "refuse"]
    if not ends:
        return [*TIMES]
    low, high = np.max(ends, axis=0)[0], np.min(ends, axis=0)[1]
    return [float(low + share * (high - low)) for share in SHARES]


def _affine(term: Any, sites: list[Any]) -> bool:
    """Are the second derivatives by the momentum of each of its sites zero?"""
    return all(
        _largest(_hessian(term, k, sites)) * _size(site.mu) <= APART * _size(term.slope(k, *sites))
        for k, site in enumerate(sites)
    )


def _steady(group: Any, term: Any, site: Any) -> bool:
    """Does xi = dE/dmu stay as it is where mu' = ad*_xi mu?"""
    hessian = _hessian(term, 0, [site])
    rate = group.ad_star(term.slope(0, site), site.mu)
    return _size(hessian @ rate) <= APART * _largest(hessian) * _size(rate)


def _isotropic(term: Any, a: Any, b: Any) -> bool:
    """Are the derivatives c b and c a?"""
    of_a, of_b = (term.slope(k, a, b) for k in (0, 1))
    c, d = dot(of_a, b.mu) / dot(b.mu, b.mu), dot(of_b, a.mu) / dot(a.mu, a.mu)
    limit = APART * max(_size(of_a), _size(of_b))
    return bool(
        _size(of_a - c * b.mu) <= limit and _size(of_b - c * a.mu) <= limit and abs(c - d) * _size(a.mu) <= limit
    )


def _hessian(term: Any, k: int, sites: list[Any]) -> Any:
    """The second derivative of an energy by the momentum of one of its sites."""

    def slope(m: Any) -> Any:
        return term.slope(k, *[with_fields(s, mu=m) if j == k else s for j, s in enumerate(sites)])

    return jacobian(slope, sites[k].mu)


def _size(mu: Any) -> float:
    return max([abs(float(x)) for x in mu])


def _largest(rows: Any) -> float:
    return max([_size(row) for row in rows])
