"""Carlson's integrals against 40 digits, on arguments such as the exact rigid body has for them, and their laws."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

from liemech.models.carlson import elliprf, elliprj

EPS = 2.0**-52


@pytest.fixture
def arguments(rng: np.random.Generator) -> np.ndarray:
    """x = cos^2, y = cos^2 + k'^2 sin^2, z = 1, p = 1 + nu sin^2, from the circle to next to the separatrix."""
    angle = np.concatenate([[0.0, 1e-9, 0.5 * np.pi], rng.uniform(0.0, 0.5 * np.pi, 60)])
    k1 = 10.0 ** (rng.uniform(-1.0, 0.0, angle.size) * np.where(np.arange(angle.size) % 2, 1.0, 70.0))
    nu = 10.0 ** rng.uniform(-12.0, 2.0, angle.size)
    x = np.where(np.arange(angle.size) == 2, 0.0, np.cos(angle) ** 2)
    return np.stack([x, x + (k1 * np.sin(angle)) ** 2, np.ones_like(x), 1.0 + nu * np.sin(angle) ** 2])


@pytest.mark.parametrize(("ours", "theirs", "count"), [(elliprf, mpmath.elliprf, 3), (elliprj, mpmath.elliprj, 4)])
def test_against_40_digits(ours, theirs, count, arguments) -> None:  # type: ignore[no-untyped-def]
    with mpmath.workdps(40):
        exact = np.array([float(theirs(*map(mpmath.mpf, column))) for column in arguments[:count].T])
    assert np.abs(ours(*arguments[:count]) / exact - 1.0).max() < 6 * EPS


@pytest.mark.parametrize(("ours", "count"), [(elliprf, 3), (elliprj, 4)])
def test_an_element_does_not_feel_its_neighbours(ours, count, arguments) -> None:  # type: ignore[no-untyped-def]
    alone = [float(ours(*column)) for column in arguments[:count].T]
    assert np.array_equal(ours(*arguments[:count]), alone)


def test_equal_arguments_and_homogeneity() -> None:
    x, y, z, p = 0.3, 1.1, 2.0, 2.5
    assert elliprf(x, x, x) == pytest.approx(x**-0.5, rel=4 * EPS)
    assert elliprj(x, x, x, x) == pytest.approx(x**-1.5, rel=4 * EPS)
    assert elliprf(9 * x, 9 * y, 9 * z) == pytest.approx(elliprf(x, y, z) / 3, rel=4 * EPS)
    assert elliprj(9 * x, 9 * y, 9 * z, 9 * p) == pytest.approx(elliprj(x, y, z, p) / 27, rel=4 * EPS)
