"""Vectors that move on a sphere: body momentum on its coadjoint orbit, the vertical seen from a
top, momentum in space.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import InvalidInput
from ...formulas.arrays import Array
from ...models.bodies.heavy_top import ReducedHeavyTop
from ...models.bodies.rigid_body import RigidBody
from ...models.poses import attitude, configurations, is_pose, rotated, turns
from ...plots import COLORS, energy_levels, separatrix
from ...plots.spheres.contours import contours
from ...systems.lie_poisson import LiePoissonSystem
from ...systems.system import System
from ..drawing import SHARED, Drawing, neighbours
from ..motion import Motion
from ..shapes import arrow, ball, mixed, rod, segments
from ..thinning import evenly
from .content import UNITS, Content, refuse

AXES = COLORS[1:4]
"""Of the body, one to three: red, green, plum, told from each other and from the blue of the first
run by every kind of colour vision.
"""
SPHERE, LEVEL, SEPARATRIX, SOLID = "#c3cddc", "#7b8493", "#3d4550", 0.7
"""Colours of a sphere and its curves, and how much of what lies behind the sphere it hides."""
OTHER = "#D98E00"
"""The colour of the highest energy of an ensemble; that of the lowest is the run's."""
LIFT = 1.003
"""Curves lie this much above their sphere, which would swallow half of them."""
MOST_POINTS = 1000
"""Bodies of an ensemble that are drawn; of larger ones as many, evenly chosen."""


@dataclass(frozen=True)
class Momentum(Content):
    """Body momentum mu on its coadjoint orbit, seen from the body: arrow, growing trail, sphere,
    curves of constant energy.

    trail : the curve behind the arrow.  sphere : the orbit, |mu| = const.  levels : how many
    energies are drawn on it beside that of the separatrix; 0 for none, and no separatrix.  Of an
    ensemble every momentum is a small ball, coloured by the order of the energies.
    The motion follows a curve of constant energy.  No sphere is drawn where there is not one orbit:
    for a body in a field, and for an ensemble whose momenta differ in length.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 15.7.
    """

    panel = "momentum"
    main = True
    alike = True
    title = "momentum, seen from the body"
    of_space = False

    trail: bool = True
    sphere: bool = True
    levels: int = 7

    def __post_init__(self) -> None:
        if self.levels < 0:
            raise InvalidInput(f"Momentum: levels must be 0 or more; got {self.levels}")

    def needs(self, system: System) -> tuple[str, ...]:
        return _turning(self, system)

    def reach(self, motion: Motion) -> Array:
        return (np.linalg.norm(motion["mu"], axis=-1).max() or 1.0) * UNITS

    def legend(self, motion: Motion) -> list[dict[str, Any]]:
        """The curves on the sphere, and of an ensemble the energies."""
        lines = {"constant energy": LEVEL}
        if isinstance(motion.system, RigidBody):
            lines["separatrix"] = SEPARATRIX
        drawn = self.sphere and self.levels and _one_orbit(motion)
        entries: list[dict[str, Any]] = [
            {"name": name, "color": color, "line": True} for name, color in lines.items() if drawn
        ]
        if motion.bodies is not None:
            entries.append({"name": "energy", "colors": (COLORS[0], OTHER), "ends": ["low", "high"]})
        return entries

    def courses(self, motion: Motion) -> dict[str, Array]:
        """The energy and the length of the momentum, of a free body both constant."""
        if motion.bodies is not None or not isinstance(motion.system, LiePoissonSystem):
            return {}
        energy: Any = motion.system.energy(motion["mu"])
        return {"energy": energy, "|\u03bc|": np.linalg.norm(motion["mu"], axis=1)}

    def draw(self, motion: Motion, drawing: Drawing) -> None:
        """The arrow or the balls, the trail, and once for all runs the orbit."""
        mu = drawing.panel.inside(motion["mu"])
        if motion.bodies is None:
            _moving_vector(drawing, mu, "mu", self.trail)
        else:
            _cloud(drawing, mu, motion)
        if not self.sphere:
            return
        triad(drawing.shared, "axis", "\u03bc", 0.007, 1.22)
        if _one_orbit(motion):
            radius = float(np.linalg.norm(mu[0], axis=-1).max())
            drawing.once(f"sphere {radius:.3f}", ball(radius, SPHERE, SOLID))
            if self.levels and f"{drawing.panel.path}/{SHARED}/levels" not in drawing.panel.nodes:
                _levels(drawing, motion.system, radius, self.levels)


@dataclass(frozen=True)
class SpatialMomentum(Content):
    """Momentum seen from space, K_g mu, in the same picture as the body: of a free body it stands
    still.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 15.2.
    """

    def needs(self, system: System) -> tuple[str, ...]:
        return *_turning(self, system), "g"

    def own(self, system: System) -> bool:
        """Whether each run has its own panel: yes, the arrow stands where the body is."""
        return True

    def draw(self, motion: Motion, drawing: Drawing) -> None:
        """An arrow as long as the picture allows."""
        momentum = rotated(attitude(motion.system, motion["g"]), motion["mu"])
        largest = np.linalg.norm(momentum, axis=1).max()
        _moving_vector(
            drawing, 1.15 * momentum / ((largest or 1.0) * drawing.panel.unit), "spatial momentum", trail=False
        )


