"""Many sites on T*G whose energy is a sum of terms of momenta and places."""

from __future__ import annotations

from functools import cached_property
from typing import Any, ClassVar, final

import numpy as np

from ...errors import InvalidInput
from ...formulas import Element, Vec, record
from ...formulas.classes.records import records_in, with_fields
from ...groups.lie_group import LieGroup
from ...systems.cotangent import CotangentSystem, DrivenCotangentSystem, EnergyOnCotangent
from ...systems.lie_poisson import of_group
from ...systems.many.energies import on_group
from .terms.sums_of_terms import EnergyTerms
from .terms.terms import AtTime, at_time


@record
class EnergyOfTerms(EnergyOnCotangent):
    """Motion of many sites on T*G by a sum of terms; abstract.

    configurations : a power of a group, such as SO3() ** 100.  terms : `Terms(...)` of momenta `a.mu` and elements `a.g`.
    """

    small: ClassVar[int] = 6  # what follows by differentiation grows fast where all sites are written out

    configurations: LieGroup
    terms: Any

    def __post_init__(self) -> None:
        name, terms = type(self).__name__, on_group(self.terms, EnergyTerms, type(self).__name__, self.configurations)
        if not isinstance(terms, EnergyTerms):
            raise InvalidInput(f"{name}: terms, such as Terms(Exchange(1.0).over(neighbours.ring(100))); got {terms!r}")
        if terms.pinned:
            raise InvalidInput(f"{name}: pinned={[*terms.pinned]}: sites are held, with their momenta, or move")
        object.__setattr__(self, "terms", terms)
        super().__post_init__()

    @final
    def rates(self, t: float, mu: Vec, g: Element) -> tuple[Vec, Vec]:
        """The velocities of all sites and the forces on them.  mu : (sites dim,), g : an element of the power."""
        return at_time(self.terms, t).rates(self.configurations, mu, g)

    @cached_property
    def site_form(self) -> Any:
        """The site form: one site, whose formulas ask the other sites for what they need."""
        group: Any = self.configurations
        return with_fields(self, configurations=group.base, terms=self.terms.of_site())

    def momenta_of_sites(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The momenta that a symmetry keeps, at many samples, with an axis of sites."""
        return self.symmetry(states["mu"], states["g"])

    @property
    def is_large(self) -> bool:
        return bool(self.terms.is_large)

    def _in_numpy(self, method: str, arguments: dict[str, Any]) -> Any:
        if method in ("energy", "velocity", "force"):
            return self.terms._in_numpy(method, arguments)
        return of_group(self.configurations, method, arguments)


@record
class CotangentSites(EnergyOfTerms, CotangentSystem):
    """Motion of many sites on T*G by a sum of terms in which momenta and places meet:

        H(g, mu) = sum over terms, sum over edges (a, b, ...) of term.energy(a, b, ...),   a.mu and a.g of each site

    configurations : a power of a group, such as SO3() ** 100, or a product of powers.  terms : `Terms(...)`.  Sites that
    are held keep momentum and element.
    A subclass may name what its symmetries keep (`symmetry`).  RKMK and SymplecticRKMK step site by site; splittings
    need an energy H(mu) + V(g), of a MechanicalSystem.

    Raises InvalidInput for terms of other sites than the group has, and for terms that change with time: those are of
    DrivenCotangentSites.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 4.4 and chapter 13.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        for term in records_in(self.terms, AtTime):
            raise InvalidInput(f"{type(self).__name__}: {term!r} changes with time: make it DrivenCotangentSites")

    @final
    def energy(self, mu: Vec, g: Element) -> float:
        """The sum of the terms.  mu : (sites dim,), g : an element of the power."""
        return self.terms.energy(mu, g)

    @final
    def velocity(self, mu: Vec, g: Element) -> Vec:
        """The velocities of all sites.  mu : (sites dim,), g : an element of the power."""
        return self.rates(0.0, mu, g)[0]

    @final
    def force(self, mu: Vec, g: Element) -> Vec:
        """The forces on all sites.  mu : (sites dim,), g : an element of the power."""
        return self.rates(0.0, mu, g)[1]


@record
class DrivenCotangentSites(EnergyOfTerms, DrivenCotangentSystem):
    """Motion of many sites on T*G by a sum of terms of which some change with time, `energy(a, t)`, as CotangentSites by
    one that does not.

    configurations : a power of a group, such as SO3() ** 100, or a product of powers.  terms : `Terms(...)`.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 4.4 and chapter 13.
    """

    @final
    def energy(self, t: float, mu: Vec, g: Element) -> float:
        """The sum of the terms at time t.  mu : (sites dim,), g : an element of the power."""
        return at_time(self.terms, t).energy(mu, g)

    @final
    def velocity(self, t: float, mu: Vec, g: Element) -> Vec:
        """The velocities of all sites at time t.  mu : (sites dim,), g : an element of the power."""
        return self.rates(t, mu, g)[0]

    @final
    def force(self, t: float, mu: Vec, g: Element) -> Vec:
        """The forces on all sites at time t.  mu : (sites dim,), g : an element of the power."""
        return self.rates(t, mu, g)[1]
