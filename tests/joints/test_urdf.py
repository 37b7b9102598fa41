"""Robots from URDF files: the same frames, bodies and accelerations as other readers find, and clear
errors for what is wrong in a file.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.errors import FileWarning, InertiaWarning, InvalidInput, InvalidType
from liemech.joints import Damper, DryFriction, FloatingJoint, JointForce, Linkage, Stops

library: Any = lm
PUMA = Path(__file__).parent.parent.parent / "examples" / "puma560.urdf"
ANGLES = {"waist": 0.2, "shoulder": 0.4, "elbow": -0.7}
ANGLES |= {"wrist roll": 0.3, "wrist pitch": 0.8, "flange": 0.1}
RATES = {"waist": 1.0, "elbow": -0.5, "wrist pitch": 2.0}

INERTIAL = (
    '<inertial><origin xyz="{}" rpy="{}"/><mass value="{}"/>'
    '<inertia ixx="0.03" iyy="0.04" izz="0.05" ixy="0.004" ixz="-0.003" iyz="0.002"/></inertial>'
)
CRANE = f"""<robot name="crane">
  <link name="floor"/>
  <link name="cart">{INERTIAL.format("0.1 0 0.2", "0.1 0.2 0.3", 3)}</link>
  <link name="lift">{INERTIAL.format("0 0.1 0", "0 0 0", 2)}</link>
  <link name="boom">{INERTIAL.format("0.3 0.1 -0.1", "1 0 0", 1)}</link>
  <link name="hook">{INERTIAL.format("0 0 -0.4", "0 0.5 0", 0.5)}</link>
  <link name="load">{INERTIAL.format("0.1 0 0", "0 0 2", 1.5)}</link>
  <joint name="wheels" type="ROOT"><parent link="floor"/><child link="cart"/>
    <origin xyz="0 0 0.3"/><axis xyz="0 0 1"/></joint>
  <joint name="mast" type="prismatic"><parent link="cart"/><child link="lift"/>
    <origin xyz="0.1 0.2 0.5" rpy="0.3 -0.2 0.1"/><axis xyz="0 1 2"/>
    <limit lower="-0.5" upper="1" effort="1" velocity="1"/></joint>
  <joint name="slew" type="revolute"><parent link="lift"/><child link="boom"/>
    <origin xyz="0 0 0.4" rpy="0 0.7 0.2"/><axis xyz="1 0 1"/>
    <limit lower="-1" upper="2" effort="1" velocity="1"/><dynamics damping="0.7"/></joint>
  <joint name="weld" type="fixed"><parent link="boom"/><child link="hook"/>
    <origin xyz="0.8 0 0" rpy="0 -0.4 0"/></joint>
  <joint name="swivel" type="continuous"><parent link="hook"/><child link="load"/>
    <origin xyz="0 0.1 -0.6" rpy="0.2 0.1 -0.3"/></joint>
