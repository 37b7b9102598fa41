"""An ensemble of bodies: their momenta at one time, as dots on the sphere of directions."""

from __future__ import annotations

from math import hypot
from typing import Any

import numpy as np

from ...errors import InvalidInput
from ...formulas.arrays import Array
from ...models.poses import configurations, turns
from ..style import SCALE, Axes, needs_run, part
from .globe import directions, dots, globe
from .projection import VIEW
from .sphere import MU, draw_energies


def cloud(
    run: Any,
    sample: int = -1,
    *,
    ax: Axes | None = None,
    view: tuple[float, float] = VIEW,
    title: str | None = None,
    levels: int = 7,
) -> Axes:
    """Draw the momenta of an ensemble at one sample, each divided by its length, coloured by the
    order of their energies.

    run : of an ensemble of bodies that rotate.  sample : which one, the last if not given.
    levels : number of curves of constant energy, for momenta as long as the first.

    Returns the axes. Raises InvalidInput for single bodies, and for bodies whose momentum does not
    move on a sphere.
    """
    needs_run(run, "plots.cloud")
    if run.bodies is None or "mu" not in run.states or not turns(configurations(run.system)):
        raise InvalidInput(f"plots.cloud is for ensembles of rotating bodies; this run is of {run.system!r}")
    mu = part(run, "mu", "plots.cloud")[sample]
    ax, frame = globe(ax, view, title, MU)
    draw_energies(ax, frame, run.system, hypot(*mu[0]), levels)
    dots(ax, directions(mu) @ frame.T, colors(run.energy[sample]), "o", None)
    return ax


def colors(values: Array) -> Array:
    """Colours by the order of numbers, (n, 4)."""
    from matplotlib import colormaps

    rank = np.argsort(np.argsort(values, kind="stable"), kind="stable")
    return colormaps[SCALE](rank / max(1, len(rank) - 1))
