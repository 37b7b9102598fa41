"""The state at a given physical time of a run in fictive time: a last step, as long as it must be."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from ...compiler import kernel
from ...compiler.driver import attempt, read
from ...formulas.classes.frozen import frozen
from ...formulas.classes.layouts import NUMBER, layout_of
from ...formulas.numbers.conversions import rounded
from ...simulation.between.dense import MotionBetween, evaluated, report, unpacked
from ...simulation.compiled.control import landed


def arrive(method: Any, system: Any, reached: Any, h: float, inputs: Any, out: Any, failures: Any) -> None:
    """The driver: from a sample, steps until a time is passed, and instead of the last one a
    shorter one to it.

    inputs : the sample and the time.  reached : layout of the sample then, and the fictive time that
    went by; behind them out has a one, or a zero as in `along`.
    """
    sample = read(inputs, 0, reached.parts[0])
    target = read(inputs, reached.parts[0].width, NUMBER)
    report(attempt(arrived, method, system, sample, h, target), reached, out, failures)


def arrived(method: Any, system: Any, sample: Any, h: float, target: float) -> tuple[Any, float]:
    """The sample at the time `target`, and the fictive time to it, from a sample before it."""
    memory = method.start(system, sample, h)
    current = sample
    passed, passed_tau = (system.clock(current) - target) * h >= 0.0, 0.0
    while not passed:
        after = method.step(system, passed_tau, memory, h)
        sample_after = rounded(method.observe(after))
        passed = (system.clock(sample_after) - target) * h >= 0.0
        if not passed:
            memory, current, passed_tau = after, sample_after, passed_tau + h
    arrival, s = landed(method, system, memory, h, target)
    return arrival, passed_tau + s


def arrivals(
    method: Any, system: Any, example: Any, h: Any, inputs: np.ndarray, wanted: bool | None,
    body: np.ndarray | None = None,
) -> np.ndarray:  # fmt: skip
    """From samples, (m, width + 1) with the times to be reached, the samples then, and the fictive
    times that went by.

    body : of each sample, where parameters, and h, are of each body.
    """
    reached = layout_of((example, 0.0))
    step = h if np.ndim(h) == 0 else kernel.Several.of(h.tolist(), len(h))
    what = repr(method), lambda k: f"on the way to t = {inputs[k, -1]:g}"
    arguments = method, system, reached, step
    return evaluated(arrive, arguments, inputs, reached.width, wanted, what, body)


def velocity_in_time(system: Any, t: float, state: Any) -> Any:
    """The velocity in physical time of a state with a clock."""
    return rounded(system.system.rate(t, system.system.essential_part(state.without_clock())))


@frozen(eq=False)
class FictiveMotion(MotionBetween):
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
    h: Any
    rows: Any
    wanted: bool | None
    begun: np.ndarray | None = None
    closer: ClassVar[bool] = True

    @property
    def points(self) -> np.ndarray:
        """The numbers of the states with their clock, and the fictive times, (n + 1, width + 1)."""
        return self.rows[:, 1:]

    def inputs(self, before: np.ndarray, after: np.ndarray, times: np.ndarray) -> np.ndarray:
        """The state where a step begins, the time to be reached, the fictive time there, and how far
        behind it the step begins.
        """
        parts = before[:, 1:-1], times[:, None], before[:, -1:], np.zeros((len(times), 1))
        numbers = np.concatenate(parts, axis=1)
        if self.begun is not None:
            first = before[:, 0] == self.t[0]
            numbers[first, :-3], numbers[first, -1] = self.begun[:-1], self.begun[-1]
        return numbers

    def moved(self, inputs: np.ndarray, times: np.ndarray, body: np.ndarray | None = None) -> np.ndarray:
        """Behind the numbers of the states, the fictive times."""
        run = self.method, self.system, self.example, self.h, inputs[:, :-2], self.wanted, body
        ends = arrivals(*run)
        ends[:, -1] = inputs[:, -2] + (ends[:, -1] - inputs[:, -1])
        return ends

    def looks(self, before: np.ndarray, after: np.ndarray, body: np.ndarray) -> np.ndarray:
        """By the velocities at both ends, in physical time."""
        (system,) = kernel.examples([self.system])
        return self._by_velocities(velocity_in_time, system.system.group, before, after, body)

    def apart(self, numbers: np.ndarray) -> tuple[Any, dict[str, np.ndarray]]:
        states = unpacked(layout_of(self.example), numbers[:, : self.width])
        return self.kind, self.system.apart(states)[1]
