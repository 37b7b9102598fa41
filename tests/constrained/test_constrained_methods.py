"""Methods on the constraints: orders of positions, momenta and multipliers, symmetry, two-form,
constraints in long runs.
"""

from __future__ import annotations

import functools
from typing import Any, ClassVar

import numpy as np
import pytest
from constrained_scenes import (
    CHAIN,
    DOUBLE,
    HANGING,
    MASSES,
    MOVING,
    PENDULUM,
    SPHERE,
    STRETCHING,
    SWINGING,
    end_of,
    plain,
    stepped,
    two_form_defect,
)
from scenes import same_bits, slow

import liemech as lm
from liemech.formulas import vec

EULERS = lm.ConstrainedEuler(), lm.ConstrainedEuler(first="drift")
PAIRS = tuple(lm.LobattoPair(order=p) for p in (2, 4, 6, 8))
GEODESIC = tuple(lm.GeodesicSplitting(order=p) for p in (2, 4, 6, 8))
COMPOSED = tuple(lm.Composition(lm.RATTLE(), order=p) for p in (4, 6, 8))
GENERAL = (lm.RATTLE(), *EULERS, *PAIRS, *COMPOSED)
EPS = float(np.finfo(float).eps)
COUNTS = {1: 40, 2: 12, 4: 8, 6: 8, 8: 4}
"""Steps over a unit of time at which errors are halved for the first time."""

SCENES: dict[str, Any] = {"sphere": (PENDULUM, SWINGING), "chain": (CHAIN, HANGING), "stretching": (STRETCHING, MOVING)}


@functools.cache
def exact(scene: str) -> np.ndarray:
    """Positions and momenta at t = 1/2: from the files; of the third system by the reduced equation."""
    if scene == "sphere":
        sample = next(s for s in SPHERE["samples"] if s["t"] == 0.5)
        return np.array([*sample["q"], *sample["v"]])
    if scene == "chain":
        sample = next(s for s in DOUBLE["samples"] if s["t"] == 0.5)
        return np.array([*sample["q"], *(MASSES * sample["v"])])
    return end_of(plain(STRETCHING, lm.RKMK(order=8), MOVING, 0.025, 20))


def orders(method: lm.Method, scene: str, finer: int = 1) -> list[float]:
    """The slopes of positions, momenta and multipliers at t = 1/2."""
    system, start = SCENES[scene]
    n, there = system.degrees, exact(scene)
    wanted = np.array(system.multipliers(there[:n], there[n:]))
    errors = []
    for steps in (finer * COUNTS[method.order], 2 * finer * COUNTS[method.order]):
        run = plain(system, method, start, 0.5 / steps, steps)
        lam = np.array(system.multipliers(run.q[-1], run.p[-1]))
        errors.append([np.abs(x).max() for x in (run.q[-1] - there[:n], run.p[-1] - there[n:], lam - wanted)])
    return [float(x) for x in np.log2(np.divide(errors[0], errors[1]))]


CASES = (
    *((method, "sphere") for method in GENERAL),
    *(slow(method, scene) for scene in ("chain", "stretching") for method in GENERAL if method.order < 8),
)


@pytest.mark.parametrize(("method", "scene"), CASES)
def test_order_of_positions_momenta_and_multipliers(method: lm.Method, scene: str) -> None:
    finer = 2 if scene != "sphere" and method.order > 4 else 1
    assert orders(method, scene, finer) == pytest.approx([method.order] * 3, abs=0.6 if method.order > 4 else 0.35)


@pytest.mark.slow
@pytest.mark.parametrize("scene", ["chain", "stretching"])
@pytest.mark.parametrize("method", [lm.RATTLE(), PAIRS[1]], ids=repr)
def test_order_with_two_constraints_and_with_energies_that_do_not_separate(method: lm.Method, scene: str) -> None:
    assert orders(method, scene) == pytest.approx([method.order] * 3, abs=0.35)


@pytest.mark.parametrize("method", GEODESIC, ids=repr)
def test_splittings_have_their_order_on_a_sphere(method: lm.Method) -> None:
    assert orders(method, "sphere", 2 if method.order == 4 else 1) == pytest.approx([method.order] * 3, abs=0.35)


def test_reference_of_the_multipliers() -> None:
    """The tension of the rod: its weight along the rod and what turns the mass, m (v^2/l - g q_3/l)."""
    lam = PENDULUM.multipliers(SWINGING.q, SWINGING.p)
    assert lam[0] == pytest.approx(SPHERE["g"] * 0.8 + 0.4**2 + 1.5**2 + 0.3**2, rel=1e-15)
    assert np.array(PENDULUM.constraint_force(SWINGING.q, SWINGING.p)) == pytest.approx(
        -lam[0] * np.array(SPHERE["q0"])
    )


