"""Events: zeros of functions of time and state, looked for in every step."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from inspect import ismethod
from typing import Any

import numpy as np

from ...errors import InvalidInput, InvalidType, StepTooSmall, warn
from ...formulas.classes.layouts import NUMBER, restricted
from ...formulas.numbers.sizes import EPSILON
from ...systems.lie_poisson import with_sites
from .. import arguments
from .dense import execution_of, natively, observe, packed
from .jump import Jump, left_behind, slope

Event = Callable[[float, Any], float]
"""A function of time and state, which knows nothing of the body: what each has of its own, such as the energy at its
start, belongs into `Events`, by body.
"""


def name_of(event: Any) -> str:
    """The name under which an event is counted in carries and in files."""
    return str(getattr(event, "__qualname__", type(event).__qualname__))


class Met(tuple[tuple[str, int], ...]):
    """For every event its name, and how many of its zeros count towards `terminal` in a run that goes on.

    events : these themselves, where they are still there; not in files, nor in other processes.
    """

    events: tuple[Event, ...] | None = None

    def __reduce__(self) -> Any:
        return Met, (tuple(self),)

    def counts(self, events: tuple[Event, ...]) -> list[int]:
        """Zeros that count for these events: none, if they are not the same.  Where only names are
        left, a name tells which event it is, but not that of a lambda.
        """
        names = [name_of(event) for event in events]
        if self.events is not None:
            pairs = zip(self.events, events, strict=False)
            same = all(a is b or (ismethod(a) and a == b) for a, b in pairs)
        else:
            same = [name for name, _ in self] == names and not any("<lambda>" in n for n in names)
        return [n for _, n in self] if same and len(self) == len(events) else [0] * len(events)


NO_EVENTS = Met()
"""The counts of a run without events."""


EARLY = 2.0**-10
"""The part of the way between two looks after which an event that is zero at the first of them has a sign."""

STEEP = 0.01
"""The change of an event in four units in the last place of the time, over that between two looks, which is a jump:
beyond eight times that of a straight line, which counts where looks are few such units apart.
"""

PORTION = 2**16
"""Looks that are taken together."""

ONE_TIME = 16.0 * EPSILON
"""Times that differ by this part of them are one, for zeros are found to four units in the last place."""

SIGN = 2.0**-1022
"""The size of an event in its zero, where it has a sign."""

Zero = tuple[int, float, int, np.ndarray]
"""In which step, when, of which event, and the numbers of the state then."""


class Watch:
    """The zeros of events along the motion of one body."""

    def __init__(self, events: tuple[Event, ...], values: list[Any], before: Met) -> None:
        self.events = events
        self.values = values  # by event, its value at the last state
        self.before = before.counts(events)  # by event, the number of zeros in the run before this one
        # by event, the times of its zeros and the numbers of the states, in the order of the motion
        self.zeros: list[list[tuple[float, np.ndarray]]] = [[] for _ in events]
        # of all zeros in the order of the motion the event, the time, and the end of the step in which it was looked for
        self.in_turn: list[tuple[int, float, float]] = []
        # by event, the number of zeros after which it ends the run; 0: it does not
        self.terminal = [int(getattr(event, "terminal", None) or 0) for event in events]
        self.ended: int | None = None  # the number of the event that has ended the run
        self.jumps = [isinstance(event, Jump) for event in events]
        self.since: Any = None  # of the look in which a jump was met the time where it began, and the values there
        self.jumped: dict[int, float] = {}  # by event, the time of its last jump

    def meet(self, zeros: Iterable[Zero], ends: np.ndarray) -> Zero | None:
        """Keep zeros in the order in which the motion meets them, up to a terminal one or a jump.  ends : of the steps."""
        for zero in zeros:
            step, at, i, numbers = zero
            self.zeros[i].append((at, numbers))
            self.in_turn.append((i, at, ends.item(step)))
            if self.before[i] + len(self.zeros[i]) == self.terminal[i]:
                self.ended = i
                return zero
            if self.jumps[i]:
                return zero
        return None

    def side_of(self, i: int, value: float, at: float) -> float:
        """The value of an event where another one jumps, with the sign that it had, if its zero there is still to come."""
        since, old = self.since
        side = old[i]
        for t, _ in self.zeros[i]:
            side = -side if t != since and min(since, at) <= t <= max(since, at) else side
        before = math.copysign(max(abs(value), SIGN), side)
        at_once = abs(at - since) <= ONE_TIME * abs(at)
        return before if side != 0.0 and (at_once or value == 0.0 or crossed(self.events[i], before, value)) else value

    def forget(self, t: float, sign: float, ended: bool) -> None:
        """Forget the zeros that were met after this time, to which the run was interrupted."""
        self.zeros = [[(at, x) for at, x in zeros if (at - t) * sign <= 0.0] for zeros in self.zeros]
        self.ended = self.ended if ended else None

    @property
    def met(self) -> Met:
        """Counts for a run that goes on; zero for the event that ended this one."""
        counts = [n + len(zeros) for n, zeros in zip(self.before, self.zeros, strict=True)]
        if self.ended is not None:
            counts[self.ended] = 0
        met = Met([(name_of(event), n) for event, n in zip(self.events, counts, strict=True)])
        met.events = self.events
        return met


def crossed(event: Event, old: Any, new: Any) -> Any:
    """Whether an event has a zero between two of its values, in its `direction`; a zero at the first is none."""
    direction = float(getattr(event, "direction", None) or 0.0)
    jump = float(getattr(event, "jumps_by", None) or 0.0)  # of angles: the way through zero is the shorter one
    zero = (np.minimum(old, new) <= 0.0) & (np.maximum(old, new) >= 0.0) & (old != 0.0)
    if jump:
        zero = zero & (abs(new - old) <= 0.5 * jump)
    return zero & (direction * (new - old) >= 0.0) if direction else zero


class Moving:
    """A run of bodies, or of one, as events ask for it: the motion inside of its steps; abstract.

    here : (1 + width, bodies) time and state of every body.  view : how its numbers are shown as states.
    over : bodies that had ended before.  sign : of the steps.  cuts : by body the event that has ended it.
    met_before : by body the zeros that the run before has met, and the event that has ended it.
    head : the numbers of a row that are time and state.  between : the motion inside of steps.
    """

    between: Any
    head: Any = slice(None)
    here: Any
    bodies: Any

    def ask(self, event: Event, t: float, state: Any) -> Any:
        """The value of an event of a state as the view has it."""
        return event(t, state)

    def refused(self, error: Any, body: int, t: float, state: Any) -> Any:
        """The error that an event has raised, with notes of where."""
        error.add_note(f"[integrate: in an event at t = {t:g}; the samples before it are in `.trajectory`]")
        if self.bodies:
            error.add_note(f"[integrate: body {body}]")
        without = ", ".join([name for name, x in state.parts.items() if x is None])
        if without:
            error.add_note(
                f"[integrate: this run moves without {without}, which events see as None; it needs it in the start, "
                "and beside what `record` names]"
            )
        return error

    @property
    def wide(self) -> int:
        """The count of numbers of a state that is kept."""
        return len(self.here) - 1

    def seen_at(self, piece: Any, step: np.ndarray, times: np.ndarray) -> Any:
        """The numbers of states that are kept of zeros, at times in steps."""
        return self.inside(piece, step, times)

    def inputs(self, piece: Any, step: np.ndarray, times: np.ndarray) -> Any:
        """Rows of numbers from which `moved` finds states at times inside of steps."""
        return self.between.inputs(piece.rows(step, before=True), piece.rows(step), times)

    def moved(self, inputs: np.ndarray, times: np.ndarray, body: np.ndarray) -> Any:
        """Numbers of states, (m, width), from the rows of `inputs`."""
        return self.between.moved(inputs, times, body)

    def looks(self, piece: Any, step: np.ndarray) -> Any:
        """Counts of looks into steps, (m,), such that none is more than a quarter of a turn from the last."""
        return self.between.looks(piece.rows(step, before=True), piece.rows(step), piece.body[step])

    def inside(self, piece: Any, step: np.ndarray, times: np.ndarray) -> Any:
        """The numbers of states at times in steps."""
        states = piece.rows(step)[:, self.head][:, 1:]
        before = times == piece.a[step]
        states[before] = piece.rows(step[before], before=True)[:, self.head][:, 1:]
        between = np.flatnonzero((times != piece.b[step]) & ~before)
        if len(between):
            steps = step[between]
            inputs = self.inputs(piece, steps, times[between])
            states[between] = self.moved(inputs, times[between], piece.body[steps])
        return states


class Events:
    """Observer of the zeros of functions of time and state, for all bodies of a run.

    run : `Moving`.  each : of every body its own watch.  blind, jumps : of events that were nan, and that jump over zero, the
    name, and the body and the time of the first one.  fresh : bodies that are still where their run begins.
    """

    def __init__(self, run: Any, events: tuple[Event, ...]) -> None:
        self.run, self.events, self.floats = run, events, True
        self.blind: dict[int, tuple[str, int, float]] = {}
        self.jumps: dict[int, tuple[str, int, float]] = {}
        self.each: dict[int, Watch] = {}
        self.noisy = run.plan._first_of("method").noisy
        met, cut = run.met_before
        for i in np.flatnonzero(~run.over).tolist():
            t, state = float(run.here[0, i]), run.view.small(run.here[1:, i])
            before, ended = met.get(i, NO_EVENTS), cut.get(i)
            values = [self._value(i, event, t, state) for event in events]
            if ended is not None and ended < len(events):  # a zero that ended that run is none of this
                names = [name for name, _ in before] or [name_of(event) for event in events]
                if names[ended] == name_of(events[ended]):
                    values[ended] = 0.0
            self.each[i] = Watch(events, values, before)
        self.fresh = {*self.each}
        layout, _ = run.view.seen(run.here[1:, :1].T)
        self.kernels = [
            execution_of(observe, (getattr(event, "when", event), layout, NUMBER), run.compiled_asked, silent=True)
            for event in (() if layout is None else events)
        ]

    def _value(self, body: int, event: Event, t: float, state: Any) -> Any:
        """The value of an event of body number `body`; errors that it raises get a note of where."""
        try:
            value = self.run.ask(event, t, state)
            self.floats = self.floats and type(value) is float
            try:
                number = float(value)
                if number != number:
                    self.blind.setdefault(id(event), (name_of(event), body, t))
                return number
            except TypeError:
                raise InvalidType(f"integrate: an event gives a number; {event!r} gave {value!r}") from None
        except Exception as error:
            raise self.run.refused(error, body, t, state) from error.__cause__

    # ---------------------------------------------------------------- the steps of a piece

    def see(self, piece: Any) -> dict[int, Zero]:
        """Look at some steps, which go on where the last ones ended: of bodies that a terminal event ends or
        that jump, the step in which they do, the time, the event, and the numbers of the state.

        What an event raises has `step`, the number of the step before which all is well.
        """
        if not len(piece):
            return {}
        hits: dict[int, Zero] = {}
        steps, starts = np.arange(len(piece)), np.flatnonzero(piece.begins)
        left = [(int(k), int(piece.body[k])) for k in steps[starts]]  # where plain Python begins, and with which body
        if self.floats and self.kernels and all([execution.ready(0.0) for execution, _ in self.kernels]):  # noqa: C419
            outcome = self._natively(piece)
            if outcome is not None:
                hits, left = outcome
        for k, body in left:
            if body in hits:
                continue
            with ExitStack() as stack:
                for execution, _ in self.kernels:
                    stack.enter_context(execution.plain())
                hit = self._plainly(piece, body, k)
            if hit is not None:
                hits[body] = hit
        return hits

    def _natively(self, piece: Any) -> Any:
        """Zeros in native code, and of bodies of which an event failed the first step where it did; None if there is
        nothing yet and an event fails on the way to a zero.
        """
        hits: dict[int, Zero] = {}
        left: dict[int, int] = {}
        try:
            counts = self.run.looks(piece, np.arange(len(piece)))
        except Exception:
            return None
        portion = np.cumsum(counts) // PORTION
        for steps in np.split(np.arange(len(piece)), np.flatnonzero(portion[1:] != portion[:-1]) + 1):
            bodies = piece.body[steps]
            if hits or left:
                steps = steps[~np.isin(bodies, [*hits, *left])]
            try:
                if len(steps):
                    self._portion(piece, steps, counts[steps], self._values, hits, left)
            except Exception:  # plain Python says why
                first = np.append(True, piece.body[steps[1:]] != piece.body[steps[:-1]])
                left |= {int(piece.body[k]): int(k) for k in steps[first]}
        return hits, [(k, body) for body, k in left.items()]

    def _portion(
        self, piece: Any, steps: np.ndarray, counts: np.ndarray, values: Any, hits: dict[int, Zero],
        left: dict[int, int] | None = None,
    ) -> None:  # fmt: skip
        """Zeros in some steps.  Where an event or a motion fails nothing has changed.

        values : finds those of events.  hits, left : what is added to: terminal zeros of bodies, and of those of which an
        event failed the step; None where a nan is a value, as in plain Python.
        """
        step, a, b, numbers = self._looks(piece, steps, counts, values)
        new = values(numbers, b)
        old = self._before(piece.body[step], new)
        early = np.flatnonzero((old == 0.0).any(axis=0))
        if len(early) and not self.noisy:
            times = a[early] + EARLY * (b - a)[early]
            signs = values(self.run.inside(piece, step[early], times), times)
            step, b = np.insert(step, early, step[early]), np.insert(b, early, times)
            a, new = np.insert(a, early + 1, times), np.insert(new, early, signs, axis=1)
            old = self._before(piece.body[step], new)
        body = piece.body[step]
        begins = np.append(True, body[1:] != body[:-1])
        bodies = body[begins].tolist()
        place, starts = np.arange(len(step)), np.flatnonzero(begins)
        # of every body the first look into the first step in which an event failed
        failed = np.isnan(new).any(axis=0) & (left is not None)
        bad = np.where(failed, np.searchsorted(step, step), len(step))
        bad = np.minimum.reduceat(bad, starts)
        good = np.flatnonzero(place < np.repeat(bad, np.diff(np.append(starts, len(step)))))
        zeros = self._zeros(piece, (step[good], a[good], b[good]), old[:, good], new[:, good], values)
        of_each: dict[int, list[Zero]] = {}
        for zero in zeros:
            of_each.setdefault(int(piece.body[zero[0]]), []).append(zero)
        for i, met in of_each.items():
            hit = self.each[i].meet(met, piece.b)
            if hit is not None:
                hits[i] = hit
            if hit is not None and self.each[i].jumps[hit[2]]:
                within = (step == hit[0]) & ((b - hit[1]) * (b - a) >= 0.0)
                look = int(np.flatnonzero(within)[0])
                self.each[i].since = a.item(look), old[:, look].tolist()
        ends = np.append(starts[1:], len(step))
        for i, start, end, first in zip(bodies, starts.tolist(), ends.tolist(), bad.tolist()):
            watch = self.each[i]
            if first != start:
                self.fresh.discard(i)
            if first < end and left is not None:
                watch.values, left[i] = old[:, first].tolist(), int(step[first])
            else:
                watch.values = new[:, end - 1].tolist()

    def _before(self, body: np.ndarray, new: np.ndarray) -> np.ndarray:
        """Values of events at the look before each look, (events, n): at the first look of a body those where it
        stands.
        """
        first = np.flatnonzero(np.append(True, body[1:] != body[:-1]))
        old = np.concatenate([new[:, :1], new[:, :-1]], axis=1)
        old[:, first] = np.array([self.each[i].values for i in body[first].tolist()]).T
        return old

    def _values(self, points: np.ndarray, t: np.ndarray, which: np.ndarray | None = None) -> np.ndarray:
        """Values of all events, (events, n), at states, (n, width), and times, (n,); nan where one failed.  which : of
        each state the only event that is asked for, whose values, (n,), are to be numbers.
        """
        inputs = np.column_stack([self.run.view.seen(points)[1], t])
        columns = [natively(*kernel, inputs, 1) for kernel in self.kernels]
        values = np.array([np.where(column[:, 1] == 1.0, column[:, 0], np.nan) for column in columns])
        if which is None:
            return values
        chosen: np.ndarray = np.take_along_axis(values, which[None], axis=0)[0]
        if np.isnan(chosen).any():
            raise ArithmeticError
        return chosen

    def _zeros(
        self, piece: Any, looks: tuple[np.ndarray, ...], old: np.ndarray, new: np.ndarray, values: Any
    ) -> list[Zero]:
        """The zeros between some looks, in the order in which motions meet them.

        looks : of each the step, and the times of the last look and of this one.  old, new : (events, n) the values then.
        """
        changes = [crossed(*triple) for triple in zip(self.events, old, new, strict=True)]
        event, look = np.nonzero(changes)
        if not len(event):
            return []
        whole, *ends = (x[look] for x in looks)

        def value(some: np.ndarray, times: np.ndarray) -> Any:
            return values(self.run.inside(piece, whole[some], times), times, event[some])

        at, jumps = roots(value, ends[0], ends[1], old[event, look], new[event, look])
        numbers = self.run.seen_at(piece, whole, at)
        for k in np.flatnonzero(jumps).tolist():
            self._jumped(int(piece.body[whole[k]]), int(event[k]), at.item(k))
        later = np.where(ends[1] >= ends[0], 1.0, -1.0)
        order = np.lexsort((later * event, later * at, whole))
        return [(int(whole[k]), at.item(k), int(event[k]), numbers[k]) for k in order[~jumps[order]].tolist()]

    def _plainly(self, piece: Any, body: int, first: int) -> Zero | None:
        """Find zeros in the steps of a body from this one on, step by step."""

        def values(points: np.ndarray, times: np.ndarray, which: np.ndarray | None = None) -> np.ndarray:
            samples = [*zip(times.tolist(), map(self.run.view.small, points), strict=True)]
            if which is not None:
                pairs = zip(which.tolist(), samples)
                return np.array([self._value(body, self.events[i], t, x) for i, (t, x) in pairs])
            return np.array([[self._value(body, event, t, x) for t, x in samples] for event in self.events])

        for k in range(first, len(piece)):
            if piece.body[k] != body:
                break
            look, hits = np.array([k]), {}  # type: Any, dict[int, Zero]
            try:
                self._portion(piece, look, self.run.looks(piece, look), values, hits)
            except BaseException as error:
                error.step = k  # type: ignore[attr-defined]
                raise
            if hits:
                return hits[body]
        return None

    # ---------------------------------------------------------------- jumps

    def ends(self, body: int) -> bool:
        """Whether the zero that a body has met last ends its run."""
        return self.each[body].ended is not None

    def jump(self, body: int, hit: Zero, end: float) -> np.ndarray:
        """The numbers of the state behind a jump, where events have the signs that they have just after it.

        hit : the zero.  end : the time of the end of the step.
        Raises StepTooSmall where jumps accumulate.
        """
        _, at, k, numbers = hit
        watch, run = self.each[body], self.run
        event: Any = self.events[k]
        system, before = run.system_and_method(body)[0], run.view.small(numbers)
        try:
            after = arguments.started(system, event.jump_of(system).after(at, before), None, at)
            if any(after.parts[name] is None for name in before.arrays):
                parts = ", ".join(before.arrays)
                raise InvalidInput(f"Jump: then(t, state) leaves parts out; give system.state(...) all of {parts}")
            after = restricted(after, run.view.layout)
            rates = [slope(event, system, at, state) for state in (before, after)]
        except Exception as error:
            raise run.refused(error, body, at, before) from error.__cause__
        last, watch.jumped[k] = watch.jumped.get(k, math.inf), at
        came_back = rates[0] * run.sign[body] * watch.since[1][k] > 0.0  # the event grows away from its zero
        why = left_behind(*rates)
        if came_back or abs(at - last) <= ONE_TIME * max(abs(at), abs(end)):
            why = (
                f"after {len(watch.zeros[k])} jumps rounding decides on which side of the zero the motion is. They accumulate, as "
                "the bounces of a ball that comes to rest: end the run before, by a terminal event, or go on from run.last with "
                "a system that has the contact as a constraint"
            )
        if why is not None:
            raise StepTooSmall(f"integrate: {name_of(event)} at t = {at:.10g}: {why}")
        values = []
        for i, other in enumerate(self.events):
            old, new = (self._value(body, other, at, state) for state in (before, after))
            near = 64.0 * max(abs(old), EPSILON * abs(rates[1]) * max(abs(at), abs(end)))
            if i == k and abs(new) <= near:
                new = math.copysign(max(abs(new), SIGN), rates[1] * run.sign[body])
            elif i != k and new == old:
                new = watch.side_of(i, new, at)
            values.append(new)
        watch.values = values
        self.fresh.discard(body)
        return packed(after)

    # ---------------------------------------------------------------- where steps are looked at

    def _looks(self, piece: Any, steps: np.ndarray, counts: np.ndarray, values: Any) -> Any:
        """Looks into some steps: of each the step, the times of the last look and of this one, and the numbers of the
        state, (m, width).

        counts : how many there are in each step.  values : finds those of events.
        """
        run = self.run
        step, a, b, numbers = steps, piece.a[steps], piece.b[steps], piece.rows(steps)[:, run.head][:, 1:]
        while (counts > 1).any():
            place = np.repeat(np.arange(len(step)), counts)
            part = np.arange(len(place)) - np.repeat(np.cumsum(counts) - counts, counts)
            step, spans, start, end = step[place], (b - a)[place] / counts[place], a[place], b[place]
            a, b = start + part * spans, np.where(part + 1 == counts[place], end, start + (part + 1) * spans)
            numbers, counts = run.inside(piece, step, b), np.ones(1)
            if run.between.closer:  # the states there may move faster
                before = np.concatenate([numbers[:1], numbers[:-1]])
                first = a == piece.a[step]
                before[first] = run.inside(piece, step[first], a[first])
                counts = run.between.looks(
                    np.column_stack([a, before]), np.column_stack([b, numbers]), piece.body[step]
                )
        self._round(piece, step, b, numbers, values)
        return step, a, b, numbers

    def _round(self, piece: Any, step: np.ndarray, b: np.ndarray, numbers: np.ndarray, values: Any) -> None:
        """Set events to zero that are zero up to rounding where a run begins.

        Rounding is that of the numbers of the state, of which a change shows what it does, and that of the time.
        """
        body = piece.body[step]
        first = np.flatnonzero(np.append(True, body[1:] != body[:-1]))
        first = first[[i in self.fresh for i in body[first].tolist()]] if self.fresh else first[:0]
        if self.noisy or not len(first):
            return
        news = values(numbers[first], b[first]).T
        for k, new in zip(first.tolist(), news, strict=True):
            watch, head = self.each[int(body[k])], self.run.here[:, body[k]]
            old = np.array(watch.values)
            small = (old != 0.0) & (np.abs(old) <= EARLY * np.abs(new))
            if small.any():
                t, end = head.item(0), b.item(k)
                at = np.array([t, t + EARLY * (end - t)])
                changed = head[1:] * (1.0 + EARLY**2 * np.linspace(1.0, 2.0, len(head) - 1))
                points = np.stack([changed, self.run.inside(piece, step[k : k + 1], at[1:])[0]])
                by_state, by_time = np.abs(values(points, at) - old[:, None]).T
                rounding = by_state / EARLY**2 + by_time / abs(at[1] - t) * max(abs(t), abs(end))
                old[small & (np.abs(old) <= 64.0 * EPSILON * rounding)] = 0.0
                watch.values = old.tolist()

    def _jumped(self, body: int, event: int, t: float) -> None:
        """Remember a jump over zero of an event that does not say that it jumps, as an angle does."""
        if getattr(self.events[event], "jumps_by", None) is None:
            self.jumps.setdefault(event, (name_of(self.events[event]), body, t))

    # ---------------------------------------------------------------- what came of it

    def tell(self) -> None:
        """Warn of events that were nan, next to which no zero is seen, and of those that jumped over zero."""
        for name, body, t in self.blind.values():
            of = f" of body {body}" if self.run.bodies else ""
            warn(
                f"integrate: the event {name} was nan at t = {t:g}{of}; its zeros are not "
                "seen in steps that begin or end so. Give it a number everywhere",
                RuntimeWarning,
            )

        for name, body, t in self.jumps.values():
            warn_of_jump(name, t, f" of body {body}" if self.run.bodies else "")

    def forget(self) -> None:
        """Forget zeros beyond the places where the bodies stand."""
        for i, watch in self.each.items():
            watch.forget(float(self.run.here[0, i]), self.run.sign[i], i in self.run.cuts)

    def shown(self, body: int) -> tuple[tuple[np.ndarray, Any], ...]:
        """Times and states of every event of a body, as a Trajectory holds them."""
        watch = self.each.get(body)
        zeros = [[] for _ in self.events] if watch is None else watch.zeros
        run, width = self.run, self.run.wide
        system = run.plan._first_of("system")
        states = [run.view.states(np.array([x for _, x in met]).reshape(len(met), width)) for met in zeros]
        times = [np.array([t for t, _ in met]) for met in zeros]
        return tuple([(t, with_sites(system, x, 1)) for t, x in zip(times, states)])


def warn_of_jump(name: str, t: float, of: str = "") -> None:
    """Warn of an event that jumps over zero."""
    warn(
        f"integrate: the event {name} jumps over zero at t = {t:.10g}{of}, as an angle does where it begins anew, or a "
        "pole: that is no zero. Give a function that goes through zero, such as the sine of the angle from there",
        RuntimeWarning,
    )


def roots(
    function: Callable[[np.ndarray, np.ndarray], np.ndarray],
    a: np.ndarray, b: np.ndarray, fa: np.ndarray, fb: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Roots of many functions, each between a and b, where its values fa and fb have not the same
    sign, to four units in the last place: inverse quadratic interpolation where that is safe, or
    else bisection.  With them which ones are none, but jumps, as `STEEP` says.

    function : by the numbers of some functions, and a place for each, their values.
    Source: Chandrupatla, Advances in Engineering Software 28 (1997), 145.
    """
    x1, f1, x2, f2, x3, f3 = b, fb, a, fa, a, fa
    change = np.zeros(len(a))
    places, left = np.where(fb == 0.0, b, a), np.flatnonzero((fb != 0.0) & (fa != 0.0))
    x1, f1, x2, f2, x3, f3 = (x[left] for x in (x1, f1, x2, f2, x3, f3))
    part, least = np.full(len(left), 0.5), 2.0 * EPSILON * np.maximum(np.abs(a), np.abs(b))[left]
    while len(left):
        x = x1 + part * (x2 - x1)
        f = function(left, x)
        same = np.sign(f) == np.sign(f1)
        x3, f3, x2, f2 = np.where(same, (x1, f1, x2, f2), (x2, f2, x1, f1))
        x1, f1 = x, f
        places[left] = np.where(np.abs(f1) < np.abs(f2), x1, x2)
        change[left] = np.where(f1 == 0.0, 0.0, np.abs(f2 - f1))
        bound = least / np.abs(x2 - x1)
        going = (bound <= 0.5) & (f1 != 0.0)
        left, least, bound = left[going], least[going], bound[going]
        x1, f1, x2, f2, x3, f3 = (x[going] for x in (x1, f1, x2, f2, x3, f3))
        with np.errstate(all="ignore"):
            xi, phi = (x1 - x2) / (x3 - x2), (f1 - f2) / (f3 - f2)
            inner = f1 / (f2 - f1) * f3 / (f2 - f3) + (x3 - x1) / (x2 - x1) * f1 / (f3 - f1) * f2 / (f3 - f2)  # fmt: skip
        safe = (phi * phi < xi) & ((1.0 - phi) ** 2 < 1.0 - xi)
        part = np.minimum(1.0 - bound, np.maximum(bound, np.where(safe, inner, 0.5)))
    places = np.where((places == a) & (fa != 0.0), np.nextafter(a, b), places)  # behind a sample there
    steep = STEEP + 32.0 * EPSILON * np.maximum(np.abs(a), np.abs(b)) / np.abs(b - a)
    return places, (change != 0.0) & (change >= steep * np.abs(fb - fa))
