"""Trials of terms at sample points, where a system is made: has a site what the formula asks for, and is an
energy that need not be alike at both ends another one there?
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ....errors import InvalidInput
from ....formulas.classes.of_each import Each
from ....formulas.classes.records import names_of, records_in, with_fields
from ....formulas.numbers.ways import APART
from ....formulas.vectors import small
from ....systems.potential import Force
from ..graphs import places_of, require_no_duplicates
from .among import has_places, places_of_sites
from .bound_terms import BoundTerm, term_of_edge
from .kinds_of_terms import alike
from .near_pairs import NearPairs
from .terms import AtTime, Site

SAMPLES = 64
"""Edges at which a term is tried."""

POINTS = 3
"""How often it is tried at each."""


def plain_term(term: Any) -> Any:
    """The term that a user wrote."""
    while isinstance(term, (NearPairs, AtTime)):
        term = term.term
    return term


def tried(terms: Any, part: BoundTerm) -> BoundTerm:
    """The term, and whether its ends are alike.  Raises InvalidInput for a term whose ends are not, on edges
    that do not say which is the first; and for one that asks a site for what it has not.

    terms : of which it is a part.
    """
    graph, name = part.graph, type(plain_term(part.term)).__name__
    near = part.term.term if isinstance(part.term, NearPairs) else None
    tested = part if near is None else with_fields(part, term=near)  # some are far apart
    reach = part.term.cutoff if isinstance(part.term, NearPairs) else 1.0
    rng = np.random.default_rng(11)
    force = isinstance(terms, Force)
    two_ends = graph.arity == 2 and graph.ordered is not True
    proof = force or (two_ends and len({*part.of}) < 2 and alike(terms, part))
    other = [proof] if isinstance(proof, tuple) else []
    for number, ends in [*graph.some_edges(SAMPLES), *other]:
        pairs = []
        for _ in range(POINTS):
            sites = [_some_site(terms, i, rng, reach) for i in ends]
            try:
                pairs.append(_values(tested, number, sites, force))
            except AttributeError as error:
                _require_parameters(terms, name, error)
            except TypeError as error:
                _require_known(terms, name, error)
            except Exception:  # a formula may fail anywhere but where it is meant to be used
                continue
        if force and pairs:
            _require_size(terms.group.base_of(ends[0]), name, pairs[0][0])
        if force or proof is True or len(ends) != 2 or not pairs or len({*part.of}) > 1:
            continue
        size = max(max(abs(a), abs(b)) for a, b in pairs)
        a, b = max(pairs, key=lambda pair: abs(pair[0] - pair[1]))
        if abs(a - b) > APART * size:
            if graph.ordered is False:
                raise _one_sided(name, graph, ends, f", {a:.6g} and {b:.6g} at sample points")
            return part
    if other and graph.ordered is False:
        raise _one_sided(name, graph, other[0][1])
    merged = two_ends and proof is True
    if merged and graph.ordered is None:
        require_no_duplicates(graph, np.sort(graph.edges, axis=1))
    return with_fields(part, merged=merged, first=force)


def _one_sided(name: str, graph: Any, ends: Any, values: str = "") -> InvalidInput:
    i, j = ends
    return InvalidInput(
        f"{name}: its energy is not the same with its sites exchanged, that of ({i}, {j}) and of ({j}, {i}){values}, and "
        f"the edges of {graph!r} do not say which is the first: give them one by one, neighbours.edges(pairs, ordered=True)"
    )


def require_apart(name: str, terms: Any, g: np.ndarray) -> None:
    """Raise InvalidInput for two sites in one place whose energy is not finite there, with the edge.

    terms : the potential.  g : (sites, ...), or (members, sites, ...); of several species in a row.
    """
    group = terms.group
    rows = np.asarray(group.in_a_row(np.asarray(g), "Element"))
    for member in rows.reshape(-1, *group.element_shape):
        for i, j in in_one_place(_places(group, member)):
            for part in terms.parts:
                if part.graph.arity == 2 and part.graph.ties(i, j):
                    _require_finite(name, terms, part, member, (i, j))


def _places(group: Any, member: np.ndarray) -> np.ndarray:
    """The places of all sites, or their elements, (sites, n).  member : elements in a row."""
    elements = group.by_site(member, "Element")
    bases = {group.base_of(i) for i in group.examples}
    if all(map(has_places, bases)):
        return places_of_sites(group, elements)
    return np.ascontiguousarray(elements).reshape(group.copies, -1)


def in_one_place(rows: np.ndarray) -> list[tuple[int, int]]:
    """The numbers of some pairs of equal rows, found by the order of a number made of each."""
    weights = np.random.default_rng(3).uniform(0.5, 1.0, rows.shape[1])
    order = np.argsort(np.abs(rows @ weights), kind="stable")
    equal = np.flatnonzero((rows[order[1:]] == rows[order[:-1]]).all(axis=1))[:SAMPLES]
    return [tuple(sorted((int(order[k]), int(order[k + 1])))) for k in equal]  # type: ignore[misc]


def _require_finite(name: str, terms: Any, part: BoundTerm, row: np.ndarray, ends: tuple[int, int]) -> None:
    group = terms.group
    order = ends if not part.of or group.species_of(ends[0]) == part.of[0] else ends[::-1]
    g = [group.site(row, i) for i in order]
    sites = [terms.site_with(i, None, small(np.asarray(x))) for i, x in zip(order, g)]
    try:
        energy = float(part.term.energy(*sites)) if not records_in(part.term, Each) else 0.0
    except ArithmeticError:
        energy = float("nan")
    except Exception:
        return
    if not np.isfinite(energy):
        raise InvalidInput(
            f"{name}: sites {group.named(order[0])} and {group.named(order[1])} are in one place, and "
            f"the energy of the edge {order} of {part!r} is not finite there"
        )


def _values(part: BoundTerm, number: int, sites: list[Any], force: bool) -> tuple[Any, Any]:
    """The energy of an edge, and that with its ends exchanged."""
    term = term_of_edge(part.term, number)
    if force:
        covector = term.covector(0.3, *sites)
        return covector, covector
    exchangeable = len(sites) == 2 and len({*part.of}) < 2
    return float(term.energy(*sites)), float(term.energy(*sites[::-1])) if exchangeable else 0.0


def _some_site(terms: Any, i: int, rng: np.random.Generator, reach: float) -> Any:
    """A site that is anywhere.  reach : how far it is away, if its energy ends with a cutoff."""
    base, site_with = terms.group.base_of(i), terms.site_with
    numbers, parts = small(rng.normal(size=base.dim)), terms.of_a_site
    mu, xi = (numbers if part in parts else None for part in ("mu", "xi"))
    if "g" not in parts:
        return site_with(i, mu, None)
    g = np.array(base.random(rng))
    if reach != 1.0:
        places_of(base, g)[...] *= reach
    return site_with(i, mu, small(g), xi)


def _require_parameters(terms: Any, term: str, error: AttributeError) -> None:
    if isinstance(error.obj, Site):
        kinds: Any = type(error.obj), Site
        names = [name for name in names_of(kinds[0]) if name not in names_of(kinds[1])]
        raise InvalidInput(
            f"{term}: a site has no {error.name!r}; it has {', '.join([*terms.of_a_site, *names])}. "
            f"Parameters of sites are given by name, Terms(..., {error.name}=each(values))"
        ) from error


def _require_known(terms: Any, term: str, error: TypeError) -> None:
    if "NoneType" in str(error):
        which, cure = _ELSEWHERE.get(terms.of_a_site, ("a.mu", "terms in a.mu belong to the Hamiltonian of its body"))
        raise InvalidInput(f"{term}: {which} does not count here ({error}); {cure}") from error


_ELSEWHERE = {
    ("mu",): ("a.g", "terms in a.g belong to the potential of a MechanicalSystem, terms in both to CotangentSites"),
    ("g",): ("a.mu", "terms in a.mu belong to the Hamiltonian of its body, terms in both to CotangentSites"),
    ("mu", "g"): ("a.xi", "write the energy by a.mu and a.g"),
}
"""By the parts of a site that terms have, one that they have not, and where terms in it belong."""


def _require_size(group: Any, term: str, force: Any) -> None:
    dim = group.dim
    if np.shape(force) != (dim,):
        raise InvalidInput(
            f"{term}.covector gives the force on a site of {group!r}, a vector of {dim} components; got {force!r}"
        )
