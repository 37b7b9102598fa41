"""Poisson structures: brackets as formulas, Poisson's theorem, and what check_poisson finds."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import pytest

import liemech as lm
from liemech.groups.matrices.skew_matrices import null_vectors, pairs
from liemech.models.charged_particle import GuidingCentreStructure, MagneticStructure
from liemech.models.lattices.maxwell_bloch import MaxwellBlochStructure
from liemech.models.lattices.toda import FlaschkaStructure

SKEW3 = [[0.0, 1.0, -2.0], [-1.0, 0.0, 3.0], [2.0, -3.0, 0.0]]
MOTIONS = lm.coadjoint(lm.SE3()).poisson_structure

SHIPPED: list[Any] = [
    lm.structures.Canonical(2),
    lm.structures.ConstantStructure(SKEW3),
    lm.structures.ConstantStructure([[0.0, 2.0], [-2.0, 0.0]]),
    lm.structures.LogCanonical(SKEW3),
    lm.coadjoint(lm.SO3()).poisson_structure,
    lm.coadjoint(lm.SO3()).poisson_structure.opposite,
    MOTIONS,
    lm.coadjoint(lm.SemidirectProduct(lm.SO3())).poisson_structure,
    lm.coadjoint(lm.SL(2)).poisson_structure.opposite,
    FlaschkaStructure(3),
    FlaschkaStructure(3, periodic=True),
    MaxwellBlochStructure(),
    MagneticStructure(lm.models.TokamakField()),
    GuidingCentreStructure(lm.models.TokamakField()),
]


@lm.record
class InUnits(lm.PoissonStructure):
    """A structure with its coordinates in other units: the points u y of the points y."""

    inner: lm.PoissonStructure
    units: lm.Vec

    @property
    def dim(self) -> int:
        return self.inner.dim

    @property
    def rank(self) -> int | None:  # type: ignore[override]
        return self.inner.rank

    def matrix(self, y: lm.Vec) -> lm.Mat:
        u, B = self.units, self.inner.matrix(y / self.units)
        return lm.mat(*[lm.vec(*[a * b * c for b, c in zip(row, u)]) for a, row in zip(u, B)])

    def casimirs(self, y: lm.Vec) -> lm.Vec:
        return self.inner.casimirs(y / self.units)

    def sharp(self, y: lm.Vec, a: lm.Vec) -> lm.Vec:
        return self.units * self.inner.sharp(y / self.units, self.units * a)

    def coordinate_flow(self, y: lm.Vec, index: int, s: float) -> lm.Vec:
        s = s * self.units[index]
        return self.units * self.inner.coordinate_flow(y / self.units, index, s)

    def places(self) -> np.ndarray:
        """Points of size one in the units of before."""
        return np.array(self.units) * np.random.default_rng(4).uniform(0.5, 1.5, (3, self.dim))


def unlike(structure: Any, decades: float, seed: int) -> InUnits:
    """The coordinates in units that differ by so many decades."""
    powers = np.random.default_rng(seed).uniform(-0.5, 0.5, structure.dim) * decades
    return InUnits(structure, 10.0**powers)


@pytest.mark.parametrize("structure", SHIPPED, ids=repr)
@pytest.mark.parametrize("decades", [6.0, 30.0, 60.0])
def test_laws_and_ranks_do_not_depend_on_units(structure: Any, decades: float) -> None:
    """Coordinates of metres beside coordinates of masses of molecules."""
    other = unlike(structure, decades, 2)
    y = other.places()[0]
    rank = np.linalg.matrix_rank(np.array(structure.matrix(y / np.array(other.units))))
    assert other.rank_at(lm.vec(*y)) == rank
    if type(structure).coordinate_flow is lm.PoissonStructure.coordinate_flow:
        report = lm.check_poisson(other, other.places(), raises=False)
        assert {finding.law for finding in report.broken} <= {"motion of coordinates"}, report
    else:
        assert lm.check_poisson(other, other.places())
    chart = lm.charts.DarbouxLieChart(other, y, steps=1)
    assert 2 * chart.degrees == rank


@pytest.mark.slow
def test_a_strong_field_hides_no_degree_of_freedom() -> None:
    """x stays a coordinate whatever the field; a Casimir would stand still."""
    for strength in 10.0 ** np.arange(-30, 31, 12):
        structure = MagneticStructure(lm.models.UniformField([0.0, 0.0, strength]))
        chart = lm.charts.DarbouxLieChart(structure, [0.1, 0.2, 0.3, 0.4, 0.5, 0.6], steps=1)
        assert chart.degrees == 3
        assert lm.check_poisson(structure)
        blocks = np.kron(np.diag([1.0, strength]), [[0.0, 1.0], [-1.0, 0.0]])
        constant = lm.structures.ConstantStructure(blocks)
        assert lm.check_poisson(constant) and len(constant.kernel) == 0
        assert lm.charts.LinearDarboux(constant).defect(np.ones(4)) < 1e-14


def test_ranks_of_products_of_vectors() -> None:
    """The sum of r products a b^T - b a^T has rank 2 r, whatever is rounded, in any units; so has
    its null space, in which B k vanishes.
    """
    rng = np.random.default_rng(3)
    for _ in range(60):
        n = int(rng.integers(2, 13))
        r = int(rng.integers(0, n // 2 + 1))
        vectors = rng.normal(size=(r, 2, n))
        B = sum((np.outer(a, b) - np.outer(b, a) for a, b in vectors), np.zeros((n, n)))
        units = 2.0 ** rng.integers(-50, 51, size=n)
        for u in (np.ones(n), units):
            scaled = u[:, None] * B * u
            assert len(pairs(scaled)) == r
            null = np.array(null_vectors(scaled)).reshape(n - 2 * r, n)
            back = null * u  # in like units: covectors
            back = back / np.linalg.norm(back, axis=1, keepdims=True)
            assert np.abs(back @ B).max(initial=0.0) < 1e-10
            assert np.linalg.matrix_rank(back) == n - 2 * r


@pytest.mark.parametrize("structure", SHIPPED, ids=repr)
def test_shipped_structures_obey_their_laws(structure: lm.PoissonStructure) -> None:
    assert lm.check_poisson(structure)


@lm.record
class Cubic(lm.PoissonStructure):
    """Volterra's cubic bracket for three species, with places for slips."""

    dim: ClassVar[int] = 3
    sign: float = 1.0
    power: int = 1
    far: float = 1.0

    def matrix(self, y: lm.Vec) -> lm.Mat:
        a, b, c = y
        u, v, w = a * b * (a + b), b * c * (b + c) ** self.power, self.far * a * b * c
        return lm.mat(lm.vec(0.0, u, w), lm.vec(-u, 0.0, v), lm.vec(-w, -self.sign * v, 0.0))


