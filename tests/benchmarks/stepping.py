"""Single steps of native code, without the call of `integrate` around them, in turn with the C++ of the same step."""

import time
from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any

import harness
import numpy as np

from liemech.simulation.compiled.prepared import Steps
from liemech.simulation.options import Options
from liemech.simulation.runs.equal import StraightRun
from liemech.simulation.runs.short import LONGEST, advanced, place_of


class Native:
    """A method on a system in native code: call it with a number of steps for the state after them,
    as one row of numbers.

    compensate : as for `integrate`; ordinary sums, as in the C++, unless it is asked for.
    """

    def __init__(self, system: Any, method: Any, start: Any, h: float, compensate: bool | None = False) -> None:
        self.plan = plan_of(Steps(system, method, h, 1, compensate, "double", True, False, 1))
        self.carry = StraightRun(self.plan, start, 0.0, 0, None, None).trajectory().carry
        place = place_of(self.plan._steps, self.carry.shape)
        self.most = LONGEST // place.carried**2  # steps at once

    def __call__(self, steps: int) -> np.ndarray:
        end = self.carry
        for done in range(0, steps, self.most):
            now = min(self.most, steps - done)
            end = advanced(self.plan._steps, end, now)
            if end is None:
                raise SystemExit(f"{now} of {steps} steps were not made at once")
        return end.last


def plan_of(steps: Steps) -> Any:
    """A Plan of any method and system, in fictive time too."""
    given = dict.fromkeys(Options._fields) | {"compiled": True, "progress": False}
    return SimpleNamespace(
        recorder=None,
        system=steps.system, method=steps.method, events=(), of_each={},
        options=Options(**given | {"workers": 1}), _steps=steps,
    )  # fmt: skip


def agreeing(runs: Mapping[str, Callable[[int], np.ndarray]], tolerance: float = 1e-13) -> None:
    """All runs give the same momentum, and the same element where they have one."""
    for steps in (1, 20):
        ends = {name: run(steps) for name, run in runs.items()}
        first = next(iter(ends.values()))
        for name, end in ends.items():
            if not np.abs(end - first).max() <= tolerance:
                raise SystemExit(
                    f"{name} differs from {next(iter(ends))} by {np.abs(end - first).max():.1e} after {steps} steps"
                )


def measure(runs: Mapping[str, Callable[[int], Any]], repetitions: int, duration: float) -> dict[str, harness.Timing]:
    """ns per step in turn, again and again: processor time, so that other processes count little,
    less that of the call.
    """

    def seconds(run: Callable[[int], Any], steps: int) -> float:
        begin = time.process_time()
        run(steps)
        return time.process_time() - begin

    steps, calls = {}, {}
    for name, run in runs.items():
        calls[name] = min(seconds(run, 1) for _ in range(20))
        steps[name] = max(50, int(1000 * duration / max(1e-9, min(seconds(run, 1000) for _ in range(5)) - calls[name])))
    spent: dict[str, list[float]] = {name: [] for name in runs}
    for _ in range(repetitions):
        for name, run in runs.items():
            spent[name].append((seconds(run, steps[name]) - calls[name]) / (steps[name] - 1) * 1e9)
    return {name: harness.Timing(np.array(values)) for name, values in spent.items()}
