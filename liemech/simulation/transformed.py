"""Runs in a fictive time: fixed steps there, of many lengths in physical time, which is
carried along and met exactly.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import numpy as np

from ..errors import IntegrationFailure, InvalidTimeScale, StepWarning, warn
from ..formulas.pytree import layout_of, leaves
from ..systems.system import State, small_state
from .arrival import FictiveMotion
from .carry import Carry
from .checkpoint import Checkpoint
from .dense import unpacked
from .equal import StraightRun
from .fictive import FictiveCarry, Origin, in_fictive_time
from .stopped import NONE
from .trajectory import Trajectory, TransformedTrajectory


class TransformedRun:
    """One run in fictive time, from a start at a time or from where another one stands.

    whole : the system whose state carries time along.  now : where its motion begins.
    """

    def __init__(
        self, plan: Any, start: State | FictiveCarry, t0: float, kept: Checkpoint | None = None
    ) -> None:
        self.now: Any
        self.carry: Any = None
        if isinstance(start, FictiveCarry):
            self.origin, self.carry, self.now, self.t0 = start.origin, start, start.inner, start.t
            self.bodies, self.before = start.bodies, start.step
        else:
            self.origin = Origin(plan.system, plan.method, start)
            self.t0, self.bodies, self.before = t0, start.bodies, 0
            self.now = self.origin.begun(t0)
        self.whole, self.kept = self.origin.whole, kept
        self.steps_made = self.origin.steps(plan._steps)
        self.h = self.steps_made.h
        self.plan = plan.in_fictive_time(self.origin)
        self.system, self.method = self.whole.system, plan.method
        self.way = self.steps_made.way_of(0)
        if self.carry is None and self.bodies is None:
            doubt = self.method.step_warning(self.whole, self.now, self.h)
            if doubt:
                warn(doubt, StepWarning)
        if kept is not None:
            shown = kept.shown
            kept.shown = lambda run: shown(self.presented(run))

    def steps(self, steps: int) -> Trajectory:
        """So many fixed steps in fictive time, for one body or an ensemble."""
        with self._failures():
            made = StraightRun(self.plan, self.now, 0.0, steps, None, None, self.kept).trajectory()
        return self.presented(made)

    @contextmanager
    def _failures(self) -> Iterator[None]:
        """Around the loop of fixed steps: the samples of a failed run are shown as those
        of a run in fictive time.
        """
        try:
            yield
        except BaseException as error:
            if isinstance(getattr(error, "trajectory", None), Trajectory):
                run = error.trajectory = self.presented(error.trajectory)  # type: ignore[attr-defined]
                if isinstance(error, IntegrationFailure) and error.reached is not None:
                    self.stopped(error, error.reached, self.before + run.steps)
            raise

    def stopped(self, error: IntegrationFailure, there: Any, steps: int) -> None:
        """Tell of a failure where the last step that was accepted led: a state of the extended
        system, after so many steps.
        """
        t, states, z = self.whole.apart({name: x[None] for name, x in there.arrays.items()})
        kind = type(self.origin.start)
        error.reached = small_state(kind, {name: x[0] for name, x in states.items()})
        error.clock = float(t[0]), steps * self.h, None if z is None else float(z[0])

    def presented(self, run: Trajectory) -> TransformedTrajectory:
        """Samples of the extended system as those of the system."""
        if isinstance(run, TransformedTrajectory):
            return run
        carry: Any = run.carry
        if carry is not None and self.bodies is None:
            carry = FictiveCarry(self.origin, carry)
        elif carry is not None:
            carry = in_fictive_time(self.origin, carry, self.h)
        more = {"steps": run.steps, "compiled": run.compiled, "carry": carry}
        if run.bodies is None:
            numbers = np.concatenate(
                [_floats(x).reshape(len(run), -1) for x in run.states.values()], axis=1
            )
            tau, ahead = run.t, None if self.carry is None else self.carry.ahead
            if ahead is not None:  # the first sample is the last one before
                numbers[0], tau[0] = leaves(ahead, layout_of(ahead)), self.carry.tau
                if len(tau) > 1 and tau[1] == tau[0]:
                    numbers, tau = numbers[1:], tau[1:]
            return self.result(
                self.whole.apart(unpacked(layout_of(self.example), numbers))[0],
                numbers,
                tau,
                **more,
            )
        t, states, z = self.whole.apart(run.states)
        return self._made(t, states, run.t, bodies=run.bodies, stopped=run.stopped, z=z, **more)

    @property
    def example(self) -> Any:
        """A state of the extended system."""
        return self.now.state if isinstance(self.now, Carry) else self.now

    def result(
        self, t: np.ndarray, numbers: np.ndarray, tau: np.ndarray, **more: Any
    ) -> TransformedTrajectory:
        """A trajectory of one body: times, numbers of the samples of the extended system, (n,
        width), and fictive times.
        """
        _, states, z = self.whole.apart(unpacked(layout_of(self.example), numbers))
        if "dense" not in more:
            more["dense"] = self.motion(t, numbers)
        return self._made(t, states, tau, bodies=None, z=z, **more)

    def motion(self, t: np.ndarray, numbers: np.ndarray) -> Any:
        """The motion between samples of one body."""
        kind, carry, begun = type(self.origin.start), self.carry, None
        if carry is not None and carry.ahead is not None and t[0] == self.t0:
            begun = np.append(carry.inner.last, carry.tau - carry.inner.t)
        given = t, numbers, self.steps_made.compiled, begun
        return FictiveMotion(self.way, self.whole, kind, self.example, self.h, *given)

    def _back(self, t: np.ndarray) -> bool:
        """Does physical time go back?"""
        later, before = (t[1:], t[:-1]) if self.h > 0.0 else (t[:-1], t[1:])
        return bool((later < before).any())

    def _made(
        self, t: np.ndarray, states: Any, tau: np.ndarray, **more: Any
    ) -> TransformedTrajectory:
        carry = more.pop("carry", None)
        known: dict[str, Any] = {"system": self.system, "method": self.method, "h": self.h}
        known |= {"t": t, "states": states, "tau": tau, "origin": self.origin, "stopped": NONE}
        rest = SimpleNamespace(carry=carry if callable(carry) else lambda: carry)
        made: Any = TransformedTrajectory.promised(rest, **known | more)
        if self._back(t):
            error = InvalidTimeScale(
                "integrate: physical time went back; "
                f"{self.whole.sigma!r} is not positive all the way"
            )
            error.trajectory = made
            raise error
        return made


def _floats(array: np.ndarray) -> np.ndarray:
    """Numbers, a complex one as two."""
    array = np.ascontiguousarray(array)
    return array.view(float) if np.iscomplexobj(array) else array
