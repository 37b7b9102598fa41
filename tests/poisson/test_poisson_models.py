"""Models of Poisson systems, chains and bodies: known motions, known numbers, and one model against another."""

from __future__ import annotations

from typing import Any

import mpmath as mp
import numpy as np
import pytest

import liemech as lm
from liemech.models.planets.planetary_system import kepler_step
from liemech.tableaus.splittings import ABA1064, STRANG

EIGHT_PERIOD = 6.325913982926211677589000333967


def velocity_by_differences(f: Any, x: np.ndarray, v: np.ndarray, e: float = 1e-5) -> np.ndarray:
    return np.asarray((f(x + e * v) - f(x - e * v)) / (2.0 * e))


# ---------------------------------------------------------------- lattices


@pytest.mark.parametrize("periodic", [False, True])
def test_toda_in_flaschkas_variables_is_toda(periodic: bool) -> None:
    """The energy is that of (q, p), and the velocity the image of q' = p, p_i' = e^(q_i-1 - q_i) - e^(q_i - q_i+1)."""
    lattice, n = lm.models.TodaLattice(4, periodic), 4
    q, p = np.random.default_rng(1).normal(size=(2, n))
    forces = np.exp(q - np.roll(q, -1))
    if not periodic:
        forces[-1] = 0.0
    start = lattice.state_of(q, p)
    assert lattice.energy(start.y) == pytest.approx(0.5 * p @ p + forces.sum(), rel=1e-14)
    x, v = np.concatenate([q, p]), np.concatenate([p, np.roll(forces, 1) - forces])
    image = velocity_by_differences(lambda z: np.array(lattice.state_of(z[:n], z[n:]).y), x, v)
    assert np.allclose(lattice.velocity(start.y), image, rtol=0.0, atol=1e-9)
    run = lm.integrate(lattice, lm.RKMK(order=8), start, h=0.02, steps=20, compiled=False)
    assert run.drift()["eigenvalues"].largest < 1e-12
    many = lattice.state_of(np.stack([q, 2.0 * q]), np.stack([p, p]))
    assert np.array_equal(many.y[0], np.array(start.y))


def test_henons_map_takes_volterra_to_toda() -> None:
    species, lattice = lm.models.LotkaVolterra.volterra_lattice(5), lm.models.TodaLattice(3)
    u = np.array([1.0, 0.7, 1.3, 0.9, 0.5])
    assert np.allclose(species.velocity(u), u * (np.array([*u[1:], 0.0]) - np.array([0.0, *u[:-1]])), rtol=1e-15)
    image = velocity_by_differences(lambda x: np.array(lattice.of_volterra(x).y), u, np.array(species.velocity(u)))
    assert np.allclose(lattice.velocity(lattice.of_volterra(u).y), image, rtol=0.0, atol=1e-10)
    kept = species.casimirs(u)
    assert np.allclose(kept, np.log(u[0] * u[2] * u[4]) * kept[0] / np.log(u[0] * u[2] * u[4]))
    assert len(kept) == 1 and abs(kept[0]) == pytest.approx(abs(np.log(1.0 * 1.3 * 0.5)), rel=1e-13)
    with pytest.raises(lm.errors.InvalidInput, match="comes from 5 species"):
        lattice.of_volterra(u[:4])


def test_species_of_one_form_only() -> None:
    with pytest.raises(lm.errors.InvalidInput, match="y must be positive"):
        lm.models.LotkaVolterra().state([1.0, -0.1])
    with pytest.raises(lm.errors.InvalidInput, match="weights are 2 finite numbers"):
        lm.models.LotkaVolterra(weights=[1.0, 2.0, 3.0])
    with pytest.raises(lm.errors.InvalidInput, match="skew-symmetric"):
        lm.models.LotkaVolterra([[0.0, 1.0], [1.0, 0.0]])
    assert np.allclose(lm.models.LotkaVolterra().velocity(lm.models.LotkaVolterra().equilibrium().y), 0.0, atol=1e-16)


