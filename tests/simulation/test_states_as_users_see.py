"""States inside of runs, at their ends and at zeros of events have one layout, whatever carries them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import liemech as lm

J = np.linspace(1.0, 2.0, 6)


@lm.record
class Pull(lm.Term):
    """Two bodies that pull at each other."""

    k: float

    def energy(self, a: Any, b: Any) -> float:
        return 0.5 * self.k * lm.dot(a.mu, b.mu)


@lm.record
class Wound(lm.CotangentSystem):
    """Bodies whose momenta see their elements."""

    configurations: lm.LieGroup

    def energy(self, mu: Any, g: Any) -> float:
        return 0.5 * lm.dot(mu, mu) + 0.1 * self.configurations.site(g, 0)[0, 3] * mu[1]


def free(sites: int) -> lm.LiePoissonSystem:
    return lm.LiePoissonSystem(lm.SE3() ** sites, lm.PerSite(lm.KineticEnergy(J)))


def pulled(sites: int) -> lm.LiePoissonSystem:
    pairs = lm.neighbours.edges([(k, k + 1) for k in range(sites - 1)])
    return lm.LiePoissonSystem(lm.SE3() ** sites, lm.Terms(lm.PerSite(lm.KineticEnergy(J)), Pull(0.3).over(pairs)))


def in_field(sites: int) -> lm.MechanicalSystem:
    return lm.MechanicalSystem(free(sites), lm.NoPotential())


def wound(sites: int) -> lm.CotangentSystem:
    return Wound(lm.SE3() ** sites)


def halfway(t: float, state: Any) -> float:
    return t - 0.123


def ends(t: float, state: Any) -> float:
    return t - 0.35


ends.terminal = 1  # type: ignore[attr-defined]

FIXED: dict[str, Any] = {"method": lm.RKMK(order=4), "h": 0.1, "steps": 4}
ADAPTIVE: dict[str, Any] = {"method": lm.RKMK(order=5), "rtol": 1e-2, "t_end": 0.4, "dense": True}


def start_of(system: Any, sites: int, members: int | None) -> Any:
    shape = (sites, 6) if members is None else (members, sites, 6)
    mu = np.sin(1.0 + np.arange(np.prod(shape))).reshape(shape)
    return system.state(mu=mu, g=np.broadcast_to(np.eye(4), (*shape[:-1], 4, 4)))


@pytest.mark.parametrize("events", [(halfway,), (halfway, ends)], ids=["whole", "ended"])
@pytest.mark.parametrize("members", [None, 2], ids=["one", "ensemble"])
@pytest.mark.parametrize("how", [FIXED, ADAPTIVE], ids=["fixed", "adaptive"])
@pytest.mark.parametrize("make", [free, pulled, in_field, wound])
@pytest.mark.parametrize("sites", [1, 2])
def test_layout(make: Any, sites: int, how: Any, members: int | None, events: Any, tmp_path: Path) -> None:
    system = make(sites)
    options = {"compiled": False, "events": events} | how
    run = lm.integrate(system, start=start_of(system, sites, members), **options)
    last, t = run.last.arrays, run.t if run.t.ndim == 1 else run.t[:, 0]
    lead = () if members is None else (members,)
    assert {name: x.shape for name, x in last.items()} == {"mu": (*lead, sites, 6), "g": (*lead, sites, 4, 4)}
    at_end, at_times = run.at(t[-1]).arrays, run.at(t[:2]).arrays
    inside = run.at(0.123).arrays
    run.save(tmp_path / "run.npz")
    for one in (run, lm.Trajectory.load(tmp_path / "run.npz")):
        zeros = one.events[0] if members is None else one.events[0][0]
        for name, x in last.items():
            assert np.array_equal(at_end[name], x)
            assert np.array_equal(at_times[name], getattr(one, name)[:2])
            met = zeros[1].arrays[name]
            assert met.shape == (1, *x.shape[len(lead) :])
            assert np.abs(met[0] - (inside[name] if members is None else inside[name][0])).max() < 1e-12
    observed = lm.integrate(system, start=start_of(system, sites, members), record=["mu", "g"], **options, t_eval=[])
    assert {name: x.shape for name, x in observed.last.arrays.items()} == {name: x.shape for name, x in last.items()}
