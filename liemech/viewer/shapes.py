"""Shapes of a scene, as the JSON of three.js that meshcat reads.

A shape makes its geometry when it is written, not before: what is only moved, as in a live scene,
costs nothing. Lengths are in units of a panel, whose content fits a ball of radius 1.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InvalidInput
from ..models.curves import frames

FORMATS = (".stl", ".obj", ".dae")
"""Mesh files that meshcat's page can read."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Shape:
    """Something to draw: its kind in three.js, what makes its geometry, its material.

    per_segment : of a trail, how many entries of the geometry belong to one segment; 0 for shapes
    that do not grow.
    per_start : how many are there before the first segment.
    many : of a shape that is there many times, as one object: how often, "count", the "sizes" of all
    or of each, and what the page should know to draw them.
    """

    kind: str
    geometry: Callable[[], dict[str, Any]]
    material: dict[str, Any]
    per_segment: int = 0
    per_start: int = 0
    many: dict[str, Any] | None = None

    def three(self, name: str) -> dict[str, Any]:
        """The object as three.js writes it down; `name` makes its identifiers unique."""
        return {
            "metadata": {"version": 4.5, "type": "Object"},
            "geometries": [{"uuid": f"{name} geometry", **self.geometry()}],
            "materials": [{"uuid": f"{name} material", **self.material}],
            "object": {
                "uuid": name,
                "type": self.kind,
                "geometry": f"{name} geometry",
                "material": f"{name} material",
                **(
                    {
                        "count": self.many["count"],
                        "userData": self.many,
                        "instanceMatrix": {"array": [0.0] * 16},
                    }
                    if self.many
                    else {}
                ),
            },
        }


# ------------------------------------------------------------------ solids


def box(size: Array, color: str, opacity: float = 1.0) -> Shape:
    """A box with edges along the axes."""
    width, height, depth = map(float, size)
    return Shape(
        "Mesh",
        lambda: {"type": "BoxGeometry", "width": width, "height": height, "depth": depth},
        solid(color, opacity),
    )


def box_edges(size: Array, color: str) -> Shape:
    """The twelve edges of a box."""
    corners = (
        0.5
        * np.asarray(size)
        * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    )
    pairs = [(a, b) for a in range(8) for b in range(a + 1, 8) if bin(a ^ b).count("1") == 1]
    return segments(corners[np.array(pairs)], color)


def ball(radius: float, color: str, opacity: float = 1.0) -> Shape:
    """A sphere; what is behind a transparent one shows through."""
    fine = (
        {"widthSegments": 48, "heightSegments": 32}
        if radius > 0.3
        else {"widthSegments": 20, "heightSegments": 12}
    )
    return Shape(
        "Mesh",
        lambda: {"type": "SphereGeometry", "radius": float(radius), **fine},
        solid(color, opacity),
    )


def turned(profile: list[tuple[float, float]], color: str, sides: int = 20) -> Shape:
    """A solid of revolution about the third axis.  profile : (radius, height) from one end to the
    other, the inside on the left.
    """

    def geometry() -> dict[str, Any]:
        points = np.array(profile, dtype=float)
        angle = np.linspace(0.0, 2.0 * np.pi, sides + 1)
        circle = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        bands, triangles = [], []
        for n, (a, b) in enumerate(pairwise(points)):  # edges stay sharp: no band shares a vertex
            bands += [np.column_stack([r * circle, np.full(sides + 1, z)]) for r, z in (a, b)]
            first = 2 * n * (sides + 1) + np.arange(sides)
            second = first + sides + 1
            triangles += [
                np.column_stack([first, first + 1, second]),
                np.column_stack([second, first + 1, second + 1]),
            ]
        return _mesh(np.concatenate(bands), np.concatenate(triangles))

    return Shape("Mesh", geometry, solid(color))


def arrow(color: str, radius: float = 0.018) -> Shape:
    """An arrow of length 1 along the third axis, from the origin."""
    neck, wide = 1.0 - 6.5 * radius, 2.7 * radius
    return turned([(0.0, 0.0), (radius, 0.0), (radius, neck), (wide, neck), (0.0, 1.0)], color)


def rod(color: str, radius: float = 0.015) -> Shape:
    """A rod of length 1 along the third axis, from the origin."""
    return turned([(0.0, 0.0), (radius, 0.0), (radius, 1.0), (0.0, 1.0)], color, sides=12)


def needle(radius: float, sides: int) -> Shape:
    """An arrow of length 1 along the third axis, with the origin in its middle.  radius : of its
    head.
    """
    thin, neck = 0.45 * radius, 0.5 - min(2.0 * radius, 0.5)
    profile = [(0.0, -0.5), (thin, -0.5), (thin, neck), (radius, neck), (0.0, 0.5)]
    return turned(profile, "#ffffff", sides)


def often(shape: Shape, count: int, sizes: ArrayLike = ((1.0,),), **known: Any) -> Shape:
    """A shape that is there many times, drawn at once.

    sizes : (1, 1) a factor for all, (count, 1) one for each, (count, 3) three along its axes.
    known : what the page draws by: "colors" and "axis", the scale for how far arrows point along
    an axis; "tints" (count, 3); "box", the edges of a periodic one; "sides", colours of a ball's
    octants, two in turn, or of the sides of a cube on which its axes come out, and of the others.
    """
    rows = np.asarray(sizes, dtype=np.float32)
    array = np.broadcast_to(rows, (len(rows), 3))
    return replace(
        shape, kind="InstancedMesh", many={"count": count, "sizes": array.ravel(), **known}
    )


