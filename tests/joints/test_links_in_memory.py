"""Linkages of any size: steps as loops over bodies and joints in memory."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import liemech as lm
from liemech.compiler import kernel
from liemech.joints import (
    BallJoint,
    Damper,
    DryFriction,
    Link,
    Linkage,
    Motor,
    PrismaticJoint,
    RevoluteJoint,
    RigidRod,
    Spring,
    Stops,
    Strut,
    UniversalJoint,
    chain,
)
from liemech.joints.elimination_order import eliminated_in, has_loops
from liemech.simulation.runs.carry import SiteCarry

TURN = [0.0, 1.0, 0.0]
TOP, BOTTOM = [0.0, 0.0, 0.5], [0.0, 0.0, -0.5]
ROD = Link.rod(1.0, 1.0, 0.05)
LUMP = Link(2.0, np.diag([0.3, 0.4, 0.5]) + 0.05)
BLOCK = Link(2.0, [0.3, 0.4, 0.5])
needs_compiler = pytest.mark.skipif(kernel.available() is not None, reason="needs llvmlite")


@lm.record
class PD(lm.joints.JointForce):
    """A controller that follows a plan."""

    stiffness: float
    damping: float
    plan: lm.PiecewisePolynomial

    def effort(self, t: float, q: float, rate: float) -> float:
        return self.stiffness * (self.plan(t) - q) - self.damping * rate

    def about(self, t: float) -> float:
        return self.plan(t)


PLAN = lm.PiecewisePolynomial.cubic([0.0, 0.5, 1.0], [0.0, 0.8, 0.3], outside="hold")


def tree(few: bool = False) -> tuple[Linkage, Any]:
    """Five bodies with five kinds of joints, and forces of all kinds."""
    joints = [
        UniversalJoint(0, None, [0, 0, 0.3], [0, 0, 1.0], [1, 0, 0], TURN, name="cross"),
        RevoluteJoint(1, 0, TOP, [0, 0.2, -0.3], TURN, TURN, name="elbow"),
        PrismaticJoint(2, 0, TOP, [0.3, 0, 0], [0, 0, 1]),
        BallJoint(3, 1, TOP, BOTTOM),
        RigidRod(4, 3, TOP, BOTTOM, 0.7),
        Strut(2, 4, BOTTOM, TOP, name="strut"),
    ]
    forces = [
        PD("elbow", 30.0, 1.5, PLAN), Damper("cross", 0.3), Spring("cross", 2.0), Motor("elbow", 0.7),
        DryFriction(2, 0.4, 0.5), Stops(2, -0.05, 0.05, 300.0), Spring(3, 1.5), Damper(3, 0.1, freedom=1),
        Spring("strut", 4.0, 0.5), Damper("strut", 0.6),
    ]  # fmt: skip
    if few:  # loads along one coordinate of a joint: less for native code to do
        forces = [force for force in forces if force.joint in ("elbow", 2) or isinstance(force, Spring)]
    linkage = Linkage([BLOCK, ROD, ROD, ROD, ROD], joints, forces=forces)
    poses = np.tile(np.eye(4), (5, 1, 1))
    poses[:, :3, 3] = [[0, 0, 0.7], [0, 0.2, -0.1], [0.3, 0, 0.1], [0, 0.2, -1.1], [0.2, 0.2, -2.8]]
    return linkage, linkage.assembled(poses, np.random.default_rng(0).normal(size=(5, 6)))


def star() -> tuple[Linkage, Any]:
    """Four rods on one body, adrift."""
    spots = np.random.default_rng(1).normal(size=(4, 3))
    joints = [BallJoint(i + 1, 0, TOP, spots[i]) for i in range(4)]
    linkage = Linkage([LUMP] + [ROD] * 4, joints, gravity=0.0)
    return linkage, linkage.state(angles={0: [0.3, 0.1, 0.2]}, rates={1: [1.0, 2.0, 0.5]})


def ring(n: int = 5) -> tuple[Linkage, Any]:
    """A closed ring of rods that falls."""
    linkage = Linkage([ROD] * n, [BallJoint(i, (i + 1) % n, BOTTOM, TOP) for i in range(n)])
    turns = 2.0 * np.pi * np.arange(n + 1) / n
    corners = np.transpose([np.cos(turns), np.sin(turns), 0.0 * turns]) / (2 * np.sin(np.pi / n))
    poses = np.tile(np.eye(4), (n, 1, 1))
    for pose, a, b in zip(poses, corners, corners[1:]):
        pose[:3, :3] = np.transpose([[0, 0, 1], np.cross(a - b, [0, 0, 1]), a - b])
        pose[:3, 3] = 0.5 * (a + b)
    return linkage, linkage.assembled(poses, np.random.default_rng(2).normal(size=(n, 6)))


def ladder(steps: int = 2) -> tuple[Linkage, Any]:
    """Two ropes with rungs between them, hanging from two points: as many loops as rungs."""
    links, joints = [], []  # type: list[Any], list[Any]
    places = []
    for k in range(steps):
        left, right, rung = 3 * k, 3 * k + 1, 3 * k + 2
        for side, b in ((-0.5, left), (0.5, right)):
            above = None if k == 0 else 3 * (k - 1) + (0 if b == left else 1)
            joints.append(BallJoint(b, above, TOP, [side, 0.0, 0.0] if k == 0 else BOTTOM))
            places.append([side, 0.0, -0.5 - k])
        joints.append(BallJoint(rung, left, [-0.5, 0.0, 0.0], BOTTOM))
        joints.append(UniversalJoint(rung, right, [0.5, 0.0, 0.0], BOTTOM, [1, 0, 0], TURN))
        places.append([0.0, 0.0, -1.0 - k])
        links += [ROD, ROD, Link(0.5, [0.01, 0.05, 0.05])]
    linkage = Linkage(links, joints)
    poses = np.tile(np.eye(4), (3 * steps, 1, 1))
    poses[:, :3, 3] = places
    xi = np.random.default_rng(3).normal(size=(3 * steps, 6))
    return linkage, linkage.assembled(poses, xi)


def by_loops(linkage: Any, method: Any, start: Any, compiled: bool, **options: Any) -> Any:
    run = lm.integrate(linkage, method, start, compiled=compiled, progress=False, **options)
    assert isinstance(run.carry, SiteCarry)
    assert run.compiled is compiled
    return run


def written_out(monkeypatch: Any, linkage: Any, method: Any, start: Any, **options: Any) -> Any:
    monkeypatch.setattr(Linkage, "small", 10**6)
    run = lm.Plan(linkage, method, h=options["h"], compiled=False).run(start, steps=options["steps"])
    monkeypatch.undo()
    assert not isinstance(run.carry, SiteCarry)
    return run


@pytest.mark.slow
@pytest.mark.parametrize("made", [tree, star, ring, ladder], ids=lambda f: f.__name__)
def test_loops_and_formulas_written_out_make_the_same_steps(made: Any, monkeypatch: Any) -> None:
    linkage, start = made()
    method = lm.LieRATTLE(lm.Cayley() if made is star else lm.Exponential())
    one = by_loops(linkage, method, start, False, h=0.01, steps=3)
    two = written_out(monkeypatch, linkage, method, start, h=0.01, steps=3)
    np.testing.assert_allclose(one.g, two.g, rtol=0.0, atol=3e-15 * np.abs(two.g).max())
    np.testing.assert_allclose(one.mu, two.mu, rtol=0.0, atol=1e-14 * np.abs(two.mu).max())


def arm() -> tuple[Linkage, Any]:
    """Two links on hinges, under control, and one that hangs from them by a spring on a ball joint."""
    joints = [
        RevoluteJoint(0, None, TOP, [0.0, 0.0, 0.0], TURN, TURN),
        RevoluteJoint(1, 0, TOP, BOTTOM, TURN, TURN, name="elbow"),
        BallJoint(2, 1, TOP, BOTTOM),
    ]
    forces = [PD(0, 30.0, 1.5, PLAN), PD("elbow", 10.0, 0.3, PLAN), Spring(2, 1.5)]
    linkage = Linkage([ROD, ROD, LUMP], joints, forces=forces)
    return linkage, linkage.state(angles={"elbow": 0.4, 2: [0.2, 0.1, 0.3]})


@pytest.mark.slow
@needs_compiler
@pytest.mark.parametrize("made", [arm, pytest.param(tree, marks=pytest.mark.slow)])
def test_native_loops_give_the_bits_of_plain_ones(made: Any) -> None:
    linkage, start = made(True) if made is tree else made()
    method = lm.Composition(lm.LieRATTLE(), order=4)
    plain = by_loops(linkage, method, start, False, h=0.02, steps=2)
    native = by_loops(linkage, method, start, True, h=0.02, steps=2)
    for name in ("mu", "g"):
        assert np.array_equal(getattr(plain, name), getattr(native, name))
    assert np.array_equal(plain.joint("elbow").torque, native.joint("elbow").torque)
    away = by_loops(linkage, method, native.last, True, h=-0.02, steps=2, t0=0.04)
    assert away.t[-1] == 0.0


@needs_compiler
@pytest.mark.parametrize("made", [pytest.param(f, marks=pytest.mark.slow) for f in (star, ring, ladder)])
def test_other_native_loops_give_the_bits_of_plain_ones(made: Any) -> None:
    linkage, start = made()
    runs = [by_loops(linkage, lm.LieRATTLE(), start, how, h=0.01, steps=5) for how in (False, True)]
    assert np.array_equal(runs[0].g, runs[1].g)


def hinged(n: int, axis: Any = TURN) -> tuple[Linkage, Any]:
    linkage = chain(n, axis=axis)
    return linkage, linkage.state(angles={0: 0.9, n - 1: -0.4}, rates={1: 1.5})


def in_angles(n: int, q: np.ndarray, rates: np.ndarray, t: np.ndarray) -> np.ndarray:
    """The relative angles of n rods on hinges, by Lagrange's equations of their angles."""
    I, g, count = ROD.inertia[0], 9.80665, np.arange(n)
    heavy = (n - 1 - np.maximum.outer(count, count)) + 0.5 * (1 - np.eye(n))
    across = heavy + (I + 0.25) * np.eye(n)
    weight = g * (0.5 + n - 1 - count)

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        a, w = y[:n], y[n:]
        d = np.subtract.outer(a, a)
        push = -(heavy * np.sin(d)) @ w**2 - weight * np.sin(a)
        return np.concatenate([w, np.linalg.solve(across * np.cos(d), push)])

    start = np.concatenate([np.cumsum(q), np.cumsum(rates)])
    found = solve_ivp(rate, (0.0, t[-1]), start, "DOP853", t, rtol=1e-13, atol=1e-13)
    return np.diff(found.y[:n].T, axis=1, prepend=0.0)


