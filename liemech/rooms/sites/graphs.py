"""Graphs: which sites of a system are neighbours."""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ...errors import IncompatibleSystem, InvalidInput, InvalidType, undefined
from ...formulas import Element, Record, Vec, check_finite, mat, real_array, record, vec
from ...formulas.classes.fields import frozen_array
from ...formulas.classes.records import with_fields
from ...groups.lie_group import LieGroup
from ...groups.rigid.se2 import SE2
from ...groups.rigid.se3 import SE3
from ...groups.vector_space import VectorSpace

MOST = 2**53
"""More sites than this have no numbers."""


class Incidence(NamedTuple):
    """For each site the edges that end there in one role, as tables with a column for each site."""

    others: np.ndarray  # (k - 1, degree, sites), the other ends, in the order of the arguments of the term
    edges: np.ndarray  # (degree, sites), the numbers of the edges, rising in a column
    # (sites,), how many entries of a column count; those below repeat the last one that does, those of a site without
    # edges are any site and edge
    counts: np.ndarray


@record
class Graph(Record):
    """Edges between the sites of a system: each tells one, two or three of them, or more; abstract.

    sites : how many sites there are; None: as many as the system has.
    A subclass writes `edges`.
    """

    @property
    def sites(self) -> int | None:
        """The number of sites; None for any, that of the system."""
        raise undefined(self, "sites")

    @property
    def ordered(self) -> bool | None:
        """Whether an edge says which of its ends comes first; None: where the term asks for it."""
        return False

    @property
    def arity(self) -> int:
        """The number of sites of an edge, 2 by default."""
        return 2

    @property
    def edges(self) -> np.ndarray:
        """The sites of each edge, (edges, arity)."""
        raise undefined(self, "edges")

    @property
    def layout(self) -> np.ndarray | None:
        """The places where its sites are drawn, (sites, 3), with neighbours at a distance of 1; None: nobody knows."""
        return None

    def on(self, sites: int) -> Graph:
        """The graph on so many sites.  Raises InvalidInput if it has another number of them."""
        if self.sites not in (None, sites):
            raise InvalidInput(
                f"{self!r} has {self.sites} sites, and the system {sites}; edges take sites={sites} "
                "where some have none"
            )
        return self

    def between(self, name: str, of: tuple[int, ...], counts: list[int]) -> None:
        """Raise InvalidInput, unless its edges can be between sites of these species, so many of each.

        name : who asks.
        """
        raise InvalidInput(
            f"{name}: the edges of {self!r} are between sites of one species, not of {of}; "
            "neighbours.between(pairs) is for two, and all_pairs() and within(cutoff) serve both"
        )

    def ties(self, i: int, j: int) -> bool:
        """Whether there is an edge of these two sites."""
        return bool((np.sort(self.edges, axis=1) == (i, j)).all(axis=1).any())

    def some_edges(self, most: int) -> list[tuple[int, list[int]]]:
        """A selection of the edges, at most so many, evenly chosen: their numbers and sites."""
        edges = self.edges
        numbers: Any = np.unique(np.linspace(0, len(edges) - 1, most).astype(np.int64)) if len(edges) else []
        return [(int(number), edges[number].tolist()) for number in numbers]

    def incidence(self, role: int | None = None) -> Incidence:
        """The edges at each site: those of which it is the end number `role`, from 0; None: either
        end of two, where these need not be told apart.
        """
        incidence = self._known.get(role)
        if incidence is None:
            incidence = self._known[role] = incidence_of(self.edges, self.sites or 0, role)
        return incidence

    @cached_property
    def _known(self) -> dict[Any, Incidence]:
        return {}


def require_sites(name: str, edges: np.ndarray, counts: Any) -> None:
    """Raise InvalidInput for an edge that names a site that is not there.

    edges : (edges, arity).  counts : how many sites there are; of several species those of each end.
    """
    wrong = ((edges < 0) | (edges >= counts)).any(axis=1)
    if wrong.any():
        at = int(wrong.argmax())
        allowed = f"they are 0 to {counts - 1}" if isinstance(counts, int) else f"there are {counts}, numbered from 0"
        raise InvalidInput(f"{name}: edge {at}, {_shown(edges[at])}, names a site that is not there; {allowed}")


