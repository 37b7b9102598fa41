"""The covariant variational method: a discrete action principle on a Lie group."""

from __future__ import annotations

import math
import sys
from typing import Any, ClassVar

import numpy as np

from ..errors import IncompatibleSystem, InvalidInput, InvalidType
from ..formulas import Mat, Vec, dot, mat, norm, plain, record, vec, vectors
from ..formulas.numbers.double_double import is_long
from ..groups.retractions import Exponential, Retraction
from ..solvers import TOLERANCE, correction, leading_power, narrow, newton, refined
from ..systems.kinetic_energy import has_inertia
from ..systems.lie_poisson import BodyState
from ..systems.many.site_state import StateOfSites
from ..systems.system import System, lies_in_memory
from .discrete_lagrangian import DiscreteLagrangian
from .implicit import Implicit
from .memory import Memory, extrapolated
from .method import alternatives
from .solvability import first_fold, grown, is_upright, largest_impulse, stays_near, surely_solvable, turns_freely

LEAST, MOST = 2.0**-336, 2.0**339
"""The sizes of J/h, about 1e-101 and 1e102, whose third powers are ordinary floats."""

FAR, HEAVY = 2.0**960, 2.0**510
"""Of a constant inertia: J/h and h/J up to which a unit of time is found that brings J/h near 1,
about 1e289; J up to which the square of its inverse is an ordinary float, about 3e153.
"""