@pytest.mark.slow
@needs_compiler
@pytest.mark.parametrize("order", [pytest.param(2, marks=pytest.mark.slow), 4])
def test_a_chain_of_hinges_moves_by_lagranges_equations_of_its_angles(order: int) -> None:
    linkage, start = hinged(5)
    errors, method = [], lm.Composition(lm.LieRATTLE(), order=4)  # type: list[float], Any
    lengths = (0.02, 0.01, 0.005)
    if order == 2:
        lengths, method = (0.01, 0.005, 0.0025), lm.LieRATTLE()
    for h in lengths:
        run = by_loops(linkage, method, start, True, h=h, steps=round(0.4 / h))
        found = [run.joint(j).angle[-1] for j in range(5)]
        start_angles, rates = np.array([0.9, 0, 0, 0, -0.4]), np.array([0, 1.5, 0, 0, 0])
        wanted = in_angles(5, start_angles, rates, run.t)[-1]
        errors.append(float(np.abs(found - wanted).max()))
    slope = np.polyfit(np.log(lengths), np.log(errors), 1)[0]
    assert abs(slope - order) < 0.15
    assert order == 2 or errors[-1] < 1e-7


@pytest.mark.slow
@needs_compiler
def test_another_number_of_links_compiles_nothing(monkeypatch: Any) -> None:
    """Beyond four places, of which code has one more version, a little faster."""
    method = lm.LieRATTLE()
    linkage, start = hinged(5)
    by_loops(linkage, method, start, True, h=0.01, steps=2)
    monkeypatch.setattr(kernel, "_translated", lambda *_, **__: pytest.fail("compiled"))
    for n in (6, 9, 30, 100):
        linkage, start = hinged(n)
        run = by_loops(linkage, method, start, True, h=0.002, steps=20)
        c = linkage.conditions_at(run.mu[-1], run.g[-1])[0]
        assert np.abs(c).max() < 4e-16 * n


