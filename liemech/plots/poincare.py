"""Poincare sections: where a motion pierces a surface, time after time."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InvalidInput
from ..formulas.arrays import Array
from ..rooms.constraints.constrained import ConstrainedSystem
from .phase import canonical
from .style import COLORS, Axes, plane_axes


def section(
    run: Any, coordinate: int = 0, value: float = 0.0, direction: int = 1
) -> tuple[Array, Array, NDArray[np.intp]]:
    """Where a canonical motion pierces the surface q_i = value: positions (m, degrees), momenta (m,
    degrees), members (m,).

    coordinate : i, from 0.  direction : +1 for crossings with q_i rising in time, -1 falling, 0
    both.

    Between two samples the motion is the cubic that has their values and velocities, with an error
    of fourth order in the time between samples; so record every step. Raises InvalidInput for
    systems that are not canonical.

    Source: Henon and Heiles, Astron. J. 69 (1964), 73; Hairer, Norsett, Wanner, Solving Ordinary
    Differential Equations I, II.6.
    """
    q, p = canonical(run, "plots.section", coordinate=coordinate)
    n = run.system.degrees
    if run.bodies is None:
        q, p = q[:, None], p[:, None]
    above = q[..., coordinate] - value >= 0.0
    t = np.broadcast_to(run.t.reshape(len(q), -1), above.shape)
    # a run backwards in time has its samples in the order it made them
    later = np.where(t[-1] >= t[0], 1, -1)
    change = (above[1:].astype(int) - above[:-1]) * later
    k, member = np.nonzero(change == np.sign(direction) if direction else change)
    h = np.diff(t, axis=0)[k, member][:, None]
    y = np.concatenate([q, p], axis=-1)
    before, after = y[k, member], y[k + 1, member]
    if not len(k):
        return before[:, :n], before[:, n:], member
    rates = [
        np.concatenate([np.asarray(run.system.velocity(*x)), _force(run.system, *x)], axis=-1)
        for x in ((before[:, :n], before[:, n:]), (after[:, :n], after[:, n:]))
    ]
    low, high = np.zeros((len(k), 1)), np.ones((len(k), 1))
    start = before[:, coordinate, None] - value >= 0.0
    for _ in range(53):  # bisection, to the last bit of s
        s = 0.5 * (low + high)
        same = (_cubic(s, h, before, after, *rates)[:, coordinate, None] - value >= 0.0) == start
        low, high = np.where(same, s, low), np.where(same, high, s)
    crossing = _cubic(high, h, before, after, *rates)
    return crossing[:, :n], crossing[:, n:], member


def poincare_section(
    run: Any,
    coordinate: int = 0,
    value: float = 0.0,
    direction: int = 1,
    shown: int = 1,
    *,
    ax: Axes | None = None,
    title: str | None = None,
) -> Axes:
    """Draw a Poincare section: (q_j, p_j) whenever the motion pierces the surface q_i = value.

    coordinate, value, direction : the surface, as in `section`.  shown : j, from 0.

    Each member of an ensemble has a colour of its own. Regular motions draw curves, chaotic ones
    fill areas. Returns the axes.
    Raises InvalidInput for systems that are not canonical, and if the surface is never pierced.

    Source: Henon and Heiles, The applicability of the third integral of motion, Astron. J. 69
    (1964), 73.
    """
    canonical(run, "plots.poincare_section", shown=shown)
    q, p, member = section(run, coordinate, value, direction)
    if not len(q):
        raise InvalidInput(
            f"plots.poincare_section: the motion never pierces q_{coordinate + 1} = {value:g}; follow it for longer"
        )
    number = shown % run.system.degrees + 1
    ax = plane_axes(ax, title, f"$q_{number}$", f"$p_{number}$", (4.2, 3.8))
    for k in range(run.bodies or 1):
        of_member = member == k
        ax.plot(
            q[of_member, shown],
            p[of_member, shown],
            linestyle="none",
            marker="o",
            markersize=1.6,
            color=COLORS[k % len(COLORS)],
        )
    return ax


def _force(system: Any, q: Array, p: Array) -> Array:
    """p', that of the constraints included."""
    force = np.asarray(system.force(q, p))
    return force + np.asarray(system.constraint_force(q, p)) if isinstance(system, ConstrainedSystem) else force


def _cubic(s: Array, h: Array, y0: Array, y1: Array, f0: Array, f1: Array) -> Array:
    """Hermite's cubic between y0 at s = 0 and y1 at s = 1 with the velocities f0 and f1."""
    return (1.0 - s) * y0 + s * y1 + s * (s - 1.0) * ((1.0 - 2.0 * s) * (y1 - y0) + h * ((s - 1.0) * f0 + s * f1))
