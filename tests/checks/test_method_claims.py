"""Every shipped method keeps its claims, on a representative of every kind of system that it accepts: one table.

`check_method` observes order, symmetry, brackets, and what is kept.  It finds a wrong claim and
says the number.
"""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Iterator
from typing import Any, ClassVar

import numpy as np
import pytest
from scenes import (
    Driven,
    DrivenFromSpace,
    Relativistic,
    Steered,
    asymmetric_body,
    heavy_top,
    kirchhoff_body,
    orbiting_body,
    same_bits,
)
from shipped import METHODS

import liemech as lm
from liemech.checks import Report, check_method
from liemech.checks.method_claims import MethodTrial
from liemech.rooms.hamilton_jacobi.class_functions import CayleySquare, TraceOfAd
from liemech.tableaus import KAHAN_LI6, SplittingTableau, gauss

EXP, CAYLEY = lm.Exponential(), lm.Cayley()


# ---------------------------------------------------------------- systems


@lm.record
class Precession(lm.HomogeneousEquation):
    """A direction that turns about an axis which depends on it."""

    def velocity(self, t: float, x: lm.Vec) -> lm.Vec:
        return lm.vec(0.3 + x[1], 1.0 - x[0] * x[2], 0.7 * x[0])


@functools.cache
def systems() -> dict[str, tuple[Any, Any]]:
    """One of each kind, with a start that is aligned with nothing."""
    turning = lm.SO3().exp([0.4, -0.3, 0.5])
    fluid, adrift, _ = kirchhoff_body()
    four = lm.LiePoissonSystem(lm.SO(4), lm.KineticEnergy([1.0, 1.4, 1.9, 1.2, 2.3, 1.6]))
    linear = lm.LiePoissonSystem(lm.MatrixLieGroup.of(lm.SL(2).generators), lm.KineticEnergy([1.0, 1.6, 2.3]))
    quaternions = lm.LiePoissonSystem(lm.UnitQuaternions(), lm.KineticEnergy([1.0, 1.6, 2.3]))
    galaxy, double, relativistic = (lm.models.HenonHeiles(), lm.models.DoublePendulum(gravity=1.0), Relativistic())
    sphere = Precession(lm.actions.SphereAction(3))
    return {
        "free body": asymmetric_body(),
        "quaternions": (quaternions, quaternions.state([0.9, 0.7, -0.6], lm.UnitQuaternions().exp([0.4, -0.3, 0.5]))),
        "fluid": (fluid, adrift),
        "SO(4)": (four, four.state([0.6, -0.5, 0.4, 0.7, 0.3, -0.2], lm.SO(4).random(1))),
        "SL(2)": (linear, linear.state([0.5, 0.4, -0.3], np.array([[1.1, 0.2], [0.3, 1.06 / 1.1]]))),
        "heavy top": heavy_top(),
        "satellite": orbiting_body(),
        "galaxy": (galaxy, galaxy.state([0.1, 0.2], [0.3, -0.2])),
        "species": (species := lm.models.LotkaVolterra(), species.state([1.5, 1.0])),
        "double pendulum": (double, double.state([0.9, -0.4], [0.7, 0.2])),
        "relativistic": (relativistic, relativistic.state([1.0, 0.2], [0.3, 1.0])),
        "driven": (driven := Driven(lm.SO3()), driven.state(turning)),
        "driven from space": (driven := DrivenFromSpace(lm.SO3()), driven.state(turning)),
        "steered": (steered := Steered(lm.SO3()), steered.state(turning)),
        "sphere": (sphere, sphere.state([0.6, 0.0, 0.8])),
        "rod": (rod := lm.SphericalPendulum(), rod.state([0.6, 0.0, -0.8], [0.4, 1.5, 0.3])),
    }


# ---------------------------------------------------------------- methods

KINDS = "free body", "heavy top", "galaxy", "species", "fluid", "driven", "steered", "sphere", "rod"
"""A representative of each kind."""


ELSEWHERE = {
    *(lm.ReversibleController, lm.AdaptiveVerlet),  # equal steps of another time: tests/timing
    # systems of their own: tests/timing, tests/joints, tests/poisson
    *(lm.MultipleTimeSteps, lm.LieRATTLE, lm.LagrangeDAlembert, lm.Boris),
    *(lm.SublatticeSplitting, lm.BondSplitting),  # tests/sites
    *(lm.DiscreteGradient, lm.WongZakai, lm.NinomiyaVictoir),  # tests/noise
    lm.DissipativeSplitting,  # tests/models/test_viscous_sphere.py
}
"""Methods whose claims `check_method` does not look at."""


