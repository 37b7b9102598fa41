"""The method of Moser and Veselov: the free rigid body as a discrete integrable system."""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np

from ...errors import IncompatibleSystem, InconsistentState, InvalidInput, NoConvergence
from ...formulas import Mat, Vec, cross, dot, norm, outer, record, sqrt, vec, vectors, where
from ...groups.retractions import Cayley
from ...groups.rigid.so3 import SO3, plus
from ...groups.rigid.unit_quaternions import UnitQuaternions
from ...solvers import beyond_fold, newton
from ...systems.kinetic_energy import has_inertia, times, trace
from ...systems.lie_poisson import BodyState
from ...systems.system import System
from ..implicit import Implicit
from ..memory import Memory, extrapolated
from ..method import Method
from ..variational import with_inertia
from .exact_free_body import ExactFreeBody


@record
class MoserVeselov(Implicit):
    """The discrete rigid body of Moser and Veselov: steps F that extremise sum tr(F J_d),
    J_d = tr(J)/2 - J.

        h hat(mu_n) = F J_d - J_d F^T,   mu_n+1 = F^T mu_n,   g_n+1 = g_n F

    With F = cay(x) the first line is J x = h (dcay_x^-1)* mu_n, left-trivialised: Algorithm 1 with
    the inverse on the other side.  Order 2, symmetric, Poisson; it keeps the energy of the body and
    the spatial momentum to rounding: its steps lie on the exact orbit, at slightly wrong times.
    Steps must be short: it has no solution beyond h|mu| of about the least moment.

    Free rigid bodies only.  Raises NoConvergence where the step is too large.
    Source: Moser and Veselov, Commun. Math. Phys. 139 (1991); Hairer, Lubich, Wanner, VII.5.
    """

    order: ClassVar[int] = 2
    symmetric: ClassVar[bool] = True
    symplectic: ClassVar[bool] = True
    name = "Moser-Veselov"

    def require(self, system: Any) -> None:
        super().require(system)
        require_free_body(self, system)

    def first(self, system: Any, state: BodyState, h: float) -> Vec:
        return h * system.velocity(state.mu)

    def step(self, system: Any, t: float, memory: Memory, h: float) -> Memory:
        """Solve for the displacement from the extrapolated one, then move momentum and attitude by it."""
        x = self.displacement(system, h, memory.state.mu, extrapolated(*memory.past))
        return self.after(memory, system.displaced(Cayley(), memory.state, x), x)

    def inertia(self, system: Any) -> Vec | Mat:
        """The moments J, or their matrix."""
        return system.hamiltonian.inertia

    def displacement(self, system: Any, h: float, mu: Vec, guess: Vec) -> Vec:
        """The x with J x = y - x x y/2 + x (x.y)/4, y = h mu."""
        y = h * mu
        x, size, enough, folded = newton(lambda x: self.equation(system, y, x), guess, dot(y, y))
        if folded or not size <= enough:
            raise NoConvergence(
                f"{self!r}: no step F from here with h hat(mu) = F J_d - J_d F^T, it would have to "
                f"turn by more than the body can: h|mu| = {norm(y):.2g}, mismatch "
                f"{sqrt(size):.1e}, wanted {sqrt(enough):.1e}. The step h = {h:g} is too large; "
                f"try {0.25 * h:g}, or "
                "CovariantVariational(Cayley()), which has a solution for every h"
            )
        return x

    def equation(self, system: Any, y: Vec, x: Vec) -> tuple[Vec, Mat, float]:
        """J x - y + x x y/2 - x (x.y)/4 and its derivative, beside y."""
        return _equation(self.inertia(system), system.group.algebra, y, x)


def _equation(inertia: Vec | Mat, algebra: Any, y: Vec, x: Vec) -> tuple[Vec, Mat, float]:
    """The equation of a step for these moments."""
    s = 0.25 * dot(x, y)
    r = times(inertia, x) - (y + (s * x - 0.5 * cross(x, y)))
    return r, _slope(inertia, algebra, y, x, s), 1.0


def _slope(inertia: Vec | Mat, algebra: Any, y: Vec, x: Vec, s: float) -> Mat:
    """Its derivative by x, where s = x.y/4."""
    return with_inertia(-1.0 * plus(outer(0.25 * x, y) + algebra.hat(0.5 * y), s), inertia)


NAN = math.nan

