"""The exact motion of a planet against Kepler's equation in fifty digits, whose bisection knows no eccentricity."""

from __future__ import annotations

from typing import Any

import mpmath as mp
import numpy as np
import pytest

import liemech as lm
from liemech.errors import InvalidInput
from liemech.models.planets import exact_kepler, universal_variables

EPS = 2.0**-52
CIRCLES = 0.0, 1e-16, 1e-9, 0.01
ELLIPSES = 0.3, 0.9, 0.999
PARABOLAS = 1.0 - 1e-6, 1.0 - 1e-13, 1.0, 1.0 + 1e-13, 1.0 + 1e-6
HYPERBOLAS = 1.01, 2.0, 30.0


def stumpff(z: mp.mpf) -> tuple[mp.mpf, mp.mpf, mp.mpf]:
    """c_1, c_2, c_3."""
    if abs(z) < mp.mpf("1e-3"):
        c = [sum((-z) ** j / mp.factorial(n + 2 * j) for j in range(16)) for n in (1, 2, 3)]
        return c[0], c[1], c[2]
    root = mp.sqrt(z)  # imaginary on hyperbolas
    c1, c2 = mp.re(mp.sin(root) / root), mp.re((1 - mp.cos(root)) / z)
    return c1, c2, (1 - c1) / z


def wanted(q: Any, p: Any, k: float, t: float) -> tuple[mp.matrix, mp.matrix]:
    """Position and velocity at t, from the start by Lagrange's coefficients."""
    x, v, time = mp.matrix(q), mp.matrix(p), mp.mpf(t)
    r0, rise = mp.norm(x), mp.fdot(x, v)
    b = 2 * k / r0 - mp.fdot(v, v)
    if b > 0:
        period = 2 * mp.pi * k / b ** mp.mpf(1.5)
        time -= period * mp.nint(time / period)

    def G(s: mp.mpf) -> tuple[mp.mpf, mp.mpf, mp.mpf]:
        c1, c2, c3 = stumpff(b * s * s)
        return s * c1, s * s * c2, s**3 * c3

    def late(s: mp.mpf) -> mp.mpf:
        G1, G2, G3 = G(s)
        return r0 * G1 + rise * G2 + k * G3 - time

    low, high = mp.mpf(0), mp.sign(time) * r0 / mp.sqrt(k * r0) / 1000
    while late(high) * mp.sign(time) < 0:
        low, high = high, 2 * high
    for _ in range(25):
        middle = (low + high) / 2
        low, high = (middle, high) if late(middle) * mp.sign(time) < 0 else (low, middle)
    s = (low + high) / 2
    for _ in range(4):
        G1, G2, G3 = G(s)
        s -= (r0 * G1 + rise * G2 + k * G3 - time) / (r0 + rise * G1 + (k - b * r0) * G2)
    G1, G2, G3 = G(s)
    r = r0 + rise * G1 + (k - b * r0) * G2
    return ((1 - k * G2 / r0) * x + (time - k * G3) * v, (1 - k * G2 / r) * v - (k * G1 / (r * r0)) * x)


@pytest.mark.parametrize("e", [*CIRCLES, *ELLIPSES, *PARABOLAS, *HYPERBOLAS])
@pytest.mark.parametrize("slant", [0.0, 0.7])
def test_every_conic_is_exact_to_rounding(e: float, slant: float) -> None:
    """From the pericentre and, with a slant, from elsewhere; the numbers of the start are exact,
    however near to a parabola they are.
    """
    k, r, turned = 2.5, 0.3, 1.1
    speed = np.sqrt(k / r * (1.0 + e))
    system = lm.Kepler(k)
    start = system.state(
        [r * np.cos(turned), r * np.sin(turned)], [-speed * np.sin(turned + slant), speed * np.cos(turned + slant)]
    )
    unit = np.sqrt(r**3 / k)
    times = unit * np.array([0.0, 1e-7, -1e-3, 0.3, 1.0, -2.5, 7.0, -40.0, 900.0])
    found = system.exact(start, times)
    with mp.workdps(50):
        for t, *here in zip(times.tolist(), found.q.tolist(), found.p.tolist(), strict=True):
            place, velocity = wanted(start.q, start.p, k, t)
            far, fast = mp.norm(place), mp.norm(velocity)
            pull = k / far**2
            known = EPS * abs(t)  # so well is the time known from the pericentre
            assert mp.norm(mp.matrix(here[0]) - place) <= 8 * EPS * far + known * fast
            bound = 8 * EPS * (fast + mp.sqrt(k / far)) + known * pull
            assert mp.norm(mp.matrix(here[1]) - velocity) <= bound


