"""Public robots move for ten seconds without contact and motors: four quadrupeds and a humanoid fly, three arms swing."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, files
from typing import Any

import numpy as np

from ...errors import InvalidInput
from ...joints import Linkage
from ...simulation.integrate import integrate
from ..constraints.lie_rattle import LieRATTLE
from .compared import Compared

SOURCE = (
    "newton-physics/newton, issue 4269 (2026): within 0.3 s SolverFeatherstone loses so100, so101, z1 and g1, MuJoCo none; "
    "files of the package example-robot-data, which has eight of its eleven robots"
)
LEGGED, ARMS = ("a1", "go1", "go2", "laikago", "g1_29dof_rev_1_0"), ("so100", "so101", "z1")


def robot(name: str) -> Linkage:
    """A robot of the package, one with legs without ground and weight.  Raises InvalidInput without the package."""
    try:
        path = next(path for path in files("example-robot-data") or () if path.name == f"{name}.urdf")
    except (PackageNotFoundError, StopIteration):
        raise InvalidInput(f"there is no {name}.urdf; pip install example-robot-data") from None
    legged = name in LEGGED
    return Linkage.from_urdf(path.locate(), floating=legged, gravity=0.0 if legged else 9.81)


def compared(full: bool) -> Iterator[Compared]:
    """How many are lost in ten seconds; of those without friction the energy, to 1 % of the largest kinetic one; the momentum
    of those that fly.  All joints start at zero, those of legs with 1 rad/s.
    """
    lost, rows = 0, []
    for name in (*LEGGED, *ARMS):
        linkage, legged = robot(name), name in LEGGED
        start = linkage.state(rates={joint.name: 1.0 for joint in linkage.joints if joint.freedoms == 1 and legged})
        h = 1e-3 if legged else 5e-4
        run: Any = integrate(linkage, LieRATTLE(), start, h=h, t_end=10.0, every=200, progress=False)
        lost += not np.isfinite(run.mu).all()
        if not linkage.forces:
            kinetic = 0.5 * (run.mu * linkage.velocity(run.mu)).sum(axis=1).max()
            rows.append(Compared(f"{name}, change of the energy", 0.0, float(np.ptp(run.energy) / kinetic), 0.01))
        if legged:
            first, last = linkage.total_momentum(run.mu[[0, -1]], run.g[[0, -1]])
            change = np.abs(last - first).max() / np.abs(run.mu).max()
            rows.append(Compared(f"{name}, change of the momentum", 0.0, float(change), 1e-9))
    yield Compared("robots that are lost", 0.0, float(lost), 0.5)
    yield from rows
