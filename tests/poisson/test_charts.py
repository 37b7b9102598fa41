"""Canonical and local coordinates of Poisson systems: there, an integration, and back."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import pytest

import liemech as lm
from liemech.formulas import cos, sin

SPECIES = lm.models.LotkaVolterra([[0, 1, -1], [-1, 0, 1], [1, -1, 0]], [1.0, 2.0, 1.0], [1.0, 1.0, 1.0])
BODY = lm.RigidBody([1.0, 1.5, 2.0])
MOMENTA = lm.PoissonSystem(lm.coadjoint(lm.SO3()).poisson_structure, BODY.hamiltonian)


# ---------------------------------------------------------------- canonical coordinates


@pytest.mark.parametrize("dim", [2, 3, 5, 6])
def test_linear_charts_of_any_rank(dim: int) -> None:
    rng = np.random.default_rng(dim)
    full = rng.normal(size=(dim, dim))
    low = np.outer(full[0], full[1])  # rank 2
    for values in (full - full.T, low - low.T, np.zeros((dim, dim))):
        chart = lm.charts.LinearDarboux(lm.structures.ConstantStructure(values))
        assert 2 * chart.degrees == np.linalg.matrix_rank(values)
        assert chart.defect(rng.normal(size=dim)) < 1e-13
        y = rng.normal(size=dim)
        assert np.allclose(chart.point(chart.coordinates(y)), y, rtol=0.0, atol=1e-13)


@pytest.mark.parametrize(
    ("chart", "y"),
    [(lm.charts.Andoyer(), [0.3, -0.4, 0.5]), (lm.charts.LogarithmicDarboux(SPECIES.structure), [1.0, 0.8, 1.2])],
    ids=["Andoyer", "logarithms"],
)
def test_closed_charts_are_canonical_and_lead_back(chart: Any, y: list[float]) -> None:
    assert chart.defect(y) < 1e-15
    assert np.allclose(chart.point(chart.coordinates(y)), y, rtol=1e-15, atol=1e-15)


@pytest.mark.parametrize(
    ("structure", "y", "degrees"),
    [
        (MOMENTA.structure, [0.3, 0.4, 0.5], 1),
        (SPECIES.structure, [1.0, 0.8, 1.2], 1),
        (lm.models.MaxwellBloch().structure, [1.0, 0.5, 0.3], 1),
        (lm.models.TodaLattice(3).structure, [0.6, 0.5, 0.2, -0.1, 0.3], 2),
    ],
    ids=["so(3)*", "species", "Maxwell-Bloch", "Toda"],
)
def test_the_construction_of_darboux_and_lie(structure: Any, y: list[float], degrees: int) -> None:
    """Canonical to 1e-10 near the point, with as many Casimirs as are left, functions of the ones that are known."""
    chart = lm.charts.DarbouxLieChart(structure, y, steps=2)
    assert chart.degrees == degrees
    near = np.array(y) * (1.0 + 0.1 * np.random.default_rng(3).uniform(-1.0, 1.0, len(y)))
    assert chart.defect(near) < 1e-10
    z = chart.coordinates(near)
    assert np.allclose(chart.point(z), near, rtol=0.0, atol=1e-11)
    assert np.allclose(chart.coordinates(y)[: 2 * degrees], 0.0, atol=1e-15)
    leaf = chart.point(np.array([*np.zeros(2 * degrees), *z[2 * degrees :]]))
    assert np.allclose(structure.casimirs(leaf), structure.casimirs(near), rtol=1e-10, atol=1e-12)


def test_no_chart_where_the_rank_falls() -> None:
    """Around a wrench without force orbits have four dimensions, at it two."""
    motions = lm.coadjoint(lm.SE3()).poisson_structure
    with pytest.raises(lm.errors.InvalidInput, match="is 2, beside it 4"):
        lm.charts.DarbouxLieChart(motions, [0.3, 0.4, 0.5, 0.0, 0.0, 0.0])


@pytest.mark.slow
def test_the_construction_where_a_level_is_inside_another() -> None:
    """Rank 4 with derivatives of the field in it, and rank 4 of 6."""
    guide, motions = (
        lm.models.GuidingCentre(lm.models.TokamakField(), 0.1).structure,
        lm.coadjoint(lm.SE3()).poisson_structure,
    )
    for structure, y in ((guide, [1.05, 0.1, 0.1, 0.2]), (motions, [0.3, 0.4, 0.5, 0.9, -0.2, 0.4])):
        chart = lm.charts.DarbouxLieChart(structure, y)
        assert chart.degrees == 2
        assert chart.defect(np.array(y) * 1.05) < 1e-10


@pytest.mark.slow
def test_a_body_in_andoyers_variables_and_back() -> None:
    """Order 4 against the exact motion; the momentum stays on its sphere; the step is a Poisson map."""
    mu = [0.9, 0.3, 0.4]
    chart = lm.charts.Andoyer()
    there, start = chart.system(MOMENTA, MOMENTA.state(mu))
    assert there.energy(start.q, start.p) == pytest.approx(BODY.energy(mu), rel=1e-15)
    errors = []
    for steps in (10, 20):
        run = lm.integrate(
            there, lm.HamiltonJacobi(order=4), start, h=2.0 / steps, steps=steps, compiled=False, progress=False
        )
        back = there.points(run.q, run.p)
        assert np.allclose(np.linalg.norm(back, axis=1), np.linalg.norm(mu), rtol=1e-14)
        errors.append(np.abs(back[-1] - BODY.exact(BODY.state(mu), 2.0).mu).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.3)
    assert lm.poisson_defect(lm.HamiltonJacobi(order=4), there, start, 0.2) < 1e-12


def test_a_chart_that_is_left_says_so() -> None:
    chart = lm.charts.Andoyer()
    with pytest.raises(lm.errors.OutsideChart, match="over the third axis"):
        chart.point([0.3, 1.2, 1.0])
    there, start = chart.system(MOMENTA, MOMENTA.state([0.3, 0.2, 1.0]))
    with pytest.raises(lm.errors.OutsideChart, match="left the chart"):
        lm.integrate(there, lm.RKMK(order=1), start, h=3.0, steps=200, compiled=False, progress=False)
    far = lm.charts.DarbouxLieChart(MOMENTA.structure, [0.3, 0.4, 0.5], steps=2)
    with pytest.raises(lm.errors.OutsideChart, match="stay nearer"):
        far.coordinates([0.3, 0.9, -0.5])
    with pytest.raises(lm.errors.InvalidInput, match="rank zero"):
        lm.charts.DarbouxLieChart(MOMENTA.structure, [0.0, 0.0, 0.0])
    with pytest.raises(lm.errors.InvalidInput, match="a PoissonSystem with"):
        chart.system(SPECIES, SPECIES.state([1.0, 1.0, 1.0]))


@pytest.mark.slow
def test_species_in_logarithms_and_back() -> None:
    """Gauss' method is a Poisson integrator there, and keeps the Casimir; here it is none."""
    chart = lm.charts.LogarithmicDarboux(SPECIES.structure)
    begin = SPECIES.state([1.0, 0.8, 1.2])
    there, start = chart.system(SPECIES, begin)
    gauss = lm.RKMK(tableau=lm.tableaus.gauss(2))
    assert lm.poisson_defect(gauss, there, start, 0.3) < 1e-12
    assert lm.poisson_defect(gauss, SPECIES, begin, 0.3) > 1e-7
    run = lm.integrate(there, gauss, start, h=0.05, steps=20, compiled=False, progress=False)
    back = there.points(run.q, run.p)
    direct = lm.integrate(SPECIES, lm.RKMK(order=8), begin, h=0.05, steps=20, compiled=False, progress=False)
    assert np.allclose(back, direct.y, rtol=0.0, atol=3e-7)
    assert np.allclose(SPECIES.casimirs(back), SPECIES.casimirs(direct.y[0]), rtol=0.0, atol=1e-14)


