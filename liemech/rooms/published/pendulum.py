"""A pendulum of 1 m falls from the horizontal for ten seconds, as a point mass on a massless bar."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...integrators.composition import Composition
from ...models.swinging.constrained_pendulums import ChainPendulum
from ...simulation.integrate import integrate
from ..constraints.rattle import RATTLE
from .compared import Compared

SOURCE = (
    "IFToMM library of computational benchmark problems, A01; places by Jacobi's functions, the energy by Exudyn "
    "(pendulumIftommBenchmark.py, energy error below 5e-5 J at h = 8e-4 s)"
)


def compared(full: bool) -> Iterator[Compared]:
    """Where the mass is after 10 s, and the largest error of the energy with their step."""
    from scipy.special import ellipj

    pendulum = ChainPendulum([1.0], [1.0], 9.81, 2)
    start = pendulum.state([-1.0, 0.0], [0.0, 0.0])
    run = integrate(pendulum, Composition(RATTLE(), order=8), start, h=0.01, t_end=10.0, every=100, progress=False)
    _, cn, dn, _ = ellipj(10.0 * np.sqrt(9.81), 0.5)
    half = np.arcsin(np.sqrt(0.5) * cn / dn)  # of the angle from below: sin(q/2) = k cd(sqrt(g/L) t), k^2 = 1/2
    for name, value, computed in zip("xy", (-np.sin(2.0 * half), -np.cos(2.0 * half)), run.q[-1]):
        yield Compared(f"{name} after 10 s, m", float(value), float(computed), 1e-10)
    run = integrate(pendulum, RATTLE(), start, h=8e-4, t_end=10.0, progress=False)
    yield Compared("largest error of the energy, order 2, h = 8e-4 s, J", 5e-5, float(np.ptp(run.energy)))
