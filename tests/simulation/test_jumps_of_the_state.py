"""Jumps of the state at events: bouncing balls by closed form, impacts on SE(3), the order of the times, restarts by SciPy."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from scenes import Ball, Pendulum
from scipy.integrate import solve_ivp

import liemech as lm

BALL, E = Ball(9.81), 0.8
FALL, BODY_AXES = np.sqrt(2.0 / 9.81), [1.0, 1.6, 2.3, 2.0, 2.0, 2.0]
METHODS = [(lm.StormerVerlet(), {"h": 0.01}), (lm.RKMK(order=5), {"rtol": 1e-10})]


def height(t: float, state: Any) -> Any:
    return state.q[0]


def rebound(t: float, state: Any) -> Any:
    return BALL.state(q=state.q, p=-E * state.p)


BOUNCE = lm.Jump(height, rebound)


def bounces(h: float, count: int) -> np.ndarray:
    """The times of bounces of a ball that falls from h: T (1 + 2 e + ... + 2 e^k), T = sqrt(2 h/g)."""
    return np.sqrt(h) * FALL * (1.0 + 2.0 * np.cumsum(np.append(0.0, E ** np.arange(1.0, count))))


def to(t_end: float, options: dict[str, Any]) -> dict[str, Any]:
    """The options of a run to this time."""
    return options | ({"steps": round(t_end / options["h"])} if "h" in options else {"t_end": t_end})


@pytest.mark.parametrize("method, options", METHODS)
@pytest.mark.parametrize("compiled", [False, None])
def test_a_bouncing_ball_by_closed_form(method: Any, options: Any, compiled: Any) -> None:
    run = lm.integrate(BALL, method, BALL.state([1.0], [0.0]), events=BOUNCE, compiled=compiled, **to(3.0, options))
    times, states = run.events[0]
    expected = bounces(1.0, 6)
    assert times == pytest.approx(expected, rel=1e-13) and run.ended is None
    assert states.p[:, 0] == pytest.approx(-9.81 * FALL * E ** np.arange(6), rel=1e-12)
    # samples lie on both sides, and the steps end where they would without jumps
    behind = np.flatnonzero(np.diff(run.t) == 0.0) + 1
    assert np.array_equal(run.t[behind], times)
    assert run.p[behind, 0] == pytest.approx(-E * run.p[behind - 1, 0], rel=1e-15)
    if "h" in options:
        assert np.array_equal(np.delete(run.t, [*behind, *(behind - 1)]), np.arange(301) * 0.01)
    t = np.linspace(0.0, 3.0, 40)
    k = np.searchsorted(expected, t)
    since, v = t - np.append(-FALL, expected)[k], 9.81 * FALL * E**k
    parabola = v * since - 0.5 * 9.81 * since**2
    assert run.at(t).q[:, 0] == pytest.approx(parabola, abs=1e-11)


@pytest.mark.parametrize("method, options", METHODS)
def test_bodies_side_by_side_bounce_as_each_does_alone(method: Any, options: Any) -> None:
    heights = np.array([0.5, 0.9, 1.0, 1.4])
    several = BALL.state(heights[:, None], np.zeros((4, 1)))
    run = lm.integrate(BALL, method, several, events=BOUNCE, **to(2.0, options))
    for i, h in enumerate(heights):
        alone = lm.integrate(BALL, method, BALL.state([h], [0.0]), events=BOUNCE, **to(2.0, options))
        assert np.array_equal(run.events[0][i][0], alone.events[0][0])
        assert np.array_equal(run.last.q[i], alone.last.q)
        expected = bounces(h, 12)
        assert run.events[0][i][0] == pytest.approx(expected[expected < 2.0], rel=1e-12)
    if "h" in options:
        assert np.array_equal(run.at(1.234).q[2], alone_at(1.0, method, options, 1.234))


def alone_at(h: float, method: Any, options: Any, t: float) -> Any:
    """Where a ball is at a time."""
    return lm.integrate(BALL, method, BALL.state([h], [0.0]), events=BOUNCE, **to(2.0, options)).at(t).q


def test_a_run_that_goes_on_or_comes_from_a_file_bounces_on(tmp_path: Path) -> None:
    plan, start = lm.Plan(BALL, lm.StormerVerlet(), h=0.01, events=BOUNCE), BALL.state([1.0], [0.0])
    whole, part = plan.run(start, steps=200), plan.run(start, steps=131)
    part.save(tmp_path / "part.npz")
    loaded = lm.Trajectory.load(tmp_path / "part.npz", [__name__], trusted=True)
    for first in (part, loaded):
        assert first.then(plan.resume(first, steps=69)) == whole
    adaptive = lm.Plan(BALL, lm.RKMK(order=5), rtol=1e-9, events=BOUNCE)
    first = adaptive.run(start, t_end=1.3)
    assert first.then(adaptive.resume(first, t_end=2.0)).events[0][0] == pytest.approx(bounces(1.0, 3), rel=1e-12)


@pytest.mark.parametrize("steps", [37, 80, 97])
def test_balls_that_bounce_at_different_times_go_on_as_in_one_run(steps: int) -> None:
    # a ball with fewer bounces has fewer samples: it repeats the last one at the end, not where the runs meet
    plan = lm.Plan(BALL, lm.StormerVerlet(), h=0.01, events=BOUNCE)
    balls = BALL.state(q=[[1.0], [0.7], [0.4]], p=[[0.0], [0.0], [0.2]])
    first = plan.run(balls, steps=steps)
    assert first.then(plan.resume(first, steps=120 - steps)) == plan.run(balls, steps=120)


@pytest.mark.parametrize("method, options", METHODS)
def test_bounces_that_accumulate_end_a_run(method: Any, options: Any) -> None:
    def soft(t: float, state: Any) -> Any:
        return BALL.state(q=state.q, p=-0.3 * state.p)

    end = FALL * (1.0 + 2.0 * 0.3 / 0.7)
    with pytest.raises(lm.errors.StepTooSmall, match=r"height at t = 0\.8.* accumulate, .* comes to rest") as stopped:
        lm.integrate(BALL, method, BALL.state([1.0], [0.0]), events=lm.Jump(height, soft), **to(2.0, options))
    run = stopped.value.trajectory
    assert run.t[-1] == pytest.approx(end, rel=1e-12) and len(run.events[0][0]) > 12
    two = BALL.state([[1.0], [5.0]], [[0.0], [0.0]])
    with pytest.warns(RuntimeWarning, match="body 0"):
        run = lm.integrate(BALL, method, two, events=lm.Jump(height, soft), **to(1.5, options))
    assert set(run.stopped) == {0} and run.last.p[1, 0] == pytest.approx(
        0.3 * np.sqrt(98.1) - 9.81 * (1.5 - np.sqrt(10.0 / 9.81)), rel=1e-12
    )


def test_a_jump_that_stays_in_its_zero_is_refused() -> None:
    plastic = lm.Jump(height, lambda t, state: BALL.state(q=state.q, p=0.0 * state.p))
    with pytest.raises(lm.errors.StepTooSmall, match="at rest in the zero") as stopped:
        lm.integrate(BALL, lm.StormerVerlet(), BALL.state([1.0], [0.0]), h=0.01, steps=100, events=plastic)
    assert stopped.value.trajectory.t[-1] == pytest.approx(FALL, rel=1e-13)


def test_kicks_at_times_and_where_a_surface_is_crossed() -> None:
    """Jumps that do not turn the motion back are met once: rise, kick at t = 0.305, kick through q = 0.5."""
    kick = lm.Jump(lambda t, state: t - 0.305, lambda t, state: BALL.state(q=state.q, p=state.p + 2.0))
    brake = lm.Jump(lambda t, state: state.q[0] - 0.5, lambda t, state: BALL.state(q=state.q, p=0.5 * state.p))
    run = lm.integrate(BALL, lm.StormerVerlet(), BALL.state([0.0], [3.0]), h=0.01, steps=60, events=[kick, brake])
    q = 3.0 * 0.305 - 0.5 * 9.81 * 0.305**2
    v = 5.0 - 9.81 * 0.305
    assert run.events[0][0] == pytest.approx([0.305], rel=1e-15) and run.events[0][1].q[0, 0] == pytest.approx(
        q, rel=1e-13
    )
    crossed = 0.305 + (v - np.sqrt(v * v - 2.0 * 9.81 * (0.5 - q))) / 9.81
    assert run.events[1][0][0] == pytest.approx(crossed, rel=1e-13)
    assert run.events[1][1].p[0, 0] == pytest.approx(v - 9.81 * (crossed - 0.305), rel=1e-13)


@pytest.mark.parametrize("method, options", METHODS)
def test_a_run_backwards_undoes_the_bounces(method: Any, options: Any) -> None:
    there = lm.integrate(BALL, method, BALL.state([1.0], [0.0]), events=BOUNCE, **to(2.0, options))
    undo = lm.Jump(height, lambda t, state: BALL.state(q=state.q, p=-state.p / E))
    back_to = {"h": -options["h"], "steps": 200} if "h" in options else options | {"t_end": 0.0}
    back = lm.integrate(BALL, method, there.last, t0=2.0, events=undo, **back_to)
    assert back.last.q[0] == pytest.approx(1.0, abs=1e-11) and abs(back.last.p[0]) < 1e-11
    assert back.events[0][0] == pytest.approx(bounces(1.0, 3)[::-1], rel=1e-11)


def test_on_a_constraint_a_wall_throws_back() -> None:
    """A spherical pendulum in the plane x = 0, to which its speed is normal."""
    pendulum = lm.SphericalPendulum(mass=1.0, length=1.0)
    wall = lm.Jump(lambda t, s: s.q[0], lambda t, s: pendulum.state(q=s.q, p=-s.p))
    run = lm.integrate(
        pendulum, lm.RATTLE(), pendulum.consistent([0.6, 0.0, -0.8], [0.0, 0.0, 0.0]), h=0.01, steps=400, events=wall
    )
    times = run.events[0][0]
    assert len(times) == 4 and np.diff(times) == pytest.approx(2.0 * times[0] * np.ones(3), rel=1e-4)
    assert run.q[:, 0].min() > -1e-12 and abs(run.energy - run.energy[0]).max() < 1e-3


def test_a_linkage_is_braked_and_many_sites_are_not() -> None:
    """Halved momenta keep the constraints, and leave a quarter of the kinetic energy."""
    along, at = [1.0, 0.0, 0.0], [0.0, 0.0, 0.5]
    hinges = [
        lm.joints.RevoluteJoint(0, None, at, [0.0] * 3, along, along, name="a"),
        lm.joints.RevoluteJoint(1, 0, at, [0.0, 0.0, -0.5], along, along, name="b"),
    ]
    arm = lm.joints.Linkage([lm.joints.Link(1.0, [0.1] * 3)] * 2, hinges, gravity=0.0)
    brake = lm.Jump(lambda t, s: t - 0.105, lambda t, s: arm.state(mu=0.5 * np.array(s.mu), g=s.g))
    start = arm.state(angles={}, rates={"a": 1.0, "b": -0.5})
    run = lm.integrate(arm, lm.LieRATTLE(), start, h=0.01, steps=20, events=brake, compiled=False)
    k = int(np.flatnonzero(np.diff(run.t) == 0.0)[0])
    assert run.energy[k + 1] == pytest.approx(0.25 * run.energy[k], rel=1e-13)
    assert run.energy[-1] == pytest.approx(0.25 * run.energy[0], rel=1e-3)
    spins = lm.LiePoissonSystem(lm.SO3() ** 400, lm.PerSite(lm.KineticEnergy([1.0, 2.0, 3.0])))
    flip = lm.Jump(lambda t, state: t - 0.1, lambda t, state: state)
    with pytest.raises(lm.errors.IncompatibleSystem, match="has no jumps of the state"):
        lm.integrate(spins, lm.CovariantVariational(), spins.state(np.ones((400, 3))), h=0.1, steps=4, events=flip)


@lm.record
class Billiard(lm.SeparableSystem):
    """A point without forces in the plane."""

    degrees: ClassVar[int] = 2

    def kinetic(self, p: Any) -> Any:
        return lm.dot(p, p) / 2.0

    def potential(self, q: Any) -> Any:
        return 0.0 * q[0]


@pytest.mark.parametrize("method, options", METHODS)
def test_a_corner_is_met_by_both_walls_at_once(method: Any, options: Any) -> None:
    """A point on the diagonal of a square comes back on it, whatever rounding says of which wall is first."""
    table = Billiard()
    walls = [
        lm.Jump(
            lambda t, state, i=i, at=at: state.q[i] - at,
            lambda t, state, i=i: table.state(q=state.q, p=[-x if k == i else x for k, x in enumerate(state.p)]),
        )
        for i in (0, 1) for at in (0.0, 1.0)
    ]  # fmt: skip
    start = table.state([0.3, 0.3], [0.7, 0.7])
    run = lm.integrate(table, method, start, events=walls, **to(10.0, options))
    fold = abs((0.3 + 0.7 * run.t + 1.0) % 2.0 - 1.0)
    assert run.q == pytest.approx(np.stack([fold, fold], axis=1), abs=1e-12)
    assert [len(times) for times, _ in run.events] == [3, 4, 3, 4]


# ------------------------------------------------------------------ impacts on SE(3)

BRICK = lm.MechanicalSystem(
    lm.LiePoissonSystem(lm.SE3(), lm.KineticEnergy(BODY_AXES)), lm.models.UniformGravity(3.0, [0, 0, 0])
)
CORNER = lm.vec(0.3, -0.2, -0.4)


def corner(t: float, state: Any) -> Any:
    """The height of a point of the body above the plane z = -1."""
    return lm.dot(state.g[2, :3], CORNER) + state.g[2, 3] + 1.0


def thrown() -> Any:
    return BRICK.state(mu=[0.3, -0.5, 0.4, 0.8, 0.2, -0.3], g=np.eye(4))


@pytest.mark.slow
@pytest.mark.parametrize("restitution, t_end", [(1.0, 4.0), (0.6, 3.0)])
def test_an_impact_keeps_what_the_plane_keeps(restitution: float, t_end: float) -> None:
    """Momenta along the plane and about its normal; energy, for e = 1, else it falls by Newton's law."""
    bounce = lm.impact(BRICK, corner, restitution)
    run = lm.integrate(BRICK, lm.RKMK(order=5), thrown(), t_end=t_end, rtol=1e-9, events=bounce)
    after = np.flatnonzero(np.diff(run.t) == 0.0) + 1
    before = after - 1
    assert len(after) >= 2 and np.array_equal(run.g[after], run.g[before])
    kept = run.spatial_momentum[:, 2:5]  # about z through the origin, along x and y
    assert kept[after] == pytest.approx(kept[before], abs=4e-15)
    normal = run.g[after, 2, :3]
    w = np.concatenate([np.cross(CORNER, normal), normal], axis=1)
    rates = [np.sum(w * run.mu[side] / BODY_AXES, axis=1) for side in (before, after)]
    assert (rates[0] < 0.0).all() and rates[1] == pytest.approx(-restitution * rates[0], rel=1e-12)
    lost = (1.0 - restitution**2) * rates[0] ** 2 / (2.0 * np.sum(w * w / BODY_AXES, axis=1))
    assert run.energy[before] - run.energy[after] == pytest.approx(lost, abs=1e-14)


