"""Kicks at several rates: the impulse method and the mollified one, where they are in resonance, and what they cost."""

from __future__ import annotations

import itertools
import math
import warnings
from typing import Any, ClassVar

import numpy as np
import pytest

import liemech as lm
from liemech.errors import IncompatibleSystem, InvalidInput, InvalidType, StepWarning


@lm.record
class Stiff(lm.MultirateSystem):
    """Two masses on stiff springs of frequency w, which a soft quartic potential couples."""

    degrees: ClassVar[int] = 2
    parts: ClassVar[tuple[str, ...]] = ("springs", "coupling")

    w: float

    def kinetic(self, p: lm.Vec) -> float:
        return 0.5 * lm.dot(p, p)

    def springs(self, q: lm.Vec) -> float:
        return 0.5 * self.w**2 * q[0] ** 2

    def coupling(self, q: lm.Vec) -> float:
        return 0.5 * (q[0] - q[1]) ** 2 + 0.25 * (q[0] + q[1]) ** 4


@lm.record
class Three(Stiff):
    """With a drive of its own rate between them."""

    parts: ClassVar[tuple[str, ...]] = ("springs", "bend", "coupling")

    def bend(self, q: lm.Vec) -> float:
        return 2.0 * lm.formulas.cos(q[0] - 2.0 * q[1])


@lm.record
class Counted(Stiff):
    """Counts the evaluations of each force."""

    calls: ClassVar[list[int]] = [0, 0]

    def part_force(self, k: int, q: lm.Vec) -> lm.Vec:
        Counted.calls[k] += 1
        return super().part_force(k, q)


SOFT, HARD = Stiff(7.0), Stiff(50.0)


def begin(system: Any) -> Any:
    return system.state(q=[0.1 / system.w, 0.7], p=[0.4, -0.2])


@pytest.mark.parametrize(
    ("system", "method", "order"),
    [
        (SOFT, lm.MultipleTimeSteps(ratios=(4,)), 2),
        (SOFT, lm.MultipleTimeSteps(ratios=(4,), mollified=True), 2),
        (Three(7.0), lm.MultipleTimeSteps(ratios=(3, 2)), 2),
        pytest.param(SOFT, lm.Composition(lm.MultipleTimeSteps(ratios=(4,)), order=4), 4, marks=pytest.mark.slow),
    ],
    ids=repr,
)
def test_order(system: Any, method: lm.Method, order: int) -> None:
    start, t = begin(system), 1.0
    exact = lm.integrate(system, lm.RKMK(order=8), start, h=t / 80, steps=80, compiled=False).q[-1]
    errors = []
    for n in (20, 40, 80):
        run = lm.integrate(system, method, start, h=t / n, steps=n, compiled=False)
        errors.append(float(np.abs(run.q[-1] - exact).max()))
    assert min(math.log2(a / b) for a, b in itertools.pairwise(errors)) > order - 0.2


@pytest.mark.parametrize(
    "method", [lm.MultipleTimeSteps(ratios=(3,)), lm.MultipleTimeSteps(ratios=(3,), mollified=True)], ids=repr
)
def test_symmetric_and_symplectic(method: lm.Method) -> None:
    start = SOFT.state(q=[0.3, 0.7], p=[0.4, -0.2])

    def step(y: np.ndarray, h: float = 0.2) -> np.ndarray:
        state = lm.CanonicalState(lm.vec(*y[:2]), lm.vec(*y[2:]))
        after = method.observe(method.step(SOFT, 0.0, method.start(SOFT, state, h), h))
        return np.array([*after.q, *after.p])

    y = np.array([*start.q, *start.p])
    assert np.abs(step(step(y), -0.2) - y).max() < 1e-14
    d = 1e-3
    columns = []
    for e in np.eye(4):
        a, b = ((step(y + k * d * e) - step(y - k * d * e)) / (2 * k * d) for k in (1, 2))
        columns.append((4 * a - b) / 3)
    M, J = np.transpose(columns), np.kron([[0.0, 1.0], [-1.0, 0.0]], np.eye(2))
    assert np.abs(M.T @ J @ M - J).max() < 1e-9


def test_one_step_of_each_rate_is_stormer_verlet() -> None:
    start = begin(SOFT)
    run = lm.integrate(SOFT, lm.MultipleTimeSteps(ratios=(1,)), start, h=0.05, steps=50, compensated=False)
    verlet = lm.integrate(SOFT, lm.StormerVerlet(), start, h=0.05, steps=50, compensated=False)
    assert np.abs(run.q - verlet.q).max() < 1e-14


