"""Carries: the numbers from which a run goes on as if it had never stopped."""

from __future__ import annotations

import dataclasses
import functools
from typing import Any, ClassVar

import numpy as np

from ...errors import InvalidInput
from ...formulas.classes.frozen import frozen
from ...formulas.classes.layouts import build
from ...systems.system import State, member, state_of
from ..between.dense import unpacked
from ..between.events import NO_EVENTS, Met
from ..compiled.control import STEP, TAKEN, TIME
from ..compiled.prepared import RunShape
from ..stopped import Stopped


@frozen(eq=False)
class Carry:
    """A column of numbers for every body, with its clock, from which the run goes on as if it had never stopped."""

    fictive: ClassVar[bool] = False  # is its time a fictive one?

    # layouts and native code, where the plan that goes on has prepared them already
    shape: RunShape | None = dataclasses.field(repr=False)
    t0: Any  # the time of step 0 of fixed steps, one for all bodies or (bodies,); None for adaptive steps
    numbers: np.ndarray = dataclasses.field(repr=False)  # (width,) or (width, bodies), of the carry of the method
    # (7,) or (7, bodies), the numbers of a `Clock`: time, step h, number of steps, ...
    clock: np.ndarray = dataclasses.field(repr=False)
    last: np.ndarray = dataclasses.field(repr=False)  # (n,) or (n, bodies), the numbers of the state
    bodies: int | None = None  # the number of bodies of an ensemble; None for one body
    # by body that has ended, the error that ended it, or None for an event
    ended: dict[int, Any] = dataclasses.field(default_factory=dict, repr=False)
    # by body, the number of zeros of every event
    met: dict[int, Met] = dataclasses.field(default_factory=dict, repr=False)
    # by body with adaptive steps, the number of the event that ended its run
    cut: dict[int, int] = dataclasses.field(default_factory=dict, repr=False)

    @property
    def inner(self) -> Any:
        """The carry of the method: itself, as there is no fictive time."""
        return self

    @classmethod
    def made(
        cls, shape: Any, t0: Any, numbers: np.ndarray, clock: np.ndarray, last: np.ndarray,
        bodies: int | None = None, met: Any = None,
    ) -> Carry:  # fmt: skip
        """The carry of bodies that all go on; in half the time of the constructor."""
        carry = object.__new__(cls)
        carry.__dict__.update(
            shape=shape, t0=t0, numbers=numbers, clock=clock, last=last, bodies=bodies,
            ended={}, met={} if met is None else met, cut={},
        )  # fmt: skip
        return carry

    @classmethod
    def quickly(
        cls, shape: Any, t0: float, h: float, step: int, numbers: np.ndarray, last: np.ndarray,
        met: Any = None, bodies: int | None = None,
    ) -> Carry:  # fmt: skip
        """The carry of bodies after `step` fixed steps."""
        clock = np.array([t0 + step * h, h, 0.0, float(step), 0.0, 0.0, 0.0])
        if bodies is not None:
            clock = np.repeat(clock[:, None], bodies, axis=1)
        return cls.made(shape, t0, numbers, clock, last, bodies, met)

    # ---------------------------------------------------------------- when and where

    @property
    def h(self) -> Any:
        """The step, in s, or the steps of all bodies."""
        return self.clock.item(STEP) if self.bodies is None else one_or_all(self.clock[STEP])

    @property
    def step(self) -> int:
        """The number of steps taken; of an ensemble the largest among the bodies that go on."""
        if self.bodies is None:
            return int(self.clock.item(TAKEN))
        going = np.delete(self.clock[TAKEN], [*self.ended])
        return int((going if len(going) else self.clock[TAKEN]).max())

    @property
    def together(self) -> bool:
        """Whether all bodies that go on have made the same fixed steps, from the same time on."""
        going = np.delete(self.clock[TAKEN], [*self.ended])
        return np.ndim(self.t0) == 0 and bool(len(going)) and bool((going == going[0]).all())

    @property
    def t(self) -> Any:
        """The time, in s; those of all bodies, (bodies,), if they differ."""
        return self.clock.item(TIME) if self.bodies is None else one_or_all(self.clock[TIME])

    @functools.cached_property
    def state(self) -> State:
        """The state at the time of the carry, with a leading axis for an ensemble."""
        shape: Any = self.shape
        if self.bodies is None:
            return build(shape.shown, iter(self.last.ravel().tolist()))
        return state_of(type(shape.example), unpacked(shape.shown, self.last.T))

    # ---------------------------------------------------------------- bodies

    @property
    def stopped(self) -> Stopped:
        """The bodies that an error has ended."""
        steps = self.clock[TAKEN].reshape(-1)
        return Stopped(
            {i: int(steps[i]) for i, error in self.ended.items() if error is not None}, self.ended.__getitem__
        )

    def member(self, i: int) -> Carry:
        """The carry of body i alone."""
        if self.bodies is None:
            return self
        t0 = self.t0 if np.ndim(self.t0) == 0 else self.t0.item(i)
        numbers, clock, last = (x[:, i] for x in (self.numbers, self.clock, self.last))
        maps: Any = self.ended, self.met, self.cut
        maps_of_body = [{0: x[i]} if i in x else {} for x in maps]
        carry = Carry(None, t0, numbers, clock, last, None, *maps_of_body)
        vars(carry)["state"] = member(self.state, i)
        return carry

    @property
    def members(self) -> tuple[Any, ...]:
        """Carries of all bodies, one for each."""
        return tuple([self.member(i) for i in range(self.bodies or 1)])

    @staticmethod
    def beside(carries: list[Any]) -> Carry:
        """The carries of several ensembles joined to one."""
        first, first_bodies = carries[0], np.cumsum([0, *[c.bodies for c in carries]]).tolist()
        zeros = [np.broadcast_to(c.t0, c.bodies) for c in carries]

        def moved(name: str) -> dict[int, Any]:
            pairs = zip(first_bodies, carries, strict=False)
            return {at + i: x for at, c in pairs for i, x in getattr(c, name).items()}

        numbers, clock, last = (
            np.concatenate([getattr(c, name) for c in carries], axis=1) for name in ("numbers", "clock", "last")
        )
        t0 = None if first.t0 is None else one_or_all(np.concatenate(zeros))
        maps = moved("ended"), moved("met"), moved("cut")
        carry = Carry(None, t0, numbers, clock, last, first_bodies[-1], *maps)
        vars(carry)["state"] = all_of([c.state for c in carries])
        return carry

    # ---------------------------------------------------------------- going on

    def put_down(self, numbers: np.ndarray, heads: np.ndarray) -> None:
        """Write what the bodies carry along, and their states, into columns.  Raises InvalidInput for
        numbers of another width, on which native code relies.
        """
        if self.numbers.size != numbers.size or self.last.size != heads.size:
            raise InvalidInput(
                f"Plan.resume: the run carries {self.numbers.shape} numbers along, this plan "
                f"{numbers.shape}: the run had another `compensated` or `precision` than the plan has"
            )
        numbers[:] = self.numbers.reshape(numbers.shape)
        heads[:] = self.last.reshape(heads.shape)

    def __getstate__(self) -> dict[str, Any]:
        """The numbers, and the state instead of layouts and native code, which the plan that goes
        on has.
        """
        return vars(self) | {"state": self.state, "shape": None}


