"""Samples of functions of the state: energies, angles, distances, kept instead of the state, in
memory for themselves alone.
"""

from __future__ import annotations

import dataclasses
import inspect
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ..compiler.driver import attempt, reason
from ..errors import (
    IntegrationInterrupted,
    InvalidInput,
    InvalidType,
    failure,
    is_mistake,
)
from ..formulas import Record
from ..formulas.pytree import layout_of
from ..formulas.vectors import small
from ..systems.system import State
from .carry import Carry
from .checkpoint import Checkpoint
from .dense import evaluated, flat, observe
from .drift import RECORDED
from .fixed_run import FixedRun
from .prepared import Steps, times
from .progress import Bar
from .trajectory import Trajectory, TransformedTrajectory

SAMPLES, STEPS = 2**16, 2**22
"""Samples and steps of all bodies together between two looks at the functions."""

COMPUTED = *RECORDED, "multipliers"
"""Quantities that a run computes from its samples, unless they were kept."""

PLAIN = ("number", "vec", "mat")
"""What a function may give."""


@dataclasses.dataclass(frozen=True, eq=False)
class Recorder:
    """What is kept of each sample: parts of the state, and quantities by name.

    quantities : methods of the system, by their names, or functions of time and state.
    """

    parts: tuple[str, ...]
    quantities: dict[str, str | Callable[[float, Any], Any]]

    @property
    def names(self) -> tuple[str, ...]:
        """All that is kept."""
        return *self.parts, *self.quantities

    def needed(self, system: Any, start: Any) -> tuple[str, ...] | None:
        """The parts of the state that a run must have: for a function of the state all that there
        are.
        """
        if not isinstance(start, State):
            return None
        if not all(isinstance(q, str) for q in self.quantities.values()):
            return tuple(dict.fromkeys([*start.arrays, *self.parts]))
        wanted = [name for name, x in system.essential_part(start).parts.items() if x is not None]
        for quantity in self.quantities.values():
            parts = inspect.signature(getattr(system, str(quantity))).parameters
            if not set(parts) <= set(start.parts):
                raise InvalidInput(
                    f"integrate: record={quantity!r} is a formula of {', '.join(parts)}, not of "
                    f"the state, which is {', '.join(start.parts)}; "
                    "record a function of time and state"
                )
            wanted += parts
        return tuple(dict.fromkeys([*wanted, *self.parts]))

    # ---------------------------------------------------------------- what is kept

    def values(
        self, run: Any, kind: Any, t: np.ndarray, states: dict[str, np.ndarray], compiled: Any
    ) -> dict[str, np.ndarray]:
        """What is kept of samples (n, ...), of an ensemble (n, bodies, ...).  kind : of state.

        What a function raises has, as `kept`, the samples before the one for which it failed: how
        many, and what is kept of them.
        """
        try:
            return self._values(run, kind, t, states, compiled)
        except (Exception, KeyboardInterrupt) as caught:
            error: Any = caught
            if isinstance(caught, KeyboardInterrupt):
                error = IntegrationInterrupted(
                    f"integrate: interrupted while {', '.join(self.quantities)} were computed; "
                    "the samples before are in `.trajectory`"
                )
            n = getattr(caught, "row", 0) // (run.bodies or 1)
            some = {name: x[:n] for name, x in states.items()}
            error.kept = n, self._values(run, kind, t[:n], some, compiled)
            raise error from error.__cause__

    def _values(
        self, run: Any, kind: Any, t: np.ndarray, states: dict[str, np.ndarray], compiled: Any
    ) -> dict[str, np.ndarray]:
        found = {name: states[name] for name in self.parts}
        for name, quantity in self.quantities.items():
            if isinstance(quantity, str):
                formula = getattr(run.system, quantity)
                found[name] = np.asarray(
                    formula(*(states[part] for part in inspect.signature(formula).parameters))
                )
            elif len(t):
                found[name] = self._of_function(
                    name, quantity, kind, t, states, run.bodies, compiled
                )
            else:
                found[name] = np.empty(0)
        return found

    def _of_function(
        self,
        name: str,
        function: Any,
        kind: Any,
        t: np.ndarray,
        states: dict[str, np.ndarray],
        bodies: int | None,
        compiled: Any,
    ) -> np.ndarray:
        """A function of time and state at every sample."""
        lead, at = ((len(t),), (0,)) if bodies is None else ((len(t), bodies), (0, 0))
        first = kind(
            *[
                small(states[f.name][at]) if f.name in states else None
                for f in dataclasses.fields(kind)
            ]
        )
        result = self._result(name, function, float(np.ravel(t)[0]), first)
        parts = {part: states[part] for part in first.arrays}
        rows = np.column_stack(
            [flat(parts, math.prod(lead)), t.ravel() if t.ndim == 2 else np.repeat(t, bodies or 1)]
        )
        arguments = function, layout_of(first), layout_of(result)
        what = f"record={name!r}", lambda k: f"at t = {rows[k, -1]:g}"
        numbers = evaluated(observe, arguments, rows, np.size(result), compiled, what)
        return numbers.reshape(*lead, *np.shape(result))

    def _result(self, name: str, function: Any, t: float, state: Any) -> Any:
        """What the function gives for the first sample."""
        result = attempt(function, t, state)
        if hasattr(result, "error"):
            error: Any = reason(result)
            raise (
                error if is_mistake(error) else failure(error, f"record={name!r}", f"at t = {t:g}")
            )
        if layout_of(result).kind not in PLAIN or np.array(result).dtype != float:
            raise InvalidType(
                f"integrate: record={name!r} gives a number (a float), a liemech.vec(...) or a "
                f"liemech.mat(...); got {result!r}"
            )
        return result

    def presented(self, run: Any, kind: type, compiled: Any) -> Any:
        """A run that kept the states, with what is to be kept instead."""
        own: dict[str, Any] = {"observed": tuple(self.quantities), "dense": None}
        try:
            kept = self.values(run, kind, run.t, run.states, compiled)
        except (Exception, IntegrationInterrupted) as caught:
            error: Any = caught
            n, kept = error.kept
            own |= {"t": run.t[:n], "states": kept, "carry": None}
            if isinstance(run, TransformedTrajectory):
                own |= {"tau": run.tau[:n], "z": None if run.z is None else run.z[:n]}
            error.trajectory = dataclasses.replace(run, **own)
            raise
        return dataclasses.replace(run, states=kept, **own)

    def instead(self, make: Callable[[], Any], kind: type, compiled: Any) -> Any:
        """The same of a run to be made, which may fail."""
        try:
            run = make()
        except BaseException as caught:
            error: Any = caught
            run = getattr(error, "trajectory", None)
            if isinstance(run, Trajectory) and not run.observed:
                error.trajectory = self.presented(run, kind, compiled)
            raise
        return self.presented(run, kind, compiled)

    # ---------------------------------------------------------------- fixed steps

    def fixed(
        self, plan: Steps, start: Any, steps: int, t0: float, checkpoint: Checkpoint | None
    ) -> Trajectory:
        """A run with fixed steps, in parts of which each goes on where the one before
        stands, to the bit.
        """
        return _RecordedRun(self, plan, start, steps, t0, checkpoint).trajectory()


