"""One run with adaptive steps: its rows, its dense output and events, its failures."""

from __future__ import annotations

import dataclasses
import functools
import math
import struct
import time
from array import array
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np

from ..compiler.driver import accepted, attempt, itself, reason
from ..errors import (
    IntegrationFailure,
    IntegrationInterrupted,
    InvalidInput,
    StepTooSmall,
    failure,
    is_mistake,
)
from ..formulas.pytree import build, gatherer, layout_of
from ..integrators.ending_at_jumps import MARGIN, jumps_between, same
from ..systems.system import State
from . import arguments
from .adaptive import (
    ASKED,
    CLOCK,
    FRESH,
    MARK,
    REJECTED,
    STEP,
    STUCK,
    TAKEN,
    TIME,
    adaptive_steps,
    go_on,
    noted,
)
from .carry import AdaptiveCarry
from .checkpoint import Checkpoint
from .dense import DenseOutput, unpacked
from .events import Event, Watch, name_of
from .execution import LOOK, Execution, numbers_of
from .first_piece import FirstPiece, first_piece
from .prepared import Prepared
from .progress import Bar
from .sampled import SAMPLES, at_start, between, sampled_steps
from .trajectory import Trajectory

ROOM = 512
"""Steps between two looks at the keyboard and the events."""

LARGE = 2**20
"""Numbers of rows that are moved where they are, if they must be, and not copied."""


class Laid(Prepared):
    """How adaptive steps are laid out, of one body, by a `Shape`, or of many."""

    def lay_out(self, method: Any, example: State, xi: Any, curves: bool) -> None:
        """From a state and its velocity."""
        self.example, self.curves = example, curves
        self.state, self.layout = layout_of(example), layout_of((example, xi))
        self.row = layout_of((0.0, example, (xi,) * method.curve_terms if curves else ()))


@dataclasses.dataclass(frozen=True, eq=False)
class AdaptiveSteps:
    """Adaptive steps: what a plan was told of them.  h : the first step, None to find it;
    longest : the longest one.
    """

    system: Any
    method: Any
    h: float | None
    rtol: float
    atol: float
    longest: float
    breaks: tuple[float, ...]
    dense: bool | None
    compiled: bool | None
    progress: bool | None
    shapes: dict[Any, Shape] = dataclasses.field(default_factory=dict, repr=False)

    def owns(self, shape: Any) -> bool:
        """Is the shape one of this plan?"""
        return shape in self.shapes.values()

    def of_system(self, system: Any) -> AdaptiveSteps:
        """The same for a system of the same layout; what is laid out and compiled is shared."""
        return dataclasses.replace(
            self, system=system, shapes={k: s.of_system(system) for k, s in [*self.shapes.items()]}
        )

    @classmethod
    def checked(
        cls,
        system: Any,
        method: Any,
        h: Any,
        rtol: Any,
        atol: Any,
        longest: Any,
        breaks: Any,
        dense: Any,
        compiled: Any,
        progress: Any,
    ) -> AdaptiveSteps:
        """From what a user gave."""
        tolerances = (
            arguments.tolerance(rtol, "rtol", arguments.RTOL),
            arguments.tolerance(atol, "atol", arguments.ATOL),
        )
        longest = arguments.longest(longest)
        first = None if h is None else arguments.step(h)
        return cls(system, method, first, *tolerances, longest, breaks, dense, compiled, progress)

    def first(self, t0: float, t_end: float) -> float:
        """The first step, signed; zero if it is to be found."""
        return 0.0 if self.h is None else math.copysign(self.h, t_end - t0)

    def jumps(self, t0: float, t_end: float) -> tuple[float, ...]:
        """The times at which the velocity jumps: those that a user has named, and those of tables."""
        return jumps_between(self.method, self.system, self.breaks, t0, t_end)

    def begun(self, t: np.ndarray) -> np.ndarray:
        """The times at which the steps to t[1:] begin: where the velocity jumps, beyond that."""
        begun = t[:-1].copy()
        t0, t_end = float(t[0]), float(t[-1])
        start, ways = stretches(self.jumps(t0, t_end), t0, t_end)
        for end, beyond in ((t0, start), *ways):
            begun[begun == end] = beyond
        return begun

    def run(
        self,
        start: Any,
        t0: float,
        t_end: Any,
        limit: Any,
        t_eval: Any,
        events: tuple[Event, ...],
        kept: Checkpoint | None = None,
        recorder: Any = None,
    ) -> Trajectory:
        """From a start, or from where another run stands, to t_end."""
        if t_end is None:
            raise InvalidInput(
                "integrate: adaptive steps need a t_end; for steps of one length give h and steps"
            )
        limit = arguments.MOST if limit is None else arguments.count(limit, "steps", 1)
        t_end = arguments.real(t_end, "t_end")
        times = arguments.times(t_eval, t0, t_end)
        if recorder is not None and self.dense:
            raise InvalidInput(
                "integrate: dense=True keeps the states; record no functions of them"
            )
        first = None
        if not (events or self.jumps(t0, t_end) or kept or recorder or self.progress) and (
            times is None or not self.dense
        ):
            first = first_piece(self, start, t0, t_end, times, limit)
            if first is not None and first.complete:
                return first.trajectory()
        return AdaptiveRun(
            self, start, t0, t_end, limit, times, events, kept, recorder, first
        ).trajectory()


