"""Ensembles whose members have parameters and steps of their own: bit for bit their single runs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import liemech as lm

RNG = np.random.default_rng(11)
MU = RNG.normal(size=(19, 3))
BODIES = [lm.RigidBody(np.sort(moments)) for moments in RNG.uniform(1.0, 1.9, size=(19, 3))]
STARTS = BODIES[0].state(mu=MU, g=np.eye(3))
WORLDS = pytest.mark.parametrize(
    "compiled", [False, pytest.param(True, marks=pytest.mark.compiled)], ids=["plain", "compiled"]
)


def alone(body: int, method: lm.Method, **options: Any) -> lm.Trajectory:
    system = BODIES[body]
    return lm.integrate(
        system, method, system.state(mu=MU[body], g=np.eye(3)), compiled=False, **options
    )


@pytest.mark.sample(2)
@WORLDS
@pytest.mark.parametrize(
    "method", [lm.RKMK(order=4), lm.CovariantVariational(lm.Cayley())], ids=repr
)
def test_every_body_has_its_inertia(method: lm.Method, compiled: bool) -> None:
    """Also where the method begins with a velocity, and where the last lanes are not full."""
    run = lm.integrate(BODIES, method, STARTS, h=0.1, steps=20, compiled=compiled)
    for i in range(0, 19, 3):
        one = alone(i, method, h=0.1, steps=20)
        assert np.array_equal(run.mu[:, i], one.mu)
        assert np.array_equal(run.g[:, i], one.g)
        assert np.array_equal(run.energy[:, i], one.energy)
    assert run.drift()["Casimir 1"].verdict == "exact"


@pytest.mark.slow
@pytest.mark.compiled
def test_other_parameters_use_the_same_code_and_resume() -> None:
    plan = lm.Plan(BODIES, lm.CovariantVariational(lm.Cayley()), 0.1, compiled=True)
    whole = plan.run(STARTS, steps=30)
    assert np.array_equal(plan.resume(plan.run(STARTS, steps=12), steps=18).mu, whole.mu[12:])
    turned = plan.replace(system=BODIES[::-1])
    back = turned.run(BODIES[0].state(mu=MU[::-1], g=np.eye(3)), steps=30)
    assert np.array_equal(back.mu[:, ::-1], whole.mu)
    with pytest.raises(lm.errors.InvalidInput, match="another system"):
        turned.resume(whole, steps=1)


def test_what_the_systems_of_an_ensemble_must_be() -> None:
    given = dict(h=0.1, steps=2)
    for systems, message in (
        (BODIES[:3], "3 systems for 19 bodies"),
        (
            [*BODIES[:18], lm.RigidBody(np.diag([1.0, 1.5, 2.0]))],
            "system 18, .* is of another kind than system 0",
        ),
        ([], "one for each body"),
        ([*BODIES[:18], 3.0], "got 3.0"),
    ):
        with pytest.raises(lm.errors.InvalidInput, match=message):
            lm.integrate(systems, lm.RKMK(order=4), STARTS, **given)  # type: ignore[arg-type]
    with pytest.raises(lm.errors.InvalidInput, match="19 systems for a start of one"):
        lm.integrate(BODIES, lm.RKMK(order=4), BODIES[0].state(mu=MU[0]), **given)  # type: ignore[arg-type]


@pytest.mark.sample(1)
@WORLDS
def test_every_body_chooses_its_steps(compiled: bool) -> None:
    method, given = lm.RKMK(order=5), dict(t_end=1.0, rtol=1e-8, t_eval=[0.5, 1.0])
    run = lm.integrate(BODIES, method, STARTS, compiled=compiled, **given)
    assert run.mu.shape == (2, 19, 3)
    for i in range(0, 19, 6):
        assert np.array_equal(run.mu[:, i], alone(i, method, **given).mu)
    ends = lm.integrate(BODIES[2], method, STARTS, t_end=1.0, rtol=1e-8, compiled=compiled)
    assert np.array_equal(ends.t, [0.0, 1.0])
    assert np.array_equal(ends.g[0], np.tile(np.eye(3), (19, 1, 1)))


@lm.record
class Blowing(lm.Hamiltonian):
    """Its third momentum grows without bound where the first is not zero."""

    def energy(self, mu: lm.Vec) -> float:
        return mu[0] * mu[2] * mu[2] * mu[1]


def test_a_body_that_fails_fails_alone() -> None:
    system = lm.LiePoissonSystem(lm.SO3(), Blowing())

    starts = system.state(mu=[[0.0, 0.0, 1.0], [1.0, 2.0, 3.0]])
    with pytest.warns(RuntimeWarning, match="1 of 2 bodies stopped early: body 1 after"):
        run = lm.integrate(
            system,
            lm.RKMK(order=5),
            starts,
            t_end=50.0,
            steps=40,
            t_eval=[0.0, 25.0, 50.0],
            compiled=False,
        )
    assert list(run.stopped) == [1]
    assert "40 steps led to" in str(run.stopped[1].error)
    assert np.array_equal(run.mu[:, 0], np.tile([0.0, 0.0, 1.0], (3, 1)))
    assert np.isfinite(run.mu).all()


@pytest.mark.compiled
def test_columns_of_large_ensembles_lie_apart() -> None:
    """2^13 bodies would have all their numbers a multiple of a page apart, where few of them find
    room in the cache: more columns are laid out, of which nothing is seen.
    """
    body, method, n = lm.RigidBody([1.0, 1.5, 2.0]), lm.RKMK(order=4), 2**13
    mu, h = np.random.default_rng(5).normal(size=(n, 3)), np.linspace(0.05, 0.1, 2**13)
    plan = lm.Plan(body, method, h, every=2, compiled=True)
    run = plan.run(body.state(mu=mu), steps=2)
    assert run.carry.shape.columns(n) % 2**8 and run.mu.shape == (2, n, 3)
    whole = plan.resume(run, steps=2)
    for i in (0, 4095, n - 1):
        alone = lm.integrate(body, method, body.state(mu=mu[i]), h=h[i], steps=4, compiled=True)
        assert np.array_equal(alone.mu[-1], whole.mu[-1, i])
