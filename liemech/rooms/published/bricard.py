"""Bricard's mechanism, six hinges along edges of a cube, falls for a second: one freedom where counting finds none."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ...groups.rigid.so3 import SO3
from ...integrators.composition import Composition
from ...joints import Link, Linkage, RevoluteJoint
from ...simulation.integrate import integrate
from ..constraints.lie_rattle import LieRATTLE
from .compared import Compared

SOURCE = (
    "IFToMM library of computational benchmark problems, A04; its motion by Exudyn (bricardMechanism.py, h = 1e-3 s, test "
    "suite of version 1.9.0: 4.172189649307425, of which 2 are a freedom and a redundant condition)"
)
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, -1, 0], [1, -1, 1], [0, -1, 1], [0, 0, 1]], dtype=float)
TURNS = [0, 0, 0], [0, 0, -np.pi / 2], [0, -np.pi / 2, 0], [0, 0, np.pi], [0, 0, np.pi / 2]
UPRIGHT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # their y is upwards


def bricard() -> tuple[Linkage, np.ndarray]:
    """Five square bars of 1 m and 1 kg, their e1 along the edges, with the poses at which they start."""
    bar = Link(1.0, [0.02 / 12, 1.01 / 12, 1.01 / 12])
    X, Y, Z = np.eye(3)
    attitudes: Any = [UPRIGHT @ np.array(SO3().exp(turn)) for turn in TURNS]
    points, middles = CORNERS @ UPRIGHT.T, 0.5 * (CORNERS[1:] + CORNERS[:-1]) @ UPRIGHT.T
    poses = np.tile(np.eye(4), (5, 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = attitudes, middles
    joints: Any = []
    for k, axis in enumerate([Y, Z, X, Y, Z, X]):
        first, second = (k, k - 1 if k else None) if k < 5 else (4, None)
        ends = [-0.5 * X if k < 5 else 0.5 * X, points[k] if second is None else 0.5 * X]
        in_space = UPRIGHT @ axis
        axes = [in_space if body is None else attitudes[body].T @ in_space for body in (first, second)]
        joints.append(RevoluteJoint(first, second, *ends, *axes, name=f"hinge {k + 1}"))
    bars: Any = [bar] * 5
    return Linkage(bars, joints, 9.81).independent(poses), poses


def compared(full: bool) -> Iterator[Compared]:
    """The length of all displacements of the bars' first ends and of their Euler parameters; to what their step allows."""
    linkage, poses = bricard()
    method = Composition(LieRATTLE(), order=4)
    run: Any = integrate(linkage, method, linkage.assembled(poses), h=0.01, t_end=1.0, progress=False)
    square = 0.0
    for begin, end in zip(poses, linkage.poses(run.g[-1])):
        ends = [pose @ [-0.5, 0.0, 0.0, 1.0] for pose in (begin, end)]
        turn = begin[:3, :3].T @ end[:3, :3]
        cosine = 0.5 * np.sqrt(1.0 + np.trace(turn))  # of half the angle
        square += ((ends[1] - ends[0]) ** 2).sum() + 2.0 - 2.0 * cosine
    yield Compared("length of the displacement", 2.172189649307425, float(np.sqrt(square)), 1e-4)
