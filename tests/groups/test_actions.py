"""Actions of groups on spaces: their laws, the spheres, orbits and vector spaces that the library
ships, and their tangents.
"""

from __future__ import annotations

from functools import partial

import mpmath as mp
import numpy as np
import pytest
from scenes import hat
from scipy.linalg import expm

import liemech as lm
from liemech.groups.representations import AdjointAction, Representation, RotationAction, standard_action

EPS = 2.0**-52
SO3, SE3, Q, SL3 = lm.SO3(), lm.SE3(), lm.UnitQuaternions(), lm.SL(3)

SPHERES = (lm.actions.SphereAction(3), lm.actions.SphereAction(4), lm.actions.SphereAction(Q))
REPRESENTATIONS = (
    lm.actions.LinearAction(SO3),
    lm.actions.LinearAction(SL3),
    RotationAction(SO3),
    RotationAction(Q),
    AdjointAction(SE3),
    lm.actions.CoadjointAction(SO3),
    lm.actions.CoadjointAction(SE3),
)
OTHERS = (
    lm.actions.TranslationAction(3),
    lm.actions.LeftMultiplication(SO3),
    lm.actions.LeftMultiplication(Q),
    lm.actions.LeftMultiplication(lm.SU(2)),
    lm.actions.LeftMultiplication(lm.VectorSpace(2)),
)
ACTIONS = (*SPHERES, *REPRESENTATIONS, *OTHERS)

each = partial(pytest.mark.parametrize, "action", ids=repr)


def close(a: object, b: object, ulps: float = 32.0) -> bool:
    a, b = np.asarray(a), np.asarray(b)
    return bool(np.abs(a - b).max() <= ulps * EPS * max(1.0, np.abs(b).max()))


@pytest.mark.sample(8)
@each(ACTIONS)
def test_laws(action: lm.GroupAction) -> None:
    """(g h) . x = g . (h . x), e . x = x, the infinitesimal action is the derivative, exp_act is
    act of exp, points stay.
    """
    assert lm.check_action(action)


@each(ACTIONS)
def test_arrays_of_points_and_elements(action: lm.GroupAction) -> None:
    """Leading axes broadcast, and each point moves as it does alone."""
    group, rng = action.group, np.random.default_rng(4)
    g, x, xi = group.random(rng, (2, 1)), action.random(rng, 3), rng.normal(size=(2, 1, group.dim))
    moved, carried, rate = action.act(g, x), action.exp_act(xi, x), action.infinitesimal(xi, x)
    assert moved.shape == carried.shape == rate.shape == (2, 3, *x.shape[1:])
    assert np.array_equal(moved[1, 2], action.act(g[1, 0], x[2]))
    assert np.array_equal(carried[1, 2], action.exp_act(xi[1, 0], x[2]))
    assert np.array_equal(rate[1, 2], action.infinitesimal(xi[1, 0], x[2]))
    assert action.contains(moved).all()
    assert action.random(1).shape == action.point_shape


@lm.record
class OnThePlane(lm.GroupAction):
    """SL(2) on the projective line, one angle for a direction of the plane: what a user must write, and no more."""

    def act(self, g: lm.Element, x: lm.Vec) -> lm.Vec:
        denominator = g[1, 0] * x[0] + g[1, 1]
        return lm.vec((g[0, 0] * x[0] + g[0, 1]) / denominator)


def test_what_is_left_out_follows() -> None:
    """Moebius maps x -> (a x + b)/(c x + d): at x the algebra's matrix (p, q; r, -p) moves with 2 p x + q - r x^2."""
    action = OnThePlane(lm.SL(2))
    assert lm.check_action(action, points=[[0.3], [-0.8], [0.1]])
    xi, x = np.array([0.2, -0.5, 0.7]), np.array([0.4])
    m = lm.SL(2).algebra.hat(xi)
    assert close(action.infinitesimal(xi, x), [2 * m[0, 0] * x[0] + m[0, 1] - m[1, 0] * x[0] ** 2], 4)
    assert action.point_shape is None
    assert action.contains(x)
    with pytest.raises(NotImplementedError, match="OnThePlane must define `point_shape`"):
        action.random()
    with pytest.raises(NotImplementedError, match="GroupAction must define `act`"):
        lm.GroupAction(SO3).act(np.eye(3), np.ones(3))
    with pytest.raises(lm.errors.InvalidType, match="group must be a LieGroup"):
        OnThePlane(3)


# ---------------------------------------------------------------- spheres


def test_spheres_of_all_dimensions() -> None:
    assert lm.actions.SphereAction(3).group == SO3
    assert lm.actions.SphereAction(4).group == lm.SO(4)
    for action, dim in zip(SPHERES, (2, 3, 2), strict=True):
        x = action.random(3)
        assert action.defect(x) <= 4 * EPS
        generators = action.generators(x)
        assert np.abs(x @ generators).max() <= 4 * EPS  # tangent
        assert np.linalg.matrix_rank(generators) == dim  # to all of the sphere


