"""What a run leaves behind: the samples, and what can be told from them, computed when asked for."""

from __future__ import annotations

import inspect
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from .dense import DenseOutput
from .errors import InvalidInput
from .systems.system import State, System

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

    from .integrators.method import Method


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory:
    """Samples of a motion, and the quantities that should stay constant along it.

    t : (n,) times in s.  states : the recorded parts of the state by name, (n, ...) each; also as attributes, such as
    mu : (n, dim) body momentum and g : (n, k, k) group elements, None if they were not recorded.
    In an ensemble of m bodies mu is (n, m, dim) and g is (n, m, k, k).
    Of adaptive steps h is the mean; `at(t)` gives the state at any time; rejected : the steps that were tried in vain;
    events : for every event function the times, and the states then.
    stopped : for an ensemble, the bodies that did not reach the end and the number of steps each of them took.
    """

    system: System
    method: Method
    h: float
    t: np.ndarray
    states: dict[str, np.ndarray]
    bodies: int | None
    steps: int
    compiled: bool = False
    stopped: dict[int, int] = field(default_factory=dict)
    rejected: int | None = None
    dense: DenseOutput | None = None
    events: tuple[tuple[np.ndarray, State], ...] = ()

    def __len__(self) -> int:
        return len(self.t)

    def __getattr__(self, name: str) -> Any:
        """A part of the state that belongs to this kind of system."""
        states = self.__dict__.get("states", {})
        if name in states:
            return states[name]
        raise AttributeError(f"a Trajectory has no {name!r}; this one recorded {', '.join(states)}")

    @property
    def g(self) -> np.ndarray | None:
        """The group elements, (n, k, k); None if they were not recorded."""
        return self.states.get("g")

    @property
    def _laws(self) -> Any:
        """The system of a body, whose formulas take all samples at once."""
        return self.system

    @cached_property
    def energy(self) -> np.ndarray:
        """The energy at every sample, in J.  (n,)"""
        energy = getattr(self.system, "energy", None)
        if energy is None:
            raise InvalidInput(f"Trajectory.energy: {self.system!r} has no energy")
        return energy(*(self.states[name] for name in inspect.signature(energy).parameters))

    @cached_property
    def casimirs(self) -> np.ndarray:
        """The Casimir functions at every sample; |mu|^2 on SO(3).  (n, number of Casimirs)"""
        return self._laws.casimirs(self.mu)

    @cached_property
    def xi(self) -> np.ndarray:
        """The velocities of a variational method: that of the interval after each sample, one step long, in 1/s.  (n, dim)

        Between the samples of a run that kept every step xi, and not J^-1 mu, is what carries g along: g_i+1 = g_i tau(h xi_i).
        """
        between = getattr(self.method, "velocity", None)
        if between is None:
            raise InvalidInput(
                f"Trajectory.xi is for methods with a velocity on every interval, as CovariantVariational; {self.method!r} has "
                "none. At the samples of a free body the velocity is `run.system.velocity(run.mu)`"
            )
        return between(self.system, self.mu, self.h)

    @cached_property
    def spatial_momentum(self) -> np.ndarray:
        """The momentum seen from space, K_g mu, at every sample.  (n, dim)"""
        return self._laws.spatial_momentum(self.mu, self._attitude("spatial_momentum"))

    @cached_property
    def rotation(self) -> Rotation:
        """The attitudes as SciPy rotations, body to space."""
        from scipy.spatial.transform import Rotation

        g = self._attitude("rotation")
        if g.shape[-2:] != (3, 3):
            raise InvalidInput(f"Trajectory.rotation is for rotations; elements of {self.system.group!r} have shape {g.shape[-2:]}")
        return Rotation.from_matrix(g)

    @property
    def last(self) -> State:
        """The last state, from which a run can be continued."""
        return self._laws.state(**{name: array[-1] for name, array in self.states.items()})

    def at(self, t: Any) -> Any:
        """The state at any time of a run with adaptive steps, or at many, (m,); between the steps too it is on the group."""
        if self.dense is None:
            needed = "a run with adaptive steps (integrate with t_end) that kept the way between them (dense=True)"
            raise InvalidInput(f"Trajectory.at needs {needed}")
        return self.dense(t)

    def drift(self) -> Drift:
        """How well the constants of the motion were kept: bounded or drifting, and how fast."""
        return Drift.of(self)

    def _attitude(self, what: str) -> np.ndarray:
        if self.g is None:
            raise InvalidInput(f"Trajectory.{what} needs the attitude; start from a state with a g and record it")
        return self.g

    def __repr__(self) -> str:
        many = "" if self.bodies is None else f"{self.bodies} bodies, "
        end = f"to t = {self.t[-1]:g}" if len(self) else "none"
        steps = f"h = {self.h:g}" if self.rejected is None else f"{self.steps} steps, {self.rejected} rejected"
        return (
            f"Trajectory({self.method!r}: {many}{len(self)} samples {end}, {steps}, "
            f"{'compiled' if self.compiled else 'plain'}; {', '.join(self.states)})"
        )


