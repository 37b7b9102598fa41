"""Sums of terms as Hamiltonians, potentials and forces on a power of a group.

Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., sections 4.4, 7.2, 7.7 and 15.2; Marsden and
West, Acta Numerica 10 (2001), section 3.1 (loads).
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from ....errors import InvalidInput
from ....formulas import Element, Mat, Vec, derivative, mat, record, vec, vectors
from ....formulas.classes.of_each import Each
from ....formulas.classes.records import fields_of, records_in, with_fields, with_records
from ....formulas.sites import SiteArray, interleaved_sum
from ....groups.composed.power import PowerGroup
from ....groups.composed.product import spans
from ....groups.composed.species import SpeciesGroup
from ....groups.lie_group import LieGroup
from ....systems.hamiltonian import Hamiltonian
from ....systems.in_time.driven_hamiltonian import DrivenHamiltonian
from ....systems.kinetic_energy import has_inertia
from ....systems.lagrangian import Lagrangian
from ....systems.many.energies import OfManySites, WithHeldSites, moving
from ....systems.potential import Force, NoPotential, Potential
from ..colouring import Coloured
from ..energy_of_species import EnergyOfSpecies
from .among import Species
from .bound_terms import BoundTerm, term_of_edge
from .kinds_of_terms import feels_velocity
from .terms import PerSite, at_time, site_class
from .terms_at_site import (
    EachOfSites,
    EnergyOfSite,
    ForceOfSite,
    HamiltonianOfSite,
    OwnOfSites,
    PotentialOfSite,
    RoleAtSite,
    SlopesOfLoad,
    TermsOfSite,
)
from .terms_in_arrays import energies, slopes_of
from .trials_of_terms import require_apart


@record
class OfTerms(OfManySites):
    """The base of energies and loads that are sums of terms over graphs; abstract."""

    form: ClassVar[type[TermsOfSite]]
    of_a_site: ClassVar[tuple[str, ...]]  # the parts of the state of a site that terms see

    group: PowerGroup | SpeciesGroup  # the power whose copies are the sites, or a product of powers
    parts: tuple[BoundTerm, ...]  # the terms
    names: tuple[str, ...] = ()  # of the parameters of the sites
    own: tuple[Any, ...] = ()  # the values of these parameters
    held: tuple[int, ...] = ()  # the sites that do not move
    species: Species | None = None  # of the sites, if there are several
    pinned: tuple[int, ...] = ()  # the sites on SE(3) that turn where they are

    def __post_init__(self) -> None:
        """Raises InvalidInput for sites that are not there, and for terms and parameters of other sites."""
        super().__post_init__()
        name, group, species = type(self).__name__, self.group, self.species
        for what, numbers in (("held", self.held), ("pinned", self.pinned)):
            for i in numbers:
                if not (type(i) is int and 0 <= i < group.copies):
                    raise InvalidInput(f"{name}: {what} names site {i!r}; they are 0 to {group.copies - 1}")
        for parameter, value in zip(self.names, self.own, strict=True):
            if isinstance(value, Each) and len(value) != group.copies:
                raise InvalidInput(f"{name}: {parameter} has {len(value)} values for {group.copies} sites")
        for part in self.parts:
            part.require_on(group)
        own_species = Species.of_group(group, species.names) if species and isinstance(group, SpeciesGroup) else None
        if species != own_species or (species is None) == isinstance(group, SpeciesGroup):
            raise InvalidInput(f"{name}: {species!r} are not the species of {group!r}")

    def __repr__(self) -> str:
        parameters = [f"{name}={value!r}" for name, value in zip(self.names, self.own)]
        resting = [("held", self.held), ("pinned", self.pinned)]
        held = [f"{name}={[*sites]}" for name, sites in resting if sites]
        if self.of_one is not None and not parameters:
            return repr(self.parts[0])
        return f"Terms({', '.join([*map(repr, self.parts), *parameters, *held])})"

    @property
    def is_large(self) -> bool:
        return self.group.is_large

    @cached_property
    def site(self) -> Any:
        """A site of which nothing is known."""
        return site_class(self.names)()

    def site_with(self, i: int, mu: Any, g: Any, xi: Any = None) -> Any:
        """Site i as terms see it."""
        parameters = [x.of(i) if isinstance(x, Each) else x for x in self.own]
        if self.species is None or not isinstance(self.group, SpeciesGroup):
            return type(self.site)(mu, g, xi, *parameters)
        k = self.group.species_of(i)
        of_species = [x for name, x in zip(self.names, parameters) if name in self.species.names[k]]
        return type(self.species.blank[k])(mu, g, xi, *of_species)

    def at_site(self, i: int, sites: list[Any], parts: Any = None) -> Any:
        """The site form at site i of sites that are all known.  parts : the terms that count; None: all."""
        roles: list[Any] = []
        for part in self.parts if parts is None else parts:
            for role, chains in zip(part.roles, part.chains):
                roles = [*roles, RoleAtSite(part.term, role, part.merged, False, chains=chains[i])]
        return with_fields(self.form(()), roles=tuple(roles), present=(sites[i], sites))

    def energy_of(self, sites: list[Any]) -> float:
        """The sum over terms and edges, site by site."""
        return interleaved_sum([self.at_site(i, sites).share(None, None) for i in range(len(sites))])

    def by_site(self, sites: list[Any], formula: Any, parts: Any = None) -> Vec:
        """The values of formula(site form, group of the site, site), one behind the other; zero where sites are held.
        parts : the terms that count; None: all.
        """
        components: list[Any] = []
        for i, site in enumerate(sites):
            form = self.at_site(i, sites, () if i in self.held else parts)
            components = [*components, *formula(form, self.group.base_of(i), site)]
        return self.moving(vec(*components))

    @property
    def released(self) -> Any:
        return with_fields(self, held=(), pinned=()) if self.held or self.pinned else self

    @staticmethod
    def held_together(name: str, body: Any, potential: Any, load: Any) -> tuple[Any, Any, Any]:
        return held_together(name, body, potential, load)

    def moving(self, x: Vec) -> Vec:
        """A vector with zeros where sites are held or pinned."""
        if not self.held and not self.pinned:
            return x
        components: list[Any] = []
        for i, part in enumerate(self.divided(x)):
            free = 0 if i in self.held else 3 if i in self.pinned else len(part)
            components = [*components, *part[:free], *[0.0 for _ in range(len(part) - free)]]
        return vec(*components)

    def divided(self, x: Vec) -> list[Any]:
        """The parts of a vector that belong to the sites."""
        return [self.group.momentum_of(x, i) for i in range(self.group.copies)]

    def of_site(self) -> Any:
        """The site form: the energy or the load of one body, which asks the other sites for what it needs; of `PerSite`
        alone the one that it was given.
        """
        return self._of_one_at_a_site() or self.form(*self._at_a_site())

    def _at_a_site(self) -> tuple[Any, ...]:
        """The fields of the site form."""
        roles = [RoleAtSite.made(part, role) for part in self.parts for role in part.roles]
        parameters = [OwnOfSites.of_each(x) if isinstance(x, Each) else x for x in self.own]
        moves: Any = np.ones((self.group.copies, 6))
        moves[[*self.held]] = 0.0
        moves[[*self.pinned], 3:] = 0.0
        moves = moves if self.pinned else moves[:, 0]
        moves = SiteArray.of(moves) if self.held or self.pinned else None
        return tuple(roles), self.names, tuple(parameters), moves, self.species

    @property
    def of_one(self) -> Any:
        """The energy of one body that each site has, if there is nothing else; None if there is.  Of
        several species those of a body of each, a tuple.
        """
        if self.held or self.pinned or not all(isinstance(part.term, PerSite) for part in self.parts):
            return None
        single_energies = {part.of: part.term.energy_of_one for part in self.parts}
        if self.species is None:
            return single_energies[()] if len(self.parts) == 1 else None
        by_species = tuple([single_energies.get((k,)) for k in range(len(self.species.groups))])
        return by_species if len(self.parts) == len(by_species) and None not in by_species else None

    def _of_one_at_a_site(self) -> Any:
        energy: Any = self.of_one
        if isinstance(energy, tuple):
            group, species = self.group, self.species  # type: Any, Any
            momenta = all(isinstance(x, Hamiltonian) for x in energy)
            return EnergyOfSpecies.at_site(energy, species, group) if momenta else None
        return energy and with_records(energy, Each, map(EachOfSites.of_each, records_in(energy, Each)))

    def _by_site(self, arguments: dict[str, Any]) -> np.ndarray:
        """The momenta or the elements of samples, (samples, sites, width)."""
        raise NotImplementedError

    def _in_numpy(self, method: str, arguments: dict[str, Any]) -> Any:
        if method == "energy":
            return energies(self, self._by_site(arguments))
        if method in ("gradient", "force"):
            return self.group.without_sites(slopes_of(self, self._by_site(arguments)), "Vec")
        return None

    def _shape(self, argument: str, kind: str) -> tuple[int, ...] | None:
        return (self.group.dim,) if kind == "Vec" else self.group.element_shape

    def _in_rows(self, value: Any, kind: str) -> Any:
        return self.group._in_rows(value, kind)

    def _out_of_rows(self, results: Any, kind: str | None = None) -> Any:
        return self.group._out_of_rows(results, kind)


@record
class MomentumTerms(OfTerms, Hamiltonian):
    """The Hamiltonian that `Terms` are on a power of a group: a sum of terms in momenta."""

    form: ClassVar[type[TermsOfSite]] = HamiltonianOfSite
    of_a_site: ClassVar[tuple[str, ...]] = ("mu",)
    __repr__ = OfTerms.__repr__

    def _sites(self, mu: Vec) -> list[Any]:
        return [self.site_with(i, m, None) for i, m in enumerate(self.divided(mu))]

    def energy(self, mu: Vec) -> float:
        """The sum over terms and edges, site by site.  mu : (sites dim,), or (sites, dim)."""
        return self.energy_of(self._sites(mu))

    def gradient(self, mu: Vec) -> Vec:
        """The derivative dH by the momenta.  mu : (sites dim,), or (sites, dim)."""
        return self.by_site(self._sites(mu), lambda form, _, site: form.gradient(site.mu))

    @cached_property
    def affine(self) -> Coloured:
        """The sites in groups, such that no term that is affine in each has two of one group."""
        graphs = [part.graph for part in self.parts if part.kind.affine]
        return Coloured(tuple(graphs), self.group.copies)

    @cached_property
    def pairs(self) -> Coloured:
        """The edges of two sites in groups, such that no two of one group share a site."""
        graphs = [part.graph for part in self.parts if part.graph.arity == 2]
        return Coloured(tuple(graphs), self.group.copies)

    def _by_site(self, arguments: dict[str, Any]) -> np.ndarray:
        return self.group.by_site(arguments["mu"], "Vec")


@record
class KineticTerms(MomentumTerms, Lagrangian):
    """The Hamiltonian of sites each of which has a Lagrangian too, such as `PerSite(KineticEnergy(
    J))`, and that Lagrangian.
    """

    __repr__ = OfTerms.__repr__

    def of_one_at(self, i: int) -> Any:
        """The energy of site i."""
        if not isinstance(self.group, SpeciesGroup):
            return term_of_edge(self.parts[0].term, i).energy_of_one
        k = self.group.species_of(i)
        of_species = self.parts[0]
        for part in self.parts:
            of_species = part if part.of == (k,) else of_species
        return term_of_edge(of_species.term, i - self.group.firsts[k]).energy_of_one

    def _each_one(self) -> list[Any]:
        return [self.of_one_at(i) for i in range(self.group.copies)]

    def value(self, xi: Vec) -> float:
        """The sum over the sites.  xi : (sites dim,), or (sites, dim)."""
        return interleaved_sum([energy.value(x) for energy, x in zip(self._each_one(), self.divided(xi))])

    def momentum(self, xi: Vec) -> Vec:
        """The momenta of the sites, one behind the other.  xi : (sites dim,), or (sites, dim)."""
        momenta = [energy.momentum(x) for energy, x in zip(self._each_one(), self.divided(xi))]
        return vec(*[x for part in momenta for x in part])

    def hessian(self, xi: Vec) -> Mat | Vec:
        """The Hessians of the sites, as blocks of the diagonal."""
        blocks = [energy.hessian(x) for energy, x in zip(self._each_one(), self.divided(xi))]
        if all([isinstance(block, vectors.Vec) for block in blocks]):  # noqa: C419
            return vec(*[x for block in blocks for x in block])
        places = spans([len(block) for block in blocks])
        return mat(
            *[
                vec(*[0.0] * first, *_row(block, k), *[0.0] * (self.group.dim - end))
                for block, (first, end) in zip(blocks, places)
                for k in range(end - first)
            ]
        )

    def momenta(self, xi: Any) -> np.ndarray:
        """The momenta of many sites in arrays, (..., sites, dim).  xi : (..., sites, dim)."""
        energy = self.of_one
        if has_inertia(energy):
            J = energy.inertia.values if isinstance(energy.inertia, Each) else np.array(energy.inertia)
            if J.ndim - isinstance(energy.inertia, Each) == 2:
                return np.asarray((J @ xi[..., None])[..., 0])
            return np.asarray(J * xi)
        each_one = self._each_one() if records_in(energy, Each) else [energy]
        if len(each_one) == 1:
            return np.asarray(energy.momentum(xi))
        momenta = [np.asarray(x.momentum(xi[..., i, :])) for i, x in enumerate(each_one)]
        return np.stack(momenta, axis=-2)


def _row(block: Any, k: int) -> list[Any]:
    """Row k of a matrix, which may be given by its diagonal."""
    if isinstance(block, vectors.Vec):
        return [block[k] if j == k else 0.0 for j in range(len(block))]
    return [*block[k]]


@record
class PlaceTerms(OfTerms, Potential):
    """The potential that `Terms` are on a power of a group: a sum of terms in elements."""

    form: ClassVar[type[TermsOfSite]] = PotentialOfSite
    of_a_site: ClassVar[tuple[str, ...]] = ("g",)
    __repr__ = OfTerms.__repr__

    def _sites(self, g: Vec) -> list[Any]:
        return [self.site_with(i, None, self.group.site(g, i)) for i in range(self.group.copies)]

    def energy(self, g: Element) -> float:
        """The sum over terms and edges, site by site.  g : an element of the power."""
        return self.energy_of(self._sites(g))

    def force(self, group: LieGroup, g: Element) -> Vec:
        """The forces on all sites.  g : an element of the power."""
        return self.by_site(self._sites(g), lambda form, base, site: form.force(base, site.g))

    def force_of(self, group: LieGroup, g: Element, k: int) -> Vec:
        """The forces of term number k alone."""
        return self.by_site(self._sites(g), lambda form, base, site: form.force(base, site.g), (self.parts[k],))

    def require_start(self, name: str, group: LieGroup, mu: Any, g: Any) -> None:
        """Raises InvalidInput for sites in one place whose energy is infinite there, and for held ones that move."""
        require_apart(name, self, g)
        _require_rest(name, group, self.held, np.asarray(mu), "held: its momentum")
        _require_rest(name, group, self.pinned, np.asarray(mu), "pinned: its linear momentum", 3)

    def _by_site(self, arguments: dict[str, Any]) -> np.ndarray:
        g, group = arguments["g"], self.group
        return (group.by_site(g, "Element") if isinstance(group, SpeciesGroup) else g).reshape(len(g), group.copies, -1)


@record
class EnergyTerms(OfTerms):
    """The energy that `Terms` are on T*G, G a power of a group: a sum of terms in momenta and elements."""

    form: ClassVar[type[TermsOfSite]] = EnergyOfSite
    of_a_site: ClassVar[tuple[str, ...]] = "mu", "g"
    __repr__ = OfTerms.__repr__

    def _sites(self, mu: Vec, g: Element) -> list[Any]:
        return [self.site_with(i, m, self.group.site(g, i)) for i, m in enumerate(self.divided(mu))]

    def energy(self, mu: Vec, g: Element) -> float:
        """The sum over terms and edges, site by site.  mu : (sites dim,), g : an element of the power."""
        return self.energy_of(self._sites(mu, g))

    def rates(self, group: LieGroup, mu: Vec, g: Element) -> tuple[Vec, Vec]:
        """The velocities of all sites and the forces on them, (sites dim,) each; zero of sites that are held."""
        sites, velocities, forces = self._sites(mu, g), [], []  # type: Any, list[Any], list[Any]
        for i, site in enumerate(sites):
            at_site = self.at_site(i, sites, () if i in self.held else None)
            xi, force = at_site.rates(self.group.base_of(i), site.mu, site.g)
            velocities, forces = [*velocities, *xi], [*forces, *force]
        return vec(*velocities), vec(*forces)

    def _by_site(self, arguments: dict[str, Any]) -> np.ndarray:
        mu, g = (self.group.by_site(arguments[name], kind) for name, kind in (("mu", "Vec"), ("g", "Element")))
        return np.concatenate([np.reshape(x, (*x.shape[:2], -1)) for x in (mu, g)], axis=2)

    def _in_numpy(self, method: str, arguments: dict[str, Any]) -> Any:
        if method not in ("velocity", "force"):
            return super()._in_numpy(method, arguments)
        slopes, dim = slopes_of(self, self._by_site(arguments)), self.group.base.dim
        return self.group.without_sites(slopes[..., :dim] if method == "velocity" else slopes[..., dim:], "Vec")


@record
class ForceTerms(OfTerms, Force):
    """The load that `Terms` are on a power of a group: a sum of forces on sites."""

    form: ClassVar[type[TermsOfSite]] = ForceOfSite
    of_a_site: ClassVar[tuple[str, ...]] = "g", "xi"
    __repr__ = OfTerms.__repr__

    @property
    def feels_velocity(self) -> bool:
        """Whether a force depends on the velocity."""
        return feels_velocity(self)

    def covector(self, t: float, xi: Vec, g: Any) -> Vec:
        """The forces on all sites.  xi : (sites dim,), g : an element of the power."""
        return self._of_parts(self.parts, t, xi, g)

    def _of_parts(self, parts: Any, t: float, xi: Vec, g: Any) -> Vec:
        """Those of some of the terms."""
        sites = self._moving_sites(xi, g)
        return self.by_site(sites, lambda form, _, site: form.covector(t, site.xi, site.g), parts)

    def _moving_sites(self, xi: Vec, g: Any) -> list[Any]:
        return [self.site_with(i, None, self.group.site(g, i), x) for i, x in enumerate(self.divided(xi))]

    def resistance(self, t: float, xi: Vec, g: Any, along: Vec) -> Vec:
        """The damping along velocities of all sites, (sites dim,); of terms that say what damps, that of each site by
        its own velocity.
        """
        damping_parts = tuple([part for part in self.parts if part.term.says_resistance])
        others = tuple([part for part in self.parts if not part.term.says_resistance])
        sites, along_sites = self._moving_sites(xi, g), self.divided(along)
        dampings = [
            self.at_site(i, sites, damping_parts).resistance(t, sites[i].xi, sites[i].g, x)
            for i, x in enumerate(along_sites)
        ]
        of_said = vec(*[x for damping in dampings for x in damping])
        return self.moving(of_said) - derivative(lambda x: self._of_parts(others, t, x, g), xi, along)

    def slopes_of_site(self) -> Any:
        """The site form of the derivatives of <lambda, F>; that of `PerSite` alone is the load itself."""
        parts = tuple([with_fields(part, first=False) for part in self.parts])
        return self._of_one_at_a_site() or SlopesOfLoad(
            *with_fields(self, parts=parts, held=(), pinned=())._at_a_site()
        )


@record
class DrivenTerms(DrivenHamiltonian, WithHeldSites):
    """A Hamiltonian of many sites some of whose terms change with time.

    at_zero : it, with these terms as they are at time 0.
    """

    at_zero: Hamiltonian

    def __repr__(self) -> str:
        return repr(self.at_zero)

    @property
    def coupled(self) -> bool:  # type: ignore[override]
        """Whether there is a term of several sites."""
        return self.at_zero.coupled

    def moving(self, xi: Vec) -> Vec:
        return moving(self.at_zero, xi)

    def _free(self, t: float, mu: Vec) -> Vec:
        return self.at(t)._free(mu)

    def at(self, t: float) -> Any:
        return at_time(self.at_zero, t)

    def energy(self, t: float, mu: Vec) -> float:
        """At time t.  mu : (sites dim,), or (sites, dim)."""
        return self.at(t).energy(mu)

    def gradient(self, t: float, mu: Vec) -> Vec:
        """The velocities at time t.  mu : (sites dim,), or (sites, dim)."""
        return self.at(t).gradient(mu)

    def of_site(self) -> DrivenTerms:
        """The site form, driven like the whole."""
        at_zero: Any = self.at_zero
        return DrivenTerms(at_zero.of_site())

    def _shape(self, argument: str, kind: str) -> tuple[int, ...] | None:
        return self.at_zero._shape(argument, kind)

    def _in_rows(self, value: Any, kind: str) -> Any:
        return self.at_zero._in_rows(value, kind)

    def _out_of_rows(self, results: Any, kind: str | None = None) -> Any:
        return self.at_zero._out_of_rows(results, kind)


# ------------------------------------------------------------------ sites that rest


def held_together(name: str, body: Any, potential: Any, load: Any) -> tuple[Any, Any, Any]:
    """A body, its potential and its load (or None), with the sites held and pinned that any of them says.  Raises
    InvalidInput where one of them cannot leave a site where it is.
    """
    energy = getattr(body, "hamiltonian", None)
    sums = [x for x in (energy, potential, load) if isinstance(x, OfTerms)]
    held, pinned = (tuple(sorted({i for x in sums for i in getattr(x, which)})) for which in ("held", "pinned"))
    if not held and not pinned:
        return body, potential, load
    words = f"sites {[*held, *pinned]} are held or pinned"
    if isinstance(potential, OfTerms):
        body = _resting(body)
        energy = getattr(body, "hamiltonian", None)
    for x in (potential, load):
        if not (x is None or isinstance(x, (OfTerms, NoPotential))):
            raise InvalidInput(f"{name}: {words}, and {x!r} may push them: write it as Terms(...)")
    if isinstance(energy, DrivenHamiltonian):
        raise InvalidInput(f"{name}: {words}, and {energy!r} may move them")
    if isinstance(potential, OfTerms):
        potential = with_fields(potential, held=held, pinned=pinned)
    load = None if load is None else with_fields(load, held=held, pinned=pinned)
    group = body.group
    mu = np.random.default_rng(1).normal(size=(group.copies, group.base.dim))
    mu[[*held]] = 0.0
    mu[[*pinned], 3:] = 0.0
    xi = group.by_site(np.asarray(body.velocity(group.without_sites(mu[None], "Vec"))), "Vec")[0]
    alone = isinstance(energy, OfTerms) and all(isinstance(part.term, PerSite) for part in energy.parts)
    if xi[[*pinned], 3:].any():
        raise InvalidInput(
            f"{name}: {words}, and the energy of {body!r} moves pinned sites along as they turn: give inertias about "
            "the points that stay"
        )
    if xi[[*held]].any() or not alone:
        if not isinstance(energy, OfTerms):
            raise InvalidInput(f"{name}: {words}, and {energy!r} may move them: write it as Terms(...)")
        energy = MomentumTerms(**{**fields_of(energy), "held": held, "pinned": pinned})
        body = with_fields(body, hamiltonian=energy)
    return body, potential, load


def _resting(body: Any) -> Any:
    """A body of many sites whose energy holds some of them: where each has an energy of its own, one that does not, for
    they rest at zero momentum.
    """
    energy = getattr(body, "hamiltonian", None)
    plain = isinstance(energy, MomentumTerms) and not isinstance(energy, KineticTerms)
    if not plain or getattr(body, "lagrangian", None) is not None or "hamiltonian" not in fields_of(body):
        return body
    free = with_fields(energy, held=(), pinned=())
    single_energies = free.of_one if isinstance(free.of_one, tuple) else (free.of_one,)
    if not all(isinstance(energy_of_one, Lagrangian) for energy_of_one in single_energies):
        return body
    return type(body)(**{**fields_of(body), "hamiltonian": KineticTerms(**fields_of(free))})


def _require_rest(name: str, group: Any, held: tuple[int, ...], mu: np.ndarray, what: str, first: int = 0) -> None:
    """Raise InvalidInput for a site that is held, and has a momentum, from a component on."""
    if not held:
        return
    mu = group.by_site(mu, "Vec") if mu.shape[-1:] == (group.dim,) else mu
    moving = np.flatnonzero(mu[..., list(held), first:].any(axis=-1).reshape(-1, len(held)).any(axis=0))
    if len(moving):
        raise InvalidInput(f"{name}: site {group.named(held[moving[0]])} is {what} must be zero")