def test_modes_of_a_chain() -> None:
    """Linear springs keep the energy of every mode; nonlinear ones let the others have some, and keep the sum of all."""
    linear = lm.models.FermiPastaUlam(7, alpha=0.0)
    start = linear.mode(2, 1.5)
    run = lm.integrate(linear, lm.Splitting(order=8), start, h=0.1, steps=40, compiled=False)
    energies = linear.mode_energies(run.q, run.p)
    assert np.allclose(energies[:, 1], linear.energy(start.q, start.p), rtol=1e-10)
    assert np.abs(np.delete(energies, 1, axis=1)).max() < 1e-14
    bent = lm.models.FermiPastaUlam(7, alpha=0.25, beta=0.3)
    assert lm.check_system(bent)
    run = lm.integrate(bent, lm.Splitting(order=8), start, h=0.1, steps=40, compiled=False)
    assert bent.mode_energies(run.q, run.p)[-1, 3] > 1e-4


@pytest.mark.slow
def test_the_recurrence_of_fermi_pasta_and_ulam() -> None:
    """32 masses, alpha = 1/4, all energy in the first mode: it falls below 10 %, and is back to 95
    % at some time before 11,500.
    """
    chain = lm.models.FermiPastaUlam()
    start = chain.mode(1, 1.0 / np.sqrt(2.0 / 33.0))  # displacements of one, as in the report
    run = lm.integrate(chain, lm.Splitting(order=4), start, h=0.25, steps=46_000, every=100, progress=False)
    first = chain.mode_energies(run.q, run.p)[:, 0]
    lowest = int(first.argmin())
    assert first[lowest] < 0.1 * first[0] and first[lowest:].max() > 0.95 * first[0]
    assert run.drift()["energy"].verdict in ("bounded", "exact")


# ---------------------------------------------------------------- bodies


def test_a_top_by_its_vertical_is_the_top_with_its_attitude() -> None:
    moments, weight, centre = [1.0, 1.5, 2.0], 2.0, [0.1, 0.0, 0.5]
    body, top = (lm.models.PoissonTop(moments, weight, centre), lm.models.HeavyTop(moments, weight, centre))
    g = lm.SO3().exp([0.4, -0.3, 0.5])
    mu = [0.3, 0.2, 1.0]
    a = lm.integrate(top, lm.RKMK(order=8), top.state(mu, g), h=0.05, steps=20, compiled=False)
    b = lm.integrate(body, lm.Splitting(order=6), body.state([*mu, *g[2]]), h=0.05, steps=20, compiled=False)
    assert np.allclose(b.y[-1], [*a.mu[-1], *a.g[-1][2]], rtol=0.0, atol=1e-7)
    assert body.energy(b.y[0]) == pytest.approx(top.energy(mu, g), rel=1e-14)
    with pytest.raises(lm.errors.InvalidInput):
        lm.models.PoissonTop([1.0, 2.0], 1.0, [0.0, 0.0, 1.0])


@pytest.mark.slow
def test_the_figure_eight_closes() -> None:
    """To 1e-12 after a period; after a third every body is where the one before it was; the energy is the known one."""
    system, start = lm.models.NBody.figure_eight()
    assert system.energy(start.q, start.p) == pytest.approx(-1.287141995631857704950953793, rel=1e-15)
    h = EIGHT_PERIOD / 240
    run = lm.integrate(system, lm.Splitting(order=8), start, h=h, steps=240, every=80, compiled=False, progress=False)
    assert np.abs(run.q[-1] - run.q[0]).max() < 1e-12
    third, first = run.q[1].reshape(3, 2), run.q[0].reshape(3, 2)
    assert min(np.abs(third - np.roll(first, k, axis=0)).max() for k in (1, 2)) < 1e-11
    drift = run.drift()
    assert drift["momentum"].verdict == drift["angular momentum"].verdict == "exact"


