"""Inputs of a stepper: the bits of a system that is made with these values, at every step."""

from __future__ import annotations

import gc
import os
import pickle
import signal
import threading
from typing import Any

import numpy as np
import pytest
from scenes import WORLDS
from scipy.integrate import solve_ivp

import liemech as lm
from liemech.errors import IntegrationFailure, IntegrationInterrupted, InvalidInput
from liemech.rooms.at_work.stepper import BodiesInPlace, BodyInPlace
from liemech.simulation.compiled.parameters import Input

MOMENTS = [1.0, 1.5, 2.0]


@lm.record
class Push(lm.Force):
    """A torque in the body, and one of a spring about e3 in space."""

    torque: Any
    stiffness: float = 0.3

    def covector(self, t: float, xi: Any, g: Any) -> Any:
        torque = self.torque(t) if callable(self.torque) else self.torque
        return torque - self.stiffness * lm.vec(0.0, 0.0, g[0, 1])


def satellite(torque: Any = (0.0, 0.0, 0.0), inertia: Any = MOMENTS) -> Any:
    load = Push(torque if callable(torque) else lm.vec(*torque))
    return lm.MechanicalSystem(lm.RigidBody(inertia), lm.NoPotential(), load=load)


START = satellite().state(xi=[0.3, -0.2, 0.4], g=lm.SO3().exp([0.3, 0.1, -0.2]))
COMMANDS = np.random.default_rng(31).normal(size=(6, 3))


def same(loop: Any, other: Any) -> None:
    """They stand in one state, to the bit."""
    assert loop.t == other.t
    for name, x in other.state.parts.items():
        assert np.array_equal(getattr(loop, name), np.array(x)), name


@pytest.mark.parametrize("method", [lm.RKMK(order=4), lm.LieVerlet(), lm.KickDrift()], ids=lambda m: type(m).__name__)
@WORLDS
def test_steps_are_those_of_the_system_with_these_values(method: Any, compiled: bool) -> None:
    """Methods that carry the state along, and such as carry more: a fresh stepper of the system with
    the command has the same bits; h = 1/64, so that t0 + n h is exact."""
    plan = lm.Plan(satellite(), method, h=2.0**-6, compiled=compiled)
    loop = other = plan.stepper(START)
    for k, torque in enumerate(COMMANDS):
        inertia = MOMENTS if k < 3 else [1.2, 1.4, 1.9]
        more = {"body.inertia": inertia} if k == 3 else {}
        system = satellite(torque, inertia)
        other = plan.replace(system=system).stepper(other.state, other.t)
        loop = plan.stepper(START) if k == 0 else loop
        loop.step(2, torque=torque, **more)
        other.step(2)
        same(loop, other)
    assert isinstance(loop._here, BodyInPlace) == compiled
    assert loop.plan.system == satellite(COMMANDS[-1], [1.2, 1.4, 1.9])
    assert np.array_equal(loop.inputs["load.torque"], COMMANDS[-1])
    run, again = loop.plan.resume(loop, steps=3), pickle.loads(pickle.dumps(loop))
    for one in (loop, again):
        one.step(3)
        assert np.array_equal(run.mu[-1], one.mu) and np.array_equal(run.g[-1], one.g)
        one.step(1, torque=[0.1, 0.0, 0.0])
    same(loop, again)


def test_a_closed_loop_against_scipy() -> None:
    """Held commands are a differential equation from look to look: DOP853 of SciPy solves each."""
    plan = lm.Plan(satellite(), lm.RKMK(order=4), h=0.01, compiled=False)
    loop = plan.stepper(START)
    moments, y = np.array(MOMENTS), np.concatenate([START.mu, np.ravel(START.g)])

    def slope(t: float, y: Any, torque: Any) -> Any:
        mu, g = y[:3], y[3:].reshape(3, 3)
        xi = mu / moments
        spring = np.array([0.0, 0.0, 0.3 * g[0, 1]])
        hat = np.array([[0, -xi[2], xi[1]], [xi[2], 0, -xi[0]], [-xi[1], xi[0], 0]])
        return np.concatenate([np.cross(mu, xi) + torque - spring, (g @ hat).ravel()])

    for _ in range(4):
        torque = -2.0 * y[:3] / moments - 0.5 * np.array([y[10], y[5], y[6]])
        loop.step(5, torque=torque)
        y = solve_ivp(slope, (0, 0.05), y, "DOP853", args=(torque,), rtol=1e-12, atol=1e-13).y[:, -1]
    assert np.abs(loop.mu - y[:3]).max() < 1e-8 and np.abs(loop.g.ravel() - y[3:]).max() < 1e-8


