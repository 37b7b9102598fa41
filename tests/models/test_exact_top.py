"""The exact Lagrange top: against reference numbers and Taylor series of 40 digits, in every regime."""

from __future__ import annotations

import functools
import json
import math
from typing import Any

import mpmath as mp
import numpy as np
import pytest
from scenes import REFERENCES, rotation

import liemech as lm
from liemech.errors import InvalidInput

EPS = 2.0**-52
REFERENCE = json.loads((REFERENCES / "heavy_top_lagrange.json").read_text())


def taylor(
    top: lm.models.LagrangeTop, mu: Any, g: Any, t: float, number: Any = float, order: int = 20
) -> tuple[np.ndarray, np.ndarray]:
    """Momentum and attitude by power series, with fixed steps: no closed form in it."""
    with mp.workdps(32):
        A, C, M = (number(x) for x in (top.transverse, top.axial, top.weight * top.length))
        y = [number(float(x)) for x in mu] + [number(float(x)) for x in np.asarray(g).reshape(-1)]
        steps = max(1, math.ceil(abs(t) * 4.0))
        h = number(t) / steps
        inverse = (1 / A, 1 / A, 1 / C)
        for _ in range(steps):
            c = [[x] for x in y]
            for k in range(order):
                w = [[inverse[i] * v for v in c[i]] for i in range(3)]

                def times(a: list[Any], b: list[Any], k: int = k) -> Any:
                    return sum((a[j] * b[k - j] for j in range(k + 1)), number(0))

                rates = [
                    times(c[1], w[2]) - times(c[2], w[1]) + M * c[10][k],
                    times(c[2], w[0]) - times(c[0], w[2]) - M * c[9][k],
                    times(c[0], w[1]) - times(c[1], w[0]),
                ]
                for i in range(3):
                    row = c[3 + 3 * i : 6 + 3 * i]
                    rates += [
                        times(row[1], w[2]) - times(row[2], w[1]),
                        times(row[2], w[0]) - times(row[0], w[2]),
                        times(row[0], w[1]) - times(row[1], w[0]),
                    ]
                for series, rate in zip(c, rates):
                    series.append(rate / (k + 1))
            y = [functools.reduce(lambda found, x: found * h + x, reversed(series)) for series in c]
        found = np.array([float(x) for x in y])
    return found[:3], found[3:].reshape(3, 3)


def tilted(angle: float) -> np.ndarray:
    return np.asarray(lm.SO3().exp(np.array([angle, 0.0, 0.0])))


TOP = lm.models.LagrangeTop(1.0, 1.0, 0.5, 1.0)  # weight, transverse, axial, length
AT_RANDOM = rotation(np.random.default_rng(4))
UPRIGHT = np.eye(3)
DOWN = np.diag([1.0, -1.0, -1.0])

CASES: dict[str, tuple[lm.models.LagrangeTop, Any, Any]] = {
    "nodding": (TOP, [0.1, 0.2, 2.0], tilted(0.3)),
    "at random": (lm.models.LagrangeTop(2.0, 1.3, 0.4, 0.7), [0.7, -0.9, 1.1], AT_RANDOM),
    "flat": (lm.models.LagrangeTop(1.0, 1.0, 1.7, 1.0), [0.4, 0.3, -1.5], AT_RANDOM),
    "weight upwards": (lm.models.LagrangeTop(-1.0, 1.0, 0.5, 1.0), [0.1, 0.2, 2.0], tilted(0.3)),
    "no weight": (lm.models.LagrangeTop(0.0, 1.0, 0.5, 1.0), [0.1, 0.2, 2.0], AT_RANDOM),
    "a spherical pendulum": (TOP, [0.3, 0.4, 0.0], tilted(1.9)),
    "a plane pendulum through the lowest point": (TOP, [0.3, 0.0, 0.0], tilted(1.9)),
    "a plane pendulum over both poles": (TOP, [3.0, 0.0, 0.0], tilted(1.9)),
    "from the highest point, with a = p_3": (TOP, [0.7, 0.2, 2.5], UPRIGHT),
    "from the lowest point, with a = -p_3": (TOP, [0.7, 0.2, 0.5], DOWN),
    "close by the highest point": (TOP, [0.7, 0.2 + 1e-9, 2.5], tilted(1e-9)),
    "close by the lowest point": (TOP, [0.7, 0.2, 0.5], tilted(math.pi - 1e-8)),
    "sleeping": (TOP, [0.0, 0.0, 2.5], UPRIGHT),
    "upright and too slow, an equilibrium all the same": (TOP, [0.0, 0.0, 1.0], UPRIGHT),
    "hanging": (TOP, [0.0, 0.0, 1.0], DOWN),
    "nearly sleeping": (TOP, [1e-5, 0.0, 2.5], tilted(1e-5)),
    "dropped from rest": (TOP, [0.0, 0.0, 0.0], tilted(0.4)),
    "with a cusp": (TOP, [0.0, 0.0, 1.5], tilted(0.8)),
}


@pytest.mark.parametrize(
    ("number", "order"), [(float, 20), pytest.param(mp.mpf, 30, marks=pytest.mark.slow)], ids=["16", "32"]
)
@pytest.mark.parametrize("name", CASES)
def test_against_power_series(name: str, number: Any, order: int) -> None:
    top, mu, g = CASES[name]
    start = top.state(mu, g)
    fast = 1.0 + float(np.abs(np.array(mu)).max()) / min(top.transverse, top.axial)
    for t in 1.3, -0.8, 5.0:
        found, (momentum, attitude) = top.exact(start, t), taylor(top, mu, g, t, number, order)
        allowed = 30.0 * EPS * (1.0 + fast * abs(t))
        assert np.abs(np.array(found.g) - attitude).max() <= allowed
        assert np.abs(np.array(found.mu) - momentum).max() <= allowed * fast


