"""Large groups of matrices, whose momenta and elements lie in memory: isospectral methods beside their
laws, native code beside plain Python, and the same formulas on small vectors.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import liemech as lm
from liemech.formulas.large import Large, inner, total

RNG = np.random.default_rng(7)


def body(group: Any, seed: int = 1) -> Any:
    """A body whose energy is a sum of squares, no symmetry left."""
    moments = np.random.default_rng(seed).uniform(1.0, 3.0, group.dim)
    return lm.LiePoissonSystem(group, lm.KineticEnergy(moments))


def start_of(system: Any, seed: int = 2) -> np.ndarray:
    """A momentum of size 1."""
    mu = np.random.default_rng(seed).normal(size=system.group.dim)
    return mu / np.linalg.norm(mu)


def reference(system: Any, mu: np.ndarray, t: float) -> np.ndarray:
    """W' = [W, X] by SciPy: matrices that this library has not touched."""
    basis, inverse = system.group.generated, 1.0 / np.array(system.hamiltonian.inertia)

    def rate(_: float, mu: np.ndarray) -> np.ndarray:
        w, x = np.conj(basis.covector(mu).T), basis.hat(inverse * mu)
        return basis.pairing(np.conj((w @ x - x @ w).T))

    return solve_ivp(rate, (0.0, t), mu, "DOP853", rtol=1e-13, atol=1e-15).y[:, -1]


GROUPS = [lm.SO(4), lm.SU(3), lm.SL(3), lm.Sp(4), lm.GL(2), lm.U(2), lm.SO(14), lm.SU(13)]


@pytest.mark.parametrize("group", GROUPS, ids=repr)
@pytest.mark.parametrize("order", [2, 4, 6])
def test_order_casimirs_and_spatial_momentum(group: Any, order: int) -> None:
    system = body(group)
    mu = start_of(system)
    start = system.state(mu=mu, g=np.eye(group.generated.n))
    turned = lm.integrate(system, lm.RKMK(order=8), start, h=0.1, steps=12, compiled=False).g[-1]
    exact, errors = reference(system, mu, 1.2), []
    for h in (0.4, 0.2):
        run = lm.integrate(system, lm.Isospectral(order), start, h=h, steps=round(1.2 / h), compiled=False)
        errors.append([np.abs(run.mu[-1] - exact).max(), np.abs(run.g[-1] - turned).max()])
        characteristic = [np.poly(group.generated.covector(m)) for m in run.mu[[0, -1]]]
        assert np.abs(characteristic[1] - characteristic[0]).max() < 3e-15
        assert np.abs(run.spatial_momentum - run.spatial_momentum[0]).max() < 3e-15
        assert np.asarray(group.contains(run.g)).all()
    slopes = np.log2(np.array(errors[0]) / errors[1])
    assert (order - 0.35 < slopes).all() and (slopes < order + 0.6).all()


NATIVE = [
    (lm.SO(14), lm.Isospectral(2)),
    *[
        pytest.param(group, method, marks=pytest.mark.slow)
        for group in (lm.SO(14), lm.SU(13), lm.SL(13), lm.Sp(14))
        for method in (lm.Isospectral(2), lm.Isospectral(4), lm.RKMK(order=4), lm.CommutatorFree(order=4))
    ],
]


@pytest.mark.parametrize(("group", "method"), NATIVE, ids=repr)
def test_native_code_has_the_bits_of_plain_python(group: Any, method: Any) -> None:
    system = body(group)
    start = system.state(mu=start_of(system))
    plain, native = (lm.integrate(system, method, start, h=0.2, steps=7, compiled=c) for c in (False, True))
    assert native.compiled and np.array_equal(plain.mu, native.mu)