@pytest.mark.slow
def test_bodies_of_an_ensemble_bounce_by_the_inertia_of_each() -> None:
    """For e = 1 each keeps its energy."""
    light: Any = lm.LiePoissonSystem(lm.SE3(), lm.KineticEnergy([0.3, 0.6, 0.4, 2.0, 2.0, 2.0]))
    light = lm.MechanicalSystem(light, BRICK.potential)
    start = BRICK.state(mu=[[0.3, -0.5, 0.4, 0.8, 0.2, -0.3]] * 2, g=np.array([np.eye(4)] * 2))
    run = lm.integrate(
        [BRICK, light], lm.RKMK(order=5), start, t_end=1.5, rtol=1e-9, events=lm.impact(BRICK, corner), compiled=False
    )
    assert [len(times) for times, _ in run.events[0]] == [1, 1]
    assert run.energy[-1] == pytest.approx(run.energy[0], rel=1e-7)


@pytest.mark.slow
def test_a_corner_that_comes_to_rest_does_not_sink() -> None:
    """Where rounding decides, an impact would turn the corner into the floor."""
    with pytest.raises(lm.errors.StepTooSmall, match="accumulate") as stopped:
        lm.integrate(BRICK, lm.RKMK(order=5), thrown(), t_end=4.0, rtol=1e-9, events=lm.impact(BRICK, corner, 0.6))
    gaps = corner_heights(stopped.value.trajectory)
    assert gaps.min() > -1e-14 and abs(gaps[-1]) < 1e-14


