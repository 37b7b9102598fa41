"""Symplectic Euler for planar Poisson systems, its adjoint, and the symmetric composition of both."""

from __future__ import annotations

from functools import partial
from typing import Any, ClassVar

import numpy as np

from ...errors import IncompatibleSystem, InvalidInput, NoConvergence
from ...formulas import Vec, derivative, plain, record, vec
from ...formulas.numbers.anything import ASKED, degree, indices_in, traced
from ...integrators.memory import Memory, Remembering
from ...integrators.method import Method
from .poisson import PoissonState, PoissonSystem

ROUNDING = 2.0**-40
"""A sum below this, relative to its terms, is zero up to rounding."""

PROBES = [
    (float(u), float(v))
    for size in (1.0, 4.0, 0.1, 30.0, 1000.0)
    for signs in ((1, 1), (-1, 1), (1, -1), (-1, -1))
    for u, v in np.random.default_rng(11).uniform(0.5, 1.0, size=(2, 2)) * size * signs
]
"""Points in the plane, of several sizes and all signs, at which b and H are looked at."""

FAR_PROBES = [
    tuple((random.uniform(0.5, 1.0, 2) * random.choice([-1.0, 1.0], 2) * [10.0**i, 10.0**j]).tolist())
    for random in [np.random.default_rng(12)]
    for i in range(-36, 37, 6)
    for j in range(-36, 37, 6)
]
"""Points with u and v in all units, for formulas that need not be affine, or a sum, as they are
written.
"""


@record
class PlanarEuler(Method):
    """Methods of the plane y = (u, v), B = [[0, b], [-b, 0]], H = K(u) + L(v), made of steps of
    symplectic Euler; abstract.

    Such a step is a Poisson map for all K and L if and only if b is affine in u and affine in v:
    b = 1, u v, 1 + u v, u + v, but not u^2 v.  `require` looks whether it is.  (That it is one for
    every b, as some texts have it, is not so.)

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.4.1; the
    condition: docs/poisson_systems.md.
    """

    symplectic: ClassVar[bool] = True

    def require(self, system: Any) -> None:
        """A Poisson system in the plane, b affine in each variable, H a sum K(u) + L(v)."""
        if not isinstance(system, PoissonSystem) or system.structure.dim != 2:
            raise IncompatibleSystem(
                f"{self!r} needs a PoissonSystem in the plane; got {system!r}. RKMK accepts every system"
            )
        b, reasons = zip(*[traced(partial(_b, system), axis) for axis in ([1, 0], [0, 1])])
        if ASKED in reasons:
            raise IncompatibleSystem(
                f"{self!r}: b_12 of {system.structure!r} need not be affine everywhere: {ASKED}. {system.alternatives}"
            )
        slope = traced(lambda y: system.gradient(y)[0], [1, 1])[0]
        bent = [x is None or degree(x) > 1 for x in b]
        mixed = slope is None or 1 in indices_in(slope)
        places = [*PROBES, *(FAR_PROBES if mixed or any(bent) else ())]
        with np.errstate(all="ignore"):
            defined = [self._looked_at(system, vec(*y), bent, mixed) for y in places]
        if not any(defined):
            raise IncompatibleSystem(
                f"{self!r}: b_12 of {system.structure!r} or the energy has no value at any of "
                f"{len(places)} points such as {PROBES[0]}, so that b_12 cannot be seen to be "
                f"affine. {system.alternatives}"
            )

    def _looked_at(self, system: Any, at: Vec, bent: list[bool], mixed: bool) -> bool:
        """Whether b and H have values at a point.  Raises IncompatibleSystem if they have, but not the form that they
        should.

        bent, mixed : need b not be affine in u, in v, and H no sum, as their formulas are written?
        """
        try:
            matrix, gradient = system.structure.matrix(at), system.gradient(at)
            slopes, curvatures, cross = [0.0, 0.0], [0.0, 0.0], 0.0
            if any(bent):
                slopes = [_slope(system, axis, at) for axis in (0, 1)]
                curvatures = [
                    derivative(partial(_slope, system, axis), at, [float(axis == 0), float(axis == 1)])
                    for axis in (0, 1)
                ]
            if mixed:
                cross = derivative(lambda x: system.gradient(x), at, [0.0, 1.0])[0]
        except (ArithmeticError, ValueError):
            return False
        b, derivatives = matrix[0, 1], [*gradient, *slopes, *curvatures, cross]
        if not np.isfinite([*(x for row in matrix for x in row), *derivatives]).all():
            return False
        if not max(abs(b + matrix[1, 0]), abs(matrix[0, 0]), abs(matrix[1, 1])) <= ROUNDING * abs(b):
            raise IncompatibleSystem(
                f"{self!r}: the matrix of {system.structure!r} is not skew-symmetric at "
                f"{tuple(at)}, where it is {matrix!r}"
            )
        sizes = abs(at)
        terms = abs(b) + sum(abs(slope) * size for slope, size in zip(slopes, sizes))
        for name, curvature, size in zip("uv", curvatures, sizes, strict=True):
            if not abs(curvature) * size * size <= ROUNDING * terms:
                raise IncompatibleSystem(
                    f"{self!r} is no Poisson map here: b_12 of {system.structure!r} is not affine "
                    f"in {name}, its second derivative at {tuple(at)} is "
                    f"{curvature:.3g}. {system.alternatives}"
                )
        parts = [abs(slope) * size for slope, size in zip(gradient, sizes)]
        if not abs(cross) * sizes[0] * sizes[1] <= ROUNDING * min(parts):
            raise IncompatibleSystem(
                f"{self!r} needs an energy K(u) + L(v); that of {system!r} has d2H/du dv = {cross:.3g} at {tuple(at)}"
            )
        return True

    def u_first(self, system: Any, y: Vec, slope: float, h: float) -> tuple[Vec, float]:
        """u_1 = u + h b(u_1, v) L'(v), v_1 = v - h b(u_1, v) K'(u_1), linear in u_1, for b is
        affine in u; and K'(u_1).

        slope : L'(v).
        """
        start = plain(y)
        gain = self._gain(system, start, h * slope, h, 0)
        between = vec(start[0] + gain, start[1])
        new = system.gradient(between)[0]
        return vec(y[0] + gain, y[1] - h * _b(system, between) * new), new

    def v_first(self, system: Any, y: Vec, slope: float, h: float) -> tuple[Vec, float]:
        """The adjoint, v_1 = v - h b(u, v_1) K'(u), u_1 = u + h b(u, v_1) L'(v_1); and L'(v_1).

        slope : K'(u).
        """
        start = plain(y)
        gain = self._gain(system, start, -h * slope, h, 1)
        between = vec(start[0], start[1] + gain)
        new = system.gradient(between)[1]
        return vec(y[0] + h * _b(system, between) * new, y[1] + gain), new

    def _gain(self, system: Any, y: Vec, s: float, h: float, axis: int) -> float:
        """The d with d = s (b + d b'), b' the slope of b along the axis."""
        denominator = 1.0 - s * _slope(system, axis, y)
        if not denominator > 0.0:
            raise NoConvergence(
                f"{self!r}: the step h = {h:g} is too large, 1 - h (dH)' b' = {denominator:.3g} is not "
                f"positive. Try {0.25 * h:g}, or Splitting, whose exact motions have no such bound"
            )
        return s * _b(system, y) / denominator


