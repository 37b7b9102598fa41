"""Runs in fictive time: they end at t_end exactly, and know the state at any physical time."""

from __future__ import annotations

import numpy as np
import pytest

import liemech as lm
from liemech.errors import IncompatibleSystem, IntegrationFailure, InvalidInput, StepTooSmall

KEPLER = lm.Kepler()
ORBIT = KEPLER.pericentre(0.6)
METHOD = lm.ReversibleController(lm.StormerVerlet(), lm.time_scales.DistancePower(1.5))


def run(**options: object) -> lm.Trajectory:
    return lm.integrate(KEPLER, METHOD, ORBIT, h=0.05, compiled=False, **options)  # type: ignore[arg-type]


def test_a_run_to_a_time_is_a_run_of_steps_and_a_shorter_one() -> None:
    whole = run(t_end=7.3)
    steps = run(steps=whole.steps - 1)
    assert whole.t[-1] == 7.3 and steps.t[-1] < 7.3 < run(steps=whole.steps).t[-1]
    for a, b in ((whole.q, steps.q), (whole.t, steps.t), (whole.tau, steps.tau), (whole.z, steps.z)):
        assert np.array_equal(a[:-1], b)
    assert 0.0 < whole.tau[-1] - whole.tau[-2] < 0.05
    few = run(t_end=7.3, every=7)
    assert np.array_equal(few.q, whole.q[[*range(0, whole.steps, 7), whole.steps]])
    assert len(run(t_end=0.0)) == 1


def test_a_time_between_two_steps_is_where_a_run_to_it_ends() -> None:
    whole = run(t_end=7.3)
    for t in (0.001, 3.0, 7.2999):
        alone = run(t_end=t)
        assert np.abs(whole.at(t).q - alone.q[-1]).max() < 1e-14
    assert np.array_equal(whole.at(whole.t).q, whole.q)  # at the samples, to the bit
    assert np.array_equal(whole.at(7.3).q, whole.last.q)
    sparse = run(t_end=7.3, every=50)
    assert np.abs(sparse.at([1.0, 5.0]).q - whole.at([1.0, 5.0]).q).max() < 1e-13
    with pytest.raises(InvalidInput, match="outside the run"):
        whole.at(7.4)


def test_backwards_and_from_another_time() -> None:
    there = lm.integrate(KEPLER, METHOD, ORBIT, h=0.01, t0=2.0, t_end=5.0)
    assert there.t[0] == 2.0 and there.t[-1] == 5.0
    back = lm.integrate(KEPLER, METHOD, there.last, h=-0.01, t0=5.0, t_end=2.0, t_eval=[5.0, 3.0, 2.0])
    assert np.array_equal(back.t, [5.0, 3.0, 2.0]) and (np.diff(back.tau) < 0.0).all()
    # z begins anew, so the steps differ, but not the motion
    assert np.abs(back.q[-1] - np.array(ORBIT.q)).max() < 1e-6
    assert np.abs(back.q[1] - there.at(3.0).q).max() < 1e-3


def test_what_is_recorded_and_summed_up_is_chosen() -> None:
    body = lm.models.LagrangeTop(weight=1.0, transverse=1.0, axial=0.5, length=1.0).body
    start = body.state(mu=[0.3, 0.0, 1.5], g=np.eye(3))
    method = lm.ReversibleController(lm.CovariantVariational(lm.Cayley()), lambda mu: 1.0 + mu[0] ** 2)
    with_g = lm.integrate(body, method, start, h=0.1, t_end=2.0, compiled=False)
    without = lm.integrate(body, method, start, h=0.1, t_end=2.0, record=("mu",), compiled=False)
    assert without.g is None and np.array_equal(without.mu, with_g.mu) and without.at(1.0).g is None
    bare = lm.integrate(body, method, start, h=0.1, t_end=2.0, compensated=False, compiled=False)
    assert 0.0 < np.abs(bare.mu - with_g.mu).max() < 1e-14
    assert np.abs(with_g.at(1.3).g.T @ with_g.at(1.3).g - np.eye(3)).max() < 1e-14


@pytest.mark.slow
def test_a_time_that_is_never_reached() -> None:
    """Towards the collision of a straight fall equal steps in tau take less and less time."""
    fall = KEPLER.state(q=[1.0, 0.0], p=[0.0, 0.0])

    with pytest.raises(IntegrationFailure) as failed:
        lm.integrate(KEPLER, METHOD, fall, h=0.1, t_end=2.0, steps=20_000, progress=False)
    assert failed.value.trajectory.t[-1] < 1.2  # the fall takes 1.11
    with pytest.raises(StepTooSmall, match="physical time stands still") as stuck:
        standing = lm.ReversibleController(lm.StormerVerlet(), lambda q: 1e-30)
        lm.integrate(KEPLER, standing, ORBIT, h=1.0, t0=1.0, t_end=2.0, compiled=False)
    assert (stuck.value.trajectory.t == 1.0).all()


def test_what_a_run_in_fictive_time_has_not() -> None:
    with pytest.raises(InvalidInput, match="dense is not for steps in fictive time"):
        run(t_end=1.0, dense=False)
    with pytest.raises(InvalidInput, match="fictive time"):
        lm.check_method(METHOD, KEPLER, ORBIT, h=0.1)
    assert lm.check_method(METHOD, KEPLER, ORBIT)
    top = lm.models.LagrangeTop(weight=1.0, transverse=1.0, axial=0.5, length=1.0)
    inside = lm.KickDrift(lm.ReversibleController(lm.CovariantVariational(lm.Cayley()), lm.time_scales.EqualArc()))
    with pytest.raises(IncompatibleSystem, match="take one"):
        lm.integrate(top, inside, top.state(mu=[0.3, 0.0, 1.5], g=np.eye(3)), h=0.1, steps=1)


def test_a_mistake_in_sigma_is_raised_as_it_is() -> None:
    def sigma(q: lm.Vec) -> float:
        return q[0] + q[7] if q[1] > 0.5 else 1.0

    for options in ({"t_end": 9.0}, {"steps": 500}):
        with pytest.raises(IndexError) as mistake:
            method = lm.ReversibleController(lm.StormerVerlet(), sigma)
            lm.integrate(KEPLER, method, ORBIT, h=0.05, compiled=False, **options)  # type: ignore[arg-type]
        assert len(mistake.value.trajectory) > 5 and mistake.value.trajectory.tau[-1] > 0.2  # type: ignore[attr-defined]
