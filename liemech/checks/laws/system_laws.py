"""The laws of a system: derivatives belong to energies, Lagrangians to Hamiltonians, constants
stay.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

from ...compiler import kernel
from ...errors import NotDefined
from ...formulas import derivative, dot, gradient, jacobian, vec
from ...formulas.classes.records import records_in
from ...integrators.rkmk import RKMK
from ...rooms.constraints.constrained import ConstrainedSystem, SeparableConstrainedSystem
from ...rooms.constraints.constrained_body import BoundBody, ConstrainedBody
from ...rooms.constraints.constrained_parts import SplitConstrainedSystem
from ...rooms.fictive_time.time_transformed import ExtendedSystem
from ...rooms.poisson.poisson import DrivenPoissonSystem, PoissonSystem
from ...rooms.sites.terms.bound_terms import term_of_edge
from ...rooms.sites.terms.sums_of_terms import MomentumTerms, OfTerms, PlaceTerms
from ...rooms.sites.terms.terms import at_time
from ...simulation.integrate import integrate
from ...simulation.reports.drift import constants_and_terms
from ...systems.canonical import CanonicalState, CanonicalSystem, HamiltonianSystem, PhaseSpace
from ...systems.cotangent import CotangentMotion, CotangentSystem, DrivenCotangentSystem, EnergyOnCotangent
from ...systems.equations.homogeneous_equation import HomogeneousEquation
from ...systems.hamiltonian import Hamiltonian
from ...systems.in_time.driven import DrivenHamiltonianSystem, DrivenLiePoissonSystem
from ...systems.in_time.driven_hamiltonian import DrivenHamiltonian
from ...systems.lagrangian import Lagrangian
from ...systems.lie_poisson import LiePoissonMotion, LiePoissonSystem
from ...systems.mechanical import MechanicalSystem
from ...systems.parts import Part
from ...systems.potential import Potential
from ...systems.separable import MultirateSystem, SeparableEnergy, SeparableSystem
from ...systems.vector_field import VectorField
from ..points.sample_points import STEP, flat, size, slope
from ..points.sample_states import AtState
from .casimir_laws import INDEPENDENCE, independence
from .closed_forms import CLOSE, Arguments, laws_of_closed_forms, records_within
from .law import Law, Same, axiom, factors, replaced, shaped, vanishes
from .part_laws import CONSTRAINED_PARTS, FIELDS, on_manifold


def derived(f: Callable[[Any], Any], x: Any) -> tuple[np.ndarray, float]:
    """df/dx by derivative numbers, or by differences of a formula that does not bear them; and by
    what these enlarge rounding.
    """
    try:
        return np.asarray(jacobian(f, x) if isinstance(f(x), (tuple, list)) else gradient(f, x), dtype=float), 1.0
    except TypeError:
        near = STEP / 16.0  # of formulas that grow fast, such as exponentials
        unit = near * (size(x) or 1.0)
        columns = [slope(lambda s, e=e: f(vec(*(flat(x) + s * e))), unit) for e in np.eye(len(x))]  # type: ignore[misc]
        slopes = np.stack(columns, axis=-1)
        return slopes[0] if len(slopes) == 1 else slopes, 1.0 / near


def _matches(given: Any, f: Callable[[Any], Any], x: Any, sign: float = 1.0) -> Same:
    """A derivative that was written beside the derived one."""
    right, rounding = derived(f, x)
    right = sign * right
    terms = size(right) + size(f(x)) / (size(x) or 1.0)
    return Same(given, right, terms * rounding, lambda: factors(right))


# ---------------------------------------------------------------- every system

SYSTEM: list[Law] = []


@axiom(SYSTEM, "velocity", "rate is a vector of dim finite numbers", slack=CLOSE)
def velocity(system: Any, at: AtState) -> Iterator[Same]:
    yield from shaped(flat(at.rate), (system.group.dim,))


# ---------------------------------------------------------------- Lie-Poisson systems

BODY: list[Law] = []


@axiom(BODY, "gradient", "gradient(mu) = dH/dmu", "gradient", slack=CLOSE)
def gradient_of_energy(system: LiePoissonSystem, at: AtState) -> Iterator[Same]:
    yield _matches(system.hamiltonian.gradient(at.state.mu), system.hamiltonian.energy, at.state.mu)


@axiom(BODY, "momentum", "momentum(xi) = dl/dxi", "momentum", optional=True, slack=CLOSE)
def momentum_of_lagrangian(system: LiePoissonSystem, at: AtState) -> Iterator[Same]:
    xi = system.velocity(at.state.mu)
    yield _matches(_lagrangian(system).momentum(xi), _lagrangian(system).value, xi)


@axiom(BODY, "hessian", "hessian(xi) = d2l/dxi2", "hessian", optional=True, slack=CLOSE)
def hessian_of_lagrangian(system: LiePoissonSystem, at: AtState) -> Iterator[Same]:
    xi = system.velocity(at.state.mu)
    matrix = np.asarray(_lagrangian(system).hessian(xi), dtype=float)
    yield _matches(np.diag(matrix) if matrix.ndim == 1 else matrix, _lagrangian(system).momentum, xi)


@axiom(
    BODY, "Legendre transform", "mu = dl/dxi at xi = dH/dmu, and H(mu) + l(xi) = <mu, xi>", optional=True, slack=CLOSE
)
def legendre(system: LiePoissonSystem, at: AtState) -> Iterator[Same]:
    mu, xi, l = at.state.mu, system.velocity(at.state.mu), _lagrangian(system)
    yield Same(l.momentum(xi), mu, size(mu), lambda: factors(flat(mu)))
    pairing, energy = float(dot(mu, xi)), float(system.energy(mu))
    yield Same(energy + l.value(xi), pairing, size(mu) * size(xi) + abs(energy))


@axiom(BODY, "Casimirs", "ad*_dC/dmu mu = 0", optional=True, slack=CLOSE)
def casimirs(system: LiePoissonSystem, at: AtState) -> Iterator[Same]:
    mu = at.state.mu
    slopes, rounding = derived(system.group.casimirs, mu)
    for row in slopes.reshape(-1, len(mu)):
        moved = system.group.ad_star(vec(*row.tolist()), mu)
        yield vanishes(moved, rounding * size(row) * size(mu))


@axiom(BODY, *INDEPENDENCE, optional=True, once=True)
def independent_casimirs(system: LiePoissonSystem, at: AtState) -> Iterator[Same]:
    casimirs, dim = system.group.casimirs, system.group.dim
    yield independence(casimirs, _rows(casimirs, dim), _somewhere(dim))


def _rows(casimirs: Callable[[Any], Any], dim: int) -> Callable[[Any], np.ndarray]:
    """The gradients of the Casimirs as rows, a function of the point."""
    return lambda y: derived(casimirs, y)[0].reshape(-1, dim)


def _somewhere(dim: int) -> list[Any]:
    """Points of nothing special, half of them with coordinates that are positive."""
    drawn = np.random.default_rng(5).normal(size=(4, dim))
    return [vec(*y) for y in np.concatenate([drawn[:2], 0.5 + np.abs(drawn[2:])]).tolist()]


def _lagrangian(system: LiePoissonSystem) -> Lagrangian:
    if system.lagrangian is None:
        raise NotDefined("the system has no Lagrangian")
    return system.lagrangian


# ---------------------------------------------------------------- bodies in fields

FIELD: list[Law] = []


@axiom(FIELD, "force", "<f, eta> = -d/ds V(g exp(s eta)) at s = 0", "force", slack=CLOSE)
def force_of_potential(system: MechanicalSystem, at: AtState) -> Iterator[Same]:
    group, g, V = system.configurations, at.state.g, system.potential
    zero = vec(*[0.0 for _ in range(group.dim)])
    yield _matches(V.force(group, g), lambda eta: V.energy(group.compose_exp(g, eta)), zero, -1.0)


@axiom(
    FIELD,
    "load",
    "a vector of dim finite numbers, by its rates and efforts too, and dE/dt = <F, xi>",
    optional=True,
    slack=CLOSE,
)
def load(system: MechanicalSystem, at: AtState) -> Iterator[Same]:
    if system.load is None:
        raise NotDefined("there is no load")
    _require_held(at.system)
    mu, g, whole = at.state.mu, at.state.g, at.system if isinstance(at.system, BoundBody) else system
    xi = system.velocity(mu, **at.timed)
    F, rates = system.load, system.load.rates(xi, g)
    force = flat(F.covector(at.t, xi, g))
    yield from shaped(force, (len(mu),))
    yield Same(F.at_rates(at.t, rates, g), force, size(force))
    if F.by_rate:
        yield Same(F.spread(at.t, F.efforts(at.t, rates, g), g), force, size(force))
    power, comparisons = float(force @ flat(xi)), []
    for place in (at, at.closer):
        energies = [whole.energy(state.mu, state.g, **at.timed) for state in place.nearby]  # of rotors too
        change, scale = place.along(energies)
        comparisons.append(Same(change, np.array([power]), scale + abs(power)))
    yield min(comparisons, key=lambda same: same.defect)


# ---------------------------------------------------------------- terms of many sites

SITES: list[Law] = []

EDGES = 20
"""Edges of a term that are looked at."""


def _terms_of(system: Any) -> list[OfTerms]:
    """The sums of terms in a system whose sites are of one species."""
    kinds = MomentumTerms, PlaceTerms
    sums = [x for x in records_in(system, OfTerms) if isinstance(x, kinds) and x.species is None]
    return [x for x in sums if any(part.graph.arity > 1 for part in x.parts)]


@axiom(SITES, "ends", "slopes and forces of all ends of an edge are those of each", slack=CLOSE)
def ends_of_edges(system: Any, at: AtState) -> Iterator[Same]:
    for terms in _terms_of(system):
        momenta = isinstance(terms, MomentumTerms)
        sites = terms._sites(at.state.mu if momenta else at.state.g)  # type: ignore[attr-defined]
        group: Any = terms.group.base
        for part in terms.parts:
            for number, numbers in part.graph.some_edges(EDGES) if part.graph.arity > 1 else []:
                term, ends = at_time(term_of_edge(part.term, number), at.t), [sites[i] for i in numbers]
                if momenta:
                    formula, together = partial(term.slope), term.slopes(*ends)
                else:
                    formula, together = partial(term.force, group), term.forces(group, *ends)
                for k, covector in enumerate(together):
                    right = flat(formula(k, *ends))
                    yield Same(flat(covector), right, size(right), lambda x=right: factors(x))  # type: ignore[misc]


# ---------------------------------------------------------------- bodies under constraints

BOUND: list[Law] = []


@axiom(BOUND, "rows of the constraint", "rows(g), put together as `touches` says, are jacobian(g)", slack=CLOSE)
def rows_of_constraint(system: BoundBody, at: AtState) -> Iterator[Same]:
    rows, G = system.rows(at.state.g), np.array(system.jacobian(at.state.g), dtype=float)
    put = system._matrix(rows)
    yield Same(put.toarray() if hasattr(put, "toarray") else put, G, size(G))


def _require_held(system: Any) -> None:
    """Joints in a given motion do work, and states are on their conditions at one time alone."""
    if isinstance(system, BoundBody) and system.rheonomic:
        raise NotDefined("conditions change with time")


@axiom(
    BOUND, "constraints stay", "d/dt c(g) = G xi = 0 and d/dt (G xi) = 0 along the motion", optional=True, slack=CLOSE
)
def constraints_stay(system: BoundBody, at: AtState) -> Iterator[Same]:
    return _better(_leaving, system, at)


def _leaving(system: BoundBody, at: AtState) -> Iterator[Same]:
    if isinstance(system, ConstrainedBody):
        change, _ = at.along([system.constraint.value(state.g) for state in at.nearby])
        G, terms = size(system.jacobian(at.state.g)), size(system._terms(at.state.g))
        yield vanishes(change, terms / at.unit + G * size(system.velocity(at.state.mu)))
    G = max(size(system.jacobian(state.g)) for state in at.nearby)
    speeds = [system.velocity(state.mu) for state in at.nearby]
    change, _ = at.along([flat(system.jacobian(s.g) @ v) for s, v in zip(at.nearby, speeds, strict=True)])
    yield vanishes(change, G * max(map(size, speeds)) / at.unit)


# ---------------------------------------------------------------- canonical and driven systems

CANONICAL: list[Law] = []
DRIVEN: list[Law] = []
DRIVEN_BODY: list[Law] = []
DRIVEN_POINT: list[Law] = []


def _of_energy(table: list[Law], t: str) -> None:
    """The laws of Hamilton's equations, of an energy of (q, p) or of (t, q, p)."""

    def place(at: AtState) -> tuple[Any, Any, Any]:
        return (at.t,) if t else (), at.state.q, at.state.p

    @axiom(table, "velocity of energy", f"velocity({t}q, p) = dH/dp", "velocity", slack=CLOSE)
    def velocity_of_energy(system: Any, at: AtState) -> Iterator[Same]:
        t, q, p = place(at)
        yield _matches(system.velocity(*t, q, p), lambda x: system.energy(*t, q, x), p)

    @axiom(table, "force of energy", f"force({t}q, p) = -dH/dq", "force", slack=CLOSE)
    def force_of_energy(system: Any, at: AtState) -> Iterator[Same]:
        t, q, p = place(at)
        yield _matches(system.force(*t, q, p), lambda x: system.energy(*t, x, p), q, -1.0)


