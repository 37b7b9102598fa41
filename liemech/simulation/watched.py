"""Fixed steps with samples at any times, and with events: the motion between the steps is
that of shorter ones.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from ..errors import IntegrationFailure, IntegrationInterrupted
from ..systems.system import State
from .carry import Carry
from .checkpoint import Checkpoint
from .dense import ShortSteps, unpacked
from .fixed_run import FixedRun
from .prepared import Steps
from .systems import OfBodies
from .trajectory import Trajectory

CHUNK, LARGEST = 8, 512
"""Steps between two looks at the events: at first, and at most."""

NEAR = 4 * np.finfo(float).eps
"""Times that differ by this part of them are those of one step."""


def sampled(
    plan: Steps,
    start: State | Carry,
    steps: int,
    t0: float,
    times: np.ndarray,
    checkpoint: Checkpoint | None = None,
) -> Trajectory:
    """A run whose samples are at these times: after the last whole step before each, a shorter one."""
    before = start.step if isinstance(start, Carry) else 0
    after, exact = _steps_before(times, t0, plan.h_of(0))
    row = after - before
    needed = row + ~exact
    marks = np.unique(np.append(row[row > 0], [steps] if steps else []).astype(np.int64))
    run = SampledRun(plan, start, steps, t0, marks, checkpoint)
    run.needed = needed
    at = np.searchsorted(np.concatenate([[0], marks]), row)

    def so_far(part: Trajectory) -> Trajectory:
        some = needed <= part.steps
        return _between(plan, run, part, times[some], after[some], at[some], exact[some])

    if checkpoint is not None:
        shown = checkpoint.shown
        checkpoint.shown = lambda part: shown(so_far(part))
    try:
        whole = run.trajectory()
    except (Exception, IntegrationInterrupted) as caught:
        error: Any = caught
        if hasattr(error, "trajectory"):
            error.trajectory = so_far(error.trajectory)
        raise
    return _between(plan, run, whole, times, after, at, exact)


class SampledRun(FixedRun):
    """The whole steps of such a run.  needed : how many of them every sample needs."""

    needed: np.ndarray

    def _kept(self, steps: int) -> int:
        return int((self.needed <= steps).sum())


def _between(
    plan: Steps,
    run: FixedRun,
    whole: Trajectory,
    times: np.ndarray,
    after: np.ndarray,
    at: np.ndarray,
    exact: np.ndarray,
) -> Trajectory:
    """The samples at these times, of a run that has kept the whole steps before them.

    after : how many steps there are before each.  at : the number of the sample after these.
    exact : does the last of these steps end at the time?
    """
    shape = run.shape
    numbers = np.moveaxis(run.out[at][..., : run.count], 1, -1).copy()  # (times, bodies, width)
    moving = np.repeat(~exact[:, None], run.count, axis=1)
    for body, stop in whole.stopped.items():
        moving[:, body] &= after < stop.steps
    if moving.any():
        begun, asked = (
            np.repeat(x[:, None], run.count, axis=1)[moving] for x in (whole.t[at], times)
        )
        found = numbers[moving]
        bodies = (
            np.nonzero(moving)[1]
            if isinstance(plan.system, OfBodies) or isinstance(plan.method, OfBodies)
            else np.zeros(len(begun), dtype=int)
        )
        for i in np.unique(bodies):
            of = bodies == i
            motion = ShortSteps(
                plan.of(int(i)),
                plan.way_of(int(i)),
                shape.example,
                begun[of],
                found[of],
                plan.compiled,
            )
            try:
                found[of] = motion.moved(np.arange(len(motion.t)), asked[of])
            except IntegrationFailure as error:
                n = int(
                    np.nonzero(moving)[0][of][getattr(error, "row", 0)]
                )  # the first that failed
                before = times[:n], after[:n], at[:n], exact[:n]
                error.trajectory = _between(plan, run, whole, *before)
                raise
        numbers[moving] = found
    states = unpacked(shape.shown, numbers[:, 0] if run.bodies is None else numbers)
    return dataclasses.replace(whole, t=times, states=states)


def _steps_before(times: np.ndarray, t0: float, h: float) -> tuple[np.ndarray, np.ndarray]:
    """How many whole steps lead to each time, and whether they lead there exactly, but for rounding
    of the time.
    """
    near = np.rint((times - t0) / h)
    exact = np.abs(times - (t0 + near * h)) <= NEAR * np.maximum(np.abs(times), abs(t0))
    return np.where(exact, near, np.floor((times - t0) / h)).astype(np.int64), exact
