"""Steps that positions on constraints would not notice, and units of mass and time that Algorithm 1 takes."""

from __future__ import annotations

import numpy as np
import pytest
from scenes_of_runs import Height

import liemech as lm
from liemech import errors

PENDULUM = lm.SphericalPendulum()
RNG = np.random.default_rng(1)
HERE = RNG.normal(size=3)
HERE /= np.linalg.norm(HERE)
ACROSS = np.cross(HERE, RNG.normal(size=3))
MOVING = PENDULUM.state(HERE, ACROSS / np.linalg.norm(ACROSS))


@pytest.mark.parametrize("method", [lm.RATTLE(), lm.ConstrainedEuler(), lm.LobattoPair(2), lm.Composition(lm.RATTLE())])
def test_a_step_that_positions_do_not_notice_is_refused(method):
    how = dict(steps=20, compiled=False)
    for h in 1e-17, -1e-20, 1e-100:
        with pytest.raises(errors.InvalidInput, match="below the rounding of q, 2"):
            lm.integrate(PENDULUM, method, MOVING, h=h, **how)
    run = lm.integrate(PENDULUM, method, MOVING, h=1e-14, **how)  # the motion is there
    rate = np.array(PENDULUM.rate(0.0, MOVING))
    assert np.abs((run.q[-1] - run.q[0]) / run.t[-1] - rate[:3]).max() < 1e-2
    assert np.abs((run.p[-1] - run.p[0]) / run.t[-1] - rate[3:]).max() < 1e-2


def test_a_start_at_rest_and_a_body_of_an_ensemble():
    at_rest = PENDULUM.state(HERE, np.zeros(3))
    lm.integrate(PENDULUM, lm.RATTLE(), at_rest, h=1e-9, steps=3, compiled=False)
    with pytest.raises(errors.InvalidInput, match="below the rounding"):
        lm.integrate(PENDULUM, lm.RATTLE(), at_rest, h=1e-40, steps=3, compiled=False)
    still = lm.SphericalPendulum(gravity=0.0)  # nothing is to move
    lm.integrate(still, lm.RATTLE(), at_rest, h=1e-40, steps=3, compiled=False)
    many = PENDULUM.state(np.array([HERE, HERE]), np.array([MOVING.p, 1e-9 * np.array(MOVING.p)]))
    with pytest.raises(errors.InvalidInput, match=r"\(body 1\)"):
        lm.integrate(still, lm.RATTLE(), many, h=1e-15, steps=3, compiled=False)


@pytest.mark.parametrize("retraction", [lm.Cayley(), lm.Exponential()])
@pytest.mark.parametrize("inertia", [np.array([1.0, 1.6, 2.3]), np.diag([1.0, 1.6, 2.3]) + 0.1])
def test_algorithm_1_takes_every_unit_of_mass_and_time(retraction, inertia):
    """Powers of two as units change no digit, up to J = 1e150 and J/h = 1e285."""
    method = lm.CovariantVariational(retraction)

    def moved(mass: float, time: float) -> list[np.ndarray]:
        body = lm.RigidBody(inertia * mass)
        start = body.state(np.array([0.5, -0.3, 0.75]) * (mass / time), g=np.eye(3))
        run = lm.integrate(body, method, start, h=0.3 * time, steps=5, compiled=False)
        return [run.mu * (time / mass), run.g]

    here = moved(1.0, 1.0)
    for units in (2.0**500, 1.0), (2.0**-950, 1.0), (1.0, 2.0**940), (1.0, 2.0**-950):
        assert all(np.array_equal(a, b) for a, b in zip(moved(*units), here, strict=True))
    for units in (2.0**520, 1.0), (2.0**-970, 1.0), (1.0, 2.0**980), (1.0, 2.0**-970):
        with pytest.raises(errors.InvalidInput, match="units of mass and time"):
            moved(*units)


@lm.record
class OnSphere(lm.Constraint):
    """|g| = 1 in R^3."""

    def value(self, g):
        return lm.vec(lm.dot(g, g) - 1.0)


def test_a_step_that_configurations_on_groups_do_not_notice():
    free = lm.LiePoissonSystem(lm.VectorSpace(3), lm.KineticEnergy([1.0, 1.0, 1.0]))
    how = dict(steps=3, compiled=False)
    for weight, mu, least in (1.0, [0.0, 1.2, 0.0], 1e-17), (1.0, [0.0] * 3, 1e-40):
        body = lm.ConstrainedBody(lm.MechanicalSystem(free, Height(weight)), OnSphere())
        start = body.state(mu, [0.6, 0.0, -0.8])
        lm.integrate(body, lm.LieRATTLE(), start, h=1e-8, **how)
        with pytest.raises(errors.InvalidInput, match="moves by less than its rounding"):
            lm.integrate(body, lm.LieRATTLE(), start, h=least, **how)
    still = lm.ConstrainedBody(lm.MechanicalSystem(free, Height(0.0)), OnSphere())
    lm.integrate(still, lm.LieRATTLE(), still.state([0.0] * 3, [0.6, 0.0, -0.8]), h=1e-40, **how)
    # of an ensemble whichever body it is, by its number
    many = still.state([[0.0, 1.2, 0.0], [0.0, 1.2e-9, 0.0]], [[0.6, 0.0, -0.8]] * 2)
    lm.integrate(still, lm.LieRATTLE(), many, h=1e-6, **how)
    with pytest.raises(errors.InvalidInput, match=r"less than its rounding \(body 1\)"):
        lm.integrate(still, lm.LieRATTLE(), many, h=1e-8, **how)
