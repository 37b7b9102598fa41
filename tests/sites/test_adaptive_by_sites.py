"""Adaptive steps of systems of many sites: one step for all of them, by the error of all."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from test_runs_by_sites import directions, native, spins

import liemech as lm
from liemech.errors import InvalidInput, StepTooSmall

N = 40


def exact(n: int, times: Any) -> np.ndarray:
    """SciPy's, of the ring of spins, (times, n, 3)."""

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        m = y.reshape(n, 3)
        xi = -np.roll(m, 1, axis=0) - np.roll(m, -1, axis=0) - [0.0, 0.0, 0.1]
        return np.cross(m, xi).ravel()

    span, start = (0.0, max(times, key=abs)), directions(n).ravel()
    found = solve_ivp(rate, span, start, "DOP853", rtol=1e-12, atol=1e-12, dense_output=True)
    return np.array([found.sol(t).reshape(n, 3) for t in times])


def adaptive(n: int = N, order: int = 5, rtol: float = 1e-7, atol: float = 1e-10, **options: Any) -> Any:
    return lm.Plan(spins(n), lm.RKMK(order=order), rtol=rtol, atol=atol, **options)


def run(n: int = N, t_end: float = 1.0, t_eval: Any = None, **options: Any) -> Any:
    return adaptive(n, **options).run(spins(n).state(mu=directions(n)), t_end=t_end, t_eval=t_eval)


@pytest.mark.slow
@native
@pytest.mark.parametrize("t_end", [1.0, -1.0])
def test_against_scipy(t_end: float) -> None:
    times = np.linspace(0.0, t_end, 4)
    found = run(60, t_end, times, compiled=True)
    assert found.compiled
    assert np.array_equal(found.t, times)
    assert found.mu.shape == (4, 60, 3)
    assert np.abs(found.mu - exact(60, times)).max() < 2e-8
    assert np.abs(np.linalg.norm(found.mu, axis=2) - 1.0).max() < 1e-14


@pytest.mark.slow
@native
def test_order_of_the_steps() -> None:
    """The error goes with the tolerance, the number of steps with its fifth root."""
    runs = [run(60, 8.0, rtol=rtol, atol=rtol) for rtol in (1e-6, 1e-11)]
    assert 7.0 < runs[1].steps / runs[0].steps < 14.0
    assert [len(one) for one in runs] == [2, 2]  # start and end


@pytest.mark.parametrize("n", [1, 2, 3])
def test_few_sites(monkeypatch: pytest.MonkeyPatch, n: int) -> None:
    zeeman = lm.LiePoissonSystem(lm.SO3() ** n, spins(n).hamiltonian) if n > 2 else None
    if zeeman is None:
        lone = lm.Terms(Tilt(1.0))
        zeeman = lm.LiePoissonSystem(lm.SO3() ** n, lone)
    monkeypatch.setattr(lm.System, "small", 0)
    plan = lm.Plan(zeeman, lm.RKMK(order=5), rtol=1e-8, compiled=False)
    found = plan.run(zeeman.state(mu=directions(n)), t_end=0.3)
    monkeypatch.setattr(lm.System, "small", 1000)
    whole = lm.Plan(zeeman, lm.RKMK(order=5), rtol=1e-8, compiled=False)
    other = whole.run(zeeman.state(mu=directions(n)), t_end=0.3, t_eval=[0.0, 0.3])
    assert np.abs(found.mu - other.mu).max() < 1e-14


@lm.record
class Tilt(lm.Term):
    k: float

    def energy(self, a: Any) -> float:
        return self.k * a.mu[2] * a.mu[0]


