"""Runs inside JAX and PyTorch: values are those of `run`, derivatives pass their own gradient checkers."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from simulation.bridges_of_jax import ATTITUDE, INERTIA, MU, PLAN, driven

import liemech as lm
from liemech.errors import IncompatibleSystem, InvalidInput


@pytest.fixture(scope="module")
def torch() -> Any:
    return pytest.importorskip("torch")


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("jax") is None, reason="no JAX")
def test_jax() -> None:
    """`bridges_of_jax`, in a process of its own."""
    program = str(Path(__file__).with_name("bridges_of_jax.py"))
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-n", "0", program],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0 and "6 passed" in done.stdout, done.stdout + done.stderr


def test_torch_passes_its_own_gradient_check(torch: Any) -> None:
    move = lm.to_torch(PLAN, steps=12)

    def end(mu: Any, eta: Any, inertia: Any) -> Any:
        zero = torch.zeros((), dtype=torch.float64)
        x, y, z = eta
        hat = torch.stack([zero, -z, y, z, zero, -x, -y, x, zero]).reshape(3, 3)
        g = torch.from_numpy(ATTITUDE.copy()) @ torch.matrix_exp(hat)
        found = move({"mu": mu, "g": g}, inertia=inertia)
        return found["mu"], found["g"]

    given = [torch.tensor(x, dtype=torch.float64, requires_grad=True) for x in (MU, [0.0] * 3, INERTIA)]
    assert torch.autograd.gradcheck(end, given)
    run = PLAN.run(PLAN.system.state(mu=MU, g=ATTITUDE), steps=12)
    for found, part in zip(end(*given), ("mu", "g"), strict=True):
        assert (found.detach().numpy() == run.states[part][-1]).all()


def test_torch_refuses_second_derivatives(torch: Any) -> None:
    """With create_graph a gradient would count as a constant."""
    move = lm.to_torch(PLAN, steps=3)
    mu = torch.tensor(MU, dtype=torch.float64, requires_grad=True)
    with pytest.raises(IncompatibleSystem, match="second derivatives"):
        torch.autograd.grad((move({"mu": mu})["mu"] ** 2).sum(), mu, create_graph=True)


def test_torch_learns_a_torque(torch: Any) -> None:
    """The torque that brings a body to rest, by the optimiser of PyTorch."""
    plan = driven()
    move = lm.to_torch(plan, steps=20)
    values = torch.zeros((6, 3), dtype=torch.float64, requires_grad=True)
    start = {"mu": torch.tensor(MU), "g": torch.eye(3, dtype=torch.float64)}
    search = torch.optim.LBFGS([values], max_iter=30, line_search_fn="strong_wolfe")

    def cost() -> Any:
        search.zero_grad()
        found = (move(start, **{"torque.values": values})["mu"] ** 2).sum()
        found.backward()
        return found

    search.step(cost)
    assert float(cost()) < 1e-8 * (MU**2).sum()


def test_tables_with_other_values() -> None:
    t = np.linspace(0.0, 1.0, 4)
    for make, count in ((lm.PiecewisePolynomial.linear, 4), (lm.PiecewisePolynomial.constant, 3)):
        values = np.arange(float(count))
        table = make(t, np.ones(count), "hold").with_values(values)
        assert table == make(t, values, "hold")
    again = lm.PiecewisePolynomial.linear(t, np.arange(4.0), "repeat")  # it jumps where it begins anew
    assert again.with_values(np.ones(4)) == lm.PiecewisePolynomial.linear(t, np.ones(4), "repeat")
    with pytest.raises(InvalidInput, match="has coefficients"):
        lm.PiecewisePolynomial.cubic(t, np.ones(4)).with_values(np.ones(4))