# ---------------------------------------------------------------- structure


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("method", [lm.RATTLE(), PAIRS[1], COMPOSED[0]], ids=repr)
def test_symmetric_methods_undo_their_steps(method: lm.Method, scene: str) -> None:
    system, start = SCENES[scene]
    y = vec(*start.q, *start.p)
    back = stepped(method, system, -0.1, stepped(method, system, 0.1, y))
    assert np.abs(np.subtract(tuple(back), tuple(y))).max() < 2e-15
    there = stepped(EULERS[0], system, 0.1, y)
    assert np.abs(np.subtract(tuple(stepped(EULERS[0], system, -0.1, there)), tuple(y))).max() > 1e-3


@pytest.mark.parametrize("scene", SCENES)
def test_the_euler_methods_undo_each_other(scene: str) -> None:
    system, start = SCENES[scene]
    y = vec(*start.q, *start.p)
    back = stepped(EULERS[1], system, -0.1, stepped(EULERS[0], system, 0.1, y))
    assert np.abs(np.subtract(tuple(back), tuple(y))).max() < 2e-15


@pytest.mark.sample(6)
@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("method", [lm.RATTLE(), *EULERS, PAIRS[1], slow(PAIRS[2]), slow(COMPOSED[1])], ids=repr)
def test_steps_keep_the_two_form_on_the_manifold(method: lm.Method, scene: str) -> None:
    system, start = SCENES[scene]
    assert two_form_defect(method, system, start, 0.05) < 1e-13


@pytest.mark.parametrize("method", GEODESIC[:3], ids=repr)
def test_splittings_keep_the_two_form_on_the_sphere(method: lm.Method) -> None:
    assert two_form_defect(method, PENDULUM, SWINGING, 0.1) < 1e-13


def test_index_reduction_does_not() -> None:
    for project in (False, True):
        method = lm.IndexReduction(lm.RKMK(order=4), project=project)
        assert two_form_defect(method, PENDULUM, SWINGING, 0.1) > 1e-6


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("scene", SCENES)
def test_constraints_hold_and_energies_do_not_drift_in_a_hundred_thousand_steps(scene: str) -> None:
    system, start = SCENES[scene]
    run = lm.integrate(system, lm.RATTLE(), start, h=0.01, steps=100_000, every=20, compiled=True, progress=False)
    position, hidden = np.split(np.asarray(system.defects(run.q, run.p)), 2, axis=1)
    assert position.max() <= 4.0 * EPS
    assert hidden.max() <= 16.0 * EPS  # beside speeds, which are sometimes small
    drift = run.drift()
    assert drift["energy"].verdict == "bounded"
    assert drift["energy"].largest < 2e-3
    if scene == "sphere":
        assert drift["vertical momentum"].largest < 1e-13


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("method", [PAIRS[1], GEODESIC[2]], ids=repr)
def test_constraints_hold_in_other_methods(method: lm.Method) -> None:
    run = lm.integrate(PENDULUM, method, SWINGING, h=0.05, steps=20_000, every=20, compiled=True, progress=False)
    assert np.asarray(PENDULUM.defects(run.q, run.p)).max() <= 4.0 * EPS
    assert run.drift()["energy"].verdict in ("bounded", "exact")


@pytest.mark.compiled
@pytest.mark.slow
def test_energies_walk_but_do_not_drift_in_ten_million_steps() -> None:
    """The same phase of the oscillation is not met again, so the largest deviation of each tenth is looked at."""
    run = lm.integrate(
        PENDULUM, lm.RATTLE(), SWINGING, h=0.01, steps=10_000_000, every=500, compiled=True, progress=False
    )
    errors = np.abs(run.energy - run.energy[0])[1:].reshape(10, -1).max(axis=1)
    assert np.ptp(errors) < 0.05 * errors.mean()
    assert np.asarray(PENDULUM.defects(run.q, run.p)).max() <= 4.0 * EPS


@pytest.mark.parametrize("method", [lm.RATTLE(), PAIRS[1], GEODESIC[1]], ids=repr)
def test_units_do_not_matter(method: lm.Method) -> None:
    """Powers of two as units of length, mass and time: the same bits, down to a molecule's size."""
    length, mass, time = 2.0**-90, 2.0**-100, 2.0**-40
    small = lm.SphericalPendulum(mass, length, SPHERE["g"] * length / time**2)
    speed = mass * length / time
    start = small.state(length * np.array(SPHERE["q0"]), speed * np.array(SPHERE["v0"]))
    a = plain(PENDULUM, method, SWINGING, 0.0625, 10)
    b = plain(small, method, start, 0.0625 * time, 10)
    assert same_bits(a.q * length, b.q)
    assert same_bits(a.p * speed, b.p)


