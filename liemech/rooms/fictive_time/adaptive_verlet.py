"""Adaptive Verlet: the method of Stormer and Verlet in a fictive time, symplectic, with steps that
follow a sigma(q).
"""

from __future__ import annotations

from typing import Any, ClassVar

from ...errors import IncompatibleSystem, InvalidTimeScale, NoConvergence
from ...formulas import Vec, dot, plain, record, sqrt, vec
from ...integrators.memory import Memory, Remembering
from ...integrators.method import alternatives
from ...solvers import LIMIT
from ...systems.canonical import CanonicalState
from ...systems.separable import SeparableSystem
from .time_scales import POSITIVE
from .time_transformed import TimeTransformed

CLOSE = 2.0**-27
"""A relative mismatch of sigma below which the correction of Newton's method, applied once more,
leaves rounding only.
"""


@record
class AdaptiveVerlet(Remembering):
    """The method of Stormer and Verlet for K = sigma(q) (T(p) + V(q) - H_0), T of second degree:
    for a TimeTransformed system.

        p  = p_n - (h/2) (sigma_n dV(q_n) + (T(p) + V(q_n) - H_0) dsigma(q_n))         one quadratic equation, for T(p)
        q_n+1 = q_n + (h/2) (sigma_n + sigma_n+1) dT/dp(p)                            one equation, for sigma_n+1 = sigma(q_n+1)
        t_n+1 = t_n + (h/2) (sigma_n + sigma_n+1)
        p_n+1 = p - (h/2) (sigma_n+1 dV(q_n+1) + (T(p) + V(q_n+1) - H_0) dsigma(q_n+1))

    Order 2, symmetric, symplectic, one force a step; Composition(AdaptiveVerlet(), order=4), 6 or
    8.
    Raises NoConvergence if h is too large for the equations, InvalidTimeScale where sigma is not
    positive.

    Source: Huang and Leimkuhler, SIAM J. Sci. Comput. 18 (1997), 239 (the name); Hairer, Appl.
    Numer. Math. 25 (1997), 219; Hairer, Lubich, Wanner, VIII.2.1 and VI.3.
    """

    order: ClassVar[int] = 2
    symmetric: ClassVar[bool] = True
    symplectic: ClassVar[bool] = True
    name = "Adaptive Verlet"

    def require(self, system: Any) -> None:
        """A separable system, T of second degree, transformed by a sigma(q)."""
        if not isinstance(system, TimeTransformed):
            raise IncompatibleSystem(
                f"{self!r} needs a TimeTransformed(system, sigma); got {system!r}. {alternatives(system)}"
            )
        if not (isinstance(system.system, SeparableSystem) and system.system.quadratic and system.sigma.positions):
            raise IncompatibleSystem(
                f"{self!r} needs an energy T(p) + V(q) with T of second degree, and a sigma of q "
                f"alone; got {system!r}. HamiltonJacobi(order=4) is for every energy and sigma, "
                "and so is ReversibleController around a symmetric method"
            )
        super().require(system)

    def step(self, system: Any, t: float, memory: Memory, h: float) -> Memory:
        """Half a kick, a drift, half a kick."""
        inner, half, n = system.system, 0.5 * h, system.degrees - 1
        q, p, momentum_of_time = memory.state.q, memory.state.p, plain(memory.state.p)[n]  # rest = -H_0
        start, (force, potential, scale, slope) = system.without(plain(q)), memory.node
        push = (half * scale) * force - (half * (potential + momentum_of_time)) * slope
        kinetic = self._kinetic(inner, start, system.without(plain(p)) + push, -half * slope, h)
        kick = push - (half * kinetic) * slope
        p = p + vec(*kick, 0.0)
        v = inner.velocity(start, system.without(plain(p)))
        time = half * (scale + self._scale(inner, system.sigma, start, v, scale, slope, half))
        q = q + vec(*(time * v), time)
        node = force, potential, scale, slope = self.at_node(system, CanonicalState(q, p), h)
        kick = (half * scale) * force - (half * (kinetic + potential + momentum_of_time)) * slope
        return Memory(CanonicalState(q, p + vec(*kick, 0.0)), node, ())

    def at_node(self, system: Any, state: CanonicalState, h: float) -> tuple[Vec, float, float, Vec]:
        """The force, V, sigma and dsigma/dq."""
        q, p = system.without(plain(state.q)), system.without(plain(state.p))
        sigma, inner = system.sigma, system.system
        scale = sigma.value(inner, CanonicalState(q, p))
        if not scale > 0.0:
            raise InvalidTimeScale(f"{sigma!r} = {scale:g}; {POSITIVE}")
        return inner.force(q, p), inner.potential(q), scale, sigma.slope(inner, q)

    def _kinetic(self, inner: Any, q: Vec, a: Vec, c: Vec, h: float) -> float:
        """The solution b of b = T(a + b c) that is T(a) where c is zero."""
        linear = dot(c, inner.velocity(q, a)) - 1.0
        square = 0.5 * dot(c, inner.velocity(q, c) - inner.velocity(q, 0.0 * c))
        constant = inner.kinetic(a)
        discriminant = linear * linear - 4.0 * square * constant
        if not (discriminant >= 0.0 and linear < 0.0):
            raise NoConvergence(
                f"AdaptiveVerlet: the kick of the step h = {h:g} has no solution, h is too large; try {0.25 * h:g}"
            )
        return 2.0 * constant / (sqrt(discriminant) - linear)

    def _scale(self, inner: Any, sigma: Any, q: Vec, v: Vec, scale: float, slope: Vec, half: float) -> float:
        """The solution s of s = sigma(q + half (scale + s) v) that is `scale` where half is zero,
        by Newton's method.
        """
        guess = scale + 2.0 * half * scale * dot(slope, v)
        s, done = guess if guess > 0.0 else scale, False
        for _ in range(LIMIT):
            x = q + (half * (scale + s)) * v
            mismatch = s - sigma.value(inner, CanonicalState(x, x))
            done = abs(mismatch) <= CLOSE * abs(s)
            s = s - mismatch / (1.0 - half * dot(sigma.slope(inner, x), v))
            if done:
                break
        if not done:
            raise NoConvergence(
                f"AdaptiveVerlet: no sigma found that fits the end of a step in {LIMIT} "
                f"iterations; h = {2.0 * half:g} is too large, try {0.5 * half:g}"
            )
        if not s > 0.0:
            raise InvalidTimeScale(f"{sigma!r} = {s:g} at the end of a step; {POSITIVE}")
        return s