def corner_heights(run: Any) -> np.ndarray:
    return run.g[:, 2, :3] @ np.array(CORNER) + run.g[:, 2, 3] + 1.0


@pytest.mark.slow
def test_times_of_impacts_have_the_order_of_the_method() -> None:
    """A free brick with spin: the second impact, whose time depends on the first, by steps of order 2."""
    bounce = lm.impact(BRICK, corner)
    exact = lm.integrate(BRICK, lm.RKMK(order=8), thrown(), t_end=3.0, rtol=1e-13, atol=1e-14, events=bounce)
    errors = []
    for steps in (75, 150, 300):
        run = lm.integrate(BRICK, lm.LieVerlet(), thrown(), h=3.0 / steps, steps=steps, events=bounce)
        errors.append(abs(run.events[0][0][1] - exact.events[0][0][1]))
    orders = np.log2(np.array(errors)[:-1] / errors[1:])
    assert orders == pytest.approx([2.0, 2.0], abs=0.25)


def test_a_ball_that_grips_reverses_the_velocity_of_its_contact() -> None:
    """Garwin, Am. J. Phys. 37 (1969), 88: a superball, I = 2/5 m r^2, keeps its energy and its angular momentum about the
    contact: u' + a' = -(u + a), u' - 2/5 a' = u - 2/5 a, with the velocities u of its centre and a = -r omega that the spin
    adds at the contact.
    """
    m, r, inertia = 1.5, 0.1, 0.4 * 1.5 * 0.1**2
    ball = lm.MechanicalSystem(
        lm.LiePoissonSystem(lm.SE3(), lm.KineticEnergy([inertia] * 3 + [m] * 3)),
        lm.models.UniformGravity(m * 9.81, [0, 0, 0]),
    )

    def grips(t: float, state: Any) -> Any:
        turned = lm.SE3().K(state.g, state.mu)  # in space, about the origin
        place, p = np.array(state.g)[:3, 3], np.array(turned)[3:]
        spin = np.array(turned)[:3] - np.cross(place, p)
        u, a = p[0] / m, -r * spin[1] / inertia  # the contact moves by u + a
        u, a = (3.0 * u - 4.0 * a) / 7.0, -(10.0 * u + 3.0 * a) / 7.0
        p, spin = np.array([m * u, p[1], -p[2]]), np.array([spin[0], -inertia * a / r, spin[2]])
        momentum = np.append(spin + np.cross(place, p), p)
        return ball.state(mu=lm.SE3().K(lm.SE3().inverse(state.g), lm.vec(*momentum)), g=state.g)

    lies = np.eye(4)
    lies[2, 3] = 0.5
    start = ball.state(mu=[0.0, inertia * 20.0, 0.0, 0.0, 0.0, 0.0], g=lies)
    touch = lm.Jump(lambda t, state: state.g[2, 3] - r, grips)
    run = lm.integrate(ball, lm.RKMK(order=5), start, t_end=1.5, rtol=1e-10, events=touch)
    assert len(run.events[0][0]) == 3
    assert run.energy == pytest.approx(run.energy[0] * np.ones(len(run)), rel=1e-9)
    behind = np.flatnonzero(np.diff(run.t) == 0.0) + 1
    jumps = run.energy[behind] - run.energy[behind - 1]
    assert jumps == pytest.approx(np.zeros(3), abs=1e-13)
    # about the contact, I omega + r e_z x m u: kept
    spatial = run.spatial_momentum
    about = spatial[:, :3] - np.cross(run.g[:, :3, 3] - [0.0, 0.0, r], spatial[:, 3:])
    assert about[behind, 1] == pytest.approx(about[behind - 1, 1], rel=1e-12)
    assert spatial[behind[1], 3] / m == pytest.approx(0.0, abs=1e-8)  # the second bounce takes back the first


