"""Both sides of borders: charts, series in two precisions, displacements without bound, momenta at
the end of the numbers, and what is no Poisson structure.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import shipped

import liemech as lm
from liemech.formulas import Vec
from liemech.formulas.numbers.double_double import DoubleDouble
from liemech.groups.ad_series import bernoulli_series, exponential_series, mean, mean_slope
from liemech.groups.bernoulli import BERNOULLI, TERMS
from liemech.groups.matrices.skew_matrices import like_sizes, null_vectors

TURNING = shipped.turning()


@pytest.mark.parametrize("group", TURNING, ids=repr)
def test_the_chart_of_the_exponential_ends_at_a_full_turn(group: lm.LieGroup) -> None:
    """Whatever the displacement; there its inverse differential is refused."""
    for angle, inside in ((0.9, True), (6.2831, True), (-6.2831, True), (6.2833, False), (9.0, False), (-9.0, False)):
        xi = [angle, *[0.0] * (group.dim - 1)]
        assert group.algebra.is_exp_chart(xi) is inside
        far = [angle, *[0.0] * (group.dim - 1)]
        far[-1] = far[-1] + 50.0 * (group.dim > 3)
        assert group.algebra.is_exp_chart(far) is inside
        if inside:
            assert np.isfinite(group.dexp_inv(xi, np.ones(group.dim))).all()
        else:
            with pytest.raises(lm.errors.OutsideChart):
                group.dexp_inv(xi, np.ones(group.dim))


@pytest.mark.parametrize("size", [1e3, 1e149, 1e151, 1e200])
def test_the_cayley_map_of_any_velocity(size: float) -> None:
    """Nearly half a turn, off by 4/|xi|."""
    rotation = np.array(lm.SO3().cayley([0.0, 0.0, size]))
    plane = np.array(lm.SE2().cayley([size, 3.0, -5.0]))
    sine, cosine = 4.0 / size / (1.0 + 4.0 / size**2 if size < 1e100 else 1.0), -1.0
    for g in (rotation, plane):
        assert g[1, 0] == pytest.approx(sine, rel=1e-14) and g[0, 1] == -g[1, 0]
        assert g[0, 0] == g[1, 1] == pytest.approx(cosine, abs=9.0 / size**2 if size < 1e100 else 0.0)
    half = np.array([[1.0, 0.5 * size], [-0.5 * size, 1.0]])  # (1 - w J/2)
    assert half @ (plane[:2, 2] / 1.0) == pytest.approx([3.0, -5.0], rel=1e-5)
    moved = np.array(lm.SE2().compose_cayley(np.eye(3), [size, 3.0, -5.0]))
    assert np.allclose(moved, plane, rtol=1e-14, atol=0.0)
    for tilted in ([size, 0.0, 0.0], [0.3 * size, 0.5 * size, -0.8 * size]):
        g = np.array(lm.SO3().cayley(tilted))
        assert np.abs(g @ g.T - np.eye(3)).max() < 1e-15 and np.linalg.det(g) == pytest.approx(1.0)
        axis = np.array(tilted) / np.linalg.norm(np.array(tilted) / size) / size
        assert np.abs(g - (2.0 * np.outer(axis, axis) - np.eye(3))).max() < 5.0 / size + 1e-15


def test_series_of_ad() -> None:
    """In both precisions beside closed forms of rotations; Bernoulli's, term by term."""
    ad, closed = lm.SO3().algebra.bracket, lm.SO3().algebra
    numbers = np.random.default_rng(2).normal(size=(2, 3)).tolist()
    for kind, digits in ((float, 2e-15), (DoubleDouble, 1e-29)):
        x, v = (Vec(*[kind(a) for a in row]) for row in numbers)

        def off(found: Any, wanted: Any) -> float:
            rest = found - wanted
            return max(abs(r.value if isinstance(r, DoubleDouble) else r) for r in rest)

        assert off(mean(ad, x, v), closed.dexp(-x, v)) < digits
        assert off(exponential_series(ad, -x, v), closed.exp_Ad_star(x, v)) < digits
    x, v = (Vec.of(row) for row in numbers)
    slope = np.array(mean_slope(ad, x, v, lm.dot(x, x)))
    assert np.abs(slope - np.array(lm.jacobian(lambda y: mean(ad, y, v), x))).max() < 1e-10
    total, power = np.zeros(3), np.array(v)
    for k in range(9):
        total = total + BERNOULLI[k] * power
        assert np.allclose(np.array(bernoulli_series(ad, x, v, k)), total, rtol=1e-15, atol=1e-15)
        assert np.allclose(np.array(closed.dexp_inv_series(-x, v, k)), total, rtol=1e-14, atol=1e-15)
        power = np.cross(numbers[0], power)
    for terms in (-1, TERMS + 1, 10**30):
        with pytest.raises(lm.errors.InvalidInput, match=f"from 0 to {TERMS}; got"):
            closed.dexp_inv_series(numbers[0], numbers[1], terms)


