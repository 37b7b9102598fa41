"""SO(n), SL(n), GL(n), SU(n), U(n), Sp(2n) and the Heisenberg groups: bases, membership, Casimir
functions, random elements.
"""

from __future__ import annotations

import numpy as np
import pytest
from bare import map_of
from scipy.linalg import polar

import liemech as lm
from liemech.groups.matrices.classical import GL, SL, SO, SU, Sp, U
from liemech.groups.matrices.heisenberg import Heisenberg
from liemech.groups.matrices.matrix_group import MatrixLieGroup

CLASSICAL = (SO(2), SO(3), SO(4), SO(5), SL(2), SL(3), GL(1), GL(2), SU(2), SU(3), U(1), U(2), Sp(2), Sp(4))
GROUPS = (*CLASSICAL, Heisenberg(1), Heisenberg(2))
WITH_CAYLEY = (SO(2), SO(3), SO(4), SL(2), SU(2), U(1), U(2), Sp(2), Sp(4), GL(2), Heisenberg(2))
DIMENSIONS = {
    SO(2): 1, SO(3): 3, SO(4): 6, SO(6): 15, SL(2): 3, SL(3): 8, GL(2): 4, SU(2): 3, SU(3): 8, U(2): 4, Sp(2): 3, Sp(4): 10,
    Heisenberg(1): 3, Heisenberg(3): 7,
}  # fmt: skip

names = pytest.mark.parametrize("group", GROUPS, ids=repr)


def samples(group: lm.LieGroup, size: float = 0.5) -> np.ndarray:
    """Three velocities or momenta of a group."""
    return size * np.random.default_rng(group.dim).normal(size=(3, group.dim))


def test_dimensions() -> None:
    for group, dim in DIMENSIONS.items():
        assert group.dim == dim


@pytest.mark.sample(8)
@names
def test_elements_obey_the_defining_laws(group: MatrixLieGroup) -> None:
    n = group.generated.n
    for g in [*group.random(1, 4), np.array(group.exp(samples(group)[0]))]:
        assert group.contains(g) and group.defect(g) < 1e-13 and group.objection(g) is None
        if isinstance(group, SO):
            assert np.allclose(g.T @ g, np.eye(n)) and np.isclose(np.linalg.det(g), 1.0)
        if isinstance(group, (SU, U)):
            assert np.allclose(g.conj().T @ g, np.eye(n))
        if isinstance(group, (SU, SL)):
            assert np.isclose(np.linalg.det(g), 1.0)
        if isinstance(group, Sp):
            assert np.allclose(g.T @ group.form @ g, group.form)
        assert np.allclose(np.array(group.inverse(g)) @ g, np.eye(n), atol=1e-12)
        assert np.allclose(
            group.Ad_star(g, group.Ad_star(group.inverse(g), samples(group)[2])), samples(group)[2], atol=1e-10
        )


@pytest.mark.parametrize(
    ("group", "matrix", "words"),
    [
        (SO(3), np.diag([1.0, 1.0, -1.0]), "reflection"),
        (SO(3), 2 * np.eye(3), "unit matrix"),
        (SO(4), np.eye(4) + 0.1 * np.eye(4, k=1), "unit matrix"),
        (SL(2), np.diag([2.0, 1.0]), "determinant is 2"),
        (SU(2), np.diag([1.0, 1j]), "determinant"),
        (U(2), np.diag([1.0, 2.0]), "unit matrix"),
        (Sp(4), np.diag([2.0, 1.0, 1.0, 1.0]), "antisymmetric form"),
        (GL(2), np.zeros((2, 2)), "singular"),
        (Heisenberg(1), np.diag([2.0, 1.0, 0.5]), "g differs|leaves alone"),
        (Heisenberg(1), np.diag([1.0, 2.0, 1.0]), "B g differs|determinant"),
    ],
)
def test_other_matrices_are_refused(group: MatrixLieGroup, matrix: np.ndarray, words: str) -> None:
    assert not group.contains(matrix)
    with pytest.raises(lm.errors.InvalidInput, match=words):
        group.Ad(matrix, np.zeros(group.dim))


