"""Linkages of any size under fields and loads on bodies, and under inputs that jump."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from test_links_in_memory import BOTTOM, ROD, TOP, TURN, by_loops, needs_compiler, star, tree, written_out

import liemech as lm
from liemech.formulas import dot, sin, sqrt, vec
from liemech.joints import BallJoint, Damper, Link, Linkage, Motor, Spring, chain
from liemech.simulation.runs.carry import SiteCarry

library: Any = lm


@lm.record
class Drag(lm.Force):
    """Drag that is neither linear nor isotropic."""

    c: float

    def covector(self, t: float, xi: Any, g: Any) -> Any:
        push = (-self.c * sqrt(0.01 + dot(xi, xi))) * xi
        return vec(*push[:5], 2.0 * push[5] + 0.3 * self.c * push[0])


@lm.record
class Thrust(lm.Force):
    """A thrust along the body, that changes with time and attitude."""

    c: float

    def covector(self, t: float, xi: Any, g: Any) -> Any:
        return vec(0.0, self.c * sin(3.0 * t), 0.0, 0.0, 0.0, self.c * g[0, 0])


@lm.record
class Trough(lm.Potential):
    """A trough about a vertical line."""

    k: float

    def energy(self, g: Any) -> float:
        return 0.5 * self.k * (g[0, 3] * g[0, 3] + 2.0 * g[1, 3] * g[1, 3])


@lm.record
class Coupled(lm.Force):
    """Dampers of all motions, each with a share of those of the next body."""

    c: float

    def covector(self, t: float, xi: Any, g: Any) -> Any:
        n = len(xi)
        return vec(*[-self.c * (xi[i] - 0.3 * xi[(i + 6) % n]) for i in range(n)])


@lm.record
class Cords(lm.Potential):
    """Springs between two pairs of bodies."""

    k: float

    def energy(self, g: Any) -> float:
        x, y = g[3] - g[16 * 2 + 3], g[7] - g[16 + 7] - 0.1
        return 0.5 * self.k * (x * x + y * y)


ON_BODIES = {"load": {1: Drag(3.0), 4: Thrust(1.0), 3: Drag(0.5)}, "potential": {2: Trough(20.0), 1: Trough(3.0)}}
ON_ALL = {"load": Coupled(2.0), "potential": Cords(30.0)}


@pytest.mark.parametrize(
    ("made", "acting"),
    [(tree, ON_BODIES), (star, ON_ALL), pytest.param(tree, ON_ALL, marks=pytest.mark.slow),
     pytest.param(star, ON_BODIES, marks=pytest.mark.slow)],
)  # fmt: skip
def test_loops_under_loads_make_the_steps_of_formulas_written_out(made: Any, acting: Any, monkeypatch: Any) -> None:
    linkage, start = tree(True) if made is tree else star()
    linkage = replace(linkage, **acting)
    one = by_loops(linkage, lm.LieRATTLE(), start, False, h=1e-3, steps=2)
    two = written_out(monkeypatch, linkage, lm.LieRATTLE(), start, h=1e-3, steps=2)
    np.testing.assert_allclose(one.g, two.g, rtol=0.0, atol=4e-15 * np.abs(two.g).max())
    np.testing.assert_allclose(one.mu, two.mu, rtol=0.0, atol=1e-14 * np.abs(two.mu).max())
    np.testing.assert_allclose(one.energy, two.energy, rtol=0.0, atol=1e-13)


def hanging(**acting: Any) -> tuple[Linkage, Any]:
    rods = chain(4)
    linkage = Linkage(rods.links, rods.joints, **acting)
    return linkage, linkage.state(angles={0: [0.3, 0.1, 0.2]}, rates={1: [1.0, 2.0, 0.5]})


FIELDS = {"load": {2: Drag(0.05)}, "potential": {1: Trough(2.0)}}


def swinging(n: int = 4, **acting: Any) -> tuple[Linkage, Any]:
    rods = chain(n, axis=TURN)
    linkage = Linkage(rods.links, rods.joints, **acting)
    return linkage, linkage.state(angles={0: 0.9, n - 1: -0.4}, rates={1: 1.5})


@pytest.mark.slow
@needs_compiler
@pytest.mark.parametrize("acting", [FIELDS, pytest.param(ON_ALL, marks=pytest.mark.slow)], ids=["bodies", "all"])
def test_native_loops_under_loads_give_the_bits_of_plain_ones(acting: Any) -> None:
    linkage, start = swinging(**acting)
    one, two = (by_loops(linkage, lm.LieRATTLE(), start, how, h=0.02, steps=3) for how in (False, True))
    assert np.array_equal(one.mu, two.mu) and np.array_equal(one.g, two.g)


@needs_compiler
@pytest.mark.slow
def test_orders_under_loads_on_bodies_beside_the_reduced_equation() -> None:
    """Against RKMK of order 8 on the reduced equation, which knows the multipliers in closed form."""
    linkage, start = hanging(load={2: Drag(0.002), 0: Thrust(0.2)}, potential={1: Trough(9.0)})
    wanted = lm.Plan(linkage, lm.RKMK(order=8), h=0.00625, compiled=False).run(start, steps=16).last
    for order, lengths in ((2, (0.005, 0.0025, 0.00125)), (4, (0.01, 0.005, 0.0025))):
        method: Any = lm.LieRATTLE()
        if order == 4:
            method = lm.Composition(method, order=4)
        errors = [
            np.abs(by_loops(linkage, method, start, True, h=h, steps=round(0.1 / h)).last.g - wanted.g).max()
            for h in lengths
        ]  # fmt: skip
        slope = np.polyfit(np.log(lengths), np.log(errors), 1)[0]
        assert abs(slope - order) < 0.25, errors


PULSE = lm.PiecewisePolynomial.constant([0.0, 0.033, 0.071, 0.2], [0.0, 3.0, -2.0], outside="hold")
SAW = lm.PiecewisePolynomial.linear([0.0, 0.045, 0.06], [0.0, 4.0, -1.0], outside="repeat")


def driven() -> tuple[Linkage, Any]:
    rods = chain(4, axis=TURN)
    linkage = Linkage(rods.links, rods.joints, forces=[Motor(0, PULSE), Motor(2, SAW)])
    return linkage, linkage.state(angles={0: 0.9, 3: -0.4}, rates={1: 1.5})


@pytest.mark.slow
@pytest.mark.parametrize("breaks", [pytest.param((), marks=pytest.mark.slow), (0.0123, 0.1)], ids=["tables", "breaks"])
def test_steps_of_loops_end_where_inputs_jump(breaks: Any, monkeypatch: Any) -> None:
    linkage, start = driven()
    plan = lm.Plan(linkage, lm.LieRATTLE(), h=0.02, compiled=False, breaks=breaks)
    one = plan.run(start, steps=4)
    monkeypatch.setattr(Linkage, "small", 10**6)
    two = plan.replace(h=0.02).run(start, steps=4)
    monkeypatch.undo()
    assert type(one.carry) is not type(two.carry)
    np.testing.assert_allclose(one.g, two.g, rtol=0.0, atol=4e-15)
    np.testing.assert_allclose(one.mu, two.mu, rtol=0.0, atol=1e-14)


@needs_compiler
@pytest.mark.slow
def test_native_steps_that_end_where_inputs_jump() -> None:
    linkage, start = driven()
    method = lm.Composition(lm.LieRATTLE(), order=4)
    one, two = (by_loops(linkage, method, start, how, h=0.02, steps=8) for how in (False, True))
    assert np.array_equal(one.mu, two.mu) and np.array_equal(one.g, two.g)
    back = by_loops(linkage, method, two.last, True, h=-0.02, steps=8, t0=two.t[-1])
    assert np.abs(back.g[-1] - two.g[0]).max() < 2e-15
    half = lm.Plan(linkage, method, h=0.02, compiled=True)
    rest = half.resume(half.run(start, steps=3), steps=5)
    assert np.array_equal(rest.g[-1], two.g[-1])
    errors = []
    for h in (0.02, 0.01, 0.005):  # order 4 across jumps
        run = by_loops(linkage, method, start, True, h=h, steps=round(0.16 / h))
        fine = by_loops(linkage, method, start, True, h=0.001, steps=160)
        errors.append(np.abs(run.g[-1] - fine.g[-1]).max())
    assert np.polyfit(np.log([4, 2, 1]), np.log(errors), 1)[0] > 3.5


def test_fields_and_loads_on_bodies_are_checked_at_the_border() -> None:
    links = [Link.rod(1.0, 1.0, 0.1, name="arm"), Link.rod(1.0, 1.0, 0.1, name="hand")]
    joints = [BallJoint(0, None, TOP), BallJoint(1, 0, TOP, BOTTOM)]
    found = Linkage(links, joints, load={"hand": Drag(1.0)})
    assert found.load.bodies == (1,)
    assert replace(found, load=found.load) == found
    for given, error, words in (
        ({"foot": Drag(1.0)}, lm.errors.InvalidInput, "no link 'foot'.*'arm', 'hand'"),
        ({"hand": Trough(1.0)}, lm.errors.InvalidType, "must be a Force"),
        ({"hand": Drag(1.0), 1: Drag(1.0)}, lm.errors.InvalidInput, "names body 1 twice"),
        ([Drag(1.0)], lm.errors.InvalidType, "or such of single bodies"),
    ):
        with pytest.raises(error, match=words):
            library.joints.Linkage(links, joints, load=given)


def side(t: float, state: Any) -> float:
    return state.g[3] + 0.3  # type: ignore[no-any-return]


ASKED = [0.0, 0.013, 0.02, 0.3234, 0.58, 0.6]


@pytest.mark.slow
@pytest.mark.parametrize("how", [pytest.param(False, marks=pytest.mark.slow), pytest.param(True, marks=needs_compiler)])
def test_samples_events_and_functions_of_runs_by_loops(how: bool, monkeypatch: Any) -> None:
    """As of the same linkage written out; the steps know nothing of what is asked."""
    linkage, start = swinging(**FIELDS)
    h = 0.04 if how is False else 0.02
    plan = lm.Plan(linkage, lm.LieRATTLE(), h=h, compiled=how, progress=False)
    steps = round(0.6 / h)
    whole = plan.run(start, steps=steps)
    asked = plan.replace(
        events=(side, linkage.angle(0, np.arcsin(0.6))), record=["g", "energy", ("height", lambda t, s: s.g[11])]
    ).run(start, steps=steps, t_eval=ASKED)  # fmt: skip
    assert isinstance(asked.carry, SiteCarry) and asked.compiled is how
    assert np.array_equal(asked.g[-1], whole.g[-1]) and np.array_equal(asked.t, ASKED)
    assert np.array_equal(asked.height, asked.g[:, 11])
    (at, there), (turned, _) = asked.events
    assert len(at) == 1 and abs(there.g[0, 3] + 0.3) < 1e-15
    # the first rod alone tells its side: both are one zero, of x = -sin(angle)/2
    assert abs(turned[0] - at[0]) < 1e-14
    first = plan.replace(events=(side,), every=5)
    half = first.run(start, steps=4)
    rest = first.resume(half, steps=steps - 4)
    assert np.array_equal(rest.g[-1], whole.g[-1]) and rest.events[0][0] == at
    ended = plan.replace(events=(linkage.angle(0, np.arcsin(0.6), terminal=1),)).run(start, steps=steps)
    assert ended.ended == 0 and ended.t[-1] == turned[0] and ended.steps == len(ended) - 1
    if how:
        return
    monkeypatch.setattr(Linkage, "small", 10**6)
    one = lm.Plan(linkage, lm.LieRATTLE(), h=h, compiled=False, events=(side,))
    out = one.run(start, steps=steps, t_eval=ASKED)
    monkeypatch.undo()
    np.testing.assert_allclose(asked.g, out.g, rtol=0.0, atol=4e-15)
    assert abs(out.events[0][0][0] - at[0]) < 1e-14


@pytest.mark.slow
@pytest.mark.parametrize("how", [False, pytest.param(True, marks=needs_compiler)])
def test_events_that_jump_are_told(how: bool) -> None:
    linkage, start = swinging(3)
    plan = lm.Plan(linkage, lm.LieRATTLE(), h=0.05, compiled=how, events=(lambda t, s: -1.0 if t < 0.07 else 1.0,))
    with pytest.warns(RuntimeWarning, match=r"jumps over zero at t = 0.07,"):
        run = plan.run(start, steps=3)
    assert not len(run.events[0][0])


def test_functions_that_fail_leave_the_samples_before() -> None:
    linkage, start = swinging(3)
    plan = lm.Plan(linkage, lm.LieRATTLE(), h=0.05, compiled=False)

    def late(t: float, state: Any) -> float:
        return 1.0 / (0.0 if t > 0.08 else 1.0)

    with pytest.raises(lm.errors.NotFinite, match=r"late.*t = 0.1") as told:
        plan.replace(record=[late]).run(start, steps=4)
    assert np.array_equal(told.value.trajectory.late, [1.0, 1.0])
    with pytest.raises(ZeroDivisionError) as told:
        plan.replace(events=(late,)).run(start, steps=4)
    assert len(told.value.trajectory) == 2
    with pytest.raises(lm.errors.InvalidInput, match="joint 1, a RevoluteJoint, has 1 coord"):
        linkage.angle(1, freedom=1)


@pytest.mark.parametrize("how", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_torques_of_motors_are_inputs_of_a_stepper(how: bool) -> None:
    """Steps after a new input are those of a linkage made with it, from the state there."""

    def made(torque: float, stiffness: float) -> Any:
        rods = chain(3, axis=TURN)
        forces = [Motor(0, torque), Spring(1, stiffness), Motor(1, 0.3), Motor(1, 0.1)]
        linkage = Linkage(rods.links, rods.joints, forces=forces)
        return lm.Plan(linkage, lm.LieRATTLE(), h=0.01, compiled=how)

    plan = made(0.5, 1.0)
    start = plan.system.state(angles={0: 0.3})
    loop, other = plan.stepper(start), made(2.0, 5.0)
    loop.step(2)
    begun = other.stepper(plan.run(start, steps=2).last, t0=0.02)
    loop.step(2, **{"forces.0.torque": 2.0, "forces.1.stiffness": 5.0})
    begun.step(2)
    assert np.array_equal(loop.g, begun.g) and np.array_equal(loop.mu, begun.mu)
    loop.step(1, **{"links.1.mass": 3.0, "forces.3.torque": 0.2})  # a new system
    assert loop.plan.system.forces[3].torque == 0.2 and loop.plan.system.forces[0].torque == 2.0
    assert loop.inputs["links.1.mass"] == 3.0
    loop.step(1, **{"forces.3.torque": 0.1})
    there = loop.plan.stepper(loop.state, loop.t)
    loop.step()
    there.step()
    np.testing.assert_allclose(loop.g, there.g, rtol=0.0, atol=1e-15)
    with pytest.raises(lm.errors.InvalidInput, match="is a number"):
        loop.step(1, **{"forces.0.torque": PULSE})


def test_the_structure_report_has_a_line_for_each_joint() -> None:
    rods = chain(2)
    joints = [replace(rods.joints[0], name="shoulder"), rods.joints[1]]
    linkage = Linkage(rods.links, joints, forces=[Damper(0, 0.1)])
    start = linkage.state(angles={0: [0.3, 0.1, 0.0]}, rates={1: [0.5, 0.0, 0.0]})
    run = lm.integrate(linkage, lm.LieRATTLE(), start, h=0.01, steps=3, compiled=False)
    names = [f"{joint}: {of}" for joint in ("shoulder", "joint 1") for of in ("position", "rate")]
    report = run.drift()
    assert [*report] == names
    assert all(report[name].verdict == "exact" for name in names)
    g = np.array(run.g)
    g[-1, 3] += 1e-6  # a rod that has left its joint
    torn = replace(run, states={"mu": run.mu, "g": g}).drift()
    assert abs(torn["shoulder: position"].largest * np.abs(g).max() - 1e-6) < 1e-14
    assert torn["shoulder: rate"].verdict == "exact"


def test_a_door_at_rest_is_reported_as_closed() -> None:
    door = Linkage(
        [Link(1.0, [0.1, 0.12, 0.15])], [lm.joints.RevoluteJoint(0, None, [0, 0.5, 0], [0, 0, 0], name="door")]
    )
    run = lm.integrate(door, lm.LieRATTLE(), door.state(angles={}), h=0.01, steps=50, compiled=False)
    rate = run.drift()["door: rate"]
    assert rate.verdict == "exact" and rate.largest < 1e-15


def test_numbers_of_two_doubles_are_for_two_bodies() -> None:
    for count in (2, 3):
        rods = chain(count, axis=TURN)
        plan = {"h": 0.01, "steps": 2, "compiled": False, "precision": "double-double"}
        if count == 2:
            run = lm.integrate(rods, lm.LieRATTLE(), rods.state(angles={0: 0.3}), **plan)
            assert np.ptp(run.energy) < 1e-4
        else:
            with pytest.raises(lm.errors.InvalidInput, match="double-double' is not for the 3 bodies of this linkage"):
                lm.integrate(rods, lm.LieRATTLE(), rods.state(angles={0: 0.3}), **plan)


def test_a_stiff_damper_is_not_called_a_dead_point() -> None:
    rods = chain(3, axis=TURN)
    linkage = Linkage([ROD, ROD, Link(1e-4, [1e-6] * 3)], rods.joints, forces=[Damper(2, 60.0)])
    start = linkage.state(angles={0: 0.3}, rates={2: 3.0})
    with pytest.raises(lm.errors.NoConvergence, match=r"joint [12]: c h/\(2 I\) is") as told:
        lm.integrate(linkage, lm.LieRATTLE(), start, h=0.05, steps=3, compiled=False)
    assert "dead point" not in str(told.value)


@pytest.mark.slow
def test_neither_are_steps_that_are_too_long() -> None:
    rods = chain(3, axis=TURN)
    with pytest.raises(lm.errors.NoConvergence, match=r"at joint .* too long there") as told:
        lm.integrate(rods, lm.LieRATTLE(), rods.state(angles={0: 0.3}), h=3.0, steps=3, compiled=False)
    assert "dead point" not in str(told.value)
    few = Linkage([ROD, Link(1e-4, [1e-6] * 3)], rods.joints[:2], forces=[Damper(1, 60.0)])
    begun = few.state(angles={0: 0.3}, rates={1: 3.0})
    with pytest.raises(lm.errors.NoConvergence, match=r"joint [12]: c h/\(2 I\) is"):
        lm.integrate(few, lm.LieRATTLE(), begun, h=0.05, steps=3, compiled=False)


@pytest.mark.slow
def test_ctrl_c_while_events_are_looked_at_leaves_the_run_where_it_was() -> None:
    linkage, start = swinging(3)
    plan = lm.Plan(linkage, lm.LieRATTLE(), h=0.05, compiled=False)

    def pressed(t: float, state: Any) -> float:
        if t > 0.12:
            raise KeyboardInterrupt
        return 1.0

    with pytest.raises(KeyboardInterrupt) as told:
        plan.replace(events=(pressed,)).run(start, steps=5)
    run = told.value.trajectory  # type: ignore[attr-defined]
    assert len(run) == run.carry.step + 1 and np.array_equal(run.g[-1], run.carry.state.g)
    rest = plan.resume(run, steps=3 - run.carry.step)
    assert np.array_equal(rest.g[-1], plan.run(start, steps=3).g[-1])