@pytest.mark.slow
@pytest.mark.parametrize("method", [lm.RKMK(order=4), lm.KickDrift()], ids=["RKMK", "KickDrift"])
@WORLDS
def test_every_body_of_an_ensemble_has_its_own(method: Any, compiled: bool) -> None:
    """Shared commands, one for each body, and shared ones again: each body as it is alone."""
    plan = lm.Plan(satellite(), method, h=2.0**-6, compiled=compiled)
    random = np.random.default_rng(5)
    starts = plan.system.state(mu=random.normal(size=(5, 3)), g=np.tile(np.eye(3), (5, 1, 1)))
    loop = plan.stepper(starts)
    alone = [plan.stepper(plan.system.state(mu=m, g=g)) for m, g in zip(starts.mu, starts.g)]
    for k in range(4):
        torque = random.normal(size=(5, 3) if k % 3 else 3)
        loop.step(2, torque=torque)
        for one, u in zip(alone, np.broadcast_to(torque, (5, 3))):
            one.step(2, torque=u)
    assert isinstance(loop._here, BodiesInPlace) == compiled
    assert np.array_equal(loop.mu, [one.mu for one in alone])
    assert np.array_equal(loop.g, [one.g for one in alone])
    assert np.array_equal(loop.plan.resume(loop, steps=2).mu[0], loop.mu)
    with pytest.raises(InvalidInput, match=r"of 5 bodies .* got shape \(3, 5\)"):
        loop.step(1, torque=np.zeros((3, 5)))
    with pytest.raises(InvalidInput, match="must be finite; body 2 has"):
        loop.step(1, torque=np.where(np.arange(5)[:, None] == 2, np.nan, np.ones((5, 3))))


@lm.record
class Fused(lm.Force):
    """A torque that a fuse keeps from being too large."""

    torque: lm.Vec

    def covector(self, t: float, xi: Any, g: Any) -> Any:
        if self.torque[0] > 100.0:
            raise ValueError("the fuse is blown")
        return self.torque


@pytest.mark.slow
@pytest.mark.compiled
def test_a_body_that_fails_leaves_the_others_to_go_on() -> None:
    system = lm.MechanicalSystem(lm.RigidBody(MOMENTS), lm.NoPotential(), load=Fused([0.0] * 3))
    plan = lm.Plan(system, lm.RKMK(order=4), h=2.0**-6, compiled=True)
    loop = plan.stepper(system.state(mu=np.ones((3, 3)) * 0.1, g=np.tile(np.eye(3), (3, 1, 1))))
    torque = np.zeros((3, 3))
    loop.step(2, torque=torque)
    torque[1] = 200.0, 0.0, 0.0
    with pytest.warns(RuntimeWarning, match=r"body 1 .*\n?.*the fuse is blown"):
        loop.step(3, torque=torque)
    alone = plan.stepper(system.state(mu=[0.1, 0.1, 0.1], g=np.eye(3)))
    alone.step(5)
    assert [*loop.stopped] == [1] and np.array_equal(loop.mu[2], alone.mu)
    loop.step(1, torque=np.zeros((3, 3)))
    alone.step(1)
    assert np.array_equal(loop.mu[0], alone.mu) and [*loop.stopped] == [1]
    one = plan.stepper(system.state(mu=[0.1, 0.1, 0.1], g=np.eye(3)))
    with pytest.raises(IntegrationFailure, match="the fuse is blown"):
        one.step(1, torque=[200.0, 0.0, 0.0])
    assert one.steps == 0
    one.step(6, torque=[0.0, 0.0, 0.0])  # another fuse
    assert np.array_equal(one.mu, alone.mu)


