"""RATTLE and the symplectic Euler method with constraints: impulses across the constraints keep a
canonical system on them.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, ClassVar

from ...errors import InvalidInput, undefined
from ...formulas import Mat, Vec, jacobian, norm, plain, record, sqrt, vec, where
from ...integrators.memory import Memory, Remembering, extrapolated, followed, repeated
from ...solvers import newton
from ...systems.canonical import CanonicalState
from .constrained import FAR, cross_products, in_order, inverse_sizes, pushed
from .on_constraints import OnConstraints


@record
class Projected(OnConstraints, Remembering):
    """Steps of a constrained system whose two ends are put on the constraints by impulses;
    abstract.

        p   = p_n - h (b H_q(p, q_n) + G(q_n)^T lambda)                     b, a : `shares`
        q_n+1 = q_n + h (b H_p(p, q_n) + a H_p(p, q_n+1)),   g(q_n+1) = 0
        p_n+1 = p - h (a H_q(p, q_n+1) + G(q_n+1)^T mu),     G(q_n+1) H_p(p_n+1, q_n+1) = 0

    A subclass says what shares of the force come before and after the drift.
    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.1.3 and VII.1.4;
    the slides, (1.13).
    """

    @property
    def shares(self) -> tuple[float, float]:
        """b and a, b + a = 1."""
        raise undefined(self, "shares")

    def beginning(self, system: Any, state: CanonicalState, h: float) -> tuple[Vec, Vec, Vec]:
        """Impulses, the multipliers times h: half of those of the state, as a guess."""
        start = plain(state)
        return repeated((0.5 * h) * system.multipliers(start.q, start.p))

    def step(self, system: Any, t: float, memory: Memory, h: float) -> Memory:
        """Onto g = 0 by an impulse at the beginning, into the tangent space by one at the end."""
        start, (_, after) = plain(memory.state), self.shares
        q, p, G = start.q, start.p, system.constraint_jacobian(start.q)
        guess = extrapolated(*memory.past)
        find = self._explicitly if system.separable else self._implicitly
        q_end, drift, free, pull, impulses, size, enough = find(system, h, q, p, G, guess)
        if not size <= enough:
            raise self._unsolved(system, h, q, p, f"mismatch {sqrt(size):.1e}, wanted {sqrt(enough):.1e}")
        if after != 0.0:
            free = free + (after * h) * system.force(q_end, p + (free + pull))
        kick = free + pull  # the pull comes last: it waits for Newton's method
        impulse, pivots = system.tangent_impulse(q_end, p + kick)
        self.check_branch(system, h, q, q_end, p + kick, G, pivots)
        state = CanonicalState(memory.state.q + drift, memory.state.p + (kick + impulse))
        return Memory(state, None, followed(memory.past, impulses))

    # ---------------------------------------------------------------- the first half of the step

    def _explicitly(self, system: Any, h: float, q: Vec, p: Vec, G: Mat, guess: Vec) -> Any:
        """A step for T(p) + V(q): positions and momenta follow from the impulses, which are the
        only unknowns.  Returned are the end, the way there, the kick of the forces and the pull of
        the constraints, the impulses, and how well they are solved for.
        """
        before, _ = self.shares
        free = (before * h) * system.force(q, p) if before != 0.0 else 0.0 * p
        if system.linear_velocity:
            return self._linearly(system, h, q, p, G, guess, free)
        weights = inverse_sizes(G, h * system.velocity(q, p + (free - guess @ G)), q)

        def equation(x: Vec) -> tuple[Vec, Mat, float]:
            ph = p + (free - x @ G)
            q_end = q + h * system.velocity(q, ph)
            slope = cross_products(system.constraint_jacobian(q_end), pushed(system, q, ph, G))
            return system.constraint(q_end), -h * slope, 1.0

        x, size, enough, _ = newton(equation, guess, solved=in_order, weights=weights)
        pull = -(x @ G)
        drift = h * system.velocity(q, p + (free + pull))
        return q + drift, drift, free, pull, x, size, enough

    def _linearly(self, system: Any, h: float, q: Vec, p: Vec, G: Mat, guess: Vec, free: Vec) -> Any:
        """A step for a velocity of first degree in p: impulses move the end of the free drift along
        normals, h H_pp G^T.
        """
        drift, normals = h * system.velocity(q, p + free), h * pushed(system, q, p, G)
        aim = q + drift
        weights = inverse_sizes(G, drift - guess @ normals, q)

        def equation(x: Vec) -> tuple[Vec, Mat, float]:
            q_end = aim - x @ normals
            return (system.constraint(q_end), -cross_products(system.constraint_jacobian(q_end), normals), 1.0)

        x, size, enough, _ = newton(equation, guess, solved=in_order, weights=weights)
        moved = x @ normals
        return aim - moved, drift - moved, free, -(x @ G), x, size, enough

    def _implicitly(self, system: Any, h: float, q: Vec, p: Vec, G: Mat, guess: Vec) -> Any:
        """A step for any energy: the unknowns are the changes of q and p, and the impulses."""
        n, m, (before, after) = len(q), len(G), self.shares
        kick = (before * h) * system.force(q, p) - guess @ G
        drift = h * system.velocity(q, p + kick)
        of_p, of_q = norm(p) + norm(kick), norm(drift) + FAR * norm(q)
        weights = vec(
            *[1.0 / where(of_q > 0.0, of_q, 1.0) for _ in q],
            *[1.0 / where(of_p > 0.0, of_p, 1.0) for _ in p],
            *inverse_sizes(G, drift, q),
        )

        def residual(z: Vec) -> Vec:
            ph, q_end = p + z[n : 2 * n], q + z[:n]
            x = vec(*[z[2 * n + k] for k in range(m)])
            moved, kicked = 0.0 * q, -(x @ G)
            if before != 0.0:
                moved, kicked = ((before * h) * system.velocity(q, ph), kicked + (before * h) * system.force(q, ph))
            if after != 0.0:
                moved = moved + (after * h) * system.velocity(q_end, ph)
            return weights * vec(*(q_end - q - moved), *(ph - p - kicked), *system.constraint(q_end))

        guesses = vec(*drift, *kick, *guess)
        z, size, enough, _ = newton(lambda z: (residual(z), jacobian(residual, z), 1.0), guesses, solved=in_order)
        drift, kick = z[:n], z[n : 2 * n]
        impulses = vec(*[z[2 * n + k] for k in range(m)])
        return q + drift, drift, kick, 0.0 * p, impulses, size, enough


@record
class RATTLE(Projected):
    """The method of Andersen, for every energy H(q, p) with constraints g(q) = 0:

        p   = p_n - (h/2) (H_q(p, q_n) + G(q_n)^T lambda)
        q_n+1 = q_n + (h/2) (H_p(p, q_n) + H_p(p, q_n+1)),            g(q_n+1) = 0
        p_n+1 = p - (h/2) (H_q(p, q_n+1) + G(q_n+1)^T mu),            G(q_n+1) H_p(p_n+1, q_n+1) = 0

    Order 2, symmetric, symplectic on M; both constraints hold to rounding after every step, the
    energy oscillates without drift.  For H = T(p) + V(q) only the multipliers are unknown, and the
    positions are those of SHAKE.  Composition(RATTLE(), order=8), or 4 or 6, is of higher order.

    A ConstrainedSystem is needed.  Raises NoConvergence where the step is too large, also if its
    solution is on another branch of the constraints; InconsistentState where the constraints become
    dependent.
    Source: Andersen, J. Comput. Phys. 52 (1983); Jay, SIAM J. Numer. Anal. 33 (1996); Hairer,
    Lubich, Wanner, VII.1.4.
    """

    order: ClassVar[int] = 2
    symmetric: ClassVar[bool] = True
    shares: ClassVar[tuple[float, float]] = (0.5, 0.5)
    name = "RATTLE"


@record
class ConstrainedEuler(Projected):
    """The symplectic Euler method with constraints:

        p   = p_n - h (H_q(p, q_n) + G(q_n)^T lambda)
        q_n+1 = q_n + h H_p(p, q_n),                          g(q_n+1) = 0
        p_n+1 = p - h G(q_n+1)^T mu,                          G(q_n+1) H_p(p_n+1, q_n+1) = 0

    first : "kick", as above, or "drift", its adjoint, in which the force acts at the end.
    Order 1, symplectic on M; both constraints hold to rounding.  Errors as of RATTLE.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.1.3; the slides,
    (1.11) and (1.12).
    """

    order: ClassVar[int] = 1

    first: str = "kick"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.first not in ("kick", "drift"):
            raise InvalidInput(f'ConstrainedEuler: first is "kick" or "drift"; got {self.first!r}')

    @cached_property
    def shares(self) -> tuple[float, float]:
        """The shares of the force before and after the drift: (1, 0), or (0, 1)."""
        return (1.0, 0.0) if self.first == "kick" else (0.0, 1.0)

    @property
    def name(self) -> str:
        return f"Constrained Euler{', drift first' if self.first == 'drift' else ''}"
