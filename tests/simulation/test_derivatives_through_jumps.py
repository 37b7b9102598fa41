"""Derivatives of runs with jumps: a ball by closed form, bodies and stages by differences of order 6 with their error."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from scenes import Ball

import liemech as lm

BALL, E = Ball(9.81), 0.8
METHODS = [(lm.StormerVerlet(), {"h": 0.01}), (lm.RKMK(order=5), {"rtol": 1e-10})]
SIXTH = (1, 3.0 / 4.0), (2, -3.0 / 20.0), (3, 1.0 / 60.0)


def height(t: float, state: Any) -> Any:
    return state.q[0]


BOUNCE = lm.Jump(height, lambda t, state: BALL.state(q=state.q, p=-E * state.p))


def to(t_end: float, options: dict[str, Any]) -> dict[str, Any]:
    """How far runs with these options go."""
    return {"steps": round(t_end / options["h"])} if "h" in options else {"t_end": t_end}


def sixth(numbers: Callable[[float], Any], step: float) -> tuple[np.ndarray, float]:
    """The derivative at zero by central differences of order 6, and the change from steps twice as long, which is 64 times
    their error.
    """
    once, twice = (
        sum(weight * (np.asarray(numbers(k * s)) - np.asarray(numbers(-k * s))) for k, weight in SIXTH) / s
        for s in (step, 2.0 * step)
    )
    return once, float(np.abs(once - twice).max())


def close(found: Any, numbers: Callable[[float], Any], step: float, rounding: float = 1e-9) -> None:
    """Assert that a derivative is that of numbers, up to the error of the differences, which is to be small."""
    expected, change = sixth(numbers, step)
    size = np.abs(expected).max()
    assert change < 1e-4 * size
    assert np.abs(np.asarray(found) - expected).max() <= change / 16.0 + rounding * size


@pytest.mark.parametrize("method, options", METHODS)
def test_the_bounces_of_a_ball_by_closed_form(method: Any, options: Any) -> None:
    """From (q, p) the k-th bounce is at t_k, the ball then leaves with e^k v, v^2 = p^2 + 2 g q."""
    q0, p0, g, t_end = 1.0, 0.2, 9.81, 1.5
    run = lm.Plan(BALL, method, events=BOUNCE, **options).tangent(
        BALL.state([q0], [p0]), by=["start", "g"], **to(t_end, options)
    )
    v = np.sqrt(p0 * p0 + 2.0 * g * q0)
    by = np.array([g / v, p0 / v, q0 / v])  # of v by q, p and g
    first = np.array([0.0, 1.0, 0.0]) / g + by / g - np.array([0.0, 0.0, 1.0]) * (p0 + v) / g**2
    flights = 2.0 * np.cumsum(np.append(0.0, E ** np.arange(1.0, 2.0)))
    times = first + flights[:, None] * (by / g - np.array([0.0, 0.0, 1.0]) * v / g**2)
    t = (p0 + v) / g + flights * v / g
    assert run.events[0][0] == pytest.approx(t, rel=1e-12)
    found = np.concatenate([run.time_tangents[0][name] for name in ("start", "g")], axis=1)
    assert found == pytest.approx(times, rel=1e-11)
    since, w = t_end - t[1], E**2 * v
    q = E**2 * by * since - w * times[1] + g * since * times[1] - np.array([0.0, 0.0, 0.5]) * since**2
    p = E**2 * by + g * times[1] - np.array([0.0, 0.0, 1.0]) * since
    end = np.concatenate([run.tangent[name][-1] for name in ("start", "g")], axis=1)
    assert end == pytest.approx(np.stack([q, p]), rel=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("method, options", METHODS)
def test_gradients_are_those_of_the_tangent_maps(method: Any, options: Any) -> None:
    plan, far = lm.Plan(BALL, method, events=BOUNCE, **options), to(1.5, options)
    several = BALL.state([[1.0], [0.6]], [[0.2], [-0.1]])
    for start in (BALL.state([1.0], [0.2]), several):
        run = plan.tangent(start, by=["start", "g"], **far)
        found = plan.gradient(lambda x: x.q[0] ** 2 + 3.0 * x.p[0], start, by=["start", "g"], **far)
        slopes = np.stack([2.0 * run.q[-1], np.full_like(run.q[-1], 3.0)], axis=-1)
        expected = slopes @ run.tangent["start"][-1]
        assert found["start"] == pytest.approx(expected.reshape(found["start"].shape), rel=1e-10)
        assert found["g"] == pytest.approx((slopes @ run.tangent["g"][-1]).sum(), rel=1e-11)
        pulled = plan.pullback({"q": slopes[..., 0], "p": slopes[..., 1]}, start, by="start", **far)
        assert pulled["start"] == pytest.approx(found["start"], rel=1e-14)


@pytest.mark.parametrize("method, options", METHODS)
def test_the_way_back_has_the_inverse_map(method: Any, options: Any) -> None:
    undo = lm.Jump(height, lambda t, state: BALL.state(q=state.q, p=-state.p / E))
    there = lm.Plan(BALL, method, events=BOUNCE, **options).tangent(BALL.state([1.0], [0.2]), **to(1.1, options))
    back_to = {"h": -options["h"]} if "h" in options else options
    far = {"steps": 110} if "h" in options else {"t_end": 0.0}
    end = BALL.state(there.q[-1], there.p[-1])
    back = lm.Plan(BALL, method, events=undo, **back_to).tangent(end, t0=1.1, **far)
    assert back.tangent["start"][-1] @ there.tangent["start"][-1] == pytest.approx(np.eye(2), abs=1e-10)


@pytest.mark.slow
def test_of_bodies_side_by_side_each_has_its_times(tmp_path: Path) -> None:
    plan = lm.Plan(BALL, lm.StormerVerlet(), h=0.01, events=BOUNCE, every=25)
    starts = BALL.state([[1.0], [0.6]], [[0.2], [-0.1]])
    run = plan.tangent(starts, steps=110)
    assert run.t == pytest.approx([0.0, 0.25, 0.5, 0.75, 1.0, 1.1]) and run.tangent["start"].shape == (6, 2, 2, 2)
    for i, (q, p) in enumerate(((1.0, 0.2), (0.6, -0.1))):
        alone = plan.tangent(BALL.state([q], [p]), steps=110)
        assert np.array_equal(run.time_tangents[0][i]["start"], alone.time_tangents[0]["start"])
    run.save(tmp_path / "run.npz")
    assert lm.Trajectory.load(tmp_path / "run.npz", [__name__], trusted=True) == run


@pytest.mark.slow
def test_of_a_run_that_ends_at_an_event_and_of_events_that_do_not_jump(tmp_path: Path) -> None:
    """The times of an apex, p = 0, and of a third bounce that ends the run, by closed form; the file has them."""

    def floor(t: float, state: Any) -> Any:
        return state.q[0]

    floor.terminal = 3  # type: ignore[attr-defined]
    bounce = lm.Jump(floor, BOUNCE.then)
    for method, options in METHODS:
        plan = lm.Plan(BALL, method, events=[bounce, lambda t, state: state.p[0]], **options)
        run = plan.tangent(BALL.state([1.0], [0.2]), **to(4.0, options))
        assert run.ended == 0 and run.t[-1] == run.events[0][0][2]
        v = np.sqrt(0.04 + 2.0 * 9.81)
        by = np.array([9.81, 0.2]) / v
        apex = (E ** np.arange(0, 3) * np.array([0.0, 1.0, 1.0]))[:, None] * by / 9.81
        times = run.time_tangents[0]["start"]
        assert run.time_tangents[1]["start"][1:] == pytest.approx((times[:2] + apex[1:]), rel=1e-9)
        assert run.time_tangents[1]["start"][0] == pytest.approx([0.0, 1.0 / 9.81], abs=1e-12)
        assert times[2] == pytest.approx(times[1] + 2.0 * E**2 * by / 9.81, rel=1e-10)
        # at the event itself it stays on the floor: dq + p dt = 0
        assert run.tangent["start"][-1][0] + run.p[-1, 0] * times[2] == pytest.approx(0.0, abs=1e-9)
        run.save(tmp_path / "run.npz")
        read = lm.Trajectory.load(tmp_path / "run.npz", [__name__], trusted=True)
        assert np.array_equal(read.time_tangents[0]["start"], times)


BRICK = lm.MechanicalSystem(
    lm.LiePoissonSystem(lm.SE3(), lm.KineticEnergy([1.0, 1.6, 2.3, 2.0, 2.0, 2.0])),
    lm.models.UniformGravity(3.0, [0, 0, 0]),
)
CORNER = lm.vec(0.3, -0.2, -0.4)


def corner(t: float, state: Any) -> Any:
    """The height of a point of the body above the plane z = -1."""
    return lm.dot(state.g[2, :3], CORNER) + state.g[2, 3] + 1.0


@pytest.mark.slow
@pytest.mark.parametrize("method, options", [(lm.LieVerlet(), {"h": 0.02}), (lm.RKMK(order=5), {"rtol": 1e-10})])
def test_a_body_that_bounces_on_a_corner(method: Any, options: Any) -> None:
    """SE(3), two impacts: by the momentum and the place of the start and by the inertia, which counts in the impact."""
    mu = np.array([0.3, -0.5, 0.4, 0.8, 0.2, -0.3])
    inertia = np.array([1.0, 1.6, 2.3, 2.0, 2.0, 2.0])

    def plan_of(moments: np.ndarray) -> Any:
        body = lm.LiePoissonSystem(lm.SE3(), lm.KineticEnergy(moments.tolist()))
        body = lm.MechanicalSystem(body, BRICK.potential)
        return lm.Plan(body, method, events=lm.impact(body, corner, 0.9), **options)

    def end(run: Any) -> np.ndarray:
        return np.concatenate([run.last.mu, run.events[0][0]])

    plan, far, start = plan_of(inertia), to(2.6, options), BRICK.state(mu=mu, g=np.eye(4))
    name = "body.hamiltonian.inertia"
    run = plan.tangent(start, by=["start", name], **far)
    assert len(run.events[0][0]) == 2
    found = np.concatenate([run.tangent["start"][-1][:6], run.time_tangents[0]["start"]])
    by_inertia = np.concatenate([run.tangent[name][-1][:6], run.time_tangents[0][name]])
    rounding = 1e-8 if "h" in options else 1e-6  # adaptive steps are held fixed
    for k in (1, 3, 5):
        unit = np.eye(6)[k]
        close(
            found[:, k], lambda x, u=unit: end(plan.run(BRICK.state(mu=mu + x * u, g=np.eye(4)), **far)), 2e-5, rounding
        )
    group = lm.SE3()
    for k in (0, 5):
        unit = np.eye(6)[k]
        close(
            found[:, 6 + k],
            lambda x, u=unit: end(plan.run(BRICK.state(mu=mu, g=np.array(group.exp(lm.vec(*(x * u))))), **far)),
            2e-5, rounding,
        )  # fmt: skip
    for k in (0, 4):
        unit = np.eye(6)[k]
        close(by_inertia[:, k], lambda x, u=unit: end(plan_of(inertia + x * u).run(start, **far)), 2e-5, rounding)
    gradient = plan.gradient(lambda x: lm.dot(x.mu, x.mu), start, by=["start", name], **far)
    assert gradient["start"] == pytest.approx(2.0 * run.last.mu @ run.tangent["start"][-1][:6], rel=1e-9, abs=1e-10)
    assert gradient[name] == pytest.approx(2.0 * run.last.mu @ run.tangent[name][-1][:6], rel=1e-9, abs=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("method, options", [(lm.StormerVerlet(), {"h": 0.01}), (lm.RKMK(order=5), {"rtol": 1e-11})])
def test_two_burns_of_a_stage_on_an_orbit_of_kepler(method: Any, options: Any) -> None:
    """At the apocentre, q . p = 0 falling, a burn along the velocity; at a height another one: two jumps in a run."""
    kepler = lm.Kepler()

    def apse(t: float, state: Any) -> Any:
        return lm.dot(state.q, state.p)

    apse.direction = -1  # type: ignore[attr-defined]

    def above(t: float, state: Any) -> Any:
        return lm.dot(state.q, state.q) - 2.0 + 0.01 * t

    above.direction = -1  # type: ignore[attr-defined]
    burns = [
        lm.Jump(apse, lambda t, s: kepler.state(q=s.q, p=1.1 * s.p)),
        lm.Jump(above, lambda t, s: kepler.state(q=s.q, p=[s.p[0] + 0.02 * t * s.q[1] ** 2, 0.9 * s.p[1]])),
    ]
    plan, far = lm.Plan(kepler, method, events=burns, **options), to(8.0, options)
    z = np.array([0.6, 0.12, 0.0, 1.55])

    def end(x: np.ndarray) -> np.ndarray:
        run = plan.run(kepler.state(x[:2], x[2:]), **far)
        return np.concatenate([run.last.q, run.last.p, *[times for times, _ in run.events]])

    run = plan.tangent(kepler.state(z[:2], z[2:]), **far)
    assert [len(times) for times, _ in run.events] == [1, 1]
    found = np.concatenate([run.tangent["start"][-1], *[x["start"] for x in run.time_tangents]])
    for k, unit in enumerate(np.eye(4)):
        close(found[:, k], lambda x, u=unit: end(z + x * u), 4e-6, 1e-8 if "h" in options else 2e-6)


@lm.record
class Fast(lm.CotangentSystem):
    """A particle near the speed of light in the plane, H = sqrt(1 + p^2)."""

    configurations: ClassVar[lm.LieGroup] = lm.VectorSpace(2)

    def energy(self, mu: lm.Vec, g: Any) -> float:
        return lm.formulas.sqrt(1.0 + lm.dot(mu, mu))


def test_the_impulse_of_an_energy_that_is_not_quadratic_has_a_derivative() -> None:
    """Behind the floor p_x stays, and p_y = u sqrt((1 + p_x^2)/(1 - u^2)) with the speed u = -e v_y."""
    particle, e, t_end = Fast(), 0.5, 2.0

    def exact(p: np.ndarray, x: np.ndarray) -> np.ndarray:
        v = p / np.sqrt(1.0 + p @ p)
        met, u = -x[1] / v[1], -e * v[1]
        after = np.array([p[0], u * np.sqrt((1.0 + p[0] ** 2) / (1.0 - u * u))])
        later = after / np.sqrt(1.0 + after @ after) * (t_end - met)
        return np.array([*after, x[0] + v[0] * met + later[0], later[1]])

    p, x = np.array([1.0, -2.0]), np.array([0.0, 1.0])
    floor = lm.impact(particle, lambda t, state: state.g[1], e)
    plan = lm.Plan(particle, lm.RKMK(order=4), h=0.1, events=floor, compiled=False)
    run = plan.tangent(particle.state(mu=p, g=x), steps=20)
    assert np.array([*run.mu[-1], *run.g[-1]]) == pytest.approx(exact(p, x), abs=1e-12)
    for k, unit in enumerate(np.eye(4)):
        close(run.tangent["start"][-1][:, k], lambda s, u=unit: exact(p + s * u[:2], x + s * u[2:]), 1e-3)


def test_grazing_is_refused_by_name_and_so_is_what_has_no_derivative() -> None:
    """A ball that turns at the very height of a ceiling: of its time there is no derivative."""

    def ceiling(t: float, state: Any) -> Any:
        return state.q[0] - 0.125 * 9.81 + 1e-14

    ceiling.direction = 1  # type: ignore[attr-defined]
    graze = lm.Jump(ceiling, lambda t, state: BALL.state(q=state.q, p=-state.p))
    plan = lm.Plan(BALL, lm.StormerVerlet(), h=0.5 / 16, events=graze)
    with pytest.raises(lm.errors.InvalidInput, match=r"ceiling grazes its zero at t = 0\.49\d*, .* no derivative"):
        plan.tangent(BALL.state([0.0], [0.5 * 9.81]), steps=20)
    plan = lm.Plan(BALL, lm.StormerVerlet(), h=0.01, events=BOUNCE)
    with pytest.raises(lm.errors.IncompatibleSystem, match="by h, with which the times"):
        plan.tangent(BALL.state([1.0], [0.0]), steps=100, by="h")
    with pytest.raises(lm.errors.InvalidInput, match="by the last state alone"):
        plan.gradient(lambda x: x.q[0], BALL.state([1.0], [0.0]), steps=100, every=10)
    kicks = [
        lm.Jump(lambda t, s, k=k: k * (t - 0.505), lambda t, s: BALL.state(q=s.q, p=s.p + 1.0)) for k in (1.0, 2.0)
    ]
    with pytest.raises(lm.errors.InvalidInput, match=r"is zero at t = 0\.505, where another event jumps"):
        lm.Plan(BALL, lm.StormerVerlet(), h=0.01, events=kicks).tangent(BALL.state([9.0], [0.0]), steps=100)
    pendulum = lm.SphericalPendulum(mass=1.0, length=1.0)
    wall = lm.Jump(lambda t, s: s.q[0], lambda t, s: pendulum.state(q=s.q, p=-s.p))
    plan = lm.Plan(pendulum, lm.RATTLE(), h=0.01, events=wall, compiled=False)
    with pytest.raises(
        lm.errors.IncompatibleSystem, match=r"at states beside the one where it is made; .* InvalidInput"
    ):
        plan.tangent(pendulum.consistent([0.6, 0.0, -0.8], [0.0, 0.0, 0.0]), steps=100)


def test_a_run_that_ends_on_a_jump_and_one_that_jumps_where_a_step_ends() -> None:
    """A kick at t = 0.5, the end of step 50: p -> p + q; both sides are smooth there."""
    kick = lm.Jump(lambda t, state: t - 0.5, lambda t, state: BALL.state(q=state.q, p=state.p + state.q))
    plan, start = lm.Plan(BALL, lm.StormerVerlet(), h=0.125, events=kick), BALL.state([3.0], [0.4])
    for steps in (4, 6):
        since = 0.125 * steps - 0.5
        flow = (
            np.array([[1.0, since], [0.0, 1.0]])
            @ np.array([[1.0, 0.0], [1.0, 1.0]])
            @ np.array([[1.0, 0.5], [0.0, 1.0]])
        )
        run = plan.tangent(start, steps=steps)
        assert run.tangent["start"][-1] == pytest.approx(flow, abs=1e-12)
        assert run.time_tangents[0]["start"] == pytest.approx(np.zeros((1, 2)), abs=1e-13)
        found = plan.gradient(lambda x: x.q[0] + 2.0 * x.p[0], start, steps=steps)
        assert found["start"] == pytest.approx(np.array([1.0, 2.0]) @ flow, rel=1e-12)


@lm.record
class Driven(lm.Force):
    """A torque from a table."""

    torque: lm.PiecewisePolynomial

    def covector(self, t: float, xi: Any, g: Any) -> Any:
        return self.torque(t)


@pytest.mark.slow
def test_gradients_by_the_values_of_a_table_go_through_jumps() -> None:
    t = np.linspace(0.0, 4.0, 5)
    values = np.column_stack([0.3 * np.sin(t), 0.2 * np.cos(t), 0.1 + 0.0 * t])

    def driven(values: np.ndarray) -> Any:
        table = lm.PiecewisePolynomial.linear(t, values)
        return lm.MechanicalSystem(lm.RigidBody([1.0, 2.0, 3.0]), lm.NoPotential(), load=Driven(table))

    body = driven(values)
    kick = lm.Jump(
        lambda t, s: s.mu[0] - 0.6, lambda t, s: body.state(mu=[s.mu[0] + 0.5, s.mu[1] * 0.9, s.mu[2]], g=s.g)
    )
    plan = lm.Plan(body, lm.RKMK(order=4), h=0.125, events=kick)
    start = body.state(mu=[0.5, 0.1, 0.8], g=np.eye(3))
    by_table = plan.gradient(lambda s: lm.dot(s.mu, lm.vec(1.0, 2.0, 3.0)), start, steps=24, by="torque.values")
    run = plan.tangent(start, steps=24, by="load.torque.values")
    assert len(run.events[0][0]) == 1
    weights = np.array([1.0, 2.0, 3.0, 0.0, 0.0, 0.0])
    found = (weights @ run.tangent["load.torque.values"][-1]).reshape(5, 3)
    assert by_table["torque.values"] == pytest.approx(found, rel=1e-9, abs=1e-11)
    for i, j in ((1, 0), (2, 2)):
        unit = np.zeros((5, 3))
        unit[i, j] = 1.0
        close(
            found[i, j],
            lambda x, u=unit: plan.replace(system=driven(values + x * u)).run(start, steps=24).mu[-1] @ weights[:3],
            2e-4,
        )
