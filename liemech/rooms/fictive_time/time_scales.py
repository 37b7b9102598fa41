"""Time scales: how much physical time a unit of fictive time takes, as a function of the state;
small where the motion is fast.
"""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable
from numbers import Real
from typing import Any, ClassVar

from ...errors import IncompatibleSystem, InvalidInput, InvalidTimeScale, InvalidType, LiemechError, undefined
from ...formulas import Record, Vec, derivative, dot, gradient, norm, record, sqrt, vec
from ...formulas.classes.derived import derived
from ...groups.retractions import Exponential
from ...systems.canonical import CanonicalState, PhaseSpace
from ...systems.cotangent import CotangentMotion
from ...systems.lie_poisson import BodyState, LiePoissonMotion
from ...systems.separable import SeparableSystem
from ...systems.system import State, System, member
from ..constraints.constrained import ConstrainedSystem

POSITIVE = "a time scale must be positive wherever the motion comes"


@record
class TimeScale(Record):
    """The sigma of a time transformation, dt = sigma(state) dtau: positive, and small where the
    motion is fast.

    1. A subclass writes `value(system, state)`, as a formula.  If that depends on some parts of the state only,
    it names them, such as `parts = ("q",)`; what moves the others is then not computed.
    2. It may write `slope`, the gradient of such a sigma(q), in closed form; and `value_at(system, t, state)`, if it
    depends on time too, as velocities of driven systems do.

    A function does too: `lambda q: lm.dot(q, q)`, whose arguments are named as the parts of the
    state are.
    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VIII.2.
    """

    parts: ClassVar[tuple[str, ...] | None] = None  # all

    def __init_subclass__(cls, **options: Any) -> None:
        """Parts that a base names are those of its own value: of another one they are all, unless it names them too."""
        super().__init_subclass__(**options)
        home = next(base for base in cls.__mro__[1:] if "value" in vars(base))
        if home is not TimeScale and "value" in vars(cls) and "parts" not in vars(cls):
            cls.parts = None

    @property
    def positions(self) -> bool:
        """Whether sigma depends on the positions of a canonical system alone."""
        return self.parts == ("q",)

    def value(self, system: Any, state: Any) -> float:
        """sigma, in s for each unit of fictive time."""
        raise undefined(self, "value")

    @derived
    def value_at(self, system: Any, t: float, state: Any) -> float:
        """sigma at time t; `value`, unless a subclass depends on time."""
        return self.value(system, state)

    @derived
    def slope(self, system: Any, q: Vec) -> Vec:
        """d sigma/dq of a sigma that depends on positions alone, (n,).  q : (n,)."""
        return gradient(lambda x: self.value(system, CanonicalState(x, x)), q)

    @derived
    def growth(self, system: Any, t: float, state: Any) -> float:
        """d sigma/dt along the motion."""
        if not isinstance(state, CanonicalState):
            return derivative(lambda s: self.value_at(system, t + s, self._later(system, t, state, s)), 0.0)
        v = system.velocity(*_point(system, t, state))
        if self.positions:
            return derivative(lambda x: self.value(system, CanonicalState(x, x)), state.q, v)
        f = system.force(*_point(system, t, state))
        if isinstance(system, ConstrainedSystem) and (self.parts is None or "p" in self.parts):
            f = f + system.constraint_force(state.q, state.p)
        return derivative(lambda s: self.value_at(system, t + s, CanonicalState(state.q + s * v, state.p + s * f)), 0.0)

    def _later(self, system: Any, t: float, state: Any, s: float) -> Any:
        """The state a short time s later, to first order, as far as the parts that count."""
        if not isinstance(state, BodyState):
            return system.displaced(Exponential(), state, s * system.rate(t, state))
        mu, g, free = state.mu, state.g, isinstance(system, LiePoissonMotion)
        group, push = system.group if free else system.configurations, None
        if isinstance(system, CotangentMotion):
            xi, push = system.rates(t, mu, g)
        elif free:
            xi = system.rate(t, state)
        else:  # pushed by a constraint
            xi, push = system.velocity(mu), vec(*[system.rate(t, state)[group.dim + i] for i in range(group.dim)])
        if self.parts is None or "mu" in self.parts:
            force = group.ad_star(xi, mu)
            mu = mu + s * (force if push is None else force + push)
        if g is not None and (self.parts is None or "g" in self.parts):
            g = group.compose_exp(g, s * xi)
        return BodyState(mu, g)

    def bound(self, system: System, start: State) -> TimeScale:
        """This sigma for the motion from a start, on whose energy it may depend.

        Raises IncompatibleSystem for a system it is not made for.
        """
        return self

    def require_positive(self, system: System, t0: float, start: State) -> None:
        """Raise InvalidTimeScale unless sigma is positive where and when a motion starts,
        InvalidType if its value is no number.
        """
        is_ensemble = start.bodies is not None
        for i in range(start.bodies or 1):
            where = f"at the start{f' of body {i}' if is_ensemble else ''}"
            try:
                value: Any = self.value_at(system, t0, member(start, i))
            except LiemechError:
                raise
            except (ArithmeticError, ValueError) as error:
                raise InvalidTimeScale(f"{self!r} has no value {where} ({error}); {POSITIVE}") from None
            if not isinstance(value, Real):
                raise InvalidType(f"{self!r} must be one number; {where} it is {value!r}")
            if not float(value) > 0.0:
                raise InvalidTimeScale(f"{self!r} = {float(value):g} {where}; {POSITIVE}")


