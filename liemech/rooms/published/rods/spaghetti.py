"""Flying spaghetti in the plane: a slender rod is thrown by a force and a moment at its end, and flies on freely."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ....integrators.kicks.kick_drift import KickDrift
from ....models.many.cosserat_rod import CosseratRod
from ....models.many.rod_section import RodSection
from ....simulation.integrate import integrate
from ..compared import Compared

SOURCE = (
    "Simo and Vu-Quoc, J. Appl. Mech. 53 (1986), 855, with E I = 100; places by AeroBeams (flyingSpaghetti2D.jl and the data "
    "of its test, 20 elements, steps of 0.01 s), whose errors they have"
)
SECTION = RodSection([100.0, 100.0, 500.0, 1e4, 1e4, 1e4], [10.0, 10.0, 20.0, 1.0, 1.0, 1.0])
LENGTH, FORCE, MOMENT, LOADED = 10.0, 8.0, 80.0, 2.5
FIRST = np.array([[-0.8, 0.0, 0.6, 0.0], [0.0, 1.0, 0.0, 0.0], [-0.6, 0.0, -0.8, 0.0], [0.0, 0.0, 0.0, 1.0]])
"""The frame of the rod's other end at rest."""


def flight(rod: CosseratRod, mu: Any, g: Any, energy: Any, impulse: float) -> Iterator[Compared]:
    """Momenta and energy, which stand still in free flight."""
    total = rod.total_momentum(mu, g)
    change, spin = (np.linalg.norm(x, axis=1) for x in (total[:, :3] - total[0, :3], total[:, :3]))
    yield Compared("momentum, the impulse of the force", impulse, float(total[-1, 3]), 1e-11)
    yield Compared("change of the angular momentum, relative", 0.0, float(change.max() / spin[0]), 1e-13)
    yield Compared("change of the energy, relative", 0.0, float(np.ptp(energy) / energy[0]), 1e-5)


def compared(full: bool) -> Iterator[Compared]:
    """Where the loaded end is, and what stands still without the load, until 7.5 s, or 100 s."""
    thrown, free = (
        CosseratRod(SECTION, LENGTH, 80, ("free", "free"), tip_force=[F, 0.0, 0.0], tip_moment=[0.0, M, 0.0])
        for F, M in ((FORCE, MOMENT), (0.0, 0.0))
    )
    g = thrown.shape(start=FIRST)
    first: Any = integrate(thrown, KickDrift(), thrown.at_rest(g), h=5e-4, t_end=LOADED, every=1000, progress=False)
    start = free.state(first.mu[-1], first.g[-1])
    end = 100.0 if full else 7.5
    run: Any = integrate(free, KickDrift(), start, h=5e-4, t_end=end - LOADED, every=1000, progress=False)
    for name, value, axis in (("u1", 10.194452899919812, 0), ("u3", -0.38777259591469987, 2)):
        yield Compared(f"{name} of the end after 7.5 s", value, float((run.g[10] - g)[-1, axis, 3]), 0.15)
    yield from flight(free, run.mu, run.g, run.energy, FORCE * LOADED)
