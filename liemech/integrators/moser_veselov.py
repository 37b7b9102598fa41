"""The method of Moser and Veselov: the free rigid body as a discrete integrable system."""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np

from ..errors import IncompatibleSystem, InconsistentState, InvalidInput, NoConvergence
from ..formulas import Mat, Vec, cross, dot, norm, outer, record, sqrt, vec, vectors, where
from ..groups.so3 import SO3, plus
from ..models.rigid_body import RigidBody
from ..retractions import Cayley
from ..solvers import newton
from ..systems.kinetic_energy import KineticEnergy
from ..systems.lie_poisson import BodyState
from .implicit import Implicit, Memory, extrapolated
from .method import Method
from .variational import with_inertia


@record
class MoserVeselov(Implicit):
    """The discrete rigid body of Moser and Veselov: steps F that extremise sum tr(F J_d), J_d = tr(J)/2 - J.

        h hat(mu_n) = F J_d - J_d F^T,   mu_n+1 = F^T mu_n,   g_n+1 = g_n F

    With F = cay(x) the first line is J x = h (dcay_x^-1)* mu_n, left-trivialised: Algorithm 1 with the inverse on the other side.
    Order 2, symmetric, Poisson; it keeps the energy of the body and the spatial momentum to rounding: its steps lie on
    the exact orbit, at slightly wrong times.  Steps must be short: it has no solution beyond h|mu| of about the least moment.

    Free rigid bodies only.  Raises NoConvergence where the step is too large.
    Source: Moser and Veselov, Commun. Math. Phys. 139 (1991); Hairer, Lubich, Wanner, VII.5.
    """

    order: ClassVar[int] = 2
    symmetric: ClassVar[bool] = True
    symplectic: ClassVar[bool] = True

    @property
    def name(self) -> str:
        """Moser-Veselov."""
        return "Moser-Veselov"

    def require(self, system: Any) -> None:
        """A free rigid body."""
        super().require(system)
        require_free_body(self, system)

    def first(self, system: Any, state: BodyState, h: float) -> Vec:
        """The displacement at the velocity of the start."""
        return h * system.velocity(state.mu)

    def step(self, system: Any, t: float, state: Memory, h: float) -> Memory:
        """Solve for the displacement from the extrapolated one, then move momentum and attitude by it."""
        x = self.displacement(system, h, state.mu, extrapolated(*self.past(state)))
        return self.after(state, system.moved(Cayley(), self.observe(state), x), x)

    def inertia(self, system: Any) -> Vec | Mat:
        """The moments J, or their matrix."""
        return system.hamiltonian.inertia

    def displacement(self, system: Any, h: float, mu: Vec, guess: Vec) -> Vec:
        """The x with J x = y - x x y/2 + x (x.y)/4, y = h mu."""
        y = h * mu
        x, size, enough, folded = newton(lambda x: self.equation(system, y, x), guess, dot(y, y))
        if folded or not size <= enough:
            raise NoConvergence(
                f"{self!r}: no step F from here with h hat(mu) = F J_d - J_d F^T, it would have to turn by more than the body can: "
                f"h|mu| = {norm(y):.2g}, mismatch {sqrt(size):.1e}, wanted {sqrt(enough):.1e}. The step h = {h:g} is too large; "
                f"try {0.25 * h:g}, or CovariantVariational(Cayley()), which has a solution for every h"
            )
        return x

    def equation(self, system: Any, y: Vec, x: Vec) -> tuple[Vec, Mat, float]:
        """J x - y + x x y/2 - x (x.y)/4 and its derivative, beside y."""
        inertia, s = self.inertia(system), 0.25 * dot(x, y)
        r = (inertia @ x if isinstance(inertia, vectors.Mat) else inertia * x) - (y + (s * x - 0.5 * cross(x, y)))
        return r, with_inertia(_minus(outer(0.25 * x, y) + system.group.algebra.hat(0.5 * y), s), inertia), 1.0


NAN = math.nan

SPANS = 1, 16
"""After how many steps a fitted method is compared with the exact motion: one to find it, more to find it beyond rounding."""

FITTED = 1e-10
"""How far, relatively, a start may be from the constants of motion for which a method was fitted."""


