"""Extended poses and Galilean frames: every law, references by series and 40 digits, and their motions."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest
from bare import phi1
from scipy.linalg import expm

import liemech as lm
from liemech.groups.lie_algebra import sided

EPS = 2.0**-52
GROUPS = (lm.SE23(), lm.SGal3())
names = pytest.mark.parametrize("group", GROUPS, ids=repr)


def ad(group: lm.LieGroup, xi: np.ndarray) -> np.ndarray:
    return np.stack([group.ad(xi, unit) for unit in np.eye(group.dim)], axis=1)


@pytest.mark.slow
@names
def test_every_law_holds(group: lm.LieGroup) -> None:
    report = lm.check_group(group)
    assert not report.broken
    closed = {finding.law for finding in report.findings if finding.verdict == "holds"}
    assert {"log", "exp_Ad_star", "dexp_inv", "dexp_inv_dual", "dual of Ad", "cayley_inv"} <= closed


@pytest.mark.sample(8)
@names
@pytest.mark.parametrize("size", [0.0, 1e-9, 1e-3, 0.6, 0.65, 2.5, 6.2, 30.0])
def test_closed_forms_beside_block_exponentials(group: lm.LieGroup, size: float) -> None:
    """On both sides of every switch between a polynomial and a quotient."""
    rng = np.random.default_rng(7)
    for xi, eta, mu in rng.normal(size=(4, 3, group.dim)):
        xi[:3] *= size / np.linalg.norm(xi[:3])
        a = ad(group, xi)
        bound = 200.0 * EPS * (1.0 + np.linalg.norm(a)) ** 2
        x = np.array(group.algebra.hat(xi))
        assert np.abs(group.exp(xi) - expm(x)).max() <= bound * np.abs(expm(x)).max()
        for side, sign in (("right", 1.0), ("left", -1.0)):
            D = phi1(sign * a)
            found = group.dexp(xi, eta, side)
            assert np.abs(found - D @ eta).max() <= bound * np.abs(D).max()
            assert np.abs(group.algebra.dexp_dual(sided(xi, side), mu) - D.T @ mu).max() <= bound * np.abs(D).max()
            if size < 6.0:
                back = group.dexp_inv(xi, found, side)
                assert np.abs(back - eta).max() <= bound * np.linalg.cond(D)


@pytest.mark.sample(2)
@pytest.mark.parametrize("size", [1e-8, 0.3, 0.63246, 0.7, 2.4, 2.6])
def test_galilean_exponential_in_40_digits(size: float) -> None:
    """The displacement V u + s E a, E = 1/2 + W/6 + ...: relative to its terms."""
    rng = np.random.default_rng(11)
    for xi in rng.normal(size=(5, 10)):
        xi[:3] *= size / np.linalg.norm(xi[:3])
        with mp.workdps(40):
            x = mp.matrix(np.array(lm.SGal3().algebra.hat(xi)).tolist())
            exact = mp.expm(x, method="taylor")
            g = lm.SGal3().exp(xi)
            worst = max(abs(mp.mpf(float(g[i, j])) - exact[i, j]) for i in range(5) for j in range(5))
        assert worst <= 8 * EPS * max(1.0, np.abs(xi).max() ** 2)


def test_a_frame_moves_events() -> None:
    """(x, t) -> (R x + v t + p, t + t_g), one frame after another; boosts do not commute with time."""
    G, rng = lm.SGal3(), np.random.default_rng(5)
    g, h = G.random(rng, 2)
    event = np.r_[rng.normal(size=4), 1.0]
    assert np.abs(G.compose(g, h) @ event - g @ (h @ event)).max() < 1e-14
    R, v, p, t = g[:3, :3], g[:3, 3], g[:3, 4], g[3, 4]
    moved = g @ event
    assert np.abs(moved[:3] - (R @ event[:3] + v * event[3] + p)).max() < 1e-14
    assert moved[3] == event[3] + t
    boost, wait = np.eye(10)[3], np.eye(10)[9]
    assert np.array_equal(G.ad(boost, wait), np.eye(10)[6])


def test_a_free_fall_is_one_exponential() -> None:
    """Acceleration a for the time s from rest: velocity a s, displacement a s^2/2, exactly."""
    s, a = 3.0, np.array([0.0, 0.5, -10.0])
    g = lm.SGal3().exp(np.r_[np.zeros(3), s * a, np.zeros(3), s])
    assert np.array_equal(g[:3, 3], s * a)
    assert np.array_equal(g[:3, 4], 0.5 * s * s * a)


def test_extended_poses_are_galilean_frames_at_one_time() -> None:
    """SE_2(3) is the subgroup t = 0 of SGal(3), and each vector makes a rigid motion."""
    rng = np.random.default_rng(3)
    for xi, eta in rng.normal(size=(10, 2, 9)):
        long, short = lm.SGal3(), lm.SE23()
        at_rest = np.r_[xi, 0.0]
        assert np.abs(long.exp(at_rest) - short.exp(xi)).max() < 8 * EPS
        assert np.abs(long.dexp(at_rest, np.r_[eta, 0.0])[:9] - short.dexp(xi, eta)).max() < 32 * EPS
        motion = lm.SE3().exp(np.r_[xi[:3], xi[6:]])
        assert np.abs(short.exp(xi)[:3, [0, 1, 2, 4]] - motion[:3]).max() < 4 * EPS


@names
def test_casimirs_and_orbits(group: lm.LieGroup) -> None:
    """As many Casimirs as the orbits lack dimensions."""
    action, mu = lm.coadjoint(group), np.random.default_rng(2).normal(size=group.dim)
    assert action.orbit_dimension(mu) == group.dim - len(group.casimirs(mu))
    for nu in action.random_on_orbit(mu, rng=1, size=5):
        there, here = group.casimirs(nu), group.casimirs(mu)
        assert np.abs(there - here).max() <= 1e-11 * max(1.0, np.abs(there).max())


@names
def test_what_is_no_element_is_refused(group: lm.LieGroup) -> None:
    g = np.eye(5)
    g[4, 0] = 1.0
    with pytest.raises(lm.errors.InvalidInput, match=rf"{group!r}.*last rows".replace("(", r"\(").replace(")", r"\)")):
        group.log(g)
    with pytest.raises(lm.errors.InvalidInput, match="reflection"):
        group.log(np.diag([1.0, 1.0, -1.0, 1.0, 1.0]))
    late = np.eye(5)
    late[3, 4] = 2.0
    assert lm.SGal3().contains(late)
    assert not lm.SE23().contains(late)
