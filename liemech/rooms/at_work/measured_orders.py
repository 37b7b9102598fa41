"""Orders of methods, measured: errors at several steps, their slopes, and what they cost."""

from __future__ import annotations

import os
import time
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...errors import InvalidInput, InvalidType
from ...formulas.arrays import Array
from ...formulas.classes.frozen import frozen
from ...integrators.method import Method
from ...integrators.rkmk import RKMK
from ...simulation.plan import Plan
from ...simulation.reports.written_tables import WrittenTable

SLOPES = 3
"""How many slopes tell an order: at larger steps it may not show yet."""
FINER = 4
"""The reference has this many times the most steps."""


@frozen
class Measured:
    """The errors of a method at several steps.

    h : the steps, (n,).  errors : at the end, relative to the largest component of each part of the
    state, (n,).  seconds : of processor time for each run, (n,).
    """

    name: str
    h: Array
    errors: Array
    seconds: Array

    @property
    def order(self) -> float | None:
        """The slope of log error over log h; None where no errors fall."""
        return order_of(self.h, self.errors)


@frozen
class Orders:
    """Errors, orders and costs of methods, as `measure_order` found them; `print` it.

    `float(orders)` is the order of a single method, `orders[name]` what was measured of one.
    """

    methods: tuple[Measured, ...]
    duration: float

    def __getitem__(self, name: str) -> Measured:
        for method in self.methods:
            if method.name == name:
                return method
        names = ", ".join(method.name for method in self.methods)
        raise InvalidInput(f"Orders: {name!r} was not measured; known are: {names}")

    def __float__(self) -> float:
        if len(self.methods) != 1 or self.methods[0].order is None:
            raise InvalidInput("Orders: there is not one order; take those of orders.methods")
        return self.methods[0].order

    def __str__(self) -> str:
        lines = [f"{'method':<40} {'order':>6} {'steps':>7} {'error':>9} {'ms':>9}"]
        for method in self.methods:
            order = "-" if method.order is None else f"{method.order:.2f}"
            steps, seconds = round(self.duration / method.h[-1]), 1e3 * method.seconds[-1]
            lines.append(f"{method.name:<40} {order:>6} {steps:>7} {method.errors[-1]:>9.1e} {seconds:>9.3f}")
        return "\n".join(lines)

    @property
    def table(self) -> WrittenTable:
        """A row for each method and step: name, h, error, order between this step and the one
        before, seconds.
        """
        rows = []
        for method in self.methods:
            slopes = np.diff(np.log(method.errors)) / np.diff(np.log(method.h))
            for k, (h, error, seconds) in enumerate(zip(method.h, method.errors, method.seconds, strict=True)):
                slope = float(slopes[k - 1]) if k else float("nan")
                rows.append((method.name, float(h), float(error), slope, float(seconds)))
        return WrittenTable(("method", "h", "error", "order", "seconds"), tuple(rows))

    def to_csv(self, path: str | os.PathLike[str] | None = None) -> str | None:
        """The table as comma-separated values: the text, or written to a file."""
        return self.table.to_csv(path)

    def to_latex(self, path: str | os.PathLike[str] | None = None) -> str | None:
        """The table as a tabular for LaTeX: the text, or written to a file."""
        return self.table.to_latex(path)

    @property
    def errors(self) -> dict[str, Array]:
        """The errors by name, for `lm.plots.orders(found.methods[0].h, found.errors)`."""
        return {method.name: method.errors for method in self.methods}

    @property
    def work(self) -> dict[str, tuple[Array, Array]]:
        """Errors and seconds by name, for `lm.plots.work_precision(found.work)`."""
        return {method.name: (method.errors, method.seconds) for method in self.methods}


