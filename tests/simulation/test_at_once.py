"""Short runs in one native call, and plans that share what is prepared with systems of other numbers."""

from __future__ import annotations

import copy
import dataclasses
import pickle
from concurrent.futures import ThreadPoolExecutor
from typing import Any, ClassVar

import numpy as np
import pytest
from scenes import Fenced

import liemech as lm
from liemech.compiler.changes.staleness import Guard
from liemech.errors import IncompatibleSystem, IntegrationFailure, InvalidInput
from liemech.formulas.classes.layouts import gatherer, layout_of, leaves
from liemech.formulas.numbers.conversions import compensated
from liemech.simulation.runs.equal import StraightRun

RKMK4 = lm.RKMK(order=4)
MOMENTA = ([0.5, 0.0, 0.75**0.5], [0.1, -0.9, 0.3])
GAIN = 1.0


@lm.record
class Gained(lm.Hamiltonian):
    """A Hamiltonian that reads a number from outside."""

    inverse: lm.Vec

    def energy(self, mu: lm.Vec) -> float:
        return GAIN * 0.5 * lm.dot(mu, self.inverse * mu)

    def gradient(self, mu: lm.Vec) -> lm.Vec:
        return GAIN * (self.inverse * mu)


def body(x: float) -> lm.RigidBody:
    return lm.RigidBody([1.0, 1.5 + x, 2.0])


@pytest.mark.parametrize(
    "value",
    [
        body(0.0),
        body(0.0).state(mu=MOMENTA[0], g=np.eye(3)),
        compensated(body(0.0).state(mu=MOMENTA[0], g=np.eye(3))),
        (1.0, lm.vec(2.0, 3.0), (lm.mat(lm.vec(4.0, 5.0), lm.vec(6.0, 7.0)), 8)),
        [lm.vec(1.0, 2.0), 3.0],
        lm.RigidBody(np.diag([1.0, 1.5, 2.0]) + 0.1),
        lm.SO3(),
    ],
)
def test_numbers_gathered_are_the_leaves(value: Any) -> None:
    layout = layout_of(value)
    assert gatherer(layout)(value) == leaves(value, layout)


@pytest.mark.compiled
@pytest.mark.parametrize(("method", "every"), [(RKMK4, 1), (RKMK4, 4), (lm.CovariantVariational(lm.Cayley()), 1)])
def test_a_short_run_is_the_run_in_pieces(method: lm.Method, every: int) -> None:
    """Whoever steps, all fields are the same; and so is what goes on from them."""
    one = body(0.0)
    plan = lm.Plan(one, method, 0.1, every=every, compiled=True)
    start = one.state(mu=MOMENTA[0])
    plan.run(start, steps=4)
    short = plan.run(start, steps=20, t0=0.3)
    pieces = StraightRun(plan, start, 0.3, 20, None, None).trajectory()
    assert "_rest" in vars(short)  # nothing of it was made yet
    for name in ("system", "method", "h", "bodies", "steps", "compiled", "rejected", "dense", "events"):
        assert getattr(short, name) == getattr(pieces, name)
    assert np.array_equal(short.t, pieces.t) and np.array_equal(short.mu, pieces.mu) and not short.stopped
    for run in (short, pickle.loads(pickle.dumps(short)), copy.copy(short), dataclasses.replace(short, compiled=True)):
        on = plan.resume(run, steps=8)
        assert np.array_equal(on.mu, plan.resume(pieces, steps=8).mu)
        assert np.array_equal(plan.step(run.carry, 8).last, on.mu[-1])
    odd = plan.run(start, steps=7, t0=0.3)
    assert np.array_equal(odd.mu[-1], plan.run(start, steps=7).mu[-1])
    assert np.array_equal(plan.resume(odd, steps=13).mu[-1], short.mu[-1])


@pytest.mark.compiled
@pytest.mark.parametrize("method", [RKMK4, lm.CovariantVariational(lm.Cayley())], ids=["RKMK4", "Algorithm 1"])
def test_bodies_of_one_layout_share_a_plan_and_nothing_else(method: lm.Method) -> None:
    plans = {x: lm.Plan(body(x), method, 0.1, compiled=False) for x in (0.0, 0.1, 0.2)}
    plain = {x: plan.run(body(x).state(mu=MOMENTA[0]), steps=9).mu for x, plan in plans.items()}
    first = lm.Plan(body(0.0), method, 0.1, compiled=True)
    for x in (0.0, 0.1, 0.2, 0.0, 0.1):
        for mu in (
            lm.integrate(body(x), method, body(0.0).state(mu=MOMENTA[0]), h=0.1, steps=9, compiled=True).mu,
            first.replace(system=body(x)).run(body(x).state(mu=MOMENTA[0]), steps=9).mu,
        ):
            assert np.array_equal(mu, plain[x])
    assert (
        first.replace(system=body(0.1)).system.inertia == body(0.1).inertia
        and first.system.inertia == body(0.0).inertia
    )