def test_the_outer_solar_system() -> None:
    """Energies in both frames, angular momentum, the forces, and Stormer's and Verlet's error of
    energy over 200,000 days.
    """
    system, start = lm.models.NBody.outer_solar_system()
    assert system.energy(start.q, start.p) == pytest.approx(-3.2177344552358074e-8, rel=1e-14)
    L = system.angular_momentum(start.q, start.p)
    assert np.allclose(L, [1.59497628e-6, -2.36860842e-5, 5.59074845e-5], rtol=2e-9)
    assert np.abs(np.array(system.momentum(start.p))).max() < 1e-20
    _, heliocentric = lm.models.NBody.outer_solar_system(barycentric=False)
    assert system.energy(heliocentric.q, heliocentric.p) == pytest.approx(-3.2154531832081676e-8, rel=1e-14)
    # at the barycentre the sums of momenta are zero, and so is their scale
    assert lm.check_system(system, heliocentric)


@pytest.mark.compiled
@pytest.mark.slow
def test_long_runs_of_the_outer_solar_system() -> None:
    system, start = lm.models.NBody.outer_solar_system(barycentric=False)
    for h, error in ((200.0, 1.9e-3), (100.0, 7.4e-4)):
        run = lm.integrate(system, lm.StormerVerlet(), start, h=h, steps=round(2e5 / h), compiled=True, progress=False)
        assert np.abs(run.energy / run.energy[0] - 1.0).max() == pytest.approx(error, rel=0.1)


# ---------------------------------------------------------------- charged particles


@pytest.mark.parametrize(
    "field", [lm.models.AxialField(0.7), lm.models.TokamakField(), lm.models.UniformField([0.1, 0.2, 0.3])], ids=repr
)
def test_integrals_of_fields(field: Any) -> None:
    """Against quadrature, also across the planes; where one of the coordinates is zero."""
    from scipy.integrate import quad

    for x in ([0.7, -0.4, 0.3], [-0.6, 0.5, -0.2], [0.0, 1.0, 0.1], [-1.05, 0.0, 0.2]):
        for component in range(3):
            for axis in {0, 1, 2} - {component}:
                for length in (0.3, -1.7):
                    if abs(x[0] * x[1]) < 1e-9 and length < 0.0:
                        continue  # across the third axis
                    e = np.eye(3)[axis]
                    found = field.integral(component, axis, x, length)

                    def along(s: float, c: int = component, e: np.ndarray = e, x: Any = x) -> float:
                        return float(field.at(np.array(x) + s * e)[c])

                    wanted = quad(along, 0.0, length, epsabs=1e-13, epsrel=1e-13)[0]
                    assert found == pytest.approx(wanted, rel=1e-12, abs=1e-13)


def test_particles_move_by_lorentz_force() -> None:
    field = lm.models.TokamakField()
    particle = lm.models.ChargedParticle(field)
    y = np.array([1.05, 0.2, -0.1, 0.3, -0.2, 0.5])
    assert np.allclose(particle.velocity(y), [*y[3:], *np.cross(y[3:], field.at(y[:3]))], rtol=1e-14)
    assert lm.check_system(particle, particle.state(y))

    @lm.record
    class Unknown(lm.models.MagneticField):
        def at(self, x: lm.Vec) -> lm.Vec:
            return lm.vec(x[1], x[2], x[0])

    other = lm.models.ChargedParticle(Unknown())
    with pytest.raises(lm.errors.IncompatibleSystem, match="coordinate_flow"):
        lm.Splitting(order=2).require(other)
    with pytest.raises(lm.errors.InvalidType, match="must be a MagneticField"):
        lm.models.ChargedParticle([0.0, 0.0, 1.0])