def test_small_and_large_steps_are_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    """SO(6) written out, and in memory."""
    from liemech.groups.matrices import matrix_basis

    def final(method: Any) -> np.ndarray:
        system = body(lm.SO(6))
        start = system.state(mu=start_of(system), g=np.eye(6))
        run = lm.integrate(system, method, start, h=0.3, steps=5, compiled=False)
        return np.concatenate([run.mu[-1], run.g[-1].ravel()])

    methods = lm.Isospectral(2), lm.Isospectral(4), lm.RKMK(order=4), lm.CommutatorFree(order=4)
    small = [final(m) for m in methods]
    monkeypatch.setattr(matrix_basis, "SMALL", 5)
    for method, before in zip(methods, small, strict=True):
        assert np.abs(final(method) - before).max() < 2e-15, method


@lm.record
class Quartic(lm.Hamiltonian):
    """An energy with a gradient of its own, in the arithmetic of vectors."""

    a: lm.Vec

    def energy(self, mu: lm.Vec) -> float:
        return 0.5 * lm.dot(mu, self.a * mu) + 0.25 * lm.dot(mu, mu) * lm.dot(mu, mu)

    def gradient(self, mu: lm.Vec) -> lm.Vec:
        return self.a * mu + lm.dot(mu, mu) * mu


IN_MATRIX_FORM = [
    *(lm.CovariantVariational(r) for r in (lm.Cayley(), lm.Exponential())),
    *(lm.LiePoissonHamiltonJacobi(2, r) for r in (lm.Cayley(), lm.Exponential())),
    lm.LiePoissonHamiltonJacobi(4),
    *(
        pytest.param(lm.LiePoissonHamiltonJacobi(k, r), marks=pytest.mark.slow)
        for k, r in ((4, lm.Cayley()), (6, lm.Cayley()), (6, lm.Exponential()), (8, lm.Cayley()), (8, lm.Exponential()))
    ),
    *(lm.Taylor(6, r) for r in (lm.Cayley(), lm.Exponential())),
]  # fmt: skip


@pytest.mark.parametrize("method", IN_MATRIX_FORM, ids=repr)
def test_methods_with_derivatives_are_the_same_small_and_large(method: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """SO(4) written out, where Newton's method solves and derivatives go by components, and in
    memory, where matrices are iterated and series have matrices as terms.
    """
    from liemech.groups.matrices import matrix_basis

    def final() -> np.ndarray:
        system = lm.LiePoissonSystem(lm.SO(4), Quartic(np.linspace(1.0, 2.0, 6)))
        if "lagrangian" in method.needs:
            system = body(lm.SO(4))
        start = system.state(mu=0.5 * start_of(system), g=np.eye(4))
        run = lm.integrate(system, method, start, h=0.2, steps=3, compiled=False)
        return np.concatenate([run.mu[-1], run.g[-1].ravel()])

    small = final()
    monkeypatch.setattr(matrix_basis, "SMALL", 3)
    assert lm.SO(4).is_large
    assert np.abs(final() - small).max() < 2e-15


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "order"),
    [
        (lm.CovariantVariational(lm.Cayley()), 2),
        (lm.LiePoissonHamiltonJacobi(4, lm.Cayley()), 4),
        (lm.LiePoissonHamiltonJacobi(4), 4),
        (lm.Taylor(4), 4),
    ],
    ids=repr,
)
def test_order_of_methods_with_derivatives(method: Any, order: int) -> None:
    system = body(lm.SO(14))
    mu, errors = start_of(system), []
    for h in (0.4, 0.2):
        run = lm.integrate(system, method, system.state(mu=mu, g=np.eye(14)), h=h, steps=round(1.2 / h))
        errors.append(np.abs(run.mu[-1] - reference(system, mu, 1.2)).max())
        kept = run.drift()
        assert kept["Casimir 1"].verdict == kept["spatial momentum"].verdict == "exact"
    assert order - 0.35 < np.log2(errors[0] / errors[1]) < order + 0.6


