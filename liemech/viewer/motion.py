"""The motion that a scene shows: times and states, checked once, thinned out to what a screen can
show.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InvalidInput, InvalidType
from ..formulas import check_finite, real_array
from ..simulation.trajectory import Trajectory
from ..systems.system import State, System


@dataclass(frozen=True, eq=False)
class Motion:
    """States of a system at given times, from wherever they come: a closed form, a file, another
    program.

    t : (n,) times, rising or falling.  states : a state whose parts have a row for each time, as
    `RigidBody.exact` returns, or such arrays by name: mu (n, dim), g (n, ...), q (n, d), p (n, d).
    A run of `integrate` need not be wrapped in a Motion.

    Raises InvalidInput for wrong shapes, numbers that are not finite, and times that turn back.
    """

    system: System
    t: NDArray[np.float64]
    states: Any
    bodies: int | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.system, System):
            raise InvalidType(
                "Motion: system must be a system such as "
                f"RigidBody([1.0, 1.5, 2.0]); got {self.system!r}"
            )
        t = np.atleast_1d(real_array(self.t, "Motion: t"))
        check_finite(t, "Motion: t")
        if t.ndim != 1 or not len(t):
            raise InvalidInput(
                f"Motion: t has shape {t.shape}; give the times as (n,), at least one"
            )
        steps = np.diff(t)
        if not ((steps >= 0.0).all() or (steps <= 0.0).all()):
            raise InvalidInput("Motion: t must rise, or fall, from one sample to the next")
        object.__setattr__(self, "t", t)
        parts = self.states.parts if isinstance(self.states, State) else self.states
        if not isinstance(parts, Mapping):
            raise InvalidType(
                "Motion: states must be a state or arrays by name, "
                f"such as {{'mu': mu}}; got {self.states!r}"
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
                    f"Motion: {name} has shape {rows.shape}; it needs a "
                    f"row for each of the {len(t)} times"
                )
            check_finite(rows, f"Motion: {name}")
        object.__setattr__(self, "states", checked)

    @classmethod
    def of(cls, run: Any, frames: int, body: int | None = None, smooth: bool = False) -> Motion:
        """The motion of a run that is shown: at most `frames` samples of it, evenly chosen, the first and the
        last among them.

        body : the one to show of an ensemble.  smooth : of a run with dense output, which has few
        and long steps, `frames` samples.
        """
        if not isinstance(run, (Trajectory, Motion)):
            raise InvalidType(
                "a scene shows what `integrate` returns, or a "
                f"Motion(system, t, states); got {run!r}"
            )
        n = len(run.t)
        if not n:
            raise InvalidInput("a scene needs at least one sample; this run has none")
        if (
            smooth
            and n < frames
            and isinstance(run, Trajectory)
            and run.dense is not None
            and n > 1
        ):
            t = np.linspace(run.t[0], run.t[-1], frames)
            return cls(run.system, t, run.at(t))
        kept = (
            slice(None)
            if n <= frames
            else np.unique(np.linspace(0, n - 1, frames).round().astype(int))
        )
        states = {name: rows[kept] for name, rows in run.states.items() if rows is not None}
        bodies, t = run.bodies, run.t[kept]
        if body is not None:
            if bodies is None or not -bodies <= body < bodies:
                many = "one body" if bodies is None else f"{bodies} bodies"
                raise InvalidInput(f"body = {body} is not there: the run has {many}")
            states, bodies = {name: rows[:, body] for name, rows in states.items()}, None
            t = t if t.ndim == 1 else t[:, body]
        if t.ndim == 2:
            raise InvalidInput(
                "a scene: bodies with steps of their own are shown one at a time; give body=, as "
                "in viewer.Scene(run, body=0)"
            )
        return cls(run.system, t, states, bodies)

    @classmethod
    def moment(cls, system: System, t: float, state: State) -> Motion:
        """A single state, as a motion of one sample; not checked, for it comes from `system.state`
        or from a step.
        """
        states = {
            name: np.asarray(x, dtype=float)[None]
            for name, x in state.parts.items()
            if x is not None
        }
        motion = object.__new__(cls)
        for name, value in (
            ("system", system),
            ("t", np.array([t])),
            ("states", states),
            ("bodies", state.bodies),
        ):
            object.__setattr__(motion, name, value)
        return motion

    def __len__(self) -> int:
        return len(self.t)

    def __getitem__(self, part: str) -> NDArray[np.float64]:
        """The rows of one part of the state."""
        return self.states[part]

    def thinned(self, frames: int) -> Motion:
        """This motion with fewer samples."""
        return self if len(self) <= frames else replace(Motion.of(self, frames), bodies=self.bodies)


def times(t: ArrayLike) -> NDArray[np.float64]:
    """Playing time from the first sample: it rises whichever way the motion runs."""
    array = np.asarray(t, dtype=float)
    return np.abs(array - array[0])
