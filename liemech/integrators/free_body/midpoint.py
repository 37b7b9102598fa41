"""Midpoint rules for the momenta of rotations, so(3)*: the plain one, the spherical one, and the
isospectral ones of Gauss.
"""

from __future__ import annotations

import functools
from typing import Any, ClassVar

from ...errors import IncompatibleSystem, InvalidInput
from ...formulas import Mat, Vec, constant, cross, dot, jacobian, mat, record, sqrt, transpose, vec, where
from ...formulas.numbers.sizes import magnitudes
from ...groups.composed.product import ProductGroup, spans
from ...groups.matrices.matrix_group import MatrixLieGroup
from ...groups.retractions import Cayley
from ...groups.rigid.so3 import SO3, plus
from ...groups.rigid.unit_quaternions import UnitQuaternions
from ...groups.vector_space import VectorSpace
from ...solvers import fixed_point, newton
from ...systems.equations.isospectral_flow import IsospectralFlow
from ...systems.lie_poisson import BodyState, LiePoissonSystem
from ...systems.system import lies_in_memory
from ...tableaus.collocation import gauss
from ...tableaus.trees import Row
from ..implicit import Implicit
from ..memory import Memory, continued, extrapolated
from ..method import Method
from ..rkmk import combination
from . import isospectral_matrices