def mesh_file(path: str | PathLike[str], color: str) -> Shape:
    """A body from a file: .stl, .obj or .dae."""
    file = Path(path)
    kind = file.suffix.lower()
    if kind not in FORMATS:
        raise InvalidInput(
            f"mesh must be a file that ends in {', '.join(FORMATS)}; got {str(path)!r}"
        )
    try:
        content = file.read_bytes()
    except OSError as refused:
        raise InvalidInput(f"mesh {str(path)!r} cannot be read: {refused}") from None
    data: Any = (
        np.frombuffer(content, dtype=np.uint8) if kind == ".stl" else content.decode("utf-8")
    )
    return Shape(
        "Mesh",
        lambda: {"type": "_meshfile_geometry", "format": kind[1:], "data": data},
        solid(color),
    )


# ------------------------------------------------------------------ curves and points


def tube(points: Array, color: str, radius: float = 0.009, sides: int = 5) -> Shape:
    """A curve (n, 3), thick enough to be seen: lines are one pixel wide in WebGL.  Its segments are
    in the order of the points.
    """

    def geometry() -> dict[str, Any]:
        normal, binormal = frames(points)
        angle = np.arange(sides) * (2.0 * np.pi / sides)
        rings = points[:, None] + radius * (
            np.cos(angle)[:, None] * normal[:, None] + np.sin(angle)[:, None] * binormal[:, None]
        )
        k = np.arange(sides)
        here, beside = np.stack([k, np.roll(k, -1)])
        one = np.stack(
            [here, beside, here + sides, here + sides, beside, beside + sides], axis=-1
        ).ravel()
        index = sides * np.arange(len(points) - 1)[:, None] + one
        return _mesh(rings.reshape(-1, 3), index.reshape(-1, 3))

    return Shape(
        "Mesh",
        geometry,
        {"type": "MeshBasicMaterial", "color": number(color), "side": 2},
        per_segment=6 * sides,
    )


def segments(pairs: Array, color: str, opacity: float = 1.0) -> Shape:
    """Straight lines one pixel wide, from (m, 2, 3)."""

    def geometry() -> dict[str, Any]:
        return {
            "type": "BufferGeometry",
            "data": {"attributes": {"position": _attribute(pairs.reshape(-1, 3))}},
        }

    return Shape(
        "LineSegments",
        geometry,
        {"type": "LineBasicMaterial", "color": number(color), **_seen_through(opacity)},
    )


def chained(curves: Array) -> Array:
    """The segments (m, 2, 3) of curves (c, n, 3)."""
    return np.stack([curves[:, :-1], curves[:, 1:]], axis=2).reshape(-1, 2, 3)


def dots(points: Array, color: str, size: float = 0.03, colors: Array | None = None) -> Shape:
    """Round dots at (n, 3).  colors : (n, 3) red, green, blue for each of them."""

    def geometry() -> dict[str, Any]:
        attributes = {"position": _attribute(points)}
        if colors is not None:
            attributes["color"] = _attribute(colors)
        return {"type": "BufferGeometry", "data": {"attributes": attributes}}

    look = (
        {"vertexColors": True, "color": 0xFFFFFF}
        if colors is not None
        else {"color": number(color)}
    )
    material = {"type": "PointsMaterial", "size": size, "sizeAttenuation": True, **look}
    return Shape("Points", geometry, material, per_segment=1, per_start=1)


# ------------------------------------------------------------------ materials and buffers


def solid(color: str, opacity: float = 1.0) -> dict[str, Any]:
    """Lambert's law, front sides only: in software drawing several times faster than the
    alternatives, and no less clear.
    """
    return {
        "type": "MeshLambertMaterial",
        "color": number(color),
        "side": 0,
        **_seen_through(opacity),
    }


def _seen_through(opacity: float) -> dict[str, Any]:
    return {} if opacity >= 1.0 else {"transparent": True, "opacity": opacity}


@lru_cache(maxsize=256)
def rgb(color: str) -> tuple[int, int, int]:
    """The parts of a colour "#rrggbb", 0 to 255."""
    try:
        if len(color) != 7 or color[0] != "#":
            raise ValueError
        return int(color[1:3], 16), int(color[3:5], 16), int(color[5:7], 16)
    except (ValueError, TypeError):
        raise InvalidInput(
            f'color must be written "#rrggbb", such as "#0072B2"; got {color!r}'
        ) from None


def shares(colors: Sequence[str]) -> list[list[float]]:
    """Colours as JavaScript mixes them, each part from 0 to 1."""
    return [[part / 255.0 for part in rgb(color)] for color in colors]


def number(color: str) -> int:
    """A colour as three.js counts it."""
    red, green, blue = rgb(color)
    return red << 16 | green << 8 | blue


def mixed(color: str, other: str, share: float) -> str:
    """A colour between two; `share` is that of the other."""
    return "#" + "".join(
        f"{round(a + share * (b - a)):02x}" for a, b in zip(rgb(color), rgb(other), strict=True)
    )


def _attribute(rows: Array) -> dict[str, Any]:
    return {
        "itemSize": rows.shape[-1],
        "type": "Float32Array",
        "array": rows.astype(np.float32).ravel(),
        "normalized": False,
    }


def _mesh(vertices: Array, triangles: NDArray[np.intp]) -> dict[str, Any]:
    small = len(vertices) < 65536
    index = triangles.astype(np.uint16 if small else np.uint32).ravel()
    return {
        "type": "BufferGeometry",
        "data": {
            "attributes": {"position": _attribute(vertices)},
            "index": {"type": "Uint16Array" if small else "Uint32Array", "array": index},
        },
    }
