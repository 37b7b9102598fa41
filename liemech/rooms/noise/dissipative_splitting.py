"""Strang's splitting of dissipation and motion."""

from __future__ import annotations

from typing import Any, ClassVar

from ...errors import IncompatibleSystem, InvalidInput, InvalidType
from ...formulas import record
from ...integrators.free_body.midpoint import Isospectral
from ...integrators.memory import Memory, Remembering
from ...integrators.method import Method
from ...systems.lie_poisson import BodyState
from .dissipative import Dissipative


@record
class DissipativeSplitting(Remembering):
    """Strang's splitting of a `Dissipative` system: half a step of damping in closed form, a step of the motion
    without it, and half a step of damping.

        Phi_h = D_h/2 o M_h o D_h/2,   D_t the flow of mu' = D(mu)

    method : for the motion, of order 2 or more.
    Order 2; it is dissipative: what damping takes, and nothing else, is lost, Casimirs too.  Steps go forwards
    in time.  Raises InvalidInput for h < 0, and what the method raises.
    Source: Strang, SIAM J. Numer. Anal. 5 (1968) 506; Hairer, Lubich, Wanner, II.5.
    """

    title: ClassVar[str] = "{0.method.name}, damped"
    dissipative: ClassVar[bool] = True

    method: Method = Isospectral(2)

    def __post_init__(self) -> None:
        method: Any = self.method
        if not isinstance(self.method, Method):
            raise InvalidType(f"DissipativeSplitting: method must be a method such as Isospectral(2); got {method!r}")
        if method.order < 2:
            raise InvalidInput(f"DissipativeSplitting: {method!r} is of order 1; take one of order 2")
        super().__post_init__()

    @property
    def order(self) -> int:
        """2, whatever the method for the motion."""
        return 2

    def require(self, system: Any) -> None:
        """A Dissipative system, whose motion the method accepts."""
        if not isinstance(system, Dissipative):
            raise IncompatibleSystem(
                f"{self!r} is for systems with dissipation, such as lm.models.ViscousSphere; got {system!r}. "
                f"Without it, use {self.method!r}"
            )
        self.method.require(system.system)

    def step_warning(self, system: Any, start: BodyState, h: float) -> str | None:
        return self.method.step_warning(system.system, start, h)

    def start(self, system: Any, state: BodyState, h: float) -> Memory:
        """The state and the past of the method.  Raises InvalidInput backwards in time."""
        if h < 0.0:
            raise InvalidInput("DissipativeSplitting: damping goes forwards in time, h > 0")
        return super().start(system, state, h)

    def beginning(self, system: Any, state: BodyState, h: float) -> Any:
        return self.method.past(self.method.start(system.system, state, h))

    def step(self, system: Any, t: float, memory: Memory, h: float) -> Memory:
        """Half the damping, the motion, half the damping."""
        method, body = self.method, system.system  # type: Any, Any
        before = BodyState(system.damped(memory.state.mu, 0.5 * h), None)
        after = method.step(body, t, method.resume(body, before, memory.past, h), h)
        mu = system.damped(method.observe(after).mu, 0.5 * h)
        return Memory(BodyState(mu, None), memory.node, method.past(after))
