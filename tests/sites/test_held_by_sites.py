"""Sites that are held, said once, stay where they are: under loads, in every method, and in noise."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scenes import Spring
from scipy.integrate import solve_ivp
from terms_of_spins import Exchange

import liemech as lm
from liemech import neighbours as near
from liemech.errors import InvalidInput

N = 6


@lm.record
class Wind(lm.Term):
    F: lm.Vec

    def covector(self, t: float, a: Any) -> lm.Vec:
        return self.F - 0.1 * a.xi


@lm.record
class Gust(lm.Term):
    """A torque and a force, in the axes of the body."""

    F: lm.Vec

    def covector(self, t: float, a: Any) -> lm.Vec:
        return self.F


@lm.record
class Tie(lm.Term):
    def energy(self, a: Any, b: Any) -> float:
        d = a.g[:3, 3] - b.g[:3, 3]
        return lm.dot(d, d)


def masses(held: Any, of_load: Any = ()) -> tuple[Any, Any]:
    body = lm.LiePoissonSystem(lm.VectorSpace(3) ** N, lm.PerSite(lm.KineticEnergy([1.0, 1.0, 1.0])))
    field = lm.Terms(Spring(5.0).over(near.chain(N)), held=held)
    system = lm.MechanicalSystem(body, field, load=lm.Terms(Wind([0.0, 1.0, 0.0]), held=of_load))
    places = np.c_[np.arange(N) * 1.0, np.zeros((N, 2))]
    return system, system.state(mu=np.zeros((N, 3)), g=places)


def reference(t: float) -> np.ndarray:
    """Five masses on springs in the wind, the first of six at rest."""

    def rate(_: float, y: np.ndarray) -> np.ndarray:
        x, v = y.reshape(2, N, 3)
        pull = np.diff(x, axis=0)
        force = np.zeros((N, 3))
        force[:-1] += 5.0 * pull
        force[1:] -= 5.0 * pull
        force += [0.0, 1.0, 0.0] - 0.1 * v
        force[0] = 0.0
        return np.concatenate([v.ravel(), force.ravel()])

    start = np.concatenate([np.c_[np.arange(N) * 1.0, np.zeros((N, 2))].ravel(), np.zeros(3 * N)])
    found = solve_ivp(rate, (0.0, t), start, method="DOP853", rtol=1e-11, atol=1e-12)
    return found.y[: 3 * N, -1].reshape(N, 3)


@pytest.mark.slow
@pytest.mark.parametrize("compiled", [False, None])
@pytest.mark.parametrize("small", [0, 48])
@pytest.mark.parametrize(
    ("method", "error"),
    [
        (lm.RKMK(order=4), 1e-4),
        (lm.KickDrift(), 1e-2),
        (lm.LieVerlet(), 1e-2),
        (lm.Taylor(6, lm.Exponential()), 1e-6),
        (lm.GalerkinVariational(order=2), 1e-2),
        (lm.GalerkinVariational(order=4), 1e-3),
        (lm.CommutatorFree(order=4), 1e-4),
    ],
)
def test_a_load_leaves_them(
    method: Any, error: float, small: int, compiled: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lm.System, "small", small)
    system, start = masses([0])
    run = lm.integrate(system, method, start, h=0.05, steps=20, compiled=compiled, progress=False)
    g = np.asarray(run.g[-1]).reshape(N, 3)
    assert np.array_equal(g[0], [0.0, 0.0, 0.0])
    assert np.abs(g - reference(1.0)).max() < error


@pytest.mark.slow
def test_what_is_held_is_said_anywhere() -> None:
    """In the load, or in both: those of all."""
    for held, of_load in (((), [0]), ([0], [0]), ([0], [5])):
        system, start = masses(held, of_load)
        run = lm.integrate(system, lm.KickDrift(), start, h=0.05, steps=10, progress=False)
        for i in {*held, *of_load}:
            assert np.array_equal(run.g[-1, i], run.g[0, i])
        assert np.abs(run.g[-1, 1] - run.g[0, 1]).max() > 0.01


@pytest.mark.slow
@pytest.mark.parametrize("method", [lm.RKMK(order=4), lm.KickDrift(), lm.LieVerlet(), lm.GalerkinVariational(order=4)])
def test_pinned_sites_turn_where_they_are(method: Any) -> None:
    """A body on a pin, driven about its axis by a constant torque, omega = M t/J, beside others."""
    J = [0.6, 0.6, 0.9, 1.0, 1.0, 1.0]
    body = lm.LiePoissonSystem(lm.SE3() ** 3, lm.PerSite(lm.KineticEnergy(J)))
    gust = Gust([0.0, 0.0, 0.45, 1.0, 2.0, 3.0])
    system = lm.MechanicalSystem(body, lm.Terms(Tie().over(near.chain(3)), pinned=[0]), load=lm.Terms(gust))
    g = np.tile(np.eye(4), (3, 1, 1))
    g[:, 0, 3] = np.arange(3)
    run = lm.integrate(system, method, system.state(mu=np.zeros((3, 6)), g=g), h=0.02, steps=50, progress=False)
    assert np.array_equal(run.g[-1, 0, :3, 3], [0.0, 0.0, 0.0])
    assert np.abs(run.mu[-1, 0] - [0.0, 0.0, 0.45, 0.0, 0.0, 0.0]).max() < 1e-12
    angle = np.arctan2(run.g[-1, 0, 1, 0], run.g[-1, 0, 0, 0])
    assert abs(angle - 0.25) < 1e-3
    assert np.abs(run.g[-1, 1, :3, 3] - [1.0, 0.0, 0.0]).max() > 0.1


@pytest.mark.slow
@pytest.mark.parametrize("small", [0, 300])
@pytest.mark.parametrize("method", [lm.KickDrift(), lm.KickDrift(order=4), lm.LieVerlet()], ids=repr)
def test_what_the_energy_of_bodies_holds_rests_in_every_method(
    method: Any, small: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The motion does not depend on whether bodies, field or load say it; a mass between two that are held swings as
    one on a spring.
    """
    monkeypatch.setattr(lm.System, "small", small)
    runs = []
    for which in range(3):
        own: list[dict[str, Any]] = [{}, {}, {}]
        own[which] = {"held": [0, 2]}
        body = lm.LiePoissonSystem(
            lm.VectorSpace(3) ** 3,
            lm.Terms(lm.PerSite(lm.KineticEnergy(lm.each([[m] * 3 for m in (1.0, 2.0, 3.0)]))), **own[0]),
        )
        field, load = lm.Terms(Spring(4.0).over(near.chain(3)), **own[1]), lm.Terms(Gust([0.0] * 3), **own[2])
        system = lm.MechanicalSystem(body, field, load=load)
        start = system.state(mu=[[0.0] * 3, [0.3, 0.0, 0.1], [0.0] * 3], g=[[-1.0, 0, 0], [0.2, 0.1, 0], [1.0, 0, 0]])
        runs.append(lm.integrate(system, method, start, h=0.05, steps=10, compiled=False))
        with pytest.raises(InvalidInput, match="held"):
            system.state(mu=np.ones((3, 3)), g=start.g)
    assert all(np.array_equal(run.mu, runs[0].mu) and np.array_equal(run.g, runs[0].g) for run in runs)
    assert np.array_equal(runs[0].g[-1, [0, 2]], [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    swing = np.array([0.2, 0.1, 0.0]) * np.cos(1.0) + np.array([0.3, 0.0, 0.1]) / 4.0 * np.sin(1.0)
    assert np.allclose(runs[0].g[-1, 1], swing, rtol=0.0, atol=1e-3)


def test_what_would_move_them_is_refused() -> None:
    class Push(lm.Force):
        def covector(self, t: float, xi: Any, g: Any) -> Any:
            return 0.0 * xi + 1.0

    body = lm.LiePoissonSystem(lm.VectorSpace(3) ** N, lm.PerSite(lm.KineticEnergy([1.0] * 3)))
    with pytest.raises(InvalidInput, match=r"\[0\] are held.*write it as Terms"):
        lm.MechanicalSystem(body, lm.Terms(Spring(1.0).over(near.chain(N)), held=[0]), load=lm.record(Push)())
    J = np.diag([0.6, 0.8, 0.9, 1.0, 1.0, 1.0])
    J[0, 4] = J[4, 0] = 0.2  # the centre of mass is elsewhere
    bodies = lm.LiePoissonSystem(lm.SE3() ** 2, lm.PerSite(lm.KineticEnergy(J)))
    with pytest.raises(InvalidInput, match="about the points that stay"):
        lm.MechanicalSystem(bodies, lm.Terms(Tie().over(near.chain(2)), pinned=[0]))


@pytest.mark.slow
def test_momenta_that_are_coupled_move_no_held_site() -> None:
    @lm.record
    class Drag(lm.Term):
        def energy(self, a: Any, b: Any) -> float:
            return 0.3 * lm.dot(a.mu, b.mu)

    terms = lm.Terms(lm.PerSite(lm.KineticEnergy([1.0] * 3)), Drag().over(near.chain(N)))
    system = lm.MechanicalSystem(
        lm.LiePoissonSystem(lm.VectorSpace(3) ** N, terms), lm.Terms(Spring(1.0).over(near.chain(N)), held=[0])
    )
    mu = np.random.default_rng(3).normal(size=(N, 3))
    mu[0] = 0.0
    run = lm.integrate(system, lm.RKMK(order=4), system.state(mu=mu, g=np.zeros((N, 3))), h=0.05, steps=5)
    assert np.array_equal(run.g[-1, 0], [0.0, 0.0, 0.0])
    assert np.abs(run.g[-1, 1]).max() > 0.01


@pytest.mark.parametrize("compiled", [False, None])
@pytest.mark.parametrize("method", [lm.WongZakai(), lm.NinomiyaVictoir()])
@pytest.mark.parametrize("kind", ["noise", "bath"])
def test_noise_leaves_them(kind: str, method: Any, compiled: Any) -> None:
    spins = lm.LiePoissonSystem(lm.SO3() ** 4, lm.Terms(Exchange(1.0).over(near.chain(4)), held=[0]))
    if kind == "bath":
        system = lm.thermal_bath(spins, damping=0.2, temperature=0.5)
    else:
        system = lm.Stochastic(spins, [[0.3, 0.1, -0.4]])
    start = system.state(mu=np.tile([0.0, 0.0, 1.0], (4, 1)), g=np.tile(np.eye(3), (4, 1, 1)))
    run = lm.integrate(system, method, start, h=0.1, steps=2, compiled=compiled, progress=False)
    assert np.array_equal(run.mu[-1, 0], [0.0, 0.0, 1.0])
    assert np.array_equal(run.g[-1, 0], np.eye(3))
    assert np.abs(run.mu[-1, 1:] - [0.0, 0.0, 1.0]).max(axis=1).min() > 0.01


def test_damping_moves_no_pinned_site() -> None:
    """Of bodies on pins with momenta along and about them: damping turns them and leaves their places."""
    body = lm.LiePoissonSystem(
        lm.SE3() ** 2, lm.Terms(lm.PerSite(lm.KineticEnergy([0.6, 0.8, 0.9, 1.0, 1.0, 1.0])), pinned=[0])
    )
    system = lm.DoubleBracket(body, 0.2)
    start = system.state(mu=np.random.default_rng(1).normal(size=(2, 6)), g=np.tile(np.eye(4), (2, 1, 1)))
    run = lm.integrate(system, lm.RKMK(order=4), start, h=0.05, steps=10, progress=False)
    assert np.array_equal(run.g[-1, 0, :3, 3], [0.0, 0.0, 0.0])
    assert np.abs(run.g[-1, 1, :3, 3]).max() > 0.01


def test_without_a_field() -> None:
    body = lm.LiePoissonSystem(lm.VectorSpace(3) ** N, lm.PerSite(lm.KineticEnergy([1.0] * 3)))
    system = lm.MechanicalSystem(body, lm.NoPotential(), load=lm.Terms(Wind([0.0, 1.0, 0.0]), held=[2]))
    run = lm.integrate(
        system, lm.RKMK(order=4), system.state(mu=np.zeros((N, 3)), g=np.zeros((N, 3))), h=0.1, steps=5, compiled=False
    )
    g = np.asarray(run.g[-1]).reshape(N, 3)
    assert np.array_equal(g[2], [0.0, 0.0, 0.0])
    x = 10.0 * 0.5 - 100.0 * (1.0 - np.exp(-0.05))  # y'' = 1 - 0.1 y'
    assert np.abs(g[[0, 1, 3, 4, 5], 1] - x).max() < 1e-6


@lm.record
class AirDrag(lm.Term):
    """That of a ball in air, whose size has no derivative by the velocity at rest."""

    c: float

    def covector(self, t: float, a: Any) -> lm.Vec:
        return -(self.c * lm.norm(a.xi)) * a.xi


@pytest.mark.parametrize("compiled", [False, None])
@pytest.mark.parametrize("method", [lm.KickDrift(), lm.LieVerlet()], ids=repr)
@pytest.mark.sample(2)
def test_a_load_on_them_need_not_have_a_derivative_at_rest(method: Any, compiled: Any) -> None:
    """A chain of balls in air hangs from one that is held: order 2 beside DOP853."""
    body = lm.LiePoissonSystem(lm.VectorSpace(3) ** N, lm.PerSite(lm.KineticEnergy([1.0, 1.0, 1.0])))
    drag = lm.Terms(AirDrag(0.7), held=[0])
    system = lm.MechanicalSystem(body, lm.Terms(Spring(5.0).over(near.chain(N))), load=drag)
    rng = np.random.default_rng(8)
    x, v = rng.normal(size=(2, N, 3))
    v[0] = 0.0

    def motion(_: float, y: np.ndarray) -> np.ndarray:
        x, v = y.reshape(2, N, 3)
        pull = 5.0 * np.diff(x, axis=0)
        force = np.pad(pull, ((0, 1), (0, 0))) - np.pad(pull, ((1, 0), (0, 0)))
        force -= 0.7 * np.linalg.norm(v, axis=1)[:, None] * v
        force[0] = 0.0
        return np.concatenate([v.ravel(), force.ravel()])

    wanted = solve_ivp(motion, (0.0, 0.2), np.r_[x.ravel(), v.ravel()], method="DOP853", rtol=1e-12, atol=1e-13).y[
        :, -1
    ]
    errors = []
    for steps in (4, 8):
        run = lm.integrate(system, method, system.state(mu=v, g=x), h=0.2 / steps, steps=steps, compiled=compiled)
        errors.append(np.abs(np.r_[run.g[-1].ravel(), run.mu[-1].ravel()] - wanted).max())
        assert np.array_equal(run.g[-1, 0], x[0])
    assert errors[0] < 0.05 and 3.5 < errors[0] / errors[1] < 4.5
