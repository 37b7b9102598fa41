"""Shapes of a scene, as the JSON of three.js that meshcat reads.

A shape makes its geometry when it is written, not before: what is only moved, as in a live scene,
costs nothing. Lengths are in units of a panel, whose content fits a ball of radius 1.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InvalidInput
from ..formulas.arrays import Array

FORMATS = (".stl", ".obj", ".dae")
"""Mesh files that meshcat's page can read."""


@dataclass(frozen=True)
class ThreeShape:
    """Something to draw: its kind in three.js, what makes its geometry, its material.

    known : what else the page should know to draw it; of a shape that is there many times, as one
    object, how often, "count".
    """

    kind: str
    geometry: Callable[[], dict[str, Any]]
    material: dict[str, Any]
    known: dict[str, Any] = field(default_factory=dict)

    def three(self, name: str) -> dict[str, Any]:
        """The object as three.js writes it down; `name` makes its identifiers unique."""
        instances = {"count": self.known.get("count"), "instanceMatrix": {"array": [0.0] * 16}}
        return {
            "metadata": {"version": 4.5, "type": "Object"},
            "geometries": [{"uuid": f"{name} geometry", **self.geometry()}],
            "materials": [{"uuid": f"{name} material", **self.material}],
            "object": {
                "uuid": name,
                "type": self.kind,
                "geometry": f"{name} geometry",
                "material": f"{name} material",
                "userData": self.known,
                **(instances if self.kind == "InstancedMesh" else {}),
            },
        }


# ------------------------------------------------------------------ solids


def box(size: Array, color: str, opacity: float = 1.0) -> ThreeShape:
    """A box along the axes; the page draws its edges darker."""
    width, height, depth = map(float, size)
    return ThreeShape(
        "Mesh", lambda: {"type": "BoxGeometry", "width": width, "height": height, "depth": depth}, solid(color, opacity)
    )


def ball(radius: float, color: str, opacity: float = 1.0, rows: int = 0) -> ThreeShape:
    """A sphere; what is behind a transparent one shows through.  rows : of its faces, from pole to pole."""
    rows = rows or (32 if radius > 0.3 else 12)
    sphere = {"type": "SphereGeometry", "radius": float(radius)}
    faces = {"widthSegments": 2 * rows, "heightSegments": rows}
    return ThreeShape("Mesh", lambda: sphere | faces, solid(color, opacity))


def colored_ball(rows: int, colors: Sequence[str]) -> ThreeShape:
    """A sphere of radius 1 on whose points the channel `tones` mixes three colours: at latitudes from
    90 degrees to -90, rows + 1 of them, and at longitudes from -180 to 180, 2 rows + 1.  Its pole is
    the second axis.
    """
    sphere = ball(1.0, "#ffffff", rows=rows)
    colored = sphere.material | {"vertexColors": True}
    return replace(sphere, material=colored, known={"colors": shares(colors)})


def turned(profile: Sequence[tuple[float, float]], color: str, sides: int = 20) -> ThreeShape:
    """A solid of revolution about the third axis.  profile : (radius, height) from one end to the
    other, the inside on the left.
    """
    corners = [{"x": r, "y": z} for r, z in profile for _ in range(2)]  # twice: edges stay sharp
    lathe = {"type": "LatheGeometry", "points": corners, "segments": sides}
    return ThreeShape("Mesh", lambda: lathe, solid(color))


def arrow(color: str) -> ThreeShape:
    """An arrow of length 1 along the third axis, from the origin."""
    return turned([(0.0, 0.0), (0.018, 0.0), (0.018, 0.88), (0.05, 0.88), (0.0, 1.0)], color)


def rod(color: str, radius: float = 0.015, sides: int = 12) -> ThreeShape:
    """A rod of length 1 along the third axis, from the origin."""
    return turned([(0.0, 0.0), (radius, 0.0), (radius, 1.0), (0.0, 1.0)], color, sides)


def stick(cap: float, sides: int) -> ThreeShape:
    """A rod of diameter and length 1 along the third axis, from the origin, with round ends beyond it, which fill the
    bends of a tube; thin ones, of less than eight sides, have points.  cap : the height of the ends.
    """
    angles = np.radians([0.0, 60.0, 90.0, 90.0] if sides >= 8 else [0.0, 90.0])  # the rim twice: it stays sharp
    end = [{"x": 0.5 * float(np.sin(a)), "y": -cap * float(np.cos(a))} for a in angles]
    points = end + [{"x": p["x"], "y": 1.0 - p["y"]} for p in reversed(end)]
    return ThreeShape("Mesh", lambda: {"type": "LatheGeometry", "points": points, "segments": sides}, solid("#ffffff"))


def needle(radius: float, sides: int) -> ThreeShape:
    """An arrow of length 1 along the third axis, with the origin in its middle.  radius : of its head."""
    thin, neck = 0.45 * radius, 0.5 - min(2.0 * radius, 0.5)
    profile = [(0.0, -0.5), (thin, -0.5), (thin, neck), (radius, neck), (0.0, 0.5)]
    return turned(profile, "#ffffff", sides)


def often(shape: ThreeShape, count: int, sizes: ArrayLike = ((1.0,),), **values: Any) -> ThreeShape:
    """A shape that is there many times, drawn at once.

    sizes : (1, 1) a factor for all, (count, 1) one for each, (count, 3) three along its axes.
    known : what the page draws by: "colors" and "axis", the scale for how far arrows point along
    an axis; "tints" (count, 3); "box", the edges of a periodic one; "sides", colours of a ball's
    octants, two in turn, or of the sides of a cube on which its axes come out, and of the others;
    "room", how far they reach from their places, along each axis.
    """
    rows = np.asarray(sizes, dtype=np.float32)
    array = np.broadcast_to(rows, (len(rows), 3)).ravel()
    room = (0.5 * rows.max(axis=0)).tolist()
    values = {"count": count, "sizes": array, "room": room, **values}
    return replace(shape, kind="InstancedMesh", known=values)


