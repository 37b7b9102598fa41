"""The exact pendulum: against reference numbers and mpmath, in every regime, to some rounding errors times 1 + w t."""

from __future__ import annotations

import json
import math
from typing import Any

import mpmath as mp
import numpy as np
import pytest
from scenes import REFERENCES

import liemech as lm
from liemech.errors import InvalidInput
from liemech.models.poses import rods

EPS = 2.0**-52
REFERENCE = json.loads((REFERENCES / "pendulum.json").read_text())
# the velocity at 2.5 rad of a pendulum that hardly reaches the top, with w = 1
TOP = 2.0 * math.cos(1.25)


def whittaker(q: float, p: float, m: float, g: float, l: float, t: float) -> tuple[Any, Any]:
    """The motion by mpmath's elliptic functions of the parameter k^2, 60 digits."""
    with mp.workdps(60):
        q, p, m, g, l = map(mp.mpf, (q, p, m, g, l))
        w, turned = mp.sqrt(abs(g) / l), mp.pi if g < 0 else mp.mpf(0)
        whole = 2 * mp.pi * mp.nint((q - turned) / (2 * mp.pi)) + turned
        S, v = mp.sin((q - whole) / 2), p / (m * l * l) / (2 * w)
        k2 = S * S + v * v
        if k2 > 1:
            k = mp.sqrt(k2) * mp.sign(v)
            u = mp.ellipf(mp.asin(S), 1 / k2) + k * w * t
            K = mp.ellipk(1 / k2)
            n = mp.nint(u / (2 * K))
            sn, dn = (mp.ellipfun(name, u - 2 * n * K, m=1 / k2) for name in ("sn", "dn"))
            return whole + 2 * (mp.asin(sn) + n * mp.pi), 2 * w * k * dn * m * l * l
        if k2 == 1:
            u = mp.atanh(S) * mp.sign(v) + w * t
            return whole + 2 * mp.sign(v) * mp.asin(mp.tanh(u)), 2 * w * mp.sign(v) / mp.cosh(u) * m * l * l
        k = mp.sqrt(k2)
        u = mp.ellipf(mp.asin(S / k), k2)
        u = (2 * mp.ellipk(k2) - u if v < 0 else u) + w * t
        sn, cn = (mp.ellipfun(name, u, m=k2) for name in ("sn", "cn"))
        return whole + 2 * mp.asin(k * sn), 2 * w * k * cn * m * l * l


CASES = {
    "small": (1e-9, 1e-10, 1.0, 1.0, 1.0),
    "swing": (0.3, 0.2, 1.0, 1.0, 1.0),
    "back": (1.0, -0.5, 2.0, 3.0, 0.5),
    "from rest": (3.0, 0.0, 1.0, 9.80665, 0.7),
    "turns": (1.0, 2.5, 1.0, 1.0, 1.0),
    "turns backwards": (1.0, -25.0, 1.0, 1.0, 1.0),
    "after many turns": (40.0, 3.0, 1.0, 1.0, 1.0),
    "the separatrix": (0.0, 2.0, 1.0, 1.0, 1.0),
    "the separatrix backwards": (0.0, -2.0, 1.0, 1.0, 1.0),
    "just below it": (2.5, TOP * (1.0 - 2.0**-50), 1.0, 1.0, 1.0),
    "just above it": (2.5, TOP * (1.0 + 2.0**-49), 1.0, 1.0, 1.0),
    "next to it": (0.0, 2.0 - 2.0**-51, 1.0, 1.0, 1.0),
    "next to the top": (math.pi, 0.0, 1.0, 1.0, 1.0),
    "gravity upwards": (0.2, 0.1, 1.0, -2.0, 1.0),
}


@pytest.mark.parametrize("name", CASES)
def test_against_mpmath(name: str) -> None:
    q, p, m, g, l = CASES[name]
    pendulum, w = lm.models.Pendulum(m, l, g), math.sqrt(abs(g) / l)
    start = pendulum.state(q, p)
    fast = max(w, abs(p) / (m * l * l))
    for t in 0.0, 0.7, -3.1, 25.0, 300.0:
        found, (angle, momentum) = pendulum.exact(start, t), whittaker(q, p, m, g, l, t)
        allowed = 8.0 * EPS * (1.0 + fast * abs(t))
        size = 1.0 if name != "small" else 1e-9
        assert abs(found.q[0] - angle) <= allowed * (size + abs(q))
        assert abs(found.p[0] - momentum) <= allowed * m * l * l * fast * size