@pytest.mark.slow
@pytest.mark.compiled
def test_an_interrupt_keeps_the_steps_of_an_ensemble() -> None:
    """All bodies stand at one step, which is one of the run's, and go on from there."""
    plan = lm.Plan(satellite(), lm.RKMK(order=4), h=0.001, compiled=True)
    mu = np.random.default_rng(8).normal(size=(3000, 3))
    loop = plan.stepper(plan.system.state(mu=mu, g=np.tile(np.eye(3), (3000, 1, 1))))
    loop.step(1)
    over = threading.Event()

    def interrupt() -> None:
        """Ctrl-C, once more if Python has lost one, as in a finaliser."""
        wait = 0.1
        while not over.wait(wait):
            os.kill(os.getpid(), signal.SIGINT)
            wait = 20.0

    interrupting = threading.Thread(target=interrupt)
    interrupting.start()
    with pytest.raises(IntegrationInterrupted, match=r"interrupted after \d+ steps"):
        loop.step(10**7)
    over.set()
    interrupting.join()
    some = plan.stepper(plan.system.state(mu=mu[:2], g=np.tile(np.eye(3), (2, 1, 1))))
    assert loop.steps > 1
    some.step(loop.steps)
    assert np.array_equal(loop.mu[:2], some.mu)


@WORLDS
def test_an_input_that_is_refused_changes_nothing(compiled: bool) -> None:
    plan = lm.Plan(satellite(), lm.RKMK(order=4), h=2.0**-6, compiled=compiled)
    loop = plan.stepper(START)
    loop.step(1, torque=COMMANDS[0])
    before = loop.carry
    for inputs, words in (
        ({"torq": 1.0}, "torq is no parameter of MechanicalSystem .* load.torque, load.stiffness"),
        ({"torque": [1.0, 2.0]}, r"load.torque is of shape \(3,\); got shape \(2,\)"),
        ({"torque": [1.0, np.nan, 2.0]}, "load.torque must be finite"),
        ({"torque": "full"}, r"load.torque is of shape \(3,\); got 'full'"),
        ({"stiffness": [1.0]}, r"load.stiffness is a number; got shape \(1,\)"),
        ({"torque": COMMANDS[1], "inertia": [-1.0, 1.0, 1.0]}, "must be positive"),
        ({"group": 1.0}, "group is no parameter"),
        ({"load": 1.0}, "laid out otherwise"),
    ):
        with pytest.raises(InvalidInput, match=words):
            loop.step(1, **inputs)
        assert loop.steps == 1
    loop.step(2)
    assert np.array_equal(loop.mu, loop.plan.step(before, 2).state.mu)


def test_where_the_numbers_are() -> None:
    """A field that formulas read as it is has places; one from which others follow, or that its class
    looks at, has none, and the system is made anew."""
    system = satellite()
    assert Input(system, "load.torque", "").places is not None
    assert len(Input(system, "load.stiffness", "").places or ()) == 1
    assert Input(system, "body.inertia", "").places is None  # its inverse
    wheels = lm.models.ReactionWheels(np.eye(3), [0.05] * 3, torques=[0.0] * 3)
    craft = lm.models.Spacecraft([10.0, 12.0, 8.0], 100.0, wheels=wheels)
    assert Input(craft, "wheels.torques", "").places is not None
    hinge = lm.joints.RevoluteJoint(0, None, [0.0, 0.0, 0.3], [0.0] * 3, [0.0, 1.0, 0.0], [0.0, 1.0, 0.0], name="elbow")
    forces = [lm.joints.Damper("elbow", 0.1), lm.joints.Motor("elbow", 0.0)]
    arm = lm.joints.Linkage([lm.joints.Link.rod(1.0, 0.6, 0.03)], [hinge], forces=forces)
    assert len(Input(arm, "forces.1.torque", "").places or ()) == 2  # as given, and at its joint
    assert arm.parameter_of_joint("elbow.torque") == ["forces.1.torque"]


def arm(torque: float = 0.0) -> Any:
    turn = [0.0, 1.0, 0.0]
    hinge = lm.joints.RevoluteJoint(0, None, [0.0, 0.0, 0.3], [0.0] * 3, turn, turn, name="elbow")
    forces = [lm.joints.Damper("elbow", 0.1), lm.joints.Motor("elbow", torque)]
    return lm.joints.Linkage([lm.joints.Link.rod(1.0, 0.6, 0.03)], [hinge], forces=forces)


