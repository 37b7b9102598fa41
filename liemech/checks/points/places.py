"""Places beside the given start at which the claims of a method are judged: other starts, of other
sizes and signs, and later times.

A run from a place is a few steps, made directly, with the system that carries physical time along
where steps are those of a fictive time.
"""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ...errors import LiemechError
from ...formulas.vectors import small
from ...integrators.rkmk import RKMK
from ...rooms.constraints.constrained import ConstrainedSystem
from ...rooms.constraints.constrained_body import BoundBody
from ...rooms.fictive_time.clocked import Clocked
from ...rooms.fictive_time.origin import Origin
from ...rooms.fictive_time.time_transformed import ExtendedSystem
from ...systems.canonical import CanonicalState, PhaseSpace
from ...systems.cotangent import CotangentMotion
from ...systems.equations.group_equation import GroupEquation, GroupState
from ...systems.equations.homogeneous_equation import HomogeneousEquation, Point
from ...systems.lie_poisson import BodyState, LiePoissonMotion
from ...systems.system import small_state
from ...systems.vector_field import VectorField
from ..reference import settled
from ..report import ROUNDING, shown
from .sample_points import flat, size
from .sample_states import ended, knows_time, members, pace, run_of

SOME = 3
"""Steps of a run: what is wrong from the second step on shows too."""

LATE = 0.0, 7.3, 61.0, 640.0
"""When the runs begin, in units of time of the system."""

EXACTLY = RKMK(order=8)

FINE = 10.0
"""Steps in which it is followed at first, while the start changes by its own size."""

NOISE = 512.0 * ROUNDING
"""Relative errors below this are rounding."""