def test_against_the_reference() -> None:
    pendulum = lm.models.Pendulum(gravity=1.0)
    start = pendulum.state(float(REFERENCE["q0"]), float(REFERENCE["p0"]))
    assert abs(pendulum.period(start) - float(REFERENCE["period"])) < 1e-14
    samples = REFERENCE["samples"]
    found = pendulum.exact(start, [float(s["t"]) for s in samples])
    for i, s in enumerate(samples):
        t = float(s["t"])
        assert abs(found.q[i, 0] - float(s["q"])) < 8.0 * EPS * (1.0 + t)
        assert abs(found.p[i, 0] - float(s["p"])) < 8.0 * EPS * (1.0 + t)


def test_periods() -> None:
    pendulum = lm.models.Pendulum(1.0, 2.0, 3.0)
    assert pendulum.period(pendulum.state(0.0, 1e-9)) == pytest.approx(2.0 * math.pi * math.sqrt(2.0 / 3.0), rel=1e-15)
    for p in 0.5, 30.0, -30.0:
        start = pendulum.state(0.4, p)
        end = pendulum.exact(start, pendulum.period(start))
        turn = 2.0 * math.pi * np.sign(p) if abs(p) > 20.0 else 0.0
        assert abs(end.q[0] - 0.4 - turn) < 1e-14
        assert abs(end.p[0] - p) < 1e-14 * abs(p)
    assert lm.models.Pendulum(gravity=1.0).period(lm.models.Pendulum(gravity=1.0).state(0.0, 2.0)) == math.inf


def test_rest_and_no_gravity() -> None:
    for pendulum, q in (lm.models.Pendulum(), 0.0), (lm.models.Pendulum(gravity=-1.0), 0.0):
        start = pendulum.state(q, 0.0)
        assert pendulum.period(start) == 0.0
        assert np.array_equal(pendulum.exact(start, [0.0, 5.0]).q, [[q], [q]])
    free = lm.models.Pendulum(2.0, 3.0, 0.0)
    end = free.exact(free.state(0.5, 9.0), [0.0, 4.0])
    assert np.allclose(end.q, [[0.5], [2.5]], rtol=1e-15)
    assert np.array_equal(end.p, [[9.0], [9.0]])


def test_the_energy_is_that_of_the_start_on_the_whole_way() -> None:
    pendulum = lm.models.Pendulum(1.3, 0.8)
    for p in 0.3, 4.0, 9.0:
        start = pendulum.state(0.7, p)
        t = np.linspace(-50.0, 50.0, 1001)
        states = pendulum.exact(start, t)
        energy = np.asarray(pendulum.energy(states.q, states.p))
        assert np.ptp(energy) < 1e-12 * abs(energy).max()


def test_bad_arguments() -> None:
    pendulum = lm.models.Pendulum()
    with pytest.raises(InvalidInput, match="one pendulum at a time"):
        pendulum.exact(pendulum.state([[0.1], [0.2]], [[0.0], [0.0]]), 1.0)
    with pytest.raises(InvalidInput, match="t must be finite"):
        pendulum.exact(pendulum.state(0.1, 0.0), math.inf)


def test_a_phase_beyond_the_largest_number_is_refused() -> None:
    pendulum, top = lm.models.Pendulum(), lm.models.LagrangeTop(0.5, 1.0, 1.0, 1.0)
    fast = pendulum.state(0.3, 400.0)
    spinning = top.state(mu=[2.0, -2.5, 0.4], g=np.eye(3))
    for exact in (lambda t: pendulum.exact(fast, t), lambda t: top.exact(spinning, t)):
        with pytest.raises(lm.errors.InvalidInput, match=r"t = 1.7e\+308 is too late"):
            exact([1.0, 1.7e308])


def test_the_period_without_gravity_is_that_of_a_turn() -> None:
    pendulum = lm.models.Pendulum(mass=1.3, length=0.7, gravity=0.0)
    start = pendulum.state(0.4, -0.9)
    end = pendulum.exact(start, pendulum.period(start))
    assert float(end.q[0]) == pytest.approx(0.4 - 2.0 * math.pi, rel=1e-14) and float(end.p[0]) == pytest.approx(
        -0.9, rel=1e-14
    )


def test_rods_of_a_pendulum_join_each_mass_to_the_one_before() -> None:
    """The first hangs on the pivot, whose number follows those of the masses."""
    pivots, joined = rods(lm.models.ChainPendulum(masses=[1.0, 1.0, 1.0], lengths=[1.0, 1.0, 1.0]))
    assert np.array_equal(pivots, np.zeros((1, 3))) or np.array_equal(pivots, np.zeros((1, 2)))
    assert joined == [(3, 0), (0, 1), (1, 2)]