_of_energy(CANONICAL, "")
_of_energy(DRIVEN, "t, ")


COTANGENT: list[Law] = []
DRIVEN_COTANGENT: list[Law] = []


def _of_energy_on_cotangent(table: list[Law], t: str) -> None:
    """The laws of the motion on T*G, of an energy of (mu, g) or of (t, mu, g)."""

    def place(at: AtState) -> tuple[Any, Any, Any]:
        return (at.t,) if t else (), at.state.mu, at.state.g

    @axiom(table, "velocity of energy", f"velocity({t}mu, g) = dH/dmu", "velocity", slack=CLOSE)
    def velocity_of_energy(system: Any, at: AtState) -> Iterator[Same]:
        t, mu, g = place(at)
        yield _matches(system.velocity(*t, mu, g), lambda x: system.energy(*t, x, g), mu)

    @axiom(table, "force of energy", f"<force({t}mu, g), eta> = -d/ds H(g exp(s eta), mu)", "force", slack=CLOSE)
    def force_of_energy(system: Any, at: AtState) -> Iterator[Same]:
        t, mu, g = place(at)
        moved = lambda eta: system.energy(*t, mu, system.configurations.compose_exp(g, eta))  # noqa: E731
        yield _matches(system.force(*t, mu, g), moved, vec(*[0.0 for _ in mu]), -1.0)


