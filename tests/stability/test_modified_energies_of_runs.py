"""Modified energies from samples: constant up to the order of their differences, equal to H up to the order of the method."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import pytest
from scenes import Pendulum

import liemech as lm


@lm.record
class Oscillator(lm.SeparableSystem):
    degrees: ClassVar[int] = 1

    def kinetic(self, p: Any) -> Any:
        return lm.dot(p, p) / 2.0

    def potential(self, q: Any) -> Any:
        return 2.0 * q[0] ** 2


TOP = lm.models.HeavyTop([1.0, 1.6, 2.3], 1.2, [0.3, 0.1, 0.8])
BODY = lm.RigidBody([1.0, 1.5, 2.0])
BRICK = lm.MechanicalSystem(
    lm.LiePoissonSystem(lm.SE3(), lm.KineticEnergy([1.0, 1.6, 2.3, 2.0, 2.0, 2.0])),
    lm.models.UniformGravity(3.0, [0.9, 0, 0]),
)
CASES = {
    "Verlet": (Pendulum(), lm.StormerVerlet(), Pendulum().state([1.0], [0.3]), 0.2),
    "splitting": (Pendulum(), lm.Splitting(order=4), Pendulum().state([1.0], [0.3]), 0.2),
    "free body": (BODY, lm.CovariantVariational(lm.Cayley()), BODY.state([0.5, 0.3, 1.1], np.eye(3)), 0.2),
    "top": (TOP, lm.LieVerlet(), TOP.state([0.3, -0.5, 0.4], lm.SO3().exp([0.4, 0.2, 0.1])), 0.1),
    "top, Cayley": (TOP, lm.LieVerlet(lm.Cayley()), TOP.state([0.3, -0.5, 0.4], lm.SO3().exp([0.4, 0.2, 0.1])), 0.1),
    "kick and drift": (TOP, lm.KickDrift(), TOP.state([0.3, -0.5, 0.4], lm.SO3().exp([0.4, 0.2, 0.1])), 0.1),
    "brick": (BRICK, lm.LieVerlet(), BRICK.state([0.3, -0.5, 0.4, 0.8, 0.2, -0.3], np.eye(4)), 0.1),
}


def steps_of(case: str, h: float, t_end: float = 6.0) -> Any:
    """A run of a case."""
    system, method, start, _ = CASES[case]
    return lm.integrate(system, method, start, h=h, steps=round(t_end / h))


@pytest.mark.slow
@pytest.mark.parametrize("nodes", [3, 6])  # written out as one body, and by sites
def test_that_of_a_field_is_constant_up_to_its_order(nodes: int) -> None:
    density = lm.FieldDensity(lm.KineticEnergy([1.0, 2.0, 1.5]), lm.KineticEnergy([1.0, 1.0, 2.0]))
    field = lm.Field(lm.SO3(), density, 0.5 * nodes, nodes - 1, ends=("held", "free"))
    k = np.arange(3 * nodes).reshape(nodes, 3)
    g = np.asarray(lm.SO3().exp(0.2 * np.cos(k)))
    start, spreads = field.state(xi=0.3 * np.sin(k) * (k > 2), g=g), []
    for steps in (24, 48):
        run = lm.integrate(field, lm.KickDrift(), start, h=1.2 / steps, steps=steps, compiled=False, progress=False)
        found = lm.modified_energy(run)
        spreads.append(np.ptp(found.values[found.t < 0.6]))
        assert found.verdict == "fluctuates"
    assert np.log2(spreads[0] / spreads[1]) > 6.5


@pytest.mark.parametrize(
    ("case", "order"),
    [*((case, order) for case in CASES for order in (6, 8)), ("Verlet", 4), ("Verlet", 10), ("top", 4), ("top", 10)],
)
def test_it_is_constant_up_to_the_order_of_its_differences(case: str, order: int) -> None:
    h = CASES[case][-1]
    spreads = [np.ptp(lm.modified_energy(steps_of(case, step), order).values) for step in (h, 0.5 * h)]
    assert np.log2(spreads[0] / spreads[1]) == pytest.approx(order, abs=0.7)


@pytest.mark.parametrize("case", ["Verlet", "free body", "top", "brick"])
def test_it_tells_that_the_energy_fluctuates(case: str) -> None:
    """Of a method of order 2 the energy is 4 times nearer with half the step, the modified one 256 times."""
    found = lm.modified_energy(steps_of(case, 0.5 * CASES[case][-1]))
    assert found.verdict == "fluctuates" and "the energy fluctuates" in repr(found)
    assert np.mean(found.values) == pytest.approx(np.mean(found.energy), rel=0.05)


def test_of_an_oscillator_it_is_that_of_the_closed_form() -> None:
    """Verlet turns by sin(r h/2) = w h/2 in the plane of p/s and w q, s^2 = 1 - (w h/2)^2: H~ = r/w (p^2/s + s w^2 q^2)/2."""
    system, h, w = Oscillator(), 0.3, 2.0
    s, rate = np.sqrt(1.0 - (h * w / 2.0) ** 2), 2.0 * np.arcsin(h * w / 2.0) / h
    run = lm.integrate(system, lm.StormerVerlet(), system.state([1.0], [0.2]), h=h, steps=60)
    closed = 0.5 * rate / w * (run.p[:, 0] ** 2 / s + s * w * w * run.q[:, 0] ** 2)
    found = lm.modified_energy(run, 12)
    assert np.ptp(closed) < 1e-13 and np.ptp(found.values) < 1e-13 < 1e-2 < np.ptp(found.energy)
    assert found.values == pytest.approx(closed[6:-6], rel=1e-6)


def test_an_energy_that_drifts_is_not_called_a_fluctuation() -> None:
    """Steps in resonance, on which nothing is conserved: the splitting loses its orbit."""
    run = lm.integrate(Pendulum(), lm.StormerVerlet(), Pendulum().state([0.1], [2.1]), h=1.9, steps=200)
    assert lm.modified_energy(run).verdict == "undecided"


@lm.record
class Longer(lm.StormerVerlet):
    """Steps that are longer than they say, of which the action is not that of h."""

    def step(self, system: Any, t: float, memory: Any, h: float) -> Any:
        return super().step(system, t, memory, 1.01 * h)


def test_what_has_no_modified_energy_is_refused() -> None:
    run = lm.integrate(TOP, lm.RKMK(order=4), CASES["top"][2], h=0.1, steps=20)
    with pytest.raises(lm.errors.IncompatibleSystem, match="the action of the steps of RKMK"):
        lm.modified_energy(run)
    longer = lm.integrate(Pendulum(), Longer(), Pendulum().state([0.1], [1.5]), h=0.3, steps=300, compiled=False)
    with pytest.raises(lm.errors.IncompatibleSystem, match="the action of the steps of Longer"):
        lm.modified_energy(longer)
    run = steps_of("Verlet", 0.2)
    for order in (2, 7):
        with pytest.raises(lm.errors.InvalidInput, match="order is even and above"):
            lm.modified_energy(run, order)
    with pytest.raises(lm.errors.InvalidInput, match="more than 8 steps"):
        lm.modified_energy(steps_of("Verlet", 0.2, 1.2))
    system, method, start, h = CASES["Verlet"]
    half: Any = lambda t, state: t - 39.5 * h  # noqa: E731
    half.terminal = True
    for options in ({"every": 2}, {"t_eval": np.linspace(0.0, 30.0 * h, 41)}, {"breaks": [12.3 * h]}, {"events": half}):
        cut: Any = lm.integrate(system, method, start, h=h, steps=40, compiled=False, **options)
        with pytest.raises(lm.errors.InvalidInput, match="every=1, none cut"):
            lm.modified_energy(cut)