PARALLEL = 2.0**-100
"""If the part of a vector perpendicular to another one is smaller than this (squared, relative),
its direction is rounding.
"""

SHORT, TRIED = 0.5, 16
"""Above SHORT of the least moment, h|mu| may have no solution later on the orbit: TRIED steps are tested."""

FITTED = 1e-10
"""How far, relatively, steps may be from the exact ones, and a start from the constants for which a
method was fitted.
"""


@record
class ExactMoserVeselov(MoserVeselov):
    """The exact motion of a free body, by steps of Moser and Veselov for a body with other moments,
    1/J'_j = (1 + s)/J_j + d.

    Its energy is (1 + s) H + d |mu|^2/2, so it has the same orbits, and its discrete motion is a
    shift of the two angles of the continuous one: along the orbit, and about the spatial momentum.
    The numbers s and d make both shifts right, for one energy, one |mu| and one h.  A step costs
    what a step of Moser-Veselov costs, and nothing but rounding errors is left.

    `ExactMoserVeselov.of(body, start, h)` fits the method; it steps from such a start, with h or
    -h, and refuses others.  Momenta and attitudes that it did not see stay exact as long as energy
    and |mu| are the same.

    Source: Hairer and Vilmart, J. Phys. A 39 (2006), and McLachlan and Zanna, Found. Comput. Math.
    5 (2005), who expand s and d in powers of h.
    """

    symplectic: ClassVar[bool] = False  # s and d belong to one orbit

    h: float
    constants: Vec
    moments: Vec | Mat
    name = "Exact Moser-Veselov"

    @classmethod
    def of(cls, body: Any, start: BodyState, h: float) -> ExactMoserVeselov:
        """The method for a free body, a start and a length of steps, fitted to the exact motion.

        An exact step cay(x) is one of Moser and Veselov if J'x = r, r = y - x x y/2 + x (x.y)/4,
        y = h mu.  With 1/J' = (1 + s)/J + d these are linear equations for s and d.  They are taken
        where the orbit meets the plane of the least and the largest moment; there r and r/J differ
        most.

        Raises IncompatibleSystem unless it is a free rigid body, NoConvergence if h is too large.
        """
        require_free_body("ExactMoserVeselov", body)
        if start.bodies is not None:
            raise InvalidInput("ExactMoserVeselov.of takes one body at a time: the method is fitted to its energy")
        inverse, mu, unit = _in_the_plane(body, start.mu)
        x, y = _exact_displacement(inverse, mu, unit * h), (unit * h) * mu
        quarter = 0.25 * dot(x, y)
        r = y + (quarter * x - 0.5 * cross(x, y))
        slow = inverse * r
        s, d, off = _combined(slow, r, x - slow)
        moments = 1.0 / vec(*[(1.0 + s) * k + d for k in inverse])
        folded = beyond_fold(_slope(moments, body.group.algebra, y, x, quarter), 1.0)
        if folded or not (norm(off) <= FITTED * norm(x) and min(moments) > 0.0):
            raise NoConvergence(
                "ExactMoserVeselov: no moments found whose steps are exact, they are off by "
                f"{norm(off):.1e}. The step h = {h:g} is too large "
                f"for this motion; try {0.25 * h:g}"
            )
        K: Any = body.hamiltonian.inverse
        shift = d * trace(K) / (inverse[0] + inverse[1] + inverse[2])
        fitted: Any = (
            1.0 / vec(*[(1.0 + s) * k + shift for k in K])
            if isinstance(K, vectors.Vec)
            else np.linalg.inv(np.array(plus((1.0 + s) * K, shift)))
        )
        method = cls(h, _fingerprint(body, start.mu), fitted)
        if norm(y) * max(inverse) > SHORT:
            memory = method.start(body, BodyState(start.mu, None), h)
            for _ in range(TRIED):
                memory = method.step(body, 0.0, memory, h)
        return method

    def first(self, system: Any, state: BodyState, h: float) -> Vec:
        """The displacement at the velocity of the start; no number at all if the method was not
        fitted to this start and h.
        """
        other = abs(h) != abs(self.h)
        for actual, expected in zip(_fingerprint(system, state.mu), self.constants):
            other = other or abs(actual - expected) > FITTED * abs(expected)
        return where(other, NAN, h) * system.velocity(state.mu)

    def step(self, system: Any, t: float, memory: Memory, h: float) -> Memory:
        """One step of the body with the other moments."""
        if memory.past[0][0] != memory.past[0][0]:
            raise InconsistentState(
                f"{self.name} was fitted to another motion, with h = {self.h:g}, |mu|^2 = "
                f"{self.constants[0]:g} and energy {self.constants[1]:g}. Fit it to this one: "
                "ExactMoserVeselov.of(body, start, h)"
            )
        return super().step(system, t, memory, h)

    def inertia(self, system: Any) -> Vec | Mat:
        return self.moments


