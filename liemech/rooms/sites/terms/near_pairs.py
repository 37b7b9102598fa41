"""Terms of sites that are near each other in space: cutoffs and periodic boxes."""

from __future__ import annotations

from typing import Any

from ....formulas import Vec, constant, dot, record, vec, where
from ....formulas.classes.records import with_fields
from ....groups.lie_group import LieGroup
from ..graphs import displaced, place, seen_from
from .terms import Term


@record
class NearPairs(Term):
    """A term of two sites that are near each other: with the nearest image of the second in a
    periodic box, times a switch that takes it to zero at the cutoff.

        s(x) = 1 - x^4 (35 - 84 x + 70 x^2 - 20 x^3),  x = (r^2 - inner^2)/(cutoff^2 - inner^2)

    Source: the polynomial of least degree with three derivatives that vanish at both ends; Allen and
    Tildesley, Computer Simulation of Liquids, 2nd ed., section 5.3 (switched potentials).
    """

    term: Term
    first: LieGroup
    second: LieGroup
    cutoff: float
    inner: float
    box: Vec | None

    def __repr__(self) -> str:
        return repr(self.term)

    def image(self, a: Any, b: Any) -> Any:
        """The image of b that is nearest to a."""
        if self.box is None:
            return b
        shift = self.shift(place(self.second, b.g) - place(self.first, a.g))
        return with_fields(b, g=displaced(self.second, b.g, shift))

    def shift(self, apart: Any) -> Vec:
        """The shift of the second site to its nearest image, in a box.  apart : where it is, seen from the first."""
        box: Any = self.box
        return vec(*[-length * ((constant(d) * (1.0 / length) + 0.5) // 1.0) for d, length in zip(apart, box)])

    @property
    def layer(self) -> float:
        """The thickness of the switch in squares, cutoff^2 - inner^2."""
        return self.cutoff * self.cutoff - self.inner * self.inner

    def depth(self, apart: Vec) -> float:
        """x of two sites that are so far apart."""
        return (dot(apart, apart) - self.inner * self.inner) * (1.0 / self.layer)

    def switch(self, x: float) -> float:
        """1 for sites that are near, 0 from the cutoff on.  x : see above."""
        y = 1.0 - x * x * x * x * (35.0 + x * (-84.0 + x * (70.0 - 20.0 * x)))
        return where(x > 0.0, where(x < 1.0, y, 0.0), 1.0)

    def energy(self, a: Any, b: Any) -> float:
        """s times the energy of the term."""
        image = self.image(a, b)
        s = self.switch(self.depth(place(self.second, image.g) - place(self.first, a.g)))
        return where(s > 0.0, s * self.term.energy(a, image), 0.0)

    def force(self, group: Any, k: int, *sites: Any) -> Vec:
        """The force on site number k: s times that of the term, and what the switch adds."""
        ends = (sites[0], self.image(*sites))
        s, push = self._pushed(*ends)
        whole = self.term.force(group, k, *ends)
        return self._whole(group, ends[k], s, whole, push if k == 0 else -push)

    def forces(self, group: Any, *sites: Any) -> tuple[Vec, ...]:
        site, image = sites[0], self.image(*sites)
        s, push = self._pushed(site, image)
        first, second = self.term.forces(group, site, image)
        return self._whole(group, site, s, first, push), self._whole(group, image, s, second, -push)

    def _pushed(self, a: Any, b: Any) -> tuple[float, Vec]:
        return self.pushed(place(self.first, a.g) - place(self.second, b.g), self.term.energy(a, b))

    def pushed(self, apart: Any, energy: float) -> tuple[float, Vec]:
        """The switch, and the force on the first site that comes of it, in space.  apart : of the two,
        energy : of the term.
        """
        x = self.depth(apart)
        y = x * (1.0 - x)
        steep = where(x > 0.0, where(x < 1.0, 140.0 * (y * y * y), 0.0), 0.0)
        return self.switch(x), ((2.0 / self.layer) * steep * energy) * apart

    def _whole(self, group: Any, end: Any, s: float, force: Vec, push: Vec) -> Vec:
        """The force on one of them; none beyond the cutoff."""
        whole = s * force + seen_from(group, end.g, push)
        return vec(*[where(s > 0.0, c, 0.0) for c in whole])