class Shape(Laid):
    """The layouts of a run, and the code that makes its steps.

    example : a state.  layout : of state and velocity; row : of time, state and the way to it.
    curves : is the way there?  sampled : does native code find the states at times, too?
    clock, kept : how many bytes lie before the clock in the memory of a first piece, and how many
    numbers before what is kept.  before : of the latter, those before the states at times.
    """

    def __init__(
        self, plan: AdaptiveSteps, start: State, xi: Any, curves: bool, sampled: bool
    ) -> None:
        method, system = plan.method, plan.system
        self.lay_out(method, start, xi, curves)
        self.constants = numbers_of(method, system)
        self.arguments = method, system, self.layout, self.row
        none = np.empty(0)
        call: Any = adaptive_steps, *self.arguments, *[0.0] * 4, curves, 1, none, none, none, None
        if sampled:
            call = sampled_steps, *self.arguments, *[0.0] * 4, curves, 1, 1, *[none] * 6, None
        self.stepping = Execution(plan.compiled, plan.progress, *call)
        carried, width, row = self.layout.width, self.state.width, self.row.width
        self.gather, self.rest = gatherer(self.state), (0.0,) * (carried - width)
        self.no_curve = (0.0,) * (row - 1 - width)
        self.clock, self.kept = 8 * carried, carried + CLOCK.width
        self.before = SAMPLES.width + row + 1 + width
        self.begun = struct.Struct(f"{self.kept + (0 if sampled else row)}d")
        self.call = struct.Struct(f"{11 if sampled else 7}q{len(self.constants)}s4d").pack


def velocity(system: Any, t: float, state: Any) -> Any:
    """The velocity at a start, as `attempt` gives it: not a number if it is complex, as a power of
    a negative number is.
    """
    xi = attempt(system.rate, t, system.essential_part(state))
    return math.nan if accepted(xi, itself) and any(type(x) is complex for x in xi) else xi


def stretches(
    breaks: tuple[float, ...], t0: float, t_end: float
) -> tuple[float, list[tuple[float, float]]]:
    """Where steps begin, to which times they lead, and where they go on: from jump to jump of the
    velocity, to the end.
    """
    if t0 == t_end:
        return t0, []
    sign = math.copysign(MARGIN, t_end - t0)
    start, ways, before = t0, [], t0  # type: float, list[tuple[float, float]], float
    inside = [b for b in breaks if min(t0, t_end) <= b <= max(t0, t_end)]
    for b in inside if t_end > t0 else inside[::-1]:
        if same(b, t0):  # there is nothing between them
            start = b + sign * float(np.spacing(abs(b)))
            continue
        # times of stages are rounded as those of the step are
        ahead = sign * float(np.spacing(max(abs(b), abs(before))))
        last = same(b, t_end)
        ways.append((b - ahead, t_end if last else b + sign * float(np.spacing(abs(b)))))
        before = b
    if not ways or ways[-1][1] != t_end:
        ways.append((t_end, t_end))
    return start, ways


