"""The bodies of a linkage, to scale, with their joints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import InvalidInput
from ..models.even_boxes import principal_box
from ..models.joints import RigidRod
from ..models.link import LinkShape
from ..models.linkage import Linkage
from ..models.poses import quaternions
from ..systems.system import System
from .body import STONE
from .content import Content, refuse
from .drawing import Drawing
from .motion import Motion
from .shapes import ball, box, mesh_file, mixed, often, turned

Array = NDArray[np.float64]

THIN = 0.03
"""The least thickness of a link, in units of the picture: thinner ones are drawn that thick."""


@dataclass(frozen=True)
class Links(Content):
    """The bodies of a linkage: each the box with its inertia and mass, to scale, a ball in each
    joint, dark ones on the ground; a linkage with shapes, as from a URDF file, shows these.

    trail : the body whose centre of mass draws its path, counted from 0, or from -1 backwards; None
    draws none.
    """

    panel = "links"
    title = "in space"

    trail: int | None = -1

    def needs(self, system: System) -> tuple[str, ...]:
        """The poses."""
        if not isinstance(system, Linkage):
            raise refuse(self, system, "bodies that joints hold together, a Linkage,")
        count = len(system.links)
        if self.trail is not None and not -count <= self.trail < count:
            raise InvalidInput(
                f"Links: trail = {self.trail} is not there; the "
                f"linkage has {count} bodies, numbered from 0"
            )
        return ("g",)

    def reach(self, motion: Motion) -> Array:
        """Where the joints and the centres of mass come."""
        system, poses = _read(motion)
        seen = [
            (one.body, (np.array(one.pose) @ [*(half * np.array(one.size)), 1.0])[:3])
            for one in system.shapes
            for half in (-0.5, 0.5)
        ]
        joints = [_placed(poses, number, at) for number, at in _points(system) + seen]
        return np.concatenate([*joints, poses[:, :, :3, 3].reshape(-1, 3)])

    def draw(self, motion: Motion, drawing: Drawing) -> None:
        """A node for each body, which carries its box, and the joints on arms from its centre of
        mass.
        """
        system, poses = _read(motion)
        unit, color = drawing.panel.unit, mixed(STONE, drawing.color, 0.18)
        drawing.add("ground", position=drawing.panel.inside(np.zeros(3)))
        for k, link in enumerate(system.links):
            place = drawing.panel.inside(poses[:, k, :3, 3])
            drawing.add(
                f"link {k + 1}", quaternion=quaternions(poses[:, k, :3, :3]), position=place
            )
            axes, edges = principal_box(link)
            if not system.shapes:
                solid = box(np.maximum(edges / unit, THIN), color)
                turn = quaternions(axes[None])[0]
                drawing.add(f"link {k + 1}/box", solid, quaternion=turn)
        for n, one in enumerate(system.shapes):
            node = f"link {one.body + 1}" if one.body is not None else "ground"
            pose, node = np.array(one.pose), f"{node}/shape {n + 1}"
            drawing.add(
                node, quaternion=quaternions(pose[None, :3, :3])[0], position=pose[:3, 3] / unit
            )
            _shape(drawing, node, one, np.array(one.size) / unit, color)
        inside, dark, held = drawing.panel.inside, mixed(color, "#000000", 0.45), _points(system)
        joints = np.stack([_placed(poses, number, at) for number, at in held], axis=1)
        if not system.shapes:
            colors = ["#333333" if number is None else drawing.color for number, _ in held]
            sizes = [[2.0 * THIN if number is None else 1.6 * THIN] for number, _ in held]
            drawing.balls("joints", inside(joints), sizes, colors)
            arms = [
                np.stack([poses[:, number, :3, 3], joints[:, k]], axis=1)
                for k, (number, _) in enumerate(held)
                if number is not None
            ]
            drawing.sticks("arms", inside(np.stack(arms, axis=1)), 0.6 * THIN, color)
        rods = [k for k, one in enumerate(system.joints) if isinstance(one, RigidRod)]
        if rods:
            ends = np.stack([joints[:, 2 * np.array(rods)], joints[:, 2 * np.array(rods) + 1]], 2)
            drawing.sticks("rods", inside(ends), THIN, dark)
        if self.trail is not None:
            drawing.trail("trail", drawing.panel.inside(poses[:, self.trail, :3, 3]))


def _shape(drawing: Drawing, node: str, one: LinkShape, size: Array, color: str) -> None:
    """A shape of a link, of this size in units of the picture."""
    color = one.color or color
    if one.kind == "box":
        drawing.add(f"{node}/box", box(size, color))
        return
    shape = mesh_file(one.file, color) if one.file else ball(0.5, color)
    if one.kind == "cylinder":
        shape = turned([(0.0, -0.5), (0.5, -0.5), (0.5, 0.5), (0.0, 0.5)], color, 32)
    drawing.add(f"{node}/{one.kind}", often(shape, 1, [size]), cloud=np.zeros((1, 3)))


def _read(motion: Motion) -> tuple[Linkage, Array]:
    system = motion.system
    if motion.bodies is not None:
        raise InvalidInput(
            "Links shows one linkage; choose one of the ensemble, as in Scene(run, body=0)"
        )
    assert isinstance(system, Linkage)
    return system, system.poses(motion["g"])


def _points(system: Linkage) -> list[tuple[int | None, Array]]:
    """Where the joints are: numbers of bodies, None for the ground, and points in their axes."""
    return [
        (number, np.array(at, dtype=float))
        for joint in system.joints
        for number, at in ((joint.first, joint.at_first), (joint.second, joint.at_second))
    ]


def _placed(poses: Array, number: int | None, at: object) -> Array:
    """A point of a body, or of the ground, in space, (n, 3)."""
    point = np.array(at, dtype=float)
    if number is None:
        return np.broadcast_to(point, (len(poses), 3))
    return poses[:, number, :3, :3] @ point + poses[:, number, :3, 3]
