"""The result of a run: the one place where samples become a `Trajectory`."""

from __future__ import annotations

import functools
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np

from ..formulas.classes.layouts import build, layout_of
from ..systems.system import small_state, state_of
from .between.dense import DenseOutput, DenseOutputs, flat, unpacked
from .stopped import NONE, Stopped
from .trajectory import TangentTrajectory, Trajectory


class AsItIs:
    """The view of the numbers of a run as states of its system.

    example : a state, whose layout they have.
    """

    lazy: ClassVar[bool] = True
    """May samples be made when somebody looks at them?"""

    def __init__(self, example: Any) -> None:
        self.layout, self.kind = layout_of(example), type(example)

    def small(self, numbers: np.ndarray) -> Any:
        """The state of one sample, in vectors and matrices, as formulas take it."""
        return build(self.layout, iter(numbers[: self.layout.width].tolist()))

    def arrays(self, numbers: np.ndarray) -> dict[str, np.ndarray]:
        """The parts of states, from their numbers, (..., width)."""
        return unpacked(self.layout, numbers)

    def states(self, numbers: np.ndarray) -> Any:
        """States of many samples, whose arrays have the leading axes of `numbers`."""
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
        return self.apart(numbers)[1]

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
    """The trajectory of the run so far.  goes_on : whether it can be resumed."""
    if run.by_sites:
        return of_sites(run)
    if run.bodies is None:
        return of_body(run, 0, goes_on)
    return of_bodies(run, goes_on or run.adaptive)


def of_body(run: Any, i: int, goes_on: bool = True) -> Any:
    """The run of one body as it would be alone."""
    quantities = run.quantities
    system, method = run.system_and_method(i)
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
    fields_of_control = run.known(i) | ({"dense": None} if quantities else {})
    return run.run_of.promised(SimpleNamespace(carry=carry), **fields | samples | fields_of_control)


def of_bodies(run: Any, goes_on: bool = True) -> Any:
    """The runs of all bodies as one."""
    events = (run.events.shown(i) for i in range(run.count)) if run.events else ()
    fields = _fields(run, run.quantities) | {
        "system": run.plan.system,
        "method": run.plan.method,
        "bodies": run.count,
        "steps": run.most,
        "events": tuple(zip(*events, strict=True)),
        "ended": ends([getattr(run.events.each.get(i), "ended", None) for i in range(run.count)] if run.events else []),
        "stopped": Stopped(run.stops, run.why),
    }
    promises = SimpleNamespace(carry=run.carry if goes_on else lambda: None)
    samples: dict[str, Any] = {}
    if run.lazy and run.view.lazy and not run.quantities:
        gathered = functools.cache(run.together)
        promises.t, promises.states = lambda: gathered()[0], lambda: run.view.arrays(gathered()[1])
    else:
        samples = _samples(lambda: run.view.fields(*run.together()), run.quantities)
    return run.run_of.promised(promises, **fields | samples | run.known(None))


def of_start(run: Any) -> Any:
    """The start as the only sample of a run that cannot begin."""
    fields = {"method": run.plan.method, "bodies": run.bodies, "steps": 0}
    return run.run_of(**fields, **run.first_sample())


def of_short(promises: Any, way: Any, h: Any, bodies: int | None, steps: int, others: Any) -> Any:
    """A run that one native call has made.  promises : makes fields of its memory when they are asked for.
    way : the prepared steps.  others : further fields.
    """
    fields = {"system": way.system, "method": way.method, "h": h, "bodies": bodies, "steps": steps}
    fields |= {"stopped": NONE, "compiled": True, "_rest": promises}
    fields |= others
    return Trajectory._of(fields)


def of_sites(run: Any) -> Any:
    """The run of one system of many sites, ended or between two pieces."""
    plan, t, states = run.plan, run.samples.t, _states_of_sites(run)
    if run.quantities:
        fields = run.quantities.fields(lambda: {"t": t, "states": run.states(run.samples.rows)})
        t, states = fields["t"], lambda: fields["states"]
    promises = SimpleNamespace(t=lambda: t, states=states, carry=lambda: run.carry)
    return Trajectory.promised(
        promises, system=plan.system, method=plan.method, bodies=None, steps=run.most,
        compiled=run.compiled, stopped=NONE, ended=run.ended_by,
        events=() if run.events is None else run.events.shown(0),
        observed=() if plan.recorder is None else plan.recorder.observed, **run.known(),
    )  # fmt: skip


def _states_of_sites(run: Any) -> Any:
    """A function without arguments that makes the arrays of the samples so far."""
    shape, recorder, samples = run.shape, run.plan.recorder, run.samples
    chosen, n = samples.chosen, samples.made
    rows, totals = samples.rows if chosen is None else samples.own[:n].copy(), samples.totals[:n].copy()

    def states() -> dict[str, np.ndarray]:
        parts = {}
        if shape.keeps:
            arrays = unpacked(shape.state, rows.swapaxes(1, 2))
            names = arrays if recorder is None else recorder.parts
            subset = arrays if set(names) - set(arrays) else {name: arrays[name] for name in names}
            parts = run.plan._one.as_users_see(subset)
            parts = {name: x for name, x in parts.items() if subset is not arrays or name in names or recorder is None}
            for name, sites in ({} if recorder is None else recorder.chosen).items():
                at = sites if chosen is None else [chosen.index(i) for i in sites]
                parts[name] = arrays[name][:, at]
        if shape.shown.quantities:
            parts |= dict(zip(run.plan._sites.summed, _columns(shape.shown.totals, totals), strict=True))
        return parts | run.recorded(n)

    return states


