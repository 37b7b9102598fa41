"""Points of canonical systems: planets, pendulums, a point in the plane of position and momentum."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import InvalidInput
from ...formulas import check_finite, real_array
from ...formulas.arrays import Array
from ...models.planets.kepler import Kepler
from ...models.planets.n_body import NBody
from ...models.poses import places, rods
from ...models.swinging.constrained_pendulums import ChainPendulum, FourBarLinkage
from ...plots import COLORS
from ...systems.canonical import CanonicalSystem
from ...systems.system import System
from ..drawing import Drawing
from ..motion import Motion
from ..shapes import ball, mixed
from .content import Content, refuse

SUN = "#C87F00"
MOST_RODS, FEW = 96, 12
"""Of more points no rods are drawn, and of more members no trails."""


@dataclass(frozen=True)
class Points(Content):
    """Where the points of a canonical system are, with trails.

    places : a function of q (n, degrees) and p (n, degrees) that gives the points in the plane of
    the picture, (n, m, 2), or in space, (n, m, 3), third axis upwards.  Left out: pendulums hang,
    two or three degrees of freedom are a point, one is a point in the plane of q and p.
    rods : are the points joined, the first to the origin, each to the next?  Left out: those of
    pendulums and linkages are.
    The last point has a trail, of bodies that attract each other each.
    Of an ensemble every member is shown, coloured by the order of their energies.
    """

    panel = "points"
    title = "position"
    to_scale = True

    places: Callable[[Array, Array], Array] | None = None
    rods: bool | None = None

    def needs(self, system: System) -> tuple[str, ...]:
        """Position; of one degree of freedom that does not hang, momentum too."""
        if not isinstance(system, CanonicalSystem):
            raise refuse(self, system, "positions q")
        if (
            self.places is None
            and system.degrees > 3
            and not isinstance(system, (ChainPendulum, NBody, FourBarLinkage))
        ):
            raise InvalidInput(
                f"Points: {system!r} has {system.degrees} degrees of freedom; say where the points "
                "are, Points(places=lambda q, p: ...), as (n, m, 2) or (n, m, 3)"
            )
        return "q", "p"

    def reach(self, motion: Motion) -> Array:
        """The points at all times, the origin, and the pivots of a linkage."""
        points = self._points(motion)
        pivots = self._joined(motion.system, points.shape[2])[0]
        return np.concatenate([points.reshape(-1, 3), np.zeros((1, 3)), pivots])

    def _joined(self, system: System, count: int) -> tuple[Array, list[tuple[int, int]]]:
        """The pivots, in space, and which points rods join: numbers of pivots follow those of points."""
        if self.rods is not None:
            row = [(k - 1 if k else count, k) for k in range(count)]
            return np.zeros((1, 3)), row if self.rods else []
        pivots, pairs = rods(system) if self.places is None else (np.zeros((0, 3)), [])
        return _upright(pivots), pairs

    def note(self, motion: Motion) -> str:
        """Balls are to be seen."""
        drawn = self.places is None and isinstance(motion.system, (Kepler, NBody))
        return "places to scale, sizes not" if drawn else ""

    def draw(self, motion: Motion, drawing: Drawing) -> None:
        """Balls, rods, the trails of the last points, and marks in the pivots."""
        inside, system = drawing.panel.inside, motion.system
        points = inside(self._points(motion))
        n, members, count = points.shape[:3]
        colors = self._colors(motion, drawing, members, count)
        sizes = np.full(count, 0.1 if members * count <= MOST_RODS else 0.05)
        if isinstance(system, NBody) and self.places is None:
            masses = np.array(system.masses)
            sizes = np.maximum(0.14 * np.cbrt(masses / masses.max()), 0.04)
        dark = [mixed(color, "#000000", 0.15) for color in colors]
        every = np.tile(sizes, members)[:, None]
        drawing.balls("points", points.reshape(n, -1, 3), every, dark)
        pivots, pairs = self._joined(system, count)
        fixed = inside(pivots)
        if pairs and members * count <= MOST_RODS:
            held = np.broadcast_to(fixed, (n, members, *fixed.shape))
            ends = np.concatenate([points, held], axis=2)[:, :, pairs]
            pale = [mixed(colors[m * count], "#ffffff", 0.3) for m in range(members) for _ in pairs]
            drawing.sticks("rods", ends.reshape(n, -1, 2, 3), 0.024, pale)
        for m in range(members if members <= FEW else 0):
            for k in range(count if isinstance(system, NBody) else min(count, 1)):
                path = f"trail {m + 1}.{k + 1}"
                drawing.trail(path, points[:, m, -1 - k], colors[(m + 1) * count - 1 - k])
        if isinstance(system, Kepler):
            drawing.once("sun", ball(0.07, SUN), position=inside(np.zeros(3)))
        elif self.places is None:
            for k, pivot in enumerate(fixed, start=1):
                drawing.once(f"pivot {k}", ball(0.03, "#333333"), position=pivot)

    def _colors(self, motion: Motion, drawing: Drawing, members: int, count: int) -> list[str]:
        """The colours of all points: many bodies have colours of their own, with a sun among them, members the order of
        their energies.
        """
        if members > 1:
            energy: Any = motion.system.constants({n: x[0] for n, x in motion.states.items()})
            rank = np.argsort(np.argsort(energy["energy"], kind="stable")) / (members - 1)
            return [mixed(*COLORS[:2], share) for share in rank.tolist() for _ in range(count)]
        if not isinstance(motion.system, NBody) or self.places is not None:
            return [drawing.color] * count
        colors, masses = [COLORS[k % len(COLORS)] for k in range(count)], motion.system.masses
        if max(masses) > 20.0 * sorted(masses)[-2]:
            colors[int(np.argmax(masses))] = SUN
        return colors

    def _points(self, motion: Motion) -> Array:
        """The points in space, (n, members, m, 3); those of a plane stand upright in it."""
        q, p = motion["q"], motion["p"]
        if motion.bodies is None:
            q, p = q[:, None], p[:, None]
        if self.places is None:
            return _upright(places(motion.system, q, p))
        rows = [_checked(self.places(q[:, k], p[:, k]), len(q)) for k in range(q.shape[1])]
        return _upright(np.stack(rows, axis=1))


def _upright(points: Array) -> Array:
    """Points in space; those of a plane stand upright in it."""
    return points if points.shape[-1] == 3 else np.insert(points, 1, 0.0, axis=-1)


def _checked(points: Any, n: int) -> Array:
    """The values of a user's function, checked."""
    array = real_array(points, "Points: places")
    check_finite(array, "Points: places")
    if array.ndim != 3 or array.shape[0] != n or array.shape[2] not in (2, 3):
        raise InvalidInput(f"Points: places gave shape {array.shape}; wanted are ({n}, m, 2) or ({n}, m, 3)")
    return array
