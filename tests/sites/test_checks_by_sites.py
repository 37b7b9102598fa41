"""check_method of methods of many sites: what it accepts, and that it sees faults."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import pytest
from scenes import Spring
from terms_of_spins import Exchange, Zeeman
from test_runs_by_sites import native

import liemech as lm
from liemech.formulas.classes.records import with_fields

N = 3


def start() -> Any:
    mu = np.random.default_rng(7).normal(size=(N, 3))
    return spins().state(mu=mu / np.linalg.norm(mu, axis=1)[:, None])


def spins(held: tuple[int, ...] = ()) -> Any:
    return lm.LiePoissonSystem(lm.SO3() ** N, lm.Terms(Exchange(1.0).over(lm.neighbours.ring(N)), held=held))


@lm.record
class Claiming(lm.SublatticeSplitting):
    """It says of itself that it is symplectic."""

    symplectic: ClassVar[bool] = True


@lm.record
class Leaking(lm.BondSplitting):
    """The last of the sites grows."""

    def step(self, system: Any, t: float, memory: Any, h: float) -> Any:
        new = super().step(system, t, memory, h)
        state, left = new.node
        x = [*state.mu]
        grown = lm.vec(*x[:-3], *[y * (1.0 + 1e-8) for y in x[-3:]])
        return with_fields(new, node=(with_fields(state, mu=grown), left))


@lm.record
class Quartic(lm.Term):
    """A cubic anisotropy, which no turn leaves as it is."""

    K: float

    def energy(self, a: Any) -> float:
        return self.K * sum([x**4 for x in a.mu])


@lm.record
class Late(lm.BondSplitting):
    """The motion of another time step."""

    def step(self, system: Any, t: float, memory: Any, h: float) -> Any:
        return super().step(system, t, memory, h * (1.0 + 1e-3 * h))


@lm.record
class Pushed(lm.BondSplitting):
    """The first site is turned about x a little more, before and after: Casimirs stay."""

    def step(self, system: Any, t: float, memory: Any, h: float) -> Any:
        pushed = super().step(system, t, self._turned(memory, h), h)
        return self._turned(pushed, h)

    def _turned(self, memory: Any, h: float) -> Any:
        state, left = memory.node
        x = lm.SO3().exp(lm.vec(1e-7 * h, 0.0, 0.0)) @ lm.vec(*[*state.mu][:3])
        return with_fields(memory, node=(with_fields(state, mu=lm.vec(*x, *[*state.mu][3:])), left))


KEEPS = ("total momentum",)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "law"),
    [(Pushed(), "total momentum"), (Claiming(), "Poisson"), (Leaking(), f"Casimir {N}"), (Late(), "symmetric")],
    ids=["momentum", "form", "Casimir", "symmetry"],
)
def test_faults_are_seen(method: Any, law: str) -> None:
    keeps = KEEPS if law in KEEPS else ()
    report = lm.check_method(method, spins(), start(), keeps=keeps, raises=False)
    assert law in [f.law for f in report.findings if f.verdict == "broken"]


@pytest.mark.slow
@native
def test_total_momentum_is_that_of_a_symmetry() -> None:
    """Of all turns of all sites, about one axis, or of none; and kept by methods as they say."""
    ring = lm.neighbours.ring(N)
    rng = np.random.default_rng(3)
    axis = np.array([0.6, 0.0, 0.8])
    fields = Exchange(1.0).over(ring), Zeeman(0.3 * axis)
    for n, more in ((N, ()), (5, ()), (N, (Quartic(0.2),))):
        terms = Exchange(1.0).over(lm.neighbours.ring(n)), *more
        system = lm.LiePoissonSystem(lm.SO3() ** n, lm.Terms(*terms))
        mu = rng.normal(size=(n, 3))
        run = lm.integrate(system, lm.RKMK(order=8), system.state(mu=mu), h=0.01, steps=10)
        names = [name for name in run.drift() if "total" in name]
        assert names == ([] if more else ["total momentum"])
        assert np.ptp(run.mu.sum(axis=1), axis=0).max() < 1e-13 or more
    system = lm.LiePoissonSystem(lm.SO3() ** N, lm.Terms(*fields))
    run = lm.integrate(system, lm.BondSplitting(), start(), h=0.1, steps=10)
    (kept,) = [one for one in run.drift().kept if "total" in one.name]
    assert kept.name == "total momentum along (0.6, 0, 0.8)"
    assert kept.largest < 1e-14
    along = run.mu.sum(axis=1)
    assert np.ptp(along @ axis) < 1e-14 < 1e-3 < np.ptp(along[:, 0])
    for method, verdict in ((lm.BondSplitting(), "holds"), (lm.SphericalMidpoint(), "holds")):
        report = lm.check_method(method, spins(), start(), keeps=KEEPS, native=False)
        assert report["total momentum"].verdict == verdict
    seen = lm.check_method(lm.SublatticeSplitting(), spins(), start(), native=False)
    assert seen["total momentum"].verdict == "not seen"


@pytest.mark.slow
@native
@pytest.mark.parametrize("fixed", [(), (0,)], ids=["all move", "one is held"])
def test_methods_of_single_sites(fixed: tuple[int, ...]) -> None:
    """Of methods that take no system of all sites as one body, too; a held one is a number in the bracket of the others."""
    report = lm.check_method(lm.SphericalMidpoint(), spins(fixed), start())
    held = {f.law for f in report.findings if f.verdict == "holds"}
    assert {"order", "symmetric", "Poisson", *[f"Casimir {k + 1}" for k in range(N)]} <= held


@native
@pytest.mark.slow
def test_molecules_at_rest() -> None:
    water = lm.models.SPC()
    bodies = lm.LiePoissonSystem(lm.SE3() ** 2, lm.PerSite(water.kinetic_energy))
    drop = lm.MechanicalSystem(bodies, lm.Terms(water.over(lm.neighbours.all_pairs())))
    g = np.stack([np.eye(4)] * 2)
    g[1, :3, 3] = [0.0, 0.4, 3.1]
    report = lm.check_method(lm.KickDrift(order=4), drop, drop.state(mu=np.zeros((2, 6)), g=g), raises=False)
    assert not [f.law for f in report.findings if f.verdict == "broken"]


@lm.record
class Pushing(Spring):
    """One whose forces have the wrong sign."""

    def force(self, group: Any, k: int, *sites: Any) -> Any:
        return self.k * (sites[k].g - sites[1 - k].g)


@lm.record
class Uneven(Spring):
    """One that pulls its ends by forces of which one is larger, where both are asked for together."""

    def forces(self, group: Any, *sites: Any) -> Any:
        force = -self.k * (sites[0].g - sites[1].g)
        return force, -1.001 * force


@pytest.mark.slow
@pytest.mark.parametrize(("term", "law"), [(Spring, ""), (Pushing, "force"), (Uneven, "ends")])
def test_faults_of_terms_are_seen(term: Any, law: str) -> None:
    """Of the forces on each end, and of those on both that runs of many sites ask for."""
    free = lm.LiePoissonSystem(lm.VectorSpace(3) ** N, lm.PerSite(lm.KineticEnergy([1.0, 2.0, 3.0])))
    chain = lm.MechanicalSystem(free, lm.Terms(term(1.0).over(lm.neighbours.chain(N))))
    mu, g = np.random.default_rng(7).normal(size=(2, N, 3))
    report = lm.check_system(chain, chain.state(mu=mu, g=g), raises=False)
    assert [f.law for f in report.findings if f.verdict == "broken"][:1] == [law][: len(law)]