def incidence_of(edges: np.ndarray, sites: int, role: int | None) -> Incidence:
    """The edges at each site of which it is end number `role`; None: either end.
    Raises InvalidInput for a site that is not there: native code does not look.
    """
    arity = edges.shape[1]
    require_sites("the edges of a graph", edges, sites)
    if role is None and arity == 2:
        site, numbers = edges.ravel(), np.repeat(np.arange(len(edges)), 2)
        others = edges[:, ::-1].reshape(-1, 1)
    else:
        site, numbers = edges[:, role or 0], np.arange(len(edges))
        others = np.delete(edges, role or 0, axis=1)
    order = np.argsort(site, kind="stable")
    site, numbers, others = site[order], numbers[order], others[order]
    counts = np.bincount(site, minlength=sites)
    degree = int(counts.max(initial=0))
    place = np.arange(len(site)) - np.repeat(np.cumsum(counts) - counts, counts)
    table = np.zeros((degree, sites), dtype=np.int64)
    table[place, site] = numbers
    ends = np.empty((arity - 1, degree, sites), dtype=np.int64)
    ends[:] = (np.arange(sites) + 1) % sites  # of sites without edges
    ends[:, place, site] = others.T
    if (counts < degree).any():
        last = np.minimum(np.arange(degree)[:, None], np.maximum(counts - 1, 0))
        table = np.take_along_axis(table, last, axis=0)
        ends = np.take_along_axis(ends, np.broadcast_to(last, ends.shape), axis=1)
    return Incidence(ends, table, counts)


# ------------------------------------------------------------------ lattices


@record
class Lattice(Graph):
    """Sites in rows, squares or cubes, each tied to the next along each axis.

    shape : how many along each axis; the last one runs fastest.  periodic : is the last one tied to
    the first, for each axis?
    """

    shape: tuple[int, ...]
    periodic: tuple[bool, ...]
    called: str = "lattice"

    def __post_init__(self) -> None:
        """Raises InvalidInput for what is no length or no truth value, and for a ring of two."""
        super().__post_init__()
        shape, periodic = self.shape, self.periodic
        for n in shape:
            _count(self.called, "a length", n)
        if len(periodic) != len(shape) or not all(type(x) is bool for x in periodic):
            raise InvalidInput(
                f"neighbours.{self.called}: periodic is True or False, or one of them for each of "
                f"{len(shape)} axes; got {periodic!r}"
            )
        for axis, (n, x) in enumerate(zip(shape, periodic)):
            if n == 2 and x:
                step = int(np.prod(shape[axis + 1 :]))
                cure = (
                    "take chain(2)"
                    if len(shape) == 1
                    else f"let axis {axis} be open, periodic={tuple([p and m > 2 for p, m in zip(periodic, shape)])}"
                )
                raise InvalidInput(
                    f"neighbours.{self.called}({', '.join(map(str, shape))}): the edges (0, {step}) and "
                    f"({step}, 0) are the same, as two sites in a circle are tied twice; {cure}"
                )

    @property
    def sites(self) -> int:
        return int(np.prod(self.shape))

    @property
    def edges(self) -> np.ndarray:
        """The edges along the first axis, then along the second, ...; not kept, as there may be millions."""
        place = np.arange(self.sites).reshape(self.shape)
        by_axis = []
        for axis, (n, periodic) in enumerate(zip(self.shape, self.periodic)):
            if n > 1:
                first = place if periodic else np.delete(place, -1, axis)
                second = np.roll(place, -1, axis) if periodic else np.delete(place, 0, axis)
                by_axis.append(np.stack([first.ravel(), second.ravel()], axis=1))
        return np.concatenate(by_axis) if by_axis else np.empty((0, 2), dtype=np.int64)

    def incidence(self, role: int | None = None) -> Incidence:
        """The edges at each site: of a lattice without ends from the numbers of its sites alone."""
        if not all(x or n == 1 for n, x in zip(self.shape, self.periodic)):
            return incidence_of(self.edges, self.sites, role)
        place = np.arange(self.sites, dtype=np.int32).reshape(self.shape)
        others: list[np.ndarray] = []
        edges: list[np.ndarray] = []
        for axis, n in enumerate(self.shape):
            if n > 1:
                after, before = (np.roll(place, step, axis) for step in (-1, 1))
                along = self.sites * (len(edges) // (2 if role is None else 1))
                ends = [(before, along + before), (after, along + place)]
                if role is None:  # in the order of the edges
                    is_first = before < place
                    pairs = [[np.where(is_first, x, y), np.where(is_first, y, x)] for x, y in zip(*ends)]
                    others, edges = others + pairs[0], edges + pairs[1]
                else:
                    others, edges = others + [ends[1 - role][0]], edges + [ends[1 - role][1]]
        degree = len(others)
        shape = degree, self.sites
        table = np.reshape(others, shape) if degree else np.empty(shape, dtype=np.int32)
        numbers = np.reshape(edges, shape) if degree else np.empty(shape, dtype=np.int32)
        return Incidence(table[None], numbers, np.full(self.sites, degree))

    @cached_property
    def layout(self) -> np.ndarray:
        """Site j of a chain is at (j, 0, 0), (i, j) of a square lattice at (j, i, 0), (i, j, k) of a
        cubic one at (k, j, i); those of a ring are on a circle about the origin.
        """
        if len(self.shape) == 1 and self.periodic[0]:
            angle = 2.0 * np.pi * np.arange(self.sites) / self.sites
            radius = 0.5 / np.sin(np.pi / self.sites)
            return radius * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=-1)
        steps = np.indices(self.shape).reshape(len(self.shape), -1)[::-1].T
        return np.pad(steps.astype(float), ((0, 0), (0, 3 - len(self.shape))))

    def __repr__(self) -> str:
        lengths = ", ".join(map(str, self.shape))
        if self.called in ("ring", "chain"):
            return f"neighbours.{self.called}({lengths})"
        uniform = len({*self.periodic}) == 1
        how = "" if all(self.periodic) else f", periodic={self.periodic[0] if uniform else self.periodic}"
        return f"neighbours.{self.called}({lengths}{how})"


