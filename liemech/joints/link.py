"""A rigid body of a linkage, and what is fixed in it: frames, and shapes to be seen."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import field
from typing import Any

import numpy as np

from ..errors import InvalidInput, InvalidType
from ..formulas import Mat, Record, Vec, real_array, record
from ..formulas.calls.arguments import whole
from ..groups.rigid.se3 import SE3
from ..systems.inertia import checked_inertia


@record
class Link(Record):
    """A rigid body of a linkage; its frame sits in the centre of mass.

    mass : in kg.  inertia : about the centre of mass, the principal moments, (3,), or the matrix,
    (3, 3), in kg m^2; with principal moments a linkage is cheaper.  name : for messages.

    Source: Goldstein, Classical Mechanics, 3rd ed., chapter 5.
    """

    mass: float
    inertia: Vec | Mat
    name: str | None = field(default=None, kw_only=True, repr=False)

    def __post_init__(self) -> None:
        mass = real_array(self.mass, "Link: mass")
        if mass.ndim or not 0.0 < mass < np.inf:
            raise InvalidInput(f"Link: mass must be a positive number; got {self.mass!r}")
        object.__setattr__(self, "inertia", checked_inertia(self.inertia, "Link: inertia", 3)[0])
        super().__post_init__()

    @classmethod
    def rod(cls, mass: float, length: float, radius: float, *, name: str | None = None) -> Link:
        """A straight cylinder of even density along e3.  mass : in kg, length, radius : in m."""
        across = mass * (3.0 * radius * radius + length * length) / 12.0
        return cls(mass, [across, across, 0.5 * mass * radius * radius], name=name)


@record
class Frame(Record):
    """A frame that is fixed in a link of a linkage, or in the ground.

    name : such as "tool".  body : the number of a link, or None for the ground.
    pose : seen from the body's centre of mass, in its axes, [[R, p], [0, 1]], (4, 4).

    Source: Featherstone, Rigid Body Dynamics Algorithms (2008), section 4.1.
    """

    name: str
    body: int | None
    pose: Mat

    def __post_init__(self) -> None:
        _require_place(self, "Frame")
        super().__post_init__()


@record
class LinkShape(Record):
    """A shape that a link is shown by, or the ground: a box, a cylinder, a ball or a mesh.

    kind : "box", of the edges `size`, (3,); "cylinder" about e3 and "ball", which stretch to these
    diameters; "mesh", a file in units of `size`.  All lengths in m.
    body : the number of a link, or None for the ground.  pose : of the middle, or of the origin of
    a mesh, seen from the centre of mass of the body, (4, 4).
    color : "#rrggbb"; None: that of the scene.  file : of a mesh, .stl, .obj or .dae.

    Source: the URDF specification of ROS, wiki, "urdf/XML/link", visual.
    """

    kind: str
    body: int | None
    pose: Mat
    size: Vec
    color: str | None = None
    file: str | None = None

    def __post_init__(self) -> None:
        _require_place(self, "LinkShape")
        size = real_array(self.size, "LinkShape: size")
        if size.shape != (3,) or not (np.isfinite(size) & (size != 0.0)).all():
            raise InvalidInput(f"LinkShape: size must be three lengths; got {self.size!r}")
        if self.kind not in KINDS or (self.kind == "mesh") != (self.file is not None):
            raise InvalidInput(
                f"LinkShape: kind is one of {', '.join(KINDS)}, and a mesh has a file; got "
                f"{self.kind!r} with file={self.file!r}"
            )
        super().__post_init__()


KINDS = ("box", "cylinder", "ball", "mesh")
"""What shapes of links are."""


def _require_place(self: Any, name: str) -> None:
    """Raise InvalidType for a body that is no number of a link, InvalidInput for a matrix that is no pose."""
    if self.body is not None and (type(self.body) is not int or self.body < 0):
        raise InvalidType(f"{name}: body is the number of a link, 0 or more, or None for the ground; got {self.body!r}")
    pose = real_array(self.pose, f"{name}: pose")
    if pose.shape != (4, 4) or not SE3().contains(pose):
        raise InvalidInput(f"{name}: pose must be [[R, p], [0, 1]], (4, 4); got {pose.tolist()}")


def number_of(items: tuple[Any, ...], item: str | int, what: str = "joint") -> int:
    """The number of a joint, or a link, that is given by its name, or by its number."""
    names = [entry.name for entry in items]
    if isinstance(item, str) and item in names:
        return names.index(item)
    with suppress(TypeError):
        if 0 <= (number := whole(item)) < len(names):
            return number
    listing = ", ".join(repr(name) for name in names if name is not None)
    raise InvalidInput(
        f"Linkage: there is no {what} {item!r}; there are {len(names)}, numbered from 0"
        + (f", with the names {listing}" if listing else "")
    )