def fitted() -> lm.Method:
    """Moser-Veselov, made exact for the body's start and one step."""
    body, start = asymmetric_body()
    return lm.ExactMoserVeselov.of(body, start, 0.3)


def further() -> Iterator[lm.Method]:
    """Orders, retractions and forms beside those of the list of methods."""
    yield from (lm.RKMK(order=p) for p in (1, 2, 3, 5, 6, 7, 8))
    yield from (lm.RKMK(order=4, retraction=CAYLEY), lm.RKMK(tableau=gauss(2)), lm.CrouchGrossman(order=4), fitted())
    yield from (lm.Taylor(order=6), *(lm.Magnus(order=p) for p in (2, 6)))
    for retraction in (EXP, CAYLEY):
        yield from (lm.CovariantVariational(retraction), lm.LieVerlet(retraction))
        yield from (lm.GalerkinVariational(order=p, retraction=retraction) for p in (2, 4, 6, 8))
        yield from (lm.LiePoissonHamiltonJacobi(p, retraction) for p in (2, 4, 6))
        yield lm.Composition(lm.CovariantVariational(retraction), order=4)
        yield from (lm.FirstKindHamiltonJacobi(order=p, retraction=retraction, scale=1.0) for p in (1, 2))
        yield lm.FirstKindHamiltonJacobi(order=2, retraction=retraction)
    yield lm.CovariantVariational(lm.CayleyAdjoint())
    yield lm.LiePoissonHamiltonJacobi(8, EXP)
    yield from (lm.FirstKindHamiltonJacobi(order=2, s0=s0, retraction=CAYLEY) for s0 in (TraceOfAd(), CayleySquare()))
    yield from (lm.HamiltonJacobi(p, adjoint) for p in (1, 2, 4, 6) for adjoint in (False, True))
    yield lm.SymmetricHamiltonJacobi(4)
    yield from (lm.Composition(base, order=p) for base in (lm.LieVerlet(), lm.CovariantVariational()) for p in (6, 8))
    yield from (*(lm.KickDrift(order=p) for p in (4, 6, 8)), lm.Composition(lm.KickDrift(), order=4))
    yield from (lm.Isospectral(p) for p in (4, 6, 8, 10))
    yield from (lm.StormerVerlet("drift"), lm.SymplecticEuler("drift"))
    yield from (lm.Splitting(order=p) for p in (3, 6, 8))
    yield from (lm.Splitting(order=p, quadratic=False) for p in (4, 6, 8))
    yield lm.Splitting(tableau=SplittingTableau.of(KAHAN_LI6))
    yield from (lm.ConstrainedEuler("drift"), lm.Composition(lm.RATTLE(), order=6))
    yield from (lm.LobattoPair(order=p) for p in (4, 6, 8))
    yield from (lm.GeodesicSplitting(order=p) for p in (4, 6, 8))
    yield lm.IndexReduction(lm.RKMK(order=4), True)
    yield from (lm.PoissonEuler("v"), lm.Composition(lm.PoissonVerlet(), order=4))
    yield from (method(order=p) for method in (lm.PoissonHamiltonJacobi, lm.SymplecticRKMK) for p in (2, 6, 8))


def methods() -> list[lm.Method]:
    """All whose claims are looked at here: not of what is fitted to another step, nor by quadrature, which takes minutes."""
    listed = [
        method for method in METHODS if type(method) not in ELSEWHERE | {lm.ExactMoserVeselov, lm.CovariantVariational}
    ]
    return [*dict.fromkeys((*listed, *further()))]


EVERYWHERE = {
    *(
        lm.RKMK(order=4),
        lm.CommutatorFree(order=4),
        lm.Magnus(order=4),
        lm.CovariantVariational(EXP),
        lm.CovariantVariational(CAYLEY),
    ),
    *(lm.LiePoissonHamiltonJacobi(2, EXP), lm.LieVerlet(CAYLEY), lm.KickDrift(order=4), lm.HamiltonJacobi(2)),
    *(lm.StormerVerlet(), lm.Splitting(order=8, quadratic=False)),
}
"""Those that are checked on other groups and energies too."""