@lm.record
class Held(lm.Force):
    """A torque that a controller holds between two looks at the body."""

    torque: lm.Vec

    def covector(self, t: float, xi: lm.Vec, g: lm.Mat) -> lm.Vec:
        return self.torque


@lm.record
class Spring(lm.SeparableSystem):
    """A point on a spring."""

    degrees: ClassVar[int] = 1
    stiffness: float

    def kinetic(self, p: lm.Vec) -> float:
        return 0.5 * p[0] ** 2

    def potential(self, q: lm.Vec) -> float:
        return 0.5 * self.stiffness * q[0] ** 2


@pytest.mark.compiled
@pytest.mark.parametrize(
    ("system", "start"),
    [
        (
            lambda x: lm.MechanicalSystem(body(0.0), lm.NoPotential(), load=Held([x, 0.1, 0.0])),
            {"mu": MOMENTA[0], "g": np.eye(3)},
        ),
        (lambda x: Spring(1.0 + x), {"q": [0.3], "p": [0.4]}),
        (
            lambda x: lm.PoissonSystem(
                lm.coadjoint(lm.SO3()).poisson_structure, lm.RigidBody([1.0, 1.5 + x, 2.0]).hamiltonian
            ),
            {"y": MOMENTA[0]},
        ),
    ],
    ids=["body in a field", "canonical", "Poisson"],
)
def test_numbers_of_a_system_change_and_nothing_is_prepared_anew(
    system: Any, start: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What a system makes of its parts, T*G or R^2n, is one object for all of its kind: the guard of
    the first one serves the others, and a control loop takes microseconds.
    """
    first = lm.Plan(system(0.0), RKMK4, 0.1, compiled=True)
    begin = system(0.0).state(**start)
    for _ in range(2):
        first.run(begin, steps=3)
    made: list[Guard] = []
    monkeypatch.setattr(Guard, "__init__", lambda guard, *_: made.append(guard))
    run = first.replace(system=system(0.1)).run(begin, steps=3)
    monkeypatch.undo()
    assert not made
    assert run == lm.integrate(system(0.1), RKMK4, begin, h=0.1, steps=3, compiled=False)


class Shear(lm.MatrixLieGroup):
    """A Heisenberg group whose scale is an attribute and no field."""

    def __init__(self, scale: float) -> None:
        object.__setattr__(self, "scale", scale)

    @property
    def generators(self) -> Any:
        x, y, z = np.zeros((3, 3, 3))
        x[0, 1] = y[1, 2] = 1.0
        z[0, 2] = self.scale
        return x, y, z


def test_what_is_no_field_is_not_shared() -> None:
    bodies = [
        lm.MechanicalSystem(lm.LiePoissonSystem(Shear(scale), lm.KineticEnergy([1.0, 1.0, 1.0])), lm.NoPotential())
        for scale in (1.0, 2.0)
    ]
    groups = [body.group for body in bodies]
    assert groups[0] is not groups[1]
    assert [body.group is group for body, group in zip(bodies, groups, strict=True)] == [True, True]
    assert lm.models.HeavyTop([1.0, 1.5, 2.0], 1.0, [0.0, 0.0, 1.0]).group is (
        lm.models.HeavyTop([1.0, 1.6, 2.0], 2.0, [0.0, 0.0, 1.0]).group
    )


@pytest.mark.compiled
def test_a_carry_of_another_body_is_refused() -> None:
    first = lm.Plan(body(0.0), RKMK4, 0.1, compiled=True)
    carry = first.begin(body(0.0).state(mu=MOMENTA[0]))
    with pytest.raises(InvalidInput, match="another system"):
        first.replace(system=body(0.1)).step(carry)
    with pytest.raises(IncompatibleSystem):
        lm.Plan(body(0.0), RKMK4, 0.1).replace(method=lm.RATTLE())


@pytest.mark.compiled
def test_what_formulas_read_is_seen_by_new_systems_too(monkeypatch: pytest.MonkeyPatch) -> None:
    def last(compiled: bool) -> Any:
        system = lm.LiePoissonSystem(lm.SO3(), Gained([1.0, 0.5, 0.4]))
        return lm.integrate(system, RKMK4, system.state(mu=MOMENTA[1]), h=0.1, steps=5, compiled=compiled).mu[-1]

    before = last(True)
    assert np.array_equal(before, last(True)) and np.array_equal(before, last(False))
    monkeypatch.setitem(globals(), "GAIN", 1.25)
    assert np.array_equal(last(True), last(False)) and not np.array_equal(last(True), before)


@pytest.mark.compiled
def test_a_short_run_that_fails_says_where() -> None:
    """Native code comes to a step that fails; plain Python says why, after the samples that went through."""
    one, said = body(0.0), []
    start = one.state(mu=[0.3, 0.4, 0.75])
    for compiled in (True, False):
        plan = lm.Plan(one, Fenced(order=4), 0.1, compiled=compiled)
        plan.run(start, steps=1)
        with pytest.raises(IntegrationFailure, match="beyond the fence") as caught:
            plan.run(start, steps=200)
        run = caught.value.trajectory
        assert 1 < run.steps < 200 and np.all(run.mu[:-1, 1] <= 0.6) and run.mu[-1, 1] > 0.6
        with pytest.raises(IntegrationFailure, match="beyond the fence"):
            plan.step(plan.begin(start), 200)
        said.append((str(caught.value), run.steps, run.mu.tobytes()))
    assert said[0] == said[1]


@pytest.mark.compiled
def test_threads_may_share_a_plan_and_a_run() -> None:
    one = body(0.0)
    plan = lm.Plan(one, RKMK4, 0.1, compiled=True)
    starts = one.state(mu=np.random.default_rng(3).normal(size=(8, 3)))
    singles = [one.state(mu=mu) for mu in np.asarray(starts.mu)]
    wanted = [plan.run(start, steps=50).mu for start in singles]
    shared = [plan.run(start, steps=50) for start in singles]

    def look(_: int) -> bool:
        again = all(
            np.array_equal(plan.run(start, steps=50).mu, mu) for start, mu in zip(singles * 5, wanted * 5, strict=True)
        )
        return again and all(np.array_equal(run.mu, mu) for run, mu in zip(shared, wanted, strict=True))

    with ThreadPoolExecutor(4) as pool:
        assert all(pool.map(look, range(8)))


@pytest.mark.slow
@pytest.mark.parametrize("method", [RKMK4, lm.KickDrift(order=4)], ids=["no memory", "a memory"])
@pytest.mark.parametrize("bodies", [5, 16])
def test_a_short_run_of_systems_of_their_own_is_the_run_in_pieces(
    method: lm.Method, bodies: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    tops = [lm.models.HeavyTop([1.0, 1.5, 2.0], 1.0 + 0.1 * i, [0.0, 0.0, 0.5]) for i in range(bodies)]
    plan = lm.Plan(tops, method, 0.05, every=2, compiled=True)
    rng = np.random.default_rng(4)
    start = tops[0].state(mu=rng.normal(size=(bodies, 3)), g=np.array([np.eye(3)] * bodies))
    for _ in range(6):  # until the beginning of the method is native, too
        plan.run(start, steps=4)
    whole = StraightRun(plan, start, 0.0, 20, None, None).trajectory()
    resumed = plan.resume(whole, steps=4)
    monkeypatch.setattr(StraightRun, "trajectory", None)  # one native call, or nothing
    short = plan.run(start, t_end=1.0)
    assert np.array_equal(short.t, whole.t) and short.system == whole.system
    for name, array in whole.states.items():
        assert np.array_equal(short.states[name], array)
    monkeypatch.undo()
    assert np.array_equal(plan.resume(short, steps=4).g, resumed.g)


def test_other_starts_of_systems_of_their_own_are_refused_as_ever() -> None:
    systems = [body(0.1 * i) for i in range(4)]
    plan = lm.Plan(systems, RKMK4, 0.1, compiled=True)
    four = systems[0].state(mu=np.ones((4, 3)))
    for _ in range(3):
        plan.run(four, steps=4)
    with pytest.raises(InvalidInput, match="4 systems for 5 bodies"):
        plan.run(systems[0].state(mu=np.ones((5, 3))), steps=4)
    with pytest.raises(InvalidInput, match="give steps or t_end"):
        plan.run(four, steps=4, t_end=0.4)


def test_a_run_between_two_others_keeps_its_numbers() -> None:
    """Runs with adaptive steps write into memory that they share, one after the other."""
    plan = lm.Plan(body(0.0), lm.RKMK(order=5), rtol=1e-9, compiled=True)
    starts = [body(0.0).state(mu=mu, g=np.eye(3)) for mu in MOMENTA]
    plan.run(starts[0], t_end=1.0)
    first = plan.run(starts[0], t_end=10.0)
    shown = first.mu.copy()
    second = plan.run(starts[1], t_end=20.0)
    assert np.array_equal(first.mu, shown) and not np.array_equal(second.mu[1], shown[1])
    alone = lm.Plan(body(0.0), lm.RKMK(order=5), rtol=1e-9, compiled=False)
    plain = [alone.run(start, t_end=t) for start, t in zip(starts, (10.0, 20.0), strict=True)]
    for run, other in zip((first, second), plain, strict=True):
        assert np.array_equal(run.mu, other.mu) and np.array_equal(run.t, other.t)
        assert np.array_equal(run.at(0.123).g, other.at(0.123).g)
        assert run.carry.t == other.carry.t and run.rejected == other.rejected
    with ThreadPoolExecutor(4) as pool:
        found = [*pool.map(lambda k: plan.run(starts[k % 2], t_end=10.0).mu[-1], range(64))]
    assert all(np.array_equal(x, found[k % 2]) for k, x in enumerate(found))