@frozen(eq=False)
class SiteCarry:
    """The state and the numbers from which a run of many sites goes on as if it had never stopped."""

    fictive: ClassVar[bool] = False

    t0: float  # the time of step 0, in s; the time is t0 + step h
    h: float
    step: int
    # (width, sites), of the carry of the method
    numbers: np.ndarray = dataclasses.field(repr=False)
    state: Any = dataclasses.field(repr=False)
    met: Met = NO_EVENTS  # the numbers of zeros of events
    # (7,), the clock of adaptive steps, whose h and step above are zero; None for fixed steps
    clock: np.ndarray | None = dataclasses.field(default=None, repr=False)
    event: int | None = None  # the number of the event that ended the run
    bodies: None = None

    @property
    def inner(self) -> Any:
        """The carry of the method: itself, as there is no fictive time."""
        return self

    @property
    def t(self) -> Any:
        """The time t0 + step h, in s."""
        return self.t0 + self.step * self.h


def one_or_all(values: Any) -> Any:
    """The value of all elements if they are equal, else an array of them."""
    flat = np.ravel(values)
    return flat.item(0) if (flat == flat[0]).all() else np.array(flat)


def all_of(states: list[Any]) -> Any:
    """The states of several ensembles joined to one."""
    names = states[0].arrays
    return state_of(type(states[0]), {n: np.concatenate([s.arrays[n] for s in states]) for n in names})