def test_the_motor_of_a_joint_by_its_name() -> None:
    plan = lm.Plan(arm(), lm.LieRATTLE(), h=2.0**-7, compiled=False)
    loop = other = plan.stepper(plan.system.state(angles={"elbow": 0.4}))
    loop.step(1, **{"elbow.torque": 0.0})
    for torque in (0.6, -0.4):
        other = plan.replace(system=arm(torque)).stepper(loop.state, loop.t)
        loop.step(2, **{"elbow.torque": torque})
        other.step(2)
        same(loop, other)
    with pytest.raises(InvalidInput, match=r"knee.torque is no parameter of Linkage .*; there are forces.\d.torque"):
        loop.step(1, **{"knee.torque": 1.0})


@pytest.mark.slow
@WORLDS
def test_tables_and_ramps_are_inputs(compiled: bool) -> None:
    """A table whose numbers and knots change, and a ramp: as systems that are made with them."""
    first = lm.PiecewisePolynomial.linear([0.0, 1.0], np.zeros((2, 3)), outside="hold")
    plan = lm.Plan(satellite(first), lm.RKMK(order=4), h=2.0**-6, compiled=compiled)
    loop = plan.stepper(START)
    for k in range(2):
        table = lm.PiecewisePolynomial.linear([0.0, 0.3, 2.0], COMMANDS[k : k + 3], outside="hold")
        other = plan.replace(system=satellite(table)).stepper(loop.state, loop.t)
        loop.step(3, torque=table)
        other.step(3)
        same(loop, other)
    assert loop._inputs["torque"].places is not None
    ramp = lm.loops.Ramp(COMMANDS[0])
    plan = lm.Plan(satellite(ramp), lm.RKMK(order=4), h=2.0**-6, compiled=compiled)
    loop = plan.stepper(START)
    ramp = lm.loops.Ramp(COMMANDS[1], COMMANDS[2], 0.25)
    other = plan.replace(system=satellite(ramp)).stepper(START)
    loop.step(3, torque=ramp)
    other.step(3)
    same(loop, other)
    loop.step(1, **{"torque.slope": [0.0, 0.0, 1.0]})  # a part of it
    both = plan.system.state(mu=[START.mu] * 2, g=[START.g] * 2)
    many, hold = plan.stepper(both), lm.loops.FirstOrderHold(0.1, first=np.zeros((2, 3)))
    many.step(2, torque=hold(many.t, COMMANDS[:2]))  # a ramp for each body
    one = plan.stepper(START)
    one.step(2, torque=lm.loops.Ramp(COMMANDS[1], COMMANDS[1] / 0.1))
    assert np.array_equal(many.mu[1], one.mu)


@WORLDS
@pytest.mark.parametrize("method", [lm.RKMK(order=4), lm.LieVerlet()], ids=["RKMK", "LieVerlet"])
def test_reset_and_at(method: Any, compiled: bool) -> None:
    plan = lm.Plan(satellite(), method, h=0.05, compiled=compiled)
    loop = plan.stepper(START, t0=2.0)
    loop.step(4, torque=COMMANDS[0])
    before, run = loop.carry, loop.plan.resume(loop, steps=1, t_eval=[2.21])
    inside = loop.at(2.21)
    assert np.array_equal(inside.mu, run.mu[-1]) and loop.steps == 4
    assert np.array_equal(loop.at(loop.t).mu, loop.mu)
    for t in (2.1, 2.3):
        with pytest.raises(InvalidInput, match="not in the step to come"):
            loop.at(t)
    assert loop.carry.step == before.step
    loop.reset()
    assert loop.t == 2.0 and np.array_equal(loop.mu, START.mu)
    loop.step(1)  # without the command
    assert np.array_equal(loop.mu, plan.run(START, steps=1, t0=2.0).mu[-1])
    loop.reset(loop.state, 7.0, torque=COMMANDS[1])
    assert loop.t == 7.0 and loop.steps == 0
    assert np.array_equal(loop.inputs["load.torque"], COMMANDS[1])


@pytest.mark.slow
@pytest.mark.compiled
def test_a_turn_of_a_loop_leaves_nothing_to_collect() -> None:
    loop = lm.Plan(satellite(), lm.RKMK(order=4), h=0.01, compiled=True).stepper(START)
    found = []
    gc.disable()
    try:
        for _ in range(3):  # at first what other tests have left
            for _ in range(300):
                loop.step(1, torque=-loop.mu)
            found.append(gc.collect())
    finally:
        gc.enable()
    assert found[-1] < 100


