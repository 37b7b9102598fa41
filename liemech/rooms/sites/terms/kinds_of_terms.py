"""Kinds of energies of coupled sites: symmetric in their ends, affine in momenta, and others whose motion is known.

A kind is proved for all edges and sites.  Energy and derivatives are formed at states by chance, on every way
through the branches of the formula: first of residues, whatever the parameters are; if an identity fails there, of
floats with the parameters of each edge, on the ways that these take.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from ....formulas import dot, jacobian, vec
from ....formulas.classes.of_each import Each
from ....formulas.classes.records import records_in, with_fields, with_records
from ....formulas.classes.remembered import Remembered
from ....formulas.numbers.ways import ANY, APART, MOVING, AnyFunction, Number, Residue, Ways, values_of
from ....groups.composed.one_of import width_of
from ....systems.in_time.tabulated import PiecewisePolynomial
from ..graphs import places_of
from .among import Among, has_places, is_all_pairs
from .bound_terms import BoundTerm, Kind
from .near_pairs import NearPairs
from .terms import at_time
from .terms_in_arrays import OfEdge

SIZES = 10.0 ** np.arange(-45, 46, 3)
"""Sizes of momenta: a part that counts in some units is seen at one of them."""

DISTANCES = 10.0 ** np.arange(-12, 13, 3)
"""Sizes of places; those of pairs within a cutoff are times this one."""

LEAST = 1e-280
"""Floats that are smaller have lost digits."""

FEW, TOGETHER, MANY = 64, 2**12, 2**22
"""Edges that are tested first, and then at a time; of all pairs with more kinds of sites the kind is unknown."""

Test = Callable[[Any, Any, list[Any], Any], list[tuple[Any, Any]]]
"""From the groups of the sites, a term, its sites and a function that draws random numbers to pairs: what vanishes if the
identity holds, and the size of its terms.
"""


def kind_of(terms: Any, part: BoundTerm) -> Kind:
    """The kind of a term on the sites of a power."""
    arity = part.graph.arity
    return Kind(
        holds(terms, part, _affine, SIZES, False) is True,
        arity == 1 and holds(terms, part, _steady, SIZES, False) is True,
        arity == 2 and holds(terms, part, _isotropic, SIZES, False) is True,
    )


def alike(terms: Any, part: BoundTerm) -> Any:
    """Whether the energy of every edge is symmetric in its two ends: True, an edge where it is not (its number and its
    sites), or None if it is not known or there are no edges.
    """
    if not part.graph.some_edges(1):
        return None
    if isinstance(part.term, NearPairs):
        near, part = part.term, with_fields(part, term=part.term.term)
        return holds(terms, part, _exchanged, near.cutoff * DISTANCES, True)
    return holds(terms, part, _exchanged, SIZES if terms.of_a_site == ("mu",) else DISTANCES, True)


def feels_velocity(terms: Any) -> bool:
    """Whether a load depends on the velocities of its sites, at some time and for some edge."""
    felt: bool | None = _felt.get(terms)
    if felt is None:
        felt = not all(holds(terms, part, _unmoved, DISTANCES, True) is True for part in terms.parts)
        _felt.set(terms, felt)
    return felt


_felt = Remembered()
"""By load, whether it depends on velocities."""


def holds(terms: Any, part: BoundTerm, test: Test, sizes: np.ndarray, of_moving: bool) -> Any:
    """Whether an identity holds on all edges: True, an edge on which it does not, or None if it is not known.

    sizes : of the states.  of_moving : may the formula branch on numbers of the states?
    """
    an_edge = [ends for _, ends in part.graph.some_edges(1)]
    if not an_edge:
        return True
    parameters = [x for x in terms.own if isinstance(x, Each)]
    rng = np.random.default_rng(7)
    try:
        if _holds(terms, part, test, of_moving, _numbers(terms, part, np.array(an_edge), None, sizes, rng))[0].all():
            return True
    except Exception:  # floats can do more
        pass
    try:
        values = np.concatenate([x.values.reshape(len(x), -1) for x in parameters], axis=1) if parameters else None
        for ends, numbers in _edges(part, values):
            good, branches = _holds(terms, part, test, of_moving, _numbers(terms, part, ends, numbers, sizes, rng))
            if not good.all():
                at = int(good.argmin())
                return None if branches else (int(numbers[at]), ends[at].tolist())
    except Exception:  # it may fail anywhere but where it is meant to be used
        return None
    return True


def _edges(part: BoundTerm, own: np.ndarray | None) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Edges, a few and then many at a time, and their numbers; of all pairs one for each pair of parameters of sites.

    own : the parameters of all sites, (sites, n).
    """
    graph: Any = part.graph
    if is_all_pairs(graph) and not records_in(part.term, Each):
        ranges = [range(*map(int, graph.range_of(k))) for k in (0, 1)] if isinstance(graph, Among) else []
        sites = [np.array(r) for r in ranges or [range(graph.sites or 0)] * 2]
        if own is None:
            kinds = [members[:1] for members in sites]
        else:
            kinds = [members[np.unique(own[members], axis=0, return_index=True)[1]] for members in sites]
        if len(kinds[0]) * len(kinds[1]) > MANY:
            raise ValueError
        edges = np.stack(np.meshgrid(*kinds, indexing="ij"), axis=-1).reshape(-1, 2)
        numbers = np.zeros(len(edges), dtype=np.int64)
    else:
        edges, numbers = graph.edges, np.arange(len(graph.edges))
        if own is None and not records_in(part.term, Each):
            edges, numbers = edges[:1], numbers[:1]
    for first in [0, *range(FEW, len(edges), TOGETHER)]:
        last = first + TOGETHER if first else FEW
        yield edges[first:last], numbers[first:last]


