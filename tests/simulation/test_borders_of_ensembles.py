"""Ensembles at the borders of runs: arrays of the wrong length, chunks, starts that are not alike."""

from __future__ import annotations

import dataclasses
import pickle
from concurrent import futures
from typing import Any, ClassVar

import numpy as np
import pytest

import liemech as lm
from liemech.errors import InvalidInput, InvalidType
from liemech.simulation import spread

KEPLER = lm.Kepler()
BODY = lm.RigidBody([1.0, 1.5, 2.0])
STARTS = BODY.state(mu=np.linspace([0.5, 0.1, 0.8], [0.6, 0.3, 0.9], 3))
ONE = BODY.state(mu=[0.5, 0.1, 0.8])


@lm.record
class Largest(lm.TimeScale):
    """A scale that depends on the largest distance of all members at the start."""

    parts: ClassVar[tuple[str, ...] | None] = ("q",)
    unit: float = 1.0

    def value(self, system: Any, state: Any) -> float:
        return self.unit + lm.dot(state.q, state.q)

    def bound(self, system: Any, start: Any) -> lm.TimeScale:
        return dataclasses.replace(self, unit=float(np.abs(start.arrays["q"]).max()))


def test_chunks_go_on_from_the_start_of_all(monkeypatch: Any) -> None:
    monkeypatch.setattr(spread, "CHUNK", 1)
    starts = KEPLER.state(q=np.linspace([0.5, 0.0], [1.0, 0.0], 40), p=[[0.0, 1.2]] * 40)
    method = lm.ReversibleController(lm.StormerVerlet(), Largest())
    plan = lm.Plan(KEPLER, method, h=0.01, compiled=False, progress=False)
    with futures.ThreadPoolExecutor(1) as executor:
        run = plan.run(starts, steps=2, executor=executor)
    assert run.sigma.unit == 1.0  # not 0.69, of the first 16 bodies
    theirs, ours = (plan.resume(x, steps=2) for x in (pickle.loads(pickle.dumps(run)), run))
    assert np.array_equal(ours.t, theirs.t) and np.array_equal(ours.q, theirs.q)