def hanging(n: int) -> tuple[Linkage, Any]:
    """Rods on ball joints, the least code of linkages that move."""
    linkage = chain(n)
    return linkage, linkage.state(angles={0: [0.9, 0.1, 0.3]}, rates={1: [1.5, -0.4, 0.2]})


@pytest.mark.parametrize("compiled", [False, pytest.param(True, marks=[pytest.mark.slow, pytest.mark.compiled])])
def test_a_step_that_is_too_long_names_a_joint_and_keeps_samples(compiled: bool) -> None:
    linkage, start = hanging(4)
    with pytest.raises(lm.errors.NoConvergence, match=r"at joint \d.*too long there") as told:
        lm.integrate(linkage, lm.LieRATTLE(), start, h=2.0, steps=3, compiled=compiled)
    assert len(told.value.trajectory) == 1


def test_trees_are_eliminated_without_filling() -> None:
    rng = np.random.default_rng(4)
    n = 200
    trees = [(j, int(rng.integers(j)) if j else -1) for j in range(n)]
    hubs = {b: sum(b in ends for ends in trees) for b in range(n)}
    order, left = eliminated_in(trees)
    assert sorted(order) == list(range(n))
    # joints of one body are tied to each other, and to no others
    assert sum(map(len, left)) == sum(k * (k - 1) // 2 for k in hubs.values())
    assert not has_loops(trees)
    ring_of = [(j, (j + 1) % n) for j in range(n)]
    assert has_loops(ring_of)
    assert max(map(len, eliminated_in(ring_of)[1])) == 2


@needs_compiler
@pytest.mark.slow
def test_ten_rods_keep_their_energy_over_many_steps() -> None:
    linkage = chain(10)
    start = linkage.state(angles={0: [0.3, 0.8, 0.1], 5: [0.5, 0.0, 0.3]})
    for method, band in ((lm.LieRATTLE(), 1.2e-4), (lm.Composition(lm.LieRATTLE(), order=4), 1e-6)):
        run = by_loops(linkage, method, start, True, h=0.001, steps=100_000, every=50)
        scale = np.abs(linkage.energy(np.zeros_like(run.mu), run.g)).max()
        off = (run.energy - run.energy[0]) / scale
        assert np.ptp(off) < band
        halves = np.array_split(off, 2)
        assert abs(np.mean(halves[1]) - np.mean(halves[0])) < 0.2 * np.ptp(off)
        assert np.abs(linkage.conditions_at(run.mu[-1], run.g[-1])[0]).max() < 4e-15


@pytest.mark.slow
def test_how_often_states_are_looked_at_changes_no_bit() -> None:
    """What is shown is found beside the steps; inside of a step, too."""
    linkage, start = hinged(3)
    every, seldom, inside = (
        by_loops(linkage, lm.LieRATTLE(), start, False, h=0.01, steps=9, **how)
        for how in ({"every": 1}, {"every": 4}, {"t_eval": [0.0, 0.0349, 0.035, 0.09]})
    )
    for run, rows in ((seldom, [0, 4, 8, 9]), (inside, [0, -1, -1, 9])):
        for k, mu, g in zip(rows, run.mu, run.g):
            c, off = linkage.conditions_at(mu, g)
            assert max(np.abs(c).max(), np.abs(off).max()) < 4e-15
            assert k < 0 or (np.array_equal(mu, every.mu[k]) and np.array_equal(g, every.g[k]))
    assert np.array_equal(every.mu[0], start.mu)
    gone_on = lm.Plan(linkage, lm.LieRATTLE(), h=0.01, compiled=False).resume(seldom, steps=3)
    whole = by_loops(linkage, lm.LieRATTLE(), start, False, h=0.01, steps=12, every=5)
    assert np.array_equal(gone_on.mu[-1], whole.mu[-1])
