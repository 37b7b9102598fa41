"""Contents of a scene: a class each, which says what of a motion it needs and draws it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ...errors import InvalidInput, InvalidType, NotDefined
from ...formulas.arrays import Array
from ...models.curves import across
from ...systems.system import System
from ..drawing import Drawing
from ..motion import Motion

UNITS = np.concatenate([np.eye(3), -np.eye(3)])
"""The reach of contents that say nothing else: the ball of radius 1 about the origin."""


@dataclass(frozen=True)
class Content:
    """Something to show of a motion; subclass it to show something of your own.

    1. A subclass names its `panel`, the picture it belongs to, and the panel's `title`, and writes
    `needs` and `draw`.
    2. It says in `reach` what the panel must hold, unless that is the ball of radius 1 about the
    origin.

    Contents of the same panel share a picture; if they are `alike`, those of equal systems do.
    With `own` each run has its own.  In a panel `of_space` directions are those of space, and if it is `to_scale` lengths
    are those of the motion.  A `main` one has most of the stage.
    """

    panel: ClassVar[str] = "space"
    title: ClassVar[str] = "in space"
    alike: ClassVar[bool] = False
    of_space: ClassVar[bool] = True
    to_scale: ClassVar[bool] = False
    main: ClassVar[bool] = False

    def needs(self, system: System) -> tuple[str, ...]:
        """The parts of the state that are drawn, such as ("mu",).  Raises InvalidInput if the
        system has nothing of the kind.
        """
        raise NotDefined(f"{type(self).__name__} must define `needs`")

    def own(self, system: System) -> bool:
        """Whether every run has a panel of its own."""
        return False

    def reach(self, motion: Motion) -> Array:
        """Points that the panel must hold, (k, 3), in the units of the motion."""
        return UNITS

    def eye(self, motion: Motion) -> tuple[float, float]:
        """The direction from which it is best seen, (azimuth, elevation) in degrees: across the
        plane in which most of it lies.
        """
        return across(self.reach(motion))

    def legend(self, motion: Motion) -> list[dict[str, Any]]:
        """The meaning of its colours: each a "name" and a "color", of a "line" or of a dot, or for a
        scale its "colors" and the texts at its "ends".
        """
        return []

    def note(self, motion: Motion) -> str:
        """A remark of the picture on itself, such as that it is not to scale."""
        return ""

    def courses(self, motion: Motion) -> dict[str, Array]:
        """Quantities that are drawn over time below the pictures, by name, (n,)."""
        return {}

    def draw(self, motion: Motion, drawing: Drawing) -> None:
        """Put nodes into a panel: `drawing.add`, `drawing.trail`, `drawing.once`."""
        raise NotDefined(f"{type(self).__name__} must define `draw`")


def refuse(content: Content, system: System, wanted: str) -> InvalidInput:
    """The error of a content that a system has not."""
    return InvalidInput(f"{type(content).__name__} shows {wanted}; {system!r} has none")


def require(contents: tuple[Content, ...], system: System, parts: frozenset[str]) -> None:
    """Raise InvalidInput unless these parts of the state are all that is needed."""
    for content in contents:
        missing = set(content.needs(system)) - parts
        if missing:
            raise InvalidInput(
                f"{type(content).__name__} needs {', '.join(sorted(missing))}, and there is only "
                f"{', '.join(sorted(parts))}; start from a state that has it, and record it"
            )


def chosen(show: Any, known: Mapping[str, type[Content]]) -> tuple[Content, ...]:
    """Contents from what a user writes: names such as "momentum", or contents such as Momentum(levels=0)."""
    items = (show,) if isinstance(show, (str, Content)) else tuple(show)
    contents = []
    for content in items:
        if isinstance(content, str):
            if content not in known:
                raise InvalidInput(f"show: {content!r} is not known; there are {', '.join(known)}")
            content = known[content]()
        if not isinstance(content, Content):
            raise InvalidType(f"show: names or contents such as Momentum(levels=0); got {content!r}")
        contents.append(content)
    if not contents:
        raise InvalidInput(f"show is empty; name something of {', '.join(known)}")
    return tuple(contents)
