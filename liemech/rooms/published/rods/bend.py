"""A cantilever bent by 45 degrees under 600 lb at its tip: displacements by a spectral method, to twelve digits."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ....models.many.cosserat_rod import CosseratRod
from ....models.many.rod_section import RodSection
from ..compared import Compared, limit

SOURCE = (
    "Bathe and Bolourchi, Int. J. Numer. Methods Eng. 14 (1979), 961; twelve digits by Kynema and BeamDyn "
    "(test Static_CurvedCompositeBeamBending), whose axis is no circle but the parabola through three of its points"
)
POINTS = (0.0, 0.0), (38.2683, -7.61205), (70.7107, -29.2893)
SECTION = RodSection([8.333e5, 8.333e5, 8.333e5, 41.6667e5, 41.6667e5, 1e7], [1 / 12, 1 / 12, 1 / 6, 1.0, 1.0, 1.0])


def displacement(elements: int) -> np.ndarray:
    """The displacement of the tip, (3,), in inches, in the axes of the source: the axis y = a x + b x^2 of the rod lies in
    elements of one length, with the turn of the tangent in each as its curvature.
    """
    (_, _), (x1, y1), (x2, y2) = POINTS
    b = (y2 / x2 - y1 / x1) / (x2 - x1)
    a = y1 / x1 - b * x1

    def arc(slope: np.ndarray) -> np.ndarray:
        """The length along the parabola from its vertex, where its slope is dy/dx."""
        return (slope * np.sqrt(1.0 + slope * slope) + np.arcsinh(slope)) / (4.0 * b)

    slopes = np.linspace(a, a + 2.0 * b * x2, elements + 1)
    first, last = arc(slopes[[0, -1]])
    lengths = np.linspace(first, last, elements + 1)
    for _ in range(8):  # Newton's method
        slopes -= (arc(slopes) - lengths) * 2.0 * b / np.sqrt(1.0 + slopes * slopes)
    angles, length = -np.arctan(slopes), last - first  # of e3 from x, towards -y
    strains = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (elements, 1))
    strains[:, 1] = np.diff(angles) * elements / length
    rods = [CosseratRod(SECTION, length, elements, rest=strains, tip_force=[0.0, F, 0.0]) for F in (0.0, 600.0)]
    straight, bent = (rod.equilibrium(stages=6)[-1, :3, 3] for rod in rods)
    down, side, along = bent - straight
    c, s = np.cos(angles[0]), np.sin(angles[0])
    return np.array([c * along - s * down, -(s * along + c * down), side])


def compared(full: bool) -> Iterator[Compared]:
    """Three displacements, from 16, 32 and 64 elements whose errors fall with the square of their lengths."""
    published = -23.6459716009048, 13.7208006040058, 53.5776450626987
    for name, value, computed in zip("xyz", published, limit([displacement(n) for n in (16, 32, 64)])):
        yield Compared(f"displacement of the tip along {name}, in", value, float(computed), 1e-8)
