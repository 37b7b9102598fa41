"""SE(3) and SE(2) against their definitions as matrices, in arithmetic of many digits: no closed
form is used on that side.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import mpmath as mp
import numpy as np
import pytest
from scenes import hat

import liemech as lm
from liemech.groups.lie_algebra import sided
from liemech.groups.rigid.se2 import SE2
from liemech.groups.rigid.se3 import SE3

EPS = np.finfo(float).eps
SIZES = {
    "identity": 0.0,
    "1e-8": 1e-8,
    "below the switch": 0.6,
    "above the switch": 0.65,
    "random": 1.7,
    "near pi": math.pi - 1e-6,
    "5": 5.0,
}
SIDES = ["right", "left"]


@dataclass
class Motion:
    """A group, its matrices written down once more, a velocity with an angle of a given size, and
    things to apply maps to.
    """

    group: lm.LieGroup
    angle: float
    xi: np.ndarray
    eta: np.ndarray
    mu: np.ndarray
    p: np.ndarray
    g: np.ndarray

    @property
    def dim(self) -> int:
        return len(self.xi)

    @property
    def n(self) -> int:
        return 4 if self.dim == 6 else 3

    @property
    def angular(self) -> int:
        return 3 if self.dim == 6 else 1

    @property
    def units(self) -> np.ndarray:
        return np.eye(self.dim)

    def hat(self, xi: np.ndarray) -> np.ndarray:
        m = np.zeros((self.n, self.n))
        m[:-1, :-1] = hat(xi[:3]) if self.dim == 6 else [[0.0, -xi[0]], [xi[0], 0.0]]
        m[:-1, -1] = xi[self.angular :]
        return m

    def vee(self, m: mp.matrix) -> list:
        if self.dim == 6:
            return [m[2, 1], m[0, 2], m[1, 0], m[0, 3], m[1, 3], m[2, 3]]
        return [m[1, 0], m[0, 2], m[1, 2]]

    def mp_hat(self, xi: list) -> mp.matrix:
        total = mp.zeros(self.n)
        for x, e in zip(xi, self.units, strict=True):
            total += mp.mpf(x) * mp.matrix(self.hat(e).tolist())
        return total

    def linear(self, f: Callable, *first: np.ndarray, **options: str) -> np.ndarray:
        """The matrix of a linear map eta -> f(..., eta)."""
        return np.stack([f(*first, u, **options) for u in self.units], axis=-1)


@pytest.fixture(params=[(g, s) for g in (SE3(), SE2()) for s in SIZES], ids=lambda p: f"{type(p[0]).__name__}-{p[1]}")
def motion(request: pytest.FixtureRequest) -> Motion:
    group, label = request.param
    rng = np.random.default_rng([4, len(label)])
    xi, eta, mu, p = rng.normal(size=(4, group.dim))
    k = 3 if group.dim == 6 else 1
    xi[:k] *= SIZES[label] / np.linalg.norm(xi[:k])
    if label in ("identity", "1e-8"):
        xi[k:] *= SIZES[label]
    return Motion(group, SIZES[label], xi, eta, mu, p, group.random(rng))


def close(a: object, b: object, ulps: float = 8) -> bool:
    a, b = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    return bool(np.abs(a - b).max() <= ulps * EPS * max(1.0, np.abs(b).max()))


def floats(m: mp.matrix) -> np.ndarray:
    return np.array(m.tolist(), dtype=float)


# ---------------------------------------------------------------- exponential and Cayley maps, and their differentials


def mp_exp(x: mp.matrix) -> mp.matrix:
    total = term = mp.eye(x.rows)
    k = 0
    while k < 3 or mp.mnorm(term, 1) > mp.mpf(10) ** -50:
        k += 1
        term = term * x / k
        total = total + term
    return total


def mp_cayley(x: mp.matrix) -> mp.matrix:
    return (mp.eye(x.rows) - x / 2) ** -1 * (mp.eye(x.rows) + x / 2)


def by_definition(motion: Motion, tau: Callable, side: str = "right") -> np.ndarray:
    """The trivialised differential as a matrix: d/de tau(xi + e eta), with tau(xi)^-1 on the side named."""
    e, xi, columns = mp.mpf(10) ** -20, motion.xi.tolist(), []
    here = tau(motion.mp_hat(xi)) ** -1
    for unit in motion.units:
        plus, minus = (
            tau(motion.mp_hat([mp.mpf(x) + s * e * int(u) for x, u in zip(xi, unit, strict=True)])) for s in (1, -1)
        )
        slope = (plus - minus) / (2 * e)
        columns.append([float(c) for c in motion.vee(slope * here if side == "right" else here * slope)])
    return np.array(columns).T


AD: dict[int, list[mp.matrix]] = {}


def mp_ad(motion: Motion, xi: list) -> mp.matrix:
    """The matrix of ad, from commutators of the basis."""
    if motion.dim not in AD:
        basis = [motion.mp_hat(unit.tolist()) for unit in motion.units]
        AD[motion.dim] = [mp.matrix([motion.vee(x * y - y * x) for y in basis]).T for x in basis]
    total = mp.zeros(motion.dim)
    for x, ad in zip(xi, AD[motion.dim], strict=True):
        total += mp.mpf(x) * ad
    return total


def mp_dexp(motion: Motion, xi: list) -> mp.matrix:
    """sum_k ad^k/(k + 1)!"""
    ad = mp_ad(motion, xi)
    total = term = mp.eye(motion.dim)
    k = 1
    while k < 3 or mp.mnorm(term, 1) > mp.mpf(10) ** -50:
        k += 1
        term = term * ad / k
        total = total + term
    return total


def mp_dcayley(motion: Motion, xi: list) -> mp.matrix:
    """The inverse of eta -> (1 - x/2) eta (1 + x/2)."""
    x, one, columns = motion.mp_hat(xi), mp.eye(motion.n), []
    for unit in motion.units:
        columns.append(motion.vee((one - x / 2) * motion.mp_hat(unit.tolist()) * (one + x / 2)))
    return mp.matrix(columns).T ** -1


def mp_dcayley_adjoint(motion: Motion, xi: list) -> mp.matrix:
    """The inverse of eta -> zeta, ad_zeta = (1 - ad/2) ad_eta (1 + ad/2); a zeta of the algebra is read off ad_zeta."""
    ad, one, columns = mp_ad(motion, xi), mp.eye(motion.dim), []
    for unit in motion.units:
        m = (one - ad / 2) * mp_ad(motion, unit.tolist()) * (one + ad / 2)
        if motion.dim == 6:
            columns.append([m[2, 1], m[0, 2], m[1, 0], m[5, 1], m[3, 2], m[4, 0]])
        else:
            columns.append([m[2, 1], -m[2, 0], m[1, 0]])
    return mp.matrix(columns).T ** -1


@pytest.mark.sample(4)
@pytest.mark.parametrize("side", SIDES)
def test_dexp_and_its_relatives_by_definition(motion: Motion, side: str) -> None:
    G, xi = motion.group, motion.xi
    with mp.workdps(40):
        assert close(G.exp(xi), floats(mp_exp(motion.mp_hat(xi.tolist()))))
        D = by_definition(motion, mp_exp, side)
        inverse = floats(mp_dexp(motion, [x if side == "right" else -x for x in xi.tolist()]) ** -1)
    assert close(motion.linear(G.dexp, xi, side=side), D)
    assert close(motion.linear(G.algebra.dexp_dual, sided(xi, side)), D.T)
    assert close(motion.linear(G.dexp_inv, xi, side=side), inverse)
    assert close(motion.linear(G.algebra.dexp_inv_dual, sided(xi, side)), inverse.T)


@pytest.mark.sample(4)
@pytest.mark.parametrize("side", SIDES)
def test_dcayley_and_its_relatives_by_definition(motion: Motion, side: str) -> None:
    G, xi = motion.group, motion.xi
    with mp.workdps(40):
        assert close(G.cayley(xi), floats(mp_cayley(motion.mp_hat(xi.tolist()))))
        D = by_definition(motion, mp_cayley, side)
        inverse = floats(mp_dcayley(motion, [x if side == "right" else -x for x in xi.tolist()]) ** -1)
    assert close(motion.linear(G.algebra.dcayley, sided(xi, side)), D)
    assert close(motion.linear(G.algebra.dcayley_dual, sided(xi, side)), D.T)
    assert close(motion.linear(G.algebra.dcayley_inv, sided(xi, side)), inverse)
    assert close(motion.linear(G.algebra.dcayley_inv_dual, sided(xi, side)), inverse.T)


@pytest.mark.sample(4)
@pytest.mark.parametrize("side", SIDES)
def test_the_second_cayley_map_is_the_one_of_ad(motion: Motion, side: str) -> None:
    """Ad of cayley_adjoint(xi) is (1 - ad/2)^-1 (1 + ad/2)."""
    G, xi = motion.group, motion.xi
    g = G.by_adjoint.cayley(xi)
    with mp.workdps(40):
        wanted = floats(mp_cayley(mp_ad(motion, xi.tolist())))
        inverse = floats(mp_dcayley_adjoint(motion, [x if side == "right" else -x for x in xi.tolist()]) ** -1)
    assert close(motion.linear(G.Ad, g), wanted)
    assert close(motion.linear(G.by_adjoint.algebra.cayley_Ad_star, xi), wanted.T)
    assert close(motion.linear(G.by_adjoint.algebra.dcayley_inv, sided(xi, side)), inverse)
    assert close(motion.linear(G.by_adjoint.algebra.dcayley_inv_dual, sided(xi, side)), inverse.T)
    D = motion.linear(G.by_adjoint.algebra.dcayley, sided(xi, side))
    assert close(D @ inverse, np.eye(motion.dim), 32)
    assert close(motion.linear(G.by_adjoint.algebra.dcayley_dual, sided(xi, side)), D.T, 4)
    assert close(G.by_adjoint.cayley_inv(g), xi, 64)
    assert close(G.by_adjoint.cayley(-xi), G.inverse(g), 16)


# ---------------------------------------------------------------- one law for all groups of motions


def test_the_chart_ends_at_a_whole_turn() -> None:
    for group, k in ((lm.SO3(), 3), (SE3(), 3), (SE2(), 1)):
        rng = np.random.default_rng(2)
        for xi in rng.normal(size=(20, group.dim)):
            for angle, inside in (
                (2 * math.pi - 1e-9, True),
                (2 * math.pi, False),
                (7.0, False),
                (4 * math.pi + 1, False),
            ):
                x = xi.copy()
                x[:k] *= angle / np.linalg.norm(xi[:k])
                if inside:
                    assert group.algebra.is_exp_chart(lm.Vec(*x))
                    assert np.isfinite(group.dexp_inv(x, xi)).all()
                    continue
                for call in (group.dexp_inv, group.algebra.dexp_inv_dual):
                    with pytest.raises(lm.errors.OutsideChart, match=r"singular at a full turn.*smaller h"):
                        call(x, xi)


def test_cayley_cannot_represent_half_a_turn() -> None:
    for group, half in ((lm.SO3(), [0, math.pi, 0]), (SE3(), [0, math.pi, 0, 1, 2, 3]), (SE2(), [math.pi, 1, 2])):
        g = group.exp(np.array(half, dtype=float))
        with pytest.raises(lm.errors.OutsideChart, match="half a turn"):
            group.cayley_inv(g)
        with pytest.raises(lm.errors.OutsideChart, match="half a turn"):
            group.by_adjoint.cayley_inv(g)
        near = group.cayley_inv(group.exp(np.array(half) * (1 - 1e-9)))
        assert np.abs(near).max() == pytest.approx(4 / (math.pi * 1e-9), rel=1e-6)