@dataclass(frozen=True)
class CheckPlace:
    """A start, small and single, and a time, at which a method is looked at.

    system, start : as a user has them; for fictive time those without clock.
    """

    name: str
    method: Any
    system: Any
    start: Any
    t0: float = 0.0
    compiled: bool | None = None

    def __str__(self) -> str:
        parts = (shown(name, flat(x)[:6]) for name, x in self.start.parts.items() if x is not None)
        return f"{self.name}, t = {self.t0:g}, {', '.join(parts)}"

    # ---------------------------------------------------------------- systems and their states

    @property
    def base(self) -> Any:
        """The system whose motion it is, in physical time."""
        return self.system.system if isinstance(self.system, ExtendedSystem) else self.system

    @property
    def fictive(self) -> bool:
        """Whether steps are of a fictive time."""
        return bool(self.method.fictive or self.system.fictive)

    @cached_property
    def whole(self) -> Any:
        """The system that the method steps, with a clock in fictive time."""
        if not self.fictive:
            return self.system
        return self._origin.whole

    @cached_property
    def _origin(self) -> Origin:
        return Origin(self.system, self.method, self.start)

    @cached_property
    def begin(self) -> Any:
        """The start, with a clock in fictive time."""
        return self._origin.begun(self.t0) if self.fictive else self.start

    def plainly(self, state: Any) -> Any:
        """A state of the system as a user has it."""
        if isinstance(self.whole, Clocked):
            return self.whole.without(state)
        if isinstance(self.whole, ExtendedSystem):
            return CanonicalState(self.whole.without(state.q), self.whole.without(state.p))
        return state

    def clock(self, state: Any, elapsed: float) -> float:
        """The physical time that has passed since t0."""
        return float(self.whole.clock(state)) - self.t0 if self.fictive else elapsed

    # ---------------------------------------------------------------- steps

    def after(self, state: Any, h: float, steps: int, elapsed: float = 0.0) -> Any:
        """The state after some steps from a state; raises what a step raises."""
        if not self.fictive:
            return small_state(type(state), self.led(self.method, state, h, steps, elapsed))
        with np.errstate(all="ignore"):
            memory = self.method.start(self.whole, state, h)
            for i in range(steps):
                memory = self.method.step(self.whole, self.t0 + elapsed + i * h, memory, h)
            return self.method.observe(memory)

    def led(self, method: Any, state: Any, h: float, steps: int, elapsed: float = 0.0) -> dict[str, np.ndarray]:
        """The parts of the last state, or states, of a run in physical time."""
        t = self.t0 + elapsed
        begin, options = self.base.vouched(state, t), {"h": h, "steps": steps, "every": steps, "t0": t}
        with np.errstate(all="ignore"):
            return ended(run_of(self.base, method, begin, self.compiled, compensated=False, **options))

    def exact(self, time: float) -> Any:
        """The state to which the motion leads in a physical time."""
        return self.exact_within(time)[0]

    def exact_within(self, time: float) -> tuple[Any, dict[str, float]]:
        """The state to which the motion leads, and how far each of its parts may be off."""
        return settled(
            lambda n: self._exactly(time, n),
            max(1, int(np.ceil(FINE * abs(time) / self.unit))),
            self.distances,
            0.25 * self.noise,
        )

    def _exactly(self, time: float, steps: int) -> Any:
        """The state after a number of steps of order 8."""
        last = self.led(EXACTLY, self.start, time / steps, steps)
        return small_state(type(self.start), last)

    @property
    def noise(self) -> float:
        """Relative errors below this are rounding, that of the time among them."""
        timed = self.fictive or knows_time(self.base)
        return NOISE * max(1.0, abs(self.t0) / self.unit if timed else 0.0)

    @cached_property
    def unit(self) -> float:
        """The time in which the start changes by its own size, or turns by a radian."""
        return 1.0 / (pace(self.base, self.t0, self.start) or 1.0)

    @cached_property
    def scale(self) -> float:
        """The physical time that a unit of the method's time takes here."""
        if not self.fictive:
            return 1.0
        h = 2.0**-10
        for _ in range(40):
            try:
                passed = self.clock(self.after(self.begin, h, 1), h)
            except (LiemechError, ArithmeticError, ValueError):
                passed = 0.0
            if 0.0 < passed <= 2.0**-6 * self.unit:
                return passed / h
            h = h / 16.0
        return 1.0

    @cached_property
    def sizes(self) -> dict[str, float]:
        """The sizes of the parts at the start, or a while later: what begins at zero has one too."""
        states = [self.start]
        with contextlib.suppress(LiemechError, ArithmeticError, ValueError):
            states.append(self._exactly(0.25 * self.unit, int(FINE)))
        sizes: dict[str, float] = {}
        for state in states:
            for name, x in state.parts.items():
                if x is not None and np.isfinite(flat(x)).all():
                    sizes[name] = max(sizes.get(name, 0.0), size(flat(x)))
        return sizes

    def differences(self, a: Any, b: Any) -> dict[str, np.ndarray]:
        """The differences of parts of two states, beside their size here, at the start and soon after."""
        parts, reference = ({name: flat(x) for name, x in s.parts.items() if x is not None} for s in (a, b))
        return {
            name: (parts[name] - x) / (max(size(x), self.sizes[name]) or 1.0)
            for name, x in reference.items()
            if name in self.sizes
        }

    def distances(self, a: Any, b: Any) -> dict[str, float]:
        """The sizes of the differences of two states."""
        return {name: size(x) for name, x in self.differences(a, b).items()}

    def moved(self, starts: list[dict[str, np.ndarray]], h: float, steps: int) -> list[Any]:
        """The states after some steps from states that are given by their parts."""
        if not self.fictive:
            ensemble = self.base.state(**{name: np.stack([parts[name] for parts in starts]) for name in starts[0]})
            last = self.led(self.method, ensemble, h, steps)
            kind = type(self.start)
            return [small_state(kind, {name: x[i] for name, x in last.items()}) for i in range(len(starts))]
        kind = type(self.begin)
        names = self.begin.parts
        return [
            self.after(kind(*[small(parts[name]) if name in parts else None for name in names]), h, steps)
            for parts in starts
        ]


def places(first: CheckPlace) -> Iterator[CheckPlace]:
    """The start at later times, and other starts, as many as there are; the first is the start
    itself.  Under conditions that move with time all of them are at its time.
    """
    yield first
    base = first.base
    moves = isinstance(base, BoundBody) and base.rheonomic
    if knows_time(base) and not moves:
        yield from filter(_serves, [replace(first, name="the start, late", t0=first.t0 + LATE[1])])
    starts = [*_others(base.at_time(first.t0) if moves else base, first.start)]
    for i, (name, state) in enumerate(starts):
        late = first.t0 + LATE[0 if moves else (i + 1) % len(LATE)]
        candidates = (replace(first, name=name, start=state, t0=t) for t in (late, first.t0))
        yield from itertools.islice(filter(_serves, candidates), 1)


