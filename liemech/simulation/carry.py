"""Where a run stands: what it hands on to the run that continues it."""

from __future__ import annotations

import dataclasses
import functools
from typing import Any

import numpy as np

from ..errors import IntegrationFailure, InvalidInput, failure
from ..formulas.frozen import frozen
from ..formulas.pytree import build
from ..systems.system import State, member, state_of
from .control import CLOCK, MARK, REJECTED, STEP, TAKEN
from .dense import unpacked
from .events import NO_EVENTS, Met
from .prepared import Shape
from .stopped import Stopped


@frozen(eq=False)
class Carry:
    """Where a run with fixed steps stands, with all that its method carries along: from here it goes
    on as if it had never stopped.

    t0, h, step : the time is t0 + step h; h is one for each body if they have steps of their own.
    bodies : of an ensemble.
    numbers : (width,) or (width, bodies), of what the method carries along.
    last : the numbers of the state.
    failures : what ended bodies that stopped.  Nothing else of it is changed, ever.
    met : how many zeros of every event were met.
    taken : (bodies,) of an ensemble of which bodies stopped the steps that each took.
    """

    shape: Shape | None = dataclasses.field(repr=False)
    t0: float
    h: float | tuple[float, ...]
    step: int
    bodies: int | None
    numbers: np.ndarray = dataclasses.field(repr=False)
    last: np.ndarray = dataclasses.field(repr=False)
    failures: dict[int, Exception | None] = dataclasses.field(default_factory=dict, repr=False)
    met: Met = NO_EVENTS
    taken: np.ndarray | None = dataclasses.field(default=None, repr=False)

    @classmethod
    def quickly(
        cls, shape: Shape, t0: float, h: Any, step: int, numbers: np.ndarray, last: np.ndarray,
        met: Met = NO_EVENTS, bodies: int | None = None,
    ) -> Carry:  # fmt: skip
        """Of bodies that have not failed, in half the time that a dataclass takes."""
        made = object.__new__(cls)
        made.__dict__.update(
            shape=shape, t0=t0, h=h, step=step, bodies=bodies, numbers=numbers, last=last,
            failures={}, met=met, taken=None,
        )  # fmt: skip
        return made

    @property
    def steps(self) -> Any:
        """How many steps were taken, by each body if some have stopped."""
        return self.step if self.taken is None else np.maximum(self.taken, 0)

    @property
    def t(self) -> Any:
        """The time, in s; of bodies with steps of their own, or of which some stopped, those of all,
        (bodies,).
        """
        return self.t0 + self.steps * (self.h if type(self.h) is float else np.array(self.h))

    @functools.cached_property
    def state(self) -> State:
        """The state at this time."""
        shape: Any = self.shape
        if self.bodies is None:
            return build(shape.shown, iter(self.last.ravel().tolist()))
        parts = unpacked(shape.shown, self.last.T)
        return type(shape.example)(*(parts.get(name) for name in shape.example.parts))

    @property
    def stopped(self) -> Stopped:
        """The bodies of an ensemble that go no further."""
        steps = {} if self.taken is None else {
            int(i): max(0, int(self.taken[i])) for i in np.flatnonzero(self.taken < self.step)
        }  # fmt: skip
        return Stopped(steps, lambda i: self.error(i, steps[i]))

    def error(self, i: int, steps: int) -> IntegrationFailure:
        """Why a body stopped, after so many steps."""
        error = self.failures.get(i)
        t = self.t0 + steps * (self.h if type(self.h) is float else self.h[i])  # type: ignore[index]
        return failure(error, f"body {i}", f"step {steps + 1}, t = {t:g}")

    def member(self, i: int) -> Any:
        """The carry of a body of an ensemble, or where it has ended."""
        if self.bodies is None:
            return self
        state, h = member(self.state, i), self.h if type(self.h) is float else self.h[i]  # type: ignore[index]
        if i in self.ended:
            steps = int(self.steps[i])
            return Ended(state, self.t0 + steps * h, steps, self.error(i, steps))
        own = Carry(None, self.t0, h, self.step, None, self.numbers[:, i], self.last[:, i])
        vars(own)["state"] = state
        return own

    @property
    def ended(self) -> list[int]:
        """The bodies that go no further."""
        return [] if self.taken is None else np.flatnonzero(self.taken < self.step).tolist()

    def __getstate__(self) -> dict[str, Any]:
        """The numbers, and the state instead of layouts and native code, which the plan that goes
        on has.
        """
        return vars(self) | {"state": self.state, "shape": None}


