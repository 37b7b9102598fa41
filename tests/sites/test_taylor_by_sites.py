"""Taylor's method for systems of many sites: what a site publishes is a power series, of which the others
need every term before the next one of theirs.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from terms_of_spins import Exchange
from test_adaptive_by_sites import exact
from test_attacked import Repulsion, masses_in_space
from test_gravity import cloud
from test_runs_by_sites import chain, directions, native, spins
from test_sublattices import triangle

import liemech as lm
from liemech.formulas import cos
from liemech.rooms.sites.runs import plan as plans

FIELD = lm.Exponential()


def atoms(graph: Any) -> tuple[Any, Any]:
    """Soft spheres in a box."""
    rng = np.random.default_rng(0)
    system = masses_in_space(8, Repulsion(1.0).over(graph))
    return system, system.state(mu=rng.normal(size=(8, 3)), g=rng.uniform(0.0, 5.0, (8, 3)))


@lm.record
class Shaken(lm.Term):
    """A field that changes with time, as fast as a user likes."""

    b: float

    def energy(self, a: Any, t: float) -> float:
        return -self.b * cos(3.0 * t) * a.mu[2]


def held() -> tuple[Any, Any]:
    """Sites that need nothing of others meet with them all the same."""
    terms = lm.Terms(Exchange(1.0).over(lm.neighbours.ring(5)), held=[0, 1])
    system = lm.LiePoissonSystem(lm.SO3() ** 5, terms)
    return system, system.state(mu=directions(5))


def driven() -> tuple[Any, Any]:
    terms = lm.Terms(Exchange(1.0).over(lm.neighbours.ring(5)), Shaken(0.7))
    system = lm.DrivenLiePoissonSystem(lm.SO3() ** 5, terms)
    return system, system.state(mu=directions(5))


CASES: dict[str, Any] = {
    "held": (held, lm.Taylor(4)),
    "driven": (driven, lm.Taylor(4)),
    "ring": (lambda: (spins(6), spins(6).state(mu=directions(6))), lm.Taylor(5)),
    "pairs, triples, a field": (lambda: (triangle(), triangle().state(mu=directions(4))), lm.Taylor(3)),
    "attitudes": (lambda: chain(5), lm.Taylor(3, FIELD)),
    "lists": (lambda: atoms(lm.neighbours.within(2.4, box=[5.0] * 3)), lm.Taylor(3, FIELD)),
    "gravity": (lambda: cloud(9), lm.Taylor(3)),
    "all pairs": (lambda: atoms(lm.neighbours.all_pairs()), lm.Taylor(3, FIELD)),
}


@pytest.fixture
def only_sites(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is written out as one body."""
    monkeypatch.setattr(lm.System, "small", 0)
    monkeypatch.setattr(lm.models.NBody, "small", 0)
    monkeypatch.setattr(plans, "LARGE", 0)


def same(a: Any, b: Any) -> None:
    for name in ("mu", "g", "q", "p"):
        if getattr(a, name, None) is not None:
            assert np.array_equal(getattr(a, name), getattr(b, name)), name


@pytest.mark.slow
@native
@pytest.mark.parametrize("case", CASES)
def test_bits_of_plain_python(only_sites: None, case: str) -> None:
    """With fixed steps, whatever sites ask of each other."""
    (system, start), method = CASES[case][0](), CASES[case][1]
    runs = [lm.integrate(system, method, start, h=0.1, steps=2, compiled=c) for c in (False, True)]
    assert runs[1].compiled
    same(*runs)


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_as_written_out(monkeypatch: pytest.MonkeyPatch, case: str) -> None:
    """The steps of all sites as one body, whose series know nothing of sites."""
    method, found = CASES[case][1], []
    for small in (1000, 0):
        monkeypatch.setattr(lm.System, "small", small)
        monkeypatch.setattr(lm.models.NBody, "small", small)
        (system, start) = CASES[case][0]()
        plan = lm.Plan(system, method, h=0.1, compiled=False)
        found.append(plan.run(start, steps=2))
    for name in ("mu", "g", "q", "p"):
        a, b = (getattr(run, name, None) for run in found)
        assert a is None or np.abs(a - b).max() < 1e-13


@native
@pytest.mark.parametrize(
    ("order", "rtol"),
    [
        (4, 1e-4),
        pytest.param(6, 1e-6, marks=pytest.mark.slow),
        pytest.param(12, 1e-9, marks=pytest.mark.slow),
        pytest.param(16, 1e-11, marks=pytest.mark.slow),
    ],
)
def test_adaptive_steps_against_scipy(order: int, rtol: float) -> None:
    """The error goes with the tolerance; samples at times, and ways inside of steps; no step is rejected."""
    n, times = 60, np.linspace(0.0, 3.0, 7)
    right = exact(n, times)
    plan = lm.Plan(spins(n), lm.Taylor(order), rtol=rtol, atol=rtol)
    run = plan.run(spins(n).state(mu=directions(n)), t_end=3.0, t_eval=times)
    assert run.compiled and run.rejected == 0 and np.array_equal(run.t, times)
    assert 1e-3 * rtol < np.abs(run.mu - right).max() < 30.0 * rtol


@pytest.mark.slow
@native
def test_adaptive_bits(only_sites: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of plain Python, natively, with any number of workers; and backwards to the start."""
    monkeypatch.setattr("liemech.compiler.sites.site_calls.SHARE", 2**11)
    given: dict[str, Any] = {"rtol": 1e-6, "atol": 1e-6}
    start, times = spins(5).state(mu=directions(5)), [0.02, 0.3]
    runs = [
        lm.Plan(spins(5), lm.Taylor(5), compiled=c, **given).run(start, t_end=0.3, t_eval=times) for c in (False, True)
    ]
    same(*runs)
    assert runs[0].steps == runs[1].steps > 1
    n = 7000
    start = spins(n).state(mu=directions(n))
    many = [lm.Plan(spins(n), lm.Taylor(6), workers=w, **given).run(start, t_end=0.5) for w in (1, 3)]
    same(*many)
    back = lm.Plan(spins(n), lm.Taylor(6), **given).run(many[0].last, t0=0.5, t_end=0.0)
    assert np.abs(back.mu[-1] - directions(n)).max() < 1e-5
