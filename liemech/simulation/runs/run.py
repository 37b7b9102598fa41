"""The loop of a run: bodies go to their goals in pieces, between which observers look at the steps."""

from __future__ import annotations

import dataclasses
import functools
import time
from typing import Any, ClassVar

import numpy as np

from ...errors import IntegrationFailure, is_mistake, warn
from ...systems.system import member
from .. import arguments
from ..between.events import Events, Moving
from ..compiled.control import CLOCK, LAST_TIME, LIMIT, MARK, STUCK, TAKEN, TIME
from ..compiled.execution import LOOK
from ..compiled.lanes import Lanes
from ..compiled.systems import of_body as one_of
from ..keep import AtTimes, Every, PieceOfBodies, Quantities
from ..result import AsItIs, of_body
from ..trajectory import Trajectory
from .carry import Carry
from .course import Course
from .jumps import Ways, beyond_jump

ROOM = 1024
"""Bodies of a thread whose numbers stay in the cache."""

TURNS, LONGEST, WORK = 8, 2**11, 2**13
"""Trials of a body between two looks at who has come to the end: at least and at most, and of all bodies together."""

PATIENCE = 0.25
"""Seconds between two looks at the keyboard."""


class Run(Course, Moving):
    """Bodies, each with a column of numbers, a clock and a goal of its own; abstract: there is one
    for every control.

    A body that fails stays where it came to, and disturbs no other.
    start : a state, or where another run stands, `before`; `fresh` if it is a state.  way : the prepared steps.
    t0, t_end, sign : of every body the time at which it begins, the last one, and the sign of its steps.  first : how many
    steps it had made before.  asked : times of samples, (n, bodies); None for ends of steps.  own_times : has every body
    its own?  compiled_asked : the option `compiled`.

    here : (1 + width, bodies) time and state of every body, and in fictive time tau.
    table : a column for each body: what is carried along, `numbers`; `clocks`; `goals`; parameters
    of their own.  lanes : how it is laid out, and who steps.
    over : bodies that had ended before.  cuts : what terminal events have ended.  errors : by body why it stopped, as far
    as somebody asked; `failures` is what plain Python saw failing steps raise.
    jumps : times at which the velocity jumps, last ones first, of bodies that still have some before them.
    observers, quantities, events : what keeps samples, the first one, and more of the steps; functions of samples; zeros.
    reach : trials of a body in which no jump of its state was met lately.
    view : how numbers are shown as states.
    """

    run_of: ClassVar[Any] = Trajectory
    # are samples handed on as the run goes, where functions of them are kept?
    streams: bool = property(lambda run: not run.bodies)  # type: ignore[assignment]
    lazy: bool = False  # are samples views of what is there, made when somebody looks at them?
    rows: bool = True
    lanes: Lanes
    table: Any
    here: Any
    t_end: Any
    sign: Any

    def __init__(
        self, plan: Any, start: Any, t0: float, steps: Any, t_end: Any, t_eval: Any,
        checkpoint: Any = None,
    ) -> None:  # fmt: skip
        self.plan, self.way, self.checkpoint = plan, plan._steps, checkpoint
        self.start, self.bodies, self.count = start, start.bodies, start.bodies or 1
        inner = getattr(start, "inner", start)
        self.before: Carry | None = inner if isinstance(inner, Carry) else None
        self.compiled_asked, self.fresh = plan.options.compiled, self.before is None
        self.t0 = np.full(self.count, t0 if self.fresh else start.t)
        self.over = np.zeros(self.count, dtype=bool)
        self.failures: dict[int, list[Any]] = {}
        self.errors: dict[int, IntegrationFailure] = {}
        if self.before is not None:
            self.over[[*self.before.ended]] = True
            self.errors = {i: e for i, e in self.before.ended.items() if e is not None}
        self.recorded = plan.recorder is not None
        self.cuts: dict[int, int] = {}
        self.struck: dict[int, IntegrationFailure] = {}  # by body, why it cannot go on behind a jump
        self.first = np.zeros(self.count)
        self.compiled = self.native = False
        self.quantities: Quantities | None = None
        self.jumps: dict[int, Ways] = {}
        ends = arguments.ends(t_end, self.count) if self.bodies else [
            None if t_end is None else arguments.real(t_end, "t_end")
        ]  # fmt: skip
        self.aim(ends, steps)
        self.asked = self._times(t_eval)
        self.own_times = arguments.axes(t_eval, "t_eval") > 1 or (t_eval is None and arguments.axes(t_end, "t_end") > 0)
        self.begin()
        self.numbers, self.clocks, self.goals, *_ = self.lanes.parts(self.table[:, : self.count])
        self.limit = self.goals[LIMIT]
        self.observers = self.observe()
        if self.recorded:
            self.quantities = Quantities(self, plan.recorder)
        self.events: Any = None
        try:
            self.events = Events(self, plan.events) if plan.events else None
        except (Exception, KeyboardInterrupt) as error:
            raise self._stopped(error) from error.__cause__

    # ---------------------------------------------------------------- what a control says

    def aim(self, ends: list[Any], steps: Any) -> None:
        """Set `t_end` and `sign` of every body, and check what was asked for."""
        raise NotImplementedError

    def begin(self) -> None:
        """Make `lanes`, `table` and `here` at the start, or where the run before stands."""
        raise NotImplementedError

    def observe(self) -> list[Any]:
        """The observers of the steps; the first one has the samples."""
        if self.asked is not None:
            return [AtTimes(self, self.asked)]
        return [Every(self, self.way.every)]

    def end_at(self, row: np.ndarray, begun: float, at: float, numbers: np.ndarray) -> None:
        """Let the step of a row end inside: at this time, in this state."""
        row[0], row[1 : 1 + len(numbers)] = at, numbers

    def cut(self, clock: np.ndarray, at: float) -> None:
        """Set the clock, and behind it the goal, of a body that an event ends."""
        clock[[TIME, MARK, CLOCK.width + LAST_TIME]] = at, 0.0, at

    def standing(self, some: Any) -> Any:
        """The carry of one body, by its number, or of all by slice(None)."""
        raise NotImplementedError

    def error(self, i: int) -> Any:
        """The error for which body i stopped."""
        raise NotImplementedError

    def known(self, i: int | None) -> dict[str, Any]:
        """Fields of the trajectory of a body, of all for None, that depend on the control."""
        raise NotImplementedError

    # ---------------------------------------------------------------- states and times

    def _times(self, t_eval: Any) -> np.ndarray | None:
        """Times of samples, (n, bodies), checked; None if every n-th step is kept."""
        if t_eval is None:
            return None
        ends = self.last_times()
        if not self.bodies:
            times: Any = arguments.times(t_eval, self.t0.item(0), ends.item(0))
            return times[:, None]
        columns = arguments.columns(t_eval, self.count)
        shared = arguments.axes(t_eval, "t_eval") == 1
        if shared and (self.t0 == self.t0[0]).all() and (ends == ends[0]).all():
            times = arguments.times(columns[0], self.t0.item(0), ends.item(0))
            return np.broadcast_to(times[:, None], (len(times), self.count))
        times_of_bodies: list[Any] = [
            column if self.over[i] and not self.adaptive else
            arguments.times(column, self.t0.item(i), ends.item(i))
            for i, column in enumerate(columns)
        ]  # fmt: skip
        return np.stack(times_of_bodies, axis=1)

    def last_times(self) -> np.ndarray:
        """Times at which the bodies end, (bodies,)."""
        return self.t_end

    def start_of(self, i: int) -> Any:
        """The state in which a body begins."""
        return member(self.start if self.fresh else self.start.state, i)

    @functools.cached_property
    def view(self) -> AsItIs:
        """The view that shows rows of numbers as states."""
        return AsItIs(self.lanes.example)

    @property
    def head(self) -> slice:
        return slice(len(self.here))

    @property
    def met_before(self) -> Any:
        return ({}, {}) if self.fresh else (self.start.met, self.before.cut)  # type: ignore[union-attr]

    # ---------------------------------------------------------------- stepping

    def _open(self, some: Any) -> np.ndarray:
        """Mask of the bodies that `some` picks: those that have steps to make."""
        clocks, goals = self.clocks, self.goals
        onward = clocks[TIME, some] != goals[LAST_TIME, some]
        onward &= clocks[TAKEN, some] < goals[LIMIT, some]
        return onward & (clocks[MARK, some] != STUCK) & ~self.over[some]

    @property
    def open(self) -> np.ndarray:
        """Mask of the bodies, (bodies,): those that have steps to make."""
        return self._open(slice(None))

    @property
    def failed(self) -> np.ndarray:
        """Mask of the bodies, (bodies,): those that go no further, though not at their ends."""
        return (self.clocks[MARK] == STUCK) & ~self.over

    def part(self) -> float:
        """The part of the run that is done, from 0 to 1."""
        if self.bodies:
            return 1.0 - float(np.count_nonzero(self.open)) / self.count
        t, t0, end = self.here.item(0), self.t0.item(0), self.t_end.item(0)
        if np.isinf(end):
            first = self.first.item(0)
            taken, limit = self.clocks.item(TAKEN, 0) - first, self.limit.item(0) - first
            return float(taken / max(1.0, limit))
        return 1.0 if end == t0 else (t - t0) / (end - t0)

    @property
    def measure(self) -> tuple[int, str]:
        return (self.count, "body") if self.bodies else (1000, "")

    @property
    def shown(self) -> int:
        return self.arrived if self.bodies else int(1000 * self.part())

    @property
    def worth_saving(self) -> bool:
        return self.adaptive or bool(self.open.any())

    def require_ends(self) -> None:
        for i in np.flatnonzero(self.failed).tolist():
            error = self.why(i)
            if not self.bodies:
                raise error
            if is_mistake(error):
                error.add_note(f"[integrate: body {i}]")
                raise error

    def tell(self, made: Trajectory) -> None:
        stopped: Any = made.stopped
        if stopped:
            examples = ", ".join(f"body {i} after {n} steps" for i, n in [*stopped.steps.items()][:5])
            warn(
                f"integrate: {len(stopped)} of {self.count} bodies stopped early: "
                f"{examples}. {stopped[min(stopped)].error}",
                RuntimeWarning,
            )
        if self.events:
            self.events.tell()

    arrived = 0
    running: Any = None  # bodies that run side by side, and their columns
    queue: Any = None  # bodies that wait
    room, least, work, span, reach = ROOM, TURNS, WORK, TURNS, LONGEST

    def piece(self) -> int | None:
        """Make some trials of as many bodies as run side by side; others wait until these are at their ends."""
        stepping, checkpoint, workers = self.lanes.stepping, self.checkpoint, self.plan.options.workers
        if self.queue is None:
            self.queue = np.flatnonzero(self.open)
            if self.quantities:
                self.quantities.flush()
        native = stepping.ready(0.0 if stepping.native is not None else self.part()) is not None
        size = self.room * workers if native else 1
        bodies, columns = self.running or (self.queue[:0], None)
        if columns is None or len(bodies) > size or native is not self.native:
            both = np.concatenate([bodies, self.queue])
            bodies, self.queue = both[:size], both[size:]
            if not len(bodies):
                return None
            columns = self.table.take(_padded(bodies, stepping.lanes if native else 1), axis=1)
        self.native, m = native, len(bodies)
        self.compiled = self.compiled or native
        turns = self.span
        if native:
            # where rows are kept, those of longer pieces would not stay in the cache
            most = self.work * (1 if self.rows else 4) * workers // columns.shape[1]
            turns = max(self.least, min(LONGEST, self.reach, most))
        if checkpoint is not None:
            turns = max(1, min(turns, checkpoint.within(turns * m) // m))
        since, taken = time.perf_counter(), columns[self._clock + TAKEN, :m].sum()
        self._piece(bodies, columns, turns)
        self._pace(time.perf_counter() - since)
        steps = int(columns[self._clock + TAKEN, :m].sum() - taken)
        going = self._open(bodies)
        ended = m - int(going.sum())
        at_once = len(self.queue) or self.events or self.jumps or not native
        if ended and (at_once or 4 * ended >= m):
            bodies, columns = bodies[going], None
            self.arrived += ended
        self.running = bodies, columns
        return steps

    def _pace(self, used: float) -> None:
        """Adapt the length of the next piece to the seconds that this one took."""
        if self.native and used > PATIENCE:  # somebody may want to interrupt it
            self.room = max(self.lanes.stepping.lanes, self.room // 4)
            self.least, self.work = max(1, self.least // 2), self.work // 4
        if not self.native and used < 0.5 * LOOK:
            self.span = min(2 * self.span, LONGEST)

    @property
    def _clock(self) -> int:
        return self.lanes.layout.width

    def _piece(self, bodies: np.ndarray, columns: np.ndarray, turns: int) -> None:
        """Make `turns` trials of these bodies, whose columns are given, and show the steps to observers."""
        m, lanes, clock = len(bodies), self.lanes, self._clock
        workers = self.plan.options.workers
        if not self.rows:  # only where they come to is asked for
            out = np.empty((2, lanes.row.width, columns.shape[1]))
            lanes.march(bodies, columns, out, turns, workers, self.failures, self.native)
            self.here[:, bodies] = columns[[clock + TIME, *range(len(self.here) - 1)], :m]
            self._stand(bodies, columns)
            return
        out = np.empty((turns + 1, lanes.row.width, columns.shape[1]))
        marks = columns[clock + TIME] if not lanes.mark else self.here[-1, bodies]
        marks, taken = marks.copy(), columns[clock + TAKEN, :m].copy()
        out[:, lanes.mark, : len(marks)] = marks
        out[0, : len(self.here), :m] = self.here[:, bodies]
        before = columns.copy() if self.events else columns
        lanes.march(bodies, columns, out, turns, workers, self.failures, self.native)
        for k, body in enumerate(bodies.tolist() if self.jumps else ()):
            ways = self.jumps.get(body)
            if ways:  # a last step that ends before a jump at t_end is one to t_end
                out[:, 0, k][out[:, 0, k] == ways[0][0]] = self.t_end[body]
        piece = PieceOfBodies(self, bodies, out, marks, taken, lanes.mark)
        try:
            self._see(piece, bodies, before, columns)
        except BaseException as error:
            if getattr(error, "step", None) is not None:  # an event failed: up to there all is well
                k = error.step  # type: ignore[attr-defined]
                column = piece.column[k]
                before_failure = piece.column[:k] == column
                replayed = self._again(bodies[column], before[:, column], turns, int(before_failure.sum()))
                columns[:, column] = replayed
                piece.keep((piece.column == column) & (np.arange(len(piece)) < k))
                self._commit(piece, bodies[[column]], columns[:, [column]])
            raise

    def _see(self, piece: PieceOfBodies, bodies: np.ndarray, before: np.ndarray, columns: np.ndarray) -> None:
        """Let observers look at a piece."""
        behind: list[tuple[int, list[PieceOfBodies]]] = []
        self.reach = min(2 * self.reach, LONGEST)
        if self.events:
            remaining = np.full(len(piece), True)
            for body, hit in self.events.see(piece).items():
                k, at, event, _ = hit
                column, end = int(piece.column[k]), piece.b.item(k)
                of = piece.column == column
                steps = int(of[: k + 1].sum())
                turns = len(piece.out) - 1
                columns[:, column] = self._again(body, before[:, column], turns, steps)
                row = self._ended(piece, k, hit)
                remaining &= ~of | (np.arange(len(piece)) <= k)
                if self.events.ends(body):
                    self.cuts[body] = event
                    self.cut(columns[self._clock :, column], at)
                    continue
                self.reach = max(TURNS, min(self.reach, 2 * steps))
                try:
                    later = self._behind(body, columns[:, column], row, hit, end, int(piece.number[k]))
                except BaseException as error:
                    error.step = k  # type: ignore[attr-defined]
                    raise
                behind.append((column, later))
            piece.keep(remaining)
        self._commit(piece, bodies, columns)
        for column, pieces in behind:
            for later_piece in pieces:
                self._commit(later_piece, bodies[[column]], columns[:, [column]])

    def _ended(self, piece: PieceOfBodies, k: int, hit: Any) -> np.ndarray:
        """The row of a step that an event ends inside, which the piece then has."""
        _, at, _, numbers = hit
        row = piece.out[piece.turn[k], :, piece.column[k]].copy()
        self.end_at(row, piece.a.item(k), at, numbers)
        piece.out[piece.turn[k], :, piece.column[k]] = row
        piece.kept[k] |= at != piece.b[k] or not self.events.ends(int(piece.body[k]))
        piece.b[k] = at
        return row

    def _behind(
        self, body: int, column: np.ndarray, row: np.ndarray, hit: Any, end: float, number: int
    ) -> list[PieceOfBodies]:
        """The jump of a body and what it has left of the step in which it jumps, as pieces of a step each; its column goes
        on from there.

        row : where it jumps.  end, number : of the step.
        """
        pieces: list[PieceOfBodies] = []
        try:
            while hit is not None:
                new = row.copy()
                new[1:] = 0.0
                numbers = self.events.jump(body, hit, end)
                new[1 : 1 + len(numbers)] = numbers
                pieces.append(PieceOfBodies.of_step(body, row, new, number, True))
                later = self.rest_of_step(body, column, new, end)
                hit = None
                if later is not None:
                    piece = PieceOfBodies.of_step(body, new, later, number, False)
                    hit = self.events.see(piece).get(body)
                    if hit is not None:
                        row = self._ended(piece, 0, hit)
                    pieces.append(piece)
                if hit is not None and self.events.ends(body):
                    self.cuts[body], hit = hit[2], None
                    self.cut(column[self._clock :], row.item(0))
        except IntegrationFailure as error:
            self.struck[body] = error
            column[self._clock + MARK] = STUCK
        return pieces

    def rest_of_step(self, body: int, column: np.ndarray, row: np.ndarray, end: float) -> np.ndarray | None:
        """Let a column go on behind a jump, from a row of time and state; of fixed steps from the end of the step, of
        which the row is returned, for jumps do not move the times at which steps end.
        """
        raise NotImplementedError

    def _again(self, body: int, column: np.ndarray, turns: int, steps: int) -> np.ndarray:
        """The column of a body after so many of these steps, once more."""
        lanes, clock = self.lanes, self._clock
        side = lanes.stepping.lanes if self.native else 1
        columns = np.repeat(column[:, None], side, axis=1)
        limit = clock + CLOCK.width + LIMIT
        columns[limit] = columns[clock + TAKEN] + steps
        if steps:
            out = np.empty((turns + 1, lanes.row.width, side))
            lanes.march(np.array([body]), columns, out, turns, 1, {}, self.native)
        columns[limit] = column[limit]
        return columns[:, 0]

    def _commit(self, piece: PieceOfBodies, bodies: np.ndarray, columns: np.ndarray) -> None:
        """Keep what is asked for of a piece, and stand where it ends."""
        for observer in self.observers:
            observer.see(piece)
        ends = np.flatnonzero(piece.ends)
        self.here[:, piece.body[ends]] = piece.rows(ends)[:, self.head].T
        self._stand(bodies, columns)
        if self.quantities:
            self.quantities.flush()

    def _stand(self, bodies: np.ndarray, columns: np.ndarray) -> None:
        """Copy state, clock and last time of these bodies from their columns to the table of the run."""
        changed = self._clock + CLOCK.width + 1  # with the time to which they go
        if self.jumps:
            self._beyond_jumps(bodies, columns)
        self.table[:changed, bodies] = columns[:changed, : len(bodies)]

    def _beyond_jumps(self, bodies: np.ndarray, columns: np.ndarray) -> None:
        """Let bodies that have come to a jump of the velocity go on behind it, to the next one."""
        clock = self._clock
        goal = clock + CLOCK.width
        for k, body in enumerate(bodies.tolist()):
            left = self.jumps.get(body)
            if not left or columns[clock + TIME, k] != columns[goal, k] or body in self.cuts:
                continue
            end = self.t_end.item(body)
            if beyond_jump(columns[clock:, k], columns[goal:, k], left, end) == end:
                self.here[0, body] = end

    # ---------------------------------------------------------------- what came of it

    def system_and_method(self, i: int) -> tuple[Any, Any]:
        """The pair of system and method of body i."""
        return one_of(self.plan.system, i), one_of(self.plan.method, i)

    def why(self, i: int) -> Any:
        """The error for which body i stopped, computed once."""
        if i not in self.errors:
            self.errors[i] = self.explained(self.struck[i], i, goes_on=False) if i in self.struck else self.error(i)
        return self.errors[i]

    def explained(self, error: Any, i: int, goes_on: bool = True) -> Any:
        """The error of a body, with its run as it would be alone."""
        run = of_body(self, i)
        error.trajectory = run if goes_on else dataclasses.replace(run, carry=None)
        if isinstance(error, IntegrationFailure):
            self.view.mark(error, self.here.item(0, i), self.here[1:, i])
        return error

    def settle(self, error: Any) -> bool:
        goes_on = self.adaptive or isinstance(error, KeyboardInterrupt)
        goes_on &= not hasattr(error, "kept")
        if self.quantities and not hasattr(error, "kept"):
            self.quantities.flush()
        for observer in (*self.observers, *([self.events] if getattr(self, "events", None) else [])):
            observer.forget()
        return goes_on

    def so_far(self) -> str:
        text = f"at t = {self.here.item(0):g}, after {int(self.made[0])} steps"
        if self.bodies:
            text = f"before {int(self.open.sum())} of {self.count} bodies came to the end"
        return f"{text}; the samples are in `.trajectory`"

    @property
    def made(self) -> np.ndarray:
        """Counts of steps of this run, (bodies,)."""
        return np.where(self.over, 0.0, self.clocks[TAKEN] - self.first)

    @property
    def most(self) -> int:
        """The largest count of steps of a body."""
        return int(self.made.max())

    @property
    def stops(self) -> dict[int, int]:
        """Counts of steps of the bodies that an error has ended, by body."""
        stopped = self.failed.copy()
        stopped[[*self.errors]] = True
        return {i: int(self.clocks[TAKEN, i]) for i in np.flatnonzero(stopped).tolist()}

    def flush(self) -> tuple[np.ndarray, np.ndarray]:
        """Times and numbers of samples that were not handed on yet."""
        return self.observers[0].flush()

    def samples(self, i: int) -> tuple[np.ndarray, np.ndarray]:
        """The samples of a body: times, and numbers of states, and fictive times behind them."""
        rows, counts = self.observers[0].rows
        samples = rows[: counts[i], i].copy() if self.bodies else rows[: counts[i], i]
        return samples[:, 0], samples[:, 1:]

    def together(self) -> tuple[np.ndarray, np.ndarray]:
        """The samples of all bodies, times, (n,) or (n, bodies), and numbers of states, (n, bodies,
        width): who has less of them stays where it came to.
        """
        rows, counts = self.observers[0].rows
        shown, failed = rows, self.failed
        if failed.any() or (counts < len(rows)).any():
            shown = self._all_as_long(rows, counts, failed)
        t = shown[..., 0]
        if not self.own_times and (t == t[:, :1]).all():
            t = t[:, 0].copy()
        return t, shown[..., 1:]

    def _all_as_long(self, rows: np.ndarray, counts: np.ndarray, failed: np.ndarray) -> np.ndarray:
        """Rows of samples, (n, bodies, width), in which bodies with fewer of them repeat where they came to."""
        heads = self.here.T
        late = failed & (self.asked is None) & (counts > 0)
        last = rows[np.maximum(counts - 1, 0), np.arange(self.count)] if len(rows) else heads
        late &= (last != heads)[:, -1 if self.lanes.mark else 0]
        n = int(np.max(counts + late)) if self.asked is None else len(rows)
        ends = np.where(((self.asked is not None) | failed | (counts == 0))[:, None], heads, last)  # where they came to
        shown = rows
        if n != len(rows):
            shown = np.empty((n, *rows.shape[1:]))
            shown[: len(rows)] = rows[:n]
        np.copyto(shown, ends, where=(np.arange(n)[:, None] >= counts)[..., None])
        if self.asked is not None and not self.own_times:  # who has failed shares the times of others
            ended = failed | (self.over & np.isin(np.arange(self.count), [*self.errors]))
            np.copyto(shown[..., 0], self.asked, where=ended)
        return shown

    # ---------------------------------------------------------------- going on

    def met(self, some: Any) -> dict[int, Any]:
        """Counts of zeros of events, by body, for one body or for all."""
        each = self.events.each if self.events else {}
        if isinstance(some, int):
            return {0: each[some].met} if some in each else {}
        return {i: watch.met for i, watch in each.items()}

    def carry_of(self, i: int) -> Any:
        """The carry of body i alone; None if it has ended."""
        ended = self.over[i] or self.clocks[MARK, i] == STUCK
        return None if ended or (i in self.cuts and not self.adaptive) else self.standing(i)

    def carry(self) -> Any:
        """The carry of all bodies to resume from; None if all have ended."""
        ended = {} if self.before is None else dict(self.before.ended)
        if len(ended) + np.count_nonzero(self.failed) == self.count:
            return None
        ended |= self.ended() | ({} if self.adaptive else dict.fromkeys(self.cuts))
        if len(ended) == self.count:
            return None
        carry = self.standing(slice(None))
        inner, bodies = getattr(carry, "inner", carry), [*ended]
        inner.ended.update(ended)
        inner.clock[TIME, bodies] = self.here[0, bodies]
        return carry

    def ended(self) -> dict[int, Any]:
        """Bodies that go no further from here on, with their errors."""
        return {i: self.why(i) for i in np.flatnonzero(self.failed).tolist()}


def _padded(places: np.ndarray, side: int) -> np.ndarray:
    """Numbers of columns, the last one repeated for the lanes that are left over."""
    return np.concatenate([places, places[-1:].repeat(-len(places) % side)])
