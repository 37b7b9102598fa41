"""The drawing of a scene: nodes of a tree, where they are, and the tracks along which they move."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .shapes import Shape, dots, tube

Array = NDArray[np.float64]

STILL = 2.0**-20
"""A channel whose values differ by less than this, in units of the panel, stands still on every
screen: it is sent once.
"""

SHARP = np.cos(np.radians(25.0))
"""A trail whose segments mostly turn by more than this is shown by its points: a curve through them
would be invented.
"""


@dataclass
class Node:
    """A place in the tree: what stands there, how it is placed, and the channels that move.

    Channels: `position` (3), `quaternion` (4), `direction` (3), towards which the third axis
    points, `scale` (1), `cloud` (m, 3), the points of dots, and `reveal`, the segments of a trail
    that are behind the moving point.
    """

    path: str
    shape: Shape | None = None
    still: dict[str, Array] = field(default_factory=dict)
    moving: dict[str, Array] = field(default_factory=dict)
    clock: int = 0


@dataclass
class Panel:
    """One of the pictures side by side: what it is called, and which ball (centre and radius) of
    its own space it shows.
    """

    path: str
    title: str
    centre: Array
    unit: float
    flat: bool = False
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

    def add(self, path: str, shape: Shape | None = None, **channels: ArrayLike) -> None:
        """Put a shape, or an empty node for others to hang on, at a path below the run.

        Channels with one row for each time move; those whose rows do not differ are taken as one.
        """
        node = Node(f"{self.panel.path}/{self.name}/{path}", shape, clock=self.clock)
        for channel, values in channels.items():
            rows = np.asarray(values, dtype=float)
            if rows.ndim == RANK[channel]:
                node.still[channel] = rows
            elif len(rows) == 1 or (np.ptp(rows, axis=0) <= STILL).all():
                node.still[channel] = rows[0]
            else:
                node.moving[channel] = rows
        self.panel.nodes[node.path] = node

    def once(self, path: str, shape: Shape, **channels: ArrayLike) -> None:
        """Put a shape that all runs in the panel share."""
        place = f"{self.panel.path}/{path}"
        if place not in self.panel.nodes:
            still = {
                channel: np.asarray(values, dtype=float) for channel, values in channels.items()
            }
            self.panel.nodes[place] = Node(place, shape, still)

    def trail(self, path: str, points: Array, color: str | None = None) -> None:
        """The curve behind a moving point, (n, 3): it grows with the time."""
        if len(points) < 2:
            return
        shape = (tube if is_smooth(points) else dots)(points, color or self.color)
        node = Node(f"{self.panel.path}/{self.name}/{path}", shape, clock=self.clock)
        node.moving["reveal"] = np.arange(len(points), dtype=float)
        self.panel.nodes[node.path] = node


RANK = {"position": 1, "quaternion": 1, "direction": 1, "scale": 0, "cloud": 2}
"""How many axes a channel has at one time."""

PLACED = ("position", "quaternion", "direction", "scale")
"""The channels that a transform holds."""


def is_smooth(points: Array) -> bool:
    """Do most segments of a curve turn little from one to the next?"""
    steps = np.diff(points, axis=0)
    length = np.linalg.norm(steps, axis=1)
    # in units of the panel: shorter ones have no direction that could be seen
    steps = steps[length > 1e-6]
    if len(steps) < 2:
        return True
    cosines = (steps[1:] * steps[:-1]).sum(axis=1) / (
        np.linalg.norm(steps[1:], axis=1) * np.linalg.norm(steps[:-1], axis=1)
    )
    return bool(np.median(cosines) >= SHARP)


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


def toward(d: Array) -> Array:
    """The quaternion of the shortest turn that takes the third axis to a direction."""
    x, y, z = d / np.linalg.norm(d)
    if z < -1.0 + 1e-9:
        return np.array([1.0, 0.0, 0.0, 0.0])
    q = np.array([-y, x, 0.0, 1.0 + z])
    return q / np.linalg.norm(q)


def rotation(q: Array) -> Array:
    """The matrix of a unit quaternion (x, y, z, w)."""
    x, y, z, w = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def carried(directions: Array) -> Array:
    """Quaternions (n, 4) that take the third axis to directions (n, 3), each by the shortest turn
    from the one before.
    """
    q = toward(directions[0])
    rows = [q]
    for a, b in pairwise(directions):
        half = np.append(np.cross(a, b), 1.0 + a @ b)
        size = np.linalg.norm(half)
        if size > 1e-9:  # opposite directions have no shortest turn
            u, v = half[:3] / size, half[3] / size
            q = np.append(v * q[:3] + q[3] * u + np.cross(u, q[:3]), v * q[3] - u @ q[:3])
        else:
            q = toward(b)
        rows.append(q)
    return np.array(rows)


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