@record
class ImplicitMidpoint(Implicit):
    """The implicit midpoint rule for mu' = mu x xi(mu), as if momenta were just vectors: a method
    to compare with.

        mu_n+1 = mu_n + h m x xi(m),   m = (mu_n + mu_n+1)/2,   that is   mu_n+1 = Ad*_cay(h xi(m)) mu_n,   g_n+1 = g_n cay(h xi(m))

    Order 2, symmetric; |mu| and spatial momentum are kept to rounding, and so is a quadratic
    energy, of which it is the discrete gradient.  But it is not a Poisson map: on so(3)*, whose
    bracket depends on mu, only the spherical rule is.

    Rotations, and products of rotations and vector spaces, with any Hamiltonian; rotations with
    `DoubleBracket` damping.  Raises NoConvergence.
    Source: Hairer, Lubich, Wanner, IV.2.1, VI.4; Austin, Krishnaprasad, Wang, J. Comput. Phys. 107
    (1993).
    """

    order: ClassVar[int] = 2
    symmetric: ClassVar[bool] = True
    damped: ClassVar[bool] = True  # does it step damped and noisy motions along orbits, too?
    name = "Implicit midpoint"

    def turn(self, system: Any, h: float, m: Vec, mu: Vec) -> Vec:
        """The displacement x that belongs to a mean m of the rotations: mu_n+1 - mu_n = m x x."""
        return h * system.velocity(among(system.group, m, mu))

    def require(self, system: Any) -> None:
        """A Lie-Poisson system of rotations, damped or not, or of a product with some."""
        super().require(system)
        require_rotations(self, system, self.damped, products=True)

    def first(self, system: Any, state: BodyState, h: float) -> Vec:
        """The mean is the momentum itself, of the rotations."""
        return of_rotations(system.group, state.mu)

    def step(self, system: Any, t: float, memory: Memory, h: float) -> Memory:
        """Solve for the mean from the extrapolated one, then move momentum and attitude by the
        displacement that belongs to it.
        """
        state = memory.state
        m = self.mean(system, h, state.mu, extrapolated(*memory.past))
        x = self.turn(system, h, m, state.mu)
        return self.after(memory, system.displaced(Cayley(), state, x), m)

    def mean(self, system: Any, h: float, mu: Vec, guess: Vec) -> Vec:
        """The m with m - m x x(m)/2 = mu."""
        turning = of_rotations(system.group, mu)
        m, size, enough, _ = newton(
            lambda m: self.equation(system, h, mu, m), guess, turning, coupled=system.hamiltonian.coupled
        )
        if not size <= enough:
            raise self._unsolved(h, size, enough)
        return m

    def equation(self, system: Any, h: float, mu: Vec, m: Vec) -> tuple[Vec, Mat, float]:
        """m - m x x(m)/2 - mu and its derivative, beside mu; of several rotations in a row."""
        group = system.group

        def half(m: Vec) -> Vec:
            return of_rotations(group, self.turn(system, 0.5 * h, m, mu))

        r: list[Any] = []
        rows: list[Any] = []
        x, by_m, start = half(m), jacobian(half, m), of_rotations(group, mu)
        hat = SO3().algebra.hat
        for k in range(len(m) // 3):
            i, j = 3 * k, 3 * k + 3
            r = [*r, *((m[i:j] - start[i:j]) - cross(m[i:j], x[i:j]))]
            turned, spin = hat(m[i:j]) @ mat(*[by_m[n] for n in range(i, j)]), hat(x[i:j])
            for a in range(3):
                row = [spin[a][n - i] - turned[a][n] if i <= n < j else -turned[a][n] for n in range(len(m))]
                rows = [*rows, vec(*[y + 1.0 if n == i + a else y for n, y in enumerate(row)])]
        return vec(*r), mat(*rows), 1.0


RANGE = 2.0**-960
"""Squares below this, or beyond its inverse, lose digits in what is made of them."""


@record
class SphericalMidpoint(ImplicitMidpoint):
    """The midpoint rule of spheres: the velocity is taken where the mean of both momenta points,
    but on their sphere.

        mu_n+1 = mu_n + h M x xi(M),   M = |mu_n| m/|m|,   m = (mu_n + mu_n+1)/2

    It turns by cay(h |mu_n|/|m| xi(M)), and so does g.  Order 2, symmetric, and a Poisson map of
    so(3)*; |mu|, spatial momentum and the quadratic energy of one body are kept to rounding.  A
    method for momenta: together with the attitude it is not symplectic on T*SO(3).

    Rotations, and products of rotations and vector spaces, each with a sphere of its own, with any
    Hamiltonian; many coupled ones are swept together.  Raises NoConvergence.
    Source: McLachlan, Modin, Verdier, Phys. Rev. E 89 (2014) and Math. Comp. 86 (2017).
    """

    symplectic: ClassVar[bool] = True
    of_momenta: ClassVar[bool] = True
    damped: ClassVar[bool] = False
    name = "Spherical midpoint"

    def first(self, system: Any, state: BodyState, h: float) -> Vec:
        """The mean is the momentum itself, whose length must have a square: raises InvalidInput."""
        mu = super().first(system, state, h)
        for i in range(0, len(mu), 3):
            part = mu[i : i + 3]
            size = abs(part[0]) + abs(part[1]) + abs(part[2])
            if size > 0.0 and not RANGE < dot(part, part) < 1.0 / RANGE:
                raise InvalidInput(
                    f"{self!r}: the square of a momentum of {size:.1e} leaves the range of floats; take another unit "
                    "of mass or time, or ImplicitMidpoint()"
                )
        return mu

    def turn(self, system: Any, h: float, m: Vec, mu: Vec) -> Vec:
        """h s xi(s m), s = |mu|/|m| of each rotation."""
        group = system.group
        start = of_rotations(group, mu)
        scales = [_scale(m[i : i + 3], start[i : i + 3]) for i in range(0, len(m), 3)]
        on_spheres = vec(*[scales[n // 3] * m[n] for n in range(len(m))])
        xi = system.velocity(among(group, on_spheres, mu))
        if len(xi) == 3:
            return (h * scales[0]) * xi
        x = [h * y for y in xi]
        for s, (i, j) in zip(scales, rotations(group)):
            x = [*x[:i], *[(h * s) * y for y in xi[i:j]], *x[j:]]
        return vec(*x)


def _scale(m: Vec, mu: Vec) -> float:
    """|mu|/|m|; one where the sphere is a point, and at a first guess that is zero."""
    point = (constant(dot(mu, mu)) == 0.0) | (constant(dot(m, m)) == 0.0)
    return sqrt(where(point, 1.0, dot(mu, mu))) / sqrt(where(point, 1.0, dot(m, m)))


@record
class Isospectral(Implicit):
    """The isospectral methods of Gauss: a symplectic Runge-Kutta method of the group, seen from the
    momenta.

    With the tableau of Gauss and B_j = -hat(xi(mu_j)) for the momenta mu_j = Q_j mu Q_j^-1 (as
    matrices) of the stages,

        Q_i = 1 + h sum_j a_ij B_j Q_j,   Q = 1 + h sum_j b_j B_j Q_j,   mu_n+1 = Q mu_n,   g_n+1 = g_n Q^T

    order : 2, 4, 6, 8 or 10, twice the number of stages.  Of order 2 it is Algorithm 1 with the
    Cayley map.  Symmetric, Poisson; spatial momentum and Casimirs are kept to rounding, the energy
    oscillates without drift.

    Rotations, and groups of matrices of any size whose algebra is closed under the adjoint x^H: SO(n),
    SU(n), U(n), SL(n), GL(n), Sp(2n), with any Hamiltonian.  There the momentum is the matrix W of
    W' = [W, hat(xi)]; elements of SU(n) and SL(n) move like those of U(n) and GL(n), divided by the n-th
    root of the determinant.  Stages are iterated to
    rounding; raises NoConvergence.
    Source: Modin and Viviani, Lie-Poisson methods for isospectral flows, Found. Comput. Math. 20
    (2020).
    """

    title: ClassVar[str] = "Isospectral Gauss {0.order}"
    symmetric: ClassVar[bool] = True
    symplectic: ClassVar[bool] = True

    orders: ClassVar[tuple[int, ...]] = 2, 4, 6, 8, 10
    order: int = 4

    @functools.cached_property
    def tableau(self) -> tuple[tuple[Row, ...], Row]:
        """A and b of Gauss' method."""
        data = gauss(self.order // 2)
        return data.A, data.b

    def require(self, system: Any) -> None:
        """A Lie-Poisson system of rotations or of other matrices: the step adds to them what it turns."""
        super().require(system)
        if by_matrices(system):
            reason = system.group.why_not_isospectral()
            if reason is not None:
                raise IncompatibleSystem(
                    f"{self!r} moves momenta as matrices by conjugation; {system.group!r}: {reason}. "
                    f"{system.alternatives}"
                )
            return
        require_rotations(self, system)
        if isinstance(system.group, UnitQuaternions):
            raise IncompatibleSystem(
                f"{self!r} moves rotation matrices, not quaternions; got {system!r}. Use "
                "group=SO3(), or ImplicitMidpoint()"
            )

    def beginning(self, system: Any, state: BodyState, h: float) -> Any:
        first = self.first(system, state, h)
        return (first,) * (6 if lies_in_memory(system.group) else 3)

    def first(self, system: Any, state: BodyState, h: float) -> Any:
        """h B at the start, for all stages; of large matrices and order 2 the momentum itself."""
        if by_matrices(system):
            w = isospectral_matrices.matrix_of(system, state.mu)
            if self.order == 2:
                return w
            b = isospectral_matrices.each(lambda x: (-h) * x, isospectral_matrices.velocity_of(system, w))
            both = (b,) if isospectral_matrices.by_antihermitian(system) else (b, -b)
            return (both,) * (self.order // 2)
        first = system.group.algebra.hat(-h * system.velocity(state.mu))
        return tuple([first for _ in range(self.order // 2)])

    def step(self, system: Any, t: float, memory: Memory, h: float) -> Memory:
        """Iterate the stages from the extrapolated ones, then add what the step turns."""
        if by_matrices(system):
            return self._step_of_matrices(system, memory, h)
        state, guess = memory.state, [extrapolated(*stage) for stage in zip(*memory.past)]
        stages = fixed_point(lambda guess: self._sweep(system, h, state.mu, guess), guess, self, h)
        turned = combination(self.tableau[1], stages)
        g = None if state.g is None else state.g + state.g @ turned.T
        return self.after(memory, BodyState(state.mu + turned @ state.mu, g), tuple(stages))

    def _step_of_matrices(self, system: Any, memory: Memory, h: float) -> Memory:
        """A step of momenta that are matrices."""
        state, guess = memory.state, continued(memory.past)
        w = isospectral_matrices.matrix_of(system, state.mu)
        g = state.g
        if self.order == 2:
            stages, turned = isospectral_matrices.midpoint(system, w, guess, self, h)
            change = isospectral_matrices.each(lambda x: -2.0 * x, turned)
            if g is not None:
                g = g + g @ isospectral_matrices.midpoint_turn(system, stages, h)
        else:
            stages = isospectral_matrices.stages(system, self.tableau[0], w, guess, self, h)
            q, r = isospectral_matrices.increments(system, self.tableau[1], stages)
            change = isospectral_matrices.conjugated(system, w, q, r)
            if g is not None:
                g = g + g @ isospectral_matrices.on_group(system.group, isospectral_matrices.in_group(system, r))
        mu = state.mu + isospectral_matrices.momentum_of(system, change)
        return Memory(BodyState(mu, g), memory.node, (stages, *memory.past[:-1]))

    def _sweep(self, system: Any, h: float, mu: Vec, stages: list[Mat]) -> tuple[list[Mat], float, float]:
        """Every stage Z_j = h B_j Q_j anew, each from the new ones before it; their change and their size."""
        change, size = 0.0, 0.0
        for i, row in enumerate(self.tableau[0]):
            q = plus(combination(row, stages), 1.0)
            xi = (-h) * system.velocity(cofactors(q) @ mu)
            new, old = transpose(mat(*[cross(xi, column) for column in q.T])), stages[i]
            stages = [*stages[:i], new, *stages[i + 1 :]]
            for a, b in zip(new, old):
                moved, whole = magnitudes(a - b), magnitudes(a)
                change, size = change + dot(moved, moved), size + dot(whole, whole)
        return stages, sqrt(change), sqrt(size)


def by_matrices(system: Any) -> bool:
    """Whether this is a Lie-Poisson system of a group of matrices given by generators."""
    served = isinstance(system, (LiePoissonSystem, IsospectralFlow))
    return served and isinstance(system.group, MatrixLieGroup)


def cofactors(q: Mat) -> Mat:
    """det(q) q^-T: how q hat(mu) q^T acts on vectors, q hat(mu) q^T = hat(cofactors(q) mu)."""
    return mat(cross(q[1], q[2]), cross(q[2], q[0]), cross(q[0], q[1]))


def require_rotations(method: Method, system: Any, damped: bool = False, products: bool = False) -> None:
    """Raise IncompatibleSystem unless the system is a Lie-Poisson system of rotations, or on a product of rotations and
    vector spaces where these are served.

    damped : or another one whose momentum alone says how it moves along its orbit?
    """
    group = getattr(system, "group", None)
    along_orbits = getattr(system, "along_orbits", False) if damped else isinstance(system, LiePoissonSystem)
    served = along_orbits and isinstance(group, (SO3, UnitQuaternions))
    if products and isinstance(system, LiePoissonSystem) and isinstance(group, ProductGroup):
        factors = {type(factor) for factor in group.factors}
        served = factors <= {SO3, UnitQuaternions, VectorSpace} and factors != {VectorSpace}
    if not served:
        extension = ", or on a product of it with vector spaces" if products else ""
        raise IncompatibleSystem(
            f"{method!r} is a method for momenta on so(3)*, a LiePoissonSystem on SO3() such as "
            f"RigidBody([1.0, 1.5, 2.0]){extension}; got {system!r}. RKMK(order=4) accepts every system"
        )


def rotations(group: Any) -> list[tuple[int, int]]:
    """The ranges of the momenta of the rotations among those of a group."""
    if not isinstance(group, ProductGroup):
        return [(0, 3)]
    places = spans([factor.dim for factor in group.factors])
    return [at for f, at in zip(group.factors, places) if not isinstance(f, VectorSpace)]


def of_rotations(group: Any, x: Vec) -> Vec:
    """The components of the rotations, in a row.  x : (dim,)."""
    if not isinstance(group, ProductGroup):
        return x
    return vec(*[y for i, j in rotations(group) for y in x[i:j]])


def among(group: Any, m: Vec, mu: Vec) -> Vec:
    """Momenta of the rotations among the others, which stay.  m : those of the rotations in a row,
    mu : (dim,).
    """
    if not isinstance(group, ProductGroup):
        return m
    momenta, k = [*mu], 0
    for i, j in rotations(group):
        momenta, k = [*momenta[:i], *m[k : k + 3], *momenta[j:]], k + 3
    return vec(*momenta)
