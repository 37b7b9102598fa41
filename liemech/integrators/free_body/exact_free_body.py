"""The exact motion of a free rigid body as a formula for one step: no iteration, no branches.

Let the step be 2, by choice of the unit of time, K = J^-1 and G = |mu|.  Constants of motion are mu . K mu and what is
made of

    D = K - mu . K mu/G^2,   C = G^2 cof D,   sigma = tr C,   and wp, Weierstrass' function with the roots e_i = C_i - sigma/3.

The momentum follows by the addition theorem.  With r_i(s)^2 = wp(s) - e_i, along principal axes i, j, k,

    mu_i(2) = (r_j r_k mu_i + r_i mu_i')/(wp(2) + sigma/3 + |mu'|^2/G^2),
    r_i(2)  = ((wp(1) - e_i)^2 - (e_i - e_j)(e_i - e_k))/(-wp'(1)).

The displacement is the least rotation from mu to mu(2), and a rotation about mu by an angle psi, in
Cayley's coordinates

    x = b K m + a m,   m = (mu + mu(2))/2,   mu(2) - mu = m x x = b m x K m,
    b = 2 c/u,   c = wp(1) + sigma/3 + |M'|^2/G^2,   u = r_1 r_2 r_3(1),   x . m = 2 G tan(psi/2),

with M' = mu' half-way, M_i' = c (mu_i(2) - mu_i)/(2 r_i(1)), which makes c the root of a quadratic
equation.  A vector of this form keeps energy and |mu| whatever a and b are.  So what all steps of
an orbit round alike changes the time, and the energy does not drift.

The angle psi is the same all along an orbit, a function of the step and the constants: seen where
the middle of the step lies in a principal plane it is

    psi = 2 mu . K mu/G + 2 G^3 det D int_0^1 ds/(wp(s) + sigma/3).

The power series of wp and three nodes of Gauss give all this to rounding, on either side of the
separatrix and on it, for any moments: each formula is symmetric in the axes, and polynomial in K.

Source: Jacobi, J. reine angew. Math. 39 (1850); Whittaker, Analytical Dynamics, 4th ed., sections
69-71; for wp DLMF 23.2, 23.9, 23.10.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np

from ...errors import IncompatibleSystem, NoConvergence
from ...formulas import Mat, Record, Vec, constant, cross, dot, mat, record, sqrt, vec, vectors, where
from ...formulas.classes.layouts import layout_of
from ...formulas.classes.records import with_fields
from ...formulas.numbers.conversions import fitted
from ...groups.composed.power import PowerGroup
from ...groups.composed.product import ProductGroup, entries
from ...groups.composed.species import SpeciesGroup
from ...groups.retractions import Cayley, Exponential
from ...groups.rigid.rotation_coefficients import LIMIT, SINC, VERSINE, polynomial
from ...groups.rigid.se3 import SE3, join
from ...groups.rigid.so3 import SO3, plus
from ...groups.rigid.unit_quaternions import UnitQuaternions
from ...groups.vector_space import VectorSpace
from ...solvers import unit_of
from ...systems.kinetic_energy import has_inertia, times, trace
from ...systems.lie_poisson import BodyState
from ...systems.many.energies import OfSpecies
from ...systems.mechanical import MechanicalSystem
from ..method import Method

TURN = 0.25 * LIMIT
"""Up to this |K mu|^2 a step turns by a tenth of a turn at most, far from the half turn that no
Cayley map reaches; and up to this size of C the terms of wp and the nodes are accurate to 1e-16.
"""

FINE = 2.0**-900
"""If |mu|^2 is below FINE or beyond 1/FINE, mu is scaled to a size near one; a body whose |mu|^2 is
still below FINE is at rest.
"""

PARTS = 2.0**20
"""A step of more parts than this, a hundred thousand turns, is refused as a mistake."""

NODES = (0.16471028689654242, 0.5498684992164436, 0.9008058292716294)
WEIGHTS = (0.06289133716441942, 0.15380118384095637, 0.11664081232795754)
"""int_0^1 f(s^2) s^2 ds = sum of weight f(node) for polynomials f of degree 5.  Source: DLMF 3.5(v), Gauss-Jacobi."""


@record
class ExactFreeBody(Method):
    """The exact motion of a free rigid body, momentum and attitude, whatever the step: nothing is
    left but rounding errors.

    Explicit, symmetric, symplectic; energy, |mu| and spatial momentum kept to rounding.  A step of
    more than a tenth of a turn is made in equal parts.
    Also for a body in space, on SE3(): it turns freely, its centre of mass flies straight; for
    masses on VectorSpace(n); and on products of rotations and vector spaces, such as
    ProductGroup(SO3(), VectorSpace(3)), whose inertia does not couple them.  On a power of such a
    group every site moves so.

    Without a field `body.exact` gives any time at once.  In a field it is the free part of a
    splitting, `KickDrift`.
    Source: Jacobi, J. reine angew. Math. 39 (1850); as a part of splittings Celledoni, Fasso,
    Safstrom and Zanna, SIAM J. Sci.  Comput. 30 (2008).
    """

    order: ClassVar[float] = math.inf
    symmetric: ClassVar[bool] = True
    symplectic: ClassVar[bool] = True
    name = "Exact free body"

    def require(self, system: Any) -> None:
        """A free rigid body, with or without its centre of mass."""
        super().require(system)
        reason = _why_not(system)
        if reason:
            others = (
                "CovariantVariational(Exponential()) keeps the same structure, RKMK(order=8) and Taylor() are accurate"
            )
            instead = f"KickDrift({self!r}) splits the field off" if isinstance(system, MechanicalSystem) else others
            raise IncompatibleSystem(
                f"{self!r} is the exact motion of a free rigid body; {system!r} is none, {reason}. {instead}"
            )

    def step(self, system: Any, t: float, state: BodyState, h: float) -> BodyState:
        """Move along the orbit in equal parts short enough for the formula; mostly one part is enough."""
        if isinstance(system.group, (PowerGroup, SpeciesGroup)):
            return self._site_by_site(system, t, state, h)
        if isinstance(system.hamiltonian, OfSpecies):
            return self._of_species(system, t, state, h)
        if isinstance(system.group, ProductGroup):
            return self._factor_by_factor(system, state, h)
        if isinstance(system.group, VectorSpace):
            moved = system.displaced(Exponential(), state, h * system.velocity(state.mu))
            return fitted(moved, layout_of(state))
        return self._turned(system, system.hamiltonian.inverse, state, h)

    def _turned(self, system: Any, inverse: Vec | Mat, state: BodyState, h: float) -> BodyState:
        """The step of one body."""
        orbit, parts, unit = self._cut(_turning(inverse), _turning(state.mu), h)
        layout, done = layout_of(state), 0.0
        while done < parts:
            if done > 0.0:  # by what is rounded a needle leaves the orbit of its start
                K, D, action, square, per_square, unit = _constants(_turning(inverse), _turning(state.mu), h / parts)
                orbit = _orbit(K, D, action, square, per_square)
            x = _with_flight(system, orbit.displacement(_turning(state.mu), unit), state.mu, h / parts)
            state = fitted(system.displaced(Cayley(), state, x), layout)
            done = done + 1.0
        return state

    def _factor_by_factor(self, system: Any, state: BodyState, h: float) -> BodyState:
        """The step on a product: rotations turn freely, vectors move straight."""
        group, inverse = system.group, system.hamiltonian.inverse
        elements = None if state.g is None else group.split(state.g)
        mu: list[Any] = []
        g: list[Any] = []
        for k, factor in enumerate(group.factors):
            i = sum([other.dim for other in group.factors[:k]])
            j = i + factor.dim
            of_factor = with_fields(system, group=factor)
            part = BodyState(state.mu[i:j], None if elements is None else elements[k])
            block = _block(inverse, i, j)
            if isinstance(factor, VectorSpace):
                moved = of_factor.displaced(Exponential(), part, h * times(block, part.mu))
            else:
                moved = self._turned(of_factor, block, part, h)
            mu = [*mu, *moved.mu]
            g = g if elements is None else [*g, *entries(moved.g)]
        return fitted(BodyState(vec(*mu), None if elements is None else vec(*g)), layout_of(state))

    def _site_by_site(self, system: Any, t: float, state: BodyState, h: float) -> BodyState:
        """The step of many sites, each of them a free body, in a row."""
        group = system.group
        mu: list[Any] = []
        g: list[Any] = []
        for i in range(group.copies):
            of_site = with_fields(
                system, group=group.base_of(i), hamiltonian=system.hamiltonian.of_one_at(i), lagrangian=None
            )
            element = None if state.g is None else group.site(state.g, i)
            after = self.step(of_site, t, BodyState(group.momentum_of(state.mu, i), element), h)
            mu = [*mu, *after.mu]
            g = g if after.g is None else [*g, *entries(after.g)]
        return BodyState(vec(*mu), None if state.g is None else vec(*g))

    def _of_species(self, system: Any, t: float, state: BodyState, h: float) -> BodyState:
        """The step of a site that is of one of several species."""

        def step(group: Any, energy: Any, mu: Any, g: Any) -> tuple[Any, Any]:
            of_site = with_fields(system, group=group, hamiltonian=energy, lagrangian=None)
            after = self.step(of_site, t, BodyState(mu, g), h)
            return after.mu, after.g

        return BodyState(*system.hamiltonian.moved(state.mu, state.g, step))

    def _cut(self, inverse: Vec | Mat, mu: Vec, h: float) -> tuple[Orbit, float, float]:
        """The orbit through mu for parts of a step, how many parts make the step, and the factor
        that `displacement` needs.

        inverse : of the inertia, (3,) or (3, 3).  mu : (3,).
        """
        K, D, action, square, per_square, unit = _constants(inverse, mu, h)
        C = square * _cofactors(D)
        # the largest |K mu|^2 on the orbit is action^2/G^2 and at most the size of C
        size = constant(action * action * per_square) + sqrt(constant(trace(times(C, C))))
        parts, size = 1.0, size / TURN
        if size > 1.0:
            while size > 1.0 and parts <= PARTS:
                parts, size = 2.0 * parts, 0.25 * size
            if parts > PARTS:
                raise NoConvergence(
                    f"{self!r}: the step h = {h:g} is too large, the body turns more than a "
                    f"hundred thousand times in it; try {h / size / parts:g}"
                )
            K, D, action = K / parts, D / parts, action / parts
        return _orbit(K, D, action, square, per_square), parts, unit


def _constants(inverse: Vec | Mat, mu: Vec, h: float) -> tuple[Any, Any, float, float, float, float]:
    """K, D, mu . K mu, G^2, its inverse, and the factor by which mu is scaled, for a step.
    inverse : of the inertia, (3,) or (3, 3).  mu : (3,).
    """
    K, unit = (0.5 * h) * inverse, 1.0
    square = dot(mu, mu)
    # nearly at rest, or in units for which squares leave the range of floats
    if not FINE < square < 1.0 / FINE:
        unit = unit_of(mu)
        K, mu = (1.0 / unit) * K, unit * mu
        square = dot(mu, mu)
    action, per_square = dot(mu, times(K, mu)), 1.0 / where(square > FINE, square, 1.0)
    return K, _spread(K, mu, action, per_square), action, square, per_square, unit


def _rate(K: Vec | Mat, mu: Vec) -> Vec:
    """mu x K mu; along axes from differences, as D."""
    if isinstance(K, vectors.Mat):
        return cross(mu, times(K, mu))
    x, y, z = mu
    return vec((K[2] - K[1]) * (y * z), (K[0] - K[2]) * (z * x), (K[1] - K[0]) * (x * y))


def _spread(K: Vec | Mat, mu: Vec, action: float, per_square: float) -> Vec | Mat:
    """D; along axes from differences, which cancel in a needle."""
    if isinstance(K, vectors.Mat):
        return plus(K, -action * per_square)
    a, b, c = (per_square * m * m for m in mu)
    xy, yz, zx = K[0] - K[1], K[1] - K[2], K[2] - K[0]
    return vec(xy * b - zx * c, yz * c - xy * a, zx * a - yz * b)


@record
class Orbit(Record):
    """The constants of all steps of an orbit; u^2 is a common factor, u = -wp'(1)/2, that saves
    divisions.

    Source: this module's first lines.
    """

    K: Any  # J^-1 times half the step
    per_square: float  # 1/G^2
    turning: float  # 2 G tan(psi/2)
    along: Any  # 4 u^2 (r_j r_k - wp(2) - sigma/3)
    across: Any  # 2 u^2 r_i(2)
    scale: float  # 4 u^2 (wp(2) + sigma/3)
    unit: float  # u^2
    reach: float  # 4 c/u, c = wp(1) + sigma/3
    middle: Any  # c r_j^2 r_k^2/(u^2 G^2) at s = 1

    def displacement(self, start: Vec, unit: float) -> Vec:
        """The x = b K m + a m of a step from mu, m the mean of its ends.

        start : mu, perhaps compensated, before it was multiplied by the unit.
        """
        mu = unit * start
        rate = _rate(self.K, mu)
        extra = (4.0 * self.unit) * (self.per_square * dot(rate, rate))
        d = (1.0 / (self.scale + extra)) * ((times(self.along, mu) - extra * mu) + 2.0 * times(self.across, rate))
        b = self.reach / (1.0 + sqrt(1.0 - dot(d, times(self.middle, d))))
        m = mu + 0.5 * d
        m = unit * (start + (b * (0.5 / unit)) * _rate(self.K, m))
        w, square = times(self.K, m), dot(m, m)
        a = (self.turning - b * dot(m, w)) / where(square > 0.5 * FINE, square, 1.0)
        return b * w + a * m


def _orbit(K: Vec | Mat, D: Vec | Mat, action: float, square: float, per_square: float) -> Orbit:
    """The orbit with these constants; action = mu . K mu, square = G^2."""
    C = square * _cofactors(D)
    third = (-1 / 3) * trace(C)
    roots = _plus(C, third)
    squares = times(roots, roots)
    # wp(s) = 1/s^2 + c2 s^2 + c3 s^4 + ... + c8 s^14:  wp(1) = 1 + p,  -wp'(1)/2 = 1 - q
    c2, c3 = 0.1 * trace(squares), (1 / 21) * trace(times(squares, roots))
    s2, s3, s23 = c2 * c2, c3 * c3, c2 * c3
    c4, c5, c6 = (1 / 3) * s2, (3 / 11) * s23, (2 / 39) * (c2 * s2) + (1 / 13) * s3
    c7, c8 = (2 / 33) * (c2 * s23), c2 * ((5 / 663) * (c2 * s2) + (60 / 2431) * s3)
    p = (c2 + c3) + ((c4 + c5) + (c6 + (c7 + c8)))
    q = (c2 + 2.0 * c3) + ((3.0 * c4 + 4.0 * c5) + (5.0 * c6 + (6.0 * c7 + 7.0 * c8)))
    integral = 0.0
    # of s^2 ds over s^2 (wp(s) + sigma/3); s stands for s^2 here
    for s, weight in zip(NODES, WEIGHTS):
        ss = s * s
        low, high = (c2 + s * c3) + ss * (c4 + s * c5), (c6 + s * c7) + ss * c8
        integral = integral + weight / ((1.0 - third * s) + ss * (low + (ss * ss) * high))
    turn = 2.0 * (action + square * (_determinant(D, C) * integral))  # G psi
    sine, versed = (polynomial(SINC, (turn * turn) * per_square), polynomial(VERSINE, (turn * turn) * per_square))
    u = 1.0 - q
    # u (2 r_i - 1)
    grown = _plus(-2.0 * (squares + (1.0 + p) * roots), (2.0 * p + p * p) + (5.0 * c2 + q))
    # scale - u^2, times the unit matrix
    excess = (2.0 * u) * grown + (times(grown, grown) + (4.0 * u * u) * C)
    along = _plus(_cofactors(grown) - (u * grown + excess), u * trace(grown))
    scale = u * u + (1 / 3) * trace(excess)
    per_u, least = 1.0 / u, (1.0 + p) - third
    middle = (least * per_square * per_u * per_u) * _cofactors(_plus(-roots, 1.0 + p))
    turning = 2.0 * turn * versed / sine
    return Orbit(K, per_square, turning, along, u * _plus(grown, u), scale, u * u, 4.0 * least * per_u, middle)


# ------------------------------------------------------------------ a Vec stands for a diagonal matrix


def _plus(m: Vec | Mat, s: float) -> Vec | Mat:
    return plus(m, s) if isinstance(m, vectors.Mat) else vec(m[0] + s, m[1] + s, m[2] + s)


def _cofactors(m: Vec | Mat) -> Vec | Mat:
    if isinstance(m, vectors.Mat):
        return mat(cross(m[1], m[2]), cross(m[2], m[0]), cross(m[0], m[1]))
    return vec(m[1] * m[2], m[2] * m[0], m[0] * m[1])


def _determinant(m: Vec | Mat, cofactors: Vec | Mat) -> float:
    return dot(m[0], cofactors[0]) if isinstance(m, vectors.Mat) else m[0] * cofactors[0]


# ------------------------------------------------------------------ bodies in space


def _turning(a: Vec | Mat) -> Vec | Mat:
    """The part of rotation, of momentum or inertia."""
    return a if len(a) == 3 else _block(a, 0, 3)


def _block(m: Vec | Mat, i: int, j: int) -> Vec | Mat:
    """The rows and columns i to j - 1."""
    return mat(*[m[k][i:j] for k in range(i, j)]) if isinstance(m, vectors.Mat) else m[i:j]


def _with_flight(system: Any, x: Vec, mu: Vec, h: float) -> Vec:
    """The displacement with that of the centre of mass, if there is one: it flies by h v."""
    if len(mu) == 3:
        return x
    v = system.velocity(mu)
    flight = h * vec(v[3], v[4], v[5])
    return join(x, flight - 0.5 * cross(x, flight))


def _why_not(system: Any) -> str:
    """Why a system is not a free rigid body; empty if it is."""
    if isinstance(system, MechanicalSystem):
        return "it is in a field"
    body = system.lie_poisson
    if body is None:
        return "there is more in its motion than its energy, or something else"
    body = body.site_form or body
    if isinstance(body.hamiltonian, OfSpecies):
        hamiltonian: Any = body.hamiltonian
        species = zip(hamiltonian.species.groups, hamiltonian.of_species)
        return next((why for kind in species if (why := _why_no_body(*kind))), "")
    return _why_no_body(body.group, body.hamiltonian)


def _why_no_body(group: Any, energy: Any) -> str:
    """Why an energy on a group is not that of a free rigid body."""
    if isinstance(group, VectorSpace) and has_inertia(energy):
        return ""
    factors = group.factors if isinstance(group, ProductGroup) else (group,)
    kinds = {type(factor) for factor in factors}
    if not (isinstance(group, SE3) or kinds <= {SO3, UnitQuaternions, VectorSpace}):
        return "it does not turn in space"
    if not has_inertia(energy):
        return "its energy is not quadratic"
    if isinstance(group, ProductGroup):
        whole = energy.inertias.copy()
        for k, factor in enumerate(factors):
            i = sum(other.dim for other in factors[:k])
            whole[:, i : i + factor.dim, i : i + factor.dim] = 0.0
        if whole.any():
            return "its inertia couples the factors, as wheels are coupled to their body"
    if isinstance(group, SE3):
        whole = energy.inertias
        mass = whole[:, 3:, 3:]
        if whole[:, :3, 3:].any() or (mass != mass[:, :1, :1] * np.eye(3)).any():
            return "its centre of mass does not fly straight on, as in a fluid"
    return ""
