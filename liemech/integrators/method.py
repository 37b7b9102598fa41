"""Methods: data, claims, and one pure step."""

from __future__ import annotations

from typing import Any, ClassVar

from ..errors import IncompatibleSystem, InvalidType, undefined
from ..formulas import Record, Vec, dot, record, sqrt, vec
from ..formulas.classes.overriding import theirs
from ..formulas.classes.records import fields_of
from ..formulas.numbers.bases import InMemory
from ..groups.retractions import Retraction
from ..systems.system import State, System, lies_in_memory
from .orders import require_order


@record
class Method(Record):
    """A one-step method; subclass it to write your own.

    must:     `step`, and the claims `order`, `symmetric`, `symplectic`
    may:      `needs` and `require`, what systems it accepts; `orders`, between which a field `order` chooses;
              a field `retraction`, which must fit the group; `start`, `observe`, `past`, `resume`, a memory
              from step to step;
              `error_order` with an adaptive `trial`, which may shorten its step (`shortens`), and its dense
              output; `analytic`, steps that are power series in time; `step_warning`; `name`
    follows:  `integrate` and whoever else owns a loop call `start` once and `step` again and again

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., II.1 and V.
    """

    symmetric: ClassVar[bool] = False
    symplectic: ClassVar[bool] = False
    # if symplectic: on coadjoint orbits alone, and not on T*G, where the elements move too?
    of_momenta: ClassVar[bool] = False
    needs: ClassVar[tuple[str, ...]] = ()
    orders: ClassVar[tuple[int, ...]] = ()  # between which `order` chooses; (): it is no choice among few
    # are its steps those of a fictive time, and is physical time carried along?
    fictive: ClassVar[bool] = False
    # does a trial make its step as long as the tolerance allows, so that none is too long?
    shortens: ClassVar[bool] = False
    # is a step a power series in time, so that it sees an input from where it begins only?
    analytic: ClassVar[bool] = False
    # does it need every number written out, for derivatives or Jacobians?
    writes_out: ClassVar[bool] = False
    # does a step see that the energy changes within it?
    timed: ClassVar[bool] = False
    # does a step draw random numbers, which are known at its ends only?
    noisy: ClassVar[bool] = False
    # does a step move what a system loses by damping, too?
    dissipative: ClassVar[bool] = False
    # does a step add to the state, so that it is worth to remember what rounding takes from the sum?
    adds: ClassVar[bool] = True

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.orders:
            require_order(self, self.orders)
        for name, field in fields_of(self).items():
            if name == "retraction" and not isinstance(field, Retraction):
                raise InvalidType(
                    f"{type(self).__name__}: retraction must be Exponential(), Cayley() or one of yours; got {field!r}"
                )

    def symmetric_on(self, system: Any) -> bool:
        """Whether the method is symmetric on a system, or on some system if that is None: by default as it claims."""
        return self.symmetric

    @property
    def error_order(self) -> int:
        """The order of the error estimate plus one, by which adaptive steps are chosen; 0 if there is none."""
        return 0

    @property
    def name(self) -> str:
        """A short name for tables and pictures, by the `title` of the class."""
        chart = type(getattr(self, "retraction", None)).__name__
        return self.title.format(self, chart=chart)

    title: ClassVar[str] = "{0!r}"  # the name, with fields of the method {0}, and the class of its retraction {chart}
    joins: ClassVar[bool] = False  # does its last motion wait for the first one of the next step?
    together: ClassVar[bool] = False  # does it step all sites of a system at once, not one by one?
    settles: ClassVar[bool] = False  # is what is shown of all sites found where it is looked at?
    looked_into: ClassVar[bool] = True  # does the memory before a step of all sites stay beside the one after it?
    place_of_site: ClassVar[Any] = None  # of every site the one in memory, if they lie in another order

    def step(self, system: Any, t: float, state: Any, h: float) -> Any:
        """The state after one step of length h from time t: a formula, without side effects."""
        raise undefined(self, "step")

    def first_velocity(self, system: Any, t: float, state: Any, rtol: float, atol: float) -> tuple[Vec, float, float]:
        """The velocity at a state, and the sizes over the tolerance of what it changes in a second and
        of what is there: what the first adaptive step is found from.
        """
        xi = system.rate(t, system.essential_part(state))
        return xi, *sizes(system, state, xi, rtol, atol)

    def change_of_velocity(
        self, system: Any, t: float, state: Any, xi: Vec, h: float, rtol: float, atol: float
    ) -> float:
        """The size, over the tolerance, of the change of the velocity in an Euler step."""
        start = system.essential_part(state)
        later = system.rate(t + h, system.displaced(self.retraction, start, h * xi))  # type: ignore[attr-defined]
        return sizes(system, state, later - xi, rtol, atol)[0]

    def start(self, system: Any, state: Any, h: float) -> Any:
        """The first memory of a run, from a state; the state itself unless the method has a memory."""
        return state

    def observe(self, memory: Any) -> State:
        """The state in what `step` carries along."""
        return memory

    def past(self, memory: Any) -> tuple[Any, ...]:
        """The part of the memory beside the state; with `resume`, for methods whose first guess
        comes from the steps before.
        """
        return ()

    def resume(self, system: Any, state: Any, past: Any, h: float) -> Any:
        """A memory, from a state and the past of steps of the same length elsewhere; a new start by default."""
        return self.start(system, state, h)

    def require(self, system: Any) -> None:
        """Raise IncompatibleSystem, saying what to use instead, unless the method accepts the
        system.

        A retraction among the fields must be one of the system's group.
        """
        if not isinstance(system, System):
            raise IncompatibleSystem(f"{self!r} needs a system such as RigidBody([1.0, 1.5, 2.0]); got {system!r}")
        self.require_written_out(system.group)
        if system.noisy and not self.noisy:
            raise IncompatibleSystem(
                f"{self!r} draws no random numbers, and {system!r} has noise. {system.alternatives}."
            )
        if system.dissipative and not self.dissipative:
            raise IncompatibleSystem(
                f"{self!r} moves by velocities alone, and {system!r} is damped. {system.alternatives}."
            )
        for need in self.needs:
            if getattr(system, need, None) is None:
                raise IncompatibleSystem(
                    f"{self!r} needs a system with a {need}; {system!r} has none. {system.alternatives}."
                )
        for _, value in fields_of(self).items():
            if isinstance(value, Retraction):
                value.require(system.group)

    def require_written_out(self, group: Any) -> None:
        """Raise IncompatibleSystem for large matrices if the method needs every number written out."""
        if self.writes_out and lies_in_memory(group):
            raise IncompatibleSystem(
                f"{self!r} needs derivatives by every component, and {group!r} has {group.dim}, in "
                "memory. Isospectral(order=2), RKMK(order=4) and LiePoissonHamiltonJacobi(order=4) go "
                "by products of matrices"
            )

    def _explain(self, arguments: dict[str, Any]) -> None:
        """Raise what is wrong with the system for which a formula failed."""
        if "system" in arguments:
            self.require(arguments["system"])

    def step_warning(self, system: Any, start: Any, h: float) -> str | None:
        """The warning before a run with this start and step; none by default."""
        return None