def ring(sites: int) -> Lattice:
    """Sites in a circle, each tied to the next, the last one to the first."""
    if _count("ring", "sites", sites) == 1:
        raise InvalidInput("neighbours.ring(1): the edge (0, 0) ties site 0 to itself; a ring has 3 sites at least")
    return _lattice("ring", (sites,), True)


def chain(sites: int) -> Lattice:
    """Sites in a row, each tied to the next."""
    return _lattice("chain", (sites,), False)


def square(rows: int, columns: int, periodic: Any = True) -> Lattice:
    """Sites of a square lattice: site (i, j) has the number columns i + j.

    periodic : is the last row tied to the first, and the last column; a truth value for both or one
    for each.
    """
    return _lattice("square", (rows, columns), periodic)


def cubic(layers: int, rows: int, columns: int, periodic: Any = True) -> Lattice:
    """Sites of a cubic lattice: site (i, j, k) has the number columns (rows i + j) + k.

    periodic : is the last layer tied to the first, and so on; a truth value for all axes or one for
    each.
    """
    return _lattice("cubic", (layers, rows, columns), periodic)


def _lattice(name: str, shape: tuple[int, ...], periodic: Any) -> Lattice:
    shape = tuple([_count(name, "a length", n) for n in shape])
    axes: Any = (periodic,) * len(shape)
    if isinstance(periodic, (tuple, list, np.ndarray)):
        axes = tuple(periodic)
    if len(axes) == len(shape):
        axes = tuple([bool(x) and n > 1 if isinstance(x, (bool, np.bool_)) else x for x, n in zip(axes, shape)])
    return Lattice(shape, axes, name)


def _count(name: str, what: str, n: Any) -> int:
    if isinstance(n, (bool, np.bool_)) or not isinstance(n, (int, np.integer)) or n < 1:
        raise InvalidInput(f"neighbours.{name}: {what} must be a whole number from 1 on; got {n!r}")
    return int(n)


# ------------------------------------------------------------------ given ones


@record
class Given(Graph):
    """Edges that are given one by one, (edges, arity); abstract."""

    given: np.ndarray

    @property
    def edges(self) -> np.ndarray:
        """The edges as they were given, (edges, arity)."""
        return self.given

    @property
    def arity(self) -> int:
        return int(self.given.shape[1])


