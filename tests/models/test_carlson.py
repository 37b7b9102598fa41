"""Carlson's integrals against 40 digits, on arguments such as the exact rigid body has for them, and their laws."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

from liemech.models.bodies import carlson
from liemech.models.bodies.carlson import ARCTANGENT, duplications, elliprf, elliprj

EPS = 2.0**-52


@pytest.fixture
def arguments(rng: np.random.Generator) -> np.ndarray:
    """x = cos^2, y = cos^2 + k'^2 sin^2, z = 1, p = 1 + nu sin^2, from the circle to next to the separatrix."""
    angle = np.concatenate([[0.0, 1e-9, 0.5 * np.pi], rng.uniform(0.0, 0.5 * np.pi, 60)])
    k1 = 10.0 ** (rng.uniform(-1.0, 0.0, angle.size) * np.where(np.arange(angle.size) % 2, 1.0, 70.0))
    nu = 10.0 ** rng.uniform(-12.0, 0.0, angle.size)
    x = np.where(np.arange(angle.size) == 2, 0.0, np.cos(angle) ** 2)
    return np.stack([x, x + (k1 * np.sin(angle)) ** 2, np.ones_like(x), 1.0 + nu * np.sin(angle) ** 2])


def test_against_40_digits(arguments: np.ndarray) -> None:
    """R_J for many arguments at once, after as many duplications as the hardest of them needs."""
    count = max(duplications(*column) for column in arguments.T)
    with mpmath.workdps(40):
        first = np.array([float(mpmath.elliprf(*map(mpmath.mpf, column))) for column in arguments[:3].T])
        third = np.array([float(mpmath.elliprj(*map(mpmath.mpf, column))) for column in arguments.T])
    assert np.abs([elliprf(*column) for column in arguments[:3].T.tolist()] / first - 1.0).max() < 6 * EPS
    assert np.abs(elliprj(*arguments, count) / third - 1.0).max() < 6 * EPS


def test_numbers_and_arrays_give_the_same_bits(arguments: np.ndarray) -> None:
    assert np.array_equal(elliprj(*arguments, 7.0), [elliprj(*column, 7.0) for column in arguments.T.tolist()])


def test_arguments_that_are_closer_need_no_more_duplications(rng: np.random.Generator) -> None:
    """As many as at a quarter period, sn = 1, are enough anywhere."""
    for k1, nu in zip(10.0 ** rng.uniform(-70.0, 0.0, 40), 10.0 ** rng.uniform(-12.0, 0.0, 40), strict=True):
        most = duplications(0.0, k1 * k1, 1.0, 1.0 + nu)
        for s2 in rng.uniform(size=20):
            assert duplications(1.0 - s2, 1.0 - s2 + k1 * k1 * s2, 1.0, 1.0 + nu * s2) <= most


def test_equal_arguments_and_homogeneity() -> None:
    x, y, z, p = 0.3, 1.1, 2.0, 2.5
    count = duplications(x, y, z, p)
    assert elliprf(x, x, x) == pytest.approx(x**-0.5, rel=4 * EPS)
    assert elliprj(x, x, x, x, 0.0) == pytest.approx(x**-1.5, rel=4 * EPS)
    assert elliprf(9 * x, 9 * y, 9 * z) == pytest.approx(elliprf(x, y, z) / 3, rel=4 * EPS)
    assert elliprj(9 * x, 9 * y, 9 * z, 9 * p, count) == pytest.approx(elliprj(x, y, z, p, count) / 27, rel=4 * EPS)


def test_the_polynomial_of_the_arctangent(rng: np.random.Generator) -> None:
    """atan(r)/r to a quarter of a rounding error, for r^2 up to (sqrt 2 - 1)/(sqrt 2 + 1)."""
    with mpmath.workdps(40):
        for w in (0.0, 1e-9, 2.0**0.5 - 1.0 - 0.2426, *rng.uniform(0.0, 0.1716, 20)):
            r = mpmath.sqrt(mpmath.mpf(w))
            found = mpmath.polyval([mpmath.mpf(c) for c in reversed(ARCTANGENT)], mpmath.mpf(w))
            assert abs(found - (mpmath.atan(r) / r if w else 1)) < 0.25 * EPS


@pytest.mark.parametrize("seed", range(4))
def test_the_series_are_of_seventh_order(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without duplications the error falls by 2^8 when arguments come twice as close, seen in 30 digits."""
    monkeypatch.setattr(carlson, "CLOSE", 1.0)
    monkeypatch.setattr(carlson, "sqrt", mpmath.sqrt)
    way = np.random.default_rng(seed).uniform(-1.0, 1.0, 4)
    with mpmath.workdps(30):
        for count, whole, part in ((3, mpmath.elliprf, elliprf), (4, mpmath.elliprj, elliprj)):
            errors = []
            for size in (0.02, 0.01):
                at = [1 + mpmath.mpf(size * x) for x in way[:count]]
                found = part(*at) if count == 3 else part(*at, 0.0)  # type: ignore[arg-type]
                errors.append(abs(found - whole(*at)))
            assert 220.0 < errors[0] / errors[1] < 300.0