def test_restarts_by_scipy_give_the_same_bounces() -> None:
    """A pendulum that hits a wall, e = 0.7."""
    pendulum, e = Pendulum(), 0.7
    wall = lm.Jump(lambda t, s: s.q[0] - 0.3, lambda t, s: pendulum.state(q=s.q, p=-e * s.p))
    run = lm.integrate(pendulum, lm.RKMK(order=8), pendulum.state([-1.2], [0.0]), t_end=12.0, rtol=1e-12, events=wall)

    def met(t: float, y: Any) -> Any:
        return y[0] - 0.3

    met.terminal, met.direction = True, 1.0  # type: ignore[attr-defined]
    t, y, times = 0.0, [-1.2, 0.0], []
    while t < 12.0:
        part = solve_ivp(
            lambda t, y: [y[1], -np.sin(y[0])], (t, 12.0), y, method="DOP853", rtol=1e-12, atol=1e-13, events=met
        )
        t, y = part.t[-1], [part.y[0, -1], -e * part.y[1, -1]]
        times += [*part.t_events[0]]
    assert len(times) >= 3 and run.events[0][0] == pytest.approx(times, abs=1e-9)


@lm.record
class Fast(lm.CotangentSystem):
    """A particle near the speed of light in the plane, in a field along y: H = sqrt(1 + p^2) + k y."""

    configurations: ClassVar[lm.LieGroup] = lm.VectorSpace(2)
    k: float

    def energy(self, mu: lm.Vec, g: Any) -> float:
        return lm.formulas.sqrt(1.0 + lm.dot(mu, mu)) + self.k * g[1]


