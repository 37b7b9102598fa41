"""Constrained systems: canonical ones whose positions stay on g(q) = 0, by forces across it."""

from __future__ import annotations

from typing import Any, ClassVar, final

import numpy as np

from ...errors import InconsistentState, InvalidInput, NoConvergence, undefined
from ...formulas import (
    Mat,
    Record,
    Vec,
    constant,
    derivative,
    dot,
    gradient,
    jacobian,
    mat,
    record,
    solve,
    sqrt,
    sum,
    vec,
    where,
)
from ...formulas.classes.derived import closed_form_of, derived, derived_from
from ...formulas.derivatives import tangent
from ...formulas.numbers.bases import Pair
from ...formulas.numbers.series import Series
from ...formulas.numbers.sizes import EPSILON
from ...formulas.vectors import Vec as SmallVec
from ...formulas.vectors import small
from ...solvers import correction, newton
from ...systems.canonical import CanonicalState, CanonicalSystem, HamiltonianSystem
from ...systems.input_checks import as_field
from ...systems.separable import SeparableEnergy, SeparableSystem

CONSISTENT = 2.0**-40
"""A start is on the constraints if they fail by no more than this, relative to their terms."""

INDEPENDENT = 2.0**-40
"""Constraints are dependent if what elimination leaves of one of them is below this, relative to
what it was.
"""

AGAIN = 4
"""Turns in which a momentum is brought into the tangent space of constraints nearly parallel."""

NEAREST = 12
"""Turns in which Newton's method finds the nearest consistent position; if not, the one across the
constraints is taken.
"""


