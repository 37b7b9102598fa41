"""Controls: how long the steps of a run are, and when it has come to its end.

Records whose methods are compiled into the driver `advance`: `Tolerance` chooses steps by the error
estimate, `Equal` makes fixed steps, `Fictive` makes them in a fictive time and lands at
t_end.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...compiler.driver import Rejected, accepted, any_body, attempt, itself, part_of_driver, reason, unchanged, write
from ...errors import StepTooSmall, is_mistake
from ...formulas import Record, record, where
from ...formulas.classes.layouts import layout_of
from ...formulas.numbers.conversions import fitted, rounded
from ...formulas.numbers.sizes import EPSILON

SAFETY, SLOWEST, FASTEST = 0.9, 0.2, 10.0
"""The controller aims at 0.9 of the step that would just be accepted, and changes steps by factors
between these two.
"""

LEAST, UNUSABLE = 1e-4, 1e3
"""The smallest error that the controller knows, and that of a step that failed."""

STUCK, ASKED = 1.0, 2.0
"""Values of Clock.stuck: the body goes no further; or native code failed in a step, and plain
Python is to make it: it may be able to (integers without end), or knows what failed.
"""

STILL = 1000.0
"""Steps without a change of the physical time after which a run to a given time is ended."""

TURNS = 60
"""Trials after which the step to a given time is taken as it is; a good one needs five."""


@record
class Clock(Record):
    """State of the control of one body: time, the step to try, the error of the last one, counts,
    and marks.

    h : zero if the first step is to be found.  error : as `following` gives it; of fictive steps how
    many left the time as it was.  stuck : 0, `STUCK` or `ASKED`.  fresh : is the velocity to be
    computed, at a start or after a jump?  Of fictive steps: did it land inside of a step?
    """

    t: float
    h: float
    error: float
    steps: float
    rejected: float
    stuck: float
    fresh: float


FRESH = 1.0, 0.0, 0.0, 0.0, 1.0
"""Numbers of a clock at a start, behind time and step."""

CLOCK = layout_of(Clock(0.0, 0.0, *FRESH))

TIME, STEP, ERROR, TAKEN, REJECTED, MARK, ANEW = range(CLOCK.width)
"""The places of these numbers among those of a clock."""


@record
class Goal(Record):
    """Where a body is to go, and how: the last time, the tolerances, the longest step, the number of
    the last step, and the time of step 0.
    """

    t_end: float
    rtol: float
    atol: float
    longest: float
    limit: float
    t0: float


GOAL = layout_of(Goal(0.0, 0.0, 0.0, 0.0, 0.0, 0.0))

LAST_TIME, RTOL, ATOL, LONGEST_STEP, LIMIT, ORIGIN = range(GOAL.width)
"""The places of these numbers among those of a goal."""


def go_on(clock: np.ndarray, t: float) -> None:
    """Set a clock to another time, from which velocity and step are computed anew."""
    clock[TIME], clock[STEP], clock[ANEW] = t, 0.0, 1.0


def going(clock: Any, goal: Any) -> bool:
    """Whether the body has more steps to make."""
    return clock.t != goal.t_end and clock.stuck == 0.0 and clock.steps < goal.limit


@record
class Control(Record):
    """How long steps are, and when a run has come to its end; abstract.

    A subclass writes `turn`, or `march`, which makes many.  It never looks into a state, nor into what
    a method carries along: they may lie in memory.
    motion : method, system, and the layouts of what is carried along and of a row.
    """

    def begun(self, method: Any, system: Any, clock: Any, carry: Any, goal: Any, failures: Any) -> Any:
        """Clock and carry before the first step, unchanged unless a subclass computes them."""
        return clock, carry

    def turn(self, motion: Any, clock: Any, carry: Any, goal: Any, k: int, out: Any, failures: Any) -> Any:
        """A trial of a step, and row number k if it was made: the clock, the carry, and whether."""
        raise NotImplementedError

    @part_of_driver
    def march(
        self, motion: Any, clock: Any, carry: Any, goal: Any, turns: int, every: int, out: Any, failures: Any
    ) -> Any:
        """Some turns, each with a row if its step was made: the clock and the carry behind them."""
        count = 0
        for _ in range(turns):
            if not any_body(going(clock, goal)):
                break
            clock, carry, good = self.turn(motion, clock, carry, goal, count, out, failures)
            if any_body(good):
                count = count + 1
        return clock, carry


@record
class Tolerance(Control):
    """Steps as long as the error estimate allows.

    curves : do rows have the way between the steps?  rows : are there any?
    """

    curves: bool
    rows: bool

    def begun(self, method: Any, system: Any, clock: Any, carry: Any, goal: Any, failures: Any) -> Any:
        """Clock and carry before the first step: with the velocity, and a step to try."""
        state, xi = carry
        h, before, stuck, fresh = clock.h, clock.error, clock.stuck, clock.fresh > 0.0
        if any_body(fresh):
            first = attempt(started, method, system, clock.t, state, h, goal.t_end, goal.rtol, goal.atol)
            good = fresh and accepted(first, itself)
            if failures is not None:
                noted(failures, first)
            if any_body(good):
                xi, h, before = (where(good, first[0], xi), where(good, first[1], h), where(good, 1.0, before))
            failed = fresh and not good
            stuck = where(failed, ASKED if failures is None else STUCK, stuck)
            fresh = failed and failures is None
        left = where(fresh, 1.0, 0.0)
        return Clock(clock.t, h, before, clock.steps, clock.rejected, stuck, left), (state, xi)

    def turn(self, motion: Any, clock: Any, carry: Any, goal: Any, k: int, out: Any, failures: Any) -> Any:
        """A trial of a step; a row of time, state and way if it was accepted."""
        (method, system, _, row), (state, xi) = motion, carry
        t, h, before, n, stuck = clock.t, clock.h, clock.error, clock.steps, clock.stuck
        rejected, running = clock.rejected, going(clock, goal)
        step, last, small = to_try(t, h, goal.t_end, goal.longest)
        tried, small = running and not small, running and small
        h, stuck = where(small, step, h), where(small, STUCK, stuck)
        if any_body(tried):
            arguments = t, state, xi, step, goal.rtol, goal.atol, self.curves
            trial = attempt(method.trial, system, *arguments)
            done = accepted(trial, itself)
            mistaken = failures is not None and noted(failures, trial)
            error, length = UNUSABLE, step
            if any_body(done):
                shortened = judged(method, trial, t, step)
                error, length = where(done, shortened[0], UNUSABLE), where(done, shortened[1], step)
            ask = tried and not done and (failures is None or mistaken)
            stuck = where(ask, ASKED if failures is None else STUCK, stuck)
            tried = tried and not ask
            good = tried and error <= 1.0
            new, root = following(method, length, error, before, 1.0 / method.error_order)
            h = where(tried, new, h)
            if any_body(good):
                t = where(good, where(last and length == step, goal.t_end, t + length), t)
                state, xi = where(good, trial.state, state), where(good, trial.velocity, xi)
                before, n = where(good, root, before), n + where(good, 1.0, 0.0)
                if self.rows:
                    write(out, k, (t, state, trial.curve), row)
            rejected = rejected + where(tried and not good, 1.0, 0.0)
        now = Clock(t, h, before, n, rejected, stuck, clock.fresh)
        return now, (state, xi), n != clock.steps


@record
class Equal(Control):
    """Fixed steps h: step n ends at t0 + n h.

    timed : has a row the time, before the state?
    """

    timed: bool = True

    @part_of_driver
    def march(
        self, motion: Any, clock: Any, carry: Any, goal: Any, turns: int, every: int, out: Any, failures: Any
    ) -> Any:
        """Turns of `every` steps each, as far as they can be made; a row where each turn leads."""
        method, system, layout, row = motion
        n, stuck, t0, h, limit = clock.steps, clock.stuck, goal.t0, clock.h, goal.limit
        shown = row.parts[1] if self.timed else row
        for k in range(turns):
            for _ in range(every):
                running = stuck == 0.0 and n < limit
                if failures is not None and not running:  # in plain Python
                    break
                trial = attempt(stepped, method, system, t0 + n * h, carry, h, layout)
                good = running and accepted(trial, observed, shown)
                if any_body(not good):
                    if failures is not None:
                        failures.append(reason(trial))
                        stuck = STUCK
                        break
                    if not any_body(running):
                        break
                    stuck = where(running and not good, ASKED, stuck)
                    carry, n = where(good, trial[0], carry), where(good, n + 1.0, n)
                else:
                    carry, n = trial[0], n + 1.0
            now = attempt(sample, method, carry)
            if self.timed:
                write(out, k, (t0 + n * h, now, ()), row)
            else:
                write(out, k, now, row)
        return Clock(t0 + n * h, h, clock.error, n, clock.rejected, stuck, clock.fresh), carry


STRAIGHT = Equal(False)
"""Fixed steps whose rows have no time: that of all bodies is known."""


@record
class Fictive(Control):
    """Fixed steps h in fictive time, tau = n h, of a system that carries its physical time
    along; instead of one that would lead beyond t_end a shorter one that ends there.
    """

    def turn(self, motion: Any, clock: Any, carry: Any, goal: Any, k: int, out: Any, failures: Any) -> Any:
        """A step; a row of physical time, state and fictive time if it could be made."""
        method, system, layout, row = motion
        t, h, n, stuck, running = clock.t, clock.h, clock.steps, clock.stuck, going(clock, goal)
        still, inside = clock.error, clock.fresh
        trial = attempt(stepped, method, system, n * h, carry, h, layout)
        good = running and accepted(trial, observed, row.parts[1])
        failed = running and not good
        if failures is not None and not good:
            failures.append(reason(trial))
        if any_body(good):
            time = system.clock(trial[1])
            past = good and (time - goal.t_end) * h > 0.0
            stood = good and not past and still >= STILL
            good = good and not past and not stood
            if failures is not None and stood:
                failures.append(StepTooSmall(f"{STILL:g} steps went by and physical time stands still"))
            failed = failed or stood
            shown, tau, memory = trial[1], (n + 1.0) * h, carry
            still = where(good, where(time == t, still + 1.0, 0.0), still)
            n, t = n + where(good, 1.0, 0.0), where(good, time, t)
            carry = where(good, trial[0], carry)
            if any_body(past):
                end = attempt(landed, method, system, memory, h, goal.t_end)
                reached = past and accepted(end, itself)
                if failures is not None and not reached:
                    failures.append(reason(end))
                if any_body(reached):
                    shown, tau = where(reached, end[0], shown), where(reached, n * h + end[1], tau)
                    t, inside = where(reached, goal.t_end, t), where(reached, 1.0, inside)
                failed = failed or (past and not reached)
                good = good or reached
            if any_body(good):
                write(out, k, (t, shown, where(good, tau, clock.steps * h)), row)
        stuck = where(failed, ASKED if failures is None else STUCK, stuck)
        return Clock(t, h, still, n, clock.rejected, stuck, inside), carry, good


# ------------------------------------------------------------------ fixed steps


def stepped(method: Any, system: Any, t: float, carry: Any, h: float, layout: Any) -> Any:
    """Make one step: the memory of the method after it, and the sample that shows it.  Raises
    InvalidType if the step returns something else than it was given.
    """
    new = method.step(system, t, carry, h)
    if layout.remembers:
        new = fitted(new, layout)
    unchanged(new, layout)
    return new, rounded(method.observe(new))


def begun(method: Any, system: Any, state: Any, h: float) -> Any:
    """Begin at a state: the memory of the method, and the sample that shows it."""
    carry = method.start(system, state, h)
    return carry, rounded(method.observe(carry))


def sample(method: Any, carry: Any) -> Any:
    """The sample that shows what the method carries along."""
    return rounded(method.observe(carry))


def observed(trial: Any) -> Any:
    """The sample in what `stepped` and `begun` return."""
    return trial[1]


def landed(method: Any, system: Any, memory: Any, h: float, target: float) -> tuple[Any, float]:
    """The sample at the time `target`, at most a step away, and the length s of the step there.

    The time after a step grows with its length; the secant method finds s, halving where it leaves
    what is left of the interval.
    Source: Dahlquist and Bjorck, Numerical Methods, section 6.4.
    """
    shown = rounded(method.observe(memory))
    low, high, before = 0.0, h, 0.0
    error_before = system.clock(shown) - target
    error, s, turns = error_before, h, 0
    done = error_before == 0.0
    if done:
        s = 0.0
    while not done:
        shown = rounded(method.observe(method.step(system, 0.0, memory, s)))
        error = system.clock(shown) - target
        if error * h < 0.0:
            low = s
        else:
            high = s
        slope = (error - error_before) / (s - before)
        new = s - error / slope if slope != 0.0 else low
        if not (min(low, high) < new < max(low, high)):
            new = 0.5 * (low + high)
        turns = turns + 1
        done = error == 0.0 or abs(new - s) <= EPSILON * abs(s) or turns >= TURNS
        if not done:
            before, error_before, s = s, error, new
    return shown, s


# ------------------------------------------------------------------ steps by tolerance


def to_try(t: float, h: float, t_end: float, longest: float) -> tuple[float, bool, bool]:
    """The step to try, and whether it leads to the end, and is too small to advance the time."""
    h = min(max(h, -longest), longest)
    last = abs(h) >= 0.999 * abs(t_end - t)
    step = where(last, t_end - t, h)
    return step, last, t + 0.125 * step == t


def judged(method: Any, trial: Any, t: float, step: float) -> tuple[float, float]:
    """The error over the tolerance of the step that a trial has made, and its length."""
    length = trial.share * step
    if not method.shortens:
        return max(trial.error, LEAST), length
    return where(t + length == t, UNUSABLE, LEAST), length


def following(method: Any, step: float, error: float, before: float, power: float) -> tuple[float, float]:
    """The step after one with this error over the tolerance, and r = err^(1/(10 q)), which controls
    it; `before` is that of the last step.  A method that shortens its steps may try any.

    A proportional-integral controller, h <- 0.9 h err_n^(-0.7/q) err_(n-1)^(0.4/q), that is
    0.9 h r_(n-1)^4 / r_n^7; after a step that was rejected h <- 0.9 h err^(-1/q).  A power in lanes
    takes as long as twenty products, so one must do.

    Source: Hairer and Wanner, Solving Ordinary Differential Equations II, 2nd ed., IV.2, equation
    (2.43c).
    """
    if method.shortens:
        return step * where(error <= 1.0, FASTEST, SLOWEST), before
    root = error ** (0.1 * power)
    cube, old = root * root * root, before * before
    if error <= 1.0:
        factor = min(FASTEST, SAFETY * (old * old) / (cube * cube * root))
    else:
        factor = SAFETY / (cube * cube * cube * root)
    return step * max(SLOWEST, factor), root


def noted(failures: list[Exception], trial: Any) -> bool:
    """Keep what a rejected step raised, the last one of them; is it a mistake in a formula?"""
    if isinstance(trial, Rejected):
        failures[:] = [trial.error]
    return isinstance(trial, Rejected) and is_mistake(trial.error)


def started(
    method: Any, system: Any, t: float, state: Any, h: float, t_end: float, rtol: float, atol: float
) -> tuple[Any, float]:
    """The velocity at the start, and the first step if h is zero: from the size of the velocity and
    of its change, in a unit in which the state changes by its own size, so that seconds and years give one motion.

    Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., II.4,
    "Starting step size".
    """
    xi, speed, size = method.first_velocity(system, t, state, rtol, atol)
    if h == 0.0:
        h, unit = first_guess(t, t_end, speed, size)
        later = attempt(method.change_of_velocity, system, t, state, xi, h, rtol, atol)
        if accepted(later, itself):
            h = second_guess(t, t_end, speed, h, unit, later, method.error_order)
        else:
            h = 1e-3 * h
    return xi, h


def first_guess(t: float, t_end: float, speed: float, size: float) -> tuple[float, float]:
    """A step in which a hundredth of what is there changes, and the unit of time."""
    span, least = t_end - t, 8.0 * EPSILON * max(abs(t), abs(t_end))
    h = unit = abs(span)
    if speed > 0.0:
        h = min(max(0.01 * size / speed, least), abs(span))
        unit = 100.0 * h
    return (-h if span < 0.0 else h), unit


def second_guess(t: float, t_end: float, speed: float, h: float, unit: float, change: float, order: int) -> float:
    """The first step, by the change of the velocity in an Euler step h."""
    span, least = t_end - t, 8.0 * EPSILON * max(abs(t), abs(t_end))
    largest = unit * max(speed, change / abs(h) * unit)
    second = abs(span)
    if largest > 0.0:
        second = unit * (0.01 / largest) ** (1.0 / order)
    second = max(min(100.0 * abs(h), second, abs(span)), least)
    return second if span > 0.0 else -second
