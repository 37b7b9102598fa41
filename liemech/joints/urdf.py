"""Robots from URDF files: links with inertias, joints, limits, damping, friction, and what is seen.

The file is read by expat, the XML reader of Python's library, which refuses what URDF has no use for:
document types, and with them entities. Readers of other packages bring lxml, trimesh and networkx along.

Source: the URDF specification of ROS, wiki, "urdf/XML"; Featherstone, Rigid Body Dynamics Algorithms
(2008), section 2.13 (inertias of bodies that are joined).
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FileWarning, InertiaWarning, InvalidInput, InvalidType, warn
from ..formulas import real_array
from ..groups.rigid.se3 import SE3
from ..names import meant
from .joint_forces import Damper, DryFriction, JointForce, JointPotential, Limited, Stops
from .joints import FloatingJoint, Mimic, PlanarJoint, PrismaticJoint, RevoluteJoint
from .link import Frame, Link, LinkShape

KINDS = ("revolute", "continuous", "prismatic", "planar", "floating", "fixed")
"""The joints of URDF."""

GEARED = ("revolute", "continuous", "prismatic")
"""Those that a motor drives."""

WIDE = 100.0
"""Bodies whose inertia says that they are so many times larger than the robot have other units."""

TOLD = 5
"""Faults of shapes that one warning tells."""

PARALLEL = 4 * np.finfo(float).eps
"""Products of inertia below this part of the moments are rounding."""


# ------------------------------------------------------------------ XML


@dataclass(eq=False)
class Element:
    """An element of the file, with the line where it begins."""

    tag: str
    attributes: dict[str, str]
    line: int
    file: str
    inside: list[Element] = field(default_factory=list)

    def some(self, tag: str) -> list[Element]:
        """The elements in it of this kind."""
        return [element for element in self.inside if element.tag == tag]

    def one(self, tag: str) -> Element | None:
        """The one element of this kind, or None."""
        elements = self.some(tag)
        if len(elements) > 1:
            raise elements[1].wrong(f"is the second <{tag}> of one <{self.tag}>")
        return elements[0] if elements else None

    def text(self, name: str) -> str:
        """An attribute that must be there."""
        if not self.attributes.get(name, "").strip():
            raise self.wrong(f"has no {name}")
        return self.attributes[name].strip()

    def number(self, name: str, default: float | None = None) -> float:
        """An attribute that is one number."""
        return float(self.numbers(name, 1, None if default is None else [default])[0])

    def numbers(self, name: str, count: int, default: Any = None) -> np.ndarray:
        """An attribute of several numbers."""
        if default is not None and name not in self.attributes:
            return np.array(default, dtype=float)
        words = self.text(name)
        try:
            if "_" in words:
                raise ValueError
            numbers = np.array([float(x) for x in words.split()])
        except ValueError:
            numbers = np.zeros(0)
        if numbers.shape != (count,) or not np.isfinite(numbers).all():
            expected = "a number" if count == 1 else f"{count} numbers"
            raise self.wrong(f'has {name}="{words}", which must be {expected}')
        return numbers

    def wrong(self, complaint: str) -> InvalidInput:
        """The error of this element."""
        name = f' name="{self.attributes["name"]}"' if "name" in self.attributes else ""
        return InvalidInput(f"{self.file}, line {self.line}: <{self.tag}{name}> {complaint}")


def parsed(data: bytes, file: str, encoding: str | None = None) -> Element:
    """The elements of an XML text.  encoding : that counts, whatever the text says of its own.

    Raises InvalidInput for what is no XML, and for document types, by which a small file can grow to
    gigabytes or read others.
    """
    from xml.parsers import expat

    parser, top = expat.ParserCreate(encoding), Element("", {}, 0, file)
    open_ones, text = [top], data.lstrip()  # others take a blank line before <?xml ?>
    blank = data[: len(data) - len(text)].count(b"\n")

    def begin(tag: str, attributes: dict[str, str]) -> None:
        if tag.startswith("xacro:") or "${" in "".join(attributes.values()):
            raise InvalidInput(
                f"{file}, line {blank + parser.CurrentLineNumber}: <{tag}> is xacro, from which URDF is "
                "made: run `xacro robot.urdf.xacro > robot.urdf`"
            )
        new = Element(tag, attributes, blank + parser.CurrentLineNumber, file)
        open_ones[-1].inside.append(new)
        open_ones.append(new)

    def document_type(*attributes: Any) -> None:
        raise InvalidInput(
            f"{file}, line {blank + parser.CurrentLineNumber}: URDF has no document type or entities; "
            "delete <!DOCTYPE ...>"
        )

    parser.StartElementHandler = begin
    parser.EndElementHandler = lambda tag: open_ones.pop()
    parser.StartDoctypeDeclHandler = document_type
    try:
        parser.Parse(text, True)
    except expat.ExpatError as refused:
        raise InvalidInput(f"{file} is no XML: {refused}") from None
    (robot,) = top.inside
    if robot.tag != "robot":
        raise robot.wrong("is no robot: a URDF file is one <robot>")
    return robot


# ------------------------------------------------------------------ the tree


def linkage_of(
    path: Any,
    *,
    floating: bool = False,
    at: Any = None,
    stops: float | None = None,
    speed: float = 0.01,
    packages: Mapping[str, Any] | None = None,
    forces: Any = (),
    limits: bool = False,
    armature: Any = None,
) -> dict[str, Any]:
    """The arguments of a `Linkage`: links, joints, forces, frames and shapes; see `from_urdf`."""
    robot, folder = _opened(path)
    links = _by_name(robot, "link")
    if not links:
        raise robot.wrong("has no links")
    joints = _by_name(robot, "joint")
    parents = _parents(joints, links)
    order = _ordered(robot, links, parents)
    root = np.eye(4) if at is None else real_array(at, "Linkage.from_urdf: at")
    if root.shape != (4, 4) or not SE3().contains(root):
        raise InvalidInput(f"Linkage.from_urdf: at is the pose of the root, [[R, p], [0, 1]]; got {root.tolist()}")
    # in the zero position: the pose of each link, and the link that it is fixed to, None: the ground
    poses, moved = {order[0]: root}, {order[0]: order[0] if floating else None}  # type: Any, Any
    for name in order[1:]:
        joint, parent = parents[name]
        kind = joint.text("type")
        if kind not in KINDS:
            raise joint.wrong(f"has the type {kind!r}; URDF has {', '.join(KINDS)}")
        poses[name] = poses[parent] @ _origin(joint)
        moved[name] = moved[parent] if kind == "fixed" else name
    heads = [name for name in order if moved[name] == name]
    if not heads:
        complaint = "has no joint that moves"
        if any(links[name].one("inertial") for name in order):
            body = _body(links, order, poses)[0]
            falling = f"FallingBody({np.array(body.inertia).tolist()}, {body.mass!r})"
            complaint += f"; all of it falls as one body, lm.models.{falling}"
        raise robot.wrong(complaint)
    numbers: Any = {name: number for number, name in enumerate(heads)} | {None: None}
    bodies = {name: _body(links, [other for other in order if moved[other] == name], poses) for name in heads}
    _require_units(bodies, poses)
    centres: Any = {name: centre for name, (_, centre) in bodies.items()} | {None: np.zeros(3)}
    args: dict[str, Any] = {"links": [body for body, _ in bodies.values()], "joints": []}
    args["forces"] = []
    rotors = _rotors(robot, joints, armature)
    for name in heads:
        point, second = poses[name][:3, 3], moved[parents[name][1]] if name in parents else None
        ends: Any = numbers[name], numbers[second], point - centres[name], point - centres[second]
        if name not in parents:
            args["joints"].append(FloatingJoint(*ends, name=f"{name} root" if name in joints else name))
            continue
        joint = parents[name][0]
        args["joints"].append(_joint(joint, ends, poses[name][:3, :3], rotors))
        args["forces"] += _forces(joint, stops, speed)
    numbered = [joint.name for joint in args["joints"]]
    args["forces"] += [_within(joints, numbered, force) if limits else force for force in forces or ()]
    centred = {name: poses[name].copy() for name in order}
    for name in order:
        centred[name][:3, 3] -= centres[moved[name]]
    args["mimics"] = [_mimic(element, joints) for element in joints.values() if element.one("mimic")]
    args["mimics"] = [element for element in args["mimics"] if element is not None]
    args["frames"] = [Frame(name, numbers[moved[name]], centred[name].tolist()) for name in order]
    args["shapes"] = _shapes(robot, links, centred, {n: numbers[moved[n]] for n in order}, _Files(folder, packages))
    return args


def _opened(path: Any) -> tuple[Element, Path]:
    """The robot of a file or a text, and the folder of its meshes."""
    text = path.removeprefix("\ufeff") if isinstance(path, str) else ""
    if text.lstrip().startswith("<"):
        return parsed(text.encode(), "URDF", "utf-8"), Path()
    if not isinstance(path, (str, os.PathLike)):
        raise InvalidType(f"Linkage.from_urdf: path is a file, or its text; got {path!r}")
    try:
        data = Path(path).read_bytes()
    except OSError as refused:
        raise InvalidInput(f"Linkage.from_urdf: {str(path)!r} cannot be read: {refused}") from None
    return parsed(data, Path(path).name), Path(path).resolve().parent


def _by_name(robot: Element, tag: str) -> dict[str, Element]:
    """The links or joints by their names."""
    by_name: dict[str, Element] = {}
    for element in robot.some(tag):
        name = element.text("name")
        if name in by_name:
            raise element.wrong(f"has the name of the <{tag}> in line {by_name[name].line}")
        by_name[name] = element
    return by_name


def _parents(joints: dict[str, Element], links: dict[str, Element]) -> dict[str, tuple[Element, str]]:
    """The joint from which each link hangs, and the link behind it, by links."""
    parents: dict[str, tuple[Element, str]] = {}
    for joint in joints.values():
        ends = []
        for side in ("parent", "child"):
            end = joint.one(side)
            name = "" if end is None else end.text("link")
            if name not in links:
                raise joint.wrong(f"has the {side} link {name!r}, which is not there{meant(name, links)}")
            ends.append(name)
        parent, child = ends
        if child in parents:
            raise joint.wrong(
                f"holds the link {child!r}, as the joint {parents[child][0].attributes['name']!r} does: a "
                "URDF is a tree. Close loops by joints of your own, Linkage(links, joints)"
            )
        parents[child] = joint, parent
    return parents


def _ordered(robot: Element, links: dict[str, Element], parents: dict[str, tuple[Element, str]]) -> list[str]:
    """The links, each after the one that it hangs from."""
    roots = [name for name in links if name not in parents]
    children: dict[str, list[str]] = {}
    for child, (_, parent) in parents.items():
        children.setdefault(parent, []).append(child)
    order = roots[:1]
    for name in order:
        order += children.get(name, [])
    left = [name for name in links if name not in order]
    if len(roots) > 1:
        raise robot.wrong(f"has several roots, links that hang from no other: {', '.join(roots)}")
    if left:
        raise robot.wrong(f"has links that hang from each other in a circle: {', '.join(left)}")
    return order


# ------------------------------------------------------------------ bodies and joints


def _origin(element: Element) -> np.ndarray:
    """The pose [[R, p], [0, 1]] of <origin xyz rpy>, R = R_z(yaw) R_y(pitch) R_x(roll)."""
    pose, origin = np.eye(4), element.one("origin")
    if origin is None:
        return pose
    turns = origin.numbers("rpy", 3, np.zeros(3))
    if np.abs(turns).max() > 4.0 * np.pi:
        raise origin.wrong(f'has rpy="{origin.attributes["rpy"]}": angles are in rad, not in degrees')
    (a, b, c), (x, y, z) = np.cos(turns), np.sin(turns)
    pose[:3, :3] = [
        [c * b, c * y * x - z * a, c * y * a + z * x],
        [z * b, z * y * x + c * a, z * y * a - c * x],
        [-y, b * x, b * a],
    ]
    pose[:3, 3] = origin.numbers("xyz", 3, np.zeros(3))
    return pose


def _body(links: dict[str, Element], parts: list[str], poses: dict[str, np.ndarray]) -> tuple[Link, np.ndarray]:
    """The body of links that are fixed to each other, and its centre of mass in the zero position.

    Its axes are those of space in that position, so that all frames are parallel where all angles
    are zero.
    """
    inertials = []
    for name in parts:
        inertial = links[name].one("inertial")
        if inertial is None:
            continue
        mass, inertia = inertial.one("mass"), inertial.one("inertia")
        if mass is None or inertia is None:
            raise inertial.wrong("must have a <mass> and an <inertia>")
        xx, yy, zz = (inertia.number(k) for k in ("ixx", "iyy", "izz"))
        xy, xz, yz = (inertia.number(k, 0.0) for k in ("ixy", "ixz", "iyz"))
        pose = poses[name] @ _origin(inertial)
        J = pose[:3, :3] @ [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]] @ pose[:3, :3].T
        m = mass.number("value")
        if m < 0.0:
            raise mass.wrong(f'has value="{mass.attributes["value"]}"; a mass is not negative')
        inertials.append((m, pose[:3, 3], J))
    total = sum(m for m, _, _ in inertials)
    if not total > 0.0:
        raise links[parts[0]].wrong("moves and has no mass: give it an <inertial>, or make its joint fixed")
    centre = sum(m * p for m, p, _ in inertials) / total
    whole = sum(J + m * ((p - centre) @ (p - centre) * np.eye(3) - np.outer(p - centre, p - centre))
                for m, p, J in inertials)  # fmt: skip
    whole = 0.5 * (whole + whole.T)
    moments = np.linalg.eigvalsh(whole)
    if not moments[0] > PARALLEL * moments[2]:
        raise links[parts[0]].wrong(
            f"has the principal moments of inertia {moments.tolist()} kg m^2; all must be positive"
        )
    if moments[0] + moments[1] < moments[2] * (1.0 - 1e-6):
        warn(
            f"link {parts[0]!r}: no body made of positive masses has the principal moments "
            f"{moments.tolist()}; the motion is computed all the same",
            InertiaWarning,
        )
    diagonal = np.diag(whole)
    off = np.abs(whole - np.diag(diagonal)).max()
    inertias: Any = diagonal if off <= PARALLEL * diagonal.max() else whole
    return Link(total, inertias.tolist(), name=parts[0]), centre


def _require_units(bodies: dict[str, tuple[Link, np.ndarray]], poses: dict[str, np.ndarray]) -> None:
    """Warn of inertias that belong to bodies far larger than the robot."""
    points = np.array([*[pose[:3, 3] for pose in poses.values()], *[c for _, c in bodies.values()]])
    size = np.ptp(points, axis=0).max()
    for name, (link, _) in bodies.items():
        J = np.array(link.inertia)
        radius = np.sqrt(float(np.trace(J) if J.ndim == 2 else J.sum()) / (2.0 * link.mass))
        if radius > WIDE * size > 0.0:
            warn(
                f"link {name!r} has a radius of gyration of {radius:.3g} m in a robot of {size:.3g} m: "
                "inertias are in kg m^2, lengths in m",
                InertiaWarning,
            )


def _mimic(joint: Element, joints: dict[str, Element]) -> Mimic | None:
    """The joint that another one follows; None for one that is fixed."""
    if joint.text("type") == "fixed":
        return None
    follower, name, ratio, offset = joint, joint.text("name"), 1.0, 0.0
    behind: list[str] = []  # leaders that follow others; a circle is for the linkage to tell
    while (mimic := follower.one("mimic")) is not None and (not behind or behind[-1] not in [name, *behind[:-1]]):
        leader = mimic.text("joint")
        if leader not in joints:
            raise mimic.wrong(f"follows the joint {leader!r}, which is not there{meant(leader, joints)}")
        follower = joints[leader]
        if follower.text("type") == "fixed":
            raise mimic.wrong(f"follows the joint {leader!r}, which is fixed; make joint {name!r} fixed too")
        offset, ratio = offset + ratio * mimic.number("offset", 0.0), ratio * mimic.number("multiplier", 1.0)
        behind.append(leader)
    return Mimic(name, behind[-1], ratio, offset)


def _rotors(robot: Element, joints: dict[str, Element], armature: Any) -> dict[str, float]:
    """The armatures of joints: those that are given, by names or for all, before those of the file, the
    inertia of a rotor times the square of its gear's ratio.
    """
    armatures: dict[str, float] = {}
    for transmission in robot.some("transmission"):
        for element in transmission.some("actuator"):
            rotor, gear = element.one("drake:rotor_inertia"), element.one("drake:gear_ratio")
            held = None if rotor is None else transmission.one("joint")  # others may have two, as differentials do
            if rotor is not None and held is not None:
                ratio = 1.0 if gear is None else gear.number("value")
                armatures[held.text("name")] = rotor.number("value") * ratio * ratio
    for name in armatures.keys() - joints.keys():
        raise robot.wrong(f"has a rotor at the joint {name!r}, which is not there")
    turning = [name for name, element in joints.items() if element.text("type") in GEARED]
    if isinstance(armature, Mapping):
        for name in armature:
            if name not in turning:
                raise InvalidInput(
                    f"Linkage.from_urdf: armature names {name!r}, which is no joint with one coordinate"
                    f"{meant(name, turning)}"
                )
        return armatures | {name: float(x) for name, x in armature.items()}
    return armatures if armature is None else dict.fromkeys(turning, float(armature))


def _within(joints: dict[str, Element], numbered: list[str], force: Any) -> Any:
    """A motor or a controller, within the limits of the file.  numbered : the names of the joints, by number."""
    unlimited = isinstance(force, (JointPotential, Damper, DryFriction, Limited))
    if unlimited or not isinstance(force, JointForce):
        return force
    at = force.joint
    name = at if isinstance(at, str) else numbered[at] if 0 <= at < len(numbered) else None
    if name not in joints:
        return force
    joint = joints[name]
    limit = joint.one("limit")
    if limit is None or joint.text("type") not in GEARED:
        return force
    effort, speed = limit.number("effort"), limit.number("velocity")
    if not (effort > 0.0 and speed > 0.0):
        raise limit.wrong(
            f"of joint {name!r} has effort={effort:g} and velocity={speed:g}, by which {force!r} "
            "moves nothing; write what the drive can do, or leave limits= out"
        )
    return Limited(force.joint, force, effort, speed, freedom=force.freedom)


def _joint(joint: Element, ends: Any, R: np.ndarray, rotors: dict[str, float]) -> Any:
    """The joint of a link, whose frame is turned by R in the zero position."""
    kind, name, axis = joint.text("type"), joint.text("name"), joint.one("axis")
    joint_type: Any = {"floating": FloatingJoint, "prismatic": PrismaticJoint, "planar": PlanarJoint}
    joint_type = joint_type.get(kind, RevoluteJoint)
    if kind == "floating":
        return joint_type(*ends, name=name)
    along = np.array([1.0, 0.0, 0.0]) if axis is None else axis.numbers("xyz", 3, [1.0, 0.0, 0.0])
    if not along.any():
        raise joint.wrong("has an axis without a direction")
    along = (R @ along / np.linalg.norm(along)).tolist()
    axes = [along] * (1 if kind == "prismatic" else 2)
    if kind == "planar":
        return joint_type(*ends, *axes, name=name)
    return joint_type(*ends, *axes, armature=rotors.get(name, 0.0), name=name)


def _forces(joint: Element, stops: float | None, speed: float) -> list[Any]:
    """The damper, the dry friction and the stops of a joint."""
    name, forces = joint.text("name"), []  # type: Any, list[Any]
    dynamics, limit = joint.one("dynamics"), joint.one("limit")
    if dynamics is not None:
        damping, friction = dynamics.number("damping", 0.0), dynamics.number("friction", 0.0)
        if min(damping, friction) < 0.0:
            raise dynamics.wrong("has negative damping or friction, which would drive the joint")
        forces += [Damper(name, damping)] if damping else []
        forces += [DryFriction(name, friction, speed)] if friction else []
    if stops is not None and limit is not None and joint.text("type") in ("revolute", "prismatic"):
        low, high = limit.number("lower", 0.0), limit.number("upper", 0.0)
        if not low < high:
            raise limit.wrong(f"of joint {name!r} has lower = {low:g}, upper = {high:g}")
        if joint.text("type") == "revolute" and high - low >= 2.0 * np.pi:
            raise limit.wrong(
                f"of joint {name!r} goes from {low:g} to {high:g} rad: poses do not tell angles a whole "
                'turn apart; make the joint type="continuous", or leave stops= out'
            )
        forces += [Stops(name, low, high, stops)]
    return forces


# ------------------------------------------------------------------ shapes


class _Files:
    """Where mesh files are, and those that are not there, or lie outside of the folders of the robot: that of
    the URDF file, the one above it, and those of packages.
    """

    def __init__(self, folder: Path, packages: Mapping[str, Any] | None) -> None:
        self.folder, self.missing, self.outside = folder, [], []  # type: Any, list[str], list[str]
        self.packages = {name: Path(path) for name, path in (packages or {}).items()}
        self.of_ros = [Path(path) for path in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if path]
        home = Path.home()  # neither it nor what it lies in belongs to a robot
        self.above = [folder, *[path for path in folder.resolve().parents if not home.is_relative_to(path)]]

    def find(self, name: str) -> str | None:
        """A file by its name: beside the URDF file, file:// or package://."""
        head, scheme, tail = name.partition("://")
        if scheme and head != "file":
            package, _, inside = tail.partition("/")
            roots = [self.packages[package]] if package in self.packages else []
            roots += [folder for folder in self.above if folder.name == package]
            roots += [folder / package for folder in self.above]
            roots += [folder / package for folder in self.of_ros]
            places = [(root / inside, [root]) for root in roots]
        else:
            place = Path(tail) if scheme else self.folder / name
            places = [(place, [*self.above[:2], *self.packages.values(), *self.of_ros])]
        for place, roots in places:
            if place.is_file():
                if any(place.resolve().is_relative_to(root.resolve()) for root in roots):
                    return str(place)
                self.outside.append(name)
                return None
        self.missing.append(name)
        return None


