"""One run that is advanced by hand: for control loops, filters and live pictures."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np

from ..errors import IntegrationInterrupted
from ..systems.system import State
from . import arguments, short
from .carry import Carry
from .dense import unpacked
from .fictive import FictiveCarry
from .short import Place, place_of
from .sites_carry import SiteCarry
from .stopped import Stopped


class Stepper:
    """One run with fixed steps, advanced by hand; `Plan.stepper` makes it.

    It stands at a time and in a state, whose parts are attributes, arrays: `mu`, `g`, ...  All of
    it is what `Plan.run` gives, to the bit.

    What formulas read from outside counts as it is when the run begins, as in any other, and not
    anew at every step, of which it would be the larger part.  `refresh` looks at it again.

    Threads may share it: one steps at a time.  It can be pickled, and goes on where it stood.
    """

    def __init__(self, plan: Any, carry: Any) -> None:
        self._plan, self._lock = plan, threading.RLock()
        self._stand(carry)

    def step(self, steps: int = 1) -> None:
        """Go on by so many steps.

        Raises what `integrate` raises.  Then it stands before the step that failed, and after
        Ctrl-C where it has come to.
        """
        if type(steps) is not int or steps < 1:
            steps = arguments.count(steps, "steps", 1)
        with self._lock:
            here = self._here
            while here is not None and steps:
                before, some = here.taken, min(steps, here.most)
                try:
                    here.advance(some)
                except KeyboardInterrupt:
                    raise IntegrationInterrupted(
                        f"Stepper.step: interrupted after {here.taken} steps, where it stands now"
                    ) from None
                made = here.taken - before
                steps -= made
                if made < some:
                    break
            if steps:
                self._slowly(steps)

    def refresh(self) -> None:
        """Look again at what formulas read from outside: the next steps are made with what is there
        now.
        """
        with self._lock:
            self._stand(self.carry)

    @property
    def carry(self) -> Any:
        """What the method carries along here, for `Plan.step`; it does not change."""
        with self._lock:
            if self._here is None:
                return self._carry
            inner, given = self._here.carry, self._carry
            if isinstance(inner, Carry) and self._fictive:
                return FictiveCarry(given.origin, inner, met=given.met)
            return inner

    @property
    def t(self) -> Any:
        """The time, in s: t0 + n h after n steps; in fictive time the physical one."""
        here = self._here
        if here is None:
            return self._carry.t
        if not self._fictive:
            return here.t
        with self._lock:
            whole = self._carry.origin.whole
            return float(whole.apart({name: x[None] for name, x in here.parts.items()})[0][0])

    @property
    def steps(self) -> int:
        """How many steps were taken, from the start on."""
        here = self._here
        return int(self._carry.step) if here is None else here.taken

    @property
    def stopped(self) -> Stopped:
        """The bodies of an ensemble that go no further: after how many steps, and why."""
        carry: Any = self.carry
        stopped: Stopped = (carry.inner if self._fictive else carry).stopped
        return stopped

    @property
    def state(self) -> State:
        """The state at this time."""
        state: State = self.carry.state
        return state

    def __getattr__(self, name: str) -> Any:
        """A part of the state, an array of its own."""
        if name.startswith("_"):
            raise AttributeError(name)
        with self._lock:
            if self._here is not None and not self._fictive and name in self._here.parts:
                return self._here.parts[name].copy()
            parts = self.state.parts
        if name not in parts:
            raise AttributeError(f"a Stepper has no {name!r}; its state has {', '.join(parts)}")
        return None if parts[name] is None else np.array(parts[name])

    def __setattr__(self, name: str, value: Any) -> None:
        if not name.startswith("_"):
            raise AttributeError(
                f"{name} of a Stepper cannot be set; begin anew: plan.stepper(start, t0)"
            )
        object.__setattr__(self, name, value)

    def __reduce__(self) -> tuple[Any, ...]:
        return Stepper, (self._plan, self.carry)

    def __repr__(self) -> str:
        return f"Stepper({self._plan.method!r}: {self.steps} steps to t = {self.t})"

    # ---------------------------------------------------------------- how it steps

    def _stand(self, carry: Any) -> None:
        """Stand where this carry does; if there is native code, it goes on from there in place."""
        self._carry, self._fictive = carry, isinstance(carry, FictiveCarry)
        self._here: InPlace | SitesInPlace | None = None
        if isinstance(carry, SiteCarry):
            self._here = SitesInPlace(self._plan, carry)
            return
        inner: Carry = carry.inner if self._fictive else carry
        steps = carry.origin.steps(self._plan._steps) if self._fictive else self._plan._steps
        if inner.bodies is None and steps.owns(inner.shape):
            place = place_of(steps, inner.shape)  # type: ignore[arg-type]
            if place.native(1):
                self._here = InPlace(place, inner)

    def _slowly(self, steps: int) -> None:
        """The same by `Plan.step`: in plain Python, for an ensemble, and for a step that fails."""
        while steps:
            carry, some = self.carry, steps
            try:
                there = self._plan.step(carry, some)
            except (Exception, KeyboardInterrupt) as error:
                run = getattr(error, "trajectory", None)
                if run is None or not 0 < run.steps < steps:
                    raise
                if isinstance(error, KeyboardInterrupt):
                    there = run.carry
                    if self._fictive and there is not None:
                        there = FictiveCarry(carry.origin, there, met=carry.met)
                    self._stand(there or carry)
                    raise
                some = run.steps  # to the last one that can be made, and fail there
                there = self._plan.step(carry, some)
            self._stand(there)
            steps -= some


class SitesInPlace:
    """Where the sites of one system stand, in memory in which they go on.

    most : so many steps at once.
    """

    most = arguments.MOST

    def __init__(self, plan: Any, begun: SiteCarry) -> None:
        self.run = plan.by_hand(begun)

    @property
    def taken(self) -> int:
        """How many steps were taken."""
        return int(self.run.taken)

    @property
    def t(self) -> float:
        """The time, in s."""
        return float(self.run.t)

    @property
    def parts(self) -> dict[str, Any]:
        """The arrays of the state."""
        arrays: dict[str, Any] = self.carry.state.arrays
        return arrays

    def advance(self, steps: int) -> None:
        """Go on by so many steps.  Raises what `integrate` raises."""
        self.run.advance(steps)

    @property
    def carry(self) -> SiteCarry:
        """A copy."""
        found: SiteCarry = self.run.standing
        return found


class InPlace:
    """Where one body stands, in memory that native code advances in place.

    memory : as of a short run; the last numbers are the sample.  parts : views of the sample.
    most : so many steps come back in milliseconds.
    """

    __slots__ = ("begun", "buffers", "memory", "most", "parts", "place")

    def __init__(self, place: Place, begun: Carry) -> None:
        self.place, self.begun = place, begun
        self.memory = np.empty(place.kept + place.sampled)
        place.go_on(begun, self.memory)
        self.most = short.LONGEST // place.carried**2
        self.parts = unpacked(place.shape.shown, self.memory[place.kept :])
        self.buffers = place.prepared(self.memory, 1, place.kept)

    @property
    def taken(self) -> int:
        """How many steps were taken."""
        return int(self.memory.item(self.place.taken))

    @property
    def t(self) -> float:
        """The time, in s."""
        return float(self.begun.t0 + self.taken * self.begun.h)  # type: ignore[operator]

    def advance(self, steps: int) -> None:
        """Go on by so many steps, as far as they can be made."""
        self.place.advance(self.buffers, 1, steps)

    @property
    def carry(self) -> Carry:
        """A copy."""
        begun: Any = self.begun
        now, place = self.memory.copy(), self.place
        given = begun.shape, begun.t0, begun.h, self.taken, now[: place.carried], now[place.kept :]
        return Carry.quickly(*given, begun.met)
