"""The vorticity of ideal flow on the sphere, or a magnetic potential that a flow carries, as the colours of a sphere."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...models.lattices.magnetic_sphere import MagneticSphere
from ...models.lattices.zeitlin_sphere import ZeitlinSphere
from ...plots.field import FIELD
from ...systems.system import System
from ..drawing import Drawing
from ..motion import Motion
from ..shapes import colored_ball
from ..thinning import MOST_NUMBERS
from .content import Content, refuse

ROWS = 120
"""Of points on the sphere, from pole to pole, at most: one for 1.5 degrees."""


@dataclass(frozen=True)
class Field(Content):
    """The absolute vorticity of ideal flow on the sphere, of a MagneticSphere its potential, whose level lines are those of
    the field: blue where it is negative, vermilion where it is positive.  The values it takes are Casimirs, so the
    colours keep their meaning.

    Of long films the points are fewer, and harmonics that these cannot show are left out.
    Source: Zeitlin, Phys. Rev. Lett. 93 (2004) 264501; Modin and Roop, IMA J. Numer. Anal. (2025), draf024.
    """

    panel = "field"
    title = "on the sphere"

    def needs(self, system: System) -> tuple[str, ...]:
        """The momentum, which is the vorticity as a matrix, or that and the potential."""
        if not isinstance(system, ZeitlinSphere | MagneticSphere):
            raise refuse(
                self, system, "a vorticity on the sphere, of a ZeitlinSphere, or a potential, of a MagneticSphere,"
            )
        return ("mu",)

    def own(self, system: System) -> bool:
        """Whether each run has its own panel: yes, each flow has its sphere."""
        return True

    def legend(self, motion: Motion) -> list[dict[str, Any]]:
        """The scale of colours, from the most negative value to the most positive."""
        most = f"{_most(motion):.2g}"
        name, unit = ("vorticity", "/s") if isinstance(motion.system, ZeitlinSphere) else ("magnetic potential", "")
        return [{"name": name, "colors": FIELD, "ends": [f"\u2212{most}{unit}", f"+{most}{unit}"]}]

    def draw(self, motion: Motion, drawing: Drawing) -> None:
        """Draw a single sphere, whose points change their colours."""
        rows = max(8, min(ROWS, int(np.sqrt(0.5 * MOST_NUMBERS / len(motion))) - 1))
        latitude = np.linspace(0.5 * np.pi, -0.5 * np.pi, rows + 1)
        longitude = np.linspace(-np.pi, np.pi, 2 * rows + 1)
        sphere, mu = _function(motion)
        tones = np.clip(sphere.vorticity(mu, latitude, longitude, rows) / _most(motion), -1.0, 1.0)
        upright = [np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]
        shape = colored_ball(rows, FIELD)
        drawing.add("field", shape, quaternion=upright, tones=tones.reshape(len(tones), -1))


def _function(motion: Motion) -> tuple[ZeitlinSphere, np.ndarray]:
    """The sphere, and the function on it at all samples as momenta there."""
    system = motion.system
    if isinstance(system, MagneticSphere):
        return system.sphere, system.fields(motion["mu"])[1]
    assert isinstance(system, ZeitlinSphere)
    return system, motion["mu"]


def _most(motion: Motion) -> float:
    """The largest value, the same at all times."""
    sphere, mu = _function(motion)
    return float(np.abs(sphere.levels(mu[0])).max()) or 1.0
