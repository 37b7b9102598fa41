"""The bodies of a linkage, to scale, with their joints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...errors import FileWarning, InvalidInput, warn
from ...formulas.arrays import Array
from ...joints.joints import RigidRod, Strut
from ...joints.link import LinkShape
from ...joints.linkage import Linkage
from ...models.even_boxes import principal_box
from ...models.poses import quaternions
from ...plots.path import GROUND, ends_of_joints, placed, with_ground
from ...systems.system import System
from ..drawing import Drawing
from ..motion import Motion
from ..shapes import ball, box, mesh_file, mixed, often, turned
from .body import STONE
from .content import Content, refuse

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
    to_scale = True

    trail: int | None = -1

    def needs(self, system: System) -> tuple[str, ...]:
        """The parts of the state drawn, the poses; InvalidInput for what is no Linkage."""
        if not isinstance(system, Linkage):
            raise refuse(self, system, "bodies that joints hold together, a Linkage,")
        count = len(system.links)
        if self.trail is not None and not -count <= self.trail < count:
            raise InvalidInput(
                f"Links: trail = {self.trail} is not there; the linkage has {count} bodies, numbered from 0"
            )
        return ("g",)

    def reach(self, motion: Motion) -> Array:
        """The paths of joints, shapes and centres of mass, (points, 3)."""
        system, poses = _read(motion)
        corners = [
            (
                GROUND if solid.body is None else solid.body,
                (np.array(solid.pose) @ [*(half * np.array(solid.size)), 1.0])[:3],
            )
            for solid in system.shapes
            for half in (-0.5, 0.5)
        ]
        paths = [placed(poses, ends_of_joints(system) + corners), poses[:, :-1, :3, 3]]
        return np.concatenate(paths, axis=1).reshape(-1, 3)

    def draw(self, motion: Motion, drawing: Drawing) -> None:
        """A node for each body and the ground, which carries its box or its shapes, and the joints on
        arms from the centres of mass.
        """
        system, poses = _read(motion)
        inside, unit, ends = drawing.panel.inside, drawing.panel.unit, ends_of_joints(system)
        color, joints = mixed(STONE, drawing.color, 0.3), placed(poses, ends)
        names = [*(f"link {k + 1}" for k in range(len(system.links))), "ground"]
        for k, name in enumerate(names):
            turns = quaternions(poses[:, k, :3, :3])
            drawing.add(name, quaternion=turns, position=inside(poses[:, k, :3, 3]))
        for n, part in enumerate(system.shapes):
            pose, node = (np.array(part.pose), f"{names[GROUND if part.body is None else part.body]}/shape {n + 1}")
            turn = quaternions(pose[None, :3, :3])[0]
            drawing.add(node, quaternion=turn, position=pose[:3, 3] / unit)
            try:
                _shape(drawing, node, part, np.array(part.size) / unit, color)
            except InvalidInput as refused:  # of one file: the others are shown
                warn(f"Links: {refused}; it is not shown", FileWarning)
        for name, link in zip(names, () if system.shapes else system.links):
            axes, edges = principal_box(link)
            solid = box(np.maximum(edges / unit, THIN), color)
            drawing.add(f"{name}/box", solid, quaternion=quaternions(axes[None])[0])
        if not system.shapes:
            colors = ["#333333" if body == GROUND else drawing.color for body, _ in ends]
            sizes = [[2.0 * THIN if body == GROUND else 1.6 * THIN] for body, _ in ends]
            drawing.balls("joints", inside(joints), sizes, colors)
            carried = [k for k, (body, _) in enumerate(ends) if body != GROUND]
            centres = poses[:, [ends[k][0] for k in carried]][..., :3, 3]
            arms = np.stack([centres, joints[:, carried]], axis=2)
            drawing.sticks("arms", inside(arms), 0.6 * THIN, color)
        rods = [k for k, part in enumerate(system.joints) if isinstance(part, (RigidRod, Strut))]
        if rods:
            both = joints.reshape(len(poses), -1, 2, 3)[:, rods]
            drawing.sticks("rods", inside(both), THIN, mixed(color, "#000000", 0.45))
        if self.trail is not None:
            drawing.trail("trail", inside(system.poses(motion["g"])[:, self.trail, :3, 3]))


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
    """The linkage, and the poses of its bodies and of the ground, (n, bodies + 1, 4, 4)."""
    system = motion.system
    if motion.bodies is not None:
        raise InvalidInput("Links shows one linkage; choose one of the ensemble, as in Scene(run, body=0)")
    assert isinstance(system, Linkage)
    return system, with_ground(system, motion["g"])
