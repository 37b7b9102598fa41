"""Trajectories: shapes, quantities computed when asked for, the report on structure, and carrying on."""

from __future__ import annotations

import copy
import math
import pickle

import numpy as np
import pytest
from scenes import CAYLEY, EXP, METHODS, RKMK4, asymmetric_body, named, quiet_body, seed_body
from scipy.spatial.transform import Rotation

import liemech as lm
from liemech import errors


@pytest.fixture(scope="module")
def single() -> lm.Trajectory:
    body, start = asymmetric_body()
    return lm.integrate(body, RKMK4, start, h=0.1, steps=40, every=4, t0=2.0)


@pytest.fixture(scope="module")
def ensemble() -> lm.Trajectory:
    body, start = asymmetric_body()
    starts = body.state(np.array(start.mu) * np.linspace(0.5, 1.5, 5)[:, None], start.g)
    return lm.integrate(body, RKMK4, starts, h=0.1, steps=40, every=4)


def test_shapes_of_one_body(single: lm.Trajectory) -> None:
    assert len(single) == 11
    assert single.bodies is None
    assert single.t.shape == (11,)
    assert single.mu.shape == (11, 3)
    assert single.g.shape == (11, 3, 3)
    assert single.energy.shape == (11,)
    assert single.casimirs.shape == (11, 1)
    assert single.spatial_momentum.shape == (11, 3)


def test_shapes_of_an_ensemble(ensemble: lm.Trajectory) -> None:
    assert ensemble.bodies == 5
    assert ensemble.mu.shape == (11, 5, 3)
    assert ensemble.g.shape == (11, 5, 3, 3)
    assert ensemble.energy.shape == (11, 5)
    assert ensemble.casimirs.shape == (11, 5, 1)
    assert ensemble.spatial_momentum.shape == (11, 5, 3)
    assert ensemble.stopped == {}


def test_quantities_are_what_they_say(single: lm.Trajectory) -> None:
    J = np.array(single.system.inertia)
    assert np.allclose(single.energy, 0.5 * (single.mu**2 / J).sum(axis=1), rtol=1e-15)
    assert np.allclose(single.casimirs[:, 0], (single.mu**2).sum(axis=1), rtol=1e-15)
    assert np.allclose(single.spatial_momentum, np.einsum("nij,nj->ni", single.g, single.mu), rtol=1e-14)


def test_quantities_are_computed_once_and_only_when_asked_for() -> None:
    body, start = asymmetric_body()
    run = lm.integrate(body, RKMK4, start, h=0.1, steps=5)
    computed = {"energy", "casimirs", "spatial_momentum", "rotation"}
    assert not computed & vars(run).keys()
    for name in computed:
        assert getattr(run, name) is getattr(run, name)
    assert computed <= vars(run).keys()


def test_rotations_are_scipy_rotations(single: lm.Trajectory, ensemble: lm.Trajectory) -> None:
    assert isinstance(single.rotation, Rotation)
    assert np.allclose(single.rotation.as_matrix(), single.g, atol=1e-15)
    assert np.allclose(single.rotation.apply(single.mu), single.spatial_momentum, atol=1e-14)
    assert np.allclose(ensemble.rotation.as_matrix(), ensemble.g, atol=1e-15)


def test_times_and_repr(single: lm.Trajectory, ensemble: lm.Trajectory) -> None:
    assert np.array_equal(single.t, 2.0 + np.arange(0, 41, 4) * 0.1)
    kind = "compiled" if single.compiled else "plain"
    assert repr(single) == f"Trajectory(RKMK(order=4): 11 samples to t = 6, h = 0.1, {kind}; mu, g)"
    assert "5 bodies" in repr(ensemble)


def test_without_attitude() -> None:
    body, start = asymmetric_body()
    run = lm.integrate(body, RKMK4, start, h=0.1, steps=5, record=("mu",), compiled=False)
    assert run.g is None
    assert repr(run).endswith("plain; mu)")
    assert run.last.g is None
    for name in ("rotation", "spatial_momentum"):
        with pytest.raises(lm.errors.InvalidInput, match=f"{name} needs the attitude"):
            getattr(run, name)
    assert [k.name for k in run.drift().kept] == ["energy", "Casimir 1"]


