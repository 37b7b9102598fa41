"""How all pictures look: colours, axes, figures that no window system knows of, and how they are
written.

Matplotlib is imported inside the functions that draw. Nothing here touches its global settings or
opens a window.
"""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InvalidInput, InvalidType, MissingExtra
from ..formulas.arrays import Array
from ..models.many.sites import base_of, is_spin

if TYPE_CHECKING:
    from matplotlib.axes import Axes as Axes
    from matplotlib.figure import Figure as Figure
else:
    Axes = Figure = Any

COLORS = ("#0072B2", "#D55E00", "#009E73", "#7B1E5B", "#5C4A12", "#5A3FE0")
"""Blue, vermilion, green, plum, umber, indigo: the first three are Okabe and Ito's; all are told
apart by every kind of colour vision, and are dark enough for lines on white (3:1).
"""
MARKERS = ("o", "s", "^", "D", "v", "P")
DASHES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (1, 1)))
"""Markers and dashes repeat what the colours say, for pictures printed in grey."""
DIRECTIONS = ("#1E90D8", "#2B2F36", "#E06A10")
"""Of directions, from against an axis over across it to along it: blue, ink, orange, each told from
white and from the others by every kind of colour vision.
"""
SCALE = "cividis"
"""Matplotlib's scale of colours for numbers: read alike by every kind of colour vision."""
INK, GREY, GRID = "#1a1a1a", "#5f6672", "#e4e7ec"
MOST_DOTS = 4000
"""More points than this on a curve are thinned evenly: nobody could tell them apart."""


def require_matplotlib() -> None:
    """Raise MissingExtra, which says what to install, unless Matplotlib is there."""
    try:
        import matplotlib.figure  # noqa: F401
    except ImportError as missing:
        raise MissingExtra("pictures need Matplotlib", extra="plot") from missing