def _columns(layout: Any, rows: np.ndarray) -> list[np.ndarray]:
    """The parts of a tuple from its numbers, each (n, ...)."""
    columns, begin = [], 0
    for part in layout.parts:
        column = rows[:, begin : begin + part.width]
        begin += part.width
        columns.append(column[:, 0] if part.kind == "number" else column)
    return columns


def _samples(make: Any, quantities: Any) -> dict[str, Any]:
    """The fields that are samples, of states or of functions of them."""
    return quantities.fields(make) if quantities else make()


def _fields(run: Any, quantities: Any) -> dict[str, Any]:
    """The fields that runs of one body and of many have in common."""
    return {
        "compiled": run.compiled or run.lanes.stepping.native is not None,
        "observed": quantities.recorder.observed if quantities else (),
        "dense": None,
        "rejected": None,
    }


def of_tangent(varied: Any, steps: int, tangent: dict[str, np.ndarray], **own: Any) -> Any:
    """A run with its tangent map.  varied : the run whose numbers have carried the derivatives; where a step
    failed in a direction, what it failed of is raised.
    """
    fields = {"bodies": None, "steps": steps, "compiled": varied.compiled, "tangent": tangent}
    run = TangentTrajectory(**fields, **own)
    if not varied.stopped:
        return run
    first = min(varied.stopped, key=lambda i: varied.stopped[i].steps)
    error: Any = varied.stopped[first].error
    error.trajectory = replace(run, steps=varied.stopped[first].steps)
    raise error from error.__cause__


# ------------------------------------------------------------------ runs beside one another


def of_some(runs: list[Any], carry: Any = lambda: None, **own: Any) -> Any:
    """The run of all bodies, from runs of one body or of several each.  carry : a function that makes its carry."""
    first = runs[0]
    fields = {name: x for name, x in vars(first).items() if name not in ("_rest", "carry")}
    return type(first).promised(SimpleNamespace(carry=carry), **fields | beside(runs) | own)


def of_members(runs: list[Any], stopped: dict[int, Any]) -> Any:
    """The runs of the members of an ensemble, of one body each.  stopped : the errors of those that did
    not reach the end, which stay where they came to at the times of the others.
    """
    longest = max(runs, key=len)
    t = clock([longest if i in stopped else run for i, run in enumerate(runs)])
    return of_some(
        runs, t=t, method=longest.method, ended=ends([run.ended for run in runs]),
        events=tuple(zip(*[r.events for r in runs], strict=True)),
        stopped=Stopped({i: runs[i].steps for i in stopped}, stopped.__getitem__),
    )  # fmt: skip


def ends(events: list[int | None]) -> tuple[int | None, ...] | None:
    """The numbers of the events that ended bodies; None if none did."""
    return tuple(events) if any(number is not None for number in events) else None


def beside(runs: list[Any]) -> dict[str, Any]:
    """The fields of one trajectory for several runs beside one another, of one body or of some each.  A
    run that has fewer samples repeats its last one.
    """
    first, h = runs[0], runs[0].h
    bodies = [run.bodies or 1 for run in runs]

    def by_name(recorded: list[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
        return {name: together(runs, [samples[name] for samples in recorded]) for name in recorded[0]}

    if first.rejected is not None:
        h = float(np.average([run.h for run in runs], weights=bodies))
    elif any(np.ndim(run.h) or run.h != h for run in runs):
        h = np.concatenate([np.broadcast_to(run.h, n) for run, n in zip(runs, bodies)])
    fields = {
        "t": clock(runs),
        "states": by_name([run.states for run in runs]),
        "h": h,
        "bodies": sum(bodies),
        "steps": max(run.steps for run in runs),
        "compiled": all(run.compiled for run in runs),
        "rejected": None if first.rejected is None else sum(run.rejected for run in runs),
    }
    if isinstance(first.dense, DenseOutput | DenseOutputs) or hasattr(first.dense, "sites"):
        fields["dense"] = DenseOutputs(
            tuple([motion for run in runs for motion in getattr(run.dense, "bodies", (run.dense,))])
        )
    if getattr(first, "tau", None) is not None:
        fields["tau"] = clock(runs, "tau")
    if getattr(first, "z", None) is not None:
        fields["z"] = together(runs, [run.z for run in runs])
    if hasattr(first, "tangent"):
        fields["tangent"] = by_name([run.tangent for run in runs])
    return fields


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
        return times[0]
    return together(
        runs,
        [np.repeat(t[:, None], run.bodies, axis=1) if run.bodies and t.ndim == 1 else t for t, run in zip(times, runs)],
    )