class _Part(FixedRun):
    """A part of a run: only the last one warns of bodies that stopped."""

    final = True

    def _result(self, steps: int) -> Trajectory:
        return super()._result(steps) if self.final else self._so_far(steps)


class _RecordedRun:
    """One run in parts."""

    def __init__(
        self,
        recorder: Recorder,
        plan: Steps,
        start: State | Carry,
        steps: int,
        t0: float,
        checkpoint: Checkpoint | None,
    ) -> None:
        self.recorder, self.plan, self.steps, self.checkpoint = recorder, plan, steps, checkpoint
        self.now, self.t0, self.done = start, t0, 0
        self.before = start.step if isinstance(start, Carry) else 0
        self.kind: Any = type(start.state if isinstance(start, Carry) else start)
        # times, and what is kept of the samples then
        self.kept: list[tuple[np.ndarray, dict[str, np.ndarray]]] = []
        self.part: Trajectory | None = None
        count = start.bodies or 1
        self.longest = max(
            1, min(max(STEPS // count, plan.every), max(1, SAMPLES // count) * plan.every)
        )

    def trajectory(self) -> Trajectory:
        """Part after part, to the end."""
        try:
            return self._trajectory()
        except IntegrationInterrupted:
            raise
        except KeyboardInterrupt:
            if self.part is None:
                raise
            stopped: Any = IntegrationInterrupted(
                f"integrate: interrupted after {self.done} of {self.steps} steps; "
                f"{self.samples} samples are in `.trajectory`"
            )
            stopped.trajectory = self._made(dataclasses.replace(self.part, carry=None))
            raise stopped from None

    def _trajectory(self) -> Trajectory:
        inner, bodies = dataclasses.replace(self.plan, progress=False), self.now.bodies
        with Bar(self.plan.progress, self.steps * (bodies or 1)) as bar:
            while True:
                n = min(self.longest, self.steps - self.done)
                if self.checkpoint is not None:
                    n = self.checkpoint.within(n)
                run = _Part(inner, self.now, n, self.t0)
                run.whole, run.earlier = self.steps - self.done, self.samples
                run.final = self.done + n == self.steps
                try:
                    part = run.trajectory()
                except (Exception, IntegrationInterrupted) as caught:
                    error: Any = caught
                    if getattr(error, "trajectory", None) is None:
                        raise
                    self._keep(error.trajectory, error.trajectory.steps)
                    error.trajectory = self._made(error.trajectory)
                    raise
                self._keep(part, n)
                bar.advance(n * (bodies or 1))
                if part.carry is None and self.done < self.steps:
                    FixedRun._result(run, n)  # warns
                    self._stay(part)
                if self.done == self.steps:
                    return self._made(part)
                self.now = part.carry
                if self.checkpoint is not None and self.checkpoint.due(n):
                    self.checkpoint.save(self._made(part))

    @property
    def samples(self) -> int:
        """How many there are."""
        return sum(len(t) for t, _ in self.kept)

    def _keep(self, part: Trajectory, steps: int) -> None:
        """Keep what is to be kept of a part: its first sample is the last one of the part before,
        its last one perhaps none.
        """
        done = self.done + steps
        extra = (
            done < self.steps
            and (self.before + done) % self.plan.every > 0
            and part.carry is not None
        )
        here = slice(1 if self.kept else 0, len(part) - 1 if steps and extra else len(part))
        self._add(part, part.t[here], {name: x[here] for name, x in part.states.items()})
        self.part, self.done = part, done

    def _stay(self, part: Trajectory) -> None:
        """All bodies have stopped: their last states are those of all samples to come."""
        numbers = np.arange(self.before + self.done + 1, self.before + self.steps + 1)
        numbers = numbers[(numbers % self.plan.every == 0) | (numbers == self.before + self.steps)]
        t0 = self.now.t0 if isinstance(self.now, Carry) else self.t0
        last = times(t0, numbers, self.plan.h)
        self._add(
            part,
            last,
            {name: np.repeat(x[-1:], len(numbers), axis=0) for name, x in part.states.items()},
        )
        self.done = self.steps

    def _add(self, part: Trajectory, t: np.ndarray, states: dict[str, np.ndarray]) -> None:
        if not len(t):
            return
        try:
            kept = self.recorder.values(part, self.kind, t, states, self.plan.compiled)
        except (Exception, IntegrationInterrupted) as caught:
            error: Any = caught
            n, some = error.kept
            self.kept.append((t[:n], some))
            error.trajectory = self._made(dataclasses.replace(part, carry=None))
            raise
        self.kept.append((t, kept))

    def _made(self, part: Trajectory) -> Trajectory:
        """The run so far, as which its last part ends."""
        names = self.recorder.names
        states = {
            name: np.concatenate([kept[name] for _, kept in self.kept])
            for name in names
            if self.kept
        }
        t = np.concatenate([t for t, _ in self.kept]) if self.kept else np.empty(0)
        return dataclasses.replace(
            part, t=t, states=states, steps=self.done, observed=tuple(self.recorder.quantities)
        )


# ------------------------------------------------------------------ what a user asks for


def recorder_of(record: Any, system: Any) -> Recorder | None:
    """What is to be kept, if there is more among it than parts of the state.

    record : names of parts of the state and of methods of the system, functions of time and state,
    pairs of a name and such a function.
    """
    items = (
        (record,)
        if isinstance(record, str) or callable(record)
        else record
        if isinstance(record, tuple)
        else ()
    )
    parts: list[str] = []
    quantities: dict[str, Any] = {}
    for item in items:
        name, wanted = item if isinstance(item, tuple) and len(item) == 2 else (item, item)
        if isinstance(wanted, str):
            known = inspect.ismethod(getattr(system, wanted, None)) and wanted not in (
                "state",
                "constants",
            )
            if known:
                quantities[name] = wanted
            else:
                parts.append(wanted)
            continue
        if not callable(wanted):
            return None  # to be refused with the parts there are
        if not isinstance(name, str):
            name = (
                type(wanted).__name__
                if isinstance(wanted, Record)
                else getattr(wanted, "__name__", "")
            )
        if not name.isidentifier():
            raise InvalidInput(
                f'integrate: record has a function without a name, {wanted!r}; give it one: record=[("name", function), ...]'
            )
        quantities[name] = wanted
    for name in quantities:
        reserved = name in Trajectory.__dataclass_fields__ or (
            hasattr(Trajectory, name) and name not in COMPUTED
        )
        if reserved or [*parts, *quantities].count(name) > 1:
            raise InvalidInput(
                f"integrate: record: {name!r} is the name of something else of a run; give another "
                "one: [(name, function), ...]"
            )
    return Recorder(tuple(parts), quantities) if quantities else None
