"""Momentum on its coadjoint orbit: of SO(3) a sphere, on which the energy has curves of its own."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...errors import InvalidInput
from ...models.bodies.rigid_body import RigidBody
from ...systems.lie_poisson import LiePoissonSystem
from ..style import COLORS, Axes
from .contours import contours
from .energy_curves import energy_levels, separatrix
from .globe import EXACT, LAST, LEVEL, RING, SEPARATRIX, chords, dots, globe, line, mark, vectors
from .projection import VIEW

MU = ("$\\mu_1$", "$\\mu_2$", "$\\mu_3$")
GAMMA = ("$\\Gamma_1$", "$\\Gamma_2$", "$\\Gamma_3$")


def momentum_sphere(
    mu: ArrayLike,
    exact: ArrayLike | None = None,
    inertia: ArrayLike | None = None,
    *,
    system: Any = None,
    end: ArrayLike | None = None,
    radius: float | None = None,
    ax: Axes | None = None,
    view: tuple[float, float] = VIEW,
    title: str | None = None,
    label: str | None = None,
    color: Any = COLORS[0],
    marker: str = "o",
    levels: int = 7,
    names: Sequence[str] = MU,
) -> Axes:
    """Draw body momenta on their coadjoint orbit, the sphere |mu| = const.

    mu : (n, 3), numerical momenta, drawn as dots; more than 4000 are thinned evenly.
    exact : (m, 3), a densely sampled exact curve, drawn as a thin line above the dots. One period is enough:
    many laps drawn over each other look bold.
    inertia : three principal moments, or a symmetric 3x3 matrix: adds curves of constant energy and
    the separatrix.
    system : instead of an inertia, any free body on SO(3): adds the curves of constant energy of
    its Hamiltonian.
    end : (3,), the exact momentum at the time of the last dot. Both are marked, which shows the phase error
    that a curve on the sphere hides.
    radius : of the sphere; that of the first momentum if not given. A momentum that left the sphere
    shows as such.
    ax : plane axes to draw on; a new figure (`ax.figure`) is made if not given.
    view : (azimuth, elevation) of the eye in degrees.
    color : of the dots; or one for each, (n, 4).
    label : name of the dots in a legend (`ax.legend()`), which is left to the caller.
    levels : number of energies drawn besides the separatrix's.
    names : of the axes, of vectors that are no momenta.

    What lies behind the sphere is faded and cut exactly at the horizon. All units of momentum are
    welcome.
    Returns the axes. Raises InvalidInput for momenta of the wrong shape, not finite, or zero, and
    MissingExtra without Matplotlib.
    """
    points = vectors(mu, "mu")
    size = hypot(*points[0]) if radius is None else float(radius)
    if not (0.0 < size < np.inf):
        raise InvalidInput(f"the sphere needs a positive finite radius; got {size!r} (is the first momentum zero?)")
    ax, frame = globe(ax, view, title, names)
    if inertia is not None:
        _of_inertia(ax, frame, inertia, levels)
    draw_energies(ax, frame, system, size, levels)
    dots(ax, points / size @ frame.T, color, marker, label)
    if exact is not None:
        line(ax, vectors(exact, "exact") / size @ frame.T, back=0.35, zorder=3.0, **EXACT)
    if end is not None:
        mark(ax, points[-1] / size @ frame.T, **(LAST | {"color": color, "marker": marker}))
        mark(ax, vectors(end, "end")[-1] / size @ frame.T, **RING)
    return ax


def draw_energies(ax: Axes, frame: Any, system: Any, radius: float, levels: int) -> None:
    """The curves of constant energy of a free body: exact ones of a rigid body, otherwise those of its Hamiltonian."""
    if not levels or not isinstance(system, LiePoissonSystem) or not radius > 0.0:
        return
    if isinstance(system, RigidBody):
        _of_inertia(ax, frame, np.array(system.inertia), levels)
        return
    curves = contours(system.energy, radius, levels) / radius
    chords(ax, curves @ frame.T, back=0.35, zorder=1.0, **LEVEL)


def _of_inertia(ax: Axes, frame: Any, inertia: ArrayLike, levels: int) -> None:
    """The curves of constant energy of a rigid body, and the separatrix."""
    for curve in energy_levels(inertia, levels):
        line(ax, curve @ frame.T, back=0.35, zorder=1.0, **LEVEL)
    for curve in separatrix(inertia):
        line(ax, curve @ frame.T, back=0.35, zorder=1.1, **SEPARATRIX)
