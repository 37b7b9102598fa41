"""The drawing of a scene: nodes of a tree, where they are, and the tracks along which they move."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..formulas.arrays import Array
from ..models.curves import is_smooth
from ..models.poses import rotation, toward
from .shapes import ThreeShape, ball, colored, often, plain, stick

STILL = 2.0**-20
"""A channel whose values differ by less than this, in units of the panel, stands still on every
screen: it is sent once.
"""


@dataclass
class Node:
    """A place in the tree: what stands there, how it is placed, and the channels that move.

    Channels: `position` (3), `quaternion` (4), `direction` (3), towards which the third axis
    points, `scale` (1), `reveal`, the segments of a trail that are behind the moving point, and of
    what is there many times its places `cloud` (m, 3), and arrows `vectors` (m, 3) or attitudes
    `turns` (m, 4), of the points of a surface their colours `tones` (m,), from -1 to 1.  A `label`
    stands at the end of an arrow or a rod.  least : to which share a trail tapers.
    """

    path: str
    shape: ThreeShape | None = None
    still: dict[str, Array] = field(default_factory=dict)
    moving: dict[str, Array] = field(default_factory=dict)
    clock: int = 0
    label: str = ""
    least: float = 0.0


@dataclass
class Canvas:
    """One of the pictures side by side: what it is called, and which ball (centre and radius) of
    its own space it shows.

    known : what the page should know to place it: the numbers of its "runs", whether it is one of the "main" pictures and
    has a "floor", or at which height, and in its "ruler" the length of the motion that is one unit of the panel, or 0.
    tips : of a motion of one sample the points at which trails are, and their colours.
    """

    path: str
    title: str
    centre: Array
    unit: float
    known: dict[str, Any] = field(default_factory=dict)
    nodes: dict[str, Node] = field(default_factory=dict)
    tips: dict[str, tuple[Array, str]] = field(default_factory=dict)

    def inside(self, points: ArrayLike) -> Array:
        """Points in units of the panel."""
        return (np.asarray(points, dtype=float) - self.centre) / self.unit


@dataclass(frozen=True)
class Drawing:
    """A panel, and the pen with which one run is drawn into it.

    name : of the nodes of the run.  color : of the run.  clock : the number of its times.
    """

    panel: Canvas
    name: str
    color: str
    clock: int

    def add(self, path: str, shape: ThreeShape | None = None, label: str = "", **channels: ArrayLike) -> Node:
        """Put a shape, or an empty node for others to hang on, at a path below the run.

        Channels with one row for each time move; those whose rows do not differ are taken as one.
        """
        node = Node(f"{self.panel.path}/{self.name}/{path}", shape, clock=self.clock, label=label)
        self.panel.nodes[node.path] = node
        for channel, values in channels.items():
            rows = np.asarray(values, dtype=float)
            if rows.ndim == RANK[channel]:
                node.still[channel] = rows
            elif len(rows) == 1 or (np.ptp(rows, axis=0) <= STILL).all():
                node.still[channel] = rows[0]
            else:
                node.moving[channel] = rows
        return node

    @property
    def shared(self) -> Drawing:
        """The pen for what all runs in the panel share."""
        return replace(self, name=SHARED)

    def once(self, path: str, shape: ThreeShape, label: str = "", **channels: ArrayLike) -> None:
        """Put a shape that all runs in the panel share."""
        self.shared.add(path, shape, label, **channels)

    def balls(self, path: str, places: Array, sizes: ArrayLike, colors: str | Sequence[str], **known: Any) -> Node:
        """Balls at places (n, m, 3) or (m, 3), as one object.  sizes : diameters, (1, 1) or (m, 1).
        colors : one, or m of them.
        """
        count = places.shape[-2]
        shape = often(ball(0.5, "#ffffff", rows=12 if count < 200 else 6), count, sizes, **known)
        return self.add(path, colored(shape, colors), cloud=places)

    def sticks(self, path: str, ends: Array, thick: float, colors: str | Sequence[str], sides: int = 8) -> Node:
        """Round sticks between pairs of points, (n, m, 2, 3) or (m, 2, 3), as one object.  thick : their
        diameter.  colors : one, or m of them.
        """
        vectors, count = ends[..., 1, :] - ends[..., 0, :], ends.shape[-3]
        length = np.linalg.norm(vectors.reshape(-1, count, 3)[0], axis=-1)
        wide = thick / np.where(length > 0.0, length, 1.0)
        sizes = np.column_stack([wide, wide, np.ones_like(wide)])
        shape = colored(
            often(stick(0.5 * thick / (length.max() or 1.0), sides), count, sizes, room=[0.5 * thick]), colors
        )
        return self.add(path, shape, cloud=ends[..., 0, :], vectors=vectors)

    def curve(self, path: str, points: Array, color: str, thick: float = 0.018) -> Node:
        """A curve (n, 3), or its points if it would be invented: lines are one pixel wide in WebGL."""
        if is_smooth(points):
            node = self.sticks(path, neighbours(points), thick, color, 6)
        else:
            node = self.balls(path, points, [[0.03]], color)
        assert node.shape is not None
        node.shape = replace(node.shape, material=plain(color))
        return node

    def trail(self, path: str, points: Array, color: str | None = None, least: float = 0.3) -> None:
        """The curve behind a moving point, (n, 3): it grows with the time, and tapers to this share of its
        thickness and colour.
        """
        color = color or self.color
        if len(points) > 1:
            node = self.curve(path, points, color, 0.024)
            node.moving["reveal"], node.least = np.arange(len(points), dtype=float), least
        else:
            self.panel.tips[f"{self.panel.path}/{self.name}/{path}"] = points[-1], color


def neighbours(points: Array) -> Array:
    """The pairs of points that follow each other, (..., m - 1, 2, 3)."""
    return np.stack([points[..., :-1, :], points[..., 1:, :]], axis=-2)


SHARED = "shared"
"""What nodes are called that belong to no run."""

PLACED = {"position": 1, "quaternion": 1, "direction": 1, "scale": 0}
"""The channels that a transform holds, and how many axes they have at one time."""

MANY = {"cloud": 2, "vectors": 2, "turns": 2, "tones": 1}
"""Those of what is there many times."""

RANK = PLACED | MANY


def transform(still: dict[str, Array]) -> list[float]:
    """The 4x4 matrix, column by column, of the channels that stand still."""
    matrix = np.eye(4)
    q = still.get("quaternion", np.array([0.0, 0.0, 0.0, 1.0]))
    if "direction" in still:
        q = toward(still["direction"])
    matrix[:3, :3] = float(still.get("scale", 1.0)) * rotation(q)
    matrix[:3, 3] = still.get("position", 0.0)
    return matrix.T.ravel().tolist()


def commands(panels: list[Canvas]) -> list[dict[str, Any]]:
    """The scene as it stands at the start, in the commands of meshcat: every object once, every
    transform that stands still once; the tracks move the others.
    """
    orders: list[dict[str, Any]] = []
    for panel in panels:
        for node in panel.nodes.values():
            if node.shape is not None:
                orders.append({"type": "set_object", "path": node.path, "object": node.shape.three(node.path)})
            if PLACED.keys() & node.still.keys():
                matrix = transform(node.still)
                orders.append({"type": "set_transform", "path": node.path, "matrix": matrix})
    return orders
