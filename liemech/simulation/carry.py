"""Where a run stands: what it hands on to the run that continues it."""

from __future__ import annotations

import dataclasses
import functools
from typing import Any

import numpy as np

from ..formulas.pytree import build
from ..systems.system import State
from .dense import unpacked
from .prepared import Shape


@dataclasses.dataclass(eq=False)
class Carry:
    """Where a run stands, with all that its method carries along: from here it goes on as if it had
    never stopped.

    t0, h, step : the time is t0 + step h; h is one for each body if they have steps of their own.
    bodies : of an ensemble.
    numbers : (width + 1,) or (width + 1, bodies), of what the method carries along, and the steps
    taken.
    last : the numbers of the state, in the memory of the samples until `keep`.
    failures : what ended bodies that stopped.  Nothing of it is changed, ever.
    """

    shape: Shape | None = dataclasses.field(repr=False)
    t0: float
    h: float | tuple[float, ...]
    step: int
    bodies: int | None
    numbers: np.ndarray = dataclasses.field(repr=False)
    last: np.ndarray = dataclasses.field(repr=False)
    failures: dict[int, Exception | None] = dataclasses.field(default_factory=dict, repr=False)

    @property
    def t(self) -> Any:
        """The time, in s; of bodies with steps of their own those of all, (bodies,)."""
        return self.t0 + self.step * (self.h if type(self.h) is float else np.array(self.h))

    @functools.cached_property
    def state(self) -> State:
        """The state at this time."""
        shape: Any = self.shape
        if self.bodies is None:
            return build(shape.shown, iter(self.last.ravel().tolist()))
        parts = unpacked(shape.shown, self.last.T)
        return type(shape.example)(*(parts.get(name) for name in shape.example.parts))

    def keep(self) -> None:
        """A copy of the last sample, before somebody gets the samples and may write to them."""
        self.last = self.last.copy()

    def __getstate__(self) -> dict[str, Any]:
        """The numbers, and the state instead of layouts and native code, which the plan that goes
        on has.
        """
        return vars(self) | {"state": self.state, "shape": None}


@dataclasses.dataclass(frozen=True, eq=False)
class AdaptiveCarry:
    """Where a run with adaptive steps stands: state and velocity, clock and controller; which event
    ended it, if one did.
    """

    numbers: np.ndarray = dataclasses.field(repr=False)
    clock: np.ndarray = dataclasses.field(repr=False)
    state: State
    t: float
    ended: int | None = None
    bodies: None = None
