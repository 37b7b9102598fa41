"""The result of a run: the one place where samples become a `Trajectory`."""

from __future__ import annotations

import functools
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np

from ..formulas.classes.pytree import build, layout_of
from ..systems.system import small_state, state_of
from .between.dense import DenseOutput, DenseOutputs, flat, unpacked
from .stopped import NONE, Stopped
from .trajectory import TangentTrajectory, Trajectory


class AsItIs:
    """How numbers of a run are shown: as states of its system.

    example : a state, whose layout they have.
    """

    lazy: ClassVar[bool] = True
    """May samples be made when somebody looks at them?"""

    def __init__(self, example: Any) -> None:
        self.layout, self.kind = layout_of(example), type(example)

    def small(self, numbers: np.ndarray) -> Any:
        """A state as formulas take it."""
        return build(self.layout, iter(numbers[: self.layout.width].tolist()))

    def arrays(self, numbers: np.ndarray) -> dict[str, np.ndarray]:
        """The parts of states, from their numbers, (..., width)."""
        return unpacked(self.layout, numbers)

    def states(self, numbers: np.ndarray) -> Any:
        """Many states."""
        return state_of(self.kind, self.arrays(numbers))

    def seen(self, numbers: np.ndarray) -> tuple[Any, np.ndarray]:
        """The layout and the numbers of many states as formulas take them."""
        return self.layout, numbers

    def fields(self, t: np.ndarray, numbers: np.ndarray) -> dict[str, Any]:
        """The fields of a trajectory that are samples."""
        return {"t": t, "states": self.arrays(numbers)}

    def mark(self, error: Any, t: float, numbers: np.ndarray) -> None:
        """Say in an error where the body stands."""
        error.reached = self.small(numbers)


class InPhysicalTime(AsItIs):
    """The states of a system with its clock as those of the system itself.

    whole : the system with its clock.  kind : of state of the system itself.
    Behind the numbers of a state its fictive time may stand; else it is the time of the sample.
    """

    lazy: ClassVar[bool] = False

    def __init__(self, example: Any, whole: Any, kind: Any) -> None:
        super().__init__(example)
        self.whole, self.kind = whole, kind

    def apart(self, numbers: np.ndarray) -> Any:
        """Physical times, parts of the states, and z."""
        return self.whole.apart(unpacked(self.layout, numbers[..., : self.layout.width]))

    def small(self, numbers: np.ndarray) -> Any:
        arrays = self.arrays(numbers[None])
        return small_state(self.kind, {name: x[0] for name, x in arrays.items()})

    def arrays(self, numbers: np.ndarray) -> dict[str, np.ndarray]:
        found: dict[str, np.ndarray] = self.apart(numbers)[1]
        return found

    def seen(self, numbers: np.ndarray) -> tuple[Any, np.ndarray]:
        return layout_of(self.small(numbers[0])), flat(self.arrays(numbers), len(numbers))

    def fields(self, t: np.ndarray, numbers: np.ndarray) -> dict[str, Any]:
        physical, states, z = self.apart(numbers)
        if numbers.shape[-1] == self.layout.width:
            return {"t": physical, "states": states, "tau": t, "z": z}
        tau = numbers[..., -1]
        if tau.ndim == 2 and (tau == tau[:, :1]).all():
            tau = tau[:, 0].copy()
        return {"t": t, "states": states, "tau": tau, "z": z}

    def mark(self, error: Any, t: float, numbers: np.ndarray) -> None:
        super().mark(error, t, numbers)
        fields = self.fields(np.array([t]), numbers[None])
        error.clock = tuple([None if (x := fields[name]) is None else x.item(0) for name in ("t", "tau", "z")])


# ------------------------------------------------------------------ runs


def of_run(run: Any, goes_on: bool = True) -> Any:
    """The run so far.  goes_on : can it be resumed?"""
    if run.by_sites:
        return of_sites(run)
    if run.bodies is None:
        return of_body(run, 0, goes_on)
    return of_bodies(run, goes_on or run.adaptive)


def of_body(run: Any, i: int, goes_on: bool = True) -> Any:
    """The run of one body as it would be alone."""
    quantities = run.quantities
    system, method = run.of(i)
    watch = run.events.each.get(i) if run.events else None
    fields = _fields(run, quantities) | {
        "system": system,
        "method": method,
        "bodies": None,
        "steps": int(run.made[i]),
        "events": run.events.shown(i) if run.events else (),
        "ended": None if watch is None else watch.ended,
        "stopped": NONE,
    }
    make = lambda: run.view.fields(*run.samples(i))  # noqa: E731
    beside = quantities and run.bodies
    samples = quantities.of_body(i, make) if beside else _samples(make, quantities)
    carry = functools.partial(run.carry_of, i) if goes_on else lambda: None
    known = run.known(i) | ({"dense": None} if quantities else {})
    return run.run_of.promised(SimpleNamespace(carry=carry), **fields | samples | known)