@record
class OfState(TimeScale):
    """A function of some parts of the state, by the names of its arguments."""

    function: Callable[..., Any]
    names: tuple[str, ...]

    @property
    def parts(self) -> tuple[str, ...]:  # type: ignore[override]
        """The names of the arguments of sigma."""
        return self.names

    def value(self, system: Any, state: Any) -> float:
        return self.function(*[getattr(state, name) for name in self.names])

    def bound(self, system: System, start: State) -> TimeScale:
        """Raise unless the arguments of sigma are parts of the state."""
        parts = tuple(name for name, x in start.parts.items() if x is not None)
        if not self.names or not set(self.names) <= set(parts):
            raise InvalidInput(
                f"sigma is a function of ({', '.join(self.names)}); its arguments must be parts of "
                f"the state, which has {parts}"
            )
        return super().bound(system, start)

    def __repr__(self) -> str:
        return f"sigma({', '.join(self.names)})"


def _point(system: Any, t: float, state: CanonicalState) -> tuple[Any, ...]:
    """The arguments of formulas of a canonical system, (q, p), or (t, q, p) of a driven one."""
    return (t, state.q, state.p) if system.driven else (state.q, state.p)


def time_scale(owner: str, sigma: Any) -> TimeScale:
    """A time scale, or one made of a function of parts of the state."""
    if isinstance(sigma, TimeScale):
        return sigma
    if callable(sigma) and not isinstance(sigma, type):
        return OfState(sigma, tuple(inspect.signature(sigma).parameters))
    raise InvalidType(
        f"{owner}: sigma is a TimeScale such as DistancePower(1.5), or a function of parts of the "
        f"state such as lambda q: lm.dot(q, q); got {sigma!r}"
    )


@record
class EqualArc(TimeScale):
    """sigma = 1/|f|: steps of equal length on the path in phase space, f = (q', p'); on a group f
    is the velocity xi, in a field with the force, (xi, f).

    It depends on velocities too: for ReversibleController, or for implicit methods.
    Source: Hairer, Lubich, Wanner, VIII.2.1, choice 1 (arclength).
    """

    def value(self, system: Any, state: Any) -> float:
        """1/|f|, of a driven system at t = 0."""
        return self.value_at(system, 0.0, state)

    def value_at(self, system: Any, t: float, state: Any) -> float:
        """The inverse speed 1/|f| at time t."""
        return 1.0 / norm(system.rate(t, state))


