"""What a formula raises in a run: failures of a step, mistakes in the program, and the samples that are left."""

from __future__ import annotations

import math
import re
import traceback
import warnings
from typing import Any, ClassVar

import numpy as np
import pytest
from scenes import asymmetric_body

import liemech as lm
from liemech import errors
from liemech.errors import IntegrationFailure, InvalidInput, InvalidType, NotFinite
from liemech.formulas import dot, vec

WORLDS = pytest.mark.parametrize(
    "compiled", [False, None, pytest.param(True, marks=pytest.mark.compiled)], ids=["plain", "chosen", "compiled"]
)
START = [0.5, 0.0, 0.75**0.5]
AWAY = [5.0, 0.0, 0.0]  # stays where it is


@lm.record
class Fragile(lm.Hamiltonian):
    """A free body whose velocity has no value below mu_1 = 0.3, for a reason of one's choice."""

    inertia: lm.Vec
    how: str

    def energy(self, mu):
        return 0.5 * dot(mu, mu / self.inertia)

    def gradient(self, mu):
        if mu[0] < 0.3:
            if self.how == "raise":
                raise RuntimeError("the body is broken")
            if self.how == "divide":
                return mu / (0.0 * mu[0])
            if self.how == "name":
                return no_such_name * mu  # noqa: F821
            if self.how == "index":
                return vec(mu[7], 0.0, 0.0)
            if self.how == "shape":
                return vec(1.0, 2.0)
            if self.how == "type":
                raise TypeError("this is no velocity")
        return mu / self.inertia


@lm.record
class Asserting(Fragile):
    """With an assertion, which pytest rewrites: for plain Python."""

    def gradient(self, mu):
        assert mu[0] > 0.3, "the body is too slow"
        return mu / self.inertia


def fragile(how: str) -> lm.LiePoissonSystem:
    kind = Asserting if how == "assert" else Fragile
    return lm.LiePoissonSystem(lm.SO3(), kind([1.0, 1.5, 2.0], how))


MISTAKES = {"name": NameError, "index": IndexError, "shape": (TypeError, lm.errors.InvalidInput), "type": TypeError}
FAILURES = {"raise": RuntimeError, "divide": ZeroDivisionError, "assert": AssertionError}


@pytest.mark.sample(6)
@pytest.mark.parametrize("how", MISTAKES)
@pytest.mark.parametrize("compiled", [False, None])
@pytest.mark.parametrize("start", [START, [AWAY, START]], ids=["one", "many"])
def test_a_mistake_is_raised_as_itself(how: str, compiled: bool | None, start: Any) -> None:
    """With the line of the formula, and the samples so far."""
    system = fragile(how)
    with pytest.raises(MISTAKES[how]) as caught:
        lm.integrate(system, lm.RKMK(order=4), system.state(start), h=0.1, steps=100, compiled=compiled)
    assert "gradient" in [f.name for f in traceback.extract_tb(caught.value.__traceback__)] or how == "shape"
    run = caught.value.trajectory  # type: ignore[attr-defined]
    assert len(run) > 1
    assert (run.mu[..., 0] > 0.3).all()
    assert "samples before it" in caught.value.__notes__[0]


@pytest.mark.compiled
def test_a_mistake_that_native_code_only_marks() -> None:
    system = fragile("type")
    for start in (START, [AWAY, START]):
        with pytest.raises(TypeError, match="this is no velocity") as caught:
            lm.integrate(system, lm.RKMK(order=4), system.state(start), h=0.1, steps=100, compiled=True)
        assert len(caught.value.trajectory) > 1  # type: ignore[attr-defined]


@pytest.mark.parametrize("how", ["name", "type"])
def test_a_mistake_in_an_adaptive_run(how: str) -> None:
    system = fragile(how)
    with pytest.raises(MISTAKES[how]) as caught:
        lm.integrate(system, lm.RKMK(order=5), system.state(START), t_end=10.0, compiled=False)
    assert len(caught.value.trajectory) > 5  # type: ignore[attr-defined]
    with pytest.raises(MISTAKES[how]) as caught:  # type: ignore[arg-type]  # already at the start
        lm.integrate(system, lm.RKMK(order=5), system.state([0.1, 0.0, 1.0]), t_end=10.0)
    assert len(caught.value.trajectory) == 1  # type: ignore[attr-defined]


