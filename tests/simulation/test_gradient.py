"""Gradients go backwards through blocks of a run: against tangent maps, which go forwards, and against
differences of runs with other parameters.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech import errors

SO3 = lm.SO3()
BODY = lm.RigidBody([1.0, 1.6, 2.3])
START = BODY.state(mu=[0.5, -0.3, 0.75], g=SO3.exp([0.1, 0.2, 0.3]))
TOP = lm.models.HeavyTop(inertia=[1.0, 1.5, 0.7], weight=1.3, centre=[0.6, 0.0, 0.8])
TOP_START = TOP.state(mu=[0.3, 0.2, 2.0], g=SO3.exp([0.1, 0.2, 0.3]))
PENDULUM = lm.SphericalPendulum(length=1.0)
BATH = lm.thermal_bath(BODY, damping=0.1, temperature=1.0)


def loss(state: Any) -> Any:
    return lm.dot(state.mu, lm.vec(1.0, 2.0, 3.0)) + 2.0 * state.g[0][1] + state.g[2][0] ** 2


def off(found: Any, wanted: Any) -> float:
    return float(np.abs(found - wanted).max() / np.abs(wanted).max())


def compared(plan: lm.Plan, start: Any, by: list[str], **length: Any) -> None:
    """The pullback of a cotangent is its product with the tangent map."""
    tangent = plan.tangent(start, by=by, **length).tangent
    w = np.sin(1.0 + np.arange(tangent["start"].shape[-2]))
    found = plan.pullback(w, start, by=by, **length)
    for name in by:
        assert off(found[name].ravel(), w @ tangent[name][-1]) < 1e-12
    norm = np.linalg.norm(tangent["start"][-1], 2)
    assert abs(found.growth - norm) < 1e-9 * norm


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "system", "start", "by"),
    [
        (lm.RKMK(order=4), BODY, START, ["start", "inertia", "h"]),
        (lm.ImplicitMidpoint(), BODY, START, ["start", "inertia"]),
        (lm.CovariantVariational(lm.Cayley()), BODY, START, ["start", "inertia"]),
        (lm.LiePoissonHamiltonJacobi(order=4), BODY, START, ["start", "inertia"]),
        (lm.LieVerlet(), TOP, TOP_START, ["start", "weight"]),
        (lm.KickDrift(order=4), TOP, TOP_START, ["start", "weight"]),
        (lm.RATTLE(), PENDULUM, PENDULUM.state(q=[0.6, 0.0, -0.8], p=[0.0, 0.5, 0.0]), ["start"]),
    ],
    ids=lambda x: getattr(x, "name", ""),
)
def test_a_pullback_is_the_product_with_the_tangent_map(method: Any, system: Any, start: Any, by: list[str]) -> None:
    """With first guesses and forces in memory, which begin anew in every block; in plain Python."""
    compared(lm.Plan(system, method, 0.05, compiled=False), start, by, steps=13)


@pytest.mark.parametrize(
    ("compiled", "steps"), [(False, 3), pytest.param(True, 400, marks=[pytest.mark.compiled, pytest.mark.slow])]
)
@pytest.mark.parametrize("method", [lm.WongZakai(lm.ImplicitMidpoint()), lm.NinomiyaVictoir()], ids=lambda x: x.name)
def test_blocks_have_the_noise_of_their_steps(method: Any, compiled: bool, steps: int) -> None:
    """Of several paths, whenever the run begins; against differences of runs with the same noise too."""
    plan, mu = lm.Plan(BATH, method, 0.1, compiled=compiled), np.array([0.5, -0.3, 0.75])
    compared(plan, BATH.state(mu=mu, path=3), ["start", "system.damping", "h"], steps=steps, t0=-3.3)
    two = np.stack([mu, 2.0 * mu])
    found = plan.gradient(lambda s: lm.dot(s.mu, s.mu), BATH.state(mu=two), steps=steps, t0=9.0)["start"]
    starts = [BATH.state(mu=(1.0 + k * 2.0**-7) * two) for k in (1, -1, 2, -2)]
    ends = [(plan.run(x, steps=steps, t0=9.0).mu[-1] ** 2).sum(axis=1) for x in starts]
    slope = 2.0**7 * ((2.0 / 3.0) * (ends[0] - ends[1]) - (1.0 / 12.0) * (ends[2] - ends[3]))
    assert off((found[:, :3] * two).sum(axis=1), slope) < 1e-6


@pytest.mark.compiled
@pytest.mark.parametrize("step", [{"h": 0.1}, {"rtol": 1e-7, "atol": 1e-9}], ids=["fixed", "adaptive"])
@pytest.mark.parametrize("retraction", [lm.Cayley(), lm.Exponential()], ids=repr)
def test_power_series_carry_several_directions(retraction: lm.Retraction, step: dict[str, float]) -> None:
    """Beside a method that makes none."""
    length = {"steps": 4} if "h" in step else {"t_end": 0.4}
    plan = lm.Plan(BODY, lm.Taylor(8, retraction), compiled=False, **step)
    found = plan.gradient(loss, START, by=["start", "inertia"], **length)
    right = lm.Plan(BODY, lm.RKMK(order=8), 0.1, compiled=False).gradient(loss, START, steps=4, by=["start", "inertia"])
    for name in ("start", "inertia"):
        assert off(found[name], right[name]) < 1e-7


@pytest.mark.slow
def test_native_blocks_agree_with_the_tangent_map() -> None:
    """In lanes, with a last block that is shorter, and backwards in time."""
    for h, steps in ((0.05, 2003), (-0.05, 1), (-0.05, 64)):
        compared(lm.Plan(BODY, lm.RKMK(order=4), h), START, ["start", "inertia"], steps=steps)


@pytest.mark.slow
def test_steps_of_an_error_estimate_are_held_fixed() -> None:
    plan = lm.Plan(TOP, lm.RKMK(order=5), rtol=1e-4, compiled=False)
    compared(plan, TOP_START, ["start", "weight"], t_end=1.0)


@lm.record
class Driven(lm.Force):
    torque: lm.PiecewisePolynomial
    delay: float = 0.0

    def covector(self, t: Any, xi: Any, g: Any) -> Any:
        return self.torque(t - self.delay)


def driven(table: Any, delay: float = 0.0) -> Any:
    return lm.MechanicalSystem(lm.RigidBody([1.0, 2.0, 3.0]), lm.NoPotential(), load=Driven(table, delay))


KNOTS = np.linspace(0.0, 1.1, 6)
VALUES = 0.3 * np.cos(np.arange(18.0)).reshape(6, 3)
AT_REST = driven(lm.PiecewisePolynomial.linear(KNOTS, VALUES)).state(mu=[1.0, 0.5, 0.2], g=np.eye(3))


@pytest.mark.slow
@pytest.mark.parametrize("outside", ["refuse", "hold", "repeat"])
@pytest.mark.parametrize("kind", ["linear", "constant"])
def test_gradients_by_the_values_of_a_table(kind: str, outside: str) -> None:
    """Knots in the middle of steps and of blocks, and beyond the table; against differences of order 4."""

    def made(values: Any) -> Any:
        given = values[:-1] if kind == "constant" else values
        return driven(getattr(lm.PiecewisePolynomial, kind)(KNOTS, given, outside=outside))

    plan = lm.Plan(made(VALUES), lm.LieVerlet(), h=0.13 if outside == "hold" else 0.1, compiled=False)
    steps = 12 if outside != "refuse" else 11
    found = plan.gradient(loss, AT_REST, steps=steps, by="torque.values")["torque.values"]
    for place in ((0, 1), (2, 0), (4, 2)):
        ends = []
        for x in (1e-3, -1e-3, 2e-3, -2e-3):
            moved = VALUES.copy()
            moved[place] += x
            ends.append(loss(plan.replace(system=made(moved)).run(AT_REST, steps=steps).last))
        wanted = (8.0 * (ends[0] - ends[1]) - (ends[2] - ends[3])) / 12e-3
        assert abs(found[place] - wanted) < 1e-9 * np.abs(found).max()


@pytest.mark.slow
def test_a_table_asked_elsewhere_is_refused() -> None:
    """A delayed torque would have a derivative by values of which no block knows."""
    table = lm.PiecewisePolynomial.constant(np.linspace(0.0, 60.0, 61), np.ones((60, 3)), "hold")
    plan = lm.Plan(driven(table, 3.5), lm.RKMK(order=4), h=0.1, compiled=False)
    with pytest.raises(errors.InvalidInput, match="other times than those of its step"):
        plan.gradient(loss, AT_REST, steps=600, by="torque.values")


@pytest.mark.slow
def test_bodies_of_an_ensemble_have_gradients_of_their_own() -> None:
    """Those of each alone; by parameters that they share the sum."""
    inertias = np.array([[1.0, 1.5, 2.0], [1.2, 1.4, 2.1], [0.9, 1.7, 2.3]])
    mu = np.array([[0.5, 0.1, 0.8], [0.2, 0.3, 0.9], [0.7, 0.2, 0.1]])
    bodies = [lm.RigidBody(x) for x in inertias]
    starts = bodies[0].state(mu=mu, g=np.tile(np.eye(3), (3, 1, 1)))
    by = ["start", "inertia"]
    step = {"h": 0.1, "compiled": False}
    found = lm.Plan(bodies, lm.RKMK(order=4), **step).gradient(loss, starts, steps=5, by=by)
    shared = lm.Plan(bodies[0], lm.RKMK(order=4), **step).gradient(loss, starts, steps=5, by=by)
    assert found["start"].shape == (3, 6)
    total, alike = 0.0, np.zeros(3)
    for i, body in enumerate(bodies):
        start = body.state(mu=mu[i], g=np.eye(3))
        one = lm.Plan(body, lm.RKMK(order=4), **step).gradient(loss, start, steps=5, by=by)
        assert off(found["start"][i], one["start"]) < 1e-13
        assert off(found["inertia"][i], one["inertia"]) < 1e-12
        total += one.value
        other = lm.Plan(bodies[0], lm.RKMK(order=4), **step)
        alike += other.gradient(loss, start, steps=5, by=by)["inertia"]
    assert abs(found.value - total) < 1e-13
    assert off(shared["inertia"], alike) < 1e-12
    each = [lambda state, i=i: (1.0 + i) * loss(state) for i in range(3)]
    weighed = lm.Plan(bodies, lm.RKMK(order=4), **step).gradient(each, starts, steps=5)
    assert off(weighed["start"], found["start"] * np.array([[1.0], [2.0], [3.0]])) < 1e-13


def test_losses_of_time_where_bodies_have_steps_of_their_own() -> None:
    """At the ends and at samples, whose times differ from body to body: those of each alone."""
    mu = np.array([[0.5, 0.1, 0.8], [0.2, 0.3, 0.9]])
    starts = BODY.state(mu=mu, g=np.tile(np.eye(3), (2, 1, 1)))
    asked: Any = {"steps": 4, "along": lambda t, s: t * t * s.mu[1], "every": 2}

    def found(h: Any, start: Any) -> Any:
        plan = lm.Plan(BODY, lm.RKMK(order=4), h=h, compiled=False)
        return plan.gradient(lambda t, s: t * s.mu[0], start, **asked)

    both = found([0.1, 0.2], starts)
    alone = [found(0.1 * (i + 1), BODY.state(mu=mu[i], g=np.eye(3))) for i in range(2)]
    assert abs(both.value - alone[0].value - alone[1].value) < 1e-15
    assert off(both["start"], np.array([one["start"] for one in alone])) < 1e-14


def test_cotangents_of_complex_elements() -> None:
    """Of a complex element C stands for Re <C, dg>, dg = g hat(eta): as by the components of the end."""
    group = lm.SU(2)
    body = lm.LiePoissonSystem(group, lm.KineticEnergy([1.0, 2.0, 3.0]))
    plan = lm.Plan(body, lm.RKMK(order=4), h=0.1, compiled=False)
    start = body.state(mu=[0.5, 0.1, -0.3], g=group.exp([0.1, 0.2, 0.4]))
    mu, C = np.array([1.0, -2.0, 0.5]), np.array([[1.0 + 2.0j, -0.3], [0.7j, 0.2 - 1.0j]])
    g = np.asarray(plan.run(start, steps=3).last.g)
    w = [(C.conj() * (g @ np.asarray(X))).sum().real for X in group.generators]
    wanted = plan.pullback(np.concatenate([mu, w]), start, steps=3)["start"]
    assert off(plan.pullback({"mu": mu, "g": C}, start, steps=3)["start"], wanted) < 1e-14


@pytest.mark.slow
def test_running_costs_are_summed_over_samples() -> None:
    """The gradient of a sum is that of cotangents at all samples, and the sum of gradients of ends."""
    plan = lm.Plan(BODY, lm.RKMK(order=4), h=0.1, compiled=False)
    at = [0, 6, 12, 18, 20]

    def running(t: float, state: Any) -> Any:
        return (1.0 + t) * state.mu[0] * state.g[1][1]

    found = plan.gradient(loss, START, steps=20, by=["start", "inertia"], along=running, every=6)
    value, wanted = 0.0, np.zeros(6)
    for n in at:
        one = plan.gradient(running, START, steps=n)
        value, wanted = value + one.value, wanted + one["start"]
    end = plan.gradient(loss, START, steps=20)
    assert abs(found.value - value - end.value) < 1e-14
    assert off(found["start"], wanted + end["start"]) < 1e-13
    run = plan.replace(every=6).run(START, steps=20)
    mu, g = np.zeros((5, 3)), np.zeros((5, 3, 3))
    mu[:, 0], g[:, 1, 1] = (1.0 + run.t) * run.g[:, 1, 1], (1.0 + run.t) * run.mu[:, 0]
    pulled = plan.pullback({"mu": mu, "g": g}, START, steps=20, every=6)
    assert off(pulled["start"], wanted) < 1e-13


@pytest.mark.slow
def test_where_motion_is_sensitive_the_gradient_warns() -> None:
    """A top on its head at rest: disturbances grow by e^(lambda t), lambda^2 = weight / inertia."""
    top = lm.models.HeavyTop(inertia=[1.0, 1.0, 1.0], weight=1.0, centre=[0.0, 0.0, 1.0])
    plan, head = (lm.Plan(top, lm.RKMK(order=4), h=0.5, compiled=False), top.state(mu=[0, 0, 0], g=np.eye(3)))
    with pytest.warns(errors.GradientWarning, match="about 5 digits"):
        growth = plan.gradient(lambda s: s.mu[1], head, steps=48).growth
    assert abs(np.log(growth) - 24.0) < 0.1


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"by": "mass"}, "mass is no parameter"),
        ({"by": []}, 'by is "start"'),
        ({"loss": 3.0}, "loss is a function of the state"),
        ({"loss": lambda a, b, c: a}, "takes 3 arguments"),
        ({"loss": lambda s: s.mu}, "gives a number"),
        ({"loss": [loss]}, "1 functions for a start of one"),
        ({"every": 0}, "every"),
        ({"steps": None}, "give h and steps"),
    ],
)
def test_what_cannot_be_differentiated_is_refused(change: dict[str, Any], message: str) -> None:
    given = {"loss": loss, "start": START, "steps": 5} | change
    plan = lm.Plan(BODY, lm.RKMK(order=4), h=0.1, compiled=False)
    with pytest.raises(errors.LiemechError, match=message):
        plan.gradient(given.pop("loss"), given.pop("start"), **given)


def test_runs_without_a_gradient_say_so() -> None:
    plan = lm.Plan(BODY, lm.RKMK(order=4), h=0.1, compiled=False)
    with pytest.raises(errors.InvalidInput, match="as the samples are"):
        plan.pullback({"mu": np.zeros(4)}, START, steps=3)
    with pytest.raises(errors.InvalidInput, match="parts of the state are mu, g"):
        plan.pullback({"q": np.zeros(3)}, START, steps=3)
    with pytest.raises(errors.InvalidInput, match=r"as the samples are; got \(3,\) of complex128"):
        plan.pullback({"mu": 1j * np.ones(3)}, START, steps=3)
    recorded = plan.replace(record="energy")
    with pytest.raises(errors.InvalidInput, match="records no functions"):
        recorded.gradient(loss, START, steps=3)
    manakov = lm.models.ManakovBody(np.arange(1.0, 13.0))
    with pytest.raises(errors.IncompatibleSystem, match="large matrices"):
        large = manakov.state(mu=np.ones(66))
        lm.Plan(manakov, lm.RKMK(order=4), h=0.1).gradient(lambda s: s.mu[0], large, steps=3)
    clock = lm.ReversibleController(lm.StormerVerlet(), sigma=lm.time_scales.DistancePower(1.4))
    kepler = lm.Plan(lm.Kepler(), clock, h=0.05)
    with pytest.raises(errors.IncompatibleSystem, match="fictive time"):
        kepler.gradient(lambda s: s.q[0], lm.Kepler().state(q=[0.6, 0.0], p=[0.0, 1.4]), steps=3)
