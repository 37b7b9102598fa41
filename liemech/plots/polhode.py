"""Poinsot's picture of a free rigid body: the polhode on the inertia ellipsoid, the herpolhode in
the invariable plane.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import InvalidInput
from ..formulas.arrays import Array
from ..models.bodies.rigid_body import RigidBody
from ..models.poses import attitude, rotated
from .components import one_body
from .spheres.energy_curves import energy_levels, separatrix
from .spheres.globe import LEVEL, LIMB, NAME, SEPARATRIX, bare, directions, halves, sphere_axes
from .spheres.projection import VIEW, split_at_horizon, view_frame
from .style import COLORS, GREY, INK, Axes, needs_run, part, plane_axes, require_matplotlib, thinned


def polhode(
    run: Any,
    *,
    body: int = 0,
    ax: Axes | None = None,
    view: tuple[float, float] = VIEW,
    title: str | None = None,
    color: str = COLORS[0],
    levels: int = 7,
) -> Axes:
    """Draw the angular velocity w in the body, on the ellipsoid w . J w = 2 H of the first sample,
    the polhode.

    run : of a RigidBody.  body : which one of an ensemble.  levels : how many other polhodes are
    drawn beside the separatrix.

    The ellipsoid is cut exactly where it hides its back. Where a method loses energy, the curve
    leaves the ellipsoid. Returns the axes. Raises InvalidInput for other systems and for a body at
    rest.

    Source: Goldstein, Classical Mechanics, 3rd ed., section 5.6 (Poinsot's construction).
    """
    require_matplotlib()
    from matplotlib.patches import Polygon

    w = _velocity(run, body, "plots.polhode")
    moments, axes = np.linalg.eigh(_inertia(run.system))
    twice = float(w[0] @ (_inertia(run.system) @ w[0]))
    if not twice > 0.0:
        raise InvalidInput("plots.polhode: the body is at rest; give it a momentum")
    # of the half axes, in rad/s; w = axes (size y) with |y| = 1 on the ellipsoid
    size = np.sqrt(twice / moments)
    unit = float(size.max())
    frame = view_frame(*view)
    facing = (frame[2] @ axes) / size  # the ellipsoid at y faces the eye where facing . y > 0
    _, _, basis = np.linalg.svd(facing[None])
    turn = np.array([basis[1], basis[2], facing / np.linalg.norm(facing)])

    drawn = ax or sphere_axes(title)

    def draw(y: Array, zorder: float, **style: Any) -> None:
        front, behind = split_at_horizon(y @ turn.T)
        halves(drawn, viewed(front @ turn), viewed(behind @ turn), 0.35, zorder, **style)

    def viewed(y: Array) -> Array:
        return (size * y) @ axes.T @ frame.T / unit

    s = np.linspace(0.0, 2.0 * np.pi, 361)[:, None]
    outline = viewed(np.cos(s) * turn[0] + np.sin(s) * turn[1])[:, :2]
    drawn.add_patch(Polygon(outline, closed=True, facecolor="#eceff4", edgecolor=LIMB, linewidth=0.8, zorder=0.1))
    inverse = 1.0 / moments
    for curve in energy_levels(inverse, levels):
        draw(curve, 1.0, **LEVEL)
    for curve in separatrix(inverse):
        draw(curve, 1.1, **SEPARATRIX)
    y = (w @ axes) / size
    draw(y[thinned(len(y))], 2.0, color=color, linewidth=1.6)
    for k, axis in enumerate(np.eye(3)):
        length = np.sqrt(twice / (axis @ _inertia(run.system) @ axis)) / unit
        tip = frame @ axis
        if facing @ (axis @ axes) >= 0.0:
            arrow = {"arrowstyle": "-|>", "color": INK, "linewidth": 0.9, "shrinkA": 0, "shrinkB": 0}
            drawn.annotate("", tuple((length + 0.2) * tip[:2]), tuple(length * tip[:2]), arrowprops=arrow, zorder=5)
            beyond = (length + 0.2) * tip[:2] + NAME * tip[:2] / max(float(np.hypot(*tip[:2])), 1e-9)
            drawn.text(
                float(beyond[0]),
                float(beyond[1]),
                f"$\\omega_{k + 1}$",
                ha="center",
                va="center",
                fontsize=11,
                color=INK,
            )
    reach = np.abs(outline).max(axis=0)
    drawn.set(xlim=(-reach[0] - 0.4, reach[0] + 0.4), ylim=(-reach[1] - 0.2, reach[1] + 0.4), aspect="equal")
    bare(drawn, title)
    return drawn


def herpolhode(
    run: Any, *, body: int = 0, ax: Axes | None = None, title: str | None = None, color: str = COLORS[0]
) -> Axes:
    """Draw the angular velocity in space, seen along the spatial momentum of the first sample: the
    herpolhode.

    run : of a RigidBody that recorded its attitude.  body : which one of an ensemble.

    The curve runs between two circles and need not close. Returns the axes. Raises InvalidInput for
    other systems, without an attitude, and for a body at rest.

    Source: Goldstein, Classical Mechanics, 3rd ed., section 5.6 (Poinsot's construction).
    """
    points, r = herpolhode_points(run, body), np.linspace(0.0, 2.0 * np.pi, 361)
    ax = plane_axes(ax, title, "$\\omega$ across the momentum (rad/s)", "", (3.6, 3.6))
    for radius in np.linalg.norm(points, axis=1).min(), np.linalg.norm(points, axis=1).max():
        ax.plot(radius * np.cos(r), radius * np.sin(r), color=GREY, linewidth=0.7, linestyle=":")
    samples = thinned(len(points))
    ax.plot(*points[samples].T, color=color, linewidth=0.9)
    ax.plot(0.0, 0.0, marker="+", color=INK, markersize=6.0)
    ax.set_aspect("equal", adjustable="datalim")
    return ax


def herpolhode_points(run: Any, body: int = 0) -> Array:
    """The angular velocity in space, without its part along the spatial momentum of the first sample, (n, 2)."""
    w = _velocity(run, body, "plots.herpolhode")
    g, mu = (part(run, name, "plots.herpolhode") for name in ("g", "mu"))
    if run.bodies is not None:
        g, mu = g[:, body], mu[:, body]
    q = attitude(run.system, g)
    momentum = rotated(q[:1], mu[:1])[0]
    if not momentum.any():
        raise InvalidInput("plots.herpolhode: the body is at rest; give it a momentum")
    axis = directions(momentum)
    _, _, basis = np.linalg.svd(axis[None])
    across = basis[1:] * np.sign(np.linalg.det(np.vstack([basis[1:], axis])))
    return rotated(q, w) @ across.T


def _velocity(run: Any, body: int, where: str) -> Array:
    needs_run(run, where)
    if not isinstance(run.system, RigidBody):
        raise InvalidInput(f"{where} is for a free RigidBody; this run is of {run.system!r}")
    mu = part(run, "mu", where)
    return np.asarray(run.system.velocity(mu if run.bodies is None else one_body(run, mu, body, where)))


def _inertia(system: Any) -> Array:
    J = np.array(system.inertia)
    return np.diag(J) if J.ndim == 1 else J
