"""Static pictures: momentum on its coadjoint orbit.

A coadjoint orbit of SO(3) is a sphere. It is drawn by orthographic projection on ordinary plane axes, because there
every curve can be cut exactly where it passes behind the sphere; Matplotlib's 3-D axes do not hide what lies behind.
All curves are reduced to the unit sphere first, so the pictures do not depend on units.

Matplotlib is imported inside the functions that draw. Nothing here touches its global settings or opens a window.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import InvalidInput, MissingExtra

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

# Okabe and Ito's palette, told apart by every kind of colour vision: blue, vermilion, green, purple, orange, sky.
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
VIEW = (40.0, 25.0)  # shows all three body axes and the separatrix crossing at the middle one
INK, GREY = "#1a1a1a", "#5f6672"
LEVEL = {"color": "#8c95a4", "linewidth": 0.5}
SEPARATRIX = {"color": "#565f6d", "linewidth": 0.9}
EXACT = {"color": INK, "linewidth": 0.9}
LAST = {"linestyle": "none", "marker": "o", "markersize": 7.0, "markeredgecolor": "white"}
RING = {"linestyle": "none", "marker": "o", "markersize": 9.5, "color": "none", "markeredgecolor": INK}
ARROW, NAME = 1.25, 0.10  # length of the body axes in radii, and how far beyond the tip their name stands
MOST_DOTS = 4000  # more numerical points than this are thinned evenly: nobody could tell them apart


class Panel(NamedTuple):
    """One sphere of `figure_one`: a title, the momenta (n, 3) of one method, a line of text below, and optionally the
    exact momentum (3,) at the last of them."""

    title: str
    mu: ArrayLike
    caption: str = ""
    end: ArrayLike | None = None


# ------------------------------------------------------------------------------------------------------- geometry


def view_frame(azimuth: float, elevation: float) -> NDArray[np.float64]:
    """The rotation that takes body axes to (right, up, towards the eye).

    The eye is at (cos e cos a, cos e sin a, sin e), with azimuth a and elevation e in degrees. Returns (3, 3).
    """
    a, e = np.radians([azimuth, elevation])
    return np.array(
        [
            [-np.sin(a), np.cos(a), 0.0],
            [-np.sin(e) * np.cos(a), -np.sin(e) * np.sin(a), np.cos(e)],
            [np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)],
        ]
    )


def split_at_horizon(curve: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Cut a curve (n, 3) in view coordinates where it passes from the front (z >= 0) to the back (z < 0).

    Each crossing is inserted as a point of both parts: there z = 0 exactly, and the point lies on the great circle
    through its two neighbours, at the distance interpolated between theirs. Returns the front and the back,
    both (n + crossings, 3), with NaN in place of the other's points, so that each draws as one broken line.
    """
    curve = np.asarray(curve, dtype=float)
    front = curve[:, 2] >= 0.0
    at = np.flatnonzero(front[1:] != front[:-1])
    p, q = curve[at], curve[at + 1]
    s = (p[:, 2] / (p[:, 2] - q[:, 2]))[:, None]
    cut = (1.0 - s) * p + s * q
    cut[:, 2] = 0.0
    length = np.linalg.norm(cut, axis=1, keepdims=True)
    wanted = (1.0 - s) * np.linalg.norm(p, axis=1, keepdims=True) + s * np.linalg.norm(q, axis=1, keepdims=True)
    cut *= np.divide(wanted, length, out=np.ones_like(length), where=length > 0.0)  # a chord through the centre stays
    points = np.insert(curve, at + 1, cut, axis=0)
    shared = np.insert(np.zeros(len(curve), dtype=bool), at + 1, True)
    ahead = np.insert(front, at + 1, True)[:, None]
    return np.where(ahead, points, np.nan), np.where(ahead & ~shared[:, None], np.nan, points)


