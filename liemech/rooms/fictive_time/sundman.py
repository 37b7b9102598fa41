"""Time transformations of any equation: a fictive time in which the motion is even, with physical
time carried along.
"""

from __future__ import annotations

import dataclasses
from typing import Any, ClassVar, final

import numpy as np

from ...errors import IncompatibleSystem, OrderWarning, undefined, warn
from ...formulas import Vec, record, vec
from ...formulas.classes.remembered import shared_property
from ...groups.composed.product import ProductGroup
from ...groups.lie_group import LieGroup
from ...groups.retractions import Retraction
from ...groups.vector_space import VectorSpace
from ...systems.in_time.inputs import inputs
from ...systems.system import State, System
from .clocked import ClockedState, clocked
from .time_scales import TimeScale, time_scale


@record
class InFictiveTime(System):
    """A system that moves in a fictive time tau, with its physical time in its state; abstract.

    system : the one that is transformed; runs begin from its states, and show them.
    A subclass has `sigma`, dt/dtau on the motion, and writes `extended`, `apart` and `clock`.
    """

    fictive: ClassVar[bool] = True

    system: System

    def __post_init__(self) -> None:
        super().__post_init__()
        if any(table.jumping > 0.0 for table in inputs(self.system)):
            warn(
                f"{type(self).__name__}: an input of {self.system!r} jumps; steps in fictive time "
                "are not cut there and lose their order, for the physical time of a jump is no time "
                "of theirs. ReversibleController(method, sigma) cuts its steps",
                OrderWarning,
            )

    def bound(self, start: Any) -> Any:
        """The system for the motion from a start."""
        return self

    def extended(self, start: Any, t0: float) -> Any:
        """A start of the system, or an ensemble of them, with its time."""
        raise undefined(self, "extended")

    def apart(self, states: dict[str, np.ndarray]) -> tuple[np.ndarray, dict[str, np.ndarray], np.ndarray | None]:
        """The samples taken apart: the times, and the parts of the states of the system itself."""
        raise undefined(self, "apart")

    def clock(self, state: Any) -> Any:
        """The physical time of a state."""
        raise undefined(self, "clock")

    def of_tangent(self, components: int) -> list[int]:
        """The places of the components of a state with its clock, in the order: the system's, then the time's."""
        return [*range(components)]


@record
class SundmanTransformed(InFictiveTime):
    """Any equation in a fictive time tau, dt = sigma dtau:

        y' = sigma(y) f(t, y),   t' = sigma(y)

    The points of the motion are the same, fixed steps of tau are steps of about sigma h in t.
    system : any, on groups too, driven or not.  sigma : a TimeScale such as EqualArc(), or a
    function of parts of the state.

    Methods for every system step it, `RKMK(order=4)` or Gauss methods.  The transformed equation is
    reversible if the given one is and sigma does not tell the direction, sigma(rho y) = sigma(y).
    It is Hamiltonian only if sigma is a function of the energy: TimeTransformed is for symplectic
    methods, ReversibleController for symmetric ones on systems of their own.
    `integrate` takes a start of the system itself and h in fictive time.

    Raises IncompatibleSystem for a system that is in a fictive time already.
    Source: Sundman, Acta Math. 36 (1913), 105; Hairer, Lubich, Wanner, VIII.2; the slides, (3.1).
    """

    alternatives: ClassVar[str] = (
        "RKMK accepts every system; TimeTransformed(system, sigma) is for symplectic methods, "
        "ReversibleController(method, sigma) for symmetric ones"
    )

    sigma: TimeScale

    def __post_init__(self) -> None:
        system: Any = self.system
        if not isinstance(system, System) or system.fictive:
            raise IncompatibleSystem(
                f"{type(self).__name__} is for a system such as Kepler() that is not in a fictive "
                f"time yet; got {system!r}"
            )
        object.__setattr__(self, "sigma", time_scale(type(self).__name__, self.sigma))
        super().__post_init__()

    def bound(self, start: Any) -> SundmanTransformed:
        return dataclasses.replace(self, sigma=self.sigma.bound(self.system, start))

    # ---------------------------------------------------------------- how it moves

    @property
    def side(self) -> str:  # type: ignore[override]
        return self.system.side

    @shared_property
    def group(self) -> LieGroup:
        """The group of the system, and R for the time."""
        group = self.system.group
        if isinstance(group, VectorSpace):
            return VectorSpace(group.dim + 1)
        return ProductGroup(group, VectorSpace(1))

    @final
    def rate(self, t: float, state: Any) -> Vec:
        """The rates by the fictive time, (sigma f, sigma), (dim + 1,)."""
        inner = state.without_clock()
        scale = self.sigma.value_at(self.system, state.time, inner)
        return vec(*(scale * self.system.rate(state.time, inner)), scale)

    @final
    def displaced(self, retraction: Retraction, state: Any, omega: Vec) -> Any:
        """The state of the system displaced, and t + the last component."""
        n = self.system.group.dim
        moved = self.system.displaced(retraction, state.without_clock(), omega[:n])
        parts = [getattr(moved, name) for name in state.names]
        return type(state)(*parts, state.time + omega[n])

    def essential_part(self, state: Any) -> Any:
        """The arguments of the motion: time too."""
        inner = self.system.essential_part(state.without_clock())
        return type(state)(*[getattr(inner, name) for name in state.names], state.time)

    @final
    def variation(self, state: Any, omega: Vec) -> tuple[Vec, Vec]:
        n = self.system.group.dim
        change, large = self.system.variation(state.without_clock(), omega[:n])
        return vec(*change, omega[n]), vec(*large, abs(state.time))

    # ---------------------------------------------------------------- starts and samples

    @final
    def state(self, *parts: Any, **named: Any) -> State:
        """A start for `integrate`: a state of the system itself."""
        system: Any = self.system
        return system.state(*parts, **named)

    def clock(self, state: ClockedState) -> Any:
        return state.time  # type: ignore[attr-defined]

    def extended(self, start: State, t0: float) -> Any:
        """A start with its time, for an ensemble too."""
        kind: Any = type(start)
        time: Any = t0 if start.bodies is None else np.full(start.bodies, t0)
        return clocked(kind, ("time",))(*start.parts.values(), time)

    def apart(self, states: dict[str, np.ndarray]) -> tuple[np.ndarray, dict[str, np.ndarray], None]:
        """The samples taken apart: the times, and the parts of the states."""
        parts = dict(states)
        return parts.pop("time"), parts, None