@record
class CovariantVariational(Implicit):
    """Algorithm 1, a Lie group variational integrator: the discrete Euler-Poincare equations of the
    action sum l_d(xi_i) with g_i+1 = g_i tau(h xi_i).

        (1/h) (dtau^-1_{h xi_i})* dl_d/dxi(xi_i) = mu_i  (right-trivialised),    solved for h xi_i by Newton's method
        mu_i+1 = Ad*_tau(h xi_i) mu_i,   g_i+1 = g_i tau(h xi_i)

    lagrangian : a DiscreteLagrangian, the action l_d of one step; by default h l(xi), of the body's
    own Lagrangian l.
    retraction : Cayley() has, for rigid bodies that are no thin rods, a solution for every step;
    Exponential() is the more accurate one.  `largest_step` tells.  On other groups, such as SL(2),
    neither has one for every step.
    mu belongs to the nodes, xi to the intervals between them: J xi is a momentum half way, an O(h)
    away from mu.  Velocities are `Trajectory.xi`; a run that is to start with a velocity starts
    with its `momentum`.
    Order 2 and symmetric, or what the discrete Lagrangian claims; spatial momentum, Casimirs and
    the Lie-Poisson bracket are kept to rounding, the energy oscillates without drift.  Raises
    NoConvergence if the step is too large: there is no solution that grows out of h = 0.

    Source: Geometric Numerical Methods with Lie Groups, algorithm 1 (with the factor h of its first
    line corrected); Bou-Rabee and Marsden, Found. Comput. Math. 9 (2009); Marsden, Pekarsky,
    Shkoller, Nonlinearity 12 (1999).
    """

    symplectic: ClassVar[bool] = True
    needs: ClassVar[tuple[str, ...]] = ("lagrangian",)

    retraction: Retraction = Exponential()
    lagrangian: DiscreteLagrangian | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.lagrangian is not None and not isinstance(self.lagrangian, DiscreteLagrangian):
            raise InvalidType(
                f"{type(self).__name__}: lagrangian must be a DiscreteLagrangian, the action of a "
                f"step, or None; got {self.lagrangian!r}"
            )

    def require(self, system: Any) -> None:
        """A system with a Lagrangian; of large matrices with the Lagrangian of the body alone."""
        super().require(system)
        if system.lie_poisson is None:
            raise IncompatibleSystem(
                f"{self!r} moves a body by its Lagrangian alone; {system!r} has more in its motion. {alternatives(system)}"
            )
        if self.lagrangian is not None and lies_in_memory(system.group):
            raise IncompatibleSystem(
                f"{self!r} differentiates the action of a step by every component, and "
                f"{system.group!r} has {system.group.dim}, in memory. Leave lagrangian out, or take "
                "LiePoissonHamiltonJacobi(order=4)"
            )

    def __repr__(self) -> str:
        action = "" if self.lagrangian is None else f", lagrangian={self.lagrangian!r}"
        return f"{type(self).__name__}(retraction={self.retraction!r}{action})"

    @property
    def order(self) -> int:
        """2, or the order of the discrete Lagrangian."""
        return 2 if self.lagrangian is None else self.lagrangian.order

    @property
    def symmetric(self) -> bool:  # type: ignore[override]
        """Whether the discrete Lagrangian is symmetric, as h l(xi) is."""
        return self.lagrangian is None or self.lagrangian.symmetric

    @property
    def name(self) -> str:
        action = "" if self.lagrangian is None else f", {type(self.lagrangian).__name__}"
        return f"Algorithm 1 ({type(self.retraction).__name__}{action})"

    def first(self, system: Any, state: BodyState, h: float) -> Vec:
        """The displacement at the velocity of the start, h J^-1 mu."""
        return h * system.velocity(state.mu)

    def step(self, system: Any, t: float, memory: Memory, h: float) -> Memory:
        """Solve for the displacement of the interval from the extrapolated one, then move momentum
        and attitude by it.
        """
        guess = extrapolated(*[narrow(x) for x in memory.past])
        x = self.displacement(system, h, plain(memory.state.mu), guess)
        return self.after(memory, system.displaced(self.retraction, memory.state, x), x)

    def displacement(self, system: Any, h: float, mu: Vec, guess: Vec) -> Vec:
        """The x = h xi whose momentum dl/dxi fits mu.

        A root that Newton's method finds is the right one where there is no other: before the first
        fold, if that is known, and in the inner half of the chart.  Elsewhere the step is grown.
        Of large matrices the momentum is iterated instead.
        """
        if lies_in_memory(system.group):
            p = system.lagrangian.momentum((1.0 / h) * guess)
            return self.iterated(system, self.retraction, h, mu, (p, guess), lambda p: h * system.velocity(p))[1]
        second = self._second(system, h)
        step, m = h / second, second * mu
        rate, coarse = 1.0 / step, narrow(m)
        square = dot(coarse, coarse)
        x, size, enough, folded = newton(lambda x: self.equation(system, rate, coarse, x), narrow(guess), square, rate)
        doubtful = folded or not (size <= enough and self.retraction.is_chart(system.group, 2.0 * x))
        free = self.lagrangian is None and turns_freely(system, self.retraction)
        if free and step * step * square > surely_solvable(system.lagrangian.inverse):
            fold = first_fold(system.lagrangian.inertia, self.retraction)
            doubtful = doubtful or step * step * square > fold * fold
        if doubtful:
            x = self._grown(system, step, coarse, second)
        if is_long(mu[0]):  # all of this in 16 digits, then one correction in 31
            x = refined(lambda x: self.equation(system, rate, m if is_long(x[0]) else coarse, x), x)
        return x

    def _second(self, system: Any, h: float) -> float:
        """The unit of time in which the equation is solved: a power of two that brings J/h near 1,
        because Newton's method multiplies three entries of that size.

        Of a constant inertia only h mu counts.  Other Lagrangians keep their unit.
        """
        if not self._is_constant(system):
            return 1.0
        return 1.0 / leading_power(first_size(system.lagrangian.inertia) / h)

    def _is_constant(self, system: Any) -> bool:
        """Whether the Hessian of the Lagrangian is an inertia that does not change."""
        return self.lagrangian is None and has_inertia(system.lagrangian)

    def _grown(self, system: Any, h: float, mu: Vec, second: float) -> Vec:
        """The displacement that grows out of zero with h, in this unit of time."""

        def trial(part: float, x: Vec, former: Vec, before: float) -> tuple[Vec, float, bool, bool]:
            r, jacobian, _ = self.equation(system, 1.0 / (part * h), mu, x)
            change = correction(jacobian, r)
            new, size = x - change, dot(change, change)
            good = stays_near(new, former, size, before) and is_upright(jacobian, h)
            done = good and size <= TOLERANCE * TOLERANCE * dot(new, new)
            return new, size, good and not (done and not self.retraction.is_chart(system.group, new)), done

        first = h * system.velocity(mu)
        x, part = grown(trial, first, first)
        if part < 1.0:
            raise self._unconnected(
                second * h, part * second * h, f"h|xi| = {norm(x):.2g}", self._usable(system, second * h, mu / second)
            )
        return x

    def _usable(self, system: Any, h: float, mu: Vec) -> float | None:
        """A step for every momentum of this size, forwards or backwards as h; None if it is not known."""
        largest = self.largest_step(system, BodyState(mu))
        return None if largest is None else math.copysign(largest, h)

    # ---------------------------------------------------------------- velocities

    def momentum(self, system: Any, xi: Vec, h: float) -> Vec:
        """The momentum at the node before a step of length h with velocity xi, (dtau^-1_{h xi})*
        dl/dxi, right-trivialised: to start from a velocity.

        xi : (dim,), in 1/s.  h : in s.  Returns (dim,).
        """
        return self.retraction.dtau_inv_dual(system.group, -(h * xi), self._momentum(system, xi, h))

    def velocity(self, system: Any, mu: Vec, h: float) -> Vec:
        """The velocity xi of the step of length h after a node with momentum mu; `momentum`
        backwards.

        mu : (dim,).  h : in s.  Returns (dim,), in 1/s.  Raises NoConvergence or OutsideChart as
        the step does.
        """
        return (1.0 / h) * self.displacement(system, h, mu, h * system.velocity(mu))

    # ---------------------------------------------------------------- how large a step may be

    def largest_step(self, system: Any, start: BodyState) -> float | None:
        """The |h| up to which every step has one solution, wherever the momentum turns; None where
        that is not known.

        Known for kinetic energies on so(3), with exp and the Cayley map: `largest_impulse` over
        |mu|; for Cayley infinite on bodies that are `is_always_solvable`.  A larger step may go
        well: it is followed from h = 0 on, refused if that ends.
        start : of one body or an ensemble, which the largest |mu| decides.
        """
        self._asked("largest_step", system, start, 1.0)
        return self._largest_step(system, start)

    def _asked(self, what: str, system: Any, start: Any, h: Any) -> None:
        """Raise what is wrong with the arguments of a question about steps."""
        self.require(system)
        where = f"{type(self).__name__}.{what}"
        if not isinstance(start, BodyState):
            raise InvalidType(f"{where}: start must {BodyState._wanted(system)}; got {start!r}")
        if not isinstance(h, (int, float)) or isinstance(h, bool):
            raise InvalidType(f"{where}: h must be a number; got {h!r}")
        if not (h and abs(h) <= sys.float_info.max):
            raise InvalidInput(f"{where}: h must be finite and not 0; got {h!r}")

    def _largest_step(self, system: Any, start: BodyState) -> float | None:
        if self.lagrangian is not None or not turns_freely(system, self.retraction):
            return None
        limit = largest_impulse(system.lagrangian.inertia, self.retraction)
        if limit == math.inf:
            return limit
        mu = np.array(start.mu, dtype=float)
        most = float(np.abs(mu).max())
        if most == 0.0:
            return math.inf
        mu /= most  # squares of it are ordinary floats
        return limit / (most * math.sqrt(np.einsum("...i,...i", mu, mu).max()))

    def step_warning(self, system: Any, start: BodyState, h: float) -> str | None:
        """The warning before a run whose step is larger than the `largest_step`; None if it is
        not.

        Raises InvalidInput for units in which Newton's method would leave the range of floats: it
        multiplies three entries of J/h, unless J is constant and it has a unit of time of its own.
        """
        state: Any = start
        is_large = isinstance(state, StateOfSites)  # more than would be written out
        usable = (is_large or isinstance(state, BodyState)) and isinstance(system, System)
        if not (usable and type(h) is float and h):
            self._asked("step_warning", system, start, h)
        of_site: Any = system.lagrangian.of_one if is_large else None
        if is_large and not has_inertia(of_site):
            return None
        if is_large:
            inertia = float(np.abs(getattr(of_site.inertia, "values", np.array(of_site.inertia))).max())
        else:
            mu = start.mu if start.bodies is None else start.mu[0]
            inertia = float(np.abs(np.array(self._hessian(system, system.velocity(mu), h), dtype=float)).max())
        size, constant = inertia / abs(h), self._is_constant(system)
        if constant:
            fits, why = 1.0 / FAR < size < FAR and inertia < HEAVY, "numbers of this size"
        else:
            fits, why = LEAST < size < MOST, "products of three such numbers"
        if not fits:
            raise InvalidInput(
                f"{self!r}: J = {inertia:.1e} and J/h is {size:.1e} in these units, and {why} "
                "leave the range of floats. Take units of mass and time in which both are closer "
                "to 1"
            )
        largest = None if is_large else self._largest_step(system, start)
        if largest is None or not abs(h) > largest:
            return None
        return (
            f"{self!r}: h = {h:g} is larger than {largest:.3g}, up to which every direction of the "
            "momentum has one solution. Steps are followed from h = 0 on, which is slow, and a "
            "direction that has none ends the run"
        )

    def equation(self, system: Any, rate: float, mu: Vec, x: Vec) -> tuple[Vec, Mat, float]:
        """The mismatch of dl/dxi and mu, its derivative, and the factor of its square."""
        xi = rate * x
        r, by_p, by_x = self.retraction.residual(system.group, x, self._momentum(system, xi, 1.0 / rate), mu)
        jacobian = with_inertia(by_x, momentum_slope(by_p, rate * self._hessian(system, xi, 1.0 / rate)))
        return r, jacobian, weight(by_p)

    def _momentum(self, system: Any, xi: Vec, h: float) -> Vec:
        """The momentum (1/h) dl_d/dxi of the discrete Lagrangian."""
        if self.lagrangian is None:
            return system.lagrangian.momentum(xi)
        return self.lagrangian.momentum(system, self.retraction, xi, h)

    def _hessian(self, system: Any, xi: Vec, h: float) -> Mat | Vec:
        """The inertia (1/h) d2l_d/dxi2 of the discrete Lagrangian."""
        if self.lagrangian is None:
            return system.lagrangian.hessian(xi)
        return self.lagrangian.hessian(system, self.retraction, xi, h)


def first_size(inertia: Vec | Mat) -> float:
    """The size of the first row, no zero."""
    if isinstance(inertia, vectors.Mat):
        return vectors.sum([abs(x) for x in inertia[0]])
    return abs(inertia[0])


def weight(by_p: float | Mat) -> float:
    """The scale of the square of a mismatch, over that of the momentum: it may be a multiple of r."""
    return 1.0 if isinstance(by_p, vectors.Mat) else by_p * by_p


def momentum_slope(by_p: float | Mat, hessian: Mat | Vec) -> Mat | Vec:
    """dr/dp d2l: a Vec stands for a diagonal matrix, a number for a multiple of the unit matrix."""
    if not isinstance(by_p, vectors.Mat):
        return by_p * hessian
    return by_p @ hessian if isinstance(hessian, vectors.Mat) else mat(*[row * hessian for row in by_p])


def with_inertia(m: Mat, inertia: Mat | Vec) -> Mat:
    """m + inertia, a Vec standing for a diagonal matrix."""
    if isinstance(inertia, vectors.Mat):
        return m + inertia
    return mat(*[vec(*[x + inertia[i] if i == j else x for j, x in enumerate(row)]) for i, row in enumerate(m)])