@pytest.mark.compiled
@pytest.mark.slow
def test_banana_and_passing_orbits() -> None:
    """The ranges of R and |Z| of both orbits, of the particle and of its guiding centre, which stays beside it."""
    particle = lm.models.ChargedParticle(lm.models.TokamakField())
    for v, low, high in (([0.0, 4.816e-4, -2.059e-3], 1.0074, 1.0853), ([0.0, 9.632e-4, -2.059e-3], 0.9299, 1.0544)):
        start = particle.state([1.05, 0.0, 0.0, *v])
        run = lm.integrate(particle, lm.Splitting(order=2), start, h=np.pi / 10, steps=250_000, every=5, progress=False)
        R = np.hypot(run.y[:, 0], run.y[:, 1])
        assert [R.min(), R.max()] == pytest.approx([low, high], abs=5e-4)
        assert run.drift()["energy"].verdict == "bounded"
        centre, begin = lm.models.GuidingCentre.of_particle(particle, start.y)
        guide = lm.integrate(centre, lm.RKMK(order=8), centre.state(begin), h=50.0, steps=1571, progress=False)
        rho = np.hypot(guide.y[:, 0], guide.y[:, 1])
        gyration = 2.2e-3 / 0.5  # |v|/|B|
        assert [rho.min() - gyration, rho.max() + gyration] == pytest.approx([R.min(), R.max()], abs=4e-3)


# ---------------------------------------------------------------- Kepler's motion as a part


@pytest.mark.parametrize("eccentricity", [0.0, 0.3, 0.9])
def test_steps_on_keplers_ellipses(eccentricity: float) -> None:
    """Against Kepler's equation, forwards, backwards and over more than a period."""
    kepler = lm.Kepler(1.7)
    start = kepler.pericentre(eccentricity)
    for t in (1e-3, 0.7, 2.5, -1.3, 9.0):
        end = kepler.exact(start, t)
        dq, dv = kepler_step(lm.vec(*start.q, 0.0), lm.vec(*start.p, 0.0), 1.7, t)
        error = np.abs([*(np.array(dq)[:2] + start.q - end.q), *(np.array(dv)[:2] + start.p - end.p)]).max()
        assert error < 2e-13 / (1.0 - eccentricity) ** 2


@pytest.mark.parametrize("e", [0.0, 0.5, 0.99, 1.0, 1.5])
def test_steps_on_conics_are_exact_to_rounding(e: float) -> None:
    """Against Kepler's equation in 40 digits: a few eps, and one for each radian of the way, which
    is what rounding of the start does.
    """
    mp.mp.dps = 40
    rng = np.random.default_rng(7)
    for part in 10.0 ** rng.uniform(-5.0, 0.4, 6):  # of a revolution on the circle
        t = float(2.0 * np.pi * part)
        q, v = lm.vec(0.6, 0.8, 0.0), lm.vec(-0.8 * np.sqrt(1.0 + e), 0.6 * np.sqrt(1.0 + e), 0.0)
        found = kepler_step(q, v, 1.0, t)
        wanted = conic(q, v, t)
        for gain, exact in zip(found, wanted, strict=True):
            error = max(abs(float(mp.mpf(x) - y)) for x, y in zip(gain, exact, strict=True))
            size = float(mp.norm(exact))
            assert error <= (4.0 + 8.0 * t) * 2.0**-52 * max(size, 1e-3 * t)


