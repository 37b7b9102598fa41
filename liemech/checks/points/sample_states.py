"""The states at which the laws of a system are checked: given ones, or random ones."""

from __future__ import annotations

import dataclasses
import warnings
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ...compiler import kernel
from ...errors import IncompatibleSystem, InconsistentState, InvalidInput, LiemechError, NoConvergence
from ...formulas.vectors import small
from ...groups.retractions import Exponential
from ...rooms.constraints.constrained import ConstrainedSystem
from ...rooms.constraints.constrained_body import BoundBody
from ...rooms.poisson.poisson import PoissonState, PoissonSystem
from ...simulation.integrate import integrate
from ...systems.canonical import CanonicalState, CanonicalSystem, PhaseSpace
from ...systems.cotangent import CotangentMotion, CotangentSystem, DrivenCotangentSystem
from ...systems.equations.group_equation import GroupEquation, GroupState
from ...systems.equations.homogeneous_equation import HomogeneousEquation, Point
from ...systems.in_time.driven import DrivenHamiltonianSystem, DrivenLiePoissonSystem
from ...systems.in_time.inputs import inputs
from ...systems.lie_poisson import BodyState, LiePoissonMotion, LiePoissonSystem
from ...systems.mechanical import MechanicalSystem
from ...systems.system import State, System
from ...systems.vector_field import VectorField
from ..report import shown
from .sample_points import STENCIL, STEP, flat, size
from .seeds import generator

SIZES = 1.0, 1.0, 1.0, 0.2, 3.0, 8.0, -8.0, 1.0
"""How large the states are that are drawn, in the units of the system; a negative one is the mirror
image of the state before.
"""

TIMES = 0.0, 0.4, -1.3, 25.0, 7.3, 13.0, 61.0, 640.0
"""When; a formula may be wrong from some time on."""

PLACES = len(SIZES)
"""How many states are drawn."""

DRIVEN = DrivenHamiltonianSystem, DrivenLiePoissonSystem, DrivenCotangentSystem
"""Systems whose energy and velocity take the time first."""

CENTRAL = *(-weight for _, weight in reversed(STENCIL)), 0.0, *(weight for _, weight in STENCIL)
"""The weights of the differences for nine equidistant values in a row."""


@dataclass(frozen=True)
class AtState:
    """A state of a system, with small arrays, and a time."""

    name: str
    system: Any
    state: Any
    t: float
    apart: float = 0.25 * STEP  # how far apart states nearby are, in units of the pace

    @property
    def closer(self) -> AtState:
        """The place with closer states nearby: for quantities that change faster than the pace
        tells.
        """
        return dataclasses.replace(self, apart=self.apart / 16.0)

    @property
    def dim(self) -> int:
        return self.system.group.dim

    @property
    def driven(self) -> bool:
        """Whether the energy depends on time."""
        return isinstance(self.system, DRIVEN)

    @property
    def timed(self) -> dict[str, float]:
        """The time, for the velocity and the energy of a body in a field that ask for it."""
        return {"t": self.t} if self.system.driven and not self.driven else {}

    @cached_property
    def rate(self) -> Any:
        """The velocity of the motion here."""
        return self.system.rate(self.t, self.state)

    @cached_property
    def pace(self) -> float:
        """The speed of the motion, relative to where it is: the inverse of a time."""
        return pace(self.system, self.t, self.state)

    @cached_property
    def nearby(self) -> list[Any]:
        """States before and after this one, at equal times, along the velocity here: the motion to
        first order.
        """
        times = [k * self.unit for k in range(-4, 5)]
        return [self.system.displaced(Exponential(), self.state, time * self.rate) for time in times]

    @property
    def unit(self) -> float:
        """The time between two states nearby."""
        return self.apart / (self.pace or 1.0)

    def along(self, values: list[Any]) -> tuple[np.ndarray, float]:
        """The derivative along the motion of a quantity with these values at the states nearby, and
        the size of its rounding.
        """
        rate = sum(w * flat(v) for w, v in zip(CENTRAL, values, strict=True)) / self.unit
        return np.asarray(rate), max(map(size, values)) / self.unit

    def __str__(self) -> str:
        parts = (shown(n, flat(x)[:6]) for n, x in self.state.parts.items() if x is not None)
        when = f"t = {self.t:g}, " if knows_time(self.system) else ""
        return f"{self.name}, {when}{', '.join(parts)}"


