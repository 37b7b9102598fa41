"""Sites on any group of small dimension, by methods of every kind: by sites as written out."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import shipped

import liemech as lm
from liemech.compiler import kernel

native = pytest.mark.skipif(kernel.available() is not None, reason="needs llvmlite")
SITES = 3


@lm.record
class Rotations(lm.SO3):
    """A user's subclass."""


@lm.record
class Momenta(lm.Term):
    k: float

    def energy(self, a: Any, b: Any) -> float:
        return self.k * lm.dot(a.mu, b.mu)


@lm.record
class Tie(lm.Term):
    """The distance of two elements as arrays of numbers."""

    k: float

    def energy(self, a: Any, b: Any) -> float:
        return self.k * square(a.g, b.g)


def square(g: Any, h: Any) -> Any:
    if not isinstance(g, lm.Mat):
        return lm.dot(g - h, g - h)
    if not isinstance(g[0, 0], lm.formulas.Complex):
        return lm.sum([lm.dot(x - y, x - y) for x, y in zip(g, h)])
    apart = [x - y for row, other in zip(g, h) for x, y in zip(row, other)]
    return lm.sum([x.re * x.re + x.im * x.im for x in apart])


GROUPS = (*shipped.RIGID, lm.SU(2), lm.MatrixLieGroup.of(shipped.PLANE), Rotations(), shipped.COMPOSED[0])
FREE = (
    lm.RKMK(order=2), lm.RKMK(order=3, retraction=lm.Cayley()), lm.CommutatorFree(), lm.CrouchGrossman(3),
)  # fmt: skip


def numbers(group: Any) -> tuple[Any, np.ndarray, np.ndarray]:
    """The energies of the sites, momenta and elements."""
    rng, inertia = np.random.default_rng(0), np.linspace(1.0, 2.0, group.dim)
    if isinstance(group, (lm.SE3, lm.ProductGroup)):
        inertia[3:] = 1.0
    kinetic = lm.PerSite(lm.KineticEnergy(inertia))
    return kinetic, 0.3 * rng.normal(size=(SITES, group.dim)), group.random(rng, SITES)


def both(monkeypatch: Any, made: Any, method: Any, **options: Any) -> list[list[np.ndarray]]:
    """The run written out, and by sites."""
    found = []
    for small in (10**6, 0):
        monkeypatch.setattr(lm.System, "small", small)
        system, start = made()
        options = {"h": 0.05, "steps": 2, "compiled": False} | options
        run = lm.integrate(system, method, start, **options)
        found.append([x for x in (run.mu, run.g) if x is not None])
    return found


def free(group: Any, attitudes: bool) -> tuple[Any, Any]:
    kinetic, mu, g = numbers(group)
    ring = lm.neighbours.ring(SITES)
    system = lm.LiePoissonSystem(group**SITES, lm.Terms(kinetic, Momenta(0.1).over(ring)))
    return system, system.state(mu=mu, g=g if attitudes else None)


def tied(group: Any) -> tuple[Any, Any]:
    kinetic, mu, g = numbers(group)
    body = lm.LiePoissonSystem(group**SITES, kinetic)
    system = lm.MechanicalSystem(body, lm.Terms(Tie(0.2).over(lm.neighbours.ring(SITES))))
    return system, system.state(mu=mu, g=g)


@pytest.mark.sample(12)
@pytest.mark.parametrize("attitudes", [False, True])
@pytest.mark.parametrize("method", FREE, ids=repr)
@pytest.mark.parametrize("group", GROUPS, ids=repr)
def test_free(group: Any, method: Any, attitudes: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    if isinstance(getattr(method, "retraction", None), lm.Cayley) and group.why_no_cayley():
        pytest.skip("no Cayley map")
    whole, sites = both(monkeypatch, lambda: free(group, attitudes), method)
    assert len(whole) == len(sites) == 1 + attitudes
    assert all(np.array_equal(x, y) for x, y in zip(whole, sites))


@pytest.mark.parametrize("group", GROUPS, ids=repr)
def test_in_a_field(group: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Newton's method of one site, or of all at once: the same to rounding."""
    whole, sites = both(monkeypatch, lambda: tied(group), lm.LieVerlet())
    assert all(np.abs(x - y).max() < 1e-15 for x, y in zip(whole, sites))


@pytest.mark.slow
@pytest.mark.parametrize("group", [lm.SO3(), lm.UnitQuaternions(), lm.VectorSpace(3), lm.SE3()], ids=repr)
def test_kicks(group: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    for order in (2, 6):
        whole, sites = both(monkeypatch, lambda: tied(group), lm.KickDrift(order=order))
        assert all(np.array_equal(x, y) for x, y in zip(whole, sites))


@pytest.mark.parametrize(
    "options", [{"compensated": True}, {"compensated": False}, {"precision": "double-double"}], ids=str
)
@pytest.mark.parametrize("several", [False, True])
def test_precision(several: bool, options: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def made() -> tuple[Any, Any]:
        if not several:
            return free(lm.SO3(), True)
        parts = [numbers(group) for group in (lm.SO3(), lm.VectorSpace(2))]
        terms = [kinetic.over(of=k) for k, (kinetic, _, _) in enumerate(parts)]
        near = Momenta(0.1).over(lm.neighbours.ring(SITES), of=0)
        group = lm.SO3() ** SITES * lm.VectorSpace(2) ** SITES
        system = lm.LiePoissonSystem(group, lm.Terms(*terms, near))
        return system, system.state(mu=[p[1] for p in parts], g=[p[2] for p in parts])

    whole, sites = both(monkeypatch, made, lm.RKMK(order=2), **options)
    for a, b in zip(whole, sites):
        pairs = zip(a, b) if several else [(a, b)]
        assert all(np.array_equal(x, y) for x, y in pairs)


@native
@pytest.mark.slow
@pytest.mark.parametrize("options", [{}, {"precision": "double-double"}], ids=str)
@pytest.mark.parametrize("group", GROUPS, ids=repr)
def test_native_bits(group: Any, options: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    if options and isinstance(group, (lm.MatrixLieGroup, lm.SGal3)):
        pytest.skip("its exponential is one of doubles")
    plain = both(monkeypatch, lambda: free(group, True), lm.RKMK(order=2), **options)[1]
    fast = both(monkeypatch, lambda: free(group, True), lm.RKMK(order=2), compiled=True, **options)
    assert all(np.array_equal(x, y) for x, y in zip(plain, fast[1]))
