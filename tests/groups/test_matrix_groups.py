"""Groups from generators alone: SO(3) against its closed forms, others against definitions; what is refused, and why."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scenes import hat, same_bits
from scipy.linalg import expm

import liemech as lm
from liemech.formulas.sums import antisymmetric_map, bilinear_map
from liemech.groups.matrices.classical import SL, SO, SU, Sp
from liemech.groups.matrices.heisenberg import Heisenberg
from liemech.groups.matrices.matrix_basis import clean
from liemech.groups.matrices.matrix_group import MatrixLieGroup
from liemech.groups.rigid.so3 import SO3Algebra

EPS = np.finfo(float).eps
ROTATIONS = np.array([hat(e) for e in np.eye(3)])


class Rotations(MatrixLieGroup):
    """SO(3), and nothing but its generators."""

    generators = ROTATIONS


@lm.record
class Plane(MatrixLieGroup):
    """SE(2), decorated."""

    generators = np.array(
        [[[0, -1, 0], [1, 0, 0], [0, 0, 0]], [[0, 0, 1], [0, 0, 0], [0, 0, 0]], [[0, 0, 0], [0, 0, 1], [0, 0, 0]]]
    )


@lm.record
class Scaled(MatrixLieGroup):
    """SO(3) with generators that depend on a field: the structure constants are 1/size, irrational for sqrt(2)."""

    size: int = 2

    @property
    def generators(self) -> np.ndarray:
        return Rotations.generators / math.sqrt(self.size)


class Affine(MatrixLieGroup):
    """x -> a x + b with a > 0: not unimodular, no invariant form on vectors."""

    generators = np.array([[[1.0, 0.0], [0.0, 0.0]], [[0.0, 1.0], [0.0, 0.0]]])


class Triangular(MatrixLieGroup):
    """Upper triangular matrices: known by no form, only by g E g^-1."""

    generators = np.array([[[1.0, 0.0], [0.0, 0.0]], [[0.0, 1.0], [0.0, 0.0]], [[0.0, 0.0], [0.0, 1.0]]])


def samples(group: lm.LieGroup, size: float) -> tuple[np.ndarray, ...]:
    """A velocity of a given length, another one and a momentum of length about 1."""
    xi, eta, mu = np.random.default_rng(group.dim).normal(size=(3, group.dim)) / math.sqrt(group.dim)
    return xi * (size / np.linalg.norm(xi)), eta, mu


def close(a: object, b: object, ulps: float = 64) -> bool:
    a, b = np.asarray(a), np.asarray(b)
    return bool(np.abs(a - b).max() <= ulps * EPS * max(1.0, np.abs(b).max()))


# ---------------------------------------------------------------- SO(3)


@pytest.mark.slow
@pytest.mark.parametrize("angle", [3.1, math.pi - 1e-3, math.pi - 1e-6, math.pi - 1e-9, math.pi])
def test_logarithm_near_half_a_turn(angle: float) -> None:
    """No digit is lost, though the square root of such a matrix is as ill-conditioned as can be; at
    pi either sign will do.
    """
    axis = np.array([1.0, -2.0, 3.0]) / math.sqrt(14)
    for group in (Rotations(), SO(3)):
        found = group.log(lm.SO3().exp(angle * axis))
        assert (
            min(np.abs(found - angle * axis).max(), np.abs(found + angle * axis).max() + (angle < 3.14159) * 9) < 4e-15
        )
    assert np.allclose(
        SO(4).exp(SO(4).log(np.diag([-1.0, -1.0, 1.0, 1.0]))), np.diag([-1.0, -1.0, 1.0, 1.0]), atol=1e-14
    )


# ---------------------------------------------------------------- any group


def test_structure_constants_are_clean() -> None:
    """Integers and small fractions exactly, irrational numbers untouched."""
    assert np.array_equal(Rotations().algebra.structure_constants, SO3Algebra().structure_constants)
    c = np.array(Scaled(2).algebra.structure_constants)
    assert np.allclose(c, math.sqrt(0.5) * np.array(SO3Algebra().structure_constants), rtol=4 * EPS, atol=0)
    values = np.array([1 - EPS / 2, 1 / 3 + EPS / 8, 1e-17, math.pi, math.sqrt(2) / 3, -0.5])
    assert np.array_equal(clean(values), [1.0, 1 / 3, 0.0, math.pi, math.sqrt(2) / 3, -0.5])
    mixed = np.einsum("ij,jab->iab", [[1.0, 1.0, 0.0], [0.0, 1.0, 1.0], [1.0, 0.0, 1.0]], Rotations.generators)
    c = 2.0 * np.array(MatrixLieGroup.of(mixed).algebra.structure_constants)
    assert np.array_equal(c, np.round(c))


# ---------------------------------------------------------------- membership


@pytest.mark.parametrize(
    ("group", "matrix"),
    [
        (Rotations(), 2 * np.eye(3)),
        (Rotations(), np.diag([1.0, 1.0, -1.0])),
        (Plane(), np.diag([1.0, -1.0, 1.0])),
        (Plane(), np.diag([1.0, 1.0, 2.0])),
        (Affine(), np.diag([1.0, 2.0])),
        (Triangular(), np.array([[1.0, 0.0], [0.1, 1.0]])),
        (Triangular(), np.zeros((2, 2))),
        (MatrixLieGroup.of(Heisenberg(1).generators), np.diag([2.0, 1.0, 0.5])),
        (MatrixLieGroup.of(Heisenberg(1).generators), np.eye(3) + np.eye(3, k=-1)),
        (MatrixLieGroup.of(SL(3).generators), np.diag([1.0, 1.0, 1.1])),
        (MatrixLieGroup.of(Sp(4).generators), np.diag([2.0, 1.0, 1.0, 0.5])),
        (MatrixLieGroup.of(SU(2).generators), np.diag([1j, 1j])),
    ],
)
def test_membership_found_from_generators(group: MatrixLieGroup, matrix: np.ndarray) -> None:
    """Elements pass, what breaks an invariant does not; formula and words agree."""
    assert not group.contains(matrix) and group.objection(np.asarray(matrix, dtype=group.generated.generators.dtype))
    elements = group.random(3, 5)
    assert group.contains(elements).all() and group.defect(elements).max() < 1e-11
    assert group.objection(elements[0]) is None


# ---------------------------------------------------------------- refusals


@pytest.mark.parametrize(
    ("generators", "error", "words"),
    [
        (np.zeros((3, 2)), lm.errors.InvalidInput, "shape"),
        (np.zeros((2, 2, 3)), lm.errors.InvalidInput, "square"),
        (np.zeros((0, 2, 2)), lm.errors.InvalidInput, "shape"),
        ([[[0.0, float("nan")], [0.0, 0.0]]], lm.errors.InvalidInput, "nan"),
        ([[["a", "b"], ["c", "d"]]], lm.errors.InvalidType, "dtype"),
        ([[[True, False], [False, True]]], lm.errors.InvalidType, "dtype"),
        ([[[1.0], [0.0, 0.0]]], lm.errors.InvalidInput, "ragged"),
        (np.array([np.eye(2), 2 * np.eye(2)]), lm.errors.LawViolation, "rank 1"),
        (np.array([np.zeros((2, 2))]), lm.errors.LawViolation, "rank 0"),
        (np.array([[[0.0, 1.0], [0.0, 0.0]], [[0.0, 0.0], [1.0, 0.0]]]), lm.errors.LawViolation, "generators 1 and 2"),
    ],
)
def test_bad_generators(generators: object, error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        MatrixLieGroup.of(generators)


def test_a_class_without_generators_says_so() -> None:
    class Empty(MatrixLieGroup):
        pass

    with pytest.raises(NotImplementedError, match="generators"):
        Empty().exp(np.zeros(3))
    with pytest.raises(NotImplementedError, match=r"MatrixLieGroup\.of\(generators\)"):
        MatrixLieGroup(np.ones((1, 2, 2)))  # type: ignore[call-arg]


def test_logarithm_outside_the_image_of_exp() -> None:
    for g in (np.diag([-2.0, -0.5]), np.array([[-1.0, 1.0], [0.0, -1.0]])):
        with pytest.raises(lm.errors.InvalidInput, match="logarithm"):
            SL(2).log(g)


# ---------------------------------------------------------------- both worlds


@pytest.mark.slow
@pytest.mark.compiled
def test_an_ensemble_moves_as_its_bodies_do() -> None:
    """In SIMD lanes, with steps so different that the series have different lengths."""
    group = SO(4)
    system = lm.LiePoissonSystem(group, lm.KineticEnergy(np.linspace(1.0, 2.0, 6)))
    mu = np.random.default_rng(4).normal(size=(9, 6)) * np.geomspace(1e-6, 40.0, 9)[:, None]
    many = lm.integrate(system, lm.RKMK(order=2), system.state(mu, np.eye(4)), h=0.1, steps=5, compiled=True)
    for i in (0, 5, 8):
        one = lm.integrate(system, lm.RKMK(order=2), system.state(mu[i], np.eye(4)), h=0.1, steps=5, compiled=False)
        assert same_bits(np.ascontiguousarray(many.mu[:, i]), one.mu)
        assert same_bits(np.ascontiguousarray(many.g[:, i]), one.g)


# ---------------------------------------------------------------- large matrices


def test_large_matrices_go_through_numpy() -> None:
    """SO(20): dimension 190, no structure constants."""
    group = SO(20)
    xi, eta, mu = samples(group, 1.0)
    x, y, g = group.generated.hat(xi), group.generated.hat(eta), group.exp(xi)
    assert close(g, expm(x))
    assert close(group.log(g), xi)
    assert close(group.ad(xi, eta), group.generated.vee(x @ y - y @ x))
    assert abs(group.ad_star(xi, mu) @ eta - mu @ group.ad(xi, eta)) < 1e-14
    assert abs(group.Ad_star(g, mu) @ eta - mu @ group.Ad(g, eta)) < 1e-14
    assert close(group.exp_Ad_star(xi, mu), group.Ad_star(g, mu))
    assert close(group.dexp_inv(xi, group.dexp(xi, eta)), eta)
    assert close(group.algebra.dexp_inv_dual(xi, group.algebra.dexp_dual(xi, mu)), mu)
    assert abs(group.algebra.dexp_dual(xi, mu) @ eta - mu @ group.dexp(xi, eta)) < 1e-14
    assert close(group.algebra.cayley_Ad_star(xi, mu), group.Ad_star(group.cayley(xi), mu))
    assert close(group.cayley_inv(group.cayley(xi)), xi)
    assert group.contains(g) and not group.contains(2 * g)
    assert group.exp(np.zeros((3, 190))).shape == (3, 20, 20)


@pytest.mark.sample(2)
@pytest.mark.parametrize("group", [SO(20), SU(13), Sp(18), SL(13)], ids=repr)
def test_bound_of_ad_without_structure_constants(group: MatrixLieGroup) -> None:
    """|[x, y]|^2 <= ad_size2(x) |y|^2 of matrices; structure constants are never formed."""
    rng, basis = np.random.default_rng(6), group.generated
    assert not basis.tabled
    for xi, eta in rng.normal(size=(5, 2, group.dim)):
        x, y = basis.hat(xi), basis.hat(eta)
        size2 = np.linalg.norm(x @ y - y @ x) ** 2
        assert size2 <= group.algebra.ad_size2(xi) * np.linalg.norm(y) ** 2
    assert "structure_constants" not in vars(basis)


@pytest.mark.slow
def test_brackets_of_large_matrices_by_structure_constants() -> None:
    """SO(13) from its generators, of plain formulas: as products of matrices, to rounding."""
    group = MatrixLieGroup.of(SO(13).generated.generators)
    basis = group.generated
    assert basis.large and basis.tabled
    xi, eta, mu = np.random.default_rng(7).normal(size=(3, group.dim))
    x, y = basis.hat(xi), basis.hat(eta)
    bracket = np.array(antisymmetric_map(basis.bracket_terms, lm.vec(*xi), lm.vec(*eta)))
    assert close(bracket, basis.vee(x @ y - y @ x))
    moved = np.array(bilinear_map(basis.ad_star_terms, lm.vec(*xi), lm.vec(*mu)))
    assert close(moved, basis.pairing(x.T @ basis.covector(mu) - basis.covector(mu) @ x.T))


def on_symmetric_matrices(generators: np.ndarray) -> np.ndarray:
    """The representation x s + s x^T of matrices on symmetric ones, in an orthonormal basis."""
    n = generators.shape[1]
    basis = []
    for i in range(n):
        for j in range(i, n):
            s = np.zeros((n, n))
            s[i, j] = s[j, i] = 1.0
            basis.append(s / np.linalg.norm(s))
    moved = [[x @ s + s @ x.T for s in basis] for x in generators]
    return np.einsum("aij,xbij->xab", np.array(basis), np.array(moved))


@pytest.mark.parametrize(
    "case",
    [
        "angles (x, 2x)",
        "positive",
        "symmetric matrices",
        pytest.param(
            "angles (x, 3x)",
            marks=pytest.mark.xfail(strict=True, reason="a law of degree 4; docs/proof/known_deficiencies.md"),
        ),
    ],
)
def test_what_turns_the_algebra_and_is_no_element_is_refused(case: str) -> None:
    """By the cubic form Re z_1^2 conj(z_2), by the sign of what is stretched, by the determinant."""
    if case.startswith("angles"):
        turn = np.array([[0.0, -1.0], [1.0, 0.0]])
        zero, times = np.zeros((2, 2)), float(case[-3])
        group = lm.MatrixLieGroup.of(np.array([np.block([[turn, zero], [zero, times * turn]])]))
        one = np.cos(0.3) * np.eye(2) + np.sin(0.3) * turn
        foreign = np.block([[one, zero], [zero, one]])
    elif case == "positive":
        group = lm.MatrixLieGroup.of(np.array([np.diag([1.0, 0.0]), np.diag([0.0, 1.0])]))
        foreign = np.diag([-2.0, 3.0])
    else:
        units = np.eye(9).reshape(9, 3, 3)
        skew = [1j * (e + e.T) for e in units] + [(e - e.T).astype(complex) for e in units]
        rows = np.array([x - np.trace(x) / 3.0 * np.eye(3) for x in skew]).reshape(18, 9)
        _, _, v = np.linalg.svd(np.concatenate([rows.real, rows.imag], axis=1))
        su3 = (v[:8, :9] + 1j * v[:8, 9:]).reshape(8, 3, 3)
        group = lm.MatrixLieGroup.of(on_symmetric_matrices(su3))
        foreign = -np.eye(6, dtype=complex)
    assert group.contains(group.identity())
    assert not group.contains(foreign)


# ------------------------------------------------------------------ generators in unlike units


def turns(unit):
    """so(3) with generators in units of 1/unit, 1 and unit."""
    e = np.zeros((3, 3, 3))
    for i, j, k in (0, 1, 2), (1, 2, 0), (2, 0, 1):
        e[i, k, j], e[i, j, k] = 1.0, -1.0
    return e * np.array([1.0 / unit, 1.0, unit])[:, None, None]


def boosts(c):
    """so(3, 1), boosts by metres per second: the block of turns, then (v, v/c^2) in row and column."""
    e = np.zeros((6, 4, 4))
    e[:3, :3, :3] = turns(1.0)
    for i in range(3):
        e[3 + i, i, 3], e[3 + i, 3, i] = 1.0, 1.0 / c**2
    return e


@pytest.mark.parametrize("unit", [1.0, 1e3, 1e6, 1e-6])
def test_generators_of_unlike_sizes_have_all_their_brackets(unit):
    group = lm.MatrixLieGroup.of(turns(unit))
    units = np.array([1.0 / unit, 1.0, unit])
    xi, eta, mu = np.random.default_rng(1).normal(size=(3, 3))
    expected = np.cross(xi, eta) / units
    assert np.allclose(group.ad(xi / units, eta / units), expected, rtol=1e-13, atol=0.0)
    assert np.allclose(group.ad_star(xi / units, mu * units), np.cross(mu, xi) * units, rtol=1e-13)
    moved = np.array(group.exp_Ad_star(xi / units, mu * units))
    assert np.allclose(moved, lm.SO3().exp_Ad_star(xi, mu) * units, rtol=1e-12, atol=0.0)
    inverse = np.array(group.dexp_inv(xi / units, eta / units))
    assert np.allclose(inverse, lm.SO3().dexp_inv(xi, eta) / units, rtol=1e-12, atol=0.0)
    (before,), (after,) = group.casimirs(mu * units), group.casimirs(moved)
    assert abs(after - before) < 1e-12 * abs(before) and group.contains(expm_of(turns(unit), xi / units))


@pytest.mark.parametrize("c", [1.0, 1e5, 299792458.0])
def test_boosts_in_metres_per_second_make_turns(c):
    group = lm.MatrixLieGroup.of(boosts(c))
    units = np.array([1.0, 1.0, 1.0, c, c, c])
    rng = np.random.default_rng(2)
    xi, eta, mu = rng.normal(size=(3, 6))
    natural = lm.MatrixLieGroup.of(boosts(1.0))
    assert np.allclose(group.ad(xi * units, eta * units), natural.ad(xi, eta) * units, rtol=1e-13)
    moved = np.array(group.exp_Ad_star(xi * units, mu / units))
    assert np.allclose(moved * units, natural.exp_Ad_star(xi, mu), rtol=1e-11, atol=1e-12)
    assert np.allclose(group.casimirs(moved), group.casimirs(mu / units), rtol=1e-11, atol=0.0)
    assert len(group.casimirs(moved)) == 2
    boost = expm_of(boosts(c), 0.3 * xi * units)
    assert group.contains(boost)
    assert np.allclose(group.inverse(boost) @ boost, np.eye(4), atol=1e-14 * c)
    galilean = np.eye(4)
    galilean[0, 3] = 0.6 * c
    assert not group.contains(galilean)


def expm_of(generators, xi):
    return expm(np.einsum("i,iab->ab", xi, generators))


# ------------------------------------------------------------------ what counts as large


def rigid_motions() -> MatrixLieGroup:
    """SE(3) from its generators alone."""
    return lm.MatrixLieGroup.of([np.array(lm.SE3().algebra.hat(e)) for e in np.eye(6)])


def test_displacements_count_beside_where_an_element_leads() -> None:
    group, known = rigid_motions(), lm.SE3()
    for xi in np.random.default_rng(2).normal(size=(5, 6)):
        g = lm.mat(*np.array(known.exp(xi)))
        assert close(np.array(group.scale(g)), np.array(known.scale(g)))
    q, p, z = lm.Heisenberg(1).scale(lm.mat([1.0, 2.0, -3.0], [0.0, 1.0, 5.0], [0.0, 0.0, 1.0]))
    assert (q, p, z) == (2.0, 5.0, 3.0)
    for other in (SO(4), SU(3), Sp(4), SL(3)):
        assert np.array_equal(np.array(other.scale(other.identity())), np.ones(other.dim))
    # events (t, x) of a plane: turns and boosts mix t with x, shifts do not
    c = 2.0**20
    plane = np.zeros((3, 3, 3))
    plane[0, 0, 1], plane[0, 1, 0] = 1.0 / c**2, 1.0
    plane[1, 0, 2] = plane[2, 1, 2] = 1.0
    events = lm.MatrixLieGroup.of(plane)
    scale = np.array(events.scale(lm.mat([1.0, 0.0, 3.0], [0.0, 1.0, 4.0 * c], [0.0, 0.0, 1.0])))
    assert close(scale, [1.0, 5.0, 5.0 * c])


@lm.record
class Flight(lm.GroupEquation):
    """A body that is steered by where it is, in units of length."""

    group: lm.LieGroup
    unit: float

    def velocity(self, t: float, g: lm.Mat) -> lm.Vec:
        turn = 1.0 + 0.3 * g[0, 1], 0.2, lm.formulas.sin(t)
        return lm.vec(*turn, self.unit * lm.formulas.cos(t), 0.2 * g[0, 3], 0.1 * self.unit)


@pytest.mark.slow
@pytest.mark.parametrize("unit", [2.0**-30, 2.0**30])
def test_adaptive_steps_on_a_group_from_generators_are_those_of_any_unit(unit: float) -> None:
    """Before, displacements were compared with 1: 3167 steps instead of 52 with numbers of 1e9."""

    def run(group: Any, length: float) -> Any:
        system, g = Flight(group, length), np.eye(4)
        g[:3, 3] = np.array([1.0, 2.0, -1.0]) * length
        return lm.integrate(system, lm.RKMK(order=5), system.state(g), t_end=5.0, rtol=1e-8, atol=0.0, compiled=False)  # fmt: skip

    here, there, known = run(rigid_motions(), 1.0), run(rigid_motions(), unit), run(lm.SE3(), 1.0)
    assert here.steps == there.steps == known.steps
    assert np.allclose(there.t, here.t, rtol=1e-9) and np.allclose(known.t, here.t, rtol=1e-9)
    assert np.allclose(there.g[-1, :3, 3] / unit, here.g[-1, :3, 3], rtol=1e-11)
