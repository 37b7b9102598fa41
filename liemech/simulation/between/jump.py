"""Jumps of the state at zeros of functions: impacts, kicks, a clutch that catches."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from ...errors import InvalidInput, InvalidType
from ...formulas.classes.frozen import frozen
from ...formulas.derivatives import derivative
from ...formulas.numbers.dual import Dual
from ...groups.retractions import Exponential
from ...systems.system import State

LEAST = 2.0**-40
"""The rate at which an event leaves its zero, over that at which it came: below, rounding decides to which side."""


@frozen(eq=False)
class Jump:
    """A jump of the state at the zeros of a function: y+ = then(t, y-) where when(t, y-) = 0.  The motion goes on from y+.

    when : the event, a function of time and state; its `direction` says which zeros count, and `terminal` at which one the run
    ends, without a jump.
    then : a function of time and state that returns a state, `system.state(...)`.

    `run.events` has the times and the states y-, and the samples both sides; `run.at(t)` at that time is y+.  After a jump
    the event has the sign of its rate: one that turns the motion back is met again.  A run ends with StepTooSmall where
    jumps accumulate, as the bounces of a ball that comes to rest, and where a jump leaves the event at rest in its zero.
    Source: di Bernardo, Budd, Champneys and Kowalczyk, Piecewise-smooth Dynamical Systems (2008), sections 2.2.3 and 2.4.
    """

    when: Callable[[float, Any], float]
    then: Callable[[float, Any], Any]

    def __post_init__(self) -> None:
        for name in ("when", "then"):
            if not callable(getattr(self, name)):
                raise InvalidType(f"Jump: {name} is a function of t and state; got {getattr(self, name)!r}")

    def __call__(self, t: float, state: Any) -> float:
        return self.when(t, state)

    def __getattr__(self, name: str) -> Any:
        """The attributes of the event: its `direction`, `terminal`, `jumps_by`, and its name."""
        if name in ("direction", "terminal", "jumps_by", "__qualname__"):
            return getattr(self.when, name)
        raise AttributeError(name)

    def jump_of(self, system: Any) -> Jump:
        """The jump of a body of this system."""
        return self

    def after(self, t: Any, state: Any) -> Any:
        """The state y+, as `then` gives it.  Raises InvalidType for what is no state."""
        new = self.then(t, state)
        if not isinstance(new, State):
            raise InvalidType(
                f"Jump: then(t, state) returns a state, system.state(...) with the parts of {type(state).__name__}; "
                f"got {new!r:.60}"
            )
        return new


def slope(event: Any, system: Any, t: float, state: Any) -> Any:
    """The rate dw/dt of an event along the motion.  Raises InvalidInput for one without a derivative."""
    xi = system.rate(t, system.essential_part(state))
    try:
        rate = derivative(lambda s: event(t + s, system.displaced(Exponential(), state, s * xi)), 0.0)
        return rate if isinstance(rate, Dual) else float(rate)
    except (TypeError, AttributeError) as error:
        raise InvalidInput(
            "Jump: when(t, state) is to be a formula that numbers with derivatives go through, which says to which side "
            f"the motion leaves its zero; here it raised {type(error).__name__}: {error}"
        ) from error


def left_behind(before: float, after: float) -> str | None:
    """Why a motion cannot go on behind a jump, by the rates of its event on both sides; None if it can."""
    if math.isfinite(after) and abs(after) > LEAST * abs(before):
        return None
    return (
        f"the jump leaves its event at rest in the zero, its rate is {after:.2g} after {before:.2g}: contact that lasts is "
        "no jump. Go on from run.last with a system that has the contact as a constraint"
    )
