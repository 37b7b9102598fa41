"""The body itself, in space: a box from its inertia, a top, or a mesh of the user's."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...errors import InvalidInput
from ...formulas.arrays import Array
from ...joints.rolling import Blade, Rolling
from ...models.bodies.heavy_top import HeavyTop, ReducedHeavyTop
from ...models.bodies.kirchhoff import KirchhoffBody
from ...models.even_boxes import box_of_inertia, inertia_of
from ...models.poses import attitude, configurations, flies, is_pose, place, rotated, toward
from ...models.space.space_bodies import OrbitingBody
from ...models.space.spacecraft import Spacecraft
from ...systems.system import System
from ..drawing import Drawing
from ..motion import Motion
from ..shapes import ThreeShape, ball, box, mesh_file, mixed, often, shares, turned
from ..thinning import Numbers, evenly
from .content import UNITS, Content, refuse
from .vectors import AXES, MOST_POINTS, axis_of, triad

STONE = "#d5dbe5"
ORBITS = OrbitingBody, Spacecraft
"""Bodies with a centre to go round."""
TRIAD = 0.75
"""Length of the axes of a top, whose nose is at 1."""
FLYING = 0.17
"""Size of a body beside the path on which it flies, which would often make it a point if it were drawn to scale."""


@dataclass(frozen=True)
class Body(Content):
    """The body at its attitude g and, where it flies, at its place: the box with its inertia, with its axes as a triad
    and a mark on the face from which the third one comes.

    mesh : a file (.stl, .obj, .dae) to show instead of the box.  size : of the mesh's unit of
    length, in units of the picture,
    whose content fits a ball of radius 1.  triad : the axes of the body, one to three in red, green
    and plum.  trail : the path of a body that flies, of a top that of its nose, where its axis meets the
    unit sphere.
    A top is a disc on a stick through its centre of mass, a body in a fluid an
    ellipsoid; what rolls is a ball on its plane and what glides a sleigh on its blade, both to
    scale.  Other bodies that fly are drawn larger than to scale.  Reaction wheels are discs on the
    faces, or corners, that their axes point at; a mark shows the spin.  The bodies of an ensemble
    are boxes, side by side unless they fly, at most 1000 of them, evenly chosen; their sides have
    the colours of the axes that come out of them.

    Source: Goldstein, Classical Mechanics, 3rd ed., section 5.7 (the nose).
    """

    panel = "space"

    mesh: str | PathLike[str] | None = None
    size: float = 1.0
    triad: bool = True
    trail: bool = True

    def __post_init__(self) -> None:
        if not 0.0 < self.size < np.inf:
            raise InvalidInput(f"Body: size must be positive and finite; got {self.size}")

    def needs(self, system: System) -> tuple[str, ...]:
        """The attitude, and the place with it."""
        if not is_pose(configurations(system)):
            raise refuse(self, system, "a body that turns in space")
        return ("g",)

    def own(self, system: System) -> bool:
        """Whether each run has its own panel: yes for bodies that stay where they are, which would overlap; no for
        those that fly.
        """
        return not flies(system)

    def reach(self, motion: Motion) -> Array:
        """The places to which the body comes, or where those of an ensemble stand."""
        if flies(motion.system):
            return _room(motion)
        if motion.bodies is None:
            return UNITS
        grid = _side_by_side(len(_shown(motion)))
        return np.concatenate([grid - 1.0, grid + 1.0])

    def legend(self, motion: Motion) -> list[dict[str, Any]]:
        return [] if motion.bodies is None else axes_legend()

    def draw(self, motion: Motion, drawing: Drawing) -> None:
        """A node with the attitude, and on it what the body is made of."""
        system = motion.system
        if motion.bodies is not None:
            return _ensemble(motion, drawing)
        top = isinstance(system, (HeavyTop, ReducedHeavyTop))
        where, size = np.zeros(3), 1.0 / drawing.panel.unit
        if flies(system):
            where, size = place(system, motion["g"]), _size(system, drawing.panel.unit)
        drawing.add("body", quaternion=attitude(system, motion["g"]), position=drawing.panel.inside(where), scale=size)
        color = mixed(STONE, drawing.color, 0.3)
        if self.mesh is not None:
            drawing.add("body/mesh", mesh_file(self.mesh, color), scale=self.size)
        elif top:
            _top(drawing, axis_of(system), color)
        elif isinstance(_constraint(system), Rolling):
            _octants(drawing, np.ones(3), color)
            drawing.panel.known["floor"] = float(drawing.panel.inside(where)[0, 2] - size)
        elif isinstance(_constraint(system), Blade):
            _sleigh(drawing, color)
            drawing.panel.known["floor"] = float(drawing.panel.inside(where)[0, 2])
        elif isinstance(system, KirchhoffBody):
            _octants(drawing, 0.5 * box_of_inertia(inertia_of(system)), color)
        else:
            edges = box_of_inertia(inertia_of(system))
            drawing.add("body/box", box(edges, color))
            face = box(edges * [0.72, 0.72, 0.0] + [0.0, 0.0, 0.02], mixed(color, drawing.color, 0.6))
            drawing.add("body/third face", face, position=[0.0, 0.0, 0.5 * edges[2]])
            if isinstance(system, Spacecraft) and system.wheels is not None:
                _wheels(drawing, np.array(system.wheels.axes), motion["g"][:, 12:], edges, color)
        if self.triad:
            symbol, length = "" if flies(system) else "e", TRIAD if top else 1.2
            triad(drawing, "body/axis", symbol, 0.014, length)
        if self.trail and flies(system):
            drawing.trail("path", drawing.panel.inside(where))
        elif self.trail and top:
            drawing.trail("nose", rotated(attitude(system, motion["g"]), axis_of(system)), least=0.0)
        if isinstance(system, ORBITS):
            centre = drawing.panel.inside(np.zeros(3))
            drawing.once("centre", ball(0.05, "#C87F00"), position=centre)

    def note(self, motion: Motion) -> str:
        """Bodies that fly would be points."""
        scaled = not flies(motion.system) or _constraint(motion.system) is not None
        return "" if scaled else "the path is to scale, the body is not"


# ------------------------------------------------------------------ pieces


def _room(motion: Motion) -> Array:
    """The path of a body, and what it orbits."""
    g = motion["g"]
    path = place(motion.system, g if motion.bodies is None else g.reshape(-1, *g.shape[2:]))
    return np.concatenate([path, np.zeros((1, 3))]) if isinstance(motion.system, ORBITS) else path


def _shown(motion: Motion) -> Numbers:
    """The numbers of the bodies of an ensemble that are drawn."""
    assert motion.bodies is not None
    return evenly(motion.bodies, MOST_POINTS)


def _side_by_side(count: int) -> Array:
    """Places of bodies in rows, upright, (count, 3)."""
    columns = int(np.ceil(np.sqrt(count)))
    row, column = np.divmod(np.arange(count), columns)
    return 2.0 * np.column_stack([0 * row, column, -row])


def _ensemble(motion: Motion, drawing: Drawing) -> None:
    """A box for each body of an ensemble, as one object of the page."""
    g, system, panel = motion["g"][:, _shown(motion)], motion.system, drawing.panel
    count, each = g.shape[1], g.reshape(-1, *g.shape[2:])
    where, size = panel.inside(_side_by_side(count)), 1.0 / panel.unit
    if flies(system):
        where = panel.inside(place(system, each)).reshape(-1, count, 3)
        size = _size(system, panel.unit)
    edges, turns = size * box_of_inertia(inertia_of(system)), attitude(system, each)
    drawing.add("bodies", boxes(count, [edges]), cloud=where, turns=turns.reshape(-1, count, 4))


def axes_legend() -> list[dict[str, Any]]:
    """The colours of a body's axes."""
    return [{"name": f"axis {k}", "color": color} for k, color in enumerate(AXES, start=1)]