@record
class ConstrainedSystem(CanonicalSystem):
    """A Hamiltonian system in R^2n whose positions satisfy g(q) = 0, m equations:

        q' = H_p,   p' = -H_q - G(q)^T lambda,   0 = g(q),   G = dg/dq (m, n)

    It lives on M = {g(q) = 0, G(q) H_p(q, p) = 0}: the second equation, the hidden constraint, is
    the derivative of the first.

    1. A subclass writes `energy(q, p)` and `constraint(q)`, as formulas, and says the number of coordinates,
    `degrees`, n.  Its fields are the parameters.  (SeparableConstrainedSystem: kinetic(p) and potential(q)
    instead of the energy.)
    2. It may write `velocity`, `force` and `constraint_jacobian` in closed form; left out, they
    follow by differentiation.
    3. It may name what stays constant beside the energy (`constants`).

    Everything else is derived: the hidden constraint, the multipliers lambda, the forces of
    constraint, consistent starts.  RATTLE is for it.  Methods for every system, such as RKMK,
    integrate the equation of lower index that the multipliers give (`rate`); they leave M.  The
    matrix G H_pp G^T must be invertible: the constraints are independent, and hold the motion.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.1.2.
    """

    alternatives: ClassVar[str] = "RATTLE() is for it; RKMK accepts every system, but leaves the constraints"

    bounded: ClassVar[bool] = True
    separable: ClassVar[bool] = False
    """Is the energy T(p) + V(q), with `velocity` a function of p alone and `force` one of q alone?"""

    # ---------------------------------------------------------------- 1. a subclass writes

    def constraint(self, q: Vec) -> Vec:
        """g(q), (m,): zero on the way.  q : (n,)."""
        raise undefined(self, "constraint")

    # ---------------------------------------------------------------- 2. closed forms are welcome

    @property
    @derived_from("energy", "kinetic", "mass")
    def linear_velocity(self) -> bool:
        """Whether the velocity is of first degree in p, as for a kinetic energy p . M(q)^-1 p/2; a subclass that says
        so saves time.
        """
        return False

    @derived
    def constraint_jacobian(self, q: Vec) -> Mat:
        """G(q) = dg/dq, (m, n).  q : (n,)."""
        return jacobian(lambda x: self.constraint(x), q)

    # ---------------------------------------------------------------- what follows

    @derived
    def hidden_constraint(self, q: Vec, p: Vec) -> Vec:
        """G(q) H_p(q, p), (m,): the speed at which the constraints would fail.  q, p : (n,)."""
        return self.constraint_jacobian(q) @ self.velocity(q, p)

    @final
    def normals(self, q: Vec, p: Vec) -> Mat:
        """H_pp G^T as rows, (m, n): how the velocity changes under an impulse of each constraint.
        q, p : (n,).
        """
        return pushed(self, q, p, self.constraint_jacobian(q))

    @final
    def multipliers(self, q: Vec, p: Vec) -> Vec:
        """The lambda that keeps the motion on M, (m,); its unit is that of a force over that of a
        row of G.  q, p : (n,).

            lambda = (G H_pp G^T)^-1 (d/dq(G H_p) H_p - G H_pp H_q)

        Raises InconsistentState where the constraints are dependent.
        Source: Hairer, Lubich, Wanner, VII.1.2; the slides, (1.9).
        """
        n, v, f = len(q), self.velocity(q, p), self.force(q, p)
        change = derivative(lambda y: self._hidden(y, n), vec(*q, *p), vec(*v, *f))
        G, across = self.constraint_jacobian(q), self.normals(q, p)
        x, pivots = eliminated(cross_products(G, across), change)
        if not independent(pivots, G, across):
            raise InconsistentState(self._dependence(q))
        return x

    @final
    def constraint_force(self, q: Vec, p: Vec) -> Vec:
        """-G^T lambda, (n,): what keeps the motion on M, in N where q is in m.  q, p : (n,)."""
        return -(self.multipliers(q, p) @ self.constraint_jacobian(q))

    @final
    def defects(self, q: Vec, p: Vec) -> Vec:
        """How far g(q) and G H_p are from zero, (2 m,), each relative to the size of the terms it
        is made of.  q, p : (n,).

        Compared with are s = sum_i |G_ki q_i|, and sum_i |G_ki v_i| with the speed (s a)^(1/2) that
        the force f gives over s, where a = sum_i |(H_pp G^T)_ik f_i|: so a body at rest may move by
        rounding.
        """
        sizes, speeds = self._terms(q, p)
        conditions = (*self.constraint(q), *self.hidden_constraint(q, p))
        pairs = zip(conditions, (*sizes, *speeds))
        return vec(*[abs(x) / where(size > 0.0, size, 1.0) for x, size in pairs])

    @derived
    def _terms(self, q: Vec, p: Vec) -> tuple[Vec, Vec]:
        """The scales of g(q) and G H_p, (m,) each: s, and the speeds."""
        G, v, f = self.constraint_jacobian(q), self.velocity(q, p), self.force(q, p)
        sizes = vec(*[dot(abs(row), abs(q)) for row in G])
        gained = [sqrt(s * dot(abs(row), abs(f))) for s, row in zip(sizes, self.normals(q, p))]
        return sizes, vec(*[dot(abs(row), abs(v)) + gain for row, gain in zip(G, gained)])

    @final
    def across(self, q: Vec, p: Vec, along: Vec) -> Vec:
        """The position q + H_pp(along, p) G(along)^T x with g = 0, (n,).  q, p, along : (n,).

        Raises NoConvergence if there is none near q.
        """
        normals = self.normals(along, p)
        rows, zero = self.constraint_jacobian(along), [0.0 for _ in normals]
        weights = inverse_sizes(rows, vec(*[0.0 for _ in q]), q)

        def equation(x: Vec) -> tuple[Vec, Mat, float]:
            position = q + x @ normals
            G = self.constraint_jacobian(position)
            return (weights * self.constraint(position), scaled(cross_products(G, normals), weights), 1.0)

        x, size, enough, _ = newton(equation, vec(*zero), solved=in_order)
        if not size <= enough:
            raise NoConvergence(f"{type(self).__name__}: no position with g(q) = 0 was found near q = {tuple(q)}")
        return q + x @ normals

    @final
    def tangent(self, q: Vec, p: Vec) -> Vec:
        """The momentum p - G^T x with G H_p = 0, (n,): the nearest one in the metric of the kinetic
        energy.  q, p : (n,).

        Raises NoConvergence if there is none near p, InconsistentState where the constraints are
        dependent.
        """
        impulse, _ = self.tangent_impulse(q, p)
        return p + impulse

    @final
    def tangent_impulse(self, q: Vec, p: Vec) -> tuple[Vec, Vec]:
        """The -G^T x with G H_p = 0 at p - G^T x, (n,), and the pivots of G H_pp G^T, (m,).  q,
        p : (n,).
        """
        G, v, across = self.constraint_jacobian(q), self.velocity(q, p), self.normals(q, p)
        x, pivots = eliminated(cross_products(G, across), G @ v)
        if not independent(pivots, G, across):
            raise InconsistentState(self._dependence(q))
        if self.linear_velocity:
            return -(x @ G), pivots
        weights = inverse_sizes(G, v, 0.0 * v)

        def equation(x: Vec) -> tuple[Vec, Mat, float]:
            momentum = p - x @ G
            products = cross_products(G, self.normals(q, momentum))
            return weights * (G @ self.velocity(q, momentum)), -scaled(products, weights), 1.0

        x, size, enough, _ = newton(equation, x, solved=in_order)
        if not size <= enough:
            raise NoConvergence(f"{type(self).__name__}: no momentum with G(q) H_p = 0 was found near p = {tuple(p)}")
        return -(x @ G), pivots

    def _hidden(self, y: Vec, n: int) -> Vec:
        """The hidden constraint of y = (q, p)."""
        return self.hidden_constraint(y[:n], y[n : 2 * n])

    # ---------------------------------------------------------------- how it moves

    @final
    def rate(self, t: float, state: CanonicalState) -> Vec:
        """(q', p') with the multipliers put in: the equation of lower index.

        Source: Hairer, Lubich, Wanner, VII.1.2; the slides, (1.8) and (1.9).
        """
        q, p = state.q, state.p
        return vec(*self.velocity(q, p), *(self.force(q, p) + self.constraint_force(q, p)))

    def constants(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The energy, and the constraints: g(q) and G H_p, zero both."""
        q, p = states["q"], states["p"]
        defects = {"constraint": self.constraint(q), "hidden constraint": self.hidden_constraint(q, p)}
        return super().constants(states) | {name: np.asarray(x) for name, x in defects.items()}

    # ---------------------------------------------------------------- checked input

    @final
    def state(self, q: Any, p: Any) -> CanonicalState:
        """A start for `integrate` on M: positions q and momenta p, (n,) each, or (members, n) for
        an ensemble.

        Raises InvalidInput for wrong shapes, entries that are not finite, constraints that are
        dependent there, and a start that is not consistent: it says by how much g(q) and G H_p
        fail.  `consistent` gives the nearest start that is.
        """
        where = f"{type(self).__name__}.state"
        arrays, members, q, p = self._starts(where, q, p)
        single = members is None
        failing = np.asarray(self.defects(q, p)).reshape(len(q), 2, -1)
        bad = np.flatnonzero(~(failing <= CONSISTENT).all(axis=(1, 2)))
        if len(bad):
            i = bad[0]
            g, hidden = (np.array(self.constraint(q[i])), np.array(self.hidden_constraint(q[i], p[i])))
            violations = [
                f"{name}[{k}] = {value:.3g}, {defect:.1e} of its terms"
                for name, values, relative in (("g(q)", g, failing[i, 0]), ("G H_p", hidden, failing[i, 1]))
                for k, (value, defect) in enumerate(zip(values, relative, strict=True))
                if not defect <= CONSISTENT
            ]
            member = "" if single else f" of member {i}"
            raise InvalidInput(
                f"{where}: the start{member} is not consistent: {'; '.join(violations)} (at most "
                f"{CONSISTENT:.0e}). Use `consistent(q, p)`, which gives the nearest state that is"
            )
        self._check_motion(where, q, p, single)
        return self._canonical_state(arrays, members)

    def _starts(self, where: str, q: Any, p: Any) -> tuple[Any, int | None, np.ndarray, np.ndarray]:
        """The parts of starts and their number, as `_points` gives them, and q and p as (members, n)."""
        arrays, members = self._points(q, p)
        self._check_formulas(arrays[0])
        q, p = (np.broadcast_to(np.atleast_2d(a), (members or 1, self.degrees)) for a in arrays)
        self._check_rank(where, q, p, members is None)
        return arrays, members, q, p

    @final
    def _reached(self, **parts: Any) -> CanonicalState:
        """The state with these parts, on M or not."""
        arrays, members = self._points(**parts)
        return CanonicalState(*[as_field(a, (self.degrees,), members) for a in arrays])

    def _check_motion(self, where: str, q: np.ndarray, p: np.ndarray, one: bool) -> None:
        """Raise InvalidInput for consistent states, (members, n), whose motion a subclass does not
        allow.
        """

    @final
    def consistent(self, q: Any, p: Any) -> CanonicalState:
        """The state on M nearest to q and p, (n,) each, or (members, n): first q, then p, in the
        metric of the kinetic energy.

        Far from M, where there may be several, it is one that is reached across the constraints.
        Raises InvalidInput as `state` does, and if no such state is found near by.
        """
        where = f"{type(self).__name__}.consistent"
        _, members, q, p = self._starts(where, q, p)
        try:
            nearest = [self._nearest(small(a), small(b)) for a, b in zip(q, p, strict=True)]
        except (NoConvergence, InconsistentState, ZeroDivisionError) as error:
            raise InvalidInput(f"{where}: {error}. Give a start that is nearer to g(q) = 0") from error
        q, p = (np.array(x) for x in zip(*nearest, strict=True))
        return self.state(q[0], p[0]) if members is None else self.state(q, p)

    def _nearest(self, q: Vec, p: Vec) -> tuple[Vec, Vec]:
        """The nearest position y = q + x H_pp G(y)^T by Newton's method from the one across the
        constraints, and its momentum.
        """
        n = len(q)
        try:
            position = self.across(q, p, q)
        except NoConvergence:
            near = self._stepwise(q, p)
            position = self.across(near, p, near)

        def off(z: Vec) -> Vec:
            y, x = z[:n], z[n:]
            return vec(*(y - q - x @ self.normals(y, p)), *self.constraint(y))

        z = vec(*position, *[0.0 for _ in self.constraint(q)])
        for _ in range(NEAREST):
            change = solve(jacobian(off, z), off(z))
            z = z - change
            if max(abs(change)) <= CONSISTENT * max(abs(z)):
                y = z[:n]
                if max(abs(y - position)) <= max(abs(position - q)):
                    position = self.across(y, p, y)
                break
        return position, self._tangent_nearby(position, p)

    def _tangent_nearby(self, q: Vec, p: Vec) -> Vec:
        """`tangent`; of constraints nearly parallel by eliminations with exchange, which leave no
        more than rounding of their large impulses, until that is small too.
        """
        try:
            momentum = self.tangent(q, p)
            if max(self.defects(q, momentum)) <= CONSISTENT:
                return momentum
        except NoConvergence:
            pass
        G = self.constraint_jacobian(q)
        for _ in range(AGAIN):
            p = p - solve(cross_products(G, self.normals(q, p)), G @ self.velocity(q, p)) @ G
        return p

    def _stepwise(self, q: Vec, p: Vec) -> Vec:
        """A position near q where g is small, across the constraints as they are after every step:
        of those that are nearly parallel, the difference turns on the way.
        """
        y = q
        for _ in range(NEAREST):
            normals = self.normals(y, p)
            m = cross_products(self.constraint_jacobian(y), normals)
            y = y - in_order(m, self.constraint(y)) @ normals
        return y

    def _check_formulas(self, q: np.ndarray) -> None:
        """Raise InvalidInput unless `constraint` gives a vector of numbers.  q : (n,), or (members, n)."""
        value = self.constraint(small(np.atleast_2d(q)[0]))
        if not isinstance(value, SmallVec):
            raise InvalidInput(
                f"{type(self).__name__}.constraint returns {value!r}; it must be a vector, one "
                "number for each constraint: lm.vec(...)"
            )
        if not len(value):
            raise InvalidInput(
                f"{type(self).__name__}.constraint returns no number; give at least one "
                "constraint. Without any, the system is a HamiltonianSystem"
            )
        if len(value) > self.degrees:
            raise InvalidInput(
                f"{type(self).__name__}: {len(value)} constraints on {self.degrees} coordinates; "
                "they cannot be independent"
            )

    def _check_rank(self, where: str, q: np.ndarray, p: np.ndarray, one: bool) -> None:
        """Refuse states at which the constraints are dependent."""
        normals, G = (np.asarray(x) for x in (self.normals(q, p), self.constraint_jacobian(q)))
        left, sizes = (G @ normals.swapaxes(1, 2)).copy(), np.abs(G * normals).sum(axis=2)
        for k in range(left.shape[1]):
            bad = np.flatnonzero(~(np.abs(left[:, k, k]) > INDEPENDENT * sizes[:, k]))
            if len(bad):
                member = "" if one else f"member {bad[0]}: "
                raise InvalidInput(f"{where}: {member}{self._dependence(q[bad[0]])}")
            left[:, k + 1 :] -= left[:, k + 1 :, k, None] / left[:, k, k, None, None] * left[:, k, None, :]

    def _dependence(self, q: Any) -> str:
        """Which constraint follows from which others, in words; for messages."""
        G = np.array(self.constraint_jacobian(small(np.array(q, dtype=float))))
        rows = G / (np.linalg.norm(G, axis=1, keepdims=True) + (np.abs(G).max(axis=1, keepdims=True) == 0.0))
        rank = np.linalg.matrix_rank(rows, tol=np.sqrt(INDEPENDENT))
        at = f"rank {rank} of {len(G)}, at q = {tuple(np.round(np.array(q, dtype=float), 6).tolist())}"
        for k in range(len(G)):
            if not np.abs(G[k]).max() > 0.0:
                return f"the derivative of constraint[{k}] is zero ({at}); no force can hold it there"
            if np.linalg.matrix_rank(rows[: k + 1], tol=np.sqrt(INDEPENDENT)) <= k:
                weights = np.linalg.lstsq(rows[:k].T, rows[k], rcond=None)[0]
                others = ", ".join(f"constraint[{j}]" for j in np.flatnonzero(np.abs(weights) > 1e-6))
                text = f"the constraints are dependent ({at}): that of constraint[{k}] follows from those of {others}. "
                position, unit = small(np.array(q, dtype=float)), np.linalg.norm(G[: k + 1], axis=1)
                values = np.array(self.constraint(position))[: k + 1] / unit
                gap = float(abs(values[k] - weights @ values[:k])) * unit[k]
                if gap > np.sqrt(CONSISTENT) * (np.abs(G[k]) @ np.abs(np.array(position))):
                    return f"{text}At this place they contradict each other: constraint[{k}] is {gap:.3g} where the others are zero"
                return f"{text}Leave out those that are redundant; at a dead point the motion is not determined"
        return f"the matrix G H_pp G^T is singular ({at}): the constraints do not determine their forces"


@record
class SeparableConstrainedSystem(SeparableEnergy, ConstrainedSystem):
    """A constrained system with H(q, p) = T(p) + V(q): a subclass writes `kinetic(p)`,
    `potential(q)` and `constraint(q)`.

    RATTLE is then explicit but for the multipliers.  T is mostly p . M^-1 p/2 with constant masses.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.1.2 and VII.1.4.
    """

    separable: ClassVar[bool] = True


@record
class ConstrainedLagrangianSystem(ConstrainedSystem):
    """A constrained system with the Lagrangian L = v . M(q) v/2 - U(q).

    A subclass writes `mass(q)`, `potential(q)` and `constraint(q)`.

        q' = v,   M(q) v' = f(q, v) - G(q)^T lambda,   0 = g(q),   p = M(q) v

    f holds the force -dU/dq and what comes from the change of the masses.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.1.1.
    """

    @property
    @closed_form_of("energy")
    def linear_velocity(self) -> bool:
        """Whether the velocity is of first degree in p: yes, the kinetic energy is quadratic whatever the mass."""
        return True

    def mass(self, q: Vec) -> Mat:
        """M(q), (n, n), symmetric and positive.  q : (n,)."""
        raise undefined(self, "mass")

    def potential(self, q: Vec) -> float:
        """The potential energy U(q).  q : (n,)."""
        raise undefined(self, "potential")

    @final
    def energy(self, q: Vec, p: Vec) -> float:
        """p . M(q)^-1 p/2 + U(q).  q, p : (n,)."""
        return 0.5 * dot(p, self.velocity(q, p)) + self.potential(q)

    @derived
    def velocity(self, q: Vec, p: Vec) -> Vec:
        """M(q)^-1 p, (n,).  q, p : (n,)."""
        return solve(self.mass(q), p)

    @derived
    def force(self, q: Vec, p: Vec) -> Vec:
        """d/dq (v . M(q) v)/2 - dU/dq at the velocity v that belongs to p, (n,).  q, p : (n,)."""
        v = self.velocity(q, p)
        return gradient(lambda x: 0.5 * dot(v, self.mass(x) @ v) - self.potential(x), q)

    @derived
    def momentum(self, q: Vec, v: Vec) -> Vec:
        """p = M(q) v, (n,).  q, v : (n,)."""
        return self.mass(q) @ v

    def _check_formulas(self, q: np.ndarray) -> None:
        """Raise InvalidInput also unless the masses are symmetric and positive.

        Source: Horn and Johnson, Matrix Analysis, 2nd ed., theorem 4.5.8 (Sylvester's law of
        inertia).
        """
        super()._check_formulas(q)
        n, name = self.degrees, f"{type(self).__name__}.mass"
        for member in np.atleast_2d(q):
            m, at = (np.array(self.mass(small(member))), f"at q = {tuple(np.round(member, 6).tolist())}")
            if m.shape != (n, n):
                raise InvalidInput(f"{name} has shape {m.shape}; it must be a matrix, ({n}, {n})")
            for i in range(n):
                if not m[i, i] > 0.0:
                    raise InvalidInput(f"{name} is not positive: entry [{i}, {i}] is {m[i, i]:.6g} {at}")
            unit = 1.0 / np.sqrt(np.diag(m))
            # with a diagonal of ones: entries in different units can be compared
            m1 = unit[:, None] * m * unit
            i, j = divmod(int(np.argmax(np.abs(m1 - m1.T))), n)
            if not abs(m1[i, j] - m1[j, i]) <= CONSISTENT:
                raise InvalidInput(
                    f"{name} is not symmetric: entry [{i}, {j}] is {m[i, j]:.6g}, but [{j}, {i}] "
                    f"is {m[j, i]:.6g} {at}. The energy v . M v/2 "
                    "needs a symmetric matrix, (M + M^T)/2"
                )
            values, vectors = np.linalg.eigh(m1)
            if not values[0] > 2 * n * EPSILON:
                entries = ", ".join(f"[{i}, {i}]" for i in np.flatnonzero(np.abs(vectors[:, 0]) > 1e-6))
                raise InvalidInput(
                    f"{name} is not positive: with rows and columns scaled to a diagonal of ones "
                    f"it has the eigenvalue {values[0]:.3g} {at}, from the "
                    f"rows and columns of the entries {entries}"
                )

    @final
    def acceleration(self, q: Vec, v: Vec) -> tuple[Vec, Vec]:
        """v', (n,), and the multipliers, (m,), of one linear system.  q, v : (n,).

            ( M  G^T ) ( v'     )   ( f          )
            ( G  0   ) ( lambda ) = ( -g''(v, v) ),      f = -(d/dq(M v)) v + d/dq(v . M v)/2 - dU/dq

        Source: Hairer, Lubich, Wanner, VII.1.1; the slides, (1.3) and (1.5).
        """
        n, G = len(q), self.constraint_jacobian(q)
        changing = derivative(lambda x: self.mass(x) @ v, q, v)
        f = gradient(lambda x: 0.5 * dot(v, self.mass(x) @ v) - self.potential(x), q) - changing
        bending = derivative(lambda x: self.constraint_jacobian(x) @ v, q, v)
        upper = [vec(*row, *column) for row, column in zip(self.mass(q), G.T)]
        lower = [vec(*row, *[0.0 for _ in G]) for row in G]
        x = solve(mat(*upper, *lower), vec(*f, *-bending))
        return x[:n], vec(*[x[n + k] for k in range(len(G))])


@record
class Surface(Record):
    """Equations g(q) = 0 for the positions of a canonical system: a subclass writes `value`; its
    fields are the parameters.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.1.2.
    """

    def value(self, q: Vec) -> Vec:
        """g(q), (m,).  q : (n,)."""
        raise undefined(self, "value")


@record
class Constrained(ConstrainedSystem):
    """A canonical system, such as DoublePendulum(), and equations on its positions.

    system : any HamiltonianSystem.  surface : a Surface, whose `value(q)` is (m,).
    Raises InvalidInput for anything else.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.1.2.
    """

    system: HamiltonianSystem
    surface: Surface

    def __post_init__(self) -> None:
        for name, kind in (("system", HamiltonianSystem), ("surface", Surface)):
            if not isinstance(getattr(self, name), kind):
                raise InvalidInput(f"Constrained: {name} must be a {kind.__name__}; got {getattr(self, name)!r}")
        super().__post_init__()

    @property
    def degrees(self) -> int:  # type: ignore[override]
        """The degrees of freedom of the system."""
        return self.system.degrees

    @property
    def separable(self) -> bool:  # type: ignore[override]
        """Whether the constrained system is separable, H = T(p) + V(q)."""
        return isinstance(self.system, SeparableSystem)

    def energy(self, q: Vec, p: Vec) -> float:
        """The energy of the system.  q, p : (n,)."""
        return self.system.energy(q, p)

    def velocity(self, q: Vec, p: Vec) -> Vec:
        """The velocity of the system.  q, p : (n,)."""
        return self.system.velocity(q, p)

    def force(self, q: Vec, p: Vec) -> Vec:
        """The force of the system, without the constraints.  q, p : (n,)."""
        return self.system.force(q, p)

    def constraint(self, q: Vec) -> Vec:
        """The value of the surface.  q : (n,)."""
        return self.surface.value(q)


# ---------------------------------------------------------------- linear algebra of the constraints


def cross_products(G: Mat, normals: Mat) -> Mat:
    """G N^T, (m, m), for the rows of G and of N."""
    return mat(*[vec(*[dot(row, normal) for normal in normals]) for row in G])


def pushed(system: Any, q: Vec, p: Vec, G: Mat) -> Mat:
    """H_pp G^T as rows, (m, n): how the velocity at q and p changes under impulses along rows of
    any G.
    """
    return mat(*[tangent(lambda x: system.velocity(q, x), p, row, True)[1] for row in G])


def scaled(m: Mat, weights: Vec) -> Mat:
    """The rows of m, each times its weight: diag(weights) m."""
    return mat(*[weight * row for row, weight in zip(m, weights)])


def inverse_sizes(G: Mat, change: Vec, q: Vec) -> Vec:
    """One over what constraints are compared with in Newton's method: what a change of q does to
    them, and far less of q itself.
    """
    sizes = [dot(abs(row), abs(change) + FAR * abs(q)) for row in G]
    return vec(*[1.0 / where(s > 0.0, s, 1.0) for s in sizes])


FAR = 2.0**-18
"""TOLERANCE, 2^-30, times this is 16 roundings: constraints hold to 16 roundings of their terms
before the last correction.
"""


def eliminated(m: Mat, rhs: Vec) -> tuple[Vec, Vec]:
    """The solution of m x = rhs by elimination in the given order, and the pivots; for G H_pp G^T
    and what is near it.

    Each pivot is what is left of a constraint beside those before it; with a positive kinetic
    energy all are positive.
    m : (k, k), rhs : (k,).  With a pivot that is zero the solution means nothing.

    Source: Golub and Van Loan, Matrix Computations, 4th ed., 3.2 and 4.2 (no exchange of rows for
    positive matrices).
    """
    n = len(rhs)
    if n == 1:
        return vec(_over(rhs[0], m[0, 0])), vec(m[0, 0])
    if n == 2:  # by Cramer's rule: one division before the solution
        volume = m[0, 0] * m[1, 1] - m[0, 1] * m[1, 0]
        scale = _over(1.0, volume)
        solution = vec(scale * (m[1, 1] * rhs[0] - m[0, 1] * rhs[1]), scale * (m[0, 0] * rhs[1] - m[1, 0] * rhs[0]))
        return solution, vec(m[0, 0], _over(volume, m[0, 0]))
    rows: list[Vec] = [vec(*m[i], rhs[i]) for i in range(n)]
    inverse: list[Any] = []
    for k in range(n):
        inverse = [*inverse, _over(1.0, rows[k][k])]
        for i in range(k + 1, n):
            rows[i] = rows[i] - (rows[i][k] * inverse[k]) * rows[k]
    x = [0.0 for _ in range(n)]
    for k in range(n - 1, -1, -1):
        remainder = rows[k][n] - sum([rows[k][j] * x[j] for j in range(k + 1, n)])
        x[k] = remainder * inverse[k]
    return vec(*x), vec(*[rows[k][k] for k in range(n)])


def _over(x: Any, pivot: Any) -> Any:
    """x/pivot, x itself for zero.

    The quotient of plain numbers does not wait for the comparison; a power series, whose later
    terms are not made yet, is chosen first.
    """
    if isinstance(pivot, (Pair, Series)):
        return x / where(constant(pivot) != 0.0, pivot, 1.0)
    return x / pivot if pivot != 0.0 else x


def in_order(m: Mat, rhs: Vec) -> Vec:
    """The solution of m x = rhs for such a matrix."""
    return correction(m, rhs) if len(rhs) == 3 else eliminated(m, rhs)[0]


def independent(pivots: Vec, G: Mat, normals: Mat) -> Any:
    """Whether something is left of every constraint beside those before it, by the pivots."""
    good = True
    for pivot, row, normal in zip(pivots, G, normals):
        good = good and abs(pivot) > INDEPENDENT * dot(abs(row), abs(normal))
    return good
