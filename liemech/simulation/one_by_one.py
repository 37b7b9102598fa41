"""Ensembles whose bodies go each its own way: one run after another, bit for bit, shown as one."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable
from types import SimpleNamespace
from typing import Any

import numpy as np

from ..errors import (
    IntegrationFailure,
    IntegrationInterrupted,
    InvalidInput,
    InvalidType,
    warn,
)
from ..systems.system import State, member, small_state, state_of
from . import arguments
from .carry import AdaptiveCarry, Carries, Carry, Ended, Waiting, each, stacked
from .checkpoint import Checkpoint
from .events import NO_EVENTS
from .fictive import FictiveCarry, Origin
from .prepared import shown_step
from .progress import Bar
from .stopped import Stopped
from .systems import OfBodies, Systems
from .trajectory import Trajectory, TransformedTrajectory


def apart(plan: Any, start: Any, t_end: Any, t_eval: Any) -> bool:
    """Do the bodies of this run go each its own way?  Otherwise they step side by side."""
    if start.bodies is None:
        return False
    if plan.adaptive or isinstance(start, Carries):
        return True
    if plan.fictive:
        several = any(name in plan.of_each for name in ("system", "method", "h"))
        return several or t_end is not None or bool(plan.events)
    of_each = np.ndim(plan._given["h"]) > 0 and (t_end is not None or t_eval is not None)
    many = arguments.axes(t_end, "t_end") > 0 or arguments.axes(t_eval, "t_eval") > 1
    return bool(plan.events) or of_each or many


def of_bodies(check: Callable[[Any], Any], values: Iterable[Any]) -> list[Any]:
    """What is made of a value of each body; what is refused names the body."""
    found: list[Any] = []
    try:
        for value in values:
            found.append(check(value))
    except (InvalidInput, InvalidType) as error:
        error.add_note(f"[integrate: body {len(found)}]")
        raise
    return found


class OneByOne:
    """A run of an ensemble, body after body: a body that fails disturbs no other.

    begun : of each body the state with its time, or what it carries along.  plan_of : its plan.
    times_of : when its samples are asked for, None for the ends of steps.
    """

    def __init__(
        self,
        plan: Any,
        start: Any,
        t0: float,
        steps: Any,
        t_end: Any,
        t_eval: Any,
        kept: Checkpoint | None,
    ) -> None:
        self.plan, self.kept, self.count = plan, kept, start.bodies
        self._start, self._t0, self._end, self._t_eval = start, t0, t_end, t_eval
        self.begun = functools.cache(self._begun())
        if plan.adaptive and plan._given["dense"]:
            raise InvalidInput("integrate: dense=True is for one body at a time")
        if plan.adaptive and t_end is None:
            raise InvalidInput(
                "integrate: adaptive steps need a t_end; for steps of one length give h and steps"
            )
        self.own_times = arguments.axes(t_eval, "t_eval") > 1 or (
            t_eval is None and arguments.axes(t_end, "t_end") > 0
        )
        dense = False if plan.adaptive else None
        changed = {"progress": False, "workers": 1, "record": None, "dense": dense}
        self._given = plan._given | changed
        self.plan_of = functools.cache(self._made)
        self._steps, self.ends = steps, arguments.ends(t_end, self.count)
        self._columns = arguments.columns(t_eval, self.count)
        self.times_of = functools.cache(self._asked)
        self._check()
        self.runs: list[Trajectory] = []
        self.errors: dict[int, IntegrationFailure] = {}

    def _check(self) -> None:
        """Refuse what a body cannot be asked for, before the first one runs."""
        of_bodies(lambda i: (self.plan_of(i), self.times_of(i)), range(self.count))

    def _begun(self) -> Callable[[int], Any]:
        """The state of a body with its time, or what it carries along."""
        start, t0 = self._start, self._t0
        if isinstance(start, State):
            return lambda i: Waiting(member(start, i), t0)
        return members(start).__getitem__

    def _asked(self, i: int) -> np.ndarray | None:
        """When samples of a body are asked for."""
        begun, asked, last = self.begun(i), self._columns[i], self._last(i)
        if self.plan.adaptive and asked is None:
            return np.array([begun.t, last])
        if asked is not None and last is not None:
            return arguments.times(asked, begun.t, last)
        return asked

    def _last(self, i: int) -> float | None:
        """When the run of a body is to end, if that is known."""
        begun, end, plan = self.begun(i), self.ends[i], self.plan_of(i)
        if plan.adaptive or plan.fictive or isinstance(begun, Ended):
            return end
        t0, before = self._counted(begun)
        steps = plan._count(self._steps, end, t0, before)
        return t0 + (before + steps) * plan._steps.h

    @staticmethod
    def _counted(begun: Any) -> tuple[float, int]:
        """From when steps of one length are counted, and how many there are."""
        return (begun.t0, begun.step) if isinstance(begun, Carry) else (begun.t, 0)

    def _made(self, i: int) -> Any:
        """The plan of one body; it shares what is prepared with that of the first, if it can."""
        own = {name: values[i] for name, values in self.plan.of_each.items()}
        if not i or not own.keys() <= {"system"}:
            return type(self.plan)(**self._given | own)
        first = self.plan_of(0)
        return first.of_system(own["system"]) if own else first

    # ---------------------------------------------------------------- stepping

    def trajectory(self) -> Trajectory:
        """All bodies in turn."""
        with Bar(self.plan._given["progress"], self.count, "body") as bar:
            for i in range(self.count):
                if self._side_by_side(i, bar):
                    break
                try:
                    self.runs.append(self._run(i))
                except (Exception, KeyboardInterrupt) as caught:
                    error: Any = caught
                    run = getattr(error, "trajectory", None)
                    if run is not None and run.bodies is not None:
                        raise  # of all bodies: a checkpoint could not record what it should
                    if isinstance(error, KeyboardInterrupt):
                        raise self._interrupted(i, run) from None
                    if not isinstance(error, IntegrationFailure):
                        if run is not None:
                            error.add_note(f"[integrate: body {i}]")
                            error.trajectory = self.joined(run)
                        raise
                    self.errors[i] = error
                    self.runs.append(error.trajectory)
                if self.kept is not None and self.kept.due():
                    self.kept.save(self.joined())
                bar.advance(1)
        try:
            run = self.joined()
        except KeyboardInterrupt:
            raise self._interrupted(self.count) from None
        ended: Any = run.stopped
        if ended:
            some = ", ".join(f"body {i} after {n} steps" for i, n in [*ended.steps.items()][:5])
            warn(
                f"integrate: {len(ended)} of {run.bodies} bodies stopped early: "
                f"{some}. {ended[min(ended)].error}",
                RuntimeWarning,
            )
        return run

    def _interrupted(self, after: int, unfinished: Trajectory | None = None) -> Any:
        """Ctrl-C after so many bodies.  unfinished : the run of the next one as far as it has come."""
        told = f"integrate: interrupted after {after} of {self.count} bodies"
        stopped = IntegrationInterrupted(f"{told}; the samples are in `.trajectory`")
        stopped.trajectory = self.joined(unfinished)
        return stopped

    def _side_by_side(self, first: int, bar: Bar) -> bool:
        """Run all bodies from this one on side by side, if that can be done."""
        return False

    def _run(self, i: int) -> Trajectory:
        """The run of one body."""
        begun, kept = self.begun(i), self.kept
        if isinstance(begun, Ended):
            return self._still(i, begun)
        if kept is None:
            return self._alone(i, begun, None)
        shown = kept.shown
        kept.shown = lambda run: shown(self.joined(run))
        try:
            return self._alone(i, begun, kept)
        finally:
            kept.shown = shown

    def _alone(self, i: int, begun: Any, kept: Checkpoint | None) -> Trajectory:
        """The same of a body that steps."""
        times, plan, t, end = self.times_of(i), self.plan_of(i), begun.t, self.ends[i]
        start = begun.state if isinstance(begun, Waiting) else begun
        if plan.fictive:
            run: Trajectory = plan._transformed(start, self._steps, end, t, times, kept)
        elif plan.adaptive:
            run = plan._steps.run(start, t, end, self._steps, times, plan.events, kept)
        else:
            t0, before = self._counted(begun)
            steps = plan._count(self._steps, end, t0, before)
            run = plan._stepped(start, steps, t0, times, kept)
        return run

    def _still(self, i: int, begun: Ended | Waiting) -> Trajectory:
        """The run of a body that goes no further, or not yet: its state."""
        if isinstance(begun, Ended) and begun.error is not None:
            self.errors[i] = begun.error
        plan, t = self.plan_of(i), np.array([begun.t])
        states = {name: x[None] for name, x in begun.state.arrays.items()}
        h = 0.0 if plan.adaptive else plan._steps.h
        if isinstance(begun, Ended) and begun.origin is not None:
            return TransformedTrajectory(
                plan._inner, plan.method, h, t, states, None, 0, compiled=True, carry=begun,
                tau=np.array([begun.tau]), z=None if begun.z is None else np.array([begun.z]),
                origin=begun.origin,
            )  # fmt: skip
        return Trajectory(
            plan.system, plan.method, h, t, states, None, 0, compiled=True, carry=begun
        )

    # ---------------------------------------------------------------- all of them as one

    def joined(self, unfinished: Trajectory | None = None) -> Trajectory:
        """The runs of all bodies; those that have not begun stand at their starts.

        unfinished : the run of the next body as far as it has come.
        """
        runs = self._all_runs(unfinished)
        members = tuple([self._carried(i, run) for i, run in enumerate(runs)])
        n = max([self._samples_of(i, *one) for i, one in enumerate(zip(runs, members))])
        ways = [
            self._filled(i, run, n, carry)
            for i, (run, carry) in enumerate(zip(runs, members, strict=True))
        ]
        t = np.stack([way.pop("") for way in ways], axis=1)
        clocks: dict[str, Any] = {name: np.stack([w.pop(name) for w in ways], axis=1) for name in ("tau", "z")
                  if name in ways[0]}  # fmt: skip
        states = {name: np.stack([way[name] for way in ways], axis=1) for name in ways[0]}
        adaptive = self.plan.adaptive
        steps = {i: self._taken(i, runs[i]) for i in self.errors}
        own: Any = None  # the step, or those of all bodies
        if not adaptive:
            steps_of = tuple([self.plan_of(i)._steps.h for i in range(self.count)])
            own = steps_of if "h" in self.plan.of_each else steps_of[0]
        known: dict[str, Any] = {
            "h": float(np.mean([run.h for run in runs])) if adaptive else shown_step(own),
            "steps": max(run.steps for run in runs),
            "compiled": all(run.compiled for run in runs),
            "stopped": Stopped(steps, self.errors.__getitem__),
            "rejected": sum(run.rejected or 0 for run in runs) if adaptive else None,
            "events": self._events(runs),
        }
        if isinstance(runs[0], TransformedTrajectory):
            if (clocks["tau"] == clocks["tau"][:, :1]).all():
                clocks["tau"] = clocks["tau"][:, 0].copy()
            origins = tuple([getattr(run, "origin", None) for run in runs])
            known |= {"z": None} | clocks
            known |= {"system": self._inner_systems(runs), "origin": origins}
        return self._shown(t, states, lambda: members, **known)

    def _shown(
        self, t: np.ndarray, states: Any, members: Callable[[], tuple[Any, ...]], **known: Any
    ) -> Trajectory:
        """All bodies as one run.  t : (n, bodies).  members : what they carry along."""
        if not self.own_times and (t == t[:, :1]).all():
            t = t[:, 0].copy()

        def carry() -> Carries | None:
            each = members()
            return None if all(isinstance(one, Ended) for one in each) else Carries(each)

        own = {"system": self.plan.system, "method": self.plan.method, "bodies": self.count}
        kind = TransformedTrajectory if "tau" in known else Trajectory
        rest = SimpleNamespace(carry=carry)
        same = {"t": t, "states": states, "dense": None, "events": (), "observed": ()}
        return kind.promised(rest, **own | same | known)

    def _all_runs(self, unfinished: Trajectory | None) -> list[Trajectory]:
        """Those of all bodies so far."""
        runs = [*self.runs, unfinished] if unfinished is not None else [*self.runs]
        return runs + [self._not_begun(i) for i in range(len(runs), self.count)]

    def _samples_of(self, i: int, run: Trajectory, carry: Any) -> int:
        """How many samples a body has, with that where it failed."""
        times = self.times_of(i)
        if times is not None:
            return max(len(run), len(times))
        if self._reached(i) is None or not len(run):
            return len(run)
        fictive = isinstance(run, TransformedTrajectory)
        return len(run) + int(carry.tau != run.tau[-1] if fictive else carry.t != run.t[-1])

    def _inner_systems(self, runs: list[Trajectory]) -> Any:
        """Of a run in fictive time the systems that move in it."""
        several = self.plan.system
        if not isinstance(several, OfBodies):
            return runs[0].system
        return Systems(tuple([getattr(system, "system", system) if system.fictive else system
                              for system in several]))  # fmt: skip

    def _not_begun(self, i: int) -> Trajectory:
        """A body that stands where it will begin."""
        begun = self.begun(i)
        if self.plan.fictive:  # it has a clock, too
            return self.plan_of(i)._transformed(
                begun.state if isinstance(begun, Waiting) else begun, 0, None, begun.t, None, None
            )
        return self._still(i, begun)

    def _carried(self, i: int, run: Trajectory) -> Any:
        """With what a body goes on, if it does."""
        if run.carry is not None and i not in self.errors:
            return run.carry
        if isinstance(self.begun(i), Ended):
            return self.begun(i)
        hit = None if isinstance(run, TransformedTrajectory) else self._hit(i, run)
        if hit is not None:
            return Ended(*hit, self._taken(i, run))
        # one that failed stays there for all times that were asked for
        end = self.ends[i] if i in self.errors and self.plan.adaptive else None
        if not len(run) and self._reached(i) is None:
            begun = self.begun(i)
            return Ended(begun.state, begun.t if end is None else end, 0, self.errors.get(i))
        reached = self._reached(i)
        state = member(stacked([self._state(run)]), 0) if reached is None else reached
        steps, error = self._taken(i, run), self.errors.get(i)
        t = float(run.t[-1]) if end is None and reached is None else end
        if t is None:
            t = self._counted(self.begun(i))[0] + steps * self.plan_of(i)._steps.h
        if not isinstance(run, TransformedTrajectory):
            return Ended(state, t, steps, error)
        if reached is not None:
            t, tau, z = error.clock  # type: ignore[union-attr]
            return Ended(state, t, steps, error, tau, z, run.origin)
        z = None if run.z is None else float(run.z[-1])
        return Ended(state, t, steps, error, float(run.tau[-1]), z, run.origin)

    def _hit(self, i: int, run: Trajectory) -> tuple[State, float] | None:
        """The state and the time in which a terminal event ended the run of a body, if one did."""
        events = self.plan.events
        before = getattr(self.begun(i), "met", NO_EVENTS).counts(events)
        for event, n, (t, states) in zip(events, before, run.events, strict=False):
            if len(t) and n + len(t) == int(getattr(event, "terminal", None) or 0):
                return member(states, len(t) - 1), float(t[-1])
        return None

    def _reached(self, i: int) -> Any:
        """The state of a body that failed after its last accepted step."""
        return getattr(self.errors.get(i), "reached", None)

    def _state(self, run: Trajectory) -> Any:
        """The last state of a body's run."""
        begun = self.begun(0).state
        return type(begun)(
            *(run.states[name][-1] if name in run.states else None for name in begun.parts)
        )

    def _taken(self, i: int, run: Trajectory) -> int:
        """How many steps a body took that stopped."""
        begun = self.begun(i)
        before = begun.steps if isinstance(begun, Ended) else getattr(begun, "step", 0)
        return int(before) + run.steps

    def _filled(self, i: int, run: Trajectory, n: int, carry: Any) -> dict[str, np.ndarray]:
        """So many samples of a body; where it came to, again and again if there are less."""
        t, states, times = run.t, run.states, self.times_of(i)
        more, clocks = n - len(t), {}
        if isinstance(run, TransformedTrajectory):
            clocks = {"tau": run.tau} | ({} if run.z is None else {"z": run.z})
        if more:
            last = {"": t[-1:], **{name: x[-1:] for name, x in (states | clocks).items()}}
            sampled = times is not None and isinstance(carry, (AdaptiveCarry, Waiting, Ended))
            sampled = sampled or self._reached(i) is not None
            if not len(t) or sampled:
                last = {name: x[None] for name, x in carry.state.arrays.items()}
                last[""] = np.array([carry.t])
                last |= {name: np.array([getattr(carry, name, 0.0)]) for name in clocks}
            t = np.concatenate([t, np.repeat(last[""], more)])
            both = {name: np.concatenate([x, np.repeat(last[name], more, axis=0)])
                    for name, x in (states | clocks).items()}  # fmt: skip
        else:
            both = {**states, **clocks}
        if i in self.errors and times is not None and np.array_equal(run.t, times[: len(run)]):
            t = times  # it stays there
        return {"": t, **both}

    def _events(self, runs: list[Trajectory]) -> tuple[Any, ...]:
        """Of every event what every body has met."""
        if not self.plan.events:
            return ()
        none = no_events(self.begun(0).state)
        return tuple(
            [
                tuple([run.events[k] if run.events else none for run in runs])
                for k in range(len(self.plan.events))
            ]
        )


