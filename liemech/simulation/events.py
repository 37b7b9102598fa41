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
        self.looked = 0  # how many of the last steps have been looked at
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
        t, n = motion.t, len(motion.t) - 1
        if not n:
            return None
        self.looked = 0
        native, found, first = NativeEvents(self.events, motion), None, 0
        if self.floats and native.ready():
            values = native.values(motion.points[1:], t[1:])
            failed = np.isnan(values).any(axis=0)
            some = int(failed.argmax()) if failed.any() else n  # steps before an event fails
            old = np.concatenate([np.array(self.values)[:, None], values], axis=1)
            steps = old[:, :some], values[:, :some], t[:some], t[1 : some + 1]
            zeros = native.zeros(*steps, lambda step, times: motion.numbers(times))
            if zeros is not None:
                found, first, self.values = self.meet(zeros), some, old[:, some].tolist()
        if found is None and first < n:
            with native.plain():
                found = self._plainly(motion, first)
        return found

    def meet(self, zeros: Iterable[Zero]) -> tuple[int, float, np.ndarray] | None:
        """Keep zeros in the order in which the motion meets them, up to a terminal one."""
        for k, at, i, numbers in zeros:
            self.found[i].append((at, numbers))
            if self.before[i] + len(self.found[i]) == self.terminal[i]:
                self.ended = i
                return k, at, numbers
        return None

    def _plainly(self, motion: Between, first: int) -> tuple[int, float, np.ndarray] | None:
        """Find zeros in the steps from this one on, one event after another."""
        ends = zip(motion.t[first:-1].tolist(), motion.t[first + 1 :].tolist(), strict=True)
        for k, (a, b) in enumerate(ends, first):
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

    def forget(self, t: float, direction: float, ended: bool) -> None:
        """Forget the zeros that a run met after this time, to which it was interrupted."""
        self.found = [
            [(at, x) for at, x in found if (at - t) * direction <= 0.0] for found in self.found
        ]
        self.ended = self.ended if ended else None

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

    def values(self, points: np.ndarray, t: np.ndarray) -> np.ndarray:
        """Their values at states, (n, width), and times, (n,): (events, n), nan where one failed."""
        given = np.column_stack([self.seen(points)[1], t])
        found = [natively(*kernel, given, 1) for kernel in self.kernels]
        return np.array([np.where(one[:, 1] == 1.0, one[:, 0], np.nan) for one in found])

    def zeros(
        self, old: np.ndarray, new: np.ndarray, a: np.ndarray, b: np.ndarray, where: Any
    ) -> list[Zero] | None:
        """The zeros in some steps, in the order in which motions meet them; None if an event or a
        motion failed, which plain Python says again.

        old, new : (events, n) their values where the steps begin and end, at the times a and b.
        where : the numbers of states inside of steps, by the numbers of these and times.
        """
        changes = [crossed(*one) for one in zip(self.events, old, new, strict=True)]
        event, step = np.nonzero(changes)
        if not len(event):
            return []

        def value(some: np.ndarray, times: np.ndarray) -> np.ndarray:
            values = self.values(where(step[some], times), times)
            found = np.take_along_axis(values, event[None, some], axis=0)[0]
            if np.isnan(found).any():
                raise ArithmeticError
            return found

        try:
            at = roots(value, a[step], b[step], old[event, step], new[event, step])
            numbers = self.seen(where(step, at))[1]
        except Exception:
            return None
        later = np.where(b[step] >= a[step], 1.0, -1.0)
        order = np.lexsort((later * event, later * at, step)).tolist()
        return [(int(step[k]), at.item(k), int(event[k]), numbers[k]) for k in order]


class Unseen(Exception):
    """An event is to be looked at in plain Python: body after body."""


def unseen(error: Any) -> Any:
    """What ends a run whose event failed at the start, but for Ctrl-C."""
    return error if isinstance(error, KeyboardInterrupt) else Unseen()


class Watches:
    """Watches the events of many bodies side by side, in native code.

    each : of every body its own watch.  values : (events, bodies) where the bodies stand.
    """

    def __init__(self, native: NativeEvents, bodies: int) -> None:
        self.native, self.each = native, dict[int, Watch]()
        self.values = np.zeros((len(native.events), bodies))

    def add(self, body: int, watch: Watch) -> None:
        """Watch a body, too.  Raises Unseen if its events are not for native code."""
        if not watch.floats:
            raise Unseen
        self.each[body], self.values[:, body] = watch, watch.values

    def look(
        self, body: np.ndarray, points: np.ndarray, a: np.ndarray, b: np.ndarray, where: Any
    ) -> dict[int, tuple[int, float, np.ndarray]]:
        """Look at steps from the times a to b, where the states are `points`, of one body after
        another: those of a terminal event the number of the step, the time and the state.

        where : as in `NativeEvents.zeros`.  Raises Unseen if plain Python is to say why one failed.
        """
        new = self.native.values(points, b)
        changed = body[1:] != body[:-1]
        begins, ends = np.append(True, changed), np.append(changed, True)
        old = np.concatenate([new[:, :1], new[:, :-1]], axis=1)
        old[:, begins] = self.values[:, body[begins]]
        self.values[:, body[ends]] = new[:, ends]
        failed = np.flatnonzero(np.isnan(new).any(axis=0))[::-1]
        first = np.full(self.values.shape[1], len(body))  # of every body the first step that failed
        first[body[failed]] = failed
        good = np.flatnonzero(np.arange(len(body)) < first[body])
        given = old[:, good], new[:, good], a[good], b[good]
        zeros = self.native.zeros(*given, lambda step, times: where(good[step], times))
        if zeros is None:
            raise Unseen
        of_each: dict[int, list[Zero]] = {}
        for k, at, event, numbers in zeros:
            step = int(good[k])
            of_each.setdefault(int(body[step]), []).append((step, at, event, numbers))
        met = {i: self.each[i].meet(own) for i, own in of_each.items()}
        if any(self.each[i].ended is None for i in body[failed].tolist()):
            raise Unseen
        return {i: hit for i, hit in met.items() if hit is not None}


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
