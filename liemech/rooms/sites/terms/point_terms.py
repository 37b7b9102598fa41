"""Terms of two sites that act on each other through points which they carry."""

from __future__ import annotations

from typing import Any

from ....errors import undefined
from ....formulas import Vec, dot, gradient, record, vec, where
from ....formulas.classes.derived import derived
from ....formulas.classes.signatures import bare
from ....groups.lie_group import LieGroup
from ..graphs import place, seen_from
from .near_pairs import NearPairs
from .terms import Term


@record
class PointTerm(Term):
    """A term of two sites through points that they carry, such as the atoms of rigid molecules: every
    site finds its points once, and turns the sum of the forces on them into a torque and a force
    once, however many others it meets; abstract.

    A subclass has `points` and `between`; `pushes` and `felt` follow, or are written in closed form.
    Source: Allen and Tildesley, Computer Simulation of Liquids, 2nd ed., section 3.6 (interaction
    sites of rigid molecules).
    """

    def points(self, g: Any) -> tuple[Any, ...]:
        """The points of a site, in space.  g : its element."""
        raise undefined(self, "points")

    def between(self, a: tuple[Any, ...], b: tuple[Vec, ...]) -> float:
        """The energy of two sites with these points."""
        raise undefined(self, "between")

    @derived
    def pushes(self, a: tuple[Any, ...], b: tuple[Vec, ...]) -> tuple[Vec, Vec]:
        """The forces on the points of the first and on those of the second, in space, in a row."""
        first = gradient(lambda x: self.between(_as_points(x, a), b), _in_a_row(a))
        second = gradient(lambda x: self.between(a, _as_points(x, b)), _in_a_row(b))
        return -first, -second

    @derived
    def felt(self, group: Any, g: Any, push: Any) -> Vec:
        """The torque and the force on a site, (dim,), of forces on its points.  g : its element, push : in a row."""
        zero = vec(*[0.0 for _ in range(group.dim)])
        return gradient(lambda eta: dot(push, _in_a_row(self.points(group.compose_exp(g, eta)))), zero)

    def energy(self, a: Any, b: Any) -> float:
        """The energy of two sites, by their points."""
        return self.between(self.points(a.g), self.points(b.g))

    def force(self, group: Any, k: int, *sites: Any) -> Vec:
        a, b = sites
        return self.felt(group, sites[k].g, self.pushes(self.points(a.g), self.points(b.g))[k])

    def forces(self, group: Any, *sites: Any) -> tuple[Any, ...]:
        a, b = sites
        first, second = self.pushes(self.points(a.g), self.points(b.g))
        return self.felt(group, a.g, first), self.felt(group, b.g, second)


def acts_through_points(term: Any) -> bool:
    """Whether the energy and forces of a term are those of its points, not written anew by a subclass."""
    names = "energy", "force", "forces"
    return isinstance(term, PointTerm) and all(
        bare(getattr(type(term), x)) is bare(getattr(PointTerm, x)) for x in names
    )


def _in_a_row(points: tuple[Any, ...]) -> Vec:
    return vec(*[x for point in points for x in point])


def _as_points(row: Vec, like: tuple[Any, ...]) -> tuple[Vec, ...]:
    """The inverse of `_in_a_row`, of as many points as `like`."""
    n = len(like[0])
    return tuple([row[n * k : n * k + n] for k in range(len(like))])


@record
class NearPointPairs(PointTerm, NearPairs):
    """Near pairs of such a term: the last point is the place of the site, from which the switch is."""

    def __repr__(self) -> str:
        return repr(self.term)

    def points(self, g: Any) -> tuple[Any, ...]:
        return (*self.term.points(g), place(self.first, g))

    def seen(self, a: tuple[Any, ...], b: tuple[Vec, ...]) -> tuple[Vec, ...]:
        """The points of the image of the second that is nearest."""
        if self.box is None:
            return b
        shift = self.shift(b[len(b) - 1] - a[len(a) - 1])
        return tuple([point + shift for point in b])

    def between(self, a: tuple[Any, ...], b: tuple[Vec, ...]) -> float:
        """s times the energy of the term."""
        b, last = self.seen(a, b), len(a) - 1
        s = self.switch(self.depth(b[last] - a[last]))
        energy = self.term.between(a[:last], b[:last])
        return where(s > 0.0, s * energy, 0.0)

    def pushes(self, a: tuple[Any, ...], b: tuple[Vec, ...]) -> tuple[Vec, Vec]:
        """s times those of the term, and what the switch adds at the places; none beyond the cutoff."""
        b, last = self.seen(a, b), len(a) - 1
        term: Any = self.term
        first, second = term.pushes(a[:last], b[:last])
        s, push = self.pushed(a[last] - b[last], term.between(a[:last], b[:last]))
        within = s > 0.0
        on_first, on_second = vec(*(s * first), *push), vec(*(s * second), *(-push))
        return vec(*[where(within, c, 0.0) for c in on_first]), vec(*[where(within, c, 0.0) for c in on_second])

    def felt(self, group: Any, g: Any, push: Any) -> Vec:
        """The force on a site by the pushes on its points and on its place."""
        n = len(push) - len(place(self.first, g))
        term: Any = self.term
        return term.felt(group, g, push[:n]) + seen_from(group, g, push[n:])


def near_pairs(term: Term, first: LieGroup, second: LieGroup, *more: Any) -> NearPairs:
    """A term of pairs that are near each other.  first, second : the groups of its sites."""
    through_points = acts_through_points(term) and first == second
    return (NearPointPairs if through_points else NearPairs)(term, first, second, *more)
