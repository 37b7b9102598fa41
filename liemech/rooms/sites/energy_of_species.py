"""The energy of a body of one of several species: the site form of kinetic energies."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ...formulas import Mat, Vec, record
from ...formulas.classes.of_each import Each, each
from ...formulas.classes.records import records_in, with_records
from ...groups.composed.one_of import chosen, lengthened, widened
from ...groups.composed.product import entries
from ...groups.composed.species import SpeciesGroup
from ...systems.lagrangian import Lagrangian
from ...systems.many.energies import OfSpecies
from .terms.among import Species
from .terms.terms_at_site import EachOfSites


@record
class EnergyOfSpecies(OfSpecies, Lagrangian):
    """The energy of a site that depends on its species.

    energies : of a body of each species.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 7.2.
    """

    energies: tuple[Any, ...]
    species: Species

    @classmethod
    def at_site(cls, energies: tuple[Any, ...], species: Species, group: SpeciesGroup) -> EnergyOfSpecies:
        """The energy of a site, from those of species whose parameters may be `each(values)`."""
        at_sites = []
        for k, energy in enumerate(energies):
            before, end = group.firsts[k], group.firsts[k] + group.counts[k]

            def of_all(own: Each, before: int = before, end: int = end) -> EachOfSites:
                values = own.values
                others = [(before, group.copies - end), *[(0, 0)] * (values.ndim - 1)]
                return EachOfSites.of_each(each(np.pad(values, others, "edge")))

            at_sites.append(with_records(energy, Each, [of_all(parameter) for parameter in records_in(energy, Each)]))
        return cls(tuple(at_sites), species)

    @property
    def of_species(self) -> tuple[Any, ...]:
        return self.energies

    def chosen(self, formula: Callable[[int, Any], Any]) -> Any:
        """formula(k, energy) for the species k of this site."""
        energies = self.energies
        return chosen(self.species.which, energies, lambda k: formula(k, energies[k]))

    def energy(self, mu: Vec) -> float:
        """The energy of a site of its species.  mu : (dim,), its momentum."""
        return self.chosen(lambda k, one: one.energy(self.species.vector(k, mu)))

    def gradient(self, mu: Vec) -> Vec:
        """The velocity of a site of its species.  mu : (dim,), its momentum."""
        return self.chosen(lambda k, one: lengthened(one.gradient(self.species.vector(k, mu)), mu))

    def value(self, xi: Vec) -> float:
        """The Lagrangian of a site of its species.  xi : (dim,), its velocity."""
        return self.chosen(lambda k, one: one.value(self.species.vector(k, xi)))

    def momentum(self, xi: Vec) -> Vec:
        """The momentum of a site of its species.  xi : (dim,), its velocity."""
        return self.chosen(lambda k, one: lengthened(one.momentum(self.species.vector(k, xi)), xi))

    def hessian(self, xi: Vec) -> Mat:
        """The Hessian of the Lagrangian of a site of its species.  xi : (dim,), its velocity."""
        groups = self.species.groups
        return self.chosen(lambda k, one: widened(one.hessian(self.species.vector(k, xi)), groups[k].dim, len(xi), 1.0))

    def moved(self, mu: Vec, g: Any, formula: Callable[[Any, Any, Any, Any], Any]) -> Any:
        """The momentum and the element that formula(group, energy, mu, g) gives for the species of this
        site.
        """
        species = self.species

        def by_energy(k: int, one: Any) -> Any:
            parts = species.vector(k, mu), species.element(k, g)
            momentum, element = formula(species.groups[k], one, *parts)
            if species.alike:
                return momentum, element
            return (lengthened(momentum, mu), None if element is None else lengthened(entries(element), g))

        return self.chosen(by_energy)