def pace(system: Any, t: float, state: Any) -> float:
    """The rate of change relative to what changes, and of turning if the group turns: the inverse
    of a time.
    """
    rate = system.rate(t, state)
    group = system.group
    turning = max(size(group.ad(rate, e)) for e in np.eye(group.dim).tolist()) if group.dim <= 32 else 0.0
    change, large = (flat(x) for x in system.variation(state, rate))
    return max(float(turning), float(np.linalg.norm(change)) / (float(np.linalg.norm(large)) or 1.0))


def run_of(system: Any, method: Any, start: Any, compiled: bool | None, **options: Any) -> Any:
    """The trajectory of a run that warns of nothing; raises what `integrate` raises.

    If the method takes no system of all sites as one body, the start has an axis of sites, and the run is native where
    it can be, because plain Python sweeps over all sites.
    """
    try:
        method.require(system)
    except IncompatibleSystem:
        start = system.state(**{name: np.asarray(x) for name, x in start.arrays.items()})
        compiled = True if compiled is None and kernel.available() is None else compiled
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return integrate(system, method, start, compiled=compiled, progress=False, **options)


def ended(run: Any) -> dict[str, np.ndarray]:
    """The last sample, unprojected: after a method that leaves the manifold it is no valid start."""
    return {
        name: run.system._in_rows(np.asarray(array[-1]), "Element" if name == "g" else "Vec")
        for name, array in run.states.items()
    }


def knows_time(system: Any) -> bool:
    """Whether the motion may depend on the time."""
    body = system.body if isinstance(system, BoundBody) else system
    equation = isinstance(system, (GroupEquation, HomogeneousEquation))
    return equation or body.driven or getattr(body, "load", None) is not None


def components(rng: np.random.Generator, n: int, large: float) -> np.ndarray:
    """Normally distributed components; of large vectors none is small."""
    x = rng.normal(size=n)
    return large * (x if abs(large) <= 1.0 else np.copysign(0.5 + np.abs(x), x))


def named(large: float) -> str:
    """The name of a random place of this size."""
    return "random" if large == 1.0 else f"random, size {abs(large):g}"


def sample_states(system: System, states: State | None, seed: int) -> list[AtState]:
    """The given states, or random ones of several sizes at which the formulas are defined; as many
    as are found, and at several times.
    """
    if states is not None:
        times = TIMES if knows_time(system) else (0.0,)
        return [
            place for i, state in enumerate(members(states)) for place in at_times(f"state {i}", system, state, times)
        ]
    rng, reason = generator("check_system", seed), ""
    drawn = rng.bit_generator.state
    places: list[AtState] = []
    for i, (large, t) in enumerate(zip(SIZES * 4, TIMES * 4, strict=True)):
        if len(places) < PLACES and (i < PLACES or large == 1.0 or not places):
            if large < 0.0:
                rng.bit_generator.state = drawn
            name, drawn = named(large), rng.bit_generator.state
            at = at_times(name, system, random_state(system, rng, large), (t,))[0]
            undefined = why_undefined(at)
            places += [] if undefined else [at]
            reason = undefined or reason
    if not places:
        raise InvalidInput(
            f"check_system: {system!r} is not defined at random states ({reason}); give some, states=system.state(...)"
        )
    return places


def at_times(name: str, system: Any, state: Any, times: tuple[float, ...]) -> list[AtState]:
    """A given state at the times at which the system is defined, the times of its tables among them; at the first time
    if there is none, and the laws say why.
    """
    ends = [np.asarray(table.knots) for table in inputs(system)]
    within = [float(k[0] + share * (k[-1] - k[0])) for k in ends for share in (0.1, 0.5, 0.9)]
    places = [AtState(name, system, state, t) for t in (*times, *within)]
    return [place for place in places if not why_undefined(place)] or places[:1]


