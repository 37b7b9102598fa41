"""Maps of a field, a rod or a chain, over its line and over time."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InvalidInput
from ..formulas import check_finite, real_array
from .field import FIELD
from .spins import MOST_ROWS
from .style import Axes, needs_run, plane_axes, thinned, time_label


def space_time(
    run: Any, values: ArrayLike, *, ax: Axes | None = None, title: str | None = None, label: str = ""
) -> Axes:
    """Draw numbers of all nodes, sites or cells over line and time: blue where negative, vermilion where positive.

    run : of a field, a rod, or other sites in a row.  values : (samples, nodes) or (samples, cells), such as
    `run.system.strains(run.g)[..., 2]`.  label : what they are, for the scale.
    Returns the axes.  Raises InvalidInput for values of another shape, or that are not finite.
    """
    needs_run(run, "plots.space_time")
    numbers = real_array(values, "plots.space_time: values")
    check_finite(numbers, "plots.space_time: values")
    if numbers.ndim != 2 or len(numbers) != len(run.t):
        raise InvalidInput(f"plots.space_time: values are ({len(run.t)}, nodes); got shape {numbers.shape}")
    from matplotlib.colors import LinearSegmentedColormap

    arc, count = getattr(run.system, "arc", None), numbers.shape[1]
    places = np.arange(count) if arc is None else arc[:count] + 0.5 * arc[1] * (count < run.system.nodes)
    shown, most = thinned(len(numbers), MOST_ROWS), float(np.abs(numbers).max())
    ax = plane_axes(ax, title, "site" if arc is None else "$s$", time_label(run), (5.2, 3.6))
    ax.grid(False)
    scale: Any = {"cmap": LinearSegmentedColormap.from_list("field", FIELD), "vmin": -most, "vmax": most}
    colors = ax.pcolormesh(places, run.t[shown], numbers[shown], shading="nearest", rasterized=True, **scale)
    ax.figure.colorbar(colors, ax=ax, shrink=0.7, label=label)
    return ax
