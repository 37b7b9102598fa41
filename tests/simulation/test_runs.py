"""Laws that every run obeys, whatever its control, its bodies and what looks at it: one table, law x
control x bodies x observer, against the public face.
"""

from __future__ import annotations

import copy
import pickle
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scenes_of_runs as scenes
from scenes_of_runs import COVARIANT, EQUAL, FICTIVE, TABLE_TOLERANCE, Scene

import liemech as lm
from liemech.errors import IntegrationFailure, IntegrationInterrupted, InvalidInput, NotCompilable, StepTooSmall

TOLERANCE = replace(scenes.TOLERANCE, first=1.1, rest=3.0)
FICTIVE_STEPS = replace(FICTIVE, first=11, rest=13)
TABLE = replace(scenes.TABLE, names=("mu", "g"))

BY_STEPS = EQUAL, COVARIANT, TABLE, FICTIVE_STEPS
"""Runs of a number of steps."""

OF_ALL_KINDS = (*(s for s in scenes.METHODS if not s.by_time), *scenes.OF_SITES)
"""A method of each kind: explicit, with memories, on constraints, in fictive time, of many sites, ..."""

BY_TIME = TOLERANCE, TABLE_TOLERANCE, FICTIVE
"""Runs to a time."""

ALL = EQUAL, COVARIANT, TABLE, *BY_TIME
BACK = scenes.turned(EQUAL), scenes.turned(TOLERANCE), scenes.turned(FICTIVE)

WATCHED = "all", "every", "t_eval", "functions", "events", "ends", "events+t_eval", "ends+functions"

BODIES = pytest.mark.parametrize("bodies", [1, 3], ids=["one", "three"])
WORLDS = pytest.mark.parametrize(
    "compiled", [False, pytest.param(True, marks=pytest.mark.compiled)], ids=["plain", "native"]
)


def over(*table: Scene) -> Any:
    """A test for every one of these scenes."""
    names = [s.name + (" by steps" if s.name == "fictive" and not s.by_time else "") for s in table]
    return pytest.mark.parametrize("scene", [pytest.param(s, marks=marks(s), id=name) for s, name in zip(table, names)])


def marks(scene: Scene) -> Any:
    """In plain Python a step by colours, or of links, takes long."""
    return [pytest.mark.slow] if scene.name in ("spins by colours", "rods") else []


def watched(*observers: str) -> Any:
    return pytest.mark.parametrize("observer", observers)


# ---------------------------------------------------------------- runs


def plan_of(scene: Scene, observer: str = "all", compiled: bool = False, **options: Any) -> lm.Plan:
    known = scene.options | scenes.observer(scene, observer)[0] | options
    system, method = known.pop("system", scene.system), known.pop("method", scene.method)
    return lm.Plan(system, method, compiled=compiled, progress=False, **known)


def span_of(scene: Scene, observer: str = "all", **span: Any) -> dict[str, Any]:
    return scene.spans(span)[0] | scenes.observer(scene, observer)[1] | span


def whole(scene: Scene, bodies: int, observer: str = "all", compiled: bool = False) -> Any:
    """The run of a scene, made once."""
    key = scene.name, scene.system, scene.first, bodies, observer, compiled
    if key not in MADE:
        with not_yet(scene, bodies, observer, compiled):
            plan = plan_of(scene, observer, compiled)
            MADE[key] = plan.run(scene.start(bodies), **span_of(scene, observer))
        assert MADE[key].compiled == compiled
    return MADE[key]


@contextmanager
def not_yet(scene: Scene, bodies: int, observer: str, compiled: bool) -> Iterator[None]:
    """What is refused today, and may be allowed: `every` of adaptive steps, and tables that end in native lanes."""
    try:
        yield
    except InvalidInput:
        if not (observer == "every" and "rtol" in scene.options):
            raise
        pytest.skip("every is not for adaptive steps")
    except NotCompilable:
        if not (scene.name.startswith("table") and bodies > 1 and compiled):
            raise
        pytest.skip("a table that ends is not native in lanes")


MADE: dict[Any, lm.Trajectory] = {}


def member(scene: Scene, bodies: int, i: int) -> lm.State:
    """The start of one of several bodies."""
    return scene.inner.state(**{name: x[i] for name, x in scene.states(bodies).items()})


def same(a: np.ndarray, b: np.ndarray) -> bool:
    """Equal to the last bit, zeros of one sign."""
    a, b = np.asarray(a), np.asarray(b)
    return a.shape == b.shape and a.tobytes() == b.tobytes()


