"""Rods at rest against closed forms and published shapes."""

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.optimize import brentq
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc, jv
from shipped import RETRACTIONS

import liemech as lm
from liemech.models import CosseratRod, RodSection, RodStrain
from liemech.rooms.sites.terms.terms import Site, Term

SECTION = RodSection.round(0.02, young=1e6, density=1000.0)
SE3 = lm.SE3()


def slopes(errors):
    """Of errors where the number of elements doubles."""
    return np.log2(np.array(errors[:-1]) / np.array(errors[1:]))


def inextensible(section=SECTION):
    """The same with shear and stretch as stiff as nothing is."""
    return RodSection([*section.stiffness[:3], 1e7, 1e7, 1e7], section.inertia)


@pytest.mark.slow
def test_a_cantilever_bends_as_timoshenko_says():
    EI, kGA, errors = SECTION.stiffness[0], SECTION.stiffness[3], []
    P = 1e-4 * EI
    for n in (10, 20, 40):
        g = CosseratRod(SECTION, 1.0, n, tip_force=[P, 0, 0]).equilibrium(stages=1)
        errors.append(abs(g[-1, 0, 3] / (P / (3.0 * EI) + P / kGA) - 1.0))
    assert errors[1] < 1e-3
    np.testing.assert_allclose(slopes(errors), 2.0, atol=0.01)


def elastica(load):
    """Deflection and shortening of a cantilever under a dead tip load P L^2/(E I): Bisshopp and
    Drucker, Quart. Appl. Math. 3 (1945), 272.
    """

    def parts(angle):  # that of the tip
        m = 0.5 * (1.0 + np.sin(angle))
        return m, np.arcsin(1.0 / np.sqrt(2.0 * m))

    def miss(angle):
        m, phi = parts(angle)
        return ellipk(m) - ellipkinc(phi, m) - np.sqrt(load)

    angle = brentq(miss, 1e-9, 0.5 * np.pi - 1e-12)
    m, phi = parts(angle)
    across = 1.0 - 2.0 / np.sqrt(load) * (ellipe(m) - ellipeinc(phi, m))
    return across, np.sqrt(2.0 * np.sin(angle) / load)


@pytest.mark.slow
def test_a_cantilever_under_a_large_load_is_eulers_elastica():
    stiff, errors = inextensible(), []
    exact = np.array(elastica(10.0))
    for n in (8, 16):
        rod = CosseratRod(stiff, 1.0, n, tip_force=[10.0 * stiff.stiffness[0], 0, 0])
        g = rod.equilibrium(stages=3)
        errors.append(np.abs(g[-1, [0, 2], 3] - exact).max())
    assert errors[-1] < 5e-3
    np.testing.assert_allclose(slopes(errors), 2.0, atol=0.1)


@pytest.mark.parametrize("turns", [0.3, 1.0])
def test_an_end_moment_bends_elements_into_the_exact_circle(turns):
    M = 2.0 * np.pi * turns * SECTION.stiffness[0]
    rod = CosseratRod(SECTION, 1.0, 4, tip_moment=[0, M, 0])
    angle = 2.0 * np.pi * turns
    tip = rod.equilibrium(stages=2)[-1, [0, 2], 3]
    np.testing.assert_allclose(tip, [(1.0 - np.cos(angle)) / angle, np.sin(angle) / angle], atol=1e-13)


@pytest.mark.parametrize(("load", "tip"), [(300.0, (22.33, 58.84, 40.08)), (600.0, (15.79, 47.23, 53.37))])
def test_the_bend_of_45_degrees_is_that_of_simo_and_vu_quoc(load, tip):
    """Bathe and Bolourchi, Int. J. Numer. Methods Eng. 14 (1979), 961; Simo and Vu-Quoc, Comput.
    Methods Appl. Mech. Eng. 58 (1986), 79, table 3, with eight elements.
    """
    section = RodSection([1e7 / 12, 1e7 / 12, 1e7 / 12, 5e6, 5e6, 1e7], [1 / 12, 1 / 12, 1 / 6, 1, 1, 1])
    length, bent = 25.0 * np.pi, [0.0, 0.01, 0.0, 0.0, 0.0, 1.0]  # along z, then towards x
    rod = CosseratRod(section, length, 8, rest=bent, tip_force=[0, load, 0])
    x = rod.equilibrium(stages=3)[-1, :3, 3]
    np.testing.assert_allclose([x[0], x[2], x[1]], tip, atol=0.2)


@pytest.mark.slow
def test_a_column_loses_its_stiffness_at_eulers_load():
    stiff, errors = inextensible(), []
    euler = 0.25 * np.pi**2 * stiff.stiffness[0]
    for n in (5, 10):

        def softest(load, n=n):
            rod = CosseratRod(stiff, 1.0, n, tip_force=[0, 0, -load])
            H = rod.stiffness(rod.equilibrium(stages=1)).toarray()
            return np.linalg.eigvalsh(0.5 * (H + H.T)[np.ix_(rod.free, rod.free)])[0]

        errors.append(abs(brentq(softest, 0.95 * euler, 1.05 * euler, xtol=1e-6 * euler) / euler - 1.0))
    assert errors[-1] < 3e-3
    np.testing.assert_allclose(slopes(errors), 2.0, atol=0.1)


