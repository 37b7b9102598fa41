"""Bodies whose attitude is a unit quaternion: the same momenta, the same rotation, or refused by name."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.linalg import norm

import liemech as lm

J, MU = [1.0, 1.6, 2.3], [0.4, -0.5, 0.9]
Q = lm.UnitQuaternions()
R = np.asarray(lm.SO3().exp([0.3, -0.2, 0.5]))
BODIES = lm.RigidBody(J), lm.RigidBody(J, group=Q)
STARTS = BODIES[0].state(MU, R), BODIES[1].state(MU, Q.from_matrix(R))

METHODS = (
    lm.RKMK(order=4),
    lm.RKMK(order=4, retraction=lm.Cayley()),
    lm.CommutatorFree(order=4),
    lm.CrouchGrossman(order=3),
    lm.Taylor(order=8),
    lm.CovariantVariational(lm.Exponential()),
    lm.CovariantVariational(lm.Cayley()),
    lm.CovariantVariational(lm.CayleyAdjoint()),
    lm.GalerkinVariational(order=4),
    lm.LiePoissonHamiltonJacobi(order=4),
    lm.MoserVeselov(),
    lm.ExactMoserVeselov.of(BODIES[0], STARTS[0], 0.1),
    lm.ExactFreeBody(),
    lm.ImplicitMidpoint(),
    lm.SphericalMidpoint(),
    lm.ThreeRotations(),
)
"""Methods whose momentum does not look at the attitude."""

BY_ELEMENTS = (
    lm.FirstKindHamiltonJacobi(order=2),
    lm.FirstKindHamiltonJacobi(order=2, retraction=lm.Cayley(), s0=lm.class_functions.CayleySquare()),
)
"""Methods that turn momenta by elements of the group: equal to rounding."""


def runs(method: lm.Method, steps: int = 20) -> list[lm.Trajectory]:
    return [
        lm.integrate(body, method, start, h=0.1, steps=steps, compiled=False)
        for body, start in zip(BODIES, STARTS, strict=True)
    ]


@pytest.mark.sample(6)
@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_the_same_momentum_bits_and_the_same_attitude(method: lm.Method) -> None:
    matrices, quaternions = runs(method)
    assert np.array_equal(matrices.mu, quaternions.mu)
    assert quaternions.g.shape == (21, 4)
    assert np.abs(Q.matrix(quaternions.g) - matrices.g).max() < 20 * 2.0**-52 * 4
    assert np.abs(norm(quaternions.g, axis=1) - 1.0).max() < 20 * 2.0**-52
    assert np.abs(matrices.spatial_momentum - quaternions.spatial_momentum).max() < 1e-14


@pytest.mark.slow
@pytest.mark.parametrize("method", BY_ELEMENTS, ids=repr)
def test_the_same_motion_to_rounding(method: lm.Method) -> None:
    matrices, quaternions = runs(method, steps=2)
    assert np.abs(matrices.mu - quaternions.mu).max() < 2e-14
    assert np.abs(Q.matrix(quaternions.g) - matrices.g).max() < 5e-14


def test_refused_by_name() -> None:
    with pytest.raises(
        lm.errors.IncompatibleSystem, match=r"Isospectral.*rotation matrices, not quaternions.*group=SO3"
    ):
        runs(lm.Isospectral(order=4))
    with pytest.raises(lm.errors.InvalidType, match=r"group must be SO3\(\) or UnitQuaternions\(\); got SE3"):
        lm.RigidBody(J, group=lm.SE3())  # type: ignore[arg-type]


def test_in_a_field() -> None:
    """A potential of the direction of gravity, told by either kind of attitude."""

    @lm.record
    class Weight(lm.Potential):
        quaternions: bool

        def energy(self, g: lm.Element) -> float:
            R = lm.UnitQuaternions().matrix(g) if self.quaternions else g
            return 0.7 * R[2, 0] - 0.4 * R[2, 2]

    found = []
    for body, start, own in zip(BODIES, STARTS, (False, True), strict=True):
        system = lm.MechanicalSystem(body, Weight(own))
        start = system.state(start.mu, start.g)
        for method in (lm.LieVerlet(), lm.RKMK(order=4), lm.KickDrift()):
            found.append(lm.integrate(system, method, start, h=0.05, steps=10, compiled=False).mu)
    for matrices, quaternions in zip(found[:3], found[3:], strict=True):
        assert np.abs(matrices - quaternions).max() < 1e-13
        assert np.abs(matrices[-1] - matrices[0]).max() > 0.1


def test_the_exact_motion() -> None:
    times = np.linspace(0.0, 30.0, 7)
    matrices, quaternions = (body.exact(start, times) for body, start in zip(BODIES, STARTS, strict=True))
    assert np.array_equal(matrices.mu, quaternions.mu)
    assert np.abs(Q.matrix(quaternions.g) - matrices.g).max() < 8 * 2.0**-52
    assert (quaternions.g[:, 3] >= 0.0).all()


def test_the_name_tells() -> None:
    assert repr(BODIES[1]).endswith("group=UnitQuaternions())")
    assert "group" not in repr(BODIES[0])
    assert BODIES[0] != BODIES[1]


@pytest.mark.slow
@pytest.mark.compiled
def test_native_code_does_the_same() -> None:
    body, start = BODIES[1], STARTS[1]
    for method in (lm.RKMK(order=4), lm.ThreeRotations()):
        plain, native = (lm.integrate(body, method, start, h=0.1, steps=10, compiled=c) for c in (False, True))
        assert np.array_equal(plain.mu, native.mu)
        assert np.array_equal(plain.g, native.g)