def boxes(count: int, edges: ArrayLike, **known: Any) -> ThreeShape:
    """Boxes whose sides have the colours of the axes that come out of them, as one object."""
    sides = shares([*AXES, STONE])
    return often(box(np.ones(3), "#ffffff"), count, edges, sides=sides, **known)


def _constraint(system: Any) -> Any:
    return getattr(system, "constraint", None)


def _size(system: Any, unit: float) -> float:
    """The size in which a body that flies is drawn: a ball that rolls and the way from a blade to the centre of mass to
    scale, if that is to be seen.
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
    disc = turned([(0.0, 0.0), (radius, 0.0), (radius, thick), (0.0, thick)], mixed(color, "#000000", 0.25), 32)
    sizes = np.array([0.25 * radius, 0.9 * radius, 0.3 * thick])
    for k, a in enumerate(axes):
        path, half = f"body/wheel {k + 1}", 0.5 * angles[:, [k]]
        face = 0.5 * (edges / np.maximum(np.abs(a), 1e-12)).min()
        drawing.add(path, position=face * a, direction=a)
        turn = np.concatenate([0.0 * half, 0.0 * half, np.sin(half), np.cos(half)], axis=1)
        drawing.add(f"{path}/disc", disc, quaternion=turn)
        mark = box(sizes, mixed(color, "#000000", 0.75))
        drawing.add(f"{path}/disc/mark", mark, position=[0.0, 0.5 * radius, 1.05 * thick])


def _sleigh(drawing: Drawing, color: str) -> None:
    """A deck on a blade, which is one unit behind the centre of mass, and a ball in that."""
    deck = box(np.array([2.4, 1.1, 0.16]), color)
    drawing.add("body/deck", deck, position=[-0.35, 0.0, 0.45])
    drawing.add("body/blade", box(np.array([0.9, 0.05, 0.4]), "#333333"), position=[-1.0, 0.0, 0.2])
    drawing.add("body/centre", ball(0.16, "#333333"), position=[0.0, 0.0, 0.55])


def _top(drawing: Drawing, axis: Array, color: str) -> None:
    """A disc on a stick, from the fixed point through the centre of mass, with a mark that shows the spin."""
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
        "body/top/mark", box(np.array([0.07, 0.34, 0.03]), mixed(color, "#000000", 0.5)), position=[0.0, 0.3, 0.635]
    )
    drawing.once("fixed point", ball(0.03, "#333333"), position=drawing.panel.inside(np.zeros(3)))
