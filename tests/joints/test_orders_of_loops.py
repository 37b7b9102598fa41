"""Composition of order 4 on a hub and on a ring, whose joints tie each other."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.joints import BallJoint, Link, Linkage


def on_a_hub(count: int) -> tuple[Linkage, Any]:
    """Rods on the rim of a heavy wheel that hangs from a point."""
    wheel, rods = Link(1.0, [0.1, 0.12, 0.15]), [Link.rod(0.2, 0.4, 0.02)] * count
    joints = [BallJoint(0, None, [0.0, 0.0, 0.3], [0.0, 0.0, 0.0])]
    for k in range(count):
        a = 2.0 * np.pi * k / count
        rim = [0.5 * np.cos(a), 0.5 * np.sin(a), -0.1]
        joints.append(BallJoint(k + 1, 0, [0.0, 0.0, 0.2], rim))
    hub = Linkage([wheel, *rods], joints)
    angles = {0: [0.3, 0.2, 0.1], 1: [0.5, 0.0, 0.0], 3: [0.0, 0.4, 0.2], 6: [-0.3, 0.3, 0.0]}
    return hub, hub.state(angles=angles, rates={0: [1.0, 0.0, 2.0]})


def in_a_ring(count: int) -> tuple[Linkage, Any]:
    """Rods in a closed ring that falls and turns."""
    ends = [0.0, 0.0, -0.5], [0.0, 0.0, 0.5]
    joints = [BallJoint(k, (k - 1) % count, *ends) for k in range(count)]
    poses = np.tile(np.eye(4), (count, 1, 1))
    for k, pose in enumerate(poses):
        a = 2.0 * np.pi * (k + 0.5) / count
        out, along = [np.cos(a), np.sin(a), 0.0], [-np.sin(a), np.cos(a), 0.0]
        pose[:3, :3] = np.transpose([np.cross(out, along), out, along])
        pose[:3, 3] = 0.5 / np.tan(np.pi / count) * np.array(out)
    ring = Linkage([Link.rod(0.2, 1.0, 0.02)] * count, joints)
    return ring, ring.assembled(poses, np.random.default_rng(0).normal(size=(count, 6)))


@pytest.mark.slow
@pytest.mark.parametrize("made, h", [(on_a_hub, 0.005), (in_a_ring, 0.0025)])
def test_order_4(made: Any, h: float) -> None:
    linkage, start = made(6 if made is on_a_hub else 8)
    method, ends = lm.Composition(lm.LieRATTLE(), order=4), []
    for k in range(3):
        steps = 40 * 2**k
        run = lm.integrate(linkage, method, start, h=h / 2**k, steps=steps, every=steps)
        ends.append(run.g[-1])
    change = [np.abs(b - a).max() for a, b in pairwise(ends)]
    assert abs(np.log2(change[0] / change[1]) - 4.0) < 0.05
