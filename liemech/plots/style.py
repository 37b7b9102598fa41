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
from numpy.typing import NDArray

from ..errors import InvalidInput, InvalidType, MissingExtra

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
"""Okabe and Ito's palette, told apart by every kind of colour vision: blue, vermilion, green,
purple, orange, sky.
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


def plane_axes(
    ax: Axes | None, title: str | None, x: str, y: str, size: tuple[float, float] = (5.2, 3.4)
) -> Axes:
    """Axes with a light grid and names: the given ones, or those of a new figure of this size in
    inches.
    """
    require_matplotlib()
    if ax is None:
        ax = new_figure(*size, layout="constrained").add_subplot()
    ax.set_xlabel(x, color=INK, fontsize=9.5)
    ax.set_ylabel(y, color=INK, fontsize=9.5)
    if title:
        ax.set_title(title, fontsize=11, color=INK, pad=6)
    ax.tick_params(labelsize=8.5, color=GREY, labelcolor=GREY)
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        ax.spines[side].set_color("#8b93a1")
    ax.grid(color=GRID, linewidth=0.7)
    ax.set_axisbelow(True)
    return ax


def legend(ax: Axes, **where: Any) -> None:
    """A legend without a frame, if anything has a name."""
    if ax.get_legend_handles_labels()[1]:
        ax.legend(frameon=False, fontsize=8.5, labelcolor=INK, **where)


def look(k: int) -> dict[str, Any]:
    """Colour and dashes of the k-th curve of a picture."""
    return {
        "color": COLORS[k % len(COLORS)],
        "linestyle": DASHES[k % len(DASHES)],
        "linewidth": 1.3,
    }


def named_runs(runs: Any, where: str) -> dict[str, Any]:
    """Runs by the names they have in a legend: a mapping as it is, a single run without a name."""
    found = dict(runs) if isinstance(runs, Mapping) else {"": runs}
    if not found:
        raise InvalidInput(f"{where} needs at least one run")
    for run in found.values():
        needs_run(run, where)
    return found


def needs_run(run: Any, where: str) -> None:
    """Raise unless this is a run with samples."""
    if not all(hasattr(run, name) for name in ("system", "t", "states", "bodies")):
        raise InvalidType(f"{where} shows what `integrate` returns; got {run!r}")
    if not len(run.t):
        raise InvalidInput(f"{where} needs at least one sample; this run has none")


def part(run: Any, name: str, where: str) -> NDArray[np.float64]:
    """A recorded part of the state, (n, ...)."""
    rows = run.states.get(name)
    if rows is None:
        raise InvalidInput(
            f"{where} needs {name}, which this run did not record; it has {', '.join(run.states)}. "
            f"Start from a state with {name}, and record it"
        )
    return np.asarray(rows)


def thinned(n: int, most: int = MOST_DOTS) -> Any:
    """Which of n samples are drawn: all, or `most`, evenly chosen, the first and the last among
    them.
    """
    return slice(None) if n <= most else np.unique(np.linspace(0, n - 1, most).round().astype(int))


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
        figure.savefig(
            path, dpi=dpi, facecolor="white", metadata=undated.get(Path(path).suffix.lower())
        )