def principal_moments(inertia: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Ascending principal moments (3,), scaled to J_max = 1, and the principal axes as columns (3, 3).

    `inertia` holds three principal moments (3,) or a symmetric matrix (3, 3). Raises InvalidInput for anything else.
    """
    J = np.asarray(inertia, dtype=float)
    if J.shape not in ((3,), (3, 3)) or not np.isfinite(J).all():
        raise InvalidInput(f"inertia must be three finite moments or a finite 3x3 matrix; got {inertia!r}")
    J = J / (np.abs(J).max() or 1.0)  # first, so that no unit of inertia overflows
    J = np.diag(J) if J.ndim == 1 else J
    if np.abs(J - J.T).max() > 1e-6:
        raise InvalidInput(f"inertia must be symmetric; got {inertia!r}")
    moments, axes = np.linalg.eigh(J)
    if moments[0] <= 0.0:
        raise InvalidInput(f"inertia must have positive principal moments; got {inertia!r}")
    return moments / moments[-1], axes


def separatrix(inertia: ArrayLike, samples: int = 361) -> NDArray[np.float64]:
    """The two great circles of the unit sphere on which the energy is that of the middle axis.

    With J1 <= J2 <= J3 they are cos(s) e2 + sin(s) (+- p1 e1 + p3 e3), p1^2 = J1 (J3 - J2) / (J2 (J3 - J1)) and
    p3^2 = J3 (J2 - J1) / (J2 (J3 - J1)). Returns (2, samples, 3); (0, samples, 3) for a spherical inertia. For an
    axisymmetric body both are the equator, a circle of equilibria.
    Source: Landau and Lifshitz, Mechanics, section 37 (the intersection of ellipsoid and sphere).
    """
    (J1, J2, J3), axes = principal_moments(inertia)
    if _spherical(J1, J3):
        return np.empty((0, samples, 3))
    p1 = np.sqrt(J1 * (J3 - J2) / (J2 * (J3 - J1)))
    p3 = np.sqrt(J3 * (J2 - J1) / (J2 * (J3 - J1)))
    s = np.linspace(0.0, 2.0 * np.pi, samples)
    circles = [np.stack([sign * p1 * np.sin(s), np.cos(s), p3 * np.sin(s)], axis=-1) for sign in (1.0, -1.0)]
    return np.array(circles) @ axes.T


def energy_levels(inertia: ArrayLike, count: int = 7, samples: int = 361) -> NDArray[np.float64]:
    """Closed curves of constant energy mu.J^-1 mu / 2 on the unit sphere, evenly spaced.

    Let k be the axis of an extreme moment, i the other extreme, j the middle one. The curve that meets the great
    circle from k to i at the angle a from k is

        x_i = A_i cos(s),  x_j = A_j sin(s),  x_k = +- sqrt((1 - A_i^2) cos^2(s) + (1 - A_j^2) sin^2(s)),
        A_i = sin(a),  A_j^2 = sin^2(a) J_j (J_k - J_i) / (J_i (J_k - J_j)),

    which is the exact intersection of ellipsoid and sphere. `count` angles are shared between the two families in
    proportion to their width. Returns (2 * count, samples, 3); (0, samples, 3) for a spherical inertia.
    """
    J, axes = principal_moments(inertia)
    curves: list[NDArray[np.float64]] = []
    s = np.linspace(0.0, 2.0 * np.pi, samples)
    if not _spherical(J[0], J[2]):
        widest = np.arctan2(np.sqrt(J[0] * (J[2] - J[1])), np.sqrt(J[2] * (J[1] - J[0])))  # axis 3 to the separatrix
        about_3 = round(count * widest / (0.5 * np.pi))
        for k, i, width, n in ((2, 0, widest, about_3), (0, 2, 0.5 * np.pi - widest, count - about_3)):
            for a in width * np.arange(1, n + 1) / (n + 1):
                Ai = np.sin(a)
                Aj = min(1.0, Ai * np.sqrt(J[1] * (J[k] - J[i]) / (J[i] * (J[k] - J[1]))))
                x = np.empty((samples, 3))
                x[:, i], x[:, 1] = Ai * np.cos(s), Aj * np.sin(s)
                x[:, k] = np.sqrt((1.0 - Ai**2) * np.cos(s) ** 2 + (1.0 - Aj**2) * np.sin(s) ** 2)
                mirror = np.ones(3)
                mirror[k] = -1.0
                curves += [x, x * mirror]
    return np.array(curves).reshape(-1, samples, 3) @ axes.T


def _spherical(smallest: float, largest: float) -> bool:
    return bool(largest - smallest <= 64.0 * np.finfo(float).eps * largest)


# -------------------------------------------------------------------------------------------------------- pictures


def momentum_sphere(
    mu: ArrayLike,
    exact: ArrayLike | None = None,
    inertia: ArrayLike | None = None,
    *,
    end: ArrayLike | None = None,
    radius: float | None = None,
    ax: Axes | None = None,
    view: tuple[float, float] = VIEW,
    title: str | None = None,
    label: str | None = None,
    color: str = COLORS[0],
    marker: str = "o",
    levels: int = 7,
) -> Axes:
    """Draw body momenta on their coadjoint orbit, the sphere |mu| = const.

    mu : (n, 3), numerical momenta, drawn as dots; more than 4000 are thinned evenly.
    exact : (m, 3), a densely sampled exact curve, drawn as a thin line above the dots. One period is enough: many laps
        drawn over each other look bold.
    inertia : three principal moments, or a symmetric 3x3 matrix: adds curves of constant energy and the separatrix.
    end : (3,), the exact momentum at the time of the last dot. Both are marked, which shows the phase error that a
        curve on the sphere hides.
    radius : of the sphere; that of the first momentum if not given. A momentum that left the sphere shows as such.
    ax : plane axes to draw on; a new figure (`ax.figure`) is made if not given.
    view : (azimuth, elevation) of the eye in degrees.
    label : name of the dots in a legend (`ax.legend()`), which is left to the caller.
    levels : number of energies drawn besides the separatrix's.

    What lies behind the sphere is faded and cut exactly at the horizon. All units of momentum are welcome.
    Returns the axes. Raises InvalidInput for momenta of the wrong shape, not finite, or zero, and MissingExtra without
    Matplotlib.
    """
    _require_matplotlib()
    from matplotlib.patches import Circle

    points = _momenta(mu, "mu")
    size = hypot(*points[0]) if radius is None else float(radius)
    if not (0.0 < size < np.inf):
        raise InvalidInput(f"the sphere needs a positive finite radius; got {size!r} (is the first momentum zero?)")
    if ax is None:
        ax = _new_figure(3.4, 3.6 if title else 3.4).add_axes((0.0, 0.0, 1.0, 0.94 if title else 1.0))
    frame = view_frame(*view)

    ax.imshow(_shade(), extent=(-1, 1, -1, 1), interpolation="bilinear", zorder=0).set_clip_path(
        Circle((0, 0), 1.0, transform=ax.transData)
    )
    ax.add_patch(Circle((0, 0), 1.0, fill=False, edgecolor="#8b93a1", linewidth=0.8, zorder=0.95))

    if inertia is not None:
        for curve in energy_levels(inertia, levels):
            _line(ax, curve @ frame.T, back=0.35, zorder=1.0, **LEVEL)
        for curve in separatrix(inertia):
            _line(ax, curve @ frame.T, back=0.35, zorder=1.1, **SEPARATRIX)
    _dots(ax, points / size @ frame.T, color, marker, label)
    if exact is not None:
        _line(ax, _momenta(exact, "exact") / size @ frame.T, back=0.35, zorder=3.0, **EXACT)
    if end is not None:
        _mark(ax, points[-1] / size @ frame.T, **(LAST | {"color": color, "marker": marker}))
        _mark(ax, _momenta(end, "end")[-1] / size @ frame.T, **RING)
    _body_axes(ax, frame)

    width, bottom, top = _limits(frame)
    ax.set(xlim=(-width, width), ylim=(bottom, top), aspect="equal")  # after the image, which sets its own
    ax.set_axis_off()
    if title:
        ax.set_title(title, fontsize=11, color=INK, pad=4)
    return ax


def figure_one(
    panels: Sequence[Panel | tuple[Any, ...]],
    exact: ArrayLike | None = None,
    inertia: ArrayLike | None = None,
    *,
    radius: float | None = None,
    view: tuple[float, float] = VIEW,
    levels: int = 7,
) -> Figure:
    """Draw several methods side by side, each on its own momentum sphere, with one legend for all.

    panels : `Panel`s, or tuples (title, mu, caption, end) of which the last two may be left out.
    exact, inertia, radius, view, levels : as in `momentum_sphere`, shared by all panels.

    Returns the figure; `save` writes it.
    """
    _require_matplotlib()
    every = [Panel(*panel) for panel in panels]
    if not every:
        raise InvalidInput("figure_one needs at least one panel")
    rows = -(-len(every) // 4)
    columns = -(-len(every) // rows)
    entries = _legend_entries(len(every), exact, any(panel.end is not None for panel in every), inertia)

    half, bottom, top = _limits(view_frame(*view))
    wide, tall = 2 * 1.15 * half + 0.15, 1.15 * (top - bottom)  # inches, 1.15 of them for a radius
    lines = max(1 + panel.caption.count("\n") if panel.caption else 0 for panel in every)
    per_line = max(1, min(len(entries), int(columns * wide / 1.45)))
    head, foot, legend = 0.32, 0.18 + 0.15 * lines, 0.12 + 0.19 * -(-len(entries) // per_line)
    width, height = columns * wide, rows * (head + tall + foot) + legend
    figure = _new_figure(width, height)
    for k, (title, mu, caption, end) in enumerate(every):
        row, column = divmod(k, columns)
        low = height - (row + 1) * (head + tall + foot) + foot
        ax = figure.add_axes((column / columns, low / height, 1 / columns, tall / height))
        color = COLORS[k % len(COLORS)]
        momentum_sphere(
            mu, exact, inertia, end=end, radius=radius, ax=ax, view=view, title=title, color=color, levels=levels
        )
        ax.text(0.5, -0.03, caption, transform=ax.transAxes, ha="center", va="top", fontsize=8.5, color=GREY)
    _legend(figure, entries, per_line)
    return figure


def save(figure: Figure, path: str | PathLike[str], dpi: int = 200) -> None:
    """Write a figure to PNG, SVG or PDF, by the ending of `path`; the same figure gives the same bytes."""
    from matplotlib import rc_context

    undated: dict[str, dict[str, Any]] = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
    with rc_context({"svg.hashsalt": "liemech"}):
        figure.savefig(path, dpi=dpi, facecolor="white", metadata=undated.get(Path(path).suffix.lower()))


# ---------------------------------------------------------------------------------------------------------- pieces


def _require_matplotlib() -> None:
    try:
        import matplotlib.figure  # noqa: F401
    except ImportError as missing:
        raise MissingExtra("pictures need Matplotlib", extra="plot") from missing


def _new_figure(width: float, height: float) -> Figure:
    """A figure that no window system knows of, so that none stays open."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def _momenta(values: ArrayLike, name: str) -> NDArray[np.float64]:
    points = np.atleast_2d(np.asarray(values, dtype=float))
    if points.ndim != 2 or points.shape[1] != 3 or not len(points):
        raise InvalidInput(f"{name} must have shape (n, 3); got {np.shape(values)}")
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if len(bad):
        raise InvalidInput(f"{name} must be finite; row {bad[0]} is {points[bad[0]].tolist()}")
    return points


def _shade(pixels: int = 220) -> NDArray[np.float64]:
    """The lit unit disc, (pixels, pixels, 3): softened cosine law, light from the upper left."""
    x, y = np.meshgrid(np.linspace(-1, 1, pixels), np.linspace(1, -1, pixels))
    z = np.sqrt(np.clip(1.0 - x**2 - y**2, 0.0, None))
    light = (0.5 + 0.5 * (-0.40 * x + 0.55 * y + 0.73 * z))[..., None] ** 1.6
    dark, bright = np.array([0.745, 0.775, 0.825]), np.array([0.985, 0.988, 0.994])
    image: NDArray[np.float64] = dark + light * (bright - dark)
    return image


def _line(ax: Axes, curve: NDArray[np.float64], back: float, zorder: float, **style: Any) -> None:
    """One curve: its front as it is, its back below everything in front and faded to the opacity `back`."""
    front, behind = split_at_horizon(curve)
    ax.plot(behind[:, 0], behind[:, 1], alpha=back, zorder=0.5 + 0.1 * zorder, **style)
    ax.plot(front[:, 0], front[:, 1], zorder=zorder, solid_capstyle="round", **style)


def _dots(ax: Axes, points: NDArray[np.float64], color: str, marker: str, label: str | None) -> None:
    from matplotlib.colors import to_rgb

    if len(points) > MOST_DOTS:
        points = points[np.linspace(0, len(points) - 1, MOST_DOTS).astype(int)]
    size = float(np.clip(46.0 / np.sqrt(len(points)), 2.0, 4.2))
    pale = tuple(0.35 * channel + 0.65 * 0.87 for channel in to_rgb(color))  # opaque: many layers stay as pale as one
    ahead = points[:, 2] >= 0.0
    style: dict[str, Any] = {"linestyle": "none", "marker": marker, "markersize": size}
    edge: dict[str, Any] = {"markeredgecolor": "white", "markeredgewidth": 0.3}
    ax.plot(*points[~ahead, :2].T, color=pale, markeredgewidth=0.0, zorder=0.75, **style)
    ax.plot(*points[ahead, :2].T, color=color, label=label, zorder=2.0, **edge, **style)


def _mark(ax: Axes, point: NDArray[np.float64], **style: Any) -> None:
    behind = point[2] < 0.0
    ax.plot(*point[:2, None], alpha=0.35 if behind else 1.0, zorder=0.94 if behind else 3.5, **style)


def _body_axes(ax: Axes, frame: NDArray[np.float64]) -> None:
    """Arrows along the body axes, from the sphere outwards; of one that points away, only what the sphere leaves."""
    from matplotlib.patheffects import withStroke

    for k, axis in enumerate(frame.T):
        reach = float(np.hypot(axis[0], axis[1]))
        start = 1.0 if axis[2] >= 0.0 else 1.0 / max(reach, 1e-9)
        if start >= ARROW or reach < 1e-9:  # hidden by the sphere, or pointing straight at the eye
            continue
        arrow = {"arrowstyle": "-|>", "color": INK, "linewidth": 0.9, "shrinkA": 0, "shrinkB": 0}
        ax.annotate("", xy=tuple(ARROW * axis[:2]), xytext=tuple(start * axis[:2]), arrowprops=arrow, zorder=5)
        x, y = ARROW * axis[:2] + NAME * axis[:2] / reach
        name = ax.text(x, y, f"$\\pi_{k + 1}$", ha="center", va="center", fontsize=11, color=INK, zorder=5)
        name.set_path_effects([withStroke(linewidth=2.2, foreground="#ffffffd0")])


def _legend_entries(
    methods: int, exact: ArrayLike | None, ends: bool, inertia: ArrayLike | None
) -> list[tuple[Line2D | tuple[Line2D, ...], str]]:
    from matplotlib.lines import Line2D

    def sample(style: dict[str, Any], **changes: Any) -> Line2D:
        return Line2D([], [], **(style | changes))

    entries: list[tuple[Line2D | tuple[Line2D, ...], str]] = []
    entries.append((tuple(sample(LAST, color=color, markersize=5.0) for color in COLORS[:methods]), "numerical"))
    if exact is not None:
        entries.append((sample(EXACT), "exact"))
    if ends:
        entries.append(((sample(LAST, color=GREY), sample(RING)), "last step: numerical, exact"))
    if inertia is not None and len(separatrix(inertia)):
        entries += [(sample(SEPARATRIX), "separatrix"), (sample(LEVEL), "constant energy")]
    return entries


def _legend(figure: Figure, entries: list[tuple[Line2D | tuple[Line2D, ...], str]], columns: int) -> None:
    from matplotlib.legend_handler import HandlerTuple

    side_by_side = {tuple: HandlerTuple(ndivide=None, pad=0.4)}
    look: dict[str, Any] = {"frameon": False, "fontsize": 8.5, "labelcolor": INK, "handler_map": side_by_side}
    samples, names = zip(*entries, strict=True)
    figure.legend(samples, names, loc="lower center", ncols=columns, **look)


def _limits(frame: NDArray[np.float64]) -> tuple[float, float, float]:
    """Half width, bottom and top of the picture in radii: the sphere, the arrows and their names, centred."""
    tips = ARROW * frame[:2] + NAME * frame[:2] / np.maximum(np.hypot(*frame[:2]), 1e-9)
    room = 0.09  # for the name itself
    x, y = np.abs(tips[0]).max() + room, tips[1]
    return max(1.05, x), min(-1.05, y.min() - room), max(1.05, y.max() + room)
