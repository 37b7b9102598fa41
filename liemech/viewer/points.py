"""Points of canonical systems: planets, pendulums, a point in the plane of position and momentum."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..errors import InvalidInput
from ..models.constrained_pendulums import ChainPendulum, FourBarLinkage
from ..models.kepler import Kepler
from ..models.n_body import NBody
from ..models.poses import places, rods
from ..systems.canonical import CanonicalSystem
from ..systems.system import System
from .content import FRONT, Content, refuse
from .drawing import Drawing
from .motion import Motion
from .shapes import ball, mixed, rod

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Points(Content):
    """Where the points of a canonical system are, with trails.

    places : a function of q (n, degrees) and p (n, degrees) that gives the points in the plane of
    the picture, (n, m, 2), or in space, (n, m, 3), third axis upwards.  Left out: pendulums hang,
    two or three degrees of freedom are a point, one is a point in the plane of q and p.
    rods : are the points joined, the first to the origin, each to the next?  Left out: those of
    pendulums and linkages are.
    trail : the curve behind the last point.
    """

    panel: ClassVar[str] = "points"
    title: ClassVar[str] = "position"

    places: Callable[[Array, Array], Array] | None = None
    rods: bool | None = None
    trail: bool = True

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
        pivots = _upright(rods(motion.system)[0]) if self.places is None else np.zeros((0, 3))
        return np.concatenate([self._points(motion).reshape(-1, 3), np.zeros((1, 3)), pivots])

    def eye(self, motion: Motion) -> tuple[float, float]:
        """From the front."""
        return FRONT

    def draw(self, motion: Motion, drawing: Drawing) -> None:
        """Balls, rods, the trail of the last point, and marks in the pivots."""
        points, dark = (
            drawing.panel.inside(self._points(motion)),
            mixed(drawing.color, "#000000", 0.25),
        )
        system, count = motion.system, points.shape[1]
        pivots, pairs = rods(system) if self.places is None else (np.zeros((0, 3)), [])
        if self.rods is not None:
            pivots, pairs = (
                np.zeros((1, 3)),
                [(k - 1 if k else count, k) for k in range(count)] if self.rods else [],
            )
        fixed = drawing.panel.inside(_upright(pivots))
        ends = np.concatenate([points, np.broadcast_to(fixed, (len(points), *fixed.shape))], axis=1)
        for k in range(count):
            drawing.add(f"point {k + 1}", ball(0.05, dark), position=points[:, k])
        for k, (a, b) in enumerate(pairs, start=1):
            start, way = ends[:, a], ends[:, b] - ends[:, a]
            length = np.linalg.norm(way, axis=1)
            direction = np.where(length[:, None] > 0.0, way, np.array([0.0, 0.0, 1.0]))
            stick = rod(mixed(drawing.color, "#ffffff", 0.4))
            drawing.add(f"rod {k}", stick, position=start, direction=direction, scale=length)
        if self.trail and count:
            drawing.trail("trail", points[:, -1])
        if isinstance(system, Kepler):
            drawing.once("sun", ball(0.07, "#E69F00"), position=drawing.panel.inside(np.zeros(3)))
        elif self.places is None:
            for k, pivot in enumerate(fixed):
                drawing.once(
                    "pivot" if len(fixed) == 1 else f"pivot {k + 1}",
                    ball(0.03, "#333333"),
                    position=pivot,
                )

    def _points(self, motion: Motion) -> Array:
        """The points in space, (n, m, 3); those of a plane stand upright in it."""
        if motion.bodies is not None:
            raise InvalidInput(
                "Points shows one member; choose one of the ensemble, as in Scene(run, body=0)"
            )
        q, p = motion["q"], motion["p"]
        points = (
            _given(self.places(q, p), len(q))
            if self.places is not None
            else places(motion.system, q, p)
        )
        return _upright(points)


def _upright(points: Array) -> Array:
    """Points in space; those of a plane stand upright in it."""
    return points if points.shape[-1] == 3 else np.insert(points, 1, 0.0, axis=-1)


def _given(points: Any, n: int) -> Array:
    """The values of a user's function, checked."""
    array = np.asarray(points, dtype=float)
    if array.ndim != 3 or array.shape[0] != n or array.shape[2] not in (2, 3):
        raise InvalidInput(
            f"Points: places gave shape {array.shape}; wanted are ({n}, m, 2) or ({n}, m, 3)"
        )
    if not np.isfinite(array).all():
        raise InvalidInput("Points: places gave numbers that are not finite")
    return array
