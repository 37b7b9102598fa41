"""Methods to compare with: their equations, orders, and which structure each of them keeps."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import (
    CAYLEY,
    EXP,
    asymmetric_body,
    hat,
    named,
    poisson_defect,
    quiet_body,
    rotation,
    same_bits,
    seed_body,
    slope,
)
from scipy.linalg import expm

import liemech as lm
from liemech.integrators.free_body.midpoint import ImplicitMidpoint, Isospectral, SphericalMidpoint
from liemech.integrators.free_body.moser_veselov import ExactMoserVeselov, MoserVeselov
from liemech.integrators.free_body.splitting import ThreeRotations
from liemech.tableaus import DOP853, gauss

IMPLICIT, SPHERICAL, VESELOV, ROTATIONS = (ImplicitMidpoint(), SphericalMidpoint(), MoserVeselov(), ThreeRotations())
GAUSS = [Isospectral(p) for p in (2, 4, 6, 8)]
METHODS = [IMPLICIT, SPHERICAL, VESELOV, ROTATIONS, *GAUSS]
each = pytest.mark.parametrize("method", METHODS, ids=named)
# ---------------------------------------------------------------- the equations


def one_step(method: lm.Method, h: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The moments of a body, its momentum before and after a step, and the turn of the step."""
    body, start = asymmetric_body()
    run = lm.integrate(body, method, start, h=h, steps=1)
    return np.array(body.inertia), run.mu[0], run.mu[1], run.g[0].T @ run.g[1]


def test_implicit_midpoint_solves_its_equation() -> None:
    J, before, after, turn = one_step(IMPLICIT, 0.4)
    m = (before + after) / 2
    assert np.abs(after - before - 0.4 * np.cross(m, m / J)).max() < 1e-15
    assert np.abs(turn.T @ before - after).max() < 1e-15


def test_spherical_midpoint_solves_its_equation() -> None:
    J, before, after, turn = one_step(SPHERICAL, 0.4)
    m = (before + after) * np.linalg.norm(before) / np.linalg.norm(before + after)
    assert np.abs(after - before - 0.4 * np.cross(m, m / J)).max() < 1e-15
    assert np.abs(turn.T @ before - after).max() < 1e-15


def test_moser_veselov_solves_its_equation() -> None:
    J, before, after, turn = one_step(VESELOV, 0.4)
    J_d = np.diag(J.sum() / 2 - J)
    assert np.abs(turn @ J_d - J_d @ turn.T - 0.4 * hat(before)).max() < 1e-15
    assert np.abs(turn.T @ before - after).max() < 1e-15


def test_three_rotations_are_three_rotations() -> None:
    J, before, after, turn = one_step(ROTATIONS, 0.4)
    mu, g = before, np.eye(3)
    for axis, share in ((0, 0.5), (1, 0.5), (2, 1.0), (1, 0.5), (0, 0.5)):
        part = expm(0.4 * share * mu[axis] / J[axis] * hat(np.eye(3)[axis]))
        mu, g = part.T @ mu, g @ part
    assert np.abs(mu - after).max() < 1e-15
    assert np.abs(g - turn).max() < 1e-15