def test_points_of_spheres_turn_by_the_rotation(rng: np.random.Generator) -> None:
    for size in (0.0, 1e-8, 0.6, 0.7, 3.1, 6.3, 50.0):
        xi = rng.normal(size=3)
        xi *= size / np.linalg.norm(xi)
        x = SPHERES[0].random(rng)
        with mp.workdps(40):
            turned = mp.expm(mp.matrix(hat(xi).tolist()), method="taylor") * mp.matrix(x.tolist())
            expected = np.array([float(a) for a in turned])
        for action in (SPHERES[0], SPHERES[2]):
            assert np.abs(action.exp_act(xi, x) - expected).max() <= 8 * EPS
        assert np.abs(SPHERES[0].infinitesimal(xi, x) - np.cross(xi, x)).max() <= 4 * EPS * max(1.0, size)
    g, q = SO3.random(rng), Q.random(rng)
    assert close(SPHERES[0].act(g, x), g @ x)
    assert close(SPHERES[2].act(q, x), Q.matrix(q) @ x)


def test_spheres_refuse_what_is_no_point_and_no_rotation() -> None:
    assert not lm.actions.SphereAction(3).contains([1.0, 1.0, 0.0])
    with pytest.raises(lm.errors.InvalidInput, match="does not keep the lengths"):
        lm.actions.SphereAction(SL3)
    with pytest.raises(lm.errors.InvalidInput, match="integer"):
        lm.actions.SphereAction(2.5)
    with pytest.raises(lm.errors.InvalidInput, match=r"last axes must be \(4,\)"):
        lm.actions.SphereAction(4).act(np.eye(4), np.ones(3))


def test_steps_in_the_chart_stay_on_the_sphere() -> None:
    """x' = A(x) . x as Omega' = dexp_Omega^-1 A(exp(Omega) . x_n), by classical Runge-Kutta: order
    4, and |x| = 1 to rounding.
    """
    action, group = SPHERES[0], SO3

    def velocity(x: np.ndarray) -> np.ndarray:
        return np.array([x[1] * x[2], 1.0 + x[0], -0.5 * x[2]])

    def step(x: np.ndarray, h: float) -> np.ndarray:
        def rate(omega: np.ndarray) -> np.ndarray:
            return np.asarray(group.dexp_inv(omega, velocity(action.exp_act(omega, x)), side="right"))

        k1 = rate(np.zeros(3))
        k2 = rate(h / 2 * k1)
        k3 = rate(h / 2 * k2)
        k4 = rate(h * k3)
        return np.asarray(action.exp_act(h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), x))

    def end(n: int) -> np.ndarray:
        x = np.array([0.6, 0.0, 0.8])
        for _ in range(n):
            x = step(x, 1.0 / n)
        return x

    assert abs(np.linalg.norm(end(32)) - 1.0) <= 16 * EPS
    errors = [np.abs(end(n) - end(2 * n)).max() for n in (8, 16)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.3)


# ---------------------------------------------------------------- representations and their duals


@each(REPRESENTATIONS)
def test_duals_are_transposes(action: Representation) -> None:
    rng = np.random.default_rng(6)
    g, xi = action.group.random(rng), rng.normal(size=action.group.dim)
    x, p = rng.normal(size=(2, action.space_dim))
    one = {"act": g, "infinitesimal": xi, "phi1": 0.5 * xi, "phi1_inv": 0.5 * xi, "half_inverse": 0.3 * xi}
    for name, a in one.items():
        left, right = p @ getattr(action, name)(a, x), getattr(action, name + "_dual")(a, p) @ x
        assert abs(left - right) <= 64 * EPS * (abs(left) + 10), name
    assert p @ action.exp_act(xi, x) == pytest.approx(action.exp_act_dual(xi, p) @ x, abs=64 * EPS * 10)
    assert action.momentum(x, p) @ xi == pytest.approx(p @ action.infinitesimal(xi, x), abs=64 * EPS)


@pytest.mark.sample(9)
@pytest.mark.parametrize("size", [0.0, 1e-8, 0.9, 1.1, 6.0])
@each(REPRESENTATIONS)
def test_averages_by_matrices(action: Representation, size: float) -> None:
    """exp, phi1 = (e^A - 1)/A, its inverse and (1 - A/2)^-1 of the matrix A of the representation."""
    rng, k = np.random.default_rng(9), action.space_dim
    xi = rng.normal(size=action.group.dim)
    xi *= size / np.linalg.norm(xi)
    A = np.stack([action.infinitesimal(xi, unit) for unit in np.eye(k)], axis=1)
    phi1 = expm(np.block([[A, np.eye(k)], [np.zeros((k, 2 * k))]]))[:k, k:]
    x = rng.normal(size=k)
    scale = 8 * np.linalg.norm(expm(A)) * np.linalg.cond(phi1)
    assert close(action.exp_act(xi, x), expm(A) @ x, scale)
    assert close(action.phi1(xi, x), phi1 @ x, scale)
    assert close(action.phi1_inv(xi, x), np.linalg.solve(phi1, x), scale)
    half = np.eye(k) - 0.5 * A
    if np.linalg.cond(half) < 100:
        assert close(action.half_inverse(xi, x), np.linalg.solve(half, x), 8 * np.linalg.cond(half))