def colored(shape: ThreeShape, colors: str | Sequence[str]) -> ThreeShape:
    """A shape that is there many times in another colour, or each in its own."""
    if isinstance(colors, str):
        return replace(shape, material=shape.material | {"color": number(colors)})
    tints = np.array(shares(colors), dtype=np.float32)
    return replace(shape, known=shape.known | {"tints": tints})


def mesh_file(path: str | PathLike[str], color: str) -> ThreeShape:
    """A body from a file: .stl, .obj or .dae.

    Raises InvalidInput for what the page could not read, which would leave it blank.
    """
    file = Path(path)
    kind = file.suffix.lower()
    if kind not in FORMATS:
        raise InvalidInput(f"mesh must be a file that ends in {', '.join(FORMATS)}; got {str(path)!r}")
    try:
        content = file.read_bytes()
    except OSError as refused:
        raise InvalidInput(f"mesh {str(path)!r} cannot be read: {refused}") from None
    wrong = {".stl": _no_stl, ".obj": _no_obj, ".dae": _no_collada}[kind](content)
    if content.startswith(b"version https://git-lfs"):
        wrong = "is a pointer of Git LFS, not the file itself: run `git lfs pull`"
    if wrong:
        raise InvalidInput(f"mesh {str(path)!r} {wrong}")
    data: Any = np.frombuffer(content, dtype=np.uint8) if kind == ".stl" else _text(content)
    return ThreeShape("Mesh", lambda: {"type": "_meshfile_geometry", "format": kind[1:], "data": data}, solid(color))


def _text(content: bytes) -> str:
    """A text in the encoding that it names, or in UTF-8, or in Latin-1, which has every byte."""
    named = re.match(rb"""\s*<\?xml[^>]*encoding=["']([\w.-]+)["']""", content)
    for encoding in ([named[1].decode()] if named else []) + ["utf-8-sig"]:
        try:
            return content.decode(encoding)
        except (LookupError, UnicodeDecodeError):
            continue
    return content.decode("latin-1")


def _no_stl(content: bytes) -> str:
    """Why bytes are no STL file of triangles; empty if they are one."""
    count = int.from_bytes(content[80:84], "little")
    text = content[:5] == b"solid" and b"facet" in content and b"vertex" in content
    return "" if text or (count > 0 and len(content) >= 84 + 50 * count) else "is no STL file of triangles"


def _no_obj(content: bytes) -> str:
    """Why bytes are no OBJ file of faces; empty if they are one."""
    has_faces = all(re.search(rb"^\s*" + letter + rb"\s", content, re.MULTILINE) for letter in (b"v", b"f"))
    return "" if has_faces else "is no OBJ file of faces"


def _no_collada(content: bytes) -> str:
    """Why bytes are no COLLADA file with a scene of triangles; empty if they are one."""
    from xml.parsers import expat

    tags: set[str] = set()
    parser = expat.ParserCreate()
    parser.StartElementHandler = lambda tag, _: tags.add(tag)
    try:
        parser.Parse(content, True)
    except expat.ExpatError as refused:
        return f"is no XML: {refused}"
    shown = {"COLLADA", "visual_scene", "mesh"} <= tags and tags & {"triangles", "polylist", "polygons", "lines"}
    return "" if shown else "is no COLLADA file with a scene of triangles"


# ------------------------------------------------------------------ lines


def segments(pairs: Array, color: str) -> ThreeShape:
    """Straight lines one pixel wide, from (m, 2, 3)."""
    look = {"type": "LineBasicMaterial", "color": number(color)}

    def geometry() -> dict[str, Any]:
        array = pairs.astype(np.float32).ravel()
        position = {"itemSize": 3, "type": "Float32Array", "array": array, "normalized": False}
        return {"type": "BufferGeometry", "data": {"attributes": {"position": position}}}

    return ThreeShape("LineSegments", geometry, look)


# ------------------------------------------------------------------ materials


def solid(color: str, opacity: float = 1.0) -> dict[str, Any]:
    """Lambert's law, front sides only: in software drawing several times faster than the
    alternatives, and no less clear.
    """
    look = {"type": "MeshLambertMaterial", "color": number(color), "side": 0}
    return look if opacity >= 1.0 else look | {"transparent": True, "opacity": opacity}


def plain(color: str) -> dict[str, Any]:
    """The colour itself, whatever the light."""
    return {"type": "MeshBasicMaterial", "color": number(color)}


@lru_cache(maxsize=256)
def rgb(color: str) -> tuple[int, int, int]:
    """The parts of a colour "#rrggbb", 0 to 255."""
    if not re.fullmatch("#[0-9a-fA-F]{6}", str(color)):
        raise InvalidInput(f'color must be written "#rrggbb", such as "#0072B2"; got {color!r}')
    red, green, blue = bytes.fromhex(color[1:])
    return red, green, blue


def shares(colors: Sequence[str]) -> list[list[float]]:
    """Colours as JavaScript mixes them, each part from 0 to 1."""
    return [[part / 255.0 for part in rgb(color)] for color in colors]


def number(color: str) -> int:
    """A colour as three.js counts it."""
    return int.from_bytes(rgb(color), "big")


def mixed(color: str, other: str, share: float) -> str:
    """A colour between two; `share` is that of the other."""
    return "#" + "".join(f"{round(a + share * (b - a)):02x}" for a, b in zip(rgb(color), rgb(other), strict=True))