</robot>"""


def accelerations(robot: Linkage, start: Any) -> dict[str, np.ndarray]:
    """Of all joints, by the rates a step before and after, h and 2 h, which leaves h^4."""
    found = []
    for h in (1e-3, 2e-3):
        ends = []
        for way in (h, -h):
            run = lm.integrate(robot, lm.LieRATTLE(), start, h=way, steps=1, compiled=False)
            ends.append([run.joint(j).rate[-1] for j in range(len(robot.joints))])
        found.append([(a - b) / (2.0 * h) for a, b in zip(*ends)])
    return {str(joint.name): np.array((4.0 * one - two) / 3.0) for joint, one, two in zip(robot.joints, *found)}


def test_frames_of_the_puma_are_those_of_denavit_and_hartenberg() -> None:
    """T_i = R_z(q_i) T_z(d_i) T_x(a_i) R_x(alpha_i), the parameters of Corke and Armstrong-Helouvry."""
    arm = Linkage.from_urdf(PUMA)
    assert [joint.name for joint in arm.joints] == list(ANGLES)
    here = np.eye(4)
    here[2, 3] = 0.6718
    turn = np.pi / 2
    table = [(0, 0, turn), (0, 0.4318, 0), (0.15005, 0.0203, -turn), (0.4318, 0, turn)]
    for q, (d, a, alpha) in zip(ANGLES.values(), [*table, (0, 0, -turn), (0.105, 0, 0)]):
        for axis, angle, shift in ((2, q, [0, 0, d]), (0, alpha, [a, 0, 0])):
            step = np.eye(4)
            step[:3, :3] = lm.SO3().exp(angle * np.eye(3)[axis])
            step[:3, 3] = shift
            here = here @ step
    start = arm.state(angles=ANGLES)
    assert arm.frame("tip", start.g) == pytest.approx(here, abs=1e-14)
    assert arm.frame("base", [start.g] * 2).shape == (2, 4, 4)
    with pytest.raises(InvalidInput, match=r"no frame 'tio'.*did you mean tip"):
        arm.frame("tio", start.g)


@pytest.mark.slow
def test_accelerations_of_the_puma_are_those_of_pinocchio() -> None:
    arm = Linkage.from_urdf(PUMA)
    found = accelerations(arm, arm.state(angles=ANGLES, rates=RATES))
    assert [found[name] for name in ANGLES] == pytest.approx(PUMA_ABA, abs=2e-6 * 35.0)


@pytest.mark.slow
def test_accelerations_of_every_kind_of_joint_are_those_of_pinocchio() -> None:
    q = {"wheels": [0.0, 0.0, 0.0], "mast": 0.2, "slew": 0.4, "swivel": -0.6}
    v = {"wheels": [0.3, -0.2, 0.5], "mast": -0.4, "slew": 0.7, "swivel": 1.1}
    crane = Linkage.from_urdf(CRANE.replace("ROOT", "planar"), gravity=9.81)
    assert len(crane.links) == 4  # boom and hook are one
    found = accelerations(crane, crane.state(angles=q, rates=v))
    assert np.concatenate([np.ravel(x) for x in found.values()]) == pytest.approx(PLANAR_ABA, rel=2e-6)
    q["wheels"], v["wheels"] = [0.0] * 6, [0.2, -0.1, 0.4, 0.3, -0.2, 0.5]
    for flies in (
        Linkage.from_urdf(CRANE.replace("ROOT", "floating"), gravity=9.81),
        Linkage.from_urdf(CRANE.replace("ROOT", "fixed"), floating=True, gravity=9.81),
    ):
        root = flies.joints[0]
        assert isinstance(root, FloatingJoint)
        angles, rates = ({root.name if name == "wheels" else name: x for name, x in some.items()} for some in (q, v))
        found = accelerations(flies, flies.state(angles=angles, rates=rates))
        turning = [*found[str(root.name)][:3], *[found[n] for n in ("mast", "slew", "swivel")]]
        assert turning == pytest.approx(FLOATING_ABA, rel=2e-6)


@pytest.mark.slow
@pytest.mark.compiled
def test_the_puma_moves_as_in_mujoco_to_the_order_of_the_method() -> None:
    arm = Linkage.from_urdf(PUMA)
    start = arm.state(angles=ANGLES, rates=RATES)
    for method, steps, order, least in (
        (lm.LieRATTLE(), (1000, 2000), 2, 5e-5),
        (lm.Composition(lm.LieRATTLE(), order=4), (500, 1000), 4, 5e-9),
    ):
        errors = []
        for n in steps:
            run = lm.integrate(arm, method, start, h=0.5 / n, steps=n, every=n, progress=False)
            ends = [run.joint(name).angle[-1] for name in ANGLES]
            errors.append(np.abs(np.array(ends) - PUMA_MUJOCO).max())
        assert errors[1] < least and np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.1)


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("root", ["planar", "floating"])
def test_native_code_of_joints_with_few_conditions_is_the_plain_formula(root: str) -> None:
    crane = Linkage.from_urdf(CRANE.replace("ROOT", root))
    start = crane.state(angles={"slew": 0.4}, rates={"swivel": 1.1})
    one, other = (lm.integrate(crane, lm.LieRATTLE(), start, h=0.01, steps=3, compiled=way) for way in (True, False))
    assert np.array_equal(one.mu, other.mu) and np.array_equal(one.g, other.g)


GRIPPER = f"""<robot name="gripper">
  <link name="palm"/>
  <link name="left">{INERTIAL.format("0 0.1 0", "0 0 0", 0.2)}</link>
  <link name="right">{INERTIAL.format("0 -0.1 0", "0 0 0", 0.2)}</link>
  <joint name="grip" type="revolute"><parent link="palm"/><child link="left"/>
    <axis xyz="1 0 0"/><limit lower="0" upper="1" effort="3" velocity="2"/></joint>
  <joint name="other" type="revolute"><parent link="palm"/><child link="right"/>
    <axis xyz="1 0 0"/><limit lower="-1" upper="0" effort="3" velocity="2"/>
    <mimic joint="grip" multiplier="-1" offset="0.1"/></joint>
  <transmission name="drive"><joint name="grip"/><actuator name="motor">
    <drake:rotor_inertia value="2e-5"/><drake:gear_ratio value="50"/></actuator></transmission>