def _numbers(
    terms: Any,
    part: BoundTerm,
    ends: np.ndarray,
    numbers: np.ndarray | None,
    sizes: np.ndarray,
    rng: np.random.Generator,
) -> list[np.ndarray]:
    """The arguments of `OfEdge` for edges, at states of all sizes: each (sizes, 1) or (1, edges).

    numbers : of the edges; None for residues in place of states and parameters.
    """
    of_edge = OfEdge.of_part(terms, part)
    columns: list[np.ndarray] = []
    for k in range(ends.shape[1]):
        states = np.array([_state(terms, int(ends[0, k]), size, rng) for size in sizes])
        columns += [*states.T[..., None]]
        for x in of_edge.own:
            if isinstance(x, Each):
                columns += [*x.values.reshape(len(x), -1)[ends[:, k]].T[:, None]]
    for x in records_in(of_edge.term, Each):
        columns += [*x.values.reshape(len(x), -1)[numbers if numbers is not None else [0]].T[:, None]]
    return columns if numbers is not None else [_residue(rng) for _ in columns]


def _residue(rng: np.random.Generator) -> np.ndarray:
    return np.array([[Residue(int.from_bytes(rng.bytes(16), "big"))]])


def _state(terms: Any, site: int, size: float, rng: np.random.Generator) -> np.ndarray:
    """A random state of a site as terms see it: momentum, element, or both."""
    base, widest, parts = terms.group.base_of(site), terms.group.base, []
    if "mu" in terms.of_a_site:
        parts.append(np.pad(size * rng.normal(size=base.dim), (0, widest.dim - base.dim)))
    if "g" in terms.of_a_site:
        g = np.array(base.random(rng, 1))
        if has_places(base):
            places_of(base, g)[...] *= size
        row = np.ascontiguousarray(g).reshape(-1).view(float)
        parts.append(np.pad(row, (0, width_of(widest) - len(row))))
    return np.concatenate(parts)