_of_energy_on_cotangent(COTANGENT, "")
_of_energy_on_cotangent(DRIVEN_COTANGENT, "t, ")


@axiom(DRIVEN_BODY, "gradient", "gradient(t, mu) = dK/dmu", "gradient", slack=CLOSE)
def gradient_of_driven(system: DrivenLiePoissonSystem, at: AtState) -> Iterator[Same]:
    t, mu, K = at.t, at.state.mu, system.hamiltonian
    yield _matches(K.gradient(t, mu), lambda x: K.energy(t, x), mu)


@axiom(DRIVEN_POINT, "gradient", "gradient(t, y) = dH/dy", "gradient", slack=CLOSE)
def gradient_of_driven_point(system: DrivenPoissonSystem, at: AtState) -> Iterator[Same]:
    t, y = at.t, at.state.y
    yield _matches(system.gradient(t, y), lambda x: system.energy(t, x), y)


@axiom(
    CANONICAL,
    "quadratic kinetic energy",
    "velocity(q, p) is of first degree in p, if `quadratic` or `linear` says so",
    slack=CLOSE,
)
def quadratic(system: CanonicalSystem, at: AtState) -> Iterator[Same]:
    quadratic = isinstance(system, SeparableEnergy) and system.quadratic
    if quadratic or (isinstance(system, ConstrainedSystem) and system.linear_velocity):
        q, p = at.state.q, at.state.p
        v0, v1, v2 = (flat(system.velocity(q, s * p)) for s in (0.0, 1.0, 2.0))
        yield Same(v2 - v1, v1 - v0, size(v0) + size(v1) + size(v2))