def _shapes(
    robot: Element,
    links: dict[str, Element],
    poses: dict[str, np.ndarray],
    bodies: dict[str, int | None],
    files: _Files,
) -> list[LinkShape]:
    """The visual geometry of all links.  What is wrong with it is warned of: the motion does not need it."""
    materials = {material.attributes.get("name"): material for material in robot.some("material")}
    shapes: list[LinkShape] = []
    wrong: list[str] = []
    for name in links:
        for visual in links[name].some("visual"):
            color = None
            try:
                color = _color(visual, materials)
            except InvalidInput as refused:
                wrong.append(f"{refused}: it has no colour of its own")
            try:
                geometry = visual.one("geometry")
                if geometry is None or len(geometry.inside) != 1:
                    raise visual.wrong(f"of link {name!r} must have one <geometry> with one shape in it")
                shape = _shape(geometry.inside[0], files)
                if shape is not None:
                    kind, size, file = shape
                    pose = poses[name] @ _origin(visual)
                    shapes.append(LinkShape(kind, bodies[name], pose.tolist(), size, color, file))
            except InvalidInput as refused:
                wrong.append(f"{refused}: it is not shown")
    if wrong:
        suffix = f"; and {len(wrong) - TOLD} more" if len(wrong) > TOLD else ""
        warn(f"{'; '.join(wrong[:TOLD])}{suffix}", FileWarning)
    if files.outside:
        warn(
            f"meshes outside of the folders of the robot are not read: {', '.join(sorted(set(files.outside)))}. "
            'packages={"name": "folder"} names a folder that may be read',
            FileWarning,
        )
    if files.missing:
        warn(
            f"meshes that are not there are not shown: {', '.join(sorted(set(files.missing)))}. "
            'packages={"name": "folder"} tells where package://name is',
            FileWarning,
        )
    return shapes