def cut(row: np.ndarray, begun: float, at: float, numbers: np.ndarray, dim: int) -> None:
    """Let the step of a row, from the time `begun` on, end inside: at this time, in a state of these
    numbers.  dim : of the displacements that the way there is made of.
    """
    width = len(numbers)
    curve = row[1 + width :].reshape(-1, dim)
    powers = ((at - begun) / (row[0] - begun)) ** np.arange(1, len(curve) + 1)
    row[0], row[1 : 1 + width] = at, numbers
    row[1 + width :] = (curve * powers[:, None]).ravel()


def watched(
    events: tuple[Event, ...], ended: Callable[[Any], Any], t0: float, start: Any, state: Any
) -> Watch:
    """Watches events from a start, or from where another run stands: a zero that ended that one is
    none of this one.
    """
    carry = start if isinstance(start, AdaptiveCarry) else None
    watch = Watch(events, ended, t0, state, None if carry is None else carry.met)
    if carry is not None and carry.ended is not None and carry.ended < len(events):
        known = [name for name, _ in carry.met] or [name_of(event) for event in events]
        if known[carry.ended] == name_of(events[carry.ended]):
            watch.values[carry.ended] = 0.0
    return watch


class AdaptiveRun:
    """One motion to a last time."""

    def __init__(
        self,
        plan: AdaptiveSteps,
        start: State | AdaptiveCarry,
        t0: float,
        t_end: float,
        limit: int,
        t_eval: np.ndarray | None,
        events: tuple[Event, ...],
        checkpoint: Checkpoint | None = None,
        recorder: Any = None,
        first: FirstPiece | None = None,
    ) -> None:
        self.recorder = recorder
        # times, and what it kept of the samples then
        self.told: list[tuple[np.ndarray, dict[str, np.ndarray]]] = []
        self.plan, self.system, self.method, self.t0, self.t_end = (
            plan,
            plan.system,
            plan.method,
            t0,
            t_end,
        )
        self.limit, self.t_eval, self.events, self.checkpoint = limit, t_eval, events, checkpoint
        self.failures: list[Exception] = []
        # all rows, or only what is asked for
        self.kept = plan.dense is True or (t_eval is None and recorder is None)
        dense = plan.dense is True or (plan.dense is None and t_eval is None and recorder is None)
        self.dense = dense
        curves = dense or bool(events) or (t_eval is not None and between(t_eval, t0, t_end))
        # are the states at the times found in native code?
        self.at_times = t_eval is not None and not (self.kept or events or recorder)
        self.start = start.state if isinstance(start, AdaptiveCarry) else start
        self.shape = shape = self._shape(curves)
        self.width = shape.state.width
        self.compiled = False
        self.rows = np.empty((8, shape.row.width))  # the start, and after every step one more
        self.rows[0] = 0.0
        self.rows[0, : 1 + self.width] = [t0, *gatherer(shape.state)(self.start)]
        self.filled = 1
        self.sampled: list[np.ndarray] = []
        self.found: np.ndarray | None = None  # room for them, of native code
        self.asked = 0  # how many of t_eval are reached
        if isinstance(start, AdaptiveCarry):
            self.states, self.clock = start.taken_up(t_end, shape.layout.width)
        else:
            self.states = np.zeros(shape.layout.width)
            self.states[: self.width] = self.rows[0, 1 : 1 + self.width]
            self.clock = np.array([t0, plan.first(t0, t_end), *FRESH])
        if first is not None:
            first.handed_over(self)
        # steps at whose events one is looking: their first row, to where they lead, and what was
        # carried along before them
        self.looking: tuple[int, float, np.ndarray, np.ndarray] | None = None
        self.watch: Any = None
        self.watch = watched(events, self._ended, t0, start, self.start)

    def _shape(self, curves: bool) -> Shape:
        """The layouts of this run, from other runs of the plan if their starts were like this one."""
        given = layout_of(self.start)
        key = given, curves, self.at_times
        shape = self.plan.shapes.get(key)
        if shape is None or self.t0 == self.t_end:  # else the steps will find it out
            xi = velocity(self.system, self.t0, self.start)
            if not accepted(xi, itself):
                raise self._not_begun(reason(xi))
        if shape is None:
            shape = self.plan.shapes[key] = Shape(self.plan, self.start, xi, *key[1:])
        else:
            shape.stepping.refresh()
        return shape

    def _not_begun(self, error: Any) -> Any:
        """The error of a run whose start has no velocity."""
        raised = (
            error
            if is_mistake(error)
            else failure(error, repr(self.method), f"at the start, t = {self.t0:g}")
        )
        n = 1 if self.t_eval is None else at_start(self.t_eval, self.t0)
        states = {name: x[None].repeat(n, axis=0) for name, x in self.start.arrays.items()}
        raised.trajectory = Trajectory(
            self.system, self.method, 0.0, np.full(n, self.t0), states, None, 0
        )
        return raised

    # ---------------------------------------------------------------- stepping

    def trajectory(self) -> Trajectory:
        """Step to the end, or to a terminal event, in pieces short enough to show progress and to
        be interrupted.
        """
        try:
            if not self.kept:
                self._sample(1 if self.recorder is None or self.t_eval is not None else 0)
            with Bar(self.plan.progress, 1000, "") as bar:
                start, ways = stretches(self.plan.jumps(self.t0, self.t_end), self.t0, self.t_end)
                if start != self.t0:
                    go_on(self.clock, start)
                for end, beyond in ways:
                    if self._stepped(end, bar):
                        break
                    if end != beyond:
                        go_on(self.clock, beyond)
                        if beyond == self.t_end:
                            self._arrived()
        except IntegrationInterrupted:
            raise
        except KeyboardInterrupt:
            stopped = IntegrationInterrupted(
                f"integrate: interrupted at t = {self.clock[TIME]:g}, after {int(self.clock[TAKEN])} "
                "steps; the samples are in `.trajectory`"
            )
            raise self._ended(stopped) from None
        if self.kept and len(self.rows) > self.filled:
            self.rows.resize((self.filled, self.rows.shape[1]), refcheck=False)
        return self._result()

    def _arrived(self) -> None:
        """At a t_end where the velocity jumps, which steps keep away from: their last state is
        that at t_end.
        """
        self.rows[self.filled - 1, 0] = self.t_end
        if self.kept:
            return
        if self.t_eval is None:
            self.told[-1][0][-1] = self.t_end
            return
        left = len(self.t_eval) - self.asked
        last = self.rows[self.filled - 1 : self.filled, 1 : 1 + self.width]
        self._keep_states(self.t_eval[self.asked :], last.repeat(left, axis=0))

    def _stepped(self, end: float, bar: Bar) -> bool:
        """Steps to this time; did a terminal event end the run?"""
        room = 8
        while self.clock[TIME] != end:
            begun = time.perf_counter()
            before, taken = self.filled, self.clock[TAKEN]
            there = (self.states.copy(), self.clock.copy()) if self.events else None
            self._more(end, room if self.shape.stepping.native is None else ROOM)
            if time.perf_counter() - begun < 0.5 * LOOK:
                room = min(2 * room, ROOM)
            bar.advance(int(1000 * self._part()) - bar.done)
            ended = there is not None and self._terminated(before, end, *there)
            if not self.kept:
                self._sample(before)
            more = int(self.clock[TAKEN] - taken)
            if self.checkpoint is not None and self.checkpoint.due(more):
                self.checkpoint.save(self._result())
            if ended:
                return True
            if self.clock[TIME] == end:
                break
            if self.clock[MARK] == STUCK:
                raise self._failure()
            if self.clock[TAKEN] >= self.limit:
                raise self._unfinished()
        return False

    def _part(self) -> float:
        """How much of the run is done."""
        return float((self.clock[TIME] - self.t0) / (self.t_end - self.t0))

    def _more(self, end: float, room: int) -> None:
        """Up to this many more steps; one in plain Python where native code has asked for it."""
        native = self.clock[MARK] != ASKED
        room = min(room if native else 1, int(self.limit - self.clock[TAKEN]))
        if self.checkpoint is not None:
            room = self.checkpoint.within(room)
        if self.at_times:
            self._more_at_times(end, room, native)
            return
        if self.filled + room > len(self.rows):
            wanted = max(len(self.rows) + len(self.rows) // 4, self.filled + room)
            self._make_room(wanted)
        before = int(self.clock[TAKEN])
        native = native and self.shape.stepping.ready(self._part())
        arrays = self.states, self.clock, self.rows[self.filled :].reshape(-1)
        self._drive(adaptive_steps, native, end, (room,), arrays)
        self.filled += int(self.clock[TAKEN]) - before

    def _drive(
        self, driver: Callable[..., None], native: bool, end: float, counts: tuple[int, ...],
        arrays: tuple[np.ndarray, ...],
    ) -> None:  # fmt: skip
        """Run a driver of steps, or the native code of it."""
        plan, shape = self.plan, self.shape
        numbers = end, plan.rtol, plan.atol, plan.longest
        if native:
            code: Any = shape.stepping.native
            self.compiled = True
            code.run(shape.constants + array("d", numbers).tobytes(), counts, arrays)
        else:
            with shape.stepping.plain():
                driver(*shape.arguments, *numbers, shape.curves, *counts, *arrays, self.failures)

    def _more_at_times(self, end: float, room: int, native: bool) -> None:
        """The same, and the states at the times they pass: of the rows only the last, and the state
        before.
        """
        row, all_times = self.shape.row.width, self.t_eval
        if self.found is None:
            self.found = np.empty((len(all_times), self.width))  # type: ignore[arg-type]
        times, samples = all_times[self.asked :], self.found[self.asked :]  # type: ignore[index]
        out, done = np.empty(row + 1 + self.width), np.empty(2)
        out[row] = self.rows[self.filled - 1, 0]
        states, clock = self.states.copy(), self.clock.copy()
        arrays = states, clock, out, times, samples.reshape(-1), done
        native = native and self.shape.stepping.ready(self._part())
        self._drive(sampled_steps, native, end, (room, len(times)), arrays)
        if clock[TAKEN] > self.clock[TAKEN]:
            self.rows[0, : 1 + self.width], self.rows[1] = out[row:], out[:row]
            self.filled = 2
        written = int(done[0])
        self.states, self.clock, self.asked = states, clock, self.asked + written
        if written:
            self.sampled.append(samples[:written])

    def _make_room(self, wanted: int) -> None:
        """So many rows, of which as few as possible are touched."""
        rows = self.rows
        if rows.size < LARGE:
            self.rows = np.empty((wanted, rows.shape[1]))
            self.rows[: self.filled] = rows[: self.filled]
        else:  # nobody looks at them between two pieces
            rows.resize((wanted, rows.shape[1]), refcheck=False)

    def _sample(self, before: int) -> None:
        """Keep the states that t_eval asks for in the last steps, and of the steps only the last."""
        times: Any = self.t_eval
        if times is None:
            self._tell(
                self.rows[before : self.filled, 0],
                self.rows[before : self.filled, 1 : 1 + self.width],
            )
        else:
            self._at_times(before, times)
        self.rows[0] = self.rows[self.filled - 1]
        self.filled = 1

    def _tell(self, times: np.ndarray, numbers: np.ndarray) -> None:
        """Keep what the recorder keeps of some samples."""
        try:
            self.told.append((times.copy(), self._recorded(times, numbers)))
        except (Exception, IntegrationInterrupted) as caught:
            error: Any = caught
            n, kept = error.kept
            self.told.append((times[:n].copy(), kept))
            raise self._ended(error, goes_on=False) from error.__cause__

    def _recorded(self, times: np.ndarray, numbers: np.ndarray) -> dict[str, np.ndarray]:
        """What the recorder keeps of samples."""
        states = unpacked(self.shape.state, numbers.copy())
        run = SimpleNamespace(system=self.system, bodies=None)
        given = run, type(self.shape.example), times, states, self.plan.compiled
        kept: dict[str, np.ndarray] = self.recorder.values(*given)
        return kept

    def _at_times(self, before: int, times: np.ndarray) -> None:
        """Keep the states that t_eval asks for in the last steps."""
        reached, left = self.clock[TIME], times[self.asked :]
        inside = left[left <= reached if self.t_end >= self.t0 else left >= reached]
        if len(inside):
            last = self.rows[self.filled - 1]
            states = (
                last[None, 1 : 1 + self.width].repeat(len(inside), axis=0)
                if inside.item(0) == last.item(0)
                else self._dense(before - 1).within(inside)
            )
            self._keep_states(inside, states)

    def _keep_states(self, times: np.ndarray, states: np.ndarray) -> None:
        """Keep the states at some times that t_eval asks for, or what the recorder keeps of them."""
        self.asked += len(times)
        if not len(times):
            return
        if self.recorder is None:
            self.sampled.append(states)
        else:
            self._tell(times, states)

    def _terminated(self, before: int, end: float, states: np.ndarray, clock: np.ndarray) -> bool:
        """Look for events in the last steps, and end the run at the first terminal one.

        states, clock : what was carried along before these steps.
        """
        self.looking = before, end, states, clock
        hit = self.watch.look(self._dense(before - 1))
        if hit is None:
            self.looking = None
            return False
        k, at, numbers = hit
        self.watch.looked = k
        self._again(end, states.copy(), clock.copy(), k + 1)
        self.looking = None
        row, begun = self.rows[before + k], self.rows[before + k - 1, 0]
        cut(row, begun, at, numbers, self.system.group.dim)
        self.filled, self.clock[MARK] = before + k + 1, 0.0
        go_on(self.clock, at)
        return True

    def _again(self, end: float, states: np.ndarray, clock: np.ndarray, steps: int) -> None:
        """So many of the last steps once more, from what was carried along before them: those beyond
        do not count, nor what became of them.
        """
        if steps:
            native = clock[MARK] != ASKED and self.shape.stepping.native is not None
            rows = np.empty((steps, self.rows.shape[1]))
            arrays = states, clock, rows.reshape(-1)
            self._drive(adaptive_steps, native, end, (steps,), arrays)
        self.states, self.clock = states, clock

    def _unlooked(self) -> None:
        """Leave out the steps at whose events nobody has looked: an event has failed, or Ctrl-C."""
        if self.looking is None:
            return
        before, end, states, clock = self.looking
        self.looking = None
        self._again(end, states, clock, self.watch.looked)
        self.filled = before + self.watch.looked
        self.watch.forget(float(self.rows[self.filled - 1, 0]), self.t_end - self.t0, False)
        if not self.kept:
            self._sample(before)

    # ---------------------------------------------------------------- results

    def _dense(self, first: int = 0) -> DenseOutput:
        """The continuous motion along the rows from this one on."""
        rows = self.rows[first : self.filled]
        method, example = self.method, self.shape.example
        return DenseOutput(
            self.system, method.retraction, example, rows, method.dense_order, self.plan.compiled
        )

    def _result(self) -> Trajectory:
        reached, steps = float(self.clock[TIME]), int(self.clock[TAKEN])
        dense = self._dense() if self.kept and self.shape.curves else None
        kept = dense if self.dense else None
        # samples may be written to, and the last row is needed for the carry
        last = self.rows[self.filled - 1].copy()
        made: list[Any] = []

        def samples() -> Any:
            if not made:
                made.append(self._samples(dense))
            return made[0]

        return Trajectory.promised(
            SimpleNamespace(
                t=lambda: samples()[0],
                states=lambda: samples()[1],
                carry=functools.partial(self._carry, last),
            ),
            system=self.system,
            method=self.method,
            h=(reached - self.t0) / max(1, steps),
            bodies=None,
            steps=steps,
            compiled=self.compiled,
            rejected=int(self.clock[REJECTED]),
            dense=kept,
            events=self.watch.shown(self.shape.example, self.shape.state) if self.watch else (),
            ended=self.watch.ended if self.watch else None,
            stopped={},
            observed=() if self.recorder is None else tuple(self.recorder.quantities),
        )

    def _carry(self, last: np.ndarray) -> AdaptiveCarry | None:
        """What to go on with from the last row: all of it, or after a terminal event a start anew."""
        numbers, clock = self.states.copy(), self.clock.copy()
        if self.watch is None or clock[MARK] == STUCK or clock[TIME] != last[0]:
            return None
        if self.watch.ended is not None:
            numbers[: self.width] = last[1 : 1 + self.width]
        state = build(self.shape.state, iter(last[1 : 1 + self.width].tolist()))
        own = self.watch.ended, self.watch.met
        return AdaptiveCarry(numbers, clock, state, float(clock[TIME]), *own)

    def _samples(self, dense: DenseOutput | None) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Times and parts of the state."""
        if self.recorder is not None:
            told = [one for one in self.told if len(one[0])]
            if not told:
                none = np.empty(0)
                told = [(none, self._recorded(none, np.empty((0, self.width))))]
            joined = {
                name: np.concatenate([kept[name] for _, kept in told])
                for name in self.recorder.names
            }
            return np.concatenate([t for t, _ in told]), joined
        if self.t_eval is None:
            times, numbers = (
                self.rows[: self.filled, 0],
                self.rows[: self.filled, 1 : 1 + self.width],
            )
        elif dense is not None:
            times = self.t_eval[np.abs(self.t_eval - self.t0) <= abs(dense.t[-1] - self.t0)]
            numbers = dense.numbers(times)
        else:
            numbers = np.concatenate([np.empty((0, self.width)), *self.sampled])
            times = self.t_eval[: len(numbers)]
        return times, unpacked(self.shape.state, numbers)

    def failed(self, states: np.ndarray, clock: np.ndarray, samples: np.ndarray) -> Exception:
        """Why a run ended that native code has led so far, beside others."""
        self.states, self.clock, self.compiled = states, clock, True
        self.rows[0, 0], self.rows[0, 1 : 1 + self.width] = clock[TIME], states[: self.width]
        self.sampled = [samples]
        return self._failure() if clock[MARK] == STUCK else self._unfinished()

    def _unfinished(self) -> Exception:
        """Why a run ended that has made all its steps."""
        told = f"{self.limit} steps led to t = {self.clock[TIME]:g} only, not to {self.t_end:g}"
        return self._ended(
            StepTooSmall(f"integrate: {told}; loosen rtol and atol or allow more `steps`")
        )

    def _failure(self) -> Exception:
        """Why the steps became too small to go on: what the last trial had to say.  A mistake in a
        formula is raised itself.
        """
        t, h = float(self.clock[TIME]), float(self.clock[STEP])
        state, xi = build(self.shape.layout, iter(self.states.tolist()))
        if t == self.t0:
            first = velocity(self.system, t, state)
            if not accepted(first, itself):
                return self._not_begun(reason(first))
        # by the steps that led here: each was at most five times as long as the next
        raised: list[Exception] = []
        for longer in (1.0, 5.0, 25.0, 125.0):
            trial = attempt(
                self.method.trial,
                self.system,
                t,
                state,
                xi,
                longer * h,
                self.plan.rtol,
                self.plan.atol,
                False,
            )
            noted(raised, trial)
            if raised or not trial.error <= 1.0:
                break
        told = [*raised, *self.failures]
        error: Any = next((e for e in told if is_mistake(e)), told[0] if told else None)
        if is_mistake(error):
            error.add_note(
                f"[integrate: in step {int(self.clock[TAKEN]) + 1}, from t = {t:g}; the samples before "
                "it are in `.trajectory`]"
            )
            return self._ended(error)
        why = str(error)
        if error is None:
            why = f"the error estimate is {trial.error:.1e} of the tolerance even so"
            if not math.isfinite(trial.error):
                why = "the motion has no finite velocity there"
        elif not isinstance(error, ArithmeticError):
            why = f"{type(error).__name__}: {error}"
        made = StepTooSmall(
            f"{self.method!r}: at t = {t:g} the step fell to {abs(h):.1e}, too small to advance "
            f"the time: {why}. The motion may have a singularity there, or rtol = "
            f"{self.plan.rtol:g}, atol = {self.plan.atol:g} ask for more than rounding allows; "
            f"{int(self.clock[TAKEN])} steps are in `.trajectory`"
        )
        made.__cause__ = error
        return self._ended(made)

    def _ended(self, error: Any, goes_on: bool = True) -> Any:
        """An error with the samples so far; may the run go on from where it stands?"""
        self._unlooked()
        run = self._result()
        error.trajectory = run if goes_on else dataclasses.replace(run, carry=None)
        if isinstance(error, IntegrationFailure):
            error.reached = build(self.shape.state, iter(self.states[: self.width].tolist()))
        return error
