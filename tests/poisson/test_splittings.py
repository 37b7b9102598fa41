"""Poisson integrators: splittings of any number of parts, symplectic Euler in the plane, and their defects."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import pytest

import liemech as lm
from liemech.compiler.changes.staleness import Guard
from liemech.tableaus.splittings import BLANES_MOAN4_GENERAL, BLANES_MOAN6_GENERAL

SPECIES = lm.models.LotkaVolterra()
START = SPECIES.state([1.5, 1.0])
CHAIN = lm.models.LotkaVolterra([[0, 1, -1], [-1, 0, 1], [1, -1, 0]], [1.0, 2.0, 1.0], [1.0, 1.0, 1.0])
TOP = lm.models.PoissonTop([1.0, 1.5, 2.0], 2.0, [0.1, 0.0, 0.5])
TOP_START = TOP.state([0.3, 0.2, 1.0, 0.0, 0.6, 0.8])


@lm.record
class Well(lm.Hamiltonian):
    def energy(self, x: lm.Vec) -> float:
        return x[0] ** 3 - x[1] ** 3 + 0.2 * x[0] ** 4 + x[1] ** 4 + x[2] ** 4


PARTICLE = lm.models.ChargedParticle(lm.models.AxialField(), Well())
LATTICE = lm.models.TodaLattice(4)
CASES: list[Any] = [
    (SPECIES, START, 0.3),
    (CHAIN, CHAIN.state([1.0, 0.8, 1.2]), 0.3),
    (TOP, TOP_START, 0.3),
    (PARTICLE, PARTICLE.state([0.0, 1.0, 0.1, 0.09, 0.55, 0.30]), 0.2),
    (lm.models.MaxwellBloch(), lm.models.MaxwellBloch().state([1.0, 0.5, 0.3]), 0.5),
    (LATTICE, LATTICE.state_of([0.3, -0.2, 0.1, 0.4], [0.5, -0.3, 0.2, 0.1]), 0.3),
    (
        lm.models.LotkaVolterra.volterra_lattice(5),
        lm.models.LotkaVolterra.volterra_lattice(5).state([1.0, 0.7, 1.3, 0.9, 0.5]),
        0.2,
    ),
]
IDS = [type(system).__name__ for system, _, _ in CASES]


def end(system: Any, method: Any, start: Any, time: float, steps: int) -> np.ndarray:
    run = lm.integrate(system, method, start, h=time / steps, steps=steps, every=steps, compiled=False, progress=False)
    return np.asarray(run.last.y)


@pytest.mark.parametrize(("system", "start", "h"), CASES, ids=IDS)
def test_shipped_systems_obey_their_laws(system: Any, start: Any, h: float) -> None:
    """Gradients, Casimirs, the motions of all parts, constants along the motion."""
    report = lm.check_system(system, start)
    assert report["motions of parts"].verdict == "holds"
    assert not system.unknown_motion()


@pytest.mark.sample(4)
@pytest.mark.parametrize(("system", "start", "h"), CASES, ids=IDS)
def test_splittings_are_poisson_maps_and_keep_casimirs(system: Any, start: Any, h: float) -> None:
    for method in (lm.Splitting(order=1), lm.Splitting(order=2), lm.Splitting(order=4)):
        assert lm.poisson_defect(method, system, start, h) < 1e-12
    assert lm.poisson_defect(lm.RKMK(order=4), system, start, h) > 1e-8
    run = lm.integrate(system, lm.Splitting(order=2), start, h=h, steps=50, compiled=False, progress=False)
    for kept in run.drift().kept:
        if kept.name.startswith("Casimir"):
            assert kept.verdict == "exact" and kept.largest < 1e-14


@pytest.mark.sample(6)
@pytest.mark.parametrize("order", [1, 2, 3, 4, 6, 8])
@pytest.mark.parametrize("system", [SPECIES, TOP], ids=["two parts", "four parts"])
def test_orders_of_parts(system: Any, order: int) -> None:
    """Slopes against RKMK of order 8; four parts, whose turns do not commute."""
    start = START if system is SPECIES else TOP_START
    exact = end(system, lm.RKMK(order=8), start, 1.0, 30)
    coarse = {1: 20, 2: 10, 3: 10, 4: 4, 6: 3, 8: 2}[order]
    errors = [np.abs(end(system, lm.Splitting(order=order), start, 1.0, n) - exact).max() for n in (coarse, 2 * coarse)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.55 if order > 4 else 0.35)


def test_sequences_of_two_parts_are_the_tableaus_and_of_one_the_motion() -> None:
    for tableau in (BLANES_MOAN4_GENERAL, BLANES_MOAN6_GENERAL):
        sequence = tableau.sequence(2)
        assert [c for part, c in sequence if part == 1] == list(tableau.kicks)
        assert [c for part, c in sequence if part == 0] == list(tableau.drifts)
        for parts in (1, 3, 5):
            shares = [sum(c for part, c in tableau.sequence(parts) if part == i) for i in range(parts)]
            assert np.allclose(shares, 1.0, rtol=1e-14, atol=0.0)
            backwards = [c for _, c in tableau.sequence(parts)][::-1]
            assert np.allclose(backwards, [c for _, c in tableau.sequence(parts)], rtol=0.0, atol=1e-15)


def test_canonical_parts_are_the_separable_system() -> None:
    """T(p) and V(q) are recognised; the steps of Stormer and Verlet, and Runge-Kutta-Nystroem
    splittings where they apply.
    """

    @lm.record
    class T(lm.Hamiltonian):
        def energy(self, y: lm.Vec) -> float:
            return 0.5 * (y[2] ** 2 + y[3] ** 2)

    @lm.record
    class V(lm.Hamiltonian):
        def energy(self, y: lm.Vec) -> float:
            return 0.5 * (y[0] ** 2 + y[1] ** 2) + y[1] * (y[0] ** 2 - y[1] ** 2 / 3.0)

    stars, same = (
        lm.models.HenonHeiles(),
        lm.PoissonSystem(lm.structures.Canonical(2), lm.SplitHamiltonian((T(), V()))),
    )
    assert same.quadratic
    q, p = [0.0, 0.1], [0.5, 0.05]
    for method in (lm.StormerVerlet(), lm.StormerVerlet("drift"), lm.Splitting(order=4), lm.Splitting(order=8)):
        a = lm.integrate(stars, method, stars.state(q, p), h=0.2, steps=20, compiled=False)
        b = lm.integrate(same, method, same.state([*q, *p]), h=0.2, steps=20, compiled=False)
        assert np.allclose(np.hstack([a.q, a.p]), b.y, rtol=1e-13, atol=1e-14)

    @lm.record
    class Root(lm.Hamiltonian):
        def energy(self, y: lm.Vec) -> float:
            return lm.formulas.sqrt(1.0 + y[2] ** 2 + y[3] ** 2)

    other = lm.PoissonSystem(lm.structures.Canonical(2), lm.SplitHamiltonian((Root(), V())))
    assert not other.quadratic
    assert lm.Splitting(order=6).tableau_for(other) == BLANES_MOAN6_GENERAL
    with pytest.raises(lm.errors.IncompatibleSystem, match="quadratic=False"):
        lm.Splitting(tableau=lm.tableaus.SPLITTINGS["Blanes-Moan 4"]).tableau_for(other)
        lm.Splitting(tableau=lm.tableaus.SPLITTINGS["Blanes-Moan 6"]).require(other)


@pytest.mark.slow
def test_quadratic_parts_of_constant_structures_are_recognised() -> None:
    """A rotating frame, H = |p|^2/2 + q_1 p_2 - q_2 p_1: an affine motion; with a field of any form order 4."""

    @lm.record
    class Frame(lm.Hamiltonian):
        def energy(self, y: lm.Vec) -> float:
            return 0.5 * (y[2] ** 2 + y[3] ** 2) + y[0] * y[3] - y[1] * y[2] + 0.3 * y[1]

    @lm.record
    class Field(lm.Hamiltonian):
        def energy(self, y: lm.Vec) -> float:
            return 0.25 * (y[0] ** 2 + 2.0 * y[1] ** 2) ** 2

    system = lm.PoissonSystem(lm.structures.Canonical(2), lm.SplitHamiltonian((Frame(), Field())))
    assert not system.unknown_motion()
    start = system.state([0.5, 0.2, -0.3, 0.4])
    assert lm.check_system(system, start)
    assert lm.poisson_defect(lm.Splitting(order=4), system, start, 0.3) < 1e-13
    assert lm.check_method(lm.Splitting(order=4), system, start, compiled=False)["order"].verdict == "holds"


@lm.record
class Mixed(lm.Hamiltonian):
    def energy(self, y: lm.Vec) -> float:
        return y[0] ** 2 * y[1] ** 2


def test_unknown_motions_are_refused_with_the_reason() -> None:
    system = lm.PoissonSystem(lm.structures.Canonical(1), Mixed())
    with pytest.raises(lm.errors.IncompatibleSystem, match=r"depends on more than one coordinate.*write `flow`"):
        lm.integrate(system, lm.Splitting(order=2), system.state([0.3, 0.2]), h=0.1, steps=1)

    @lm.record
    class Own(lm.Part):
        """q^2 p^2, whose product q p is constant."""

        def energy(self, y: lm.Vec) -> float:
            return y[0] ** 2 * y[1] ** 2

        def flow(self, structure: lm.PoissonStructure, y: lm.Vec, t: float) -> lm.Vec:
            growth = lm.formulas.exp(2.0 * t * y[0] * y[1])
            return lm.vec(y[0] * growth, y[1] / growth)

    own = lm.PoissonSystem(lm.structures.Canonical(1), Own())
    assert lm.check_system(own)
    for order in (1, 4, 8):  # one part: the step is its motion
        found = end(own, lm.Splitting(order=order), own.state([0.6, 0.7]), 1.0, 2)
        assert np.allclose(found, [0.6 * np.exp(0.84), 0.7 * np.exp(-0.84)], rtol=1e-14)

    @lm.record
    class Slow(Own):
        def flow(self, structure: lm.PoissonStructure, y: lm.Vec, t: float) -> lm.Vec:
            return super().flow(structure, y, 0.5 * t)

    with pytest.raises(lm.errors.LawViolation, match=r"motions of parts[\s\S]*a factor 1/2 too many"):
        lm.check_system(lm.PoissonSystem(lm.structures.Canonical(1), Slow()))


# ---------------------------------------------------------------- symplectic Euler in the plane


@lm.record
class Planar(lm.PoissonStructure):
    """{u, v} = c_0 + c_1 u + c_2 v + c_3 u v + c_4 u^2 v."""

    dim: ClassVar[int] = 2
    c: lm.Vec

    def matrix(self, y: lm.Vec) -> lm.Mat:
        u, v = y
        b = self.c[0] + self.c[1] * u + self.c[2] * v + self.c[3] * u * v + self.c[4] * u * u * v
        return lm.mat(lm.vec(0.0, b), lm.vec(-b, 0.0))


@lm.record
class Separate(lm.Hamiltonian):
    def energy(self, y: lm.Vec) -> float:
        return lm.formulas.sin(y[0]) + 0.5 * y[0] ** 2 + 0.25 * y[1] ** 4 - 2.0 * y[1]


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    "c", [(1, 0, 0, 0, 0), (0, 0, 0, 1, 0), (1, 0, 0, 1, 0), (0, 1, 1, 0, 0), (0.3, -0.2, 0.5, 0.7, 0)]
)
def test_symplectic_euler_is_poisson_for_affine_b(c: tuple[float, ...]) -> None:
    system = lm.PoissonSystem(Planar(lm.vec(*map(float, c))), Separate())
    start = system.state([0.8, 0.6])
    for method in (
        lm.PoissonEuler(),
        lm.PoissonEuler("v"),
        lm.PoissonVerlet(),
        lm.Composition(lm.PoissonVerlet(), order=4),
    ):
        assert lm.poisson_defect(method, system, start, 0.1) < 1e-12


def test_symplectic_euler_is_refused_where_it_is_no_poisson_map() -> None:
    """b = u^2 v: written out with Newton's method it has a defect of half a hundredth, so the lemma
    for every b is too wide.
    """
    system = lm.PoissonSystem(Planar(lm.vec(0.0, 0.0, 0.0, 0.0, 1.0)), Separate())
    with pytest.raises(lm.errors.IncompatibleSystem, match="not affine in u"):
        lm.PoissonEuler().require(system)
    with pytest.raises(lm.errors.IncompatibleSystem, match=r"K\(u\) \+ L\(v\)"):
        lm.PoissonVerlet().require(lm.PoissonSystem(lm.structures.Canonical(1), Mixed()))
    with pytest.raises(lm.errors.IncompatibleSystem, match="in the plane"):
        lm.PoissonEuler().require(CHAIN)

    def step(y: np.ndarray, h: float) -> np.ndarray:
        u, v = y
        slope, new = v**3 - 2.0, u
        for _ in range(100):
            new = u + h * new**2 * v * slope
        return np.array([new, v - h * new**2 * v * (np.cos(new) + new)])

    y, h, e = np.array([0.8, 0.6]), 0.1, 1e-5
    D = np.stack([(step(y + e * d, h) - step(y - e * d, h)) / (2 * e) for d in np.eye(2)], axis=1)
    end = step(y, h)
    assert abs(np.linalg.det(D) * y[0] ** 2 * y[1] / (end[0] ** 2 * end[1]) - 1.0) > 1e-3


def test_symplectic_euler_of_lotka_and_volterra() -> None:
    """u_1 = u/(1 - h (v - 2)), v_1 = v + h v (1 - u_1); the adjoint inverts it; a step too large is refused."""
    h, (u, v) = 0.1, (1.5, 1.0)
    new = end(SPECIES, lm.PoissonEuler(), START, h, 1)
    u1 = u / (1.0 - h * (v - 2.0))
    assert np.allclose(new, [u1, v + h * v * (1.0 - u1)], rtol=1e-15, atol=0.0)
    back = lm.integrate(SPECIES, lm.PoissonEuler("v"), SPECIES.state(new), h=-h, steps=1, compiled=False)
    assert np.allclose(back.y[-1], [u, v], rtol=1e-15, atol=0.0)
    with pytest.raises(lm.errors.NoConvergence, match="too large"):
        lm.integrate(SPECIES, lm.PoissonEuler(), SPECIES.state([1.0, 4.0]), h=0.6, steps=1, compiled=False)
    logs = end(SPECIES, lm.Splitting(order=1), START, h, 1)  # the same in the logarithms of u and v
    u2 = u * np.exp(h * (v - 2.0))
    assert np.allclose(logs, [u2, v * np.exp(h * (1.0 - u2))], rtol=1e-15, atol=0.0)


def test_orbits_close_or_spiral() -> None:
    """Five hundred steps of h = 0.05: symplectic Euler stays in a band, explicit Euler leaves; logs
    are positive for any h.
    """
    runs = {
        method: lm.integrate(SPECIES, method, START, h=0.05, steps=500, progress=False, compiled=False).energy
        for method in (lm.PoissonEuler(), lm.Splitting(order=1), lm.RKMK(order=1))
    }
    first, logs, explicit = runs.values()
    assert np.ptp(first[:250]) == pytest.approx(np.ptp(first[250:]), rel=0.02)
    assert np.ptp(logs[:250]) == pytest.approx(np.ptp(logs[250:]), rel=0.02)
    assert explicit[-1] - explicit[0] > 2.0 * np.ptp(first)
    large = lm.integrate(SPECIES, lm.Splitting(order=2), START, h=0.7, steps=200, compiled=False)
    assert large.y.min() > 0.0


@pytest.mark.slow
def test_gauss_methods_are_poisson_maps_for_constant_structures_only() -> None:
    """Casimirs too: linear ones are kept by every Runge-Kutta method, those of Lotka and Volterra are not."""
    constant = lm.PoissonSystem(
        lm.structures.ConstantStructure([[0, 1.0, 2.0], [-1.0, 0, 0.5], [-2.0, -0.5, 0]]), Quartic()
    )
    start = constant.state([0.4, -0.2, 0.3])
    for tableau in (lm.tableaus.gauss(1), lm.tableaus.gauss(2)):
        gauss = lm.RKMK(tableau=tableau)
        assert lm.poisson_defect(gauss, constant, start, 0.2) < 1e-12
        assert lm.poisson_defect(gauss, SPECIES, START, 0.3) > 1e-5
    run = lm.integrate(constant, lm.RKMK(order=4), start, h=0.1, steps=50, compiled=False)
    assert run.drift()["Casimir 1"].verdict == "exact"
    run = lm.integrate(
        CHAIN, lm.RKMK(tableau=lm.tableaus.gauss(1)), CHAIN.state([1.0, 0.8, 1.2]), h=0.2, steps=50, compiled=False
    )
    assert run.drift()["Casimir 1"].largest > 1e-8


@lm.record
class Quartic(lm.Hamiltonian):
    def energy(self, y: lm.Vec) -> float:
        return 0.5 * lm.dot(y, y) + 0.25 * y[0] ** 4 + y[1] * y[2] ** 2


@pytest.mark.parametrize(
    ("method", "claims"),
    [
        (lm.SphericalMidpoint(), True),
        (lm.Isospectral(4), True),
        (lm.ThreeRotations(), True),
        (lm.ImplicitMidpoint(), False),
    ],
    ids=lambda x: getattr(x, "name", ""),
)
def test_defects_of_other_methods(method: Any, claims: bool) -> None:
    """The measure is that of all brackets: momenta of bodies, too."""
    body = lm.RigidBody([1.0, 1.5, 2.0])
    defect = lm.poisson_defect(method, body, body.state([0.5, 0.3, 0.8]), 0.5)
    assert defect < 1e-12 if claims else defect > 1e-5


def test_defects_in_phase_space_and_refusals() -> None:
    kepler = lm.Kepler()
    start = kepler.pericentre(0.5)
    assert lm.poisson_defect(lm.Splitting(order=6), kepler, start, 0.1) < 1e-13
    assert lm.poisson_defect(lm.RKMK(order=4), kepler, start, 0.1) > 1e-5
    with pytest.raises(lm.errors.InvalidInput, match="one state"):
        lm.poisson_defect(lm.RKMK(order=4), SPECIES, SPECIES.state([[1.0, 2.0], [1.0, 1.0]]), 0.1)
    with pytest.raises(lm.errors.IncompatibleSystem, match="poisson_defect needs"):
        field = lm.models.HeavyTop([1.0, 1.0, 0.5], 1.0, [0.0, 0.0, 1.0])
        lm.poisson_defect(lm.RKMK(order=4), field, field.state([0.1, 0.2, 0.3], np.eye(3)), 0.1)


@pytest.mark.slow
def test_casimirs_over_a_million_steps() -> None:
    for system, start, h in CASES[1:3]:
        run = lm.integrate(system, lm.Splitting(order=2), start, h=0.5 * h, steps=10**6, every=10**4, progress=False)
        for kept in run.drift().kept:
            if kept.name.startswith("Casimir"):
                assert kept.largest < 1e-12
            if kept.name == "energy":
                assert kept.verdict == "bounded"


@pytest.mark.parametrize(
    "method",
    [
        *(lm.LiePoissonHamiltonJacobi(), lm.FirstKindHamiltonJacobi(order=2), lm.CovariantVariational()),
        *(lm.ImplicitMidpoint(), lm.KickDrift()),
    ],
    ids=repr,
)
def test_methods_for_bodies_refuse_poisson_systems(method: Any) -> None:
    with pytest.raises(lm.errors.IncompatibleSystem):
        lm.integrate(TOP, method, TOP_START, h=0.1, steps=1)


@pytest.mark.compiled
def test_a_splitting_reads_nothing_that_can_change_in_place(monkeypatch: pytest.MonkeyPatch) -> None:
    """A table of tableaus that the step looked up was compared in every run: 0.2 ms."""
    plan = lm.Plan(SPECIES, lm.Splitting(order=4), h=0.1, every=8, compiled=True, progress=False)
    plan.run(START, steps=8)
    monkeypatch.setattr(Guard, "_content", lambda self: pytest.fail(f"compares {self.mutable}"))
    plan.run(START, steps=8)