@record
class Edges(Given):
    """Edges that are given one by one, of two sites each, or of three, or more.

    given : (edges, arity).  count : how many sites there are.  order : is the first of an edge told
    from the second?
    """

    count: int
    order: bool | None = None

    def __post_init__(self) -> None:
        """Raises InvalidInput for an edge to itself, a number beyond the sites, and one that is there
        twice; InvalidType for what is no whole number.
        """
        name = "neighbours.edges"
        array, order = _numbers_of_sites(name, self.given), self.order
        object.__setattr__(self, "given", frozen_array(array, name))
        super().__post_init__()
        require_sites(name, array, _count("edges", "sites", self.count))
        rows = np.sort(array, axis=1)
        twice = (rows[:, 1:] == rows[:, :-1]).any(axis=1)
        if twice.any():
            at = int(twice.argmax())
            raise InvalidInput(f"{name}: edge {at}, {_shown(array[at])}, ties a site to itself")
        if not (order is None or isinstance(order, (bool, np.bool_))):
            raise InvalidType(f"{name}: ordered is True, False or None; got {order!r}")
        require_no_duplicates(self, array if order is not False or array.shape[1] > 2 else rows)

    @property
    def sites(self) -> int:
        return self.count

    @property
    def ordered(self) -> bool | None:
        """Whether an edge says which of its ends comes first, as was given; None: where the term asks for it."""
        return self.order

    def __repr__(self) -> str:
        noun = {2: "pairs", 3: "triples"}.get(self.arity, f"edges of {self.arity}")
        return f"neighbours.edges({len(self.edges)} {noun}, sites={self.count})"


def edges(pairs: Any, sites: int | None = None, ordered: bool | None = None) -> Edges:
    """Edges between sites that are given one by one: (edges, 2) pairs of numbers of sites, from 0,
    or (edges, 3) triples.

    sites : how many there are; left out, up to the largest number.  ordered : does (i, j) say that i
    comes first?  Left out, where the term is not symmetric.
    Raises InvalidInput for an edge to itself, a number beyond the sites, and one that is there
    twice.
    """
    name = "neighbours.edges"
    array = _numbers_of_sites(name, pairs)
    most = int(array.max(initial=-1)) + 1
    return Edges(frozen_array(array, name), max(most, 1) if sites is None else _count("edges", "sites", sites), ordered)


def _numbers_of_sites(name: str, pairs: Any) -> np.ndarray:
    """Edges that are given, (edges, arity) whole numbers."""
    try:
        array = np.asarray(pairs)
    except ValueError:
        raise InvalidInput(f"{name}: pairs are ragged: edges have one number of sites") from None
    if array.size == 0:
        array = np.empty((0, array.shape[1] if array.ndim == 2 and array.shape[1] else 2), dtype=np.int64)
    whole = array.dtype.kind == "f" and bool((array == np.floor(array)).all())
    if whole and np.abs(array).max(initial=0.0) < MOST:
        array = array.astype(np.int64)
    if (whole and array.dtype.kind == "f") or (array.dtype.kind == "u" and array.max() >= MOST):
        raise InvalidInput(f"{name}: pairs name site {array.max():g}; there are not so many")
    if array.dtype.kind not in "iu":
        raise InvalidType(f"{name}: pairs are whole numbers, those of sites; got {array.dtype}")
    if array.ndim != 2 or array.shape[1] < 2:
        raise InvalidInput(f"{name}: pairs have shape (edges, 2), triples (edges, 3); got {array.shape}")
    return array.astype(np.int64)


@record
class Between(Given):
    """Edges between sites of several species, given one by one, by their numbers in these; `Term.over` takes the species."""

    sites = None  # as many as the species have

    def __post_init__(self) -> None:
        """Raises InvalidInput for an edge that is there twice, InvalidType for what is no whole number."""
        name = "neighbours.between"
        object.__setattr__(self, "given", frozen_array(_numbers_of_sites(name, self.given), name))
        super().__post_init__()
        require_no_duplicates(self, self.given)

    def on(self, sites: int) -> Graph:
        """Raise InvalidInput: it is between species."""
        raise InvalidInput(
            f"{self!r}: say between which species its edges are, `over(graph, of=(0, 1))`; edges of "
            "one are neighbours.edges(pairs)"
        )

    def between(self, name: str, of: tuple[int, ...], counts: list[int]) -> None:
        """Raise InvalidInput for a site that is not there, and for an edge to itself."""
        require_sites(f"{name} between species {of}", self.given, counts)
        for i in range(len(of)):
            for j in range(i):
                degenerate = self.given[:, i] == self.given[:, j]
                if of[i] == of[j] and degenerate.any():
                    at = int(degenerate.argmax())
                    raise InvalidInput(f"{name}: edge {at}, {_shown(self.given[at])}, ties a site to itself")

    def __repr__(self) -> str:
        return f"neighbours.between({len(self.given)} edges)"


def between(pairs: Any) -> Between:
    """Edges between sites of two species, or of three: (i, j) ties site i of the first to site j of
    the second, `term.over(neighbours.between(pairs), of=(0, 1))`.

    pairs : (edges, 2), or (edges, 3).  Raises InvalidInput for an edge that is there twice; `over` for
    a site that is not there.
    """
    return Between(_numbers_of_sites("neighbours.between", pairs))


