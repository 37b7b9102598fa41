"""The vorticity of ideal flow on the sphere, as the colours of a sphere."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

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
    """The absolute vorticity of ideal flow on the sphere: blue where it is negative, vermilion where
    it is positive.  The values it takes are Casimirs, so the colours keep their meaning.

    Of long films the points are fewer, and harmonics that these cannot show are left out.
    Source: Zeitlin, Phys. Rev. Lett. 93 (2004) 264501.
    """

    panel = "field"
    title = "vorticity"

    def needs(self, system: System) -> tuple[str, ...]:
        """The momentum, which is the vorticity as a matrix."""
        if not isinstance(system, ZeitlinSphere):
            raise refuse(self, system, "a vorticity on the sphere, of a ZeitlinSphere,")
        return ("mu",)

    def own(self, system: System) -> bool:
        """Whether each run has its own panel: yes, each flow has its sphere."""
        return True

    def legend(self, motion: Motion) -> list[dict[str, Any]]:
        """The scale of colours, from the most negative vorticity to the most positive."""
        most = f"{_most(motion):.2g}/s"
        return [{"name": "vorticity", "colors": FIELD, "ends": [f"\u2212{most}", f"+{most}"]}]

    def draw(self, motion: Motion, drawing: Drawing) -> None:
        """Draw a single sphere, whose points change their colours."""
        rows = max(8, min(ROWS, int(np.sqrt(0.5 * MOST_NUMBERS / len(motion))) - 1))
        latitude = np.linspace(0.5 * np.pi, -0.5 * np.pi, rows + 1)
        longitude = np.linspace(-np.pi, np.pi, 2 * rows + 1)
        values = _sphere(motion).vorticity(motion["mu"], latitude, longitude, rows)
        tones = np.clip(values / _most(motion), -1.0, 1.0)
        upright = [np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]
        shape = colored_ball(rows, FIELD)
        drawing.add("field", shape, quaternion=upright, tones=tones.reshape(len(tones), -1))


def _sphere(motion: Motion) -> ZeitlinSphere:
    assert isinstance(motion.system, ZeitlinSphere)
    return motion.system


def _most(motion: Motion) -> float:
    """The largest value, the same at all times."""
    return float(np.abs(_sphere(motion).levels(motion["mu"][0])).max()) or 1.0
