"""Systems whose state carries its physical time and its time scale along, for steps that are equal
in a fictive time.
"""

from __future__ import annotations

import dataclasses
import functools
from typing import Any, ClassVar

import numpy as np

from ...formulas import Record, record
from ...systems.system import State, System, member
from .time_scales import TimeScale


@record
class ClockedState(State):
    """The parts of a state, the physical `time`, and, for a ReversibleController, `z`, about
    1/sigma; abstract: `clocked` makes one for each kind of state.
    """

    inner: ClassVar[type[State]]
    names: ClassVar[tuple[str, ...]]
    clock: ClassVar[tuple[str, ...]]

    def __reduce__(self) -> tuple[Any, ...]:
        """The class is not pickled; it is made again when the state is read."""
        return _remade, (self.inner, self.clock, tuple(self.parts.values()))

    def without_clock(self) -> Any:
        """The state of the system itself, without time and z."""
        return self.inner(*[getattr(self, name) for name in self.names])


def _remade(inner: Any, clock: tuple[str, ...], values: tuple[Any, ...]) -> Any:
    return clocked(inner, clock)(*values)


@functools.cache
def clocked(inner: type[State], clock: tuple[str, ...] = ("time", "z")) -> Any:
    """The kind of state that has the parts of another kind, and those of a clock."""
    names = tuple(f.name for f in dataclasses.fields(inner))
    body = {
        "__annotations__": dict.fromkeys((*names, *clock), Any),
        "__module__": __name__,
        "__doc__": f"{inner.__name__} with {' and '.join(clock)}.",
        "names": names,
        "inner": inner,
        "clock": clock,
    }
    title = "Clocked" if "z" in clock else "Timed"
    return record(type(f"{title}{inner.__name__}", (ClockedState,), body))


@record
class Clocked(Record):
    """A system and its states with time and z: what a ReversibleController steps.

    sigma : bound to the start.
    """

    system: System
    sigma: TimeScale

    def without(self, state: Any) -> Any:
        """The state of the system itself."""
        return state.without_clock()

    def clock(self, state: Any) -> Any:
        """The physical time of a state."""
        return state.time

    def essential_part(self, state: Any) -> Any:
        """The arguments of the motion: time and z too."""
        inner = self.system.essential_part(self.without(state))
        return type(state)(*inner.parts.values(), state.time, state.z)

    def extended(self, start: State, t0: float) -> Any:
        """A start with its time and z = 1/sigma, for an ensemble too."""
        time: Any = t0
        z: Any
        if start.bodies is None:
            z = 1.0 / self.sigma.value_at(self.system, t0, start)
        else:
            members = [member(start, i) for i in range(start.bodies)]
            sigma = [self.sigma.value_at(self.system, t0, body) for body in members]
            time, z = np.full(start.bodies, t0), 1.0 / np.array(sigma)
        kind: Any = type(start)
        return clocked(kind)(*start.parts.values(), time, z)

    def apart(self, states: dict[str, np.ndarray]) -> tuple[np.ndarray, dict[str, np.ndarray], np.ndarray]:
        """The samples taken apart: the times, the parts of the states, and z."""
        parts = dict(states)
        return parts.pop("time"), parts, parts.pop("z")