def test_who_has_a_cayley_map() -> None:
    for group in WITH_CAYLEY:
        assert group.why_no_cayley() is None
    for group in (SL(3), SU(3)):
        assert "x y x" in str(group.why_no_cayley())
        with pytest.raises(lm.errors.IncompatibleSystem, match="x y x"):
            lm.Cayley().require(group)


@names
def test_casimir_functions(group: MatrixLieGroup) -> None:
    """B grad C = 0 by differences, as many independent ones as the orbits leave; and RKMK keeps them."""
    mu = samples(group, 1.0)[2]
    e = 1e-5
    plus, minus = (group.casimirs(mu + s * e * np.eye(group.dim)) for s in (1, -1))
    gradient = (plus - minus).T / (2 * e)
    structure = np.array(group.algebra.poisson_structure(mu))
    assert np.abs(gradient @ structure).max() < 1e-7 * max(1.0, np.abs(gradient).max())
    free = group.dim - np.linalg.matrix_rank(structure, tol=1e-9)
    assert len(gradient) == free == np.linalg.matrix_rank(gradient, tol=1e-6)
    g = group.random(5)
    before, after = group.casimirs(mu), group.casimirs(group.Ad_star(g, mu))
    assert np.abs(after - before).max() <= 1e-12 * max(1.0, np.abs(g).max()) ** 8 * max(1.0, np.abs(before).max())


@pytest.mark.sample(2)
@pytest.mark.parametrize("group", [SO(4), SU(2), Sp(4), Heisenberg(1)], ids=repr)
def test_casimir_functions_along_a_motion(group: MatrixLieGroup) -> None:
    system = lm.LiePoissonSystem(group, lm.KineticEnergy(np.linspace(1.0, 2.0, group.dim)))
    run = lm.integrate(system, lm.RKMK(order=4), system.state(samples(group)[2]), h=0.1, steps=50, compiled=False)
    assert np.abs(group.casimirs(run.mu) - group.casimirs(run.mu[0])).max() < 1e-13


@names
def test_nearest(group: MatrixLieGroup) -> None:
    """On the group, at an element the element itself, and never farther than the element that was disturbed."""
    rng = np.random.default_rng(8)
    g = group.random(3)
    noise = 1e-3 * rng.normal(size=g.shape)
    found = np.array(group.nearest(g + noise))
    assert group.defect(found) < 1e-12
    assert np.abs(np.array(group.nearest(g)) - g).max() < 1e-12 * max(1.0, np.abs(g).max() ** 2)
    if not isinstance(group, SL):
        assert np.linalg.norm(found - g - noise) <= np.linalg.norm(noise) * (1 + 1e-6)


def test_nearest_of_compact_groups_is_the_polar_factor() -> None:
    rng = np.random.default_rng(1)
    a = SO(4).random(2) + 0.1 * rng.normal(size=(4, 4))
    assert np.allclose(SO(4).nearest(a), polar(a)[0], atol=1e-13)
    assert np.allclose(MatrixLieGroup.of(SO(4).generators).nearest(a), polar(a)[0], atol=1e-12)
    c = U(2).random(2) + 0.1 * rng.normal(size=(2, 2))
    assert np.allclose(U(2).nearest(c), polar(c)[0], atol=1e-13)


@pytest.mark.parametrize("group", [SO(3), SO(4), SU(2), SU(3), U(2)], ids=repr)
def test_random_elements_are_uniform(group: MatrixLieGroup) -> None:
    """Haar measure: the mean of |tr g|^2 is 1 (2 for none of these), that of g is 0, before and after a fixed factor."""
    g = group.random(7, 4000)
    h = group.random(8) @ g
    for sample in (g, h):
        traces = np.einsum("bii->b", sample)
        assert abs(np.mean(np.abs(traces) ** 2) - 1.0) < 0.12
        assert np.abs(sample.mean(axis=0)).max() < 0.06