# ---------------------------------------------------------------- local coordinates of a constrained system

GRAVITY = 9.81
Q0, V0 = [0.6, 0.0, -0.8], [0.4, 1.5, 0.3]
AT_HALF = (
    [0.118622044704195811, 0.466592090544287381, -0.876481963049843540],
    [-1.96537876408542766, -0.143566790544161937, -0.342419341411690487],
)
"""The spherical pendulum after half a second, from a computation in 36 digits."""


@lm.record
class Particle(lm.HamiltonianSystem):
    """A free particle under gravity: the constraint |q| = 1 is in the chart alone."""

    degrees: ClassVar[int] = 3

    def energy(self, q: lm.Vec, p: lm.Vec) -> float:
        return 0.5 * lm.dot(p, p) + GRAVITY * q[2]


@lm.record
class Sphere(lm.charts.LocalChart):
    """y = (theta, phi, and either their velocities or their momenta)."""

    dim: ClassVar[int] = 4
    momenta: bool

    def embedding(self, y: lm.Vec) -> lm.Vec:
        s, c, sp, cp = sin(y[0]), cos(y[0]), sin(y[1]), cos(y[1])
        turn = y[3] / (s * s) if self.momenta else y[3]
        along, around = lm.vec(c * cp, c * sp, -s), lm.vec(-s * sp, s * cp, 0.0)
        return lm.vec(s * cp, s * sp, c, *(y[2] * along + turn * around))

    def coordinates(self, x: lm.Vec) -> lm.Vec:
        q, p = lm.vec(x[0], x[1], x[2]), lm.vec(x[3], x[4], x[5])
        s2 = q[0] * q[0] + q[1] * q[1]
        turn = q[0] * p[1] - q[1] * p[0]
        theta = lm.formulas.acos(q[2])
        return lm.vec(
            theta, lm.formulas.atan2(q[1], q[0]), -p[2] / lm.formulas.sqrt(s2), turn if self.momenta else turn / s2
        )


