"""What a run leaves behind: the samples, and what can be told from them, computed when asked for."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from .dense import DenseOutput
from .errors import IntegrationFailure, InvalidInput
from .systems.system import State, System

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

    from .integrators.method import Method
    from .viewer import Scene


class Stop(NamedTuple):
    """Where and why a body of an ensemble stopped: after how many steps, and what the next one failed of."""

    steps: int
    error: IntegrationFailure


class Stopped(Mapping[int, Stop]):
    """The bodies of an ensemble that did not reach the end, by their numbers; why, is found out when asked for.

    steps : how many steps each of them took.
    """

    def __init__(self, steps: Mapping[int, int] | None = None, failure: Callable[[int], IntegrationFailure] | None = None) -> None:
        self.steps, self._failure = dict(steps or {}), failure
        self._errors: dict[int, IntegrationFailure] = {}

    def __getitem__(self, body: int) -> Stop:
        steps = self.steps[body]
        if body not in self._errors and self._failure is not None:
            self._errors[body] = self._failure(body)
        return Stop(steps, self._errors[body])

    def __iter__(self) -> Iterator[int]:
        return iter(self.steps)

    def __len__(self) -> int:
        return len(self.steps)

    def __repr__(self) -> str:
        return f"Stopped({self.steps!r})"

    def __getstate__(self) -> dict[str, Any]:
        """With all reasons and without the run, which would find them out."""
        return {"steps": self.steps, "_failure": None, "_errors": {body: self[body].error for body in self}}


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory:
    """Samples of a motion, and the quantities that should stay constant along it.

    t : (n,) times in s.  states : the recorded parts of the state by name, (n, ...) each; also as attributes, such as
    mu : (n, dim) body momentum and g : (n, k, k) group elements, None if they were not recorded.
    In an ensemble of m bodies mu is (n, m, dim) and g is (n, m, k, k).
    Of adaptive steps h is the mean; `at(t)` gives the state at any time; rejected : the steps that were tried in vain;
    events : for every event function the times, and the states then.
    stopped : for an ensemble, the bodies that did not reach the end, each with the `steps` it took and the `error` that ended it.
    """

    system: System
    method: Method
    h: float
    t: np.ndarray
    states: dict[str, np.ndarray]
    bodies: int | None
    steps: int
    compiled: bool = False
    stopped: Mapping[int, Stop] = field(default_factory=Stopped)
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

    def view(self, show: Any = None) -> Scene:
        """The run as a moving picture: `run.view().show()` opens it, notebooks show it.  show : as in viewer.Scene."""
        from .viewer import Scene

        return Scene(self, show)

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


SMALL = 0.1
"""A constant smaller than this part of its terms owes its size to their cancelling; its changes are told beside the terms."""


@dataclass(frozen=True)
class Kept:
    """How well one quantity was kept: its size, the largest change, the trend, and how sure the trend is.

    size : at the start.  scale : what changes are divided by: the size, or that of the terms the quantity is the sum of where these
    nearly cancel; 0 if changes are absolute, because everything is zero at the start.
    """

    name: str
    size: float
    scale: float
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

    @property
    def measure(self) -> str:
        """Whether changes are relative, and to what, or absolute."""
        if not self.scale:
            return "absolute"
        cancelling = "" if self.scale == self.size else f", the size of its terms; it is {self.size:.1e}"
        return f"relative to {self.scale:.6g}{cancelling}"

    def __str__(self) -> str:
        trends = {"drifting": f"; {self.slope:+.1e} per unit time", "changed": "; too few samples for a trend"}
        trend = trends.get(self.verdict, "")
        return f"{self.name:<18}{self.verdict:<10}largest change {self.largest:.1e} ({self.measure}){trend}"


@dataclass(frozen=True)
class Drift:
    """The structure report of a run; `print` it."""

    kept: tuple[Kept, ...]

    @classmethod
    def of(cls, run: Trajectory) -> Drift:
        """Measure what the system names as constant: of a body energy, Casimirs, spatial momentum."""
        if len(run) < 2:
            raise InvalidInput("Trajectory.drift needs at least two samples")
        series, terms = run.system.constants(run.states), _terms(run)
        axes = run.t.ndim + (run.bodies is not None)

        def flat(values: np.ndarray) -> np.ndarray:
            return values.reshape(*values.shape[:axes], -1)

        return cls(tuple(_kept(name, run.t, flat(values), flat(terms[name])) for name, values in series.items()))

    def __getitem__(self, name: str) -> Kept:
        for kept in self.kept:
            if kept.name == name:
                return kept
        names = ", ".join(k.name for k in self.kept) or "none"
        raise InvalidInput(f"Drift: {name!r} is no constant of this motion; known are: {names}")

    def __str__(self) -> str:
        return "\n".join(map(str, self.kept)) or "no constants of the motion are known"


def _terms(run: Trajectory) -> dict[str, np.ndarray]:
    """How large the terms of the constants are, sum_i |x_i dC/dx_i| over the coordinates, at the start, half-way and at the end."""
    states = {name: values[_some(len(run))] for name, values in run.states.items()}
    constants, bit = run.system.constants(states), 2.0**-20
    sizes = {name: np.abs(values) for name, values in constants.items()}
    totals = {name: np.zeros_like(values) for name, values in sizes.items()}
    for part in run.system.coordinates:
        for i in range(states[part].shape[-1]):
            varied = states[part].copy()
            varied[..., i] *= 1.0 + bit
            for name, values in run.system.constants(states | {part: varied}).items():
                totals[name] += np.abs(values - constants[name]) / bit
    return {name: np.maximum(sizes[name], totals[name]) for name in sizes}


def _some(samples: int) -> list[int]:
    """The samples at which the terms are looked at."""
    return [0, samples // 2, -1]


def _kept(name: str, t: np.ndarray, values: np.ndarray, terms: np.ndarray) -> Kept:
    """The change of a vector quantity along a run: its largest norm, and by least squares a straight line through it."""
    _, exponent = np.frexp(np.abs(values).max(axis=(0, -1)))  # a power of two as unit: then no square under- or overflows
    values, terms = (np.ldexp(x, -exponent[..., None]) for x in (values, terms))
    size, sums = np.linalg.norm(values[0], axis=-1), np.linalg.norm(terms, axis=-1)
    changes = np.linalg.norm(values[_some(len(t))] - values[0], axis=-1)
    sum_of_terms = np.where(changes <= SMALL * sums, sums, 0.0).max(axis=0)  # not where the motion has been left
    scale = np.where(size > SMALL * sum_of_terms, size, sum_of_terms)
    unit = np.where(scale > 0.0, scale, np.ldexp(1.0, -exponent))
    change = (values - values[0]) / unit[..., None]
    largest = np.linalg.norm(change, axis=-1)
    worst = np.unravel_index(np.argmax(largest), largest.shape)[1:]
    series = change[(slice(None), *worst)]
    component = np.ascontiguousarray(series[:, np.abs(series[-1]).argmax()])
    time = t - t.mean()
    slope = float(time @ component / (time @ time))
    spread = float(np.std(component - slope * time))
    size, scale = (float(np.ldexp(x, exponent)[worst]) for x in (size, scale))
    return Kept(name, size, scale, float(largest.max()), slope, spread, float(abs(t[-1] - t[0])), len(t))
