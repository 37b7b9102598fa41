"""Runs of systems of many sites, site by site: what a user sees of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from terms_of_spins import Exchange, Zeeman

import liemech as lm
from liemech.compiler import kernel
from liemech.errors import IncompatibleSystem, InvalidInput, NotCompiledWarning, NotFinite
from liemech.rooms.sites.runs import execution, samples
from liemech.rooms.sites.runs import run as run_of_sites
from liemech.systems.lie_poisson import BodyState

N = 40
native = pytest.mark.skipif(kernel.available() is not None, reason="needs llvmlite")


@lm.record
class Tie(lm.Term):
    k: float

    def energy(self, a: Any, b: Any) -> float:
        return -self.k * lm.sum([lm.dot(a.g[i], b.g[i]) for i in range(3)])


def spins(n: int = N) -> Any:
    terms = Exchange(1.0).over(lm.neighbours.ring(n)), Zeeman([0.0, 0.0, 0.1])
    return lm.LiePoissonSystem(lm.SO3() ** n, lm.Terms(*terms))


def directions(n: int = N) -> np.ndarray:
    s = np.random.default_rng(1).normal(size=(n, 3)) * 0.3 + [0.0, 0.0, 1.0]
    return s / np.linalg.norm(s, axis=1)[:, None]


def chain(n: int = N) -> tuple[Any, Any]:
    bodies = lm.LiePoissonSystem(lm.SO3() ** n, lm.PerSite(lm.KineticEnergy([1.0, 1.5, 2.0])))
    system = lm.MechanicalSystem(bodies, lm.Terms(Tie(0.7).over(lm.neighbours.ring(n))))
    turned = np.asarray(lm.SO3().exp(np.random.default_rng(3).normal(size=(n, 3))))
    return system, system.state(mu=directions(n), g=turned)


@pytest.fixture(scope="module")
def plan() -> Any:
    return lm.Plan(spins(), lm.RKMK(order=4), h=0.05, every=10)


@pytest.fixture(scope="module")
def run(plan: Any) -> Any:
    return plan.run(plan.system.state(mu=directions()), steps=57)


@pytest.mark.parametrize("every", [1, 3])
def test_few_samples_at_once(every: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """The samples are there however few the driver writes before Python looks."""
    plan = lm.Plan(spins(8), lm.SublatticeSplitting(), h=0.05, every=every, progress=False, compiled=False)
    start = plan.system.state(mu=directions(8))
    whole = plan.run(start, steps=7)
    monkeypatch.setattr(samples, "MOST", 2)
    monkeypatch.setattr(run_of_sites, "PATIENCE", 1e3)
    by_parts = plan.run(start, steps=7)
    assert np.array_equal(by_parts.t, whole.t) and np.array_equal(by_parts.mu, whole.mu)


@pytest.mark.slow
def test_samples(run: Any) -> None:
    assert run.mu.shape == (7, N, 3)
    assert np.allclose(run.t, [0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 2.85], rtol=1e-15)
    assert np.array_equal(run.mu[0], directions())
    assert np.array_equal(run.last.mu, run.mu[-1])
    assert np.abs(np.linalg.norm(run.mu, axis=2) - 1.0).max() < 1e-14


def test_checkpoint(plan: Any, run: Any, tmp_path: Path) -> None:
    file = tmp_path / "kept.npz"
    whole = plan.run(plan.system.state(mu=directions()), steps=57, checkpoint=file, checkpoint_every="25 steps")
    assert np.array_equal(whole.mu, run.mu)
    kept = lm.Trajectory.load(file)
    assert kept.steps == 50
    assert np.array_equal(plan.resume(kept, steps=7).mu[-1], run.mu[-1])


@pytest.mark.slow
def test_quantities(run: Any) -> None:
    found = lm.integrate(
        spins(), lm.RKMK(order=4), spins().state(mu=directions()), h=0.05, steps=57, every=10,
        record=("energy", ("spin", lambda t, site: site.mu)),
    )  # fmt: skip
    assert not hasattr(found, "mu")
    assert np.allclose(found.spin, run.mu.sum(axis=1), rtol=0.0, atol=1e-13)
    s = run.mu
    by_hand = -(s * np.roll(s, 1, axis=1)).sum(axis=(1, 2)) - 0.1 * s[:, :, 2].sum(axis=1)
    assert np.allclose(found.energy, by_hand, rtol=1e-14)
    assert np.array_equal(found.energy, run.energy)
    along = "total momentum along (0, 0, 1)"  # the axis of the field
    assert {kept.name for kept in run.drift().kept} == {"energy", "Casimir 1", along}
    assert run.drift()["Casimir 1"].largest < 1e-14


def test_attitude_that_is_not_recorded() -> None:
    turned = np.broadcast_to(np.eye(3), (N, 3, 3))
    start = spins().state(mu=directions(), g=turned)
    assert lm.integrate(spins(), lm.RKMK(order=1), start, h=0.05, steps=2).g.shape == (3, N, 3, 3)
    left_out = lm.integrate(spins(), lm.RKMK(order=1), start, h=0.05, steps=2, record=("mu",))
    assert left_out.g is None


@pytest.mark.parametrize("compiled", [None, False])
def test_a_site_that_fails(compiled: Any) -> None:
    mu = directions()
    mu[17] *= 1e200
    with pytest.raises(NotFinite, match="site 13, step 1 of 30, t = 0") as caught:  # four edges away
        lm.integrate(spins(), lm.RKMK(order=4), spins().state(mu=mu), h=0.05, steps=30, compiled=compiled)
    assert caught.value.trajectory.mu.shape == (1, N, 3)


def test_a_site_that_fails_among_colours() -> None:
    """The site that overflowed is told, or a neighbour of it, and of which member."""
    mu = np.stack([directions(), directions()])
    mu[1, 17] *= 1e200
    system = spins()
    with pytest.raises(NotFinite, match=r"\[site 1[67], after step 0") as caught:
        lm.integrate(system, lm.SublatticeSplitting(), system.state(mu=mu[1]), h=0.05, steps=30)
    assert caught.value.trajectory.mu.shape == (1, N, 3)
    with pytest.warns(RuntimeWarning, match=r"member 1 after 0 steps.*\[site 1[67]"):
        both = lm.integrate(system, lm.SublatticeSplitting(), system.state(mu=mu), h=0.05, steps=3)
    alone = lm.integrate(system, lm.SublatticeSplitting(), system.state(mu=mu[0]), h=0.05, steps=3)
    assert np.array_equal(both.mu[:, 0], alone.mu)


@pytest.mark.slow
@native
def test_functions_of_all_sites_beside_those_of_one() -> None:
    """Few sites go by sites, too, where something is of one of them."""
    wanted: Any = [("first", lambda t, state: state.mu[0]), ("spin", lambda t, site: site.mu)]
    system = spins(9)
    plan = lm.Plan(system, lm.RKMK(order=4), h=0.05, every=4, compiled=False)
    run = plan.run(system.state(mu=directions(9)), steps=8)
    found = plan.replace(record=wanted).run(system.state(mu=directions(9)), steps=8)
    assert np.array_equal(found.first, run.mu[:, 0, 0])
    assert np.allclose(found.spin, run.mu.sum(axis=1), rtol=0.0, atol=1e-14)


@pytest.mark.slow
def test_functions_of_all_sites() -> None:
    """Of more sites than are written out they are computed sample by sample, in plain Python."""
    n = 120
    system, start = spins(n), spins(n).state(mu=directions(n))

    def winding(t: float, state: Any) -> float:
        m = np.array(state.mu).reshape(-1, 3)
        turns = np.arctan2(np.roll(m[:, 1], 1) * m[:, 0] - np.roll(m[:, 0], 1) * m[:, 1], 1.0)
        return t + float(turns.sum())

    def ends(t: float, state: Any) -> Any:
        return lm.vec(state.mu[0], state.mu[3 * n - 1])

    wanted: Any = [("winding", winding), ("ends", ends), ("spin", lambda t, site: site.mu)]
    for method in (lm.RKMK(order=4), lm.SublatticeSplitting()):
        for times in (None, [0.0, 0.07, 0.4]):
            plan = lm.Plan(system, method, h=0.05, every=4)
            run = plan.run(start, steps=8, t_eval=times)
            found = plan.replace(record=wanted).run(start, steps=8, t_eval=times)
            by_hand = [winding(t, BodyState(x.ravel())) for t, x in zip(run.t, run.mu)]
            assert np.array_equal(found.winding, by_hand)
            assert np.array_equal(found.ends, run.mu.reshape(len(run.t), -1)[:, [0, -1]])
            assert np.allclose(found.spin, run.mu.sum(axis=1), rtol=0.0, atol=1e-13)
            assert "mu" not in found.states
    plan = lm.Plan(system, lm.RKMK(order=4), h=0.05, every=4, record=["mu", *wanted])
    half = plan.run(start, steps=4)
    assert half.mu.shape == (2, n, 3)
    assert half.then(plan.resume(half, steps=4)).winding.shape == (3,)

    def failing(t: float, state: Any) -> float:
        return 1.0 / (0.4 - t)

    with pytest.raises(NotFinite, match=r"in failing\(t, state\) at t = 0.4") as caught:
        plan.replace(record=[("failing", failing)]).run(start, steps=12)
    assert caught.value.trajectory.failing.shape == (2,)


@pytest.mark.parametrize("n", [3, 101])
def test_methods_of_the_system_are_recorded_of_all_sites(n: int, tmp_path: Path) -> None:
    """By their names, written out or site by site, at every sample: sums over the sites were kept of many."""
    start, way = spins(n).state(mu=directions(n)), {"h": 0.05, "steps": 2, "compiled": False}
    run = lm.integrate(spins(n), lm.RKMK(order=1), start, record=["mu", "velocity", "casimirs", "energy"], **way)
    neighbours = np.roll(run.mu, 1, axis=1) + np.roll(run.mu, -1, axis=1)
    assert np.allclose(run.velocity, -neighbours - [0.0, 0.0, 0.1], rtol=1e-14)
    assert np.allclose(run.casimirs, (run.mu**2).sum(axis=-1), rtol=1e-14)
    assert np.allclose(run.energy, (run.velocity * run.mu).sum(axis=(1, 2)) / 2 - 0.05 * run.mu[..., 2].sum(axis=1))
    run.save(tmp_path / "run.npz")
    assert np.array_equal(lm.Trajectory.load(tmp_path / "run.npz").velocity, run.velocity)


def test_what_large_systems_do_not_have() -> None:
    system = spins(200)
    start = system.state(mu=directions(200))
    with pytest.raises(IncompatibleSystem, match="no derivative by h"):
        lm.Plan(system, lm.RKMK(order=1), h=0.05).tangent(start, steps=1, by="h")


@native
def test_many_sites() -> None:
    """A hundred thousand spins: two samples, and no list of as many objects."""
    n = 100_000
    system = spins(n)
    found = lm.integrate(system, lm.RKMK(order=1), system.state(mu=directions(n)), h=0.05, steps=4, every=4)
    assert found.mu.shape == (2, n, 3)
    assert np.abs(np.linalg.norm(found.mu[-1], axis=1) - 1.0).max() < 1e-14


@pytest.mark.slow
@native
def test_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("liemech.compiler.sites.site_calls.SHARE", 2**11)
    n = 7000
    system = spins(n)
    start, way = system.state(mu=directions(n)), {"h": 0.05, "steps": 3, "every": 3}
    for method in (lm.RKMK(order=2), lm.RKMK(tableau=lm.tableaus.gauss(1))):
        one, *more = [lm.integrate(system, method, start, workers=w, **way).mu for w in (1, 2, 3)]
        assert all(np.array_equal(x, one) for x in more)
    mu = directions(n)
    mu[5000] *= 1e200
    with pytest.raises(NotFinite, match="site 4998"):
        lm.integrate(system, lm.RKMK(order=2), system.state(mu=mu), workers=2, **way)


@native
def test_a_loop_of_single_steps_becomes_native(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each call is too short to be worth native code, all of them are not."""
    monkeypatch.setattr(execution, "WORTH", 10**6)
    for name in ("known", "stored"):
        monkeypatch.setattr(kernel, name, lambda *call, lanes: None)
    for seconds in (1e9, 1e-9):
        monkeypatch.setattr(execution, "WAIT", seconds)
        body = lm.Plan(spins(), lm.RKMK(order=4), h=0.05).stepper(spins().state(mu=directions()))
        for _ in range(3):
            body.step()
        assert body._here.compiled is (seconds < 1.0)


