"""The free rigid body: its inertia, its equations, its axes and units, and every method against its exact motion."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from scenes import METHODS, asymmetric_body, named, rotation, seed_body

import liemech as lm

ALL = pytest.mark.parametrize("method", METHODS, ids=named)


def test_numbers_of_the_seed_body() -> None:
    """|mu| = 1, H = 3/8, and the momentum returns after 11.3259."""
    body, start = seed_body()
    assert body.energy(start.mu) == pytest.approx(3 / 8, rel=1e-15)
    assert body.casimirs(start.mu)[0] == pytest.approx(1.0, rel=4e-16)
    assert body.period(start) == pytest.approx(11.32589766740764959, rel=1e-14)
    momenta = {
        0.5: (0.476979989770352279, 0.212085309998946577, 0.852941915162647734),
        5.0: (-0.460065089372333753, 0.276911948246465352, 0.843599363714300964),
        100.0: (0.220396701616357976, -0.634705118801841825, 0.740658292388176756),
    }
    for t, mu in momenta.items():
        assert np.abs(body.exact(start, t).mu - mu).max() < 1e-13 * (1 + t)


def test_velocity_energy_and_lagrangian(rng: np.random.Generator) -> None:
    """xi = J^-1 mu, H = mu . xi/2 = l(xi), for principal moments and for a full matrix."""
    Q = rotation(rng)
    for J in (np.array([1.0, 1.6, 2.3]), Q @ np.diag([1.0, 1.6, 2.3]) @ Q.T):
        body, matrix = lm.RigidBody(J), J if J.ndim == 2 else np.diag(J)
        mu = rng.normal(size=3)
        xi = np.linalg.solve(matrix, mu)
        assert np.allclose(body.velocity(mu), xi, rtol=1e-13)
        assert body.energy(mu) == pytest.approx(0.5 * mu @ xi, rel=1e-13)
        assert body.lagrangian.value(xi) == pytest.approx(0.5 * mu @ xi, rel=1e-13)
        assert np.allclose(body.lagrangian.momentum(xi), mu, rtol=1e-13)
        hessian = np.array(body.lagrangian.hessian(lm.Vec.of(xi)))
        assert np.allclose(hessian if hessian.ndim == 2 else np.diag(hessian), matrix, rtol=1e-15)
        assert np.allclose(body.group.ad_star(xi, mu), np.cross(mu, xi), rtol=1e-12)


@ALL
def test_a_full_inertia_matrix_is_the_principal_body_in_turned_axes(
    method: lm.Method, rng: np.random.Generator
) -> None:
    """With J' = Q J Q^T the motion from (Q mu, g Q^T) is (Q mu(t), g(t) Q^T)."""
    body, start = asymmetric_body()
    Q = rotation(rng)
    turned = lm.RigidBody(Q @ np.diag(np.array(body.inertia)) @ Q.T)
    other = turned.state(Q @ np.array(start.mu), np.array(start.g) @ Q.T)
    a = lm.integrate(body, method, start, h=0.2, steps=20)
    b = lm.integrate(turned, method, other, h=0.2, steps=20)
    assert np.abs(b.mu - a.mu @ Q.T).max() < 1e-13
    assert np.abs(b.g - a.g @ Q.T).max() < 1e-13
    assert np.abs(b.spatial_momentum - a.spatial_momentum).max() < 1e-13


@ALL
def test_turning_space_turns_the_motion(method: lm.Method, rng: np.random.Generator) -> None:
    """Left-invariance: the momentum does not notice, the attitude is turned."""
    body, start = asymmetric_body()
    Q = rotation(rng)
    a = lm.integrate(body, method, start, h=0.2, steps=15)
    b = lm.integrate(body, method, body.state(start.mu, Q @ np.array(start.g)), h=0.2, steps=15)
    assert np.array_equal(a.mu, b.mu)
    assert np.abs(b.g - Q @ a.g).max() < 1e-14 * 5


