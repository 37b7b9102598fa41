"""Functions of time that are given by tables: torque histories, driven velocities."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

from ...errors import InvalidInput, InvalidType
from ...formulas import Record, check_finite, horner, real_array, record, vec, where
from ...formulas.classes.records import with_fields
from ...formulas.tables import Table, entry, last_up_to
from .knots import jump_ahead, just_inside, slack_of

OUTSIDE = ("refuse", "hold", "repeat")
"""The ways to go on beyond a table."""

ROUNDING = 2.0**-48
"""Part of the times of a table by which a stage of a step may miss its ends."""

EQUAL = 2.0**-44
"""Part of its terms by which the value of a table may change at a knot and not jump."""

ANY = 0.5
"""In place of the number of a period, which is whole: each time is in a period of its own."""


@record
class PiecewisePolynomial(Record):
    """A function of time given by a table, with a polynomial between each two knots.

        f(t) = c_i0 + c_i1 (t - t_i) + c_i2 (t - t_i)^2 + ...,   t_i <= t < t_(i+1)

    `cubic`, `linear` and `constant` make one of values, `of` takes one from SciPy.  It is a record:
    a field of a force, a system, ... whose formulas call it, `self.torque(t)`, in native code too,
    where tables of any length share one code.  A number or a vector.  At a knot the later interval
    counts; a step that ends there sees the earlier one.  Runs make their steps end where the
    value jumps, of a table that is a field of the system; `breaks=f.knots` does so at every knot.

    knots : (n + 1,) times in s, rising.  coefficients : (n, degree + 1) or, of a vector, (n,
    degree + 1, dim), by rising powers.
    outside : before the first knot and after the last one a value is refused ("refuse", a
    ValueError that ends a run), that of the nearest end is held ("hold"), or the table is repeated
    ("repeat").

    Source: de Boor, A Practical Guide to Splines, revised ed., chapter VII, (1).
    """

    knots: Any
    coefficients: Any
    outside: str = "refuse"
    degree: int = dataclasses.field(default=-1)
    size: int = dataclasses.field(default=-1)  # components of a vector; 0 for a number
    intervals: float = dataclasses.field(default=0.0, init=False)
    # the times at which the value jumps, in the first period, and how many there are
    jumps: Any = dataclasses.field(default=None, init=False)
    jumping: float = dataclasses.field(default=0.0, init=False)
    # `during` a step: at times from `begin` to `end` only the intervals from `first` to `last` count,
    # in this period of the table; at other times, such as those of a delay, all of them count
    begin: float = dataclasses.field(default=1.0, init=False)
    end: float = dataclasses.field(default=-1.0, init=False)
    first: float = dataclasses.field(default=-1.0, init=False)
    last: float = dataclasses.field(default=0.0, init=False)
    period: float = dataclasses.field(default=ANY, init=False)

    def __post_init__(self) -> None:
        if self.jumps is None:
            terms = self.coefficients
            if isinstance(terms, Table) and self.degree >= 0:  # of another one, laid flat
                terms = self._terms()
            knots = real_array(np.asarray(self.knots), "PiecewisePolynomial: knots")
            terms = real_array(np.asarray(terms), "PiecewisePolynomial: coefficients")
            check_finite(knots, "PiecewisePolynomial: knots")
            check_finite(terms, "PiecewisePolynomial: coefficients")
            if knots.ndim != 1 or len(knots) < 2 or not (np.diff(knots) > 0.0).all():
                raise InvalidInput(
                    f"PiecewisePolynomial: knots are two rising times or more; got shape {knots.shape}, {knots!r}"
                )
            if terms.ndim not in (2, 3) or len(terms) != len(knots) - 1 or 0 in terms.shape:
                n = len(knots) - 1
                raise InvalidInput(
                    f"PiecewisePolynomial: for {n + 1} knots the coefficients are ({n}, degree + "
                    f"1), of a vector ({n}, degree + 1, dim); got {terms.shape}"
                )
            object.__setattr__(self, "degree", terms.shape[1] - 1)
            object.__setattr__(self, "size", terms.shape[2] if terms.ndim == 3 else 0)
            jumps = knots[:-1][_jumping(knots, terms, self.outside == "repeat")]
            object.__setattr__(self, "knots", Table(knots))
            object.__setattr__(self, "coefficients", Table(terms))
            object.__setattr__(self, "jumps", Table(jumps if len(jumps) else knots[:1]))
            object.__setattr__(self, "jumping", float(len(jumps)))
        if self.outside not in OUTSIDE:
            raise InvalidInput(f'PiecewisePolynomial: outside is "refuse", "hold" or "repeat"; got {self.outside!r}')
        object.__setattr__(self, "intervals", float(len(self.knots) - 1))
        object.__setattr__(self, "last", self.intervals)
        super().__post_init__()

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Formulas read the tables by these numbers, and native code does not look where they end:
        from a copy or a file they must belong together.
        """
        super().__setstate__(state)
        counts: tuple[Any, ...] = self.degree, self.size, self.intervals
        if (
            not (isinstance(self.knots, Table) and isinstance(self.coefficients, Table))
            or not all(isinstance(n, (int, float)) and n >= 0 for n in counts)
            or len(self.knots) < 2
            or self.intervals != len(self.knots) - 1
            or len(self.coefficients) != self.intervals * (self.degree + 1) * max(self.size, 1)
            or not (np.diff(np.asarray(self.knots)) > 0.0).all()
            or not (isinstance(self.jumps, Table) and len(self.jumps) > 0)
            or not all(isinstance(x, float) for x in (self.jumping, self.first, self.last, self.period))
            or not 0.0 <= self.jumping <= len(self.jumps)
            or not -1.0 <= self.first <= self.last <= self.intervals
        ):
            raise InvalidInput("PiecewisePolynomial: its tables do not fit its degree and size")

    # ---------------------------------------------------------------- how it is made

    @classmethod
    def of(cls, curve: Any, outside: str = "refuse") -> PiecewisePolynomial:
        """The function of a CubicSpline, PchipInterpolator, Akima1DInterpolator, PPoly, BPoly or
        BSpline of scipy.interpolate.
        """
        from scipy.interpolate import BPoly, BSpline, PPoly

        if isinstance(curve, BSpline):
            knots = np.unique(curve.t[curve.k : len(curve.t) - curve.k])
            terms = [curve(knots[:-1], k) / math.factorial(k) for k in range(curve.k + 1)]
            return cls(knots, np.stack(terms, axis=1), outside)
        if isinstance(curve, BPoly):
            curve = PPoly.from_bernstein_basis(curve)
        if not isinstance(curve, PPoly):
            raise InvalidType(
                f"PiecewisePolynomial.of takes a spline of scipy.interpolate, such as CubicSpline; got {curve!r}"
            )
        return cls(curve.x, np.moveaxis(curve.c[::-1], 0, 1), outside)

    @classmethod
    def cubic(cls, t: Any, values: Any, ends: Any = "not-a-knot", outside: str = "refuse") -> PiecewisePolynomial:
        """The cubic spline through the values, twice differentiable.

        t : (n,) rising times in s.  values : (n,) or (n, dim).  ends : SciPy's `bc_type`:
        "not-a-knot", "natural", "clamped", "periodic" or derivatives there.
        """
        from scipy.interpolate import CubicSpline

        times, rows = _table(t, values, 0)
        try:
            with np.errstate(all="ignore"):  # what is not finite then is refused
                curve = CubicSpline(times, rows, bc_type=ends)
            return cls.of(curve, outside)
        except ValueError as error:
            raise InvalidInput(f"PiecewisePolynomial.cubic: {error}") from None

    @classmethod
    def linear(cls, t: Any, values: Any, outside: str = "refuse") -> PiecewisePolynomial:
        """The straight lines from value to value.  t : (n,) rising times in s.  values : (n,) or (n, dim)."""
        times, rows = _table(t, values, 0)
        slopes = np.diff(rows, axis=0) / np.diff(times).reshape(-1, *[1] * (rows.ndim - 1))
        return cls(times, np.stack([rows[:-1], slopes], axis=1), outside)

    @classmethod
    def constant(cls, t: Any, values: Any, outside: str = "refuse") -> PiecewisePolynomial:
        """One value between each two times, such as that of a pulse.

        t : (n + 1,) rising times in s, at which the values change.  values : (n,) or (n, dim), the
        first from t_0 to t_1.
        """
        times, rows = _table(t, values, 1)
        return cls(times, rows[:, None], outside)

    @property
    def has_values(self) -> bool:
        """Whether the table is of steps or of straight lines from value to value, so that its values tell all of it."""
        inner = np.asarray(self.jumps)[: int(self.jumping)] > np.asarray(self.knots)[0]
        return self.degree == 0 or (self.degree == 1 and not inner.any())

    def with_values(self, values: Any) -> PiecewisePolynomial:
        """The table with other values at the same times: (n,) or (n, dim), of steps one for each interval,
        of straight lines one for each knot.  Raises InvalidInput for other tables.
        """
        if not self.has_values:
            raise InvalidInput(
                "PiecewisePolynomial.with_values: values are those of steps (.constant) and of straight "
                f"lines (.linear); {self!r} has coefficients"
            )
        make = self.linear if self.degree else self.constant
        return make(np.asarray(self.knots), values, self.outside)

    def derivative(self, order: int = 1) -> PiecewisePolynomial:
        """The derivative of this order, a piecewise polynomial; at a knot that of the later interval.  Raises
        InvalidInput where values are held: use `lm.derivative` in a formula there.
        """
        if self.outside == "hold":
            raise InvalidInput(
                'PiecewisePolynomial.derivative: of outside="hold" the slope is not held; lm.derivative knows it'
            )
        terms = self._terms()
        for _ in range(order):
            powers = np.arange(1.0, terms.shape[1]).reshape(1, -1, *[1] * (terms.ndim - 2))
            terms = terms[:, 1:] * powers if terms.shape[1] > 1 else np.zeros_like(terms)
        return PiecewisePolynomial(np.asarray(self.knots), terms, self.outside)

    # ---------------------------------------------------------------- its value

    def __call__(self, t: Any) -> Any:
        """f(t): a number, or (dim,).  t : a time in s; of an array, (m,), the values are (m,) or (m, dim)."""
        if isinstance(t, np.ndarray):
            return self._of_array(real_array(t, "PiecewisePolynomial: t"))
        within = self.begin <= t <= self.end
        first, last = where(within, self.first, -1.0), where(within, self.last, self.intervals)
        t = self._inside(t, first, last, where(within, self.period, ANY))
        i = self._interval(t, first, last)
        return horner(self._terms_of(i), t - entry(self.knots, i))

    def _terms_of(self, i: Any) -> list[Any]:
        """The coefficients of interval number i, by rising powers."""
        width = max(self.size, 1)
        at = i * ((self.degree + 1) * width)
        rows = [[entry(self.coefficients, at + (k * width + j)) for j in range(width)] for k in range(self.degree + 1)]
        return [vec(*row) if self.size else row[0] for row in rows]

    def _of_array(self, t: np.ndarray) -> np.ndarray:
        """The values at many times, bit for bit those at each time."""
        knots, terms = np.asarray(self.knots), self._terms()
        times = np.array([self._inside(x, -1.0, self.intervals, ANY) for x in t.ravel().tolist()])
        i = np.clip(np.searchsorted(knots, times, "right") - 1, 0, len(knots) - 2)
        x = (times - knots[i]).reshape(-1, *[1] * (terms.ndim - 2))
        heights = horner([terms[i, k] for k in range(self.degree + 1)], x)
        return heights.reshape(*t.shape, *heights.shape[1:])

    def _terms(self) -> np.ndarray:
        """The coefficients as an array, (n, degree + 1) or (n, degree + 1, dim)."""
        return np.asarray(self.coefficients).reshape(
            len(self.knots) - 1, self.degree + 1, *([self.size] if self.size else [])
        )

    def _inside(self, t: Any, low: Any, high: Any, period: Any) -> Any:
        """The time in the table at which its value for t is looked up; only the intervals from `low` to `high` count."""
        first, last = entry(self.knots, 0), entry(self.knots, int(self.intervals))
        if self.outside == "hold":
            t = where(high >= self.intervals, min(t, last), t)
            t = where(low < 0.0, max(t, first), t)
            return where(low >= self.intervals, last, where(high < 0.0, first, t))
        if self.outside == "repeat":
            length = last - first
            return where(period == ANY, first + (t - first) % length, t - period * length)
        slack = ROUNDING * max(abs(first), abs(last))
        if not (first - slack <= t <= last + slack):
            raise ValueError(
                f'at t = {t} the table, {first} to {last}, has no value; outside="hold" would hold its ends'
            )
        return t

    def _interval(self, t: Any, low: Any, high: Any) -> Any:
        """The number of the interval in which t is, among those from `low` to `high`."""
        final = self.intervals - 1.0
        return last_up_to(self.knots, int(min(max(low, 0.0), final)), int(max(min(high, final), 0.0)), t)

    # ---------------------------------------------------------------- the table and steps

    def during(self, t: Any, h: Any, beyond: Any = None) -> PiecewisePolynomial:
        """The table as a step from t to t + h sees it: where the step begins or ends at a knot, the
        interval on the other side of the knot does not count.

        beyond : the part of h by which stages lie beyond the ends of the step, None if none does;
        where an end is at a jump, they see the polynomial on this side of it.
        """
        early, late = just_inside(t, h)
        first, last = entry(self.knots, 0), entry(self.knots, int(self.intervals))
        final = int(self.intervals) - 1
        slack = 2.0 * slack_of(t, t + h)
        begin, end = min(t, t + h) - slack, max(t, t + h) + slack
        period, shift = ANY, 0.0
        if self.outside == "repeat":
            length = last - first
            turn = (early - first) // length
            period = where(turn == -((first - late) // length) - 1.0, turn, ANY)
            shift = turn * length
        early, late = early - shift, late - shift
        if beyond is not None:
            begin, end = begin - beyond * abs(h), end + beyond * abs(h)
            early, late = self._up_to_jumps(early, late)
            if self.outside == "repeat":  # where it begins anew without a jump, another period counts
                smooth = entry(self.jumps, 0) > first
                begin = where(smooth, max(begin, first + shift), begin)
                end = where(smooth, min(end, last + shift), end)
        i = 1.0 * last_up_to(self.knots, 0, final, early)
        j = 1.0 * last_up_to(self.knots, 0, final, late, below=True)
        if self.outside == "repeat":
            i, j = where(period == ANY, -1.0, i), where(period == ANY, 1.0 * final, j)
        if self.outside == "hold":
            i = where(early < first, -1.0, where(early >= last, self.intervals, i))
            j = where(late <= first, -1.0, where(late > last, self.intervals, j))
        return with_fields(self, begin=begin, end=end, first=i, last=j, period=period)

    def _up_to_jumps(self, early: Any, late: Any) -> tuple[Any, Any]:
        """The last jump up to `early`, and the first one from `late` on; beyond the table if there is none."""
        first, last = entry(self.knots, 0), entry(self.knots, int(self.intervals))
        length, final = last - first, max(int(self.jumping) - 1, 0)
        before = entry(self.jumps, last_up_to(self.jumps, 0, final, early))
        k = last_up_to(self.jumps, 0, final, late, below=True)
        k = where(entry(self.jumps, 0) >= late, 0, k + 1)
        behind = entry(self.jumps, min(k, final))
        before = where(self.jumping > 0.0, where(before <= early, before, first - length), first - length)
        behind = where(self.jumping > 0.0, where(k <= final, behind, last + length), last + length)
        return min(before, early), max(behind, late)

    def jump_times(self, low: float, high: float, every: bool) -> list[float]:
        """All times from `low` to `high` at which `jump_ahead` stops."""
        knots, count = np.asarray(self.knots), int(self.intervals)
        times = np.asarray(self.jumps)[: int(self.jumping)]
        if every:
            begin = 1 if self.outside == "refuse" else 0
            times = knots[begin : count + 1 if self.outside == "hold" else count]
        if self.outside == "repeat" and len(times):
            length = knots[-1] - knots[0]
            first, last = (int((x - knots[0]) // length) for x in (low, high))
            times = (np.arange(first, last + 1)[:, None] * length + times).ravel()
        return times[(times >= low) & (times <= high)].tolist()

    def jump_ahead(self, t: Any, end: Any, every: bool) -> Any:
        """The first time after t on the way to `end` at which the value jumps, or, of every knot,
        may change in any way; `end` if there is none before it.
        """
        first, last = entry(self.knots, 0), entry(self.knots, int(self.intervals))
        table, begin, count = self.jumps, 0, int(self.jumping)
        if every:
            table, count = self.knots, int(self.intervals)
            if self.outside == "refuse":
                begin = 1
            if self.outside == "hold":
                count = count + 1
        if self.outside != "repeat":
            return jump_ahead(table, begin, count, t, end)
        length, slack = last - first, slack_of(t, end)
        forward = end > t
        period = where(forward, (t + slack - first) // length, -((first - t + slack) // length) - 1.0)
        in_period = jump_ahead(table, begin, count, t - period * length, end - period * length)
        jump = in_period + period * length
        after = where(forward, period + 1.0, period - 1.0)
        edge = entry(table, where(forward, 0, max(count - 1, 0))) + after * length
        none = in_period == end - period * length
        jump = where(none, where(count > 0, edge, end), jump)
        beyond = where(forward, jump >= end - slack, jump <= end + slack)
        return where(beyond, end, jump)

    def __repr__(self) -> str:
        kind = f"{self.size} components" if self.size else "a number"
        ends = f"{np.asarray(self.knots)[0]:g} to {np.asarray(self.knots)[-1]:g}"
        return f"PiecewisePolynomial(t = {ends}, {len(self.knots)} knots, degree {self.degree}, {kind}, {self.outside})"


def _table(t: Any, values: Any, more: int) -> tuple[np.ndarray, np.ndarray]:
    """Times and values as arrays, checked.  more : the times beyond the number of values."""
    times, rows = (real_array(t, "PiecewisePolynomial: t"), real_array(values, "PiecewisePolynomial: values"))
    check_finite(times, "PiecewisePolynomial: t")
    check_finite(rows, "PiecewisePolynomial: values")
    if times.ndim != 1 or rows.ndim not in (1, 2) or len(times) != len(rows) + more or len(times) < 2:
        expected = "one value for each time" if more == 0 else "one value between each two times"
        raise InvalidInput(
            f"PiecewisePolynomial: t is (n,) and values are (n,) or (n, dim), {expected}; got t "
            f"{times.shape}, values {rows.shape}"
        )
    if not (np.diff(times) > 0.0).all():
        raise InvalidInput(
            f"PiecewisePolynomial: t must rise; {times[:-1][np.diff(times) <= 0.0][0]:g} is followed by less"
        )
    return times, rows


def _jumping(knots: np.ndarray, terms: np.ndarray, repeat: bool) -> np.ndarray:
    """Whether the value jumps, for each knot but the last; at the first one from the end of a table that is repeated."""
    width = np.diff(knots).reshape(-1, *[1] * (terms.ndim - 2))
    parts = terms * width[:, None] ** np.arange(terms.shape[1]).reshape(1, -1, *[1] * (terms.ndim - 2))
    before = np.roll(parts.sum(axis=1), 1, axis=0)
    size = np.roll(np.abs(parts).sum(axis=1), 1, axis=0) + np.abs(terms[:, 0])
    jumps = np.abs(terms[:, 0] - before) > EQUAL * size
    jumping: np.ndarray = jumps.reshape(len(jumps), -1).any(axis=1)
    jumping[0] &= repeat
    return jumping