def test_a_slow_force_is_evaluated_once_a_step() -> None:
    system = Counted(50.0)
    method, h = lm.MultipleTimeSteps(ratios=(8,)), 0.02
    memory = method.start(system, begin(system), h)
    Counted.calls[:] = [0, 0]
    for _ in range(10):
        memory = method.step(system, 0.0, memory, h)
    assert Counted.calls == [80, 10]


def largest_change(method: lm.Method, h: float, steps: int) -> float:
    run = lm.integrate(HARD, method, begin(HARD), h=h, steps=steps, progress=False)
    return float(np.abs(run.energy - run.energy[0]).max())


@pytest.mark.slow
@pytest.mark.compiled
def test_resonance() -> None:
    """Kicks half a fast period apart add up; those of the mollified force vanish just there."""
    impulse, mollified = (lm.MultipleTimeSteps(ratios=(40,), mollified=m) for m in (False, True))
    resonant, calm = math.pi / 50.02, 0.75 * math.pi / 50.0
    with pytest.warns(StepWarning, match="in resonance with the frequency 50"):
        blown = largest_change(impulse, resonant, 4_000)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        quiet = largest_change(impulse, calm, 4_000)
        damped = largest_change(mollified, resonant, 4_000)
    assert blown > 20.0 * quiet and blown > 20.0 * damped


def test_fast_steps_that_are_unstable_are_warned_of() -> None:
    with pytest.warns(StepWarning, match="are unstable for the frequency 50"):
        lm.integrate(HARD, lm.MultipleTimeSteps(ratios=(2,)), begin(HARD), h=0.1, steps=1)


@pytest.mark.slow
def test_with_steps_that_follow_a_time_scale() -> None:
    for mollified in (False, True):
        method = lm.ReversibleController(
            lm.MultipleTimeSteps(ratios=(4,), mollified=mollified), lambda q: 1.0 + q[1] ** 2
        )
        start, errors = begin(SOFT), []
        exact = lm.integrate(SOFT, lm.RKMK(order=8), start, h=0.0125, steps=80, compiled=False).q[-1]
        for h in (0.04, 0.02, 0.01):
            run = lm.integrate(SOFT, method, start, h=h, t_end=1.0, compiled=False)
            errors.append(float(np.abs(run.q[-1] - exact).max()))
        assert min(math.log2(a / b) for a, b in itertools.pairwise(errors)) > 1.8


def test_whole_numbers_of_numpy_are_ratios() -> None:
    made = lm.MultipleTimeSteps((np.int64(2), np.int32(3)))  # type: ignore[arg-type]
    assert made == lm.MultipleTimeSteps((2, 3)) and made.name == "Impulse 2:3"


def test_what_is_refused() -> None:
    for wrong in ((), (0,), (2.0,), (True,), (np.int64(0),)):
        with pytest.raises(InvalidInput, match="ratios"):
            lm.MultipleTimeSteps(ratios=wrong)  # type: ignore[arg-type]
    with pytest.raises(InvalidInput, match="two parts"):
        lm.MultipleTimeSteps(ratios=(2, 2), mollified=True)
    with pytest.raises(InvalidType):
        lm.MultipleTimeSteps(mollified=1)  # type: ignore[arg-type]
    with pytest.raises(IncompatibleSystem, match="MultirateSystem"):
        lm.integrate(lm.Kepler(), lm.MultipleTimeSteps(), lm.Kepler().pericentre(0.1), h=0.1, steps=1)
    with pytest.raises(IncompatibleSystem, match="for 3 parts"):
        lm.integrate(SOFT, lm.MultipleTimeSteps(ratios=(2, 2)), begin(SOFT), h=0.1, steps=1)

    @lm.record
    class Nameless(lm.MultirateSystem):
        degrees: ClassVar[int] = 1

    with pytest.raises(InvalidInput, match="the fastest first"):
        Nameless()


# ---------------------------------------------------------------- sums of fields


@lm.record
class Fast(lm.VectorField):
    """A gyration that is damped and driven, not Hamiltonian; affine."""

    dim: ClassVar[int] = 3
    w: float

    def velocity(self, y: lm.Vec) -> lm.Vec:
        return lm.vec(-self.w * y[1] - 0.3 * y[0], self.w * y[0], -0.2 * y[2])


@lm.record
class Slow(lm.VectorField):
    """What is dear: no motion of it is known."""

    dim: ClassVar[int] = 3

    def velocity(self, y: lm.Vec) -> lm.Vec:
        return lm.vec(lm.formulas.sin(y[2]), y[0] * y[2], y[1] - y[2] ** 2)