def conic(q: lm.Vec, v: lm.Vec, t: float) -> tuple[list[mp.mpf], list[mp.mpf]]:
    """The gains of position and velocity by universal variables, k = 1, bisection first."""
    x, w, t = [mp.mpf(a) for a in q], [mp.mpf(a) for a in v], mp.mpf(t)
    r0, e0 = mp.norm(x), mp.fdot(x, w)
    b = 2 / r0 - mp.fdot(w, w)

    def G(n: int, s: mp.mpf) -> mp.mpf:
        term = total = s**n / mp.factorial(n)
        for j in range(n + 2, n + 90, 2):
            term = -term * b * s * s / (j * (j - 1))
            total += term
        return total

    s = mp.findroot(
        lambda s: r0 * G(1, s) + e0 * G(2, s) + G(3, s) - t, (0, 2 * t / r0), solver="anderson",
        tol=1e-70, maxsteps=200,
    )  # fmt: skip
    r = r0 + e0 * G(1, s) + (1 - b * r0) * G(2, s)
    f, g, df, dg = -G(2, s) / r0, t - G(3, s), -G(1, s) / (r0 * r), -G(2, s) / r
    return [f * a + g * c for a, c in zip(x, w, strict=True)], [df * a + dg * c for a, c in zip(x, w, strict=True)]


def test_steps_on_hyperbolas_are_those_of_rk8() -> None:
    kepler = lm.Kepler()
    start = kepler.state([1.0, 0.2], [0.3, 1.9])
    run = lm.integrate(kepler, lm.RKMK(order=8), start, h=0.02, steps=100, compiled=False)
    dq, dv = kepler_step(lm.vec(1.0, 0.2, 0.0), lm.vec(0.3, 1.9, 0.0), 1.0, 2.0)
    assert np.allclose(np.array(dq)[:2] + [1.0, 0.2], run.q[-1], rtol=1e-12)
    assert np.allclose(np.array(dv)[:2] + [0.3, 1.9], run.p[-1], rtol=1e-12)


def test_planets_in_jacobis_coordinates() -> None:
    """The energy and the motion of NBody; two bodies are exact; steps of Wisdom and Holman beside those of Verlet."""
    system, start = lm.models.PlanetarySystem.outer_solar_system()
    bodies, begin = lm.models.NBody.outer_solar_system()
    assert system.energy(start.y) == pytest.approx(bodies.energy(begin.q, begin.p), rel=1e-13)
    q, p = system.bodies(start.y)
    assert np.allclose(q, begin.q, rtol=0.0, atol=1e-13) and np.allclose(p, begin.p, rtol=0.0, atol=1e-17)
    run = lm.integrate(bodies, lm.Splitting(order=8), begin, h=50.0, steps=20, compiled=False, progress=False)
    errors = []
    for h in (200.0, 100.0):
        found = lm.integrate(
            system, lm.Splitting(order=2), start, h=h, steps=round(1000 / h), compiled=False, progress=False
        )
        errors.append(np.abs(system.bodies(found.y[-1])[0] - run.q[-1]).max())
    assert errors[1] < 1e-4 and np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.3)
    pair = lm.models.PlanetarySystem([1.0, 1e-3], 1.0)
    y = pair.state([1.0, 0.0, 0.0, 0.0, 1.2e-3, 1e-4])
    once = lm.integrate(pair, lm.Splitting(order=2), y, h=3.0, steps=1, compiled=False)
    many = lm.integrate(pair, lm.Splitting(order=2), y, h=0.1, steps=30, compiled=False)
    assert np.allclose(once.y[-1], many.y[-1], rtol=0.0, atol=1e-13)


@pytest.mark.compiled
@pytest.mark.slow
def test_wisdom_and_holman_over_ten_thousand_years() -> None:
    """The errors of energy that REBOUND 5.2.2 has on the same start: WHFast 2.1e-6, SABA(10, 6, 4)
    2.4e-12 at h = 400 d.
    """
    system, start = lm.models.PlanetarySystem.outer_solar_system()
    for tableau, h, error in ((STRANG.exchanged, 200.0, 2.1e-6), (ABA1064, 400.0, 2.4e-12)):
        steps = round(3652425 / h)
        method = lm.Splitting(tableau=tableau)
        run = lm.integrate(system, method, start, h=h, steps=steps, every=steps // 400, compiled=True, progress=False)
        assert np.abs(run.energy / run.energy[0] - 1.0).max() == pytest.approx(error, rel=0.5)
