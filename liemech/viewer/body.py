"""The body itself, in space: a box from its inertia, a top, or a mesh of the user's."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..errors import InvalidInput
from ..models.even_boxes import box_of_inertia, inertia_of
from ..models.heavy_top import HeavyTop, ReducedHeavyTop
from ..models.kirchhoff import KirchhoffBody
from ..models.poses import attitude, configurations, flies, is_pose, place, toward
from ..models.rolling import Blade, Rolling
from ..models.space_bodies import OrbitingBody
from ..models.spacecraft import Spacecraft
from ..systems.system import System
from .content import Content, refuse
from .drawing import Drawing
from .motion import Motion
from .shapes import ball, box, box_edges, mesh_file, mixed, often, rod, segments, shares, turned
from .vectors import AXES, axis_of

Array = NDArray[np.float64]

STONE = "#d5dbe5"
TRIAD = 0.75
"""Length of the axes of a top, whose nose is at 1."""
FLYING = 0.17
"""Size of a body beside the path on which it flies, which would often make it a point if it were
drawn to scale.
"""


@dataclass(frozen=True)
class Body(Content):
    """The body at its attitude g and, where it flies, at its place: the box with its inertia, with
    its axes as a triad.

    mesh : a file (.stl, .obj, .dae) to show instead of the box.  size : of the mesh's unit of
    length, in units of the picture,
    whose content fits a ball of radius 1.  triad : the axes of the body, one to three in red, green
    and plum.  A top is a disc on a stick through its centre of mass, a body in a fluid an
    ellipsoid; what rolls is a ball on its plane and what glides a sleigh on its blade, both to
    scale.  Other bodies that fly are drawn larger than to scale.  Reaction wheels are discs on the
    faces, or corners, that their axes point at; a mark shows the spin.
    """

    panel: ClassVar[str] = "space"

    mesh: str | PathLike[str] | None = None
    size: float = 1.0
    triad: bool = True

    def __post_init__(self) -> None:
        if not 0.0 < self.size < np.inf:
            raise InvalidInput(f"Body: size must be positive and finite; got {self.size}")

    def needs(self, system: System) -> tuple[str, ...]:
        """The attitude, and the place with it."""
        if not is_pose(configurations(system)):
            raise refuse(self, system, "a body that turns in space")
        return ("g",)

    def own(self, system: System) -> bool:
        """Yes, unless it flies: bodies that stay where they are would stand in each other's way."""
        return not flies(system)

    def reach(self, motion: Motion) -> Array | None:
        """The places to which the body comes."""
        return _room(motion) if flies(motion.system) else None

    def draw(self, motion: Motion, drawing: Drawing) -> None:
        """A node with the attitude, and on it what the body is made of."""
        system = motion.system
        if motion.bodies is not None:
            raise InvalidInput(
                "Body shows one body; choose one of the ensemble, as in Scene(run, body=0)"
            )
        top = isinstance(system, (HeavyTop, ReducedHeavyTop))
        where, size = np.zeros(3), 1.0 / drawing.panel.unit
        if flies(system):
            where, size = place(system, motion["g"]), _size(system, drawing.panel.unit)
        drawing.add(
            "body",
            quaternion=attitude(system, motion["g"]),
            position=drawing.panel.inside(where),
            scale=size,
        )
        color = mixed(STONE, drawing.color, 0.18)
        if self.mesh is not None:
            drawing.add("body/mesh", mesh_file(self.mesh, color), scale=self.size)
        elif top:
            _top(drawing, axis_of(system), color)
        elif isinstance(_constraint(system), Rolling):
            _octants(drawing, np.ones(3), color)
            _ground(drawing, motion, -_constraint(system).radius)
        elif isinstance(_constraint(system), Blade):
            _sleigh(drawing, color)
            _ground(drawing, motion, 0.0)
        elif isinstance(system, KirchhoffBody):
            _octants(drawing, 0.5 * box_of_inertia(inertia_of(system)), color)
        else:
            edges = box_of_inertia(inertia_of(system))
            edged_box(drawing, "body", edges, color)
            if isinstance(system, Spacecraft) and system.wheels is not None:
                _wheels(drawing, np.array(system.wheels.axes), motion["g"][:, 12:], edges, color)
        if self.triad:
            for k, axis in enumerate(AXES):
                drawing.add(
                    f"body/axis {k + 1}",
                    rod(axis, 0.014),
                    "" if flies(system) else "e" + "\u2081\u2082\u2083"[k],
                    direction=np.eye(3)[k],
                    scale=TRIAD if top else 1.2,
                )

    def note(self, motion: Motion) -> str:
        """Bodies that fly would be points."""
        scaled = not flies(motion.system) or _constraint(motion.system) is not None
        return "" if scaled else "the path is to scale, the body is not"


@dataclass(frozen=True)
class Path(Content):
    """The path of a body that flies: the curve of its centre of mass, or of a point on a group of
    translations.
    """

    def needs(self, system: System) -> tuple[str, ...]:
        """The place, which is part of g."""
        if not flies(system):
            raise refuse(self, system, "the path of a body that flies")
        return ("g",)

    def reach(self, motion: Motion) -> Array:
        """The path."""
        return _room(motion)

    def draw(self, motion: Motion, drawing: Drawing) -> None:
        """The trail."""
        drawing.trail("path", drawing.panel.inside(place(motion.system, motion["g"])))
        if isinstance(motion.system, (OrbitingBody, Spacecraft)):
            drawing.once(
                "centre", ball(0.05, "#C87F00"), position=drawing.panel.inside(np.zeros(3))
            )


