"""Chaplygin's reducing multiplier: bodies bound by a condition on velocities as canonical motions in another time.

A point in space with z' = y x' has the reduced energy H = (p_x^2/(1 + y^2) + p_y^2)/2 + U(x, y) and the multiplier
N = (1 + y^2)^(-1/2): with P = N p it is canonical in the time s, ds = N dt, and keeps the measure N dq dp in the time t.
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import pytest
from scenes import Slope
from scipy.integrate import solve_ivp

import liemech as lm


@lm.record
class Bowl(lm.Potential):
    """U(x, y), of which no direction is like another."""

    def energy(self, g: Any) -> Any:
        return bowl(g[0], g[1])


def bowl(x: Any, y: Any) -> Any:
    """The potential U."""
    return 0.5 * (x * x + 1.3 * y * y) + 0.2 * x * x * y + 0.05 * y * y * y * y


@lm.record
class Hamiltonised(lm.HamiltonianSystem):
    """The point in the time s: H(q, P) = (P_x^2 + (1 + y^2) P_y^2)/2 + U, q = (x, y)."""

    degrees: ClassVar[int] = 2

    def energy(self, q: Any, p: Any) -> Any:
        return 0.5 * (p[0] * p[0] + (1.0 + q[1] * q[1]) * p[1] * p[1]) + bowl(q[0], q[1])


def multiplier(q: Any) -> Any:
    """N = ds/dt."""
    return 1.0 / lm.formulas.sqrt(1.0 + q[1] * q[1])


POINT = lm.NonholonomicBody(
    lm.MechanicalSystem(lm.LiePoissonSystem(lm.VectorSpace(3), lm.KineticEnergy([1.0] * 3)), Bowl()), Slope()
)
IN_TIME_T = lm.TimeTransformed(Hamiltonised(), multiplier)
GAUSS = lm.RKMK(tableau=lm.tableaus.gauss(2))
PLACE, VELOCITY = np.array([0.4, -0.7]), np.array([0.5, 0.3])


def begun() -> tuple[Any, Any]:
    """One start of both: of the point, and with P = N p, p_x = (1 + y^2) x', p_y = y'."""
    (x, y), (u, v) = PLACE, VELOCITY
    w = np.sqrt(1.0 + y * y)
    return POINT.state(mu=[u, v, y * u], g=[x, y, 0.1]), Hamiltonised().state(q=[x, y], p=[w * u, v / w])


def rates(t: float, y: np.ndarray) -> np.ndarray:
    """The reduced motion of (x, y, p_x, p_y) in the time t, by Lagrange and d'Alembert: p_x' = y y' p_x/(1 + y^2) - U_x,
    p_y' = -U_y.
    """
    x, z, p, r = y
    return np.array([
        p / (1.0 + z * z), r, z * r * p / (1.0 + z * z) - x - 0.4 * x * z,
        -1.3 * z - 0.2 * x * x - 0.2 * z**3,
    ])  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("method", [GAUSS, lm.HamiltonJacobi(order=4)])
def test_the_canonical_motion_is_that_of_the_body(method: Any) -> None:
    """Fixed steps in the time t, of order 4, beside SciPy; the body by its own method comes to where SciPy does, too."""
    start, canonical = begun()
    (x, y), (u, v) = PLACE, VELOCITY
    exact = solve_ivp(rates, (0.0, 4.0), [x, y, (1.0 + y * y) * u, v], "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    errors = []
    for n in (40, 80):
        run = lm.integrate(IN_TIME_T, method, canonical, h=4.0 / n, steps=n, compiled=False)
        w = np.sqrt(1.0 + run.q[-1, 1] ** 2)
        errors.append(np.abs(np.concatenate([run.q[-1], run.p[-1] * [w, w]]) - exact).max())
        assert run.tau[-1] == pytest.approx(4.0, rel=1e-14)
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.25)
    body = lm.integrate(POINT, lm.LagrangeDAlembert(), start, h=0.01, steps=400, compiled=False)
    assert body.g[-1, :2] == pytest.approx(exact[:2], abs=1e-3)


@pytest.mark.slow
def test_the_measure_is_kept_by_the_motion_and_by_canonical_steps() -> None:
    """det of the map of (q, p) in the time s times N^2 there over N^2 here is one: of canonical steps to rounding, of
    SciPy's motion to its tolerance; without the factor it is not.
    """
    _, canonical = begun()
    run = lm.Plan(Hamiltonised(), GAUSS, h=0.1, compiled=False).tangent(canonical, steps=30)
    assert np.linalg.det(run.tangent["start"]) == pytest.approx(np.ones(31), abs=1e-13)
    # in the time t the density is N: the divergence of N f is zero, of f it is not
    rng = np.random.default_rng(1)
    fields = (lambda y: rates(0.0, y), lambda y: rates(0.0, y) / np.sqrt(1.0 + y[1] ** 2))
    for at in rng.normal(size=(5, 4)):
        f, weighted = (
            sum((g(at + 1e-5 * e) - g(at - 1e-5 * e))[k] / 2e-5 for k, e in enumerate(np.eye(4))) for g in fields
        )
        assert abs(weighted) < 1e-8 and abs(f) > 1e-3


@pytest.mark.slow
def test_the_energy_of_the_canonical_motion_does_not_drift() -> None:
    """Over ten thousand steps, the largest error of the second half is that of the first."""
    run = lm.integrate(IN_TIME_T, GAUSS, begun()[1], h=0.25, steps=10_000, every=5)
    error = np.abs(Hamiltonised().energy(run.q, run.p) - Hamiltonised().energy(run.q[0], run.p[0]))
    first, second = error[:1000].max(), error[1000:].max()
    assert second < 1.1 * first and first > 1e-8


@lm.record
class Veselova(lm.VelocityConstraint):
    """A body about a fixed point whose angular velocity stays across a direction of space, gamma . w = 0."""

    def matrix(self, g: Any) -> Any:
        return lm.mat(g[2])


@pytest.mark.parametrize("power, kept", [(0.5, True), (0.0, False)])
def test_the_measure_of_Veselovas_problem(power: float, kept: bool) -> None:
    """Of (w, gamma) the motion keeps (gamma . J^-1 gamma)^(1/2) dw dgamma: rates by the class, on the condition and off it
    by what is linear there.
    """
    J = np.array([1.0, 1.7, 2.4])
    body = lm.NonholonomicBody(lm.RigidBody(J), Veselova())

    def velocity(y: np.ndarray) -> np.ndarray:
        w, gamma = y[:3], y[3:]
        pull = gamma @ (np.cross(J * w, w) / J) / (gamma @ (gamma / J))
        return np.concatenate([(np.cross(J * w, w) - pull * gamma) / J, np.cross(gamma, w)])

    g = np.array(lm.SO3().exp([0.3, -0.5, 0.8]))
    w = np.cross(g[2], [0.3, 0.7, -0.2])
    rate = np.array(body.rate(0.0, body.state(mu=J * w, g=g)))
    at = np.concatenate([w, g[2]])
    assert (np.cross(J * w, w) + rate[3:]) / J == pytest.approx(velocity(at)[:3], rel=1e-12)
    density = lambda y: (y[3:] @ (y[3:] / J)) ** power  # noqa: E731
    unit = 1e-5 * np.eye(6)
    flow = sum((density(at + e) * velocity(at + e) - density(at - e) * velocity(at - e))[k] for k, e in enumerate(unit))
    assert bool(abs(flow / 2e-5) < 1e-9) is kept