def _in_the_plane(body: Any, mu: Vec) -> tuple[Vec, Vec, float]:
    """1/J of the principal moments; a momentum of the same orbit, in principal axes, without
    component along the middle one.

    Both in units near to their size, and the factor that makes steps of time those of such units.
    mu_1^2 = J_1/(J_3 - J_1) sum_i mu_i^2 (J_3 - J_i)/J_i from energy and |mu|^2, and likewise
    mu_3^2.
    """
    J, m = body.hamiltonian.inertia, mu
    if isinstance(J, vectors.Mat):
        moments, axes = np.linalg.eigh(np.array(J))
        J, m = Vec.of(moments.tolist()), Vec.of((np.array(mu) @ axes).tolist())
    order = sorted(range(3), key=lambda i: J[i])
    j, u = 2.0 ** math.frexp(J[order[0]])[1], 2.0 ** math.frexp(max(map(abs, m)))[1]
    J1, J2, J3 = J = vec(*[J[i] / j for i in order])
    squares = vec(*[(m[i] / u) * (m[i] / u) for i in order]) / J
    if J1 < J3:
        first = J1 / (J3 - J1) * (squares[0] * (J3 - J1) + squares[1] * (J3 - J2))
        last = J3 / (J3 - J1) * (squares[1] * (J2 - J1) + squares[2] * (J3 - J1))
        return 1.0 / J, vec(sqrt(first), 0.0, sqrt(last)), u / j
    return 1.0 / J, vec(*[m[i] / u for i in order]), u / j


_EXACT = ExactFreeBody()


def _exact_displacement(inverse: Vec, mu: Vec, h: float) -> Vec:
    """The x with cay(x) the exact step of h, of more than half a turn no number at all."""
    orbit, parts, unit = _EXACT._cut(inverse, mu, h)
    x = orbit.displacement(mu, unit)
    z = 0.5 * x
    for _ in range(int(parts) - 1):
        mu = SO3().algebra.cayley_Ad_star(x, mu)
        x = orbit.displacement(mu, unit)
        half = 0.5 * x
        left = 1.0 - dot(z, half)  # tan of half the angle, times the axis: Rodrigues' formula
        z = (1.0 / left if left > 0.0 else NAN) * (z + half + cross(z, half))
    return 2.0 * z


def _combined(a: Vec, b: Vec, wanted: Vec) -> tuple[float, float, Vec]:
    """The s and d with s a + d b = wanted, and what is left of it; s = 0 if a and b are parallel."""
    size = dot(b, b) or 1.0
    across, wanted_across = (v - (dot(v, b) / size) * b for v in (a, wanted))
    spread = dot(across, across)
    s = dot(across, wanted_across) / spread if spread > PARALLEL * dot(a, a) else 0.0
    d = dot(b, wanted - s * a) / size
    return s, d, wanted - s * a - d * b


def _fingerprint(system: Any, mu: Vec) -> Vec:
    """|mu|^2 and the energy, which tell an orbit, and the velocity of some momentum, which tells the body."""
    return vec(dot(mu, mu), system.energy(mu), *system.velocity(vec(1.0, 2.0, 3.0)))


def require_free_body(method: Method | str, system: Any) -> None:
    """Raise IncompatibleSystem unless the system is a free rigid body: kinetic energy on SO(3) or
    the unit quaternions.
    """
    body = system.lie_poisson if isinstance(system, System) else None
    if body is None or not isinstance(body.group, (SO3, UnitQuaternions)) or not has_inertia(body.hamiltonian):
        raise IncompatibleSystem(
            f"{method} is a method for the free rigid body, such as RigidBody([1.0, 1.5, 2.0]); "
            f"got {system!r}. For this one use CovariantVariational(Exponential()), which keeps "
            "the same structure, or RKMK(order=4)"
        )
