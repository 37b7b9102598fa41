"""Lie-Poisson systems: a group and an energy that depends on the body momentum alone."""

from __future__ import annotations

from functools import cached_property
from typing import Any, ClassVar, final

import numpy as np

from ..errors import InvalidInput, require
from ..formulas import Element, Record, Vec, derivative, record, vec
from ..formulas.arrays import at_a_glance
from ..formulas.classes.derived import closed_form_of, written_together
from ..formulas.classes.layouts import laid_out
from ..formulas.classes.records import fields_of, fill
from ..formulas.classes.remembered import Remembered
from ..formulas.large import Large
from ..formulas.numbers.bases import InMemory
from ..formulas.numbers.transposes import ruled
from ..formulas.vectors import Mat
from ..formulas.vectors import Vec as SmallVec
from ..groups.composed.power import PowerGroup
from ..groups.composed.product import ProductGroup
from ..groups.composed.species import SpeciesGroup
from ..groups.lie_group import LieGroup
from ..groups.matrices.matrix_group import MatrixLieGroup
from ..groups.retractions import Retraction
from .agreement import require_one_body
from .hamiltonian import Hamiltonian
from .input_checks import as_field, element_at_a_glance, large_members, members_of, points
from .kinetic_energy import by_entries
from .lagrangian import Lagrangian
from .many.common_momentum import momenta_of_symmetry
from .many.energies import OfManySites, moving, on_group, released
from .many.site_state import SiteState, rows_of_species, site_state, velocities_of_sites
from .system import State, System, as_precise, lies_in_memory


@record
class BodyState(State):
    """Where a body is and how it moves: body momentum `mu`, and the group element `g` from body to
    space (None: not asked for).

    mu : (dim,) or, for an ensemble, (bodies, dim);  g : an element or, with a leading axis, one for
    each body.
    """

    mu: Any
    g: Any = None


_NO_LAGRANGIAN = Lagrangian()


