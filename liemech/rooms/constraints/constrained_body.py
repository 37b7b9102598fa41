"""Bodies under holonomic constraints: on any group, with joints, rods, fixed points."""

from __future__ import annotations

from dataclasses import field
from typing import Any, ClassVar, NoReturn, final

import numpy as np

from ...errors import InconsistentState, InvalidInput, InvalidType, NoConvergence, require, undefined
from ...formulas import Element, Mat, Vec, derivative, mat, record, vec, vectors
from ...formulas.classes.records import with_fields
from ...formulas.vectors import small
from ...groups.lie_group import LieGroup
from ...groups.retractions import Retraction
from ...systems.kinetic_energy import has_inertia, times
from ...systems.lie_poisson import BodyState, LiePoissonSystem, body_state
from ...systems.mechanical import MechanicalSystem
from ...systems.potential import NoPotential
from ...systems.system import System
from .conditions import connections, joint, led, pulled, solved_sparse, speeds, yielding
from .constraint import Constraint, VelocityConstraint, factors_of

CONSISTENT = 1e-9
"""A start may miss its constraints by this part of their terms: rounding and printed digits, not
mistakes.
"""

INDEPENDENT = 1e-10
"""Conditions are redundant if a square of a singular value of their derivatives is less than this part of the
largest, though all bodies were of equal weight.
"""

DENSE = 20_000
"""Entries of G beyond which it is made without its zeros: chains of more than thirty bodies."""

PATIENCE = 50
"""Iterations after which no consistent start is looked for any more."""


