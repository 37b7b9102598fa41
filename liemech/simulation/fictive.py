"""Where runs in fictive time began, and where they stand."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import Any

from ..errors import IncompatibleSystem
from ..formulas.frozen import frozen
from ..formulas.pytree import layout_of
from ..integrators.composition import Composition
from ..systems.clocked import Clocked
from ..systems.sundman import InFictiveTime
from ..systems.system import State, member, small_state, state_of
from .carry import Carry, Ended
from .events import NO_EVENTS, Met
from .prepared import Steps


@frozen(eq=False)
class Origin:
    """Where a run began: the system as it was given, the method, and the start, on whose energy
    time scales may depend.
    """

    given: Any
    method: Any
    start: State

    @cached_property
    def whole(self) -> Any:
        """The system whose state carries physical time along, bound to the start."""
        given, method = self.given, self.method
        if isinstance(given, InFictiveTime):
            if method.fictive:
                raise IncompatibleSystem(
                    f"integrate: {method!r} varies its steps, and so "
                    f"does {given!r}; one of them will do"
                )
            whole = given.bound(self.start)
            method.require(whole)
            return whole
        while isinstance(method, Composition):
            method = method.base
        return Clocked(given, method.sigma.bound(given, self.start))

    def begun(self, t0: float) -> Any:
        """The start with its clock, at the time t0; InvalidTimeScale unless sigma is positive
        there.
        """
        whole = self.whole
        whole.sigma.require_positive(whole.system, t0, self.start)
        return whole.extended(self.start, t0)

    def steps(self, plan: Steps) -> Steps:
        """The steps of a plan, of the system with its clock; the plan keeps what is laid out and
        compiled for them, as long as the origin is there.
        """
        kept = plan.of_origins.get(self)
        if kept is None:
            layout = layout_of(self.whole)
            like = plan.of_layouts.get(layout)
            shapes = [] if like is None else [*like.shapes.items()]
            shared = {key: shape.of_system(self.whole) for key, shape in shapes}
            made = replace(plan, system=self.whole, shapes=shared, clock="tau")
            kept = plan.of_origins.setdefault(self, made)
            plan.of_layouts[layout] = kept  # the last one knows most
        return kept

    def __getstate__(self) -> dict[str, Any]:
        """Without the system that is bound to the start."""
        return {"given": self.given, "method": self.method, "start": self.start}


@frozen(eq=False)
class FictiveCarry:
    """Where a run in fictive time stands: at the end of its last whole step, from which it goes on
    as if it had never stopped.

    inner : what the method carries along there, of the system with its clock, whose time is the
    fictive one.
    ahead : the last sample, with its clock, if it lies inside of the next step, as at a t_end.
    tau : its fictive time.  met : as of a Carry.
    """

    origin: Origin
    inner: Carry
    ahead: Any = None
    tau: Any = None
    met: Met = NO_EVENTS

    def __post_init__(self) -> None:
        if self.tau is None:
            object.__setattr__(self, "tau", self.inner.t)

    @property
    def bodies(self) -> int | None:
        """How many members an ensemble has."""
        return self.inner.bodies

    @property
    def step(self) -> int:
        """How many whole steps were taken."""
        return self.inner.step

    @property
    def t(self) -> Any:
        """The physical time of the last sample, in s; of an ensemble those of the members,
        (bodies,).
        """
        t = self._apart[0][0]
        return float(t) if self.bodies is None else t

    @cached_property
    def state(self) -> Any:
        """The last sample."""
        made = small_state if self.bodies is None else state_of
        return made(type(self.origin.start), {name: x[0] for name, x in self._apart[1].items()})

    def member(self, i: int) -> Any:
        """The carry of a body of an ensemble, or where it has ended."""
        if self.bodies is None:
            return self
        return _member_of(self.origin, i, self.inner.member(i), self.inner.h)

    @property
    def ended(self) -> list[int]:
        """The bodies that go no further."""
        return self.inner.ended

    @cached_property
    def _apart(self) -> Any:
        sample = self.inner.state if self.ahead is None else self.ahead
        return self.origin.whole.apart({name: x[None] for name, x in sample.arrays.items()})


def _member_of(origin: Origin, i: int, inner: Any, h: Any) -> Any:
    """The carry of a body of an ensemble, or where it has ended."""
    own = Origin(origin.given, origin.method, member(origin.start, i))
    if isinstance(inner, Carry):
        return FictiveCarry(own, inner)
    arrays = {name: x[None] for name, x in inner.state.arrays.items()}
    t, states, z = own.whole.apart(arrays)
    state = small_state(type(own.start), {name: x[0] for name, x in states.items()})
    tau, last = inner.steps * h, None if z is None else float(z[0])
    return Ended(state, float(t[0]), inner.steps, inner.error, tau, last, own)
