"""Ten links swing: the energy of a variational integrator stays in a band, without a trend."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ...joints import Link, Linkage, RevoluteJoint
from ...simulation.integrate import integrate
from ..constraints.lie_rattle import LieRATTLE
from .compared import Compared

SOURCE = (
    "Lee, Liu, Park and Srinivasa, WAFR 2016 (arXiv:1609.02898), energy conservation, as DART repeats it with "
    "numbers (test PassiveChainEnergyHasNoSecularDrift)"
)
BAND, TREND = 7.8e-3, 5.9e-4
"""The largest change of the energy by DART's variational integrator, relative to that of the start, and its trend over the
run, the slope from sample to sample times a hundred samples.
"""


def compared(full: bool) -> Iterator[Compared]:
    """The largest change of the energy, and its trend from the first sample to the last; ten seconds, or a hundred."""
    Y = np.array([0.0, 1.0, 0.0])
    links: Any = [Link(0.7, [0.02, 0.02, 0.02])] * 10
    joints: Any = [RevoluteJoint(0, None, axis_first=Y, axis_second=Y, name="0")]
    joints += [RevoluteJoint(k, k - 1, [0.0, 0.0, 0.0], [0.3, 0.0, 0.0], Y, Y, name=f"{k}") for k in range(1, 10)]
    chain = Linkage(links, joints, 9.81)
    start = chain.state(angles={f"{k}": 0.4 for k in range(10)})
    steps = 100_000 if full else 10_000
    run = integrate(chain, LieRATTLE(), start, h=1e-3, steps=steps, every=steps // 100, progress=False)
    change = run.energy / run.energy[0] - 1.0
    yield Compared("largest change of the energy, relative", BAND, float(np.abs(change).max()))
    slope = np.polyfit(run.t / run.t[-1], change, 1)[0]
    yield Compared("trend of the energy over the run, relative", TREND, float(slope))
