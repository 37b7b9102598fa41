"""Bodies of a linkage along a run: the load on each, its power and work."""

import numpy as np
import pytest

import liemech as lm


@lm.record
class Drag(lm.Force):
    """Air that gets thicker."""

    c: float

    def covector(self, t, xi, g):
        """-c (1 + t) xi."""
        return -self.c * (1.0 + t) * xi


@lm.record
class Winds(lm.Force):
    """The same on all bodies by one formula."""

    c: float

    def covector(self, t, xi, g):
        """-c (1 + t) xi."""
        return -self.c * (1.0 + t) * xi


@pytest.mark.parametrize("load", [{1: Drag(0.05), 0: Drag(0.05)}, Winds(0.05)])
def test_energy_changes_by_the_work_of_loads(load):
    rods = lm.joints.chain(2, radius=0.2)
    drag = lm.joints.Linkage(rods.links, rods.joints, load=load)
    start = drag.state(angles={0: [0.5, 0.1, 0.0]}, rates={1: [0.0, 2.0, 0.0]})
    off = []
    for steps in (10, 20):
        run = lm.integrate(drag, lm.LieRATTLE(), start, h=0.2 / steps, steps=steps, compiled=False)
        lost = run.link(0).work[-1] + run.link(1).work[-1]
        off.append(run.energy[-1] - run.energy[0] - lost)
    assert lost < -1e-3 and abs(off[1]) < 1e-3 * abs(lost)
    assert off[0] / off[1] == pytest.approx(4.0, rel=0.2)
    assert np.array_equal(run.link(1).pose[:, 3], [[0.0, 0.0, 0.0, 1.0]] * len(run))
    with pytest.raises(lm.errors.InvalidInput, match="no link 'arm'"):
        run.link("arm")
