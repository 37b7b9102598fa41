"""Splitting on the constraints of an energy of any parts that stay on M: order, structure, what it
is equal to, what is refused.
"""

from __future__ import annotations

import itertools
from typing import Any, ClassVar

import numpy as np
import pytest
from constrained_scenes import PENDULUM, SPHERE, SWINGING, plain

import liemech as lm
from liemech.errors import IncompatibleSystem, InvalidInput, InvalidType, LawViolation
from liemech.formulas import cos, sin

GREAT_CIRCLES = lm.SphericalPendulum(gravity=0.0)


@lm.record
class Free(lm.ConstrainedPart):
    """Motion along great circles of the unit sphere."""

    def energy(self, q: lm.Vec, p: lm.Vec) -> float:
        return 0.5 * lm.dot(p, p)

    def flow(self, system: Any, q: lm.Vec, p: lm.Vec, t: float) -> tuple[lm.Vec, lm.Vec]:
        return GREAT_CIRCLES.geodesic(q, p, t)


@lm.record
class Weight(lm.ConstrainedPart):
    """A potential: its motion is not written."""

    gravity: float
    tilt: float = 0.0

    def energy(self, q: lm.Vec, p: lm.Vec) -> float:
        return self.gravity * q[2] + self.tilt * q[0] * q[1]


def turned(x: lm.Vec, angle: Any) -> lm.Vec:
    c, s = cos(angle), sin(angle)
    return lm.vec(c * x[0] - s * x[1], s * x[0] + c * x[1], x[2])


@lm.record
class Frame(lm.ConstrainedPart):
    """-rate L_3: what a turning frame adds."""

    rate: float

    def energy(self, q: lm.Vec, p: lm.Vec) -> float:
        return -self.rate * (q[0] * p[1] - q[1] * p[0])

    def flow(self, system: Any, q: lm.Vec, p: lm.Vec, t: float) -> tuple[lm.Vec, lm.Vec]:
        return turned(q, -self.rate * t), turned(p, -self.rate * t)


@lm.record
class Flattened(lm.ConstrainedPart):
    """a L_3^2/2: of second degree in q and in p."""

    a: float

    def energy(self, q: lm.Vec, p: lm.Vec) -> float:
        return 0.5 * self.a * (q[0] * p[1] - q[1] * p[0]) ** 2

    def flow(self, system: Any, q: lm.Vec, p: lm.Vec, t: float) -> tuple[lm.Vec, lm.Vec]:
        angle = t * self.a * (q[0] * p[1] - q[1] * p[0])
        return turned(q, angle), turned(p, angle)


@lm.record
class Ball(lm.SplitConstrainedSystem):
    """A point of the unit sphere."""

    degrees: ClassVar[int] = 3

    def constraint(self, q: lm.Vec) -> lm.Vec:
        return lm.vec(0.5 * (lm.dot(q, q) - 1.0))


@lm.record
class Quadratic(Ball):
    """The same for T and V."""

    quadratic: ClassVar[bool] = True


G = SPHERE["g"]
FOUCAULT = Ball((Free(), Frame(0.7), Weight(G)))
GENERAL = Ball((Flattened(0.5), Free(), Weight(G, tilt=0.8)))
HANGING = GENERAL.consistent([0.6, 0.0, -0.8], [0.4, 1.5, 0.3])


def test_the_energy_is_the_sum_and_the_parts_sum_to_the_motion() -> None:
    """(1.15) for each part, added, is (1.8) with the multipliers of the whole."""
    q, p = HANGING.q, HANGING.p
    assert GENERAL.energy(q, p) == sum(part.energy(q, p) for part in GENERAL.parts)
    rates = sum(np.array(GENERAL.rate_of_part(k, q, p)) for k in range(3))
    assert rates == pytest.approx(np.array(GENERAL.rate(0.0, HANGING)), rel=1e-14)
    assert lm.check_system(GENERAL)["motions of parts"].verdict == "holds"


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, 2, 3, 4, 6])
def test_order(order: int) -> None:
    method = lm.Splitting(order=order, quadratic=False)
    exact = plain(GENERAL, lm.RKMK(order=8), HANGING, 1 / 128, 32)
    errors = []
    for n in (4, 8, 16) if order < 4 else (2, 4):
        run = plain(GENERAL, method, HANGING, 0.25 / n, n)
        errors.append((np.log2(n), np.log2(np.abs(run.q[-1] - exact.q[-1]).max())))
    slopes = [(b[1] - a[1]) / (a[0] - b[0]) for a, b in itertools.pairwise(errors)]
    assert slopes[-1] == pytest.approx(order, abs=0.3)


@pytest.mark.slow
@pytest.mark.parametrize("system", [FOUCAULT, GENERAL], ids=["frame", "general"])
def test_steps_are_symplectic_on_m_and_stay_there(system: Ball) -> None:
    start = system.consistent([0.6, 0.0, -0.8], [0.4, 1.5, 0.3])
    report = lm.check_method(lm.Splitting(order=2), system, start, h=0.2)
    for law in ("symplectic", "symmetric", "order", "constraint", "hidden constraint"):
        assert report[law].verdict == "holds"


