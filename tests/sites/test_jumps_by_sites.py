"""Runs by sites whose steps end where an input jumps, and states between their steps."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from terms_of_spins import Exchange

import liemech as lm
from liemech.compiler import kernel

native = pytest.mark.skipif(kernel.available() is not None, reason="needs llvmlite")

N, CUT = 8, 0.43
RING = lm.neighbours.ring(N)
TABLE = lm.PiecewisePolynomial.constant([0.0, 0.33, 0.6, 2.0], [1.0, -2.0, 0.5])


@lm.record
class Pulse(lm.Term):
    """A field along x that is given by a table."""

    pulse: lm.PiecewisePolynomial

    def energy(self, a: Any, t: float) -> float:
        return -self.pulse(t) * a.mu[0]


@lm.record
class Switch(lm.Term):
    """A field along y that changes at a time."""

    at: float

    def energy(self, a: Any, t: float) -> float:
        return (-0.7 if t < self.at else 1.3) * a.mu[1]


CASES: dict[str, Any] = {
    "table": (Pulse(TABLE), (0.33, 0.6), lambda t: [-float(TABLE(t)), 0.0, 0.0], ()),
    "breaks": (Switch(CUT), (CUT,), lambda t: [0.0, -0.7 if t < CUT else 1.3, 0.0], (CUT,)),
}
METHODS = lm.RKMK(order=4), lm.SublatticeSplitting(order=4), lm.BondSplitting()


def spins() -> np.ndarray:
    s = np.random.default_rng(0).normal(size=(N, 3))
    return s / np.linalg.norm(s, axis=1)[:, None]


def driven(term: Any) -> Any:
    return lm.DrivenLiePoissonSystem(lm.SO3() ** N, lm.Terms(Exchange(1.0).over(RING), term))


def exact(cuts: Any, field: Any, t_end: float) -> np.ndarray:
    """DOP853 from jump to jump, with the field between them."""
    y, t = spins().ravel(), 0.0
    for end in [*[c for c in cuts if c < t_end], t_end]:
        B = np.array(field(0.5 * (t + end)))

        def motion(_: float, y: np.ndarray, B: np.ndarray = B) -> np.ndarray:
            m = y.reshape(N, 3)
            return np.cross(m, B - np.roll(m, 1, 0) - np.roll(m, -1, 0)).ravel()

        y = solve_ivp(motion, (t, end), y, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
        t = end
    return y.reshape(N, 3)


@native
@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_steps_end_at_jumps(method: Any, case: str) -> None:
    check(method, case)


@pytest.mark.slow
@native
def test_bonds_end_at_breaks() -> None:
    check(lm.BondSplitting(), "breaks")


def check(method: Any, case: str) -> None:
    term, cuts, field, breaks = CASES[case]
    system, errors = driven(term), []
    start, wanted = system.state(mu=spins()), exact(cuts, field, 1.0)
    for h in (0.1, 0.05):
        plan = lm.Plan(system, method, h=h, breaks=breaks, every=3, compiled=True)
        run = plan.run(start, steps=round(1.0 / h))
        errors.append(np.abs(run.mu[-1] - wanted).max())
    assert np.log2(errors[0] / errors[1]) > method.order - 0.5
    plain = lm.integrate(system, method, start, h=0.1, steps=10, breaks=breaks, compiled=False, every=10)
    by_hand = lm.Plan(system, method, h=0.1, breaks=breaks, compiled=True)
    whole = by_hand.run(start, steps=10)
    assert np.array_equal(whole.mu[-1], plain.mu[-1])
    half = by_hand.run(start, steps=4)  # t = 0.4, before the cut
    assert np.array_equal(by_hand.resume(half, steps=6).mu[-1], plain.mu[-1])
    within = by_hand.run(start, steps=10, t_eval=[0.0, 0.47, 1.0])  # behind a jump in its step
    assert np.array_equal(within.mu[-1], plain.mu[-1])
    error = np.abs(within.mu[1] - exact(cuts, field, 0.47)).max()
    assert error < 3.0 * errors[0]
    assert np.array_equal(whole.at(0.47).mu, within.mu[1])


@pytest.mark.parametrize("small", [1000, 0], ids=["written out", "by sites"])
@pytest.mark.parametrize("method", [lm.SublatticeSplitting(), lm.BondSplitting()], ids=repr)
def test_the_order_stays_where_a_table_jumps_at_ends_of_steps(method: Any, small: int, monkeypatch: Any) -> None:
    """The last motion of a step, joined with the first one of the next, would see the other side of the jump."""
    table = lm.PiecewisePolynomial.constant([0.0, 0.5, 1.0], [1.0, -2.0])
    system, errors = driven(Pulse(table)), []
    monkeypatch.setattr(lm.System, "small", small)
    wanted = exact((0.5,), lambda t: [-float(table(t)), 0.0, 0.0], 1.0)
    for steps in (4, 8):
        run = lm.integrate(system, method, system.state(mu=spins()), h=1.0 / steps, steps=steps, compiled=False)
        errors.append(np.abs(run.mu[-1].reshape(N, 3) - wanted).max())
    assert np.log2(errors[0] / errors[1]) > 1.7


@native
def test_where_sites_are_written_out_the_bits_are_the_same(monkeypatch: Any) -> None:
    term, _, _, breaks = CASES["breaks"]
    system = driven(term)
    start = system.state(mu=spins())
    given: Any = {"h": 0.1, "steps": 10, "breaks": breaks}
    by_sites = lm.integrate(system, lm.RKMK(order=2), start, **given)
    monkeypatch.setattr(type(system), "small", 100)
    written = lm.integrate(system, lm.RKMK(order=2), start, **given)
    assert np.array_equal(by_sites.mu, written.mu)


@native
@pytest.mark.slow
def test_an_event_behind_a_jump() -> None:
    term, cuts, field, breaks = CASES["breaks"]
    system = driven(term)
    run = lm.integrate(
        system, lm.RKMK(order=4), system.state(mu=spins()), h=0.05, steps=20, breaks=breaks,
        record=("mu", ("spin", lambda t, site: site.mu)), events=[lambda t, total: t - 0.447],
    )  # fmt: skip
    times, states = run.events[0]
    assert abs(times[0] - 0.447) < 1e-9
    assert np.abs(states.mu[0] - exact(cuts, field, 0.447)).max() < 1e-6


@pytest.mark.slow
@native
def test_between_adaptive_steps() -> None:
    free = lm.LiePoissonSystem(lm.SO3() ** N, lm.Terms(Exchange(1.0).over(RING)))
    start = free.state(mu=spins())
    given: Any = {"t_end": 2.0, "rtol": 1e-7, "atol": 1e-7, "compiled": True}
    run = lm.integrate(free, lm.RKMK(order=5), start, dense=True, **given)
    ends = lm.integrate(free, lm.RKMK(order=5), start, **given)
    assert len(run.t) == run.steps + 1 and np.array_equal(run.mu[-1], ends.mu[-1])
    times = np.array([2.0, 0.31, 0.0, 1.7, 0.9, run.t[3]])
    found = run.at(times).mu
    for t, mu in zip(times, found):
        assert np.abs(mu - exact((), lambda t: [0.0] * 3, t)).max() < 1e-6 if t else (mu == spins()).all()
    assert np.array_equal(run.at(run.t[3]).mu, run.mu[3])
    with pytest.raises(lm.errors.InvalidInput, match="outside the run"):
        run.at(2.5)