def test_a_million_revolutions_are_taken_off_without_loss() -> None:
    system = lm.Kepler()
    start = system.state([0.4, -0.1], [0.2, 1.7])
    t = 1e6 * system.period(start) + 0.25
    found = system.exact(start, t)
    with mp.workdps(50):
        place, velocity = wanted(start.q, start.p, 1.0, t)
        error = mp.norm(mp.matrix(list(found.q)) - place)
        assert error <= 8 * EPS * mp.norm(place)  # not a million times as much
        assert mp.norm(mp.matrix(list(found.p)) - velocity) <= 16 * EPS * mp.norm(velocity)


def test_a_fall_into_the_sun_is_said() -> None:
    """Without angular momentum: the way there is exact, the time of the fall is refused, and the planet comes back."""
    system = lm.Kepler()
    start = system.state([2.0, 0.0], [0.0, 0.0])
    period = system.period(start)
    assert period == pytest.approx(2.0 * np.pi, rel=1e-15)
    there, back = system.exact(start, np.array([1.1, period - 1.1])).q
    assert there == pytest.approx(back, rel=1e-14) and 0.0 < there[0] < 2.0
    thrown = system.state([2.0, 0.0], [-1.0, 0.0])  # with the speed of a parabola
    hit = 4.0 / 3.0  # sqrt(2 r^3/9): r' = -(2/r)^(1/2)
    half = system.exact(thrown, 0.5 * hit)
    assert half.q[0] == pytest.approx(2.0 * 0.5 ** (2 / 3), rel=1e-14)
    with pytest.raises(InvalidInput, match=r"Kepler\.exact: at t = 0 .* leave the range of floats"):
        system.exact(system.state([1e-310, 0.0], [0.0, 0.0]), 0.0)


@pytest.mark.compiled
def test_native_code_has_the_bits_of_plain_python(monkeypatch: pytest.MonkeyPatch) -> None:
    system, times = lm.Kepler(2.0), np.linspace(-31.0, 57.0, 41)
    starts = [
        system.state([0.7, 0.2], velocity) for velocity in ([0.1, 1.2], [-2.0, 2.4], [0.0, 0.0], [0.3, 1.0])
    ]  # fmt: skip
    plain = [system.exact(start, times) for start in starts]
    monkeypatch.setattr(exact_kepler._PLACED, "spent", 10.0)
    native = [system.exact(start, times) for start in starts]
    assert exact_kepler._PLACED.kernels
    for a, b in zip(plain, native, strict=True):
        assert np.array_equal(a.q, b.q) and np.array_equal(a.p, b.p)


@pytest.mark.parametrize("e", [*CIRCLES, *ELLIPSES, *PARABOLAS, *HYPERBOLAS])
def test_the_guess_is_near_at_all_times(e: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Few turns of the iteration, each of which asks for Stumpff's functions once."""
    seen, stumpff = [0], universal_variables.stumpff

    def counted(z: float) -> Any:
        seen[0] += 1
        return stumpff(z)

    monkeypatch.setattr(universal_variables, "stumpff", counted)
    system = lm.Kepler()
    start = system.state([1.0, 0.0], [0.0, (1.0 + e) ** 0.5])
    made = exact_kepler.conic(start.q, start.p, 1.0)
    longest = 1e12 if e >= 1.0 else np.pi / made.b**1.5
    for t in np.geomspace(1e-12, longest, 60).tolist():
        seen[0] = 0
        assert np.isfinite(exact_kepler.place(made, t)).all()
        assert seen[0] <= 6, t


def test_sizes_and_times_of_all_kinds() -> None:
    """Units of 1e-200 to 1e200, times whose phase no digit knows, far out on a hyperbola, and a start in the sun."""
    system = lm.Kepler()
    for size in (1e-200, 1e-100, 1e100):
        start = system.state([size, 0.0], [0.0, size**-0.5])
        turned = system.exact(start, size**1.5).q / size
        assert turned == pytest.approx([np.cos(1.0), np.sin(1.0)], rel=1e-14)
    late = system.exact(system.pericentre(0.5), np.array([1e17, 1e300]))
    assert (np.hypot(*late.q.T) <= 1.5 + 1e-14).all()
    t = 1e300
    far = system.exact(system.state([1.0, 0.0], [0.0, 2.0]), t).q / t
    assert np.hypot(*far) == pytest.approx(2.0**0.5, rel=1e-14)  # |v|^2 - 2 k/r
    with pytest.raises(InvalidInput, match=r"Kepler\.exact: q is zero"):
        system.exact(system.state([0.0, 0.0], [0.0, 1.0]), 1.0)