@lm.record
class Distant(lm.SeparableConstrainedSystem):
    """The pendulum hung up far away from the origin."""

    degrees: ClassVar[int] = 3
    x: float

    def kinetic(self, p: lm.Vec) -> float:
        return 0.5 * lm.dot(p, p)

    def potential(self, q: lm.Vec) -> float:
        return SPHERE["g"] * q[2]  # type: ignore[no-any-return]

    def constraint(self, q: lm.Vec) -> lm.Vec:
        r = q - vec(self.x, 0.0, 0.0)
        return vec(0.5 * (lm.dot(r, r) - 1.0))


@pytest.mark.parametrize("x", [1e3, 1e6, 1e9])
def test_the_origin_does_not_matter(x: float) -> None:
    """Positions are rounded to eps x, and so are the constraints; nothing else is lost."""
    far = Distant(x)
    start = far.consistent(np.array(SPHERE["q0"]) + [x, 0.0, 0.0], SPHERE["v0"])
    a, b = (plain(PENDULUM, lm.RATTLE(), SWINGING, 0.05, 20), plain(far, lm.RATTLE(), start, 0.05, 20))
    assert np.abs(b.q - [x, 0.0, 0.0] - a.q).max() < 200.0 * EPS * x


@pytest.mark.parametrize("method", [lm.RATTLE(), *PAIRS[1:3]], ids=repr)
def test_short_steps_from_rest(method: lm.Method) -> None:
    """Momenta begin at zero: nothing but positions tells what is small."""
    start = CHAIN.state(CHAIN.hanging(vec(0.8, -0.6, 0.8, -0.6)), np.zeros(4))
    for h in (1e-2, 1e-4, 1e-6):
        run = plain(CHAIN, method, start, h, 2)
        fall = np.array(CHAIN.rate(0.0, start))[4:]
        assert np.abs(run.p[-1] - 2.0 * h * fall).max() < 300.0 * h**3 + 1e-9 * h


def test_states_at_turning_points_are_consistent() -> None:
    """Where a swing turns the speed is no more than rounding of itself: any sample can be started from."""
    start = PENDULUM.state([np.sin(0.3), 0.0, -np.cos(0.3)], [0.0, 0.0, 0.0])
    run = plain(PENDULUM, lm.RATTLE(), start, 0.01, 110)
    assert PENDULUM.state(run.q, run.p).bodies == 111


# ---------------------------------------------------------------- index reduction, to compare with


def test_index_reduction_is_the_reduced_equation() -> None:
    a, b = (plain(PENDULUM, m, SWINGING, 0.05, 20) for m in (lm.IndexReduction(lm.RKMK(order=4)), lm.RKMK(order=4)))
    assert same_bits(a.q, b.q)


def test_index_reduction_leaves_the_manifold_and_projection_does_not() -> None:
    """g and G H_p change as the error of the method: order 4 in h, and they grow along the way."""
    ends = []
    for h in (0.05, 0.025):
        run = plain(PENDULUM, lm.IndexReduction(lm.RKMK(order=4)), SWINGING, h, round(2 / h))
        ends.append(np.abs(np.asarray(PENDULUM.constraint(run.q))).max())
    assert np.log2(ends[0] / ends[1]) == pytest.approx(4.0, abs=0.7)
    assert np.array_equal(run.last.q, run.q[-1])  # beside M, and no start
    with pytest.raises(lm.errors.InvalidInput, match="not consistent"):
        plain(PENDULUM, lm.RATTLE(), run.last, 0.1, 1)
    run = plain(PENDULUM, lm.IndexReduction(lm.RKMK(order=4), project=True), SWINGING, 0.05, 40)
    assert np.asarray(PENDULUM.defects(run.q, run.p)).max() <= 4.0 * EPS


@pytest.mark.slow
@pytest.mark.compiled
def test_only_rattle_keeps_the_energy_for_a_long_time() -> None:
    drifts = {}
    for method in (lm.RATTLE(), lm.IndexReduction(lm.RKMK(order=4)), lm.IndexReduction(lm.RKMK(order=4), project=True)):
        run = lm.integrate(PENDULUM, method, SWINGING, h=0.02, steps=20_000, every=10, compiled=True, progress=False)
        drifts[method] = run.drift()["energy"].verdict
    assert list(drifts.values()) == ["bounded", "drifting", "drifting"]
