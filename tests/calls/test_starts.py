"""Where a motion starts: velocities for momenta, attitudes in other people's notation."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import transform

import liemech as lm

SYSTEMS = {
    "body": lm.RigidBody([1.0, 1.5, 2.0]),
    "body in other axes": lm.RigidBody([[2.0, 0.1, 0.3], [0.1, 2.5, -0.2], [0.3, -0.2, 1.5]]),
    "top": lm.models.HeavyTop([1.0, 1.5, 2.0], 3.0, [0.1, 0.2, 0.5]),
    "symmetric top": lm.models.LagrangeTop(weight=1.0, transverse=1.0, axial=0.5, length=1.0),
    "in a fluid": lm.models.KirchhoffBody([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]),
    "falling": lm.models.FallingBody([1.0, 1.5, 2.0], mass=2.0, gravity=9.8),
}


@pytest.mark.parametrize("name", SYSTEMS)
@pytest.mark.parametrize("many", [False, True])
def test_a_velocity_gives_the_momentum_that_gives_it_back(name: str, many: bool, rng: np.random.Generator) -> None:
    system = SYSTEMS[name]
    group = getattr(system, "configurations", system.group)
    shape = (5,) if many else ()
    xi, g = rng.normal(size=(*shape, group.dim)), group.random(rng, shape)
    start = system.state(xi=xi, g=g)
    assert start.bodies == (5 if many else None)
    assert np.abs(system.velocity(np.array(start.mu)) - xi).max() < 1e-14 * np.abs(xi).max()
    assert np.array_equal(start.mu, system.state(np.array(start.mu), g).mu)
    assert system.knows(start)


def test_momentum_or_velocity() -> None:
    body, top = SYSTEMS["body"], SYSTEMS["top"]
    for system in (body, top):
        with pytest.raises(lm.errors.InvalidInput, match=r"give mu, the momentum, or xi, the velocity$"):
            system.state(g=np.eye(3))
        with pytest.raises(lm.errors.InvalidInput, match="not both"):
            system.state(mu=[1.0, 2.0, 3.0], xi=[1.0, 2.0, 3.0], g=np.eye(3))
        with pytest.raises(
            lm.errors.InvalidInput, match=r"state: xi has shape \(2,\); a velocity on SO3\(\) has shape \(3,\)"
        ):
            system.state(xi=[1.0, 2.0], g=np.eye(3))
        with pytest.raises(lm.errors.InvalidInput, match=r"state: xi\[1\] is nan"):
            system.state(xi=[1.0, np.nan, 2.0], g=np.eye(3))
    with pytest.raises(lm.errors.InvalidInput, match="g is missing"):
        top.state(xi=[1.0, 2.0, 3.0])
    reduced = lm.models.ReducedHeavyTop([1.0, 1.5, 2.0], 3.0, [0.1, 0.2, 0.5])
    with pytest.raises(
        lm.errors.InvalidInput, match="has no Lagrangian, which makes a momentum of the velocity xi; give mu"
    ):
        reduced.state(xi=np.ones(6))


def test_quaternions_in_both_orders(rng: np.random.Generator) -> None:
    """As SciPy has it; q and -q are one rotation, and the product of quaternions is that of rotations."""
    R = transform.Rotation.random(40, random_state=1)
    q, G = R.as_quat(), lm.SO3()
    for found in (
        G.from_quaternion(q, "xyzw"),
        G.from_quaternion(-q, "xyzw"),
        G.from_quaternion(np.roll(q, 1, axis=1), "wxyz"),
    ):
        assert np.abs(found - R.as_matrix()).max() < 1e-15
    assert np.abs(G.from_quaternion((R[0] * R[1]).as_quat(), "xyzw") - (R[0] * R[1]).as_matrix()).max() < 1e-15
    assert np.array_equal(G.from_quaternion([1, 0, 0, 0], order="wxyz"), np.eye(3))
    assert np.array_equal(G.from_quaternion([1, 0, 0, 0], order="xyzw"), np.diag([1.0, -1.0, -1.0]))
    back = G.quaternion(G.from_quaternion(q, "xyzw"))
    assert np.abs(back - q * np.sign(q[:, 3:])).max() < 1e-15


def test_quaternions_that_are_none() -> None:
    G = lm.SO3()
    with pytest.raises(
        lm.errors.InvalidInput, match=r'order is "wxyz", scalar first, or "xyzw", scalar last; got \'wzyx\''
    ):
        G.from_quaternion([1.0, 0.0, 0.0, 0.0], order="wzyx")
    with pytest.raises(lm.errors.InvalidInput, match=r"no unit quaternion, \|q\|\^2 is 1\.21"):
        G.from_quaternion([1.1, 0.0, 0.0, 0.0], order="wxyz")
    with pytest.raises(lm.errors.InvalidInput, match="q has shape"):
        G.from_quaternion([1.0, 0.0, 0.0], order="wxyz")
    with pytest.raises(lm.errors.InvalidInput, match="must be finite"):
        G.from_quaternion([1.0, np.nan, 0.0, 0.0], order="wxyz")


def test_starts_from_scipy() -> None:
    R = transform.Rotation.random(3, random_state=2)
    assert np.array_equal(SYSTEMS["body"].state(xi=[0.1, 0.2, 0.3], g=R).g, R.as_matrix())
    assert np.array_equal(SYSTEMS["top"].state(xi=[0.1, 0.2, 0.3], g=R[0]).g, R[0].as_matrix())
    if hasattr(transform, "RigidTransform"):
        T = transform.RigidTransform.from_components([1.0, 2.0, 3.0], R[0])
        start = SYSTEMS["in a fluid"].state(xi=np.ones(6), g=T)
        assert np.array_equal(start.g, T.as_matrix())
        back = lm.SE3().rigid_transform(start.g)
        assert np.abs(back.as_matrix() - T.as_matrix()).max() < 1e-15
