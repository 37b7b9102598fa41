"""Steps that end where an input jumps: each stage sees the limit from inside of its own step."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from ..errors import IncompatibleSystem
from ..formulas import record, where
from ..formulas.classes.layouts import layout_of
from ..formulas.classes.records import fields_of, with_fields
from ..formulas.numbers.conversions import fitted
from ..formulas.numbers.sizes import EPSILON
from ..formulas.tables import Table, entry, last_up_to
from ..systems.in_time.inputs import during, has_inputs, inputs
from ..systems.in_time.knots import jump_ahead, slack_of
from ..systems.in_time.tabulated import ROUNDING
from .method import Method, Wrapping

AT_ENDS = "its noise is known at the ends of steps only. Let steps end there: t0 + n h"

MARGIN = 4
"""Units in the last place by which steps keep away from a jump of the velocity that a user has named, on both sides."""

SMALLEST = 2.0**-960
"""Times below it are none: their rounding errors have no digits."""


def ending_at_jumps(method: Any, system: Any, breaks: tuple[float, ...]) -> Any:
    """The method as drivers get it: itself where nothing is known to jump, and where steps are made
    in a fictive time that is a coordinate.

    One that varies its steps makes those of the method inside of it so.
    """
    if getattr(system, "fictive", False) or not (breaks or has_inputs(system)):
        return method
    if method.noisy:
        raise IncompatibleSystem(
            f"{method!r} cannot end a step at a jump of {'the velocity' if breaks else 'an input'}: {AT_ENDS}"
        )
    if method.fictive:
        inner_system = system if hasattr(method, "base") else getattr(system, "system", system)
        inner = {n: x for n, x in fields_of(method).items() if isinstance(x, Method)}
        return with_fields(method, **{n: ending_at_jumps(x, inner_system, breaks) for n, x in inner.items()})
    anew = any(getattr(type(method), f) is not getattr(Method, f) for f in ("start", "observe"))
    table = Table(breaks or (0.0,))
    beyond = overshoot(method) or None
    return EndingAtJumps(method, table, float(len(breaks)), anew, sees_powers(method), beyond)


def uncut(method: Any) -> Any:
    """The user's method, inside of `EndingAtJumps` if it is wrapped."""
    return method.method if isinstance(method, EndingAtJumps) else method


def distinct_times(times: Iterable[float]) -> tuple[float, ...]:
    """The times in rising order, without those that differ from the one before by rounding."""
    distinct: list[float] = []
    for t in sorted(times):
        if not distinct or not is_one_time(t, distinct[-1]):
            distinct.append(t)
    return tuple(distinct)


def is_one_time(t: float, other: float) -> bool:
    """Whether two times differ by rounding alone."""
    return abs(t - other) <= 4 * MARGIN * EPSILON * max(abs(t), abs(other), SMALLEST)


def jumps_between(method: Any, system: Any, breaks: tuple[float, ...], t0: float, t_end: float) -> tuple[float, ...]:
    """The times from t0 to t_end at which an input is known to jump, rising, for adaptive steps."""
    if not has_inputs(system):
        return breaks
    low, high, every = min(t0, t_end), max(t0, t_end), sees_powers(method)
    of_tables = [t for table in inputs(system) for t in table.jump_times(low, high, every)]
    return distinct_times({*breaks, *of_tables})


def cuts(way: EndingAtJumps, system: Any) -> bool:
    """Whether there are times at which steps must end."""
    tables = inputs(system)
    return way.count > 0.0 or any(way.every or table.jumping > 0.0 for table in tables)


def sees_powers(method: Any) -> bool:
    """Whether a method, or one that it is made of, sees an input as a power series in time."""
    inner = [x for x in fields_of(method).values() if isinstance(x, Method)]
    return method.analytic or any(map(sees_powers, inner))


def overshoot(method: Any) -> float:
    """The part of a step by which stages of a method lie before its beginning or behind its end."""
    tableau: Any = getattr(method, "tableau", None)
    shares = getattr(tableau, "gamma", None)
    if shares is None:
        times = getattr(tableau, "c", None) or getattr(tableau, "nodes", None) or (0.0,)
        return max(-min(times), max(times) - 1.0, 0.0)
    inner = max((overshoot(x) for x in fields_of(method).values() if isinstance(x, Method)), default=0.0)
    far = 0.0
    for node, share in zip(tableau.nodes, shares, strict=True):
        ends = node - inner * share, node + (1.0 + inner) * share
        far = max(far, -min(ends), max(ends) - 1.0)
    return far if far > ROUNDING else 0.0


