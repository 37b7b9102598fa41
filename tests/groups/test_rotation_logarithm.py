"""The rotation vector of a rotation matrix against arithmetic of many digits."""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Callable

import pytest
from mpmath import mp, mpf

from liemech.formulas.vectors import Mat
from liemech.groups.rigid.rotation_logarithm import rotation_quaternion, rotation_vector

EPS = 2.0**-52
DIGITS = 50


def rotation(w: list[mpf]) -> Mat:
    """exp(hat(w)), rounded once at the end."""
    x = mp.fsum(c * c for c in w)
    t = mp.sqrt(x)
    W = mp.matrix([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
    R = mp.eye(3) + mp.sin(t) / t * W + 2 * (mp.sin(t / 2) / t) ** 2 * W * W
    return Mat(*([float(R[i, j]) for j in range(3)] for i in range(3)))


def directions(count: int) -> list[list[float]]:
    """Random axes, some of them close to a coordinate plane, some in it."""
    r = random.Random(7)
    axes = [[r.gauss(0.0, 1.0) for _ in range(3)] for _ in range(count)]
    for i, n in enumerate(axes):
        n[i % 3] *= (1.0, 1.0, 1e-6, 0.0)[i % 4]
    return axes


def error(w: list[mpf], found: tuple[float, ...]) -> float:
    """|found - w| / |w| in units of eps."""
    return float(mp.norm(mp.matrix(w) - mp.matrix(list(found))) / mp.norm(mp.matrix(w))) / EPS


r = random.Random(11)
ANGLES: dict[str, Callable[[], float]] = {
    "1e-12 .. 1e-8": lambda: 10 ** r.uniform(-12, -8),
    "1e-8 .. 1e-4": lambda: 10 ** r.uniform(-8, -4),
    "1e-4 .. 0.1": lambda: 10 ** r.uniform(-4, -1),
    "0.1 .. 3": lambda: r.uniform(0.1, 3),
    "pivots change": lambda: r.uniform(1.5, 2.2),
    "pi - (1e-1 .. 1e-4)": lambda: math.pi - 10 ** r.uniform(-4, -1),
    "pi - (1e-4 .. 1e-8)": lambda: math.pi - 10 ** r.uniform(-8, -4),
    "pi - (1e-8 .. 1e-13)": lambda: math.pi - 10 ** r.uniform(-13, -8),
    "the double pi": lambda: math.pi,
}


def largest_error(where: str, count: int = 150) -> float:
    """Of so many rotations by angles in this range, in units of eps."""
    found = []
    with mp.workdps(DIGITS):
        for n in directions(count):
            w = [mpf(ANGLES[where]()) * c / mp.norm(mp.matrix(n)) for c in n]
            log = rotation_vector(rotation(w))
            # the rounded matrix is a half turn
            sign = -1 if where == "the double pi" and mp.fdot(w, log) < 0 else 1
            found.append(error([sign * c for c in w], log))
    return max(found)


@pytest.mark.sample(3)
@pytest.mark.parametrize("where", ANGLES)
def test_accuracy(where: str) -> None:
    assert largest_error(where) < 3.0


@pytest.mark.parametrize("size", [1e-20, 1e-160, 1e-170, 1e-300])
def test_tiny_rotations_keep_their_digits(size: float) -> None:
    """Squares underflow, the vector does not."""
    a, b, c = 3.0 * size, -4.0 * size, 1.5 * size
    R = Mat((1.0, -c, b), (c, 1.0, -a), (-b, a, 1.0))
    assert error([mpf(a), mpf(b), mpf(c)], rotation_vector(R)) < 2.0


@pytest.mark.parametrize("zero", [0.0, -0.0])
def test_the_identity_gives_exact_zeros(zero: float) -> None:
    R = Mat((1.0, zero, zero), (zero, 1.0, zero), (zero, zero, 1.0))
    assert tuple(rotation_vector(R)) == (0.0, 0.0, 0.0)
    assert tuple(rotation_quaternion(R)) == (0.0, 0.0, 0.0, 1.0)


# ---------------------------------------------------------------- half a turn


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("zero", [0.0, -0.0])
def test_half_turns_about_the_axes(axis: int, zero: float) -> None:
    R = Mat(*([(1.0 if i == axis else -1.0) if i == j else zero for j in range(3)] for i in range(3)))
    assert tuple(rotation_vector(R)) == tuple(math.pi if i == axis else 0.0 for i in range(3))


def test_half_turns_and_their_sign() -> None:
    """2 n n^T/|n|^2 - 1 is exactly symmetric; of +-n we get the one that is positive at the largest diagonal entry."""
    for n in itertools.product((-2, -1, 0, 1, 2), repeat=3):
        if any(n):
            nn = sum(c * c for c in n)
            R = Mat(*([2.0 * n[i] * n[j] / nn - (i == j) for j in range(3)] for i in range(3)))
            diagonal = [R[i, i] for i in range(3)]
            sign = math.copysign(1.0, n[diagonal.index(max(diagonal))])
            with mp.workdps(DIGITS):
                assert error([sign * mp.pi * c / mp.sqrt(nn) for c in n], rotation_vector(R)) < 2.0, n


# ---------------------------------------------------------------- the quaternion


def random_rotations(count: int) -> list[Mat]:
    s = random.Random(5)
    with mp.workdps(DIGITS):
        return [rotation([s.uniform(0, 3.1) * c / mp.norm(mp.matrix(n)) for c in n]) for n in directions(count)]


def test_the_quaternion_is_a_unit_and_gives_the_matrix_back() -> None:
    for R in random_rotations(200):
        x, y, z, w = rotation_quaternion(R)
        assert abs(math.fsum((x * x, y * y, z * z, w * w)) - 1.0) < 2 * EPS
        assert w >= 0.0
        again = (
            (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
            (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
            (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
        )
        assert max(abs(R[i, j] - again[i][j]) for i in range(3) for j in range(3)) < 4 * EPS


def test_a_quarter_turn_has_the_textbook_quaternion() -> None:
    """About the third axis, body to space: e_1 goes to e_2, q = (0, 0, sin 45, cos 45), scalar last."""
    R = Mat((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    h = math.sqrt(0.5)
    assert tuple(rotation_quaternion(R)) == pytest.approx((0.0, 0.0, h, h), rel=EPS, abs=0.0)
    assert tuple(rotation_vector(R)) == pytest.approx((0.0, 0.0, math.pi / 2), rel=EPS, abs=0.0)


# ---------------------------------------------------------------- laws


def test_the_inverse_rotation_has_the_opposite_vector_bit_for_bit() -> None:
    for R in random_rotations(200):
        assert tuple(rotation_vector(R.T)) == tuple(-c for c in rotation_vector(R))


@pytest.mark.parametrize("defect", [1e-15, 1e-12, 1e-8])
def test_small_defects_stay_small(defect: float) -> None:
    """A matrix that is a rotation only up to `defect` gives a vector wrong by a few times that;
    |w| <= pi always.
    """
    s = random.Random(9)
    with mp.workdps(DIGITS):
        for n in directions(60):
            for angle in (0.0, 1e-9, 1.0, 2.0, 3.0, math.pi - 1e-4, math.pi):
                w = [mpf(angle) * c / mp.norm(mp.matrix(n)) for c in n] if angle else [mpf(1e-300), mpf(0), mpf(0)]
                R = rotation(w)
                found = rotation_vector(Mat(*([e + defect * s.uniform(-1, 1) for e in row] for row in R)))
                assert math.hypot(*found) <= math.pi * (1 + 2 * EPS)
                distance = min(mp.norm(mp.matrix(v) - mp.matrix(list(found))) for v in (w, *other_sheet(w, angle)))
                assert distance < 4 * (defect + EPS * angle)


def other_sheet(w: list[mpf], angle: float) -> list[list[mpf]]:
    """At half a turn a defect may turn the axis round."""
    return [[-c for c in w]] if angle == math.pi else []
