"""Situations in which users of other viewers saw something else than the motion: repository and number of each
report; what is drawn is compared with the states.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import liemech as lm
from liemech.viewer import Motion, Scene
from liemech.viewer.page import described

BODY = lm.RigidBody([1.0, 2.0, 3.0])


def turning(angles: Any, axis: Any = (0.0, 0.0, 1.0)) -> Motion:
    """A body that turns about an axis by these angles, one a second."""
    attitudes = Rotation.from_rotvec(np.outer(angles, axis)).as_matrix()
    return Motion(BODY, np.arange(float(len(angles))), {"mu": np.tile(axis, (len(angles), 1)), "g": attitudes})


def moving(scene: Any, ending: str, channel: str) -> Any:
    """What moves of the node whose path ends so, in units of its panel."""
    (found,) = [
        node.moving[channel] for panel in scene.panels() for path, node in panel.nodes.items() if path.endswith(ending)
    ]
    return found


def nodes(scene: Any) -> dict[str, Any]:
    return {path.partition("/")[2]: node for panel in scene.panels() for path, node in panel.nodes.items()}


def orbit(scale: float = 1.0, centre: Any = (0.0, 0.0, 0.0)) -> Motion:
    """A body on a circle of this radius about a centre."""
    at = np.linspace(0.0, 6.0, 61)
    system = lm.MechanicalSystem(
        lm.LiePoissonSystem(lm.SE3(), lm.KineticEnergy([1.0, 1.0, 1.0, 1.0, 1.0, 1.0])), lm.NoPotential()
    )
    poses = np.tile(np.eye(4), (61, 1, 1))
    poses[:, :3, 3] = np.asarray(centre) + scale * np.stack([np.cos(at), np.sin(at), 0.3 * np.sin(2.0 * at)], axis=1)
    return Motion(system, at, {"mu": np.zeros((61, 6)), "g": poses})


@pytest.mark.parametrize("axis", [(0.0, 0.0, 1.0), (0.6, 0.0, -0.8), (-2 / 3, 1 / 3, 2 / 3)])
def test_attitudes_are_those_of_the_states_over_many_turns(axis: Any) -> None:
    """KhronosGroup/glTF-Sample-Models#185, CueMol/cuemol2#102, CesiumGS/cesium#1342: a motion went the long way round
    where the quaternion came back with the other sign.
    """
    angles = np.radians(40.0) * np.arange(40)
    scene = Scene(turning(angles, axis), show="body")
    q = moving(scene, "run 1/body", "quaternion")
    assert (
        np.abs(Rotation.from_quat(q).as_matrix() - Rotation.from_rotvec(np.outer(angles, axis)).as_matrix()).max()
        < 1e-14
    )
    signs = np.sign((q[1:] * q[:-1]).sum(axis=1))[:, None]
    halfway = q[1:] * signs + q[:-1]
    halfway /= np.linalg.norm(halfway, axis=1)[:, None]
    truth = Rotation.from_rotvec(np.outer(0.5 * (angles[1:] + angles[:-1]), axis)).as_matrix()
    assert np.abs(Rotation.from_quat(halfway).as_matrix() - truth).max() < 1e-14
    assert described(scene)["joined"] == [True]


def test_turns_of_more_than_half_a_circle_between_samples_are_not_invented() -> None:
    """mrdoob/three.js#13756: keys more than half a turn apart were joined by another motion."""
    scene = described(Scene(turning(np.radians(200.0) * np.arange(20)), show="body"))
    assert scene["joined"] == [False] and "degrees apart" in scene["notes"][0]


@pytest.mark.parametrize("scale", [1e-9, 1e-3, 1e6, 1e12])
def test_a_scene_of_any_size_fills_its_picture(scale: float) -> None:
    """rdeits/MeshCat.jl#165, awslabs/iot-app-kit#304, mikedh/trimesh#571: scenes in millimetres or kilometres were out of
    sight.
    """
    small, large = Scene(orbit()), Scene(orbit(scale))
    one, other = nodes(small), nodes(large)
    assert set(one) == set(other)
    moved = 0
    for path, node in one.items():
        for channel, values in node.moving.items():
            if channel in ("position", "cloud") and "axis" not in path:
                assert np.allclose(values, other[path].moving[channel], rtol=0.0, atol=1e-9), path
                assert np.abs(values).max() < 1.5
                moved += 1
    assert moved


def test_a_scene_far_from_the_origin_does_not_tremble() -> None:
    """pyvista/pyvista#1445, Tumiz/py3d#87: objects far away vanished, or shook by the rounding of single precision."""
    here, there = Scene(orbit()), Scene(orbit(centre=(3e8, -2e8, 1e8)))
    one = {path: node for path, node in nodes(here).items() if "position" in node.moving}
    other = nodes(there)
    assert one
    for path, node in one.items():
        a, b = node.moving["position"], other[path].moving["position"]
        assert np.allclose(np.diff(a, axis=0), np.diff(b, axis=0), rtol=0.0, atol=1e-6)


