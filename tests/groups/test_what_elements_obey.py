"""What tells elements of groups of matrices from other matrices: the laws that are found, two ways
to measure how far they are broken, words for it; and the constants of formulas.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import liemech as lm
from liemech.groups.matrices.heisenberg import Heisenberg
from liemech.groups.matrices.matrix_basis import linear_terms, products
from liemech.groups.matrices.matrix_group import MatrixLieGroup
from liemech.groups.matrices.matrix_invariants import null_space, objections
from liemech.groups.matrices.nearest import nearest_unitary

PLANE = lm.SE2().algebra.basis
TRIANGULAR = [[[1.0, 0.0], [0.0, 0.0]], [[0.0, 1.0], [0.0, 0.0]], [[0.0, 0.0], [0.0, 1.0]]]
COMPLEX_PLANE = [[[1j, 0], [0, 0]], [[0, 1], [0, 0]], [[0, 1j], [0, 0]]]
SHIPPED = lm.SO(3), lm.SO(4), lm.SL(2), lm.SL(3), lm.GL(2), lm.Sp(4), lm.SU(2), lm.SU(3), lm.U(2)
NOT_ENOUGH = MatrixLieGroup.of(TRIANGULAR), MatrixLieGroup.of([np.diag([1.0, 2.0, 0.0])])
ENOUGH = (
    *(MatrixLieGroup.of(G.generators) for G in (*SHIPPED, Heisenberg(2))),
    MatrixLieGroup.of(PLANE),
    MatrixLieGroup.of(COMPLEX_PLANE),
    MatrixLieGroup.of([[[0.0, -1.0], [1.0, 0.0]]]),
)


def kept(maps: list[np.ndarray]) -> int:
    """The dimension of what linear maps leave alone."""
    one = np.eye(len(maps[0]))
    rank = np.linalg.matrix_rank(np.concatenate([m - one for m in maps]), tol=1e-8)
    return len(one) - int(rank)


@pytest.mark.parametrize("group", (*ENOUGH, *NOT_ENOUGH), ids=repr)
def test_all_laws_are_found(group: lm.MatrixLieGroup) -> None:
    """As many as five elements leave alone; and whether they make the group."""
    laws, rng = group.invariants, np.random.default_rng(4)
    g = [np.array(group.exp(xi)) for xi in 0.7 * rng.normal(size=(5, group.dim))]
    assert len(laws.vectors) == kept(g)
    assert len(laws.covectors) == kept([m.T for m in g])
    assert len(laws.forms) == kept([np.kron(m.T, m.T) for m in g])
    known = np.array([*laws.commuting, np.eye(len(g[0]))]).reshape(-1, len(g[0]) ** 2)
    assert np.linalg.matrix_rank(known) == kept([np.kron(m, np.linalg.inv(m).T) for m in g])
    if not any(np.linalg.cond(b) < 1e6 for b in laws.forms):
        assert len(laws.coforms) == kept([np.kron(m, m) for m in g])
    if np.iscomplexobj(g[0]):
        assert len(laws.hermitian) == kept([np.kron(np.conj(m).T, m.T) for m in g])
        if not any(np.linalg.cond(b) < 1e6 for b in laws.hermitian):
            assert len(laws.cohermitian) == kept([np.kron(m, np.conj(m)) for m in g])
    for law in (*laws.forms, *laws.hermitian, *laws.coforms, *laws.vectors, *laws.covectors):
        assert np.abs(law).max() == pytest.approx(1.0, rel=1e-15)
    det = np.linalg.det(g[0])
    assert laws.determinant == (
        "1" if abs(det - 1.0) < 1e-9
        else "unit" if abs(abs(det) - 1.0) < 1e-9
        else "any" if np.iscomplexobj(g[0]) else "positive"
    )  # fmt: skip
    for v in laws.rays:
        assert all(np.allclose(m @ v, (v @ m @ v) * v) and v @ m @ v > 0.0 for m in g)
    for t in laws.cubic:
        assert all(np.allclose(np.einsum("abc,ai,bj,ck", t, m, m, m), t, atol=1e-9) for m in g)
    assert laws.enough == (group in ENOUGH)


@pytest.mark.parametrize("group", (*SHIPPED, *ENOUGH, *NOT_ENOUGH), ids=repr)
def test_formulas_and_arrays_measure_the_same(group: lm.MatrixLieGroup) -> None:
    """Elements obey all laws; of what is off, near or far, the worst law is the defect."""
    rng = np.random.default_rng(3)

    def worst(g: np.ndarray) -> float:
        return max([0.0, *(off for off, _ in objections(group.invariants, group.generated, g))])

    for size in (0.3, 2.0):
        g = np.array(group.exp(size * rng.normal(size=group.dim)))
        assert group.defect(g) < 1e-12 and worst(g) < 1e-12 and group.objection(g) is None
        for noise, scale in itertools.product((1e-4, 0.3), (1.0, 20.0)):
            off = scale * g + noise * rng.normal(size=g.shape)
            assert group.defect(off) == pytest.approx(worst(off), rel=1e-9, abs=1e-15)
            assert (group.objection(off) is None) == (worst(off) <= 1e-6)
    if group.invariants.determinant in ("any", "positive") and group.invariants.enough:
        assert group.defect(0.0 * g) == worst(0.0 * g) == 1.0


@pytest.mark.parametrize("group", SHIPPED, ids=repr)
def test_constants_of_formulas(group: lm.MatrixLieGroup) -> None:
    """x y x and its dual from terms; brackets begin with no minus; the bound of ad is its norm, or
    the half of its square where singular values come in pairs.
    """
    basis = group.generated
    x, y = np.random.default_rng(5).normal(size=(2, group.dim))
    if basis.without_cayley is None:
        wanted = basis.vee(basis.hat(x) @ basis.hat(y) @ basis.hat(x))
        found = [sum(c * x[i] * x[j] * y[k] for c, i, j, k in t) for t in basis.triple_terms]
        assert np.allclose(found, wanted, atol=1e-12)
        dual = [sum(c * x[i] * x[j] * y[k] for c, i, j, k in t) for t in basis.triple_dual_terms]
        assert dual @ y == pytest.approx(y @ wanted, abs=1e-12)
    assert all(c > 0.0 for terms in basis.bracket_terms for c, _, _ in terms)
    ad = np.array(group.algebra.ad_matrix(x))
    half = 0.5 if np.array_equal(ad, -ad.T) else 1.0
    assert group.algebra.ad_size2(x) == pytest.approx(half * np.sum(ad * ad), rel=1e-13)


def test_terms_with_positive_coefficients_come_first() -> None:
    assert linear_terms(np.array([-1.0, 0.0, 2.0, -3.0])) == ((2.0, 2), (-1.0, 0), (-3.0, 3))
    assert products(np.array([[0.0, -1.0], [2.0, 0.0]])) == ((2.0, 1, 0), (-1.0, 0, 1))


def test_why_there_is_no_cayley_map() -> None:
    """Two generators whose product x y x leaves the algebra, or three whose products together do."""
    reason = lm.SL(3).why_no_cayley()
    assert reason and reason.endswith("x = E_7, y = E_8 the product sticks out by 2.0e-01 of its size")
    one, up = (np.eye(2), np.array([[0.0, 1.0], [0.0, 0.0]]))  # they commute, and their squares vanish
    factors = (up, one, one), (one, up, one), (one, one, up)
    reason = MatrixLieGroup.of([np.kron(a, np.kron(b, c)) for a, b, c in factors]).why_no_cayley()
    assert reason and "x = E_1 + E_3, y = E_2 the product sticks out by 2.5e-01" in reason


def test_the_nearest_orthogonal_matrix_is_refused_where_there_are_several() -> None:
    many, one = ((1.0, 0.5, -0.5), (1.0, 0.0, 0.0)), ((1.0, 0.5, -0.25), (1.0, 1.0, 0.0))
    assert all(nearest_unitary(np.diag(d), oriented=True) is None for d in many)
    assert all(nearest_unitary(np.diag(d), oriented=True) is not None for d in one)
    assert nearest_unitary(np.diag([1.0, 1.0, 0.0]), oriented=False) is None
    assert nearest_unitary(np.diag([1.0, 1.0, 1e-9]), oriented=False) is not None
    assert np.array_equal(nearest_unitary(np.array([[3.0]]), oriented=True), [[1.0]])


@pytest.mark.parametrize("complex_", [False, True])
@pytest.mark.parametrize("size", [1.0, 1e-13, 1e13])
def test_solutions_of_linear_equations_look_simple(complex_: bool, size: float) -> None:
    """In reduced form, the largest entry of each 1, in whatever unit the equations are."""
    rng = np.random.default_rng(7)
    for m, k in ((3, 7), (2, 3), (6, 4), (1, 5)):
        equations = rng.normal(size=(m, k)) + (1j * rng.normal(size=(m, k)) if complex_ else 0.0)
        rows = null_space(size * equations)
        assert len(rows) == max(k - m, 0) and np.allclose(equations @ rows.T, 0.0, atol=1e-13)
        for row in rows:
            first = int(np.flatnonzero(row)[0])
            assert np.abs(row).max() == pytest.approx(1.0, rel=1e-15)
            assert np.count_nonzero(rows[:, first]) == 1
    assert np.array_equal(null_space(np.array([[0.0, 0.0, 3.0]])), [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


@pytest.mark.parametrize(
    ("group", "g", "words"),
    [
        (lm.SO(2), [[1.0, 0.0], [0.0, -1.0]], "its determinant is -1, it is a reflection"),
        (lm.SO(2), [[2.0, 0.0], [0.0, 2.0]], "g^T g differs from the unit matrix by 3.0e+00"),
        (lm.SU(2), [[1j, 0.0], [0.0, 1j]], "its determinant is -1, not 1"),
        (lm.SL(2), [[-1.0, 0.0], [0.0, 1.0]], "its determinant is -1, not 1"),
        (lm.SL(2), [[2.0, 0.0], [0.0, 1.25]], "its determinant is 2.5, not 1"),
        (lm.SU(2), [[1.0, 0.0], [0.0, 1j]], "its determinant is 0+1j, not 1"),
        (lm.U(2), [[2.0, 0.0], [0.0, 1.0]], "g^H g differs from the unit matrix by 3.0e+00"),
        (lm.GL(2), [[1.0, 1.0], [1.0, 1.0]], "it is singular"),
        (MatrixLieGroup.of(lm.Sp(2).generators), [[2.0, 0.0], [0.0, 1.0]],
         "g^T B g differs from B by 1.0e+00, with the antisymmetric form B = [[ 0.,  1.], [-1.,  0.]] of the group"),
        (MatrixLieGroup.of([[[0.0, 1.0], [1.0, 0.0]]]), [[2.0, 0.0], [0.0, 1.0]], "with the symmetric form B = "),
        (MatrixLieGroup.of(PLANE), [[1, 0, 0], [0, 1, 0], [0, 0, 2]], "g^T B g differs from B by 3.0e+00"),
        (MatrixLieGroup.of(COMPLEX_PLANE), [[2, 0], [0, 1]], "g C g^H differs from C = "),
        (MatrixLieGroup.of(TRIANGULAR), [[1, 0], [1, 1]], "g E_1 g^-1 sticks out of the algebra by"),
        (MatrixLieGroup.of([np.diag([1.0, 2.0, 0.0])]), [[1, 0, 0], [0, 1, 0], [0, 1, 1]],
         "it does not commute with"),
    ],
)  # fmt: skip
def test_words(group: lm.MatrixLieGroup, g: list[list[float]], words: str) -> None:
    laws = objections(group.invariants, group.generated, np.array(g))
    assert any(words in text for off, text in laws if off > 1e-6)


def test_the_nearest_element_is_refused_beyond_a_quarter_of_the_size() -> None:
    for group in (MatrixLieGroup.of(lm.SL(2).generators), lm.Sp(2)):
        g = np.diag([1.0, 1.5])
        h = np.array(group.nearest(g))
        assert np.linalg.det(h) == pytest.approx(1.0)
        assert 0.1 * np.linalg.norm(g) < np.linalg.norm(h - g) < 0.25 * np.linalg.norm(g)
        with pytest.raises(lm.errors.InvalidInput, match="too far from the group"):
            group.nearest([[2.0, 0.3], [0.1, 1.5]])  # 0.36 of its size away