class Wrong:
    """Structures with one slip each."""

    @lm.record
    class Monopole(lm.models.MagneticField):
        """div B = 1."""

        def at(self, x: lm.Vec) -> lm.Vec:
            return lm.vec(x[0], 0.5, 1.0 + x[1])

    @lm.record
    class NotStarred(GuidingCentreStructure):
        """B where B* is meant."""

        def fields(self, y: lm.Vec) -> Any:
            B = self.field.at(lm.vec(y[0], y[1], y[2]))
            b = B / lm.norm(B)
            return b, B, lm.dot(b, B)

    @lm.record
    class Casimir(MaxwellBlochStructure):
        """A wrong sign in the Casimir."""

        def casimirs(self, y: lm.Vec) -> lm.Vec:
            return lm.vec(y[2] - 0.5 * y[0] ** 2)

    @lm.record
    class Flow(MaxwellBlochStructure):
        """The factor 1/2 of s^2 forgotten."""

        def coordinate_flow(self, y: lm.Vec, index: int, s: float) -> lm.Vec:
            return lm.vec(y[0] + s, y[1], y[2] - s * (y[0] + s)) if index == 1 else super().coordinate_flow(y, index, s)

    @lm.record
    class Sharp(lm.structures.Canonical):
        """A wrong sign in the product."""

        def sharp(self, y: lm.Vec, a: lm.Vec) -> lm.Vec:
            n = self.degrees
            return lm.vec(*a[n:], *a[:n])

    @lm.record
    class Rank(FlaschkaStructure):
        """A rank too high."""

        rank: ClassVar[int] = 6


