"""ChainPendulum of any length: by loops over masses and rods, the same steps as RATTLE of its own."""

from dataclasses import replace

import numpy as np
import pytest

import liemech as lm


@lm.record
class WrittenOut(lm.models.ChainPendulum):
    """One whose steps write every mass out."""

    small = 10**9


def bent(count, dimension, kind=lm.models.ChainPendulum):
    """A chain of unlike masses and rods, bent and moving."""
    rng = np.random.default_rng(count)
    chain = kind(rng.uniform(0.5, 2.0, count), rng.uniform(0.5, 1.5, count), dimension=dimension)
    q = np.zeros((count, dimension))
    angle = 0.5 + 0.3 * np.sin(0.3 * np.arange(count))
    q[:, 0], q[:, -1] = np.sin(angle), -np.cos(angle)
    q = np.cumsum(q * np.array(chain.lengths)[:, None], axis=0)
    turn = np.zeros_like(q)  # about the vertical through the support, or about the support
    turn[:, :2] = np.stack([-q[:, 1], q[:, 0]], axis=1)
    p = 0.7 * turn * np.array(chain.masses)[:, None]
    return chain, chain.state(q.ravel(), p.ravel())


@pytest.mark.slow
@pytest.mark.parametrize("dimension", [2, 3])
def test_steps_are_those_of_rattle(dimension):
    count = 7 if dimension == 2 else 5
    chain, start = bent(count, dimension)
    whole, same = bent(count, dimension, WrittenOut)
    assert chain.site_form is not None and whole.site_form is None
    method = lm.Composition(lm.RATTLE(), order=4)
    run = lm.integrate(chain, method, start, h=0.02, steps=3, compiled=False)
    other = lm.integrate(whole, method, same, h=0.02, steps=3, compiled=False)
    for name in ("q", "p"):
        size = np.abs(other.states[name]).max()
        assert np.abs(run.states[name] - other.states[name]).max() < 5e-15 * size
    assert np.array_equal(run.energy[0], other.energy[0])


@pytest.mark.slow
def test_a_thousand_links():
    chain, start = bent(1000, 3)
    run = lm.integrate(chain, lm.RATTLE(), start, h=1e-3, steps=20, compiled=True)
    short, begun = bent(5, 3)
    few = lm.integrate(short, lm.RATTLE(), begun, h=1e-3, steps=20, compiled=True)
    plain = lm.integrate(short, lm.RATTLE(), begun, h=1e-3, steps=20, compiled=False)
    assert np.array_equal(few.q, plain.q)
    assert np.abs(chain.constraint(run.q[-1])).max() < 4e-16 * np.sum(chain.lengths)
    assert np.abs(chain.hidden_constraint(run.q[-1], run.p[-1])).max() < 1e-12
    assert np.ptp(run.energy) < 1e-6 * np.abs(run.energy[0])
    turn = [chain.vertical_momentum(q, p) for q, p in zip(run.q[::20], run.p[::20])]
    assert np.ptp(turn) < 1e-12 * abs(turn[0])


@pytest.mark.slow
def test_what_runs_have():
    chain, start = bent(5, 3)
    plan = lm.Plan(chain, lm.RATTLE(), h=0.01, compiled=False)
    run = plan.run(start, steps=6)
    assert np.array_equal(plan.resume(plan.run(start, steps=3), steps=3).q[-1], run.q[-1])
    there = plan.run(start, t_end=0.06, t_eval=[0.0, 0.025, 0.06])
    assert np.array_equal(there.q[-1], run.q[-1])
    assert np.abs(there.q[1] - 0.5 * (run.q[2] + run.q[3])).max() < 1e-3
    both = type(start)(np.stack([start.q, start.q]), np.stack([start.p, start.p]))
    assert np.array_equal(plan.run(both, steps=6).q[:, 1], run.q)
    # a zero-length rod and a broken one are told
    bad = np.array(start.q)
    bad[3:6] = bad[:3]
    with pytest.raises(lm.errors.InvalidInput):
        chain.state(bad, start.p)
    with pytest.raises(lm.errors.InvalidInput, match="not consistent"):
        replace(chain, gravity=1.0).state(1.01 * np.array(start.q), start.p)


def test_hidden_constraint_is_the_derivative():
    chain, start = bent(5, 3)
    q, p = np.array(start.q), np.array(start.p) + 0.3
    G = np.asarray(chain.constraint_jacobian(q))
    assert np.allclose(chain.hidden_constraint(q, p), G @ np.asarray(chain.velocity(q, p)), atol=1e-14)
    whole = super(lm.models.ChainPendulum, chain)._terms(lm.vec(*q), lm.vec(*p))
    for mine, theirs in zip(chain._terms(lm.vec(*q), lm.vec(*p)), whole):
        assert np.allclose(np.array(mine), np.array(theirs), rtol=1e-13)