def test_in_a_turning_frame_it_is_the_motion_at_rest_turned_back() -> None:
    resting = plain(PENDULUM, lm.GeodesicSplitting(order=8), SWINGING, 0.05, 10)
    start = FOUCAULT.state(SWINGING.q, SWINGING.p)
    turning = plain(FOUCAULT, lm.Splitting(order=6, quadratic=False), start, 0.05, 10)
    c, s = np.cos(-0.7 * 0.5), np.sin(-0.7 * 0.5)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    assert np.abs(turning.q[-1] - resting.q[-1]).max() > 0.1
    assert np.abs(turning.q[-1] - R @ resting.q[-1]).max() < 1e-8
    assert np.abs(turning.p[-1] - R @ resting.p[-1]).max() < 1e-7


@pytest.mark.parametrize("order", [2, 4, 6])
def test_two_parts_of_second_degree_are_the_geodesic_splitting(order: int) -> None:
    system = Quadratic((Free(), Weight(G)))
    ours = plain(system, lm.Splitting(order=order), SWINGING, 0.1, 10)
    theirs = plain(PENDULUM, lm.GeodesicSplitting(order=order), SWINGING, 0.1, 10)
    assert np.abs(ours.q - theirs.q).max() < 1e-13
    assert np.abs(ours.p - theirs.p).max() < 1e-12


@pytest.mark.slow
@pytest.mark.compiled
def test_long_runs_keep_the_constraints_and_the_energy() -> None:
    run = lm.integrate(
        GENERAL, lm.Splitting(order=2), HANGING, h=0.02, steps=20_000, every=20, compiled=True, progress=False
    )
    assert run.drift()["energy"].verdict == "bounded"
    assert np.asarray(GENERAL.defects(run.q, run.p)).max() < 1e-13


# ---------------------------------------------------------------- what is refused


@lm.record
class Vertical(lm.ConstrainedPart):
    """p_3^2/2: it moves across the sphere."""

    def energy(self, q: lm.Vec, p: lm.Vec) -> float:
        return 0.5 * p[2] ** 2

    def flow(self, system: Any, q: lm.Vec, p: lm.Vec, t: float) -> tuple[lm.Vec, lm.Vec]:
        return q + lm.vec(0.0, 0.0, t * p[2]), p


@lm.record
class Unwritten(lm.ConstrainedPart):
    """A kinetic energy whose motion is not written."""

    def energy(self, q: lm.Vec, p: lm.Vec) -> float:
        return 0.5 * lm.dot(p, p)


@lm.record
class Walled(lm.ConstrainedPart):
    """A potential with a wall."""

    def energy(self, q: lm.Vec, p: lm.Vec) -> float:
        return q[2] if q[2] > 0.5 else 0.5 * q[2]


@lm.record
class Backwards(Free):
    """Great circles the wrong way."""

    def flow(self, system: Any, q: lm.Vec, p: lm.Vec, t: float) -> tuple[lm.Vec, lm.Vec]:
        return GREAT_CIRCLES.geodesic(q, p, -t)


def test_parts_that_leave_m_are_refused() -> None:
    """At the start by `state`, everywhere by `check_system`."""
    system = Ball((Vertical(), Free(), Weight(G)))
    with pytest.raises(InvalidInput, match=r"moved off the constraints by Vertical\(\) alone"):
        system.consistent([0.6, 0.0, -0.8], [0.4, 1.5, 0.3])
    report = lm.check_system(system, raises=False)
    assert report["parts stay on M"].verdict == "broken"


def test_a_motion_that_is_not_that_of_its_part_is_found() -> None:
    with pytest.raises(LawViolation, match="motions of parts"):
        lm.check_system(Ball((Backwards(), Weight(G))))


def test_motions_that_are_not_known_are_refused() -> None:
    for part, why in (
        (Unwritten(), "depends on p, and its motion on the constraints is not written"),
        (Walled(), "need not be the same at all points"),
    ):
        with pytest.raises(IncompatibleSystem, match=why):
            lm.Splitting(order=2).require(Ball((part, Weight(G))))
    with pytest.raises(IncompatibleSystem, match="quadratic=False"):
        lm.Splitting(tableau=lm.tableaus.SPLITTINGS["Blanes-Moan 6"]).require(GENERAL)


def test_flows_that_are_none_are_refused_by_the_state() -> None:
    @lm.record
    class Alone(Free):
        def flow(self, q: lm.Vec, p: lm.Vec, t: float) -> Any:  # type: ignore[override]
            return q, p

    @lm.record
    class Half(Free):
        def flow(self, system: Any, q: lm.Vec, p: lm.Vec, t: float) -> Any:
            return q

    with pytest.raises(InvalidType, match=r"write `def flow\(self, system, q, p, t\)`"):
        Ball((Alone(), Weight(G))).state(SWINGING.q, SWINGING.p)
    with pytest.raises(InvalidInput, match="two vectors of 3 numbers"):
        Ball((Half(), Weight(G))).state(SWINGING.q, SWINGING.p)


def test_parts_must_be_parts() -> None:
    with pytest.raises(InvalidType, match="must be ConstrainedParts"):
        Ball((Free(), lm.KineticEnergy([1.0, 1.0, 1.0])))  # type: ignore[arg-type]
    with pytest.raises(InvalidType, match="a tuple of ConstrainedParts"):
        Ball(())
    with pytest.raises(InvalidInput, match="the parts are two"):
        Quadratic((Free(), Weight(G), Weight(1.0)))


def test_rattle_needs_no_motion_of_a_part() -> None:
    system = Ball((Unwritten(), Weight(G)))
    ours = plain(system, lm.RATTLE(), SWINGING, 0.05, 4)
    theirs = plain(PENDULUM, lm.RATTLE(), SWINGING, 0.05, 4)
    assert np.abs(ours.q - theirs.q).max() < 1e-14