@record
class EndingAtJumps(Wrapping):
    """A method whose steps are cut where an input jumps: what drivers get instead of the method.

    A step from t to t + h becomes one from t to the first jump, one from there to the next, ..., and
    one to t + h.  Of the tables in the system each of them sees the limits from inside; from times
    in `breaks`, about which only the user knows, they keep away by some units in the last place.
    The cuts depend on the times only, and are the same backwards: what is symmetric or symplectic
    remains so.

    Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., II.6, "Discontinuous
    equations".
    """

    breaks: Any  # a Table of rising times
    count: float  # how many there are, in case there are none
    anew: bool  # does the method remember what is of fixed steps, in one field?
    every: bool  # does it see an input as a power series, so that its steps must end at every knot?
    beyond: Any  # the part of a step by which its stages lie beyond the ends of the step, or None

    def step(self, system: Any, t: float, memory: Any, h: float) -> Any:
        """The steps from jump to jump; of another length than h a method that remembers begins
        anew, and after them once more.
        """
        at, lasting, going = t, h, True
        cut = self.is_cut(system, t, h) if self.method.joins else False
        while going:
            at, begin, s, going = self.next_part(system, t, h, at)
            if self.anew:
                memory, lasting = self._begun(system, memory, cut or lasting != s, s), s
            after = self.method.step(during(system, begin, s, self.beyond), begin, memory, s)
            memory = fitted(after, layout_of(memory))  # constant entries of poses carry no rest
        return self._begun(system, memory, cut or lasting != h, h) if self.anew else memory

    def is_cut(self, system: Any, t: float, h: float) -> bool:
        """Does an input jump in a step, or at its ends?"""
        near, end = where(h > 0.0, 2.0, -2.0) * slack_of(t, t + h), t + h
        return self.next_end(system, t - near, end + near) != end + near

    def parts(self, system: Any, t: float, h: float) -> list[tuple[float, float]]:
        """Where the parts of a step begin, and their lengths, outside of formulas."""
        at, going, parts = t, (t + h - t) * h > 0.0, []
        while going:
            at, begin, s, going = self.next_part(system, t, h, at)
            parts.append((begin, s))
        return parts

    def _begun(self, system: Any, memory: Any, anew: bool, h: float) -> Any:
        """The memory, or if the method begins anew one of steps of length h."""
        if anew:
            first = self.method.start(system, self.method.observe(memory), h)
            memory = fitted(first, layout_of(memory))  # numbers that carry a derivative go on with it
        return memory

    def next_part(self, system: Any, t: float, h: float, at: float) -> tuple[float, float, float, Any]:
        """Of the part of a step, t to t + h, from `at` on: its end; begin and length of its step; do others follow it?"""
        end = t + h
        to = self.next_end(system, at, end)
        begin, s = self.kept_away(at, to, where(at == t and to == end, h, to - at))
        return to, begin, s, where(h > 0.0, to < end, to > end)

    def next_end(self, system: Any, t: float, end: float) -> float:
        """Where the next step ends: at the first jump after t, or at `end`."""
        to = end
        for table in inputs(system):
            to = table.jump_ahead(t, to, self.every)
        return jump_ahead(self.breaks, 0, int(self.count), t, to)

    def kept_away(self, t: float, to: float, h: float) -> tuple[float, float]:
        """Where a step from t to `to`, of length h, begins, and its length, away from the times in `breaks`."""
        near, sign = slack_of(t, to), where(h > 0.0, 1.0, -1.0)
        first, last = self._break_before(t + near), self._break_before(to + near)
        at_first = self.count > 0.0 and abs(first - t) <= near
        at_last = self.count > 0.0 and abs(last - to) <= near
        away = MARGIN * EPSILON * sign
        begin = where(at_first, first + away * max(abs(first), abs(h)), t)
        finish = where(at_last, last - away * max(abs(last), abs(h)), to)
        return begin, where(at_first or at_last, finish - begin, h)

    def _break_before(self, t: float) -> float:
        """The last time in `breaks` up to t, or the first one of all."""
        return entry(self.breaks, last_up_to(self.breaks, 0, max(int(self.count) - 1, 0), t))

    def __repr__(self) -> str:
        return repr(self.method)