</robot>"""


@pytest.mark.slow
def test_a_gripper_with_a_motor_that_drives_both_fingers() -> None:
    forces = [lm.joints.Motor("grip", 8.0), Damper("other", 0.1)]
    hand = Linkage.from_urdf(GRIPPER, forces=forces, limits=True, gravity=0.0)
    assert [joint.armature for joint in hand.joints] == [0.05, 0.0]
    motor = lm.joints.Limited("grip", lm.joints.Motor("grip", 8.0), 3.0, 2.0)
    assert hand.forces == (motor, forces[1])
    by_number = Linkage.from_urdf(GRIPPER, forces=[lm.joints.Motor(0, 8.0)], limits=True)
    assert by_number.forces == (lm.joints.Limited(0, lm.joints.Motor(0, 8.0), 3.0, 2.0),)
    start = hand.state(angles={"grip": 0.2})
    run = lm.integrate(hand, lm.LieRATTLE(), start, h=0.002, steps=30, compiled=False)
    grip, other = run.joint("grip"), run.joint("other")
    assert np.abs(other.angle - (0.1 - grip.angle)).max() < 1e-14
    # both fingers turn about the axis with J, and the motor turns them: (2 J + A) q'' = 3 - c q'
    one = np.array(hand.links[0].inertia)[0, 0] + 0.2 * 0.1**2
    total = 2.0 * one + 0.05
    wanted = 30.0 * (1.0 - np.exp(-0.1 / total * run.t))
    assert np.abs(grip.rate - wanted).max() < 1e-6
    with pytest.raises(InvalidInput, match="joint 'other' follows joint 'grip' by gears, and"):
        Linkage.from_urdf(GRIPPER.replace("2e-5", "0"))
    heavy = Linkage.from_urdf(GRIPPER, armature={"grip": 0.3})
    assert [joint.armature for joint in heavy.joints] == [0.3, 0.0]
    with pytest.raises(InvalidInput, match="armature names 'gripp', which is no joint with one"):
        Linkage.from_urdf(GRIPPER, armature={"gripp": 0.3})
    with pytest.raises(InvalidInput, match="'grip' has effort=0 and velocity=2"):
        Linkage.from_urdf(GRIPPER.replace('effort="3"', 'effort="0"'), forces=forces, limits=True)


def test_damping_friction_and_limits_of_the_file() -> None:
    crane = CRANE.replace("ROOT", "fixed").replace('damping="0.7"', 'damping="0.7" friction="0.2"')
    plain = Linkage.from_urdf(crane)
    assert plain.forces == (Damper("slew", 0.7), DryFriction("slew", 0.2, 0.01))
    held = Linkage.from_urdf(crane, stops=1e4, speed=0.1, forces=[Damper("swivel", 0.1)])
    kinds = [Stops("mast", -0.5, 1.0, 1e4), Damper("slew", 0.7), DryFriction("slew", 0.2, 0.1)]
    assert held.forces == (*kinds, Stops("slew", -1.0, 2.0, 1e4), Damper("swivel", 0.1))
    far = crane.replace('lower="-1" upper="2"', 'lower="-6" upper="6"')
    assert Linkage.from_urdf(far)
    with pytest.raises(InvalidInput, match="'slew' goes from -6 to 6 rad"):
        Linkage.from_urdf(far, stops=1.0)


def test_a_robot_may_stand_elsewhere() -> None:
    at = np.eye(4)
    at[:3, :3], at[:3, 3] = lm.SO3().exp([0.4, -0.3, 0.5]), [1.0, 2.0, 3.0]
    one, other = Linkage.from_urdf(PUMA), Linkage.from_urdf(PUMA, at=at)
    here, there = (arm.frame("tip", arm.state(angles=ANGLES).g) for arm in (one, other))
    assert there == pytest.approx(at @ here, abs=1e-14)
    with pytest.raises(InvalidInput, match="at is the pose of the root"):
        Linkage.from_urdf(PUMA, at=2.0 * at)


def test_shapes_and_meshes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    arm = Linkage.from_urdf(PUMA)
    assert [shape.kind for shape in arm.shapes].count("cylinder") == 4
    assert arm.shapes[0].body is None and arm.shapes[0].color == "#40454c"
    corners = struct.pack("<12fH", 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0)
    (tmp_path / "robots" / "urdf").mkdir(parents=True)
    (tmp_path / "robots" / "arm.stl").write_bytes(bytes(80) + struct.pack("<I", 1) + corners)
    visual = '<visual><geometry><mesh filename="{}" scale="0.1 0.1 0.2"/></geometry></visual>'
    names = ["../arm.stl", "package://robots/arm.stl", f"file://{tmp_path}/robots/arm.stl"]
    names += ["package://elsewhere/robots/arm.stl"]
    text = CRANE.replace("ROOT", "fixed").replace(
        '<link name="load">', '<link name="load">' + "".join(map(visual.format, names))
    )
    (tmp_path / "robots" / "urdf" / "crane.urdf").write_text(text)
    crane = Linkage.from_urdf(tmp_path / "robots" / "urdf" / "crane.urdf", packages={"elsewhere": tmp_path})
    files = [Path(str(shape.file)).resolve() for shape in crane.shapes]
    assert files == [tmp_path.resolve() / "robots" / "arm.stl"] * 4
    assert crane.shapes[0].size == lm.vec(0.1, 0.1, 0.2)
    with pytest.warns(FileWarning, match="package://elsewhere/robots/arm.stl.*packages="):
        Linkage.from_urdf(tmp_path / "robots" / "urdf" / "crane.urdf")
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path))
    assert Linkage.from_urdf(text.replace("elsewhere/robots", "robots").replace("../", f"{tmp_path}/robots/"))


LINK = '<link name="a"/><link name="b">' + INERTIAL.format("0 0 0", "0 0 0", 1) + "</link>"
JOINT = '<joint name="j" type="revolute"><parent link="a"/><child link="b"/>{}</joint>'
GOOD = f"<robot>{LINK}{JOINT.format('')}</robot>"
BOMB = '<!DOCTYPE r [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;">]>'
BROKEN = {
    "entities": (BOMB + GOOD, "no document type or entities; delete"),
    "a file of others": ('<!DOCTYPE r SYSTEM "/etc/passwd">' + GOOD, "no document type"),
    "no XML": ("<robot><link></robot>", "is no XML: mismatched tag: line 1"),
    "cut": (GOOD[:150], "is no XML"),
    "two": (GOOD + GOOD, "is no XML: junk"),
    "no robot": ("<sdf/>", "line 1: <sdf> is no robot"),
    "xacro": ('<robot><xacro:include filename="x"/></robot>', "run `xacro"),
    "xacro in numbers": (GOOD.replace('mass value="1"', 'mass value="${m}"'), "run `xacro"),
    "no links": ("<robot/>", "has no links"),
    "no name": (GOOD.replace('link name="a"', "link"), "<link> has no name"),
    "two of a name": (GOOD.replace('name="b"', 'name="a"'), "has the name of the <link> in line 1"),
    "no such link": (GOOD.replace('parent link="a"', 'parent link="A"'), "parent link 'A'.*mean a"),
    "no child": (GOOD.replace('<child link="b"/>', ""), 'name="j"> has the child link \'\''),
    "a circle": (
        GOOD.replace('<link name="a"/>', '<link name="a"/><link name="c"/>').replace(
            'parent link="a"', 'parent link="c"').replace(
            "</robot>", JOINT.replace('"j"', '"k"').replace('"b"', '"c"').replace('"a"', '"b"')
            + "</robot>"),
        "hang from each other in a circle: c, b"),
    "a loop": (GOOD.replace("</robot>", JOINT.replace('"j"', '"k"') + "</robot>"), "'j' does: a URDF is a tree"),
    "several roots": (GOOD.replace("</robot>", '<link name="c"/></robot>'), "several roots.*: a, c"),
    "no type": (GOOD.replace(' type="revolute"', ""), "has no type"),
    "a wrong type": (GOOD.replace("revolute", "Revolute"), "the type 'Revolute'; URDF has revolute"),
    "mimic": (GOOD.replace("</joint>", '<mimic joint="k"/></joint>'), "<mimic> follows the joint 'k'"),
    "mimic of a weld": (
        GOOD.replace('<link name="a"/>', '<link name="c"/><link name="a"/>').replace(
            "</joint>", '<mimic joint="k"/></joint>').replace(
            "</robot>", '<joint name="k" type="fixed"><parent link="c"/><child link="a"/></joint></robot>'),
        "<mimic> follows the joint 'k', which is fixed; make joint 'j' fixed too"),
    "nothing moves": (
        GOOD.replace("revolute", "fixed"),
        r"no joint that moves; all of it falls as one body, lm.models.FallingBody\(\[\[0.03.*, 1.0\)"),
    "nothing there": ("<robot>" + '<link name="a"/></robot>', "has no joint that moves$"),
    "no mass": (GOOD.replace('mass value="1"', 'mass value="0"'), '"b"> moves and has no mass'),
    "no inertial": ("<robot>" + '<link name="a"/><link name="b"/>' + JOINT + "</robot>", "no mass"),
    "negative mass": (GOOD.replace('mass value="1"', 'mass value="-1"'), "a mass is not negative"),
    "no inertia": (GOOD.replace('ixx="0.03"', 'ixx="0"'), "moments of inertia.*must be positive"),
    "half an inertial": (GOOD.replace('<mass value="1"/>', ""), "<mass> and an <inertia>"),
    "no number": (GOOD.replace('ixx="0.03"', 'ixx="0,03"'), 'ixx="0,03", which must be a number'),
    "not finite": (GOOD.replace('ixx="0.03"', 'ixx="nan"'), 'ixx="nan"'),
    "a Python number": (GOOD.replace('ixx="0.03"', 'ixx="1_0"'), 'ixx="1_0"'),
    "two numbers": (GOOD.replace('xyz="0 0 0"', 'xyz="0 0"'), "which must be 3 numbers"),
    "degrees": (GOOD.replace('rpy="0 0 0"', 'rpy="0 0 90"'), "in rad, not in degrees"),
    "no axis": (GOOD.replace("</joint>", '<axis xyz="0 0 0"/></joint>'), "axis without a direction"),
    "two origins": (
        GOOD.replace("</joint>", "<origin/><origin/></joint>"), "second <origin> of one <joint>"),
    "negative damping": (
        GOOD.replace("</joint>", '<dynamics damping="-1"/></joint>'), "would drive the joint"),
}  # fmt: skip


@pytest.mark.parametrize("name", BROKEN)
def test_what_is_wrong_in_a_file_is_said(name: str) -> None:
    text, words = BROKEN[name]
    assert Linkage.from_urdf(GOOD)
    with pytest.raises(InvalidInput, match=words):
        Linkage.from_urdf(text)


BOX = '<geometry><box size="1 1 1"/></geometry>'
ODD_SHAPES = {
    "five numbers": (BOX + '<material name=""><color rgba="0.15 0.15 0.15 0 1"/></material>', "must be 4 numbers", 1),
    "three numbers": (BOX + '<material name=""><color rgba="0.1 0.2 0.3"/></material>', "must be 4 numbers", 1),
    "no shape": ("<geometry/>", "one shape in it", 0),
    "an unknown shape": ("<geometry><cone/></geometry>", "<cone> is no shape", 0),
    "a flat box": ('<geometry><box size="1 1 0"/></geometry>', "positive lengths", 0),
    "a point": ('<geometry><sphere radius="0"/></geometry>', "positive lengths", 0),
    "one scale": ('<geometry><mesh filename="a.stl" scale="0.001"/></geometry>', "must be 3 numbers", 0),
    "degrees": ('<origin rpy="0 0 90"/>' + BOX, "in rad, not in degrees", 0),
}


@pytest.mark.filterwarnings("ignore:meshes that are not there")
@pytest.mark.parametrize("name", ODD_SHAPES)
def test_what_only_the_picture_needs_is_warned_of(name: str) -> None:
    """The motion is that of the file, and the other shapes are shown."""
    visual, words, shown = ODD_SHAPES[name]
    text = GOOD.replace('<link name="a"/>', f'<link name="a"><visual>{visual}</visual><visual>{BOX}</visual></link>')
    with pytest.warns(FileWarning, match=words):
        robot = Linkage.from_urdf(text)
    assert robot.links == Linkage.from_urdf(GOOD).links
    assert [one.kind for one in robot.shapes] == ["box"] * (shown + 1)


def test_a_transmission_of_two_joints_without_a_rotor_is_read() -> None:
    """As of a differential, in the files of TALOS."""
    both = '<transmission name="d"><joint name="j"/><joint name="k"/><actuator name="m"/></transmission></robot>'
    assert Linkage.from_urdf(GOOD.replace("</robot>", both)).joints[0].armature == 0.0


def test_a_body_that_flies_is_told_how_to_be_written() -> None:
    """Links that are welded together are one body, by the sums of their masses and moments."""
    hull = '<inertial><mass value="1"/><inertia ixx="1" iyy="2" izz="2.5"/></inertial>'
    camera = '<inertial><mass value="0.1"/><inertia ixx="1e-3" iyy="1e-3" izz="1e-3"/></inertial>'
    drone = f"""<robot name="drone"><link name="hull">{hull}</link><link name="camera">{camera}</link>
    <joint name="screw" type="fixed"><parent link="hull"/><child link="camera"/><origin xyz="0.1 0 0"/></joint></robot>"""
    free = '<link name="world"/><joint name="free" type="floating"><parent link="world"/><child link="hull"/></joint>'
    arm = 1.0 * 0.1 / 1.1 * 0.1**2  # m1 m2/(m1 + m2) d^2
    for text, options in ((drone, {}), (drone, {"floating": True}), (drone.replace("</robot>", free + "</robot>"), {})):
        with pytest.raises(InvalidInput, match=r"lm\.models\.FallingBody\(.*\)") as refused:
            Linkage.from_urdf(text, **options)
        assert "floating=True" not in str(refused.value)
        told = str(refused.value)
        body = eval(told[told.index("lm.models.FallingBody(") :])
        assert np.allclose(np.array(body.inertia), [1.001, 2.001 + arm, 2.501 + arm], rtol=1e-14)
        assert body.mass == pytest.approx(1.1)


def test_what_is_odd_in_a_file_is_warned_of(tmp_path: Path) -> None:
    with pytest.warns(InertiaWarning, match="no body made of positive masses"):
        Linkage.from_urdf(GOOD.replace('izz="0.05"', 'izz="0.5"'))
    far = GOOD.replace("</joint>", '<origin xyz="0 0 0.3"/></joint>')
    for one, other in (('ixx="0.03"', 'ixx="3e4"'), ('iyy="0.04"', 'iyy="4e4"'), ('izz="0.05"', 'izz="5e4"')):
        far = far.replace(one, other)
    with pytest.warns(InertiaWarning, match="radius of gyration"):
        Linkage.from_urdf(far)
    with pytest.raises(InvalidInput, match=r"'nowhere\.urdf' cannot be read"):
        Linkage.from_urdf("nowhere.urdf")
    with pytest.raises(InvalidType, match="path is a file, or its text"):
        Linkage.from_urdf(3)
    file = tmp_path / "r.urdf"
    file.write_bytes(b'<?xml version="1.0" encoding="utf-16"?>\n'.decode().encode("utf-16") + GOOD.encode("utf-16")[2:])
    assert Linkage.from_urdf(file).joints[0].name == "j"


@library.record
class Follow(JointForce):
    """A controller."""

    stiffness: float
    damping: float
    wanted: float

    def effort(self, t: float, q: float, rate: float) -> float:
        return self.stiffness * (self.wanted - q) - self.damping * rate


@pytest.mark.slow
@pytest.mark.compiled
def test_an_arm_that_a_controller_holds_comes_to_rest_and_stays() -> None:
    """The rates become rounding, and the loads do not."""
    gains = [(2000.0, 150.0), (3000.0, 200.0), (1000.0, 50.0), (5.0, 0.1), (2.0, 0.03), (0.1, 0.004)]
    hold = [Follow(n, k, c, 1.1 * q) for (n, q), (k, c) in zip(ANGLES.items(), gains)]
    arm = Linkage.from_urdf(PUMA, forces=hold)
    run = lm.integrate(arm, lm.LieRATTLE(), arm.state(angles=ANGLES), h=1e-3, steps=6000, every=500, progress=False)
    for name, (k, _) in zip(ANGLES, gains):
        joint = run.joint(name)
        assert abs(joint.rate[-1]) < 1e-12
        assert joint.torque[-1] == pytest.approx(k * (1.1 * ANGLES[name] - joint.angle[-1]), abs=1e-9)
    assert abs(run.joint("shoulder").torque[-1]) > 10.0


# ------------------------------------------------------------------ numbers of others

PUMA_ABA = [-3.597716486277701, -23.165302313193152, 34.943135231807226]
PUMA_ABA += [2.7941594452077023, -27.822533939528036, -0.3615764296724732]
"""Accelerations in rad/s^2, by aba of Pinocchio 4.1 of the same file."""

PLANAR_ABA = [-0.6518557578641798 + 0.5 * 0.2, 0.7564946740075037 + 0.5 * 0.3, 1.7622885283077592]
PLANAR_ABA += [-10.017987016662063, -0.38098137481396915, 0.590475480367648]
FLOATING_ABA = [-0.1997626394486906, -0.06711714251798917, 0.005163769557227672]
FLOATING_ABA += [-0.021662480852451288, -0.13409002268581952, 0.3209360416074314]
"""Of the crane, with its root on a plane, the mast, the slew and the swivel, or free: of that
its angular acceleration. Pinocchio's plane turns with the cart, which adds w x v.
"""

PUMA_MUJOCO = [0.5209627552617115, -0.7246732647814762, -0.9907881140805553]
PUMA_MUJOCO += [0.544837036104637, 1.8100009622700202, 0.1602394816603847]
"""Angles in rad after 0.5 s, by MuJoCo 4.0, RK4 with steps of 0.02 ms, of the same file."""


@pytest.mark.parametrize("begin", ["", "\n\n", "\ufeff", '<?xml version="1.0" encoding="ISO-8859-1"?>\n'])
def test_a_text_has_its_letters_whatever_it_says_of_bytes(begin: str) -> None:
    text = (
        begin
        + """<robot name="r"><link name="wall"/>
