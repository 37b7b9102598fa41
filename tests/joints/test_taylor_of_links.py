"""Taylor series of linkages: multipliers order by order, by the elimination of order zero."""

import numpy as np
import pytest
from orders import slope
from test_stages_of_links import TURN, Linkage, arm

import liemech as lm
from liemech.errors import IncompatibleSystem
from liemech.formulas import mat, vec
from liemech.formulas.numbers.series import Series
from liemech.joints import BallJoint, Damper, Link, Motor, Shaking, Spring


def mixed():
    """A tree of balls and hinges with springs, dampers and a motor, a spring at rest among them."""
    rods = lm.joints.chain(4, axis=TURN)
    joints = [rods.joints[0], BallJoint(1, 0, rods.joints[1].at_first, rods.joints[1].at_second),
              *rods.joints[2:]]  # fmt: skip
    forces = [Damper(1, 0.1), Spring(1, 3.0), Spring(2, 2.0, rest=0.3), Motor(3, 0.5)]
    made = Linkage(rods.links, joints, forces=forces)
    return made, made.state(angles={0: 0.7, 2: 0.2}, rates={0: 0.5, 3: 1.0})


def end(made, method, steps, t_end=0.24):
    linkage, start = made
    return lm.integrate(linkage, method, start, h=t_end / steps, steps=steps, compiled=False)


@pytest.mark.slow
@pytest.mark.parametrize("order", [2, 5])
def test_order_of_a_tree(order):
    made = mixed()
    wanted = lm.integrate(*made[:1], lm.RKMK(order=8), made[1], h=0.24 / 96, steps=96)
    errors, counts = [], (12, 24, 48)
    for steps in counts:
        run = lm.integrate(made[0], lm.Taylor(order=order), made[1], h=0.24 / steps, steps=steps)
        errors.append(np.abs(run.mu[-1] - wanted.mu[-1]).max())
    assert slope(counts[:2], errors[:2]) == pytest.approx(-order, abs=0.5)


@pytest.mark.slow
def test_with_loads_on_bodies_and_friction():
    linkage, start = arm(Linkage)
    a, b = (
        lm.integrate(linkage, method, start, h=0.005, steps=16) for method in (lm.Taylor(order=6), lm.RKMK(order=8))
    )
    assert np.abs(a.mu[-1] - b.mu[-1]).max() < 1e-11


@pytest.mark.slow
def test_momentum_of_links_that_float():
    """Joints pull both bodies by opposite forces in every order: the linear momentum stays to rounding,
    whatever the error.
    """
    rod = Link.rod(1.0, 1.0, 0.1)
    low, up = [0.0, 0.0, -0.5], [0.0, 0.0, 0.5]
    linkage = Linkage([rod] * 3, [BallJoint(1, 0, up, low), BallJoint(2, 1, up, low)], gravity=0.0)
    poses = np.tile(np.eye(4), (3, 1, 1))
    poses[:, 2, 3] = [0.0, -1.0, -2.0]
    start = linkage.assembled(poses, np.tile([0.3, 0.1, 0.2, 0.2, 0.0, 0.1], (3, 1)))
    run = lm.integrate(linkage, lm.Taylor(order=3), start, h=0.2, steps=30, compiled=False)
    assert np.ptp(run.energy) > 1e-7
    R, p = run.g.reshape(-1, 3, 4, 4)[:, :, :3, :3], run.mu.reshape(-1, 3, 6)[:, :, 3:]
    total = np.einsum("tbij,tbj->ti", R, p)
    assert np.ptp(total, axis=0).max() < 2e-14 * np.abs(total).max()


def test_logarithm_of_series():
    """log(R exp(s v)) at s = 0 has the derivative dexp^-1 of v, from rest to half a turn."""
    group, v = lm.SO3(), np.array([0.3, -0.5, 0.7])
    V = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    for size in (0.0, 1e-9, 0.1, 0.41, 1.0, 2.0, 3.1):
        xi = size * np.array([0.6, 0.0, 0.8])
        R = group.exp(xi)
        terms = [R, R @ V, 0.5 * R @ V @ V, R @ V @ V @ V / 6.0]
        q = group.log(mat(*[vec(*[Series(*[float(c[i, j]) for c in terms]) for j in range(3)])
                            for i in range(3)]))  # fmt: skip
        slope = group.algebra.dexp_inv_dual(-q, vec(*v))
        left = group.algebra.dexp_inv(xi, v)
        assert np.abs(np.array([x[1] for x in q]) - left).max() < 4e-14
        # and of the second order: the derivative of dexp_inv along the way
        e = 1e-4
        ways = [group.algebra.dexp_inv(group.log(R @ group.exp(s * v)), v) for s in (e, -e)]
        assert np.abs(np.array([x[1] for x in slope]) - (ways[0] - ways[1]) / (2.0 * e)).max() < 1e-7


def test_what_is_refused():
    rods = lm.joints.chain(3, axis=TURN)
    start = rods.state(angles={0: 0.5})
    with pytest.raises(IncompatibleSystem, match=r"no adaptive steps.*Exponential"):
        lm.integrate(rods, lm.Taylor(order=6), start, t_end=0.1, rtol=1e-6)
    shaken = Linkage(rods.links, rods.joints, motions={0: Shaking([0.0, 0.0, 0.1], 50.0)})
    with pytest.raises(IncompatibleSystem, match="no joints in a given motion"):
        lm.integrate(shaken, lm.Taylor(order=6), start, h=0.01, steps=2)


@pytest.mark.slow
def test_native_is_plain_and_compiles_once():
    made = mixed()
    native, plain = (
        lm.integrate(made[0], lm.Taylor(order=6), made[1], h=0.02, steps=6, compiled=compiled)
        for compiled in (True, False)
    )
    assert np.array_equal(native.g, plain.g) and np.array_equal(native.mu, plain.mu)
    rods = lm.joints.chain(40)
    start = rods.state(angles={0: [0.3, 0.1, 0.0], 20: [0.2, 0.0, 0.0]})
    run = lm.integrate(rods, lm.Taylor(order=10), start, h=2e-3, steps=50, compiled=True)
    assert np.ptp(run.energy) < 1e-12 * np.abs(run.energy[0])
    assert np.abs(rods.conditions_at(run.mu[-1], run.g[-1])[0]).max() < 1e-11