def cases() -> Iterator[Any]:
    """Each method with a system of each kind that it accepts; some with all systems."""
    for method in methods():
        for name, (system, _) in systems().items():
            if name not in KINDS and not (method in EVERYWHERE and (method.symplectic or name != "satellite")):
                continue
            if is_dear(method) and name not in ("free body", "galaxy"):
                continue
            try:
                method.require(system)
            except lm.errors.IncompatibleSystem:
                continue
            quick = name in ("galaxy", "species") or (name == "free body" and method.order <= 4 and not is_dear(method))
            quick = quick and not (isinstance(method, lm.PoissonHamiltonJacobi) and method.order > 2)
            marks = [] if quick else [pytest.mark.slow]  # many seconds
            yield pytest.param(method, name, marks=marks, id=f"{method!r}-{name}")


def is_dear(method: lm.Method) -> bool:
    """Is it so costly that one system must do?

    The scale of a method of the first kind is chosen at the start.  On other groups than rotations it is no function of
    Casimirs, so that steps from two starts belong to two methods, and the bracket of their map is another one.
    """
    dear = lm.LiePoissonHamiltonJacobi, lm.GalerkinVariational, lm.HamiltonJacobi
    return isinstance(method, lm.FirstKindHamiltonJacobi) or (isinstance(method, dear) and method.order > 4)


@pytest.fixture(autouse=True, scope="module")
def known_motions() -> Iterator[None]:
    """Where a motion leads does not depend on the method: it is computed once for all of them."""
    computed, known = MethodTrial.exact.func, {}  # type: ignore[attr-defined]

    def exact(trial: MethodTrial) -> Any:
        start = (part.tobytes() for part in trial.start.arrays.values())
        key = id(trial.system), trial.time, *start
        if key not in known:
            known[key] = computed(trial), trial.system  # which keeps its id to itself
        return known[key][0]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(MethodTrial, "exact", property(exact))
        yield


KEPT = {"free body": "spatial momentum", "heavy top": "vertical momentum"}


@pytest.mark.sample(2)
@pytest.mark.parametrize(("method", "name"), [*cases()])
def test_claims(method: lm.Method, name: str) -> None:
    """Order, symmetry, symplecticity as claimed; momenta of symmetries kept by what is made to keep them."""
    system, start = systems()[name]
    keeps = [KEPT[name]] if name in KEPT and (name == "free body" or method.symplectic) else []
    h = 0.3 if isinstance(method, lm.ExactMoserVeselov) else None
    check_method(method, system, start, h=h, keeps=keeps, compiled=False)


def test_every_method_has_a_system() -> None:
    seen = {type(case.values[0]) for case in cases()}
    assert seen == {type(method) for method in methods()}


def of_free_bodies() -> Iterator[Any]:
    """All that move a free body, but for those whose numbers are fitted to its units."""
    body, _ = systems()["free body"]
    for method in methods():
        with contextlib.suppress(lm.errors.IncompatibleSystem):
            method.require(body)
            if getattr(method, "scale", None) is None and not isinstance(method, lm.ExactMoserVeselov):
                yield pytest.param(method, marks=[pytest.mark.slow] if is_dear(method) else [], id=repr(method))


@pytest.mark.sample(4)
@pytest.mark.parametrize("method", [*of_free_bodies()])
def test_a_free_body(method: lm.Method) -> None:
    """Orbit, group and momentum in space to rounding; at rest it stays, to the bit; neither another unit of mass nor
    whether the attitude is asked for changes a bit of its momentum.
    """
    body, start = systems()["free body"]
    h = 0.05 if isinstance(method, lm.FirstKindHamiltonJacobi) else 0.2

    def run(mu: Any, g: Any, unit: float = 1.0) -> Any:
        one = lm.RigidBody(unit * np.array(body.inertia))
        begin, steps = one.state(unit * np.array(mu), g), 2 if is_dear(method) else 20
        return lm.integrate(one, method, begin, h=h, steps=steps, compiled=False)

    moved, size = run(start.mu, start.g), np.linalg.norm(start.mu)
    assert np.abs(np.linalg.norm(moved.mu, axis=1) - size).max() < 3e-15 * size
    assert np.abs(moved.spatial_momentum - moved.spatial_momentum[0]).max() < 5e-15 * size
    assert np.abs(np.swapaxes(moved.g, 1, 2) @ moved.g - np.eye(3)).max() < 5e-15
    rest = run([0.0, 0.0, 0.0], start.g)
    assert not rest.mu.any() and (rest.g == np.array(start.g)).all()
    for unit in (2.0**-300, 2.0**300):
        heavy = run(start.mu, start.g, unit)
        assert same_bits(heavy.mu, unit * moved.mu) and same_bits(heavy.g, moved.g)
    assert same_bits(run(start.mu, None).mu, moved.mu)


