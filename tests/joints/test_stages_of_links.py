"""Methods of stages on the reduced equation of linkages."""

import numpy as np
import pytest

import liemech as lm
from liemech.joints import Damper, DryFriction, Spring
from liemech.joints.linkage import Linkage
from liemech.simulation.runs.carry import SiteCarry

TURN = [0.0, 1.0, 0.0]


@lm.record
class WrittenOut(Linkage):
    """One whose equation is written out for all bodies."""

    small = 10**9


@lm.record
class Drag(lm.Force):
    """Air."""

    c: float

    def covector(self, t, xi, g):
        """-c xi."""
        return -self.c * xi


def arm(kind):
    """Three rods on balls, with forces at joints and on a body, bent and moving."""
    rods = lm.joints.chain(3, radius=0.3)
    forces = [Damper(1, 0.1), Spring(2, 2.0), DryFriction(0, 0.05, 0.5)]
    made = kind(rods.links, rods.joints, forces=forces, load={2: Drag(0.05)})
    angles = {0: [0.5, 0.1, 0.0], 1: [0.0, 0.3, 0.0]}
    return made, made.state(angles=angles, rates={2: [1.0, 0.0, 2.0]})


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    "method",
    [
        lm.RKMK(order=3),
        lm.RKMK(order=6),
        lm.RKMK(tableau=lm.tableaus.gauss(1)),
        lm.CommutatorFree(4),
        lm.CrouchGrossman(3),
    ],
    ids=repr,
)
def test_steps_under_loads_are_those_of_the_equation_written_out(method):
    ours, theirs = (
        lm.integrate(*made[:1], method, made[1], h=0.05, steps=3, compiled=False)
        for made in (arm(Linkage), arm(WrittenOut))
    )
    assert isinstance(ours.carry, SiteCarry) and not isinstance(theirs.carry, SiteCarry)
    for a, b in ((ours.g, theirs.g), (ours.mu, theirs.mu)):
        assert np.abs(a - b).max() < 1e-14 * np.abs(b).max()  # rounding


@pytest.mark.slow
def test_between_steps_it_goes_on_from_where_it_has_drifted():
    """The ends of steps are off the conditions by the error of the method, as no start may be."""
    rods = lm.joints.chain(4)
    start = rods.state(angles={0: [0.4, 0.3, 0.1]}, rates={0: [1.0, 0.5, 0.2]})
    run = lm.integrate(rods, lm.RKMK(order=4), start, h=0.02, steps=10, compiled=False)
    off, _ = rods.conditions_at(run.mu[9], run.g[9])
    assert np.abs(off).max() > 1e-10
    halves = lm.integrate(rods, lm.RKMK(order=4), start, h=0.01, steps=20, compiled=False)
    assert np.abs(run.at(0.19).g - halves.g[19]).max() < 30.0 * np.abs(run.g[9] - halves.g[18]).max()


@pytest.mark.slow
def test_loops():
    """A parallelogram, as the same with the method that keeps its conditions."""
    rod = lm.joints.Link.rod(1.0, 1.0, 0.02)
    R, up, low = lm.joints.RevoluteJoint, [0.0, 0.0, 0.5], [0.0, 0.0, -0.5]
    zero, far = [0.0] * 3, [1.0, 0.0, 0.0]
    joints = [
        R(0, None, up, zero, TURN, TURN, name="left"),
        R(1, None, up, far, TURN, TURN, name="right"),
        lm.joints.BallJoint(2, 0, low, low, name="pin"),
        lm.joints.BallJoint(2, 1, up, low, name="other pin"),
    ]
    poses = np.tile(np.eye(4), (3, 1, 1))
    poses[:, :3, 3] = [[0.0, 0.0, -0.5], [1.0, 0.0, -0.5], [0.5, 0.0, -1.0]]
    poses[2, :3, :3] = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]
    loop = lm.joints.Linkage([rod] * 3, joints).independent(poses)
    start = loop.state(angles={"left": 0.4}, near=poses)
    runs = [
        lm.integrate(loop, method, start, h=0.02, steps=6, compiled=False)
        for method in (lm.RKMK(order=6), lm.Composition(lm.LieRATTLE(), order=6))
    ]
    a, b = (run.joint("left").angle[-1] for run in runs)
    assert a == pytest.approx(b, abs=1e-9) and abs(a - 0.4) > 1e-2
