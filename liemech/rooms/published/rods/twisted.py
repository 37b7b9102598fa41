"""A cantilever twisted by 90 degrees bends under a force at its tip, and a straight one rolls up to a circle."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ....models.many.cosserat_rod import CosseratRod
from ....models.many.rod_section import RodSection
from ..compared import Compared, limit

SOURCE = (
    "Wang, Sprague, Jonkman, Johnson and Jonkman, Wind Energy 20 (2017), 1439; twelve digits by Kynema and BeamDyn (test "
    "Static_TwistedCompositeBeamBending); rolling up, Simo and Vu-Quoc, Comput. Methods Appl. Mech. Eng. 58 (1986), 79"
)
LENGTH, TWIST = 10.0, 0.5 * np.pi
SECTION = RodSection([5.20833e8, 1.30208333e8, 1.41872656e8, 8.2604167e9, 8.2604167e9, 2.5e10], [1.0] * 6)
ROLLED = RodSection([86.9e3, 215e3, 8.16e3, 1770e3, 1770e3, 1770e3], [1.0] * 6)
TIP = -1.14152599953942, -1.71805334646388, -3.59321324026952


def displacement(elements: int) -> np.ndarray:
    """The displacement of the twisted tip along, across and under the force, (3,)."""
    strain = [0.0, 0.0, TWIST / LENGTH, 0.0, 0.0, 1.0]
    rod = CosseratRod(SECTION, LENGTH, elements, rest=strain, tip_force=[0.0, -4e6, 0.0])
    across, under, along = rod.equilibrium()[-1, :3, 3]
    return np.array([along - LENGTH, across, under])


def compared(full: bool) -> Iterator[Compared]:
    """Three displacements, from 16, 32, 64 and 128 elements whose errors fall with the squares of their lengths."""
    for name, value, computed in zip("123", TIP, limit([displacement(n) for n in (16, 32, 64, 128)])):
        yield Compared(f"u{name} of the tip", value, float(computed), 1e-8)
    rod = CosseratRod(ROLLED, LENGTH, 8, tip_moment=[2.0 * np.pi * 86.9e3 / LENGTH, 0.0, 0.0])
    yield Compared("tip that is rolled up", -LENGTH, float(rod.equilibrium()[-1, 2, 3] - LENGTH), 1e-10)