@pytest.mark.sample(4)
@pytest.mark.parametrize("how", ["raise", "divide"])
@WORLDS
def test_a_failure_names_its_cause_and_keeps_the_samples(how: str, compiled: bool | None) -> None:
    system = fragile(how)
    with pytest.raises(lm.errors.IntegrationFailure, match="step 41 of 100") as caught:
        lm.integrate(system, lm.RKMK(order=4), system.state(START), h=0.1, steps=100, compiled=compiled)
    assert type(caught.value.__cause__) is FAILURES[how]
    assert caught.value.trajectory is not None
    assert len(caught.value.trajectory) == 41


@pytest.mark.parametrize("how", FAILURES)
def test_a_failure_in_an_adaptive_run(how: str) -> None:
    """Shorter steps do not help; what the rejected ones raised is told, and the way there is kept."""
    system = fragile(how)
    with pytest.raises(lm.errors.StepTooSmall) as caught:
        lm.integrate(system, lm.RKMK(order=5), system.state(START), t_end=10.0, compiled=False)
    assert type(caught.value.__cause__) is FAILURES[how]
    assert caught.value.trajectory is not None
    assert abs(caught.value.trajectory.mu[-1, 0] - 0.3) < 1e-9


@pytest.mark.slow
@pytest.mark.compiled
def test_an_adaptive_failure_is_the_same_in_native_code() -> None:
    system, found = fragile("raise"), []
    for compiled in (False, True):
        with pytest.raises(lm.errors.StepTooSmall) as caught:
            lm.integrate(system, lm.RKMK(order=5), system.state(START), t_end=10.0, compiled=compiled)
        found.append((str(caught.value), caught.value.trajectory.mu.tobytes()))  # type: ignore[union-attr]
    assert found[0] == found[1]
    assert "RuntimeError: the body is broken" in found[0][0]


