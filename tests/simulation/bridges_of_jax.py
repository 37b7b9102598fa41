"""What JAX is asked of runs, in a process of its own: `test_bridges` starts it, for JAX has threads, beside
which other tests could not fork.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.errors import IncompatibleSystem, InvalidInput, InvalidType

INERTIA = [1.0, 1.5, 2.0]


@lm.record
class Torque(lm.Force):
    """A torque that a table gives, seen from the body."""

    torque: Any

    def covector(self, t, xi, g):
        return self.torque(t)


def driven() -> lm.Plan:
    table = lm.PiecewisePolynomial.linear(np.linspace(0.0, 2.0, 6), np.full((6, 3), 0.1))
    system = lm.MechanicalSystem(lm.RigidBody(INERTIA), lm.NoPotential(), load=Torque(table))
    return lm.Plan(system, lm.RKMK(order=4), h=0.1)


@pytest.fixture(scope="module")
def jax() -> Any:
    jax = pytest.importorskip("jax")
    jax.config.update("jax_enable_x64", True)
    return jax


PLAN = lm.Plan(lm.RigidBody(INERTIA), lm.CovariantVariational(lm.Cayley()), h=0.1)
MU, ATTITUDE = np.array([0.3, -0.5, 0.9]), lm.SO3().exp([0.2, 0.1, -0.4])


def test_jax_knows_the_derivatives_by_start_and_parameters(jax: Any) -> None:
    from jax.test_util import check_grads

    move = lm.to_jax(PLAN, steps=12)

    def end(mu: Any, eta: Any, inertia: Any) -> Any:
        x, y, z = eta
        hat = jax.numpy.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        g = ATTITUDE @ jax.scipy.linalg.expm(hat)
        found = move({"mu": mu, "g": g}, inertia=inertia)
        return found["mu"], found["g"]

    given = jax.numpy.array(MU), jax.numpy.zeros(3), jax.numpy.array(INERTIA)
    check_grads(end, given, order=1, modes=["rev"], atol=1e-7, rtol=1e-6)
    run = PLAN.run(PLAN.system.state(mu=MU, g=ATTITUDE), steps=12)
    for found, part in zip(end(*given), ("mu", "g"), strict=True):
        assert (np.asarray(found) == run.states[part][-1]).all()


def test_jax_has_the_tangent_map_of_the_library(jax: Any) -> None:
    move = lm.to_jax(PLAN, steps=12)
    D = jax.jacrev(lambda mu: move({"mu": mu})["mu"])(MU)
    tangent = PLAN.tangent(PLAN.system.state(mu=MU), steps=12).tangent["start"][-1]
    assert np.asarray(D) == pytest.approx(tangent, abs=1e-13)


def test_jax_differentiates_samples_and_tables(jax: Any) -> None:
    from jax.test_util import check_grads

    plan = driven()
    move = lm.to_jax(plan, steps=20, every=5)

    def cost(mu: Any, values: Any) -> Any:
        g = jax.numpy.eye(3)
        found = move({"mu": mu, "g": g}, **{"torque.values": values})
        assert found["mu"].shape == (5, 3) and found["g"].shape == (5, 3, 3)
        return (found["mu"] ** 2).sum() + found["g"][2, 0, 1]

    values = 0.1 + 0.05 * np.random.default_rng(0).normal(size=(6, 3))
    check_grads(cost, (MU, values), order=1, modes=["rev"], atol=1e-7, rtol=1e-6)


def test_vmap_runs_an_ensemble(jax: Any) -> None:
    move = lm.to_jax(PLAN, steps=12)
    many = np.random.default_rng(1).normal(size=(5, 3))
    moments = np.array(INERTIA) + 0.1 * np.arange(5)[:, None]

    def cost(mu: Any, inertia: Any) -> Any:
        return (move({"mu": mu}, inertia=inertia)["mu"] ** 3).sum()

    one = jax.grad(cost, argnums=(0, 1))
    every = jax.jit(jax.vmap(one))(many, moments)
    shared = jax.vmap(one, in_axes=(0, None))(many, moments[0])
    for k in range(5):
        for found, wanted in zip(every, one(many[k], moments[k]), strict=True):
            assert np.asarray(found[k]) == pytest.approx(np.asarray(wanted), rel=1e-12, abs=1e-13)
        for found, wanted in zip(shared, one(many[k], moments[0]), strict=True):
            assert np.asarray(found[k]) == pytest.approx(np.asarray(wanted), rel=1e-12, abs=1e-13)


def test_loops_and_compiled_functions_are_traced_once(jax: Any) -> None:
    """Other values of parameters trace nothing anew; numbers of single precision become double ones."""
    move, traced = lm.to_jax(PLAN, steps=3), []

    def cost(mu: Any, inertia: Any) -> Any:
        traced.append(mu)
        steps = jax.lax.scan(lambda x, _: (move({"mu": x}, inertia=inertia)["mu"], 0.0), mu, None, length=4)
        return (steps[0] ** 2).sum() + steps[0][0]

    compiled = jax.jit(jax.grad(cost))
    found = [compiled(MU, np.array(INERTIA) * k) for k in (1.0, 1.1, 1.2)]
    assert len(traced) == 1
    w = lm.to_jax(PLAN, steps=12)({"mu": MU})["mu"] * 2.0 + np.array([1.0, 0.0, 0.0])
    wanted = PLAN.pullback({"mu": np.asarray(w)}, PLAN.system.state(mu=MU), steps=12)["start"]
    assert np.asarray(found[0]) == pytest.approx(wanted, rel=1e-12)
    single = jax.grad(lambda mu: move({"mu": mu})["mu"][0])(jax.numpy.array(MU, dtype="float32"))
    assert single.dtype == np.float32


def test_what_a_bridge_cannot_carry_is_named(jax: Any) -> None:
    move = lm.to_jax(PLAN, steps=3)
    with pytest.raises(InvalidType, match="its parts by name"):
        move(MU)
    with pytest.raises(Exception, match="inertial is no parameter of RigidBody"):
        move({"mu": MU}, inertial=1.0)
    twice = jax.grad(lambda mu: jax.grad(lambda x: move({"mu": x})["mu"][0])(mu).sum())
    for second in (twice, jax.hessian(lambda mu: move({"mu": mu})["mu"][0])):
        with pytest.raises(IncompatibleSystem, match="second derivatives"):
            second(MU)
    with pytest.raises(InvalidType, match="a Plan of one system"):
        lm.to_jax(PLAN.system, steps=3)
    with pytest.raises(InvalidInput, match="leave out every"):
        lm.to_jax(lm.Plan(PLAN.system, lm.RKMK(order=5), rtol=1e-8), t_end=1.0, every=2)
    jax.config.update("jax_enable_x64", False)
    try:
        with pytest.raises(InvalidInput, match="jax_enable_x64"):
            move({"mu": MU})
    finally:
        jax.config.update("jax_enable_x64", True)
