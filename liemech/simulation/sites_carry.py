"""Where a run of one system of many sites stands: what it hands on to the run that continues it."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from ..formulas.frozen import frozen
from .between.events import NO_EVENTS, Met


@frozen(eq=False)
class SiteCarry:
    """Where a run of many sites stands, with all that its method carries along.

    t0, h, step : the time is t0 + step h.  numbers : (width, sites), of what the method carries
    along for each site.  state : the state at this time.  clock : of adaptive steps, whose h and step
    are zero.  met, event : as of an `AdaptiveCarry`.
    """

    t0: float
    h: float
    step: int
    numbers: np.ndarray = dataclasses.field(repr=False)
    state: Any = dataclasses.field(repr=False)
    met: Met = NO_EVENTS
    clock: np.ndarray | None = dataclasses.field(default=None, repr=False)
    event: int | None = None
    bodies: None = None

    @property
    def t(self) -> Any:
        """The time, in s."""
        return self.t0 + self.step * self.h
