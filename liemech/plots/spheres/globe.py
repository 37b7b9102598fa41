"""Drawing on a sphere that hides what lies behind it: curves, dots, marks, axes.

The sphere is drawn by orthographic projection on ordinary plane axes, because there every curve can
be cut exactly where it passes behind; Matplotlib's 3-D axes do not hide what lies behind.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...errors import InvalidInput, InvalidType
from ...formulas.arrays import Array, real_array
from ...simulation.trajectory import Trajectory
from ..style import INK, MOST_DOTS, Axes, new_figure, require_matplotlib, thinned
from .projection import split_at_horizon, view_frame

LEVEL = {"color": "#8c95a4", "linewidth": 0.5}
SEPARATRIX = {"color": "#565f6d", "linewidth": 0.9}
EXACT = {"color": INK, "linewidth": 0.9}
LAST = {"linestyle": "none", "marker": "o", "markersize": 7.0, "markeredgecolor": "white"}
RING = {"linestyle": "none", "marker": "o", "markersize": 9.5, "color": "none", "markeredgecolor": INK}
LIMB = "#8b93a1"
# length of the body axes in radii, and how far beyond the tip their name stands
ARROW, NAME = 1.25, 0.10


def globe(ax: Axes | None, view: tuple[float, float], title: str | None, names: Sequence[str]) -> tuple[Axes, Array]:
    """A lit unit sphere with three named axes, and the rotation to (right, up, towards the eye), (3, 3)."""
    require_matplotlib()
    from matplotlib.patches import Circle

    ax = ax or sphere_axes(title)
    frame = view_frame(*view)
    ax.imshow(_shade(), extent=(-1, 1, -1, 1), interpolation="bilinear", zorder=0).set_clip_path(
        Circle((0, 0), 1.0, transform=ax.transData)
    )
    ax.add_patch(Circle((0, 0), 1.0, fill=False, edgecolor=LIMB, linewidth=0.8, zorder=0.95))
    axes(ax, frame, names)
    width, bottom, top = limits(frame)
    # after the image, which sets its own
    ax.set(xlim=(-width, width), ylim=(bottom, top), aspect="equal")
    bare(ax, title)
    return ax, frame


def sphere_axes(title: str | None) -> Axes:
    """The square axes of a new figure, with room for a title if there is one."""
    return new_figure(3.4, 3.6 if title else 3.4).add_axes((0.0, 0.0, 1.0, 0.94 if title else 1.0))


def bare(ax: Axes, title: str | None) -> None:
    """Take frame and ticks off the axes, and set a title if there is one."""
    ax.set_axis_off()
    if title:
        ax.set_title(title, fontsize=11, color=INK, pad=4)


def vectors(values: ArrayLike, name: str) -> Array:
    """Vectors in space, (n, 3), finite; InvalidInput and InvalidType name what is wrong."""
    if isinstance(values, Trajectory):
        raise InvalidType(f"{name} must be vectors, (n, 3); got a run: give its momenta, run.mu")
    points = np.atleast_2d(real_array(values, name))
    if points.ndim != 2 or points.shape[1] != 3 or not len(points):
        raise InvalidInput(f"{name} must have shape (n, 3); got {np.shape(values)}")
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if len(bad):
        raise InvalidInput(f"{name} must be finite; row {bad[0]} is {points[bad[0]].tolist()}")
    return points


def directions(values: Array) -> Array:
    """Vectors divided by their lengths, (..., 3), in all units; zero stays zero."""
    largest = np.abs(values).max(axis=-1, keepdims=True)
    values = np.divide(values, largest, out=np.zeros_like(values), where=largest > 0.0)
    size = np.linalg.norm(values, axis=-1, keepdims=True)
    return np.divide(values, size, out=values, where=size > 0.0)


def line(ax: Axes, curve: Array, back: float, zorder: float, **style: Any) -> None:
    """One curve on the sphere, in view coordinates: cut at the horizon."""
    halves(ax, *split_at_horizon(curve), back, zorder, **style)


def halves(ax: Axes, front: Array, behind: Array, back: float, zorder: float, **style: Any) -> None:
    """A curve that is cut already: its front as it is, its back below everything in front and faded
    to the opacity `back`.
    """
    ax.plot(behind[:, 0], behind[:, 1], alpha=back, zorder=0.5 + 0.1 * zorder, **(style | {"label": None}))
    ax.plot(front[:, 0], front[:, 1], zorder=zorder, solid_capstyle="round", **style)


def chords(ax: Axes, segments: Array, back: float, zorder: float, **style: Any) -> None:
    """Many short pieces of curves on the sphere, (m, 2, 3), in view coordinates."""
    from matplotlib.collections import LineCollection

    ahead = segments[:, :, 2].sum(axis=1) >= 0.0
    for part, alpha, height in ((~ahead, back, 0.5 + 0.1 * zorder), (ahead, 1.0, zorder)):
        ax.add_collection(LineCollection(list(segments[part, :, :2]), alpha=alpha, zorder=height, **style))


def dots(ax: Axes, points: Array, color: Any, marker: str, label: str | None) -> None:
    """Points in view coordinates; those behind are pale and below everything in front.
    color : one, or (n, 3) or (n, 4).
    """
    from matplotlib.colors import to_rgb, to_rgba_array

    if len(points) > MOST_DOTS:
        samples = thinned(len(points))
        points, color = points[samples], color if isinstance(color, str) else color[samples]
    size = float(np.clip(46.0 / np.sqrt(len(points)), 2.0, 4.2))
    ahead = points[:, 2] >= 0.0
    if not isinstance(color, str):
        rgb = to_rgba_array(color)[:, :3]
        for part, shown, z in ((~ahead, 0.35 * rgb + 0.65 * 0.87, 0.75), (ahead, rgb, 2.0)):
            ax.scatter(points[part, 0], points[part, 1], c=shown[part], s=max(size, 3.2) ** 2, linewidths=0.0, zorder=z)
        return
    # opaque: many layers stay as pale as one
    pale = tuple(0.35 * channel + 0.65 * 0.87 for channel in to_rgb(color))
    style: dict[str, Any] = {"linestyle": "none", "marker": marker, "markersize": size}
    edge: dict[str, Any] = {"markeredgecolor": "white", "markeredgewidth": 0.3}
    ax.plot(*points[~ahead, :2].T, color=pale, markeredgewidth=0.0, zorder=0.75, **style)
    ax.plot(*points[ahead, :2].T, color=color, label=label, zorder=2.0, **edge, **style)


def mark(ax: Axes, point: Array, **style: Any) -> None:
    behind = point[2] < 0.0
    ax.plot(*point[:2, None], alpha=0.35 if behind else 1.0, zorder=0.94 if behind else 3.5, **style)


def axes(ax: Axes, frame: Array, names: Sequence[str]) -> None:
    """Named arrows along three axes, from the sphere outwards; of one that points away, only what the sphere leaves."""
    from matplotlib.patheffects import withStroke

    for name, axis in zip(names, frame.T):
        reach = float(np.hypot(axis[0], axis[1]))
        start = 1.0 if axis[2] >= 0.0 else 1.0 / max(reach, 1e-9)
        if start >= ARROW or reach < 1e-9:  # hidden by the sphere, or pointing straight at the eye
            continue
        arrow = {"arrowstyle": "-|>", "color": INK, "linewidth": 0.9, "shrinkA": 0, "shrinkB": 0}
        ax.annotate("", xy=tuple(ARROW * axis[:2]), xytext=tuple(start * axis[:2]), arrowprops=arrow, zorder=5)
        x, y = ARROW * axis[:2] + NAME * axis[:2] / reach
        words = ax.text(x, y, name, ha="center", va="center", fontsize=11, color=INK, zorder=5)
        words.set_path_effects([withStroke(linewidth=2.2, foreground="#ffffffd0")])


def limits(frame: Array) -> tuple[float, float, float]:
    """Half width, bottom and top of the picture in radii: the sphere, the arrows and their names, centred."""
    tips = ARROW * frame[:2] + NAME * frame[:2] / np.maximum(np.hypot(*frame[:2]), 1e-9)
    room = 0.09  # for the name itself
    x, y = np.abs(tips[0]).max() + room, tips[1]
    return max(1.05, x), min(-1.05, y.min() - room), max(1.05, y.max() + room)


def _shade() -> Array:
    """The lit unit disc, (220, 220, 3): softened cosine law, light from the upper left."""
    x, y = np.meshgrid(np.linspace(-1, 1, 220), np.linspace(1, -1, 220))
    z = np.sqrt(np.clip(1.0 - x**2 - y**2, 0.0, None))
    light = (0.5 + 0.5 * (-0.40 * x + 0.55 * y + 0.73 * z))[..., None] ** 1.6
    dark, bright = np.array([0.745, 0.775, 0.825]), np.array([0.985, 0.988, 0.994])
    return dark + light * (bright - dark)