def members(states: State) -> list[Any]:
    """The members of an ensemble, or the one state, with small arrays."""
    rows = (...,) if states.bodies is None else range(states.bodies)
    return [
        type(states)(*(None if x is None else small(np.asarray(x)[i]) for x in states.parts.values())) for i in rows
    ]


def random_state(system: Any, rng: np.random.Generator, large: float = 1.0) -> Any:
    """A state with normally distributed coordinates, times `large`, and a random element of the
    group.
    """
    if isinstance(system, BoundBody):
        return _on_constraint(system, rng, large)
    if isinstance(system, (LiePoissonMotion, CotangentMotion)):
        group = system.group if isinstance(system, LiePoissonMotion) else system.configurations
        mu = small(components(rng, group.dim, large))
        g = group.random(rng)
        if abs(large) < 1.0:  # small turns and shifts too
            g = group.exp(small(large * rng.normal(size=group.dim)))
        return BodyState(mu, small(np.asarray(g)))
    if isinstance(system, ConstrainedSystem):
        return _consistent(system, rng, large)
    if isinstance(system, PhaseSpace):
        return CanonicalState(*(small(components(rng, system.degrees, large)) for _ in range(2)))
    if isinstance(system, VectorField):
        y = components(rng, system.dim, large)
        try:
            return PoissonState(small(np.asarray(system.state(y).y)))
        except InvalidInput:
            return PoissonState(small(0.5 * abs(large) + np.abs(y)))
    if isinstance(system, GroupEquation):
        return GroupState(small(np.asarray(system.group.random(rng))))
    if isinstance(system, HomogeneousEquation):
        return Point(small(np.asarray(system.action.random(rng))))
    raise InvalidInput(
        f"check_system: how states of {system!r} are drawn is not known; give some, states=system.state(...)"
    )


def _consistent(system: ConstrainedSystem, rng: np.random.Generator, large: float = 1.0) -> CanonicalState:
    """A state on the constraints, near a random one; the random one if none is found, and the laws say why."""
    for attempt in range(20):
        q, p = (small(large * x) for x in rng.normal(size=(2, system.degrees)))
        q = q if attempt < 4 else q / large  # where positions may be is for the constraints to say
        try:
            position = system.across(q, p, q)
            return CanonicalState(position, system.tangent(position, p))
        except (NoConvergence, InconsistentState, ArithmeticError, ValueError):
            pass
    return CanonicalState(q, p)


def _on_constraint(system: Any, rng: np.random.Generator, large: float) -> BodyState:
    """A consistent state near a random one; if none is found, a random one."""
    group = system.configurations
    for _ in range(3):
        mu = small(components(rng, group.dim, large))
        g = small(np.asarray(group.random(rng)))
        try:
            start = system.consistent(np.array(mu), np.array(g))
            return BodyState(*(small(np.asarray(x)) for x in start.parts.values()))
        except (LiemechError, ArithmeticError, ValueError):
            pass
    return BodyState(mu, g)


def why_undefined(at: AtState) -> str:
    """The reason why velocity or energy have no value at a state; empty if they have one, or if a law will say what is
    wrong.
    """
    try:
        with np.errstate(all="ignore"):
            values = [*flat(at.rate), _energy(at.system, at.state)]
        return "" if np.isfinite(values).all() else f"velocity and energy are {values}"
    except LiemechError:
        return ""
    except (ArithmeticError, ValueError) as error:
        return f"{type(error).__name__}: {error}"
    except Exception:
        return ""


def _energy(system: Any, state: Any) -> float:
    """The energy, of systems that have one."""
    if isinstance(system, LiePoissonSystem):
        return float(system.energy(state.mu))
    return (
        float(system.energy(*state.parts.values()))
        if isinstance(system, (MechanicalSystem, CotangentSystem, CanonicalSystem, PoissonSystem))
        else 0.0
    )
