"""Reversible step size control: a symmetric method whose steps follow a time scale, symmetric with
their changes too.
"""

from __future__ import annotations

from typing import Any, ClassVar

from ...errors import IncompatibleSystem, InvalidInput, InvalidTimeScale, require
from ...formulas import Record, plain, record
from ...integrators.free_body.moser_veselov import ExactMoserVeselov
from ...integrators.method import Method
from .clocked import Clocked
from .time_scales import POSITIVE, TimeScale, time_scale


@record
class Controlled(Record):
    """The memory of the controller: that of its method, physical time, z, and the growth
    rate of sigma there.

    kind : of the states that show it.
    """

    kind: Any
    inner: Any
    time: Any
    z: Any
    rate: float


@record
class ReversibleController(Method):
    """Steps of about sigma(y) eps around a symmetric method Phi, for fixed steps eps of a fictive
    time, dt = sigma dtau:

        z = z_n + (eps/2) G(y_n),   y_n+1 = Phi_(eps/z)(y_n),   t_n+1 = t_n + eps/z,   z_n+1 = z + (eps/2) G(y_n+1)

    with G = -(d sigma/dt)/sigma along the motion and z_0 = 1/sigma(y_0); z sigma stays near 1.

    method : any symmetric one, on any system that it accepts; Gauss methods, such as
    RKMK(tableau=tableaus.gauss(2)), where the group is R^n.
    sigma : a time scale such as DistancePower(1.5) or EqualArc(), or a function of parts of the
    state, lambda q: lm.dot(q, q).  Of the order of its method, at physical times; symmetric, and
    reversible where sigma does not change when velocities are turned back.  So the energy of a
    reversible system does not drift, though the steps differ.  Not symplectic.  `integrate` takes
    h = eps.

    Raises InvalidInput if the method is not symmetric, InvalidTimeScale in a step where sigma or z
    is not positive.
    Source: Hairer and Soderlind, SIAM J. Sci. Comput. 26 (2005); Hairer, Lubich, Wanner, VIII.3.2;
    the slides, (3.7) and (3.8), with G(y_n+1) in the last line.
    """

    title: ClassVar[str] = "{0.method.name}, steps by {0.sigma!r}"
    symmetric: ClassVar[bool] = True
    fictive: ClassVar[bool] = True

    method: Method
    sigma: TimeScale

    def __post_init__(self) -> None:
        method: Any = self.method
        require("ReversibleController: method", method, Method, "a method such as StormerVerlet()")
        if not method.symmetric_on(None):
            raise InvalidInput(
                f"ReversibleController: {method!r} is not symmetric, and steps that change "
                "reversibly would not make it so. StormerVerlet(), LieVerlet(), "
                "CovariantVariational(Exponential()) and compositions of them are"
            )
        if isinstance(method, ExactMoserVeselov) or method.fictive:
            raise InvalidInput(f"ReversibleController: {method!r} is for fixed steps")
        object.__setattr__(self, "sigma", time_scale("ReversibleController", self.sigma))
        super().__post_init__()

    @property
    def order(self) -> int:
        return self.method.order  # type: ignore[attr-defined]

    def require(self, system: Any) -> None:
        """A system that the method accepts, and on which it is symmetric."""
        inner = system.system if isinstance(system, Clocked) else system
        self.method.require(inner)
        if not self.method.symmetric_on(inner):
            raise IncompatibleSystem(
                f"{self!r}: {self.method!r} is symmetric on vector spaces, and not on the group of "
                f"{inner!r}; its chart stands at the start of the step. "
                "CovariantVariational(Exponential()), LieVerlet() and the midpoint rule "
                "RKMK(tableau=tableaus.gauss(1)) are"
            )

    def step_warning(self, system: Any, start: Any, h: float) -> str | None:
        return self.method.step_warning(system.system, system.without(start), h / start.z)

    def start(self, system: Any, state: Any, h: float) -> Controlled:
        """The method's own memory beside time, z and the growth rate."""
        if not isinstance(system, Clocked):
            raise IncompatibleSystem(f"{self!r} varies its steps; it cannot be a part of another method, but take one")
        inner, z = system.without(state), plain(state.z)
        rate = self._rate(system, plain(state.time), plain(inner))
        memory = self.method.start(system.system, inner, h / z)
        return Controlled(type(state), memory, state.time, state.z, rate)

    def observe(self, memory: Controlled) -> Any:
        inner = self.method.observe(memory.inner)
        return memory.kind(*[getattr(inner, name) for name in memory.kind.names], memory.time, memory.z)

    def step(self, system: Any, t: float, memory: Controlled, h: float) -> Controlled:
        """Half a step of z, a step of the method, half a step of z."""
        half = memory.z + (0.5 * h) * memory.rate
        z = plain(half)
        if not z > 0.0:
            raise InvalidTimeScale(
                f"ReversibleController: z = {z:g} after half a step of {h:g}, and the physical "
                "step h/z must not change its sign. Sigma grows too "
                f"fast for this step; try {0.25 * h:g}"
            )
        after = self.method.step(system.system, plain(memory.time), memory.inner, h / z)
        time = memory.time + h / z
        rate = self._rate(system, plain(time), plain(self.method.observe(after)))
        return Controlled(memory.kind, after, time, half + (0.5 * h) * rate, rate)

    def _rate(self, system: Any, t: float, state: Any) -> float:
        """-(d sigma/dt)/sigma along the motion."""
        sigma = system.sigma.value_at(system.system, t, state)
        if not sigma > 0.0:
            raise InvalidTimeScale(f"{system.sigma!r} = {sigma:g} at t = {t:g}; {POSITIVE}")
        return -system.sigma.growth(system.system, t, state) / sigma