def test_orbits_at_the_end_of_the_numbers() -> None:
    """Momenta that have no reciprocal, and those whose squares overflow."""
    rotations, motions = lm.coadjoint(lm.SO3()), lm.coadjoint(lm.SE3())
    for size in (5e-310, 1e-150, 1.0, 1e160, 1e307):
        mu, nu = size * np.array([3.0, 4.0, 0.0]), size * np.array([0.0, 0.0, 5.0])
        assert rotations.on_same_orbit(mu, nu)
        assert not rotations.on_same_orbit(mu, 1.01 * nu)
        resting = np.concatenate([mu, np.zeros(3)]), np.concatenate([nu, np.zeros(3)])
        assert motions.on_same_orbit(*resting)
        assert not motions.on_same_orbit(resting[0], 1.01 * resting[1])
        assert not motions.on_same_orbit(resting[0], np.concatenate([nu, size * np.eye(3)[0]]))
    general = lm.coadjoint(lm.SemidirectProduct(lm.SO3()))
    mu = np.array([0.3, -0.2, 0.5, 0.0, 0.0, 0.0])
    assert general.on_same_orbit(mu, mu[[1, 2, 0, 3, 4, 5]])
    assert not general.on_same_orbit(mu, 1.1 * mu)
    assert not general.on_same_orbit(mu, np.array([0.3, -0.2, 0.5, 0.0, 0.0, 1e-3]))


def test_poisson_structures_of_all_sizes() -> None:
    for n in (1, 2, 3):
        structure = lm.structures.Canonical(n)
        assert structure.dim == structure.rank == 2 * n
        B = np.block([[np.zeros((n, n)), np.eye(n)], [-np.eye(n), np.zeros((n, n))]])
        y, a = np.random.default_rng(n).normal(size=(2, 2 * n))
        assert np.array_equal(structure.matrix(y), B)
        assert np.array_equal(structure.sharp(y, a), B @ a)
        for i in range(2 * n):
            assert np.allclose(structure.coordinate_flow(y, i, 0.3), y + 0.3 * B[:, i])
    with pytest.raises(lm.errors.InvalidInput, match="y"):
        lm.structures.Canonical(2).sharp(np.zeros(3), np.zeros(4))
    assert lm.structures.ConstantStructure([[0.0]]).rank == 0


@pytest.mark.parametrize("off", [1e-12, 0.5, 2.0])
def test_matrices_that_are_not_skew_are_refused(off: float) -> None:
    with pytest.raises(lm.errors.InvalidInput, match=r"entries \(1, 2\) and \(2, 1\) are 1 and -"):
        lm.structures.ConstantStructure([[0.0, 1.0], [-1.0 - off, 0.0]])