@pytest.mark.slow
@native
def test_bits(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of plain Python, natively, and with any number of workers; of times that nobody asked for."""
    monkeypatch.setattr("liemech.compiler.sites.site_calls.SHARE", 2**11)
    times = [0.013, 0.04]
    plain, quick = (run(17, 0.04, times, compiled=c) for c in (False, True))
    assert quick.compiled
    assert not plain.compiled
    assert np.array_equal(plain.mu, quick.mu)
    assert (plain.steps, plain.rejected) == (quick.steps, quick.rejected)
    many = [run(7000, 0.04, times, workers=w).mu for w in (1, 2, 3)]
    assert all(np.array_equal(x, many[0]) for x in many)
    assert np.array_equal(run(7000, 0.04).mu[-1], many[0][-1])


@pytest.mark.slow
@native
def test_units() -> None:
    """Steps of the same motion in units that are powers of two are the same, bit for bit."""
    spun = run(20, 1.0)
    for unit in (2.0**-40, 2.0**50):
        energy = lm.Terms(Exchanged(1.0 / unit).over(lm.neighbours.ring(20)))
        system = lm.LiePoissonSystem(lm.SO3() ** 20, energy)
        plan = lm.Plan(system, lm.RKMK(order=5), rtol=1e-7, atol=0.0)
        found = plan.run(system.state(mu=unit * directions(20)), t_end=1.0)
        one = lm.LiePoissonSystem(lm.SO3() ** 20, lm.Terms(Exchanged(1.0).over(lm.neighbours.ring(20))))
        same = lm.Plan(one, lm.RKMK(order=5), rtol=1e-7, atol=0.0)
        other = same.run(one.state(mu=directions(20)), t_end=1.0)
        assert np.array_equal(found.mu, unit * other.mu)
    assert spun.steps > 3


@lm.record
class Exchanged(lm.Term):
    J: float

    def energy(self, a: Any, b: Any) -> float:
        return -self.J * lm.dot(a.mu, b.mu)


@pytest.mark.slow
@native
def test_breaks_and_rejected_steps() -> None:
    found = run(breaks=[0.31], h=1.0)
    assert found.rejected > 0
    assert np.abs(found.mu[-1] - exact(N, [1.0])[0]).max() < 1e-7
    whole = run(h=1.0)
    assert found.steps > whole.steps
    kept = run(20, breaks=[0.31], dense=True)  # one sample at the break
    assert len(kept) == kept.steps + 1 and (np.diff(kept.t) > 1e-12).all()
    with pytest.raises(StepTooSmall, match="4 steps led to t"):
        lm.integrate(
            spins(), lm.RKMK(order=5), spins().state(mu=directions()), t_end=9.0, steps=4
        )  # fmt: skip
    with pytest.raises(InvalidInput, match="t_end"):
        lm.integrate(spins(), lm.RKMK(order=5), spins().state(mu=directions()))


@pytest.mark.slow
@pytest.mark.parametrize("compiled", [None, False])
def test_a_site_that_fails(compiled: Any) -> None:
    n = 20
    mu = directions(n)
    mu[7] *= 1e200
    with pytest.raises(StepTooSmall, match=r"site \d.* t = 0.* overflowed") as caught:
        lm.integrate(
            spins(n), lm.RKMK(order=5), spins(n).state(mu=mu), t_end=1.0, compiled=compiled,
            progress=False,
        )  # fmt: skip
    assert caught.value.trajectory.mu.shape == (1, n, 3)


@pytest.mark.slow
@native
def test_a_site_whose_steps_fail_for_a_while() -> None:
    """A step that leaves the domain of a formula becomes shorter; natively, and with the same bits in plain Python."""
    system = lm.LiePoissonSystem(lm.SO3() ** 17, lm.Terms(Rooted(2.0)))
    plan = lm.Plan(system, lm.RKMK(order=5), h=0.3, rtol=1e-3, progress=False)
    start = system.state(mu=directions(17))
    plain, quick = (plan.replace(compiled=c).run(start, t_end=0.3) for c in (False, True))
    assert quick.rejected > 0
    assert (plain.steps, plain.rejected) == (quick.steps, quick.rejected)
    assert np.array_equal(plain.mu, quick.mu)


@lm.record
class Rooted(lm.Term):
    k: float

    def energy(self, a: Any) -> float:
        return self.k * a.mu[0] + lm.formulas.sqrt(a.mu[2] - 0.6)


@native
def test_going_on(tmp_path: Path) -> None:
    plan = adaptive()
    first = plan.run(plan.system.state(mu=directions()), t_end=0.4)
    rest = plan.resume(first, t_end=1.0)
    assert first.carry.t == rest.t[0] == 0.4
    assert np.abs(rest.mu[-1] - exact(N, [1.0])[0]).max() < 1e-7
    first.save(tmp_path / "run.npz")
    loaded = lm.Trajectory.load(tmp_path / "run.npz")
    assert np.array_equal(plan.resume(loaded, t_end=1.0).mu, rest.mu)
    assert np.array_equal(first.then(rest).t, [0.0, 0.4, 1.0])
    with pytest.raises(InvalidInput, match="with other steps"):
        lm.Plan(spins(), lm.RKMK(order=5), h=0.1).resume(first, steps=3)


@pytest.mark.slow
@native
def test_times_of_fixed_steps() -> None:
    """Inside of a fixed step by a shorter one."""
    plan = lm.Plan(spins(), lm.RKMK(order=4), h=0.1)
    start = plan.system.state(mu=directions())
    times = [0.1, 0.25, 0.3, 0.98]
    found = plan.run(start, steps=10, t_eval=times)
    whole = plan.run(start, steps=10)
    assert np.array_equal(found.t, times)
    assert np.array_equal(found.mu[[0, 2]], whole.mu[[1, 3]])
    assert np.abs(found.mu - exact(N, times)).max() < 1e-4
    short = lm.Plan(spins(), lm.RKMK(order=4), h=0.25 - (0.0 + 2 * 0.1))
    assert np.array_equal(found.mu[1], short.run(spins().state(mu=whole.mu[2]), steps=1).mu[-1])


@native
def test_order_of_cost() -> None:
    """A hundred thousand spins: one step for all of them, two samples."""
    n = 100_000
    found = run(n, 0.3, rtol=1e-6)
    assert found.mu.shape == (2, n, 3)
    assert found.steps < 20


@pytest.mark.slow
@native
def test_dense_beside_times(tmp_path: Path) -> None:
    """`run.at` is on the way of each step, to the bits of `t_eval`, resumed, loaded and of members too."""
    n, times = 20, np.linspace(0.0, 0.4, 8)
    plan = adaptive(n, compiled=True, dense=True)
    start = spins(n).state(mu=directions(n))
    wanted = run(n, 0.4, times, compiled=True).mu
    seen, ends = plan.run(start, t_end=0.4, t_eval=times), plan.run(start, t_end=0.4)
    assert np.array_equal(seen.mu, wanted)
    assert len(ends) == seen.steps + 1
    assert np.array_equal(seen.at(times).mu, wanted)
    assert np.array_equal(ends.at(times[::-1]).mu, wanted[::-1])
    assert np.array_equal(seen.at(0.25).mu, ends.at(0.25).mu)
    assert np.abs(seen.at(0.25).mu - exact(n, [0.25])[0]).max() < 1e-8
    seen.save(tmp_path / "run.npz")
    assert np.array_equal(lm.Trajectory.load(tmp_path / "run.npz").at(times).mu, wanted)
    half = plan.run(start, t_end=0.2)
    both = half.then(plan.resume(half, t_end=0.4))
    assert np.array_equal(both.at(times[:4]).mu, half.at(times[:4]).mu)
    assert np.abs(both.at(times).mu - wanted).max() < 1e-8
    few = [run(5, 0.04, dense=True, compiled=c).at([0.01, 0.03]).mu for c in (False, True)]
    assert np.array_equal(*few)
    two = plan.run(spins(n).state(mu=np.stack([directions(n)] * 2)), t_end=0.4)
    assert np.array_equal(two.at(times).mu[:, 1], wanted)
    with pytest.raises(InvalidInput, match="outside the run"):
        seen.at(0.5)


@pytest.mark.slow
@native
def test_dense_up_to_an_event() -> None:
    """The way of the step in which a run ends goes as far as the run, and on behind it."""
    n = 20

    def half(t: float, total: Any) -> float:
        return t - 0.23

    half.terminal = True  # type: ignore[attr-defined]
    options: Any = {"events": [half], "record": ["mu", ("m", lambda t, site: site.mu)]}
    plan = adaptive(n, compiled=True, dense=True, **options)
    start = spins(n).state(mu=directions(n))
    ended, whole = plan.run(start, t_end=0.4), run(n, 0.4, dense=True, compiled=True)
    last = float(ended.t[-1])
    assert abs(last - 0.23) < 1e-12
    times = np.array([0.05, 0.2, 0.225, last])
    assert np.abs(ended.at(times).mu - whole.at(times).mu).max() < 1e-13
    with pytest.raises(InvalidInput, match="outside the run"):
        ended.at(0.24)
    on = ended.then(plan.resume(ended, t_end=0.4))
    assert np.abs(on.at([0.1, 0.3]).mu - whole.at([0.1, 0.3]).mu).max() < 1e-8
