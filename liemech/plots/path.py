"""Paths: of planets and pendulums in their plane, of bodies in space."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import InvalidInput
from ..formulas.arrays import Array
from ..joints.given_motion import MovedJoint
from ..joints.linkage import Linkage
from ..models.planets.kepler import Kepler
from ..models.planets.n_body import NBody
from ..models.poses import flies, place, places, rods
from ..models.space.space_bodies import OrbitingBody
from ..models.space.spacecraft import Spacecraft
from ..models.swinging.constrained_pendulums import ChainPendulum, FourBarLinkage
from ..models.swinging.pendulums import Pendulum
from ..systems.canonical import CanonicalSystem
from .spheres.cloud import colors
from .spheres.projection import VIEW, view_frame
from .style import COLORS, GREY, INK, Axes, needs_run, part, plane_axes, thinned, time_unit


def path(run: Any, *, ax: Axes | None = None, title: str | None = None, view: tuple[float, float] = VIEW) -> Axes:
    """Draw the path that a motion takes: of a planet, of the last bob of a pendulum, of a body in
    space.

    run : of a canonical system with positions in a plane or in space, of several bodies all of
    them, or one that recorded the poses of a body that flies, or those of the bodies of a linkage;
    of an ensemble every member, coloured from dark to light by the energy at the start, or by
    number.
    view : azimuth and elevation of the eye, in degrees, for paths in space, whose shadow on the
    ground is grey.

    A ring is the start, a dot the end. Returns the axes. Raises InvalidInput where there is no path
    to draw.
    """
    needs_run(run, "plots.path")
    points, joints = _points(run)
    flat = points.shape[-1] == 2
    unit = " (m)" if time_unit(run.system) == "s" else ""
    words = (f"$x${unit}", f"$y${unit}") if flat else ("", "")
    ax = plane_axes(ax, title, *words, (4.4, 4.0))
    ax.set_aspect("equal", adjustable="datalim")
    frame = np.eye(2) if flat else view_frame(*view)[:2]
    if not flat:
        ground = points.copy()
        ground[..., 2] = points[..., 2].min()
        ax.set(xticks=[], yticks=[])
        ax.margins(0.15)
        ax.grid(False)
        for side in ax.spines.values():
            side.set_visible(False)
        for k in range(points.shape[1]):
            ax.plot(*(ground[thinned(len(ground)), k] @ frame.T).T, color="#c9ced6", linewidth=0.8, zorder=0.8)
        _triad(ax, frame)
    palette: Any = (
        [COLORS[k % len(COLORS)] for k in range(points.shape[1])] if run.bodies is None else colors(_order(run))
    )
    for k, color in enumerate(palette):
        curve = points[:, k] @ frame.T
        ax.plot(*curve[thinned(len(curve))].T, color=color, linewidth=1.0)
        if run.bodies is None:
            ax.plot(*curve[0], marker="o", markersize=7.0, color="none", markeredgecolor=INK)
        if points.shape[1] == 1:
            for word, point in (("start", curve[0]), ("end", curve[-1])):
                beside: dict[str, Any] = {"xytext": (6, 5), "textcoords": "offset points", "fontsize": 8.0}
                ax.annotate(word, point, color=GREY, zorder=5, **beside)
        ax.plot(
            *curve[-1], marker="o", markersize=5.0, color=color, markeredgecolor="white", markeredgewidth=0.5, zorder=4
        )
    if isinstance(run.system, (Kepler, OrbitingBody, Spacecraft)):
        ax.plot(0.0, 0.0, marker="o", markersize=9.0, color="#C87F00", markeredgecolor="white", zorder=3)
    if not flat:
        _scale(ax, points, unit.strip(" ()"))
    for ends in joints:
        ax.plot(*(ends @ frame.T).T, color=GREY, linewidth=1.4, zorder=3, marker="o", markersize=4.0)
    return ax


def has_path(run: Any) -> bool:
    """Whether there is a path to draw."""
    if isinstance(run.system, CanonicalSystem):
        drawable = Pendulum if run.bodies is not None else (Pendulum, ChainPendulum, FourBarLinkage, NBody)
        return 1 < run.system.degrees <= 3 or isinstance(run.system, drawable)
    if isinstance(run.system, Linkage):
        return run.states.get("g") is not None and run.bodies is None
    return run.states.get("g") is not None and flies(run.system)


def _points(run: Any) -> tuple[Array, list[Array]]:
    """The places of all members, (n, bodies, 2 or 3); of a single pendulum or linkage also the ends
    of its rods at last, or the joints with the arms that lead to them.
    """
    if not has_path(run):
        raise InvalidInput(
            "plots.path is for positions in a plane or in space, and for bodies with recorded "
            f"poses g; got a run of {run.system!r}"
        )
    if isinstance(run.system, CanonicalSystem):
        points = places(run.system, part(run, "q", "plots.path"), part(run, "p", "plots.path"))
        if isinstance(run.system, NBody):
            return points, []
        pivots, pairs = rods(run.system) if run.bodies is None else (np.zeros((0, 3)), [])
        joints = [np.concatenate([points[-1], pivots])[list(pair)] for pair in pairs]
        last = points[..., -1, :]
        return (last[:, None] if run.bodies is None else last), joints
    g = part(run, "g", "plots.path")
    if isinstance(run.system, Linkage):
        poses, ends = with_ground(run.system, g), ends_of_joints(run.system)
        at = placed(poses[-1:], ends)[0]
        arms = [np.stack([poses[-1, k, :3, 3], end]) for (k, _), end in zip(ends, at) if k != GROUND]
        return poses[:, :-1, :3, 3], [*arms, *at.reshape(-1, 2, 3)]  # and the rods between two ends
    axes = g.shape[: 1 if run.bodies is None else 2]
    positions = place(run.system, g.reshape(-1, *g.shape[len(axes) :]))
    return positions.reshape(len(g), -1, 3), []


GROUND = -1
"""The number of the ground, which is the last body of a linkage."""


def with_ground(system: Linkage, g: Array) -> Array:
    """The poses of the bodies of a linkage and of the ground, (n, bodies + 1, 4, 4)."""
    poses = system.poses(g)
    return np.concatenate([poses, np.tile(np.eye(4), (len(poses), 1, 1, 1))], axis=1)


def ends_of_joints(system: Linkage) -> list[tuple[int, Array]]:
    """The ends of the joints, two of each: the number of a body, GROUND for none, and the point in its
    axes.  What holds a joint in a given motion is where the first body is.
    """
    return [
        (GROUND if body is None else body, np.array(at, dtype=float))
        for joint in system.joints
        for body, at in (
            (joint.first, joint.at_first),
            (joint.first, joint.at_first) if isinstance(joint, MovedJoint) else (joint.second, joint.at_second),
        )
    ]


def placed(poses: Array, points: list[tuple[int, Array]]) -> Array:
    """Points of bodies in space, (n, k, 3)."""
    g = poses[:, [body for body, _ in points]]
    at = np.array([point for _, point in points])[..., None]
    return (g[..., :3, :3] @ at)[..., 0] + g[..., :3, 3]


def _order(run: Any) -> Array:
    """The energies at the start, by which members are coloured; numbers where there are none."""
    try:
        return np.asarray(run.energy[0], dtype=float)
    except InvalidInput:
        return np.arange(run.bodies, dtype=float)


def _scale(ax: Axes, points: Array, unit: str) -> None:
    """A bar that says how long things are, of a round length, in the corner."""
    whole = float(np.ptp(points.reshape(-1, 3), axis=0).max()) or 1.0
    decade = 10.0 ** np.floor(np.log10(0.3 * whole))
    length = decade * max(n for n in (1.0, 2.0, 5.0) if n * decade <= 0.3 * whole)
    x, low = ax.get_xlim()[1], ax.get_ylim()[0]
    ends = [x - length, x], [low, low]
    ax.plot(*ends, color=INK, linewidth=1.6, solid_capstyle="butt", zorder=5)
    ax.annotate(
        f"{length:g} {unit}".strip(),
        (x - 0.5 * length, low),
        (0, 4),
        textcoords="offset points",
        ha="center",
        fontsize=8.5,
        color=INK,
    )


def _triad(ax: Axes, frame: Array) -> None:
    """Three short arrows, x, y, z, in the corner."""
    for name, tip in zip("xyz", frame.T):
        end = 0.09 + 0.08 * tip
        arrow = {"arrowstyle": "-|>", "color": INK, "linewidth": 0.8, "shrinkA": 0, "shrinkB": 0}
        ax.annotate("", end, (0.09, 0.09), xycoords="axes fraction", textcoords="axes fraction", arrowprops=arrow)
        x, y = 0.09 + 0.11 * tip
        ax.text(x, y, f"${name}$", transform=ax.transAxes, ha="center", va="center", fontsize=9, color=INK)