@pytest.mark.slow
def test_a_column_too_tall_for_its_weight_loses_its_stiffness_at_greenhills_height():
    # A. G. Greenhill, Proc. Camb. Phil. Soc. 4 (1881), 65: rho A g L^3/(E I) = (9/4) j^2, j the first zero of J_-1/3.
    zero = brentq(lambda x: jv(-1.0 / 3.0, x), 1.5, 2.5)
    assert 2.25 * zero**2 == pytest.approx(7.8373, abs=5e-5)
    stiff, errors = inextensible(), []
    greenhill = 2.25 * zero**2 * stiff.stiffness[0] / stiff.inertia[5]
    for n in (8, 16):

        def softest(gravity, n=n):
            rod = CosseratRod(stiff, 1.0, n, gravity=gravity)
            H = rod.stiffness(rod.equilibrium(stages=1)).toarray()
            return np.linalg.eigvalsh(0.5 * (H + H.T)[np.ix_(rod.free, rod.free)])[0]

        found = brentq(softest, 0.9 * greenhill, 1.1 * greenhill, xtol=1e-6 * greenhill)
        errors.append(abs(found / greenhill - 1.0))
    assert errors[-1] < 3e-3
    np.testing.assert_allclose(slopes(errors), 2.0, atol=0.1)


def frequencies(rod, components):
    """Of small oscillations of these components about the shape without force, from SciPy."""
    free = rod.free & np.isin(np.arange(6 * rod.frames) % 6, components)
    H = rod.stiffness(rod.shape()).toarray()[np.ix_(free, free)]
    return np.sqrt(np.abs(eigh(H, np.diag(rod.inertias.ravel()[free]), eigvals_only=True)))


@pytest.mark.parametrize("component", [2, 5], ids=["torsion", "stretch"])
def test_waves_along_the_rod_are_those_of_a_row_of_masses(component):
    n, speed = 12, np.sqrt(SECTION.stiffness[component] / SECTION.inertia[component])
    found = frequencies(CosseratRod(SECTION, 1.0, n, ends=("free", "free")), [component])
    wave = 2.0 * speed * n * np.sin(np.arange(n + 1) * np.pi / (2 * n))
    np.testing.assert_allclose(found[1:], wave[1:], rtol=1e-9)
    assert found[0] < 1e-5 * wave[1]
    assert found[1] == pytest.approx(np.pi * speed, rel=3e-3)  # of the rod: c pi/L


@pytest.mark.slow
def test_bending_waves_have_timoshenkos_dispersion():
    K, J, errors = SECTION.stiffness, SECTION.inertia, []
    k = np.pi * np.arange(1, 4)
    a, c = J[0] * J[3], K[0] * K[3] * k**4
    b = J[3] * (K[0] * k**2 + K[3]) + J[0] * K[3] * k**2
    exact = np.sqrt((b - np.sqrt(b * b - 4.0 * a * c)) / (2.0 * a))
    for n in (20, 40, 80):
        found = frequencies(CosseratRod(SECTION, 1.0, n, ends=("hinged", "hinged")), [0, 4])
        errors.append(np.abs(found[:3] / exact - 1.0).max())
    assert errors[-1] < 0.01
    np.testing.assert_allclose(slopes(errors), 2.0, atol=0.1)


@pytest.mark.parametrize("tau", RETRACTIONS, ids=repr)
def test_forces_and_derivatives_are_those_of_the_energy(tau):
    rng = np.random.default_rng(3)
    A = rng.normal(size=(6, 6))
    for K in ([1.0, 2.0, 3.0, 4.0, 5.0, 6.0], A @ A.T):
        one = RodStrain(0.7, K, rng.normal(size=6), tau)
        sites = [Site(g=lm.formulas.mat(*map(list, SE3.exp(0.7 * rng.normal(size=6))))) for _ in "ab"]
        forces = np.array(one.forces(SE3, *sites))
        derived = np.array([Term.force(one, SE3, k, *sites) for k in range(2)])
        np.testing.assert_allclose(forces, derived, rtol=1e-12, atol=1e-12 * abs(derived).max())
        ours, theirs = (np.array(one.stiffnesses(SE3, *sites)), np.array(Term.stiffnesses(one, SE3, *sites)))
        np.testing.assert_allclose(ours, theirs, rtol=1e-11, atol=1e-12 * abs(theirs).max())