def test_null_vectors_in_any_units() -> None:
    """Their largest component is one; units are powers of two that make rows alike."""
    skew = np.array([[0.0, 3.0, -2.0], [-3.0, 0.0, 5.0], [2.0, -5.0, 0.0]])
    for units in (np.ones(3), np.array([1e-40, 1e-40, 1e-40]), np.array([1e2, 1e-2, 3.0])):
        B = units[:, None] * skew * units
        (found,) = null_vectors(B)
        exact = np.array([5.0, 2.0, 3.0]) / units
        assert np.allclose(found, exact / np.abs(exact).max(), rtol=1e-11, atol=0.0)
    pairs = np.zeros((5, 5))
    pairs[0, 1], pairs[1, 0], pairs[2, 3], pairs[3, 2] = 1e40, -1e40, 1e-60, -1e-60
    d = like_sizes(pairs)
    rows = np.abs(d[:, None] * pairs * d).max(axis=1)
    assert np.array_equal(d, 2.0 ** np.round(np.log2(d))) and d[4] == 1.0
    assert (rows[:4] > 0.25).all() and (rows[:4] < 4.0).all()
    assert null_vectors(pairs) == ((0.0, 0.0, 0.0, 0.0, 1.0),)
    assert null_vectors(pairs[:4, :4]) == ()
    assert len(null_vectors(np.zeros((2, 2)))) == 2 and len(null_vectors(np.zeros((1, 1)))) == 1
    u, v = np.array([0.1, 0.2, 0.3, 0.7]), np.array([0.3, 0.6, 0.2, 0.5])
    noisy = np.outer(u, v) - np.outer(v, u)  # an entry of 1e-17 is a rounding error, and no unit
    noisy[0, 1], noisy[1, 0] = 1e-17, -1e-17
    assert len(null_vectors(noisy)) == 2


@pytest.mark.parametrize("group", (*TURNING[:6], lm.Heisenberg(2), lm.SO(3), lm.SL(2)), ids=repr)
def test_an_array_is_an_element_up_to_a_millionth(group: lm.LieGroup) -> None:
    """Entry by entry: an objection, a defect and another nearest element all say so."""
    g = np.array(group.exp(0.4 * np.random.default_rng(3).normal(size=group.dim)))
    for place in np.ndindex(g.shape):
        for off in (-1e-7, 1e-7, -1e-4, 1e-4):
            h = g.copy()
            h[place] += off
            free = bool(np.abs(np.array(group.nearest(h)) - h).max() < 1e-12)
            small = free or abs(off) < 1e-6
            assert group.contains(h) is small and (group.objection(h) is None) is small
            assert (group.defect(h) < 1e-12) == free
            assert free or 0.01 * abs(off) < group.defect(h) < 10.0 * abs(off)
    mirrored = g.copy()
    mirrored[..., 0] *= -1.0
    assert isinstance(group, lm.UnitQuaternions) or not group.contains(mirrored)
    assert isinstance(group, lm.UnitQuaternions) or group.objection(mirrored)


def test_words_for_rows_that_are_none() -> None:
    for group, row, words in (
        (lm.SE2(), 2, "its last row is [0.0, 1.0, 1.0], not 0 0 1"),
        (lm.SE3(), 3, "its last row is [0.0, 1.0, 0.0, 1.0], not 0 0 0 1"),
        (
            lm.SE23(),
            3,
            "its last rows begin [0.0, 1.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 0.0, 1.0], not 0 0 0 1 and 0 0 0 0 1",
        ),
    ):
        g = np.array(group.identity())
        g[row, 1] = 1.0
        assert group.objection(g) == words
    g = np.eye(5)
    g[3, 4] = -1e-5
    assert lm.SE23().objection(g) == "its fourth row is [0.0, 0.0, 0.0, 1.0, -1e-05], not 0 0 0 1 0"
    assert lm.SGal3().objection(g) is None


def test_reflections_are_told_from_turns_at_every_angle() -> None:
    """On the plane and in space, whichever axis is mirrored."""
    for angle in np.linspace(-3.0, 3.0, 13).tolist():
        for group, n, xi in (
            (lm.SE2(), 2, [angle, 0.3, -0.7]),
            (lm.SO3(), 3, [0.3, 0.4, angle]),
            (lm.SE3(), 3, [angle, 0.4, 0.2, 1.0, 2.0, 3.0]),
        ):
            g = np.array(group.exp(xi))
            assert group.objection(g) is None
            for k in range(n):
                mirrored = g.copy()
                mirrored[:n, k] *= -1.0
                assert "it is a reflection" in group.objection(mirrored)
                assert not group.contains(mirrored)