@pytest.mark.parametrize("method", METHODS, ids=named)
def test_the_last_state_continues_a_run(method: lm.Method) -> None:
    body, start = asymmetric_body()
    whole = lm.integrate(body, method, start, h=0.1, steps=30)
    half = lm.integrate(body, method, start, h=0.1, steps=15)
    rest = lm.integrate(body, method, half.last, h=0.1, steps=15, t0=half.t[-1])
    assert rest.t[-1] == pytest.approx(whole.t[-1], rel=1e-15)
    if method is RKMK4:  # without memory
        assert np.array_equal(rest.mu, whole.mu[15:])
        assert np.array_equal(rest.g, whole.g[15:])
    else:  # another first guess for Newton's method: the same root, to rounding
        assert np.abs(rest.mu - whole.mu[15:]).max() < 1e-14
        assert np.abs(rest.g - whole.g[15:]).max() < 1e-14


def test_the_last_states_of_an_ensemble(ensemble: lm.Trajectory) -> None:
    assert ensemble.last.bodies == 5
    more = lm.integrate(ensemble.system, ensemble.method, ensemble.last, h=0.1, steps=3)
    assert np.array_equal(more.mu[0], ensemble.mu[-1])


# ---------------------------------------------------------------- the report


@pytest.fixture(scope="module")
def long_runs() -> dict[lm.Method, lm.Trajectory]:
    body, start = seed_body()
    return {m: lm.integrate(body, m, start, h=0.5, steps=4000) for m in METHODS}


@pytest.mark.parametrize("method", METHODS, ids=named)
def test_report(method: lm.Method, long_runs: dict[lm.Method, lm.Trajectory]) -> None:
    """Energy: RKMK drifts, Algorithm 1 does not.  Casimirs and spatial momentum: exact for all."""
    report = long_runs[method].drift()
    assert report["energy"].verdict == ("drifting" if method is RKMK4 else "bounded")
    assert report["Casimir 1"].verdict == "exact"
    assert report["spatial momentum"].verdict == "exact"
    text = str(report)
    assert text.count("\n") == 2
    assert ("per unit time" in text) == (method is RKMK4)


def test_slope_of_the_report_is_the_slope(long_runs: dict[lm.Method, lm.Trajectory]) -> None:
    run = long_runs[RKMK4]
    found = run.drift()["energy"]
    line = np.polyfit(run.t, run.energy / run.energy[0] - 1, 1)
    assert found.slope == pytest.approx(line[0], rel=1e-6)
    assert found.size == pytest.approx(3 / 8)
    assert found.largest == pytest.approx(np.abs(run.energy / run.energy[0] - 1).max())


@pytest.mark.parametrize("unit", [2.0**-133, 2.0**133, 2.0**-300])
def test_the_report_does_not_depend_on_units(unit: float, long_runs: dict[lm.Method, lm.Trajectory]) -> None:
    body = quiet_body(unit * np.array([2 / 3, 1.0, 2.0]))
    start = body.state(unit * np.array([0.5, 0.0, 0.75**0.5]), np.eye(3))
    for method in (RKMK4, EXP):
        run = lm.integrate(body, method, start, h=0.5, steps=4000)
        for mine, theirs in zip(run.drift().kept, long_runs[method].drift().kept, strict=True):
            assert (mine.verdict, mine.largest, mine.slope) == (theirs.verdict, theirs.largest, theirs.slope)


def test_report_of_an_ensemble_names_the_worst() -> None:
    """Of two bodies, one at rest on its axis, the moving one decides."""
    body, start = seed_body()
    starts = body.state([[0.0, 0.0, 1.0], start.mu], start.g)
    both = lm.integrate(body, RKMK4, starts, h=0.5, steps=400).drift()["energy"]
    alone = lm.integrate(body, RKMK4, start, h=0.5, steps=400).drift()["energy"]
    assert both.largest == alone.largest
    assert both.slope == alone.slope


def test_report_of_a_body_at_rest() -> None:
    body, _ = asymmetric_body()
    run = lm.integrate(body, CAYLEY, body.state([0, 0, 0], np.eye(3)), h=0.5, steps=10)
    assert {k.verdict for k in run.drift().kept} == {"exact"}