def test_there_are_no_inputs_in_fictive_time() -> None:
    kepler = lm.Kepler()
    clocked = lm.ReversibleController(lm.StormerVerlet(), lm.time_scales.DistancePower(1.5))
    loop = lm.Plan(kepler, clocked, h=0.05, compiled=False).stepper(kepler.state(q=[0.4, 0.0], p=[0.0, 2.0]))
    with pytest.raises(InvalidInput, match="steps in fictive time take no inputs"):
        loop.step(1, mu=2.0)


# ------------------------------------------------------------------ blocks


def test_a_first_order_hold_joins_commands() -> None:
    """Of commands on a line it is the line; delayed it is the line one period later."""
    line = lambda t: np.array([1.0, -2.0]) + t * np.array([0.5, 3.0])  # noqa: E731
    hold, late = lm.loops.FirstOrderHold(0.1), lm.loops.FirstOrderHold(0.1, delayed=True)
    for k in range(4):
        ramp, delayed = hold(0.1 * k, line(0.1 * k)), late(0.1 * k, line(0.1 * k))
        if k:
            for t in (0.1 * k, 0.1 * k + 0.07):
                assert np.allclose(np.array(ramp(t)), line(t), rtol=1e-14)
                assert np.allclose(np.array(delayed(t)), line(t - 0.1), rtol=1e-14)
    assert np.array_equal(np.array(hold(0.4, [0.0, 0.0])(0.4)), [0.0, 0.0])
    hold.reset()
    assert np.array_equal(np.array(hold(0.0, [1.0, 2.0])(9.0)), [1.0, 2.0])
    assert lm.loops.FirstOrderHold(1.0, first=0.0)(0.0, 2.0) == lm.loops.Ramp(2.0, 2.0)


def test_a_controller_may_write_its_commands_into_one_array() -> None:
    blocks = [
        lm.loops.ZeroOrderHold(2),
        lm.loops.Latency(1, np.zeros(2)),
        lm.loops.RateLimit([0.5, 0.5], 1.0, np.zeros(2)),
    ]
    hold, u, now = lm.loops.FirstOrderHold(1.0), np.zeros(2), []
    for k in range(4):
        u[:] = [k, -k]
        now.append([*[block(u) for block in blocks], hold(float(k), u).slope])
    for k, (held, late, slow, slope) in enumerate(now):
        assert np.array_equal(late, [max(k - 1, 0), -max(k - 1, 0)])
        assert np.array_equal(slow, [0.5 * k, -0.5 * k])
        assert np.array_equal(slope, [1.0, -1.0] if k else [0.0, 0.0])
        assert np.array_equal(held, [k - k % 2, k % 2 - k])


def test_commands_late_slow_and_held() -> None:
    latency = lm.loops.Latency(2, 0.0)
    assert [latency(float(k)) for k in range(1, 6)] == [0.0, 0.0, 1.0, 2.0, 3.0]
    latency.reset()
    assert latency(9.0) == 0.0 and lm.loops.Latency(0, 0.0)(4.0) == 4.0
    moved = lm.loops.Latency(1, np.zeros(2))
    command = np.ones(2)
    moved(command)
    command[:] = 7.0  # an array that its owner goes on with
    assert np.array_equal(moved(command), np.ones(2))
    limit = lm.loops.RateLimit([1.0, 2.0], 0.5, [0.0, 0.0])
    assert np.array_equal(limit([3.0, -0.4]), [0.5, -0.4])
    assert np.array_equal(limit([3.0, 9.0]), [1.0, 0.6])
    limit.reset()
    assert np.array_equal(limit([0.1, 0.3]), [0.1, 0.3])
    asked = []
    hold = lm.loops.ZeroOrderHold(3)
    held = [hold(lambda: asked.append(0) or len(asked)) for _ in range(7)]
    assert held == [1, 1, 1, 2, 2, 2, 3] and len(asked) == 3
    for wrong in (
        lambda: lm.loops.FirstOrderHold(0.0),
        lambda: lm.loops.RateLimit(-1.0, 0.1, 0.0),
        lambda: lm.loops.Latency(-1, 0.0),
        lambda: lm.loops.ZeroOrderHold(0),
        lambda: lm.loops.Ramp([1.0, 2.0], [1.0]),
        lambda: lm.loops.RateLimit(1.0, 0.1, 0.0)(np.nan),
    ):
        with pytest.raises(InvalidInput):
            wrong()