def test_generators_span_the_orbit(rng: np.random.Generator) -> None:
    for action, rank in (
        (lm.actions.LinearAction(SL3), 3),
        (lm.actions.LinearAction(SO3), 2),
        (lm.actions.CoadjointAction(SE3), 4),
    ):
        x = action.random(rng)
        generators = action.generators(x)
        assert generators.shape == (len(x), action.group.dim)
        assert np.linalg.matrix_rank(generators) == rank
        xi = rng.normal(size=action.group.dim)
        assert close(generators @ xi, action.infinitesimal(xi, x))


def test_standard_action() -> None:
    assert standard_action(SO3) == RotationAction(SO3)
    assert standard_action(Q) == RotationAction(Q)
    assert standard_action(SL3) == lm.actions.LinearAction(SL3)
    with pytest.raises(lm.errors.InvalidInput, match="complex, not real matrices"):
        lm.actions.LinearAction(lm.SU(2))
    with pytest.raises(lm.errors.InvalidInput, match="vectors, not real matrices"):
        lm.actions.LinearAction(Q)
    with pytest.raises(lm.errors.InvalidType, match="must be SO3"):
        RotationAction(SL3)


def test_coadjoint_action_is_one_of_these(rng: np.random.Generator) -> None:
    action = lm.coadjoint(SE3)
    g, (mu, xi) = SE3.random(rng), rng.normal(size=(2, 6))
    assert isinstance(action, lm.GroupAction)
    assert np.array_equal(action.act(g, mu), SE3.K(g, mu))
    assert np.array_equal(action.infinitesimal(xi, mu), -SE3.ad_star(xi, mu))
    assert action.on_same_orbit(mu, action.exp_act(xi, mu), tolerance=64 * EPS)


# ---------------------------------------------------------------- vectors moving vectors, a group moving itself


def test_translations_add_no_operation(rng: np.random.Generator) -> None:
    action = lm.actions.TranslationAction(3)
    xi, x = rng.normal(size=(2, 3))
    assert np.array_equal(action.act(xi, x), x + xi)
    assert np.array_equal(action.exp_act(xi, x), x + xi)
    assert np.array_equal(action.infinitesimal(xi, x), xi)
    assert action == lm.actions.TranslationAction(lm.VectorSpace(3))
    with pytest.raises(lm.errors.InvalidType, match="must be a VectorSpace or its dimension"):
        lm.actions.TranslationAction(SO3)


def test_a_group_moves_itself(rng: np.random.Generator) -> None:
    for group in (SO3, lm.SU(2)):
        action, xi = lm.actions.LeftMultiplication(group), rng.normal(size=group.dim)
        g, h = group.random(rng, 2)
        assert close(action.act(g, h), g @ h)
        assert close(action.infinitesimal(xi, h), group.algebra.hat(xi) @ h)
        assert not action.contains(1.1 * h)
        with pytest.raises(lm.errors.InvalidInput, match=r"x is not in"):
            action.act(g, 1.1 * h)


# ---------------------------------------------------------------- many at once


@pytest.mark.sample(2)
@pytest.mark.parametrize("n", [10, 2100])
@each([SPHERES[0], lm.actions.LinearAction(SO3), lm.actions.CoadjointAction(SO3), lm.actions.LeftMultiplication(SO3)])
def test_elements_off_the_group_are_refused_however_many(action: lm.GroupAction, n: int) -> None:
    g, x = action.group.random(1, n), action.random(2, n)
    g[7] *= 1.1
    with pytest.raises(lm.errors.InvalidInput, match=r"g\[7\] is not in SO3"):
        action.act(g, x)


def test_generators_at_points_that_are_matrices() -> None:
    """Of rotations from the left every component of xi moves g: hat(e_i) g, in a row."""
    action, g = lm.actions.LeftMultiplication(lm.SO3()), lm.SO3().exp([0.4, -0.3, 0.5])
    found = np.asarray(action.generators(g))
    expected = [(lm.SO3().algebra.hat(unit) @ g).ravel() for unit in np.eye(3)]
    assert np.allclose(found, np.transpose(expected), rtol=0, atol=1e-15)
    assert np.linalg.matrix_rank(found) == 3
