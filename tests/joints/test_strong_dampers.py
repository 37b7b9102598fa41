"""Dampers stronger than an explicit half kick can resolve are refused, and motors at their rated speed hold it.

The wheel and its damping are those of a published robot (hello-robot-stretch-urdf): 5.1e-5 kg m^2, 21.75 N m s;
I w' = -c w, so that w = w0 exp(-c t/I).
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import liemech as lm
from liemech.compiler import kernel
from liemech.formulas import tanh
from liemech.joints import (  # fmt: skip
    BallJoint,
    Damper,
    DryFriction,
    JointForce,
    Limited,
    Link,
    Linkage,
    Motor,
    PlanarJoint,
    PrismaticJoint,
    RevoluteJoint,
    Spring,
)
from liemech.solvers import newton_of_kicks

UP, ACROSS, ORIGIN = [0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.0]
INERTIA, DAMPING = 5.1e-5, 21.75
native = pytest.mark.skipif(kernel.available() is not None, reason="needs llvmlite")
BOTH = [False, pytest.param(True, marks=native)]
NATIVE_LATER = [False, pytest.param(True, marks=[native, pytest.mark.slow])]


def wheel(*forces: Any, inertia: float = INERTIA, **of_joint: Any) -> Linkage:
    hinge = RevoluteJoint(0, None, ORIGIN, ORIGIN, UP, UP, name="wheel", **of_joint)
    return Linkage([Link(0.2, [inertia] * 3)], [hinge], gravity=0.0, forces=forces)


def longest(error: Any) -> tuple[float, float]:
    """The ratio that a refusal tells, and the longest step."""
    found = re.search(r"c h/\(2 I\) is (\S+), .* Steps may be (\S+) long", str(error.value))
    assert found is not None, error.value
    return float(found[1]), float(found[2])


@lm.record
class Viscous(DryFriction):
    """Friction that grows with the rate, whose base declares that it resists no kick."""

    def effort(self, t: float, q: float, rate: float) -> float:
        return -(self.torque / self.speed * rate)


def test_friction_that_is_written_anew_is_damping_again() -> None:
    system = wheel(Viscous("wheel", DAMPING, 1.0))
    start = system.state(angles={}, rates={"wheel": 1.0})
    with pytest.raises(lm.errors.NoConvergence, match="joint 'wheel'") as told:
        lm.integrate(system, lm.LieRATTLE(), start, h=1e-3, steps=100, compiled=False)
    assert longest(told)[0] == pytest.approx(DAMPING * 1e-3 / (2.0 * INERTIA), rel=1e-3)


@pytest.mark.parametrize("how", NATIVE_LATER)
def test_a_damper_that_throws_a_wheel_back_is_refused(how: bool) -> None:
    system = wheel(Damper("wheel", DAMPING))
    start = system.state(angles={}, rates={"wheel": 1.0})
    with pytest.raises(lm.errors.NoConvergence, match="joint 'wheel'") as told:
        lm.integrate(system, lm.LieRATTLE(), start, h=1e-3, steps=100, compiled=how)
    ratio, h = longest(told)
    assert ratio == pytest.approx(DAMPING * 1e-3 / (2.0 * INERTIA), rel=1e-3)
    assert h == pytest.approx(2.0 * INERTIA / DAMPING, rel=5e-3)
    assert len(told.value.trajectory) == 1


@pytest.mark.slow
def test_shorter_steps_give_the_exponential() -> None:
    system = wheel(Damper("wheel", DAMPING))
    start, h = system.state(angles={}, rates={"wheel": 1.0}), 0.02 * INERTIA / DAMPING
    moved = lm.integrate(system, lm.LieRATTLE(), start, h=h, steps=1000, compiled=False).joint("wheel")
    assert np.abs(moved.rate - np.exp(-DAMPING * h * np.arange(1001) / INERTIA)).max() < 2e-5
    assert moved.angle[-1] == pytest.approx(INERTIA / DAMPING, rel=2e-4)
    assert moved.work[-1] == pytest.approx(-0.5 * INERTIA, rel=1e-3)


def test_a_motor_from_rest_under_a_strong_damper_is_refused() -> None:
    system = wheel(Damper("wheel", DAMPING), Motor("wheel", 1.0))
    with pytest.raises(lm.errors.NoConvergence, match="joint 'wheel'"):
        lm.integrate(system, lm.LieRATTLE(), system.state(angles={}), h=1e-3, steps=3, compiled=False)


def test_a_rotor_counts_as_inertia() -> None:
    geared, bare = (wheel(Damper("wheel", DAMPING), armature=x) for x in (0.02, 0.0))
    start = geared.state(angles={}, rates={"wheel": 1.0})
    moved = lm.integrate(geared, lm.LieRATTLE(), start, h=1e-3, steps=2, compiled=False)
    ratio = DAMPING * 1e-3 / (2.0 * (INERTIA + 0.02))
    rates = ((1.0 - ratio) / (1.0 + ratio)) ** np.arange(3)
    assert moved.joint("wheel").rate == pytest.approx(rates, rel=1e-12)
    with pytest.raises(lm.errors.NoConvergence, match="c h/"):
        lm.integrate(bare, lm.LieRATTLE(), bare.state(angles={}, rates={"wheel": 1.0}), h=1e-3, steps=1, compiled=False)
    with pytest.raises(lm.errors.NoConvergence, match="c h/") as told:
        lm.integrate(geared, lm.LieRATTLE(), start, h=2e-3, steps=1, compiled=False)
    assert longest(told)[1] == pytest.approx(2.0 * (INERTIA + 0.02) / DAMPING, rel=5e-3)


def test_a_slider() -> None:
    system = Linkage(
        [Link(0.01, [1e-5] * 3)],
        [PrismaticJoint(0, None, ORIGIN, ORIGIN, UP, name="slide")],
        gravity=0.0,
        forces=[Damper("slide", 50.0)],
    )
    start = system.state(angles={}, rates={"slide": 1.0})
    with pytest.raises(lm.errors.NoConvergence, match="joint 'slide'") as told:
        lm.integrate(system, lm.LieRATTLE(), start, h=1e-2, steps=4, compiled=False)
    assert longest(told)[1] == pytest.approx(2.0 * 0.01 / 50.0, rel=5e-3)


def seen_inertia(system: Linkage, start: Any, joint: int) -> float:
    """A unit torque over the acceleration of a joint at rest, by the reduced equation."""
    pushed, dim = Linkage(system.links, system.joints, 0.0, forces=[Motor(joint, 1.0)]), len(start.mu)
    still = pushed.state(np.zeros(dim), start.g)
    speed = pushed.velocity(lm.vec(*pushed.rate(0.0, still)[dim:]))
    one, two = system.joints[joint].motions(*poses(system, start, joint))[0]
    return 1.0 / float(np.dot(one, speed[6 * joint : 6 * joint + 6]) + np.dot(two, speed[6 * joint - 6 : 6 * joint]))


def poses(system: Linkage, start: Any, joint: int) -> Any:
    found = system.poses(np.array(start.g))
    return tuple(lm.mat(*[lm.vec(*row) for row in found[b].tolist()]) for b in (joint, joint - 1))


@pytest.mark.parametrize("count", [2, 4])
@pytest.mark.parametrize("composed", [False, True])
def test_in_a_chain_the_inertia_is_that_which_the_joint_feels(count: int, composed: bool) -> None:
    links = [Link(1.0 + 0.1 * k, [0.1, 0.12, 0.15]) for k in range(count)]
    joints = [RevoluteJoint(0, None, [0, 0, 0.5], ORIGIN, ACROSS, ACROSS)] + [
        RevoluteJoint(k, k - 1, [0, 0, 0.5], [0, 0, -0.5], ACROSS, ACROSS) for k in range(1, count)
    ]
    system = Linkage(links, joints, 0.0, forces=[Damper(count - 1, 1.0)])
    start = system.state(angles={0: 0.4, count - 1: 0.7}, rates={0: 1e-3})
    h, method = 2.0 * seen_inertia(system, start, count - 1), lm.LieRATTLE()  # type: float, Any
    if composed:
        method = lm.Composition(method, order=4)
        h = h / max(abs(share) for share in method.tableau.gamma)
    lm.integrate(system, method, start, h=0.999 * h, steps=1, compiled=False)
    with pytest.raises(lm.errors.NoConvergence, match=f"joint {count - 1}"):
        lm.integrate(system, method, start, h=1.001 * h, steps=1, compiled=False)
    if composed and count == 4:
        with pytest.raises(lm.errors.NoConvergence) as told:
            lm.integrate(system, method, start, h=2.0 * h, steps=1, compiled=False)
        assert longest(told)[1] == pytest.approx(h, rel=5e-3)  # of whole steps, not of the parts of a composition


def test_light_parts_are_seen_beside_heavy_ones() -> None:
    # A wrist of 1e-5 kg m^2 behind an arm that a motor swings: its energy is nothing beside that of the arm.
    system = Linkage(
        [Link(5.0, [1.0, 1.0, 1.0]), Link(1e-3, [1e-5] * 3), Link(1e-3, [1e-5] * 3)],
        [
            RevoluteJoint(0, None, [0, 0, 0.5], ORIGIN, ACROSS, ACROSS),
            RevoluteJoint(1, 0, ORIGIN, [0, 0, -0.5], UP, UP, name="wrist"),
            BallJoint(2, 1, ORIGIN, ORIGIN, name="finger"),
        ],
        forces=[Motor(0, 30.0), Damper("wrist", 0.05)],
    )
    with pytest.raises(lm.errors.NoConvergence, match="joint 'wrist'"):
        lm.integrate(system, lm.LieRATTLE(), system.state(angles={0: 1.0}), h=1e-3, steps=3, compiled=False)


@lm.record
class Friction(lm.Force):
    """Friction, and a force across the velocity that does no work."""

    damping: float
    across: float

    def covector(self, t: float, xi: lm.Vec, g: Any) -> lm.Vec:
        turned = lm.vec(-xi[1], xi[0], 0.0)
        return self.across * turned - self.damping * xi


@pytest.mark.parametrize("how", BOTH)
@pytest.mark.parametrize("method", [lm.LieVerlet(), lm.KickDrift()])
def test_loads_on_free_bodies(method: Any, how: bool) -> None:
    body = lm.MechanicalSystem(lm.RigidBody([1e-3] * 3), lm.NoPotential(), load=Friction(1.0, 0.0))
    start = body.state(xi=[0.0, 0.0, 1.0], g=np.eye(3))
    with pytest.raises(lm.errors.NoConvergence, match="Friction") as told:
        lm.integrate(body, method, start, h=1e-2, steps=3, compiled=how)
    assert longest(told) == pytest.approx((5.0, 2e-3), rel=5e-3)
    moved = lm.integrate(body, method, start, h=1e-5, steps=100, compiled=how)
    assert moved.mu[-1, 2] == pytest.approx(1e-3 * np.exp(-1.0), rel=1e-4)
    magnetic = lm.MechanicalSystem(lm.RigidBody([1e-3] * 3), lm.NoPotential(), load=Friction(0.0, 1.0))
    start = magnetic.state(xi=[1.0, 0.0, 0.0], g=np.eye(3))
    turned = lm.integrate(magnetic, method, start, h=1e-2, steps=3, compiled=how)
    assert len(turned) == 4  # it only turns the velocity, however strong


@pytest.mark.slow
@pytest.mark.parametrize("count", [2, 6])
def test_loads_on_sites(count: int) -> None:
    load = lm.PerSite(Friction(1.0, 0.0))
    body = lm.MechanicalSystem(
        lm.LiePoissonSystem(lm.SO3() ** count, lm.PerSite(lm.KineticEnergy([1e-3] * 3))), lm.NoPotential(), load=load
    )
    start = body.state(xi=np.ones((count, 3)), g=np.tile(np.eye(3), (count, 1, 1)))
    with pytest.raises(lm.errors.NoConvergence, match="c h/"):
        lm.integrate(body, lm.KickDrift(), start, h=1e-2, steps=3, compiled=False)
    moved = lm.integrate(body, lm.KickDrift(), start, h=1e-5, steps=100, compiled=False)
    assert np.ravel(moved.mu[-1]) == pytest.approx(1e-3 * np.exp(-1.0), rel=1e-4)


def test_damping_of_rods() -> None:
    # every frame is slowed by -c J xi, so that the ratio is c h/2 for all of them
    rod = lm.models.CosseratRod(lm.models.RodSection.round(0.02, 1e6, 1000.0), 1.0, 4, damping=3.0)
    start = rod.at_rest()
    with pytest.raises(lm.errors.NoConvergence, match=r"c h/\(2 I\) is 1.5,.* 0.667 long"):
        lm.integrate(rod, lm.KickDrift(), start, h=1.0, steps=1, compiled=False)


@lm.record
class Hold(JointForce):
    """A controller with damping of its own."""

    stiffness: float
    damping: float

    def effort(self, t: float, q: float, rate: float) -> float:
        return -self.stiffness * q - self.damping * rate


@pytest.mark.slow
def test_controllers_are_dampers_and_dry_friction_is_none() -> None:
    system = wheel(Hold("wheel", 1.0, 0.5), inertia=1e-4)
    with pytest.raises(lm.errors.NoConvergence, match="joint 'wheel'") as told:
        lm.integrate(system, lm.LieRATTLE(), system.state(angles={"wheel": 0.1}), h=1e-3, steps=3, compiled=False)
    assert longest(told)[0] == pytest.approx(2.5, rel=1e-3)
    # friction that stops a wheel at any speed of its regularisation, and one cut at a limit
    for force in (DryFriction("wheel", 0.02, 1e-6), Limited("wheel", Hold("wheel", 0.0, 50.0), 0.02)):
        rubbed = wheel(force, Spring("wheel", 1e-3), inertia=0.01)
        start = rubbed.state(angles={}, rates={"wheel": 1.0})
        steps = 400 if isinstance(force, DryFriction) else 40
        assert len(lm.integrate(rubbed, lm.LieRATTLE(), start, h=1e-3, steps=steps, compiled=False)) == steps + 1


@pytest.mark.slow
@pytest.mark.parametrize("how", BOTH)
def test_a_motor_holds_its_rated_speed(how: bool) -> None:
    # rate = torque t/I up to the speed, beyond which the first kick may carry it by half of what a step adds
    for inertia, h in ((0.02, 1e-3), (0.01, 1e-3), (0.009, 1e-3), (0.005, 1e-3), (0.002, 1e-3), (0.002, 2.5e-4)):
        system = wheel(Limited("wheel", Motor("wheel", 1.0), 21.0, 8.0), inertia=inertia)
        steps = round(0.3 / h)
        moved = lm.integrate(system, lm.LieRATTLE(), system.state(angles={}), h=h, steps=steps, compiled=how)
        rate, t = moved.joint("wheel").rate, moved.t
        free = t < 7.9 * inertia - h
        assert np.abs(rate[free] - t[free] / inertia).max() < 1e-12
        held = rate[t > 8.0 * inertia + 20.0 * h]
        assert np.all(held >= 8.0 - 1e-3) and np.ptp(held) < 1e-3
        assert rate.max() <= 8.0 + 0.5 * h / inertia


def motors_in_a_row(torque: float, speed: float, limit: float = 97.0) -> Linkage:
    links = [Link(1.0, [0.01, 0.01, 0.01])] + [Link(0.1, [0.001, 0.001, 0.001]) for _ in range(3)]
    joints = [RevoluteJoint(k, None if k == 0 else k - 1, ORIGIN, ORIGIN, UP, UP) for k in range(4)]
    return Linkage(links, joints, 0.0, forces=[Limited(k, Motor(k, torque), limit, speed) for k in range(4)])


@pytest.mark.slow
@pytest.mark.parametrize("how", BOTH)
@pytest.mark.parametrize("torque", [0.1, 1.0])
def test_motors_in_a_row_hold_their_speeds(torque: float, how: bool) -> None:
    # beyond its speed a rate is carried by half of what a motor adds to it in a step, by the bodies beside it, at most
    system = motors_in_a_row(torque, 2.0)
    steps = 200 if how else 25  # the last one reaches its speed in ten
    moved = lm.integrate(system, lm.LieRATTLE(), system.state(angles={}), h=1e-3, steps=steps, compiled=how)
    for k in range(4):
        assert moved.joint(k).rate.max() < 2.0 + 0.5e-3 * torque / 0.001


@pytest.mark.slow
def test_motors_in_a_row_speed_up_as_one_differential_equation_says() -> None:
    # about one axis: J W' = T(w) - T(w of the next), with w the rates of joints and W those of bodies
    system, inertia = motors_in_a_row(0.1, 2.0, 0.1), np.array([0.01, 0.001, 0.001, 0.001])

    def accelerations(t: float, whole: Any) -> Any:
        torques = 0.1 * np.clip(10.0 * (1.0 - np.diff(whole, prepend=0.0) / 2.0), 0.0, 1.0)
        return (torques - np.append(torques[1:], 0.0)) / inertia

    moved = lm.integrate(system, lm.LieRATTLE(), system.state(angles={}), h=2.5e-4, steps=100, compiled=False)
    exact = solve_ivp(accelerations, (0.0, 0.025), np.zeros(4), "DOP853", moved.t, rtol=1e-9, atol=1e-12, max_step=1e-3)
    for k, rate in enumerate(np.diff(exact.y, axis=0, prepend=0.0)):
        assert moved.joint(k).rate == pytest.approx(rate, abs=2e-3 * 2.0)


@pytest.mark.slow
@pytest.mark.parametrize("count", [2, 6, 10])
def test_rates_to_which_kicks_lead_that_fall_with_them(count: int) -> None:
    # w = w0 + R k(w), R positive and k_i falling: of motors at their speeds, and of friction; there is exactly one w
    random = np.random.default_rng(count)
    for _ in range(12):
        half = random.normal(size=(count, count))
        R = lm.mat(*[lm.vec(*row) for row in (half @ half.T * 10.0 ** random.uniform(-3.0, 1.0)).tolist()])
        torques, speeds = (10.0 ** random.uniform(-1.0, 1.0, count) for _ in range(2))
        rubs, free = random.integers(0, 2, count), lm.vec(*random.normal(size=count).tolist())

        def kick(i: int, w: Any) -> Any:
            if rubs[i]:  # noqa: B023
                return DryFriction(0, float(torques[i]), 1e-4).effort(0.0, 0.0, w)  # noqa: B023
            return Limited(0, Motor(0, float(torques[i])), 97.0, float(speeds[i])).effort(0.0, 0.0, w)  # noqa: B023

        def kicks(w: Any) -> Any:
            return lm.vec(*[kick(i, w[i]) for i in range(count)])

        def led_to(k: Any) -> Any:
            found = free + R @ k  # noqa: B023
            return found, lm.dot(free, free) + lm.dot(found, found)  # noqa: B023

        w, size, enough = newton_of_kicks(kicks, led_to, free)
        assert size <= enough
        off = np.array(w) - np.array(led_to(kicks(w))[0])
        scale = np.abs(np.array(R)) @ np.abs(np.array(kicks(w))) + np.abs(np.array(free))
        slope = 1.0 + np.abs(np.array(R)).sum() * np.max(np.where(rubs > 0, torques / 1e-4, 10.0 * torques / speeds))
        assert np.max(np.abs(off) / scale) < 1e-14 * slope


@pytest.mark.slow
@pytest.mark.parametrize("count", [2, 3])
def test_an_ensemble_runs_and_ends_where_one_of_it_would_be_thrown_back(count: int) -> None:
    # free wheels on one axis, each with its own damper: I w' = -c w, ((1 - x)/(1 + x))^n with x = c h/(2 I)
    links = [Link(1.0, [0.1, 0.1, 0.1]) for _ in range(count)]
    joints = [RevoluteJoint(k, None, ORIGIN, [float(k), 0.0, 0.0], UP, UP) for k in range(count)]
    for damping in (1.0, 50.0):
        system = Linkage(links, joints, 0.0, forces=[Damper(k, damping) for k in range(count)])
        starts = [system.state(angles={}, rates={0: rate}) for rate in (1.0, -2.0, 3.0)]
        several = system.state(np.stack([one.mu for one in starts]), np.stack([one.g for one in starts]))
        if damping > 20.0:
            with pytest.warns(RuntimeWarning, match="throws back"):
                ran = lm.integrate(system, lm.LieRATTLE(), several, h=0.02, steps=5, compiled=False)
            assert np.all(ran.mu[-1] == ran.mu[0])
        else:
            ran = lm.integrate(system, lm.LieRATTLE(), several, h=0.02, steps=5, compiled=False)
            x = damping * 0.02 / (2.0 * 0.1)
            rates = np.array([1.0, -2.0, 3.0]) * ((1.0 - x) / (1.0 + x)) ** 5
            assert ran.mu[-1].reshape(3, -1)[:, 2] == pytest.approx(0.1 * rates, rel=1e-12)


@lm.record
class Rubs(lm.Force):
    """Friction that is bounded, and says so."""

    torque: float
    speed: float

    def covector(self, t: float, xi: lm.Vec, g: Any) -> lm.Vec:
        return lm.vec(*[-self.torque * tanh(x / self.speed) for x in xi])

    def resistance(self, t: float, xi: lm.Vec, g: Any, along: lm.Vec) -> lm.Vec:
        return 0.0 * along


@lm.record
class RubsThere(lm.Term):
    """As a term of one site."""

    torque: float
    speed: float

    def covector(self, t: float, a: Any) -> lm.Vec:
        return lm.vec(*[-self.torque * tanh(x / self.speed) for x in a.xi])

    def resistance(self, t: float, along: lm.Vec, a: Any) -> lm.Vec:
        return 0.0 * along


@lm.record
class Slows(lm.Term):
    damping: float

    def covector(self, t: float, a: Any) -> lm.Vec:
        return -self.damping * a.xi


RUBBING = [
    lm.PerSite(Rubs(0.03, 0.01)),
    lm.Terms(lm.PerSite(Rubs(0.03, 0.01)), Slows(0.5)),
    lm.Terms(RubsThere(0.03, 0.01)),
    lm.Terms(RubsThere(0.03, 0.01), lm.PerSite(Friction(0.5, 0.0))),
]


def rubbed(load: Any, count: int, h: float, how: bool) -> Any:
    """Wheels of 0.01 kg m^2 that turn about their third axes, and creep."""
    body = lm.MechanicalSystem(
        lm.LiePoissonSystem(lm.SO3() ** count, lm.PerSite(lm.KineticEnergy([1e-2] * 3))), lm.NoPotential(), load=load
    )
    start = body.state(xi=np.outer(np.ones(count), [0.0, 0.0, 1e-3]), g=np.tile(np.eye(3), (count, 1, 1)))
    return lm.integrate(body, lm.KickDrift(), start, h=h, steps=4, compiled=how)


@pytest.mark.parametrize("how", NATIVE_LATER)
@pytest.mark.parametrize("load", RUBBING, ids=lambda load: repr(load)[:30])
def test_loads_on_sites_say_themselves_what_damps(load: Any, how: bool) -> None:
    count = 2
    # T/speed h/2 is one and a half times the inertia; kicks are (h/2) F(w) and then the root of w' - w'' = (h/2) F(w'')/I
    c, h = (0.0 if "0.5" not in repr(load) else 0.5), 1e-2

    def kick(w: float) -> float:
        return -0.5 * h * (0.03 * np.tanh(w / 0.01) + c * w) / 1e-2

    rates = [1e-3]
    for _ in range(4):
        w = rates[-1] + kick(rates[-1])
        rates = [*rates, brentq(lambda x, w=w: x - w - kick(x), -1.0, 1.0, xtol=1e-16)]
    moved = rubbed(load, count, h, how).mu.reshape(5, count, 3)
    assert moved[:, :, 2] == pytest.approx(np.outer(1e-2 * np.array(rates), np.ones(count)), rel=1e-9)


@lm.record
class Between(lm.Term):
    """Bounded friction between two masses."""

    torque: float

    def covector(self, t: float, a: Any, b: Any) -> lm.Vec:
        return lm.vec(-self.torque * tanh((a.xi[0] - b.xi[0]) / 0.01))

    def resistance(self, t: float, along: lm.Vec, a: Any, b: Any) -> lm.Vec:
        return 0.0 * along


@lm.record
class Nothing(lm.Term):
    def energy(self, a: Any, b: Any) -> float:
        return 0.0 * a.g[0] * b.g[0]


@pytest.mark.parametrize("small", [0, lm.System.small])
def test_friction_between_sites_says_itself_what_damps(small: int, monkeypatch: pytest.MonkeyPatch) -> None:
    # two masses with w and -w: a kick is (h/2) T tanh(2 w/0.01), whose slope is 1.25; the end is a root, as above
    monkeypatch.setattr(lm.System, "small", small)
    pair, h = lm.neighbours.chain(2), 0.1
    free = lm.LiePoissonSystem(lm.VectorSpace(1) ** 2, lm.PerSite(lm.KineticEnergy([1.0])))
    system = lm.MechanicalSystem(free, lm.Terms(Nothing().over(pair)), load=lm.Terms(Between(0.125).over(pair)))
    start = system.state(mu=[[1e-3], [-1e-3]], g=np.zeros((2, 1)))
    moved = lm.integrate(system, lm.KickDrift(), start, h=h, steps=1, compiled=False).mu[-1]
    w = 1e-3 - 0.5 * h * 0.125 * np.tanh(0.2)
    w = brentq(lambda x: x - w + 0.5 * h * 0.125 * np.tanh(2.0 * x / 0.01), -1.0, 1.0, xtol=1e-18)
    assert np.ravel(moved) == pytest.approx([w, -w], rel=1e-9)


def test_of_a_sum_what_says_nothing_still_counts() -> None:
    with pytest.raises(lm.errors.NoConvergence, match=r"c h/\(2 I\) is 5,"):
        rubbed(lm.Terms(RubsThere(0.1, 0.01), lm.PerSite(Rubs(0.1, 0.01)), Slows(10.0)), 2, 1e-2, False)


@pytest.mark.parametrize("base", [lm.Force, JointForce, lm.Term])
def test_a_field_with_the_name_of_what_the_library_calls_is_refused(base: Any) -> None:
    @lm.record
    class Drag(base):  # type: ignore[misc]
        resistance: float

    with pytest.raises(lm.errors.InvalidType, match=r"Drag\.resistance is a field"):
        Drag(resistance=0.3)


def test_a_ratio_is_told_where_metres_and_radians_are_far_apart():
    """Two rods of 1 nm, one askew on the other, on a plane, damped by 0.1 in N s/m and N m s: c h/2 is 0.00025 of the mass,
    and 1e16 times the moment about their common centre.
    """
    size = 2.0**-30
    links = [Link(1.0, size**2 * np.array([0.09, 0.1, 0.02]))] * 2
    top, bottom = [0.0, 0.0, 0.5 * size], [0.0, 0.0, -0.5 * size]
    joints = [PlanarJoint(0, None, ORIGIN, ORIGIN, UP, UP), RevoluteJoint(1, 0, top, bottom, ACROSS, ACROSS)]
    system = Linkage(links, joints, forces=[Damper(0, 0.1)])
    start = system.state(angles={1: 0.15}, rates={1: -0.5})
    sine2 = np.sin(0.15) ** 2
    moment = size**2 * (0.02 + 0.02 * (1.0 - sine2) + 0.09 * sine2 + 0.5 * 0.25 * sine2)
    told = f"joint 0: c h/(2 I) is {0.5 * 0.1 * 0.01 / moment:.4g}"
    with pytest.raises(lm.errors.NoConvergence, match=re.escape(told)):
        lm.integrate(system, lm.LieRATTLE(), start, h=0.01, steps=1, compiled=False)