@pytest.mark.parametrize("group", [lm.SO(14), lm.SU(13)], ids=repr)
@pytest.mark.parametrize("method", [lm.RKMK(order=5), lm.Taylor(6, lm.Exponential())], ids=repr)
def test_adaptive_steps(group: Any, method: Any) -> None:
    system = body(group)
    start = system.state(mu=start_of(system), g=np.eye(group.n))
    exact, found = reference(system, start_of(system), 2.0), []
    for rtol in (1e-6, 1e-9):
        run = lm.integrate(system, method, start, t_end=2.0, rtol=rtol, atol=1e-3 * rtol, compiled=False, dense=True)
        found.append(np.abs(run.mu[-1] - exact).max())
        between = reference(system, start_of(system), 0.77)
        assert np.abs(run.at(0.77).mu - between).max() < 10.0 * rtol
        assert np.abs(run.spatial_momentum - run.spatial_momentum[0]).max() < 3e-15
    assert found[0] < 1e-6 and found[1] < 1e-9 and len(run.t) > 5


@pytest.mark.parametrize("method", [lm.RKMK(order=5), pytest.param(lm.Taylor(6), marks=pytest.mark.slow)], ids=repr)
def test_adaptive_steps_small_and_large_are_the_same(method: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    from liemech.groups.matrices import matrix_basis

    def run() -> Any:
        system = body(lm.SO(4))
        start = system.state(mu=start_of(system), g=np.eye(4))
        return lm.integrate(system, method, start, t_end=1.0, rtol=1e-8, atol=1e-11, compiled=False)

    small = run()
    monkeypatch.setattr(matrix_basis, "SMALL", 3)
    large = run()
    assert np.abs(small.t - large.t).max() < 1e-9 and np.abs(small.mu - large.mu).max() < 1e-10


@pytest.mark.slow
def test_runs_go_on_are_saved_and_are_many(tmp_path: Path) -> None:
    system = body(lm.SO(14))
    mu = np.array([start_of(system, k) for k in range(3)])
    plan = lm.Plan(system, lm.Isospectral(2), h=0.2, compiled=True, progress=False)
    whole = plan.run(system.state(mu=mu[0], g=np.eye(14)), steps=8)
    half = plan.run(system.state(mu=mu[0], g=np.eye(14)), steps=4)
    half.save(tmp_path / "run.npz")
    for begun in (half, lm.Trajectory.load(tmp_path / "run.npz")):
        on = plan.resume(begun, steps=4)
        assert np.array_equal(on.mu[-1], whole.mu[-1]) and np.array_equal(on.g[-1], whole.g[-1])
    many = plan.run(system.state(mu=mu), steps=8)
    assert many.mu.shape == (9, 3, 91) and np.array_equal(many.mu[:, 0], whole.mu)
    alone = plan.run(system.state(mu=mu[2]), steps=8)
    assert np.array_equal(many.mu[:, 2], alone.mu)


def test_what_cannot_be_says_why() -> None:
    system = body(lm.SO(14))
    start = system.state(mu=start_of(system))
    cases: list[tuple[Any, dict[str, Any], str]] = [
        (lm.GalerkinVariational(2), {"h": 0.1}, "products of matrices"),
        (lm.CovariantVariational(lagrangian=lm.QuadratureLagrangian()), {"h": 0.1}, "Leave lagrangian out"),
        (lm.Isospectral(2), {"h": 0.1, "precision": "double-double"}, "double precision"),
    ]
    for method, options, words in cases:
        with pytest.raises(lm.errors.IncompatibleSystem, match=words):
            lm.integrate(system, method, start, **options, steps=2)
    plan = lm.Plan(system, lm.Isospectral(2), h=0.1)
    with pytest.raises(lm.errors.IncompatibleSystem, match="calls BLAS"):
        plan.export("body", start=start)
    upper = lm.MatrixLieGroup.of([[[1.0, 0.0], [0.0, 0.0]], [[0.0, 1.0], [0.0, 0.0]]])
    with pytest.raises(lm.errors.IncompatibleSystem, match="not closed under the adjoint"):
        at = body(upper).state(mu=[0.1, 0.2])
        lm.integrate(body(upper), lm.Isospectral(2), at, h=0.1, steps=1)


def test_a_step_that_is_too_long_says_so() -> None:
    system = body(lm.SO(14))
    start = system.state(mu=start_of(system))
    for compiled in (False, True):
        with pytest.raises(lm.errors.NoConvergence, match="too large"):
            lm.integrate(system, lm.Isospectral(2), start, h=60.0, steps=3, compiled=compiled)


def test_algorithm_1_on_symplectic_matrices(monkeypatch: pytest.MonkeyPatch) -> None:
    """Sp(4), whose matrices are not antihermitian, small and in memory."""
    from liemech.groups.matrices import matrix_basis

    def final() -> np.ndarray:
        system = body(lm.Sp(4))
        start = system.state(mu=start_of(system), g=np.eye(4))
        method = lm.CovariantVariational(lm.Cayley())
        run = lm.integrate(system, method, start, h=0.1, steps=3, compiled=False)
        return np.concatenate([run.mu[-1], run.g[-1].ravel()])

    small = final()
    monkeypatch.setattr(matrix_basis, "SMALL", 3)
    assert np.abs(final() - small).max() < 2e-15


@pytest.mark.parametrize("group", [lm.SU(3), lm.SL(3), lm.SU(13), lm.SL(13)], ids=repr)
def test_elements_without_cayley_map(group: Any) -> None:
    """They keep determinant 1, and order 2 beside RKMK."""
    system, n = body(group), group.n
    start, found = system.state(mu=start_of(system), g=np.eye(n)), []
    exact = lm.integrate(system, lm.RKMK(order=8), start, h=0.3, steps=2, compiled=False).g[-1]
    for steps in (2, 4):
        run = lm.integrate(system, lm.Isospectral(2), start, h=0.6 / steps, steps=steps, compiled=False)
        assert abs(np.linalg.det(run.g[-1]) - 1.0) < 5e-15
        assert np.abs(run.spatial_momentum - run.spatial_momentum[0]).max() < 3e-15
        found.append(np.abs(run.g[-1] - exact).max())
    assert 1.8 < np.log2(found[0] / found[1]) < 2.3


@pytest.mark.parametrize("unit", [1.0, 1j])
def test_determinants(unit: complex) -> None:
    """With rows in no order, so that pivots change them."""
    a = RNG.normal(size=(13, 13)) + (unit.imag * 1j * RNG.normal(size=(13, 13)) if unit.imag else 0)
    for one in (a, a[::-1]):
        d = Large(one).determinant()
        found = complex(d.re, d.im) if unit.imag else d
        assert abs(found / np.linalg.det(one) - 1.0) < 1e-13


@lm.record
class Pivoted(lm.Hamiltonian):
    """No energy, but a velocity that asks for a determinant."""

    def energy(self, mu: lm.Vec) -> float:
        return 0.0 * lm.dot(mu, mu)

    def gradient(self, mu: lm.Vec) -> lm.Vec:
        return 0.0 * mu

    def velocity_matrix(self, algebra: Any, m: Any) -> Any:
        return m.determinant() * m.without_adjoint()


def test_native_determinants_have_their_sign() -> None:
    """Of a matrix whose rows pivots exchange."""
    system = lm.LiePoissonSystem(lm.GL(11), Pivoted())
    start = system.state(mu=(np.eye(11)[::-1] + 0.1 * RNG.normal(size=(11, 11))).ravel())
    plain, native = (lm.integrate(system, lm.Isospectral(2), start, h=0.05, steps=3, compiled=c) for c in (False, True))
    assert native.compiled and np.array_equal(plain.mu, native.mu)
    assert np.abs(plain.mu[-1] - plain.mu[0]).max() > 1e-3


def test_arithmetic_in_memory_is_that_of_numpy() -> None:
    a, b = RNG.normal(size=(2, 17, 17)) + 1j * RNG.normal(size=(2, 17, 17))
    x, y = Large(a), Large(b)
    assert np.allclose((x @ y).array, a @ b, rtol=1e-13)
    assert np.allclose(x.over(y).array @ b, a, rtol=1e-10)
    assert np.array_equal((2.0 * x - y / 4.0).array, 2.0 * a - b / 4.0)
    assert np.array_equal(x.H.array, a.conj().T) and np.array_equal(x.T.array, a.T)
    assert inner(x, y) == pytest.approx(np.sum(a.conj() * b).real, rel=1e-13)
    numbers = RNG.normal(size=16 * 5 + 3)
    sums = [0.0] * 16
    for k in range(5):  # sixteen interleaved sums, halves, what is left
        sums = [s + t if k else t for s, t in zip(sums, numbers[16 * k :].tolist())]
    while len(sums) > 1:
        sums = [s + t for s, t in zip(sums[: len(sums) // 2], sums[len(sums) // 2 :])]
    for rest in numbers[80:].tolist():
        sums[0] = sums[0] + rest
    assert total(numbers) == sums[0]
    assert np.isnan(Large(np.eye(14)).over(Large(np.zeros((14, 14)))).array).all()


def test_an_energy_of_ones_own() -> None:
    system = lm.LiePoissonSystem(lm.SO(10), Quartic(np.linspace(1.0, 2.0, 45)))
    start = system.state(mu=start_of(system))
    plain, native = (lm.integrate(system, lm.Isospectral(2), start, h=0.2, steps=9, compiled=c) for c in (False, True))
    assert native.compiled and np.array_equal(plain.mu, native.mu)
    assert native.drift()["Casimir 1"].verdict == "exact"
    assert np.ptp(native.energy) < 1e-3 * native.energy[0]


def test_tables_that_native_code_reads_stay_where_they_are() -> None:
    """A second system with equal tables must not set free those whose addresses native code holds."""
    from liemech.formulas.large_maps import TABLES

    first = lm.models.ZeitlinSphere(13)
    content = [first.hamiltonian.solver.content, first.group.generated.hat_map.content]
    kept = [TABLES[c] for c in content]
    second = lm.models.ZeitlinSphere(13)
    assert [second.hamiltonian.solver.content, second.group.generated.hat_map.content] == content
    assert all(TABLES[c] is tables for c, tables in zip(content, kept, strict=True))


@pytest.mark.parametrize("retraction", [lm.Exponential(), lm.Cayley()], ids=repr)
def test_retractions_on_rows_of_large_complex_groups(retraction: Any) -> None:
    """They are complex, and those of one row alike."""
    group = lm.U(13)
    xi = RNG.normal(size=(2, group.dim)) / 10.0
    g = retraction.tau(group, xi)
    assert g.dtype == complex and np.asarray(group.contains(g)).all()
    assert np.abs(g[1] - np.asarray(retraction.tau(group, xi[1]))).max() < 1e-14


@pytest.mark.parametrize("rows", [13, 48])
@pytest.mark.parametrize("norm", [1e-8, 1e-3, 0.9, 1.1, 5.3, 5.5, 40.0, 1e3])
def test_exponentials_of_large_matrices(rows: int, norm: float) -> None:
    """exp(x) - 1 beside sixty digits of mpmath, relative to itself: by the series and, from 48 rows on, by
    Pade's approximation, on both sides of where they scale; and unitary.
    """
    import mpmath

    from liemech.groups.matrices.matrix_functions import expm1

    rng = np.random.default_rng(rows)
    turns = np.append(1.0, rng.uniform(-0.1, 0.1, rows - 1))  # its norm is nearly that of one eigenvalue
    turns *= norm / np.linalg.norm(turns)
    q = np.linalg.qr(rng.normal(size=(rows, rows)) + 1j * rng.normal(size=(rows, rows)))[0]
    x = (q * (1j * turns)) @ q.conj().T
    x = 0.5 * (x - x.conj().T)
    found = np.array(expm1(Large(x)).array)
    g = found + np.eye(rows)
    assert np.abs(g.conj().T @ g - np.eye(rows)).max() < 3e-16 * (16.0 + norm)
    with mpmath.workdps(60):
        exact = np.array([complex(mpmath.expm1(mpmath.mpc(0, t))) for t in turns])
    expected = (q * exact) @ q.conj().T  # q is unitary to rounding, and x known to rounding
    assert np.linalg.norm(found - expected) < 2e-15 * (4.0 + norm) * np.linalg.norm(exact)


def test_pade_coefficients() -> None:
    """p(x)/p(-x) of degree m agrees with exp up to x^2m: as fractions, beside SymPy's series."""
    from fractions import Fraction
    from math import factorial

    from liemech.groups.matrices.matrix_functions import pade_coefficients

    for m in (7, 13):
        b = [
            Fraction(factorial(2 * m - j) * factorial(m), factorial(2 * m) * factorial(m - j) * factorial(j))
            for j in range(m + 1)
        ]  # fmt: skip
        assert np.allclose(pade_coefficients(m), [float(x) for x in b], rtol=0.0, atol=0.0)
        for k in range(2 * m + 1):  # the coefficient of x^k in p(-x) exp(x) - p(x)
            product = sum(((-1) ** j * b[j] / factorial(k - j) for j in range(min(k, m) + 1)), Fraction(0))
            assert product == (b[k] if k <= m else 0)


LARGE_GROUPS = [lm.SO(14), lm.SU(13), lm.U(13), lm.SL(13), lm.GL(12), lm.Sp(14)]


@pytest.mark.parametrize("group", LARGE_GROUPS, ids=repr)
def test_what_is_no_momentum_and_no_element_is_named(group: Any) -> None:
    """For every large class: shapes, what is not finite or not real, and matrices outside of the group."""
    system, n, e = body(group), group.n, np.eye(group.n)
    bad: list[tuple[dict[str, Any], str]] = [
        ({"mu": np.ones(group.dim + 1)}, "mu has shape"),
        ({"mu": np.ones((n, n))}, "mu has shape"),
        ({"mu": np.full(group.dim, np.nan)}, "finite"),
        ({"mu": 1j * np.ones(group.dim)}, "real numbers"),
        ({"g": np.eye(n + 1)}, "g has shape"),
        ({"g": 0.0 * e}, r"g is not in "),
        ({"g": np.full((n, n), np.inf)}, "finite"),
    ]
    if not isinstance(group, lm.GL):
        bad.append(({"g": 1.01 * e}, "is not in "))  # near, with a determinant of its own
    if not group.generated.complex:
        bad.append(({"g": e * (1.0 + 0.1j)}, "real numbers"))
    for given, words in bad:
        with pytest.raises((lm.errors.InvalidInput, lm.errors.InvalidType), match=words):
            system.state(**({"mu": np.ones(group.dim)} | given))
    algebra = group.algebra
    for call, words in (
        (lambda: algebra.hat(np.ones(group.dim - 1)), "xi has shape"),
        (lambda: algebra.vee(np.eye(n + 1)), "matrix has shape"),
        (lambda: group.exp(np.full(group.dim, np.nan)), "finite"),
        (lambda: group.log(0.0 * e), "is not in "),
        (lambda: lm.LiePoissonSystem(group, lm.KineticEnergy(np.ones(group.dim - 1))), "components"),
    ):
        with pytest.raises((lm.errors.InvalidInput, lm.errors.InvalidType, lm.errors.IncompatibleSystem), match=words):
            call()


@lm.record
class Driven(lm.LinearGroupEquation):
    """g' = g (a sin t + b cos 2t)."""

    a: lm.Vec
    b: lm.Vec

    def drive(self, t: float) -> lm.Vec:
        return lm.formulas.sin(t) * self.a + lm.formulas.cos(2.0 * t) * self.b


@pytest.mark.slow
def test_magnus_on_a_large_group() -> None:
    group = lm.SO(14)
    system = Driven(group, *(0.08 * np.random.default_rng(1).normal(size=(2, group.dim))))
    start, errors = system.state(np.eye(14)), []
    exact = lm.integrate(system, lm.RKMK(order=8), start, h=0.1, steps=20, compiled=False).g[-1]
    for h in (0.2, 0.1):
        run = lm.integrate(system, lm.Magnus(order=4), start, h=h, steps=round(2.0 / h), compiled=False)
        errors.append(np.abs(run.g[-1] - exact).max())
        assert np.asarray(group.contains(run.g)).all()
    assert 3.9 < np.log2(errors[0] / errors[1]) < 4.1