# ------------------------------------------------------------------ pieces


def _room(motion: Motion) -> Array:
    """The path of a body, and what it orbits."""
    path = place(motion.system, motion["g"])
    orbits = isinstance(motion.system, (OrbitingBody, Spacecraft))
    return np.concatenate([path, np.zeros((1, 3))]) if orbits else path


def _constraint(system: Any) -> Any:
    return getattr(system, "constraint", None)


def _size(system: Any, unit: float) -> float:
    """How large a body that flies is drawn: a ball that rolls and the way from a blade to the
    centre of mass to scale, if that is to be seen.
    """
    constraint = _constraint(system)
    if isinstance(constraint, Rolling):
        return float(constraint.radius / unit)
    if isinstance(constraint, Blade):
        return max(abs(constraint.behind) / unit, 0.5 * FLYING)
    return FLYING


def _octants(drawing: Drawing, half: Array, color: str) -> None:
    """A ball or an ellipsoid with these half axes, in two colours, which show how it turns."""
    shape = often(ball(1.0, "#ffffff"), 1, [half], sides=shares((color, drawing.color)))
    drawing.add("body/ellipsoid", shape, cloud=np.zeros((1, 3)))


def _wheels(drawing: Drawing, axes: Array, angles: Array, edges: Array, color: str) -> None:
    """A disc on the box for each wheel, with a mark that shows its angle.

    axes : (n, 3), unit vectors.  angles : (frames, n), in rad.  edges : of the box, (3,).
    """
    radius, thick = 0.3 * float(edges.min()), 0.1 * float(edges.min())
    profile = [(0.0, 0.0), (radius, 0.0), (radius, thick), (0.0, thick)]
    for k, a in enumerate(axes):
        x, y, z, w = toward(a)
        s, c = np.sin(0.5 * angles[:, k]), np.cos(0.5 * angles[:, k])
        # toward(a), and before it the turn about the third axis
        q = np.stack([c * x + s * y, c * y - s * x, c * z + s * w, c * w - s * z], axis=-1)
        face = 0.5 * (edges / np.maximum(np.abs(a), 1e-12)).min()
        path = f"body/wheel {k + 1}"
        drawing.add(
            path,
            turned(profile, mixed(color, "#000000", 0.25), 32),
            position=face * a,
            quaternion=q,
        )
        mark = box(
            np.array([0.25 * radius, 0.9 * radius, 0.3 * thick]), mixed(color, "#000000", 0.75)
        )
        drawing.add(f"{path}/mark", mark, position=[0.0, 0.5 * radius, 1.05 * thick])


def edged_box(drawing: Drawing, path: str, edges: Array, color: str) -> None:
    """A box whose edges are seen."""
    drawing.add(f"{path}/box", box(edges, color))
    drawing.add(f"{path}/edges", box_edges(edges * 1.001, mixed(color, "#000000", 0.45)))


def _sleigh(drawing: Drawing, color: str) -> None:
    """A deck on a blade, which is one unit behind the centre of mass, and a ball in that."""
    drawing.add("body/deck", position=[-0.35, 0.0, 0.45])
    edged_box(drawing, "body/deck", np.array([2.4, 1.1, 0.16]), color)
    drawing.add("body/blade", box(np.array([0.9, 0.05, 0.4]), "#333333"), position=[-1.0, 0.0, 0.2])
    drawing.add("body/centre", ball(0.16, "#333333"), position=[0.0, 0.0, 0.55])


def _ground(drawing: Drawing, motion: Motion, below: float) -> None:
    """The plane on which a body moves, a grid with squares of 1, 2 or 5 times a power of ten."""
    path = place(motion.system, motion["g"])
    low, high = path[:, :2].min(axis=0), path[:, :2].max(axis=0)
    least = 0.1 * float((high - low).max() or 1.0)
    decade, z = 10.0 ** np.floor(np.log10(least)), path[0, 2] + below
    square = decade * next(n for n in (1.0, 2.0, 5.0, 10.0) if n * decade >= least)
    x, y = (
        square * np.arange(first - 1.0, last + 1.5)
        for first, last in zip(np.floor(low / square), np.ceil(high / square), strict=True)
    )
    lines = [[(x[0], b, z), (x[-1], b, z)] for b in y] + [[(a, y[0], z), (a, y[-1], z)] for a in x]
    drawing.once("ground", segments(drawing.panel.inside(lines), "#9aa3b0"))


def _top(drawing: Drawing, axis: Array, color: str) -> None:
    """A disc on a stick, from the fixed point through the centre of mass, with a mark that shows
    the spin.
    """
    profile = [
        (0.0, 0.0),
        (0.02, 0.06),
        (0.02, 0.42),
        (0.50, 0.52),
        (0.50, 0.60),
        (0.03, 0.66),
        (0.03, 0.97),
        (0.0, 1.0),
    ]
    drawing.add("body/top", turned(profile, color, 32), quaternion=toward(axis))
    drawing.add(
        "body/top/mark",
        box(np.array([0.07, 0.34, 0.03]), mixed(color, "#000000", 0.5)),
        position=[0.0, 0.3, 0.635],
    )
    drawing.once("fixed point", ball(0.03, "#333333"), position=drawing.panel.inside(np.zeros(3)))