def require_no_duplicates(graph: Graph, rows: np.ndarray) -> None:
    """Raise InvalidInput if two rows, those of the edges, are the same."""
    order = np.lexsort(rows.T[::-1])
    sorted_ = rows[order]
    twice = (sorted_[1:] == sorted_[:-1]).all(axis=1)
    if twice.any():
        at = int(twice.argmax())
        i, j = sorted(map(int, order[at : at + 2]))
        raise InvalidInput(
            f"{graph!r}: edges {i}, {_shown(graph.edges[i])}, and {j}, {_shown(graph.edges[j])}, are the same"
        )


def _shown(edge: Any) -> str:
    return str(tuple(map(int, edge)))


# ------------------------------------------------------------------ all of them


@record
class OfCount(Graph):
    """A graph that is known by the number of its sites; abstract.

    count : that number; None: as many as the system has.
    """

    count: int | None = None

    def __post_init__(self) -> None:
        """Raises InvalidInput for what is no number of sites."""
        super().__post_init__()
        if self.count is not None:
            _count(type(self).__name__, "sites", self.count)

    @property
    def sites(self) -> int | None:
        """The number of sites; None: as many as the system has."""
        return self.count

    def on(self, sites: int) -> Graph:
        """The graph on this number of sites, unless it has another one."""
        return with_fields(self, count=sites) if self.count is None else super().on(sites)


@record
class AllPairs(OfCount):
    """Every site is tied to every other one."""

    @cached_property
    def edges(self) -> np.ndarray:
        """(0, 1), (0, 2), ..., (1, 2), ..."""
        return np.stack(np.triu_indices(self.count or 0, 1), axis=1).astype(np.int64)

    def between(self, name: str, of: tuple[int, ...], counts: list[int]) -> None:
        """Every site of one to every one of the other."""
        if len(of) != 2 or self.count is not None:
            super().between(name, of, counts)

    def ties(self, i: int, j: int) -> bool:
        """Whether two sites are tied: yes, every two."""
        return True

    def some_edges(self, most: int) -> list[tuple[int, list[int]]]:
        """(0, 1), (0, 2), ..."""
        return [(i, [0, i + 1]) for i in range(min(most, (self.count or 0) - 1))]

    def __repr__(self) -> str:
        return f"neighbours.all_pairs({'' if self.count is None else self.count})"


def all_pairs(sites: int | None = None) -> AllPairs:
    """Every site is tied to every other one.  sites : how many there are; left out, as many as the
    system has.
    """
    return AllPairs(None if sites is None else _count("all_pairs", "sites", sites))


@record
class Within(AllPairs):
    """Every two sites whose places are nearer than a cutoff, in space or in a periodic box.

    cutoff : that distance.  inner : up to this one a term has its full energy; from there on a
    switch takes it to zero, which it is at the cutoff with three derivatives.  box : the lengths of
    the periodic box; None: there is none.  The place of a site is that of its element in space.

    Written out it is all pairs, of which those beyond the cutoff add zero; `near` finds the others,
    so that sums have the same bits whichever list they go through and whenever it was made.

    Source: Allen and Tildesley, Computer Simulation of Liquids, 2nd ed., sections 1.6 and 5.3.
    """

    cutoff: float = 0.0
    inner: float = 0.0
    box: Vec | None = None

    def __post_init__(self) -> None:
        """Raises InvalidInput unless 0 <= inner < cutoff, and for a cutoff beyond half the box."""
        super().__post_init__()
        name, far, near = "neighbours.within", self.cutoff, self.inner
        if not 0.0 <= near < far < np.inf:
            raise InvalidInput(
                f"{name}: cutoff is a positive distance, and inner a shorter one; got {far:g} and {near:g}"
            )
        if self.box is None:
            return
        if not len(self.box) or not all(0.0 < length < np.inf for length in self.box):
            raise InvalidInput(f"{name}: box is the lengths of a box, positive; got {self.box!r}")
        if far > 0.5 * min(self.box):
            raise InvalidInput(
                f"{name}: the cutoff {far:g} is beyond half the box, {0.5 * min(self.box):g}: a site would "
                "meet two images of another"
            )

    def pairs(self, places: Any, reach: float) -> np.ndarray:
        """The pairs of sites up to a distance, (pairs, 2), in rising order.  places : (sites, n)."""
        from scipy.spatial import cKDTree

        at, box = np.asarray(places, dtype=float), None
        if self.box is not None:
            box = np.array(self.box)
            at = np.mod(at, box)
            at[at >= box] = 0.0  # of -1e-17
        pairs = cKDTree(at, boxsize=box).query_pairs(reach, output_type="ndarray")
        pairs = np.sort(pairs.astype(np.int64), axis=1)
        return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]

    def near(self, places: Any, reach: float, role: int = 0) -> Incidence:
        """The sites near each site, in rising order; of no places none.  reach : the cutoff or more.
        Lists that reach further give the same sums: what is beyond the cutoff adds zero.
        """
        if places is None:
            return incidence_of(np.empty((0, 2), dtype=np.int64), 1, None)
        return incidence_of(self.pairs(places, reach), self.sites or len(places), None)

    def open(self) -> Within:
        """The graph of any number of sites, for formulas."""
        return with_fields(self, count=None)

    def __repr__(self) -> str:
        box = "" if self.box is None else f", box={list(self.box)}"
        return f"neighbours.within({self.cutoff:g}{box})"