def test_too_few_samples_for_a_trend() -> None:
    body, start = seed_body()
    with pytest.raises(lm.errors.InvalidInput, match="at least two samples"):
        lm.integrate(body, RKMK4, start, h=0.5, steps=0).drift()
    run = lm.integrate(body, EXP, start, h=0.5, steps=300, every=150)
    assert run.drift()["energy"].verdict == "changed"
    assert "too few samples" in str(run.drift())


def test_a_step_that_is_too_large_is_not_bounded() -> None:
    """Changes are told beside the start, however large the motion has become."""
    body = lm.RigidBody([1.0, 1.5, 2.0])
    start = body.state([0.5, 0.0, 0.75**0.5], np.eye(3))
    for h in (10.0, 100.0):
        run = lm.integrate(body, RKMK4, start, h=h, steps=40)
        assert run.drift()["energy"].verdict == "lost"
        assert run.drift()["Casimir 1"].verdict == "exact"
    few = lm.integrate(body, RKMK4, start, h=0.1, steps=12)
    assert few.drift()["energy"].verdict == "changed"
    orbit = lm.Kepler()
    for h in (0.5, 1.0):
        start = orbit.state(q=[0.4, 0.0], p=[0.0, 2.0])
        run = lm.integrate(orbit, lm.StormerVerlet(), start, h=h, steps=200)
        report = run.drift()
        assert np.abs(run.q).max() > 100.0
        assert report["energy"].verdict == report["Runge-Lenz vector"].verdict == "lost"
        assert report["energy"].scale < 20.0 and report["Runge-Lenz vector"].scale < 2.0


def test_the_report_is_a_collection_of_names(long_runs: dict[lm.Method, lm.Trajectory]) -> None:
    report = long_runs[EXP].drift()
    assert list(report) == ["energy", "Casimir 1", "spatial momentum"] and len(report) == 3
    assert "energy" in report and "typo" not in report and 0 not in report