def of_bodies(run: Any, goes_on: bool = True) -> Any:
    """The runs of all bodies as one."""
    events = (run.events.shown(i) for i in range(run.count)) if run.events else ()
    fields = _fields(run, run.quantities) | {
        "system": run.plan.system,
        "method": run.plan.method,
        "bodies": run.count,
        "steps": run.most,
        "events": tuple(zip(*events, strict=True)),
        "stopped": Stopped(run.stops, run.why),
    }
    rest = SimpleNamespace(carry=run.carry if goes_on else lambda: None)
    samples: dict[str, Any] = {}
    if run.lazy and run.view.lazy and not run.quantities:
        made = functools.cache(run.together)
        rest.t, rest.states = lambda: made()[0], lambda: run.view.arrays(made()[1])
    else:
        samples = _samples(lambda: run.view.fields(*run.together()), run.quantities)
    return run.run_of.promised(rest, **fields | samples | run.known(None))


def of_start(run: Any) -> Any:
    """The start as the only sample of a run that cannot begin."""
    known = {"method": run.plan.method, "bodies": run.bodies, "steps": 0}
    return run.run_of(**known, **run.first_sample())


def of_short(found: Any, way: Any, h: Any, bodies: int | None, steps: int, more: Any) -> Any:
    """A run that one native call has made.  found : has what is made of its numbers when it is asked
    for.  way : of the steps.  more : other fields.
    """
    known = {"system": way.system, "method": way.method, "h": h, "bodies": bodies, "steps": steps}
    known |= {"stopped": NONE, "compiled": True, "_rest": found}
    known |= more
    return Trajectory._of(known)


def of_sites(run: Any) -> Any:
    """The run of one system of many sites, which has come to a stand."""
    plan = run.plan
    t = run.asked[: run.made].copy()
    rest = SimpleNamespace(t=lambda: t, states=_states_of_sites(run), carry=lambda: run.standing)
    return Trajectory.promised(
        rest, system=plan.system, method=plan.method, bodies=None, steps=run.most,
        compiled=run.compiled, stopped=NONE, ended=run.ended,
        events=() if run.events is None else run.events.shown,
        observed=() if plan.recorder is None else plan.recorder.observed, **run.known(),
    )  # fmt: skip


def _states_of_sites(run: Any) -> Any:
    """A function that makes the samples so far."""
    shape, recorder, here, n = run.shape, run.plan.recorder, run.chosen, run.made
    totals, own, seen = run.totals[:n].copy(), run.own[:n].copy(), run.seen.array[: n * run.wide]

    def states() -> dict[str, np.ndarray]:
        found = {}
        if shape.shown.kept:
            rows = own if here is not None else seen.reshape(n, run.wide, seen.shape[-1])[..., : run.count]
            arrays = unpacked(shape.state, rows.swapaxes(1, 2))
            wanted = arrays if recorder is None else recorder.parts
            asked = arrays if set(wanted) - set(arrays) else {name: arrays[name] for name in wanted}
            found = run.plan._one.as_users_see(asked)
            found = {name: x for name, x in found.items() if asked is not arrays or name in wanted or recorder is None}
            for name, some in ({} if recorder is None else recorder.chosen).items():
                at = some if here is None else [here.index(i) for i in some]
                found[name] = arrays[name][:, at]
        if shape.shown.quantities:
            found |= dict(zip(run.plan._sites.summed, _columns(shape.shown.totals, totals), strict=True))
        return found | run.recorded(n)

    return states


def _columns(layout: Any, rows: np.ndarray) -> list[np.ndarray]:
    """The parts of a tuple, each (n, ...)."""
    found, begin = [], 0
    for part in layout.parts:
        own = rows[:, begin : begin + part.width]
        begin += part.width
        found.append(own[:, 0] if part.kind == "number" else own)
    return found


def _samples(make: Any, quantities: Any) -> dict[str, Any]:
    """The fields that are samples: of states, or of functions of them."""
    found: dict[str, Any] = quantities.fields(make) if quantities else make()
    return found


