"""Where the laws of a system are checked: at given states, or at random ones."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..errors import InconsistentState, InvalidInput, LiemechError, NoConvergence
from ..formulas.broadcasting import small
from ..retractions import Exponential
from ..systems.canonical import CanonicalState, CanonicalSystem, HamiltonianSystem
from ..systems.constrained import ConstrainedSystem
from ..systems.group_equation import GroupEquation, Position
from ..systems.homogeneous_equation import HomogeneousEquation, Point
from ..systems.lie_poisson import BodyState, LiePoissonSystem
from ..systems.mechanical import MechanicalSystem
from ..systems.poisson import PoissonState, PoissonSystem
from ..systems.system import State, System
from ..systems.vector_field import VectorField
from .sample_points import STENCIL, STEP, flat, size
from .seeds import generator

PLACES = 5
"""How many states are drawn."""

CENTRAL = *(-weight for _, weight in reversed(STENCIL)), 0.0, *(weight for _, weight in STENCIL)
"""The same differences for nine equidistant values in a row."""


@dataclass(frozen=True)
class AtState:
    """A state of a system, with small arrays, and a time."""

    name: str
    system: Any
    state: Any
    t: float

    @property
    def dim(self) -> int:
        return self.system.group.dim

    @cached_property
    def rate(self) -> Any:
        """The velocity of the motion here."""
        return self.system.rate(self.t, self.state)

    @cached_property
    def pace(self) -> float:
        """How fast the motion is, relative to where it is: the inverse of a time."""
        return pace(self.system, self.t, self.state)

    @cached_property
    def nearby(self) -> list[Any]:
        """States before and after this one, at equal times, along the velocity here: the motion to
        first order.
        """
        times = [k * self.unit for k in range(-4, 5)]
        return [
            self.system.displaced(Exponential(), self.state, time * self.rate) for time in times
        ]

    @property
    def unit(self) -> float:
        """The time between them."""
        return 0.25 * STEP / (self.pace or 1.0)

    def along(self, values: list[Any]) -> tuple[np.ndarray, float]:
        """The derivative along the motion of a quantity with these values at the states nearby, and
        the size of its rounding.
        """
        found = sum(w * flat(v) for w, v in zip(CENTRAL, values, strict=True)) / self.unit
        return np.asarray(found), max(map(size, values)) / self.unit

    def __str__(self) -> str:
        parts = (
            f"{n} = ({', '.join(f'{c:.3g}' for c in flat(x)[:6])})"
            for n, x in self.state.parts.items()
            if x is not None
        )
        return f"{self.name}, {', '.join(parts)}"


def pace(system: Any, t: float, state: Any) -> float:
    """The rate of change relative to what changes, and of turning if the group turns: the inverse
    of a time.
    """
    rate = system.rate(t, state)
    group = system.group
    found = (
        max(size(group.ad(rate, e)) for e in np.eye(group.dim).tolist()) if group.dim <= 32 else 0.0
    )
    change, large = (flat(x) for x in system.variation(state, rate))
    return max(float(found), float(np.linalg.norm(change)) / (float(np.linalg.norm(large)) or 1.0))


def sample_states(system: System, states: State | None, seed: int) -> list[AtState]:
    """The given states, or random ones at which the formulas are defined; as many as are found."""
    if states is not None:
        return [
            AtState(f"state {i}", system, state, 0.0) for i, state in enumerate(members(states))
        ]
    rng, reason = generator("check_system", seed), ""
    found: list[AtState] = []
    for _ in range(4 * PLACES):
        at = AtState("random", system, random_state(system, rng), float(rng.normal()))
        if len(found) < PLACES:
            undefined = why_undefined(at)
            found += [] if undefined else [at]
            reason = undefined or reason
    if not found:
        raise InvalidInput(
            f"check_system: {system!r} is not defined at random states ({reason}); "
            "give some, states=system.state(...)"
        )
    return found


def members(states: State) -> list[Any]:
    """The members of an ensemble, or the one state, with small arrays."""
    if states.bodies is None:
        return [
            type(states)(
                *(None if x is None else small(np.asarray(x)) for x in states.parts.values())
            )
        ]
    rows = range(states.bodies)
    return [
        type(states)(
            *(None if x is None else small(np.asarray(x[i])) for x in states.parts.values())
        )
        for i in rows
    ]


def random_state(system: Any, rng: np.random.Generator) -> Any:
    """A state with normally distributed coordinates, and a random element of the group."""
    if isinstance(system, (LiePoissonSystem, MechanicalSystem)):
        group = system.group if isinstance(system, LiePoissonSystem) else system.configurations
        return BodyState(small(rng.normal(size=group.dim)), small(np.asarray(group.random(rng))))
    if isinstance(system, ConstrainedSystem):
        return _consistent(system, rng)
    if isinstance(system, HamiltonianSystem):
        return CanonicalState(*(small(x) for x in rng.normal(size=(2, system.degrees))))
    if isinstance(system, VectorField):
        y = rng.normal(size=system.dim)
        try:
            return PoissonState(small(np.asarray(system.state(y).y)))
        except InvalidInput:
            return PoissonState(small(0.5 + np.abs(y)))
    if isinstance(system, GroupEquation):
        return Position(small(np.asarray(system.group.random(rng))))
    if isinstance(system, HomogeneousEquation):
        return Point(small(np.asarray(system.action.random(rng))))
    raise InvalidInput(
        f"check_system: how states of {system!r} are drawn is not "
        "known; give some, states=system.state(...)"
    )


def _consistent(system: ConstrainedSystem, rng: np.random.Generator) -> CanonicalState:
    """A state on the constraints, near a random one; if none is found, for what is wrong is for the
    laws to tell, a random one.
    """
    for _ in range(4 * PLACES):
        q, p = (small(x) for x in rng.normal(size=(2, system.degrees)))
        try:
            there = system.across(q, p, q)
            return CanonicalState(there, system.tangent(there, p))
        except (NoConvergence, InconsistentState, ArithmeticError, ValueError):
            pass
    return CanonicalState(q, p)


def why_undefined(at: AtState) -> str:
    """Why velocity or energy have no value here; empty if they have, and if what is wrong is for
    the laws to tell.
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
        if isinstance(system, (MechanicalSystem, CanonicalSystem, PoissonSystem))
        else 0.0
    )
