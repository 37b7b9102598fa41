"""Functions of small matrices against SciPy, against many digits, and against what they must satisfy."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest
from scipy.linalg import expm, logm, sqrtm

from liemech.formulas import Mat, elimination
from liemech.groups.matrices import matrix_functions as functions
from liemech.groups.matrices.matrix_basis import clean
from liemech.groups.matrices.matrix_functions import expm1

EPS = np.finfo(float).eps
SIZES = (1e-8, 0.1, 1.0, 10.0)


def sample(n: int, size: float, complex_: bool, seed: int = 1) -> np.ndarray:
    """A random matrix of given spectral norm."""
    rng = np.random.default_rng([seed, n])
    x = rng.normal(size=(n, n)) + (1j * rng.normal(size=(n, n)) if complex_ else 0.0)
    return x * (size / np.linalg.norm(x, 2))


def of(function: object, x: np.ndarray) -> np.ndarray:
    return np.array(function(Mat.of(x.tolist())))  # type: ignore[operator]


def exact_expm1(x: np.ndarray) -> np.ndarray:
    """exp(x) - 1 by its series, in 60 digits."""
    with mp.workdps(60):
        a = mp.matrix(x.tolist())
        term = total = a
        for k in range(2, 120):
            term = term * a / k
            total = total + term
        return np.array([[complex(v) for v in row] for row in total.tolist()])


@pytest.mark.sample(4)
@pytest.mark.parametrize("complex_", [False, True])
@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("n", [1, 2, 3, 4, 6])
def test_exponential(n: int, size: float, complex_: bool) -> None:
    """exp(x) - 1 is right relative to its own size, which for small x is that of x."""
    x = sample(n, size, complex_)
    exact = exact_expm1(x)
    assert np.abs(of(functions.expm1, x) - exact).max() <= 8 * EPS * max(1.0, size) * np.linalg.norm(exact, 2)
    # SciPy has 5e-13 here
    assert np.allclose(of(functions.expm, x), expm(x), rtol=0, atol=1e-12 * np.linalg.norm(expm(x), 2))


def test_exponential_of_nothing_and_of_too_much() -> None:
    for tiny in (0.0, 5e-324, 1e-200):
        assert np.array_equal(of(functions.expm1, tiny * np.eye(3)), tiny * np.eye(3))
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])
    g = of(functions.expm, 1e6 * turn)
    assert np.abs(g.T @ g - np.eye(2)).max() < 1e-9
    assert np.abs(g - [[np.cos(1e6), -np.sin(1e6)], [np.sin(1e6), np.cos(1e6)]]).max() < 1e-9
    for lost in (1e17, 1e200):  # no digit would be right
        assert np.isnan(of(functions.expm, lost * turn)).all() and np.isnan(of(functions.phi1m, lost * turn)).all()
    of(functions.expm, np.full((2, 2), np.inf))  # ends


@pytest.mark.sample(4)
@pytest.mark.parametrize("complex_", [False, True])
@pytest.mark.parametrize("n", [1, 2, 3, 4, 6])
def test_logarithm_and_root(n: int, complex_: bool) -> None:
    for size in (1e-8, 0.1, 1.0, 2.5):
        x = sample(n, size, complex_)
        g = expm(x)
        assert np.abs(of(functions.logm, g) - x).max() <= 64 * EPS * np.linalg.cond(g)
        root = of(functions.sqrtm, g)
        assert np.abs(root @ root - g).max() <= 64 * EPS * np.linalg.cond(g)
        assert np.abs(root - sqrtm(g)).max() <= 64 * EPS * np.linalg.cond(g)
        small = 0.2 * x / size
        assert np.abs(of(functions.log1pm, small) - logm(np.eye(n) + small)).max() < 1e-14


def test_logarithm_of_a_negative_number_is_none() -> None:
    for a in ([[-1.0]], [[-1.0, 0.0], [0.0, -2.0]], [[0.0, 0.0], [0.0, 1.0]]):
        with np.errstate(all="ignore"):
            found = of(functions.logm, np.array(a))
        assert not np.isfinite(found).all() or np.abs(expm(found) - a).max() > 0.1


@pytest.mark.parametrize("complex_", [False, True])
@pytest.mark.parametrize("n", [1, 2, 3, 5])
def test_inverse_determinant_and_solutions(n: int, complex_: bool) -> None:
    for seed in range(5):
        m, rhs = sample(n, 3.0, complex_, seed), sample(n, 1.0, complex_, seed + 10)
        condition = np.linalg.cond(m)
        assert np.abs(of(elimination.inverse, m) @ m - np.eye(n)).max() <= 16 * EPS * condition
        assert abs(complex(elimination.determinant(Mat.of(m.tolist()))) - np.linalg.det(m)) <= 64 * EPS * 3.0**n
        solution = np.array(elimination.solve_matrix(Mat.of(m.tolist()), Mat.of(rhs.tolist())))
        assert np.abs(m @ solution - rhs).max() <= 16 * EPS * condition
    assert not np.isfinite(of(elimination.inverse, np.zeros((2, 2)))).any()
    assert np.array_equal(of(elimination.inverse, np.array([[0.0, 2.0], [1.0, 0.0]])), [[0.0, 1.0], [0.5, 0.0]])
    assert elimination.determinant(Mat.of([[0.0, 2.0], [0.0, 1.0]])) == 0.0


@pytest.mark.parametrize("size", [0.0, 1e-8, 0.3, 1.0, 3.0, 9.0])
def test_phi(size: float) -> None:
    """a phi(a) = exp(a) - 1, where a can be divided by."""
    for n in (1, 2, 3, 6):
        a = sample(n, size, False) if size else np.zeros((n, n))
        exact = exact_expm1(a).real
        assert np.abs(a @ of(functions.phi1m, a) - exact).max() <= 32 * EPS * max(1.0, size**2) * max(
            1.0, np.linalg.norm(exact, 2)
        )
    for tiny in (0.0, 1e-9):
        assert np.abs(of(functions.phi1m, tiny * np.eye(2)) - (1.0 + 0.5 * tiny) * np.eye(2)).max() <= EPS


@pytest.mark.parametrize("function", [functions.expm1, functions.phi1m])
@pytest.mark.parametrize("n", [3, 6])
def test_norms_without_a_digit_left_are_given_up_at_once(
    function: object, n: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    products, product = [0], Mat.__matmul__

    def counted(self: Mat, other: object) -> object:
        products[0] += 1
        return product(self, other)

    monkeypatch.setattr(Mat, "__matmul__", counted)
    for size in (2.0**60, 1e160, 1e300):
        assert np.isnan(of(function, sample(n, size, False))).any()
    assert products[0] < 3 * 64
    assert np.isfinite(of(function, -(2.0**40) * np.eye(n))).all()


def test_the_exponential_of_a_symmetric_matrix_has_its_axes() -> None:
    axes, _ = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))
    for sizes in ([0.3, -0.2, 0.5], [0.05, 0.06, 0.07], [1.5, 2.0, -0.5]):
        x = axes @ np.diag(sizes) @ axes.T
        found = axes.T @ np.array(expm1(Mat.of(x.tolist()))) @ axes
        assert np.abs(found - np.diag(np.expm1(sizes))).max() < 1e-14 * np.expm1(max(sizes))


def test_rounding_is_taken_off_fractions_and_small_units_are_left_alone() -> None:
    third = 1.0 / 3.0 + 2.0**-52
    assert clean(np.array([third, 1e-17, 0.3 + 1e-9])).tolist() == [1.0 / 3.0, 0.0, 0.3 + 1e-9]
    small = 1e-20 * np.array([1.0, -0.7, 1e-17])
    assert clean(small).tolist() == [small[0], small[1], 0.0]