@record
class Wrapping(Method):
    """A method that makes the steps of another one, under other conditions; abstract.

    Its claims and its memory are those of the method inside, until a subclass says something else.
    """

    title: ClassVar[str] = "{0.method.name}"

    method: Method

    @property
    def order(self) -> Any:
        return self.method.order  # type: ignore[attr-defined]

    @property
    def symmetric(self) -> bool:  # type: ignore[override]
        return self.method.symmetric

    @property
    def symplectic(self) -> bool:  # type: ignore[override]
        return self.method.symplectic

    @property
    def of_momenta(self) -> bool:  # type: ignore[override]
        """Whether the method is symplectic for momenta alone."""
        return self.method.of_momenta

    @property
    def noisy(self) -> bool:  # type: ignore[override]
        """Whether the method draws random numbers."""
        return self.method.noisy

    @property
    def adds(self) -> bool:  # type: ignore[override]
        """Whether a step of the wrapped method adds to the state."""
        return self.method.adds

    def start(self, system: Any, state: Any, h: float) -> Any:
        return self.method.start(system, state, h)

    def observe(self, memory: Any) -> Any:
        return self.method.observe(memory)

    def past(self, memory: Any) -> Any:
        return self.method.past(memory)

    def resume(self, system: Any, state: Any, past: Any, h: float) -> Any:
        return self.method.resume(system, state, past, h)


def alternatives(system: Any, otherwise: str = System.alternatives) -> str:
    """The methods to use where one does not accept a system.  otherwise : if its class names none."""
    words = system.alternatives if isinstance(system, System) else otherwise
    return otherwise if words == System.alternatives else words


def sizes(system: Any, state: Any, omega: Vec, rtol: float, atol: float) -> tuple[float, float]:
    """The root mean squares, over the tolerances, of the changes by a displacement and of the numbers that change; of
    many sites over all.
    """
    change, scale = system.variation(state, omega)
    if isinstance(change[0], InMemory):
        return (
            sqrt(mean_square_of_parts(change, scale, rtol, atol)),
            sqrt(mean_square_of_parts(scale, scale, rtol, atol)),
        )
    total = system.mean_over_sites(mean_squares(change, scale, rtol, atol))
    return sqrt(total[0]), sqrt(total[1])


def mean_squares(change: Vec, scale: Vec, rtol: float, atol: float) -> Vec:
    """The mean squares of the components of a change, and of what is there, over the tolerances."""
    total = vec(0.0, 0.0)
    for c, s in zip(change, scale):
        weight = 0.0
        if atol + rtol * s > 0.0:
            weight = 1.0 / (atol + rtol * s)
        total = total + vec((weight * c) * (weight * c), (weight * s) * (weight * s))
    return total / len(change)


LEAST = 2.0**-1000
"""Added to a tolerance, which may be zero: no change is then no error, and any change is too large."""


def mean_square_of_parts(changes: tuple[Any, ...], sizes: tuple[Any, ...], rtol: float, atol: float) -> float:
    """The mean square of changes over atol + rtol sizes, of vectors in memory."""
    total, count = 0.0, 0
    for change, size in zip(changes, sizes):
        ratio = change / (rtol * size + (atol + LEAST))
        total, count = total + dot(ratio, ratio), count + len(change)
    return total * (1.0 / count)


def larger(a: Any, b: Any) -> Any:
    """The larger ones of the numbers of two vectors in memory, to rounding."""
    return 0.5 * ((a + b) + abs(a - b))


def home_of(method: Any, name: str) -> type:
    """The class that writes the method's `step`, `trial`, ..."""
    return next(cls for cls in type(method).__mro__ if name in vars(cls))


def steps_as(method: Any, *kinds: type) -> bool:
    """Whether steps are those of one of these classes; a subclass of a user's may have written others."""
    return isinstance(method, kinds) and not theirs(home_of(method, "step"))