def no_events(state: Any) -> tuple[np.ndarray, Any]:
    """What a body has met of an event, with states like this one: nothing."""
    empty = {name: x[None][:0] for name, x in state.arrays.items()}
    return np.empty(0), state_of(type(state), empty)


def members(carry: Carry | FictiveCarry | Carries) -> tuple[Any, ...]:
    """What every body of an ensemble carries along."""
    if isinstance(carry, Carries):
        return carry.members
    return each(carry) if isinstance(carry, Carry) else each_in_fictive_time(carry)


def each_in_fictive_time(carry: FictiveCarry) -> tuple[Any, ...]:
    """What every body of an ensemble that steps side by side in fictive time carries along."""
    found: list[Any] = []
    h: Any = carry.inner.h
    for i, inner in enumerate(each(carry.inner)):
        origin = Origin(carry.origin.given, carry.origin.method, member(carry.origin.start, i))
        if not isinstance(inner, Ended):
            found.append(FictiveCarry(origin, inner))
            continue
        arrays = {name: x[None] for name, x in inner.state.arrays.items()}
        t, states, z = origin.whole.apart(arrays)
        state = small_state(type(origin.start), {name: x[0] for name, x in states.items()})
        tau, last = inner.steps * h, None if z is None else float(z[0])
        found.append(Ended(state, float(t[0]), inner.steps, inner.error, tau, last, origin))
    return tuple(found)