@pytest.mark.parametrize(
    ("structure", "law", "entries"),
    [
        (Cubic(sign=-1.0), "skew symmetry", r"b_2,3 = .* or b_3,2"),
        (Cubic(power=2), "Jacobi identity", "b_1,2, b_2,3, b_3,1"),
        (Cubic(far=0.99), "Jacobi identity", "b_1,2, b_2,3, b_3,1"),
        (MagneticStructure(Wrong.Monopole()), "Jacobi identity", "b_4,5, b_5,6, b_6,4"),
        (Wrong.NotStarred(lm.models.TokamakField()), "Jacobi identity", "b_"),
        (Wrong.Casimir(), "Casimirs", "Casimir 1"),
        (Wrong.Flow(), "motion of coordinates", "the motion of y_2"),
        (Wrong.Sharp(2), "closed product", "a_1"),
        (Wrong.Rank(3), "rank", "`rank`, which is 6"),
    ],
    ids=lambda x: x if isinstance(x, str) else type(x).__name__,
)
def test_every_slip_is_found_and_its_entries_are_named(structure: Any, law: str, entries: str) -> None:
    report = lm.check_poisson(structure, raises=False)
    assert next(finding.law for finding in report.broken) == law
    other = unlike(structure, 30.0, 5)
    report = lm.check_poisson(other, other.places(), raises=False)
    assert law in [finding.law for finding in report.broken]
    with pytest.raises(lm.errors.LawViolation, match=entries):
        lm.check_poisson(structure)


def test_a_place_where_the_rank_falls_is_named() -> None:
    with pytest.raises(lm.errors.LawViolation, match="B has rank 0 here, 2 elsewhere"):
        lm.check_poisson(lm.coadjoint(lm.SO3()).poisson_structure, [[0.0, 0.0, 0.0], [1.0, 2.0, 3.0]])


def test_brackets_are_formulas_that_nest() -> None:
    """{q_1, p_1} = 1; {F, {G, H}} + cyclic = 0; Leibniz; with the plus structure all signs turn."""
    B = lm.structures.Canonical(2)
    y = [0.3, -0.7, 1.1, 0.4]
    assert B.bracket(lambda x: x[0], lambda x: x[2])(y) == 1.0
    sin = lm.formulas.sin
    F, G, H = ((lambda x: x[0] * sin(x[2])), (lambda x: x[1] ** 2 * x[3] + x[0]), (lambda x: x[2] * x[3] * x[0]))
    cyclic = [B.bracket(a, B.bracket(b, c))(y) for a, b, c in ((F, G, H), (G, H, F), (H, F, G))]
    assert abs(sum(cyclic)) <= 1e-14 * max(map(abs, cyclic)) > 0.0
    minus = lm.coadjoint(lm.SO3()).poisson_structure
    mu = [0.1, 0.2, 0.3]
    assert minus.bracket(lambda m: m[0], lambda m: m[1])(mu) == -0.3
    assert minus.opposite.bracket(lambda m: m[0], lambda m: m[1])(mu) == 0.3
    with pytest.raises(lm.errors.InvalidType, match="G must be a formula"):
        minus.bracket(F, 1.0)  # type: ignore[arg-type]


@lm.record
class Bracketed(lm.Hamiltonian):
    """An energy that is a bracket of brackets."""

    strength: float

    def energy(self, y: lm.Vec) -> float:
        B = lm.structures.Canonical(1)
        outer = B.bracket(
            lambda x: x[1], B.bracket(lambda x: x[1] ** 2 + x[0] ** 3, lambda x: 9.0 * x[0] ** 2 * x[1] ** 2)
        )
        return self.strength * outer(y) + y[1] ** 2 + y[0] ** 2


