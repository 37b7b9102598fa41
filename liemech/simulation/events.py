"""Events: zeros of functions of time and state, looked for in every step."""

from __future__ import annotations

from collections.abc import Callable
from inspect import ismethod
from typing import Any

import numpy as np

from ..errors import IntegrationInterrupted, InvalidType
from .dense import Between, packed, unpacked

Event = Callable[[float, Any], float]


def name_of(event: Any) -> str:
    """By which an event is known in a run that goes on, and in files."""
    return str(getattr(event, "__qualname__", type(event).__qualname__))


class Met(tuple[tuple[str, int], ...]):
    """Of every event its name, and how many of its zeros count for its `terminal` in a run that
    goes on.

    events : these themselves, where they are still there; not in files, nor in other processes.
    """

    events: tuple[Event, ...] | None = None

    @classmethod
    def of(cls, events: tuple[Event, ...], counts: list[int]) -> Met:
        """That of these events."""
        met = cls([(name_of(event), n) for event, n in zip(events, counts, strict=True)])
        met.events = events
        return met

    def __reduce__(self) -> Any:
        return Met, (tuple(self),)

    def counts(self, events: tuple[Event, ...]) -> list[int]:
        """What counts for these events: nothing, if they are not the same.  Where only names are
        left, a name tells which event it is, but not that of a lambda.
        """
        names = [name_of(event) for event in events]
        if self.events is not None:
            pairs = zip(self.events, events, strict=False)
            same = all(a is b or (ismethod(a) and a == b) for a, b in pairs)
        else:
            same = [name for name, _ in self] == names and not any("<lambda>" in n for n in names)
        return [n for _, n in self] if same and len(self) == len(events) else [0] * len(events)


NO_EVENTS = Met()
"""Of a run without events."""


class Watch:
    """Watches the events of one run.

    found : of every event the times and the numbers of the states, in the order in which the motion
    meets them.
    before : `met` of the run that this one goes on with.
    """

    def __init__(
        self,
        events: tuple[Event, ...],
        ended: Callable[[Any], Any],
        t: float,
        state: Any,
        before: Met | None = None,
    ) -> None:
        self.events, self._ended = events, ended
        self.looking, self.looked = False, 0  # how many of the last steps have been looked at
        self.before = [0] * len(events) if before is None else before.counts(events)
        self.ended: int | None = None  # by which event
        self.found: list[list[tuple[float, np.ndarray]]] = [[] for _ in events]
        self.terminal = [int(getattr(event, "terminal", None) or 0) for event in events]
        self.values = [self._value(event, t, state) for event in events]

    def look(self, motion: Between) -> tuple[int, float, np.ndarray] | None:
        """Look at some steps, which go on where the last ones ended.

        Returns, if a terminal event ends the run, the number of the step in which it does, the
        time, and the numbers of the state.
        """
        self.looking = True
        for k, (a, b) in enumerate(zip(motion.t[:-1].tolist(), motion.t[1:].tolist(), strict=True)):
            self.looked = k
            hits, state = [], motion.end(k + 1)
            for i, (event, old) in enumerate(zip(self.events, self.values, strict=True)):
                new = self.values[i] = self._value(event, b, state)
                direction = getattr(event, "direction", 0.0)
                if (
                    min(old, new) <= 0.0 <= max(old, new)
                    and old != 0.0
                    and direction * (new - old) >= 0.0
                ):
                    hits.append((self._root(event, motion, a, b), i))
            for at, i in sorted(hits, reverse=b < a):
                numbers = packed(motion.state(at))
                self.found[i].append((at, numbers))
                if self.before[i] + len(self.found[i]) == self.terminal[i]:
                    self.ended, self.looking = i, False
                    return k, at, numbers
        self.looking = False
        return None

    @property
    def met(self) -> Met:
        """With what a run goes on: the zeros so far, or none of the event that ended this one."""
        counts = [n + len(found) for n, found in zip(self.before, self.found, strict=True)]
        if self.ended is not None:
            counts[self.ended] = 0
        return Met.of(self.events, counts)

    def shown(self, example: Any, layout: Any) -> tuple[tuple[np.ndarray, Any], ...]:
        """Of every event the times and the states, as a Trajectory holds them."""
        shown = []
        for found in self.found:
            arrays = unpacked(
                layout, np.array([row for _, row in found]).reshape(len(found), layout.width)
            )
            shown.append(
                (
                    np.array([t for t, _ in found]),
                    type(example)(*(arrays.get(name) for name in example.parts)),
                )
            )
        return tuple(shown)

    def _value(self, event: Event, t: float, state: Any) -> float:
        """The value of an event.  What it raises goes to the caller, with the run up to here."""
        try:
            value = event(t, state)
            try:
                return float(value)
            except TypeError:
                raise InvalidType(
                    f"integrate: an event gives a number; {event!r} gave {value!r}"
                ) from None
        except KeyboardInterrupt:
            stopped = IntegrationInterrupted(
                f"integrate: interrupted at t = {t:g}; the samples are in `.trajectory`"
            )
            raise self._ended(stopped) from None
        except Exception as error:
            error.add_note(
                f"[integrate: in an event at t = {t:g}; the samples before it are in `.trajectory`]"
            )
            raise self._ended(error) from None

    def _root(self, event: Event, motion: Between, a: float, b: float) -> float:
        from scipy.optimize import brentq

        tiny = 4 * np.finfo(float).eps
        return float(
            brentq(
                lambda t: self._value(event, t, motion.state(t)),
                a,
                b,
                xtol=tiny * max(abs(a), abs(b)),
                rtol=tiny,
            )
        )
