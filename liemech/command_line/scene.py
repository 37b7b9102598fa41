"""A scene: what moves, by which method, how far, and what of it is wanted; and what follows from that."""

from __future__ import annotations

import dataclasses
from typing import Any

import liemech as lm

from ..plots.choice import shown_parts

SAMPLES = 100_000
"""Of longer runs not every state is kept."""
FRAMES = 600
"""Samples that a picture or a page needs."""


@dataclasses.dataclass(frozen=True)
class Setup:
    """A motion to follow, with fixed steps, or adaptively to `t_end`.

    title : one line.  system, method, start : as in `integrate`, as are h, steps, every, t_end,
    rtol, atol, t0.
    every : keep every k-th state; left out, as many as `SAMPLES`, of a scene that is only looked at
    about `FRAMES`.
    record : the parts of the state that are kept; left out, what is shown, and what the motion
    depends on.
    view : what a page shows, names of `lm.viewer`; left out, what suits the system.
    """

    title: str
    system: lm.System
    method: lm.Method
    start: lm.State
    h: float | None = None
    steps: int | None = None
    every: int | None = None
    t_end: float | None = None
    rtol: float | None = None
    atol: float | None = None
    t0: float = 0.0
    record: tuple[str, ...] | None = None
    view: tuple[str, ...] | None = None

    def changed(self, **changes: Any) -> Setup:
        """This scene with other options; those that are None do not change."""
        options = {name: value for name, value in changes.items() if value is not None}
        if self.t_end is not None and {"h", "steps"} & options.keys() and "t_end" not in options:
            options = {"t_end": None, "rtol": None, "atol": None} | options
        return dataclasses.replace(self, **options)

    def parts(self, *, saved: bool, viewed: bool, plotted: bool) -> tuple[str, ...]:
        """The parts of the state that are computed: what the motion depends on, and what is
        recorded, saved or shown.
        """
        available = [name for name, x in self.start.parts.items() if x is not None]
        recorded = {name for name, x in self.system.essential_part(self.start).parts.items() if x is not None}
        recorded |= set(self.record or (available if saved else ()))
        ensemble = self.start.bodies is not None
        if viewed:
            from ..viewer.choice import KNOWN, suited
            from ..viewer.contents.content import chosen

            have = frozenset(available)
            contents = suited(self.system, have, ensemble) if self.view is None else chosen(self.view, KNOWN)
            recorded |= {name for content in contents for name in content.needs(self.system)}
        if plotted:
            recorded |= shown_parts(self.system, available)
        strange = sorted(recorded - set(available))
        if strange:
            raise lm.errors.InvalidInput(
                f"record and view ask for {', '.join(strange)}; the start has {', '.join(available)}"
            )
        return tuple(name for name in available if name in recorded)

    def sampling(self, saved: bool) -> int:
        """Every how many steps a state is kept."""
        if self.every is not None or self.steps is None or self.t_end is not None:
            return 1 if self.every is None else self.every
        return max(1, -(-self.steps // (SAMPLES if saved else 10 * FRAMES)))

    def run(self, record: tuple[str, ...], every: int, progress: bool | None) -> lm.Trajectory:
        """The run; raises what `integrate` raises."""
        options = {"h": self.h, "steps": self.steps, "t_end": self.t_end, "rtol": self.rtol, "atol": self.atol}
        arguments: dict[str, Any] = {name: value for name, value in options.items() if value is not None}
        return lm.integrate(
            self.system, self.method, self.start, **arguments, every=every, record=record, t0=self.t0, progress=progress
        )