def _b(system: Any, y: Any) -> Any:
    return system.structure.matrix(y)[0, 1]


def _slope(system: Any, axis: int, y: Any) -> Any:
    """The derivative of b_12 by one variable: db/du for axis 0, db/dv for axis 1."""
    # an integer 0 rests
    return derivative(lambda x: _b(system, x), y, [1.0, 0] if axis == 0 else [0, 1.0])


@record
class PoissonEuler(PlanarEuler):
    """Symplectic Euler as a Poisson map, for y = (u, v), {u, v} = b(u, v) and H = K(u) + L(v),
    explicit where b is affine in u:

        u_n+1 = u_n + h b(u_n+1, v_n) L'(v_n),   v_n+1 = v_n - h b(u_n+1, v_n) K'(u_n+1)        first="u"
        v_n+1 = v_n - h b(u_n, v_n+1) K'(u_n),   u_n+1 = u_n + h b(u_n, v_n+1) L'(v_n+1)        first="v", its adjoint

    Order 1.  Refused unless b is affine in u and in v.  Raises NoConvergence on a step too large
    for the linear equation.  Numbers of animals may still become negative; Splitting(order=1), the
    same in logarithms, keeps them positive whatever the step.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., I.1.1 and VII.4.1.
    """

    order: ClassVar[int] = 1
    first: str = "u"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.first not in ("u", "v"):
            raise InvalidInput(f'PoissonEuler: first is "u" or "v"; got {self.first!r}')

    def step(self, system: Any, t: float, state: PoissonState, h: float) -> PoissonState:
        """One symplectic Euler step, u first or v first."""
        slopes = system.gradient(plain(state.y))
        if self.first == "u":
            return PoissonState(self.u_first(system, state.y, slopes[1], h)[0])
        return PoissonState(self.v_first(system, state.y, slopes[0], h)[0])


@record
class PoissonVerlet(PlanarEuler, Remembering):
    """Half a step of PoissonEuler and half a step of its adjoint: the method of Stormer and Verlet
    as a Poisson map.

    Order 2, symmetric; a base for `Composition`.  Refused unless b is affine in u and in v.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.4.1 and II.4.
    """

    order: ClassVar[int] = 2
    symmetric: ClassVar[bool] = True

    def at_node(self, system: Any, state: PoissonState, h: float) -> float:
        """The slope L'(v) = dH/dv, which the next step begins with."""
        return system.gradient(plain(state.y))[1]

    def step(self, system: Any, t: float, memory: Memory, h: float) -> Memory:
        """Half a step u first, half a step v first; L' at the end is that of the next beginning."""
        y, slope = self.u_first(system, memory.state.y, memory.node, 0.5 * h)
        y, slope = self.v_first(system, y, slope, 0.5 * h)
        return Memory(PoissonState(y), slope, ())