@pytest.mark.slow
@pytest.mark.compiled
def test_brackets_compile() -> None:
    system = lm.PoissonSystem(lm.structures.Canonical(1), Bracketed(1e-3))
    start = system.state([0.4, 0.3])
    runs = [lm.integrate(system, lm.RKMK(order=4), start, h=0.05, steps=20, compiled=c) for c in (True, False)]
    assert np.array_equal(runs[0].y, runs[1].y)
    # {p, {p^2 + q^3, 9 q^2 p^2}} = d/dq of (2p . 18 q p^2 - 3 q^2 . 18 q^2 p), with {p, F} = -dF/dq
    q, p = 0.4, 0.3
    exact = 36.0 * p**3 - 216.0 * q**3 * p
    assert system.energy([q, p]) == pytest.approx(1e-3 * exact + p * p + q * q, rel=1e-14)


def test_poissons_theorem() -> None:
    """Of a central force L_1 and L_2 are invariants, and {L_1, L_2} = L_3; a wrong invariant is refused."""
    B = lm.structures.Canonical(3)

    def L(i: int, y: Any) -> Any:
        j, k = (i + 1) % 3, (i + 2) % 3
        return y[j] * y[3 + k] - y[k] * y[3 + j]

    def H(y: Any) -> Any:
        return 0.5 * (y[3] ** 2 + y[4] ** 2 + y[5] ** 2) - 1.0 / lm.norm(lm.vec(y[0], y[1], y[2]))

    third = B.poisson_theorem(lambda y: L(0, y), lambda y: L(1, y), H)
    y = [0.5, -0.2, 0.8, 0.1, 0.9, -0.3]
    assert third(y) == pytest.approx(L(2, y), rel=1e-14)
    assert B.is_invariant(third, H)
    assert not B.is_invariant(lambda y: y[0], H)
    with pytest.raises(lm.errors.LawViolation, match="G is no invariant of H"):
        B.poisson_theorem(third, lambda y: y[3], H)


def test_lie_derivatives_are_those_along_the_motion() -> None:
    """Of an oscillator q'' = -4 q, q'''' = 16 q; the vector field is B dH."""
    B = lm.structures.Canonical(1)

    def H(y: Any) -> Any:
        return 0.5 * y[1] ** 2 + 2.0 * y[0] ** 2

    y = [0.7, 0.3]
    assert B.lie_derivative(lambda x: x[0], H, times=2)(y) == pytest.approx(-2.8, rel=1e-15)
    assert B.lie_derivative(lambda x: x[0], H, times=4)(y) == pytest.approx(11.2, rel=1e-15)
    assert list(B.hamiltonian_vector_field(H)(y)) == [0.3, -2.8]


def test_two_structures_of_maxwell_and_bloch_give_one_motion() -> None:
    """The structure of se(2)*, H = z + x^2/2, and the one of the model."""

    @lm.record
    class Other(lm.PoissonStructure):
        dim: ClassVar[int] = 3

        def matrix(self, y: lm.Vec) -> lm.Mat:
            return lm.mat(lm.vec(0.0, -y[2], y[1]), lm.vec(y[2], 0.0, 0.0), lm.vec(-y[1], 0.0, 0.0))

        def casimirs(self, y: lm.Vec) -> lm.Vec:
            return lm.vec(y[1] ** 2 + y[2] ** 2)

    assert lm.check_poisson(Other())
    y = [0.3, -0.4, 1.2]
    field = Other().hamiltonian_vector_field(lambda x: x[2] + 0.5 * x[0] ** 2)(y)
    assert np.allclose(field, lm.models.MaxwellBloch().velocity(y), rtol=1e-15, atol=0.0)


def test_bad_structures_are_refused() -> None:
    with pytest.raises(lm.errors.InvalidInput, match=r"must be skew-symmetric; entries \(1, 2\) and \(2, 1\)"):
        lm.structures.ConstantStructure([[0.0, 1.0], [1.0, 0.0]])
    with pytest.raises(lm.errors.InvalidInput, match="square matrix"):
        lm.structures.LogCanonical([[0.0, 1.0]])
    with pytest.raises(lm.errors.InvalidInput, match="sign is -1"):
        lm.structures.LiePoissonStructure(lm.SO3(), 2)
    with pytest.raises(lm.errors.InvalidType, match="with the brackets"):
        lm.check_poisson(lm.structures.Canonical)  # type: ignore[arg-type]
