"""Taylor methods: the order that was asked for, on every kind of system; structure to rounding;
dense output; adaptive steps.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scenes import Powers, asymmetric_body, rotation, same_bits

import liemech as lm
from liemech.errors import IncompatibleSystem, InvalidInput, InvalidType, NotCompilable, StepTooSmall
from liemech.formulas import cos, dot, exp, log, record, sin, sqrt, tanh, vec, where
from liemech.integrators.taylor import SAFETY, Taylor, shortened


@record
class Driven(lm.GroupEquation):
    """Forced in time, and dependent on where it is."""

    def velocity(self, t: float, g: Any) -> Any:
        return vec(sin(3.0 * t) + g[0, 1], 0.3 * t * g[1, 2], cos(2.0 * t) / (1.0 + t * t))


@record
class DrivenInSpace(Driven):
    """The same velocity, in space."""

    side = "right"


@record
class Linear(lm.LinearGroupEquation):
    """Forced in time alone."""

    def drive(self, t: float) -> Any:
        return vec(sin(3.0 * t), 0.3, exp(-t))


@record
class OnSphere(lm.HomogeneousEquation):
    """A motion on a sphere."""

    def velocity(self, t: float, x: Any) -> Any:
        return vec(x[1] * t, sin(x[2]), exp(-t) + x[0] * x[0])


@record
class Plain(lm.GroupEquation):
    """Equations in R^9 with products of many forms: enough of them to lie side by side."""

    def velocity(self, t: float, y: Any) -> Any:
        line = 0.3 + 0.1 * t
        pairs = [y[i] * y[(i + 1) % 9] for i in range(9)]
        bent = [pairs[i] * y[i] - line * y[(i + 4) % 9] for i in range(9)]
        others = [y[0] * y[0], y[1] * y[1], y[2] / (2.0 + y[3] * y[3]), sin(t) * y[4], sqrt(y[5])]
        return vec(*[bent[i] - 0.1 * others[i % 5] for i in range(9)])


@record
class Rotor(lm.Hamiltonian):
    """An energy that is not quadratic, and whose gradient nobody writes."""

    def energy(self, mu: Any) -> float:
        return sqrt(1.0 + dot(mu, vec(1.0, 0.7, 0.4) * mu)) + 0.2 * log(2.0 + mu[0]) + 0.1 * tanh(mu[1]) ** 2


def moving(name: str) -> tuple[lm.System, Any, lm.Retraction]:
    """A system, its start and a retraction."""
    rng = np.random.default_rng(3)
    cayley, exponential, g, six = (lm.Cayley(), lm.Exponential(), rotation(rng), [0.3, 0.4, 1.0, 0.2, 0.5, 0.7])
    rotations = lm.SO3()
    submarine = lm.LiePoissonSystem(lm.SE3(), lm.KineticEnergy([1.0, 1.5, 2.0, 1.0, 1.3, 1.7]))
    hidden = lm.LiePoissonSystem(rotations, Rotor())
    quantum = lm.LiePoissonSystem(lm.SU(2), lm.KineticEnergy([1.0, 1.5, 2.0]))
    volume = lm.LiePoissonSystem(lm.SL(3), lm.KineticEnergy([1.0, 1.5, 2.0, 1.2, 1.4, 1.7, 1.1, 1.9]))
    ball, plain = OnSphere(lm.actions.SphereAction(3)), Plain(lm.VectorSpace(9))
    return {
        "body": (asymmetric_body()[0], asymmetric_body()[1], cayley),
        "body, exponential": (asymmetric_body()[0], asymmetric_body()[1], exponential),
        "driven": (Driven(rotations), Driven(rotations).state(g), cayley),
        "driven, exponential": (Driven(rotations), Driven(rotations).state(g), exponential),
        "driven in space": (DrivenInSpace(rotations), DrivenInSpace(rotations).state(g), cayley),
        "linear": (Linear(rotations), Linear(rotations).state(g), cayley),
        "sphere": (ball, ball.state([0.0, 0.6, 0.8]), cayley),
        "energy alone": (hidden, hidden.state([0.3, 0.9, 1.4], g), cayley),
        "Kirchhoff": (submarine, submarine.state(six, np.eye(4)), cayley),
        "SU(2)": (quantum, quantum.state([0.3, 0.4, 1.0], np.eye(2)), cayley),
        "plain": (plain, plain.state([*six, 0.1, 0.9, 0.4]), cayley),
        "SL(3)": (volume, volume.state([*six, 0.1, 0.1], np.eye(3)), exponential),
    }[name]


NAMES = (
    "body",
    "body, exponential",
    "driven",
    "driven, exponential",
    "driven in space",
    "linear",
    "sphere",
    "energy alone",
    "Kirchhoff",
    "SU(2)",
    "SL(3)",
    "plain",
)


def ends(run: lm.Trajectory, at: int = -1) -> np.ndarray:
    """All that is known of the last state, in one row."""
    return np.concatenate([np.ravel(x)[:] for x in (getattr(run, n)[at] for n in run.states)]).view(float)


def last(system: lm.System, method: lm.Method, start: Any, t_end: float, n: int, **options: Any) -> np.ndarray:
    return ends(lm.integrate(system, method, start, h=t_end / n, steps=n, every=n, **options))


# ------------------------------------------------------------------ order


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(("order", "counts"), [(4, (8, 16)), (8, (4, 8))])
def test_order_on_every_kind_of_system(name: str, order: int, counts: tuple[int, int]) -> None:
    system, start, retraction = moving(name)
    method = Taylor(order=order, retraction=retraction)
    reference = last(system, lm.RKMK(order=8), start, 1.5, 60)
    coarse, fine = (np.abs(last(system, method, start, 1.5, n, compiled=False) - reference).max() for n in counts)
    assert fine < 1e-13 or order - 1.0 < np.log2(coarse / fine) < order + 2.5, (coarse, fine)


# ------------------------------------------------------------------ one formula, two worlds


@pytest.mark.compiled
@pytest.mark.parametrize("name", NAMES)
def test_native_code_gives_the_bits_of_plain_python(name: str) -> None:
    system, start, retraction = moving(name)
    method = Taylor(order=3, retraction=retraction)
    plain, native = (last(system, method, start, 0.9, 4, compiled=c) for c in (False, True))
    assert same_bits(plain, native)


@pytest.mark.compiled
def test_where_takes_the_side_on_which_the_step_starts() -> None:
    @record
    class Folded(lm.GroupEquation):
        def velocity(self, t: float, g: Any) -> Any:
            return vec(where(g[0, 1] > 0.1, sin(t), cos(g[1, 1])), 0.3 * max(t, g[0, 0]), abs(g[0, 2]) + 1.0)

    @record
    class Branched(lm.GroupEquation):
        def velocity(self, t: float, g: Any) -> Any:
            x = t
            if g[0, 1] > 0.1:
                x = cos(t)
            return vec(x, 0.3, 0.1)

    system, start = Folded(lm.SO3()), Folded(lm.SO3()).state(np.eye(3))
    plain, native = (last(system, Taylor(order=6), start, 1.0, 10, compiled=c) for c in (False, True))
    assert same_bits(plain, native)
    system = Branched(lm.SO3())
    last(system, Taylor(order=6), start, 1.0, 10, compiled=False)
    with pytest.raises(NotCompilable, match="power series"):
        last(system, Taylor(order=6), start, 1.0, 10, compiled=True)


# ------------------------------------------------------------------ what is kept


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("order", [3, 12])
def test_casimir_and_spatial_momentum_to_rounding_over_ten_thousand_steps(order: int) -> None:
    body, start = asymmetric_body()
    run = lm.integrate(body, Taylor(order=order), start, h=0.2, steps=10_000, every=100, compiled=True)
    size = np.linalg.norm(run.mu, axis=1)
    assert np.abs(size / size[0] - 1.0).max() < 1e-13
    spatial = np.einsum("nij,nj->ni", run.g, run.mu)
    assert np.abs(spatial - spatial[0]).max() < 2e-13 * size[0]
    assert np.abs(np.einsum("nji,njk->nik", run.g, run.g) - np.eye(3)).max() < 1e-13


# ------------------------------------------------------------------ adaptive steps


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("order", [8, 12, 16])
def test_the_error_follows_the_tolerance(order: int) -> None:
    body, start = asymmetric_body()
    exact = body.exact(start, np.array([30.0]))
    steps = []
    for tolerance in (1e-5, 1e-7, 1e-9, 1e-11, 1e-13):
        run = lm.integrate(body, Taylor(order=order), start, t_end=30.0, rtol=tolerance, atol=tolerance, compiled=True)
        error = max(np.abs(run.mu[-1] - exact.mu[0]).max(), np.abs(run.g[-1] - exact.g[0]).max())
        assert error < 5.0 * tolerance + 2e-14
        assert error > 1e-4 * tolerance
        assert run.rejected <= 1
        steps.append(run.steps)
    growth = np.log(steps[3] / steps[0]) / np.log(1e6)  # steps ~ tolerance^(-1/order)
    assert 0.8 < growth * order < 1.3


@pytest.mark.slow
@pytest.mark.parametrize("name", ["driven", "sphere", "Kirchhoff"])
def test_adaptive_steps_on_other_systems(name: str) -> None:
    system, start, retraction = moving(name)
    run = lm.integrate(system, Taylor(order=10, retraction=retraction), start, t_end=1.5, rtol=1e-11, atol=1e-11)
    assert np.abs(ends(run) - last(system, lm.RKMK(order=8), start, 1.5, 150)).max() < 1e-10


@pytest.mark.slow
def test_every_step_is_as_long_as_its_terms_allow() -> None:
    """Also where a motion slows down quickly: past the pericentre of a long ellipse."""
    kepler = lm.Kepler()
    start = kepler.state([0.1, 0.0], [0.0, np.sqrt(19.0)])
    runs = [
        lm.integrate(kepler, Taylor(order), start, t_end=2.0 * np.pi, rtol=1e-9, atol=1e-9, compiled=False)
        for order in (12, 24)
    ]
    for run in runs:
        assert run.rejected == 0 and run.t[-1] == 2.0 * np.pi
        assert np.abs(run.q[-1] - np.array(start.q)).max() < 1e-8
    assert runs[1].steps < 0.5 * runs[0].steps


def test_a_number_that_begins_with_zero_needs_no_absolute_tolerance() -> None:
    body = lm.RigidBody([1.0, 1.5, 2.0])
    start = body.state(mu=[0.5, 0.0, 0.75**0.5], g=np.eye(3))
    steps = [
        lm.integrate(body, Taylor(8), start, t_end=3.0, rtol=1e-7, atol=atol, compiled=False).steps
        for atol in (0.0, 1e-7)
    ]
    assert steps[0] <= 1.5 * steps[1]


def test_steps_that_end_at_a_singularity() -> None:
    @record
    class Explosive(lm.GroupEquation):
        def velocity(self, t: float, y: Any) -> Any:
            return y * y[0]

    system = Explosive(lm.VectorSpace(1))
    with pytest.raises(StepTooSmall, match="at t = 1 the step fell") as caught:
        lm.integrate(system, Taylor(24), system.state([1.0]), t_end=2.0, compiled=False)
    times = caught.value.trajectory.t
    assert (np.diff(times) > 0.0).all() and 1.0 - times[-1] < 1e-14


def test_a_body_that_turns_about_an_axis_of_symmetry_has_no_error_to_estimate() -> None:
    body = lm.RigidBody([1.0, 1.0, 2.0])
    run = lm.integrate(body, Taylor(), body.state([0.0, 0.0, 1.0], np.eye(3)), t_end=5.0, rtol=1e-10, atol=1e-10)
    assert np.abs(run.g[-1][:2, :2] - [[np.cos(2.5), -np.sin(2.5)], [np.sin(2.5), np.cos(2.5)]]).max() < 1e-9


# ------------------------------------------------------------------ between the steps


@pytest.mark.parametrize("order", [4, 8])
def test_dense_output_has_the_order_of_the_method(order: int) -> None:
    body, start = asymmetric_body()
    errors = []
    for h in (0.5, 0.25):
        run = lm.integrate(
            body, Taylor(order=order), start, t_end=h, h=h, rtol=0.5, atol=1e3, dense=True, compiled=False
        )
        assert run.steps == 1
        times = np.linspace(0.0, h, 9)[1:-1]
        between, exact = run.dense(times), body.exact(start, times)
        errors.append(max(np.abs(between.mu - exact.mu).max(), np.abs(between.g - exact.g).max()))
    assert order + 0.5 < np.log2(errors[0] / errors[1]) < order + 2.0  # of a single step: order + 1


def test_dense_output_at_tight_tolerance() -> None:
    body, start = asymmetric_body()
    run = lm.integrate(body, Taylor(order=12), start, t_end=5.0, rtol=1e-12, atol=1e-12, dense=True)
    assert run.dense.order == 12
    times = np.linspace(0.0, 5.0, 200)
    np.testing.assert_allclose(run.dense(times).mu, body.exact(start, times).mu, atol=5e-12)


# ------------------------------------------------------------------ refusals


def test_refusals() -> None:
    refused: list[tuple[type[Exception], str, Callable[[], object]]] = [
        (InvalidType, "retraction must be", lambda: Taylor(retraction="cayley")),  # type: ignore[arg-type]
        (
            InvalidInput,
            r"with Exponential\(\) the order is at most 14",
            lambda: Taylor(order=15, retraction=lm.Exponential()),
        ),
        (IncompatibleSystem, "Exponential", lambda: Taylor().require(moving("SL(3)")[0])),
    ]
    for error, words, call in refused:
        with pytest.raises(error, match=words):
            call()
    assert Taylor().name == "Taylor12" and not Taylor.symmetric and not Taylor.symplectic


def test_taylor_takes_the_last_term_but_one_where_the_last_is_missing() -> None:
    """Of x' = t^2 the term of h^4 is zero: the error is e_3, in units of the tolerance, and its
    cubic root shortens the step.
    """
    line = Powers(lm.VectorSpace(1), 2)
    method, start = lm.Taylor(order=4), line.state([0.0])

    def trial(atol: float) -> Any:
        return method.trial(line, 0.5, start, line.drive(0.5), 0.8, 0.0, atol, False)

    e3 = 0.8**3 / 3.0
    for atol in (1.0, 0.5, 1e-3, 1e-6):
        assert trial(atol).error == pytest.approx(e3 / atol, rel=1e-14)
        share = min(1.0, SAFETY * (atol / e3) ** (1.0 / 3.0))
        assert trial(atol).share == pytest.approx(share, rel=2e-3)


@pytest.mark.parametrize("p", [2, 3, 8, 18, 30])
def test_the_share_of_a_step_is_right_to_a_hundredth(p: int) -> None:
    """Whichever of two terms is the larger one, and however large."""
    for share in np.geomspace(1e-4, 2.0, 300).tolist():
        last, before = (share / SAFETY) ** (-2 * p), (share / SAFETY) ** (2 - 2 * p)
        for found in (shortened(last, 0.1 * before, p), shortened(0.1 * last, before, p)):
            assert (1.0 - 1e-13) * min(share, 1.0) <= found <= 1.014 * min(share, 1.0)
    assert shortened(0.0, 0.0, p) == 1.0
    assert shortened(math.inf, 1.0, p) == 0.0


class Cubed(lm.VectorField):
    dim = 1

    def velocity(self, y):
        return vec(1.0 + y[0] ** 3)


@pytest.mark.xfail(
    strict=True, reason="the last two of twelve terms vanish by symmetry, and the step that is given is taken"
)
def test_a_given_first_step_from_a_symmetric_point():
    """y' = 1 + y^3 from y = 0 has the terms t, t^4, t^7, ...; it is at 0.8 at t = int_0^0.8 dy/(1 + y^3), by Simpson's rule."""
    y = np.linspace(0.0, 0.8, 20_001)
    f = 1.0 / (1.0 + y**3)
    end = float(np.sum(f[:-1:2] + 4.0 * f[1::2] + f[2::2]) * (y[1] / 3.0))
    run = lm.integrate(Cubed(), lm.Taylor(), Cubed().state([0.0]), t_end=end, h=end, rtol=1e-9, compiled=False)
    assert abs(run.y[-1, 0] - 0.8) < 1e-7
