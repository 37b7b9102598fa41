"""Linkages and rolling bodies in pictures: joints stay together, boxes have the size of the bodies,
rods keep their length.
"""

from __future__ import annotations

import struct
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.command_line.scenes import SCENES
from liemech.errors import FileWarning, InvalidInput
from liemech.models.even_boxes import principal_box
from liemech.viewer import Links, Motion, Scene

library: Any = lm


def rods(count: int = 3) -> Motion:
    """Poses of a chain whose joints hold, at four times; no equation is solved."""
    chain, rng = library.joints.chain(count, length=0.8), np.random.default_rng(3)
    poses = np.tile(np.eye(4), (4, count, 1, 1))
    for pose in poses:
        top = np.zeros(3)
        for link in pose:
            link[:3, :3] = lm.SO3().exp(rng.normal(size=3))
            link[:3, 3] = top - 0.4 * link[:3, 2]
            top = top - 0.8 * link[:3, 2]
    return Motion(chain, np.arange(4.0), {"g": poses.reshape(4, -1)})


def test_joints_of_two_bodies_are_in_one_place() -> None:
    (panel,) = Scene(rods()).panels()
    nodes = {path.partition("run 1/")[2]: node for path, node in panel.nodes.items()}

    ends = nodes["joints"].moving["cloud"]  # of each joint two
    assert ends.shape == (4, 6, 3) and np.abs(ends[:, ::2] - ends[:, 1::2]).max() < 1e-14
    support = panel.inside(np.zeros(3))
    assert np.abs(ends[:, 0] - support).max() < 1e-14
    arms = nodes["arms"].moving  # from the centres of mass
    assert arms["cloud"] + arms["vectors"] == pytest.approx(ends[:, 1:], abs=1e-14)
    inside = np.concatenate([node.moving["position"] for node in nodes.values() if "position" in node.moving])
    assert np.linalg.norm(inside, axis=1).max() < 1.0
    assert len(nodes["trail"].moving["reveal"]) == 4


def test_the_box_of_a_link_has_its_size() -> None:
    edges, mass = np.array([0.3, 0.5, 0.9]), 2.5
    J = mass * ((edges**2).sum() - edges**2) / 12.0
    R = np.array(lm.SO3().exp([0.4, -0.3, 0.5]))
    assert principal_box(lm.joints.Link(mass, J))[1] == pytest.approx(edges, rel=1e-14)
    axes, found = principal_box(lm.joints.Link(mass, R @ np.diag(J) @ R.T))
    assert np.sort(found) == pytest.approx(edges, rel=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1.0) and axes * found**2 @ axes.T == pytest.approx(R * edges**2 @ R.T)
    assert principal_box(lm.joints.Link.rod(1.3, 0.8, 0.05))[1][2] == pytest.approx(0.8, rel=1e-14)


def test_a_linkage_with_shapes_shows_these(tmp_path: Path) -> None:
    corners = struct.pack("<12fH", 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0)
    (tmp_path / "part.stl").write_bytes(bytes(80) + struct.pack("<I", 1) + corners)
    at, turned = np.eye(4), np.eye(4)
    at[:3, 3], turned[:3, :3] = [0.1, 0.2, 0.3], lm.SO3().exp([0.0, 0.0, 0.5])
    shapes = [
        library.joints.LinkShape("box", 0, at, [0.2, 0.4, 0.6], "#102030"),
        library.joints.LinkShape("mesh", 1, turned, [0.1, 0.1, 0.2], file=str(tmp_path / "part.stl")),
        library.joints.LinkShape("cylinder", None, at, [0.3, 0.3, 0.5]),
        library.joints.LinkShape("ball", 2, np.eye(4), [0.3, 0.3, 0.3]),
    ]
    bare = rods()
    motion = Motion(replace(bare.system, shapes=shapes), bare.t, bare.states)
    scene = Scene(motion)
    (panel,) = scene.panels()
    nodes = {path.partition("run 1/")[2]: node for path, node in panel.nodes.items()}
    box = nodes["link 1/shape 1/box"].shape.three("x")["geometries"][0]
    assert box["depth"] * panel.unit == pytest.approx(0.6)
    assert nodes["link 1/shape 1"].still["position"] * panel.unit == pytest.approx(at[:3, 3])
    mesh = nodes["link 2/shape 2/mesh"].shape
    assert mesh.known["sizes"] * panel.unit == pytest.approx([0.1, 0.1, 0.2])
    place = nodes["ground"].still["position"] + nodes["ground/shape 3"].still["position"]
    assert place == pytest.approx(panel.inside(at[:3, 3]))
    assert "link 3/shape 4/ball" in nodes and not any("even" in path for path in nodes)
    scene.save(tmp_path / "page.html")


def test_rods_of_a_four_bar_linkage_keep_their_length_and_stand_on_their_supports() -> None:
    scene = SCENES["four-bar"]()
    run = lm.integrate(scene.system, scene.method, scene.start, h=scene.h, steps=20, compiled=False)
    (panel,) = Scene(run).panels()
    rods = panel.nodes["panel 1/run 1/rods"]
    lengths = np.linalg.norm(rods.moving["vectors"], axis=-1)
    assert lengths.shape == (21, 5) and np.ptp(lengths) < 1e-12  # equal, and never change
    starts = rods.moving["cloud"]
    for k in range(3):
        pivot = panel.nodes[f"panel 1/shared/pivot {k + 1}"].still["position"]
        assert (starts[:, k] == pivot).all()