@lm.record
class Listed(lm.Term):
    def energy(self, a: Any, b: Any) -> float:
        return -lm.dot(a.mu, b.mu) * len({"no set": 1.0}.keys() | {"no set"})


@native
def test_a_loop_of_single_steps_that_cannot_be_native_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(execution, "WAIT", 1e-9)
    monkeypatch.setattr(execution, "WORTH", 10**6)
    system = lm.LiePoissonSystem(lm.SO3() ** N, lm.Terms(Listed().over(lm.neighbours.ring(N))))
    body = lm.Plan(system, lm.RKMK(order=2), h=0.05).stepper(system.state(mu=directions()))
    with pytest.warns(NotCompiledWarning, match="Running in plain Python"):
        for _ in range(3):
            body.step()
    assert body.steps == 3


def test_stepper_before_a_step_that_fails() -> None:
    mu = directions()
    mu[17] *= 1e200
    body = lm.Plan(spins(), lm.RKMK(order=4), h=0.05).stepper(spins().state(mu=mu))
    for _ in range(2):
        with pytest.raises(NotFinite, match="site 13, step 1"):
            body.step(3)
        assert body.steps == 0
        assert np.array_equal(body.mu, mu)


@pytest.mark.parametrize("method", [lm.RKMK(order=4), lm.SublatticeSplitting(order=2)], ids=repr)
def test_chosen_sites(method: Any, tmp_path: Path) -> None:
    """Of a run of many sites some are kept, and totals of all."""
    start, way = spins().state(mu=directions()), {"h": 0.05, "steps": 57, "every": 10}
    whole = lm.integrate(spins(), method, start, **way)
    some = lm.integrate(spins(), method, start, record=[("mu", [39, 0, 7]), "energy"], **way)
    assert some.mu.shape == (7, 3, 3)
    assert np.array_equal(some.mu, whole.mu[:, [39, 0, 7]])
    assert np.allclose(some.energy, whole.energy, rtol=1e-14)
    assert np.array_equal(some.last.mu, whole.last.mu)
    some.save(tmp_path / "some.npz")
    assert np.array_equal(lm.Trajectory.load(tmp_path / "some.npz").mu, some.mu)
    with pytest.raises(InvalidInput, match="there is no site 40; the sites are 0 to 39"):
        lm.Plan(spins(), method, h=0.1, record=[("mu", [40])])
    with pytest.raises(InvalidInput, match="names sites"):
        lm.Plan(lm.RigidBody([1.0, 1.5, 2.0]), lm.RKMK(), h=0.1, record=[("mu", [1])])


