"""Whether a system is written out or goes by sites, it has the same warnings and refusals."""

from __future__ import annotations

import functools
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from terms_of_spins import Exchange

import liemech as lm
from liemech import neighbours as near
from liemech.errors import IncompatibleSystem, InvalidInput, StepWarning


@lm.record
class Drag(lm.Term):
    r: float
    begin: float = -1.0

    def covector(self, t: float, a: Any) -> lm.Vec:
        return lm.formulas.where(t > self.begin, -self.r, 0.0) * a.xi


@lm.record
class Gust(lm.Term):
    """At rest."""

    def covector(self, t: float, a: Any) -> lm.Vec:
        return lm.vec(0.0, 0.0, 0.0, lm.formulas.sin(t) * a.g[0, 0], 0.0, 0.0)


@lm.record
class Tie(lm.Term):
    def energy(self, a: Any, b: Any) -> float:
        d = a.g[:3, 3] - b.g[:3, 3]
        return lm.dot(d, d)


def outcome(run: Any) -> tuple[str, list[str]]:
    """What a call raises, and of what it warns."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        try:
            run()
            raised = ""
        except Exception as error:
            raised = type(error).__name__
    return raised, sorted({type(x.message).__name__ for x in told})


def spins(n: int, size: float = 1.0) -> tuple[Any, Any]:
    """Few are written out: up to 12 numbers."""
    system = lm.LiePoissonSystem(lm.SO3() ** n, lm.Terms(Exchange(1.0 / size).over(near.ring(n))))
    return system, system.state(mu=size * np.random.default_rng(1).normal(size=(n, 3)))


def bodies(n: int, load: Any = None) -> tuple[Any, Any]:
    body = lm.LiePoissonSystem(lm.SE3() ** n, lm.PerSite(lm.KineticEnergy([0.6, 0.8, 0.9, 1.0, 1.0, 1.0])))
    system = lm.MechanicalSystem(body, lm.Terms(Tie().over(near.chain(n))), load=load)
    g = np.tile(np.eye(4), (n, 1, 1))
    g[:, 0, 3] = np.arange(n)
    return system, system.state(mu=np.full((n, 6), 0.1), g=g)


def links(n: int) -> tuple[Any, Any]:
    chain = lm.joints.chain(n)
    return chain, chain.state(angles={0: [0.1, 0.5, 0.0]})


def free(n: int, J: float) -> tuple[Any, Any]:
    system = lm.LiePoissonSystem(lm.SO3() ** n, lm.PerSite(lm.KineticEnergy([J, J, 2.0 * J])))
    return system, system.state(mu=np.full((n, 3), J))


FINE, FRICTION = lm.RKMK(order=4), lm.KickDrift(order=4)
SITUATIONS: dict[str, Any] = {
    "small beside atol": (spins, (4, 6), (1e-10,), lm.RKMK(order=5), {"t_end": 0.5}, "", ["RuntimeWarning"]),
    "atol is given": (spins, (4, 6), (1e-10,), lm.RKMK(order=5), {"t_end": 0.5, "atol": 1e-16}, "", []),
    "friction": (bodies, (2, 4), (lm.Terms(Drag(0.5)),), FRICTION, {}, "", ["StepWarning"]),
    "friction at one site": (
        lambda n: bodies(n, lm.Terms(Drag(lm.each(np.eye(n)[-1])))), (2, 4), (), FRICTION, {}, "", ["StepWarning"]
    ),
    "friction that begins": (bodies, (2, 4), (lm.Terms(Drag(0.5, 7.0)),), FRICTION, {}, "", ["StepWarning"]),
    "friction of none": (bodies, (2, 4), (lm.Terms(Drag(0.0)),), FRICTION, {}, "", []),
    "no friction": (bodies, (2, 4), (lm.Terms(Gust()),), FRICTION, {}, "", []),
    "order 2": (bodies, (2, 4), (lm.Terms(Drag(0.5)),), lm.KickDrift(), {}, "", []),
    "lost steps of joints": (links, (2, 3), (), lm.LieRATTLE(), {"h": 1e-19}, "InvalidInput", []),
    "steps of joints": (links, (2, 3), (), lm.LieRATTLE(), {}, "", []),
    "units of floats": (free, (4, 6, 101), (1e-200,), lm.CovariantVariational(lm.Cayley()), {}, "InvalidInput", []),
    "lost beside t0": (spins, (4, 6), (), FINE, {"t0": 1e18}, "InvalidInput", []),
    "no number of steps": (spins, (4, 6), (), FINE, {"t_end": 0.015}, "InvalidInput", []),
    "backwards": (spins, (4, 6), (), FINE, {"steps": -1}, "InvalidInput", []),
    "samples elsewhere": (spins, (4, 6), (), FINE, {"t_eval": [7.0]}, "InvalidInput", []),
    "samples twice": (spins, (4, 6), (), FINE, {"t_eval": [0.0, 0.0]}, None, None),
    "no part": (spins, (4, 6), (), FINE, {"record": ["q"]}, "InvalidInput", []),
}  # fmt: skip


@pytest.mark.parametrize("name", SITUATIONS)
def test_both_layouts_warn_and_refuse(name: str) -> None:
    make, sizes, given, method, options, raised, told = SITUATIONS[name]
    found = []
    for n in sizes:
        system, start = make(n, *given)
        asked = {"compiled": False, "progress": False, **options}
        if not {"t_end", "rtol"} & {*asked}:
            asked = {"steps": 0 if isinstance(method, lm.KickDrift) else 2, **asked}
        if asked.get("atol") is None and method.order != 5:
            asked = {"h": 0.01, **asked}
        found.append(outcome(functools.partial(lm.integrate, system, method, start, **asked)))
    assert all(x == found[0] for x in found)
    if raised is not None:
        assert found[0] == (raised, told)


@pytest.mark.parametrize("n", [2, 4])
def test_steppers_warn_as_runs_do(n: int) -> None:
    system, start = bodies(n, lm.Terms(Drag(0.5)))
    with pytest.warns(StepWarning, match="of order 2 under"):
        lm.Plan(system, FRICTION, h=0.01, compiled=False).begin(start)


def test_members_are_told_once() -> None:
    system, _ = spins(6)
    start = system.state(mu=1e-10 * np.ones((3, 6, 3)))
    with pytest.warns(RuntimeWarning, match="largest number of the start") as told:
        lm.integrate(system, lm.RKMK(order=5), start, t_end=0.1, compiled=False)
    assert len(told) == 1


@pytest.mark.slow
@pytest.mark.parametrize("n", [4, 6])
@pytest.mark.parametrize("kind", ["fixed", "colours", "adaptive"])
def test_no_samples(n: int, kind: str, tmp_path: Path) -> None:
    """Of a run that keeps none all quantities are empty arrays, and the last state is there."""
    system, start = spins(n)
    method = {"fixed": FINE, "colours": lm.SublatticeSplitting(), "adaptive": lm.RKMK(order=5)}[kind]
    asked: dict[str, Any] = {"t_end": 0.1} if kind == "adaptive" else {"h": 0.05, "steps": 2}
    run = lm.integrate(system, method, start, t_eval=[], compiled=False, **asked)
    whole = lm.integrate(system, method, start, compiled=False, **asked)
    assert run.t.shape == (0,) == run.energy.shape
    assert run.mu.shape == (0, n, 3)
    assert np.array_equal(np.ravel(run.last.mu), np.ravel(whole.mu[-1]))
    assert "0" in repr(run)
    run.save(tmp_path / "run.npz")
    assert lm.Trajectory.load(tmp_path / "run.npz").mu.shape == (0, n, 3)
    with pytest.raises(InvalidInput, match="two samples"):
        run.drift()


@pytest.mark.parametrize("n", [2, 3])
def test_no_samples_of_links(n: int) -> None:
    system, start = links(n)
    run = lm.integrate(system, lm.LieRATTLE(), start, h=0.01, steps=2, t_eval=[], compiled=False)
    assert run.g.shape == (0, 16 * n)
    assert run.energy.shape == (0,)
    with pytest.raises(InvalidInput, match="two samples"):
        run.drift()


@pytest.mark.slow
def test_the_first_kind_serves_few_sites_alone() -> None:
    """Its equation is that of all sites: few are written out, beside DOP853; of more it is refused."""
    system, start = spins(5)
    mu = np.asarray(start.mu)

    def rate(_: float, y: np.ndarray) -> np.ndarray:
        m = y.reshape(5, 3)
        return np.cross(m, -np.roll(m, 1, axis=0) - np.roll(m, -1, axis=0)).ravel()

    end = solve_ivp(rate, (0.0, 0.02), mu.ravel(), method="DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
    method = lm.FirstKindHamiltonJacobi(order=2, retraction=lm.Cayley())
    run = lm.integrate(system, method, start, h=0.01, steps=2, compiled=False)
    assert np.abs(np.ravel(run.mu[-1]) - end).max() < 2e-4
    system, start = spins(200)
    with pytest.raises(IncompatibleSystem, match="one equation for all sites, and these are too many"):
        lm.integrate(system, method, start, h=0.02, steps=5, compiled=False)
    with pytest.raises(IncompatibleSystem, match="of the second kind, serves every group"):
        lm.Plan(spins(5)[0], lm.FirstKindHamiltonJacobi(), h=0.02)
