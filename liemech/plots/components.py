"""The components of a part of the state over time: what can be drawn of everything."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import InvalidInput
from ..models.poses import configurations, turns
from ..models.swinging.pendulums import DoublePendulum, Pendulum
from .style import Axes, legend, look, needs_run, part, plane_axes, thinned, time_label, time_unit

NAMES = {"mu": "\\mu", "q": "q", "p": "p", "g": "g", "x": "x"}
MOST_CURVES = 6


def components(
    run: Any, name: str | None = None, *, body: int = 0, ax: Axes | None = None, title: str | None = None
) -> Axes:
    """Draw the components of a part of the state over time.

    run : what `integrate` returns.  name : "mu", "g", "q", "p", ...; the first that was recorded if
    not given.
    body : which one of an ensemble.

    At most six are drawn, those that vary most, and none that stand still beside others that move;
    of complex numbers both parts. Returns the axes. Raises InvalidInput for what was not recorded.
    """
    needs_run(run, "plots.components")
    name = next(iter(run.states)) if name is None else name
    rows = part(run, name, "plots.components")
    rows = rows if run.bodies is None else one_body(run, rows, body, "plots.components")
    columns = rows.reshape(len(rows), -1)
    names = [_name(NAMES.get(name, name), np.unravel_index(i, rows.shape[1:])) for i in range(columns.shape[1])]
    if np.iscomplexobj(columns):
        columns = np.concatenate([columns.real, columns.imag], axis=1)
        names = [f"{symbol} {component}" for symbol in ("Re", "Im") for component in names]
    unit = unit_of(run.system, name)
    ax = plane_axes(ax, title, time_label(run), f"${NAMES.get(name, name)}$" + unit)
    spans = np.ptp(columns, axis=0)
    varied = np.argsort(-spans, kind="stable")[: min(MOST_CURVES, np.count_nonzero(spans) or MOST_CURVES)]
    samples, t = thinned(len(rows)), times_of(run, body)
    for k, column in enumerate(sorted(varied)):
        label = names[column] if columns.shape[1] > 1 else None
        ax.plot(t[samples], columns[samples, column], label=label, **look(k))
    legend(ax, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return ax


def _name(symbol: str, index: Any) -> str:
    """A component, counted from 1."""
    return f"${symbol}_{{{','.join(str(i + 1) for i in index)}}}$"


def unit_of(system: Any, name: str) -> str:
    """The unit of a part of the state, as it stands behind its symbol on an axis; nothing where
    parts differ, or there is none.
    """
    if isinstance(system, (Pendulum, DoublePendulum)):
        return {"q": " (rad)", "p": " (kg m$^2$/s)"}.get(name, "")
    turning = name == "mu" and turns(configurations(system)) and time_unit(system) == "s"
    return " (kg m$^2$/s)" if turning else ""


def one_body(run: Any, rows: np.ndarray, body: int, where: str) -> np.ndarray:
    """The rows of one body of an ensemble."""
    if not -run.bodies <= body < run.bodies:
        raise InvalidInput(f"{where}: body = {body} is not there; the run has {run.bodies} bodies")
    return rows[:, body]


def times_of(run: Any, body: int) -> np.ndarray:
    """The times of one body, which may have times of its own."""
    t: np.ndarray = run.t
    return t if t.ndim == 1 else t[:, body]
