"""Canonical systems and their models: Hamilton's equations, references of many digits, ordinary
methods as methods on R^2n.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

import liemech as lm
from liemech.errors import InvalidInput, InvalidType
from liemech.formulas import Vec, cos, record, sin
from liemech.models.planets.henon_heiles import HenonHeiles
from liemech.models.planets.kepler import Kepler
from liemech.models.swinging.pendulums import DoublePendulum, Pendulum
from liemech.systems.canonical import CanonicalState, HamiltonianSystem

REFERENCE = Path(__file__).parent.parent / "reference"
MODELS = (Pendulum(1.2, 0.8, 3.0), DoublePendulum([1.0, 0.5], [1.0, 0.8], 9.81), HenonHeiles(0.7), Kepler(2.0))
EACH = pytest.mark.parametrize("model", MODELS, ids=lambda model: type(model).__name__)


def reference(name: str) -> dict[str, Any]:
    """Numbers of a reference file."""

    def numbers(value: Any) -> Any:
        if isinstance(value, dict):
            return {k: numbers(v) for k, v in value.items()}
        if isinstance(value, list):
            return [numbers(v) for v in value]
        try:
            return float(value)
        except ValueError:
            return value

    return numbers(json.loads((REFERENCE / f"{name}.json").read_text()))


@record
class Oscillators(HamiltonianSystem):
    """As many coupled oscillators as one likes: an energy, and nothing else."""

    degrees: int  # type: ignore[misc]
    stiffness: float

    def energy(self, q: Vec, p: Vec) -> float:
        total = 0.5 * (p @ p) * (1.0 + 0.1 * sin(q[0]))
        for i in range(self.degrees - 1):
            total = total - self.stiffness * cos(q[i + 1] - q[i])
        return total


# ------------------------------------------------------------------ Hamilton's equations


@EACH
def test_velocity_and_force_are_the_derivatives_of_the_energy(
    model: HamiltonianSystem, rng: np.random.Generator
) -> None:
    q, p = rng.normal(size=(2, 5, model.degrees))

    def differences(f: Any, x: np.ndarray) -> np.ndarray:
        steps = 1e-3 * np.eye(model.degrees)
        one = np.stack([(f(x + e) - f(x - e)) / 2e-3 for e in steps], axis=-1)
        half = np.stack([(f(x + e / 2) - f(x - e / 2)) / 1e-3 for e in steps], axis=-1)
        return (4 * half - one) / 3

    scale = 1.0 + np.abs(model.force(q, p)).max()
    assert np.abs(model.velocity(q, p) - differences(lambda x: model.energy(q, x), p)).max() <= 1e-8 * scale
    assert np.abs(model.force(q, p) + differences(lambda x: model.energy(x, p), q)).max() <= 1e-8 * scale


@EACH
def test_derivatives_that_nobody_wrote_are_those_in_closed_form(
    model: HamiltonianSystem, rng: np.random.Generator
) -> None:
    q, p = map(Vec.of, rng.normal(size=(2, model.degrees)))
    for written, derived in (("velocity", HamiltonianSystem.velocity), ("force", HamiltonianSystem.force)):
        closed = np.array(getattr(model, written)(q, p))
        assert np.allclose(np.array(derived(model, q, p)), closed, rtol=1e-13, atol=1e-13)


def test_momentum_inverts_the_velocity(rng: np.random.Generator) -> None:
    for model in MODELS[:2]:
        q, v = rng.normal(size=(2, 6, model.degrees))
        assert np.allclose(model.velocity(q, model.momentum(q, v)), v, rtol=1e-13, atol=1e-14)


@pytest.mark.slow
def test_the_degrees_may_be_a_parameter(rng: np.random.Generator) -> None:
    system = Oscillators(5, 0.3)
    assert system.group.n == 10
    start = system.state(rng.normal(size=5), rng.normal(size=5))
    run = lm.integrate(system, lm.RKMK(order=8), start, h=0.05, steps=100)
    assert np.ptp(run.energy) <= 1e-11 * np.abs(run.energy).max()


# ------------------------------------------------------------------ references


def test_pendulum_against_elliptic_functions() -> None:
    data, system = reference("pendulum"), Pendulum(gravity=1.0)
    start = system.state(data["q0"], data["p0"])
    assert abs(system.energy(np.array(start.q), np.array(start.p)) - data["energy"]) <= 1e-15
    run = lm.integrate(system, lm.Taylor(16), start, h=0.1, steps=100)
    for sample in data["samples"][:5]:
        i = round(sample["t"] / 0.1)
        assert abs(run.q[i, 0] - sample["q"]) <= 1e-13 * (1.0 + sample["t"])
        assert abs(run.p[i, 0] - sample["p"]) <= 1e-13 * (1.0 + sample["t"])


@pytest.mark.slow
def test_double_pendulum_against_an_integration_with_constraints() -> None:
    data = reference("double_pendulum")
    system = DoublePendulum([data["m1"], data["m2"]], [data["l1"], data["l2"]], data["g"])
    q = np.array(data["angles0"])
    start = system.state(q, system.momentum(q, np.array(data["angular_velocities0"])))
    assert abs(system.energy(q, np.array(start.p)) - data["energy"]) <= 1e-14 * abs(data["energy"])
    run = lm.integrate(system, lm.Taylor(16), start, h=0.02, steps=50)
    for sample in data["samples"]:
        assert np.abs(run.q[round(sample["t"] / 0.02)] - sample["angles"]).max() <= 1e-13


def test_kepler_against_the_reference() -> None:
    system = Kepler()
    for case in reference("kepler")["cases"]:
        start, e = system.state(case["q0"], case["p0"]), case["e"]
        t = np.array([sample["t"] for sample in case["samples"]])
        exact = system.exact(start, t)
        tolerance = 1e-14 * (1.0 + t) / (1.0 - e) ** 2
        for values, name in ((exact.q, "q"), (exact.p, "p")):
            errors = np.abs(values - np.array([sample[name] for sample in case["samples"]])).max(axis=1)
            assert (errors <= tolerance).all()
        assert np.allclose(system.pericentre(e).p, start.p, rtol=1e-15, atol=0.0)
        assert abs(system.period(start) - case["period"]) <= 1e-12 * case["period"]


@pytest.mark.slow
def test_kepler_from_anywhere_on_the_orbit() -> None:
    """The exact motion against an integration, from a start that is no pericentre, clockwise, and backwards."""
    system = Kepler(2.5)
    start = system.state([1.1, 0.4], [0.3, -1.2])
    run = lm.integrate(system, lm.Taylor(20), start, h=-0.02, steps=500)
    exact = system.exact(start, run.t)
    assert np.abs(run.q - exact.q).max() <= 1e-12
    assert np.abs(run.p - exact.p).max() <= 1e-12
    kept = system.constants({"q": exact.q, "p": exact.p})
    assert set(kept) == {"energy", "angular momentum", "Runge-Lenz vector"}
    for values in kept.values():
        assert np.ptp(values, axis=0).max() <= 1e-13


def test_henon_heiles_has_three_exits_at_the_energy_one_sixth() -> None:
    system = HenonHeiles()
    saddle = np.array([[0.0, 1.0], [np.sqrt(0.75), -0.5], [-np.sqrt(0.75), -0.5]])
    assert np.allclose(system.energy(saddle, 0.0 * saddle), 1 / 6)
    assert np.allclose(system.force(saddle, 0.0 * saddle), 0.0)


# ------------------------------------------------------------------ ordinary methods


def test_runge_kutta_on_the_phase_space_is_the_ordinary_one() -> None:
    system, h = MODELS[1], 0.02
    start = system.state([0.9, -0.4], [0.5, 0.7])
    run = lm.integrate(system, lm.RKMK(order=4), start, h=h, steps=50)

    def f(y: np.ndarray) -> np.ndarray:
        return np.concatenate([system.velocity(y[:2], y[2:]), system.force(y[:2], y[2:])])

    y = np.array([*start.q, *start.p])
    for _ in range(50):
        k1 = f(y)
        k2 = f(y + h / 2 * k1)
        k3 = f(y + h / 2 * k2)
        k4 = f(y + h * k3)
        y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    assert np.abs(y - np.concatenate([run.q[-1], run.p[-1]])).max() <= 1e-14


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    "method",
    [lm.RKMK(order=8), lm.RKMK(order=4), lm.CommutatorFree(), lm.Taylor(), lm.CrouchGrossman()],
    ids=lambda m: m.name,
)
def test_methods_for_groups_serve_canonical_systems(method: lm.Method) -> None:
    system = Kepler()
    start = system.pericentre(0.3)
    errors = []
    for steps in 100, 200:
        run = lm.integrate(system, method, start, h=3.0 / steps, steps=steps, compiled=False)
        errors.append(np.abs(run.q[-1] - system.exact(start, 3.0).q).max())
    assert errors[1] <= 1e-13 or np.log2(errors[0] / errors[1]) >= method.order - 0.3


@pytest.mark.slow
def test_adaptive_steps_and_dense_output() -> None:
    system = Kepler()
    start = system.pericentre(0.7)
    run = lm.integrate(system, lm.Taylor(), start, t_end=20.0, rtol=1e-11, atol=1e-11)
    t = np.linspace(0.0, 20.0, 400)
    exact = system.exact(start, t)
    assert np.abs(run.at(t).q - exact.q).max() <= 1e-7
    assert run.drift()["angular momentum"].largest <= 1e-9


@pytest.mark.slow
def test_compensated_sums_keep_more() -> None:
    system = Kepler()
    start = system.pericentre(0.2)
    drift = [
        np.abs(
            lm.integrate(system, lm.RKMK(order=8), start, h=0.01, steps=20_000, every=50, compensated=c).energy + 0.5
        ).max()
        for c in (False, True)
    ]
    assert drift[1] < drift[0] <= 1e-12


# ------------------------------------------------------------------ border


def test_states(rng: np.random.Generator) -> None:
    pendulum, double = MODELS[:2]
    one = pendulum.state(1, 0.5)
    assert one == pendulum.state(q=[1.0], p=[0.5])
    assert isinstance(one, CanonicalState) and one.bodies is None
    many = double.state(q=rng.normal(size=(7, 2)), p=[0.1, 0.2])
    assert many.bodies == 7 and many.p.shape == (7, 2)
    assert pendulum.energy(np.zeros((3, 4, 1)), np.ones((4, 1))).shape == (3, 4)


def test_what_a_run_offers() -> None:
    system = Kepler()
    run = lm.integrate(system, lm.RKMK(order=8), system.pericentre(0.4), h=0.02, steps=100)
    assert run.q.shape == run.p.shape == (101, 2)
    assert np.allclose(run.energy, -0.5, atol=1e-10)
    again = lm.integrate(system, lm.RKMK(order=8), run.last, h=-0.02, steps=100)
    assert np.abs(again.q[-1] - run.q[0]).max() <= 1e-9


@pytest.mark.parametrize(
    ("q", "p", "text"),
    [
        ([1.0], [0.0, 0.0], "q has shape"),
        ([1.0, 2.0], 0.0, "p has shape"),
        (np.zeros((3, 2)), np.zeros((4, 2)), "3 positions and 4 momenta"),
        ([1.0, np.nan], [0.0, 0.0], "finite"),
        (np.zeros((0, 2)), np.zeros((0, 2)), "at least one"),
    ],
)
def test_bad_states(q: Any, p: Any, text: str) -> None:
    with pytest.raises(InvalidInput, match=text):
        MODELS[1].state(q, p)


def test_complex_states_are_refused() -> None:
    with pytest.raises(InvalidType, match="real"):
        MODELS[1].state([1.0, 2.0j], [0.0, 0.0])


@pytest.mark.parametrize(
    "make",
    [
        lambda: Pendulum(mass=0.0),
        lambda: Pendulum(length=-1.0),
        lambda: DoublePendulum([1.0, 2.0, 3.0]),
        lambda: DoublePendulum([1.0, -2.0]),
        lambda: Kepler(float("inf")),
        lambda: Kepler().pericentre(1.0),
        lambda: Kepler().pericentre(0.5, axis=-1.0),
        lambda: Kepler().period(Kepler().state([1.0, 0.0], [0.0, 2.0])),
        lambda: Kepler().exact(Kepler().pericentre(0.1), [np.nan]),
        lambda: Kepler().exact(Kepler().state(np.ones((3, 2)), np.ones((3, 2))), 1.0),
        lambda: Oscillators(0, 1.0),
    ],
)
def test_bad_models(make: Any) -> None:
    with pytest.raises(InvalidInput):
        make()


def test_a_system_must_say_its_degrees_and_its_energy() -> None:
    @record
    class Silent(HamiltonianSystem):
        def energy(self, q: Vec, p: Vec) -> float:
            return 0.0

    @record
    class Idle(HamiltonianSystem):
        degrees: ClassVar[int] = 1

    with pytest.raises(InvalidInput, match="degrees of freedom"):
        Silent()
    with pytest.raises(NotImplementedError, match="Idle must define `energy`"):
        Idle().energy(Vec(1.0), Vec(0.0))
    with pytest.raises(InvalidType, match=r"kepler\.state"):
        Kepler().exact(lm.BodyState([1.0]), 1.0)  # type: ignore[arg-type]
