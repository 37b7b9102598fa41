"""Rounding on the constraints has no mean: positions are held on neither side, the energy walks."""

import math
from fractions import Fraction

import numpy as np
import pytest

import liemech as lm
from liemech.formulas.derivatives import tangent
from liemech.integrators.method import Method

SPHERE = lm.SphericalPendulum(gravity=9.81)


def swinging(count: int) -> lm.CanonicalState:
    """Starts near one motion."""
    rng = np.random.default_rng(7)
    q = np.array([0.6, 0.0, -0.8]) + 0.05 * rng.uniform(-1, 1, (count, 3))
    return SPHERE.consistent(q, np.array([0.4, 1.5, 0.3]) + 0.1 * rng.uniform(-1, 1, (count, 3)))


def test_rods_are_held_on_neither_side():
    rng, p = np.random.default_rng(3), lm.vec(0.1, 0.2, 0.3)
    left = []
    for q in rng.normal(size=(2000, 3)):
        near = lm.vec(*(q / np.linalg.norm(q)).tolist())
        there = SPHERE.across(near, p, near)
        left.append(float(sum(Fraction(x) ** 2 for x in there) - 1))
    assert abs(np.mean(left)) < 4 * np.std(left) / len(left) ** 0.5
    assert np.std(left) < 2**-53


@pytest.mark.slow
def test_geodesics_have_no_bias_of_energy():
    """It was 7e-18 J a step; the scatter of 16 bodies after 2e5 steps is 5e-19."""
    steps, every = 200_000, 10
    run = lm.integrate(
        SPHERE, lm.GeodesicSplitting(order=6), swinging(16), h=0.1, steps=steps, every=every, progress=False
    )
    quarter = len(run.energy) // 4
    change = run.energy[-quarter:].mean(axis=0) - run.energy[:quarter].mean(axis=0)
    assert abs(change.mean()) / (0.75 * steps) < 2e-18


def test_geodesic_splittings_carry_the_state_and_nothing_else():
    """So a prepared run lays its start down as it comes, and no formula is called before a step."""
    assert all(getattr(lm.GeodesicSplitting, f) is getattr(Method, f) for f in ("start", "observe"))


def test_slopes_that_are_zero_keep_their_sign_where_it_is_asked_for():
    """Normals of constraints need no 0.0 added; what does not move has the slope 0.0 all the same."""
    falling = tangent(lambda x: lm.vec(2.0 * x, 3.0), 1.0, -0.0, True)[1]
    assert [math.copysign(1.0, s) for s in falling] == [-1.0, 1.0]
    assert math.copysign(1.0, lm.derivative(lambda x: 2.0 * x, 1.0, -0.0)) == 1.0