def within(cutoff: float, box: Any = None, inner: float | None = None) -> Within:
    """Every two sites nearer than a cutoff.  Their energy goes to zero there, by a switch from
    `inner` on.

    box : the lengths of a periodic box, (n,), or one number for a cube of space: every site sees
    the nearest image of another.  inner : left out, 0.9 of the cutoff.
    Raises InvalidInput for a cutoff beyond half the box.
    """
    name = "neighbours.within"
    numbers = [real_array(x, f"{name}: {argument}") for argument, x in (("cutoff", cutoff), ("inner", inner or 0.0))]
    for argument, x in zip(("cutoff", "inner"), numbers):
        if x.ndim:
            raise InvalidInput(f"{name}: {argument} is one distance; got shape {x.shape}")
        check_finite(x, f"{name}: {argument}")
    cutoff_length = float(numbers[0])
    inner_length = 0.9 * cutoff_length if inner is None else float(numbers[1])
    if box is None:
        return Within(None, cutoff_length, inner_length)
    lengths = real_array(box, f"{name}: box")
    lengths = lengths if lengths.ndim else np.repeat(lengths, 3)
    check_finite(lengths, f"{name}: box")
    if lengths.ndim != 1:
        raise InvalidInput(f"{name}: box is the lengths of a box, (n,); got shape {lengths.shape}")
    return Within(None, cutoff_length, inner_length, Vec.of(lengths.tolist()))


def place(group: LieGroup, g: Element) -> Vec:
    """The place in space of an element of SE3(), SE2() or VectorSpace(n).  g : an element."""
    if isinstance(group, SE3):
        return vec(g[0, 3], g[1, 3], g[2, 3])
    if isinstance(group, SE2):
        return vec(g[0, 2], g[1, 2])
    if isinstance(group, VectorSpace):
        return g
    raise IncompatibleSystem(
        f"neighbours.within needs places in space, which elements of {group!r} have not; SE3(), SE2() "
        "and VectorSpace(n) have"
    )


def seen_from(group: LieGroup, g: Element, x: Vec) -> Vec:
    """A force in space on the place of an element, in its own axes, (dim,): <f, eta> is the power
    when it moves with velocity eta.
    """
    if isinstance(group, VectorSpace):
        return x
    n = len(x)
    turned = [sum([g[i, k] * x[i] for i in range(n)]) for k in range(n)]
    return vec(*[0.0 for _ in range(group.dim - n)], *turned)


def places_of(group: LieGroup, g: Any) -> np.ndarray:
    """The places of many elements, (..., n).  g : (..., n), or (..., n + 1, n + 1)."""
    return g if isinstance(group, VectorSpace) else g[..., :-1, -1]


def displaced(group: LieGroup, g: Element, shift: Vec) -> Any:
    """The element that is moved in space by a shift.  g : an element."""
    if isinstance(group, VectorSpace):
        return g + shift
    n = len(shift)
    return mat(
        *[vec(*[g[i, j] + shift[i] if j == n and i < n else g[i, j] for j in range(n + 1)]) for i in range(n + 1)]
    )


@record
class EachSite(OfCount):
    """Every site for itself: the edges of terms that have one argument."""

    arity = 1

    @cached_property
    def edges(self) -> np.ndarray:
        """The edges (0,), (1,), ..., one for each site."""
        return np.arange(self.count or 0, dtype=np.int64)[:, None]

    def __repr__(self) -> str:
        return "every site"
