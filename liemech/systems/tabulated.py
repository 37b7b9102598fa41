"""Functions of time that are given by tables: torque histories, driven velocities."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

from ..errors import InvalidInput, InvalidType
from ..formulas import Record, check_finite, horner, real_array, record, vec, where
from ..formulas.tables import Table, entry

OUTSIDE = ("refuse", "hold", "repeat")
"""What may be done beyond a table."""

ROUNDING = 2.0**-48
"""Part of the times of a table by which a stage of a step may miss its ends."""


@record
class PiecewisePolynomial(Record):
    """A function of time given by a table, with a polynomial between each two knots.

        f(t) = c_i0 + c_i1 (t - t_i) + c_i2 (t - t_i)^2 + ...,   t_i <= t < t_(i+1)

    `cubic`, `linear` and `constant` make one of values, `of` takes one from SciPy.  It is a record:
    a field of a force, a system, ... whose formulas call it, `self.torque(t)`, in native code too,
    where tables of any length share one code.  A number or a vector; smooth between the knots only,
    so that adaptive steps may want `breaks=f.knots`.

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

    def __post_init__(self) -> None:
        if not isinstance(self.knots, Table):
            knots = real_array(self.knots, "PiecewisePolynomial: knots")
            terms = real_array(self.coefficients, "PiecewisePolynomial: coefficients")
            check_finite(knots, "PiecewisePolynomial: knots")
            check_finite(terms, "PiecewisePolynomial: coefficients")
            if knots.ndim != 1 or len(knots) < 2 or not (np.diff(knots) > 0.0).all():
                raise InvalidInput(
                    "PiecewisePolynomial: knots are two rising times or "
                    f"more; got shape {knots.shape}, {knots!r}"
                )
            if terms.ndim not in (2, 3) or len(terms) != len(knots) - 1 or 0 in terms.shape:
                n = len(knots) - 1
                raise InvalidInput(
                    f"PiecewisePolynomial: for {n + 1} knots the coefficients are ({n}, degree + "
                    f"1), of a vector ({n}, degree + 1, dim); got {terms.shape}"
                )
            object.__setattr__(self, "degree", terms.shape[1] - 1)
            object.__setattr__(self, "size", terms.shape[2] if terms.ndim == 3 else 0)
            object.__setattr__(self, "knots", Table(knots))
            object.__setattr__(self, "coefficients", Table(terms))
        if self.outside not in OUTSIDE:
            raise InvalidInput(
                f'PiecewisePolynomial: outside is "refuse", "hold" or "repeat"; got {self.outside!r}'
            )
        object.__setattr__(self, "intervals", float(len(self.knots) - 1))
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
                "PiecewisePolynomial.of takes a spline of "
                f"scipy.interpolate, such as CubicSpline; got {curve!r}"
            )
        return cls(curve.x, np.moveaxis(curve.c[::-1], 0, 1), outside)

    @classmethod
    def cubic(
        cls, t: Any, values: Any, ends: Any = "not-a-knot", outside: str = "refuse"
    ) -> PiecewisePolynomial:
        """The cubic spline through the values, twice differentiable.

        t : (n,) rising times in s.  values : (n,) or (n, dim).  ends : SciPy's `bc_type`:
        "not-a-knot", "natural", "clamped", "periodic" or derivatives there.
        """
        from scipy.interpolate import CubicSpline

        times, found = _table(t, values, 0)
        try:
            with np.errstate(all="ignore"):  # what is not finite then is refused
                curve = CubicSpline(times, found, bc_type=ends)
            return cls.of(curve, outside)
        except ValueError as error:
            raise InvalidInput(f"PiecewisePolynomial.cubic: {error}") from None

    @classmethod
    def linear(cls, t: Any, values: Any, outside: str = "refuse") -> PiecewisePolynomial:
        """The straight lines from value to value.  t : (n,) rising times in s.  values : (n,) or
        (n, dim).
        """
        times, found = _table(t, values, 0)
        slopes = np.diff(found, axis=0) / np.diff(times).reshape(-1, *[1] * (found.ndim - 1))
        return cls(times, np.stack([found[:-1], slopes], axis=1), outside)

    @classmethod
    def constant(cls, t: Any, values: Any, outside: str = "refuse") -> PiecewisePolynomial:
        """One value between each two times, such as that of a pulse.

        t : (n + 1,) rising times in s, at which the values change.  values : (n,) or (n, dim), the
        first from t_0 to t_1.
        """
        times, found = _table(t, values, 1)
        return cls(times, found[:, None], outside)

    def derivative(self, order: int = 1) -> PiecewisePolynomial:
        """df/dt, again as such a function; at a knot that of the interval behind it.  Held values
        have no slope: use the formula's `lm.derivative` there.
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
        """f(t): a number, or (dim,).  t : a time in s; of an array, (m,), the values are (m,) or
        (m, dim).
        """
        if isinstance(t, np.ndarray):
            return self._of_array(real_array(t, "PiecewisePolynomial: t"))
        t = self._inside(t)
        i = self._interval(t)
        width = max(self.size, 1)
        at = i * ((self.degree + 1) * width)
        rows = [
            [entry(self.coefficients, at + (k * width + j)) for j in range(width)]
            for k in range(self.degree + 1)
        ]
        return horner(
            [vec(*row) if self.size else row[0] for row in rows], t - entry(self.knots, i)
        )

    def _of_array(self, t: np.ndarray) -> np.ndarray:
        """The values at many times, to the bit."""
        knots, terms = np.asarray(self.knots), self._terms()
        times = np.array([self._inside(x) for x in t.ravel().tolist()])
        i = np.clip(np.searchsorted(knots, times, "right") - 1, 0, len(knots) - 2)
        x = (times - knots[i]).reshape(-1, *[1] * (terms.ndim - 2))
        found = horner([terms[i, k] for k in range(self.degree + 1)], x)
        return found.reshape(*t.shape, *found.shape[1:])

    def _terms(self) -> np.ndarray:
        """The coefficients as they were given."""
        return np.asarray(self.coefficients).reshape(
            len(self.knots) - 1, self.degree + 1, *([self.size] if self.size else [])
        )

    def _inside(self, t: Any) -> Any:
        """The time in the table that counts for t."""
        first, last = entry(self.knots, 0), entry(self.knots, int(self.intervals))
        if self.outside == "hold":
            return min(max(t, first), last)
        if self.outside == "repeat":
            return first + (t - first) % (last - first)
        slack = ROUNDING * max(abs(first), abs(last))
        if not (first - slack <= t <= last + slack):
            raise ValueError(
                f'at t = {t} the table, {first} to {last}, has no value; outside="hold" would hold its ends'
            )
        return t

    def _interval(self, t: Any) -> Any:
        """The number of the interval in which t is, by bisection."""
        low, high = 0, int(self.intervals)
        while high - low > 1:
            middle = (low + high) // 2
            later = t >= entry(self.knots, middle)
            low, high = where(later, middle, low), where(later, high, middle)
        return low

    def __repr__(self) -> str:
        kind = f"{self.size} components" if self.size else "a number"
        ends = f"{np.asarray(self.knots)[0]:g} to {np.asarray(self.knots)[-1]:g}"
        return f"PiecewisePolynomial(t = {ends}, {len(self.knots)} knots, degree {self.degree}, {kind}, {self.outside})"


def _table(t: Any, values: Any, more: int) -> tuple[np.ndarray, np.ndarray]:
    """Times and values that belong together."""
    times, found = (
        real_array(t, "PiecewisePolynomial: t"),
        real_array(values, "PiecewisePolynomial: values"),
    )
    check_finite(times, "PiecewisePolynomial: t")
    check_finite(found, "PiecewisePolynomial: values")
    if (
        times.ndim != 1
        or found.ndim not in (1, 2)
        or len(times) != len(found) + more
        or len(times) < 2
    ):
        wanted = "one value for each time" if more == 0 else "one value between each two times"
        raise InvalidInput(
            f"PiecewisePolynomial: t is (n,) and values are (n,) or (n, dim), {wanted}; got t "
            f"{times.shape}, values {found.shape}"
        )
    if not (np.diff(times) > 0.0).all():
        raise InvalidInput(
            "PiecewisePolynomial: t must rise; "
            f"{times[:-1][np.diff(times) <= 0.0][0]:g} is followed by less"
        )
    return times, found