CONSTRAINED: list[Law] = []


@axiom(CONSTRAINED, "Jacobian of the constraints", "constraint_jacobian(q) = dg/dq", "constraint_jacobian", slack=CLOSE)
def jacobian_of_constraints(system: ConstrainedSystem, at: AtState) -> Iterator[Same]:
    yield _matches(system.constraint_jacobian(at.state.q), system.constraint, at.state.q)


@axiom(
    CONSTRAINED,
    "geodesic",
    "geodesic(q, p, t) begins with the velocity, stays on g = 0 and G H_p = 0, keeps T, and t is t/2 + t/2",
    optional=True,
    slack=CLOSE,
)
def geodesic(system: Any, at: AtState) -> Iterator[Same]:
    if not isinstance(system, SeparableConstrainedSystem) or not hasattr(system, "geodesic"):
        raise NotDefined("the system has none")
    q, p = at.state.q, at.state.p
    t = 0.5 / (at.pace or 1.0)
    position, after = system.geodesic(q, p, t)
    half = system.geodesic(*system.geodesic(q, p, 0.5 * t), 0.5 * t)
    yield Same(vec(*half[0], *half[1]), vec(*position, *after), size(position) + size(after))
    begins = derivative(lambda s: system.geodesic(q, p, s)[0], 0.0)
    yield Same(begins, system.velocity(q, p), size(system.velocity(q, p)))
    yield from on_manifold(system, position, after)
    yield Same(system.kinetic(after), system.kinetic(p), abs(system.kinetic(p)))