@record
class BoundBody(System):
    """Bodies whose velocity obeys G(g) xi = 0 with a force -G(g)* lam that does no work; abstract.

    1. A subclass says what makes `G`, and how consistent a start is.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.1; Bloch,
    Nonholonomic Mechanics and Control, 2nd ed., section 1.3.
    """

    coordinates: ClassVar[tuple[str, ...]] = ("mu",)
    bounded: ClassVar[bool] = True
    body: Any
    constraint: Constraint
    conditions: int = field(init=False, repr=False)
    separate: bool = field(init=False, repr=False)
    touches: tuple[Any, ...] = field(init=False, repr=False)
    held: tuple[Any, ...] = field(init=False, repr=False)
    shared: tuple[Any, ...] = field(init=False, repr=False)
    elimination: tuple[Any, ...] = field(init=False, repr=False)
    places: tuple[Any, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        name = type(self).__name__
        body = self.body
        if isinstance(body, LiePoissonSystem):
            body = MechanicalSystem(body, NoPotential())
        require(
            f"{name}: body", body, MechanicalSystem, "a body such as RigidBody([1.0, 1.5, 2.0]) or a MechanicalSystem"
        )
        kinetic: Any = getattr(body.body, "lagrangian", None)
        if not has_inertia(kinetic):
            raise InvalidInput(
                f"{name}: the kinetic energy must be quadratic, a KineticEnergy; {body.body!r} has another one"
            )
        object.__setattr__(self, "body", body)
        # formulas may have no value at the identity
        count = self._count(small(body.configurations.random(1)))
        object.__setattr__(self, "conditions", count)
        separate = _separate(body.configurations, np.array(kinetic.inertia))
        object.__setattr__(self, "separate", separate)
        self._connect(count)
        super().__post_init__()

    def _count(self, g: Any) -> int:
        """The number of conditions, seen at an element."""
        raise undefined(self, "_count")

    def _connect(self, conditions: int) -> None:
        """The blocks and conditions that depend on each other, for sums that leave out what is known to be zero: `connections`.

        A block is what the inertia leaves to itself.  places : of each block where its coordinates
        begin and end.
        """
        group = self.configurations
        touches: Any = ((0,),) * conditions
        groups: tuple[LieGroup, ...] = (group,)
        if self.separate:
            touches, groups = self.constraint.touches(group, conditions), factors_of(group)
        ends = np.cumsum([factor.dim for factor in groups]).tolist()
        graph = connections(touches, len(groups))
        graph["places"] = tuple((end - factor.dim, end) for factor, end in zip(groups, ends, strict=True))
        for name, value in graph.items():
            object.__setattr__(self, name, value)

    @final
    @property
    def configurations(self) -> LieGroup:
        """The group whose elements tell where the bodies are."""
        return self.body.configurations

    @property
    def rheonomic(self) -> bool:
        """Whether its conditions change with time."""
        return self.constraint.rheonomic

    def at_time(self, t: float) -> Any:
        """The bodies with their conditions frozen at time t."""
        return with_fields(self, constraint=self.constraint.at_time(float(t))) if self.rheonomic else self

    def vouched(self, state: Any, t: float = 0.0) -> Any:
        """The state, noted as checked under the conditions at time t."""
        return self.at_time(t)._vouched(state)

    @property
    def group(self) -> Any:
        """T*G, the group that moves momentum and configuration together."""
        return self.body.group

    @property
    def blocks(self) -> tuple[tuple[LieGroup, int, int], ...]:
        """The blocks of the algebra: of each the group, and the places where its coordinates begin
        and end.
        """
        groups = factors_of(self.configurations) if self.separate else (self.configurations,)
        return tuple([(group, start, end) for group, (start, end) in zip(groups, self.places)])

    @property
    def inertias(self) -> tuple[Vec | Mat, ...]:
        """The diagonal blocks of the inertia J."""
        return tuple([_block(self.body.body.lagrangian.inertia, start, end) for _, start, end in self.blocks])

    @property
    def inverses(self) -> tuple[Vec | Mat, ...]:
        """The diagonal blocks of the inverse inertia J^-1."""
        return tuple([_block(self.body.body.lagrangian.inverse, start, end) for _, start, end in self.blocks])

    # ---------------------------------------------------------------- formulas

    @final
    def velocity(self, mu: Vec) -> Vec:
        """The body velocity xi = J^-1 mu.  mu : (dim,)."""
        return self.body.velocity(mu)

    @final
    def force(self, g: Element) -> Vec:
        """The force of the field, without that of the constraint.  g : an element;  returns (dim,)."""
        return self.body.force(g)

    @property
    def _turning_group(self) -> LieGroup:
        return self.group.acting

    def _turning_velocity(self, t: float, state: Any) -> Vec:
        """The body velocity, without the rate of the momentum, which asks for multipliers."""
        return self.velocity(state.mu)

    def energy(self, mu: Vec, g: Element) -> float:
        """H(mu) + V(g).  mu : (dim,), g : an element."""
        return self.body.energy(mu, g)

    @final
    def spatial_momentum(self, mu: Vec, g: Element) -> Vec:
        """The momentum seen from space, K_g mu.  mu : (dim,), g : an element."""
        return self.body.spatial_momentum(mu, g)

    @final
    def jacobian(self, g: Element) -> Mat:
        """G(g), the left-trivialised derivative of the constraint, (m, dim).  g : an element."""
        return self.constraint.jacobian(self.configurations, g)

    @final
    def rows(self, g: Any) -> Any:
        """G(g) by conditions and blocks, as `touches` says.  g : an element."""
        if not self.separate:
            return tuple([(row,) for row in self.jacobian(g)])
        return self.constraint.rows(self.configurations, g)

    def multipliers(self, mu: Vec, g: Element, t: float = 0.0) -> Vec:
        """The multipliers lam, (m,), at a consistent state: -G* lam is the force of the constraint
        on the momentum.

            lam = (G J^-1 G*)^-1 [ d/ds G(g exp(s xi)) xi + G J^-1 (ad*_xi mu + f + F) ]

        A condition measured in m has its lam in N, one that is an angle or a cosine in N m.
        mu : (dim,), g : an element.  t : in s, for loads that change with it.
        Source: Hairer, Lubich, Wanner, VII.1.2; the slides, (1.9), on a group.
        """
        return self.multipliers_under(self.body.applied(t, self.velocity(mu), g), mu, g, t)

    def multipliers_under(self, force: Vec, mu: Vec, g: Element, t: float = 0.0) -> Vec:
        """The multipliers under this force in place of f + F, (m,).  force, mu : (dim,), g : an element."""
        rows, xi = self.rows_at(t, g), self.velocity(mu)
        pull = self.configurations.ad_star(xi, mu) + force
        curved = derivative(
            lambda y: vec(*self._slips(t + y[0], self.configurations.compose_exp(g, y[1:]), xi)),
            vec(*[0.0 for _ in range(self.configurations.dim + 1)]),
            vec(1.0, *xi),
        )
        accelerations = [a + b for a, b in zip(curved, speeds(self, rows, self.velocity(pull)))]
        through = led(self, rows)
        pushed = [[times(inverse, row) for row in block] for inverse, block in zip(self.inverses, through)]
        return solved_sparse(self, yielding(self, joint(self, through, pushed)), accelerations)[0]

    def rows_at(self, t: float, g: Any) -> Any:
        """G by conditions and blocks, at time t."""
        if not self.rheonomic:
            return self.rows(g)
        return self.constraint.at_time(t).rows(self.configurations, g)

    def _slips(self, t: float, g: Any, xi: Vec) -> list[Any]:
        """G xi + dc/dt, condition by condition."""
        slips = speeds(self, self.rows_at(t, g), xi)
        if self.rheonomic:
            slips = [a + b for a, b in zip(slips, self.constraint.at_time(t).paces(g))]
        return slips

    def strongest_damper(self, t: float, xi: Vec, g: Any, mode: Vec) -> str:
        """The load, or the joint with the load, that damps a motion most, in words.  xi, mode : (dim,)."""
        return f"the load {self.body.load!r}"

    # ---------------------------------------------------------------- how it moves

    def rate(self, t: float, state: BodyState) -> Vec:
        """(xi, f + F - G* lam): the velocity on T*G, by index reduction."""
        xi = self.velocity(state.mu)
        push = self.body.applied(t, xi, state.g) - pulled(
            self, self.rows_at(t, state.g), self.multipliers(state.mu, state.g, t)
        )
        return vec(*xi, *push)

    @final
    def displaced(self, retraction: Retraction, state: BodyState, omega: Vec) -> BodyState:
        return self.body.displaced(retraction, state, omega)

    @final
    def variation(self, state: BodyState, omega: Vec) -> tuple[Vec, Vec]:
        return self.body.variation(state, omega)

    def constants(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The energy; nothing, as far as is known, under a load or conditions that change with time."""
        if self.body.load is not None or self.rheonomic:
            return {}
        return {"energy": np.asarray(self.energy(states["mu"], states["g"]))}

    # ---------------------------------------------------------------- checked input

    def state(self, mu: Any = None, g: Any = None, *, xi: Any = None) -> BodyState:
        """A start for `integrate`: body momentum mu, or body velocity xi, and configuration g, which
        obey the constraint.

        mu, xi : (dim,) for one body, (bodies, dim) for an ensemble;  g : an element, or one for
        each body.
        Raises InvalidInput as MechanicalSystem.state does, and for redundant conditions;
        InconsistentState for a start off the constraint, with the cure: `consistent(mu, g)` is the
        nearest start on it.
        """
        state = self._body_state("state", mu, g, xi)
        for k, (member, where) in enumerate(_members(state)):
            self._require_independent(
                where, f"{type(self).__name__}.state" + ("" if state.bodies is None else f": body {k}")
            )
            self._require_consistent(member, where)
        return self._vouched(state)

    @final
    def _reached(self, **parts: Any) -> BodyState:
        return self._body_state("state", parts.get("mu"), parts.get("g"), None)

    def _require_consistent(self, mu: Any, g: Any) -> None:
        """Raise InconsistentState for a velocity off the constraint, beside what velocities of its
        energy could be off.
        """
        G = self._matrix(self.rows(g))
        slip = G @ (self._inverse @ np.array(mu)) + self._paces(g)
        self._require_zero("G(g) J^-1 mu", slip, self._reach_of(G, mu, g) + np.abs(self._paces(g)))

    def _reach_of(self, rows: Any, mu: Any, g: Any) -> np.ndarray:
        """How large rows times velocities of the energy of mu are.

        To its energy counts what the force does on a unit displacement: at rest in a field a
        momentum is nothing but rounding.
        """
        momentum, force, inverse = np.array(mu), np.array(self.force(g)), self._inverse
        least = 1.0 / abs(inverse).sum(axis=1).max()
        energy = momentum @ (inverse @ momentum) + np.sqrt(least * (force @ (inverse @ force)))
        return np.asarray(np.sqrt(energy * (rows @ inverse @ rows.T).diagonal()))

    def _paces(self, g: Any) -> Any:
        """The rate of the conditions where bodies rest, dc/dt, (m,), or 0."""
        return np.array(self.constraint.paces(g)) if self.rheonomic else 0.0

    def _require_zero(self, what: str, value: np.ndarray, scale: np.ndarray) -> None:
        if (np.abs(value) > CONSISTENT * scale).any():
            i = int(np.argmax(np.abs(value) / np.where(scale > 0.0, scale, 1.0)))
            raise InconsistentState(
                f"{type(self).__name__}.state: {what} must be zero; condition {i} is "
                f"{value[i]:.3g}. `consistent(mu, g)` gives the nearest start on the constraint"
            )

    def _single(self, what: str, mu: Any, g: Any, xi: Any) -> BodyState:
        """A single start, on the constraint or not; InvalidInput for an ensemble."""
        state = self._body_state(what, mu, g, xi)
        if state.bodies is not None:
            raise InvalidInput(f"{type(self).__name__}.{what} takes one start at a time; loop over the ensemble")
        return state

    def _start(self, what: str, mu: Any, g: Any, xi: Any) -> tuple[np.ndarray, Any]:
        """Momentum and configuration of a single start whose conditions are independent."""
        state = self._single(what, mu, g, xi)
        start = small(np.array(state.g))
        self._require_independent(start, f"{type(self).__name__}.{what}")
        return np.array(state.mu), start

    def _projected(self, momentum: np.ndarray, g: Any) -> np.ndarray:
        """The momentum less G* (G J^-1 G*)^-1 G J^-1 mu: the nearest with a velocity on the
        constraint.
        """
        G, inverse = self._matrix(self.rows(g)), self._inverse
        for _ in range(2):  # the second time for rounding
            rates_off = G @ (inverse @ momentum) + self._paces(g)
            momentum = momentum - G.T @ _solved(G @ inverse @ G.T, rates_off)
        return momentum

    def _body_state(self, what: str, mu: Any, g: Any, xi: Any) -> BodyState:
        name = f"{type(self).__name__}.{what}"
        if g is None:
            raise InvalidInput(
                f"{name}: g is missing; the constraint depends on where the body is, give {what}(mu=..., g=...)"
            )
        return body_state(name, self.configurations, self.body.body._momentum_of(name, mu, xi), g)

    @property
    def _sparse(self) -> bool:
        """Whether there are so many bodies that matrices of all conditions and velocities are made without their zeros."""
        return self.conditions * self.configurations.dim > DENSE

    @property
    def _inverse(self) -> Any:
        """J^-1, a matrix; a sparse one of many bodies."""
        if self._sparse:
            return sparse().block_diag(
                [np.diag(np.array(J)) if np.ndim(J) == 1 else np.array(J) for J in self.inverses], "csr"
            )
        inverse = np.array(self.body.body.lagrangian.inverse)
        return inverse if inverse.ndim == 2 else np.diag(inverse)

    def _matrix(self, rows: Any) -> Any:
        """G from its rows, by conditions and blocks, (m, dim); a sparse one of many bodies."""
        entries = [
            (a, start + j, x)
            for a, (row, ties) in enumerate(zip(rows, self.touches, strict=True))
            for part, (b, _) in zip(row, ties, strict=True)
            for start, _ in (self.places[b],)
            for j, x in enumerate(part)
        ]
        at, columns, values = (np.array(numbers) for numbers in zip(*entries, strict=True))
        shape = self.conditions, self.configurations.dim
        if self._sparse:
            return sparse().csr_array((values, (at, columns)), shape)
        G = np.zeros(shape, dtype=values.dtype)
        G[at, columns] = values
        return G

    def _require_independent(self, g: Any, name: str) -> None:
        """Raise InvalidInput unless the conditions are independent at g; beside each other they are
        measured by G J^-1 G*.
        """
        try:
            G = self._matrix(self.rows(g))
        except ArithmeticError as error:
            raise InvalidInput(f"{name}: {type(self.constraint).__name__} has no derivative at g: {error}") from None
        gram = G @ self._inverse @ G.T
        unit = np.sqrt(np.abs(gram.diagonal()))
        if not np.isfinite(unit).all():
            bad = f"G[{(a := int(np.argmin(np.isfinite(unit))))}] = {[x for part in self.rows(g)[a] for x in part]}"
            raise InvalidInput(f"{name}: {type(self.constraint).__name__} has no finite derivative at g: {bad}")
        silent = np.flatnonzero(unit == 0.0)
        if len(silent):
            raise InvalidInput(
                f"{name}: condition {silent[0]} of {type(self.constraint).__name__} does not "
                "change here: its derivative is zero"
            )
        if self._sparse and unit.all():
            if _pivots(gram, unit).min() > INDEPENDENT:
                return
            # rows that depend on each other are to be named, whatever it takes
            gram, G = gram.toarray(), G.toarray()
        squares = np.linalg.eigvalsh(gram / np.outer(unit, unit))
        if np.abs(squares).min() > INDEPENDENT * squares[-1]:
            return
        # bodies as if they were of equal weight
        inverse = self._inverse.toarray() if self._sparse else self._inverse
        lightness = np.ones(len(inverse))
        for start, end in self.places:
            lightness[start:end] = inverse.diagonal()[start:end].max()
        rows = G @ (np.linalg.cholesky(inverse) / np.sqrt(lightness)[:, None])
        directions, sizes, _ = np.linalg.svd(rows / np.linalg.norm(rows, axis=1, keepdims=True))
        rank = int((sizes**2 > INDEPENDENT * sizes[0] ** 2).sum())
        if rank < self.conditions:
            weights = np.abs(directions[:, rank:]).max(axis=1)
            raise InvalidInput(
                f"{name}: the {self.conditions} conditions have rank {rank} here; "
                f"{self._named(np.flatnonzero(weights > 1e-3))} depend on each other. "
                f"Leave out {self.conditions - rank} of them{self._cure}, or "
                "start elsewhere if it is a dead point"
            )

    def _named(self, conditions: Any) -> str:
        """Conditions in words, by their numbers."""
        return f"conditions {', '.join(str(i) for i in conditions)}"

    _cure: ClassVar[str] = ""

    def independence(self, g: Any) -> float:
        """The least singular value of J^-1/2 G*, its columns of length 1: 1 for unrelated
        conditions, 0 for dependent ones.
        """
        return float(np.sqrt(np.abs(self._spectrum(g)[0])).min())

    def weakest(self, g: Any) -> str:
        """The conditions that are closest to depending on each other, in words."""
        share = np.abs(self._spectrum(g)[1][:, 0])
        return self._named(np.flatnonzero(share > 0.1 * share.max()))

    def _spectrum(self, g: Any) -> Any:
        """The eigenvalues of G J^-1 G* scaled to a diagonal of ones, rising, and its eigenvectors."""
        G = self._matrix(self.rows(g))
        gram = G @ self._inverse @ G.T
        gram = gram.toarray() if self._sparse else gram
        unit = np.sqrt(np.abs(np.diag(gram)))
        return np.linalg.eigh(gram / np.outer(unit, unit))

    # elements are those of the configurations

    @final
    def identity(self) -> Any:
        """The neutral element of the configurations."""
        return self.configurations.identity()

    @final
    def defect(self, g: Any) -> float:
        """How far an array is from being a configuration.  g : shaped like an element."""
        return self.configurations.defect(g)

    def _shape(self, argument: str, kind: str) -> tuple[int, ...] | None:
        return (self.conditions, self.configurations.dim) if argument == "G" else self.body._shape(argument, kind)

    def _complex(self, kind: str) -> bool:
        return self.configurations._complex(kind)

    def _objection(self, argument: str, value: Any) -> str | None:
        return self.configurations._objection(argument, value) if argument != "G" else None


@record
class ConstrainedBody(BoundBody):
    """Bodies whose configuration obeys c(g) = 0:

        mu' = ad*_xi mu + f(g) + F(t, xi, g) - G(g)* lam,   g' = g xi,   xi = J^-1 mu,   c(g) = 0,   hence   G(g) xi = 0

    body : what moves without the constraint: a free body such as RigidBody(J), or a
    MechanicalSystem, perhaps under a load F; its kinetic energy is quadratic.  On a ProductGroup it
    is many bodies.
    constraint : c, with m components, m >= 1, whose derivatives G(g), left-trivialised, are
    independent.  LieRATTLE keeps both constraints to rounding, the two-form on what is left, and
    the momenta of common symmetries.  `rate` is that of the reduced equation, with lam in closed
    form: other methods accept it, and drift off the constraint.

    Raises InvalidInput for an energy that is not quadratic, InvalidType for what is no body or no
    constraint.
    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.1; Leyendecker,
    Marsden and Ortiz, ZAMM 88 (2008).
    """

    alternatives: ClassVar[str] = "LieRATTLE() keeps the constraint"

    def _count(self, g: Any) -> int:
        constraint: Any = self.constraint
        if not isinstance(constraint, Constraint) or isinstance(constraint, VelocityConstraint):
            expected = "a Constraint, a subclass with a `value(g)` (conditions on velocities: NonholonomicBody)"
            raise InvalidType(f"{type(self).__name__}: constraint must be {expected}; got {self.constraint!r}")
        value = self.constraint.value(g)
        if not isinstance(value, vectors.Vec) or not len(value):
            name = f"{type(self).__name__}: {type(self.constraint).__name__}"
            raise InvalidType(f"{name}.value must return lm.vec(...), (m,); got {value!r}")
        return len(value)

    @final
    def conditions_at(self, mu: Vec, g: Element, t: float = 0.0) -> tuple[Vec, Vec]:
        """c(g) and its rate G(g) J^-1 mu + dc/dt, (m,) each: both are zero along the motion.
        mu : (dim,), g : an element.  t : in s, for conditions that change with it.
        """
        return self.constraint.at_time(t).value(g), vec(*self._slips(t, g, self.velocity(mu)))

    @final
    def consistent(self, mu: Any = None, g: Any = None, *, xi: Any = None) -> BodyState:
        """The start on the constraint that is nearest, measured by the kinetic energy, to one that
        is close to it: body momentum mu, or body velocity xi, and configuration g.

        The configuration moves by exp of the shortest displacement to c = 0, then the momentum
        loses G* (G J^-1 G*)^-1 G J^-1 mu.
        mu, xi : (dim,), g : an element.  Raises InvalidInput as `state` does, NoConvergence if g is
        too far off.
        """
        state = self._single("consistent", mu, g, xi)
        nearest = self._nearest(small(np.array(state.g)))
        self._require_independent(nearest, f"{type(self).__name__}.consistent")
        return self.state(self._projected(np.array(state.mu), nearest), np.array(nearest))

    def _nearest(self, start: Any) -> Any:
        """The configuration on the constraint nearest to one that is close to it."""
        nearest = self._reached_from(start, np.zeros(self.configurations.dim))
        if nearest is None:
            self._refuse_far(start)
        return nearest

    def _refuse_far(self, start: Any) -> NoReturn:
        """Say why no configuration on the constraint was found."""
        name = f"{type(self).__name__}.consistent"
        self._require_independent(start, name)
        raise NoConvergence(f"{name}: no configuration on the constraint found near g; start closer")

    def _reached_from(self, start: Any, x: np.ndarray) -> Any:
        """The configuration start exp(x) on the constraint with the shortest x near this one, (dim,), by
        Newton's method; None if it does not converge.
        """
        group, inverse, change = self.configurations, self._inverse, np.inf
        for _ in range(PATIENCE):
            before, g = change, group.compose_exp(start, Vec.of(x))
            algebras, pieces = (
                [group.algebra for group, _, _ in self.blocks],
                [Vec.of(x[slice(*place)]) for place in self.places],
            )
            try:
                bent = [
                    [algebras[b].dexp_dual(pieces[b], part) for part, (b, _) in zip(row, ties)]
                    for row, ties in zip(self.rows(g), self.touches)
                ]
                G = self._matrix(bent)
                aim = G @ x - np.array(self.constraint.value(g))
                new = inverse @ (G.T @ _solved(G @ inverse @ G.T, aim))
            except (np.linalg.LinAlgError, ArithmeticError):
                return None
            change, x = float(np.abs(new - x).max()), new
            if (
                not change < np.inf
                or (change >= before and change <= CONSISTENT * max(1.0, np.abs(x).max()))
                or change == 0.0
            ):
                break
        if not change <= CONSISTENT * max(1.0, np.abs(x).max()):
            return None
        return group.compose_exp(start, Vec.of(x))

    def _require_consistent(self, mu: Any, g: Any) -> None:
        """Raise InconsistentState for a configuration off the constraint, measured beside the terms
        of c, or such a velocity.
        """
        reach = self._reach(self._matrix(self.rows(g)))
        value = np.array(self.constraint.value(g))
        if (np.abs(value) > CONSISTENT * reach).any():  # their terms take longer to find
            self._require_zero("c(g)", value, self._terms(g) + reach)
        super()._require_consistent(mu, g)

    def _reach(self, G: Any) -> np.ndarray:
        """How much conditions with these derivatives change over unit displacements, of heavier bodies shorter ones, (m,)."""
        largest = max(
            np.abs(np.array(J)).max() if np.ndim(J) == 1 else np.linalg.norm(np.array(J), 2) for J in self.inverses
        )
        return np.asarray(np.sqrt((G @ self._inverse @ G.T).diagonal() / largest))

    def _terms(self, g: Any) -> np.ndarray:
        """How large the terms are whose sums the conditions are: sum |dc/dg_i g_i| over the entries
        of g.

        Entries of bodies that no condition touches together are varied at once.
        """
        entries = np.array(g)
        flat = entries.ravel()
        sizes = [np.size(group.identity()) for group, _, _ in self.blocks]
        ends, total = np.cumsum(sizes), np.zeros(self.conditions)
        for blocks in _apart(self.touches, len(sizes)):
            for i in range(max(sizes[b] for b in blocks)):
                at = [ends[b] - sizes[b] + i for b in blocks if i < sizes[b]]
                direction = np.zeros(len(flat))
                direction[at] = flat[at].real
                total += np.abs(np.array(derivative(self.constraint.value, g, small(direction.reshape(entries.shape)))))
        return total


@record
class NonholonomicBody(BoundBody):
    """Bodies that roll, or glide on a blade: velocities obey A(g) xi = 0, configurations nothing.

        mu' = ad*_xi mu + f(g) + F(t, xi, g) - A(g)* lam,   g' = g xi,   xi = J^-1 mu,   A(g) xi = 0          (Lagrange-d'Alembert)

    body : what moves without the constraint: a free body or a MechanicalSystem, perhaps under a
    load F, with quadratic kinetic energy.
    constraint : A, a VelocityConstraint with m independent rows.
    Without a load the motion keeps the energy.  It keeps no symplectic form, and of a symmetry's momentum no more
    than its allowed motions tell.  LagrangeDAlembert() is the method for it; `rate` is that of the
    reduced equation, for RKMK.

    Raises InvalidInput for an energy that is not quadratic, InvalidType for what is no body or no
    constraint.
    Source: Bloch, Nonholonomic Mechanics and Control, 2nd ed., chapter 5; Cortes and Martinez,
    Nonlinearity 14 (2001).
    """

    alternatives: ClassVar[str] = "LagrangeDAlembert() is the method for velocity constraints"

    def _count(self, g: Any) -> int:
        if not isinstance(self.constraint, VelocityConstraint):
            expected = "a VelocityConstraint, a subclass with a `matrix(g)`"
            raise InvalidType(f"{type(self).__name__}: constraint must be {expected}; got {self.constraint!r}")
        A, dim = self.constraint.matrix(g), self.configurations.dim
        if not isinstance(A, vectors.Mat) or len(A[0]) != dim:
            name = f"{type(self).__name__}: {type(self.constraint).__name__}"
            raise InvalidType(f"{name}.matrix must return lm.mat(...), (m, {dim}); got {A!r}")
        return len(A)

    @final
    def consistent(self, mu: Any = None, g: Any = None, *, xi: Any = None) -> BodyState:
        """The start with the momentum nearest, measured by the kinetic energy, to mu, or to that of
        the body velocity xi.

        mu, xi : (dim,), g : an element.  Raises InvalidInput as `state` does.
        """
        momentum, start = self._start("consistent", mu, g, xi)
        return self.state(self._projected(momentum, start), np.array(start))


def _members(state: BodyState) -> list[tuple[Any, Any]]:
    """Momentum and element of each body, small."""
    if state.bodies is None:
        return [(state.mu, state.g)]
    return [(small(mu), small(g)) for mu, g in zip(np.array(state.mu), np.array(state.g), strict=True)]


def sparse() -> Any:
    """SciPy's sparse matrices, imported when they are needed."""
    import scipy.sparse
    import scipy.sparse.linalg

    return scipy.sparse


def _solved(matrix: Any, rhs: np.ndarray) -> np.ndarray:
    """The solution of a symmetric, positive system."""
    return (
        np.linalg.solve(matrix, rhs) if isinstance(matrix, np.ndarray) else sparse().linalg.spsolve(matrix.tocsc(), rhs)
    )


def _pivots(gram: Any, unit: np.ndarray) -> np.ndarray:
    """The pivots of a sparse positive matrix, scaled to a diagonal of ones; zeros if it is
    singular.

    Source: Golub and Van Loan, Matrix Computations, 4th ed., section 4.2.
    """
    scale = sparse().diags_array(1.0 / unit)
    options = {"SymmetricMode": True}
    try:
        factors = sparse().linalg.splu(
            (scale @ gram @ scale).tocsc(), "MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options
        )
    except RuntimeError:
        return np.zeros(1)
    return np.abs(factors.U.diagonal())


def _apart(touches: Any, blocks: int) -> list[list[int]]:
    """The blocks in groups of which no condition touches two."""
    near: list[set[int]] = [set() for _ in range(blocks)]
    for row in touches:
        for b, _ in row:
            near[b] |= {k for k, _ in row}
    colors: list[int] = []
    for b in range(blocks):
        taken = {colors[k] for k in near[b] if k < b}
        colors.append(next(c for c in range(b + 1) if c not in taken))
    return [[b for b in range(blocks) if colors[b] == c] for c in range(max(colors) + 1)]


def _block(inertia: Vec | Mat, start: int, end: int) -> Vec | Mat:
    """The part of an inertia that belongs to these coordinates."""
    if isinstance(inertia, vectors.Mat):
        return mat(*[vec(*inertia[i][start:end]) for i in range(start, end)])
    return inertia[start:end]


def _separate(group: LieGroup, inertia: np.ndarray) -> bool:
    """Whether the inertia leaves the factors of the group to themselves."""
    if inertia.ndim == 1:
        return True
    ends = np.cumsum([factor.dim for factor in factors_of(group)])
    owner = np.searchsorted(ends, np.arange(group.dim), side="right")
    return not inertia[owner[:, None] != owner].any()