@record
class LiePoissonMotion(System):
    """Momenta that move on their coadjoint orbits and elements of the group above them, by whatever
    energy; abstract.

    A subclass writes `velocity`, `energy`, `rate` and `state`.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., sections 13.1 and
    13.5.
    """

    coordinates: ClassVar[tuple[str, ...]] = ("mu",)
    along_orbits: ClassVar[bool] = False  # is `velocity` a function of the momentum alone?

    @final
    def casimirs(self, mu: Vec) -> Vec:
        """The Casimir functions of the group: constant whatever the energy.  mu : (dim,)."""
        return self.group.casimirs(mu)

    @final
    def spatial_momentum(self, mu: Vec, g: Element) -> Vec:
        """The momentum seen from space, K_g mu = Ad*_{g^-1} mu: constant by Noether's theorem.
        mu : (dim,), g : an element.
        """
        return self.group.K(g, mu)

    def displaced(self, retraction: Retraction, state: BodyState, omega: Vec) -> BodyState:
        """Momentum and attitude moved by the same displacement: Ad*_tau(omega) mu, g tau(omega)."""
        return ruled(self._displaced, self._displaced_back, self.group, (retraction,), state, omega)

    def _displaced(self, retraction: Retraction, state: BodyState, omega: Vec) -> BodyState:
        omega = as_precise(omega, state.mu)
        mu = retraction.tau_Ad_star(self.group, omega, state.mu)
        return BodyState(mu, None if state.g is None else retraction.compose_tau(self.group, state.g, omega))

    def _displaced_back(self, retraction: Retraction, state: BodyState, omega: Vec, w: Any) -> Any:
        """Ad_tau w_mu, Ad*_(tau^-1) w_g, and by omega dtau*_omega (w_g - ad*_(w_mu) mu_1)."""
        group = self.group
        h, mu = retraction.tau(group, omega), retraction.tau_Ad_star(group, omega, state.mu)
        bent = -group.ad_star(w.mu, mu) if w.g is None else w.g - group.ad_star(w.mu, mu)
        by_state = BodyState(group.Ad(h, w.mu), None if w.g is None else group.K(h, w.g))
        return (by_state, retraction.dtau_dual(group, omega, bent)), []

    def moving(self, state: BodyState, xi: Vec) -> BodyState:
        """ad*_xi mu, of the momentum alone."""
        return BodyState(self.group.ad_star(xi, state.mu), None)

    def essential_part(self, state: BodyState) -> BodyState:  # type: ignore[override]
        """The state without its element: the momentum moves alone."""
        return BodyState(state.mu, None)

    def _written_out(self, state: Any) -> Any:
        return in_a_row(self, state)

    def by_site(self, arrays: dict[str, Any]) -> dict[str, Any]:
        return by_site(self.group, arrays)

    def as_users_see(self, arrays: dict[str, Any]) -> dict[str, Any]:
        return as_users_see(self.group, arrays)

    def at_site(self, kind: Any) -> Any:
        """A system of this kind, of one site among many; None if the energy is no sum of terms on a power."""
        group, energy = self.group, getattr(self, "hamiltonian", None)  # type: Any, Any
        has_sites = isinstance(group, (PowerGroup, SpeciesGroup)) and hasattr(energy, "of_site")
        return kind(group.base, energy.of_site()) if has_sites else None

    def variation(self, state: BodyState, omega: Vec) -> tuple[Any, Any]:
        """ad*_omega mu beside |mu|, and omega beside what counts as large where the body is; of large
        matrices each part by itself.
        """
        mu: Any = state.mu
        if isinstance(mu, InMemory):
            changes, sizes = (self.group.ad_star(omega, mu),), (abs(mu),)  # type: ignore[arg-type, var-annotated]
            if state.g is None:
                return changes, sizes
            return (*changes, omega), (*sizes, 0.0 * omega + 1.0)
        change, size = self.group.ad_star(omega, state.mu), vec(*[abs(m) for m in state.mu])
        return (change, size) if state.g is None else (vec(*change, *omega), vec(*size, *self.group.scale(state.g)))

    def constants(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Casimirs and, if the attitude is known, the spatial momentum."""
        mu, g = states["mu"], states.get("g")
        casimirs = np.asarray(self.casimirs(mu))
        constants = {f"Casimir {i + 1}": casimirs[..., i] for i in range(casimirs.shape[-1])}
        return constants if g is None else constants | {"spatial momentum": np.asarray(self.spatial_momentum(mu, g))}


@record
class LiePoissonSystem(LiePoissonMotion):
    """Motion on the dual of a Lie algebra, mu' = ad*_xi mu with xi = dH/dmu, and on the group above
    it, g' = g xi.

    group : the configuration space.  hamiltonian : the energy as a function of the body momentum.
    lagrangian : the same motion told by velocities, for methods that need it; left out, the
    Hamiltonian stands in if it is a Lagrangian too, like KineticEnergy.

    Raises InvalidInput for functions of vectors of another dimension, a written gradient that is
    not the derivative of the energy, and a Lagrangian of another body, whose momentum does not undo
    the gradient.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., sections 13.1, 13.5
    and 13.7.
    """

    along_orbits: ClassVar[bool] = True

    group: LieGroup
    hamiltonian: Hamiltonian
    lagrangian: Lagrangian | None = None

    def __repr__(self) -> str:
        lagrangian: Any = self.lagrangian
        alone = lagrangian is None or lagrangian == self.hamiltonian
        suffix = "" if alone else f", lagrangian={self.lagrangian!r}"
        return f"{type(self).__name__}(group={self.group!r}, hamiltonian={self.hamiltonian!r}{suffix})"

    def __post_init__(self) -> None:
        name = type(self).__name__
        energy = on_group(self.hamiltonian, Hamiltonian, name, self.group)
        if lies_in_memory(self.group):
            energy = enlarged(by_entries(energy, self.group))
        if energy is not self.hamiltonian:
            object.__setattr__(self, "hamiltonian", energy)
        fields: tuple[Any, ...] = self.group, self.hamiltonian, self.lagrangian or _NO_LAGRANGIAN
        for name, value, kind in zip(
            ("group", "hamiltonian", "lagrangian"), fields, (LieGroup, Hamiltonian, Lagrangian)
        ):
            require(f"{type(self).__name__}: {name}", value, kind)
        natural = isinstance(self.hamiltonian, Lagrangian) and written_together(
            type(self.hamiltonian), "energy", "value"
        )
        if self.lagrangian is None and natural:
            object.__setattr__(self, "lagrangian", self.hamiltonian)
        super().__post_init__()
        require_one_body(type(self).__name__, self.group, released(self.hamiltonian), self.lagrangian)

    # ---------------------------------------------------------------- formulas

    @final
    def velocity(self, mu: Vec) -> Vec:
        """The body velocity xi = dH/dmu.  mu : (dim,)."""
        return ruled(self.hamiltonian.gradient, self._velocity_back, None, (), mu)

    def _velocity_back(self, mu: Vec, w: Vec) -> Any:
        """D_w dH/dmu, as second derivatives commute."""
        along = moving(self.hamiltonian, w)
        slope = derivative(lambda m: self.hamiltonian._free(m), mu, along)
        return (slope,), [("momenta", 0.0, mu, along)]

    def velocity_matrix(self, m: Mat) -> Mat:
        """hat(dH/dmu) from the matrix that stands for the momentum, on groups of matrices.  m : (n, n)."""
        return self.hamiltonian.velocity_matrix(self.group.algebra, m)

    @final
    def energy(self, mu: Vec) -> float:
        """The energy H(mu) of the Hamiltonian.  mu : (dim,)."""
        return self.hamiltonian.energy(mu)

    @final
    def rate(self, t: float, state: BodyState) -> Vec:
        """The body velocity xi = dH/dmu."""
        return self.velocity(state.mu)

    @property
    @closed_form_of("displaced")
    def lie_poisson(self) -> LiePoissonSystem:
        return self

    @cached_property
    def site_form(self) -> LiePoissonSystem | None:
        """The site form of a system of many sites: that of one body, whose formulas ask the other
        sites for what they need; None if there is none.
        """
        return self.at_site(LiePoissonSystem)

    def constants(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Energy, Casimirs, if the attitude is known, the spatial momentum, and what sites that are coupled
        keep together.
        """
        energy = {"energy": np.asarray(self.energy(states["mu"]))}
        return energy | super().constants(states) | self.momenta_of_sites(states)

    def momenta_of_sites(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The sum of all momenta, where a turn of all sites leaves the energy as it is."""
        return momenta_of_symmetry(self, np.asarray(states["mu"]))

    @property
    def is_large(self) -> bool:
        """Whether there are more sites than formulas would be written out for, or large matrices."""
        return self.group.is_large and isinstance(self.group, (PowerGroup, SpeciesGroup, MatrixLieGroup))

    def _in_numpy(self, method: str, arguments: dict[str, Any]) -> Any:
        if method in ("energy", "velocity") and lies_in_memory(self.group):
            formula: Any = self.hamiltonian.energy if method == "energy" else self.hamiltonian.gradient
            return np.array([np.asarray(formula(Large(mu))) for mu in arguments["mu"]])
        energy = self.hamiltonian if self.hamiltonian.is_large else None
        if method in ("energy", "velocity"):
            name = "energy" if method == "energy" else "gradient"
            return energy and energy._in_numpy(name, arguments)
        return of_group(self.group, method, arguments)

    # ---------------------------------------------------------------- checked input

    @final
    def state(self, mu: Any = None, g: Any = None, *, xi: Any = None) -> BodyState:
        """A start for `integrate`: body momentum mu, or body velocity xi, and, if the motion on the
        group is wanted, the element g.

        mu, xi : (dim,) for one body, (bodies, dim) for an ensemble;  g : an element, for matrix
        groups (n, n), or (bodies, n, n); SciPy's Rotation and RigidTransform will do, on a product
        a tuple of the factors' elements, (rotation, x).  xi needs a
        Lagrangian, dl/dxi is the momentum.
        Raises InvalidInput for wrong shapes, entries that are not finite, and a g that is not on
        the group.
        """
        name = f"{type(self).__name__}.state"
        momentum = mu if xi is None and mu is not None else self._momentum_of(name, mu, xi)
        return self._vouched(body_state(name, self.group, momentum, g))

    @final
    def _momentum_of(self, name: str, mu: Any, xi: Any) -> Any:
        """The momentum of a start, from mu or from xi, whichever is given.  name : of the caller, for messages."""
        if mu is None and xi is None:
            raise InvalidInput(f"{name}: give mu, the momentum, or xi, the velocity")
        if xi is None:
            return mu
        if mu is not None:
            raise InvalidInput(f"{name}: give mu, the momentum, or xi, the velocity, not both")
        if self.lagrangian is None:
            raise InvalidInput(
                f"{name}: {self!r} has no Lagrangian, which makes a momentum of the velocity xi; give mu"
            )
        if isinstance(self.group, SpeciesGroup) and self.lagrangian is not None:
            return self.lagrangian.momentum(rows_of_species(f"{name}: xi", self.group, xi, "Vec"))
        if isinstance(self.group, PowerGroup) and isinstance(self.lagrangian, OfManySites):
            lagrangian: Any = self.lagrangian
            return lagrangian.momenta(velocities_of_sites(f"{name}: xi", self.group, xi))
        dim = self.group._sizes[0]
        return self.lagrangian.momentum(points(xi, f"{name}: xi", dim, f"a velocity on {self.group!r}"))


def enlarged(energy: Any) -> Any:
    """The energy of large momenta: vectors and matrices among its fields lie in memory too."""
    if not isinstance(energy, Record):
        return energy
    fields = fields_of(energy)
    large = {n: Large(x) for n, x in fields.items() if isinstance(x, (SmallVec, Mat)) and len(x)}
    return fill(type(energy), vars(energy) | fields | large) if large else energy


def in_a_row(system: System, state: State) -> State:
    """The state of a body whose vectors are those of all sites in a row; any other state as it is."""
    if not isinstance(state, SiteState):
        return state
    row: State | None = _written.get(state)
    if row is None:
        row = BodyState(**state.in_a_row)
        _written.set(state, row)
    return system._vouched(row) if system._knows(state) else row


def with_sites(system: Any, state: State, axes: int) -> State:
    """The inverse of `in_a_row`: on a power a state of sites, any other state as it is.

    axes : count of the axes of times and members, behind which the numbers of all sites may be in a row.
    """
    group = getattr(system, "configurations", system.group)
    if not isinstance(group, PowerGroup) or type(state) not in (BodyState, SiteState):
        return state
    parts = state.arrays
    return SiteState(**{n: group.by_site(x, KINDS[n]) if x.ndim == axes + 1 else x for n, x in parts.items()})


_written = Remembered()
"""For states of many sites the same in a row."""


def by_site(group: LieGroup, arrays: dict[str, Any]) -> dict[str, Any]:
    """Parts of states of sites of several species, with an axis of sites."""
    if not isinstance(group, SpeciesGroup):
        return arrays
    return {name: group.by_site(np.asarray(x), KINDS[name]) for name, x in arrays.items()}


def as_users_see(group: LieGroup, arrays: dict[str, Any]) -> dict[str, Any]:
    """The inverse of `by_site`: species as lists again."""
    if not isinstance(group, SpeciesGroup):
        return arrays
    return {name: group.without_sites(x, KINDS[name]) if name in KINDS else x for name, x in arrays.items()}


KINDS = {"mu": "Vec", "g": "Element"}
"""Of parts of states what their numbers are."""


def of_group(group: LieGroup, method: str, arguments: dict[str, Any]) -> Any:
    """Casimirs and spatial momenta on arrays; None for anything else."""
    if method == "casimirs":
        return group._in_numpy("casimirs", arguments)
    if method == "spatial_momentum":
        return group._in_numpy("K", {"g": arguments["g"], "mu": arguments["mu"]})
    return None


def _of_factors(name: str, group: ProductGroup, g: tuple[Any, ...]) -> Any:
    """One element from those of the factors, if that is what a tuple holds; else the tuple."""
    if len(g) != len(group.factors) or all(isinstance(x, (int, float)) for x in g):
        return g
    try:
        return group.join(*g)
    except InvalidInput as error:
        raise InvalidInput(f"{name}: g: {error}") from None


def body_state(name: str, group: LieGroup, mu: Any, g: Any) -> Any:
    """Momenta on a group and, if given, elements of it, checked; one of either may serve for many of the other."""
    if isinstance(group, PowerGroup):
        return site_state(name, group, mu, g)
    if isinstance(g, tuple) and isinstance(group, ProductGroup):
        g = _of_factors(name, group, g)
    dim, shape = group._sizes
    large = lies_in_memory(group)
    quick = None if large or isinstance(group, SpeciesGroup) else at_a_glance(mu, dim)
    if quick is not None and (g is None or (at := element_at_a_glance(group, g)) is not None):
        start = fill(BodyState, {"mu": quick, "g": None if g is None else at})
        return laid_out(start, (dim, None if g is None else shape))
    if isinstance(group, SpeciesGroup):
        momenta = rows_of_species(f"{name}: mu", group, mu, "Vec")
        elements = None if g is None else rows_of_species(f"{name}: g", group, g, "Element")
    else:
        momenta = points(mu, f"{name}: mu", dim, f"a momentum on {group!r}")
        elements = None if g is None else members_of(group, g, f"{name}: g")
    counts = [len(a) for a, single in ((momenta, dim), (elements, shape)) if a is not None and a.shape != single]
    if len(set(counts)) > 1:
        raise InvalidInput(f"{name}: {counts[0]} momenta and {counts[1]} group elements")
    bodies = counts[0] if counts else None
    start = BodyState(
        as_field(momenta, dim, bodies, large), None if elements is None else as_field(elements, shape, bodies, large)
    )
    return large_members(start, large)