@pytest.mark.parametrize("method", GAUSS, ids=named)
def test_isospectral_methods_as_matrices(method: Isospectral) -> None:
    """Q_i and P_i apart, by linear solves, the stages W_i = Q_i P_i iterated: the definition for
    any quadratic matrix algebra.
    """
    h = 0.4
    J, before, after, turn = one_step(method, h)
    tableau, one, W = gauss(method.order // 2), np.eye(3), hat(before)
    A, b, s = np.array([[*row] for row in tableau.A]), np.array(tableau.b), len(tableau.b)
    stages = [W] * s
    for _ in range(100):
        B = [-hat(np.array([w[2, 1], w[0, 2], w[1, 0]]) / J) for w in stages]
        big = np.eye(3 * s) - h * np.block([[A[i, j] * B[j] for j in range(s)] for i in range(s)])
        Q = np.linalg.solve(big, np.vstack([one] * s)).reshape(s, 3, 3)
        back = np.eye(3 * s) + h * np.block([[A[j, i] * B[i] for j in range(s)] for i in range(s)])
        P = np.linalg.solve(back.T, np.vstack([W.T] * s)).reshape(s, 3, 3).transpose(0, 2, 1)
        stages = [q @ p for q, p in zip(Q, P, strict=True)]
    Q_new = one + h * sum(b[i] * B[i] @ Q[i] for i in range(s))
    P_new = W - h * sum(b[i] * P[i] @ B[i] for i in range(s))
    assert np.abs(Q_new @ P_new - hat(after)).max() < 2e-15
    assert np.abs(Q_new.T - turn).max() < 2e-15


def test_relatives_of_the_cayley_map() -> None:
    """With x the Cayley vector of a step and p = J x/h, three methods differ in how p and mu at its start are related."""
    J, mu, _, turn = one_step(IMPLICIT, 0.4)
    x = np.array(lm.SO3().cayley_inv(turn))
    p = J * x / 0.4
    assert np.abs(p + np.cross(x, p) / 2 - mu).max() < 1e-15
    J, mu, _, turn = one_step(CAYLEY, 0.4)
    x = np.array(lm.SO3().cayley_inv(turn))
    p = J * x / 0.4
    assert np.abs(p + np.cross(x, p) / 2 + x * (x @ p) / 4 - mu).max() < 1e-15
    J, mu, _, turn = one_step(VESELOV, 0.4)
    x = np.array(lm.SO3().cayley_inv(turn))
    p = J * x / 0.4
    assert np.abs(mu - np.cross(x, mu) / 2 + x * (x @ mu) / 4 - p).max() < 1e-15


# ---------------------------------------------------------------- order, symmetry, structure


@pytest.mark.slow
def test_who_is_more_accurate() -> None:
    """Errors at T = 2 with 40 steps of the article's body, over those of Algorithm 1 with exp."""
    body, start = seed_body()
    exact = body.exact(start, 2.0).mu
    error = {
        m.name: np.abs(lm.integrate(body, m, start, h=0.05, steps=40).mu[-1] - exact).max()
        for m in (*METHODS, EXP, CAYLEY)
    }
    assert error["Spherical midpoint"] < 0.2 * error["Implicit midpoint"]
    assert error["Implicit midpoint"] < error[EXP.name] < error["Moser-Veselov"] < error[CAYLEY.name]
    assert error["Isospectral Gauss 2"] == pytest.approx(error[CAYLEY.name], abs=1e-13)
    assert error["Isospectral Gauss 4"] < 1e-7
    assert error["Isospectral Gauss 6"] < 3e-12


@pytest.mark.slow
def test_energy_of_large_steps() -> None:
    """A thousand steps h = 0.5: bounded, or exact."""
    body, start = seed_body()
    for method, bound in (
        (ROTATIONS, 1.8e-3),
        (EXP, 1.0e-3),
        (CAYLEY, 2.6e-3),
        *((m, 0.0) for m in (IMPLICIT, SPHERICAL, VESELOV)),
    ):
        run = lm.integrate(body, method, start, h=0.5, steps=1000)
        assert np.abs(run.energy - run.energy[0]).max() == pytest.approx(bound, rel=0.05, abs=2e-14), method


# ---------------------------------------------------------------- other energies, other axes, rest


@lm.record
class Quartic(lm.Hamiltonian):
    """An energy that is no kinetic energy."""

    stiffness: float

    def energy(self, mu: lm.Vec) -> float:
        return 0.5 * lm.dot(mu, mu / lm.vec(1.0, 2.0, 3.0)) + self.stiffness * mu[0] ** 4 + self.stiffness * mu[1] ** 3


@pytest.mark.slow
@pytest.mark.parametrize("method", [IMPLICIT, SPHERICAL, Isospectral(4)], ids=named)
def test_any_hamiltonian(method: lm.Method) -> None:
    system = lm.LiePoissonSystem(lm.SO3(), Quartic(0.3))
    start = system.state([0.6, -0.4, 0.8], np.eye(3))
    exact = lm.integrate(system, lm.RKMK(tableau=DOP853), start, h=0.02, steps=100).last
    counts, errors = (20, 40, 80), []
    for n in counts:
        last = lm.integrate(system, method, start, h=2.0 / n, steps=n).last
        errors.append(
            [np.abs(np.array(last.mu) - np.array(exact.mu)).max(), np.abs(np.array(last.g) - np.array(exact.g)).max()]
        )
    for error in np.transpose(errors):
        assert slope([1 / n for n in counts], error) == pytest.approx(method.order, abs=0.1)  # type: ignore[attr-defined]
    assert (poisson_defect(system, method, np.array([0.6, -0.4, 0.8]), 0.3) < 1e-11) == method.symplectic


@pytest.mark.sample(2)
@pytest.mark.parametrize("method", [IMPLICIT, SPHERICAL, VESELOV, Isospectral(4)], ids=named)
def test_axes_do_not_matter(method: lm.Method) -> None:
    """The same body in other axes of its own: J = U diag U^T, mu -> U mu, g -> g U^T."""
    body, start = asymmetric_body()
    U = rotation(np.random.default_rng(4))
    tilted = lm.RigidBody(U @ np.diag(np.array(body.inertia)) @ U.T)
    other = tilted.state(U @ np.array(start.mu), np.array(start.g) @ U.T)
    a = lm.integrate(body, method, start, h=0.2, steps=50)
    b = lm.integrate(tilted, method, other, h=0.2, steps=50)
    assert np.abs(a.mu @ U.T - b.mu).max() < 1e-13
    assert np.abs(a.g @ U.T - b.g).max() < 1e-13


# ---------------------------------------------------------------- the end of their range


def directions(n: int) -> np.ndarray:
    """Unit vectors in all directions."""
    mu = np.random.default_rng(7).normal(size=(n, 3))
    return mu / np.linalg.norm(mu, axis=1)[:, None]


def test_range_of_moser_veselov() -> None:
    """h|mu| = 0.6 always works for the article's body, 2 never; in between it depends on the direction."""
    body, _ = seed_body()
    for h, wanted in ((0.6, {30}), (0.8, set(range(12, 30))), (2.0, {0})):
        through = 0
        for mu in directions(30):
            try:
                lm.integrate(body, VESELOV, body.state(mu), h=h, steps=1, compiled=False)
            except lm.errors.NoConvergence as error:
                assert "no step F from here" in str(error)
                assert "CovariantVariational(Cayley())" in str(error)
            else:
                through += 1
        assert through in wanted, h


@pytest.mark.parametrize("method", [SPHERICAL, Isospectral(4)], ids=named)
def test_steps_that_are_too_large_end_the_run(method: lm.Method) -> None:
    body = quiet_body([0.1, 1.0, 3.0])
    with pytest.raises(lm.errors.IntegrationFailure, match="too large for this motion; try"):
        lm.integrate(body, method, body.state([0.3, 0.9, 0.4]), h=40.0, steps=50)


# ---------------------------------------------------------------- the fitted method


EXACT_BODIES = {
    "seed": ((2 / 3, 1.0, 2.0), (0.5, 0.0, 0.75**0.5)),
    "other side": ((2 / 3, 1.0, 2.0), (0.9, 0.2, 0.3)),
    "asymmetric": ((1.0, 1.6, 2.3), (0.4, 1.1, 0.5)),
    "round": ((1.0, 1.0, 1.7), (0.4, 0.8, 0.5)),
    "sphere": ((1.3, 1.3, 1.3), (0.4, 0.8, 0.5)),
    "steady": ((1.0, 1.6, 2.3), (0.0, 0.0, 1.2)),
    "nearly steady": ((1.0, 1.6, 2.3), (1e-7, 1e-7, 1.2)),
    "heavy": ((1e9, 1.6e9, 2.3e9), (0.4e9, 1.1e9, 0.5e9)),
}


@pytest.mark.sample(3)
@pytest.mark.parametrize("case", EXACT_BODIES)
@pytest.mark.parametrize("h", [0.05, 0.4])
def test_fitted_steps_are_exact(case: str, h: float) -> None:
    inertia, mu = EXACT_BODIES[case]
    body = quiet_body(inertia)
    start = body.state(mu, rotation(np.random.default_rng(6)))
    method, steps = ExactMoserVeselov.of(body, start, h), round(40 / h)
    run = lm.integrate(body, method, start, h=h, steps=steps, every=steps // 10)
    exact = body.exact(start, run.t)
    assert np.abs(run.mu - exact.mu).max() < 2e-13 * np.linalg.norm(mu)
    assert np.abs(run.g - exact.g).max() < 2e-13


def test_fitted_steps_in_other_axes_and_back() -> None:
    U = rotation(np.random.default_rng(4))
    body = lm.RigidBody(U @ np.diag([1.0, 1.6, 2.3]) @ U.T)
    start = body.state([0.4, 1.1, 0.5], U)
    method = ExactMoserVeselov.of(body, start, 0.3)
    there = lm.integrate(body, method, start, h=0.3, steps=200)
    exact = body.exact(start, 60.0)
    assert np.abs(there.mu[-1] - exact.mu).max() < 2e-13
    assert np.abs(there.g[-1] - exact.g).max() < 2e-13
    back = lm.integrate(body, method, there.last, h=-0.3, steps=200)
    assert np.abs(back.mu[-1] - np.array(start.mu)).max() < 1e-13
    assert np.abs(back.g[-1] - U).max() < 1e-13


def test_fitted_steps_follow_every_start_on_the_orbit() -> None:
    """Fitted at one point, exact from all others of the same energy and |mu|."""
    body, start = asymmetric_body()
    method = ExactMoserVeselov.of(body, start, 0.3)
    for t in (1.7, 4.1):
        at = body.exact(start, t)
        other = body.state(at.mu, np.eye(3))
        run = lm.integrate(body, method, other, h=0.3, steps=100)
        exact = body.exact(other, 30.0)
        assert np.abs(run.mu[-1] - exact.mu).max() < 2e-13
        assert np.abs(run.g[-1] - exact.g).max() < 2e-13


@pytest.mark.parametrize("compiled", [False, pytest.param(True, marks=pytest.mark.compiled)])
def test_fitted_steps_refuse_other_motions(compiled: bool) -> None:
    body, start = asymmetric_body()
    method = ExactMoserVeselov.of(body, start, 0.3)
    for other, h in ((start, 0.2), (body.state(1.01 * np.array(start.mu)), 0.3), (body.state([0.0, 0.0, 1.3]), 0.3)):
        with pytest.raises(lm.errors.InconsistentState, match=r"was fitted to another motion, with h = 0\.3"):
            lm.integrate(body, method, other, h=h, steps=5, compiled=compiled)
    turned = lm.RigidBody(np.array(body.inertia)[[1, 2, 0]])  # the same motion under other names
    with pytest.raises(lm.errors.InconsistentState, match="was fitted to another motion"):
        lm.integrate(turned, method, turned.state(np.array(start.mu)[[1, 2, 0]]), h=0.3, steps=5, compiled=compiled)
    many = body.state(np.outer([1.0, 1.1, 1.0], np.array(start.mu)))
    with pytest.warns(RuntimeWarning, match="body 1 after 0 steps"):
        run = lm.integrate(body, method, many, h=0.3, steps=5, compiled=compiled)
    assert same_bits(np.ascontiguousarray(run.mu[:, 0]), np.ascontiguousarray(run.mu[:, 2]))
    with pytest.raises(lm.errors.InvalidInput, match="one body at a time"):
        ExactMoserVeselov.of(body, many, 0.3)
    with pytest.raises(lm.errors.IncompatibleSystem, match="a method for the free rigid body"):
        ExactMoserVeselov.of(lm.SO3(), start, 0.3)  # type: ignore[arg-type]
    with pytest.raises(lm.errors.NoConvergence, match="too large"):
        ExactMoserVeselov.of(body, start, 5.0)


# ---------------------------------------------------------------- refusals


@each
def test_other_systems_are_refused(method: lm.Method) -> None:
    kirchhoff = lm.LiePoissonSystem(lm.SE3(), lm.KineticEnergy([1.0, 2.0, 3.0, 1.0, 1.0, 2.0]))
    with pytest.raises(
        lm.errors.IncompatibleSystem, match=r"such as RigidBody\(\[1.0, 1.5, 2.0\]\).*; got LiePoissonSystem"
    ):
        lm.integrate(kirchhoff, method, kirchhoff.state(np.ones(6)), h=0.1, steps=1)


@pytest.mark.parametrize("method", [VESELOV, ROTATIONS], ids=named)
def test_methods_of_the_free_body_refuse_other_energies(method: lm.Method) -> None:
    system = lm.LiePoissonSystem(lm.SO3(), Quartic(0.3))
    with pytest.raises(lm.errors.IncompatibleSystem, match="is a method for the free rigid body"):
        method.require(system)


def test_three_rotations_need_principal_axes() -> None:
    with pytest.raises(lm.errors.IncompatibleSystem, match="needs three principal moments"):
        ROTATIONS.require(lm.RigidBody([[2.0, 0.1, 0.0], [0.1, 1.5, 0.0], [0.0, 0.0, 1.0]]))
