"""Spins on a lattice: at one time of a square one or a layer of a cubic one, over time of a ring or a chain."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InvalidInput
from ..formulas import real_array
from ..formulas.arrays import Array
from ..models.many.sites import base_of, by_site, fixed_places, is_spin, lattice_of
from .style import DIRECTIONS, GREY, Axes, needs_run, part, plane_axes, thinned, time_label

MOST_ARROWS = 48
"""Along an axis; of larger lattices the colours alone are drawn."""
MOST_ROWS = 600
"""Samples of a ring or a chain that are drawn."""


def spins(
    run: Any,
    sample: int = -1,
    *,
    axis: ArrayLike = (0.0, 0.0, 1.0),
    layer: int | None = None,
    ax: Axes | None = None,
    title: str | None = None,
) -> Axes:
    """Draw the directions of the spins of a lattice, seen from above: arrows as far as they lie in
    the plane, coloured by how far they point along an axis; of a ring or a chain the colours of all
    sites over time.

    run : of a system of many spins on a square lattice, a cubic one, a ring or a chain.  sample : which one, from 0,
    or from -1 backwards.  axis : orange points along it, blue against it.  layer : of a cubic
    lattice, z; left out, the one in the middle.

    Site (i, j) of a square lattice is at x = j, y = i, site (i, j, k) of a cubic one at x = k, y = j,
    z = i.  Of more than 48 sites along an axis the colours are drawn without arrows.  Returns the axes.
    """
    needs_run(run, "plots.spins")
    lattice = lattice_of(run.system)
    if not is_spin(base_of(run.system)) or lattice is None:
        raise InvalidInput(
            "plots.spins draws spins on a square or a cubic lattice, a ring or a chain, which "
            f"{run.system!r} has not; `run.view()` shows spins everywhere"
        )
    if run.bodies is not None:
        raise InvalidInput("plots.spins draws one member of an ensemble; run it by itself")
    along = real_array(axis, "plots.spins: axis")
    if along.shape != (3,) or not 0.0 < np.linalg.norm(along) < np.inf:
        raise InvalidInput(f"plots.spins: axis is a direction in space; got {axis!r}")
    rows = part(run, "mu", "plots.spins")
    if not -len(rows) <= sample < len(rows):
        raise InvalidInput(f"plots.spins: the run has {len(rows)} samples; got sample = {sample!r}")
    along = along / np.linalg.norm(along)
    if len(lattice.shape) == 1:
        return _over_time(run, by_site(run.system, "mu", rows), along, ax, title)
    mu = by_site(run.system, "mu", rows[sample])
    places = fixed_places(run.system)
    if len(lattice.shape) == 3:
        layer = lattice.shape[0] // 2 if layer is None else layer
        in_layer = places[:, 2] == layer
        if not in_layer.any():
            raise InvalidInput(f"plots.spins: layers are 0 to {lattice.shape[0] - 1}; got {layer!r}")
        places, mu = places[in_layer], mu[in_layer]
    elif layer is not None:
        raise InvalidInput(f"plots.spins: {lattice!r} has no layers; leave layer out")
    return _drawn(run, sample, places, mu, along, layer, ax, title)


def has_spins(run: Any) -> bool:
    """Whether this is a run of one system of spins that `spins` draws."""
    placed = lattice_of(run.system) is not None
    return placed and is_spin(base_of(run.system)) and "mu" in run.states and run.bodies is None


def _over_time(run: Any, mu: Array, axis: Array, ax: Axes | None, title: str | None) -> Axes:
    """The sites along x, the time upwards."""
    shown = thinned(len(mu), MOST_ROWS)
    ax = plane_axes(ax, title, "site", time_label(run), (5.2, 3.6))
    ax.grid(False)
    scale, norm = _colors()
    sites = np.arange(mu.shape[1])
    ax.pcolormesh(
        sites, run.t[shown], _unit(mu[shown]) @ axis, cmap=scale, norm=norm, shading="nearest", rasterized=True
    )
    _bar(ax, axis)
    return ax


def _unit(mu: Array) -> Array:
    """The directions of spins, zero where there is none."""
    size = np.linalg.norm(mu, axis=-1, keepdims=True)
    return np.asarray(mu / np.where(size > 0.0, size, 1.0))


def _colors() -> tuple[Any, Any]:
    """The colours of directions, and the numbers that they stand for."""
    from matplotlib.colors import LinearSegmentedColormap, Normalize

    return LinearSegmentedColormap.from_list("directions", DIRECTIONS), Normalize(-1.0, 1.0)


def _bar(ax: Axes, axis: Array) -> None:
    """The scale of colours beside the picture."""
    from matplotlib.cm import ScalarMappable

    scale, norm = _colors()
    axis_names = {(1.0, 0.0, 0.0): "$x$", (0.0, 1.0, 0.0): "$y$", (0.0, 0.0, 1.0): "$z$"}
    name = axis_names.get(tuple(axis.tolist()), "the axis")
    bar: Any = ax.figure.colorbar(ScalarMappable(norm, scale), ax=ax, shrink=0.7, ticks=[-1, 0, 1])
    bar.ax.tick_params(labelsize=8.5, color=GREY, labelcolor=GREY)
    bar.set_label(f"direction along {name}", fontsize=9, color=GREY)
    bar.outline.set_visible(False)


def _drawn(
    run: Any, sample: int, places: Array, mu: Array, axis: Array, layer: int | None, ax: Axes | None, title: str | None
) -> Axes:
    size, unit = np.linalg.norm(mu, axis=1), _unit(mu)
    scale, norm = _colors()
    at = f"$t$ = {run.t[sample]:.4g}" + ("" if layer is None else f", $z$ = {layer}")
    ax = plane_axes(ax, title or at, "$x$", "$y$", (5.2, 4.4))
    ax.grid(False)
    ax.set_aspect("equal")
    columns, rows = (int(n) + 1 for n in places[-1, :2])
    colors, edge = unit @ axis, (-0.5, columns - 0.5, -0.5, rows - 0.5)
    if max(columns, rows) <= MOST_ARROWS:
        ax.quiver(
            *places[:, :2].T,
            *(mu[:, :2] / (size.max() or 1.0)).T,
            colors,
            cmap=scale,
            norm=norm,
            pivot="mid",
            angles="xy",
            scale_units="xy",
            scale=1.0 / 0.9,
            width=0.13 / columns,
            headwidth=3.6,
            headlength=4.0,
            headaxislength=3.7,
            minlength=0.6,
        )
        ax.set_xlim(edge[:2])
        ax.set_ylim(edge[2:])
    else:
        ax.imshow(
            colors.reshape(rows, columns), cmap=scale, norm=norm, origin="lower", extent=edge, interpolation="nearest"
        )
    _bar(ax, axis)
    return ax