@frozen(eq=False)
class AdaptiveCarry:
    """Where a run with adaptive steps stands: state and velocity, clock and controller.

    event : which one ended it, if one did.  met : as of a Carry.
    """

    numbers: np.ndarray = dataclasses.field(repr=False)
    clock: np.ndarray = dataclasses.field(repr=False)
    state: State
    t: float
    event: int | None = None
    met: Met = NO_EVENTS
    bodies: None = None
    ended = ()

    def member(self, i: int) -> Any:
        """The carry of the only body."""
        return self

    def taken_up(self, t_end: float, width: int) -> tuple[np.ndarray, np.ndarray]:
        """Numbers and clock with which a run to t_end goes on: it counts its own steps.

        width : how many numbers such a run carries along, which native code relies on.
        """
        numbers, clock = np.array(self.numbers, dtype=float), np.array(self.clock, dtype=float)
        if numbers.shape != (width,) or clock.shape != (CLOCK.width,):
            raise InvalidInput(
                f"Plan.resume: the run carries {numbers.shape} numbers and a clock of {clock.shape} "
                f"along; this plan has ({width},) and ({CLOCK.width},)"
            )
        clock[[TAKEN, REJECTED, MARK]] = 0.0
        if clock[STEP] * (t_end - self.t) < 0.0:
            clock[STEP] = -clock[STEP]
        return numbers, clock


@frozen(eq=False)
class Waiting:
    """A body of an ensemble whose run has not begun: its start, and when."""

    state: State
    t: float


@frozen(eq=False)
class Ended:
    """A body of an ensemble that goes no further: where it stays, after how many steps, and the
    error that ended it, if it was one.

    tau, z, origin : of a run in fictive time.
    """

    state: State
    t: float
    steps: int
    error: IntegrationFailure | None = None
    tau: float = 0.0
    z: float | None = None
    origin: Any = None


@frozen(eq=False)
class Carries:
    """Where an ensemble stands whose bodies go each its own way: every body where it came to.

    members : what each carries along, or that it has not begun, or has ended.
    """

    members: tuple[Any, ...] = dataclasses.field(repr=False)

    @property
    def bodies(self) -> int:
        """How many there are."""
        return len(self.members)

    def member(self, i: int) -> Any:
        """The carry of a body, or where it has ended."""
        return self.members[i]

    @property
    def ended(self) -> list[int]:
        """The bodies that go no further."""
        return [i for i, one in enumerate(self.members) if isinstance(one, Ended)]

    @property
    def t(self) -> Any:
        """The time, in s; those of all, (bodies,), if they differ."""
        return self._common([member.t for member in self.members])

    @property
    def tau(self) -> Any:
        """The same in fictive time."""
        return self._common([getattr(member, "tau", 0.0) for member in self.members])

    @staticmethod
    def _common(times: list[float]) -> Any:
        return times[0] if len(set(times)) == 1 else np.array(times)

    @functools.cached_property
    def state(self) -> State:
        """The states of all bodies."""
        return stacked([member.state for member in self.members])


def stacked(states: list[Any]) -> Any:
    """The states of single bodies as that of an ensemble."""
    arrays = {name: np.stack([s.arrays[name] for s in states]) for name in states[0].arrays}
    return state_of(type(states[0]), arrays)
