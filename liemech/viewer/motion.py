"""The motion that a scene shows: times and states, checked once, thinned out to what a screen can show."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InvalidInput, InvalidType, require
from ..formulas import check_finite, real_array
from ..formulas.arrays import Array
from ..models.many.sites import by_site, turn
from ..simulation.trajectory import Trajectory
from ..systems.system import State, System
from .thinning import FAR, shown_samples, shown_sites

FIRST, LATER = slice(None, -1), slice(1, None)


@dataclass(frozen=True, eq=False)
class Motion:
    """States of a system at given times, from wherever they come: a closed form, a file, another
    program.

    t : (n,) times, rising or falling.  states : a state whose parts have a row for each time, as
    `RigidBody.exact` returns, or such arrays by name: mu (n, dim), g (n, ...), q (n, d), p (n, d).
    A run of `integrate` need not be wrapped in a Motion.  sites : the numbers of those that are
    shown, where the states have an axis of sites.  note : what is left out.
    joined : do turns between two samples take the shortest way?

    Raises InvalidInput for wrong shapes, numbers that are not finite, and times that turn back.
    """

    system: System
    t: Array
    states: Any
    bodies: int | None = None
    sites: NDArray[np.intp] | None = None
    note: str = ""
    joined: bool = True

    def __post_init__(self) -> None:
        require("Motion: system", self.system, System, "a system such as RigidBody([1.0, 1.5, 2.0])")
        t = np.atleast_1d(real_array(self.t, "Motion: t"))
        check_finite(t, "Motion: t")
        if t.ndim != 1 or not len(t):
            raise InvalidInput(f"Motion: t has shape {t.shape}; give the times as (n,), at least one")
        steps = np.diff(t)
        if not ((steps >= 0.0).all() or (steps <= 0.0).all()):
            raise InvalidInput("Motion: t must rise, or fall, from one sample to the next")
        object.__setattr__(self, "t", t)
        parts = self.states.parts if isinstance(self.states, State) else self.states
        if not isinstance(parts, Mapping):
            raise InvalidType(
                f"Motion: states must be a state or arrays by name, such as {{'mu': mu}}; got {self.states!r}"
            )
        may_be_complex = self.system._complex("Element")
        checked = {
            name: real_array(rows, f"Motion: {name}", name == "g" and may_be_complex)
            for name, rows in parts.items()
            if rows is not None
        }
        for name, rows in checked.items():
            if rows.shape[:1] != t.shape:
                raise InvalidInput(
                    f"Motion: {name} has shape {rows.shape}; it needs a row for each of the {len(t)} times"
                )
            check_finite(rows, f"Motion: {name}")
        object.__setattr__(self, "states", checked)

    @classmethod
    def of_run(cls, run: Any, frames: int, body: int | None = None, smooth: bool = False, sites: Any = None) -> Motion:
        """The motion of a run that is shown: at most `frames` samples of it, evenly chosen, the first and the
        last among them, of many sites fewer.

        body : the one to show of an ensemble.  smooth : a run with dense output, whose steps are few and
        long, has even times between its own, `frames` in all.  sites : the numbers of those to show.
        """
        if not isinstance(run, (Trajectory, Motion)):
            raise InvalidType(f"a scene shows what `integrate` returns, or a Motion(system, t, states); got {run!r}")
        n = len(run.t)
        if not n:
            raise InvalidInput("a scene needs at least one sample; this run has none")
        states, bodies, t = run.states, run.bodies, run.t
        too_few = smooth and t.ndim == 1 and 1 < n < frames
        if too_few and isinstance(run, Trajectory) and run.dense is not None:
            between = np.linspace(t[0], t[-1], frames - n + 2)[1:-1]
            t = np.union1d(t, between)[:: 1 if t[-1] >= t[0] else -1]
            states = run.at(t).parts
        states = {name: rows for name, rows in states.items() if rows is not None}
        if body is not None:
            if bodies is None or not -bodies <= body < bodies:
                bodies_shown = "one body" if bodies is None else f"{bodies} bodies"
                raise InvalidInput(f"body = {body} is not there: the run has {bodies_shown}")
            states, bodies = {name: rows[:, body] for name, rows in states.items()}, None
            t = t if t.ndim == 1 else t[:, body]
        if t.ndim == 2:
            raise InvalidInput(
                "a scene: bodies with steps of their own are shown one at a time; give body=, as "
                "in viewer.Scene(run, body=0)"
            )
        chosen, note = shown_sites(run.system, sites)
        numbers = 0
        if chosen is not None:
            if bodies is not None:
                raise InvalidInput(
                    f"a scene shows one member of an ensemble of many sites, of {bodies} here; give "
                    "body=, as in viewer.Scene(run, body=0)"
                )
            numbers = len(chosen) * (7 if "g" in states else 3)

        def shown(kept: NDArray[np.intp]) -> dict[str, Any]:
            entries = kept if chosen is None else np.ix_(kept, chosen)
            return {name: by_site(run.system, name, rows)[entries] for name, rows in states.items()}

        samples, notes = shown_samples(len(t), frames, numbers), [note] if note else []
        left_out = len(t) / len(samples)
        if left_out > 1.0 and left_out * turn(run.system, shown(samples[:-1]), shown(samples[:-1] + 1)) > FAR:
            samples = np.arange(len(samples))
            notes.append(f"the first {len(samples):,} of {len(t):,} samples, to t = {t[samples[-1]]:.6g}")
        elif left_out >= 2.0:  # fewer are not missed
            notes.append(f"{len(samples):,} of {len(t):,} samples")
        thinned = shown(samples)
        pairs = ({n: x[k] for n, x in thinned.items()} for k in (FIRST, LATER))
        angle = turn(run.system, *pairs) if len(samples) > 1 else 0.0
        if angle > FAR:
            notes.append(f"samples one by one, which are up to {angle:.0f} degrees apart")
        joined = angle <= FAR
        return cls(run.system, t[samples], thinned, bodies, chosen, ", ".join(notes), joined)

    @classmethod
    def moment(cls, system: System, t: float, state: State, sites: NDArray[np.intp] | None = None) -> Motion:
        """A single state, as a motion of one sample.  sites : the numbers of those that are shown."""
        states = {name: np.asarray(x, dtype=float)[None] for name, x in state.parts.items() if x is not None}
        if sites is not None:
            states = {name: by_site(system, name, x)[:, sites] for name, x in states.items()}
        return cls(system, np.array([t]), states, state.bodies, sites)

    def __len__(self) -> int:
        return len(self.t)

    def __getitem__(self, part: str) -> Array:
        """The rows of one part of the state."""
        return self.states[part]
