"""Galerkin variational methods: the method itself to 15 digits, orders 2 to 8 on several groups,
and the structure it keeps.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scenes import EXP, TOP, PlaneMotions, asymmetric_body, heavy_top, kirchhoff_body, named, seed_body, slope, slow

import liemech as lm
from liemech.formulas import sin, sqrt
from liemech.integrators.galerkin import GalerkinVariational

ORDERS = 2, 4, 6, 8
EXPS = {order: GalerkinVariational(order) for order in ORDERS}
CAYLEYS = {order: GalerkinVariational(order, lm.Cayley()) for order in ORDERS}
ALL = pytest.mark.parametrize("method", [*EXPS.values(), *CAYLEYS.values()], ids=named)

# mu and g after one step h = 0.5 of order 4, seed body: the discrete action in 40 digits, its
# gradient by steps of 1e-25 i, its equations solved to 1e-40
REFERENCE = {
    "Exponential": (
        (0.476980327445000959, 0.212083409339821284, 0.852942198928659803),
        (
            (0.975042127671246566, -0.202392236941392731, 0.0912701029482691865),
            (0.221686053767002656, 0.910043203570917254, -0.350252282218968083),
            (-0.012171393985165366, 0.361744039426002431, 0.93219799780315806),
        ),
    ),
    "Cayley": (
        (0.476977104393369223, 0.212102158786903423, 0.852939339063718039),
        (
            (0.97504120952176455, -0.202392583728580934, 0.0912791421191270774),
            (0.22168991677792079, 0.910034440636406862, -0.350272604773168965),
            (-0.012174585550769158, 0.361765889640318952, 0.932189476747842059),
        ),
    ),
}


class Affine(lm.MatrixLieGroup):
    """x -> a x + b with a > 0, and nothing but its generators: not unimodular, no invariant form."""

    generators = np.array([[[1.0, 0.0], [0.0, 0.0]], [[0.0, 1.0], [0.0, 0.0]]])


@lm.record
class Euler(lm.Retraction):
    """Turns about the axes one after the other and back, each through half the angle: a retraction
    that is nothing but its tau.
    """

    def tau(self, group: Any, xi: lm.Vec) -> Any:
        a, b = group.exp(lm.vec(0.5 * xi[0], 0.0, 0.0)), group.exp(lm.vec(0.0, 0.5 * xi[1], 0.0))
        return a @ b @ group.exp(lm.vec(0.0, 0.0, xi[2])) @ b @ a


@lm.record
class Fast(lm.Hamiltonian, lm.Lagrangian):
    """A free body whose speed has a limit, l = -sqrt(1 - xi . J xi), H = sqrt(1 + mu . J^-1 mu);
    its derivatives are derived.
    """

    inertia: lm.Vec

    def energy(self, mu: lm.Vec) -> float:
        return sqrt(1.0 + lm.dot(mu, mu / self.inertia))

    def value(self, xi: lm.Vec) -> float:
        return -sqrt(1.0 - lm.dot(xi, self.inertia * xi))


@lm.record
class Driven(lm.Force):
    """Friction, and a torque that comes and goes."""

    def covector(self, t: float, xi: lm.Vec, g: Any) -> lm.Vec:
        return lm.vec(0.0, 0.3 * sin(2.0 * t), 0.0) - 0.2 * xi


@lm.record
class Springs(lm.Potential):
    """Two springs that are not linear, on the plane."""

    def energy(self, g: Any) -> float:
        return 0.5 * g[0] * g[0] + 0.25 * g[1] ** 4 + 0.3 * g[0] * g[1] * g[1]


def free(group: lm.LieGroup, seed: int = 3) -> tuple[lm.LiePoissonSystem, lm.BodyState]:
    """A free body on a group, started anywhere."""
    rng = np.random.default_rng(seed)
    system = lm.LiePoissonSystem(group, lm.KineticEnergy(np.linspace(1.0, 2.0, group.dim)))
    return system, system.state(0.5 * rng.normal(size=group.dim), np.array(group.exp(0.3 * rng.normal(size=group.dim))))


def assert_order(
    system: Any, method: lm.Method, start: lm.BodyState, end: Any, t_end: float, counts: Any, t0: float = 0.0
) -> None:
    """The errors of momentum and configuration fall as they should; of order 8 they are soon
    rounding, hence the wider bound.
    """
    (mu, g), errors = map(np.array, end), []
    for n in counts:
        run = lm.integrate(system, method, start, h=t_end / n, steps=n, t0=t0, compiled=False)
        errors.append([np.abs(run.mu[-1] - mu).max(), np.abs(run.g[-1] - g).max()])
    for error in np.array(errors).T:
        assert slope([1 / n for n in counts], error) == pytest.approx(
            method.order, abs=0.1 if method.order < 8 else 0.15
        )


# ---------------------------------------------------------------- the method itself


@pytest.mark.parametrize("method", [EXPS[4], CAYLEYS[4]], ids=named)
def test_a_step_of_the_method_itself(method: GalerkinVariational) -> None:
    body, start = seed_body()
    run = lm.integrate(body, method, start, h=0.5, steps=1)
    mu, g = REFERENCE[type(method.retraction).__name__]
    assert np.abs(run.mu[1] - mu).max() < 1e-15
    assert np.abs(run.g[1] - g).max() < 1e-15


@pytest.mark.sample(4)
@ALL
def test_the_action_is_stationary(method: GalerkinVariational) -> None:
    """sum_j b_j l(dtau_X_j V_j) - V(g tau(X_j)) does not change to first order with velocities that
    leave x; by differences.
    """
    top, start = heavy_top()
    group, tau, h = top.configurations, method.retraction, 0.3
    A, b, _, _ = (np.array(x) for x in method.tableau)
    memory = method.step(top, 0.0, method.start(top, start, h), h)
    V = np.array(memory.past[0])

    def action(V: np.ndarray) -> float:
        total = 0.0
        for X, v, weight in zip(h * A @ V, V, b):
            xi, g = tau.dtau(group, X, v), group.compose(start.g, tau.tau(group, X))
            total += weight * (0.5 * np.sum(np.array(top.inertia) * xi**2) - top.potential.energy(g))
        return total

    assert np.abs(np.array(group.compose(start.g, tau.tau(group, h * b @ V))) - np.array(memory.state.g)).max() < 1e-15
    gradient = np.empty_like(V)
    for place in np.ndindex(*V.shape):
        e = np.zeros_like(V)
        e[place] = 1e-3
        gradient[place] = (8 * (action(V + e) - action(V - e)) - (action(V + 2 * e) - action(V - 2 * e))) / 12e-3
    forces = gradient / b[:, None]
    assert np.abs(forces - forces[0]).max() < 1e-10


@pytest.mark.slow
def test_order_two_with_exp_is_the_variational_method() -> None:
    """One node in the middle, xi = V: h l(xi) and its action principle."""
    for system, start, h in ((*asymmetric_body(), 0.4), (*kirchhoff_body()[:2], 0.2), (*free(PlaneMotions()), 0.2)):
        ours, theirs = (lm.integrate(system, method, start, h=h, steps=40, compiled=False) for method in (EXPS[2], EXP))
        size = 1.0 + np.abs(theirs.g).max()
        assert np.abs(ours.mu - theirs.mu).max() < 1e-14
        assert np.abs(ours.g - theirs.g).max() < 2e-14 * size


def test_on_vectors_it_is_the_runge_kutta_method_of_gauss() -> None:
    """q' = p/m, p' = f(q): the discrete Lagrangian of Gauss' nodes gives Gauss' method."""
    masses = np.array([1.5, 0.7])
    plane = lm.LiePoissonSystem(lm.VectorSpace(2), lm.KineticEnergy(masses))
    system = lm.MechanicalSystem(plane, Springs())
    for order, method in EXPS.items():
        start = system.state([0.3, -0.4], [0.8, 0.5])
        run = lm.integrate(system, method, start, h=0.4, steps=3)
        A, b, _, _ = (np.array(x) for x in method.tableau)
        p, q = np.array(start.mu), np.array(start.g)
        for _ in range(3):
            k = np.zeros((order // 2, 2))
            for _ in range(100):
                at = q + 0.4 * A @ (p + 0.4 * A @ k) / masses
                x, y = at.T
                k = -np.stack([x + 0.3 * y * y, y**3 + 0.6 * x * y], axis=1)
            q = q + 0.4 * b @ ((p + 0.4 * A @ k) / masses)
            p = p + 0.4 * b @ k
        assert np.abs(run.mu[-1] - p).max() < 2e-15
        assert np.abs(run.g[-1] - q).max() < 2e-15


# ---------------------------------------------------------------- orders


@ALL
def test_order_of_a_heavy_top(method: GalerkinVariational) -> None:
    """Momentum and attitude, in a field."""
    top, start = heavy_top()
    at = TOP["samples"][2 if method.order == 8 else 1]
    counts = {2: (40, 80), 4: (20, 40), 6: (12, 24), 8: (12, 20) if method in EXPS.values() else (16, 24)}[method.order]
    assert_order(top, method, start, (np.array(at["pi"], float), np.array(at["R"], float)), float(at["t"]), counts)


@pytest.mark.slow
@pytest.mark.parametrize("method", EXPS.values(), ids=named)
def test_order_under_a_load_that_changes_with_time(method: GalerkinVariational) -> None:
    system, start = heavy_top(Driven())
    end = lm.integrate(system, lm.RKMK(order=8), start, h=0.01, steps=100, t0=0.3).last
    counts = {2: (20, 40), 4: (10, 20), 6: (5, 10), 8: (4, 7)}[method.order]
    assert_order(system, method, start, (end.mu, end.g), 1.0, counts, t0=0.3)


@pytest.mark.slow
@pytest.mark.parametrize("group", [Affine(), PlaneMotions(), lm.SO(4)], ids=["generators only", "exp only", "SO(4)"])
def test_orders_on_other_groups(group: lm.LieGroup) -> None:
    system, start = free(group)
    end = lm.integrate(system, lm.RKMK(order=8), start, h=0.025, steps=40, compiled=False).last
    for order, counts in ((2, (8, 16)), (4, (4, 8)), (6, (4, 8)), (8, (3, 4))):
        assert_order(system, EXPS[order], start, (end.mu, end.g), 1.0, counts)


@pytest.mark.slow
def test_order_with_a_retraction_of_ones_own() -> None:
    body, start = asymmetric_body()
    end = body.exact(start, 1.0)
    for system in (body, lm.MechanicalSystem(body, lm.NoPotential())):
        begin = system.state(start.mu, start.g)
        assert_order(system, GalerkinVariational(4, Euler()), begin, (end.mu, end.g), 1.0, (4, 8))


@pytest.mark.parametrize("order", (4, 6))
def test_order_of_a_lagrangian_that_is_not_quadratic(order: int) -> None:
    system = lm.LiePoissonSystem(lm.SO3(), Fast([1.0, 1.6, 2.3]))
    start = system.state([0.7, -0.4, 0.9], np.eye(3))
    assert np.abs(np.array(system.lagrangian.momentum(system.velocity(start.mu))) - np.array(start.mu)).max() < 1e-15
    end = lm.integrate(system, lm.RKMK(order=8), start, h=0.1, steps=40).last
    assert_order(system, EXPS[order], start, (end.mu, end.g), 4.0, {4: (8, 16), 6: (6, 12)}[order])


# ---------------------------------------------------------------- symmetry


@pytest.mark.slow
def test_only_order_two_with_exp_is_symmetric() -> None:
    """What claims to be symmetric finds its way back; of the others the chart at the start of a
    step is not that at its end.
    """
    for method in (*EXPS.values(), *CAYLEYS.values()):
        for system, start in (asymmetric_body(), heavy_top()):
            away = lm.integrate(system, method, start, h=0.3, steps=5, compiled=False)
            home = lm.integrate(system, method, away.last, h=-0.3, steps=5, compiled=False)
            error = max(np.abs(home.mu[-1] - np.array(start.mu)).max(), np.abs(home.g[-1] - np.array(start.g)).max())
            if method.symmetric:
                assert error < 2e-14
        assert method.symmetric == (method == EXPS[2])
        assert (error > 1e-13) != method.symmetric


@pytest.mark.slow
def test_composition_takes_what_is_symmetric() -> None:
    top, start = heavy_top()
    method, at = lm.Composition(EXPS[2], order=4), TOP["samples"][1]
    assert_order(top, method, start, (np.array(at["pi"], float), np.array(at["R"], float)), float(at["t"]), (10, 20))
    with pytest.raises(lm.errors.InvalidInput, match="not symmetric"):
        lm.Composition(EXPS[4], order=6)


# ---------------------------------------------------------------- structure


@pytest.mark.compiled
@pytest.mark.slow
def test_what_is_kept_over_a_million_steps() -> None:
    """Spatial momentum and Casimir to rounding, with compensated sums; the energy as well as at the start."""
    for system, start, h, casimir in ((*asymmetric_body(), 0.5, 1.3**2), (*kirchhoff_body()[:2], 0.2, 0.62)):
        run = lm.integrate(system, EXPS[4], start, h=h, steps=10**6, every=10**3, compensated=True)
        casimirs = np.array(system.casimirs(run.mu))[:, 0]
        assert np.abs(casimirs / casimir - 1.0).max() < 1e-13
        if isinstance(system, lm.RigidBody):
            assert np.abs(run.spatial_momentum - run.spatial_momentum[0]).max() < 1e-13
        error = np.abs(run.energy - run.energy[0])
        assert error[500:].max() <= 1.1 * error[:500].max()


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("method", [EXPS[4], *(slow(m) for m in (EXPS[6], CAYLEYS[4]))], ids=named)
def test_what_a_top_keeps(method: GalerkinVariational) -> None:
    top, start = heavy_top()
    run = lm.integrate(top, method, start, h=0.1, steps=10_000)
    vertical = np.einsum("ni,ni->n", run.mu, run.g[:, 2, :])
    assert np.abs(vertical - float(TOP["vertical_momentum_pi_dot_Gamma"])).max() < 1e-13
    energy = np.abs(top.energy(run.mu, run.g) - float(TOP["energy"]))
    assert energy[5000:].max() <= 1.2 * energy[:5000].max() < {4: 1e-3, 6: 1e-5}[method.order]


# ---------------------------------------------------------------- running


@pytest.mark.slow
def test_a_field_of_nothing_changes_nothing() -> None:
    body, start = asymmetric_body()
    nowhere = lm.MechanicalSystem(body, lm.NoPotential())
    for method in (EXPS[4], CAYLEYS[6]):
        a, b = (
            lm.integrate(system, method, system.state(start.mu, start.g), h=0.3, steps=10) for system in (body, nowhere)
        )
        assert np.abs(a.mu - b.mu).max() < 1e-14
        assert np.abs(a.g - b.g).max() < 1e-14


@pytest.mark.slow
@pytest.mark.parametrize("method", [EXPS[2], EXPS[8], CAYLEYS[4]], ids=named)
def test_a_top_that_begins_to_fall_is_at_rest_again_and_again(method: GalerkinVariational) -> None:
    swing = lm.models.HeavyTop([1.0, 1.0, 0.5], 1.0, [0.0, 0.0, 1.0])
    start = swing.state([0.0, 0.0, 0.0], lm.SO3().exp([2.0, 0.0, 0.0]))
    fall = lm.integrate(swing, method, start, h=0.1, steps=150)
    energy = swing.energy(fall.mu, fall.g)
    assert np.abs(energy - energy[0]).max() < {2: 1e-2, 4: 1e-4, 8: 1e-9}[method.order]
    assert np.diff(np.sign(fall.mu[1:, 0])).any()


@pytest.mark.parametrize("method", [EXPS[4], CAYLEYS[4]], ids=named)
@pytest.mark.parametrize("compiled", [False, pytest.param(True, marks=pytest.mark.compiled)])
def test_too_large_a_step_is_refused(method: GalerkinVariational, compiled: bool) -> None:
    for system, start in (seed_body(), heavy_top()):
        with pytest.raises(lm.errors.NoConvergence, match=r"GalerkinVariational.*h = 8 is too large.*try 2") as caught:
            lm.integrate(system, method, start, h=8.0, steps=100, compiled=compiled)
        assert len(caught.value.trajectory) >= 1


def test_steps_beyond_the_chart_are_refused() -> None:
    """A turn about a principal axis solves the equations whatever the angle; beyond a whole turn exp is no chart."""
    body, _ = asymmetric_body()
    J = np.array(body.inertia)
    spin = body.state([0.0, 0.0, 1.0], np.eye(3))
    for order, method in EXPS.items():
        run = lm.integrate(body, method, spin, h=6.2 * J[2], steps=2)
        assert np.abs(run.g[-1] - np.array(body.exact(spin, run.t[-1]).g)).max() < 1e-14 * order
        with pytest.raises(lm.errors.OutsideChart, match="left the chart"):
            lm.integrate(body, method, spin, h=6.3 * J[2], steps=2)


def test_what_cannot_be_meant() -> None:
    for order in (3, 10, 4.0, "4"):
        with pytest.raises(lm.errors.InvalidInput, match=r"order is one of \[2, 4, 6, 8\]"):
            GalerkinVariational(order)  # type: ignore[arg-type]
    with pytest.raises(lm.errors.InvalidType, match="retraction must be"):
        GalerkinVariational(4, "exp")  # type: ignore[arg-type]
    system, start = free(lm.SL(3))
    with pytest.raises(lm.errors.IncompatibleSystem, match="Exponential"):
        lm.integrate(system, CAYLEYS[4], start, h=0.1, steps=1)
    reduced = lm.models.ReducedHeavyTop([1.0, 1.6, 2.3], 1.3, [0.1, 0.2, 1.0])
    with pytest.raises(lm.errors.IncompatibleSystem, match=r"a lagrangian.*LiePoissonHamiltonJacobi"):
        lm.integrate(reduced, EXPS[4], reduced.state([0.4, -0.5, 0.7, 0.6, 0.0, 0.8]), h=0.1, steps=1)
    with pytest.raises(lm.errors.IncompatibleSystem, match="needs a body, free"):
        EXPS[4].require(3)


@pytest.mark.parametrize("order", [4, 6, 8])
def test_gauss_tables_are_tridiagonal_in_legendre_polynomials(order: int) -> None:
    """A = W X W^-1 with 1/2 in the corner and the couplings beside the diagonal."""
    method = lm.GalerkinVariational(order)
    there, back, couplings = method.legendre
    X = np.diag(couplings, -1) - np.diag(couplings, 1)
    X[0, 0] = 0.5
    A = np.array(lm.tableaus.gauss(order // 2).A)
    assert np.abs(np.array(back) @ X @ np.array(there) - A).max() < 1e-15