def same_runs(a: lm.Trajectory, b: lm.Trajectory) -> None:
    """Two runs have found the same."""
    assert same(a.t, b.t) and a.steps == b.steps and a.rejected == b.rejected
    assert a.states.keys() == b.states.keys() and a.ended == b.ended
    for name, x in a.states.items():
        assert same(x, b.states[name]), name
    assert dict(a.stopped.items()).keys() == dict(b.stopped.items()).keys()
    for one, other in zip(found(a), found(b), strict=True):
        same_events(one, other)


def found(run: lm.Trajectory) -> list[Any]:
    """What each event has met; of an ensemble by body."""
    events: Any = run.events
    return [*events] if run.bodies is None else [met for event in events for met in event]


def same_events(one: Any, other: Any) -> None:
    assert same(one[0], other[0])
    for name, x in one[1].arrays.items():
        assert same(x, other[1].arrays[name]), name


def body_of(run: lm.Trajectory, i: int) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Times and samples of one body of an ensemble."""
    t = run.t[:, i] if run.t.ndim == 2 else run.t
    return t, {name: x[:, i] for name, x in run.states.items()}


# ---------------------------------------------------------------- worlds, lanes, workers


@pytest.mark.slow
@pytest.mark.compiled
@over(*ALL, *BACK)
@BODIES
@watched(*WATCHED)
def test_native_code_gives_the_bits_of_plain_python(scene: Scene, bodies: int, observer: str) -> None:
    same_runs(whole(scene, bodies, observer), whole(scene, bodies, observer, compiled=True))


@pytest.mark.sample(10)
@over(*ALL, *BACK)
@watched(*WATCHED, "ends+t_eval")
def test_bodies_of_an_ensemble_go_as_alone(scene: Scene, observer: str) -> None:
    """Samples, events, and where a terminal event has ended it."""
    together, singles = whole(scene, 3, observer), []
    for i in range(3):
        singles += [plan_of(scene, observer).run(member(scene, 3, i), **span_of(scene, observer))]
        as_alone(together, i, singles[-1])
    if together.rejected is not None:
        assert together.rejected == sum(single.rejected for single in singles)
        assert together.steps == max(single.steps for single in singles)


def as_alone(together: lm.Trajectory, i: int, single: lm.Trajectory) -> None:
    """Body i of an ensemble has the samples of a run of its own; then it stays where it is."""
    t, states = body_of(together, i)
    if together.rejected is not None and len(t) == 2 < len(single.t):
        single_t, single_states = (single.t[[0, -1]], {n: x[[0, -1]] for n, x in single.states.items()})
    else:
        single_t, single_states = single.t, single.states
    n, end, last = len(single_t), single.t[-1], {}
    if single.ended is not None:  # not at the last time before the event that was asked for
        times, there = single.events[single.ended]
        end, last = times[-1], {name: x[-1] for name, x in there.arrays.items()}
    assert n <= len(t) and same(t[:n], single_t) and (t[n:] == end).all()
    for name, x in single_states.items():
        assert same(states[name][:n], x), name
        assert (states[name][n:] == last.get(name, x[-1])).all(), name
    events: Any = together.events
    for event, alone in zip(events, single.events, strict=True):
        same_events(event[i], alone)


OWN = [
    pytest.param(scene, name, id=f"{scene.name}, {name}")
    for scene in (EQUAL, TOLERANCE, FICTIVE)
    for name in scenes.own(scene)
]


@pytest.mark.sample(6)
@pytest.mark.parametrize(("scene", "name"), OWN)
@watched("all", "functions", "events")
def test_bodies_with_numbers_of_their_own_go_as_alone(scene: Scene, name: str, observer: str) -> None:
    """To the end, and from there on; so do their energies."""
    options, span = scenes.own(scene)[name]
    plan = plan_of(scene, observer, **options)
    together = plan.run(scene.start(5), **span_of(scene, observer, **span))
    further: dict[str, Any] = {"t_end": 8.0} if scene.by_time else {"steps": 3}
    gone = plan.resume(together, **further) if observer == "all" else None
    if scene is EQUAL and gone is not None:
        assert together.drift()["Casimir 1"].verdict == "exact"
    for i in range(5):
        mine = {key: x[i] for key, x in options.items()}
        until = {
            key: [row[i] for row in x] if key == "t_eval" else x[i] if isinstance(x, list) else x
            for key, x in span.items()
        }
        alone = plan_of(scene, observer, **mine)
        single = alone.run(member(scene, 5, i), **span_of(scene, observer, **until))
        as_alone(together, i, single)
        if gone is not None:
            onwards = alone.resume(single, **further)
            as_alone(gone, i, onwards)
            n = len(onwards) if not (together.rejected is not None and len(gone) == 2) else 1
            assert same(gone.energy[:n, i], onwards.energy[:n])


@pytest.mark.sample(4)
@over(*ALL)
@watched("all", "t_eval", "functions", "events")
def test_workers_and_executors_give_the_bits_of_one_thread(scene: Scene, observer: str) -> None:
    alone, start, span = whole(scene, 3, observer), scene.start(3), span_of(scene, observer)
    same_runs(plan_of(scene, observer, workers=2).run(start, **span), alone)
    with ThreadPoolExecutor(2) as executor:
        same_runs(plan_of(scene, observer).run(start, executor=executor, **span), alone)


@pytest.mark.compiled
@over(EQUAL, COVARIANT, TOLERANCE, FICTIVE)
@BODIES
@watched("all", "t_eval", "functions", "events")
def test_a_plan_that_has_run_gives_the_same_again(scene: Scene, bodies: int, observer: str) -> None:
    """However it makes its later runs, and whatever becomes of the samples of the first."""
    wanted = whole(scene, bodies, observer)
    plan, start = plan_of(scene, observer, compiled=True), scene.start(bodies)
    for prepared in (plan, plan, plan.replace(system=scene.system)):
        run = prepared.run(start, **span_of(scene, observer))
        same_runs(run, wanted)
        last = {name: np.array(x) for name, x in run.carry.state.arrays.items()}
        for x in run.states.values():
            x[:] = 7.0
        for name, x in run.carry.state.arrays.items():
            assert same(x, last[name]), name


@pytest.mark.compiled
@over(TOLERANCE, BACK[1])
@pytest.mark.parametrize(
    "options",
    [{"dense": False}, {"h": 0.01, "max_step": 0.1}, {"breaks": (0.5, 1.0)}],
    ids=["no way between", "lengths of steps", "breaks"],
)
def test_options_of_adaptive_steps(scene: Scene, options: dict[str, Any]) -> None:
    """In both worlds, first and later; no step is longer than allowed, and the first as given."""
    span, options = span_of(scene), dict(options)
    if "breaks" in options:  # parts of the way
        options["breaks"] = [scene.t0 + x * (scene.end - scene.t0) for x in options["breaks"]]
    wanted = plan_of(scene, **options).run(scene.start(1), **span)
    plan = plan_of(scene, compiled=True, **options)
    for _ in range(2):
        run = plan.run(scene.start(1), **span)
        same_runs(run, wanted)
        assert (run.dense is None) == (options.get("dense") is False)
    taken = np.abs(np.diff(wanted.t))
    if "h" in options:
        assert taken.max() < 0.1 * (1.0 + 1e-12) and abs(taken[0] - 0.01) < 1e-12
    elif "breaks" in options:
        for at in options["breaks"]:  # or some roundings before, where the velocity is the old one
            assert np.abs(wanted.t - at).min() <= 8.0 * np.spacing(np.abs(wanted.t).max())
        assert wanted.t[-1] == scene.end
        whole_one = whole(scene, 1)
        assert np.abs(wanted.mu[-1] - whole_one.mu[-1]).max() < 1e-3
        energies = plan_of(scene, "functions", **options).run(scene.start(1), **span)
        assert same(energies.t, wanted.t) and same(energies.states["mu"], wanted.mu)
    else:
        same_runs(wanted, whole(scene, 1))


LONG = {"equal": {"steps": 3000}, "covariant": {"steps": 3000}, "tolerance": {"t_end": 300.0}}


@pytest.mark.compiled
@over(EQUAL, COVARIANT, TOLERANCE)
@BODIES
def test_a_run_of_many_pieces_is_one(scene: Scene, bodies: int) -> None:
    """Of which a long one is made, and between which one looks at the clock: it ends where runs of
    a hundred steps do that go on from each other.
    """
    fine = {"rtol": 1e-9} if "rtol" in scene.options else {}
    plan, start, span = plan_of(scene, compiled=True, **fine), scene.start(bodies), LONG[scene.name]
    one = plan.run(start, **span)
    if "steps" in span:
        parts = plan.run(start, steps=100)
        for _ in range(29):
            parts = plan.resume(parts, steps=100)
        assert one.steps == 3000 and same(parts.t[-1], one.t[-1])
    else:
        parts = plan.replace(workers=2).run(start, t_eval=[0.0, 300.0], **span)
        assert one.steps > 500 and parts.steps == one.steps and parts.rejected == one.rejected
    for name, x in one.states.items():
        assert same(parts.states[name][-1], x[-1]), name
    if bodies == 1:
        assert len(one) == one.steps + 1 and (np.diff(one.t) > 0.0).all()
        size = np.linalg.norm(one.mu, axis=1)
        assert np.abs(size - size[0]).max() < 1e-12


# ---------------------------------------------------------------- going on


IN_PARTS = [
    *(
        pytest.param(s, name, id=f"{s.name}, {name}")
        for s in BY_STEPS
        for name in ("every", "functions", "events", "events+t_eval")
    ),
    *(pytest.param(s, "all", marks=marks(s), id=f"{s.name}, all") for s in (*BY_STEPS, *OF_ALL_KINDS)),
]


@pytest.mark.sample(8)
@pytest.mark.parametrize(("scene", "observer"), IN_PARTS)
@BODIES
def test_a_run_in_two_parts_is_the_whole_one(scene: Scene, bodies: int, observer: str) -> None:
    """By its pickle and by its copy too."""
    require_steps(scene, bodies)
    plan, (_, first, rest, times) = plan_of(scene, observer), scene.spans({})
    early: dict[str, Any] = {}
    late: dict[str, Any] = {}
    if "t_eval" in observer and scene.inner_fictive:
        pytest.skip("steps in fictive time come to no time that is known")
    if "t_eval" in observer:
        begun = plan_of(scene).run(scene.start(bodies), **first)
        early["t_eval"] = [t for t in times if t <= np.max(begun.t[-1])]
        late["t_eval"] = times[len(early["t_eval"]) :]
    one = whole(scene, bodies, observer)
    begun = plan.run(scene.start(bodies), **first, **early)
    for before in (begun, pickle.loads(pickle.dumps(begun)), copy.deepcopy(begun)):
        joined = before.then(plan.resume(before, **rest, **late))
        kept = slice(None)
        if observer == "every":  # where the first part ends is a sample of the joined run
            kept = np.isin(np.asarray(joined.t).reshape(len(joined), -1)[:, 0], one.t.reshape(len(one), -1)[:, 0])
        assert same(np.asarray(joined.t)[kept], one.t) and joined.steps == one.steps
        for name, x in one.states.items():
            assert same(joined.states[name][kept], x), name
        for mine, theirs in zip(found(joined), found(one), strict=True):
            same_events(mine, theirs)


def require_steps(scene: Scene, bodies: int) -> None:
    if bodies > 1 and scene in scenes.OF_SITES:
        pytest.skip("members of many sites have no steps by hand, nor do their runs go on")


@over(*BY_TIME)
@BODIES
@watched("all", "t_eval", "events", "functions")
def test_what_goes_on_from_a_file_goes_on_as_it_did(scene: Scene, bodies: int, observer: str, tmp_path: Path) -> None:
    plan, (_, first, rest, times) = plan_of(scene, observer), scene.spans({})
    late = {"t_eval": [t for t in times if t > scene.middle]} if observer == "t_eval" else {}
    early = {"t_eval": [t for t in times if t <= scene.middle]} if observer == "t_eval" else {}
    begun = plan.run(scene.start(bodies), **first, **early)
    wanted = plan.resume(begun, **rest, **late)
    assert (np.asarray(wanted.t)[-1] == scene.end).all()
    same_runs(plan.resume(pickle.loads(pickle.dumps(begun)), **rest, **late), wanted)
    if observer != "functions":
        begun.save(tmp_path / "run.npz")
        again = lm.Trajectory.load(tmp_path / "run.npz")
        same_runs(again, begun)
        same_runs(plan.resume(again, **rest, **late), wanted)


@pytest.mark.sample(4)
@over(*BY_STEPS, *OF_ALL_KINDS)
@BODIES
@WORLDS
def test_steps_by_hand_are_those_of_a_run(scene: Scene, bodies: int, compiled: bool) -> None:
    """`stepper`, `begin` and `step`, and runs that go on from either."""
    require_steps(scene, bodies)
    run = whole(scene, bodies, "all", compiled)
    plan, start = plan_of(scene, compiled=compiled), scene.start(bodies)
    stepper, carry = plan.stepper(start), plan.begin(start)
    for n in range(1, scene.first + 1):
        stepper.step()
        carry = plan.step(carry)
        assert same(stepper.t, run.t[n]) and same(carry.t, run.t[n]) and stepper.steps == n
        for name, x in run.states.items():
            assert same(stepper.state.arrays[name], x[n]), name
            assert same(carry.state.arrays[name], x[n]), name
    for here in (stepper, plan.stepper(carry)):
        rest = plan.resume(here, steps=scene.rest)
        assert same(rest.t[-1], run.t[-1])
        for name, x in run.states.items():
            assert same(rest.states[name], x[scene.first :]), name
    stepper.step(scene.rest)
    for name, x in run.states.items():
        assert same(stepper.state.arrays[name], x[-1]), name


LOOKS = [0]


@lm.record
class Interrupting(lm.Hamiltonian):
    """A free body; Ctrl-C comes when somebody has looked at its velocity often enough."""

    def energy(self, mu: lm.Vec) -> Any:
        return 0.5 * lm.dot(mu, self.gradient(mu))

    def gradient(self, mu: lm.Vec) -> lm.Vec:
        LOOKS[0] -= 1
        if LOOKS[0] == 0:
            raise KeyboardInterrupt
        return lm.vec(mu[0], mu[1] / 1.5, mu[2] / 2.0)


INTERRUPTED = lm.LiePoissonSystem(lm.SO3(), Interrupting())


@over(EQUAL, TOLERANCE)
@BODIES
@watched("all", "every", "functions", "events")
@pytest.mark.parametrize("part", [0.2, 0.6])
def test_a_run_that_was_interrupted_goes_on(scene: Scene, bodies: int, observer: str, part: float) -> None:
    """Its samples are the first of the whole run, and it ends where that does."""
    finer = {"rtol": 1e-9} if scene.by_time else {}  # many steps are left, of which each hangs on all before
    scene = replace(scene, system=INTERRUPTED, functions=("energy",), options=scene.options | finer)
    with not_yet(scene, bodies, observer, False):
        plan, span = plan_of(scene, observer), span_of(scene, observer)
    LOOKS[0] = 10**9
    one, looks = plan.run(scene.start(bodies), **span), 10**9
    LOOKS[0] = int(part * (looks - LOOKS[0]))
    with pytest.raises(IntegrationInterrupted) as caught:
        plan.run(scene.start(bodies), **span)
    LOOKS[0] = 0
    begun: Any = caught.value.trajectory
    if bodies == 1:
        n = len(begun.t) - 1  # the last one may lie between two samples
        assert n < len(one.t) and same(begun.t[:n], one.t[:n])
        for name, x in one.states.items():
            assert same(begun.states[name][:n], x[:n]), name
    if begun.carry is None:  # it was interrupted in a step that has an event, or in a recorded function
        assert observer in ("events", "functions")
        return
    for before in (begun, pickle.loads(pickle.dumps(begun))):
        gone = plan.resume(before, t_end=one.t[-1].max())
        assert (gone.t[-1] == one.t[-1]).all()
        for name, x in one.states.items():
            assert same(gone.states[name][-1], x[-1]), name
        if bodies == 1:
            for mine, theirs in zip(found(before.then(gone)), found(one), strict=True):
                same_events(mine, theirs)


@BODIES
@pytest.mark.parametrize("part", [0.5, 0.9])
def test_a_stepper_that_was_interrupted_goes_on(bodies: int, part: float) -> None:
    """All bodies stand at the last step that each of them has made."""
    scene = replace(EQUAL, system=INTERRUPTED)
    plan, start = plan_of(scene), scene.start(bodies)
    LOOKS[0] = 10**9
    one, looks = plan.run(start, steps=40), 10**9
    LOOKS[0] = int(part * (looks - LOOKS[0]))
    stepper = plan.stepper(start)
    with pytest.raises(IntegrationInterrupted):
        stepper.step(40)
    LOOKS[0] = 0
    made = stepper.steps
    assert 0 < made < 40 and same(np.max(stepper.t), one.t[made])
    stepper.step(40 - made)
    for name, x in one.states.items():
        assert same(stepper.state.arrays[name], x[-1]), name


# ---------------------------------------------------------------- observers


@over(*ALL, *BACK)
@BODIES
def test_every_nth_sample_is_one_of_all(scene: Scene, bodies: int) -> None:
    few, full = whole(scene, bodies, "every"), whole(scene, bodies)
    kept = [*range(0, len(full), 5)]
    kept += [len(full) - 1] * ((len(full) - 1) % 5 > 0)
    if full.t.ndim == 1:
        assert same(few.t, full.t[kept]) and few.steps == full.steps
        for name, x in full.states.items():
            assert same(few.states[name], x[kept]), name
        return
    for i in range(bodies):
        (t, states), (all_t, all_states) = body_of(few, i), body_of(full, i)
        where = np.searchsorted(np.sign(scene.end) * all_t, np.sign(scene.end) * t)
        assert same(t, all_t[where])
        for name, x in states.items():
            assert same(x, all_states[name][where]), name


@over(*ALL, *BACK)
@WORLDS
def test_states_at_times_lie_on_the_motion_between_the_steps(scene: Scene, compiled: bool) -> None:
    """Those of `run.at`: to the bit of polynomials and of shorter steps; in fictive time, where a
    root is looked for, to rounding.
    """
    some, full = whole(scene, 1, "t_eval", compiled), whole(scene, 1, "all", compiled)
    assert same(some.t, scene.times)
    at = full.at(scene.times)
    for name, x in some.states.items():
        if scene.inner_fictive:
            assert np.abs(x - at.arrays[name]).max() < 1e-13
        else:
            assert same(x, at.arrays[name]), name
        assert same(x[0], full.states[name][0]) and same(x[-1], full.states[name][-1])


TIMES = {
    "twice": [0.0, 0.0, 0.25, 0.25, 0.5, 1.0, 1.0],
    "inside": [0.125, 0.53125],
    "the end": [1.0],
    "the start": [0.0],
    "none": [],
}


@pytest.mark.sample(12)
@over(EQUAL, TOLERANCE, TABLE_TOLERANCE, *BACK[:2])
@BODIES
@WORLDS
@pytest.mark.parametrize("times", TIMES.values(), ids=TIMES)
def test_any_times_may_be_asked_for(scene: Scene, bodies: int, compiled: bool, times: list[float]) -> None:
    """None, the same again, the ends or not: the states are those at the time alone, and the steps
    those of any other run.
    """
    at = [scene.t0 + (scene.end - scene.t0) * x for x in times]
    with not_yet(scene, bodies, "t_eval", compiled):
        plan = plan_of(scene, compiled=compiled)
        span = scene.spans({})[0]
        run = plan.run(scene.start(bodies), t_eval=at, **span)
    full = whole(scene, 1 if bodies == 1 else bodies, "all", compiled)
    assert same(run.t, np.array(at)) and run.steps == full.steps and run.rejected == full.rejected
    assert run.dense is None and len(run) == len(at)
    for k, t in enumerate(at):
        if bodies == 1:
            for name, x in full.at(t).arrays.items():
                assert same(run.states[name][k], x), name
        else:
            single = plan_of(scene).run(member(scene, bodies, 2), t_eval=[t], **span)
            for name, x in single.states.items():
                assert same(run.states[name][k, 2], x[0]), name
    onwards = {"t_end": scene.end + 0.5 * np.sign(scene.end)} if scene.by_time else {"steps": 3}
    ends = [plan.resume(r, **onwards).states for r in (run, plan.run(scene.start(bodies), **span))]
    for name, x in ends[0].items():
        assert same(x[-1], ends[1][name][-1]), name


@over(*ALL, *BACK)
@BODIES
@watched("functions", "ends+functions", "names")
def test_what_is_recorded_is_that_of_the_samples(scene: Scene, bodies: int, observer: str) -> None:
    """Functions of the state by their values, parts of it as they are."""
    if observer == "names" and "rtol" in scene.options:
        pytest.skip("the error of parts that nobody needs is not asked for: the steps are others")
    without = {"ends+functions": "ends"}.get(observer, "all")
    kept, full = whole(scene, bodies, observer), whole(scene, bodies, without)
    t = np.asarray(full.t).reshape(len(full), -1) + np.zeros((1, bodies))
    for name, values in kept.states.items():
        if name in full.states:
            assert same(values, full.states[name]), name
        elif name == "energy":
            assert np.allclose(values, full.energy, rtol=1e-15, atol=1e-15)
        else:
            x = {
                n: np.moveaxis(y.reshape(len(full), bodies, *y.shape[2 if bodies > 1 else 1 :]), 0, 0)
                for n, y in full.states.items()
            }
            if name == "tilt":
                wanted = x["g"][..., 2, 2] * x["mu"][..., 0] + 0.25 * t
            else:
                q = x["q"]
                wanted = q[..., 0] * q[..., 0] + q[..., 1] * q[..., 1] - t
            assert same(values, wanted.reshape(values.shape)), name
    if observer == "names":
        assert same(kept.t, full.t) and kept.states.keys() == set(scene.names)


@over(*ALL, *BACK)
@BODIES
@watched("events", "ends")
def test_events_are_zeros_on_the_motion(scene: Scene, bodies: int, observer: str) -> None:
    """Where g = 0, in the order of the motion, one for each change of sign between two samples."""
    run = whole(scene, bodies, observer)
    functions = scenes.observer(scene, observer)[0]["events"]
    forwards = np.sign(scene.end - scene.t0)
    for k, g in enumerate(functions):
        met: Any = [run.events[k]] if bodies == 1 else run.events[k]
        for i, (times, states) in enumerate(met):
            if bodies == 1:
                t, samples = run.t, run.states
            else:
                t, samples = body_of(run, i)
            assert (np.diff(forwards * times) > 0.0).all()
            last = {name: x[-1] for name, x in samples.items()}
            values = []
            for j, at in enumerate(times):
                state = scene.inner.state(**{name: x[j] for name, x in states.arrays.items()})
                values.append(float(g(at, state)))
                if bodies == 1 and observer == "events":
                    for name, x in run.at(at).arrays.items():
                        assert np.abs(x - states.arrays[name][j]).max() < 1e-13, name
            assert np.abs(values).max(initial=0.0) < 1e-12
            if getattr(g, "terminal", None) and len(times) == g.terminal:
                assert t[-1] == times[-1]
                for name, x in states.arrays.items():
                    assert same(x[-1], last[name]), name
            if bodies == 1 and "rtol" not in scene.options and not hasattr(g, "direction"):
                signs = [
                    np.sign(float(g(s, scene.inner.state(**{n: x[m] for n, x in samples.items()}))))
                    for m, s in enumerate(t.tolist())
                ]
                changes = int((np.diff(signs) != 0).sum())
                assert abs(changes - len(times)) <= 1 if observer == "ends" else changes == len(times)


@over(EQUAL, COVARIANT, FICTIVE, TOLERANCE)
@BODIES
def test_an_event_ends_a_run_at_the_zero_that_all_of_them_show(scene: Scene, bodies: int) -> None:
    """The samples before are those of the run without an end."""
    full, ended = whole(scene, bodies), whole(scene, bodies, "ends")
    for i in range(bodies):
        t, states = (ended.t, ended.states) if bodies == 1 else body_of(ended, i)
        all_t, all_states = (full.t, full.states) if bodies == 1 else body_of(full, i)
        n = int((t != t[-1]).sum())
        if "rtol" in scene.options and bodies > 1:
            n = 1
        assert same(t[:n], all_t[:n])
        for name, x in states.items():
            assert same(x[:n], all_states[name][:n]), name


@over(EQUAL, TOLERANCE, *BACK[:2])
def test_the_times_asked_for_before_an_event_that_ends_a_run_are_kept(scene: Scene) -> None:
    """And those behind it not, in the step that it ends."""
    times, end = np.linspace(scene.t0, scene.end, 97), scene.t0 + 0.47 * (scene.end - scene.t0)

    def late(t: float, state: Any) -> float:
        return t - end

    late.terminal = True  # type: ignore[attr-defined]
    span = span_of(scene, t_eval=times)
    full, ended = plan_of(scene).run(scene.start(1), **span), plan_of(scene, events=[late]).run(scene.start(1), **span)
    assert same(full.t, times) and same(ended.t, times[:46])
    for name, x in ended.states.items():
        assert np.abs(x - full.states[name][:46]).max() < 1e-12, name


# ---------------------------------------------------------------- mathematics


@over(EQUAL, COVARIANT, FICTIVE_STEPS)
@BODIES
def test_the_way_back_undoes_a_run(scene: Scene, bodies: int) -> None:
    """To rounding, if the method is symmetric; else to an order more than its own."""

    def off(steps: int) -> float:
        h = scene.options["h"] * 24 / steps
        there = plan_of(scene, h=h).run(scene.start(bodies), steps=steps)
        end = there.last
        back = plan_of(scene, h=-h).run(end, steps=steps, t0=float(np.max(there.t[-1])))
        return max(np.abs(x[-1] - there.states[n][0]).max() for n, x in back.states.items())

    if scene is COVARIANT:
        assert off(24) < 1e-13
    elif scene is EQUAL:
        assert off(48) < 1e-3 and off(48) < off(24) / 2**4 * 1.2
    else:  # z begins anew at the turn, so the steps differ: the order is that of the method
        assert off(96) < 1e-1 and off(96) < off(48) / 2**2 * 1.3


@over(EQUAL, COVARIANT, TOLERANCE, FICTIVE, *BACK)
@BODIES
@watched("all", "t_eval", "events", "ends")
def test_what_the_method_keeps_is_kept_in_every_sample(scene: Scene, bodies: int, observer: str) -> None:
    """|mu| and the group on bodies, the angular momentum on orbits; at events too."""
    run = whole(scene, bodies, observer)
    places = [run.states, *(state.arrays for _, state in found(run) if len(_))]
    for k, x in enumerate(places):
        if "q" in x:
            L = x["q"][..., 0] * x["p"][..., 1] - x["q"][..., 1] * x["p"][..., 0]
            level = run.states["q"][0, ..., 0] * run.states["p"][0, ..., 1]
            level = level - run.states["q"][0, ..., 1] * run.states["p"][0, ..., 0]
            if k and bodies > 1:  # of one body
                assert np.abs(L[:, None] - level).min(axis=1).max() < 1e-13
            else:
                assert np.abs(L - level).max() < 1e-13
        else:
            size, level = np.linalg.norm(x["mu"], axis=-1), np.linalg.norm(run.mu[0], axis=-1)
            apart = size[:, None] - level if k and bodies > 1 else size - level
            apart = np.abs(apart).min(axis=1) if k and bodies > 1 else np.abs(apart)
            assert apart.max() < 1e-13
            g = x["g"]
            assert np.abs(np.swapaxes(g, -1, -2) @ g - np.eye(3)).max() < 1e-13


@over(EQUAL, COVARIANT, FICTIVE_STEPS)
def test_time_goes_on_with_the_steps(scene: Scene) -> None:
    """t0 + n h; what does not depend on time does not see t0."""
    run = plan_of(scene).run(scene.start(1), steps=24)
    later = plan_of(scene).run(scene.start(1), steps=24, t0=4.0)
    if not scene.inner_fictive:
        assert same(later.t, 4.0 + np.arange(25) * scene.options["h"])
    assert np.abs(later.t - 4.0 - run.t).max() < 1e-14
    for name, x in run.states.items():
        assert same(x, later.states[name]), name


# ---------------------------------------------------------------- failures


@pytest.mark.sample(12)
@over(*scenes.FAILING)
@watched("all", "every", "t_eval", "functions", "events")
@WORLDS
def test_a_run_that_fails_keeps_its_samples(scene: Scene, observer: str, compiled: bool) -> None:
    """Those that a shorter run has, which ends before the step that fails."""
    with not_yet(scene, 1, observer, compiled):
        plan = plan_of(scene, observer, compiled)
    with pytest.raises(IntegrationFailure) as caught:
        plan.run(scene.start(1), **span_of(scene, observer))
    told: Any = caught.value.trajectory
    assert told.steps > 0
    if scene.by_time:
        short = plan_of(scene, observer.replace("t_eval", "all")).run(scene.start(1), t_end=0.5 * float(told.t[-1]))
        n = 1 if observer == "t_eval" else len(short.t) - 2
        assert len(told) > n
    else:
        times = {"t_eval": told.t} if observer == "t_eval" else {}
        short = plan.run(scene.start(1), steps=told.steps, **times)
        n = len(told)
        if observer == "every":  # the last one is no sample of a run that should have gone on
            n = min(n, 1 + told.steps // 5)
        for mine, theirs in zip(found(told), found(short), strict=True):
            same_events(mine, theirs)
    assert same(told.t[:n], short.t[:n])
    for name, x in told.states.items():
        assert same(x[:n], short.states[name][:n]), name


@over(TOLERANCE, TABLE_TOLERANCE)
@watched("all", "t_eval", "functions")
@WORLDS
def test_too_few_steps_leave_the_samples_before(scene: Scene, observer: str, compiled: bool) -> None:
    """`steps` is the largest number of them; the plan may have run before."""
    full, plan = whole(scene, 1, observer), plan_of(scene, observer, compiled)
    for _ in range(2):
        with pytest.raises(StepTooSmall, match="5 steps led to") as caught:
            plan.run(scene.start(1), **span_of(scene, observer), steps=5)
        told: Any = caught.value.trajectory
        n = len(told)
        assert told.steps == 5 and 0 < n < len(full) and same(told.t, full.t[:n])
        assert observer == "t_eval" or n == 6
        for name, x in told.states.items():
            assert same(x, full.states[name][:n]), name


@pytest.mark.compiled
@over(*scenes.FAILING)
@watched("all", "t_eval", "events")
def test_a_failure_is_told_in_native_code_as_in_plain_python(scene: Scene, observer: str) -> None:
    """With the same words and the same samples; again, where the plan has failed before."""
    said = []
    for compiled in (False, True, True):
        with pytest.raises(IntegrationFailure) as caught:
            plan_of(scene, observer, compiled).run(scene.start(1), **span_of(scene, observer))
        said.append((type(caught.value), str(caught.value), caught.value.trajectory))
    assert said[0][:2] == said[1][:2] == said[2][:2]
    for _, _, run in said[1:]:
        same_runs(run, said[0][2])  # type: ignore[arg-type]


@over(*scenes.FAILING)
@watched("all", "t_eval", "functions", "events")
@WORLDS
@pytest.mark.filterwarnings("ignore")
def test_a_body_that_fails_disturbs_no_other(scene: Scene, observer: str, compiled: bool) -> None:
    """It is told of, with the steps that it has made, and the others go as alone."""
    if "exploding-tolerance" in scene.name and not (compiled or observer == "all"):
        pytest.skip("hundreds of steps, as they become shorter and shorter")
    runs = plan_of(scene, observer, compiled).run(scene.start(5), **span_of(scene, observer))
    assert runs.stopped
    for i in range(5):
        plan = plan_of(scene, observer, compiled)
        try:
            single = plan.run(member(scene, 5, i), **span_of(scene, observer))
            assert i not in runs.stopped
            as_alone(runs, i, single)
        except IntegrationFailure as error:
            stop = runs.stopped[i]
            assert type(stop.error) is type(error) and stop.steps == error.trajectory.steps  # type: ignore[union-attr]
