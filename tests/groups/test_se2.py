"""The group of rigid motions of the plane: what is particular to it, and bodies that slide on ice."""

from __future__ import annotations

import math

import mpmath as mp
import numpy as np
import pytest

import liemech as lm
from liemech.formulas import jacobian
from liemech.groups.retractions import CayleyAdjoint
from liemech.groups.rigid.se2 import SE2
from liemech.groups.rigid.se3 import SE3
from liemech.systems.kinetic_energy import KineticEnergy

G = SE2()
EPS = np.finfo(float).eps
IN_SPACE = [2, 3, 4]
"""Where (w, v_x, v_y) lies in a screw: SE(2) is the part of SE(3) that keeps the plane."""


def screw(xi: np.ndarray) -> np.ndarray:
    total = np.zeros(6)
    total[IN_SPACE] = xi
    return total


@pytest.mark.parametrize("size", [0.0, 1e-8, 0.6, 0.65, 2.0, 3.1])
def test_motions_of_the_plane_are_motions_of_space(size: float, rng: np.random.Generator) -> None:
    for xi in rng.normal(size=(5, 3)):
        xi = np.r_[size, xi[1:]]
        S = SE3()
        pairs = ((G.exp, S.exp), (G.cayley, S.cayley), (G.by_adjoint.cayley, S.by_adjoint.cayley))
        for ours, in_space in pairs:
            g, h = ours(xi), in_space(screw(xi))
            assert np.abs(g[:2, :2] - h[:2, :2]).max() < 4 * EPS
            assert np.abs(g[:2, 2] - h[:2, 3]).max() < 8 * EPS


def test_a_quarter_turn_on_an_arc() -> None:
    """Turning left by pi/2 while going ahead by pi/2: a quarter of the unit circle."""
    g = G.exp(np.array([math.pi / 2, math.pi / 2, 0.0]))
    assert np.abs(g - [[0, -1, 1], [1, 0, 1], [0, 0, 1]]).max() < 2 * EPS


@pytest.mark.parametrize("size", [1e-8, 0.63, 0.64, 2.0, math.pi, 100.0, 1e8, 1e15])
def test_accuracy_of_the_exponential(size: float, rng: np.random.Generator) -> None:
    for factor, x, y in rng.normal(size=(20, 3)):
        w = size * factor
        with mp.workdps(60):
            c, s, a, b = mp.cos(w), mp.sin(w), mp.sin(w) / mp.mpf(w), (1 - mp.cos(w)) / mp.mpf(w)
            wanted = [c, -s, a * x - b * y, s, c, b * x + a * y, 0, 0, 1]
            g = G.exp(np.array([w, x, y])).ravel().tolist()
            assert max(abs(mp.mpf(u) - z) for u, z in zip(g, wanted, strict=True)) < 4 * EPS * max(1.0, abs(x), abs(y))


@pytest.mark.parametrize("w", [0.0, 1e-12, 1e-3, 1.0, -2.0, 3.0, math.pi - 1e-4, math.pi - 1e-13, -math.pi + 1e-9])
def test_accuracy_of_the_logarithm(w: float, rng: np.random.Generator) -> None:
    for v in rng.normal(size=(20, 2)):
        found = G.log(G.exp(np.array([w, *v])))
        assert abs(found[0] - w) < 3 * EPS
        assert np.abs(found[1:] - v).max() < 4 * EPS * np.abs(v).sum()


def test_the_algebra_is_closed_under_x_y_x(rng: np.random.Generator) -> None:
    """(w, v)(a, u)(w, v) = -w a (w, v): there is a Cayley map."""
    xi, eta = rng.normal(size=(2, 3))
    X, Y = G.algebra.hat(xi), G.algebra.hat(eta)
    assert np.abs(X @ Y @ X + xi[0] * eta[0] * G.algebra.hat(xi)).max() < 8 * EPS
    assert G.why_no_cayley() is None


def test_cayley_of_anything_finite() -> None:
    assert np.array_equal(G.cayley(np.array([1e160, 1.0, 2.0]))[:2, :2], [[-1.0, -4e-160], [4e-160, -1.0]])
    for w in (1e3, -1e8, 1e100):
        assert G.contains(G.cayley(np.array([w, 1.0, 2.0])))


def test_membership_names_the_law(rng: np.random.Generator) -> None:
    g = G.random(rng)
    assert G.contains(G.random(rng, (50,))).all()
    for broken, words in (
        (np.diag([1.0, -1.0, 1.0]), "reflection"),
        (np.diag([2.0, 2.0, 1.0]), "differs from the unit matrix by 3"),
        (g + np.diag([0, 0, 1e-3]), "last row"),
    ):
        assert not G.contains(broken)
        with pytest.raises(lm.errors.InvalidInput, match=words):
            G.inverse(broken)
    noisy = g + 1e-3 * rng.normal(size=(3, 3))
    assert G.contains(G.nearest(noisy))
    assert np.abs(G.nearest(noisy) - g).max() < 1e-2


# ---------------------------------------------------------------- bodies that move

CAYLEY, ADJOINT = map(lm.CovariantVariational, (lm.Cayley(), CayleyAdjoint()))


def sledge() -> tuple[lm.LiePoissonSystem, lm.BodyState]:
    """A body in a plane fluid: added mass depends on the direction, and the centre of pressure is
    not the centre of mass.
    """
    system = lm.LiePoissonSystem(G, KineticEnergy(np.array([[1.0, 0.1, 0.2], [0.1, 1.5, 0.0], [0.2, 0.0, 0.7]])))
    return system, system.state([0.4, 0.8, -0.5], G.exp(np.array([0.3, 1.0, -2.0])))


def test_both_cayley_maps_are_one_in_the_plane() -> None:
    system, start = sledge()
    runs = [lm.integrate(system, method, start, h=0.1, steps=50) for method in (CAYLEY, ADJOINT)]
    assert np.array_equal(runs[0].g, runs[1].g)


def test_the_mismatch_vanishes_where_it_should_and_its_slope_is_its_derivative() -> None:
    algebra = lm.SE2().algebra
    for xi in ([0.7, 0.4, -1.1], [-1.9, 0.2, 0.5], [1e-9, 0.3, 0.8]):
        xi, mu = lm.vec(*xi), lm.vec(0.9, -0.6, 0.5)
        r, _, slope = algebra.exp_residual(xi, algebra.dexp_dual(-xi, mu), mu)
        assert np.abs(np.array(r)).max() < 1e-15 * 4
        derived = jacobian(lambda x, mu=mu: algebra.exp_residual(x, mu, mu)[0], xi)
        assert np.abs(np.array(slope) - np.array(derived)).max() < 1e-9