def test_falling_from_the_vertical() -> None:
    """The separatrix: u = 1 - (1 - u_1)/cosh^2, and the top comes back to the vertical without ever standing there."""
    spin = 1.0
    lowest = spin * spin / 2.0 - 1.0
    speed = math.sqrt(2.0 * (1.0 - lowest) - spin * spin * (1.0 - lowest) / (1.0 + lowest))
    assert speed == 0.0 or abs(speed) < 1e-7  # at its lowest point it only precesses
    tilt = math.acos(lowest)
    mu = [0.0, spin * math.sin(tilt) * 1.0 / (1.0 + lowest), spin]
    start = TOP.state(mu, tilted(tilt))
    assert abs(float(TOP.energy(start.mu, start.g)) - (1.0 + spin * spin)) < 16.0 * EPS
    t = np.linspace(-6.0, 6.0, 25)
    rate = math.sqrt(0.5 * (1.0 - lowest))
    u = TOP.exact(start, t).g[:, 2, 2]
    assert np.abs(u - (1.0 - (1.0 - lowest) / np.cosh(rate * t) ** 2)).max() < 1e-10
    for at in 1.0, -2.0:
        found, (momentum, attitude) = TOP.exact(start, at), taylor(TOP, start.mu, start.g, at)
        assert np.abs(np.array(found.g) - attitude).max() < 2e-14
        assert np.abs(np.array(found.mu) - momentum).max() < 2e-14


def test_the_separatrix_itself() -> None:
    """A start whose numbers lie on it exactly: upright, not turning about a horizontal axis, all roots at 1 or below."""
    from liemech.models.bodies.exact_top import lagrange_top

    half = math.sqrt(0.5)
    # u_0 = 0, u_1 = -1/2: C = 1/2, p_3 = 1, a = 1, energy M; mu . Gamma = 1
    q = (half, half, 0.0, 0.0)
    mu = (1.0, 1.0, 1.0)
    t = np.array([0.0, 0.4, -1.0])
    attitude, momenta = lagrange_top(1.0, 0.5, 1.0, mu, q, t)
    g = TOP.state(mu, tilted(math.pi / 2.0)).g
    for i, at in enumerate(t):
        momentum, rotation_ = taylor(TOP, mu, g, float(at))
        w, x, y, z = (float(c[i]) for c in attitude)
        assert np.abs(momenta[i] - momentum).max() < 1e-14
        assert abs(w * w + z * z - x * x - y * y - rotation_[2, 2]) < 1e-14
        assert abs(2.0 * (x * z - w * y) - rotation_[2, 0]) < 1e-14


def test_against_the_reference() -> None:
    top = lm.models.LagrangeTop(float(REFERENCE["mgl"]), float(REFERENCE["J"][0]), float(REFERENCE["J"][2]), 1.0)
    start = top.state(np.array(REFERENCE["pi0"], dtype=float), np.array(REFERENCE["R0"], dtype=float))
    for sample in REFERENCE["samples"]:
        t = float(sample["t"])
        found = top.exact(start, t)
        assert np.abs(np.array(found.mu) - np.array(sample["pi"], dtype=float)).max() < 8.0 * EPS * (1.0 + 4.0 * t)
        assert np.abs(np.array(found.g) - np.array(sample["R"], dtype=float)).max() < 8.0 * EPS * (1.0 + 4.0 * t)


def test_long_times_keep_what_is_constant() -> None:
    top, mu, g = CASES["at random"]
    start = top.state(mu, g)
    states = top.exact(start, np.linspace(0.0, 1e4, 501))
    assert np.ptp(np.asarray(top.energy(states.mu, states.g))) < 1e-13
    assert np.ptp(np.einsum("ni,ni->n", states.mu, states.g[:, 2])) < 1e-13
    assert np.abs(np.einsum("nij,nkj->nik", states.g, states.g) - np.eye(3)).max() < 16.0 * EPS


def test_the_motion_goes_on_from_where_it_is() -> None:
    top, mu, g = CASES["flat"]
    start = top.state(mu, g)
    middle = top.exact(start, 700.0)
    end, other = top.exact(start, 1000.0), top.exact(top.state(middle.mu, middle.g), 300.0)
    assert np.abs(np.array(end.g) - np.array(other.g)).max() < 1e-11


def test_bad_arguments() -> None:
    many = TOP.state(np.zeros((2, 3)), np.stack([UPRIGHT, UPRIGHT]))
    with pytest.raises(InvalidInput, match="one top at a time"):
        TOP.exact(many, 1.0)
    with pytest.raises(InvalidInput, match="t must be finite"):
        TOP.exact(TOP.state([0.1, 0.2, 2.0], UPRIGHT), math.nan)


def test_an_upright_top_sleeps_above_its_momentum() -> None:
    """A small deflection z obeys A z'' - i mu z' - w l z = 0, bounded where mu^2 > 4 A w l."""
    top = lm.models.LagrangeTop(transverse=1.3, axial=0.7, weight=2.0, length=0.4)
    mu = top.sleeping_momentum
    for factor, sleeps in ((1.0 + 1e-6, True), (1.0 - 1e-6, False)):
        roots = np.roots([1.3, -1j * factor * mu, -2.0 * 0.4])
        assert (np.abs(roots.real).max() < 1e-9) == sleeps