@record
class DistancePower(TimeScale):
    """sigma = |q|^power: 3/2 keeps the number of steps for each revolution of an orbit of any size,
    2 gives equal angles.

    Source: Hairer, Lubich, Wanner, VIII.2.1, choice 2; Budd and Piggott, Geometric integration and
    its applications, Handbook of Numerical Analysis XI (2003).
    """

    parts: ClassVar[tuple[str, ...] | None] = ("q",)

    power: float = 1.5

    def value(self, system: Any, state: Any) -> float:
        """The power |q|^power of the distance."""
        return dot(state.q, state.q) ** (0.5 * self.power)

    def slope(self, system: Any, q: Vec) -> Vec:
        """power |q|^(power - 2) q."""
        return (self.power * dot(q, q) ** (0.5 * self.power - 1.0)) * q

    def growth(self, system: Any, t: float, state: Any) -> float:
        """power |q|^(power - 2) q.q'."""
        return dot(self.slope(system, state.q), system.velocity(*_point(system, t, state)))

    def bound(self, system: System, start: State) -> TimeScale:
        """A canonical system, which may be driven."""
        if not isinstance(system, PhaseSpace):
            raise IncompatibleSystem(f"{self!r} is for systems with positions q; {system!r} has none")
        return super().bound(system, start)


@record
class OfEnergy(TimeScale):
    """A sigma that knows the kinetic energy from where it is, as H_0 - V(q); abstract.

    energy : H_0; None for that of the start.
    """

    parts: ClassVar[tuple[str, ...] | None] = ("q",)

    energy: float | None = None

    def bound(self, system: System, start: State) -> TimeScale:
        """For a separable system with the energy of the start."""
        if not isinstance(system, SeparableSystem) or not system.quadratic:
            raise IncompatibleSystem(
                f"{self!r} is for energies T(p) + V(q) with T of second degree, a SeparableSystem; "
                f"{system!r} is none. EqualArc() is for every system, or write a sigma of your own"
            )
        if self.energy is not None:
            return super().bound(system, start)
        if start.bodies is not None:
            raise InvalidInput(
                f"{self!r} takes the energy of one start; the members of an ensemble have several. "
                "Give `energy`, or integrate them one by one"
            )
        scale: TimeScale = dataclasses.replace(self, energy=float(system.energy(**start.parts)))
        return scale.bound(system, start)

    def kinetic(self, system: Any, q: Vec) -> float:
        """H_0 - V(q).  q : (n,)."""
        if self.energy is None:
            raise InvalidInput(f"{self!r} needs the energy of the motion; integrate knows that of its start")
        return self.energy - system.potential(q)


@record
class EqualChange(OfEnergy):
    """sigma = (H_0 - V + dV.M^-1 dV)^(-1/2): equal steps in positions and momenta together, as a
    function of the positions.

    Source: Hairer, Lubich, Wanner, VIII.2.1, choice 3; Huang and Leimkuhler, SIAM J. Sci. Comput.
    18 (1997).
    """

    def value(self, system: Any, state: Any) -> float:
        """(H_0 - V + dV.M^-1 dV)^(-1/2)."""
        f = system.force(state.q, state.p)
        pull = dot(f, system.velocity(state.q, f) - system.velocity(state.q, 0.0 * f))
        return 1.0 / sqrt(self.kinetic(system, state.q) + pull)


@record
class EqualPath(OfEnergy):
    """sigma = (H_0 - V)^(-1/2): equal steps in the positions.  It has no value at a turning point,
    where a motion comes to rest.

    Source: Hairer, Lubich, Wanner, VIII.2.1, choice 4.
    """

    def value(self, system: Any, state: Any) -> float:
        """The inverse root (H_0 - V)^(-1/2) of the kinetic energy."""
        return 1.0 / sqrt(self.kinetic(system, state.q))
