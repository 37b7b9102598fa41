"""N four-bars pass their dead points: together they are a pendulum, though most of their conditions are redundant."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ...integrators.composition import Composition
from ...joints import Link, Linkage, RevoluteJoint
from ...simulation.integrate import integrate
from ..constraints.lie_rattle import LieRATTLE
from .compared import Compared

SOURCE = (
    "IFToMM library of computational benchmark problems, A02; positions and velocities of the pendulum by DOP853 to "
    "1e-13, energies by Exudyn (fourBarMechanismIftomm.py)"
)
X, Y, Z = np.eye(3)


def four_bars(loops: int) -> tuple[Linkage, Any]:
    """N + 1 cranks and N couplers of 1 m and 1 kg, and their start: upright, with 1 m/s."""
    bar = Link(1.0, [1 / 12, 1 / 12, 1e-3])
    poses = np.tile(np.eye(4), (2 * loops + 1, 1, 1))
    poses[: loops + 1, :3, 3] = [k * X + 0.5 * Z for k in range(loops + 1)]
    poses[loops + 1 :, :3, 3] = [(k + 0.5) * X + Z for k in range(loops)]
    poses[loops + 1 :, :3, :3] = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]  # e3 along X
    joints: Any = [RevoluteJoint(k, None, -0.5 * Z, k * X, Y, Y, name=f"crank {k}") for k in range(loops + 1)]
    for k in range(loops):
        joints += [
            RevoluteJoint(loops + 1 + k, k + end, side * Z, 0.5 * Z, Y, Y) for end, side in ((0, -0.5), (1, 0.5))
        ]
    bars: Any = [bar] * (2 * loops + 1)
    linkage = Linkage(bars, joints, 9.81).independent(poses)
    return linkage, linkage.state(rates={"crank 0": 1.0}, near=poses)


def compared(full: bool) -> Iterator[Compared]:
    """The point B0 of the first crank; two four-bars for 10 s, forty for 20 s, and the energy of two."""
    ends: dict[int, Any] = {2: (10.0, (0.328458111537, 0.944518538180, 1.423051470, -0.494868845))}
    if full:
        ends[40] = (20.0, (0.410901153747, 0.911679900979, 1.566785372, -0.706162236))
    for loops, (end, published) in ends.items():
        linkage, start = four_bars(loops)
        run = integrate(linkage, Composition(LieRATTLE(), order=4), start, h=2.5e-3, t_end=end, every=4, progress=False)
        crank = run.joint("crank 0")
        q, rate = crank.angle[-1], crank.rate[-1]
        computed = np.sin(q), np.cos(q), rate * np.cos(q), -rate * np.sin(q)
        for name, value, number in zip(("x, m", "y, m", "x', m/s", "y', m/s"), published, computed):
            yield Compared(f"B0 of {loops} four-bars, {name}", value, number, 1e-8)
    linkage, start = four_bars(2)
    for h, largest in ((0.01, 0.1140507007), (1e-3, 1.143193966e-3), (5e-4, 2.858041366e-4))[: 3 if full else 1]:
        energy = integrate(linkage, LieRATTLE(), start, h=h, t_end=10.0, progress=False).energy
        yield Compared(f"largest error of the energy, order 2, h = {h:g} s, J", largest, np.ptp(energy))