def _fields(run: Any, quantities: Any) -> dict[str, Any]:
    """Fields of runs of one body and of many."""
    return {
        "compiled": run.compiled or run.lanes.stepping.native is not None,
        "observed": quantities.recorder.observed if quantities else (),
        "dense": None,
        "rejected": None,
    }


def of_tangent(made: Any, steps: int, tangent: dict[str, np.ndarray], **own: Any) -> Any:
    """A run with its tangent map.  made : the run whose numbers have carried the derivatives; where a step
    failed in a direction, what it failed of is raised.
    """
    known = {"bodies": None, "steps": steps, "compiled": made.compiled, "tangent": tangent}
    run = TangentTrajectory(**known, **own)
    if not made.stopped:
        return run
    first = min(made.stopped, key=lambda i: made.stopped[i].steps)
    error: Any = made.stopped[first].error
    error.trajectory = replace(run, steps=made.stopped[first].steps)
    raise error from error.__cause__


# ------------------------------------------------------------------ runs beside one another


def of_some(runs: list[Any], carry: Any = lambda: None, **own: Any) -> Any:
    """The run of all bodies, from runs of one or of some each.  carry : makes what it goes on with."""
    first = runs[0]
    known = {name: x for name, x in vars(first).items() if name not in ("_rest", "carry")}
    return type(first).promised(SimpleNamespace(carry=carry), **known | beside(runs) | own)


def of_members(runs: list[Any], stopped: dict[int, Any]) -> Any:
    """The runs of the members of an ensemble, of one body each.  stopped : the errors of those that did
    not reach the end, which stay where they came to at the times of the others.
    """
    longest = max(runs, key=len)
    t = clock([longest if i in stopped else run for i, run in enumerate(runs)])
    return of_some(
        runs, t=t, method=longest.method, ended=None,
        events=tuple(zip(*[r.events for r in runs], strict=True)),
        stopped=Stopped({i: runs[i].steps for i in stopped}, stopped.__getitem__),
    )  # fmt: skip


def beside(runs: list[Any]) -> dict[str, Any]:
    """The fields of one trajectory for several runs beside one another, of one body or of some each.  A
    run that has fewer samples repeats its last one.
    """
    first, h = runs[0], runs[0].h
    bodies = [run.bodies or 1 for run in runs]

    def by_name(kept: list[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
        return {name: together(runs, [one[name] for one in kept]) for name in kept[0]}

    if first.rejected is not None:
        h = float(np.average([run.h for run in runs], weights=bodies))
    elif any(np.ndim(run.h) or run.h != h for run in runs):
        h = np.concatenate([np.broadcast_to(run.h, n) for run, n in zip(runs, bodies)])
    found = {
        "t": clock(runs),
        "states": by_name([run.states for run in runs]),
        "h": h,
        "bodies": sum(bodies),
        "steps": max(run.steps for run in runs),
        "compiled": all(run.compiled for run in runs),
        "rejected": None if first.rejected is None else sum(run.rejected for run in runs),
    }
    if isinstance(first.dense, DenseOutput | DenseOutputs) or hasattr(first.dense, "sites"):
        found["dense"] = DenseOutputs(
            tuple([one for run in runs for one in getattr(run.dense, "bodies", (run.dense,))])
        )
    if getattr(first, "tau", None) is not None:
        found["tau"] = clock(runs, "tau")
    if getattr(first, "z", None) is not None:
        found["z"] = together(runs, [run.z for run in runs])
    if hasattr(first, "tangent"):
        found["tangent"] = by_name([run.tangent for run in runs])
    return found


def together(runs: list[Any], arrays: list[np.ndarray]) -> np.ndarray:
    """Samples of several runs beside one another, the last ones repeated."""
    samples = max(map(len, arrays))
    columns = [x[:, None] if run.bodies is None else x for x, run in zip(arrays, runs)]
    filled = [np.concatenate([x, np.repeat(x[-1:], samples - len(x), axis=0)]) for x in columns]
    return np.concatenate(filled, axis=1)


def clock(runs: list[Any], name: str = "t") -> np.ndarray:
    """The times of several runs, (n, bodies) unless all have the same ones, (n,)."""
    times = [getattr(run, name) for run in runs]
    if all(t.ndim == 1 and np.array_equal(t, times[0]) for t in times):
        found: np.ndarray = times[0]
        return found
    return together(
        runs,
        [np.repeat(t[:, None], run.bodies, axis=1) if run.bodies and t.ndim == 1 else t for t, run in zip(times, runs)],
    )
