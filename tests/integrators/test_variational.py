"""Algorithm 1: the method itself to 13 digits, its order, and the structure it keeps."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from scenes import CAYLEY, EXP, asymmetric_body, named, quiet_body, rotation, seed_body, slope

import liemech as lm
from liemech.formulas.numbers.conversions import double_double, rounded
from liemech.formulas.numbers.double_double import is_long
from liemech.integrators.variational import first_size
from liemech.solvers import leading_power

REFERENCE = json.loads((Path(__file__).parent.parent / "reference" / "integrator_steps_so3.json").read_text())
pytestmark = pytest.mark.filterwarnings("ignore::liemech.errors.StepWarning")
BOTH = pytest.mark.parametrize("method", [EXP, CAYLEY], ids=named)
# ---------------------------------------------------------------- the method itself


@pytest.mark.sample(2)
@BOTH
@pytest.mark.parametrize("compiled", [False, pytest.param(True, marks=pytest.mark.compiled)])
def test_steps_of_the_method_itself(method: lm.CovariantVariational, compiled: bool) -> None:
    body, start = seed_body()
    run = lm.integrate(body, method, start, h=0.5, steps=200, compiled=compiled)
    wanted = REFERENCE["methods"][method.name]
    assert np.abs(run.mu[1] - wanted["mu"]).max() < 1e-15
    assert np.abs(run.g[1] - wanted["g"]).max() < 1e-15
    for at in wanted["trajectory"]:
        assert np.abs(run.mu[at["n"]] - at["mu"]).max() < 1e-13
        assert np.abs(run.g[at["n"]] - at["g"]).max() < 1e-13
        assert run.energy[at["n"]] == pytest.approx(at["energy"], abs=1e-13)


@BOTH
def test_velocity_of_the_first_interval(method: lm.CovariantVariational) -> None:
    body, start = seed_body()
    x = method.displacement(body, 0.5, start.mu, 0.5 * body.velocity(start.mu))
    assert np.abs(np.array(x) / 0.5 - REFERENCE["methods"][method.name]["xi"]).max() < 2e-15


def test_error_after_two_hundred_steps() -> None:
    body, start = seed_body()
    exact = body.exact(start, 100.0).mu
    for method, momentum, energy in ((EXP, 8.5e-2, -8.9e-4), (CAYLEY, 1.3, -2.3e-3)):
        run = lm.integrate(body, method, start, h=0.5, steps=200)
        assert np.abs(run.mu[-1] - exact).max() == pytest.approx(momentum, rel=5e-2)
        assert run.energy[-1] - 3 / 8 == pytest.approx(energy, rel=5e-2)


@BOTH
def test_momentum_fits_the_velocity(method: lm.CovariantVariational) -> None:
    """The two lines of the algorithm: (dtau^-1)* J xi is the momentum after the step, the right one that before it."""
    body, start = asymmetric_body()
    h, mu = 0.4, np.array(start.mu)
    run = lm.integrate(body, method, start, h=h, steps=1)
    xi = method.retraction.tau_inv(body.group, run.g[0].T @ run.g[1]) / h
    p = np.array(body.inertia) * xi
    assert np.abs(method.retraction.dtau_inv_dual(body.group, -h * xi, p) - mu).max() < 1e-14
    assert np.abs(method.retraction.dtau_inv_dual(body.group, h * xi, p) - run.mu[1]).max() < 1e-14


@BOTH
def test_velocities_belong_to_intervals(method: lm.CovariantVariational) -> None:
    """g_i+1 = g_i tau(h xi_i), and the momentum of xi_i is mu_i: J xi_i is another one, an O(h)
    away, half way to mu_i+1.
    """
    body, start = asymmetric_body()
    gaps = []
    for h in (0.1, 0.05):
        run = lm.integrate(body, method, start, h=h, steps=10)
        between = method.retraction.tau_inv(body.group, np.swapaxes(run.g[:-1], 1, 2) @ run.g[1:]) / h
        assert np.abs(run.xi[:-1] - between).max() < 4e-15
        assert np.abs(method.momentum(body, run.xi, h) - run.mu).max() < 1e-15
        J_xi = np.array(body.inertia) * run.xi[:-1]
        gaps.append((np.abs(J_xi - run.mu[:-1]).max(), np.abs(J_xi - 0.5 * (run.mu[:-1] + run.mu[1:])).max()))
    assert np.log2(np.divide(*gaps)) == pytest.approx([1.0, 2.0], abs=0.2)


@BOTH
def test_a_run_may_start_with_a_velocity(method: lm.CovariantVariational) -> None:
    body, _ = asymmetric_body()
    xi, h = np.array([0.3, -0.5, 0.9]), 0.2
    run = lm.integrate(body, method, body.state(method.momentum(body, xi, h)), h=h, steps=5)
    assert np.abs(run.xi[0] - xi).max() < 1e-15
    assert np.abs(method.velocity(body, method.momentum(body, xi, -h), -h) - xi).max() < 1e-15


def test_other_methods_have_no_velocities_of_intervals() -> None:
    body, start = asymmetric_body()
    run = lm.integrate(body, lm.RKMK(4), start, h=0.1, steps=2)
    with pytest.raises(
        lm.errors.InvalidInput, match=r"Trajectory.xi is for methods with a velocity .* RKMK\(order=4\) has none"
    ):
        _ = run.xi


@BOTH
def test_small_steps_have_the_velocity_of_the_body(method: lm.CovariantVariational) -> None:
    """h -> 0 gives xi = J^-1 mu + h/2 J^-1 (mu' ...): no factor h is lost or left over."""
    body, start = asymmetric_body()
    velocity = np.array(body.velocity(start.mu))
    gaps = []
    for h in (1e-2, 1e-3, 1e-4):
        xi = np.array(method.displacement(body, h, start.mu, h * body.velocity(start.mu))) / h
        gaps.append(np.abs(xi - velocity).max())
    assert slope([1e-2, 1e-3, 1e-4], gaps) == pytest.approx(1.0, abs=0.01)
    assert gaps[-1] < 1e-4


@BOTH
def test_a_sphere_turns_exactly(method: lm.CovariantVariational) -> None:
    """J = j 1: the momentum stays, and with exp the attitude is the exact one."""
    body = lm.RigidBody([1.7, 1.7, 1.7])
    start = body.state([0.3, -0.5, 0.9], rotation(np.random.default_rng(2)))
    run = lm.integrate(body, method, start, h=0.5, steps=20)
    assert np.abs(run.mu - run.mu[0]).max() < 1e-15
    exact = body.exact(start, run.t).g
    if method is EXP:
        assert np.abs(run.g - exact).max() < 2e-14
    # with Cayley xi(1 + h^2 |xi|^2/4) = mu/j: a little slower, about the same axis
    axis = np.array(start.mu) / np.linalg.norm(start.mu)
    assert np.abs(run.g[-1] @ axis - exact[-1] @ axis).max() < 1e-14


# ---------------------------------------------------------------- structure


@BOTH
def test_spatial_momentum_is_kept_to_rounding(method: lm.CovariantVariational) -> None:
    body, start = asymmetric_body()
    run = lm.integrate(body, method, start, h=0.5, steps=1000)
    size = np.linalg.norm(run.mu[0])
    assert np.abs(run.spatial_momentum - run.spatial_momentum[0]).max() < 3e-14 * size
    assert np.abs(np.linalg.norm(run.mu, axis=1) - size).max() < 1e-14 * size


@BOTH
def test_energy_oscillates_without_drift(method: lm.CovariantVariational) -> None:
    body, start = seed_body()
    run = lm.integrate(body, method, start, h=0.5, steps=10_000)
    error = np.abs(run.energy - run.energy[0])
    assert error[:1001].max() == pytest.approx({EXP: 1.0e-3, CAYLEY: 2.6e-3}[method], rel=0.1)
    assert error[5000:].max() <= 1.1 * error[:5000].max()


def modified_energy(body: lm.RigidBody, method: lm.CovariantVariational, mu: np.ndarray, h: float) -> np.ndarray:
    """H - (h^2/6) s_3: s_3 = w . K w/4 with K = J^-1, v = K mu, w = mu x v, and for Cayley + |v|^2 (mu . v)/2."""
    v = mu / np.array(body.inertia)
    w = np.cross(mu, v)
    s3 = 0.25 * (w * w / np.array(body.inertia)).sum(axis=1)
    if method is CAYLEY:
        s3 += 0.5 * (v * v).sum(axis=1) * (mu * v).sum(axis=1)
    return 0.5 * (mu * v).sum(axis=1) - h * h / 6 * s3


@BOTH
def test_modified_energy_is_kept_to_fourth_order(method: lm.CovariantVariational) -> None:
    """Its oscillation falls by 16 per halving, that of the energy by 4."""
    body, start = asymmetric_body()
    h, plain, modified = [0.2, 0.1, 0.05, 0.025], [], []
    for step in h:
        run = lm.integrate(body, method, start, h=step, steps=round(20 / step))
        plain.append(np.ptp(run.energy))
        modified.append(np.ptp(modified_energy(body, method, run.mu, step)))
    assert slope(h, plain) == pytest.approx(2.0, abs=0.1)
    assert slope(h, modified) == pytest.approx(4.0, abs=0.1)
    assert modified[-1] < 1e-3 * plain[-1]


# ---------------------------------------------------------------- large steps


def test_cayley_has_a_step_of_every_size() -> None:
    body, start = seed_body()
    for h in (1.0, 3.0, 10.0, 50.0, 1e4):
        run = lm.integrate(body, CAYLEY, start, h=h, steps=50)
        assert np.abs(np.linalg.norm(run.mu, axis=1) - 1.0).max() < 1e-13
        defect = np.abs(run.spatial_momentum - run.spatial_momentum[0]).max()
        assert defect < 1e-13


@pytest.mark.parametrize("compiled", [False, pytest.param(True, marks=pytest.mark.compiled)])
def test_exp_says_when_the_step_is_too_large(compiled: bool) -> None:
    """The step of this start ends at h = 14.5, where h|xi| = 2 pi: before, it grows without a fold."""
    body, start = seed_body()
    with pytest.raises(lm.errors.IntegrationFailure, match=r"too large.*try") as caught:
        lm.integrate(body, EXP, start, h=20.0, steps=100, compiled=compiled)
    run = caught.value.trajectory
    assert isinstance(run, lm.Trajectory)
    assert np.isfinite(run.mu).all()
    assert len(run) == run.steps + 1
    assert f"step {len(run)} of 100, t = {20.0 * run.steps:g}" in str(caught.value)


@pytest.mark.parametrize("h", [4.0, -6.0])
def test_steps_of_exp_beyond_a_fold_are_refused(h: float) -> None:
    """What is accepted has det DF > 0, F(xi) = (dexp^-1_{h xi})* J xi; two of five roots found at h
    |mu| = 6 have not.
    """
    body, _ = seed_body()
    J, rng = np.array(body.inertia), np.random.default_rng(0)

    def legendre(x: np.ndarray) -> np.ndarray:
        return body.group.algebra.dexp_inv_dual(-x, J * x / h)

    for mu in rng.normal(size=(16, 3)):
        m = lm.Vec.of(mu / np.linalg.norm(mu))
        try:
            x = np.array(EXP.displacement(body, h, m, h * body.velocity(m)))
        except (lm.errors.NoConvergence, lm.errors.OutsideChart):
            continue
        if np.linalg.norm(x) > 2 * math.pi - 1e-3:
            continue
        derivative = np.stack([(legendre(x + e) - legendre(x - e)) / 2e-6 for e in 1e-6 * np.eye(3)], axis=1)
        assert np.linalg.det(h * derivative) > 0.0


@pytest.mark.parametrize("h", [6.0, 12.0, 100.0])
def test_steps_of_exp_beyond_a_whole_turn_are_refused(h: float) -> None:
    """Newton's method finds roots with h |xi| > 2 pi: meaningless sheets, on which a run would go on for ever."""
    body, _ = seed_body()
    rng = np.random.default_rng(0)
    for mu in rng.normal(size=(6, 3)):
        m = lm.Vec.of(mu / np.linalg.norm(mu))
        try:
            x = EXP.displacement(body, h, m, h * body.velocity(m))
        except (lm.errors.NoConvergence, lm.errors.OutsideChart):
            continue
        assert np.linalg.norm(x) < 2 * math.pi


@pytest.mark.slow
def test_within_its_rule_the_step_of_exp_is_the_one_connected_to_zero() -> None:
    """h |mu| <= pi J_min: the root grows with h from nothing, without a jump."""
    body = quiet_body([2 / 3, 1.0, 2.0])
    rng = np.random.default_rng(4)
    top = math.pi * 2 / 3
    for mu in rng.normal(size=(20, 3)):
        mu = mu / np.linalg.norm(mu)
        guess = lm.Vec.of(np.zeros(3))
        for h in np.linspace(top / 40, top, 40):
            guess = EXP.displacement(body, float(h), lm.Vec.of(mu), guess)
        direct = EXP.displacement(body, top, lm.Vec.of(mu), top * body.velocity(lm.Vec.of(mu)))
        assert np.abs(np.array(direct) - np.array(guess)).max() < 1e-14


BODY, MU = lm.RigidBody([1.0, 1.6, 2.3]), lm.vec(0.3, 0.8, -0.5)


@lm.record
class Watched(lm.Cayley):
    """The Cayley map, and how many of its residuals had 31 digits."""

    digits: ClassVar[list[bool]] = []

    def residual(self, group: Any, xi: Any, p: Any, mu: Any) -> Any:
        self.digits.append(any(is_long(x[0]) for x in (xi, p, mu)))
        return super().residual(group, xi, p, mu)


@pytest.mark.parametrize("thin", [False, True], ids=["body", "rod"])
def test_one_residual_of_a_step_has_31_digits(thin: bool) -> None:
    """Of a rod too, whose displacement is followed from h = 0 on; and it is solved to them."""
    system = lm.LiePoissonSystem(lm.SO3(), lm.KineticEnergy([0.001, 1.0, 1.2])) if thin else BODY
    mu, h = lm.vec(0.001, 1.1, 0.4) if thin else MU, 0.3
    method = lm.CovariantVariational(Watched())
    Watched.digits.clear()
    x = method.displacement(system, h, double_double(mu), h * system.velocity(mu))
    assert Watched.digits.count(True) == 1
    assert len(Watched.digits) > 3
    rest = method.equation(system, 1.0 / h, double_double(mu), x)[0]
    assert np.abs(np.array(rounded(rest))).max() < 1e-27


MOMENTS, MOMENTUM = np.array([1.0, 1.6, 2.3]), np.array([0.3, 0.8, -0.5])
FULL = np.array([[1.0, 0.1, 0.05], [0.1, 1.6, 0.2], [0.05, 0.2, 2.3]])
UNITS = [(-196, 124), (-103, 196), (280, -40)]  # residuals of J/h would be denormal, or huge


def moved(
    method: lm.Method, inertia: np.ndarray, mass: float = 1.0, second: float = 1.0
) -> tuple[np.ndarray, np.ndarray]:
    """Momentum, in ordinary units, and attitude after some steps."""
    body = lm.RigidBody(mass * inertia)
    start = body.state(mass / second * MOMENTUM, np.eye(3))
    run = lm.integrate(body, method, start, h=0.3 * second, steps=25, compiled=False)
    return run.mu / (mass / second), run.g


@pytest.mark.parametrize("retraction", [lm.Exponential(), lm.Cayley()], ids=repr)
@pytest.mark.parametrize("inertia", [MOMENTS, FULL], ids=["diagonal", "full"])
def test_powers_of_two_change_no_bit(retraction: lm.Retraction, inertia: np.ndarray) -> None:
    method = lm.CovariantVariational(retraction)
    mu, g = moved(method, inertia)
    for mass, second in UNITS:
        other = moved(method, inertia, 2.0**mass, 2.0**second)
        assert np.array_equal(other[0], mu)
        assert np.array_equal(other[1], g)


def test_steps_back_and_a_root_that_grows_out_of_zero() -> None:
    """Both ways to a displacement, with steps of either sign, for a thin rod beyond its fold."""
    method, rod = lm.CovariantVariational(lm.Cayley()), np.array([1.0 / 1000, 1.0, 1.0])
    for h in 0.7, -0.7:
        found = []
        for mass, second in (0, 0), (-103, 196):
            system = lm.LiePoissonSystem(lm.SO3(), lm.KineticEnergy(2.0**mass * rod))
            mu = lm.Vec.of(2.0 ** (mass - second) * np.array([0.001, 1.1, 0.4]))
            found.append(method.velocity(system, mu, h * 2.0**second) * 2.0**second)
        assert np.array_equal(np.array(found[0]), np.array(found[1]))


def test_leading_powers() -> None:
    rng = np.random.default_rng(0)
    exponents = rng.integers(-900, 900, 300)
    sizes = [1.0, -1.5, 2.0, math.nextafter(2.0, 0.0), *(rng.uniform(1, 2, 300) * 2.0**exponents)]
    for x in sizes:
        assert leading_power(float(x)) == 2.0 ** (math.frexp(abs(x))[1] - 1)
    assert first_size(lm.mat(lm.vec(0.0, -2.0), lm.vec(-2.0, 1.0))) == 2.0


def test_the_largest_step_of_an_ensemble_is_that_of_its_fastest_body() -> None:
    method, body = lm.CovariantVariational(lm.Exponential()), lm.RigidBody(MOMENTS)
    mu = np.random.default_rng(1).normal(size=(50, 3))
    alone = [method.largest_step(body, body.state(m)) for m in mu]
    for power in -1000, 0, 1000:  # squares of it are no floats
        found = method.largest_step(body, body.state(2.0**power * mu))
        assert found == pytest.approx(2.0**-power * min(alone), rel=1e-15)