@WORLDS
def test_every_body_has_its_own_reason(compiled: bool | None) -> None:
    """Lazily, and each of its own step."""
    body, _ = asymmetric_body()
    starts = body.state([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    with pytest.warns(RuntimeWarning, match="3 of 3 bodies"):
        run = lm.integrate(body, Counting(), starts, h=1.0, steps=20, compiled=compiled)
    assert run.stopped.steps == {0: 7, 1: 4, 2: 6}  # type: ignore[attr-defined]
    for i, x in ((0, 0), (1, 3), (2, 1)):
        error = run.stopped[i].error
        assert isinstance(error, lm.errors.OutsideChart)
        assert f"the counter began at {x} [step {8 - x} of 20, t = {7 - x}]" in str(error)
    assert np.array_equal(run.mu[-1, :, 0], [7.0, 7.0, 7.0])


@lm.record
class Counting(lm.Method):
    """Counts to seven and says where it began; begins not at all below zero."""

    def start(self, system, state, h):
        if state.mu[0] < 0.0:
            raise ValueError("nothing to count")
        return lm.BodyState(state.mu + vec(0.0, state.mu[0], 0.0), state.g)

    def observe(self, memory):
        if memory.mu[0] > 1e6:
            raise ValueError("too many")
        return lm.BodyState(memory.mu, memory.g)

    def step(self, system, t, state, h):
        if state.mu[0] >= 7.0:
            raise lm.errors.OutsideChart(f"the counter began at {state.mu[1]:g}")
        return lm.BodyState(state.mu + vec(1.0, 0.0, 0.0), state.g)


@pytest.mark.sample(4)
@WORLDS
@pytest.mark.parametrize("bad", [0, 1, 2])
def test_a_body_that_cannot_begin_harms_no_other(bad: int, compiled: bool | None) -> None:
    body, _ = asymmetric_body()
    mu = np.zeros((3, 3))
    mu[bad, 0] = -1.0
    with pytest.warns(RuntimeWarning, match=f"1 of 3 bodies stopped early: body {bad} after 0 steps"):
        run = lm.integrate(body, Counting(), body.state(mu), h=1.0, steps=5, every=2, compiled=compiled)
    assert list(run.stopped) == [bad]
    assert "ValueError: nothing to count [at the start, t = 0]" in str(run.stopped[bad].error)
    others = [i for i in range(3) if i != bad]
    assert np.array_equal(run.mu[:, others, 0], np.array([[0, 0], [2, 2], [4, 4], [5, 5]]))
    assert np.array_equal(run.mu[:, bad], np.tile(mu[bad], (4, 1)))


@pytest.mark.parametrize(
    ("way", "far", "on", "all_of_it"),
    [({"h": 0.1}, {"steps": 60}, {"steps": 2}, {"steps": 62}), ({"rtol": 1e-6}, {"t_end": 6.0}, {"t_end": 6.5}, None)],
    ids=["fixed", "adaptive"],
)
@pytest.mark.parametrize("bad", [0, 1, 2])
def test_runs_of_which_a_body_has_failed_are_joined(bad: int, way: Any, far: Any, on: Any, all_of_it: Any) -> None:
    """The sample that both have is there once, also where a body stands before it."""
    body = lm.LiePoissonSystem(lm.SO3(), Fragile([1.0, 1.5, 2.0], "divide"))
    start = body.state(mu=np.insert(np.tile(AWAY, (2, 1)), bad, START, axis=0))
    plan = lm.Plan(body, lm.RKMK(order=5), compiled=False, **way)
    with pytest.warns(RuntimeWarning, match=f"body {bad} after"):
        first = plan.run(start, **far)
        joined = first.then(plan.resume(first, **on))
    others = np.delete(joined.t, bad, axis=1) if joined.t.ndim == 2 else joined.t
    assert (np.diff(others, axis=0) > 0.0).all() and [*joined.stopped] == [bad]
    if all_of_it:
        with pytest.warns(RuntimeWarning, match=f"body {bad} after"):
            whole = plan.run(start, **all_of_it)
        assert np.array_equal(joined.t, whole.t) and np.array_equal(joined.mu, whole.mu)


def test_when_nobody_can_begin() -> None:
    body, _ = asymmetric_body()
    starts = ([-1.0, 0.0, 0.0], "nothing to count"), (-np.ones((2, 3)), "none of the 2 bodies")
    lm.integrate(body, Counting(), body.state(np.ones((2, 3))), h=1.0, steps=1)  # lays all out
    for start, words in 2 * starts:
        with pytest.raises(lm.errors.IntegrationFailure, match=words) as caught:
            lm.integrate(body, Counting(), body.state(start), h=1.0, steps=5)
        assert caught.value.trajectory is not None
        assert len(caught.value.trajectory) == 1


@pytest.mark.slow
@WORLDS
def test_a_force_that_raises_at_the_start(compiled: bool | None) -> None:
    """Splittings evaluate the force before the first step: that is an attempt too, and its formula compiles."""
    for method in (lm.KickDrift(), lm.LieVerlet()):
        top = lm.MechanicalSystem(lm.RigidBody([1.0, 1.5, 2.0]), Cliff())
        good, bad = np.eye(3), np.diag([1.0, -1.0, -1.0])
        starts = top.state(np.ones((2, 3)), np.array([good, bad]))
        with pytest.warns(RuntimeWarning, match="body 1 after 0 steps"):
            run = lm.integrate(top, method, starts, h=0.01, steps=5, compiled=compiled)
        assert "over the edge" in str(run.stopped[1].error)
        alone = lm.integrate(top, method, top.state(np.ones(3), good), h=0.01, steps=5, compiled=False)
        assert np.array_equal(run.mu[:, 0], alone.mu)


@lm.record
class Cliff(lm.Potential):
    """A field that ends where the body's third axis points down."""

    def energy(self, g):
        if g[2, 2] < 0.0:
            raise ValueError("over the edge")
        return g[2, 2]


def test_an_exception_that_does_not_repeat_is_kept() -> None:
    """The step is not run again: what was raised the first time is the cause."""
    body, start = asymmetric_body()
    calls: list[float] = []

    @lm.record
    class Flaky(lm.Method):
        def step(self, system, t, state, h):
            calls.append(t)
            if len(calls) == 3:
                raise OSError("the sensor is off")
            return state

    with pytest.raises(lm.errors.IntegrationFailure, match=r"OSError: the sensor is off \[step 3 of 9") as caught:
        lm.integrate(body, Flaky(), start, h=0.1, steps=9, compiled=False)
    assert isinstance(caught.value.__cause__, OSError)
    assert len(calls) == 3


def test_an_event_that_raises_keeps_the_samples() -> None:
    body, start = asymmetric_body()

    def broken(t, state):
        return 1.0 / 0.0 if t > 1.0 else 1.0

    with pytest.raises(ZeroDivisionError) as caught:
        lm.integrate(body, lm.RKMK(order=5), start, t_end=5.0, events=broken)
    assert len(caught.value.trajectory) > 1  # type: ignore[attr-defined]


@pytest.mark.slow
@pytest.mark.compiled
def test_an_event_that_raises_ends_an_adaptive_run_before_its_step() -> None:
    """Rows, samples, steps, zeros and ensembles end where it was last looked at, in both worlds: and
    from there the run goes on as if nothing had happened.
    """

    def event(t: float, state: Any) -> float:
        return math.sqrt(1.0 - t) - 0.5

    body, mu, asked = lm.RigidBody([1.0, 1.6, 2.3]), [-2.2565, 1.4079, -0.0149], np.arange(11) / 5.0
    whole = lm.integrate(body, lm.RKMK(order=5), body.state(mu=mu), rtol=3.75e-9, t_end=2.0)
    last = whole.t[whole.t < 1.0][-1]
    for compiled in (False, True):
        plan = lm.Plan(body, lm.RKMK(order=5), rtol=3.75e-9, events=event, compiled=compiled)
        for times, start in (None, mu), (asked, mu), (None, [mu, [0.1, 0.2, 0.3]]):
            with pytest.raises(ValueError, match="math domain") as caught:
                plan.run(body.state(mu=start), t_end=2.0, t_eval=times)
            error: Any = caught.value
            run = error.trajectory
            if run.bodies is None:
                wanted = whole.t[whole.t <= last] if times is None else asked[asked <= last]
                assert np.array_equal(run.t, wanted) and run.steps == (whole.t <= last).sum() - 1
                assert [*run.events[0][0]] == [0.75]
                rest = plan.replace(events=()).resume(run, t_end=2.0)
                assert np.array_equal(rest.mu[-1], whole.mu[-1])
            else:
                assert np.array_equal(run.t, [[0.0, 0.0], [last, 0.0]])
                assert np.array_equal(run.mu[1, 0], whole.mu[run.steps])


@WORLDS
def test_no_absolute_tolerance_and_a_zero_in_the_start(compiled: bool | None) -> None:
    """A component that stays zero has no error; the others are as with a tiny tolerance."""
    body = lm.RigidBody([1.0, 1.5, 2.0])
    run = lm.integrate(
        body, lm.RKMK(order=5), body.state([0.0, 0.0, 1.0]), t_end=5.0, atol=0.0, rtol=1e-6, compiled=compiled
    )
    assert np.array_equal(run.mu, np.tile([0.0, 0.0, 1.0], (len(run), 1)))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run = lm.integrate(body, lm.RKMK(order=5), body.state(START), t_end=5.0, atol=0.0, rtol=1e-6, compiled=compiled)
    assert np.abs(run.mu[-1] - body.exact(body.state(START), [5.0]).mu[0]).max() < 1e-4


BODY = lm.RigidBody([1.0, 1.5, 2.0])


@lm.record
class Gap(lm.Force):
    """A force that is not defined for a while."""

    def covector(self, t, xi, g):
        if 0.52 < t < 0.545:
            raise ValueError("no force here")
        return lm.vec(0.0, 0.0, 0.0)


def test_a_shorter_step_that_fails_tells_its_time():
    body = lm.MechanicalSystem(BODY, lm.NoPotential(), load=Gap())
    start = body.state(mu=[1.0, 0.0, 0.2], g=np.eye(3))
    how = dict(method=lm.RKMK(order=2), start=start, h=0.1, steps=20, compiled=False)
    run = lm.integrate(body, **how)
    words = r"no force here \[the shorter step from t = 0.5 to t = 0.57\]"
    for times in (0.57, [0.1, 0.2, 0.57]):
        with pytest.raises(errors.IntegrationFailure, match=words):
            run.at(times)
    with pytest.raises(errors.IntegrationFailure, match=words) as caught:
        lm.integrate(body, t_eval=[0.1, 0.13, 0.57, 0.6], **how)
    assert np.array_equal(caught.value.trajectory.t, [0.1, 0.13])


@pytest.mark.parametrize("compiled", [False, pytest.param(True, marks=pytest.mark.compiled)])
def test_a_step_that_fails_leaves_the_samples_that_were_asked_for(compiled: bool) -> None:
    """Not the whole steps before them; and it says how many there are."""
    body = lm.MechanicalSystem(BODY, lm.NoPotential(), load=Gap())
    plan = lm.Plan(body, lm.RKMK(order=4), 0.05, compiled=compiled)
    start = body.state(mu=[1.0, 0.0, 0.2], g=np.eye(3))
    times = [0.0, 0.03, 0.1, 0.42, 0.51, 0.9]
    with pytest.raises(IntegrationFailure, match=r"no force here .*; 4 samples are in") as caught:
        plan.run(start, t_end=1.0, t_eval=times)
    run, before = caught.value.trajectory, plan.run(start, t_end=0.5, t_eval=times[:4])
    assert np.array_equal(run.t, times[:4]) and np.array_equal(run.mu, before.mu)


STARTS = BODY.state(np.array([[0.3, 0.4, 0.5], [0.1, 0.5, 0.9]]))


def test_a_mistake_in_an_event_is_raised_as_it_is() -> None:
    def mistaken(t: float, state: Any) -> float:
        return no_such_name * state.mu[0]  # type: ignore[name-defined]  # noqa: F821

    plan = lm.Plan(BODY, lm.RKMK(order=5), rtol=1e-6, events=mistaken, compiled=False)
    with pytest.raises(NameError, match="no_such_name"):
        plan.run(STARTS, t_end=1.0)


wrong = False


@lm.record
class Energy(lm.Hamiltonian):
    def energy(self, mu: lm.Vec) -> float:
        return lm.dot(mu, mu)

    def gradient(self, mu: lm.Vec) -> lm.Vec:
        return lm.vec(np.array([mu[0], 0.0]) if wrong else 2.0 * mu[0], 2.0 * mu[1], 2.0 * mu[2])


@pytest.mark.parametrize("steps", [{"h": 0.1, "steps": 3}, {"t_end": 1.0, "rtol": 1e-6}])
@pytest.mark.parametrize("bodies", [None, 2])
def test_it_is_raised_and_stops_no_body_as_if_a_step_had_failed(
    steps: dict[str, Any], bodies: int | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    system = lm.LiePoissonSystem(lm.SO3(), Energy())
    start = system.state([0.3, 0.8, -0.5] if bodies is None else np.ones((bodies, 3)))
    monkeypatch.setitem(globals(), "wrong", True)
    with pytest.raises(InvalidType, match=r"NumPy array where a number belongs, write liemech.vec"):
        lm.integrate(system, lm.RKMK(order=5), start, **steps, compiled=False)


def test_a_public_function_says_what_is_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    energy = Energy()
    monkeypatch.setitem(globals(), "wrong", True)
    with pytest.raises(InvalidType, match=r"a NumPy array where a number belongs"):
        energy.gradient([0.3, 0.8, -0.5])


@lm.record
class Shaken(lm.GroupEquation):
    strength: float

    def velocity(self, t: float, g: Any) -> Any:
        return AXIS * np.cos(self.strength * t)


AXIS = np.array([0.0, 0.6, 0.8])


def test_an_array_for_a_vector_is_one() -> None:
    """A turn by sin(2 t)/2 about one axis, given as an array."""
    equation = Shaken(lm.SO3(), 2.0)
    run = lm.integrate(equation, lm.RKMK(order=4), equation.state(np.eye(3)), h=0.1, steps=2, compiled=False)
    wanted = lm.SO3().exp(0.5 * np.sin(0.4) * AXIS)
    assert np.abs(run.g[-1] - wanted).max() < 1e-7


@lm.record
class Edge(lm.Hamiltonian):
    """(mu_1 + 0.2)^1.5 exists where mu_1 > -0.2."""

    def energy(self, mu: lm.Vec) -> float:
        return 0.5 * (mu[0] * mu[0] + 2.0 * mu[1] * mu[1] + 3.0 * mu[2] * mu[2]) + 0.01 * (mu[0] + 0.2) ** 1.5


@pytest.mark.parametrize("compiled", [False, pytest.param(True, marks=pytest.mark.compiled)])
def test_it_ends_the_body_that_left_and_no_other(compiled: Any) -> None:
    system = lm.LiePoissonSystem(lm.SO3(), Edge())
    start = system.state([[0.3, 0.8, -0.5], [2.0, 0.01, 0.0]])
    plan = lm.Plan(system, lm.RKMK(order=2), 0.05, compiled=compiled)
    with pytest.warns(RuntimeWarning, match="1 of 2 bodies"):
        run = plan.run(start, steps=40)
    assert [*run.stopped] == [0]
    with pytest.raises(NotFinite):
        plan.replace(compiled=False).run(system.state(start.mu[0]), steps=40)


@pytest.mark.parametrize("compiled", [False, pytest.param(True, marks=pytest.mark.compiled)])
def test_an_adaptive_run_does_not_begin_there(compiled: Any) -> None:
    system = lm.LiePoissonSystem(lm.SO3(), Edge())
    start = system.state([-1.0, 0.8, -0.5])
    with pytest.raises(NotFinite, match="at the start, t = 0"):
        lm.integrate(system, lm.RKMK(order=5), start, t_end=1.0, rtol=1e-6, compiled=compiled)


@pytest.mark.parametrize("name", ["energy", "gradient"])
def test_public_functions_have_no_value_there(name: str) -> None:
    with pytest.raises(InvalidInput, match=rf"Edge.{name} has no finite value at mu = \[-1.0"):
        getattr(Edge(), name)([[1.0, 0.0, 0.0], [-1.0, 0.8, -0.5]])


@pytest.mark.parametrize("bodies", [False, True])
@pytest.mark.parametrize("kind", ["steps", "adaptive", "fictive"])
@pytest.mark.parametrize("error", [ValueError, TypeError])
def test_an_error_names_step_and_time(error: Any, kind: str, bodies: bool) -> None:
    """A failure, and a mistake in a formula."""

    @lm.record
    class Fenced(lm.SeparableSystem):
        degrees: ClassVar[int] = 1

        def kinetic(self, p: lm.Vec) -> float:
            return 0.5 * p[0] * p[0]

        def potential(self, q: lm.Vec) -> float:
            if q[0] > 0.5:
                raise error("beyond the fence")
            return 0.5 * q[0] * q[0]

    system: Any = Fenced()
    method: Any = {
        "steps": lm.RKMK(order=4),
        "adaptive": lm.RKMK(order=5),
        "fictive": lm.ReversibleController(lm.StormerVerlet(), sigma=lambda q: 1.0),
    }[kind]
    start = system.state(q=[0.0], p=[1.0])
    if bodies:
        start = system.state(q=[[0.0], [0.0]], p=[[-0.1], [1.0]])
    given: Any = {"t_end": 4.0} if kind == "adaptive" else {"h": 0.05, "steps": 80}
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        try:
            run = lm.integrate(system, method, start, compiled=False, **given)
        except (lm.errors.IntegrationFailure, TypeError) as caught:
            said = "; ".join([str(caught), *getattr(caught, "__notes__", [])])
        else:
            said = "; ".join([*(str(w.message) for w in told), str(run.stopped[1].error)])
    assert re.search(r"step \d+|\d+ steps", said) and re.search(r"\bt(au)? = [\d.]+", said), said