@ALL
def test_relabelling_the_axes_relabels_the_motion(method: lm.Method) -> None:
    body, start = asymmetric_body()
    mu, order = np.array(start.mu), [1, 2, 0]
    a = lm.integrate(body, method, body.state(mu), h=0.2, steps=50)
    other = lm.RigidBody(np.array(body.inertia)[order])
    b = lm.integrate(other, method, other.state(mu[order]), h=0.2, steps=50)
    assert np.abs(b.mu - a.mu[:, order]).max() < 1e-14


@ALL
def test_rotations_about_principal_axes_are_steady(method: lm.Method) -> None:
    body, _ = asymmetric_body()
    for axis in np.eye(3):
        run = lm.integrate(body, method, body.state(0.7 * axis, np.eye(3)), h=0.3, steps=50)
        assert np.array_equal(run.mu, np.tile(0.7 * axis, (51, 1)))


@pytest.mark.parametrize("unit", [1e-46, 1e40])
@ALL
def test_molecules_and_planets(method: lm.Method, unit: float) -> None:
    """No absolute number anywhere: the relative motion is that of a body of one kilogram."""
    body, start = asymmetric_body()
    run = lm.integrate(body, method, start, h=0.2, steps=100)
    other = lm.RigidBody(unit * np.array(body.inertia))
    scaled = lm.integrate(other, method, other.state(unit * np.array(start.mu), start.g), h=0.2, steps=100)
    assert np.abs(scaled.mu / unit - run.mu).max() < 1e-13
    assert np.abs(scaled.g - run.g).max() < 1e-13


# ---------------------------------------------------------------- the inertia at the border


def test_the_triangle_inequality_is_a_warning() -> None:
    with pytest.warns(lm.errors.InertiaWarning, match=r"0.666667 \+ 1 < 2") as seen:
        lm.RigidBody([2 / 3, 1.0, 2.0])
    assert len(seen) == 1
    assert seen[0].filename == __file__
    with pytest.warns(lm.errors.InertiaWarning):
        lm.RigidBody(np.diag([1.0, 1.0, 3.0]))


def test_no_warning_for_a_flat_body_or_a_symmetric_one() -> None:
    """J1 + J2 = J3 is a plate; rounding must not make it an error, in any unit."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for unit in (1e-300, 1e-46, 1.0, 1e40, 1e300):
            lm.RigidBody(unit * np.array([0.1, 0.2, 0.1 + 0.2]))
            lm.RigidBody(unit * np.array([1.0, 1.0, 1.0]))
            lm.RigidBody(unit * np.array([0.1, 0.2, 0.3]))


def test_rounding_errors_in_a_symmetric_matrix_are_averaged_away() -> None:
    J = np.array([[2.0, 0.1, 0.0], [0.1, 2.5, 0.2], [0.0, 0.2, 3.0]])
    skew = J.copy()
    skew[0, 1] += 1e-15
    body = lm.RigidBody(skew)
    matrix = np.array(body.inertia)
    assert np.array_equal(matrix, matrix.T)
    with pytest.raises(lm.errors.InvalidInput, match="not symmetric"):
        lm.RigidBody(J + 1e-6 * np.triu(J, 1))


def test_diagonal_matrix_and_moments_move_alike() -> None:
    moments, start = np.array([1.0, 1.6, 2.3]), dict(mu=[0.3, 0.4, 0.5], g=np.eye(3))
    for method in METHODS:
        bodies = lm.RigidBody(moments), lm.RigidBody(np.diag(moments))
        a, b = (lm.integrate(body, method, body.state(**start), h=0.2, steps=50) for body in bodies)
        assert np.abs(a.mu - b.mu).max() < 1e-14
        assert np.abs(a.g - b.g).max() < 1e-14


def test_face() -> None:
    body = lm.RigidBody([1, 1.5, 2])
    assert repr(body) == "RigidBody(inertia=Vec(1.0, 1.5, 2.0))"
    assert body == lm.RigidBody(np.array([1.0, 1.5, 2.0]))
    assert hash(body) == hash(lm.RigidBody((1.0, 1.5, 2.0)))
    with pytest.raises(AttributeError):
        body.inertia = None  # type: ignore[misc]