FEW = 8
"""Samples below which a straight line through them says nothing."""


@dataclass(frozen=True)
class Kept:
    """How well one quantity was kept: its size, the largest deviation, the trend, and how sure the trend is."""

    name: str
    size: float
    largest: float
    slope: float
    spread: float
    duration: float
    samples: int

    @property
    def verdict(self) -> str:
        """`exact` (rounding only), `bounded` (oscillates), `drifting` (the trend dominates), or `changed` (who knows)."""
        if self.largest <= 1e-12:
            return "exact"
        if self.samples < FEW:
            return "changed"
        return "drifting" if abs(self.slope) * self.duration > 4.0 * self.spread else "bounded"

    def __str__(self) -> str:
        trends = {"drifting": f", {self.slope:+.1e} per unit time", "changed": ", too few samples for a trend"}
        trend = trends.get(self.verdict, "")
        return f"{self.name:<18}{self.verdict:<10}largest change {self.largest:.1e} of {self.size:.6g}{trend}"


@dataclass(frozen=True)
class Drift:
    """The structure report of a run; `print` it."""

    kept: tuple[Kept, ...]

    @classmethod
    def of(cls, run: Trajectory) -> Drift:
        """Measure what the system names as constant: of a body energy, Casimirs, spatial momentum.  Changes are relative."""
        if len(run) < 2:
            raise InvalidInput("Trajectory.drift needs at least two samples")
        series = run.system.constants(run.states)
        if not series:
            raise InvalidInput(f"Trajectory.drift: {run.system!r} names no `constants` of its motion")
        axes = run.t.ndim + (run.bodies is not None)
        return cls(tuple(_kept(name, run.t, values.reshape(*values.shape[:axes], -1)) for name, values in series.items()))

    def __getitem__(self, name: str) -> Kept:
        return next(k for k in self.kept if k.name == name)

    def __str__(self) -> str:
        return "\n".join(map(str, self.kept))


def _kept(name: str, t: np.ndarray, values: np.ndarray) -> Kept:
    """The change of a vector quantity along a run: its largest norm, and by least squares a straight line through it."""
    _, exponent = np.frexp(np.abs(values).max(axis=(0, -1)))  # a power of two as unit: then no square under- or overflows
    values = np.ldexp(values, -exponent[..., None])
    size = np.linalg.norm(values[0], axis=-1)
    relative = (values - values[0]) / np.where(size > 0.0, size, 1.0)[..., None]
    largest = np.linalg.norm(relative, axis=-1)
    worst = np.unravel_index(np.argmax(largest), largest.shape)[1:]
    series = relative[(slice(None), *worst)]
    component = np.ascontiguousarray(series[:, np.abs(series[-1]).argmax()])
    time = t - t.mean()
    slope = float(time @ component / (time @ time))
    spread = float(np.std(component - slope * time))
    size = np.ldexp(size, exponent)
    return Kept(name, float(np.max(size)), float(largest.max()), slope, spread, float(abs(t[-1] - t[0])), len(t))