@pytest.mark.parametrize(("length", "plays"), [(2.0, 5.0), (8.0, 8.0), (300.0, 15.0)])
def test_a_scene_plays_in_real_time_where_one_can_look_so_long(length: float, plays: float) -> None:
    """pydy/pydy#26, tsoding/multik#23, ihmcrobotics/ihmc-open-robotics-software#111: ten seconds did not last ten
    seconds.
    """
    start = BODY.state(mu=np.array([0.3, 1.0, 0.2]) / length, g=np.eye(3))  # slow: samples far apart take their time
    run = lm.integrate(BODY, lm.RKMK(order=4), start, h=length / 100, steps=100, compiled=False)
    scene = Scene(run)
    assert scene.duration == pytest.approx(length, rel=1e-14) and scene.seconds == pytest.approx(plays, rel=1e-14)


def test_uneven_samples_are_shown_at_their_times() -> None:
    """anitagraser/TimeManager#251, tsoding/multik#23: every picture stood for as long as any other."""
    at = np.array([0.0, 0.1, 0.2, 1.7, 1.8, 5.0])
    motion = Motion(
        BODY,
        at,
        {
            "mu": np.tile([0.0, 0.0, 1.0], (6, 1)),
            "g": Rotation.from_rotvec(np.outer(0.1 * at, [0.0, 0.0, 1.0])).as_matrix(),
        },
    )
    (clock,) = described(Scene(motion))["clocks"]
    assert np.array_equal(clock, at)


def test_shapes_of_a_robot_stand_where_its_frames_say() -> None:
    """stack-of-tasks/pinocchio#1471: visual shapes were placed by another frame than the one of their link."""
    robot = lm.joints.Linkage.from_urdf(
        """<robot name="one"><link name="wall"/>
        <link name="arm"><inertial><origin xyz="0 0 -0.5"/><mass value="2"/><inertia ixx="0.2" iyy="0.2" izz="0.01"/></inertial>
        <visual><origin xyz="0.1 0 -0.7" rpy="0 0.5 0"/><geometry><sphere radius="0.1"/></geometry></visual></link>
        <joint name="hinge" type="continuous"><parent link="wall"/><child link="arm"/><axis xyz="0 1 0"/>
        <origin xyz="0.3 0.2 1" rpy="0 0 0.4"/></joint></robot>"""
    )
    run = lm.integrate(robot, lm.LieRATTLE(), robot.state(angles={"hinge": 1.1}), h=0.02, steps=5, compiled=False)
    scene = Scene(run)
    (panel,) = scene.panels()
    expected = [panel.inside((robot.frame("arm", g) @ [0.1, 0.0, -0.7, 1.0])[:3]) for g in run.g]
    link, shape = (panel.nodes[f"panel 1/run 1/link 1{name}"] for name in ("", "/shape 1"))
    carried = Rotation.from_quat(link.moving["quaternion"]).apply(shape.still["position"])
    assert np.abs(link.moving["position"] + carried - expected).max() < 1e-12


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_state_without_a_number_is_named_and_not_drawn(bad: float) -> None:
    """rdeits/MeshCat.jl#165, mikedh/trimesh#571: a blank page, and no word why."""
    momenta = np.tile([0.0, 0.0, 1.0], (4, 1))
    momenta[2, 1] = bad
    with pytest.raises(lm.errors.InvalidInput, match="mu"):
        Motion(BODY, np.arange(4.0), {"mu": momenta})


@pytest.mark.parametrize("samples", [1, 2])
def test_a_run_of_a_single_sample_is_a_picture(samples: int) -> None:
    """d4vid87/hookecho#249, photopea/photopea#5266: films of few pictures, which divide by the time between them."""
    scene = Scene(turning(np.zeros(samples)))
    shown = described(scene)
    assert shown["duration"] == samples - 1.0 and scene.seconds >= 1.0
    assert all(
        np.isfinite(np.asarray(track["values"], dtype=float)).all() for track in shown["tracks"] if "values" in track
    )


def test_a_small_orbit_beside_a_large_one_is_in_the_picture() -> None:
    """design-automation/mobius-parametric-modeller#189: objects vanished beside a very large one."""
    scene = Scene(orbit(1e6), name="large").add(orbit(), name="small")
    shown = [
        node.moving["position"]
        for panel in scene.panels()
        for node in panel.nodes.values()
        if "position" in node.moving
    ]
    assert len(shown) >= 2 and all(np.abs(places).max() < 1.5 for places in shown)
    assert max(np.ptp(places, axis=0).max() for places in shown) > 0.5
