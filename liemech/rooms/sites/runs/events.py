"""Events of systems of many sites: zeros of functions of time and of totals over all sites."""

from __future__ import annotations

from typing import Any

import numpy as np

from ....formulas.numbers.sizes import EPSILON
from ....simulation.between.dense import unpacked
from ....simulation.between.events import EARLY, NO_EVENTS, Event, Watch, crossed, name_of, roots, warn_of_jump
from .states import kind_of


class Sightings:
    """The zeros that a run of many sites has met."""

    def __init__(self, run: Any, events: tuple[Event, ...], begun: Any) -> None:
        self.run, before = run, getattr(begun, "met", NO_EVENTS)
        self.watch = Watch(events, [], before)
        self.each = {0: self.watch}
        # a zero that ended the run before is none of this
        self.known, ended = [name for name, _ in before], getattr(begun, "event", None)
        self.over = ended if ended is not None and self.known == [name_of(e) for e in events] else None

    def meet(self, begun: float, end: float) -> float:
        """Find the zeros in a step that goes from one time to another; where the run is to end, or the
        end of the step.
        """
        run, watch = self.run, self.watch
        old, new = run.values
        fresh = begun == run.begun
        if fresh and self.over is not None and np.isfinite(old[self.over]):
            old[self.over] = 0.0
        found = []
        for i, event in enumerate(watch.events):
            # what is zero at the start of the step, up to rounding of the time where the run begins, has a sign later
            a, first = begun, float(old[i])
            if first == 0.0 or (fresh and abs(first) <= EARLY * abs(new[i]) and crossed(event, first, new[i])):
                late = begun + EARLY * (end - begun)
                sign = float(run.looked(late, begun, end)[2][i])
                rounding = 64.0 * EPSILON * max(abs(begun), abs(end)) * abs(sign - first) / abs(late - begun)
                if abs(first) <= rounding:
                    a, first = late, sign
            if crossed(event, first, new[i]):

                def value(_: Any, times: np.ndarray, i: int = i) -> np.ndarray:
                    return np.array([run.looked(t, begun, end)[2][i] for t in times.tolist()])

                at, jump = roots(value, *[np.array([x]) for x in (a, end, first, new[i])])
                if jump.item():
                    warn_of_jump(name_of(event), at.item())
                else:
                    found.append((at.item(), i))
        found.sort(reverse=end < begun)
        zeros = ((0, at, i, run.samples.kept_of(run.looked(at, begun, end)[0])) for at, i in found)
        hit = watch.meet(zeros)
        run.values[0] = new
        run.ended = watch.ended
        return end if hit is None else hit[1]

    def shown(self, body: int) -> tuple[Any, ...]:
        """Of every event the times and the states."""
        run = self.run
        layout, width = run.shape.state, run.shape.state.width
        shown = []
        for one in self.watch.found:
            some = run.samples.kept_of(np.empty((1, run.count))).shape[1]
            rows = np.array([x for _, x in one]).reshape(len(one), width, some)
            arrays = unpacked(layout, np.moveaxis(rows, 1, -1))
            shown.append((np.array([t for t, _ in one]), kind_of(arrays)(**arrays)))
        return tuple(shown)