def test_special_cases_agree() -> None:
    """SO(3) is SO3; Sp(2) is SL(2); SU(2) covers SO(3)."""
    xi, eta, mu = samples(SO(3))
    closed, general = lm.SO3(), SO(3)
    g = closed.exp(eta)
    calls = {"exp": (xi,), "log": (g,), "Ad": (g, xi), "exp_Ad_star": (xi, mu), "dexp": (xi, eta), "casimirs": (mu,)}
    for name, args in calls.items():
        assert np.allclose(map_of(general, name)(*args), map_of(closed, name)(*args), rtol=0, atol=1e-15)
    assert np.allclose(Sp(2).exp(xi), SL(2).exp(SL(2).algebra.vee(Sp(2).algebra.hat(xi))), atol=1e-15)


def test_heisenberg() -> None:
    """[Q_i, P_i] = Z and nothing else; closed forms equal those that follow from the generators;
    there is no invariant form.
    """
    closed = Heisenberg(2)
    general = MatrixLieGroup.of(closed.generators)
    unit = np.eye(5)
    assert np.array_equal(closed.ad(unit[1], unit[3]), unit[4]) and not closed.ad(unit[0], unit[3]).any()
    assert closed.algebra.invariant_form is None
    xi, eta, mu = samples(closed, 2.0)
    g = closed.exp(eta)
    pairs = {
        "exp": (xi,), "cayley": (xi,), "log": (g,), "cayley_inv": (g,), "inverse": (g,), "Ad": (g, xi), "Ad_star": (g, mu),
        "exp_Ad_star": (xi, mu), "cayley_Ad_star": (xi, mu), "compose_exp": (g, xi), "compose_cayley": (g, xi),
        "dexp": (xi, eta), "dexp_inv": (xi, eta), "dexp_dual": (xi, mu), "dexp_inv_dual": (xi, mu), "dcayley": (xi, eta),
        "dcayley_inv": (xi, eta), "dcayley_dual": (xi, mu), "dcayley_inv_dual": (xi, mu),
    }  # fmt: skip
    for name, args in pairs.items():
        assert np.allclose(map_of(closed, name)(*args), map_of(general, name)(*args), atol=1e-13), name


@pytest.mark.parametrize(
    ("cls", "n"),
    [
        (SO, 1),
        (SO, 0),
        (SO, 2.5),
        (SO, True),
        (SO, "3"),
        (SL, 1),
        (SU, 1),
        (U, 0),
        (GL, 0),
        (Sp, 3),
        (Sp, 0),
        (Heisenberg, 0),
    ],
)
def test_sizes_that_make_no_group(cls: type, n: object) -> None:
    with pytest.raises(lm.errors.InvalidInput, match=cls.__name__):
        cls(n)


@pytest.mark.parametrize("n", [5, 6, 7])
def test_casimirs_of_rotations_have_the_signs_they_say(n: int) -> None:
    """(-1)^k/2 tr hat(mu)^2k, in terms of the rates a_i of rotation in planes: the sum of a_i^2k, never negative."""
    group = lm.SO(n)
    mu = np.random.default_rng(n).normal(size=group.dim)
    rates = np.linalg.eigvals(np.array(group.algebra.hat(mu))).imag
    traces = group.casimirs(mu)
    for k in range(1, (n + 1) // 2):
        assert traces[k - 1] == pytest.approx(0.5 * (rates ** (2 * k)).sum(), rel=1e-13)


@pytest.mark.parametrize("n", [3, 4, 5])
def test_casimirs_of_unitary_matrices_have_the_signs_they_say(n: int) -> None:
    """i^-k tr M^k of an antihermitian matrix is the sum of the powers of its eigenvalues over i."""
    group = lm.SU(n)
    mu = np.random.default_rng(n).normal(size=group.dim)
    eigenvalues = np.linalg.eigvals(np.array(group.algebra.covector(mu))).imag
    for k, found in enumerate(group.casimirs(mu), start=2):
        assert found == pytest.approx((eigenvalues**k).sum(), rel=1e-13, abs=1e-13)