@record
class ExactMoserVeselov(MoserVeselov):
    """The exact motion of a free body, by steps of Moser and Veselov for a body with other moments, 1/J'_j = (1 + s)/J_j + d.

    Its energy is (1 + s) H + d |mu|^2/2, so it has the same orbits, and its discrete motion is a shift of the two angles of the
    continuous one: along the orbit, and about the spatial momentum.  The numbers s and d make both shifts right, for one energy,
    one |mu| and one h.  A step costs what a step of Moser-Veselov costs, and nothing but rounding errors is left.

    `ExactMoserVeselov.of(body, start, h)` fits the method; it steps from such a start, with h or -h, and refuses others.
    Momenta and attitudes that it did not see stay exact as long as energy and |mu| are the same.

    Source: Hairer and Vilmart, J. Phys. A 39 (2006), and McLachlan and Zanna, Found. Comput. Math. 5 (2005), who expand s and d
    in powers of h.
    """

    symplectic: ClassVar[bool] = False  # s and d belong to one orbit

    h: float
    constants: Vec
    moments: Vec | Mat

    @classmethod
    def of(cls, body: RigidBody, start: BodyState, h: float) -> ExactMoserVeselov:
        """The method for a free body, a start and a length of steps, fitted by Newton's method to `body.exact`.

        Raises IncompatibleSystem unless it is a RigidBody, NoConvergence if h is too large.
        """
        if not isinstance(body, RigidBody):
            raise IncompatibleSystem(f"ExactMoserVeselov.of needs a RigidBody, whose exact motion is known; got {body!r}")
        if start.bodies is not None:
            raise InvalidInput("ExactMoserVeselov.of takes one body at a time: the method is fitted to its energy")
        start = BodyState(start.mu, SO3().identity())
        exact = {steps: np.array(body.exact(start, steps * h).g) for steps in SPANS}
        inverse = np.array(body.hamiltonian.inverse)
        constants = _fingerprint(body, start.mu)
        one = np.ones(3) if inverse.ndim == 1 else np.eye(3)
        change = np.array([inverse, np.sum(inverse * one) / 3.0 * one])

        def fitted(p: np.ndarray) -> ExactMoserVeselov:
            total = inverse + np.tensordot(p, change, 1)
            return cls(h, constants, 1.0 / total if inverse.ndim == 1 else np.linalg.inv(total))

        def error(p: np.ndarray, steps: int) -> np.ndarray:
            method = fitted(p)
            memory = method.start(body, start, h)
            for _ in range(steps):
                memory = method.step(body, 0.0, memory, h)
            return np.array(body.group.log(exact[steps].T @ np.array(memory.g)))

        p = np.zeros(2)
        for steps in SPANS:
            for _ in range(8):
                slopes = [(error(p + e, steps) - error(p - e, steps)) / 2e-4 for e in 1e-4 * np.eye(2)]
                step = np.linalg.lstsq(np.transpose(slopes), -error(p, steps), rcond=1e-8)[0]
                p = p + step
                if np.abs(step).max() < 1e-15:
                    break
        rest = np.abs(error(p, SPANS[-1])).max()
        if not rest <= FITTED:
            raise NoConvergence(
                f"ExactMoserVeselov: no moments found whose steps are exact, {SPANS[-1]} of them are off by {rest:.1e}. "
                f"The step h = {h:g} is too large for this motion; try {0.25 * h:g}"
            )
        return fitted(p)

    @property
    def name(self) -> str:
        """Exact Moser-Veselov."""
        return "Exact Moser-Veselov"

    def first(self, system: Any, state: BodyState, h: float) -> Vec:
        """The displacement at the velocity of the start; no number at all if the method was not fitted to this start and h."""
        other = abs(h) != abs(self.h)
        for found, wanted in zip(_fingerprint(system, state.mu), self.constants):
            other = other or abs(found - wanted) > FITTED * abs(wanted)
        return where(other, NAN, h) * system.velocity(state.mu)

    def step(self, system: Any, t: float, state: Memory, h: float) -> Memory:
        """One step of the body with the other moments."""
        if state.last[0] != state.last[0]:
            raise InconsistentState(
                f"{self.name} was fitted to another motion, with h = {self.h:g}, |mu|^2 = {self.constants[0]:g} and energy "
                f"{self.constants[1]:g}. Fit it to this one: ExactMoserVeselov.of(body, start, h)"
            )
        return super().step(system, t, state, h)

    def inertia(self, system: Any) -> Vec | Mat:
        """The fitted moments."""
        return self.moments


def _fingerprint(system: Any, mu: Vec) -> Vec:
    """|mu|^2 and the energy, which tell an orbit, and the velocity of some momentum, which tells the body."""
    return vec(dot(mu, mu), system.energy(mu), *system.velocity(vec(1.0, 2.0, 3.0)))


def _minus(m: Mat, s: float) -> Mat:
    """-(m + s 1)."""
    return -1.0 * plus(m, s)


def require_free_body(method: Method, system: Any) -> None:
    """Raise IncompatibleSystem unless the system is a free rigid body: kinetic energy on SO(3)."""
    if not (isinstance(getattr(system, "group", None), SO3) and isinstance(getattr(system, "hamiltonian", None), KineticEnergy)):
        raise IncompatibleSystem(
            f"{method!r} is a method for the free rigid body, such as RigidBody([1.0, 1.5, 2.0]); got {system!r}. "
            "For this one use CovariantVariational(Exponential()), which keeps the same structure, or RKMK(order=4)"
        )