def new_figure(width: float, height: float, layout: Any = None) -> Figure:
    """A figure that no window system knows of, so that none stays open.  width, height : in inches."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), facecolor="white", layout=layout)
    FigureCanvasAgg(figure)
    return figure


def plane_axes(ax: Axes | None, title: str | None, x: str, y: str, size: tuple[float, float] = (5.2, 3.4)) -> Axes:
    """Axes with a light grid and names: the given ones, or those of a new figure of this size in inches."""
    require_matplotlib()
    if ax is None:
        ax = new_figure(*size, layout="constrained").add_subplot()
    ax.set_xlabel(x)
    ax.set_ylabel(y)
    if title:
        ax.set_title(title, pad=6)
    return dressed(ax)


def dressed(ax: Axes) -> Axes:
    """Axes as all pictures have them: no box, a light grid, sizes and colours of words and curves."""
    for words, size in ((ax.xaxis.label, 9.5), (ax.yaxis.label, 9.5), (ax.title, 11.0)):
        words.set(color=INK, fontsize=size)
    ax.tick_params(labelsize=8.5, color=GREY, labelcolor=GREY)
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        ax.spines[side].set_color("#8b93a1")
    ax.grid(color=GRID, linewidth=0.7)
    ax.set_axisbelow(True)
    ax.set_prop_cycle(color=COLORS)
    return ax


def subplots(
    rows: int = 1, columns: int = 1, *, figsize: tuple[float, float] = (5.2, 3.4), **more: Any
) -> tuple[Figure, Any]:
    """A figure and its axes, in the style of all pictures here: for pictures of your own.

    rows, columns, figsize, more : as for `matplotlib.pyplot.subplots`, such as sharex=True.
    Returns the figure, which no window system knows of (`plots.save` writes it), and the axes, or
    an array of them.
    """
    require_matplotlib()
    figure = new_figure(*figsize, layout="constrained")
    axes = figure.subplots(rows, columns, **more)
    for ax in np.atleast_1d(axes).flat:
        dressed(ax)
    return figure, axes


MOST_ENTRIES = 10
"""Curves that a legend tells apart; of more each has its name at its end."""


def legend(ax: Axes, **where: Any) -> None:
    """A legend without a frame, if anything has a name; of more than ten curves the names stand at
    their ends.

    where : as for `Axes.legend`, such as loc="upper left".
    """
    handles, names = ax.get_legend_handles_labels()
    if len(names) > MOST_ENTRIES and all(hasattr(handle, "get_xydata") for handle in handles):
        _named_at_ends(ax, handles, names)
    elif names:
        ax.legend(**{"frameon": False, "fontsize": 8.5, "labelcolor": INK} | where)


def _named_at_ends(ax: Axes, curves: Any, names: list[str]) -> None:
    """Names right of the picture, in the order in which their curves end, each joined to its end."""
    ends = []
    ax.autoscale_view()  # which Matplotlib puts off until the picture is drawn
    for curve in curves:
        points = ax.transLimits.transform(ax.transScale.transform(curve.get_xydata()))
        visible = points[np.isfinite(points).all(axis=1)]
        ends.append(visible[visible[:, 0].argmax()] if len(visible) else np.zeros(2))
    order = np.argsort([y for _, y in ends])
    gap = 1.0 / len(names)
    heights = np.array([ends[k][1] for k in order])
    for k in range(1, len(heights)):  # up, then all down by what sticks out
        heights[k] = max(heights[k], heights[k - 1] + gap)
    heights = np.minimum(heights, 1.0 - gap * np.arange(len(heights) - 1, -1, -1))
    for k, y in zip(order, heights, strict=True):
        color = curves[k].get_color()
        ax.annotate(
            names[k],
            ends[k],
            (1.03, y),
            xycoords="axes fraction",
            textcoords="axes fraction",
            fontsize=8.0,
            color=color,
            va="center",
            arrowprops={"arrowstyle": "-", "color": color, "linewidth": 0.5, "alpha": 0.6},
            annotation_clip=False,
        )


def look(k: int) -> dict[str, Any]:
    """Colour and dashes of the k-th curve of a picture; of 36 curves no two have both in common."""
    return {"color": color(k), "linestyle": DASHES[(k + k // 6) % 6], "linewidth": 1.3}


def marked(k: int) -> dict[str, Any]:
    """Colour and marker of the k-th series of a picture; of 36 no two have both in common."""
    return {"color": color(k), "marker": MARKERS[(k + k // 6) % 6], "markersize": 4.5}


def color(k: int) -> str:
    """The colour of the k-th curve of a picture."""
    return COLORS[k % len(COLORS)]


def time_label(run: Any) -> str:
    """The name of an axis of time, with its unit."""
    unit = time_unit(run.system)
    return f"time $t$ ({unit})" if unit else "time $t$"


def named_runs(runs: Any, where: str) -> dict[str, Any]:
    """Runs by the names they have in a legend: a mapping as it is, a single run without a name."""
    by_name = dict(runs) if isinstance(runs, Mapping) else {"": runs}
    if not by_name:
        raise InvalidInput(f"{where} needs at least one run")
    for run in by_name.values():
        needs_run(run, where)
    return by_name


def needs_run(run: Any, where: str) -> None:
    """Raise unless this is a run with samples."""
    if not all(hasattr(run, name) for name in ("system", "t", "states", "bodies")):
        raise InvalidType(f"{where} shows what `integrate` returns; got {run!r}")
    if not len(run.t):
        raise InvalidInput(f"{where} needs at least one sample; this run has none")


def part(run: Any, name: str, where: str) -> Array:
    """A recorded part of the state, (n, ...)."""
    rows = run.states.get(name)
    if rows is None:
        raise InvalidInput(
            f"{where} needs {name}, which this run did not record; it has {', '.join(run.states)}. "
            f"Start from a state with {name}, and record it"
        )
    return np.asarray(rows)


def thinned(n: int, most: int = MOST_DOTS) -> Any:
    """Which of n samples are drawn: all, or `most`, evenly chosen, the first and the last among them."""
    return slice(None) if n <= most else np.unique(np.linspace(0, n - 1, most).round().astype(int))


def time_unit(system: Any) -> str:
    """The unit of the time of a system, "s" or that of its terms, or "" where there is none, as of spins."""
    if is_spin(base_of(system)):
        return ""
    parts = getattr(getattr(system, "potential", None), "parts", ())
    of_terms = [part.term.time_unit for part in parts if getattr(part, "term", None) and part.term.time_unit]
    return of_terms[0] if of_terms else system.time_unit


def save(figure: Figure, path: str | PathLike[str], dpi: int = 200) -> None:
    """Write a figure to PNG, SVG, PDF or PGF, by the ending of `path`; the same figure gives the same
    bytes.

    PGF is for `\\input` in LaTeX, with the fonts of the document: it needs no LaTeX to be written,
    and of the document `\\usepackage{pgf}`.  Texts of labels are escaped, mathematics stays.
    """
    from matplotlib import rc_context

    if Path(path).suffix.lower() == ".pgf":
        from .pgf import write_pgf

        write_pgf(figure, Path(path))
        return

    undated: dict[str, dict[str, Any]] = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
    with rc_context({"svg.hashsalt": "liemech"}):
        figure.savefig(path, dpi=dpi, facecolor="white", metadata=undated.get(Path(path).suffix.lower()))