# ---------------------------------------------------------------- Poisson systems

PARTS: list[Law] = []


@axiom(PARTS, "gradient of energy", "gradient(y) = dH/dy", slack=CLOSE)
def gradient_of_point(system: PoissonSystem, at: AtState) -> Iterator[Same]:
    yield _matches(system.gradient(at.state.y), system.energy, at.state.y)


@axiom(PARTS, "Casimirs of the structure", "B dC = 0", optional=True, slack=CLOSE)
def casimirs_of_structure(system: PoissonSystem, at: AtState) -> Iterator[Same]:
    y = at.state.y
    slopes, rounding = derived(system.casimirs, y)
    for row in slopes.reshape(-1, len(y)):
        moved = system.structure.sharp(y, vec(*row.tolist()))
        scale = size(np.abs(np.asarray(system.structure.matrix(y))) @ np.abs(row)) + size(row)
        yield vanishes(moved, rounding * scale)


@axiom(PARTS, *INDEPENDENCE, optional=True, once=True)
def independent_casimirs_of_structure(system: PoissonSystem, at: AtState) -> Iterator[Same]:
    dim = system.structure.dim
    places = [at.state.y, *_somewhere(dim)]
    yield independence(system.casimirs, _rows(system.casimirs, dim), places)


@axiom(PARTS, "motions of parts", "d/dt flow(y, t) = B dH_i at flow(y, t), at two t", optional=True, slack=CLOSE)
def motions_of_parts(system: PoissonSystem, at: AtState) -> Iterator[Same]:
    written = [part for part in system.parts if isinstance(part, Part)]
    if not written:
        raise NotDefined("no part has a motion that is known")
    y, B = at.state.y, system.structure
    for part in written:
        yield Same(part.flow(B, y, 0.0), y, size(y))
        for t in (0.0, 0.1 / (at.pace or 1.0)):
            point = part.flow(B, y, t)
            rate = B.sharp(point, part.gradient(point))
            change = derivative(partial(part.flow, B, y), t)
            scale = size(rate) + size(change) + size(y) * (at.pace or 1.0)
            yield Same(change, rate, scale, lambda rate=rate: factors(flat(rate)))  # type: ignore[misc]


# ---------------------------------------------------------------- what is kept

KEPT: list[Law] = []


@axiom(KEPT, "constants", "d/dt C = 0 along the motion, for all that `constants` names", optional=True, slack=CLOSE)
def constants(system: Any, at: AtState) -> Iterator[Same]:
    return _better(_changes, system, at)


def _better(law: Any, system: Any, at: AtState) -> Iterator[Same]:
    """The equations of a law at two distances along the motion, of each the one with the smaller defect."""
    _require_held(system)
    for near, far in zip(law(system, at.closer), law(system, at), strict=True):
        yield min(near, far, key=lambda same: same.defect)


def _changes(system: Any, at: AtState) -> Iterator[Same]:
    states = {name: np.stack([state.arrays[name] for state in at.nearby]) for name in at.state.arrays}
    values, terms = constants_and_terms(system, states, len(at.nearby))
    # they are zero, and so are their terms at some states
    if isinstance(system, ConstrainedSystem):
        values = {name: value for name, value in values.items() if name not in ("constraint", "hidden constraint")}
    if not values:
        raise NotDefined("the system names none")
    for name, value in values.items():
        change, scale = at.along([*value])
        # of sums that cancel the terms round
        yield vanishes(change, max(scale, size(terms[name]) / at.unit))


# ---------------------------------------------------------------- native code

RUNS: list[Law] = []


@axiom(RUNS, "native code", "two steps of RKMK4, the same bits as plain Python", once=True)
def native_code(system: Any, at: AtState) -> Iterator[Same]:
    reason = kernel.available()
    if reason:
        raise NotDefined(reason)
    start = system.state(**at.state.arrays)
    h = 0.1 / (at.pace or 1.0)
    runs = [integrate(system, RKMK(order=4), start, h=h, steps=2, compiled=c, progress=False) for c in (True, False)]
    for name, x in runs[0].last.parts.items():
        if x is not None:
            yield Same(flat(x), flat(runs[1].last.parts[name]), 0.0)


