"""The state at a given physical time of a run in fictive time: a last step, as long as it must be."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..compiler.driver import accepted, attempt, itself, read, reason, write
from ..errors import InvalidInput, failure, is_mistake
from ..formulas.pytree import NUMBER, layout_of, rounded
from ..systems.system import small_state, state_of
from .dense import Between, flat, one_or_many, unpacked
from .execution import Execution

TURNS = 60
"""Trials after which the step to a given time is taken as it is; a good one needs five."""

ULP = 2.0**-52


def arrive(
    method: Any, system: Any, shown: Any, h: float, count: int, given: Any, out: Any, failures: Any
) -> None:
    """The driver: from each of many samples, steps until a given time is passed, and instead of the
    last one a shorter one to it.

    given : for each the sample and the time.  out : the sample then, the fictive time that went by,
    and 1 (0 if a step failed).
    """
    for k in range(count):
        at = k * (shown.width + 1)
        trial = attempt(
            arrived,
            method,
            system,
            read(given, at, shown),
            h,
            read(given, at + shown.width, NUMBER),
        )
        good = accepted(trial, itself)
        at = k * (shown.width + 2)
        if good:
            write(out, at, trial[0], shown)
            write(out, at + shown.width, trial[1], NUMBER)
            write(out, at + shown.width + 1, 1.0, NUMBER)
        else:
            write(out, at + shown.width + 1, 0.0, NUMBER)
            if failures is not None:
                failures.append(reason(trial))


def arrived(method: Any, system: Any, sample: Any, h: float, target: float) -> tuple[Any, float]:
    """The sample at the time `target`, and the fictive time to it, from a sample before it."""
    memory = method.start(system, sample, h)
    now = sample
    passed, gone = (system.clock(now) - target) * h >= 0.0, 0.0
    while not passed:
        after = method.step(system, gone, memory, h)
        seen = rounded(method.observe(after))
        passed = (system.clock(seen) - target) * h >= 0.0
        if not passed:
            memory, now, gone = after, seen, gone + h
    found, s = landed(method, system, memory, h, target)
    return found, gone + s


def landed(method: Any, system: Any, memory: Any, h: float, target: float) -> tuple[Any, float]:
    """The sample at the time `target`, at most a step away, and the length s of the step there.

    The time after a step grows with its length; the secant method finds s, halving where it leaves
    what is left of the interval.
    Source: Dahlquist and Bjorck, Numerical Methods, section 6.4.
    """
    found = rounded(method.observe(memory))
    low, high, before = 0.0, h, 0.0
    error_before = system.clock(found) - target
    error, s, turns = error_before, h, 0
    done = error_before == 0.0
    if done:
        s = 0.0
    while not done:
        found = rounded(method.observe(method.step(system, 0.0, memory, s)))
        error = system.clock(found) - target
        if error * h < 0.0:
            low = s
        else:
            high = s
        slope = (error - error_before) / (s - before)
        new = s - error / slope if slope != 0.0 else low
        if not (min(low, high) < new < max(low, high)):
            new = 0.5 * (low + high)
        turns = turns + 1
        done = error == 0.0 or abs(new - s) <= ULP * abs(s) or turns >= TURNS
        if not done:
            before, error_before, s = s, error, new
    return found, s


@dataclass(frozen=True, eq=False)
class FictiveMotion(Between):
    """The motion between the samples of a run: from the last one before, steps of the method, the
    last of them shorter.

    So the state at a time is that of a run that ends there, up to rounding.

    begun : of a run whose first sample lies inside of a step, where that step begins, and the
    fictive time from there to the sample, (width + 1,).
    """

    method: Any
    system: Any
    kind: Any
    example: Any
    h: float
    t: np.ndarray
    points: np.ndarray
    wanted: bool | None
    begun: np.ndarray | None = None
    shape: ClassVar[Any] = None

    def of_shape(self, shape: Any) -> FictiveMotion:
        """The same, where what the run has prepared may be used."""
        object.__setattr__(self, "shape", shape)
        return self

    def __getstate__(self) -> dict[str, Any]:
        """Without native code."""
        return {name: x for name, x in vars(self).items() if name != "shape"}

    def numbers(self, times: np.ndarray) -> np.ndarray:
        """At each of these times the numbers of the state with its clock, and the fictive time
        since the sample, (m, width + 1).
        """
        t = self.t
        inside = (times >= min(t[0], t[-1])) & (times <= max(t[0], t[-1]))
        if not inside.all():
            raise InvalidInput(
                f"t = {times[~inside][0]:g} is outside the run, "
                f"which goes from {t[0]:g} to {t[-1]:g}"
            )
        sign = 1.0 if self.h > 0.0 else -1.0
        last = np.searchsorted(sign * t, sign * times, "right") - 1
        found = np.concatenate([self.points[last], np.zeros((len(times), 1))], axis=1)
        away = np.flatnonzero(times != t[last])
        given = np.concatenate([self.points[last[away]], times[away, None]], axis=1)
        inside = (last[away] == 0) & (self.begun is not None)
        if self.begun is not None:
            given[inside, :-1] = self.begun[:-1]
        found[away] = self._moved(given)
        if self.begun is not None:
            found[away[inside], -1] -= self.begun[-1]
        return found

    def _moved(self, given: np.ndarray) -> np.ndarray:
        shown, many = layout_of(self.example), len(given)
        arguments, array, shape = (self.method, self.system, shown, self.h), np.empty(1), self.shape
        call = *arguments, 1, array, array, None
        execution = (
            Execution(self.wanted, False, arrive, *call)
            if shape is None
            else shape.other(arrive, *call)
        )
        found, done, failures = np.empty((many, shown.width + 2)), 0, []  # type: Any, int, list[Any]
        while done < many:
            if execution.ready(done / many):
                run: Any = execution.native
                rest = np.ascontiguousarray(given[done:]).ravel()
                out = np.empty((many - done) * (shown.width + 2))
                run(*arguments, many - done, rest, out, None)
                found[done:] = out.reshape(many - done, -1)
                break
            out = np.empty(shown.width + 2)
            with execution.plain():
                arrive(*arguments, 1, np.ascontiguousarray(given[done]), out, failures)
            found[done] = out
            done += 1
        for k in np.flatnonzero(found[:, -1] == 0.0).tolist():
            arrive(
                *arguments, 1, np.ascontiguousarray(given[k]), np.empty(shown.width + 2), failures
            )
            error = failures[0]
            if is_mistake(error):
                raise error
            raise failure(error, repr(self.method), f"on the way to t = {given[k, -1]:g}")
        return found[:, :-1]

    def __call__(self, times: Any) -> Any:
        """The state at one time, or at many, (m,), whose arrays then have a leading axis."""
        at = one_or_many(times)
        states = self._own(self.numbers(np.atleast_1d(at).ravel()))
        one = 0 if at.ndim == 0 else slice(None)
        return state_of(self.kind, {name: x[one] for name, x in states.items()})

    def seen(self, numbers: np.ndarray) -> tuple[Any, np.ndarray]:
        """Of the numbers of states with their clock the layout and the numbers of what formulas
        take.
        """
        return layout_of(self._small(numbers[:1])), flat(self._own(numbers), len(numbers))

    def state(self, t: float) -> Any:
        """The state at a time as formulas take it."""
        return self._small(self.numbers(np.array([t])))

    def end(self, k: int) -> Any:
        """The state at the k-th end of a step as formulas take it."""
        return self._small(self.points[k : k + 1])

    def _own(self, numbers: np.ndarray) -> dict[str, np.ndarray]:
        """Of the numbers of states with their clock the parts of the states themselves."""
        shown = layout_of(self.example)
        return self.system.apart(unpacked(shown, numbers[:, : shown.width]))[1]

    def _small(self, numbers: np.ndarray) -> Any:
        return small_state(self.kind, {name: x[0] for name, x in self._own(numbers).items()})