def test_chosen_sites_of_a_system_that_is_written_out() -> None:
    start, way = spins(6).state(mu=directions(6)), {"h": 0.05, "steps": 4}
    whole = lm.integrate(spins(6), lm.RKMK(order=4), start, **way)
    some = lm.integrate(spins(6), lm.RKMK(order=4), start, record=[("mu", [5, 2])], **way)
    assert np.array_equal(some.mu, whole.mu.reshape(5, 6, 3)[:, [5, 2]])


def test_a_member_that_fails_does_not_end_the_others() -> None:
    mu = np.stack([directions(), directions(), directions()[::-1]])
    mu[1, 17] *= 1e200
    with pytest.warns(RuntimeWarning, match="1 of 3 members stopped early, the first is member 1"):
        run = lm.integrate(spins(), lm.RKMK(order=4), spins().state(mu=mu), h=0.05, steps=20)
    alone = lm.integrate(spins(), lm.RKMK(order=4), spins().state(mu=mu[2]), h=0.05, steps=20)
    assert np.array_equal(run.mu[:, 2], alone.mu)
    assert np.array_equal(run.mu[:, 1], np.broadcast_to(mu[1], (21, N, 3)))
    assert run.t.shape == (21,)
    assert run.stopped.steps == {1: 0}
    assert isinstance(run.stopped[1].error, NotFinite)
