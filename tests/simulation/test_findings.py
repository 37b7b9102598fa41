"""What attacks on runs, starts and checks have found."""

from __future__ import annotations

import numpy as np
import pytest

import liemech as lm
from liemech import errors

BODY = lm.RigidBody([1.0, 1.5, 2.0])
START = BODY.state(mu=[0.5, 0.0, 0.75**0.5], g=np.eye(3))


@lm.record
class Gap(lm.Force):
    """A force that is not defined for a while."""

    def covector(self, t, xi, g):
        if 0.52 < t < 0.545:
            raise ValueError("no force here")
        return lm.vec(0.0, 0.0, 0.0)


def test_a_total_momentum_of_zero_is_a_constant_like_any_other():
    """Its terms are those of the bodies: the rounding of their sum is none of a number that is
    zero.
    """
    bodies = lm.NBody([1.0, 2.0, 3.0])
    q = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.3, -0.7, 0.2]
    p = [0.3, 0.2, 0.1, -0.1, 0.5, 0.2, -0.2, -0.7, -0.3]
    assert lm.check_system(bodies, states=bodies.state(q, p))
    assert lm.check_system(bodies, states=bodies.state(q, np.zeros(9)))

    class Leaking(lm.NBody):
        def momentum(self, p):
            return super().momentum(p) + 1e-6 * p[0]

    with pytest.raises(errors.LawViolation, match="constants"):
        lm.check_system(Leaking([1.0, 2.0, 3.0]), states=bodies.state(q, p))


def test_a_body_at_rest_in_a_field_may_have_a_momentum_of_rounding():
    """Beside the speed that the weight gives it, in any units; a speed that is none of rounding is
    refused.
    """
    for mass, length in ((1.0, 1.0), (1e-3, 1e3)):  # kg and m, or g and mm
        unit = mass * length**2
        link = lm.Link(mass, [unit, 1.2 * unit, 1.5 * unit])
        joint = lm.RevoluteJoint(
            0, None, [0.0, 0.0, 0.5 * length], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0]
        )
        pendulum = lm.Linkage([link], [joint], 9.81 * length)
        g = np.eye(4)
        g[2, 3] = -0.5 * length
        for i in range(6):
            mu = np.zeros(6)
            mu[i] = 1e-17 * (unit if i < 3 else mass * length)
            assert pendulum.state(mu, g.ravel()).mu[i] == mu[i]
        with pytest.raises(errors.InconsistentState):
            pendulum.state(1e12 * mu, g.ravel())


def test_a_start_is_that_of_its_own_system():
    """A point of one sphere is none of another: the same class and group say nothing about the
    length.
    """
    short, long = lm.SphericalPendulum(length=1.0), lm.SphericalPendulum(length=2.0)
    start = short.state([0.0, 0.6, -0.8], [1.0, 0.0, 0.0])
    with pytest.raises(errors.InvalidInput, match="not consistent"):
        lm.integrate(long, lm.RATTLE(), start, h=0.01, steps=2, compiled=False)
    same = lm.SphericalPendulum(length=1.0)
    assert lm.integrate(same, lm.RATTLE(), start, h=0.01, steps=2, compiled=False).steps == 2
    two = short.state([[0.0, 0.6, -0.8]] * 2, [[1.0, 0.0, 0.0]] * 2)
    with pytest.raises(errors.InvalidInput, match=r"body 1: .*not consistent"):
        lm.integrate([short, long], lm.RATTLE(), two, h=0.01, steps=2, compiled=False)
    assert (
        lm.integrate([short, same], lm.RATTLE(), two, h=0.01, steps=2, compiled=False).bodies == 2
    )


def test_times_of_two_axes_are_refused():
    times = np.array([[0.1, 0.2], [0.3, 0.4]])
    fixed = lm.integrate(BODY, lm.RKMK(order=2), START, h=0.1, steps=10, compiled=False)
    adaptive = lm.integrate(BODY, lm.RKMK(order=5), START, t_end=1.0, compiled=False)
    kepler = lm.Kepler()
    method = lm.ReversibleController(lm.StormerVerlet(), sigma=lm.EqualArc())
    fictive = lm.integrate(
        kepler, method, kepler.state(q=[0.5, 0.0], p=[0.0, 1.7]), h=0.01, t_end=1.0, compiled=False
    )
    for run in (fixed, adaptive, fictive):
        with pytest.raises(errors.InvalidInput, match=r"\(m,\); got t of shape \(2, 2\)"):
            run.at(times)


def test_a_shorter_step_that_fails_tells_its_time():
    body = lm.MechanicalSystem(BODY, lm.NoPotential(), load=Gap())
    start = body.state(mu=[1.0, 0.0, 0.2], g=np.eye(3))
    how = dict(method=lm.RKMK(order=2), start=start, h=0.1, steps=20, compiled=False)
    run = lm.integrate(body, **how)
    words = r"no force here \[the shorter step from t = 0.5 to t = 0.57\]"
    for times in (0.57, [0.1, 0.2, 0.57]):
        with pytest.raises(errors.IntegrationFailure, match=words):
            run.at(times)
    with pytest.raises(errors.IntegrationFailure, match=words) as caught:
        lm.integrate(body, t_eval=[0.1, 0.57], **how)
    assert caught.value.trajectory is not None


def test_two_runs_joined_have_the_samples_of_both():
    """Where the first was not asked for its end, the first sample of the second is no repetition."""
    plan = lm.Plan(BODY, lm.RKMK(order=2), h=0.1, compiled=False)
    first = plan.run(START, steps=10, t_eval=[0.0, 0.5])
    joined = first.then(plan.resume(first, steps=5))
    whole = plan.run(START, steps=15)
    assert joined.t.tolist() == [0.0, 0.5, *whole.t[10:].tolist()]
    assert np.array_equal(joined.mu[2:], whole.mu[10:])
    first = plan.run(START, steps=10)
    assert np.array_equal(first.then(plan.resume(first, steps=5)).t, whole.t)