# ---------------------------------------------------------------- claims that do not hold


@lm.record
class Memory(lm.Record):
    """Two successive states."""

    before: lm.BodyState
    now: lm.BodyState


@lm.record
class Leapfrog(lm.Method):
    """The one of docs/your_own_method.md, with the claim that it had there once."""

    order: ClassVar[int] = 2
    symmetric: ClassVar[bool] = True

    def start(self, system: Any, state: Any, h: float) -> Memory:
        half = self.displaced(system, state, -0.5 * h * system.velocity(state.mu))
        return Memory(self.displaced(system, state, -h * system.velocity(half.mu)), state)

    def observe(self, memory: Any) -> Any:
        return memory.now

    def step(self, system: Any, t: float, memory: Any, h: float) -> Memory:
        return Memory(memory.now, self.displaced(system, memory.before, 2.0 * h * system.velocity(memory.now.mu)))

    def displaced(self, system: Any, state: Any, turn: lm.Vec) -> lm.BodyState:
        return system.displaced(EXP, state, turn)  # type: ignore[no-any-return]


def verdicts(report: Report) -> dict[str, str]:
    """The verdicts by the names of the claims."""
    return {finding.law: finding.verdict for finding in report.findings}


@pytest.mark.slow
def test_the_leapfrog_of_the_page_is_not_symmetric_and_its_composition_is_of_order_3() -> None:
    body, start = systems()["free body"]
    with pytest.raises(
        lm.errors.LawViolation, match=r"the law of symmetric(.|\n)*observed  \d\.\de-0\d\n  wanted    below"
    ):
        check_method(Leapfrog(), body, start, compiled=False)
    report = check_method(lm.Composition(Leapfrog(), order=4), body, start, compiled=False, raises=False)
    assert report["order"].verdict == report["symmetric"].verdict == "broken"
    assert report["order"].observed.startswith(("mu 2.9", "mu 3.0"))  # type: ignore[attr-defined]


@lm.record
class Boasting(lm.RKMK):
    """A method that claims what it is not."""

    symplectic: ClassVar[bool] = True

    def step(self, system: Any, t: float, state: Any, h: float) -> Any:
        return super().step(system, t, state, 0.5 * h + 0.5 * h)


@pytest.mark.slow
def test_a_wrong_bracket_is_found_on_momenta_on_groups_and_in_the_plane() -> None:
    for name, law in (("free body", "Poisson"), ("heavy top", "symplectic"), ("galaxy", "symplectic")):
        system, start = systems()[name]
        report = check_method(Boasting(order=4), system, start, compiled=False, raises=False)
        assert verdicts(report)[law] == "broken"
        assert report["order"].verdict == "holds"


@lm.record
class Higher(lm.Method):
    """A method under another order."""

    base: lm.Method
    order: int

    def step(self, system: Any, t: float, state: Any, h: float) -> Any:
        return self.base.step(system, t, state, h)


@pytest.mark.slow
@pytest.mark.parametrize(("order", "claimed"), [(1, 2), (3, 4), (4, 5), (6, 7)])
def test_an_order_too_high_is_found(order: int, claimed: int) -> None:
    higher = Higher(lm.RKMK(order=order), claimed)
    for name in ("free body", "galaxy"):
        system, start = systems()[name]
        with pytest.raises(lm.errors.LawViolation, match=f"the law of order(.|\\n)*wanted    {claimed}"):
            check_method(higher, system, start, compiled=False)


@pytest.mark.slow
def test_what_is_said_to_be_kept_must_be_kept() -> None:
    top, start = systems()["heavy top"]
    with pytest.raises(lm.errors.LawViolation, match="vertical momentum"):
        check_method(lm.RKMK(order=4), top, start, keeps=["vertical momentum"], compiled=False)
    with pytest.raises(
        lm.errors.InvalidInput, match="no constant of this motion; known are: energy, vertical momentum"
    ):
        check_method(lm.RKMK(order=4), top, start, keeps=["charge"], compiled=False)


