"""Forms on Lie algebras: Killing's, and those that ad leaves alone, where there are any."""

from __future__ import annotations

import numpy as np
import pytest

import liemech as lm

SEMISIMPLE = [
    lm.SO3(),
    lm.UnitQuaternions(),
    lm.SO(3),
    lm.SO(4),
    lm.SO(5),
    lm.SL(2),
    lm.SL(3),
    lm.SU(2),
    lm.SU(3),
    lm.Sp(2),
]
SEMISIMPLE += [lm.Sp(4)]
OTHERS = {  # the rank of the Killing form, and whether some nondegenerate form is invariant
    lm.SE3(): (3, True),
    lm.SE2(): (1, False),
    lm.Heisenberg(1): (0, False),
    lm.VectorSpace(3): (0, True),
    lm.GL(2): (3, True),
    lm.U(2): (3, True),
    lm.ProductGroup(lm.SO3(), lm.VectorSpace(2)): (3, True),
    lm.ProductGroup(lm.SO3(), lm.Heisenberg(1)): (3, False),
}


def invariance(algebra: lm.LieAlgebra, form: np.ndarray) -> float:
    """The largest of ([x, y], z) - (x, [y, z]) over the basis, against the size of the form."""
    e = np.eye(algebra.dim)
    defects = [
        abs(algebra.bracket(x, y) @ form @ z - x @ form @ algebra.bracket(y, z)) for x in e for y in e for z in e
    ]
    return max(defects) / np.abs(form).max()


@pytest.mark.sample(4)
@pytest.mark.parametrize("group", SEMISIMPLE, ids=repr)
def test_killing_form_of_semisimple_algebras(group: lm.LieGroup) -> None:
    """K_ij = tr(ad_i ad_j) is symmetric, invariant and nondegenerate, and is minus the invariant form, up to its size."""
    algebra, e = group.algebra, np.eye(group.dim)
    ad = [np.stack([algebra.bracket(x, y) for y in e], axis=1) for x in e]
    K = algebra.killing_form
    assert np.allclose(K, [[np.trace(a @ b) for b in ad] for a in ad], rtol=0, atol=1e-13 * np.abs(K).max())
    assert np.linalg.matrix_rank(K) == group.dim
    assert invariance(algebra, K) < 1e-13
    assert np.allclose(algebra.invariant_form, -K / np.abs(K).max())


def test_known_killing_forms() -> None:
    assert np.array_equal(lm.SO3().algebra.killing_form, -2 * np.eye(3))
    assert np.array_equal(lm.SO3().algebra.invariant_form, np.eye(3))
    n, K = 5, lm.SO(5).algebra
    for i in range(3):  # (n - 2) tr(XY) on so(n), Humphreys, section 6
        x, y = np.eye(10)[i], np.eye(10)[i + 1]
        for a, b in ((x, x), (x, y)):
            assert a @ K.killing_form @ b == pytest.approx(
                (n - 2) * np.trace(np.array(K.hat(a)) @ np.array(K.hat(b))), abs=1e-12
            )
    compact = np.linalg.eigvalsh(lm.SU(3).algebra.killing_form)
    assert compact.max() < 0  # negative definite: the group is compact
    split = np.linalg.eigvalsh(lm.SL(2).algebra.killing_form)
    assert (split > 0).sum() == 2  # two boosts and one rotation
    assert (split < 0).sum() == 1


@pytest.mark.parametrize("group", OTHERS, ids=repr)
def test_forms_of_other_algebras(group: lm.LieGroup) -> None:
    rank, exists = OTHERS[group]
    algebra = group.algebra
    assert np.linalg.matrix_rank(algebra.killing_form, tol=1e-10) == rank
    form = algebra.invariant_form
    assert (form is not None) is exists
    if form is not None:
        assert np.allclose(form, form.T)
        assert np.linalg.cond(form) < 1e6
        assert invariance(algebra, form) < 1e-12


def test_klein_form_is_among_those_of_screws() -> None:
    """On se(3) every invariant form is a w.a + b (w.u + v.a): the Klein form belongs to them, and
    the first part is degenerate.
    """
    form = lm.SE3().algebra.invariant_form
    a, b = form[0, 0], form[0, 3]
    expected = np.block([[a * np.eye(3), b * np.eye(3)], [b * np.eye(3), np.zeros((3, 3))]])
    assert np.allclose(form, expected, rtol=0, atol=1e-12)
    assert abs(b) > 1e-3


@pytest.mark.parametrize("group", [lm.SO3(), lm.SE3(), lm.SL(2), lm.SU(2), lm.Heisenberg(1)], ids=repr)
def test_basis(group: lm.LieGroup) -> None:
    """The basis are the matrices of the unit velocities, and their commutators have the structure
    constants as coordinates.
    """
    algebra, E = group.algebra, group.algebra.basis
    c = np.array(algebra.structure_constants)
    assert E.shape == (group.dim, *group.element_shape)
    for i in range(group.dim):
        for j in range(group.dim):
            assert np.allclose(E[i] @ E[j] - E[j] @ E[i], np.einsum("k,kab->ab", c[:, i, j], E), rtol=0, atol=1e-14)


@lm.record
class InUnits(lm.LieAlgebra):
    """The generators u_i E_i of another algebra."""

    algebra: lm.LieAlgebra
    units: tuple[float, ...]

    @property
    def dim(self) -> int:
        return self.algebra.dim

    def bracket(self, xi: lm.Vec, eta: lm.Vec) -> lm.Vec:
        u = lm.vec(*self.units)
        return self.algebra.bracket(u * xi, u * eta) / u


@pytest.mark.parametrize("group", [lm.SO3(), lm.SE3(), lm.SL(2), lm.SE2()], ids=repr)
@pytest.mark.parametrize("reach", [4, 8])
def test_forms_of_generators_of_unlike_scales(group: lm.LieGroup, reach: int) -> None:
    """(u_i E_i, u_j E_j) = u_i u_j (E_i, E_j): whether there is a form is no matter of units."""
    u = 10.0 ** np.linspace(-reach, reach, group.dim)
    form = InUnits(group.algebra, tuple(u.tolist())).invariant_form
    wanted = group.algebra.invariant_form
    if wanted is None:
        assert form is None
        return
    back = form / np.outer(u, u)
    assert np.allclose(back / np.abs(back).max(), wanted, rtol=0, atol=1e-13)
