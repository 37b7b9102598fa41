"""Phase portraits: momentum over position, of one motion or of an ensemble."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import InvalidInput
from ..formulas.arrays import Array
from ..models.swinging.pendulums import DoublePendulum, Pendulum
from ..systems.canonical import CanonicalSystem
from .components import unit_of
from .spheres.cloud import colors
from .style import COLORS, INK, Axes, needs_run, part, plane_axes, thinned


def phase_portrait(
    run: Any, degree: int = 0, *, wrap: float | None = None, ax: Axes | None = None, title: str | None = None
) -> Axes:
    """Draw one degree of freedom of a canonical system in its phase plane, p over q; of an ensemble
    every member.

    run : of a system with positions q and momenta p.  degree : which degree of freedom, from 0.
    wrap : the period of q if it is an angle, which is drawn between -wrap/2 and wrap/2; 2 pi for
    pendulums, else none.

    Members are coloured by their energy, from dark to light; a dot is where each is at the end.
    With one degree of freedom and an energy that is kept no curve crosses another. Returns the
    axes. Raises InvalidInput for other systems.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., I.1.3.
    """
    q, p = canonical(run, "plots.phase_portrait", degree=degree)
    n = run.system.degrees
    if wrap is None and isinstance(run.system, (Pendulum, DoublePendulum)):
        wrap = 2.0 * np.pi
    index = f"_{degree % n + 1}" if n > 1 else ""
    x, y = (f"${part}{index}$" + unit_of(run.system, part) for part in "qp")
    ax = plane_axes(ax, title, x, y, (4.2, 3.6))
    q, p = q[..., degree], p[..., degree]
    if wrap:
        q = np.mod(q + 0.5 * wrap, wrap) - 0.5 * wrap
    if run.bodies is None:
        _curve(ax, q, p, wrap, COLORS[0])
        return ax
    for k, color in enumerate(colors(np.asarray(run.energy[0]))):
        _curve(ax, q[:, k], p[:, k], wrap, color)
    return ax


def plane(run: Any, ax: Axes | None = None, title: str | None = None) -> Axes:
    """A motion of two numbers y in their plane; a ring is the start, a dot the end."""
    y = part(run, "y", "plots.plot")
    ax = plane_axes(ax, title, "$y_1$", "$y_2$", (4.2, 3.6))
    _curve(ax, y[:, 0], y[:, 1], None, COLORS[0])
    ax.plot(*y[0], marker="o", markersize=7.0, color="none", markeredgecolor=INK)
    return ax


def _curve(ax: Axes, q: Array, p: Array, wrap: float | None, color: Any) -> None:
    samples = thinned(len(q))
    q, p = q[samples], p[samples]
    at: Any = np.flatnonzero(np.abs(np.diff(q)) > 0.5 * wrap) + 1 if wrap else []
    ax.plot(np.insert(q, at, np.nan), np.insert(p, at, np.nan), color=color, linewidth=0.9)
    ax.plot(q[-1:], p[-1:], color=color, marker="o", markersize=3.5, markeredgecolor="white", markeredgewidth=0.4)


def canonical(run: Any, where: str, **degrees: int) -> tuple[Array, Array]:
    """The positions and momenta of a run, which has the degrees of freedom that are asked for."""
    needs_run(run, where)
    if not isinstance(run.system, CanonicalSystem):
        raise InvalidInput(
            f"{where} is for canonical systems, with positions q and momenta p; this run is of {run.system!r}"
        )
    n = run.system.degrees
    for name, degree in degrees.items():
        if not -n <= degree < n:
            raise InvalidInput(f"{where}: {name} = {degree} is not there; {run.system!r} has {n} degrees of freedom")
    return part(run, "q", where), part(run, "p", where)