def measure_order(
    system: Any,
    methods: Any,
    start: Any,
    t_end: float,
    *,
    steps: Iterable[int] = (16, 32, 64, 128, 256),
    exact: Any = None,
    compiled: bool | None = True,
) -> Orders:
    """Run methods with more and more equal steps to t_end, and take the slopes of their errors.

    methods : one, several, or a mapping from names to methods.  steps : how many, two numbers at
    least.  exact : the state at t_end; left out, `system.exact` where there is one, else RKMK of
    order 8 with four times the most steps.  compiled : as in `integrate`; True, so that times can be
    compared.

    The error is that of the part of the state with the largest one, relative to its largest
    component.  Times are the least of three runs, without compiling and preparing.
    Raises InvalidInput, InvalidType for other arguments.

    Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., II.4 and
    II.10.
    """
    named = _named(methods)
    counts = sorted(int(n) for n in steps)
    if len(counts) < 2 or counts[0] < 1:
        raise InvalidInput(f"measure_order: steps are two numbers at least, from 1 on; got {counts}")
    if not 0.0 < float(t_end) < np.inf:
        raise InvalidInput(f"measure_order: t_end must be positive and finite; got {t_end!r}")
    if start.bodies is not None:
        raise InvalidInput("measure_order takes one body, not an ensemble")
    reference = _reference(system, start, float(t_end), counts[-1], compiled) if exact is None else exact
    measured = []
    for name, method in named.items():
        errors, seconds = [], []
        for n in counts:
            plan = Plan(system, method, h=t_end / n, every=n, compiled=compiled, progress=False)
            took = []
            for _ in range(4):  # the first one compiles
                since = time.process_time()
                last = plan.run(start, steps=n).last
                took.append(time.process_time() - since)
            errors.append(_distance(last, reference))
            seconds.append(min(took[1:]))
        h = float(t_end) / np.array(counts)
        measured.append(Measured(name, h, np.array(errors), np.array(seconds)))
    return Orders(tuple(measured), float(t_end))


def _named(methods: Any) -> dict[str, Any]:
    """Methods by their names, from one, several, or a mapping."""
    if not isinstance(methods, Mapping):
        several = [methods] if isinstance(methods, Method) else [*methods]
        methods = {getattr(m, "name", repr(m)): m for m in several}
    for method in methods.values():
        if not isinstance(method, Method):
            raise InvalidType(f"measure_order: {method!r} is no method such as RKMK(order=4)")
    if not methods:
        raise InvalidInput("measure_order needs a method at least")
    return dict(methods)


def _reference(system: Any, start: Any, t_end: float, most: int, compiled: Any) -> Any:
    """The state at the end: exact, or by many steps of high order."""
    if callable(getattr(system, "exact", None)):
        return system.exact(start, t_end)
    n = FINER * most
    plan = Plan(system, RKMK(order=8), h=t_end / n, every=n, compiled=compiled, progress=False)
    return plan.run(start, steps=n).last


def _distance(state: Any, exact: Any) -> float:
    """The largest relative difference of a part of the state."""
    worst = 0.0
    for name, x in state.parts.items():
        target = exact.parts.get(name)
        if x is None or target is None:
            continue
        a, b = np.asarray(x, dtype=float), np.asarray(target, dtype=float)
        worst = max(worst, float(np.abs(a - b).max() / (np.abs(b).max() or 1.0)))
    return worst


def order_of(h: ArrayLike, error: ArrayLike) -> float | None:
    """The order that errors show: between neighbouring steps the slope of log error over log h, of
    the last three the middle one.

    The last are those before the errors fall less than half as fast as until then, at the floor of
    rounding. None where fewer than two errors fall.
    """
    steps, errors = np.asarray(h, dtype=float), np.asarray(error, dtype=float)
    rows = falling(steps, errors)
    slopes = np.diff(np.log(errors[rows])) / np.diff(np.log(steps[rows]))
    return float(np.median(slopes[-SLOPES:])) if len(slopes) else None


def falling(steps: Array, errors: Array) -> NDArray[np.intp]:
    """Numbers of the errors above the floor of rounding, from the largest step down."""
    rows = np.flatnonzero(np.isfinite(errors) & (errors > 0.0))
    rows = rows[np.argsort(-steps[rows], kind="stable")]
    slopes = np.diff(np.log(errors[rows])) / np.diff(np.log(steps[rows]))
    flat = np.flatnonzero(~(slopes >= 0.5 * np.maximum.accumulate(np.maximum(slopes, 0.0))) | ~(slopes > 0.0))
    return rows[: int(flat[0]) + 1 if len(flat) else len(rows)]