def _holds(
    terms: Any, part: BoundTerm, test: Test, of_moving: bool, numbers: list[np.ndarray]
) -> tuple[np.ndarray, bool]:
    """Whether an identity holds on each of some edges, on all paths through the formula; and whether some path may
    never be taken.

    numbers : residues, or floats, each (sizes, 1) or (1, edges).
    """
    of_edge, ways = OfEdge.of_part(terms, part), Ways(of_moving)
    shape = np.broadcast_shapes(*[x.shape for x in numbers])
    exact = numbers[0].dtype == object
    step = of_edge.width + sum(len(x.numbers) // len(x) for x in of_edge.own if isinstance(x, Each))
    good, branches = np.ones(shape[1], dtype=bool), False
    rng = np.random.default_rng(5)
    species = terms.species
    groups = [terms.group.base if species is None else species.groups[k] for k in part.of or (0,) * part.graph.arity]
    moves = [
        MOVING if i < step * of_edge.arity and i % step < of_edge.width else ANY * exact for i in range(len(numbers))
    ]

    def anything() -> Number:
        return Number(
            _residue(rng)
            if exact
            else rng.normal(size=(shape[0], 1)) * 10.0 ** rng.uniform(-20.0, 20.0, (shape[0], 1)),
            ways,
            ANY,
        )

    with np.errstate(all="ignore"):
        for _ in ways.each():
            term, sites = of_edge.sites(vec(*[Number(x, ways, kind) for x, kind in zip(numbers, moves)]))
            term = at_time(term, anything())
            tables = [AnyFunction(x.size, anything) for x in records_in(term, PiecewisePolynomial)]
            term = with_records(term, PiecewisePolynomial, tables)
            for error, size in test(groups, term, sites, anything):
                misfit, whole = (np.broadcast_to(np.asarray(x, dtype=float), shape) for x in (error, size))
                finite = np.isfinite(misfit) & np.isfinite(whole) & ((whole > LEAST) | (whole == 0.0))
                # beside residues, of which the size is 1, a constant of the formula is as large as its unit makes it
                holds = ((misfit <= whole * (0.0 if exact else APART)) | ~finite).all(axis=0) & finite.any(axis=0)
                good &= holds | ~np.broadcast_to(ways.points, (1, shape[1]))[0]
            branches = branches or ways.branch
    return good, branches


# ------------------------------------------------------------------ what should vanish


def _exchanged(groups: Any, term: Any, sites: list[Any], draw: Any) -> list[tuple[Any, Any]]:
    """E(a, b) - E(b, a)."""
    energy, other = values_of(term.energy(*sites)), values_of(term.energy(*sites[::-1]))
    return [(np.abs(energy - other), np.maximum(np.abs(energy), np.abs(other)))]


def _affine(groups: Any, term: Any, sites: list[Any], draw: Any) -> list[tuple[Any, Any]]:
    """d2E/dmu_k^2 for each site k."""
    return [
        (_largest(_hessian(term, k, sites)) * _size(site.mu), _size(term.slope(k, *sites)))
        for k, site in enumerate(sites)
    ]


def _steady(groups: Any, term: Any, sites: list[Any], draw: Any) -> list[tuple[Any, Any]]:
    """The change of xi = dE/dmu where mu' = ad*_xi mu."""
    hessian = _hessian(term, 0, sites)
    rate = groups[0].ad_star(term.slope(0, *sites), sites[0].mu)
    return [(_size(hessian @ rate), _largest(hessian) * _size(rate))]


def _isotropic(groups: Any, term: Any, sites: list[Any], draw: Any) -> list[tuple[Any, Any]]:
    """dE/da - c b, dE/db - c a, and the difference of both c."""
    a, b = sites
    of_a, of_b = (term.slope(k, a, b) for k in (0, 1))
    c, d = dot(of_a, b.mu) / dot(b.mu, b.mu), dot(of_b, a.mu) / dot(a.mu, a.mu)
    whole = np.maximum(_size(of_a), _size(of_b))
    differences = of_a - c * b.mu, of_b - c * a.mu, (c - d) * a.mu
    return [(_size(x), whole) for x in differences]


def _unmoved(groups: Any, term: Any, sites: list[Any], draw: Any) -> list[tuple[Any, Any]]:
    """The difference of the forces at two random velocities."""
    t, forces = draw(), []
    for _ in range(2):
        moving = [with_fields(s, xi=vec(*[draw() for _ in range(group.dim)])) for s, group in zip(sites, groups)]
        forces.append(term.covector(t, *moving))
    return [(_size(forces[0] - forces[1]), _size(forces[0]) + _size(forces[1]))]


def _hessian(term: Any, k: int, sites: list[Any]) -> Any:
    """The second derivative of an energy by the momentum of one of its sites."""

    def slope(m: Any) -> Any:
        return term.slope(k, *[with_fields(s, mu=m) if j == k else s for j, s in enumerate(sites)])

    return jacobian(slope, sites[k].mu)


def _size(mu: Any) -> Any:
    return np.maximum.reduce(np.broadcast_arrays(*[np.abs(values_of(x)) for x in mu]))


def _largest(rows: Any) -> Any:
    return np.maximum.reduce(np.broadcast_arrays(*[_size(row) for row in rows]))
