"""The drawing of a scene: nodes of a tree, where they are, and the tracks along which they move."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..models.curves import is_smooth
from ..models.poses import rotation, toward
from .shapes import Shape, dots, tube

Array = NDArray[np.float64]

STILL = 2.0**-20
"""A channel whose values differ by less than this, in units of the panel, stands still on every
screen: it is sent once.
"""


@dataclass
class Node:
    """A place in the tree: what stands there, how it is placed, and the channels that move.

    Channels: `position` (3), `quaternion` (4), `direction` (3), towards which the third axis
    points, `scale` (1), `reveal`, the segments of a trail that are behind the moving point, and of
    what is there many times its places `cloud` (m, 3), of dots too, and arrows `vectors` (m, 3) or
    attitudes `turns` (m, 4).  A `label` stands at the end of an arrow or a rod.
    """

    path: str
    shape: Shape | None = None
    still: dict[str, Array] = field(default_factory=dict)
    moving: dict[str, Array] = field(default_factory=dict)
    clock: int = 0
    label: str = ""
    fading: bool = False


@dataclass
class Panel:
    """One of the pictures side by side: what it is called, and which ball (centre and radius) of
    its own space it shows.
    """

    path: str
    title: str
    centre: Array
    unit: float
    nodes: dict[str, Node] = field(default_factory=dict)

    def inside(self, points: ArrayLike) -> Array:
        """Points in units of the panel."""
        return (np.asarray(points, dtype=float) - self.centre) / self.unit


@dataclass(frozen=True)
class Drawing:
    """A panel, and the pen with which one run is drawn into it.

    name : of the nodes of the run.  color : of the run.  clock : the number of its times.
    """

    panel: Panel
    name: str
    color: str
    clock: int

    def add(
        self, path: str, shape: Shape | None = None, label: str = "", **channels: ArrayLike
    ) -> None:
        """Put a shape, or an empty node for others to hang on, at a path below the run.

        Channels with one row for each time move; those whose rows do not differ are taken as one.
        """
        node = Node(f"{self.panel.path}/{self.name}/{path}", shape, clock=self.clock, label=label)
        for channel, values in channels.items():
            rows = np.asarray(values, dtype=float)
            if rows.ndim == RANK[channel]:
                node.still[channel] = rows
            elif len(rows) == 1 or (np.ptp(rows, axis=0) <= STILL).all():
                node.still[channel] = rows[0]
            else:
                node.moving[channel] = rows
        self.panel.nodes[node.path] = node

    def once(self, path: str, shape: Shape, label: str = "", **channels: ArrayLike) -> None:
        """Put a shape that all runs in the panel share."""
        place = f"{self.panel.path}/{path}"
        if place not in self.panel.nodes:
            still = {
                channel: np.asarray(values, dtype=float) for channel, values in channels.items()
            }
            self.panel.nodes[place] = Node(place, shape, still, label=label)

    def trail(
        self,
        path: str,
        points: Array,
        color: str | None = None,
        fading: bool = True,
    ) -> None:
        """The curve behind a moving point, (n, 3): it grows with the time, and fades."""
        if len(points) < 2:
            return
        smooth, color = is_smooth(points), color or self.color
        shape = tube(points, color) if smooth else dots(points, color)
        node = Node(f"{self.panel.path}/{self.name}/{path}", shape, clock=self.clock)
        node.moving["reveal"], node.fading = np.arange(len(points), dtype=float), fading
        self.panel.nodes[node.path] = node


MANY = ("cloud", "vectors", "turns")
"""The channels of what is there many times."""

RANK = {"position": 1, "quaternion": 1, "direction": 1, "scale": 0} | dict.fromkeys(MANY, 2)
"""How many axes a channel has at one time."""

PLACED = ("position", "quaternion", "direction", "scale")
"""The channels that a transform holds."""


def transform(still: dict[str, Array]) -> list[float]:
    """The 4x4 matrix, column by column, of the channels that stand still."""
    matrix = np.eye(4)
    scale = float(still.get("scale", 1.0))
    q = (
        still["quaternion"]
        if "quaternion" in still
        else toward(still["direction"])
        if "direction" in still
        else None
    )
    matrix[:3, :3] = scale * (np.eye(3) if q is None else rotation(q))
    matrix[:3, 3] = still.get("position", 0.0)
    return matrix.T.ravel().tolist()


def commands(panels: list[Panel]) -> list[dict[str, Any]]:
    """The scene as it stands at the start, in the commands of meshcat: every object once, every
    transform once.
    """
    found: list[dict[str, Any]] = []
    for panel in panels:
        for node in panel.nodes.values():
            if node.shape is not None:
                found.append(
                    {"type": "set_object", "path": node.path, "object": node.shape.three(node.path)}
                )
            first = {c: values for c, values in node.still.items() if c in PLACED}
            first |= {c: rows[0] for c, rows in node.moving.items() if c in PLACED}
            if first:
                found.append(
                    {"type": "set_transform", "path": node.path, "matrix": transform(first)}
                )
    return found