@lm.record
class Stiffening(RodStrain):
    """Stretch that grows stiff: W = (l/2) e . K e + l c e_6^4, of another length without force."""

    c: float = 0.0

    def energy(self, a, b):
        e = self.strain(a, b)
        return 0.5 * self.length * lm.dot(e, self.stiffness * e) + self.length * self.c * e[5] ** 4


@lm.record
class StiffeningRod(CosseratRod):
    @property
    def element(self):
        return Stiffening(self.length / self.elements, self.section.stiffness, [0, 0, 0, 0, 0, 1.1], c=1e4)


@pytest.mark.slow
def test_an_element_of_ones_own_is_at_rest_where_its_own_energy_says():
    """EA e + 4 c e^3 = P of a rod that is pulled along."""
    EA = SECTION.stiffness[5]
    rod = StiffeningRod(SECTION, 1.0, 2, tip_force=[0, 0, 0.3 * EA])
    stretch = brentq(lambda e: EA * e + 4e4 * e**3 - 0.3 * EA, 0.0, 1.0)
    g = rod.equilibrium(stages=2)
    np.testing.assert_allclose(g[-1, :3, 3], [0, 0, 1.1 + stretch], rtol=1e-12, atol=1e-12)
    along = np.zeros((3, 6))
    along[:, 5] = 0.0, 0.5, 1.0  # the elements stretch alike
    assert along.ravel() @ rod.stiffness(g) @ along.ravel() == pytest.approx(EA + 12e4 * stretch**2, rel=1e-11)
    with pytest.raises(lm.errors.NotDefined, match="wrenches"):
        rod.wrenches(g)


def test_energy_and_forces_are_the_same_in_every_frame():
    rng = np.random.default_rng(5)
    rod = CosseratRod(SECTION, 1.0, 6, ends=("free", "free"))
    g = rod.shape(rng.normal(size=(6, 6)) + [0, 0, 0, 0, 0, 1])
    moved = np.array(SE3.compose(SE3.random(rng), g))
    zero = np.zeros((7, 6))
    assert rod.energy(zero, moved) == pytest.approx(rod.energy(zero, g), rel=1e-13)
    np.testing.assert_allclose(rod.force(moved), rod.force(g), atol=1e-12 * np.abs(rod.force(g)).max())


def test_sections_have_the_constants_of_the_tables():
    """Timoshenko and Goodier, section 109: 0.1406 of a square, 0.229 of sides 2 : 1; Cowper's shear
    coefficients for a Poisson ratio of 0.3.
    """
    for width, height, constant in ((1.0, 1.0, 0.1406), (2.0, 1.0, 0.229), (1.0, 2.0, 0.229)):
        K = np.array(RodSection.rectangle(width, height, 2.6, 1.0, 0.3).stiffness)
        assert K[2] == pytest.approx(constant * width * height * min(width, height) ** 2, rel=2e-3)
        assert K[3] / (width * height) == pytest.approx(0.850, abs=1e-3)
        assert K[0] / K[1] == pytest.approx((height / width) ** 2)
    assert SECTION.stiffness[3] / (1e6 / 2.6 * np.pi * 0.02**2) == pytest.approx(0.886, abs=1e-3)
    thin = RodSection.tube(1.0, 0.999, 1.0, 1.0, 0.3)
    assert thin.stiffness[3] * 2.6 / thin.stiffness[5] == pytest.approx(0.53, abs=2e-3)


@pytest.mark.slow
def test_a_wavy_ring_relaxes_to_a_circle():
    ring = CosseratRod(SECTION, 1.0, 12, closed=True)
    R = 0.5 / np.pi

    def wavy(s):
        return R * np.cos(s / R), R * np.sin(s / R), 0.02 * np.sin(3.0 * s / R)

    u = ring.strains(ring.equilibrium(ring.along(wavy), stages=1))
    np.testing.assert_allclose(np.hypot(u[:, 0], u[:, 1]), 2.0 * np.pi, rtol=1e-7)
    np.testing.assert_allclose(u[:, 2:], [[0.0, 0.0, 0.0, 1.0]] * 12, atol=1e-7)


@pytest.mark.parametrize("ends", [("hinged", "hinged"), ("clamped", "clamped")], ids="-".join)
def test_a_rod_between_two_walls_hangs_as_its_load_asks(ends):
    """Small loads bend a beam: 5 w L^4/(384 EI) between hinges, w L^4/(384 EI) between clamps."""
    stiff = RodSection([*SECTION.stiffness[:3], 1e6, 1e6, 1e6], SECTION.inertia)
    turn = [[0, 0, 1, 0], [0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1]]
    gravity = 1e-5 * stiff.stiffness[0] / stiff.inertia[5]
    rod = CosseratRod(stiff, 1.0, 20, ends=ends, gravity=gravity)
    sag = -rod.equilibrium(rod.shape(start=turn), stages=1)[10, 2, 3]
    factor = 5.0 if ends[0] == "hinged" else 1.0
    assert sag == pytest.approx(factor * 1e-5 / 384.0, rel=0.01)
