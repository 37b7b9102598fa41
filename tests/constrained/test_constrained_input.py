"""Bad input and bad dynamics: starts off the constraints, dependent constraints, dead points, steps too large, kinks."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import pytest
from constrained_scenes import CHAIN, PENDULUM, SWINGING, plain

import liemech as lm
from liemech import errors
from liemech.errors import IncompatibleSystem, InconsistentState, InvalidInput, InvalidType, NoConvergence
from liemech.formulas import record, vec


@record
class Holding(lm.SeparableConstrainedSystem):
    """A particle in space under gravity, with constraints to be written."""

    degrees: ClassVar[int] = 3

    def kinetic(self, p: lm.Vec) -> float:
        return 0.5 * lm.dot(p, p)

    def potential(self, q: lm.Vec) -> float:
        return 9.81 * q[2]


# ---------------------------------------------------------------- starts


def test_a_start_off_the_constraints_is_told_by_how_much() -> None:
    with pytest.raises(InvalidInput, match=r"g\(q\)\[0\] = 0\.05.*consistent\(q, p\)"):
        PENDULUM.state([0.6, 0.0, -np.sqrt(1.1 - 0.36)], [0.0, 1.0, 0.0])
    with pytest.raises(InvalidInput, match=r"G H_p\[0\] = 0\.18"):
        PENDULUM.state([0.6, 0.0, -0.8], [0.3, 1.0, 0.0])
    good, bad = [0.6, 0.0, -0.8], [0.6, 0.1, -0.8]
    with pytest.raises(InvalidInput, match="of member 2 is not consistent"):
        PENDULUM.state([good, good, bad], [0.0, 0.0, 0.0])


def test_rounding_is_no_inconsistency() -> None:
    """Angles in sines and cosines, and momenta of about rounding at rest."""
    for a in np.linspace(0.0, 3.0, 13):
        PENDULUM.state([np.sin(a), 0.0, -np.cos(a)], [1e-17, 0.0, 2e-17])


def test_the_nearest_consistent_state() -> None:
    """On the sphere it is q/|q|, with the tangential part of p; on an ellipsoid the foot of the perpendicular."""
    q, p = np.array([0.7, 0.1, -0.9]), np.array([0.3, 1.0, 0.2])
    found, n = PENDULUM.consistent(q, p), q / np.linalg.norm(q)
    assert np.array(found.q) == pytest.approx(n, abs=1e-15)
    assert np.array(found.p) == pytest.approx(p - (p @ n) * n, abs=1e-15)
    egg = lm.models.ParticleOnEllipsoid([1.0, 1.5, 2.0])
    foot = np.array(egg.consistent([0.9, 1.0, 1.2], p).q)
    normal = foot / np.array([1.0, 1.5, 2.0]) ** 2
    assert np.linalg.norm(np.cross(foot - [0.9, 1.0, 1.2], normal)) < 1e-14
    many = PENDULUM.consistent(np.stack([q, 2.0 * q]), p)
    assert np.asarray(many.q)[1] == pytest.approx(n, abs=1e-15)
    assert PENDULUM.consistent(SWINGING.q, SWINGING.p).q == SWINGING.q
    with pytest.raises(InvalidInput, match=r"consistent: .*derivative of constraint\[0\] is zero"):
        PENDULUM.consistent([0.0, 0.0, 0.0], p)


# ---------------------------------------------------------------- constraints


def test_dependent_constraints_are_named() -> None:
    @record
    class Twice(Holding):
        def constraint(self, q: lm.Vec) -> lm.Vec:
            return vec(q[0] + q[1], lm.dot(q, q) - 1.0, q[1] - q[2], q[0] + q[2])

    with pytest.raises(InvalidInput, match=r"rank 3 of 4|4 constraints on 3 coordinates"):
        Twice().state([0.0, 0.0, 1.0], [0.0, 0.0, 0.0])

    @record
    class Redundant(Holding):
        def constraint(self, q: lm.Vec) -> lm.Vec:
            return vec(lm.dot(q, q) - 1.0, q[0], 3.0 * q[0] + 0.5 * (lm.dot(q, q) - 1.0))

    with pytest.raises(
        InvalidInput, match=r"rank 2 of 3.*constraint\[2\] follows from those of constraint\[0\], constraint\[1\]"
    ):
        Redundant().state([0.0, 0.6, -0.8], [0.0, 0.0, 0.0])

    @record
    class Nothing(Holding):
        def constraint(self, q: lm.Vec) -> lm.Vec:
            return vec(0.0 * q[0])

    with pytest.raises(InvalidInput, match=r"derivative of constraint\[0\] is zero \(rank 0 of 1"):
        Nothing().state([0.0, 0.6, -0.8], [0.0, 0.0, 0.0])


def test_constraints_must_be_vectors_and_systems_have_them() -> None:
    @record
    class Number(Holding):
        def constraint(self, q: lm.Vec) -> Any:
            return lm.dot(q, q) - 1.0

    with pytest.raises(InvalidType, match="constraint must return a vector"):
        Number().state([0.0, 0.6, -0.8], [0.0, 0.0, 0.0])
    with pytest.raises(lm.errors.NotDefined, match="Holding must define `constraint`"):
        Holding().state([0.0, 0.6, -0.8], [0.0, 0.0, 0.0])
    with pytest.raises(InvalidInput, match="surface must be a Surface"):
        lm.Constrained(lm.Kepler(), lambda q: q)  # type: ignore[arg-type]


def test_parameters_of_the_models() -> None:
    for wrong in (
        lambda: lm.SphericalPendulum(length=0.0),
        lambda: lm.models.ChainPendulum([1.0, 1.0], [1.0]),
        lambda: lm.models.ChainPendulum(dimension=4),
        lambda: lm.models.FourBarLinkage(0),
        lambda: lm.models.ParticleOnEllipsoid([1.0, -1.0]),
        lambda: lm.models.OrthogonalBody([1.0, 1.0, 2.0]),
        lambda: lm.LobattoPair(order=5),
        lambda: lm.ConstrainedEuler(first="both"),
        lambda: lm.IndexReduction(lm.IndexReduction(lm.RKMK(order=4))),
    ):
        with pytest.raises(InvalidInput):
            wrong()
    with pytest.raises(InvalidType):
        lm.IndexReduction("RKMK")  # type: ignore[arg-type]


@pytest.mark.slow
def test_slips_in_written_formulas_are_found() -> None:
    @record
    class Halved(lm.SphericalPendulum):
        def constraint_jacobian(self, q: lm.Vec) -> lm.Mat:
            return 0.5 * super().constraint_jacobian(q)

    @record
    class Straight(lm.SphericalPendulum):
        def geodesic(self, q: lm.Vec, p: lm.Vec, t: float) -> tuple[lm.Vec, lm.Vec]:
            return q + (t / self.mass) * p, p

    @record
    class Fast(lm.models.ParticleOnEllipsoid):
        """Relativistic, so that its velocity is not linear, as it says."""

        linear_velocity: ClassVar[bool] = True

        def kinetic(self, p: lm.Vec) -> float:
            return lm.norm(vec(1.0, *p))  # type: ignore[no-any-return]

        def velocity(self, q: lm.Vec, p: lm.Vec) -> lm.Vec:
            return p / lm.norm(vec(1.0, *p))

    assert lm.check_system(PENDULUM)["geodesic"].verdict == "holds"
    for slipped, law in (
        (Halved(), "Jacobian of the constraints"),
        (Straight(), "geodesic"),
        (Fast(), "quadratic kinetic energy"),
    ):
        with pytest.raises(lm.errors.LawViolation, match=f"breaks the law of {law}"):
            lm.check_system(slipped)


# ---------------------------------------------------------------- methods and systems that do not go together


METHODS = lm.RATTLE(), lm.LobattoPair(), lm.GeodesicSplitting(), lm.IndexReduction(lm.RKMK(order=4))


@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_free_systems_have_other_methods(method: lm.Method) -> None:
    with pytest.raises(IncompatibleSystem, match="Constrained"):
        method.require(lm.Kepler())


def test_methods_for_free_systems_do_not_take_constrained_ones() -> None:
    for method in (lm.StormerVerlet(), lm.HamiltonJacobi(order=4), lm.CovariantVariational()):
        with pytest.raises(IncompatibleSystem):
            method.require(PENDULUM)
    with pytest.raises(IncompatibleSystem, match=r"geodesic\(q, p, t\)"):
        lm.GeodesicSplitting().require(CHAIN)


# ---------------------------------------------------------------- bad dynamics


@pytest.mark.slow
def test_a_step_too_large_is_refused_before_it_lands_on_another_branch() -> None:
    """A free particle on the sphere turns by asin(h v) a step, at most by a right angle: h v < 1."""
    free = lm.SphericalPendulum(gravity=0.0)
    start = free.state([1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    assert plain(free, lm.RATTLE(), start, 0.99, 1).q[1, 1] == pytest.approx(0.99, abs=1e-14)
    for h in (1.01, 1.5, 3.0, -1.2):
        with pytest.raises(NoConvergence, match=r"step h = .* is too large.*try"):
            plain(free, lm.RATTLE(), start, h, 3)
    for h in np.linspace(0.3, 4.0, 12):
        for method in (lm.RATTLE(), lm.LobattoPair(), lm.ConstrainedEuler()):
            try:
                run = plain(PENDULUM, method, SWINGING, float(h), 4)
            except lm.errors.IntegrationFailure as failure:
                run = failure.trajectory
            turns = np.sum(run.q[1:] * run.q[:-1], axis=1)
            assert (turns > 0.0).all(), f"{method!r}, h = {h}: a step of more than a right angle"


@pytest.mark.slow
def test_a_linkage_stops_at_its_dead_point() -> None:
    """All rods in one line: parallelogram and antiparallelogram meet there."""
    linkage = lm.models.FourBarLinkage()
    q, v = [0.0, 1.0, 1.0, 1.0], [1.0, 0.0, 1.0, 0.0]
    start = linkage.state(q, linkage.momentum(vec(*q), vec(*v)))
    with pytest.raises(InconsistentState, match=r"nearly dependent.*dead point") as stopped:
        plain(linkage, lm.RATTLE(), start, 0.01, 100)
    run = stopped.value.trajectory
    assert run.t[-1] == pytest.approx(0.70, abs=0.02)
    assert abs(run.q[-1, 1]) < 0.06
    with pytest.raises(InvalidInput, match=r"dependent \(rank 2 of 3"):
        linkage.state([1.0, 0.0, 2.0, 0.0], [0.0, 0.0, 0.0, 0.0])


def test_a_kink_is_refused_where_it_is_met() -> None:
    """A track with a corner: |x| + z = 0."""

    @record
    class Roof(Holding):
        def constraint(self, q: lm.Vec) -> lm.Vec:
            return vec(abs(q[0]) + q[2], q[1])

    roof = Roof()
    start = roof.state([-0.5, 0.0, -0.5], [3.0, 0.0, 3.0])
    with pytest.raises(lm.errors.IntegrationFailure) as stopped:
        plain(roof, lm.RATTLE(), start, 0.01, 100)
    assert stopped.value.trajectory.q[-1, 0] < 0.0


def test_the_reduced_equation_says_where_constraints_become_dependent() -> None:
    linkage = lm.models.FourBarLinkage()
    line = vec(1.0, 0.0, 2.0, 0.0)
    with pytest.raises(
        InconsistentState, match=r"constraint\[2\] follows from those of constraint\[0\], constraint\[1\]"
    ):
        linkage.multipliers(line, 0.0 * line)


@pytest.mark.slow
@pytest.mark.compiled
def test_one_member_of_an_ensemble_may_fail() -> None:
    """The one with too much speed stops, with the reason; others have the bits that they have alone."""
    free = lm.SphericalPendulum(gravity=0.0)
    q, p = np.tile([1.0, 0.0, 0.0], (5, 1)), np.outer([0.5, 0.8, 3.0, 0.9, 0.2], [0.0, 1.0, 0.0])
    with pytest.warns(RuntimeWarning, match="body 2 after 0 steps"):
        run = lm.integrate(free, lm.RATTLE(), free.state(q, p), h=1.0, steps=5, compiled=True, progress=False)
    assert isinstance(run.stopped[2].error, NoConvergence)
    alone = lm.integrate(free, lm.RATTLE(), free.state(q[3], p[3]), h=1.0, steps=5, compiled=False, progress=False)
    assert np.array_equal(run.q[:, 3], alone.q)


def test_a_start_is_that_of_its_own_system():
    """A point of one sphere is none of another: the same class and group say nothing about the length."""
    short, long = lm.SphericalPendulum(length=1.0), lm.SphericalPendulum(length=2.0)
    start = short.state([0.0, 0.6, -0.8], [1.0, 0.0, 0.0])
    with pytest.raises(errors.InvalidInput, match="not consistent"):
        lm.integrate(long, lm.RATTLE(), start, h=0.01, steps=2, compiled=False)
    same = lm.SphericalPendulum(length=1.0)
    assert lm.integrate(same, lm.RATTLE(), start, h=0.01, steps=2, compiled=False).steps == 2
    two = short.state([[0.0, 0.6, -0.8]] * 2, [[1.0, 0.0, 0.0]] * 2)
    with pytest.raises(errors.InvalidInput, match=r"body 1: .*not consistent"):
        lm.integrate([short, long], lm.RATTLE(), two, h=0.01, steps=2, compiled=False)
    assert lm.integrate([short, same], lm.RATTLE(), two, h=0.01, steps=2, compiled=False).bodies == 2
