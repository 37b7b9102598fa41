"""A function on the sphere, such as a vorticity, as colours on its front."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InvalidInput
from .spheres.globe import LIMB, bare, sphere_axes
from .spheres.projection import VIEW, view_frame
from .style import COLORS, Axes, require_matplotlib

FIELD = (COLORS[0], "#f7f7f5", COLORS[1])
"""The colours of the least value, of zero and of the largest."""
PIXELS = 480
"""Across the sphere."""


def field(
    values: ArrayLike,
    latitude: ArrayLike,
    longitude: ArrayLike,
    *,
    ax: Axes | None = None,
    most: float | None = None,
    view: tuple[float, float] = VIEW,
    title: str | None = None,
) -> Axes:
    """A function on the sphere, seen from one side: blue where it is negative, vermilion where positive.

    values : (a, b) at latitudes (a,) and longitudes (b,), in rad, ascending, from -pi to pi; values
    between are interpolated.  most : the value of the full colours; by default the largest one.
    view : azimuth and elevation of the eye, in degrees.
    Returns the axes.  Raises InvalidInput for shapes that do not fit, and values that are not finite.
    """
    require_matplotlib()
    from matplotlib.colors import LinearSegmentedColormap
    from matplotlib.patches import Circle

    grid, north, east = (np.asarray(x, dtype=float) for x in (values, latitude, longitude))
    if grid.shape != (len(north), len(east)):
        raise InvalidInput(
            f"plots.field: values has shape {grid.shape}; it must be that of latitude and longitude, "
            f"({len(north)}, {len(east)})"
        )
    if not np.isfinite(grid).all():
        raise InvalidInput("plots.field: values must be finite")
    full = float(np.abs(grid).max()) if most is None else float(most)
    x = np.linspace(-1.0, 1.0, PIXELS)
    right, up = np.meshgrid(x, x)
    ahead = np.sqrt(np.clip(1.0 - right**2 - up**2, 0.0, None))
    space = np.stack([right, up, ahead], axis=-1) @ view_frame(*view)
    at = np.arcsin(np.clip(space[..., 2], -1.0, 1.0)), np.arctan2(space[..., 1], space[..., 0])
    ax = ax or sphere_axes(title)
    disk = ax.imshow(
        _between(grid, north, east, *at) * (0.86 + 0.14 * ahead),  # paler towards its edge
        extent=(-1, 1, -1, 1),
        origin="lower",
        cmap=LinearSegmentedColormap.from_list("field", FIELD),
        vmin=-full,
        vmax=full,
        interpolation="bilinear",
    )
    disk.set_clip_path(Circle((0, 0), 1.0, transform=ax.transData))
    ax.add_patch(Circle((0, 0), 1.0, fill=False, edgecolor=LIMB, linewidth=0.8))
    ax.set(xlim=(-1.03, 1.03), ylim=(-1.03, 1.03), aspect="equal")
    bare(ax, title)
    return ax


def _between(values: Any, north: Any, east: Any, latitude: Any, longitude: Any) -> np.ndarray:
    """Values interpolated from the four nearest points of a grid; beyond its ends the values there."""
    i, s = _place(north, latitude)
    j, t = _place(east, longitude)
    low, high = (
        (1.0 - t) * values[k, j] + t * values[k, j + 1] for k in (i, i + 1)
    )  # fmt: skip
    return np.asarray((1.0 - s) * low + s * high)


def _place(nodes: Any, x: Any) -> tuple[np.ndarray, np.ndarray]:
    """The node before, and how far it is from there to the next one, from 0 to 1."""
    i = np.clip(np.searchsorted(nodes, x) - 1, 0, len(nodes) - 2)
    return i, np.clip((x - nodes[i]) / (nodes[i + 1] - nodes[i]), 0.0, 1.0)
