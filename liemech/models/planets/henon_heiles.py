"""Henon and Heiles' galaxy: two coupled oscillators, regular at low energy and chaotic at high energy."""

from __future__ import annotations

from typing import ClassVar

from ...formulas import Vec, record, vec
from ...systems.separable import SeparableSystem


@record
class HenonHeiles(SeparableSystem):
    """A star in the plane of a galaxy, H(q, p) = |p|^2/2 + |q|^2/2 + lambda (x^2 y - y^3/3),
    q = (x, y); without units.

    coupling : lambda, 1 by default.  Bounded below the energy 1/(6 lambda^2); nearly integrable up
    to half of it.

    Source: Henon and Heiles, The applicability of the third integral of motion, Astron. J. 69
    (1964), 73; Hairer, Lubich, Wanner, I.3.
    """

    degrees: ClassVar[int] = 2
    time_unit: ClassVar[str] = ""

    coupling: float = 1.0

    def kinetic(self, p: Vec) -> float:
        """The kinetic energy |p|^2/2 of unit mass.  p : (2,)."""
        return 0.5 * (p @ p)

    def potential(self, q: Vec) -> float:
        """|q|^2/2 + lambda (x^2 y - y^3/3).  q : (2,)."""
        x, y = q
        return 0.5 * (q @ q) + self.coupling * y * (x * x - y * y / 3.0)

    def velocity(self, q: Vec, p: Vec) -> Vec:
        """p.  q, p : (2,)."""
        return p

    def force(self, q: Vec, p: Vec) -> Vec:
        """-(x + 2 lambda x y, y + lambda (x^2 - y^2)).  q, p : (2,)."""
        x, y = q
        return -vec(x + 2.0 * self.coupling * x * y, y + self.coupling * (x * x - y * y))
