"""Tangent maps and gradients of linkages of any size, forwards and backwards through loops over bodies and joints."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from test_links_in_memory import BLOCK, ROD, TURN, needs_compiler, ring, star

import liemech as lm
from liemech.simulation.compiled.parameters import full_name, parameter, with_parameter

jt = lm.joints
SIXTH = (1, 0.75), (2, -0.15), (3, 1.0 / 60.0)
"""Weights of differences of order 6."""


@lm.record
class Breeze(lm.Force):
    """A wind along one axis that changes with time and drags a body along."""

    drag: float

    def covector(self, t: float, xi: Any, g: Any) -> Any:
        v = lm.vec(*[g[0][j] * (1.0 + 0.3 * lm.sin(2.0 * t)) - xi[3 + j] for j in range(3)])
        return lm.vec(0.0, 0.0, 0.0, *(self.drag * v))

    def resistance(self, t: float, xi: Any, g: Any, direction: Any) -> Any:
        return lm.vec(0.0, 0.0, 0.0, *[self.drag * x for x in direction[3:]])


def arm(**forces: float) -> tuple[Any, Any]:
    """Three links with two kinds of joints, springs, dampers, and wind on one of the links."""
    numbers = {"stiffness": 2.0, "damping": 0.3, "drag": 0.2} | forces
    joints = [
        jt.RevoluteJoint(0, None, [0, 0, 0.3], [0, 0, 1.0], [0.6, 0.0, 0.8], TURN, name="elbow"),
        jt.PrismaticJoint(1, 0, [0, 0.1, 0.5], [0.3, 0, 0], [0, 0, 1]),
        jt.BallJoint(2, 1, [0, 0, 0.5], [0, 0, -0.5], name="ball"),
    ]
    forces_at_joints = [
        jt.Spring("elbow", numbers["stiffness"], 0.2), jt.Damper("elbow", numbers["damping"]),
        jt.Spring(1, 3.0), jt.Damper("ball", 0.1, freedom=1),
    ]  # fmt: skip
    links = [BLOCK, ROD, ROD]
    system = jt.Linkage(links, joints, forces=forces_at_joints)
    return system, system.state(
        angles={"elbow": 0.4, 1: 0.1, "ball": [0.3, -0.2, 0.4]}, rates={"elbow": 0.7, "ball": [0.5, 0.3, -0.2]}
    )


def chain() -> tuple[Any, Any]:
    system = jt.chain(3, mass=0.5, length=0.4)
    return system, system.state(
        angles={0: [0.1, 0.6, 0.0], 2: [0.5, 0.0, 0.2]}, rates={0: [0.3, -0.2, 0.4], 1: [1.0, 0.5, -0.4]}
    )


def plan_of(system: Any, method: Any, compiled: bool | None = False) -> Any:
    return lm.Plan(system, method, h=0.02, compiled=compiled, progress=False)


def hung() -> tuple[Any, Any]:
    """Three links with two kinds of joints and springs."""
    system, start = arm()
    springs = [force for force in system.forces if isinstance(force, jt.Spring)]
    return jt.Linkage(system.links, system.joints, forces=springs), start


def components(system: Any, run: Any, at: np.ndarray) -> np.ndarray:
    """The last momenta, and where the last poses are, seen from others, odd in how far they are."""
    seen = np.linalg.inv(at) @ run.g[-1].reshape(at.shape)
    turns = 0.5 * np.stack([seen[:, i, j] - seen[:, j, i] for i, j in ((2, 1), (0, 2), (1, 0))], axis=1)
    return np.concatenate([run.mu[-1], np.concatenate([turns, seen[:, :3, 3]], axis=1).ravel()])


def slope(value: Callable[[float], Any], e: float) -> Any:
    """The derivative at zero, by differences of order 6."""
    return sum(w * (value(k * e) - value(-k * e)) for k, w in SIXTH) / e


RATTLES = lm.LieRATTLE(), lm.LieRATTLE(lm.Cayley()), lm.Composition(lm.LieRATTLE(), order=4)
SHORT = lm.RKMK(order=1), lm.CommutatorFree(order=2)


@pytest.mark.slow
@pytest.mark.parametrize("method", [lm.RKMK(order=2), *RATTLES], ids=repr)
def test_tangents_are_derivatives_of_runs(method: Any) -> None:
    """Along a curve of starts that keep the conditions."""
    system, start = arm() if isinstance(method, lm.RKMK) else hung()
    plan = plan_of(system, method)

    def begun(e: float) -> Any:
        return system.state(
            angles={"elbow": 0.4 + e, 1: 0.1 - e, "ball": [0.3, -0.2 + 0.5 * e, 0.4]},
            rates={"elbow": 0.7, "ball": [0.5 + e, 0.3, -0.2 - e]},
        )

    places = [np.array(start.g).reshape(-1, 4, 4), plan.run(start, steps=2).g[-1].reshape(-1, 4, 4)]
    along, wanted = (
        slope(lambda e, at=at, steps=steps: components(system, plan.run(begun(e), steps=steps), at), 1e-2)
        for at, steps in zip(places, (0, 2))
    )
    run = plan.tangent(start, steps=2, along=along)
    assert np.array_equal(run.mu, plan.run(start, steps=2).mu)
    assert run.tangent["along"][-1] == pytest.approx(wanted, rel=0.0, abs=1e-10 * np.abs(wanted).max())


@pytest.mark.slow
@pytest.mark.parametrize("method", [lm.RKMK(order=2), lm.LieRATTLE()], ids=repr)
def test_beside_equations_written_out(method: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    system, start = chain()
    by_joints = plan_of(system, method).tangent(start, steps=2).tangent["start"]
    monkeypatch.setattr(jt.Linkage, "small", 10**6)
    whole = plan_of(system, method).tangent(start, steps=2).tangent["start"]
    assert by_joints.shape == whole.shape == (3, 36, 36)
    assert np.abs(by_joints - whole).max() <= 1e-13 * np.abs(whole).max()


@pytest.mark.slow
@pytest.mark.parametrize("method", [*SHORT, *RATTLES], ids=repr)
@pytest.mark.parametrize("made", [arm, hung, star, ring], ids=lambda f: f.__name__)
def test_backwards_is_the_transpose_of_forwards(made: Any, method: Any) -> None:
    """<w, J v> = <J^T w, v>, off the conditions too; of hubs and of loops."""
    if made is arm and method in RATTLES:
        pytest.skip("loads")
    system, start = made()
    plan, rng = plan_of(system, method), np.random.default_rng(3)
    v, w = rng.normal(size=(2, 12 * len(system.links)))
    forwards = w @ plan.tangent(start, steps=2, along=v).tangent["along"][-1]
    back = plan.pullback(w, start, steps=2)
    sizes = np.abs(back["start"]) @ np.abs(v)
    assert abs(back["start"] @ v - forwards) <= 1e-14 * sizes


@pytest.mark.slow
@pytest.mark.parametrize("method", [SHORT[0], RATTLES[0]], ids=repr)
def test_running_costs(method: Any) -> None:
    """A loss and a cost along the run, beside tangents at the samples."""
    system, start = chain()
    plan, v = plan_of(system, method), np.random.default_rng(6).normal(size=36)

    def cost(t: float, state: Any) -> Any:
        return (1.0 + t) * lm.dot(state.mu, state.mu)

    back = plan.gradient(lambda state: state.mu[3] ** 2, start, steps=3, every=2, along=cost)
    run = plan.tangent(start, steps=3, along=v)
    moves, mu = run.tangent["along"][:, :18], run.mu
    sums = [(1.0 + run.t[k]) * np.array([mu[k] @ mu[k], 2.0 * mu[k] @ moves[k]]) for k in (0, 2, 3)]
    value, slope_along = np.sum(sums, axis=0) + [mu[3, 3] ** 2, 2.0 * mu[3, 3] * moves[3, 3]]
    assert back.value == pytest.approx(value, rel=1e-14)
    assert abs(back["start"] @ v - slope_along) <= 1e-13 * (np.abs(back["start"]) @ np.abs(v))


@needs_compiler
@pytest.mark.slow
@pytest.mark.parametrize("method", [lm.RKMK(order=4), lm.LieRATTLE()], ids=repr)
def test_natively(method: Any) -> None:
    """The bits of plain Python, and of 64 rods the transpose."""
    system, start = chain()
    v, w = np.random.default_rng(4).normal(size=(2, 36))
    native, plain = (plan_of(system, method, compiled) for compiled in (True, False))
    assert np.array_equal(*(plan.tangent(start, steps=2, along=v).tangent["along"] for plan in (native, plain)))
    assert np.array_equal(*(plan.pullback(w, start, steps=2)["start"] for plan in (native, plain)))
    rods = jt.chain(64, mass=0.5, length=0.1)
    begun = rods.state(angles={k: [0.1, 0.02 * k, 0.0] for k in range(64)}, rates={0: [0.3, -0.2, 0.4]})
    plan = lm.Plan(rods, method, h=1e-3, progress=False)
    v, w = np.random.default_rng(5).normal(size=(2, 12 * 64))
    run = plan.tangent(begun, steps=20, along=v)
    back = plan.pullback(w, begun, steps=20)
    assert run.compiled
    assert abs(back["start"] @ v - run.tangent["along"][-1] @ w) <= 1e-13 * (np.abs(back["start"]) @ np.abs(v))


NAMES = (
    "links.0.mass", "links.1.inertia", "gravity", "joints.1.at_first", "joints.0.axis_first", "elbow.stiffness",
    "elbow.damping", "elbow.rest",
)  # fmt: skip


def loss(t: float, state: Any) -> Any:
    return lm.dot(state.mu, state.mu) + t * state.g[7] * state.g[40]


@pytest.mark.slow
@pytest.mark.parametrize("method", [SHORT[0], RATTLES[0]], ids=repr)
@pytest.mark.parametrize("name", NAMES)
def test_by_parameters(name: str, method: Any) -> None:
    """Masses, places of joints, gains: a number that a linkage has is one that it is differentiated by."""
    if method in RATTLES and name == "elbow.damping":
        pytest.skip("loads")
    system, start = arm() if method in SHORT else hung()
    found = plan_of(system, method).gradient(loss, start, steps=2, by=name)
    full = full_name(system, name, "here")
    value = np.array(parameter(system, full), dtype=float)
    way = value * np.random.default_rng(1).uniform(0.5, 1.0, size=value.shape)
    way = way if way.any() else np.ones(value.shape)

    def lost(e: float) -> float:
        moved = value + e * way
        other = with_parameter(system, full, float(moved) if moved.ndim == 0 else lm.vec(*moved))
        run = plan_of(other, method).run(other.vouched(start), steps=2)
        return float(loss(run.t[-1], type(start)(lm.vec(*run.mu[-1]), lm.vec(*run.g[-1]))))

    wanted = slope(lost, 1e-3)
    assert np.sum(found[name] * way) == pytest.approx(wanted, rel=1e-8)
