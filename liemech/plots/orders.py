"""Order plots and work-precision plots: error over step, and work over error."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InvalidInput
from ..formulas.arrays import Array
from ..rooms.at_work.measured_orders import falling, order_of
from .style import GREY, Axes, legend, marked, plane_axes


def orders(
    h: ArrayLike,
    errors: Mapping[str, ArrayLike],
    *,
    ax: Axes | None = None,
    title: str | None = None,
    ylabel: str = "error",
) -> Axes:
    """Draw errors over the step, both logarithmic; the order of each method, its slope, stands in
    the legend.

    h : (n,), the steps.  errors : the errors of each method at these steps, by name, (n,); nan
    where there is none.

    The order is that of `order_of`; dotted lines of whole slope go through the last error above the
    floor of rounding. Returns the axes. Raises InvalidInput for shapes that differ and for numbers
    that are not positive.
    """
    steps = _positive(h, "orders: h")
    ax = plane_axes(ax, title, "step $h$", ylabel)
    for k, (name, values) in enumerate(errors.items()):
        error = _positive(values, f"orders: {name}", len(steps))
        fitted = order_of(steps, error)
        label = name if fitted is None else f"{name}: order {fitted:.2f}"
        ax.loglog(steps, error, linewidth=1.2, label=label, **marked(k))
        if fitted is not None and round(fitted) > 0:
            foot = falling(steps, error)[-1]
            guide = error[foot] * (steps / steps[foot]) ** round(fitted)
            inside = (guide >= 0.3 * np.nanmin(error)) & (guide <= 3.0 * np.nanmax(error))
            ax.loglog(steps[inside], guide[inside], color=GREY, linestyle=":", linewidth=0.8, zorder=0.5)
    if np.ptp(np.log10(steps)) < 2.0:
        from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

        ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        ax.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
        ax.xaxis.set_minor_formatter(NullFormatter())
    legend(ax, loc="best")
    return ax


def work_precision(
    curves: Mapping[str, tuple[ArrayLike, ArrayLike]],
    *,
    ax: Axes | None = None,
    title: str | None = None,
    xlabel: str = "error",
    ylabel: str = "time (s)",
) -> Axes:
    """Draw work over error, both logarithmic, accuracy growing to the right: the lowest curve is
    the cheapest method.

    curves : of each method, by name, its errors and its work, (n,) each: seconds, or evaluations of
    the field.

    Returns the axes. Raises InvalidInput for shapes that differ and for numbers that are not
    positive.

    Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., II.10
    (work-precision diagrams).
    """
    ax = plane_axes(ax, title, xlabel, ylabel)
    for k, (name, (errors, work)) in enumerate(curves.items()):
        error = _positive(errors, f"work_precision: the errors of {name}")
        cost = _positive(work, f"work_precision: the work of {name}", len(error))
        ax.loglog(error, cost, label=name, linewidth=1.2, **marked(k))
    ax.xaxis.set_inverted(True)
    legend(ax, loc="best")
    return ax


def _positive(values: ArrayLike, name: str, n: int | None = None) -> Array:
    """Positive numbers, (n,); nan is what is not there, and so is an error of zero, which has no logarithm."""
    array = np.asarray(values, dtype=float)
    if array.ndim != 1 or not len(array) or (n is not None and len(array) != n):
        raise InvalidInput(f"plots.{name} has shape {array.shape}; wanted is ({'n' if n is None else n},)")
    if (array < 0.0).any() or np.isinf(array).any():
        raise InvalidInput(
            f"plots.{name} must be positive and finite; got {array[(array < 0.0) | np.isinf(array)][0]:g}"
        )
    return np.where(array > 0.0, array, np.nan)
