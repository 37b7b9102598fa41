"""Bodies with many joints: their motion is an unknown of the elimination, beside the impulses."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from test_links_in_memory import BLOCK, LUMP, ROD, TOP, TURN, by_loops, ladder, needs_compiler, ring, star, tree

import liemech as lm
from liemech.formulas.sites import padded
from liemech.joints import BallJoint, Damper, Link, Linkage, PrismaticJoint, RevoluteJoint, chain, elimination_order
from liemech.joints.elimination_order import hubs_in, tables_of


def wheel(m: int, light: float = 1.0, damped: bool = False) -> tuple[Linkage, Any]:
    """A wheel on a ball joint, with rods all around it, one of them on a slide."""
    joints: list[Any] = [BallJoint(0, None, [0.0, 0.0, 0.7], [0.0, 0.0, 0.7])]
    links, poses = [Link(5.0 * light, [1.0 * light, 1.2 * light, 1.1 * light])], [np.eye(4)]
    rng = np.random.default_rng(3)
    for k in range(m):
        turn, spot = 2.0 * np.pi * k / m, np.eye(4)
        rim = np.array([np.cos(turn), np.sin(turn), 0.0])
        spot[:3, :3] = np.eye(3) if k in (1, 2) else lm.SO3().exp(0.4 * rng.normal(size=3))
        spot[:3, 3] = rim - spot[:3, :3] @ TOP
        if k == 1:
            joints.append(PrismaticJoint(2, 0, TOP, rim, [0, 0, 1]))
        elif k == 2:
            joints.append(RevoluteJoint(3, 0, TOP, rim, TURN, TURN))
        else:
            joints.append(BallJoint(k + 1, 0, TOP, rim))
        links, poses = [*links, ROD], [*poses, spot]
    forces = [Damper(2, 0.4), Damper(3, 0.3)] if damped else []
    linkage = Linkage(links, joints, forces=forces)
    return linkage, linkage.assembled(np.array(poses), rng.normal(size=(m + 1, 6)))


def chained() -> tuple[Linkage, Any]:
    """Four rods between two points: joints at both ends hold the ground, the others rods alone."""
    links, poses = [BLOCK, ROD, ROD, LUMP], np.tile(np.eye(4), (4, 1, 1))
    poses[:, 0, 3] = 0.9 * np.arange(4)
    joints = [BallJoint(0, None, [-0.45, 0, 0], [-0.45, 0, 0])] + [
        BallJoint(k, k - 1, [-0.45, 0, 0.1], [0.45, 0, 0.1]) for k in (1, 2, 3)
    ]
    joints.append(BallJoint(3, None, [0.45, 0, 0.2], [3.15, 0, 0.2]))
    linkage = Linkage(links, joints)
    return linkage, linkage.assembled(poses, np.random.default_rng(5).normal(size=(4, 6)))


CASES: dict[str, Any] = {
    "wheel": lambda: wheel(5),
    "light wheel": lambda: wheel(5, 1e-3),
    "heavy wheel": lambda: wheel(5, 1e6),
    "damped wheel": lambda: wheel(5, damped=True),
    "star": star,
    "tree with loads": tree,
    "ladder": ladder,
    "ring": ring,
    "between two points": chained,
}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_hubs_change_nothing_but_the_way_of_elimination(case: str, monkeypatch: Any) -> None:
    """Every body of more than one joint as a hub, and none: Woodbury's identity."""
    ends = []
    for least in (2, 1000):
        monkeypatch.setattr(elimination_order, "HUB", least)
        linkage, start = CASES[case]()
        assert (linkage.linked.links.parts > 0) is (least == 2)
        for h in (0.005, -0.005):
            run = by_loops(linkage, lm.LieRATTLE(), start, False, h=h, steps=2)
            ends.append((run.g[-1], run.mu[-1]))
            c, off = linkage.conditions_at(run.mu[-1], run.g[-1])
            assert np.abs(c).max() < 4e-15
            assert np.abs(off).max() < 1e-12
    for one, other in zip(ends[:2], ends[2:]):
        assert np.abs(one[0] - other[0]).max() < 1e-13
        assert np.abs(one[1] - other[1]).max() < 1e-13 * np.abs(other[1]).max()


def test_accelerations_with_hubs_are_those_of_the_dense_matrix(monkeypatch: Any) -> None:
    linkage, start = wheel(7)
    assert linkage.linked.links.parts > 0
    run = by_loops(linkage, lm.RKMK(4), start, False, h=0.002, steps=1)
    monkeypatch.setattr(elimination_order, "HUB", 1000)
    linkage, start = wheel(7)
    other = by_loops(linkage, lm.RKMK(4), start, False, h=0.002, steps=1)
    assert np.abs(run.g[-1] - other.g[-1]).max() < 1e-13


@needs_compiler
@pytest.mark.slow
def test_native_hubs_have_the_bits_of_plain_ones() -> None:
    linkage, start = wheel(8)
    plain, native = (by_loops(linkage, lm.LieRATTLE(), start, compiled, h=0.005, steps=3) for compiled in (False, True))
    assert np.array_equal(plain.g, native.g)
    assert np.array_equal(plain.mu, native.mu)


def test_work_of_a_hub_grows_like_its_joints() -> None:
    """Blocks and products of them for each joint: the same with 20 and with 200."""
    cost = []
    for m in (20, 200):
        ends = [(0, -1)] + [(k + 1, 0) for k in range(m)]
        _, order, _, _ = tables_of(ends, hubs_in(ends), 2, m + 8)
        cost.append((len(order.updates) / m, (order.blocks - 3 * padded(m + 8)) / m))
    assert np.allclose(*cost, rtol=0.2)
    assert not hubs_in([(k, k - 1) for k in range(50)])  # a chain has none
    assert chain(9).linked.links.parts == 0


@pytest.mark.slow
def test_a_mimic_of_the_joint_that_holds_a_hub() -> None:
    """The joint to the ground has no block before the motion of the hub: its rotor drives another one."""
    n, errors = 8, []
    hinges = [RevoluteJoint(0, None, [0, 0, 0.1], [0, 0, 0], TURN, TURN, armature=0.3)]
    for k in range(n):
        rim = [0.3 * np.cos(k), 0.0, 0.3 * np.sin(k)]
        hinges.append(RevoluteJoint(k + 1, 0, [0, 0, 0.2], rim, TURN, TURN))
    links = [Link(1.0, [0.1, 0.12, 0.09])] * (n + 1)
    linkage = Linkage(links, hinges, mimics=[lm.joints.Mimic(2, 0, ratio=2.0)])
    angles = {k + 1: 0.2 * k for k in range(n) if k != 1}
    start = linkage.state(angles={0: 0.1, **angles}, rates={0: 1.0, 1: 0.5})
    for steps in (5, 10):
        run = lm.integrate(linkage, lm.LieRATTLE(), start, h=0.1 / steps, steps=steps, compiled=False)
        errors.append(abs(run.energy[-1] - run.energy[0]))
        turned = np.diff([run.joint(k).angle[[0, -1]] for k in (2, 0)])
        assert abs(turned[0, 0] - 2.0 * turned[1, 0]) < 1e-13
    assert errors[0] / errors[1] == pytest.approx(4.0, abs=0.2)