def _serves(place: CheckPlace) -> bool:
    """Whether the system is defined at a place, and in motion."""
    try:
        with np.errstate(all="ignore"):
            rate = flat(place.base.rate(place.t0, place.start))
            if not np.isfinite(rate).all() or not size(rate):
                return False
            end = place.exact(0.25 * place.unit)
            good = all(np.isfinite(flat(x)).all() for x in end.parts.values() if x is not None)
            return good and place.begin is not None
    except (LiemechError, ArithmeticError, ValueError):
        return False


FACTORS = (
    ("turned back", -1.0),
    ("larger", 5.0),
    ("smaller", 0.2),
    ("much larger", 40.0),
    ("much larger, turned", -40.0),
)
"""Names of other starts, and the factors of the components of the start."""


def _others(system: Any, start: Any) -> Iterator[tuple[str, Any]]:
    """Other starts of the same kind: turned, smaller, larger, with other signs."""
    rng = np.random.default_rng(3)
    make = _maker(system)
    if make is None:
        return
    for name, factor in FACTORS:
        try:
            yield name, make(start, factor, rng)
        except (LiemechError, ArithmeticError, ValueError):
            continue


def _maker(system: Any) -> Callable[[Any, float, np.random.Generator], Any] | None:
    """A function of a start, a factor and random numbers that makes another start."""

    def turned(g: Any, group: Any, rng: np.random.Generator, angle: float) -> Any:
        xi = rng.normal(size=group.dim)
        return group.compose(small(np.asarray(g)), group.exp(small(angle * xi / size(xi))))

    def mixed(x: Any, factor: float, rng: np.random.Generator) -> np.ndarray:
        """The components of x times a factor, a little at random added to each."""
        x = flat(x)
        return np.asarray(factor * (x + 0.3 * (size(x) or 1.0) / x.size**0.5 * rng.normal(size=x.size)))

    def canonical(start: Any, factor: float, rng: np.random.Generator) -> Any:
        p = mixed(start.p, abs(factor) if factor != -1.0 else -1.0, rng)
        return CanonicalState(small(mixed(start.q, factor, rng)), small(p))

    def constrained(start: Any, factor: float, rng: np.random.Generator) -> Any:
        q = small(mixed(start.q, 1.0, rng))
        on_manifold = system.across(q, start.p, q)
        return CanonicalState(on_manifold, system.tangent(on_manifold, small(mixed(start.p, factor, rng))))

    def body(start: Any, factor: float, rng: np.random.Generator) -> Any:
        mu = small(mixed(start.mu, factor, rng))
        if start.g is None:
            return BodyState(mu)
        free = isinstance(system, LiePoissonMotion)
        group = system.group if free else system.configurations
        return BodyState(mu, turned(start.g, group, rng, 1.0 if abs(factor) <= 1.0 else 2.0))

    def bound(start: Any, factor: float, rng: np.random.Generator) -> Any:
        g = turned(start.g, system.configurations, rng, 0.3)
        states = system.consistent(mixed(start.mu, factor, rng), np.asarray(g))
        return members(states)[0]

    def poisson(start: Any, factor: float, rng: np.random.Generator) -> Any:
        y = mixed(start.y, factor, rng)
        return members(system.state(y))[0]

    def position(start: Any, factor: float, rng: np.random.Generator) -> Any:
        return GroupState(turned(start.g, system.group, rng, min(3.0, abs(factor) + 0.5)))

    def point(start: Any, factor: float, rng: np.random.Generator) -> Any:
        xi = rng.normal(size=system.group.dim)
        return Point(system.action.act(system.group.exp(small(xi)), start.x))

    kinds: tuple[tuple[type, Any], ...] = (
        (BoundBody, bound),
        (LiePoissonMotion, body),
        (CotangentMotion, body),
        (ConstrainedSystem, constrained),
        (PhaseSpace, canonical),
        (VectorField, poisson),
        (GroupEquation, position),
        (HomogeneousEquation, point),
    )
    return next((make for kind, make in kinds if isinstance(system, kind)), None)
