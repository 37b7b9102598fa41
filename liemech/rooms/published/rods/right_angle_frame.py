"""A right-angled frame of thin strip buckles sideways under a force in its plane: the critical load."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ....groups.rigid.se3 import SE3
from ....models.many.cosserat_rod import CosseratRod
from ....models.many.rod_section import RodSection
from ..compared import Compared

SOURCE = (
    "Simo and Vu-Quoc, Comput. Methods Appl. Mech. Eng. 58 (1986), 79; parameters and load as Exudyn quotes them "
    "(rightAngleFrame.py): legs of 0.24 m, 30 x 0.6 mm, E = 71.24 GPa, Poisson's ratio 0.31, GJ of a thin strip"
)
LEG, HEIGHT, WIDTH = 0.24, 0.03, 0.0006
SECTION = RodSection.of(
    HEIGHT * WIDTH, WIDTH * HEIGHT**3 / 12, HEIGHT * WIDTH**3 / 12, HEIGHT * WIDTH**3 / 3, 1.0, 7.124e10, 100.0, 0.31
)


def critical_load(elements: int) -> float:
    """The force at the free end, along the clamped leg, at which the frame's stiffness has no inverse, in N.

    The middle one of the elements, an odd number, has the corner: it is straight, a quarter turn about e1, and straight.
    """
    from scipy.optimize import brentq

    l = 2.0 * LEG / elements
    half, corner = np.eye(4), np.eye(4)
    half[2, 3] = 0.5 * l
    corner[1:3, 1:3] = [[0.0, 1.0], [-1.0, 0.0]]
    strains = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (elements, 1))
    strains[elements // 2] = np.asarray(SE3().log(half @ corner @ half)) / l

    def least(force: float) -> float:
        """The least eigenvalue of the stiffness where forces balance."""
        rod = CosseratRod(SECTION, 2.0 * LEG, elements, rest=strains, tip_force=[0.0, 0.0, force])
        stiffness = rod.stiffness(rod.equilibrium(stages=1)).toarray()[rod.free][:, rod.free]
        return float(np.linalg.eigvalsh(0.5 * (stiffness + stiffness.T))[0])

    return float(brentq(least, 0.9, 1.3, xtol=1e-8))


def compared(full: bool) -> Iterator[Compared]:
    """The load from 17, 33 and 65 elements, whose errors fall with their lengths; to a unit of its last digit."""
    counts = 17, 33, 65
    loads = [critical_load(n) for n in counts]
    yield Compared("critical load, N", 1.088, float(np.polyfit([1.0 / n for n in counts], loads, 2)[-1]), 1e-3)
