"""The maps of large matrices, through NumPy, beside the formulas of the same groups in small."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.groups.matrices import matrix_basis
from liemech.groups.matrices.heisenberg import Heisenberg
from liemech.groups.matrices.matrix_group import MatrixLieGroup

SMALL_ONES = {
    "SO(3)": lm.SO(3),
    "SU(2)": lm.SU(2),
    "SL(2)": lm.SL(2),
    "H_3": Heisenberg(1),  # nilpotent: no eigenvectors
    "triangular": MatrixLieGroup.of([[[1.0, 0.0], [0.0, 0.0]], [[0.0, 1.0], [0.0, 0.0]], [[0.0, 0.0], [0.0, 1.0]]]),
}


@pytest.mark.parametrize("name", SMALL_ONES)
def test_large_matrices_are_moved_as_small_ones(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    small = SMALL_ONES[name]
    generators = np.array(small.generated.generators)
    monkeypatch.setattr(matrix_basis, "SMALL", 1)
    monkeypatch.setattr(matrix_basis, "_known", {})
    large = MatrixLieGroup.of(generators)
    assert large.is_large and not small.is_large
    xi, eta, mu = 0.7 * np.random.default_rng(2).normal(size=(3, 2, small.dim))
    g, h = np.array(small.exp(eta)), np.array(small.exp(-0.4 * xi))

    def same(owner: str, method: str, *args: Any) -> None:
        ours, theirs = (getattr(G if owner == "group" else G.algebra, method)(*args) for G in (large, small))
        assert np.allclose(ours, theirs, rtol=1e-13, atol=1e-13), method

    for method in ("exp", "cayley"):
        same("group", method, xi)
        same("group", f"compose_{method}", g, xi)
    for method in ("inverse", "log", "cayley_inv", "contains"):
        same("group", method, g)
    for method in ("compose", "distance"):
        same("group", method, g, h)
    same("group", "Ad", g, xi)
    for method in ("Ad_star", "K"):
        same("group", method, g, mu)
    for method in ("hat", "covector"):
        same("algebra", method, xi)
    same("algebra", "vee", np.array(small.algebra.hat(xi)))
    same("algebra", "pairing", g)
    for method in ("bracket", "ad_star", "exp_Ad_star", "cayley_Ad_star"):
        same("algebra", method, xi, mu)
    for method in ("dexp", "dexp_inv", "dcayley", "dcayley_inv"):
        for x in (xi, -xi):
            same("algebra", method, x, eta)
            same("algebra", f"{method}_dual", x, mu)
    away = g.copy()
    away[..., -1, 0] += 0.01
    assert np.abs(large.defect(g)).max() < 1e-13 and (large.defect(away) > 1e-4).all()
    assert not large.contains(away).any()


def test_brackets_and_bounds_without_structure_constants(monkeypatch: pytest.MonkeyPatch) -> None:
    """Products of matrices; |[x, y]|^2 <= 2 |x|^2 |y|^2 of matrices."""
    for name, value in (("SMALL", 1), ("TABLED", 0), ("_known", {})):
        monkeypatch.setattr(matrix_basis, name, value)
    for small, scale in ((lm.SL(2), [1.0, 2.0, 3.0]), (lm.SU(2), [1.0, 0.5, 3.0])):
        generators = np.array(scale)[:, None, None] * np.array(small.generated.generators)
        algebra = MatrixLieGroup.of(generators).algebra
        assert algebra.generated.large and not algebra.generated.tabled
        xi, eta = map(lm.Vec.of, np.random.default_rng(3).normal(size=(2, 3)).tolist())
        x, y = (np.einsum("i,iab->ab", v, generators) for v in (xi, eta))
        assert np.allclose(algebra.generated.hat(np.array(algebra.bracket(xi, eta))), x @ y - y @ x)
        assert lm.dot(algebra.ad_star(xi, eta), xi) == pytest.approx(0.0, abs=1e-14)
        ad = np.array([algebra.bracket(xi, lm.Vec.of(e)) for e in np.eye(3).tolist()]).T
        assert np.allclose(algebra.ad_star(xi, eta), ad.T @ np.array(eta))
        bound = 2.0 * np.linalg.norm(x) ** 2
        assert algebra.ad_size2(xi) == pytest.approx(bound, rel=1e-12)
    for wrong, words in (
        (lm.SL(2).generators[:2], "closed under the bracket: the bracket of two generic elements"),
        ([[[0.0, 1.0], [0.0, 0.0]], np.zeros((2, 2))], "linearly dependent: 2 matrices of rank 1"),
    ):
        with pytest.raises(lm.errors.LawViolation, match=words):
            MatrixLieGroup.of(wrong)


def test_what_is_off_or_has_no_logarithm_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(matrix_basis, "SMALL", 1)
    monkeypatch.setattr(matrix_basis, "_known", {})
    slow_plane = MatrixLieGroup.of([[[1.0, 0.0], [0.0, 0.0]]])
    with pytest.raises(lm.errors.InvalidInput, match="does not stretch"):
        slow_plane.log(np.diag([-1.0, 1.0]))
    turns = MatrixLieGroup.of([[[0.0, -1.0], [1.0, 0.0]]])
    with pytest.raises(lm.errors.InvalidInput, match="no principal logarithm"):
        turns.log(-np.eye(2))
    jordan = MatrixLieGroup.of([[[1.0, 1.0], [0.0, 1.0]], [[0.0, 1.0], [0.0, 0.0]]])
    with pytest.raises(lm.errors.LawViolation, match=r"linearly dependent: 2 matrices of rank 1"):
        MatrixLieGroup.of([[[1.0, 1.0], [0.0, 1.0]], [[0.0, 0.0], [0.0, 0.0]]])
    assert np.allclose(jordan.dexp_inv([40.0, 3.0], [1.0, 2.0], side="right"), [1.0, 2.0])


@pytest.mark.slow
def test_large_groups_obey_their_laws() -> None:
    """All laws that small groups obey, SO(10) from matrices in memory."""
    report = lm.check_group(lm.SO(10))
    assert not [f for f in report.findings if f.verdict == "broken"]


@pytest.mark.slow
def test_a_group_of_many_generators_is_found_in_seconds() -> None:
    """so(13) by its 78 generators alone: its forms, and what is no element."""
    group = lm.MatrixLieGroup.of(lm.SO(13).generators)
    assert len(group.invariants.forms) == 1 and group.invariants.enough
    assert np.allclose(group.invariants.forms[0], np.eye(13))
    g = lm.SO(13).random(1)
    assert group.contains(g) and not group.contains(1.001 * g)


@pytest.mark.parametrize("name", ["SU(12)**2", "SU(12)*SU(3)", "SU(12) and its momenta"])
def test_elements_in_memory_are_not_written_out(name: str) -> None:
    large = lm.SU(12)
    with pytest.raises(lm.errors.IncompatibleSystem, match="matrices with 12 rows lie in memory"):
        group = (
            lm.SemidirectProduct(large, lm.actions.CoadjointAction(large)) if "momenta" in name else large * lm.SU(3)
        )
        (large**2 if "**" in name else group).identity()
