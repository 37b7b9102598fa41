"""How a state moves between measurements: discrete maps on a group, driven by measured inputs, with noise."""

from __future__ import annotations

from operator import attrgetter
from typing import TYPE_CHECKING, Any

from ..errors import undefined
from ..formulas import Element, Mat, Record, Vec, derivative, mat, record, sqrt, transpose, vec
from ..formulas.derivatives import axes
from ..groups.lie_group import LieGroup
from ..integrators.method import Method
from ..systems.equations.group_equation import GroupEquation, GroupState
from .errors_of_elements import velocity
from .noise import check_noise


@record
class Process(Record):
    """A discrete map x' = move(x, u, w, h) of a group, with a measured input u and noise w.

    must:  `group` (a field or a property), `move`, `deviations`
    may:   `inputs`

    Derivatives by the state and by the noise are derived from `move`.

    Source: Sarkka, Bayesian Filtering and Smoothing, 2nd ed., section 4.1; on groups Barrau and
    Bonnabel, IEEE Trans. Autom. Control 62 (2017), section II.
    """

    if TYPE_CHECKING:  # a field here would be one of every subclass

        @property
        def group(self) -> Any: ...

    def move(self, g: Element, u: Vec, w: Vec, h: float) -> Element:
        """The element after a step h, in s.  u : the input, w : the noise, 0 where it is not known."""
        raise undefined(self, "move")

    def deviations(self, h: float) -> Vec:
        """The standard deviations of the independent components of w, constant over a step h.

        White noise of density s (per root of Hz) has the mean s/sqrt(h) over a step.
        """
        raise undefined(self, "deviations")

    def led(self, g: Element, u: Vec, h: float) -> Element:
        """The element after a step without noise."""
        return self.move(g, u, vec(*[0.0] * len(self.deviations(h))), h)

    def by_noise(self, side: str, g: Element, u: Vec, h: float) -> Mat:
        """L, (dim, len(w)): the error after a step by each component of the noise, in units of its
        deviation.  side : of the error.
        """
        size = self.deviations(h)
        zero = vec(*[0.0] * len(size))
        g_next = self.move(g, u, zero, h)
        rates = [derivative(lambda w: self.move(g, u, w, h), zero, d) for d in axes(zero)]
        return transpose(mat(*[s * velocity(self.group, side, g_next, rate) for s, rate in zip(size, rates)]))

    @property
    def inputs(self) -> int:
        """The number of components of u, by default the dimension of the group."""
        return self.group.dim

    _space = property(attrgetter("group"))

    def _shape(self, argument: str, kind: str) -> tuple[int, ...] | None:
        shapes = {"u": (self.inputs,), "w": (len(self.deviations(1.0)),)}
        return shapes.get(argument) or super()._shape(argument, kind)


@record
class Turning(Process):
    """A velocity that is measured in the body, g' = g (u + w): g exp(h (u + w)).

    A gyroscope on SO(3), wheel odometry on SE(2), visual odometry on SE(3).

    density : (dim,) of the white noise, in units of u per root of Hz.

    Source: Markley and Crassidis, Fundamentals of Spacecraft Attitude Determination and Control (2014),
    section 6.2.
    """

    group: LieGroup
    density: Vec

    def __post_init__(self) -> None:
        super().__post_init__()
        check_noise(self, density=self.group.dim)

    def move(self, g: Element, u: Vec, w: Vec, h: float) -> Element:
        """g exp(h (u + w))."""
        return self.group.compose_exp(g, h * (u + w))

    def deviations(self, h: float) -> Vec:
        """The deviations of the noise, density/sqrt(h)."""
        return self.density / sqrt(h)


@record
class _Driven(GroupEquation):
    """The equation of one step, input and noise held."""

    equation: Any
    u: Vec
    w: Vec

    def velocity(self, t: float, g: Element) -> Vec:
        return self.equation.velocity(g, self.u, self.w)


@record
class Discrete(Process):
    """An equation on a group, g' = g xi(g, u, w), as one step of a method of the library.

    A subclass writes `velocity(g, u, w)` and `deviations`; `method` is the one that steps, such as
    `lm.RKMK(order=4)`.  F is the derivative of that step, not of the equation.  Raises IncompatibleSystem for a method
    that does not move such equations.

    Source: Iserles et al., Acta Numerica 9 (2000), section 3.
    """

    group: LieGroup
    method: Method

    def __post_init__(self) -> None:
        super().__post_init__()
        zeros = [vec(*[0.0] * n) for n in (self.inputs, len(self.deviations(1.0)))]
        self.method.require(_Driven(self.group, self, *zeros))

    def velocity(self, g: Element, u: Vec, w: Vec) -> Vec:
        """The body velocity, (dim,).  u : the input, w : the noise."""
        raise undefined(self, "velocity")

    def move(self, g: Element, u: Vec, w: Vec, h: float) -> Element:
        """One step of the method, input and noise held."""
        method, held = self.method, _Driven(self.group, self, u, w)  # type: Any, Any
        return method.observe(method.step(held, 0.0, method.start(held, GroupState(g), h), h)).g
