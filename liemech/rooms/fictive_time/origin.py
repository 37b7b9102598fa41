"""Origins and carries of runs in fictive time."""

from __future__ import annotations

from dataclasses import field, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from ...errors import IncompatibleSystem
from ...formulas.classes.frozen import frozen
from ...formulas.classes.layouts import layout_of
from ...integrators.composition import Composition
from ...simulation.between.dense import unpacked
from ...simulation.compiled.prepared import Steps
from ...simulation.runs.carry import Carry, one_or_all
from ...systems.system import State, member, small_state, state_of
from .clocked import Clocked
from .sundman import InFictiveTime


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
        system, method = self.given, self.method
        if isinstance(system, InFictiveTime):
            if method.fictive:
                raise IncompatibleSystem(
                    f"integrate: {method!r} varies its steps, and so does {system!r}; one of them will do"
                )
            whole = system.bound(self.start)
            method.require(whole)
            return whole
        while isinstance(method, Composition):
            method = method.base
        return Clocked(system, method.sigma.bound(system, self.start))

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
        planned = plan.of_origins.get(self)
        if planned is None:
            layout = layout_of(self.whole)
            like = plan.of_layouts.get(layout)
            shapes = [] if like is None else [*like.shapes.items()]
            shared = {key: shape.of_system(self.whole) for key, shape in shapes}
            fresh = replace(plan, system=self.whole, shapes=shared, clock="tau")
            planned = plan.of_origins.setdefault(self, fresh)
            plan.of_layouts[layout] = planned  # the last one knows most
        return planned

    def __getstate__(self) -> dict[str, Any]:
        """Without the system that is bound to the start."""
        return {"given": self.given, "method": self.method, "start": self.start}


@frozen(eq=False)
class FictiveCarry:
    """Where a run in fictive time stands: at the end of its last whole step, from which it goes on
    as if it had never stopped.
    """

    fictive: ClassVar[bool] = True

    origin: Any  # an Origin; a tuple of them for an ensemble whose bodies have different ones
    inner: Carry  # the carry of the system with its clock, whose time is the fictive one
    # the last samples, if they lie inside of the next step, as at a t_end: (n,) or (n, bodies) physical time, numbers of
    # the state with its clock, and fictive time
    here: np.ndarray | None = None
    # by body, the number of zeros of every event
    met: dict[int, Any] = field(default_factory=dict, repr=False)

    def moved(self, inner: Carry) -> FictiveCarry:
        """The carry of the run at the end of a later step, where its method stands with `inner`."""
        return FictiveCarry(self.origin, inner, met=self.met)

    @property
    def bodies(self) -> int | None:
        """The number of members of an ensemble; None for one body."""
        return self.inner.bodies

    @property
    def step(self) -> int:
        """The number of whole steps taken."""
        return self.inner.step

    @property
    def standing(self) -> np.ndarray:
        """`here`, also of an ensemble that stands at the ends of steps."""
        if self.here is not None:
            return self.here
        lead = self.inner.last.shape[1:]
        t, tau = (np.broadcast_to(x, lead)[None] for x in (self.t, self.tau))
        return np.concatenate([t, self.inner.last, tau])

    @property
    def tau(self) -> Any:
        """The fictive time of the last sample."""
        return self.inner.t if self.here is None else one_or_all(self.here[-1])

    @property
    def t(self) -> Any:
        """The physical time of the last sample, in s; of an ensemble those of the members,
        (bodies,).
        """
        t = self._apart[0] if self.here is None else self.here[0]
        return one_or_all(t)

    @cached_property
    def state(self) -> Any:
        """The state of the last sample, in physical time."""
        make = small_state if self.bodies is None else state_of
        return make(self._kind, self._apart[1])

    def member(self, i: int) -> Any:
        """The carry of one body."""
        if self.bodies is None:
            return self
        last = None if self.here is None else self.here[:, i]
        zeros = {0: self.met[i]} if i in self.met else {}
        return FictiveCarry(origin_of(self.origin, i), self.inner.member(i), last, zeros)

    @property
    def members(self) -> tuple[Any, ...]:
        """The carries of all bodies."""
        return tuple([self.member(i) for i in range(self.bodies or 1)])

    @property
    def _first(self) -> Origin:
        return self.origin[0] if isinstance(self.origin, tuple) else self.origin

    @property
    def _kind(self) -> Any:
        return type(self._first.start)

    @cached_property
    def _apart(self) -> Any:
        """Time, parts of the state, and z."""
        inner, last = self.inner.state, self.here
        parts = inner.arrays if last is None else unpacked(layout_of(member(inner, 0)), last[1:-1].T)
        t, states, z = self._first.whole.apart({name: x[None] for name, x in parts.items()})
        return t[0], {name: x[0] for name, x in states.items()}, None if z is None else z[0]

    def __getstate__(self) -> dict[str, Any]:
        """The fields of the record, without what is derived from them."""
        return {name: vars(self)[name] for name in ("origin", "inner", "here", "met")}


def origin_of(origin: Any, i: int) -> Origin:
    """The origin of body i, of a tuple of origins or of the one of an ensemble."""
    if isinstance(origin, tuple):
        return origin[i]
    return Origin(origin.given, origin.method, member(origin.start, i))
