"""Hamilton-Jacobi methods of the first kind: generating functions of the displacement that start
from a class function.
"""

from __future__ import annotations

from typing import Any, ClassVar

from ...errors import IncompatibleSystem, InvalidInput, require
from ...formulas import Mat, Vec, derivative, dot, jacobian, norm, plain, record, vec, where
from ...formulas.numbers.sizes import one_norms
from ...formulas.sums import total
from ...groups.composed.power import PowerGroup
from ...groups.composed.species import SpeciesGroup
from ...groups.retractions import Exponential, Retraction
from ...integrators.implicit import Implicit
from ...integrators.memory import Memory, extrapolated
from ...integrators.method import alternatives
from ...integrators.motion_series import first_kind, velocity_at
from ...solvers import newton
from ...systems.lie_poisson import BodyState
from .class_functions import ClassFunction, InvariantForm, inverse_differential
from .derivability import require_derivatives

FINER = 2.0**-46
"""The tolerance of Newton's method, whose matrix is that of order 1."""


@record
class FirstKindHamiltonJacobi(Implicit):
    """Steps whose generating function S(xi), of the first kind, solves the Lie-Poisson
    Hamilton-Jacobi equation to an order in h.

        S = c S_0 + h S_1 + ... + (h^k/k!) S_k,   pi = (dtau^-1_xi)* dS/dxi  (left-trivialised)
        Ad*_tau(xi) mu_i = pi     solved for xi by Newton's method
        mu_i+1 = pi,   g_i+1 = g_i tau(xi) tau(turn)^-1

    S is the action of the motion with the energy C + h H for the time 1, where C is the Casimir
    function that S_0 belongs to.  Its motion leaves momenta alone and turns the group; tau(turn),
    the motion of C at mu_i+1, is what the attitude has to be freed of.

    order : k, 1 to 4.  retraction : Exponential() or Cayley().  s0 : the class function S_0,
    InvariantForm(), TraceOfAd() or, with Cayley() on SO(3), CayleySquare().  scale : c, an action;
    by default chosen at the start so that the turn is one by the angle 3 for InvariantForm() with
    the exponential, by about 1 for the others.  The series in h converges like (c h/J)^k; too small
    a c leads out of the chart.
    An energy that changes with time, K(t, mu), is that of a DrivenLiePoissonSystem; S is then
    expanded about the end of the step.  Casimirs, spatial momentum and the Lie-Poisson bracket are
    kept to rounding.  Not symmetric: for the same error the second kind, LiePoissonHamiltonJacobi,
    takes far longer steps, and it serves every group.
    Raises NoConvergence or OutsideChart if the step is too large, or |mu| for the scale.

    Source: Ge and Marsden, Phys. Lett. A 133 (1988), 134; Channell and Scovel, Physica D 50 (1991),
    80.
    """

    timed: ClassVar[bool] = True
    writes_out: ClassVar[bool] = True
    symplectic: ClassVar[bool] = True
    of_momenta: ClassVar[bool] = True
    analytic: ClassVar[bool] = True
    needs: ClassVar[tuple[str, ...]] = ("hamiltonian",)

    orders: ClassVar[tuple[int, ...]] = 1, 2, 3, 4
    order: int = 2
    retraction: Retraction = Exponential()
    s0: ClassFunction = InvariantForm()
    scale: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        require(f"{type(self).__name__}: s0", self.s0, ClassFunction, "InvariantForm(), TraceOfAd() or CayleySquare()")
        scale: Any = self.scale
        if scale is not None:
            if isinstance(scale, bool) or not isinstance(scale, (int, float)) or not 0.0 < scale < float("inf"):
                raise InvalidInput(f"{type(self).__name__}: scale must be a positive number or None; got {scale!r}")
            object.__setattr__(self, "scale", float(scale))

    @property
    def name(self) -> str:
        """The method, its order, the class function, the retraction and a scale that is given."""
        scale = "" if self.scale is None else f", scale {self.scale:g}"
        return f"Hamilton-Jacobi {self.order} of the first kind ({type(self.s0).__name__}, {type(self.retraction).__name__}{scale})"

    def require(self, system: Any) -> None:
        """A Lie-Poisson system whose Hamiltonian can be differentiated, on a group on which S_0
        generates the identity.
        """
        super().require(system)
        if system.is_large and isinstance(system.group, (PowerGroup, SpeciesGroup)):
            raise IncompatibleSystem(
                f"{self!r} solves one equation for all sites, and these are too many. {alternatives(system)}"
            )
        require_derivatives(self, system)
        self.s0.require(system.group, self.retraction)

    # ---------------------------------------------------------------- one step

    def at_node(self, system: Any, state: BodyState, h: float) -> float:
        """The factor c of the class function, which a run keeps."""
        if self.scale is not None:
            return self.scale
        return self.s0.size(system.group, self.retraction, plain(state.mu))

    def first(self, system: Any, state: BodyState, h: float) -> Vec:
        """The first guess of the difference to the turn: zero, (dim,)."""
        return 0.0 * plain(state.mu)

    def step(self, system: Any, t: float, memory: Memory, h: float) -> Memory:
        """Solve for xi, whose difference to the turn is extrapolated, move momentum and attitude,
        and turn the attitude back.
        """
        mu, scale = plain(memory.state.mu), memory.node
        turn = self.turn(system, mu, scale)
        xi = self.displacement(system, h, mu, scale, turn + extrapolated(*memory.past), t + h)
        moved = system.displaced(self.retraction, memory.state, xi)
        g = moved.g
        if g is not None:
            g = system.displaced(self.retraction, moved, -self.turn(system, plain(moved.mu), scale)).g
        return self.after(memory, BodyState(moved.mu, g), xi - turn)

    def turn(self, system: Any, mu: Vec, scale: float) -> Vec:
        """The displacement that the class function alone generates at a momentum."""
        return self.s0.turn(system.group, self.retraction, mu / scale)

    def displacement(self, system: Any, h: float, mu: Vec, scale: float, guess: Vec, end: float = 0.0) -> Vec:
        """The xi whose momentum is mu, seen from where the step begins; it ends at the time `end`."""
        weights, data = None, dot(mu, mu)
        if len(system.unit_blocks) > 1:  # residuals in several units, each beside its momenta
            norms = one_norms(plain(mu), system.unit_blocks)
            inverse = [where(x > 0.0, 1.0 / where(x > 0.0, x, 1.0), 0.0) for x in norms]
            weights = vec(*[w for w, n in zip(inverse, system.unit_blocks) for _ in range(n)])
            data = 1.0
        xi, size, enough, _ = newton(
            lambda x: self.equation(system, h, mu, scale, x, end), guess, data, tolerance=FINER, weights=weights
        )
        if not size <= enough:
            raise self._unsolved(h, size, enough, f", |xi| = {norm(xi):.2g}, scale = {scale:.2g}")
        if not self.retraction.is_chart(system.group, xi):
            raise self._out_of_chart(h, f"|xi| = {norm(xi):.2g}, scale = {scale:.2g}")
        return xi

    def equation(self, system: Any, h: float, mu: Vec, scale: float, xi: Vec, end: float) -> tuple[Vec, Mat, float]:
        """pi - Ad*_tau(xi) mu, its derivative (that of order 1), and 1."""
        slope = jacobian(lambda x: self.excess(system, h, mu, scale, x, 1, end), xi)
        return self.excess(system, h, mu, scale, xi, self.order, end), slope, 1.0

    def excess(self, system: Any, h: float, mu: Vec, scale: float, xi: Vec, order: int, end: float) -> Vec:
        """pi - Ad*_tau(xi) mu of an order."""
        return self.momentum(system, h, scale, xi, order, end) - self.retraction.tau_Ad_star(system.group, xi, mu)

    def momentum(self, system: Any, h: float, scale: float, xi: Vec, order: int, end: float = 0.0) -> Vec:
        """pi, the momentum at the end of a step tau(xi), at the time `end`."""
        if order == 1:
            return self._leading(system, h, scale, xi, end)
        return total(first_kind(system, self.retraction, self.s0, scale, xi, order, h, end))

    def _leading(self, system: Any, h: float, scale: float, xi: Vec, end: float) -> Vec:
        """pi_0 + h (ad*_v pi_0 - d(pi_0) v), pi_0 = c P(xi), v = dH(pi_0), the derivative along
        tau(xi) v.
        """
        group, retraction = system.group, self.retraction
        start = scale * self.s0.momentum(group, retraction, xi)
        v = velocity_at(system, end, start)
        onward = inverse_differential(group, retraction, xi, v)
        change = derivative(lambda x: self.s0.momentum(group, retraction, x), xi, onward)
        return start + h * (group.ad_star(v, start) - scale * change)
