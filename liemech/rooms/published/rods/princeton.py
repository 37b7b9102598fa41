"""The Princeton beam: a strip bends about both axes and twists under a weight at its tip, turned from edge to flat."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ....models.many.cosserat_rod import CosseratRod
from ....models.many.rod_section import RodSection
from ..compared import Compared, limit

SOURCE = (
    "Obrezkov, Mikkola, Matikainen et al., Nonlinear Dyn. 109 (2022): displacements by ANSYS's beam and solid elements, as "
    "Exudyn quotes them (geometricallyExactBeamTest.py); E = 71.7 GPa, Poisson's ratio 0.31"
)
LENGTH, HEIGHT, WIDTH = 0.508, 12.3777e-3, 3.2024e-3
ANGLES = 15, 30, 45, 60, 75
BEAM = {
    8.896: (
        (1.061328706e-2, 1.011169630e-2, 8.837226265e-3, 6.604665004e-3, 3.538889001e-3),
        (4.208232124e-2, 7.939482948e-2, 0.108987937, 0.129887616, 0.142194370),
    ),
    13.345: (
        (1.645825752e-2, 1.665873206e-2, 1.518618440e-2, 1.157837500e-2, 6.248967384e-3),
        (6.435812858e-2, 0.117735994, 0.156467239, 0.181861627, 0.196097131),
    ),
}
SOLID = {
    8.896: (
        (1.057180106e-2, 9.938278402e-3, 8.686786771e-3, 6.500006282e-3, 3.481999513e-3),
        (4.101165651e-2, 7.696749069e-2, 0.105976311, 0.127251299, 0.139594740),
    ),
    13.345: (
        (1.637026068e-2, 1.640440775e-2, 1.485055210e-2, 1.127173264e-2, 6.062461977e-3),
        (6.270699533e-2, 0.113752002, 0.153554457, 0.179978534, 0.192972233),
    ),
}


def displacement(weight: float, angle: float) -> np.ndarray:
    """Displacements of the tip across and along the flat side, from 16 and 32 elements, in m.  angle : from the edge, in rad."""
    section = RodSection.rectangle(WIDTH, HEIGHT, young=71.7e9, density=2810.0, poisson=0.31)
    force = [weight * np.sin(angle), weight * np.cos(angle), 0.0]
    rods = [CosseratRod(section, LENGTH, n, tip_force=force) for n in (16, 32)]
    return np.asarray(limit([rod.equilibrium()[-1, :2, 3] for rod in rods]))


def compared(full: bool) -> Iterator[Compared]:
    """Both displacements for two weights, to what beam and solid elements differ by."""
    for weight, beam in BEAM.items():
        for k, degrees in enumerate(ANGLES):
            for name, i, computed in zip(("across", "along"), (1, 0), displacement(weight, np.radians(degrees))):
                published, solid = beam[i][k], SOLID[weight][i][k]
                quantity = f"{name} the flat side, {weight:g} N at {degrees} degrees, m"
                yield Compared(quantity, published, float(computed), abs(published - solid))
