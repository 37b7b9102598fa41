"""Algorithm 1 and its compositions beyond rotations: what is exact on SE(3), SO(4) and a group given by generators."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from scenes import CAYLEY, EXP, asymmetric_body, kirchhoff_body, poisson_defect, slope, slow

import liemech as lm
from liemech.groups.matrices.matrix_group import MatrixLieGroup

Scene = tuple[lm.LiePoissonSystem, lm.BodyState]


@functools.cache
def on_SE3() -> Scene:
    """A body in a fluid, with a full matrix of inertia."""
    return kirchhoff_body()[:2]


@functools.cache
def on_SO4() -> Scene:
    """A free body in four dimensions, six different moments."""
    system = lm.LiePoissonSystem(lm.SO(4), lm.KineticEnergy([1.0, 1.4, 1.9, 1.2, 2.3, 1.6]))
    return system, system.state([0.6, -0.5, 0.4, 0.7, 0.3, -0.4], lm.SO(4).random(3))


@functools.cache
def on_generators() -> Scene:
    """SL(2), of which nothing is known but three matrices; momenta on hyperboloids."""
    group = MatrixLieGroup.of(lm.SL(2).generators)
    system = lm.LiePoissonSystem(group, lm.KineticEnergy([1.0, 1.6, 2.3]))
    return system, system.state([0.7, -0.5, 0.6], group.exp([0.3, -0.2, 0.4]))


ADJOINT = lm.CovariantVariational(lm.CayleyAdjoint())
COMPOSED = [lm.Composition(EXP, order=4), lm.Composition(CAYLEY, order=4), lm.Composition(EXP, order=6)]
CASES = [(scene, method) for scene in (on_SE3, on_SO4, on_generators) for method in (EXP, CAYLEY)] + [(on_SE3, ADJOINT)]
EACH = pytest.mark.parametrize(
    ("scene", "method"), CASES, ids=lambda x: x.name if isinstance(x, lm.Method) else x.__name__
)


# ---------------------------------------------------------------- one step


@EACH
def test_momentum_fits_the_velocity(scene: object, method: lm.CovariantVariational) -> None:
    """The two lines of the algorithm: (dtau^-1)* J xi is the momentum after the step, the right one that before it."""
    system, start = scene()  # type: ignore[operator]
    h, group = 0.2, system.group
    run = lm.integrate(system, method, start, h=h, steps=1)
    x = method.retraction.tau_inv(group, group.compose(group.inverse(run.g[0]), run.g[1]))
    p = np.array(system.lagrangian.momentum(np.array(x) / h))
    assert np.abs(method.retraction.dtau_inv_dual(group, -x, p) - run.mu[0]).max() < 1e-14
    assert np.abs(method.retraction.dtau_inv_dual(group, x, p) - run.mu[1]).max() < 1e-14
    assert np.abs(run.spatial_momentum[1] - run.spatial_momentum[0]).max() < 4e-15


@pytest.mark.sample(4)
@EACH
def test_the_bracket_is_kept(scene: object, method: lm.Method) -> None:
    system, start = scene()  # type: ignore[operator]
    assert poisson_defect(system, method, np.array(start.mu), 0.3) < 1e-11


def test_rkmk_does_not_keep_the_bracket() -> None:
    """What the test above is worth."""
    for scene in (on_SE3, on_SO4, on_generators):
        system, start = scene()
        assert poisson_defect(system, lm.RKMK(order=4), np.array(start.mu), 0.3) > 1e-8


# ---------------------------------------------------------------- the same map under other names


@pytest.mark.parametrize("scene", [asymmetric_body, on_SO4], ids=["SO3", "SO4"])
@pytest.mark.parametrize("h", [0.05, 0.3])
def test_cayley_is_the_isospectral_midpoint_rule(scene: object, h: float) -> None:
    """W_n = (1 - hB/2) W (1 + hB/2), W_n+1 = (1 + hB/2) W (1 - hB/2) with W = hat(mu),
    B = -hat(xi), and g_n+1 = g_n Q^T.

    Source: Modin, Viviani, Found. Comput. Math. 20 (2020).
    """
    system, start = scene()  # type: ignore[operator]
    run = lm.integrate(system, CAYLEY, start, h=h, steps=10, compiled=False, compensated=False)
    hat, vee = system.group.algebra.hat, system.group.algebra.vee
    one = np.eye(len(run.g[0]))
    for n in range(10):
        before, W = np.array(hat(run.mu[n])), np.array(hat(run.mu[n]))
        for _ in range(60):
            B = -np.array(hat(system.velocity(vee(W))))
            W = np.linalg.solve(one - h / 2 * B, before) @ np.linalg.inv(one + h / 2 * B)
        after = (one + h / 2 * B) @ W @ (one - h / 2 * B)
        Q = np.linalg.solve(one - h / 2 * B, one + h / 2 * B)
        assert np.abs(after - np.array(hat(run.mu[n + 1]))).max() < 2e-15
        assert np.abs(run.g[n] @ Q.T - run.g[n + 1]).max() < 2e-15


# ---------------------------------------------------------------- energies


def third(system: lm.LiePoissonSystem, retraction: lm.Retraction, p: np.ndarray) -> float:
    """s_3 = (d/dt)^2 H((dtau^-1_tv)* p) at 0, left-trivialised, v = dH(p), for any retraction; by
    differences, extrapolated.
    """
    v = np.array(system.velocity(p))

    def energy(t: float) -> float:
        return float(system.energy(retraction.dtau_inv_dual(system.group, t * v, p)))

    coarse, fine = ((energy(e) - 2.0 * energy(0.0) + energy(-e)) / e**2 for e in (2e-2, 1e-2))
    return (4.0 * fine - coarse) / 3.0


@pytest.mark.slow
@EACH
def test_modified_energy_is_kept_to_fourth_order(scene: object, method: lm.CovariantVariational) -> None:
    """H - (h^2/6) s_3, s_3 of the Hamilton-Jacobi equation: its oscillation falls by 16 per halving, that of H by 4."""
    system, start = scene()  # type: ignore[operator]
    h, plain, modified = [0.1, 0.05, 0.025], [], []
    for step in h:
        run = lm.integrate(
            system, method, start, h=step, steps=round(4 / step), every=round(0.4 / step), compiled=False
        )
        s3 = np.array([third(system, method.retraction, mu) for mu in run.mu])
        plain.append(np.ptp(run.energy))
        modified.append(np.ptp(run.energy - step**2 / 6 * s3))
    assert slope(h, plain) == pytest.approx(2.0, abs=0.1)
    assert slope(h, modified) == pytest.approx(4.0, abs=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "method"),
    [
        *((on_SO4, COMPOSED[1]), (on_generators, COMPOSED[0])),
        *(slow(*pair) for pair in ((on_SE3, COMPOSED[0]), (on_SE3, COMPOSED[1]))),
        *(slow(*pair) for pair in ((on_SO4, COMPOSED[0]), (on_generators, COMPOSED[1]))),
    ],
)
def test_the_energy_of_a_composition_has_its_order(scene: object, method: lm.Method) -> None:
    system, start = scene()  # type: ignore[operator]
    h, error = [0.1, 0.05], []
    for step in h:
        run = lm.integrate(
            system,
            method,
            system.state(start.mu),
            h=step,
            steps=round(2 / step),
            every=round(0.2 / step),
            compiled=False,
        )
        error.append(np.abs(run.energy - run.energy[0]).max())
    assert slope(h, error) == pytest.approx(4.0, abs=0.1)


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("scene", [on_SE3, on_SO4])
def test_energy_and_momenta_over_ten_thousand_steps(scene: object) -> None:
    system, start = scene()  # type: ignore[operator]
    run = lm.integrate(system, CAYLEY, system.state(start.mu), h=0.1, steps=10_000)
    energy, casimirs = np.abs(run.energy - run.energy[0]), np.array(system.casimirs(run.mu))
    assert energy[5000:].max() <= 1.1 * energy[:5000].max()
    assert np.abs(casimirs - casimirs[0]).max() < 1e-13
