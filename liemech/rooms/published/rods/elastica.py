"""A slender cantilever under a large load across its tip: Euler's elastica, by elliptic integrals."""

from __future__ import annotations

from collections.abc import Iterator

from ....models.many.cosserat_rod import CosseratRod
from ....models.many.rod_section import RodSection
from ..compared import Compared, limit

SOURCE = "Mattiasson, Int. J. Numer. Methods Eng. 17 (1981), 145, tables"
STIFF = RodSection([1.0, 1.0, 1.0, 1e7, 1e7, 1e7], [1.0] * 6)
"""It stretches and shears by 1e-7 of what it bends."""


def compared(full: bool) -> Iterator[Compared]:
    """Displacements of the tip at P L^2 = 10 E I, from 16 and 32 elements."""
    tips = []
    for elements in (16, 32):
        rod = CosseratRod(STIFF, 1.0, elements, tip_force=[10.0, 0.0, 0.0])
        tips.append(rod.equilibrium(stages=4)[-1, :3, 3])
    across, _, along = limit(tips)
    yield Compared("displacement of the tip along the load, in lengths", 0.81061, across, 6e-6)
    yield Compared("displacement of the tip along the rod, in lengths", 0.55500, 1.0 - along, 6e-6)
