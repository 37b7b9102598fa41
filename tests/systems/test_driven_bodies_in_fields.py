"""Bodies in fields whose energy changes with time: orders, rockets, what stays constant, and what the
change of the energy does.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import simpson, solve_ivp

import liemech as lm
from liemech.errors import IncompatibleSystem, InvalidInput, InvalidType
from liemech.models.bodies.gravity import FixedPointGravity


@lm.record
class Burning(lm.DrivenKineticEnergy):
    """Moments that fall evenly."""

    first: lm.Vec
    rate: lm.Vec

    def inertia(self, t: float) -> Any:
        return self.first - t * self.rate


@lm.record
class Shifting(Burning):
    """The same with a product of inertia."""

    product: float = 0.4

    def inertia(self, t: float) -> Any:
        a, b, c = self.first - t * self.rate
        p = self.product * (1.0 + 0.5 * lm.formulas.sin(t))
        return lm.mat((a, p, 0.0), (p, b, 0.0), (0.0, 0.0, c))


@lm.record
class Push(lm.Force):
    torque: lm.Vec

    def covector(self, t: float, xi: Any, g: Any) -> Any:
        return lm.formulas.cos(t) * self.torque - 0.1 * xi


@lm.record
class Pulse(lm.Term):
    field: lm.Vec

    def energy(self, a: Any, t: float) -> Any:
        return -t * lm.dot(self.field, a.mu)


FIRST, RATE, TORQUE = [2.0, 3.0, 2.5], [0.2, 0.1, 0.3], [0.1, 0.2, -0.1]
FIELD = FixedPointGravity(0.9, [0.3, 0.2, 0.8])


def system(load: bool = True, product: float = 0.0, rate: Any = RATE) -> Any:
    energy = Shifting(FIRST, rate, product) if product else Burning(FIRST, rate)
    body = lm.DrivenLiePoissonSystem(lm.SO3(), energy)
    return lm.MechanicalSystem(body, FIELD, load=Push(TORQUE) if load else None)


START = system().state(mu=[0.5, -0.3, 0.7], g=lm.SO3().exp([0.2, 0.3, 0.1]))


def by_scipy(product: float, t0: float, t_end: float) -> np.ndarray:
    """mu' = mu x xi + f + F, g' = g hat(xi), written down anew: momentum and rotation at the end."""

    def slope(t: float, y: np.ndarray) -> np.ndarray:
        mu, g = y[:3], y[3:].reshape(3, 3)
        J = np.diag(np.array(FIRST) - t * np.array(RATE))
        J[0, 1] = J[1, 0] = product * (1.0 + 0.5 * np.sin(t))
        xi = np.linalg.solve(J, mu)
        torque = 0.9 * np.cross(g[2], [0.3, 0.2, 0.8]) + np.cos(t) * np.array(TORQUE) - 0.1 * xi
        hat = np.array([[0, -xi[2], xi[1]], [xi[2], 0, -xi[0]], [-xi[1], xi[0], 0]])
        return np.concatenate([np.cross(mu, xi) + torque, (g @ hat).ravel()])

    y = np.concatenate([START.mu, np.ravel(START.g)])
    return solve_ivp(slope, (t0, t_end), y, "DOP853", rtol=1e-13, atol=1e-14).y[:, -1]


METHODS = {
    "RKMK": (lm.RKMK(order=4), 4),
    "commutator-free": (lm.CommutatorFree(order=4), 4),
    "KickDrift": (lm.KickDrift(), 2),
    "LieVerlet": (lm.LieVerlet(), 2),
    "Cayley": (lm.LieVerlet(lm.Cayley()), 2),
    "Hamilton-Jacobi": (lm.KickDrift(lm.LiePoissonHamiltonJacobi(order=2)), 2),
    "Galerkin": (lm.GalerkinVariational(order=4), 4),
    "composition": (lm.Composition(lm.KickDrift(), order=4), 4),
}


@pytest.mark.sample(3)
@pytest.mark.parametrize("product", [0.0, 0.4], ids=["moments", "matrix"])
@pytest.mark.parametrize("name", METHODS)
def test_orders_under_a_field_a_load_and_time(name: str, product: float) -> None:
    method, order = METHODS[name]
    exact, errors = by_scipy(product, 1.0, 3.0), []
    for steps in (16, 32):
        run = lm.integrate(
            system(product=product), method, START, h=2.0 / steps, steps=steps, t0=1.0, compiled=False
        )  # fmt: skip
        end = np.concatenate([run.mu[-1], run.g[-1].ravel()])
        errors.append(np.abs(end - exact).max())
    assert abs(np.log2(errors[0] / errors[1]) - order) < 0.25
    assert errors[1] < (1e-6 if order == 4 else 1e-2)


@lm.record
class Rocket(lm.DrivenKineticEnergy):
    """A body on SE(3) whose mass falls from m by r t, with moments in proportion."""

    mass: float
    burn: float

    def inertia(self, t: float) -> Any:
        m = self.mass - self.burn * t
        return lm.vec(0.4 * m, 0.4 * m, 0.2 * m, m, m, m)


@lm.record
class Thrust(lm.Force):
    """Mass leaves with the velocity of the body and, along e3, with u beside it: momentum r (u e3 -
    v), and angular momentum -r k^2 w."""

    burn: float
    speed: float

    def covector(self, t: float, xi: Any, g: Any) -> Any:
        w, v = lm.vec(*xi[:3]), lm.vec(*xi[3:])
        turn = -self.burn * lm.vec(0.4 * w[0], 0.4 * w[1], 0.2 * w[2])
        push = self.burn * (lm.vec(0.0, 0.0, self.speed) - v)
        return lm.vec(*turn, *push)


@pytest.mark.parametrize("method", [lm.RKMK(order=4), lm.KickDrift()], ids=["RKMK", "KickDrift"])
def test_a_rocket_is_that_of_tsiolkovsky(method: Any) -> None:
    """v = u ln(m_0/m) along its axis, about which it turns as fast as it did."""
    body = lm.DrivenLiePoissonSystem(lm.SE3(), Rocket(10.0, 2.0))
    rocket = lm.MechanicalSystem(body, lm.NoPotential(), load=Thrust(2.0, 3.0))
    start = rocket.state(mu=[0.0, 0.0, 0.2 * 10.0 * 0.7, 0.0, 0.0, 0.0], g=np.eye(4))
    errors = []
    for steps in (40, 80):
        run = lm.integrate(rocket, method, start, h=4.0 / steps, steps=steps, compiled=False)
        xi = rocket.velocity(run.mu, run.t)
        exact = 3.0 * np.log(10.0 / (10.0 - 2.0 * run.t))
        errors.append(np.abs(xi[:, 5] - exact).max())
        assert np.abs(xi[:, 2] - 0.7).max() < 2e-3 and np.abs(xi[:, :2]).max() < 1e-15
    assert abs(np.log2(errors[0] / errors[1]) - method.order) < 0.2 and errors[1] < 3e-3


@pytest.mark.parametrize("load", [True, False])
def test_the_balance_of_energy(load: bool) -> None:
    """E(t) - E(0) is the integral of dK/dt + <F, xi>; dK/dt = xi . (-J') xi/2 is checked by hand."""
    here = system(load)
    run = lm.integrate(here, lm.RKMK(order=8), START, h=0.02, steps=100, compiled=False)
    power = here.power(run.mu, run.g, run.t)
    work, size = simpson(power, x=run.t), np.abs(power).sum() * 0.02
    assert abs(run.energy[-1] - run.energy[0] - work) < 1e-7 * size
    xi = here.velocity(run.mu, run.t)
    by_hand = 0.5 * (xi**2 * np.array(RATE)).sum(axis=1)
    if load:
        by_hand += (np.cos(run.t)[:, None] * TORQUE * xi - 0.1 * xi**2).sum(axis=1)
    assert np.allclose(here.power(run.mu, run.g, run.t), by_hand, rtol=1e-13)


def test_what_a_symmetry_keeps_time_does_not_take() -> None:
    """The vertical momentum, to rounding, while the energy moves; nothing else is claimed."""
    run = lm.integrate(system(load=False), lm.KickDrift(), START, h=0.05, steps=80, compiled=False)
    assert [*run.drift()] == ["vertical momentum"] and np.ptp(run.energy) > 0.05
    kept = run.spatial_momentum[:, 2]
    assert np.abs(kept - kept[0]).max() < 1e-14
    back = lm.integrate(system(load=False), lm.KickDrift(), run.last, h=-0.05, steps=80, t0=4.0, compiled=False)
    assert np.abs(back.mu[-1] - START.mu).max() < 1e-13  # symmetric in time, too


@pytest.mark.compiled
@pytest.mark.parametrize("name", ["RKMK", "KickDrift", "LieVerlet", "Galerkin"])
def test_native_code_has_the_same_bits_and_without_change_the_body_has_them(name: str) -> None:
    method, _ = METHODS[name]
    given = {"h": 0.05, "steps": 20}
    both = [lm.integrate(system(), method, START, compiled=c, **given) for c in (True, False)]
    assert np.array_equal(both[0].mu, both[1].mu) and np.array_equal(both[0].g, both[1].g)
    still = lm.integrate(system(rate=[0.0] * 3), method, START, compiled=False, **given)
    body = lm.MechanicalSystem(lm.RigidBody(FIRST), FIELD, load=Push(TORQUE))
    plain = lm.integrate(body, method, START, compiled=False, **given)
    assert np.array_equal(still.mu, plain.mu) and np.array_equal(still.g, plain.g)
    assert np.array_equal(still.energy, plain.energy)


def test_the_tangent_map_by_what_changes_with_time() -> None:
    """By the rates at which the moments fall, against differences of runs."""
    name, given = "body.hamiltonian.rate", {"steps": 10, "t0": 1.0}
    plan = lm.Plan(system(), lm.KickDrift(), h=0.1, compiled=False)
    found = plan.tangent(START, by=name, **given).tangent[name][-1, :3, 0]
    ends = [
        plan.replace(system=system(rate=[RATE[0] + e, *RATE[1:]])).run(START, **given).mu[-1] for e in (1e-5, -1e-5)
    ]
    assert np.abs((ends[0] - ends[1]) / 2e-5 - found).max() < 1e-7 * np.abs(found).max()


def test_ensembles_know_the_time() -> None:
    starts = system().state(mu=np.tile(START.mu, (3, 1)), g=np.tile(START.g, (3, 1, 1)))
    given = {"h": 0.1, "steps": 4, "t0": 0.5, "compiled": False}
    alone = lm.integrate(system(), lm.RKMK(order=4), START, **given)
    for systems in (system(), [system()] * 3):
        runs = lm.integrate(systems, lm.RKMK(order=4), starts, **given)
        assert np.array_equal(runs.energy[:, 2], alone.energy)
        kept = lm.integrate(systems, lm.RKMK(order=4), starts, record=("energy", "power"), **given)
        assert np.array_equal(kept.energy, runs.energy)
        power = system().power(alone.mu, alone.g, alone.t)
        assert np.array_equal(kept.states["power"][:, 1], power)


@pytest.mark.slow
def test_checks_and_refusals() -> None:
    assert lm.check_system(system(), START)
    with pytest.raises(InvalidInput, match="give mu; the momentum of a velocity changes"):
        system().state(xi=[0.1, 0.0, 0.0], g=np.eye(3))
    with pytest.raises(IncompatibleSystem, match=r"Composition\(KickDrift\(\), order=4\)"):
        lm.Plan(system(), lm.KickDrift(order=4), h=0.1)
    with pytest.raises(InvalidInput, match="a KineticEnergy"):
        lm.ConstrainedBody(system(), lm.joints.Blade())
    spins = lm.DrivenLiePoissonSystem(lm.SO3() ** 4, lm.Terms(Pulse([1.0, 0.0, 0.0])))
    with pytest.raises(InvalidInput, match="many sites in a field cannot change with time"):
        lm.MechanicalSystem(spins, lm.NoPotential())
    with pytest.raises(InvalidType, match="body must be a LiePoissonSystem"):
        lm.MechanicalSystem(lm.Kepler(), FIELD)