def laws_of(system: Any) -> Iterator[tuple[list[Law], Any, Callable[[str], bool]]]:
    """The tables of laws for a system, their subjects, and the names of the formulas that its class has written itself."""
    yield SYSTEM, system, lambda name: True
    tables: list[tuple[list[Law], Any, Any, Callable[[str], bool]]] = []  # with whose formulas these are
    body = system.body if isinstance(system, (MechanicalSystem, BoundBody)) else system
    field = system.body if isinstance(system, BoundBody) else system
    body = body.body if isinstance(body, MechanicalSystem) else body
    if isinstance(body, LiePoissonSystem):
        tables.append((BODY, body, (body.hamiltonian, body.lagrangian), partial(_written, body)))
    if isinstance(field, MechanicalSystem):
        tables.append((FIELD, field, (field.potential,), partial(replaced, field.potential, Potential)))
    if isinstance(system, CanonicalSystem):
        bases = SeparableSystem, SeparableConstrainedSystem, ConstrainedSystem, HamiltonianSystem
        base = next(kind for kind in bases if isinstance(system, kind))
        tables.append((CANONICAL, system, (system,), partial(replaced, system, base)))
    kinds: tuple[type, ...] = CotangentSystem, DrivenCotangentSystem, ConstrainedSystem, DrivenHamiltonianSystem
    for kind, table in zip(kinds, (COTANGENT, DRIVEN_COTANGENT, CONSTRAINED, DRIVEN)):
        if isinstance(system, kind):
            tables.append((table, system, (system,), partial(replaced, system, kind)))
    for kind, table in (DrivenLiePoissonSystem, DRIVEN_BODY), (DrivenPoissonSystem, DRIVEN_POINT):
        if isinstance(system, kind):
            energy = system.hamiltonian
            tables.append((table, system, (energy,), partial(replaced, energy, DrivenHamiltonian)))
    if _terms_of(system):
        tables.append((SITES, system, (), lambda name: True))
    field_laws = (PoissonSystem, PARTS) if isinstance(system, PoissonSystem) else (VectorField, FIELDS)
    for kind, table in (BoundBody, BOUND), (SplitConstrainedSystem, CONSTRAINED_PARTS), field_laws:
        if isinstance(system, kind):
            tables.append((table, system, (), lambda name: True))
    for laws, subject, _, written in tables:
        yield laws, subject, written
    for owner in records_within(system):
        named = {
            name
            for laws, _, owners, _ in tables
            if any(owner is record for record in owners)
            for law in laws
            for name in law.closed
        }
        laws = [*laws_of_closed_forms(owner, partial(arguments, owner), named.__contains__)]
        yield laws, system, lambda name: True
    yield KEPT, system, lambda name: True


def arguments(owner: Any, at: AtState) -> Arguments:
    """Values for the arguments of formulas at a state, by their names."""
    system, state, t = at.system, at.state, at.t
    inner: Any = system
    if isinstance(system, ExtendedSystem) and owner is not system:  # what it holds knows no time
        inner = system.system
        state = CanonicalState(system.without(state.q), system.without(state.p))
    by_name = {"t": t, "system": inner, "state": state}
    by_name |= {name: x for name, x in state.parts.items() if x is not None}
    body = isinstance(inner, (LiePoissonMotion, CotangentMotion, BoundBody))
    if body or isinstance(inner, PhaseSpace):
        where = {"mu": state.mu} if body and not isinstance(inner, EnergyOnCotangent) else state.parts
        v = inner.velocity(*((t,) if at.driven else ()), *where.values(), **at.timed)
        by_name |= {"v": v, "xi": v}
    if isinstance(inner, PoissonSystem):
        by_name |= {"mu": state.y, "a": inner.gradient(state.y), "structure": inner.structure}
    if isinstance(inner, HomogeneousEquation):
        by_name |= {"xi": at.rate, "g": inner.group.exp(at.rate)}
    if body:
        free = isinstance(inner, LiePoissonMotion)
        by_name |= {"group": inner.group if free else inner.configurations}
    several: Arguments = {name: (value,) for name, value in by_name.items()}
    if isinstance(owner, MultirateSystem):
        several["k"] = tuple(range(len(owner.parts)))
    return several


def _written(body: LiePoissonSystem, name: str) -> bool:
    """Whether the Hamiltonian or the Lagrangian of a body writes a formula."""
    if name == "gradient":
        return replaced(body.hamiltonian, Hamiltonian, name)
    return body.lagrangian is None or replaced(body.lagrangian, Lagrangian, name)