@pytest.mark.parametrize("momenta", [True, False], ids=["momenta", "velocities"])
def test_the_spherical_pendulum_in_local_coordinates(momenta: bool) -> None:
    """The round trip: into the chart, half a second of motion, and back, against known digits; L_3 is an invariant."""
    chart = Sphere(momenta)
    system = lm.charts.in_coordinates(Particle(), chart)
    x = np.array([*Q0, *V0])
    y = chart.coordinates(x)
    assert np.allclose(chart.embedding(y), x, rtol=0.0, atol=1e-15)
    assert lm.check_poisson(system.structure, [y, [0.7, 0.3, -0.4, 0.9]])
    run = lm.integrate(system, lm.RKMK(order=8), system.state(y), h=0.05, steps=10, compiled=False, progress=False)
    assert np.allclose(chart.embedding(run.y[-1]), [*AT_HALF[0], *AT_HALF[1]], rtol=0.0, atol=1e-8)

    def vertical(z: Any) -> Any:
        w = chart.embedding(z)
        return w[0] * w[4] - w[1] * w[3]

    assert system.structure.is_invariant(vertical, system.energy, [y])
    assert not system.structure.is_invariant(lambda z: z[0], system.energy, [y])


@pytest.mark.slow
@pytest.mark.parametrize("momenta", [True, False], ids=["momenta", "velocities"])
@pytest.mark.parametrize("order", [2, 4])
def test_hamilton_and_jacobi_in_local_coordinates(order: int, momenta: bool) -> None:
    """Steps that are symplectic on the manifold, as they are Poisson maps in coordinates, and on it by the embedding."""
    chart, method = Sphere(momenta), lm.PoissonHamiltonJacobi(order)
    system = lm.charts.in_coordinates(Particle(), chart)
    start = system.state(chart.coordinates(np.array([*Q0, *V0])))
    errors = []
    for steps in (20, 40):
        run = lm.integrate(system, method, start, h=0.5 / steps, steps=steps, compiled=True, progress=False)
        q, p = np.split(np.asarray(chart.embedding(run.y[-1])), 2)
        assert abs(q @ q - 1.0) < 1e-15 and abs(q @ p) < 1e-15
        errors.append(np.abs([q - AT_HALF[0], p - AT_HALF[1]]).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.1)
    assert lm.poisson_defect(method, system, start, 0.05) < 1e-13


def test_structures_of_the_sphere_in_closed_form() -> None:
    """With momenta canonical; with velocities B_12 of them 2 v_phi cot theta, and 1 and 1/sin^2
    theta beside the angles.
    """
    y = [0.7, 0.3, -0.4, 0.9]
    B = np.array(lm.charts.in_coordinates(Particle(), Sphere(True)).structure.matrix(y))
    assert np.allclose(B, lm.structures.Canonical(2).matrix(y), rtol=0.0, atol=1e-15)
    theta, _, _, turn = y
    B = np.array(lm.charts.in_coordinates(Particle(), Sphere(False)).structure.matrix(y))
    expected = np.zeros((4, 4))
    expected[0, 2], expected[1, 3], expected[2, 3] = (1.0, 1.0 / np.sin(theta) ** 2, 2.0 * turn / np.tan(theta))
    assert np.allclose(B, expected - expected.T, rtol=0.0, atol=1e-14)


def test_charts_that_are_none_are_refused() -> None:
    with pytest.raises(lm.errors.InvalidType, match="chart must be a LocalChart"):
        lm.charts.in_coordinates(Particle(), lm.charts.Andoyer())  # type: ignore[arg-type]
    with pytest.raises(lm.errors.InvalidType, match="an even number"):

        @lm.record
        class Odd(lm.charts.LocalChart):
            dim: ClassVar[int] = 3

        lm.charts.in_coordinates(Particle(), Odd())
    with pytest.raises(lm.errors.InvalidType, match="energy"):
        lm.charts.in_coordinates(lm.SO3(), Sphere(True))