def test_constants_that_are_zero_by_cancelling() -> None:
    """Their changes are told beside the size of their terms: no division by a rounding error."""
    fluid = lm.models.KirchhoffBody([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    start = fluid.state([1.0, 1.0, 1.0, 0.1, 0.2, -0.3], np.eye(4))
    kept = lm.integrate(fluid, lm.RKMK(order=4), start, h=0.05, steps=60, compiled=False).drift()["Casimir 2"]
    assert kept.size < 1e-15
    assert 0.1 < kept.scale < 10.0
    assert kept.verdict == "exact"
    assert "the size of its terms" in str(kept)
    pendulum = lm.models.Pendulum()
    swing = lm.integrate(pendulum, lm.RKMK(order=4), pendulum.state(math.pi / 2, 0.0), h=0.02, steps=60, compiled=False)
    energy = swing.drift()["energy"]
    assert 1.0 < energy.scale < 100.0
    assert energy.largest < 1e-6
    top = lm.models.LagrangeTop(weight=1.0, transverse=1.0, axial=0.5, length=1.0)
    lying = top.state(np.zeros(3), [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    energy = lm.integrate(top, lm.LieVerlet(), lying, h=0.01, steps=300, compiled=False).drift()["energy"]
    assert 0.1 < energy.scale < 10.0  # half-way it falls
    assert energy.largest < 1e-3


def test_changes_are_relative_or_absolute_and_say_so() -> None:
    body, start = seed_body()
    report = lm.integrate(body, EXP, start, h=0.5, steps=100).drift()
    assert "relative to 0.375" in str(report["energy"])
    rest = lm.integrate(body, CAYLEY, body.state([0.0, 0.0, 0.0]), h=0.5, steps=10).drift()
    assert "absolute" in str(rest["energy"])
    assert rest["energy"].largest == 0.0
    with pytest.raises(lm.errors.InvalidInput, match=r"'typo' is no constant .* energy, Casimir 1, spatial momentum"):
        report["typo"]


def test_a_system_that_names_no_constants() -> None:
    class Spin(lm.LinearGroupEquation):
        def drive(self, t):
            return lm.vec(1.0, 0.0, t)

    system = Spin(lm.SO3())
    report = lm.integrate(system, RKMK4, system.state(np.eye(3)), h=0.1, steps=10).drift()
    assert report.kept == ()
    assert str(report) == "no constants of the motion are known"


COPIES = {"pickle": lambda x: pickle.loads(pickle.dumps(x)), "deep": copy.deepcopy, "copy": copy.copy}


@pytest.mark.parametrize("again", COPIES.values(), ids=COPIES)
def test_copies_print_alike(again, single: lm.Trajectory, ensemble: lm.Trajectory) -> None:
    body, start = asymmetric_body()
    adaptive = lm.integrate(body, lm.RKMK(order=5), start, t_end=2.0)
    methods = (lm.RKMK(order=5), lm.CommutatorFree(), lm.Composition(CAYLEY), lm.KickDrift(), lm.Taylor())
    for one in (single, ensemble, adaptive, body, start, body.group, *methods):
        assert repr(again(one)) == repr(one)
    assert np.array_equal(again(adaptive).at(1.0).mu, adaptive.at(1.0).mu)
    carried_on = lm.integrate(body, RKMK4, again(start), h=0.1, steps=3)
    assert np.array_equal(carried_on.mu, lm.integrate(body, RKMK4, start, h=0.1, steps=3).mu)


def test_nothing_is_written_into_frozen_records() -> None:
    body, _ = asymmetric_body()
    start = body.state([0.1, 0.2, 0.3], np.eye(3))
    before = {id(x): set(vars(x)) for x in (start, body.hamiltonian)}
    lm.integrate(body, lm.LiePoissonHamiltonJacobi(order=2), start, h=0.1, steps=2)
    for x in (start, body.hamiltonian):
        assert set(vars(x)) - before[id(x)] <= {"_layout"}
        assert "_home" not in vars(x)


def test_a_run_does_not_notice_later_changes_of_its_start() -> None:
    body, _ = asymmetric_body()
    mu = np.array([[0.1, 0.2, 0.3], [0.3, 0.2, 0.1]])
    start = body.state(mu)
    run = lm.integrate(body, RKMK4, start, h=0.1, steps=2)
    mu[:] = 9.0
    again = lm.integrate(body, RKMK4, start, h=0.1, steps=2)
    assert np.array_equal(run.mu, again.mu)
    with pytest.raises(ValueError, match="read-only"):
        start.mu[0, 0] = 1.0


BODY = lm.RigidBody([1.0, 1.5, 2.0])
START = BODY.state(mu=[0.5, 0.0, 0.75**0.5], g=np.eye(3))


def test_times_of_two_axes_are_refused():
    times = np.array([[0.1, 0.2], [0.3, 0.4]])
    fixed = lm.integrate(BODY, lm.RKMK(order=2), START, h=0.1, steps=10, compiled=False)
    adaptive = lm.integrate(BODY, lm.RKMK(order=5), START, t_end=1.0, compiled=False)
    kepler = lm.Kepler()
    method = lm.ReversibleController(lm.StormerVerlet(), sigma=lm.time_scales.EqualArc())
    fictive = lm.integrate(kepler, method, kepler.state(q=[0.5, 0.0], p=[0.0, 1.7]), h=0.01, t_end=1.0, compiled=False)
    for run in (fixed, adaptive, fictive):
        with pytest.raises(errors.InvalidInput, match=r"\(m,\); got t of shape \(2, 2\)"):
            run.at(times)


def test_two_runs_joined_have_the_samples_of_both():
    """Where the first was not asked for its end, the first sample of the second is no repetition."""
    plan = lm.Plan(BODY, lm.RKMK(order=2), h=0.1, compiled=False)
    first = plan.run(START, steps=10, t_eval=[0.0, 0.5])
    joined = first.then(plan.resume(first, steps=5))
    whole = plan.run(START, steps=15)
    assert joined.t.tolist() == [0.0, 0.5, *whole.t[10:].tolist()]
    assert np.array_equal(joined.mu[2:], whole.mu[10:])
    first = plan.run(START, steps=10)
    assert np.array_equal(first.then(plan.resume(first, steps=5)).t, whole.t)
