"""A stiff governor for ten seconds: its collar hangs from the arms by two springs with strong dampers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ...joints import Damper, Link, Linkage, PrismaticJoint, RevoluteJoint, Spring, Strut
from ...simulation.integrate import integrate
from ..constraints.lie_rattle import LieRATTLE
from .compared import Compared

SOURCE = (
    "IFToMM library of computational benchmark problems, A05; position and velocity of the collar by Exudyn "
    "(stiffFlyballGovernorKT.py, trapezoidal rule, h = 5e-4 s; log of its examples, version 1.10.0)"
)
DENSITY, LENGTH, SIDE, CUBE, BALL = 3000.0, 1.0, 0.01, 0.1, 5.0
STIFFNESS, DAMPING, REST = 8e5, 4e4, 0.5


def governor() -> tuple[Linkage, Any]:
    """A shaft, the collar on it and two arms with balls, and their start: arms 30 degrees below the horizon, 2 pi rad/s."""
    rod, cube = DENSITY * LENGTH * SIDE**2, DENSITY * CUBE**3
    across, along = rod * (LENGTH**2 + SIDE**2) / 12.0, rod * SIDE**2 / 6.0
    centre = LENGTH * (0.5 * rod + BALL) / (rod + BALL)  # of an arm with its ball, from the hinge
    of_arm = across + rod * (centre - 0.5 * LENGTH) ** 2 + BALL * (LENGTH - centre) ** 2
    arm = Link(rod + BALL, [of_arm, of_arm, along])
    links: Any = [Link(rod, [across, across, along]), Link(cube, [cube * CUBE**2 / 6.0] * 3), arm, arm]
    Y, Z = np.eye(3)[1:]
    joints: Any = [
        RevoluteJoint(0, None, -0.5 * LENGTH * Z, [0.0, 0.0, 0.0], Z, Z, name="shaft"),
        PrismaticJoint(1, 0, at_second=-0.5 * LENGTH * Z, axis=Z, name="collar"),
    ]
    forces: Any = []
    for body, side in ((2, 0.5 * CUBE), (3, -0.5 * CUBE)):
        at_shaft, at_collar = [side, 0.0, 0.5 * LENGTH], [side, 0.0, 0.0]
        joints += [
            RevoluteJoint(body, 0, -centre * Z, at_shaft, Y, Y, name=f"arm {body}"),
            Strut(1, body, at_collar, (0.5 * LENGTH - centre) * Z, name=f"strut {body}"),
        ]
        forces += [Spring(f"strut {body}", STIFFNESS, REST), Damper(f"strut {body}", DAMPING)]
    linkage = Linkage(links, joints, 9.81, forces)
    angles = {"collar": 0.5, "arm 2": 2.0 * np.pi / 3.0, "arm 3": -2.0 * np.pi / 3.0}
    return linkage, linkage.state(angles=angles, rates={"shaft": 2.0 * np.pi})


def compared(full: bool) -> Iterator[Compared]:
    """Where the collar is after 10 s, and how fast; their step allows 1e-4 m and 1e-3 m/s."""
    linkage, start = governor()
    run = integrate(linkage, LieRATTLE(), start, h=1e-4, t_end=10.0, every=100, progress=False)
    collar = run.joint("collar")
    yield Compared("position of the collar, m", 0.6196290867043189, collar.angle[-1], 1e-4)
    yield Compared("velocity of the collar, m/s", -0.7476025025635852, collar.rate[-1], 1e-3)