@dataclass(frozen=True)
class Vertical(Content):
    """The vertical seen from a top, Gamma = g^T e3, on its sphere: arrow and growing trail.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 1.4.
    """

    panel = "vertical"
    title = "vertical, seen from the body"
    of_space = False

    def needs(self, system: System) -> tuple[str, ...]:
        """The attitude; of a top on se(3)* the momentum, of which Gamma is a part."""
        if isinstance(system, ReducedHeavyTop):
            return ("mu",)
        if not is_pose(configurations(system)):
            raise refuse(self, system, "the vertical seen from a body")
        return ("g",)

    def draw(self, motion: Motion, drawing: Drawing) -> None:
        """The arrow, the trail, and once for all runs the unit sphere."""
        if isinstance(motion.system, ReducedHeavyTop):
            gamma = motion["mu"][:, 3:]
        else:
            back = attitude(motion.system, motion["g"]) * [-1.0, -1.0, -1.0, 1.0]
            gamma = rotated(back, np.array([0.0, 0.0, 1.0]))
        _moving_vector(drawing, gamma, "vertical", trail=True, least=0.0)
        drawing.once("sphere", ball(1.0, SPHERE, SOLID))
        triad(drawing.shared, "axis", "\u0393", 0.007, 1.22)


# ------------------------------------------------------------------ pieces


def _turning(content: Content, system: System) -> tuple[str, ...]:
    """The momentum, of a system that has one in space."""
    if "mu" not in system.coordinates or not turns(configurations(system)):
        raise refuse(content, system, "an angular momentum, which moves on a sphere")
    return ("mu",)


def axis_of(top: Any) -> Array:
    """The direction from the fixed point to the centre of mass; the third axis if that is the fixed point."""
    centre = np.array(top.centre)
    length = np.linalg.norm(centre)
    return centre / length if length > 0.0 else np.array([0.0, 0.0, 1.0])


def _moving_vector(drawing: Drawing, v: Array, name: str, trail: bool, least: float = 0.7) -> None:
    """An arrow to (n, 3), and the trail of its tip."""
    length = np.linalg.norm(v, axis=1)
    if length.max() <= 0.0:  # a body at rest has no arrow
        return
    unit = np.divide(v, length[:, None], out=np.tile([0.0, 0.0, 1.0], (len(v), 1)), where=length[:, None] > 0.0)
    origin = drawing.panel.inside(np.zeros(3))
    drawing.add(name, arrow(drawing.color), direction=unit, scale=length, position=origin)
    if trail:  # with its tip, for the arrow is inside
        drawing.add(f"{name} tip", ball(0.035, drawing.color), position=LIFT * v)
        drawing.trail(f"{name} trail", LIFT * v, least=least)


def _cloud(drawing: Drawing, v: Array, motion: Motion) -> None:
    """A small ball for each body of an ensemble, (n, m, 3), coloured in the order of their energies at the start."""
    shown = evenly(v.shape[1], MOST_POINTS)
    if isinstance(motion.system, LiePoissonSystem):
        energy: Any = motion.system.energy(motion["mu"][0, shown])
        shown = shown[np.argsort(energy, kind="stable")]
    colors = [mixed(drawing.color, OTHER, share) for share in np.linspace(0.0, 1.0, len(shown))]
    drawing.balls("mu", LIFT * v[:, shown], [[0.04]], colors)


def triad(pen: Drawing, path: str, symbol: str, radius: float, length: float) -> None:
    """The axes of the body with their names, if they have any."""
    for k, color in enumerate(AXES):
        name = symbol and symbol + "\u2081\u2082\u2083"[k]
        stick = rod(color, radius)
        pen.add(f"{path} {k + 1}", stick, name, direction=np.eye(3)[k], scale=length)


def _one_orbit(motion: Motion) -> bool:
    """Whether there is one sphere on which all momenta stay."""
    radii = np.linalg.norm(motion["mu"][0], axis=-1)
    one_radius = np.ptp(radii) <= 0.01 * radii.max() and radii.max() > 0.0
    return bool(one_radius) and isinstance(motion.system, LiePoissonSystem)


def _levels(drawing: Drawing, system: Any, radius: float, count: int) -> None:
    """Curves of constant energy and, of a rigid body, the separatrix."""
    circles: Any = []
    if isinstance(system, RigidBody):
        inertia = np.array(system.inertia)
        curves = radius * neighbours(energy_levels(inertia, count, samples=181)).reshape(-1, 2, 3)
        circles = radius * separatrix(inertia, samples=121)
    else:
        curves = contours(lambda mu: system.energy(mu * drawing.panel.unit), radius, count + 2)
    if len(curves):  # of a spherical body every direction is a fixed point
        drawing.once("levels", segments(LIFT * curves, LEVEL))
        for k, circle in enumerate(circles, start=1):
            drawing.shared.curve(f"separatrix {k}", LIFT * circle, SEPARATRIX, 0.01)
