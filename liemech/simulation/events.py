"""Events: zeros of functions of time and state, looked for in every step."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from inspect import ismethod
from typing import Any

import numpy as np

from ..errors import IntegrationInterrupted, InvalidType
from ..formulas.pytree import NUMBER
from ..formulas.sizes import EPSILON
from .dense import Between, execution_of, natively, observe, packed, unpacked

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
        self.floats = True  # are all values floats, and not numbers of another kind?
        self.values = [self._value(event, t, state) for event in events]

    def look(self, motion: Between) -> tuple[int, float, np.ndarray] | None:
        """Look at some steps, which go on where the last ones ended.

        Returns, if a terminal event ends the run, the number of the step in which it does, the
        time, and the numbers of the state.
        """
        if len(motion.t) < 2:
            return None
        self.looking, self.looked = True, 0
        native = NativeEvents(self.events, motion)
        zeros = self._natively(native, motion) if self.floats and native.ready() else None
        if zeros is None:
            with native.plain():
                found = self._plainly(motion)
        else:
            found = self.meet(zeros)
        self.looking = False
        return found

    def meet(self, zeros: Iterable[Zero]) -> tuple[int, float, np.ndarray] | None:
        """Keep zeros in the order in which the motion meets them, up to a terminal one."""
        for k, at, i, numbers in zeros:
            self.found[i].append((at, numbers))
            if self.before[i] + len(self.found[i]) == self.terminal[i]:
                self.ended = i
                return k, at, numbers
        return None

    def _natively(self, native: NativeEvents, motion: Between) -> list[Zero] | None:
        """All zeros in some steps; None if plain Python is to say what fails there."""
        t, old = motion.t[:, None], np.array(self.values)[:, None]
        values = native.values(motion.points[1:, None], t[1:])
        if values is None:
            return None
        found = native.zeros(values, old, t, lambda step, body, times: motion.numbers(times))
        if found is not None:
            self.values = values[:, -1, 0].tolist()
        return None if found is None else [zero for _, zero in found]

    def _plainly(self, motion: Between) -> tuple[int, float, np.ndarray] | None:
        """Find zeros in some steps, one event after another."""
        for k, (a, b) in enumerate(zip(motion.t[:-1].tolist(), motion.t[1:].tolist(), strict=True)):
            self.looked = k
            hits, state = [], motion.end(k + 1)
            for i, (event, old) in enumerate(zip(self.events, self.values, strict=True)):
                new = self.values[i] = self._value(event, b, state)
                if crossed(event, old, new):
                    hits.append((self._root(event, motion, (a, b), (old, new)), i))
            ordered = sorted(hits, reverse=b < a)
            hit = self.meet([(k, at, i, packed(motion.state(at))) for at, i in ordered])
            if hit is not None:
                return hit
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
            self.floats = self.floats and type(value) is float
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

    def _root(
        self, event: Event, motion: Between, ends: tuple[float, float], values: tuple[float, float]
    ) -> float:
        def value(_: np.ndarray, times: np.ndarray) -> np.ndarray:
            return np.array([self._value(event, t, motion.state(t)) for t in times.tolist()])

        given = [np.array([x]) for x in (*ends, *values)]
        return float(roots(value, *given).item())


Zero = tuple[int, float, int, np.ndarray]
"""In which step, when, of which event, and the numbers of the state then."""


def crossed(event: Event, old: Any, new: Any) -> Any:
    """Has an event a zero between two of its values, in the direction that it asks for?  A zero at
    the first is none.
    """
    direction = float(getattr(event, "direction", None) or 0.0)
    least, most = np.minimum(old, new), np.maximum(old, new)
    return (least <= 0.0) & (most >= 0.0) & (old != 0.0) & (direction * (new - old) >= 0.0)


class NativeEvents:
    """Events in native code, of many motions side by side.

    motion : one of them.
    """

    def __init__(self, events: tuple[Event, ...], motion: Between) -> None:
        self.events, self.seen = events, motion.seen
        layout, _ = motion.seen(motion.points[:1])
        self.kernels = [
            execution_of(observe, (event, layout, NUMBER), motion.wanted, silent=True)
            for event in events
        ]

    def ready(self) -> bool:
        """Is there native code of all of them?"""
        return all([execution.ready(0.0) for execution, _ in self.kernels])  # noqa: C419 (all are asked)

    @contextmanager
    def plain(self) -> Iterator[None]:
        """Around what finds their zeros in plain Python, whose time counts."""
        with ExitStack() as stack:
            for execution, _ in self.kernels:
                stack.enter_context(execution.plain())
            yield

    def values(self, points: np.ndarray, t: np.ndarray) -> np.ndarray | None:
        """Of every event its values at states, (n, bodies, width), and times, (n, bodies); None if one
        failed.
        """
        found = np.empty((len(self.events), *t.shape))
        for i in range(len(self.events)):
            one = self._value(i, points.reshape(t.size, -1), t.ravel())
            if one is None:
                return None
            found[i] = one.reshape(t.shape)
        return found

    def _value(self, i: int, numbers: np.ndarray, times: np.ndarray) -> np.ndarray | None:
        execution, constants = self.kernels[i]
        given = np.column_stack([self.seen(numbers)[1], times])
        found = natively(execution, constants, given, 1)
        return found[:, 0] if found[:, 1].all() else None

    def zeros(
        self, values: np.ndarray, before: np.ndarray, t: np.ndarray, where: Any
    ) -> list[tuple[int, Zero]] | None:
        """The zeros in some steps, each with the number of its body, in the order in which the
        motions meet them; None if an event or a motion failed.

        values : (events, n, bodies) at the ends of the steps.  before : (events, bodies) where they
        begin.  t : (n + 1, bodies).  where : the numbers of states inside of steps, by the numbers
        of the steps and of the bodies, and times.
        """
        old = np.concatenate([before[:, None], values[:, :-1]], axis=1)
        changes = [crossed(*one) for one in zip(self.events, old, values, strict=True)]
        event, step, body = np.nonzero(changes)
        if not len(event):
            return []

        def value(some: np.ndarray, times: np.ndarray) -> np.ndarray:
            numbers, found = where(step[some], body[some], times), np.empty(len(some))
            for i in np.unique(event[some]).tolist():
                of = event[some] == i
                one = self._value(i, numbers[of], times[of])
                if one is None:
                    raise FloatingPointError
                found[of] = one
            return found

        ends = t[step, body], t[step + 1, body]
        try:
            at = roots(value, *ends, old[event, step, body], values[event, step, body])
            numbers = self.seen(where(step, body, at))[1]
        except Exception:  # plain Python finds it again, and says what it is
            return None
        later = np.where(ends[1] >= ends[0], 1.0, -1.0)
        order = np.lexsort((later * event, later * at, step, body))
        return [(int(body[k]), (int(step[k]), float(at[k]), int(event[k]), numbers[k])) for k in order]


def roots(
    function: Callable[[np.ndarray, np.ndarray], np.ndarray],
    a: np.ndarray, b: np.ndarray, fa: np.ndarray, fb: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Roots of many functions, each between a and b, where its values fa and fb have not the same
    sign, to four units in the last place: inverse quadratic interpolation where that is safe, or
    else bisection.

    function : by the numbers of some functions, and a place for each, their values.
    Source: Chandrupatla, Advances in Engineering Software 28 (1997), 145.
    """
    x1, f1, x2, f2, x3, f3 = b, fb, a, fa, a, fa
    found, left = np.where(fb == 0.0, b, a), np.flatnonzero((fb != 0.0) & (fa != 0.0))
    x1, f1, x2, f2, x3, f3 = (x[left] for x in (x1, f1, x2, f2, x3, f3))
    part, least = np.full(len(left), 0.5), 2.0 * EPSILON * np.maximum(np.abs(a), np.abs(b))[left]
    while len(left):
        x = x1 + part * (x2 - x1)
        f = function(left, x)
        same = np.sign(f) == np.sign(f1)
        x3, f3, x2, f2 = np.where(same, (x1, f1, x2, f2), (x2, f2, x1, f1))
        x1, f1 = x, f
        found[left] = np.where(np.abs(f1) < np.abs(f2), x1, x2)
        bound = least / np.abs(x2 - x1)
        going = (bound <= 0.5) & (f1 != 0.0)
        left, least, bound = left[going], least[going], bound[going]
        x1, f1, x2, f2, x3, f3 = (x[going] for x in (x1, f1, x2, f2, x3, f3))
        xi, phi = (x1 - x2) / (x3 - x2), (f1 - f2) / (f3 - f2)
        with np.errstate(all="ignore"):
            inner = f1 / (f2 - f1) * f3 / (f2 - f3) + (x3 - x1) / (x2 - x1) * f1 / (f3 - f1) * f2 / (f3 - f2)  # fmt: skip
        safe = (phi * phi < xi) & ((1.0 - phi) ** 2 < 1.0 - xi)
        part = np.minimum(1.0 - bound, np.maximum(bound, np.where(safe, inner, 0.5)))
    return found
