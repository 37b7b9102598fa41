"""Flying spaghetti in space: a slender rod is thrown by a force and two moments that rise and fall, and flies on freely."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ....formulas import Vec, record, vec
from ....formulas.classes.of_each import each
from ....groups.rigid.se3 import join
from ....integrators.kicks.kick_drift import KickDrift
from ....models.many.cosserat_rod import CosseratRod, turned_back
from ....models.many.rod_section import RodSection
from ....simulation.integrate import integrate
from ....systems.potential import Force
from ...sites.terms.terms import PerSite
from ..compared import Compared
from .spaghetti import FIRST, LENGTH, flight

SOURCE = (
    "Simo and Vu-Quoc, Comput. Methods Appl. Mech. Eng. 66 (1988), 125, with a moment of 200; places by AeroBeams "
    "(flyingSpaghetti3D.jl and the data of its test, 10 elements, steps of 0.001 s), whose errors they have"
)
SECTION = RodSection([500.0, 500.0, 500.0, 1e4, 1e4, 1e4], [10.0, 10.0, 20.0, 1.0, 1.0, 1.0])
PLACES = -0.5864870078071763, -3.1154766560045917, 1.8241373114933275


@record
class Throw(Force):
    """Moments M and M/2 about y and z, a force M/10 along x, in space; M is 200 at 2.5 s.  share : 1 where they act."""

    share: Any

    def covector(self, t: float, xi: Vec, g: Any) -> Vec:
        """(R^T M, R^T F)."""
        M = self.share * 80.0 * max(min(t, 5.0 - t), 0.0)
        return join(turned_back(g, vec(0.0, M, 0.5 * M)), turned_back(g, vec(0.1 * M, 0.0, 0.0)))


@record
class ThrownRod(CosseratRod):
    """A rod whose last frame is thrown."""

    def others(self) -> tuple[list[Any], Any]:
        """No other terms, and the throw."""
        at_end: Any = each(np.eye(self.frames)[-1])
        return [], PerSite(Throw(at_end))


def compared(full: bool) -> Iterator[Compared]:
    """Where the loaded end is after 3.5 s, within 0.15 m; what stands still from 5 s on, until 7.5 s, or 100 s."""
    rod = ThrownRod(SECTION, LENGTH, 80, ("free", "free"))
    g, end = rod.shape(start=FIRST), 100.0 if full else 7.5
    run: Any = integrate(rod, KickDrift(), rod.at_rest(g), h=5e-4, t_end=end, every=1000, progress=False)
    for name, value, computed in zip(("u1", "u2", "u3"), PLACES, (run.g[7] - g)[-1, :3, 3]):
        yield Compared(f"{name} of the end after 3.5 s", value, float(computed), 0.15)
    yield from flight(rod, run.mu[10:], run.g[10:], run.energy[10:], 50.0)
