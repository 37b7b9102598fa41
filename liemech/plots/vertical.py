"""The vertical seen from a body, Gamma = g^T e3, on its sphere."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import InvalidInput
from ..formulas.arrays import Array
from ..models.bodies.heavy_top import ReducedHeavyTop
from ..models.poses import attitude, configurations, is_pose, rotated
from .spheres.globe import directions, dots, globe, line
from .spheres.projection import VIEW
from .spheres.sphere import GAMMA
from .style import COLORS, Axes, needs_run, part


def vertical(
    run: Any,
    *,
    ax: Axes | None = None,
    view: tuple[float, float] = VIEW,
    title: str | None = None,
    label: str | None = None,
    color: str = COLORS[0],
) -> Axes:
    """Draw the vertical as the body sees it, Gamma = g^T e3, on the unit sphere.

    run : one that recorded the attitude of a body, or the momentum (pi, Gamma) of a top on se(3)*;
    of an ensemble the last sample
    of every body is drawn.  view : azimuth and elevation of the eye in degrees.  label : a name for
    a legend.

    Of an upright top Gamma is e3; what lies behind the sphere is faded. Returns the axes. Raises
    InvalidInput without an attitude.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 1.4.
    """
    needs_run(run, "plots.vertical")
    gamma = verticals(run)
    ax, frame = globe(ax, view, title, GAMMA)
    if run.bodies is None:
        line(ax, gamma @ frame.T, back=0.25, zorder=1.5, color=color, linewidth=0.7)
        dots(ax, gamma @ frame.T, color, "o", label)
    else:
        dots(ax, gamma[-1] @ frame.T, color, "o", label)
    return ax


def verticals(run: Any) -> Array:
    """The vertical seen from the body, (n, 3), of an ensemble (n, bodies, 3)."""
    system = run.system
    if isinstance(system, ReducedHeavyTop) and run.states.get("mu") is not None:
        gamma = np.asarray(run.states["mu"])[..., 3:]
        if not gamma.any(axis=-1).all():
            raise InvalidInput("plots.vertical: Gamma is zero, and points nowhere")
        return directions(gamma)
    if run.states.get("g") is None or not is_pose(configurations(system)):
        raise InvalidInput(f"plots.vertical needs the attitude g of a body in space; this run is of {system!r}")
    g = part(run, "g", "plots.vertical")
    axes = g.shape[: 1 if run.bodies is None else 2]
    q = attitude(system, g.reshape(-1, *g.shape[len(axes) :]))
    return rotated(q * np.array([-1.0, -1.0, -1.0, 1.0]), np.array([0.0, 0.0, 1.0])).reshape(*axes, 3)
