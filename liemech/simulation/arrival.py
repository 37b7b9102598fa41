"""The state at a given physical time of a run in fictive time: a last step, as long as it must be."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..compiler import kernel
from ..compiler.driver import attempt, read
from ..errors import InvalidInput
from ..formulas.frozen import frozen
from ..formulas.pytree import NUMBER, layout_of, rounded
from ..systems.system import state_of
from .control import landed
from .dense import Between, evaluated, one_or_many, told, unpacked


def arrive(
    method: Any, system: Any, reached: Any, h: float, given: Any, out: Any, failures: Any
) -> None:
    """The driver: from a sample, steps until a given time is passed, and instead of the last one a
    shorter one to it.

    given : the sample and the time.  reached : layout of the sample then, and the fictive time that
    went by; behind them out has a one, or a zero as in `along`.
    """
    sample = read(given, 0, reached.parts[0])
    target = read(given, reached.parts[0].width, NUMBER)
    told(attempt(arrived, method, system, sample, h, target), reached, out, failures)


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


def arrivals(
    method: Any, system: Any, example: Any, h: Any, given: np.ndarray, wanted: bool | None,
    body: np.ndarray | None = None,
) -> np.ndarray:  # fmt: skip
    """From samples, (m, width + 1) with the times to be reached, the samples then, and the fictive
    times that went by.

    body : of each sample, where parameters, and h, are of each body.
    """
    reached = layout_of((example, 0.0))
    step = h if np.ndim(h) == 0 else kernel.Several.of(h.tolist(), len(h))
    what = repr(method), lambda k: f"on the way to t = {given[k, -1]:g}"
    arguments = method, system, reached, step
    return evaluated(arrive, arguments, given, reached.width, wanted, what, body)


@frozen(eq=False)
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
        return arrivals(self.method, self.system, self.example, self.h, given, self.wanted)

    def __call__(self, times: Any) -> Any:
        """The state at one time, or at many, (m,), whose arrays then have a leading axis."""
        at = one_or_many(times)
        states = self._own(self.numbers(np.atleast_1d(at).ravel()))
        one = 0 if at.ndim == 0 else slice(None)
        return state_of(self.kind, {name: x[one] for name, x in states.items()})

    def _own(self, numbers: np.ndarray) -> dict[str, np.ndarray]:
        """Of the numbers of states with their clock the parts of the states themselves."""
        shown = layout_of(self.example)
        return self.system.apart(unpacked(shown, numbers[:, : shown.width]))[1]