@pytest.mark.slow
def test_an_attitude_that_is_moved_by_something_else_is_found() -> None:
    """g is moved from the other side: the spatial momentum changes, and the motion seen from elsewhere."""

    @lm.record
    class WrongSide(lm.Method):
        order: ClassVar[int] = 1

        def step(self, system: Any, t: float, state: Any, h: float) -> Any:
            xi = h * system.velocity(state.mu)
            g = None if state.g is None else system.group.compose(system.group.exp(xi), state.g)
            return lm.BodyState(system.group.exp_Ad_star(xi, state.mu), g)

    body, start = systems()["free body"]
    report = check_method(WrongSide(), body, start, compiled=False, raises=False)
    assert verdicts(report)["equivariance"] == verdicts(report)["order"] == "broken"
    assert verdicts(report)["Casimir 1"] == "seen"
    assert verdicts(report)["spatial momentum"] == "not seen"


@pytest.mark.slow
def test_a_symplectic_method_need_not_be_symplectic_with_the_attitude() -> None:
    body, start = systems()["free body"]
    found = {
        m: verdicts(check_method(m, body, start, compiled=False))
        for m in (lm.SphericalMidpoint(), lm.ImplicitMidpoint())
    }
    for method, poisson in ((lm.SphericalMidpoint(), "holds"), (lm.ImplicitMidpoint(), "not seen")):
        assert found[method]["Poisson"] == poisson
        assert found[method]["symplectic"] == "not seen"
        assert found[method]["energy"] == "seen"


@pytest.mark.slow
def test_the_midpoint_rule_is_symplectic_in_the_plane_without_saying_so() -> None:
    galaxy, start = systems()["galaxy"]
    report = check_method(lm.RKMK(tableau=gauss(1)), galaxy, start, compiled=False)
    assert verdicts(report)["symplectic"] == verdicts(report)["symmetric"] == "seen"


@pytest.mark.slow
def test_the_report_names_numbers() -> None:
    galaxy, start = systems()["galaxy"]
    lines = str(check_method(lm.StormerVerlet(), galaxy, start, compiled=False)).splitlines()
    assert lines[0].endswith("4 laws hold, none broken")
    assert lines[1].split() == ["law", "verdict", "observed", "wanted"]
    assert lines[2].split()[:3] == ["order", "holds", "q"]
    assert lines[-2].split()[:3] == ["energy", "not", "seen"]
    assert lines[-1].split()[:2] == ["reversible", "holds"]


@pytest.mark.slow
@pytest.mark.compiled
def test_native_code_is_compared_on_request() -> None:
    galaxy, start = systems()["galaxy"]
    assert (
        check_method(lm.StormerVerlet(), galaxy, start, compiled=False, native=True)["native code"].verdict == "holds"
    )


def test_what_cannot_be_checked_is_said() -> None:
    body, start = systems()["free body"]
    with pytest.raises(lm.errors.InvalidType, match=r"method must be a Method; got .*write RKMK\(\.\.\.\)"):
        check_method(lm.RKMK, body, start)  # type: ignore[arg-type]
    with pytest.raises(lm.errors.InvalidInput, match="ensemble of 2"):
        check_method(lm.RKMK(), body, body.state(np.ones((2, 3))))
    with pytest.raises(lm.errors.InvalidInput, match=r"h = 100 is too long.*turns by a radian in"):
        check_method(lm.RKMK(), body, start, h=100.0)
    with pytest.raises(lm.errors.InvalidInput, match="at rest"):
        check_method(lm.RKMK(), body, body.state([0.0, 0.0, 0.0]))
    with pytest.raises(lm.errors.IncompatibleSystem, match="SeparableSystem"):
        check_method(lm.StormerVerlet(), body, start)

    @lm.record
    class Mistaken(lm.Method):
        order: ClassVar[int] = 1

        def step(self, system: Any, t: float, state: Any, h: float) -> Any:
            return state.mu + nonsense  # type: ignore[name-defined] # noqa: F821

    with pytest.raises(NameError, match="nonsense"):
        check_method(Mistaken(), body, start, compiled=False)


def test_iterates_that_grow_without_bound_are_no_convergence() -> None:
    """With infinite stages no change was small beside them, and a step once led to momenta of 1e253."""
    body, start = systems()["free body"]
    for h in (1.7720865943621886, 3.0):
        with pytest.raises(lm.errors.NoConvergence):
            lm.integrate(body, lm.Isospectral(order=2), start, h=h, steps=1, compiled=False, compensated=False)