@pytest.mark.parametrize("restitution", [1.0, 0.5])
def test_an_energy_that_is_not_quadratic_rebounds_by_newtons_law(restitution: float) -> None:
    """p_x stays, and v_y = p_y/sqrt(1 + p^2) is turned back: p_y = v sqrt((1 + p_x^2)/(1 - v^2))."""
    particle = Fast(0.3)
    floor = lm.impact(particle, lambda t, state: state.g[1], restitution)
    start = particle.state(mu=[1.0, -2.0], g=[0.0, 1.0])
    run = lm.integrate(particle, lm.RKMK(order=5), start, h=0.1, steps=20, events=floor, compiled=False)
    k = int(np.flatnonzero(np.diff(run.t) == 0.0)[0])
    (x, y), after = run.mu[k], run.mu[k + 1]
    v = -restitution * y / np.sqrt(1.0 + x * x + y * y)
    assert after == pytest.approx([x, v * np.sqrt((1.0 + x * x) / (1.0 - v * v))], rel=1e-13)
    if restitution == 1.0:
        assert run.energy[k + 1] == pytest.approx(run.energy[k], rel=1e-14)


# ------------------------------------------------------------------ borders


def test_what_is_no_jump_is_refused() -> None:
    start = BALL.state([1.0], [0.0])
    with pytest.raises(lm.errors.InvalidType, match="Jump: then is a function"):
        lm.Jump(height, 3.0)
    with pytest.raises(lm.errors.InvalidType, match="returns a state"):
        lm.integrate(BALL, lm.StormerVerlet(), start, h=0.1, steps=10, events=lm.Jump(height, lambda t, s: -s.p))
    free = lm.RigidBody([1.0, 2.0, 3.0])
    half = lm.Jump(lambda t, s: t - 0.25, lambda t, s: free.state(mu=0.5 * s.mu))
    with pytest.raises(lm.errors.InvalidInput, match=r"leaves parts out; .* all of mu, g"):
        lm.integrate(free, lm.RKMK(order=4), free.state([1.0, 0.2, 0.3], np.eye(3)), h=0.1, steps=10, events=half)
    slow = lm.integrate(free, lm.RKMK(order=4), free.state([1.0, 0.2, 0.3]), h=0.1, steps=10, events=half)
    assert slow.energy[-1] == pytest.approx(0.25 * slow.energy[0], rel=1e-7)
    with pytest.raises(lm.errors.InvalidInput, match="impact: restitution is a number"):
        lm.impact(BRICK, corner, 0.0)
    with pytest.raises(lm.errors.InvalidType, match="a body in a field"):
        lm.impact(BALL, height)
    plan = lm.Plan(BALL, lm.StormerVerlet(), h=0.1, events=BOUNCE)
    for call in (
        lambda: plan.begin(start),
        lambda: plan.step(plan.run(start, steps=1).carry),
        lambda: plan.stepper(start),
    ):
        with pytest.raises(lm.errors.InvalidInput, match="no Jump would be made"):
            call()
    with pytest.raises(lm.errors.IncompatibleSystem, match="double-double"):
        lm.Plan(BALL, lm.StormerVerlet(), h=0.1, events=BOUNCE, precision="double-double")