@lm.record
class Slowest(lm.VectorField):
    """A wind that changes with height: straight lines."""

    dim: ClassVar[int] = 3

    def velocity(self, y: lm.Vec) -> lm.Vec:
        return lm.vec(0.1 * lm.formulas.cos(y[2]), 0.2 * y[2] ** 2, 0.0)


MIDPOINT = lm.RKMK(tableau=lm.tableaus.gauss(1))
GAUSS = lm.RKMK(tableau=lm.tableaus.gauss(2))
FIELDS = {
    "a method for the slow part": (
        lm.SplitField((Fast(8.0), Slow())),
        lm.MultipleTimeSteps(ratios=(4,), methods=(None, MIDPOINT)),
    ),
    "methods for both": (
        lm.SplitField((Fast(8.0), Slow())),
        lm.MultipleTimeSteps(ratios=(4,), methods=(GAUSS, MIDPOINT)),
    ),
    "their own motions, three rates": (
        lm.SplitField((Fast(8.0), Slowest(), Slowest())),
        lm.MultipleTimeSteps(ratios=(3, 2)),
    ),
    "a sum inside": (
        lm.SplitField((lm.SplitField((Fast(8.0), Slowest())), Slow())),
        lm.MultipleTimeSteps(ratios=(4,), methods=(lm.Splitting(order=2), GAUSS)),
    ),
}


@pytest.mark.parametrize("name", FIELDS)
def test_fields_at_several_rates(name: str) -> None:
    """(3.11) for any symmetric Phi: of order two, and back with -h."""
    system, method = FIELDS[name]
    start = system.state([0.5, -0.3, 0.8])

    def end(method: lm.Method, n: int, start: Any = start, t: float = 1.0) -> Any:
        return lm.integrate(
            system, method, start, h=t / n, steps=n, compiled=False, compensated=False, progress=False
        ).last

    exact = np.array(end(lm.RKMK(order=8), 100).y)
    errors = [np.abs(np.array(end(method, n).y) - exact).max() for n in (16, 32)]
    assert math.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.15)
    there = end(method, 5)
    back = end(method, 5, there, -1.0)
    assert np.abs(np.array(back.y) - np.array(start.y)).max() < 1e-13


def test_one_step_of_each_field_is_strangs_splitting() -> None:
    system = lm.SplitField((Fast(8.0), Slowest()))
    start = system.state([0.5, -0.3, 0.8])
    runs = [
        lm.integrate(system, method, start, h=0.1, steps=20, compiled=False, compensated=False, progress=False)
        for method in (lm.MultipleTimeSteps(ratios=(1,)), lm.Splitting(order=2))
    ]
    assert np.abs(runs[0].y - runs[1].y).max() < 1e-14


@pytest.mark.slow
@pytest.mark.compiled
def test_native_code_of_fields_gives_the_same_bits() -> None:
    system, method = FIELDS["a method for the slow part"]
    for start in ([0.5, -0.3, 0.8], np.array([[0.5, -0.3, 0.8], [0.1, 0.2, 0.3], [1.0, 0.0, 0.1]])):
        plain, native = (
            lm.integrate(system, method, system.state(start), h=0.05, steps=10, compiled=c, progress=False)
            for c in (False, True)
        )
        assert native.y.tobytes() == plain.y.tobytes()


def test_what_fields_refuse() -> None:
    system = lm.SplitField((Fast(8.0), Slow()))
    with pytest.raises(IncompatibleSystem, match="or give it one of `methods`"):
        lm.MultipleTimeSteps(ratios=(4,)).require(system)
    with pytest.raises(IncompatibleSystem, match="for 3 parts"):
        lm.MultipleTimeSteps(ratios=(4, 2)).require(system)
    with pytest.raises(IncompatibleSystem, match="mollified"):
        lm.MultipleTimeSteps(ratios=(4,), mollified=True).require(system)
    with pytest.raises(InvalidInput, match="is not symmetric"):
        lm.MultipleTimeSteps(ratios=(4,), methods=(None, lm.RKMK(order=4)))
    with pytest.raises(InvalidInput, match="for 1 ratios of 2"):
        lm.MultipleTimeSteps(ratios=(4,), methods=(MIDPOINT,))
    with pytest.raises(InvalidType, match="are Methods or None"):
        lm.MultipleTimeSteps(ratios=(4,), methods=(MIDPOINT, "RK4"))  # type: ignore[arg-type]
    with pytest.raises(IncompatibleSystem, match="for the parts of a SplitField"):
        lm.MultipleTimeSteps(ratios=(4,), methods=(None, MIDPOINT)).require(SOFT)
    with pytest.raises(IncompatibleSystem, match="needs a SeparableSystem"):
        lm.MultipleTimeSteps(ratios=(4,), methods=(None, lm.StormerVerlet())).require(system)
