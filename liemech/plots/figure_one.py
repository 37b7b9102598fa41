"""The article's Fig. 1: several methods side by side, each on its own momentum sphere."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from numpy.typing import ArrayLike

from ..errors import InvalidInput
from .spheres.energy_curves import separatrix
from .spheres.globe import EXACT, LAST, LEVEL, RING, SEPARATRIX, limits
from .spheres.projection import VIEW, view_frame
from .spheres.sphere import momentum_sphere
from .style import COLORS, GREY, INK, Figure, new_figure, require_matplotlib

if TYPE_CHECKING:
    from matplotlib.lines import Line2D


class Panel(NamedTuple):
    """One sphere of `figure_one`: a title, the momenta (n, 3) of one method, a line of text below,
    and optionally the exact momentum (3,) at the last of them.
    """

    title: str
    mu: ArrayLike
    caption: str = ""
    end: ArrayLike | None = None


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
    require_matplotlib()
    every = [Panel(*panel) for panel in panels]
    if not every:
        raise InvalidInput("figure_one needs at least one panel")
    rows = -(-len(every) // 4)
    columns = -(-len(every) // rows)
    entries = _legend_entries(len(every), exact, any(panel.end is not None for panel in every), inertia)

    half, bottom, top = limits(view_frame(*view))
    wide, tall = 2 * 1.15 * half + 0.15, 1.15 * (top - bottom)  # inches, 1.15 of them for a radius
    lines = max(1 + panel.caption.count("\n") if panel.caption else 0 for panel in every)
    per_line = max(1, min(len(entries), int(columns * wide / 1.45)))
    head, foot, legend = 0.32, 0.18 + 0.15 * lines, 0.12 + 0.19 * -(-len(entries) // per_line)
    width, height = columns * wide, rows * (head + tall + foot) + legend
    figure = new_figure(width, height)
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
