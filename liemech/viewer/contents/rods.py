"""An elastic rod as a tube through its frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...formulas.arrays import Array
from ...models.many.cosserat_rod import CosseratRod
from ...systems.system import System
from ..drawing import Drawing, neighbours
from ..motion import Motion
from ..shapes import ball, mixed
from .body import STONE
from .content import Content, refuse

PIECES = 120
"""A tube has at least so many straight pieces, where that is more than one for each element."""
THIN = 0.006
"""The least radius of a tube, in lengths of the rod: thinner rods are drawn that thick."""
LONG = 2000
"""Rods of more frames are drawn without the line that shows the twist."""


@dataclass(frozen=True)
class Rod(Content):
    """An elastic rod as a tube: between two frames the piece of a helix with the strain of the element.
    The dark line is where e1 of the frames points, which shows the twist; a dark ball marks an end
    that is held, and a trail follows the last one if it is free.

    The tube is as thick as a round rod that is as stiff, 2 sqrt(EI/EA), unless it would be a thread.

    Source: Simo, Comput. Methods Appl. Mech. Eng. 49 (1985), 55.
    """

    panel = "rod"
    to_scale = True

    def needs(self, system: System) -> tuple[str, ...]:
        """The parts of the state drawn, the frames; InvalidInput for other systems."""
        if not isinstance(system, CosseratRod):
            raise refuse(self, system, "an elastic rod, a CosseratRod,")
        return ("g",)

    def reach(self, motion: Motion) -> Array:
        """The places of the frames, with room for the tube, (points, 3)."""
        places, (_, room) = motion["g"][..., :3, 3].reshape(-1, 3), _rod(motion)
        return np.concatenate([places - room, places + room])

    def note(self, motion: Motion) -> str:
        """Threads would not be seen."""
        rod, radius = _rod(motion)
        return "the thickness of the rod is not to scale" if rod.section.radius < radius else ""

    def draw(self, motion: Motion, drawing: Drawing) -> None:
        """The tube, its line, the ends that are held, and the trail of the last one."""
        (system, radius), panel = _rod(motion), drawing.panel
        radius /= panel.unit
        g = system.between(motion["g"], -(-PIECES // system.elements))
        where, color = panel.inside(g[..., :3, 3]), mixed(STONE, drawing.color, 0.6)
        drawing.sticks("tube", neighbours(where), 2.0 * radius, color, 16)
        if motion["g"].shape[1] <= LONG:
            line, dark = where + radius * g[..., :3, 0], mixed(color, "#000000", 0.6)
            drawing.sticks("line", neighbours(line), 0.5 * radius, dark)
        for end, kind in zip((0, -1), () if system.closed else system.ends):
            if kind != "free":
                mark = ball(1.5 * radius, "#333333")
                drawing.add(f"end {end}", mark, position=where[:, end])
            elif end:
                drawing.trail("trail", where[:, end])


def _rod(motion: Motion) -> tuple[CosseratRod, float]:
    """The rod, and the radius with which it is drawn."""
    rod = motion.system
    assert isinstance(rod, CosseratRod)
    return rod, max(rod.section.radius, THIN * rod.length)
