"""Lie-Verlet: the covariant variational method in a field of force."""

from __future__ import annotations

from typing import Any, ClassVar

from ..errors import IncompatibleSystem, NoConvergence
from ..native import Mat, Vec, dot, identity_matrix, jacobian, record
from ..solvers import newton
from ..systems.lie_poisson import BodyState
from ..systems.mechanical import MechanicalSystem
from .implicit import Memory
from .variational import CovariantVariational


@record
class Flight(Memory):
    """What Lie-Verlet carries from step to step: the memory of the free motion, and the force of the field at the node."""

    force: Vec


@record
class LieVerlet(CovariantVariational):
    """Algorithm 1 between two kicks, the discrete Euler-Lagrange equations of the sum of h l(xi_i) - h (V(g_i) + V(g_i+1))/2:

        m = mu_i + (h/2) f(g_i)                                                 half a kick
        (dtau^-1_{h xi_i})* dl/dxi(xi_i) = m,   g_i+1 = g_i tau(h xi_i)         one step without the field
        mu_i+1 = Ad*_tau(h xi_i) m + (h/2) f(g_i+1)                             half a kick

    retraction : Exponential() is the more accurate one, Cayley() has a solution for every step size.
    Order 2, symmetric, symplectic; a momentum that belongs to a symmetry of the potential is kept to rounding, the energy
    oscillates without drift.  One force a step.  On R^n it is the Verlet method.
    A load F, by the principle of Lagrange and d'Alembert, adds (h/2) F to each kick: to the first as it is at the beginning, to the
    last as it is at the end, an equation for mu_i+1.
    Raises NoConvergence if the step is too large.

    Source: Bou-Rabee and Marsden, Found. Comput. Math. 9 (2009); Lee, Leok, McClamroch, Lie group variational
    integrators for the full body problem, Comput. Methods Appl. Mech. Eng. 196 (2007); for loads Marsden and West, Acta Numerica 10
    (2001), section 3.2.
    """

    needs: ClassVar[tuple[str, ...]] = ("potential",)

    @property
    def name(self) -> str:
        """Lie-Verlet and the retraction."""
        return f"Lie-Verlet ({type(self.retraction).__name__})"

    def require(self, system: Any) -> None:
        """A body in a field, with a Lagrangian, on a group that has the retraction."""
        if not isinstance(system, MechanicalSystem):
            without = f"Without a field it is CovariantVariational({self.retraction!r})"
            raise IncompatibleSystem(f"{self!r} needs a body in a field, a MechanicalSystem; got {system!r}. {without}")
        if system.body.lagrangian is None:
            raise IncompatibleSystem(
                f"{self!r} needs a body with a lagrangian; {system.body!r} has none. RKMK accepts every system."
            )
        self.retraction.require(system.body.group)

    def start(self, system: Any, state: BodyState, h: float) -> Flight:
        """The first guess is the velocity at the start."""
        return _in_field(super().start(system.body, state, h), system)

    def resume(self, system: Any, state: BodyState, past: tuple[Vec, Vec, Vec], h: float) -> Flight:
        """Momentum and configuration from elsewhere, displacements to extrapolate from the past."""
        return _in_field(super().resume(system.body, state, past, h), system)

    def step(self, system: Any, t: float, state: Any, h: float) -> Flight:
        """Kick, move freely, kick."""
        kicked = _kicked(state, (0.5 * h) * state.force)
        if system.load is not None:
            load = system.load.covector(t, system.velocity(state.mu), state.g)
            kicked = _kicked(kicked, (0.5 * h) * load)
        moved = _in_field(super().step(system.body, t, kicked, h), system)
        moved = _kicked(moved, (0.5 * h) * moved.force)
        if system.load is not None:
            moved = _kicked(moved, self._last_kick(system, t + h, moved, 0.5 * h))
        return moved

    def _last_kick(self, system: Any, t: float, state: Flight, h: float) -> Vec:
        """The k = h F at mu + k, by Newton's method."""
        guess = h * system.load.covector(t, system.velocity(state.mu), state.g)
        kick, rest, enough, _ = newton(lambda k: self._excess(system, t, state, h, k), guess, 1.0)
        if not rest <= enough:
            raise NoConvergence(f"{self!r}: no momentum found that fits the load at the end of the step; try h = {0.5 * h:g}")
        return kick

    def _excess(self, system: Any, t: float, state: Flight, h: float, kick: Vec) -> tuple[Vec, Mat, float]:
        """k - h F at mu + k and its derivative, beside |mu|^2 + |k|^2."""
        r = kick - h * system.load.covector(t, system.velocity(state.mu + kick), state.g)
        slope = jacobian(lambda m: h * system.load.covector(t, system.velocity(m), state.g), state.mu + kick)
        return r, identity_matrix(len(kick)) - slope, dot(state.mu, state.mu) + dot(kick, kick)


def _in_field(free: Memory, system: Any) -> Flight:
    return Flight(free.mu, free.g, free.last, free.last_1, free.last_2, system.force(free.g))


def _kicked(state: Flight, kick: Vec) -> Flight:
    return Flight(state.mu + kick, state.g, state.last, state.last_1, state.last_2, state.force)