# ---------------------------------------------------------------- symplectic is Poisson in coordinates

PENDULUM = lm.SphericalPendulum(gravity=GRAVITY)
METHODS = {
    "RATTLE": (lm.RATTLE(), True),
    "Euler": (lm.ConstrainedEuler(), True),
    "geodesics": (lm.GeodesicSplitting(order=4), True),
    "Lobatto": (lm.LobattoPair(order=4), True),
    "projected": (lm.IndexReduction(lm.RKMK(order=2), project=True), False),
}


@pytest.mark.slow
@pytest.mark.parametrize("momenta", [True, False], ids=["momenta", "velocities"])
@pytest.mark.parametrize("name", METHODS)
def test_symplectic_on_the_manifold_is_poisson_in_coordinates(name: str, momenta: bool) -> None:
    """The lemma, both ways and in two kinds of coordinates, one canonical and one not: a Poisson map in them if and
    only if check_method, which has coordinates of its own, finds the two-form kept.
    """
    method, symplectic = METHODS[name]
    start = PENDULUM.state(Q0, V0)
    defect = lm.poisson_defect(method, PENDULUM, start, 0.05, Sphere(momenta))
    if symplectic:
        assert defect < 1e-10
    else:
        assert defect > 1e-6
    if momenta:
        report = lm.check_method(method, PENDULUM, start, h=0.2, raises=False)
        seen = report["symplectic"].verdict
        assert seen == ("holds" if symplectic else "not seen")


def test_a_hamiltonian_system_is_poisson_in_any_coordinates() -> None:
    """The lemma without constraints: a symplectic step in coordinates that are not canonical."""

    @lm.record
    class Polar(lm.charts.LocalChart):
        """Distance and angle, with their velocities."""

        dim: ClassVar[int] = 4

        def embedding(self, y: lm.Vec) -> lm.Vec:
            r, a, u, w = y
            s, c = sin(a), cos(a)
            return lm.vec(r * c, r * s, u * c - r * w * s, u * s + r * w * c)

        def coordinates(self, x: lm.Vec) -> lm.Vec:
            r = lm.formulas.sqrt(x[0] * x[0] + x[1] * x[1])
            u = (x[0] * x[2] + x[1] * x[3]) / r
            w = (x[0] * x[3] - x[1] * x[2]) / (r * r)
            return lm.vec(r, lm.formulas.atan2(x[1], x[0]), u, w)

    planet = lm.Kepler()
    start = planet.state([0.8, 0.3], [-0.2, 1.1])
    assert lm.check_poisson(lm.structures.InducedStructure(Polar()), [[0.9, 0.2, 0.1, 1.3]])
    assert lm.poisson_defect(lm.StormerVerlet(), planet, start, 0.1, Polar()) < 1e-13
    assert lm.poisson_defect(lm.RKMK(order=4), planet, start, 0.1, Polar()) > 1e-9


def test_charts_of_defects_are_refused() -> None:
    start = PENDULUM.state(Q0, V0)
    with pytest.raises(lm.errors.IncompatibleSystem, match="give coordinates of it, chart="):
        lm.poisson_defect(lm.RATTLE(), PENDULUM, start, 0.05)
    with pytest.raises(lm.errors.InvalidType, match="must be a LocalChart"):
        lm.poisson_defect(lm.RATTLE(), PENDULUM, start, 0.05, lm.charts.Andoyer())  # type: ignore[arg-type]
    off = Particle().state([0.6, 0.0, -0.9], V0)
    with pytest.raises(lm.errors.InvalidInput, match=r"is not in Sphere\(momenta=True\)"):
        lm.poisson_defect(lm.RKMK(order=4), Particle(), off, 0.05, Sphere(True))
    with pytest.raises(lm.errors.InvalidInput, match="leaves the manifold"):
        free = Particle().state(Q0, V0)
        lm.poisson_defect(lm.RKMK(order=4), Particle(), free, 0.05, Sphere(True))
    with pytest.raises(lm.errors.IncompatibleSystem, match="with a chart"):
        body = lm.RigidBody([1.0, 1.5, 2.0])
        lm.poisson_defect(lm.RKMK(order=4), body, body.state([1.0, 0.0, 0.5]), 0.1, Sphere(True))