@pytest.mark.parametrize("name", ["sleigh", "rolling-ball"])
def test_bodies_under_conditions_have_pictures(name: str) -> None:
    scene = SCENES[name]()
    run = lm.integrate(scene.system, scene.method, scene.start, h=scene.h, steps=4, compiled=False)
    (panel,) = Scene(run).panels()
    own = {"sleigh": "body/blade", "rolling-ball": "body/ellipsoid"}[name]
    assert {f"panel 1/run 1/{own}", "panel 1/run 1/path"} <= set(panel.nodes)
    assert panel.known["floor"] is not False


def test_the_path_of_a_linkage_is_that_of_its_bodies() -> None:
    pytest.importorskip("matplotlib")
    chain = library.joints.chain(2)
    poses = np.tile(np.eye(4), (2, 1, 1))
    poses[:, 2, 3] = -0.5, -1.5
    start = chain.assembled(poses, [[1.0, 0.0, 0.0, 0.0, 0.5, 0.0], [0.0, 2.0, 0.0, 0.0, 0.0, 0.0]])
    run = lm.integrate(chain, lm.LieRATTLE(), start, h=0.01, steps=3, compiled=False)
    shadows_and_paths = [line for line in lm.plots.plot(run).lines if len(line.get_xdata()) == 4]
    assert len(shadows_and_paths) == 4


def test_what_is_no_linkage_is_refused() -> None:
    body = lm.RigidBody([1.0, 1.5, 2.0])
    free = Motion(body, [0.0], {"mu": np.ones((1, 3)), "g": np.eye(3)[None]})
    with pytest.raises(InvalidInput, match="Links shows bodies that joints hold together"):
        Scene(free, show="links")
    with pytest.raises(InvalidInput, match="trail = 5 is not there; the linkage has 3 bodies"):
        Scene(rods(), show=Links(trail=5))
    assert not any("trail" in path for path in Scene(rods(), show=Links(trail=None)).panels()[0].nodes)


def test_a_joint_in_a_given_motion_is_where_its_first_body_is() -> None:
    rod = library.joints.chain(1, axis=[0.0, 1.0, 0.0])
    shaken = library.joints.Shaking([0.0, 0.0, 0.1], 20.0)
    pendulum = library.joints.Linkage(rod.links, rod.joints, motions={None: shaken})
    start = pendulum.state(angles={0: 3.0})
    run = lm.integrate(pendulum, lm.LieRATTLE(), start, h=0.01, steps=6, compiled=False)
    (panel,) = Scene(run).panels()
    (joints,) = [node for path, node in panel.nodes.items() if path.endswith("/joints")]
    found = joints.moving["cloud"][:, 0]
    wanted = panel.inside(np.array([[0.0, 0.0, 0.1 * np.sin(20.0 * t)] for t in run.t]))
    assert np.abs(found - wanted).max() < 1e-12


ONE_TRIANGLE = bytes(80) + struct.pack("<I", 1) + struct.pack("<12fH", 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0)
COLLADA = """<?xml version="1.0" encoding="iso-8859-1"?><COLLADA><asset><author>\u00e9</author></asset>
<library_geometries><geometry id="g"><mesh><triangles count="0"/></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"/></library_visual_scenes></COLLADA>"""
MESHES = {
    "good.stl": (ONE_TRIANGLE, ""),
    "words.stl": (b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n", ""),
    "pointer.stl": (b"version https://git-lfs.github.com/spec/v1\noid sha256:0000\nsize 12\n", "pointer of Git LFS"),
    "empty.stl": (b"", "no STL file of triangles"),
    "cut.stl": (ONE_TRIANGLE[:-1], "no STL file of triangles"),
    "latin.obj": ("# \u00e9\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n".encode("latin-1"), ""),
    "points.obj": (b"v 0 0 0\nv 1 0 0\n", "no OBJ file of faces"),
    "latin.dae": (COLLADA.encode("latin-1"), ""),
    "no_scene.dae": (b'<?xml version="1.0"?><COLLADA></COLLADA>', "no COLLADA file with a scene"),
    "no_xml.dae": (b"<COLLADA>", "is no XML"),
    "part.glb": (b"glTF", "must be a file that ends in"),
    "missing.stl": (None, "cannot be read"),
}


@pytest.mark.parametrize("name", MESHES)
def test_a_mesh_that_is_none_is_named_and_the_others_are_shown(tmp_path: Path, name: str) -> None:
    content, reason = MESHES[name]
    if content is not None:
        (tmp_path / name).write_bytes(content)
    motion, pose = rods(2), np.eye(4).tolist()
    shapes = [
        library.joints.LinkShape("mesh", 0, pose, [1.0, 1.0, 1.0], file=str(tmp_path / name)),
        library.joints.LinkShape("box", 1, pose, [0.1, 0.2, 0.3]),
    ]
    motion = replace(motion, system=replace(motion.system, shapes=shapes))
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        (panel,) = Scene(motion).panels()
    nodes = {path.partition("run 1/")[2] for path, node in panel.nodes.items() if node.shape is not None}
    assert "link 2/shape 2/box" in nodes
    assert ("link 1/shape 1/mesh" in nodes) is (reason == "")
    assert [(one.category, name in str(one.message), reason in str(one.message)) for one in told] == (
        [(FileWarning, True, True)] if reason else []
    )