<link name="Tür"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>
<joint name="Angel" type="revolute"><parent link="wall"/><child link="Tür"/></joint></robot>"""
    )
    assert [link.name for link in Linkage.from_urdf(text).links] == ["Tür"]
    line = begin.count("\n") + 2
    with pytest.raises(InvalidInput, match=rf"line {line}: <mass> has value="):
        Linkage.from_urdf(text.replace('<mass value="1"/>', '<mass value="x"/>'))


def test_joints_follow_those_that_follow_others() -> None:
    """What follows a joint that follows another one follows that, by both gears: 3 (2 q + 0.1) + 0.2."""
    body = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'
    text = '<robot name="r"><link name="wall"/>'
    for name, parent, mimic in (
        ("a", "wall", ""),
        ("b", "a", '<mimic joint="to a" multiplier="2" offset="0.1"/>'),
        ("c", "b", '<mimic joint="to b" multiplier="3" offset="0.2"/>'),
    ):
        text += f'<link name="{name}">{body}</link><joint name="to {name}" type="continuous"><parent link="{parent}"/>'
        text += f'<child link="{name}"/>{mimic}</joint>'
    robot = Linkage.from_urdf(text + "</robot>", armature={"to a": 0.1})
    assert robot.mimics[0] == lm.joints.Mimic("to b", "to a", 2.0, 0.1)
    assert robot.mimics[1].leader == "to a"
    assert [robot.mimics[1].ratio, robot.mimics[1].offset] == pytest.approx([6.0, 0.5], rel=1e-15)
    circle = text.replace('<child link="a"/>', '<child link="a"/><mimic joint="to c"/>')
    with pytest.raises(InvalidInput, match="let all follow one that leads"):
        Linkage.from_urdf(circle + "</robot>", armature=0.1)


def test_a_root_that_floats_may_have_the_name_of_a_joint() -> None:
    body = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'
    text = f'<robot name="r"><link name="base">{body}</link><link name="arm">{body}</link>'
    text += '<joint name="base" type="continuous"><parent link="base"/><child link="arm"/></joint></robot>'
    robot = Linkage.from_urdf(text, floating=True)
    assert [joint.name for joint in robot.joints] == ["base root", "base"]
    assert type(robot.joints[robot.number("base")]).__name__ == "RevoluteJoint"