def _color(visual: Element, materials: dict[str | None, Element]) -> str | None:
    """The colour of a visual, "#rrggbb", its own or that of a material of the robot."""
    material = visual.one("material")
    if material is not None and material.one("color") is None:
        material = materials.get(material.attributes.get("name"))
    color = None if material is None else material.one("color")
    if color is None:
        return None
    parts = np.clip(color.numbers("rgba", 4), 0.0, 1.0)[:3]
    return "#" + "".join(f"{round(255 * x):02x}" for x in parts)


def _shape(element: Element, files: _Files) -> tuple[str, list[float], str | None] | None:
    """Kind, size and file of a geometry; None: its mesh is not there."""
    if element.tag == "mesh":
        file = files.find(element.text("filename"))
        scale = element.numbers("scale", 3, np.ones(3)).tolist()
        return None if file is None else ("mesh", scale, file)
    if element.tag == "box":
        size = element.numbers("size", 3).tolist()
    elif element.tag in ("cylinder", "capsule"):
        width = 2.0 * element.number("radius")
        size = [width, width, element.number("length")]
    elif element.tag == "sphere":
        size = [2.0 * element.number("radius")] * 3
    else:
        raise element.wrong("is no shape; URDF has box, cylinder, sphere, mesh")
    if not min(size) > 0.0:
        raise element.wrong("must have positive lengths")
    kind = {"box": "box", "sphere": "ball"}.get(element.tag, "cylinder")
    return kind, size, None
