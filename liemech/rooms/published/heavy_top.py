"""A fast heavy top for two seconds: its angular velocity and its attitude."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ...groups.rigid.so3 import SO3
from ...integrators.composition import Composition
from ...integrators.kicks.lie_verlet import LieVerlet
from ...models.bodies.heavy_top import HeavyTop
from ...simulation.integrate import integrate
from .compared import Compared

SOURCE = (
    "Bruels and Cardona, J. Comput. Nonlinear Dyn. 5 (2010), 031002, the top; two seconds of it by Exudyn "
    "(explicitLieGroupIntegratorTest.py, Dormand and Prince to 1e-10; log of its tests, version 1.9.0)"
)
OMEGA = -27.65851484, -106.16380357, -102.46246458
TURN = -1.43258163, 1.02227688, -2.29872073


def compared(full: bool) -> Iterator[Compared]:
    """The angular velocity in space and the rotation vector after 2 s, to what two methods of Exudyn differ by."""
    m, centre = 15.0, np.array([0.0, 1.0, 0.0])
    top = HeavyTop(np.array([0.234375, 0.46875, 0.234375]) + m * (1.0 - centre), m * 9.81, centre)
    start = top.state(xi=[0.0, 150.0, -4.61538], g=np.eye(3))
    run: Any = integrate(top, Composition(LieVerlet(), order=8), start, h=1e-3, steps=2000, every=2000, progress=False)
    R = run.g[-1]
    omega, turn = R @ (run.mu[-1] / np.array(top.inertia)), np.array(SO3().log(R))
    for quantity, values, vector in (("angular velocity, rad/s", OMEGA, omega), ("rotation vector", TURN, turn)):
        for name, value, computed in zip("xyz", values, vector):
            yield Compared(f"{quantity}, {name}", value, float(computed), 2e-5)
